"""Repair of a broken skeleton: near end points are joined (METHOD section 3, the paper's Algorithm 1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np

from core.config import GapConfig
from core.perception.skeleton import Walker, end_pixels
from core.types import Mask, Point, Points, Skeletons

MAX_ENDS = 150
"""A robot broken to pieces, and some specks, have some tens of ends. What has more is noise, and every two ends are compared."""
TOUCHING_PX = 3.0
"""Two ends this near are joined however they look."""
NEAR_PX = 10.0
"""The step between two ends this near is too short to have a direction: there only the ends' own directions must agree."""


@dataclass(frozen=True, slots=True)
class _End:
    place: tuple[int, int]
    direction: Point | None
    component: int


def repair(skeletons: Skeletons, config: GapConfig) -> Skeletons:
    """The same skeletons with the robot's gaps bridged, and the bridges listed.

    With ``rule = "components"`` ends of different components are joined, nearest first, where the robot would not have to turn by
    more than ``max_turn_deg``; each end is used once. With ``rule = "every_pair"`` every two ends nearer than the threshold are
    joined, as the paper's pseudocode says: also the two ends of one short piece. A skeleton of more than ``MAX_ENDS`` ends is left
    as it is.
    """
    places = end_pixels(skeletons.robot)
    if len(places) > MAX_ENDS:
        return skeletons
    if not any(math.dist(a, b) < config.gap_threshold_px for a, b in combinations(places, 2)):
        return skeletons
    ends = _described(places, skeletons.robot)
    if config.rule == "every_pair":
        pairs = [(a, b) for a, b in combinations(ends, 2) if _distance(a, b) < config.gap_threshold_px]
    else:
        pairs = _plausible_pairs(ends, config)
    if not pairs:
        return skeletons
    robot = skeletons.robot.view(np.uint8).copy()
    for a, b in pairs:
        cv2.line(robot, a.place, b.place, 1)
    bridges = tuple(((float(a.place[0]), float(a.place[1])), (float(b.place[0]), float(b.place[1]))) for a, b in pairs)
    return Skeletons(skeletons.vessel, robot.view(np.bool_), bridges)


def _described(places: list[tuple[int, int]], skeleton: Mask) -> list[_End]:
    x, y, width, height = cv2.boundingRect(skeleton.view(np.uint8))
    window = np.ascontiguousarray(skeleton[y : y + height, x : x + width])
    _, labels = cv2.connectedComponents(window.view(np.uint8), connectivity=8)
    walker = Walker(window)
    return [_End((u, v), walker.direction((u - x, v - y)), int(labels[v - y, u - x])) for u, v in places]


def _distance(a: _End, b: _End) -> float:
    return math.dist(a.place, b.place)


def _plausible_pairs(ends: list[_End], config: GapConfig) -> list[tuple[_End, _End]]:
    """Pairs to join: of different components, nearest first, and only where neither end has to turn too far."""
    near = [(d, i, j) for (i, a), (j, b) in combinations(enumerate(ends), 2) if (d := _distance(a, b)) < config.gap_threshold_px]
    merged = {end.component: end.component for end in ends}
    used: set[int] = set()
    chosen = []
    for distance, i, j in sorted(near):
        a, b = ends[i], ends[j]
        if i in used or j in used or merged[a.component] == merged[b.component]:
            continue
        if distance > TOUCHING_PX and _turn_deg(a, b, distance) > config.max_turn_deg:
            continue
        old, new = merged[b.component], merged[a.component]
        merged = {component: new if group == old else group for component, group in merged.items()}
        used |= {i, j}
        chosen.append((a, b))
    return chosen


def _turn_deg(a: _End, b: _End, distance: float) -> float:
    if distance <= NEAR_PX and a.direction is not None and b.direction is not None:
        cosine = -a.direction[0] * b.direction[0] - a.direction[1] * b.direction[1]
        return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return max(turns_deg(a.place, a.direction, b.place, b.direction))


def turns_deg(
    a: Sequence[float] | Points, leaving: Point | Points | None, b: Sequence[float] | Points, arriving: Point | Points | None
) -> tuple[float, float]:
    """How far a path turns, leaving through end `a` towards end `b`, and entering there: degrees, 0 for an end without direction.

    Both directions are unit vectors that point out of their own piece.
    """
    step = np.asarray(b, np.float64) - np.asarray(a, np.float64)
    step /= max(float(np.hypot(step[0], step[1])), 1e-9)
    first = 1.0 if leaving is None else float(step @ np.asarray(leaving))
    second = 1.0 if arriving is None else float(-step @ np.asarray(arriving))
    return float(np.degrees(np.arccos(np.clip(first, -1.0, 1.0)))), float(np.degrees(np.arccos(np.clip(second, -1.0, 1.0))))
