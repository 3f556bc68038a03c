import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core import geometry
from core.perception.vectors import RadiusMap, fit_line, fit_robot_vector, fit_vessel_vector, is_walled_off, project
from core.types import Centerline, Mask, Point, Points


def test_only_the_last_forty_px_count() -> None:
    path = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 40.0]])
    vector = fit_robot_vector(path, 40.0)
    assert vector.start == pytest.approx((100.0, 0.0))
    assert vector.center == pytest.approx((100.0, 20.0))
    assert vector.end == pytest.approx((100.0, 40.0))
    assert vector.direction == pytest.approx((0.0, 1.0))


def test_a_shorter_path_is_used_whole() -> None:
    vector = fit_robot_vector(np.array([[5.0, 5.0], [5.0, 15.0]]), 40.0)
    assert vector.start == pytest.approx((5.0, 5.0))


def test_the_vector_points_to_the_head_whatever_the_direction() -> None:
    for angle in np.radians(np.arange(0, 360, 15)):
        direction = np.array([np.cos(angle), np.sin(angle)])
        vector = fit_robot_vector(np.outer(np.arange(60.0), direction), 40.0)
        assert vector.direction == pytest.approx(tuple(direction))


def test_total_least_squares_does_not_prefer_an_axis() -> None:
    zigzag = np.array([[10.0, float(y)] for y in range(40)]) + np.tile([[1.0, 0.0], [-1.0, 0.0]], (20, 1))
    vector = fit_line(zigzag)
    assert abs(np.degrees(np.arctan2(vector.direction[0], vector.direction[1]))) < 1.0


def test_linear_regression_takes_errors_in_one_direction_only() -> None:
    zigzag = np.array([[0.0, 0.0], [4.0, 2.0], [8.0, 0.0], [12.0, 2.0]])
    # Regression by hand: x - 6 = -6 -2 2 6, y - 1 = -1 1 -1 1, sum xy = 8, sum xx = 80: slope 1/10.
    along = fit_line(zigzag, "least_squares")
    upright = fit_line(zigzag[:, ::-1], "least_squares")
    assert along.direction[1] / along.direction[0] == pytest.approx(0.1)
    assert upright.direction[0] / upright.direction[1] == pytest.approx(0.1)
    assert along.start[0] < along.end[0]
    assert upright.start[1] < upright.end[1]


def test_dense_points_weigh_no_more_than_sparse_ones() -> None:
    bent = np.array([[0.0, 0.0], [20.0, 0.0], [40.0, 10.0]])
    dense_start = np.concatenate([np.column_stack([np.linspace(0, 20, 500), np.zeros(500)]), bent[2:]])
    sparse, dense = fit_line(bent), fit_line(dense_start)
    assert dense.direction == pytest.approx(sparse.direction, abs=1e-3)


def test_end_and_start_are_feet_on_the_line() -> None:
    arc = np.column_stack([np.arange(41.0), 0.01 * (np.arange(41.0) - 20) ** 2])
    vector = fit_line(arc)
    assert vector.direction == pytest.approx((1.0, 0.0), abs=1e-9)
    assert vector.end[0] == pytest.approx(40.0)
    assert vector.end[1] == pytest.approx(vector.start[1]) == pytest.approx(vector.center[1])
    assert vector.end[1] < 4.0  # the head itself lies at y = 4, above the line through the middle of the arc


@pytest.mark.parametrize("points", [[[3.0, 3.0]], [[3.0, 3.0], [3.0, 3.0]], [[3.0, 3.0], [5.0, 3.0]]])
def test_too_short_for_a_direction(points: list[list[float]]) -> None:
    assert fit_robot_vector(np.array(points), 40.0) is None


def test_a_closed_piece_has_no_direction() -> None:
    angle = np.linspace(0, 2 * np.pi, 60)
    assert fit_line(10 * np.column_stack([np.cos(angle), np.sin(angle)])) is None


def test_the_vessel_vector_runs_along_its_piece() -> None:
    piece = np.array([[50.0, 20.0], [10.0, 20.0]])
    vector = fit_vessel_vector(Centerline(piece, (30.0, 20.0), 12.0))
    assert vector.direction == pytest.approx((-1.0, 0.0))
    assert vector.center == pytest.approx((30.0, 20.0))


@given(angle=st.floats(-np.pi, np.pi), shift=st.tuples(st.floats(-500, 500), st.floats(-500, 500)), bend=st.floats(-0.01, 0.01))
def test_the_fit_turns_and_moves_with_the_path(angle: float, shift: tuple[float, float], bend: float) -> None:
    along = np.arange(45.0)
    path = np.column_stack([along, bend * along**2])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    plain, moved = fit_robot_vector(path, 40.0), fit_robot_vector(path @ turn.T + shift, 40.0)
    assert np.asarray(moved.end) == pytest.approx(turn @ plain.end + shift, abs=1e-6)
    assert np.asarray(moved.direction) == pytest.approx(turn @ plain.direction, abs=1e-6)


AT = np.array([[60.0, 100.0], [80.0, 100.0], [100.0, 100.0]])


def tube(half_width: float) -> np.ndarray:
    """Probability of a straight tube along row 100."""
    rows = np.arange(200.0)[:, None] + np.zeros((1, 200))
    return np.clip(0.5 + 0.25 * (half_width - np.abs(rows - 100.0)), 0.0, 1.0).astype(np.float32)


def test_the_rough_radius_is_right_to_a_pixel_wherever_the_mask_has_a_wall() -> None:
    radius = RadiusMap(tube(12.0) >= 0.5)
    assert radius.at(AT) == pytest.approx(12.0, abs=1.0)
    assert RadiusMap(np.ones((48, 64), bool)).at(np.array([[30.0, 20.0]]))[0] <= 65.0


# ---- one lumen, or two side by side ----


def _bent_back(bridge: tuple[int, int] = (0, 0)) -> tuple[Mask, Points]:
    """A vessel that bends back beside itself: wide (40 px) on its way out, narrow (10 px) on its way back, 3 px of wall between.

    `bridge`: columns in which there is no wall. The line is the whole centerline, drawn from the wide strand's beginning.
    """
    mask = np.zeros((200, 300), np.bool_)
    mask[80:121, :260] = True
    mask[124:135, :260] = True
    mask[80:135, 220:270] = True
    mask[121:124, bridge[0] : bridge[1]] = True
    line = np.concatenate(
        [
            np.linspace((0.0, 100.0), (240.0, 100.0), 241),
            np.linspace((240.0, 101.0), (240.0, 128.0), 28),
            np.linspace((240, 129), (0, 129), 241),
        ]
    )
    return mask, line


@pytest.mark.parametrize(
    ("other", "walled_off"),
    [((150.0, 100.0), False), ((150.0, 129.0), True), ((190.0, 129.0), True), ((245.0, 129.0), False), ((150.0, 122.0), False)],
)
def test_a_wall_between_two_places_parts_them(other: Point, walled_off: bool) -> None:
    mask, _ = _bent_back()
    head = (245.0, 100.0) if other[0] > 220 else (150.0, 117.0)
    assert is_walled_off(head, other, mask) is walled_off
    assert is_walled_off(other, head, mask) is walled_off


def test_a_line_that_touches_the_corner_of_a_pixel_meets_no_wall() -> None:
    mask = np.ones((20, 20), np.bool_)
    mask[10, 10] = False
    assert not is_walled_off((0.0, 9.0), (19.0, 9.4), mask)
    assert is_walled_off((0.0, 10.0), (19.0, 10.0), mask)


def test_what_lies_outside_at_an_end_is_no_wall() -> None:
    mask, _ = _bent_back()
    assert not is_walled_off((100.0, 76.0), (100.0, 90.0), mask), "the robot bulges its vessel"
    assert not is_walled_off((100.0, 150.0), (100.0, 170.0), mask)
    assert not is_walled_off((-3.0, 100.0), (2.0, 100.0), mask), "nor does what lies beyond the picture matter"


def test_the_foot_on_a_line_that_bends_back_lies_in_the_strand_that_holds_the_place() -> None:
    mask, line = _bent_back()
    place = (100.25, 117.0)
    assert geometry.nearest(line, place)[2] == pytest.approx((100.25, 129.0)), "the other strand is nearer"
    found = project(line, place, mask)
    assert found[0] == pytest.approx(17.0)
    assert found[1] == pytest.approx(100.25)
    assert found[2] == pytest.approx((100.25, 100.0))
    assert project(line, place, None) == geometry.nearest(line, place)
    open_mask, _ = _bent_back(bridge=(90, 110))
    assert project(line, place, open_mask) == geometry.nearest(line, place), "without a wall it is one lumen"


def test_beyond_a_wall_from_everything_there_is_no_foot() -> None:
    mask, line = _bent_back()
    assert project(line[-200:], (100.0, 117.0), mask) is None
