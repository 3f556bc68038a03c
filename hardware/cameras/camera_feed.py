"""A camera read in a thread of its own, for those who look at it now and then: the newest picture, or the next few."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable

from core.calibration_config import LensConfig
from core.devices import Camera, CameraLost, DeviceError
from core.types import Frame
from hardware.cameras.straightened import StraightenedCamera

_log = logging.getLogger(__name__)
_READ_S = 0.1
_KEPT = 30
_WAIT_S = 0.02


class CameraFeed:
    """Owns an open camera. ``newest`` and ``problem`` may be asked from any thread; ``on_frame`` is called in the feed's own."""

    def __init__(self, camera: Camera, lens: LensConfig | None = None) -> None:
        self._camera = StraightenedCamera(camera, lens)
        self._frames: deque[Frame] = deque(maxlen=_KEPT)
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self.problem: str | None = None
        self.on_frame: Callable[[Frame], None] | None = None
        self._thread = threading.Thread(target=self._run, name="camera feed", daemon=True)
        self._thread.start()

    @property
    def name(self) -> str:
        return self._camera.name

    @property
    def lens(self) -> LensConfig | None:
        return self._camera.lens

    @lens.setter
    def lens(self, lens: LensConfig | None) -> None:
        """From the next picture on; those from before are forgotten."""
        self._camera.lens = lens
        with self._lock:
            self._frames.clear()

    @property
    def newest(self) -> Frame | None:
        with self._lock:
            return self._frames[-1] if self._frames else None

    def take(self, count: int, timeout_s: float, alive: Callable[[], object] = lambda: None) -> list[Frame]:
        """The next `count` pictures that are captured from now on.

        Parameters
        ----------
        alive : called again and again while waiting; what it raises ends the wait.

        Raises
        ------
        DeviceError
            They do not come in time, or the camera is lost.
        """
        since_s = time.monotonic()
        while True:
            alive()
            with self._lock:
                found = [frame for frame in self._frames if frame.captured_s > since_s]
            if len(found) >= count:
                return found[:count]
            if time.monotonic() - since_s > timeout_s:
                raise DeviceError(self.problem or f"{self.name} gives no pictures: check its cable")
            time.sleep(_WAIT_S)

    def close(self) -> None:
        """End the thread and close the camera; may be called twice."""
        self._stop.set()
        self._thread.join()
        self._camera.close()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                frame = self._camera.read(_READ_S)
            except CameraLost as error:  # it looks for itself
                self.problem = str(error)
                self._stop.wait(_READ_S)
                continue
            except DeviceError as error:
                self.problem = str(error)
                return
            except Exception as error:  # noqa: BLE001 - top of the thread: who looks is told
                _log.exception("the camera feed ended")
                self.problem = f"{self.name} is no longer read ({type(error).__name__}: {error})"
                return
            if frame is None:
                continue
            self.problem = None
            with self._lock:
                self._frames.append(frame)
            if (on_frame := self.on_frame) is not None:
                on_frame(frame)
