"""Each picture is registered against its bench: how far the camera has moved since, and how the light has changed.

The motion is a similarity transform, found by Gauss-Newton steps on the fine structure of both pictures (S. Baker and I. Matthews,
"Lucas-Kanade 20 years on", 2004: inverse compositional), coarse to fine. Where a robot, a hand or a cable covers the bench, the
residuals are large and count little.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.bench.bench import Bench, reachable
from core.messages import message
from core.types import Image, Mask, Reason, Refusal, Window

MAX_SHIFT_PX, MAX_ROTATION_DEG, MAX_SCALING = 10.0, 2.0, 0.03
"""A camera that moved by more has to be taken for another place: the bench must be made again."""
_TOLERANCE = 1.05
"""Of these limits: the error of the measurement."""
LEAST_LIKENESS, LEAST_LIKENESS_HERE = 0.33, 0.2
"""Correlation of the fine structure of a picture with the bench's, anywhere, and where the camera has hardly moved. Of 120 pictures
of four benches it is above 0.31, and with those of another bench at most 0.32, far away."""
_HERE_PX = 3.0
"""A camera that moved by less has hardly moved."""
SAME_PLACE_PX = 0.6
"""A picture that moved by less than this anywhere, against the one before, is seen at the same place."""
_EDGE_PX = 0.5
"""Displacement of an edge that counts as much as the noise."""
_SEARCH_PX, _SEARCH_POINTS = 40, 500
"""The farthest shift that is found, and named, and the number of points with which it is searched."""
_SURE_LIKENESS = 0.7
"""A place with this likeness needs no other attempt."""
_LEVELS = (8, 4, 2)
"""Scales of the pictures that are aligned, coarse to fine: 1 / 8 first."""
_STEPS = (8, 6, 6)
"""The most Gauss-Newton steps at each of these scales."""
_CELLS = 16
"""Structure is taken from cells of 1 / this of the picture's width alike, so that it is spread over the picture."""
_POINTS_PER_CELL = 12
_RIM_PX = 36
"""Width of the picture's rim whose structure does not count: a collimator's edge does not move with the phantom."""
_LEAST_STRENGTH = 0.1
"""Of the strongest structure: less is mostly noise."""
_NOISE_TIMES = 3.0
"""A gradient counts from so many times the median of the gradients that only noise and the finest texture make."""
_DONE_PX = 0.02
"""A step below this, in pixels at its own scale, is the last."""
LIGHT_CELL_PX = 8
"""Light is compared between means over cells of this size."""


@dataclass(frozen=True, slots=True, eq=False)
class BenchView:
    """A bench as it must look in one picture (h, w).

    Attributes
    ----------
    empty : the picture without the robot, RGB uint8 (h, w, 3), at the place and in the light of this picture.
    known : bool (h, w); False where the empty picture is not known, also where the camera now sees what it did not see then.
    vessel : the lumen, bool (h, w); None: not drawn. The same object as long as the camera does not move.
    reachable : where the robot may lie, bool (h, w); all of it where no vessel is drawn.
    noise : standard deviation of one picture's pixels, float32 (h, w), grey levels.
    shift_px, rotation_deg : how far the camera has moved since the bench was made.
    gain : brightness of this picture against the bench's.
    matrix : (2, 3), from pixels of the bench to those of this picture.
    likeness : correlation of the fine structure of both, at most 1.
    """

    empty: Image
    known: Mask
    vessel: Mask | None
    reachable: Mask
    noise: NDArray[np.float32]
    shift_px: float
    rotation_deg: float
    gain: float
    matrix: NDArray[np.float64]
    likeness: float
    placed: Image
    """The bench's empty picture at this place, in the bench's own light."""
    lab: Image
    """``empty`` without its noise, in Lab (``lab_of``); made once for all windows of this view."""
    gradient: NDArray[np.float32]
    """Of the brightness of ``lab`` (``gradient_of``)."""
    window: Window | None = None
    """The part of the picture that is meant; None: all of it."""


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """Points with structure at one scale of the bench: places (N, 2) from the middle of the picture, structure (N,), and its
    derivatives (N, 4) by shift in x and y, scaling and rotation."""

    scale: int
    places: NDArray[np.float64]
    structure: NDArray[np.float64]
    derivatives: NDArray[np.float64]
    gradient: NDArray[np.float64]
    weight: NDArray[np.float64]
    strength: float
    limit: float


def register(image: Image, bench: Bench, previous: BenchView | None = None) -> BenchView | Refusal:
    """The bench as it must look in `image` (h, w, 3), a picture at working size.

    Returns a refusal (BENCH_MOVED, OTHER_BENCH) where the camera was moved by more than ``MAX_SHIFT_PX``, ``MAX_ROTATION_DEG`` or
    ``MAX_SCALING``, the drawn vessel was moved on its board, or the picture is not of this bench.

    Parameters
    ----------
    previous : of an earlier picture of the same camera; its place is tried first, and kept where the picture is still there.
    """
    height, width = bench.empty.shape[:2]
    if image.shape != bench.empty.shape:
        detail = message(
            "the picture has {a}x{b} px at working size, the bench {width}x{height}",
            a=image.shape[1],
            b=image.shape[0],
            width=width,
            height=height,
        )
        return Refusal(Reason.OTHER_BENCH, detail)
    found, likeness, slope = _place(image, bench, previous)
    shift, rotation, scaling = _motion(found, (width, height))
    is_far = max(shift / MAX_SHIFT_PX, abs(rotation) / MAX_ROTATION_DEG, abs(scaling) / MAX_SCALING) > _TOLERANCE
    here = np.eye(2, 3) if previous is None else previous.matrix
    least = LEAST_LIKENESS_HERE if _apart(found, here, (width, height)) < _HERE_PX else LEAST_LIKENESS
    if likeness < least:
        detail = message(
            "likeness {found:.2f} (at least {least:.2f}): make the bench again, or put the camera back",
            found=likeness,
            least=least,
        )
        return Refusal(Reason.OTHER_BENCH, detail)
    if is_far:
        detail = message(
            "by {shift:.0f} px and {rotation:.1f} degrees (at most {a:.0f} px, {b:.0f} degrees): make the bench again",
            shift=shift,
            rotation=abs(rotation),
            a=MAX_SHIFT_PX,
            b=MAX_ROTATION_DEG,
        )
        return Refusal(Reason.BENCH_MOVED, detail)
    if (vessel_px := _vessel_shift_px(image, bench, found)) > 0.0:
        detail = message(
            "the vessel alone, by about {shift:.0f} px against what lies around it: put it back, or make the bench again",
            shift=vessel_px,
        )
        return Refusal(Reason.BENCH_MOVED, detail)
    if previous is not None and _apart(found, previous.matrix, (width, height)) < SAME_PLACE_PX:
        found, placed, known = previous.matrix, previous.placed, previous.known
        vessel, area, noise = previous.vessel, previous.reachable, previous.noise
        shift, rotation, _ = _motion(found, (width, height))
    elif _apart(found, np.eye(2, 3), (width, height)) < SAME_PLACE_PX:
        found, placed, known, vessel, noise = np.eye(2, 3), bench.empty, bench.known, bench.vessel, bench.noise
        area = _reachable(bench)
        shift = rotation = 0.0
    else:
        placed = np.asarray(_moved(bench.empty, found, cv2.INTER_LINEAR), np.uint8)
        inside = _moved(np.full((height, width), 255, np.uint8), found, cv2.INTER_LINEAR, outside=0) == 255
        known = inside & (_moved(bench.known.view(np.uint8), found, cv2.INTER_NEAREST) > 0)
        vessel = None
        if bench.vessel is not None:
            vessel = _moved(bench.vessel.astype(np.float32), found, cv2.INTER_LINEAR) >= 0.5
        area = inside & (_moved(_reachable(bench).view(np.uint8), found, cv2.INTER_NEAREST) > 0)
        noise = np.asarray(_moved(bench.noise, found, cv2.INTER_LINEAR), np.float32)
    empty, gain, power = relit(placed, image, known)
    if slope / power < _SOFT_SLOPE:
        empty = blurred_alike(empty, image, known)
    lab = lab_of(empty)
    gradient = gradient_of(lab[..., 0])
    return BenchView(empty, known, vessel, area, noise, shift, rotation, gain, found, likeness, placed, lab, gradient)


def window_of(view: BenchView, window: Window) -> BenchView:
    """The part of a view that a window (x, y, width, height) shows; ``matrix`` is still that of the whole picture."""
    x, y, width, height = window
    part = np.s_[y : y + height, x : x + width]
    return replace(
        view,
        empty=view.empty[part],
        known=view.known[part],
        vessel=view.vessel[part] if view.vessel is not None else None,
        reachable=view.reachable[part],
        noise=view.noise[part],
        placed=view.placed[part],
        lab=view.lab[part],
        gradient=view.gradient[part],
        window=window,
    )


def lab_of(image: Image) -> Image:
    """Lab of a picture (h, w, 3), as bytes, without its finest noise."""
    return np.asarray(cv2.cvtColor(cv2.GaussianBlur(image, (0, 0), _FINEST_PX), cv2.COLOR_RGB2LAB), np.uint8)


_FINEST_PX = 0.8
"""Deviation of the Gaussian that takes noise out of both pictures."""


def gradient_of(brightness: NDArray[Any]) -> NDArray[np.float32]:
    """Grey levels per px, float32 (h, w)."""
    across, down = (cv2.Sobel(brightness, cv2.CV_32F, dx, 1 - dx, scale=1 / 8) for dx in (1, 0))
    return np.asarray(cv2.magnitude(across, down), np.float32)


def _moved(values: NDArray[Any], matrix: NDArray[np.float64], how: int, outside: int | None = None) -> NDArray[Any]:
    """Values of the bench at their places in the picture; beyond the border, the border's or `outside`."""
    border = cv2.BORDER_REPLICATE if outside is None else cv2.BORDER_CONSTANT
    size = values.shape[1], values.shape[0]
    return np.asarray(cv2.warpAffine(values, matrix, size, flags=how, borderMode=border, borderValue=[float(outside or 0)]))


def _structure(image: Image, scale: int, limit: float = math.inf) -> NDArray[np.float32]:
    """Fine structure at 1 / `scale`: logarithm of the brightness, which a change of light adds to, without its slow part."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    size = max(1, round(image.shape[1] / scale)), max(1, round(image.shape[0] / scale))
    small = cv2.LUT(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), _LOGARITHMS)
    small = cv2.GaussianBlur(small, (0, 0), _SMOOTH)
    slow = cv2.blur(small, (2 * _SLOW + 1, 2 * _SLOW + 1))
    return np.asarray(np.clip(small - slow, -limit, limit), np.float32)


_LOGARITHMS = np.log(np.arange(256, dtype=np.float32) + 8.0)
"""Of grey levels; the 8 keeps the noise of dark pixels small."""
_SLOW = 5
"""Half the side of the square, in pixels of each scale, whose mean is the slow part."""
_SMOOTH = 0.8
"""Deviation of the Gaussian, in pixels of each scale: less noise, and longer steps."""
_MOST_STRUCTURE = 2.0
"""Times the 90th percentile of the bench's structure: what is stronger, a robot or glare, counts as this."""


@functools.lru_cache(maxsize=4)
def _reachable(bench: Bench) -> Mask:
    return reachable(bench.vessel) if bench.vessel is not None else np.ones(bench.empty.shape[:2], np.bool_)


@functools.lru_cache(maxsize=4)
def _levels(bench: Bench) -> tuple[_Level, ...]:
    known = bench.known.view(np.uint8)
    return tuple(_level(bench.empty, known, scale) for scale in _LEVELS)


def _level(empty: Image, known: NDArray[np.uint8], scale: int) -> _Level:
    structure = _structure(empty, scale)
    limit = _MOST_STRUCTURE * float(np.percentile(np.abs(structure), 90)) + 1e-3
    structure = np.clip(structure, -limit, limit)
    across, down = cv2.Sobel(structure, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(structure, cv2.CV_32F, 0, 1, scale=1 / 8)
    strength = np.hypot(across, down)
    height, width = structure.shape
    strength[cv2.resize(known, (width, height), interpolation=cv2.INTER_NEAREST) == 0] = 0.0
    rim = max(_SLOW + 1, round(_RIM_PX / scale))
    strength[:rim], strength[-rim:], strength[:, :rim], strength[:, -rim:] = 0.0, 0.0, 0.0, 0.0
    rough = structure - cv2.GaussianBlur(structure, (0, 0), 2.0)
    noise = np.hypot(cv2.Sobel(rough, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(rough, cv2.CV_32F, 0, 1, scale=1 / 8))
    least = max(_LEAST_STRENGTH * float(np.percentile(strength, 99)), _NOISE_TIMES * float(np.median(noise)))
    strength[strength < min(least, float(np.percentile(strength, 95)))] = 0.0
    side = max(4, width // _CELLS)
    chosen = []
    for y in range(0, height, side):
        for x in range(0, width, side):
            part = strength[y : y + side, x : x + side]
            count = min(_POINTS_PER_CELL, part.size)
            best = np.argpartition(part.ravel(), part.size - count)[part.size - count :]
            rows, columns = np.unravel_index(best, part.shape)
            chosen.append(np.column_stack([rows + y, columns + x])[part[rows, columns] > 0.0])
    rows, columns = np.concatenate(chosen).T
    places = np.column_stack([columns - (width - 1) / 2, rows - (height - 1) / 2]).astype(np.float64)
    gx, gy = across[rows, columns].astype(np.float64), down[rows, columns].astype(np.float64)
    derivatives = np.column_stack([gx, gy, gx * places[:, 0] + gy * places[:, 1], gy * places[:, 0] - gx * places[:, 1]])
    values, gradient = structure[rows, columns].astype(np.float64), np.hypot(gx, gy)
    weight = 1.0 / np.maximum(gradient, 1e-6) ** 2
    weight = np.minimum(weight, 4.0 * np.median(weight)) if len(weight) else weight
    return _Level(scale, places, values, derivatives, gradient, weight, max(float(np.dot(values * weight, values)), 1e-9), limit)


def _place(image: Image, bench: Bench, previous: BenchView | None) -> tuple[NDArray[np.float64], float, float]:
    """The transform (2, 3) from the bench to the picture, the likeness there, and how strong the picture's structure is."""
    levels = _levels(bench)
    if previous is not None:
        start = _from_middle(previous.matrix, bench.size)
        found, likeness, slope = _refined(image, levels[-2:], start)
        if likeness >= LEAST_LIKENESS_HERE and _apart(_to_corner(found, bench.size), previous.matrix, bench.size) < _HERE_PX:
            return _to_corner(found, bench.size), likeness, slope
    best, best_likeness, best_slope = np.eye(3), -1.0, 1.0
    for start, scales in ((np.eye(3), levels[1:]), (_searched(image, levels[1]), levels[1:]), (np.eye(3), levels)):
        found, likeness, slope = _refined(image, scales, start)
        if likeness > best_likeness:
            best, best_likeness, best_slope = found, likeness, slope
        if likeness > _SURE_LIKENESS:
            break
    return _to_corner(best, bench.size), best_likeness, best_slope


def _searched(image: Image, level: _Level) -> NDArray[np.float64]:
    """The whole-pixel shift, at the level's scale, that puts most points on structure like theirs, about the picture's middle."""
    structure = _structure(image, level.scale, level.limit)
    height, width = structure.shape
    reach = _SEARCH_PX // level.scale
    framed = np.ascontiguousarray(cv2.copyMakeBorder(structure, reach, reach, reach, reach, cv2.BORDER_REPLICATE)).ravel()
    few = slice(None, None, max(1, len(level.places) // _SEARCH_POINTS))
    x, y = (np.rint(level.places[few] + np.array([(width - 1) / 2, (height - 1) / 2])).astype(np.intp) + reach).T
    shifts = np.arange(-reach, reach + 1)
    down, across = (one.ravel() for one in np.meshgrid(shifts, shifts, indexing="ij"))
    stride = width + 2 * reach
    seen = framed[(y * stride + x)[None] + (down * stride + across)[:, None]]
    scale = 2.0 * (_EDGE_PX * level.gradient[few] + 0.01)
    apart = (seen - level.structure[few]) / scale
    best = int(np.argmax((1.0 / (1.0 + apart**2)).sum(axis=1)))
    start = np.eye(3)
    start[:2, 2] = level.scale * across[best], level.scale * down[best]
    return start


def _vessel_shift_px(image: Image, bench: Bench, matrix: NDArray[np.float64]) -> float:
    """By how much the drawn vessel was moved on its board, which is at `matrix` (2, 3); 0 where it lies where it was."""
    found = _vessel_level(bench)
    if found is None:
        return 0.0
    level, is_same = found
    transform = _from_middle(matrix, bench.size)
    places = level.places @ transform[:2, :2].T + transform[:2, 2] / level.scale
    shifted = (places + _VESSEL_SHIFTS_PX[:, None] / level.scale).reshape(-1, 2)
    seen = _sample(_structure(image, level.scale, level.limit), shifted, np.eye(3)).reshape(len(_VESSEL_SHIFTS_PX), -1)
    apart = (seen - level.structure) / (2.0 * (_EDGE_PX * level.gradient + 0.01))
    scores = (1.0 / (1.0 + apart**2)).mean(axis=1)
    best = int(np.argmax(scores))
    was_moved = scores[best] > _LEAST_VESSEL_SCORE and scores[is_same].max() < _VESSEL_SCORE_SHARE * scores[best]
    return math.hypot(*_VESSEL_SHIFTS_PX[best]) if was_moved else 0.0


@functools.lru_cache(maxsize=4)
def _vessel_level(bench: Bench) -> tuple[_Level, NDArray[np.bool_]] | None:
    """The points beside the drawn vessel's walls, at 1/4, and the shifts (K,) under which it stays as it is, as along a
    straight tube. None where there are too few points to tell.
    """
    if bench.vessel is None:
        return None
    level = _levels(bench)[1]
    solid = bench.vessel.view(np.uint8)
    depth = cv2.distanceTransform(solid, cv2.DIST_L2, 5) + cv2.distanceTransform(1 - solid, cv2.DIST_L2, 5)
    height, width = depth.shape
    x, y = np.rint(level.places * level.scale + np.array([(width - 1) / 2, (height - 1) / 2])).astype(np.intp).T
    beside = depth[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)] < _WALL_PX
    if np.count_nonzero(beside) < _LEAST_WALL_POINTS:
        return None
    some = np.flatnonzero(beside)[:: max(1, np.count_nonzero(beside) // _WALL_POINTS)]
    parts = {name: getattr(level, name)[some] for name in ("places", "structure", "derivatives", "gradient", "weight")}
    small = cv2.resize(solid * 255, (width // level.scale, height // level.scale), interpolation=cv2.INTER_AREA)
    is_same = []
    for x_px, y_px in _VESSEL_SHIFTS_PX / level.scale:
        moved = _moved(small, np.array([[1, 0, x_px], [0, 1, y_px]]), cv2.INTER_LINEAR)
        is_same.append(float(cv2.min(small, moved).sum(dtype=np.float64)) >= _SAME_SHARE * float(small.sum(dtype=np.float64)))
    return replace(level, **parts), np.array(is_same)


_VESSEL_SHIFTS_PX = np.stack(np.meshgrid(np.arange(-16, 17, 4), np.arange(-16, 17, 4)), axis=-1).reshape(-1, 2)
"""Shifts (K, 2) of a vessel on its board that are tried."""
_WALL_PX = 12.0
"""How near the walls structure belongs to the vessel."""
_SAME_SHARE = 0.95
"""A vessel that overlaps so much of itself was not moved."""
_LEAST_WALL_POINTS, _WALL_POINTS = 40, 200
"""Points with which it is searched: at least, and about at most."""
_VESSEL_SCORE_SHARE, _LEAST_VESSEL_SCORE = 0.95, 0.7
"""A vessel was moved where its score, 0..1, at its place is below this share of the highest, and that is above the second value: of
152 frames of four benches none is; moved by 12 px on a textured board it is 0.7 of 0.97."""


def _refined(image: Image, levels: tuple[_Level, ...], start: NDArray[np.float64]) -> tuple[NDArray[np.float64], float, float]:
    """The transform (3, 3) about the picture's middle in working pixels, the correlation of the structure there, and its slope."""
    transform, likeness, slope = start.copy(), -1.0, 1.0
    for level in levels:
        structure = _structure(image, level.scale, level.limit)
        here = transform.copy()
        here[:2, 2] /= level.scale
        reach = math.sqrt(float(np.mean(level.places**2)))
        for _ in range(_STEPS[_LEVELS.index(level.scale)]):
            seen = _sample(structure, level.places, here)
            slope, weight = _slope(seen, level, slope)
            apart = seen - slope * level.structure
            weighted = level.derivatives * (weight * slope)[:, None]
            # The derivatives by scaling and rotation are large where the picture is: a little damping in units of pixels.
            normal = weighted.T @ (level.derivatives * slope)
            normal[2, 2] += 1e-4 * normal[0, 0] * reach**2
            normal[3, 3] += 1e-4 * normal[0, 0] * reach**2
            normal[0, 0] += 1e-9
            normal[1, 1] += 1e-9
            try:
                step = np.linalg.solve(normal, weighted.T @ apart)
            except np.linalg.LinAlgError:
                break
            change = np.array([[1 + step[2], -step[3], step[0]], [step[3], 1 + step[2], step[1]], [0, 0, 1]])
            here = here @ np.linalg.inv(change)
            if math.hypot(step[0], step[1]) + reach * math.hypot(step[2], step[3]) < _DONE_PX:
                break
        transform = here.copy()
        transform[:2, 2] *= level.scale
        seen = _sample(structure, level.places, here)
        likeness = float(np.dot(seen * level.weight, level.structure))
        likeness /= max(math.sqrt(float(np.dot(seen * level.weight, seen)) * level.strength), 1e-9)
        slope, _ = _slope(seen, level, slope)
    return transform, likeness, slope


def _slope(seen: NDArray[np.float64], level: _Level, slope: float) -> tuple[float, NDArray[np.float64]]:
    """How strong the structure that is `seen` (N,) is against the bench's, and the weights (N,), small where it is another."""
    apart = seen - slope * level.structure
    # Strong edges and weak ones count alike: in units of noise and of pixels that an edge is displaced.
    scale = float(np.median(np.abs(apart))) + 1e-4 + _EDGE_PX * level.gradient
    weight = (scale / (scale**2 + (0.5 * apart) ** 2)) ** 2  # Geman and McClure's
    weighted = weight * level.structure
    found = float(np.dot(weighted, seen)) / max(float(np.dot(weighted, level.structure)), 1e-9)
    return min(max(found, 0.3), 1.5), weight


_BLURS_PX = (1.0, 1.5, 2.0, 2.8, 4.0)
_SOFT_SLOPE = 0.92
"""Structure that is stronger than this share of the bench's is not blurred."""
_FOCUS_POINTS = 2000
_FOCUS_RIM_PX = 3
"""Width of the picture's rim that is not asked: blur needs what lies beyond the border."""


def blurred_alike(empty: Image, image: Image, known: Mask) -> Image:
    """The empty picture (h, w, 3), blurred as far as makes its sharpest edges most like the picture's."""
    # smoothed, because noise of the empty picture would make a blurred one more like the other
    now, before = (cv2.GaussianBlur(cv2.cvtColor(one, cv2.COLOR_RGB2GRAY), (0, 0), 1.2) for one in (image, empty))
    strength = np.abs(cv2.Laplacian(before, cv2.CV_16S)) * known
    strength[:_FOCUS_RIM_PX], strength[-_FOCUS_RIM_PX:], strength[:, :_FOCUS_RIM_PX], strength[:, -_FOCUS_RIM_PX:] = 0, 0, 0, 0
    least = np.partition(strength[::2, ::2].ravel(), -_FOCUS_POINTS // 4)[-_FOCUS_POINTS // 4]
    places = np.flatnonzero(strength >= max(int(least), 1))
    values = now.ravel()[places].astype(np.float32)
    best, chosen = _apart_by(before, places, values), 0.0
    for blur in _BLURS_PX:
        found = _apart_by(cv2.GaussianBlur(before, (0, 0), blur), places, values)
        if found > best:
            break
        best, chosen = found, blur
    return empty if chosen == 0.0 else np.asarray(cv2.GaussianBlur(empty, (0, 0), chosen), np.uint8)


def _apart_by(picture: NDArray[Any], places: NDArray[np.intp], values: NDArray[np.float32]) -> float:
    """Mean of the smaller half of the differences: a robot does not count."""
    apart = np.abs(picture.ravel()[places] - values)
    half = max(1, len(apart) // 2)
    return float(np.partition(apart, half - 1)[:half].mean()) if len(apart) else 0.0


def _sample(structure: NDArray[np.float32], places: NDArray[np.float64], transform: NDArray[np.float64]) -> NDArray[np.float64]:
    """The structure at the bench's points (N, 2), which the transform (3, 3) about the middle moves."""
    height, width = structure.shape
    moved = places @ transform[:2, :2].T + transform[:2, 2] + np.array([(width - 1) / 2, (height - 1) / 2])
    x, y = np.ascontiguousarray(moved.T.astype(np.float32))
    rows = -(-len(x) // 512)
    padded = np.zeros((2, rows * 512), np.float32)  # remap takes no more than 32767 columns
    padded[0, : len(x)], padded[1, : len(x)] = x, y
    seen = cv2.remap(
        structure, padded[0].reshape(rows, 512), padded[1].reshape(rows, 512), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(seen.ravel()[: len(x)], np.float64)


def _to_corner(transform: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    """(3, 3) about the middle -> (2, 3) about the corner pixel."""
    middle = np.array([(size[0] - 1) / 2, (size[1] - 1) / 2])
    matrix = transform[:2].copy()
    matrix[:, 2] += middle - matrix[:, :2] @ middle
    return matrix


def _from_middle(matrix: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    middle = np.array([(size[0] - 1) / 2, (size[1] - 1) / 2])
    transform = np.vstack([matrix, [0, 0, 1]])
    transform[:2, 2] += matrix[:, :2] @ middle - middle
    return transform


def _motion(matrix: NDArray[np.float64], size: tuple[int, int]) -> tuple[float, float, float]:
    """Shift of the picture's middle in px, rotation in degrees, and scaling - 1."""
    about = _from_middle(matrix, size)
    scale = math.hypot(about[0, 0], about[1, 0])
    return math.hypot(about[0, 2], about[1, 2]), math.degrees(math.atan2(about[1, 0], about[0, 0])), scale - 1.0


def _apart(one: NDArray[np.float64], other: NDArray[np.float64], size: tuple[int, int]) -> float:
    """The longest distance between where two transforms put the middles of the picture's quarters, px."""
    middles = np.array([[x * size[0], y * size[1], 1] for x in (0.25, 0.75) for y in (0.25, 0.75)], np.float64)
    return float(np.hypot(*(middles @ (one - other).T).T).max())


def relit(placed: Image, image: Image, known: Mask) -> tuple[Image, float, float]:
    """The empty picture (h, w, 3) in the light of `image`, the factor of its brightness, and its power.

    A power and a factor for each channel, as exposure, gamma and colour balance make them, from the middle of all cells; then a
    smooth factor for shadows: the median of the cells around, in which a robot does not count.
    """
    size = max(1, image.shape[1] // LIGHT_CELL_PX), max(1, image.shape[0] // LIGHT_CELL_PX)
    before = cv2.resize(placed, size, interpolation=cv2.INTER_AREA).astype(np.float32) + 4.0
    now = cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32) + 4.0
    usable = cv2.resize(known.view(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    if not usable.any():
        return placed, 1.0, 1.0
    one, other = np.log(before), np.log(now)
    factors = np.empty_like(one)
    curves = np.empty((256, 3), np.float64)
    levels = np.log(np.arange(256) + 4.0)
    powers = []
    for channel in range(3):
        offset, power = _curve(one[usable, channel], other[usable, channel])
        curves[:, channel] = offset + power * levels
        powers.append(power)
        rest = other[..., channel] - (offset + power * one[..., channel])
        steps = np.clip(np.rint(rest * _LOG_STEPS) + 128, 0, 255).astype(np.uint8)
        median = cv2.medianBlur(cv2.copyMakeBorder(steps, 8, 8, 8, 8, cv2.BORDER_REFLECT), _LIGHT_CELLS)[8:-8, 8:-8]
        factors[..., channel] = (median.astype(np.float32) - 128.0) / _LOG_STEPS
    smooth = cv2.GaussianBlur(factors, (0, 0), 1.0)
    gain = float(np.exp(np.median((curves - levels[:, None])[32:224]) + np.median(smooth)))
    table = np.exp(curves).astype(np.float32) - 4.0
    lit = cv2.LUT(placed, np.ascontiguousarray(table[None])) + 4.0
    lit *= cv2.resize(np.exp(smooth), placed.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    return np.clip(lit - 3.5, 0, 255).astype(np.uint8), gain, float(np.mean(powers))


_LOG_STEPS = 150.0
"""Steps of 8 bits for a factor of e: a factor between 0.43 and 2.3 in steps of 0.7 %."""
_LIGHT_CELLS = 11
"""Cells along a side of the median: a robot up to 40 px wide covers less than half of them."""


def _curve(before: NDArray[np.float32], now: NDArray[np.float32]) -> tuple[float, float]:
    """Offset and slope of the logarithms of a channel, `now` against `before` (N,), by reweighted least squares."""
    offset, slope = float(np.median(now - before)), 1.0
    spread = float(np.percentile(before, 95) - np.percentile(before, 5))
    for _ in range(3):
        apart = now - offset - slope * before
        weight = 1.0 / (1.0 + (apart / (2.0 * float(np.median(np.abs(apart))) + 1e-3)) ** 2)
        total = float(weight.sum())
        x, y = float(weight @ before) / total, float(weight @ now) / total
        if spread > _LEAST_SPREAD:
            variance = float(weight @ (before - x) ** 2)
            slope = float(weight @ ((before - x) * (now - y))) / max(variance, 1e-6)
            slope = min(max(slope, 0.6), 1.6)
        offset = y - slope * x
    return offset, slope


_LEAST_SPREAD = 0.2
"""Logarithm of brightness: a board that is plainer shows an exposure, but no gamma."""
