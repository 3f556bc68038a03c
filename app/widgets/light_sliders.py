"""Contrast and brightness of the picture as it is shown; the image itself is not changed."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGridLayout, QLabel, QSlider, QWidget

from app import theme
from app.language import tr

_STEP = 10


class LightSliders(QWidget):
    """``changed`` carries contrast (1 = as it is) and brightness (0 = as it is, in grey levels)."""

    changed = Signal(float, float)

    def __init__(self) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setVerticalSpacing(2)
        self._contrast, self._brightness = self._slider(tr("Contrast"), ", ."), self._slider(tr("Brightness"), "< >")
        for row, (name, keys, slider) in enumerate(
            ((tr("Contrast"), ", .", self._contrast), (tr("Brightness"), "< >", self._brightness))
        ):
            for column, text, role in ((0, name, "TEXT_DIM"), (2, keys, "TEXT_FAINT")):
                label = QLabel(text)
                theme.set_sheet(label, f"color: @{role}; font-size: 12px;")
                grid.addWidget(label, row, column)
            grid.addWidget(slider, row, 1)

    def _slider(self, name: str, keys: str) -> QSlider:
        slider = QSlider(Qt.Orientation.Horizontal)
        slider.setRange(-100, 100)
        slider.setPageStep(_STEP)
        slider.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        slider.setAccessibleName(name)
        slider.setToolTip(tr("{name} of the picture on the screen  (keys {keys}; / resets both)", name=name, keys=keys))
        slider.valueChanged.connect(self._tell)
        return slider

    @property
    def light(self) -> tuple[float, float]:
        """Contrast and brightness."""
        return 4.0 ** (self._contrast.value() / 100.0), float(self._brightness.value())

    def step(self, contrast: int = 0, brightness: int = 0) -> None:
        """Some steps up or down."""
        self._contrast.setValue(self._contrast.value() + contrast * _STEP)
        self._brightness.setValue(self._brightness.value() + brightness * _STEP)

    def reset(self) -> None:
        self._contrast.setValue(0)
        self._brightness.setValue(0)

    def _tell(self) -> None:
        self.changed.emit(*self.light)
