"""Zeros that neither creep nor mislead, with the real driver, the bus process and software servos: restart, power cut, overload."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from core.config.calibration import ZeroConfig
from core.config.safety import JointName, SafetyConfig, ServosConfig
from core.control.gate import Source
from core.control.joints import Retracted
from core.control.kept_zero import KeptZeros, ZeroBasis, ZeroOffer, ZeroRequest, all_at_zero, keep
from core.types import Command
from hardware.servos.bus_ipc import BusStatus
from hardware.servos.dynamixel_port import NotReady
from hardware.servos.registers import HardwareError, ServoState
from hardware.servos.servo_robot import ServoRobot
from hardware.servos.zero_keeper import ZeroKeeper
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.servos.device import OVERLOAD_BIT

pytestmark = [pytest.mark.real_time, pytest.mark.usefixtures("no_process_stays_behind")]

ROOT = Path(__file__).resolve().parents[3]
CONFIG, SAFETY = ServosConfig(watchdog_s=2.5, heartbeat_timeout_s=3.0, unattended_s=0.0), SafetyConfig()
TENDONS: tuple[JointName, ...] = ("right", "left", "up", "down")
PATIENCE_S = 10.0
REST = Command()
ALL_AT_ZERO = all_at_zero(CONFIG)


@pytest.fixture
def servos(start_servos: Callable[..., SoftServoBus]) -> SoftServoBus:
    return start_servos(CONFIG, wire_time=True, positions=[1000 + joint.id for joint in CONFIG.joints])


Connect = Callable[[], ServoRobot]


@pytest.fixture
def connect(servos: SoftServoBus, tmp_path: Path) -> Iterator[Connect]:
    """A program that is started: the last robot is closed first, its torque stays on."""
    made: list[ServoRobot] = []

    def start() -> ServoRobot:
        for robot in made:
            robot.close()
        config = CONFIG.model_copy(update={"port": servos.port})
        made.append(ServoRobot(config, SAFETY, keep=tmp_path / "zeros" / "bench.json"))
        made[-1].connect()
        return made[-1]

    yield start
    for robot in made:
        robot.close()


def drive(robot: ServoRobot, command: Command, seconds: float, *, retracts: Retracted = Retracted.NONE) -> BusStatus:
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        robot.beat(Source.OPERATOR)
        robot.send(command, retracts=retracts)
        time.sleep(0.02)
    status = robot.bus_status()
    assert status is not None
    return status


def seen(robot: ServoRobot, wanted: Callable[[BusStatus], bool]) -> BusStatus:
    """Wait for a status."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        robot.beat(Source.OPERATOR)
        status = robot.bus_status()
        if status is not None and wanted(status):
            return status
        time.sleep(0.01)
    raise AssertionError(f"not seen: {robot.bus_status()}")


def settled(robot: ServoRobot, servos: SoftServoBus, command: Command = REST) -> tuple[float, ...]:
    """Pulls of the tendons when they stand: the wires come to their pretension slowly."""
    before, end_s = (math.inf,) * 4, time.monotonic() + PATIENCE_S
    while max(abs(was - at) for was, at in zip(before, servos.positions_mm(), strict=False)) > 0.01 and time.monotonic() < end_s:
        before = servos.positions_mm()[:4]
        drive(robot, command, 0.4)
    return servos.positions_mm()[:4]


def offers(robot: ServoRobot) -> dict[str, ZeroOffer]:
    status = seen(robot, lambda status: len(status.servos) == 7 and all(isinstance(one, ServoState) for one in status.servos))
    return {offer.name: offer for offer in status.offers}


def use_kept(robot: ServoRobot) -> None:
    """As the operator does who confirms all that is offered."""
    robot.zero(ZeroRequest(kept=tuple(offer.name for offer in offers(robot).values())))


# --- tendons: finding 3 ----------------------------------------------------------------------------------------------------------


def test_restarts_add_no_pull(servos: SoftServoBus, connect: Connect) -> None:
    """The probe's operator, who restarts the program each day with the servos left on, and zeroes and switches them on."""
    robot = connect()
    assert offers(robot) == {}
    robot.zero()
    robot.arm()
    for _ in range(2):
        assert settled(robot, servos) == pytest.approx([0.3] * 4, abs=0.02)
        robot = connect()
        with pytest.raises(NotReady, match="not zeroed: right, left, up, down"):
            robot.arm()
        with pytest.raises(NotReady, match=r"right stands \+0\.30 mm from its kept zero: use that"):
            robot.zero()
        assert not any(robot.bus_status().zeroed), "all or none"
        use_kept(robot)
        robot.arm()
    assert settled(robot, servos) == pytest.approx([0.3] * 4, abs=0.02)


def test_what_ended_bent_cannot_be_zeroed_bent(servos: SoftServoBus, connect: Connect, tmp_path: Path) -> None:
    robot = connect()
    robot.zero()
    robot.arm()
    assert settled(robot, servos, Command(bend=1.0))[0] == pytest.approx(2.3, abs=0.03)
    robot = connect()
    with pytest.raises(NotReady, match=r"right stands \+2\.30 mm from its kept zero"):
        robot.zero()
    robot.torque_off()  # these motors do not give way
    with pytest.raises(NotReady, match=r"right stands \+2\.30 mm from its kept zero"):
        robot.zero()
    use_kept(robot)
    robot.arm()
    assert settled(robot, servos, Command(bend=1.0))[:2] == pytest.approx([2.3, -1.7], abs=0.05)
    # nothing is kept any more, and the servos hold
    robot.close()
    (tmp_path / "zeros" / "bench.json").unlink()
    robot = connect()
    assert offers(robot) == {}
    with pytest.raises(NotReady, match=r"servo right \(id 1\) holds its wire: .* switch the torque off and see that it is slack"):
        robot.zero()
    with pytest.raises(NotReady, match="of a rig are confirmed or measured"):
        robot.zero(ALL_AT_ZERO.model_copy(update={"basis": ZeroBasis.HERE}))


def test_without_power_for_a_moment_all_is_offered_again(servos: SoftServoBus, connect: Connect) -> None:
    """Feeds beyond a turn: 46 mm are one turn and 6 mm."""
    robot = connect()
    robot.zero(ZeroRequest(positions_mm={**ALL_AT_ZERO.positions_mm, "advance": 40.0, "delivery_1": 38.0, "delivery_2": 38.0}))
    robot.arm()
    drive(robot, Command(bend=0.5, advance_mm_s=10.0), 0.8)
    robot.disarm()
    time.sleep(0.1)
    status = seen(robot, lambda status: len(status.servos) == 7)
    before = [reading.position_mm for reading in status.servos if isinstance(reading, ServoState)]
    for joint in CONFIG.joints:
        servos.modify_servo(joint.id, lambda servo: servo.restart())
    seen(robot, lambda status: status.restarts >= 7)
    found = offers(robot)
    assert [found[joint.name].position_mm for joint in CONFIG.joints] == pytest.approx(before, abs=0.03)
    use_kept(robot)
    robot.acknowledge()
    robot.arm()
    assert settled(robot, servos, Command(bend=0.5)) == pytest.approx([1.3, -0.7, 0.3, 0.3], abs=0.05)
    assert robot.bus_status().servos[4].position_mm == pytest.approx(before[4], abs=0.05)


def test_a_wire_that_was_hung_in_again_is_zeroed_when_its_kept_zero_is_forgotten(servos: SoftServoBus, connect: Connect) -> None:
    robot = connect()
    robot.zero()
    robot.arm()
    drive(robot, Command(), 0.4)
    robot = connect()
    assert set(offers(robot)) == {joint.name for joint in CONFIG.joints}
    again = ZeroRequest(positions_mm={"up": 0.0}, forgotten=("up",))
    with pytest.raises(NotReady, match="holds its wire"):
        robot.zero(again)
    assert "up" in offers(robot), "a refused request forgets nothing"
    robot.torque_off()
    servos.modify_servo(3, lambda servo: servo.turn(-205))
    at_mm = servos.positions_mm()[2]
    robot.zero(again)
    use_kept(robot)
    robot.arm()
    assert settled(robot, servos) == pytest.approx([0.3, 0.3, at_mm + 0.3, 0.3], abs=0.05)


@pytest.mark.parametrize(
    ("basis", "said"), [(ZeroBasis.SLACK, "holds its wire"), (ZeroBasis.SEARCHED, r"left.* pulls with \d+ mA")]
)
def test_a_tendon_that_pulls_is_not_at_its_zero(servos: SoftServoBus, basis: ZeroBasis, said: str) -> None:
    """A search leaves its wires held without tension, which the current tells."""
    robot = ServoRobot(CONFIG.model_copy(update={"port": servos.port}), SAFETY)
    robot.connect()
    try:
        robot.zero()
        robot.arm()
        robot.disarm()
        robot.zero(ALL_AT_ZERO.model_copy(update={"basis": ZeroBasis.SEARCHED}))
        servos.modify_servo(2, lambda servo: servo.grind(150.0))
        robot.close()
        robot.connect()
        with pytest.raises(NotReady, match=said):
            robot.zero(ALL_AT_ZERO.model_copy(update={"basis": basis}))
    finally:
        robot.close()


# --- feeds: finding 2 ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def stuck(servos: SoftServoBus, connect: Connect) -> ServoRobot:
    """The probe's accident: 40.1 mm in, the feed shuts down by overload, and is rebooted."""
    robot = connect()
    robot.zero(ZeroRequest(positions_mm={**ALL_AT_ZERO.positions_mm, "advance": 35.0}))  # the software servo's own zero
    robot.arm()
    while drive(robot, Command(advance_mm_s=20.0), 0.02).servos[4].position_mm < 40.1:
        pass
    servos.modify_servo(5, lambda servo: servo.alert(OVERLOAD_BIT))
    seen(robot, lambda status: status.latched is not None)
    robot.acknowledge()
    robot.reboot(5)
    seen(robot, lambda status: not status.zeroed[4] and len(status.servos) == 7)
    robot.acknowledge()
    with pytest.raises(NotReady, match="not zeroed: advance "):
        robot.arm()
    return robot


def inserted_mm(servos: SoftServoBus) -> float:
    return servos.positions_mm()[4] + 35.0


def pull_out(robot: ServoRobot, servos: SoftServoBus) -> None:
    """Retract until it stands."""
    robot.arm()
    before_mm, end_s = math.inf, time.monotonic() + 3 * PATIENCE_S
    while before_mm - servos.positions_mm()[4] > 0.02 and time.monotonic() < end_s:
        before_mm = servos.positions_mm()[4]
        drive(robot, Command(advance_mm_s=-20.0), 0.5)


def test_after_an_overload_the_kept_insertion_is_offered_and_the_robot_comes_out(servos: SoftServoBus, stuck: ServoRobot) -> None:
    offer = offers(stuck)["advance"]
    assert offer.position_mm == pytest.approx(inserted_mm(servos), abs=0.05)
    assert offer.position_mm > 40.0
    stuck.zero(ZeroRequest(kept=("advance",)))
    pull_out(stuck, servos)
    assert inserted_mm(servos) == pytest.approx(-5.0, abs=0.1)


def test_or_the_operator_says_that_it_is_at_40_mm(servos: SoftServoBus, stuck: ServoRobot) -> None:
    with pytest.raises(NotReady, match="advance cannot be at 401 mm: give -5 to 400 mm"):
        stuck.zero(ZeroRequest(positions_mm={"advance": 401.0}))
    at_mm = inserted_mm(servos)
    stuck.zero(ZeroRequest(positions_mm={"advance": 40.0}))
    pull_out(stuck, servos)
    assert inserted_mm(servos) == pytest.approx(at_mm - 45.0, abs=0.1)


def test_or_it_is_pulled_out_slowly_beyond_the_end(servos: SoftServoBus, stuck: ServoRobot) -> None:
    """By an operator who took it for 1 mm in: it stops where it truly is some 34 mm in, and goes on while retract is held."""
    stuck.zero(ZeroRequest(positions_mm={"advance": 1.0}))
    pull_out(stuck, servos)
    end_mm = inserted_mm(servos)
    assert end_mm > 33.0
    started_s = time.monotonic()
    status = drive(stuck, Command(advance_mm_s=-20.0), 1.5, retracts=Retracted.ROBOT)
    assert status.armed
    gone_mm = end_mm - inserted_mm(servos)
    assert 1.0 < gone_mm <= 2.0 * (time.monotonic() - started_s) + 0.2
    drive(stuck, Command(advance_mm_s=-20.0), 0.4)
    held_mm = inserted_mm(servos)
    drive(stuck, Command(advance_mm_s=-20.0), 0.6)
    assert inserted_mm(servos) == pytest.approx(held_mm, abs=0.02), "without the hold it stays"
    stuck.disarm()
    stuck.arm()  # from there, too
    status = drive(stuck, Command(advance_mm_s=-20.0), 1.0, retracts=Retracted.ROBOT)
    assert inserted_mm(servos) < held_mm - 0.8
    assert (status.armed, status.active) == (True, ())


# --- the file --------------------------------------------------------------------------------------------------------------------


def kept_mm(path: Path) -> dict[str, float]:
    return {one.name: one.position_mm for one in KeptZeros.model_validate_json(path.read_bytes()).joints}


@pytest.mark.parametrize("unattended_s", [0.0, 600.0])
def test_a_killed_application_leaves_the_last_insertion(servos: SoftServoBus, tmp_path: Path, unattended_s: float) -> None:
    """Also where its bus process goes on watching, until the next program takes the port over."""
    path = tmp_path / "zeros" / "bench.json"
    code = (
        "import sys, time\nfrom pathlib import Path\n"
        "from core.config.safety import SafetyConfig, ServosConfig\nfrom core.types import Command\n"
        "from hardware.servos.servo_robot import ServoRobot\n"
        "servos = ServosConfig(port=sys.argv[1], watchdog_s=2.5, heartbeat_timeout_s=3.0, unattended_s=float(sys.argv[3]))\n"
        "robot = ServoRobot(servos, SafetyConfig(), keep=Path(sys.argv[2]))\n"
        "robot.connect()\nrobot.zero()\nrobot.arm()\n"
        "while True:\n    robot.send(Command(advance_mm_s=20.0))\n    time.sleep(0.02)\n"
    )
    child = subprocess.Popen([sys.executable, "-c", code, servos.port, str(path), str(unattended_s)], cwd=ROOT)
    try:
        until_s = time.monotonic() + 3 * PATIENCE_S
        while servos.positions_mm()[4] < 30.0 and time.monotonic() < until_s:
            time.sleep(0.02)
        at_mm = servos.positions_mm()[4]
        assert kept_mm(path)["advance"] > at_mm - 15.0, "the file follows a long feed"
    finally:
        os.kill(child.pid, signal.SIGKILL)
        child.wait()
    until_s = time.monotonic() + PATIENCE_S
    while abs(kept_mm(path)["advance"] - servos.positions_mm()[4]) > 0.3 and time.monotonic() < until_s:
        time.sleep(0.05)
    assert kept_mm(path)["advance"] == pytest.approx(servos.positions_mm()[4], abs=0.3)
    config = CONFIG.model_copy(update={"port": servos.port})
    following = ServoRobot(config, SAFETY, keep=path)
    following.connect()
    try:
        assert offers(following)["advance"].position_mm == pytest.approx(servos.positions_mm()[4], abs=0.05)
    finally:
        following.close()


def test_a_killed_bus_process_leaves_less_than_a_quarter_of_a_turn_to_tell(servos: SoftServoBus, connect: Connect) -> None:
    robot = connect()
    robot.zero()
    robot.arm()
    drive(robot, Command(advance_mm_s=20.0), 1.5)
    os.kill(robot._client.pid, signal.SIGKILL)
    assert servos.positions_mm()[4] > 15.0
    for joint in CONFIG.joints:
        servos.modify_servo(joint.id, lambda servo: servo.restart())
    time.sleep(0.5)
    robot = connect()
    assert offers(robot)["advance"].position_mm == pytest.approx(servos.positions_mm()[4], abs=0.05)


def state(place: int, ticks: int, position_mm: float | None) -> ServoState:
    joint = CONFIG.joints[place]
    at = (position_mm, position_mm, 0.0, 8.0, 12.0, 30.0, HardwareError(0), True, False)
    return ServoState(joint.name, joint.id, 0.0, ticks, ticks, *at)


def test_the_file_is_written_now_and_then_and_at_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, wrote = tmp_path / "bench.json", []
    keeper = ZeroKeeper(CONFIG, path)
    monkeypatch.setattr(keeper, "write", lambda now_s, write=keeper.write: (wrote.append(round(now_s, 2)), write(now_s)))
    for cycle in range(200):  # 20 mm/s
        now_s, at_mm = 100.0 + cycle * 0.02, cycle * 0.4
        keeper.update([state(place, round(at_mm * 102.4), at_mm) for place in range(7)], now_s)
    gaps = [after - before for before, after in zip(wrote, wrote[1:], strict=False)]
    assert 0.24 <= min(gaps) <= max(gaps) <= 0.3
    wrote.clear()
    for cycle in range(500):  # the last digit flickers
        keeper.update([state(place, 8151 + cycle % 3, 79.6) for place in range(7)], 110.0 + cycle * 0.02)
    assert len(wrote) <= 1
    keeper.close(200.0)
    assert kept_mm(path)["advance"] == 79.6


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"format": 2, "joints": []}', b'{"joints": [{"name": "up"}]}'])
def test_a_damaged_file_offers_nothing_and_is_replaced(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bench.json"
    path.write_bytes(content)
    keeper = ZeroKeeper(CONFIG, path)
    keeper.load()
    assert keeper.offers([state(place, 1000, None) for place in range(7)]) == ()
    keeper.update([state(place, 1000, 0.0) for place in range(7)], 100.0)
    keeper.close(101.0)
    assert len(kept_mm(path)) == 7


def test_a_folder_that_cannot_be_written_costs_no_driving(tmp_path: Path) -> None:
    blocker = tmp_path / "zeros"
    blocker.write_bytes(b"a file")
    keeper = ZeroKeeper(CONFIG, blocker / "bench.json")
    keeper.update([state(0, 1000, 0.0)], 100.0)
    keeper.close(101.0)
    assert blocker.read_bytes() == b"a file"


@pytest.mark.parametrize(("found_s", "offered_mm"), [(2000.0, 0.2), (500.0, 0.5), (None, 0.5)])
def test_a_newer_search_of_the_rig_file_goes_before_what_was_kept(tmp_path: Path, found_s: float | None, offered_mm: float) -> None:
    path = tmp_path / "bench.json"
    path.write_text(KeptZeros(joints=(keep(CONFIG.joints[0], CONFIG.model, 1051, 0.5, 1000.0),)).model_dump_json())
    found = None if found_s is None else datetime.fromtimestamp(found_s, UTC)
    searched = ZeroConfig(ticks=(1031,) * 7, slack_mm=(0.0,) * 4, pretension_mm=0.3, found_utc=found)
    keeper = ZeroKeeper(CONFIG, path, searched)
    keeper.load()
    found_offers = {offer.name: offer for offer in keeper.offers([state(place, 1051, None) for place in range(7)])}
    keeper.close(0.0)
    assert found_offers["right"].position_mm == pytest.approx(offered_mm, abs=0.01)
    assert found_offers["left"].position_mm == pytest.approx(0.2, abs=0.01), "nothing else is known of it"
    assert set(found_offers) == set(TENDONS), "a feed's zero is no insertion"
