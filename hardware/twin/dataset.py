"""Labelled data sets from the twin: random phantoms, physical robot shapes, random looks, exact masks and truth.

A set consists of episodes: one random phantom (seed = first seed + episode) through which the robot is driven once, in
``LOOKS_PER_EPISODE`` looks. Painting a look takes far longer than painting a robot into it, so one look can serve several poses.
Of the family ``painted``, pictures are drawn from their geometry alone (``core.learning.painting``), with the same truth.
A set of scenes has geometry in place of frames (``core.learning.scenes``), and pictures of every second scene alone.
A frame depends only on the seed of its episode and on the plan: a set can be continued after an interruption, and two sets with
disjoint seed ranges are disjoint.
"""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.config.models import PerceptionConfig
from core.devices import UserError
from core.files import is_unfinished, sweep_unfinished, write_atomic
from core.learning.dataset import mask_png, png
from core.learning.painting import PaintedBench, exposed
from core.learning.scenes import BenchScene
from core.system import begin_as_worker
from core.types import Image, Mask, Points
from hardware.twin.catalog import BENCH_LOOK, OWN_LOOK
from hardware.twin.phantom import BOARD_MM, Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import TwinPhysics
from hardware.twin.rendering.appearance import Appearance, make_view, named_appearance
from hardware.twin.rendering.renderer import RenderedFrame, Renderer
from hardware.twin.truth import RouteFollower, truth_of
from hardware.twin.view import CameraView, measure_lumen

LOOKS_PER_EPISODE = 16
SCENES_PER_EPISODE = 4
_ROBOTS_PER_SCENE, _PICTURES_PER_SCENE = 6, 2
_SCENE_REACH_PX = 20.0
"""Distance outside the lumen up to which it is measured: painted walls are up to 5.5 px thick, in crops of 0.6 of the size."""
PAINTED_LOOK = "painted"
"""Family of benches that are painted from their geometry."""
_EMPTY_SHARE = 0.03  # of the frames show no robot
_STEP_S = 0.02
_FEED_MM_S = 40.0


@dataclass(frozen=True, slots=True)
class SynthPlan:
    """What to write. ``families`` of ``LOOKS`` limits the looks (None: all random ones), ``phantom`` fixes the phantom (None:
    random ones), ``poses`` is the number of poses of the robot in every look; ``scenes``: scenes instead of frames."""

    out: Path
    count: int
    seed: int
    size: tuple[int, int] = (640, 480)
    families: tuple[str, ...] | None = None
    phantom: str | None = None
    poses: int = 1
    scenes: bool = False

    @property
    def episodes(self) -> int:
        return -(-self.count // self.frames_per_episode)

    @property
    def frames_per_episode(self) -> int:
        return SCENES_PER_EPISODE if self.scenes else LOOKS_PER_EPISODE * self.poses

    def frames_of(self, episode: int) -> int:
        return min(self.frames_per_episode, self.count - episode * self.frames_per_episode)


@dataclass(frozen=True, slots=True, eq=False)
class LabelledFrame:
    """One frame of an episode: picture, masks, and truth as plain types."""

    stem: str
    picture: RenderedFrame
    truth: dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Episode:
    """A finished episode: contents of its files by relative path, and the truth of its frames, a line each."""

    number: int
    files: dict[str, bytes]
    truth: tuple[str, ...]


RemoteEpisodes = Callable[[Callable[[int], Episode], Sequence[int]], Iterable[Episode]]
"""Makes the episodes with these numbers on other machines, in any order."""

RobotShape = tuple[Points, float, float]
"""Points (N, 2) mm tail -> head, sheath mm, clearance mm."""


def robot_shapes(phantom: Phantom, seed: int, looks: int, poses: int = 1) -> list[RobotShape]:
    """Drive the robot once through a phantom; `poses` shapes for each of `looks` looks, in order."""
    count = looks * poses
    rng = np.random.default_rng((seed, 11))
    physics = TwinPhysics(phantom, seed)
    target = int(rng.choice(phantom.targets))
    follower = RouteFollower(
        phantom, target, lookahead_mm=float(rng.uniform(6, 14)), wander=float(rng.choice((0.0, 0.4, 0.9))), seed=seed
    )
    moments = np.sort(rng.uniform(0.12, 0.98, count)) * follower.length_mm
    shapes: list[RobotShape] = []
    sheath_speed = float(rng.choice((0.0, 0.0, 6.0, 14.0)))
    for _ in range(int(3.0 * follower.length_mm / _FEED_MM_S / _STEP_S)):
        command = follower.command(physics.robot_points_mm(), _FEED_MM_S, _STEP_S)
        physics.step(type(command)(command.bend, 0.0, command.advance_mm_s, sheath_speed), _STEP_S)
        while len(shapes) < count and physics.insertion_mm >= moments[len(shapes)]:
            shapes.append((physics.robot_points_mm(), physics.delivery_mm, physics.clearance_mm()))
            if len(shapes) % poses:
                break  # the robot has not moved since
            # A random bend, so that not every picture shows a robot that follows its route.
            physics.step(type(command)(float(rng.uniform(-1, 1)), 0.0, 0.0, 0.0), float(rng.uniform(0.0, 0.15)))
        if len(shapes) == count:
            break
    last = (physics.robot_points_mm(), physics.delivery_mm, physics.clearance_mm())
    return shapes + [last] * (count - len(shapes))  # a stuck robot: its last shape in the remaining looks


def episode_frames(plan: SynthPlan, episode: int) -> Iterator[LabelledFrame]:
    """The frames of one episode, in order."""
    seed = plan.seed + episode
    phantom = make_phantom(plan.phantom or f"random:{seed}")
    rng = np.random.default_rng((seed, 13))
    config = PerceptionConfig()
    shapes = robot_shapes(phantom, seed, LOOKS_PER_EPISODE, plan.poses)
    # Several poses of a look come from anywhere on the route; single ones are shown in order.
    moments = np.random.default_rng((seed, 17)).permutation(len(shapes)) if plan.poses > 1 else np.arange(len(shapes))
    first = episode * plan.frames_per_episode
    first_look = seed * LOOKS_PER_EPISODE
    for place in range(plan.frames_of(episode)):
        look, pose = divmod(place, plan.poses)
        if pose == 0:
            appearance = _look_of(plan, rng, first_look + look)
            view = make_view(appearance, plan.size, phantom)
            is_painted = appearance.family == PAINTED_LOOK
            renderer = (_PaintedRenderer if is_painted else Renderer)(phantom, appearance, plan.size, seed, view)
        moment = int(moments[place])
        points, sheath_mm, clearance_mm = shapes[moment]
        empty = bool(rng.random() < _EMPTY_SHARE)
        if appearance.family == OWN_LOOK:
            sheath_mm = 0.0  # how it looks there is not known
        robot = None if empty else points
        picture = renderer.render(robot, 0.0 if empty else sheath_mm, noise_seed=place)
        truth = truth_of(phantom, view, robot, renderer.appearance.robot_radius_mm, config).to_json()
        stem = f"{first + place:06d}"
        stuck = moment > 0 and points is shapes[moment - 1][0]
        row = {"stem": stem, "seed": seed, "phantom": phantom.name, "family": appearance.family}
        row |= {"clearance_mm": clearance_mm, "stuck": stuck, "robot_visible": bool(picture.robot.any())}
        yield LabelledFrame(stem, picture, row | truth)


def _look_of(plan: SynthPlan, rng: np.random.Generator, number: int) -> Appearance:
    family = str(rng.choice(plan.families)) if plan.families else None
    appearance = named_appearance(None if family == PAINTED_LOOK else family, number)
    return replace(appearance, family=family) if family in (BENCH_LOOK, PAINTED_LOOK) else appearance


class _PaintedRenderer:
    """Stands in for ``Renderer``: the same geometry and exact labels, in a painted look."""

    def __init__(self, phantom: Phantom, appearance: Appearance, size: tuple[int, int], seed: int, view: CameraView) -> None:
        self.appearance = appearance
        self._rng = np.random.default_rng((seed, appearance.clutter_seed, 19))
        distance_px, ratio = _measured(phantom, appearance, view)
        self._bench = PaintedBench(self._rng, distance_px, ratio)
        self._view, self._radius_px = view, appearance.robot_radius_mm * _pixels_per_mm(view)

    def render(self, robot_points_mm: Points | None, sheath_mm: float = 0.0, noise_seed: int = 0) -> RenderedFrame:
        """As ``Renderer.render``; no sheath is drawn."""
        del sheath_mm
        rng = np.random.default_rng((int(self._rng.integers(2**31)), noise_seed))
        bench, robot = self._bench, np.zeros_like(self._bench.vessel)
        if robot_points_mm is None or len(robot_points_mm) < 2:
            picture = bench.empty()
        else:
            picture, robot = bench.with_robot(rng, self._view.project(robot_points_mm), self._radius_px)
        levels = exposed(rng, picture, bench.vessel, bench.blur_px)
        return RenderedFrame(np.ascontiguousarray(levels.transpose(1, 2, 0)), bench.vessel.copy(), robot)


def _pixels_per_mm(view: CameraView) -> float:
    return view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))


def _measured(phantom: Phantom, appearance: Appearance, view: CameraView) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Signed distance (h, w) to the vessel's wall in px, and the ratio of the distance to the centerline and the radius."""
    scale = _pixels_per_mm(view)
    lumen = measure_lumen(phantom.graph, view, view.grid_mm().astype(np.float32), appearance.wall_mm, _SCENE_REACH_PX / scale)
    return lumen.distance_mm * np.float32(scale), lumen.ratio


def episode_scenes(plan: SynthPlan, episode: int) -> Iterator[tuple[BenchScene, dict[str, Any]]]:
    """The scenes of one episode, in order, and what is noted of each."""
    seed = plan.seed + episode
    phantom = make_phantom(plan.phantom or f"random:{seed}")
    rng = np.random.default_rng((seed, 13))
    shapes = robot_shapes(phantom, seed, SCENES_PER_EPISODE, _ROBOTS_PER_SCENE)
    order = np.random.default_rng((seed, 17)).permutation(len(shapes))
    for place in range(plan.frames_of(episode)):
        appearance = _look_of(plan, rng, seed * LOOKS_PER_EPISODE + place)
        view = make_view(appearance, plan.size, phantom)
        distance_px, ratio = _measured(phantom, appearance, view)
        first = place * _ROBOTS_PER_SCENE
        robots = [shapes[moment] for moment in order[first : first + _ROBOTS_PER_SCENE]]
        pictures: list[tuple[Image, Mask]] = []
        empty = None
        if place % 2 == 0:  # painted boards are the slow part
            renderer = Renderer(phantom, appearance, plan.size, seed, view)
            for number, (points, sheath_mm, _) in enumerate(robots[:_PICTURES_PER_SCENE]):
                seen = renderer.render(points, sheath_mm, noise_seed=number)
                pictures.append((seen.image, seen.robot))
            empty = renderer.render(None, 0.0, noise_seed=_PICTURES_PER_SCENE).image
        yield (
            BenchScene(
                distance_px=distance_px,
                ratio=ratio,
                lines=tuple(view.project(points) for points, _, _ in robots),
                radius_px=appearance.robot_radius_mm * _pixels_per_mm(view),
                pictures=tuple(pictures),
                empty=empty,
            ),
            {"seed": seed, "phantom": phantom.name, "family": appearance.family, "pictures": len(pictures)},
        )


def make_episode(plan: SynthPlan, number: int) -> Episode:
    """Render an episode in memory."""
    import cv2

    cv2.setNumThreads(1)
    files: dict[str, bytes] = {}
    truth = []
    if plan.scenes:
        for place, (scene, noted) in enumerate(episode_scenes(plan, number)):
            stem = f"{number * SCENES_PER_EPISODE + place:06d}"
            files[f"scenes/{stem}.npz"] = scene.to_bytes()
            truth.append(json.dumps({"stem": stem} | noted))
        return Episode(number, files, tuple(truth))
    for frame in episode_frames(plan, number):
        files[f"images/{frame.stem}.png"] = png(frame.picture.image)
        files[f"masks/{frame.stem}_vessel.png"] = mask_png(frame.picture.vessel)
        files[f"masks/{frame.stem}_robot.png"] = mask_png(frame.picture.robot)
        truth.append(json.dumps(frame.truth, allow_nan=False))
    return Episode(number, files, tuple(truth))


def _write_episode(plan: SynthPlan, number: int) -> int:
    return _save_episode(plan, make_episode(plan, number))


def _save_episode(plan: SynthPlan, made: Episode) -> int:
    """Write an episode and return its number of frames. The truth file comes last, by rename, and marks it as complete."""
    for name, data in made.files.items():
        write_atomic(plan.out / name, data)
    write_atomic(_episode_file(plan, made.number), ("\n".join(made.truth) + "\n").encode())
    return len(made.truth)


def _episode_file(plan: SynthPlan, episode: int) -> Path:
    return plan.out / "episodes" / f"{episode:05d}.jsonl"


class SynthError(UserError):
    """The set cannot be written; the message is one line and says what to do."""


class SynthFolderError(SynthError):
    """The folder holds something else; ``problem`` says what, without the advice to choose another one."""

    def __init__(self, problem: str, advice: str = "choose another folder") -> None:
        super().__init__(f"{problem}; {advice}")
        self.problem = problem


def write_set(
    plan: SynthPlan, *, workers: int = 1, remote: RemoteEpisodes | None = None, on_progress: Callable[[int], None] = lambda _: None
) -> int:
    """Write the set and return its number of frames; existing frames are kept.

    With `remote`, other machines render the frames in place of `workers` processes here; they are written here. `on_progress`
    gets the number of frames completed since its last call. An interruption (Ctrl-C) loses only unfinished episodes; the same
    call continues. Raises SynthError: the folder holds a set of another plan, or cannot be written.
    """
    _prepare(plan)
    try:
        _write_missing(plan, workers, remote, on_progress)
    except OSError as error:
        raise SynthError(f"{error.filename or plan.out}: cannot be written ({error.strerror}); free some space and go on") from None
    except BrokenProcessPool:
        raise SynthError(
            f"{plan.out}: a process that makes frames was ended from outside (too little memory?); the same command goes on, "
            "with fewer --workers perhaps"
        ) from None
    return plan.count


def _write_missing(plan: SynthPlan, workers: int, remote: RemoteEpisodes | None, on_progress: Callable[[int], None]) -> None:
    def is_complete(episode: int) -> bool:
        path = _episode_file(plan, episode)
        return path.is_file() and len(path.read_text(encoding="utf-8").splitlines()) >= plan.frames_of(episode)

    missing = [episode for episode in range(plan.episodes) if not is_complete(episode)]
    on_progress(plan.count - sum(map(plan.frames_of, missing)))
    if remote is not None and missing:
        for made in remote(partial(make_episode, plan), missing):
            on_progress(_save_episode(plan, made))
    elif workers <= 1:
        for episode in missing:
            on_progress(_write_episode(plan, episode))
    elif missing:
        # Spawned, not forked: physics and OpenCV own threads that a fork would cut off.
        context = multiprocessing.get_context("spawn")
        others = set(multiprocessing.active_children())
        with ProcessPoolExecutor(workers, mp_context=context, initializer=begin_as_worker) as pool:
            jobs = [pool.submit(_write_episode, plan, episode) for episode in missing]
            try:
                for job in as_completed(jobs):
                    on_progress(job.result())
            finally:
                # There is something to cancel or to end only after an interruption or a failed episode.
                pool.shutdown(wait=False, cancel_futures=True)
                for worker in set(multiprocessing.active_children()) - others:
                    worker.terminate()
    rows = [_episode_file(plan, episode).read_bytes() for episode in range(plan.episodes)]
    write_atomic(plan.out / "truth.jsonl", b"".join(rows))


def _prepare(plan: SynthPlan) -> None:
    """Make the folders and the plan file, or check that those that exist are of this plan."""
    described = {
        "seed": plan.seed,
        "size": list(plan.size),
        "families": plan.families and list(plan.families),
        "phantom": plan.phantom,
    }
    if plan.poses != 1:
        described["poses"] = plan.poses
    if plan.scenes:
        described["scenes"] = True
    path = plan.out / "plan.json"
    try:
        if not path.is_file() and plan.out.is_dir() and not all(map(is_unfinished, plan.out.iterdir())):
            raise SynthFolderError(f"{plan.out}: holds something that synth did not write")
        plan.out.mkdir(parents=True, exist_ok=True)
        made = (plan.out / "scenes").glob("*.npz") if plan.scenes else (plan.out / "images").glob("*.png")
        if any(int(path.stem) >= plan.count for path in made if path.stem.isdecimal()):
            kind = "scenes" if plan.scenes else "frames"
            raise SynthFolderError(f"{plan.out}: holds more than {plan.count} {kind}", "ask for as many, or choose another folder")
        if path.is_file():
            if json.loads(path.read_text(encoding="utf-8")) != described:
                raise SynthFolderError(f"{plan.out}: holds a set with other settings ({path.name})")
        else:
            write_atomic(path, f"{json.dumps(described)}\n".encode())  # first: it marks the folder as one of synth
        folders = [plan.out / name for name in (*(("scenes",) if plan.scenes else ("images", "masks")), "episodes")]
        for folder in folders:
            folder.mkdir(exist_ok=True)
        for folder in (plan.out, *folders):
            sweep_unfinished(folder)
    except OSError as error:
        raise SynthError(f"{plan.out}: cannot be written ({error.strerror}); choose another folder") from None
    except ValueError:
        raise SynthError(f"{path}: damaged; delete the folder and write the set again") from None
