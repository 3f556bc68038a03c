"""JSON of scenes, ticks and drive views: rows of ``frames.jsonl``, and the lines that ``perceive`` and ``replay`` write.

Each layout is declared once, as a pydantic model that both writes and reads. Points of a row are in working pixels as in the scene,
lines thinned where they are straight; points of a ``perceive`` line are in source pixels. A value with a number that is not finite
is written as None and named in the row's ``not_finite``, so that every row is valid JSON.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from typing import Annotated, Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, PlainSerializer, ValidationError
from pydantic_core import CoreSchema, core_schema

from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.gate import Source
from core.control.modes import Hindrance, Mode
from core.types import (
    Advice,
    Centerline,
    Command,
    Frame,
    GraphEdge,
    Image,
    Mask,
    Masks,
    Point,
    Points,
    Pose,
    PoseState,
    Reason,
    Refusal,
    RobotPath,
    RobotStatus,
    Route,
    Scene,
    Skeletons,
    Speed,
    Tick,
    Vector,
    VesselGraph,
)

Row = dict[str, Any]

_MAX_ITEMS = 20_000  # points of a line, lines of a mask
_MAX_SIDE_PX, _MAX_MASK_PX = 16_384, 4096
_LONGEST_S = 1e9  # thirty years: no monotonic clock shows more
_LINE_PX = 0.3  # largest distance of a thinned line from the recorded one
VESSEL_LINE_PX, ROBOT_LINE_PX = 1.0, 0.5
"""The same for outlines of masks; the robot is thin."""
_NO_PIXELS = np.zeros((0, 0), np.float32)


class InvalidRecord(ValueError):
    """A record is damaged; the message names the value."""


Read = TypeVar("Read", bound=BaseModel)
# Half a character, out of a file name that is no UTF-8: Python's JSON writes it, pydantic's refuses it.
_SURROGATE = re.compile(rb"(?<!\\)\\u(?=[dD][89a-fA-F])")


def read_json(kind: type[Read], data: bytes) -> Read:
    """A JSON object as a model, types checked strictly; raises InvalidRecord."""
    try:
        return kind.model_validate_json(data, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        written_out = _SURROGATE.sub(rb"\\\\u", data) if first["type"] == "json_invalid" else data
        if written_out != data:
            return read_json(kind, written_out)
        where = ".".join(map(str, first["loc"]))
        what = {"json_invalid": "not valid JSON", "model_type": "not an object"}.get(first["type"], first["msg"])
        raise InvalidRecord(f"{where}: {what}" if where else what) from None


def finite(value: float | None, digits: int) -> float | None:
    """Rounded; None when it is missing or not finite, which JSON cannot hold."""
    return round(float(value), digits) if value is not None and math.isfinite(value) else None


def finite_tree(value: Any) -> Any:
    """Plain JSON values, floats rounded; a number that is not finite becomes None, what JSON does not know its text."""
    if isinstance(value, dict):
        return {str(key): finite_tree(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite_tree(inner) for inner in value]
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, float):
        return finite(value, 5)
    return int(value) if isinstance(value, int) else str(value)


class JsonLayout(BaseModel):
    """JSON layout of a value; keys that it does not have are ignored."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False, from_attributes=True)


@dataclass(frozen=True, slots=True)
class _As:
    """Annotation of a field whose JSON differs from its value: ``plain`` gives the JSON, ``make`` takes it (None: as it is)."""

    layout: Any
    make: Callable[[Any], Any] | None = None
    plain: Callable[[Any], Any] | None = None

    def __get_pydantic_core_schema__(self, _source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        written = read = handler.generate_schema(self.layout)
        if self.make is not None:
            read = core_schema.no_info_after_validator_function(self.make, read)
        if self.plain is not None:
            written = core_schema.no_info_before_validator_function(self.plain, written)
        return core_schema.json_or_python_schema(read, written)


def _round(value: Any, digits: int) -> Any:
    if isinstance(value, float):
        return round(value, digits)
    return [_round(inner, digits) for inner in value] if isinstance(value, tuple) else value


def _rounded(digits: int) -> PlainSerializer:
    return PlainSerializer(lambda value: _round(value, digits))


def _finite(value: Any) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


_F1 = Annotated[float, _rounded(1)]
_F2 = Annotated[float, _rounded(2)]
_F3 = Annotated[float, _rounded(3)]
_F4 = Annotated[float, _rounded(4)]
_F5 = Annotated[float, _rounded(5)]
# Written as None where they are not finite: the record that they belong to is of use without them.
_Maybe3 = Annotated[float | None, _As(Annotated[float | None, _rounded(3)], plain=_finite)]
_Maybe4 = Annotated[float | None, _As(Annotated[float | None, _rounded(4)], plain=_finite)]
_Maybe5 = Annotated[float | None, _As(Annotated[float | None, _rounded(5)], plain=_finite)]
_Maybe6 = Annotated[float | None, _As(Annotated[float | None, _rounded(6)], plain=_finite)]
_Pair = tuple[float, float]
_Point = Annotated[_Pair, _rounded(3)]
_Tendons = Annotated[tuple[float, ...], Field(min_length=2, max_length=4)]
Count = Annotated[int, Field(ge=0, lt=2**63)]
Moment = Annotated[float, Field(ge=-_LONGEST_S, le=_LONGEST_S), _rounded(6)]
"""Seconds of a monotonic clock."""
Text = Annotated[str, Field(max_length=20_000)]
_Side = Annotated[int, Field(ge=0, le=_MAX_SIDE_PX)]
_MaskSide = Annotated[int, Field(gt=0, le=_MAX_MASK_PX)]
_Scale = Annotated[float, Field(gt=0.0), _rounded(9)]
_List = Field(max_length=_MAX_ITEMS)
_Pairs = Annotated[list[_Pair], _List]


def _array(pairs: list[_Pair]) -> Points:
    return np.array(pairs, np.float64).reshape(-1, 2)


def thinned(points: Points, digits: int = 2) -> list[list[float]]:
    """A polyline (N, 2), thinned and rounded; points that are not finite are left out."""
    line = points.astype(np.float32)
    if not np.isfinite(line).all():
        line = line[np.isfinite(line).all(axis=1)]
    if len(line) > 2:
        line = np.asarray(cv2.approxPolyDP(line[:, None], _LINE_PX, False)[:, 0], np.float32)
    return np.round(line.astype(np.float64), digits).tolist()  # type: ignore[no-any-return]


def _vector(ends: tuple[Point, Point, Point]) -> Vector:
    if ends[0] == ends[2]:
        raise ValueError("start and end are one point")
    return Vector(*ends)


_Line = Annotated[Points, _As(_Pairs, _array, thinned)]
_VectorField = Annotated[
    Vector, _As(tuple[_Point, _Point, _Point], _vector, lambda vector: (vector.start, vector.center, vector.end))
]
_CommandField = Annotated[
    Command,
    _As(
        Annotated[tuple[float, ...], Field(min_length=4, max_length=5), _rounded(5)],  # the fifth where a shaft is turned
        lambda numbers: Command(*numbers),
        lambda command: (
            *(command.bend, command.pitch, command.advance_mm_s, command.delivery_mm_s),
            *((command.rotation_deg_s,) if command.rotation_deg_s else ()),
        ),
    ),
]
_FaultField = Annotated[Fault, _As(tuple[Cause, Text], lambda pair: Fault(*pair), lambda fault: (fault.cause, fault.detail))]


def _made(kind: type[Any]) -> Callable[[JsonLayout], Any]:
    return lambda layout: kind(**layout.__dict__)


class _PathLayout(JsonLayout):
    points: Annotated[Points, _As(Annotated[_Pairs, Field(min_length=1)], _array, thinned)]
    score: _F5
    runner_up: _Maybe5 = None
    entry_on_border: bool
    bridged_px: _F2
    radius_px: _F3


class _CenterlineLayout(JsonLayout):
    piece: _Line
    nearest: _Point
    radius_px: _F3
    ambiguity: _F4


class _RouteLayout(JsonLayout):
    points: _Line
    length_px: _F2
    target: _Point


class _AdviceLayout(JsonLayout):
    speed: Speed
    advance_mm_s: _F4
    steer_deg: _F4
    why: Text


class _StatusLayout(JsonLayout):
    time_s: Moment
    insertion_mm: _F4
    delivery_mm: _F4
    tendon_pull_mm: Annotated[_Tendons, _rounded(4)]
    tendon_force_mn: Annotated[_Tendons, _rounded(3)]
    wall_contact_n: _Maybe6 = None
    rotation_deg: _F4 = 0.0


class _MasksLayout(JsonLayout):
    size: tuple[_MaskSide, _MaskSide]
    vessel: Annotated[list[Annotated[list[int], _List]], _List]
    robot: Annotated[list[Annotated[list[int], _List]], _List]


class _GraphLayout(JsonLayout):
    nodes: _Pairs
    edges: Annotated[list[tuple[Count, Count, _Pairs, _F1]], _List]


def _masks(layout: _MasksLayout) -> Masks:
    """Probabilities are not recorded: they are those of the masks, 0 and 1."""
    vessel, robot = (_filled(outlines, layout.size) for outlines in (layout.vessel, layout.robot))
    return Masks(vessel, robot, vessel.astype(np.float32), robot.astype(np.float32))


def _filled(flat_outlines: list[list[int]], size: tuple[int, int]) -> Mask:
    canvas, outlines = np.zeros((size[1], size[0]), np.uint8), []
    for flat in flat_outlines:
        if not flat or len(flat) % 2 or max(map(abs, flat)) > _MAX_SIDE_PX:
            raise ValueError("not an outline")
        corners = np.array(flat, np.int64).reshape(-1, 2).cumsum(axis=0)
        outlines.append(np.clip(corners, -1, _MAX_SIDE_PX).astype(np.int32))
    if outlines:
        cv2.fillPoly(canvas, outlines, 1)
    return canvas.astype(bool)


def _plain_masks(masks: Masks) -> Row:
    """Outlines of areas and holes as x, y, dx, dy, dx, dy, ...; filled by the even-odd rule they are the masks within a pixel."""
    record: Row = {"size": (masks.vessel.shape[1], masks.vessel.shape[0])}
    for name, mask, leave_px in (("vessel", masks.vessel, VESSEL_LINE_PX), ("robot", masks.robot, ROBOT_LINE_PX)):
        record[name] = [np.diff(outline, axis=0, prepend=0).ravel().tolist() for outline in mask_outlines(mask, leave_px)]
    return record


def mask_outlines(mask: Mask, leave_px: float) -> list[NDArray[np.int32]]:
    """Outlines (N, 2) of areas and holes, thinned by at most `leave_px`."""
    found, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    return [np.asarray(cv2.approxPolyDP(outline, leave_px, True)[:, 0], np.int32) for outline in found]


def _graph(layout: _GraphLayout) -> VesselGraph:
    edges = []
    for start, end, line, radius in layout.edges:
        if max(start, end) >= len(layout.nodes) or not line:
            raise ValueError("an edge without points, or with an end that is no node")
        edges.append(GraphEdge(start, end, _array(line), np.full(len(line), radius)))
    return VesselGraph(_array(layout.nodes), tuple(edges))


def _plain_graph(graph: VesselGraph) -> Row:
    edges = [
        (edge.start, edge.end, thinned(edge.points, 1), float(edge.radius.mean()) if edge.radius.size else 0.0)
        for edge in graph.edges
    ]
    return {"nodes": np.round(graph.nodes, 1).tolist(), "edges": edges}


_AdviceField = Annotated[Advice, _As(_AdviceLayout, _made(Advice))]
_Reasons = tuple[Hindrance | Cause, ...]


class _DriveLayout(JsonLayout):
    """The fields of DriveView, in the order in which they are written."""

    time_s: Moment
    mode: Mode
    permitted: Source | None = None
    latched: _FaultField | None = None
    active: tuple[_FaultField, ...]
    against_arming: _Reasons
    against_hand_over: _Reasons
    keyboard_deadman: bool = True
    simulated: bool = False
    deadman: bool | None = None
    servos_on: bool
    busy: Text
    asked: _CommandField | None = None
    asked_s: _Maybe6 = None
    advice: _AdviceField | None = None
    blanked: Text
    commanded: _CommandField | None = None
    sent: _CommandField | None = None
    sent_by: Source | None = None
    latency_s: _Maybe6 = None
    latency_p95_s: _Maybe6 = None
    follow_share: _Maybe4 = None


def _drive_key(name: str) -> str:
    """The key in a row of a field of DriveView."""
    return {"operator_command": "asked", "operator_moved_s": "asked_s", "program_command": "commanded"}.get(name, name)


def _drive(layout: _DriveLayout) -> DriveView:
    values = {field.name: getattr(layout, _drive_key(field.name)) for field in fields(DriveView)}
    return DriveView(**values | {"operator_command": layout.asked or Command()})


class _RefusalLayout(JsonLayout):
    reason: Reason
    detail: Text = ""


class _SceneLayout(JsonLayout):
    source_size: tuple[_Side, _Side]
    scale: _Scale
    scale_xy: tuple[_Scale, _Scale] | None = None
    robot_vector: _VectorField | None = None
    vessel_vector: _VectorField | None = None
    path: Annotated[RobotPath, _As(_PathLayout, _made(RobotPath))] | None = None
    centerline: Annotated[Centerline, _As(_CenterlineLayout, _made(Centerline))] | None = None
    route: Annotated[Route, _As(_RouteLayout, _made(Route))] | None = None
    route_problem: Text = ""
    bridges: Annotated[list[tuple[_Point, _Point]], _List] | None = None
    masks: Annotated[Masks, _As(_MasksLayout, _masks, _plain_masks)] | None = None
    graph: Annotated[VesselGraph, _As(_GraphLayout, _graph, _plain_graph)] | None = None


class _TickLayout(JsonLayout):
    """What a tick gives to a row, in the order in which it is written."""

    index: Count
    captured_s: Moment
    size: tuple[_Side, _Side]
    dropped_frames: Count
    camera_lost: Count = 0
    fps: _Maybe3 = None
    mode: str | None = None
    state: PoseState | None = None
    theta_signed_deg: _F4 | None = None
    c_head_px: _F4 | None = None
    c_tail_px: _F4 | None = None
    crossed: bool | None = None
    confidence: _F4 | None = None
    novelty: _F4 | None = None
    refusal: Annotated[Refusal, _As(_RefusalLayout, _made(Refusal))] | None = None
    advice: _AdviceField | None = None
    sent: _CommandField | None = None
    servo: Annotated[RobotStatus, _As(_StatusLayout, _made(RobotStatus))] | None = None
    drive: Annotated[DriveView, _As(_DriveLayout, _drive)] | None = None
    bus: dict[str, Any] | None = None
    latency_ms: dict[str, _Maybe3]
    scene: _SceneLayout


class _RowLayout(_TickLayout):
    """A whole row; the writer adds its place in the session."""

    row: Count
    video: Count
    pts_ms: Count
    dropped_rows: Count = 0


_SAME = tuple(name for name in _SceneLayout.model_fields if name not in ("bridges", "graph"))
"""Fields of a scene that have their own names in a row."""
_POSE_KEYS = ("state", "theta_signed_deg", "c_head_px", "c_tail_px", "crossed", "confidence")


def light_tick(tick: Tick) -> Tick:
    """The tick without what is not recorded (probabilities, skeletons), so that frames in a queue weigh a third."""
    scene = tick.scene
    if scene.masks is None and scene.skeletons is None:
        return tick
    masks = replace(scene.masks, vessel_probability=_NO_PIXELS, robot_probability=_NO_PIXELS) if scene.masks else None
    blank = _NO_PIXELS.astype(bool)
    skeletons = replace(scene.skeletons, vessel=blank, robot=blank) if scene.skeletons else None
    return replace(tick, scene=replace(scene, masks=masks, skeletons=skeletons))


def row_of(tick: Tick, drive: DriveView | None, *, bus: Any = None, with_masks: bool = True) -> Row:
    """One row, without its place in the session (``row``, ``video``, ``pts_ms``, ``dropped_rows``), which the writer adds.

    `bus` is the newest status of the servo bus, any dataclass of plain values; None: there is no bus, as no robot without
    `drive`. `with_masks`: also outlines of the masks, and the vessel graph.
    """
    scene, pose = tick.scene, tick.scene.pose
    parts: Row = {name: getattr(scene, name) for name in _SAME}
    parts |= {"bridges": scene.skeletons.bridges if scene.skeletons else None, "graph": scene.vessel_graph}
    if not with_masks:
        parts["masks"] = parts["graph"] = None
    values: Row = {
        "index": tick.frame.index,
        "captured_s": tick.frame.captured_s,
        "size": tick.frame.image.shape[1::-1],
        "dropped_frames": tick.dropped_frames,
        "camera_lost": tick.frame.lost,
        "fps": tick.frames_per_second,
        "mode": drive.mode if drive else None,
        **{name: getattr(pose, name) if pose else None for name in _POSE_KEYS},
        "novelty": scene.novelty,
        "refusal": scene.refusal,
        "advice": tick.advice,
        "sent": tick.sent,
        "servo": tick.status,
        "drive": {_drive_key(field.name): getattr(drive, field.name) for field in fields(drive)} if drive else None,
        "bus": finite_tree(asdict(bus)) if bus is not None else None,
        "latency_ms": scene.latency_ms,
        "scene": parts,
    }
    broken: list[str] = []
    try:
        row = _TickLayout.model_validate(values)
    except ValidationError as error:
        for loc in (tuple(map(str, one["loc"])) for one in error.errors()):
            name, holder, prefix = loc[0], values, ""
            if name in _POSE_KEYS:
                values |= dict.fromkeys(_POSE_KEYS)
                name = "pose"
            else:
                if name in ("scene", "drive"):
                    holder, name, prefix = values[name], loc[1], "drive." if name == "drive" else ""
                holder[name] = None
            broken.append(f"{prefix}{name}")
        row = _TickLayout.model_validate(values)
    record = row.model_dump(mode="json")
    return record | {"not_finite": list(dict.fromkeys(broken))} if broken else record


@dataclass(frozen=True, slots=True, eq=False)
class RecordedRow:
    """One recorded frame without its picture. ``row`` counts in the session, ``index`` is the camera's; ``pts_ms`` is the time in
    the video file number ``video``. ``size`` is the picture's (width, height). ``drive``: None when there was no robot to drive.
    ``bus`` is the status of the servo bus as plain values, None where there was none. ``camera_lost`` counts, since the camera was
    opened, the frames that never came from it; ``dropped_frames`` those that came and were skipped for a newer one.
    """

    row: int
    index: int
    captured_s: float
    video: int
    pts_ms: int
    size: tuple[int, int]
    dropped_frames: int
    dropped_rows: int
    frames_per_second: float
    scene: Scene
    advice: Advice | None
    sent: Command | None
    status: RobotStatus | None
    drive: DriveView | None
    bus: dict[str, Any] | None
    camera_lost: int = 0

    @property
    def source_px_per_working_px(self) -> float:
        """For distances to the centerline (``c_head_px``, ``c_tail_px``), which are in working pixels."""
        return 1.0 / self.scene.scale

    def tick(self, image: Image) -> Tick:
        """The tick as it was, with its picture from the video."""
        frame = Frame(self.index, self.captured_s, image, self.camera_lost)
        return Tick(
            frame, self.scene, self.advice, self.sent, self.status, self.dropped_frames + self.dropped_rows, self.frames_per_second
        )


def row_from_json(data: bytes) -> RecordedRow:
    """A line of ``frames.jsonl`` as values again; raises InvalidRecord, which names the value."""
    row = read_json(_RowLayout, data)
    values = {field.name: getattr(row, field.name) for field in fields(RecordedRow) if field.name in _RowLayout.model_fields}
    return RecordedRow(**values | {"frames_per_second": row.fps or 0.0, "scene": _scene(row), "status": row.servo})


def _scene(row: _RowLayout) -> Scene:
    scene, pose = row.scene, None
    if row.state is not None:
        signed, c_head, c_tail = row.theta_signed_deg, row.c_head_px, row.c_tail_px
        if signed is None or c_head is None or c_tail is None or row.crossed is None or row.confidence is None:
            raise InvalidRecord("state: without theta_signed_deg, c_head_px, c_tail_px, crossed or confidence")
        pose = Pose(abs(signed), signed, c_head, c_tail, row.crossed, row.state, row.confidence)
    blank = _NO_PIXELS.astype(bool)
    return Scene(
        row.index,
        row.captured_s,
        **{name: getattr(scene, name) for name in _SAME},
        skeletons=Skeletons(blank, blank, tuple(scene.bridges)) if scene.bridges is not None else None,
        vessel_graph=scene.graph,
        pose=pose,
        refusal=row.refusal,
        latency_ms={stage: ms for stage, ms in row.latency_ms.items() if ms is not None},
        novelty=row.novelty,
    )


class _VectorLayout(JsonLayout):
    start: _Point
    center: _Point
    end: _Point


class PerceivedLine(JsonLayout):
    """A line of ``perceive --jsonl`` (a contract), in source pixels; distances to the centerline are in working pixels."""

    image: str
    width: Count | None
    height: Count | None
    head_xy: _Point | None = None
    tail_xy: _Point | None = None
    robot_path_xy: _Pairs | None = None
    robot_vector: _VectorLayout | None = None
    vessel_vector: _VectorLayout | None = None
    theta_deg: _F4 | None = None
    theta_signed_deg: _F4 | None = None
    d_head_px: _F4 | None = None
    d_tail_px: _F4 | None = None
    crossed: bool | None = None
    state: PoseState | None = None
    confidence: _F4 = 0.0
    reason: Text | None = None
    latency_ms: dict[str, _F3] = {}


def scene_to_json(name: str, scene: Scene) -> Row:
    """The ``perceive`` line of an image called `name`."""
    pose, path, to_source = scene.pose, scene.path, scene.to_source
    values: Row = {
        "image": name,
        "width": scene.source_size[0],
        "height": scene.source_size[1],
        "head_xy": to_source(path.head) if path else None,
        "tail_xy": to_source(path.tail) if path else None,
        "robot_path_xy": np.round(scene.points_to_source(path.points), 2).tolist() if path else None,
        "reason": str(scene.refusal) if scene.refusal else None,
        "latency_ms": scene.latency_ms,
    }
    for key, vector in (("robot_vector", scene.robot_vector), ("vessel_vector", scene.vessel_vector)):
        values[key] = {part: to_source(getattr(vector, part)) for part in _VectorLayout.model_fields} if vector else None
    if pose is not None:
        for key in ("theta_deg", "theta_signed_deg", "d_head_px", "d_tail_px", "crossed", "state", "confidence"):
            values[key] = getattr(pose, key)
    return PerceivedLine.model_validate(values).model_dump(mode="json")


def unread_to_json(name: str, problem: str) -> Row:
    """The ``perceive`` line of an image that could not be read."""
    blank = Scene(0, 0.0, (0, 0), 1.0, refusal=Refusal(Reason.UNREADABLE, problem))
    return scene_to_json(name, blank) | {"width": None, "height": None}


def scene_from_json(data: bytes) -> Scene:
    """The scene of a ``perceive`` line: path, vectors, pose or reason, all in source pixels. Raises InvalidRecord."""
    line = read_json(PerceivedLine, data)
    if line.width is None or line.height is None:
        raise InvalidRecord("width: the image could not be read")
    path = RobotPath(_array(line.robot_path_xy), 0.0, None, False, 0.0, 0.0) if line.robot_path_xy else None
    try:
        robot, vessel = (_vector((v.start, v.center, v.end)) if v else None for v in (line.robot_vector, line.vessel_vector))
        pose, refusal = None, None
        if line.state is None or robot is None or vessel is None:
            reason, _, detail = (line.reason or "").partition(": ")
            refusal = Refusal(Reason(reason), detail)
        else:
            signed, d_head, d_tail = line.theta_signed_deg, line.d_head_px, line.d_tail_px
            if signed is None or d_head is None or d_tail is None:
                raise ValueError("a state without angle or distances")
            head, tail = (math.copysign(1.0, _offset(vessel, end)) for end in (robot.end, robot.start))
            pose = Pose(abs(signed), signed, head * d_head, tail * d_tail, head != tail, line.state, line.confidence)
    except ValueError as error:
        raise InvalidRecord(str(error)) from None
    return Scene(
        0,
        0.0,
        (line.width, line.height),
        1.0,
        path=path,
        robot_vector=robot,
        vessel_vector=vessel,
        pose=pose,
        refusal=refusal,
        latency_ms=line.latency_ms,
    )


def _offset(vessel: Vector, place: Point) -> float:
    """Signed distance from the vessel's line (METHOD section 5), here only for its side."""
    x, y = vessel.direction
    return x * (place[1] - vessel.center[1]) - y * (place[0] - vessel.center[0])
