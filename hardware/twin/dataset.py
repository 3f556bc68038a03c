"""Labelled data sets from the twin: random phantoms, physical robot shapes, random looks, exact masks and truth.

A set is made in episodes: one random phantom (seed = first seed + episode) through which the robot is driven once, in
``LOOKS_PER_EPISODE`` looks. Painting a look takes far longer than painting a robot into it, so a look can be shown with several
poses of the robot. A frame depends on its episode's seed and on the plan alone, so a set can be continued after an interruption,
and two sets are disjoint when their seed ranges are.
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

from core.config.models import PerceptionConfig
from core.devices import UserError
from core.files import is_unfinished, sweep_unfinished, write_atomic
from core.learning.dataset import mask_png, png
from core.system import begin_as_worker
from core.types import Points
from hardware.twin.catalog import BENCH_LOOK
from hardware.twin.phantom import Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.physics import TwinPhysics
from hardware.twin.rendering.appearance import Appearance, make_view, named_appearance
from hardware.twin.rendering.renderer import RenderedFrame, Renderer
from hardware.twin.truth import RouteFollower, truth_of

LOOKS_PER_EPISODE = 16
_EMPTY_SHARE = 0.03
_STEP_S = 0.02
_FEED_MM_S = 40.0


@dataclass(frozen=True, slots=True)
class SynthPlan:
    """What to write. ``families`` of ``LOOKS`` limits the looks (None: all random ones), ``phantom`` fixes the phantom (None:
    random ones), ``poses`` is how many poses of the robot every look is shown with."""

    out: Path
    count: int
    seed: int
    size: tuple[int, int] = (640, 480)
    families: tuple[str, ...] | None = None
    phantom: str | None = None
    poses: int = 1

    @property
    def episodes(self) -> int:
        return -(-self.count // self.frames_per_episode)

    @property
    def frames_per_episode(self) -> int:
        """Of all episodes but the last, which may have fewer."""
        return LOOKS_PER_EPISODE * self.poses

    def frames_of(self, episode: int) -> int:
        """How many frames an episode has."""
        return min(self.frames_per_episode, self.count - episode * self.frames_per_episode)


@dataclass(frozen=True, slots=True, eq=False)
class LabelledFrame:
    """One frame of an episode: picture, masks, and truth as plain types."""

    stem: str
    picture: RenderedFrame
    truth: dict[str, Any]


@dataclass(frozen=True, slots=True, eq=False)
class Episode:
    """One made episode: what to write where in a set's folder, and the truth of its frames, a line each."""

    number: int
    files: dict[str, bytes]
    truth: tuple[str, ...]


Elsewhere = Callable[[Callable[[int], Episode], Sequence[int]], Iterable[Episode]]
"""Makes the episodes of these numbers on other machines, in any order."""


Shape = tuple[Points, float, float]
"""The robot at a moment: points (N, 2) mm tail -> head, sheath mm, clearance mm."""


def robot_shapes(phantom: Phantom, seed: int, looks: int, poses: int = 1) -> list[Shape]:
    """Drive the robot once through a phantom; `poses` moments for each of `looks` looks, in order."""
    count = looks * poses
    rng = np.random.default_rng((seed, 11))
    physics = TwinPhysics(phantom, seed)
    target = int(rng.choice(phantom.targets))
    follower = RouteFollower(
        phantom, target, lookahead_mm=float(rng.uniform(6, 14)), wander=float(rng.choice((0.0, 0.4, 0.9))), seed=seed
    )
    moments = np.sort(rng.uniform(0.12, 0.98, count)) * follower.length_mm
    shapes: list[Shape] = []
    sheath_speed = float(rng.choice((0.0, 0.0, 6.0, 14.0)))
    for _ in range(int(3.0 * follower.length_mm / _FEED_MM_S / _STEP_S)):
        command = follower.command(physics.robot_points_mm(), _FEED_MM_S, _STEP_S)
        physics.step(type(command)(command.bend, 0.0, command.advance_mm_s, sheath_speed), _STEP_S)
        while len(shapes) < count and physics.insertion_mm >= moments[len(shapes)]:
            shapes.append((physics.robot_points_mm(), physics.delivery_mm, physics.clearance_mm()))
            if len(shapes) % poses:
                break  # the robot has not moved since
            # A free wiggle now and then: not every picture shows a robot that follows its route.
            physics.step(type(command)(float(rng.uniform(-1, 1)), 0.0, 0.0, 0.0), float(rng.uniform(0.0, 0.15)))
        if len(shapes) == count:
            break
    last = (physics.robot_points_mm(), physics.delivery_mm, physics.clearance_mm())
    while len(shapes) < count:  # it got stuck: its last shape, seen by other looks
        shapes.append(last)
    return shapes


def episode_frames(plan: SynthPlan, episode: int) -> Iterator[LabelledFrame]:
    """The frames of one episode, in order."""
    seed = plan.seed + episode
    phantom = make_phantom(plan.phantom or f"random:{seed}")
    rng = np.random.default_rng((seed, 13))
    config = PerceptionConfig()
    shapes = robot_shapes(phantom, seed, LOOKS_PER_EPISODE, plan.poses)
    # Several poses of a look lie anywhere on the way, not one behind the other; single ones are shown in order.
    moments = np.random.default_rng((seed, 17)).permutation(len(shapes)) if plan.poses > 1 else np.arange(len(shapes))
    first = episode * plan.frames_per_episode
    first_look = seed * LOOKS_PER_EPISODE
    for place in range(plan.frames_of(episode)):
        look, pose = divmod(place, plan.poses)
        if pose == 0:
            appearance = _look(plan, first_look + look, rng)
            view = make_view(appearance, plan.size, phantom)
            renderer = Renderer(phantom, appearance, plan.size, seed)
        moment = int(moments[place])
        points, sheath_mm, clearance_mm = shapes[moment]
        empty = bool(rng.random() < _EMPTY_SHARE)
        robot = None if empty else points
        picture = renderer.render(robot, 0.0 if empty else sheath_mm, noise_seed=place)
        truth = truth_of(phantom, view, robot, appearance.robot_radius_mm, config).to_json()
        stem = f"{first + place:06d}"
        stuck = moment > 0 and points is shapes[moment - 1][0]
        row = {"stem": stem, "seed": seed, "phantom": phantom.name, "family": appearance.family}
        row |= {"clearance_mm": clearance_mm, "stuck": stuck, "robot_visible": bool(picture.robot.any())}
        yield LabelledFrame(stem, picture, row | truth)


def _look(plan: SynthPlan, look_seed: int, rng: np.random.Generator) -> Appearance:
    family = str(rng.choice(plan.families)) if plan.families else None
    look = named_appearance(family, look_seed)
    return replace(look, family=BENCH_LOOK) if family == BENCH_LOOK else look


def make_episode(plan: SynthPlan, number: int) -> Episode:
    """Make an episode; nothing is written."""
    import cv2

    cv2.setNumThreads(1)
    files: dict[str, bytes] = {}
    truth = []
    for frame in episode_frames(plan, number):
        files[f"images/{frame.stem}.png"] = png(frame.picture.image)
        files[f"masks/{frame.stem}_vessel.png"] = mask_png(frame.picture.vessel)
        files[f"masks/{frame.stem}_robot.png"] = mask_png(frame.picture.robot)
        truth.append(json.dumps(frame.truth, allow_nan=False))
    return Episode(number, files, tuple(truth))


def _write_episode(plan: SynthPlan, number: int) -> int:
    return _keep(plan, make_episode(plan, number))


def _keep(plan: SynthPlan, made: Episode) -> int:
    """Write an episode; its truth file comes last, by rename, and marks it as complete. Returns how many frames it has."""
    for name, data in made.files.items():
        write_atomic(plan.out / name, data)
    write_atomic(_episode_file(plan, made.number), ("\n".join(made.truth) + "\n").encode())
    return len(made.truth)


def _episode_file(plan: SynthPlan, episode: int) -> Path:
    return plan.out / "episodes" / f"{episode:05d}.jsonl"


def _is_complete(plan: SynthPlan, episode: int) -> bool:
    path = _episode_file(plan, episode)
    return path.is_file() and len(path.read_text(encoding="utf-8").splitlines()) >= plan.frames_of(episode)


class SynthError(UserError):
    """The set cannot be written; the message is one line and says what to do."""


class SynthFolderError(SynthError):
    """The folder holds something else; ``problem`` says what, for those who cannot just choose another one."""

    def __init__(self, problem: str, advice: str = "choose another folder") -> None:
        super().__init__(f"{problem}; {advice}")
        self.problem = problem


def write_set(
    plan: SynthPlan, *, workers: int = 1, elsewhere: Elsewhere | None = None, on_progress: Callable[[int], None] = lambda _: None
) -> int:
    """Write the set; frames that are there already are kept. Returns the number of frames in it.

    With `elsewhere` other machines make the frames, in place of `workers` processes here; what they make is written here.

    `on_progress` is given the number of frames that were completed since its last call. An interruption (Ctrl-C) loses the episodes
    in hand only; the same call goes on from there.

    Raises
    ------
    SynthError
        The folder holds a set of another plan, or cannot be written.
    """
    _prepare(plan)
    try:
        _write_missing(plan, workers, elsewhere, on_progress)
    except OSError as error:
        raise SynthError(f"{error.filename or plan.out}: cannot be written ({error.strerror}); free some space and go on") from None
    except BrokenProcessPool:
        raise SynthError(
            f"{plan.out}: a process that makes frames was ended from outside (too little memory?); the same command goes on, "
            "with fewer --workers perhaps"
        ) from None
    return plan.count


def _write_missing(plan: SynthPlan, workers: int, elsewhere: Elsewhere | None, on_progress: Callable[[int], None]) -> None:
    missing = [episode for episode in range(plan.episodes) if not _is_complete(plan, episode)]
    on_progress(plan.count - sum(map(plan.frames_of, missing)))
    if elsewhere is not None and missing:
        for made in elsewhere(partial(make_episode, plan), missing):
            on_progress(_keep(plan, made))
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
                # Nothing is left to cancel or to end unless it was interrupted or an episode failed.
                pool.shutdown(wait=False, cancel_futures=True)
                for worker in set(multiprocessing.active_children()) - others:
                    worker.terminate()
    rows = [_episode_file(plan, episode).read_bytes() for episode in range(plan.episodes)]
    write_atomic(plan.out / "truth.jsonl", b"".join(rows))


def _prepare(plan: SynthPlan) -> None:
    described = {
        "seed": plan.seed,
        "size": list(plan.size),
        "families": plan.families and list(plan.families),
        "phantom": plan.phantom,
    }
    if plan.poses != 1:
        described["poses"] = plan.poses
    path = plan.out / "plan.json"
    try:
        if not path.is_file() and plan.out.is_dir() and not all(map(is_unfinished, plan.out.iterdir())):
            raise SynthFolderError(f"{plan.out}: holds something that synth did not write")
        plan.out.mkdir(parents=True, exist_ok=True)
        if any(int(image.stem) >= plan.count for image in (plan.out / "images").glob("*.png") if image.stem.isdecimal()):
            raise SynthFolderError(f"{plan.out}: holds more than {plan.count} frames", "ask for as many, or choose another folder")
        if path.is_file():
            if json.loads(path.read_text(encoding="utf-8")) != described:
                raise SynthFolderError(f"{plan.out}: holds a set with other settings ({path.name})")
        else:
            write_atomic(path, f"{json.dumps(described)}\n".encode())  # first: it says whose folder this is
        folders = [plan.out / name for name in ("images", "masks", "episodes")]
        for folder in folders:
            folder.mkdir(exist_ok=True)
        for folder in (plan.out, *folders):
            sweep_unfinished(folder)
    except OSError as error:
        raise SynthError(f"{plan.out}: cannot be written ({error.strerror}); choose another folder") from None
    except ValueError:
        raise SynthError(f"{path}: damaged; delete the folder and write the set again") from None
