"""A question in the place where it was raised: unlike a dialog it takes no key from the window, so STOP works while it is open."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QTimer, Signal, Slot
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QWidget

from app import theme
from app.language import tr

_OPEN_MS = 20_000
BUTTON_STYLE = "padding: 0 9px; min-height: 20px; font-size: 12px;"


class QuestionStrip(QWidget):
    """One line with the question, the answer that does it, and Cancel. Left alone for 20 s it takes itself back.

    ``closed`` comes after either answer. What is asked for is done by the callback given to ``ask``.
    """

    closed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._action: Callable[[], None] | None = None
        self._text = ""
        self._question = QLabel()
        theme.set_sheet(self._question, "color: @ORANGE; font-size: 12px; font-weight: 600;")
        self._yes = QPushButton()
        self._no = QPushButton(tr("Cancel"))
        for button in (self._yes, self._no):
            button.setStyleSheet(BUTTON_STYLE)
        self._yes.clicked.connect(self._on_yes)
        self._no.clicked.connect(self.cancel)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(_OPEN_MS)
        self._timer.timeout.connect(self.cancel)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(6)
        row.addWidget(self._question, 1)
        row.addWidget(self._yes)
        row.addWidget(self._no)
        self.setAccessibleName(tr("Question"))

    @property
    def text(self) -> str:
        """The open question; empty when there is none."""
        return self._text

    def ask(self, question: str, answer: str, action: Callable[[], None]) -> None:
        """Open the question; `action` is done when `answer` is pressed. A question that was open is taken back."""
        self._action, self._text = action, question
        self._yes.setText(answer)
        self.setAccessibleDescription(question)
        self._fit()
        self._timer.start()
        self._no.setFocus()

    @Slot()
    def cancel(self) -> None:
        """Take the question back."""
        if self._text:
            self._close()

    @Slot()
    def _on_yes(self) -> None:
        action = self._action
        self._close()
        if action is not None:
            action()

    def _close(self) -> None:
        self._action, self._text = None, ""
        self._timer.stop()
        self.closed.emit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """The question must not push the buttons out of a narrow window; its tool tip has all of it."""
        room = self.width() - self._yes.sizeHint().width() - self._no.sizeHint().width() - 16
        text = f"! {self._text}" if self._text else ""
        self._question.setText(theme.elide(theme.semi_bold(12), text, max(40, room)))
        self._question.setToolTip(self._text)
