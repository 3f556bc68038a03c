import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.perception.vectors import fit_line, fit_robot_vector, fit_vessel_vector
from core.types import Centerline


def test_only_the_last_forty_px_count() -> None:
    path = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 40.0]])
    vector = fit_robot_vector(path, 40.0)
    assert vector is not None
    assert vector.start == pytest.approx((100.0, 0.0))
    assert vector.center == pytest.approx((100.0, 20.0))
    assert vector.end == pytest.approx((100.0, 40.0))
    assert vector.direction == pytest.approx((0.0, 1.0))


def test_a_shorter_path_is_used_whole() -> None:
    vector = fit_robot_vector(np.array([[5.0, 5.0], [5.0, 15.0]]), 40.0)
    assert vector is not None
    assert vector.start == pytest.approx((5.0, 5.0))


def test_the_vector_points_to_the_head_whatever_the_direction() -> None:
    for angle in np.radians(np.arange(0, 360, 15)):
        direction = np.array([np.cos(angle), np.sin(angle)])
        vector = fit_robot_vector(np.outer(np.arange(60.0), direction), 40.0)
        assert vector is not None
        assert vector.direction == pytest.approx(tuple(direction))


def test_total_least_squares_does_not_prefer_an_axis() -> None:
    zigzag = np.array([[10.0, float(y)] for y in range(40)]) + np.tile([[1.0, 0.0], [-1.0, 0.0]], (20, 1))
    vector = fit_line(zigzag)
    assert vector is not None
    assert abs(np.degrees(np.arctan2(vector.direction[0], vector.direction[1]))) < 1.0


def test_dense_points_weigh_no_more_than_sparse_ones() -> None:
    bent = np.array([[0.0, 0.0], [20.0, 0.0], [40.0, 10.0]])
    dense_start = np.concatenate([np.column_stack([np.linspace(0, 20, 500), np.zeros(500)]), bent[2:]])
    sparse, dense = fit_line(bent), fit_line(dense_start)
    assert sparse is not None
    assert dense is not None
    assert dense.direction == pytest.approx(sparse.direction, abs=1e-3)


def test_end_and_start_are_feet_on_the_line() -> None:
    arc = np.column_stack([np.arange(41.0), 0.01 * (np.arange(41.0) - 20) ** 2])
    vector = fit_line(arc)
    assert vector is not None
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
    assert vector is not None
    assert vector.direction == pytest.approx((-1.0, 0.0))
    assert vector.center == pytest.approx((30.0, 20.0))


@given(
    angle=st.floats(-np.pi, np.pi),
    shift=st.tuples(st.floats(-500, 500), st.floats(-500, 500)),
    bend=st.floats(-0.01, 0.01),
)
def test_the_fit_turns_and_moves_with_the_path(angle: float, shift: tuple[float, float], bend: float) -> None:
    along = np.arange(45.0)
    path = np.column_stack([along, bend * along**2])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    plain, moved = fit_robot_vector(path, 40.0), fit_robot_vector(path @ turn.T + shift, 40.0)
    assert plain is not None
    assert moved is not None
    assert np.asarray(moved.end) == pytest.approx(turn @ plain.end + shift, abs=1e-6)
    assert np.asarray(moved.direction) == pytest.approx(turn @ plain.direction, abs=1e-6)
