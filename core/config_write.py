"""Settings files: what differs from the defaults, as TOML. Nothing that a user wrote is ever lost.

Comments and unknown keys stay where they are. Before anything else would be lost (a file that is no TOML, a value that is not
allowed, a change that somebody else made meanwhile) the old file is kept beside the new one, as ``NAME.bad-<time>``.
"""

from __future__ import annotations

import os
import shutil
import tomllib
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Table
from tomlkit.toml_document import TOMLDocument

from core.config import Config, ConfigError, load_config
from core.config_schema import JOINTS, Kind, settings_by_key, value_at
from core.settings_file import UNKNOWN, aside_name, usable_part
from core.whole_file import write_whole

_HEAD = "# LumenPilot's settings: only what differs from the defaults. Every key, its range and its meaning: core/config.py."


def write_settings(path: Path, config: Config, seen: str | None = None) -> str:
    """Write what differs from the defaults; whenever the process or the power goes, the old or the new file is there.

    Parameters
    ----------
    path : the file, made if it is missing; a link is followed.
    config : what the file is to say.
    seen : the text that the file had when `config` was begun; None: nobody looked.

    Returns
    -------
    str
        Empty, or one line about where the old file is kept.

    Raises
    ------
    ConfigError
        The file cannot be written; the old one is as it was.
    """
    path = Path(os.path.realpath(path))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        old, note = _old_text(path, seen)
        text, is_lossless = settings_text(old, config)
        if not is_lossless and not note:
            note = _kept(path, "had values that are not allowed")
        write_whole(path, text.encode("utf-8"), durable=True)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written ({error.strerror}); nothing was changed") from None
    return note


def settings_text(old: str, config: Config) -> tuple[str, bool]:
    """The text of a settings file that says `config`, made from its `old` text.

    Returns
    -------
    text : comments, order and unknown keys as in `old`.
    is_lossless : False when `old` held something at a known place that nobody can read back from `text`.
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
    # Rare forms (a table in three places, dotted keys) can outwit the editor: what it wrote is read back before it counts.
    if _says(text, config, {problem for problem in problems if UNKNOWN in problem}):
        return text, is_lossless
    return _fresh(config), False


def changed_keys(first: Config, second: Config) -> tuple[str, ...]:
    """Dotted paths of all settings that differ."""
    one, other = first.model_dump(mode="json"), second.model_dump(mode="json")
    return tuple(key for key in settings_by_key() if value_at(one, key) != value_at(other, key))


def _old_text(path: Path, seen: str | None) -> tuple[str, str]:
    """The file's text, empty where there is none that can be edited, and a line when it had to be set aside."""
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
    return f"{path.name} {why}: the old one is kept as {aside.name}"


def _says(text: str, config: Config, unknown: set[str]) -> bool:
    """Whether the text, read back, means `config` and still has its unknown keys."""
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
    """Make the document say `config`: what differs from the default is set, what is a default again goes out of it."""
    said = document.unwrap()
    base, new = load_config().model_dump(mode="json"), config.model_dump(mode="json")
    for key, setting in settings_by_key().items():
        if key.startswith(JOINTS):
            continue
        value = value_at(new, key)
        if not _agrees(said, key, value, is_switch=setting.kind is Kind.SWITCH):
            if value == value_at(base, key):
                _drop(document, key.split("."))
            else:
                _put(document, key.split("."), value)
    joints = value_at(new, JOINTS)
    usable, _ = usable_part(said)
    is_said = load_config(overrides=usable).model_dump(mode="json")["servos"]["joints"] == joints
    if joints == value_at(base, JOINTS):
        if not is_said or not _is_at(usable, JOINTS):
            _drop(document, JOINTS.split("."))
    elif not is_said:
        _put_joints(document, joints)


def _agrees(said: dict[str, Any], key: str, value: Any, *, is_switch: bool) -> bool:
    """Whether the file says so already; a whole number may stand for a number, but not for a switch."""
    if not _is_at(said, key):
        return False
    found = value_at(said, key)
    return bool(found == value) and isinstance(found, bool) is is_switch


def _is_at(data: dict[str, Any], key: str) -> bool:
    try:
        value_at(data, key)
    except KeyError:
        return False
    return True


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
    """All seven; those that stand there already are edited, so that unknown keys and comments stay."""
    if not isinstance(document.get("servos"), dict):
        document["servos"] = tomlkit.table(is_super_table=True)
    servos: Any = document["servos"]
    old = servos.get("joints")
    if isinstance(old, AoT) and len(old) == len(joints):
        for table, joint in zip(old, joints, strict=True):
            for name, value in joint.items():
                if table.get(name) != value:
                    table[name] = value
        return
    tables = tomlkit.aot()
    for joint in joints:
        entry = tomlkit.table()
        entry.update(joint)
        tables.append(entry)
    servos["joints"] = tables
