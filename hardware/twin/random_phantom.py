"""Random phantoms of wide variety, the same for the same seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.types import Points
from hardware.twin.channels import Channel, Sketch, smooth_channel
from hardware.twin.phantom import BOARD_MM, Phantom
from hardware.twin.phantom_check import faults, node_distances_mm

MAX_WAY_MM = 290.0
_STEP_MM = 1.0
_INLET_MM = 16.0
_OPEN_END_CHANCE = 0.25
_PROBES_MM = np.array([5.0, 10.0, 16.0, 24.0])
_STYLES = {"single": 0.2, "tree": 0.5, "loop": 0.15, "parallel": 0.15}


@dataclass(frozen=True, slots=True)
class _Manner:
    """How the channels of one phantom look."""

    wander: float
    """Spread of curvature (1/mm)."""
    max_curvature: float
    radius_mm: float


def random_phantom(seed: int) -> Phantom:
    """A phantom drawn at random: topology, port side, curvature, radii, stenoses and aneurysms; 1 to 6 ends.

    Drawings that ``phantom_check.faults`` finds unfit are thrown away and drawn again, so every seed gives a usable phantom.
    """
    rng = np.random.default_rng([seed, 20111])
    while True:
        sketch = _draw(rng)
        if sketch is None:
            continue
        phantom = Phantom(f"random:{seed}", f"Random phantom {seed}", sketch.graph(), port=0)
        if not phantom.targets or len(phantom.targets) > 6 or faults(phantom):
            continue
        ways = node_distances_mm(phantom)[phantom.port, list(phantom.targets)]
        if ways.max() <= MAX_WAY_MM:
            return phantom


def _draw(rng: np.random.Generator) -> Sketch | None:
    style = str(rng.choice(list(_STYLES), p=list(_STYLES.values())))
    wander = rng.uniform(0.004, 0.03 if style in ("single", "tree") else 0.012)
    manner = _Manner(wander, 1 / rng.uniform(11.0, 18.0), rng.uniform(4.2, 8.0 if style in ("single", "tree") else 5.5))
    sketch = Sketch()
    start, heading = _port(rng)
    length = rng.uniform(110.0, 270.0 if style == "single" else 210.0)
    main = _grown(rng, sketch, start, heading, length, manner, manner.radius_mm, inlet_mm=_INLET_MM)
    if main is None:
        return None
    sketch.add(main)
    if style in ("loop", "parallel"):
        sides = [1.0, -1.0] if style == "parallel" else [float(rng.choice([-1.0, 1.0]))]
        if not all(_add_bypass(rng, sketch, side, rejoins=style == "loop") for side in sides):
            return None
    branches = {"single": 0, "tree": int(rng.integers(1, 6)), "loop": int(rng.integers(0, 3)), "parallel": 0}[style]
    for _ in range(branches):
        _add_branch(rng, sketch, manner)
    return sketch if style != "tree" or len(sketch.channels) > 1 else None


def _port(rng: np.random.Generator) -> tuple[NDArray[np.float64], float]:
    """A place just outside one of the four board edges and a heading (radians) into the board."""
    width, height = BOARD_MM
    side, along, lean = int(rng.integers(4)), rng.uniform(0.22, 0.78), rng.uniform(-0.25, 0.25)
    places = ((-1.0, along * height), (along * width, -1.0), (width + 1.0, along * height), (along * width, height + 1.0))
    return np.array(places[side]), side * np.pi / 2 + lean


def _grown(
    rng: np.random.Generator,
    sketch: Sketch,
    start: NDArray[np.float64],
    heading: float,
    length_mm: float,
    manner: _Manner,
    radius_mm: float,
    inlet_mm: float,
) -> Channel | None:
    """A channel that wanders from `start` and steers away from the board's edges and from what is already drawn.

    Every millimetre it weighs nine curvatures by probing the way ahead; it ends where there is no room. None when too short.
    """
    open_end = rng.random() < _OPEN_END_CHANCE
    taken = np.concatenate([np.column_stack([c.points, c.radius])[::5] for c in sketch.channels] or [np.zeros((0, 3))])
    taken = taken[np.linalg.norm(taken[:, :2] - start, axis=1) > 2.4 * radius_mm + 6.0]
    path, curvature, wanted = [start], 0.0, 0.0
    for step in range(int(length_mm / _STEP_MM)):
        travelled = step * _STEP_MM
        wanted = 0.96 * wanted + rng.normal(0.0, manner.wander * 0.28)
        if travelled >= inlet_mm:
            own = np.array(path[: max(0, len(path) - int(3.4 * radius_mm) - 8)][::2]).reshape(-1, 2)
            others = np.concatenate([taken, np.column_stack([own, np.full(len(own), radius_mm)])])
            choices = np.clip(curvature + np.linspace(-0.02, 0.02, 9), -manner.max_curvature, manner.max_curvature)
            costs = _costs(path[-1], heading, choices, wanted, radius_mm, others, open_end)
            best = int(np.argmin(costs))
            if costs[best] > 50.0:
                break
            curvature = float(choices[best])
        heading += curvature * _STEP_MM
        path.append(path[-1] + _STEP_MM * np.array([np.cos(heading), np.sin(heading)]))
        if travelled > 40.0 and _margin(path[-1]) < 0.0:
            break
    if len(path) < max(inlet_mm + 25.0, 0.35 * length_mm):
        return None
    count = max(4, round(len(path) / rng.uniform(8.0, 13.0)))
    waypoints = np.array(path)[np.linspace(0, len(path) - 1, count).astype(int)]
    return smooth_channel(waypoints, _radii(rng, count, radius_mm), path[1] - path[0])


def _margin(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of points (..., 2) to the board's edge, negative outside."""
    return np.asarray(np.minimum(points, np.asarray(BOARD_MM) - points).min(axis=-1))


def _costs(
    here: NDArray[np.float64],
    heading: float,
    curvatures: NDArray[np.float64],
    wanted: float,
    radius_mm: float,
    others: NDArray[np.float64],
    open_end: bool,
) -> NDArray[np.float64]:
    """How bad it is to go on with each of the curvatures: distance from the wanted one, and lack of room at the probes ahead."""
    angle = heading + curvatures[:, None] * _PROBES_MM / 2
    probes = here + np.stack([np.cos(angle), np.sin(angle)], axis=-1) * _PROBES_MM[:, None]
    room = np.full(probes.shape[:2], np.inf) if open_end else _margin(probes) - radius_mm - 3.0
    if len(others):
        gap = np.linalg.norm(probes[:, :, None] - others[:, :2], axis=-1) - others[:, 2] - radius_mm - 3.5
        room = np.minimum(room, gap.min(axis=-1))
    lack = np.maximum(0.0, -room) + 0.3 * np.maximum(0.0, 5.0 - room)
    blocked = np.where(room[:, 0] < 0, 100.0, 0.0)
    return np.asarray(((curvatures - wanted) / 0.03) ** 2 + (lack * np.array([4.0, 2.0, 1.0, 0.5])).sum(axis=-1) + blocked)


def _radii(rng: np.random.Generator, count: int, start_mm: float) -> NDArray[np.float64]:
    """A taper with waves, sometimes a stenosis or an aneurysm; never under 3.4 mm."""
    along = np.linspace(0.0, 1.0, count)
    radii = start_mm * (1.0 - rng.uniform(0.05, 0.4) * along) * (1.0 + rng.uniform(0.0, 0.08) * np.sin(along * rng.uniform(6, 20)))
    for change, chance in ((rng.uniform(-0.4, -0.2), 0.3), (rng.uniform(0.2, 0.45), 0.2)):
        place, width = rng.uniform(0.3, 0.85), rng.uniform(0.06, 0.12)
        if rng.random() < chance:
            radii = radii * (1.0 + change * np.exp(-(((along - place) / width) ** 2)))
    return np.clip(radii, 3.4, 9.0)


def _add_branch(rng: np.random.Generator, sketch: Sketch, manner: _Manner) -> None:
    """A branch from a random place of a random channel, if there is room for one."""
    parent_number = int(rng.integers(len(sketch.channels)))
    parent = sketch.channels[parent_number]
    index = int(rng.uniform(0.15, 0.8) * len(parent.points))
    if parent_number == 0 and index * 0.4 < _INLET_MM:
        return
    if any(abs(index - mark) * 0.4 < 2.2 * parent.radius[index] for mark in parent.marks):
        return
    angle_deg = float(rng.choice([-1.0, 1.0]) * rng.uniform(38.0, 60.0))
    tangent = parent.tangent(index)
    heading = float(np.arctan2(tangent[1], tangent[0]) + np.radians(angle_deg))
    radius_mm = max(3.5, float(parent.radius[index]) * rng.uniform(0.68, 0.95))
    channel = _grown(rng, sketch, parent.points[index], heading, rng.uniform(50.0, 130.0), manner, radius_mm, inlet_mm=0.0)
    if channel is not None:
        sketch.join(sketch.add(channel), 0, parent_number, index)


def _add_bypass(rng: np.random.Generator, sketch: Sketch, side: float, rejoins: bool) -> bool:
    """A channel beside the first one, which it leaves and (if `rejoins`) meets again."""
    main = sketch.channels[0]
    count = len(main.points)
    low = int(count * rng.uniform(0.16, 0.3))
    high = int(count * rng.uniform(0.72, 0.9)) if rejoins else count - 1
    offset = side * (2.0 * float(main.radius.max()) + rng.uniform(4.0, 18.0))
    places = np.linspace(low, high, 6 if rejoins else 5)[1 : -1 if rejoins else None].astype(int)
    normals = np.array([[-t[1], t[0]] for t in (main.tangent(int(i)) for i in places)])
    waypoints: Points = main.points[places] + offset * normals
    radii = _radii(rng, len(waypoints) + 1 + int(rejoins), float(main.radius[low]) * 0.92)
    angle_deg = side * rng.uniform(38.0, 55.0)
    if low * 0.4 < _INLET_MM:
        return False
    at = (float(main.points[low, 0]), float(main.points[low, 1]))
    rejoin = (0, (float(main.points[high, 0]), float(main.points[high, 1])), -angle_deg) if rejoins else None
    sketch.branch(0, at, angle_deg, [(float(x), float(y)) for x, y in waypoints], [float(r) for r in radii], rejoin)
    return True
