"""Annotations out of and into other forms: labelme and COCO files, training sets, and the algorithm's proposal.

A damaged file or shape is named in one line, and the others are read.
"""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from core import geometry
from core.annotation.agreement_report import finished, manual_measurements, measured_alike, studies_of
from core.annotation.masks import area_polygon, fill, polygons_of, polygons_of_area
from core.annotation.model import Annotation, AnnotationError, Line, MaskPolygon, MaskTarget, line_from, measure_lines
from core.annotation.store import FoundImage, StoredAnnotation
from core.config.models import PerceptionConfig
from core.files import ImageError, read_image, write_atomic
from core.learning.dataset import IMAGE_ENDINGS, UNMEASURED, write_mask, write_png
from core.types import Mask, Points, Pose, Refusal, Scene, Vector

_MAX_BYTES = 500_000_000
# Labels that are understood, in lower case.
_LABELS = {
    **dict.fromkeys(("vessel", "vessels", "lumen", "blood vessel", "artery"), MaskTarget.VESSEL),
    **dict.fromkeys(("robot", "interventional robot", "catheter", "guidewire", "device"), MaskTarget.ROBOT),
}


@dataclass(frozen=True, slots=True)
class Imported:
    """The annotation of one image in a file."""

    image: FoundImage
    content: Annotation
    source: Path


def read_files(paths: Iterable[Path], images: Iterable[FoundImage]) -> tuple[list[Imported], list[str]]:
    """Read labelme and COCO files (told apart by their content).

    Parameters
    ----------
    paths : files.
    images : those that the annotations may belong to; a file's image is found among them by its name.

    Returns
    -------
    tuple
        What was read, and one line for each thing that was not.
    """
    by_name: dict[str, list[FoundImage]] = {}
    for image in images:
        by_name.setdefault(image.path.name, []).append(image)
    found: list[Imported] = []
    problems: list[str] = []
    for path in paths:
        try:
            if path.stat().st_size > _MAX_BYTES:
                raise AnnotationError(f"{path}: larger than {_MAX_BYTES // 1_000_000} MB; left out")
            content = json.loads(path.read_text(encoding="utf-8-sig"))
            if not isinstance(content, dict):
                raise AnnotationError(f"{path}: neither labelme nor COCO; left out")
            if "shapes" in content:
                found += _labelme(path, content, by_name, problems)
            elif "annotations" in content and "images" in content:
                found += _coco(path, content, by_name, problems)
            else:
                problems.append(f"{path}: neither labelme (shapes) nor COCO (images, annotations); left out")
        except OSError as error:
            problems.append(f"{path}: cannot be read ({error.strerror}); left out")
        except AnnotationError as error:
            problems.append(str(error))
        except (ValueError, RecursionError):
            problems.append(f"{path}: damaged, not valid JSON; left out")
    return found, problems


def _image_of(
    path: Path, name: Any, width: Any, height: Any, by_name: Mapping[str, list[FoundImage]], problems: list[str]
) -> FoundImage | None:
    """The image that a file means, by its file name; None, and why, when it is not there or of another size."""
    told = str(name).replace("\\", "/")
    base = told.rpartition("/")[2]
    candidates = by_name.get(base, [])
    if len(candidates) > 1:  # in several folders: the name may include one
        ending = "/" + told.lstrip("./")
        candidates = [one for one in candidates if one.path.absolute().as_posix().endswith(ending)] or candidates
    if not candidates:
        problems.append(f"{path}: its image {base!r} is not among the given ones; left out")
        return None
    if len(candidates) > 1:
        problems.append(f"{path}: {len(candidates)} images are called {base!r}; left out")
        return None
    size = candidates[0].record.size
    if (width, height) != (None, None) and (width, height) != size:
        problems.append(f"{path}: says that {base} is {width}x{height}, but it is {size[0]}x{size[1]}; left out")
        return None
    return candidates[0]


def _labelme(path: Path, content: dict[str, Any], by_name: Mapping[str, list[FoundImage]], problems: list[str]) -> list[Imported]:
    image = _image_of(path, content.get("imagePath"), content.get("imageWidth"), content.get("imageHeight"), by_name, problems)
    if image is None:
        return []
    shapes = content["shapes"]
    if not isinstance(shapes, list):
        raise AnnotationError(f"{path}: its shapes are damaged; left out")
    masks: list[MaskPolygon] = []
    lines: dict[str, Line] = {}
    for number, shape in enumerate(shapes, 1):
        where = f"{path}: shape {number}"
        try:
            target = _target(where, shape["label"], problems)
            points = line_from(shape["points"])
            kind = shape.get("shape_type", "polygon")
        except (TypeError, KeyError, ValueError, AttributeError):
            problems.append(f"{where} is damaged; left out")
            continue
        if target is None:
            continue
        if kind == "rectangle" and len(points) == 2:
            (x0, y0), (x1, y1) = points
            kind, points = "polygon", ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
        if kind == "polygon" and len(points) >= 3:
            found = polygons_of_area(np.array(points), target, image.record.size)
            if not found:
                problems.append(f"{where} covers no pixel; left out")
            masks += found
        elif kind in ("linestrip", "line") and len(points) >= 2 and target.value not in lines:
            # labelme counts from pixel corners, we from pixel centres
            lines[target.value] = tuple((x - 0.5, y - 0.5) for x, y in points)
        else:
            problems.append(f"{where} is a {kind} of {len(points)} points, not a polygon or the one line of its label; left out")
    if not masks and not lines:
        problems.append(f"{path}: nothing of use in it; left out")
        return []
    return [Imported(image, Annotation(lines.get("robot", ()), lines.get("vessel", ()), masks=tuple(masks)), path)]


def _coco(path: Path, content: dict[str, Any], by_name: Mapping[str, list[FoundImage]], problems: list[str]) -> list[Imported]:
    try:
        names = {row["id"]: row["name"] for row in content["categories"]}
        listed = {row["id"]: (row["file_name"], row.get("width"), row.get("height")) for row in content["images"]}
        rows = list(content["annotations"])
    except (TypeError, KeyError, AttributeError):
        raise AnnotationError(f"{path}: its images or categories are damaged; left out") from None
    images: dict[Any, FoundImage | None] = {}
    masks: dict[Any, list[MaskPolygon]] = {}
    for number, row in enumerate(rows, 1):
        where = f"{path}: annotation {number}"
        try:
            image_id, label, segmentation = row["image_id"], names[row["category_id"]], row["segmentation"]
            if image_id not in images:
                images[image_id] = _image_of(path, *listed[image_id], by_name, problems)
            image, target = images[image_id], _target(where, label, problems)
            if image is not None and target is not None:
                masks.setdefault(image_id, []).extend(_segmentation(segmentation, target, image.record.size))
        except (TypeError, KeyError, ValueError, AttributeError, OverflowError, MemoryError) as error:
            reason = f" ({error})" if isinstance(error, ValueError) else ""
            problems.append(f"{where} is damaged{reason}; left out")
    read = []
    for image_id, polygons in masks.items():
        image = images[image_id]
        if image is not None and polygons:
            read.append(Imported(image, Annotation(masks=tuple(polygons)), path))
    return read


def _segmentation(segmentation: Any, target: MaskTarget, size: tuple[int, int]) -> list[MaskPolygon]:
    if isinstance(segmentation, dict):
        if not isinstance(segmentation.get("counts"), list):
            raise ValueError("compressed run lengths are not read: write polygons or plain run lengths")
        width, height = size
        counts = np.array(segmentation["counts"], np.int64)
        if list(segmentation["size"]) != [height, width] or counts.min(initial=0) < 0 or int(counts.sum()) != width * height:
            raise ValueError("run lengths of another size")
        mask = np.repeat(np.arange(len(counts)) % 2 == 1, counts).reshape((height, width), order="F")
        return list(polygons_of(mask, target, 0.0))
    polygons: list[MaskPolygon] = []
    for flat in segmentation:
        points = line_from(list(zip(flat[::2], flat[1::2], strict=True)))
        if len(points) < 3:
            raise ValueError("a polygon of fewer than three points")
        polygons += polygons_of_area(np.array(points), target, size)
    if not polygons:
        raise ValueError("covers no pixel")
    return polygons


def _target(where: str, label: Any, problems: list[str]) -> MaskTarget | None:
    known = _LABELS.get(str(label).strip().lower())
    if known is None:
        problems.append(f"{where}: unknown label {str(label)[:40]!r} (known: {', '.join(sorted(_LABELS))}); left out")
    return known


def merged(old: Annotation, new: Annotation) -> Annotation:
    """The imported parts put into what is there: only where there was nothing, so that no work by hand is lost."""
    masks = old.masks + tuple(mask for mask in new.masks if mask.target not in old.drawn)
    return replace(old, robot=old.robot or new.robot, vessel=old.vessel or new.vessel, masks=masks)


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
    annotations : whose masks count, of any study.
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
    stems: dict[str, str] = {}
    for sha256 in filter(here.__contains__, sources):
        stem = here[sha256].path.stem  # equal ones get a piece of the hash
        stems[sha256] = stem if stem not in stems.values() else f"{stem}_{sha256[:8]}"
    problems = [f"image {sha256[:12]}: is not among the given images; left out" for sha256 in sources if sha256 not in here]
    complete: dict[str, StoredAnnotation] = {}
    for sha256, one in sources.items():
        lacking = [target for target in MaskTarget if target not in one.content.drawn]
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
            rows.append(row | dict.fromkeys(nothing) | {"reason": UNMEASURED})
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


def export_coco(annotations: Iterable[StoredAnnotation], images: Sequence[FoundImage], out: Path) -> int:
    """Write the masks as a COCO file; returns the number of images in it. Pieces with holes are run lengths, others polygons.

    Raises AnnotationError when there is nothing to write or the file cannot be written; one that is there is not overwritten.
    """
    categories = {target: number for number, target in enumerate(MaskTarget, 1)}
    here = {image.sha256: image for image in images}
    # Files name the images; where several have one name, by their places below the folder that has all of them.
    names = {image.path: image.path.name for image in images}
    if len(set(names.values())) < len(images):
        common = Path(os.path.commonpath([image.path.absolute().parent for image in images]))
        names = {image.path: image.path.absolute().relative_to(common).as_posix() for image in images}
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
        pieces: list[list[MaskPolygon]] = []  # each outer polygon with the holes that follow it
        for polygon in one.content.masks:
            if not polygon.is_hole:
                pieces.append([polygon])
            elif pieces and pieces[-1][0].target is polygon.target:
                pieces[-1].append(polygon)
        for piece in pieces:
            ids = {"id": len(content["annotations"]) + 1, "image_id": number, "category_id": categories[piece[0].target]}
            content["annotations"].append(ids | _coco_piece(piece, image.record.size))
    if not content["images"]:
        raise AnnotationError("no image has a mask; draw them, or take the algorithm's over, in annotate")
    if out.exists():
        raise AnnotationError(f"{out}: is there already; choose another --out")
    try:
        write_atomic(out, json.dumps(content, allow_nan=False).encode())
    except OSError as error:
        raise AnnotationError(f"{out}: cannot be written ({error.strerror}); choose another --out") from None
    return len(content["images"])


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


def count_complete(annotations: Sequence[StoredAnnotation]) -> int:
    """Images with both masks."""
    return len(_complete(annotations))


def split_own_frames(
    annotations: Sequence[StoredAnnotation],
    images: Sequence[FoundImage],
    out: Path,
    go_on: Callable[[], bool] = lambda: True,
) -> OwnFrames:
    """Write a set to train on and one to judge by below `out`: a fifth of the images, two at least, is held out.

    The held-out images are neighbours in the order of names: pictures of one video are alike, and one between two that are trained
    on would not be independent. Angles and states go along where they are of one study.

    Raises
    ------
    AnnotationError
        Too few images with both masks are here, `out` is not empty, or cannot be written; or `go_on` has become False.
    """
    here = {image.sha256: image for image in images}
    complete = sorted((sha256 for sha256 in _complete(annotations) if sha256 in here), key=lambda one: str(here[one].path))
    if len(complete) < FEWEST:
        missing = FEWEST - len(complete)
        have = f"{len(complete)} {'image has' if len(complete) == 1 else 'images have'} both a vessel and a robot mask"
        how = "draw them with keys 3 and 4, or take over and correct the algorithm's with G"
        raise AnnotationError(f"{have}, and training needs {FEWEST}: {missing} more ({how})")
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


def _complete(annotations: Sequence[StoredAnnotation]) -> list[str]:
    """SHA-256 of the images whose masks that count are there for both targets."""
    return [sha256 for sha256, one in mask_source(annotations).items() if one.content.drawn.issuperset(MaskTarget)]


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
