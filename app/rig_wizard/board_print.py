"""The calibration board for the printer, at true size: PDF (lines, not pixels) or PNG, on A4 or A3, with a line to check it by."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

from core.calibration.camera import BoardSpec, board_bitmap
from core.devices import UserError, disk_errors
from core.files import write_atomic

_PAPERS = {"A4": (297.0, 210.0), "A3": (420.0, 297.0)}
_MARGIN_MM, _FOOT_MM = 8.0, 16.0
_MM_PER_INCH = 25.4
_PNG_DPI = 600
_MODULES = 8
"""Modules of a square's side that ``board_bitmap`` draws: a marker of six in a square of eight."""
_CHECK_MM = 100.0


class BoardPrintError(UserError):
    """The board cannot be printed like this."""


def paper_for(spec: BoardSpec) -> str:
    """The smallest paper that the board fits on. Raises BoardPrintError."""
    width, height = spec.size_mm
    for name, (across, down) in _PAPERS.items():
        if width + 2 * _MARGIN_MM <= across and height + _MARGIN_MM + _FOOT_MM <= down:
            return name
    raise BoardPrintError(f"a board of {width:g} x {height:g} mm fits on no paper up to A3: fewer or smaller squares")


def print_board(path: Path, spec: BoardSpec) -> str:
    """Write the board to a .pdf or .png; returns the paper's name.

    Raises
    ------
    BoardPrintError
        Another ending, a board that fits on no paper, or a disk that does not take it.
    BoardError
        More squares than there are markers.
    """
    if path.suffix.lower() not in {".pdf", ".png"}:
        raise BoardPrintError(f"{path}: a board is written as .pdf or .png")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    paper = paper_for(spec)
    width, height = _PAPERS[paper]
    figure = Figure(figsize=(width / _MM_PER_INCH, height / _MM_PER_INCH))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, width)
    axes.set_ylim(height, 0.0)
    axes.axis("off")
    left, top = (width - spec.size_mm[0]) / 2, _MARGIN_MM
    axes.add_collection(PolyCollection(_black(spec, left, top), facecolors="black", edgecolors="none", antialiased=False))
    below = top + spec.size_mm[1] + 6.0
    axes.plot([left, left + _CHECK_MM], [below, below], color="black", linewidth=0.8)
    for x in (left, left + _CHECK_MM):
        axes.plot([x, x], [below - 1.5, below + 1.5], color="black", linewidth=0.8)
    text = (
        f"This line is {_CHECK_MM:g} mm long; if it is not, print again at 100 % (no fitting to the page). "
        f"LumenPilot board, {spec.columns} x {spec.rows} squares of {spec.square_mm:g} mm. Lay it flat at the height of the robot."
    )
    axes.text(left, below + 3.0, text, fontsize=7, va="top")
    printed = BytesIO()  # on a full disk, the PDF writer ends in an error of its compressor, and leaves an empty file
    kind = path.suffix.lower().removeprefix(".")
    figure.savefig(printed, format=kind, dpi=_PNG_DPI, metadata={"Title": "LumenPilot calibration board"})
    with disk_errors(BoardPrintError, path, "cannot be written"):
        write_atomic(path, printed.getvalue())
    return paper


def _black(spec: BoardSpec, left: float, top: float) -> list[list[tuple[float, float]]]:
    """Black runs of modules, as rectangles in mm."""
    bitmap = board_bitmap(spec, _MODULES)
    side = spec.square_mm / _MODULES
    found = []
    for row, line in enumerate(bitmap):
        start = None
        for column in range(len(line) + 1):
            is_black = column < len(line) and line[column] == 0
            if is_black and start is None:
                start = column
            elif not is_black and start is not None:
                x0, x1 = left + start * side, left + column * side
                y0, y1 = top + row * side, top + (row + 1) * side
                found.append([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
                start = None
    return found
