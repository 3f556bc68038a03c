"""The application's side of the bench twin, which runs in a process of its own (``hardware.twin.server``).

The application sends the configuration; the process
answers with the port of the servos, or an error. Pictures and the robot's status then go through shared memory, a byte in the pipe
announces a new picture, and the end of the socket ends the process.
"""

from __future__ import annotations

import contextlib
import math
import os
import select
import struct
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from core.config.models import Config, TwinConfig
from core.config.safety import ServosConfig
from core.devices import CameraLost, DeviceError
from core.types import Command, Frame, RobotStatus
from hardware.processes import DeviceProcess, SharedSlot
from hardware.servos.bus_ipc import start_bus
from hardware.simulated_clock import SimulatedClock
from hardware.twin.actuation import JointsToTwin

if TYPE_CHECKING:
    from hardware.twin.servos.bus import SoftServoBus
    from hardware.twin.world import TwinWorld

_START_S, _END_S = 60.0, 5.0  # time limits for start and end of the process
_FRAME = struct.Struct("<Qddii")  # index, captured, published, width, height
_STATUS = struct.Struct(
    "<B3d8d2d"
)  # tendons; time, insertion, delivery; pulls and forces, filled up; contact (NaN: unknown), rotation
_MOST_TENDONS = 4
_SILENT_S = 20.0
"""A twin that gives no picture for so long has stopped."""


def slot_sizes(twin: TwinConfig) -> tuple[int, int]:
    """Bytes of a frame and of a status in the shared memory."""
    return _FRAME.size + 3 * twin.image_width_px * twin.image_height_px, _STATUS.size


def pack_frame(frame: Frame) -> bytes:
    """The bytes of a frame that is published now."""
    height, width = frame.image.shape[:2]
    return _FRAME.pack(frame.index, frame.captured_s, time.monotonic(), width, height) + frame.image.tobytes()


def unpack_frame(data: bytes) -> Frame:
    index, captured_s, published_s, width, height = _FRAME.unpack_from(data)
    image = np.frombuffer(data, np.uint8, 3 * width * height, _FRAME.size).reshape(height, width, 3)
    return Frame(index, captured_s, image, published_s=published_s)


def pack_status(status: RobotStatus) -> bytes:
    contact_n = float("nan") if status.wall_contact_n is None else status.wall_contact_n
    count, both = len(status.tendon_pull_mm), (status.tendon_pull_mm, status.tendon_force_mn)
    numbers = [number for four in both for number in (*four, *(0.0,) * (_MOST_TENDONS - count))]
    return _STATUS.pack(count, status.time_s, status.insertion_mm, status.delivery_mm, *numbers, contact_n, status.rotation_deg)


def unpack_status(data: bytes) -> RobotStatus:
    count, time_s, insertion_mm, delivery_mm, *numbers, contact_n, rotation_deg = _STATUS.unpack(data)
    pulls, forces = tuple(numbers[:count]), tuple(numbers[_MOST_TENDONS : _MOST_TENDONS + count])
    known_n = None if math.isnan(contact_n) else contact_n
    return RobotStatus(time_s, insertion_mm, delivery_mm, pulls, forces, known_n, rotation_deg)


def start_twin() -> DeviceProcess:
    """Start a twin process, which loads for seconds and then waits for its configuration; raises DeviceError."""
    return DeviceProcess("hardware.twin.server", "the bench twin", writes_pipe=False)


def _order(config: Config, insertion_mm: float) -> dict[str, Any]:
    return {"config": config.model_dump(mode="json"), "insertion_mm": insertion_mm}


class RemoteTwin:
    """A running twin process as a ``Camera``. ``read`` and ``close`` belong to one thread, ``status`` to any.

    A new process is started where `prestarted`, from ``start_twin``, is missing or has ended. Without `waits` it is not ready
    before ``await_start``. Raises DeviceError when it cannot be started: an unknown phantom, no memory, no pseudo-terminal.
    """

    def __init__(self, config: Config, insertion_mm: float, prestarted: DeviceProcess | None = None, *, waits: bool = True) -> None:
        self.order = _order(config, insertion_mm)
        self._number = 0
        self._closed = False
        sizes = slot_sizes(config.twin)
        self._process, memory = DeviceProcess.claim(prestarted, start_twin, sum(map(SharedSlot.size, sizes)))
        self._frames, self._status = SharedSlot.row(memory, sizes)
        with contextlib.ExitStack() as undo:
            undo.callback(self._end)
            self.clock = SimulatedClock()
            undo.callback(self.clock.close)
            with contextlib.suppress(OSError):  # a process that has ended gives no answer either
                self._process.send({**self.order, "clock": self.clock.file})
            undo.pop_all()
        if waits:
            self.await_start()

    def await_start(self) -> None:
        """Wait until it is ready; raises DeviceError, and is closed then."""
        with contextlib.ExitStack() as undo:
            undo.callback(self.close)
            answer = self._receive(_START_S)
            if "error" in answer:
                raise DeviceError(answer["error"])
            if "port" not in answer:
                raise DeviceError("the bench twin did not start: free memory, then start the rig again (F5)")
            self.port = answer["port"]
            self.name = f"bench twin: {answer['title']}"
            self._heard_s = time.monotonic()
            undo.pop_all()

    def _receive(self, timeout_s: float) -> dict[str, str]:
        """The next message of the process; empty without one, or when the process has ended."""
        with contextlib.suppress(OSError):
            return self._process.receive(timeout_s) or {}
        return {}

    def open(self) -> None:
        """The process runs already."""

    def read(self, timeout_s: float) -> Frame | None:
        """The newest frame not read yet, waiting at most `timeout_s` for it. Raises DeviceError when the process has ended."""
        until_s = time.monotonic() + timeout_s
        while True:
            found = self._frames.newest()
            if found is not None and found[0] != self._number:
                self._number, self._heard_s = found[0], time.monotonic()
                return unpack_frame(found[1])
            left_s = until_s - time.monotonic()
            if left_s <= 0.0:
                self._check()
                if time.monotonic() - self._heard_s > _SILENT_S:  # its clock stands still, so no age would tell it
                    raise CameraLost("the bench twin gives no pictures: F5 starts it again")
                return None
            select.select([self._process.pipe], [], [], left_s)
            with contextlib.suppress(BlockingIOError):
                if os.read(self._process.pipe, 4096) == b"":
                    self._check()
                    time.sleep(max(0.0, until_s - time.monotonic()))

    def status(self) -> RobotStatus:
        """The latest status of the simulated robot; raises DeviceError before the first one."""
        found = self._status.newest()
        if found is None:
            raise DeviceError("the bench twin has not told anything yet")
        return unpack_status(found[1])

    def close(self) -> None:
        """End the process; may be called twice."""
        if not self._closed:
            self._closed = True
            self._end()
            self.clock.close()

    def _end(self) -> None:
        self._process.request_end()
        self._process.await_end(_END_S)
        self._process.release()

    def _check(self) -> None:
        code = self._process.exit_code()
        if code is not None:
            why = self._receive(0.0).get("error", f"exit code {code}")
            raise DeviceError("the bench twin stopped ({why}): start the rig again (F5)", why=why)


def wired(twin: TwinConfig, servos: ServosConfig) -> ServosConfig:
    """The servos as the twin's wiring has them, which the program may not know.

    Raises ValueError when there is not one id for each joint, or one is used twice.
    """
    if twin.wiring is None:
        return servos
    numbers = [int(number) for number in twin.wiring.split(",")]
    if len({abs(number) for number in numbers}) != len(numbers) or not all(0 < abs(number) <= 252 for number in numbers):
        raise ValueError(f"twin.wiring {twin.wiring}: different ids of 1 to 252")
    if len(numbers) != len(servos.joints):
        raise ValueError(f"twin.wiring {twin.wiring}: {len(servos.joints)} ids, one for each joint")
    joints = tuple(
        joint.model_copy(update={"id": abs(number), "sign": -1 if number < 0 else 1})
        for joint, number in zip(servos.joints, numbers, strict=True)
    )
    return servos.model_copy(update={"joints": joints})


def drive_world(world: TwinWorld, bus: SoftServoBus, config: ServosConfig) -> None:
    """Let the servos of `bus` move the robot of `world`; they get the forces of its wires as loads."""
    joints = JointsToTwin(config, bus.positions_mm(), world.config.roll_deg)
    others = (0.0,) * (len(config.joints) - len(config.tendons))

    def drive(duration_s: float) -> Command:
        bus.set_loads_mn((*world.physics.status().tendon_force_mn, *others))
        return joints.command(bus.positions_mm(), duration_s)

    world.drive = drive


class PrestartedProcesses:
    """The processes of the twin and of its servo bus, loading before the rig is opened. Raises DeviceError."""

    def __init__(self) -> None:
        self.twin = start_twin()  # first, because it loads longer
        self._begun: RemoteTwin | None = None
        with contextlib.ExitStack() as undo:
            undo.callback(self.twin.discard)
            self.bus = start_bus()
            undo.pop_all()

    def begin(self, config: Config, insertion_mm: float) -> None:
        """Let the twin build its bench, which takes half a second, before the rig is opened. Raises DeviceError."""
        self._begun = RemoteTwin(config, insertion_mm, self.twin, waits=False)

    def open_twin(self, config: Config, insertion_mm: float) -> RemoteTwin:
        """The one that has begun where it is what is asked for, else another one; the caller's to close. Raises DeviceError."""
        begun, self._begun = self._begun, None
        if begun is not None:
            was_killed = (begun._process.exit_code() or 0) < 0
            if begun.order == _order(config, insertion_mm) and not was_killed:
                begun.await_start()
                return begun
            begun.close()
        return RemoteTwin(config, insertion_mm, self.twin)

    def end(self) -> None:
        """End the processes that no rig has claimed."""
        self.bus.discard()
        self.twin.discard()
        if self._begun is not None:
            self._begun.close()
