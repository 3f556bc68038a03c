"""Settings while they are edited: every entry is checked as it is typed, and nothing acts before it is allowed. No Qt here."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

from pydantic import ValidationError

from app.ui.i18n import tr, tr_text
from core.config.files import changed_keys
from core.config.models import Config, load_config
from core.config.rig_file import sections_of_rig
from core.config.safety import JOINT_NAMES, JointKind
from core.config.schema import JOINTS, Effect, FieldKind, Section, Setting, schema, setting_at, settings_by_key, with_value

_SEPARATORS = re.compile(r"[\s_.,]+")


class SettingsDraft:
    """A configuration under edit. What the running rig keeps in a file of its own is shown as it is there, and not edited.

    Parameters
    ----------
    saved : what the settings file says.
    """

    def __init__(self, saved: Config) -> None:
        self.default = load_config()
        self.saved = saved
        self._defaults = _flat(self.default.model_dump(mode="json"))
        self._data = saved.model_dump(mode="json")
        self._saved_values = self._values = _flat(self._data)
        self._config: Config | None = saved
        self._entries: dict[str, str] = {}
        self._errors: dict[str, str] = {}
        self._section_errors: dict[str, str] = {}
        self.rig_file = ""
        self._kept: frozenset[str] = frozenset()
        self._in_force: dict[str, Any] = {}
        self._of_rig: Config | None = None

    def show_rig(self, running: Config) -> None:
        """Show what is in force where the rig file of the running configuration keeps it; edits there are dropped."""
        self.rig_file = running.rig.file or ""
        self._kept = sections_of_rig(running, self.saved)
        self._of_rig = running if "servos" in self._kept else None
        self._in_force = {key: value for key, value in _flat(running.model_dump(mode="json")).items() if self.is_kept(key)}
        for key in self._in_force:
            self._drop_entry(key)
        self._set_data(self._data, kept=self.saved.model_dump(mode="json"))

    # ---- values

    @property
    def config(self) -> Config | None:
        """The configuration as edited, None while anything in it is not allowed."""
        return self._config if not self._errors and not self._section_errors else None

    def value(self, key: str) -> Any:
        """The last allowed value of a setting; of one that the rig file keeps, the one in force."""
        return self._in_force[key] if key in self._in_force else self._values[key]

    def is_kept(self, key: str) -> bool:
        """Whether the rig file keeps a setting, or a section."""
        return key.partition(".")[0] in self._kept

    def title(self, section: Section) -> str:
        """As it is shown. A joint has the name that it has in the robot; "" for one that it does not have.

        Nor is a rotation shown, which is in degrees: its values stand in the rig file only.
        """
        part, _, place = section.key.rpartition(".")
        if part != JOINTS:
            return tr(section.title)
        joints = (self._of_rig or self._config or self.saved).servos.joints[int(place) : int(place) + 1]
        if not joints or joints[0].kind is JointKind.ROTATION:
            return ""
        name = joints[0].name
        return tr(section.title) if name == JOINT_NAMES[int(place)] else tr("Joint {name}", name=name.replace("_", " "))

    def default_value(self, key: str) -> Any:
        return self._defaults[key]

    def entry(self, key: str) -> str:
        """The text of the field: exactly as typed ("12." is the beginning of a decimal), or the value."""
        return self._entries.get(key, as_text(self.value(key)))

    def is_changed(self, key: str) -> bool:
        """Whether it differs from the default."""
        return key in self._errors or self.value(key) != self.default_value(key)

    def changed_in(self, section: Section) -> int:
        """How many settings of a section, those within included, differ from the default."""
        return sum(self.is_changed(setting.key) for setting in section.all_settings())

    @property
    def is_dirty(self) -> bool:
        """Whether anything is to be saved, or stands there that cannot be."""
        return bool(self._errors or self._section_errors) or self._values != self._saved_values

    def effects(self) -> set[Effect]:
        """When what differs from the saved settings begins to act."""
        return {settings_by_key()[key].effect for key in self.unsaved_keys()}

    def unsaved_keys(self) -> tuple[str, ...]:
        return tuple(key for key, value in self._values.items() if value != self._saved_values[key])

    # ---- errors

    def error(self, key: str) -> str:
        """One clear message for an entry, empty when it is allowed."""
        return self._errors.get(key, "")

    def section_error(self, section_key: str) -> str:
        """What does not go together in a section."""
        return self._section_errors.get(section_key, "")

    def is_wrong_in(self, section: Section) -> bool:
        return any(part.key in self._section_errors for part in section.walk()) or any(
            setting.key in self._errors for setting in section.all_settings()
        )

    @property
    def first_problem(self) -> tuple[str, str] | None:
        """Key (of a setting or a section) and message of the first problem."""
        return next(iter((self._errors | self._section_errors).items()), None)

    # ---- edits

    def set_entry(self, key: str, entry: object) -> str:
        """Enter what was typed or chosen; returns the message, empty when it is allowed."""
        value, message = parse(settings_by_key()[key], entry)
        if not message:
            candidate = with_value(self._data, key, value)
            message = _own_message(candidate, key)
            if not message:
                self._data = candidate
        self._entries[key] = as_text(entry)
        if message:
            self._errors[key] = message
        else:
            self._errors.pop(key, None)
        self._check_sections()
        return message

    def reset(self, keys: Iterable[str]) -> None:
        """Put settings back to their defaults, together: half of them might not go with the other half."""
        for key in keys:
            if self.is_kept(key):
                continue
            self._drop_entry(key)
            self._data = with_value(self._data, key, self.default_value(key))
        self._check_sections()

    def load(self, config: Config) -> None:
        """Replace the whole configuration."""
        self._entries.clear()
        self._errors.clear()
        self._set_data(config.model_dump(mode="json"), kept=self._data)

    def mark_saved(self) -> None:
        """What is edited is what the file says now."""
        if self.config is not None:
            self.saved, self._saved_values = self.config, self._values

    def _set_data(self, data: dict[str, Any], kept: dict[str, Any]) -> None:
        """`data`, except for the sections that the rig file keeps: those stay as in `kept`, the settings file."""
        self._data = {**data, **{name: kept[name] for name in self._kept}}
        self._check_sections()

    def _drop_entry(self, key: str) -> None:
        self._entries.pop(key, None)
        self._errors.pop(key, None)

    def _check_sections(self) -> None:
        """Each entry is allowed by itself; do they go together?"""
        self._values, self._section_errors = _flat(self._data), {}
        try:
            self._config = Config.model_validate(self._data)
        except ValidationError as error:
            for found in error.errors():
                key = ".".join(str(part) for part in found["loc"])
                self._section_errors.setdefault(key, _sentence(found["msg"]))


def _flat(data: dict[str, Any]) -> dict[str, Any]:
    """All settings by key."""
    return {key: setting_at(data, key) for key in settings_by_key()}


def parse(setting: Setting, entry: object) -> tuple[Any, str]:
    """The value of an entry, and why it is not allowed (empty when it is)."""
    if setting.kind is FieldKind.SWITCH:
        return bool(entry), ""
    if setting.kind is FieldKind.CHOICE:
        return (entry, "") if entry in setting.choices else (None, tr("must be one of: {range}", range=tr_text(setting.range_text)))
    text = as_text(entry).strip()
    if not text:
        return (None, "") if setting.is_optional else (None, tr("must not be empty{allowed}", allowed=_wanted(setting)))
    if setting.kind is FieldKind.TEXT:
        return text, ""
    if text.count(",") == 1 and "." not in text:
        text = text.replace(",", ".")
    try:
        value = float(text)
    except ValueError:
        return None, tr("not a number{allowed}", allowed=_wanted(setting))
    if not math.isfinite(value):
        return None, tr("not a finite number{allowed}", allowed=_wanted(setting))
    if setting.kind is FieldKind.WHOLE and not value.is_integer():
        return None, tr("must be a whole number{allowed}", allowed=_wanted(setting))
    bounds = setting.bounds
    is_low = bounds.low is not None and (value <= bounds.low if bounds.low_open else value < bounds.low)
    is_high = bounds.high is not None and (value >= bounds.high if bounds.high_open else value > bounds.high)
    if is_low or is_high:
        return None, tr("must be {range}", range=tr_text(setting.range_text))
    return int(value) if setting.kind is FieldKind.WHOLE else value, ""


def _wanted(setting: Setting) -> str:
    return tr("; allowed: {range}", range=tr_text(setting.range_text)) if setting.range_text else ""


def _own_message(data: dict[str, Any], key: str) -> str:
    """What pydantic reports about this entry itself (a pattern, a length), not about what does not go together."""
    try:
        Config.model_validate(data)
    except ValidationError as error:
        for found in error.errors():
            if ".".join(str(part) for part in found["loc"]) == key:
                if found["type"] == "string_pattern_mismatch":
                    return tr("has not the right form: {description}", description=tr(settings_by_key()[key].description))
                return _sentence(found["msg"])
    return ""


def _sentence(message: str) -> str:
    return tr_text(message.removeprefix("Value error, "))


def as_text(value: object) -> str:
    """As it stands in a field: 6 for 6.0, nothing for None."""
    if value is None:
        return ""
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
    return str(value)


def search(words: str) -> list[tuple[Section, list[Setting]]]:
    """Settings that have all the words in name, title, description, unit or their section's title, by section."""
    wanted = [word for word in _SEPARATORS.split(words.casefold()) if word]
    found = []
    for section in schema().walk():
        hits = [setting for setting in section.settings if all(word in _searched(section, setting) for word in wanted)]
        if hits and wanted:
            found.append((section, hits))
    return found


def _searched(section: Section, setting: Setting) -> str:
    shown = (section.title, setting.title, setting.description)
    parts = (*shown, *(tr(text) for text in shown), setting.key.replace(".", " "), setting.unit, setting.range_text)
    return " ".join(parts).casefold()


def with_changes(running: Config, before: Config, after: Config, effects: frozenset[Effect], since: Config | None = None) -> Config:
    """`running` with the differences from `before` to `after` whose effect is in `effects`.

    What `running` has from elsewhere (a command line, a picker) stays, and so does what has changed in it since it was `since`, and
    what its rig file keeps. Where the result is not allowed, it is `running` as it was; the settings then act at the next start.
    """
    data, new = running.model_dump(mode="json"), after.model_dump(mode="json")
    settings, kept = settings_by_key(), sections_of_rig(running, after)
    old = since.model_dump(mode="json") if since is not None else data
    newer = {key for key in changed_keys(before, after) if setting_at(old, key) != setting_at(data, key)}
    for key in changed_keys(before, after):
        if settings[key].effect in effects and key.partition(".")[0] not in kept and key not in newer:
            data = with_value(data, key, setting_at(new, key))
    try:
        return Config.model_validate(data)
    except ValidationError:
        return running
