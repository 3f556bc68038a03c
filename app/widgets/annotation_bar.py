"""The tools below the picture as chips with their keys, and one line on how the chosen one is used."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QAbstractButton, QButtonGroup, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from app import palette, theme
from app.annotation_tool import BRUSH_HINT, Tool
from app.language import mark, tr
from app.palette import ON_PICTURE

_DRAWN = ("ROBOT", "VESSEL")
"""Roles that the picture shows in their own colours."""
_SEEN = 3.0
_SWITCHES = (
    ("L", mark("Loupe"), "TEXT", mark("The surroundings of the cursor, magnified")),
    ("K", mark("Masks"), "VESSEL", mark("Show the drawn masks")),
    ("T", mark("Brush"), "ORANGE", mark("Paint the mask instead of moving its points")),
    (
        "H",
        mark("Algorithm"),
        "TEXT",
        mark("Show what the algorithm says: answers after it are told apart. Not in a blind study"),
    ),
)


class AnnotationBar(QWidget):
    """``tool_chosen`` carries a tool; ``switched`` the key of a switch ("L", "K", "T", "H") and whether it is on."""

    tool_chosen = Signal(object)
    switched = Signal(str, bool)

    def __init__(self, *, blind: bool) -> None:
        super().__init__()
        row = QHBoxLayout()
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(5)
        self._blind = blind
        self._tools: dict[Tool, _Chip] = {}
        group = QButtonGroup(self)
        for tool in Tool:
            chip = _Chip(
                tool.value.key,
                tr(tool.value.label),
                tool.value.role,
                tr("{meaning}  (key {key})", meaning=tr(tool.value.label), key=tool.value.key),
            )
            chip.clicked.connect(lambda _on=False, which=tool: self.tool_chosen.emit(which))
            group.addButton(chip)
            row.addWidget(chip)
            self._tools[tool] = chip
        row.addStretch(1)
        self._switches: dict[str, _Chip] = {}
        for key, label, colour, meaning in _SWITCHES:
            if key == "H" and blind:
                continue
            chip = _Chip(key, tr(label), colour, tr("{meaning}  (key {key})", meaning=tr(meaning), key=key))
            chip.setChecked(key in "LK")
            chip.toggled.connect(lambda on, which=key: self.switched.emit(which, on))
            row.addWidget(chip)
            self._switches[key] = chip
        self._hint = QLabel()
        self._hint.setObjectName("card_note")
        self._hint.setMinimumWidth(10)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(5)
        column.addLayout(row)
        column.addWidget(self._hint)
        self.show_tool(Tool.ROBOT, brush_on=False)

    @property
    def hint(self) -> str:
        return self._hint.text()

    def show_tool(self, tool: Tool, *, brush_on: bool) -> None:
        """The tool in hand and how it is used."""
        self._tools[tool].setChecked(True)
        self.set_switch("T", brush_on)
        self._switches["T"].setEnabled(tool.is_mask)
        hint = tr(BRUSH_HINT) if brush_on else tool.value.hint
        self._hint.setText(hint.partition(" · G ")[0] if self._blind else hint)

    def set_switch(self, key: str, on: bool) -> None:
        """Show a switch as on or off without ``switched``."""
        chip = self._switches.get(key)
        if chip is not None and chip.isChecked() is not on:
            chip.blockSignals(True)
            chip.setChecked(on)
            chip.blockSignals(False)

    def is_on(self, key: str) -> bool:
        return self._switches[key].isChecked()

    def toggle(self, key: str) -> None:
        """As a click on the switch."""
        chip = self._switches.get(key)
        if chip is not None and chip.isEnabled():
            chip.toggle()


class _Chip(QAbstractButton):
    """Key cap, colour and name; filled when on, outlined when off."""

    def __init__(self, key: str, label: str, role: str, tip: str) -> None:
        super().__init__()
        self._key, self._role = key, role
        self.setCheckable(True)
        self.setText(label)
        self.setFixedHeight(30)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setToolTip(tip)
        self.setAccessibleName(label)

    def sizeHint(self) -> QSize:
        return QSize(50 + QFontMetrics(theme.semi_bold(12)).horizontalAdvance(self.text()), 30)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        on, is_enabled = self.isChecked(), self.isEnabled()
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        edge = palette.SKY if on else palette.TEXT_FAINT if self.underMouse() and is_enabled else palette.LINE
        painter.setPen(QPen(QColor(edge), 1.4 if on else 1.0))
        painter.setBrush(QColor(palette.RAISED) if on else QColor(palette.WINDOW))
        painter.drawRoundedRect(frame, 6, 6)
        painter.setOpacity(1.0 if is_enabled else 0.45)
        painter.setPen(QColor(palette.TEXT_DIM if on else palette.TEXT_FAINT))
        painter.setFont(theme.semi_bold(11))
        painter.drawText(QRectF(9, 0, 12, self.height()), Qt.AlignmentFlag.AlignCenter, self._key)
        name = getattr(ON_PICTURE, self._role) if self._role in _DRAWN else palette.of(self._role)
        is_lost = palette.contrast(name, palette.RAISED) < _SEEN  # a pale colour on a light chip
        painter.setPen(QPen(QColor(palette.TEXT_FAINT if is_lost else name), 1.5))
        painter.setBrush(QColor(name) if on else Qt.BrushStyle.NoBrush)
        painter.drawRoundedRect(QRectF(27, self.height() / 2 - 4, 8, 8), 2, 2)
        painter.setPen(QColor(palette.TEXT if on else palette.TEXT_DIM))
        painter.setFont(theme.semi_bold(12))
        painter.drawText(QRectF(41, 0, self.width() - 45, self.height()), Qt.AlignmentFlag.AlignVCenter, self.text())
        painter.end()
