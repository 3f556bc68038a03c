"""The switches of the overlays: a row of chips, each with its key, or two rows where one has no room for their names."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QPainter, QResizeEvent
from PySide6.QtWidgets import QAbstractButton, QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr
from app.ui.theme import ON_PICTURE
from app.widgets.painting import CENTER, Painted, draw_box, draw_text, text_width
from app.widgets.scene_overlay import Layer

_SEEN = 3.0  # contrast from which on a swatch is seen
_HEIGHT, _NARROW, _GAP = 30, 54, 5
_SWATCH = {
    Layer.MASKS: ON_PICTURE.VESSEL,
    Layer.VESSEL: ON_PICTURE.VESSEL,
    Layer.ROBOT: ON_PICTURE.ROBOT,
    Layer.HEAD: ON_PICTURE.HEAD,
    Layer.VECTORS: ON_PICTURE.ROBOT_VECTOR,
    Layer.NEAREST: ON_PICTURE.NEAREST,
    Layer.DISTANCES: ON_PICTURE.D_HEAD,
    Layer.ROUTE: ON_PICTURE.ROUTE,
    Layer.LOUPE: ON_PICTURE.TEXT,
    Layer.GHOST: ON_PICTURE.GHOST,
}


class OverlayBar(QWidget):
    """``toggled`` carries a layer and whether it is on."""

    toggled = Signal(object, bool)

    def __init__(self) -> None:
        super().__init__()
        self._chips = {layer: _Chip(layer, self) for layer in Layer}
        for layer, chip in self._chips.items():
            chip.toggled.connect(lambda on, which=layer: self.toggled.emit(which, on))
        policy = QSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Minimum)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.setAccessibleName(tr("Overlays"))

    def sizeHint(self) -> QSize:
        return QSize(_full_width(list(self._chips.values())), _HEIGHT)

    def minimumSizeHint(self) -> QSize:
        widest = (len(self._chips) + 1) // 2
        return QSize(widest * (_NARROW + _GAP) - _GAP, _HEIGHT)

    def heightForWidth(self, width: int) -> int:
        return len(self._rows(width)) * (_HEIGHT + _GAP) - _GAP

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        top = 0
        for row in self._rows(self.width()):
            left = 0.0
            # each gets as much more, or less, as its name is long
            share = (self.width() + _GAP) / (_full_width(row) + _GAP)
            for chip in row:
                step = (chip.sizeHint().width() + _GAP) * share
                chip.setGeometry(round(left), top, round(left + step) - _GAP - round(left), _HEIGHT)
                left += step
            top += _HEIGHT + _GAP

    def _rows(self, width: int) -> list[list[_Chip]]:
        chips = list(self._chips.values())
        if width >= _full_width(chips):
            return [chips]
        half = (len(chips) + 1) // 2
        return [chips[:half], chips[half:]]

    def is_on(self, layer: Layer) -> bool:
        return self._chips[layer].isChecked()

    def toggle(self, layer: Layer) -> None:
        self._chips[layer].toggle()

    def set_all(self, on: bool) -> None:
        for chip in self._chips.values():
            chip.setChecked(on)


def _full_width(row: list[_Chip]) -> int:
    """The width that shows all of their names and colours."""
    return sum(chip.sizeHint().width() + _GAP for chip in row) - _GAP


class _Chip(Painted, QAbstractButton):
    """Key cap, colour and name; filled when on, outlined when off."""

    def __init__(self, layer: Layer, bar: OverlayBar) -> None:
        super().__init__(bar)
        self._layer = layer
        self.setCheckable(True)
        self.setChecked(True)
        self.setText(tr(layer.value.label))
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setToolTip(tr("{meaning}  (key {key})", meaning=tr(layer.value.meaning), key=layer.value.key))
        self.setAccessibleName(tr("Overlay {label}", label=tr(layer.value.label)))

    def sizeHint(self) -> QSize:
        return QSize(40 + text_width(theme.font(12), self.text()), _HEIGHT)

    def paint(self, painter: QPainter) -> None:
        on, height = self.isChecked(), self.height()
        edge = theme.SKY if self.hasFocus() else theme.TEXT_FAINT if self.underMouse() else theme.LINE
        draw_box(painter, QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5), 6, theme.RAISED if on else theme.WINDOW, edge)
        key_colour = theme.TEXT_DIM if on else theme.TEXT_FAINT
        draw_text(painter, QRectF(8, 0, 10, height), self._layer.value.key, theme.semi_bold(11), key_colour, CENTER)
        left, swatch = 22.0, _SWATCH[self._layer]
        if self.width() >= self.sizeHint().width():  # no room for the colour in a narrow window
            is_lost = theme.contrast(swatch, theme.RAISED) < _SEEN  # a pale colour on a light chip
            box = QRectF(left, height / 2 - 4, 8, 8)
            draw_box(painter, box, 2, swatch if on else None, theme.TEXT_FAINT if is_lost else swatch, 1.5)
            left = 35.0
        room = QRectF(left, 0, self.width() - left - 4, height)
        colour = theme.TEXT if on else theme.TEXT_FAINT
        draw_text(painter, room, self.text(), theme.font(12), colour, smallest_px=10, elided=True)
