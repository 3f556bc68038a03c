"""A message that goes away by itself, at the lower edge of the live picture."""

from __future__ import annotations

import re

from PySide6.QtCore import QEvent, QObject, Qt, QTimer
from PySide6.QtWidgets import QLabel, QWidget

from app import theme
from app.language import tr_text

_SHOWN_MS = 6000
_AFTER = re.compile(r"[/_-]")


class Toast(QLabel):
    """One line or two; the newest message replaces the one before."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._parent = parent
        self.setWordWrap(True)
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.NoTextInteraction)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._lift_px = 0
        self._message = ""
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self.hide)
        parent.installEventFilter(self)
        self.hide()

    def show_message(self, text: str, *, is_fault: bool = False) -> None:
        text = tr_text(text)
        edge = "@FAULT" if is_fault else "@LINE"
        theme.set_sheet(
            self,
            f"background: @RAISED; color: @TEXT; border: 1px solid {edge}; border-radius: 8px; padding: 8px 16px; font-size: 14px;",
        )
        self._message = text
        self.setText(_AFTER.sub("\\g<0>\N{ZERO WIDTH SPACE}", text))  # where a long name of a file may be broken
        self.setAccessibleName(text)
        self._place()
        self.show()
        self.raise_()
        self._timer.start(_SHOWN_MS)

    def text(self) -> str:
        """The message as it was said."""
        return self._message

    def lift(self, height_px: int) -> None:
        """Stay so far above the lower edge, where something else lies."""
        self._lift_px = height_px
        if self.isVisible():
            self._place()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and self.isVisible():
            self._place()
        return False

    def _place(self) -> None:
        room = self._parent.rect()
        widest = max(200, room.width() - 40)
        self.setFixedWidth(min(widest, self.fontMetrics().horizontalAdvance(self.text()) + 60))
        self.setFixedHeight(self.heightForWidth(self.width()))
        self.move((room.width() - self.width()) // 2, room.height() - self.height() - 16 - self._lift_px)
