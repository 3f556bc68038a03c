"""What moving servos a little shows: which servo is which, where the wires are taut, in which direction each tendon bends the head.

The procedures know neither window nor command line. Every motion is a probe's (one servo, bounded) or a robot's (all,
zeroed); both go through driver and gate, and STOP ends every procedure within one period. Robots have the joints of their
configuration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from core.calibration.servos import (
    Assignment,
    Function,
    HeadNotSeen,
    Look,
    NeverTaut,
    Pull,
    ServoFinding,
    TautReading,
    Wiggle,
    classify,
    head_move,
    is_begun,
    is_enough,
    learn,
    taut_at_mm,
)
from core.config.calibration import SteeringConfig, ZeroConfig
from core.config.safety import TENDON_ANGLES_DEG, JointConfig, JointKind, ServosConfig
from core.control.joints import unit_vector
from core.control.kept_zero import keep, zero_offer
from core.devices import DeviceError
from core.messages import message
from core.types import Command, Point
from hardware.calibration.bench import CalibrationBench
from hardware.calibration.servo_probe import ProbeLimits, ServoProbe, SteeredRobot
from hardware.servos.dynamixel_port import ServoError

_AMPLITUDES_MM = (0.75, 1.5, 3.0)
_SETTLE_S = 0.5
_SLACK_MM, _STEP_MM, _FINE_MM, _REACH_MM = 1.25, 0.25, 0.06, 4.0
_BELOW_MM, _PARK_MM = 0.3, 1.0
_PULLS_MM = (0.3, 0.5, 0.8, 1.2)
_ENOUGH_PX = 6.5
_TURN_S, _TURNED_DEG, _TURN_TRIES = 0.6, 0.5, 20
"""Time in which a shaft is to turn back, how far it may be from there, and how often that is tried."""
_AT_ZERO_MM = 0.1
"""A tendon so near to its kept zero stands at it."""

Say = Callable[[str], object]


@dataclass(frozen=True, slots=True)
class Zeros:
    """How far each tendon was from taut (mm; positive: it was slack), and those that could not be told, with why."""

    slack_mm: tuple[float, ...]
    problems: tuple[str, ...] = ()


def wiggle(
    bench: CalibrationBench, servos: ServosConfig, found: Mapping[int, int], servo_id: int, amplitude_mm: float = 1.5
) -> None:
    """Turn one servo a little both ways and back, for the operator to watch."""
    with bench.probe(servos, servo_id, ProbeLimits(-amplitude_mm, amplitude_mm), 1, found) as probe:
        for target_mm in (amplitude_mm, 0.0, -amplitude_mm, 0.0):
            probe.move_to(target_mm)
            probe.pause(_SETTLE_S / 2)


@contextmanager
def _or_back(back: Callable[[], None]) -> Iterator[None]:
    """Go back when the head is not seen or the camera is lost in the middle of a step: a retry would go on from there.

    After an error of the servos themselves, STOP included, nothing moves any more.
    """
    try:
        yield
    except ServoError:
        raise
    except (HeadNotSeen, DeviceError):
        back()
        raise


def identify_servo(
    bench: CalibrationBench, servos: ServosConfig, found: Mapping[int, int], servo_id: int, say: Say
) -> ServoFinding | None:
    """What one servo does; None when nothing clear was seen. It is turned no further than needed.

    `found` has the models of all servos on the line, by id. Raises ServoError, DeviceError, HeadNotSeen.
    """
    most_mm = _AMPLITUDES_MM[-1]
    limits = ProbeLimits(-most_mm, most_mm)
    with bench.probe(servos, servo_id, limits, 1, found) as probe, _or_back(lambda: probe.move_to(0.0)):
        for amplitude_mm in _AMPLITUDES_MM:
            say(message("servo {a}: {b:g} mm both ways", a=servo_id, b=amplitude_mm))
            finding = classify(_wiggled(bench, probe, amplitude_mm))
            if finding is not None and finding.function is Function.ADVANCE and amplitude_mm < most_mm:
                # How far it feeds is clear only after a longer way.
                say(message("servo {a}: {b:g} mm both ways", a=servo_id, b=most_mm))
                try:
                    farther = classify(_wiggled(bench, probe, most_mm))
                except HeadNotSeen:  # the head leaves the picture there
                    farther = None
                    probe.move_to(0.0)
                if farther is not None and (farther.function, farther.sign) == (finding.function, finding.sign):
                    finding = farther
            if finding is not None:
                say(
                    message(
                        "servo {a} {function} ({seen}), direction {sign}",
                        a=servo_id,
                        function=finding.function,
                        seen=finding.seen,
                        sign="+" if finding.sign > 0 else "-",
                    )
                )
                return finding
    say(message("servo {a}: nothing clear was seen", a=servo_id))
    return None


def _wiggled(bench: CalibrationBench, probe: ServoProbe, amplitude_mm: float) -> Wiggle:
    """What is seen at rest, so far one way and so far the other; the servo stands where it stood then."""
    rest = _look(bench, probe)
    seen = []
    for target_mm in (amplitude_mm, -amplitude_mm):
        probe.move_to(target_mm)
        seen.append(_look(bench, probe))
    probe.move_to(0.0)
    return Wiggle(amplitude_mm, rest, *seen)


def identified(servos: ServosConfig, assignments: Sequence[Assignment]) -> ServosConfig:
    """The bus with every servo in its place, turning the right way; raises ValueError when two have the same id."""
    by_name = {one.name: one for one in assignments}
    joints = [
        {**joint.model_dump(), "id": by_name[joint.name].id, "sign": by_name[joint.name].sign} if joint.name in by_name else joint
        for joint in servos.joints
    ]
    return ServosConfig.model_validate({**servos.model_dump(), "joints": joints})


def find_zeros(bench: CalibrationBench, servos: ServosConfig, say: Say) -> Zeros:
    """Let each tendon go slack, pull it until the head follows, and leave it where it just became taut.

    A tendon that cannot be told is left where it was, and named in ``problems``.

    Raises ServoError: strained, stopped, or the bus is not in order: nothing goes on; DeviceError: the camera is lost; the
    tendons in hand are as they were.
    """
    slack = {joint.name: 0.0 for joint in servos.tendons}
    problems = []
    # opposite wires stand side by side; three share every pull
    names, size = list(slack), 3 if len(slack) == 3 else 2
    for group in (names[first : first + size] for first in range(0, len(names), size)):
        # Taut wires share every pull: while one is looked at the others hang slack.
        for name in group[1:]:
            _move(bench, servos, name, -_PARK_MM)
        for name in group:
            hangs_mm, then_mm = 0.0 if name == group[0] else _PARK_MM, 0.0 if name == group[-1] else -_PARK_MM
            try:
                taut_mm = _find_zero(bench, servos, name, then_mm)
            except ServoError:
                raise
            except DeviceError:
                for hanging in group[1 if name == group[0] else 0 :]:
                    _move(bench, servos, hanging, _PARK_MM)
                raise
            except (NeverTaut, HeadNotSeen) as error:
                problems.append(f"{name}: {error}")
                say(problems[-1])
                _move(bench, servos, name, hangs_mm + then_mm)
            else:
                slack[name] = taut_mm - hangs_mm
                say(f"{name}: taut {abs(slack[name]):.2f} mm {'farther' if slack[name] >= 0 else 'back'}")
        for name in group[:-1]:
            _move(bench, servos, name, _PARK_MM)
    return Zeros(tuple(slack.values()), tuple(problems))


def _joint(servos: ServosConfig, name: str) -> JointConfig:
    return servos.joints[servos.names.index(name)]


def _move(bench: CalibrationBench, servos: ServosConfig, name: str, way_mm: float) -> None:
    joint = _joint(servos, name)
    limits = ProbeLimits(-_PARK_MM, _PARK_MM)
    with bench.probe(servos, joint.id, limits, joint.sign) as probe:
        probe.move_to(way_mm)
        probe.pause(_SETTLE_S / 2)


def _find_zero(bench: CalibrationBench, servos: ServosConfig, name: str, then_mm: float) -> float:
    """Where a tendon becomes taut, from where it stands; it is left `then_mm` from there.

    Raises NeverTaut, HeadNotSeen, DeviceError: it is where it was.
    """
    joint = _joint(servos, name)
    # A wire that stood too tight is taut below where it was let go to, and hangs lower still: a probe stops at its limits.
    limits = ProbeLimits(-_SLACK_MM - 2.0 * _PARK_MM, _REACH_MM)
    with bench.probe(servos, joint.id, limits, joint.sign) as probe, _or_back(lambda: probe.move_to(0.0)):
        probe.move_to(-_SLACK_MM)
        rest = _look(bench, probe)
        begun = _steps(bench, probe, rest, -_SLACK_MM, _STEP_MM, is_begun)[-1].position_mm
        # Once more from slack, in small steps: a fraction of a millimetre takes the head through its whole way. And with another
        # look at rest: the head does not come back to where it was by itself. From three steps before, because out of the picture's
        # plane the first one beyond taut shows next to nothing, and steps before it tell where it begins, too.
        slack_mm = begun - 3.0 * _STEP_MM
        probe.move_to(slack_mm - _BELOW_MM)
        rest = _look(bench, probe)
        steps = _steps(bench, probe, rest, slack_mm - _FINE_MM, _FINE_MM, is_enough)
        try:
            taut_mm = taut_at_mm(steps)
        except NeverTaut:
            probe.move_to(0.0)
            raise
        probe.move_to(taut_mm - _BELOW_MM)
        probe.move_to(taut_mm + then_mm)
    return taut_mm


def _steps(
    bench: CalibrationBench, probe: ServoProbe, rest: Look, from_mm: float, step_mm: float, ends: Callable[[TautReading], bool]
) -> list[TautReading]:
    """Tighten step by step, until one of them ends it or there is no room left."""
    steps: list[TautReading] = []
    at_mm = from_mm
    while at_mm < _REACH_MM - 1e-9 and not (steps and ends(steps[-1])):
        at_mm = min(at_mm + step_mm, _REACH_MM)
        probe.move_to(at_mm)
        steps.append(TautReading(at_mm, head_move(rest, _look(bench, probe))))
    return steps


def nudge(bench: CalibrationBench, servos: ServosConfig, name: str, way_mm: float) -> None:
    """Tighten one tendon by `way_mm`, 1 mm at most, or let it go (negative); it stays there."""
    _move(bench, servos, name, way_mm)


def standing_ticks(bench: CalibrationBench, servos: ServosConfig) -> tuple[int, ...]:
    """Position registers of the joints, armed for a moment where they stand; nothing turns. Raises ServoError."""
    with bench.steer(servos.model_copy(update={"pretension_mm": 0.0})) as robot:
        return robot.ticks()


@dataclass(frozen=True, slots=True)
class LearnedSteering:
    """The steering, where the head was, and the position registers of the joints at zero."""

    steering: SteeringConfig
    head_px: Point
    zero_ticks: tuple[int, ...]


def learn_steering(bench: CalibrationBench, servos: ServosConfig, say: Say, kept: ZeroConfig | None = None) -> LearnedSteering:
    """Bend to each side, up and down a little, as far as the head needs to show its way: that pulls each tendon.

    The tendons must be taut and without tension where they stand: that becomes zero, and there they are in the end. Without the
    pretension, which would be kept and be added once more each time this is done.

    Parameters
    ----------
    kept : zero of an earlier search, at which the tendons must stand; None: a search has just left them there.

    Raises SteeringNotSeen, HeadNotSeen, ServoError, DeviceError.
    """
    pulls: dict[str, Pull] = {}
    first: Look | None = None
    slack = servos.model_copy(update={"pretension_mm": 0.0})
    with bench.steer(slack) as robot, _or_back(lambda: _bend(robot, servos, 0.0, 0.0)):
        ticks = robot.ticks()
        if kept is not None:
            _check_at_zero(servos, kept, ticks)
        for name, angle_deg in TENDON_ANGLES_DEG.items():
            for pull_mm in _PULLS_MM:
                _bend(robot, servos, 0.0, 0.0)
                rest = _look(bench, robot)
                first = first or rest
                _bend(robot, servos, pull_mm / servos.max_pull_mm, angle_deg)
                pulls[name] = Pull(pull_mm, head_move(rest, _look(bench, robot)))
                if pulls[name].move.size_px >= _ENOUGH_PX:
                    break
            say(
                message(
                    "{joint}: {a:g} mm of pull, {b:.1f} px of way", joint=name, a=pulls[name].pull_mm, b=pulls[name].move.size_px
                )
            )
        _bend(robot, servos, 0.0, 0.0)
    assert first is not None
    return LearnedSteering(learn(pulls, first.heading, servos.tendons), first.head, ticks)


def _bend(robot: SteeredRobot, servos: ServosConfig, share: float, angle_deg: float) -> None:
    """Bend by a share of the full bend in a direction; a shaft that turns its tendons there is waited for, and turned back."""
    across, up = unit_vector(angle_deg)
    command = Command(bend=share * across, pitch=share * up)
    robot.bend_to(command)
    if len(servos.tendons) > 2 or not servos.joints[servos.places(JointKind.ROTATION)]:
        return
    for _ in range(_TURN_TRIES):
        before_deg = robot.rotation_deg
        if share == 0.0 and abs(before_deg) <= _TURNED_DEG:
            robot.bend_to(command)
            return
        robot.bend_to(command if share else Command(rotation_deg_s=-before_deg / _TURN_S))
        if share and abs(robot.rotation_deg - before_deg) <= _TURNED_DEG:
            return
    raise ServoError("the shaft does not turn to where it should: is it held?")


def _check_at_zero(servos: ServosConfig, kept: ZeroConfig, ticks: tuple[int, ...]) -> None:
    """Raise DeviceError when a tendon does not stand at its kept zero: from a bent head every pull would be added to that."""
    for joint, zero_ticks, now in zip(servos.tendons, kept.ticks, ticks, strict=False):
        model = servos.model_of(joint).number
        offer = zero_offer(joint, model, keep(joint, model, zero_ticks, 0.0, 0.0), now)
        if offer is None or abs(offer.position_mm) > _AT_ZERO_MM:
            raise DeviceError("tendon {name} does not stand at its kept zero: find the zeros first", name=joint.name)


def _look(bench: CalibrationBench, mover: ServoProbe | SteeredRobot) -> Look:
    mover.pause(_SETTLE_S)
    return bench.observe(mover.alive)
