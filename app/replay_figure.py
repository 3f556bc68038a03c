"""The figure of a replay: theta and state before and after over time, how much theta and head moved, and the table of states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from app.figure_style import BLUE, GREY, INK, PALE, styled
from app.palette import ON_PICTURE, STATE_COLOUR
from core.study.replay import Change, Seen
from core.study.replay_tally import STATES
from core.types import PoseState

VERMILLION = ON_PICTURE.VERMILLION  # on white paper, always
_MOST_POINTS = 3000
"""An hour has a hundred thousand frames; nobody sees more than a few per printed dot."""

_Floats = NDArray[np.float64]


def draw_replay(changes: Sequence[Change], matrix: list[list[int]], name: str) -> Figure:
    """Two columns of a journal's page. `matrix` is that of ``summarise``; `name` the session's."""
    time_s = np.array([change.time_s for change in changes])
    with styled():
        figure = Figure(figsize=(7.2, 4.4), layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(4, 2, width_ratios=(3.1, 1.0), height_ratios=(2.6, 0.5, 1.3, 1.3))
        theta, band, moved, shifted = (figure.add_subplot(grid[row, 0]) for row in range(4))
        _draw_theta(theta, changes, time_s)
        theta.set_title(name, fontsize=7.5, loc="left", color=GREY)
        _draw_states(band, changes, time_s)
        _draw_change(moved, time_s, _column([change.theta_deg for change in changes]), "|\N{GREEK CAPITAL LETTER DELTA} theta| (°)")
        _draw_change(shifted, time_s, _column([change.head_px for change in changes]), "head shift (px)")
        shifted.set_xlabel("time (s)")
        for axes in (theta, band, moved, shifted):
            axes.set_xlim(time_s[0], max(time_s[-1], time_s[0] + 1e-3))
            if axes is not shifted:
                axes.tick_params(labelbottom=False)
        _draw_matrix(figure.add_subplot(grid[:2, 1]), matrix)
    return figure


def _column(values: Sequence[float | None]) -> _Floats:
    return np.array([np.nan if value is None else value for value in values], np.float64)


def _thinned(count: int) -> slice:
    return slice(None, None, max(1, -(-count // _MOST_POINTS)))


def _draw_theta(axes: Axes, changes: Sequence[Change], time_s: _Floats) -> None:
    every = _thinned(len(changes))
    for side, colour, label, width in (("before", GREY, "before", 1.6), ("after", BLUE, "after", 0.9)):
        values = _column([getattr(change, side).theta_signed_deg for change in changes])
        # a turn through 180 degrees is no line across the figure
        values[1:][np.abs(np.diff(values)) > 180.0] = np.nan
        axes.plot(time_s[every], values[every], color=colour, lw=width, label=label, marker=".", ms=1.5)
    axes.axhline(0.0, color=PALE, lw=0.7, zorder=0)
    axes.set_ylabel("theta (°)")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, frameon=False, fontsize=7, borderaxespad=0.0)


def _draw_states(axes: Axes, changes: Sequence[Change], time_s: _Floats) -> None:
    """Two bands of colour, each state with its letter where there is room for it."""
    edges = np.concatenate([time_s, [2 * time_s[-1] - time_s[-2] if len(time_s) > 1 else time_s[-1] + 0.03]])
    span = max(edges[-1] - edges[0], 1e-6)
    for height, side in ((1.0, "before"), (0.0, "after")):
        sides: list[Seen] = [getattr(change, side) for change in changes]
        first = 0
        for k in range(1, len(sides) + 1):
            if k < len(sides) and sides[k].state is sides[first].state:
                continue
            state, left, width = sides[first].state, edges[first], edges[k] - edges[first]
            if state is not None:
                axes.broken_barh([(left, width)], (height + 0.08, 0.84), facecolors=STATE_COLOUR[state], lw=0)
                if width > 0.02 * span:
                    axes.text(left + width / 2, height + 0.47, state.value, ha="center", va="center", fontsize=6, color=INK)
            first = k
    axes.set_yticks([1.5, 0.5], ["before", "after"])
    axes.set_ylim(0.0, 2.0)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def _draw_change(axes: Axes, time_s: _Floats, values: _Floats, label: str) -> None:
    """The largest of each few frames: a peak of one frame must not be thinned away."""
    size = _thinned(len(values)).step
    full = np.abs(np.pad(values, (0, -len(values) % size), constant_values=np.nan)).reshape(-1, size)
    highest = np.max(np.nan_to_num(full, nan=-1.0), axis=1)
    highest[highest < 0.0] = np.nan
    axes.plot(time_s[::size], highest, color=VERMILLION, lw=0.8, marker=".", ms=1.5)
    axes.set_ylabel(label)
    axes.set_ylim(bottom=0.0)


def _draw_matrix(axes: Axes, matrix: list[list[int]]) -> None:
    counts = np.array(matrix, np.float64)
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.4, aspect="equal")
    for (row, column), count in np.ndenumerate(counts):
        if count:
            axes.text(column, row, f"{count:.0f}", ha="center", va="center", fontsize=6.5, color=INK)
    labels = [*(state.value for state in PoseState), "none"]
    axes.set_xticks(range(len(STATES)), labels)
    axes.set_yticks(range(len(STATES)), labels)
    axes.set_xlabel("state after")
    axes.set_ylabel("state before")
    axes.set_title("frames", fontsize=7.5, loc="left")
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
