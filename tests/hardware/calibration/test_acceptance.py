"""The steps of an acceptance through the real driver and bus process, on strict software servos."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest

from core.config.acceptance import FORCE_ALLOWANCE, AcceptanceError
from core.config.models import Config, load_config
from core.config.safety import JointConfig, ServosConfig
from core.control.faults import Cause
from hardware.calibration.acceptance import AcceptanceBench
from hardware.calibration.servo_probe import ProcedureStopped, StopSwitch
from hardware.twin.servos.bus import SoftServoBus
from tests.core.robots import THREE, TURNED

pytestmark = [pytest.mark.real_time, pytest.mark.usefixtures("no_process_stays_behind")]


@pytest.fixture
def shape(request: pytest.FixtureRequest) -> ServosConfig:
    """The robot's joints."""
    return getattr(request, "param", ServosConfig())


@pytest.fixture
def servos(start_servos: Callable[..., SoftServoBus], shape: ServosConfig) -> SoftServoBus:
    return start_servos(shape, wire_time=True)


@pytest.fixture
def config(shape: ServosConfig, servos: SoftServoBus) -> Config:
    config = load_config(overrides={"rig": {"camera": "webcam", "robot": "servos"}})
    # no process stays behind to watch the servos
    return config.model_copy(update={"servos": shape.model_copy(update={"port": servos.port, "unattended_s": 0.0})})


@pytest.fixture
def bench(config: Config) -> AcceptanceBench:
    return AcceptanceBench(config, StopSwitch(), None)


def _joint(config: Config, name: str) -> JointConfig:
    return next(joint for joint in config.servos.joints if joint.name == name)


def test_the_servos_say_who_they_are_and_nothing_is_written(servos: SoftServoBus, bench: AcceptanceBench) -> None:
    before = [bytes(servos.servo(n).answer(2, 0, 147).data) for n in range(1, 8)]
    found, (low_v, high_v) = bench.identify()
    assert [(one.name, one.id, one.model) for one in found][:2] == [("right", 1, 1020), ("left", 2, 1020)]
    assert {one.firmware for one in found} == {servos.servo(1).table["firmware"]}
    assert low_v == high_v == 12.0
    assert [bytes(servos.servo(n).answer(2, 0, 120).data) for n in range(1, 8)] == [table[:120] for table in before]


def test_a_direction_is_shown_by_one_axis_that_comes_back(servos: SoftServoBus, config: Config, bench: AcceptanceBench) -> None:
    seen_mm = []
    watching = threading.Event()

    def watch() -> None:
        while not watching.wait(0.02):
            seen_mm.append(servos.positions_mm())

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        bench.show_direction(_joint(config, "up"))
    finally:
        watching.set()
        thread.join()
    assert max(at[2] for at in seen_mm) == pytest.approx(1.5, abs=0.1)
    assert servos.positions_mm() == pytest.approx([0.0] * 7, abs=0.06)


@pytest.mark.parametrize("name", ["right", "advance"])
def test_the_pull_at_a_scale_gives_the_configured_force_and_lets_go(
    servos: SoftServoBus, config: Config, bench: AcceptanceBench, name: str
) -> None:
    joint = _joint(config, name)
    servos.attach_wire(joint.id, n_per_mm=10.0)
    peak_n, watching = [0.0], threading.Event()

    def watch() -> None:
        while not watching.wait(0.005):
            peak_n.append(servos.wire_n(joint.id))

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        pull = bench.pull(joint)
    finally:
        watching.set()
        thread.join()
    assert pull.was_held
    assert 0.3 * joint.max_force_n < max(peak_n) <= FORCE_ALLOWANCE * joint.max_force_n  # the gear's friction takes its part
    assert pull.by_current_n == pytest.approx(joint.max_force_n, rel=0.15)
    assert servos.wire_n(joint.id) < 2.0, "the tension is let off"


def test_a_scale_that_holds_nothing_is_noticed(config: Config, bench: AcceptanceBench) -> None:
    assert not bench.pull(_joint(config, "left")).was_held


@pytest.mark.parametrize("kind", ["STOP", "deadman"])
def test_stops_are_timed_until_the_axis_stands(servos: SoftServoBus, config: Config, bench: AcceptanceBench, kind: str) -> None:
    lines: list[str] = []
    found = bench.stop_times(kind, _joint(config, "advance"), lines.append)
    assert len(found.times_ms) == len(lines) == 3
    assert min(found.times_ms) > 0.0
    if kind == "deadman":
        assert min(found.times_ms) >= 80.0, "a deadman that falls silent counts for 80 ms"
    assert (0.8 if kind == "deadman" else 0.0) < found.way_mm < 8.0, "it goes on while the deadman still counts"
    assert servos.positions_mm()[4] == pytest.approx(0.0, abs=0.3)


def _power(servos: SoftServoBus, for_s: float) -> None:
    for servo_id in range(1, 8):
        servos.modify_servo(servo_id, lambda servo: servo.restart(for_s))


def test_the_e_stop_is_seen_and_nothing_can_be_switched_on_before_the_joints_are_zeroed(
    servos: SoftServoBus, bench: AcceptanceBench
) -> None:
    said: list[str] = []

    def say(line: str) -> None:
        said.append(line)
        _power(servos, 60.0 if line.startswith("press") else 0.0)

    record = bench.estop(say, 10.0)
    assert [line.split()[0] for line in said] == ["press", "release"]
    assert record.cause == Cause.SUPPLY_LOST.value
    assert 0.0 < record.silent_ms < 2000.0
    assert "release the E-stop" in record.refused
    assert "not zeroed" in record.refused_after


def test_a_button_that_cuts_one_servo_only_is_no_e_stop(servos: SoftServoBus, bench: AcceptanceBench) -> None:
    with pytest.raises(AcceptanceError, match=r"another cause.*must cut the power of all servos at once"):
        bench.estop(lambda _: servos.faults.mute(3), 10.0)


def test_an_e_stop_that_is_not_pressed_is_not_recorded(bench: AcceptanceBench) -> None:
    with pytest.raises(AcceptanceError, match="nothing was seen within"):
        bench.estop(lambda _: None, 0.5)


def test_stop_ends_a_step(servos: SoftServoBus, config: Config) -> None:
    stop = StopSwitch()
    timer = threading.Timer(1.5, stop.press)
    timer.start()
    try:
        with pytest.raises(ProcedureStopped):
            while True:
                AcceptanceBench(config, stop, None).show_direction(_joint(config, "advance"))
    finally:
        timer.join()
    time.sleep(0.5)  # the axis comes to rest
    at_mm = servos.positions_mm()
    time.sleep(0.2)
    assert servos.positions_mm() == pytest.approx(at_mm, abs=0.05)


@pytest.mark.parametrize(
    ("shape", "name"),
    [(THREE, "tendon_2"), (TURNED, "tendon_2"), (TURNED, "rotation")],
    indirect=["shape"],
    ids=["three", "two", "shaft"],
)
def test_axes_of_other_robots_are_shown_one_by_one(servos: SoftServoBus, config: Config, bench: AcceptanceBench, name: str) -> None:
    joint, seen = _joint(config, name), list[tuple[float, ...]]()
    watching = threading.Event()

    def watch() -> None:
        while not watching.wait(0.02):
            seen.append(servos.positions_mm())

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        bench.show_direction(joint)
    finally:
        watching.set()
        thread.join()
    place = config.servos.joints.index(joint)
    farthest = [max(at[one] for at in seen) for one in range(len(servos.positions_mm()))]
    near = 0.5 if name == "rotation" else 0.1  # some of a servo's steps
    assert farthest[place] == pytest.approx(15.0 if name == "rotation" else 1.5, abs=near)
    assert max(at for one, at in enumerate(farthest) if one != place) < 0.05
    assert servos.positions_mm() == pytest.approx([0.0] * len(farthest), abs=near)


@pytest.mark.parametrize("shape", [TURNED], indirect=True, ids=["turned"])
def test_the_torque_of_a_shaft_is_read_at_a_lever(servos: SoftServoBus, config: Config, bench: AcceptanceBench) -> None:
    joint = _joint(config, "rotation")
    servos.attach_wire(joint.id, n_per_mm=10.0)  # N mm per degree
    pull = bench.pull(joint)
    assert pull.was_held
    assert pull.by_current_n == pytest.approx(joint.max_force_n, rel=0.15)


@pytest.mark.parametrize("shape", [TURNED], indirect=True, ids=["turned"])
def test_stops_and_e_stop_of_another_robot_are_those_of_its_feed(
    servos: SoftServoBus, config: Config, bench: AcceptanceBench
) -> None:
    assert bench.stop_times("STOP", _joint(config, "advance"), lambda _: None).way_mm < 8.0

    def press(line: str) -> None:
        servos.brown_out(60.0 if line.startswith("press") else 0.0)

    assert bench.estop(press, 10.0).cause == Cause.SUPPLY_LOST.value
