"""The robot behind the ``GuardedRobot`` protocol, moved by its servos through the guarded bus process."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

from core.config.calibration import ZeroConfig
from core.config.safety import SafetyConfig, ServosConfig
from core.control.bus_monitor import BusReport
from core.control.faults import Cause
from core.control.gate import Rejection, Source
from core.control.joints import Retracted, status_at, within_speeds
from core.control.kept_zero import ZeroRequest, all_at_zero
from core.control.robot import SentMotion
from core.types import Command, RobotStatus
from hardware.processes import DeviceProcess
from hardware.servos.bus_guard import report_of
from hardware.servos.bus_ipc import END_S, BusClient, BusOrder, BusPhase, BusStatus, Heartbeat, IssuedGoals
from hardware.servos.dynamixel_port import BusProcessLost, NotReady, ServoError, TorqueStillOn
from hardware.servos.registers import ServoReading, ServoState, wire_force_mn
from hardware.simulated_clock import SimulatedClock

_OPEN_S, _ARM_S, _REQUEST_S, _TORQUE_OFF_S = 20.0, 10.0, 5.0, 10.0
_RELAX_S, _LOOK_S = 15.0, 0.05
"""Longer than letting go slowly takes; and between two looks whether it is done."""
_HARDWARE = re.compile(r"\b(cable|power|supply)\b")
_TWIN_LATE = "the twin's servos did not answer in time: close other programs, then try again; F5 starts the twin again"
_HUNG_S = 0.2
"""For the end of a bus process that has just left a request unanswered."""


class ServoRobot:
    """Seven servos, in a process of their own. All methods may be called from any thread.

    Parameters
    ----------
    servos, safety : the configuration; ``servos.port`` must be set.
    name : shown to the operator.
    truth : tells the status instead of the servos, where the robot is simulated; its servos are not watched when the program ends.
    keep : file in which the bus process keeps where the joints are, to offer it after a restart; None: only while it runs.
    searched : zeros of the rig file, of the last search for slack; offered, too.
    process : a bus process that was started ahead, for the first connection.
    backups : folder that keeps the servos' EEPROM as it was before it is changed; None for software servos.
    clock : of a simulated bench; None: the wall clock.

    Notes
    -----
    Nothing moves before ``zero`` and ``arm``. Orders and permissions are valid for 100 ms and must be repeated. A program with a
    supervisor calls ``beat`` at its every tick, and from the first call on nothing else is a sign of life; in a program without
    one ``send``, ``hold`` and ``status`` are, and permit the operator. ``arm``, ``zero`` and the like wait for their answer,
    ``stop`` waits for nothing.
    """

    def __init__(
        self,
        servos: ServosConfig,
        safety: SafetyConfig,
        *,
        name: str = "servo robot",
        truth: Callable[[], RobotStatus] | None = None,
        keep: Path | None = None,
        searched: ZeroConfig | None = None,
        process: DeviceProcess | None = None,
        backups: Path | None = None,
        clock: SimulatedClock | None = None,
    ) -> None:
        self._clock = clock
        self._servos = servos if truth is None else servos.model_copy(update={"unattended_s": 0.0})
        self._safety = safety
        self._name = name
        self._truth, self._keep, self._searched = truth, keep, searched
        self._lock, self._releasing = threading.Lock(), threading.Lock()
        self._prestarted, self._backups = process, backups
        self._client: BusClient | None = None
        self._closes = 0
        self._supervised = False
        self._states: tuple[ServoReading, ...] = ()
        self._reported = (0, 0, 0)  # cycle, bad packets and restarts of the last report
        self._reported_offs = self._reported_releases = 0
        self._not_connected: str | None = None

    def now_s(self) -> float:
        """The clock of orders and reports."""
        return time.monotonic() if self._clock is None else self._clock()

    @property
    def name(self) -> str:
        return self._name

    @property
    def failure(self) -> str | None:
        """One line when the bus process is gone without ``close``, or when it could not be started again."""
        client = self._client
        return client.failure if client is not None else self._not_connected

    def connect(self) -> None:
        """Start the bus process, open and lock the port, check all servos. Nothing moves, and nothing is armed.

        Raises ServoError: what is wrong with port or servos; all is closed again.
        """
        closes = self._closes
        self._disconnect()
        if self._servos.port is None:
            raise NotReady("no servo port is configured: set servos.port")
        try:
            with ExitStack() as undo:
                prestarted, self._prestarted = self._prestarted, None
                client = BusClient(
                    self._servos,
                    self._safety,
                    prestarted,
                    backups=self._backups,
                    keep=self._keep,
                    searched=self._searched,
                    clock=self._clock.file if self._clock is not None else None,
                )
                undo.callback(client.close)
                self._request(client, "open", _OPEN_S)
                with self._lock:
                    if self._closes != closes:
                        raise NotReady(f"the {self._name} was closed meanwhile")
                    self._not_connected = None
                    self._reported = (0, 0, 0)
                    self._reported_offs = self._reported_releases = 0
                    self._states = ()
                    self._supervised = False
                    self._client = client
                undo.pop_all()
        except ServoError as error:
            self._not_connected = str(error)
            raise

    def zero(self, request: ZeroRequest | None = None) -> None:
        """Set where joints are now, or confirm their kept zeros (``BusStatus.offers``).

        Raises NotReady, NoAnswer: the zero of a tendon is refused while its servo holds or pulls, and where one is kept.
        """
        wanted = request or all_at_zero(self._servos)
        self._request(self._connected(), "zero", _REQUEST_S, **wanted.model_dump(mode="json"))

    def arm(self) -> None:
        """Torque on, each servo holding where it stands; from now on the permitted source's orders are followed.

        Raises NotReady: with all reasons: not zeroed, a fault that was not acknowledged or is still there.
        """
        self._request(self._connected(), "arm", _ARM_S)
        self._beat_unsupervised()

    def disarm(self) -> None:
        """Hold, and follow no more orders. The torque stays on."""
        self._request(self._connected(), "disarm", _REQUEST_S)

    def stop(self) -> None:
        """STOP: hold at once, latched, and the torque off if the configuration says so. Never fails and never waits."""
        if (client := self._client) is not None:
            client.stop()

    def acknowledge(self) -> None:
        """The operator has seen why the servos were disarmed or stopped; arming is another request."""
        self._request(self._connected(), "acknowledge", _REQUEST_S)

    def reboot(self, servo_id: int) -> None:
        """Restart a servo, which clears its hardware error; its joint must be zeroed again."""
        self._request(self._connected(), "reboot", _REQUEST_S, servo_id=servo_id)

    def relax(self, is_overtaken: Callable[[], bool] = lambda: False) -> None:
        """Let the tension off slowly, then switch all torque off; waits for both, some seconds, or until `is_overtaken` says that
        a torque-off was asked for.

        Raises NotReady: STOP came meanwhile, and the wires are as they were then; TorqueStillOn.
        """
        client = self._connected()
        before = self.bus_status()
        offs, stops = (before.torque_offs, _stops(before)) if before is not None else (0, 0)
        client.request("relax", _REQUEST_S)
        until_s = time.monotonic() + _RELAX_S
        while time.monotonic() < until_s:
            if is_overtaken():
                return
            status = self._connected().status()
            if status is not None and status.torque_offs > offs:
                return
            if status is not None and _stops(status) > stops:
                raise NotReady("stopped meanwhile: the wires are as they were then")
            self._beat_unsupervised()
            time.sleep(_LOOK_S)
        raise TorqueStillOn("the wires were not let go in time: cut the servos' power")

    def torque_off(self) -> None:
        """Disarm and switch all torque off, which releases the tension of the wires.

        Where the bus process is gone or hangs, a new one does it, and ends; also where a missing servo keeps the robot from being
        connected. Raises TorqueStillOn.
        """
        if (failure := self.failure) is None:
            client = self._connected()
            try:
                client.request("torque off", _REQUEST_S)
                return
            except BusProcessLost as error:
                failure = str(error)
        with self._releasing:  # only one process can have the port
            self._not_connected = failure  # stays: the new process does not drive
            self._disconnect(_HUNG_S)
            client = BusClient(self._servos, self._safety)
            try:
                client.request("torque off", _TORQUE_OFF_S)
            finally:
                client.close()

    def beat(self, permitted: Source | None) -> None:
        """A sign of life of the application; `permitted` says whose orders may be followed (None: of no source)."""
        self._supervised = True
        if (client := self._client) is not None:
            client.put_heartbeat(Heartbeat(self.now_s(), permitted))

    def send(
        self,
        command: Command,
        *,
        source: Source = Source.OPERATOR,
        captured_s: float | None = None,
        retracts: Retracted = Retracted.NONE,
    ) -> Command:
        """Make `command` the newest order.

        Parameters
        ----------
        command : limited to -1..1 and to the joints' speeds.
        captured_s : when the frame behind it was taken (monotonic); needed of the program.
        retracts : the feeds whose retraction the operator holds beyond the low end of their envelope, at 2 mm/s.

        Returns
        -------
        Command
            The motion that really left the gate in the newest cycle of the bus, not more than a cycle before this order.

        Raises ValueError: when a number is not finite; the order before stays; BusProcessLost: not connected, or the bus process
        is gone.
        """
        limited = within_speeds(command, self._servos)
        client = self._connected()
        client.put_order(BusOrder(limited, source, self.now_s(), captured_s, retracts))
        self._beat_unsupervised()
        sent = self._sent(client.status())
        return sent.motion if sent is not None else Command()

    def hold(self) -> None:
        """Stop all motion and keep the bend; stays armed."""
        if (client := self._client) is not None:
            client.put_order(BusOrder(None, Source.OPERATOR, self.now_s()))
            self._beat_unsupervised()

    def status(self) -> RobotStatus:
        """Where the robot is, as its servos told last (``time_s``, monotonic); 0 for a joint that is not zeroed. BusProcessLost."""
        self._beat_unsupervised()
        self._connected()
        self.bus_status()
        if self._truth is not None:
            return self._truth()
        states = [reading for reading in self._states if isinstance(reading, ServoState)]
        servos = self._servos
        if not states:
            return status_at((0.0,) * len(servos.joints), (0.0,) * len(servos.tendons), self.now_s(), servos)
        forces_mn = tuple(
            wire_force_mn(joint, servos.model_of(joint), state.current_ma or 0.0)
            for joint, state in zip(servos.tendons, states, strict=False)
        )
        at_mm = [state.position_mm or 0.0 for state in states]
        return status_at(at_mm, forces_mn, min(state.time_s for state in states), servos)

    def bus_status(self) -> BusStatus | None:
        """The newest status of the bus process, also after its end (see ``failure``); None before the first. No heartbeat."""
        client = self._client
        status = client.status() if client is not None else None
        if status is not None and status.servos and all(isinstance(reading, ServoState) for reading in status.servos):
            self._states = status.servos
        return status

    def report(self) -> BusReport | None:
        """What the supervisor wants to know of the cycles since the last call; None when there was none, or the bus is quiet."""
        status = self.bus_status()
        with self._lock:
            cycle, bad_packets, restarts = self._reported
            if status is None or status.cycle == cycle or self.failure is not None:
                return None
            self._reported = status.cycle, bad_packets, restarts
            if status.phase is not BusPhase.CLOSED and not status.servos:
                return None
            torque_off, self._reported_offs = status.torque_offs > self._reported_offs, status.torque_offs
            let_out, self._reported_releases = status.releases > self._reported_releases, status.releases
            if status.phase is BusPhase.CLOSED:
                return BusReport(port_open=False, torque_off=torque_off, torque_problem=status.torque_problem)
            self._reported = status.cycle, status.bad_packets, status.restarts
        errors, rebooted = status.bad_packets - bad_packets, status.restarts > restarts
        report = report_of(status.servos, armed=status.armed, errors=errors, rebooted=rebooted)
        return replace(
            report,
            armed=status.armed,
            ended=status.latched,
            torque_off=torque_off,
            torque_problem=status.torque_problem,
            let_out=let_out,
            still_tight=status.still_tight,
        )

    def sent_motion(self) -> SentMotion | None:
        """What left the gate in the newest cycle since it was armed; None before that, and when it is not armed. No heartbeat.

        A bus whose status is old counts as holding: whether it still sends anything is unknown.
        """
        status = self.bus_status()
        sent = self._sent(status)
        if status is None or sent is None:
            return None
        return sent.sent_motion(status.cycle, status.rejection, status.at_end, self._servos.joints)

    def _sent(self, status: BusStatus | None) -> IssuedGoals | None:
        if status is None or status.sent is None or not status.armed or self.failure is not None:
            return None
        is_late = self.now_s() - status.time_s > self._safety.bus_hold_s
        return status.sent.kept() if is_late else status.sent

    def kept_back(self) -> Rejection | None:
        """Why nothing at all has left the gate since it was armed; None when something has, and when it is not armed."""
        status = self.bus_status()
        return status.rejection if status is not None and status.armed and status.sent is None else None

    def close(self) -> None:
        """Hold, end the bus process and give the port back. The torque stays on."""
        with self._lock:
            self._closes += 1  # a connection that is being made by another thread is given up
        self._disconnect()
        prestarted, self._prestarted = self._prestarted, None
        if prestarted is not None:
            prestarted.discard()

    def _disconnect(self, patience_s: float = END_S) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close(patience_s)

    def _request(self, client: BusClient, what: str, timeout_s: float, **details: Any) -> None:
        """As ``BusClient.request``; what a simulated robot says names no cable."""
        try:
            client.request(what, timeout_s, **details)
        except ServoError as error:
            if self._truth is None or not _HARDWARE.search(str(error)):
                raise
            raise type(error)(_TWIN_LATE) from error

    def _connected(self) -> BusClient:
        client = self._client
        if client is None:
            raise BusProcessLost(f"the {self._name} is not connected: connect it first")
        if (failure := client.failure) is not None:
            raise BusProcessLost(failure)
        return client

    def _beat_unsupervised(self) -> None:
        """A sign of life of a program without a supervisor."""
        if (client := self._client) is not None and not self._supervised:
            client.put_heartbeat(Heartbeat(self.now_s(), Source.OPERATOR))


def _stops(status: BusStatus) -> int:
    """How often STOP was pressed."""
    return status.fault_counts.get(Cause.STOP_PRESSED, 0)
