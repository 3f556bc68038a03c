"""What a camera and a robot are to the rest of the program. Drivers live in ``hardware`` and pass one contract suite."""

from __future__ import annotations

from typing import Protocol

from core.errors import UserError
from core.types import Command, Frame, RobotStatus


class DeviceError(UserError):
    """A device cannot do what was asked. The message is one line and says what to do."""


class Camera(Protocol):
    """Gives the newest frame. One thread opens, reads and closes it.

    ``read`` waits at most `timeout_s` for a frame newer than the last one it gave and returns None when none came; it raises
    ``DeviceError`` when the camera is lost, and ``EndOfStream`` when a file has no more frames.
    """

    @property
    def name(self) -> str: ...
    @property
    def is_live(self) -> bool: ...
    def open(self) -> None: ...
    def read(self, timeout_s: float) -> Frame | None: ...
    def close(self) -> None: ...


class CameraLost(DeviceError):
    """A camera gives no more frames, and looks for itself: ``read`` raises this until it is back, and then gives frames again."""


class DamagedPicture(DeviceError):
    """One picture of a recorded source cannot be read; the next one may be."""


class EndOfStream(DeviceError):
    """A recorded source has no more frames."""


class DamagedStream(EndOfStream):
    """A recorded source ends too early, because its rest cannot be read."""


class Robot(Protocol):
    """Takes commands and returns what was really sent after its own limits."""

    @property
    def name(self) -> str: ...
    def connect(self) -> None: ...
    def send(self, command: Command) -> Command: ...
    def status(self) -> RobotStatus: ...
    def hold(self) -> None: ...
    def close(self) -> None: ...
