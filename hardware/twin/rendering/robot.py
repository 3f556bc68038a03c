"""The robot in the picture: exact distances of pixels to its body line, and painting of its body and sheath from them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from core.bench.robot_texture import REACH_RADII, RobotTexture
from core.types import Points
from hardware.twin.rendering.appearance import Appearance
from hardware.twin.view import CameraView

F32 = NDArray[np.float32]

_LONGEST_PIECE_MM = 2.2


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Pixels near the robot's body line, arrays of shape (K,).

    ``pixel`` is the flat index into the image, ``distance_mm`` the distance to the line (both ends round), ``from_tip_mm`` and
    ``from_tail_mm`` the arc length from either end to the nearest point of the line, ``side`` the signed lateral position (-1..1
    over the robot's width) and ``normal`` (K, 2) the normal of the line there.
    """

    pixel: NDArray[np.int64]
    distance_mm: F32
    from_tip_mm: F32
    from_tail_mm: F32
    side: F32
    normal: F32


def measure_band(points_mm: Points, radius_mm: float, reach_mm: float, view: CameraView, grid_mm: F32) -> Band:
    """Exact distances to the polyline `points_mm` (N, 2) for all pixels nearer than `reach_mm`.

    Every piece is compared with the pixels of a small square window around it; the nearest piece wins.
    """
    height, width = grid_mm.shape[:2]
    points = _subdivide(points_mm)
    start, step = points[:-1], np.diff(points, axis=0)
    length = np.linalg.norm(step, axis=1)
    start, step, length = start[length > 0], step[length > 0], length[length > 0]
    visible, corner, side_px = _windows(start + step / 2, length / 2 + reach_mm, view)
    window = np.arange(side_px)
    x, y = corner[:, 0, None] + window, corner[:, 1, None] + window
    inside = ((y >= 0) & (y < height))[:, :, None] & ((x >= 0) & (x < width))[:, None, :]
    pixel = np.clip(y, 0, height - 1)[:, :, None] * width + np.clip(x, 0, width - 1)[:, None, :]
    # Windows of one size make dense arrays (pieces, rows, columns), so data of a piece are not copied for its pixels.
    (start_x, start_y), (step_x, step_y) = (part[visible].T.astype(np.float32)[..., None, None] for part in (start, step))
    offset_x, offset_y = grid_mm[..., 0].reshape(-1)[pixel] - start_x, grid_mm[..., 1].reshape(-1)[pixel] - start_y
    squared = (length[visible] ** 2).astype(np.float32)[:, None, None]
    share = np.clip((offset_x * step_x + offset_y * step_y) / squared, 0, 1)
    distance = np.sqrt((offset_x - share * step_x) ** 2 + (offset_y - share * step_y) ** 2)
    near = np.flatnonzero((distance < reach_mm) & inside)
    near = near[_winners(pixel.reshape(-1)[near], distance.reshape(-1)[near], height * width)]
    pixel, distance, share = pixel.reshape(-1)[near], distance.reshape(-1)[near], share.reshape(-1)[near]
    piece = visible[near // side_px**2]
    unit = (step / length[:, None])[piece].astype(np.float32)
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])
    lateral = offset_x.reshape(-1)[near] * normal[:, 0] + offset_y.reshape(-1)[near] * normal[:, 1]
    side = np.sign(lateral) * np.minimum(distance / np.float32(radius_mm), 1)
    before = np.concatenate([[0.0], np.cumsum(length)])
    from_tail = (before[piece] + share * length[piece]).astype(np.float32)
    return Band(pixel, distance, np.float32(before[-1]) - from_tail, from_tail, side.astype(np.float32), normal)


def _winners(pixel: NDArray[np.int64], distance: F32, size: int) -> NDArray[np.int64]:
    """Index of the smallest distance of each pixel; the last of equal ones."""
    nearest = np.full(size, np.inf, np.float32)
    np.minimum.at(nearest, pixel, distance)
    place = np.flatnonzero(distance == nearest[pixel])
    owner = np.empty(size, np.int64)
    owner[pixel[place]] = place
    last: NDArray[np.int64] = place[owner[pixel[place]] == place]
    return last


def _subdivide(points: Points) -> Points:
    """The same polyline in pieces of at most 2.2 mm, so that one window size suits all."""
    pieces = np.maximum(1, np.ceil(np.linalg.norm(np.diff(points, axis=0), axis=1) / _LONGEST_PIECE_MM)).astype(int)
    if len(pieces) and pieces.max() == 1:
        return points
    index = np.repeat(np.arange(len(pieces)), pieces)
    first = np.cumsum(pieces) - pieces
    share = (np.arange(len(index)) - first[index]) / pieces[index]
    return np.vstack([points[index] + share[:, None] * np.diff(points, axis=0)[index], points[-1:]])


def _windows(
    middle_mm: Points, reach_mm: NDArray[np.float64], view: CameraView
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """The pieces that are visible, the corners (K, 2) of their windows in pixels, and the side of a window.

    All are as large as the largest that any piece needs.
    """
    width, height = view.size
    half = int(np.ceil(1.06 * float(np.max(reach_mm * view.scales(middle_mm))) + 1)) if len(middle_mm) else 0
    corner = np.rint(view.project(middle_mm)).astype(np.int64) - half
    visible = np.flatnonzero(np.all((corner + 2 * half >= 0) & (corner < (width, height)), axis=1))
    return visible, corner[visible], 2 * half + 1


def paint_sheath(canvas: F32, band: Band, coverage: F32, appearance: Appearance) -> None:
    """Blend the catheter sheath over the flat `canvas` (H * W, 3): a translucent tube around the robot, brighter at its edges."""
    edge = np.clip(band.distance_mm / np.float32(appearance.robot_radius_mm + appearance.sheath_extra_mm), 0, 1) ** 4
    alpha = (coverage * appearance.sheath_opacity * (0.7 + 0.3 * edge))[:, None]
    colour = np.asarray(appearance.sheath_rgb, np.float32) * (0.85 + 0.3 * edge)[:, None]
    canvas[band.pixel] = canvas[band.pixel] * (1 - alpha) + colour * alpha


def paint_robot(canvas: F32, band: Band, coverage: F32, lit: F32, appearance: Appearance, light: F32) -> None:
    """Blend the robot over the flat `canvas` (H * W, 3).

    `coverage` (K,) is the share of each pixel that the body covers; `lit` (K,) in -1..1 says how far the pixel lies on the side
    that faces the lamp; `light` (K,) is how bright the lamp shines there.
    """
    colour, strength = _body_colour(band, appearance)
    if appearance.material == "xray":
        _absorb(canvas, band, coverage * strength, colour, appearance)
        return
    shade = (1 - 0.35 * band.side**2 + 0.22 * lit)[:, None].astype(np.float32)
    gloss = appearance.robot_gloss * np.exp(-(((lit - 0.35) / 0.28) ** 2))[:, None]
    painted = colour * shade * light[:, None]
    painted += gloss.astype(np.float32) * (np.float32(1) - painted) * np.float32(0.8)
    alpha = (coverage * strength * appearance.robot_opacity)[:, None].astype(np.float32)
    canvas[band.pixel] = canvas[band.pixel] * (1 - alpha) + painted * alpha


def paint_texture(canvas: F32, band: Band, texture: RobotTexture, radius_mm: float, from_head_mm: F32) -> None:
    """Blend the straightened picture of a real robot over the flat `canvas` (H * W, 3).

    `from_head_mm` (K, 2) leads from the head of the line, a radius behind the robot's end, to each pixel.
    """
    rows, columns = texture.rgba.shape[:2]
    reach, pitch = np.float32(radius_mm * REACH_RADII), np.float32(texture.radius_px / radius_mm)
    is_ahead, across = band.from_tip_mm <= 0, np.sum(from_head_mm * band.normal, axis=1)
    ahead = np.sqrt(np.maximum(band.distance_mm**2 - across**2, 0))
    row = np.float32(texture.radius_px) + pitch * np.where(is_ahead, -ahead, band.from_tip_mm)
    half = np.float32((rows - 1) / 2)  # a longer robot goes on with the rear half, to and fro
    row = np.minimum(row, 2 * half) - half + np.abs(half - np.maximum(row - 2 * half, 0) % (2 * half))
    across = np.where(is_ahead, across, np.sign(band.side) * band.distance_mm)
    shape = -(-len(row) // 512), 512  # OpenCV takes no longer lines
    x, y = np.resize((across / reach + 1) * np.float32((columns - 1) / 2), shape), np.resize(row, shape)
    taken = cv2.remap(texture.rgba, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    seen = taken.reshape(-1, 4)[: len(row)].astype(np.float32) / np.float32(255)
    inside = np.where(
        is_ahead, np.clip((np.float32(radius_mm) - band.distance_mm) * pitch + np.float32(0.5), 0, 1), band.distance_mm < reach
    )
    alpha = seen[:, 3:] * inside[:, None]
    canvas[band.pixel] = canvas[band.pixel] * (1 - alpha) + seen[:, :3] * alpha


def _absorb(canvas: F32, band: Band, coverage: F32, colour: F32, appearance: Appearance) -> None:
    """X-rays: the longer the way through the device, the darker."""
    thickness = 0.45 + 0.55 * np.sqrt(np.clip(1 - band.side**2, 0, 1))
    alpha = (coverage * appearance.robot_opacity * thickness)[:, None]
    canvas[band.pixel] *= (1 - alpha * (1 - colour)).astype(np.float32)


def _body_colour(band: Band, appearance: Appearance) -> tuple[F32, F32]:
    """Colour (K, 3) and contrast (K,) along the body: rings, bands, braid and tip."""
    base, accent = np.asarray(appearance.robot_rgb, np.float32), np.asarray(appearance.robot_accent_rgb, np.float32)
    tip = np.asarray(appearance.tip_rgb, np.float32)
    share = _pattern(band, appearance)[:, None]
    colour = base * (1 - share) + accent * share
    in_tip = np.clip((appearance.tip_mm - band.from_tip_mm) / 0.4 + 0.5, 0, 1).astype(np.float32)
    if appearance.robot_look not in ("plain_dark", "black_wire"):
        colour = colour * (1 - in_tip[:, None]) + tip * in_tip[:, None]
    fade = np.clip((appearance.tip_mm * 1.5 - band.from_tip_mm) / (0.5 * appearance.tip_mm), 0, 1)
    strength = 1 - (1 - appearance.tip_contrast) * fade
    return colour.astype(np.float32), strength.astype(np.float32)


def _pattern(band: Band, appearance: Appearance) -> F32:
    """Share of the accent colour (K,)."""
    look, pitch = appearance.robot_look, appearance.ring_pitch_mm
    phase = (band.from_tip_mm / pitch) % 1.0
    if look in ("ringed", "translucent"):
        share = np.clip((appearance.ring_share / 2 - np.abs(phase - 0.5)) * pitch / 0.25 + 0.5, 0, 1)
    elif look == "banded":
        share = ((band.from_tip_mm / (4 * pitch)) % 1.0 < appearance.ring_share).astype(np.float32)
    elif look == "metallic":
        share = 0.5 + 0.5 * np.sin(2 * np.pi * (band.from_tip_mm / (0.35 * pitch) + 0.3 * band.side))
        share = 0.5 * share
    else:
        share = np.zeros(len(phase))
    return np.asarray(share, np.float32)
