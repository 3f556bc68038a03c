"""The Python API: perceive pictures, open sessions, read annotations, run trials.

The values are those of ``core`` (``core/types.py``). Pictures are RGB, uint8, of shape (h, w, 3); points are (x, y) in pixels of
the picture; distances to the centerline are working pixels (longer side 640). Errors that a user can mend are
``core.devices.UserError``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from core.annotation.model import status_of
from core.annotation.store import DEFAULT_NAME, AnnotationStore, StoredAnnotation
from core.config.models import choose_model, load_config, merge
from core.devices import UserError
from core.evaluation.trial import Row, summarise
from core.files import read_image
from core.session.codec import RecordedRow
from core.session.reader import SessionReader
from core.types import Frame, Image, Mask, Point, Points, Pose, PoseState, Scene

__all__ = ["Measured", "Perceived", "Perceiver", "Session", "open_session", "read_annotations", "run_trials", "summarise"]


@dataclass(frozen=True, slots=True, eq=False)
class Perceived:
    """What was understood of one picture.

    Attributes
    ----------
    pose : theta, distances, crossed, state and confidence; None: there is none, and ``reason`` says why.
    vessel, robot : masks of shape (h, w), empty where nothing was found.
    robot_path : (N, 2), from tail to head; None without a robot.
    scene : all the rest, in working pixels.
    """

    pose: Pose | None
    reason: str
    vessel: Mask
    robot: Mask
    robot_path: Points | None
    scene: Scene

    @property
    def state(self) -> PoseState | None:
        return self.pose.state if self.pose is not None else None

    @property
    def confidence(self) -> float:
        """0 to 1; 0 without a pose."""
        return self.pose.confidence if self.pose is not None else 0.0


class Perceiver:
    """Perception with a model that is loaded once (about a second). One thread at a time.

    Parameters
    ----------
    model : a model's name or folder.
    preset : "paper" for the paper's own settings.
    stream : pictures are frames of one video, which the last frames help to understand; else each is perceived by itself.
    settings : of the section ``perception``, as in a settings file: ``{"pose": {"d_allow_px": 8.0}}``.

    Raises UserError: for an unknown model, a missing bench, or a setting that is not allowed.
    """

    def __init__(
        self, model: str = "default", *, preset: str | None = None, stream: bool = False, settings: dict[str, Any] | None = None
    ) -> None:
        from core.perception.pipeline import open_pipeline

        config = load_config(None, preset, merge({"perception": settings or {}}, choose_model(model)))
        self._pipeline, self._stream, self._index = open_pipeline(config.perception), stream, -1

    def __call__(self, picture: Image | str | Path, *, target: Point | None = None, time_s: float | None = None) -> Perceived:
        """Perceive a picture, or the file of one. `target`: where the robot shall go, source pixels; `time_s` of a frame."""
        from app.commands.perceive import source_masks

        image = read_image(Path(picture)) if isinstance(picture, str | Path) else np.ascontiguousarray(picture)
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
            raise UserError(f"a picture is an array of uint8 of shape (h, w, 3), not of {image.dtype} of shape {image.shape}")
        self._index += 1
        frame = Frame(self._index, self._index / 30.0 if time_s is None else time_s, image)
        scene = self._pipeline(frame, target) if self._stream else self._pipeline.perceive_single(frame, target)
        path = scene.points_to_source(scene.path.points) if scene.path is not None else None
        return Perceived(scene.pose, str(scene.refusal or ""), **source_masks(scene), robot_path=path, scene=scene)


class Session(SessionReader):
    """A recorded session.

    ``timeline()`` has its columns as arrays (time_s, theta_deg, state, mode), ``events`` what happened, ``manifest`` where it comes
    from, ``problems`` what is damaged. ``row(n)`` and ``frame(n)`` are single ones, ``len`` counts them. Close it, or use ``with``.
    """

    def rows(self) -> Iterator[RecordedRow]:
        """All rows: scene, advice, what was sent, status, mode; without those that are damaged."""
        return (row for place in range(len(self)) if (row := self.row(place)) is not None)

    def frames(self) -> Iterator[Frame]:
        """All pictures with their times; without those that are lost."""
        return (frame for place in range(len(self)) if (frame := self.frame(place)) is not None)


def open_session(path: str | Path) -> Session:
    """Open a session's folder, and wait until all its rows are known. Raises UserError for what is no session."""
    session = Session(Path(path))
    session.wait()
    return session


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """An annotation: what a rater drew and answered on one image.

    ``status`` is "done", "can't tell", "no robot" or "begun"; ``robot`` (N, 2) from tail to head and ``vessel`` (N, 2) are the
    lines that were drawn, empty without any; ``theta_deg`` is None until both are there. ``stored`` has the rest.
    """

    image: str
    size: tuple[int, int]
    rater: str
    study: str
    repeat: int
    status: str
    state: PoseState | None
    theta_deg: float | None
    robot: Points
    vessel: Points
    stored: StoredAnnotation


def read_annotations(path: str | Path) -> list[Measured]:
    """All annotations of a file, or of the one in a folder or session. Raises UserError."""
    file = Path(path) / DEFAULT_NAME if Path(path).is_dir() else Path(path)
    with AnnotationStore(file, read_only=True) as store:
        images, kept = store.images(), store.annotations()
    found = []
    for one in kept:
        key, drawn, image = one.key, one.content, images[one.key.sha256]
        status = status_of(drawn, measured=one.theta_deg is not None).value
        robot, vessel = (np.array(line, np.float64).reshape(-1, 2) for line in (drawn.robot, drawn.vessel))
        answer = (status, drawn.state, one.theta_deg, robot, vessel)
        found.append(Measured(image.name, image.size, key.rater, key.study, key.repeat, *answer, one))
    return found


def run_trials(
    seeds: Iterable[int], policy: str = "pursuit", look: str = "random", *, max_seconds: float = 120.0, true_masks: bool = False
) -> list[Row]:
    """Closed-loop trials in the bench twin, one after the other; ``summarise`` gives the figures of all.

    Parameters
    ----------
    policy : pursuit, table, push, random, or a plugin's.
    look : "random", "bench" or a family of looks, as ``synth --family`` has them.
    true_masks : the twin's own masks instead of the network's.

    Returns
    -------
    list of dict
        Per trial: seed, reached, time_s, insertion_mm, wall_contact_n and what else ``trial --json`` prints; ``track`` has the way.
    """
    from app.commands.trial import parse_policies, run_one
    from hardware.twin.catalog import TRIAL_LOOKS
    from hardware.twin.trial import TrialPlan

    (name,) = parse_policies([policy])
    if look not in TRIAL_LOOKS:
        raise UserError(f"unknown look {look!r}; known: {', '.join(TRIAL_LOOKS)}")
    plan = TrialPlan(load_config(), true_masks, max_seconds, look)
    return [run_one(plan, (name, seed)) for seed in seeds]
