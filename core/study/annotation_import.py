"""From labelme and COCO files to annotations. A damaged file or shape is named in one line, and the others are read."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from core.study.annotation_images import FoundImage
from core.study.annotations import Annotation, AnnotationError, Line, MaskPolygon, MaskTarget, line_from
from core.study.mask_areas import polygons_of_area
from core.study.mask_polygons import polygons_of
from core.types import Mask

_MAX_BYTES = 500_000_000
_LABELS = {
    **dict.fromkeys(("vessel", "vessels", "lumen", "blood vessel", "artery"), MaskTarget.VESSEL),
    **dict.fromkeys(("robot", "interventional robot", "catheter", "guidewire", "device"), MaskTarget.ROBOT),
}
"""Labels that are understood, in lower case."""


@dataclass(frozen=True, slots=True)
class Imported:
    """What a file says about one image."""

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
            content = _read_json(path)
            if "shapes" in content:
                found += _labelme(path, content, by_name, problems)
            elif "annotations" in content and "images" in content:
                found += _coco(path, content, by_name, problems)
            else:
                problems.append(f"{path}: neither labelme (shapes) nor COCO (images, annotations); left out")
        except AnnotationError as error:
            problems.append(str(error))
    return found, problems


def _read_json(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise AnnotationError(f"{path}: larger than {_MAX_BYTES // 1_000_000} MB; left out")
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise AnnotationError(f"{path}: cannot be read ({error.strerror}); left out") from None
    except (ValueError, RecursionError):
        raise AnnotationError(f"{path}: damaged, not valid JSON; left out") from None
    if not isinstance(content, dict):
        raise AnnotationError(f"{path}: neither labelme nor COCO; left out")
    return content


def _image_of(
    path: Path, name: Any, width: Any, height: Any, by_name: Mapping[str, list[FoundImage]], problems: list[str]
) -> FoundImage | None:
    """The image that a file means, by its file name; None, and why, when it is not there or of another size."""
    told = str(name).replace("\\", "/")
    base = told.rpartition("/")[2]
    candidates = by_name.get(base, [])
    if len(candidates) > 1:  # in several folders: the name may say in which
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
        return list(polygons_of(_from_run_lengths(segmentation, size), target, 0.0))
    polygons: list[MaskPolygon] = []
    for flat in segmentation:
        points = line_from(list(zip(flat[::2], flat[1::2], strict=True)))
        if len(points) < 3:
            raise ValueError("a polygon of fewer than three points")
        polygons += polygons_of_area(np.array(points), target, size)
    if not polygons:
        raise ValueError("covers no pixel")
    return polygons


def _from_run_lengths(segmentation: Mapping[str, Any], size: tuple[int, int]) -> Mask:
    width, height = size
    counts = np.array(segmentation["counts"], np.int64)
    if list(segmentation["size"]) != [height, width] or counts.min(initial=0) < 0 or int(counts.sum()) != width * height:
        raise ValueError("run lengths of another size")
    values = np.arange(len(counts)) % 2 == 1
    return np.repeat(values, counts).reshape((height, width), order="F")


def _target(where: str, label: Any, problems: list[str]) -> MaskTarget | None:
    known = _LABELS.get(str(label).strip().lower())
    if known is None:
        problems.append(f"{where}: unknown label {str(label)[:40]!r} (known: {', '.join(sorted(_LABELS))}); left out")
    return known


def merged(old: Annotation, new: Annotation) -> Annotation:
    """The imported parts put into what is there: only where there was nothing, so that no work by hand is lost."""
    masks = old.masks + tuple(mask for mask in new.masks if mask.target not in old.drawn)
    return replace(old, robot=old.robot or new.robot, vessel=old.vessel or new.vessel, masks=masks)
