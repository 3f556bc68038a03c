"""Draws vessel graphs: smooth channels through waypoints, with branches that leave (and rejoin) them at given angles. All in mm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from core.types import GraphEdge, Points, VesselGraph

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
    """A vessel graph in the making.

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
    waypoints: Points,
    radii: NDArray[np.float64],
    first: NDArray[np.float64] | None = None,
    last: NDArray[np.float64] | None = None,
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
