"""The switches of the overlays: a row of chips, each with its key."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QAbstractButton, QHBoxLayout, QWidget

from app import palette, theme
from app.language import tr
from app.palette import ON_PICTURE
from app.widgets.overlays import Layer

_SEEN = 3.0
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
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(5)
        self._chips: dict[Layer, _Chip] = {}
        for layer in Layer:
            chip = _Chip(layer)
            chip.toggled.connect(lambda on, which=layer: self.toggled.emit(which, on))
            row.addWidget(chip, chip.sizeHint().width())
            self._chips[layer] = chip
        self.setAccessibleName(tr("Overlays"))

    def is_on(self, layer: Layer) -> bool:
        return self._chips[layer].isChecked()

    def toggle(self, layer: Layer) -> None:
        self._chips[layer].toggle()

    def set_all(self, on: bool) -> None:
        for chip in self._chips.values():
            chip.setChecked(on)


class _Chip(QAbstractButton):
    """Key cap, colour and name; filled when on, outlined when off."""

    def __init__(self, layer: Layer) -> None:
        super().__init__()
        self._layer = layer
        self.setCheckable(True)
        self.setChecked(True)
        self.setText(tr(layer.value.label))
        self.setFixedHeight(30)
        self.setMinimumWidth(54)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setToolTip(tr("{meaning}  (key {key})", meaning=tr(layer.value.meaning), key=layer.value.key))
        self.setAccessibleName(tr("Overlay {label}", label=tr(layer.value.label)))

    def sizeHint(self) -> QSize:
        return QSize(40 + QFontMetrics(theme.font(12)).horizontalAdvance(self.text()), 30)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        on = self.isChecked()
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        edge = palette.SKY if self.hasFocus() else palette.TEXT_FAINT if self.underMouse() else palette.LINE
        painter.setPen(QPen(QColor(edge), 1))
        painter.setBrush(QColor(palette.RAISED) if on else QColor(palette.WINDOW))
        painter.drawRoundedRect(frame, 6, 6)
        painter.setPen(QColor(palette.TEXT_DIM if on else palette.TEXT_FAINT))
        painter.setFont(theme.semi_bold(11))
        painter.drawText(QRectF(8, 0, 10, self.height()), Qt.AlignmentFlag.AlignCenter, self._layer.value.key)
        text_font = theme.font(12)
        left = 22.0
        if self.width() >= self.sizeHint().width():  # no room for the colour in a narrow window
            is_lost = palette.contrast(_SWATCH[self._layer], palette.RAISED) < _SEEN  # a pale colour on a light chip
            painter.setPen(QPen(QColor(palette.TEXT_FAINT if is_lost else _SWATCH[self._layer]), 1.5))
            painter.setBrush(QColor(_SWATCH[self._layer]) if on else Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(QRectF(left, self.height() / 2 - 4, 8, 8), 2, 2)
            left = 35.0
        painter.setPen(QColor(palette.TEXT if on else palette.TEXT_FAINT))
        width = self.width() - left - 4
        fitted = theme.fitted(text_font, self.text(), int(width), 10)
        painter.setFont(fitted)
        shown = theme.elide(fitted, self.text(), int(width))
        painter.drawText(QRectF(left, 0, width, self.height()), Qt.AlignmentFlag.AlignVCenter, shown)
        painter.end()
