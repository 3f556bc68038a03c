"""The loop: newest frame -> perceive -> advise -> tick. One thread turns it; the operator's commands may come from another."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Protocol

from core.devices import Camera, Robot
from core.types import Advice, Command, Frame, Point, Scene, Tick


class Perceive(Protocol):
    """Turns a frame into a scene; ``target`` is the operator's destination in source pixels."""

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene: ...


class Engine:
    """Owns an open camera and robot and turns them once per ``step``.

    Parameters
    ----------
    camera, robot : open devices; ``close`` closes them through `on_close`.
    perceive : the perception pipeline.
    policy : scene -> advice, None when there is none.
    on_close : closes the rig.
    """

    def __init__(
        self,
        camera: Camera,
        robot: Robot | None,
        perceive: Perceive,
        policy: Callable[[Scene], Advice | None],
        on_close: Callable[[], None],
    ) -> None:
        self._camera = camera
        self._robot = robot
        self._perceive = perceive
        self._policy = policy
        self._on_close = on_close
        self._lock = threading.Lock()
        self._target: Point | None = None
        self._sent: Command | None = None
        self._last_index: int | None = None
        self._dropped = 0
        self._times: deque[float] = deque(maxlen=30)

    def step(self, timeout_s: float) -> Tick | None:
        """One turn; None when no new frame came in time. Raises DeviceError when a device is lost."""
        frame = self._camera.read(timeout_s)
        if frame is None:
            return None
        self._count(frame)
        with self._lock:
            target, sent = self._target, self._sent
        scene = self._perceive(frame, target)
        status = self._robot.status() if self._robot is not None else None
        return Tick(frame, scene, self._policy(scene), sent, status, self._dropped, self._rate())

    def jog(self, command: Command) -> None:
        """Send the operator's command at once (from any thread); what was really sent appears in the next ticks."""
        if self._robot is not None:
            sent = self._robot.send(command)
            with self._lock:
                self._sent = sent

    def set_target(self, point: Point | None) -> None:
        """The operator's destination in source pixels; None clears it."""
        with self._lock:
            self._target = point

    def close(self) -> None:
        """Hold the robot and close the rig."""
        try:
            if self._robot is not None:
                self._robot.hold()
        finally:
            self._on_close()

    def _count(self, frame: Frame) -> None:
        if self._last_index is not None:
            self._dropped += max(0, frame.index - self._last_index - 1)
        self._last_index = frame.index
        self._times.append(frame.captured_s)

    def _rate(self) -> float:
        if len(self._times) < 2 or self._times[-1] <= self._times[0]:
            return 0.0
        return (len(self._times) - 1) / (self._times[-1] - self._times[0])
