"""The calibration board for the printer, at true size: PDF (lines, not pixels) or PNG, on A4 or A3, with a line to check it by."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from core.calibration.camera import BoardSpec, board_bitmap
from core.devices import UserError, disk_errors
from core.files import write_atomic

_PAPERS = {"A4": (297.0, 210.0), "A3": (420.0, 297.0)}
_MARGIN_MM, _FOOT_MM = 8.0, 16.0
_MM_PER_INCH = 25.4
_POINTS_PER_MM = 72 / _MM_PER_INCH
_STROKE_MM, _TEXT_MM = 0.3, 2.5
_PNG_DPI = 600
_MODULES = 8
"""Modules of a square's side that ``board_bitmap`` draws: a marker of six in a square of eight."""
_CHECK_MM = 100.0

Rectangle = tuple[float, float, float, float]
"""Left, top, right and bottom, mm."""


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
    paper = paper_for(spec)
    width, height = _PAPERS[paper]
    left, top = (width - spec.size_mm[0]) / 2, _MARGIN_MM
    below = top + spec.size_mm[1] + 6.0
    black = _black(spec, left, top)
    black.append((left, below, left + _CHECK_MM, below + _STROKE_MM))
    black += [(x, below - 1.5, x + _STROKE_MM, below + 1.5) for x in (left, left + _CHECK_MM - _STROKE_MM)]
    text = (
        f"This line is {_CHECK_MM:g} mm long; if it is not, print again at 100 % (no fitting to the page). "
        f"LumenPilot board, {spec.columns} x {spec.rows} squares of {spec.square_mm:g} mm. Lay it flat at the height of the robot."
    )
    draw = _pdf if path.suffix.lower() == ".pdf" else _png
    printed = draw((width, height), black, text, (left, below + 5.5))
    with disk_errors(BoardPrintError, path, "cannot be written"):
        write_atomic(path, printed)
    return paper


def _pdf(size_mm: tuple[float, float], black: Sequence[Rectangle], text: str, at_mm: tuple[float, float]) -> bytes:
    """One page of black rectangles and a line of Helvetica; PDF counts points from the lower left corner."""
    width, height = (side * _POINTS_PER_MM for side in size_mm)
    drawn = [f"{_POINTS_PER_MM:.6f} 0 0 {-_POINTS_PER_MM:.6f} 0 {height:.4f} cm"]
    drawn += [f"{x0:.4f} {y0:.4f} {x1 - x0:.4f} {y1 - y0:.4f} re f" for x0, y0, x1, y1 in black]
    words = text.replace("(", "\\(").replace(")", "\\)")
    drawn.append(f"BT /F {_TEXT_MM:g} Tf 1 0 0 -1 {at_mm[0]:.4f} {at_mm[1]:.4f} Tm ({words}) Tj ET")
    page = zlib.compress("\n".join(drawn).encode("ascii"))
    parts = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] /Contents 5 0 R "
        "/Resources << /Font << /F 4 0 R >> >> >>".encode(),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
        f"<< /Length {len(page)} /Filter /FlateDecode >>\nstream\n".encode() + page + b"\nendstream",
    ]
    file, places = b"%PDF-1.4\n", []
    for number, part in enumerate(parts, 1):
        places.append(f"{len(file):010d} 00000 n \n")
        file += f"{number} 0 obj\n".encode() + part + b"\nendobj\n"
    table = f"xref\n0 {len(parts) + 1}\n0000000000 65535 f \n{''.join(places)}"
    return file + f"{table}trailer\n<< /Size {len(parts) + 1} /Root 1 0 R >>\nstartxref\n{len(file)}\n%%EOF\n".encode()


def _png(size_mm: tuple[float, float], black: Sequence[Rectangle], text: str, at_mm: tuple[float, float]) -> bytes:
    """The same as pixels, with their number per metre behind the file's header."""
    scale = _PNG_DPI / _MM_PER_INCH
    image = np.full((round(size_mm[1] * scale), round(size_mm[0] * scale)), 255, np.uint8)
    for rectangle in black:
        x0, y0, x1, y1 = (round(value * scale) for value in rectangle)
        image[y0:y1, x0:x1] = 0
    at = round(at_mm[0] * scale), round(at_mm[1] * scale)
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, _TEXT_MM * scale / 30.0, 0, 3, cv2.LINE_AA)
    file = cv2.imencode(".png", image)[1].tobytes()
    chunk = b"pHYs" + 2 * round(1000 * scale).to_bytes(4, "big") + b"\x01"
    return file[:33] + (9).to_bytes(4, "big") + chunk + zlib.crc32(chunk).to_bytes(4, "big") + file[33:]


def _black(spec: BoardSpec, left: float, top: float) -> list[Rectangle]:
    """Black runs of modules."""
    bitmap = board_bitmap(spec, _MODULES)
    side = spec.square_mm / _MODULES
    found: list[Rectangle] = []
    for row, line in enumerate(bitmap):
        start = None
        for column in range(len(line) + 1):
            is_black = column < len(line) and line[column] == 0
            if is_black and start is None:
                start = column
            elif not is_black and start is not None:
                x0, x1 = left + start * side, left + column * side
                y0, y1 = top + row * side, top + (row + 1) * side
                found.append((x0, y0, x1, y1))
                start = None
    return found
