"""Faults 21 to 28, 44 and 45: the servos and their line. Always over a pseudo-terminal, with the real driver in its own process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from app.faults.bench import FaultBench, open_bench
from app.faults.judge import Wanted, judge, mark
from app.faults.registry import CampaignError, Kit, Seen, fault
from core.control.alerts import Note
from core.control.faults import Cause
from core.control.modes import Act, Mode
from hardware.servos.bus_messages import BusPhase, BusStatus
from hardware.servos.errors import WrongServo
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.servo_bus import SoftServoBus
from hardware.twin.servo_device import OVERLOAD_BIT, SoftServo

_DISARM, _STOP, _HELD = (Mode.ADVISORY,), (Mode.STOPPED,), (Mode.HOLD, Mode.ADVISORY)
_ADVANCE = 5
_CARRIED_TICKS_S = 1000.0
"""Some 10 mm/s of a joint."""


def _line(bench: FaultBench) -> SoftServoBus:
    assert bench.bus is not None
    return bench.bus


def _status(bench: FaultBench) -> BusStatus | None:
    return bench.robot.bus_status() if isinstance(bench.robot, ServoRobot) else None


def _servo_fault(
    kit: Kit,
    inject: Callable[[FaultBench], object],
    path: tuple[Mode, ...],
    cause: Cause,
    *more: Cause,
    alternatives: tuple[tuple[Mode, ...], ...] = (),
    release: Callable[[FaultBench], object] = lambda bench: None,
    **options: Any,
) -> Seen:
    """Hand over, break something, wait until the pilot has left autonomy; the servos must hold and nothing may be sent any more.

    `release` ends what moves the servos from outside.
    """
    with open_bench(kit, live=True, **options) as bench:
        start = mark(bench.hand_over())
        inject(bench)
        bench.until(lambda view: view.mode is path[-1])
        release(bench)
        bench.run(0.4)
        wanted = Wanted(path, (cause, *more), cause, alternatives=((Mode.HOLD, *path), *alternatives), may_hold=True)
        return judge(bench, start, wanted, *_still(bench))


def _still(bench: FaultBench) -> list[str]:
    """Nothing is armed any more, and the servos stand."""
    status = _status(bench)
    problems = ["the bus process is still armed"] if status is not None and status.phase is BusPhase.ARMED else []
    before = _line(bench).positions_mm()
    bench.run(0.3)
    after = _line(bench).positions_mm()
    moved_mm = max(abs(a - b) for a, b in zip(before, after, strict=True))
    return problems + ([f"a servo still moves, by {moved_mm:.2f} mm"] if moved_mm > 0.05 else [])


@fault(
    21,
    "one servo silent",
    injected="the advance servo hears and obeys, but does not answer",
    wanted="after 3 misses DISARM of all seven",
    quick=False,
)
def silent(kit: Kit) -> Seen:
    return _servo_fault(kit, lambda bench: _line(bench).faults.mute(_ADVANCE), _DISARM, Cause.SERVO_SILENT)


@fault(
    22,
    "CRC, garbage, short packet",
    injected="one damaged answer of each kind; then forty with a wrong CRC",
    wanted="one retry each, at most a short hold; more than 5 in a second: DISARM; nothing breaks",
    quick=False,
)
def noise(kit: Kit) -> Seen:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())
        faults = _line(bench).faults
        spoils: tuple[Callable[[], object], ...]
        spoils = (partial(faults.crc, 1), partial(faults.garbage, 24), partial(faults.short, 3), partial(faults.truncate, 2))
        for spoil in spoils:
            spoil()
            bench.run(0.45)
        single = bench.mode
        faults.crc(40)
        bench.until(lambda view: view.mode is Mode.ADVISORY)
        bench.run(0.3)
        problems = [] if single in {Mode.AUTONOMOUS, Mode.HOLD} else [f"single bad packets already led to {single}"]
        status = _status(bench)
        problems += [] if status is not None and status.line.retries >= 3 else ["there was no retry"]
        return judge(
            bench,
            start,
            Wanted(_DISARM, (Cause.BUS_NOISE,), Cause.BUS_NOISE, alternatives=(_HELD,), may_hold=True),
            *problems,
            *_still(bench),
        )


@fault(
    23,
    "overload alert",
    injected="a servo raises its hardware error bit for overload",
    wanted="register 70 is read: STOP",
    quick=False,
)
def overload(kit: Kit) -> Seen:
    return _servo_fault(kit, lambda bench: _line(bench).stir(3, lambda servo: servo.alert(OVERLOAD_BIT)), _STOP, Cause.SERVO_ALERT)


@fault(
    24,
    "over-temperature, under-voltage",
    injected="a servo is warmed up, then heated; on another bench the supply sags, then falls",
    wanted="first a warning, then DISARM, before the servo shuts itself down",
    quick=False,
)
def supply(kit: Kit) -> Seen:
    def drop(servo: SoftServo, volts: float) -> None:
        servo.supply_v = volts

    def heat(bench: FaultBench) -> None:
        _line(bench).stir(2, lambda servo: servo.heat(67.0))
        _expect(bench, Cause.WARM)
        _line(bench).stir(2, lambda servo: servo.heat(72.0))

    def sag(bench: FaultBench) -> None:
        for supply_v in (10.8, 10.3):
            for joint in bench.config.servos.joints:
                _line(bench).stir(joint.id, partial(drop, volts=supply_v))
            if supply_v > 10.5:
                _expect(bench, Cause.VOLTAGE_SAGS)

    return _on_benches(
        kit,
        ("heat", lambda part: _servo_fault(part, heat, _DISARM, Cause.HOT, Cause.WARM)),
        ("supply", lambda part: _servo_fault(part, sag, _DISARM, Cause.VOLTAGE_LOW, Cause.VOLTAGE_SAGS)),
    )


def _on_benches(kit: Kit, *parts: tuple[str, Callable[[Kit], Seen]]) -> Seen:
    """Several kinds of a fault, each on a bench of its own, told as one."""
    found = []
    for name, inject in parts:
        part = Kit(kit.folder / name, kit.live)
        part.folder.mkdir()
        seen = inject(part)
        found.append(replace(seen, reaction=f"{name}: {seen.reaction}"))
    return Seen(
        "; ".join(seen.reaction for seen in found),
        tuple(text for seen in found for text in seen.alerts),
        tuple(dict.fromkeys(text for seen in found for text in seen.events)),
        tuple(text for seen in found for text in seen.problems),
    )


def _expect(bench: FaultBench, cause: Cause) -> None:
    """A warning comes, and the program drives on."""
    if not bench.until(lambda view: any(fault.cause is cause for fault in view.active)):
        raise CampaignError(f"no warning: {cause}")


@fault(
    25,
    "tracking error, jam, slack wire",
    injected="the advance servo's horn is blocked while the program feeds; on another bench it is pulled back; on a third it drifts"
    " while nobody drives",
    wanted="STOP after 200 ms beyond the envelope",
    quick=False,
)
def jam(kit: Kit) -> Seen:
    def block(bench: FaultBench) -> None:
        _line(bench).stir(_ADVANCE, lambda servo: servo.freeze(True))

    def pull(bench: FaultBench) -> None:
        _line(bench).stir(_ADVANCE, lambda servo: servo.carry(-_CARRIED_TICKS_S))

    return _on_benches(
        kit,
        ("jam", lambda part: _servo_fault(part, block, _STOP, Cause.TRACKING)),
        ("pulled", lambda part: _servo_fault(part, pull, _STOP, Cause.TRACKING, release=_release)),
        ("drift", _drift),
    )


def _release(bench: FaultBench) -> None:
    _line(bench).stir(_ADVANCE, lambda servo: servo.carry(0.0))


def _drift(kit: Kit) -> Seen:
    """Armed, and the operator's hand at rest."""
    with open_bench(kit, live=True) as bench:
        bench.arm()
        bench.run(0.3)
        start = mark(bench)
        _line(bench).stir(_ADVANCE, lambda servo: servo.carry(_CARRIED_TICKS_S / 4))
        bench.until(lambda view: view.mode is Mode.STOPPED)
        _release(bench)
        bench.run(0.4)
        return judge(bench, start, Wanted(_STOP, (Cause.TRACKING,), Cause.TRACKING), *_still(bench))


@fault(
    44,
    "too much current",
    injected="the advance servo draws 1.5 A for 100 ms; then 0.9 A for good, with a ripple to nothing for a fifth of the time",
    wanted="the first is no fault; the second STOPs after half a second",
    quick=False,
)
def strain(kit: Kit) -> Seen:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())

        _line(bench).stir(_ADVANCE, lambda servo: servo.grind(1500.0))
        bench.run(0.1)
        _line(bench).stir(_ADVANCE, lambda servo: servo.grind(0.0))
        bench.run(0.7)
        peak = bench.mode
        _line(bench).stir(_ADVANCE, lambda servo: servo.grind(900.0, ripples=True))
        bench.until(lambda view: view.mode is Mode.STOPPED)
        bench.run(0.3)
        problems = [f"a peak already led to {peak}"] if peak not in {Mode.AUTONOMOUS, Mode.HOLD} else []
        return judge(
            bench,
            start,
            Wanted(_STOP, (Cause.STRAINED,), Cause.STRAINED, alternatives=((Mode.HOLD, *_STOP),), may_hold=True),
            *problems,
            *_still(bench),
        )


@fault(
    45,
    "torque-off not proven",
    injected="the torque is to go off at STOP; it is pressed while one servo obeys but does not answer, which it does 0.6 s later",
    wanted="STOP; told at once that the torque is not proven to be off, tried again, and told when all servos have said so",
    quick=False,
)
def torque_stays(kit: Kit) -> Seen:
    with open_bench(kit, live=True, servos={"torque_off_on_stop": True}) as bench:
        start = mark(bench.hand_over())
        _line(bench).faults.mute(_ADVANCE)
        bench.pilot.ask(Act.STOP)
        bench.until(lambda view: any(fault.cause is Cause.TORQUE_ON for fault in view.active))
        bench.run(0.6)
        early = [alert for alert in bench.alerts[start.alerts :] if alert.key is Note.TORQUE_OFF]
        _line(bench).faults.mute(_ADVANCE, False)
        bench.until(lambda view: all(fault.cause is not Cause.TORQUE_ON for fault in view.active))
        bench.run(0.3)
        problems = ["said to be off before the silent servo had said so"] if early else []
        problems += [
            f"the torque of {joint.name} is on"
            for joint in bench.config.servos.joints
            if _line(bench).servo(joint.id).table["torque"]
        ]
        wanted = Wanted(_STOP, (Cause.STOP_PRESSED, Cause.TORQUE_ON), Cause.STOP_PRESSED, alerts=(Note.TORQUE_OFF,), may_hold=True)
        return judge(bench, start, wanted, *problems)


@fault(
    26,
    "USB serial vanishes",
    injected="the pseudo-terminal is closed, and comes back two seconds later",
    wanted="STOP; opened again and checked by itself, never armed by itself",
    quick=False,
)
def vanished(kit: Kit) -> Seen:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())
        _line(bench).vanish()
        bench.until(lambda view: view.mode is Mode.STOPPED)
        bench.run(2.0)
        _line(bench).reappear()
        back = bench.until(lambda view: (status := _status(bench)) is not None and status.phase is not BusPhase.CLOSED)
        bench.run(1.0)
        status = _status(bench)
        problems = [] if back else ["the port was not opened again"]
        problems += ["it was armed again by itself"] if status is not None and status.armed else []
        problems += ["the servos count as switched on"] if bench.view.servos_on else []
        problems += ["joints count as zeroed although nobody watched them"] if status is not None and any(status.zeroed) else []
        return judge(
            bench,
            start,
            Wanted(_STOP, (Cause.PORT_LOST,), Cause.PORT_LOST, alternatives=((Mode.HOLD, *_STOP),), may_hold=True),
            *problems,
        )


@fault(
    27,
    "servo rebooted",
    injected="a servo loses its power for a moment: RAM and turn count are gone",
    wanted="DISARM, latched; it must be zeroed before it can be armed",
    quick=False,
)
def rebooted(kit: Kit) -> Seen:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())
        _line(bench).stir(4, lambda servo: servo.restart())
        bench.until(lambda view: view.mode is Mode.ADVISORY)
        bench.run(0.8)
        status = _status(bench)
        problems = ["its joint still counts as zeroed"] if status is not None and status.zeroed[3] else []
        # which of the two is seen first depends on when the read falls: it is silent while it boots
        latched = bench.view.latched.cause if bench.view.latched is not None else None
        problems += [] if latched in {Cause.REBOOTED, Cause.SERVO_SILENT} else [f"latched is {latched or 'nothing'}"]
        said = {alert.key for alert in bench.alerts[start.alerts :]} & {Cause.REBOOTED, Cause.SERVO_SILENT}
        problems += [] if said else ["no alert"]
        wanted = Wanted(_DISARM, (Cause.REBOOTED,), silent=(Cause.REBOOTED,), alternatives=(_HELD,), may_hold=True)
        seen = judge(bench, start, wanted, *problems)
        bench.pilot.ask(Act.ACKNOWLEDGE)
        bench.run(0.2)
        bench.pilot.switch_on()
        bench.until(lambda view: any(fault.cause is Cause.SERVOS_WRONG for fault in view.active) or view.servos_on)
        wrong = next((fault.detail for fault in bench.view.active if fault.cause is Cause.SERVOS_WRONG), "")
        more = () if "zero" in wrong else ("it could be switched on without a new zero",)
        return replace(seen, problems=(*seen.problems, *more))


@fault(
    28,
    "wrong id, model, mode",
    injected="a servo with another model number; one with another id inside; one whose mode is altered while it stands by",
    wanted="named; the rig does not open, or the servos cannot be switched on: nothing to arm",
    quick=False,
)
def wrong_servo(kit: Kit) -> Seen:
    said = [_refused(kit, "model_number", 1060), _refused(kit, "id", 9)]
    with open_bench(kit, live=True) as bench:
        start = mark(bench)
        _line(bench).stir(6, lambda servo: servo.table.__setitem__("operating_mode", 1))
        bench.pilot.switch_on()
        bench.until(lambda view: any(f.cause is Cause.SERVOS_WRONG for f in view.active) or view.servos_on)
        said.append(next((fault.detail for fault in bench.view.active if fault.cause is Cause.SERVOS_WRONG), ""))
        bench.pilot.ask(Act.ARM)
        bench.run(0.2)
        problems = ["the servos could be switched on"] if bench.view.servos_on else []
        problems += ["not refused by name" for text in said if not text]
        seen = judge(bench, start, Wanted((), (Cause.SERVOS_WRONG,)), *problems)
        return replace(seen, reaction="; ".join(said))


def _refused(kit: Kit, register: str, value: int) -> str:
    """What the driver says at the opening of a rig with one altered servo; empty when it says nothing."""
    part = Kit(kit.folder / register, kit.live)
    part.folder.mkdir()
    try:
        with open_bench(part, live=True, before_open=lambda bus: bus.servo(2).table.__setitem__(register, value)):
            return ""
    except WrongServo as error:
        return str(error)
