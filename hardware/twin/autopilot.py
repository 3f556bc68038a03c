"""Drives the twin's robot along the true centerline, for data sets and demonstrations. It knows the truth; policies do not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.perception.route import distances, go_back, incidence_of, joined
from core.types import Command, Point, Points
from hardware.twin.phantom import Phantom


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

    @property
    def progress_mm(self) -> float:
        """Arc length of the route point beside the head."""
        return self._progress_mm

    def command(self, robot_points_mm: Points, advance_mm_s: float, dt_s: float) -> Command:
        """The next command for the robot's current shape (N, 2), tail -> head, in board mm."""
        head = robot_points_mm[-1]
        near = (self._along > self._progress_mm - 15) & (self._along < self._progress_mm + 25)
        places = np.flatnonzero(near)
        nearest = places[np.argmin(np.sum((self.route[places] - head) ** 2, axis=1))]
        self._progress_mm = float(self._along[nearest])
        goal = self._point_at(self._progress_mm + self._lookahead_mm)
        heading = _heading(robot_points_mm)
        wanted = goal - head
        right = np.array([-heading[1], heading[0]])
        error = float(np.arctan2(wanted @ right, wanted @ heading))
        # Ornstein-Uhlenbeck drift with a memory of 0.6 s.
        keep = float(np.exp(-dt_s / 0.6))
        self._drift = keep * self._drift + float(np.sqrt(1 - keep**2)) * float(self._rng.normal())
        bend = float(np.clip(1.6 * error + self._wander * self._drift, -1, 1))
        return Command(bend=bend, advance_mm_s=advance_mm_s)

    def _point_at(self, along_mm: float) -> NDArray[np.float64]:
        before = int(np.searchsorted(self._along, along_mm, side="right")) - 1
        if before >= len(self.route) - 1:
            return np.asarray(self.route[-1])
        share = (along_mm - self._along[before]) / (self._along[before + 1] - self._along[before])
        return np.asarray(self.route[before] + share * (self.route[before + 1] - self.route[before]))


def way_from_port(phantom: Phantom, target: int) -> Points:
    """The shortest way (N, 2) along the phantom's true centerlines from its port to a node, mm; raises ValueError without one.

    From node to node, and so without perception's loops (``plan_route``), for which a twin's process would wait a second.
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


def _heading(points: Points, over_mm: float = 3.0) -> np.ndarray:
    """Unit direction of the robot's head."""
    distance = np.linalg.norm(points - points[-1], axis=1)
    behind = points[np.flatnonzero(distance >= over_mm)[-1]] if np.any(distance >= over_mm) else points[0]
    step = points[-1] - behind
    return np.asarray(step / max(float(np.linalg.norm(step)), 1e-9))


def nearest_target(phantom: Phantom, point_mm: Point) -> int:
    """The target node nearest to a point on the board."""
    nodes = np.array(phantom.targets)
    distance = np.sum((phantom.graph.nodes[nodes] - np.asarray(point_mm)) ** 2, axis=1)
    return int(nodes[int(np.argmin(distance))])
