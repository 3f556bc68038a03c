"""The twin's own way through its phantom: the shortest one along the true centerlines."""

import numpy as np
import pytest

from core.perception.centerline import plan_route
from core.types import GraphEdge, Points, VesselGraph
from hardware.twin.phantom import PHANTOM_TITLES, Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.truth import RouteFollower, way_from_port


def edge(start: int, end: int, *points: tuple[float, float]) -> GraphEdge:
    return GraphEdge(start, end, np.array(points), np.full(len(points), 3.0))


STRAIGHT: Points = np.array([(0.0, 0.0), (10.0, 0.0), (30.0, 0.0), (40.0, 0.0)])
LOOP = Phantom(
    "two ways",
    "Two ways",
    VesselGraph(
        np.array([(0.0, 0.0), (10.0, 0.0), (30.0, 0.0), (40.0, 0.0), (90.0, 90.0)]),
        (
            edge(0, 1, (0, 0), (10, 0)),
            edge(1, 2, (10, 0), (20, 15), (30, 0)),
            edge(2, 1, (30, 0), (10, 0)),  # the shorter one of the two, and drawn against the way
            edge(2, 3, (30, 0), (40, 0)),
        ),
    ),
    port=0,
)


def test_of_two_vessels_between_the_same_forks_the_shorter_one_is_taken() -> None:
    np.testing.assert_array_equal(way_from_port(LOOP, 3), STRAIGHT)
    np.testing.assert_array_equal(way_from_port(LOOP, 0), STRAIGHT[:1])


def test_a_node_that_no_vessel_leads_to_is_an_error() -> None:
    with pytest.raises(ValueError, match="phantom two ways: node 4 cannot be reached from the port"):
        way_from_port(LOOP, 4)


@pytest.mark.parametrize("name", [*PHANTOM_TITLES, "random:100", "random:101"])
def test_it_is_the_operators_route_to_the_same_place(name: str) -> None:
    phantom = make_phantom(name)
    nodes = [(float(x), float(y)) for x, y in phantom.graph.nodes]
    for target in phantom.targets:
        route = plan_route(phantom.graph, nodes[phantom.port], nodes[target])
        assert route is not None
        np.testing.assert_array_equal(way_from_port(phantom, target), route.points)
        assert RouteFollower(phantom, target).length_mm == pytest.approx(route.length_px, abs=1e-9)
