"""Pictures of a drawn bench: a board with structure, a forked lumen, and a robot that comes from the left border."""

import cv2
import numpy as np

from core.learning.teaching import TeachingPicture
from core.types import Image, Mask

SIZE = (320, 240)
"""Width and height."""
_TRUNK = np.array([[-5, 120], [60, 118], [120, 122], [160, 120]], np.float64)
_BRANCHES = (np.array([[200, 95], [240, 70], [290, 50]], np.float64), np.array([[200, 145], [240, 170], [290, 190]], np.float64))


def _line(points: np.ndarray, width: int) -> Mask:
    mask = np.zeros(SIZE[::-1], np.uint8)
    cv2.polylines(mask, [np.rint(points).astype(np.int32)], False, 1, width)
    return mask > 0


def _course(branch: int) -> np.ndarray:
    points = np.vstack([_TRUNK, _BRANCHES[branch]])
    pieces = [np.linspace(a, b, 60)[:-1] for a, b in zip(points, points[1:], strict=False)]
    return np.vstack([*pieces, points[-1:]])


def toy_vessel() -> Mask:
    """The lumen, bool (240, 320)."""
    return _line(_course(0), 26) | _line(_course(1), 26)


def toy_robot(branch: int, share: float) -> Mask:
    """The robot in one of two branches, inserted by a share of their length."""
    course = _course(branch)
    return _line(course[: max(2, int(share * len(course)))], 6)


def toy_picture(robot: Mask | None = None, *, seed: int = 0, board: int = 0) -> Image:
    """The bench with a robot, RGB; `seed` draws the noise, `board` the structure of the board."""
    rng = np.random.default_rng(1000 + board)
    coarse = cv2.resize(rng.normal(0, 26, (30, 40)).astype(np.float32), SIZE, interpolation=cv2.INTER_CUBIC)
    picture = np.repeat((120 + coarse)[:, :, None], 3, axis=2)
    picture[toy_vessel()] = picture[toy_vessel()] * 0.4 + 110
    if robot is not None:
        picture[robot] = (30, 40, 60)
    picture = cv2.GaussianBlur(picture, (0, 0), 0.6) + np.random.default_rng(seed).normal(0, 1.5, picture.shape)
    return np.asarray(np.clip(picture, 0, 255), np.uint8)


def toy_stream(count: int) -> list[TeachingPicture]:
    """`count` pictures of a robot that is pushed into one branch and then into the other."""
    pictures = []
    for index in range(count):
        branch, share = index * 2 // count, 0.35 + 0.6 * (index % (count // 2)) / (count // 2)
        robot = toy_robot(branch, share)
        pictures.append(TeachingPicture(f"picture {index}", f"{index:03d}", toy_picture(robot, seed=index)))
    return pictures
