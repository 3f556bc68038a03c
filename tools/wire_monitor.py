"""An independent check of every goal on the line to the servos against limits.

It shares no code with the gate: it reads packets and the true positions of the horns. Its limits are wider than the gate's by
the age of a reading and of a command. A goal beyond them is unsafe, whatever its source.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from core.config.safety import TENDONS, JointConfig, JointName, ServosConfig
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.servos.device import SoftServo
from hardware.twin.servos.protocol import BROADCAST, CURRENT_POSITION, Instruction, InstructionPacket, group_items

_TORQUE, _GOAL = 64, 116
_OLD_S = 0.2
"""Age of the position and the command behind a goal."""
_ROUNDING_MM, _STILL_MM, _JUMP_MM = 0.03, 0.3, 0.5
_AT_END_MM, _SLOW_LAG_MM = 0.1, 0.3
"""A feed so near to the low end of its envelope may be pulled out by hand; its goals are so far ahead at most."""
_AFTER_STOP_S = 0.5
_FORCE_SHARE, _CURRENT_UNIT_MA = 1.1, 2.69
"""A servo may give a tenth more than its joint's force; unit of Goal Current(102) of the twin's XM430."""
_MOST_TEXTS = 50


@dataclass(slots=True)
class WireReport:
    """Counts so far; ``texts`` describes the first unsafe goals."""

    packets: int = 0
    goals: int = 0
    unsafe: int = 0
    texts: list[str] = field(default_factory=list)


class WireMonitor:
    """Checks every packet before a servo executes it. All methods may be called from any thread."""

    def __init__(self, servos: ServosConfig) -> None:
        self._joints = {joint.id: joint for joint in servos.joints}
        self._lock = threading.Lock()
        self._zero: dict[int, float] = {}
        self._last: dict[int, tuple[float, float]] = {}
        self._stopped_s: float | None = None
        self._report = WireReport()

    def set_zero(self, servos: Iterable[SoftServo], names: Iterable[JointName] | None = None) -> None:
        """Take the present positions of these joints (None: of all) as zero, as the operator does."""
        wanted = None if names is None else set(names)
        with self._lock:
            for servo in servos:
                if wanted is None or self._joints[servo.id].name in wanted:
                    self._zero[servo.id] = servo.mechanical_ticks

    def set_stop(self, now_s: float | None) -> None:
        """Set the time of STOP; None: the operator has acknowledged it."""
        with self._lock:
            self._stopped_s = now_s

    @property
    def report(self) -> WireReport:
        with self._lock:
            return replace(self._report, texts=list(self._report.texts))

    def check_packet(self, packet: InstructionPacket, servos: dict[int, SoftServo], now_s: float) -> None:
        with self._lock:
            self._report.packets += 1
            if packet.instruction == Instruction.SYNC_WRITE:
                address, items = group_items(packet.parameters)
                for servo_id, data in items:
                    self._check_write(servos.get(servo_id), address, data, now_s)
            elif packet.instruction == Instruction.WRITE:
                address = int.from_bytes(packet.parameters[:2], "little")
                ids = list(servos) if packet.id == BROADCAST else [packet.id]
                for servo_id in ids:
                    self._check_write(servos.get(servo_id), address, packet.parameters[2:], now_s)

    def _check_write(self, servo: SoftServo | None, address: int, data: bytes, now_s: float) -> None:
        if servo is None or servo.id not in self._joints:
            return
        joint = self._joints[servo.id]
        if address == _TORQUE and data[:1] == b"\1":
            away_mm = _ticks_to(servo, int(servo.table["goal_position"])) / abs(joint.ticks_per_mm)
            if not servo.table["torque"] and abs(away_mm) > _JUMP_MM:
                self._add_unsafe(f"{joint.name}: torque on with its goal {away_mm:.2f} mm away")
        elif address == _GOAL and len(data) >= 4:
            self._check_goal(servo, joint, int.from_bytes(data[:4], "little", signed=True), now_s)

    def _check_goal(self, servo: SoftServo, joint: JointConfig, ticks: int, now_s: float) -> None:
        self._report.goals += 1
        per_mm = abs(joint.ticks_per_mm)
        away_mm = abs(_ticks_to(servo, ticks)) / per_mm
        at_ticks = servo.mechanical_ticks + _ticks_to(servo, ticks)
        last, self._last[servo.id] = self._last.get(servo.id), (now_s, at_ticks)
        if not servo.table["torque"]:
            return  # it causes no motion; the register is checked when the torque is switched on
        if servo.table["operating_mode"] != CURRENT_POSITION:
            self._add_unsafe(f"{joint.name}: a goal in mode {servo.table['operating_mode']}")
        if (force_n := _most_force_n(servo, joint)) > _FORCE_SHARE * joint.max_force_n:
            self._add_unsafe(f"{joint.name}: a goal that may pull with {force_n:.1f} N (at most {joint.max_force_n:g} N)")
        most_mm = joint.max_step_mm + joint.max_speed_mm_s * _OLD_S
        if away_mm > most_mm + _ROUNDING_MM:
            self._add_unsafe(f"{joint.name}: goal {away_mm:.2f} mm from the horn (at most {most_mm:.2f} mm)")
        if servo.id in self._zero:
            goal_mm = (at_ticks - self._zero[servo.id]) / joint.ticks_per_mm
            here_mm = (servo.mechanical_ticks - self._zero[servo.id]) / joint.ticks_per_mm
            low_mm, high_mm = min(joint.low_mm, here_mm), max(joint.high_mm, here_mm)  # holding is allowed outside, too
            if joint.name not in TENDONS and here_mm < joint.low_mm + _AT_END_MM:  # the operator may pull it out, slowly
                low_mm = min(low_mm, here_mm - _SLOW_LAG_MM)
            if not low_mm - _ROUNDING_MM <= goal_mm <= high_mm + _ROUNDING_MM:
                self._add_unsafe(f"{joint.name}: goal {goal_mm:.2f} mm ({joint.low_mm:g} to {joint.high_mm:g} mm)")
        if last is not None:
            reach_mm = joint.max_speed_mm_s * max(now_s - last[0], _OLD_S) + joint.max_step_mm
            if abs(at_ticks - last[1]) / per_mm > reach_mm + _ROUNDING_MM:
                self._add_unsafe(
                    f"{joint.name}: goal leaps by {abs(at_ticks - last[1]) / per_mm:.2f} mm (at most {reach_mm:.2f} mm)"
                )
        if self._stopped_s is not None and now_s - self._stopped_s > _AFTER_STOP_S and away_mm > _STILL_MM:
            self._add_unsafe(f"{joint.name}: sent {away_mm:.2f} mm on, {now_s - self._stopped_s:.1f} s after STOP")

    def _add_unsafe(self, text: str) -> None:
        self._report.unsafe += 1
        if len(self._report.texts) < _MOST_TEXTS:
            self._report.texts.append(text)


def _most_force_n(servo: SoftServo, joint: JointConfig) -> float:
    """What the servo may pull its joint with."""
    return abs(servo.table["goal_current"]) * _CURRENT_UNIT_MA * servo.motor.mnm_per_ma / (joint.mm_per_turn / (2.0 * math.pi))


def _ticks_to(servo: SoftServo, register: int) -> float:
    """Distance from the horn to the value of a position register, in ticks."""
    return register - int(servo.table["present_position"]) + 0.0


class MonitoredBus(SoftServoBus):
    """Software servos whose packets are checked."""

    def __init__(self, config: ServosConfig, monitor: WireMonitor, *, wire_time: bool = True, seed: int = 0) -> None:
        super().__init__(config, wire_time=wire_time, seed=seed)
        self._monitor = monitor

    def set_zero(self, names: Iterable[JointName] | None = None) -> None:
        """Tell the monitor that joints were zeroed where they are."""
        with self._lock:
            self._advance()
            self._monitor.set_zero(self._servos.values(), names)

    def _execute(self, packet: InstructionPacket, baud: int | None, now_s: float) -> None:
        self._advance()
        awake = {number: servo for number, servo in self._servos.items() if not servo.is_booting}
        self._monitor.check_packet(packet, awake, time.monotonic())
        super()._execute(packet, baud, now_s)
