"""A drive that is no DYNAMIXEL: a stepper board on a pseudo-terminal, its faults, and STOP through the guarded process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import pytest

from core.config.models import load_config
from core.config.rig_file import RigFileError, make_rig
from core.config.safety import SafetyConfig, ServosConfig
from core.control.faults import Cause
from core.control.gate import Source
from core.control.kept_zero import ZeroRequest
from core.types import Command
from hardware.servos.bus_process import make_bus
from hardware.servos.drive import DriveBus
from hardware.servos.dynamixel_port import NoAnswer, NotReady, PortTaken, StoppedMeanwhile, TorqueStillOn
from hardware.servos.registers import HardwareError, MissingServo, ServoState
from hardware.servos.servo_robot import ServoRobot
from hardware.servos.stepper_board import StepperBoard, line_of, states_of, text_of
from tests.core.robots import THREE
from tests.hardware.servos.soft_stepper import SoftStepper

pytestmark = pytest.mark.real_time

SERVOS = ServosConfig.model_validate({**THREE.model_dump(), "driver": "stepper board", "baud": 115_200})


@pytest.fixture
def board() -> Iterator[SoftStepper]:
    board = SoftStepper(SERVOS)
    yield board
    board.close()


@pytest.fixture
def bus(board: SoftStepper) -> Iterator[DriveBus]:
    bus = make_bus(SERVOS.model_copy(update={"port": board.port}), None)
    assert isinstance(bus, DriveBus)
    bus.open()
    yield bus
    bus.close()


@pytest.fixture
def armed(bus: DriveBus) -> DriveBus:
    bus.set_zero()
    bus.arm()
    return bus


def _states(bus: DriveBus) -> list[ServoState]:
    states = [reading for reading in bus.read() if isinstance(reading, ServoState)]
    assert len(states) == len(SERVOS.joints)
    return states


def test_lines_carry_a_checksum_and_damaged_ones_are_refused() -> None:
    assert line_of("?") == b"?*3F\n"
    assert text_of(b"G 1 2000*" + line_of("G 1 2000")[-3:]) == "G 1 2000"
    for damaged in (b"", b"?", b"?*40\n", b"*\n", b"?*zz\n", b"\xff*FF\n"):
        with pytest.raises(ValueError):
            text_of(damaged)
    state = states_of("A 7 24.1 31.5;4 -20 30 1 4")[4]
    assert (state.position, state.goal, state.is_on, state.error, state.volts) == (-20, 30, True, HardwareError.OVERHEATING, 24.1)
    for wrong in ("A 7 24.1", "B 7 24.1 31.5;4 0 0 1 0", "A 7 24.1 31.5;4 0 0", "A x 24.1 31.5;4 0 0 1 0"):
        with pytest.raises(ValueError):
            states_of(wrong)


def test_axes_follow_goals_and_tell_where_they_are(board: SoftStepper, armed: DriveBus) -> None:
    for turn in range(1, 6):
        written = armed.write((0.1 * turn, 0.0, 0.0, 0.5 * turn))
        time.sleep(0.02)
    assert written[3] == pytest.approx(2.5, abs=0.01)
    time.sleep(0.1)
    states = _states(armed)
    assert [state.position_mm for state in states] == pytest.approx([0.5, 0.0, 0.0, 2.5], abs=0.02)
    assert {(state.voltage_v, state.temperature_c, state.current_ma) for state in states} == {(24.1, 31.5, None)}


def test_nothing_moves_before_it_is_zeroed_and_armed(board: SoftStepper, bus: DriveBus) -> None:
    with pytest.raises(NotReady, match="not zeroed: tendon_1, tendon_2"):
        bus.arm()
    bus.set_zero()
    with pytest.raises(NotReady, match="not armed"):
        bus.write((0.0,) * 4)
    board.axes[2].errors = 4
    with pytest.raises(NotReady, match="tendon_2 reports an error"):
        bus.arm()
    assert not any(axis.is_on for axis in board.axes.values())
    board.axes[2].errors, board.axes[1].is_on = 0, True
    with pytest.raises(NotReady, match="some axes hold and others do not"):
        bus.arm()


def test_a_tendon_is_zeroed_only_while_it_is_let_go(armed: DriveBus) -> None:
    with pytest.raises(NotReady, match="disarm before zeroing"):
        armed.set_zero()
    armed.disarm()
    with pytest.raises(NotReady, match="tendon_1 holds its wire"):
        armed.set_zero()
    armed.set_zero({"advance": 40.0})
    assert _states(armed)[3].position_mm == pytest.approx(40.0, abs=0.01)
    armed.torque_off()
    armed.set_zero()


def test_a_damaged_line_is_asked_again_and_a_silent_board_is_missing(board: SoftStepper, armed: DriveBus) -> None:
    board.garbled = 1
    assert len(_states(armed)) == 4
    assert armed.counts.corrupt == 1
    board.mute = -1
    for misses in (1, 2, 3):
        assert [(one.misses, one.reason) for one in armed.read() if isinstance(one, MissingServo)] == [(misses, "no answer")] * 4
    with pytest.raises(TorqueStillOn, match="tendon_1, tendon_2, tendon_3, advance is not proven to be off"):
        armed.torque_off()


def test_a_board_that_restarted_has_lost_all_zeros_and_takes_no_goals(board: SoftStepper, armed: DriveBus) -> None:
    board.restart()
    readings = armed.read()
    assert all(isinstance(one, MissingServo) and one.restarted for one in readings)
    assert armed.zero_ticks == (None,) * 4
    with pytest.raises(NotReady, match="not armed"):
        armed.write((0.0,) * 4)


def test_current_that_stays_on_is_told(board: SoftStepper, armed: DriveBus) -> None:
    board.stuck = True
    with pytest.raises(TorqueStillOn, match="cut the servos' power"):
        armed.torque_off()
    board.stuck = False
    armed.torque_off()
    assert not any(axis.is_on for axis in board.axes.values())


def test_stop_while_it_is_switched_on_leaves_it_off(board: SoftStepper, bus: DriveBus) -> None:
    bus.set_zero()

    def check() -> None:
        if any(text == "H" for text in board.said):
            raise StoppedMeanwhile("stopped meanwhile")

    with pytest.raises(StoppedMeanwhile), bus.interruptible(check):
        bus.arm()
    assert not bus.is_armed
    assert not any(axis.is_on for axis in board.axes.values())


def test_letting_go_never_tightens(armed: DriveBus) -> None:
    armed.write((0.3, 0.0, 0.0, 0.0))
    time.sleep(0.1)
    readings = armed.read()
    with pytest.raises(ValueError, match="cannot be slackened"):
        armed.slacken((0.9, None, None, None), readings)
    armed.slacken((0.1, None, None, None), readings)
    time.sleep(0.1)
    assert _states(armed)[0].position_mm == pytest.approx(0.1, abs=0.02)


def test_a_missing_axis_or_a_taken_port_is_one_line(board: SoftStepper, bus: DriveBus) -> None:
    other = StepperBoard(board.port, 115_200)
    with pytest.raises(PortTaken):
        other.open()
    bus.close()
    del board.axes[3]
    with pytest.raises(NoAnswer, match=r"tendon_3 \(id 3\): no answer; check the drive's power"):
        bus.open()
    assert not bus.is_open


def test_stop_reaches_the_board_through_the_guarded_process(board: SoftStepper) -> None:
    robot = ServoRobot(SERVOS.model_copy(update={"port": board.port, "unattended_s": 0.0}), SafetyConfig(), name="steppers")
    try:
        robot.connect()
        robot.zero(ZeroRequest(positions_mm=dict.fromkeys(SERVOS.names, 0.0)))
        robot.arm()
        until_s = time.monotonic() + 5.0
        while board.axes[4].position < 4050.0:
            robot.send(Command(advance_mm_s=5.0), source=Source.OPERATOR)
            assert time.monotonic() < until_s, robot.bus_status()
            time.sleep(0.01)
        robot.stop()
        _until(lambda: (status := robot.bus_status()) is not None and status.latched is not None)
        status = robot.bus_status()
        assert status.latched.cause is Cause.STOP_PRESSED
        _until(lambda: "S" in board.said)
        at = board.axes[4].position
        time.sleep(0.1)
        assert board.axes[4].position == pytest.approx(at, abs=2.0), "it holds"
        robot.torque_off()
        assert not any(axis.is_on for axis in board.axes.values())
    finally:
        robot.close()


def _until(is_true: Callable[[], bool]) -> None:
    until_s = time.monotonic() + 5.0
    while not is_true():
        assert time.monotonic() < until_s
        time.sleep(0.005)


def test_what_has_no_stepper_board_is_refused() -> None:
    with pytest.raises(RigFileError, match="the twin has DYNAMIXEL servos of its own"):
        make_rig(load_config().model_copy(update={"servos": SERVOS}), "bench 1", None)
    with pytest.raises(NotReady, match="no servo port is configured"):
        make_bus(SERVOS, None)
