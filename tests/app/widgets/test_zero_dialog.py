"""The dialog of the zeros: what it says of each joint, what it proposes, and that it asks for nothing else."""

from __future__ import annotations

import time

import pytest
from pytestqt.qtbot import QtBot

from app.widgets.zero_dialog import Choice, JointZero, ZeroDialog, choices, joint_zeros
from core.config.safety import TENDONS, JointKind, JointName
from core.control.kept_zero import ZeroOffer, ZeroRequest
from hardware.servos.bus_ipc import BusPhase, BusStatus
from hardware.servos.registers import MissingServo
from tests.app.bus_status import SERVOS, bus, servo

LONG_AGO_S = time.mktime((2026, 3, 4, 12, 30, 0, 0, 0, -1))


def offer(name: JointName, at_mm: float, moved_mm: float = 0.0, kept_s: float = LONG_AGO_S) -> ZeroOffer:
    return ZeroOffer(name, at_mm, moved_mm, 0, kept_s)


def restarted(*offers: ZeroOffer, torque: bool = True) -> BusStatus:
    """A bus whose joints have all lost their zeros."""
    states = (servo(place, position_mm=None, goal_mm=None, torque=torque) for place in range(7))
    return bus(*states, phase=BusPhase.DISARMED, zeroed=(False,) * 7, offers=offers)


@pytest.fixture
def dialog(qtbot: QtBot) -> ZeroDialog:
    dialog = ZeroDialog(SERVOS)
    qtbot.addWidget(dialog)
    dialog.show()
    return dialog


@pytest.mark.parametrize(
    ("known", "said"),
    [
        (JointZero("right", None, offer("right", 0.42), True), "+0.42 mm from its kept zero (2026-03-04 12:30)"),
        (
            JointZero("up", None, offer("up", -0.1, 1.2, 0.0), True),
            "-0.10 mm from its kept zero (rig file), moved by +1.2 mm",
        ),
        (JointZero("down", None, None, True), "no kept zero that fits"),
        (JointZero("left", 0.3, None, True), "at 0.30 mm"),
        (
            JointZero("advance", None, offer("advance", 40.7, 0.6), False),
            "last seen at 40.1 mm (2026-03-04 12:30), moved by +0.6 mm",
        ),
        (JointZero("advance", None, None, False), "not known: measure how far it is in"),
        (JointZero("delivery_1", 12.0, None, True), "at 12.0 mm"),
        (JointZero("delivery_2"), "its servo does not answer"),
    ],
)
def test_what_is_said_of_a_joint(known: JointZero, said: str) -> None:
    assert known.note.removesuffix(" since") == said


@pytest.mark.parametrize(
    ("known", "offered"),
    [
        (JointZero("right", None, offer("right", 0.4), True), (Choice.KEPT, Choice.LEAVE)),
        (JointZero("right", None, offer("right", 0.4), False), (Choice.KEPT, Choice.LEAVE, Choice.AGAIN)),
        (JointZero("right", None, None, True), (Choice.LEAVE,)),
        (JointZero("right", None, None, False), (Choice.LEAVE, Choice.SLACK)),
        (JointZero("right", 0.3, None, True), (Choice.LEAVE,)),
        (JointZero("right", 0.3, None, False), (Choice.LEAVE, Choice.AGAIN)),
        (JointZero("right"), (Choice.LEAVE,)),
    ],
)
def test_a_wire_is_slack_only_where_its_servo_does_not_hold_and_is_never_proposed_to_be(
    known: JointZero, offered: tuple[Choice, ...]
) -> None:
    assert choices(known) == offered


def test_after_a_restart_the_kept_values_are_proposed_and_only_set_when_asked(dialog: ZeroDialog, qtbot: QtBot) -> None:
    dialog.show_joints(joint_zeros(restarted(*(offer(name, 0.3) for name in TENDONS), offer("advance", 40.1)), SERVOS))
    with qtbot.waitSignal(dialog.zero_asked) as asked:
        dialog.set_button.click()
    assert asked.args == [ZeroRequest(positions_mm={"advance": 40.1}, kept=TENDONS)]


def test_a_number_that_nobody_gave_is_not_set(dialog: ZeroDialog) -> None:
    dialog.show_joints(joint_zeros(restarted(torque=False), SERVOS))
    assert dialog.request == ZeroRequest()
    assert not dialog.set_button.isEnabled()
    box, number = dialog.feed("advance")
    assert box.isChecked()
    assert number.text() == "? mm"
    number.setValue(-5.0)
    assert dialog.request == ZeroRequest(positions_mm={"advance": -5.0})
    box.setChecked(False)
    assert dialog.request == ZeroRequest()


def test_a_wire_that_was_hung_in_again_is_forgotten_and_zeroed_here(dialog: ZeroDialog) -> None:
    dialog.show_joints(joint_zeros(restarted(offer("up", 1.0), torque=False), SERVOS))
    up = dialog.tendon("up")
    up.setCurrentIndex(up.findData(Choice.AGAIN))
    right = dialog.tendon("right")
    right.setCurrentIndex(right.findData(Choice.SLACK))
    assert dialog.request == ZeroRequest(positions_mm={"right": 0.0, "up": 0.0}, forgotten=("up",))


def test_without_a_kept_zero_the_search_is_the_way(dialog: ZeroDialog, qtbot: QtBot) -> None:
    dialog.show_joints(joint_zeros(restarted(*(offer(name, 0.3) for name in TENDONS)), SERVOS))
    assert (dialog.search_button.objectName(), dialog.set_button.objectName()) == ("", "main_button")
    dialog.show_joints(joint_zeros(restarted(*(offer(name, 0.3) for name in TENDONS[1:])), SERVOS))
    assert (dialog.search_button.objectName(), dialog.set_button.objectName()) == ("main_button", "")
    with qtbot.waitSignal(dialog.search_asked):
        dialog.search_button.click()
    assert not dialog.isVisible()


def test_what_was_chosen_stays_while_it_is_possible(dialog: ZeroDialog, qtbot: QtBot) -> None:
    """The state of the servos is shown five times a second, and the torque goes off meanwhile."""
    dialog.show_joints(joint_zeros(restarted(offer("advance", 40.1), torque=True), SERVOS))
    with qtbot.waitSignal(dialog.torque_off_asked):
        dialog.off_button.click()
    dialog.show_joints(joint_zeros(restarted(offer("advance", 40.9), torque=False), SERVOS))
    assert dialog.request == ZeroRequest(positions_mm={"advance": 40.9}), "moved by hand"
    dialog.feed("advance")[1].setValue(38.0)
    dialog.show_joints(joint_zeros(restarted(offer("advance", 40.2), torque=False), SERVOS))
    assert not dialog.off_button.isEnabled()
    left = dialog.tendon("left")
    left.setCurrentIndex(left.findData(Choice.SLACK))
    dialog.show_joints(joint_zeros(restarted(offer("advance", 40.3), torque=False), SERVOS))
    assert dialog.request == ZeroRequest(positions_mm={"left": 0.0, "advance": 38.0})
    dialog.show_joints(joint_zeros(restarted(offer("advance", 40.3), torque=True), SERVOS))
    assert dialog.request == ZeroRequest(positions_mm={"advance": 38.0}), "its servo holds again"


def test_all_is_shown_of_a_bus_that_is_silent_or_lacks_a_servo() -> None:
    nothing = tuple(JointZero(joint.name, kind=joint.kind) for joint in SERVOS.joints)
    assert joint_zeros(None, SERVOS) == joint_zeros(bus(servos=()), SERVOS) == nothing
    known = joint_zeros(bus(MissingServo("up", 3, 100.0, 4, "silent"), phase=BusPhase.DISARMED), SERVOS)
    assert known[2] == nothing[2]
    state = servo(0)
    assert known[0] == JointZero("right", state.position_mm, None, True, JointKind.TENDON)
