"""The figures of a campaign of trials: how path, force, time and offset spread, and where the head went."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from app.figure_style import BLUE, GREY, INK, PALE, styled
from app.palette import ON_PICTURE
from core.perception.polyline import normals
from hardware.twin.phantoms import make_phantom

GREEN, ORANGE, VERMILLION = (
    ON_PICTURE.GREEN,
    ON_PICTURE.ORANGE,
    ON_PICTURE.VERMILLION,
)  # on white paper, always
Rows = Sequence[Mapping[str, Any]]
_LUMEN, _WALL = "#EEF1F4", "#C3CAD3"
_MOST_N = 0.5
_FORCE = LinearSegmentedColormap.from_list("force", [BLUE, ORANGE, VERMILLION])


def draw_spreads(by_policy: Mapping[str, Rows]) -> Figure:
    """One dot per trial and policy: path ratio, largest and 95th-percentile force, time, offset; bars are medians."""
    with styled():
        figure = Figure(figsize=(7.2, 2.5), layout="constrained")
        FigureCanvasAgg(figure)
        panels: list[Axes] = list(figure.subplots(1, 4))
        for axes, (label, limit, values) in zip(panels, _panels(by_policy), strict=True):
            _dots(axes, values)
            if limit is not None:
                axes.axhline(limit, color=VERMILLION, lw=0.9, ls="--", zorder=1)
            axes.set_title(label, fontsize=7.5, loc="left")
            axes.set_ylim(bottom=0.0)
            axes.set_xticks(range(len(values)), list(values))
            axes.set_xlim(-0.6, len(values) - 0.4)
    return figure


def _panels(by_policy: Mapping[str, Rows]) -> list[tuple[str, float | None, dict[str, list[tuple[float, bool]]]]]:
    def collected(read: Any) -> dict[str, list[tuple[float, bool]]]:
        found = {policy: [(read(row), bool(row["reached"])) for row in rows] for policy, rows in by_policy.items()}
        return {policy: [(value, reached) for value, reached in pairs if value is not None] for policy, pairs in found.items()}

    def force(row: Mapping[str, Any]) -> float | None:
        return row["wall_contact_n"]["max"] if row["wall_contact_n"] else None

    return [
        ("Path over route", None, collected(lambda row: row["path_ratio"])),
        ("Largest wall force (N)", _MOST_N, collected(force)),
        ("Time (s)", None, collected(lambda row: row["time_s"])),
        ("Offset over lumen radius", 0.25, collected(lambda row: row["offset_ratio"])),
    ]


def _dots(axes: Axes, values: Mapping[str, list[tuple[float, bool]]]) -> None:
    """Filled: reached its target; hollow: did not."""
    for place, pairs in enumerate(values.values()):
        if not pairs:
            continue
        numbers = np.array([value for value, _ in pairs])
        reached = np.array([ok for _, ok in pairs])
        # Spread sideways by rank, so that the picture is the same every time.
        x = place + 0.44 * ((np.argsort(np.argsort(numbers, kind="stable")) * 0.618) % 1.0 - 0.5)
        axes.scatter(x[reached], numbers[reached], s=9, color=BLUE, linewidths=0, alpha=0.7, zorder=2)
        axes.scatter(x[~reached], numbers[~reached], s=10, facecolors="none", edgecolors=VERMILLION, linewidths=0.9, zorder=2)
        axes.plot([place - 0.3, place + 0.3], [np.median(numbers)] * 2, color=INK, lw=1.4, zorder=3)


def draw_track(row: Mapping[str, Any]) -> Figure:
    """The head's way over the phantom, coloured by contact force up to 0.5 N; a ring is the target, a cross the end of the way."""
    graph = make_phantom(row["phantom"]).graph
    with styled():
        figure = Figure(figsize=(3.4, 2.6), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        for margin, colour in ((0.5, _WALL), (0.0, _LUMEN)):
            for edge in graph.edges:
                side = normals(edge.points) * (edge.radius + margin)[:, None]
                outline = np.vstack([edge.points + side, (edge.points - side)[::-1]])
                axes.fill(outline[:, 0], outline[:, 1], color=colour, lw=0, zorder=1 if margin else 2)
        for edge in graph.edges:
            axes.plot(edge.points[:, 0], edge.points[:, 1], color=GREY, lw=0.4, ls=(0, (4, 3)), zorder=3)
        _draw_way(figure, axes, row)
        axes.set_aspect("equal")
        axes.invert_yaxis()
        axes.set_axis_off()
        axes.set_title(f"{row['policy']}, seed {row['seed']}: {row['outcome']}", fontsize=7.5, loc="left")
    return figure


def _draw_way(figure: Figure, axes: Axes, row: Mapping[str, Any]) -> None:
    track = row["track"]
    points = np.column_stack([track["x_mm"], track["y_mm"]])
    if len(points) > 1:
        lines = LineCollection(list(np.stack([points[:-1], points[1:]], axis=1)), cmap=_FORCE, linewidths=1.3, zorder=4)
        lines.set_array(np.asarray(track["wall_contact_n"][1:]))
        lines.set_clim(0.0, _MOST_N)
        axes.add_collection(lines)
        bar = figure.colorbar(lines, ax=axes, shrink=0.6, aspect=18, pad=0.01)
        bar.set_label("wall force (N)")
        bar.outline.set_edgecolor(PALE)
    if len(points):
        axes.plot(*points[-1], marker="x", color=INK, ms=5, zorder=5)
    axes.plot(*row["target_mm"], marker="o", mfc="none", mec=GREEN, mew=1.4, ms=8, zorder=5)
