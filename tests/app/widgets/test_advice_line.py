"""The advice, or why there is none."""

from __future__ import annotations

import pytest
from pytestqt.qtbot import QtBot

from app.widgets.advice_line import AdviceLine
from core.types import Advice, PoseState, Speed


def test_advice_on_a_pose_that_is_unsure_says_so(qtbot: QtBot) -> None:
    line = AdviceLine()
    qtbot.addWidget(line)
    advice = Advice(Speed.SLOWEST, 1.0, -18.4, "moving away")
    line.show_advice(advice, PoseState.C, "", is_unsure=True)
    assert line.text == line.accessibleDescription() == "Slowest, 18° left: the pose is unsure; moving away"
    line.show_advice(advice, PoseState.C, "")
    assert line.text == "Slowest, 18° left: moving away"


def test_advice_is_blank_with_a_reason_when_there_is_none(qtbot: QtBot) -> None:
    line = AdviceLine()
    qtbot.addWidget(line)
    line.show_advice(Advice(Speed.SLOWEST, 1.0, -18.4, "moving away"), PoseState.C, "")
    assert line.text == "Slowest, 18° left: moving away"
    line.show_advice(None, None, "no robot in view", renew_text=False)
    assert line.text == "No advice: no robot in view"


@pytest.mark.parametrize("speed", list(Speed))
def test_advice_paints_every_speed(qtbot: QtBot, speed: Speed) -> None:
    line = AdviceLine()
    qtbot.addWidget(line)
    line.resize(700, 68)
    line.show_advice(Advice(speed, 1.0, 200.0, "a reason " * 40), PoseState.D, "")
    assert not line.grab().isNull()
