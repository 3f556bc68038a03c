"""The panels together: what one of them is told, the others do not contradict."""

from __future__ import annotations

import numpy as np
from pytestqt.qtbot import QtBot

from app.operator.panels import OperatorPanels
from core.config.models import Config
from core.control.drive_view import DriveView
from core.types import Frame, Tick
from hardware.rig import RigKind
from tests.app.bus_status import bus
from tests.core.pilot_bench import ADVICE, Bench, scene_at


def test_neither_advice_nor_ghost_outlives_its_frame(qtbot: QtBot) -> None:
    """The picture stands for half a second before it counts as old; what was advised for it is over sooner."""
    panels = OperatorPanels(Config(), RigKind.SIM, [])
    qtbot.addWidget(panels)
    panels.show()
    bench = Bench().on()
    frame = Frame(1, bench.now_s, np.zeros((480, 640, 3), np.uint8))
    panels.show_drive(bench.pilot.view, None)
    panels.show_tick(Tick(frame, scene_at(1, bench.now_s), ADVICE, None, None, 0, 30.0), 0.0)
    qtbot.waitUntil(lambda: "go" in panels.advice.text)
    assert panels.live.ghost is not None
    bench.seeing = False
    bench.turn(8)  # 160 ms
    panels.show_drive(bench.pilot.view, None)
    assert bench.pilot.view.blanked
    assert panels.live.ghost is None
    assert "go" not in panels.advice.text
    assert bench.pilot.view.blanked in panels.advice.text
    bench.pilot.close()


def test_positions_of_a_twin_that_waits_for_the_computer_are_known_ones(qtbot: QtBot) -> None:
    """Its clock is behind the wall's, further and further; a bus counts as silent by that clock."""
    panels = OperatorPanels(Config(), RigKind.SIM, [])
    qtbot.addWidget(panels)
    panels.show_drive(DriveView(100.2), bus())
    assert "inserted 20 mm" in panels.jog._readout.text
    assert "nothing heard" not in panels.servos.bus.text()
    panels.show_drive(DriveView(103.0), bus())
    assert "inserted 20 mm" not in panels.jog._readout.text
    assert "nothing heard from the servo bus for 3 s" in panels.servos.bus.text()
