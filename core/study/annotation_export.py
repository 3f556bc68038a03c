"""From annotations to what others read: a training set, a COCO file."""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from core.config import PerceptionConfig
from core.images import ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS, UNMEASURED, write_mask, write_png
from core.study.annotation_images import FoundImage
from core.study.annotation_measures import measured_alike
from core.study.annotation_records import StoredAnnotation
from core.study.annotation_report import finished, manual_measurements, studies_of
from core.study.annotations import AnnotationError, MaskPolygon, MaskTarget, measure_lines
from core.study.mask_areas import area_polygon
from core.study.mask_polygons import fill
from core.types import Mask, Vector
from core.whole_file import write_whole


def mask_source(annotations: Iterable[StoredAnnotation]) -> dict[str, StoredAnnotation]:
    """By image, the annotation whose masks count: of those with both of them, or else with any, the one changed last."""
    best: dict[str, tuple[int, str]] = {}
    chosen: dict[str, StoredAnnotation] = {}
    for one in annotations:
        worth = len(one.content.drawn), one.changed_utc
        if one.content.drawn and worth >= best.get(one.key.sha256, worth):
            best[one.key.sha256], chosen[one.key.sha256] = worth, one
    return chosen


def export_training_set(
    annotations: Sequence[StoredAnnotation],
    images: Sequence[FoundImage],
    out: Path,
    go_on: Callable[[], bool] = lambda: True,
    *,
    measured: Sequence[StoredAnnotation] | None = None,
) -> tuple[int, list[str]]:
    """Write ``images/``, ``masks/`` and ``truth.jsonl`` as ``train --data`` and ``evaluate`` read them.

    Parameters
    ----------
    annotations : whose masks count, of whatever study.
    measured : finished answers of one study, whose angles and states go along; None: those among `annotations`.

    Returns
    -------
    tuple
        Number of frames written, and one line for each annotated image that was left out. An image with only one of the two masks
        is left out: without its mask a robot that is there would be taught as background.

    Raises
    ------
    AnnotationError
        The folder is not empty or cannot be written, or there is nothing to write; the images were measured in several studies; or
        `go_on`, asked before each image, is False.
    """
    sources = mask_source(annotations)
    here = {image.sha256: image for image in images}
    stems = _stems([here[sha256] for sha256 in sources if sha256 in here])
    problems = [f"image {sha256[:12]}: is not among the given images; left out" for sha256 in sources if sha256 not in here]
    complete: dict[str, StoredAnnotation] = {}
    for sha256, one in sources.items():
        lacking = [target for target in MaskTarget if target not in one.content.drawn]
        if sha256 in here and lacking:
            problems.append(f"{here[sha256].path.name}: has no {lacking[0].value} mask; left out")
        elif sha256 in here:
            complete[sha256] = one
    if not complete:
        raise AnnotationError("no image has both a vessel and a robot mask; draw them, or take the model's over, in annotate")
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
            _put_image(image.path, out / "images", stem)
            for target in MaskTarget:
                mask = fill(one.content.masks, target, image.record.size)
                write_mask(out / "masks" / f"{stem}_{target.value}.png", mask)
        rows = [json.dumps(row, allow_nan=False) for row in _truth_rows(measured, complete, here, stems)]
        (out / "truth.jsonl").write_text("\n".join(rows) + "\n", encoding="utf-8")
    except OSError as error:
        where = error.filename2 or error.filename or out  # a copy that fails names first what was to be copied
        raise AnnotationError(f"{where}: cannot be written ({error.strerror}); choose another --out") from None
    return len(complete), problems


def _put_image(path: Path, folder: Path, stem: str) -> None:
    """The file as it is, or as PNG where it is of a kind that training does not look for. Raises OSError, AnnotationError."""
    ending = path.suffix.lower()
    if ending in IMAGE_ENDINGS:
        shutil.copyfile(path, folder / f"{stem}{ending}")
        return
    try:
        write_png(folder / f"{stem}.png", read_image(path))
    except ImageError as error:
        raise AnnotationError(str(error)) from None


def _stems(images: Sequence[FoundImage]) -> dict[str, str]:
    """A file name without ending for each image; equal ones get a piece of the hash."""
    used: set[str] = set()
    stems = {}
    for image in images:
        stem = image.path.stem if image.path.stem not in used else f"{image.path.stem}_{image.sha256[:8]}"
        used.add(stem)
        stems[image.sha256] = stem
    return stems


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
            (a for a in measured if a.key.sha256 == sha256 and a.theta_deg is not None and not a.content.cannot_tell), None
        )
        row: dict[str, Any] = {"stem": stems[sha256], "source": "annotated by hand", "reason": None}
        if lines is None or theta is None or manual is None or manual.state is None:
            nothing = ("head_xy", "theta_deg", "theta_signed_deg", "d_head_px", "d_tail_px", "crossed", "state")
            rows.append(row | dict.fromkeys(nothing) | {"reason": UNMEASURED})
            continue
        readout = measure_lines(lines.content, here[sha256].record.size, PerceptionConfig())
        row |= {"head_xy": list(lines.content.robot[-1]), "robot_path_xy": [list(point) for point in lines.content.robot]}
        row |= {"robot_vector": _vector(readout.robot_vector), "vessel_vector": _vector(readout.vessel_vector)}
        row |= {"theta_deg": theta, "theta_signed_deg": math.copysign(theta, lines.theta_signed_deg or 0.0)}
        row |= {"d_head_px": lines.d_head_px, "d_tail_px": lines.d_tail_px, "crossed": lines.crossed, "state": manual.state}
        rows.append(row)
    return rows


def _names_of(images: Sequence[FoundImage]) -> dict[Path, str]:
    """What files call the images: their names, or, where several have one, their places below the folder that has all of them."""
    if len({image.path.name for image in images}) == len(images):
        return {image.path: image.path.name for image in images}
    common = Path(os.path.commonpath([image.path.absolute().parent for image in images]))
    return {image.path: image.path.absolute().relative_to(common).as_posix() for image in images}


def _vector(vector: Vector | None) -> dict[str, list[float]] | None:
    return None if vector is None else {name: list(getattr(vector, name)) for name in ("start", "center", "end")}


def export_coco(annotations: Iterable[StoredAnnotation], images: Sequence[FoundImage], out: Path) -> int:
    """Write the masks as a COCO file; returns the number of images in it. Pieces with holes are run lengths, others polygons.

    Raises AnnotationError when there is nothing to write or the file cannot be written; one that is there is not overwritten.
    """
    categories = {target: number for number, target in enumerate(MaskTarget, 1)}
    here = {image.sha256: image for image in images}
    names = _names_of(images)
    content: dict[str, list[dict[str, Any]]] = {
        "images": [],
        "annotations": [],
        "categories": [{"id": number, "name": target.value, "supercategory": ""} for target, number in categories.items()],
    }
    for sha256, one in mask_source(annotations).items():
        if sha256 not in here:
            continue
        image, number = here[sha256], len(content["images"]) + 1
        width, height = image.record.size
        content["images"].append({"id": number, "file_name": names[image.path], "width": width, "height": height})
        for piece in _pieces(one.content.masks):
            row = _coco_piece(piece, image.record.size)
            ids = {"id": len(content["annotations"]) + 1, "image_id": number, "category_id": categories[piece[0].target]}
            content["annotations"].append(ids | row)
    if not content["images"]:
        raise AnnotationError("no image has a mask; draw them, or take the model's over, in annotate")
    if out.exists():
        raise AnnotationError(f"{out}: is there already; choose another --out")
    try:
        write_whole(out, json.dumps(content, allow_nan=False).encode())
    except OSError as error:
        raise AnnotationError(f"{out}: cannot be written ({error.strerror}); choose another --out") from None
    return len(content["images"])


def _pieces(masks: Sequence[MaskPolygon]) -> list[list[MaskPolygon]]:
    """Each outer polygon with the holes that follow it."""
    pieces: list[list[MaskPolygon]] = []
    for mask in masks:
        if not mask.is_hole:
            pieces.append([mask])
        elif pieces and pieces[-1][0].target is mask.target:
            pieces[-1].append(mask)
    return pieces


def _coco_piece(piece: Sequence[MaskPolygon], size: tuple[int, int]) -> dict[str, Any]:
    mask = fill(piece, piece[0].target, size)
    rows, columns = np.nonzero(mask)
    box = [0, 0, 0, 0]
    if len(rows):
        box = [int(columns.min()), int(rows.min()), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1]
    polygon = area_polygon(mask)
    whole = {"size": [size[1], size[0]], "counts": run_lengths(mask)}
    segmentation = whole if polygon is None else [[round(value, 3) for point in polygon.tolist() for value in point]]
    return {"segmentation": segmentation, "bbox": box, "area": int(mask.sum()), "iscrowd": 0}


def run_lengths(mask: Mask) -> list[int]:
    """COCO's uncompressed run lengths: column by column, beginning with the number of zeros."""
    flat = np.concatenate([[False], mask.ravel(order="F"), [False]])
    changes = np.flatnonzero(flat[1:] != flat[:-1])
    edges = np.concatenate([[0], changes, [mask.size]])
    counts: list[int] = np.diff(edges).tolist()
    return counts[:-1] if counts[-1] == 0 else counts
