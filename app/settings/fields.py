"""The fields of the settings dialog, made from the schema: editor, unit, range, meaning, reset, and the marks of a changed one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PySide6.QtCore import QPoint, QRectF, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPaintEvent, QPen, QWheelEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QFileDialog,
    QFrame,
    QGridLayout,
    QLabel,
    QLineEdit,
    QMenu,
    QPushButton,
    QSlider,
    QWidget,
)

from app.operator.stop_keys import NUMBERS_ONLY
from app.settings.draft import as_text
from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.opening import ask_path
from app.widgets.basics import QuietCombo, line
from core.config.models import RESOURCES
from core.config.rig_file import rigs_folder
from core.config.schema import Effect, FieldKind, Setting
from core.files import VIDEO_ENDINGS

_VIDEOS = " ".join(f"*{ending}" for ending in VIDEO_ENDINGS)
_MODELS = RESOURCES / "models"


@dataclass(frozen=True, slots=True)
class PathRequest:
    """What a setting names. ``filter`` is for files; where ``files`` and ``folders`` are both True a menu asks which."""

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
    """Chooses the file or folder that a setting names; ``chosen`` carries the path. The dialog leaves STOP in reach."""

    chosen = Signal(str)

    def __init__(self, key: str, title: str) -> None:
        super().__init__(tr("Browse..."))
        self._key, self._wanted = key, WANTED[key]
        self.entry = ""
        """The text of the field: the dialog begins there."""
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
        mode = QFileDialog.FileMode.Directory if folders else QFileDialog.FileMode.ExistingFile
        filters = [] if folders else self._wanted.filter.split(";;")
        ask_path(self.window(), tr(self._wanted.title), self._start(), self._on_chosen, mode, filters, folders_only=folders)

    def _on_chosen(self, path: Path) -> None:
        self.chosen.emit(path.name if path.parent == _MODELS else str(path))  # a shipped model goes by its name

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


Editor = QCheckBox | QuietCombo | QLineEdit


class SettingField(QFrame):
    """One setting: name, field, unit, range and meaning, marked where it is wrong or not the default.

    ``edited`` carries key and entry, ``reset_asked`` the key.
    """

    edited = Signal(str, object)
    reset_asked = Signal(str)

    def __init__(self, setting: Setting, default: Any) -> None:
        super().__init__()
        self.setting = setting
        self._default = default
        self._state: tuple[object, ...] = ()
        self.setObjectName("setting")
        self._name, self.error = QLabel(tr(setting.title)), QLabel()
        self._name.setObjectName("setting_name")
        self._name.setWordWrap(True)
        self.error.setObjectName("setting_error")
        self.error.setWordWrap(True)
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
        if isinstance(self._default, bool):
            return tr("on") if self._default else tr("off")
        text = as_text(self._default)
        return _with_unit(text, tr_text(self.setting.unit)) if text else tr(_UNSET)

    def show_state(self, entry: str, value: Any, *, is_changed: bool, error: str) -> None:
        """Show the text of the field, the last allowed value, and what is wrong with the text."""
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
        self.error.setText(f"\N{WARNING SIGN}  {error}" if error else "")
        self.error.setVisible(bool(error))
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

    # ---- the editor

    def _make_editor(self) -> Editor:
        setting = self.setting
        editor: Editor
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

    def _span(self) -> tuple[float, float, float]:
        """Lowest value, length and power of the slider's scale."""
        low, high = self.setting.bounds.low, self.setting.bounds.high
        assert low is not None
        assert high is not None
        is_long = low >= 0 and high - low > _CURVED_FROM * max(float(self._default or 0), 1e-9)
        return low, high - low, 3.0 if is_long else 1.0

    def _value_at(self, place: int) -> str:
        """The value at a place of the slider, with no more digits than its step has."""
        bounds, (low, span, power) = self.setting.bounds, self._span()
        high = low + span
        value = low + span * (place / _SLIDER_STEPS) ** power
        if self.setting.kind is FieldKind.WHOLE:
            step = round(bounds.step or 1)
            return str(round(value / step) * step)
        inside = span / _SLIDER_STEPS / 10.0  # an end that is excluded is not offered
        value = min(max(value, low + inside * bounds.low_open), high - inside * bounds.high_open)
        digits = max(0, 2 - math.floor(math.log10(max(abs(value), span / 1e4, 1e-9))))
        text = f"{value:.{digits}f}".rstrip("0").rstrip(".") if digits else f"{value:.0f}"
        text = "0" if text in ("-0", "") else text
        is_out = (bounds.low_open and float(text) <= low) or (bounds.high_open and float(text) >= high)
        return f"{value:.6g}" if is_out else text

    def _place_of(self, value: float) -> int:
        low, span, power = self._span()
        share = max(0.0, min(1.0, (value - low) / span))
        return round(_SLIDER_STEPS * float(share ** (1.0 / power)))

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
            row = line((self.editor, 1), spacing=8)
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
        labels = (label for label in (self.error, meaning, note) if label is self.error or label.text())
        for place, label in enumerate(labels, 1):
            grid.addWidget(label, place, 1, 1, 4)
        self.error.hide()
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
        event.ignore()  # the wheel scrolls the page


def _with_unit(text: str, unit: str) -> str:
    """The sign of degrees stands at its number."""
    return f"{text}{unit}" if unit == "°" else f"{text} {unit}".strip()


def _together(text: str, unit: str) -> str:
    """No unit stands alone in a line."""
    return text.replace(f" {unit}", "°" if unit == "°" else f"\N{NO-BREAK SPACE}{unit}") if unit else text


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
