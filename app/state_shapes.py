"""The shape that stands for each pose state, as an outline that Qt and OpenCV both draw."""

from __future__ import annotations

import math

import numpy as np

from core.types import Point, Points, PoseState

LETTER_HEIGHT: dict[PoseState | None, float] = {
    None: 0.60,
    PoseState.A: 0.60,
    PoseState.B: 0.64,
    PoseState.C: 0.50,
    PoseState.D: 0.54,
}
"""Font size over the box's side."""
LETTER_DROP: dict[PoseState | None, float] = {PoseState.C: 0.13}
"""How far below the middle of the box the letter sits, over the box's side: a triangle's visual middle is lower."""


def state_outline(state: PoseState | None) -> Points:
    """Closed outline (N, 2) in a box of -1..1: A circle, B square, C triangle, D diamond, None circle."""
    if state is PoseState.B:
        return _rounded([(-0.86, -0.86), (0.86, -0.86), (0.86, 0.86), (-0.86, 0.86)], 0.2)
    if state is PoseState.C:
        corners = [(0.0, -1.0), (1.06, 0.84), (-1.06, 0.84)]
        return _rounded(corners, 0.22)
    if state is PoseState.D:
        return _rounded([(0.0, -1.02), (1.02, 0.0), (0.0, 1.02), (-1.02, 0.0)], 0.16)
    turn = np.linspace(0.0, 2 * math.pi, 72, endpoint=False)
    return 0.95 * np.column_stack([np.cos(turn), np.sin(turn)])


def _rounded(corners: list[Point], rounding: float) -> Points:
    """The polygon with its corners replaced by quadratic curves that start `rounding` before them."""
    points = np.array(corners)
    along = np.linspace(0.0, 1.0, 8)[:, None]
    pieces = []
    for k, corner in enumerate(points):
        before, after = points[k - 1] - corner, points[(k + 1) % len(points)] - corner
        enter = corner + before / np.linalg.norm(before) * rounding
        leave = corner + after / np.linalg.norm(after) * rounding
        pieces.append((1 - along) ** 2 * enter + 2 * along * (1 - along) * corner + along**2 * leave)
    return np.concatenate(pieces)
