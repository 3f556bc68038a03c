"""The application's end of the twin's process: a camera, the servos' port, and the truth about the robot."""

from __future__ import annotations

import contextlib
import math
import mmap
import os
import select
import struct
import time
from dataclasses import dataclass

import numpy as np

from core.config import Config, TwinConfig
from core.devices import DeviceError
from core.types import Frame, RobotStatus
from hardware.servos.shared_slot import SharedSlot
from hardware.twin.twin_start import TwinProcess

_FRAME = struct.Struct("<Qdii")  # index, captured, width, height
_STATUS = struct.Struct("<3d8dd")  # time, insertion, delivery, pulls and forces, contact (NaN: unknown)


@dataclass(frozen=True, slots=True)
class MemoryLayout:
    """Where the slots lie in the shared memory."""

    frame_bytes: int

    @property
    def size(self) -> int:
        return SharedSlot.size(self.frame_bytes) + SharedSlot.size(_STATUS.size)

    def slots(self, memory: mmap.mmap) -> tuple[SharedSlot, SharedSlot]:
        """Newest frame, newest status."""
        after = SharedSlot.size(self.frame_bytes)
        return SharedSlot(memory, 0, self.frame_bytes), SharedSlot(memory, after, _STATUS.size)


def memory_layout(twin: TwinConfig) -> MemoryLayout:
    """The layout for the twin's picture size; both processes compute it."""
    return MemoryLayout(_FRAME.size + 3 * twin.image_width_px * twin.image_height_px)


def pack_frame(frame: Frame) -> bytes:
    height, width = frame.image.shape[:2]
    return _FRAME.pack(frame.index, frame.captured_s, width, height) + frame.image.tobytes()


def unpack_frame(data: bytes) -> Frame:
    index, captured_s, width, height = _FRAME.unpack_from(data)
    image = np.frombuffer(data, np.uint8, 3 * width * height, _FRAME.size).reshape(height, width, 3)
    return Frame(index, captured_s, image)


def pack_status(status: RobotStatus) -> bytes:
    contact_n = float("nan") if status.wall_contact_n is None else status.wall_contact_n
    pulls, forces = status.tendon_pull_mm, status.tendon_force_mn
    return _STATUS.pack(status.time_s, status.insertion_mm, status.delivery_mm, *pulls, *forces, contact_n)


def unpack_status(data: bytes) -> RobotStatus:
    time_s, insertion_mm, delivery_mm, *rest = _STATUS.unpack(data)
    a, b, c, d, e, f, g, h, contact_n = rest
    known_n = None if math.isnan(contact_n) else contact_n
    return RobotStatus(time_s, insertion_mm, delivery_mm, (a, b, c, d), (e, f, g, h), known_n)


class RemoteTwin:
    """A running twin process: one that was started ahead, or a new one.

    ``read`` and ``close`` belong to one thread, ``status`` to any.

    Raises
    ------
    DeviceError
        When it cannot be started: an unknown phantom, no memory, no pseudo-terminal.
    """

    def __init__(self, config: Config, insertion_mm: float, ahead: TwinProcess | None = None) -> None:
        self._number = 0
        layout = memory_layout(config.twin)
        with contextlib.ExitStack() as undo:
            self._process = ahead or TwinProcess()
            undo.callback(self._process.end)
            os.ftruncate(self._process.memory_fd, layout.size)
            self._memory = undo.enter_context(mmap.mmap(self._process.memory_fd, layout.size))
            self._frames, self._status = layout.slots(self._memory)
            self.port, self.title = self._hello(config, insertion_mm)
            undo.pop_all()
        self._wake = self._process.wake
        os.set_blocking(self._wake, False)

    def read(self, timeout_s: float) -> Frame | None:
        """The newest frame, waiting at most `timeout_s` for one that was not given yet.

        Raises
        ------
        DeviceError
            The process is gone.
        """
        until_s = time.monotonic() + timeout_s
        while True:
            found = self._frames.newest()
            if found is not None and found[0] != self._number:
                self._number = found[0]
                return unpack_frame(found[1])
            left_s = until_s - time.monotonic()
            if left_s <= 0.0:
                self._check()
                return None
            select.select([self._wake], [], [], left_s)
            with contextlib.suppress(BlockingIOError):
                if os.read(self._wake, 4096) == b"":
                    self._check()
                    time.sleep(max(0.0, until_s - time.monotonic()))

    def status(self) -> RobotStatus:
        """The truth, as the process told it last.

        Raises
        ------
        DeviceError
            Nothing was told yet.
        """
        found = self._status.newest()
        if found is None:
            raise DeviceError("the bench twin has not told anything yet")
        return unpack_status(found[1])

    def close(self) -> None:
        """End the process; may be called twice."""
        self._process.end()
        self._memory.close()

    def _hello(self, config: Config, insertion_mm: float) -> tuple[str, str]:
        answer = self._process.begin(config, insertion_mm)
        if "error" in answer:
            raise DeviceError(str(answer["error"]))
        if "port" not in answer:
            raise DeviceError("the bench twin did not start: free memory, then start the rig again (F5)")
        return str(answer["port"]), str(answer["title"])

    def _check(self) -> None:
        code = self._process.exit_code()
        if code is not None:
            why = self._process.said(0.0).get("error", f"exit code {code}")
            raise DeviceError(f"the bench twin stopped ({why}): start the rig again (F5)")


class RemoteCamera:
    """A ``Camera`` over a twin's process. Closing it ends the process."""

    def __init__(self, twin: RemoteTwin) -> None:
        self._twin = twin

    @property
    def name(self) -> str:
        return f"bench twin: {self._twin.title}"

    @property
    def is_live(self) -> bool:
        """False: what it shows is simulated."""
        return False

    def open(self) -> None:
        """It runs already."""

    def read(self, timeout_s: float) -> Frame | None:
        return self._twin.read(timeout_s)

    def close(self) -> None:
        self._twin.close()
