"""The interface of a camera, the errors of devices, and a one-slot hand-over between threads. Drivers live in ``hardware``."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from core.messages import message

if TYPE_CHECKING:
    from core.types import Frame


class UserError(Exception):
    """Root of all errors that a user can fix; the message is one line that says what to do. A command ends with exit code 2.

    With `values` the text is a template, as that of ``message``.
    """

    def __init__(self, text: str = "", /, **values: object) -> None:
        super().__init__(message(text, **values) if values else text)


@contextmanager
def disk_errors(kind: type[UserError], path: Path | str, what: str, then: str = "", *, missing: str = "") -> Iterator[None]:
    """Tell an OSError within as an error of `kind`: what is the matter with `path`, and what to do.

    `missing` is said of a file that is not there, where that is worth other words.
    """
    try:
        yield
    except OSError as error:
        is_missing = missing and isinstance(error, FileNotFoundError)
        raise kind(f"{path}: {missing}" if is_missing else f"{path}: {what} ({error.strerror}){then}") from None


class DeviceError(UserError):
    """A device cannot do what was asked."""


class Camera(Protocol):
    """Gives the newest frame. One thread opens, reads and closes it.

    ``read`` waits at most `timeout_s` for a frame newer than the last one it gave and returns None when none came; it raises
    ``DeviceError`` when the camera is lost, and ``EndOfStream`` when a file has no more frames.
    """

    @property
    def name(self) -> str: ...
    def open(self) -> None: ...
    def read(self, timeout_s: float) -> Frame | None: ...
    def close(self) -> None: ...


class CameraLost(DeviceError):
    """A camera gives no more frames and reconnects by itself: ``read`` raises this until it is back."""


class DamagedPicture(DeviceError):
    """One picture of a recorded source cannot be read; the next one may be."""


class EndOfStream(DeviceError):
    """A recorded source has no more frames."""


class DamagedStream(EndOfStream):
    """A recorded source ends too early, because its rest cannot be read."""


T = TypeVar("T")


class Latest(Generic[T]):
    """A slot of depth one between threads: the newest value replaces an older one, which counts as dropped.

    A queue would fall behind without bound when the reader is slower than the writer.
    """

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._value: T | None = None
        self._dropped = 0

    @property
    def dropped(self) -> int:
        """How many values were replaced before they were taken."""
        with self._condition:
            return self._dropped

    def put(self, value: T) -> bool:
        """Store `value`; True when the slot was empty, so that the writer must wake the reader."""
        with self._condition:
            was_empty = self._value is None
            if not was_empty:
                self._dropped += 1
            self._value = value
            self._condition.notify()
            return was_empty

    def take(self, timeout_s: float = 0.0) -> T | None:
        """Take the newest value, waiting at most `timeout_s`; None when there was none."""
        with self._condition:
            if self._value is None and timeout_s > 0:
                self._condition.wait(timeout_s)
            value, self._value = self._value, None
            return value
