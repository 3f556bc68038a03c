import numpy as np
import pytest

from core.geometry import arc_length
from core.perception.centerline import plan_route, route_or_reason
from core.types import GraphEdge, Point, Route, VesselGraph


def graph_of(nodes: list[Point], edges: list[tuple[int, int]]) -> VesselGraph:
    places = np.array(nodes, np.float64)
    lines = [np.linspace(places[a], places[b], 41) for a, b in edges]
    return VesselGraph(places, tuple(GraphEdge(a, b, line, np.full(41, 10.0)) for (a, b), line in zip(edges, lines, strict=True)))


SQUARE = graph_of([(0, 0), (100, 0), (100, 100), (0, 100), (200, 0)], [(0, 1), (2, 1), (2, 3), (3, 0), (1, 4)])
"""A loop of four vessels, two of them drawn against the way round, and a branch at (100, 0)."""


def test_along_one_vessel_in_both_directions() -> None:
    there = plan_route(SQUARE, (110, 4), (180, -3))
    back = plan_route(SQUARE, (180, -3), (110, 4))
    assert there is not None
    assert back is not None
    assert there.length_px == back.length_px == pytest.approx(70)
    assert there.points[[0, -1]].tolist() == [[110, 0], [180, 0]]
    assert there.points.tolist() == back.points[::-1].tolist()
    assert there.target == (180, -3)


@pytest.mark.parametrize(
    ("start", "target", "length", "corner"),
    [
        ((20, 0), (100, 60), 140, (100, 0)),
        ((20, 0), (40, 100), 160, (0, 0)),
        ((100, 60), (20, 0), 140, (100, 0)),
        ((190, 0), (60, 100), 230, (100, 100)),
    ],
)
def test_the_shorter_way_round_a_loop(start: Point, target: Point, length: float, corner: Point) -> None:
    route = plan_route(SQUARE, start, target)
    assert route is not None
    assert route.length_px == pytest.approx(length)
    assert arc_length(route.points)[-1] == pytest.approx(length)
    assert list(corner) in route.points.tolist()
    assert route.points[0] == pytest.approx(start)
    assert route.points[-1] == pytest.approx(target)


def test_a_target_that_cannot_be_reached_says_why() -> None:
    apart = graph_of([(0, 0), (100, 0), (0, 200), (100, 200)], [(0, 1), (2, 3)])
    assert route_or_reason(apart, (20, 0), (50, 200)) == "no vessel that was found leads there"
    assert route_or_reason(apart, (20, 0), (50, 60)) == "the target is 50 px beside the vessel"
    assert route_or_reason(VesselGraph(np.zeros((0, 2)), ()), (20, 0), (50, 60)) == "no vessel was found"
    near = route_or_reason(apart, (20, 0), (50, 24))  # 14 px beside the lumen of radius 10
    assert not isinstance(near, str)
    assert near.length_px == pytest.approx(30)


def test_the_way_out_of_a_vessel_and_back_into_it_when_that_is_shorter() -> None:
    half = np.linspace(0, np.pi, 60)
    bow = np.column_stack([50 - 50 * np.cos(half), -100 * np.sin(half)])
    bypass = VesselGraph(
        np.array([[0.0, 0.0], [100.0, 0.0]]),
        (GraphEdge(0, 1, bow, np.full(60, 10.0)), GraphEdge(0, 1, np.array([[0.0, 0.0], [100.0, 0.0]]), np.full(2, 10.0))),
    )
    route = plan_route(bypass, (1, -10), (99, -10))
    assert route is not None
    assert route.length_px < 125
    assert [0, 0] in route.points.round(6).tolist()


def test_a_ring_with_one_node() -> None:
    angle = np.linspace(0, 2 * np.pi, 181)
    ring = np.column_stack([100 * np.cos(angle), 100 * np.sin(angle)])
    graph = VesselGraph(ring[:1], (GraphEdge(0, 0, ring, np.full(181, 10.0)),))
    route = plan_route(graph, tuple(ring[10]), tuple(ring[170]))
    assert route is not None
    assert route.length_px == pytest.approx(2 * np.pi * 100 * 20 / 180, rel=0.01)
    assert arc_length(route.points)[-1] == pytest.approx(route.length_px)


def test_no_way_and_no_vessel() -> None:
    islands = graph_of([(0, 0), (50, 0), (100, 0), (150, 0)], [(0, 1), (2, 3)])
    assert plan_route(islands, (10, 0), (120, 0)) is None
    assert plan_route(VesselGraph(np.empty((0, 2)), ()), (10, 0), (120, 0)) is None


@pytest.mark.parametrize("y", [122, 126, 128])
def test_a_click_inside_a_wide_vessel_is_in_it_though_a_narrow_ones_centerline_is_nearer(y: float) -> None:
    nodes = np.array([[0.0, 100.0], [200.0, 100.0], [400.0, 100.0], [400.0, 142.0]])
    trunk = np.column_stack([np.linspace(0, 200, 101), np.full(101, 100.0)])
    wide = np.column_stack([np.linspace(200, 400, 101), np.full(101, 100.0)])
    narrow = np.array([[200.0, 100.0], [210.0, 142.0], [400.0, 142.0]])
    edges = (
        GraphEdge(0, 1, trunk, np.full(101, 30.0)),
        GraphEdge(1, 2, wide, np.full(101, 30.0)),
        GraphEdge(1, 3, narrow, np.full(3, 5.0)),
    )
    way = route_or_reason(VesselGraph(nodes, edges), (20.0, 100.0), (350.0, y))
    assert isinstance(way, Route)
    assert way.points[-1][1] == pytest.approx(100.0)


def test_start_and_target_at_the_same_place() -> None:
    route = plan_route(SQUARE, (50, 3), (50, -3))
    assert route is not None
    assert route.length_px == 0.0
    assert route.points[0].tolist() == [50, 0]
