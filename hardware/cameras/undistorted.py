"""A camera whose lens is known: every picture is straightened where it comes in, so that nobody behind it knows of a lens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.calibration import camera as lenses
from core.config.calibration import LensConfig
from core.devices import Camera
from core.types import Frame


class UndistortedCamera:
    """A ``Camera`` over another one. A picture of another aspect, or none at all of the usual kind, is passed on as it is.

    ``lens`` may be changed between two reads; None: nothing is known, and nothing is done.
    """

    def __init__(self, camera: Camera, lens: LensConfig | None) -> None:
        self._camera = camera
        self.lens = lens
        self._prepared: tuple[LensConfig, tuple[int, int], tuple[np.ndarray, np.ndarray] | None] | None = None

    @property
    def name(self) -> str:
        return self._camera.name

    @property
    def is_live(self) -> bool:
        return self._camera.is_live

    def open(self) -> None:
        self._camera.open()

    def read(self, timeout_s: float) -> Frame | None:
        frame = self._camera.read(timeout_s)
        return None if frame is None else self.straightened(frame)

    def close(self) -> None:
        self._camera.close()

    def straightened(self, frame: Frame) -> Frame:
        """The frame as it would be without the lens."""
        image, lens = frame.image, self.lens
        if lens is None or image.ndim != 3 or image.dtype != np.uint8:
            return frame
        maps = self._maps(lens, (image.shape[1], image.shape[0]))
        return frame if maps is None else replace(frame, image=lenses.straightened(image, *maps))

    def _maps(self, lens: LensConfig, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray] | None:
        prepared = self._prepared
        if prepared is None or prepared[0] is not lens or prepared[1] != size:
            fitted = lenses.scaled_to(lens, size)
            prepared = self._prepared = lens, size, None if fitted is None else lenses.maps(fitted)
        return prepared[2]
