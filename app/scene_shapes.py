"""A scene as shapes in source pixels, which both the live view and the overlay pictures draw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.types import Point, Points, Scene, Vector

_MIN_STEP_PX = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class SceneShapes:
    """Shapes in source pixels (pixel centres at integers). What the scene does not have is None or empty.

    ``head_foot`` and ``tail_foot`` are the feet of the robot vector's end and start on the vessel line, so that the pieces
    robot_vector.end -> head_foot and robot_vector.start -> tail_foot are d_head and d_tail. ``angle_arc`` (N, 2) turns from the
    vessel's direction to the robot's around ``robot_vector.start``, with radius 1: painters scale it. ``ghost`` (N, 2) is where the
    head goes next, ``robot_width`` the robot's thickness.
    """

    vessel_lines: tuple[Points, ...]
    robot_line: Points | None
    bridges: tuple[tuple[Point, Point], ...]
    head: Point | None
    nearest: Point | None
    robot_vector: Vector | None
    vessel_vector: Vector | None
    head_foot: Point | None
    tail_foot: Point | None
    angle_arc: Points | None
    route: Points | None
    ghost: Points | None = None
    robot_width: float = 0.0


def scene_shapes(scene: Scene, ghost: Points | None = None) -> SceneShapes:
    """The shapes of `scene`, mapped to source pixels; polylines are thinned to steps of about 5 working pixels.

    `ghost` is the head's predicted path in working pixels.
    """
    robot, vessel = _vector(scene, scene.robot_vector), _vector(scene, scene.vessel_vector)
    both = robot is not None and vessel is not None and scene.pose is not None
    return SceneShapes(
        vessel_lines=tuple(_line(scene, edge.points) for edge in scene.vessel_graph.edges) if scene.vessel_graph else (),
        robot_line=_line(scene, scene.path.points) if scene.path else None,
        bridges=tuple((scene.to_source(a), scene.to_source(b)) for a, b in scene.skeletons.bridges) if scene.skeletons else (),
        head=scene.to_source(scene.path.head) if scene.path else None,
        nearest=scene.to_source(scene.centerline.nearest) if scene.centerline else None,
        robot_vector=robot,
        vessel_vector=vessel,
        head_foot=foot(vessel, robot.end) if both and robot and vessel else None,
        tail_foot=foot(vessel, robot.start) if both and robot and vessel else None,
        angle_arc=_arc(vessel, robot) if both and robot and vessel else None,
        route=_line(scene, scene.route.points) if scene.route else None,
        ghost=scene.points_to_source(ghost) if ghost is not None else None,
        robot_width=2.0 * scene.path.radius_px / scene.scale if scene.path else 0.0,
    )


def foot(line: Vector, point: Point) -> Point:
    """The point of the straight line through `line` that is nearest to `point` (METHOD section 5: point - c * normal)."""
    vx, vy = line.direction
    offset = vx * (point[1] - line.center[1]) - vy * (point[0] - line.center[0])
    return point[0] + offset * vy, point[1] - offset * vx


def _vector(scene: Scene, vector: Vector | None) -> Vector | None:
    if vector is None:
        return None
    return Vector(scene.to_source(vector.start), scene.to_source(vector.center), scene.to_source(vector.end))


def _line(scene: Scene, points: Points) -> Points:
    """Every n-th point in source pixels, ends kept: a pixel chain needs no point per pixel to look the same."""
    if len(points) > 2:
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        stride = max(1, int(_MIN_STEP_PX * (len(points) - 1) / max(length, 1e-9)))
        keep = np.unique(np.append(np.arange(0, len(points), stride), len(points) - 1))
        points = points[keep]
    return scene.points_to_source(points)


def _arc(vessel: Vector, robot: Vector) -> Points:
    start = np.arctan2(vessel.direction[1], vessel.direction[0])
    turn = np.arctan2(robot.direction[1], robot.direction[0]) - start
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    angles = start + np.linspace(0.0, turn, 24)
    return np.column_stack([np.cos(angles), np.sin(angles)])
