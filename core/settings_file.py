"""Reading settings files of the user: what can be used of them is used, what cannot is told and kept."""

from __future__ import annotations

import time
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from core.config import Config, load_config, merge

UNKNOWN = "unknown key, kept but not used"
_TOO_MUCH = "too much is wrong"
_MOST_ROUNDS = 500


@dataclass(frozen=True, slots=True)
class SettingsFile:
    """What a settings file says.

    ``data`` is what can be used, as nested dictionaries; ``text`` the file as it was read, None where there was none; ``problems``
    are one line each, for people.
    """

    path: Path
    data: dict[str, Any]
    text: str | None
    problems: tuple[str, ...] = ()

    @property
    def config(self) -> Config:
        """With the defaults where the file says nothing."""
        return load_config(overrides=self.data)


def read_settings(path: Path, *, may_move: bool = True) -> SettingsFile:
    """What can be used of a settings file; a missing one is empty.

    A file that is no TOML is set aside at once (unless it may not be moved), so that the next change does not overwrite it. Unknown
    keys and values that are not allowed are left out here and stay in the file.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
        data = tomllib.loads(text)
    except FileNotFoundError:
        return SettingsFile(path, {}, None)
    except OSError as error:
        return SettingsFile(path, {}, None, (f"{path}: cannot be read ({error.strerror}); the defaults are used",))
    except (ValueError, RecursionError) as error:  # not TOMLDecodeError alone: a number of 5000 digits is none
        why = f"is no TOML ({_first_line(error)})"
        return SettingsFile(path, {}, None, (_move_aside(path, why) if may_move else f"{path}: {why}; the defaults are used",))
    data, problems = usable_part(data)
    return SettingsFile(path, data, text, tuple(f"{path}: {problem}" for problem in problems))


def aside_name(path: Path) -> Path:
    """A free name beside `path`, with the time."""
    stem = f"{path.name}.bad-{time.strftime('%Y%m%d-%H%M%S')}"
    names = (path.with_name(stem if k == 0 else f"{stem}-{k}") for k in range(10_000))
    return next(name for name in names if not name.exists())


def usable_part(data: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """The part of `data` that is allowed, and a line for each part that is not."""
    problems: list[str] = []
    base = load_config().model_dump(mode="json")
    for _ in range(_MOST_ROUNDS):
        try:
            Config.model_validate(merge(base, data))
        except ValidationError as error:
            first: Any = error.errors()[0]
            data, key = _without(data, first["loc"])
            if first["type"] == "extra_forbidden":
                problems.append(f"{key}: {UNKNOWN}")
            else:
                problems.append(f"{key}: {_message(error)}; the default is used")
        else:
            return data, problems
    return {}, [*problems, f"{_TOO_MUCH}; the defaults are used"]


def _without(data: dict[str, Any], location: tuple[Any, ...]) -> tuple[dict[str, Any], str]:
    """`data` without what is at `location`, or without the nearest thing around it that the file does say."""
    if not location or location[0] not in data:
        return {}, "file"
    name, inner = str(location[0]), data[location[0]]
    if isinstance(inner, dict) and len(location) > 1 and location[1] in inner:
        rest, key = _without(inner, location[1:])
        return {**data, name: rest}, f"{name}.{key}"
    return {key: value for key, value in data.items() if key != name}, name


def _message(error: ValidationError) -> str:
    first: Any = error.errors()[0]
    return str(first["msg"]).removeprefix("Value error, ")


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def _move_aside(path: Path, why: str) -> str:
    aside = aside_name(path)
    try:
        path.rename(aside)
    except OSError as error:
        return f"{path}: {why}, and cannot be set aside ({error.strerror}); the defaults are used"
    return f"{path}: {why}; it is kept as {aside.name}, and the defaults are used"
