"""The truth on a straight lumen, where every number can be worked out by hand: 3 px per mm, x_px = 3 x + 20, y_px = 3 y + 10."""

from __future__ import annotations

import json
from math import cos, radians, sin

import numpy as np
import pytest

from core.config.models import PerceptionConfig
from core.perception.centerline import plan_route
from core.types import GraphEdge, Points, Reason, VesselGraph
from hardware.twin.phantom import PHANTOM_TITLES, Phantom
from hardware.twin.phantoms import make_phantom
from hardware.twin.rendering.appearance import Appearance
from hardware.twin.rendering.renderer import Renderer
from hardware.twin.truth import RouteFollower, Truth, true_graph, truth_of, way_from_port
from hardware.twin.view import CameraView

VIEW = CameraView(np.array([[3.0, 0, 20], [0, 3, 10], [0, 0, 1]]), (640, 480))
TWICE = CameraView(np.array([[6.0, 0, 40.5], [0, 6, 20.5], [0, 0, 1]]), (1280, 960))
CONFIG = PerceptionConfig()
RADIUS = 1.0


def _straight_phantom(radius: float = 6.0) -> Phantom:
    line = np.column_stack([np.arange(0.0, 190.5, 0.5), np.full(381, 75.0)])
    return Phantom("straight", "Straight", VesselGraph(line[[0, -1]], (GraphEdge(0, 1, line, np.full(381, radius)),)), 0)


PHANTOM = _straight_phantom()


def _robot(angle_deg: float, head_offset_mm: float, length_mm: float = 60.0) -> Points:
    """A straight robot whose very tip (line end + 1 mm cap) lies at x = 100 mm, `head_offset_mm` below the centerline."""
    direction = np.array([cos(radians(angle_deg)), sin(radians(angle_deg))])
    tip = np.array([100.0, 75.0 + head_offset_mm])
    back = np.arange(RADIUS, length_mm, 2.0)[::-1]
    return tip - back[:, None] * direction


def _truth(robot: Points | None, view: CameraView = VIEW) -> Truth:
    return truth_of(PHANTOM, view, robot, RADIUS, CONFIG)


# c_tail = c_head - 40 px * sin(angle); positive: right of the direction of travel, which is below on screen.
@pytest.mark.parametrize(
    ("angle_deg", "offset_mm", "c_head", "c_tail", "crossed", "state"),
    [
        (0.0, 0.5, 1.5, 1.5, False, "A"),
        (5.0, 1.0, 3.0, 3.0 - 40 * sin(radians(5)), True, "A"),
        (20.0, 1.0, 3.0, 3.0 - 40 * sin(radians(20)), True, "D"),
        (-20.0, -1.0, -3.0, -3.0 + 40 * sin(radians(20)), True, "D"),
        (-15.0, 1.0, 3.0, 3.0 + 40 * sin(radians(15)), False, "B"),
        (15.0, 4.5, 13.5, 13.5 - 40 * sin(radians(15)), False, "C"),
        (0.0, 3.0, 9.0, 9.0, False, "C"),
    ],
)
def test_straight_robot_in_a_straight_lumen(
    angle_deg: float, offset_mm: float, c_head: float, c_tail: float, crossed: bool, state: str
) -> None:
    truth = _truth(_robot(angle_deg, offset_mm))
    assert truth.reason is None
    assert truth.pose.theta_signed_deg == pytest.approx(angle_deg, abs=1e-6)
    assert truth.pose.c_head_px == pytest.approx(c_head, abs=1e-6)
    assert truth.pose.c_tail_px == pytest.approx(c_tail, abs=1e-6)
    assert truth.pose.crossed is crossed
    assert truth.pose.state == state


def test_points_and_distances() -> None:
    truth = _truth(_robot(0.0, 2.0))
    # Tip at (100, 77) mm -> (320, 241) px; nearest centerline point (100, 75) mm -> (320, 235) px; lumen radius 6 mm -> 18 px.
    assert truth.head_xy == pytest.approx((320, 241))
    assert truth.nearest == pytest.approx((320, 235))
    assert truth.lumen_radius_px == pytest.approx(18)
    assert truth.offset_ratio == pytest.approx(6 / 18)
    assert truth.robot_vector.start == pytest.approx((280, 241))
    assert truth.robot_vector.end == pytest.approx((320, 241))
    assert truth.vessel_vector.start == pytest.approx((300, 235))
    assert truth.vessel_vector.end == pytest.approx((340, 235))
    # The wall is 6 mm from the centerline: 6 - 2 - radius 1 = 3 mm of room.
    assert truth.head_clearance_mm == pytest.approx(3.0)
    assert truth.body_clearance_mm == pytest.approx(3.0)


def test_tail_is_the_port_side_end_of_what_is_visible() -> None:
    inside = _truth(_robot(0.0, 0.0, 60.0))
    # 59 mm of line behind the tip at 1 mm steps of 2: its first point is 59 mm back, its cap ends 60 mm back.
    assert inside.tail_xy == pytest.approx((320 - 3 * 60, 235))
    entering = _truth(np.array([[-30.0, 75.0], [99.0, 75.0]]))
    assert entering.tail_xy[0] == pytest.approx(-0.5, abs=0.5)
    assert entering.robot_path[-1] == pytest.approx((320, 235))


def test_body_clearance_counts_from_the_port_on() -> None:
    bent = np.array([[-20.0, 90.0], [-2.0, 76.0], [4.0, 75.0], [50.0, 79.5], [99.0, 75.0]])
    truth = _truth(bent)
    assert truth.body_clearance_mm == pytest.approx(6.0 - 4.5 - RADIUS)


def test_working_pixels_do_not_depend_on_the_cameras_resolution() -> None:
    # TWICE shows the same scene at double size: x' = 2 (x + 0.5) - 0.5.
    robot = _robot(12.0, 1.5)
    one, two = _truth(robot), _truth(robot, TWICE)
    assert two.scale == 0.5
    assert two.head_xy == pytest.approx(one.head_xy)
    assert two.pose.theta_deg == pytest.approx(one.pose.theta_deg)
    assert two.pose.c_tail_px == pytest.approx(one.pose.c_tail_px)
    assert two.to_json()["head_xy"] == pytest.approx([2 * (value + 0.5) - 0.5 for value in one.head_xy or ()], abs=1e-2)


@pytest.mark.parametrize(
    ("robot", "reason"),
    [
        (None, Reason.NO_ROBOT),
        (np.array([[50.0, 75.0]]), Reason.NO_ROBOT),
        (np.array([[50.0, 75.0], [400.0, 75.0]]), Reason.NO_ROBOT),
        (np.array([[50.0, 75.0], [50.0, 75.0]]), Reason.NO_ROBOT),
        (np.array([[50.0, 75.0], [53.0, 75.0]]), Reason.TOO_SHORT),
        (np.array([[50.0, 20.0], [90.0, 20.0]]), Reason.OUTSIDE_VESSEL),
    ],
    ids=["none", "one point", "head out of the picture", "no length", "15 px long", "beside the vessel"],
)
def test_no_pose_with_a_reason(robot: Points | None, reason: Reason) -> None:
    truth = _truth(robot)
    assert truth.pose is None
    assert truth.reason is reason
    assert truth.to_json()["state"] is None
    assert truth.to_json()["reason"] == reason.value


def test_json_is_plain_and_complete() -> None:
    row = json.loads(json.dumps(_truth(_robot(20.0, 1.0)).to_json(), allow_nan=False))
    assert row["state"] == "D"
    assert row["crossed"] is True
    assert row["head_xy"] == pytest.approx([320, 238], abs=1e-3)
    assert row["robot_path_xy"][-1] == pytest.approx(row["head_xy"], abs=1e-3)
    assert set(row["robot_vector"]) == {"start", "center", "end"}
    assert row["d_tail_px"] == pytest.approx(40 * sin(radians(20)) - 3)


def test_true_graph_in_pixels() -> None:
    graph = true_graph(PHANTOM, VIEW)
    assert graph.nodes.tolist() == [[20, 235], [590, 235]]
    assert graph.edges[0].radius == pytest.approx(np.full(381, 18.0))
    half = true_graph(PHANTOM, VIEW, 0.5)
    # Pixel centres at integers: (20 + 0.5) / 2 - 0.5.
    assert half.nodes[0] == pytest.approx([9.75, 117.25])
    assert half.edges[0].radius == pytest.approx(np.full(381, 9.0))


def test_head_is_where_the_robots_label_ends() -> None:
    robot = _robot(17.0, 1.0)
    appearance = Appearance()
    renderer = Renderer(PHANTOM, appearance, view=VIEW)
    truth = truth_of(PHANTOM, VIEW, robot, renderer.appearance.robot_radius_mm, CONFIG)
    label = renderer.render(robot).robot
    direction = np.array([cos(radians(17)), sin(radians(17))])
    assert truth.head_xy is not None
    for step, expected in ((-1.0, True), (1.0, False)):
        x, y = np.rint(np.array(truth.head_xy) + step * direction).astype(int)
        assert label[y, x] == expected


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
        np.testing.assert_array_equal(way_from_port(phantom, target), route.points)
        assert RouteFollower(phantom, target).length_mm == pytest.approx(route.length_px, abs=1e-9)
