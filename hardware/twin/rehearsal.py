"""Rehearsal: many runs to one target of a bench's own phantom, with other friction, stiffness, start and play in each.

Before the runs, the robot is perceived in the twin's pictures all along the way. A run then paints nothing, which takes a tenth of
the time: it perceives the truth with the errors, or without an answer, as in a picture whose head was nearest. Where one was not
sure, more are taken, since only another noise may move a head on that rests there. The geometry alone tells which branches on the
way turn off more sharply than the head bends.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.config.calibration import BehaviourConfig, Estimate
from core.config.models import Config
from core.control.look_ahead import sharp_branches
from core.evaluation.metrics import wilson_95
from core.evaluation.rehearsal import FedMoment, RehearsedWay, SharpBranch, WeakestPlace, way_per_feed
from core.evaluation.trial import Row, TrialSample, summarise
from core.perception.centerline import centerline_at, plan_route
from core.perception.pipeline import open_pipeline
from core.perception.pose import measure_pose
from core.perception.vectors import fit_robot_vector, fit_vessel_vector
from core.types import Frame, Image, Masks, Point, Points, Reason, Refusal, RobotPath, Scene
from hardware.twin.phantom import Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import MAX_PULL_MM, ROBOT_RADIUS_MM, DriveProperties
from hardware.twin.rendering.appearance import Appearance, appearance_of, make_view
from hardware.twin.trial import FIRST_SEED, Target, TargetError, Trial, TrialPlan, start_mm, target_near
from hardware.twin.truth import RouteFollower, heading, true_graph, visible_path, with_caps
from hardware.twin.view import CameraView
from hardware.twin.world import TwinWorld

BEND_DEG_PER_MM = 47.0
"""Bend of the head per millimetre of pull, as measured in the twin."""
SPEEDS = (1.0, 0.7, 0.5)
"""Shares of the configured speeds that are tried, the next one only where the one before fails the limits."""
LEAST_SHARE, FORCE_P95_N, FORCE_MAX_N = 0.95, 0.15, 0.5
"""A speed is recommended where so many runs arrive, and the wall force stays below these."""
PLAY_MM, SLACK_MM, START_MM = (0.03, 0.2), (0.0, 0.06), 5.0
"""Spread of the play and of the slack of the wires, and of the insertion at the start to both sides; uniform."""
WANDERS = (0.0, 0.4, 0.8)
"""How far the robot sways on the ways on which it is perceived in pictures (``RouteFollower``)."""
_PICTURE_S, _PICTURE_MM_S = 0.1, 10.0
"""Time between the pictures, and speed."""
_LOOKS = 5
"""At one place, until perception is sure."""
_RESTS_MM = 0.05
"""A head that moves by less between two frames is seen in any of the pictures of its place."""
_LINE_PX = 40.0
"""Length of the robot's end over which an error of the head fades out."""
_HEADING_PX = 10.0
"""Over so much of its end the robot's direction is taken."""
_COMMANDS = 5
"""To the robot for each picture of the way."""
_NICENESS = 10
_BIN_MM = 10.0
"""Length of the pieces of the way among which the weakest is looked for."""
_STEP_MM, _BESIDE_MM = 2.5, 12.0
"""Spacing of the places where all runs are compared; a head further from the way is in another branch."""
_BLANK: Image = np.zeros((1, 1, 3), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class SeenHeads:
    """What perception gives in pictures of the way.

    Attributes
    ----------
    heads_mm : true heads (N, 2), on the board; several pictures may have the same, and the first is what a head that passes shows.
    errors_mm : of the perceived ones, along the robot and to its right (N, 2); NaN: no answer.
    confidence : (N,).
    """

    heads_mm: Points
    errors_mm: Points
    confidence: NDArray[np.float64]

    @staticmethod
    def joined(parts: Sequence[SeenHeads]) -> SeenHeads:
        return SeenHeads(*(np.concatenate([getattr(one, name) for one in parts]) for name in SeenHeads.__slots__))

    @property
    def missing(self) -> float:
        """Share of the places without an answer in their first picture; others were taken only where that was not sure."""
        first = np.unique(self.heads_mm, axis=0, return_index=True)[1]
        return float(np.isnan(self.errors_mm[first, 0]).mean())


def seen_heads(config: Config, target: Target, wander: float) -> SeenHeads:
    """Drive the twin's robot to `target` in its pictures, a picture every millimetre, and perceive each; at low priority.

    Raises UserError where the model or the bench cannot be opened, and TargetError where the camera never sees the head.
    """
    _give_way()
    one = config.perception.segmentation.model_copy(update={"threads": 1})
    pipeline = open_pipeline(config.perception.model_copy(update={"segmentation": one}))
    world = TwinWorld(config.twin, perception=config.perception, servos=config.servos, safety=config.safety)
    view, scale = world.view, config.perception.working_size_px / max(world.view.size)
    x, y = view.project(np.array([target.point_mm]))[0].tolist()
    follower = RouteFollower(world.phantom, target.node, wander=wander)
    first_mm = max(5.0, start_mm(world.phantom, target) - START_MM)
    world.insert(first_mm, target=target.node)
    heads, errors, confidence, looks = [], [], [], 0
    for _ in range(round(1.2 * (target.at_mm - first_mm) / (_PICTURE_S * _PICTURE_MM_S))):
        for _ in range(_COMMANDS):
            dt_s = _PICTURE_S / _COMMANDS
            world.send(follower.command(world.physics.robot_points_mm(), _PICTURE_MM_S, dt_s))
            world.advance(dt_s)
        robot = world.physics.robot_points_mm()
        path = visible_path(with_caps(robot, world.appearance.robot_radius_mm), view, scale)
        if path is None:
            continue
        head_mm, ahead = world.physics.head_mm, _in_frame(heading(path, _HEADING_PX))
        px_per_mm = view.pixels_per_mm(head_mm) * scale
        for _ in range(_LOOKS):
            looks += 1  # each at a later time, though the robot rests
            scene = pipeline(world.frame(world.physics.time_s + looks / config.twin.frames_per_second), (x, y))
            error = np.full(2, np.nan)
            if scene.pose is not None and scene.path is not None and scene.route is not None:
                error = ahead @ np.subtract(scene.path.head, path[-1]) / px_per_mm
            heads.append(head_mm)
            errors.append(error)
            confidence.append(scene.pose.confidence if scene.pose is not None else 0.0)
            if not np.isnan(error[0]) and confidence[-1] >= config.safety.min_confidence:
                break
        if math.dist(head_mm, target.point_mm) < _STEP_MM:
            break
    if not heads:
        raise TargetError("the camera never sees the robot on the way to this target; choose another")
    return SeenHeads(np.array(heads), np.array(errors), np.array(confidence))


def _give_way() -> None:
    """Other processes go first from now on."""
    os.setpriority(os.PRIO_PROCESS, 0, max(os.getpriority(os.PRIO_PROCESS, 0), _NICENESS))


def _in_frame(ahead: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turns a vector of the picture into its parts along a unit vector and to the right of it."""
    return np.array([ahead, [-ahead[1], ahead[0]]])


@dataclass(frozen=True, slots=True)
class RehearsalPlan:
    """``trial`` has phantom and target; ``seen`` is how perception does on the way; ``speed`` is a share."""

    trial: TrialPlan
    seen: SeenHeads
    speed: float = 1.0


def rehearse_once(plan: RehearsalPlan, seed: int) -> Row:
    """One run, at low priority."""
    _give_way()
    return Rehearsal(plan, seed).run()


class Rehearsal(Trial):
    """One run of a rehearsal: a trial with a drawn play and start, which perceives without pictures."""

    def __init__(self, plan: RehearsalPlan, seed: int) -> None:
        rng = np.random.default_rng([FIRST_SEED + seed, 60013])
        config, drive = slowed(plan.trial.config, plan.speed), None
        if (known := config.twin.behaviour) is not None:
            config = config.model_copy(update={"twin": config.twin.model_copy(update={"behaviour": drawn(known, rng)})})
        else:
            drive = DriveProperties(backlash_mm=float(rng.uniform(*PLAY_MM)), dead_zone_mm=float(rng.uniform(*SLACK_MM)))
        trial = replace(plan.trial, config=config)
        super().__init__(trial, seed, trial.config.policy.name, None, drive=drive)
        self._start_mm = max(5.0, self._start_mm + float(rng.uniform(-START_MM, START_MM)))
        self._eye, self._rng = plan, rng
        view = self._world.view
        self._scale = trial.config.perception.working_size_px / max(view.size)
        self._graph = true_graph(self._world.phantom, view, self._scale)
        self._masks_shown = _vessel_masks(self._world, self._scale)
        self._error_px: float | None = None
        self._last_mm: Point = (math.inf, math.inf)
        self._fed: list[FedMoment] = []

    def run(self) -> Row:
        """The row, with the ``way_per_feed``."""
        return super().run() | {"way_per_feed": way_per_feed(self._fed)}

    def _read(self) -> Frame:
        self._world.advance(1.0 / self._world.config.frames_per_second)
        return Frame(len(self._log.forces_n), self._world.physics.time_s, _BLANK)

    def _perceive(self, frame: Frame) -> Scene:
        """The true scene, with the errors of a picture."""
        config, world = self._plan.config.perception, self._world
        scene, seen = Scene(frame.index, frame.captured_s, world.view.size, self._scale), self._eye.seen
        radius_mm, head_mm = world.appearance.robot_radius_mm, world.physics.head_mm
        px_per_mm = world.view.pixels_per_mm(head_mm) * self._scale
        path = visible_path(with_caps(world.physics.robot_points_mm(), radius_mm), world.view, self._scale)
        away = np.linalg.norm(seen.heads_mm - head_mm, axis=1)
        pictures, rests = np.flatnonzero(away == away.min()), math.dist(head_mm, self._last_mm) < _RESTS_MM
        picture, self._last_mm = int(self._rng.choice(pictures) if rests else pictures[0]), head_mm
        error_mm, confidence, self._error_px = seen.errors_mm[picture], float(seen.confidence[picture]), None
        if path is None or np.isnan(error_mm[0]):
            return replace(scene, refusal=Refusal(Reason.LOW_CONFIDENCE))
        self._error_px = float(np.hypot(*error_mm)) * px_per_mm
        path = _displaced(path, px_per_mm * error_mm)
        robot = RobotPath(path, 1.0, None, True, 0.0, radius_mm * px_per_mm)
        line = fit_robot_vector(path, config.vectors.robot_length_px)
        route = plan_route(self._graph, robot.head, scene.to_working(self.target.click_px))
        centerline = None
        if line is not None:
            centerline = centerline_at(self._graph, robot.head, line.direction, config.vectors.vessel_half_length_px, route)
        vessel = fit_vessel_vector(centerline) if centerline is not None else None
        scene = replace(scene, masks=self._masks_shown, path=robot, vessel_graph=self._graph, route=route, centerline=centerline)
        if line is None or vessel is None:
            return replace(scene, refusal=Refusal(Reason.NO_VESSEL))
        pose = replace(measure_pose(line, vessel, config.pose), confidence=confidence)
        return replace(scene, robot_vector=line, vessel_vector=vessel, pose=pose)

    def _measure(self, scene: Scene, time_s: float, insertion_mm: float, wall_contact_n: float) -> None:
        """Without the truth of pose and vessel, which takes a third of a run's time."""
        head_mm = self._world.physics.head_mm
        self._log.measures.append(TrialSample(time_s, head_mm, insertion_mm, wall_contact_n, head_error_px=self._error_px))
        self._fed.append((time_s, geometry.nearest(self.target.route, head_mm)[1], self._world.command.advance_mm_s))
        self._update_progress(head_mm, time_s)


def _displaced(path: Points, error_px: Points) -> Points:
    """The robot's path (N, 2) with its end displaced along it and to its right."""
    along = geometry.arc_length(path)
    share = np.clip(1.0 - (along[-1] - along) / _LINE_PX, 0.0, 1.0)
    return np.asarray(path + share[:, None] * (error_px @ _in_frame(heading(path, _HEADING_PX))))


def _vessel_masks(world: TwinWorld, scale: float) -> Masks:
    """The true vessel at working size, without a robot."""
    vessel = world.picture(world.physics.robot_points_mm()).vessel.astype(np.float32)
    size = round(world.view.size[0] * scale), round(world.view.size[1] * scale)
    seen = np.asarray(cv2.resize(vessel, size, interpolation=cv2.INTER_AREA), np.float32)
    return Masks(seen >= 0.5, np.zeros(seen.shape, bool), seen, np.zeros(seen.shape, np.float32))


def drawn(known: BehaviourConfig, rng: np.random.Generator) -> BehaviourConfig:
    """A robot within the intervals of what was identified."""
    estimates = {name: one for name, one in known if isinstance(one, Estimate)}
    values = {
        name: float(np.clip(rng.normal(one.value, (one.high - one.low) / 3.92), one.low, one.high))
        for name, one in estimates.items()
    }
    return known.model_copy(update={name: one.model_copy(update={"value": values[name]}) for name, one in estimates.items()})


def slowed(config: Config, share: float) -> Config:
    """The configuration with this share of all advised speeds."""
    names = ("slowest_mm_s", "slow_mm_s", "moderate_mm_s", "fast_mm_s")
    advice = config.advice.model_copy(update={name: share * getattr(config.advice, name) for name in names})
    return config.model_copy(update={"advice": advice})


def is_good(summary: Mapping[str, Any]) -> bool:
    """Whether the sums over runs (``summarise``) meet the limits of a recommended speed."""
    p95, most = summary["wall_force_p95_n"] or 0.0, summary["wall_force_max_n"] or 0.0
    return bool(summary["reached_share"] >= LEAST_SHARE and p95 <= FORCE_P95_N and most <= FORCE_MAX_N)


def is_hopeless(rows: Sequence[Mapping[str, Any]], count: int) -> bool:
    """Whether `count` runs that begin with these cannot be good any more."""
    failed = sum(not row["reached"] for row in rows)
    return failed > (1.0 - LEAST_SHARE) * count + 1e-9 or any(row["wall_contact_n"]["max"] > FORCE_MAX_N for row in rows)


@dataclass(frozen=True, slots=True, eq=False)
class RehearsalPicture:
    """The picture whose pixels are told, and the way to the target in it; the runs have their target at ``trial_px``."""

    phantom: Phantom
    view: CameraView
    target: Target
    trial_px: Point

    @staticmethod
    def of(config: Config, target: Point, size_px: tuple[int, int] | None = None) -> RehearsalPicture:
        """The picture of this size, else of the twin's. Raises TargetError."""
        own_px = config.twin.image_width_px, config.twin.image_height_px
        phantom = make_phantom(config.twin.phantom)
        view = make_view(appearance_of(config.twin), size_px or own_px, phantom)
        found = target_near(phantom, view, target)
        x, y = make_view(Appearance(), own_px, phantom).project(np.array([found.point_mm]))[0].tolist()
        return RehearsalPicture(phantom, view, found, (x, y))

    def pixels(self, points_mm: Points | Sequence[Point]) -> list[Point]:
        return [(round(x, 1), round(y, 1)) for x, y in self.view.project(np.asarray(points_mm, np.float64)).tolist()]

    def sharp(self, config: Config) -> list[SharpBranch]:
        """The branches on the way that are too sharp for the twin's robot, or for the weaker side of an identified one.

        A warning (``sharp_branches``): of the trial seeds 100 to 199 it names six (108, 149, 167, 179, 184, 186); one run of each:
        two stopped short, three arrived with 0.2 to 0.4 N at the wall, one easily.
        """
        bend_deg = BEND_DEG_PER_MM * MAX_PULL_MM
        if (known := config.twin.behaviour) is not None:
            sides = (known.bend_right_deg_per_mm, known.slack_right_mm), (known.bend_left_deg_per_mm, known.slack_left_mm)
            bend_deg = min(bend.value * (config.servos.max_pull_mm - slack.value) for bend, slack in sides)
        turns = sharp_branches(self.phantom.graph, self.target.route, ROBOT_RADIUS_MM, bend_deg, (0.0, self.target.at_mm))
        return [
            SharpBranch(xy=self.pixels([point_mm])[0], turn_deg=round(turn_deg, 1), limit_deg=round(limit_deg, 1))
            for point_mm, turn_deg, limit_deg in turns
        ]

    def weakest(self, rows: Sequence[Row]) -> WeakestPlace | None:
        """Where runs ended before the target, or else where the wall force is largest (95th percentile); None: nowhere."""
        route = self.target.route
        along = geometry.arc_length(route)

        def place(x: float, y: float) -> int:
            return int(geometry.nearest(route, (x, y), along)[1] // _BIN_MM)

        tracks = [(row["reached"], row["track"]) for row in rows]
        ends = [place(track["x_mm"][-1], track["y_mm"][-1]) for reached, track in tracks if not reached and track["x_mm"]]
        forces: dict[int, list[float]] = {}
        for _, track in tracks:
            for x, y, force in zip(track["x_mm"], track["y_mm"], track["wall_contact_n"], strict=True):
                forces.setdefault(place(x, y), []).append(force)
        worst = {number: float(np.percentile(values, 95)) for number, values in forces.items()}
        if not worst:
            return None
        number = max(set(ends), key=ends.count) if ends else max(worst, key=worst.__getitem__)
        at = (number + 0.5) * _BIN_MM
        points = geometry.point_at(route, along, at + np.array([-10.0, -5.0, 0.0, 5.0, 10.0]))
        (ax, ay), (bx, by) = points[1] - points[0], points[4] - points[3]
        return WeakestPlace(
            xy=self.pixels(points[2:3])[0],
            along_mm=round(at, 1),
            turn_deg=round(abs(math.degrees(math.atan2(ax * by - ay * bx, ax * bx + ay * by))), 1),
            ended_here=ends.count(number),
            wall_force_p95_n=round(worst.get(number, 0.0), 4),
        )

    def way(self, rows: Sequence[Row]) -> RehearsedWay:
        """The band of head paths, wall force and time along the way; places that no head passed are left out."""
        along = geometry.arc_length(self.target.route)
        at = np.arange(0.0, along[-1] + _STEP_MM, _STEP_MM)
        places = geometry.point_at(self.target.route, along, at)
        across = geometry.normals(places)
        found = np.full((3, max(1, len(rows)), len(at)), np.nan)  # offset, force, time
        for number, row in enumerate(rows):
            track = row["track"]
            heads = np.column_stack([track["x_mm"], track["y_mm"]])
            if not len(heads):
                continue
            away = heads[:, None] - places[None]
            nearest = np.argmin(np.linalg.norm(away, axis=2), axis=1)
            offset = np.sum(away[np.arange(len(heads)), nearest] * across[nearest], axis=1)
            is_beside = np.linalg.norm(away[np.arange(len(heads)), nearest], axis=1) <= _BESIDE_MM
            force, time_s = np.array(track["wall_contact_n"]), np.array(track["time_s"])
            for place in np.unique(nearest[is_beside]).tolist():
                here = is_beside & (nearest == place)
                found[:, number, place] = offset[here].mean(), force[here].max(), time_s[here].min()
        runs = np.sum(~np.isnan(found[0]), axis=0)
        there = np.flatnonzero(runs)
        if not len(there):
            return RehearsedWay()
        offset, force, time_s = found[:, :, there]
        band = np.nanpercentile(offset, (50, 5, 95), axis=0)[..., None] * across[there] + places[there]
        middle, low, high = (tuple(self.pixels(line)) for line in band)
        return RehearsedWay(
            along_mm=at[there].tolist(),
            xy=middle,
            low_xy=low,
            high_xy=high,
            wall_force_n=np.nanpercentile(force, 95, axis=0).round(4).tolist(),
            time_s=np.nanpercentile(time_s, (5, 50, 95), axis=0).T.round(2).tolist(),
            runs=runs[there].tolist(),
        )

    def found(self, rows: Sequence[Row]) -> dict[str, Any]:
        """The figures, the weakest place, and what happened along the way, as ``RehearsalResult`` has them."""
        weakest = self.weakest(rows)
        parts = {"weakest": weakest.model_dump(mode="json") if weakest else None, "way": self.way(rows).model_dump(mode="json")}
        shares = [share for row in rows if (share := row.get("way_per_feed")) is not None]
        parts["way_per_feed"] = np.percentile(shares, (5, 50, 95)).round(4).tolist() if shares else None
        return figures(rows) | parts


def figures(rows: Sequence[Row]) -> dict[str, Any]:
    """Share that arrived with its interval, outcomes, states, times, forces."""
    sums = summarise(rows)
    times = [row["time_s"] for row in rows if row["reached"]]
    states = {name: [row["state_shares"][name] for row in rows if row["state_shares"][name] is not None] for name in "ABCD"}
    low, high = wilson_95(sums["reached_share"], len(rows))
    return {
        "runs": len(rows),
        "arrived": {"share": sums["reached_share"], "low": round(low, 4), "high": round(high, 4)},
        "outcomes": sums["outcomes"],
        "states": {name: round(float(np.mean(shares)), 4) for name, shares in states.items() if shares},
        "time_s": {"median": sums["median_time_s"], "p95": round(float(np.percentile(times, 95)), 2) if times else None},
        "wall_force_n": {"p95": sums["wall_force_p95_n"], "max": sums["wall_force_max_n"]},
    }
