"""Messages that take no key from the window, so that STOP and driving by hand work while they are open.

Over the picture: toast, notice, offers. In a panel: a question.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QMouseEvent, QResizeEvent
from PySide6.QtWidgets import QFrame, QLabel, QProgressBar, QPushButton, QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.widgets.basics import OnResize, column, line, text_button
from app.widgets.painting import CENTER

_SHOWN_MS = 6000
_BREAK_AFTER = re.compile(r"[/_-]")  # where a long name of a file may be broken
_TOAST_STYLE = "background: @RAISED; color: @TEXT; border: 1px solid @{}; border-radius: 8px; padding: 8px 16px; font-size: 14px;"


class Toast(QLabel):
    """One line or two at the lower edge of the parent, for six seconds; the newest message replaces the one before."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent, wordWrap=True, alignment=CENTER, textInteractionFlags=Qt.TextInteractionFlag.NoTextInteraction)
        self._parent = parent
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._lift_px = 0
        self._message = ""
        self._timer = QTimer(self, singleShot=True, interval=_SHOWN_MS)
        self._timer.timeout.connect(self.hide)
        OnResize(parent, self, self._place)
        self.hide()

    def show_message(self, text: str, *, is_fault: bool = False) -> None:
        self._message = tr_text(text)
        theme.set_sheet(self, _TOAST_STYLE.format("FAULT" if is_fault else "LINE"))
        self.setText(_BREAK_AFTER.sub("\\g<0>\N{ZERO WIDTH SPACE}", self._message))
        self.setAccessibleName(self._message)
        self._place()
        self.show()
        self.raise_()
        self._timer.start()

    def text(self) -> str:
        """The message, without the marks where it may be broken."""
        return self._message

    def lift(self, height_px: int) -> None:
        """Stay so far above the lower edge, where something else lies."""
        self._lift_px = height_px
        self._place()

    def _place(self) -> None:
        if not self._message:
            return
        room = self._parent.rect()
        widest = max(200, room.width() - 40)
        self.setFixedWidth(min(widest, self.fontMetrics().horizontalAdvance(self._message) + 60))
        self.setFixedHeight(self.heightForWidth(self.width()))
        self.move((room.width() - self.width()) // 2, room.height() - self.height() - 16 - self._lift_px)


class NoticeKind(Enum):
    """How serious it is: the colour of the edge, as a role of the palette."""

    PROGRESS = "SKY"
    WARNING = "SIM"
    FAULT = "FAULT"


_WIDEST_PX, _EDGE_PX = 560, 20
_SIZES_PX = (14, 13, 12, 11)  # of the detail's font
_NOTICE_STYLE = """
Notice {{ background: @PANEL; border: 2px solid @{}; border-radius: 10px; }}
QLabel {{ color: @TEXT_DIM; }}
QLabel#title {{ color: @TEXT; }}
QProgressBar {{ background: @RAISED; border: none; border-radius: 3px; }}
QProgressBar::chunk {{ background: @{}; border-radius: 3px; }}
"""


class Notice(QFrame):
    """A card in the middle of its parent: starting, no new picture, recording over, fault. It is as high as its text needs.

    PROGRESS has a moving bar; a fault or an ended recording has a button to start again (``restart``).
    """

    restart = Signal()

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._parent = parent
        self._title, self._detail = QLabel(alignment=CENTER), QLabel(wordWrap=True, alignment=CENTER)
        self._title.setObjectName("title")
        self._bar = QProgressBar(textVisible=False, maximum=0)
        self._bar.setFixedHeight(6)
        self._button = text_button(tr("Start again  (F5)"), self.restart.emit)
        rows = column(self._title, (self._detail, 1), self._bar, spacing=8, margins=(_EDGE_PX, 16, _EDGE_PX, 20))
        rows.addWidget(self._button, 0, CENTER)
        self.setLayout(rows)
        OnResize(parent, self, self._place)
        self.hide()

    @property
    def text(self) -> str:
        return ". ".join(label.text() for label in (self._title, self._detail) if label.text())

    def show_notice(self, kind: NoticeKind, title: str, detail: str = "", *, restartable: bool = False) -> None:
        self._title.setText(tr_text(title))
        self._detail.setText(tr_text(detail))
        self._detail.setVisible(bool(detail))
        self._bar.setVisible(kind is NoticeKind.PROGRESS)
        self._button.setVisible(restartable)
        theme.set_sheet(self, _NOTICE_STYLE.format(kind.value, kind.value))
        self.setAccessibleName(self.text)
        self.setToolTip(self.text)
        self._place()
        self.show()
        self.raise_()

    def _place(self) -> None:
        """In the largest font of the detail with which all of it has room."""
        room, rows = self._parent.rect(), self.layout()
        assert rows is not None
        width = min(_WIDEST_PX, room.width() - 2 * _EDGE_PX)
        self._title.setFont(theme.fitted(theme.bold(22), self._title.text(), width - 2 * _EDGE_PX, 11))
        for size_px in _SIZES_PX:
            self._detail.setFont(theme.font(size_px))
            rows.invalidate()
            if (height := rows.totalHeightForWidth(width)) <= room.height() - _EDGE_PX:
                break
        self.setGeometry((room.width() - width) // 2, (room.height() - height) // 2, width, height)


_OFFER_WIDEST_PX = 900
_MARGIN_PX = 12
_INK = theme.ON_PICTURE
_SHAPE = "padding: 0 10px; min-height: 24px; font-size: 13px;"
_PLAIN = f"{_SHAPE} background: {_INK.RAISED}; color: {_INK.TEXT}; border: 1px solid {_INK.TEXT_FAINT};"
_MAIN = f"{_SHAPE} background: {_INK.SKY}; color: {_INK.INK}; font-weight: 600; border: 1px solid {_INK.SKY};"
_FOCUS = f"QPushButton:focus {{ border: 2px solid {_INK.TEXT}; }} QPushButton:hover {{ border-color: {_INK.TEXT}; }}"


@dataclass(frozen=True, slots=True)
class OfferButton:
    """A button: its word, what it does, and a tool tip."""

    name: str
    action: Callable[[], object]
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class Offer:
    """Something that the operator can do now. One is shown at a time, oldest first; a new one replaces that of the same key.

    Attributes
    ----------
    text, detail : what is the matter, and a second line.
    answers : the first one is the main one, unless work goes on; pressing any of them closes the offer first.
    share : None: no work goes on; 0..1: how much is done; negative: work goes on for an unknown time.
    is_fault : something went wrong.
    dismissed : when the cross is pressed; without one the offer only goes.
    """

    key: str
    text: str
    detail: str = ""
    answers: tuple[OfferButton, ...] = ()
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
        self._text, self._detail, self._more = QLabel(wordWrap=True), QLabel(wordWrap=True), QLabel()
        self._text.setStyleSheet(f"color: {_INK.TEXT}; font-size: 14px; font-weight: 600; border: none; background: none;")
        for label in (self._detail, self._more):
            label.setStyleSheet(f"color: {_INK.TEXT_DIM}; font-size: 12px; border: none; background: none;")
        self._bar = QProgressBar(textVisible=False)
        self._bar.setFixedHeight(6)
        self._bar.setStyleSheet(
            f"QProgressBar {{ background: {_INK.WINDOW}; border: none; border-radius: 3px; }}"
            f"QProgressBar::chunk {{ background: {_INK.SKY}; border-radius: 3px; }}"
        )
        words = column((self._text, 0), (self._detail, 0), (self._bar, 0), spacing=2)
        self._row = line(spacing=6)
        self.setLayout(line((words, 1), self._more, self._row, spacing=12, margins=(14, 8, 8, 8)))
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setCursor(Qt.CursorShape.ArrowCursor)
        OnResize(parent, self, self._place)
        self.hide()

    @property
    def text(self) -> str:
        return f"{self._shown.text} {self._shown.detail}".strip() if self._shown is not None else ""

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

    def _show(self) -> None:
        before, self._shown = self._shown, next(iter(self._offers.values()), None)
        offer = self._shown
        if offer is None:
            focus = self.window().focusWidget()
            had_focus = focus is not None and self.isAncestorOf(focus)
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
        for k, answer in enumerate(offer.answers):
            self._add_button(answer.name, answer.meaning or answer.name, k == 0 and offer.share is None)
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

    def _place(self) -> None:
        if self._shown is None:
            return
        room = self._parent.rect()
        width = min(_OFFER_WIDEST_PX, room.width() - 2 * _MARGIN_PX)
        layout = self.layout()
        assert layout is not None
        layout.activate()
        height = max(48, layout.totalHeightForWidth(width) if layout.hasHeightForWidth() else self.sizeHint().height())
        self.setGeometry((room.width() - width) // 2, room.height() - height - _MARGIN_PX, width, height)
        self.lifted.emit(height + _MARGIN_PX)


class _AnswerButton(QPushButton):
    """The second half of a double click is no answer: by then the button may be another offer's, which was not read."""

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        event.accept()


_OPEN_MS = 20_000
BUTTON_STYLE = "padding: 0 9px; min-height: 20px; font-size: 12px;"


class QuestionStrip(QWidget):
    """One line with a question, the answer that does it, and Cancel, in the place where it was raised. It closes itself after 20 s.

    ``closed`` comes after either answer. What is asked for is done by the callback given to ``ask``. While a question is open it
    stands in the place of the widgets `instead_of`; without any the owner shows and hides it.
    """

    closed = Signal()

    def __init__(self, *instead_of: QWidget) -> None:
        super().__init__()
        self.instead_of = instead_of
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
        self._timer = QTimer(self, singleShot=True, interval=_OPEN_MS)
        self._timer.timeout.connect(self.cancel)
        self.setLayout(line((self._question, 1), self._yes, self._no, spacing=6))
        self.setAccessibleName(tr("Question"))
        if instead_of:
            self.hide()

    @property
    def text(self) -> str:
        return self._text

    def ask(self, question: str, answer: str, action: Callable[[], None]) -> None:
        """Open the question; `action` is done when `answer` is pressed. A question that was open is taken back."""
        self._action, self._text = action, question
        self._yes.setText(answer)
        self.setAccessibleDescription(question)
        self._swap(True)
        self._fit()
        self._timer.start()
        self._no.setFocus()

    def cancel(self) -> None:
        if self._text:
            self._close()

    def _on_yes(self) -> None:
        action = self._action
        self._close()
        if action is not None:
            action()

    def _close(self) -> None:
        self._action, self._text = None, ""
        self._timer.stop()
        self._swap(False)
        self.closed.emit()

    def _swap(self, is_open: bool) -> None:
        for part in self.instead_of:
            self.setVisible(is_open)
            part.setVisible(not is_open)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """The question must not push the buttons out of a narrow window; its tool tip has all of it."""
        room = self.width() - self._yes.sizeHint().width() - self._no.sizeHint().width() - 16
        text = f"! {self._text}" if self._text else ""
        self._question.setText(theme.elide(theme.semi_bold(12), text, max(40, room)))
        self._question.setToolTip(self._text)
