"""The pose state, its reason and how sure it is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.ui import theme
from app.widgets.state_badge import StateBadge
from core.config.models import PoseConfig
from core.types import PoseState, Reason, Refusal
from tests.app.fakes import make_pose, make_scene
from tests.app.widgets.conftest import Own, colours_in

LIMITS = PoseConfig()


@pytest.mark.parametrize("state", list(PoseState))
def test_badge_shows_letter_title_and_colour_of_the_state(own: Own, state: PoseState) -> None:
    badge = own(StateBadge(LIMITS, 0.5))
    badge.resize(480, badge.height())
    badge.show_scene(make_scene(make_pose(state)))
    assert badge.letter == state.value
    assert badge.accessibleDescription().startswith(f"{state.value}: {badge.title}")
    assert theme.STATE_COLOUR[state].upper() in colours_in(badge)


def test_badge_shows_a_dash_and_the_reason_without_a_pose(own: Own) -> None:
    badge = own(StateBadge(LIMITS, 0.5))
    badge.show_scene(make_scene(make_pose()))
    badge.show_scene(make_scene(refusal=Refusal(Reason.OUTSIDE_VESSEL, "41 % inside, 60 % needed")), renew_text=False)
    assert (badge.letter, badge.title) == ("-", "Robot is outside the vessel")
    assert badge.why.endswith("41 % inside, 60 % needed")


def _shown(badge: StateBadge, confidence: float, *, renew_text: bool = True) -> tuple[bool, str]:
    badge.show_scene(make_scene(replace(make_pose(PoseState.D), confidence=confidence)), renew_text=renew_text)
    return badge.is_unsure, badge.sureness


def test_badge_says_how_sure_it_is_and_leaves_the_shape_of_an_unsure_state_open(own: Own) -> None:
    badge = own(StateBadge(LIMITS, 0.5))
    badge.resize(480, badge.height())
    assert _shown(badge, 0.974) == (False, "97 % sure")
    filled = _share_of(badge, theme.STATE_COLOUR[PoseState.D])
    assert _shown(badge, 1.0) == (False, "99 % sure"), "nothing is as sure as 100 %"
    assert _shown(badge, 0.499) == (True, "unsure: 49 %")
    assert badge.accessibleDescription().startswith("D: Crossed (unsure: 49 %). ")
    assert 0 < _share_of(badge, theme.STATE_COLOUR[PoseState.D]) < filled / 3
    badge.show_scene(make_scene(refusal=Refusal(Reason.NO_ROBOT)))
    assert (badge.is_unsure, badge.sureness) == (False, "")
    assert _shown(badge, 0.52) == (False, "52 % sure"), "a refusal resets it"


def test_the_limit_decides_whether_a_badge_is_unsure_and_nothing_that_was_before(own: Own) -> None:
    badge = own(StateBadge(LIMITS, 0.57))
    assert _shown(badge, 0.57) == (False, "57 % sure"), "0.57 is a little less than that in binary"
    assert _shown(badge, 0.569) == (True, "unsure: 56 %")
    assert _shown(badge, 0.57) == (False, "57 % sure")
    assert _shown(badge, 0.1, renew_text=False) == (False, "57 % sure"), "texts are renewed together"
    badge.set_limits(LIMITS, 0.8)
    assert _shown(badge, 0.79)[0]


def _share_of(badge: StateBadge, colour: str) -> int:
    image = badge.grab().toImage()
    pixels = ((x, y) for x in range(image.width()) for y in range(image.height()))
    return sum(image.pixelColor(x, y).name().upper() == colour.upper() for x, y in pixels)
