"""Lines followed through a clip: a moving robot, from the nearest drawn picture, until it is stopped."""

import math

import cv2
import numpy as np
import pytest

from core.annotation.follow import followed_lines
from core.annotation.model import Annotation
from core.types import Image

BACKGROUND = cv2.GaussianBlur(np.random.default_rng(1).integers(60, 200, (160, 200, 3), np.uint8), (0, 0), 2.0)
VESSEL = ((20.0, 100.0), (180.0, 100.0))


def robot_line(number: int) -> tuple[tuple[float, float], tuple[float, float]]:
    """It moves by a pixel a picture to the right, and turns by 1.5 degrees."""
    angle = math.radians(-1.5 * number)
    head = 110.0 + number, 90.0
    return (head[0] - 60.0 * math.cos(angle), head[1] - 60.0 * math.sin(angle)), head


def picture(number: int) -> Image:
    image = BACKGROUND.copy()
    tail, head = np.array(robot_line(number))
    cv2.line(
        image, np.round(tail * 16).astype(int).tolist(), np.round(head * 16).astype(int).tolist(), (20, 20, 30), 9, cv2.LINE_AA, 4
    )
    for share in (0.2, 0.45, 0.7, 0.95):  # bands
        at = tail + share * (head - tail)
        cv2.circle(image, np.round(at * 16).astype(int).tolist(), 3 * 16, (230, 220, 120), -1, cv2.LINE_AA, 4)
    return image


def turned(line: object) -> float:
    points = np.asarray(line)
    step = points[-1] - points[0]
    return math.degrees(math.atan2(step[1], step[0]))


def test_the_robot_is_followed_forwards_and_backwards_and_the_vessel_stays() -> None:
    found = {place: (robot, vessel) for place, robot, vessel in followed_lines(picture, {6: Annotation(robot_line(6), VESSEL)}, 13)}
    assert sorted(found) == [place for place in range(13) if place != 6]
    for place, (robot, vessel) in found.items():
        assert vessel == VESSEL
        assert math.dist(robot[-1], robot_line(place)[-1]) < 3.0, place
        assert turned(robot) == pytest.approx(turned(robot_line(place)), abs=2.0), place


def test_each_picture_is_followed_from_the_nearest_drawn_one() -> None:
    """The second drawing is 10 px too low on purpose: what follows from it tells."""
    low = tuple((x, y + 10.0) for x, y in robot_line(12))
    read: list[int] = []

    def logged(number: int) -> Image:
        read.append(number)
        return picture(number)

    keys = {2: Annotation(robot_line(2), VESSEL), 12: Annotation(low, ((0.0, 0.0), (9.0, 9.0)))}
    found = {place: vessel for place, _, vessel in followed_lines(logged, keys, 14)}
    assert [place for place, vessel in found.items() if vessel == VESSEL] == [3, 4, 5, 6, 7, 1, 0]
    assert sorted(place for place, vessel in found.items() if vessel != VESSEL) == [8, 9, 10, 11, 13]
    assert len(read) < 14 + 4, "each picture is read once, the drawn ones once more a way"


def test_it_can_be_stopped_and_bears_lines_beside_the_picture() -> None:
    left = iter([True, True, False])
    keys = {0: Annotation(((-500.0, -500.0), (-460.0, -500.0)), VESSEL)}
    found = list(followed_lines(picture, keys, 10, lambda: next(left)))
    assert [place for place, *_ in found] == [1, 2]
    assert list(followed_lines(picture, {0: Annotation(vessel=VESSEL)}, 3)) == [], "no robot to follow"
