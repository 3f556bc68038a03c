"""What the picture is: simulated, live or recorded."""

from __future__ import annotations

import pytest
from pytestqt.qtbot import QtBot

from app.widgets.sim_banner import SimBanner
from hardware.rig import RigKind


@pytest.mark.parametrize("kind", list(RigKind))
def test_banner_says_what_the_picture_is(qtbot: QtBot, kind: RigKind) -> None:
    banner = SimBanner(kind)
    qtbot.addWidget(banner)
    banner.resize(500, 34)
    banner.grab()
    assert banner.word == kind.value
    assert banner.accessibleName().startswith(kind.value)


def test_a_live_rig_without_servos_does_not_claim_that_they_move(qtbot: QtBot) -> None:
    banner = SimBanner(RigKind.LIVE, has_servos=False)
    qtbot.addWidget(banner)
    assert banner.word == "LIVE"
    assert "no servos" in banner.accessibleName()
