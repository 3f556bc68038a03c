"""The twin's camera view (board millimetres <-> pixels), and the distance of every pixel to the wall of the lumen in mm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.types import Mask, Points, VesselGraph


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """A pinhole view of the plane with one radial distortion term.

    ``homography`` (3, 3) maps board mm (x right, y down) to undistorted pixels; ``distortion`` k1 acts on radii relative to half
    the image diagonal (negative: barrel; sensible range -0.2..0.3). ``size`` is (width, height) in pixels.
    """

    homography: np.ndarray
    size: tuple[int, int]
    distortion: float = 0.0

    def project(self, points_mm: Points) -> Points:
        """Board millimetres (N, 2) -> pixels (N, 2)."""
        points = np.asarray(points_mm, np.float64)
        mapped = np.column_stack([points, np.ones(len(points))]) @ self.homography.T
        plane = np.asarray(mapped[:, :2] / mapped[:, 2:])
        if not self.distortion:
            return plane
        offset, half = self._normalise(plane)
        radius2 = np.sum(offset**2, axis=1, keepdims=True)
        return np.asarray(self._center + half * offset * (1 + self.distortion * radius2))

    def unproject(self, points_px: Points) -> Points:
        """Pixels (N, 2) -> board millimetres (N, 2); the distortion is inverted by Newton steps on the radius (error < 1e-9 px)."""
        plane = np.asarray(points_px, np.float64)
        if self.distortion:
            offset, half = self._normalise(plane)
            seen = np.sqrt(offset[:, 0] ** 2 + offset[:, 1] ** 2)
            radius = seen.copy()
            for _ in range(5):
                square = self.distortion * radius * radius
                radius -= (radius * (1 + square) - seen) / (1 + 3 * square)
            plane = self._center + (half * offset) / (1 + self.distortion * radius * radius)[:, None]
        inverse = np.linalg.inv(self.homography)
        depth = plane @ inverse[2, :2] + inverse[2, 2]
        return np.asarray((plane @ inverse[:2, :2].T + inverse[:2, 2]) / depth[:, None])

    def pixels_per_mm(self, point_mm: tuple[float, float]) -> float:
        """Local scale at a point of the board (mean of both directions)."""
        return float(self.scales(np.array([point_mm]))[0])

    def scales(self, points_mm: Points) -> np.ndarray:
        """Local scale in px per mm at each of `points_mm` (N, 2), the mean of both directions; shape (N,)."""
        points, step = np.asarray(points_mm, np.float64), 0.1
        here = self.project(points)
        right, down = self.project(points + (step, 0.0)), self.project(points + (0.0, step))
        return np.asarray((np.linalg.norm(right - here, axis=1) + np.linalg.norm(down - here, axis=1)) / (2 * step))

    def grid_mm(self) -> np.ndarray:
        """Board millimetres under every pixel centre, shape (H, W, 2)."""
        width, height = self.size
        x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        return np.asarray(self.unproject(np.column_stack([x.ravel(), y.ravel()])).reshape(height, width, 2))

    def fitted(self, size: tuple[int, int]) -> CameraView:
        """The same view as a picture of another `size` (width, height), as large as fits in its middle."""
        zoom = min(size[0] / self.size[0], size[1] / self.size[1])
        place = np.diag([zoom, zoom, 1.0])
        place[:2, 2] = [(new - 1 - zoom * (old - 1)) / 2 for new, old in zip(size, self.size, strict=True)]
        return CameraView(place @ self.homography, size, self.distortion)

    @property
    def _center(self) -> np.ndarray:
        return np.array([(self.size[0] - 1) / 2, (self.size[1] - 1) / 2])

    def _normalise(self, pixels: np.ndarray) -> tuple[np.ndarray, float]:
        half = float(np.hypot(*self.size) / 2)
        return (pixels - self._center) / half, half


F32 = NDArray[np.float32]

_LABEL_SPACING_MM = 0.4
_LOOK_SPACING_MM = 1.0
_SCALLOP_MM = 0.08


@dataclass(frozen=True, slots=True, eq=False)
class LumenField:
    """Per pixel of a view, arrays of shape (H, W).

    ``distance_mm`` is the signed distance to the lumen's wall: the least of |p - c| - r over the discs along the centerlines
    (negative inside; its sign is exact, its value good to 0.05 mm up to ``reach_mm`` outside, where it is cut). ``ratio`` is the
    least |p - c| / r (0 on the centerline, 1 at the wall) and ``outer_ratio`` the same for the tube's outside, r + wall.
    """

    distance_mm: F32
    ratio: F32
    outer_ratio: F32
    reach_mm: float

    @property
    def inside(self) -> Mask:
        """The vessel label: pixels whose centre lies in the union of discs."""
        return np.asarray(self.distance_mm < 0)


def lumen_discs(graph: VesselGraph, spacing_mm: float = _LABEL_SPACING_MM) -> tuple[Points, NDArray[np.float64]]:
    """Centres (N, 2) and radii (N,) of the discs whose union is the lumen.

    Samples much denser than `spacing_mm` are thinned; gaps much wider are filled by linear interpolation.
    """
    centers, radii = [graph.nodes[:0]], [np.zeros(0)]
    for edge in graph.edges:
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(edge.points, axis=0), axis=1))])
        keep = np.concatenate([[True], np.diff(along) > 0])
        wanted = np.linspace(0.0, along[-1], max(2, int(np.ceil(along[-1] / spacing_mm)) + 1))
        gap = along[-1] / max(len(along) - 1, 1)
        if gap > 1.3 * spacing_mm:  # sparse samples are corners of the centerline, which must stay
            wanted = np.union1d(wanted, along)
        elif gap >= 0.5 * spacing_mm:
            wanted = along
        else:  # a subset of the phantom's samples, so that the thinned discs never cover more than all
            wanted = along[np.unique(np.searchsorted(along, wanted).clip(max=len(along) - 1))]
        centers.append(np.column_stack([np.interp(wanted, along[keep], edge.points[keep, axis]) for axis in (0, 1)]))
        radii.append(np.interp(wanted, along[keep], edge.radius[keep]))
    return np.vstack(centers), np.concatenate(radii)


def measure_lumen(graph: VesselGraph, view: CameraView, grid_mm: F32, wall_mm: float, reach_mm: float) -> LumenField:
    """The field of `graph` seen through `view`; `grid_mm` (H, W, 2) holds the board position of every pixel centre.

    A disc changes a small window, which costs about 60 us. So discs 1 mm apart come first; they leave scallops of at most 0.05 mm
    along the wall, whose few pixels are then compared with all discs.
    """
    height, width = grid_mm.shape[:2]
    distance = np.full((height, width), reach_mm, np.float32)
    ratio = np.full((height, width), 9.0, np.float32)
    outer = np.full((height, width), 9.0, np.float32)
    grid_x, grid_y = np.ascontiguousarray(grid_mm[..., 0]), np.ascontiguousarray(grid_mm[..., 1])
    centers, radii = lumen_discs(graph, _LOOK_SPACING_MM)
    pixels, scales = view.project(centers), view.scales(centers)
    half = 1.12 * (radii + reach_mm) * scales + 2
    low = np.maximum(np.floor(pixels - half[:, None]), 0).astype(int)
    high = np.minimum(np.ceil(pixels + half[:, None]) + 1, (width, height)).astype(int)
    for index in np.flatnonzero(np.all(high > low, axis=1)):
        window = slice(low[index, 1], high[index, 1]), slice(low[index, 0], high[index, 0])
        radius = np.float32(radii[index])
        dx, dy = grid_x[window] - np.float32(centers[index, 0]), grid_y[window] - np.float32(centers[index, 1])
        dx *= dx
        dy *= dy
        dx += dy
        away = np.sqrt(dx, out=dx)
        np.minimum(distance[window], away - radius, out=distance[window])
        np.minimum(ratio[window], away / radius, out=ratio[window])
        away /= radius + np.float32(wall_mm)
        np.minimum(outer[window], away, out=outer[window])
    _refine_wall(distance, grid_mm, graph)
    return LumenField(distance, ratio, outer, reach_mm)


def _refine_wall(distance: F32, grid_mm: F32, graph: VesselGraph) -> None:
    """Exact distances, by all discs, for pixels just outside the coarse wall."""
    rows, columns = np.nonzero((distance >= 0) & (distance < _SCALLOP_MM))
    centers, radii = lumen_discs(graph)
    for some in np.array_split(np.arange(len(rows)), len(rows) // 500 + 1):
        place = rows[some], columns[some]
        points = grid_mm[place].astype(np.float64)
        away = np.hypot(points[:, :1] - centers[None, :, 0], points[:, 1:] - centers[None, :, 1])
        distance[place] = (away - radii).min(axis=1, initial=np.inf)
