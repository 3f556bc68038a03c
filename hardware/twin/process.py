"""The bench twin in a process of its own: physics, pictures and software servos take no time from the program that looks at them.

The application starts it as ``python -m hardware.twin.process MEMORY PIPE SOCKET PARENT``, sends the configuration as its first
message, and gets one back: the servos' port, or what is wrong. From then on pictures and truth go through shared memory, a byte in
the pipe tells that there is a new picture, and the end of the socket ends the process.
"""

from __future__ import annotations

import contextlib
import gc
import math
import os
import select
import signal
import struct
import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.config.models import Config, TwinConfig
from core.config.safety import ServosConfig
from core.devices import DeviceError
from core.messages import message
from core.types import Command, Frame, RobotStatus
from hardware.processes import DeviceProcess, ParentLink, SharedSlot
from hardware.servos.bus_ipc import start_bus
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.world import TwinWorld

_START_S, _END_S = 60.0, 5.0


_FRAME = struct.Struct("<Qdii")  # index, captured, width, height
_STATUS = struct.Struct("<3d8dd")  # time, insertion, delivery, pulls and forces, contact (NaN: unknown)


def _slot_sizes(twin: TwinConfig) -> tuple[int, int]:
    """Bytes of a frame and a status in the shared memory; both processes know the twin's picture size."""
    return _FRAME.size + 3 * twin.image_width_px * twin.image_height_px, _STATUS.size


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


def start_twin() -> DeviceProcess:
    """A twin process, which loads for seconds and then waits for its configuration; raises DeviceError."""
    return DeviceProcess("hardware.twin.process", "the bench twin", writes_pipe=False)


class RemoteTwin:
    """A running twin process. ``read`` and ``close`` belong to one thread, ``status`` to any.

    Parameters
    ----------
    prestarted : a process from ``start_twin``; without one, or when it has died meanwhile, one is started.

    Raises DeviceError: when it cannot be started: an unknown phantom, no memory, no pseudo-terminal.
    """

    def __init__(self, config: Config, insertion_mm: float, prestarted: DeviceProcess | None = None) -> None:
        self._number = 0
        self._closed = False
        sizes = _slot_sizes(config.twin)
        self._process, memory = DeviceProcess.claim(prestarted, start_twin, sum(map(SharedSlot.size, sizes)))
        self._frames, self._status = SharedSlot.row(memory, sizes)
        with contextlib.ExitStack() as undo:
            undo.callback(self.close)
            with contextlib.suppress(OSError):  # a process that is gone has no answer either
                self._process.send({"config": config.model_dump(mode="json"), "insertion_mm": insertion_mm})
            answer = self._receive(_START_S)
            if "error" in answer:
                raise DeviceError(answer["error"])
            if "port" not in answer:
                raise DeviceError("the bench twin did not start: free memory, then start the rig again (F5)")
            self.port, self.title = answer["port"], answer["title"]
            undo.pop_all()

    def _receive(self, timeout_s: float) -> dict[str, str]:
        """What the process says; empty when it says nothing, or is gone."""
        with contextlib.suppress(OSError):
            return self._process.receive(timeout_s) or {}
        return {}

    def read(self, timeout_s: float) -> Frame | None:
        """The newest frame, waiting at most `timeout_s` for one that was not given yet. Raises DeviceError: the process is gone."""
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
            select.select([self._process.pipe], [], [], left_s)
            with contextlib.suppress(BlockingIOError):
                if os.read(self._process.pipe, 4096) == b"":
                    self._check()
                    time.sleep(max(0.0, until_s - time.monotonic()))

    def status(self) -> RobotStatus:
        """The truth, as the process told it last; raises DeviceError before the first time."""
        found = self._status.newest()
        if found is None:
            raise DeviceError("the bench twin has not told anything yet")
        return unpack_status(found[1])

    def close(self) -> None:
        """End the process; may be called twice."""
        if not self._closed:
            self._closed = True
            self._process.request_end()
            self._process.await_end(_END_S)
            self._process.release()

    def _check(self) -> None:
        code = self._process.exit_code()
        if code is not None:
            why = self._receive(0.0).get("error", f"exit code {code}")
            raise DeviceError(message("the bench twin stopped ({why}): start the rig again (F5)", why=why))


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

    Raises ValueError: when two servos have the same id, or one has none.
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
    """Run until the application ends it, or is gone. Arguments: those of ``ParentLink``."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the application decides what Ctrl-C means
    link = ParentLink(arguments)
    message = link.first_message()
    if message is None:  # started ahead, and not needed
        return 0
    config = Config.model_validate(message["config"])
    sizes = _slot_sizes(config.twin)
    frames, status = SharedSlot.row(link.map_memory(sum(map(SharedSlot.size, sizes))), sizes)
    try:
        world = TwinWorld(config.twin, perception=config.perception)
        world.insert(message["insertion_mm"])
        wiring = wired(config.twin, config.servos)
        servos = SoftServoBus(wiring, wire_time=True)
        servos.start()
    except (ValueError, OSError, DeviceError) as error:
        link.send({"error": str(error)})
        return 1
    drive_world(world, servos, wiring)
    world.start()
    gc.collect()
    gc.freeze()  # what is loaded stays: later collections are short
    link.send({"port": servos.port, "title": world.phantom.title})
    ended = threading.Event()
    threading.Thread(target=link.wait_for_end, args=(ended,), name="end of link", daemon=True).start()
    try:
        _serve(world, frames, status, link, ended)
    finally:
        world.stop()
        servos.stop()
    return 0


def _serve(world: TwinWorld, frames: SharedSlot, status: SharedSlot, link: ParentLink, ended: threading.Event) -> None:
    while not ended.is_set():
        if world.failure is not None:
            link.send({"error": world.failure})
            return
        frame = world.frames.take(_WAIT_S)
        status.put(pack_status(world.physics.status()))
        if frame is not None:
            frames.put(pack_frame(frame))
            try:
                os.write(link.pipe, b".")
            except BlockingIOError:
                pass  # a full pipe wakes as well
            except BrokenPipeError:
                return  # the application was ended at this moment, before the end of the link is seen


class PrestartedProcesses:
    """The twin and its servo bus, loading before the rig is opened. Raises DeviceError when they cannot be started."""

    def __init__(self) -> None:
        self.twin = start_twin()  # first: it loads for longer
        with contextlib.ExitStack() as undo:
            undo.callback(self.twin.discard)
            self.bus = start_bus()
            undo.pop_all()

    def end(self) -> None:
        """End those that no rig has taken over."""
        self.bus.discard()
        self.twin.discard()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
