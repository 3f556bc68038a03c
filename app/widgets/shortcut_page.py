"""All keys of a window on one page, over it; and those of the operator window."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QPoint, QRect, QRectF, Qt
from PySide6.QtGui import QMouseEvent, QPainter
from PySide6.QtWidgets import QMainWindow, QWidget

from app.ui import theme
from app.ui.actions import KeyTable, key_names, menu_tables, shown
from app.ui.i18n import mark, tr
from app.ui.texts import DEADMAN_KEY
from app.widgets.basics import OnResize
from app.widgets.jog_panel import KEYS
from app.widgets.painting import PaintedWidget, draw_box, draw_text, text_width

_MOST_WIDTH, _EDGE, _GUTTER = 1280, 28, 22
_COLUMNS = (3, 4)  # in as few as fit
_TITLE, _HEAD, _ROW, _BETWEEN = 58.0, 29.0, 26.0, 10.0
_LEAST_ROW = 16.0
_CLEAR_PX = 4
_KEYS_SHARE = 0.46  # of a column's width, at most

Column = tuple[KeyTable, ...]


class KeyPage(PaintedWidget):
    """Covers its parent; a click closes it. Its tables are made each time that it opens.

    Parameters
    ----------
    parent : what it covers, a part of the window whose keys these are.
    first, last : tables before and after those of the window's menus.
    above : what the page ends above, a part of the parent that must stay in sight and in reach.
    """

    def __init__(self, parent: QWidget, first: Column = (), last: Column = (), above: QWidget | None = None) -> None:
        super().__init__(tr("Keys"), parent=parent)
        self._parent = parent
        self._first, self._last = first, last
        self._above = above
        self._tables: Column = ()
        self.hide()
        for watched in (parent, above):
            if watched is not None:
                OnResize(watched, self, self._place, moves=True)

    @property
    def tables(self) -> Column:
        """The tables shown since the last opening."""
        return self._tables

    def toggle(self) -> None:
        window = self._parent.window()
        if not self.isVisible() and isinstance(window, QMainWindow):
            self._tables = (*map(shown, self._first), *menu_tables(window), *map(shown, self._last))
            rows = (row for _, table in self._tables for row in table)
            self.setAccessibleDescription("; ".join(f"{key}: {text}" for key, text in rows))
        self._place()
        self.setVisible(not self.isVisible())
        self.raise_()

    def _place(self) -> None:
        room = QRect(self._parent.rect())
        if self._above is not None:
            room.setBottom(self._above.mapTo(self._parent, QPoint(0, 0)).y() - _CLEAR_PX)
        self.setGeometry(room)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.hide()

    def paint(self, painter: QPainter) -> None:
        painter.fillRect(self.rect(), theme.colour(theme.ON_PICTURE.INK, 0.78))
        columns, scale = _lay_out(self._tables, self.height() - 24 - _TITLE - _EDGE / 2)
        page = QRectF(0, 0, min(_MOST_WIDTH, self.width() - 24), _TITLE + _tallest(columns) * scale + _EDGE / 2)
        page.moveCenter(QRectF(self.rect()).center())
        draw_box(painter, page, 12, theme.PANEL, theme.LINE)
        left, right, top = Qt.AlignmentFlag.AlignLeft, Qt.AlignmentFlag.AlignRight, Qt.AlignmentFlag.AlignTop
        draw_text(painter, page.adjusted(_EDGE, 18, 0, 0), tr("Keys"), theme.bold(22), theme.TEXT, left | top)
        hint = page.adjusted(0, 24, -_EDGE, 0)
        draw_text(painter, hint, tr("F1 or Esc closes this page"), theme.font(12), theme.TEXT_FAINT, right | top)
        x = page.left() + _EDGE
        for column, width in zip(columns, _widths(columns, page.width() - 2 * _EDGE), strict=True):
            _paint_column(painter, QRectF(x, page.top() + _TITLE, width, 0), column, scale)
            x += width + _GUTTER


def _height(tables: Sequence[KeyTable]) -> float:
    return sum(_HEAD + _ROW * len(rows) + _BETWEEN for _, rows in tables)


def _tallest(columns: Sequence[Column]) -> float:
    return max(map(_height, columns), default=0.0)


def _lay_out(tables: Column, room: float) -> tuple[tuple[Column, ...], float]:
    """The columns, and the scale of their rows: when nothing fits, the rows move together."""
    columns: tuple[Column, ...] = ()
    for count in _COLUMNS:
        columns = _in_columns(tables, count)
        if _tallest(columns) <= room:
            return columns, 1.0
    return columns, max(_LEAST_ROW / _ROW, room / max(1.0, _tallest(columns)))


def _in_columns(tables: Column, count: int) -> tuple[Column, ...]:
    """The tables in their order, none of them cut, in `count` columns at most; the tallest is as low as can be."""
    limits = sorted({_height(tables[first:last]) for first in range(len(tables)) for last in range(first + 1, len(tables) + 1)})
    for limit in limits:
        columns: list[Column] = [()]
        for table in tables:
            if columns[-1] and _height((*columns[-1], table)) > limit:
                columns.append(())
            columns[-1] += (table,)
        if len(columns) <= count and _tallest(columns) <= limit:
            return tuple(columns)
    return (tables,)


def _widths(columns: Sequence[Column], room: float) -> list[float]:
    """The width of each column's longest row; the difference to `room` is shared."""
    texts = [max(text_width(theme.font(13), text) for _, rows in column for _, text in rows) for column in columns]
    needed = [_keys_width(column) + text + 2.0 for column, text in zip(columns, texts, strict=True)]
    spare = room - _GUTTER * (len(columns) - 1) - sum(needed)
    if spare < 0.0:
        return [width * (1.0 + spare / sum(needed)) for width in needed]
    return [width + spare / len(columns) for width in needed]


def _keys_width(column: Column) -> float:
    return max(text_width(theme.semi_bold(13), key) for _, rows in column for key, _ in rows) + 14.0


def _paint_column(painter: QPainter, place: QRectF, tables: Column, scale: float) -> None:
    keys_px = min(_keys_width(tables), _KEYS_SHARE * place.width())
    line = QRectF(place)
    for title, rows in tables:
        line.setHeight(_HEAD * scale - 3)
        draw_text(painter, line, title, theme.semi_bold(14), theme.SKY)
        line.moveTop(line.top() + _HEAD * scale)
        line.setHeight(_ROW * scale)
        for key, text in rows:
            draw_text(painter, line, key, theme.fitted(theme.semi_bold(13), key, int(keys_px - 6)), theme.TEXT)
            room = line.adjusted(keys_px, 0, 0, 0)
            draw_text(painter, room, text, theme.font(13), theme.TEXT_DIM, smallest_px=11, elided=True)
            line.moveTop(line.top() + _ROW * scale)
        line.moveTop(line.top() + _BETWEEN * scale)


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


def operator_help(parent: QWidget, above: QWidget) -> KeyPage:
    """The page of the operator window, over `parent`; it ends above what the robot is stopped with."""
    return KeyPage(parent, (_HELD, _DRIVING), (_ELSE,), above)
