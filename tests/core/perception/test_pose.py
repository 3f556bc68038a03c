import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.config.models import PoseConfig
from core.perception.pose import StateFilter, classify, measure_pose, room_px, signed_distance
from core.types import Pose, PoseState, Vector

A, B, C, D = PoseState.A, PoseState.B, PoseState.C, PoseState.D
CONFIG = PoseConfig(d_allow_px=6.0, theta_allow_deg=10.0, hysteresis_px=1.0, hysteresis_deg=1.5, dwell_s=0.1)


def vector(start: tuple[float, float], end: tuple[float, float]) -> Vector:
    return Vector(start, ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2), end)


EAST = vector((0.0, 100.0), (40.0, 100.0))
"""The vessel runs to the right of the screen along y = 100."""


@pytest.mark.parametrize(
    ("robot", "theta_signed_deg"),
    [
        (vector((0, 100), (40, 100)), 0.0),
        (vector((0, 100), (40, 140)), 45.0),  # y grows downwards: it points to the right of the vessel's direction
        (vector((0, 100), (40, 60)), -45.0),
        (vector((20, 80), (20, 120)), 90.0),
        (vector((20, 120), (20, 80)), -90.0),
        (vector((40, 100), (0, 100)), 180.0),  # never -180
    ],
)
def test_theta_is_positive_to_the_right_as_seen_on_screen(robot: Vector, theta_signed_deg: float) -> None:
    pose = measure_pose(robot, EAST, CONFIG)
    assert pose.theta_signed_deg == pytest.approx(theta_signed_deg)
    assert pose.theta_deg == pytest.approx(abs(theta_signed_deg))


def test_distances_are_true_px_and_signed_to_the_right() -> None:
    pose = measure_pose(vector((10, 112), (50, 97)), EAST, CONFIG)
    assert pose.c_head_px == pytest.approx(-3.0)
    assert pose.c_tail_px == pytest.approx(12.0)
    assert (pose.d_head_px, pose.d_tail_px) == (pytest.approx(3.0), pytest.approx(12.0))
    assert pose.crossed
    assert pose.state is D


@pytest.mark.parametrize("length", [1.0, 40.0, 1000.0])
def test_distance_does_not_depend_on_the_vessel_vectors_length(length: float) -> None:
    assert signed_distance((7.0, 130.0), vector((0, 100), (length, 100))) == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("c_head", "c_tail", "theta", "state"),
    [
        (5.9, 5.9, 9.9, A),
        (-5.9, 5.9, 9.9, A),  # A is asked first: crossing within the allowance is ideal
        (6.0, 0.0, 0.0, C),  # the limits themselves are outside
        (0.0, 6.0, 0.0, B),
        (1.0, 1.0, 10.0, C),
        (-1.0, 20.0, 30.0, D),
        (20.0, -1.0, 30.0, D),
        (8.0, 12.0, 5.0, B),
        (-8.0, -12.0, 5.0, B),
        (12.0, 8.0, 5.0, C),
        (-12.0, -8.0, 5.0, C),
        (9.0, 9.0, 0.0, C),
        (0.0, 9.0, 20.0, B),  # on the line is not across it
    ],
)
def test_states_in_the_order_a_d_b_c(c_head: float, c_tail: float, theta: float, state: PoseState) -> None:
    assert classify(c_head, c_tail, theta, CONFIG) is state


@pytest.mark.parametrize(
    ("c_head", "c_tail", "theta", "room"),
    [
        (3.0, 2.0, 1.0, 3.0),  # A, the head 3 px below its limit
        (3.0, -3.0, 9.0, 20.0 * (math.sin(math.radians(10)) - math.sin(math.radians(9)))),  # A, the angle near its limit
        (9.0, 10.0, 1.0, 0.5),  # B: half a pixel each makes them equal
        (8.0, 1.0, 10.1, 1.0),  # C, and D where the tail crosses
        (6.5, 2.0, 6.5, 0.5),  # C, A where the head is nearer
        (-8.0, 0.25, 12.0, 0.25),  # D
        (9.0, 9.0, 0.0, 0.0),
    ],
)
def test_the_room_to_another_state_by_hand(c_head: float, c_tail: float, theta: float, room: float) -> None:
    assert room_px(c_head, c_tail, theta, CONFIG, 40.0) == pytest.approx(room)
    assert room_px(-c_head, -c_tail, theta, CONFIG, 40.0) == pytest.approx(room)


@given(
    c_head=st.floats(-19.0, 19.0), c_tail=st.floats(-19.0, 19.0), head_share=st.floats(-1.0, 1.0), tail_share=st.floats(-1.0, 1.0)
)
def test_within_the_room_the_state_stays(c_head: float, c_tail: float, head_share: float, tail_share: float) -> None:
    def theta(head: float, tail: float) -> float:
        return math.degrees(math.asin(min(1.0, abs(head - tail) / 40.0)))

    room = 0.999 * room_px(c_head, c_tail, theta(c_head, c_tail), CONFIG, 40.0)
    moved = c_head + head_share * room, c_tail + tail_share * room
    state = classify(c_head, c_tail, theta(c_head, c_tail), CONFIG)
    assert room < 1e-6 or classify(*moved, theta(*moved), CONFIG) is state


@given(
    c_head=st.floats(-100, 100), c_tail=st.floats(-100, 100), theta=st.floats(0, 180), current=st.sampled_from([None, *PoseState])
)
def test_every_pose_has_exactly_one_state(c_head: float, c_tail: float, theta: float, current: PoseState | None) -> None:
    state = classify(c_head, c_tail, theta, CONFIG, current)
    assert isinstance(state, PoseState)
    assert classify(-c_head, -c_tail, theta, CONFIG, current) is state  # left and right are alike


points = st.tuples(st.floats(0, 640), st.floats(0, 480))


@given(robot=st.tuples(points, points), vessel=st.tuples(points, points), angle=st.floats(-math.pi, math.pi))
def test_turning_the_picture_changes_nothing_and_mirroring_it_the_signs(
    robot: tuple[tuple[float, float], tuple[float, float]], vessel: tuple[tuple[float, float], tuple[float, float]], angle: float
) -> None:
    if math.dist(*robot) < 4 or math.dist(*vessel) < 4:
        return

    def turned(p: tuple[float, float]) -> tuple[float, float]:
        return math.cos(angle) * p[0] - math.sin(angle) * p[1], math.sin(angle) * p[0] + math.cos(angle) * p[1]

    def mirrored(p: tuple[float, float]) -> tuple[float, float]:
        return -p[0], p[1]

    plain = measure_pose(vector(*robot), vector(*vessel), CONFIG)
    rotated = measure_pose(vector(*map(turned, robot)), vector(*map(turned, vessel)), CONFIG)
    flipped = measure_pose(vector(*map(mirrored, robot)), vector(*map(mirrored, vessel)), CONFIG)
    assert rotated.theta_deg == pytest.approx(plain.theta_deg, abs=1e-5)
    assert rotated.c_head_px == pytest.approx(plain.c_head_px, abs=1e-6)
    assert flipped.theta_deg == pytest.approx(plain.theta_deg, abs=1e-5)
    if plain.theta_deg < 179.99:
        assert flipped.theta_signed_deg == pytest.approx(-plain.theta_signed_deg, abs=1e-5)
    assert flipped.c_head_px == pytest.approx(-plain.c_head_px, abs=1e-6)
    assert flipped.c_tail_px == pytest.approx(-plain.c_tail_px, abs=1e-6)


def pose(c_head: float, c_tail: float, theta: float) -> Pose:
    return Pose(theta, theta, c_head, c_tail, c_head * c_tail < 0, classify(c_head, c_tail, theta, CONFIG), 1.0)


def states(stream: list[Pose | None], frame_s: float = 1 / 30) -> str:
    steady = StateFilter(CONFIG)
    return "".join(
        "-" if (out := steady.update(one, step * frame_s)) is None else out.state.value for step, one in enumerate(stream)
    )


INSIDE, AWAY, CROSSED = pose(2, 2, 2), pose(20, 10, 30), pose(-9, 15, 40)


@pytest.mark.parametrize(
    ("frame_s", "told"),
    [(1 / 60, "AAAAAACCC"), (1 / 30, "AAACCCCCC"), (1 / 20, "AACCCCCCC"), (0.1, "ACCCCCCCC"), (0.3, "CCCCCCCCC")],
)
def test_the_first_pose_counts_at_once_and_a_new_state_after_its_dwell(frame_s: float, told: str) -> None:
    """A tenth of a second after it was first seen, to half a frame, however many frames that are."""
    assert states([INSIDE, *[AWAY] * 9], frame_s) == "A" + told


def test_an_odd_frame_among_contradictions_does_not_keep_the_old_state() -> None:
    assert states([INSIDE, AWAY, AWAY, INSIDE, AWAY, AWAY]) == "AAAACC"
    assert states([INSIDE, AWAY, INSIDE, AWAY, AWAY, AWAY]) == "AAAACC"


def test_frames_that_come_unevenly_count_by_their_time() -> None:
    steady = StateFilter(CONFIG)
    told = [steady.update(one, at_s) for one, at_s in [(INSIDE, 0.0), (AWAY, 0.03), (AWAY, 0.04), (AWAY, 0.05), (AWAY, 0.13)]]
    assert [out.state for out in told if out is not None] == [A, A, A, A, C]


def test_frames_that_waver_between_two_other_states_do_not_keep_the_old_one() -> None:
    assert states([INSIDE, AWAY, CROSSED, AWAY, AWAY, AWAY]) == "AAAACC"  # three of four spoke for C
    assert states([INSIDE, *[CROSSED, AWAY] * 2, CROSSED]) == "AAAACC"  # of equals the latest


def test_noise_within_the_band_does_not_change_the_state() -> None:
    assert states([pose(5.5, 5.5, 5), *[pose(6.5, 5.5, 11)] * 6]) == "AAAAAAA"
    assert states([pose(5.5, 5.5, 5), *[pose(7.5, 5.5, 5)] * 6]) == "AAAACCC"
    wobble = [pose(10, 10.4, 20), pose(10.4, 10, 20)]
    assert states(wobble * 5) == "BBBBBBBBBB"
    assert states([wobble[1], *wobble * 5]) == "CCCCCCCCCCC"
    assert states([pose(0.4, 15, 20), *[pose(-0.4, 15, 20)] * 6]) == "BBBBBBB"
    assert states([pose(-3, 15, 20), *[pose(0.4, 15, 20)] * 6]) == "DDDDDDD"


def test_a_frame_without_pose_shows_no_state_and_forgets() -> None:
    assert states([pose(2, 2, 2), None, pose(20, 10, 30)]) == "A-C"


def test_the_filter_never_shows_a_state_that_no_frame_had() -> None:
    seen = [pose(2, 2, 2), pose(20, 10, 30), pose(8, 15, 12), pose(-9, 15, 40)]
    for order in itertools.permutations(seen):
        shown = states([one for one in order for _ in range(4)])
        assert set(shown) <= {one.state.value for one in seen}
