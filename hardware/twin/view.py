"""How the twin's camera sees the board: millimetres on the board <-> pixels of the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.types import Points


@dataclass(frozen=True, slots=True, eq=False)
class View:
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

    @property
    def _center(self) -> np.ndarray:
        return np.array([(self.size[0] - 1) / 2, (self.size[1] - 1) / 2])

    def _normalise(self, pixels: np.ndarray) -> tuple[np.ndarray, float]:
        half = float(np.hypot(*self.size) / 2)
        return (pixels - self._center) / half, half
