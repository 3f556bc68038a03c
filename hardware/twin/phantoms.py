"""Named and random phantoms: smooth channels through waypoints, with branches that leave (and rejoin) them at given angles.

Lengths and coordinates are board millimetres (x right, y down). ``faults`` checks that channels keep apart and lie on the board,
and that a robot can follow them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial import cKDTree

from core.types import GraphEdge, Points, VesselGraph
from hardware.twin.phantom import BOARD_MM, PHANTOM_TITLES, Phantom

SPACING_MM = 0.4
Waypoints = Sequence[tuple[float, float]]


@dataclass(slots=True, eq=False)
class Channel:
    """One smooth run of lumen: ``points`` (N, 2) and ``radius`` (N,); ``marks`` are the point indices where it has nodes."""

    points: Points
    radius: NDArray[np.float64]
    marks: set[int] = field(default_factory=set)

    def index_near(self, point: tuple[float, float]) -> int:
        return int(np.argmin(np.sum((self.points - point) ** 2, axis=1)))

    def tangent(self, index: int) -> NDArray[np.float64]:
        """Unit tangent at a point, in the direction of drawing."""
        low, high = max(index - 1, 0), min(index + 1, len(self.points) - 1)
        step = self.points[high] - self.points[low]
        return np.asarray(step / np.linalg.norm(step))


class Sketch:
    """Builds a vessel graph channel by channel.

    A channel that carries on past a junction stays one spline, so the graph is C1 (in fact C2) along through-branches.
    """

    def __init__(self) -> None:
        self.channels: list[Channel] = []
        self._same: dict[tuple[int, int], tuple[int, int]] = {}

    def add(self, channel: Channel) -> int:
        """Add a ready-made channel; returns its number."""
        channel.marks |= {0, len(channel.points) - 1}
        self.channels.append(channel)
        return len(self.channels) - 1

    def run(self, waypoints: Waypoints, radii: Sequence[float]) -> int:
        """Add a free channel through `waypoints` with lumen `radii` at them; returns its number."""
        return self.add(smooth_channel(np.asarray(waypoints, np.float64), np.asarray(radii, np.float64)))

    def branch(
        self,
        parent: int,
        near: tuple[float, float],
        angle_deg: float,
        waypoints: Waypoints,
        radii: Sequence[float],
        rejoin: tuple[int, tuple[float, float], float] | None = None,
    ) -> int:
        """Add a channel that leaves `parent` at its point nearest to `near`; returns its number.

        Parameters
        ----------
        angle_deg : between the parent's direction and the branch's first tangent, positive = to the right as seen on screen.
        waypoints, radii : the rest of the way, without the start; the first of `radii` is at the start, so one more than waypoints
            (two more with `rejoin`).
        rejoin : (channel, near, angle_deg) where the branch ends on another channel, the angle between that channel's direction and
            the branch's last tangent.
        """
        start = self.channels[parent].index_near(near)
        points = [tuple(self.channels[parent].points[start]), *waypoints]
        first = _turned(self.channels[parent].tangent(start), angle_deg)
        last = None
        if rejoin is not None:
            end_channel, end_near, end_angle_deg = rejoin
            end = self.channels[end_channel].index_near(end_near)
            points.append(tuple(self.channels[end_channel].points[end]))
            last = _turned(self.channels[end_channel].tangent(end), end_angle_deg)
        number = self.add(smooth_channel(np.asarray(points), np.asarray(radii, np.float64), first, last))
        self.join(number, 0, parent, start)
        if rejoin is not None:
            self.join(number, len(self.channels[number].points) - 1, end_channel, end)
        return number

    def join(self, channel: int, index: int, onto: int, onto_index: int) -> None:
        """Make point `index` of `channel` the same node as point `onto_index` of channel `onto`."""
        self.channels[channel].marks.add(index)
        self.channels[onto].marks.add(onto_index)
        self._same[channel, index] = (onto, onto_index)

    def graph(self) -> VesselGraph:
        """The graph drawn so far; node 0 is the start of the first channel."""
        numbers: dict[tuple[int, int], int] = {}
        nodes: list[NDArray[np.float64]] = []

        def node(channel: int, index: int) -> int:
            key = channel, index
            while key in self._same:
                key = self._same[key]
            if key not in numbers:
                numbers[key] = len(nodes)
                nodes.append(self.channels[key[0]].points[key[1]])
            return numbers[key]

        edges = []
        for number, channel in enumerate(self.channels):
            marks = sorted(channel.marks)
            for low, high in zip(marks[:-1], marks[1:], strict=True):
                piece = slice(low, high + 1)
                edges.append(GraphEdge(node(number, low), node(number, high), channel.points[piece], channel.radius[piece]))
        return VesselGraph(np.array(nodes), tuple(edges))


def smooth_channel(
    waypoints: Points, radii: NDArray[np.float64], first: NDArray[np.float64] | None = None, last: NDArray[np.float64] | None = None
) -> Channel:
    """A cubic spline through `waypoints` at even spacing, `radii` interpolated without overshoot.

    `first` and `last` are unit tangents at the ends (None: natural end).
    """
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(waypoints, axis=0), axis=1))])
    free = (2, np.zeros(2))
    ends = (free if first is None else (1, first), free if last is None else (1, last))
    curve = CubicSpline(chord, waypoints, bc_type=ends)
    fine = np.linspace(0.0, chord[-1], int(chord[-1] / 0.05) + 2)
    dense = curve(fine)
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    even = np.interp(np.linspace(0.0, arc[-1], int(np.ceil(arc[-1] / SPACING_MM)) + 1), arc, fine)
    return Channel(np.asarray(curve(even)), np.asarray(PchipInterpolator(chord, radii)(even)))


def _turned(direction: NDArray[np.float64], angle_deg: float) -> NDArray[np.float64]:
    """`direction` turned by `angle_deg`, positive = to the right as seen on screen (x right, y down)."""
    angle = np.radians(angle_deg)
    x, y = direction
    return np.array([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle)])


WALL_GAP_MM = 2.0
MIN_BEND_RADIUS_MM = 8.0
MAX_TURN_DEG = 75.0
_STRIDE = 3
_SAME_CHANNEL, _OTHER_CHANNEL = 1.6, 3.6


def faults(phantom: Phantom) -> list[str]:
    """What is wrong with `phantom`, one line each; empty when it is fit.

    A bend as tight as the lumen allows brings points 2 * (radius + gap) apart within half a turn, pi/2 times that along the way;
    two branches that leave a junction at 35 degrees keep their gap after 3.5 times that. Points that are further apart along the
    graph must have a wall between them.
    """
    return [*_off_board(phantom), *_too_tight(phantom), *_sharp_turns(phantom), *_overlaps(phantom)]


def bend_radius_mm(points: Points, over_mm: float = 4.0) -> NDArray[np.float64]:
    """Local radius of curvature (N,) of a polyline (N, 2), measured over chords of `over_mm`."""
    step = max(1, round(over_mm / 2 / float(np.linalg.norm(points[1] - points[0]))))
    if len(points) < 2 * step + 1:
        return np.full(len(points), np.inf)
    before, here, after = points[: -2 * step], points[step:-step], points[2 * step :]
    a, b, c = (np.linalg.norm(q - p, axis=1) for p, q in ((before, here), (here, after), (before, after)))
    u, v = here - before, after - here
    area2 = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    radius = a * b * c / np.maximum(2 * area2, 1e-9)
    return np.concatenate([np.full(step, np.inf), radius, np.full(step, np.inf)])


def node_distances_mm(phantom: Phantom) -> NDArray[np.float64]:
    """Shortest way along the graph between all nodes, (K, K)."""
    count = len(phantom.graph.nodes)
    distance = np.full((count, count), np.inf)
    np.fill_diagonal(distance, 0.0)
    for edge in phantom.graph.edges:
        length = float(np.linalg.norm(np.diff(edge.points, axis=0), axis=1).sum())
        distance[edge.start, edge.end] = min(distance[edge.start, edge.end], length)
        distance[edge.end, edge.start] = distance[edge.start, edge.end]
    for via in range(count):
        distance = np.minimum(distance, distance[:, via, None] + distance[None, via, :])
    return distance


def _off_board(phantom: Phantom) -> list[str]:
    """Lumen may leave the board only within reach of an end that lies at the edge."""
    graph, found = phantom.graph, []
    open_ends = [graph.nodes[node] for node in (phantom.port, *phantom.targets) if _margin(graph.nodes[node][None])[0] < 1.0]
    for number, edge in enumerate(graph.edges):
        outside = _margin(edge.points) < edge.radius + 1.0
        for end in open_ends:
            outside &= np.linalg.norm(edge.points - end, axis=1) > 2.0 * edge.radius + 4.0
        if outside.any():
            x, y = edge.points[np.argmax(outside)]
            found.append(f"edge {number} leaves the board at ({x:.0f}, {y:.0f})")
    return found


def _too_tight(phantom: Phantom) -> list[str]:
    found = []
    for number, edge in enumerate(phantom.graph.edges):
        tightest = float(bend_radius_mm(edge.points).min())
        if tightest < MIN_BEND_RADIUS_MM:
            found.append(f"edge {number} bends with radius {tightest:.1f} mm")
    return found


def _sharp_turns(phantom: Phantom) -> list[str]:
    """Turns at junctions on the shortest ways from the port to each target."""
    distance, found = node_distances_mm(phantom), []
    leaving: dict[int, list[tuple[int, NDArray[np.float64]]]] = {}
    for edge in phantom.graph.edges:
        for near, far, points in ((edge.start, edge.end, edge.points), (edge.end, edge.start, edge.points[::-1])):
            step = points[min(5, len(points) - 1)] - points[0]
            leaving.setdefault(near, []).append((far, step / np.linalg.norm(step)))
    for node, exits in leaving.items():
        ins = [away for far, away in exits if distance[phantom.port, far] < distance[phantom.port, node]]
        outs = [away for far, away in exits if distance[phantom.port, far] > distance[phantom.port, node]]
        for inward in ins:
            for outward in outs:
                turn_deg = float(np.degrees(np.arccos(np.clip(-inward @ outward, -1.0, 1.0))))
                if turn_deg > MAX_TURN_DEG:
                    found.append(f"node {node} asks for a turn of {turn_deg:.0f} deg")
    return found


def _overlaps(phantom: Phantom) -> list[str]:
    edges, between = phantom.graph.edges, node_distances_mm(phantom)
    points = np.concatenate([edge.points[::_STRIDE] for edge in edges])
    radius = np.concatenate([edge.radius[::_STRIDE] for edge in edges])
    owner = np.concatenate([np.full(len(edge.points[::_STRIDE]), number) for number, edge in enumerate(edges)])
    steps = [np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(edge.points, axis=0), axis=1))]) for edge in edges]
    from_start = np.concatenate([arc[::_STRIDE] for arc in steps])
    to_end = np.concatenate([arc[-1] - arc[::_STRIDE] for arc in steps])
    pairs = cKDTree(points).query_pairs(2 * float(radius.max()) + WALL_GAP_MM, output_type="ndarray")
    i, j = pairs.T
    near = np.linalg.norm(points[i] - points[j], axis=1) < radius[i] + radius[j] + WALL_GAP_MM
    i, j = i[near], j[near]
    start = np.array([edge.start for edge in edges])
    end = np.array([edge.end for edge in edges])
    ways = [
        first + between[a, b] + second
        for a, first in ((start[owner[i]], from_start[i]), (end[owner[i]], to_end[i]))
        for b, second in ((start[owner[j]], from_start[j]), (end[owner[j]], to_end[j]))
    ]
    same = owner[i] == owner[j]
    along = np.min(ways, axis=0)
    along = np.where(same, np.minimum(along, np.abs(from_start[i] - from_start[j])), along)
    allowed = np.where(same, _SAME_CHANNEL, _OTHER_CHANNEL) * (radius[i] + radius[j] + WALL_GAP_MM)
    bad = along > allowed
    if not bad.any():
        return []
    worst = int(np.argmax(np.where(bad, along - allowed, -np.inf)))
    (x, y), (first, second) = points[i[worst]], (owner[i[worst]], owner[j[worst]])
    return [f"edges {first} and {second} come too near each other at ({x:.0f}, {y:.0f})"]


MAX_WAY_MM = 290.0
_STEP_MM = 1.0
_INLET_MM = 16.0
_OPEN_END_CHANCE = 0.25
_PROBES_MM = np.array([5.0, 10.0, 16.0, 24.0])
_STYLES = {"single": 0.2, "tree": 0.5, "loop": 0.15, "parallel": 0.15}


@dataclass(frozen=True, slots=True)
class _ChannelStyle:
    """Shape of the channels of one phantom."""

    wander: float
    """Spread of curvature (1/mm)."""
    max_curvature: float
    radius_mm: float


def random_phantom(seed: int) -> Phantom:
    """A phantom drawn at random: topology, port side, curvature, radii, stenoses and aneurysms; 1 to 6 ends.

    Phantoms with ``faults`` are drawn again, so every seed gives a usable phantom.
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
    channel_style = _ChannelStyle(
        wander, 1 / rng.uniform(11.0, 18.0), rng.uniform(4.2, 8.0 if style in ("single", "tree") else 5.5)
    )
    sketch = Sketch()
    start, heading = _port(rng)
    length = rng.uniform(110.0, 270.0 if style == "single" else 210.0)
    main = _grow_channel(rng, sketch, start, heading, length, channel_style, channel_style.radius_mm, inlet_mm=_INLET_MM)
    if main is None:
        return None
    sketch.add(main)
    if style in ("loop", "parallel"):
        sides = [1.0, -1.0] if style == "parallel" else [float(rng.choice([-1.0, 1.0]))]
        if not all(_add_bypass(rng, sketch, side, rejoins=style == "loop") for side in sides):
            return None
    branches = {"single": 0, "tree": int(rng.integers(1, 6)), "loop": int(rng.integers(0, 3)), "parallel": 0}[style]
    for _ in range(branches):
        _add_branch(rng, sketch, channel_style)
    return sketch if style != "tree" or len(sketch.channels) > 1 else None


def _port(rng: np.random.Generator) -> tuple[NDArray[np.float64], float]:
    """A place just outside one of the four board edges and a heading (radians) into the board."""
    width, height = BOARD_MM
    side, along, lean = int(rng.integers(4)), rng.uniform(0.22, 0.78), rng.uniform(-0.25, 0.25)
    places = ((-1.0, along * height), (along * width, -1.0), (width + 1.0, along * height), (along * width, height + 1.0))
    return np.array(places[side]), side * np.pi / 2 + lean


def _grow_channel(
    rng: np.random.Generator,
    sketch: Sketch,
    start: NDArray[np.float64],
    heading: float,
    length_mm: float,
    channel_style: _ChannelStyle,
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
        wanted = 0.96 * wanted + rng.normal(0.0, channel_style.wander * 0.28)
        if travelled >= inlet_mm:
            own = np.array(path[: max(0, len(path) - int(3.4 * radius_mm) - 8)][::2]).reshape(-1, 2)
            others = np.concatenate([taken, np.column_stack([own, np.full(len(own), radius_mm)])])
            choices = np.clip(curvature + np.linspace(-0.02, 0.02, 9), -channel_style.max_curvature, channel_style.max_curvature)
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
    """Distance of points (..., 2) to the edge of the board, negative outside."""
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


def _add_branch(rng: np.random.Generator, sketch: Sketch, channel_style: _ChannelStyle) -> None:
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
    channel = _grow_channel(
        rng, sketch, parent.points[index], heading, rng.uniform(50.0, 130.0), channel_style, radius_mm, inlet_mm=0.0
    )
    if channel is not None:
        sketch.join(sketch.add(channel), 0, parent_number, index)


def _add_bypass(rng: np.random.Generator, sketch: Sketch, side: float, rejoins: bool) -> bool:
    """Add a channel beside the first one, which it leaves and (if `rejoins`) meets again; False when there is no room."""
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


@dataclass(frozen=True, slots=True)
class _Branch:
    """A branch of a named phantom: arguments of ``Sketch.branch``."""

    parent: int
    near: tuple[float, float]
    angle_deg: float
    waypoints: Waypoints
    radii: Sequence[float]
    rejoin: tuple[int, tuple[float, float], float] | None = None


# Waypoints and radii of the trunk (channel 0), then the branches (channels 1, 2, ...).
_NAMED: dict[str, tuple[Waypoints, Sequence[float], tuple[_Branch, ...]]] = {
    "s_curve": (
        [(-1, 34), (24, 33), (66, 28), (98, 52), (104, 88), (130, 119), (166, 112), (178, 84), (170, 60)],
        [6.0, 6.0, 5.2, 4.6, 5.6, 6.2, 5.0, 4.2, 4.0],
        (),
    ),
    "y_branch": (
        [(96, 151), (97, 128), (102, 100), (92, 72), (66, 44), (48, 16)],
        [7.0, 7.0, 6.6, 6.0, 4.8, 4.2],
        (_Branch(0, (101, 95), 40.0, [(120, 70), (141, 44), (166, 30)], [6.0, 5.0, 4.6, 3.8]),),
    ),
    # A narrow trunk: in a wide one the bent tip finds no wall to lean on, the shaft goes straight on and misses the branches.
    "tree": (
        [(-1, 78), (22, 78), (56, 76), (92, 80), (124, 69), (154, 72), (186, 64)],
        [5.0, 4.8, 4.6, 4.6, 4.4, 4.2, 3.8],
        (
            _Branch(0, (42, 77), -36.0, [(66, 54), (86, 32), (116, 18)], [5.0, 4.8, 4.4, 3.9]),
            _Branch(1, (74, 45), 42.0, [(98, 44), (128, 42), (158, 32)], [4.6, 4.2, 4.0, 3.7]),
            _Branch(0, (84, 80), 34.0, [(106, 96), (121, 117), (134, 138)], [4.8, 4.4, 4.2, 3.7]),
            _Branch(3, (108, 98), -36.0, [(128, 106), (154, 106), (180, 98)], [4.6, 4.2, 4.0, 3.8]),
        ),
    ),
    "aortic_arch": (
        [(146, 151), (146, 128), (144, 104), (134, 76), (108, 60), (80, 68), (64, 92), (60, 122)],
        [9.0, 9.0, 9.4, 10.0, 10.4, 10.6, 11.0, 11.6],
        (
            _Branch(0, (133, 75), 50.0, [(140, 44), (152, 26), (156, 9)], [4.6, 4.4, 4.2, 4.0]),
            _Branch(0, (110, 60), 62.0, [(106, 34), (112, 10)], [4.4, 4.2, 3.9]),
            _Branch(0, (86, 64), 62.0, [(68, 42), (66, 24), (70, 9)], [5.6, 5.2, 4.4, 4.0]),
            _Branch(3, (70, 44), -48.0, [(44, 33), (18, 29)], [4.4, 4.2, 3.8]),
        ),
    ),
    "tortuous": (
        [(-1, 104), (22, 103), (42, 88), (52, 64), (70, 50), (88, 63), (94, 90), (110, 105), (126, 92), (130, 64), (145, 48),
         (161, 62), (166, 88), (182, 100)],
        [5.4, 5.4, 5.0, 4.4, 5.0, 4.6, 4.0, 4.8, 4.4, 3.8, 4.8, 4.4, 4.0, 3.8],
        (),
    ),
    "cerebral_siphon": (
        [(58, 151), (58, 128), (64, 102), (86, 92), (106, 98), (123, 90), (120, 72), (104, 62), (106, 46), (124, 40), (152, 44),
         (184, 36)],
        [5.0, 5.0, 4.8, 4.6, 4.5, 4.4, 4.4, 4.6, 5.0, 4.6, 4.0, 3.6],
        (
            _Branch(0, (112, 42), -52.0, [(116, 22), (98, 12), (72, 20), (52, 14)], [3.9, 3.8, 3.7, 3.6, 3.5]),
            _Branch(0, (149, 43), 40.0, [(166, 61), (184, 72)], [4.0, 3.8, 3.6]),
        ),
    ),
    "parallel_channels": (
        [(-1, 75), (22, 75), (60, 75), (120, 77), (170, 73), (201, 75)],
        [7.0, 7.0, 5.0, 4.4, 4.8, 5.0],
        (
            _Branch(0, (26, 75), -40.0, [(46, 54), (78, 45), (128, 47), (172, 44), (201, 45)], [5.4, 5.2, 5.0, 4.2, 4.6, 4.8]),
            _Branch(0, (40, 75), 42.0, [(60, 94), (86, 104), (132, 103), (172, 106), (201, 105)], [5.2, 5.0, 4.8, 4.2, 4.6, 4.8]),
        ),
    ),
    "loop": (
        [(201, 84), (178, 84), (150, 74), (124, 46), (92, 38), (62, 52), (38, 72), (12, 76)],
        [6.4, 6.4, 5.8, 4.8, 4.6, 5.0, 5.4, 4.2],
        (_Branch(0, (156, 77), -44.0, [(122, 106), (90, 117), (60, 102)], [5.2, 5.0, 4.4, 4.6, 5.0], (0, (36, 73), 50.0)),),
    ),
    "coronary": (
        [(30, -1), (32, 20), (46, 44), (76, 56), (110, 58), (142, 74), (162, 102), (168, 134)],
        [5.6, 5.6, 5.2, 4.8, 3.6, 4.6, 4.0, 3.5],
        (
            _Branch(0, (40, 36), 50.0, [(38, 68), (42, 98), (62, 124), (92, 136)], [4.6, 4.6, 5.8, 4.2, 3.6]),
            _Branch(0, (84, 57), 50.0, [(100, 82), (122, 106), (128, 130)], [4.2, 4.0, 3.8, 3.5]),
            _Branch(0, (106, 57), -44.0, [(130, 40), (156, 36), (184, 26)], [4.2, 4.0, 3.8, 3.5]),
        ),
    ),
}  # fmt: skip

PHANTOM_NAMES: tuple[str, ...] = tuple(PHANTOM_TITLES)


def make_phantom(name: str) -> Phantom:
    """The phantom called `name`: one of ``PHANTOM_NAMES``, ``random:<seed>``, or ``bench:<folder>`` of a bench with a phantom.

    Raises ValueError when there is no such phantom; the message lists the names.
    """
    kind, _, seed = name.partition(":")
    if kind == "bench":
        from hardware.twin.own_phantom import read_phantom

        return read_phantom(name)
    if kind == "random" and seed.isdecimal():
        return random_phantom(int(seed))
    if name not in _NAMED:
        raise ValueError(f"unknown phantom {name!r}; known: {', '.join(PHANTOM_NAMES)}, random:<seed>, bench:<folder>")
    waypoints, radii, branches = _NAMED[name]
    sketch = Sketch()
    sketch.run(waypoints, radii)
    for branch in branches:
        sketch.branch(branch.parent, branch.near, branch.angle_deg, branch.waypoints, branch.radii, branch.rejoin)
    return Phantom(name, PHANTOM_TITLES[name], sketch.graph(), port=0)
