"""The controls of the player: the bar below the timeline, the list of events, what was recorded, a line for notes."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Sequence

from PySide6.QtCore import (
    QAbstractListModel,
    QModelIndex,
    QPersistentModelIndex,
    QPointF,
    QRectF,
    QSignalBlocker,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QValidator
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QLabel,
    QLineEdit,
    QListView,
    QPushButton,
    QSizePolicy,
    QSlider,
    QSpinBox,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QWidget,
)

from app.player.course import LISTED, MARK_LOOK, SPEEDS, JumpKind, clock_text, event_line
from app.player.timeline import paint_mark
from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.widgets.basics import column, line, name_list
from app.widgets.painting import RIGHT, draw_text
from core.session.manifest import Description, Event, EventKind, Manifest

_TYPED = re.compile(r"(?:(?:(\d+):)?(\d+):)?(\d+(?:[.,]\d*)?|[.,]\d+)(?: *(ms|s))?")
_UNFINISHED = re.compile(r"[\d:., ms]*")
_MS = {"ms": 1.0, "s": 1000.0, None: 1000.0}


def typed_ms(text: str) -> int | None:
    """Milliseconds of "1:02:03.5", "1:23.4", "83.4", "83.4 s" or "83400 ms", with a decimal point or comma; None for no time."""
    found = _TYPED.fullmatch(text.strip())
    if found is None or (found[2] is not None and found[4] == "ms"):
        return None
    minutes = 60 * int(found[1] or 0) + int(found[2] or 0)
    return round(60_000 * minutes + float(found[3].replace(",", ".")) * _MS[found[4]])


class TimeField(QSpinBox):
    """A time in milliseconds. When the text is no time, leaving the field shows the value again."""

    def textFromValue(self, value: int) -> str:
        return clock_text(value / 1000)

    def valueFromText(self, text: str) -> int:
        found = typed_ms(text)
        return self.value() if found is None else min(found, self.maximum())

    def validate(self, text: str, position: int) -> object:
        if typed_ms(text) is not None:
            return QValidator.State.Acceptable, text, position
        is_begun = _UNFINISHED.fullmatch(text) is not None
        return (QValidator.State.Intermediate if is_begun else QValidator.State.Invalid), text, position

    def fixup(self, text: str) -> str:
        return self.textFromValue(self.value())


_PLAY = "\N{BLACK RIGHT-POINTING TRIANGLE}"
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
"""


class PlayerBar(QWidget):
    """Slider, time, buttons and choosers. Times are milliseconds from the first row. A button presses an entry of the menus.

    Parameters
    ----------
    press : gets the key of the entry.
    """

    sought_ms = Signal(int)
    speed_chosen = Signal(float)
    jump_kind_chosen = Signal(object)

    def __init__(self, press: Callable[[str], object]) -> None:
        super().__init__()
        self._press = press
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
        self.length, self.frame = QLabel(tr("of {time}", time="0:00.000")), QLabel()
        for label in (self.length, self.frame):
            theme.set_sheet(label, "color: @TEXT_DIM;")
        self.frame.setObjectName("card_note")
        self.play = self._button(_PLAY, tr("Play or pause  (Space)"), "Space", tr("Play"))
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
        clip_tip = tr("Save the selection as a video, without one the session  (E)")
        self.clip = self._button(tr("Clip"), clip_tip, "E")
        self.note = self._button(tr("Note"), tr("Add a note at this time  (M)"), "M")
        self.snapshot = self._button(tr("Snapshot"), tr("Save this picture  (Ctrl+S)"), "Ctrl+S")
        self._lay_out()
        self.slider.valueChanged.connect(self.sought_ms)
        self.position.valueChanged.connect(self.sought_ms)
        self.speed.activated.connect(lambda _index: self.speed_chosen.emit(self.speed.currentData()))
        self.kind.activated.connect(lambda _index: self.jump_kind_chosen.emit(self.kind.currentData()))
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

    def discard_typed_time(self) -> None:
        """Of a time that was typed and not confirmed: leaving the field would take it."""
        self.position.lineEdit().setText(self.position.textFromValue(self.position.value()))

    def show_playing(self, on: bool) -> None:
        self.play.setText("||" if on else _PLAY)
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

    def _button(self, text: str, tip: str, key: str, name: str = "") -> QPushButton:
        button = QPushButton(text)
        button.setToolTip(tip)
        button.setAccessibleName(name or tip.partition("  (")[0])
        button.setFixedWidth(max(_BUTTON, QFontMetrics(theme.font(14)).horizontalAdvance(text) + 18))
        button.clicked.connect(lambda _checked=False: self._press(key))
        return button

    def _lay_out(self) -> None:
        row = line(spacing=5)
        before = self._button("\N{LEFTWARDS ARROW}", tr("One frame back  (\N{LEFTWARDS ARROW})"), "Left")
        after = self._button("\N{RIGHTWARDS ARROW}", tr("One frame on  (\N{RIGHTWARDS ARROW})"), "Right")
        previous = self._button(
            "\N{LEFT-POINTING DOUBLE ANGLE QUOTATION MARK}", tr("To the previous one of the kind beside  (P)"), "P"
        )
        following = self._button(
            "\N{RIGHT-POINTING DOUBLE ANGLE QUOTATION MARK}", tr("To the next one of the kind beside  (N)"), "N"
        )
        for group in ((before, self.play, after), (previous, self.kind, following)):
            for widget in group:
                row.addWidget(widget)
            row.addSpacing(6)
        row.addWidget(self.speed)
        row.addStretch(1)
        for right in (self.clip, self.note, self.snapshot):
            row.addWidget(right)
        top = line((self.slider, 1), self.position, self.length, self.frame, spacing=8)
        self.setLayout(column(top, row, spacing=5))
        self.clip.setFixedWidth(QFontMetrics(theme.font(14)).horizontalAdvance("Clip 0000.0 s") + 18)
        self.frame.setMinimumWidth(150)
        self.frame.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)


_RAISED = (EventKind.FAULT, EventKind.ALERT)
_ROW_HEIGHT = 24
_TIME_WIDTH = 86

_Index = QModelIndex | QPersistentModelIndex


class SessionEvents(QListView):
    """By time. Click or Enter goes to an event: ``chosen`` carries it."""

    chosen = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._model = _EventModel()
        self.setModel(self._model)
        self.setItemDelegate(_EventDelegate(self))
        self.setUniformItemSizes(True)
        self.setFrameShape(QListView.Shape.NoFrame)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setMinimumHeight(2 * _ROW_HEIGHT)
        self.setAccessibleName(tr("Events of the session"))
        self.clicked.connect(self._choose)
        self.activated.connect(self._choose)

    @property
    def lines(self) -> list[str]:
        return [self._model.line(event) for event in self._model.events]

    def show_events(self, events: Sequence[Event], first_s: float) -> None:
        """All events; times count from `first_s`."""
        listed, raised = [], set()
        for event in events:
            raised |= {event.text} if event.kind in _RAISED else set()
            # What is cleared and was not raised here is from before the recording.
            if event.kind in LISTED and (event.kind is not EventKind.CLEARED or event.text in raised):
                listed.append(event)
        self._model.show(tuple(listed), first_s)

    def show_time(self, time_s: float) -> None:
        """Mark the last one that had happened at a time of the recorded clock."""
        row = bisect_right(self._model.events, time_s + 1e-6, key=lambda event: event.time_s) - 1
        if row != self.currentIndex().row() and not self.hasFocus():
            self.setCurrentIndex(self._model.index(row) if row >= 0 else QModelIndex())

    def _choose(self, index: QModelIndex) -> None:
        self.chosen.emit(self._model.events[index.row()])


class _EventModel(QAbstractListModel):
    def __init__(self) -> None:
        super().__init__()
        self.events: tuple[Event, ...] = ()
        self._first_s = 0.0

    def show(self, events: tuple[Event, ...], first_s: float) -> None:
        self.beginResetModel()
        self.events, self._first_s = events, first_s
        self.endResetModel()

    def time_text(self, event: Event) -> str:
        return clock_text(event.time_s - self._first_s)

    def line(self, event: Event) -> str:
        return f"{self.time_text(event)}  {event_line(event)}"

    def rowCount(self, parent: _Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default, never changed
        return 0 if parent.isValid() else len(self.events)

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        event = self.events[index.row()]
        if role == Qt.ItemDataRole.UserRole:
            return event
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.AccessibleTextRole):
            return self.line(event)
        return event_line(event) if role == Qt.ItemDataRole.ToolTipRole else None


class _EventDelegate(QStyledItemDelegate):
    """Time, mark, text."""

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        return QSize(100, _ROW_HEIGHT)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        model, event = index.model(), index.data(Qt.ItemDataRole.UserRole)
        assert isinstance(model, _EventModel)
        room = QRectF(option.rect)  # type: ignore[attr-defined]
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if option.state & QStyle.StateFlag.State_Selected:  # type: ignore[attr-defined]
            painter.fillRect(room, QColor(theme.RAISED))
        time_room = QRectF(room.left(), room.top(), _TIME_WIDTH - 14, room.height())
        draw_text(painter, time_room, model.time_text(event), theme.font(12), theme.TEXT_FAINT, RIGHT)
        look = MARK_LOOK.get(event.kind)
        if look is not None:
            paint_mark(painter, QPointF(room.left() + _TIME_WIDTH + 2, room.center().y()), look.shape, look.colour)
        text_room = room.adjusted(_TIME_WIDTH + 16, 0, -4, 0)
        draw_text(painter, text_room, event_line(event), theme.font(13), theme.TEXT, elided=True)
        painter.restore()


_KNOWN = ("SIM", "LIVE", "PLAYBACK")
_HEIGHT = 34
_PLATE_STYLE = "color: @{0}; border: 2px dashed @{0}; border-radius: 6px; padding: 0 10px; font-size: 14px; font-weight: 700;"


class RecordedPlate(QWidget):
    """What was recorded, SIM or LIVE, on which rig, when: an outlined word, not filled as the banner of a live rig."""

    def __init__(self, manifest: Manifest | None, name: str, description: Description) -> None:
        super().__init__()
        self._manifest, self._name = manifest, name
        self._description, self._is_written = description, False
        kind = manifest.kind if manifest is not None else "UNKNOWN"
        self._word, self._note = QLabel(tr("recorded {kind}", kind=tr_text(kind))), QLabel()
        theme.set_sheet(self._word, _PLATE_STYLE.format(kind if kind in _KNOWN else "FAULT"))
        theme.set_sheet(self._note, "color: @TEXT_DIM; font-size: 14px;")
        self._note.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.setLayout(line(self._word, (self._note, 1), spacing=12, margins=(1, 3, 0, 3)))
        self.setFixedHeight(_HEIGHT)
        self._show()

    def show_written(self, is_written: bool) -> None:
        """Whether it is still being recorded: then it is not cut off."""
        self._is_written = is_written
        self._show()

    def show_description(self, description: Description) -> None:
        """What the session is about."""
        self._description = description
        self._show()

    def _show(self) -> None:
        about, note = self._description, _note(self._manifest, self._name, is_written=self._is_written)
        self._note.setText("  \N{MIDDLE DOT}  ".join(part for part in (note, about.line) if part))
        program = self._manifest.program if self._manifest is not None else ""
        made = tr("recorded with LumenPilot {program}", program=program) if program else ""
        tags = " ".join(f"#{tag}" for tag in about.tags)
        self.setAccessibleName(self.text)
        self.setToolTip("\n".join(part for part in (self.text, tags, about.notes, made) if part))

    @property
    def text(self) -> str:
        return f"{self._word.text()}, {self._note.text()}"


def _note(manifest: Manifest | None, name: str, *, is_written: bool) -> str:
    if manifest is None:
        return tr("{name}: its manifest is damaged", name=name)
    started = manifest.started_utc.astimezone()
    how = "" if manifest.closed else tr(", being recorded") if is_written else tr(", cut off")
    how += tr(", recovered") if manifest.recovered is not None else ""
    return tr("{started:%Y-%m-%d %H:%M:%S}, rig {name}{how}", started=started, name=manifest.rig or tr("unknown"), how=how)


_MOST_LETTERS = 2000


class NoteField(QLineEdit):
    """A line for a note that goes into a file; `hint` is its placeholder, `edge` the role of its frame's colour."""

    def __init__(self, hint: str, edge: str = "LINE") -> None:
        super().__init__(placeholderText=hint, maxLength=_MOST_LETTERS)
        self.setAccessibleName(tr("Note"))
        frame = f"border: 1px solid @{edge}; border-radius: 6px; padding: 5px 10px;"
        theme.set_sheet(
            self, f"QLineEdit {{ background: @PANEL; color: @TEXT; {frame} }} QLineEdit:focus {{ border-color: @SKY; }}"
        )

    @property
    def kept_text(self) -> str:
        """The text as a file can hold it: half of a surrogate pair, pasted, becomes a question mark."""
        return self.text().encode("utf-8", errors="replace").decode("utf-8").strip()
