"""A scene as the contract's JSON object, in source pixel coordinates; distances stay in working pixels."""

from __future__ import annotations

from typing import Any

import numpy as np

from core.types import Point, Points, Reason, Refusal, Scene, Vector


def scene_to_json(name: str, scene: Scene) -> dict[str, Any]:
    """One object per image, as the command line's contract says."""
    pose, path = scene.pose, scene.path
    return {
        "image": name,
        "width": scene.source_size[0],
        "height": scene.source_size[1],
        "head_xy": _point(scene, path.head) if path else None,
        "tail_xy": _point(scene, path.tail) if path else None,
        "robot_path_xy": _points(scene, path.points) if path else None,
        "robot_vector": _vector(scene, scene.robot_vector),
        "vessel_vector": _vector(scene, scene.vessel_vector),
        "theta_deg": _round(pose.theta_deg) if pose else None,
        "theta_signed_deg": _round(pose.theta_signed_deg) if pose else None,
        "d_head_px": _round(pose.d_head_px) if pose else None,
        "d_tail_px": _round(pose.d_tail_px) if pose else None,
        "crossed": pose.crossed if pose else None,
        "state": pose.state.value if pose else None,
        "confidence": _round(pose.confidence) if pose else 0.0,
        "reason": str(scene.refusal) if scene.refusal else None,
        "latency_ms": {stage: round(ms, 3) for stage, ms in scene.latency_ms.items()},
    }


def unread_to_json(name: str, problem: str) -> dict[str, Any]:
    """The object of an image that could not be read."""
    blank = Scene(0, 0.0, (0, 0), 1.0, refusal=Refusal(Reason.UNREADABLE, problem))
    return scene_to_json(name, blank) | {"width": None, "height": None}


def _round(value: float) -> float:
    return round(float(value), 4)


def _point(scene: Scene, point: Point) -> list[float]:
    x, y = scene.to_source(point)
    return [round(x, 3), round(y, 3)]


def _points(scene: Scene, points: Points) -> list[list[float]]:
    return np.round(scene.points_to_source(points), 2).tolist()  # type: ignore[no-any-return]


def _vector(scene: Scene, vector: Vector | None) -> dict[str, list[float]] | None:
    if vector is None:
        return None
    return {name: _point(scene, getattr(vector, name)) for name in ("start", "center", "end")}
