"""Painting of lumen and wall: silicone tube, clear block, turbid gel, open channel, or X-ray contrast.

A picture has two layers. ``under`` (H, W, 3) lies behind the robot; ``front_alpha`` (H, W) and ``front`` (H, W, 3, already
multiplied by alpha) lie over it: highlights of the tube, lamp reflections, fittings.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hardware.twin.rendering.appearance import Appearance
from hardware.twin.rendering.background import smooth_noise
from hardware.twin.view import LumenField

F32 = NDArray[np.float32]


@dataclass(slots=True, eq=False)
class Layers:
    """The two layers while they are being painted."""

    under: F32
    front: F32
    front_alpha: F32

    def cover(self, alpha: F32, colour: F32) -> None:
        """Lay `colour` (H, W, 3) or (3,) over the front layer with `alpha` (H, W)."""
        keep = (1 - alpha)[..., None]
        self.front *= keep
        self.front += alpha[..., None] * colour
        self.front_alpha *= keep[..., 0]
        self.front_alpha += alpha


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Geometry that all looks share: `normal_x`, `normal_y` point out of the lumen (unit vectors, image axes), ``facing`` is their
    product with the direction to the lamp (-1..1), ``scale`` px per mm, ``lamp`` the unit vector to the lamp in image axes."""

    field: LumenField
    normal_x: F32
    normal_y: F32
    facing: F32
    scale: float
    lamp: tuple[float, float]

    def inside(self, margin_mm: float = 0.0) -> F32:
        """Share of each pixel that lies within `margin_mm` of the lumen: an anti-aliased step."""
        depth = np.float32(margin_mm) - self.field.distance_mm
        return np.asarray(np.clip(depth * np.float32(self.scale) + np.float32(0.5), 0, 1), np.float32)

    def line(self, place_mm: float, width_mm: float) -> F32:
        """A soft line along the wall at `place_mm` from it (negative: in the lumen)."""
        return np.asarray(np.exp(-(((self.field.distance_mm - np.float32(place_mm)) / np.float32(width_mm)) ** 2)), np.float32)


def surface_of(field: LumenField, scale: float, lamp: tuple[float, float]) -> Surface:
    """The surface of a measured lumen at `scale` px per mm, lit from `lamp` (unit vector on screen)."""
    soft = cv2.GaussianBlur(field.distance_mm, (0, 0), max(1.0, 0.4 * scale))
    dx = np.asarray(cv2.Sobel(soft, cv2.CV_32F, 1, 0), np.float32)
    dy = np.asarray(cv2.Sobel(soft, cv2.CV_32F, 0, 1), np.float32)
    length = np.maximum(np.sqrt(dx * dx + dy * dy), np.float32(1e-3))
    dx /= length
    dy /= length
    return Surface(field, dx, dy, dx * np.float32(lamp[0]) + dy * np.float32(lamp[1]), scale, lamp)


def paint_vessel(appearance: Appearance, board: F32, surface: Surface, rng: Generator) -> Layers:
    """Both layers with the vessel in its material on `board` (H, W, 3)."""
    paint = {"tube": _tube, "block": _block, "gel": _gel, "channel": _channel, "xray": _xray}[appearance.material]
    shape = board.shape[:2]
    layers = Layers(board, np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32))
    paint(appearance, layers, surface, rng)
    if appearance.glow:
        _glow(appearance, layers, surface)
    np.clip(layers.under, 0, 1, out=layers.under)
    return layers


def shifted(layer: F32, surface: Surface, distance_mm: float) -> F32:
    """`layer` moved away from the lamp by `distance_mm`, as a shadow falls."""
    step = distance_mm * surface.scale
    move = np.array([[1, 0, -surface.lamp[0] * step], [0, 1, -surface.lamp[1] * step]], np.float32)
    height, width = layer.shape
    return np.asarray(cv2.warpAffine(layer, move, (width, height), borderMode=cv2.BORDER_REPLICATE), np.float32)


def _tube(appearance: Appearance, layers: Layers, surface: Surface, rng: Generator) -> None:
    wall = appearance.wall_mm
    body = surface.inside(wall)
    _cast_shadow(appearance, layers, surface, body)
    bent = _refracted(layers.under, surface, surface.field.outer_ratio, appearance.refraction_mm)
    layers.under = layers.under + (bent - layers.under) * body[..., None]
    haze = body * np.float32(appearance.wall_haze)
    layers.under += haze[..., None] * (np.asarray(appearance.wall_rgb, np.float32) - layers.under)
    _fill_liquid(appearance, layers, surface)
    _edges(appearance, layers, surface, (0.0, wall))
    _highlight(appearance, layers, surface, surface.field.outer_ratio, body, rng)
    _lamps(appearance, layers, surface, body, rng)


def _block(appearance: Appearance, layers: Layers, surface: Surface, rng: Generator) -> None:
    """A lumen cast into a clear block: no outer wall, reflections anywhere on the flat top."""
    inside = surface.inside()
    haze = np.float32(0.6 * appearance.wall_haze)
    layers.under += haze * (np.asarray(appearance.wall_rgb, np.float32) - layers.under)
    bent = _refracted(layers.under, surface, surface.field.ratio, 0.7 * appearance.refraction_mm)
    layers.under = layers.under + (bent - layers.under) * inside[..., None]
    _cast_shadow(appearance, layers, surface, inside)
    _fill_liquid(appearance, layers, surface)
    _edges(appearance, layers, surface, (0.0,))
    _highlight(appearance, layers, surface, surface.field.ratio, inside, rng, 0.6)
    _lamps(appearance, layers, surface, np.full(inside.shape, 0.7, np.float32), rng)


def _gel(appearance: Appearance, layers: Layers, surface: Surface, rng: Generator) -> None:
    """A lumen in a turbid gel: no edges, everything behind it blurred and milky, reflections on the flat top."""
    _fill_liquid(appearance, layers, surface)
    spread = max(0.5, appearance.scatter_mm * surface.scale)
    layers.under = np.asarray(cv2.GaussianBlur(layers.under, (0, 0), spread, borderType=cv2.BORDER_REPLICATE), np.float32)
    cloud = np.float32(appearance.wall_haze) * (1 + np.float32(0.25) * smooth_noise(rng, surface.facing.shape, 25 * surface.scale))
    layers.under += cloud[..., None] * (np.asarray(appearance.wall_rgb, np.float32) - layers.under)
    _lamps(appearance, layers, surface, np.full(surface.facing.shape, 0.8, np.float32), rng)


def _glow(appearance: Appearance, layers: Layers, surface: Surface) -> None:
    """Light emitted by the liquid, and the part scattered around it."""
    source = np.float32(appearance.glow) * surface.inside() * (0.4 + 0.6 * _depth(surface))
    near = np.asarray(cv2.GaussianBlur(source, (0, 0), max(1.0, 2.5 * surface.scale), borderType=cv2.BORDER_REPLICATE), np.float32)
    layers.under += (source + 0.35 * near)[..., None] * np.asarray(appearance.liquid_rgb, np.float32)


def _channel(appearance: Appearance, layers: Layers, surface: Surface, rng: Generator) -> None:
    """A channel carved into an opaque plate, seen from above: floor, shadow of the near wall, bright rim of the far one."""
    inside = surface.inside()
    texture = layers.under.mean(axis=2, keepdims=True) - np.float32(np.mean(appearance.board_rgb))
    floor = np.asarray(appearance.liquid_rgb, np.float32) + np.float32(0.7) * texture
    bowl = np.float32(1 - 2 * appearance.lumen_shade) + np.float32(2 * appearance.lumen_shade) * _depth(surface)
    floor = floor * bowl[..., None]
    deep = min(appearance.shadow_mm, 3.0)
    shadow = np.clip(inside - shifted(inside, surface, deep), 0, 1)
    shadow = cv2.GaussianBlur(shadow, (0, 0), max(0.6, 0.25 * deep * surface.scale))
    floor = floor * (1 - np.float32(0.25 + appearance.tube_shadow) * np.clip(shadow, 0, 1))[..., None]
    layers.under = layers.under + (floor - layers.under) * inside[..., None]
    rim = surface.line(0.0, 0.6 * appearance.edge_mm)
    layers.under += (rim * np.float32(0.7 * appearance.edge_bright) * np.clip(-surface.facing, 0, 1))[..., None]
    layers.under *= (1 - rim * np.float32(appearance.edge_dark) * (0.35 + 0.65 * np.clip(surface.facing, 0, 1)))[..., None]
    _highlight(appearance, layers, surface, surface.field.ratio, inside, rng, 0.5)
    _lamps(appearance, layers, surface, inside * np.float32(0.6), rng)


def _xray(appearance: Appearance, layers: Layers, surface: Surface, rng: Generator) -> None:
    """Contrast medium absorbs along the way through the lumen; a road map shows it brighter."""
    soft = cv2.GaussianBlur(_depth(surface) * surface.inside(), (0, 0), max(0.6, 0.25 * surface.scale))
    flow = 1 + np.float32(0.25) * smooth_noise(rng, soft.shape, 20 * surface.scale)
    alpha = np.float32(appearance.liquid_opacity) * np.clip((0.3 * surface.inside() + 0.8 * soft) * flow, 0, 1)
    bright = appearance.liquid_rgb[0] > 0.5
    layers.under += alpha[..., None] * ((np.float32(1.0) if bright else np.float32(0.0)) - layers.under)
    wall = np.clip(surface.inside(appearance.wall_mm) - surface.inside(), 0, 1)
    layers.under *= (1 - np.float32(appearance.wall_haze) * wall)[..., None]


def _depth(surface: Surface) -> F32:
    """Length of the way through the lumen, 1 on the centerline, 0 at the wall."""
    return np.asarray(np.sqrt(np.clip(1 - surface.field.ratio**2, 0, 1)), np.float32)


def _cast_shadow(appearance: Appearance, layers: Layers, surface: Surface, body: F32) -> None:
    if appearance.tube_shadow:
        shadow = shifted(body, surface, appearance.shadow_mm)
        shadow = np.asarray(cv2.GaussianBlur(shadow, (0, 0), max(0.8, 0.4 * appearance.shadow_mm * surface.scale)), np.float32)
        layers.under *= (1 - np.float32(appearance.tube_shadow) * shadow)[..., None]


def _refracted(board: F32, surface: Surface, ratio: F32, strength_mm: float) -> F32:
    """The board seen through the round tube: shifted outwards, most near the edge of the tube."""
    if not strength_mm:
        return board
    height, width = ratio.shape
    bend = np.float32(strength_mm * surface.scale) * np.clip(ratio, 0, 1) ** 3
    map_x = np.arange(width, dtype=np.float32)[None, :] + bend * surface.normal_x
    map_y = np.arange(height, dtype=np.float32)[:, None] + bend * surface.normal_y
    return np.asarray(cv2.remap(board, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)


def _fill_liquid(appearance: Appearance, layers: Layers, surface: Surface) -> None:
    """Liquid both tints what is seen through it and scatters its own colour; the lumen also darkens towards its sides."""
    inside, depth = surface.inside(), _depth(surface)
    colour = np.asarray(appearance.liquid_rgb, np.float32)
    amount = np.float32(appearance.liquid_opacity) * inside * (0.45 + 0.55 * depth)
    tinted = layers.under * (1 - amount[..., None] * (1 - colour))
    scattered = amount[..., None] * np.float32(0.75)
    layers.under = tinted * (1 - scattered) + colour * scattered
    layers.under *= (1 - np.float32(appearance.lumen_shade) * inside * (1 - depth))[..., None]


def _edges(appearance: Appearance, layers: Layers, surface: Surface, places_mm: tuple[float, ...]) -> None:
    """Refraction lines along the walls, a dark and a bright one side by side; the lamp decides which is stronger."""
    width = appearance.edge_mm
    for place in places_mm:
        dark = surface.line(place - 0.4 * width, width) * (0.55 - 0.45 * surface.facing)
        layers.under *= (1 - np.float32(appearance.edge_dark) * dark)[..., None]
        bright = surface.line(place + 0.5 * width, 0.8 * width) * (0.5 + 0.5 * surface.facing)
        layers.under += (np.float32(0.8 * appearance.edge_bright) * bright)[..., None] * (1 - layers.under)


def _highlight(
    appearance: Appearance, layers: Layers, surface: Surface, ratio: F32, body: F32, rng: Generator, strength: float = 1.0
) -> None:
    """The long reflection of the lamp on the round tube, broken here and there, with a weaker one on the far side."""
    if not appearance.highlight * strength:
        return
    place = np.clip(ratio, 0, 1) * surface.facing
    across = np.float32(0.35) + np.float32(0.65) * surface.facing**2
    width = np.float32(appearance.highlight_width)
    shine = np.exp(-(((place - np.float32(0.55)) / width) ** 2))
    shine += np.float32(0.35) * np.exp(-(((place + np.float32(0.7)) / width) ** 2))
    broken = np.clip(0.8 + 0.8 * smooth_noise(rng, ratio.shape, 14 * surface.scale), 0, 1)
    alpha = np.float32(strength * appearance.highlight) * shine * across * broken * body
    layers.cover(np.clip(alpha, 0, 0.92).astype(np.float32), np.ones(3, np.float32))


def _lamps(appearance: Appearance, layers: Layers, surface: Surface, where: F32, rng: Generator) -> None:
    """Reflections of lamps: small glaring spots, stretched and cut by the tubes."""
    height, width = where.shape
    glare = np.zeros((height, width), np.float32)
    for _ in range(appearance.lamps):
        centre = rng.uniform(0, width), rng.uniform(0, height)
        size = appearance.lamp_mm * surface.scale * rng.uniform(0.5, 1.3, 2)
        axes = max(1, int(size[0])), max(1, int(size[1] * 0.5))
        cv2.ellipse(glare, (int(centre[0]), int(centre[1])), axes, rng.uniform(0, 180), 0, 360, float(rng.uniform(0.5, 1)), -1)
    if appearance.lamps:
        glare = np.asarray(cv2.GaussianBlur(glare, (0, 0), max(1.0, 0.15 * appearance.lamp_mm * surface.scale)), np.float32)
        tube = np.clip(1.1 - np.abs(surface.facing - np.float32(0.2)) * np.clip(surface.field.ratio, 0, 1), 0.1, 1)
        layers.cover(np.clip(np.float32(appearance.lamp_strength) * glare * where * tube, 0, 0.97), np.ones(3, np.float32))
