"""Annotations as other programs write and read them: labelme, COCO, PNG label maps, CVAT, ImageJ. ``FORMATS`` lists them.

Other programs count from pixel corners, we from pixel centres. A damaged file or shape is named in one line, and the others are
read. Lines go from the robot's tail to its head.
"""

from __future__ import annotations

import base64
import io
import json
import os
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
from numpy.typing import NDArray

from core.annotation.masks import area_of, area_polygon, area_rings, fill, polygons_of, polygons_of_area
from core.annotation.model import Annotation, AnnotationError, Line, MaskPolygon, MaskTarget, line_from
from core.annotation.store import FoundImage, StoredAnnotation
from core.files import write_atomic
from core.learning.dataset import write_png
from core.program import program_id
from core.types import Mask, Points

_MAX_BYTES = 500_000_000
"""Larger files are left out."""
_LABELS = {
    **dict.fromkeys(("vessel", "vessels", "lumen", "blood vessel", "artery"), MaskTarget.VESSEL),
    **dict.fromkeys(("robot", "interventional robot", "catheter", "guidewire", "device"), MaskTarget.ROBOT),
}
"""Labels that are understood, in lower case."""
_SUFFIX = re.compile(r"[\s_-]*(line|mask)?[\s_-]*\d*$")
"""What may follow a label: robot line, vessel-2."""
_DAMAGE = (TypeError, KeyError, ValueError, AttributeError, OverflowError, MemoryError, IndexError)
"""What reading a damaged shape raises."""


@dataclass(frozen=True, slots=True)
class Imported:
    """The annotation of one image in a file."""

    image: FoundImage
    content: Annotation
    source: Path


@dataclass(frozen=True, slots=True)
class Format:
    """Of another program, by its name in commands. Without ``write`` it can only be read; that writes a folder unless
    ``writes_file``."""

    name: str
    title: str
    ending: str
    write: Callable[[Sequence[tuple[FoundImage, Annotation]], Mapping[Path, str], Path], None] | None = None
    writes_file: bool = False
    has_lines: bool = False


def read_files(paths: Iterable[Path], images: Iterable[FoundImage]) -> tuple[list[Imported], list[str]]:
    """Read files of the formats in ``FORMATS``, told apart by ending and content; and one line for each thing that was not read.

    The image of an annotation is found by its name among `images`.
    """
    read = _Reading(images)
    for path in paths:
        try:
            if path.stat().st_size > _MAX_BYTES:
                raise AnnotationError(f"{path}: larger than {_MAX_BYTES // 1_000_000} MB; left out")
            _READERS.get(path.suffix.lower(), _read_json)(path, read)
        except OSError as error:
            read.problems.append(f"{path}: cannot be read ({error.strerror or error}); left out")
        except AnnotationError as error:
            read.problems.append(str(error))
    found = []
    for content in read.contents.values():
        if content.masks or content.lines:
            annotation = Annotation(content.lines.get("robot", ()), content.lines.get("vessel", ()), masks=tuple(content.masks))
            found.append(Imported(content.image, annotation, content.path))
        else:
            read.problems.append(f"{content.path}: nothing of use in it for {content.image.path.name}; left out")
    return found, read.problems


@dataclass(slots=True)
class _Content:
    """What a file says about one image."""

    path: Path
    image: FoundImage
    problems: list[str]
    masks: list[MaskPolygon] = field(default_factory=list)
    lines: dict[str, Line] = field(default_factory=dict)

    def add(self, where: str, label: Any, kind: str, points: Any) -> None:
        """An area or a line of points [x, y], counted from pixel corners. Raises ValueError for damaged points."""
        target, points = _target(where, label, self.problems), line_from(points)
        if target is None:
            return
        if kind == "rectangle" and len(points) == 2:
            (x0, y0), (x1, y1) = points
            kind, points = "polygon", ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
        if kind == "polygon" and len(points) >= 3:
            found = polygons_of_area(np.array(points), target, self.image.record.size)
            if not found:
                self.problems.append(f"{where} covers no pixel; left out")
            self.masks += found
        elif kind in ("linestrip", "line", "polyline") and len(points) >= 2 and target.value not in self.lines:
            self.lines[target.value] = tuple((x - 0.5, y - 0.5) for x, y in points)
        else:
            self.problems.append(
                f"{where} is a {kind} of {len(points)} points, not a polygon or the one line of its label; left out"
            )

    def add_mask(self, where: str, label: Any, patch: Mask, left: int = 0, top: int = 0) -> None:
        """A mask (h, w) whose first pixel lies at (`left`, `top`). Raises ValueError where it is not all in the picture."""
        target, (width, height) = _target(where, label, self.problems), self.image.record.size
        if left < 0 or top < 0 or left + patch.shape[1] > width or top + patch.shape[0] > height:
            raise ValueError("a mask beyond the picture")
        if target is not None:
            whole = np.zeros((height, width), np.bool_)
            whole[top : top + patch.shape[0], left : left + patch.shape[1]] = patch
            self.masks += polygons_of(whole, target, 0.0)


class _Reading:
    """What was read so far, by file and image."""

    def __init__(self, images: Iterable[FoundImage]) -> None:
        self.contents: dict[tuple[Path, str], _Content] = {}
        self.problems: list[str] = []
        self._by_name: dict[str, list[FoundImage]] = {}
        for image in images:
            for name in {image.path.name, image.path.stem}:
                self._by_name.setdefault(name, []).append(image)

    def content(self, path: Path, name: Any, size: tuple[Any, Any] = (None, None)) -> _Content | None:
        """Of the image that a file calls `name`; None, and a line that says why, when it is not there or of another size."""
        told = str(name).replace("\\", "/")
        base = told.rpartition("/")[2]
        candidates = self._by_name.get(base, [])
        if len(candidates) > 1:  # in several folders: the name may include one
            ending = "/" + told.lstrip("./")
            places = {one: one.path.absolute() for one in candidates}
            endings = {one: (place.as_posix(), place.with_suffix("").as_posix()) for one, place in places.items()}
            candidates = [one for one in candidates if any(text.endswith(ending) for text in endings[one])] or candidates
        if not candidates:
            self.problems.append(f"{path}: its image {base!r} is not among the given ones; left out")
            return None
        if len(candidates) > 1:
            self.problems.append(f"{path}: {len(candidates)} images are called {base!r}; left out")
            return None
        image = candidates[0]
        width, height = image.record.size
        if size not in ((None, None), (width, height)):
            self.problems.append(f"{path}: says that {base} is {size[0]}x{size[1]}, but it is {width}x{height}; left out")
            return None
        return self.contents.setdefault((path, image.sha256), _Content(path, image, self.problems))

    @contextmanager
    def shape(self, where: str) -> Iterator[None]:
        """What is damaged in it is named, and the next shape is read."""
        try:
            yield
        except _DAMAGE as error:
            reason = f" ({str(error).splitlines()[0]})" if isinstance(error, ValueError) and str(error) else ""
            self.problems.append(f"{where} is damaged{reason}; left out")


def _target(where: str, label: Any, problems: list[str]) -> MaskTarget | None:
    name = str(label).strip().lower()
    known = _LABELS.get(name) or _LABELS.get(_SUFFIX.sub("", name))
    if known is None:
        problems.append(f"{where}: unknown label {str(label)[:40]!r} (known: {', '.join(sorted(_LABELS))}); left out")
    return known


def _read_json(path: Path, read: _Reading) -> None:
    """Labelme or COCO, which is told by the content."""
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError):
        raise AnnotationError(f"{path}: damaged, not valid JSON; left out") from None
    if isinstance(content, dict) and "shapes" in content:
        _read_labelme(path, content, read)
    elif isinstance(content, dict) and "annotations" in content and "images" in content:
        _read_coco(path, content, read)
    else:
        raise AnnotationError(f"{path}: neither labelme (shapes) nor COCO (images, annotations); left out")


def _read_labelme(path: Path, content: dict[str, Any], read: _Reading) -> None:
    found = read.content(path, content.get("imagePath"), (content.get("imageWidth"), content.get("imageHeight")))
    if not isinstance(content["shapes"], list):
        raise AnnotationError(f"{path}: its shapes are damaged; left out")
    for number, shape in enumerate(content["shapes"] if found is not None else (), 1):
        where = f"{path}: shape {number}"
        with read.shape(where):
            assert found is not None
            kind = shape.get("shape_type", "polygon")
            if kind == "mask":
                (left, top), _ = line_from(shape["points"])
                patch = _decoded(base64.b64decode(shape["mask"]), cv2.IMREAD_GRAYSCALE)
                found.add_mask(where, shape["label"], np.asarray(patch > 0, np.bool_), round(left), round(top))
            else:
                found.add(where, shape["label"], str(kind), shape["points"])


def _decoded(data: bytes, flags: int) -> NDArray[Any]:
    """A PNG's pixels (H, W) or (H, W, 3 or 4). Raises ValueError."""
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    except cv2.error:  # larger than OpenCV allows
        pixels = None
    if pixels is None:
        raise ValueError("no PNG that can be read")
    return pixels


def _read_coco(path: Path, content: dict[str, Any], read: _Reading) -> None:
    try:
        names = {row["id"]: row["name"] for row in content["categories"]}
        listed = {row["id"]: (row["file_name"], (row.get("width"), row.get("height"))) for row in content["images"]}
        rows = list(content["annotations"])
    except (TypeError, KeyError, AttributeError):
        raise AnnotationError(f"{path}: its images or categories are damaged; left out") from None
    contents: dict[Any, _Content | None] = {}
    for number, row in enumerate(rows, 1):
        where = f"{path}: annotation {number}"
        with read.shape(where):
            image, label, segmentation = row["image_id"], names[row["category_id"]], row["segmentation"]
            if image not in contents:
                contents[image] = read.content(path, *listed[image])
            found = contents[image]
            if found is None:
                continue
            if isinstance(segmentation, dict):
                width, height = found.image.record.size
                counts = segmentation["counts"]
                runs = decompressed_runs(counts) if isinstance(counts, str) else counts
                if list(segmentation["size"]) != [height, width]:
                    raise ValueError("run lengths of another size")
                found.add_mask(where, label, _from_runs(runs, (width, height)).T)
                continue
            polygons = [list(zip(flat[::2], flat[1::2], strict=True)) for flat in segmentation]
            if not polygons or min(map(len, polygons)) < 3:
                raise ValueError("a polygon of fewer than three points")
            for polygon in polygons:
                found.add(where, label, "polygon", polygon)


def decompressed_runs(text: str) -> list[int]:
    """COCO's compressed run lengths as numbers. Raises ValueError for a damaged text.

    Five bits a character, the lowest first, from ``chr(48)`` on; bit 5: more follow; bit 4 of the last one: the number is negative.
    From the fourth number on it is the difference to the last but one.
    """
    runs: list[int] = []
    number = bits = 0
    for character in text.encode("ascii"):
        code = character - 48
        if not 0 <= code < 64:
            raise ValueError("run lengths with a character that does not belong there")
        number |= (code & 31) << bits
        bits += 5
        if code & 32:
            continue
        if code & 16:
            number -= 1 << bits
        runs.append(number + (runs[-2] if len(runs) > 2 else 0))
        number = bits = 0
    if bits:
        raise ValueError("run lengths that are cut short")
    return runs


def _from_runs(runs: Any, shape: tuple[int, int]) -> Mask:
    """The mask of `shape` whose rows one after the other are so many pixels outside, inside, outside ... Raises ValueError."""
    counts = np.array(runs, np.int64)
    if counts.min(initial=0) < 0 or int(counts.sum()) != shape[0] * shape[1]:
        raise ValueError("run lengths of another size")
    return np.repeat(np.arange(len(counts)) % 2 == 1, counts).reshape(shape)


_LABEL_MAP = ("background", "vessel", "robot", "vessel+robot")
"""What the values of a label map mean without a ``labels.txt`` beside it, which has a line for each value."""
_NO_LABELS = frozenset(("", "background", "_background_", "__ignore__"))
"""Lines of ``labels.txt`` without a label."""


def _read_label_map(path: Path, read: _Reading) -> None:
    """One picture of label numbers, grey or in VOC's colours (as labelme and CVAT write them), called like its image."""
    found = read.content(path, "/".join(path.absolute().with_suffix("").parts[-2:]))
    if found is None:
        return
    try:
        pixels = _decoded(path.read_bytes(), cv2.IMREAD_UNCHANGED)
    except ValueError as error:
        raise AnnotationError(f"{path}: damaged, {error}; left out") from None
    if pixels.shape[:2] != found.image.record.size[::-1]:
        given, real = f"{pixels.shape[1]}x{pixels.shape[0]}", "x".join(map(str, found.image.record.size))
        raise AnnotationError(f"{path}: is {given}, but its image is {real}; left out")
    if pixels.ndim == 3:  # colour k has the lowest bits of k in red, green and blue
        if not np.isin(pixels[:, :, :3], (0, 128)).all():
            raise AnnotationError(f"{path}: is a picture in colours, not a map of labels; left out")
        pixels = (pixels[:, :, 2::-1] > 0) @ np.array([1, 2, 4])
    table = path.with_name("labels.txt")
    labels = table.read_text(encoding="utf-8", errors="replace").splitlines() if table.is_file() else _LABEL_MAP
    values = np.unique(pixels).tolist()
    if unknown := [value for value in values if value >= len(labels)]:
        some = ", ".join(map(str, unknown[:3])) + ", ..." * (len(unknown) > 3)
        read.problems.append(f"{path}: pixels of value {some} have no label (0 to {len(labels) - 1} have); left out")
    masks: dict[MaskTarget, Mask] = {}
    for value in values:
        for label in labels[value].split("+") if value < len(labels) else ():
            if label.strip().lower() not in _NO_LABELS:
                target = _target(f"{path}: value {value}", label, read.problems)
                if target is not None:
                    masks[target] = masks.get(target, np.zeros(pixels.shape, np.bool_)) | (pixels == value)
    for target, mask in masks.items():
        found.add_mask(str(path), target.value, mask)


def _read_cvat(path: Path, read: _Reading) -> None:
    """*CVAT for images 1.1*: polygons, boxes, masks, and polylines as lines."""
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except ElementTree.ParseError as error:
        raise AnnotationError(f"{path}: damaged, not valid XML ({error}); left out") from None
    if root.tag != "annotations" or root.find("image") is None:
        raise AnnotationError(f"{path}: no images of CVAT in it; export it as CVAT for images 1.1; left out")
    for element in root.iter("image"):
        sides = (element.get("width"), element.get("height"))
        width, height = (int(side) if side and side.isascii() and side.isdigit() else side for side in sides)
        found = read.content(path, element.get("name"), (width, height))
        for number, shape in enumerate(element if found is not None else (), 1):
            where = f"{path}: {element.get('name')}: {shape.tag} {number}"
            with read.shape(where):
                assert found is not None
                value = shape.attrib
                if shape.tag == "mask":
                    left, top, across, down = (int(value[name]) for name in ("left", "top", "width", "height"))
                    if not (0 < across <= found.image.record.width and 0 < down <= found.image.record.height):
                        raise ValueError("a mask beyond the picture")
                    patch = _from_runs([int(run) for run in value["rle"].split(",")], (down, across))
                    found.add_mask(where, value["label"], patch, left, top)
                elif shape.tag == "box":
                    corners = [[float(value[x]), float(value[y])] for x, y in (("xtl", "ytl"), ("xbr", "ybr"))]
                    found.add(where, value["label"], "rectangle", corners)
                elif shape.tag != "tag":  # a tag has no place in the picture
                    points = [[float(part) for part in pair.split(",")] for pair in value["points"].split(";")]
                    found.add(where, value["label"], shape.tag, points)


def _read_imagej(path: Path, read: _Reading) -> None:
    """The ROI Manager's ``NAME.zip`` of the image NAME; the names of the regions are their labels."""
    import roifile

    kinds = roifile.ROI_TYPE
    areas = {kinds.POLYGON, kinds.FREEHAND, kinds.TRACED}
    lines = {kinds.LINE, kinds.POLYLINE, kinds.FREELINE}
    found = read.content(path, path.stem)
    if found is None:
        return
    try:
        with zipfile.ZipFile(path) as archive:
            entries = [one for one in archive.infolist() if one.filename.lower().endswith(".roi")]
            if not entries:
                raise AnnotationError(f"{path}: no ImageJ ROI in it (of a CVAT export, unpack annotations.xml); left out")
            if sum(one.file_size for one in entries) > _MAX_BYTES:
                raise AnnotationError(f"{path}: larger than {_MAX_BYTES // 1_000_000} MB; left out")
            files = [(one.filename, archive.read(one)) for one in entries]
    except (zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError):
        raise AnnotationError(f"{path}: damaged, not a ZIP file; left out") from None
    for name, data in files:
        where = f"{path}: {name}"
        with read.shape(where):
            try:
                roi = roifile.ImagejRoi.frombytes(data)
                coordinates = [np.asarray(one, np.float64) for one in roi.coordinates(multi=True)]
            except (*_DAMAGE, struct.error, RuntimeError, AssertionError):
                raise ValueError("no ImageJ ROI that can be read") from None
            label = roi.name or Path(name).stem
            if roi.composite or (roi.roitype is kinds.RECT and not roi.rounded_rect_arc_size):
                size = found.image.record.size
                whole = np.zeros((size[1], size[0]), np.bool_)
                for ring in coordinates:  # holes are rings within others
                    whole ^= area_of(np.array(line_from(ring.tolist())), size)
                found.add_mask(where, label, whole)
            else:
                kind = "polygon" if roi.roitype in areas else "polyline" if roi.roitype in lines else roi.roitype.name.lower()
                found.add(where, label, kind, coordinates[0].tolist())


_READERS: dict[str, Callable[[Path, _Reading], None]] = {
    ".json": _read_json,
    ".png": _read_label_map,
    ".xml": _read_cvat,
    ".zip": _read_imagej,
}
"""By the ending of a file; others are taken for JSON."""

_Chosen = Sequence[tuple[FoundImage, Annotation]]
_Names = Mapping[Path, str]
"""What a file calls an image: its name, or its place below the common folder where several have one name."""


def mask_source(annotations: Iterable[StoredAnnotation]) -> dict[str, StoredAnnotation]:
    """By image, the annotation whose masks count: of those with both of them, or else with any, the one changed last."""
    best: dict[str, tuple[int, str]] = {}
    chosen: dict[str, StoredAnnotation] = {}
    for one in annotations:
        worth = len(one.content.drawn), one.changed_utc
        if one.content.drawn and worth >= best.get(one.key.sha256, worth):
            best[one.key.sha256], chosen[one.key.sha256] = worth, one
    return chosen


def export_as(kind: Format, annotations: Sequence[StoredAnnotation], images: Sequence[FoundImage], out: Path) -> int:
    """Write each image's masks and lines, those that were changed last; returns the number of images.

    Raises AnnotationError when there is nothing to write, `out` is there already, or cannot be written.
    """
    masks, lines = mask_source(annotations), {}
    for one in sorted(annotations, key=lambda one: one.changed_utc) if kind.has_lines else ():
        if one.content.robot or one.content.vessel:
            lines[one.key.sha256] = one.content
    chosen = []
    for image in images:
        drawn, line = masks.get(image.sha256), lines.get(image.sha256, Annotation())
        if drawn is not None or line != Annotation():
            chosen.append((image, Annotation(line.robot, line.vessel, masks=drawn.content.masks if drawn is not None else ())))
    if not chosen:
        what = "mask or line" if kind.has_lines else "mask"
        raise AnnotationError(f"no image has a {what}; draw them, or take the algorithm's over, in annotate")
    names = {image.path: image.path.name for image in images}
    if len(set(names.values())) < len(images):
        common = Path(os.path.commonpath([image.path.absolute().parent for image in images]))
        names = {image.path: image.path.absolute().relative_to(common).as_posix() for image in images}
    try:
        if out.exists() and (out.is_file() or kind.writes_file or any(out.iterdir())):
            raise AnnotationError(f"{out}: is there already; choose another --out")
        assert kind.write is not None
        kind.write(chosen, names, out)
    except OSError as error:
        raise AnnotationError(f"{error.filename or out}: cannot be written ({error.strerror}); choose another --out") from None
    return len(chosen)


def _files(chosen: _Chosen, names: _Names, out: Path, ending: str) -> Iterator[tuple[FoundImage, Annotation, Path]]:
    """Each image with the file of its own below `out`: its name with another ending, after its own where two differ in it only."""
    stems = [Path(names[image.path]).with_suffix("") for image, _ in chosen]
    for (image, content), stem in zip(chosen, stems, strict=True):
        name = names[image.path] if stems.count(stem) > 1 else stem.as_posix()
        path = out / f"{name}{ending}"
        path.parent.mkdir(parents=True, exist_ok=True)
        yield image, content, path


def _pieces(content: Annotation, size: tuple[int, int]) -> Iterator[tuple[MaskTarget, Mask, Points | None]]:
    """Each outline with the holes that follow it: its mask (H, W), and the polygon (N, 2) around that; None where it has holes."""
    pieces: list[list[MaskPolygon]] = []
    for polygon in content.masks:
        if not polygon.is_hole:
            pieces.append([polygon])
        elif pieces and pieces[-1][0].target is polygon.target:
            pieces[-1].append(polygon)
    for piece in pieces:
        mask = fill(piece, piece[0].target, size)
        if mask.any():
            yield piece[0].target, mask, area_polygon(mask)


def _box(mask: Mask) -> tuple[int, int, int, int]:
    """Left, top, right and bottom, the last two not included."""
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    return left, top, left + width, top + height


def _write_labelme(chosen: _Chosen, names: _Names, out: Path) -> None:
    for image, content, path in _files(chosen, names, out, ".json"):
        shapes = []
        for target, mask, polygon in _pieces(content, image.record.size):
            shape: dict[str, Any] = {"label": target.value, "shape_type": "polygon", "mask": None}
            if polygon is not None:
                shape["points"] = np.round(polygon, 3).tolist()
            else:
                left, top, right, bottom = _box(mask)
                done, data = cv2.imencode(".png", mask[top:bottom, left:right].astype(np.uint8) * 255)
                assert done
                shape |= {"shape_type": "mask", "points": [[left, top], [right - 1, bottom - 1]]}
                shape["mask"] = base64.b64encode(data.tobytes()).decode()
            shapes.append(shape)
        for label, line in (("robot", content.robot), ("vessel", content.vessel)):
            if line:
                points = [[x + 0.5, y + 0.5] for x, y in line]
                shapes.append({"label": label, "shape_type": "linestrip", "points": points, "mask": None})
        try:
            place = os.path.relpath(image.path.absolute(), path.parent.absolute())
        except ValueError:  # another drive
            place = str(image.path.absolute())
        width, height = image.record.size
        file: dict[str, Any] = {"version": _LABELME_VERSION, "flags": {}, "imagePath": place, "imageData": None}
        file |= {"imageHeight": height, "imageWidth": width}
        file["shapes"] = [shape | {"group_id": None, "description": "", "flags": {}} for shape in shapes]
        write_atomic(path, json.dumps(file, allow_nan=False, indent=1).encode())


_LABELME_VERSION = "5.5.0"
"""The first with all parts that are written."""


def _write_coco(chosen: _Chosen, names: _Names, out: Path) -> None:
    """Pieces with holes are run lengths, others polygons."""
    numbers = {target: number for number, target in enumerate(MaskTarget, 1)}
    categories = [{"id": number, "name": target.value, "supercategory": ""} for target, number in numbers.items()]
    info = {"description": "LumenPilot annotations"} | program_id()
    content: dict[str, Any] = {"info": info, "images": [], "annotations": [], "categories": categories}
    for number, (image, annotation) in enumerate(chosen, 1):
        width, height = image.record.size
        content["images"].append({"id": number, "file_name": names[image.path], "width": width, "height": height})
        for target, mask, polygon in _pieces(annotation, image.record.size):
            left, top, right, bottom = _box(mask)
            runs = {"size": [height, width], "counts": run_lengths(mask)}
            row: dict[str, Any] = {"id": len(content["annotations"]) + 1, "image_id": number, "category_id": numbers[target]}
            row["segmentation"] = runs if polygon is None else [np.round(polygon, 3).ravel().tolist()]
            row |= {"bbox": [left, top, right - left, bottom - top], "area": int(mask.sum()), "iscrowd": 0}
            content["annotations"].append(row)
    write_atomic(out, json.dumps(content, allow_nan=False).encode())


def run_lengths(mask: Mask) -> list[int]:
    """COCO's uncompressed run lengths: column by column, beginning with the number of zeros."""
    flat = np.concatenate([[False], mask.ravel(order="F"), [False]])
    changes = np.flatnonzero(flat[1:] != flat[:-1])
    edges = np.concatenate([[0], changes, [mask.size]])
    counts: list[int] = np.diff(edges).tolist()
    return counts[:-1] if counts[-1] == 0 else counts


def _write_label_maps(chosen: _Chosen, names: _Names, out: Path) -> None:
    for image, content, path in _files(chosen, names, out, ".png"):
        vessel, robot = (fill(content.masks, target, image.record.size) for target in MaskTarget)
        write_png(path, vessel.astype(np.uint8) + robot.astype(np.uint8) * 2)
        write_atomic(path.with_name("labels.txt"), ("\n".join(_LABEL_MAP) + "\n").encode())


_ROI_COLOURS = {"vessel": b"\xff\x56\xb4\xe9", "robot": b"\xff\xf0\xe4\x42"}
"""Alpha, red, green and blue: those of the program's overlays."""


def _write_imagej(chosen: _Chosen, names: _Names, out: Path) -> None:
    import roifile

    kinds = roifile.ROI_TYPE
    for image, content, path in _files(chosen, names, out, ".zip"):
        regions: list[tuple[str, Any]] = []
        for target, mask, polygon in _pieces(content, image.record.size):
            if polygon is not None:
                roi = roifile.ImagejRoi.frompoints(polygon)
                roi.roitype = kinds.POLYGON
            else:
                left, top, right, bottom = _box(mask)
                rings = [[value for point in ring for value in (1.0, *point)] + [4.0] for ring in area_rings(mask)]
                for ring in rings:
                    ring[0] = 0.0  # move to the first point, lines to the others, close
                path_of = np.array([value for ring in rings for value in ring], np.float32)
                roi = roifile.ImagejRoi(roitype=kinds.RECT, left=left, top=top, right=right, bottom=bottom)
                roi.multi_coordinates, roi.shape_roi_size = path_of, len(path_of)
            regions.append((target.value, roi))
        for label, line in (("robot", content.robot), ("vessel", content.vessel)):
            if line:
                points = np.array(line) + 0.5
                roi = roifile.ImagejRoi.frompoints(points)
                roi.roitype = kinds.POLYLINE if len(line) > 2 else kinds.LINE
                if len(line) == 2:  # whose angle ImageJ measures
                    (roi.x1, roi.y1), (roi.x2, roi.y2) = points.tolist()
                regions.append((f"{label} line", roi))
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
            for number, (label, roi) in enumerate(regions, 1):
                roi.name, roi.stroke_color = f"{label} {number}", _ROI_COLOURS[label.split()[0]]
                archive.writestr(f"{roi.name}.roi", roi.tobytes())
        write_atomic(path, data.getvalue())


FORMATS = {
    one.name: one
    for one in (
        Format("labelme", "labelme", ".json", _write_labelme, has_lines=True),
        Format("coco", "COCO", ".json", _write_coco, writes_file=True),
        Format("png", "PNG label maps", ".png", _write_label_maps),
        Format("cvat", "CVAT for images 1.1", ".xml"),
        Format("imagej", "ImageJ ROI Manager", ".zip", _write_imagej, has_lines=True),
    )
}
"""All formats by name: command line, windows and documentation follow from them."""
