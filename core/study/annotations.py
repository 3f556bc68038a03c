"""What a rater draws and says about one image, and what is measured from it by the rule of METHOD section 5.

Everything a rater draws is kept in source pixels of the image as it is on disk, however it was shown to him.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

import numpy as np

from core.config import PerceptionConfig
from core.errors import UserError
from core.perception import polyline
from core.perception.centerline import centerline_at
from core.perception.pose import measure
from core.perception.vectors import MIN_LENGTH_PX, fit_robot_vector, fit_vessel_vector
from core.types import GraphEdge, Image, Point, Points, Pose, PoseState, Vector, VesselGraph

Line = tuple[Point, ...]
_MAX_COORDINATE_PX = 1e6


class AnnotationError(UserError):
    """Annotations cannot be read, kept or used; the message is one line and says what to do."""


class MaskTarget(StrEnum):
    """What a mask polygon covers."""

    VESSEL = "vessel"
    ROBOT = "robot"


class View(StrEnum):
    """How an image is shown: repeats may be turned so that a rater does not know them again. Each is its own inverse."""

    AS_IS = "as is"
    MIRRORED = "mirrored"
    TURNED = "turned"


@dataclass(frozen=True, slots=True)
class MaskPolygon:
    """Outline of a piece of mask through the centres of its border pixels, or of a hole in it; source pixels."""

    target: MaskTarget
    points: Line
    is_hole: bool = False


@dataclass(frozen=True, slots=True)
class Annotation:
    """What one rater drew on one image: ``robot`` from tail to head, ``vessel`` beside the head, both source pixels.

    ``cannot_tell`` is an answer: the image does not show what is asked.
    """

    robot: Line = ()
    vessel: Line = ()
    state: PoseState | None = None
    cannot_tell: bool = False
    masks: tuple[MaskPolygon, ...] = ()
    note: str = ""

    @property
    def drawn(self) -> frozenset[MaskTarget]:
        """Of what there is a mask: a hole alone is none."""
        return frozenset(mask.target for mask in self.masks if not mask.is_hole)

    def to_json(self) -> str:
        """One line of JSON; ``annotation_from_json`` reads it."""
        content = {
            "robot": self.robot,
            "vessel": self.vessel,
            "state": self.state,
            "cannot_tell": self.cannot_tell,
            "masks": [{"target": m.target, "points": m.points, "is_hole": m.is_hole} for m in self.masks],
            "note": self.note,
        }
        return json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))


def annotation_from_json(text: str) -> Annotation:
    """The annotation in one line of JSON; raises ValueError when it is damaged or makes no sense."""
    try:
        row = json.loads(text)
        masks = tuple(MaskPolygon(MaskTarget(m["target"]), line_from(m["points"]), m["is_hole"] is True) for m in row["masks"])
        state = None if row["state"] is None else PoseState(row["state"])
        return Annotation(
            line_from(row["robot"]), line_from(row["vessel"]), state, row["cannot_tell"] is True, masks, str(row["note"])
        )
    except (TypeError, KeyError, RecursionError, AttributeError) as error:
        raise ValueError(f"not an annotation ({type(error).__name__})") from None


def line_from(values: Any) -> Line:
    """A list of [x, y] as points; raises ValueError unless all are finite and of a picture's size."""
    points = []
    for value in values:
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise ValueError("a point is not [x, y]")
        x, y = float(value[0]), float(value[1])
        if not (abs(x) <= _MAX_COORDINATE_PX and abs(y) <= _MAX_COORDINATE_PX):
            raise ValueError("a point lies outside every picture")
        points.append((x, y))
    return tuple(points)


@dataclass(frozen=True, slots=True, eq=False)
class Readout:
    """What follows from the two lines. Points and vectors are source pixels, ``pose`` is in working pixels.

    ``robot_piece`` and ``vessel_piece`` are the parts of the drawn lines that the vectors are fitted to; ``robot_length_px`` and
    ``vessel_length_px`` are their arc lengths in working pixels. Without a pose ``missing`` says what is still to be drawn.
    """

    robot_piece: Points | None = None
    vessel_piece: Points | None = None
    robot_vector: Vector | None = None
    vessel_vector: Vector | None = None
    robot_length_px: float = 0.0
    vessel_length_px: float = 0.0
    pose: Pose | None = None
    missing: str = ""


def working_scale(size: tuple[int, int], working_size_px: int) -> tuple[float, float]:
    """Working pixels per source pixel in x and y for an image of `size` (width, height), rounded as perception does it."""
    scale = working_size_px / max(size)
    if scale == 1.0:
        return 1.0, 1.0
    return max(1, round(size[0] * scale)) / size[0], max(1, round(size[1] * scale)) / size[1]


def measure_lines(annotation: Annotation, size: tuple[int, int], config: PerceptionConfig) -> Readout:
    """Vectors, angle, distances and state of the drawn lines: the same fit, on the same lengths, as perception makes.

    Parameters
    ----------
    annotation : lines in source pixels.
    size : (width, height) of the image.
    config : lengths, thresholds and working resolution.
    """
    scale = np.array(working_scale(size, config.working_size_px))
    robot, vessel = (_to_working(line, scale) for line in (annotation.robot, annotation.vessel))
    vectors = config.vectors
    robot_vector = fit_robot_vector(robot, vectors.robot_length_px, vectors.line_fit)
    if robot_vector is None:
        missing = "draw the robot, from its tail to its head" if len(robot) < 2 else f"robot line < {MIN_LENGTH_PX:g} px"
        return Readout(missing=missing)
    total = float(polyline.arc_length(robot)[-1])
    piece = polyline.cut(robot, total - vectors.robot_length_px, total)
    found = Readout(
        robot_piece=_to_source(piece, scale),
        robot_vector=_vector_to_source(robot_vector, scale),
        robot_length_px=min(total, vectors.robot_length_px),
    )
    if len(vessel) < 2:
        return replace(found, missing="draw the vessel's centerline beside the head")
    beside = centerline_at(_graph(vessel), annotation_head(robot), robot_vector.direction, vectors.vessel_half_length_px)
    vessel_vector = fit_vessel_vector(beside, vectors.line_fit) if beside is not None else None
    if beside is None or vessel_vector is None:
        return replace(found, missing="the vessel line ends too soon beside the head: draw it farther")
    return replace(
        found,
        vessel_piece=_to_source(beside.piece, scale),
        vessel_vector=_vector_to_source(vessel_vector, scale),
        vessel_length_px=float(polyline.arc_length(beside.piece)[-1]),
        pose=measure(robot_vector, vessel_vector, config.pose),
    )


def annotation_head(robot: Points) -> Point:
    """The last point of the robot's line."""
    return float(robot[-1, 0]), float(robot[-1, 1])


def _graph(vessel: Points) -> VesselGraph:
    """The drawn line as a vessel graph of one edge, so that perception's own rule cuts and directs it."""
    return VesselGraph(vessel[[0, -1]], (GraphEdge(0, 1, vessel, np.zeros(len(vessel))),))


def _to_working(line: Line, scale: Points) -> Points:
    points = np.array(line, np.float64).reshape(-1, 2)
    # Two clicks on one place make no step; a line of such steps has no direction there.
    apart = np.ones(len(points), bool)
    apart[1:] = np.any(np.diff(points, axis=0) != 0.0, axis=1)
    return np.asarray((points[apart] + 0.5) * scale - 0.5, np.float64)


def _to_source(points: Points, scale: Points) -> Points:
    return np.asarray((points + 0.5) / scale - 0.5, np.float64)


def _vector_to_source(vector: Vector, scale: Points) -> Vector:
    start, center, end = _to_source(np.array([vector.start, vector.center, vector.end]), scale).tolist()
    return Vector(tuple(start), tuple(center), tuple(end))


def turn_point(point: Point, view: View, size: tuple[int, int]) -> Point:
    """A place of the image as it lies in the view, and the other way round; pixel centres are at integers."""
    x, y = point
    if view is View.AS_IS:
        return point
    return (size[0] - 1.0 - x, y) if view is View.MIRRORED else (size[0] - 1.0 - x, size[1] - 1.0 - y)


def turn_annotation(annotation: Annotation, view: View, size: tuple[int, int]) -> Annotation:
    """All lines and polygons mapped into the view, or back from it."""
    if view is View.AS_IS:
        return annotation

    def turned(line: Line) -> Line:
        return tuple(turn_point(point, view, size) for point in line)

    masks = tuple(replace(mask, points=turned(mask.points)) for mask in annotation.masks)
    return replace(annotation, robot=turned(annotation.robot), vessel=turned(annotation.vessel), masks=masks)


def turn_image(image: Image, view: View) -> Image:
    """The image as it is shown."""
    if view is View.AS_IS:
        return image
    return np.ascontiguousarray(image[:, ::-1] if view is View.MIRRORED else image[::-1, ::-1])


class Status(StrEnum):
    """How far an image is."""

    NEW = "new"
    BEGUN = "begun"
    DONE = "done"
    CANNOT_TELL = "can't tell"


def status_of(annotation: Annotation | None, *, measured: bool) -> Status:
    """Done is who has both lines, so that an angle is `measured`, and a state; "can't tell" is an answer too."""
    if annotation is None or annotation == Annotation():
        return Status.NEW
    if annotation.cannot_tell:
        return Status.CANNOT_TELL
    return Status.DONE if measured and annotation.state is not None else Status.BEGUN
