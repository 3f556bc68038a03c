"""The keys on the screen, and how far they have moved the robot."""

from __future__ import annotations

from PySide6.QtCore import QPoint, Qt
from pytestqt.qtbot import QtBot

from app.widgets.jog_panel import JogPanel, Motion
from core.config.models import JogConfig
from core.config.safety import ServosConfig
from core.types import RobotStatus
from tests.app.widgets.conftest import Own
from tests.core.robots import ADVANCE, ROTATION, TENDON, TURNED, robot


def test_jog_panel_says_what_a_held_key_makes(own: Own) -> None:
    panel = own(JogPanel(ServosConfig()))
    assert panel.speeds == "", "no rig is known"
    panel.set_speeds(JogConfig(bend_rate_per_s=1.2, advance_mm_s=10.0, delivery_mm_s=8.0), ServosConfig(max_pull_mm=2.0))
    assert panel.speeds == "speeds: feed 10, sheath 8, tendons 2.4 mm/s"
    assert panel.speeds in panel._readout.accessibleDescription()
    assert panel._caps[Motion.WITHDRAW].toolTip() == "sheath back: hold to move, release to stop; 8 mm/s"
    assert panel._caps[Motion.PITCH_UP].toolTip().endswith("the tendons are pulled 2.4 mm/s")
    heard: list[float] = []
    panel.speed_changed.connect(heard.append)
    panel._speed.setCurrentIndex(1)
    assert heard == [0.5]
    assert panel.speeds == "speeds: feed 5, sheath 4, tendons 1.2 mm/s"
    panel.set_speeds(JogConfig(), ServosConfig(max_pull_mm=1.0))
    assert panel.speeds == "speeds: feed 5, sheath 5, tendons 0.6 mm/s", "another rig has the chosen share, too"
    panel.set_speeds(JogConfig(), TURNED)
    assert panel.speeds == "speeds: feed 5, tendons 1.2 mm/s", "this one has no sheath"


def test_key_caps_light_up_and_can_be_held_with_the_mouse(own: Own, qtbot: QtBot) -> None:
    panel = own(JogPanel(ServosConfig()), 280, 140, show=True)
    events: list[tuple[str, Motion]] = []
    panel.pressed.connect(lambda motion: events.append(("down", motion)))
    panel.released.connect(lambda motion: events.append(("up", motion)))
    panel.show_held(frozenset({Motion.ADVANCE}))
    lit = [motion for motion, cap in panel._caps.items() if cap.is_lit]
    assert lit == [Motion.ADVANCE]
    cap = panel._caps[Motion.STEER_LEFT]
    qtbot.mousePress(cap, Qt.MouseButton.LeftButton, pos=QPoint(5, 5))
    qtbot.mouseRelease(cap, Qt.MouseButton.LeftButton, pos=QPoint(500, 5))
    assert events == [("down", Motion.STEER_LEFT), ("up", Motion.STEER_LEFT)]
    qtbot.mousePress(cap, Qt.MouseButton.LeftButton)
    panel.hide()
    assert events[-1] == ("up", Motion.STEER_LEFT), "a hidden cap holds nothing"


def test_readout_shows_and_says_how_the_robot_stands(own: Own) -> None:
    panel = own(JogPanel(ServosConfig()), 203, 170, show=True)
    pictures = []
    for pulls, text in (
        ((0.3, 0.3, 0.3, 0.3), "bend 0.00, pitch 0.00, inserted 84 mm"),
        ((1.3, -0.7, 0.3, 0.3), "bend 0.50, pitch 0.00, inserted 84 mm"),
        ((0.3, 0.3, -0.7, 1.3), "bend 0.00, pitch -0.50, inserted 84 mm"),
    ):
        panel.show_status(RobotStatus(0.0, 84.2, 0.0, pulls, (0.0,) * 4))
        assert panel.readout == panel._readout.accessibleDescription() == text
        pictures.append(panel._readout.grab().toImage())
    assert pictures[0] != pictures[1] and pictures[1] != pictures[2]
    panel.show_status(None)
    assert panel.readout == "bend –, pitch –, inserted – mm", "a straight head would be something that is known"
    panel.set_enabled(False, "Fault")
    assert panel.accessibleDescription() == "Fault"


def test_readout_shows_nothing_of_unknown_joints(own: Own) -> None:
    panel = own(JogPanel(ServosConfig()))
    panel.show_known((False,) * 7)
    panel.show_status(RobotStatus(0.0, 0.0, 0.0, (0.0,) * 4, (0.0,) * 4))
    assert panel.readout == "bend –, pitch –, inserted – mm"
    unknown = panel._readout.grab().toImage()
    panel.show_known((True, True, False, True, True, True, True))
    assert panel.readout == "bend 0.00, pitch –, inserted 0 mm"
    assert panel._readout.grab().toImage() != unknown, "a bar without a mark is no straight head"
    panel.show_known((True,) * 4 + (False, True, True))
    assert panel.readout == "bend 0.00, pitch 0.00, inserted – mm"


def test_keys_of_motions_that_the_robot_does_not_have_are_hidden(own: Own) -> None:
    panel = own(JogPanel(TURNED), 280, 140, show=True)
    panel.set_speeds(JogConfig(), TURNED)
    turns = {Motion.TURN_LEFT, Motion.TURN_RIGHT}
    assert {motion for motion, cap in panel._caps.items() if not cap.isVisible()} == {Motion.DELIVER, Motion.WITHDRAW} | turns
    panel.show_status(RobotStatus(0.0, 84.2, 0.0, (1.3, -0.7), (0.0,) * 2, rotation_deg=-90.0))
    assert panel.readout == "bend 0.50, pitch 0.00, inserted 84 mm", "its tendons bend in the picture's plane now"
    flat = TURNED.model_copy(update={"joints": TURNED.joints[:3]})
    panel.set_speeds(JogConfig(), flat)
    assert not panel._caps[Motion.PITCH_UP].isVisible(), "two tendons cannot pitch without a rotation"
    panel.set_speeds(JogConfig(), ServosConfig())
    assert {motion for motion, cap in panel._caps.items() if not cap.isVisible()} == turns


def test_a_shaft_with_four_tendons_is_turned_by_keys(own: Own) -> None:
    turned = robot(*({**TENDON, "name": name} for name in ("right", "left", "up", "down")), ADVANCE, ROTATION)
    panel = own(JogPanel(turned), 280, 140, show=True)
    panel.set_speeds(JogConfig(rotation_deg_s=90.0), turned)
    assert panel._caps[Motion.TURN_LEFT].isVisible()
    assert panel._caps[Motion.TURN_LEFT].toolTip() == "turn the shaft left: hold to move, release to stop; 60 °/s"
