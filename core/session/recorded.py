"""A row of ``frames.jsonl`` as values again, so that what was recorded is shown by the same code as what is live. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from core.control.drive_view import DriveView
from core.session.checked import (
    Damaged,
    choice,
    count,
    flag,
    group,
    items,
    maybe_number,
    moment,
    number,
    numbers,
    point,
    points,
    text,
)
from core.session.later_words import without_later_words
from core.session.recorded_drive import advice_from, command_from, drive_from, status_from
from core.types import (
    Advice,
    Centerline,
    Command,
    Frame,
    GraphEdge,
    Image,
    Mask,
    Masks,
    Pose,
    PoseState,
    Reason,
    Refusal,
    RobotPath,
    RobotStatus,
    Route,
    Scene,
    Skeletons,
    Tick,
    Vector,
    VesselGraph,
)

Row = dict[str, Any]

_MAX_SIDE_PX = 16_384
_MAX_MASK_PX = 4096


@dataclass(frozen=True, slots=True, eq=False)
class RecordedRow:
    """One recorded frame without its picture. ``row`` counts in the session, ``index`` is the camera's; ``pts_ms`` is the time in
    the video file number ``video``. ``size`` is the picture's (width, height). ``drive`` is None when there was no robot to drive.
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
    unknown: tuple[str, ...] = ()
    """Words of a later version, each with its place; what they belonged to is left out."""

    @property
    def source_px_per_working_px(self) -> float:
        """Places are told in source pixels, distances to the centerline (``c_head_px``, ``c_tail_px``) in working pixels."""
        return 1.0 / self.scene.scale

    def tick(self, image: Image) -> Tick:
        """The tick as it was, with its picture from the video."""
        frame = Frame(self.index, self.captured_s, image, self.camera_lost)
        return Tick(
            frame, self.scene, self.advice, self.sent, self.status, self.dropped_frames + self.dropped_rows, self.frames_per_second
        )


def row_from_json(record: Row) -> RecordedRow:
    """Raises Damaged, which names the value. A word of a later version damages nothing."""
    record, unknown = without_later_words(record)
    index, captured_s = count(record.get("index"), "index"), moment(record.get("captured_s"), "captured_s")
    return RecordedRow(
        row=count(record.get("row"), "row"),
        index=index,
        captured_s=captured_s,
        video=count(record.get("video"), "video"),
        pts_ms=count(record.get("pts_ms"), "pts_ms"),
        size=_size(record.get("size"), "size"),
        dropped_frames=count(record.get("dropped_frames"), "dropped_frames"),
        dropped_rows=count(record.get("dropped_rows", 0), "dropped_rows"),
        frames_per_second=maybe_number(record.get("fps"), "fps") or 0.0,
        scene=_scene(record, index, captured_s),
        advice=advice_from(record.get("advice"), "advice"),
        sent=command_from(record.get("sent"), "sent"),
        status=status_from(record.get("servo")),
        drive=drive_from(record.get("drive")),
        bus=group(record["bus"], "bus") if record.get("bus") is not None else None,
        camera_lost=count(record.get("camera_lost", 0), "camera_lost"),  # sessions of before have none
        unknown=unknown,
    )


def _size(value: Any, name: str) -> tuple[int, int]:
    sides = items(value, name)
    if len(sides) != 2 or not all(type(side) is int and 0 <= side <= _MAX_SIDE_PX for side in sides):
        raise Damaged(f"{name}: not a size")
    return sides[0], sides[1]


def _scene(record: Row, index: int, captured_s: float) -> Scene:
    scene = group(record.get("scene"), "scene")
    across = scene.get("scale_xy")
    scale = number(scene.get("scale"), "scale")
    scale_xy = numbers(across, "scale_xy", 2) if across is not None else None
    if min(scale, *(scale_xy or ())) <= 0.0 if scale_xy else scale <= 0.0:
        raise Damaged("scale: not positive")
    stages = group(record.get("latency_ms"), "latency_ms")
    return Scene(
        index,
        captured_s,
        _size(scene.get("source_size"), "source_size"),
        scale,
        masks=_masks(scene.get("masks")),
        skeletons=_bridges(scene.get("bridges")),
        path=_path(scene.get("path")),
        vessel_graph=_graph(scene.get("graph")),
        route=_route(scene.get("route")),
        centerline=_centerline(scene.get("centerline")),
        robot_vector=_vector(scene.get("robot_vector"), "robot_vector"),
        vessel_vector=_vector(scene.get("vessel_vector"), "vessel_vector"),
        pose=_pose(record),
        refusal=_refusal(record.get("refusal")),
        latency_ms={stage: number(ms, f"latency_ms.{stage}") for stage, ms in stages.items() if ms is not None},
        route_problem=text(scene.get("route_problem", ""), "route_problem"),
        scale_xy=(scale_xy[0], scale_xy[1]) if scale_xy is not None else None,
        novelty=maybe_number(record.get("novelty"), "novelty"),  # sessions of before have none
    )


def _pose(record: Row) -> Pose | None:
    if record.get("state") is None:
        return None
    signed = number(record.get("theta_signed_deg"), "theta_signed_deg")
    return Pose(
        theta_deg=abs(signed),
        theta_signed_deg=signed,
        c_head_px=number(record.get("c_head_px"), "c_head_px"),
        c_tail_px=number(record.get("c_tail_px"), "c_tail_px"),
        crossed=flag(record.get("crossed"), "crossed"),
        state=choice(PoseState, record["state"], "state"),
        confidence=number(record.get("confidence"), "confidence"),
    )


def _refusal(value: Any) -> Refusal | None:
    if value is None:
        return None
    refusal = group(value, "refusal")
    return Refusal(choice(Reason, refusal.get("reason"), "refusal.reason"), text(refusal.get("detail", ""), "refusal.detail"))


def _vector(value: Any, name: str) -> Vector | None:
    if value is None:
        return None
    ends = points(value, name)
    if len(ends) != 3 or (ends[0] == ends[2]).all():
        raise Damaged(f"{name}: not start, center and end")
    start, center, end = ((float(x), float(y)) for x, y in ends)
    return Vector(start, center, end)


def _path(value: Any) -> RobotPath | None:
    if value is None:
        return None
    path = group(value, "path")
    line = points(path.get("points"), "path.points")
    if not len(line):
        raise Damaged("path.points: empty")
    return RobotPath(
        line,
        number(path.get("score"), "path.score"),
        maybe_number(path.get("runner_up"), "path.runner_up"),
        flag(path.get("entry_on_border"), "path.entry_on_border"),
        number(path.get("bridged_px"), "path.bridged_px"),
        number(path.get("radius_px"), "path.radius_px"),
    )


def _centerline(value: Any) -> Centerline | None:
    if value is None:
        return None
    line = group(value, "centerline")
    return Centerline(
        points(line.get("piece"), "centerline.piece"),
        point(line.get("nearest"), "centerline.nearest"),
        number(line.get("radius_px"), "centerline.radius_px"),
        number(line.get("ambiguity"), "centerline.ambiguity"),
    )


def _route(value: Any) -> Route | None:
    if value is None:
        return None
    route = group(value, "route")
    length = number(route.get("length_px"), "route.length_px")
    return Route(points(route.get("points"), "route.points"), length, point(route.get("target"), "route.target"))


def _bridges(value: Any) -> Skeletons | None:
    """Only the bridges of a skeleton are recorded."""
    if value is None:
        return None
    blank = np.zeros((0, 0), bool)
    pairs = [points(pair, "bridges") for pair in items(value, "bridges")]
    if any(len(pair) != 2 for pair in pairs):
        raise Damaged("bridges: not pairs of points")
    ends = (((float(a[0]), float(a[1])), (float(b[0]), float(b[1]))) for a, b in pairs)
    return Skeletons(blank, blank, tuple(ends))


def _masks(value: Any) -> Masks | None:
    """Probabilities are not recorded: they are those of the masks, 0 and 1."""
    if value is None:
        return None
    masks = group(value, "masks")
    size = _size(masks.get("size"), "masks.size")
    if not 0 < min(size) <= max(size) <= _MAX_MASK_PX:
        raise Damaged("masks.size: empty or too large")
    vessel, robot = (_filled(masks.get(name), size, f"masks.{name}") for name in ("vessel", "robot"))
    return Masks(vessel, robot, vessel.astype(np.float32), robot.astype(np.float32))


def _filled(value: Any, size: tuple[int, int], name: str) -> Mask:
    canvas = np.zeros((size[1], size[0]), np.uint8)
    outlines = []
    for outline in items(value, name):
        flat = items(outline, name)
        if not flat or len(flat) % 2 or not all(type(v) is int and abs(v) <= _MAX_SIDE_PX for v in flat):
            raise Damaged(f"{name}: not an outline")
        corners = np.array(flat, np.int64).reshape(-1, 2).cumsum(axis=0)
        outlines.append(np.clip(corners, -1, _MAX_SIDE_PX).astype(np.int32))
    if outlines:
        cv2.fillPoly(canvas, outlines, 1)
    return canvas.astype(bool)


def _graph(value: Any) -> VesselGraph | None:
    if value is None:
        return None
    graph = group(value, "graph")
    nodes = points(graph.get("nodes"), "graph.nodes")
    edges = []
    for edge in items(graph.get("edges"), "graph.edges"):
        if type(edge) is not list or len(edge) != 4:
            raise Damaged("graph.edges: not start, end, points and radius")
        start, end = count(edge[0], "graph.edges"), count(edge[1], "graph.edges")
        line = points(edge[2], "graph.edges")
        if max(start, end) >= len(nodes) or not len(line):
            raise Damaged("graph.edges: an end that is no node, or no points")
        edges.append(GraphEdge(start, end, line, np.full(len(line), number(edge[3], "graph.edges"))))
    return VesselGraph(nodes, tuple(edges))
