"""The scripted hand: which lines it draws, and that it outlines a vessel of the twin with few events."""

from __future__ import annotations

import numpy as np
import pytest

from core.annotation.outline import VesselOutline
from core.types import Mask
from tools.outline_hand import ScriptedHand, dice, true_lines, twin_picture


def cross() -> Mask:
    """A trunk from left to right with a branch downwards."""
    mask = np.zeros((240, 320), bool)
    mask[90:111] = True
    mask[100:, 150:165] = True
    return mask


def test_the_trunk_comes_first_and_a_branch_begins_at_it() -> None:
    trunk, branch = true_lines(cross())
    assert abs(trunk.points[-1, 0] - trunk.points[0, 0]) > 290.0
    assert np.hypot(*(branch.points[0] - (157.0, 100.0))) < 12.0 and branch.points[-1, 1] > 220.0


@pytest.mark.parametrize("with_proposal", [False, True])
def test_a_vessel_is_outlined_within_forty_events(with_proposal: bool) -> None:
    image, truth = twin_picture(7018, "fluoroscopy")
    proposal = truth.copy()
    proposal[:, 400:] = False
    hand = ScriptedHand(VesselOutline(image, proposal if with_proposal else None), truth)
    if not with_proposal:
        hand.draw_all()
    hand.correct()
    assert hand.events <= 40
    assert dice(hand.outline.mask, truth) >= 0.95
