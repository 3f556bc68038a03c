"""Parts of a picture that are shown to a network instead of all of it."""

from __future__ import annotations

from core.types import Point, Window

MARGIN_PX = 16
"""At a window's inner edges a network lacks context: so much of what it says there counts less, or not at all."""


def window_around(place: Point, size: tuple[int, int], side: int) -> Window:
    """The window (x, y, width, height) of at most `side` px with `place` in its middle, or as near to it as the picture allows."""
    width, height = min(side, size[0]), min(side, size[1])
    x = min(max(round(place[0]) - width // 2, 0), size[0] - width)
    y = min(max(round(place[1]) - height // 2, 0), size[1] - height)
    return x, y, width, height


def inner_area(window: Window, size: tuple[int, int]) -> tuple[slice, slice]:
    """Rows and columns of a picture of `size` (width, height) that a look at a window renews: not the margin at inner edges."""
    x, y, width, height = window
    left, top = (MARGIN_PX if x > 0 else 0), (MARGIN_PX if y > 0 else 0)
    right = width - (MARGIN_PX if x + width < size[0] else 0)
    bottom = height - (MARGIN_PX if y + height < size[1] else 0)
    return slice(y + top, y + bottom), slice(x + left, x + right)
