"""Candidates for the robot's path: ways through the pixel graph, and how good each is (METHOD section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.config import PathConfig
from core.perception import polyline
from core.perception.pixel_graph import Chain, PixelGraph
from core.types import Points

Steps = tuple[tuple[int, bool], ...]
"""Chains in walking order, each with whether it is walked from its start to its end."""
HEADING_PX = 10.0
"""Directions at a junction are taken over this length of each chain."""
STEPS_PER_CANDIDATE = 20


@dataclass(frozen=True, slots=True, eq=False)
class Trail:
    """A way through the graph that uses no chain twice. ``effective_px`` is its length less what its turns at junctions cost."""

    start: int
    end: int
    points: Points
    length_px: float
    effective_px: float


def max_steps(config: PathConfig) -> int:
    """How many chains may be walked in one frame, by all its starts together."""
    return STEPS_PER_CANDIDATE * config.max_candidates


def explore(graph: PixelGraph, start: int, config: PathConfig, budget: int | None = None) -> list[Trail]:
    """All ways from an end of the skeleton to its other ends, without using a chain twice; longest (effective) first.

    A node may be passed twice: a robot that crosses itself does. Straight continuations are tried first, so that the limits drop
    the unlikely ones: ``max_candidates``, and `budget`, the number of chains walked. Where no other end can be reached (the robot's
    head lies against its own body) the ways that stop at a junction are given instead.
    """
    leaving = _chains_at(graph)
    degrees = graph.degrees()
    headings = {(index, start): _heading(chain, start) for index, chain in enumerate(graph.chains) for start in (True, False)}
    finished: list[tuple[Steps, float]] = []
    stopped: list[tuple[Steps, float]] = []
    pending: list[tuple[int, Steps, float]] = [(start, (), 0.0)]
    left = max_steps(config) if budget is None else budget
    while pending and left > 0 and len(finished) < config.max_candidates:
        left -= 1
        node, steps, turning = pending.pop()
        if steps and degrees[node] == 1:
            finished.append((steps, turning))
            continue
        used = {index for index, _ in steps}
        arriving = -headings[steps[-1][0], not steps[-1][1]] if steps else None
        options = []
        for index, onward in leaving[node]:
            if index not in used:
                turn = 0.0 if arriving is None else 1.0 - float(arriving @ headings[index, onward])
                options.append((turn, index, onward))
        if not options and steps:
            stopped.append((steps, turning))
        for turn, index, onward in sorted(options, reverse=True):
            chain = graph.chains[index]
            pending.append((chain.end if onward else chain.start, (*steps, (index, onward)), turning + turn))
    trails = [_trail(graph, steps, turning, config) for steps, turning in finished or stopped]
    return sorted(trails, key=lambda trail: -trail.effective_px)


def _chains_at(graph: PixelGraph) -> list[list[tuple[int, bool]]]:
    leaving: list[list[tuple[int, bool]]] = [[] for _ in range(len(graph.nodes))]
    for index, chain in enumerate(graph.chains):
        leaving[chain.start].append((index, True))
        leaving[chain.end].append((index, False))
    return leaving


def _heading(chain: Chain, from_start: bool) -> NDArray[np.float64]:
    """Unit vector from a chain's node into the chain."""
    points = chain.points if from_start else chain.points[::-1]
    chord = points[min(len(points) - 1, round(HEADING_PX))] - points[0]
    return np.asarray(chord / max(float(np.hypot(chord[0], chord[1])), 1e-9))


def _trail(graph: PixelGraph, steps: Steps, turning: float, config: PathConfig) -> Trail:
    chains = [(graph.chains[index], onward) for index, onward in steps]
    lines = [chain.points if onward else chain.points[::-1] for chain, onward in chains]
    points = np.concatenate([lines[0], *(line[1:] for line in lines[1:])])
    length = float(polyline.arc_length(points)[-1])
    (first, onward), (last, last_onward) = chains[0], chains[-1]
    return Trail(
        start=first.start if onward else first.end,
        end=last.end if last_onward else last.start,
        points=points,
        length_px=length,
        effective_px=length - config.junction_turn_px * turning,
    )


def score(points: Points, length_share: float, config: PathConfig) -> float:
    """The paper's score of a path: ``w_l * length + w_s * smoothness + w_c * consistency``.

    Parameters
    ----------
    points : the path (N, 2).
    length_share : its length against the longest candidate, 0..1; the paper prefers shorter ones, so its weight is negative.
    config : weights, the step over which directions are taken, and whether a reversal counts as -1 (signed) or, as in the paper,
        as +1 (absolute).
    """
    # Steps of one pixel only know multiples of 45 degrees; the paper's form takes them as they are.
    line = polyline.resample(points, config.step_px) if config.step_px > 1.0 else points
    steps = _unit_steps(line)
    return (
        config.weight_length * length_share
        + config.weight_smoothness * _smoothness(steps, config.cosine)
        + config.weight_consistency * _consistency(line, steps, config.cosine)
    )


def smoothness(line: Points, cosine: Literal["signed", "absolute"]) -> float:
    """Mean cosine of the change of direction at each inner point: 1 for a straight line."""
    return _smoothness(_unit_steps(line), cosine)


def consistency(line: Points, cosine: Literal["signed", "absolute"]) -> float:
    """Mean cosine between each step and the vector from start to end: 1 for a straight line, 0 for a closed one."""
    return _consistency(line, _unit_steps(line), cosine)


def _smoothness(steps: Points, cosine: Literal["signed", "absolute"]) -> float:
    if len(steps) < 2:
        return 1.0
    before, after = steps[:-1], steps[1:]
    return _mean_cosine(before[:, 0] * after[:, 0] + before[:, 1] * after[:, 1], cosine)


def _consistency(line: Points, steps: Points, cosine: Literal["signed", "absolute"]) -> float:
    chord = line[-1] - line[0]
    length = float(np.hypot(chord[0], chord[1]))
    if length == 0.0 or len(steps) == 0:
        return 0.0
    return _mean_cosine(steps @ (chord / length), cosine)


def _unit_steps(line: Points) -> Points:
    steps = line[1:] - line[:-1]
    length = np.hypot(steps[:, 0], steps[:, 1])
    moved = length > 0.0
    return np.asarray(steps[moved] / length[moved, None])


def _mean_cosine(cosines: NDArray[np.float64], cosine: Literal["signed", "absolute"]) -> float:
    return float((np.abs(cosines) if cosine == "absolute" else cosines).sum()) / len(cosines)
