import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from core.config import CleaningConfig, PerceptionConfig, VectorConfig, load_config
from core.perception import centerline, polyline, skeleton
from core.perception.centerline import build_graph, centerline_at, window_at
from core.perception.vectors import fit_vessel_vector
from core.types import GraphEdge, Masks, Point, Points, Route, VesselGraph
from tests.core.drawing import SIZE, curve, depth, probability

EAST, WEST = (1.0, 0.0), (-1.0, 0.0)
HALF = 20.0


def direction(angle_deg: float) -> Point:
    return float(np.cos(np.radians(angle_deg))), float(np.sin(np.radians(angle_deg)))


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
    assert found is not None
    return found.piece[[0, -1]].round(3).tolist()


def test_twenty_px_to_each_side_of_the_nearest_point() -> None:
    found = centerline_at(STRAIGHT, (80.25, 93.0), EAST, HALF)
    assert found is not None
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
        assert piece is not None
        assert np.abs(piece.piece[:, 1] - 100).max() < 1e-6  # although (100, 92) lies on the side branch


def test_at_a_fork_the_branch_that_the_robot_points_into() -> None:
    assert ends(FORK, (90, 100), direction(20))[1][1] > 103
    assert ends(FORK, (90, 100), direction(-20))[1][1] < 97


def test_at_a_fork_with_the_robot_pointing_between_the_nearer_branch() -> None:
    assert ends(FORK, (95, 106), EAST)[1][1] > 103
    assert ends(FORK, (95, 94), EAST)[1][1] < 97


def test_never_both_branches() -> None:
    for angle in (-30, -10, 0, 10, 30):
        piece = centerline_at(FORK, (100, 100), direction(angle), HALF)
        assert piece is not None
        forward = piece.piece[piece.piece[:, 0] > 100.5]
        assert (forward[:, 1] > 100).all() or (forward[:, 1] < 100).all()
        assert polyline.arc_length(piece.piece)[-1] == pytest.approx(2 * HALF)


def test_backward_the_branch_that_the_robot_came_from() -> None:
    leaving = ends(FORK, (90, 100), direction(180 - 26.57))  # out of the branch that runs up on the screen, down into the stem
    assert leaving[1][0] < 75
    assert leaving[0][1] < 97
    turning = ends(TEE, (103, 88), direction(-80))  # it has just turned into the side branch
    assert turning[1] == [100, pytest.approx(68, abs=0.5)]


def test_ambiguity_is_one_in_the_fork_and_zero_away_from_it() -> None:
    def ambiguity(head: Point, pointing: Point) -> float:
        found = centerline_at(FORK, head, pointing, HALF)
        assert found is not None
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
        assert found is not None
        assert found.ambiguity < 0.1


def test_a_route_that_does_not_pass_by_is_ignored() -> None:
    far = Route(np.array([[0.0, 400.0], [200.0, 400.0]]), 200.0, (200, 400))
    assert ends(FORK, (90, 100), direction(-20), far)[1][1] < 97


def test_the_route_tells_the_direction_of_travel_beyond_a_right_angle() -> None:
    route = centerline.plan_route(STRAIGHT, (20, 100), (190, 100))
    assert ends(STRAIGHT, (80, 95), direction(100), route)[1][0] > 80
    assert ends(STRAIGHT, (80, 95), direction(170), route)[1][0] < 80  # but not of a robot that has turned around


def test_a_loop_is_walked_one_way_round() -> None:
    corners: list[Point] = [(0, 100), (60, 100), (100, 60), (140, 100), (100, 140), (200, 100)]
    loop = graph_of(corners, [(0, 1), (1, 2), (2, 3), (3, 4), (4, 1), (3, 5)])
    piece = ends(loop, (62, 97), direction(-30))
    assert piece[0][0] < 50
    assert piece[1][1] < 90


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
        assert found is not None
        length = float(polyline.arc_length(found.piece)[-1])
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
    assert plain is not None
    assert turned is not None
    assert turned.ambiguity == pytest.approx(plain.ambiguity, abs=1e-3)
    if abs(offset) + abs(angle) > 0.1:
        np.testing.assert_allclose(turned.piece[[0, -1]], moved(plain.piece[[0, -1]]), atol=1e-3)


@settings(max_examples=60)
@given(
    x=st.floats(20, 180),
    offset=st.floats(-8, 8),
    angle=st.floats(-30, 30),
    dx=st.floats(-0.5, 0.5),
    dy=st.floats(-0.5, 0.5),
    da=st.floats(-1, 1),
)
def test_a_small_disturbance_matters_only_where_two_branches_fit_alike(
    x: float, offset: float, angle: float, dx: float, dy: float, da: float
) -> None:
    before = centerline_at(FORK, (x, 100 + offset), direction(angle), HALF)
    after = centerline_at(FORK, (x + dx, 100 + offset + dy), direction(angle + da), HALF)
    assert before is not None
    assert after is not None
    if before.ambiguity < 0.1:
        assert np.abs(before.piece[-1] - after.piece[-1]).max() < 6.0


def test_the_papers_window_takes_every_pixel_near_the_nearest_one() -> None:
    pixels = np.zeros((200, 220), bool)
    pixels[100, 10:200] = True
    pixels[100:180, 100] = True
    straight = window_at(pixels, (50, 90), WEST, HALF)
    assert straight is not None
    assert straight.piece.round(6).tolist() == [[70, 100], [30, 100]]
    assert straight.nearest == (50.0, 100.0)
    both = window_at(pixels, (95, 104), EAST, HALF)
    assert both is not None
    vector = fit_vessel_vector(both)
    assert vector is not None
    assert vector.direction[1] > 0.05  # the side branch pulls the line: why the graph rule is the default
    assert window_at(np.zeros((200, 220), bool), (50, 90), EAST, HALF) is None


def test_the_rule_is_chosen_by_configuration() -> None:
    pixels = np.zeros((200, 220), bool)
    pixels[100, 10:200] = True
    paper = load_config(preset="paper").perception.vectors
    literal = centerline.find(STRAIGHT, pixels, (50, 90), EAST, paper)
    ours = centerline.find(STRAIGHT, pixels, (50.5, 90), EAST, VectorConfig())
    assert literal is not None
    assert ours is not None
    assert literal.radius_px == 0.0
    assert ours.nearest == (50.5, 100.0)


# ---- the graph of a skeleton ----


def perceived(*tubes: tuple[Points, float], config: CleaningConfig = CleaningConfig()) -> VesselGraph:  # noqa: B008
    vessel = probability(*(depth(line, radius) for line, radius in tubes))
    found = Masks(vessel >= 0.5, np.zeros_like(vessel, bool), vessel, np.zeros_like(vessel))
    skeletons = skeleton.thin_masks(found, PerceptionConfig(cleaning=config))
    return build_graph(skeletons.vessel, found.vessel, config)


def degrees(graph: VesselGraph) -> list[int]:
    return sorted(np.bincount([node for edge in graph.edges for node in (edge.start, edge.end)]).tolist())


BENT = curve((-30, 240), (160, 200), (330, 270), (670, 220))


def test_one_vessel_is_one_edge_to_a_fraction_of_a_pixel() -> None:
    graph = perceived((BENT, 17.0))
    assert degrees(graph) == [1, 1]
    edge = graph.edges[0]
    gaps = [polyline.nearest(BENT, (float(x), float(y)))[0] for x, y in edge.points]
    assert max(gaps) < 2.0
    assert np.median(gaps) < 0.5
    assert np.median(edge.radius) == pytest.approx(17.0, abs=0.7)
    assert {round(x) for x in (edge.points[0, 0], edge.points[-1, 0])} == {0, SIZE[0] - 1}  # to the image border


def test_edges_end_in_their_nodes() -> None:
    graph = perceived((BENT, 17.0), (curve((200, 210), (260, 330), (280, 420)), 11.0))
    assert degrees(graph) == [1, 1, 1, 3]
    for edge in graph.edges:
        np.testing.assert_allclose(edge.points[0], graph.nodes[edge.start])
        np.testing.assert_allclose(edge.points[-1], graph.nodes[edge.end])
        assert len(edge.points) == len(edge.radius)


def test_a_loop_with_one_junction_starts_and_ends_there() -> None:
    arcs = [np.linspace(start, start + 1.2 * np.pi, 200) for start in (0.0, np.pi)]
    ring = [np.column_stack([330 + 110 * np.cos(angle), 240 + 110 * np.sin(angle)]) for angle in arcs]
    graph = perceived(*((arc, 12.0) for arc in ring), (np.array([[-20.0, 240.0], [225.0, 240.0]]), 12.0))
    assert degrees(graph) == [1, 3]
    loop = next(edge for edge in graph.edges if edge.start == edge.end)
    for end in (loop.points[0], loop.points[-1]):
        np.testing.assert_allclose(end, graph.nodes[loop.start])
    assert np.hypot(*np.diff(loop.points, axis=0).T).max() < 6.0
    assert len(loop.points) == len(loop.radius)
    assert max(abs(np.hypot(x - 330, y - 240) - 110) for x, y in loop.points[15:-15]) < 2.0


def test_bumps_of_the_wall_are_no_branches() -> None:
    bumps = [(np.array([[x, 240.0], [x + 4.0, 266.0]]), 4.0) for x in (150.0, 300.0, 450.0)]
    line = np.array([[-20.0, 240.0], [660.0, 240.0]])
    assert degrees(perceived((line, 18.0), *bumps)) == [1, 1]
    literal = CleaningConfig(prune_spurs=False, extend_ends=False, rebuild_junctions=False)
    assert len(perceived((line, 18.0), *bumps, config=literal).edges) > 1


@pytest.mark.parametrize("angle_deg", [50, 70, 90, 120])
def test_a_trunk_runs_straight_through_a_junction_and_the_branch_straight_into_it(angle_deg: float) -> None:
    trunk = np.array([[-20.0, 200.0], [660.0, 200.0]])
    along = np.array(direction(angle_deg))
    branch = np.array([[300.0, 200.0], [300.0, 200.0] + 200 * along])
    graph = perceived((trunk, 18.0), (branch, 12.0))
    assert degrees(graph) == [1, 1, 1, 3]
    node = graph.nodes[int(np.argmax(np.bincount([n for e in graph.edges for n in (e.start, e.end)])))]
    assert node == pytest.approx((300, 200), abs=10)
    for edge in graph.edges:
        line = branch if edge.points[:, 1].max() > 300 else trunk
        assert max(polyline.nearest(line, (float(x), float(y)))[0] for x, y in edge.points) < 7.0


def arc(first_deg: float, last_deg: float) -> Points:
    angle = np.radians(np.linspace(first_deg, last_deg, 200))
    return np.column_stack([320 + 110 * np.cos(angle), 240 + 110 * np.sin(angle)])


def test_a_loop_stays_a_loop() -> None:
    way_in, way_out = np.array([[-20.0, 240.0], [215.0, 240.0]]), np.array([[425.0, 240.0], [660.0, 240.0]])
    graph = perceived((arc(-10, 190), 14.0), (arc(170, 370), 14.0), (way_in, 14.0), (way_out, 14.0))
    assert degrees(graph) == [1, 1, 3, 3]
    assert len(graph.edges) == 4


def test_the_radius_near_a_junction_does_not_depend_on_the_branchs_other_end() -> None:
    trunk, branch = curve((-20, 240), (320, 240), (660, 240)), np.array([[320.0, 240.0], [430.0, 60.0]])
    near = []
    for config in (CleaningConfig(), CleaningConfig(extend_ends=False)):
        side = min(perceived((trunk, 16.0), (branch, 10.0), config=config).edges, key=lambda edge: edge.points[:, 1].min())
        outward = slice(None) if side.points[0, 1] > side.points[-1, 1] else slice(None, None, -1)
        near.append(side.radius[outward][:12])
    np.testing.assert_allclose(near[0], near[1], atol=0.2)
    assert 14.0 < near[0][0] < 18.0, "at first it is in its trunk's lumen"


def test_a_ring_alone_and_an_empty_mask() -> None:
    graph = perceived((arc(-10, 190), 14.0), (arc(170, 370), 14.0))
    assert len(graph.edges) == 1
    assert graph.edges[0].start == graph.edges[0].end
    nothing = np.zeros((480, 640), bool)
    assert build_graph(nothing, nothing, CleaningConfig()).edges == ()


def test_a_mesh_is_no_vessel() -> None:
    net = np.zeros((480, 640), bool)
    net[::30] = net[:, ::30] = True
    assert build_graph(net, net, CleaningConfig()).edges == ()
    assert build_graph(net[:100, :100], net[:100, :100], CleaningConfig()).edges != ()


def test_a_blob_keeps_one_edge_or_none() -> None:
    assert len(perceived((np.array([[300.0, 240.0], [330.0, 240.0]]), 25.0)).edges) <= 1


def test_the_vessels_direction_beside_the_head_to_a_degree() -> None:
    graph = perceived((BENT, 17.0))
    truth = VesselGraph(BENT[[0, -1]], (GraphEdge(0, 1, BENT, np.full(len(BENT), 17.0)),))
    for x in range(40, 600, 40):
        head = (float(x), float(np.interp(x, BENT[:, 0], BENT[:, 1])) + 5.0)
        vectors = [fit_vessel_vector(found) for one in (graph, truth) if (found := centerline_at(one, head, EAST, HALF))]
        assert len(vectors) == 2
        angles = [np.degrees(np.arctan2(v.direction[1], v.direction[0])) for v in vectors if v is not None]
        assert abs(angles[0] - angles[1]) < 1.0


@pytest.mark.parametrize("apart_px", [16.0, 24.0, 34.0])
def test_branches_that_leave_close_to_each_other_leave_no_hook(apart_px: float) -> None:
    trunk = curve((60.0, 240.0), (320.0, 240.0), (580.0, 240.0))
    up = curve((300.0, 240.0), (350.0, 150.0), (400.0, 60.0))
    down = curve((300.0 + apart_px, 240.0), (360.0 + apart_px, 330.0), (420.0 + apart_px, 420.0))
    found = perceived((trunk, 16.0), (up, 12.0), (down, 12.0))
    assert degrees(found).count(1) == 4
    for edge in found.edges:
        steps = np.diff(edge.points, axis=0)
        steps = steps[np.hypot(steps[:, 0], steps[:, 1]) > 0]
        assert (np.einsum("ij,ij->i", steps[:-1], steps[1:]) > 0).all(), "the centerline never goes back on itself"
        assert len(edge.radius) == len(edge.points)


def off_by(line: Points, edge: GraphEdge) -> float:
    """How far an edge leaves a line at most."""
    return max(polyline.nearest(line, (float(x), float(y)))[0] for x, y in edge.points)


def test_a_centerline_lies_in_the_middle_to_a_third_of_a_pixel() -> None:
    for line in (BENT, curve((60, 60), (200, 330), (420, 380), (600, 90))):
        (edge,) = perceived((line, 14.0)).edges
        gaps = [polyline.nearest(line, (float(x), float(y)))[0] for x, y in edge.points[15:-15]]
        assert float(np.mean(gaps)) < 0.15
        assert max(gaps) < 0.5


def test_where_one_wall_is_soft_the_other_one_and_the_width_around_count() -> None:
    line = np.array([[-20.0, 240.0], [660.0, 240.0]])
    deep = depth(line, 14.0)
    vessel = probability(deep)
    rows = np.arange(SIZE[1], dtype=np.float64)[:, None]
    soft = 1.0 / (1.0 + np.exp(-0.25 * (rows - (240.0 - 17.0))))  # the upper wall, 3 px too far out
    vessel[:240, 290:350] = soft[:240]
    found = Masks(vessel >= 0.5, np.zeros_like(vessel, bool), vessel, np.zeros_like(vessel))
    skeletons = skeleton.thin_masks(found, PerceptionConfig())
    aside = []
    for known in (None, vessel):
        (edge,) = build_graph(skeletons.vessel, found.vessel, CleaningConfig(), known).edges
        near = (edge.points[:, 0] > 300) & (edge.points[:, 0] < 340)
        aside.append(float(np.abs(edge.points[near, 1] - 240.0).max()))
    assert aside[0] == pytest.approx(1.5, abs=0.4)
    assert aside[1] < 0.6


def test_a_branch_bends_into_its_trunk_as_its_walls_do() -> None:
    trunk = curve((40.0, 200.0), (320.0, 200.0), (600.0, 200.0))
    branch = curve((260.0, 200.0), (290.0, 222.0), (325.0, 262.0), (340.0, 330.0), (335.0, 440.0))
    graph = perceived((trunk, 16.0), (branch, 13.0))
    assert degrees(graph) == [1, 1, 1, 3]
    side = next(edge for edge in graph.edges if edge.points[:, 1].max() > 300)
    inner = side.points[(side.points[:, 1] < 400)]
    node = graph.nodes[int(np.argmax(np.bincount([n for e in graph.edges for n in (e.start, e.end)])))]
    assert node == pytest.approx((260.0, 200.0), abs=9.0)
    assert max(polyline.nearest(branch, (float(x), float(y)))[0] for x, y in inner) < 4.0
    for edge in graph.edges:
        if edge is not side:
            assert off_by(trunk, edge) < 1.5


def way_between(graph: VesselGraph, start: Point, end: Point) -> Points:
    """The two edges that lead from one end of a fork to another one, as one line."""
    from_start, to_end = (min(graph.edges, key=lambda edge: polyline.nearest(edge.points, near)[0]) for near in (start, end))
    node = next(iter({from_start.start, from_start.end} & {to_end.start, to_end.end}))
    inward = from_start.points if from_start.end == node else from_start.points[::-1]
    outward = to_end.points if to_end.start == node else to_end.points[::-1]
    return np.concatenate([inward, outward[1:]])


def test_a_symmetric_fork_goes_on_smoothly_and_alike_into_both_branches() -> None:
    stem = np.array([[-20.0, 240.0], [300.0, 240.0]])
    up = curve((300.0, 240.0), (330.0, 234.0), (400.0, 200.0), (600.0, 60.0))
    down = up * [1.0, -1.0] + [0.0, 480.0]
    graph = perceived((stem, 16.0), (up, 15.0), (down, 15.0))
    assert degrees(graph) == [1, 1, 1, 3]
    ways = [way_between(graph, (20.0, 240.0), end) for end in ((590.0, 67.0), (590.0, 413.0))]
    for way, true in zip(ways, (up, down), strict=True):
        line = np.concatenate([stem, true[1:]])
        inner = way[(way[:, 0] > 40) & (way[:, 0] < 560)]
        assert max(polyline.nearest(line, (float(x), float(y)))[0] for x, y in inner) < 3.5
        step = np.diff(polyline.resample(inner, 4.0), axis=0)
        turn_deg = np.degrees(np.abs(np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))))
        assert turn_deg.max() < 12.0
    mirrored = ways[1] * [1.0, -1.0] + [0.0, 480.0]
    assert max(polyline.nearest(mirrored, (float(x), float(y)))[0] for x, y in ways[0]) < 0.5


def theta_through(graph: VesselGraph, place: Point, heading: Point) -> float:
    """By how many degrees the vessel's direction beside a head there differs from the robot's."""
    found = centerline_at(graph, place, heading, 20.0)
    assert found is not None
    vector = fit_vessel_vector(found)
    assert vector is not None
    turn = np.arctan2(*vector.direction[::-1]) - np.arctan2(*heading[::-1])
    return float(np.degrees((turn + np.pi) % (2 * np.pi) - np.pi))


@pytest.mark.parametrize("turned_deg", [0.0, 17.0, 40.0, 75.0])
@pytest.mark.parametrize("spread_deg", [110.0, 120.0, 125.0])
def test_where_any_two_of_three_may_be_the_trunk_all_ways_are_alike(turned_deg: float, spread_deg: float) -> None:
    middle = np.array([320.3, 240.2])
    outward = [np.array(direction(turned_deg + angle)) for angle in (0.0, spread_deg, -spread_deg)]
    graph = perceived(*((np.array([middle, middle + 200 * way]), 14.0) for way in outward))
    assert degrees(graph) == [1, 1, 1, 3]
    for start, end in ((0, 1), (1, 2), (2, 0)):
        heading = outward[end] - outward[start]
        heading /= np.hypot(*heading)
        assert abs(theta_through(graph, (320.3, 240.2), (float(heading[0]), float(heading[1])))) < 9.0


@pytest.mark.parametrize("radius", [13.5, 15.0, 16.0, 17.0])
def test_a_narrow_vessel_that_a_wide_one_ends_on_stays_straight(radius: float) -> None:
    narrow, wide = np.array([[-20.0, 200.0], [660.0, 200.0]]), np.array([[320.0, 200.0], [320.0, 440.0]])
    graph = perceived((narrow, 8.0), (wide, radius))
    assert degrees(graph) == [1, 1, 1, 3]
    assert abs(theta_through(graph, (320.0, 200.0), EAST)) < 2.0


@pytest.mark.parametrize("turn_deg", [28.0, 32.0, 36.0])
def test_a_trunk_that_bends_as_much_as_its_branch_turns_away_stays_on_its_line(turn_deg: float) -> None:
    trunk = curve((-20.0, 240.0), (140.0, 238.0), (280.0, 240.0), (420.0, 205.0), (560.0, 120.0))
    branch = np.array([[290.0, 239.0], [290.0, 239.0] + 220 * np.array(direction(turn_deg))])
    graph = perceived((trunk, 16.0), (branch, 15.0))
    way = way_between(graph, (20.0, 240.0), (550.0, 126.0))
    inner = way[(way[:, 0] > 40) & (way[:, 0] < 530)]
    assert max(polyline.nearest(trunk, (float(x), float(y)))[0] for x, y in inner) < 2.0


@pytest.mark.parametrize("apart_px", [0.0, 14.0, 30.0, 46.0])
@pytest.mark.parametrize("other_side", [False, True])
def test_one_trunk_runs_through_junctions_that_are_near_to_each_other(apart_px: float, other_side: bool) -> None:
    trunk = curve((40.0, 240.0), (320.0, 240.0), (600.0, 240.0))
    first = curve((280.0, 240.0), (340.0, 190.0), (400.0, 60.0))
    turned = -1.0 if other_side else 1.0
    start = 280.0 + apart_px + (0.0 if other_side else 30.0)
    second = np.array([[start, 240.0], [start + 180.0, 240.0 - turned * 150.0]])
    graph = perceived((trunk, 16.0), (first, 11.0), (second, 11.0))
    ends = [edge for edge in graph.edges if off_by(trunk, edge) < 2.5]
    covered = np.concatenate([edge.points[:, 0] for edge in ends])
    assert covered.min() < 62.0
    assert covered.max() > 578.0
    assert np.diff(np.sort(covered)).max() < 8.0, "the trunk is there from end to end, on its own line"


def has_no_jump_and_stays_within(graph: VesselGraph, *tubes: tuple[Points, float]) -> bool:
    """Whether all edges are evenly drawn, end in their nodes, and run within the vessel."""
    inside = np.maximum.reduce([depth(line, radius) for line, radius in tubes])
    for edge in graph.edges:
        np.testing.assert_allclose(edge.points[[0, -1]], graph.nodes[[edge.start, edge.end]])
        places = np.rint(edge.points).astype(int)
        if np.hypot(*np.diff(edge.points, axis=0).T).max() > 6.0 or (inside[places[:, 1], places[:, 0]] < -1.0).any():
            return False
    return True


def test_a_branch_of_a_branch_stays_on_it_however_near_the_trunk_is() -> None:
    scene = (
        (np.array([[320.0, -20.0], [320.0, 500.0]]), 16.0),
        (np.array([[320.0, 260.0], [60.0, 230.0]]), 13.0),
        (np.array([[272.0, 254.0], [268.0, 60.0]]), 8.0),
    )
    graph = perceived(*scene)
    assert degrees(graph) == [1, 1, 1, 1, 3, 3]
    assert has_no_jump_and_stays_within(graph, *scene)
    twig = next(edge for edge in graph.edges if edge.points[:, 1].min() < 80 and edge.points[:, 0].max() < 300)
    assert max(twig.points[:, 1]) == pytest.approx(254.0, abs=8.0)


def test_a_link_between_two_vessels_leaves_both_whole() -> None:
    scene = (
        (np.array([[300.0, -20.0], [300.0, 500.0]]), 10.0),
        (np.array([[340.0, -20.0], [340.0, 500.0]]), 10.0),
        (np.array([[300.0, 240.0], [340.0, 240.0]]), 8.0),
    )
    graph = perceived(*scene)
    assert degrees(graph) == [1, 1, 1, 1, 3, 3]
    assert has_no_jump_and_stays_within(graph, *scene)


@pytest.mark.parametrize("seed", range(12))
def test_whatever_a_vessel_looks_like_its_lines_end_in_their_nodes_and_in_the_picture(seed: int) -> None:
    rng = np.random.default_rng(seed)
    width, height = int(rng.integers(40, 200)), int(rng.integers(40, 200))
    mask = np.zeros((height, width), np.uint8)
    for _ in range(int(rng.integers(2, 7))):
        corners = (rng.uniform(-0.2, 1.2, (int(rng.integers(2, 6)), 2)) * (width, height)).astype(np.int32)
        cv2.polylines(mask, [corners], bool(rng.random() < 0.3), 1, int(rng.integers(1, 24)))
    graph = build_graph(skeleton.thin_half_size(mask > 0), mask > 0, CleaningConfig())
    for edge in graph.edges:
        assert len(edge.points) == len(edge.radius) >= 1
        assert np.isfinite(edge.points).all()
        np.testing.assert_allclose(edge.points[0], graph.nodes[edge.start])
        np.testing.assert_allclose(edge.points[-1], graph.nodes[edge.end])
        assert (edge.points > -3.0).all()
        assert (edge.points < (width + 2.0, height + 2.0)).all()


def test_a_wall_on_the_very_edge_of_belief_is_survived() -> None:
    level = np.zeros((100, 100), np.float32)
    level[50, 5:95] = level[5:95, 50] = 0.5
    assert len(build_graph(level >= 0.5, level >= 0.5, CleaningConfig(), level).edges) >= 1


def test_an_island_in_a_junction_stays_a_loop() -> None:
    around = np.linspace(0.0, 2.0 * np.pi, 120)
    halves = [np.column_stack([320.0 + 24.0 * np.cos(part), 240.0 + 24.0 * np.sin(part)]) for part in (around[:70], around[50:])]
    arms = [np.array([320.0, 240.0]) + np.outer([14.0, 190.0], direction(angle)) for angle in (10, 130, 250)]
    graph = perceived(*((half, 10.0) for half in halves), *((arm, 12.0) for arm in arms))
    assert degrees(graph) == [1, 1, 1, 3, 3, 3]
    assert len(graph.edges) == 6
    for edge in graph.edges:
        np.testing.assert_allclose(edge.points[0], graph.nodes[edge.start])
        np.testing.assert_allclose(edge.points[-1], graph.nodes[edge.end])


def test_a_vessel_that_fills_the_image_has_a_radius_of_its_size() -> None:
    full = np.ones((480, 640), bool)
    line = np.zeros((480, 640), bool)
    line[240] = True
    (edge,) = build_graph(line, full, CleaningConfig()).edges
    assert edge.radius.max() <= 641.0
