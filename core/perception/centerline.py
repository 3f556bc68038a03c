"""The piece of the vessel's centerline beside the robot's head, and the route along the vessel graph (METHOD section 5).

Lengths are in the graph's own unit: pixels in perception; the same functions serve analytic graphs in any unit.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.config.models import VectorConfig
from core.messages import message
from core.perception.vectors import is_walled_off, project
from core.types import Centerline, Mask, Point, Points, Route, VesselGraph

REACH_RADII = 1.5
"""Vessels further from the head than this many of their radii are ignored."""


@dataclass(frozen=True, slots=True)
class EdgeProjection:
    """The head's projection on an edge within its lumen: its distance, its arc-length position, the radius there."""

    distance: float
    edge: int
    position: float
    radius: float


def project_on_edges(graph: VesselGraph, head: Point, half_length: float, vessel: Mask | None) -> list[EdgeProjection]:
    """The edges that the head may belong to, in the graph's order and unit; edges beyond a wall are left out, unless all are.

    `half_length` of the piece of centerline is wanted; a radius below a quarter of it counts as that. Walls are those of the
    mask `vessel` (h, w), in px; None: they are ignored.
    """
    plain = []
    for index, edge in enumerate(graph.edges):
        if len(edge.points) >= 2:
            along = geometry.arc_length(edge.points)
            distance, position, place = geometry.nearest(edge.points, head, along)
            radius = float(np.interp(position, along, edge.radius))
            plain.append((EdgeProjection(distance, index, position, max(radius, 0.25 * half_length)), place, distance <= radius))
    plain.sort(key=lambda one: (one[0].distance, one[0].edge))
    found: list[EdgeProjection] = []
    for near, place, is_inside in plain:
        if found and not _is_in_reach(near, found):
            continue
        if vessel is None or is_inside or not is_walled_off(head, place, vessel):
            found.append(near)
        elif (within := project(graph.edges[near.edge].points, head, vessel)) is not None:
            edge = graph.edges[near.edge]
            radius = float(np.interp(within[1], geometry.arc_length(edge.points), edge.radius))
            found.append(EdgeProjection(within[0], near.edge, within[1], max(radius, 0.25 * half_length)))
    found = found or [near for near, *_ in plain]
    return sorted((one for one in found if _is_in_reach(one, found)), key=lambda one: one.edge)


def _is_in_reach(one: EdgeProjection, found: list[EdgeProjection]) -> bool:
    first = min(found, key=lambda near: (near.distance, near.edge))
    return one.distance <= max(first.distance + 0.25 * first.radius, REACH_RADII * one.radius)


OFF_VESSEL_PX = 15.0
"""A click this far beside the lumen still counts as on the vessel."""


def route_or_reason(graph: VesselGraph, start: Point, target: Point, vessel: Mask | None = None) -> Route | str:
    """The route, or the reason for none: the target is beside the vessel, or no vessel that was found leads there."""
    there = _lumen(graph, target)
    if there is None:
        return "no vessel was found"
    beside_px, *_ = there
    if beside_px > OFF_VESSEL_PX:
        return message("the target is {a:.0f} px beside the vessel", a=beside_px)
    return plan_route(graph, start, target, vessel) or "no vessel that was found leads there"


def plan_route(graph: VesselGraph, start: Point, target: Point, vessel: Mask | None = None) -> Route | None:
    """The shortest route along the graph from the place beside `start` to the one in the vessel that `target` lies in.

    With the vessel's mask (h, w), in pixels, no wall lies between `start` and the place beside it. None when the graph is empty or
    does not connect the two places.
    """
    here, there = _place(graph, start, vessel), _lumen(graph, target)
    if here is None or there is None:
        return None
    (edge, position), (_, last_edge, last_position) = here, there
    lengths = [float(geometry.arc_length(e.points)[-1]) for e in graph.edges]
    reached, came_by = distances(graph, lengths, edge, position)
    last = graph.edges[last_edge]
    options: list[tuple[float, int | None]] = [
        (reached[last.start] + last_position, last.start),
        (reached[last.end] + lengths[last_edge] - last_position, last.end),
    ]
    if edge == last_edge:
        options.append((abs(last_position - position), None))
    length, node = min(options, key=lambda option: option[0])
    if not np.isfinite(length):
        return None
    if node is None:
        low, high = sorted((position, last_position))
        points = geometry.cut(last.points, low, high)
        return Route(points if position <= last_position else points[::-1], length, target)
    by_start = node == last.start and reached[last.start] + last_position == length
    pieces = [geometry.cut(last.points, 0.0, last_position) if by_start else geometry.cut(last.points, last_position, np.inf)[::-1]]
    node = go_back(graph, came_by, node, pieces)
    first = graph.edges[edge]
    leaves_by_end = node == first.end and (node != first.start or 2.0 * position > lengths[edge])
    pieces.append(geometry.cut(first.points, position, np.inf) if leaves_by_end else geometry.cut(first.points, 0, position)[::-1])
    return Route(joined(pieces[::-1]), length, target)


def _place(graph: VesselGraph, point: Point, vessel: Mask | None) -> tuple[int, float] | None:
    """The edge nearest to a point and the arc-length position on it; beyond a wall only where there is no other."""
    lines = [(index, edge.points) for index, edge in enumerate(graph.edges) if len(edge.points) > 1]
    nearest = [(*geometry.nearest(points, point), index) for index, points in lines]
    if not nearest:
        return None
    _, position, place, index = min(nearest, key=lambda found: (found[0], found[1]))
    if vessel is not None and is_walled_off(point, place, vessel):
        projections = [(found[0], found[1], i) for i, points in lines if (found := project(points, point, vessel)) is not None]
        if projections:
            _, position, index = min(projections)
    return index, position


def _lumen(graph: VesselGraph, point: Point) -> tuple[float, int, float] | None:
    """The vessel that a point lies in, or nearest to: distance outside its lumen (negative: inside), its edge, the position on it.

    Measured from the walls: inside a wide vessel the centerline of a narrow one may be nearer.
    """
    found = []
    for index, edge in enumerate(graph.edges):
        if len(edge.points) > 1:
            along = geometry.arc_length(edge.points)
            distance, position, _ = geometry.nearest(edge.points, point, along)
            found.append((distance - float(np.interp(position, along, edge.radius)), distance, index, position))
    if not found:
        return None
    outside, _, index, position = min(found)
    return outside, index, position


def distances(graph: VesselGraph, lengths: list[float], edge: int, position: float) -> tuple[list[float], list[int | None]]:
    """Dijkstra from a place on an edge: each node's distance, and the edge it is reached by (None: directly from the place)."""
    reached = [np.inf] * len(graph.nodes)
    came_by: list[int | None] = [None] * len(graph.nodes)
    incidence = incidence_of(graph)
    first = graph.edges[edge]
    queue: list[tuple[float, int, int]] = [(position, first.start, -1), (lengths[edge] - position, first.end, -1)]
    heapq.heapify(queue)
    while queue:
        distance, node, via = heapq.heappop(queue)
        if distance >= reached[node]:
            continue
        reached[node], came_by[node] = distance, via if via >= 0 else None
        for index, starts in incidence[node]:
            following = graph.edges[index].end if starts else graph.edges[index].start
            if distance + lengths[index] < reached[following]:
                heapq.heappush(queue, (distance + lengths[index], following, index))
    return reached, came_by


def go_back(graph: VesselGraph, came_by: list[int | None], node: int, pieces: list[Points]) -> int:
    """Add to `pieces` the edges by which a node was reached, the last one first, each in the direction of travel; returns the node
    that was reached directly from the place."""
    while (via := came_by[node]) is not None:
        edge = graph.edges[via]
        pieces.append(edge.points if edge.end == node else edge.points[::-1])
        node = edge.start if edge.end == node else edge.end
    return node


def joined(pieces: list[Points]) -> Points:
    """Consecutive lines as one (N, 2), without repeated points."""
    points = np.concatenate(pieces)
    return np.asarray(points[np.concatenate([[True], np.any(np.diff(points, axis=0) != 0.0, axis=1)])])


def incidence_of(graph: VesselGraph) -> list[list[tuple[int, bool]]]:
    """For each node the edges that touch it, as (edge, whether the edge starts here)."""
    touching: list[list[tuple[int, bool]]] = [[] for _ in range(len(graph.nodes))]
    for index, edge in enumerate(graph.edges):
        touching[edge.start].append((index, True))
        touching[edge.end].append((index, False))
    return touching


MIN_PIECE_SHARE = 0.2
"""A piece shorter than this share of the wanted length (8 of 40 px) gives no direction."""
PLACE_WEIGHT = 0.5
SHORTNESS_WEIGHT = 0.5
ROUTE_WEIGHT = 1.0
WALL_WEIGHT = 4.0
LEAVES_ROUTE, SAME_ROUTE = 0.5, 0.1
"""Off the route by more than the first (0 to 1), a path leaves it; within the second of another one, both follow it."""
FORK_SHARE = 0.25
"""Of half the piece's length (5 of 20 px): this near to a fork a route passes it, even one that was found in an earlier frame."""
TIE_COST = 0.2
"""A path whose cost is this much above the best one's is no rival."""
SAME_COST = 1e-9
TIE_ANGLE_DEG = 20.0
"""Rivals that differ by this much make the answer fully ambiguous; by less, proportionally less."""


@dataclass(frozen=True, slots=True, eq=False)
class _LookAhead:
    """The part of the operator's route ahead of the head; ``goes_back``: it leads to a fork first that the robot has passed.

    Then the robot is beside the route and travels in its own direction.
    """

    points: Points
    goes_back: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """One path of the graph past the head, cut to the wanted length and oriented; lower cost fits better.

    ``off_route`` is 0 where its forward half is on the route, 1 where it leaves it; ``is_beside``: the head is inside its lumen.
    """

    piece: Points
    nearest: Point
    radius: float
    cost: float
    off_route: float = 0.0
    is_beside: bool = True

    @property
    def direction(self) -> Points:
        chord = self.piece[-1] - self.piece[0]
        return np.asarray(chord / max(float(np.hypot(chord[0], chord[1])), 1e-9))


def find(
    graph: VesselGraph,
    skeleton: Mask,
    head: Point,
    robot_direction: Point,
    config: VectorConfig,
    route: Route | None = None,
    vessel: Mask | None = None,
) -> Centerline | None:
    """The piece beside the head by the configured rule: along one path of the graph, or the paper's window of skeleton pixels."""
    if config.vessel_rule == "window":
        return window_at(skeleton, head, robot_direction, config.vessel_half_length_px)
    return centerline_at(graph, head, robot_direction, config.vessel_half_length_px, route, vessel)


def window_at(skeleton: Mask, head: Point, robot_direction: Point, half_length_px: float) -> Centerline | None:
    """The paper's rule: all vessel-skeleton pixels within `half_length_px` of the one nearest to the head, of whatever branch.

    The pixels have no order, so the piece is the straight line through them; the radius is not known (0). None where they are fewer
    than ``MIN_PIECE_SHARE`` of the wanted length.
    """
    rows, columns = np.nonzero(skeleton)
    pixels = np.column_stack([columns, rows]).astype(np.float64)
    if len(pixels) == 0:
        return None
    nearest = pixels[np.argmin(np.hypot(*(pixels - head).T))]
    window = pixels[np.hypot(*(pixels - nearest).T) <= half_length_px]
    if len(window) < MIN_PIECE_SHARE * 2.0 * half_length_px:
        return None
    mean = window.mean(axis=0)
    axis = np.linalg.svd(window - mean, full_matrices=False)[2][0]
    axis = axis if float(axis @ np.asarray(robot_direction)) >= 0.0 else -axis
    along = (window - mean) @ axis
    piece = mean + np.outer([along.min(), along.max()], axis)
    return Centerline(piece, (float(nearest[0]), float(nearest[1])), 0.0)


def centerline_at(
    graph: VesselGraph,
    head: Point,
    robot_direction: Point,
    half_length_px: float,
    route: Route | None = None,
    vessel: Mask | None = None,
) -> Centerline | None:
    """The piece of centerline beside the head, along one path of the vessel graph, in the robot's direction of travel.

    Near a junction the nearest edge may be a side branch that the robot merely passes. So every path past the head within reach is
    a candidate, and the one is taken that the robot's straight line fits best, in direction and in place. Where the operator's
    route passes, only those that follow it are candidates. The cost changes smoothly with head and direction, so that a small
    disturbance changes the choice only where two branches fit equally well; ``ambiguity`` measures how near that is.

    Returns the piece, or None when the graph is empty or ends too soon (less than ``MIN_PIECE_SHARE`` of the wanted length).

    Parameters
    ----------
    graph : vessel centerlines.
    head : the robot's head.
    robot_direction : unit vector of the robot's last 40 px, pointing to the head.
    half_length_px : arc length of the piece to each side of the nearest point; cut short where the vessel ends.
    route : the operator's route; it decides between branches where it passes the head.
    vessel : its mask (h, w), if known: edges beyond a wall from the head are not beside it.
    """
    projections = project_on_edges(graph, head, half_length_px, vessel)
    incidence = incidence_of(graph)
    # One scale for all candidates: the same distance counts equally in a narrow branch and in its wide trunk.
    scale = max((near.radius for near in projections), default=1.0)
    direction = np.asarray(robot_direction, np.float64)
    meeting = [touching[0] for touching in incidence if len(touching) > 2] if route is not None else []
    forks = [graph.edges[index].points[0 if starts else -1] for index, starts in meeting]
    ahead = _route_ahead(route, head, direction, half_length_px, scale, vessel, forks)
    candidates = []
    for near in projections:
        backward = _walks(graph, incidence, near.edge, near.position, False, 2.0 * half_length_px)
        forward = _walks(graph, incidence, near.edge, near.position, True, 2.0 * half_length_px)
        for back, used_behind in backward:
            for onward, used_ahead in forward:
                if used_behind & used_ahead:
                    continue
                line = np.concatenate([back[:0:-1], onward])
                along = geometry.arc_length(line)
                place = geometry.nearest(line, head, along)
                if vessel is not None and place[0] < near.distance - SAME_COST and is_walled_off(head, place[2], vessel):
                    place = near.distance, float(along[len(back) - 1]), (float(onward[0, 0]), float(onward[0, 1]))
                candidate = _candidate(line, along, place, near.radius, scale, head, direction, half_length_px, ahead, forks)
                if candidate is not None:
                    candidates.append(candidate)
    if not candidates:
        return None
    if ahead is not None and not _is_turned(ahead.points, direction):
        candidates = _on_route(candidates)
    # The same line is found from each edge it runs along: rounding must not decide which radius counts.
    least = min(candidate.cost for candidate in candidates)
    best = next(candidate for candidate in candidates if candidate.cost <= least + SAME_COST)
    ambiguity = max(_rivalry(best, other) for other in candidates)
    return Centerline(best.piece, best.nearest, best.radius, ambiguity)


def _walks(
    graph: VesselGraph, incidence: list[list[tuple[int, bool]]], edge: int, position: float, onward: bool, reach: float
) -> list[tuple[Points, frozenset[int]]]:
    """All walks of length `reach` along the graph from a place on an edge: polylines from that place, and the other edges they use.

    A walk may return to an edge that is a loop by its other end, unless it is so short that the walks to both sides would meet.
    """
    first = graph.edges[edge]
    along = geometry.arc_length(first.points)
    total = float(along[-1])
    if onward:
        line, node = geometry.cut(first.points, position, min(position + reach, total), along), first.end
    else:
        line, node = geometry.cut(first.points, max(position - reach, 0.0), position, along)[::-1], first.start
    comes_back = total >= 2.0 * reach
    walks = []
    left = reach - (total - position if onward else position)
    pending: list[tuple[Points, int, float, frozenset[int]]] = [(line, node, left, frozenset())]
    while pending:
        line, node, left, used = pending.pop()
        open_ends = [(i, starts) for i, starts in incidence[node] if i not in used] if left > 0 else []
        options = [(i, starts) for i, starts in open_ends if i != edge or (comes_back and starts == onward)]
        if not options:
            walks.append((line, used))
        for index, starts in options:
            following = graph.edges[index]
            points = following.points if starts else following.points[::-1]
            along = geometry.arc_length(points)
            longer = np.concatenate([line, geometry.cut(points, 0.0, left, along)])
            pending.append((longer, following.end if starts else following.start, left - float(along[-1]), used | {index}))
    return walks


def _route_ahead(
    route: Route | None,
    head: Point,
    direction: NDArray[np.float64],
    half_length: float,
    radius: float,
    vessel: Mask | None,
    forks: list[Points],
) -> _LookAhead | None:
    """The part of the route that lies ahead of the head, or None where the route does not pass by."""
    if route is None or len(route.points) < 2:
        return None
    place = project(route.points, head, vessel)
    if place is None:
        return None
    distance, position, _ = place
    ahead = geometry.cut(route.points, position, position + 2.0 * half_length)
    near = distance <= max(1.5 * radius, 0.5 * half_length)
    if not near or float(geometry.arc_length(ahead)[-1]) <= MIN_PIECE_SHARE * half_length:
        return None
    return _LookAhead(ahead, _goes_back(ahead, direction, half_length, forks))


def _candidate(
    line: Points,
    along: NDArray[np.float64],
    place: tuple[float, float, Point],
    radius: float,
    scale: float,
    head: Point,
    direction: NDArray[np.float64],
    half_length: float,
    ahead: _LookAhead | None,
    forks: list[Points],
) -> _Candidate | None:
    distance, position, nearest = place
    piece = geometry.cut(line, position - half_length, position + half_length, along)
    before, after = min(position, half_length), min(float(along[-1]) - position, half_length)
    length = before + after
    if length < MIN_PIECE_SHARE * 2.0 * half_length:
        return None
    travel = float((piece[-1] - piece[0]) @ direction)
    if ahead is not None and not ahead.goes_back and not _is_turned(ahead.points, direction):
        # On the route its direction is the direction of travel, even if the head is bent a bit beyond a right angle.
        travel = float((piece[-1] - piece[0]) @ (ahead.points[-1] - ahead.points[0]))
    if travel < 0.0:
        piece, before, after = piece[::-1], after, before
    chord = piece[-1] - piece[0]
    turn_cost = 1.0 - float(chord @ direction) / length
    places = np.array([piece[0], nearest, piece[-1]])
    robot_line = np.asarray(head) + np.outer([-before, 0.0, after], direction)
    place_cost = float(np.mean(np.sum((places - robot_line) ** 2, axis=1))) / scale**2
    cost = turn_cost + PLACE_WEIGHT * place_cost + SHORTNESS_WEIGHT * (1.0 - length / (2.0 * half_length))
    # If the head is outside a path's lumen, the path is another vessel.
    cost += WALL_WEIGHT * max(0.0, distance / radius - 1.0)
    off_route = 0.0
    if ahead is not None:
        forward = geometry.cut(piece, before, length)
        backs_out = _goes_back(forward, direction, half_length, forks)
        off_route = 1.0 if backs_out else _off_route(forward, ahead.points, scale)
    return _Candidate(piece, nearest, radius, cost + ROUTE_WEIGHT * off_route, off_route, distance <= radius)


def _goes_back(path: Points, direction: NDArray[np.float64], half_length: float, forks: list[Points]) -> bool:
    """Whether a path from the head leads to a fork behind the robot, as to the other branch of one that it has passed."""
    along = geometry.arc_length(path)
    met = (geometry.nearest(path, (float(x), float(y)), along) for x, y in forks)
    first = min((position for distance, position, _ in met if distance <= FORK_SHARE * half_length), default=0.0)
    # All of it is behind the robot; a bend of the robot's own vessel is not.
    return first > 0.0 and all(
        float((geometry.cut(path, 0.0, share * first, along)[-1] - path[0]) @ direction) < 0.0 for share in (0.5, 1.0)
    )


def _is_turned(ahead: Points, direction: NDArray[np.float64]) -> bool:
    """Whether the robot points against the route, and so is somewhere else."""
    chord = ahead[-1] - ahead[0]
    return float(chord @ direction) <= -0.5 * float(np.hypot(chord[0], chord[1]))


def _on_route(candidates: list[_Candidate]) -> list[_Candidate]:
    """Those that follow the route best; all where none does, or the head is in none of their lumens."""
    beside = [candidate for candidate in candidates if candidate.is_beside]
    least = min((candidate.off_route for candidate in beside), default=1.0)
    if least > LEAVES_ROUTE:
        return candidates
    return [candidate for candidate in beside if candidate.off_route <= least + SAME_ROUTE]


def _off_route(forward: Points, ahead: Points, radius: float) -> float:
    """Mean deviation of a piece's forward half from the route, 0 (on it) to 1 (more than half a lumen radius off)."""
    if len(forward) < 2:
        return 0.0
    probes = geometry.resample(forward, float(geometry.arc_length(forward)[-1]) / 4.0)
    gaps = [geometry.nearest(ahead, (float(x), float(y)))[0] for x, y in probes]
    return float(np.mean(np.minimum(1.0, (np.array(gaps) / (0.5 * radius)) ** 2)))


def _rivalry(best: _Candidate, other: _Candidate) -> float:
    """Ambiguity through another candidate: it must fit nearly as well and point elsewhere."""
    closeness = max(0.0, 1.0 - (other.cost - best.cost) / TIE_COST)
    angle_deg = float(np.degrees(np.arccos(np.clip(best.direction @ other.direction, -1.0, 1.0))))
    return closeness * min(1.0, angle_deg / TIE_ANGLE_DEG)
