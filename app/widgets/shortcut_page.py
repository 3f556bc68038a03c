"""All keys of a window on one page, over it.

The operator window's keys.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetrics, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QMainWindow, QWidget

from app.operator.manual_drive import KEYS
from app.ui import theme
from app.ui.actions import KeyTable, key_names, menu_tables, shown
from app.ui.i18n import mark, tr
from app.ui.texts import DEADMAN_KEY

TablesOf = Callable[[QMainWindow], Sequence[KeyTable]]
_MOST_WIDTH, _MOST_COLUMNS, _EDGE, _GUTTER = 1280, 4, 28, 22
_TITLE, _HEAD, _ROW, _BETWEEN = 58.0, 29.0, 26.0, 10.0
_LEAST_ROW = 16.0
_CLEAR_PX = 4
_KEYS_SHARE = 0.46


@dataclass(frozen=True, slots=True)
class _Layout:
    columns: tuple[tuple[KeyTable, ...], ...]
    scale: float


class KeyPage(QWidget):
    """Covers its parent; a click closes it. What it says is asked for each time that it opens.

    Parameters
    ----------
    parent : what it covers, a part of the window whose keys these are.
    tables_of : the tables in their order, of that window.
    above : what the page ends above, a part of the parent that must stay in sight and in reach.
    """

    def __init__(self, parent: QWidget, tables_of: TablesOf, above: QWidget | None = None) -> None:
        super().__init__(parent)
        self._parent = parent
        self._tables_of = tables_of
        self._above = above
        self._tables: tuple[KeyTable, ...] = ()
        self.hide()
        self.setAccessibleName(tr("Keys"))
        parent.installEventFilter(self)
        if above is not None:
            above.installEventFilter(self)

    @property
    def tables(self) -> tuple[KeyTable, ...]:
        """What it says, as of the last opening."""
        return self._tables

    def toggle(self) -> None:
        """Open it, or close it."""
        window = self._parent.window()
        if not self.isVisible() and isinstance(window, QMainWindow):
            self._tables = tuple(self._tables_of(window))
            rows = (row for _, table in self._tables for row in table)
            self.setAccessibleDescription("; ".join(f"{key}: {text}" for key, text in rows))
        self.setGeometry(self._room())
        self.setVisible(not self.isVisible())
        self.raise_()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in (QEvent.Type.Resize, QEvent.Type.Move):
            self.setGeometry(self._room())
        return False

    def _room(self) -> QRect:
        room = self._parent.rect()
        if self._above is not None:
            room.setBottom(self._above.mapTo(self._parent, QPoint(0, 0)).y() - _CLEAR_PX)
        return room

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.hide()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), theme.colour(theme.ON_PICTURE.INK, 0.78))
        layout = _laid_out(self._tables, self.height() - 24 - _TITLE - _EDGE / 2)
        heights = [_height(column) * layout.scale for column in layout.columns]
        page = QRectF(0, 0, min(_MOST_WIDTH, self.width() - 24), _TITLE + max(heights, default=0.0) + _EDGE / 2)
        page.moveCenter(QRectF(self.rect()).center())
        painter.setPen(QPen(QColor(theme.LINE), 1))
        painter.setBrush(QColor(theme.PANEL))
        painter.drawRoundedRect(page, 12, 12)
        painter.setPen(QColor(theme.TEXT))
        painter.setFont(theme.bold(22))
        corner = Qt.AlignmentFlag.AlignTop
        painter.drawText(page.adjusted(_EDGE, 18, 0, 0), Qt.AlignmentFlag.AlignLeft | corner, tr("Keys"))
        painter.setPen(QColor(theme.TEXT_FAINT))
        painter.setFont(theme.font(12))
        painter.drawText(page.adjusted(0, 24, -_EDGE, 0), Qt.AlignmentFlag.AlignRight | corner, tr("F1 or Esc closes this page"))
        left = page.left() + _EDGE
        for column, width in zip(layout.columns, _widths(layout.columns, page.width() - 2 * _EDGE), strict=True):
            _paint_column(painter, QRectF(left, page.top() + _TITLE, width, 0), column, layout.scale)
            left += width + _GUTTER
        painter.end()


def _height(tables: Sequence[KeyTable]) -> float:
    return sum(_HEAD + _ROW * len(rows) + _BETWEEN for _, rows in tables)


def _laid_out(tables: Sequence[KeyTable], room: float) -> _Layout:
    """In as few columns as fit, three at least; when nothing fits, the rows move together."""
    columns: list[tuple[KeyTable, ...]] = []
    for count in range(3, _MOST_COLUMNS + 1):
        columns = _in_columns(tables, count)
        if _tallest(columns) <= room:
            return _Layout(tuple(columns), 1.0)
    return _Layout(tuple(columns), max(_LEAST_ROW / _ROW, room / max(1.0, _tallest(columns))))


def _tallest(columns: Sequence[Sequence[KeyTable]]) -> float:
    return max((_height(column) for column in columns), default=0.0)


def _in_columns(tables: Sequence[KeyTable], count: int) -> list[tuple[KeyTable, ...]]:
    """The tables in their order, none of them cut, in `count` columns at most; the tallest is as low as can be."""
    limits = sorted({_height(tables[first:last]) for first in range(len(tables)) for last in range(first + 1, len(tables) + 1)})
    for limit in limits:
        columns: list[list[KeyTable]] = [[]]
        for table in tables:
            if columns[-1] and _height([*columns[-1], table]) > limit:
                columns.append([])
            columns[-1].append(table)
        if len(columns) <= count and _tallest(columns) <= limit:
            return [tuple(column) for column in columns]
    return [tuple(tables)]


def _widths(columns: Sequence[Sequence[KeyTable]], room: float) -> list[float]:
    """Each as its longest row needs; what is left over, or missing, is shared."""
    metrics = QFontMetrics(theme.font(13))
    texts = [max(metrics.horizontalAdvance(text) for _, rows in column for _, text in rows) for column in columns]
    needed = [_keys_width(column) + text + 2.0 for column, text in zip(columns, texts, strict=True)]
    spare = room - _GUTTER * (len(columns) - 1) - sum(needed)
    if spare < 0.0:
        return [width * (1.0 + spare / sum(needed)) for width in needed]
    return [width + spare / len(columns) for width in needed]


def _keys_width(tables: Sequence[KeyTable]) -> float:
    metrics = QFontMetrics(theme.semi_bold(13))
    return max(metrics.horizontalAdvance(key) for _, rows in tables for key, _ in rows) + 14.0


def _paint_column(painter: QPainter, place: QRectF, tables: Sequence[KeyTable], scale: float) -> None:
    keys_px = min(_keys_width(tables), _KEYS_SHARE * place.width())
    top = place.top()
    for title, rows in tables:
        painter.setPen(QColor(theme.SKY))
        painter.setFont(theme.semi_bold(14))
        painter.drawText(QRectF(place.left(), top, place.width(), _HEAD * scale - 3), Qt.AlignmentFlag.AlignVCenter, title)
        top += _HEAD * scale
        for key, text in rows:
            _paint_row(painter, QRectF(place.left(), top, place.width(), _ROW * scale), key, text, keys_px)
            top += _ROW * scale
        top += _BETWEEN * scale


def _paint_row(painter: QPainter, place: QRectF, key: str, text: str, keys_px: float) -> None:
    painter.setPen(QColor(theme.TEXT))
    painter.setFont(theme.fitted(theme.semi_bold(13), key, int(keys_px - 6)))
    painter.drawText(place, Qt.AlignmentFlag.AlignVCenter, key)
    painter.setPen(QColor(theme.TEXT_DIM))
    room = place.adjusted(keys_px, 0, 0, 0)
    painter.setFont(theme.fitted(theme.font(13), text, int(room.width())))
    painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, theme.elide(painter.font(), text, int(room.width())))


_HELD = (mark("Hold to move, release to stop"), tuple((key_names(keys), motion.value) for motion, keys in KEYS.items()))
_DRIVING = (
    mark("While the program drives"),
    ((DEADMAN_KEY, mark("deadman: it drives while held")), (mark("Any key above"), mark("you steer again, at once"))),
)
_ELSE = (
    mark("Mouse and focus"),
    (
        (mark("Click"), mark("destination; right click clears it")),
        (mark("Wheel, drag"), mark("zoom the picture, move it")),
        (mark("Tab, Enter"), mark("go to a control, press or open it")),
    ),
)


def operator_keys(window: QMainWindow) -> Sequence[KeyTable]:
    """The keys that move the robot, and those of the menus."""
    return (*map(shown, (_HELD, _DRIVING)), *menu_tables(window), shown(_ELSE))


def operator_help(parent: QWidget, above: QWidget) -> KeyPage:
    """The page of the operator window, over `parent`; it ends above what the robot is stopped with."""
    return KeyPage(parent, operator_keys, above)
