"""Rates and latencies."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.ui import theme
from app.widgets.performance_panel import PerformancePanel
from tests.app.fakes import make_tick


def colours_in(widget: QWidget) -> set[str]:
    image = widget.grab().toImage()
    return {image.pixelColor(x, y).name().upper() for x in range(0, image.width(), 2) for y in range(0, image.height(), 2)}


def test_performance_shows_percentiles_and_marks_a_long_block(qtbot: QtBot) -> None:
    panel = PerformancePanel()
    qtbot.addWidget(panel)
    panel.resize(260, 180)
    panel.add(make_tick(), 12.4)
    assert "network" not in panel.text
    assert "total 30.0 30.0" in panel.text
    assert "segmentation 21.0 21.0" in panel.text
    assert "block ms 12" in panel.text
    panel.clear()
    assert "total" not in panel.text
    panel.add(make_tick(), 80.0)
    assert theme.FAULT.upper() in colours_in(panel)
