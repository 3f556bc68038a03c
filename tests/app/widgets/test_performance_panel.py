"""Rates and latencies."""

from __future__ import annotations

from app.ui import theme
from app.widgets.performance_panel import PerformancePanel
from tests.app.fakes import make_tick
from tests.app.widgets.conftest import Own, colours_in


def test_performance_shows_percentiles_and_marks_a_long_block(own: Own) -> None:
    panel = own(PerformancePanel(), 260, 180)
    panel.add(make_tick(), 12.4)
    assert "network" not in panel.text
    assert "total 30.0 30.0" in panel.text
    assert "segmentation 21.0 21.0" in panel.text
    assert "pause ms 12" in panel.text
    panel.clear()
    assert "total" not in panel.text
    panel.add(make_tick(), 80.0)
    assert theme.FAULT.upper() in colours_in(panel)
