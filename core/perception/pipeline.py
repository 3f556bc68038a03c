"""All stages in the order of the data's way: frame -> masks -> skeletons -> path, centerline -> vectors -> pose, or a refusal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import perf_counter

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config.models import PathConfig, PerceptionConfig
from core.perception import compiled, quality, robot_path, segmentation, skeleton
from core.perception.centerline import find as find_centerline
from core.perception.centerline import route_or_reason
from core.perception.inference import open_second_look, open_segmenter
from core.perception.out_of_distribution import OutOfDistributionReference
from core.perception.pose import StateFilter, measure
from core.perception.quality import ConfidenceCalibration, collect
from core.perception.roi import Background, VesselAverage, look
from core.perception.segmentation import Recognised, Segmenter, Turned, recognise, robot_beside, to_working
from core.perception.tip_refinement import MOST_LOOKS, TipRefinement
from core.perception.tracking import PreviousFrame, RouteMemory, StreamState, check_in_view, check_jump, recall, remember
from core.perception.vectors import fit_robot_vector, fit_vessel_vector
from core.perception.vessel_graph import build_graph
from core.types import Frame, Image, Mask, Masks, Point, Reason, Refusal, Scene, Skeletons, VesselGraph, Window


class _Stopwatch:
    """Milliseconds per stage."""

    def __init__(self) -> None:
        self._start = perf_counter()
        self.latency_ms: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        before = perf_counter()
        try:
            yield
        finally:
            self.latency_ms[name] = self.latency_ms.get(name, 0.0) + (perf_counter() - before) * 1e3

    def finish(self, scene: Scene) -> Scene:
        self.latency_ms["total"] = (perf_counter() - self._start) * 1e3
        return replace(scene, latency_ms=self.latency_ms)


@dataclass(frozen=True, slots=True)
class Sight:
    """A network as it is asked, and what its evidence means (None: not calibrated).

    `swings`: how steady an answer is belongs to its evidence. It takes some four times as long as the geometry alone.
    `familiarity`: what kind of pictures the network knows (None: nobody has told). `all_orientations`: it looks at each picture in
    all of them.
    """

    segment: Segmenter
    calibration: ConfidenceCalibration | None = None
    swings: bool = False
    familiarity: OutOfDistributionReference | None = None
    all_orientations: bool = False


_EDGE_PX = 4
"""Around what a mask shows the probability falls off so far."""


class Pipeline:
    """Perception of single images or of a stream.

    A call perceives a frame of a stream: the last frames decide between near-equal paths, an impossible jump of the head is
    refused, and the state is steadied. ``perceive_single`` knows nothing of other frames and leaves the stream's memory alone;
    it may look with another `single` sight, which takes its time. With a `glance`, a sight that may be shown a part of a picture,
    most frames of a stream are looked at around the robot's head only (``glance.py``), and the others, each in another orientation,
    tell together what is vessel (``standing_vessel.py``).
    """

    def __init__(
        self,
        segmenter: Segmenter,
        config: PerceptionConfig,
        calibration: ConfidenceCalibration | None = None,
        single: Sight | None = None,
        glance: Sight | None = None,
        familiarity: OutOfDistributionReference | None = None,
        *,
        swings: bool = False,
    ) -> None:
        compiled.load()  # not with the first picture
        self._stream = Sight(segmenter, calibration, swings, familiarity)
        self._single = single or self._stream
        self._offered = glance
        self._glance = glance if config.tracking.window_px else None
        self._config = config
        self._states = StateFilter(config.pose)
        self._past = StreamState(config.tracking)
        self._shape: tuple[int, ...] | None = None

    @property
    def engine(self) -> str:
        """Where the network runs, in words."""
        return self._stream.segment.engine

    def with_config(self, config: PerceptionConfig) -> Pipeline:
        """The same networks under other thresholds, with no memory; what is set of the networks themselves is not looked at."""
        stream = self._stream
        return Pipeline(
            stream.segment,
            config,
            stream.calibration,
            single=self._single,
            glance=self._offered,
            familiarity=stream.familiarity,
            swings=stream.swings,
        )

    def follow_on(self, before: Pipeline) -> None:
        """Go on with the stream that `before` perceives, under other thresholds; may be asked while it does.

        Which end of the robot is the head does not hang on them, and one picture alone may not tell it. All else begins anew.
        """
        if before._config.working_size_px == self._config.working_size_px:
            self._past.memory, self._shape = before._past.memory, before._shape

    def warm_up(self) -> None:
        """Compile the networks for a stream of 4:3 pictures. Else the first pictures wait for it, up to a second each."""
        side, window = self._config.working_size_px, self._config.tracking.window_px
        segment = self._stream.segment
        segment(np.zeros((round(0.75 * side), side, 3), np.uint8))
        if self._glance is not None:
            glance = self._glance.segment
            robot_beside(glance, np.zeros((window, window), np.float32), np.zeros((window, window, 3), np.uint8))
            if isinstance(glance, TipRefinement):
                glance.warm_up_beside()
        if isinstance(segment, TipRefinement):
            segment.warm_up()

    def reset(self) -> None:
        """Forget the stream's past."""
        self._past.forget()
        self._states.forget()

    def perceive_single(self, frame: Frame, target: Point | None = None) -> Scene:
        """A frame by itself; `target` is the operator's destination in source pixels."""
        watch = _Stopwatch()
        return watch.finish(self._perceive(frame, target, watch, self._single))

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        """The next frame of a stream; `target` is the operator's destination in source pixels."""
        tracking, past = self._config.tracking, self._past
        if not tracking.enabled:
            watch = _Stopwatch()
            return watch.finish(self._perceive(frame, target, watch, self._stream))
        if frame.image.shape != self._shape:  # another camera or another mode of it: what is remembered lies in other pixels
            self.reset()
            self._shape = frame.image.shape
        watch = _Stopwatch()
        scene = self._perceive(frame, target, watch, self._stream, past)
        if past.memory is not None and tracking.memory_s and recall(past.memory, frame.captured_s, tracking) is None:
            self._states.forget()  # after a pause, or wound back: the state of then says nothing of now
        if scene.pose is not None and scene.path is not None:
            refusal = check_jump(scene.path, past.memory, frame.captured_s, tracking)
            if refusal is None:
                assert scene.masks is not None
                past.memory = remember(scene.path, scene.masks.robot, past.memory, frame.captured_s, self._config)
                past.lookalikes.learn(scene.path, frame.captured_s)
                refusal = check_in_view(past.memory, self._config)
            else:
                past.lookalikes.doubt()  # the camera was moved, perhaps; or it is one bad frame
            if refusal is not None:
                scene = replace(scene, pose=None, refusal=refusal)
        past.routes.settle(is_believed=scene.pose is not None)
        if self._glance is not None:
            past.glances.remember(scene)
        return watch.finish(replace(scene, pose=self._states.update(scene.pose, scene.captured_s)))

    def _perceive(
        self, frame: Frame, target: Point | None, watch: _Stopwatch, sight: Sight, past: StreamState | None = None
    ) -> Scene:
        config = self._config
        height, width = frame.image.shape[:2]
        with watch.stage("prepare"):
            image, scale_xy = to_working(frame.image, config.working_size_px)
            refusal = quality.check_image(image, config.quality)
            chosen = None
            if past is not None and self._glance is not None and refusal is None:
                chosen = past.glances.choose(image, frame.captured_s, past.refresh_s)
        scene = Scene(frame.index, frame.captured_s, (width, height), scale_xy[0 if width >= height else 1], scale_xy=scale_xy)
        if refusal is not None:
            return replace(scene, refusal=refusal)
        if chosen is not None and self._glance is not None:
            sight = self._glance
            scene = self._see_window(scene, image, chosen, sight, watch, past)
        else:
            scene = self._see_all(scene, image, sight, watch, past)
        unlike = self._check_kind(scene, past)
        if scene.refusal is not None:
            return replace(scene, refusal=quality.hinted(scene.refusal, unlike))
        before = past.recall(frame.captured_s) if past is not None else PreviousFrame()
        scene = self._locate(scene, image, target, watch, before, past.routes if past is not None else None)
        if scene.refusal is None and unlike is not None:
            # What was found is kept: it is what somebody who teaches the model this rig begins with.
            scene = replace(scene, refusal=unlike)
        return scene if scene.refusal is not None else self._judge(scene, image, target, watch, sight, before)

    def _check_kind(self, scene: Scene, past: StreamState | None) -> Refusal | None:
        """Whether the picture is of a kind that the model does not know. A stream remembers; a window tells nothing of it."""
        refusal = quality.check_kind(scene.novelty, self._config.quality, refused_before=past is not None and past.unlike)
        if past is not None and scene.novelty is not None:
            past.unlike = refusal is not None
        return refusal

    def _see_all(self, scene: Scene, image: Image, sight: Sight, watch: _Stopwatch, past: StreamState | None) -> Scene:
        """Masks, skeletons and vessel graph of the whole working image (h, w, 3)."""
        turns = past is not None and self._glance is not None and not self._glance.all_orientations
        standing = past.next_look() if past is not None and turns else None
        with watch.stage("network"):
            if standing is None:
                vessel_probability, robot_probability, signature = recognise(sight.segment, [image])[0]
            else:
                vessel_probability, robot_probability, signature = _recognise_turned(sight.segment, image, standing)
        if (broken := quality.check_finite(vessel_probability, robot_probability)) is not None:
            return _unseen(scene, vessel_probability, robot_probability, broken)
        with watch.stage("masks"):
            if standing is not None and past is not None:
                vessel_probability = standing.add(vessel_probability, robot_probability, past.glances.cells, past.glances.noise)
            found = segmentation.clean(vessel_probability, robot_probability, self._config)
            if past is not None:
                found = replace(found, robot=past.lookalikes.without(found.robot, image, scene.captured_s))
            known = sight.familiarity
            # At another size the same picture is another one to the network; without a vessel half of a signature says nothing.
            if known is not None and known.working_size_px == self._config.working_size_px and found.vessel.any():
                scene = replace(scene, novelty=known.novelty(signature) if signature is not None else None)
        return self._draw(scene, found, watch)

    def _draw(self, scene: Scene, found: Masks, watch: _Stopwatch) -> Scene:
        """Skeletons and vessel graph of the masks found."""
        config = self._config
        scene = replace(scene, masks=found, refusal=quality.check_masks(found))
        if scene.refusal is not None:
            return scene
        with watch.stage("skeletons"):
            skeletons = skeleton.thin_masks(found, config)
        with watch.stage("gaps"):
            skeletons = skeleton.repair(skeletons, config.gaps)
        with watch.stage("graph"):
            # Walls are looked for at 0.5, the mask ends where the user has said.
            below = np.float32(0.5 - config.segmentation.vessel_threshold)
            level = found.vessel_probability + below if below else found.vessel_probability
            graph = build_graph(skeletons.vessel, found.vessel, config.cleaning, level)
        return replace(scene, skeletons=skeletons, vessel_graph=graph, refusal=quality.check_graph(graph, config.vectors))

    def _see_window(
        self,
        scene: Scene,
        image: Image,
        chosen: tuple[Background, Window],
        sight: Sight,
        watch: _Stopwatch,
        past: StreamState | None,
    ) -> Scene:
        """The same, with only the robot in the window seen anew."""
        config, (known, window) = self._config, chosen
        with watch.stage("network"):
            robot_probability = look(sight.segment, image, window, known)
        if (broken := quality.check_finite(robot_probability)) is not None:
            return _unseen(replace(scene, window=window), known.vessel_probability, robot_probability, broken)
        with watch.stage("masks"):
            robot = segmentation.clean_robot(robot_probability, config)
            robot = past.lookalikes.without(robot, image, scene.captured_s, window) if past is not None else robot
            found = Masks(known.vessel, robot, known.vessel_probability, robot_probability)
        scene = replace(scene, window=window, masks=found, refusal=quality.check_masks(found))
        if scene.refusal is not None:
            return scene
        with watch.stage("skeletons"):
            skeletons = Skeletons(vessel=known.vessel_skeleton, robot=skeleton.thin_robot(robot, config))
        with watch.stage("gaps"):
            skeletons = skeleton.repair(skeletons, config.gaps)
        return replace(scene, skeletons=skeletons, vessel_graph=known.graph)

    def _locate(
        self,
        scene: Scene,
        image: Image,
        target: Point | None,
        watch: _Stopwatch,
        before: PreviousFrame,
        routes: RouteMemory | None = None,
    ) -> Scene:
        """The robot's path, the way to the target, the centerline's piece and both vectors, or why one of them is not to be had."""
        config, found, skeletons, graph = self._config, scene.masks, scene.skeletons, scene.vessel_graph
        assert found is not None
        assert skeletons is not None
        assert graph is not None
        with watch.stage("path"):
            path = robot_path.find(
                skeletons,
                found,
                config,
                before.path,
                graph,
                _port(config.path, image),
                before.ends,
                came_from_within=before.came_from_within,
            )
        if isinstance(path, Refusal):
            return replace(scene, refusal=path)
        with watch.stage("pose"):
            if target is not None:
                scene = _with_route(scene, graph, path.head, scene.to_working(target), found.vessel, routes)
            elif routes is not None:
                routes.forget()
            robot_vector = fit_robot_vector(path.points, config.vectors.robot_length_px, config.vectors.line_fit)
            scene = replace(scene, path=path, robot_vector=robot_vector)
            refusal = quality.check_path(path, found, config)
            if robot_vector is None or refusal is not None:
                return replace(scene, refusal=refusal or Refusal(Reason.TOO_SHORT, "it has no direction"))
            centerline = find_centerline(
                graph, skeletons.vessel, path.head, robot_vector.direction, config.vectors, scene.route, found.vessel
            )
            vessel_vector = fit_vessel_vector(centerline, config.vectors.line_fit) if centerline is not None else None
            refusal = quality.check_centerline(centerline, path.head, config.quality)
            if refusal is None and vessel_vector is None:
                refusal = Refusal(Reason.NO_VESSEL, "the centerline beside the head has no direction")
            return replace(scene, centerline=centerline, vessel_vector=vessel_vector, refusal=refusal)

    def _judge(
        self, scene: Scene, image: Image, target: Point | None, watch: _Stopwatch, sight: Sight, before: PreviousFrame
    ) -> Scene:
        """The pose of what was located, with its evidence and confidence, or the quality gate's word against it."""
        config, found, path, centerline = self._config, scene.masks, scene.path, scene.centerline
        robot, vessel = scene.robot_vector, scene.vessel_vector
        assert found is not None
        assert path is not None
        assert centerline is not None
        assert robot is not None
        assert vessel is not None
        with watch.stage("pose"):
            refusal = quality.check_walls(found, path.head, config.quality)
            if refusal is not None:
                return replace(scene, refusal=refusal)
            pose = measure(robot, vessel, config.pose)
            believed = _believed(found, before.none)
            evidence = collect(path, robot, centerline, believed, config)
        if sight.swings:
            with watch.stage("steadiness"):
                others = [
                    self._answer(scene, image, target, segmentation.clean(*shifted, config), before)
                    for shifted in quality.neighbours(believed)
                ]
                theta, head = quality.swings((path.head, pose.theta_signed_deg), others)
                evidence = replace(evidence, theta_swing=theta, head_swing=head)
        scene = replace(scene, evidence=evidence.values())
        if sight.calibration is not None:
            confidence = sight.calibration.confidence(evidence)
        else:
            confidence = quality.confidence(path, centerline, found, config)
        refusal = quality.check_confidence(confidence, config.quality)
        if refusal is not None:
            return replace(scene, refusal=refusal)
        return replace(scene, pose=replace(pose, confidence=confidence))

    def _answer(
        self, scene: Scene, image: Image, target: Point | None, found: Masks, before: PreviousFrame
    ) -> quality.Answer | None:
        """Head and signed theta of the same frame with other masks; None for a refusal."""
        watch = _Stopwatch()
        bare = Scene(scene.frame_index, scene.captured_s, scene.source_size, scene.scale, scale_xy=scene.scale_xy)
        bare = self._draw(bare, found, watch)
        if bare.refusal is None:
            bare = self._locate(bare, image, target, watch, before)
        if bare.refusal is not None or bare.path is None or bare.robot_vector is None or bare.vessel_vector is None:
            return None
        return bare.path.head, measure(bare.robot_vector, bare.vessel_vector, self._config.pose).theta_signed_deg


def _recognise_turned(segmenter: Segmenter, image: Image, standing: VesselAverage) -> Recognised:
    """``recognise`` in the orientation whose turn it is."""
    vessel, robot, signature = recognise(segmenter, [standing.turned(image)])[0]
    return standing.upright(vessel), standing.upright(robot), signature


def _unseen(scene: Scene, vessel: NDArray[np.float32], robot: NDArray[np.float32], why: Refusal) -> Scene:
    """A scene in which nothing was found, with what the network gave: whoever drives has to hear of it."""
    return replace(scene, masks=Masks(np.zeros(vessel.shape, bool), np.zeros(robot.shape, bool), vessel, robot), refusal=why)


def _believed(found: Masks, none: Mask | None) -> Masks:
    """The masks with a robot's probability (h, w) of 0 around `none` (h, w), what a stream knows to be no robot."""
    if none is None:
        return found
    x, y, width, height = cv2.boundingRect(none.view(np.uint8))
    box = slice(max(0, y - _EDGE_PX), y + height + _EDGE_PX), slice(max(0, x - _EDGE_PX), x + width + _EDGE_PX)
    around = cv2.dilate(none[box].view(np.uint8), np.ones((2 * _EDGE_PX + 1, 2 * _EDGE_PX + 1), np.uint8)) > 0
    probability = found.robot_probability.copy()
    probability[box][around & ~found.robot[box]] = 0.0
    return replace(found, robot_probability=probability)


def _with_route(scene: Scene, graph: VesselGraph, head: Point, target: Point, vessel: Mask, routes: RouteMemory | None) -> Scene:
    """The way to the target in working px, or why there is none; in a stream `routes` remembers what was found before."""
    way = route_or_reason(graph, head, target, vessel)
    if routes is not None:
        way = routes.follow(way, head, target, vessel, scene.captured_s)
    return replace(scene, route_problem=way) if isinstance(way, str) else replace(scene, route=way)


def _port(config: PathConfig, image: Image) -> Point | None:
    """The insertion port in the working image; None where nobody has told it."""
    if config.port_x_share is None or config.port_y_share is None:
        return None
    height, width = image.shape[:2]
    return config.port_x_share * (width - 1), config.port_y_share * (height - 1)


def open_pipeline(config: PerceptionConfig, *, recalibrating: bool = False) -> Pipeline:
    """Load the configured model and build the pipeline around it; raises ModelError. `recalibrating`: as ``open_sights`` has it."""
    plain, turned = open_sights(config, recalibrating=recalibrating)
    stream = turned if config.segmentation.mirrored == "always" else plain
    single = plain if config.segmentation.mirrored == "never" else turned
    return Pipeline(stream.segment, config, stream.calibration, single, stream, stream.familiarity, swings=stream.swings)


def open_sights(config: PerceptionConfig, *, recalibrating: bool = False) -> tuple[Sight, Sight]:
    """The configured model as it looks at a picture once, and in all its orientations; raises ModelError.

    A model whose confidence was calibrated on fewer second looks, or without swings, goes on like that; `recalibrating`, as it will
    be from then on.
    """
    segmenter, near = open_segmenter(config.segmentation), open_second_look(config.segmentation)
    info = segmenter.info
    plain: Segmenter = segmenter
    turned: Segmenter = Turned(segmenter)
    if near is not None:
        if recalibrating or info.calibration is None:
            looks = MOST_LOOKS
        else:
            looks = info.mirrored_second_looks if info.calibration_mirrored is not None else 1
        plain, turned = TipRefinement(plain, near), TipRefinement(turned, Turned(near), looks=looks)
    surest = info.calibration_mirrored or info.calibration
    swings = recalibrating or (surest is not None and surest.needs_swings)
    known = info.familiarity if not recalibrating else None
    return Sight(plain, info.calibration, familiarity=known), Sight(turned, surest, swings, known, all_orientations=True)


class NoPerception:
    """Stands in when no model can be loaded: every frame is refused, with the reason and what to do."""

    def __init__(self, problem: str) -> None:
        self._refusal = Refusal(Reason.NO_MODEL, problem)

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        height, width = frame.image.shape[:2]
        return Scene(frame.index, frame.captured_s, (width, height), 1.0, refusal=self._refusal, latency_ms={"total": 0.0})
