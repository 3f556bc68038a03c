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
_SLACK_PX = 6.5
"""A wall this far from where it was drawn, on a picture 640 px long, costs as much as an edge of full strength saves."""
_UNCLEAR, _CLEAR, _CLEAR_GAIN = 0.92, 0.99, 1.0
"""Where walls are the only edges, they may lie more to the side: the gain grows between these shares of the
strongest edge among all. A tube with an inner and an outer wall, and reflections, has less."""
_TURN_COST, _GROWTH_COST = 40.0, 80.0
"""Cost of the change of the middle, or of the half width, from place to place, per squared radius."""
_BEFORE_RADII, _AFTER_RADII = 1.2, 1.2
"""Over so many radii the drawn line, and the found walls, are smoothed."""
_BLUR_RADII, _BLUR_PX = 0.11, 1.4
"""Smoothing across the way, in radii, but at least so many pixels."""
_LINE_GAIN = 1.6
"""How much a thin line counts compared with an edge, where walls are unclear. Chosen on four independent benches and six of the
twin's: without lines, walls that are seen as dark lines are missed by half the line's width."""
_TYPICAL_PERCENT = 60.0
"""This percentile of the strongest edge beside each place counts as full strength."""


@dataclass(frozen=True, slots=True, eq=False)
class LumenTube:
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


def drawn_tube(stroke: Points, radius_px: FloatArray) -> LumenTube:
    """The tube as the hand drew it along (N, 2) px with the radii (N,), with a point every sixth of its least radius."""
    along = geometry.arc_length(stroke)
    step = max(float(radius_px.min()) * _STEP, 0.5)
    if along[-1] < step:
        return LumenTube(stroke[-1:].copy(), radius_px[-1:].copy())
    points = geometry.resample(stroke, step)
    moved = np.concatenate([[True], np.diff(along) > 0])
    return LumenTube(points, np.interp(np.linspace(0.0, along[-1], len(points)), along[moved], radius_px[moved]))


def snapped_tube(image: Image, stroke: Points, radius_px: FloatArray, taken: Mask | None = None) -> LumenTube:
    """The vessel along a drag; beyond the border of the picture where an end of the drag is nearer to it than a radius.

    `image` is RGB (H, W, 3); `stroke` (N, 2) px leads along the middle of the vessel, with the drawn radius (N,) at each point.
    Walls are not looked for in what is vessel already, `taken` (H, W).
    """
    tube = drawn_tube(stroke, radius_px)
    if len(tube.middle) < 4:
        return tube
    tube = _led_out(_smoothed(tube, _BEFORE_RADII), (image.shape[1], image.shape[0]))
    slack_px = _SLACK_PX * max(image.shape[:2]) / 640.0
    radius = float(np.median(tube.radius))
    margin = (_WIDEST + 0.5) * float(tube.radius.max()) + 4.0
    low = np.clip(tube.middle.min(axis=0) - margin, 0, (image.shape[1] - 1, image.shape[0] - 1)).astype(int)
    high = np.maximum(np.ceil(tube.middle.max(axis=0) + margin).astype(int), low) + 1
    window = slice(low[1], high[1]), slice(low[0], high[0])
    seen = np.ascontiguousarray(image[window])
    hidden = taken[window].view(np.uint8) if taken is not None else np.zeros(seen.shape[:2], np.uint8)
    scale = min(1.0, _RADIUS_PX / radius)
    if scale < 1.0:
        seen = np.asarray(cv2.resize(seen, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        hidden = np.asarray(cv2.resize(hidden, seen.shape[1::-1], interpolation=cv2.INTER_NEAREST), np.uint8)
    near = LumenTube((tube.middle - low + 0.5) * scale - 0.5, tube.radius * scale)
    found = _smoothed(_fitted(seen, near, hidden, slack_px * scale), _AFTER_RADII)
    return LumenTube((found.middle + 0.5) / scale - 0.5 + low, found.radius / scale)


def _smoothed(tube: LumenTube, radii: float) -> LumenTube:
    """Line and radius smoothed over so many radii."""
    sigma = radii / _STEP
    middle = geometry.smooth(tube.middle, sigma, keeps_bends=True)
    radius = cv2.GaussianBlur(tube.radius.reshape(-1, 1), (0, 0), sigmaX=1e-3, sigmaY=sigma, borderType=cv2.BORDER_REPLICATE)
    return LumenTube(middle, np.asarray(radius, np.float64).ravel())


def _led_out(tube: LumenTube, size: tuple[int, int]) -> LumenTube:
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
    return LumenTube(middle, radius)


def _fitted(image: Image, tube: LumenTube, taken: NDArray[np.uint8], slack_px: float) -> LumenTube:
    """The tube with both of its walls on edges of the picture, but not on those within what is `taken` (h, w)."""
    normals, radius = geometry.normals(tube.middle), float(np.median(tube.radius))
    reach = _WIDEST + 0.5
    across = np.arange(-reach, reach + 1e-9, _SAMPLE)
    places = tube.middle[:, None] + normals[:, None] * (across[None, :, None] * tube.radius[:, None, None])
    x, y = places[..., 0].astype(np.float32), places[..., 1].astype(np.float32)
    smooth = cv2.GaussianBlur(image.astype(np.float32) / 255.0, (0, 0), 0.7)
    lab = cv2.cvtColor(smooth, cv2.COLOR_RGB2LAB)  # equal steps look equally large
    strip = np.asarray(cv2.remap(lab, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
    inner = cv2.erode(taken, np.ones((5, 5), np.uint8))  # its own border is a wall
    hidden = cv2.remap(inner, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT) > 0
    hidden |= (x < 0) | (y < 0) | (x > image.shape[1] - 1) | (y > image.shape[0] - 1)
    steps = np.arange(_NARROWEST, _WIDEST + 1e-9, _CELL)
    columns = np.arange(len(across), dtype=np.float64)

    def sides(line_gain: float) -> FloatArray:
        strength = np.where(hidden, 0.0, _edges(strip, radius, line_gain))
        return np.array([[np.interp((side * steps + reach) / _SAMPLE, columns, row) for row in strength] for side in (-1, 1)])

    plain = sides(1.0)
    share = 0.5 * (_clearness(plain[0]) + _clearness(plain[1]))
    clear = min(max((share - _UNCLEAR) / (_CLEAR - _UNCLEAR), 0.0), 1.0)
    both = sides(_LINE_GAIN + (1.0 - _LINE_GAIN) * clear) if clear < 1.0 else plain
    to_left, to_right = _walls(both[0], both[1], steps, slack_px * (1.0 + _CLEAR_GAIN * clear) / radius)
    shift, half = 0.5 * (to_right - to_left), 0.5 * (to_right + to_left)
    return LumenTube(tube.middle + normals * (shift * tube.radius)[:, None], half * tube.radius)


def _edges(strip: NDArray[np.float32], radius_px: float, line_gain: float) -> FloatArray:
    """Strength of edges and thin lines along the way, 0..1, (N, T) of a straightened picture (N, T, 3).

    Local energy: the slope and the bend across the way. A wall that is seen as a thin line has no slope in its middle, where the
    vessel ends, and one edge on either side. With a `line_gain` of 1 a plain edge is strongest in its middle, with a larger one it
    becomes a plateau: the drawn place counts within it.
    """
    across = max(_BLUR_RADII * radius_px, _BLUR_PX) / radius_px / _SAMPLE
    smooth = cv2.GaussianBlur(strip, (0, 0), sigmaX=across, sigmaY=0.4 / _STEP, borderType=cv2.BORDER_REPLICATE)
    slope = np.gradient(smooth, axis=1).astype(np.float64)
    bend = line_gain * across * np.gradient(slope, axis=1)
    strength = np.sqrt((slope**2).sum(axis=2) + (bend**2).sum(axis=2))
    full = float(np.percentile(strength.max(axis=1), _TYPICAL_PERCENT))
    return np.asarray(np.minimum(strength / max(full, 1e-6), 1.0))


def _clearness(strength: FloatArray) -> float:
    """Share of the strongest edge among all edges on one side, (N, K): 1 where there is only one, and no noise."""
    inner = strength[:, 1:-1]
    peaks = np.where((inner >= strength[:, :-2]) & (inner > strength[:, 2:]), inner, 0.0)
    return float(peaks.max(axis=1).sum() / max(peaks.sum(), 1e-6))


def _walls(left: FloatArray, right: FloatArray, steps: FloatArray, slack: float) -> tuple[FloatArray, FloatArray]:
    """The cheapest pair of walls (N,) and (N,), in radii from the line, by dynamic programming.

    `left` and `right` are edge strengths (N, K) at the distances `steps` (K,); `slack` is the distance from the drawn wall, in
    radii, that costs as much as an edge of full strength saves.
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
