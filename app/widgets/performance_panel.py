"""Frame rates, latency per stage, dropped frames and the longest block of the window."""

from __future__ import annotations

import time
from collections import deque

import numpy as np
from PySide6.QtCore import QRectF
from PySide6.QtGui import QPainter

from app.ui import theme
from app.ui.i18n import tr, tr_text
from app.ui.texts import tip
from app.ui.workers import Pace
from app.widgets.painting import NONE, RIGHT, PaintedWidget, draw_text
from core.types import Tick

_SAMPLES = 300  # per stage
_DRAW_EVERY_S = 0.5
_BLOCK_LIMIT_MS = 50.0
_ROW_MIN, _ROW_MAX = 13.0, 18.0
_TABLE_TOP = 40.0

Heads = tuple[tuple[str, str, bool], ...]
"""Name, value, and whether it is out of bounds."""


class PerformancePanel(PaintedWidget):
    """Numbers over the last few seconds, renewed twice a second."""

    ground = "PANEL"

    def __init__(self) -> None:
        explanation = tip("shown", "engine", "dropped", "gui_block", "latency")
        super().__init__(tr("Performance"), explanation, hint=(240, 170), least=(210, 92))
        self._stages: dict[str, deque[float]] = {}
        self._shown_s: deque[float] = deque(maxlen=60)
        self._pace = Pace(_DRAW_EVERY_S)
        self._heads = _heads(None, None, None, None)
        self._rows: tuple[tuple[str, str, str], ...] = ()

    @property
    def text(self) -> str:
        heads = [f"{name} {value}" for name, value, _ in self._heads]
        return "\n".join(heads + [" ".join(row) for row in self._rows])

    def add(self, tick: Tick, gui_block_ms: float) -> None:
        """Account one shown tick."""
        self._shown_s.append(time.monotonic())
        for stage, milliseconds in tick.scene.latency_ms.items():
            self._stages.setdefault(stage, deque(maxlen=_SAMPLES)).append(milliseconds)
        if self._pace.due():
            shown = (len(self._shown_s) - 1) / max(self._shown_s[-1] - self._shown_s[0], 1e-6)
            self._heads = _heads(shown, tick.frames_per_second, tick.dropped_frames, gui_block_ms)
            self._rows = self._percentiles()
            self.setAccessibleDescription(self.text)
            self.update()

    def clear(self) -> None:
        self._stages.clear()
        self._shown_s.clear()
        self._pace.reset()
        self._heads, self._rows = _heads(None, None, None, None), ()
        self.update()

    def _percentiles(self) -> tuple[tuple[str, str, str], ...]:
        rows = []
        for name in ["total", *(name for name in self._stages if name != "total")]:
            if name in self._stages:
                half, most = np.percentile(self._stages[name], (50, 95))
                rows.append((name.replace("_", " "), f"{half:.1f}", f"{most:.1f}"))
        return tuple(rows)

    def paint(self, painter: QPainter) -> None:
        width = self.width() / 4
        for k, (name, value, is_bad) in enumerate(self._heads):
            draw_text(painter, QRectF(k * width, 0, width, 22), value, theme.bold(18), theme.FAULT if is_bad else theme.TEXT)
            draw_text(painter, QRectF(k * width, 22, width, 14), name, theme.font(11), theme.TEXT_FAINT)
        rows = ((tr("ms per frame"), "p50", "p95"), *self._rows)
        room = self.height() - _TABLE_TOP
        height = min(_ROW_MAX, max(_ROW_MIN, room / len(rows)))
        for k, (name, half, most) in enumerate(rows[: int(room / height)]):
            y = _TABLE_TOP + k * height
            font = theme.semi_bold(12) if name == "total" else theme.font(12)
            colour = theme.TEXT if name == "total" else theme.TEXT_FAINT if k == 0 else theme.TEXT_DIM
            draw_text(painter, QRectF(0, y, self.width() - 110, height), tr_text(name), font, colour)
            draw_text(painter, QRectF(self.width() - 110, y, 52, height), half, font, colour, RIGHT)
            draw_text(painter, QRectF(self.width() - 56, y, 56, height), most, font, colour, RIGHT)


def _heads(shown: float | None, engine: float | None, dropped: int | None, block_ms: float | None) -> Heads:
    is_long = block_ms is not None and block_ms > _BLOCK_LIMIT_MS
    values = (
        (tr("shown/s"), shown, False),
        (tr("frames/s"), engine, False),
        (tr("dropped"), dropped, False),
        (tr("pause ms"), block_ms, is_long),
    )
    return tuple((name, NONE if value is None else f"{value:.0f}", is_bad) for name, value, is_bad in values)
