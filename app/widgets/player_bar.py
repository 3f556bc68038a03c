"""Playing: a slider in milliseconds, buttons for play and single frames, jumps with their chooser, speed, selection and clip."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QProgressBar, QPushButton, QSlider, QVBoxLayout, QWidget

from app import theme
from app.language import tr
from app.play_clock import SPEEDS
from app.session_marks import JumpKind, clock_text
from app.widgets.quiet_combo import name_list
from app.widgets.time_field import TimeField

_BUTTON = 34
_LONGEST_MS = 2**31 - 1
"""A damaged row may be of another month; sliders end here."""
_STYLE = """
QPushButton { padding: 3px 6px; }
QPushButton#play { background: @PLAYBACK; color: @INK; font-weight: 700; font-size: 16px; }
QPushButton#play:focus { border: 2px solid @TEXT; }
QSlider::groove:horizontal { height: 6px; background: @RAISED; border-radius: 3px; }
QSlider::sub-page:horizontal { background: @PLAYBACK; border-radius: 3px; }
QSlider::handle:horizontal { background: @TEXT; width: 14px; margin: -5px 0; border-radius: 7px; }
QSlider::handle:horizontal:focus { background: @SKY; }
QProgressBar { background: @RAISED; border: 1px solid @LINE; border-radius: 5px; text-align: center;
    color: @TEXT; font-size: 12px; }
QProgressBar::chunk { background: @LINE; border-radius: 4px; }
"""


class PlayerBar(QWidget):
    """Shows and asks; it decides nothing. Times are milliseconds from the first row."""

    play_asked = Signal()
    step_asked = Signal(int)
    jump_asked = Signal(int)
    sought_ms = Signal(int)
    speed_chosen = Signal(float)
    jump_kind_chosen = Signal(object)
    clip_asked = Signal()
    cancel_asked = Signal()
    note_asked = Signal()
    snapshot_asked = Signal()

    def __init__(self) -> None:
        super().__init__()
        theme.set_sheet(self, _STYLE)
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setAccessibleName(tr("Position in milliseconds"))
        self.slider.setSingleStep(100)
        self.slider.setPageStep(1000)
        self.position = TimeField()
        self.position.setKeyboardTracking(False)
        self.position.setButtonSymbols(TimeField.ButtonSymbols.NoButtons)
        self.position.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.position.setFixedWidth(124)
        self.position.setAccessibleName(tr("Go to a time"))
        self.position.setToolTip(tr("Time from the first frame; type one as 1:23.4 or in seconds, and press Enter  (key T)"))
        self.length = _label(tr("of {time}", time="0:00.000"))
        self.frame = _label("")
        self.frame.setObjectName("card_note")
        self.play = self._button(
            "\N{BLACK RIGHT-POINTING TRIANGLE}", tr("Play or pause  (Space)"), self.play_asked.emit, tr("Play")
        )
        self.play.setObjectName("play")
        self.play.setFixedWidth(56)
        self.kind = QComboBox()
        for kind in JumpKind:
            self.kind.addItem(tr(kind.value), kind)
        name_list(self.kind, tr("What N and P jump to"))
        self.kind.setToolTip(tr("What N and P jump to  (K: the next kind)"))
        self.kind.setFixedWidth(142)
        self.speed = QComboBox()
        for speed in SPEEDS:
            self.speed.addItem(f"{speed:g}\N{MULTIPLICATION SIGN}", speed)
        name_list(self.speed, tr("Speed"))
        self.speed.setToolTip(tr("Speed  ([ slower, ] faster)"))
        self.speed.setFixedWidth(78)
        self.clip = self._button(
            tr("Clip"), tr("Save the selection as a video, without one the session  (E)"), self.clip_asked.emit
        )
        self.note = self._button(tr("Note"), tr("Add a note at this time  (M)"), self.note_asked.emit)
        self.snapshot = self._button(tr("Snapshot"), tr("Save this picture  (S)"), self.snapshot_asked.emit)
        self.progress = QProgressBar()
        self.progress.setFixedHeight(24)
        self.progress.setAccessibleName(tr("Clip being written"))
        self.cancel = self._button(tr("Cancel"), tr("Stop writing the clip  (Esc)"), self.cancel_asked.emit, tr("Cancel the clip"))
        self._lay_out()
        self._wire()
        self.show_progress(None)
        self.show_length(0, 0)

    def show_length(self, duration_ms: int, rows: int) -> None:
        """How long the session is, as far as it is known."""
        for field in (self.slider, self.position):
            with QSignalBlocker(field):
                field.setRange(0, min(max(0, duration_ms), _LONGEST_MS))
        self._rows = rows
        self.length.setText(tr("of {time}", time=clock_text(duration_ms / 1000)))

    def show_position(self, time_ms: int, place: int) -> None:
        """Where playing is. A number that is being typed stays."""
        time_ms = min(time_ms, _LONGEST_MS)
        with QSignalBlocker(self.slider):
            self.slider.setValue(time_ms)
        if not self.position.hasFocus():
            with QSignalBlocker(self.position):
                self.position.setValue(time_ms)
        self.frame.setText(tr("frame {place} of {count}", place=place + 1, count=self._rows) if self._rows else tr("no frames"))

    def abandon(self) -> None:
        """Forget a time that was typed and not confirmed; leaving the field would count it otherwise."""
        self.position.lineEdit().setText(self.position.textFromValue(self.position.value()))

    def show_playing(self, on: bool) -> None:
        self.play.setText("\N{DOUBLE VERTICAL BAR}" if on else "\N{BLACK RIGHT-POINTING TRIANGLE}")
        self.play.setAccessibleName(tr("Pause") if on else tr("Play"))

    def show_speed(self, speed: float) -> None:
        with QSignalBlocker(self.speed):
            self.speed.setCurrentIndex(self.speed.findData(speed))

    def show_kind(self, kind: JumpKind) -> None:
        with QSignalBlocker(self.kind):
            self.kind.setCurrentIndex(self.kind.findData(kind))

    def show_selection(self, length_s: float | None) -> None:
        """How long the clip will be."""
        self.clip.setText(tr("Clip") if length_s is None else tr("Clip {seconds:.1f} s", seconds=length_s))

    def show_progress(self, share: float | None) -> None:
        """Of the clip that is being written; None: none is."""
        for widget in (self.progress, self.cancel):
            widget.setVisible(share is not None)
        self.clip.setVisible(share is None)
        if share is not None:
            self.progress.setValue(round(100 * share))

    def _button(self, text: str, tip: str, slot: object, name: str = "") -> QPushButton:
        button = QPushButton(text)
        button.setToolTip(tip)
        button.setAccessibleName(name or tip.partition("  (")[0])
        button.setFixedWidth(max(_BUTTON, QFontMetrics(theme.font(14)).horizontalAdvance(text) + 18))
        button.clicked.connect(slot)
        return button

    def _lay_out(self) -> None:
        row = QHBoxLayout()
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(5)
        before = self._button("\N{LEFTWARDS ARROW}", tr("One frame back  (\N{LEFTWARDS ARROW})"), lambda: self.step_asked.emit(-1))
        after = self._button("\N{RIGHTWARDS ARROW}", tr("One frame on  (\N{RIGHTWARDS ARROW})"), lambda: self.step_asked.emit(1))
        previous = self._button("P", tr("Previous of the kind beside  (P)"), lambda: self.jump_asked.emit(-1))
        following = self._button("N", tr("Next of the kind beside  (N)"), lambda: self.jump_asked.emit(1))
        for step in (before, self.play, after):
            row.addWidget(step)
        row.addSpacing(6)
        for jump in (previous, self.kind, following):
            row.addWidget(jump)
        row.addSpacing(6)
        row.addWidget(self.speed)
        row.addStretch(1)
        for widget in (self.progress, self.cancel, self.clip, self.note, self.snapshot):
            row.addWidget(widget)
        top = QHBoxLayout()
        top.setContentsMargins(0, 0, 0, 0)
        top.setSpacing(8)
        top.addWidget(self.slider, 1)
        top.addWidget(self.position)
        top.addWidget(self.length)
        top.addWidget(self.frame)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(5)
        column.addLayout(top)
        column.addLayout(row)
        self.clip.setFixedWidth(QFontMetrics(theme.font(14)).horizontalAdvance("Clip 0000.0 s") + 18)
        self.frame.setMinimumWidth(150)
        self.frame.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)

    def _wire(self) -> None:
        self.slider.valueChanged.connect(self.sought_ms)
        self.position.valueChanged.connect(self.sought_ms)
        self.speed.activated.connect(lambda _index: self.speed_chosen.emit(self.speed.currentData()))
        self.kind.activated.connect(lambda _index: self.jump_kind_chosen.emit(self.kind.currentData()))


def _label(text: str) -> QLabel:
    label = QLabel(text)
    theme.set_sheet(label, "color: @TEXT_DIM;")
    return label
