"""What the picture is: simulated, live or recorded."""

from __future__ import annotations

import pytest

from app.widgets.sim_banner import SimBanner
from hardware.rig import RigKind
from tests.app.widgets.conftest import Own


@pytest.mark.parametrize("kind", list(RigKind))
def test_banner_says_what_the_picture_is(own: Own, kind: RigKind) -> None:
    banner = own(SimBanner(kind), 500, 34)
    banner.grab()
    assert banner.word == kind.value
    assert banner.accessibleName().startswith(kind.value)


def test_a_live_rig_without_servos_does_not_claim_that_they_move(own: Own) -> None:
    banner = own(SimBanner(RigKind.LIVE, has_servos=False))
    assert banner.word == "LIVE"
    assert "no servos" in banner.accessibleName()
