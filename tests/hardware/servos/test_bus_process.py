"""The guarded bus process for real: it is killed, stopped and flooded, and strict software servos tell what came of it."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil
import pytest

from core.config.safety import JOINT_NAMES, SafetyConfig, ServosConfig
from core.control.faults import Cause
from core.control.gate import RejectReason, Source
from core.control.kept_zero import ZeroRequest
from core.control.robot import GuardedRobot
from core.devices import DeviceError
from core.types import Command, RobotStatus
from hardware.processes import PARENT_CHECK_S
from hardware.servos.bus_ipc import BusClient, BusPhase, BusStatus, start_bus
from hardware.servos.discovery import find_servos
from hardware.servos.dynamixel_port import BusProcessLost, NoAnswer, NotReady, PortError, PortTaken, TorqueStillOn
from hardware.servos.registers import ServoState
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.servos.bus import SoftServoBus
from tools.kill_campaign import BOUND_S, BOUND_STEPS, KINDS, strike

pytestmark = [pytest.mark.real_time, pytest.mark.usefixtures("no_process_stays_behind")]

ROOT = Path(__file__).resolve().parents[3]
# Watchdog and heartbeat are patient, so that a machine that stalls does not trip them; what is about them says so.
# So that no process stays behind, servos that hold are not watched; what is about that says so, too.
CONFIG, SAFETY = ServosConfig(watchdog_s=2.5, heartbeat_timeout_s=3.0, unattended_s=0.0), SafetyConfig()
FORWARD = Command(advance_mm_s=5.0)
PATIENCE_S = 10.0
STRAIN_MA = 700.0
"""Of a gear that grinds: more than a servo may draw."""


@pytest.fixture
def servos(start_servos: Callable[..., SoftServoBus]) -> SoftServoBus:
    return start_servos(CONFIG, wire_time=True, positions=[1000 + joint.id for joint in CONFIG.joints])


def _robot(servos: SoftServoBus, **changes: object) -> ServoRobot:
    return ServoRobot(CONFIG.model_copy(update={"port": servos.port, **changes}), SAFETY)


@pytest.fixture
def robot(servos: SoftServoBus) -> Iterator[ServoRobot]:
    robot = _robot(servos)
    robot.connect()
    yield robot
    robot.close()


@pytest.fixture
def armed(robot: ServoRobot) -> ServoRobot:
    robot.zero()
    robot.arm()
    return robot


def _drive(robot: ServoRobot, seconds: float = PATIENCE_S, until: Callable[[BusStatus], bool] = lambda status: False) -> BusStatus:
    """Drive forward until something is seen, or for so long; returns the last status."""
    end_s = time.monotonic() + seconds
    while True:
        robot.beat(Source.OPERATOR)
        robot.send(FORWARD)
        status = robot.bus_status()
        if until(status) or time.monotonic() > end_s:
            return status
        time.sleep(0.02)


def _seen(robot: ServoRobot, wanted: Callable[[BusStatus], bool], beat: bool = True) -> BusStatus:
    """Wait for a status, as an application that is well but asks for nothing."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        if beat:
            robot.beat(Source.OPERATOR)
        status = robot.bus_status()
        if status is not None and wanted(status):
            return status
        time.sleep(0.01)
    raise AssertionError(f"not seen: {status}")


def _wait_for(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.01)


def _signal(robot: ServoRobot, number: signal.Signals) -> None:
    """To the robot's bus process."""
    os.kill(robot._client.pid, number)


def _torques(servos: SoftServoBus) -> list[int]:
    return [servos.servo(joint.id).table["torque"] for joint in CONFIG.joints]


def _latched(cause: Cause) -> Callable[[BusStatus], bool]:
    return lambda status: status.latched is not None and status.latched.cause is cause


def _settle_mm(servos: SoftServoBus, most_s: float = 2.0) -> float:
    """Where the advance servo is when it stands still."""
    at_mm, end_s = servos.positions_mm()[4], time.monotonic() + most_s
    while time.monotonic() < end_s:
        time.sleep(0.1)
        before_mm, at_mm = at_mm, servos.positions_mm()[4]
        if at_mm == before_mm:
            return at_mm
    raise AssertionError("the servo goes on and on")


# --- from arming to closing ------------------------------------------------------------------------------------------------------


def test_it_is_a_robot_that_moves_only_when_armed(servos: SoftServoBus, robot: ServoRobot) -> None:
    as_protocol: GuardedRobot = robot
    assert as_protocol.send(FORWARD) == Command()
    assert robot.bus_status().firmware == (servos.servo(1).table["firmware"],) * 7
    _drive(robot, 0.2)
    assert servos.positions_mm()[4] == 0.0
    with pytest.raises(NotReady, match="not zeroed"):
        robot.arm()
    robot.zero()
    robot.arm()
    status = _drive(robot, until=lambda status: servos.positions_mm()[4] > 2.5)  # the wires come to their pretension slowly
    assert status.armed
    assert status.sent.order.command == FORWARD
    assert robot.send(FORWARD).advance_mm_s == pytest.approx(5.0, abs=2.5)
    assert as_protocol.status().insertion_mm == pytest.approx(servos.positions_mm()[4], abs=0.5)
    _drive(robot, until=lambda status: abs(servos.positions_mm()[0] - CONFIG.pretension_mm) <= 0.02)
    assert servos.positions_mm()[0] == pytest.approx(CONFIG.pretension_mm, abs=0.02)


def test_without_a_supervisor_orders_are_signs_of_life_and_with_one_they_are_not(servos: SoftServoBus, armed: ServoRobot) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while servos.positions_mm()[4] < 1.0 and time.monotonic() < end_s:
        armed.send(FORWARD)
        time.sleep(0.02)
    assert servos.positions_mm()[4] >= 1.0
    armed.beat(Source.OPERATOR)
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        armed.send(FORWARD)
        armed.status()
        status = armed.bus_status()
        if status is not None and not status.armed:
            break
        time.sleep(0.02)
    assert status.latched.cause is Cause.HEARTBEAT_LOST
    assert servos.positions_mm()[4] < 4.0


def test_hold_stops_and_disarm_refuses_orders(servos: SoftServoBus, armed: ServoRobot) -> None:
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    armed.hold()
    _seen(armed, lambda s: s.rejection is not None and s.rejection.reason is RejectReason.NO_COMMAND)
    _settle_mm(servos)
    assert _seen(armed, lambda s: True).armed
    armed.disarm()
    before_mm = _settle_mm(servos)
    _drive(armed, 0.2)
    assert servos.positions_mm()[4] == before_mm
    assert _seen(armed, lambda s: s.phase is BusPhase.DISARMED).latched is None


def test_requests_that_cannot_be_done_say_why(armed: ServoRobot) -> None:
    with pytest.raises(NotReady, match="disarm before zeroing"):
        armed.zero()
    with pytest.raises(NotReady, match="already armed"):
        armed.arm()
    with pytest.raises(NotReady, match="disarm before a reboot"):
        armed.reboot(1)


def test_it_refuses_what_is_not_finite(robot: ServoRobot) -> None:
    for key in ("bend", "pitch", "advance_mm_s", "delivery_mm_s"):
        with pytest.raises(ValueError, match="not finite"):
            robot.send(Command(**{key: math.nan}))


def test_a_port_that_is_none_and_servos_that_are_not_there(servos: SoftServoBus) -> None:
    with pytest.raises(NotReady, match=r"set servos\.port"):
        ServoRobot(ServosConfig(), SAFETY).connect()
    with pytest.raises(PortError, match="does not exist"):
        ServoRobot(CONFIG.model_copy(update={"port": servos.port + "_not"}), SAFETY).connect()
    servos.faults.mute(3)
    with pytest.raises(NoAnswer, match="servo up"):
        _robot(servos).connect()


@pytest.mark.parametrize("simulated", [False, True])
def test_a_simulated_robot_names_no_cable(servos: SoftServoBus, simulated: bool) -> None:
    truth = RobotStatus(0.0, 0.0, 0.0, (0.0,) * 4, (0.0,) * 4)
    robot = ServoRobot(CONFIG.model_copy(update={"port": servos.port}), SAFETY, truth=(lambda: truth) if simulated else None)
    robot.connect()
    try:
        servos.faults.mute(3)
        with pytest.raises(NotReady) as told:
            robot.zero()
        assert ("cable" in str(told.value)) is not simulated
        assert ("the twin's servos did not answer in time" in str(told.value)) is simulated
    finally:
        servos.faults.clear()
        robot.close()


def test_fault_29_a_second_program_is_refused_and_the_first_one_drives_on(servos: SoftServoBus, armed: ServoRobot) -> None:
    with pytest.raises(PortTaken, match="close that program first"):
        _robot(servos).connect()
    assert _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0).armed


def test_closed_in_the_middle_of_a_motion_the_servos_hold(servos: SoftServoBus, armed: ServoRobot) -> None:
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    armed.close()
    armed.close()
    at_mm = servos.positions_mm()[4]
    assert abs(_settle_mm(servos) - at_mm) <= CONFIG.joints[4].max_step_mm
    assert servos.servo(5).table["torque"] == 1
    armed.stop()
    armed.hold()
    with pytest.raises(BusProcessLost, match="connect it first"):
        armed.send(FORWARD)


# --- STOP ------------------------------------------------------------------------------------------------------------------------


def test_stop_is_latched_and_needs_acknowledgement_and_a_new_arming(servos: SoftServoBus, armed: ServoRobot) -> None:
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    armed.stop()
    _drive(armed, until=lambda status: status.phase is BusPhase.STOPPED)
    at_mm = _settle_mm(servos)
    _drive(armed, 0.2)
    assert servos.positions_mm()[4] == at_mm
    with pytest.raises(NotReady, match="acknowledge first: stop pressed"):
        armed.arm()
    armed.acknowledge()
    _drive(armed, 0.2)
    assert servos.positions_mm()[4] == at_mm
    armed.arm()
    _drive(armed, until=lambda status: servos.positions_mm()[4] > at_mm + 1.0)


def test_stop_comes_through_floods_of_orders_and_requests(servos: SoftServoBus, armed: ServoRobot) -> None:
    done = threading.Event()

    def flood() -> None:
        while not done.wait(0.0005):
            armed.beat(Source.OPERATOR)
            armed.send(FORWARD)

    def ask() -> None:
        while not done.is_set():
            with contextlib.suppress(DeviceError):
                armed.zero()

    threads = [threading.Thread(target=target) for target in (flood, ask)]
    for thread in threads:
        thread.start()
    try:
        _seen(armed, lambda status: servos.positions_mm()[4] > 0.5)
        armed.stop()
        _seen(armed, lambda status: status.phase is BusPhase.STOPPED)
        _settle_mm(servos)
    finally:
        done.set()
        for thread in threads:
            thread.join()


def test_stop_while_every_way_in_is_full(servos: SoftServoBus, armed: ServoRobot) -> None:
    """The bus process stands still; requests pile up until no more go in, STOPs too. It wakes up, and stops first."""
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    _signal(armed, signal.SIGSTOP)
    try:
        with pytest.raises(BlockingIOError):
            for number in range(100_000):
                armed._client._process.send({"id": 1_000_000 + number, "do": "zero"})
        for _ in range(70_000):
            armed.stop()
    finally:
        _signal(armed, signal.SIGCONT)
    _drive(armed, until=lambda status: status.phase is BusPhase.STOPPED)
    status = armed.bus_status()
    assert status.fault_counts[Cause.STOP_PRESSED] > 0
    _settle_mm(servos)


@pytest.mark.slow  # what hangs is waited for, and then for its end
def test_a_bus_process_that_hangs_keeps_no_torque_on(armed: ServoRobot, servos: SoftServoBus) -> None:
    """Asked and asked again it could not answer, and the port was its own: only opening the rig anew got out of it."""
    _signal(armed, signal.SIGSTOP)
    armed.torque_off()
    assert _torques(servos) == [0] * 7
    assert armed.failure is not None, "this process is not the one that drives"


@pytest.mark.parametrize("comes_back", [True, False])
def test_a_torque_off_that_is_owed_is_paid_when_the_application_closes(
    servos: SoftServoBus, comes_back: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """The cable falls out, STOP is pressed, the cable is back, and the window closes before the process has looked for it again."""
    robot = _robot(servos, torque_off_on_stop=True)
    robot.connect()
    try:
        robot.zero()
        robot.arm()
        servos.vanish()
        robot.stop()
        status = _seen(robot, lambda status: status.phase is BusPhase.CLOSED and status.torque_problem != "")
        assert "cut the servos' power" in status.torque_problem
        assert any(_torques(servos))
        if comes_back:
            servos.reappear()
    finally:
        robot.close()
    assert any(_torques(servos)) is not comes_back
    assert ("the torque is not proven to be off" in caplog.text) is not comes_back


def test_torque_that_went_off_on_a_port_that_cannot_be_opened_is_told_at_once(robot: ServoRobot) -> None:
    """All seven had let go, but one of them was another one than before: told only when somebody had changed it back."""
    link, status = robot._client, _seen(robot, lambda status: bool(status.servos))
    closed = replace(status, phase=BusPhase.CLOSED, servos=(), cycle=status.cycle + 1000, torque_offs=1)
    link.status = lambda: closed
    report = robot.report()
    assert (report.port_open, report.torque_off) == (False, True)
    closed = replace(closed, cycle=closed.cycle + 1)
    report = robot.report()
    assert (report.port_open, report.torque_off) == (False, False)


def test_without_a_bus_process_and_without_a_servo_the_others_still_let_go(servos: SoftServoBus, armed: ServoRobot) -> None:
    """Nobody can connect seven servos of which one is missing, and six went on pulling."""
    _signal(armed, signal.SIGKILL)
    _wait_for(lambda: armed.failure is not None)
    servos.faults.mute(3)
    with pytest.raises(NoAnswer, match="servo up"):
        armed.connect()
    with pytest.raises(TorqueStillOn, match="torque of up is not proven to be off"):
        armed.torque_off()
    assert [servos.servo(joint.id).table["torque"] for joint in CONFIG.joints if joint.id != 3] == [0] * 6
    servos.faults.clear()
    armed.torque_off()
    assert _torques(servos) == [0] * 7
    assert armed.failure is not None  # nobody drives with it before it was connected again
    armed.connect()
    assert armed.failure is None
    armed.close()
    with pytest.raises(BusProcessLost, match="connect it first"):
        armed.torque_off()


def test_a_bus_process_that_tells_nothing_any_more_sends_nothing(servos: SoftServoBus, armed: ServoRobot) -> None:
    """It stands still, then it is gone: its last status would say for ever that the robot is being driven."""
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    sent = armed.sent_motion()
    assert sent.source is Source.OPERATOR
    _signal(armed, signal.SIGSTOP)
    try:
        time.sleep(SAFETY.bus_hold_s + 0.1)
        sent = armed.sent_motion()
        assert (sent.source, sent.motion.advance_mm_s) == (None, 0.0)
        assert armed.send(FORWARD).advance_mm_s == 0.0
    finally:
        _signal(armed, signal.SIGKILL)
        _signal(armed, signal.SIGCONT)
    _wait_for(lambda: armed.failure is not None)
    assert armed.sent_motion() is None


# --- the application falls silent ------------------------------------------------------------------------------------------------


def test_silence_holds_then_disarms_then_quiet_then_the_servos_own_watchdog(servos: SoftServoBus) -> None:
    robot = _robot(servos, watchdog_s=0.4, heartbeat_timeout_s=0.3)
    robot.connect()
    try:
        robot.zero()
        robot.arm()
        _drive(robot, until=lambda status: servos.positions_mm()[4] > 1.0)
        at_mm = servos.positions_mm()[4]
        status = _seen(robot, lambda status: status.phase is BusPhase.QUIET, beat=False)
        assert status.latched.cause is Cause.HEARTBEAT_LOST
        assert status.servos == ()
        assert abs(servos.positions_mm()[4] - at_mm) <= CONFIG.joints[4].max_step_mm
        heard = len(servos.log)
        time.sleep(0.6)
        assert len(servos.log) == heard
        assert servos.servo(5).table["watchdog"] == -1
        # it wakes up, and nothing moves before it was acknowledged and armed
        status = _drive(robot, 0.3)
        assert status.phase is BusPhase.DISARMED
        with pytest.raises(NotReady, match="no heartbeat of the application"):
            robot.arm()
        robot.acknowledge()
        robot.arm()
        at_mm = servos.positions_mm()[4]
        _drive(robot, until=lambda status: servos.positions_mm()[4] > at_mm + 1.0)
    finally:
        robot.close()


# --- faults of bus and servos ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("inject", "cause", "phase"),
    [
        (lambda s: s.faults.crc(60), Cause.BUS_NOISE, BusPhase.DISARMED),
        (lambda s: s.modify_servo(2, lambda servo: servo.alert(32)), Cause.SERVO_ALERT, BusPhase.STOPPED),
        (lambda s: s.modify_servo(5, lambda servo: servo.freeze(True)), Cause.TRACKING, BusPhase.STOPPED),
    ],
    ids=["22 noise", "23 overload", "25 jam"],
)
def test_faults_end_the_motion(
    servos: SoftServoBus, armed: ServoRobot, inject: Callable[[SoftServoBus], None], cause: Cause, phase: BusPhase
) -> None:
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    inject(servos)
    status = _drive(armed, until=_latched(cause))
    assert status.latched.cause is cause
    assert status.phase is phase
    assert status.fault_counts[cause] == 1
    servos.faults.clear()
    _settle_mm(servos)


def test_an_e_stop_is_told_from_a_broken_cable_and_nothing_arms_before_power_is_back(
    servos: SoftServoBus, armed: ServoRobot
) -> None:
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    servos.brown_out(for_s=PATIENCE_S)
    status = _drive(armed, until=lambda status: status.latched is not None)
    assert status.latched.cause is Cause.SUPPLY_LOST
    assert not status.armed
    armed.acknowledge()
    with pytest.raises(NotReady, match="release the E-stop or switch their supply on"):
        armed.arm()
    for joint in CONFIG.joints:
        servos.modify_servo(joint.id, lambda servo: servo.restart(0.0))  # power is back: they start again
    _seen(armed, lambda status: bool(status.servos) and all(isinstance(one, ServoState) for one in status.servos))
    with pytest.raises(NotReady, match="not zeroed"):
        armed.arm()
    armed.acknowledge()
    status = _seen(armed, lambda status: len(status.offers) == 7)
    armed.zero(ZeroRequest(kept=tuple(offer.name for offer in status.offers)))
    armed.arm()


def test_fault_29_another_master_switches_the_torque_off(servos: SoftServoBus, armed: ServoRobot) -> None:
    """No servo has restarted: the zeros hold, and the cause is named."""
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    servos.write_by_other(64, b"\0")
    status = _drive(armed, until=lambda status: status.latched is not None)
    assert not status.armed
    assert status.latched.cause is Cause.TORQUE_TAKEN
    assert status.latched.detail == ", ".join(JOINT_NAMES)
    assert all(status.zeroed)
    assert status.restarts == 0
    assert [servos.servo(joint.id).table["torque"] for joint in CONFIG.joints] == [0] * 7
    armed.acknowledge()
    armed.arm()


def _bend(robot: ServoRobot, share: float = 1.0) -> BusStatus:
    """Bend until the right tendon has its pull."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        robot.beat(Source.OPERATOR)
        robot.send(Command(bend=share, advance_mm_s=2.0))
        status = robot.bus_status()
        at_mm = _positions(status)[0] if status is not None else None
        if status is not None and at_mm is not None and at_mm > 2.0 * share + 0.2:
            return status
        time.sleep(0.02)
    raise AssertionError("the robot does not bend")


def _positions(status: BusStatus) -> tuple[float | None, ...]:
    return tuple(reading.position_mm if isinstance(reading, ServoState) else None for reading in status.servos) or (None,) * 7


def test_after_a_strain_the_tendons_are_let_go_slowly(servos: SoftServoBus, armed: ServoRobot) -> None:
    _bend(armed)
    servos.modify_servo(1, lambda servo: servo.grind(STRAIN_MA))
    _seen(armed, _latched(Cause.STRAINED))
    servos.modify_servo(1, lambda servo: servo.grind(0.0))
    begun_s, fed_mm = time.monotonic(), servos.positions_mm()[4]
    while time.monotonic() - begun_s < 0.5:  # the sender of goals may be late, but never early
        gone_mm = 2.3 - servos.positions_mm()[0]
        assert gone_mm <= 2.0 * (time.monotonic() - begun_s + 0.3)
        time.sleep(0.02)
    status = _seen(armed, lambda status: all(at is not None and at <= 0.06 for at in _positions(status)[:4]))
    assert status.latched.cause is Cause.STRAINED
    assert not status.armed
    assert _positions(status)[1] == pytest.approx(-1.7, abs=0.1), "a slack tendon is not tightened"
    assert servos.positions_mm()[4] == pytest.approx(fed_mm, abs=0.1), "the robot is not pulled out"
    assert _torques(servos) == [1] * 7


@pytest.mark.parametrize("startup", [0, 3])
def test_fault_27_a_servo_restarts(servos: SoftServoBus, armed: ServoRobot, startup: int) -> None:
    """It is silent for 0.3 s, and then has lost its zero, whatever Startup Configuration(60) brings back of its settings."""
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    servos.modify_servo(6, lambda servo: (servo.backup(), servo.table.__setitem__("startup", startup), servo.restart()))
    status = _drive(armed, until=lambda status: status.latched is not None)
    assert not status.armed
    _seen(armed, lambda status: status.restarts > 0)
    armed.acknowledge()
    _seen(armed, lambda status: all(fault.cause is not Cause.SERVO_SILENT for fault in status.active))
    with pytest.raises(NotReady, match="not zeroed: delivery_1"):
        armed.arm()
    armed.zero(ZeroRequest(kept=("delivery_1",)))
    if startup & 1:  # it has switched its torque on by itself
        with pytest.raises(NotReady, match=r"delivery_1 .* holds with another startup configuration"):
            armed.arm()
        armed.torque_off()
    armed.arm()


def test_fault_26_the_port_vanishes_and_comes_back(servos: SoftServoBus, armed: ServoRobot) -> None:
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    servos.vanish()
    status = _drive(armed, until=lambda status: status.phase is BusPhase.CLOSED)
    assert _latched(Cause.PORT_LOST)(status)
    report = armed.report()
    assert not report.port_open
    with pytest.raises(NotReady, match="port is not open"):
        armed.arm()
    servos.reappear()
    _drive(armed, until=lambda status: status.phase is BusPhase.STOPPED)
    with pytest.raises(NotReady, match="acknowledge first"):
        armed.arm()
    armed.acknowledge()
    with pytest.raises(NotReady, match="not zeroed"):
        armed.arm()
    status = _seen(armed, lambda status: len(status.offers) == 7)
    armed.zero(ZeroRequest(kept=tuple(offer.name for offer in status.offers)))
    armed.arm()
    at_mm = servos.positions_mm()[4]
    _drive(armed, until=lambda status: servos.positions_mm()[4] > at_mm + 1.0)


# --- the bus process dies --------------------------------------------------------------------------------------------------------


def test_a_killed_bus_process_is_seen_and_said(servos: SoftServoBus, armed: ServoRobot) -> None:
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    assert armed.failure is None
    _signal(armed, signal.SIGKILL)
    _wait_for(lambda: armed.failure is not None)
    assert armed.failure == (
        "the servo bus process ended (killed by SIGKILL): the servos stopped by themselves; connect the robot again"
    )
    for action in (lambda: armed.send(FORWARD), armed.status, armed.arm, armed.acknowledge):
        with pytest.raises(BusProcessLost, match="killed by SIGKILL"):
            action()
    armed.stop()
    armed.hold()
    armed.connect()
    assert armed.failure is None
    armed.torque_off()
    armed.zero()
    armed.arm()


def test_a_bus_process_that_hangs_reports_nothing_new(servos: SoftServoBus, armed: ServoRobot) -> None:
    _seen(armed, lambda status: len(status.servos) == 7)
    assert armed.report() is not None
    _signal(armed, signal.SIGSTOP)
    time.sleep(0.05)
    armed.report()
    time.sleep(0.1)
    assert armed.report() is None
    assert armed.failure is None
    _signal(armed, signal.SIGCONT)


def test_it_dies_while_somebody_waits_for_an_answer(servos: SoftServoBus, robot: ServoRobot) -> None:
    _signal(robot, signal.SIGSTOP)
    killer = threading.Timer(0.1, _signal, (robot, signal.SIGKILL))
    killer.start()
    with pytest.raises(BusProcessLost, match="killed by SIGKILL"):
        robot.zero()
    killer.join()


def test_a_bus_process_that_hangs_is_ended_by_close(servos: SoftServoBus, robot: ServoRobot) -> None:
    pid = robot._client.pid
    _signal(robot, signal.SIGSTOP)
    robot.close()
    assert not psutil.pid_exists(pid)


def test_asked_to_end_it_holds_and_ends_with_zero(servos: SoftServoBus, armed: ServoRobot) -> None:
    _drive(armed, until=lambda status: servos.positions_mm()[4] > 1.0)
    _signal(armed, signal.SIGTERM)
    assert armed._client._process.wait(PATIENCE_S)
    assert armed._client._process.exit_code() == 0
    _settle_mm(servos)


# --- the application dies --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("victim", "number"), KINDS, ids=lambda value: getattr(value, "name", value))
def test_fault_32_killed_or_stopped_every_servo_stops_in_time_and_within_one_step(
    start_servos: Callable[..., SoftServoBus], victim: str, number: signal.Signals
) -> None:
    outcome = strike(start_servos(ServosConfig(), wire_time=True), victim, number, delay_s=0.5)
    assert outcome.before_mm > 0.1
    assert outcome.stop_ms <= 1000.0 * BOUND_S
    assert outcome.steps <= BOUND_STEPS
    if number is signal.SIGKILL:
        assert outcome.bus_gone is (victim == "bus process"), "it goes on, and watches the servos that hold"


def test_an_application_that_forgets_to_close_leaves_nothing_behind(servos: SoftServoBus) -> None:
    """Its interpreter just ends; a forked child of it keeps all its ends open, and even so the bus process ends."""
    program = (
        "import os, sys, time\nfrom core.config.safety import SafetyConfig\nfrom core.config.safety import ServosConfig\n"
        "from hardware.servos.servo_robot import ServoRobot\n"
        "robot = ServoRobot(ServosConfig(port=sys.argv[1], unattended_s=0.0), SafetyConfig())\n"
        "robot.connect()\nrobot.zero()\nrobot.arm()\n"
        "child = os.fork()\nif child == 0:\n    time.sleep(30)\n    os._exit(0)\n"
        "print(robot._client.pid, child, flush=True)\nos._exit(0)\n"
    )
    run = subprocess.Popen([sys.executable, "-c", program, servos.port], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    bus_pid, child = map(int, run.stdout.readline().split())
    try:
        end_s = time.monotonic() + PATIENCE_S
        while _lives(bus_pid) and time.monotonic() < end_s:
            time.sleep(0.02)
        assert not _lives(bus_pid)
    finally:
        os.kill(child, signal.SIGKILL)
        run.wait()
        run.stdout.close()


def _lives(pid: int) -> bool:
    with contextlib.suppress(psutil.NoSuchProcess):
        return bool(psutil.Process(pid).status() != psutil.STATUS_ZOMBIE)
    return False


# --- servos that hold when the application is gone or silent ---------------------------------------------------------------------


WATCHED: dict[str, Any] = {"watchdog_s": 0.3, "heartbeat_timeout_s": 0.3}
BENDS = """
import sys, time
from core.config.safety import SafetyConfig, ServosConfig
from core.types import Command
from hardware.servos.servo_robot import ServoRobot

servos = ServosConfig(port=sys.argv[1], unattended_s=float(sys.argv[2]), watchdog_s=0.3, heartbeat_timeout_s=0.3)
robot = ServoRobot(servos, SafetyConfig())
robot.connect()
robot.zero()
robot.arm()
until_s = time.monotonic() + 20.0
while time.monotonic() < until_s and (robot.bus_status().servos[0].position_mm or 0.0) < 1.8:
    robot.send(Command(bend=0.8))
    time.sleep(0.02)
print(robot._client.pid, flush=True)
time.sleep(60.0)
"""


@contextlib.contextmanager
def _bent(servos: SoftServoBus, unattended_s: float) -> Iterator[tuple[int, int]]:
    """An application that holds the robot bent: its process id, and that of its bus process, which is gone afterwards."""
    run = subprocess.Popen(
        [sys.executable, "-c", BENDS, servos.port, str(unattended_s)], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    bus_pid = int(run.stdout.readline())
    try:
        yield run.pid, bus_pid
    finally:
        run.kill()
        run.wait()
        run.stdout.close()
        with contextlib.suppress(ProcessLookupError):
            os.kill(bus_pid, signal.SIGKILL)


def _fall_mm(servos: SoftServoBus, until: Callable[[], bool]) -> tuple[float, float]:
    """The longest way of the right tendon (mm), and the longest pause (s), between two looks until something is so."""
    fall_mm = pause_s = 0.0
    at_mm, at_s, end_s = servos.positions_mm()[0], time.monotonic(), time.monotonic() + PATIENCE_S
    while not until() and time.monotonic() < end_s:
        time.sleep(0.005)
        now_mm, now_s = servos.positions_mm()[0], time.monotonic()
        fall_mm, pause_s = max(fall_mm, at_mm - now_mm), max(pause_s, now_s - at_s)
        at_mm, at_s = now_mm, now_s
    assert until()
    return fall_mm, pause_s


def test_servos_of_a_dead_application_hold_are_watched_and_then_relaxed_and_switched_off(servos: SoftServoBus) -> None:
    """All seven pulled on for ever, and not a packet was sent any more."""
    with _bent(servos, 4.0) as (pid, bus_pid):
        os.kill(pid, signal.SIGKILL)
        at_mm = servos.positions_mm()[0]
        time.sleep(2.5)
        assert _torques(servos) == [1] * 7
        assert servos.positions_mm()[0] == pytest.approx(at_mm, abs=0.05)
        assert [servos.servo(joint.id).table["watchdog"] for joint in CONFIG.joints] == [-1] * 7
        assert _lives(bus_pid)
        heard = len(servos.log)
        _wait_for(lambda: len(servos.log) > heard)  # it looks at them
        fall_mm, pause_s = _fall_mm(servos, lambda: _torques(servos) == [0] * 7)
        assert fall_mm <= 1.5 * pause_s + 0.3, "no snap"
        assert servos.positions_mm()[0] == pytest.approx(0.0, abs=0.06)
        _wait_for(lambda: not _lives(bus_pid))
        assert not _lives(bus_pid)


def test_a_closed_robot_that_holds_is_watched_and_the_next_one_takes_over(servos: SoftServoBus) -> None:
    robot = _robot(servos, unattended_s=600.0, **WATCHED)
    robot.connect()
    robot.zero()
    robot.arm()
    _bend(robot)
    watcher = robot._client.pid
    robot.close()
    at_mm = servos.positions_mm()[0]
    assert _lives(watcher)
    servos.log.clear()
    following = _robot(servos, unattended_s=600.0, **WATCHED)
    following.connect()
    try:
        assert not _lives(watcher)
        assert _torques(servos) == [1] * 7
        assert servos.positions_mm()[0] == pytest.approx(at_mm, abs=0.05)
        assert not any(packet.parameters[:3] == b"\x40\x00\x00" for packet in servos.log), "no torque went off meanwhile"
    finally:
        following.torque_off()
        following.close()
    assert psutil.Process().children() == [], "with the torque off there is nothing to watch"


@contextlib.contextmanager
def _watched(servos: SoftServoBus) -> Iterator[int]:
    """A bus process that watches servos of which one pulls, after its application has closed; its id."""
    robot = _robot(servos, unattended_s=600.0, **WATCHED)
    robot.connect()
    robot.zero()
    robot.arm()
    _bend(robot)
    watcher = robot._client.pid
    robot.close()
    assert watcher is not None
    assert _lives(watcher)
    yield watcher


def test_a_search_for_servos_has_a_watched_port_after_the_wires_are_relaxed(servos: SoftServoBus) -> None:
    """A search does not watch: servos that hold would be left pulling."""
    with _watched(servos) as watcher:
        assert len(find_servos(servos.port).servos) == 7
        assert not _lives(watcher)
        assert _torques(servos) == [0] * 7
        assert servos.positions_mm()[0] == pytest.approx(0.0, abs=0.06)
    following = _robot(servos)
    following.connect()
    following.close()


def test_a_program_that_cannot_open_a_watched_port_switches_the_torque_off(servos: SoftServoBus) -> None:
    with _watched(servos) as watcher:
        servos.faults.mute(3)
        with pytest.raises(NoAnswer, match="id 3"):
            _robot(servos, unattended_s=600.0, **WATCHED).connect()
        assert not _lives(watcher)
        _wait_for(lambda: _torques(servos) == [0] * 7)
        assert _torques(servos) == [0] * 7
    servos.faults.clear()


def test_a_signal_relaxes_what_is_watched(servos: SoftServoBus) -> None:
    with _watched(servos) as watcher:
        os.kill(watcher, signal.SIGTERM)
        _wait_for(lambda: not _lives(watcher))
        assert _torques(servos) == [0] * 7
        assert servos.positions_mm()[0] == pytest.approx(0.0, abs=0.06)


def test_wires_are_relaxed_slowly_and_let_go_on_request(servos: SoftServoBus, armed: ServoRobot) -> None:
    _bend(armed)
    begun_s, from_mm = time.monotonic(), servos.positions_mm()[0]
    armed.relax()
    assert time.monotonic() - begun_s > 0.9 * from_mm, "1 mm/s"
    assert _torques(servos) == [0] * 7
    assert servos.positions_mm()[0] == pytest.approx(0.0, abs=0.06)


def test_stop_while_wires_are_relaxed_is_told(servos: SoftServoBus, armed: ServoRobot) -> None:
    _bend(armed)
    stopper = threading.Timer(0.5, armed.stop)
    stopper.start()
    with pytest.raises(NotReady, match="stopped meanwhile"):
        armed.relax()
    stopper.join()
    assert servos.positions_mm()[0] > 0.5
    assert _torques(servos) == [1] * 7


# --- the link by itself, and the rig ---------------------------------------------------------------------------------------------


def test_a_link_whose_process_fails_at_once_says_why() -> None:
    link = BusClient(ServosConfig(), SAFETY)
    try:
        with pytest.raises(BusProcessLost, match="no servo port is configured"):
            link.request("open", PATIENCE_S)
    finally:
        link.close()
    with pytest.raises(BusProcessLost, match="not connected"):
        link.request("open", PATIENCE_S)


@pytest.mark.parametrize("dies", [False, True])
def test_a_process_that_was_started_ahead_waits_for_its_servos_and_is_replaced_when_it_dies(dies: bool) -> None:
    process = start_bus()
    if dies:
        os.kill(process.pid, signal.SIGKILL)
        assert process.wait(PATIENCE_S)
    else:
        time.sleep(2.5 * PARENT_CHECK_S)
    client = BusClient(ServosConfig(), SAFETY, process)
    try:
        assert (client.pid == process.pid) is not dies
        with pytest.raises(BusProcessLost, match="no servo port is configured"):
            client.request("open", PATIENCE_S)
    finally:
        client.close()
        process.discard()  # which is the client's, by then


def test_a_robot_that_is_never_connected_ends_the_process_that_loads_for_it() -> None:
    process = start_bus()
    ServoRobot(ServosConfig(), SAFETY, process=process).close()
    assert process.exit_code() is not None


LETS_GO = """
import os, signal, sys
from core.config.safety import SafetyConfig
from core.config.safety import ServosConfig
from hardware.servos.bus_ipc import BusClient

link = BusClient(ServosConfig(port=sys.argv[1]), SafetyConfig())
link._process.send({"id": 1, "do": "torque off"})
print(link.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_torque_off_is_done_though_the_application_dies_while_its_bus_process_loads(servos: SoftServoBus) -> None:
    for joint in CONFIG.joints:
        servos.servo(joint.id).table["torque"] = 1
    done = subprocess.run([sys.executable, "-c", LETS_GO, servos.port], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    until_s = time.monotonic() + PATIENCE_S
    while _lives(int(done.stdout)) and time.monotonic() < until_s:
        time.sleep(0.02)
    assert _torques(servos) == [0] * 7
