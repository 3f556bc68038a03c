"""A vessel of which the picture's border cuts off one side: where its middle is, as far as the other side tells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.perception.bundle import Bundle
from core.types import Points

WIDTH_RADII = 4.0
"""A width that was seen so many radii away is believed by a third (1/e): a vessel that the picture cuts lengthwise may taper."""
ALONG = 0.87
"""Cosine of the angle to the border up to which a vessel is cut lengthwise. One that runs out of the picture lacks a wall for a
short way only: its end is led anew (``vessel_ends``), and until there the map tells more than a skeleton that turns aside."""
END_RADII = 1.5
"""So near to its ends a line runs into a corner, or through a junction's opening, where no width is the vessel's."""
MAP_PX = 2.0
MAP_SHARE = 0.03
"""The map of distances is not farther off than this and a share of the radius: steps from pixel to pixel are no straight way."""


def by_wall_in_view(
    lines: Bundle, step_px: float, normal: Points, reach: NDArray[np.float64], shift: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float64]:
    """`shift` (N,) by the map of distances, but where the image's border cuts off one side of the vessel by what is seen of it.

    Beyond the border the map goes on as if there were no wall, and would draw the line out of the picture. Where the border is
    nearer than the wall, `reach` (N,), the middle is as far from the wall that is seen as it is where both are; where that is
    nowhere to be seen on a line, the middle of what is in the picture is all that is known.

    Parameters
    ----------
    lines, step_px : places in the lumen, and how far they are from each other along a line.
    normal : unit vectors (N, 2) across the lines.
    reach : distance to the nearest wall (N,).
    shift : by how much each point lies beside the middle of the map (N,), along the normals.
    shape : of the picture, (h, w).
    """
    nearest, limit = _to_nearest_border(lines.points, shape), (1.0 + MAP_SHARE) * reach + MAP_PX
    near = np.flatnonzero(nearest < limit)  # mostly the ends of some vessels, or nothing at all
    if not len(near):
        return shift
    ahead, behind = (_to_border(lines.points[near], sign * normal[near], shape) for sign in (1.0, -1.0))
    across = np.minimum(ahead, behind)
    found = (across < limit[near]) & (nearest[near] >= ALONG * across)
    if not found.any():
        return shift
    cut = near[found]
    is_cut = np.zeros(len(lines.points), np.bool_)
    is_cut[cut] = True
    is_plain = ~is_cut & (step_px * _to_ends(lines) > END_RADII * reach)
    half = lines.split(np.where(is_plain, reach + np.abs(shift), np.nan))
    known, away = np.concatenate([_from_the_nearest(values) for values in half], axis=1)
    belief = np.exp(-step_px * away[cut] / (WIDTH_RADII * reach[cut]))
    towards = np.clip(belief * (known[cut] - reach[cut]), -reach[cut], across[found])
    moved = shift.copy()
    moved[cut] = np.where(ahead[found] < behind[found], towards, -towards)
    return moved


def _to_border(points: Points, direction: Points, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """How far it is from places in the picture (N, 2) along unit vectors (N, 2) to its border: to the last pixels' centres."""
    limit = np.array([shape[1] - 1.0, shape[0] - 1.0])
    room = np.where(direction > 0.0, limit - points, points)
    return np.asarray(np.maximum((room / np.maximum(np.abs(direction), 1e-9)).min(axis=1), 0.0))


def _to_nearest_border(points: Points, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """How far it is from places in the picture (N, 2) to its nearest side, to the last pixels' centres."""
    return np.asarray(np.minimum(points, (shape[1] - 1.0, shape[0] - 1.0) - points).min(axis=1))


def _to_ends(lines: Bundle) -> NDArray[np.int64]:
    """How many points each point (N,) is away from the nearer end of its line."""
    counts = np.diff(lines.starts)
    place = np.arange(len(lines.points)) - np.repeat(lines.starts[:-1], counts)
    return np.asarray(np.minimum(place, np.repeat(counts, counts) - 1 - place), np.int64)


def _from_the_nearest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values (N,) of a line, NaN where they are not known, filled up from the places around, and how many points away that is.

    Shape (2, N). Of a line where nothing is known the values are 0, infinitely far away.
    """
    places, known = np.arange(len(values)), np.flatnonzero(np.isfinite(values))
    if not len(known):
        return np.stack([np.zeros(len(values)), np.full(len(values), np.inf)])
    following = np.searchsorted(known, places)
    before, after = known[np.maximum(following - 1, 0)], known[np.minimum(following, len(known) - 1)]
    return np.stack([np.interp(places, known, values[known]), np.minimum(np.abs(places - before), np.abs(places - after))])
