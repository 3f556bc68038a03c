"""The application's end of the twin's process: a camera, the servos' port, and the truth about the robot."""

from __future__ import annotations

import contextlib
import json
import math
import mmap
import os
import select
import struct
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from core.config import Config, TwinConfig
from core.devices import DeviceError
from core.types import Frame, RobotStatus
from hardware.servos.shared_slot import SharedSlot

MODULE = "hardware.twin.twin_process"
_ROOT = Path(__file__).resolve().parents[2]
_START_S, _END_S = 60.0, 5.0
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
    """A running twin process. ``read`` and ``close`` belong to one thread, ``status`` to any.

    Raises
    ------
    DeviceError
        When it cannot be started: an unknown phantom, no memory, no pseudo-terminal.
    """

    def __init__(self, config: Config, insertion_mm: float) -> None:
        self._number = 0
        layout = memory_layout(config.twin)
        with contextlib.ExitStack() as undo, contextlib.ExitStack() as always:
            memory_fd = os.memfd_create("bench_twin", os.MFD_CLOEXEC)
            always.callback(os.close, memory_fd)
            os.ftruncate(memory_fd, layout.size)
            self._wake, wake_end = os.pipe()
            undo.callback(os.close, self._wake)
            always.callback(os.close, wake_end)
            self._memory = undo.enter_context(mmap.mmap(memory_fd, layout.size))
            self._frames, self._status = layout.slots(self._memory)
            self._process = _spawn((memory_fd, wake_end))
            undo.callback(self._end)
            self.port, self.title = self._hello(config, insertion_mm)
            undo.pop_all()
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
        if self._process.poll() is None or not self._memory.closed:
            self._end()
            with contextlib.suppress(OSError):
                os.close(self._wake)
            self._memory.close()

    def _hello(self, config: Config, insertion_mm: float) -> tuple[str, str]:
        assert self._process.stdin is not None
        message = {"config": config.model_dump(mode="json"), "insertion_mm": insertion_mm}
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()
        answer = self._said(_START_S)
        if "error" in answer:
            raise DeviceError(str(answer["error"]))
        if "port" not in answer:
            raise DeviceError("the bench twin did not start: free memory, then start the rig again (F5)")
        return str(answer["port"]), str(answer["title"])

    def _said(self, timeout_s: float) -> dict[str, Any]:
        """The next line of the process; empty when there is none."""
        assert self._process.stdout is not None
        ready, _, _ = select.select([self._process.stdout], [], [], timeout_s)
        line = self._process.stdout.readline() if ready else b""
        try:
            found = json.loads(line) if line else {}
        except ValueError:
            found = {}
        return found if isinstance(found, dict) else {}

    def _check(self) -> None:
        code = self._process.poll()
        if code is not None:
            why = self._said(0.0).get("error", f"exit code {code}")
            raise DeviceError(f"the bench twin stopped ({why}): start the rig again (F5)")

    def _end(self) -> None:
        process = self._process
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


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


def _spawn(ends: tuple[int, int]) -> subprocess.Popen[bytes]:
    """The process, in a session of its own: Ctrl-C in the application's terminal does not reach it."""
    path = os.pathsep.join(filter(None, (str(_ROOT), os.environ.get("PYTHONPATH", ""))))
    quiet = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    try:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", MODULE, *map(str, ends)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=ends,
            start_new_session=True,
            env={**os.environ, **quiet, "PYTHONPATH": path},
        )
    except OSError as error:
        raise DeviceError(f"the bench twin cannot be started ({error.strerror}): free memory, then try again") from None
