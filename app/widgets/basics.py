"""A titled panel, so that every panel of a window looks the same.

Two columns with a handle between them; their shares of the width stay when the window grows.

Enter presses the button that has the focus, and opens the list: Space, which does it elsewhere, stops the robot.

A list that opens only on purpose: the keys of an operator window belong to the robot.

Lists of the operator window that Tab reaches: the arrows scroll there, and everywhere else they are the robot's.

Lists and numbers that the wheel does not turn: what it changes by the way nobody has chosen, and nobody has seen.

Small signs that tell modes and priorities apart without colour, and key caps.
"""

from __future__ import annotations

import math
from enum import Enum
from functools import cache

from PySide6.QtCore import QEvent, QObject, QPointF, QRectF, Qt
from PySide6.QtGui import (
    QColor,
    QFontMetrics,
    QKeyEvent,
    QPainter,
    QPainterPath,
    QPainterPathStroker,
    QPen,
    QPolygonF,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSpinBox,
    QComboBox,
    QFrame,
    QHBoxLayout,
    QLabel,
    QLayout,
    QListView,
    QSplitter,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from app.ui import theme
from app.ui.i18n import tr


class Card(QFrame):
    """A rounded panel; with a title, it has a small head line with an optional note on the right."""

    def __init__(self, title: str, content: QWidget | QLayout, note: QWidget | str = "") -> None:
        super().__init__()
        self.setObjectName("card")
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 7, 12, 9)
        column.setSpacing(4)
        if title:
            column.addLayout(_head(title, note))
        if isinstance(content, QWidget):
            column.addWidget(content, 1)
        else:
            column.addLayout(content, 1)


def _head(title: str, note: QWidget | str) -> QHBoxLayout:
    row = QHBoxLayout()
    row.setSpacing(8)
    label = QLabel(title)
    label.setObjectName("card_title")
    row.addWidget(label)
    row.addStretch(1)
    if isinstance(note, str):
        note_label = QLabel(note)
        note_label.setObjectName("card_note")
        note = note_label
    row.addWidget(note)
    return row


_LEAST, _MOST = 0.2, 0.9


class Columns(QSplitter):
    """`share` is the left one's of the width; neither can be closed."""

    def __init__(self, left: QWidget, right: QWidget, share: float) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self._share = share
        self.addWidget(left)
        self.addWidget(right)
        self.setChildrenCollapsible(False)
        self.setHandleWidth(theme.GAP)
        handle = self.handle(1)
        handle.setToolTip(tr("Drag to give one side more room"))
        handle.setAccessibleName(tr("Border between the columns"))
        self.splitterMoved.connect(self._on_moved)

    @property
    def share(self) -> float:
        """The left column's share of the width."""
        return self._share

    def set_share(self, share: float) -> None:
        """Another share, as far as the columns allow it."""
        self._share = max(_LEAST, min(_MOST, share))
        self._place()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._place()

    def _place(self) -> None:
        room = self.width() - self.handleWidth()
        if room > 0:
            left = round(room * self._share)
            self.setSizes([left, room - left])

    def _on_moved(self, _position: int, _handle: int) -> None:
        left, right = self.sizes()
        self._share = left / max(1, left + right)


def takes_enter(dialog: QWidget, event: QKeyEvent) -> bool:
    """Whether a key press of `dialog` was Enter; it is done with then, also where it means nothing."""
    if event.key() not in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
        return False
    focus = dialog.focusWidget()
    if not event.isAutoRepeat():
        if isinstance(focus, QAbstractButton):
            focus.click()
        elif isinstance(focus, QComboBox):
            focus.showPopup()
    return True


_OPENING = (Qt.Key.Key_Return, Qt.Key.Key_Enter)


def name_list(combo: QComboBox, name: str) -> None:
    """Under Linux Qt tells a screen reader what is chosen instead of the name, so the name is its description, too."""
    combo.setAccessibleName(name)
    combo.setAccessibleDescription(name)


class QuietCombo(QComboBox):
    """A click opens it, or Enter when Tab has come to it; in the open list the arrows choose, Enter takes and Escape leaves.

    Closed it takes no key and no turn of the wheel: neither may choose something by the way.

    Parameters
    ----------
    name : for screen readers.
    keeps_focus : in a dialog, which is gone through by keyboard. Else the keys are the robot's again once the list is closed.
    """

    def __init__(self, name: str, *, keeps_focus: bool = False) -> None:
        super().__init__()
        self._keeps_focus = keeps_focus
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        name_list(self, name)

    def wheelEvent(self, event: QWheelEvent) -> None:
        event.ignore()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in _OPENING and not event.isAutoRepeat():
            self.showPopup()
            return
        event.ignore()

    def hidePopup(self) -> None:
        super().hidePopup()
        if not self._keeps_focus:
            self.clearFocus()


Key = Qt.Key
SCROLL_KEYS = frozenset({Key.Key_Up, Key.Key_Down, Key.Key_PageUp, Key.Key_PageDown, Key.Key_Home, Key.Key_End})
"""What a list keeps for itself while it has the focus, so that none of them reaches the robot by way of its parent."""


def listen_to_tab(view: QAbstractItemView) -> None:
    """By Tab only: a click into the list must not take the arrows from the robot."""
    view.setFocusPolicy(Qt.FocusPolicy.TabFocus)


def scroll(view: QAbstractItemView, event: QKeyEvent, row_px: int) -> bool:
    """Scroll by a row, a page or to an end; False for any other key."""
    bar = view.verticalScrollBar()
    ways = {
        Key.Key_Up: bar.value() - row_px,
        Key.Key_Down: bar.value() + row_px,
        Key.Key_PageUp: bar.value() - bar.pageStep(),
        Key.Key_PageDown: bar.value() + bar.pageStep(),
        Key.Key_Home: bar.minimum(),
        Key.Key_End: bar.maximum(),
    }
    place = ways.get(Key(event.key()))
    if place is None:
        return False
    bar.setValue(place)
    event.accept()
    return True


class ScrolledList(QListView):
    """A list that nobody chooses from."""

    def __init__(self, row_px: int) -> None:
        super().__init__()
        self._row_px = row_px
        listen_to_tab(self)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not scroll(self, event, self._row_px):
            event.ignore()


class ScrolledTable(QTableView):
    """A table that nobody chooses from."""

    def __init__(self, row_px: int) -> None:
        super().__init__()
        self._row_px = row_px
        self.setTabKeyNavigation(False)
        listen_to_tab(self)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not scroll(self, event, self._row_px):
            event.ignore()


class StillWheel(QObject):
    """For all lists and numbers that `dialog` has when it is made; what lies below them is scrolled instead.

    An open list is turned as ever.
    """

    def __init__(self, dialog: QWidget) -> None:
        super().__init__(dialog)
        for control in (*dialog.findChildren(QComboBox), *dialog.findChildren(QAbstractSpinBox)):
            control.setFocusPolicy(Qt.FocusPolicy.StrongFocus)  # nor may it take the focus to them
            control.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Wheel:
            event.ignore()
            return True
        return False


class Sign(Enum):
    """What a sign stands for."""

    WHEEL = "steering wheel"
    READY = "ready"
    DRIVES = "drives"
    PAUSE = "pause"
    STOP = "stop"
    BARRED = "barred"
    WARNING = "warning"
    INFO = "information"


def paint_sign(painter: QPainter, box: QRectF, sign: Sign, ink: QColor) -> None:
    """The sign in one colour, as large as fits into `box`."""
    painter.save()
    painter.translate(box.center())
    side = min(box.width(), box.height()) / 2
    painter.scale(side, side)
    painter.fillPath(_path(sign), ink)
    painter.restore()


def key_cap_width(key: str) -> float:
    return QFontMetrics(theme.semi_bold(theme.Size.LABEL)).horizontalAdvance(key) + 12.0


def paint_key_cap(painter: QPainter, middle: QPointF, key: str, ink: QColor) -> None:
    """The name of a key in a small outlined cap."""
    cap = QRectF(0, 0, key_cap_width(key), 18)
    cap.moveCenter(middle)
    edge = QColor(ink)
    edge.setAlphaF(0.55)
    painter.setPen(QPen(edge, 1))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawRoundedRect(cap, 4, 4)
    painter.setPen(ink)
    painter.setFont(theme.semi_bold(theme.Size.LABEL))
    painter.drawText(cap, Qt.AlignmentFlag.AlignCenter, key)


def octagon(box: QRectF, cut: float) -> QPolygonF:
    """`box` with its corners cut off by `cut` each way."""
    left, top, right, bottom = box.left(), box.top(), box.right(), box.bottom()
    corners = [
        (left + cut, top), (right - cut, top), (right, top + cut), (right, bottom - cut),
        (right - cut, bottom), (left + cut, bottom), (left, bottom - cut), (left, top + cut),
    ]  # fmt: skip
    return QPolygonF([QPointF(x, y) for x, y in corners])


@cache
def _path(sign: Sign) -> QPainterPath:
    """The sign in a box of -1..1, y down."""
    return {
        Sign.WHEEL: _wheel,
        Sign.READY: _ready,
        Sign.DRIVES: _drives,
        Sign.PAUSE: _pause,
        Sign.STOP: _stop,
        Sign.BARRED: _barred,
        Sign.WARNING: _warning,
        Sign.INFO: _info,
    }[sign]()


def _stroker(width: float) -> QPainterPathStroker:
    stroker = QPainterPathStroker()
    stroker.setWidth(width)
    stroker.setCurveThreshold(0.005)  # the usual one is for pixels, and makes octagons of circles this small
    return stroker


def _lines(width: float, *lines: list[tuple[float, float]], joined: bool = False) -> QPainterPath:
    """Open lines of some width, with round ends and corners; `joined` closes them."""
    path = QPainterPath()
    for points in lines:
        path.addPolygon(QPolygonF([QPointF(x, y) for x, y in points]))
        if joined:
            path.closeSubpath()
    stroker = _stroker(width)
    stroker.setCapStyle(Qt.PenCapStyle.RoundCap)
    stroker.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    return stroker.createStroke(path)


def _ring(radius: float, width: float) -> QPainterPath:
    path = QPainterPath()
    path.addEllipse(QPointF(0, 0), radius, radius)
    return _stroker(width).createStroke(path)


def _disc(x: float, y: float, radius: float) -> QPainterPath:
    path = QPainterPath()
    path.addEllipse(QPointF(x, y), radius, radius)
    return path


def _filled(points: QPolygonF) -> QPainterPath:
    path = QPainterPath()
    path.addPolygon(points)
    path.closeSubpath()
    return path


def _wheel() -> QPainterPath:
    spokes = [[(0.0, 0.0), (0.84 * math.cos(a), 0.84 * math.sin(a))] for a in (math.radians(d) for d in (90, 210, 330))]
    return _ring(0.84, 0.26).united(_lines(0.26, *spokes)).united(_disc(0, 0, 0.28))


def _ready() -> QPainterPath:
    return _ring(0.86, 0.22).united(_filled(QPolygonF([QPointF(-0.26, -0.46), QPointF(0.54, 0.0), QPointF(-0.26, 0.46)])))


def _drives() -> QPainterPath:
    chevrons = [[(x, -0.66), (x + 0.66, 0.0), (x, 0.66)] for x in (-0.72, 0.06)]
    return _lines(0.34, *chevrons)


def _pause() -> QPainterPath:
    path = QPainterPath()
    path.addRoundedRect(QRectF(-0.68, -0.82, 0.48, 1.64), 0.1, 0.1)
    path.addRoundedRect(QRectF(0.20, -0.82, 0.48, 1.64), 0.1, 0.1)
    return path


def _stop() -> QPainterPath:
    bar = QPainterPath()
    bar.addRect(QRectF(-0.54, -0.18, 1.08, 0.36))
    return _filled(octagon(QRectF(-0.96, -0.96, 1.92, 1.92), 0.56)).subtracted(bar)


def _barred() -> QPainterPath:
    return _ring(0.84, 0.28).united(_lines(0.28, [(-0.56, 0.56), (0.56, -0.56)]))


def _warning() -> QPainterPath:
    plate = _lines(0.24, [(0.0, -0.78), (0.86, 0.72), (-0.86, 0.72)], joined=True)
    plate = plate.united(_filled(QPolygonF([QPointF(0.0, -0.78), QPointF(0.86, 0.72), QPointF(-0.86, 0.72)])))
    return plate.subtracted(_lines(0.22, [(0.0, -0.28), (0.0, 0.22)])).subtracted(_disc(0.0, 0.53, 0.13))


def _info() -> QPainterPath:
    path = _disc(0, 0, 0.96)  # what is added inside becomes a hole
    path.addPath(_disc(0, -0.5, 0.16))
    path.addPath(_lines(0.26, [(0.0, -0.06), (0.0, 0.54)]))
    return path
