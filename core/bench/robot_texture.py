"""How the real robot looks: straightened pictures of it with opacity, from frames and their masks, kept in the bench's folder.

The twin paints its robot with them into the bench's empty picture (``hardware/twin/rendering``).
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.bench.bench import ROBOT_FILE, Bench, BenchError
from core.bench.registration import register
from core.config.models import PerceptionConfig
from core.devices import disk_errors
from core.files import write_atomic
from core.learning.dataset import Sample
from core.perception import robot_path, skeleton
from core.types import Image, Mask, Masks, Point, Refusal

_FORMAT = 1
REACH_RADII, _COLUMNS = 2.5, 41
"""A texture shows so much of the robot's surroundings on either side, from its middle, in so many columns in all."""
_MOST_ROWS, _LEAST_ROWS = 400, 40
"""Rows of a texture: behind them a robot goes on as it is there; one that shows less is left out."""
_MOST_TEXTURES, PAINTED_TEXTURES = 32, 8
"""So many are kept, for what covers the robot; the first ones, in which it is longest, are painted."""
_EDGE_PX, _RIM_RADII = 0.7, 1.3
"""Blur of a mask's edge; beyond the rim, what darkens the bench is the robot's shadow."""
_COVERED_SHARE, _COVERING_LEVELS, _COVER_ROWS = 0.3, 80.0, 9
"""A row with less of the usual contrast, or with so bright a line above it, is covered; so are the nearest of as many rows."""
_RING_ROWS = 5
"""Fewer rows without contrast are a ring of the robot as bright as the bench."""
_EVEN_ROWS = 15
"""Over so many rows the edges are evened out."""
_LEAST_PASSES = 2
"""Of frames, where something is to cover the robot: one alone may show it faintly there."""
_FAINTEST_SHADOW, _DEEPEST_SHADOW = 0.03, 0.4
_LINE_PX, _LINE_LEVELS = 9, 12.0
"""Width and least brightness (grey levels) of reflections and bright edges of a vessel, which lie above the robot."""
_NO_LINE = np.zeros((0, 3), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class RobotTexture:
    """The robot of one frame, in the light of the bench's empty picture.

    ``rgba`` : uint8 (rows, columns, 4); a row for each px of working size, from the mask's end at the head backwards, columns from
    the robot's left to its right over ``REACH_RADII`` radii each. ``radius_px`` and ``tail_px``, where its line begins: at working
    size. ``line`` (N, 3): places of the robot, and how much of its usual contrast it has there, 0 to 1.
    """

    rgba: NDArray[np.uint8]
    radius_px: float
    tail_px: Point
    line: NDArray[np.float32] = field(default_factory=lambda: _NO_LINE)


def texture_of(image: Image, robot: Mask, doubtful: Mask, bench: Bench) -> RobotTexture | None:
    """The robot of a frame (h, w, 3) with its masks (h, w); None where its line is not clear, or the frame is of another place."""
    view = register(image, bench)
    if isinstance(view, Refusal):
        return None
    soft = np.asarray(cv2.GaussianBlur(robot.astype(np.float32), (0, 0), _EDGE_PX), np.float32)
    masks, config = Masks(view.reachable, robot, view.reachable.astype(np.float32), soft), PerceptionConfig()
    path = robot_path.find(skeleton.repair(skeleton.thin_masks(masks, config), config.gaps), masks, config)
    if isinstance(path, Refusal):
        return None
    radius = path.radius_px
    line = geometry.resample(path.points[::-1], 1.0)[:_MOST_ROWS]
    if len(line) < _LEAST_ROWS:
        return None
    across = np.linspace(-REACH_RADII, REACH_RADII, _COLUMNS)
    places = line[:, None] - geometry.normals(line)[:, None] * (radius * across)[None, :, None]
    x, y = (np.ascontiguousarray(places[..., axis], np.float32) for axis in (0, 1))

    def straightened(picture: NDArray[np.generic]) -> NDArray[np.float32]:
        return cv2.remap(picture.astype(np.float32), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float32)

    light = (view.placed.astype(np.float32) + 1.0) / (view.empty.astype(np.float32) + 1.0)
    seen, behind, alpha = straightened(image * light), straightened(view.placed), straightened(soft)
    above = np.minimum(straightened(lines_above(view.placed)), _COVERING_LEVELS)
    middle = np.abs(across) < 0.5
    contrast = np.abs(seen - behind)[:, middle].mean(axis=(1, 2))
    is_seen = (alpha[:, middle].min(axis=1) > 0.7) & (straightened(doubtful)[:, middle].max(axis=1) < 0.3)
    contrast = cv2.morphologyEx(contrast[:, None], cv2.MORPH_CLOSE, np.ones((_RING_ROWS, 1), np.uint8))[:, 0]
    shown = np.clip(contrast / max(float(np.median(contrast)), 1e-6), 0.0, 1.0)
    is_seen &= (shown > _COVERED_SHARE) & (above[:, middle].max(axis=(1, 2)) < _COVERING_LEVELS)
    tip = round(3 * radius)
    is_seen[:tip] = True  # a tip may have little contrast
    is_seen = cv2.erode(is_seen.view(np.uint8)[:, None], np.ones((_COVER_ROWS, 1), np.uint8))[:, 0] > 0
    seen, behind = (np.asarray(255.0 * (one - above) / (255.0 - above), np.float32) for one in (seen, behind))  # below the lines
    if is_seen.sum() < _LEAST_ROWS:
        return None
    alpha = np.asarray(cv2.blur(alpha, (1, _EVEN_ROWS)), np.float32)
    alpha[: round(radius)] = alpha[round(radius)]  # how round its end is, is left to where it is painted
    colour = behind + (seen - behind) / np.maximum(alpha, 0.5)[..., None]
    darker = 1.0 - np.median(((seen + 1.0) / (behind + 1.0)).mean(axis=2)[is_seen], axis=0)
    is_shadow = (np.abs(across) > _RIM_RADII) & (darker > _FAINTEST_SHADOW)
    colour[:, is_shadow], alpha[:, is_shadow] = 0.0, np.minimum(darker[is_shadow], _DEEPEST_SHADOW)
    rgba = np.concatenate([colour, 255.0 * alpha[..., None]], axis=2)
    rows = np.flatnonzero(is_seen)
    nearest = rows[np.abs(np.arange(len(line))[:, None] - rows).argmin(axis=1)]  # what is hidden looks as its neighbours do
    shares = np.concatenate([line, shown[:, None]], axis=1)[tip:].astype(np.float32)
    return RobotTexture(np.clip(np.rint(rgba[nearest]), 0, 255).astype(np.uint8), radius, path.tail, shares)


def textures_of(samples: Sequence[Sample], bench: Bench) -> list[RobotTexture]:
    """The robots of labelled frames of the bench, at working size, the longest first. Raises DatasetError."""
    found = []
    for sample in samples:
        image, _, robot = sample.load(max(bench.size))
        texture = texture_of(image, robot, sample.load_doubtful(robot.shape), bench)
        found += [texture] if texture is not None else []
    return sorted(found, key=lambda one: -len(one.rgba))[:_MOST_TEXTURES]


def entry_of(textures: Sequence[RobotTexture]) -> Point | None:
    """Where the robot enters the picture, in px of working size; None where that was not seen."""
    if not textures:
        return None
    x, y = np.median([one.tail_px for one in textures], axis=0).tolist()
    return x, y


def covers_of(textures: Sequence[RobotTexture], shape: tuple[int, int]) -> NDArray[np.float32]:
    """How opaque (h, w), 0 to 1, a clip or the like is that covers the robot: it is hardly seen there in most frames that pass."""
    seen = np.full((max(1, len(textures)), *shape), np.nan, np.float32)
    for layer, one in zip(seen, textures, strict=False):
        inside = np.all((one.line[:, :2] > -0.5) & (one.line[:, :2] < (shape[1] - 0.5, shape[0] - 0.5)), axis=1)
        x, y = np.rint(one.line[inside, :2]).astype(int).T
        off_line = np.ones(shape, np.uint8)
        off_line[y, x] = 0
        away, nearest = cv2.distanceTransformWithLabels(off_line, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
        shares = np.ones(int(nearest.max()) + 1, np.float32)
        shares[nearest[y, x]] = one.line[inside, 2]
        layer[:] = np.where(away <= _RIM_RADII * one.radius_px, shares[nearest], np.nan)
    passed = np.sum(~np.isnan(seen), axis=0) >= _LEAST_PASSES
    covers = np.zeros(shape, np.float32)
    shown = np.nanmedian(seen[:, passed], axis=0)
    covers[passed] = np.where(shown < _COVERED_SHARE, 1 - shown, 0)
    return covers


def lines_above(empty: Image) -> NDArray[np.float32]:
    """The part of the empty picture (h, w, 3) that lies above the robot: narrow reflections and bright edges of the vessel."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_LINE_PX, _LINE_PX))
    thin = cv2.morphologyEx(empty, cv2.MORPH_TOPHAT, disc).astype(np.float32)
    return np.asarray(np.maximum(thin - np.float32(_LINE_LEVELS), 0.0), np.float32)


def write_textures(textures: Sequence[RobotTexture], folder: Path) -> None:
    """Keep them in the folder of their bench; none: remove older ones. Raises BenchError."""
    path = folder / ROBOT_FILE
    arrays: dict[str, Any] = {f"rgba_{number}": one.rgba for number, one in enumerate(textures)}
    arrays |= {f"line_{number}": one.line for number, one in enumerate(textures)}
    data = io.BytesIO()
    arrays |= {"format": _FORMAT, "robots": [(one.radius_px, *one.tail_px) for one in textures]}
    np.savez_compressed(data, **arrays)
    with disk_errors(BenchError, path, "cannot be written", "; make room, or choose another folder"):
        if textures:
            write_atomic(path, data.getvalue())
        else:
            path.unlink(missing_ok=True)


def read_textures(folder: Path) -> list[RobotTexture]:
    """Those kept with a bench; none where no frame showed the robot. Raises BenchError: damaged, or of a newer version."""
    path = folder / ROBOT_FILE
    try:
        if not path.exists():
            return []
        with np.load(io.BytesIO(path.read_bytes())) as file:
            if (found_format := int(file["format"])) > _FORMAT:
                raise BenchError("{path}: format {found} is of a newer version; update the program", path=path, found=found_format)
            robots = file["robots"].tolist()
            lines = [file[name] if (name := f"line_{number}") in file else _NO_LINE for number in range(len(robots))]
            found = [
                RobotTexture(file[f"rgba_{number}"], radius, (x, y), line)
                for number, ((radius, x, y), line) in enumerate(zip(robots, lines, strict=True))
            ]
    except (OSError, ValueError, TypeError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise BenchError("{path}: damaged ({why}); make the bench again", path=path, why=error) from None
    if any(
        one.rgba.dtype != np.uint8
        or one.rgba.shape[1:] != (_COLUMNS, 4)
        or not one.radius_px > 0.0
        or one.line.shape[1:] != (3,)
        or not np.isfinite(one.line).all()
        for one in found
    ):
        raise BenchError("{path}: damaged ({why}); make the bench again", path=path, why="size")
    return found
