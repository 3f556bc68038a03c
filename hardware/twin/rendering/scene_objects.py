"""Unlabelled objects in the picture.

Beside the vessel: cables, ruler, stickers, stains, boxes of equipment, hands. On the vessel, which stays labelled under them:
clips, connectors, air bubbles, dust.
"""

from __future__ import annotations

import colorsys
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.types import Points
from hardware.twin.phantom import BOARD_MM, Phantom
from hardware.twin.rendering.appearance import Appearance
from hardware.twin.rendering.background import U8, fill, level, normals, random_edge, stroke
from hardware.twin.rendering.vessel import Layers
from hardware.twin.view import CameraView, LumenField

_SKIN_AND_GLOVES = ((225, 180, 150), (190, 135, 105), (120, 80, 60), (90, 130, 200), (120, 100, 190), (235, 235, 230), (50, 55, 60))


def cast_shadow(canvas: U8, mask: U8, strength: float, blur_px: float) -> None:
    """Darken `canvas` (H, W, 3) where `mask` (H, W, 0..255) is set, with soft edges."""
    x, y, width, height = cv2.boundingRect(mask)
    pad = int(3 * blur_px) + 1
    window = slice(max(y - pad, 0), y + height + pad), slice(max(x - pad, 0), x + width + pad)
    if width and height:
        soft = cv2.GaussianBlur(mask[window], (0, 0), max(0.8, blur_px)).astype(np.float32)
        canvas[window] = (canvas[window] * (1 - np.float32(strength / 255) * soft)[..., None]).astype(np.uint8)


def place_object(canvas: U8, view: CameraView, field: LumenField, rng: Generator) -> None:
    """Paint a box or a hand with its shadow on `canvas` (H, W, 3) where it covers no lumen, if there is room."""
    for _ in range(6):
        mask = np.zeros(canvas.shape[:2], np.uint8)
        if rng.random() < 0.6:
            _box(mask, view, rng)
            colour = np.full(3, rng.choice([rng.uniform(10, 70), rng.uniform(120, 245)])) + rng.uniform(-12, 12, 3)
        else:
            _hand(mask, view, rng)
            colour = np.asarray(_SKIN_AND_GLOVES[int(rng.integers(len(_SKIN_AND_GLOVES)))], float)
        if mask.any() and not np.any((mask > 0) & (field.distance_mm < field.reach_mm - 1)):
            break
    else:
        return
    scale = view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
    cast_shadow(canvas, mask, 0.5, 1.5 * scale)
    # Darker towards the rim, by the blurred outline.
    height = cv2.GaussianBlur(mask, (0, 0), 2.5 * scale).astype(np.float32) / np.float32(255)
    alpha = mask.astype(np.float32)[..., None] / 255
    painted = colour.astype(np.float32) * (0.5 + 0.55 * height)[..., None]
    canvas[:] = np.clip(canvas * (1 - alpha) + painted * alpha, 0, 255).astype(np.uint8)


def _box(mask: U8, view: CameraView, rng: Generator) -> None:
    """A rectangle, more often near the rim of the board than in its middle."""
    side, angle = rng.uniform(8, 45, 2), rng.normal(0, 0.3)
    place = rng.uniform((-10, -10), np.array(BOARD_MM) + 10)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * side / 2 @ turn + place
    fill(mask, view.project(corners), 255)


def _hand(mask: U8, view: CameraView, rng: Generator) -> None:
    """A palm at the rim of the picture with fingers that point inwards."""
    width, height = view.size
    scale = view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
    root = rng.uniform((0, 0), (width, height))
    axis = int(rng.integers(2))
    root[axis] = view.size[axis] * int(rng.integers(2))
    inward = np.array([width / 2, height / 2]) - root
    aim = np.arctan2(inward[1], inward[0]) + rng.normal(0, 0.5)
    palm = root - 12 * scale * np.array([np.cos(aim), np.sin(aim)])
    cv2.circle(mask, (int(palm[0]), int(palm[1])), int(26 * scale), 255, -1, cv2.LINE_AA)
    for finger in range(int(rng.integers(1, 5))):
        direction = aim + (finger - 1.5) * 0.3
        knuckle = palm + 22 * scale * np.array([np.cos(direction), np.sin(direction)])
        bend = direction + rng.normal(0, 0.3)
        middle = knuckle + rng.uniform(12, 22) * scale * np.array([np.cos(direction), np.sin(direction)])
        tip = middle + rng.uniform(10, 20) * scale * np.array([np.cos(bend), np.sin(bend)])
        stroke(mask, np.array([knuckle, middle, tip]), 255, 13 * scale)


F32 = NDArray[np.float32]


def add_board_clutter(
    appearance: Appearance, board: F32, view: CameraView, phantom: Phantom, field: LumenField, rng: Generator
) -> F32:
    """`board` (H, W, 3) with the objects beside the vessel."""
    canvas = np.asarray(cv2.convertScaleAbs(board, alpha=255.0), np.uint8)
    scale = view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
    _stains(appearance, canvas, scale, rng)
    for _ in range(appearance.labels):
        _sticker(appearance, canvas, view, rng)
    for _ in range(appearance.objects):
        place_object(canvas, view, field, rng)
    if appearance.ruler:
        _ruler(appearance, canvas, view, field, rng)
    for _ in range(appearance.cables):
        path = _cable_path(view, phantom, field, appearance, rng)
        if path is not None:
            _cable(appearance, canvas, path, scale, rng)
    return np.asarray(canvas.astype(np.float32) / 255, np.float32)


def _random_colour(appearance: Appearance, rng: Generator) -> tuple[float, float, float]:
    if appearance.material == "xray":
        level = float(rng.uniform(0.05, 0.3))
        return level, level, level
    if rng.random() < 0.45:
        level = float(rng.choice([rng.uniform(0.02, 0.25), rng.uniform(0.7, 1.0)]))
        return level, level, level
    return colorsys.hsv_to_rgb(rng.random(), rng.uniform(0.4, 1.0), rng.uniform(0.25, 0.95))


def _stains(appearance: Appearance, canvas: U8, scale: float, rng: Generator) -> None:
    height, width = canvas.shape[:2]
    for _ in range(appearance.stains):
        size = int(max(3, rng.uniform(3, 14) * scale))
        x, y = int(rng.integers(-size // 2, width)), int(rng.integers(-size // 2, height))
        window = canvas[max(y, 0) : y + size, max(x, 0) : x + size]
        if window.size == 0:
            continue
        blob = np.zeros(window.shape[:2], np.float32)
        for _ in range(4):
            centre = rng.uniform(0.3, 0.7, 2) * size
            cv2.circle(blob, (int(centre[0]), int(centre[1])), max(1, int(rng.uniform(0.08, 0.25) * size)), 1.0, -1)
        blob = cv2.GaussianBlur(blob, (0, 0), max(0.5, 0.08 * size))[..., None] * np.float32(rng.uniform(-0.35, 0.2))
        window[:] = np.clip(window * (1 + blob), 0, 255).astype(np.uint8)


def _sticker(appearance: Appearance, canvas: U8, view: CameraView, rng: Generator) -> None:
    """A paper label with writing, a piece of tape, or writing on the board itself."""
    place, angle = rng.uniform((0, 0), BOARD_MM), rng.normal(0, 0.25)
    wide, tall = rng.uniform(10, 30), rng.uniform(5, 12)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    corners = np.array([[0, 0], [wide, 0], [wide, tall], [0, tall]]) @ turn + place
    pixels = view.project(corners)
    paper = rng.random() < 0.7 and appearance.material != "xray"
    if paper:
        colour = (0.95, 0.95, 0.92) if rng.random() < 0.6 else _random_colour(appearance, rng)
        fill(canvas, pixels, level(colour))
        stroke(canvas, np.vstack([pixels, pixels[:1]]), level(colour, 0.8), 1)
    ink = level(rng.uniform(0, 0.4, 3)) if paper or np.mean(appearance.board_rgb) > 0.4 else level((0.9, 0.9, 0.9))
    text = "".join(rng.choice(list("ABCDEFGHKLMNPRSTUVXYZ0123456789-"), int(rng.integers(1, 8))))
    size = max(0.25, 0.022 * tall * view.pixels_per_mm((float(place[0]), float(place[1]))))
    x, y = pixels[3] + 0.2 * (pixels[1] - pixels[3])
    cv2.putText(canvas, text, (int(x), int(y)), cv2.FONT_HERSHEY_SIMPLEX, size, ink, max(1, int(size * 2)), cv2.LINE_AA)


def _ruler(appearance: Appearance, canvas: U8, view: CameraView, field: LumenField, rng: Generator) -> None:
    """A ruler along one side of the board, where it does not cover the vessel."""
    wide = rng.uniform(12, 24)
    for _ in range(6):
        along = bool(rng.random() < 0.6)
        start = rng.uniform((0, -wide), (80, BOARD_MM[1])) if along else rng.uniform((-wide, 0), (BOARD_MM[0], 30))
        run, side = (np.array([120.0, 0]), np.array([0, wide])) if along else (np.array([0, 120.0]), np.array([wide, 0]))
        corners = view.project(np.array([start, start + run, start + run + side, start + side]))
        mask = np.zeros(canvas.shape[:2], np.uint8)
        fill(mask, corners, 255)
        if not np.any((mask > 0) & (field.distance_mm < 1.0)):
            break
    else:
        return
    colour = _random_colour(appearance, rng) if rng.random() < 0.5 else (0.8, 0.8, 0.78)
    ink = level((0.05, 0.05, 0.05)) if np.mean(colour) > 0.4 else level((0.95, 0.95, 0.95))
    fill(canvas, corners, level(colour))
    for millimetre in range(0, 121):
        tick = wide * (0.45 if millimetre % 10 == 0 else 0.32 if millimetre % 5 == 0 else 0.2)
        foot = start + run * millimetre / 120
        stroke(canvas, view.project(np.array([foot, foot + side / wide * tick])), ink, 1)
        if millimetre % 10 == 0:
            x, y = view.project((foot + side * 0.75)[None])[0]
            if abs(x) < 10_000 and abs(y) < 10_000:
                cv2.putText(canvas, str(millimetre // 10), (int(x), int(y)), cv2.FONT_HERSHEY_SIMPLEX, 0.3, ink, 1, cv2.LINE_AA)


def _cable_path(view: CameraView, phantom: Phantom, field: LumenField, appearance: Appearance, rng: Generator) -> Points | None:
    """A smooth line in px clear of the lumen, across the free board or close beside a vessel. None: no room."""
    keep_off = appearance.wall_mm + 1.2
    best, best_length = None, 40
    for _ in range(5):
        points = _beside(view, phantom, rng) if rng.random() < 0.45 else _across(view, rng)
        for piece in _free_pieces(points, view, field, keep_off):
            if len(piece) > best_length:
                best, best_length = piece, len(piece)
        if best is not None and rng.random() < 0.5:
            break
    return best


def _across(view: CameraView, rng: Generator) -> Points:
    """A random smooth curve through the picture, one point per px or so."""
    width, height = view.size
    knots = rng.uniform((-0.1 * width, -0.1 * height), (1.1 * width, 1.1 * height), (4, 2))
    if rng.random() < 0.6:
        knots[0] = [rng.choice([-10, width + 10]), rng.uniform(0, height)]
    t = np.linspace(0, 1, 2 * width)[:, None]
    return np.asarray((1 - t) ** 3 * knots[0] + 3 * t * (1 - t) ** 2 * knots[1] + 3 * t**2 * (1 - t) * knots[2] + t**3 * knots[3])


def _beside(view: CameraView, phantom: Phantom, rng: Generator) -> Points:
    """A line that runs along a vessel outside of its wall."""
    edge = random_edge(phantom, rng)
    normal = normals(edge.points)
    away = (float(edge.radius.max()) + rng.uniform(3.0, 12.0)) * rng.choice([-1.0, 1.0])
    line = edge.points + normal * (away + rng.uniform(-2, 2) * np.sin(np.linspace(0, rng.uniform(1, 8), len(normal))))[:, None]
    pixels = view.project(line)
    steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(pixels, axis=0), axis=1))])
    dense = np.arange(0.0, steps[-1], 1.0)
    line_px = np.column_stack([np.interp(dense, steps, pixels[:, axis]) for axis in (0, 1)])
    if len(line_px) > 30:
        line_px = cv2.blur(line_px, (1, 25), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(line_px, np.float64)


def _free_pieces(points: Points, view: CameraView, field: LumenField, keep_off_mm: float) -> Iterator[Points]:
    """The stretches of a line that do not come nearer than `keep_off_mm` to the lumen."""
    width, height = view.size
    index = np.rint(points).astype(int)
    seen = np.all((index >= 0) & (index < (width, height)), axis=1)
    free = np.ones(len(points), bool)
    free[seen] = field.distance_mm[index[seen, 1], index[seen, 0]] > keep_off_mm
    breaks = np.flatnonzero(np.diff(free.astype(int))) + 1
    for piece, ok in zip(np.split(points, breaks), np.split(free, breaks), strict=True):
        if ok[0] and np.any(np.all((piece > 0) & (piece < (width, height)), axis=1)):
            yield piece


def _cable(appearance: Appearance, canvas: U8, path: Points, scale: float, rng: Generator) -> None:
    colour, wide = _random_colour(appearance, rng), float(rng.uniform(0.8, 3.2) * scale)
    points = path[:: max(1, int(len(path) / 300))]
    angle = np.deg2rad(appearance.light_deg)
    lamp = np.array([np.cos(angle), np.sin(angle)])
    if appearance.material == "xray":
        dark = canvas.copy()
        stroke(dark, points, (0, 0, 0), max(1.0, 0.6 * wide))
        cv2.addWeighted(dark, 0.6, canvas, 0.4, 0, dst=canvas)
        return
    shadow = np.zeros(canvas.shape[:2], np.uint8)
    stroke(shadow, points - lamp * 0.6 * wide, 255, wide)
    cast_shadow(canvas, shadow, 0.25 + 0.5 * appearance.tube_shadow, 0.8 * scale)
    stroke(canvas, points, level(colour, 0.7), wide)
    stroke(canvas, points + lamp * 0.1 * wide, level(colour), max(1.0, 0.65 * wide))
    if rng.random() < 0.7:
        stroke(canvas, points + lamp * 0.22 * wide, level(np.asarray(colour) * 0.5 + 0.5), max(1.0, 0.2 * wide))
    if rng.random() < 0.4:
        stroke(canvas, points[-max(2, int(8 * scale * len(points) / len(path))) :], level(rng.uniform(0.3, 0.9, 3)), 0.8 * wide)


def add_fittings(appearance: Appearance, layers: Layers, phantom: Phantom, view: CameraView, rng: Generator) -> None:
    """Clips over the lumen, connectors at its ends (behind the robot, which enters through one), bubbles and dust."""
    scale = view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
    shape = layers.front_alpha.shape
    if appearance.end_fittings and appearance.material not in ("xray", "channel"):
        colour, alpha = np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.uint8)
        for node in (phantom.port, *phantom.targets):
            _connector(appearance, colour, alpha, phantom, node, view, rng)
        share = (alpha.astype(np.float32) * np.float32(0.9 / 255))[..., None]
        layers.under += share * (colour.astype(np.float32) / 255 - layers.under)
    colour, alpha = np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.uint8)
    for _ in range(appearance.fittings):
        _clip(appearance, colour, alpha, phantom, view, rng)
    for _ in range(appearance.bubbles):
        _bubble(colour, alpha, phantom, view, rng)
    for _ in range(appearance.dust):
        _dust(colour, alpha, scale, rng)
    if alpha.any():
        opacity = np.asarray(alpha, np.float32) / np.float32(255)
        layers.cover(opacity, np.asarray(colour, np.float32) / np.float32(255))


def _clip(appearance: Appearance, colour: U8, alpha: U8, phantom: Phantom, view: CameraView, rng: Generator) -> None:
    """A clip or a joint across the tube."""
    edge = random_edge(phantom, rng)
    place = int(rng.integers(int(0.1 * len(edge.points)), max(int(0.9 * len(edge.points)), 1)))
    normal = normals(edge.points)[place]
    tangent = np.array([normal[1], -normal[0]])
    across = (edge.radius[place] + appearance.wall_mm + rng.uniform(0.5, 3.0)) * normal
    along = rng.uniform(1.0, 2.8) * tangent
    corners = view.project(edge.points[place] + np.array([across + along, -across + along, -across - along, across - along]))
    opacity = int(255 * appearance.fitting_opacity)
    tone = appearance.fitting_rgb
    fill(alpha, corners, opacity)
    fill(colour, corners, level(tone))
    middle = corners.mean(axis=0)
    fill(colour, middle + (corners - middle) * (0.96, 0.45), level(tone, 1.15))
    stroke(colour, np.vstack([corners, corners[:1]]), level(tone, 0.6), 1)


def _connector(
    appearance: Appearance, colour: U8, alpha: U8, phantom: Phantom, node: int, view: CameraView, rng: Generator
) -> None:
    """A luer connector at an end of the vessel, pointing outwards."""
    for edge in phantom.graph.edges:
        if node in (edge.start, edge.end):
            points = edge.points if edge.end == node else edge.points[::-1]
            radius = edge.radius[-1] if edge.end == node else edge.radius[0]
            break
    outward = points[-1] - points[max(-6, -len(points))]
    outward = outward / max(float(np.linalg.norm(outward)), 1e-9)
    normal = np.array([-outward[1], outward[0]])
    half, start = radius + appearance.wall_mm, points[-1] + 0.4 * radius * outward
    for begin, finish, wide in ((0.0, rng.uniform(4, 7), 1.15), (4.0, rng.uniform(8, 14), rng.uniform(0.6, 0.9))):
        box = np.array([[begin, wide * half], [finish, wide * half], [finish, -wide * half], [begin, -wide * half]])
        corners = view.project(start + box[:, :1] * outward + box[:, 1:] * normal)
        fill(alpha, corners, int(255 * max(0.6, appearance.fitting_opacity)))
        fill(colour, corners, level(appearance.fitting_rgb, 0.9))
        middle = corners.mean(axis=0)
        fill(colour, middle + (corners - middle) * 0.6, level(appearance.fitting_rgb, 1.12))
        stroke(colour, np.vstack([corners, corners[:1]]), level(appearance.fitting_rgb, 0.6), 1)


def _bubble(colour: U8, alpha: U8, phantom: Phantom, view: CameraView, rng: Generator) -> None:
    """An air bubble: a dark ring with a bright spot, half see-through."""
    edge = random_edge(phantom, rng)
    place = int(rng.integers(len(edge.points)))
    radius = edge.radius[place] * rng.uniform(0.15, 0.6)
    shift = normals(edge.points)[place] * (edge.radius[place] - radius) * rng.uniform(-0.8, 0.8)
    x, y = view.project((edge.points[place] + shift)[None])[0]
    size = max(1, round(radius * view.pixels_per_mm((float(edge.points[place, 0]), float(edge.points[place, 1])))))
    if not (-50 < x < view.size[0] + 50 and -50 < y < view.size[1] + 50):
        return
    at = int(x), int(y)
    cv2.circle(alpha, at, size, 40, -1, cv2.LINE_AA)
    cv2.circle(colour, at, size, (235, 235, 235), -1, cv2.LINE_AA)
    cv2.circle(alpha, at, size, 150, 1, cv2.LINE_AA)
    cv2.circle(colour, at, size, (60, 60, 60), 1, cv2.LINE_AA)
    spot = at[0] - size // 3, at[1] - size // 3
    cv2.circle(alpha, spot, max(1, size // 4), 220, -1, cv2.LINE_AA)
    cv2.circle(colour, spot, max(1, size // 4), (255, 255, 255), -1, cv2.LINE_AA)


def _dust(colour: U8, alpha: U8, scale: float, rng: Generator) -> None:
    """A speck or a short fibre."""
    height, width = alpha.shape
    at, tone = rng.uniform((0, 0), (width, height)), int(rng.choice([rng.integers(0, 90), rng.integers(200, 256)]))
    if rng.random() < 0.8:
        spot = int(at[0]), int(at[1])
        size = int(rng.integers(0, max(2, int(0.35 * scale))))
        cv2.circle(alpha, spot, size, int(rng.integers(60, 220)), -1, cv2.LINE_AA)
        cv2.circle(colour, spot, size, (tone, tone, tone), -1, cv2.LINE_AA)
        return
    fibre = at + np.cumsum(rng.normal(0, 0.6 * scale, (5, 2)) + rng.normal(0, 0.5 * scale, 2), axis=0)
    stroke(alpha, fibre, int(rng.integers(60, 150)), 1)
    stroke(colour, fibre, (tone, tone, tone), 1)
