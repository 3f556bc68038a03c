"""Settings files: what differs from the defaults, as TOML in the user's configuration folder. No user data is lost.

Reading uses what is valid and reports the rest. Writing keeps comments and unknown keys where they are; before anything else would
be lost (a file that is no TOML, a value that is not allowed, a change made meanwhile) the old file is kept as ``NAME.bad-<time>``.
"""

from __future__ import annotations

import os
import shutil
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import platformdirs
import tomlkit
from pydantic import ValidationError
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Table
from tomlkit.toml_document import TOMLDocument

from core.config.models import Config, ConfigError, load_config, merge
from core.config.schema import JOINTS, FieldKind, setting_at, settings_by_key, value_at
from core.config.section import plain_message
from core.files import write_atomic
from core.messages import message

UNKNOWN = "unknown key, kept but not used"
_TOO_MUCH = "too much is wrong"
_MOST_ROUNDS = 500


@dataclass(frozen=True, slots=True)
class SettingsFile:
    """A settings file as read.

    ``data`` is the valid part, as nested dictionaries; ``text`` the whole file, None where there was none; ``problems`` are lines.
    """

    path: Path
    data: dict[str, Any]
    text: str | None
    problems: tuple[str, ...] = ()

    @property
    def config(self) -> Config:
        """With the defaults for everything else."""
        return load_config(overrides=self.data)


def read_settings(path: Path, *, may_move: bool = True) -> SettingsFile:
    """The valid part of a settings file; a missing one is empty.

    A file that is no TOML is renamed at once (if `may_move`), so that a change does not overwrite it. Unknown keys and values
    that are not allowed are left out here and stay in the file.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
        data = tomllib.loads(text)
    except FileNotFoundError:
        return SettingsFile(path, {}, None)
    except OSError as error:
        return SettingsFile(
            path, {}, None, (message("{path}: cannot be read ({why}); the defaults are used", path=path, why=error.strerror),)
        )
    except (ValueError, RecursionError) as error:  # not TOMLDecodeError alone: a number of 5000 digits is another ValueError
        why = message("is no TOML ({why})", why=str(error).splitlines()[0] if str(error) else type(error).__name__)
        return SettingsFile(
            path,
            {},
            None,
            (_move_aside(path, why) if may_move else message("{path}: {why}; the defaults are used", path=path, why=why),),
        )
    data, problems = usable_part(data)
    return SettingsFile(path, data, text, tuple(f"{path}: {problem}" for problem in problems))


def aside_name(path: Path) -> Path:
    """A free name beside `path`, with the time."""
    stem = f"{path.name}.bad-{time.strftime('%Y%m%d-%H%M%S')}"
    names = (path.with_name(stem if k == 0 else f"{stem}-{k}") for k in range(10_000))
    return next(name for name in names if not name.exists())


def usable_part(data: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """The valid part of `data`, and a line for each part that is not valid."""
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
            elif key == "servos.driver":  # the default driver's packets are not for what is on this port
                data = {**data, "servos": {name: value for name, value in data["servos"].items() if name != "port"}}
                problems.append(f"{key}: {plain_message(first)}; no servo port is opened")
            else:
                problems.append(f"{key}: {plain_message(first)}; the default is used")
        else:
            return data, problems
    return {}, [*problems, f"{_TOO_MUCH}; the defaults are used"]


def _without(data: dict[str, Any], location: tuple[Any, ...]) -> tuple[dict[str, Any], str]:
    """`data` without the value at `location`, or without the innermost table around it that the file has."""
    if not location or location[0] not in data:
        return {}, "file"
    name, inner = str(location[0]), data[location[0]]
    if isinstance(inner, dict) and len(location) > 1 and location[1] in inner:
        rest, key = _without(inner, location[1:])
        return {**data, name: rest}, f"{name}.{key}"
    return {key: value for key, value in data.items() if key != name}, name


def _move_aside(path: Path, why: str) -> str:
    aside = aside_name(path)
    try:
        path.rename(aside)
    except OSError as error:
        return message(
            "{path}: {why}, and cannot be set aside ({trouble}); the defaults are used", path=path, why=why, trouble=error.strerror
        )
    return message("{path}: {why}; it is kept as {name}, and the defaults are used", path=path, why=why, name=aside.name)


_HEAD = "# LumenPilot's settings: only what differs from the defaults. Every key, its range and its meaning: core/config/models.py."


def write_settings(path: Path, config: Config, seen: str | None = None) -> str:
    """Write what differs from the defaults, atomically, also when the power goes; returns nothing, or where the old file is kept.

    The file is made if it is missing; a link is followed. `seen` is the text that it had when the change of `config` began;
    None: not read. Raises ConfigError: it cannot be written; the old one is as it was.
    """
    path = Path(os.path.realpath(path))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        old, note = _old_text(path, seen)
        text, is_lossless = settings_text(old, config)
        if not is_lossless and not note:
            note = _kept(path, "had values that are not allowed")
        write_atomic(path, text.encode("utf-8"), durable=True)
    except OSError as error:
        raise ConfigError("{path}: cannot be written ({why}); nothing was changed", path=path, why=error.strerror) from None
    return note


def settings_text(old: str, config: Config) -> tuple[str, bool]:
    """The text of a settings file for `config`, with comments, order and unknown keys as in its `old` text.

    And whether it is lossless: False when a value of a known key in `old` is not in it.
    """
    try:
        document = tomlkit.parse(old)
    except TOMLKitError:
        return _fresh(config), not old.strip()
    _, problems = usable_part(tomllib.loads(old))
    is_lossless = all(UNKNOWN in problem for problem in problems)
    if not old.strip():
        return _fresh(config), True
    _update(document, config)
    text = tomlkit.dumps(document)
    # rare forms (a table in three places, dotted keys) can break the edit: it is read back before it counts
    if _says(text, config, {problem for problem in problems if UNKNOWN in problem}):
        return text, is_lossless
    return _fresh(config), False


def changed_keys(first: Config, second: Config) -> tuple[str, ...]:
    """Dotted paths of all settings that differ."""
    one, other = first.model_dump(mode="json"), second.model_dump(mode="json")
    return tuple(key for key in settings_by_key() if setting_at(one, key) != setting_at(other, key))


def _old_text(path: Path, seen: str | None) -> tuple[str, str]:
    """The file's text, empty where it cannot be edited, and a line when it had to be kept aside."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return "", ""
    try:
        text = data.decode("utf-8-sig")
        tomllib.loads(text)
    except (ValueError, RecursionError):
        return "", _kept(path, "was no TOML")
    note = _kept(path, "was changed meanwhile") if seen is not None and text != seen else ""
    return text, note


def _kept(path: Path, why: str) -> str:
    """Copy the old file beside itself."""
    aside = aside_name(path)
    shutil.copy2(path, aside)
    return message("{name} {why}: the old one is kept as {kept}", name=path.name, why=why, kept=aside.name)


def _says(text: str, config: Config, unknown: set[str]) -> bool:
    """Whether the text, read back, gives `config` and still has its unknown keys."""
    try:
        data, problems = usable_part(tomllib.loads(text))
    except ValueError:
        return False
    return load_config(overrides=data) == config and set(problems) == unknown


def _fresh(config: Config) -> str:
    document = tomlkit.document()
    document.add(tomlkit.comment(_HEAD.removeprefix("# ")))
    _update(document, config)
    return tomlkit.dumps(document)


def _update(document: TOMLDocument, config: Config) -> None:
    """Set in the document what differs from the default, and remove what is a default again."""
    said = document.unwrap()
    base, new = load_config().model_dump(mode="json"), config.model_dump(mode="json")
    for key, setting in settings_by_key().items():
        if key.startswith(JOINTS):
            continue
        value = value_at(new, key)
        if not _agrees(said, key, value, is_switch=setting.kind is FieldKind.SWITCH):
            if value == value_at(base, key):
                _drop(document, key.split("."))
            else:
                _put(document, key.split("."), value)
    joints = value_at(new, JOINTS)
    usable, _ = usable_part(said)
    is_said = load_config(overrides=usable).model_dump(mode="json")["servos"]["joints"] == joints
    if joints == value_at(base, JOINTS):
        if not is_said or "joints" not in usable.get("servos", {}):
            _drop(document, JOINTS.split("."))
    elif not is_said:
        _put_joints(document, joints)


def _agrees(said: dict[str, Any], key: str, value: Any, *, is_switch: bool) -> bool:
    """Whether the file has this value already; a whole number may stand for a number, but not for a switch."""
    try:
        found = value_at(said, key)
    except KeyError:
        return False
    return bool(found == value) and isinstance(found, bool) is is_switch


def _put(table: Any, parts: list[str], value: Any) -> None:
    name = parts[0]
    if len(parts) == 1:
        if value is not None:
            table[name] = value
        elif name in table:
            del table[name]
        return
    if not isinstance(table.get(name), dict):
        table[name] = tomlkit.table(is_super_table=len(parts) > 2)
    _put(table[name], parts[1:], value)


def _drop(table: Any, parts: list[str]) -> None:
    name = parts[0]
    if name not in table:
        return
    inner = table[name]
    if len(parts) > 1 and isinstance(inner, dict):
        _drop(inner, parts[1:])
        is_bare = isinstance(inner, Table) and not inner and "#" not in inner.as_string()
        if not is_bare:
            return
    del table[name]


def _put_joints(document: TOMLDocument, joints: list[dict[str, Any]]) -> None:
    """All seven; existing ones are edited, so that unknown keys and comments stay."""
    if not isinstance(document.get("servos"), dict):
        document["servos"] = tomlkit.table(is_super_table=True)
    servos: Any = document["servos"]
    old = servos.get("joints")
    if isinstance(old, AoT) and len(old) == len(joints):
        for table, joint in zip(old, joints, strict=True):
            for name, value in joint.items():
                if value is None:
                    table.pop(name, None)
                elif table.get(name) != value:
                    table[name] = value
        return
    tables = tomlkit.aot()
    for joint in joints:
        entry = tomlkit.table()
        entry.update({name: value for name, value in joint.items() if value is not None})
        tables.append(entry)
    servos["joints"] = tables


def settings_folder() -> Path:
    """The user's configuration folder; it need not exist."""
    return Path(platformdirs.user_config_dir("LumenPilot", appauthor=False))


def trigger_socket() -> Path:
    """Where the operator window takes triggers from other programs, in the user's runtime folder."""
    return Path(platformdirs.user_runtime_dir("LumenPilot", appauthor=False)) / "triggers.sock"


def own_settings_path() -> Path:
    """The settings of the windows when no other file is named."""
    return settings_folder() / "settings.toml"


def settings_of_windows(named: Path | None = None) -> SettingsFile:
    """The settings that a window starts with and its dialog writes: of a named file, which is never moved, else the user's own."""
    return read_settings(named or own_settings_path(), may_move=named is None)


def own_config() -> Config:
    """The user's own configuration, for a window that cannot change it; no file is touched."""
    return read_settings(own_settings_path(), may_move=False).config
