"""A tick of the engine as one row of ``frames.jsonl``. Pure; ``recorded`` is the way back.

Points are in working pixels as in the scene, thinned where a line is straight. What has a number that is not finite becomes None,
and ``not_finite`` names it, so that every row is valid JSON whatever perception gave.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import asdict, replace
from typing import Any, TypeVar

import cv2
import numpy as np

from core.control.drive_view import DriveView
from core.control.faults import Fault
from core.session.checked import finite, finite_tree
from core.types import (
    Advice,
    Centerline,
    Command,
    Mask,
    Masks,
    Point,
    Points,
    RobotPath,
    RobotStatus,
    Route,
    Scene,
    Tick,
    Vector,
    VesselGraph,
)

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
