"""Figures for a paper, as SVG and PDF: of an evaluation, of angles over time, and of a campaign of trials.

In SVG text is drawn as outlines, so that a figure looks the same everywhere; the same figure always gives the same file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from app.ui.palette import ON_PICTURE
from core.config.models import RESOURCES
from core.evaluation.evaluation import AnglePairs
from core.evaluation.metrics import LIMITS_SD, RANGE_DEG
from core.files import write_atomic
from core.geometry import normals
from hardware.twin.phantoms import make_phantom

INK, GREY, PALE, BLUE = "#1A1D21", "#6B727C", "#E4E7EB", "#0B5C94"
GREEN, VERMILLION, ORANGE = ON_PICTURE.GREEN, ON_PICTURE.VERMILLION, ON_PICTURE.ORANGE  # the paper is always white
_MEAN, _LIMIT = VERMILLION, GREEN
"""Mean and limits of agreement, as in the paper."""
_SIZE_IN = (3.46, 2.75)
"""One column of a journal's page: 88 mm."""
_DATELESS: dict[str, dict[str, Any]] = {".svg": {"Date": None, "Creator": None}, ".pdf": {"CreationDate": None}}
_LUMEN, _WALL = "#EEF1F4", "#C3CAD3"
_MOST_N = 0.5
"""Largest force that is allowed, and the end of the colour scale."""
_FORCE = LinearSegmentedColormap.from_list("force", [BLUE, ORANGE, VERMILLION])
_STYLE: Any = {
    "font.family": ["Inter", "DejaVu Sans"],
    "font.size": 7.5,
    "axes.labelsize": 7.5,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "svg.fonttype": "path",
    "pdf.fonttype": 42,  # outlines of Type 3 are refused by some journals
    "svg.hashsalt": "lumenpilot",  # the same figure gives the same file
    "axes.unicode_minus": True,
    "text.color": INK,
}


def styled() -> AbstractContextManager[None]:
    """The style as a context: what is drawn within it has it."""
    known = {entry.fname for entry in font_manager.fontManager.ttflist}
    for path in sorted((RESOURCES / "fonts").glob("Inter-*.otf")):
        if str(path) not in known:
            font_manager.fontManager.addfont(path)
    return mpl.rc_context(_STYLE)


def draw_figures(pairs: AnglePairs, metrics: dict[str, Any]) -> dict[str, Figure]:
    """The figures there is something to draw for, by name."""
    figures: dict[str, Figure] = {}
    with styled():
        if len(pairs.manual_deg):
            for name, draw in (("error_distribution", error_distribution), ("bland_altman", bland_altman), ("scatter", scatter)):
                figures[name] = _new_figure(_SIZE_IN)
                draw(figures[name].add_subplot(), pairs, metrics["angle"])
        if metrics["state"]["n"]:
            figures["confusion"] = _new_figure((2.75, 2.65))
            confusion(figures["confusion"].add_subplot(), metrics["state"])
    return figures


def drawn(figure: Figure, ending: str) -> bytes:
    """As a file of this ending (``.svg``, ``.pdf``, ``.png``), without a date, so that equal figures are equal files."""
    stream = BytesIO()
    with styled():
        figure.savefig(stream, format=ending.removeprefix("."), metadata=_DATELESS.get(ending), dpi=160)
    return stream.getvalue()


def save_figure(figure: Figure, path: Path) -> None:
    """``drawn`` to `path`, by its ending; raises OSError."""
    # Drawn before writing: on a full disk the PDF's writer fails in ways of its own.
    write_atomic(path, drawn(figure, path.suffix))


def _new_figure(size_in: tuple[float, float]) -> Figure:
    # Without pyplot, which would keep the figure alive and could open a window.
    figure = Figure(figsize=size_in, layout="constrained")
    FigureCanvasAgg(figure)
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


_Floats = NDArray[np.float64]


def draw_angles(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Angles by hand over time (rows of ``--export angles``), drawn ones larger than followed ones, beside the algorithm's."""
    with styled():
        figure = _new_figure((7.0, 2.75))
        axes = figure.add_subplot()
        timed = all(row["time_s"] is not None for row in rows)
        across = _column([row["time_s"] if timed else number for number, row in enumerate(rows)])
        algorithm, manual = (_column([row[name] for row in rows]) for name in ("algorithm_theta_signed_deg", "theta_signed_deg"))
        is_followed = np.array([row["provenance"] == "followed" for row in rows])
        axes.plot(across, algorithm, color=GREY, lw=1.6, label="algorithm")
        axes.plot(across[is_followed], manual[is_followed], ".", color=BLUE, ms=2.5, label="followed")
        axes.plot(across[~is_followed], manual[~is_followed], "o", color=VERMILLION, ms=3.5, label="drawn or corrected")
        axes.axhline(0.0, color=PALE, lw=0.7, zorder=0)
        axes.set_xlabel("time (s)" if timed else "picture")
        axes.set_ylabel("theta (°)")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=3, frameon=False, fontsize=7, borderaxespad=0.0)
    return figure


def _column(values: Sequence[float | None]) -> _Floats:
    return np.array([np.nan if value is None else value for value in values], np.float64)


Rows = Sequence[Mapping[str, Any]]


def draw_spreads(by_policy: Mapping[str, Rows]) -> Figure:
    """One dot per trial and policy: path ratio, largest and 95th-percentile force, time, offset; bars are medians."""
    with styled():
        figure = _new_figure((7.2, 2.5))
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
    """The head's track over the phantom, coloured by contact force up to 0.5 N; a ring is the target, a cross the end."""
    graph = make_phantom(row["phantom"]).graph
    with styled():
        figure = _new_figure((3.4, 2.6))
        axes = figure.add_subplot()
        for margin, colour in ((0.5, _WALL), (0.0, _LUMEN)):
            for edge in graph.edges:
                side = normals(edge.points) * (edge.radius + margin)[:, None]
                outline = np.vstack([edge.points + side, (edge.points - side)[::-1]])
                axes.fill(outline[:, 0], outline[:, 1], color=colour, lw=0, zorder=1 if margin else 2)
        for edge in graph.edges:
            axes.plot(edge.points[:, 0], edge.points[:, 1], color=GREY, lw=0.4, ls=(0, (4, 3)), zorder=3)
        _draw_head_track(figure, axes, row)
        axes.set_aspect("equal")
        axes.invert_yaxis()
        axes.set_axis_off()
        axes.set_title(f"{row['policy']}, seed {row['seed']}: {row['outcome']}", fontsize=7.5, loc="left")
    return figure


def _draw_head_track(figure: Figure, axes: Axes, row: Mapping[str, Any]) -> None:
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
