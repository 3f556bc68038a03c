"""Clips over the lumen, connectors at its ends, air bubbles in it, dust above it. The label goes on beneath all of them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import Generator

from hardware.twin.appearance import Appearance
from hardware.twin.drawing import U8, fill, level, normals, random_edge, stroke
from hardware.twin.phantom import BOARD_MM, Phantom
from hardware.twin.vessel_look import Layers
from hardware.twin.view import View


def add_fittings(appearance: Appearance, layers: Layers, phantom: Phantom, view: View, rng: Generator) -> None:
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


def _clip(appearance: Appearance, colour: U8, alpha: U8, phantom: Phantom, view: View, rng: Generator) -> None:
    """A clip or a joint across the tube; the lumen goes on beneath it."""
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


def _connector(appearance: Appearance, colour: U8, alpha: U8, phantom: Phantom, node: int, view: View, rng: Generator) -> None:
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


def _bubble(colour: U8, alpha: U8, phantom: Phantom, view: View, rng: Generator) -> None:
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
