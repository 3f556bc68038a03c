"""Real cameras: read in a thread of their own, newest frame first, and opened again when they were lost.

``LiveCamera`` makes a ``Camera`` of a driver's ``Sensor``; ``CaptureClock`` tells when a picture was taken, from whatever clock the
camera stamps its pictures with; ``CameraFeed`` reads a ``Camera`` for callers that look now and then.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from core.config.calibration import LensConfig
from core.config.models import CameraConfig
from core.devices import Camera, CameraLost, DeviceError, Latest
from core.messages import message
from core.types import Frame, Image
from hardware.cameras.undistorted import UndistortedCamera

_log = logging.getLogger(__name__)

_OPEN_WITHIN_S = 20.0
_FIRST_FRAME_WITHIN_S = 5.0
"""Exposure and laser take a moment to come up."""
_READ_S = 0.1
_LATE_PERIODS = 1.75
"""A frame that comes later than this after the one before has left one out; less is jitter."""
_END_WITHIN_S = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class SensorFrame:
    """A picture as it comes from a sensor; ``captured_s`` is monotonic, ``number`` the camera's own count (None: it has none)."""

    image: Image
    captured_s: float
    number: int | None = None


class Sensor(Protocol):
    """What a driver must do. All but ``name`` is called from one thread."""

    @property
    def name(self) -> str: ...

    def start(self) -> None:
        """Find the camera and start it, quickly or not at all; raises DeviceError with what to do."""

    def read(self, timeout_s: float) -> SensorFrame | None:
        """The newest picture, after at most about `timeout_s`; None when none came. DeviceError: the camera is gone."""

    def stop(self) -> None:
        """Release the camera, whatever state it is in. Never fails."""

    def reset(self) -> float:
        """Reset a camera that was lost while it is still plugged in; returns for how many seconds it must rest then."""


class LiveCamera:
    """A ``Camera`` over a sensor.

    ``read`` raises ``CameraLost`` when no picture came for ``lost_after_s`` (five seconds after the start). Meanwhile the camera is
    reset and opened again and again; once it is back, ``read`` gives frames as before, and their index goes on. A ``DeviceError``
    that is no ``CameraLost`` is for good. The age is watched from outside the driver's thread, which may hang in its library.
    """

    def __init__(self, sensor: Sensor, config: CameraConfig) -> None:
        self._sensor, self._config = sensor, config
        self._reader: _Reader | None = None
        self._hung: _Reader | None = None

    @property
    def name(self) -> str:
        return self._sensor.name

    @property
    def reconnects(self) -> int:
        """How often the camera came back since it was opened."""
        return self._reader.reconnects if self._reader is not None else 0

    def open(self) -> None:
        """Start the camera; raises DeviceError when it is not there or does not start."""
        self.close()
        if self._hung is not None and self._hung.thread.is_alive():
            raise DeviceError("the driver of {camera} does not return: plug the camera out and in again", camera=self.name)
        self._reader = _Reader(self._sensor, self._config)
        self._reader.thread.start()
        problem = None if self._reader.opened.wait(_OPEN_WITHIN_S) else f"{self.name} does not answer: plug it out and in again"
        problem = problem or self._reader.refused
        if problem is not None:
            self.close()
            raise DeviceError(problem)

    def read(self, timeout_s: float) -> Frame | None:
        reader = self._reader
        if reader is None:
            raise DeviceError(f"{self.name} is not open: open it first")
        frame = reader.frames.take(timeout_s)
        if frame is None and reader.died is not None:
            raise DeviceError(reader.died)
        if frame is None and (problem := reader.problem(time.monotonic())) is not None:
            raise CameraLost(problem)
        return frame

    def close(self) -> None:
        reader, self._reader = self._reader, None
        if reader is not None and not reader.end():
            self._hung = reader


class _Reader:
    """The thread that reads a sensor from ``open`` to ``close``; one that hangs is left behind."""

    def __init__(self, sensor: Sensor, config: CameraConfig) -> None:
        self._sensor, self._config = sensor, config
        self._stop = threading.Event()
        self.thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self._lost_after_s = max(config.lost_after_s, 3.0 / config.frames_per_second)
        self._index, self._lost = -1, 0
        self._before: tuple[int | None, float] | None = None
        self._problem: str | None = None
        self._silent_after_s = float("inf")
        self.frames: Latest[Frame] = Latest()
        self.opened = threading.Event()
        self.refused: str | None = None
        self.died: str | None = None
        self.reconnects = 0

    def end(self) -> bool:
        """False when the driver does not return."""
        self._stop.set()
        self.thread.join(_END_WITHIN_S)
        if self.thread.is_alive():
            _log.warning("the driver of %s does not return; going on without it", self._sensor.name)
        return not self.thread.is_alive()

    def problem(self, now_s: float) -> str | None:
        """Why there are no frames, as seen from outside the thread; None while all is well."""
        return self._problem or (self._silence() if now_s > self._silent_after_s else None)

    def _silence(self) -> str:
        return f"{self._sensor.name} gives no picture: check its cable; it is opened again by itself"

    def _run(self) -> None:
        try:
            self._serve()
        except Exception as error:  # noqa: BLE001 - the top of this thread
            _log.exception("the thread of camera %s ended", self._sensor.name)
            self.died = f"{self._sensor.name} is no longer read ({type(error).__name__}: {error}): start the rig again (F5)"
            if not self.opened.is_set():
                self.refused = self.died
        finally:
            self.opened.set()

    def _serve(self) -> None:
        while not self._stop.is_set():
            pause_s = self._config.reconnect_s
            try:
                self._sensor.start()
            except DeviceError as error:
                if not self.opened.is_set():
                    self.refused = str(error)
                    return
                self._problem = str(error)
            else:
                self.opened.set()
                try:
                    self._read_until_lost()
                except DeviceError as error:
                    self._problem = str(error)
                finally:
                    self._sensor.stop()
                if not self._stop.is_set():
                    _log.warning("%s", self._problem)
                    pause_s = max(pause_s, self._sensor.reset())
            self._stop.wait(pause_s)

    def _read_until_lost(self) -> None:
        self._before = None
        self._silent_after_s = time.monotonic() + _FIRST_FRAME_WITHIN_S
        while not self._stop.is_set():
            found = self._sensor.read(_READ_S)
            if self._stop.is_set():
                return
            now_s = time.monotonic()
            if found is not None and self._publish(found):
                self._silent_after_s = now_s + self._lost_after_s
            elif now_s > self._silent_after_s:
                raise DeviceError(self._silence())

    def _publish(self, found: SensorFrame) -> bool:
        """Count and hand over a picture; False for one that was there already: a camera that repeats itself gives nothing new."""
        before, self._before = self._before, (found.number, found.captured_s)
        if before is not None:
            if before == self._before:
                return False
            # Lost frames by the camera's count, which may also go back, or by its rate: in dim light it may slow down and count on.
            number, captured_s = before
            by_count = found.number - number - 1 if found.number is not None and number is not None else 0
            periods = (found.captured_s - captured_s) * self._config.frames_per_second
            by_rate = round(periods) - 1 if periods > _LATE_PERIODS else 0
            self._lost += max(0, by_count, by_rate)
        if self._problem is not None:
            self._problem = None
            self.reconnects += 1
            _log.warning("%s is back", self._sensor.name)
        self._index += 1
        self.frames.put(Frame(self._index, found.captured_s, found.image, self._lost))
        return True


_BELIEVABLE_S = 0.5
"""A picture that claims to be older than this, or from the future, has a stamp of another clock."""
_STALLED_S = 10.0
"""But of a clock that has proved to be ours, a picture may have waited so long, while the computer was busy."""
_REMEMBERED = 300
"""Pictures whose delay is compared."""


class CaptureClock:
    """Maps stamps to monotonic seconds; never later than the arrival, never before the picture before.

    A stamp on a clock that this computer has too (wall or monotonic) tells the age of the picture itself. Of the camera's own
    clock only the rate is known: the quickest of the last pictures is taken to have arrived at once, and the others to have waited
    so much longer. Then an age is too short by the quickest way through cable and driver, but delays on top of it show.
    """

    def __init__(self) -> None:
        self._offsets: deque[float] = deque(maxlen=_REMEMBERED)
        self._stamp_s: float | None = None
        self._is_ours = False
        self._newest_s = float("-inf")

    def captured_s(self, arrived_s: float, stamp_s: float | None, now_on_its_clock_s: float | None = None) -> float:
        """The monotonic time of capture of a picture that came at `arrived_s`.

        The camera's stamp is in seconds of any clock, which showed `now_on_its_clock_s` at the arrival; None: not known.
        """
        captured_s = arrived_s
        age_s = now_on_its_clock_s - stamp_s if stamp_s is not None and now_on_its_clock_s is not None else -1.0
        if 0.0 <= age_s <= (_STALLED_S if self._is_ours else _BELIEVABLE_S):
            self._is_ours = True
            captured_s = arrived_s - age_s
        elif stamp_s is not None:
            if self._stamp_s is not None and not 0.0 <= stamp_s - self._stamp_s <= 10.0:
                self._offsets.clear()  # the camera was started again, or its clock was set
            self._stamp_s = stamp_s
            self._offsets.append(arrived_s - stamp_s)
            captured_s = stamp_s + min(self._offsets)
        self._newest_s = max(self._newest_s, min(captured_s, arrived_s))
        return self._newest_s


_KEPT = 30
_WAIT_S = 0.02


class CameraFeed:
    """Owns an open camera. ``newest`` and ``problem`` may be asked from any thread; ``on_frame`` is called in the feed's own.

    `clock` is that of its frames.
    """

    def __init__(self, camera: Camera, lens: LensConfig | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._camera, self._clock = UndistortedCamera(camera, lens), clock
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
        """From the next picture on; those from before are dropped."""
        self._camera.lens = lens
        with self._lock:
            self._frames.clear()

    @property
    def newest(self) -> Frame | None:
        with self._lock:
            return self._frames[-1] if self._frames else None

    def next_frames(self, count: int, timeout_s: float, alive: Callable[[], object] = lambda: None) -> list[Frame]:
        """The next `count` pictures that are captured from now on; `alive` is called meanwhile, and what it raises ends the wait.

        Raises DeviceError: they do not come in time, or the camera is lost.
        """
        since_s, begun_s = self._clock(), time.monotonic()
        while True:
            alive()
            with self._lock:
                found = [frame for frame in self._frames if frame.captured_s > since_s]
            if len(found) >= count:
                return found[:count]
            # a simulated bench may be slow: its time counts, unless it has failed
            if self._clock() - since_s > timeout_s or (self.problem is not None and time.monotonic() - begun_s > timeout_s):
                raise DeviceError(self.problem or message("{camera} gives no pictures: check its cable", camera=self.name))
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
            except CameraLost as error:  # it reconnects by itself
                self.problem = str(error)
                self._stop.wait(_READ_S)
                continue
            except DeviceError as error:
                self.problem = str(error)
                return
            except Exception as error:  # noqa: BLE001 - top of the thread
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
