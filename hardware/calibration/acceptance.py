"""The steps of an acceptance that ask or move servos, through the same driver, process and gate as every other motion.

One axis moves at a time, in the place that ``servo_probe`` gives a servo under test; the others hold where they stand.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from core.config.acceptance import STOP_TRIES, AcceptanceError, AcceptedServo, EstopRecord, StopTimes
from core.config.models import Config
from core.config.safety import JointConfig, JointKind
from core.config.servo_models import drum_radius_mm
from core.control.faults import Cause
from core.control.health import Deadman
from core.types import Command
from hardware.calibration.servo_probe import ProbeFailed, ProbeLimits, ServoProbe, StopSwitch, feed_of, probe_config
from hardware.servos.bus_ipc import BusStatus, ask_for_port
from hardware.servos.dynamixel_bus import identify
from hardware.servos.dynamixel_port import ServoError, ServoLine
from hardware.servos.registers import ServoState

_VOLTAGE = 144
"""Register of the supply's voltage, 0.1 V."""
DIRECTION_MM = {JointKind.TENDON: 1.5, JointKind.ADVANCE: 5.0, JointKind.DELIVERY: 5.0, JointKind.ROTATION: 15.0}
"""Way by which the direction of a joint is shown, in its own unit."""
PULL_MM = {JointKind.TENDON: 6.0, JointKind.ADVANCE: 15.0, JointKind.DELIVERY: 15.0, JointKind.ROTATION: 15.0}
"""Longest way of the pull at a scale, which gives way itself."""
_PULL_MM_S = 1.5
_PULLED_CYCLES = 2
"""Readings at the force limit in a row that end the pull: fewer than end the motion as a strain."""
STOP_MM = 15.0
"""Way that the motion of a stop takes at most, forwards and backwards in turns."""
_RUN_UP_S = 0.35
_HELD_MM = 0.03
"""An axis that moves less between two readings is held by the scale."""
_STILL_MM, _STILL_S = 0.02, 0.15
"""A joint that moves by no more in that time stands still."""
_WATCH_S = 1.0
_PERIOD_S = 0.005
_TURN_S = 0.02
"""The pilot's turn, in which a deadman is looked at."""


@dataclass(frozen=True, slots=True)
class ScalePull:
    """Force of a pull by the servo's own current (None: it reports none), and whether the scale held the axis."""

    by_current_n: float | None
    was_held: bool


class AcceptanceProbe(ServoProbe):
    """One axis that is moved for an acceptance."""

    peak_ma = 0.0
    _stood = 0
    _stood_mm = 0.0

    @classmethod
    @contextmanager
    def of(
        cls,
        config: Config,
        joint: JointConfig,
        limits: ProbeLimits,
        stop: StopSwitch,
        backups: Path | None,
        *,
        as_driven: bool = False,
    ) -> Iterator[Self]:
        """The axis, armed; where it stands is 0. At the end it holds, disarmed. `as_driven`: with steps and times of driving."""
        servos = probe_config(config.servos, joint.id, limits, joint.sign)
        if as_driven:
            times = {key: getattr(config.servos, key) for key in ("bus_hz", "watchdog_s", "heartbeat_timeout_s")}
            limited = {"max_step_mm": joint.max_step_mm, "max_acceleration_mm_s2": joint.max_acceleration_mm_s2}
            joints = tuple(one.model_copy(update=limited) if one.id == joint.id else one for one in servos.joints)
            servos = servos.model_copy(update=times | {"joints": joints})
        with cls.opened(servos, config.safety, limits, stop, backups) as probe:
            assert isinstance(probe, cls)
            yield probe

    def _watch_current(self, state: ServoState) -> None:
        """Note the highest current, and how long the axis has stood at its force limit; the bus process watches for strain."""
        if state.current_ma is None or state.time_s == self._strain_seen_s:
            return
        self._strain_seen_s = state.time_s
        drawn_ma, at_mm = abs(state.current_ma), state.position_mm or 0.0
        is_held = self._strain_ma is not None and drawn_ma >= self._strain_ma and abs(at_mm - self._stood_mm) <= _HELD_MM
        self._stood = self._stood + 1 if is_held else 0
        self._stood_mm = at_mm
        if self._stood:
            self.peak_ma = max(self.peak_ma, drawn_ma)

    def pull_to(self, target_mm: float) -> bool:
        """Go there slowly until the servo gives all its force; then back, which lets the tension off. False: nothing held it.

        A servo without current ends by the watch for jams: it holds then, and its torque goes off.
        """
        try:
            while self.position_mm < target_mm - _STILL_MM:
                if self._stood >= _PULLED_CYCLES:
                    self.move_to(0.0)
                    return True
                self._robot.send(Command(advance_mm_s=_PULL_MM_S))
                self._stop.sleep(_TURN_S)
        except ProbeFailed:
            status = self._robot.bus_status()
            if status is None or status.latched is None or status.latched.cause not in {Cause.STRAINED, Cause.TRACKING}:
                raise
            self._robot.torque_off()
            return True
        self.move_to(0.0)
        return False

    def run(self, speed_mm_s: float, seconds: float) -> None:
        """Move at this speed for so long."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self._checked()
            self._robot.send(Command(advance_mm_s=speed_mm_s))
            self._stop.sleep(_TURN_S)

    def press_stop(self) -> float:
        """STOP, as the window sends it; returns when."""
        at_s = time.monotonic()
        self._robot.stop()
        return at_s

    def lose_deadman(self, speed_mm_s: float, timeout_s: float) -> float:
        """Move while a deadman is held that falls silent; it is looked at in each turn, as the pilot does.

        Returns when it was heard last.
        """
        last_s = time.monotonic()
        deadman = Deadman(True, last_s, counts=True)
        while deadman.is_down(time.monotonic(), timeout_s):
            self._robot.send(Command(advance_mm_s=speed_mm_s))
            self._stop.sleep(_TURN_S)
        self._robot.hold()
        return last_s

    def stand_still(self, since_s: float, from_mm: float) -> tuple[float, float]:
        """Milliseconds from `since_s` until the servo stood, and its way from `from_mm`, where it was then.

        Raises ProbeFailed when it does not stop.
        """
        samples: list[tuple[float, float]] = []
        while time.monotonic() < since_s + _WATCH_S:
            state = _state_of(self._robot.bus_status(), self.servo_id)
            if state is not None and state.position_mm is not None and (not samples or state.time_s > samples[-1][0]):
                samples.append((state.time_s, state.position_mm))
            self._robot.hold()
            time.sleep(_PERIOD_S)
        end_s, end_mm = samples[-1] if samples else (0.0, 0.0)
        moving = [time_s for time_s, at_mm in samples if abs(at_mm - end_mm) > _STILL_MM]
        still = [time_s for time_s, _ in samples if time_s >= since_s and (not moving or time_s > moving[-1])]
        if not still or end_s - still[0] < _STILL_S:
            raise ProbeFailed(f"servo {self.servo_id} does not stand still within {_WATCH_S:g} s: press the E-stop")
        return 1000.0 * (still[0] - since_s), abs(end_mm - from_mm)

    def acknowledge(self) -> None:
        """After a STOP that was timed: arm again for the next one."""
        self._robot.acknowledge()
        self._robot.arm()

    def await_status(self, wanted: Callable[[BusStatus], bool], within_s: float, beat: bool = True) -> BusStatus:
        """Hold, until a status is as wanted. Raises AcceptanceError, ProcedureStopped."""
        until_s = time.monotonic() + within_s
        while time.monotonic() < until_s:
            if beat:
                self._robot.hold()
            status = self._robot.bus_status()
            if status is not None and wanted(status):
                return status
            self._stop.sleep(_TURN_S)
        raise AcceptanceError(f"nothing was seen within {within_s:g} s")

    def refusal(self) -> str:
        """Why the servos cannot be switched on. Raises AcceptanceError when they can."""
        try:
            self._robot.acknowledge()
            self._robot.arm()
        except ServoError as error:
            return str(error)
        self._robot.torque_off()
        raise AcceptanceError(
            "the servos could be switched on after the E-stop without a zero: check its wiring, do not use the rig"
        )


def _state_of(status: BusStatus | None, servo_id: int) -> ServoState | None:
    readings = () if status is None else status.servos
    return next((one for one in readings if isinstance(one, ServoState) and one.id == servo_id), None)


class AcceptanceBench:
    """The servos of a rig, of which one axis moves at a time; ``stop`` ends whatever moves."""

    def __init__(self, config: Config, stop: StopSwitch, backups: Path | None) -> None:
        self._config, self._stop, self._backups = config, stop, backups

    def identify(self) -> tuple[tuple[AcceptedServo, ...], tuple[float, float]]:
        """Who answers, and the lowest and highest supply. Nothing is written. Raises ServoError."""
        servos = self._config.servos
        ask_for_port(servos.port or "", relaxed=True)  # a bus process of this program may watch servos that hold: it relaxes them
        line = ServoLine(servos.port or "", servos.baud)
        line.open()
        try:
            found = identify(line, servos)
            volts = [int.from_bytes(line.read(joint.id, _VOLTAGE, 2), "little") / 10.0 for joint in servos.joints]
        finally:
            line.close()
        return (
            tuple(AcceptedServo(name=one.name, id=one.id, model=one.model, firmware=one.firmware) for one in found),
            (min(volts), max(volts)),
        )

    def show_direction(self, joint: JointConfig) -> None:
        """A short way in the joint's positive direction, and back."""
        way_mm = DIRECTION_MM[joint.kind]
        limits = ProbeLimits(-way_mm, way_mm, min(max(3.0, way_mm / 1.5), joint.max_speed_mm_s))
        with AcceptanceProbe.of(self._config, joint, limits, self._stop, self._backups) as probe:
            probe.move_to(way_mm)
            probe.pause(1.0)
            probe.move_to(0.0)

    def pull(self, joint: JointConfig) -> ScalePull:
        """Pull at the scale until the servo gives all that its force limit allows, then let go."""
        way_mm = PULL_MM[joint.kind]
        limits = ProbeLimits(-1.0, way_mm, 4.0)
        with AcceptanceProbe.of(self._config, joint, limits, self._stop, self._backups) as probe:
            was_held = probe.pull_to(way_mm)
            peak_ma = probe.peak_ma
        model = self._config.servos.model_of(joint)
        by_current_n = None
        if model.has_current_mode:
            by_current_n = round(model.torque_nm(peak_ma) / (drum_radius_mm(joint.drum_mm_per_turn) / 1000.0), 2)
        return ScalePull(by_current_n, was_held)

    def stop_times(self, kind: str, joint: JointConfig, report: Callable[[str], None]) -> StopTimes:
        """Time stops at full speed, forwards and backwards in turns. Raises ServoError, AcceptanceError."""
        speed_mm_s = min(joint.max_speed_mm_s, STOP_MM / _RUN_UP_S / 2.0)
        limits = ProbeLimits(-STOP_MM, STOP_MM, speed_mm_s)
        times_ms, way_mm = [], 0.0
        with AcceptanceProbe.of(self._config, joint, limits, self._stop, self._backups, as_driven=True) as probe:
            for attempt in range(STOP_TRIES):
                way = speed_mm_s if attempt % 2 == 0 else -speed_mm_s
                probe.run(way, _RUN_UP_S)
                from_mm = probe.position_mm
                if kind == "STOP":
                    began_s = probe.press_stop()
                else:
                    began_s = probe.lose_deadman(way, self._config.safety.deadman_timeout_s)
                time_ms, at_mm = probe.stand_still(began_s, from_mm)
                times_ms.append(round(time_ms, 1))
                way_mm = max(way_mm, at_mm)
                report(f"  {time_ms:.0f} ms, {at_mm:.2f} mm")
                if kind == "STOP":
                    probe.acknowledge()
            probe.move_to(0.0)
        return StopTimes.model_validate(
            {"kind": kind, "joint": joint.name, "speed_mm_s": speed_mm_s, "times_ms": times_ms, "way_mm": round(way_mm, 2)}
        )

    def estop(self, say: Callable[[str], None], within_s: float) -> EstopRecord:
        """Wait until the E-stop is pressed, and until it is released again. Raises ServoError, AcceptanceError."""
        limits = ProbeLimits()
        with AcceptanceProbe.of(self._config, feed_of(self._config.servos), limits, self._stop, self._backups) as probe:
            heard_s = time.monotonic()

            def is_over(status: BusStatus) -> bool:
                nonlocal heard_s
                if status.servos and all(isinstance(one, ServoState) for one in status.servos):
                    heard_s = min(one.time_s for one in status.servos if isinstance(one, ServoState))
                return status.latched is not None

            say("press the E-stop")
            status = probe.await_status(is_over, within_s)
            assert status.latched is not None
            cause, silent_ms = status.latched.cause, 1000.0 * (time.monotonic() - heard_s)
            if cause is not Cause.SUPPLY_LOST:
                raise AcceptanceError(
                    f"disarmed for another cause ({cause.text}): the E-stop must cut the power of all servos at once"
                )
            refused = probe.refusal()
            say("release the E-stop, so that the servos have power again")
            probe.await_status(_all_answer, within_s)
            refused_after = probe.refusal()
        return EstopRecord(cause=cause.value, silent_ms=round(silent_ms, 1), refused=refused, refused_after=refused_after)


def _all_answer(status: BusStatus) -> bool:
    return bool(status.servos) and all(isinstance(one, ServoState) for one in status.servos)
