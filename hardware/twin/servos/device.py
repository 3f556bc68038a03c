"""A software servo: answers, motion and force by its registers, protection, and its motor with current and heat.

Speed, stall current and torque are those of the model (``core/config/servo_models.py``), friction is that of an XM430-W350 at 12 V;
what a register does is as in the Robotis e-Manual.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from core.config.servo_models import SERVO_MODELS, ServoModel
from hardware.twin.servos.protocol import (
    ALERT,
    CURRENT_POSITION,
    POSITION,
    POSITION_MODES,
    RAM_START,
    WATCHDOG_TRIPPED,
    ControlTable,
    ErrorCode,
    Instruction,
)

TICKS_PER_TURN = 4096
_XM430 = SERVO_MODELS[1020]
MAX_TICKS_S = _XM430.no_load_rpm / 60.0 * TICKS_PER_TURN
"""No-load speed of an XM430-W350."""
STALL_MA = _XM430.stall_ma
GEAR_FRICTION_MNM = 233.0
"""Torque below which its gear holds without current: where the line of the performance graph (0.84 N m at 0.60 A, 2.45 N m at
1.50 A) ends at no current. Other models have the same share of their stall torque."""
_STAND_MA, _FRICTION_MA = 8.0, 40.0
"""Currents of a horn that stands without load, and that friction takes of one that turns: more than the 13 mA that a user saw
without load (DynamixelSDK issue 564), less than the 130 mA of the graph's line under load."""
_FULL_PWM = 885
"""Goal PWM(100) at the whole supply voltage."""
_P_GAIN_UNIT = 128.0
"""Position P Gain(84) over this: units of PWM (modes 3 and 4) or of current (mode 5) per tick of position error."""
_GAIN_MA = 800 / _P_GAIN_UNIT / _FULL_PWM * STALL_MA
"""Current of a blocked horn per tick of position error, as the servo comes: 16.2 mA."""
_OVERLOAD_SHARE, _OVERLOAD_S = 0.8, 1.0
_HEAT_C, _HEAT_TIME_S = 400.0, 180.0
"""Final rise of temperature at stall, and the time constant."""
_STANDS_TICKS = 1e-6
"""A horn that could move by less than this stands."""
_STEP_S = 0.002
_MAX_STEPS = 5000


@dataclass(slots=True)
class MotorGoal:
    """The motion that the registers ask for, in ticks, ticks/s, ticks/s^2; ``acceleration`` 0: unlimited.

    Attributes
    ----------
    limit_ma : the current never exceeds it, whatever blocks the horn.
    duty : share of the nominal voltage that the motor may get; it limits the speed.
    gain_ma : current per tick by which a horn that cannot follow is behind.
    """

    torque: bool = False
    goal: int = 0
    speed: float = MAX_TICKS_S
    acceleration: float = 0.0
    limit_ma: float = STALL_MA
    duty: float = 1.0
    gain_ma: float = _GAIN_MA


@dataclass(frozen=True, slots=True)
class ElasticWire:
    """A wire on the horn's drum that is taut beyond ``slack_ticks`` in the direction of ``sign``; torque in mN m per tick."""

    mnm_per_tick: float
    slack_ticks: float
    sign: int = 1

    def torque_mnm(self, position: float) -> float:
        """Torque against the positive direction."""
        return self.sign * self.mnm_per_tick * max(0.0, self.sign * (position - self.slack_ticks))


class ServoMotor:
    """The motor; its position in ticks is independent of what the servo counts.

    ``trajectory`` and ``velocity`` are those of the profile, ``position`` and ``horn_ticks_s`` those of the horn. A horn that can
    follow does so exactly (the lag of some ticks that a P controller leaves is left out); one that is frozen, or whose load needs
    more current than the limit, stays behind, and draws the current of its position error up to the limit.

    Attributes
    ----------
    load_mnm, wire : torque against the positive direction: constant, and of an elastic wire.
    gear_mnm : a load above this torque, beyond what the motor gives, turns the horn back.
    stall_ma, mnm_per_ma, max_ticks_s : the model's figures, of its winding at the recommended supply.
    grinds_ma : additional current as of a damaged gear.
    carried_ticks_s : a speed forced from outside.
    """

    def __init__(self, position: float, ambient_c: float = 25.0, model: ServoModel = _XM430) -> None:
        self.stall_ma, self.max_ticks_s = model.stall_ma, model.no_load_rpm / 60.0 * TICKS_PER_TURN
        self.mnm_per_ma = 1000.0 * model.stall_nm / model.stall_ma
        self.position = self.trajectory = position
        self.velocity = self.horn_ticks_s = 0.0
        self.ambient_c = ambient_c
        self.temperature_c = ambient_c
        self.load_mnm = 0.0
        self.wire: ElasticWire | None = None
        self.gear_mnm = GEAR_FRICTION_MNM * model.stall_nm / _XM430.stall_nm
        self.grinds_ma = self.carried_ticks_s = 0.0
        self.frozen = False
        self._overloaded_s = 0.0

    def step(self, drive: MotorGoal, duration_s: float) -> None:
        """Advance time; motion is limited to 10 s of it."""
        end_c = self.ambient_c + _HEAT_C * (self.current_ma(drive) / self.stall_ma) ** 2
        self.temperature_c += (end_c - self.temperature_c) * -math.expm1(-duration_s / _HEAT_TIME_S)
        strained = drive.torque and abs(self.current_ma(drive)) > _OVERLOAD_SHARE * self.stall_ma
        self._overloaded_s = self._overloaded_s + duration_s if strained else 0.0
        if self.carried_ticks_s:
            self.position += self.carried_ticks_s * duration_s
            self.stop()
            self.horn_ticks_s = self.carried_ticks_s
            return
        if not drive.torque:
            self.stop()
        steps = min(_MAX_STEPS, math.ceil(duration_s / _STEP_S - 1e-9))
        part_s = min(duration_s, _MAX_STEPS * _STEP_S) / max(1, steps)
        free = drive.torque and self._is_free(drive)
        for _ in range(steps):
            before = self.position
            at_goal = not drive.torque or (self.trajectory == drive.goal and self.velocity == 0.0)
            if not at_goal:
                self._move(drive, part_s)
            if not free:
                self._follow(drive, part_s)
            if at_goal and self.position == before:
                break
        if free:
            self.position, self.horn_ticks_s = self.trajectory, self.velocity
        if not drive.torque:
            self.trajectory = self.position

    def _is_free(self, drive: MotorGoal) -> bool:
        """Whether nothing can keep the horn from its trajectory."""
        load_ma = abs(self._load_ma())
        return (
            not self.frozen
            and self.wire is None
            and self.position == self.trajectory
            and load_ma + _FRICTION_MA + abs(self.grinds_ma) <= drive.limit_ma
            and min(drive.speed, self.max_ticks_s) <= self.max_ticks_s * (drive.duty - load_ma / self.stall_ma)
        )

    def _load_ma(self) -> float:
        """Current that the load takes, signed."""
        wire_mnm = self.wire.torque_mnm(self.position) if self.wire is not None else 0.0
        return (self.load_mnm + wire_mnm) / self.mnm_per_ma

    def _follow(self, drive: MotorGoal, part_s: float) -> None:
        """One step of the horn towards the trajectory as far as the current allows it, or back as far as the load turns it."""
        self.horn_ticks_s = 0.0
        if self.frozen:
            return
        lag, load_ma = self.trajectory - self.position, self._load_ma()
        way = math.copysign(1.0, lag)
        limit_ma = drive.limit_ma if drive.torque else 0.0
        spare_ma = limit_ma - _FRICTION_MA - abs(self.grinds_ma) - way * load_ma
        if lag and spare_ma >= 0.0:
            fastest = self.max_ticks_s * max(0.0, drive.duty - max(0.0, way * load_ma) / self.stall_ma)
            move = min(abs(lag), fastest * part_s)
            if self.wire is not None and self.wire.sign == way:
                slack = max(0.0, way * (self.wire.slack_ticks - self.position))
                move = min(move, slack + spare_ma * self.mnm_per_ma / self.wire.mnm_per_tick)
            if move > _STANDS_TICKS:
                self.position += way * move
                self.horn_ticks_s = way * move / part_s
            return
        excess_ma = load_ma - max(-limit_ma, min(limit_ma, drive.gain_ma * lag))
        beyond_ma = abs(excess_ma) - self.gear_mnm / self.mnm_per_ma
        if beyond_ma > 0.0:
            self.horn_ticks_s = -math.copysign(min(1.0, beyond_ma / self.stall_ma) * self.max_ticks_s, excess_ma)
            self.position += self.horn_ticks_s * part_s

    def _move(self, drive: MotorGoal, part_s: float) -> None:
        """One step along the profile, at the highest speed from which it can still brake in time."""
        way = drive.goal - self.trajectory
        fastest = min(drive.speed, self.max_ticks_s)
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
        self.trajectory, self.velocity, self.horn_ticks_s = self.position, 0.0, 0.0

    def current_ma(self, drive: MotorGoal) -> float:
        """Motor current by load, friction, and the position error of a horn that does not come nearer; at most the limit."""
        if not drive.torque:
            return 0.0
        lag = self.trajectory - self.position
        if lag * self.horn_ticks_s > 0.0:
            lag = 0.0  # its speed, not its load, keeps it behind
        moves = self.horn_ticks_s or self.velocity
        friction = math.copysign(_FRICTION_MA, moves) if moves else _STAND_MA
        grinding = math.copysign(self.grinds_ma, friction)
        current = self._load_ma() + friction + grinding + drive.gain_ma * lag
        return max(-drive.limit_ma, min(drive.limit_ma, current))

    @property
    def is_overloaded(self) -> bool:
        """Whether the current was too high for too long, at which the servo switches off."""
        return self._overloaded_s > _OVERLOAD_S


# Units of the registers.
_VELOCITY_TICKS_S = 0.229 / 60.0 * TICKS_PER_TURN
_ACCELERATION_TICKS_S2 = 214.577 / 3600.0 * TICKS_PER_TURN
_WATCHDOG_S = _RIPPLE_S = 0.02
REBOOT_S = 0.3
_TORQUE_AT_START, _RAM_RESTORE = 1, 2
"""Bits of Startup Configuration(60)."""
_OUTPUT_LIMITS = (("goal_pwm", "pwm_limit"), ("goal_current", "current_limit"))
_GAINS = ("velocity_i_gain", "velocity_p_gain", "position_d_gain", "position_i_gain", "position_p_gain", "feedforward_2nd",
          "feedforward_1st")  # fmt: skip
VOLTAGE_BIT, HEAT_BIT, OVERLOAD_BIT = 1, 4, 32


@dataclass(frozen=True, slots=True)
class StatusReply:
    """Error byte and data of a status packet."""

    error: int
    data: bytes = b""


class SoftServo:
    """A servo of the X series with its horn at `position` ticks.

    Time advances by ``advance``; the bus watchdog counts from the last ``feed_watchdog``. What a test may do to it:

    - ``table[name]`` sets any register, as its EEPROM may have come from another program (``"startup"``, ``"shutdown"``,
      ``"secondary_id"``, ``"firmware"``, ``"temperature_limit"``, ``"current_limit"`` ...). ``backup`` stores the backup that bit 1
      of ``startup`` restores.
    - ``restart``: RAM and turns are lost. ``alert``, ``heat``, ``supply_v``.
    - ``freeze`` blocks the horn; ``motor.load_mnm`` and ``motor.wire`` load it; ``motor.gear_mnm`` is what the gear holds without
      current; ``grind``, ``carry``, ``turn``.
    - ``current_ma`` and ``torque_mnm`` tell what the motor gives at the moment, ``mechanical_ticks`` where the horn really is.

    Modes 3, 4 and 5 move; the others (0, 1, 16) hold still. Forces: in modes 3 and 4 Goal PWM(100) alone limits the current, in
    mode 5 also Goal Current(102); Current Limit(38) and PWM Limit(36) limit what those registers take, and their values after a
    restart or a change of the mode.
    """

    def __init__(self, servo_id: int, model: int, position: int, baud_code: int = 3) -> None:
        self.id = servo_id
        self.model = kind = SERVO_MODELS[model]
        self.table = ControlTable(kind)
        self.table["temperature_limit"] = round(kind.max_temperature_c)
        self.table["min_voltage_limit"] = round(10.0 * min(kind.supply_v[0], 0.8 * kind.recommended_v))
        self.table["max_voltage_limit"] = round(10.0 * max(kind.supply_v[1], 1.2 * kind.recommended_v))
        self.table["id"] = servo_id
        self.table["model_number"] = model
        self.table["baud_rate"] = baud_code
        self.motor = ServoMotor(float(position), model=kind)
        self.supply_v = self._nominal_v = kind.recommended_v
        self._current_unit_ma = kind.current_unit_ma or kind.stall_ma / 1000.0  # else a load in 0.1 %
        self._grinds_ma, self._ripples = 0.0, False
        self._lost_turns = 0
        self._heard_s = 0.0
        self._now_s = self._started_s = 0.0
        self._silent_until_s: float | None = None
        self._backup: dict[str, int] | None = None
        self.restart(silent_s=0.0)

    @property
    def mechanical_ticks(self) -> float:
        """True position of the horn, independent of what the servo counts."""
        return self.motor.position

    @property
    def current_ma(self) -> float:
        """Current of the motor's winding, signed."""
        return self.motor.current_ma(self._drive())

    @property
    def told_ma(self) -> float:
        """The current that register 126 rounds: of the 330 size that of the supply, which is the winding's times the duty."""
        current_ma = self.current_ma
        return current_ma * min(1.0, self._duty(current_ma)) if self.model.is_small else current_ma

    def _duty(self, current_ma: float) -> float:
        """Share of the supply that the winding gets."""
        motor = self.motor
        share = abs(current_ma) / motor.stall_ma + abs(motor.horn_ticks_s) / motor.max_ticks_s
        return share * self._nominal_v / max(self.supply_v, 1.0)

    @property
    def torque_mnm(self) -> float:
        """Torque of the motor at the horn, signed, its friction included; 0 without torque."""
        return self.current_ma * self.motor.mnm_per_ma

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
        """Power-up: reset RAM and turn count, and do not answer for a while.

        Startup Configuration(60) may bring parts of the RAM back from the backup (the indirect addresses among them), and switch
        the torque on.
        """
        table = self.table
        table.reset_ram()
        for goal, limit in _OUTPUT_LIMITS:
            table[goal] = table[limit]
        startup = table["startup"] if table["firmware"] >= table.startup_since else 0
        if startup & _RAM_RESTORE and self._backup is not None:
            for name in table.backed_up:
                table[name] = self._backup[name]
        self.motor.stop()
        self.motor.step(MotorGoal(), 0.0)
        self._forget_turns()
        table["goal_position"] = self._count(self.motor.position)
        table["torque"] = startup & _TORQUE_AT_START
        self._started_s = self._now_s
        self._silent_until_s = self._now_s + silent_s if silent_s > 0.0 else None
        self._refresh()

    def backup(self) -> None:
        """Store gains, profile and indirect addresses, as another program may have done (instruction Control Table Backup)."""
        self._backup = {name: self.table[name] for name in self.table.backed_up}

    def _forget_turns(self) -> None:
        """Count from within one turn from now on."""
        self._lost_turns = int(self.motor.position // TICKS_PER_TURN)

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

    def obey(self, address: int, data: bytes) -> None:
        """A write to its Secondary ID(12): the RAM obeys, and there is no answer."""
        if address >= RAM_START:
            self._write(address, data)

    def answers_to(self, instruction: int) -> bool:
        """Whether its status return level lets it answer."""
        level = self.table["status_return"]
        return instruction == Instruction.PING or level == 2 or (level == 1 and instruction == Instruction.READ)

    def _reply(self, error: ErrorCode, data: bytes = b"") -> StatusReply:
        return StatusReply(error | (ALERT if self.table["hardware_error"] else 0), data)

    def _write(self, address: int, data: bytes) -> ErrorCode:
        torque, mode = self.table["torque"], self.table["operating_mode"]
        if address == 64 and data == b"\1" and self._has_shut_down():
            return ErrorCode.RESULT_FAIL  # only a restart clears a hardware error
        error, written = self.table.write(address, data)
        if error:
            return error
        if "torque" in written and self.table["torque"] and not torque:
            if mode == POSITION:
                self._forget_turns()
            self.motor.stop()  # it then moves to whatever the goal register has
        if "watchdog" in written:
            self.feed_watchdog()
        if self.table["operating_mode"] != mode:
            self._change_mode()
        for goal, limit in _OUTPUT_LIMITS:
            if limit in written:
                self.table[goal] = max(-self.table[limit], min(self.table[limit], self.table[goal]))
        self._refresh()
        return ErrorCode.NONE

    def _change_mode(self) -> None:
        """What a new Operating Mode(11) resets: turns, profile, gains, and the limits of PWM and current."""
        self._forget_turns()
        for name in ("profile_velocity", "profile_acceleration", *_GAINS):
            self.table.reset(name)
        for goal, limit in _OUTPUT_LIMITS:
            self.table[goal] = self.table[limit]

    def _count(self, mechanical: float) -> int:
        return round(mechanical) - self._lost_turns * TICKS_PER_TURN

    def _drive(self) -> MotorGoal:
        table, mode = self.table, self.table["operating_mode"]
        # the small motor runs on
        halted = (table["watchdog"] == WATCHDOG_TRIPPED and not self.model.is_small) or mode not in POSITION_MODES
        volts = self.supply_v / self._nominal_v
        duty = abs(table["goal_pwm"]) / _FULL_PWM * volts
        gain = table["position_p_gain"] / _P_GAIN_UNIT
        by_current = mode == CURRENT_POSITION
        stall_ma, goal_ma = self.motor.stall_ma, abs(table["goal_current"]) * self._current_unit_ma
        if (
            self.model.is_small
        ):  # it limits the current of the supply: the winding's times a duty that is its share of the stall current
            goal_ma = math.sqrt(goal_ma * stall_ma * volts)
        return MotorGoal(
            torque=table["torque"] == 1,
            goal=round(self.motor.trajectory) if halted else table["goal_position"] + self._lost_turns * TICKS_PER_TURN,
            speed=(table["profile_velocity"] or table["velocity_limit"]) * _VELOCITY_TICKS_S,
            acceleration=table["profile_acceleration"] * _ACCELERATION_TICKS_S2,
            limit_ma=min(duty * stall_ma, goal_ma if by_current else math.inf),
            duty=duty,
            gain_ma=gain * self._current_unit_ma if by_current else gain / _FULL_PWM * stall_ma * volts,
        )

    def _check_watchdog(self) -> None:
        limit = self.table["watchdog"]
        if self.table["torque"] and limit > 0 and self._now_s - self._heard_s > limit * _WATCHDOG_S:
            self.table["watchdog"] = WATCHDOG_TRIPPED
            if self.model.is_small:
                return
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
        limit, pwm = abs(table["goal_pwm"]), round(math.copysign(_FULL_PWM * self._duty(self.current_ma), self.current_ma))
        table["present_pwm"] = max(-limit, min(limit, pwm)) if table["torque"] else 0
        table["present_position"] = self._count(motor.position)
        table["position_trajectory"] = self._count(motor.trajectory)
        table["present_velocity"] = round(motor.horn_ticks_s / _VELOCITY_TICKS_S)
        table["velocity_trajectory"] = round(motor.velocity / _VELOCITY_TICKS_S)
        table["present_current"] = round(self.told_ma / self._current_unit_ma)
        table["moving"] = int(motor.horn_ticks_s != 0.0)
        table["temperature"] = round(motor.temperature_c)
        table["voltage"] = round(10.0 * self.supply_v)
        table["tick_ms"] = int((self._now_s - self._started_s) * 1000.0) % 32768
