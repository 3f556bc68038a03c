"""A tick of the engine as one row of ``frames.jsonl``. Pure; ``recorded`` is the way back.

Points are in working pixels as in the scene, thinned where a line is straight. What has a number that is not finite becomes None,
and ``not_finite`` names it, so that every row is valid JSON whatever perception gave.

Values out of a file that may be damaged: each is what it should be, or it is named. And finite numbers into one.

A row of ``frames.jsonl`` as values again, so that what was recorded is shown by the same code as what is live. Pure.

Advice, commands, servo status and driving out of a row of ``frames.jsonl``. Pure; part of ``recorded``.

Words of a later version of the program in a recorded row: what they belong to is left out, and the row stands. Pure.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any, TypeVar

import cv2
import numpy as np

from core.control.faults import Cause, Fault
from core.control.gate import Source
from core.control.modes import Hindrance, Mode
from core.control.pilot import DriveView
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

Choice = TypeVar("Choice", bound=StrEnum)

MAX_POINTS = 20_000
_MAX_TEXT = 20_000
_LONGEST_S = 1e9


class InvalidRecord(ValueError):
    """A record is not what it should be; the message names the value."""


def finite(value: float | None, digits: int) -> float | None:
    """Rounded; None when it is missing or no finite number, as JSON knows none."""
    return round(float(value), digits) if value is not None and math.isfinite(value) else None


def finite_tree(value: Any) -> Any:
    """Plain JSON values, rounded; a number that is not finite becomes None, what JSON does not know its text."""
    if isinstance(value, dict):
        return {str(key): finite_tree(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite_tree(inner) for inner in value]
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, float):
        return finite(value, 5)
    if isinstance(value, int):
        return int(value)
    return str(value)


def checked_number(value: Any, name: str) -> float:
    """A finite number."""
    if type(value) not in (int, float):
        raise InvalidRecord(f"{name}: not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InvalidRecord(f"{name}: not a finite number")
    return number


def moment(value: Any, name: str) -> float:
    """Seconds of a monotonic clock: no computer has run for thirty years."""
    seconds = checked_number(value, name)
    if abs(seconds) > _LONGEST_S:
        raise InvalidRecord(f"{name}: no time of a clock")
    return seconds


def maybe_number(value: Any, name: str) -> float | None:
    return None if value is None else checked_number(value, name)


def count(value: Any, name: str) -> int:
    """A whole number from 0 on that fits 63 bits."""
    if type(value) is not int or not 0 <= value < 2**63:
        raise InvalidRecord(f"{name}: not a count")
    return value


def flag(value: Any, name: str) -> bool:
    if type(value) is not bool:
        raise InvalidRecord(f"{name}: neither true nor false")
    return value


def text(value: Any, name: str) -> str:
    if type(value) is not str or len(value) > _MAX_TEXT:
        raise InvalidRecord(f"{name}: not a text")
    # Half a character, which JSON may name, is none, and brings down who draws or writes it.
    return value if value.isascii() else value.encode("utf-8", "backslashreplace").decode()


def choice(kind: type[Choice], value: Any, name: str) -> Choice:
    """One of the values of an enumeration."""
    try:
        return kind(text(value, name))
    except ValueError:
        raise InvalidRecord(f"{name}: unknown ({str(value)[:40]!r})") from None


def group(value: Any, name: str) -> dict[str, Any]:
    """A JSON object."""
    if type(value) is not dict:
        raise InvalidRecord(f"{name}: not an object")
    return value


def items(value: Any, name: str) -> list[Any]:
    if type(value) is not list or len(value) > MAX_POINTS:
        raise InvalidRecord(f"{name}: not a list")
    return value


def numbers(value: Any, name: str, length: int | None = None) -> Sequence[float]:
    """A list of finite numbers, of this length if one is given."""
    found = items(value, name)
    if length is not None and len(found) != length:
        raise InvalidRecord(f"{name}: {len(found)} numbers instead of {length}")
    return [checked_number(inner, name) for inner in found]


def point(value: Any, name: str) -> Point:
    x, y = numbers(value, name, 2)
    return x, y


def points(value: Any, name: str) -> Points:
    """(N, 2) out of a list of pairs."""
    pairs = [point(inner, name) for inner in items(value, name)]
    return np.array(pairs, np.float64).reshape(-1, 2)


Row = dict[str, Any]

_LINE_PX = 0.3
"""Farthest that a thinned line leaves the recorded one."""
_VESSEL_PX, _ROBOT_PX = 1.0, 0.5
"""The same for the outlines of the masks: the robot is thin."""
_EMPTY = np.zeros((0, 0), np.float32)


def light_tick(tick: Tick) -> Tick:
    """The same without what is not recorded (probabilities, skeletons), so that frames in a queue weigh a third."""
    scene = tick.scene
    if scene.masks is None and scene.skeletons is None:
        return tick
    masks = replace(scene.masks, vessel_probability=_EMPTY, robot_probability=_EMPTY) if scene.masks else None
    skeletons = scene.skeletons
    if skeletons is not None:
        skeletons = replace(skeletons, vessel=np.zeros((0, 0), bool), robot=np.zeros((0, 0), bool))
    return replace(tick, scene=replace(scene, masks=masks, skeletons=skeletons))


def row_of(tick: Tick, drive: DriveView | None, *, bus: Any = None, with_masks: bool = True) -> Row:
    """One row, without its place in the session (``row``, ``video``, ``pts_ms``, ``dropped_rows``), which the writer adds.

    Parameters
    ----------
    drive : None when there is no robot to drive.
    bus : the newest status of the servo bus, any dataclass of plain values; None where there is no bus.
    with_masks : also outlines of the masks, and the vessel graph.
    """
    scene, pose = tick.scene, tick.scene.pose
    height, width = tick.frame.image.shape[:2]
    broken: list[str] = []
    values = None
    if pose is not None:
        numbers = (pose.theta_signed_deg, pose.c_head_px, pose.c_tail_px, pose.confidence)
        values = _whole([finite(value, 4) for value in numbers], "pose", broken)
    pose = pose if values is not None else None
    theta, c_head, c_tail, confidence = values or (None,) * 4
    novelty = finite(scene.novelty, 4) if scene.novelty is not None else None
    if scene.novelty is not None and novelty is None:
        broken.append("novelty")
    row = {
        "index": tick.frame.index,
        "captured_s": finite(tick.frame.captured_s, 6),
        "size": [width, height],
        "dropped_frames": tick.dropped_frames,
        "camera_lost": tick.frame.lost,
        "fps": finite(tick.frames_per_second, 3),
        "mode": drive.mode.value if drive else None,
        "state": pose.state.value if pose else None,
        "theta_signed_deg": theta,
        "c_head_px": c_head,
        "c_tail_px": c_tail,
        "crossed": pose.crossed if pose else None,
        "confidence": confidence,
        "novelty": novelty,
        "refusal": {"reason": scene.refusal.reason.value, "detail": scene.refusal.detail} if scene.refusal else None,
        "advice": _whole(_advice(tick.advice), "advice", broken),
        "sent": _whole(_command(tick.sent), "sent", broken),
        "servo": _whole(_status(tick.status), "servo", broken, {"wall_contact_n"}),
        "drive": _drive(drive, broken) if drive else None,
        "bus": finite_tree(asdict(bus)) if bus is not None else None,
        "latency_ms": {stage: finite(ms, 3) for stage, ms in scene.latency_ms.items()},
        "scene": _scene(scene, with_masks, broken),
    }
    return row | {"not_finite": broken} if broken else row


Whole = TypeVar("Whole", Row, list[Any])


def _whole(record: Whole | None, name: str, broken: list[str], may_miss: Container[str] = ()) -> Whole | None:
    """The record, or None when a value in it is missing that must not; then its name goes to `broken`."""
    if record is None:
        return None
    values = [value for key, value in record.items() if key not in may_miss] if isinstance(record, dict) else record
    if all(value is not None and not (isinstance(value, list) and None in value) for value in values):
        return record
    broken.append(name)
    return None


def _scene(scene: Scene, with_masks: bool, broken: list[str]) -> Row:
    return {
        "source_size": list(scene.source_size),
        "scale": finite(scene.scale, 9),
        "scale_xy": [finite(value, 9) for value in scene.scale_xy] if scene.scale_xy else None,
        "robot_vector": _whole(_vector(scene.robot_vector), "robot_vector", broken),
        "vessel_vector": _whole(_vector(scene.vessel_vector), "vessel_vector", broken),
        "path": _whole(_path(scene.path), "path", broken, {"runner_up"}) if scene.path else None,
        "centerline": _whole(_centerline(scene.centerline), "centerline", broken) if scene.centerline else None,
        "route": _whole(_route(scene.route), "route", broken) if scene.route else None,
        "route_problem": scene.route_problem,
        "bridges": [[_point(a), _point(b)] for a, b in scene.skeletons.bridges] if scene.skeletons else None,
        "masks": _masks(scene.masks) if scene.masks and with_masks else None,
        "graph": _graph(scene.vessel_graph, broken) if scene.vessel_graph and with_masks else None,
    }


def _point(point: Point) -> list[float | None]:
    return [finite(point[0], 3), finite(point[1], 3)]


def _vector(vector: Vector | None) -> list[list[float | None]] | None:
    return [_point(vector.start), _point(vector.center), _point(vector.end)] if vector else None


def _line(points: Points, digits: int = 2) -> list[list[float]]:
    """A polyline (N, 2), thinned and rounded; points that are not finite are left out."""
    line = points.astype(np.float32)
    if not np.isfinite(line).all():
        line = line[np.isfinite(line).all(axis=1)]
    if len(line) > 2:
        line = np.asarray(cv2.approxPolyDP(line[:, None], _LINE_PX, False)[:, 0], np.float32)
    return np.round(line.astype(np.float64), digits).tolist()  # type: ignore[no-any-return]


def _path(path: RobotPath) -> Row:
    return {
        "points": _line(path.points),
        "score": finite(path.score, 5),
        "runner_up": finite(path.runner_up, 5),
        "entry_on_border": path.entry_on_border,
        "bridged_px": finite(path.bridged_px, 2),
        "radius_px": finite(path.radius_px, 3),
    }


def _centerline(line: Centerline) -> Row:
    return {
        "piece": _line(line.piece),
        "nearest": _point(line.nearest),
        "radius_px": finite(line.radius_px, 3),
        "ambiguity": finite(line.ambiguity, 4),
    }


def _route(route: Route) -> Row:
    return {"points": _line(route.points), "length_px": finite(route.length_px, 2), "target": _point(route.target)}


def _masks(masks: Masks) -> Row:
    height, width = masks.vessel.shape
    return {"size": [width, height], "vessel": _outlines(masks.vessel, _VESSEL_PX), "robot": _outlines(masks.robot, _ROBOT_PX)}


def _outlines(mask: Mask, leave_px: float) -> list[list[int]]:
    """Outlines of areas and of holes as x, y, dx, dy, dx, dy, ...; filled by the even-odd rule they are the mask again, within a
    pixel."""
    found, _ = cv2.findContours(mask.view(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    outlines = (cv2.approxPolyDP(outline, leave_px, True)[:, 0] for outline in found)
    return [np.diff(outline, axis=0, prepend=0).ravel().tolist() for outline in outlines]


def _graph(graph: VesselGraph, broken: list[str]) -> Row | None:
    """None where a node or a radius is no number: an edge that leads nowhere is no edge."""
    if not all(np.isfinite(numbers).all() for numbers in (graph.nodes, *(edge.radius for edge in graph.edges))):
        broken.append("graph")
        return None
    edges = [
        [edge.start, edge.end, _line(edge.points, 1), finite(float(edge.radius.mean()) if edge.radius.size else 0.0, 1)]
        for edge in graph.edges
    ]
    return {"nodes": np.round(graph.nodes, 1).tolist(), "edges": edges}


def _advice(advice: Advice | None) -> Row | None:
    if advice is None:
        return None
    return {
        "speed": advice.speed.value,
        "advance_mm_s": finite(advice.advance_mm_s, 4),
        "steer_deg": finite(advice.steer_deg, 4),
        "why": advice.why,
    }


def _command(command: Command | None) -> list[float | None] | None:
    """Bend, pitch, advance and delivery (mm/s)."""
    if command is None:
        return None
    return [finite(v, 5) for v in (command.bend, command.pitch, command.advance_mm_s, command.delivery_mm_s)]


def _status(status: RobotStatus | None) -> Row | None:
    if status is None:
        return None
    return {
        "time_s": finite(status.time_s, 6),
        "insertion_mm": finite(status.insertion_mm, 4),
        "delivery_mm": finite(status.delivery_mm, 4),
        "tendon_pull_mm": [finite(value, 4) for value in status.tendon_pull_mm],
        "tendon_force_mn": [finite(value, 3) for value in status.tendon_force_mn],
        "wall_contact_n": finite(status.wall_contact_n, 6),
    }


def _fault(fault: Fault) -> list[str]:
    return [fault.cause.value, fault.detail]


def _drive(drive: DriveView, broken: list[str]) -> Row:
    return {
        "time_s": finite(drive.time_s, 6),
        "mode": drive.mode.value,
        "permitted": drive.permitted.value if drive.permitted else None,
        "latched": _fault(drive.latched) if drive.latched else None,
        "active": [_fault(fault) for fault in drive.active],
        "against_arming": [reason.value for reason in drive.against_arming],
        "against_hand_over": [reason.value for reason in drive.against_hand_over],
        "deadman": drive.deadman,
        "servos_on": drive.servos_on,
        "busy": drive.busy,
        "asked": _whole(_command(drive.asked), "drive.asked", broken),
        "asked_s": finite(drive.asked_s, 6),
        "advice": _whole(_advice(drive.advice), "drive.advice", broken),
        "blanked": drive.blanked,
        "commanded": _whole(_command(drive.commanded), "drive.commanded", broken),
        "sent": _whole(_command(drive.sent), "drive.sent", broken),
        "sent_by": drive.sent_by.value if drive.sent_by else None,
        "latency_s": finite(drive.latency_s, 6),
        "latency_p95_s": finite(drive.latency_p95_s, 6),
        "follow_share": finite(drive.follow_share, 4),
    }


def advice_from(value: Any, name: str) -> Advice | None:
    if value is None:
        return None
    advice = group(value, name)
    return Advice(
        choice(Speed, advice.get("speed"), f"{name}.speed"),
        checked_number(advice.get("advance_mm_s"), f"{name}.advance_mm_s"),
        checked_number(advice.get("steer_deg"), f"{name}.steer_deg"),
        text(advice.get("why"), f"{name}.why"),
    )


def command_from(value: Any, name: str) -> Command | None:
    return None if value is None else Command(*numbers(value, name, 4))


def status_from(value: Any) -> RobotStatus | None:
    if value is None:
        return None
    status = group(value, "servo")
    pull = numbers(status.get("tendon_pull_mm"), "servo.tendon_pull_mm", 4)
    force = numbers(status.get("tendon_force_mn"), "servo.tendon_force_mn", 4)
    return RobotStatus(
        checked_number(status.get("time_s"), "servo.time_s"),
        checked_number(status.get("insertion_mm"), "servo.insertion_mm"),
        checked_number(status.get("delivery_mm"), "servo.delivery_mm"),
        (pull[0], pull[1], pull[2], pull[3]),
        (force[0], force[1], force[2], force[3]),
        maybe_number(status.get("wall_contact_n"), "servo.wall_contact_n"),
    )


def _recorded_drive_fault(value: Any, name: str) -> Fault:
    pair = items(value, name)
    if len(pair) != 2:
        raise InvalidRecord(f"{name}: not cause and detail")
    return Fault(choice(Cause, pair[0], name), text(pair[1], name))


def _reasons(value: Any, name: str) -> tuple[Hindrance | Cause, ...]:
    found: list[Hindrance | Cause] = []
    for reason in items(value, name):
        is_hindrance = type(reason) is str and reason in set(Hindrance)
        found.append(choice(Hindrance, reason, name) if is_hindrance else choice(Cause, reason, name))
    return tuple(found)


def _maybe_source(value: Any, name: str) -> Source | None:
    return None if value is None else choice(Source, value, name)


def drive_from(value: Any) -> DriveView | None:
    if value is None:
        return None
    drive = group(value, "drive")
    latched, deadman = drive.get("latched"), drive.get("deadman")
    return DriveView(
        time_s=checked_number(drive.get("time_s"), "drive.time_s"),
        mode=choice(Mode, drive.get("mode"), "drive.mode"),
        permitted=_maybe_source(drive.get("permitted"), "drive.permitted"),
        latched=None if latched is None else _recorded_drive_fault(latched, "drive.latched"),
        active=tuple(_recorded_drive_fault(fault, "drive.active") for fault in items(drive.get("active"), "drive.active")),
        against_arming=_reasons(drive.get("against_arming"), "drive.against_arming"),
        against_hand_over=_reasons(drive.get("against_hand_over"), "drive.against_hand_over"),
        deadman=None if deadman is None else flag(deadman, "drive.deadman"),
        servos_on=flag(drive.get("servos_on"), "drive.servos_on"),
        busy=text(drive.get("busy"), "drive.busy"),
        asked=command_from(drive.get("asked"), "drive.asked") or Command(),
        asked_s=maybe_number(drive.get("asked_s"), "drive.asked_s"),
        advice=advice_from(drive.get("advice"), "drive.advice"),
        blanked=text(drive.get("blanked"), "drive.blanked"),
        commanded=command_from(drive.get("commanded"), "drive.commanded"),
        sent=command_from(drive.get("sent"), "drive.sent"),
        sent_by=_maybe_source(drive.get("sent_by"), "drive.sent_by"),
        latency_s=maybe_number(drive.get("latency_s"), "drive.latency_s"),
        latency_p95_s=maybe_number(drive.get("latency_p95_s"), "drive.latency_p95_s"),
        follow_share=maybe_number(drive.get("follow_share"), "drive.follow_share"),
    )


_PAIR = 2


def without_later_words(record: Row) -> tuple[Row, tuple[str, ...]]:
    """The row without what this version has no word for, and these words, each with its place.

    Damage is not looked for here: a row whose checksum is right says what its writer meant.
    """
    unknown: list[str] = []
    row = dict(record)
    if _is_later(PoseState, row.get("state"), "state", unknown):
        row["state"] = None
    if isinstance(row.get("refusal"), dict) and _is_later(Reason, row["refusal"].get("reason"), "refusal", unknown):
        row["refusal"] = None
    row["advice"] = _later_words_advice(row.get("advice"), unknown)
    if isinstance(row.get("drive"), dict):
        row["drive"] = _later_words_drive(row["drive"], unknown)
    return row, tuple(dict.fromkeys(unknown))


def _is_later(kind: type[StrEnum], word: Any, place: str, unknown: list[str]) -> bool:
    """What is no text is for others to judge."""
    if not isinstance(word, str) or word in set(kind):
        return False
    unknown.append(f"{place} {word[:40]!r}")
    return True


def _later_words_advice(advice: Any, unknown: list[str]) -> Any:
    is_later = isinstance(advice, dict) and _is_later(Speed, advice.get("speed"), "speed", unknown)
    return None if is_later else advice


def _later_words_drive(drive: Row, unknown: list[str]) -> Row | None:
    if _is_later(Mode, drive.get("mode"), "mode", unknown):
        return None
    known = dict(drive)
    for name in ("permitted", "sent_by"):
        if _is_later(Source, known.get(name), name, unknown):
            known[name] = None
    known["latched"] = next(_known_faults([known.get("latched")], unknown), None)
    if isinstance(known.get("active"), list):
        known["active"] = list(_known_faults(known["active"], unknown))
    for name in ("against_arming", "against_hand_over"):
        if isinstance(known.get(name), list):
            known[name] = [word for word in known[name] if _is_hindrance(word) or not _is_later(Cause, word, name, unknown)]
    known["advice"] = _later_words_advice(known.get("advice"), unknown)
    return known


def _is_hindrance(word: Any) -> bool:
    return isinstance(word, str) and word in set(Hindrance)


def _known_faults(faults: list[Any], unknown: list[str]) -> Iterator[Any]:
    for fault in faults:
        if not (isinstance(fault, list) and len(fault) == _PAIR and _is_later(Cause, fault[0], "fault", unknown)):
            yield fault


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
        scene=_recorded_scene(record, index, captured_s),
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
        raise InvalidRecord(f"{name}: not a size")
    return sides[0], sides[1]


def _recorded_scene(record: Row, index: int, captured_s: float) -> Scene:
    scene = group(record.get("scene"), "scene")
    across = scene.get("scale_xy")
    scale = checked_number(scene.get("scale"), "scale")
    scale_xy = numbers(across, "scale_xy", 2) if across is not None else None
    if min(scale, *(scale_xy or ())) <= 0.0 if scale_xy else scale <= 0.0:
        raise InvalidRecord("scale: not positive")
    stages = group(record.get("latency_ms"), "latency_ms")
    return Scene(
        index,
        captured_s,
        _size(scene.get("source_size"), "source_size"),
        scale,
        masks=_recorded_masks(scene.get("masks")),
        skeletons=_bridges(scene.get("bridges")),
        path=_recorded_path(scene.get("path")),
        vessel_graph=_recorded_graph(scene.get("graph")),
        route=_recorded_route(scene.get("route")),
        centerline=_recorded_centerline(scene.get("centerline")),
        robot_vector=_recorded_vector(scene.get("robot_vector"), "robot_vector"),
        vessel_vector=_recorded_vector(scene.get("vessel_vector"), "vessel_vector"),
        pose=_pose(record),
        refusal=_refusal(record.get("refusal")),
        latency_ms={stage: checked_number(ms, f"latency_ms.{stage}") for stage, ms in stages.items() if ms is not None},
        route_problem=text(scene.get("route_problem", ""), "route_problem"),
        scale_xy=(scale_xy[0], scale_xy[1]) if scale_xy is not None else None,
        novelty=maybe_number(record.get("novelty"), "novelty"),  # sessions of before have none
    )


def _pose(record: Row) -> Pose | None:
    if record.get("state") is None:
        return None
    signed = checked_number(record.get("theta_signed_deg"), "theta_signed_deg")
    return Pose(
        theta_deg=abs(signed),
        theta_signed_deg=signed,
        c_head_px=checked_number(record.get("c_head_px"), "c_head_px"),
        c_tail_px=checked_number(record.get("c_tail_px"), "c_tail_px"),
        crossed=flag(record.get("crossed"), "crossed"),
        state=choice(PoseState, record["state"], "state"),
        confidence=checked_number(record.get("confidence"), "confidence"),
    )


def _refusal(value: Any) -> Refusal | None:
    if value is None:
        return None
    refusal = group(value, "refusal")
    return Refusal(choice(Reason, refusal.get("reason"), "refusal.reason"), text(refusal.get("detail", ""), "refusal.detail"))


def _recorded_vector(value: Any, name: str) -> Vector | None:
    if value is None:
        return None
    ends = points(value, name)
    if len(ends) != 3 or (ends[0] == ends[2]).all():
        raise InvalidRecord(f"{name}: not start, center and end")
    start, center, end = ((float(x), float(y)) for x, y in ends)
    return Vector(start, center, end)


def _recorded_path(value: Any) -> RobotPath | None:
    if value is None:
        return None
    path = group(value, "path")
    line = points(path.get("points"), "path.points")
    if not len(line):
        raise InvalidRecord("path.points: empty")
    return RobotPath(
        line,
        checked_number(path.get("score"), "path.score"),
        maybe_number(path.get("runner_up"), "path.runner_up"),
        flag(path.get("entry_on_border"), "path.entry_on_border"),
        checked_number(path.get("bridged_px"), "path.bridged_px"),
        checked_number(path.get("radius_px"), "path.radius_px"),
    )


def _recorded_centerline(value: Any) -> Centerline | None:
    if value is None:
        return None
    line = group(value, "centerline")
    return Centerline(
        points(line.get("piece"), "centerline.piece"),
        point(line.get("nearest"), "centerline.nearest"),
        checked_number(line.get("radius_px"), "centerline.radius_px"),
        checked_number(line.get("ambiguity"), "centerline.ambiguity"),
    )


def _recorded_route(value: Any) -> Route | None:
    if value is None:
        return None
    route = group(value, "route")
    length = checked_number(route.get("length_px"), "route.length_px")
    return Route(points(route.get("points"), "route.points"), length, point(route.get("target"), "route.target"))


def _bridges(value: Any) -> Skeletons | None:
    """Only the bridges of a skeleton are recorded."""
    if value is None:
        return None
    blank = np.zeros((0, 0), bool)
    pairs = [points(pair, "bridges") for pair in items(value, "bridges")]
    if any(len(pair) != 2 for pair in pairs):
        raise InvalidRecord("bridges: not pairs of points")
    ends = (((float(a[0]), float(a[1])), (float(b[0]), float(b[1]))) for a, b in pairs)
    return Skeletons(blank, blank, tuple(ends))


def _recorded_masks(value: Any) -> Masks | None:
    """Probabilities are not recorded: they are those of the masks, 0 and 1."""
    if value is None:
        return None
    masks = group(value, "masks")
    size = _size(masks.get("size"), "masks.size")
    if not 0 < min(size) <= max(size) <= _MAX_MASK_PX:
        raise InvalidRecord("masks.size: empty or too large")
    vessel, robot = (_filled(masks.get(name), size, f"masks.{name}") for name in ("vessel", "robot"))
    return Masks(vessel, robot, vessel.astype(np.float32), robot.astype(np.float32))


def _filled(value: Any, size: tuple[int, int], name: str) -> Mask:
    canvas = np.zeros((size[1], size[0]), np.uint8)
    outlines = []
    for outline in items(value, name):
        flat = items(outline, name)
        if not flat or len(flat) % 2 or not all(type(v) is int and abs(v) <= _MAX_SIDE_PX for v in flat):
            raise InvalidRecord(f"{name}: not an outline")
        corners = np.array(flat, np.int64).reshape(-1, 2).cumsum(axis=0)
        outlines.append(np.clip(corners, -1, _MAX_SIDE_PX).astype(np.int32))
    if outlines:
        cv2.fillPoly(canvas, outlines, 1)
    return canvas.astype(bool)


def _recorded_graph(value: Any) -> VesselGraph | None:
    if value is None:
        return None
    graph = group(value, "graph")
    nodes = points(graph.get("nodes"), "graph.nodes")
    edges = []
    for edge in items(graph.get("edges"), "graph.edges"):
        if type(edge) is not list or len(edge) != 4:
            raise InvalidRecord("graph.edges: not start, end, points and radius")
        start, end = count(edge[0], "graph.edges"), count(edge[1], "graph.edges")
        line = points(edge[2], "graph.edges")
        if max(start, end) >= len(nodes) or not len(line):
            raise InvalidRecord("graph.edges: an end that is no node, or no points")
        edges.append(GraphEdge(start, end, line, np.full(len(line), checked_number(edge[3], "graph.edges"))))
    return VesselGraph(nodes, tuple(edges))
