"""The wizard's procedures on a twin whose servos, gate and camera turn on one clock: the right answer is known."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress

import numpy as np
import pytest

from core.calibration.servos import Assignment, Function, HeadMove, HeadNotSeen, Look, angle_deg, assign, turn_deg
from core.config.models import RESOURCES, Config
from core.config.rig_file import read_rig
from core.config.safety import JOINT_NAMES, TENDONS, ServosConfig
from core.devices import DeviceError
from core.types import Command
from hardware.calibration import servo_identification
from hardware.calibration.servo_probe import ProbeFailed, ProbeLimits, ProcedureStopped, probe_config
from hardware.servos import registers
from hardware.twin.rendering.appearance import Appearance
from tests.hardware.lock_bench import LockBench, LockTwin, lock_bench

WIRING = "3,-7,1,-12,-5,2,-4"  # tendons right, left, up, down; advance; two of the catheter
IDS = (1, 2, 3, 4, 5, 7, 12)
FOUND = dict.fromkeys(IDS, 1020)


def _config(**twin: object) -> Config:
    return Config.model_validate({"twin": {"phantom": "tree", "wiring": WIRING, **twin}})


def _identify(bench: LockBench, say: Callable[[str], object] = lambda _: None) -> tuple[Assignment, ...]:
    found = {servo_id: servo_identification.identify_servo(bench, ServosConfig(), FOUND, servo_id, say) for servo_id in IDS}
    return assign({servo_id: finding for servo_id, finding in found.items() if finding is not None}, ServosConfig())


def _tendon_mm(twin: LockTwin) -> np.ndarray:
    return np.array(twin.joints_mm()[:4])


@pytest.fixture(scope="module")
def straight() -> tuple[LockTwin, LockBench]:
    return lock_bench(_config())


@pytest.mark.slow
def test_seven_servos_are_told_apart_whatever_their_ids_and_directions(straight: tuple[LockTwin, LockBench]) -> None:
    twin, bench = straight
    said: list[str] = []
    start = dict(twin.turned_mm)
    twin.moved.clear()
    found = _identify(bench, said.append)
    assert [(one.name, one.sign * one.id) for one in found] == list(zip(JOINT_NAMES, map(int, WIRING.split(",")), strict=True))
    assert {one.name for one in found if one.assumed} == {"up", "down"}
    assert max(abs(at_mm - start[servo_id]) for servo_id, at_mm in twin.moved) <= 3.0 + 1e-6
    assert twin.turned_mm == pytest.approx(start, abs=0.02)
    assert len([line for line in said if "direction" in line]) == 7
    identified = servo_identification.identified(ServosConfig(), found)
    assert [(joint.id, joint.sign) for joint in identified.joints] == [(joint.id, joint.sign) for joint in twin.wiring.joints]


def test_how_far_the_feed_goes_is_measured_over_its_longest_way(straight: tuple[LockTwin, LockBench]) -> None:
    twin, bench = straight
    feed = twin.wiring.joints[JOINT_NAMES.index("advance")]
    start = dict(twin.turned_mm)
    finding = servo_identification.identify_servo(bench, ServosConfig(), FOUND, feed.id, lambda _: None)
    assert (finding.function, finding.sign) == (Function.ADVANCE, feed.sign)
    assert finding.way.amplitude_mm == 3.0
    assert finding.way.px_per_mm == pytest.approx(Appearance().pixels_per_mm, rel=0.1)
    assert twin.turned_mm == pytest.approx(start, abs=0.02)


def test_a_feed_that_leaves_the_picture_on_its_longest_way_is_a_feed_all_the_same() -> None:
    """It was clear who it is: the longer way only tells how far it goes. All seven had to be identified again."""
    twin = LockTwin(_config())
    feed = twin.wiring.joints[JOINT_NAMES.index("advance")]
    start = dict(twin.turned_mm)

    class LosesIt(LockBench):
        def observe(self, alive: Callable[[], None]) -> Look:
            if any(abs(at_mm) > 2.0 for _, at_mm in twin.moved):
                raise HeadNotSeen("the robot's head is not seen")
            return super().observe(alive)

    finding = servo_identification.identify_servo(LosesIt(twin), ServosConfig(), FOUND, feed.id, lambda _: None)
    assert (finding.function, finding.sign) == (Function.ADVANCE, feed.sign)
    assert twin.turned_mm == pytest.approx(start, abs=0.05)


@pytest.mark.slow
def test_wires_are_left_where_they_just_become_taut(straight: tuple[LockTwin, LockBench]) -> None:
    twin, bench = straight
    slack_mm = np.array([0.8, 0.3, -0.2, 0.5])
    for joint, one_mm in zip(twin.wiring.joints[:4], slack_mm, strict=True):
        twin.turn(joint.id, -joint.sign * one_mm)
    twin.pass_time(0.5)
    twin.moved.clear()
    found = servo_identification.find_zeros(bench, twin.wiring, lambda _: None)
    assert found.problems == ()
    # Right and left act in the picture's plane. Up and down bend the head out of it: it shows by a pixel or two of shortening.
    for off_mm in (np.array(found.slack_mm) - slack_mm, _tendon_mm(twin)):
        assert np.abs(off_mm[:2]).max() < 0.1
        assert np.abs(off_mm[2:]).max() < 0.3
    # never more than what shows the head's way beyond taut
    by_id = {joint.id: joint.sign for joint in twin.wiring.joints}
    assert max(by_id[servo_id] * at_mm for servo_id, at_mm in twin.moved) < 1.2


@pytest.mark.slow
@pytest.mark.parametrize("roll_deg", [0.0, 25.0])
def test_the_steering_is_learnt_to_three_degrees(roll_deg: float) -> None:
    twin, bench = lock_bench(_config(roll_deg=roll_deg))
    learnt = servo_identification.learn_steering(bench, twin.wiring, lambda _: None)
    steering = learnt.steering
    assert steering.roll_deg == pytest.approx(roll_deg, abs=5.0)
    for name, axis in (("right", "bend"), ("up", "pitch")):
        direction = next(tendon.direction_deg for tendon in steering.tendons if tendon.name == name)
        if name == "up" and roll_deg == 0.0:
            assert direction is None
        elif name == "right":
            assert abs(turn_deg(_true_direction(twin, bench, axis), direction)) <= 3.0
    assert np.hypot(*(np.array(learnt.head_px) - twin.head_px())) < 15.0
    assert steering.turn_deg_per_mm == pytest.approx(38.0, rel=0.2)  # of the tip, as the truth has it: 36 to 40


def _true_direction(twin: LockTwin, bench: LockBench, axis: str) -> float:
    """From the twin's own head: by how much it moves between a small bend to one side and to the other."""
    heads = []
    with bench.steer(twin.wiring) as robot:
        for share in (0.15, -0.15):
            robot.bend_to(Command(**{axis: share}))
            robot.pause(0.5)
            heads.append(twin.head_px())
        robot.bend_to(Command())
        robot.pause(0.5)
    return angle_deg(heads[0] - heads[1])


def test_stop_in_the_middle_ends_it_at_once() -> None:
    twin, bench = lock_bench(_config())
    said: list[str] = []

    def stop_at_the_first_motion(line: str) -> None:
        said.append(line)
        bench.stop.press()

    with pytest.raises(ProcedureStopped):
        _identify(bench, stop_at_the_first_motion)
    assert len(said) == 1
    assert twin.moved == []
    with pytest.raises(ProcedureStopped):  # and nothing else begins before somebody goes on
        servo_identification.nudge(bench, twin.wiring, "right", 0.5)
    assert twin.moved == []
    bench.stop.release()
    servo_identification.nudge(bench, twin.wiring, "right", 0.5)
    assert twin.joints_mm()[0] == pytest.approx(0.5, abs=0.02)


def test_a_head_that_is_not_seen_moves_nothing() -> None:
    twin, bench = lock_bench(_config())
    twin.world.physics.reset()  # the robot is out of the vessel
    with pytest.raises(HeadNotSeen):
        _identify(bench)
    assert twin.moved == []


class _TrueBench(LockBench):
    """Observes the robot as it is, in no time; after `looks` more looks it sees nothing."""

    def __init__(self, twin: LockTwin, looks: int = 10_000, error: Exception | None = None) -> None:
        super().__init__(twin)
        self.looks = looks
        self._error = error or HeadNotSeen("the robot's head is not seen")

    def observe(self, alive: Callable[[], None]) -> Look:
        alive()
        self.looks -= 1
        if self.looks < 0:
            raise self._error
        points = np.asarray(self._twin.world.view.project(self._twin.world.physics.robot_points_mm()))
        return Look((points,) * 3, np.zeros((480, 640, 3), np.uint8))


def test_learning_the_steering_again_and_again_pulls_no_wire() -> None:
    twin = LockTwin(_config())
    for _ in range(2):
        servo_identification.learn_steering(_TrueBench(twin), twin.wiring, lambda _: None)
        assert _tendon_mm(twin) == pytest.approx([0.0] * 4, abs=0.02)


def _of_shape(name: str, wiring: str) -> LockTwin:
    servos = read_rig(RESOURCES / "rigs" / f"{name}.toml").servos
    return LockTwin(Config.model_validate({"twin": {"phantom": "tree", "wiring": wiring}, "servos": servos.model_dump()}))


SHAPES = [("three_tendons", "3,-7,1,-12,5"), ("two_tendons_rotation", "-9,2,-5,6")]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "wiring"), SHAPES)
def test_zeros_and_steering_of_robots_of_other_shapes(name: str, wiring: str) -> None:
    """The shaft of two tendons is turned into the picture's plane for it, and back."""
    twin = _of_shape(name, wiring)
    bench, tendons = _TrueBench(twin), twin.wiring.tendons
    slack_mm = np.array([0.6, -0.2, 0.3])[: len(tendons)]
    for joint, one_mm in zip(tendons, slack_mm, strict=True):
        twin.turn(joint.id, -joint.sign * one_mm)
    twin.pass_time(0.5)
    found = servo_identification.find_zeros(bench, twin.wiring, lambda _: None)
    assert found.problems == ()
    assert np.abs(np.array(found.slack_mm) - slack_mm).max() < 0.2
    learnt = servo_identification.learn_steering(bench, twin.wiring, lambda _: None)
    assert np.abs(twin.joints_mm()[: len(tendons)]).max() < 0.2
    assert twin.joints_mm()[-1] == pytest.approx(0.0, abs=0.5), "the shaft is turned back"
    steering = learnt.steering
    assert steering.roll_deg == pytest.approx(0.0, abs=10.0)
    assert steering.turn_deg_per_mm == pytest.approx(38.0, rel=0.25)
    assert tuple(one.name for one in steering.tendons) == tuple(joint.name for joint in tendons)


def test_tendons_feed_and_rotation_are_told_apart() -> None:
    twin = _of_shape(*SHAPES[1])
    servos, ids = twin.config.servos, (2, 5, 6, 9)
    models = {2: 1020, 5: 1020, 6: 1210, 9: 1020}
    found = {one: servo_identification.identify_servo(_TrueBench(twin), servos, models, one, lambda _: None) for one in ids}
    named = assign({servo_id: finding for servo_id, finding in found.items() if finding is not None}, servos, ids)
    assert [(one.name, one.id) for one in named] == [("tendon_1", 2), ("tendon_2", 9), ("advance", 5), ("rotation", 6)]
    assert [one.sign for one in named[:3]] == [1, -1, -1]


_UNSEEN, _LOST = HeadNotSeen("the robot's head is not seen"), DeviceError("webcam is lost")


@pytest.mark.parametrize(
    ("looks", "error"),
    [
        (1, _LOST),
        (2, _UNSEEN),
        (5, _LOST),
        *(pytest.param(*rest, marks=pytest.mark.slow) for rest in ((1, _UNSEEN), (2, _LOST), (5, _UNSEEN))),
    ],
)
def test_a_step_that_loses_sight_leaves_nothing_turned(looks: int, error: Exception) -> None:
    """Otherwise a retry would go on from there."""
    twin = LockTwin(_config())
    before = dict(twin.turned_mm)
    steps = (
        lambda blind: servo_identification.identify_servo(blind, ServosConfig(), FOUND, 3, lambda _: None),
        lambda blind: servo_identification.find_zeros(blind, twin.wiring, lambda _: None),
        lambda blind: servo_identification.learn_steering(blind, twin.wiring, lambda _: None),
    )
    for step in steps:
        with suppress(HeadNotSeen, DeviceError):
            step(_TrueBench(twin, looks, error))
        assert twin.turned_mm == pytest.approx(before, abs=0.05)


def test_a_wiggle_goes_both_ways_and_comes_back() -> None:
    twin, bench = lock_bench(_config())
    servo_identification.wiggle(bench, ServosConfig(), FOUND, 7)
    ways = [at_mm for servo_id, at_mm in twin.moved if servo_id == 7]
    assert {servo_id for servo_id, _ in twin.moved} == {7}
    assert (min(ways), max(ways)) == pytest.approx((-1.5, 1.5), abs=0.02)
    assert ways[-1] == pytest.approx(0.0, abs=0.02)


def test_the_servo_under_test_has_bounds_and_the_others_stand() -> None:
    limits = ProbeLimits(-1.0, 2.0, speed_mm_s=4.0)
    made = probe_config(ServosConfig(), 12, limits, -1, FOUND)
    tested = made.joints[JOINT_NAMES.index("advance")]
    assert (tested.id, tested.sign) == (12, -1)
    assert (tested.low_mm, tested.high_mm) == pytest.approx((-1.3, 2.3))
    assert {joint.max_speed_mm_s for joint in made.joints} == {4.0}
    assert {joint.id for joint in made.joints} == set(IDS)
    assert made.pretension_mm == 0.0
    with pytest.raises(ProbeFailed, match="servo 9 cannot be moved"):
        probe_config(ServosConfig(), 9, limits, 1, FOUND)
    with pytest.raises(ProbeFailed, match="7 servos are needed"):
        probe_config(ServosConfig(), 1, limits, 1, dict.fromkeys(IDS[:6], 1020))


def _with_turns(*mm_per_turn: float) -> ServosConfig:
    plain = ServosConfig()
    turns = zip(plain.joints, mm_per_turn, strict=True)
    return plain.model_copy(update={"joints": tuple(joint.model_copy(update={"mm_per_turn": mm}) for joint, mm in turns)})


def _way_mm(servos: ServosConfig, made: ServosConfig, servo_id: int, asked_mm: float) -> float:
    """How far the real joint of a servo moves when the probe is asked for so much."""
    tested, real = made.joints[JOINT_NAMES.index("advance")], next(joint for joint in servos.joints if joint.id == servo_id)
    assert tested.id == servo_id
    return registers.to_mm(real, registers.to_ticks(tested, asked_mm, 0), 0)


@pytest.mark.parametrize("servo_id", range(1, 8))
def test_a_small_step_of_a_servo_that_is_known_is_one_of_its_own_joint(servo_id: int) -> None:
    servos = _with_turns(40.0, 38.0, 25.0, 25.0, 5.0, 60.0, 62.0)  # tendons on drums, a lead screw, rollers
    made = probe_config(servos, servo_id, ProbeLimits(-2.25, 4.0))
    for asked_mm in (0.25, -1.0, 4.0):
        assert _way_mm(servos, made, servo_id, asked_mm) == pytest.approx(asked_mm, abs=0.02)
    real = next(joint for joint in servos.joints if joint.id == servo_id)
    tested = made.joints[JOINT_NAMES.index("advance")]
    assert registers.velocity_mm_s(real, registers.profile_velocity(tested)) <= 4.0
    turns = {joint.id: joint.mm_per_turn for joint in servos.joints}
    assert all(joint.mm_per_turn == turns[joint.id] for joint in made.joints)  # those that only hold, too


@pytest.mark.parametrize("servo_id", range(1, 8))
def test_a_servo_that_nobody_knows_yet_moves_nothing_farther_or_faster_than_asked(servo_id: int) -> None:
    servos = _with_turns(40.0, 38.0, 25.0, 25.0, 5.0, 60.0, 62.0)
    made = probe_config(servos, servo_id, ProbeLimits(), found=dict.fromkeys(range(1, 8), 1020))
    for asked_mm in (0.75, 3.0):
        assert 0.0 < _way_mm(servos, made, servo_id, asked_mm) <= asked_mm + 0.01
    real = next(joint for joint in servos.joints if joint.id == servo_id)
    assert registers.velocity_mm_s(real, registers.profile_velocity(made.joints[JOINT_NAMES.index("advance")])) <= 4.0


class _Wires:
    """Four tendons and a head that goes 20 px with each millimetre of a taut one; a probe goes nowhere beyond its limits."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **taut_mm: float) -> None:
        self.servos = ServosConfig()
        self.taut_mm = {joint.id: taut_mm.get(joint.name, 0.2) for joint in self.servos.joints[:4]}
        self.at_mm = dict.fromkeys(self.taut_mm, 0.0)
        self._pulled = 0
        monkeypatch.setattr(servo_identification, "_look", lambda _bench, _mover: self._pulls_mm())
        monkeypatch.setattr(servo_identification, "head_move", self._head_move)

    def _pulls_mm(self) -> dict[int, float]:
        return {servo_id: max(0.0, at - self.taut_mm[servo_id]) for servo_id, at in self.at_mm.items()}

    def _head_move(self, rest: dict[int, float], now: dict[int, float]) -> HeadMove:
        lateral_px = 20.0 * (now[self._pulled] - rest[self._pulled])
        return HeadMove(np.array([lateral_px, 0.0]), lateral_px, longer_px=0.0)

    @contextmanager
    def probe(
        self, servos: ServosConfig, servo_id: int, limits: ProbeLimits, sign: int, found: Mapping[int, int] | None = None
    ) -> Iterator[_WireProbe]:
        self._pulled = servo_id
        yield _WireProbe(self.at_mm, servo_id, limits)

    def find(self) -> servo_identification.Zeros:
        return servo_identification.find_zeros(self, self.servos, lambda _: None)

    def too_tight_mm(self) -> list[float]:
        return [self.at_mm[servo_id] - taut for servo_id, taut in self.taut_mm.items()]


class _WireProbe:
    def __init__(self, at_mm: dict[int, float], servo_id: int, limits: ProbeLimits) -> None:
        self._at_mm, self._id, self._limits, self._zero_mm = at_mm, servo_id, limits, at_mm[servo_id]

    @property
    def position_mm(self) -> float:
        return self._at_mm[self._id] - self._zero_mm

    def move_to(self, target_mm: float) -> None:
        self._at_mm[self._id] = self._zero_mm + max(self._limits.low_mm, min(self._limits.high_mm, target_mm))

    def pause(self, seconds: float) -> None: ...
    def alive(self) -> None: ...


@pytest.mark.parametrize("name", ["right", "left", "up", "down"])
@pytest.mark.parametrize("too_tight_mm", [-1.0, 0.0, 0.8, 1.2, 1.4, 1.6, 1.75])
def test_a_wire_that_stood_too_tight_is_left_where_it_is_taut(
    monkeypatch: pytest.MonkeyPatch, name: str, too_tight_mm: float
) -> None:
    wires = _Wires(monkeypatch, **{name: -too_tight_mm})
    found = wires.find()
    assert found.problems == ()
    assert wires.too_tight_mm() == pytest.approx([0.0] * 4, abs=0.1)
    assert found.slack_mm[TENDONS.index(name)] == pytest.approx(-too_tight_mm, abs=0.1)


@pytest.mark.parametrize("too_tight_mm", [1.85, 1.9, 2.0, 2.5, 4.0])
def test_a_wire_that_stood_far_too_tight_is_named_and_left_where_it_was(
    monkeypatch: pytest.MonkeyPatch, too_tight_mm: float
) -> None:
    wires = _Wires(monkeypatch, right=-too_tight_mm)
    found = wires.find()
    assert [problem.partition(":")[0] for problem in found.problems] == ["right"]
    assert found.slack_mm[0] == 0.0
    assert wires.too_tight_mm() == pytest.approx([too_tight_mm, 0.0, 0.0, 0.0], abs=0.1)
