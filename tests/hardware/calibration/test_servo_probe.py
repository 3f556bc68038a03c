"""One servo moved by itself through the real driver and bus process, on strict software servos."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from core.config.safety import SafetyConfig, ServosConfig
from hardware.calibration.servo_probe import (
    ProbeFailed,
    ProbeLimits,
    ProcedureStopped,
    ServoProbe,
    StopSwitch,
    Strained,
    probe_config,
)
from hardware.servos.discovery import find_ports, find_servos
from hardware.servos.dynamixel_port import NoAnswer, NotReady, PortError, ServoError
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.servos.protocol import Instruction, InstructionPacket

pytestmark = [pytest.mark.real_time, pytest.mark.usefixtures("no_process_stays_behind")]

CONFIG, SAFETY = ServosConfig(unattended_s=0.0), SafetyConfig()  # no process stays behind to watch the servos
LIMITS = ProbeLimits(-2.0, 2.0)


@pytest.fixture
def servos(start_servos: Callable[..., SoftServoBus]) -> SoftServoBus:
    return start_servos(CONFIG, wire_time=True)


def _config(servos: SoftServoBus, servo_id: int = 3, limits: ProbeLimits = LIMITS, sign: int = 1) -> ServosConfig:
    return probe_config(CONFIG.model_copy(update={"port": servos.port}), servo_id, limits, -1 if sign < 0 else 1)


def test_one_servo_goes_there_and_back_and_the_others_stand(servos: SoftServoBus) -> None:
    with ServoProbe.opened(_config(servos, sign=-1), SAFETY, LIMITS, StopSwitch()) as probe:
        probe.move_to(1.0)
        assert probe.position_mm == pytest.approx(1.0, abs=0.05)
        probe.pause(0.2)
        there = servos.positions_mm()
        probe.move_to(9.0)  # beyond the limits: to their end
        assert probe.position_mm == pytest.approx(2.0, abs=0.05)
        probe.move_to(0.0)
    assert there[2] == pytest.approx(-1.0, abs=0.05)  # the servo's own negative direction
    assert [there[place] for place in (0, 1, 3, 4, 5, 6)] == pytest.approx([0.0] * 6, abs=0.02)
    assert servos.positions_mm() == pytest.approx([0.0] * 7, abs=0.05)


def test_stop_from_another_thread_holds_at_once(servos: SoftServoBus) -> None:
    stop, stopped = StopSwitch(), threading.Event()
    slow = ProbeLimits(-2.0, 2.0, speed_mm_s=1.0)

    def press() -> None:
        time.sleep(0.5)
        stop.press()
        stopped.set()

    with pytest.raises(ProcedureStopped), ServoProbe.opened(_config(servos, limits=slow), SAFETY, slow, stop) as probe:
        thread = threading.Thread(target=press)
        thread.start()
        try:
            probe.move_to(2.0)
        finally:
            thread.join()
    assert stopped.is_set()
    at_mm = servos.positions_mm()[2]
    assert 0.0 < at_mm < 1.6
    time.sleep(0.3)
    assert servos.positions_mm()[2] == pytest.approx(at_mm, abs=0.05)  # the horn was still braking when it was first read
    with pytest.raises(ProcedureStopped), ServoProbe.opened(_config(servos), SAFETY, LIMITS, stop):
        raise AssertionError("nothing is opened before the operator goes on")


def test_current_stops_it_and_lets_the_wire_go(servos: SoftServoBus) -> None:
    with (
        pytest.raises(Strained, match=r"servo 3 drew \d+ mA"),
        ServoProbe.opened(_config(servos), SAFETY, LIMITS, StopSwitch()) as probe,
    ):
        servos.modify_servo(3, lambda servo: setattr(servo.motor, "load_mnm", 800.0))  # 450 mA, where its 20 N are 70
        probe.move_to(2.0)
    assert servos.positions_mm()[2] < 1.0
    assert servos.servo(3).table["torque"] == 0


def test_a_jam_ends_it_and_is_not_tried_again(servos: SoftServoBus) -> None:
    with (
        pytest.raises((ProbeFailed, Strained), match=r"does not follow|all that its force limit allows"),
        ServoProbe.opened(_config(servos), SAFETY, LIMITS, StopSwitch()) as probe,
    ):
        servos.modify_servo(3, lambda servo: servo.freeze(True))
        probe.move_to(2.0)


def test_a_servo_with_an_error_is_not_moved(servos: SoftServoBus) -> None:
    servos.modify_servo(5, lambda servo: servo.alert(32))
    told = pytest.raises(NotReady, match=r"hardware error \(servo 5 0x20\)")
    with told, ServoProbe.opened(_config(servos), SAFETY, LIMITS, StopSwitch()):
        raise AssertionError("not armed")


def test_a_missing_servo_is_named(servos: SoftServoBus) -> None:
    servos.faults.mute(6)
    with pytest.raises(NoAnswer, match=r"servo 6: no answer"), ServoProbe.opened(_config(servos), SAFETY, LIMITS, StopSwitch()):
        raise AssertionError("not armed")


def test_a_line_that_is_silent_for_a_moment_ends_the_motion_and_nothing_is_armed_again(servos: SoftServoBus) -> None:
    with (
        pytest.raises(ProbeFailed, match=r"servo 3 was stopped .*: find the cause, then try again"),
        ServoProbe.opened(_config(servos), SAFETY, LIMITS, StopSwitch()) as probe,
    ):
        probe.move_to(1.0)
        armed = len(_torque_writes(servos))
        assert armed == 7
        servos.faults.mute(4)
        threading.Timer(0.4, lambda: servos.faults.mute(4, False)).start()
        probe.move_to(-1.0)
    assert servos.positions_mm()[2] > -0.9
    assert len(_torque_writes(servos)) == armed


def _torque_writes(servos: SoftServoBus) -> list[InstructionPacket]:
    """The packets that switch a servo's torque (register 64) on."""
    return [p for p in servos.log if p.instruction == Instruction.WRITE and p.parameters[:3] == b"\x40\x00\x01"]


# ---- who is there


def test_servos_are_found_by_asking_and_nothing_is_written(servos: SoftServoBus) -> None:
    found = find_servos(servos.port)
    assert found.baud == CONFIG.baud
    assert found.ids == (1, 2, 3, 4, 5, 6, 7)
    assert {servo.model for servo in found.servos} == {CONFIG.model}
    assert {packet.instruction for packet in servos.log} == {1}  # pings


def test_servos_at_another_speed_are_found(start_servos: Callable[..., SoftServoBus]) -> None:
    servos = start_servos(CONFIG.model_copy(update={"baud": 57_600}), wire_time=True)
    said: list[str] = []
    assert find_servos(servos.port, (1_000_000, 57_600), said.append).baud == 57_600
    assert said == ["asking at 1000000 baud", "asking at 57600 baud"]


def test_servos_at_several_speeds_are_all_named(servos: SoftServoBus) -> None:
    for servo_id in (3, 6):
        servos._servos[servo_id].table["baud_rate"] = 1  # 57600, as from the factory
    found = find_servos(servos.port, (57_600, 1_000_000, 115_200))
    assert (found.baud, found.ids) == (1_000_000, (1, 2, 4, 5, 7))
    assert found.elsewhere == ((57_600, (3, 6)),)


def test_nobody_answers(servos: SoftServoBus) -> None:
    for joint in CONFIG.joints:
        servos.faults.mute(joint.id)
    with pytest.raises(NoAnswer, match=r"no servo answers .*asked at 1000000 baud.*supply on"):
        find_servos(servos.port, (1_000_000,))


def test_no_port(tmp_path: Path) -> None:
    with pytest.raises(PortError):
        find_servos(str(tmp_path / "ttyUSB0"))
    assert find_ports() is not None


def test_stop_ends_the_search(servos: SoftServoBus) -> None:
    stop = StopSwitch()
    stop.press()
    with pytest.raises(ServoError, match="stopped"):
        find_servos(servos.port, check_stop=stop.check)
