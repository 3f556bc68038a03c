"""All keys of the player on one page, over the window."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QRectF, Qt
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from app import palette, theme
from app.widgets.overlays import Layer

KEY_TABLES: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    (
        "Play",
        (
            ("Space", "play, pause"),
            ("\N{LEFTWARDS ARROW}   \N{RIGHTWARDS ARROW}", "one frame back, on"),
            ("Shift + arrow", "one second"),
            ("Ctrl + arrow", "ten seconds"),
            ("Home   End", "first, last frame"),
            ("[   ]   R", "slower, faster, as recorded"),
            ("T", "go to a time in ms"),
        ),
    ),
    (
        "Jump",
        (
            ("N   P", "next, previous"),
            ("K", "of which kind: the next one"),
            ("F6", "the list of events"),
            ("+   \N{MINUS SIGN}", "zoom the timeline"),
            ("Ctrl + 0", "the whole session"),
            ("Click, drag", "on the timeline: go there"),
            ("Wheel", "on the timeline: zoom"),
        ),
    ),
    (
        "Keep",
        (
            ("I   O", "selection from here, to here"),
            ("Shift + drag", "on the timeline: select"),
            ("E", "selection as video"),
            ("S   Ctrl+S", "snapshot of this picture"),
            ("M", "note at this time"),
            ("Esc", "close, cancel, unselect"),
            ("F1   F11   Ctrl+Q", "keys, full screen, quit"),
        ),
    ),
    (
        "Overlays",
        (*((f"{layer.value.key}", layer.value.label) for layer in Layer), ("0", "all on or off"), ("F", "whole picture")),
    ),
)
_SHARES = (0.27, 0.27, 0.29, 0.17)
_KEYS_PX = (118.0, 104.0, 124.0, 34.0)
_ROW = 30


class PlayerHelp(QWidget):
    """Covers its parent; a click closes it."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._parent = parent
        self.hide()
        self.setAccessibleName("Keys")
        self.setAccessibleDescription("; ".join(f"{key}: {text}" for _, rows in KEY_TABLES for key, text in rows))
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
        page = QRectF(0, 0, min(1180, self.width() - 40), 490)
        page.moveCenter(QRectF(self.rect()).center())
        painter.setPen(QPen(QColor(palette.LINE), 1))
        painter.setBrush(QColor(palette.PANEL))
        painter.drawRoundedRect(page, 12, 12)
        painter.setPen(QColor(palette.TEXT))
        painter.setFont(theme.bold(22))
        painter.drawText(page.adjusted(32, 22, 0, 0), Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop, "Keys")
        left = page.left() + 32
        for (title, rows), share, keys_px in zip(KEY_TABLES, _SHARES, _KEYS_PX, strict=True):
            width = (page.width() - 40) * share
            _paint_table(painter, QRectF(left, page.top() + 68, width - 16, 0), title, rows, keys_px)
            left += width
        painter.end()


def _paint_table(painter: QPainter, place: QRectF, title: str, rows: tuple[tuple[str, str], ...], keys_px: float) -> None:
    painter.setPen(QColor(palette.SKY))
    painter.setFont(theme.semi_bold(14))
    painter.drawText(QRectF(place.left(), place.top(), place.width(), 30), Qt.AlignmentFlag.AlignVCenter, title)
    top = place.top() + 34
    for key, text in rows:
        painter.setPen(QColor(palette.TEXT))
        painter.setFont(theme.fitted(theme.semi_bold(13), key, int(keys_px - 6)))
        painter.drawText(QRectF(place.left(), top, keys_px, _ROW), Qt.AlignmentFlag.AlignVCenter, key)
        painter.setPen(QColor(palette.TEXT_DIM))
        painter.setFont(theme.fitted(theme.font(13), text, int(place.width() - keys_px)))
        room = QRectF(place.left() + keys_px, top, place.width() - keys_px, _ROW)
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, text)
        top += _ROW
