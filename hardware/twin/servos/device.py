"""A software servo: answers, motion by its registers, protection, and its motor with current and heat.

Figures are those of an XM430-W350 at 12 V, from its data sheet where it has them (speed, stall current, torque).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hardware.twin.servos.protocol import ALERT, EXTENDED_POSITION, WATCHDOG_TRIPPED, ControlTable, ErrorCode, Instruction

TICKS_PER_TURN = 4096
MAX_TICKS_S = 46.0 / 60.0 * TICKS_PER_TURN
"""No-load speed."""
STALL_MA = 2300.0
_TORQUE_NM_PER_A = 1.78
_STAND_MA, _FRICTION_MA = 8.0, 40.0
_STIFFNESS_MA_PER_TICK = 12.0
_OVERLOAD_SHARE, _OVERLOAD_S = 0.8, 1.0
_HEAT_C, _HEAT_TIME_S = 400.0, 180.0
"""Final rise of temperature at stall, and the time constant."""
_STEP_S = 0.002
_MAX_STEPS = 5000


@dataclass(slots=True)
class MotorGoal:
    """The motion that the registers ask for, in ticks, ticks/s, ticks/s^2; ``acceleration`` 0: unlimited."""

    torque: bool = False
    goal: int = 0
    speed: float = MAX_TICKS_S
    acceleration: float = 0.0


class ServoMotor:
    """The motor; its position in ticks is independent of what the servo counts.

    ``trajectory`` is the position of the profile, ``position`` that of the horn, which differs only when the horn is frozen.
    ``grinds_ma`` is additional current as of a damaged gear. ``carried_ticks_s`` is a speed forced from outside.
    """

    def __init__(self, position: float, ambient_c: float = 25.0) -> None:
        self.position = self.trajectory = position
        self.velocity = 0.0
        self.ambient_c = ambient_c
        self.temperature_c = ambient_c
        self.load_mnm = 0.0
        self.grinds_ma = self.carried_ticks_s = 0.0
        self.frozen = False
        self._overloaded_s = 0.0

    def step(self, drive: MotorGoal, duration_s: float) -> None:
        """Advance time; motion is limited to 10 s of it."""
        self._warm(drive, duration_s)
        strained = drive.torque and abs(self.current_ma(drive)) > _OVERLOAD_SHARE * STALL_MA
        self._overloaded_s = self._overloaded_s + duration_s if strained else 0.0
        if self.carried_ticks_s:
            self.position += self.carried_ticks_s * duration_s
        if not drive.torque or self.carried_ticks_s:
            self.velocity, self.trajectory = 0.0, self.position
            return
        steps = min(_MAX_STEPS, math.ceil(duration_s / _STEP_S - 1e-9))
        part_s = min(duration_s, _MAX_STEPS * _STEP_S) / max(1, steps)
        for _ in range(steps):
            if self.trajectory == drive.goal and self.velocity == 0.0:
                break
            self._move(drive, part_s)
        if not self.frozen:
            self.position = self.trajectory

    def _move(self, drive: MotorGoal, part_s: float) -> None:
        """One step along the profile, at the highest speed from which it can still brake in time."""
        way = drive.goal - self.trajectory
        fastest = min(drive.speed, MAX_TICKS_S)
        if drive.acceleration <= 0.0:
            self.velocity = math.copysign(min(fastest, abs(way) / part_s), way)
        else:
            gain = drive.acceleration * part_s
            # Speed from which steps of `gain` still end at the goal.
            braked = max(0.0, math.sqrt(2.0 * drive.acceleration * abs(way) + gain**2 / 4.0) - gain / 2.0)
            wanted = math.copysign(min(fastest, braked, abs(way) / part_s), way)
            self.velocity += max(-gain, min(gain, wanted - self.velocity))
        move = self.velocity * part_s
        if abs(way - move) < 0.5 and abs(self.velocity) <= max(2.0 * drive.acceleration * part_s, 1.0 / part_s):
            self.trajectory, self.velocity = float(drive.goal), 0.0
        else:
            self.trajectory += move

    def stop(self) -> None:
        """Stop where the horn is, as at a tripped watchdog."""
        self.trajectory, self.velocity = self.position, 0.0

    def current_ma(self, drive: MotorGoal) -> float:
        """Motor current by load, friction, and the lag behind the trajectory."""
        if not drive.torque:
            return 0.0
        lag = self.trajectory - self.position
        friction = math.copysign(_FRICTION_MA, self.velocity) if self.velocity else _STAND_MA
        grinding = math.copysign(self.grinds_ma, friction)
        current = self.load_mnm / _TORQUE_NM_PER_A + friction + grinding + _STIFFNESS_MA_PER_TICK * lag
        return max(-STALL_MA, min(STALL_MA, current))

    @property
    def is_overloaded(self) -> bool:
        """Whether the current was too high for too long, at which the servo switches off."""
        return self._overloaded_s > _OVERLOAD_S

    def _warm(self, drive: MotorGoal, duration_s: float) -> None:
        end_c = self.ambient_c + _HEAT_C * (self.current_ma(drive) / STALL_MA) ** 2
        self.temperature_c += (end_c - self.temperature_c) * -math.expm1(-duration_s / _HEAT_TIME_S)


# Units of the registers.
_VELOCITY_TICKS_S = 0.229 / 60.0 * TICKS_PER_TURN
_ACCELERATION_TICKS_S2 = 214.577 / 3600.0 * TICKS_PER_TURN
_CURRENT_MA = 2.69
_WATCHDOG_S = _RIPPLE_S = 0.02
REBOOT_S = 0.3
VOLTAGE_BIT, HEAT_BIT, OVERLOAD_BIT = 1, 4, 32


@dataclass(frozen=True, slots=True)
class StatusReply:
    """Error byte and data of a status packet."""

    error: int
    data: bytes = b""


class SoftServo:
    """A servo of the X series with its horn at `position` ticks.

    Time advances by ``advance``; the bus watchdog counts from the last ``feed_watchdog``.
    """

    def __init__(self, servo_id: int, model: int, position: int, baud_code: int = 3) -> None:
        self.id = servo_id
        self.table = ControlTable()
        self.table["id"] = servo_id
        self.table["model_number"] = model
        self.table["baud_rate"] = baud_code
        self.motor = ServoMotor(float(position))
        self.supply_v = 12.0
        self._grinds_ma, self._ripples = 0.0, False
        self._lost_turns = 0
        self._heard_s = 0.0
        self._now_s = 0.0
        self._silent_until_s: float | None = None
        self.restart(silent_s=0.0)

    @property
    def mechanical_ticks(self) -> float:
        """True position of the horn, independent of what the servo counts."""
        return self.motor.position

    @property
    def is_booting(self) -> bool:
        return self._silent_until_s is not None

    def advance(self, now_s: float) -> None:
        """Advance the servo to `now_s`."""
        duration_s = max(0.0, now_s - self._now_s)
        self._now_s = max(self._now_s, now_s)
        if self._silent_until_s is not None and now_s >= self._silent_until_s:
            self._silent_until_s = None
        self._check_watchdog()
        self.motor.grinds_ma = 0.0 if self._ripples and int(self._now_s / _RIPPLE_S) % 5 == 0 else self._grinds_ma
        self.motor.step(self._drive(), duration_s)
        self._protect()
        self._refresh()

    def feed_watchdog(self) -> None:
        """Any instruction packet on the line feeds the watchdog, for any servo."""
        self._heard_s = self._now_s

    def restart(self, silent_s: float = REBOOT_S) -> None:
        """Power-up: reset RAM and turn count, and do not answer for a while."""
        self.table.reset_ram()
        self.motor.stop()
        self.motor.step(MotorGoal(), 0.0)
        self._lost_turns = int(self.motor.position // TICKS_PER_TURN)
        self.table["goal_position"] = self._count(self.motor.position)
        self._silent_until_s = self._now_s + silent_s if silent_s > 0.0 else None
        self._refresh()

    def answer(self, instruction: int, address: int = 0, length: int = 0, data: bytes = b"") -> StatusReply:
        """Execute an instruction."""
        if instruction == Instruction.PING:
            _, identity = self.table.read(0, 7)
            return self._reply(ErrorCode.NONE, identity[:2] + identity[6:7])
        if instruction == Instruction.READ:
            return self._reply(*self.table.read(address, length))
        if instruction == Instruction.WRITE:
            return self._reply(self._write(address, data))
        if instruction == Instruction.REBOOT:
            reply = self._reply(ErrorCode.NONE)
            self.restart()
            return reply
        return self._reply(ErrorCode.INSTRUCTION)

    def answers_to(self, instruction: int) -> bool:
        """Whether its status return level lets it answer."""
        level = self.table["status_return"]
        return instruction == Instruction.PING or level == 2 or (level == 1 and instruction == Instruction.READ)

    def _reply(self, error: ErrorCode, data: bytes = b"") -> StatusReply:
        return StatusReply(error | (ALERT if self.table["hardware_error"] else 0), data)

    def _write(self, address: int, data: bytes) -> ErrorCode:
        torque = self.table["torque"]
        if address == 64 and data == b"\1" and self._has_shut_down():
            return ErrorCode.RESULT_FAIL  # only a restart clears a hardware error
        error, written = self.table.write(address, data)
        if error:
            return error
        if "torque" in written and self.table["torque"] and not torque:
            self.motor.stop()  # it then moves to whatever the goal register has
        if "watchdog" in written:
            self.feed_watchdog()
        if "operating_mode" in written and self.table["operating_mode"] != EXTENDED_POSITION:
            self._lost_turns = int(self.motor.position // TICKS_PER_TURN)  # that mode knows one turn only
        self._refresh()
        return ErrorCode.NONE

    def _count(self, mechanical: float) -> int:
        return round(mechanical) - self._lost_turns * TICKS_PER_TURN

    def _drive(self) -> MotorGoal:
        table = self.table
        speed = table["profile_velocity"] or table["velocity_limit"]
        halted = table["watchdog"] == WATCHDOG_TRIPPED or table["operating_mode"] != EXTENDED_POSITION
        return MotorGoal(
            torque=table["torque"] == 1,
            goal=round(self.motor.trajectory) if halted else table["goal_position"] + self._lost_turns * TICKS_PER_TURN,
            speed=speed * _VELOCITY_TICKS_S,
            acceleration=table["profile_acceleration"] * _ACCELERATION_TICKS_S2,
        )

    def _check_watchdog(self) -> None:
        limit = self.table["watchdog"]
        if self.table["torque"] and limit > 0 and self._now_s - self._heard_s > limit * _WATCHDOG_S:
            self.table["watchdog"] = WATCHDOG_TRIPPED
            self.motor.stop()
            self.table["goal_position"] = self._count(self.motor.position)
            self.table["profile_velocity"] = self.table["profile_acceleration"] = 0

    def _protect(self) -> None:
        table, error = self.table, 0
        if not table["min_voltage_limit"] <= round(10 * self.supply_v) <= table["max_voltage_limit"]:
            error |= VOLTAGE_BIT
        if self.motor.temperature_c > table["temperature_limit"]:
            error |= HEAT_BIT
        if self.motor.is_overloaded:
            error |= OVERLOAD_BIT
        self.table["hardware_error"] |= error
        if self._has_shut_down():
            self.table["torque"] = 0

    def turn(self, ticks: int) -> None:
        """Turn the horn by hand, which works only while the torque is off."""
        if not self.table["torque"]:
            self.motor.position += ticks
            self._refresh()

    def freeze(self, frozen: bool) -> None:
        """Jam the horn, or release it; then it starts from where it is."""
        self.motor.frozen = frozen
        self.motor.stop()

    def grind(self, current_ma: float, *, ripples: bool = False) -> None:
        """Add a motor current (0 ends it); with ripples, not in every fifth 20 ms."""
        self._grinds_ma, self._ripples = current_ma, ripples

    def carry(self, ticks_s: float) -> None:
        """Turn the horn by an external force stronger than the motor (0 ends it)."""
        self.motor.carried_ticks_s = ticks_s

    def heat(self, temperature_c: float) -> None:
        """Set the temperature of the servo and of its surroundings."""
        self.motor.ambient_c = self.motor.temperature_c = temperature_c

    def alert(self, bits: int) -> None:
        """Raise a hardware error, which stays until a restart."""
        self.table["hardware_error"] |= bits
        self._protect()

    def _has_shut_down(self) -> bool:
        return bool(self.table["hardware_error"] & self.table["shutdown"])

    def _refresh(self) -> None:
        """Update the registers with the present values."""
        table, motor = self.table, self.motor
        current_ma = motor.current_ma(self._drive())
        table["present_position"] = self._count(motor.position)
        table["position_trajectory"] = self._count(motor.trajectory)
        table["present_velocity"] = 0 if motor.frozen else round(motor.velocity / _VELOCITY_TICKS_S)
        table["velocity_trajectory"] = round(motor.velocity / _VELOCITY_TICKS_S)
        table["present_current"] = round(current_ma / _CURRENT_MA)
        table["moving"] = int(motor.velocity != 0.0)
        table["temperature"] = round(motor.temperature_c)
        table["voltage"] = round(10.0 * self.supply_v)
        table["tick_ms"] = int(self._now_s * 1000.0) % 32768
