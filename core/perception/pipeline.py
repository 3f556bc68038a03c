"""The stages of perception in order: frame -> masks -> skeletons -> path, centerline -> vectors -> pose, or a refusal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np
from numpy.typing import NDArray

from core.bench.bench import Bench, bench_stamp, check_size, reachable, read_bench
from core.bench.difference import beside_network, combined, robot_by_difference
from core.bench.registration import BenchView, register, window_of
from core.config.models import PathConfig, PerceptionConfig
from core.perception import compiled, quality, robot_path, segmentation, skeleton
from core.perception.centerline import find as find_centerline
from core.perception.centerline import route_or_reason
from core.perception.head_tail import PreviousPath
from core.perception.inference import open_second_look, open_segmenter
from core.perception.out_of_distribution import OutOfDistributionReference
from core.perception.pose import measure_pose
from core.perception.quality import ConfidenceCalibration, confidence_features
from core.perception.roi import Background, segment_roi
from core.perception.segmentation import LumenSizeAverage, OrientationAverage, Segmenter, inner_area, to_working
from core.perception.tip_refinement import MAX_PASSES, TipRefinement
from core.perception.tracking import RouteMemory, StreamState, check_in_view, check_jump, recall, track
from core.perception.vectors import fit_robot_vector, fit_vessel_vector
from core.perception.vessel_graph import build_graph
from core.types import (
    Centerline,
    Frame,
    Image,
    Mask,
    Masks,
    Point,
    Reason,
    Refusal,
    RobotPath,
    Scene,
    Skeletons,
    Vector,
    VesselGraph,
    Window,
)

_EDGE_PX = 4
"""Width around a mask in which the probability falls off."""


class _Stopwatch:
    """Milliseconds per stage."""

    def __init__(self) -> None:
        self._start = perf_counter()
        self._latency_ms: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        before = perf_counter()
        try:
            yield
        finally:
            self._latency_ms[name] = self._latency_ms.get(name, 0.0) + (perf_counter() - before) * 1e3

    def finish(self, scene: Scene) -> Scene:
        self._latency_ms["total"] = (perf_counter() - self._start) * 1e3
        return replace(scene, latency_ms=self._latency_ms)


@dataclass(frozen=True, slots=True)
class CalibratedSegmenter:
    """A segmenter with what its answers mean.

    ``calibration``: of its confidence; None: not calibrated. ``sensitivity``: whether the confidence features include the threshold
    sensitivity, which takes some four times as long as the geometry alone. ``known``: the kinds of pictures that the network was
    trained on; None: not recorded. ``all_orientations``: it averages over all orientations of a picture. ``is_taught``: it was
    taught on a bench, so that ``known`` is right for pictures of that bench, too.
    """

    segment: Segmenter
    calibration: ConfidenceCalibration | None = None
    sensitivity: bool = False
    known: OutOfDistributionReference | None = None
    all_orientations: bool = False
    is_taught: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _Structures:
    """Masks of a frame with their skeletons and vessel graph."""

    masks: Masks
    skeletons: Skeletons
    graph: VesselGraph


@dataclass(frozen=True, slots=True, eq=False)
class _DrawnVessel:
    """A bench's vessel with its skeleton and graph; ``mask`` is the view's own object, by which it is known again."""

    mask: Mask
    probability: NDArray[np.float32]
    skeleton: Mask
    graph: VesselGraph


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """The robot's path, the piece of centerline beside its head, and the vectors of both."""

    path: RobotPath
    robot: Vector
    centerline: Centerline
    vessel: Vector


@dataclass(slots=True, eq=False)
class _Run:
    """A frame on its way through the stages. ``scene`` holds all that was found so far, also where a later stage refuses."""

    image: Image
    target: Point | None
    scene: Scene
    watch: _Stopwatch
    state: StreamState | None = None
    view: BenchView | None = None
    drawn: _DrawnVessel | None = None

    def add(self, **found: object) -> None:
        self.scene = replace(self.scene, **found)  # type: ignore[arg-type]


class Pipeline:
    """Perception of single images or of a stream.

    A call perceives a frame of a stream: the last frames decide between nearly equal paths, an impossible jump of the head is
    refused, and the state is filtered. ``perceive_single`` uses no other frames and leaves the stream's state unchanged; it may use
    another segmenter, `single`, which takes more time. With `roi`, a segmenter that can be given a part of a picture, most frames
    of a stream are segmented only around the robot's head, and the vessel is the average over full frames (``roi.py``).

    With a `bench`, each full frame is registered against it: a vessel that was drawn takes the place of the segmented one, the
    robot is what differs from the empty bench and what the network sees there, and a picture of another place is refused.
    """

    def __init__(
        self,
        stream: Segmenter | CalibratedSegmenter,
        config: PerceptionConfig,
        *,
        single: CalibratedSegmenter | None = None,
        roi: CalibratedSegmenter | None = None,
        bench: Bench | None = None,
    ) -> None:
        self._stream = stream if isinstance(stream, CalibratedSegmenter) else CalibratedSegmenter(stream)
        self._single = single or self._stream
        self._offered_roi = roi
        self._roi = roi if config.tracking.window_px else None
        self._config = config
        self._state = StreamState(config)
        self._bench = bench
        self._drawn: _DrawnVessel | None = None

    @property
    def bench(self) -> Bench | None:
        """What is known of the bench."""
        return self._bench

    @property
    def engine(self) -> str:
        """Where the network runs, in words."""
        return self._stream.segment.engine

    def with_config(self, config: PerceptionConfig) -> Pipeline:
        """The same networks under other thresholds, at the start of a stream; ``config.segmentation`` is not read.

        Raises BenchError for another bench that cannot be read, and for another working size than the bench has.
        """
        before = self._config
        is_same = config.bench == before.bench and config.working_size_px == before.working_size_px
        if is_same and self._bench is not None and self._bench.stamp is not None and config.bench is not None:
            is_same = self._bench.stamp == bench_stamp(Path(config.bench))  # made again in the same folder
        bench = self._bench if is_same else configured_bench(config)
        return Pipeline(self._stream, config, single=self._single, roi=self._offered_roi, bench=bench)

    def with_bench(self, bench: Bench | None) -> Pipeline:
        """The same networks with another bench, at the start of a stream."""
        return Pipeline(self._stream, self._config, single=self._single, roi=self._offered_roi, bench=bench)

    def follow_on(self, before: Pipeline) -> None:
        """Continue the stream that `before` perceives, under other thresholds; may be called while it does.

        Only the tracked path is taken over: which end is the head does not depend on thresholds, and one picture may not show it.
        """
        if before._config.working_size_px == self._config.working_size_px:
            self._state.tracked, self._state.shape = before._state.tracked, before._state.shape

    def warm_up(self) -> None:
        """Compile the networks for a stream of 4:3 pictures, and load the inner loops.

        Otherwise the first pictures wait for it, up to a second each.
        """
        side, window = self._config.working_size_px, self._config.tracking.window_px
        segment = self._stream.segment
        segment(np.zeros((round(0.75 * side), side, 3), np.uint8))
        if self._roi is not None:
            beside = self._roi.segment
            beside.segment_robot_beside(np.zeros((window, window), np.float32), np.zeros((window, window, 3), np.uint8))
            if isinstance(beside, TipRefinement):
                beside.warm_up(beside=True)
        if isinstance(segment, TipRefinement):
            segment.warm_up()
        compiled.load()  # last: another thread can do it meanwhile, as compiling leaves the interpreter free

    def reset(self) -> None:
        """Begin another stream."""
        self._state = StreamState(self._config)

    def perceive_single(self, frame: Frame, target: Point | None = None) -> Scene:
        """Perceive a frame by itself; `target` is the place in source pixels that the operator clicked."""
        watch = _Stopwatch()
        return watch.finish(self._perceive(frame, target, watch, self._single))

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        """Perceive the next frame of a stream; `target` is the place in source pixels that the operator clicked."""
        tracking = self._config.tracking
        if not tracking.enabled:
            watch = _Stopwatch()
            return watch.finish(self._perceive(frame, target, watch, self._stream))
        if frame.image.shape != self._state.shape:  # another camera or another mode of it: the state is in other pixels
            self.reset()
            self._state.shape = frame.image.shape
        state, watch = self._state, _Stopwatch()
        scene = self._perceive(frame, target, watch, self._stream, state)
        if state.tracked is not None and tracking.memory_s and recall(state.tracked, frame.captured_s, tracking).path is None:
            state.pose_filter.reset()  # after a pause, or wound back
        if scene.pose is not None and scene.path is not None and scene.masks is not None:
            refusal = check_jump(scene.path, state.tracked, frame.captured_s, tracking)
            if refusal is None:
                state.tracked = track(scene.path, scene.masks.robot, state.tracked, frame.captured_s, self._config)
                state.artefacts.learn(scene.path, frame.captured_s)
                refusal = check_in_view(state.tracked, self._config)
            else:
                state.artefacts.distrust()  # the camera was moved, perhaps; or it is one bad frame
            if refusal is not None:
                scene = replace(scene, pose=None, refusal=refusal)
        state.routes.settle(is_believed=scene.pose is not None)
        if self._roi is not None:
            state.roi.update(scene)
        return watch.finish(replace(scene, pose=state.pose_filter.update(scene.pose, scene.captured_s)))

    def _perceive(
        self,
        frame: Frame,
        target: Point | None,
        watch: _Stopwatch,
        segmenter: CalibratedSegmenter,
        state: StreamState | None = None,
    ) -> Scene:
        config = self._config
        height, width = frame.image.shape[:2]
        with watch.stage("prepare"):
            image, scale_xy = to_working(frame.image, config.working_size_px)
            refusal = quality.check_image(image, config.quality)
            roi = None
            if state is not None and self._roi is not None and refusal is None:
                roi = state.roi.choose(image, frame.captured_s, state.refresh_s)
        scene = Scene(frame.index, frame.captured_s, (width, height), scale_xy[0 if width >= height else 1], scale_xy=scale_xy)
        run = _Run(image, target, scene, watch, state)
        if refusal is None and self._bench is not None:
            with watch.stage("bench"):
                refusal = self._register(run, self._bench, is_full=roi is None)
        if refusal is None:
            refusal = self._run_stages(run, segmenter, roi)
        return replace(run.scene, refusal=refusal)

    def _register(self, run: _Run, bench: Bench, *, is_full: bool) -> Refusal | None:
        """Where the bench is in this picture. A window follows a full frame from which the picture has not changed."""
        state = run.state
        before = state.view if state is not None else None
        if is_full or before is None:
            found = register(run.image, bench, before)
            if isinstance(found, Refusal):
                return found
            before = found
            if state is not None:
                state.view = found
        run.view = before
        if before.vessel is not None:
            drawn = self._drawn
            if drawn is None or drawn.mask is not before.vessel:
                self._drawn = drawn = self._trace_drawn(before.vessel)
            run.drawn = drawn
            return quality.check_graph(drawn.graph, self._config.vectors)
        return None

    def _trace_drawn(self, mask: Mask) -> _DrawnVessel:
        """Skeleton and graph of a drawn vessel (h, w), once for each place of the camera."""
        config = self._config
        probability = soft_edged(mask)
        empty = Masks(mask, np.zeros_like(mask), probability, np.zeros_like(probability))
        skeletons = skeleton.repair(skeleton.thin_masks(empty, config), config.gaps)
        return _DrawnVessel(mask, probability, skeletons.vessel, build_graph(skeletons.vessel, mask, config.cleaning, probability))

    def _run_stages(self, run: _Run, segmenter: CalibratedSegmenter, roi: tuple[Background, Window] | None) -> Refusal | None:
        if roi is not None and self._roi is not None:
            segmenter = self._roi
            structures = self._segment_roi(run, *roi)
        else:
            structures = self._segment_frame(run, segmenter)
        state, novelty = run.state, run.scene.novelty
        refused_before = state is not None and state.is_unfamiliar
        unfamiliar = quality.check_kind(novelty, self._config.quality, refused_before=refused_before)
        if run.view is not None and not segmenter.is_taught:  # a picture of the bench is known, whatever it looks like
            unfamiliar = None
        if state is not None and novelty is not None:  # a region of interest has no novelty
            state.is_unfamiliar = unfamiliar is not None
        if isinstance(structures, Refusal):
            return quality.hinted(structures, unfamiliar)
        before = PreviousPath()
        if state is not None:
            before = recall(state.tracked, run.scene.captured_s, self._config.tracking)
        located = self._locate(run, structures, before, state.routes if state is not None else None)
        if isinstance(located, Refusal):
            return located
        # What was found is kept in the scene: training for this rig begins with it.
        return unfamiliar or self._judge(run, structures.masks, located, segmenter, before)

    def _segment_frame(self, run: _Run, segmenter: CalibratedSegmenter) -> _Structures | Refusal:
        """Masks, skeletons and vessel graph of the whole working image (h, w, 3)."""
        state = run.state
        average = None
        if state is not None and self._roi is not None and not self._roi.all_orientations and run.drawn is None:
            average = state.begin_full_frame()
        with run.watch.stage("network"):
            signature = None
            if state is not None and run.drawn is not None:  # without the vessel's decoder a third of the time is saved
                vessel = run.drawn.probability
                robot = segmenter.segment.segment_robot_beside(vessel, run.image)
            else:
                image = run.image if average is None else average.orient(run.image)
                vessel, robot, signature = segmenter.segment.segment_signed([image])[0]
            if average is not None:
                vessel, robot = average.orient(vessel), average.orient(robot)
        if (broken := quality.check_finite(vessel, robot)) is not None:
            return self._refuse_output(run, vessel, robot, broken)
        with run.watch.stage("masks"):
            if average is not None and state is not None:
                vessel = average.add(vessel, robot, state.roi.cells, state.roi.noise)
            if run.drawn is not None:
                vessel = run.drawn.probability
        if run.view is not None:
            with run.watch.stage("bench"):
                robot = self._with_bench(run.view, run.image, robot, vessel)
        with run.watch.stage("masks"):
            masks = segmentation.clean(vessel, robot, self._config)
            if run.drawn is not None:
                masks = replace(masks, vessel=run.drawn.mask)
            if state is not None:
                masks = replace(masks, robot=state.artefacts.remove(masks.robot, run.image, run.scene.captured_s))
            known = segmenter.known
            # The network sees the same picture differently at another size; without a vessel half of a signature says nothing.
            if known is not None and known.working_size_px == self._config.working_size_px and masks.vessel.any():
                run.add(novelty=known.novelty(signature) if signature is not None else None)
        return self._trace(run, masks)

    def _with_bench(
        self, view: BenchView, image: Image, robot: NDArray[np.float32], vessel: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """The robot's probability (h, w) of the network and of the difference to the empty bench."""
        if view.vessel is None:  # where it was not drawn, the robot lies in the vessel that the network sees
            view = replace(view, reachable=reachable(vessel >= self._config.segmentation.vessel_threshold))
        difference = beside_network(robot_by_difference(image, view), robot, image, view)
        return combined(robot, difference, view, is_taught=self._stream.is_taught)

    def _trace(self, run: _Run, masks: Masks) -> _Structures | Refusal:
        """Skeletons and vessel graph of masks; those of a drawn vessel are known."""
        config, drawn = self._config, run.drawn
        run.add(masks=masks)
        if (refusal := quality.check_masks(masks)) is not None:
            return refusal
        if drawn is not None:
            with run.watch.stage("skeletons"):
                skeletons = Skeletons(vessel=drawn.skeleton, robot=skeleton.thin_robot(masks.robot, config))
            with run.watch.stage("gaps"):
                skeletons = skeleton.repair(skeletons, config.gaps)
            run.add(skeletons=skeletons, vessel_graph=drawn.graph)
            return _Structures(masks, skeletons, drawn.graph)
        with run.watch.stage("skeletons"):
            skeletons = skeleton.thin_masks(masks, config)
        with run.watch.stage("gaps"):
            skeletons = skeleton.repair(skeletons, config.gaps)
        with run.watch.stage("graph"):
            # Walls are found at 0.5, the mask ends at the configured threshold.
            below = np.float32(0.5 - config.segmentation.vessel_threshold)
            level = masks.vessel_probability + below if below else masks.vessel_probability
            graph = build_graph(skeletons.vessel, masks.vessel, config.cleaning, level)
        run.add(skeletons=skeletons, vessel_graph=graph)
        return quality.check_graph(graph, config.vectors) or _Structures(masks, skeletons, graph)

    def _segment_roi(self, run: _Run, background: Background, window: Window) -> _Structures | Refusal:
        """The same, with only the robot in the window segmented again."""
        assert self._roi is not None
        config, state = self._config, run.state
        run.add(window=window)
        with run.watch.stage("network"):
            robot_probability = segment_roi(self._roi.segment, run.image, window, background)
        if run.view is not None:
            with run.watch.stage("bench"):
                x, y, width, height = window
                rows, columns = inner_area(window, (run.image.shape[1], run.image.shape[0]))
                part = np.s_[y : y + height, x : x + width]
                inner = np.s_[rows.start - y : rows.stop - y, columns.start - x : columns.stop - x]
                seen = self._with_bench(
                    window_of(run.view, window), run.image[part], robot_probability[part], background.vessel_probability[part]
                )
                robot_probability[rows, columns] = seen[inner]
        if (broken := quality.check_finite(robot_probability)) is not None:
            return self._refuse_output(run, background.vessel_probability, robot_probability, broken)
        with run.watch.stage("masks"):
            robot = segmentation.clean_robot(robot_probability, config)
            if state is not None:
                robot = state.artefacts.remove(robot, run.image, run.scene.captured_s, window)
            masks = Masks(background.vessel, robot, background.vessel_probability, robot_probability)
        run.add(masks=masks)
        if (refusal := quality.check_masks(masks)) is not None:
            return refusal
        with run.watch.stage("skeletons"):
            skeletons = Skeletons(vessel=background.vessel_skeleton, robot=skeleton.thin_robot(robot, config))
        with run.watch.stage("gaps"):
            skeletons = skeleton.repair(skeletons, config.gaps)
        run.add(skeletons=skeletons, vessel_graph=background.graph)
        return _Structures(masks, skeletons, background.graph)

    def _refuse_output(self, run: _Run, vessel: NDArray[np.float32], robot: NDArray[np.float32], refusal: Refusal) -> Refusal:
        """Empty masks with the network's unusable output, so that it is shown."""
        run.add(masks=Masks(np.zeros(vessel.shape, bool), np.zeros(robot.shape, bool), vessel, robot))
        return refusal

    def _locate(self, run: _Run, structures: _Structures, before: PreviousPath, routes: RouteMemory | None) -> Located | Refusal:
        """The robot's path, the route to the target, the centerline's piece and both vectors."""
        config, masks, graph = self._config, structures.masks, structures.graph
        with run.watch.stage("path"):
            port = _port(config.path, run.image)
            path = robot_path.find(structures.skeletons, masks, config, vessel=graph, port=port, before=before)
        if isinstance(path, Refusal):
            return path
        with run.watch.stage("pose"):
            if run.target is not None:
                target = run.scene.to_working(run.target)
                route = route_or_reason(graph, path.head, target, masks.vessel)
                if routes is not None:
                    route = routes.update(route, path.head, target, masks.vessel, run.scene.captured_s)
                run.add(**{"route_problem" if isinstance(route, str) else "route": route})
            elif routes is not None:
                routes.reset()
            robot = fit_robot_vector(path.points, config.vectors.robot_length_px, config.vectors.line_fit)
            run.add(path=path, robot_vector=robot)
            refusal = quality.check_path(path, masks, config)
            if robot is None or refusal is not None:
                return refusal or Refusal(Reason.TOO_SHORT, "it has no direction")
            centerline = find_centerline(
                graph, structures.skeletons.vessel, path.head, robot.direction, config.vectors, run.scene.route, masks.vessel
            )
            vessel = fit_vessel_vector(centerline, config.vectors.line_fit) if centerline is not None else None
            run.add(centerline=centerline, vessel_vector=vessel)
            refusal = quality.check_centerline(centerline, path.head, config.quality)
            if refusal is not None:
                return refusal
            if centerline is None or vessel is None:
                return Refusal(Reason.NO_VESSEL, "the centerline beside the head has no direction")
            return Located(path, robot, centerline, vessel)

    def _judge(
        self, run: _Run, masks: Masks, located: Located, segmenter: CalibratedSegmenter, before: PreviousPath
    ) -> Refusal | None:
        """Add the pose of what was located, with its features and confidence, or refuse it."""
        config, path = self._config, located.path
        with run.watch.stage("pose"):
            refusal = quality.check_walls(masks, path.head, config.quality)
            if refusal is not None:
                return refusal
            pose = measure_pose(located.robot, located.vessel, config.pose)
            believed = _without_artefacts(masks, run.state.artefacts.removed if run.state is not None else None)
            features = confidence_features(path, located.robot, located.centerline, believed, config)
        if segmenter.sensitivity:
            with run.watch.stage("sensitivity"):
                others = [
                    self._answer_to(self._cleaned(shifted, run), run, before) for shifted in quality.shifted_probabilities(believed)
                ]
                theta, head = quality.threshold_sensitivity((path.head, pose.theta_signed_deg), others)
                features = replace(features, theta_swing=theta, head_swing=head)
        run.add(evidence=features.values())
        if segmenter.calibration is not None:
            confidence = segmenter.calibration.confidence(features)
        else:
            confidence = quality.uncalibrated_confidence(path, located.centerline, masks, config)
        refusal = quality.check_confidence(confidence, config.quality)
        if refusal is None:
            run.add(pose=replace(pose, confidence=confidence))
        return refusal

    def _cleaned(self, probabilities: tuple[NDArray[np.float32], NDArray[np.float32]], run: _Run) -> Masks:
        masks = segmentation.clean(*probabilities, self._config)
        if run.drawn is None:
            return masks
        return replace(masks, vessel=run.drawn.mask, vessel_probability=run.drawn.probability)

    def _answer_to(self, masks: Masks, run: _Run, before: PreviousPath) -> quality.Answer | None:
        """Head and signed theta of the same frame with other masks; None for a refusal."""
        scene = run.scene
        bare = Scene(scene.frame_index, scene.captured_s, scene.source_size, scene.scale, scale_xy=scene.scale_xy)
        other = _Run(run.image, run.target, bare, _Stopwatch(), drawn=run.drawn)
        structures = self._trace(other, masks)
        located = structures if isinstance(structures, Refusal) else self._locate(other, structures, before, None)
        if isinstance(located, Refusal):
            return None
        return located.path.head, measure_pose(located.robot, located.vessel, self._config.pose).theta_signed_deg


def soft_edged(mask: Mask) -> NDArray[np.float32]:
    """A drawn mask (h, w) as a probability: 0.5 on its edge, and soft over a pixel or two."""
    whole = np.ascontiguousarray(mask).view(np.uint8)
    inside, outside = (cv2.distanceTransform(one, cv2.DIST_L2, 5) for one in (whole, 1 - whole))
    depth = np.maximum(inside - 0.5, 0.0) - np.maximum(outside - 0.5, 0.0)
    return np.asarray(1.0 / (1.0 + np.exp(-2.0 * np.clip(depth, -20.0, 20.0))), np.float32)


def _without_artefacts(masks: Masks, removed: Mask | None) -> Masks:
    """The masks with a robot's probability (h, w) of 0 around the static artefacts that were `removed` (h, w)."""
    if removed is None:
        return masks
    x, y, width, height = cv2.boundingRect(removed.view(np.uint8))
    box = slice(max(0, y - _EDGE_PX), y + height + _EDGE_PX), slice(max(0, x - _EDGE_PX), x + width + _EDGE_PX)
    around = cv2.dilate(removed[box].view(np.uint8), np.ones((2 * _EDGE_PX + 1, 2 * _EDGE_PX + 1), np.uint8)) > 0
    probability = masks.robot_probability.copy()
    probability[box][around & ~masks.robot[box]] = 0.0
    return replace(masks, robot_probability=probability)


def _port(config: PathConfig, image: Image) -> Point | None:
    """The insertion port in the working image; None where it is not configured."""
    if config.port_x_share is None or config.port_y_share is None:
        return None
    height, width = image.shape[:2]
    return config.port_x_share * (width - 1), config.port_y_share * (height - 1)


def open_pipeline(config: PerceptionConfig, *, recalibrating: bool = False, bench: Bench | None = None) -> Pipeline:
    """Load the configured model, and the configured bench unless another is given, and build the pipeline around them.

    Raises ModelError and BenchError. `recalibrating`: see ``open_calibrated``.
    """
    if bench is None:
        bench = configured_bench(config)
    plain, averaged = open_calibrated(config, recalibrating=recalibrating)
    stream = averaged if config.segmentation.mirrored == "always" else plain
    single = plain if config.segmentation.mirrored == "never" else averaged
    return Pipeline(stream, config, single=single, roi=stream, bench=bench)


def configured_bench(config: PerceptionConfig) -> Bench | None:
    """The configured bench; raises BenchError."""
    if config.bench is None:
        return None
    bench = read_bench(Path(config.bench))
    check_size(bench, config.working_size_px, config.bench)
    return bench


def open_calibrated(config: PerceptionConfig, *, recalibrating: bool = False) -> tuple[CalibratedSegmenter, CalibratedSegmenter]:
    """The configured model on a picture as it is, and averaged over all its orientations and two sizes; raises ModelError.

    A model whose confidence was calibrated with fewer passes of tip refinement, or without threshold sensitivity, keeps them;
    `recalibrating`: use all of both, and no calibration of kinds of pictures.
    """
    segmenter, near = open_segmenter(config.segmentation), open_second_look(config.segmentation)
    info = segmenter.info
    plain: Segmenter = segmenter
    averaged: Segmenter = LumenSizeAverage(OrientationAverage(segmenter))
    if near is not None:
        if recalibrating or info.calibration is None:
            passes = MAX_PASSES
        else:
            passes = info.mirrored_second_looks if info.calibration_mirrored is not None else 1
        plain, averaged = TipRefinement(plain, near), TipRefinement(averaged, OrientationAverage(near), passes=passes)
    calibration = info.calibration_mirrored or info.calibration
    sensitivity = recalibrating or (calibration is not None and calibration.needs_sensitivity)
    known = info.familiarity if not recalibrating else None
    is_taught = "taught" in info.training
    return (
        CalibratedSegmenter(plain, info.calibration, known=known, is_taught=is_taught),
        CalibratedSegmenter(averaged, calibration, sensitivity, known, all_orientations=True, is_taught=is_taught),
    )


class NoPerception:
    """Stands in when no model can be loaded: every frame is refused, with the reason and what to do."""

    def __init__(self, problem: str) -> None:
        self._refusal = Refusal(Reason.NO_MODEL, problem)

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        height, width = frame.image.shape[:2]
        return Scene(frame.index, frame.captured_s, (width, height), 1.0, refusal=self._refusal, latency_ms={"total": 0.0})
