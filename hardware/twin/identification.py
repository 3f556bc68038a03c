"""The robot's behaviour from a recorded jog of a minute: what of it pictures and servo positions tell; what changed in a later run.

First each parameter where it shows by itself: the feed from the length of robot in the picture; delay, play, slack and bend per
pull from the head's turn against the pull. Then all together through the twin's physics, which know the walls. The first half is
fitted, the second one shows how well its head path is predicted.

Pictures show no forces, so of the stiffness only the ratio of shaft and head is found, and only where the head leans on a wall.
Play and delay are told apart by pauses. Intervals are those of the least squares with errors that are alike within a second
(cluster-robust): errors of perception stay for several pictures, so that single ones would count too much.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from core import geometry
from core.bench.bench import PHANTOM_FILE, bench_sha256
from core.config.calibration import BehaviourConfig, Estimate
from core.config.models import Config
from core.config.safety import JointKind, ServosConfig
from core.devices import UserError
from core.session.reader import SessionReader
from core.types import Command, Points, Reason, Scene
from hardware.twin.actuation import wires_bend_mm
from hardware.twin.own_phantom import phantom_name
from hardware.twin.phantom import Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import (
    MAX_PULL_MM,
    NOMINAL_DEG_PER_MM,
    ROBOT_RADIUS_MM,
    DriveProperties,
    Port,
    Specimen,
    TwinPhysics,
    port_of,
)
from hardware.twin.rendering.appearance import appearance_of, make_view
from hardware.twin.truth import RouteFollower, with_caps
from hardware.twin.view import CameraView

Floats = NDArray[np.float64]

BEHIND_MM = np.array([0.0, 5.0, 10.0, 15.0, 20.0, 25.0])
"""Places on the robot that are compared: way back from the head along it."""
_SEEN_SHARE = 0.94
"""Of the head's bend between the chords of the first and of the last 5 mm."""
_STEP_S, _INSERT_MM_S, _REST_S = 0.02, 40.0, 0.3
_PICTURES_HZ = 10.0
"""So many pictures a second are used."""
LEAST_S, LEAST_BEND_MM, LEAST_FEED_MM = 40.0, 0.5, 10.0
"""Shortest jog, and least pull to each side and way of the feed in each of its halves."""
_MOVED_SHARE = 0.02
_LEAST_NOISE_MM = 0.1
_WITHIN = 5.3
"""Standard errors of the least squares that hold 95 % of the values: of 180 of twenty hidden twins (``tools.identified_twins``),
since what perception always sees alike is not in them."""
_MOST_RUNS = 7
"""Of the twin for the fit, besides those for the slopes."""
_LEAST_PICTURES = 30
"""Of a run that is explained."""
_LOST_MM = 6.0
"""From where on the replay's head is so far off, it may be in another branch: only what was before is explained."""
_ALIKE = 30.0
"""So many of the compared numbers count as one: those of ten pictures a second, and of places side by side, err alike."""
_CLEARLY, _ALONE, _AS_WELL, _MOST, _NAMED = 12.0, 0.7, 0.9, 0.5, 2
"""Twice the logarithm of a likelihood's ratio from which a parameter is named; its least share of what all parameters together
explain; the share of the best one's from which another one explains as well; the share of the head's distance that has to vanish;
and how many may be named as equals."""


@dataclass(frozen=True, slots=True)
class FittedParameter:
    """``start`` is the nominal twin's value, ``step`` that of the differences; it lies between ``low`` and ``high``.

    ``spread`` is the standard deviation about the first guess, of a parameter that is taken into account and not told; None: told.
    """

    start: float
    step: float
    low: float
    high: float
    spread: float | None = None


PARAMETERS = {
    "bend_right_deg_per_mm": FittedParameter(NOMINAL_DEG_PER_MM, 1.5, 5.0, 300.0),
    "bend_left_deg_per_mm": FittedParameter(NOMINAL_DEG_PER_MM, 1.5, 5.0, 300.0),
    "slack_right_mm": FittedParameter(0.05, 0.02, 0.0, 1.0),
    "slack_left_mm": FittedParameter(0.05, 0.02, 0.0, 1.0),
    "play_mm": FittedParameter(0.1, 0.02, 0.0, 1.0),
    "shaft_to_head": FittedParameter(2.5, 0.3, 0.5, 20.0),
    "feed_share": FittedParameter(1.0, 0.01, 0.3, 3.0),
    "feed_slip": FittedParameter(0.0, 0.01, -0.3, 0.6),
    "delay_s": FittedParameter(0.05, 0.02, 0.0, 0.5),
    "start_mm": FittedParameter(40.0, 0.5, 0.0, 1000.0, 0.5),
    "friction": FittedParameter(0.1, 0.03, 0.0, 0.5, 0.03),
    "set_deg": FittedParameter(0.0, 2.0, -20.0, 20.0, 2.5),
}
"""``start_mm`` is the insertion at the first picture; friction at the wall and the bend without pull hide behind play and slack."""
RUNS = len(PARAMETERS) + 1
"""Of the twin, for the slopes."""
_NAMES = tuple(PARAMETERS)
_TOLD = tuple(name for name in _NAMES if name in BehaviourConfig.model_fields)
_STEPS, _LOW, _HIGH = (np.array([getattr(one, name) for one in PARAMETERS.values()]) for name in ("step", "low", "high"))
_SPREAD = np.array([one.spread or np.inf for one in PARAMETERS.values()])
_HIDDEN = np.isfinite(_SPREAD)


class JogError(UserError):
    """A session tells nothing of the robot's behaviour; one line says why."""


@dataclass(frozen=True, slots=True, eq=False)
class JogRecord:
    """What a jog showed, in board mm and on one clock.

    Pictures at ``time_s`` (N,) with the robot's places ``body_mm`` (N, 6, 2) at ``BEHIND_MM`` and its ``length_mm`` (N,) beyond the
    port; servos at ``joint_s`` (M,) with the pull to the right ``bend_mm`` (M,), as a full pull of ``MAX_PULL_MM`` has it, and the
    feed ``feed_mm`` (M,).
    """

    time_s: Floats
    body_mm: Floats
    length_mm: Floats
    joint_s: Floats
    bend_mm: Floats
    feed_mm: Floats

    def between(self, start_s: float, end_s: float) -> JogRecord:
        """The pictures from one time to before the other."""
        keep = (self.time_s >= start_s) & (self.time_s < end_s)
        return replace(self, time_s=self.time_s[keep], body_mm=self.body_mm[keep], length_mm=self.length_mm[keep])


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedBench:
    """Where the jog took place: the phantom, its port, and how its camera sees it."""

    phantom: Phantom
    port: Port
    view: CameraView


def bench_of_session(reader: SessionReader, rig: str | None = None) -> IdentifiedBench:
    """The twin of the bench that a session was recorded on. Raises JogError, PhantomError.

    `rig` : name of the rig that it has to be of.
    """
    manifest, folder = reader.manifest, reader.folder
    if manifest is None:
        raise JogError(f"{folder}: its manifest is lost, so its bench is not known")
    if rig is not None and manifest.rig.casefold() != rig.casefold():
        raise JogError(f"{folder}: is of the rig {manifest.rig}, not of {rig}")
    config = Config.model_validate(manifest.config)
    if manifest.kind != "SIM":
        if manifest.known is None or manifest.known.scale is None:
            raise JogError(f"{folder}: was recorded without a scale; calibrate the rig with the board, and record the jog again")
        if config.perception.bench is None:
            raise JogError(f"{folder}: the rig had no bench; teach it, make its phantom (phantom), and record the jog again")
        bench = Path(config.perception.bench)
        if (bench / PHANTOM_FILE).is_file() and (manifest.bench or {}).get("sha256") != bench_sha256(bench):
            raise JogError(f"{folder}: the bench {bench} was taught again since; record the jog again")
        twin = config.twin.model_copy(update={"phantom": phantom_name(str(bench)), "look": "bench"})
    else:
        twin = config.twin
    phantom = make_phantom(twin.phantom)
    size = phantom.view.size if phantom.view is not None else (twin.image_width_px, twin.image_height_px)
    look = appearance_of(twin)
    if manifest.kind != "SIM" or (manifest.known is not None and manifest.known.lens is not None):
        look = replace(look, distortion=0.0)  # its pictures are undistorted
    return IdentifiedBench(phantom, port_of(phantom), make_view(look, size, phantom))


def jog_of_session(reader: SessionReader, bench: IdentifiedBench) -> JogRecord:
    """What a recorded jog showed. Raises JogError."""
    jog = motion_of_session(reader, bench)
    if (seconds := float(jog.time_s[-1] - jog.time_s[0]) if len(jog.time_s) else 0.0) < LEAST_S:
        raise JogError(f"{reader.folder}: the robot is seen for {seconds:.0f} s; a jog has a minute")
    check_jog(jog, str(reader.folder))
    return jog


def motion_of_session(reader: SessionReader, bench: IdentifiedBench) -> JogRecord:
    """What a session showed of the robot and its servos. Raises JogError."""
    reader.wait()
    assert reader.manifest is not None
    servos = ServosConfig.model_validate(reader.manifest.config["servos"])
    known = reader.manifest.known
    roll = np.radians(known.steering.roll_deg if known is not None and known.steering is not None else 0.0)
    pictures: list[tuple[float, Floats, float]] = []
    joints: dict[float, tuple[float, float]] = {}
    moved = 0
    for place in range(len(reader)):
        if (row := reader.row(place)) is None:
            continue
        states = (row.bus or {}).get("servos") or ()
        if len(states) == len(servos.joints) and all(state.get("position_mm") is not None for state in states):
            at_mm = [float(state["position_mm"]) for state in states]
            bend, pitch = wires_bend_mm(at_mm[servos.places(JointKind.TENDON)], servos.tendons)
            across = (np.cos(roll) * bend + np.sin(roll) * pitch) * MAX_PULL_MM / servos.max_pull_mm
            joints[min(state["time_s"] for state in states)] = across, sum(at_mm[servos.places(JointKind.ADVANCE)])
        moved += row.scene.refusal is not None and row.scene.refusal.reason is Reason.BENCH_MOVED
        is_due = not pictures or row.captured_s - pictures[-1][0] > 0.9 / _PICTURES_HZ
        if is_due and (seen := seen_robot(row.scene, bench)) is not None:
            pictures.append((row.captured_s, *seen))
    if moved > _MOVED_SHARE * len(reader):
        raise JogError(f"{reader.folder}: the camera or the phantom moved; fix them, and record the jog again")
    if len(joints) < 2:
        raise JogError(f"{reader.folder}: has no positions of the servos: record while you drive the robot")
    joint_s = np.array(sorted(joints))
    bend_mm, feed_mm = np.array([joints[time_s] for time_s in joint_s]).T
    time_s, body_mm, length_mm = (np.array([one[place] for one in pictures]) for place in range(3))
    return JogRecord(time_s, body_mm, length_mm, joint_s, bend_mm, feed_mm)


def check_jog(jog: JogRecord, name: str) -> None:
    """Raise JogError where one half has too little motion to tell something."""
    times = np.linspace(jog.time_s[0], jog.time_s[-1], 3)
    for half, (start_s, end_s) in zip(("first", "second"), pairwise(times), strict=True):
        within = (jog.joint_s >= start_s) & (jog.joint_s <= end_s)
        bend, feed = (values[within] if within.any() else np.zeros(1) for values in (jog.bend_mm, jog.feed_mm))
        ways = (float(bend.max()), -float(bend.min()), float(np.ptp(feed)))
        if min(ways[:2]) < LEAST_BEND_MM or ways[2] < LEAST_FEED_MM:
            raise JogError(
                f"{name}: no jog: in its {half} half the head was pulled {max(ways[0], 0.0):.1f} mm to the right, "
                f"{max(ways[1], 0.0):.1f} mm to the left, and fed {ways[2]:.0f} mm; {LEAST_BEND_MM:g} mm each and "
                f"{LEAST_FEED_MM:g} mm are needed"
            )


def seen_robot(scene: Scene, bench: IdentifiedBench) -> tuple[Floats, float] | None:
    """Places on the robot (6, 2) and its length beyond the port, in mm; None where it is not seen, or too short."""
    if scene.path is None or scene.pose is None:
        return None
    line, port = bench.view.unproject(scene.points_to_source(scene.path.points)), bench.port
    along = geometry.arc_length(line)
    if along[-1] <= BEHIND_MM[-1]:
        return None
    _, at_mm, _ = geometry.nearest(line, (float(port.point[0]), float(port.point[1])), along)
    hidden_mm = max(0.0, float((line[0] - port.point) @ port.inward)) if at_mm == 0.0 else 0.0  # straight, before the picture
    return body_of(line), float(along[-1]) - at_mm + hidden_mm


def body_of(line_mm: Points) -> Points:
    """The places (6, 2) on the robot's line, tail -> head."""
    along = geometry.arc_length(line_mm)
    return geometry.point_at(line_mm, along, along[-1] - BEHIND_MM)


def turn_deg(body_mm: Floats) -> Floats:
    """The head's turn (N,) against the shaft behind it, positive to the right."""
    head, base = body_mm[:, 0] - body_mm[:, 1], body_mm[:, -2] - body_mm[:, -1]
    cross, dot = base[:, 0] * head[:, 1] - base[:, 1] * head[:, 0], (base * head).sum(axis=1)
    return np.asarray(np.degrees(np.arctan2(cross, dot)))


def carried_mm(pull_mm: Floats, play_mm: float) -> Floats:
    """What play lets through of a pull (M,)."""
    at, half, found = 0.0, play_mm / 2, np.empty(len(pull_mm))
    for place, pull in enumerate(pull_mm.tolist()):
        at = max(pull - half, min(pull + half, at))
        found[place] = at
    return found


def first_guess(jog: JogRecord) -> Floats:
    """The parameters without physics: the feed by the visible length, the others by the head's turn."""
    values = {name: one.start for name, one in PARAMETERS.items()}
    fed = np.diff(jog.feed_mm, prepend=jog.feed_mm[0])
    forward, back = (np.interp(jog.time_s, jog.joint_s, np.cumsum(way)) for way in (fed.clip(min=0.0), fed.clip(max=0.0)))

    def feed_error(x: Floats) -> Floats:
        return np.asarray(x[0] + x[1] * forward + x[2] * back - jog.length_mm)

    start_mm, share_forward, share_back = least_squares(feed_error, [jog.length_mm[0], 1.0, 1.0], loss="soft_l1", f_scale=0.5).x
    values |= {"start_mm": start_mm - ROBOT_RADIUS_MM, "feed_share": share_back, "feed_slip": 1.0 - share_forward / share_back}
    names = _NAMES[:5]
    turned = turn_deg(jog.body_mm)

    def bend_error(x: Floats, delay_s: float) -> Floats:
        right, left, slack_right, slack_left, play, kept_deg = x
        pull = np.interp(jog.time_s - delay_s, jog.joint_s, carried_mm(jog.bend_mm, play))
        bent = right * np.maximum(0.0, pull - slack_right) - left * np.maximum(0.0, -pull - slack_left)
        return np.asarray(_SEEN_SHARE * bent + kept_deg - turned)

    limits = [[*(getattr(PARAMETERS[name], end) for name in names), kept] for end, kept in (("low", -30.0), ("high", 30.0))]
    start, steps = [*(values[name] for name in names), 0.0], [*(PARAMETERS[name].step for name in names), 1.0]
    fits = [
        (least_squares(partial(bend_error, delay_s=d), start, bounds=limits, loss="soft_l1", f_scale=2.0, x_scale=steps), d)
        for d in (0.0, 0.06, 0.12, 0.18, 0.24, 0.32, 0.4)
    ]
    fit, delay_s = min(fits, key=lambda found: float(found[0].cost))
    values |= dict(zip(names, fit.x[:5], strict=True)) | {"delay_s": delay_s}
    return np.asarray(np.clip([values[name] for name in _NAMES], _LOW, _HIGH))


def target_of(phantom: Phantom, jog: JogRecord) -> int:
    """The end of the phantom whose way is nearest to the head where it was fed farthest."""
    x, y = jog.body_mm[int(np.argmax(jog.length_mm)), 0].tolist()
    return min(phantom.targets, key=lambda node: geometry.nearest(RouteFollower(phantom, node).route, (x, y))[0])


def predicted(phantom: Phantom, target: int, jog: JogRecord, values: Floats) -> Floats:
    """The robot's places (N, 6, 2) in the twin whose joints move as the jog's did, by parameters in the order of ``PARAMETERS``."""
    v = dict(zip(_NAMES, values.tolist(), strict=True))
    drive = DriveProperties(
        backlash_mm=v["play_mm"],
        dead_zone_mm=v["slack_right_mm"],
        dead_zone_left_mm=v["slack_left_mm"],
        gain=(v["bend_right_deg_per_mm"] / NOMINAL_DEG_PER_MM, v["bend_left_deg_per_mm"] / NOMINAL_DEG_PER_MM),
    )
    head_ei = Specimen().tip_ei
    robot = Specimen(v["shaft_to_head"] * head_ei, head_ei, friction=v["friction"], tip_set_deg=v["set_deg"])
    physics = TwinPhysics(phantom, 0, drive, specimen=robot)
    follower = RouteFollower(phantom, target)
    while (left_mm := v["start_mm"] - physics.insertion_mm) > 0.02:
        speed_mm_s = min(_INSERT_MM_S, left_mm / _STEP_S)
        physics.step(follower.command(physics.robot_points_mm(), speed_mm_s, _STEP_S), _STEP_S)
    before_s = float(jog.time_s[0])
    physics.step(Command(bend=float(np.interp(before_s - v["delay_s"], jog.joint_s, jog.bend_mm)) / MAX_PULL_MM), _REST_S)
    found = np.empty_like(jog.body_mm)
    for place, now_s in enumerate(jog.time_s.tolist()):
        count = max(1, round((now_s - before_s) / _STEP_S))
        times = np.linspace(before_s, now_s, count + 1) - v["delay_s"]  # not by the drive, which knows steps of 2 ms only
        bends = np.interp(times[1:], jog.joint_s, jog.bend_mm) / MAX_PULL_MM
        fed = np.diff(np.interp(times, jog.joint_s, jog.feed_mm)) * v["feed_share"]
        fed *= np.where(fed > 0.0, 1.0 - v["feed_slip"], 1.0)
        step_s, before_s = (now_s - before_s) / count, now_s
        if step_s > 0.0:
            for bend, way in zip(bends.tolist(), fed.tolist(), strict=True):
                physics.step(Command(bend=bend, advance_mm_s=way / step_s), step_s)
        found[place] = body_of(with_caps(physics.robot_points_mm(), ROBOT_RADIUS_MM))
    return found


Spread = Callable[[Callable[[tuple[int, Floats]], tuple[int, Floats]], Sequence[tuple[int, Floats]]], Iterable[tuple[int, Floats]]]
"""Calls a function for all tasks, in any order, over processes or not (``map``)."""


def _predict_task(phantom: Phantom, target: int, jog: JogRecord, task: tuple[int, Floats]) -> tuple[int, Floats]:
    return task[0], predicted(phantom, target, jog, task[1])


def identify(phantom: Phantom, jog: JogRecord, session: str, servos: ServosConfig, spread: Spread = map) -> BehaviourConfig:
    """Fit the first half of a jog; the second one tells how well it predicts. Raises FloatingPointError as the physics does."""
    middle_s = float(jog.time_s[0] + jog.time_s[-1]) / 2
    half, target = jog.between(-np.inf, middle_s), target_of(phantom, jog)
    values, errors = refined(phantom, target, half, first_guess(half), spread)
    error, later = predicted(phantom, target, jog, values) - jog.body_mm, jog.time_s >= middle_s
    away = np.linalg.norm(error[later, 0] - error[~later].mean(axis=(0, 1)), axis=1)
    return _behaviour(values, _WITHIN * errors, away, session, servos.max_pull_mm / MAX_PULL_MM)


def refined(phantom: Phantom, target: int, jog: JogRecord, start: Floats, spread: Spread = map) -> tuple[Floats, Floats]:
    """Parameters (P,) that fit the whole jog better than `start`, and their standard errors (P,)."""
    found = _varied(phantom, target, jog, start, spread)
    errors = np.linalg.norm(found[-1] - jog.body_mm, axis=2)
    weights = 1.0 / np.maximum(_LEAST_NOISE_MM, np.median(errors, axis=0))[:, None]

    def weighed(body_mm: Floats) -> Floats:
        # Without each place's mean: what lies above or below the plane of the scale is seen shifted, and perception errs alike.
        return np.asarray(((body_mm - body_mm.mean(axis=0)) * weights).ravel())

    def all_errors(scaled: Floats) -> Floats:
        away = (scaled * _STEPS - start)[_HIDDEN] / _SPREAD[_HIDDEN]
        return np.concatenate([weighed(predicted(phantom, target, jog, scaled * _STEPS)) - seen, away])

    seen, here = weighed(jog.body_mm), weighed(found[-1])
    slope = np.column_stack([weighed(found[place]) - here for place in range(len(start))])
    known = np.diag(_STEPS / _SPREAD)[_HIDDEN]
    # The slopes of the start serve throughout: it is near, and each of these runs costs one, not one for each parameter.
    fit = least_squares(
        all_errors,
        np.clip(start, _LOW, _HIGH) / _STEPS,
        lambda _: np.vstack([slope, known]),
        bounds=(_LOW / _STEPS, _HIGH / _STEPS),
        loss="soft_l1",
        max_nfev=_MOST_RUNS,
    )
    errors_of = _standard_errors(slope, fit.fun[: len(seen)], np.repeat(jog.time_s, 2 * len(weights)), known.T @ known)
    return fit.x * _STEPS, errors_of * _STEPS


def _varied(phantom: Phantom, target: int, jog: JogRecord, start: Floats, spread: Spread) -> dict[int, Floats]:
    """What is ``predicted`` by `start` (-1), and with each parameter one step larger."""
    tasks = [(place, start + _STEPS * (np.arange(len(start)) == place)) for place in range(-1, len(start))]
    return dict(spread(partial(_predict_task, phantom, target, jog), tasks))


def _standard_errors(slope: Floats, errors: Floats, time_s: Floats, known: Floats) -> Floats:
    """Of the parameters (P,), by slopes (N, P), errors (N,) that are alike within a second, and what was known before (P, P)."""
    inverse = np.linalg.pinv(slope.T @ slope + known)
    second = np.floor(time_s).astype(int)
    pulls = np.array([slope[second == one].T @ errors[second == one] for one in np.unique(second)])
    correction = len(pulls) / max(1, len(pulls) - slope.shape[1])
    return np.asarray(np.sqrt(np.maximum(0.0, np.diag(inverse @ (pulls.T @ pulls + known) @ inverse)) * correction))


def _behaviour(values: Floats, spread: Floats, away_mm: Floats, session: str, real_mm: float) -> BehaviourConfig:
    """As it is kept, in mm of the joints (`real_mm` to one of the twin)."""
    parts: dict[str, Any] = {}
    for name, value, half, low, high in zip(_TOLD, values, spread, _LOW, _HIGH, strict=False):
        unit = _unit(name, real_mm)
        ends = (max(low, value - half), min(high, value + half))
        parts[name] = Estimate(value=round(value * unit, 5), low=round(ends[0] * unit, 5), high=round(ends[1] * unit, 5))
    p50_mm, p95_mm = np.percentile(away_mm, [50, 95]).round(3).tolist()
    return BehaviourConfig(session=session, head_p50_mm=p50_mm, head_p95_mm=p95_mm, **parts)


def _unit(name: str, real_mm: float) -> float:
    """Of a parameter, in mm of joints of which `real_mm` are one of the twin's."""
    return 1.0 / real_mm if name.endswith("deg_per_mm") else real_mm if name.endswith("_mm") else 1.0


@dataclass(frozen=True, slots=True)
class Explanation:
    """Of a run whose head was ``away_mm`` (median) from that of its replay in the identified twin.

    ``values`` : of the parameter that would explain it, or of two of which either one would; {}: no single one does. ``left_mm`` is
    what is left of the distance with that.
    """

    away_mm: float
    left_mm: float
    values: dict[str, float]


def explained(phantom: Phantom, run: JogRecord, known: BehaviourConfig, servos: ServosConfig, spread: Spread = map) -> Explanation:
    """Which parameter, if it were another than `known`, explains how a run went.

    The joints' motion is replayed in the twin, and again with each parameter changed. A likelihood with all parameters within what
    is known of them is compared with those where one of them is free; the best one, or two as good, is named where it is clearly
    better than that and than the others, and a replay with it comes clearly nearer.

    Raises JogError for too short a run, and FloatingPointError.
    """
    if len(run.time_s) < _LEAST_PICTURES:
        raise JogError("the robot is seen for too short a time to explain the run")
    real_mm, target = servos.max_pull_mm / MAX_PULL_MM, target_of(phantom, run)
    start = np.array([one.start for one in PARAMETERS.values()])
    start[_NAMES.index("start_mm")] = run.length_mm[0] - ROBOT_RADIUS_MM
    deviation = _SPREAD.copy()
    for place, name in enumerate(_TOLD):
        one: Estimate = getattr(known, name)
        start[place] = one.value / _unit(name, real_mm)
        deviation[place] = max((one.high - one.low) / 3.92 / _unit(name, real_mm), 0.02 * _STEPS[place])
    found = _varied(phantom, target, run, start, spread)
    away = np.linalg.norm(found[-1][:, 0] - run.body_mm[:, 0], axis=1)
    lost = np.flatnonzero(away > _LOST_MM)
    seen = slice(0, max(_LEAST_PICTURES, int(lost[0])) if len(lost) else len(away))
    scale = 1.0 / (max(2 * _LEAST_NOISE_MM, known.head_p50_mm) * np.sqrt(_ALIKE))

    def scaled(change_mm: Floats) -> Floats:
        return np.asarray(scale * (change_mm[seen] - change_mm[seen].mean(axis=0)).ravel())

    misses = scaled(run.body_mm - found[-1])
    slopes = np.column_stack([scaled(found[place] - found[-1]) for place in range(len(start))])
    within = (_STEPS / deviation) ** 2
    nothing, _ = _likelihood(misses, slopes, within)
    freed = [_likelihood(misses, slopes, np.where(np.arange(len(start)) == place, 0.0, within)) for place in range(len(_TOLD))]
    most = nothing - _likelihood(misses, slopes, np.where(_HIDDEN, within, 0.0))[0]
    gains = nothing - np.array([cost for cost, _ in freed])
    best, away_mm = int(np.argmax(gains)), float(np.median(away[seen]))
    equals = [place for place in np.argsort(-gains).tolist() if gains[place] >= _AS_WELL * gains[best]]
    if gains[best] < max(_CLEARLY, _ALONE * most) or len(equals) > _NAMED:
        return Explanation(round(away_mm, 2), round(away_mm, 2), {})
    values: dict[str, float] = {}
    left_mm = away_mm
    for place in equals:
        changed = np.clip(start + freed[place][1] * _STEPS, _LOW, _HIGH)
        left = np.linalg.norm(predicted(phantom, target, run, changed)[:, 0] - run.body_mm[:, 0], axis=1)
        if (still_mm := float(np.median(left[seen]))) <= (1.0 - _MOST) * away_mm:
            values[_TOLD[place]] = round(float(changed[place] * _unit(_TOLD[place], real_mm)), 4)
            left_mm = min(left_mm, still_mm)
    return Explanation(round(away_mm, 2), round(left_mm, 2), values)


def _likelihood(misses: Floats, slopes: Floats, within: Floats) -> tuple[float, Floats]:
    """Minus twice the logarithm of the likelihood (Huber's), and the parameters (P,) in steps, where they are known `within`."""
    steps: Floats = np.zeros(len(within))
    weight: Floats = np.ones(len(misses))
    limit = 3.0 / np.sqrt(_ALIKE)
    for _ in range(10):
        normal = (slopes * weight[:, None]).T
        steps = np.asarray(np.linalg.lstsq(normal @ slopes + np.diag(within), normal @ misses)[0])
        left = np.abs(misses - slopes @ steps)
        weight = np.asarray(limit / np.maximum(limit, left))
    return float(np.where(left < limit, left**2, 2 * limit * left - limit**2).sum() + (within * steps**2).sum()), steps
