"""The bench twin in a process of its own: physics, pictures and software servos take no time from the program that looks at them.

The application starts it (``twin_start``) as ``python -m hardware.twin.process MEMORY WAKE``, gives it the configuration as
one line of JSON on standard input, and gets one line back: the servos' port, or what is wrong. From then on pictures and truth go
through shared memory, a byte in the pipe WAKE tells that there is a new picture, and the end of standard input ends the process.

Starts the twin's process, which loads its modules for seconds and then waits for the twin that it shall be.

The application's end of the twin's process: a camera, the servos' port, and the truth about the robot.

The two processes of a twin with servos, which load beside whatever else is loading.

From the seven servos' motion to the twin's mechanics: wires pull, drums feed.
"""

from __future__ import annotations

import contextlib
import gc
import json
import math
import mmap
import os
import select
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np

from core.config.models import Config, TwinConfig
from core.config.safety import ServosConfig
from core.devices import DeviceError
from core.types import Command, Frame, RobotStatus
from hardware.processes import SharedSlot, start_child
from hardware.servos.bus_ipc import BusProcess
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.world import TwinWorld

_MODULE = "hardware.twin.process"
_START_S, _END_S = 60.0, 5.0


class TwinProcess:
    """The process with its shared memory (a file of no length yet) and the pipe that tells of a new picture.

    Raises
    ------
    DeviceError
        When it cannot be started: no memory, no descriptors.
    """

    def __init__(self) -> None:
        try:
            with contextlib.ExitStack() as undo, contextlib.ExitStack() as always:
                self.memory_fd = os.memfd_create("bench_twin", os.MFD_CLOEXEC)
                undo.callback(os.close, self.memory_fd)
                self.wake, wake_end = os.pipe()
                undo.callback(os.close, self.wake)
                always.callback(os.close, wake_end)
                self._process = start_child(_MODULE, (self.memory_fd, wake_end), talks=True)
                self._files = undo.pop_all()
        except OSError as error:
            raise DeviceError(f"the bench twin cannot be started ({error.strerror}): free memory, then try again") from None
        self._has_begun = False
        self.pid = self._process.pid

    def begin(self, config: Config, insertion_mm: float) -> dict[str, Any]:
        """Say what twin it shall be, with the memory in its length; returns what it answers, empty when it is gone."""
        assert self._process.stdin is not None
        self._has_begun = True
        message = {"config": config.model_dump(mode="json"), "insertion_mm": insertion_mm}
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()
        return self.said(_START_S)

    def said(self, timeout_s: float) -> dict[str, Any]:
        """The next line of the process; empty when there is none."""
        assert self._process.stdout is not None
        ready, _, _ = select.select([self._process.stdout], [], [], timeout_s)
        line = self._process.stdout.readline() if ready else b""
        try:
            found = json.loads(line) if line else {}
        except ValueError:
            found = {}
        return found if isinstance(found, dict) else {}

    def exit_code(self) -> int | None:
        """None while it runs."""
        return self._process.poll()

    def end(self) -> None:
        """The end of its input ends it; while it only loads there is nothing to wait for. May be called twice."""
        if not self._has_begun:
            self._process.kill()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._files.close()


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


@dataclass(frozen=True, slots=True)
class Pair:
    """An antagonistic pair. ``bend_mm`` is what it does to the head, positive towards the first; slack: the pulls sum below 0."""

    bend_mm: float
    slack: bool


def pair_of(first_mm: float, second_mm: float) -> Pair:
    """The pair's effect at two pulls, in mm from where each wire is without tension.

    Two stiff wires on a soft head: taut, both hold it and it goes to half their difference. Slack, only a wire that is pulled
    counts, and nothing holds against it; with none pulled the head is straight. Both agree where the sum is zero.
    """
    if first_mm + second_mm >= 0.0:
        return Pair((first_mm - second_mm) / 2.0, slack=False)
    return Pair(max(first_mm, 0.0) - max(second_mm, 0.0), slack=True)


class JointsToTwin:
    """Turns measured joint positions over time into what the twin's physics takes.

    Feeds go by differences: the sum of what is fed equals the joint's way, however time is cut. With a roll the robot is turned
    about its axis: what its tendon "right" does is then partly up or down as the camera sees it.
    """

    def __init__(self, config: ServosConfig, start_mm: Sequence[float], roll_deg: float = 0.0) -> None:
        self._max_pull_mm = config.max_pull_mm
        self._turn = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
        self._last_mm = tuple(start_mm)
        self.slack = (False, False)
        """Of the bending and of the pitching pair."""

    def command(self, positions_mm: Sequence[float], duration_s: float) -> Command:
        """What moves the twin for `duration_s`, with the joints (in the order of ``JOINT_NAMES``) at `positions_mm` at its end."""
        right, left, up, down = positions_mm[:4]
        advance, first, second = (now - last for now, last in zip(positions_mm[4:], self._last_mm[4:], strict=True))
        self._last_mm = tuple(positions_mm)
        bend, pitch = pair_of(right, left), pair_of(up, down)
        self.slack = bend.slack, pitch.slack
        cos, sin = self._turn
        return Command(
            bend=_within_one((cos * bend.bend_mm + sin * pitch.bend_mm) / self._max_pull_mm),
            pitch=_within_one((cos * pitch.bend_mm - sin * bend.bend_mm) / self._max_pull_mm),
            advance_mm_s=advance / duration_s,
            # Two rollers on one sheath: it moves as their mean.
            delivery_mm_s=(first + second) / 2.0 / duration_s,
        )


def wired(twin: TwinConfig, servos: ServosConfig) -> ServosConfig:
    """The servos as they really are: as the twin's wiring says, whatever the program believes of them.

    Raises
    ------
    ValueError
        When two servos have the same id, or one has none.
    """
    if twin.wiring is None:
        return servos
    numbers = [int(number) for number in twin.wiring.split(",")]
    if len({abs(number) for number in numbers}) != len(numbers) or not all(0 < abs(number) <= 252 for number in numbers):
        raise ValueError(f"twin.wiring {twin.wiring}: seven different ids of 1 to 252")
    joints = tuple(
        joint.model_copy(update={"id": abs(number), "sign": -1 if number < 0 else 1})
        for joint, number in zip(servos.joints, numbers, strict=True)
    )
    return servos.model_copy(update={"joints": joints})


def drive_world(world: TwinWorld, bus: SoftServoBus, config: ServosConfig) -> JointsToTwin:
    """From now on the servos of `bus` move the robot of `world`, and feel its wires. Returns the link, which knows slack pairs."""
    joints = JointsToTwin(config, bus.positions_mm(), world.config.roll_deg)

    def drive(duration_s: float) -> Command:
        bus.set_loads_mn((*world.physics.status().tendon_force_mn, 0.0, 0.0, 0.0))
        return joints.command(bus.positions_mm(), duration_s)

    world.drive = drive
    return joints


def _within_one(value: float) -> float:
    return max(-1.0, min(1.0, value))


_WAIT_S = 0.2


def main(arguments: list[str]) -> int:
    """Run until standard input ends. Arguments: file descriptors of the shared memory and of the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the application decides what Ctrl-C means
    memory_fd, wake = map(int, arguments)
    line = sys.stdin.readline()
    if not line:  # started ahead, and not needed
        return 0
    message = json.loads(line)
    config = Config.model_validate(message["config"])
    layout = memory_layout(config.twin)
    with mmap.mmap(memory_fd, layout.size) as memory:
        frames, status = layout.slots(memory)
        try:
            world = TwinWorld(config.twin, perception=config.perception)
            world.insert(message["insertion_mm"])
            wiring = wired(config.twin, config.servos)
            servos = SoftServoBus(wiring, wire_time=True)
            servos.start()
        except (ValueError, OSError, DeviceError) as error:
            _say({"error": str(error)})
            return 1
        drive_world(world, servos, wiring)
        world.start()
        gc.collect()
        gc.freeze()  # what is loaded stays: later collections are short
        _say({"port": servos.port, "title": world.phantom.title})
        ended = threading.Event()
        threading.Thread(target=_await_end, args=(ended,), name="end of input", daemon=True).start()
        try:
            _serve(world, frames, status, wake, ended)
        finally:
            world.stop()
            servos.stop()
    return 0


def _serve(world: TwinWorld, frames: SharedSlot, status: SharedSlot, wake: int, ended: threading.Event) -> None:
    os.set_blocking(wake, False)
    while not ended.is_set():
        if world.failure is not None:
            _say({"error": world.failure})
            return
        frame = world.frames.take(_WAIT_S)
        status.put(pack_status(world.physics.status()))
        if frame is not None:
            frames.put(pack_frame(frame))
            try:
                os.write(wake, b".")
            except BlockingIOError:
                pass  # a full pipe wakes as well
            except BrokenPipeError:
                return  # the application was ended at this moment, before its end of the input is seen


def _await_end(ended: threading.Event) -> None:
    """The application closes its end, or is gone."""
    sys.stdin.read()
    ended.set()


def _say(message: dict[str, str]) -> None:
    with contextlib.suppress(BrokenPipeError):
        sys.stdout.write(json.dumps(message) + "\n")
        sys.stdout.flush()


@dataclass(frozen=True, slots=True, eq=False)
class PrestartedProcesses:
    """They load, and wait for what they shall be."""

    twin: TwinProcess
    bus: BusProcess

    def end(self) -> None:
        """They are not needed. What was taken over is left alone."""
        self.bus.end()
        self.twin.end()


def start_twin() -> PrestartedProcesses:
    """Raises DeviceError when they cannot be started."""
    with ExitStack() as undo:
        twin = TwinProcess()  # first: it loads for longer
        undo.callback(twin.end)
        bus = BusProcess()
        undo.pop_all()
    return PrestartedProcesses(twin, bus)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
