"""Starts the servo bus's process, which loads its modules for half a second and then waits for the servos that it shall guard."""

from __future__ import annotations

import contextlib
import mmap
import os
import socket

from hardware.child_process import start_child
from hardware.servos.errors import BusProcessLost
from hardware.servos.shared_slot import SharedSlot

SMALL_BYTES, STATUS_BYTES = 64, 65_536
MEMORY_BYTES = 2 * SharedSlot.size(SMALL_BYTES) + SharedSlot.size(STATUS_BYTES)
_MODULE = "hardware.servos.bus_process"


def slots(memory: mmap.mmap) -> tuple[SharedSlot, SharedSlot, SharedSlot]:
    """Order, heartbeat and status in the shared memory."""
    small = SharedSlot.size(SMALL_BYTES)
    return (
        SharedSlot(memory, 0, SMALL_BYTES),
        SharedSlot(memory, small, SMALL_BYTES),
        SharedSlot(memory, 2 * small, STATUS_BYTES),
    )


class BusProcess:
    """The process and our ends of the three ways to it: ``memory``, ``line`` for STOP, ``socket``. A ``BusLink`` takes it over.

    Raises
    ------
    BusProcessLost
        When it cannot be started: no memory, no descriptors.
    """

    def __init__(self) -> None:
        try:
            with contextlib.ExitStack() as undo, contextlib.ExitStack() as theirs:
                memory_fd = os.memfd_create("servo_bus", os.MFD_CLOEXEC)
                theirs.callback(os.close, memory_fd)
                os.ftruncate(memory_fd, MEMORY_BYTES)
                self.memory = undo.enter_context(mmap.mmap(memory_fd, MEMORY_BYTES))
                line_end, self.line = os.pipe()
                theirs.callback(os.close, line_end)
                undo.callback(os.close, self.line)
                self.socket, socket_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                theirs.callback(socket_end.close)
                undo.callback(self.socket.close)
                self.process = start_child(_MODULE, (memory_fd, line_end, socket_end.fileno()), str(os.getpid()))
                self._ours = undo.pop_all()
        except OSError as error:
            raise BusProcessLost(
                f"the servo bus process cannot be started ({error.strerror}): free memory, then try again"
            ) from None
        os.set_blocking(self.line, False)
        self.socket.setblocking(False)
        self._is_taken = False

    def take_over(self) -> None:
        """From now on it is the caller's to end."""
        self._is_taken = True

    def end(self) -> None:
        """Where nobody took it over: it knows of no servos, so that it may be killed. May be called twice."""
        if self._is_taken:
            return
        self.process.kill()
        self.process.wait()
        self._ours.close()
