"""What a rater draws and answers about one image, what is measured from it (METHOD section 5), and the journal of edits for undo.

Everything a rater draws is kept in source pixels of the image as it is on disk, however it was shown.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import takewhile
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from core import geometry
from core.config.models import PerceptionConfig
from core.devices import UserError
from core.messages import message
from core.perception.centerline import centerline_at
from core.perception.pose import measure_pose
from core.perception.vectors import MIN_LENGTH_PX, fit_robot_vector, fit_vessel_vector
from core.types import GraphEdge, Image, Point, Points, Pose, PoseState, Vector, VesselGraph

_Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]  # beyond it a point lies outside every picture
Line = tuple[tuple[_Coordinate, _Coordinate], ...]


class AnnotationError(UserError):
    """Annotations cannot be read, kept or used; the message is one line and says what to do."""


class MaskTarget(StrEnum):
    """What a mask polygon covers."""

    VESSEL = "vessel"
    ROBOT = "robot"


class ImageView(StrEnum):
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

    ``cannot_tell`` and ``no_robot`` are answers: the image does not show what is asked, or it shows that there is no robot.
    """

    robot: Line = ()
    vessel: Line = ()
    state: PoseState | None = None
    cannot_tell: bool = False
    masks: tuple[MaskPolygon, ...] = ()
    note: str = ""
    no_robot: bool = False

    @property
    def without_pose(self) -> bool:
        """Whether it is answered without an angle and a state."""
        return self.cannot_tell or self.no_robot

    @property
    def drawn(self) -> frozenset[MaskTarget]:
        """Targets with a mask; a hole alone does not count."""
        return frozenset(mask.target for mask in self.masks if not mask.is_hole)

    def to_json(self) -> str:
        """One line of JSON; ``annotation_from_json`` reads it."""
        content = _ANNOTATION.dump_python(self, mode="json")
        return json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))


_ANNOTATION, _LINE = TypeAdapter(Annotation), TypeAdapter(Line)


def annotation_from_json(text: str) -> Annotation:
    """The annotation in one line of JSON; raises ValueError when it is damaged or makes no sense."""
    try:
        return _ANNOTATION.validate_json(text)
    except ValidationError as error:
        raise ValueError(f"not an annotation ({error.errors()[0]['msg']})") from None


def line_from(values: Any) -> Line:
    """A list of [x, y] as points; raises ValueError unless all are finite and of a picture's size."""
    try:
        return _LINE.validate_python(values)
    except ValidationError as error:
        raise ValueError(f"no line of points [x, y] ({error.errors()[0]['msg']})") from None


@dataclass(frozen=True, slots=True, eq=False)
class Readout:
    """What follows from the two lines. Points and vectors are source pixels, ``pose`` is in working pixels.

    ``robot_piece`` and ``vessel_piece`` are the parts of the drawn lines that the vectors are fitted to; ``robot_length_px`` and
    ``vessel_length_px`` are their arc lengths in working pixels; ``is_short`` where one of them is shorter than perception fits to.
    Without a pose ``missing`` says what is still to be drawn; ``is_hidden`` is one that the rater may not see yet.
    """

    robot_piece: Points | None = None
    vessel_piece: Points | None = None
    robot_vector: Vector | None = None
    vessel_vector: Vector | None = None
    robot_length_px: float = 0.0
    vessel_length_px: float = 0.0
    is_short: bool = False
    is_hidden: bool = False
    pose: Pose | None = None
    missing: str = ""


_SHORT_PX = 0.5
"""A line that lacks less than this of its length is shown as long enough: lengths are shown in whole pixels."""


def working_scale(size: tuple[int, int], working_size_px: int) -> tuple[float, float]:
    """Working pixels per source pixel in x and y for an image of `size` (width, height), rounded as perception does it."""
    scale = working_size_px / max(size)
    if scale == 1.0:
        return 1.0, 1.0
    return max(1, round(size[0] * scale)) / size[0], max(1, round(size[1] * scale)) / size[1]


def measure_lines(annotation: Annotation, size: tuple[int, int], config: PerceptionConfig) -> Readout:
    """Vectors, angle, distances and state of the drawn lines: the same fit, on the same lengths, as perception makes.

    The annotation's lines are in source pixels; `size` is the image's (width, height).
    """
    scale = np.array(working_scale(size, config.working_size_px))

    def to_source(points: Points) -> Points:
        return np.asarray((points + 0.5) / scale - 0.5, np.float64)

    def vector_to_source(vector: Vector) -> Vector:
        return Vector(*map(tuple, to_source(np.array([vector.start, vector.center, vector.end])).tolist()))

    robot, vessel = (_to_working(line, scale) for line in (annotation.robot, annotation.vessel))
    vectors = config.vectors
    robot_vector = fit_robot_vector(robot, vectors.robot_length_px, vectors.line_fit)
    if robot_vector is None:
        missing = (
            "draw the robot, from its tail to its head" if len(robot) < 2 else message("robot line < {a:g} px", a=MIN_LENGTH_PX)
        )
        return Readout(missing=missing)
    total = float(geometry.arc_length(robot)[-1])
    piece = geometry.cut(robot, total - vectors.robot_length_px, total)
    found = Readout(
        robot_piece=to_source(piece),
        robot_vector=vector_to_source(robot_vector),
        robot_length_px=min(total, vectors.robot_length_px),
    )
    if len(vessel) < 2:
        return replace(found, missing="draw the vessel's centerline beside the head")
    # The drawn line as a vessel graph of one edge, so that perception's own rule cuts and directs it.
    graph = VesselGraph(vessel[[0, -1]], (GraphEdge(0, 1, vessel, np.zeros(len(vessel))),))
    head = float(robot[-1, 0]), float(robot[-1, 1])
    beside = centerline_at(graph, head, robot_vector.direction, vectors.vessel_half_length_px)
    vessel_vector = fit_vessel_vector(beside, vectors.line_fit) if beside is not None else None
    if beside is None or vessel_vector is None:
        return replace(found, missing="the vessel line ends too soon beside the head: draw it farther")
    vessel_px = float(geometry.arc_length(beside.piece)[-1])
    lacking_px = max(vectors.robot_length_px - found.robot_length_px, 2.0 * vectors.vessel_half_length_px - vessel_px)
    return replace(
        found,
        vessel_piece=to_source(beside.piece),
        vessel_vector=vector_to_source(vessel_vector),
        vessel_length_px=vessel_px,
        is_short=lacking_px >= _SHORT_PX,
        pose=measure_pose(robot_vector, vessel_vector, config.pose),
    )


def _to_working(line: Line, scale: Points) -> Points:
    points = np.array(line, np.float64).reshape(-1, 2)
    # Two clicks on one place make no step; a line of such steps has no direction there.
    apart = np.ones(len(points), bool)
    apart[1:] = np.any(np.diff(points, axis=0) != 0.0, axis=1)
    return np.asarray((points[apart] + 0.5) * scale - 0.5, np.float64)


def turn_point(point: Point, view: ImageView, size: tuple[int, int]) -> Point:
    """A place of the image as it lies in the view, and the other way round; pixel centres are at integers."""
    x, y = point
    if view is ImageView.AS_IS:
        return point
    return (size[0] - 1.0 - x, y) if view is ImageView.MIRRORED else (size[0] - 1.0 - x, size[1] - 1.0 - y)


def turn_annotation(annotation: Annotation, view: ImageView, size: tuple[int, int]) -> Annotation:
    """All lines and polygons mapped into the view, or back from it."""
    if view is ImageView.AS_IS:
        return annotation

    def turned(line: Line) -> Line:
        return tuple(turn_point(point, view, size) for point in line)

    masks = tuple(replace(mask, points=turned(mask.points)) for mask in annotation.masks)
    return replace(annotation, robot=turned(annotation.robot), vessel=turned(annotation.vessel), masks=masks)


def turn_image(image: Image, view: ImageView) -> Image:
    """The image as it is shown."""
    if view is ImageView.AS_IS:
        return image
    return np.ascontiguousarray(image[:, ::-1] if view is ImageView.MIRRORED else image[::-1, ::-1])


class Status(StrEnum):
    """How far an image is."""

    NEW = "new"
    BEGUN = "begun"
    DONE = "done"
    CANNOT_TELL = "can't tell"
    NO_ROBOT = "no robot"


ANSWERED = (Status.DONE, Status.CANNOT_TELL, Status.NO_ROBOT)


class AngleProvenance(StrEnum):
    """Where the lines of an annotation come from, and its angle with them. Lists, reports and tables use these words."""

    MANUAL = "manual"
    ALGORITHM = "algorithm"
    """Taken over from the algorithm, and not changed."""
    FOLLOWED = "followed"
    """Carried over from another frame of the same recording, and not changed."""
    CORRECTED = "corrected"
    """Taken over or followed, then changed by hand."""


TAKES_LINES, FOLLOWS_LINES = "take the algorithm's lines", "follow the lines"
"""Actions of the edits that bring lines which were not drawn by hand."""
PROVENANCE = {TAKES_LINES: AngleProvenance.ALGORITHM, FOLLOWS_LINES: AngleProvenance.FOLLOWED}


def status_of(annotation: Annotation | None, *, measured: bool) -> Status:
    """Done is an image with both lines, so that an angle is `measured`, and a state; the answers without a pose count, too."""
    if annotation is None or annotation == Annotation():
        return Status.NEW
    if annotation.cannot_tell:
        return Status.CANNOT_TELL
    if annotation.no_robot:
        return Status.NO_ROBOT
    return Status.DONE if measured and annotation.state is not None else Status.BEGUN


ROBOT, VESSEL = -2, -1


@dataclass(frozen=True, slots=True)
class Touch:
    """A point of a line, or (``is_edge``) the place on the way from point ``place - 1`` to ``place`` where one could be put in.

    ``line`` is ``ROBOT``, ``VESSEL``, or the index of a mask polygon.
    """

    line: int
    place: int
    is_edge: bool = False


def line_of(annotation: Annotation, line: int) -> Line:
    """The points of a line; () when it does not exist."""
    if line == ROBOT:
        return annotation.robot
    if line == VESSEL:
        return annotation.vessel
    return annotation.masks[line].points if 0 <= line < len(annotation.masks) else ()


def with_line(annotation: Annotation, line: int, points: Line) -> Annotation:
    """The annotation with other points on a line, which takes an answer without a pose back.

    A polygon of fewer than three points is removed, an outline with the holes in it: those that follow before the next outline of
    the same mask.
    """
    if line == ROBOT:
        return replace(annotation, robot=points, cannot_tell=False, no_robot=False)
    if line == VESSEL:
        return replace(annotation, vessel=points, cannot_tell=False, no_robot=False)
    masks: list[MaskPolygon] = list(annotation.masks)
    if len(points) >= 3:
        masks[line] = replace(masks[line], points=points)
    else:
        removed = masks.pop(line)
        same = [place for place in range(line, len(masks)) if masks[place].target is removed.target]
        holes = list(takewhile(lambda place: masks[place].is_hole, same)) if not removed.is_hole else []
        masks = [mask for place, mask in enumerate(masks) if place not in holes]
    return replace(annotation, masks=tuple(masks))


def put(annotation: Annotation, line: int, place: int, point: Point) -> Annotation:
    """A new point before the one at `place`."""
    points = line_of(annotation, line)
    return with_line(annotation, line, (*points[:place], point, *points[place:]))


def move(annotation: Annotation, line: int, place: int, point: Point) -> Annotation:
    """The point at `place` lies elsewhere."""
    points = line_of(annotation, line)
    return with_line(annotation, line, (*points[:place], point, *points[place + 1 :]))


def remove(annotation: Annotation, line: int, place: int) -> Annotation:
    """Without the point at `place`."""
    points = line_of(annotation, line)
    return with_line(annotation, line, points[:place] + points[place + 1 :])


def touched(annotation: Annotation, lines: Iterable[int], point: Point, point_reach: float, edge_reach: float) -> Touch | None:
    """What lies at a place: a point within `point_reach`, else an edge within `edge_reach` (both in image pixels); the nearest."""
    best_point: tuple[float, Touch] | None = None
    best_edge: tuple[float, Touch] | None = None
    for line in lines:
        points = np.array(line_of(annotation, line), np.float64).reshape(-1, 2)
        if len(points) == 0:
            continue
        distance = np.hypot(*(points - point).T)
        place = int(np.argmin(distance))
        if distance[place] <= point_reach and (best_point is None or distance[place] < best_point[0]):
            best_point = float(distance[place]), Touch(line, place)
        closed = points if line < 0 else np.concatenate([points, points[:1]])
        if len(closed) > 1:
            gap = _distances_to_edges(closed, point)
            edge = int(np.argmin(gap))
            if gap[edge] <= edge_reach and (best_edge is None or gap[edge] < best_edge[0]):
                best_edge = float(gap[edge]), Touch(line, edge + 1, is_edge=True)
    chosen = best_point or best_edge
    return chosen[1] if chosen is not None else None


def _distances_to_edges(points: Points, point: Point) -> NDArray[np.float64]:
    """How far `point` is from each straight piece of a line (N, 2), shape (N - 1,)."""
    start, step = points[:-1], points[1:] - points[:-1]
    offset = np.array(point) - start
    share = np.clip((offset * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return np.asarray(np.hypot(*(offset - share[:, None] * step).T))


Kind = Literal["edit", "undo", "redo"]


@dataclass(frozen=True, slots=True)
class JournalEntry:
    """One entry. ``number`` counts from 1 per annotation; 0 is the empty annotation before all edits.

    For an edit ``base`` is the edit that it was made on and ``content`` what it led to; for undo and redo ``base`` is the edit
    (or 0) that is in force again, and there is no content.
    """

    number: int
    kind: Kind
    base: int
    action: str = ""
    content: Annotation | None = None


class History:
    """The edits of one annotation: what is in force, and what undo and redo lead to, from the `entries` of its journal in order.

    A new edit after an undo starts a branch: redo no longer leads to what was undone, but its entries stay in the journal.
    `last` is the highest number that is taken, also by an entry that is not there because its record is damaged.
    """

    def __init__(self, entries: Iterable[JournalEntry] = (), *, last: int = 0) -> None:
        self._contents: dict[int, Annotation] = {0: Annotation()}
        self._actions: dict[int, str] = {0: ""}
        self._bases: dict[int, int] = {}
        self._now = self._tip = 0
        self._last = last
        for entry in entries:
            self._follow(entry)

    @property
    def current(self) -> Annotation:
        return self._contents[self._now]

    @property
    def last(self) -> int:
        """The newest entry's number, 0 before the first."""
        return self._last

    @property
    def can_undo(self) -> bool:
        return self._now != 0

    @property
    def can_redo(self) -> bool:
        return self._now != self._tip

    @property
    def undo_action(self) -> str:
        """What undo takes back, in words; "" for nothing."""
        return self._actions[self._now]

    @property
    def provenance(self) -> AngleProvenance:
        """Of the lines in force: the last edit that brought them, unless they were cleared since."""
        step, now = self._now, self.current
        while step and (lines := (self._contents[step].robot, self._contents[step].vessel)) != ((), ()):
            if (brought := PROVENANCE.get(self._actions[step])) is not None:
                return brought if lines == (now.robot, now.vessel) else AngleProvenance.CORRECTED
            step = self._bases[step]
        return AngleProvenance.MANUAL

    def edit(self, action: str, content: Annotation) -> JournalEntry | None:
        """Put `content` in force; None when it changes nothing."""
        return self._add("edit", self._now, action, content) if content != self.current else None

    def renewed(self, action: str) -> JournalEntry | None:
        """What is in force once more, because its record was lost; None for an empty annotation."""
        return self._add("edit", self._now, action, self.current) if self.current != Annotation() else None

    def undo(self) -> JournalEntry | None:
        """Back to before the last edit; None without one."""
        return self._add("undo", self._bases[self._now], self._actions[self._now]) if self.can_undo else None

    def redo(self) -> JournalEntry | None:
        """Forward again; None when nothing was undone."""
        if not self.can_redo:
            return None
        step = self._tip
        while self._bases[step] != self._now:
            step = self._bases[step]
        return self._add("redo", step, self._actions[step])

    def _add(self, kind: Kind, base: int, action: str, content: Annotation | None = None) -> JournalEntry:
        entry = JournalEntry(self._last + 1, kind, base, action, content)
        self._follow(entry)
        return entry

    def _follow(self, entry: JournalEntry) -> None:
        """Follow an entry; one that refers to an edit that is not there (its record was damaged) changes nothing."""
        if entry.base >= entry.number or entry.number in self._contents:
            return
        self._last = max(self._last, entry.number)
        if entry.kind == "edit" and entry.content is not None:
            # An edit whose base was lost to damage goes on from what is in force, so that undo still leads to the beginning.
            self._bases[entry.number] = entry.base if entry.base in self._contents else self._now
            self._contents[entry.number] = entry.content
            self._actions[entry.number] = entry.action
            self._now = self._tip = entry.number
        elif entry.kind != "edit" and entry.base in self._contents and self._leads_to_tip(entry.base):
            self._now = entry.base

    def _leads_to_tip(self, step: int) -> bool:
        back = self._tip
        while back not in (step, 0):
            back = self._bases[back]
        return back == step
