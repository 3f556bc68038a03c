"""How all figures for paper look: colours, type, lines; the same figure always gives the same file."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

import matplotlib as mpl
from matplotlib import font_manager

from core.config import RESOURCES

INK, GREY, PALE, BLUE = "#1A1D21", "#6B727C", "#E4E7EB", "#0B5C94"
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
