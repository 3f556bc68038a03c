"""Ground truth of the twin's pictures, from geometry without any pixels, and a follower of the true centerline.

Truth is measured in working pixels (longer side of the image = ``working_size_px``) by the same functions and the same 40-px rule
as perception, on the true lines: in a bend the local tangent at the tip would differ from the 40-px line by several degrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.config.models import PerceptionConfig
from core.perception.centerline import centerline_at, distances, go_back, incidence_of, joined
from core.perception.pose import measure_pose
from core.perception.vectors import fit_robot_vector, fit_vessel_vector
from core.types import Centerline, Command, GraphEdge, Point, Points, Pose, Reason, Route, Vector, VesselGraph
from hardware.twin.phantom import Phantom
from hardware.twin.view import CameraView, lumen_discs

_PATH_STEP_PX = 2.0
_CLIP_STEP_PX = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The true scene; points and distances in working px, missing parts None.

    The head is the end of the robot's line extended by the radius of its round cap, where the robot's mask ends and to which
    perception extends its head. The tail is the other visible end (at the image border or, within the picture, extended
    likewise). Exactly one of ``pose`` and ``reason`` is set.

    Attributes
    ----------
    robot_path : visible part that ends in the head, (N, 2), tail -> head, a point every 2 px; None: the head is out of the image.
    nearest : centerline point nearest to the head; ``lumen_radius_px`` is the lumen's radius there.
    offset_ratio : distance of the head to ``nearest`` over that radius (0 in the middle).
    ambiguity : 0..1, how nearly another branch fits as well.
    head_clearance_mm, body_clearance_mm : least distance between the robot's visible surface and the lumen's wall, at the end of
        the robot's line and anywhere within the lumen; negative: it overlaps the wall.
    head_visible : whether the head lies in the picture; otherwise there is no pose, though the body may be visible.
    scale : working px per source px.
    """

    scale: float
    reason: Reason | None = None
    head_visible: bool = False
    head_xy: Point | None = None
    tail_xy: Point | None = None
    robot_path: Points | None = None
    robot_vector: Vector | None = None
    vessel_vector: Vector | None = None
    pose: Pose | None = None
    nearest: Point | None = None
    lumen_radius_px: float | None = None
    offset_ratio: float | None = None
    ambiguity: float | None = None
    head_clearance_mm: float | None = None
    body_clearance_mm: float | None = None

    def to_source(self, point: Point) -> Point:
        """Working pixels -> source pixels (pixel centres at integers in both)."""
        return (point[0] + 0.5) / self.scale - 0.5, (point[1] + 0.5) / self.scale - 0.5

    def to_json(self) -> dict[str, Any]:
        """Plain types with the key names of ``perceive``; points in source px, distances in working px."""
        pose = self.pose
        path = [] if self.robot_path is None else [self._plain((x, y)) for x, y in self.robot_path.tolist()]
        return {
            "head_xy": self._plain(self.head_xy),
            "tail_xy": self._plain(self.tail_xy),
            "robot_path_xy": path,
            "robot_vector": self._plain_vector(self.robot_vector),
            "vessel_vector": self._plain_vector(self.vessel_vector),
            **{name: getattr(pose, name, None) for name in ("theta_deg", "theta_signed_deg", "d_head_px", "d_tail_px")},
            **{name: getattr(pose, name, None) for name in ("c_head_px", "c_tail_px", "crossed")},
            "state": pose.state.value if pose else None,
            "reason": self.reason.value if self.reason else None,
            "head_visible": self.head_visible,
            "nearest_xy": self._plain(self.nearest),
            **{name: getattr(self, name) for name in ("lumen_radius_px", "offset_ratio", "ambiguity")},
            **{name: getattr(self, name) for name in ("head_clearance_mm", "body_clearance_mm")},
        }

    def _plain(self, point: Point | None) -> list[float] | None:
        return None if point is None else [round(value, 3) for value in self.to_source(point)]

    def _plain_vector(self, vector: Vector | None) -> dict[str, list[float] | None] | None:
        if vector is None:
            return None
        return {"start": self._plain(vector.start), "center": self._plain(vector.center), "end": self._plain(vector.end)}


def true_graph(phantom: Phantom, view: CameraView, scale: float = 1.0) -> VesselGraph:
    """The phantom's centerlines in pixels of the view times `scale`, lumen radii likewise (by the local scale)."""
    edges = tuple(
        GraphEdge(edge.start, edge.end, _scaled(view.project(edge.points), scale), edge.radius * view.scales(edge.points) * scale)
        for edge in phantom.graph.edges
    )
    return VesselGraph(_scaled(view.project(phantom.graph.nodes), scale), edges)


def truth_of(
    phantom: Phantom,
    view: CameraView,
    robot_points_mm: Points | None,
    radius_mm: float,
    config: PerceptionConfig,
    route: Route | None = None,
) -> Truth:
    """The truth of a moment.

    Parameters
    ----------
    phantom, view : as given to the renderer.
    robot_points_mm : the robot's line (N, 2), tail -> head, on the board; None or one point: no robot.
    radius_mm : the robot's visible radius.
    config : the same settings as perception's; a robot is refused by the same limits on length and place.
    route : the operator's route in working px; it decides between branches.
    """
    scale = config.working_size_px / max(view.size)
    if robot_points_mm is None or len(robot_points_mm) < 2:
        return Truth(scale, Reason.NO_ROBOT)
    axis = np.asarray(robot_points_mm, np.float64)
    path = visible_path(with_caps(axis, radius_mm), view, scale)
    if path is None:
        return Truth(scale, Reason.NO_ROBOT)
    tail, head = _point(path[0]), _point(path[-1])
    depths = _depths_mm(axis, phantom.graph)
    body = depths[_beyond_port(axis, phantom)]
    robot_vector = fit_robot_vector(path, config.vectors.robot_length_px)
    graph = true_graph(phantom, view, scale)
    centerline: Centerline | None = None
    if robot_vector is not None:
        centerline = centerline_at(graph, head, robot_vector.direction, config.vectors.vessel_half_length_px, route)
    vessel_vector = None if centerline is None else fit_vessel_vector(centerline)
    reason = _refusal(path, view, phantom.graph, robot_vector, vessel_vector, config)
    pose = None
    if reason is None and robot_vector is not None and vessel_vector is not None:
        pose = measure_pose(robot_vector, vessel_vector, config.pose)
    return Truth(
        scale=scale,
        reason=reason,
        head_visible=True,
        head_xy=head,
        tail_xy=tail,
        robot_path=path,
        robot_vector=robot_vector,
        vessel_vector=vessel_vector,
        pose=pose,
        nearest=centerline.nearest if centerline else None,
        lumen_radius_px=float(centerline.radius_px) if centerline else None,
        offset_ratio=float(np.hypot(*np.subtract(head, centerline.nearest)) / centerline.radius_px) if centerline else None,
        ambiguity=float(centerline.ambiguity) if centerline else None,
        head_clearance_mm=float(depths[-1]) - radius_mm,
        body_clearance_mm=float(body.min()) - radius_mm if len(body) else None,
    )


def _refusal(
    path: Points, view: CameraView, graph: VesselGraph, robot: Vector | None, vessel: Vector | None, config: PerceptionConfig
) -> Reason | None:
    """Why perception would refuse at its own limits, even with perfect masks."""
    if robot is None or float(geometry.arc_length(path)[-1]) < config.quality.min_robot_length_px:
        return Reason.TOO_SHORT
    total = float(geometry.arc_length(path)[-1])
    last = geometry.resample(geometry.cut(path, total - config.vectors.robot_length_px, total), 1.0)
    scale = config.working_size_px / max(view.size)
    inside = _depths_mm(view.unproject((last + 0.5) / scale - 0.5), graph) > 0
    if float(np.mean(inside)) < config.quality.min_inside_vessel:
        return Reason.OUTSIDE_VESSEL
    return Reason.NO_VESSEL if vessel is None else None


def with_caps(axis: Points, radius_mm: float) -> Points:
    """The robot's line extended at both ends by the radius of its round caps, to the mask's edge."""
    keep = np.concatenate([[True], np.any(np.diff(axis, axis=0) != 0, axis=1)])
    axis = axis[keep]
    if len(axis) < 2:
        return axis
    first, last = axis[0] - axis[1], axis[-1] - axis[-2]
    start = axis[0] + radius_mm * first / np.linalg.norm(first)
    end = axis[-1] + radius_mm * last / np.linalg.norm(last)
    return np.vstack([start, axis, end])


def visible_path(line_mm: Points, view: CameraView, scale: float) -> Points | None:
    """The last stretch of the line within the picture, in working px; None when the head itself is not in the picture."""
    if len(line_mm) < 2:
        return None
    pixels = geometry.resample(_scaled(view.project(line_mm), scale), _CLIP_STEP_PX)
    limit = np.array(view.size) * scale - 0.5
    outside = np.flatnonzero(np.any((pixels < -0.5) | (pixels > limit), axis=1))
    visible = pixels[int(outside[-1]) + 1 :] if len(outside) else pixels
    return geometry.resample(visible, _PATH_STEP_PX) if len(visible) >= 2 else None


def _depths_mm(points_mm: Points, graph: VesselGraph) -> NDArray[np.float64]:
    """How deep points (N, 2) lie in the lumen (N,): distance to its wall, negative outside."""
    centers, radii = lumen_discs(graph)
    offset = points_mm[:, None, :] - centers[None, :, :]
    return np.asarray(np.max(radii - np.hypot(offset[..., 0], offset[..., 1]), axis=1))


def _beyond_port(points_mm: Points, phantom: Phantom) -> NDArray[np.bool_]:
    """Which points have passed the port: all after the last point behind its cross-section."""
    port = phantom.graph.nodes[phantom.port]
    edge = next(edge for edge in phantom.graph.edges if phantom.port in (edge.start, edge.end))
    line = edge.points if edge.start == phantom.port else edge.points[::-1]
    radius = edge.radius[0] if edge.start == phantom.port else edge.radius[-1]
    away = points_mm - port
    behind = (away @ (line[min(4, len(line) - 1)] - line[0]) <= 0) & (np.hypot(away[:, 0], away[:, 1]) < 3 * radius)
    passed = np.ones(len(points_mm), bool)
    if behind.any():
        passed[: int(np.flatnonzero(behind)[-1]) + 1] = False
    return passed


def _scaled(pixels: Points, scale: float) -> Points:
    return np.asarray((pixels + 0.5) * scale - 0.5)


def _point(values: Points) -> Point:
    return float(values[0]), float(values[1])


class RouteFollower:
    """Steers towards a point `lookahead_mm` ahead on the route to a target.

    ``wander`` (0..1) adds a slow random bend, seeded, so that all pose states and wall contacts occur in a data set.
    """

    def __init__(self, phantom: Phantom, target: int, *, lookahead_mm: float = 10.0, wander: float = 0.0, seed: int = 0) -> None:
        self.route = way_from_port(phantom, target)
        self._along = _arc_length(self.route)
        self._lookahead_mm = lookahead_mm
        self._wander = wander
        self._rng = np.random.default_rng(seed)
        self._drift = 0.0
        self._progress_mm = 0.0

    @property
    def length_mm(self) -> float:
        return float(self._along[-1])

    def command(self, robot_points_mm: Points, advance_mm_s: float, dt_s: float) -> Command:
        """The next command for the robot's current shape (N, 2), tail -> head, in board mm."""
        head = robot_points_mm[-1]
        near = (self._along > self._progress_mm - 15) & (self._along < self._progress_mm + 25)
        places = np.flatnonzero(near)
        nearest = places[np.argmin(np.sum((self.route[places] - head) ** 2, axis=1))]
        self._progress_mm = float(self._along[nearest])
        goal = self.point_at(self._progress_mm + self._lookahead_mm)
        ahead = heading(robot_points_mm)
        wanted = goal - head
        right = np.array([-ahead[1], ahead[0]])
        error = float(np.arctan2(wanted @ right, wanted @ ahead))
        # Ornstein-Uhlenbeck drift with a memory of 0.6 s.
        keep = float(np.exp(-dt_s / 0.6))
        self._drift = keep * self._drift + float(np.sqrt(1 - keep**2)) * float(self._rng.normal())
        bend = float(np.clip(1.6 * error + self._wander * self._drift, -1, 1))
        return Command(bend=bend, advance_mm_s=advance_mm_s)

    def point_at(self, along_mm: float) -> NDArray[np.float64]:
        before = int(np.searchsorted(self._along, along_mm, side="right")) - 1
        if before >= len(self.route) - 1:
            return np.asarray(self.route[-1])
        share = (along_mm - self._along[before]) / (self._along[before + 1] - self._along[before])
        return np.asarray(self.route[before] + share * (self.route[before + 1] - self.route[before]))


def way_from_port(phantom: Phantom, target: int) -> Points:
    """The shortest way (N, 2) along the phantom's true centerlines from its port to a node, mm; raises ValueError without one.

    It does not use perception's ``plan_route``, whose Numba loops take a second to load.
    """
    graph = phantom.graph
    lengths = [float(_arc_length(edge.points)[-1]) for edge in graph.edges]
    first, starts = incidence_of(graph)[phantom.port][0]
    reached, came_by = distances(graph, lengths, first, 0.0 if starts else lengths[first])
    if not np.isfinite(reached[target]):
        raise ValueError(f"phantom {phantom.name}: node {target} cannot be reached from the port")
    pieces = [graph.nodes[[target]]]
    if go_back(graph, came_by, target, pieces) != phantom.port:
        pieces.append(graph.edges[first].points if starts else graph.edges[first].points[::-1])
    return joined(pieces[::-1])


def _arc_length(points: Points) -> NDArray[np.float64]:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def heading(points: Points, over_mm: float = 3.0) -> NDArray[np.float64]:
    """Unit direction of the robot's head."""
    distance = np.linalg.norm(points - points[-1], axis=1)
    behind = points[np.flatnonzero(distance >= over_mm)[-1]] if np.any(distance >= over_mm) else points[0]
    step = points[-1] - behind
    return np.asarray(step / max(float(np.linalg.norm(step)), 1e-9))
