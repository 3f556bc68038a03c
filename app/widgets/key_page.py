"""All keys of a window on one page, over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject, QRectF, Qt
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from app import palette, theme

KeyTable = tuple[str, tuple[tuple[str, str], ...]]
"""A title, and (key, what it does) below it."""
_MOST_WIDTH, _EDGE = 1200, 32
_TITLE, _HEAD, _ROW, _BETWEEN = 68, 33, 28.5, 12


@dataclass(frozen=True, slots=True)
class KeyColumn:
    """Tables below each other: their share of the page's width, and the room for the keys."""

    tables: tuple[KeyTable, ...]
    share: float
    keys_px: float

    @property
    def height(self) -> float:
        return sum(_HEAD + _ROW * len(rows) + _BETWEEN for _, rows in self.tables)


class KeyPage(QWidget):
    """Covers its parent; a click closes it."""

    def __init__(self, parent: QWidget, columns: Sequence[KeyColumn]) -> None:
        super().__init__(parent)
        self._parent = parent
        self._columns = tuple(columns)
        self.hide()
        self.setAccessibleName("Keys")
        rows = (row for column in self._columns for _, table in column.tables for row in table)
        self.setAccessibleDescription("; ".join(f"{key}: {text}" for key, text in rows))
        parent.installEventFilter(self)

    def toggle(self) -> None:
        self.setGeometry(self._parent.rect())
        self.setVisible(not self.isVisible())
        self.raise_()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self.setGeometry(self._parent.rect())
        return False

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.hide()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.fillRect(self.rect(), theme.colour(palette.INK, 0.78))
        height = _TITLE + max(column.height for column in self._columns) + _EDGE / 2
        page = QRectF(0, 0, min(_MOST_WIDTH, self.width() - 36), height)
        page.moveCenter(QRectF(self.rect()).center())
        painter.setPen(QPen(QColor(palette.LINE), 1))
        painter.setBrush(QColor(palette.PANEL))
        painter.drawRoundedRect(page, 12, 12)
        painter.setPen(QColor(palette.TEXT))
        painter.setFont(theme.bold(22))
        painter.drawText(page.adjusted(_EDGE, 22, 0, 0), Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop, "Keys")
        left = page.left() + _EDGE
        for column in self._columns:
            width, top = (page.width() - 1.5 * _EDGE) * column.share, page.top() + _TITLE
            for title, rows in column.tables:
                top = _paint_table(painter, QRectF(left, top, width - 15, 0), title, rows, column.keys_px) + _BETWEEN
            left += width
        painter.end()


def _paint_table(painter: QPainter, place: QRectF, title: str, rows: tuple[tuple[str, str], ...], keys_px: float) -> float:
    """Returns where it ends."""
    painter.setPen(QColor(palette.SKY))
    painter.setFont(theme.semi_bold(14))
    painter.drawText(QRectF(place.left(), place.top(), place.width(), 30), Qt.AlignmentFlag.AlignVCenter, title)
    top = place.top() + _HEAD
    for key, text in rows:
        painter.setPen(QColor(palette.TEXT))
        painter.setFont(theme.fitted(theme.semi_bold(13), key, int(keys_px - 6)))
        painter.drawText(QRectF(place.left(), top, keys_px, _ROW), Qt.AlignmentFlag.AlignVCenter, key)
        painter.setPen(QColor(palette.TEXT_DIM))
        painter.setFont(theme.fitted(theme.font(13), text, int(place.width() - keys_px)))
        room = QRectF(place.left() + keys_px, top, place.width() - keys_px, _ROW)
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, text)
        top += _ROW
    return top
