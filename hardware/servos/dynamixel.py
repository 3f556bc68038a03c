"""The seven DYNAMIXEL X servos through the real SDK: who they are, arming, goals, state, and recovery."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Sequence

from core.servo_config import JointConfig, JointName, ServosConfig
from hardware.servos import setup, units
from hardware.servos.errors import NoAnswer, NotReady, PortLost, Refused, ServoError, TorqueStillOn, WrongServo
from hardware.servos.line import LineCounts, Miss, ServoLine
from hardware.servos.status_block import (
    ANSWERS_ALL,
    BLOCK_BYTES,
    TAG_BYTES,
    HardwareError,
    MissingServo,
    ServoReading,
    ServoState,
    describe,
    indirect_data,
    state_of,
)

_STATUS_RETURN, _HARDWARE_ERROR = 68, 70
_REBOOT_S = 1.5
_log = logging.getLogger(__name__)


class ServoBus:
    """Seven servos on one line, in the order of the configuration's joints. One thread opens, uses and closes it.

    Parameters
    ----------
    config : identities, conversion and speeds. Envelope and step limits are the gate's business, not the driver's.
    port : serial device; default is the configuration's.

    Notes
    -----
    Positions are joint millimetres from where ``set_zero`` was called. Every method but ``close`` may raise ``PortLost``; then the
    bus is closed, and ``open`` starts anew: disarmed, without zeros.
    """

    def __init__(self, config: ServosConfig, port: str | None = None) -> None:
        chosen = port or config.port
        if chosen is None:
            raise NotReady("no servo port is configured: set servos.port")
        self.config = config
        self._joints = config.joints
        self._line = ServoLine(chosen, config.baud)
        self._forget()

    def _forget(self) -> None:
        self._armed = False
        self._identities: tuple[setup.ServoIdentity, ...] = ()
        self._zeros: dict[int, int] = {}
        self._put_off: set[int] = set()
        self._misses = dict.fromkeys((joint.id for joint in self._joints), 0)
        self._silences = dict(self._misses)
        self._turn = 0

    @property
    def is_open(self) -> bool:
        return self._line.is_open

    @property
    def is_armed(self) -> bool:
        """Whether goals are taken. Nothing but ``arm`` makes it true; a restart, a lost torque or a lost port make it false."""
        return self._armed and self._line.is_open

    @property
    def identities(self) -> tuple[setup.ServoIdentity, ...]:
        return self._identities

    @property
    def zero_ticks(self) -> tuple[int | None, ...]:
        """Position register at zero, by joint; None where the joint has not been zeroed since it was switched on."""
        return tuple(self._zeros.get(joint.id) for joint in self._joints)

    @property
    def counts(self) -> LineCounts:
        """Silent, damaged, late answers and retries since ``open``."""
        return self._line.counts

    def open(self) -> None:
        """Open and lock the port, and make sure that the seven servos are those of the configuration. Nothing moves, none lets go.

        A servo whose torque is on is not set up, which takes the torque off: it may hold a wire. ``arm`` does it.

        Raises
        ------
        PortError, PortTaken
            The port cannot be opened.
        NoAnswer, WrongServo
            A servo is missing, or not the one that the configuration names. The port is closed again.
        """
        self._line.open()
        self._forget()
        try:
            self._line.broadcast(_STATUS_RETURN, bytes([ANSWERS_ALL]))  # else a servo may be set not to answer writes
            self._identities = setup.identify(self._line, self.config)
            for joint in self._joints:
                if not setup.holds(self._line, joint):
                    self._configure(joint)
                elif setup.differences(self._line, joint):
                    self._put_off.add(joint.id)
                    _log.warning("%s holds, so it is not set up before the servos are switched on", setup.call(joint))
                setup.map_block(self._line, joint)
        except ServoError:
            self.close()
            raise

    def close(self) -> None:
        """Hold if armed, and give the port back. Never fails. The torque stays on: releasing the wires is a decision of its own."""
        if self.is_armed:
            with contextlib.suppress(ServoError):
                self.hold()
                self.read()  # whoever answers has heard the hold: it is not lost with the port
        self._armed = False
        self._line.close()

    def set_zero(self, names: Sequence[JointName] | None = None) -> None:
        """The present positions become zero, of all joints or of those named. Tendons must be without tension there.

        Raises
        ------
        NotReady
            When armed: goals would jump. When a servo holds and counts otherwise than it will when it is set up.
        NoAnswer
        """
        if self.is_armed:
            raise NotReady("the servos are armed: disarm before zeroing")
        chosen = [joint for joint in self._joints if names is None or joint.name in names]
        self._set_up_late(chosen)
        found = {joint.id: units.signed(self._line.read(joint.id, setup.POSITION, 4)) for joint in chosen}
        self._zeros.update(found)

    def arm(self) -> None:
        """Torque on, each servo holding where it stands.

        The order: watchdog off, torque off, mode and limits, profile, position read, goal = position, torque on, watchdog on.

        Raises
        ------
        NotReady
            A joint has no zero, has lost it by a restart, or a servo reports a hardware error.
        WrongServo, NoAnswer, Refused
            Before the torque is touched: a servo is missing or another one. Later, the torque of all servos is off again.
        TorqueStillOn
            It could not be switched on everywhere, nor proven to be off again.
        """
        self._armed = False
        self._check_ready()
        try:
            for joint in self._joints:
                self._line.write(joint.id, setup.WATCHDOG, b"\0")
            for joint in self._joints:
                self._line.write(joint.id, setup.TORQUE, b"\0")
            for joint in self._joints:
                self._configure(joint)
                if setup.map_block(self._line, joint):  # else nobody would ever know: it counts from another turn now
                    self._zeros.pop(joint.id, None)
                setup.set_profile(self._line, joint)
            self._check_zeroed()
            setup.goal_to_position(self._line, self.config)
            for joint in self._joints:
                self._line.write(joint.id, setup.TORQUE, b"\1")
            setup.start_watchdogs(self._line, self.config)
        except PortLost:
            raise
        except ServoError as error:
            try:
                self.torque_off()
            except PortLost:
                raise
            except ServoError as still_on:
                raise TorqueStillOn(f"{error}; {still_on}") from error
            raise
        self._armed = True

    def disarm(self) -> None:
        """Hold, and take no more goals. The torque stays on; the servos' watchdogs trip when nobody talks to them."""
        self._armed = False
        self.hold()

    def read(self) -> tuple[ServoReading, ...]:
        """State of all seven, in the order of the joints; a servo without a usable answer is a ``MissingServo``.

        Takes 3 ms at 1 Mbps, and at most 80 ms when servos are silent.
        """
        length = BLOCK_BYTES + self._turn % (TAG_BYTES + 1)
        # Those that were silent come last, where they cannot silence others.
        ids = sorted(self._misses, key=lambda servo_id: self._silences[servo_id])
        answer = self._line.group_read(ids, indirect_data(self.config.model), length)
        now = time.monotonic()
        if answer.data or any(miss is not Miss.WAITING for miss in answer.missed.values()):
            self._turn += 1  # of what was really asked: else the next request would look like the one before
        readings: list[ServoReading] = []
        for joint in self._joints:
            if joint.id in answer.data:
                readings.append(self._reading(joint, answer.data[joint.id], now))
            else:
                readings.append(self._missing(joint, answer.missed[joint.id], now))
        return tuple(readings)

    def write(self, goals_mm: Sequence[float]) -> tuple[float, ...]:
        """Send the seven goals in one packet; returns the goals in mm as the servos count them.

        No servo answers: ``ServoState.goal_mm`` of the next read tells what was taken.

        Raises
        ------
        NotReady
            When not armed.
        ValueError
            When a goal is not finite or beyond what a servo counts; nothing is sent.
        """
        if not self.is_armed:
            raise NotReady("the servos are not armed: zero and arm them first")
        goals = {
            joint.id: units.to_ticks(joint, goal_mm, self._zeros[joint.id])
            for joint, goal_mm in zip(self._joints, goals_mm, strict=True)
        }
        setup.send_goals(self._line, goals)
        return tuple(units.to_mm(joint, goals[joint.id], self._zeros[joint.id]) for joint in self._joints)

    def hold(self) -> tuple[ServoReading, ...]:
        """Goal = present position, of every servo that tells its own; returns the readings. Needs no arming."""
        readings = self.read()
        goals = {reading.id: reading.ticks for reading in readings if isinstance(reading, ServoState)}
        if goals:
            setup.send_goals(self._line, goals)
        return readings

    def torque_off(self) -> None:
        """Switch all torque off: one packet to all, three times, read back. It releases the tension of the wires.

        Raises
        ------
        TorqueStillOn
            When a servo still has torque, or does not tell.
        """
        self._armed = False
        for _ in range(3):
            self._line.broadcast(setup.TORQUE, b"\0")
        answer = self._line.group_read([joint.id for joint in self._joints], setup.TORQUE, 1)
        doubtful = [joint.name for joint in self._joints if answer.data.get(joint.id) != b"\0"]
        if doubtful:
            raise TorqueStillOn(f"torque of {', '.join(doubtful)} is not proven to be off: cut the servos' power")

    def let_go(self) -> None:
        """``torque_off`` on a closed bus that cannot be opened because not all seven answer: whoever hears it obeys.

        Raises
        ------
        PortError, PortTaken
            The port cannot be opened.
        TorqueStillOn
            When a servo still has torque, or does not tell.
        """
        self._line.open()
        try:
            self.torque_off()
        finally:
            self._line.close()

    def reboot(self, servo_id: int) -> None:
        """Restart one servo, which clears its hardware error. Afterwards the bus is disarmed, and the joint must be zeroed.

        Raises
        ------
        NoAnswer
            When it does not come back within 1.5 s.
        """
        joint = self._joint(servo_id)
        self._armed = False
        self._zeros.pop(servo_id, None)
        self._line.reboot(servo_id)
        until = time.monotonic() + _REBOOT_S
        time.sleep(0.1)  # it answers for a moment before it goes down
        while (model := self._line.ping(servo_id)) is None:
            if time.monotonic() > until:
                raise NoAnswer(f"{setup.call(joint)} did not come back after its reboot: switch the servos' power off and on")
        setup.check_model(joint, model, self.config.model)
        self._configure(joint)
        setup.map_block(self._line, joint)

    def clear_watchdog(self) -> None:
        """Let servos whose bus watchdog tripped take goals again, starting where they stand.

        Raises
        ------
        NotReady
            When not armed: ``arm`` clears it, too.
        """
        if not self.is_armed:
            raise NotReady("the servos are not armed: arming clears the bus watchdog")
        for joint in self._joints:
            setup.set_profile(self._line, joint)  # a trip forgets it, and without one the servo moves as fast as it can
            self._line.write(joint.id, setup.WATCHDOG, b"\0")
        setup.goal_to_position(self._line, self.config)
        setup.start_watchdogs(self._line, self.config)

    def _set_up_late(self, chosen: Sequence[JointConfig]) -> None:
        """Those that held when the port was opened, if they do not any more."""
        for joint in chosen:
            if joint.id not in self._put_off:
                continue
            if not setup.holds(self._line, joint):
                self._configure(joint)
            elif setup.counts_anew(setup.differences(self._line, joint)):
                raise NotReady(
                    f"{setup.call(joint)} holds in a mode of another program: switch the torque off (the wires go slack), then zero"
                )

    def _check_ready(self) -> None:
        if not self.is_open:
            raise NotReady("the servo port is not open: open it first")
        # again, since a servo may have been changed meanwhile
        self._identities = tuple(setup.identity_of(self._line, joint, self.config) for joint in self._joints)
        self._check_zeroed()
        for joint in self._joints:
            error = HardwareError(self._line.read(joint.id, _HARDWARE_ERROR, 1)[0])
            if error:
                raise NotReady(f"{setup.call(joint)} reports {describe(error)}: find the cause, then reboot the servo")

    def _check_zeroed(self) -> None:
        missing = [joint.name for joint in self._joints if joint.id not in self._zeros]
        if missing:
            names = ", ".join(missing)
            raise NotReady(f"not zeroed: {names} (or restarted since then): slacken the wires and zero before arming")

    def _configure(self, joint: JointConfig) -> None:
        self._put_off.discard(joint.id)
        if setup.configure(self._line, joint):
            self._zeros.pop(joint.id, None)

    def _reading(self, joint: JointConfig, block: bytes, time_s: float) -> ServoReading:
        self._misses[joint.id] = self._silences[joint.id] = 0
        state = state_of(joint, self.config.model, self._zeros.get(joint.id), block, time_s)
        if state is None:
            self._armed = False
            self._zeros.pop(joint.id, None)
            with contextlib.suppress(NoAnswer, Refused):
                setup.map_block(self._line, joint)
            return MissingServo(joint.name, joint.id, time_s, 0, "restarted: zero and arm again", restarted=True)
        if not state.torque:
            self._armed = False
        return state

    def _missing(self, joint: JointConfig, miss: Miss, time_s: float) -> MissingServo:
        self._misses[joint.id] += miss is not Miss.WAITING
        self._silences[joint.id] += miss is Miss.SILENT
        return MissingServo(joint.name, joint.id, time_s, self._misses[joint.id], miss.value)

    def _joint(self, servo_id: int) -> JointConfig:
        for joint in self._joints:
            if joint.id == servo_id:
                return joint
        raise WrongServo(f"there is no servo with id {servo_id} in the configuration")
