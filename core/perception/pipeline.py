"""All stages in the order of the data's way: frame -> masks -> skeletons -> path, centerline -> vectors -> pose, or a refusal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from time import perf_counter

import numpy as np

from core.config import PerceptionConfig
from core.perception import gaps, masks, quality, robot_path, skeleton
from core.perception.centerline import centerline_at, plan_route
from core.perception.pose import StateFilter, measure
from core.perception.segmentation import Segmenter, open_segmenter, to_working
from core.perception.vectors import fit_robot_vector, fit_vessel_vector
from core.perception.vessel_graph import build_graph
from core.types import Frame, Point, Reason, Refusal, RobotPath, Scene


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


class Pipeline:
    """Perception of single images or of a stream.

    A call perceives a frame of a stream: the last frames decide between near-equal paths, an impossible jump of the head is refused,
    and the state is steadied. ``perceive_single`` knows nothing of other frames and leaves the stream's memory alone.
    """

    def __init__(self, segmenter: Segmenter, config: PerceptionConfig) -> None:
        self._segment = segmenter
        self._config = config
        self._states = StateFilter(config.pose)
        self._previous: RobotPath | None = None
        self._previous_s = 0.0

    @property
    def engine(self) -> str:
        """Where the network runs, in words."""
        return self._segment.engine

    def reset(self) -> None:
        """Forget the stream's past."""
        self._previous = None
        self._states.update(None)

    def perceive_single(self, frame: Frame, target: Point | None = None) -> Scene:
        """A frame by itself; `target` is the operator's destination in source pixels."""
        watch = _Stopwatch()
        return watch.finish(self._perceive(frame, target, None, watch))

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        """The next frame of a stream; `target` is the operator's destination in source pixels."""
        tracking = self._config.tracking
        if not tracking.enabled:
            return self.perceive_single(frame, target)
        watch = _Stopwatch()
        age_s = frame.captured_s - self._previous_s
        previous = self._previous if self._previous is not None and 0 <= age_s <= tracking.memory_s else None
        scene = self._perceive(frame, target, previous, watch)
        if scene.pose is not None and scene.path is not None and previous is not None:
            moved = float(np.hypot(scene.path.head[0] - previous.head[0], scene.path.head[1] - previous.head[1]))
            allowed = tracking.max_head_speed_px_s * age_s + tracking.head_jump_px
            if moved > allowed:
                # The memory is not renewed: a robot that really is elsewhere is believed once the memory has faded.
                detail = f"{moved:.0f} px in {age_s * 1e3:.0f} ms, at most {allowed:.0f} px is possible"
                scene = replace(scene, pose=None, refusal=Refusal(Reason.HEAD_JUMP, detail))
                self._states.update(None)
                return watch.finish(scene)
        if scene.pose is not None:
            self._previous, self._previous_s = scene.path, frame.captured_s
        steadied = self._states.update(scene.pose)
        return watch.finish(replace(scene, pose=steadied))

    def _perceive(self, frame: Frame, target: Point | None, previous: RobotPath | None, watch: _Stopwatch) -> Scene:
        config = self._config
        height, width = frame.image.shape[:2]
        with watch.stage("prepare"):
            image, scale = to_working(frame.image, config.working_size_px)
            refusal = quality.check_image(image, config.quality)
        scene = Scene(frame.index, frame.captured_s, (width, height), scale)
        if refusal is not None:
            return replace(scene, refusal=refusal)
        with watch.stage("network"):
            vessel_probability, robot_probability = self._segment(image)
        with watch.stage("masks"):
            found = masks.clean(vessel_probability, robot_probability, config)
        scene = replace(scene, masks=found)
        refusal = quality.check_masks(found)
        if refusal is not None:
            return replace(scene, refusal=refusal)
        with watch.stage("skeletons"):
            skeletons = skeleton.thin_masks(found, config)
        with watch.stage("gaps"):
            skeletons = gaps.repair(skeletons, config.gaps)
        with watch.stage("graph"):
            graph = build_graph(skeletons.vessel, found.vessel, config.cleaning)
        scene = replace(scene, skeletons=skeletons, vessel_graph=graph)
        with watch.stage("path"):
            path = robot_path.find(skeletons, found, config, previous, graph)
        if isinstance(path, Refusal):
            return replace(scene, refusal=path)
        scene = replace(scene, path=path)
        with watch.stage("pose"):
            return self._pose(scene, path, target)

    def _pose(self, scene: Scene, path: RobotPath, target: Point | None) -> Scene:
        """Vectors, centerline piece, pose and the last word of the quality gate."""
        config = self._config
        assert scene.masks is not None
        assert scene.vessel_graph is not None
        graph = scene.vessel_graph
        if target is not None:
            scene = replace(scene, route=plan_route(graph, path.head, scene.to_working(target)))
        robot_vector = fit_robot_vector(path.points, config.vectors.robot_length_px)
        if robot_vector is None:
            return replace(scene, refusal=Refusal(Reason.TOO_SHORT, "no line can be fitted to it"))
        half_px = config.vectors.vessel_half_length_px
        centerline = centerline_at(graph, path.head, robot_vector.direction, half_px, scene.route)
        vessel_vector = fit_vessel_vector(centerline) if centerline is not None else None
        scene = replace(scene, robot_vector=robot_vector, centerline=centerline, vessel_vector=vessel_vector)
        if centerline is None or vessel_vector is None:
            return replace(scene, refusal=Refusal(Reason.NO_VESSEL, "no centerline beside the robot's head"))
        judged = quality.judge(scene.masks, path, centerline, config)
        if isinstance(judged, Refusal):
            return replace(scene, refusal=judged)
        return replace(scene, pose=measure(robot_vector, vessel_vector, config.pose, judged))


def open_pipeline(config: PerceptionConfig) -> Pipeline:
    """Load the configured model and build the pipeline around it; raises ModelError."""
    return Pipeline(open_segmenter(config.segmentation), config)


class NoPerception:
    """Stands in when no model can be loaded: every frame is refused, with the reason and what to do."""

    def __init__(self, problem: str) -> None:
        self._refusal = Refusal(Reason.NO_MODEL, problem)

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        height, width = frame.image.shape[:2]
        return Scene(frame.index, frame.captured_s, (width, height), 1.0, refusal=self._refusal, latency_ms={"total": 0.0})
