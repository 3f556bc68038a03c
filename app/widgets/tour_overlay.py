"""A tour: a light on one part of the window after the other, and a card beside it. The window stays in use meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QPainter, QPainterPath, QRegion
from PySide6.QtWidgets import QAbstractButton, QComboBox, QLabel, QTabWidget, QWidget

from app.ui import theme
from app.ui.i18n import tr
from app.widgets.basics import card_note, column, line, text_button
from app.widgets.painting import PaintedWidget, draw_box, set_colours

_CARD_WIDTH = 380
_MARGIN, _AROUND, _CORNER = 14, 5, 9.0  # of the card; of the light, and the radius of its corners
_SHADE = 0.5
_FOLLOW_EVERY_MS = 150
_FORWARD, _BACK = (Qt.Key.Key_Return, Qt.Key.Key_Enter), (Qt.Key.Key_Backspace,)


@dataclass(frozen=True, slots=True)
class TourStop:
    """A text, and the widgets that it describes; they are lit together."""

    title: str
    text: str
    widgets: tuple[QWidget, ...]


class TourOverlay(QObject):
    """Shows one stop of a tour after the other over `parent`. ``ended`` comes when it is over.

    The shade lets every click through, and neither shade nor card ever lies over the widgets `kept_clear`. The keys are Enter and
    Backspace, where the window has no other use for them.
    """

    ended = Signal()

    def __init__(self, parent: QWidget, kept_clear: Sequence[QWidget] = ()) -> None:
        super().__init__(parent)
        self._parent = parent
        self._kept_clear = tuple(kept_clear)
        self._stops: tuple[TourStop, ...] = ()
        self.place = -1  # which stop, from 0; -1: none
        self._shade = _Shade(parent)
        self.card = _TourCard(parent, self)
        self._timer = QTimer(self, interval=_FOLLOW_EVERY_MS)
        self._timer.timeout.connect(self._follow)

    @property
    def is_running(self) -> bool:
        return self.place >= 0

    @property
    def light(self) -> QRect:
        """What is lit, in the parent's pixels."""
        return self._shade.light

    def begin(self, stops: Sequence[TourStop]) -> None:
        """From the first stop; without stops nothing happens."""
        if not stops:
            return
        if not self.is_running:
            self._parent.installEventFilter(self)
            self._parent.window().installEventFilter(self)
        self._stops = tuple(stops)
        self._timer.start()
        self._show_stop(0)

    def forward(self) -> None:
        """The next stop; after the last one it is over."""
        if self.place + 1 < len(self._stops):
            self._show_stop(self.place + 1)
        else:
            self.end()

    def back(self) -> None:
        self._show_stop(max(0, self.place - 1))

    def end(self) -> None:
        if not self.is_running:
            return
        self.place = -1
        self._timer.stop()
        self._parent.removeEventFilter(self)
        self._parent.window().removeEventFilter(self)
        self.card.hide()
        self._shade.hide()
        self.ended.emit()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and watched is self._parent:
            self._follow()
        elif event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent) and watched is self._parent.window():
            return self._on_key(event)
        return False

    def _on_key(self, event: QKeyEvent) -> bool:
        """A key that no widget has used, on its way to the window, which may have a use for Enter on a control."""
        focus = self._parent.window().focusWidget()
        if event.key() in _FORWARD and isinstance(focus, QAbstractButton | QComboBox):
            return False
        if event.key() not in (*_FORWARD, *_BACK) or event.isAutoRepeat():
            return False
        if event.key() in _BACK:
            self.back()
        else:
            self.forward()
        return True

    def _show_stop(self, place: int) -> None:
        self.place = place
        stop = self._stops[place]
        for widget in stop.widgets:
            _turn_to_page_of(widget)
        self.card.show_stop(stop, place, len(self._stops))
        self._shade.light = QRect()
        self._follow()
        for part in (self._shade, self.card):
            part.show()
            part.raise_()
        self.card.forward.setFocus()

    def _follow(self) -> None:
        """Light and card keep up with the window's parts, which may move at any time."""
        if not self.is_running:
            return
        light = QRect()
        for widget in self._stops[self.place].widgets:
            if widget.isVisible():
                light = light.united(self._rect_of(widget))
        light = light.adjusted(-_AROUND, -_AROUND, _AROUND, _AROUND) if light.isValid() else light
        clear = [self._rect_of(widget) for widget in self._kept_clear if widget.isVisible()]
        self._shade.cover(self._parent.rect(), light, clear)
        self.card.setGeometry(place_card(self.card.wanted_size(), self._parent.rect(), light, clear))

    def _rect_of(self, widget: QWidget) -> QRect:
        return QRect(widget.mapTo(self._parent, QPoint(0, 0)), widget.size())


def place_card(size: QSize, room: QRect, light: QRect, clear: Sequence[QRect]) -> QRect:
    """Where the card goes: within `room`, off the rectangles to be kept clear, and beside the light if there is a place.

    Parameters
    ----------
    size : of the card.
    room, light, clear : in the same pixels; an invalid `light` means that there is no light.
    """
    inner = room.adjusted(_MARGIN, _MARGIN, -_MARGIN, -_MARGIN)
    width, height = size.width(), size.height()
    last_x, last_y = max(inner.left(), inner.right() - width + 1), max(inner.top(), inner.bottom() - height + 1)
    xs, ys = [inner.left(), inner.right() - width + 1], [inner.top(), inner.bottom() - height + 1]
    if light.isValid():
        xs += [light.right() + _MARGIN, light.left() - width - _MARGIN, light.center().x() - width // 2, light.left()]
        ys += [light.bottom() + _MARGIN, light.top() - height - _MARGIN, light.center().y() - height // 2, light.top()]
    cards = [QRect(min(max(x, inner.left()), last_x), min(max(y, inner.top()), last_y), width, height) for x in xs for y in ys]

    def cost(card: QRect) -> tuple[bool, int, int]:
        both = card & light
        covered = both.width() * both.height() if both.isValid() else 0
        away = (card.center() - light.center()).manhattanLength() if light.isValid() else 0
        return any(card.intersects(rect) for rect in clear), covered, away

    return min(cards, key=cost)


def _turn_to_page_of(widget: QWidget) -> None:
    child: QWidget | None = widget
    while child is not None:
        stack = child.parentWidget()
        pages = stack.parentWidget() if stack is not None else None
        if isinstance(pages, QTabWidget) and pages.indexOf(child) >= 0:
            pages.setCurrentWidget(child)
        child = stack


class _Shade(PaintedWidget):
    """Darkens all but the light; every click goes through it."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(tr("Tour"), parent=parent)
        self.light = QRect()
        self._clear: list[QRect] = []
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()

    def cover(self, room: QRect, light: QRect, clear: list[QRect]) -> None:
        if (room, light, clear) == (self.geometry(), self.light, self._clear):
            return
        self.light, self._clear = light, clear
        self.setGeometry(room)
        region = QRegion(room)
        for rect in clear:
            region -= QRegion(rect)
        self.setMask(region)
        self.update()

    def paint(self, painter: QPainter) -> None:
        dark, lit = QPainterPath(), QPainterPath()
        dark.addRect(QRectF(self.rect()))
        if self.light.isValid():
            lit.addRoundedRect(QRectF(self.light), _CORNER, _CORNER)
        painter.fillPath(dark.subtracted(lit), theme.colour(theme.ON_PICTURE.INK, _SHADE))
        set_colours(painter, None, theme.ON_PICTURE.SKY, 2.5)
        painter.drawPath(lit)


class _TourCard(PaintedWidget):
    """Title, text, and the buttons."""

    def __init__(self, parent: QWidget, tour: TourOverlay) -> None:
        super().__init__(parent=parent)
        self._title, self._text, self._count = QLabel(), QLabel(wordWrap=True), card_note("")
        self._title.setFont(theme.bold(18))
        for label in (self._title, self._text, self._count):
            label.setTextFormat(Qt.TextFormat.PlainText)
        self.back, self.skip, self.forward = (
            text_button(text, action, tool_tip, tr("{button}: tour", button=text))
            for text, action, tool_tip in (
                (tr("Back"), tour.back, tr("The stop before  (Backspace)")),
                (tr("Skip"), tour.end, tr("End the tour  (Esc); Help, Tour shows it again")),
                (tr("Next"), tour.forward, tr("The next stop  (Enter)")),
            )
        )
        for button in (self.back, self.skip, self.forward):
            button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        buttons = line((self._count, 1), self.skip, self.back, self.forward, spacing=8)
        self._rows = column(self._title, self._text, buttons, spacing=9, margins=(18, 14, 18, 14))
        self.setLayout(self._rows)
        self.setFixedWidth(_CARD_WIDTH)
        self.setCursor(Qt.CursorShape.ArrowCursor)
        self.hide()

    @property
    def text(self) -> str:
        return f"{self._title.text()}. {self._text.text()}"

    def show_stop(self, stop: TourStop, place: int, count: int) -> None:
        self._title.setText(stop.title)
        self._text.setText(stop.text)
        self._count.setText(tr("{place} of {count}", place=place + 1, count=count))
        is_last = place + 1 == count
        self.forward.setText(tr("Done") if is_last else tr("Next"))
        self.forward.setAccessibleName(tr("End the tour") if is_last else tr("Next stop of the tour"))
        self.forward.setAccessibleDescription(self.text)  # is read out when it takes the focus
        self.back.setEnabled(place > 0)
        self.skip.setVisible(not is_last)
        self.setAccessibleName(tr("Tour, {place} of {count}", place=place + 1, count=count))
        self.setAccessibleDescription(self.text)

    def wanted_size(self) -> QSize:
        """As high as its text needs."""
        self._rows.activate()
        return QSize(_CARD_WIDTH, self._rows.totalHeightForWidth(_CARD_WIDTH))

    def paint(self, painter: QPainter) -> None:
        draw_box(painter, QRectF(self.rect()).adjusted(1, 1, -1, -1), 11, theme.PANEL, theme.SKY, 1.5)
