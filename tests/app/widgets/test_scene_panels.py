"""The advice, or why it is missing."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QRect
from PySide6.QtGui import QImage

from app.widgets.scene_panels import AdviceLine
from app.widgets.state_badge import StateBadge
from core.config.models import PoseConfig
from core.types import Advice, PoseState, Speed
from tests.app.fakes import make_pose, make_scene
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


@pytest.mark.parametrize(
    ("state", "advice", "says"),
    [
        (PoseState.A, Advice(Speed.FAST, 8.0, 0.4, "along the route"), ""),
        (PoseState.B, Advice(Speed.SLOW, 3.0, 0.0, "coming back"), ""),
        (PoseState.C, Advice(Speed.SLOWEST, 1.0, -18.0, "moving away"), ""),
        (PoseState.D, Advice(Speed.MODERATE, 5.0, 9.0, "crossed"), ""),
        (PoseState.B, Advice(Speed.FAST, 8.0, -1.0, "along the route"), "the route decides, not state B (slow, no steering)"),
        (PoseState.A, Advice(Speed.FAST, 8.0, 2.0, "along the route"), "the route decides, not state A (fast, no steering)"),
        (PoseState.D, Advice(Speed.FAST, -8.0, 9.0, "backing off"), "the route decides, not state D (moderate, steer)"),
        (PoseState.C, Advice(Speed.STOP, 0.0, 0.0, "at the target"), "the route decides, not state C (slowest, steer)"),
    ],
)
def test_where_the_route_decides_and_not_the_state_badge_and_advice_say_so_together(
    own: Own, state: PoseState, advice: Advice, says: str
) -> None:
    """The badge's tool tip said "slow down, no steering" beside "Fast, 1° left"."""
    line, badge = own(AdviceLine()), own(StateBadge(PoseConfig(), 0.8))
    line.show_advice(advice, state, "")
    badge.show_scene(make_scene(make_pose(state)), advice)
    assert line.text.endswith(f"{advice.why}; {says.partition(' (')[0]}" if says else advice.why)
    assert badge.why.endswith(says)
    assert ("the route decides" in badge.why) is bool(says)
    assert "badge and advice say so" in badge.toolTip()


def _ink(advice: Advice, own: Own) -> list[QImage]:
    """Arrow and chevrons as painted, apart."""
    line = own(AdviceLine())
    line.resize(600, 68)
    line.show_advice(advice, PoseState.C, "")
    picture = line.grab().toImage()
    return [picture.copy(QRect(20, 4, 58, 60)), picture.copy(QRect(86, 4, 76, 60))]


def _weight(image: QImage) -> float:
    """Where the ink lies, from 0 at the upper edge to 1 at the lower one."""
    back = image.pixel(0, 0)
    rows = [y for y in range(image.height()) for x in range(image.width()) if image.pixel(x, y) != back]
    return sum(rows) / len(rows) / image.height()


def test_backing_off_is_drawn_downwards_as_its_key_is(own: Own) -> None:
    """It was drawn with the arrow of advancing, and chevrons that read as "left"."""
    forward, back = Advice(Speed.FAST, 8.0, 0.0, ""), Advice(Speed.FAST, -8.0, 0.0, "")
    for ahead, behind in zip(_ink(forward, own), _ink(back, own), strict=True):
        assert ahead != behind
    assert _weight(_ink(forward, own)[0]) < _weight(_ink(back, own)[0]), "the arrow's head is its heaviest part"
