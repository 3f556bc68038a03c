"""Random changes of labelled frames during training: geometry for image and masks alike, looks for the image alone."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import Generator

from core.types import Image, Mask


def random_crop(image: Image, vessel: Mask, robot: Mask, size: tuple[int, int], rng: Generator) -> tuple[Image, Mask, Mask]:
    """A turned, scaled, perhaps mirrored cut-out of `size` (height, width), in one warp so that nothing is blurred twice.

    Most cuts are centred near the robot's ends or body: the robot is one or two percent of the pixels.
    """
    height, width = size
    center = _center(robot, rng)
    scale = float(np.exp(rng.uniform(np.log(0.75), np.log(1.35))))
    angle = rng.choice((0.0, 90.0, 180.0, 270.0)) + (rng.uniform(-45, 45) if rng.random() < 0.5 else 0.0)
    matrix = cv2.getRotationMatrix2D((float(center[0]), float(center[1])), angle, scale)
    if rng.random() < 0.5:
        matrix[0, :2] = -matrix[0, :2]  # the shift is set below
    target = np.array([width, height]) * (0.5 + rng.uniform(-0.25, 0.25, 2))
    moved = matrix @ np.array([center[0], center[1], 1.0])
    matrix[:, 2] += target - moved
    # What lies beyond the picture is one colour without labels; mirrored, robots would meet their own reflection.
    fill = tuple(float(v) for v in image[int(rng.integers(image.shape[0])), int(rng.integers(image.shape[1]))])
    cut = cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=fill)
    masks = [
        cv2.warpAffine(m.astype(np.uint8) * 255, matrix, (width, height), flags=cv2.INTER_LINEAR) > 127 for m in (vessel, robot)
    ]
    return np.asarray(cut, np.uint8), np.asarray(masks[0]), np.asarray(masks[1])


def _center(robot: Mask, rng: Generator) -> tuple[float, float]:
    height, width = robot.shape
    if rng.random() < 0.65:
        rows, columns = np.nonzero(robot)
        if len(rows):
            pick = int(rng.integers(len(rows)))
            return float(columns[pick]), float(rows[pick])
    return float(rng.uniform(0.2, 0.8) * width), float(rng.uniform(0.2, 0.8) * height)


def with_strips(image: Image, vessel: Mask, robot: Mask, rng: Generator) -> Image:
    """`image` with one or two clips across the lumen, most of them over the robot and more often near its ends than on its body.

    The labels stay: robot and lumen go on beneath. Of the twin's own clips few lie where the robot happens to be.
    """
    painted = image.copy()
    for _ in range(int(rng.integers(1, 3))):
        under = robot if rng.random() < 0.75 and robot.any() else vessel
        found = np.argwhere(under)[:, ::-1]
        if not len(found):
            break
        some = found[rng.integers(len(found), size=6)].astype(float)
        far = np.linalg.norm(some - found.mean(axis=0), axis=1)
        middle = some[int(np.argmax(far))] if rng.random() < 0.5 else some[0]
        _strip(painted, middle + rng.normal(0, 4, 2), _across(found, middle) + rng.normal(0, 0.3), rng)
    return painted


def _across(found: np.ndarray, middle: np.ndarray) -> float:
    """The angle in radians at a right angle to what lies near `middle`; `found` (N, 2) in px."""
    near = found[np.linalg.norm(found - middle, axis=1) < 25] - middle
    if len(near) < 3:
        return 0.0
    along = np.linalg.eigh(near.T @ near)[1][:, 1]
    return float(np.arctan2(along[0], -along[1]))


def _strip(image: Image, middle: np.ndarray, angle: float, rng: Generator) -> None:
    """Paint a half see-through rectangle with a rim, a raised middle and a bit of shadow into `image`."""
    tone = rng.uniform(0.1, 1.0) * np.ones(3) if rng.random() < 0.7 else rng.uniform(0.1, 0.95, 3)
    opacity, shade = rng.uniform(0.35, 0.92), rng.uniform(0.6, 1.0)
    half = np.array([rng.uniform(14, 40), rng.uniform(4, 12)])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])

    def corners(share: tuple[float, float], shift: float = 0.0) -> np.ndarray:
        box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half * share @ turn + middle + shift
        return np.asarray(np.rint(box * 16).astype(np.int32))

    shadow = np.ones(image.shape[:2], np.float32)
    cv2.fillPoly(shadow, [corners((1, 1), rng.uniform(-3, 3))], float(shade), cv2.LINE_AA, 4)
    paint: np.ndarray = image * shadow[:, :, None]
    cover = np.zeros(image.shape[:2], np.float32)
    color = np.zeros(image.shape, np.float32)
    for share, lightness in (((1.0, 1.0), 1.0), ((0.96, 0.45), rng.uniform(0.9, 1.2))):
        level = tuple(float(v) for v in np.clip(255 * tone * lightness, 0, 255))
        cv2.fillPoly(cover, [corners(share)], opacity, cv2.LINE_AA, 4)
        cv2.fillPoly(color, [corners(share)], level, cv2.LINE_AA, 4)
    cv2.polylines(color, [corners((1, 1))], True, tuple(float(v) for v in 150 * tone), 1, cv2.LINE_AA, 4)
    paint += (color - paint) * cover[:, :, None]
    image[:] = np.clip(paint, 0, 255).astype(np.uint8)


def random_look(image: Image, rng: Generator) -> Image:
    """Exposure, contrast, gamma, white balance, uneven light, blur, noise and compression, each now and then."""
    pixels: np.ndarray = image.astype(np.float32) / 255.0
    if rng.random() < 0.7:
        mean = float(pixels.mean())
        pixels = (pixels - mean) * rng.uniform(0.65, 1.4) + mean + rng.uniform(-0.15, 0.15)
    if rng.random() < 0.5:
        pixels = pixels * rng.uniform(0.85, 1.15, 3).astype(np.float32)
    if rng.random() < 0.12:
        pixels = np.repeat(pixels.mean(axis=2, keepdims=True), 3, axis=2)
    elif rng.random() < 0.12:
        pixels = pixels[:, :, rng.permutation(3)]
    if rng.random() < 0.4:
        pixels = np.clip(pixels, 0, 1) ** np.float32(np.exp(rng.uniform(-0.5, 0.5)))
    if rng.random() < 0.3:
        pixels = pixels * _uneven_light(pixels.shape[:2], rng)[:, :, None]
    if rng.random() < 0.25:
        pixels = cv2.GaussianBlur(pixels, (0, 0), float(rng.uniform(0.4, 1.3)))
    if rng.random() < 0.35:
        pixels = pixels + rng.normal(0, rng.uniform(0.005, 0.04), pixels.shape).astype(np.float32)
    result = np.asarray((np.clip(pixels, 0, 1) * 255).astype(np.uint8))
    if rng.random() < 0.15:
        data = cv2.imencode(".jpg", result, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(35, 90))])[1]
        result = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))
    return result


def _uneven_light(shape: tuple[int, int], rng: Generator) -> np.ndarray:
    coarse = rng.uniform(0.6, 1.3, (4, 4)).astype(np.float32)
    return np.asarray(cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC))


def random_clutter(size: tuple[int, int], rng: Generator) -> Image:
    """A picture with neither vessel nor robot: plain, noisy or striped boards, blobs, cables, boxes. Its masks are empty."""
    height, width = size
    image = np.full((height, width, 3), rng.integers(0, 256, 3), np.float32)
    if rng.random() < 0.6:
        image += cv2.resize(
            rng.normal(0, rng.uniform(5, 60), (6, 6, 3)).astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC
        )
    for _ in range(int(rng.integers(0, 9))):
        color = tuple(float(c) for c in rng.integers(0, 256, 3))
        points = np.cumsum(rng.normal(0, 60, (8, 2)), axis=0) + rng.uniform(0, (width, height))
        kind = rng.random()
        if kind < 0.5:
            curve = cv2.resize(points.astype(np.float32).reshape(8, 1, 2), (1, 160), interpolation=cv2.INTER_CUBIC).reshape(
                -1, 1, 2
            )
            cv2.polylines(image, [curve.astype(np.int32)], False, color, int(rng.integers(1, 14)), cv2.LINE_AA)
        elif kind < 0.75:
            cv2.fillPoly(image, [points.astype(np.int32)], color, cv2.LINE_AA)
        else:
            cv2.circle(
                image,
                (int(points[0, 0]), int(points[0, 1])),
                int(rng.integers(3, 90)),
                color,
                int(rng.choice([-1, 2, 5])),
                cv2.LINE_AA,
            )
    image += rng.normal(0, rng.uniform(0, 12), image.shape)
    return np.asarray(np.clip(image, 0, 255).astype(np.uint8))
