"""The advice, or why it is missing."""

from __future__ import annotations

from app.widgets.advice_line import AdviceLine
from core.types import Advice, PoseState, Speed
from tests.app.widgets.conftest import Own


def test_advice_on_a_pose_that_is_unsure_says_so(own: Own) -> None:
    line = own(AdviceLine())
    advice = Advice(Speed.SLOWEST, 1.0, -18.4, "moving away")
    line.show_advice(advice, PoseState.C, "", is_unsure=True)
    assert line.text == line.accessibleDescription() == "Slowest, 18° left: the pose is unsure; moving away"
    line.show_advice(advice, PoseState.C, "")
    assert line.text == "Slowest, 18° left: moving away"


def test_advice_is_blank_with_a_reason_when_there_is_none(own: Own) -> None:
    line = own(AdviceLine())
    line.show_advice(Advice(Speed.SLOWEST, 1.0, -18.4, "moving away"), PoseState.C, "")
    assert line.text == "Slowest, 18° left: moving away"
    line.show_advice(None, None, "no robot in view", renew_text=False)
    assert line.text == "No advice: no robot in view"
