"""Is a phantom fit for the bench? Its channels keep apart, stay on the board, and a robot can follow them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from core.types import GraphEdge, Points
from hardware.twin.phantom import BOARD_MM, Phantom

WALL_GAP_MM = 2.0
MIN_BEND_RADIUS_MM = 8.0
MAX_TURN_DEG = 75.0
_STRIDE = 3
_SAME_CHANNEL, _OTHER_CHANNEL = 1.6, 3.6


def faults(phantom: Phantom) -> list[str]:
    """What is wrong with `phantom`, one line each; empty when it is fit.

    A bend as tight as the lumen allows brings points 2 * (radius + gap) apart within half a turn, pi/2 times that along the way;
    two branches that leave a junction at 35 degrees keep their gap after 3.5 times that. Points farther apart than these along the
    graph must have a wall between them.
    """
    return [*_off_board(phantom), *_too_tight(phantom), *_sharp_turns(phantom), *_overlaps(phantom)]


def bend_radius_mm(points: Points, over_mm: float = 4.0) -> NDArray[np.float64]:
    """Local radius of curvature (N,) of a polyline (N, 2), measured over chords of `over_mm`."""
    step = max(1, round(over_mm / 2 / float(np.linalg.norm(points[1] - points[0]))))
    if len(points) < 2 * step + 1:
        return np.full(len(points), np.inf)
    before, here, after = points[: -2 * step], points[step:-step], points[2 * step :]
    a, b, c = (np.linalg.norm(q - p, axis=1) for p, q in ((before, here), (here, after), (before, after)))
    u, v = here - before, after - here
    area2 = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    radius = a * b * c / np.maximum(2 * area2, 1e-9)
    return np.concatenate([np.full(step, np.inf), radius, np.full(step, np.inf)])


def node_distances_mm(phantom: Phantom) -> NDArray[np.float64]:
    """Shortest way along the graph between all nodes, (K, K)."""
    count = len(phantom.graph.nodes)
    distance = np.full((count, count), np.inf)
    np.fill_diagonal(distance, 0.0)
    for edge in phantom.graph.edges:
        length = edge_length_mm(edge)
        distance[edge.start, edge.end] = min(distance[edge.start, edge.end], length)
        distance[edge.end, edge.start] = distance[edge.start, edge.end]
    for via in range(count):
        distance = np.minimum(distance, distance[:, via, None] + distance[None, via, :])
    return distance


def edge_length_mm(edge: GraphEdge) -> float:
    return float(np.linalg.norm(np.diff(edge.points, axis=0), axis=1).sum())


def _off_board(phantom: Phantom) -> list[str]:
    """Lumen may leave the board only within reach of an end that lies at the edge."""
    graph, found = phantom.graph, []
    open_ends = [graph.nodes[node] for node in (phantom.port, *phantom.targets) if _edge_distance(graph.nodes[node][None])[0] < 1.0]
    for number, edge in enumerate(graph.edges):
        outside = _edge_distance(edge.points) < edge.radius + 1.0
        for end in open_ends:
            outside &= np.linalg.norm(edge.points - end, axis=1) > 2.0 * edge.radius + 4.0
        if outside.any():
            x, y = edge.points[np.argmax(outside)]
            found.append(f"edge {number} leaves the board at ({x:.0f}, {y:.0f})")
    return found


def _edge_distance(points: Points) -> NDArray[np.float64]:
    return np.asarray(np.minimum(points, np.asarray(BOARD_MM) - points).min(axis=1))


def _too_tight(phantom: Phantom) -> list[str]:
    found = []
    for number, edge in enumerate(phantom.graph.edges):
        tightest = float(bend_radius_mm(edge.points).min())
        if tightest < MIN_BEND_RADIUS_MM:
            found.append(f"edge {number} bends with radius {tightest:.1f} mm")
    return found


def _sharp_turns(phantom: Phantom) -> list[str]:
    """Turns at junctions on the shortest ways from the port to each target."""
    distance, found = node_distances_mm(phantom), []
    leaving: dict[int, list[tuple[int, NDArray[np.float64]]]] = {}
    for edge in phantom.graph.edges:
        for near, far, points in ((edge.start, edge.end, edge.points), (edge.end, edge.start, edge.points[::-1])):
            step = points[min(5, len(points) - 1)] - points[0]
            leaving.setdefault(near, []).append((far, step / np.linalg.norm(step)))
    for node, exits in leaving.items():
        ins = [away for far, away in exits if distance[phantom.port, far] < distance[phantom.port, node]]
        outs = [away for far, away in exits if distance[phantom.port, far] > distance[phantom.port, node]]
        for inward in ins:
            for outward in outs:
                turn_deg = float(np.degrees(np.arccos(np.clip(-inward @ outward, -1.0, 1.0))))
                if turn_deg > MAX_TURN_DEG:
                    found.append(f"node {node} asks for a turn of {turn_deg:.0f} deg")
    return found


def _overlaps(phantom: Phantom) -> list[str]:
    edges, between = phantom.graph.edges, node_distances_mm(phantom)
    points = np.concatenate([edge.points[::_STRIDE] for edge in edges])
    radius = np.concatenate([edge.radius[::_STRIDE] for edge in edges])
    owner = np.concatenate([np.full(len(edge.points[::_STRIDE]), number) for number, edge in enumerate(edges)])
    steps = [np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(edge.points, axis=0), axis=1))]) for edge in edges]
    from_start = np.concatenate([arc[::_STRIDE] for arc in steps])
    to_end = np.concatenate([arc[-1] - arc[::_STRIDE] for arc in steps])
    pairs = cKDTree(points).query_pairs(2 * float(radius.max()) + WALL_GAP_MM, output_type="ndarray")
    i, j = pairs.T
    near = np.linalg.norm(points[i] - points[j], axis=1) < radius[i] + radius[j] + WALL_GAP_MM
    i, j = i[near], j[near]
    start = np.array([edge.start for edge in edges])
    end = np.array([edge.end for edge in edges])
    ways = [
        first + between[a, b] + second
        for a, first in ((start[owner[i]], from_start[i]), (end[owner[i]], to_end[i]))
        for b, second in ((start[owner[j]], from_start[j]), (end[owner[j]], to_end[j]))
    ]
    same = owner[i] == owner[j]
    along = np.min(ways, axis=0)
    along = np.where(same, np.minimum(along, np.abs(from_start[i] - from_start[j])), along)
    allowed = np.where(same, _SAME_CHANNEL, _OTHER_CHANNEL) * (radius[i] + radius[j] + WALL_GAP_MM)
    bad = along > allowed
    if not bad.any():
        return []
    worst = int(np.argmax(np.where(bad, along - allowed, -np.inf)))
    (x, y), (first, second) = points[i[worst]], (owner[i[worst]], owner[j[worst]])
    return [f"edges {first} and {second} come too near each other at ({x:.0f}, {y:.0f})"]
