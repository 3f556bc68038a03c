"""The graph of a vessel's skeleton: centerlines, junctions, ends and radius."""

import cv2
import numpy as np
import pytest

from core import geometry
from core.config.models import CleaningConfig, PerceptionConfig
from core.perception import skeleton
from core.perception.centerline import centerline_at
from core.perception.vectors import fit_vessel_vector
from core.perception.vessel_graph import build_graph, led_on
from core.types import GraphEdge, Mask, Masks, Point, Points, VesselGraph
from tests.core.drawing import SIZE, curve, depth, direction, probability

EAST = (1.0, 0.0)
HALF = 20.0


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
    gaps = [geometry.nearest(BENT, (float(x), float(y)))[0] for x, y in edge.points]
    assert max(gaps) < 2.0
    assert np.median(gaps) < 0.5
    assert np.median(edge.radius) == pytest.approx(17.0, abs=0.7)
    assert {round(x) for x in (edge.points[0, 0], edge.points[-1, 0])} == {0, SIZE[0] - 1}  # to the image border


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
        assert max(geometry.nearest(line, (float(x), float(y)))[0] for x, y in edge.points) < 7.0


def arc(first_deg: float, last_deg: float) -> Points:
    angle = np.radians(np.linspace(first_deg, last_deg, 200))
    return np.column_stack([320 + 110 * np.cos(angle), 240 + 110 * np.sin(angle)])


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
    return max(geometry.nearest(line, (float(x), float(y)))[0] for x, y in edge.points)


def test_a_centerline_lies_in_the_middle_to_a_third_of_a_pixel() -> None:
    for line in (BENT, curve((60, 60), (200, 330), (420, 380), (600, 90))):
        (edge,) = perceived((line, 14.0)).edges
        gaps = [geometry.nearest(line, (float(x), float(y)))[0] for x, y in edge.points[15:-15]]
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


@pytest.mark.parametrize(("radius", "row"), [(12.0, 9.0), (30.0, 29.0), (30.0, 27.0), (45.0, 40.0)])
@pytest.mark.parametrize("turned", [False, True])
def test_of_a_vessel_whose_one_wall_is_out_of_the_picture_the_middle_of_what_is_in_it_counts(
    radius: float, row: float, turned: bool
) -> None:
    line = np.array([[-20.0, row], [660.0, row]])
    (edge,) = perceived((np.array([[SIZE[0] - 1.0, 0.0]]) + line[:, ::-1] * (-1.0, 1.0) if turned else line, radius)).edges
    beside = SIZE[0] - 1 - edge.points[:, 0] if turned else edge.points[:, 1]
    assert np.abs(beside[15:-15] - 0.5 * (row + radius)).max() < 2.0


def test_where_the_border_cuts_off_one_wall_for_a_while_the_line_stays_as_far_from_the_other_one() -> None:
    line = curve((-30, 70), (150, 40), (320, 16), (490, 40), (670, 70))  # 24 px wide to each side, 8 px of them out of the picture
    (edge,) = perceived((line, 24.0)).edges
    gaps = [geometry.nearest(line, (float(x), float(y)))[0] for x, y in edge.points[15:-15]]
    assert max(gaps) < 2.5
    assert np.mean(gaps) < 0.8


def test_a_branch_bends_into_its_trunk_as_its_walls_do() -> None:
    trunk = curve((40.0, 200.0), (320.0, 200.0), (600.0, 200.0))
    branch = curve((260.0, 200.0), (290.0, 222.0), (325.0, 262.0), (340.0, 330.0), (335.0, 440.0))
    graph = perceived((trunk, 16.0), (branch, 13.0))
    assert degrees(graph) == [1, 1, 1, 3]
    side = next(edge for edge in graph.edges if edge.points[:, 1].max() > 300)
    inner = side.points[(side.points[:, 1] < 400)]
    node = graph.nodes[int(np.argmax(np.bincount([n for e in graph.edges for n in (e.start, e.end)])))]
    assert node == pytest.approx((260.0, 200.0), abs=9.0)
    assert max(geometry.nearest(branch, (float(x), float(y)))[0] for x, y in inner) < 4.0
    for edge in graph.edges:
        if edge is not side:
            assert off_by(trunk, edge) < 1.5


def way_between(graph: VesselGraph, start: Point, end: Point) -> Points:
    """The two edges that lead from one end of a fork to another one, as one line."""
    from_start, to_end = (min(graph.edges, key=lambda edge: geometry.nearest(edge.points, near)[0]) for near in (start, end))
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
        assert max(geometry.nearest(line, (float(x), float(y)))[0] for x, y in inner) < 3.5
        step = np.diff(geometry.resample(inner, 4.0), axis=0)
        turn_deg = np.degrees(np.abs(np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))))
        assert turn_deg.max() < 12.0
    mirrored = ways[1] * [1.0, -1.0] + [0.0, 480.0]
    assert max(geometry.nearest(mirrored, (float(x), float(y)))[0] for x, y in ways[0]) < 0.5


def theta_through(graph: VesselGraph, place: Point, heading: Point) -> float:
    """By how many degrees the vessel's direction beside a head there differs from the robot's."""
    found = centerline_at(graph, place, heading, 20.0)
    vector = fit_vessel_vector(found)
    turn = np.arctan2(*vector.direction[::-1]) - np.arctan2(*heading[::-1])
    return float(np.degrees((turn + np.pi) % (2 * np.pi) - np.pi))


@pytest.mark.parametrize("turned_deg", [0.0, 40.0])
@pytest.mark.parametrize("spread_deg", [110.0, 125.0])
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
    assert max(geometry.nearest(trunk, (float(x), float(y)))[0] for x, y in inner) < 2.0


@pytest.mark.parametrize("apart_px", [0.0, 30.0])
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


@pytest.mark.parametrize("seed", range(6))
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


def vessel(line: Points, radius: float) -> Mask:
    return np.asarray(depth(line, radius) >= 0.0)


def bend(last_deg: float, radius: float) -> Points:
    """A circle around (320, 240), clockwise from the left, a point about every 2 px."""
    angle = np.radians(np.arange(-180.0, last_deg, np.degrees(2.0 / radius)))
    return np.column_stack([320.0 + radius * np.cos(angle), 240.0 + radius * np.sin(angle)])


def hooked(line: Points, count: int, by_px: float) -> Points:
    """The last points moved outwards, more and more."""
    moved = line.copy()
    outward = (line - [320.0, 240.0]) / np.hypot(*(line - [320.0, 240.0]).T)[:, None]
    moved[-count:] += (by_px * (np.arange(1, count + 1) / count) ** 2)[:, None] * outward[-count:]
    return moved


@pytest.mark.parametrize("around_px", [70.0, 100.0, 150.0])
@pytest.mark.parametrize("radius", [9.0, 14.0])
def test_a_vessel_that_ends_in_a_bend_bends_to_its_end(radius: float, around_px: float) -> None:
    line = bend(20.0, around_px)
    found = led_on(hooked(line, round(0.6 * radius), 0.7 * radius), radius, vessel(line, radius))
    aside = np.abs(np.hypot(*(found - [320.0, 240.0]).T) - around_px)
    assert aside.max() < 1.2
    assert np.hypot(*(found[-1] - line[-1])) < 0.6 * radius, "it ends where it ended"
    assert np.hypot(*np.diff(found, axis=0).T).max() < 3.0
