"""Phantoms: fit for the bench, different from each other, the same for the same seed."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from core.types import GraphEdge, VesselGraph
from hardware.twin.phantom import BOARD_MM, Phantom
from hardware.twin.phantoms import (
    MAX_WAY_MM,
    PHANTOM_NAMES,
    Sketch,
    bend_radius_mm,
    faults,
    make_phantom,
    node_distances_mm,
    random_phantom,
    smooth_channel,
)

RANDOM_SEEDS = range(4)
ALL = [*PHANTOM_NAMES, *(f"random:{seed}" for seed in RANDOM_SEEDS)]
ENDS = {
    "s_curve": 1, "y_branch": 2, "tree": 5, "aortic_arch": 5, "tortuous": 1, "cerebral_siphon": 3, "parallel_channels": 3,
    "loop": 1, "coronary": 4,
}  # fmt: skip


def cycles(graph: VesselGraph) -> int:
    """Independent cycles of a connected graph: edges - nodes + 1."""
    return len(graph.edges) - len(graph.nodes) + 1


def reachable(phantom: Phantom) -> set[int]:
    seen, queue = {phantom.port}, deque([phantom.port])
    while queue:
        here = queue.popleft()
        for edge in phantom.graph.edges:
            for a, b in ((edge.start, edge.end), (edge.end, edge.start)):
                if a == here and b not in seen:
                    seen.add(b)
                    queue.append(b)
    return seen


def straight(start: tuple[float, float], end: tuple[float, float], radius: float, nodes: tuple[int, int]) -> GraphEdge:
    points = np.linspace(start, end, 1 + int(np.hypot(end[0] - start[0], end[1] - start[1]) / 0.4))
    return GraphEdge(*nodes, points, np.full(len(points), radius))


@pytest.mark.parametrize("name", ALL)
def test_a_phantom_is_fit_for_the_bench(name: str) -> None:
    phantom = make_phantom(name)
    assert faults(phantom) == []
    assert phantom.name == name
    assert reachable(phantom) == set(range(len(phantom.graph.nodes)))
    assert phantom.port not in phantom.targets
    x, y = phantom.graph.nodes[phantom.port]
    assert -2.0 <= min(x, y, BOARD_MM[0] - x, BOARD_MM[1] - y) <= 0.0, "the port lies at the edge of the board"
    # Centerlines are dense, smooth and end in their nodes.
    for edge in phantom.graph.edges:
        steps = np.linalg.norm(np.diff(edge.points, axis=0), axis=1)
        assert steps.max() <= 0.5
        assert edge.points.shape == (len(edge.radius), 2)
        np.testing.assert_array_equal(edge.points[0], phantom.graph.nodes[edge.start])
        np.testing.assert_array_equal(edge.points[-1], phantom.graph.nodes[edge.end])
        assert 3.3 <= edge.radius.min() and edge.radius.max() <= 12.0
        # No jump of the lumen's radius: at most 0.3 mm per mm.
        assert np.abs(np.diff(edge.radius) / steps).max() < 0.3


@pytest.mark.parametrize("name", PHANTOM_NAMES)
def test_every_through_branch_is_c1(name: str) -> None:
    """At each junction two of the edges carry on into each other, with less than 3 degrees between their tangents."""
    phantom = make_phantom(name)
    away: dict[int, list[np.ndarray]] = {}
    for edge in phantom.graph.edges:
        for node, points in ((edge.start, edge.points), (edge.end, edge.points[::-1])):
            step = points[1] - points[0]
            away.setdefault(node, []).append(step / np.linalg.norm(step))
    for directions in away.values():
        if len(directions) > 1:
            straightest = min(float(a @ b) for i, a in enumerate(directions) for b in directions[:i])
            assert straightest < -np.cos(np.radians(3.0))


def test_the_named_phantoms_have_characters_of_their_own() -> None:
    phantoms = {name: make_phantom(name) for name in PHANTOM_NAMES}
    assert {name: len(phantom.targets) for name, phantom in phantoms.items()} == ENDS
    assert {name for name, phantom in phantoms.items() if cycles(phantom.graph)} == {"loop"}
    assert cycles(phantoms["loop"].graph) == 1
    widest = {name: max(float(edge.radius.max()) for edge in phantom.graph.edges) for name, phantom in phantoms.items()}
    assert max(widest, key=lambda name: widest[name]) == "aortic_arch"
    tightest = {name: min(float(bend_radius_mm(edge.points).min()) for edge in p.graph.edges) for name, p in phantoms.items()}
    assert set(sorted(tightest, key=lambda name: tightest[name])[:2]) == {"cerebral_siphon", "tortuous"}


def test_random_phantoms_repeat_and_differ() -> None:
    once, again, other = random_phantom(7), random_phantom(7), random_phantom(8)
    for first, second in zip(once.graph.edges, again.graph.edges, strict=True):
        np.testing.assert_array_equal(first.points, second.points)
        np.testing.assert_array_equal(first.radius, second.radius)
    assert not np.array_equal(once.graph.nodes, other.graph.nodes)


def test_random_phantoms_vary() -> None:
    phantoms = [random_phantom(seed) for seed in range(24)]
    assert {len(phantom.targets) for phantom in phantoms} >= {1, 2, 3}
    assert any(cycles(phantom.graph) for phantom in phantoms)
    ports = np.array([phantom.graph.nodes[phantom.port] for phantom in phantoms])
    for on_side in (ports[:, 0] < 0, ports[:, 0] > BOARD_MM[0], ports[:, 1] < 0, ports[:, 1] > BOARD_MM[1]):
        assert on_side.any()
    ways = [node_distances_mm(phantom)[phantom.port, list(phantom.targets)].max() for phantom in phantoms]
    assert max(ways) <= MAX_WAY_MM and max(ways) > 1.6 * min(ways)


@pytest.mark.parametrize("name", ["", "banana", "random:", "random:-1", "random:x", "S_curve"])
def test_an_unknown_name_is_refused_with_the_known_ones(name: str) -> None:
    with pytest.raises(ValueError, match=r"known: s_curve, .*random:<seed>"):
        make_phantom(name)


def test_bend_radius_of_a_circle() -> None:
    angle = np.linspace(0.0, np.pi, 400)
    circle = 15.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    radius = bend_radius_mm(circle)
    np.testing.assert_allclose(radius[np.isfinite(radius)], 15.0, rtol=1e-6)


def test_the_check_finds_each_fault() -> None:
    nodes = np.array([(-1.0, 75.0), (80.0, 75.0)])
    fit = Phantom("fit", "fit", VesselGraph(nodes, (straight((-1, 75), (80, 75), 5.0, (0, 1)),)), 0)
    assert faults(fit) == []

    hugging = Phantom("hugging", "", VesselGraph(nodes, (straight((-1, 4), (80, 4), 5.0, (0, 1)),)), 0)
    assert "leaves the board" in faults(hugging)[0]

    hairpin = smooth_channel(np.array([(-1.0, 60.0), (60.0, 60.0), (66.0, 63.0), (60.0, 66.0), (20.0, 66.0)]), np.full(5, 4.0))
    edge = GraphEdge(0, 1, hairpin.points, hairpin.radius)
    found = faults(Phantom("hairpin", "", VesselGraph(hairpin.points[[0, -1]], (edge,)), 0))
    assert any("bends with radius" in line for line in found)
    assert any("too near" in line for line in found)

    sketch = Sketch()
    trunk = sketch.run([(-1, 75), (60, 75), (120, 75)], [5, 5, 5])
    sketch.branch(trunk, (60, 75), 130.0, [(30, 110)], [4, 4])
    assert any("turn of 130 deg" in line for line in faults(Phantom("backwards", "", sketch.graph(), 0)))


def test_a_branch_leaves_to_the_right_for_a_positive_angle() -> None:
    """x right, y down: heading east, the right hand is south (greater y)."""
    sketch = Sketch()
    trunk = sketch.run([(0, 75), (60, 75), (120, 75)], [5, 5, 5])
    branch = sketch.channels[sketch.branch(trunk, (60, 75), 45.0, [(90, 105)], [4, 4])]
    assert branch.points[5, 1] > 75.5
    direction = branch.tangent(0)
    np.testing.assert_allclose(np.degrees(np.arctan2(direction[1], direction[0])), 45.0, atol=1.0)
