"""A camera whose lens is known: every frame is undistorted where it comes in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.calibration import camera as lenses
from core.config.calibration import LensConfig
from core.devices import Camera
from core.types import Frame


class UndistortedCamera:
    """A ``Camera`` over another one. A picture of another aspect or type is passed on as it is.

    ``lens`` may be changed between two reads; None: frames are passed on.
    """

    def __init__(self, camera: Camera, lens: LensConfig | None) -> None:
        self._camera = camera
        self.lens = lens
        self._prepared: tuple[LensConfig, tuple[int, int], tuple[np.ndarray, np.ndarray] | None] | None = None

    @property
    def name(self) -> str:
        return self._camera.name

    def open(self) -> None:
        self._camera.open()

    def read(self, timeout_s: float) -> Frame | None:
        frame = self._camera.read(timeout_s)
        if frame is None or self.lens is None or frame.image.ndim != 3 or frame.image.dtype != np.uint8:
            return frame
        maps = self._maps(self.lens, (frame.image.shape[1], frame.image.shape[0]))
        return frame if maps is None else replace(frame, image=lenses.undistorted(frame.image, *maps))

    def close(self) -> None:
        self._camera.close()

    def _maps(self, lens: LensConfig, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray] | None:
        prepared = self._prepared
        if prepared is None or prepared[0] is not lens or prepared[1] != size:
            fitted = lenses.scaled_to(lens, size)
            prepared = self._prepared = lens, size, None if fitted is None else lenses.maps(fitted)
        return prepared[2]
