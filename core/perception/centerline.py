"""The piece of the vessel's centerline beside the robot's head, and the route along the vessel graph (METHOD section 5).

Lengths are in the graph's own unit: pixels in perception, and the same functions serve analytic graphs in any unit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.config import VectorConfig
from core.perception import polyline
from core.perception.feet import feet_of
from core.perception.lumen import foot, is_walled_off
from core.perception.route import incidence_of, plan_route
from core.perception.vessel_graph import build_graph
from core.types import Centerline, Mask, Point, Points, Route, VesselGraph

__all__ = ["build_graph", "centerline_at", "find", "plan_route", "window_at"]

MIN_PIECE_SHARE = 0.2
"""A piece shorter than this share of the wanted length (8 of 40 px) gives no direction."""
PLACE_WEIGHT = 0.5
SHORTNESS_WEIGHT = 0.5
ROUTE_WEIGHT = 1.0
WALL_WEIGHT = 4.0
LEAVES_ROUTE, SAME_ROUTE = 0.5, 0.1
"""Off the route by more than the first (0 to 1), a path leaves it; by up to the second more than another one, both keep to it."""
FORK_SHARE = 0.25
"""Of half the piece's length (5 of 20 px): so near to a fork a route passes it, even one that was found in an earlier frame."""
TIE_COST = 0.2
"""A path whose cost is this much above the best one's no longer counts as nearly as good."""
SAME_COST = 1e-9
TIE_ANGLE_DEG = 20.0
"""Two nearly as good paths that differ by this much make the answer fully ambiguous; by less, proportionally less so."""


@dataclass(frozen=True, slots=True, eq=False)
class _Ahead:
    """What of the operator's route lies ahead of the head; ``goes_back``: to a fork first that the robot has passed.

    Then the robot is beside the route, however that goes on, and travels the way that it points.
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
    """The paper's way: all vessel-skeleton pixels within `half_length_px` of the one nearest to the head, whatever branch they are
    of.

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

    Near a junction the nearest edge may be a side branch that the robot merely passes. So every path that leads past the head
    within reach is a candidate, and the one is taken that the robot's straight line fits best, in direction and in place. Where
    the operator's route passes, only those that keep to it are asked, whichever branch the robot points into. The cost changes
    smoothly with head and direction, so that a small disturbance changes the choice only where two branches fit equally well;
    `ambiguity` says how near that is.

    Parameters
    ----------
    graph : vessel centerlines.
    head : the robot's head.
    robot_direction : unit vector of the robot's last 40 px, pointing to the head.
    half_length_px : arc length of the piece to each side of the nearest point; cut short where the vessel ends.
    route : the operator's route; it decides between branches where it passes the head.
    vessel : its mask (h, w), if there is one: what lies beyond a wall from the head is not beside it, however near.

    Returns
    -------
    The piece, or None when the graph is empty or ends too soon (less than ``MIN_PIECE_SHARE`` of the wanted length).
    """
    feet = feet_of(graph, head, half_length_px, vessel)
    incidence = incidence_of(graph)
    # One scale for all candidates: a narrow branch must not count the same distance for more than its wide trunk does.
    scale = max((near.radius for near in feet), default=1.0)
    direction = np.asarray(robot_direction, np.float64)
    meeting = [touching[0] for touching in incidence if len(touching) > 2] if route is not None else []
    forks = [graph.edges[index].points[0 if starts else -1] for index, starts in meeting]
    ahead = _route_ahead(route, head, direction, half_length_px, scale, vessel, forks)
    candidates = []
    for near in feet:
        backward = _walks(graph, incidence, near.edge, near.position, False, 2.0 * half_length_px)
        forward = _walks(graph, incidence, near.edge, near.position, True, 2.0 * half_length_px)
        for back, used_behind in backward:
            for onward, used_ahead in forward:
                if used_behind & used_ahead:
                    continue
                line = np.concatenate([back[:0:-1], onward])
                along = polyline.arc_length(line)
                place = polyline.nearest(line, head, along)
                if vessel is not None and place[0] < near.distance - SAME_COST and is_walled_off(head, place[2], vessel):
                    place = near.distance, float(along[len(back) - 1]), (float(onward[0, 0]), float(onward[0, 1]))
                candidate = _candidate(line, along, place, near.radius, scale, head, direction, half_length_px, ahead, forks)
                if candidate is not None:
                    candidates.append(candidate)
    if not candidates:
        return None
    if ahead is not None and not _is_turned(ahead.points, direction):
        candidates = _on_route(candidates)
    # The same line is found from each edge it runs along: rounding alone must not decide which one's radius counts.
    least = min(candidate.cost for candidate in candidates)
    best = next(candidate for candidate in candidates if candidate.cost <= least + SAME_COST)
    ambiguity = max(_rivalry(best, other) for other in candidates)
    return Centerline(best.piece, best.nearest, best.radius, ambiguity)


def _walks(
    graph: VesselGraph, incidence: list[list[tuple[int, bool]]], edge: int, position: float, onward: bool, reach: float
) -> list[tuple[Points, frozenset[int]]]:
    """All ways to walk `reach` along the graph from a place on an edge: polylines from that place, and the other edges they use.

    An edge that is a loop is come back to by its other end, and then is one of them; unless it is so short that the ways to both
    sides would meet on it.
    """
    first = graph.edges[edge]
    along = polyline.arc_length(first.points)
    total = float(along[-1])
    if onward:
        line, node = polyline.cut(first.points, position, min(position + reach, total), along), first.end
    else:
        line, node = polyline.cut(first.points, max(position - reach, 0.0), position, along)[::-1], first.start
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
            along = polyline.arc_length(points)
            joined = np.concatenate([line, polyline.cut(points, 0.0, left, along)])
            pending.append((joined, following.end if starts else following.start, left - float(along[-1]), used | {index}))
    return walks


def _route_ahead(
    route: Route | None,
    head: Point,
    direction: NDArray[np.float64],
    half_length: float,
    radius: float,
    vessel: Mask | None,
    forks: list[Points],
) -> _Ahead | None:
    """The part of the route that lies ahead of the head, or None where the route does not pass by."""
    if route is None or len(route.points) < 2:
        return None
    place = foot(route.points, head, vessel)
    if place is None:
        return None
    distance, position, _ = place
    ahead = polyline.cut(route.points, position, position + 2.0 * half_length)
    near = distance <= max(1.5 * radius, 0.5 * half_length)
    if not near or float(polyline.arc_length(ahead)[-1]) <= MIN_PIECE_SHARE * half_length:
        return None
    return _Ahead(ahead, _goes_back(ahead, direction, half_length, forks))


def _candidate(
    line: Points,
    along: NDArray[np.float64],
    place: tuple[float, float, Point],
    radius: float,
    scale: float,
    head: Point,
    direction: NDArray[np.float64],
    half_length: float,
    ahead: _Ahead | None,
    forks: list[Points],
) -> _Candidate | None:
    distance, position, nearest = place
    piece = polyline.cut(line, position - half_length, position + half_length, along)
    before, after = min(position, half_length), min(float(along[-1]) - position, half_length)
    length = before + after
    if length < MIN_PIECE_SHARE * 2.0 * half_length:
        return None
    travel = float((piece[-1] - piece[0]) @ direction)
    if ahead is not None and not ahead.goes_back and not _is_turned(ahead.points, direction):
        # On the route its direction is the direction of travel, even if the head is bent to a bit beyond a right angle.
        travel = float((piece[-1] - piece[0]) @ (ahead.points[-1] - ahead.points[0]))
    if travel < 0.0:
        piece, before, after = piece[::-1], after, before
    chord = piece[-1] - piece[0]
    turn_cost = 1.0 - float(chord @ direction) / length
    places = np.array([piece[0], nearest, piece[-1]])
    robot_line = np.asarray(head) + np.outer([-before, 0.0, after], direction)
    place_cost = float(np.mean(np.sum((places - robot_line) ** 2, axis=1))) / scale**2
    cost = turn_cost + PLACE_WEIGHT * place_cost + SHORTNESS_WEIGHT * (1.0 - length / (2.0 * half_length))
    # A path whose lumen the head is outside of is another vessel, however well it would fit.
    cost += WALL_WEIGHT * max(0.0, distance / radius - 1.0)
    off_route = 0.0
    if ahead is not None:
        forward = polyline.cut(piece, before, length)
        backs_out = _goes_back(forward, direction, half_length, forks)
        off_route = 1.0 if backs_out else _off_route(forward, ahead.points, scale)
    return _Candidate(piece, nearest, radius, cost + ROUTE_WEIGHT * off_route, off_route, distance <= radius)


def _goes_back(way: Points, direction: NDArray[np.float64], half_length: float, forks: list[Points]) -> bool:
    """Whether a way from the head leads to a fork that lies behind the robot, as to the other branch of one that it has passed."""
    along = polyline.arc_length(way)
    met = (polyline.nearest(way, (float(x), float(y)), along) for x, y in forks)
    first = min((position for distance, position, _ in met if distance <= FORK_SHARE * half_length), default=0.0)
    # All of the way there is behind: one round a bend of the robot's own vessel is not.
    return first > 0.0 and all(
        float((polyline.cut(way, 0.0, share * first, along)[-1] - way[0]) @ direction) < 0.0 for share in (0.5, 1.0)
    )


def _is_turned(ahead: Points, direction: NDArray[np.float64]) -> bool:
    """Whether the robot points the other way than the route leads, and so is somewhere else."""
    way = ahead[-1] - ahead[0]
    return float(way @ direction) <= -0.5 * float(np.hypot(way[0], way[1]))


def _on_route(candidates: list[_Candidate]) -> list[_Candidate]:
    """Those that keep to the route as well as any; all where none does, or the head is in none of their lumens."""
    beside = [candidate for candidate in candidates if candidate.is_beside]
    least = min((candidate.off_route for candidate in beside), default=1.0)
    if least > LEAVES_ROUTE:
        return candidates
    return [candidate for candidate in beside if candidate.off_route <= least + SAME_ROUTE]


def _off_route(forward: Points, ahead: Points, radius: float) -> float:
    """How far the forward half of a piece leaves the route, 0 (on it) to 1 (more than half a lumen radius off)."""
    if len(forward) < 2:
        return 0.0
    probes = polyline.resample(forward, float(polyline.arc_length(forward)[-1]) / 4.0)
    gaps = [polyline.nearest(ahead, (float(x), float(y)))[0] for x, y in probes]
    return float(np.mean(np.minimum(1.0, (np.array(gaps) / (0.5 * radius)) ** 2)))


def _rivalry(best: _Candidate, other: _Candidate) -> float:
    """How much another candidate puts the best one in doubt: it must fit nearly as well and point elsewhere."""
    closeness = max(0.0, 1.0 - (other.cost - best.cost) / TIE_COST)
    angle_deg = float(np.degrees(np.arccos(np.clip(best.direction @ other.direction, -1.0, 1.0))))
    return closeness * min(1.0, angle_deg / TIE_ANGLE_DEG)
