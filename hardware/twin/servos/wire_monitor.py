"""An independent witness on the servos' side of the wire: every goal that really arrived, against what a servo may ever be told.

It shares nothing with the gate: it reads packets, looks where the horns are by their mechanics, and has limits of its own, wider
than the gate's by what a read and a cycle may be old. What breaks them is unsafe, whoever decided it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass, field

from core.config.safety import JointConfig, JointName, ServosConfig
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.servos.device import SoftServo
from hardware.twin.servos.protocol import BROADCAST, EXTENDED_POSITION, Instruction, InstructionPacket

_TORQUE, _GOAL = 64, 116
_OLD_S = 0.2
"""A goal may rest on a position so old, and on an order before it."""
_ROUNDING_MM, _STILL_MM, _JUMP_MM = 0.03, 0.3, 0.5
_AFTER_STOP_S = 0.5
_MOST_TEXTS = 50


@dataclass(slots=True)
class WireReport:
    """What was seen so far. ``unsafe`` counts, ``texts`` names the first ones."""

    packets: int = 0
    goals: int = 0
    unsafe: int = 0
    texts: list[str] = field(default_factory=list)


class WireMonitor:
    """Told of every packet before a servo acts on it. All methods may be called from any thread."""

    def __init__(self, servos: ServosConfig) -> None:
        self._joints = {joint.id: joint for joint in servos.joints}
        self._lock = threading.Lock()
        self._zero: dict[int, float] = {}
        self._last: dict[int, tuple[float, float]] = {}
        self._stopped_s: float | None = None
        self._seen = WireReport()

    def zeroed(self, servos: Iterable[SoftServo], names: Iterable[JointName] | None = None) -> None:
        """The operator took the present positions of these joints (None: of all) for zero."""
        wanted = None if names is None else set(names)
        with self._lock:
            for servo in servos:
                if wanted is None or self._joints[servo.id].name in wanted:
                    self._zero[servo.id] = servo.mechanical_ticks

    def stopped(self, now_s: float | None) -> None:
        """STOP was pressed at that time; None: the operator has acknowledged it."""
        with self._lock:
            self._stopped_s = now_s

    @property
    def seen(self) -> WireReport:
        with self._lock:
            return WireReport(self._seen.packets, self._seen.goals, self._seen.unsafe, list(self._seen.texts))

    def see(self, packet: InstructionPacket, servos: dict[int, SoftServo], now_s: float) -> None:
        """A packet that the servos heard."""
        with self._lock:
            self._seen.packets += 1
            if packet.instruction == Instruction.SYNC_WRITE:
                self._group(packet.parameters, servos, now_s)
            elif packet.instruction == Instruction.WRITE:
                address = int.from_bytes(packet.parameters[:2], "little")
                ids = list(servos) if packet.id == BROADCAST else [packet.id]
                for servo_id in ids:
                    self._write(servos.get(servo_id), address, packet.parameters[2:], now_s)

    def _group(self, parameters: bytes, servos: dict[int, SoftServo], now_s: float) -> None:
        address, length = int.from_bytes(parameters[:2], "little"), int.from_bytes(parameters[2:4], "little")
        items = parameters[4:]
        if length == 0 or len(items) % (length + 1):
            return
        for at in range(0, len(items), length + 1):
            self._write(servos.get(items[at]), address, items[at + 1 : at + 1 + length], now_s)

    def _write(self, servo: SoftServo | None, address: int, data: bytes, now_s: float) -> None:
        if servo is None or servo.id not in self._joints:
            return
        joint = self._joints[servo.id]
        if address == _TORQUE and data[:1] == b"\1":
            away_mm = _ticks_to(servo, int(servo.table["goal_position"])) / abs(joint.ticks_per_mm)
            if not servo.table["torque"] and abs(away_mm) > _JUMP_MM:
                self._blame(f"{joint.name}: torque on with its goal {away_mm:.2f} mm away")
        elif address == _GOAL and len(data) >= 4:
            self._goal(servo, joint, int.from_bytes(data[:4], "little", signed=True), now_s)

    def _goal(self, servo: SoftServo, joint: JointConfig, ticks: int, now_s: float) -> None:
        self._seen.goals += 1
        per_mm = abs(joint.ticks_per_mm)
        away_mm = abs(_ticks_to(servo, ticks)) / per_mm
        at_ticks = servo.mechanical_ticks + _ticks_to(servo, ticks)
        last, self._last[servo.id] = self._last.get(servo.id), (now_s, at_ticks)
        if not servo.table["torque"]:
            return  # nothing moves by it; what is in the register when the torque comes is looked at then
        if servo.table["operating_mode"] != EXTENDED_POSITION:
            self._blame(f"{joint.name}: a goal in mode {servo.table['operating_mode']}")
        most_mm = joint.max_step_mm + joint.max_speed_mm_s * _OLD_S
        if away_mm > most_mm + _ROUNDING_MM:
            self._blame(f"{joint.name}: goal {away_mm:.2f} mm from the horn (at most {most_mm:.2f} mm)")
        if servo.id in self._zero:
            goal_mm = (at_ticks - self._zero[servo.id]) / joint.ticks_per_mm
            here_mm = (servo.mechanical_ticks - self._zero[servo.id]) / joint.ticks_per_mm
            low_mm, high_mm = min(joint.low_mm, here_mm), max(joint.high_mm, here_mm)  # held where it stands, even outside
            if not low_mm - _ROUNDING_MM <= goal_mm <= high_mm + _ROUNDING_MM:
                self._blame(f"{joint.name}: goal {goal_mm:.2f} mm ({joint.low_mm:g} to {joint.high_mm:g} mm)")
        if last is not None:
            reach_mm = joint.max_speed_mm_s * max(now_s - last[0], _OLD_S) + joint.max_step_mm
            if abs(at_ticks - last[1]) / per_mm > reach_mm + _ROUNDING_MM:
                self._blame(f"{joint.name}: goal leaps by {abs(at_ticks - last[1]) / per_mm:.2f} mm (at most {reach_mm:.2f} mm)")
        if self._stopped_s is not None and now_s - self._stopped_s > _AFTER_STOP_S and away_mm > _STILL_MM:
            self._blame(f"{joint.name}: sent {away_mm:.2f} mm on, {now_s - self._stopped_s:.1f} s after STOP")

    def _blame(self, text: str) -> None:
        self._seen.unsafe += 1
        if len(self._seen.texts) < _MOST_TEXTS:
            self._seen.texts.append(text)


def _ticks_to(servo: SoftServo, register: int) -> float:
    """How far the horn is from what a position register says, in ticks."""
    return register - int(servo.table["present_position"]) + 0.0


class MonitoredBus(SoftServoBus):
    """Software servos with a witness."""

    def __init__(self, config: ServosConfig, watch: WireMonitor, *, wire_time: bool = True, seed: int = 0) -> None:
        super().__init__(config, wire_time=wire_time, seed=seed)
        self._watch = watch

    def zeroed(self, names: Iterable[JointName] | None = None) -> None:
        """Tell the witness that joints were zeroed where they are."""
        with self._lock:
            self._advance()
            self._watch.zeroed(self._servos.values(), names)

    def _hear(self, packet: InstructionPacket, baud: int | None, now_s: float) -> None:
        self._advance()
        awake = {number: servo for number, servo in self._servos.items() if not servo.is_booting}
        self._watch.see(packet, awake, time.monotonic())
        super()._hear(packet, baud, now_s)
