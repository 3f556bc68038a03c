"""The engine: newest frame -> perceive -> advise, in one thread; the pilot beside it drives."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

from core.control.faults import Cause, Fault
from core.control.frame_reports import is_picture
from core.control.pilot import Pilot, PilotLoop
from core.control.robot import GuardedRobot
from core.devices import Camera, CameraLost, DeviceError, EndOfStream
from core.messages import message
from core.types import Advice, Frame, Point, Reason, Refusal, RobotStatus, Scene, Tick


class Perceive(Protocol):
    """Turns a frame into a scene; ``target`` is the place in source pixels that the operator clicked."""

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene: ...


class Engine:
    """Owns an open camera and runs perception once per ``step``.

    Parameters
    ----------
    camera : open; closed through `on_close`.
    perceive : the perception pipeline.
    policy : scene -> advice, for rigs without a pilot.
    on_close : closes the rig.
    pilot : advises and drives the rig's robot; None when there is no robot. Its turns begin now.
    robot : its status goes into the ticks.
    turns_pilot : False: the caller ticks the pilot, in lock-step.
    """

    def __init__(
        self,
        camera: Camera,
        perceive: Perceive,
        policy: Callable[[Scene], Advice | None],
        on_close: Callable[[], None],
        pilot: Pilot | None = None,
        robot: GuardedRobot | None = None,
        *,
        turns_pilot: bool = True,
    ) -> None:
        self._camera = camera
        self._perceive = perceive
        self._policy = policy
        self._on_close = on_close
        self._robot = robot
        self.pilot = pilot
        self.problem: str | None = None
        self._loop = PilotLoop(pilot) if pilot is not None and turns_pilot else None
        self._lock = threading.Lock()
        self._target: Point | None = None
        self._last_index: int | None = None
        self._dropped = 0
        self._times: deque[float] = deque(maxlen=30)

    def step(self, timeout_s: float) -> Tick | None:
        """One turn; None when no new frame came in time.

        A lost camera that reconnects by itself does not end the turns, and one that is lost for good only where there is no
        pilot: an operator with a robot in a vessel must be able to bring it back by hand. ``problem`` then says what is wrong.

        Raises EndOfStream: a recording is over. Raises DeviceError: the camera is lost for good and there is no pilot, or driving
        failed.
        """
        if self._loop is not None and self._loop.failure is not None:
            raise DeviceError(self._loop.failure)
        frame = self._read(timeout_s)
        if frame is None or self._is_late(frame):
            if self.pilot is not None:
                self.pilot.perception_alive()
            return None
        if self._last_index is not None:
            self._dropped += max(0, frame.index - self._last_index - 1)
        self._last_index = frame.index
        self._times.append(frame.captured_s)
        with self._lock:
            target = self._target
        if self.pilot is not None:
            self.pilot.frame_arrived(frame)
        if not is_picture(frame.image):
            self._refuse(frame)
            return None
        scene = self._perceive(frame, target)
        status = self._status()
        with self._lock:
            # a scene that was perceived with another target has no route to this one
            has_target = target is not None and target == self._target
        if self.pilot is None:
            advice, sent = self._policy(scene), None
        else:
            advice = self.pilot.update_scene(frame, scene, status, has_target=has_target)
            sent = self.pilot.view.sent
        span_s = self._times[-1] - self._times[0]
        return Tick(frame, scene, advice, sent, status, self._dropped, (len(self._times) - 1) / span_s if span_s > 0.0 else 0.0)

    def _read(self, timeout_s: float) -> Frame | None:
        before_s = time.monotonic()
        try:
            frame = self._camera.read(timeout_s)
        except EndOfStream:
            raise
        except DeviceError as error:
            if self.pilot is None and not isinstance(error, CameraLost):
                raise
            self.problem = str(error)
            if self.pilot is not None:
                self.pilot.report_fault(Fault(Cause.CAMERA_LOST, self.problem))
            time.sleep(max(0.0, timeout_s - (time.monotonic() - before_s)))
            return None
        if frame is not None:
            self.problem = None
        return frame

    def _status(self) -> RobotStatus | None:
        """None also when the robot was lost: pictures go on, and the pilot reports it."""
        if self._robot is None:
            return None
        try:
            return self._robot.status()
        except DeviceError:
            return None

    def set_target(self, point: Point | None) -> None:
        """The operator's target in source pixels; None clears it. A change ends a hand-over that is under way."""
        with self._lock:
            changed, self._target = point != self._target, point
        if changed and self.pilot is not None:
            self.pilot.target_changed()

    def close(self) -> None:
        """Hold the robot and close the rig."""
        try:
            if self._loop is not None:
                self._loop.close()
            elif self.pilot is not None:
                self.pilot.close()
        finally:
            self._on_close()

    def _refuse(self, frame: Frame) -> None:
        """A frame of a wrong format is reported, and not perceived, shown or recorded."""
        shape = "x".join(map(str, frame.image.shape))
        self.problem = message(
            "the camera's picture is {kind} {shape}, not 8-bit RGB: set its colour format", kind=frame.image.dtype, shape=shape
        )
        if self.pilot is not None:
            scene = Scene(frame.index, frame.captured_s, (0, 0), 1.0, refusal=Refusal(Reason.UNREADABLE, self.problem))
            self.pilot.update_scene(frame, scene, None, has_target=False)

    def _is_late(self, frame: Frame) -> bool:
        """Older than the last one by index and time: a camera that was opened again restarts its index, but at a later time."""
        if self._last_index is None or frame.index >= self._last_index or frame.captured_s >= self._times[-1]:
            return False
        self._dropped += 1
        if self.pilot is not None:
            self.pilot.frame_late()
        return True
