"""All keys of a window on one page, over it; and those of the operator window."""

from __future__ import annotations

from html import escape

from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QColor, QMouseEvent
from PySide6.QtWidgets import QFrame, QLabel, QMainWindow, QWidget

from app.ui import theme
from app.ui.actions import KeyTable, key_names, menu_tables, shown
from app.ui.i18n import mark, tr
from app.ui.texts import DEADMAN_KEY
from app.widgets.basics import OnResize, column, line
from app.widgets.jog_panel import KEYS

_MOST_WIDTH, _MARGIN_PX, _CLEAR_PX = 1280, 12, 4
_COLUMNS = 4
_SIZES = ((13, 5), (13, 3), (13, 1), (12, 1), (11, 0))
"""Of the text and of the space above and below it, px; the first with which all fits."""
_STYLE = f"""
QFrame#keys {{ background: @PANEL; border: 1px solid @LINE; border-radius: 12px; }}
KeyPage {{ background: {theme.colour(theme.ON_PICTURE.INK, 0.78).name(QColor.NameFormat.HexArgb)}; }}
"""

Column = tuple[KeyTable, ...]


class KeyPage(QFrame):
    """Covers its parent; a click closes it. Its tables are made each time that it opens.

    Parameters
    ----------
    parent : what it covers, a part of the window whose keys these are.
    first, last : tables before and after those of the window's menus.
    above : what the page ends above, a part of the parent that must stay in sight and in reach.
    """

    def __init__(self, parent: QWidget, first: Column = (), last: Column = (), above: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAccessibleName(tr("Keys"))
        self._parent = parent
        self._first, self._last = first, last
        self._above = above
        self.tables: Column = ()
        """Shown since the last opening."""
        title, hint, self._text = QLabel(tr("Keys")), QLabel(tr("F1 or Esc closes this page")), QLabel()
        title.setFont(theme.bold(22))
        hint.setObjectName("card_note")
        self._card = QFrame()
        self._card.setObjectName("keys")
        self._card.setLayout(column(line((title, 1), hint), (self._text, 1), margins=(28, 16, 28, 14)))
        self._text.setAlignment(Qt.AlignmentFlag.AlignTop)
        rows = column(self._card, margins=(_MARGIN_PX,) * 4)
        rows.setAlignment(self._card, Qt.AlignmentFlag.AlignVCenter)
        self.setLayout(rows)
        theme.set_sheet(self, _STYLE)
        self.hide()
        for watched in (parent, above):
            if watched is not None:
                OnResize(watched, self, self._place, moves=True)

    def toggle(self) -> None:
        window = self._parent.window()
        if not self.isVisible() and isinstance(window, QMainWindow):
            self.tables = (*map(shown, self._first), *menu_tables(window), *map(shown, self._last))
            rows = (row for _, table in self.tables for row in table)
            self.setAccessibleDescription("; ".join(f"{key}: {text}" for key, text in rows))
        self.setVisible(not self.isVisible())
        self._place()
        self.raise_()

    def _place(self) -> None:
        room = QRect(self._parent.rect())
        if self._above is not None:
            room.setBottom(self._above.mapTo(self._parent, QPoint(0, 0)).y() - _CLEAR_PX)
        self.setGeometry(room)
        self._card.setMaximumWidth(_MOST_WIDTH)
        self.follow_theme()

    def follow_theme(self) -> None:
        """The text again, in the scheme's colours, as large as fits."""
        if self.isHidden():
            return
        width, height = min(self.width() - 2 * _MARGIN_PX, _MOST_WIDTH), self.height() - 2 * _MARGIN_PX
        for size_px, space_px in _SIZES:
            self._text.setText(_page(self.tables, size_px, space_px))
            needed = self._card.sizeHint()
            if needed.width() <= width and needed.height() <= height:
                break

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.hide()


def _page(tables: Column, size_px: int, space_px: int) -> str:
    """All tables in columns, as HTML."""
    columns = "<td width=22></td>".join(
        f"<td><table cellspacing=0>{''.join(_rows(*table) for table in part)}</table></td>" for part in _in_columns(tables)
    )
    cells = f"td {{ font-size: {size_px}px; padding: {space_px}px 14px {space_px}px 0; white-space: pre; }}"
    heads = f"td.head {{ color: {theme.SKY}; font-weight: 600; font-size: {size_px + 1}px; padding-top: {3 * space_px}px; }}"
    looks = f"td.key {{ color: {theme.TEXT}; font-weight: 600; }} td.text {{ color: {theme.TEXT_DIM}; }}"
    return f"<style>{cells} {heads} {looks}</style><table width=100% cellspacing=0 cellpadding=0><tr>{columns}</tr></table>"


def _rows(title: str, rows: tuple[tuple[str, str], ...]) -> str:
    body = (f"<tr><td class=key>{escape(keys)}</td><td class=text>{escape(what)}</td></tr>" for keys, what in rows)
    return f"<tr><td class=head colspan=2>{escape(title)}</td></tr>{''.join(body)}"


def _in_columns(tables: Column) -> list[Column]:
    """The tables in their order, none of them cut, in ``_COLUMNS`` columns at most; the tallest is as low as can be."""
    most_rows = max((len(rows) + 1 for _, rows in tables), default=1)
    while True:
        columns: list[Column] = [()]
        height = 0
        for table in tables:
            rows = len(table[1]) + 1
            if height + rows > most_rows:
                columns, height = [*columns, ()], 0
            columns[-1], height = (*columns[-1], table), height + rows
        if len(columns) <= _COLUMNS:
            return columns
        most_rows += 1


_HELD = (mark("Hold to move, release to stop"), tuple((key_names(keys), motion.value) for motion, keys in KEYS.items()))
_DRIVING = (
    mark("While the program drives"),
    ((DEADMAN_KEY, mark("deadman: it drives while held")), (mark("Any key above"), mark("you steer again, at once"))),
)
_ELSE = (
    mark("Mouse and focus"),
    (
        (mark("Click"), mark("target; right click clears it")),
        (mark("Wheel, drag"), mark("zoom the picture, move it")),
        (mark("Tab, Enter"), mark("go to a control, press or open it")),
    ),
)


def operator_help(parent: QWidget, above: QWidget) -> KeyPage:
    """The page of the operator window, over `parent`; it ends above what the robot is stopped with."""
    return KeyPage(parent, (_HELD, _DRIVING), (_ELSE,), above)
