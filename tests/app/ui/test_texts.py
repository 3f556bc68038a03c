"""Plain words: what the operator reads must follow from the values, and every case must have a text."""

from __future__ import annotations

import pytest

from app.ui.texts import (
    REASON_TEXT,
    SPEED_WORD,
    STATE_MEANING,
    STATE_TITLE,
    advice_headline,
    refusal_line,
    tip,
    why_line,
)
from core.config.models import PoseConfig
from core.types import Advice, PoseState, Reason, Refusal, Speed
from tests.app.fakes import make_pose

LIMITS = PoseConfig()


def words(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize(
    ("state", "theta", "head", "tail", "expected"),
    [
        (PoseState.A, 4.4, 3.0, -2.0, "d_head 3 px, d_tail 2 px (allowed 6), theta 4° right (allowed 10°)"),
        (PoseState.B, -12.0, 8.0, 14.0, "to the centerline: d_head 8 px < d_tail 14 px, theta 12° left"),
        (PoseState.C, 18.4, 14.2, 6.1, "from the centerline: d_head 14 px > d_tail 6 px, theta 18° right"),
        (PoseState.C, 18.4, 14.2, 14.1, "from the centerline: d_head 14.2 px > d_tail 14.1 px, theta 18° right"),
        (PoseState.D, -21.0, -9.0, 7.0, "head 9 px left, tail 7 px right of the centerline, theta 21° left"),
    ],
)
def test_why_line_gives_the_values_that_decided(state: PoseState, theta: float, head: float, tail: float, expected: str) -> None:
    assert words(why_line(make_pose(state, theta=theta, head=head, tail=tail), LIMITS)) == expected


def test_why_line_owns_up_to_hysteresis() -> None:
    kept = make_pose(PoseState.B, theta=5.0, head=8.2, tail=8.0)
    assert words(why_line(kept, LIMITS)) == "to the centerline: d_head 8.2 px > d_tail 8.0 px, theta 5° right (kept for a moment)"


def test_every_case_has_a_text() -> None:
    assert set(REASON_TEXT) == set(Reason)
    assert set(STATE_TITLE) == set(STATE_MEANING) == set(PoseState)
    assert set(SPEED_WORD) == set(Speed)


def test_refusal_says_what_to_do_and_what_was_measured() -> None:
    assert refusal_line(Refusal(Reason.NO_ROBOT)) == "Advance the robot into the picture"
    line = refusal_line(Refusal(Reason.BLURRED, "sharpness 3 of 40"))
    assert line == "Focus the camera or hold it still. sharpness 3 of 40"


@pytest.mark.parametrize(
    ("speed", "steer", "expected"),
    [
        (Speed.FAST, 0.0, "Fast, straight"),
        (Speed.SLOWEST, -18.4, "Slowest, 18° left"),
        (Speed.MODERATE, 7.6, "Moderate, 8° right"),
        (Speed.SLOW, 0.4, "Slow, straight"),
    ],
)
def test_advice_headline(speed: Speed, steer: float, expected: str) -> None:
    assert advice_headline(Advice(speed, 1.0, steer, "")) == expected


def test_a_tip_names_quantity_and_unit() -> None:
    assert tip("theta").startswith("theta (degrees): Angle between")
    assert tip("d_head", "d_tail").count("(working px)") == 2
