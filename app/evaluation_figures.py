"""The figures of an evaluation, for a paper: error distribution, Bland-Altman, scatter, confusion matrix, as SVG and PDF.

In SVG text is drawn as outlines, so that a figure looks the same everywhere; the mean line is red and the limits of agreement are
green and dashed, as in the paper.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from app.figure_style import BLUE, GREY, INK, PALE, styled
from app.palette import ON_PICTURE
from core.study.agreement import LIMITS_SD, RANGE_DEG
from core.study.evaluation import AnglePairs
from core.whole_file import write_whole

GREEN, VERMILLION = ON_PICTURE.GREEN, ON_PICTURE.VERMILLION  # on white paper, always
_MEAN, _LIMIT = VERMILLION, GREEN
_SIZE_IN = (3.46, 2.75)
"""One column of a journal's page: 88 mm."""
FIGURES = ("error_distribution", "bland_altman", "scatter", "confusion")
ENDINGS = (".svg", ".pdf")
_DATELESS: dict[str, dict[str, Any]] = {".svg": {"Date": None, "Creator": None}, ".pdf": {"CreationDate": None}}


def draw_figures(pairs: AnglePairs, metrics: dict[str, Any]) -> dict[str, Figure]:
    """The figures there is something to draw for, by name."""
    figures: dict[str, Figure] = {}
    with styled():
        if len(pairs.manual_deg):
            for name, draw in (("error_distribution", error_distribution), ("bland_altman", bland_altman), ("scatter", scatter)):
                figures[name] = _on_axes(partial(draw, pairs=pairs, angle=metrics["angle"]))
        if metrics["state"]["n"]:
            figures["confusion"] = _on_axes(lambda axes: confusion(axes, metrics["state"]), (2.75, 2.65))
    return figures


def drawn(figure: Figure, ending: str) -> bytes:
    """As a file of this ending (``.svg``, ``.pdf``, ``.png``), without a date, so that equal figures are equal files."""
    stream = BytesIO()
    with styled():
        figure.savefig(stream, format=ending.removeprefix("."), metadata=_DATELESS.get(ending), dpi=160)
    return stream.getvalue()


def save_figure(figure: Figure, path: Path) -> None:
    """``drawn`` to `path`, by its ending; raises OSError."""
    # Drawn before: a disk that is full makes the PDF's writer fail in ways of its own.
    write_whole(path, drawn(figure, path.suffix))


def _on_axes(draw: Callable[[Axes], None], size_in: tuple[float, float] = _SIZE_IN) -> Figure:
    # A figure by itself: pyplot would keep it alive and could open a window.
    figure = Figure(figsize=size_in, layout="constrained")
    FigureCanvasAgg(figure)
    draw(figure.add_subplot())
    return figure


def error_distribution(axes: Axes, pairs: AnglePairs, angle: dict[str, Any]) -> None:
    """Histogram of the signed error over the bins that the paper counts in (4 and 8 percent of 180 degrees, either way)."""
    error = pairs.algorithm_deg - pairs.manual_deg
    reach = max(float(np.abs(error).max()) * 1.05, 0.04 * RANGE_DEG * 1.15)
    width = _round_step(2 * reach / 24)
    last = int(np.ceil(reach / width))
    for edge, shade in ((0.08, "#F3F5F7"), (0.04, PALE)):
        axes.axvspan(-edge * RANGE_DEG, edge * RANGE_DEG, color=shade, lw=0, zorder=0)
    bins = (np.arange(-last, last + 1) * width).tolist()
    counts, _, _ = axes.hist(error, bins=bins, color=BLUE, edgecolor="white", linewidth=0.6, zorder=2)
    axes.axvline(angle["mean_error_deg"], color=_MEAN, lw=1.2, zorder=3, label=f"mean {_degrees(angle['mean_error_deg'])}")
    median = f"median {_degrees(angle['median_deg'])}"
    axes.axvline(angle["median_deg"], color=INK, lw=1.0, ls=(0, (1.5, 1.5)), zorder=3, label=median)
    axes.set_xlim(-last * width, last * width)
    axes.set_ylim(0, max(float(np.max(counts)) * 1.22, 1.0))
    for edge in (0.04, 0.08):
        if edge * RANGE_DEG < last * width:
            words = f"{100 * edge:.0f} % "
            axes.text(edge * RANGE_DEG, axes.get_ylim()[1] * 0.985, words, color=GREY, size=6.5, ha="right", va="top")
    axes.yaxis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10], integer=True))
    axes.set_xlabel("Error, algorithm − manual (°)")
    axes.set_ylabel("Images")
    axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0, 1), ncols=2, fontsize=6.5, handlelength=1.6, borderaxespad=0.2)


def bland_altman(axes: Axes, pairs: AnglePairs, angle: dict[str, Any]) -> None:
    """Difference over mean of the two methods, with the mean difference and the 95 % limits of agreement."""
    mean, error = (pairs.algorithm_deg + pairs.manual_deg) / 2, pairs.algorithm_deg - pairs.manual_deg
    axes.axhline(0, color=PALE, lw=1.0, zorder=0)
    lines = [("mean_error_deg", "mean", _MEAN, "-")]
    if angle["sd_deg"] is not None:
        sign = f"{LIMITS_SD} SD"
        lines += [("loa_high_deg", f"+{sign}", _LIMIT, "--"), ("loa_low_deg", f"−{sign}", _LIMIT, "--")]
    for name, words, colour, style in lines:
        value, interval = angle[name], angle["ci95"][name]
        if interval is not None:
            axes.axhspan(*interval, color=colour, alpha=0.10, lw=0, zorder=0)
        axes.axhline(value, color=colour, lw=1.2, ls=style, zorder=1)
        axes.annotate(
            f"{words}\n{_degrees(value)}",
            (1.0, value),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            size=6.5,
            color=colour,
            annotation_clip=False,
        )
    _points(axes, mean, error)
    reach = max(np.abs(error).max(), *(abs(angle[name]) for name, *_ in lines), 1.0) * 1.18
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("Mean of algorithm and manual (°)")
    axes.set_ylabel("Difference, algorithm − manual (°)")


def scatter(axes: Axes, pairs: AnglePairs, angle: dict[str, Any]) -> None:
    """Algorithm over manual, both axes alike, with the identity line."""
    values = np.concatenate([pairs.manual_deg, pairs.algorithm_deg])
    step = _round_step((float(values.max()) - min(0.0, float(values.min()))) / 6 or 1.0)
    low, high = min(0.0, np.floor(values.min() / step) * step), max(np.ceil(values.max() / step) * step, step)
    axes.plot([low, high], [low, high], color=GREY, lw=0.9, zorder=1)
    _points(axes, pairs.manual_deg, pairs.algorithm_deg)
    margin = (high - low) * 0.02
    axes.set(xlim=(low - margin, high + margin), ylim=(low - margin, high + margin), aspect="equal")
    ticks = np.arange(low, high + step / 2, step)
    axes.set_xticks(ticks)
    axes.set_yticks(ticks)
    axes.set_xlabel("Manual angle (°)")
    axes.set_ylabel("Algorithm angle (°)")
    coefficients = {"r": angle["pearson"], "ρ": angle["spearman"], "ICC": angle["icc"]}
    words = [f"n = {angle['n']}", *(f"{name} = {value:.3f}" for name, value in coefficients.items() if value is not None)]
    axes.text(0.03, 0.98, "\n".join(words), transform=axes.transAxes, va="top", size=6.5, linespacing=1.5)


def confusion(axes: Axes, state: dict[str, Any]) -> None:
    """Counts, and shares of the manual state; shade by share."""
    table = np.array(state["confusion"], float)
    support = table.sum(1, keepdims=True)
    share = np.divide(table, support, out=np.zeros_like(table), where=support > 0)
    shades = LinearSegmentedColormap.from_list("paper", ["#FFFFFF", BLUE])
    # A mesh stays vectors; an image would be a bitmap in the file.
    edges = np.arange(len(table) + 1) - 0.5
    axes.pcolormesh(edges, edges, share, cmap=shades, vmin=0, vmax=1, edgecolors=PALE, linewidth=0.8)
    axes.set(aspect="equal", ylim=(edges[-1], edges[0]))
    for row, column in np.ndindex(*table.shape):
        colour = "white" if share[row, column] > 0.55 else INK
        axes.text(column, row - 0.08, f"{table[row, column]:.0f}", ha="center", va="center", size=9.5, color=colour)
        if support[row, 0]:
            axes.text(column, row + 0.22, f"{100 * share[row, column]:.0f} %", ha="center", va="center", size=6.5, color=colour)
    places = range(len(state["labels"]))
    axes.set_xticks(places, state["labels"])
    axes.set_yticks(places, state["labels"])
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.set_xlabel("Algorithm state")
    axes.set_ylabel("Manual state")


def _points(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    crowded = len(x) > 300
    axes.scatter(x, y, s=5 if crowded else 13, color=BLUE, alpha=0.45 if crowded else 0.75, lw=0, zorder=2)


def _degrees(value: float) -> str:
    return f"{round(value, 2) + 0.0:.2f}°".replace("-", "−")


def _round_step(rough: float) -> float:
    """The next of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(rough))
    return float(next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough * (1 - 1e-9)))
