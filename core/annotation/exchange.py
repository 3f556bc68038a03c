"""Annotations become training sets, and the algorithm's answer becomes an annotation. Other programs' files: ``formats.py``."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from core import geometry
from core.annotation.agreement_report import finished, manual_measurements, measured_alike, studies_of
from core.annotation.formats import mask_source
from core.annotation.masks import fill, polygons_of
from core.annotation.model import Annotation, AnnotationError, Line, MaskPolygon, MaskTarget, measure_lines
from core.annotation.store import FoundImage, StoredAnnotation
from core.config.models import PerceptionConfig
from core.files import ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS, UNMEASURED, write_mask, write_png
from core.types import Mask, Points, Pose, Reason, Refusal, Scene, Vector


def merged(old: Annotation, new: Annotation) -> Annotation:
    """The imported parts put into what is there: only where there was nothing, so that no work by hand is lost."""
    masks = old.masks + tuple(mask for mask in new.masks if mask.target not in old.drawn)
    return replace(old, robot=old.robot or new.robot, vessel=old.vessel or new.vessel, masks=masks)


def export_training_set(
    annotations: Sequence[StoredAnnotation],
    images: Sequence[FoundImage],
    out: Path,
    go_on: Callable[[], bool] = lambda: True,
    *,
    measured: Sequence[StoredAnnotation] | None = None,
) -> tuple[int, list[str]]:
    """Write ``images/``, ``masks/`` and ``truth.jsonl`` as ``train --data`` and ``evaluate`` read them.

    Returns the number of frames written, and one line for each annotated image that was left out. An image with only one of the
    two masks is left out: without its mask a robot that is there would be taught as background. `measured` are finished answers
    of one study, whose angles and states go along; None: those among `annotations`.

    Raises AnnotationError: `out` is not empty or cannot be written; there is nothing to write; the images were measured in
    several studies; or `go_on`, asked before each image, is False.
    """
    sources = mask_source(annotations)
    here = {image.sha256: image for image in images}
    stems: dict[str, str] = {}
    for sha256 in filter(here.__contains__, sources):
        stem = here[sha256].path.stem  # equal ones get a piece of the hash
        stems[sha256] = stem if stem not in stems.values() else f"{stem}_{sha256[:8]}"
    problems = [f"image {sha256[:12]}: is not among the given images; left out" for sha256 in sources if sha256 not in here]
    complete: dict[str, StoredAnnotation] = {}
    for sha256, one in sources.items():
        lacking = _lacking(one.content)
        if sha256 in here and lacking:
            problems.append(f"{here[sha256].path.name}: has no {lacking[0].value} mask; left out")
        elif sha256 in here:
            complete[sha256] = one
    if not complete:
        raise AnnotationError("no image has both a vessel and a robot mask; draw them, or take the algorithm's over, in annotate")
    measured = [one for one in (finished(annotations) if measured is None else measured) if one.key.sha256 in complete]
    if len(studies := studies_of(measured)) > 1:
        raise AnnotationError(f"the images were measured in several studies ({', '.join(studies)}); choose one with --study NAME")
    # By the method's own lengths, as the truth of every other set is.
    measured, _ = measured_alike(measured, {sha256: image.record for sha256, image in here.items()}, PerceptionConfig())
    try:
        if out.exists() and any(out.iterdir()):
            raise AnnotationError(f"{out}: is not empty; choose another --out")
        for name in ("images", "masks"):
            (out / name).mkdir(parents=True, exist_ok=True)
        for sha256, one in complete.items():
            if not go_on():
                raise AnnotationError(f"{out}: given up half-way; it is no whole set")
            image, stem = here[sha256], stems[sha256]
            ending = image.path.suffix.lower()
            if ending in IMAGE_ENDINGS:
                shutil.copyfile(image.path, out / "images" / f"{stem}{ending}")
            else:  # a kind that training does not look for
                write_png(out / "images" / f"{stem}.png", read_image(image.path))
            for target in MaskTarget:
                mask = fill(one.content.masks, target, image.record.size)
                write_mask(out / "masks" / f"{stem}_{target.value}.png", mask)
        rows = [json.dumps(row, allow_nan=False) for row in _truth_rows(measured, complete, here, stems)]
        (out / "truth.jsonl").write_text("\n".join(rows) + "\n", encoding="utf-8")
    except ImageError as error:
        raise AnnotationError(str(error)) from None
    except OSError as error:
        where = error.filename2 or error.filename or out  # a copy that fails names first what was to be copied
        raise AnnotationError(f"{where}: cannot be written ({error.strerror}); choose another --out") from None
    return len(complete), problems


def _lacking(content: Annotation) -> list[MaskTarget]:
    """The masks that a training set needs and that are not drawn; of a picture without a robot the vessel's is enough."""
    drawn = content.drawn | ({MaskTarget.ROBOT} if content.no_robot else set())
    return [target for target in MaskTarget if target not in drawn]


def _truth_rows(
    measured: Sequence[StoredAnnotation],
    complete: Mapping[str, StoredAnnotation],
    here: Mapping[str, FoundImage],
    stems: Mapping[str, str],
) -> list[dict[str, Any]]:
    """Truth by hand, from finished answers: angle and state of the common one, lines and distances of the first that has them."""
    common = {row.image: row for row in manual_measurements(measured, {sha256: sha256 for sha256 in complete})}
    rows = []
    for sha256 in complete:
        manual = common.get(sha256)
        theta = manual.manual_angle_deg if manual is not None else None
        lines = next(
            (a for a in measured if a.key.sha256 == sha256 and a.theta_deg is not None and not a.content.without_pose), None
        )
        row: dict[str, Any] = {"stem": stems[sha256], "source": "annotated by hand", "reason": None}
        if lines is None or theta is None or manual is None or manual.state is None:
            nothing = ("head_xy", "theta_deg", "theta_signed_deg", "d_head_px", "d_tail_px", "crossed", "state")
            why = Reason.NO_ROBOT.value if complete[sha256].content.no_robot else UNMEASURED
            rows.append(row | dict.fromkeys(nothing) | {"reason": why})
            continue
        readout = measure_lines(lines.content, here[sha256].record.size, PerceptionConfig())
        row |= {"head_xy": list(lines.content.robot[-1]), "robot_path_xy": [list(point) for point in lines.content.robot]}
        row |= {"robot_vector": _vector(readout.robot_vector), "vessel_vector": _vector(readout.vessel_vector)}
        row |= {"theta_deg": theta, "theta_signed_deg": math.copysign(theta, lines.theta_signed_deg or 0.0)}
        row |= {"d_head_px": lines.d_head_px, "d_tail_px": lines.d_tail_px, "crossed": lines.crossed, "state": manual.state}
        rows.append(row)
    return rows


def _vector(vector: Vector | None) -> dict[str, list[float]] | None:
    return None if vector is None else {name: list(getattr(vector, name)) for name in ("start", "center", "end")}


FEWEST = 6
"""Images with both masks below which nothing is trained: four to learn from and two to judge by."""
_HELD_OUT_SHARE, _FEWEST_HELD_OUT = 5, 2  # one image in five is held out, two at least


@dataclass(frozen=True, slots=True)
class OwnFrames:
    """Folders as ``train --data`` reads them, and how many frames each has. ``problems``: what was left out, a line each."""

    train: Path
    held_out: Path
    train_count: int
    held_out_count: int
    problems: tuple[str, ...] = ()


def split_own_frames(
    annotations: Sequence[StoredAnnotation], images: Sequence[FoundImage], out: Path, go_on: Callable[[], bool] = lambda: True
) -> OwnFrames:
    """Write a set to train on and one to judge by below `out`: a fifth of the images, two at least, is held out.

    The held-out images are neighbours in the order of names: pictures of one video are alike, and one between two that are trained
    on would not be independent. Angles and states go along where they are of one study.

    Raises AnnotationError: too few images with both masks are here, `out` is not empty, or cannot be written; or `go_on` has become
    False.
    """
    complete = trainable(annotations, images)
    count = max(_FEWEST_HELD_OUT, len(complete) // _HELD_OUT_SHARE)
    begin = (len(complete) - count) // 2
    held_out = set(complete[begin : begin + count])
    measured = finished(annotations)
    measured = measured if len(studies_of(measured)) < 2 else []
    counts, problems = {}, []
    for name in ("train", "held_out"):
        wanted = held_out if name == "held_out" else {image.sha256 for image in images} - held_out
        chosen = [one for one in annotations if one.key.sha256 in wanted]
        here_of = [image for image in images if image.sha256 in wanted]
        counts[name], found = export_training_set(chosen, here_of, out / name, go_on, measured=measured)
        problems += found
    return OwnFrames(out / "train", out / "held_out", counts["train"], counts["held_out"], tuple(problems))


def trainable(annotations: Sequence[StoredAnnotation], images: Sequence[FoundImage]) -> list[str]:
    """SHA-256 of the images with both masks, in the order of their paths. Raises AnnotationError: too few."""
    here = {image.sha256: image for image in images}
    whole = [sha256 for sha256, one in mask_source(annotations).items() if sha256 in here and not _lacking(one.content)]
    complete = sorted(whole, key=lambda one: str(here[one].path))
    if len(complete) < FEWEST:
        missing = FEWEST - len(complete)
        have = f"{len(complete)} {'image has' if len(complete) == 1 else 'images have'} both a vessel and a robot mask"
        how = "draw them with keys 3 and 4, or take over and correct the algorithm's with G"
        raise AnnotationError(f"{have}, and training needs {FEWEST}: {missing} more ({how})")
    return complete


_LINE_PX = 60.0  # length of the proposed robot line, working px: the 40 px that count and some before
_TOLERANCE_PX = 0.4  # by which a proposed line may leave the perceived one


@dataclass(frozen=True, slots=True)
class Proposal:
    """The algorithm's answer in the form of an annotation (source pixels), with its pose or the refusal."""

    annotation: Annotation
    pose: Pose | None
    confidence: float
    refusal: Refusal | None = None


def proposal_of(scene: Scene) -> Proposal:
    """The lines, the state and the masks of a perceived scene; parts that it does not have are empty."""
    robot: Line = ()
    vessel: Line = ()
    if scene.path is not None:
        total = float(geometry.arc_length(scene.path.points)[-1])
        robot = _line(scene, geometry.cut(scene.path.points, total - _LINE_PX, total))
    if scene.centerline is not None:
        vessel = _line(scene, scene.centerline.piece)
    masks: tuple[MaskPolygon, ...] = ()
    if scene.masks is not None:
        pairs = (MaskTarget.VESSEL, scene.masks.vessel), (MaskTarget.ROBOT, scene.masks.robot)
        masks = tuple(polygon for target, mask in pairs for polygon in polygons_of(_enlarged(mask, *scene.source_size), target))
    state = scene.pose.state if scene.pose is not None else None
    confidence = scene.pose.confidence if scene.pose is not None else 0.0
    return Proposal(Annotation(robot, vessel, state, masks=masks), scene.pose, confidence, scene.refusal)


def _line(scene: Scene, points: Points) -> Line:
    """The points that are needed for the line's shape, in source pixels."""
    few = cv2.approxPolyDP(points.astype(np.float32).reshape(-1, 1, 2), _TOLERANCE_PX, False)[:, 0]
    # The ends decide angle and distances: they stay exact.
    exact = np.asarray(few, np.float64)
    exact[0], exact[-1] = points[0], points[-1]
    return tuple((float(x), float(y)) for x, y in np.round(scene.points_to_source(exact), 3).tolist())


def _enlarged(mask: Mask, width: int, height: int) -> Mask:
    """The mask at the image's own size."""
    if mask.shape == (height, width):
        return mask
    soft = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(soft > 0.5)
