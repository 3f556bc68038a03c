"""Seven software servos on a pseudo-terminal, with the real protocol at the real speed, and fault injection on their line."""

from __future__ import annotations

import contextlib
import fcntl
import heapq
import logging
import math
import os
import random
import select
import shutil
import tempfile
import termios
import threading
import time
import tty
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

from core.config.safety import JointConfig, ServosConfig
from hardware.twin.servos.device import REBOOT_S, ElasticWire, SoftServo, StatusReply
from hardware.twin.servos.protocol import (
    BROADCAST,
    MAX_ID,
    Instruction,
    InstructionPacket,
    PacketParser,
    group_items,
    status_packet,
)


class LineFaults:
    """Faults of the answers on the line: lost, late or damaged. May be set from any thread while the bus runs."""

    def __init__(self, seed: int = 0) -> None:
        self._random = random.Random(seed)
        self.clear()

    def clear(self) -> None:
        """All faults off."""
        self._muted: set[int] = set()
        self._delay_s: dict[int, float] = {}
        self._truncate: dict[int, int] = {}
        self._short: dict[int, int] = {}
        self._crc = 0
        self._garbage = 0

    def mute(self, servo_id: int, on: bool = True) -> None:
        """The servo obeys, but does not answer."""
        (self._muted.add if on else self._muted.discard)(servo_id)

    def delay(self, servo_id: int, seconds: float) -> None:
        """Delay all answers of the servo; 0 ends it."""
        self._delay_s[servo_id] = seconds

    def crc(self, count: int) -> None:
        """The next `count` answers have a wrong CRC."""
        self._crc = count

    def garbage(self, count: int) -> None:
        """Put `count` random bytes before the next answer."""
        self._garbage = count

    def truncate(self, servo_id: int, count: int = 1) -> None:
        """The next `count` answers of the servo end in the middle."""
        self._truncate[servo_id] = count

    def short(self, servo_id: int, count: int = 1) -> None:
        """The next `count` answers of the servo are whole packets without data."""
        self._short[servo_id] = count

    def is_muted(self, servo_id: int) -> bool:
        return servo_id in self._muted

    def apply(self, servo_id: int, answer: bytes) -> tuple[bytes, float]:
        """The bytes on the line in place of an answer, and their delay in seconds."""
        if self._short.get(servo_id, 0) > 0:
            self._short[servo_id] -= 1
            answer = status_packet(servo_id, 0)
        if self._truncate.get(servo_id, 0) > 0:
            self._truncate[servo_id] -= 1
            answer = answer[: len(answer) // 2 + 1]
        if self._crc > 0:
            self._crc -= 1
            answer = answer[:-1] + bytes([answer[-1] ^ 0x55])
        if self._garbage > 0:
            answer = self._random.randbytes(self._garbage) + answer
            self._garbage = 0
        return answer, self._delay_s.get(servo_id, 0.0)


_log = logging.getLogger(__name__)

BAUD_OF_CODE = {0: 9600, 1: 57600, 2: 115_200, 3: 1_000_000, 4: 2_000_000, 5: 3_000_000, 6: 4_000_000}
_SPEEDS = {getattr(termios, f"B{baud}"): baud for baud in BAUD_OF_CODE.values()}
_IDLE_S = 0.02
_PACKET_PAUSE_S = 0.1
_BITS_PER_BYTE = 10
_TIOCGEXCL = 0x8004_5440
"""Asks whether a terminal is in exclusive mode (asm-generic/ioctls.h); the module termios does not have it."""
_PRIORITY = -10


class SoftServoBus:
    """The servos with their line; ``start`` opens ``port`` and answers there from a thread.

    Parameters
    ----------
    clock : seconds for motion, heat and the servos' watchdogs; the line itself runs in real time.
    wire_time : delay answers by their duration at the speed of the port.
    latency_s : the first answer to every packet comes so much later: the USB adapter, 1 to 4 ms with a latency timer of 1 ms, up to
        16 ms as it comes. The attribute of this name may be set at any time.
    positions : ticks of each horn at the start; None draws them within one turn, from `seed`.

    Notes
    -----
    To a test: ``modify_servo`` reaches one servo (see ``SoftServo``), ``faults`` spoils answers, ``brown_out`` dips the supply of
    all, ``write_by_other`` writes as another program on the same line would, ``attach_wire`` loads a joint with an elastic wire,
    and ``wire_n`` tells its force.

    Packets without stuffing, or with a wrong CRC, speed or length are ignored. As in the vendor's protocol the answers to a group
    read follow one another, so a silent servo also silences those behind it.
    """

    def __init__(
        self,
        config: ServosConfig,
        *,
        clock: Callable[[], float] = time.monotonic,
        wire_time: bool = False,
        latency_s: float = 0.0,
        positions: Sequence[int] | None = None,
        seed: int = 0,
    ) -> None:
        self._joints = config.joints
        self._clock = clock
        self._wire_time = wire_time
        self.latency_s = latency_s
        self._baud = config.baud
        draw = random.Random(seed)
        start = positions if positions is not None else [draw.randrange(4096) for _ in self._joints]
        code = next((code for code, baud in BAUD_OF_CODE.items() if baud == config.baud), 3)
        self._servos = {
            joint.id: SoftServo(joint.id, config.model_of(joint).number, ticks, code)
            for joint, ticks in zip(self._joints, start, strict=True)
        }
        self._mounted = {servo.id: servo.mechanical_ticks for servo in self._servos.values()}
        self.faults = LineFaults(seed)
        self.log: deque[InstructionPacket] = deque(maxlen=10_000)
        """Accepted packets, oldest first."""
        self.rejected = 0
        """Number of damaged packets that were ignored."""
        self.failure: str | None = None
        self._lock = threading.RLock()
        self._parser = PacketParser()
        self._due: list[tuple[float, int, bytes]] = []
        self._order = 0
        self._heard_s = 0.0
        self._folder: Path | None = None
        self._pty: tuple[int, int] | None = None
        self._plugged = False
        self._settled = threading.Event()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._wake: tuple[int, int] = (-1, -1)

    @property
    def port(self) -> str:
        """Path of the serial port; the same after ``vanish`` and ``reappear``. Raises RuntimeError when the bus was not started."""
        if self._folder is None:
            raise RuntimeError("start the bus first")
        return str(self._folder / "servos")

    def servo(self, servo_id: int) -> SoftServo:
        """One servo; use ``modify_servo`` while the bus is running."""
        return self._servos[servo_id]

    def modify_servo(self, servo_id: int, action: Callable[[SoftServo], object]) -> None:
        """Apply a change to a servo while the bus waits: ``bus.modify_servo(3, lambda s: s.alert(32))``."""
        with self._lock:
            self._advance()
            action(self._servos[servo_id])

    def positions_mm(self) -> tuple[float, ...]:
        """Mechanical positions of the seven joints, in mm from those at the start."""
        with self._lock:
            self._advance()
            return tuple(
                (self._servos[joint.id].mechanical_ticks - self._mounted[joint.id]) / joint.ticks_per_mm for joint in self._joints
            )

    def set_loads_mn(self, forces_mn: Sequence[float]) -> None:
        """Set the force at each joint against its positive direction, in mN, which the servos' currents show."""
        with self._lock:
            for joint, force_mn in zip(self._joints, forces_mn, strict=True):
                self._servos[joint.id].motor.load_mnm = joint.sign * force_mn * _radius_mm(joint) / 1000.0

    def attach_wire(self, servo_id: int, n_per_mm: float, slack_mm: float = 0.0) -> None:
        """Load a joint with an elastic wire of `n_per_mm`, taut from `slack_mm` on (mm as of ``positions_mm``)."""
        joint = self._joint(servo_id)
        slack = self._mounted[servo_id] + slack_mm * joint.ticks_per_mm
        wire = ElasticWire(n_per_mm * _radius_mm(joint) / abs(joint.ticks_per_mm), slack, joint.sign)
        self.modify_servo(servo_id, lambda servo: setattr(servo.motor, "wire", wire))

    def wire_n(self, servo_id: int) -> float:
        """Tension (N) of a joint's elastic wire; 0 without one."""
        with self._lock:
            self._advance()
            motor = self._servos[servo_id].motor
            return abs(motor.wire.torque_mnm(motor.position)) / _radius_mm(self._joint(servo_id)) if motor.wire is not None else 0.0

    def _joint(self, servo_id: int) -> JointConfig:
        return next(joint for joint in self._joints if joint.id == servo_id)

    def brown_out(self, for_s: float = REBOOT_S) -> None:
        """The supply dips: all servos restart, and are silent for `for_s`."""
        with self._lock:
            self._advance()
            for servo in self._servos.values():
                servo.restart(for_s)

    def write_by_other(self, address: int, data: bytes, servo_id: int = BROADCAST) -> None:
        """Another program on the same line writes registers: ``write_by_other(64, bytes(1))`` switches all torque off."""
        with self._lock:
            packet = InstructionPacket(servo_id, Instruction.WRITE, address.to_bytes(2, "little") + data)
            self._execute(packet, self._baud, time.monotonic())

    def start(self) -> None:
        """Open the pseudo-terminal and answer on it."""
        if self._thread is None:
            self._folder = Path(tempfile.mkdtemp(prefix="lumenpilot_servos_"))
            self._stop.clear()
            self.failure = None
            self._wake = os.pipe()
            self._plug(True)
            self._thread = threading.Thread(target=self._run, name="twin-servos", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Close the line; the servos keep their state, and the bus can be started again."""
        if self._thread is not None:
            self._stop.set()
            self._wake_thread()
            self._thread.join()
            self._thread = None
            self._plug(False)
            for end in self._wake:
                os.close(end)
            if self._folder is not None:
                shutil.rmtree(self._folder, ignore_errors=True)
                self._folder = None

    def vanish(self) -> None:
        """Unplug: the port disappears. The servos keep running."""
        self._replug(False)

    def reappear(self) -> None:
        """Plug it in again, at the same path."""
        self._replug(True)

    def _replug(self, plugged: bool) -> None:
        self._settled.clear()
        self._plugged = plugged
        self._wake_thread()
        self._settled.wait(5.0)

    def _wake_thread(self) -> None:
        os.write(self._wake[1], b"!")

    def _plug(self, plugged: bool) -> None:
        """Make or close the pseudo-terminal. Its open slave end keeps the line alive between two programs."""
        link = Path(self.port)
        if plugged and self._pty is None:
            master, slave = os.openpty()
            tty.setraw(slave)
            os.set_blocking(master, False)
            link.symlink_to(os.ttyname(slave))
            self._pty = master, slave
        elif not plugged and self._pty is not None:
            link.unlink(missing_ok=True)
            for end in self._pty:
                os.close(end)
            self._pty = None
            self._due.clear()
        self._plugged = plugged
        self._parser.reset()

    def _run(self) -> None:
        with contextlib.suppress(OSError):  # like hardware, they do not wait for a busy computer
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _PRIORITY)
        try:
            while not self._stop.is_set():
                self._run_once()
        except Exception as error:  # noqa: BLE001 - top of the thread: the driver sees silent servos, and this says why
            _log.exception("the twin's servos stopped")
            self.failure = f"the twin's servos stopped ({type(error).__name__}: {error}); start the rig again"
            self._settled.set()

    def _run_once(self) -> None:
        """Wait for bytes, the time of the next answer or a wake-up; then advance the servos and send what is due."""
        wait_s = min(_IDLE_S, self._due[0][0] - time.monotonic()) if self._due else _IDLE_S
        ends = [self._wake[0], *([self._pty[0]] if self._pty else [])]
        ready, _, _ = select.select(ends, [], [], max(0.0, wait_s))
        if self._wake[0] in ready:
            os.read(self._wake[0], 64)
        with self._lock:
            if self._plugged != (self._pty is not None) and not self._stop.is_set():
                self._plug(self._plugged)
                self._settled.set()
            elif self._pty is not None and self._pty[0] in ready:
                self._receive(self._pty[0])
            elif self._pty is not None:
                _end_exclusive_mode(self._pty[1])
            self._settled.set()
            self._advance()
            self._send()

    def _receive(self, master: int) -> None:
        with contextlib.suppress(BlockingIOError):
            data = os.read(master, 4096)
            now = time.monotonic()
            if self._parser.is_midway and now - self._heard_s > _PACKET_PAUSE_S:
                self._parser.reset()
            self._heard_s = now
            baud = _SPEEDS.get(termios.tcgetattr(master)[5])
            for packet in self._parser.feed(data):
                self._execute(packet, baud, now + self._on_wire_s(len(packet.parameters) + 10, baud))
            self.rejected = self._parser.rejected

    def _on_wire_s(self, length: int, baud: int | None) -> float:
        return length * _BITS_PER_BYTE / baud if self._wire_time and baud else 0.0

    def _advance(self) -> None:
        now = self._clock()
        for servo in self._servos.values():
            servo.advance(now)

    def _execute(self, packet: InstructionPacket, baud: int | None, now_s: float) -> None:
        """Execute a packet by all servos that listen at this speed."""
        self._advance()
        awake = {i: s for i, s in self._servos.items() if not s.is_booting and BAUD_OF_CODE.get(s.table["baud_rate"]) == baud}
        if not awake:
            self._parser.rejected += 1
            return
        self.log.append(packet)
        now_s += self.latency_s
        for servo in awake.values():
            servo.feed_watchdog()
        if packet.instruction == Instruction.SYNC_WRITE:
            address, items = group_items(packet.parameters)
            for servo_id, data in items:
                if servo_id in awake:
                    awake[servo_id].answer(Instruction.WRITE, address, data=data)
                _obey_second_ids(awake, servo_id, address, data)
        elif packet.instruction == Instruction.SYNC_READ:
            self._group_read(packet.parameters, awake, baud, now_s)
        else:
            self._single(packet, awake, baud, now_s)

    def _single(self, packet: InstructionPacket, awake: dict[int, SoftServo], baud: int | None, now_s: float) -> None:
        to_all = packet.id == BROADCAST
        if packet.instruction == Instruction.WRITE:
            address = int.from_bytes(packet.parameters[:2], "little")
            _obey_second_ids(awake, packet.id, address, packet.parameters[2:])
        for servo in sorted(awake.values(), key=lambda servo: servo.id):
            if to_all or servo.id == packet.id:
                answer = _answer(servo, packet)
                talks = packet.instruction == Instruction.PING if to_all else servo.answers_to(packet.instruction)
                if talks and not self.faults.is_muted(servo.id):
                    now_s = self._queue(servo, answer, baud, now_s)

    def _group_read(self, parameters: bytes, awake: dict[int, SoftServo], baud: int | None, now_s: float) -> None:
        if len(parameters) < 5:
            return
        address, length = int.from_bytes(parameters[:2], "little"), int.from_bytes(parameters[2:4], "little")
        for servo_id in parameters[4:]:
            servo = awake.get(servo_id)
            if servo is None or self.faults.is_muted(servo_id) or not servo.answers_to(Instruction.READ):
                return  # those behind it get no turn
            now_s = self._queue(servo, servo.answer(Instruction.READ, address, length), baud, now_s)

    def _queue(self, servo: SoftServo, answer: StatusReply, baud: int | None, now_s: float) -> float:
        """Queue an answer; returns the time of its end on the line."""
        packet = status_packet(servo.id, answer.error, answer.data)
        data, delay_s = self.faults.apply(servo.id, packet)
        pause_s = 2e-6 * servo.table["return_delay"] if self._wire_time else 0.0
        now_s += pause_s + self._on_wire_s(len(packet), baud)
        self._order += 1
        heapq.heappush(self._due, (now_s + delay_s, self._order, data))
        return now_s

    def _send(self) -> None:
        now = time.monotonic()
        while self._due and self._due[0][0] <= now and self._pty is not None:
            data = heapq.heappop(self._due)[2]
            with contextlib.suppress(BlockingIOError):  # no reader: the buffer is full, and the bytes are lost
                os.write(self._pty[0], data)


def _end_exclusive_mode(slave: int) -> None:
    """Do what the last close of a real port does, when the program that held it was killed: a driver that lives has the lock."""
    if fcntl.ioctl(slave, _TIOCGEXCL, bytes(4)) == bytes(4):
        return
    with contextlib.suppress(BlockingIOError):
        fcntl.flock(slave, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.ioctl(slave, termios.TIOCNXCL)
        fcntl.flock(slave, fcntl.LOCK_UN)


def _radius_mm(joint: JointConfig) -> float:
    """Of the joint's drum; a torque in mN m over it is a force in N."""
    return joint.drum_mm_per_turn / (2.0 * math.pi)


def _obey_second_ids(awake: dict[int, SoftServo], servo_id: int, address: int, data: bytes) -> None:
    """Servos with this Secondary ID(12) obey, too; one whose own id it is has obeyed already."""
    for servo in awake.values():
        if servo.table["secondary_id"] == servo_id and servo.id != servo_id and servo_id <= MAX_ID:
            servo.obey(address, data)


def _answer(servo: SoftServo, packet: InstructionPacket) -> StatusReply:
    parameters = packet.parameters
    address = int.from_bytes(parameters[:2], "little")
    if packet.instruction == Instruction.READ:
        return servo.answer(packet.instruction, address, int.from_bytes(parameters[2:4], "little"))
    return servo.answer(packet.instruction, address, data=parameters[2:])
