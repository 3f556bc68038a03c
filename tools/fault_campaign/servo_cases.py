"""Faults 21 to 29, 32, 44 and 45: servos and bus. Always over a pseudo-terminal, with the real driver in its own process."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from core.config.safety import JointConfig, ServosConfig
from core.control.alerts import Note
from core.control.faults import Cause
from core.control.modes import Act, Mode
from hardware.servos.bus_ipc import BusPhase, BusStatus
from hardware.servos.dynamixel_bus import TORQUE
from hardware.servos.dynamixel_port import WrongServo
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.servos.device import OVERLOAD_BIT, SoftServo
from tools.fault_campaign.bench import ExpectedReaction, FaultBench, bench_fault, is_active, judge, open_bench
from tools.fault_campaign.children import read_line, start_child
from tools.fault_campaign.registry import CampaignError, Kit, Observation, check, fault, run_parts
from tools.kill_campaign import KINDS, strike

_DISARM, _STOP, _HELD = (Mode.ADVISORY,), (Mode.STOPPED,), (Mode.HOLD, Mode.ADVISORY)
_ADVANCE = 5  # id of the advance servo
_CARRIED_TICKS_S = 1000.0  # about 10 mm/s of a joint
_BOUND_S = 1.0  # patience with a stopped application (0.5 s), a hold, and a machine that has other things to do
_STEP_SLACK = 1.05
_MOVING_MM = 0.1  # of the fastest servo in the 100 ms before a strike


def _status(bench: FaultBench) -> BusStatus:
    assert isinstance(bench.robot, ServoRobot)
    status = bench.robot.bus_status()
    if status is None:
        raise CampaignError("the bus process has reported nothing")
    return status


def _moving(bench: FaultBench) -> list[str]:
    """What is still armed, or moves."""
    armed = _status(bench).phase is BusPhase.ARMED
    before = bench.bus.positions_mm()
    bench.run(0.3)
    moved_mm = max(abs(a - b) for a, b in zip(before, bench.bus.positions_mm(), strict=True))
    return check((not armed, "the bus process is still armed"), (moved_mm <= 0.05, f"a servo still moves, by {moved_mm:.2f} mm"))


def _expect(path: tuple[Mode, ...], cause: Cause, *more: Cause) -> ExpectedReaction:
    return ExpectedReaction(path, (cause, *more), cause, alternatives=((Mode.HOLD, *path),), may_hold=True)


def _await_end(bench: FaultBench, mode: Mode, release: Callable[[], object] = lambda: None) -> list[str]:
    """Wait until the pilot has left autonomy, end what moves the servos from outside, and see that they stand."""
    bench.until_mode(mode)
    release()
    bench.run(0.4)
    return _moving(bench)


def _run(kit: Kit, inject: Callable[[FaultBench], list[str]], expected: ExpectedReaction) -> Observation:
    with open_bench(kit, live=True) as bench:
        bench.hand_over().mark()
        return judge(bench, expected, *inject(bench))


def _held(kit: Kit, inject: Callable[[FaultBench], list[str]]) -> Observation:
    """A servo that is held stops all by its way or by its current, whichever limit comes first."""
    with open_bench(kit, live=True) as bench:
        bench.hand_over().mark()
        problems = inject(bench)
        cause = Cause.STRAINED if bench.latched is Cause.STRAINED else Cause.TRACKING
        return judge(bench, _expect(_STOP, cause), *problems)


servo_fault = partial(bench_fault, live=True)


@servo_fault(21, _expect(_DISARM, Cause.SERVO_SILENT))
def silent(bench: FaultBench) -> list[str]:
    bench.bus.faults.mute(_ADVANCE)
    return _await_end(bench, Mode.ADVISORY)


@servo_fault(22, _expect(_DISARM, Cause.BUS_NOISE))
def noise(bench: FaultBench) -> list[str]:
    faults = bench.bus.faults
    spoils: tuple[Callable[[], object], ...]
    spoils = (partial(faults.crc, 1), partial(faults.garbage, 24), partial(faults.short, 3), partial(faults.truncate, 2))
    for spoil in spoils:
        spoil()
        bench.run(0.45)
    single = bench.mode
    faults.crc(40)
    bench.until_mode(Mode.ADVISORY)
    bench.run(0.3)
    problems = check(
        (single in {Mode.AUTONOMOUS, Mode.HOLD}, f"single bad packets already led to {single}"),
        (_status(bench).line.retries >= 3, "there was no retry"),
    )
    return problems + _moving(bench)


@servo_fault(23, _expect(_STOP, Cause.SERVO_ALERT))
def overload(bench: FaultBench) -> list[str]:
    bench.bus.modify_servo(3, lambda servo: servo.alert(OVERLOAD_BIT))
    return _await_end(bench, Mode.STOPPED)


@fault(24)
def supply(kit: Kit) -> Observation:
    def await_warning(bench: FaultBench, cause: Cause) -> None:
        if not bench.until_active(cause):
            raise CampaignError(f"no warning: {cause}")

    def heat(bench: FaultBench) -> list[str]:
        bench.bus.modify_servo(2, lambda servo: servo.heat(67.0))
        await_warning(bench, Cause.WARM)
        bench.bus.modify_servo(2, lambda servo: servo.heat(72.0))
        return _await_end(bench, Mode.ADVISORY)

    def set_supply(bench: FaultBench, volts: float, joints: Sequence[JointConfig]) -> None:
        def set_volts(servo: SoftServo) -> None:
            servo.supply_v = volts

        for joint in joints:
            bench.bus.modify_servo(joint.id, set_volts)

    def sag(bench: FaultBench) -> list[str]:
        set_supply(bench, 10.8, bench.config.servos.joints)
        await_warning(bench, Cause.VOLTAGE_SAGS)
        set_supply(bench, 10.3, bench.config.servos.joints[-1:])  # at all of them it would be the E-stop
        return _await_end(bench, Mode.ADVISORY)

    return run_parts(
        kit,
        ("heat", partial(_run, inject=heat, expected=_expect(_DISARM, Cause.HOT, Cause.WARM))),
        ("supply", partial(_run, inject=sag, expected=_expect(_DISARM, Cause.VOLTAGE_LOW, Cause.VOLTAGE_SAGS))),
    )


@fault(25)
def jam(kit: Kit) -> Observation:
    def carry(bench: FaultBench, ticks_s: float) -> None:
        bench.bus.modify_servo(_ADVANCE, lambda servo: servo.carry(ticks_s))

    def block(bench: FaultBench) -> list[str]:
        bench.bus.modify_servo(_ADVANCE, lambda servo: servo.freeze(True))
        return _await_end(bench, Mode.STOPPED)

    def pull(bench: FaultBench, ticks_s: float = -_CARRIED_TICKS_S) -> list[str]:
        carry(bench, ticks_s)
        return _await_end(bench, Mode.STOPPED, lambda: carry(bench, 0.0))

    def drift(kit: Kit) -> Observation:
        """Armed, with the operator's controls at rest."""
        with open_bench(kit, live=True) as bench:
            bench.arm()
            bench.run(0.3)
            bench.mark()
            problems = pull(bench, _CARRIED_TICKS_S / 4)
            return judge(bench, ExpectedReaction(_STOP, (Cause.TRACKING,), Cause.TRACKING), *problems)

    return run_parts(kit, ("jam", partial(_held, inject=block)), ("pulled", partial(_held, inject=pull)), ("drift", drift))


@servo_fault(44, _expect(_STOP, Cause.STRAINED))
def strain(bench: FaultBench) -> list[str]:
    """The feed's 30 N are 105 mA, of which its friction takes 40: it still moves, with nearly all that it may give."""
    bench.bus.modify_servo(_ADVANCE, lambda servo: servo.grind(60.0))
    bench.run(0.1)
    bench.bus.modify_servo(_ADVANCE, lambda servo: servo.grind(0.0))
    bench.run(0.7)
    peak = bench.mode
    bench.bus.modify_servo(_ADVANCE, lambda servo: servo.grind(60.0, ripples=True))
    bench.until_mode(Mode.STOPPED)
    bench.run(0.3)
    return check((peak in {Mode.AUTONOMOUS, Mode.HOLD}, f"a peak already led to {peak}")) + _moving(bench)


@servo_fault(
    45,
    ExpectedReaction(_STOP, (Cause.STOP_PRESSED, Cause.TORQUE_ON), Cause.STOP_PRESSED, alerts=(Note.TORQUE_OFF,), may_hold=True),
    servos={"torque_off_on_stop": True},
)
def torque_stays(bench: FaultBench) -> list[str]:
    bench.bus.faults.mute(_ADVANCE)
    bench.pilot.stop()
    bench.until_active(Cause.TORQUE_ON)
    bench.run(0.6)
    early = any(alert.key is Note.TORQUE_OFF for alert in bench.alerts_since_mark)
    bench.bus.faults.mute(_ADVANCE, False)
    bench.until(lambda view: not is_active(view, Cause.TORQUE_ON))
    bench.run(0.3)
    joints = bench.config.servos.joints
    return check(
        (not early, "said to be off before the silent servo had said so"),
        *((not bench.bus.servo(j.id).table["torque"], f"the torque of {j.name} is on") for j in joints),
    )


@servo_fault(26, _expect(_STOP, Cause.PORT_LOST))
def vanished(bench: FaultBench) -> list[str]:
    bench.bus.vanish()
    bench.until_mode(Mode.STOPPED)
    bench.run(2.0)
    bench.bus.reappear()
    back = bench.until(lambda view: _status(bench).phase is not BusPhase.CLOSED)
    bench.run(1.0)
    status = _status(bench)
    return check(
        (back, "the port was not opened again"),
        (not status.armed, "it was armed again by itself"),
        (not bench.view.servos_on, "the servos count as switched on"),
        (not any(status.zeroed), "joints count as zeroed although nobody watched them"),
    )


@fault(27)
def rebooted(kit: Kit) -> Observation:
    # which of the two is seen first depends on when the read falls: it is silent while it boots
    either: set[object] = {Cause.REBOOTED, Cause.SERVO_SILENT}
    with open_bench(kit, live=True) as bench:
        bench.hand_over().mark()
        bench.bus.modify_servo(4, lambda servo: servo.restart())
        bench.until_mode(Mode.ADVISORY)
        bench.run(0.8)
        problems = check(
            (not _status(bench).zeroed[3], "its joint still counts as zeroed"),
            (bench.latched in either, f"latched is {bench.latched or 'nothing'}"),
            (bool(either & {alert.key for alert in bench.alerts_since_mark}), "no alert"),
        )
        expected = ExpectedReaction(_DISARM, (Cause.REBOOTED,), silent=(Cause.REBOOTED,), alternatives=(_HELD,), may_hold=True)
        seen = judge(bench, expected, *problems)
        bench.pilot.ask(Act.ACKNOWLEDGE)
        bench.run(0.2)
        bench.pilot.switch_on()
        more = check(("zero" in _why_wrong(bench), "it could be switched on without a new zero"))
        return replace(seen, problems=(*seen.problems, *more))


def _why_wrong(bench: FaultBench) -> str:
    """Why the servos cannot be switched on; empty when they can."""
    bench.until(lambda view: is_active(view, Cause.SERVOS_WRONG) or view.servos_on)
    return next((fault.detail for fault in bench.view.active if fault.cause is Cause.SERVOS_WRONG), "")


@fault(28)
def wrong_servo(kit: Kit) -> Observation:
    refusals = [_refusal(kit.part(register), register, value) for register, value in (("model_number", 1060), ("id", 9))]
    with open_bench(kit, live=True) as bench:
        bench.mark()
        bench.bus.modify_servo(6, lambda servo: servo.table.__setitem__("operating_mode", 1))
        bench.pilot.switch_on()
        refusals.append(_why_wrong(bench))
        bench.pilot.ask(Act.ARM)
        bench.run(0.2)
        problems = check(
            (not bench.view.servos_on, "the servos could be switched on"),
            *((bool(text), "not refused by name") for text in refusals),
        )
        seen = judge(bench, ExpectedReaction((), (Cause.SERVOS_WRONG,)), *problems)
        return replace(seen, reaction="; ".join(refusals))


def _refusal(kit: Kit, register: str, value: int) -> str:
    """The driver's error at the opening of a rig with one altered servo; empty when there is none."""
    try:
        with open_bench(kit, live=True, before_open=lambda bus: bus.servo(2).table.__setitem__(register, value)):
            return ""
    except WrongServo as error:
        return str(error)


# ---- other programs on the line


@fault(29)
def two_programs(kit: Kit) -> Observation:
    def take_torque(bench: FaultBench) -> list[str]:
        bench.bus.write_by_other(TORQUE, b"\0")
        problems = _await_end(bench, Mode.ADVISORY)
        return problems + check((all(_status(bench).zeroed), "a zero is lost, though no servo has restarted"))

    return run_parts(
        kit,
        ("opened", _open_twice),
        ("torque switched off", partial(_run, inject=take_torque, expected=_expect(_DISARM, Cause.TORQUE_TAKEN))),
    )


def _open_twice(kit: Kit) -> Observation:
    with open_bench(kit, live=True) as bench:
        bench.hand_over().mark()
        with start_child("open", bench.bus.port) as process:
            bench.wait_for(lambda: process.poll() is not None)
            answer = read_line(process)
        problems = check(
            (answer.get("error") == "PortTaken", f"the second program: {answer}"),
            (bench.mode in {Mode.AUTONOMOUS, Mode.HOLD}, f"the first program went to {bench.mode}"),
        )
        seen = judge(bench, ExpectedReaction((), alternatives=((Mode.HOLD,),), may_hold=True), *problems)
        message = str(answer.get("message", "")).replace(bench.bus.port, "PORT")
        message = re.sub(r"another program, .*?:", "another program, PROGRAM:", message)
        return replace(seen, reaction=f"refused: {message}; the first one goes on")


@fault(32)
def killed(kit: Kit) -> Observation:
    servos = SoftServoBus(ServosConfig(), wire_time=True)
    servos.start()
    try:
        outcomes = [strike(servos, victim, number, delay_s=0.6) for victim, number in KINDS]
    finally:
        servos.stop()
    problems, reaction = [], []
    for seen in outcomes:
        name = f"{seen.signal} {seen.victim}"
        # a stopped application is permitted until its heartbeat is missed: its order is good for a step, and then held
        problems += check(
            (seen.before_mm > _MOVING_MM, f"{name}: no servo moved before"),
            (seen.stop_ms <= 1000.0 * _BOUND_S, f"{name}: still moving after {seen.stop_ms:.0f} ms"),
            (seen.steps <= _STEP_SLACK, f"{name}: went {seen.steps:.2f} steps"),
        )
        reaction.append(f"{name}: {seen.stop_ms:.0f} ms, {seen.steps:.2f} steps")
    events = ("the session ends there (fault 37)",)
    return Observation(f"servos stand. {'; '.join(reaction)}", events=events, problems=tuple(problems))
