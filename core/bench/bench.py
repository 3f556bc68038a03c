"""What is known of a bench, a fixed camera above a fixed phantom: the picture without the robot, its noise, and the vessel.

A bench is made from pictures of the empty bench, or from frames with the robot in several places, and kept in a folder.
"""

from __future__ import annotations

import hashlib
import math
import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from core.config.section import first_problem
from core.devices import UserError
from core.files import ImageError, read_image, replace_folder
from core.learning.dataset import mask_png, png
from core.perception import quality
from core.perception.segmentation import Probability, to_working
from core.perception.skeleton import end_pixels, thin
from core.system import MAX_PIXELS
from core.types import Image, Mask, Points

FORMAT = 1
INFO, EMPTY, NOISE, KNOWN, VESSEL = "bench.json", "empty.png", "noise.png", "known.png", "vessel.png"
_PICTURES = frozenset({EMPTY, NOISE, KNOWN, VESSEL})
PHANTOM_FILE, ROBOT_FILE = "phantom.json", "robot.npz"
"""The twin's phantom of this bench (``hardware/twin/own_phantom.py``) and what its robot looks like (``robot_texture.py``), which
stay when the bench is written again; the phantom only where the camera sees it as before."""
_FILES = frozenset({INFO, *_PICTURES, PHANTOM_FILE, ROBOT_FILE})

SHARP_SHARE = 0.9
"""Empty pictures that are less sharp than this share of the sharpest one are not averaged into it."""
LEAST_SHARPNESS = 0.05
"""A bench whose sharpest picture is below this is out of focus (``quality.sharpness``: 0.15 is a sharp edge)."""
LEAST_LIKENESS = 0.3
"""Correlation of the fine structure of two pictures of one bench: above 0.65 on four benches with a robot, other light or out of
focus, and below 0.1 between them."""
_SAME_PLACE_SHARE = 0.01
"""Shift between two empty pictures, of the longer side, up to which the camera was not moved."""
_MAX_VESSEL_SHARE, _LEAST_VESSEL_SHARE = 0.5, 0.002
"""Share of the picture that a vessel may cover: more is a mask with vessel and background exchanged, less is a speck."""
_MAX_BORDER_SHARE = 0.6
"""Share of the picture's border that a vessel may reach: the complement of a tree covers nearly all of it."""
_NOISE_STEPS = 256
"""``noise.png`` has 16 bits: grey levels times this."""
LEAST_NOISE = 0.5
"""Grey levels: what rounding to whole levels, and a camera's own denoising, hide."""
_DIFFERENT_SIGMAS, _DIFFERENT_LEVELS = 6.0, 10.0
"""Smoothed pictures that differ by more than both, noise deviations and grey levels, do not show the same there."""
_MOST_SMOOTH_NOISE = 30.0
"""Grey levels of what differs that noise explains at most: more than half of a picture may show something else."""
_LEAST_FRAMES = 3
_AGREED_SHARE = 0.5
"""Share of the frames that must show the same, for the empty bench to be known at a pixel."""
_MOVED_SHARE = 5e-4
"""Share of the picture that a robot changes at least when it moves."""


class BenchError(UserError):
    """A bench cannot be made, read or used; the message is one line that says what to do."""


@dataclass(frozen=True, slots=True, eq=False)
class Bench:
    """A fixed camera above a fixed phantom, at working size (h, w).

    Attributes
    ----------
    name : what the user calls it.
    empty : the picture without the robot, RGB uint8 (h, w, 3).
    noise : standard deviation of one picture's pixels, float32 (h, w), grey levels.
    known : bool (h, w); False where the empty picture is not known, because something always lay there.
    vessel : the lumen, bool (h, w), drawn once; None: not drawn.
    landmarks : corners of the empty picture (N, 2), by which a moved camera is noticed.
    stamp : see ``bench_stamp``; None where it was not read from a folder.
    """

    name: str
    empty: Image
    noise: NDArray[np.float32]
    known: Mask
    vessel: Mask | None
    landmarks: Points
    stamp: int | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.empty.shape[1], self.empty.shape[0]


class _BenchInfo(BaseModel):
    """``bench.json``; ``sha256`` has the hash of each picture in the folder by its name."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    format: int = Field(FORMAT, ge=1)
    name: str = Field(max_length=200)
    width: int = Field(ge=1, le=MAX_PIXELS)
    height: int = Field(ge=1, le=MAX_PIXELS)
    sha256: dict[str, str]
    landmarks: tuple[tuple[float, float], ...] = ()


def bench_from_pictures(
    pictures: Sequence[Image],
    vessel: Mask | None,
    name: str,
    working_size_px: int,
) -> Bench:
    """The bench of one or more pictures without the robot, RGB uint8 (H, W, 3), of one size.

    They may differ in noise, exposure and focus, and other things may lie in one of them: where sharp pictures differ, the
    median of three or more counts, and of two the place is not known.

    Raises BenchError: pictures of different size or of different benches, all of them out of focus, or a mask that cannot be a
    vessel.

    Parameters
    ----------
    vessel : the lumen, drawn at the pictures' size, bool (H, W).
    """
    if not pictures:
        raise BenchError("a bench needs a picture of the empty bench")
    _check_sizes(pictures, vessel)
    images = [to_working(picture, working_size_px)[0] for picture in pictures]
    sharp = [quality.sharpness(image) for image in images]
    best = int(np.argmax(sharp))
    if sharp[best] < LEAST_SHARPNESS:
        raise BenchError(
            "the empty picture is blurred (sharpness {found:.3f}): focus the camera and take another", found=sharp[best]
        )
    for number, image in enumerate(images, 1):
        if (found := likeness(image, images[best])) < LEAST_LIKENESS:
            raise BenchError(
                "empty picture {number} shows another bench, or the camera was moved (likeness {found:.2f})",
                number=number,
                found=found,
            )
    base = images[best]
    others = [same_light(image, base) for index, image in enumerate(images) if index != best]
    focused: list[NDArray[np.float32]] = [base.astype(np.float32)]
    focused += [one for one, value in zip(others, _without(sharp, best), strict=True) if value >= SHARP_SHARE * sharp[best]]
    noise = picture_noise(base) if len(focused) == 1 else np.maximum(picture_noise(base), _noise_between(focused))
    if len(images) >= 3:
        middle = np.median(np.stack([base, *others]), axis=0)
        clean = [np.where(_differs(one, middle, noise)[:, :, None], middle, one) for one in focused]
        empty, known = np.mean(clean, axis=0), np.ones(base.shape[:2], np.bool_)
    else:
        empty, known = _mean_without_glare(focused), np.ones(base.shape[:2], np.bool_)
        for other in others:
            unlike = _differs(other, base, noise)
            glare = [_beside_glare(one) for one in (base.astype(np.float32), other)]
            known &= ~unlike | (glare[0] ^ glare[1])  # the picture without the reflection shows the bench
            empty = np.where((unlike & ~glare[0])[:, :, None], base, empty)
            empty = np.where((glare[0] & ~glare[1])[:, :, None], other, empty)
    drawn = _drawn_vessel(vessel, base.shape[:2])
    if drawn is not None and len(images) > 1 and any(_is_robot(_differs(one, base, noise), drawn) for one in others):
        raise BenchError("the empty pictures differ along the vessel: take them without the robot")
    return _bench(name, empty, noise, known, drawn)


def bench_from_frames(
    frames: Sequence[Image],
    name: str,
    working_size_px: int,
    vessel: Mask | None = None,
    robots: Sequence[Probability] = (),
) -> Bench:
    """The bench as most of the frames show it, with the robot in another place in each, where no empty picture can be taken.

    Raises BenchError: fewer than three frames, of different sizes or benches, or the robot lies still.

    Parameters
    ----------
    frames : RGB uint8 (H, W, 3), of one size.
    vessel : the lumen, drawn at the frames' size, bool (H, W).
    robots : a network's robot probability (h, w) of each frame at working size; without them a place where the robot lies in all
        frames is taken for the empty bench.
    """
    if len(frames) < _LEAST_FRAMES:
        raise BenchError("{count} frames are too few: move the robot to three places", count=len(frames))
    _check_sizes(frames, vessel)
    images = [to_working(frame, working_size_px)[0] for frame in frames]
    sharp = [quality.sharpness(image) for image in images]
    base = images[int(np.argsort(sharp)[len(sharp) // 2])]
    for number, image in enumerate(images, 1):
        if likeness(image, base) < LEAST_LIKENESS:
            raise BenchError("frame {number} shows another bench, or the camera was moved", number=number)
    even = [same_light(image, base) for image in images]
    usable = np.ones((len(even), *base.shape[:2]), np.bool_)
    for index, robot in enumerate(robots):
        usable[index] &= cv2.dilate((robot >= np.float32(0.3)).view(np.uint8), np.ones((7, 7), np.uint8)) == 0
    noise = np.median([picture_noise(image) for image in images], axis=0).astype(np.float32)
    stack = np.stack(even)
    middle = _masked_median(stack, usable)
    agree = np.stack([~_differs(one, middle, noise) for one in even]) & usable
    differing = [float(np.mean(~one)) for one in agree]
    if max(differing) < _MOVED_SHARE:
        raise BenchError("the robot lies still in all frames: move it to three places")
    count = agree.sum(axis=0)
    mean = np.stack([(stack[..., channel] * agree).sum(axis=0) for channel in range(3)], axis=-1) / np.maximum(count, 1)[..., None]
    known = (count >= _AGREED_SHARE * np.maximum(usable.sum(axis=0), 1)) & (count >= 2)
    empty = np.where((count > 0)[:, :, None], mean, middle)
    return _bench(name, empty, noise, known, _drawn_vessel(vessel, base.shape[:2]))


def with_vessel(bench: Bench, vessel: Mask) -> Bench:
    """The bench with another vessel, drawn at its empty picture's size or the camera's, bool (H, W).

    Raises BenchError where the mask cannot be a vessel.
    """
    return replace(bench, vessel=_drawn_vessel(vessel, bench.known.shape))


def _without(values: Sequence[float], index: int) -> list[float]:
    return [value for place, value in enumerate(values) if place != index]


def _bench(name: str, empty: NDArray[np.floating], noise: NDArray[np.float32], known: Mask, vessel: Mask | None) -> Bench:
    """The values in their types; places that are not known are widened by a pixel, whose smoothed neighbours are mixed."""
    unknown = cv2.dilate((~known).view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    picture = np.clip(np.rint(empty), 0, 255).astype(np.uint8)
    return Bench(name, picture, np.maximum(noise, LEAST_NOISE).astype(np.float32), ~unknown, vessel, landmarks_of(picture))


def landmarks_of(empty: Image) -> Points:
    """Corners of a picture (h, w, 3), strongest first, (N, 2); a plain board has none."""
    grey = cv2.GaussianBlur(cv2.cvtColor(empty, cv2.COLOR_RGB2GRAY), (0, 0), 1.0)
    found = cv2.goodFeaturesToTrack(grey, maxCorners=200, qualityLevel=0.02, minDistance=8)
    return np.zeros((0, 2)) if found is None else np.asarray(found.reshape(-1, 2), np.float64)


def reachable(vessel: Mask) -> Mask:
    """Where a robot may lie, bool (h, w): in and beside the vessel, and between the border and those of its ends that are near."""
    height, width = vessel.shape
    side = 2 * BESIDE_PX + 1
    solid = vessel.view(np.uint8)
    area = cv2.dilate(solid, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    depth = cv2.distanceTransform(cv2.copyMakeBorder(solid, 1, 1, 1, 1, cv2.BORDER_REPLICATE), cv2.DIST_L2, 5)[1:-1, 1:-1]
    skeleton = thin(vessel)
    line = np.argwhere(skeleton)
    for x, y in end_pixels(skeleton):
        radius = float(depth[y, x])
        if min(x, y, width - 1 - x, height - 1 - y) < radius + 3:
            continue
        apart = np.hypot(line[:, 0] - y, line[:, 1] - x)
        behind = line[np.argmin(np.abs(apart - _DIRECTION_PX))]
        direction = np.array([x - behind[1], y - behind[0]], np.float64)
        direction /= max(float(np.hypot(*direction)), 1e-6)
        # how far it is to the border in that direction
        ahead = [
            ((last if step > 0 else 0) - place) / step
            for place, step, last in ((x, direction[0], width - 1), (y, direction[1], height - 1))
            if abs(step) > 1e-6
        ]
        length = min(ahead)
        if length > _LONGEST_ENTRY * width:
            continue
        across, start = np.array([-direction[1], direction[0]]), np.array([x, y], np.float64)
        end, narrow = start + direction * (length + 20), across * (radius + BESIDE_PX)
        wide = narrow + across * _ENTRY_SPREAD * length
        cv2.fillConvexPoly(area, np.rint([start + narrow, end + wide, end - wide, start - narrow]).astype(np.int32), [1])
    return np.asarray(area > 0)


BESIDE_PX = 5
"""Width around the drawn vessel in which the robot may lie: outlines are drawn by hand, and a robot presses against the wall."""
_DIRECTION_PX = 25
"""Length of a vessel's end from which its direction is taken."""
_LONGEST_ENTRY = 0.4
"""Of the picture's width: so far the robot's entrance at the picture's border may be from a vessel's end."""
_ENTRY_SPREAD = 0.3
"""By how much of its length the way from a vessel's end to the border widens on each side."""


def same_light(image: Image, base: Image) -> NDArray[np.float32]:
    """`image` (h, w, 3) with the exposure and colour of `base`: a factor for each channel, from the middle half of all pixels."""
    ratio = (base.astype(np.float32) + 1.0) / (image.astype(np.float32) + 1.0)
    gain = np.median(ratio[::4, ::4].reshape(-1, 3), axis=0)
    return np.asarray(image * gain.astype(np.float32), np.float32)


def likeness(image: Image, base: Image) -> float:
    """Correlation -1..1 of the fine structure of two pictures (h, w, 3), which light and focus hardly change."""
    fine = []
    for one in (image, base):
        grey = cv2.cvtColor(one, cv2.COLOR_RGB2GRAY).astype(np.float32)
        detail = cv2.GaussianBlur(grey, (0, 0), 2.0) - cv2.GaussianBlur(grey, (0, 0), 12.0)
        limit = 3.0 * float(np.abs(detail).mean()) + 1.0
        fine.append(np.clip(detail, -limit, limit).ravel())
    return float(np.dot(fine[0], fine[1]) / max(float(np.linalg.norm(fine[0]) * np.linalg.norm(fine[1])), 1e-6))


def picture_noise(image: Image) -> NDArray[np.float32]:
    """Standard deviation of the noise around each pixel of one picture, float32 (h, w), grey levels.

    The median of a second derivative that straight edges do not change (J. Immerkaer, "Fast noise variance estimation", 1996).
    """
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    left = cv2.filter2D(grey, -1, np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6.0)
    return _local_deviation(np.abs(left))


def _noise_between(pictures: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
    """The same from what two or more pictures of one light differ by."""
    greys = [cv2.cvtColor(one, cv2.COLOR_RGB2GRAY) for one in pictures]
    pairs = [np.abs(one - other) / np.sqrt(2.0) for one, other in zip(greys, greys[1:], strict=False)]
    return np.asarray(np.mean([_local_deviation(pair) for pair in pairs], axis=0), np.float32)


def _local_deviation(sizes: NDArray[np.floating]) -> NDArray[np.float32]:
    """Robust deviation around each pixel from absolute values (h, w): their median over 15 px, which the edges do not count in."""
    eighths = np.clip(np.rint(sizes * 8.0), 0, 255).astype(np.uint8)
    return np.asarray(cv2.blur(cv2.medianBlur(eighths, 15).astype(np.float32), (15, 15)) * np.float32(1.4826 / 8.0))


def _differs(one: NDArray[np.floating] | Image, other: NDArray[np.floating] | Image, noise: NDArray[np.float32]) -> Mask:
    """Where two pictures of one light show different things: smoothed, beyond noise, focus and slow changes of light."""
    apart = cv2.GaussianBlur(np.asarray(one, np.float32) - np.asarray(other, np.float32), (0, 0), 2.0)
    slow = cv2.blur(np.clip(apart, -_DIFFERENT_LEVELS, _DIFFERENT_LEVELS), (81, 81))  # no halo around what differs much
    size = np.abs(apart - slow).max(axis=2)
    # a Gaussian of 2 px averages 50 pixels of white noise; that of a camera may be alike in neighbours, and coloured
    smooth_noise = min(_DIFFERENT_SIGMAS * float(np.median(size)), _MOST_SMOOTH_NOISE)
    seeds = size > np.maximum(_DIFFERENT_SIGMAS * noise / 7.0, max(_DIFFERENT_LEVELS, smooth_noise))
    return np.asarray(cv2.dilate(seeds.view(np.uint8), np.ones((9, 9), np.uint8)) > 0)


def _is_robot(unlike: Mask, vessel: Mask) -> bool:
    """Whether two pictures differ by something long that lies in the vessel."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(unlike.view(np.uint8), connectivity=8)
    inside = np.bincount(labels[vessel], minlength=len(stats))
    longest = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1)
    robots = (longest > _ROBOT_SHARE * vessel.shape[1]) & (inside > _INSIDE_SHARE * stats[:, cv2.CC_STAT_AREA])
    return bool(robots[1:].any())


_ROBOT_SHARE, _INSIDE_SHARE = 0.12, 0.5
"""Least length of a robot, of the picture's width, and least share of its area, widened, in the vessel."""


def _mean_without_glare(pictures: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Mean of pictures (h, w, 3) of one light, without those with a reflection at the place, where another has none."""
    weights = [np.where(_beside_glare(one), np.float32(1e-3), np.float32(1.0))[:, :, None] for one in pictures]
    total = np.sum([weight * one for weight, one in zip(weights, pictures, strict=True)], axis=0)
    return np.asarray(total / np.sum(weights, axis=0), np.float32)


def _beside_glare(picture: NDArray[np.float32]) -> Mask:
    """Where a picture (h, w, 3) is overexposed by a reflection, and the halo around it."""
    core = cv2.morphologyEx((picture.min(axis=2) > _GLARE_LEVEL).view(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    return np.asarray(cv2.dilate(core, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_HALO_PX, _HALO_PX))) > 0)


_GLARE_LEVEL, _HALO_PX = 240.0, 121
"""Grey level of all channels in a reflection of a lamp, and the diameter of the halo around its rim."""


def _masked_median(stack: NDArray[np.float32], usable: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Median over the frames (N, h, w, 3) that are `usable` (N, h, w) at a pixel, over all where none is."""
    if usable.all():
        return np.asarray(np.median(stack, axis=0), np.float32)
    chosen = usable | ~usable.any(axis=0)
    ranked = np.sort(np.where(chosen[..., None], stack, np.float32(np.inf)), axis=0)
    middle = (chosen.sum(axis=0) - 1) // 2
    return np.asarray(np.take_along_axis(ranked, middle[None, :, :, None], axis=0)[0], np.float32)


def _check_sizes(pictures: Sequence[Image], vessel: Mask | None) -> None:
    height, width = pictures[0].shape[:2]
    for number, picture in enumerate(pictures, 1):
        if picture.shape[:2] != (height, width):
            raise BenchError(
                "picture {number} has {a}x{b} px, the first {width}x{height}: take all with the same camera",
                number=number,
                a=picture.shape[1],
                b=picture.shape[0],
                width=width,
                height=height,
            )
    if vessel is not None and vessel.shape != (height, width):
        raise BenchError(
            "the vessel mask has {a}x{b} px, the pictures {width}x{height}: draw it on one of them",
            a=vessel.shape[1],
            b=vessel.shape[0],
            width=width,
            height=height,
        )


def _drawn_vessel(vessel: Mask | None, shape: tuple[int, int]) -> Mask | None:
    """The mask at working size (h, w). Raises BenchError where it cannot be a vessel."""
    if vessel is None:
        return None
    share = float(np.mean(vessel))
    border = float(np.mean(np.concatenate([vessel[0], vessel[-1], vessel[:, 0], vessel[:, -1]])))
    if share > _MAX_VESSEL_SHARE or border > _MAX_BORDER_SHARE:
        raise BenchError("the vessel mask covers {share:.0%} of the picture: white must be the vessel", share=share)
    if share < _LEAST_VESSEL_SHARE:
        raise BenchError("the vessel mask is empty: draw the vessel's lumen white")
    if vessel.shape == shape:
        return vessel
    return np.asarray(cv2.resize(vessel.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA) >= 0.5)


def bench_stamp(folder: Path) -> int | None:
    """When the bench in `folder` was written, in nanoseconds; None where it is missing."""
    try:
        return (folder / INFO).stat().st_mtime_ns
    except OSError:
        return None


def check_size(bench: Bench, working_size_px: int, where: str) -> None:
    """Raise BenchError for a bench (of the folder `where`) that was made for another working size."""
    if max(bench.size) != working_size_px:
        raise BenchError(
            "{path}: was made for a working size of {a} px, and {b} px are set; make the bench again",
            path=where,
            a=max(bench.size),
            b=working_size_px,
        )


def read_bench(folder: Path) -> Bench:
    """Raises BenchError: not there, damaged, or of a newer version."""
    path, stamp = folder / INFO, bench_stamp(folder)
    try:
        info = _BenchInfo.model_validate_json(path.read_bytes())
    except OSError as error:
        raise BenchError("{path}: cannot be read ({why}); make the bench again", path=path, why=error.strerror) from None
    except ValidationError as error:
        raise BenchError("{path}: damaged ({why}); make the bench again", path=path, why=first_problem(error)) from None
    if info.format > FORMAT:
        raise BenchError("{path}: format {found} is of a newer version; update the program", path=path, found=info.format)
    files: dict[str, bytes] = {}
    for name, wanted in info.sha256.items():
        if name not in _PICTURES:
            raise BenchError("{path}: names {name}, which no bench has; make the bench again", path=path, name=name)
        try:
            files[name] = (folder / name).read_bytes()
        except OSError as error:
            raise BenchError(
                "{path}: cannot be read ({why}); make the bench again", path=folder / name, why=error.strerror
            ) from None
        if hashlib.sha256(files[name]).hexdigest() != wanted:
            raise BenchError("{path}: cut or damaged (SHA-256); make the bench again", path=folder / name)
    try:
        empty = read_image(folder / EMPTY)
        noise = cv2.imdecode(np.frombuffer(files[NOISE], np.uint8), cv2.IMREAD_UNCHANGED)
        known = _decoded_mask(files[KNOWN])
        vessel = _decoded_mask(files[VESSEL]) if VESSEL in files else None
    except (KeyError, ImageError, cv2.error) as error:
        raise BenchError("{path}: lacks a picture ({why}); make the bench again", path=path, why=error) from None
    size = (info.height, info.width)
    if noise is None or known is None or noise.dtype != np.uint16 or empty.shape[:2] != size:
        raise BenchError("{path}: its pictures are damaged; make the bench again", path=path)
    if any(one is not None and one.shape != size for one in (noise, known, vessel)):
        raise BenchError("{path}: its pictures differ in size; make the bench again", path=path)
    landmarks = np.array(info.landmarks, np.float64).reshape(-1, 2)
    return Bench(info.name, empty, np.asarray(noise / np.float32(_NOISE_STEPS), np.float32), known, vessel, landmarks, stamp)


def _decoded_mask(data: bytes) -> Mask:
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    if pixels is None:
        raise ImageError("a mask cannot be decoded")
    return np.asarray(pixels > 127)


def bench_sha256(folder: Path) -> str:
    """The hash that names a bench: of ``bench.json``, which has the hashes of all its pictures. Raises BenchError."""
    try:
        return hashlib.sha256((folder / INFO).read_bytes()).hexdigest()
    except OSError as error:
        raise BenchError("{path}: cannot be read ({why})", path=folder / INFO, why=error.strerror) from None


def write_bench(bench: Bench, folder: Path) -> None:
    """Write the folder whole, in the place of an older bench. Raises BenchError; an older bench is unchanged then."""
    folder = Path(os.path.realpath(folder))
    noise = np.clip(np.rint(bench.noise * _NOISE_STEPS), 0, 65535).astype(np.uint16)
    files = {EMPTY: png(bench.empty), NOISE: png(noise), KNOWN: mask_png(bench.known)}
    if bench.vessel is not None:
        files[VESSEL] = mask_png(bench.vessel)
    info = _BenchInfo(
        name=bench.name,
        width=bench.size[0],
        height=bench.size[1],
        sha256={name: hashlib.sha256(data).hexdigest() for name, data in files.items()},
        landmarks=tuple((round(x, 2), round(y, 2)) for x, y in bench.landmarks.tolist()),
    )
    files[INFO] = info.model_dump_json(indent=1).encode() + b"\n"
    scratch: Path | None = None
    try:
        if folder.exists() and not (folder.is_dir() and {one.name for one in folder.iterdir()} <= _FILES):
            raise BenchError("{path}: exists and is no bench; choose another folder", path=folder)
        folder.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
        for name, data in files.items():
            with (scratch / name).open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        for kept in (ROBOT_FILE,) if was_moved(bench, folder) else (PHANTOM_FILE, ROBOT_FILE):
            if (folder / kept).is_file():
                shutil.copy2(folder / kept, scratch)
        scratch.chmod(0o755)
        if (aside := replace_folder(scratch, folder)) is not None:
            shutil.rmtree(aside, ignore_errors=True)
    except OSError as error:
        raise BenchError(
            "{path}: cannot be written ({why}); make room, or choose another folder", path=folder, why=error.strerror
        ) from None
    finally:
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)


def was_moved(bench: Bench, folder: Path) -> bool:
    """Whether the camera sees another place than in the bench that is in `folder`."""
    try:
        old = read_bench(folder)
    except BenchError:  # none, or a damaged one
        return False
    if old.size != bench.size or likeness(bench.empty, old.empty) < LEAST_LIKENESS:
        return True
    now, then = (cv2.cvtColor(one.empty, cv2.COLOR_RGB2GRAY).astype(np.float32) for one in (bench, old))
    shift, _ = cv2.phaseCorrelate(now, then, cv2.createHanningWindow(bench.size, cv2.CV_32F))
    return math.hypot(*shift) > _SAME_PLACE_SHARE * max(bench.size)
