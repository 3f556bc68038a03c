"""The piece of centerline beside the head: which branch, which way round, and how ambiguous that is."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from core import geometry
from core.config.models import VectorConfig, load_config
from core.geometry import arc_length
from core.perception import centerline
from core.perception.centerline import centerline_at, plan_route, route_or_reason, window_at
from core.perception.vectors import fit_robot_vector, fit_vessel_vector
from core.types import GraphEdge, Mask, Point, Points, Route, VesselGraph
from tests.core.drawing import direction

EAST, WEST = (1.0, 0.0), (-1.0, 0.0)
HALF = 20.0


def graph_of(nodes: list[Point], edges: list[tuple[int, int]], radius: float = 15.0) -> VesselGraph:
    """Straight vessels between nodes."""
    places = np.array(nodes, np.float64)
    lines = [np.linspace(places[a], places[b], 81) for a, b in edges]
    return VesselGraph(places, tuple(GraphEdge(a, b, line, np.full(81, radius)) for (a, b), line in zip(edges, lines, strict=True)))


STRAIGHT = graph_of([(0, 100), (200, 100)], [(0, 1)])
TEE = graph_of([(0, 100), (100, 100), (200, 100), (100, 0)], [(0, 1), (1, 2), (1, 3)])
FORK = graph_of([(0, 100), (100, 100), (200, 150), (200, 50)], [(0, 1), (1, 2), (1, 3)])


def ends(graph: VesselGraph, head: Point, pointing: Point, route: Route | None = None) -> list[list[float]]:
    found = centerline_at(graph, head, pointing, HALF, route)
    return found.piece[[0, -1]].round(3).tolist()


def test_twenty_px_to_each_side_of_the_nearest_point() -> None:
    found = centerline_at(STRAIGHT, (80.25, 93.0), EAST, HALF)
    assert found.nearest == pytest.approx((80.25, 100.0))  # between the line's points
    assert found.piece[[0, -1]].tolist() == [pytest.approx([60.25, 100]), pytest.approx([100.25, 100])]
    assert found.radius_px == 15.0
    assert found.ambiguity == 0.0


def test_the_piece_runs_the_way_the_robot_travels() -> None:
    assert ends(STRAIGHT, (80, 93), EAST) == [[60, 100], [100, 100]]
    assert ends(STRAIGHT, (80, 93), WEST) == [[100, 100], [60, 100]]
    assert ends(STRAIGHT, (80, 93), direction(70)) == [[60, 100], [100, 100]]
    assert ends(STRAIGHT, (80, 93), direction(110)) == [[100, 100], [60, 100]]


@pytest.mark.parametrize(
    ("head_x", "piece"), [(5.0, [[0, 100], [25, 100]]), (193.0, [[173, 100], [200, 100]]), (-8.0, [[0, 100], [20, 100]])]
)
def test_a_vessels_end_cuts_the_piece_short(head_x: float, piece: list[list[float]]) -> None:
    assert ends(STRAIGHT, (head_x, 95.0), EAST) == piece


def test_a_vessel_of_less_than_eight_px_gives_nothing() -> None:
    assert centerline_at(graph_of([(0, 0), (7.9, 0)], [(0, 1)]), (3, 0), EAST, HALF) is None
    assert centerline_at(graph_of([(0, 0), (8.1, 0)], [(0, 1)]), (3, 0), EAST, HALF) is not None
    assert centerline_at(VesselGraph(np.empty((0, 2)), ()), (3, 0), EAST, HALF) is None


def test_a_side_branch_that_the_robot_passes_is_not_taken() -> None:
    for head_x in (80, 90, 95, 100, 105, 110, 120):
        piece = centerline_at(TEE, (head_x, 92.0), EAST, HALF)
        assert np.abs(piece.piece[:, 1] - 100).max() < 1e-6  # although (100, 92) lies on the side branch


def test_at_a_fork_the_branch_that_the_robot_points_into() -> None:
    assert ends(FORK, (90, 100), direction(20))[1][1] > 103
    assert ends(FORK, (90, 100), direction(-20))[1][1] < 97


def test_backward_the_branch_that_the_robot_came_from() -> None:
    leaving = ends(FORK, (90, 100), direction(180 - 26.57))  # out of the branch that runs up on the screen, down into the stem
    assert leaving[1][0] < 75
    assert leaving[0][1] < 97
    turning = ends(TEE, (103, 88), direction(-80))  # it has just turned into the side branch
    assert turning[1] == [100, pytest.approx(68, abs=0.5)]


def test_ambiguity_is_one_in_the_fork_and_zero_away_from_it() -> None:
    def ambiguity(head: Point, pointing: Point) -> float:
        found = centerline_at(FORK, head, pointing, HALF)
        return found.ambiguity

    assert ambiguity((98, 100), EAST) == pytest.approx(1.0, abs=1e-6)
    assert ambiguity((40, 100), EAST) == 0.0
    assert ambiguity((160, 130), direction(26.57)) == 0.0
    assert ambiguity((98, 100), direction(10)) < 0.8
    assert ambiguity((98, 100), direction(26)) < 0.2


def test_the_route_decides_between_branches() -> None:
    for target, sign in (((200, 150), 1), ((200, 50), -1)):
        route = centerline.plan_route(FORK, (20, 100), target)
        for angle in (0, -12, 12):
            assert sign * (ends(FORK, (95, 100), direction(angle), route)[1][1] - 100) > 3
        found = centerline_at(FORK, (95, 100), EAST, HALF, route)
        assert found.ambiguity < 0.1


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("angle", [20, 30, 45, 60])
def test_the_route_decides_whichever_branch_the_robot_points_into(sign: int, angle: int) -> None:
    """Before the fork: it has not turned yet, and must be told by how much."""
    route = centerline.plan_route(FORK, (20, 100), (200, 100 + 50 * sign))
    for x in (88, 92, 95):
        found = centerline_at(FORK, (x, 100), direction(-sign * angle), HALF, route)
        assert sign * (found.piece[-1][1] - 100) > 0
        assert found.ambiguity < 0.1


def test_a_robot_in_another_vessel_than_the_routes_is_not_said_to_be_in_it() -> None:
    route = centerline.plan_route(FORK, (20, 100), (200, 150))
    beyond = centerline_at(FORK, (170, 65), direction(-26.57), HALF, route)
    assert beyond.nearest[1] < 80


def _fork(own_deg: float, other_deg: float, radius: float) -> VesselGraph:
    own, other = (tuple(float(v) for v in 300.0 + 200.0 * np.array(direction(angle))) for angle in (own_deg, other_deg))
    return graph_of([(0.0, 300.0), (300.0, 300.0), own, other], [(0, 1), (1, 2), (1, 3)], radius)


def _driven_into(own_deg: float, bend_px: float) -> Points:
    """A robot's way along the stem and, round a bend of this radius, into a branch that turns up."""
    before = bend_px * np.tan(np.radians(-own_deg) / 2.0)
    stem = np.column_stack([np.arange(100.0, 300.0 - before), np.full(int(np.ceil(200.0 - before)), 300.0)])
    turned = np.radians(np.arange(0.0, -own_deg, 2.0))
    bend = np.array([300.0 - before, 300.0 - bend_px]) + bend_px * np.column_stack([np.sin(turned), np.cos(turned)])
    branch = 300.0 + np.outer(before + np.arange(0.0, 70.0), direction(own_deg))
    return np.concatenate([stem, bend, branch])


@pytest.mark.parametrize(("own_deg", "other_deg"), [(-90, 90), (-75, 15), (-45, 0)])
@pytest.mark.parametrize("radius", [8.0, 15.0])
def test_a_robot_that_goes_beside_its_route_is_measured_forwards(own_deg: float, other_deg: float, radius: float) -> None:
    """Past the fork the way begins backwards; the piece never turns back with it, though the robot's 40 px lag behind its head."""
    fork = _fork(own_deg, other_deg, radius)
    way = _driven_into(own_deg, 20.0)
    thetas = []
    for length in np.arange(150.0, float(geometry.arc_length(way)[-1]), 1.0):
        path = geometry.cut(way, 0.0, length)
        robot, head = fit_robot_vector(path, 40.0), (float(path[-1, 0]), float(path[-1, 1]))
        route = plan_route(fork, head, (float(fork.nodes[3][0]), float(fork.nodes[3][1])))
        found = centerline_at(fork, head, robot.direction, HALF, route)
        vessel = fit_vessel_vector(found) if found is not None else None
        thetas.append(np.degrees(np.arccos(np.clip(np.dot(vessel.direction, robot.direction), -1.0, 1.0))))
    assert max(thetas) < 75
    assert thetas[-1] < 1, "in its own branch alone"
    assert max(thetas) > 0.35 * (other_deg - own_deg), "near the fork it is told how far to turn"


@pytest.mark.parametrize("bent", [100, 115, 122])
@pytest.mark.parametrize("bend_px", [25.0, 60.0])
def test_where_there_is_no_fork_the_route_tells_the_direction_in_a_bend_too(bent: int, bend_px: float) -> None:
    turned = np.radians(np.arange(0.0, 181.0))
    line = 100.0 + bend_px * np.column_stack([np.sin(turned), -np.cos(turned)])
    even = geometry.resample(np.concatenate([[[0.0, 100.0 - bend_px]], line, [[0.0, 100.0 + bend_px]]]), 1.0)
    graph = VesselGraph(even[[0, -1]], (GraphEdge(0, 1, even, np.full(len(even), 8.0)),))
    head = (float(line[20, 0]), float(line[20, 1]))
    route = plan_route(graph, head, (5.0, 100.0 + bend_px))
    found = centerline_at(graph, head, direction(20 + bent), HALF, route)
    assert found.piece[-1][1] > found.nearest[1] > found.piece[0][1]


def _side_by_side(*, joined: bool) -> tuple[VesselGraph, Mask]:
    """A wide vessel (y = 100, 40 px) and a narrow one (y = 129, 10 px) with 3 px of wall between: one edge round a bend, or two."""
    vessel = np.zeros((200, 400), np.bool_)
    vessel[80:121], vessel[124:135] = True, True
    wide, narrow = np.linspace((0.0, 100.0), (380.0, 100.0), 381), np.linspace((380.0, 129.0), (0.0, 129.0), 381)
    if joined:
        vessel[80:135, 360:] = True
        line = np.concatenate([wide, np.linspace((380.0, 101.0), (380.0, 128.0), 28), narrow])
        radius = np.where(line[:, 1] == 100.0, 20.0, 5.0)
        return VesselGraph(np.array([line[0], line[-1]]), (GraphEdge(0, 1, line, radius),)), vessel
    edges = (GraphEdge(0, 1, wide, np.full(381, 20.0)), GraphEdge(2, 3, narrow, np.full(381, 5.0)))
    return VesselGraph(np.array([wide[0], wide[-1], narrow[0], narrow[-1]]), edges), vessel


@pytest.mark.parametrize("joined", [True, False])
@pytest.mark.parametrize(("y", "own"), [(116.0, 100.0), (119.5, 100.0), (125.0, 129.0), (133.0, 129.0)])
def test_the_centerline_is_that_of_the_lumen_that_holds_the_head(joined: bool, y: float, own: float) -> None:
    """Beside the wall of the wide vessel the narrow one's centerline is nearer."""
    graph, vessel = _side_by_side(joined=joined)
    found = centerline_at(graph, (150.5, y), EAST, HALF, vessel=vessel)
    assert found.nearest == pytest.approx((150.5, own))
    assert found.piece[[0, -1]].tolist() == [pytest.approx([130.5, own]), pytest.approx([170.5, own])]
    assert found.ambiguity == 0.0


@pytest.mark.parametrize("joined", [True, False])
def test_a_route_that_bends_back_leads_on_in_the_heads_own_lumen(joined: bool) -> None:
    graph, vessel = _side_by_side(joined=joined)
    target = (20.0, 129.0) if joined else (370.0, 100.0)
    route = plan_route(graph, (100.0, 118.0), target, vessel)
    assert route.points[0] == pytest.approx((100.0, 100.0))
    assert route.length_px == pytest.approx(280.0 + 29.0 + 360.0 if joined else 270.0)
    found = centerline_at(graph, (150.0, 118.0), direction(100), HALF, route, vessel)
    assert found.piece[[0, -1]].tolist() == [pytest.approx([130.0, 100.0]), pytest.approx([170.0, 100.0])]


def test_where_everything_lies_beyond_a_wall_the_nearest_is_better_than_none() -> None:
    graph, vessel = _side_by_side(joined=False)
    narrow = VesselGraph(graph.nodes[2:], (GraphEdge(0, 1, graph.edges[1].points, graph.edges[1].radius),))
    assert plan_route(narrow, (150.0, 118.0), (20.0, 129.0), vessel) is not None
    found = centerline_at(narrow, (150.0, 118.0), EAST, HALF, vessel=vessel)
    assert found.nearest == pytest.approx((150.0, 129.0))


def test_a_route_that_does_not_pass_by_is_ignored() -> None:
    far = Route(np.array([[0.0, 400.0], [200.0, 400.0]]), 200.0, (200, 400))
    assert ends(FORK, (90, 100), direction(-20), far)[1][1] < 97


def test_the_route_tells_the_direction_of_travel_beyond_a_right_angle() -> None:
    route = centerline.plan_route(STRAIGHT, (20, 100), (190, 100))
    assert ends(STRAIGHT, (80, 95), direction(100), route)[1][0] > 80
    assert ends(STRAIGHT, (80, 95), direction(170), route)[1][0] < 80  # but not of a robot that has turned around


@pytest.mark.parametrize("has_stem", [False, True])
@pytest.mark.parametrize("radius", [120.0, 14.0])
def test_a_loops_one_node_is_no_end_of_it(radius: float, has_stem: bool) -> None:
    """A bare ring has its node anywhere; a small one is still one vessel past the head."""
    turns = np.linspace(0.0, 2.0 * np.pi, 721)
    ring = 200.0 + radius * np.column_stack([np.sin(turns), -np.cos(turns)])
    stem = np.linspace(ring[0], ring[0] - (0.0, 100.0), 81)
    nodes = np.vstack([ring[0], stem[-1]]) if has_stem else ring[:1]
    edges = [GraphEdge(0, 0, ring, np.full(721, 15.0)), GraphEdge(0, 1, stem, np.full(81, 15.0))][: 1 + has_stem]
    graph = VesselGraph(nodes, tuple(edges))
    for angle_deg in range(-20, 21, 2):
        angle = np.radians(angle_deg)
        head = (200.0 + (radius - 1.0) * np.sin(angle), 200.0 - (radius - 1.0) * np.cos(angle))
        found = centerline_at(graph, head, direction(angle_deg), HALF)
        length = float(geometry.arc_length(found.piece)[-1])
        if radius > 20.0:
            assert length == pytest.approx(2.0 * HALF, abs=0.2)
            chord = found.piece[-1] - found.piece[0]
            assert np.degrees(np.arctan2(chord[1], chord[0])) == pytest.approx(angle_deg, abs=1.5)
        assert length <= 2.0 * HALF + 0.2


@settings(max_examples=60)
@given(
    x=st.floats(20, 180), offset=st.floats(-10, 10), angle=st.floats(-35, 35), turn=st.floats(-180, 180), shift=st.floats(-300, 300)
)
def test_the_piece_turns_and_moves_with_the_picture(x: float, offset: float, angle: float, turn: float, shift: float) -> None:
    assume(abs(offset) > 1e-6)  # on the fork's axis both branches are equally near: an exact tie may fall either way
    plain = centerline_at(FORK, (x, 100 + offset), direction(angle), HALF)
    a = np.radians(turn)
    rotation = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])

    def moved(points: Points) -> Points:
        return np.asarray(points) @ rotation.T + shift

    edges = tuple(GraphEdge(e.start, e.end, moved(e.points), e.radius) for e in FORK.edges)
    turned = centerline_at(
        VesselGraph(moved(FORK.nodes), edges), tuple(moved(np.array([x, 100 + offset]))), direction(angle + turn), HALF
    )
    assert turned.ambiguity == pytest.approx(plain.ambiguity, abs=1e-3)
    if abs(offset) + abs(angle) > 0.1:
        np.testing.assert_allclose(turned.piece[[0, -1]], moved(plain.piece[[0, -1]]), atol=1e-3)


def test_the_papers_window_takes_every_pixel_near_the_nearest_one() -> None:
    pixels = np.zeros((200, 220), bool)
    pixels[100, 10:200] = True
    pixels[100:180, 100] = True
    straight = window_at(pixels, (50, 90), WEST, HALF)
    assert straight.piece.round(6).tolist() == [[70, 100], [30, 100]]
    assert straight.nearest == (50.0, 100.0)
    both = window_at(pixels, (95, 104), EAST, HALF)
    vector = fit_vessel_vector(both)
    assert vector.direction[1] > 0.05  # the side branch pulls the line: why the graph rule is the default
    assert window_at(np.zeros((200, 220), bool), (50, 90), EAST, HALF) is None


def test_the_rule_is_chosen_by_configuration() -> None:
    pixels = np.zeros((200, 220), bool)
    pixels[100, 10:200] = True
    paper = load_config(preset="paper").perception.vectors
    literal = centerline.find(STRAIGHT, pixels, (50, 90), EAST, paper)
    ours = centerline.find(STRAIGHT, pixels, (50.5, 90), EAST, VectorConfig())
    assert literal.radius_px == 0.0
    assert ours.nearest == (50.5, 100.0)


def route_graph_of(nodes: list[Point], edges: list[tuple[int, int]]) -> VesselGraph:
    places = np.array(nodes, np.float64)
    lines = [np.linspace(places[a], places[b], 41) for a, b in edges]
    return VesselGraph(places, tuple(GraphEdge(a, b, line, np.full(41, 10.0)) for (a, b), line in zip(edges, lines, strict=True)))


SQUARE = route_graph_of([(0, 0), (100, 0), (100, 100), (0, 100), (200, 0)], [(0, 1), (2, 1), (2, 3), (3, 0), (1, 4)])
"""A loop of four vessels, two of them drawn against the way round, and a branch at (100, 0)."""


def test_along_one_vessel_in_both_directions() -> None:
    there = plan_route(SQUARE, (110, 4), (180, -3))
    back = plan_route(SQUARE, (180, -3), (110, 4))
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
    assert route.length_px == pytest.approx(length)
    assert arc_length(route.points)[-1] == pytest.approx(length)
    assert list(corner) in route.points.tolist()
    assert route.points[0] == pytest.approx(start)
    assert route.points[-1] == pytest.approx(target)


def test_a_target_that_cannot_be_reached_says_why() -> None:
    apart = route_graph_of([(0, 0), (100, 0), (0, 200), (100, 200)], [(0, 1), (2, 3)])
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
    assert route.length_px < 125
    assert [0, 0] in route.points.round(6).tolist()


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
    assert way.points[-1][1] == pytest.approx(100.0)
