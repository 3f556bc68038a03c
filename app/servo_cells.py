"""What the servo table says, as texts with a tone: a bus status becomes seven rows, two tendon pairs and one line. No Qt here."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from app.cells import NONE, SIGN, Cell, Row, Tone, Track, number
from app.language import mark, tr, tr_text
from core.safety_config import SafetyConfig
from core.servo_config import JOINT_NAMES, JointConfig, JointName, ServosConfig
from core.types import RobotStatus
from hardware.servos.status_block import HardwareError, MissingServo, ServoReading, ServoState
from hardware.servos.units import wire_force_mn

if TYPE_CHECKING:
    from hardware.servos.bus_messages import BusStatus

SILENT_AFTER_S = 1.0
"""What the bus said longer ago is not true any more."""
_CYCLE_P99_LIMIT_MS = 30.0
_LONG_TRAVEL_MM = 50.0
_TRACK_STEPS = 200.0


class Column(Enum):
    """The columns in order: heading and explanation."""

    JOINT = (mark("Joint"), mark("Joint, and id of its servo on the bus"))
    POSITION = (
        mark("Position mm"),
        mark("Where the joint is, and where that is within its envelope; darker ends: there it is slowed down"),
    )
    GOAL = (mark("Goal mm"), mark("The goal that the servo has taken"))
    CURRENT = ("mA", mark("Motor current in mA"))
    TEMPERATURE = ("°C", mark("Temperature of the servo in °C"))
    VOLTAGE = ("V", mark("Supply voltage at the servo in V"))
    TORQUE = (mark("Torque"), mark("Whether the motor holds"))
    ZERO = (mark("Zero"), mark("Whether the joint has been zeroed since the servo was switched on"))
    ERROR = (mark("Error"), mark("What the servo reports, or that it does not answer"))


_ERROR_WORDS = {
    HardwareError.OVERLOAD: (mark("overload"), mark("overload: the motor was pulled too hard for too long; free the wire")),
    HardwareError.OVERHEATING: (mark("overheating"), mark("overheating: let the servo cool down")),
    HardwareError.INPUT_VOLTAGE: (mark("input voltage"), mark("input voltage out of range: check the power supply")),
    HardwareError.ELECTRICAL_SHOCK: (
        mark("electric shock"),
        mark("electric shock on the circuit, or too little power for the motor"),
    ),
    HardwareError.ENCODER: (mark("encoder"), mark("encoder: the servo does not know where it is; have it repaired")),
}


def error_words(error: HardwareError) -> str:
    """The error bits as a few words, worst first; empty when there is none."""
    words = [tr(short) for flag, (short, _) in _ERROR_WORDS.items() if error & flag]
    rest = int(error) & ~sum(int(flag) for flag in _ERROR_WORDS)
    return ", ".join(words + ([tr("error {number}", number=rest)] if rest else []))


def servo_rows(status: BusStatus | None, servos: ServosConfig, safety: SafetyConfig) -> tuple[Row, ...]:
    """Seven rows in the order of the joints, each with a cell for every column; dashes where nothing is known."""
    readings: tuple[ServoReading | None, ...] = status.servos if status is not None and status.servos else (None,) * 7
    zeroed: tuple[bool | None, ...] = status.zeroed if status is not None and status.servos else (None,) * 7
    armed = status is not None and status.armed
    rows = []
    for joint, reading, is_zeroed in zip(servos.joints, readings, zeroed, strict=True):
        if isinstance(reading, ServoState):
            rows.append(_known(joint, reading, bool(is_zeroed), armed, servos, safety))
        else:
            rows.append(_unknown(joint, reading))
    return tuple(rows)


def known_joints(status: BusStatus | None, now_s: float) -> tuple[bool, ...]:
    """Of which joints it is known where they are: those that are zeroed, and whose servo has answered lately.

    Without a bus it is known of all: such a robot tells it itself. `now_s` is monotonic, as ``BusStatus.time_s`` is.
    """
    if status is None:
        return (True,) * 7
    if not status.servos or now_s - status.time_s > SILENT_AFTER_S:
        return (False,) * 7
    return tuple(zeroed and isinstance(reading, ServoState) for reading, zeroed in zip(status.servos, status.zeroed, strict=True))


def status_by_servos(status: BusStatus | None) -> RobotStatus | None:
    """Where the robot is by its servos alone, for while no picture brings its status along; None when not all of them answer.

    What it says of a joint that is not zeroed is nothing that is known: see ``known_joints``.
    """
    states = [reading for reading in status.servos if isinstance(reading, ServoState)] if status is not None else []
    if status is None or len(states) != len(JOINT_NAMES):
        return None
    right, left, up, down, advance, first, second = (state.position_mm or 0.0 for state in states)
    return RobotStatus(status.time_s, advance, (first + second) / 2.0, (right, left, up, down), (0.0,) * 4)


def _known(joint: JointConfig, state: ServoState, zeroed: bool, armed: bool, servos: ServosConfig, safety: SafetyConfig) -> Row:
    hot, warm = servos.max_temperature_c, servos.max_temperature_c - safety.temperature_warn_margin_c
    low, sags = servos.min_voltage_v, servos.min_voltage_v + safety.voltage_warn_margin_v
    heat = Tone.BAD if state.temperature_c >= hot else Tone.WARN if state.temperature_c >= warm else Tone.PLAIN
    volts = Tone.BAD if state.voltage_v <= low else Tone.WARN if state.voltage_v <= sags else Tone.PLAIN
    most_ma = servos.max_current_ma
    strain = Tone.BAD if state.current_ma is not None and abs(state.current_ma) > most_ma else Tone.PLAIN
    error = _error(state)
    name = Cell(_name(joint), max(Tone.PLAIN, heat, volts, error.tone))
    return (
        name,
        _position(joint, state),
        Cell(_mm(joint, state.goal_mm), Tone.FAINT if not armed else Tone.PLAIN),
        Cell(NONE)
        if state.current_ma is None
        else _signed_cell(number(state.current_ma, 0), strain, tr("limit {most:g} mA for half a second", most=most_ma)),
        _signed_cell(f"{state.temperature_c:.0f}", heat, tr("warning from {warm:g} °C, limit {hot:g} °C", warm=warm, hot=hot)),
        _signed_cell(f"{state.voltage_v:.1f}", volts, tr("warning from {sags:g} V, limit {low:g} V", sags=sags, low=low)),
        Cell(tr("on"), Tone.PLAIN) if state.torque else _signed_cell(tr("off"), Tone.BAD if armed else Tone.FAINT),
        Cell(tr("yes"), Tone.PLAIN)
        if zeroed
        else _signed_cell(tr("no"), Tone.WARN, tr("zero the joint, with slack wires, before arming")),
        error,
    )


def _unknown(joint: JointConfig, reading: MissingServo | None) -> Row:
    blank = (Cell(NONE, Tone.FAINT),) * (len(Column) - 2)
    if reading is None:
        return (Cell(_name(joint), Tone.FAINT), *blank, Cell(NONE, Tone.FAINT))
    short = tr("restarted") if reading.restarted else tr("silent")
    tip = (
        tr("the servo restarted: zero its joint again")
        if reading.restarted
        else tr("{reason}, {misses} times in a row", reason=tr_text(reading.reason), misses=reading.misses)
    )
    return (Cell(_name(joint), Tone.BAD), *blank, Cell(short, Tone.BAD, tip))


def _position(joint: JointConfig, state: ServoState) -> Cell:
    at = state.position_mm
    if at is None:
        return Cell(NONE, Tone.FAINT, tr("not known before the joint is zeroed"))
    span = joint.high_mm - joint.low_mm
    margin = joint.warn_margin_mm
    if not joint.low_mm <= at <= joint.high_mm:
        tone = Tone.BAD
    else:
        tone = Tone.WARN if not joint.low_mm + margin <= at <= joint.high_mm - margin else Tone.PLAIN

    def share(mm: float) -> float:
        return round((mm - joint.low_mm) / span * _TRACK_STEPS) / _TRACK_STEPS

    track = Track(
        share(at),
        None if state.goal_mm is None else share(state.goal_mm),
        share(joint.low_mm + margin),
        share(joint.high_mm - margin),
    )
    tip = tr(
        "envelope {low_mm:g} to {high_mm:g} mm, slow within {margin:g} mm of its ends",
        low_mm=joint.low_mm,
        high_mm=joint.high_mm,
        margin=margin,
    )
    return Cell(SIGN[tone] + _mm(joint, at), tone, tip, track)


def _error(state: ServoState) -> Cell:
    if state.error:
        tips = [tr(long) for flag, (_, long) in _ERROR_WORDS.items() if state.error & flag]
        return Cell(error_words(state.error), Tone.BAD, "\n".join(tips) or tr("see the servo's manual: hardware error status"))
    if state.watchdog_tripped:
        return Cell(tr("bus watchdog"), Tone.BAD, tr("nobody talked to the servo: arm again"))
    return Cell(tr("none"), Tone.FAINT)


def _signed_cell(text: str, tone: Tone, tip: str = "") -> Cell:
    return Cell(SIGN[tone] + text, tone, tip)


def _name(joint: JointConfig) -> str:
    return f"{tr_text(joint.name).replace('_', ' ')} \N{MIDDLE DOT} {joint.id}"


def _mm(joint: JointConfig, value_mm: float | None) -> str:
    """Hundredths for a tendon, tenths for a feed: so much can be read, and matters."""
    return NONE if value_mm is None else number(value_mm, 1 if joint.high_mm - joint.low_mm > _LONG_TRAVEL_MM else 2)


@dataclass(frozen=True, slots=True)
class PairBalance:
    """Two wires that pull against each other. ``sum_mm`` of their pulls should be ``wanted_mm``, twice the pretension.

    None: not known. ``forces_n`` of the wires is told by the motors' currents, friction included.
    """

    names: tuple[JointName, JointName]
    wanted_mm: float
    sum_mm: float | None = None
    forces_n: tuple[float, float] | None = None
    tone: Tone = Tone.FAINT

    @property
    def share(self) -> float | None:
        """Excess over what is wanted: -1 no tension left, 0 as wanted, 1 twice as much."""
        if self.sum_mm is None:
            return None
        return (self.sum_mm - self.wanted_mm) / max(self.wanted_mm, 0.1)

    @property
    def word(self) -> str:
        if self.sum_mm is None or self.tone < Tone.WARN:
            return ""
        return tr("slack") if self.sum_mm < self.wanted_mm else tr("too tight")


def pair_balances(status: BusStatus | None, servos: ServosConfig) -> tuple[PairBalance, PairBalance]:
    """Right and left, up and down. Before arming nothing is pretensioned, so slack wires are no warning then."""
    first, second = (_balance(status, servos, place) for place in (0, 2))
    return first, second


def _balance(status: BusStatus | None, servos: ServosConfig, place: int) -> PairBalance:
    joints = servos.joints[place : place + 2]
    balance = PairBalance((joints[0].name, joints[1].name), 2.0 * servos.pretension_mm)
    states = [state for state in (status.servos[place : place + 2] if status is not None else ()) if isinstance(state, ServoState)]
    if status is None or len(states) < 2 or states[0].position_mm is None or states[1].position_mm is None:
        return balance
    one, other = (state.current_ma for state in states)
    forces = None
    if one is not None and other is not None:
        forces = wire_force_mn(joints[0], one) / 1000.0, wire_force_mn(joints[1], other) / 1000.0
    known = PairBalance(balance.names, balance.wanted_mm, states[0].position_mm + states[1].position_mm, forces, Tone.PLAIN)
    share = known.share or 0.0
    tone = Tone.PLAIN
    if status.armed and abs(share) > 0.5:
        tone = Tone.BAD if abs(share) >= 1.0 else Tone.WARN
    elif not status.armed:
        tone = Tone.FAINT
    return PairBalance(known.names, known.wanted_mm, known.sum_mm, known.forces_n, tone)


def bus_line(status: BusStatus | None, silence_s: float | None = None) -> Cell:
    """Phase, timing and counts of the bus in one line; `silence_s` is how long ago it was heard, when that is too long."""
    if status is None:
        return Cell(tr("no servo bus: nothing is known about the servos"), Tone.FAINT)
    if silence_s is not None:
        return Cell(tr("!! nothing heard from the servo bus for {seconds:.0f} s", seconds=silence_s), Tone.BAD)
    slow = status.times.period_p99_ms > _CYCLE_P99_LIMIT_MS
    timing = tr(
        "cycle {half:.1f} ms, {sign}p99 {most:.1f} ms",
        half=status.times.period_p50_ms,
        sign="! " if slow else "",
        most=status.times.period_p99_ms,
    )
    parts = [
        tr("bus {phase}", phase=tr_text(status.phase.value)),
        timing if status.times.period_p50_ms > 0.0 else tr("cycle not measured yet"),
        tr("bad packets {count}", count=status.bad_packets),
        tr("clamps {count}", count=status.clamp_count),
    ]
    whole = f"  {chr(0xB7)}  ".join(parts)
    tip = f"{whole}\n" + tr("cycle: half of the periods of the last ten seconds were shorter than the first, 99 % than p99")
    if broken := [
        f"{tr_text(r.name).replace('_', ' ')} {error_words(r.error)}"
        for r in status.servos
        if isinstance(r, ServoState) and r.error
    ]:
        return Cell(f"!! {'; '.join(broken)}", Tone.BAD, tip)  # for which a narrow table has no room
    return Cell(whole, Tone.WARN if slow else Tone.PLAIN, tip)
