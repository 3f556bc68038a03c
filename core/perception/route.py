"""The operator's route: the shortest way along the vessel graph to a destination. Lengths are in the graph's own unit."""

from __future__ import annotations

import heapq

import numpy as np

from core.perception import polyline
from core.perception.lumen import foot, is_walled_off
from core.types import Mask, Point, Points, Route, VesselGraph

OFF_VESSEL_PX = 15.0
"""A click so far beside the lumen is still taken for one on the vessel."""


def route_or_reason(graph: VesselGraph, start: Point, target: Point, vessel: Mask | None = None) -> Route | str:
    """The route, or in plain words why there is none: the target is beside the vessel, or no vessel that was found leads there."""
    there = _lumen(graph, target)
    if there is None:
        return "no vessel was found"
    beside_px, *_ = there
    if beside_px > OFF_VESSEL_PX:
        return f"the target is {beside_px:.0f} px beside the vessel"
    return plan_route(graph, start, target, vessel) or "no vessel that was found leads there"


def plan_route(graph: VesselGraph, start: Point, target: Point, vessel: Mask | None = None) -> Route | None:
    """The shortest way along the graph from the place beside `start` to the one beside `target`, in the vessel that this lies in.

    With the vessel's mask (h, w), in pixels, no wall lies between `start` and the place beside it.

    Returns
    -------
    The route, or None when the graph is empty or has no way between the two places.
    """
    here, there = _place(graph, start, vessel), _lumen(graph, target)
    if here is None or there is None:
        return None
    (edge, position), (_, last_edge, last_position) = here, there
    lengths = [float(polyline.arc_length(e.points)[-1]) for e in graph.edges]
    reached, came_by = distances(graph, lengths, edge, position)
    last = graph.edges[last_edge]
    ways: list[tuple[float, int | None]] = [
        (reached[last.start] + last_position, last.start),
        (reached[last.end] + lengths[last_edge] - last_position, last.end),
    ]
    if edge == last_edge:
        ways.append((abs(last_position - position), None))
    length, node = min(ways, key=lambda way: way[0])
    if not np.isfinite(length):
        return None
    if node is None:
        low, high = sorted((position, last_position))
        points = polyline.cut(last.points, low, high)
        return Route(points if position <= last_position else points[::-1], length, target)
    by_start = node == last.start and reached[last.start] + last_position == length
    pieces = [polyline.cut(last.points, 0.0, last_position) if by_start else polyline.cut(last.points, last_position, np.inf)[::-1]]
    node = go_back(graph, came_by, node, pieces)
    first = graph.edges[edge]
    leaves_by_end = node == first.end and (node != first.start or 2.0 * position > lengths[edge])
    pieces.append(polyline.cut(first.points, position, np.inf) if leaves_by_end else polyline.cut(first.points, 0, position)[::-1])
    return Route(joined(pieces[::-1]), length, target)


def _place(graph: VesselGraph, point: Point, vessel: Mask | None) -> tuple[int, float] | None:
    """The edge nearest to a point and the arc-length position on it; beyond a wall only where nothing lies before it."""
    lines = [(index, edge.points) for index, edge in enumerate(graph.edges) if len(edge.points) > 1]
    nearest = [(*polyline.nearest(points, point), index) for index, points in lines]
    if not nearest:
        return None
    _, position, place, index = min(nearest, key=lambda found: (found[0], found[1]))
    if vessel is not None and is_walled_off(point, place, vessel):
        feet = [(found[0], found[1], index) for index, points in lines if (found := foot(points, point, vessel)) is not None]
        if feet:
            _, position, index = min(feet)
    return index, position


def _lumen(graph: VesselGraph, point: Point) -> tuple[float, int, float] | None:
    """The vessel that a point lies in, or nearest to: how far outside its lumen (negative: inside), its edge, the position on it.

    By the walls, not by the centerlines: inside a wide vessel the centerline of a narrow one may be nearer.
    """
    found = []
    for index, edge in enumerate(graph.edges):
        if len(edge.points) > 1:
            along = polyline.arc_length(edge.points)
            distance, position, _ = polyline.nearest(edge.points, point, along)
            found.append((distance - float(np.interp(position, along, edge.radius)), distance, index, position))
    if not found:
        return None
    outside, _, index, position = min(found)
    return outside, index, position


def distances(graph: VesselGraph, lengths: list[float], edge: int, position: float) -> tuple[list[float], list[int | None]]:
    """Dijkstra from a place on an edge: each node's distance, and the edge it is reached by (None: straight from the place)."""
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
    that was reached straight from the place."""
    while (via := came_by[node]) is not None:
        edge = graph.edges[via]
        pieces.append(edge.points if edge.end == node else edge.points[::-1])
        node = edge.start if edge.end == node else edge.end
    return node


def joined(pieces: list[Points]) -> Points:
    """Lines one after the other as one (N, 2), without the points that stand twice."""
    points = np.concatenate(pieces)
    return np.asarray(points[np.concatenate([[True], np.any(np.diff(points, axis=0) != 0.0, axis=1)])])


def incidence_of(graph: VesselGraph) -> list[list[tuple[int, bool]]]:
    """For each node the edges that touch it, as (edge, whether the edge starts here)."""
    touching: list[list[tuple[int, bool]]] = [[] for _ in range(len(graph.nodes))]
    for index, edge in enumerate(graph.edges):
        touching[edge.start].append((index, True))
        touching[edge.end].append((index, False))
    return touching
