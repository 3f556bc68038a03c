"""Presses STOP at random moments while the servos are being opened, zeroed, switched on or restarted; measures what comes of it.

``python -m tools.stop_campaign [COUNT] [SEED]`` prints a line per procedure. Driver, packets, bus loop and software servos are the
real ones; line and clock are simulated, with 1 to 16 ms of latency for each transaction, so the same seed gives the same figures.
"""

from __future__ import annotations

import random
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast
from unittest.mock import patch

from core.config.safety import SafetyConfig, ServosConfig
from core.control.faults import Cause
from core.control.gate import Source
from core.control.kept_zero import all_at_zero
from hardware.servos import bus_process, dynamixel_bus, dynamixel_port
from hardware.servos.bus_ipc import BusOrder, BusServer, BusStatus, Heartbeat, Request
from hardware.servos.bus_process import BusLoop
from hardware.servos.dynamixel_bus import ServoBus
from hardware.servos.dynamixel_port import LockedPort
from hardware.twin.servos.device import SoftServo
from hardware.twin.servos.protocol import BROADCAST, Instruction, PacketParser, group_items, status_packet

BOUND_MS = 30.0
"""STOP is noticed so soon after the end of the transaction that was under way."""
LATENCY_S = (0.001, 0.016)
"""Least and greatest time from a request on the line to its answer."""
_WRITE_S = 0.0002
"""Time that it takes to hand a packet to the adapter."""
_READ_SLICE_S = 0.0005
"""The driver waits so long for bytes before it looks at the clock."""
_NO_ANSWER_S = 0.034
"""The driver waits for an answer so long."""
_NEXT_REQUEST_S = 0.005
"""Pause of the application between an answer and its next request."""
_AFTER_S = 0.4
"""The bus is watched for so long after STOP, or after the last request."""
_START_S = 1000.0
"""Of the simulated clock."""


class LockstepLine:
    """Seven software servos on a simulated line: pyserial's methods, and a clock that waiting for an answer advances.

    Attributes
    ----------
    torques : time, servo id and value of every change of a torque.
    transactions : beginning and end of every exchange with an answer, or in which one is waited for in vain.
    """

    def __init__(self, config: ServosConfig, draw: random.Random) -> None:
        self.now_s = _START_S
        self.servos = {joint.id: SoftServo(joint.id, config.model, 1000 + joint.id) for joint in config.joints}
        self.torques: list[tuple[float, int, int]] = []
        self.transactions: list[tuple[float, float]] = []
        self._draw = draw
        self._parser = PacketParser()
        self._due: deque[tuple[float, bytes]] = deque()
        self._buffer = bytearray()

    # ---- what the modules call instead of the module ``time``

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds

    # ---- pyserial

    @property
    def in_waiting(self) -> int:
        self._take_due()
        return len(self._buffer)

    def read(self, length: int) -> bytes:
        if not self.in_waiting:
            self.now_s = min(self.now_s + _READ_SLICE_S, self._due[0][0] if self._due else self.now_s + _READ_SLICE_S)
        self._take_due()
        data = bytes(self._buffer[:length])
        del self._buffer[:length]
        return data

    def reset_input_buffer(self) -> None:
        self._take_due()
        self._buffer.clear()

    def write(self, data: bytes) -> int:
        """Execute the packets; their answers come after the latency."""
        self.now_s += _WRITE_S
        for packet in self._parser.feed(data):
            answers = b"".join(self._execute(packet.id, packet.instruction, packet.parameters))
            if packet.id == BROADCAST and packet.instruction != Instruction.SYNC_READ:
                continue
            due_s = self.now_s + (self._draw.uniform(*LATENCY_S) if answers else _NO_ANSWER_S)
            self.transactions.append((self.now_s, due_s))
            if answers:
                self._due.append((due_s, answers))
        return len(data)

    def _take_due(self) -> None:
        while self._due and self._due[0][0] <= self.now_s:
            self._buffer += self._due.popleft()[1]

    def _execute(self, servo_id: int, instruction: int, parameters: bytes) -> Iterator[bytes]:
        before = {one.id: one.table["torque"] for one in self.servos.values()}
        for one in self.servos.values():
            one.advance(self.now_s)
            one.feed_watchdog()
        address = int.from_bytes(parameters[:2], "little")
        if instruction == Instruction.SYNC_WRITE:
            address, items = group_items(parameters)
            for one_id, data in items:
                self.servos[one_id].answer(Instruction.WRITE, address, data=data)
        elif instruction == Instruction.SYNC_READ:
            for one_id in parameters[4:]:
                yield self._answer(one_id, Instruction.READ, address, parameters[2:4])
        elif servo_id == BROADCAST:
            for one_id in self.servos:
                self._answer(one_id, instruction, address, parameters[2:])
        elif not self.servos[servo_id].is_booting:
            yield self._answer(servo_id, instruction, address, parameters[2:])
        changes = ((one.id, one.table["torque"]) for one in self.servos.values())
        self.torques += [(self.now_s, one_id, value) for one_id, value in changes if value != before[one_id]]

    def _answer(self, servo_id: int, instruction: int, address: int, rest: bytes) -> bytes:
        servo = self.servos[servo_id]
        if instruction == Instruction.READ:
            reply = servo.answer(instruction, address, int.from_bytes(rest, "little"))
        else:
            reply = servo.answer(instruction, address, data=rest)
        return status_packet(servo_id, reply.error, reply.data)


class LockstepPort(LockedPort):
    """The driver's port on a ``LockstepLine``."""

    def __init__(self, line: LockstepLine, name: str) -> None:
        super().__init__(name)
        self._lockstep = line

    def setupPort(self, cflag_baud: int) -> bool:
        self.ser = self._lockstep
        self.is_open, self.is_using = True, False
        self.tx_time_per_byte = 10_000.0 / self.baudrate
        return True

    def closePort(self) -> None:
        self.is_open = False

    def writePort(self, packet: list[int]) -> int:
        return self._lockstep.write(bytes(packet))


class LockstepEnd:
    """The application's end of the bus process: asks for one thing after the other, whatever the answers, and presses STOP once.

    It acknowledges nothing after STOP.
    """

    def __init__(self, line: LockstepLine, requests: list[Ask]) -> None:
        self._line = line
        self._requests = deque(requests)
        self._ask_s, self._asked = line.now_s + _NEXT_REQUEST_S, False
        self.stop_s: float | None = None
        self._is_stop_read = False
        self.noticed_s: float | None = None
        """When a status said first that STOP was pressed."""
        self.done_s: float | None = None
        """When the last request was answered."""
        self.errors: list[str] = []

    @property
    def is_alone(self) -> bool:
        times = [time_s for time_s in (self.stop_s, self.done_s) if time_s is not None]
        return self.done_s is not None and self._line.now_s > max(times) + _AFTER_S

    def wait(self, timeout_s: float) -> tuple[bool, bool]:
        until_s = self._line.now_s + max(0.0, timeout_s)
        events = [] if self._asked or not self._requests else [self._ask_s]
        if self.stop_s is not None and not self._is_stop_read:
            events.append(self.stop_s)
        self._line.now_s = max(self._line.now_s, min([until_s, *events]))
        is_request = bool(self._requests) and not self._asked and self._ask_s <= self._line.now_s
        return self._is_stop_waiting, is_request

    @property
    def _is_stop_waiting(self) -> bool:
        return self.stop_s is not None and not self._is_stop_read and self.stop_s <= self._line.now_s

    def read_stop(self) -> bool:
        is_waiting = self._is_stop_waiting
        self._is_stop_read = self._is_stop_read or is_waiting
        return is_waiting

    def read_request(self) -> Request:
        what, details = self._requests[0]
        self._asked = True
        return Request(1, what, details)

    def answer(self, request: Request, error: Exception | None) -> None:
        self.errors.append("" if error is None else str(error))
        self._requests.popleft()
        if self.stop_s is not None and self.stop_s <= self._line.now_s:
            self._requests = deque(one for one in self._requests if one[0] != "acknowledge")
        self._asked, self._ask_s = False, self._line.now_s + _NEXT_REQUEST_S
        if not self._requests:
            self.done_s = self._line.now_s

    def publish(self, status: BusStatus) -> None:
        is_stop = status.fault_counts.get(Cause.STOP_PRESSED, 0) > 0
        if is_stop and self.noticed_s is None and self.stop_s is not None and self.stop_s <= self._line.now_s:
            self.noticed_s = self._line.now_s

    def heartbeat(self) -> Heartbeat:
        return Heartbeat(self._line.now_s, Source.OPERATOR)

    def order(self) -> BusOrder | None:
        return None

    def send_fatal(self, text: str) -> None:
        raise AssertionError(text)


Ask = tuple[str, dict[str, Any]]
"""A request, and its details."""
_ZERO: Ask = ("zero", all_at_zero(ServosConfig()).model_dump(mode="json"))
_ARM: Ask = ("arm", {})
PROCEDURES: dict[str, tuple[bool, list[Ask]]] = {
    "open, zero and switch on": (False, [("open", {}), _ZERO, _ARM]),
    "switch on again, under tension": (True, [_ARM]),
    "zero and restart a servo": (False, [("open", {}), _ZERO, ("reboot", {"servo_id": 3}), _ARM]),
}
"""Name; whether the servos hold before; what is asked for."""


@dataclass(slots=True)
class StopOutcome:
    """One STOP.

    ``late_ms`` is from STOP, or the end of the transaction that was under way then, to the status that says so. ``came_on`` and
    ``dropped`` are the servos whose torque came on after STOP, and whose torque went off although they held before.
    """

    procedure: str
    after_s: float
    late_ms: float
    came_on: list[int] = field(default_factory=list)
    dropped: list[int] = field(default_factory=list)


@contextmanager
def lockstep(config: ServosConfig, draw: random.Random) -> Iterator[LockstepLine]:
    """The driver's modules on a simulated line and clock."""
    line = LockstepLine(config, draw)
    with ExitStack() as stack:
        stack.enter_context(patch.object(dynamixel_port, "LockedPort", partial(LockstepPort, line)))
        for module in (bus_process, dynamixel_bus, dynamixel_port):
            stack.enter_context(patch.object(module, "time", line))
        yield line


def run_procedure(name: str, draw: random.Random, stop_after_s: float | None) -> tuple[LockstepLine, LockstepEnd, float]:
    """The procedure with STOP so long after its beginning (None: without); returns line, application and beginning."""
    config = ServosConfig(port="lockstep", unattended_s=0.0)  # the application ends with its procedure
    holds, requests = PROCEDURES[name]
    with lockstep(config, draw) as line:
        bus = ServoBus(config, now_s=line.monotonic)
        end = LockstepEnd(line, [("open", {}), _ZERO, _ARM, ("disarm", {}), ("acknowledge", {})] if holds else [])
        loop = BusLoop(cast(BusServer, end), bus, config, SafetyConfig(), now_s=line.monotonic)
        if holds:
            with patch.object(bus, "close"):
                loop.run()
            end = LockstepEnd(line, requests)
            loop = BusLoop(cast(BusServer, end), bus, config, SafetyConfig(), now_s=line.monotonic)
        else:
            end._requests.extend(requests)
        begun_s = line.now_s
        end.stop_s = None if stop_after_s is None else begun_s + stop_after_s
        line.torques.clear()
        line.transactions.clear()
        loop.run()
    return line, end, begun_s


def press(name: str, draw: random.Random, stop_after_s: float) -> StopOutcome:
    """One STOP."""
    line, end, _ = run_procedure(name, draw, stop_after_s)
    assert end.stop_s is not None
    busy_s = [until_s for since_s, until_s in line.transactions if since_s <= end.stop_s < until_s]
    free_s = max([end.stop_s, *busy_s])
    late_ms = 1000.0 * (end.noticed_s - free_s) if end.noticed_s is not None else float("inf")
    came_on = [one for time_s, one, value in line.torques if value and time_s > free_s + _WRITE_S]
    holds = PROCEDURES[name][0]
    dropped = sorted({one for _, one, value in line.torques if not value}) if holds else []
    return StopOutcome(name, stop_after_s, max(0.0, late_ms), came_on, dropped)


def campaign(count: int, seed: int = 0) -> Iterator[StopOutcome]:
    """`count` STOPs at random moments, all procedures in turn."""
    draw = random.Random(seed)
    lasts_s: dict[str, float] = {}
    for name in PROCEDURES:
        _, end, begun_s = run_procedure(name, random.Random(seed), None)
        assert end.done_s is not None and not any(end.errors[:-1]), end.errors
        lasts_s[name] = end.done_s - begun_s
    for turn in range(count):
        name = list(PROCEDURES)[turn % len(PROCEDURES)]
        yield press(name, draw, draw.uniform(0.0, lasts_s[name]))


def main(count: int = 1000, seed: int = 0) -> None:
    outcomes = list(campaign(count, seed))
    for name in PROCEDURES:
        found = [outcome for outcome in outcomes if outcome.procedure == name]
        late = sorted(outcome.late_ms for outcome in found)
        sys.stdout.write(
            f"{name}: {len(found)} STOPs; noticed after the transaction under way: median {late[len(late) // 2]:.1f} ms, "
            f"longest {late[-1]:.1f} ms (at most {BOUND_MS:g} ms); torque came on after {sum(bool(o.came_on) for o in found)}, "
            f"tension dropped in {sum(bool(o.dropped) for o in found)}\n"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
