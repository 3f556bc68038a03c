"""The switches of the overlays: a row of chips, each with its key, or two rows where one has no room for their names."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPaintEvent, QPen, QResizeEvent
from PySide6.QtWidgets import QAbstractButton, QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr
from app.ui.theme import ON_PICTURE
from app.widgets.scene_overlay import Layer

_SEEN = 3.0
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
        self._chips: dict[Layer, _Chip] = {}
        for layer in Layer:
            chip = _Chip(layer, self)
            chip.toggled.connect(lambda on, which=layer: self.toggled.emit(which, on))
            self._chips[layer] = chip
        policy = QSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Minimum)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.setAccessibleName(tr("Overlays"))

    def sizeHint(self) -> QSize:
        return QSize(_wanted(list(self._chips.values())), _HEIGHT)

    def minimumSizeHint(self) -> QSize:
        widest = max(map(len, self._rows(2)))
        return QSize(widest * (_NARROW + _GAP) - _GAP, _HEIGHT)

    def heightForWidth(self, width: int) -> int:
        rows = self._rows_at(width)
        return rows * (_HEIGHT + _GAP) - _GAP

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        top = 0
        for row in self._rows(self._rows_at(self.width())):
            left = 0.0
            # As much more, or less, for each as its name is long.
            share = (self.width() + _GAP) / (_wanted(row) + _GAP)
            for chip in row:
                step = (chip.sizeHint().width() + _GAP) * share
                chip.setGeometry(round(left), top, round(left + step) - _GAP - round(left), _HEIGHT)
                left += step
            top += _HEIGHT + _GAP

    def _rows_at(self, width: int) -> int:
        return 1 if width >= _wanted(list(self._chips.values())) else 2

    def _rows(self, count: int) -> list[list[_Chip]]:
        chips = list(self._chips.values())
        if count == 1:
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


def _wanted(row: list[_Chip]) -> int:
    """The width that shows all of their names and colours."""
    return sum(chip.sizeHint().width() + _GAP for chip in row) - _GAP


class _Chip(QAbstractButton):
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
        return QSize(40 + QFontMetrics(theme.font(12)).horizontalAdvance(self.text()), _HEIGHT)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        on = self.isChecked()
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        edge = theme.SKY if self.hasFocus() else theme.TEXT_FAINT if self.underMouse() else theme.LINE
        painter.setPen(QPen(QColor(edge), 1))
        painter.setBrush(QColor(theme.RAISED) if on else QColor(theme.WINDOW))
        painter.drawRoundedRect(frame, 6, 6)
        painter.setPen(QColor(theme.TEXT_DIM if on else theme.TEXT_FAINT))
        painter.setFont(theme.semi_bold(11))
        painter.drawText(QRectF(8, 0, 10, self.height()), Qt.AlignmentFlag.AlignCenter, self._layer.value.key)
        text_font = theme.font(12)
        left = 22.0
        if self.width() >= self.sizeHint().width():  # no room for the colour in a narrow window
            is_lost = theme.contrast(_SWATCH[self._layer], theme.RAISED) < _SEEN  # a pale colour on a light chip
            painter.setPen(QPen(QColor(theme.TEXT_FAINT if is_lost else _SWATCH[self._layer]), 1.5))
            painter.setBrush(QColor(_SWATCH[self._layer]) if on else Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(QRectF(left, self.height() / 2 - 4, 8, 8), 2, 2)
            left = 35.0
        painter.setPen(QColor(theme.TEXT if on else theme.TEXT_FAINT))
        width = self.width() - left - 4
        fitted = theme.fitted(text_font, self.text(), int(width), 10)
        painter.setFont(fitted)
        shown = theme.elide(fitted, self.text(), int(width))
        painter.drawText(QRectF(left, 0, width, self.height()), Qt.AlignmentFlag.AlignVCenter, shown)
        painter.end()
