"""Offers at the lower edge of the picture: something can be done now, and nothing waits for an answer.

Unlike a dialog it takes no key from the window, so STOP and the hand on the robot work while it is open.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QProgressBar, QPushButton, QSizePolicy, QVBoxLayout, QWidget

from app import palette
from app.language import tr

_WIDEST_PX = 900
_MARGIN_PX = 12
_INK = palette.ON_PICTURE
_SHAPE = "padding: 0 10px; min-height: 24px; font-size: 13px;"
_PLAIN = f"{_SHAPE} background: {_INK.RAISED}; color: {_INK.TEXT}; border: 1px solid {_INK.TEXT_FAINT};"
_MAIN = f"{_SHAPE} background: {_INK.SKY}; color: {_INK.INK}; font-weight: 600; border: 1px solid {_INK.SKY};"
_FOCUS = f"QPushButton:focus {{ border: 2px solid {_INK.TEXT}; }} QPushButton:hover {{ border-color: {_INK.TEXT}; }}"


@dataclass(frozen=True, slots=True)
class Answer:
    """A button: its word, what it does, and a tool tip."""

    name: str
    action: Callable[[], object]
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class Offer:
    """What can be done. Of several, one is shown at a time, oldest first; an offer with a known key takes the old one's place.

    Attributes
    ----------
    text, detail : what is the matter, and a second line.
    answers : the first one is the one that is meant, unless work goes on; pressing any of them closes the offer first.
    share : None: no work goes on; 0..1: how much is done; negative: work goes on, nobody knows how long.
    is_fault : something went wrong.
    dismissed : when the cross is pressed; without one the offer only goes.
    """

    key: str
    text: str
    detail: str = ""
    answers: tuple[Answer, ...] = ()
    share: float | None = None
    is_fault: bool = False
    dismissed: Callable[[], None] | None = None


class OfferStrip(QFrame):
    """Lies over the lower edge of its parent. ``lifted`` carries how many px it covers there, 0 when it is closed."""

    lifted = Signal(int)

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._parent = parent
        self._offers: dict[str, Offer] = {}
        self._shown: Offer | None = None
        self._buttons: list[QPushButton] = []
        self._text, self._detail, self._more = QLabel(), QLabel(), QLabel()
        self._text.setWordWrap(True)
        self._detail.setWordWrap(True)
        self._text.setStyleSheet(f"color: {_INK.TEXT}; font-size: 14px; font-weight: 600; border: none; background: none;")
        for label in (self._detail, self._more):
            label.setStyleSheet(f"color: {_INK.TEXT_DIM}; font-size: 12px; border: none; background: none;")
        self._bar = QProgressBar()
        self._bar.setTextVisible(False)
        self._bar.setFixedHeight(6)
        self._bar.setStyleSheet(
            f"QProgressBar {{ background: {_INK.WINDOW}; border: none; border-radius: 3px; }}"
            f"QProgressBar::chunk {{ background: {_INK.SKY}; border-radius: 3px; }}"
        )
        words = QVBoxLayout()
        words.setSpacing(2)
        for widget in (self._text, self._detail, self._bar):
            words.addWidget(widget)
        self._row = QHBoxLayout()
        self._row.setSpacing(6)
        whole = QHBoxLayout(self)
        whole.setContentsMargins(14, 8, 8, 8)
        whole.setSpacing(12)
        whole.addLayout(words, 1)
        whole.addWidget(self._more)
        whole.addLayout(self._row)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setCursor(Qt.CursorShape.ArrowCursor)
        parent.installEventFilter(self)
        self.hide()

    @property
    def text(self) -> str:
        """What is shown, "" when nothing is."""
        if self._shown is None:
            return ""
        return f"{self._shown.text} {self._shown.detail}".strip()

    @property
    def answers(self) -> dict[str, QPushButton]:
        """The buttons that are shown, by their words."""
        return {button.text(): button for button in self._buttons}

    def offer(self, offer: Offer) -> None:
        """Show it, after those that wait already; or renew the one of that key."""
        self._offers[offer.key] = offer
        self._show()

    def withdraw(self, key: str) -> None:
        """It is no longer true."""
        if self._offers.pop(key, None) is not None:
            self._show()

    def has(self, key: str) -> bool:
        return key in self._offers

    # ---- what is shown

    def _show(self) -> None:
        before, self._shown = self._shown, next(iter(self._offers.values()), None)
        offer = self._shown
        if offer is None:
            had_focus = self.isAncestorOf(self.window().focusWidget()) if self.window().focusWidget() is not None else False
            self.hide()
            if had_focus:
                self._parent.setFocus()
            self.lifted.emit(0)
            return
        self._text.setText(offer.text)
        self._detail.setText(offer.detail)
        self._detail.setVisible(bool(offer.detail))
        self._bar.setVisible(offer.share is not None)
        if offer.share is not None:
            self._bar.setRange(0, 1000 if offer.share >= 0.0 else 0)
            self._bar.setValue(round(1000 * max(0.0, offer.share)))
        waiting = len(self._offers) - 1
        self._more.setText(tr("+{count} more", count=waiting))
        self._more.setVisible(waiting > 0)
        edge = _INK.FAULT if offer.is_fault else _INK.SKY
        self.setStyleSheet(f"OfferStrip {{ background: {_INK.RAISED}; border: 1px solid {edge}; border-radius: 8px; }}")
        self.setAccessibleName(offer.text)
        self.setAccessibleDescription(offer.detail)
        names = [answer.name for answer in offer.answers]
        if before is None or before.key != offer.key or [answer.name for answer in before.answers] != names:
            self._make_buttons(offer)
        self.show()
        self._place()
        self.raise_()

    def _make_buttons(self, offer: Offer) -> None:
        for button in self._buttons:
            self._row.removeWidget(button)
            button.hide()
            button.deleteLater()
        self._buttons = []
        for place, answer in enumerate(offer.answers):
            self._add_button(answer.name, answer.meaning or answer.name, place == 0 and offer.share is None)
        cross = self._add_button("\N{MULTIPLICATION SIGN}", tr("Close this"), False)
        cross.setAccessibleName(tr("Close this offer"))
        cross.setFixedWidth(30)

    def _add_button(self, name: str, meaning: str, is_main: bool) -> QPushButton:
        button = _AnswerButton(name)
        button.setStyleSheet(f"QPushButton {{ {_MAIN if is_main else _PLAIN} }} {_FOCUS}")
        button.setToolTip(meaning)
        button.setAccessibleDescription(meaning)
        button.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        button.setFocusPolicy(Qt.FocusPolicy.TabFocus)  # a click must not take the arrows from the robot
        button.clicked.connect(lambda _checked=False, n=name: self._on_answer(n))
        self._row.addWidget(button)
        self._buttons.append(button)
        return button

    def _on_answer(self, name: str) -> None:
        offer = self._shown
        if offer is None:
            return
        action = next((answer.action for answer in offer.answers if answer.name == name), offer.dismissed)
        self.withdraw(offer.key)
        if action is not None:
            action()

    # ---- its place

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and self.isVisible():
            self._place()
        return False

    def _place(self) -> None:
        room = self._parent.rect()
        width = min(_WIDEST_PX, room.width() - 2 * _MARGIN_PX)
        layout = self.layout()
        assert layout is not None
        layout.activate()
        height = max(48, layout.totalHeightForWidth(width) if layout.hasHeightForWidth() else self.sizeHint().height())
        self.setGeometry((room.width() - width) // 2, room.height() - height - _MARGIN_PX, width, height)
        self.lifted.emit(height + _MARGIN_PX)


class _AnswerButton(QPushButton):
    """The second half of a double click is no answer: by then the button may be another offer's, which nobody has read."""

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        event.accept()
