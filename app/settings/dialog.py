"""The settings dialog: the whole configuration, section by section, made from its models. STOP works while it is open.

Settings while they are edited: every entry is checked as it is typed, and nothing acts before it is allowed. No Qt here.

One setting: name, field, unit, what is allowed, what it means; checked as it is typed, marked where it is not the default.

Settings below each other: a section of the configuration, or what a search has found in several.

Profiles: choose one, save the settings under a name, delete one. Questions are asked in the row itself, never in a box.

Browse...: chooses the file or folder that a setting names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from PySide6.QtCore import QPoint, QRectF, QSignalBlocker, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QCloseEvent, QColor, QKeyEvent, QKeySequence, QPainter, QPaintEvent, QPen, QShortcut, QWheelEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QFileDialog,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QMenu,
    QPushButton,
    QScrollArea,
    QSlider,
    QSplitter,
    QStackedLayout,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.operator.manual_drive import NUMBERS_ONLY
from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.widgets.basics import QuietCombo, takes_enter
from app.widgets.messages import QuestionStrip
from core.config.files import Profile, ProfileError, Profiles, changed_keys
from core.config.models import RESOURCES, Config, load_config
from core.config.rig_file import rigs_folder, sections_of_rig
from core.config.schema import Effect, FieldKind, Section, Setting, schema, settings_by_key, value_at, with_value
from core.files import VIDEO_ENDINGS

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

    def show_rig(self, running: Config) -> None:
        """Say what is in force where the rig file of the running configuration keeps it; edits there are dropped."""
        self.rig_file = running.rig.file or ""
        self._kept = sections_of_rig(running, self.saved)
        self._in_force = {key: value for key, value in _flat(running.model_dump(mode="json")).items() if self.is_kept(key)}
        for key in self._in_force:
            self._forget_entry(key)
        self._take(self._data, kept=self.saved.model_dump(mode="json"))

    # ---- what is there

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

    def default_value(self, key: str) -> Any:
        return self._defaults[key]

    def entry(self, key: str) -> str:
        """What stands in the field: what was typed, to the letter, or the value. "12." is the beginning of a decimal."""
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
        settings = settings_by_key()
        return {settings[key].effect for key in self.unsaved_keys()}

    def unsaved_keys(self) -> tuple[str, ...]:
        return tuple(key for key, value in self._values.items() if value != self._saved_values[key])

    # ---- what is wrong

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
        for problems in (self._errors, self._section_errors):
            for key, message in problems.items():
                return key, message
        return None

    # ---- edits

    def set_entry(self, key: str, entry: object) -> str:
        """Take what was typed or chosen; returns the message, empty when it is allowed."""
        setting = settings_by_key()[key]
        text = entry if isinstance(entry, str) else as_text(entry)
        value, message = parse(setting, entry)
        if not message:
            candidate = with_value(self._data, key, value)
            message = _own_message(candidate, key)
            if not message:
                self._data = candidate
        self._entries[key] = text
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
            self._forget_entry(key)
            self._data = with_value(self._data, key, self.default_value(key))
        self._check_sections()

    def reset_section(self, section: Section) -> None:
        """A section and all within."""
        self.reset([setting.key for setting in section.all_settings()])

    def load(self, config: Config) -> None:
        """Take a whole configuration, of a profile."""
        self._entries.clear()
        self._errors.clear()
        self._take(config.model_dump(mode="json"), kept=self._data)

    def mark_saved(self) -> None:
        """What is edited is what the file says now."""
        if self.config is not None:
            self.saved, self._saved_values = self.config, self._values

    def _take(self, data: dict[str, Any], kept: dict[str, Any]) -> None:
        """All of `data` but for what the rig file keeps: of that, what the settings file says stays in it."""
        self._data = {**data, **{name: kept[name] for name in self._kept}}
        self._check_sections()

    def _forget_entry(self, key: str) -> None:
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
    return {key: value_at(data, key) for key in settings_by_key()}


def parse(setting: Setting, entry: object) -> tuple[Any, str]:
    """The value of an entry, and why it is none (empty when it is)."""
    if setting.kind is FieldKind.SWITCH:
        return bool(entry), ""
    if setting.kind is FieldKind.CHOICE:
        return (entry, "") if entry in setting.choices else (None, tr("must be one of: {range}", range=tr_text(setting.range_text)))
    text = as_text(entry).strip()
    if not text:
        return (None, "") if setting.is_optional else (None, tr("must not be empty{allowed}", allowed=_wanted(setting)))
    if setting.kind is FieldKind.TEXT:
        return text, ""
    return _number(setting, text)


def _number(setting: Setting, text: str) -> tuple[Any, str]:
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
    """What pydantic has against this entry itself (a pattern, a length); what does not go together is no matter of one entry."""
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
        hits = [setting for setting in section.settings if all(word in _haystack(section, setting) for word in wanted)]
        if hits and wanted:
            found.append((section, hits))
    return found


def _haystack(section: Section, setting: Setting) -> str:
    shown = (section.title, setting.title, setting.description)
    parts = (*shown, *(tr(text) for text in shown), setting.key.replace(".", " "), setting.unit, setting.range_text)
    return " ".join(parts).casefold()


def with_changes(running: Config, before: Config, after: Config, effects: frozenset[Effect], since: Config | None = None) -> Config:
    """`running` with those differences of two others that act then: what it has from elsewhere (a command line, a picker) stays.

    So does what has changed in it `since` it was so.

    What its rig file keeps stays, too: it would be gone at the next start of that rig.
    Where that does not go together it is `running` as it was; the settings then act at the next start of the program.
    """
    data, new = running.model_dump(mode="json"), after.model_dump(mode="json")
    settings, kept = settings_by_key(), sections_of_rig(running, after)
    old = since.model_dump(mode="json") if since is not None else data
    newer = {key for key in changed_keys(before, after) if value_at(old, key) != value_at(data, key)}
    for key in changed_keys(before, after):
        if settings[key].effect in effects and key.partition(".")[0] not in kept and key not in newer:
            data = with_value(data, key, value_at(new, key))
    try:
        return Config.model_validate(data)
    except ValidationError:
        return running


_VIDEOS = " ".join(f"*{ending}" for ending in (*VIDEO_ENDINGS, ".bag"))
_MODELS = RESOURCES / "models"


@dataclass(frozen=True, slots=True)
class PathRequest:
    """What a setting names. ``filter`` is for files; where `files` and `folders` are both True a menu asks which."""

    title: str
    files: bool = False
    folders: bool = False
    filter: str = mark("All files (*)")


WANTED = {
    "rig.source": PathRequest(
        mark("Pictures to play"),
        files=True,
        folders=True,
        filter=f"Videos and recordings ({_VIDEOS});;All files (*)",
    ),
    "rig.file": PathRequest(mark("Rig file"), files=True, filter=mark("Rigs (*.toml)")),
    "perception.segmentation.model": PathRequest(mark("Model folder"), folders=True),
    "window.pictures_folder": PathRequest(mark("Folder for snapshots"), folders=True),
    "record.folder": PathRequest(mark("Folder for sessions"), folders=True),
}
"""The settings that name a file or folder of the disk, by their keys."""


class BrowseButton(QPushButton):
    """``chosen`` has the path. The dialog leaves the window in reach, so that STOP is, too."""

    chosen = Signal(str)

    def __init__(self, key: str, title: str) -> None:
        super().__init__(tr("Browse..."))
        self._key, self._wanted = key, WANTED[key]
        self.dialog: QFileDialog | None = None
        self.entry = ""
        """What stands in the field: the dialog begins there."""
        self.setAccessibleName(tr("Browse for {title}", title=title))
        self.setToolTip(tr("{title}: choose it on the disk", title=tr(self._wanted.title)))
        if self._wanted.files and self._wanted.folders:
            menu = QMenu(self)
            menu.addAction(tr("&File..."), lambda: self.browse(folders=False))
            menu.addAction(tr("F&older..."), lambda: self.browse(folders=True))
            self.setMenu(menu)
        else:
            self.clicked.connect(lambda _on=False: self.browse(folders=self._wanted.folders))

    def browse(self, *, folders: bool) -> None:
        """Open the dialog."""
        if self.dialog is not None:
            self.dialog.raise_()
            return
        dialog = QFileDialog(self.window(), tr(self._wanted.title), str(self._start()))
        dialog.setOption(QFileDialog.Option.DontUseNativeDialog)
        if folders:
            dialog.setFileMode(QFileDialog.FileMode.Directory)
            dialog.setOption(QFileDialog.Option.ShowDirsOnly)
        else:
            dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
            dialog.setNameFilters(self._wanted.filter.split(";;"))
        dialog.fileSelected.connect(self._on_selected)
        dialog.finished.connect(self._on_finished)
        self.dialog = dialog
        dialog.show()  # not open(): nothing may cover STOP

    def _on_selected(self, path: str) -> None:
        chosen = Path(path)
        self.chosen.emit(chosen.name if chosen.parent == _MODELS else path)  # a shipped model goes by its name

    def _on_finished(self) -> None:
        dialog, self.dialog = self.dialog, None
        if dialog is not None:
            dialog.deleteLater()

    def _start(self) -> Path:
        """The nearest folder that is there."""
        usual = {"rig.file": rigs_folder(), "perception.segmentation.model": _MODELS}.get(self._key, Path.home())
        entry = Path(self.entry).expanduser() if "/" in self.entry else usual
        return next((path for path in (entry, *entry.parents) if path.is_dir()), Path.home())


_SLIDER_STEPS = 1000
_CURVED_FROM = 10.0
"""A range this much longer than the default is stretched at its lower end, or the slider could not be set finely there."""
_UNSET = mark("not set")
"""An empty field; its description says what that means."""
_NAME_PX, _FIELD_PX, _UNIT_PX = 132, 100, 46
_SLIDE_PX = (36, 18)


class SettingField(QFrame):
    """Shows what it is told and says what was typed; it decides nothing. ``edited`` has key and entry, ``reset_asked`` the key."""

    edited = Signal(str, object)
    reset_asked = Signal(str)

    def __init__(self, setting: Setting, default: Any) -> None:
        super().__init__()
        self.setting = setting
        self._default = default
        self._state: tuple[object, ...] = ()
        self.setObjectName("setting")
        self._name, self._error = QLabel(tr(setting.title)), QLabel()
        self._name.setObjectName("setting_name")
        self._name.setWordWrap(True)
        self._error.setObjectName("setting_error")
        self._error.setWordWrap(True)
        self.editor = self._make_editor()
        self.slider = self._make_slider()
        self.browse_button = BrowseButton(setting.key, tr(setting.title)) if setting.key in WANTED else None
        self.reset_button = QPushButton(tr("Reset"))
        self.reset_button.setToolTip(tr("Back to the default: {default}", default=self.default_text))
        self.reset_button.setAccessibleName(tr("Reset {title} to {default}", title=tr(setting.title), default=self.default_text))
        self.reset_button.clicked.connect(lambda _on=False: self.reset_asked.emit(setting.key))
        self._lay_out()

    @property
    def default_text(self) -> str:
        """The default with its unit."""
        if isinstance(self._default, bool):
            return tr("on") if self._default else tr("off")
        text = as_text(self._default)
        return _with_unit(text, tr_text(self.setting.unit)) if text else tr(_UNSET)

    @property
    def error_text(self) -> str:
        return self._error.text()

    @property
    def is_marked(self) -> bool:
        """Whether it is marked as different from the default."""
        return bool(self.property("changed"))

    def show_state(self, entry: str, value: Any, *, is_changed: bool, error: str) -> None:
        """What stands in the field, the last allowed value, and what is wrong with what stands there."""
        state = (entry, value, is_changed, error)
        if state == self._state:
            return
        self._state = state
        with QSignalBlocker(self.editor):
            if isinstance(self.editor, QCheckBox):
                self.editor.setChecked(bool(value))
                self.editor.setText(tr("on") if value else tr("off"))
            elif isinstance(self.editor, QuietCombo):
                self.editor.setCurrentIndex(self.editor.findData(value))
            elif self.editor.text() != entry:
                self.editor.setText(entry)
        if self.browse_button is not None:
            self.browse_button.entry = entry
        if self.slider is not None and value is not None and not self.slider.isSliderDown():
            with QSignalBlocker(self.slider):
                self.slider.setValue(self._place_of(float(value)))
        error = error.replace(" °", "°")
        self._error.setText(f"\N{WARNING SIGN}  {error}" if error else "")
        self._error.setVisible(bool(error))
        self.reset_button.setEnabled(is_changed)
        self._name.setText(f"\N{BLACK CIRCLE} {tr(self.setting.title)}" if is_changed else tr(self.setting.title))
        self.editor.setAccessibleDescription(f"{error}. {self._note()}" if error else self._note())
        if (bool(self.property("changed")), bool(self.property("wrong"))) != (is_changed, bool(error)):
            self.setProperty("changed", is_changed)
            self.setProperty("wrong", bool(error))
            self.editor.setProperty("wrong", bool(error))
            for widget in (self, self.editor):  # style sheets look at properties only when they are told to
                widget.style().unpolish(widget)
                widget.style().polish(widget)

    def take_focus(self) -> None:
        self.editor.setFocus()

    # ---- the editor

    def _make_editor(self) -> QCheckBox | QuietCombo | QLineEdit:
        setting = self.setting
        editor: QCheckBox | QuietCombo | QLineEdit
        if setting.kind is FieldKind.SWITCH:
            editor = _Switch()
            editor.toggled.connect(lambda on: self.edited.emit(setting.key, on))
        elif setting.kind is FieldKind.CHOICE:
            editor = QuietCombo(tr(setting.title), keeps_focus=True)
            for choice in setting.choices:
                editor.addItem(as_text(choice).replace("_", " "), choice)
            combo = editor
            combo.currentIndexChanged.connect(lambda _place: self.edited.emit(setting.key, combo.currentData()))
        else:
            editor = (
                QLineEdit()
                if setting.kind is FieldKind.TEXT
                else NumberEdit(is_whole=setting.kind is FieldKind.WHOLE, multiple=setting.bounds.step)
            )
            editor.setPlaceholderText(tr(_UNSET) if setting.is_optional else "")
            editor.textEdited.connect(lambda text: self.edited.emit(setting.key, text))
        editor.setAccessibleName(f"{tr(setting.title)}, {tr_text(setting.unit)}" if setting.unit else tr(setting.title))
        editor.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        return editor

    def _make_slider(self) -> QSlider | None:
        """For what acts at once, so that the picture can be watched meanwhile."""
        setting, bounds = self.setting, self.setting.bounds
        if setting.effect is not Effect.NOW or bounds.low is None or bounds.high is None:
            return None
        slider = _Slider(Qt.Orientation.Horizontal)
        slider.setRange(0, _SLIDER_STEPS)
        slider.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the field beside it has the arrows
        slider.setAccessibleName(tr("{title}, as a slider", title=tr(setting.title)))
        slider.valueChanged.connect(lambda place: self.edited.emit(setting.key, self._value_at(place)))
        return slider

    def _power(self) -> float:
        bounds = self.setting.bounds
        assert bounds.low is not None
        assert bounds.high is not None
        is_long = bounds.low >= 0 and bounds.high - bounds.low > _CURVED_FROM * max(float(self._default or 0), 1e-9)
        return 3.0 if is_long else 1.0

    def _value_at(self, place: int) -> str:
        """The value at a place of the slider, with no more digits than its step has."""
        bounds = self.setting.bounds
        assert bounds.low is not None
        assert bounds.high is not None
        span = bounds.high - bounds.low
        value = bounds.low + span * (place / _SLIDER_STEPS) ** self._power()
        if self.setting.kind is FieldKind.WHOLE:
            step = round(bounds.step or 1)
            return str(round(value / step) * step)
        inside = span / _SLIDER_STEPS / 10.0  # an end that is excluded is not offered
        value = max(value, bounds.low + inside * bounds.low_open)
        value = min(value, bounds.high - inside * bounds.high_open)
        digits = max(0, 2 - math.floor(math.log10(max(abs(value), span / 1e4, 1e-9))))
        text = f"{value:.{digits}f}".rstrip("0").rstrip(".") if digits else f"{value:.0f}"
        text = "0" if text in ("-0", "") else text
        is_out = (bounds.low_open and float(text) <= bounds.low) or (bounds.high_open and float(text) >= bounds.high)
        return f"{value:.6g}" if is_out else text

    def _place_of(self, value: float) -> int:
        bounds = self.setting.bounds
        assert bounds.low is not None
        assert bounds.high is not None
        share = max(0.0, min(1.0, (value - bounds.low) / (bounds.high - bounds.low)))
        return round(_SLIDER_STEPS * float(share ** (1.0 / self._power())))

    # ---- places

    def _lay_out(self) -> None:
        setting = self.setting
        unit, meaning = QLabel(tr_text(setting.unit)), QLabel(_capital(tr(setting.description)))
        note = QLabel(_together(self._note(), tr_text(setting.unit)))
        unit.setObjectName("setting_note")
        meaning.setObjectName("setting_meaning")
        note.setObjectName("setting_note")
        for label in (meaning, note):
            label.setWordWrap(True)
            label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._name.setFixedWidth(_NAME_PX)
        self._name.setBuddy(self.editor)
        self.setToolTip(setting.key)
        grid = QGridLayout(self)
        grid.setContentsMargins(12, 7, 10, 8)
        grid.setHorizontalSpacing(8)
        grid.setVerticalSpacing(2)
        grid.addWidget(self._name, 0, 0)
        if setting.kind is FieldKind.TEXT:
            row = QHBoxLayout()
            row.setSpacing(8)
            row.addWidget(self.editor, 1)
            if self.browse_button is not None:
                row.addWidget(self.browse_button)
                self.browse_button.chosen.connect(lambda path: self.edited.emit(setting.key, path))
            grid.addLayout(row, 0, 1, 1, 3)
        else:
            self.editor.setFixedWidth(_FIELD_PX if setting.kind is not FieldKind.CHOICE else _FIELD_PX + 50)
            unit.setMinimumWidth(_UNIT_PX)
            if setting.kind is FieldKind.CHOICE:
                grid.addWidget(self.editor, 0, 1, 1, 2, Qt.AlignmentFlag.AlignLeft)
            else:
                grid.addWidget(self.editor, 0, 1)
                grid.addWidget(unit, 0, 2)
            grid.addWidget(self.slider if self.slider is not None else QWidget(), 0, 3)
        grid.addWidget(self.reset_button, 0, 4)
        line = 1
        for label in (self._error, meaning, note):
            if label is self._error or label.text():
                grid.addWidget(label, line, 1, 1, 4)
                line += 1
        self._error.hide()
        grid.setColumnStretch(3, 1)

    def _note(self) -> str:
        parts = [tr("Default {default}", default=self.default_text)]
        if self.setting.range_text and self.setting.kind is not FieldKind.CHOICE:
            parts.append(tr("allowed {range}", range=tr_text(self.setting.range_text)))
        if self.setting.effect is not Effect.NOW:
            parts.append(tr(self.setting.effect.value))
        return "  \N{MIDDLE DOT}  ".join(parts)


class NumberEdit(QLineEdit):
    """A number as text; up and down change it by a step that fits its size, with Shift by ten of them."""

    def __init__(self, *, is_whole: bool, multiple: float | None = None) -> None:
        super().__init__()
        self._is_whole, self._multiple = is_whole, multiple
        self.setProperty(NUMBERS_ONLY, True)
        self.setAlignment(Qt.AlignmentFlag.AlignRight)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Up, Qt.Key.Key_Down):
            sign = 1 if event.key() == Qt.Key.Key_Up else -1
            self.step(sign * (10 if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1))
            return
        super().keyPressEvent(event)

    def step(self, steps: int) -> None:
        """So many steps up or down; what is no number stays as it is."""
        try:
            value = float(self.text().replace(",", "."))
        except ValueError:
            return
        if not math.isfinite(value):
            return
        if self._multiple is not None:
            self.setText(as_text((round(value / self._multiple) + steps) * self._multiple))
            self.textEdited.emit(self.text())
            return
        exponent = 0 if self._is_whole else math.floor(math.log10(abs(value))) - 1 if value else -2
        value = round(value / 10.0**exponent + steps) * 10.0**exponent
        self.setText(as_text(round(value, max(0, -exponent))))
        self.textEdited.emit(self.text())


class _Switch(QCheckBox):
    """A slide with its word. Enter turns it too: Space, which does it elsewhere, stops the robot."""

    def sizeHint(self) -> QSize:
        return QSize(_SLIDE_PX[0] + 12 + max(self.fontMetrics().horizontalAdvance(tr(word)) for word in ("on", "off")) + 8, 30)

    def hitButton(self, at: QPoint) -> bool:
        return self.rect().contains(at)

    def paintEvent(self, event: QPaintEvent) -> None:
        is_on, can = self.isChecked(), self.isEnabled()
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self.hasFocus():
            painter.setPen(QPen(QColor(theme.SKY), 1))
            painter.drawRoundedRect(QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5), 5, 5)
        width, height = _SLIDE_PX
        slide = QRectF(4, (self.height() - height) / 2, width, height)
        painter.setPen(QPen(QColor(theme.TEXT_FAINT if can else theme.LINE), 1.2))
        painter.setBrush(QColor(theme.SKY if is_on and can else theme.LINE if is_on else theme.WINDOW))
        painter.drawRoundedRect(slide, height / 2, height / 2)
        knob = QRectF(slide.right() - height if is_on else slide.left(), slide.top(), height, height).adjusted(4, 4, -4, -4)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.TEXT_FAINT if not can else theme.INK if is_on else theme.TEXT_DIM))
        painter.drawEllipse(knob)
        painter.setPen(QColor(theme.TEXT if can else theme.TEXT_FAINT))
        painter.setFont(theme.font())
        room = QRectF(slide.right() + 8, 0, self.width(), self.height())
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, self.text())
        painter.end()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter) and not event.isAutoRepeat():
            self.toggle()
            return
        super().keyPressEvent(event)


class _Slider(QSlider):
    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()  # it belongs to the page


def _with_unit(text: str, unit: str) -> str:
    """The sign of degrees stands at its number."""
    return f"{text}{unit}" if unit == "°" else f"{text} {unit}".strip()


def _together(text: str, unit: str) -> str:
    """No unit stands alone in a line."""
    return text.replace(f" {unit}", "°" if unit == "°" else f"\N{NO-BREAK SPACE}{unit}") if unit else text


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


MOST_FOUND = 40
"""Fields that are made for a search; more say nothing that a longer word would not."""
_AT_ONCE = 7

Group = tuple[Section, Sequence[Setting]]


class SettingPage(QScrollArea):
    """Shows groups of settings of a draft. ``edited`` carries key and entry, the others what is to be reset."""

    edited = Signal(str, object)
    reset_asked = Signal(str)
    section_reset_asked = Signal(object)

    def __init__(self, draft: SettingsDraft) -> None:
        super().__init__()
        self._draft = draft
        self.fields: dict[str, SettingField] = {}
        self._section_errors: dict[str, QLabel] = {}
        self._section_notes: dict[str, QLabel] = {}
        self._section_buttons: dict[str, tuple[Section, QPushButton]] = {}
        self._column: QVBoxLayout | None = None
        self._waiting: list[Section | Setting | str] = []
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self._add_some)
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setAccessibleName(tr("Settings of the section"))
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)

    def show_groups(self, groups: Sequence[Group], empty: str = "") -> None:
        """These instead of the ones before; `empty` is said when there are none.

        What is in sight is there at once, the rest comes bit by bit: a long section would keep the window busy for too long.
        """
        self.fields, self._section_errors, self._section_notes, self._section_buttons = {}, {}, {}, {}
        page = QWidget()
        page.setObjectName("setting_page")
        column = QVBoxLayout(page)
        column.setContentsMargins(14, 4, 12, 14)
        column.setSpacing(6)
        column.addStretch(1)
        self.setWidget(page)
        self._column = column
        self._waiting = _parts(groups, empty)
        self._add_some()
        self.verticalScrollBar().setValue(0)

    def renew(self) -> None:
        """Show the draft as it is now."""
        draft = self._draft
        for key, field in self.fields.items():
            field.show_state(draft.entry(key), draft.value(key), is_changed=draft.is_changed(key), error=draft.error(key))
            field.setEnabled(not draft.is_kept(key))
        for key, label in self._section_notes.items():
            label.setText(tr("Kept in the rig file {path}: change it there, or by menu Rig, Calibrate", path=draft.rig_file))
            label.setVisible(draft.is_kept(key))
        for key, label in self._section_errors.items():
            error = draft.section_error(key)
            label.setText(f"\N{WARNING SIGN}  {error}" if error else "")
            label.setVisible(bool(error))
        for section, button in self._section_buttons.values():
            count = draft.changed_in(section)
            button.setEnabled(count > 0 and not draft.is_kept(section.key))
            button.setText(tr("Reset section ({count})", count=count) if count else tr("Reset section"))

    def add_all(self) -> None:
        """Everything that has not come yet."""
        while self._waiting:
            self._add_some()

    def go_to(self, key: str) -> None:
        """Bring a setting into sight and give it the focus."""
        self.add_all()
        layout = self._column
        if layout is not None:
            layout.activate()
        field = self.fields.get(key)
        if field is not None:
            self.ensureWidgetVisible(field, 0, 60)
            field.take_focus()

    def _add_some(self) -> None:
        """The next few, above the stretch at the end."""
        for part in self._waiting[:_AT_ONCE]:
            if isinstance(part, Section):
                self._add_head(part)
            elif isinstance(part, Setting):
                self._add_field(part)
            else:
                label = QLabel(part)
                label.setObjectName("setting_meaning")
                self._add(label)
        del self._waiting[:_AT_ONCE]
        self.renew()
        self._make_room()
        if self._waiting:
            self._soon.start()

    def _make_room(self) -> None:
        """All that is there gets its height now: left to Qt it would be painted squeezed together once, and then pulled apart."""
        page, column = self.widget(), self._column
        assert column is not None
        for part in page.findChildren(QWidget):
            part.ensurePolished()
        column.activate()
        width = self.viewport().width()
        page.resize(width, max(self.viewport().height(), column.totalHeightForWidth(width)))

    def _add(self, part: QWidget) -> None:
        assert self._column is not None
        self._column.insertWidget(self._column.count() - 1, part)
        part.show()  # Qt does it later, and until then the column has no room for it

    def _add_head(self, section: Section) -> None:
        title, meaning = QLabel(tr(section.title)), QLabel(tr(section.description).replace("``", ""))
        note, error = QLabel(), QLabel()
        title.setObjectName("section_title")
        title.setIndent(0)
        for label, name in ((meaning, "setting_meaning"), (note, "setting_meaning"), (error, "setting_error")):
            label.setObjectName(name)
            label.setWordWrap(True)
        button = QPushButton(tr("Reset section"))
        button.setAccessibleName(tr("Reset section {title}", title=tr(section.title)))
        button.clicked.connect(lambda _on=False: self.section_reset_asked.emit(section))
        head = QWidget()
        row = QHBoxLayout(head)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(title)
        row.addStretch(1)
        row.addWidget(button)
        for widget in (head, meaning, note, error):
            self._add(widget)
        note.hide()
        error.hide()
        self._section_notes[section.key] = note
        self._section_errors[section.key] = error
        self._section_buttons[section.key] = (section, button)

    def _add_field(self, setting: Setting) -> None:
        field = SettingField(setting, self._draft.default_value(setting.key))
        field.edited.connect(self.edited)
        field.reset_asked.connect(self.reset_asked)
        self.fields[setting.key] = field
        self._add(field)


def _parts(groups: Sequence[Group], empty: str) -> list[Section | Setting | str]:
    """Heads, settings and a last word, in the order of the page."""
    parts: list[Section | Setting | str] = []
    left = MOST_FOUND if len(groups) > 1 else 10_000
    for section, settings in groups:
        if left > 0:
            parts += [section, *settings[:left]]
        left -= len(settings)
    said = empty if not groups else tr("{count} more: add a word", count=-left) if left < 0 else ""
    return [*parts, said] if said else parts


_OWN = mark("Own settings")


class ProfileRow(QWidget):
    """Asks only; ``chosen`` carries a profile, ``save_asked`` a name, ``delete_asked`` the profile that was confirmed."""

    chosen = Signal(object)
    save_asked = Signal(str)
    delete_asked = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.combo = QuietCombo(tr("Profile"), keeps_focus=True)
        self.combo.setMinimumWidth(190)
        self.combo.setToolTip(tr("Takes all settings from a profile; nothing is kept before you save"))
        self.save_button, self.delete_button = QPushButton(tr("Save as")), QPushButton(tr("Delete"))
        self.name = QLineEdit()
        self.name.setPlaceholderText(tr("Name of the profile; Enter saves, Esc does not"))
        self.name.setAccessibleName(tr("Name of the profile"))
        self.name.setMaxLength(60)
        self.question = QuestionStrip()
        self._profiles: tuple[Profile, ...] = ()
        self._lay_out()
        self.combo.activated.connect(self._on_activated)
        self.save_button.clicked.connect(self.begin_naming)
        self.delete_button.clicked.connect(self._ask_delete)
        self.name.returnPressed.connect(self._on_named)
        self.question.closed.connect(self.end_asking)

    def show_profiles(self, profiles: tuple[Profile, ...], current: Profile | None) -> None:
        """All there are, and the one that says exactly what is edited; None: none does."""
        self._profiles = profiles
        with QSignalBlocker(self.combo):
            self.combo.clear()
            self.combo.addItem(tr(_OWN), None)
            for profile in profiles:
                self.combo.addItem(tr("{name} (preset)", name=profile.name) if profile.is_preset else profile.name, profile.name)
        self.show_current(current)

    def show_current(self, current: Profile | None) -> None:
        with QSignalBlocker(self.combo):
            self.combo.setCurrentIndex(self._profiles.index(current) + 1 if current in self._profiles else 0)
        profile = self.profile
        self.delete_button.setEnabled(profile is not None and not profile.is_preset)
        self.delete_button.setToolTip("" if self.delete_button.isEnabled() else tr("Choose one of your own profiles first"))

    @property
    def profile(self) -> Profile | None:
        """The one that is chosen."""
        place = self.combo.currentIndex()
        return self._profiles[place - 1] if place > 0 else None

    @property
    def is_asking(self) -> bool:
        return self._stack.currentIndex() != 0

    def begin_naming(self) -> None:
        """Ask for a name."""
        profile = self.profile
        self.name.setText(profile.name if profile is not None and not profile.is_preset else "")
        self._stack.setCurrentWidget(self.name)
        self.name.setFocus()
        self.name.selectAll()

    def ask(self, question: str, answer: str, action: object) -> None:
        """A question in place of the row."""
        self._stack.setCurrentWidget(self.question)
        self.question.ask(question, answer, action)  # type: ignore[arg-type]

    def end_asking(self) -> None:
        """The row as it was."""
        self._stack.setCurrentIndex(0)

    def _on_activated(self, place: int) -> None:
        if place > 0:
            self.chosen.emit(self._profiles[place - 1])

    def _on_named(self) -> None:
        name = self.name.text()
        self.end_asking()
        self.save_asked.emit(name)

    def _ask_delete(self) -> None:
        profile = self.profile
        if profile is not None:
            self.ask(tr("Delete the profile {name}?", name=profile.name), tr("Delete"), lambda: self.delete_asked.emit(profile))

    def _lay_out(self) -> None:
        buttons = QWidget()
        row = QHBoxLayout(buttons)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(6)
        label = QLabel(tr("Profile"))
        label.setObjectName("card_title")
        row.addWidget(label)
        row.addWidget(self.combo, 1)
        row.addWidget(self.save_button)
        row.addWidget(self.delete_button)
        self._stack = QStackedLayout(self)
        for widget in (buttons, self.name, self.question):
            self._stack.addWidget(widget)
        self.setFixedHeight(36)


_SIZE = (900, 660)
_LEAST = (700, 420)
_SEARCH_AFTER_MS = 150
_ROW_PX = 26
_TREE_PX = 204
_MOST_SHARE, _MARGIN_PX = 0.57, 40
_KEY_ROLE = Qt.ItemDataRole.UserRole


class SettingsDialog(QDialog):
    """Edits a draft and says what is to become of it; it writes profiles, and leaves the settings file to its owner.

    ``drafted`` carries the configuration whenever it changes and is allowed, for the preview, ``save_asked`` whether the rig is to
    be started again. ``finished`` comes at the end. Whoever leaves with changes by Esc, which is meant for the field
    as often, is asked; Cancel and the window's cross ask nobody.

    Parameters
    ----------
    draft : what is edited.
    path : of the settings file, to be shown.
    profiles : the named ones.
    problems : what was wrong with the file, one line each.
    """

    drafted = Signal(object)
    save_asked = Signal(bool)

    def __init__(
        self,
        draft: SettingsDraft,
        path: Path,
        profiles: Profiles,
        problems: tuple[str, ...] = (),
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.draft, self._path, self._profiles = draft, path, profiles
        self._locked = ""
        self._running: Config | None = None
        self._section: Section = schema().sections[0]
        self.search = QLineEdit()
        self.tree = QTreeWidget()
        self.page = SettingPage(draft)
        self.profile_row = ProfileRow()
        self.status, self.notice = QLabel(), QLabel()
        self.question = QuestionStrip()
        """Of leaving, in place of the state of the settings."""
        self.reset_all, self.cancel = QPushButton(tr("Reset all")), QPushButton(tr("Cancel"))
        self.save, self.save_and_restart = QPushButton(tr("Save")), QPushButton(tr("Save, and start the rig again"))
        self._items: dict[str, QTreeWidgetItem] = {}
        self._search_soon = QTimer(self)
        self._search_soon.setSingleShot(True)
        self._search_soon.setInterval(_SEARCH_AFTER_MS)
        self.setObjectName("settings")
        self.setWindowTitle(tr("LumenPilot \N{EM DASH} settings"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._lay_out()
        self._fill_tree()
        self._wire()
        self._show_profiles()
        self.show_notice("\n".join(map(tr_text, problems)), is_fault=True)
        self.show_section(self._section)
        self.setMinimumSize(*_LEAST)
        self.resize(*_SIZE)

    # ---- what is shown

    def show_section(self, section: Section) -> None:
        """The settings of a section; of one that only holds others, those too."""
        self._section = section
        groups = [(section, section.settings)] if section.settings else [(part, part.settings) for part in section.sections]
        self.page.show_groups(groups)
        item = self._items.get(section.key)
        if item is not None and self.tree.currentItem() is not item:
            self.tree.setCurrentItem(item)
        self._renew()

    def stand_beside(self, window: QWidget, kept_clear: QWidget) -> None:
        """At the right edge of a window, so that its picture stays in sight as far as can be, and `kept_clear` (STOP) wholly."""
        frame = window.frameGeometry()
        width = max(_LEAST[0], min(_SIZE[0], round(frame.width() * _MOST_SHARE)))
        top = frame.top() + _MARGIN_PX
        room = kept_clear.mapToGlobal(QPoint(0, 0)).y() - top - _MARGIN_PX
        self.resize(width, max(_LEAST[1], min(_SIZE[1], room)))
        self.move(frame.right() - width - 10, top)

    def go_to(self, key: str) -> None:
        """Show a setting, or a section, and give it the focus."""
        sections = {section.key: section for section in schema().walk()}
        section = sections.get(key) or sections.get(key.rpartition(".")[0])
        if section is None:
            return
        self.page.add_all()
        if key not in self.page.fields:
            self.search.clear()
            self._search_soon.stop()
            self.show_section(section)
        self.page.go_to(key)

    def show_notice(self, text: str, *, is_fault: bool = False) -> None:
        """A line above the settings: what was wrong with the file, what could not be done."""
        self.notice.setText(f"\N{WARNING SIGN}  {text}" if text and is_fault else text)
        self.notice.setObjectName("setting_error" if is_fault else "setting_meaning")
        self.notice.style().unpolish(self.notice)
        self.notice.style().polish(self.notice)
        self.notice.setVisible(bool(text))

    def follow_theme(self) -> None:
        self.status.setText("")  # a link keeps the colour that it was laid out with
        self._renew()

    def lock(self, why: str) -> None:
        """Nothing can be changed for this reason; empty: it can be again."""
        if why != self._locked:
            self._locked = why
            for widget in (self.page, self.profile_row, self.reset_all):
                widget.setEnabled(not why)
            self._renew()

    def show_rig(self, running: Config) -> None:
        """What the rig file of the running configuration keeps is shown as it is in force, and is not changed here."""
        if running is not self._running:
            self._running = running
            self.draft.show_rig(running)
            self._renew()

    # ---- edits

    def _on_edited(self, key: str, entry: object) -> None:
        self.draft.set_entry(key, entry)
        self._changed()

    def _on_reset(self, key: str) -> None:
        self.draft.reset([key])
        self._changed()

    def _on_section_reset(self, section: Section) -> None:
        self.draft.reset_section(section)
        self._changed()

    def _ask_reset_all(self) -> None:
        self.profile_row.ask(tr("Put all settings back to their defaults?"), tr("Reset all"), self._reset_everything)

    def _reset_everything(self) -> None:
        self.draft.load(self.draft.default)
        self._changed()

    def _changed(self) -> None:
        self._renew()
        self.profile_row.show_current(self._profiles.matching(self.draft.config) if self.draft.config is not None else None)
        if self.draft.config is not None:
            self.drafted.emit(self.draft.config)

    def _renew(self) -> None:
        """Fields, marks, the line below and the buttons, as the draft is."""
        self.page.renew()
        for section in schema().walk():
            if section.key:
                count, is_wrong = self.draft.changed_in(section), self.draft.is_wrong_in(section)
                mark = "\N{WARNING SIGN}" if is_wrong else f"\N{BLACK CIRCLE} {count}" if count else ""
                item = self._items[section.key]
                if item.text(1) == mark and item.toolTip(0):
                    continue
                item.setText(1, mark)
                words = (
                    tr("something is not allowed")
                    if is_wrong
                    else tr("{count} differ from the default", count=count)
                    if count
                    else tr("as by default")
                )
                item.setToolTip(0, f"{section.key}: {words}")
                item.setData(0, Qt.ItemDataRole.AccessibleTextRole, f"{tr(section.title)}, {words}")
        effects = self.draft.effects()
        may_save = not self._locked and self.draft.config is not None and self.draft.is_dirty
        self.save.setEnabled(may_save)
        self.save_and_restart.setVisible(Effect.RIG in effects)
        self.save_and_restart.setEnabled(may_save)
        self.reset_all.setEnabled(not self._locked and any(map(self._can_reset, settings_by_key())))
        self.status.setText(self._status(effects))

    def _can_reset(self, key: str) -> bool:
        return self.draft.is_changed(key) and not self.draft.is_kept(key)

    def _status(self, effects: set[Effect]) -> str:
        if self._locked:
            return f"\N{WARNING SIGN}  {self._locked}"
        problem = self.draft.first_problem
        if problem is not None:
            return f'\N{WARNING SIGN}  <a href="{problem[0]}">{_shown_name(problem[0])}</a>: {problem[1].replace(" °", "°")}'
        if not self.draft.is_dirty:
            return tr("Saved in {path}", path=self._path)
        count = len(self.draft.unsaved_keys())
        parts = [tr("{count} not saved", count=count)]
        if Effect.NOW in effects:
            parts.append(tr("the picture shows it already; Cancel puts it back"))
        if Effect.RIG in effects:
            parts.append(tr("some act when the rig is started again"))
        if Effect.PROGRAM in effects:
            parts.append(tr("some at the next start of the program"))
        return "; ".join(parts)

    # ---- searching

    def _run_search(self) -> None:
        words = self.search.text().strip()
        if not words:
            self.show_section(self._section)
            return
        self.tree.clearSelection()
        self.page.show_groups(search(words), tr("Nothing has {words} in its name, meaning or unit", words=words))

    def _on_tree(self) -> None:
        item = self.tree.currentItem()
        if item is None or not item.isSelected():
            return
        key = item.data(0, _KEY_ROLE)
        section = next(section for section in schema().walk() if section.key == key)
        self.search.clear()
        self._search_soon.stop()
        self.show_section(section)

    # ---- profiles

    def _show_profiles(self) -> None:
        config = self.draft.config
        self.profile_row.show_profiles(self._profiles.all(), self._profiles.matching(config) if config is not None else None)

    def _choose_profile(self, profile: Profile) -> None:
        try:
            file = self._profiles.load(profile)
        except ProfileError as error:
            self.show_notice(tr_text(str(error)), is_fault=True)
        else:
            self.draft.load(file.config)
            self.show_notice("\n".join(map(tr_text, file.problems)), is_fault=True)
        self._show_profiles()
        self._changed()

    def _ask_save_profile(self, name: str) -> None:
        if self._profiles.exists(name):
            self.profile_row.ask(
                tr("There is a profile {name} already. Replace it?", name=name), tr("Replace"), partial(self._save_profile, name)
            )
        else:
            self._save_profile(name)

    def _save_profile(self, name: str) -> None:
        config = self.draft.config
        if config is None:
            self.show_notice(tr("First mend what is not allowed"), is_fault=True)
            return
        self._do(lambda: self._profiles.save(name, config)[1] or tr("Saved as profile {name}", name=name))

    def _delete_profile(self, profile: Profile) -> None:
        def delete() -> str:
            self._profiles.delete(profile)
            return tr("Profile {name} deleted", name=profile.name)

        self._do(delete)

    def _do(self, action: Callable[[], str]) -> None:
        """Do something with a profile and say how it went."""
        try:
            self.show_notice(tr_text(action()))
        except ProfileError as error:
            self.show_notice(tr_text(str(error)), is_fault=True)
        self._show_profiles()

    # ---- keys

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if takes_enter(self, event):
            return
        if event.key() != Qt.Key.Key_Escape:
            super().keyPressEvent(event)
        elif not event.isAutoRepeat():
            self._on_escape()

    def closeEvent(self, event: QCloseEvent) -> None:
        self.reject()  # asks nobody: what refuses to be closed would keep the program from ending, too
        super().closeEvent(event)

    def ask_to_leave(self) -> None:
        """Close the dialog; with something changed and not saved only after a question."""
        if not self.draft.is_dirty:
            self.reject()
        elif not self.question.text:
            self._show_question(True)
            self.question.ask(tr("Leave without saving the changes?"), tr("Leave"), self.reject)

    def _on_escape(self) -> None:
        """Back by one step: a question, the search, the dialog."""
        if self.question.text:
            self.question.cancel()
        elif self.profile_row.is_asking:
            self.profile_row.question.cancel()
            self.profile_row.end_asking()
        elif self.search.text():
            self.search.clear()
        else:
            self.ask_to_leave()

    def _show_question(self, on: bool) -> None:
        """In place of the state and of Cancel: the question has one of its own, which goes on with the dialog."""
        self.question.setVisible(on)
        for part in (self.status, self.reset_all, self.cancel):
            part.setVisible(not on)

    # ---- places

    def _wire(self) -> None:
        self.search.textChanged.connect(lambda _text: self._search_soon.start())
        self._search_soon.timeout.connect(self._run_search)
        self.tree.itemSelectionChanged.connect(self._on_tree)
        self.page.edited.connect(self._on_edited)
        self.page.reset_asked.connect(self._on_reset)
        self.page.section_reset_asked.connect(self._on_section_reset)
        self.profile_row.chosen.connect(self._choose_profile)
        self.profile_row.save_asked.connect(self._ask_save_profile)
        self.profile_row.delete_asked.connect(self._delete_profile)
        self.status.linkActivated.connect(self.go_to)
        self.question.closed.connect(lambda: self._show_question(False))
        self.reset_all.clicked.connect(lambda _on=False: self._ask_reset_all())
        self.cancel.clicked.connect(lambda _on=False: self.reject())
        self.save.clicked.connect(lambda _on=False: self.save_asked.emit(False))
        self.save_and_restart.clicked.connect(lambda _on=False: self.save_asked.emit(True))
        QShortcut(QKeySequence.StandardKey.Find, self).activated.connect(self.search.setFocus)

    def _fill_tree(self) -> None:
        def add(parent: QTreeWidget | QTreeWidgetItem, section: Section) -> None:
            item = QTreeWidgetItem(parent, [tr(section.title), ""])
            item.setData(0, _KEY_ROLE, section.key)
            item.setSizeHint(0, QSize(0, _ROW_PX))
            item.setTextAlignment(1, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            self._items[section.key] = item
            for part in section.sections:
                add(item, part)

        for section in schema().sections:
            add(self.tree, section)
        self._items["perception"].setExpanded(True)

    def _lay_out(self) -> None:
        self.search.setPlaceholderText(tr("Search name, meaning, unit  (Ctrl+F)"))
        self.search.setAccessibleName(tr("Search settings"))
        self.search.setClearButtonEnabled(True)
        self.tree.setColumnCount(2)
        self.tree.setHeaderHidden(True)
        self.tree.header().setStretchLastSection(False)
        self.tree.header().setMinimumSectionSize(0)
        self.tree.header().setSectionResizeMode(0, self.tree.header().ResizeMode.Stretch)
        self.tree.header().setSectionResizeMode(1, self.tree.header().ResizeMode.ResizeToContents)
        self.tree.setAccessibleName(tr("Sections"))
        self.tree.setIndentation(14)
        self.notice.setWordWrap(True)
        self.status.setWordWrap(True)
        self.status.setObjectName("setting_meaning")
        self.status.setAccessibleName(tr("State of the settings"))
        top = QHBoxLayout()
        top.setSpacing(20)
        top.addWidget(self.search, 2)
        top.addWidget(self.profile_row, 3)
        self.splitter = QSplitter(Qt.Orientation.Horizontal)
        self.splitter.addWidget(self.tree)
        self.splitter.addWidget(self.page)
        self.splitter.setChildrenCollapsible(False)
        self.splitter.setStretchFactor(1, 1)
        self.splitter.setSizes([_TREE_PX, _SIZE[0] - _TREE_PX])
        bottom = QHBoxLayout()
        bottom.setSpacing(8)
        bottom.addWidget(self.status, 1)
        bottom.addWidget(self.question, 1)
        self.question.hide()
        for button in (self.reset_all, self.cancel, self.save, self.save_and_restart):
            bottom.addWidget(button)
        for button in self.findChildren(QPushButton):
            button.setAutoDefault(False)
        self.save.setObjectName("main_button")
        column = QVBoxLayout(self)
        column.setContentsMargins(theme.GAP, theme.GAP, theme.GAP, theme.GAP)
        column.setSpacing(8)
        column.addLayout(top)
        column.addWidget(self.notice)
        column.addWidget(self.splitter, 1)
        column.addLayout(bottom)


def _shown_name(key: str) -> str:
    """What a setting or a section is called on the page."""
    setting = settings_by_key().get(key)
    section = next((one for one in schema().walk() if one.key == (key.rpartition(".")[0] if setting is not None else key)), None)
    return ", ".join(tr(one.title) for one in (section, setting) if one is not None and one.title)
