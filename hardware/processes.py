"""Child processes (the servo bus and the twin), the shared memory between two processes, and threads that serve a device.

Also which programs have a device open (``holders``).
"""

from __future__ import annotations

import contextlib
import json
import logging
import math
import mmap
import os
import select
import socket
import struct
import subprocess
import sys
import threading
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from core.devices import DeviceError
from core.program import ROOT

_log = logging.getLogger(__name__)
MESSAGE_BYTES = 131_072
"""The largest message on a socket between two processes."""
PARENT_CHECK_S = 1.0
"""How often a process that waits for its first message looks whether its parent still lives."""


def holders(device: str) -> tuple[str, ...]:
    """The other programs that have a device open, as "name (process 12)"; a pseudo-terminal's own far end is left out.

    Only root sees what other users run.
    """
    target = os.path.realpath(device)
    terminal = target.removeprefix("/dev/pts/")
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdecimal() or int(folder.name) == os.getpid():
            continue
        with contextlib.suppress(OSError):  # another user's, or gone meanwhile
            links = {fd.name: os.readlink(fd) for fd in (folder / "fd").iterdir()}
            ends = [fd for fd, link in links.items() if link.endswith("ptmx")]
            infos = [(folder / "fdinfo" / fd).read_text(encoding="ascii") for fd in ends]
            if target in links.values() and not any(f"tty-index:\t{terminal}" in info.splitlines() for info in infos):
                found.append(f"{_program(folder)} (process {folder.name})")
    return tuple(sorted(found))


def _program(folder: Path) -> str:
    """What a process in /proc runs; of Python the script or module."""
    words = [word.decode("utf-8", "replace") for word in (folder / "cmdline").read_bytes().split(b"\0") if word]
    name = Path(words[0]).name if words else (folder / "comm").read_text(encoding="utf-8", errors="replace").strip()
    script = next((Path(word).name for word in words[1:] if not word.startswith("-")), "")
    return f"{name} {script}" if name.startswith("python") and script else name


_LEFT: list[subprocess.Popen[bytes]] = []
"""Children that go on by themselves."""


class DeviceProcess:
    """``python -m module``, which loads at once and waits for its first message: it may be started before it is needed.

    The child inherits its ends of a shared memory, a pipe and a socket for JSON messages, and gets their numbers and our process id
    as arguments: ``ParentLink`` reads them. It has a session of its own, so that Ctrl-C in our terminal does not reach it.

    Parameters
    ----------
    module : has a ``main`` that makes a ``ParentLink`` of its arguments.
    title : what messages call it.
    error : raised when it cannot be started: no memory, no descriptors.
    writes_pipe : whether our end of the pipe is the one that writes.
    """

    def __init__(self, module: str, title: str, error: type[DeviceError] = DeviceError, *, writes_pipe: bool) -> None:
        self._title, self._error = title, error
        self._memory: mmap.mmap | None = None
        self._is_claimed = self._has_message = False
        with self._start_errors(), contextlib.ExitStack() as undo, contextlib.ExitStack() as theirs:
            self._memory_fd = os.memfd_create(module, os.MFD_CLOEXEC)
            undo.callback(os.close, self._memory_fd)
            ends = os.pipe()
            self.pipe, their_pipe = reversed(ends) if writes_pipe else ends
            undo.callback(os.close, self.pipe)
            theirs.callback(os.close, their_pipe)
            self.socket, their_socket = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            undo.callback(self.socket.close)
            theirs.callback(their_socket.close)
            fds = (self._memory_fd, their_pipe, their_socket.fileno())
            path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
            one_thread = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", module, *map(str, fds), str(os.getpid())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=fds,
                start_new_session=True,
                env={**os.environ, **one_thread, "PYTHONPATH": path},
            )
            undo.pop_all()
        os.set_blocking(self.pipe, False)
        self.socket.setblocking(False)

    @contextlib.contextmanager
    def _start_errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise self._error(f"{self._title} cannot be started ({error.strerror}): free memory, then try again") from None

    @property
    def pid(self) -> int:
        return self._process.pid

    def exit_code(self) -> int | None:
        """None while it runs; negative: the number of the signal that ended it."""
        return self._process.poll()

    def send(self, message: dict[str, Any]) -> None:
        """Raises OSError: BlockingIOError when the child does not read, another one when it is gone."""
        self._has_message = True
        self.socket.send(json.dumps(message).encode())

    def receive(self, timeout_s: float) -> dict[str, Any] | None:
        """The next message; None when none came in time. Raises OSError when the child is gone and has said all."""
        ready, _, _ = select.select([self.socket], [], [], max(0.0, timeout_s))
        if not ready:
            return None
        if not (data := self.socket.recv(MESSAGE_BYTES)):
            raise ConnectionResetError
        message = json.loads(data)
        return message if isinstance(message, dict) else {}

    def wait(self, timeout_s: float) -> bool:
        """Whether it has ended, waiting for that at most so long."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout_s)
        return self._process.poll() is not None

    def request_end(self) -> None:
        """Close our ends, which asks the child to end; it may still answer. Call it once."""
        with contextlib.suppress(OSError):
            self.socket.shutdown(socket.SHUT_WR)  # a forked child of ours may keep the pipe open
        os.close(self.pipe)

    def await_end(self, patience_s: float) -> bool:
        """Wait after ``request_end``; False when it had to be killed. A child without a message has no work, and is killed at
        once."""
        if self._has_message and self.wait(patience_s):
            return True
        self._process.kill()
        self._process.wait()
        return not self._has_message

    def leave(self) -> None:
        """After ``request_end``: it goes on without us."""
        _LEFT.append(self._process)

    def release(self) -> None:
        """Give socket and memory back, after the end."""
        _LEFT[:] = [one for one in _LEFT if one.poll() is None]  # no zombie stays of those that have ended since
        self.socket.close()
        if self._memory is not None:
            self._memory.close()
        os.close(self._memory_fd)

    def discard(self) -> None:
        """End a child that was started ahead and not needed; one that ``claim`` gave away is left alone. May be called twice."""
        if not self._is_claimed:
            self._is_claimed = True
            self.request_end()
            self.await_end(0.0)
            self.release()

    @staticmethod
    def claim(
        prestarted: DeviceProcess | None, start: Callable[[], DeviceProcess], memory_bytes: int
    ) -> tuple[DeviceProcess, mmap.mmap]:
        """The prestarted child if it still lives, else a new one, with its memory: the caller's to end from now on."""
        if prestarted is not None and prestarted.exit_code() is not None:
            prestarted.discard()
            prestarted = None
        child = prestarted or start()
        with contextlib.ExitStack() as undo, child._start_errors():
            undo.callback(child.discard)
            os.ftruncate(child._memory_fd, memory_bytes)
            child._memory = mmap.mmap(child._memory_fd, memory_bytes)
            undo.pop_all()
        child._is_claimed = True
        return child, child._memory


class ParentLink:
    """The child's ends of what ``DeviceProcess`` shares with it: ``pipe``, ``socket`` and the memory.

    `arguments` of the command line: file descriptors of memory, pipe and socket, and the parent's process id.
    """

    def __init__(self, arguments: Sequence[str]) -> None:
        self._memory_fd, self.pipe, socket_fd, self._parent = map(int, arguments)
        self.socket = socket.socket(fileno=socket_fd)
        os.set_blocking(self.pipe, False)
        self._memory: mmap.mmap | None = None
        self._is_cut = False

    @property
    def is_alone(self) -> bool:
        """The parent is gone: its ends are closed, or, should a child of it keep them open, we have another parent now."""
        return self._is_cut or os.getppid() != self._parent

    def first_message(self) -> dict[str, Any] | None:
        """What the parent wants of this process, however long it takes; None when the parent was gone before it said so.

        A parent that has sent it and is gone is no reason to end at once: a request or STOP may wait behind the message.
        """
        self.socket.settimeout(PARENT_CHECK_S)
        while True:
            try:
                message = json.loads(self.socket.recv(MESSAGE_BYTES) or b"null")
            except TimeoutError:  # started ahead, and not needed yet
                if self.is_alone:
                    return None
            except (OSError, ValueError):
                return None
            else:
                self.socket.setblocking(False)
                return message if isinstance(message, dict) else None

    def map_memory(self, size: int) -> mmap.mmap:
        """After the first message: by then the parent has given the memory its length."""
        self._memory = mmap.mmap(self._memory_fd, size)
        return self._memory

    def send(self, message: dict[str, Any]) -> None:
        """A parent that does not listen gets no message."""
        with contextlib.suppress(OSError):
            self.socket.send(json.dumps(message).encode(), socket.MSG_DONTWAIT)

    def wait_for_end(self, ended: threading.Event) -> None:
        """Set `ended` when the parent closes its ends or is gone. For a thread of a child that takes no requests."""
        while not self.is_alone:
            ready, _, _ = select.select([self.socket], [], [], PARENT_CHECK_S)
            try:
                self._is_cut = bool(ready) and not self.socket.recv(MESSAGE_BYTES)
            except BlockingIOError:
                continue
            except OSError:  # the parent ended with a message unread
                self._is_cut = True
        ended.set()

    def close(self) -> None:
        self.socket.close()
        if self._memory is not None:
            self._memory.close()
        for fd in (self._memory_fd, self.pipe):
            with contextlib.suppress(OSError):
                os.close(fd)


_HEAD = struct.Struct("<QII")  # sequence number from 1, length, CRC over both and the data
_KEY = struct.Struct("<QI")
_TRIES = 4


class SharedSlot:
    """One value in shared memory, from one writer to one reader; the newest wins, and neither side waits.

    Parameters
    ----------
    memory : mapped in both processes.
    offset, capacity : the slot's place, and how many bytes a value may have.

    Notes
    -----
    No lock: a process that is stopped or killed while it holds one stops the other. Values go in turn into two halves, each with a
    checksum; while one half is being written, or was left half-written, the other one still holds the value before.
    """

    def __init__(self, memory: mmap.mmap, offset: int, capacity: int) -> None:
        self._memory, self._offset, self._capacity = memory, offset, capacity
        self._written = 0
        self._read: tuple[int, bytes] | None = None

    @staticmethod
    def size(capacity: int) -> int:
        """Bytes of memory for values of `capacity` bytes."""
        return 2 * (_HEAD.size + capacity)

    @classmethod
    def row(cls, memory: mmap.mmap, capacities: Sequence[int]) -> list[SharedSlot]:
        """Slots one behind the other from the memory's beginning."""
        starts = [sum(map(cls.size, capacities[:index])) for index in range(len(capacities))]
        return [cls(memory, start, capacity) for start, capacity in zip(starts, capacities, strict=True)]

    def put(self, data: bytes) -> None:
        """Replace the value; raises ValueError when it is longer than the slot."""
        if len(data) > self._capacity:
            raise ValueError(f"{len(data)} bytes do not fit into a slot of {self._capacity}")
        self._written += 1
        at = self._half(self._written)
        check = zlib.crc32(data, zlib.crc32(_KEY.pack(self._written, len(data))))
        self._memory[at : at + _HEAD.size] = bytes(_HEAD.size)
        self._memory[at + _HEAD.size : at + _HEAD.size + len(data)] = data
        self._memory[at : at + _HEAD.size] = _HEAD.pack(self._written, len(data), check)

    def newest(self) -> tuple[int, bytes] | None:
        """Number and bytes of the newest whole value; None before the first."""
        known = self._read[0] if self._read is not None else 0
        for _ in range(_TRIES):
            numbers = sorted(((self._head(half)[0], half) for half in (0, 1)), reverse=True)
            if numbers[0][0] == known:
                break
            found = next((value for _, half in numbers if (value := self._whole(half)) is not None), None)
            if found is not None and found[0] >= known:
                self._read = found
                break
        return self._read

    def _half(self, number: int) -> int:
        return self._offset + (number % 2) * (_HEAD.size + self._capacity)

    def _head(self, half: int) -> tuple[int, int, int]:
        """Number (0 while it is being written), length and checksum of a half."""
        at = self._half(half)
        number, length, check = _HEAD.unpack(self._memory[at : at + _HEAD.size])
        return number, length, check

    def _whole(self, half: int) -> tuple[int, bytes] | None:
        number, length, check = self._head(half)
        if number == 0 or length > self._capacity:
            return None
        at = self._half(half) + _HEAD.size
        data = self._memory[at : at + length]
        return (number, data) if zlib.crc32(data, zlib.crc32(_KEY.pack(number, length))) == check else None


class DeviceThread:
    """Runs `serve` in a thread until it returns; what it raises goes to `failed`, in the same thread.

    `serve` waits only by ``wait``, and returns soon after ``stopping`` turned True.
    """

    def __init__(self, name: str, serve: Callable[[], None], failed: Callable[[Exception], None]) -> None:
        self._name, self._serve, self._failed = name, serve, failed
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._wake = (-1, -1)

    @property
    def stopping(self) -> bool:
        return self._stop.is_set()

    def start(self) -> None:
        """Start; does nothing when it runs."""
        if self._thread is None:
            self._stop.clear()
            self._wake = os.pipe()
            self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread and wait for that; may be called twice, but not from within `serve`."""
        if self._thread is not None:
            self._stop.set()
            os.write(self._wake[1], b"!")
            self._thread.join()
            self._thread = None
            for end in self._wake:
                os.close(end)

    def wait(self, device: int | None, timeout_s: float) -> bool:
        """Wait until the file descriptor `device` can be read or is lost (True), for `timeout_s` at most, or for ``close``."""
        poll = select.poll()  # select would refuse a file descriptor above 1023
        poll.register(self._wake[0], select.POLLIN)
        if device is not None:
            poll.register(device, select.POLLIN)
        ready = [end for end, _ in poll.poll(math.ceil(1000.0 * max(0.0, timeout_s)))]
        return device in ready and not self.stopping

    def _run(self) -> None:
        try:
            self._serve()
        except Exception as error:  # noqa: BLE001 - top of the thread
            _log.exception("the thread %s ended", self._name)
            self._failed(error)
