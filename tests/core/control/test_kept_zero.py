"""Kept zeros: a joint is offered where it truly is, whatever the servo forgot, and never where that is in doubt.

A turn is 4096 ticks and 40 mm, so 1 mm is 102.4 ticks. Tendons: -2.4..2.8 mm, feeds: -5..400 mm.
"""

import re
from typing import Literal

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from core.config.safety import TENDONS, TICKS_PER_TURN, JointConfig, ServosConfig
from core.control.kept_zero import (
    KeptJoint,
    KeptZeros,
    ZeroOffer,
    ZeroRequest,
    all_at_zero,
    keep,
    request_problem,
    unknown_joint,
    zero_offer,
)

SERVOS = ServosConfig()
RIGHT, ADVANCE = SERVOS.joints[0], SERVOS.joints[4]
MODEL = SERVOS.model
ALL_AT_ZERO = all_at_zero(SERVOS)


def kept(joint: JointConfig, ticks: int, position_mm: float) -> KeptJoint:
    return keep(joint, MODEL, ticks, position_mm, 1000.0)


@pytest.mark.parametrize(
    ("joint", "was", "at_mm", "now", "offered_mm", "zero_ticks"),
    [
        (RIGHT, 2048, 0.0, 2048, 0.0, 2048),  # only the program was started again
        (RIGHT, 2048, 0.0, 2150, 102 / 102.4, 2048),  # pulled by hand meanwhile
        (RIGHT, 2048 + 31, 31 / 102.4, 2079, 31 / 102.4, 2048),  # holds its pretension
        (RIGHT, 9000, 0.0, 9000 - 2 * 4096, 0.0, 808),  # restarted: counts from another turn
        (RIGHT, -100, 0.0, 3996, 0.0, 3996),  # registers below 0 come back within one turn, too
        (RIGHT, 4090, 0.0, 4, 10 / 102.4, -6),  # restarted behind the encoder's seam
        (RIGHT, 4096, 0.0, 0, 0.0, 0),
        (RIGHT, -1, 0.0, 4095, 0.0, 4095),
        (ADVANCE, 5106, 40.0, 5106, 40.0, 1010),
        (ADVANCE, 5106, 40.0, 1010, 40.0, 1010 - 4096),  # restarted, and one turn in
        (ADVANCE, 5106, 40.0, 1112, 40.0 + 102 / 102.4, 1112 - 4198),
    ],
)
def test_where_a_joint_stands_by_its_kept_zero(
    joint: JointConfig, was: int, at_mm: float, now: int, offered_mm: float, zero_ticks: int
) -> None:
    offer = zero_offer(joint, MODEL, kept(joint, was, at_mm), now)
    assert offer.position_mm == pytest.approx(offered_mm, abs=0.005)
    assert offer.zero_ticks == zero_ticks


@pytest.mark.parametrize(
    ("joint", "was", "at_mm", "now", "why"),
    [
        (RIGHT, 2048, 0.0, 2048 + 300, "it would be at 2.93 mm, outside the envelope"),
        (RIGHT, 2048, 2.0, 2048 + 130, "it would be at 3.27 mm"),
        (ADVANCE, 1000, 40.0, 1000 + 1100, "moved by more than a quarter of a turn: perhaps in another one"),
        (ADVANCE, 5106, 40.0, 5106 + 4096, "another program fed it by a turn: a restarted servo counts below 4096"),
        (ADVANCE, 5106, 2.0, 5106 - 800, "it would be at -5.8 mm"),
        (RIGHT, 8192, 0.0, 4096, "turned back by a turn, but not restarted: it would count from 0 to 4095"),
    ],
)
def test_in_doubt_nothing_is_offered(joint: JointConfig, was: int, at_mm: float, now: int, why: str) -> None:
    assert zero_offer(joint, MODEL, kept(joint, was, at_mm), now) is None, why


@pytest.mark.parametrize(("ticks", "is_offered"), [(-259, False), (-258, True), (258, True), (259, False)])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_joint_at_the_end_of_its_envelope_may_be_two_units_beyond_it(sign: int, ticks: int, is_offered: bool) -> None:
    """2.5 mm are 256 units."""
    joint = RIGHT.model_copy(update={"sign": sign, "low_mm": -2.5, "high_mm": 2.5})
    assert (zero_offer(joint, MODEL, kept(joint, 2000, 0.0), 2000 + ticks) is not None) is is_offered


@pytest.mark.parametrize("changes", [{"id": 9}, {"sign": -1}, {"mm_per_turn": 62.8}])
def test_another_servo_direction_or_drum_has_no_kept_zero(changes: dict[str, float]) -> None:
    of_before = kept(RIGHT, 2048, 0.0)
    assert zero_offer(RIGHT, MODEL, of_before, 2048) is not None
    assert zero_offer(RIGHT.model_copy(update=changes), MODEL, of_before, 2048) is None
    assert zero_offer(RIGHT, 1060, of_before, 2048) is None
    assert zero_offer(SERVOS.joints[1].model_copy(update={"id": 1}), MODEL, of_before, 2048) is None
    assert zero_offer(RIGHT, MODEL, None, 2048) is None


@given(
    sign=st.sampled_from([-1, 1]),
    mm_per_turn=st.floats(5.0, 120.0),
    horn=st.integers(-40_000, 40_000),
    lost=st.integers(-3, 3),
    zero=st.integers(-20_000, 20_000),
    moved=st.integers(-1024, 1024),
    restarts=st.booleans(),
    is_feed=st.booleans(),
)
def test_the_offer_is_where_the_joint_truly_is(
    sign: Literal[-1, 1], mm_per_turn: float, horn: int, lost: int, zero: int, moved: int, restarts: bool, is_feed: bool
) -> None:
    """`horn` and `zero` in ticks of a horn that never forgets; the servo counts them from another turn, and from 0..4095 after a
    restart."""
    joint = (ADVANCE if is_feed else RIGHT).model_copy(update={"sign": sign, "mm_per_turn": mm_per_turn})
    register = horn - lost * TICKS_PER_TURN
    before_mm, now_mm = ((at - zero) / joint.ticks_per_mm for at in (horn, horn + moved))
    now = (horn + moved) % TICKS_PER_TURN if restarts else register + moved
    offer = zero_offer(joint, MODEL, kept(joint, register, before_mm), now)
    is_inside = joint.low_mm <= now_mm <= joint.high_mm
    if is_inside:
        assert offer is not None
    assume(offer is not None)
    assert offer.position_mm == pytest.approx(now_mm, abs=1e-6)
    assert offer.moved_mm == pytest.approx(moved / joint.ticks_per_mm, abs=1e-6)
    assert (now - offer.zero_ticks) / joint.ticks_per_mm == pytest.approx(now_mm, abs=1e-6)


@given(horn=st.integers(-40_000, 40_000), moves=st.lists(st.tuples(st.integers(-1024, 1024), st.booleans()), max_size=12))
def test_confirmed_again_and_again_a_zero_never_creeps(horn: int, moves: list[tuple[int, bool]]) -> None:
    """Each time the joint is kept where it then is, and the offer is taken."""
    joint = ADVANCE.model_copy(update={"low_mm": -1000.0, "high_mm": 1000.0})
    true, register, record = horn, horn, kept(joint, horn, 0.0)
    for moved, restarts in moves:
        true += moved
        register = true % TICKS_PER_TURN if restarts else register + moved
        offer = zero_offer(joint, MODEL, record, register)
        assert register - offer.zero_ticks == true - horn, "zero is where it was"
        record = kept(joint, register, offer.position_mm)


# --- what is refused -------------------------------------------------------------------------------------------------------------

OFFER = ZeroOffer("right", 0.42, 0.0, 2005, 1000.0)


@pytest.mark.parametrize(
    ("request_", "offers", "said"),
    [
        (ALL_AT_ZERO, (), ""),
        (ALL_AT_ZERO, (OFFER,), r"right stands \+0\.42 mm from its kept zero: use that, or forget it"),
        (ZeroRequest(positions_mm=ALL_AT_ZERO.positions_mm, forgotten=("right",)), (OFFER,), ""),
        (ZeroRequest(kept=("right",)), (OFFER,), ""),
        (ZeroRequest(kept=("right",), forgotten=("right",)), (OFFER,), "right has no kept zero"),
        (ZeroRequest(kept=("left",)), (OFFER,), "left has no kept zero that fits"),
        (ZeroRequest(positions_mm={"right": 0.3}), (), "right: a tendon is zeroed where its wire is slack"),
        (ZeroRequest(positions_mm={"advance": 40.0}), (ZeroOffer("advance", 38.0, 0.0, 0, 0.0),), ""),  # a feed goes by its number
        (ZeroRequest(positions_mm={"advance": -5.0, "delivery_1": 400.0}), (), ""),
        (ZeroRequest(positions_mm={"advance": 400.1}), (), r"advance cannot be at 400\.1 mm: give -5 to 400 mm"),
        (ZeroRequest(positions_mm={"advance": -5.1}), (), r"advance cannot be at -5\.1 mm: give -5 to 400 mm"),
    ],
)
def test_zeros_that_are_refused_and_why(request_: ZeroRequest, offers: tuple[ZeroOffer, ...], said: str) -> None:
    problem = request_problem(request_, offers, SERVOS)
    assert re.match(said or "$", problem), problem


@pytest.mark.parametrize("wrong", [{"positions_mm": {"advance": float("nan")}}, {"positions_mm": {"Hook!": 0.0}}, {"kept": ("",)}])
def test_a_request_that_is_none_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="ZeroRequest"):
        ZeroRequest.model_validate(wrong)


@pytest.mark.parametrize("key", ["positions_mm", "kept", "forgotten"])
def test_a_joint_that_the_robot_does_not_have_is_named(key: str) -> None:
    request = ZeroRequest.model_validate({key: {"hook": 0.0} if key == "positions_mm" else ("hook",)})
    assert unknown_joint(request, SERVOS).startswith("hook is no joint of this robot: right, left")
    assert unknown_joint(ALL_AT_ZERO, SERVOS) == ""
    assert ALL_AT_ZERO.positions_mm == dict.fromkeys(SERVOS.names, 0.0)


def test_a_file_is_read_as_it_was_written_and_another_one_is_refused() -> None:
    zeros = KeptZeros(joints=tuple(kept(joint, 2048, 0.5) for joint in SERVOS.joints))
    assert KeptZeros.model_validate_json(zeros.model_dump_json()) == zeros
    assert {one.name for one in zeros.joints} >= set(TENDONS)
    for wrong in ('{"format": 2}', '{"joints": [{"name": "right"}]}', "[]"):
        with pytest.raises(ValueError, match="KeptZeros"):
            KeptZeros.model_validate_json(wrong)
