"""A vessel's walls beside a line drawn by hand: the tube of a drag along the middle, snapped to the edges on both of its sides.

The picture is straightened along the drag. Both walls are then found together, as the cheapest pair of lines: on strong edges, near
where they were drawn, changing little along the way. Where one wall is faint, the other one and the drawn width carry it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.types import Image, Mask, Points

FloatArray = NDArray[np.float64]

_STEP = 1 / 6
"""Distance of the places along the way, in radii."""
_SAMPLE = 0.05
"""Distance of the samples across the way, in radii."""
_NARROWEST, _WIDEST, _CELL = 0.5, 1.5, 0.075
"""Where a wall may lie, in drawn radii from the line, and the distance of these places."""
_RADIUS_PX = 20.0
"""A vessel of a larger radius is looked at in a picture that is scaled down until it has this one."""
_SLACK_PX = 4.0
"""A wall this far from where it was drawn, on a picture 640 px long, costs as much as an edge of full strength saves."""
_UNCLEAR, _CLEAR, _CLEAR_GAIN = 0.88, 0.97, 3.0
"""Where walls are the only edges, they may lie farther from where they were drawn: the gain grows between these shares of the
strongest edge among all. A tube with an inner and an outer wall, and reflections, has .5 to .8."""
_TURN_COST, _GROWTH_COST = 40.0, 80.0
"""Cost of the change of the middle, or of the half width, from place to place, per squared radius."""
_BEFORE_RADII, _AFTER_RADII = 0.6, 0.8
"""Over so many radii the drawn line, and the found walls, are smoothed."""
_TYPICAL_PERCENT = 60.0
"""This percentile of the strongest edge beside each place counts as full strength."""


@dataclass(frozen=True, slots=True, eq=False)
class Tube:
    """Vessel along a line: ``middle`` (N, 2) and ``radius`` (N,), in pixels; its area is the union of the discs."""

    middle: Points
    radius: FloatArray

    def area(self, size: tuple[int, int]) -> Mask:
        """The mask (H, W) of it in a picture of `size` (width, height)."""
        mask = np.zeros((size[1], size[0]), np.uint8)
        bits = 4  # a sixteenth of a pixel
        fixed = np.round(np.column_stack([self.middle, np.maximum(self.radius, 0.0)]) * (1 << bits)).astype(int)
        for x, y, radius in fixed.tolist():
            cv2.circle(mask, (x, y), radius, 1, -1, cv2.LINE_8, bits)
        return mask.view(np.bool_)


def drawn_tube(stroke: Points, radius_px: FloatArray) -> Tube:
    """The tube as the hand drew it, with a point every sixth of its least radius.

    Parameters
    ----------
    stroke : where the hand went, (N, 2) px.
    radius_px : the drawn radius (N,) at each of these points.
    """
    along = geometry.arc_length(stroke)
    step = max(float(radius_px.min()) * _STEP, 0.5)
    if along[-1] < step:
        return Tube(stroke[-1:].copy(), radius_px[-1:].copy())
    points = geometry.resample(stroke, step)
    moved = np.concatenate([[True], np.diff(along) > 0])
    return Tube(points, np.interp(np.linspace(0.0, along[-1], len(points)), along[moved], radius_px[moved]))


def snapped_tube(image: Image, stroke: Points, radius_px: FloatArray, taken: Mask | None = None) -> Tube:
    """The vessel along a drag; beyond the border of the picture where an end of the drag is nearer to it than a radius.

    Parameters
    ----------
    image : RGB (H, W, 3).
    stroke : where the hand went, (N, 2) px, along the middle of the vessel.
    radius_px : the drawn radius (N,) at each of these points.
    taken : (H, W), what is vessel already; walls are not looked for in there.
    """
    tube = drawn_tube(stroke, radius_px)
    if len(tube.middle) < 4:
        return tube
    tube = _led_out(_smoothed(tube, _BEFORE_RADII), (image.shape[1], image.shape[0]))
    slack_px = _SLACK_PX * max(image.shape[:2]) / 640.0
    scale = min(1.0, _RADIUS_PX / float(np.median(tube.radius)))
    if scale < 1.0:
        image = np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        if taken is not None:
            taken = cv2.resize(taken.view(np.uint8), image.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0
        tube = Tube((tube.middle + 0.5) * scale - 0.5, tube.radius * scale)
    tube = _smoothed(_fitted(image, tube, taken, slack_px * scale), _AFTER_RADII)
    return tube if scale == 1.0 else Tube((tube.middle + 0.5) / scale - 0.5, tube.radius / scale)


def _smoothed(tube: Tube, radii: float) -> Tube:
    """Line and radius smoothed over so many radii."""
    sigma = radii / _STEP
    middle = geometry.smooth(tube.middle, sigma, keeps_bends=True)
    radius = cv2.GaussianBlur(tube.radius.reshape(-1, 1), (0, 0), sigmaX=1e-3, sigmaY=sigma, borderType=cv2.BORDER_REPLICATE)
    return Tube(middle, np.asarray(radius, np.float64).ravel())


def _led_out(tube: Tube, size: tuple[int, int]) -> Tube:
    """Continued straight across the border of the picture where an end is near it and runs towards it."""
    middle, radius = tube.middle, tube.radius
    limit = np.array([size[0] - 1.0, size[1] - 1.0])
    for _ in range(2):
        middle, radius = middle[::-1], radius[::-1]
        step = middle[-1] - middle[max(0, len(middle) - 1 - round(1.0 / _STEP))]
        length = float(np.hypot(*step))
        if length == 0.0:
            continue
        reach = float(radius[-1])
        ahead = middle[-1] + step * (reach / length)
        if np.any(ahead < 0.0) or np.any(ahead > limit):
            count = round(2.5 / _STEP)
            more = middle[-1] + step / length * (np.arange(1, count + 1) * _STEP * reach)[:, None]
            middle, radius = np.concatenate([middle, more]), np.concatenate([radius, np.full(count, reach)])
    return Tube(middle, radius)


def _fitted(image: Image, tube: Tube, taken: Mask | None, slack_px: float) -> Tube:
    """The tube with both of its walls on edges of the picture."""
    normals, radius = geometry.normals(tube.middle), float(np.median(tube.radius))
    reach = _WIDEST + 0.5
    across = np.arange(-reach, reach + 1e-9, _SAMPLE)
    places = tube.middle[:, None] + normals[:, None] * (across[None, :, None] * tube.radius[:, None, None])
    x, y = places[..., 0].astype(np.float32), places[..., 1].astype(np.float32)
    smooth = cv2.GaussianBlur(image.astype(np.float32) / 255.0, (0, 0), 0.7)
    lab = cv2.cvtColor(smooth, cv2.COLOR_RGB2LAB)  # equal steps look equally large
    strength = _edges(cv2.remap(lab, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), radius)
    height, width = image.shape[:2]
    hidden = (x < 0) | (y < 0) | (x > width - 1) | (y > height - 1)
    if taken is not None:
        inner = cv2.erode(taken.view(np.uint8), np.ones((5, 5), np.uint8))  # its own border is a wall
        hidden |= cv2.remap(inner, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT) > 0
    strength[hidden] = 0.0
    steps = np.arange(_NARROWEST, _WIDEST + 1e-9, _CELL)
    columns = np.arange(len(across), dtype=np.float64)
    left, right = (np.stack([np.interp((side * steps + reach) / _SAMPLE, columns, row) for row in strength]) for side in (-1, 1))
    clear = float(np.mean([_clearness(side) for side in (left, right)]))
    slack_px *= 1.0 + _CLEAR_GAIN * min(max((clear - _UNCLEAR) / (_CLEAR - _UNCLEAR), 0.0), 1.0)
    to_left, to_right = _walls(left, right, steps, slack_px / radius)
    shift, half = 0.5 * (to_right - to_left), 0.5 * (to_right + to_left)
    return Tube(tube.middle + normals * (shift * tube.radius)[:, None], half * tube.radius)


def _edges(strip: NDArray[np.float32], radius_px: float) -> FloatArray:
    """Strength of the edges along the way, 0..1, (N, T) of a straightened picture (N, T, 3)."""
    across = max(0.08 * radius_px, 0.8) / radius_px / _SAMPLE  # 0.8 px at least: pixel noise
    smooth = cv2.GaussianBlur(strip, (0, 0), sigmaX=across, sigmaY=0.4 / _STEP, borderType=cv2.BORDER_REPLICATE)
    slope = np.gradient(smooth, axis=1).astype(np.float64)
    strength = np.sqrt((slope**2).sum(axis=2))
    full = float(np.percentile(strength.max(axis=1), _TYPICAL_PERCENT))
    return np.asarray(np.minimum(strength / max(full, 1e-6), 1.0))


def _clearness(strength: FloatArray) -> float:
    """Share of the strongest edge among all edges on one side, (N, K): 1 where there is only one, and no noise."""
    inner = strength[:, 1:-1]
    peaks = np.where((inner >= strength[:, :-2]) & (inner > strength[:, 2:]), inner, 0.0)
    return float(peaks.max(axis=1).sum() / max(peaks.sum(), 1e-6))


def _walls(left: FloatArray, right: FloatArray, steps: FloatArray, slack: float) -> tuple[FloatArray, FloatArray]:
    """The cheapest pair of walls (N,) and (N,), in radii from the line, by dynamic programming.

    Parameters
    ----------
    left, right : edge strengths (N, K) at the distances `steps` (K,) on either side of the line.
    slack : distance from the drawn wall, in radii, that costs as much as an edge of full strength saves.
    """
    count, kinds = left.shape
    cell = steps[1] - steps[0]
    prior = ((steps[:, None] - 1.0) ** 2 + (steps[None, :] - 1.0) ** 2) / slack**2
    moves = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
    change = [(0.5 * cell) ** 2 * (_TURN_COST * (b - a) ** 2 + _GROWTH_COST * (a + b) ** 2) for a, b in moves]
    total = np.zeros((kinds, kinds))
    came = np.zeros((count, kinds, kinds), np.int8)
    padded = np.full((kinds + 2, kinds + 2), np.inf)
    for place in range(count):
        if place:
            padded[1:-1, 1:-1] = total
            options = np.stack(
                [padded[1 - a : 1 - a + kinds, 1 - b : 1 - b + kinds] + cost for (a, b), cost in zip(moves, change, strict=True)]
            )
            came[place] = options.argmin(axis=0)
            total = options.min(axis=0)
        total = total + prior - left[place][:, None] - right[place][None, :]
    found = np.zeros((count, 2))
    row, column = divmod(int(total.argmin()), kinds)
    for place in range(count - 1, -1, -1):
        found[place] = steps[row], steps[column]
        a, b = moves[came[place, row, column]]
        row, column = row - a, column - b
    return found[:, 0], found[:, 1]
