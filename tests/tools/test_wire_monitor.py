"""The wire monitor: which packets are unsafe, and that a healthy motion has no unsafe one."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from core.config.safety import SafetyConfig, ServosConfig
from core.types import Command
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.servos.device import SoftServo
from hardware.twin.servos.protocol import CURRENT_POSITION, Instruction, InstructionPacket
from tools.wire_monitor import MonitoredBus, WireMonitor

SERVOS = ServosConfig()
ADVANCE = 5
PER_MM = 4096 / 40.0


def goal(ticks: int, servo_id: int = ADVANCE) -> InstructionPacket:
    data = (116).to_bytes(2, "little") + (4).to_bytes(2, "little") + bytes([servo_id]) + ticks.to_bytes(4, "little", signed=True)
    return InstructionPacket(0xFE, Instruction.SYNC_WRITE, data)


def servo_at(ticks: int) -> SoftServo:
    servo = SoftServo(ADVANCE, SERVOS.model, ticks)
    servo.table["operating_mode"] = CURRENT_POSITION
    servo.table["goal_current"] = 39  # 30 N at 40 mm a turn
    servo.table["torque"] = 1
    return servo


@pytest.fixture
def servo() -> SoftServo:
    return servo_at(1000)


@pytest.fixture
def watch(servo: SoftServo) -> WireMonitor:
    watch = WireMonitor(SERVOS)
    watch.set_zero([servo])
    return watch


def mm(distance: float) -> int:
    """The register that means so many mm from where the servo stands."""
    return 1000 + round(distance * PER_MM)


@pytest.mark.parametrize(
    ("distance", "words"),
    [(0.0, None), (0.9, None), (-0.9, None), (4.9, None), (5.3, "from the horn"), (-5.5, "from the horn")],
)
def test_a_goal_is_near_the_horn(watch: WireMonitor, servo: SoftServo, distance: float, words: str | None) -> None:
    """A feed's step is 1 mm; at 20 mm/s it moves 4 mm while a reading and an order grow old."""
    watch.check_packet(goal(mm(distance)), {ADVANCE: servo}, 10.0)
    assert watch.report.unsafe == (0 if words is None else len(watch.report.texts))
    assert (words is None) == (watch.report.unsafe == 0)
    assert words is None or words in watch.report.texts[0]


def test_a_goal_is_inside_the_envelope_unless_the_joint_itself_is_not(watch: WireMonitor) -> None:
    """It ends at -5 mm; the joint's zero is at 1000."""
    near = {ADVANCE: servo_at(mm(-4.8))}
    watch.check_packet(goal(mm(-5.0)), near, 10.0)
    assert watch.report.unsafe == 0
    watch.check_packet(goal(mm(-5.2)), near, 10.02)
    assert watch.report.texts == ["advance: goal -5.20 mm (-5 to 400 mm)"]
    watch.check_packet(goal(mm(-6.0)), {ADVANCE: servo_at(mm(-6.0))}, 10.04)  # held where it is
    assert watch.report.unsafe == 1


def test_a_servo_that_may_pull_harder_than_its_joint_is_unsafe(watch: WireMonitor, servo: SoftServo) -> None:
    servo.table["goal_current"] = 1193
    watch.check_packet(goal(mm(0.1)), {ADVANCE: servo}, 10.0)
    assert watch.report.texts == ["advance: a goal that may pull with 898.6 N (at most 30 N)"]
    servo.table["operating_mode"], servo.table["goal_current"] = 4, 39
    watch.check_packet(goal(mm(0.1)), {ADVANCE: servo}, 10.02)
    assert watch.report.texts[1:] == ["advance: a goal in mode 4"]


def test_a_leap_between_goals_is_unsafe(watch: WireMonitor, servo: SoftServo) -> None:
    watch.check_packet(goal(mm(-4.5)), {ADVANCE: servo}, 10.0)
    watch.check_packet(goal(mm(4.5)), {ADVANCE: servo}, 10.02)
    assert "leaps by 9.00 mm" in watch.report.texts[0]


def test_after_stop_nothing_moves_until_it_is_acknowledged(watch: WireMonitor, servo: SoftServo) -> None:
    watch.set_stop(10.0)
    watch.check_packet(goal(mm(0.9)), {ADVANCE: servo}, 10.3)  # on its way already
    watch.check_packet(goal(mm(0.1)), {ADVANCE: servo}, 11.0)
    assert watch.report.unsafe == 0
    watch.check_packet(goal(mm(0.9)), {ADVANCE: servo}, 11.0)
    assert "after STOP" in watch.report.texts[0]
    watch.set_stop(None)
    watch.check_packet(goal(mm(0.9)), {ADVANCE: servo}, 11.02)
    assert watch.report.unsafe == 1


def test_torque_comes_on_only_where_the_goal_is(watch: WireMonitor, servo: SoftServo) -> None:
    servo.table["torque"] = 0
    servo.table["goal_position"] = mm(2.0)
    on = InstructionPacket(ADVANCE, Instruction.WRITE, (64).to_bytes(2, "little") + b"\1")
    watch.check_packet(on, {ADVANCE: servo}, 10.0)
    assert "torque on with its goal 2.00 mm away" in watch.report.texts[0]
    servo.table["goal_position"] = mm(0.0)
    watch.check_packet(on, {ADVANCE: servo}, 10.0)
    assert watch.report.unsafe == 1


@pytest.fixture
def bus() -> Iterator[MonitoredBus]:
    bus = MonitoredBus(SERVOS, WireMonitor(SERVOS))
    bus.start()
    yield bus
    bus.stop()


@pytest.mark.real_time
def test_a_real_motion_is_monitored_and_safe(bus: MonitoredBus) -> None:
    patient = {"watchdog_s": 2.5, "heartbeat_timeout_s": 3.0, "unattended_s": 0.0}
    robot = ServoRobot(SERVOS.model_copy(update={"port": bus.port, **patient}), SafetyConfig())
    robot.connect()
    try:
        robot.zero()
        bus.set_zero()
        robot.arm()
        until_s = time.monotonic() + 20.0
        while bus.positions_mm()[4] < 2.0 and time.monotonic() < until_s:
            robot.send(Command(bend=0.5, advance_mm_s=10.0))
            time.sleep(0.02)
    finally:
        robot.close()
    assert bus.positions_mm()[4] >= 2.0
    seen = bus._monitor.report
    assert seen.goals > 7
    assert seen.texts == []
