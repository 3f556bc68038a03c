"""Frame rates, latency per stage, dropped frames and the longest block of the window."""

from __future__ import annotations

import time
from collections import deque

import numpy as np
from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.texts import tip
from app.ui.workers import Pace
from core.types import Tick

_SAMPLES = 300
_DRAW_EVERY_S = 0.5
_BLOCK_LIMIT_MS = 50.0
_ROW_MIN = 13.0


class PerformancePanel(QWidget):
    """Numbers over the last few seconds, renewed twice a second."""

    def __init__(self) -> None:
        super().__init__()
        self._stages: dict[str, deque[float]] = {}
        self._shown_s: deque[float] = deque(maxlen=60)
        self._pace = Pace(_DRAW_EVERY_S)
        self._heads: tuple[tuple[str, str, bool], ...] = _heads(None, None, None, None)
        self._rows: tuple[tuple[str, str, str], ...] = ()
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMinimumSize(210, 92)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(tr("Performance"))
        self.setToolTip(tip("shown", "engine", "dropped", "gui_block", "latency"))

    @property
    def text(self) -> str:
        """Everything that is shown, as lines."""
        heads = [f"{name} {value}" for name, value, _ in self._heads]
        return "\n".join(heads + [" ".join(row) for row in self._rows])

    def sizeHint(self) -> QSize:
        return QSize(240, 170)

    def add(self, tick: Tick, gui_block_ms: float) -> None:
        """Account one shown tick."""
        self._shown_s.append(time.monotonic())
        for stage, milliseconds in tick.scene.latency_ms.items():
            self._stages.setdefault(stage, deque(maxlen=_SAMPLES)).append(milliseconds)
        if self._pace.due():
            self._heads = _heads(self.shown_per_second, tick.frames_per_second, tick.dropped_frames, gui_block_ms)
            self._rows = self._percentiles()
            self.setAccessibleDescription(self.text)
            self.update()

    def clear(self) -> None:
        """Forget the numbers of another rig."""
        self._stages.clear()
        self._shown_s.clear()
        self._pace.reset()
        self._heads, self._rows = _heads(None, None, None, None), ()
        self.update()

    @property
    def shown_per_second(self) -> float:
        """Ticks shown per second over the last two seconds or so."""
        if len(self._shown_s) < 2:
            return 0.0
        return (len(self._shown_s) - 1) / max(self._shown_s[-1] - self._shown_s[0], 1e-6)

    def _percentiles(self) -> tuple[tuple[str, str, str], ...]:
        rows = []
        for name in ["total", *(name for name in self._stages if name != "total")]:
            if name in self._stages:
                half, most = np.percentile(self._stages[name], (50, 95))
                rows.append((name.replace("_", " "), f"{half:.1f}", f"{most:.1f}"))
        return tuple(rows)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(theme.PANEL))
        width = self.width() / 4
        for k, (name, value, is_bad) in enumerate(self._heads):
            painter.setPen(QColor(theme.FAULT if is_bad else theme.TEXT))
            painter.setFont(theme.bold(18))
            painter.drawText(QRectF(k * width, 0, width, 22), Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, value)
            painter.setPen(QColor(theme.TEXT_FAINT))
            painter.setFont(theme.font(11))
            painter.drawText(QRectF(k * width, 22, width, 14), Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, name)
        self._paint_table(painter, 40.0)
        painter.end()

    def _paint_table(self, painter: QPainter, top: float) -> None:
        middle = Qt.AlignmentFlag.AlignVCenter
        left, right = Qt.AlignmentFlag.AlignLeft | middle, Qt.AlignmentFlag.AlignRight | middle
        rows = ((tr("ms per frame"), "p50", "p95"), *self._rows)
        height = min(18.0, max(_ROW_MIN, (self.height() - top) / max(len(rows), 1)))
        rows = rows[: int((self.height() - top) / height)]
        for k, (name, half, most) in enumerate(rows):
            y = top + k * height
            is_total = name == "total"
            painter.setFont(theme.semi_bold(12) if is_total else theme.font(12))
            painter.setPen(QColor(theme.TEXT if is_total else theme.TEXT_FAINT if k == 0 else theme.TEXT_DIM))
            painter.drawText(QRectF(0, y, self.width() - 110, height), left, tr_text(name))
            painter.drawText(QRectF(self.width() - 110, y, 52, height), right, half)
            painter.drawText(QRectF(self.width() - 56, y, 56, height), right, most)


def _heads(
    shown: float | None, engine: float | None, dropped: int | None, block_ms: float | None
) -> tuple[tuple[str, str, bool], ...]:
    """Name, value, and whether it is out of bounds."""
    none = "\N{EN DASH}"
    return (
        (tr("shown/s"), none if shown is None else f"{shown:.0f}", False),
        (tr("frames/s"), none if engine is None else f"{engine:.0f}", False),
        (tr("dropped"), none if dropped is None else f"{dropped}", False),
        (tr("block ms"), none if block_ms is None else f"{block_ms:.0f}", block_ms is not None and block_ms > _BLOCK_LIMIT_MS),
    )
