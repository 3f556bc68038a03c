"""A tour: a light on one part of the window after the other, and a card beside it. The window stays in use meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, QRectF, QSize, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPainterPath, QPaintEvent, QPen, QRegion
from PySide6.QtWidgets import QAbstractButton, QComboBox, QHBoxLayout, QLabel, QPushButton, QTabWidget, QVBoxLayout, QWidget

from app.ui import theme
from app.ui.i18n import tr

_CARD_WIDTH = 380
_MARGIN, _AROUND, _CORNER = 14, 5, 9.0
_SHADE = 0.5
_LOOK_EVERY_MS = 150
_FORWARD, _BACK = (Qt.Key.Key_Return, Qt.Key.Key_Enter), (Qt.Key.Key_Backspace,)


@dataclass(frozen=True, slots=True)
class TourStop:
    """What is said, and the widgets that it is said of; they are shown together."""

    title: str
    text: str
    widgets: tuple[QWidget, ...]


class TourOverlay(QObject):
    """Leads over `parent` from stop to stop. ``ended`` comes when it is over, in whichever way.

    The shade lets every click through, and neither shade nor card ever lies over the widgets to be `kept_clear`. The keys are
    Enter and Backspace, where nothing else has a use for them; all others go where they always go.
    """

    ended = Signal()

    def __init__(self, parent: QWidget, kept_clear: Sequence[QWidget] = ()) -> None:
        super().__init__(parent)
        self._parent = parent
        self._kept_clear = tuple(kept_clear)
        self._stops: tuple[TourStop, ...] = ()
        self._place = -1
        self._shade = _Shade(parent)
        self.card = _TourCard(parent)
        self.card.forward.clicked.connect(self.forward)
        self.card.back.clicked.connect(self.back)
        self.card.skip.clicked.connect(self.end)
        self._look = QTimer(self)
        self._look.setInterval(_LOOK_EVERY_MS)
        self._look.timeout.connect(self._follow)

    @property
    def is_running(self) -> bool:
        return self._place >= 0

    @property
    def place(self) -> int:
        """Which stop, from 0; -1: none."""
        return self._place

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
        self._look.start()
        self._go(0)

    @Slot()
    def forward(self) -> None:
        """The next stop; after the last one it is over."""
        if self._place + 1 < len(self._stops):
            self._go(self._place + 1)
        else:
            self.end()

    @Slot()
    def back(self) -> None:
        self._go(max(0, self._place - 1))

    @Slot()
    def end(self) -> None:
        if not self.is_running:
            return
        self._place = -1
        self._look.stop()
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
        """Keys that nobody else took, on their way to the window; it may have a use for Enter on a control."""
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

    # ---- places

    def _go(self, place: int) -> None:
        self._place = place
        stop = self._stops[place]
        for widget in stop.widgets:
            _bring_forward(widget)
        self.card.show_stop(stop, place, len(self._stops))
        self._shade.light = QRect()
        self._follow()
        for part in (self._shade, self.card):
            part.show()
            part.raise_()
        self.card.forward.setFocus()

    @Slot()
    def _follow(self) -> None:
        """The window's parts may move at any time."""
        if not self.is_running:
            return
        light = QRect()
        for widget in self._stops[self._place].widgets:
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
    room, light, clear : in the same pixels; an invalid `light` means that there is none.
    """
    inner = room.adjusted(_MARGIN, _MARGIN, -_MARGIN, -_MARGIN)
    width, height = size.width(), size.height()
    xs = [inner.left(), inner.right() - width + 1]
    ys = [inner.top(), inner.bottom() - height + 1]
    if light.isValid():
        xs += [light.right() + _MARGIN, light.left() - width - _MARGIN, light.center().x() - width // 2, light.left()]
        ys += [light.bottom() + _MARGIN, light.top() - height - _MARGIN, light.center().y() - height // 2, light.top()]
    best: tuple[tuple[bool, int, int], QRect] | None = None
    for x in xs:
        for y in ys:
            card = QRect(
                min(max(x, inner.left()), max(inner.left(), inner.right() - width + 1)),
                min(max(y, inner.top()), max(inner.top(), inner.bottom() - height + 1)),
                width,
                height,
            )
            away = (card.center() - light.center()).manhattanLength() if light.isValid() else 0
            cost = (any(card.intersects(rect) for rect in clear), _area(card & light), away)
            if best is None or cost < best[0]:
                best = cost, card
    assert best is not None
    return best[1]


def _area(rect: QRect) -> int:
    return rect.width() * rect.height() if rect.isValid() else 0


def _bring_forward(widget: QWidget) -> None:
    """Turn to the page that it is on."""
    child: QWidget | None = widget
    while child is not None:
        pages = child.parentWidget()
        pages = pages.parentWidget() if pages is not None else None
        if isinstance(pages, QTabWidget) and pages.indexOf(child) >= 0:
            pages.setCurrentWidget(child)
        child = child.parentWidget()


class _Shade(QWidget):
    """Darkens all but the light; no click ends here."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.light = QRect()
        self._clear: list[QRect] = []
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAccessibleName(tr("Tour"))
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

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        dark = QPainterPath()
        dark.addRect(QRectF(self.rect()))
        lit = QPainterPath()
        if self.light.isValid():
            lit.addRoundedRect(QRectF(self.light), _CORNER, _CORNER)
        painter.fillPath(dark.subtracted(lit), theme.colour(theme.ON_PICTURE.INK, _SHADE))
        painter.setPen(QPen(QColor(theme.ON_PICTURE.SKY), 2.5))
        painter.drawPath(lit)
        painter.end()


class _TourCard(QWidget):
    """Title, text, and the way on."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self._title, self._text, self._count = QLabel(), QLabel(), QLabel()
        self._title.setFont(theme.bold(18))
        self._text.setWordWrap(True)
        self._count.setObjectName("card_note")
        for label in (self._title, self._text, self._count):
            label.setTextFormat(Qt.TextFormat.PlainText)
        self.back = _button(tr("Back"), tr("The stop before  (Backspace)"))
        self.skip = _button(tr("Skip"), tr("End the tour  (Esc); Help, Tour shows it again"))
        self.forward = _button(tr("Next"), tr("The next stop  (Enter)"))
        row = QHBoxLayout()
        row.setSpacing(8)
        row.addWidget(self._count)
        row.addStretch(1)
        for button in (self.skip, self.back, self.forward):
            row.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(18, 14, 18, 14)
        column.setSpacing(9)
        column.addWidget(self._title)
        column.addWidget(self._text)
        column.addLayout(row)
        self.setFixedWidth(_CARD_WIDTH)
        self.setCursor(Qt.CursorShape.ArrowCursor)
        self.hide()

    @property
    def text(self) -> str:
        """All that is said."""
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
        layout = self.layout()
        assert layout is not None
        layout.activate()
        return QSize(_CARD_WIDTH, layout.totalHeightForWidth(_CARD_WIDTH))

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(QColor(theme.SKY), 1.5))
        painter.setBrush(QColor(theme.PANEL))
        painter.drawRoundedRect(QRectF(self.rect()).adjusted(1, 1, -1, -1), 11, 11)
        painter.end()


def _button(text: str, tip: str) -> QPushButton:
    button = QPushButton(text)
    button.setToolTip(tip)
    button.setAccessibleName(tr("{button}: tour", button=text))
    return button
