"""Fault 25 in all its kinds: a joint that runs away, drifts in a hold or stays outside its envelope ends the motion, and no other.

Guard and gate are the real ones, the joints are the twin's motors with the profile that the driver gives them, and time is turned
by the test.
"""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from core.config.safety import JointConfig, SafetyConfig, ServosConfig
from core.control.faults import Cause, Fault
from core.control.gate import JointMeasurement, Source
from core.types import Command
from hardware.servos import registers
from hardware.servos.bus_guard import BusGuard
from hardware.servos.bus_ipc import BusOrder, Heartbeat
from hardware.servos.registers import HardwareError, MissingServo, ServoReading, ServoState
from hardware.servos.tracking import Jam, JamMonitor, TrackingMonitor, drift_limit_mm
from hardware.twin.servos.device import _ACCELERATION_TICKS_S2, _VELOCITY_TICKS_S, MotorGoal, ServoMotor

SERVOS, SAFETY = ServosConfig(), SafetyConfig()
RIGHT, ADVANCE = 0, 4
FORWARD = Command(advance_mm_s=20.0)
CYCLE_S = 0.02


class Motors:
    """Seven motors under the guard; ``carried_mm_s`` moves joints from outside, ``weak`` ones reach a share of their speed."""

    def __init__(self, servos: ServosConfig = SERVOS) -> None:
        self.servos, self.now_s = servos, 100.0
        self.period_s = 1.0 / servos.bus_hz
        self.guard = BusGuard(servos, SAFETY, self.now_s)
        self.motors = [ServoMotor(0.0) for _ in servos.joints]
        self.goals_mm = [0.0] * 7
        self.command: Command | None = Command()
        self.permitted: Source | None = Source.OPERATOR
        self.carried_mm_s = [0.0] * 7
        self.weak = [1.0] * 7
        self.missing: set[int] = set()
        self.fault: Fault | None = None

    @property
    def at_mm(self) -> tuple[float, ...]:
        return tuple(motor.position / abs(joint.ticks_per_mm) for motor, joint in zip(self.motors, self.servos.joints, strict=True))

    def put(self, place: int, at_mm: float) -> None:
        """Where a joint is, and its goal: moved by hand while nothing was armed."""
        motor = self.motors[place]
        motor.position = motor.trajectory = at_mm * abs(self.servos.joints[place].ticks_per_mm)
        self.goals_mm[place] = at_mm

    def arm(self) -> Motors:
        self.guard.update(self._readings(), 0, None, self.now_s)
        self.guard.check_arming()
        self.guard.set_armed(self.now_s)
        return self

    def run(self, seconds: float) -> Motors:
        """Cycles for so long, or until the motion is ended."""
        until_s = self.now_s + seconds - 1e-9
        while self.now_s < until_s and self.guard.armed:
            self.cycle()
        return self

    def cycle(self) -> None:
        self._live(self.period_s)
        beat = Heartbeat(self.now_s, self.permitted)
        self.fault = self.guard.update(self._readings(), 0, beat, self.now_s)
        if self.fault is not None:
            self.guard.end_motion(self.fault)
            return
        step = self.guard.step(BusOrder(self.command, Source.OPERATOR, self.now_s), beat, self.now_s)
        if step.goals_mm is not None:
            self._live(0.003)  # the write comes so much later than the read
            self.goals_mm = list(step.goals_mm)
            self.guard.record_sent(step.goals_mm, self.guard.followed, self.now_s)

    def _live(self, seconds: float) -> None:
        self.now_s += seconds
        for place, (motor, joint) in enumerate(zip(self.motors, self.servos.joints, strict=True)):
            per_mm = abs(joint.ticks_per_mm)
            drive = MotorGoal(
                torque=True,
                goal=round(self.goals_mm[place] * per_mm),
                speed=registers.profile_velocity(joint) * _VELOCITY_TICKS_S * self.weak[place],
                acceleration=registers.profile_acceleration(joint) * _ACCELERATION_TICKS_S2,
            )
            if self.carried_mm_s[place]:
                motor.stop()
                motor.position = motor.trajectory = motor.position + self.carried_mm_s[place] * seconds * per_mm
            else:
                motor.step(drive, seconds)

    def _readings(self) -> list[ServoReading]:
        return [
            self._missing(joint) if place in self.missing else self._state(joint, round(100 * at) / 100, goal)
            for place, (joint, at, goal) in enumerate(zip(self.servos.joints, self.at_mm, self.goals_mm, strict=True))
        ]

    def _missing(self, joint: JointConfig) -> MissingServo:
        return MissingServo(joint.name, joint.id, self.now_s, 1, "no answer")

    def _state(self, joint: JointConfig, at_mm: float, goal_mm: float) -> ServoState:
        none = HardwareError(0)
        return ServoState(joint.name, joint.id, self.now_s, 0, 0, at_mm, goal_mm, 0.0, 8.0, 12.0, 30.0, none, True, False)

    def stopped_for(self, text: str) -> None:
        """Fault 25, which stops, with these words."""
        assert self.guard.stopped
        assert self.guard.latched.cause is Cause.TRACKING
        assert text in self.guard.latched.detail


# --- jams ------------------------------------------------------------------------------------------------------------------------


def test_a_joint_that_stands_though_its_goal_is_far_is_jammed() -> None:
    """Far: more than half of the tendon's step of 0.6 mm, for 0.2 s."""
    watch, goals, at = JamMonitor(SERVOS.joints, 0.2), (0.4,) + (0.0,) * 6, (0.0,) * 7
    seen = [watch.update(goals, at, n * CYCLE_S) for n in range(12)]
    assert seen[:10] == [None] * 10
    assert seen[10] == Jam(SERVOS.joints[0], 0.4, 0.2)


@pytest.mark.parametrize(
    "path",
    [
        lambda t: (0.29, 0.0),
        lambda t: (5.0 * t + 0.4, 5.0 * t),
        lambda t: (0.4 if t % 0.2 < 0.1 else 0.0, 0.0),
        lambda t: (0.4 if t % 0.2 < 0.1 else -0.4, 0.0),
    ],
    ids=["near", "lags but moves", "far now and then", "to and fro"],
)
def test_no_jam(path: Callable[[float], tuple[float, float]]) -> None:
    watch = JamMonitor(SERVOS.joints, 0.2)
    for n in range(100):
        goal, at = path(n * CYCLE_S)
        assert watch.update((goal,) + (0.0,) * 6, (at,) + (0.0,) * 6, n * CYCLE_S) is None


# --- what ends the motion --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed_mm_s", [-2.0, -12.0, -19.9, -21.0, -60.0])
def test_a_joint_that_runs_away_from_its_goal(speed_mm_s: float) -> None:
    """Faster than its goals may go (20 mm/s), the gate holds and begins anew, again and again: never far from a goal."""
    rig = Motors().arm()
    rig.put(ADVANCE, 100.0)
    rig.command = Command(advance_mm_s=5.0)
    rig.run(0.5)
    assert rig.guard.armed
    start_mm, rig.carried_mm_s[ADVANCE] = rig.at_mm[ADVANCE], speed_mm_s
    rig.run(3.0)
    rig.stopped_for("advance")
    gone_mm = start_mm - rig.at_mm[ADVANCE]
    assert gone_mm <= drift_limit_mm(SERVOS.joints[ADVANCE]) + abs(speed_mm_s) * 0.35


@pytest.mark.parametrize("speed_mm_s", [22.0, 40.0])
def test_a_joint_that_runs_past_its_goal(speed_mm_s: float) -> None:
    rig = Motors().arm()
    rig.command = Command(advance_mm_s=5.0)
    rig.run(0.5)
    rig.carried_mm_s[ADVANCE] = speed_mm_s
    rig.run(2.0)
    rig.stopped_for("advance went")


@pytest.mark.parametrize("speed_mm_s", [0.2, 0.7, 1.5, 8.0])
@pytest.mark.parametrize("permitted", [None, Source.OPERATOR])
def test_a_joint_that_drifts_during_a_hold(permitted: Source | None, speed_mm_s: float) -> None:
    """A wire that pulls its servo along: each new hold began where it was by then."""
    rig = Motors().arm()
    rig.run(0.3)
    rig.command, rig.permitted = None, permitted
    rig.carried_mm_s[RIGHT] = speed_mm_s
    start_mm = rig.at_mm[RIGHT]
    rig.run(10.0)
    rig.stopped_for("right")
    assert abs(rig.at_mm[RIGHT] - start_mm) <= drift_limit_mm(SERVOS.joints[RIGHT]) + speed_mm_s * 0.35


def test_a_joint_that_stays_outside_its_envelope_from_the_first_cycle_on() -> None:
    """Moved between the check and the first cycle: no goal leads from there, so none was ever far away."""
    rig = Motors().arm()
    rig.put(ADVANCE, 402.0)
    rig.run(0.2)
    assert rig.guard.armed, "not before 200 ms"
    rig.run(0.1)
    rig.stopped_for("advance stays at 402.00 mm, outside its envelope (-5 to 400 mm)")


@pytest.mark.parametrize(("permitted", "is_armed"), [(Source.OPERATOR, True), (None, True), (Source.PROGRAM, False)])
def test_a_feed_below_its_low_end_is_held_there_unless_the_program_drives(permitted: Source | None, is_armed: bool) -> None:
    rig = Motors()
    rig.put(ADVANCE, -30.0)
    rig.arm()
    rig.command, rig.permitted = FORWARD if permitted is not Source.OPERATOR else None, permitted
    rig.run(1.0)
    assert rig.guard.armed is is_armed
    assert rig.at_mm[ADVANCE] == pytest.approx(-30.0, abs=0.01)
    if not is_armed:
        rig.stopped_for("advance stays at -30.00 mm, outside its envelope")


def test_a_joint_that_is_pushed_out_of_its_envelope_and_stays_there() -> None:
    rig = Motors().arm()
    rig.run(0.3)
    rig.motors[ADVANCE].frozen = True
    rig.motors[ADVANCE].position = -7.0 * SERVOS.joints[ADVANCE].ticks_per_mm
    rig.run(0.4)
    rig.stopped_for("advance went 7.00 mm where nobody sent it")


# --- what does not ---------------------------------------------------------------------------------------------------------------


def _stutter(rig: Motors, draw: random.Random) -> None:
    """Orders that come and go as on a busy machine, with reversals, holds and changes of who may drive."""
    rig.command = draw.choice(
        [
            None,
            FORWARD,
            Command(advance_mm_s=-20.0),
            Command(bend=draw.uniform(-1.0, 1.0), pitch=draw.uniform(-1.0, 1.0), delivery_mm_s=draw.choice([-20.0, 20.0])),
        ]
    )
    rig.permitted = draw.choice([Source.OPERATOR, Source.OPERATOR, Source.OPERATOR, None])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("bus_hz", [50.0, 20.0])
def test_no_healthy_joint_stops_however_it_is_driven(seed: int, bus_hz: float) -> None:
    rig, draw = Motors(SERVOS.model_copy(update={"bus_hz": bus_hz})).arm(), random.Random(seed)
    rig.put(ADVANCE, 100.0)
    for _ in range(150):
        _stutter(rig, draw)
        rig.run(draw.choice([0.02, 0.06, 0.12, 0.25, 0.4]))
    assert rig.guard.armed, rig.guard.latched


@pytest.mark.parametrize("seed", range(2))
def test_a_late_status_is_no_fault_of_the_joints(seed: int) -> None:
    """Answers are lost for up to 60 ms, now and then, and the process stands still for 0.8 s."""
    rig, draw = Motors().arm(), random.Random(seed)
    rig.put(ADVANCE, 100.0)
    for _ in range(150):
        _stutter(rig, draw)
        for _ in range(draw.randrange(1, 10)):
            rig.missing = {draw.randrange(7)} if draw.random() < 0.5 else set()
            rig.run(rig.period_s)
        if draw.random() < 0.1:
            rig.now_s += 0.8
            rig._live(0.0)
    assert rig.guard.armed, rig.guard.latched


@pytest.mark.parametrize(("speed_mm_s", "acceleration_mm_s2"), [(0.3, 200.0), (1.0, 3.0), (20.0, 20.0)])
def test_slow_joints_that_are_under_way_are_no_fault(speed_mm_s: float, acceleration_mm_s2: float) -> None:
    """Slow, or slow to brake. The one that is a step outside its envelope when it is armed takes seconds to come back."""
    slow = {"max_speed_mm_s": speed_mm_s, "max_acceleration_mm_s2": acceleration_mm_s2}
    joints = tuple(joint.model_copy(update=slow) for joint in SERVOS.joints)
    rig = Motors(SERVOS.model_copy(update={"joints": joints}))
    rig.put(ADVANCE, 400.9)
    rig.arm().run(6.0)
    assert rig.guard.armed, rig.guard.latched
    assert rig.at_mm[ADVANCE] < 400.5
    for command in (FORWARD, None, Command(advance_mm_s=-20.0, bend=1.0), Command(bend=-1.0), None):
        rig.command = command
        rig.run(2.5)
    assert rig.guard.armed, rig.guard.latched


@pytest.mark.parametrize("share", [0.5, 0.2])
def test_a_joint_that_lags_and_comes_along_is_no_fault(share: float) -> None:
    """A weak supply: it reaches a part of the speed that it is asked for."""
    rig = Motors().arm()
    rig.weak = [share] * 7
    for command in (FORWARD, Command(bend=1.0), Command(bend=-1.0, advance_mm_s=-20.0), None, FORWARD):
        rig.command = command
        rig.run(1.5)
        assert rig.guard.armed, rig.guard.latched


def test_a_joint_that_was_moved_before_arming_is_taken_where_it_is() -> None:
    rig = Motors()
    rig.arm().run(0.5)
    rig.guard.disarm()
    rig.put(ADVANCE, 250.0)
    rig.put(RIGHT, 1.5)
    rig.arm().run(2.0)
    assert rig.guard.armed, rig.guard.latched


def test_a_nudge_that_is_let_go_again_is_none() -> None:
    rig = Motors().arm()
    rig.run(0.3)
    for _ in range(5):
        rig.carried_mm_s[ADVANCE] = 20.0
        rig.run(0.08)
        rig.carried_mm_s[ADVANCE] = 0.0
        rig.run(0.5)
    assert rig.guard.armed, rig.guard.latched


def test_the_same_positions_told_again_say_nothing_new() -> None:
    watch, goals = TrackingMonitor(SERVOS.joints, SAFETY), (0.0,) * 4 + (1.0, 0.0, 0.0)
    old = JointMeasurement((0.0,) * 7, 1.0)
    assert [watch.update(goals, old) for _ in range(100)] == [None] * 100
    heard = [watch.update(goals, JointMeasurement((0.0,) * 7, 1.0 + 0.05 * n)) for n in range(8)]
    assert heard[-1] == "advance stands 1.00 mm from its goal for 300 ms"
