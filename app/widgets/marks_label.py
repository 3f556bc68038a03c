"""Marks over a picture that Qt paints alone."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QPainter, QPainterPath, QPicture, QTransform
from PySide6.QtWidgets import QLabel, QWidget

from app.widgets.overlays import Marks


class MarksLabel(QLabel):
    """Records marks as drawing commands, and lets Qt paint them.

    Painting takes milliseconds, recording a fraction of that; while Python paints, the interpreter is locked for the threads of
    perception and control, while Qt paints, it is free.
    """

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)

    def record(self, marks: Marks, to_label: QTransform, label_px: int, glass: QPainterPath | None = None) -> None:
        """Show `marks` drawn with `to_label` (source pixels to the label's), cut to `glass` when there is one."""
        commands = QPicture()
        painter = QPainter(commands)
        if glass is not None:
            painter.setClipPath(glass)
        marks.draw(painter, to_label, QRectF(self.rect()), label_px, tags=glass is None)
        painter.end()
        commands.setBoundingRect(self.rect())  # else the label would put its first mark into its corner
        self.setPicture(commands)
