"""The twin's camera: gives what the world renders, either as it runs or one frame per read in lock-step."""

from __future__ import annotations

from core.devices import DeviceError
from core.types import Frame
from hardware.twin.world import TwinWorld


class TwinCamera:
    """A ``Camera`` over a ``TwinWorld``. In lock-step every read advances the world by one frame period."""

    def __init__(self, world: TwinWorld, *, lock_step: bool = False) -> None:
        self._world = world
        self._lock_step = lock_step

    @property
    def name(self) -> str:
        return f"bench twin: {self._world.phantom.title}"

    @property
    def is_live(self) -> bool:
        """False: what it shows is simulated."""
        return False

    def open(self) -> None:
        if not self._lock_step:
            self._world.start()

    def read(self, timeout_s: float) -> Frame | None:
        if self._lock_step:
            self._world.advance(1.0 / self._world.config.frames_per_second)
            return self._world.frame()
        frame = self._world.frames.take(timeout_s)
        if frame is None and self._world.failure is not None:
            raise DeviceError(self._world.failure)
        return frame

    def close(self) -> None:
        self._world.stop()
