"""One software servo: what it answers, how its registers move it, and when it switches itself off.

A servo's motor: trapezoidal motion to a goal, current from what it pushes against, heat from the current. Pure.

Simple but physical: figures of an XM430-W350 at 12 V, from its data sheet where that has one (speed, stall current, torque).
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
"""Rise of temperature at stall if it lasted, and the time constant."""
_STEP_S = 0.002
_MAX_STEPS = 5000


@dataclass(slots=True)
class MotorGoal:
    """What the servo's registers ask for. Ticks, ticks/s, ticks/s^2; ``acceleration`` 0 means none is prescribed."""

    torque: bool = False
    goal: int = 0
    speed: float = MAX_TICKS_S
    acceleration: float = 0.0


class ServoMotor:
    """Position in ticks since the twin was built: it turns on whatever the servo's registers make of it.

    ``trajectory`` is where the profile wants the horn, ``position`` where it is: the same, unless the horn is frozen. ``grinds_ma``
    is what it draws beyond friction, as with a damaged gear: it still goes where it shall. ``carried_ticks_s``: something
    stronger turns the horn, wherever the goal is.
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
        """Let time pass. A pause of more than 10 s is cut: nothing changes in it any more but the temperature."""
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
        """One step along the profile: as fast as can still be braked in time."""
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
        """Stand still where the horn is, as at a tripped watchdog."""
        self.trajectory, self.velocity = self.position, 0.0

    def current_ma(self, drive: MotorGoal) -> float:
        """Motor current: load, friction, and the pull towards a trajectory that the horn does not follow."""
        if not drive.torque:
            return 0.0
        lag = self.trajectory - self.position
        friction = math.copysign(_FRICTION_MA, self.velocity) if self.velocity else _STAND_MA
        grinding = math.copysign(self.grinds_ma, friction)
        current = self.load_mnm / _TORQUE_NM_PER_A + friction + grinding + _STIFFNESS_MA_PER_TICK * lag
        return max(-STALL_MA, min(STALL_MA, current))

    @property
    def is_overloaded(self) -> bool:
        """Too much current for too long: the servo switches itself off."""
        return self._overloaded_s > _OVERLOAD_S

    def _warm(self, drive: MotorGoal, duration_s: float) -> None:
        end_c = self.ambient_c + _HEAT_C * (self.current_ma(drive) / STALL_MA) ** 2
        self.temperature_c += (end_c - self.temperature_c) * -math.expm1(-duration_s / _HEAT_TIME_S)


_TICKS_PER_TURN = 4096
_VELOCITY_TICKS_S = 0.229 / 60.0 * _TICKS_PER_TURN
_ACCELERATION_TICKS_S2 = 214.577 / 3600.0 * _TICKS_PER_TURN
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
    """A servo of the X series with ``id``, at `position` ticks of its mechanics.

    Time comes in through ``advance``; the bus watchdog counts from the last ``hear``.
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
        """Where the horn really is, whatever the servo counts."""
        return self.motor.position

    @property
    def is_booting(self) -> bool:
        return self._silent_until_s is not None

    def advance(self, now_s: float) -> None:
        """Let the servo live until `now_s`."""
        duration_s = max(0.0, now_s - self._now_s)
        self._now_s = max(self._now_s, now_s)
        if self._silent_until_s is not None and now_s >= self._silent_until_s:
            self._silent_until_s = None
        self._watch()
        self.motor.grinds_ma = 0.0 if self._ripples and int(self._now_s / _RIPPLE_S) % 5 == 0 else self._grinds_ma
        self.motor.step(self._drive(), duration_s)
        self._protect()
        self._refresh()

    def hear(self) -> None:
        """Any instruction packet on the line feeds the watchdog, whoever it is for."""
        self._heard_s = self._now_s

    def restart(self, silent_s: float = REBOOT_S) -> None:
        """Power-up: RAM and turn count are gone, and for a while nobody is at home."""
        self.table.forget()
        self.motor.stop()
        self.motor.step(MotorGoal(), 0.0)
        self._lost_turns = int(self.motor.position // _TICKS_PER_TURN)
        self.table["goal_position"] = self._count(self.motor.position)
        self._silent_until_s = self._now_s + silent_s if silent_s > 0.0 else None
        self._refresh()

    def answer(self, instruction: int, address: int = 0, length: int = 0, data: bytes = b"") -> StatusReply:
        """Do what a packet asks."""
        if instruction == Instruction.PING:
            _, identity = self.table.read(0, 7)
            return self._say(ErrorCode.NONE, identity[:2] + identity[6:7])
        if instruction == Instruction.READ:
            return self._say(*self.table.read(address, length))
        if instruction == Instruction.WRITE:
            return self._say(self._write(address, data))
        if instruction == Instruction.REBOOT:
            said = self._say(ErrorCode.NONE)
            self.restart()
            return said
        return self._say(ErrorCode.INSTRUCTION)

    def answers_to(self, instruction: int) -> bool:
        """Whether its status return level lets it answer."""
        level = self.table["status_return"]
        return instruction == Instruction.PING or level == 2 or (level == 1 and instruction == Instruction.READ)

    def _say(self, error: ErrorCode, data: bytes = b"") -> StatusReply:
        return StatusReply(error | (ALERT if self.table["hardware_error"] else 0), data)

    def _write(self, address: int, data: bytes) -> ErrorCode:
        torque = self.table["torque"]
        if address == 64 and data == b"\1" and self._has_shut_down():
            return ErrorCode.RESULT_FAIL  # only a restart clears a hardware error
        error, written = self.table.write(address, data)
        if error:
            return error
        if "torque" in written and self.table["torque"] and not torque:
            self.motor.stop()  # from where it stands to the goal register, whatever that says: who arms must write it first
        if "watchdog" in written:
            self.hear()
        if "operating_mode" in written and self.table["operating_mode"] != EXTENDED_POSITION:
            self._lost_turns = int(self.motor.position // _TICKS_PER_TURN)  # that mode knows one turn only
        self._refresh()
        return ErrorCode.NONE

    def _count(self, mechanical: float) -> int:
        return round(mechanical) - self._lost_turns * _TICKS_PER_TURN

    def _drive(self) -> MotorGoal:
        table = self.table
        speed = table["profile_velocity"] or table["velocity_limit"]
        halted = table["watchdog"] == WATCHDOG_TRIPPED or table["operating_mode"] != EXTENDED_POSITION
        return MotorGoal(
            torque=table["torque"] == 1,
            goal=round(self.motor.trajectory) if halted else table["goal_position"] + self._lost_turns * _TICKS_PER_TURN,
            speed=speed * _VELOCITY_TICKS_S,
            acceleration=table["profile_acceleration"] * _ACCELERATION_TICKS_S2,
        )

    def _watch(self) -> None:
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
        """Somebody turns the horn by hand; he cannot while the torque is on."""
        if not self.table["torque"]:
            self.motor.position += ticks
            self._refresh()

    def freeze(self, frozen: bool) -> None:
        """Jam the horn, or free it; freed, it starts from where it is."""
        self.motor.frozen = frozen
        self.motor.stop()

    def grind(self, current_ma: float, *, ripples: bool = False) -> None:
        """Let the motor draw so much more than it needs, until this is 0 again; with ripples, not in every fifth 20 ms."""
        self._grinds_ma, self._ripples = current_ma, ripples

    def carry(self, ticks_s: float) -> None:
        """Let something stronger than the motor turn the horn, until this is 0 again."""
        self.motor.carried_ticks_s = ticks_s

    def heat(self, temperature_c: float) -> None:
        """Put the servo into surroundings of this temperature, long enough to have taken it on."""
        self.motor.ambient_c = self.motor.temperature_c = temperature_c

    def alert(self, bits: int) -> None:
        """Raise a hardware error, which stays until a restart."""
        self.table["hardware_error"] |= bits
        self._protect()

    def _has_shut_down(self) -> bool:
        return bool(self.table["hardware_error"] & self.table["shutdown"])

    def _refresh(self) -> None:
        """The registers that tell the present."""
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
