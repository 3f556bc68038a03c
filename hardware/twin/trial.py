"""One closed-loop trial in the twin, in lock-step: picture -> perception -> policy -> drive -> robot, against the truth.

Only the simulated clock is used, so the same seed and settings give the same bits. The latency between picture and motion is
simulated as a delay of whole frames.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from core import geometry
from core.config.models import Config
from core.control.direction_monitor import DirectionMonitor, MotionSent, head_seen
from core.control.motion import AdviceController
from core.control.policies import Policy, make_policy
from core.devices import UserError
from core.evaluation.accuracy import TrueMasks
from core.evaluation.trial import Row, TrialLog, TrialSample, trial_row
from core.perception.centerline import plan_route
from core.perception.pipeline import Pipeline
from core.types import Advice, Command, Frame, Point, Points, Scene, Speed
from hardware.twin.catalog import RANDOM_LOOK
from hardware.twin.phantom import Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import DriveProperties
from hardware.twin.rendering.appearance import named_appearance
from hardware.twin.truth import RouteFollower
from hardware.twin.view import CameraView
from hardware.twin.world import TwinCamera, TwinWorld

FIRST_SEED = 2_000_000
"""Seed of phantom, look and robot of trial 0; training sets use lower seeds."""
REACHED_MM = 5.0
DELAY_FRAMES = 2
"""67 ms at 30 frames per second; capture to servo may take 100 ms."""
_START_MM, _START_MOST_MM, _BEFORE_JUNCTION_MM = 22.0, 45.0, 12.0
_BEFORE_END_MM = 6.0
_LEAST_WAY_MM = 60.0
_MARGIN_PX = 14.0
_MEASURE_EVERY = 3
_SETTLE_S = 0.5
_STOPPED_S = 2.0
_NO_PROGRESS_S, _PROGRESS_MM = 40.0, 2.0  # enough to back out of a missed branch and to try again
_HELP_S, _HELP_MM_S, _MAX_HELP = 1.0, 5.0, 5


@dataclass(frozen=True, slots=True)
class TrialPlan:
    """Settings of all trials of a campaign.

    ``true_masks``: the twin's masks in place of the network's. ``look`` of ``TRIAL_LOOKS``: every trial has another look, of any
    of the ten families or of the named one, or all have the default clear bench. ``own``: in the configured phantom, a bench's, not
    in random ones; ``target_px``: to the place in the vessel that is nearest to this one of the picture, not to a random end.
    """

    config: Config
    true_masks: bool = False
    max_seconds: float = 120.0
    look: str = RANDOM_LOOK
    own: bool = False
    target_px: Point | None = None


class TargetError(UserError):
    """There is no way to the place that was chosen; one line says why."""


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """The end ``node``, the ``route`` (N, 2) to it in board mm, the position ``at_mm`` along it, and the operator's click."""

    node: int
    route: Points
    at_mm: float
    point_mm: Point
    click_px: Point


def choose_target(phantom: Phantom, view: CameraView, seed: int) -> Target:
    """A random end to which the route is visible; the click lies on the centerline shortly before the end.

    For an end outside the picture the click lies where the route leaves the picture.
    """
    targets = [_target_at(phantom, view, node) for node in phantom.targets]
    whole = [t for t in targets if t.at_mm >= _LEAST_WAY_MM]
    if not whole:
        return max(targets, key=lambda t: t.at_mm)
    return whole[int(np.random.default_rng([seed, 30011]).integers(len(whole)))]


def target_near(phantom: Phantom, view: CameraView, click_px: Point) -> Target:
    """The place on the way to an end that is nearest to a click. Raises TargetError beside the vessel, or at its port."""
    x, y = view.unproject(np.array([click_px]))[0].tolist()
    graph = phantom.graph
    if min(geometry.nearest(edge.points, (x, y))[0] - float(edge.radius.max()) for edge in graph.edges) > 0.0:
        raise TargetError(f"the target ({click_px[0]:.0f}, {click_px[1]:.0f}) is not in the vessel; click into its lumen")
    routes = [(node, RouteFollower(phantom, node).route) for node in phantom.targets]
    node, route = min(routes, key=lambda found: geometry.nearest(found[1], (x, y))[0])
    along = geometry.arc_length(route)
    at_mm = min(geometry.nearest(route, (x, y), along)[1], float(along[-1]) - _BEFORE_END_MM)
    if at_mm < _START_MM + REACHED_MM:
        raise TargetError(f"the target is {at_mm:.0f} mm from the port, where the robot begins; choose one further in")
    point = geometry.point_at(route, along, np.array([at_mm]))
    (x, y), (across, down) = point[0].tolist(), view.project(point)[0].tolist()
    return Target(node, route, at_mm, (x, y), (across, down))


def _target_at(phantom: Phantom, view: CameraView, node: int) -> Target:
    follower = RouteFollower(phantom, node)
    along = geometry.arc_length(follower.route)
    pixels = view.project(follower.route)
    limit = np.array(view.size) - 1 - _MARGIN_PX
    hidden = np.any((pixels < _MARGIN_PX) | (pixels > limit), axis=1) & (along > _START_MM)
    seen_mm = float(along[int(np.argmax(hidden))]) if hidden.any() else follower.length_mm
    at_mm = min(seen_mm, follower.length_mm - _BEFORE_END_MM)
    point = geometry.point_at(follower.route, along, np.array([at_mm]))
    click = view.project(point)[0]
    return Target(node, follower.route, at_mm, (float(point[0, 0]), float(point[0, 1])), (float(click[0]), float(click[1])))


def start_mm(phantom: Phantom, target: Target) -> float:
    """Insertion before the trial: shortly before the first bifurcation, so that autonomy has to take all of them."""
    graph = phantom.graph
    degree = np.bincount([node for edge in graph.edges for node in (edge.start, edge.end)], minlength=len(graph.nodes))
    places = [geometry.nearest(target.route, (x, y))[:2] for x, y in graph.nodes[degree >= 3].tolist()]
    first_mm = min((along for away, along in places if away < 0.5), default=math.inf)
    return max(_START_MM, min(_START_MOST_MM, first_mm - _BEFORE_JUNCTION_MM, target.at_mm - _LEAST_WAY_MM / 2))


class Trial:
    """One trial; ``run`` returns its row.

    `pipeline` is reset; None where ``_perceive`` is another one. `masks` is the segmentation of the pipeline when it runs on true
    masks, else None. `drive` is the play of the wires.
    """

    def __init__(
        self,
        plan: TrialPlan,
        seed: int,
        policy: str,
        pipeline: Pipeline | None,
        masks: TrueMasks | None = None,
        drive: DriveProperties | None = None,
    ) -> None:
        config, own_seed = plan.config, FIRST_SEED + seed
        phantom = make_phantom(config.twin.phantom if plan.own else f"random:{own_seed}")
        self._plan, self._seed, self._name = plan, seed, policy
        look = named_appearance(None if plan.look == RANDOM_LOOK else plan.look, own_seed)
        self._world = TwinWorld(
            config.twin,
            phantom=phantom,
            appearance=look,
            perception=config.perception,
            seed=own_seed,
            servos=config.servos,
            safety=config.safety,
            drive=drive,
        )
        view = self._world.view
        self.target = (
            choose_target(phantom, view, own_seed) if plan.target_px is None else target_near(phantom, view, plan.target_px)
        )
        self._start_mm = start_mm(phantom, self.target)
        self._camera = TwinCamera(self._world, lock_step=True)
        self._pipeline, self._masks = pipeline, masks
        if pipeline is not None:
            pipeline.reset()
        self._policy: Policy = make_policy(policy, config, own_seed)
        self._drive = AdviceController(config.policy.drive)
        self._direction = DirectionMonitor()
        self._wrong_way = False
        self._operator = _Operator(config.safety.pose_disarm_s)
        self._manual = RouteFollower(phantom, self.target.node)
        self._log = TrialLog()
        self._delayed = deque([Command()] * DELAY_FRAMES)
        self._backing_off = False
        self._first_mm = self._left_mm = self._best_mm = math.inf
        self._best_s = 0.0
        self._reached_s: float | None = None
        self._stopped_s: float | None = None

    def run(self) -> Row:
        """Run until the target is reached or the trial has failed."""
        world = self._world
        world.insert(self._start_mm, target=self.target.node)
        start_s = world.physics.time_s
        outcome = ""
        while not outcome:
            try:
                outcome = self._run_frame(start_s)
            except FloatingPointError:  # never seen; a campaign of hundreds must not end with it
                outcome = "physics diverged"
        return trial_row(
            self._log,
            seed=self._seed,
            policy=self._name,
            phantom=world.phantom.name,
            outcome=outcome,
            way_mm=self._first_mm - self._left_mm if math.isfinite(self._first_mm) else 0.0,
            target_mm=self.target.point_mm,
        )

    def _run_frame(self, start_s: float) -> str:
        """Process one frame; returns the outcome, "" while the trial goes on."""
        frame = self._read()
        scene = self._perceive(frame)
        status = self._world.physics.status()
        is_sure = scene.pose is None or scene.pose.confidence >= self._plan.config.safety.min_confidence
        advice = self._policy(scene, replace(status, wall_contact_n=None)) if is_sure else None  # no real rig measures it
        if scene.pose is not None and scene.route is None:
            advice = None  # autonomy has to hold
        self._watch_direction(scene)
        self._delayed.append(self._command(advice, frame.captured_s))
        self._world.send(self._delayed.popleft())
        time_s, contact_n = frame.captured_s - start_s, status.wall_contact_n or 0.0
        self._log.count(scene.pose, scene.refusal.reason.value if scene.refusal else "", contact_n)
        if len(self._log.forces_n) % _MEASURE_EVERY == 1:
            self._measure(scene, time_s, status.insertion_mm, contact_n)
        return self._outcome(time_s, advice)

    def _perceive(self, frame: Frame) -> Scene:
        assert self._pipeline is not None
        return self._pipeline(frame, self.target.click_px)

    def _read(self) -> Frame:
        if self._masks is None:
            frame = self._camera.read(0.0)
            assert frame is not None
            return frame
        world = self._world
        world.advance(1.0 / world.config.frames_per_second)
        picture = world.picture(world.physics.robot_points_mm(), world.physics.delivery_mm)
        self._masks.show(picture.vessel, picture.robot)
        return Frame(len(self._log.forces_n), world.physics.time_s, picture.image)

    def _command(self, advice: Advice | None, now_s: float) -> Command:
        # Computed in every frame, so that its progress along the route is up to date.
        manual = self._manual.command(self._world.physics.robot_points_mm(), _HELP_MM_S, 1.0 / self._world.config.frames_per_second)
        helping = self._operator.acts(advice is not None, now_s)
        if helping is None:
            backing_off = advice is not None and advice.advance_mm_s < 0.0
            self._log.back_offs += backing_off and not self._backing_off
            self._backing_off = backing_off
            command = self._drive.command(advice, now_s, turns=self._direction.turns, feeds=self._direction.feeds)
            sent_s = now_s + DELAY_FRAMES / self._world.config.frames_per_second
            turn_deg = command.bend * self._plan.config.policy.drive.turn_deg
            self._direction = self._direction.drive(MotionSent(sent_s, turn_deg, command.advance_mm_s))
            return command
        if helping:
            self._log.interventions += 1
        self._policy.reset()
        self._drive.take_over(manual.bend)
        self._direction = DirectionMonitor()
        return manual

    def _watch_direction(self, scene: Scene) -> None:
        """Count when the robot seems to go the other way, which would end autonomy: it is wired right, so each is a false alarm."""
        config, pose = self._plan.config, scene.pose
        is_sure = pose is not None and pose.confidence >= config.safety.min_confidence  # as for the pilot
        head = head_seen(scene, config.policy.pursuit.pixels_per_mm) if is_sure else None
        self._direction = self._direction.observe(head) if head is not None else self._direction
        before, self._wrong_way = self._wrong_way, bool(self._direction.faults())
        self._log.direction_alarms += self._wrong_way and not before

    def _measure(self, scene: Scene, time_s: float, insertion_mm: float, wall_contact_n: float) -> None:
        truth = self._world.truth(self.target.click_px)
        theta_error = head_error = None
        if scene.pose is not None and scene.path is not None and truth.pose is not None and truth.head_xy is not None:
            theta_error = abs((scene.pose.theta_signed_deg - truth.pose.theta_signed_deg + 180.0) % 360.0 - 180.0)
            head_error = math.dist(scene.path.head, truth.head_xy)
        d_px = None
        if truth.offset_ratio is not None and truth.lumen_radius_px is not None:
            d_px = truth.offset_ratio * truth.lumen_radius_px
        head_mm = self._world.physics.head_mm
        self._log.measures.append(
            TrialSample(
                time_s=time_s,
                head_mm=head_mm,
                insertion_mm=insertion_mm,
                wall_contact_n=wall_contact_n,
                d_px=d_px,
                offset_ratio=truth.offset_ratio,
                head_clearance_mm=truth.head_clearance_mm,
                theta_error_deg=theta_error,
                head_error_px=head_error,
            )
        )
        self._update_progress(head_mm, time_s)

    def _update_progress(self, head_mm: Point, time_s: float) -> None:
        """Remaining distance on the phantom's graph, and the time of the last progress."""
        left = plan_route(self._world.phantom.graph, head_mm, self.target.point_mm)
        assert left is not None  # a phantom is connected
        self._left_mm = left.length_px
        if math.isinf(self._first_mm):
            self._first_mm = self._left_mm
        if self._left_mm < self._best_mm - _PROGRESS_MM:
            self._best_mm, self._best_s = self._left_mm, time_s
        if self._reached_s is None and math.dist(head_mm, self.target.point_mm) <= REACHED_MM:
            self._reached_s = time_s

    def _outcome(self, time_s: float, advice: Advice | None) -> str:
        """The outcome, "" while the trial goes on."""
        stopped = advice is not None and advice.speed is Speed.STOP
        if self._reached_s is not None and (stopped or time_s - self._reached_s >= _SETTLE_S):
            return "reached"
        if self._log.interventions > _MAX_HELP:
            return "lost"
        self._stopped_s = (time_s if self._stopped_s is None else self._stopped_s) if stopped else None
        if self._stopped_s is not None and time_s - self._stopped_s >= _STOPPED_S:
            return "stopped short"
        if time_s - self._best_s >= _NO_PROGRESS_S:
            return "stuck"
        return "time out" if time_s >= self._plan.max_seconds else ""


class _Operator:
    """Takes over for a second (5 mm) when there was no advice for longer than `patience_s`."""

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self._well_s: float | None = None
        self._until_s = -math.inf

    def acts(self, advised: bool, now_s: float) -> bool | None:
        """None: autonomy goes on. True: the operator takes over now. False: the operator is still driving."""
        if now_s < self._until_s:
            self._well_s = now_s
            return False
        if advised or self._well_s is None:
            self._well_s = now_s
            return None
        if now_s - self._well_s <= self._patience_s:
            return None
        self._until_s, self._well_s = now_s + _HELP_S, now_s
        return True
