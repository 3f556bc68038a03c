"""Distances from the centerline, room to the wall, contact force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.ui import theme
from app.widgets.distance_bars import ClearanceBar, DistanceBars
from core.types import Centerline, Reason, Refusal, RobotPath, RobotStatus, Scene
from tests.app.fakes import make_pose, make_scene
from tests.app.widgets.conftest import Own, colours_in


def test_bars_show_unsigned_numbers_and_grow_to_their_side(own: Own) -> None:
    bars = own(DistanceBars(6.0), 300, 160)
    assert bars.texts == ("–", "–")
    bars.show_pose(make_pose(head=-14.2, tail=6.1))
    assert bars.texts == ("14.2 px", "6.1 px")
    image = bars.grab().toImage()
    track = [x for x in range(300) if any(image.pixelColor(x, y).name().upper() == theme.D_HEAD for y in range(52, 70))]
    assert track
    assert max(track) <= 150, "left of the middle"
    bars.show_pose(make_pose(head=500.0, tail=1.0))
    bars.grab()
    bars.show_pose(None)
    assert bars.texts == ("–", "–")


MINUS, DASH = "\N{MINUS SIGN}", "\N{EN DASH}"


def wall_scene(offset_px: float, captured_s: float = 0.0) -> Scene:
    """Lumen radius 24 px, robot radius 4 px: 20 px of room on the centerline, the robot lies along it."""
    path = RobotPath(np.array([(10.0, 100.0 + offset_px), (100.0, 100.0 + offset_px)]), 1.0, None, True, 0.0, 4.0)
    line = Centerline(np.array([(50.0, 100.0), (150.0, 100.0)]), (100.0, 100.0), 24.0)
    return replace(make_scene(make_pose(), captured_s=captured_s), path=path, centerline=line)


def force(newton: float | None) -> RobotStatus:
    return RobotStatus(0.0, 0.0, 0.0, (0.0,) * 4, (0.0,) * 4, newton)


@pytest.fixture
def bar(own: Own) -> ClearanceBar:
    return own(ClearanceBar(4.0), 440, 48)


@pytest.mark.parametrize(
    ("offset_px", "text"),
    [(8.0, "Room to the wall  12 px, 3.0 mm"), (22.0, "Room to the wall  0 px, 0.0 mm, at the wall")],
    ids=["plain", "an error of the picture is no negative room"],
)
def test_room_in_pixels_and_millimetres(bar: ClearanceBar, offset_px: float, text: str) -> None:
    bar.show_scene(wall_scene(offset_px), force(None))
    assert bar.text == text
    assert not bar.is_breach


def test_near_the_wall_is_said_at_once_and_until_it_is_clearly_over(bar: ClearanceBar) -> None:
    seen = []
    for offset_px in (10.0, 16.9, 17.1, 16.0, 15.1, 14.9, 19.5, 22.0):
        bar.show_scene(wall_scene(offset_px), None)
        seen.append(bar.text.rpartition(", ")[2] if "wall" in bar.text.rpartition(", ")[2] else "")
    assert seen == ["", "", *["near the wall"] * 3, "", "at the wall", "at the wall"]


def test_breach_is_said_when_it_lasts_and_until_it_is_clearly_over(bar: ClearanceBar) -> None:
    seen = []
    for k, offset_px in enumerate((24.0, 24.0, 24.0, 22.5, 21.6, 21.4)):
        bar.show_scene(wall_scene(offset_px, 0.1 * k), None)
        seen.append(bar.is_breach)
        if k == 2:
            assert bar.text == f"BREACH: the head is in the wall  ({MINUS}4 px, {MINUS}1.0 mm)"
            assert theme.FAULT in colours_in(bar)
    assert seen == [False, False, True, True, True, False]


def test_force_has_words_beyond_its_marks(bar: ClearanceBar) -> None:
    texts = []
    for newton in (0.05, 0.16, 0.14, 0.11, 0.6):
        bar.show_scene(wall_scene(0.0), force(newton))
        texts.append(bar.text.partition("; ")[2])
    assert texts[0] == "Wall force  0.05 N"
    assert texts[1] == "Wall force  0.16 N, leans on the wall"
    assert "leans" in texts[2], "0.14 N is below the mark, but not clearly"
    assert "leans" not in texts[3]
    assert texts[4] == "Wall force  0.60 N, PRESSES TOO HARD"


def test_without_a_pose_the_reason_stands_there(bar: ClearanceBar) -> None:
    for captured_s in (0.0, 0.3):
        bar.show_scene(wall_scene(26.0, captured_s), None)
    assert bar.is_breach
    bar.show_scene(make_scene(refusal=Refusal(Reason.OUTSIDE_VESSEL)), None)
    assert bar.text == "Room to the wall: robot is outside the vessel"
    assert not bar.is_breach
    bar.show_scene(None, None)
    assert bar.text == "Room to the wall: not known"
