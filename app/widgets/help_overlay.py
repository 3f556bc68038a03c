"""All keys on one page, over the window."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QRectF, Qt
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from app import palette, theme
from app.next_step import DEADMAN_KEY, STOP_KEY, Step
from app.widgets.overlays import Layer

KEY_TABLE: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    (
        "Move the robot (hold)",
        (
            ("A  D   or   \N{LEFTWARDS ARROW}  \N{RIGHTWARDS ARROW}", "bend the head left, right"),
            ("W  S   or   \N{UPWARDS ARROW}  \N{DOWNWARDS ARROW}", "advance, retract"),
            ("E   Q", "lift, dip the head"),
            ("PgUp   PgDn", "sheath forward, back"),
            ("X", "straighten the head"),
        ),
    ),
    (
        "Who drives",
        (
            (STOP_KEY, "STOP, in any focus"),
            *((step.value.key, step.value.name.lower()) for step in Step if step is not Step.DISARM),
            (DEADMAN_KEY, "deadman: hold it"),
            ("Any moving key", "takes back at once"),
        ),
    ),
    (
        "Overlays",
        (*((layer.value.key, layer.value.label) for layer in Layer), ("0", "all on or off")),
    ),
    (
        "Window",
        (
            ("Click", "destination"),
            ("Right click, Esc", "clear it"),
            ("P   or   Ctrl+S", "snapshot into your pictures"),
            ("F9", "record, end the recording"),
            ("F10", "save the last 30 s"),
            ("R", "another random phantom"),
            ("F5", "start the rig again"),
            ("Wheel, drag, F", "zoom, move, whole picture"),
            ("Tab, Enter", "go to a button, press it"),
            ("F11", "full screen (Esc leaves)"),
            ("F1", "this page (Esc closes)"),
            ("Ctrl+Q", "quit"),
        ),
    ),
)
_SHARES = (0.29, 0.27, 0.16, 0.28)
_KEYS_PX = (134.0, 116.0, 34.0, 108.0)
_ROW = 30
_HEAD = 40


class HelpOverlay(QWidget):
    """Covers its parent; a click closes it."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._parent = parent
        self.hide()
        self.setAccessibleName("Keys")
        self.setAccessibleDescription("; ".join(f"{key}: {text}" for _, rows in KEY_TABLE for key, text in rows))
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
        page = QRectF(0, 0, min(1180, self.width() - 40), 460)
        page.moveCenter(QRectF(self.rect()).center())
        painter.setPen(QPen(QColor(palette.LINE), 1))
        painter.setBrush(QColor(palette.PANEL))
        painter.drawRoundedRect(page, 12, 12)
        painter.setPen(QColor(palette.TEXT))
        painter.setFont(theme.bold(22))
        painter.drawText(page.adjusted(32, 22, 0, 0), Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop, "Keys")
        left = page.left() + 32
        for index, share in enumerate(_SHARES):
            width = (page.width() - 40) * share
            self._paint_table(painter, left, page.top() + 68, width - 16, index)
            left += width
        painter.end()

    @staticmethod
    def _paint_table(painter: QPainter, left: float, top: float, width: float, index: int) -> None:
        title, rows = KEY_TABLE[index]
        painter.setPen(QColor(palette.SKY))
        painter.setFont(theme.semi_bold(14))
        painter.drawText(QRectF(left, top, width, _HEAD - 8), Qt.AlignmentFlag.AlignVCenter, title)
        top += _HEAD - 6
        keys_width = _KEYS_PX[index]
        for key, text in rows:
            painter.setPen(QColor(palette.TEXT))
            painter.setFont(theme.semi_bold(13))
            painter.drawText(QRectF(left, top, keys_width, _ROW), Qt.AlignmentFlag.AlignVCenter, key)
            painter.setPen(QColor(palette.TEXT_DIM))
            text_font = theme.font(13)
            painter.setFont(text_font)
            shown = theme.elide(text_font, text, int(width - keys_width))
            painter.drawText(QRectF(left + keys_width, top, width - keys_width, _ROW), Qt.AlignmentFlag.AlignVCenter, shown)
            top += _ROW
