"""The panels of the annotator window: tool bar, header, list of images, readout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import QAbstractListModel, QModelIndex, QPersistentModelIndex, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QImage, QImageReader, QPainter, QPen, QPixmap
from PySide6.QtWidgets import (
    QAbstractButton,
    QButtonGroup,
    QComboBox,
    QLabel,
    QListView,
    QProgressBar,
    QSizePolicy,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QWidget,
)

from app.annotator.editing import MaskMode, Tool, short_words
from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import STATE_MEANING, STATE_TITLE, side, tip
from app.ui.theme import ON_PICTURE
from app.ui.workers import Worker
from app.widgets.basics import column, line, name_list
from app.widgets.painting import CENTER, NONE, Painted, PaintedWidget, draw_box, draw_fitted, draw_text
from app.widgets.state_badge import paint_state
from core.annotation.model import ANSWERED, AngleProvenance, Annotation, MaskTarget, Readout, Status
from core.types import PoseState

_DRAWN = ("ROBOT", "VESSEL")
"""Roles that the picture shows in their own colours."""
_LEGIBLE_CONTRAST = 3.0
"""A colour with less contrast than this to its chip is replaced by grey."""
_SWITCHES = (
    ("L", mark("Loupe"), "TEXT", mark("The surroundings of the cursor, magnified")),
    ("K", mark("Masks"), "VESSEL", mark("Show the drawn masks")),
    ("H", mark("Algorithm"), "TEXT", mark("Show what the algorithm says: answers after it are told apart. Not in a blind study")),
)


@dataclass(frozen=True, slots=True)
class AnswerText:
    """An answer of the rater: its key, its name, what it means, and its state; None: no pose."""

    key: str
    label: str
    meaning: str
    state: PoseState | None = None


class Answer(Enum):
    """What a rater can say of a picture, in the order of the chips."""

    A = AnswerText("A", STATE_TITLE[PoseState.A], STATE_MEANING[PoseState.A], PoseState.A)
    B = AnswerText("B", STATE_TITLE[PoseState.B], STATE_MEANING[PoseState.B], PoseState.B)
    C = AnswerText("C", STATE_TITLE[PoseState.C], STATE_MEANING[PoseState.C], PoseState.C)
    D = AnswerText("D", STATE_TITLE[PoseState.D], STATE_MEANING[PoseState.D], PoseState.D)
    CANNOT_TELL = AnswerText("X", mark("Can't tell"), mark("A robot may be there, but the picture does not show its pose"))
    NO_ROBOT = AnswerText("O", mark("No robot"), mark("The picture shows no robot"))

    @classmethod
    def of(cls, annotation: Annotation) -> Answer | None:
        if annotation.cannot_tell or annotation.no_robot:
            return cls.CANNOT_TELL if annotation.cannot_tell else cls.NO_ROBOT
        return next((one for one in cls if one.value.state is not None and one.value.state is annotation.state), None)


class AnnotationBar(QWidget):
    """``answered`` carries an answer; ``tool_chosen`` a tool; ``mode_chosen`` a mode of the mask tools, POINTS when the one that is
    on is left; ``switched`` the key of a switch ("L", "K", "H") and whether it is on, ``shown`` the same also where the window has
    set it.

    Parameters
    ----------
    blind : a study without the algorithm's answer.
    tools : the tools that are offered; without a line tool there is no switch for the algorithm.
    """

    answered = Signal(object)
    tool_chosen = Signal(object)
    mode_chosen = Signal(object)
    switched = Signal(str, bool)
    shown = Signal(str, bool)

    def __init__(self, *, blind: bool, tools: Sequence[Tool] = tuple(Tool)) -> None:
        super().__init__()
        has_lines = any(not tool.is_mask for tool in tools)
        self._has_algorithm = not blind and has_lines
        self._tools = {tool: _Chip(tool.value.key, tool.value.label, tool.value.role, tool.value.label) for tool in tools}
        group = QButtonGroup(self)
        for tool, chip in self._tools.items():
            chip.clicked.connect(lambda _on=False, which=tool: self.tool_chosen.emit(which))
            group.addButton(chip)
        self._switches = {key: _Chip(key, *texts) for key, *texts in _SWITCHES if key != "H" or self._has_algorithm}
        for key, chip in self._switches.items():
            chip.setChecked(key in "LK")
            for signal in (self.switched, self.shown):
                chip.toggled.connect(lambda on, which=key, signal=signal: signal.emit(which, on))
        self._answers: dict[Answer, _Chip] = {}
        for answer in Answer if has_lines else ():
            key, role = answer.value.key, f"STATE_{answer.value.key}" if answer.value.state is not None else "TEXT"
            chip = self._answers[answer] = _Chip(key, answer.value.label, role, answer.value.meaning)
            chip.clicked.connect(lambda _on=False, which=answer: self.answered.emit(which))
        self.modes: dict[MaskMode, _Chip] = {}
        for mode in MaskMode:
            if mode is not MaskMode.POINTS:
                chip = self.modes[mode] = _Chip(mode.value.key, mode.value.label, "ORANGE", mode.value.meaning)
                chip.clicked.connect(lambda on, which=mode: self.mode_chosen.emit(which if on else MaskMode.POINTS))
        self.hint = QLabel(wordWrap=True)
        self.hint.setObjectName("card_note")
        self.hint.setMinimumWidth(10)
        self.hint.setFixedHeight(_HINT_HEIGHT)
        rows = [line(*self._tools.values(), None, *self._switches.values(), spacing=5)]
        rows += [line(*self._answers.values(), None, spacing=5)] if has_lines else []
        modes = line(*self.modes.values(), spacing=5)
        modes.addSpacing(7)
        modes.addWidget(self.hint, 1)
        self.setLayout(column(*rows, modes, spacing=5))
        self.show_tool(next(iter(tools)), MaskMode.POINTS)

    def show_tool(self, tool: Tool, mode: MaskMode) -> None:
        """The chosen tool and mode, and how it is used."""
        if tool in self._tools:
            self._tools[tool].setChecked(True)
        for which, chip in self.modes.items():
            chip.setChecked(which is mode)
            chip.setVisible(tool.is_mask)
            chip.role = tool.value.role
        hint = tr(mode.value.hint) if mode is not MaskMode.POINTS else tool.value.hint
        self.hint.setText(hint if self._has_algorithm else hint.partition(" · G ")[0])

    def show_answer(self, annotation: Annotation, readout: Readout) -> None:
        """The answer that is given, and with an arrow the one that Enter would take."""
        given = Answer.of(annotation)
        proposed = readout.pose.state if readout.pose is not None and given is None else None
        for answer, chip in self._answers.items():
            chip.setChecked(answer is given)
            chip.show_enter(proposed is not None and answer.value.state is proposed)

    def set_switch(self, key: str, on: bool) -> None:
        """Show a switch as on or off without ``switched``."""
        chip = self._switches.get(key)
        if chip is not None and chip.isChecked() is not on:
            chip.blockSignals(True)
            chip.setChecked(on)
            chip.blockSignals(False)
            self.shown.emit(key, on)

    def is_on(self, key: str) -> bool:
        return self._switches[key].isChecked()

    def toggle(self, key: str) -> None:
        chip = self._switches.get(key)
        if chip is not None and chip.isEnabled():
            chip.toggle()


_HINT_HEIGHT = 34
"""Of two lines, so that a longer hint moves nothing."""


class _Chip(Painted, QAbstractButton):
    """Key cap, colour and name; filled when on, outlined when off."""

    def __init__(self, key: str, label: str, role: str, meaning: str) -> None:
        super().__init__()
        self._key, self.role = key, role
        self._is_next = False
        self.setCheckable(True)
        self.setText(tr(label))
        self.setFixedHeight(30)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setToolTip(tr("{meaning}  (key {key})", meaning=tr(meaning), key=key))
        self.setAccessibleName(tr(label))

    def show_enter(self, on: bool) -> None:
        """Whether the Enter key does this now."""
        self._is_next = on
        self.update()

    def sizeHint(self) -> QSize:
        return QSize(
            (66 if self.role.startswith("STATE") else 50) + QFontMetrics(theme.semi_bold(12)).horizontalAdvance(self.text()), 30
        )

    def paint(self, painter: QPainter) -> None:
        on, is_enabled = self.isChecked(), self.isEnabled()
        edge = theme.SKY if on or self._is_next else theme.TEXT_FAINT if self.underMouse() and is_enabled else theme.LINE
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        draw_box(painter, frame, 6, theme.RAISED if on else theme.WINDOW, edge, 1.4 if on else 1.0)
        painter.setOpacity(1.0 if is_enabled else 0.45)
        key_colour = theme.TEXT_DIM if on else theme.TEXT_FAINT
        draw_text(painter, QRectF(9, 0, 12, self.height()), self._key, theme.semi_bold(11), key_colour, CENTER)
        if self.role.startswith("STATE_"):
            name = theme.STATE_COLOUR[PoseState(self.role[-1])]
        else:
            name = getattr(ON_PICTURE, self.role) if self.role in _DRAWN else theme.of(self.role)
        is_illegible = theme.contrast(name, theme.RAISED) < _LEGIBLE_CONTRAST  # a pale colour on a light chip
        swatch = QRectF(27, self.height() / 2 - 4, 8, 8)
        draw_box(painter, swatch, 2, name if on else None, theme.TEXT_FAINT if is_illegible else name, 1.5)
        if self._is_next:
            enter = QRectF(self.width() - 21, 0, 16, self.height())
            draw_text(painter, enter, "\N{DOWNWARDS ARROW WITH CORNER LEFTWARDS}", theme.semi_bold(13), theme.SKY, CENTER)
        room = QRectF(41, 0, self.width() - 45, self.height())
        draw_text(painter, room, self.text(), theme.semi_bold(12), theme.TEXT if on else theme.TEXT_DIM)


class AnnotationHeader(QWidget):
    """Title on the left, study and rater in the middle, the state of the file on the right."""

    def __init__(self, who: str) -> None:
        super().__init__()
        self._title = QLabel()
        theme.set_sheet(self._title, "color: @TEXT; font-size: 17px; font-weight: 700;")
        self._title.setMinimumWidth(40)
        self._title.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._who = QLabel(who)
        theme.set_sheet(self._who, "color: @TEXT_DIM; font-size: 13px;")
        self.saved = QLabel()
        self.saved.setAccessibleName(tr("State of the file"))
        self.setLayout(line((self._title, 1), self._who, self.saved, spacing=18, margins=(4, 2, 4, 0)))
        self.show_saved(True)

    def show_title(self, text: str) -> None:
        self._title.setText(text)
        self._title.setToolTip(text)

    def show_saved(self, is_saved: bool) -> None:
        self._show(tr("\N{CHECK MARK}  saved") if is_saved else tr("saving"), "ALLOWED" if is_saved else "TEXT_DIM", "")

    def show_unsaved(self, count: int, why: str) -> None:
        """Edits that could not be written, and why."""
        one, more = tr("\N{WARNING SIGN}  NOT SAVED: 1 edit"), tr("\N{WARNING SIGN}  NOT SAVED: {count} edits", count=count)
        self._show(one if count == 1 else more, "FAULT", why)

    def _show(self, text: str, role: str, tip: str) -> None:
        self.saved.setText(text)
        self.saved.setToolTip(tip)
        theme.set_sheet(self.saved, f"color: @{role}; font-size: 13px; font-weight: 600;")


_ROW = 30
_PICTURE = QSize(40, 26)
"""Room of the small picture in a row."""
_WORD = {
    Status.NEW: mark("new"),
    Status.BEGUN: mark("begun"),
    Status.DONE: mark("done"),
    Status.CANNOT_TELL: mark("can't tell"),
    Status.NO_ROBOT: mark("no robot"),
}
_SHORT = mark("short")
_FROM = {
    AngleProvenance.ALGORITHM: mark("algorithm"),
    AngleProvenance.FOLLOWED: mark("followed"),
    AngleProvenance.CORRECTED: mark("corrected"),
}
"""What a row says of lines that were not drawn by hand."""
_STYLE = """
QListView { background: @PANEL; outline: none; }
QScrollBar:vertical { background: transparent; width: 8px; margin: 0; }
QScrollBar::handle:vertical { background: @LINE; border-radius: 4px; min-height: 24px; }
QScrollBar::add-line:vertical, QScrollBar::sub-line:vertical { height: 0; }
QScrollBar::add-page:vertical, QScrollBar::sub-page:vertical { background: transparent; }
"""
_BAR_STYLE = """
QProgressBar { background: @LINE; border: none; border-radius: 3px; }
QProgressBar::chunk { background: @ALLOWED; border-radius: 3px; }
"""
_Index = QModelIndex | QPersistentModelIndex


class Items(Protocol):
    """What the list shows of each item."""

    def status(self, place: int) -> Status: ...
    def content(self, place: int) -> Annotation: ...
    def provenance(self, place: int) -> AngleProvenance: ...
    def is_short(self, place: int) -> bool: ...


class Filter(Enum):
    """Which items are listed."""

    ALL = mark("All images")
    OPEN = mark("Without an answer")
    ANSWERED = mark("Answered")
    MASKS = mark("With masks")
    NOTE = mark("With a note")
    SHORT = mark("With short lines")
    NOT_BY_HAND = mark("Not drawn by hand")

    def keeps(self, items: Items, place: int) -> bool:
        status, content = items.status(place), items.content(place)
        kept = {
            Filter.OPEN: status in (Status.NEW, Status.BEGUN),
            Filter.ANSWERED: status in ANSWERED,
            Filter.MASKS: bool(content.masks),
            Filter.NOTE: bool(content.note),
            Filter.NOT_BY_HAND: items.provenance(place) is not AngleProvenance.MANUAL,
        }
        return items.is_short(place) if self is Filter.SHORT else kept.get(self, True)


class QueueModel(QAbstractListModel):
    """Rows of name, status, masks, and what is particular about the lines; small pictures are read when they are in sight.

    Parameters
    ----------
    paths : of the pictures; empty: none is shown.
    """

    def __init__(self, names: list[str], items: Items, paths: Sequence[Path] = ()) -> None:
        super().__init__()
        self._names, self.items, self.paths = names, items, paths
        self._pictures: dict[int, QPixmap] = {}
        self._reading = Worker("thumbnails", self, behind=True)
        self._reading.done.connect(self._on_read)

    def rowCount(self, parent: _Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own signature
        return 0 if parent.isValid() else len(self._names)

    def data(self, index: _Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if not index.isValid():
            return None
        row = index.row()
        if role == Qt.ItemDataRole.DisplayRole:
            return self._names[row]
        if role in (Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole):
            masks = tr(", with masks") if self.items.content(row).masks else ""
            said = [tr(_WORD[self.items.status(row)]), *(tr(word) for word in self.particulars(row))]
            return f"{row + 1}: {self._names[row]}: {', '.join(said)}{masks}"
        if role == Qt.ItemDataRole.DecorationRole and self.paths:
            if row not in self._pictures:
                self._pictures[row] = QPixmap()
                self._reading.submit(row, partial(_thumbnail, self.paths[row]), urgent=True)
            return self._pictures[row]
        return None

    def _on_read(self, row: int, picture: QImage) -> None:
        self._pictures[row] = QPixmap.fromImage(picture)
        self.update_row(row)

    def particulars(self, row: int) -> list[str]:
        """Words on lines that are short, or were not drawn by hand."""
        source = _FROM.get(self.items.provenance(row))
        return [*([_SHORT] if self.items.is_short(row) else []), *([source] if source is not None else [])]

    def update_row(self, row: int) -> None:
        index = self.index(row)
        self.dataChanged.emit(index, index)


def _thumbnail(path: Path) -> QImage:
    """A small picture; a null one where Qt cannot read the file."""
    reader = QImageReader(str(path))
    reader.setScaledSize(reader.size().scaled(_PICTURE * 2, Qt.AspectRatioMode.KeepAspectRatio))  # sharp on a fine screen, too
    return reader.read()


class _QueueRow(QStyledItemDelegate):
    """Number, small picture, name, particulars of the lines, masks of vessel and robot, and the answer: a tick, or a word."""

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        return QSize(120, _ROW)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        model, row = index.model(), index.row()
        assert isinstance(model, QueueModel)
        status, content = model.items.status(row), model.items.content(row)
        box = QRectF(option.rect).adjusted(1, 1, -1, -1)  # type: ignore[attr-defined]
        is_current = bool(option.state & QStyle.StateFlag.State_Selected)  # type: ignore[attr-defined]
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if is_current:
            draw_box(painter, box, 5, theme.RAISED, theme.SKY, 1.2)
        draw_text(painter, box.adjusted(6, 0, 0, 0), str(index.row() + 1), theme.font(12), theme.TEXT_FAINT)
        name_font = theme.semi_bold(13) if is_current else theme.font(13)
        name_colour = theme.TEXT if is_current or status is Status.NEW else theme.TEXT_DIM
        right = box.right() - 8
        words = [(tr(word), theme.ORANGE) for word in model.particulars(row)]
        if status is Status.DONE:
            letter = content.state.value if content.state is not None else ""
            words.append((f"{letter} \N{CHECK MARK}", theme.ALLOWED))
        elif status is not Status.NEW:
            words.append((tr(_WORD[status]), theme.ORANGE if status is Status.BEGUN else theme.SKY))
        small = theme.semi_bold(12)
        for word, colour in reversed(words):
            width = QFontMetrics(small).horizontalAdvance(word) + 2
            draw_text(painter, QRectF(right - width, box.top(), width, box.height()), word, small, colour)
            right -= width + 8
        for target in (MaskTarget.ROBOT, MaskTarget.VESSEL):
            if target in content.drawn:
                colour = theme.ROBOT if target is MaskTarget.ROBOT else theme.VESSEL
                draw_box(painter, QRectF(right - 10, box.center().y() - 5, 10, 10), 3, theme.colour(colour, 0.8))
                right -= 14
        left = box.left() + 40
        picture = index.data(Qt.ItemDataRole.DecorationRole)
        if picture is not None:
            place = QRectF(left, box.center().y() - _PICTURE.height() / 2, _PICTURE.width(), _PICTURE.height())
            draw_fitted(painter, place, picture)
            left = place.right() + 8
        name = QRectF(left, box.top(), max(0.0, right - left), box.height())
        draw_text(painter, name, index.data(), name_font, name_colour, elided=True)
        painter.restore()


class QueueList(QWidget):
    """``chosen`` carries the row that the user wants."""

    chosen = Signal(int)

    def __init__(self, model: QueueModel) -> None:
        super().__init__()
        self._model = model
        self.update_row = model.update_row
        model.setParent(self)
        self._view = QListView()
        self._view.setModel(model)
        self._view.setItemDelegate(_QueueRow(self._view))
        self._view.setUniformItemSizes(True)
        self._view.setFrameShape(QListView.Shape.NoFrame)
        self._view.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        theme.set_sheet(self._view, _STYLE)
        self._view.setAccessibleName(tr("Images"))
        self._view.activated.connect(lambda index: self.chosen.emit(index.row()))
        self._view.clicked.connect(lambda index: self.chosen.emit(index.row()))
        self.setFocusProxy(self._view)
        self._filter = QComboBox()
        for kind in Filter:
            self._filter.addItem(tr(kind.value), kind)
        name_list(self._filter, tr("Which images are listed"))
        self._filter.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._filter.currentIndexChanged.connect(lambda _index: self._show_rows())
        self.progress, self._bar = QLabel(), QProgressBar(textVisible=False)
        self.progress.setFont(theme.semi_bold(14))
        self._bar.setFixedHeight(6)
        self._bar.setAccessibleName(tr("Progress"))
        theme.set_sheet(self._bar, _BAR_STYLE)
        self.setLayout(column(self.progress, self._bar, self._filter, (self._view, 1), spacing=6))

    def show_progress(self, finished: int, count: int) -> None:
        left = count - finished
        done = tr("{finished} of {count} done", finished=finished, count=count)
        self.progress.setText(done + tr(", {left} left", left=left) if left else done)
        self._bar.setRange(0, max(count, 1))
        self._bar.setValue(finished)

    def _show_rows(self) -> None:
        chosen = self._filter.currentData()
        for row in range(self._model.rowCount()):
            self._view.setRowHidden(row, not chosen.keeps(self._model.items, row))

    def show_current(self, row: int) -> None:
        if self._filter.currentData() is not Filter.ALL:
            self._show_rows()
        index = self._model.index(row)
        self._view.setCurrentIndex(index)
        self._view.scrollTo(index)


_HEIGHT = 232


class AnnotationReadout(PaintedWidget):
    """Shows one annotation with its readout; without both lines it says what is still to be drawn."""

    def __init__(self) -> None:
        tool_tip = tip("theta", "d_head", "d_tail", "crossed", "lines_used", "state")
        super().__init__(tr("Readout"), tool_tip, hint=(320, _HEIGHT), height=_HEIGHT)
        self._annotation = Annotation()
        self._readout = Readout()
        self._is_preview = False
        self._source = ""

    @property
    def angle_text(self) -> str:
        pose = self._readout.pose
        if pose is None:
            return tr("hidden") if self._readout.is_hidden else NONE
        return f"{pose.theta_deg:.1f}°"

    @property
    def state_text(self) -> str:
        """The line beside the badge."""
        annotation, pose = self._annotation, self._readout.pose
        given = Answer.of(annotation)
        if given is not None:
            return tr(given.value.label)
        return tr("No state yet") if pose is not None or self._readout.is_hidden else tr("No state")

    @property
    def advice_text(self) -> str:
        """What the lines say of the state, or what is missing."""
        annotation, pose = self._annotation, self._readout.pose
        if annotation.without_pose:
            return tr("{key} takes it back", key="X" if annotation.cannot_tell else "O")
        if self._readout.is_hidden:
            return tr("Blind: press A B C D; then theta is shown")
        if pose is None:
            missing = tr_text(self._readout.missing)
            return missing[:1].upper() + missing[1:]
        if annotation.state is None:
            return tr("The lines say {state}: Enter takes it, or press A B C D", state=pose.state.value)
        if annotation.state is not pose.state:
            return tr("The lines say {state}, by the rule", state=pose.state.value)
        return tr("The lines say the same")

    def show_annotation(
        self,
        annotation: Annotation,
        readout: Readout,
        source: AngleProvenance = AngleProvenance.MANUAL,
        *,
        is_preview: bool = False,
    ) -> None:
        """`source` is where the lines come from; `is_preview`: a point is still moving."""
        self._annotation, self._readout, self._is_preview = annotation, readout, is_preview
        self._source = _FROM.get(source, "")
        words = [f"{tr('theta')} {self.angle_text}", self.state_text, self.advice_text]
        words += [tr(self._source)] if self._source else []
        self.setAccessibleDescription("; ".join([*words, *([short_words(readout)] if readout.is_short else [])]))
        self.update()

    def paint(self, painter: QPainter) -> None:
        self._paint_angle(painter)
        self._paint_distances(painter)
        self._paint_state(painter)

    def _paint_angle(self, painter: QPainter) -> None:
        pose = self._readout.pose
        draw_text(painter, QRectF(0, 0, 40, 72), "\N{GREEK SMALL LETTER THETA}", theme.semi_bold(34), theme.TEXT_DIM)
        angle_font, colour = theme.bold(58 if pose is not None else 34), theme.THETA if pose is not None else theme.TEXT_FAINT
        draw_text(painter, QRectF(40, 0, self.width() - 40, 72), self.angle_text, angle_font, colour)
        left = 40.0 + QFontMetrics(angle_font).horizontalAdvance(self.angle_text) + 10.0
        turn = side(pose.theta_signed_deg) if pose is not None and pose.theta_deg >= 0.05 else ""
        draw_text(painter, QRectF(left, 12, self.width() - left, 24), turn, theme.semi_bold(20), theme.TEXT)
        if self._is_preview or self._source:
            word, colour = (tr("moving"), theme.TEXT_DIM) if self._is_preview else (tr(self._source), theme.ORANGE)
            draw_text(painter, QRectF(left, 38, self.width() - left, 20), word, theme.semi_bold(14), colour)

    def _paint_distances(self, painter: QPainter) -> None:
        """Distances, and the arc lengths that the vectors are fitted to: shorter ones are less certain."""
        pose, readout = self._readout.pose, self._readout
        robot_px, vessel_px = round(readout.robot_length_px), round(readout.vessel_length_px)
        lengths = f"{robot_px} + {vessel_px} px" if vessel_px else f"{robot_px} px"
        cells = (
            ("d_head", f"{pose.d_head_px:.1f} px" if pose else NONE, theme.D_HEAD),
            ("d_tail", f"{pose.d_tail_px:.1f} px" if pose else NONE, theme.D_TAIL),
            (tr("crossed"), (tr("yes") if pose.crossed else tr("no")) if pose else NONE, theme.TEXT),
            (tr("lines used"), lengths if readout.robot_length_px else NONE, theme.TEXT),
        )
        if readout.is_short:
            cells = (*cells[:3], (tr("short lines"), lengths, theme.ORANGE))
        width = self.width() / len(cells)
        for place, (name, value, colour) in enumerate(cells):
            value_font = theme.fitted(theme.semi_bold(15), value, int(width - 4))
            value_colour = colour if pose or place == 3 else theme.TEXT_FAINT
            draw_text(painter, QRectF(place * width, 80, width, 16), name, theme.font(12), theme.TEXT_DIM)
            draw_text(painter, QRectF(place * width, 98, width, 20), value, value_font, value_colour)

    def _paint_state(self, painter: QPainter) -> None:
        annotation, pose = self._annotation, self._readout.pose
        painter.setPen(QPen(QColor(theme.LINE), 1))
        painter.drawLine(QPointF(0, 131), QPointF(self.width(), 131))
        box, shown = QRectF(2, 146, 62, 62), None if annotation.without_pose else annotation.state
        if annotation.without_pose:
            painter.setPen(QPen(QColor(theme.TEXT_DIM), 2, Qt.PenStyle.DashLine))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawEllipse(box.adjusted(3, 3, -3, -3))
            sign = "?" if annotation.cannot_tell else "\N{EMPTY SET}"
            draw_text(painter, box, sign, theme.bold(30), theme.TEXT, CENTER)
        else:
            paint_state(painter, box, shown)
        left, width = 80.0, self.width() - 80.0
        colour = theme.TEXT if shown or annotation.without_pose else theme.TEXT_DIM
        draw_text(painter, QRectF(left, 148, width, 26), self.state_text, theme.bold(20), colour)
        differs = shown is not None and pose is not None and pose.state is not shown
        painter.setFont(theme.font(13))
        painter.setPen(QColor(theme.ORANGE if differs else theme.TEXT_DIM))
        flags = int(Qt.AlignmentFlag.AlignTop | Qt.TextFlag.TextWordWrap)
        painter.drawText(QRectF(left, 178, width, 52), flags, self.advice_text)
