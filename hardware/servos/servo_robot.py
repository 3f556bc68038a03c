"""The robot behind the ``Robot`` protocol, moved by seven servos through the guarded bus process."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace

from core.calibration.servos import zero_advice
from core.config.calibration import ZeroConfig
from core.config.safety import JointConfig, JointName, SafetyConfig, ServosConfig
from core.control.gate import Rejection, Source
from core.control.health import BusReport
from core.control.robot import SentMotion
from core.types import Command, RobotStatus
from hardware.servos.bus_guard import report_of
from hardware.servos.bus_ipc import END_S, BusClient, BusOrder, BusPhase, BusProcess, BusStatus, Heartbeat, IssuedGoals
from hardware.servos.dynamixel_port import BusProcessLost, NotReady, ServoError
from hardware.servos.registers import ServoReading, ServoState, wire_force_mn

_OPEN_S, _ARM_S, _REQUEST_S, _LET_GO_S = 20.0, 10.0, 5.0, 10.0
_HUNG_S = 0.2
"""For the end of a bus process that has just left a request unanswered."""


class ServoRobot:
    """Seven servos, in a process of their own. All methods may be called from any thread.

    Parameters
    ----------
    servos, safety : the configuration; ``servos.port`` must be set.
    name : for people.
    truth : tells the status instead of the servos, where the robot is simulated.
    on_close : called once, after the servos were let go.
    kept_zero : of the rig file; arming without a zero then says whether the servos have lost their turns since.
    process : a bus process that is loading already, for the first connection.

    Notes
    -----
    Nothing moves before ``zero`` and ``arm``. Orders and permissions hold good for 100 ms and must be repeated. A program with a
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
        on_close: Callable[[], None] | None = None,
        kept_zero: ZeroConfig | None = None,
        process: BusProcess | None = None,
    ) -> None:
        self._servos, self._safety = servos, safety
        self._name = name
        self._truth, self._on_close, self._kept_zero = truth, on_close, kept_zero
        self._lock, self._letting_go = threading.Lock(), threading.Lock()
        self._loading = process
        self._link: BusClient | None = None
        self._closes = 0
        self._supervised = False
        self._states: tuple[ServoReading, ...] = ()
        self._reported = (0, 0, 0)  # cycle, bad packets and restarts of the last report
        self._told_offs = 0
        self._not_connected: str | None = None

    @property
    def name(self) -> str:
        return self._name

    @property
    def failure(self) -> str | None:
        """One line when the bus process is gone though nobody closed it, or when it could not be started again."""
        link = self._link
        return link.failure if link is not None else self._not_connected

    def connect(self) -> None:
        """Start the bus process, open and lock the port, check all servos. Nothing moves, and nothing is armed.

        Raises
        ------
        ServoError
            What is wrong with port or servos; all is closed again.
        """
        closes = self._closes
        self._disconnect()
        if self._servos.port is None:
            raise NotReady("no servo port is configured: set servos.port")
        try:
            with ExitStack() as undo:
                loading, self._loading = self._loading, None
                link = BusClient(self._servos, self._safety, loading)
                undo.callback(link.close)
                link.request("open", _OPEN_S)
                with self._lock:
                    if self._closes != closes:
                        raise NotReady(f"the {self._name} was closed meanwhile")
                    self._not_connected = None
                    self._reported = (0, 0, 0)
                    self._told_offs = 0
                    self._states = ()
                    self._supervised = False
                    self._link = link
                undo.pop_all()
        except ServoError as error:
            self._not_connected = str(error)
            raise

    def zero(self, names: Sequence[JointName] | None = None) -> None:
        """The present positions are zero, of all joints or of those named; the wires must be slack.

        Raises
        ------
        NotReady, NoAnswer
        """
        self._connected().request("zero", _REQUEST_S, names=None if names is None else list(names))

    def arm(self) -> None:
        """Torque on, each servo holding where it stands; from now on the permitted one's orders are followed.

        Raises
        ------
        NotReady
            With all reasons: not zeroed, a fault that was not acknowledged or is still there.
        """
        try:
            self._connected().request("arm", _ARM_S)
        except NotReady as error:
            raise NotReady(f"{error}{self._about_kept_zero()}") from None
        self._live()

    def _about_kept_zero(self) -> str:
        """What the rig file's zero says of joints that are not zeroed; "" where it has none, or all are."""
        status = self.bus_status()
        if self._kept_zero is None or status is None or all(status.zeroed) or len(self._states) != len(self._servos.joints):
            return ""
        ticks = [reading.ticks for reading in self._states if isinstance(reading, ServoState)]
        return f" ({zero_advice(self._servos, self._kept_zero, ticks)})"

    def disarm(self) -> None:
        """Hold, and follow no more orders. The torque stays on."""
        self._connected().request("disarm", _REQUEST_S)

    def stop(self) -> None:
        """STOP: hold at once, latched, and the torque off if the configuration says so. Never fails and never waits."""
        if (link := self._link) is not None:
            link.stop()

    def acknowledge(self) -> None:
        """The operator has seen why the servos were disarmed or stopped; arming is another request."""
        self._connected().request("acknowledge", _REQUEST_S)

    def reboot(self, servo_id: int) -> None:
        """Restart a servo, which clears its hardware error; its joint must be zeroed again."""
        self._connected().request("reboot", _REQUEST_S, servo_id=servo_id)

    def torque_off(self) -> None:
        """Disarm and switch all torque off, which releases the tension of the wires.

        Where the bus process is gone or hangs, a new one does it, and ends. Servos obey also where a missing one keeps the robot
        from being connected.

        Raises
        ------
        TorqueStillOn
        """
        if (failure := self.failure) is None:
            link = self._connected()
            try:
                link.request("torque off", _REQUEST_S)
                return
            except BusProcessLost as error:
                failure = str(error)
        with self._letting_go:  # one that has the port is enough
            self._not_connected = failure  # and stays so: this process is not the one that drives
            self._disconnect(_HUNG_S)
            link = BusClient(self._servos, self._safety)
            try:
                link.request("torque off", _LET_GO_S)
            finally:
                link.close()

    def beat(self, permitted: Source | None) -> None:
        """A sign of life of the application, with what its supervisor says: whose orders may be followed (None: nobody's)."""
        self._supervised = True
        if (link := self._link) is not None:
            link.put_heartbeat(Heartbeat(time.monotonic(), permitted))

    def send(self, command: Command, *, source: Source = Source.OPERATOR, captured_s: float | None = None) -> Command:
        """Make `command` the newest order.

        Parameters
        ----------
        command : limited to -1..1 and to the joints' speeds.
        source, captured_s : who asks; the program must say when the frame behind it was taken (monotonic).

        Returns
        -------
        Command
            The motion that really left the gate in the newest cycle of the bus, not more than a cycle before this order.

        Raises
        ------
        ValueError
            When a number is not finite; the order before stays.
        BusProcessLost
            Not connected, or the bus process is gone.
        """
        if not all(math.isfinite(number) for number in (command.bend, command.pitch, command.advance_mm_s, command.delivery_mm_s)):
            raise ValueError(f"command is not finite: {command}")
        joints = self._servos.joints
        limited = Command(
            bend=_limited(command.bend, 1.0),
            pitch=_limited(command.pitch, 1.0),
            advance_mm_s=_limited(command.advance_mm_s, joints[4].max_speed_mm_s),
            delivery_mm_s=_limited(command.delivery_mm_s, min(joint.max_speed_mm_s for joint in joints[5:])),
        )
        link = self._connected()
        link.put_order(BusOrder(limited, source, time.monotonic(), captured_s))
        self._live()
        sent = self._sent(link.status())
        return sent.motion if sent is not None else Command()

    def hold(self) -> None:
        """Stop all motion and keep the bend; stays armed."""
        if (link := self._link) is not None:
            link.put_order(BusOrder(None, Source.OPERATOR, time.monotonic()))
            self._live()

    def status(self) -> RobotStatus:
        """Where the robot is, as far as its servos told last (``time_s``, monotonic); 0 for a joint that is not zeroed.

        Raises
        ------
        BusProcessLost
        """
        self._live()
        self._connected()
        self.bus_status()
        if self._truth is not None:
            return self._truth()
        states = [reading for reading in self._states if isinstance(reading, ServoState)]
        if not states:
            return RobotStatus(time.monotonic(), 0.0, 0.0, (0.0,) * 4, (0.0,) * 4)
        at_mm = [state.position_mm or 0.0 for state in states]
        right, left, up, down = (_force_mn(joint, state) for joint, state in zip(self._servos.joints[:4], states[:4], strict=True))
        return RobotStatus(
            time_s=min(state.time_s for state in states),
            insertion_mm=at_mm[4],
            delivery_mm=(at_mm[5] + at_mm[6]) / 2.0,
            tendon_pull_mm=(at_mm[0], at_mm[1], at_mm[2], at_mm[3]),
            tendon_force_mn=(right, left, up, down),
        )

    def bus_status(self) -> BusStatus | None:
        """The newest status of the bus process, also after its end (see ``failure``); None before the first. No heartbeat."""
        link = self._link
        status = link.status() if link is not None else None
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
            torque_off, self._told_offs = status.torque_offs > self._told_offs, status.torque_offs
            if status.phase is BusPhase.CLOSED:
                return BusReport(port_open=False, torque_off=torque_off, torque_problem=status.torque_problem)
            self._reported = status.cycle, status.bad_packets, status.restarts
        errors, rebooted = status.bad_packets - bad_packets, status.restarts > restarts
        report = report_of(status.servos, armed=status.armed, errors=errors, rebooted=rebooted)
        return replace(
            report, armed=status.armed, ended=status.latched, torque_off=torque_off, torque_problem=status.torque_problem
        )

    def sent_motion(self) -> SentMotion | None:
        """What left the gate in the newest cycle since it was armed; None before that, and when it is not armed. No heartbeat.

        Of a bus that has told nothing for a while nobody knows that it sends anything: then it is a hold.
        """
        status = self.bus_status()
        sent = self._sent(status)
        if status is None or sent is None:
            return None
        order = sent.order
        return SentMotion(
            cycle=status.cycle,
            time_s=sent.time_s,
            motion=sent.motion,
            source=order.source if order is not None and order.command is not None else None,
            captured_s=order.captured_s if order is not None else None,
            rejection=status.rejection.reason if status.rejection is not None else None,
            at_end=status.at_end,
        )

    def _sent(self, status: BusStatus | None) -> IssuedGoals | None:
        if status is None or status.sent is None or not status.armed or self.failure is not None:
            return None
        is_late = time.monotonic() - status.time_s > self._safety.bus_hold_s
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
        loading, self._loading = self._loading, None
        if loading is not None:
            loading.end()
        on_close, self._on_close = self._on_close, None
        if on_close is not None:
            on_close()

    def _disconnect(self, patience_s: float = END_S) -> None:
        link, self._link = self._link, None
        if link is not None:
            link.close(patience_s)

    def _connected(self) -> BusClient:
        link = self._link
        if link is None:
            raise BusProcessLost(f"the {self._name} is not connected: connect it first")
        if (failure := link.failure) is not None:
            raise BusProcessLost(failure)
        return link

    def _live(self) -> None:
        """A sign of life of a program without a supervisor."""
        if (link := self._link) is not None and not self._supervised:
            link.put_heartbeat(Heartbeat(time.monotonic(), Source.OPERATOR))


def _force_mn(joint: JointConfig, state: ServoState) -> float:
    """Pull of a wire as the motor's current tells it; 0 for models that report no current."""
    return wire_force_mn(joint, state.current_ma or 0.0)


def _limited(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
