"""Requests to the servos that take seconds, one after another beside the pilot's turns, and the torque-off after a stop."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from enum import Enum
from functools import partial

from core.control.faults import Cause, Fault
from core.control.health import ServoCheckReport, ServoRequestBegun
from core.control.kept_zero import ZeroRequest
from core.control.modes import Event
from core.control.robot import GuardedRobot
from core.devices import DeviceError
from core.messages import message

_log = logging.getLogger(__name__)


class ReleaseState(Enum):
    """States of a torque-off after a stop."""

    IDLE = "idle"
    REQUESTED = "requested"
    """The bus process switches the torque off by itself."""
    BUS_LOST = "bus lost"
    """Requested, but the bus process is gone or hangs: the operator is told, and the pilot tries."""
    CONFIRMED = "confirmed"
    """All servos have reported torque off, and none was asked to switch on since."""


class ReleaseEvent(Enum):
    """Events of a torque-off after a stop."""

    REQUEST = "request"
    """STOP, or another one."""
    LOSE_BUS = "lose bus"
    CONFIRM = "confirm"
    """All servos have reported that their torque is off."""
    SWITCH_ON = "switch on"
    """The servos are asked to switch on: a confirmation holds no longer."""
    CANCEL = "cancel"
    """The operator, who has seen the stop, has switched the servos on."""


def next_state(state: ReleaseState, event: ReleaseEvent) -> ReleaseState:
    """The transition table. The bus process may confirm a torque-off before the pilot's turn handles the stop that requests it."""
    match event, state:
        case ReleaseEvent.REQUEST, ReleaseState.IDLE:
            return ReleaseState.REQUESTED
        case ReleaseEvent.LOSE_BUS, ReleaseState.REQUESTED:
            return ReleaseState.BUS_LOST
        case ReleaseEvent.SWITCH_ON, ReleaseState.CONFIRMED:
            return ReleaseState.IDLE
        case ReleaseEvent.CONFIRM, _:
            return ReleaseState.CONFIRMED
        case ReleaseEvent.CANCEL, _:
            return ReleaseState.IDLE
    return state


RETRY_S = 10.0
"""Between two tries of the pilot: a cable that is plugged in again is found after this long, at the latest."""


class TorqueRelease:
    """The torque-off that a stop requests, until all servos confirm it or are switched on again.

    `is_enabled`: a stop switches the torque off at all (``servos.torque_off_on_stop``).
    """

    def __init__(self, *, is_enabled: bool) -> None:
        self._is_enabled = is_enabled
        self._lock = threading.Lock()
        self._tried_s = -math.inf
        self.state = ReleaseState.IDLE

    @property
    def is_requested(self) -> bool:
        return self.state in {ReleaseState.REQUESTED, ReleaseState.BUS_LOST}

    @property
    def fault(self) -> Fault | None:
        return Fault(Cause.TORQUE_ON, "the servo bus was lost") if self.state is ReleaseState.BUS_LOST else None

    def handle(self, event: ReleaseEvent) -> None:
        with self._lock:
            if event is ReleaseEvent.REQUEST:
                if not self._is_enabled:
                    return
                self._tried_s = -math.inf  # the next try need not wait
            self.state = next_state(self.state, event)

    def is_due(self, now_s: float, *, is_bus_lost: bool, is_busy: bool) -> bool:
        """Whether the pilot must try now; the try counts as made."""
        if not (self.is_requested and is_bus_lost) or is_busy or now_s - self._tried_s < RETRY_S:
            return False
        self._tried_s = now_s
        return True


class Interrupted(DeviceError):
    """STOP or a torque-off came while the servos were being switched on."""


class ServoRequests:
    """Carries requests out in a thread of its own. A request that fails posts the driver's message as a problem of the servos.

    `post` takes the outcome, from that thread.
    """

    def __init__(self, robot: GuardedRobot, post: Callable[[Event], None]) -> None:
        self._robot, self._post = robot, post
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="servo request")
        self._lock = threading.Lock()  # of what follows
        self._stops = 0
        self._offs = self._offs_done = 0
        self._is_blocked = self._is_released = False
        self._releases: list[Future[None]] = []
        self._waiting: list[str] = []

    @property
    def busy(self) -> str:
        """The request in progress, or ""."""
        with self._lock:
            return self._waiting[0] if self._waiting else ""

    @property
    def is_releasing(self) -> bool:
        """Whether a torque-off is under way, or waits."""
        return any(not release.done() for release in self._releases)

    def take_released(self) -> bool:
        """Whether, since the last call, the torque of all servos went off on a robot that is not connected and reports nothing."""
        with self._lock:
            released, self._is_released = self._is_released, False
        return released

    def stop(self) -> None:
        """STOP: what is running or waiting must not switch anything on, and nothing does before an acknowledgement."""
        with self._lock:
            self._stops += 1
            self._is_blocked = True

    def switch_on(self) -> None:
        """Check the servos and switch their torque on; a bus process that is gone is started again."""
        with self._lock:
            asked = self._stops, self._offs
        self._request("checking the servos", lambda: self._switch_on(asked))

    def acknowledge(self) -> None:
        """The operator has seen why the servos were stopped."""
        with self._lock:
            self._is_blocked = False
        self._request("acknowledging", self._robot.acknowledge)

    def zero(self, request: ZeroRequest) -> None:
        """Set where joints are now, or confirm their kept zeros."""
        self._request("zeroing the servos", lambda: self._disarm_and(lambda: self._robot.zero(request)))

    def reboot(self, servo_id: int) -> None:
        """Restart a servo, which clears its hardware error."""
        self._request(message("restarting servo {a}", a=servo_id), lambda: self._disarm_and(lambda: self._robot.reboot(servo_id)))

    def relax(self) -> None:
        """Let the wires go slowly, then switch the torque off; a torque-off that is asked for meanwhile does not wait for it."""
        with self._lock:
            asked = self._offs
        relax = partial(self._robot.relax, lambda: self._offs != asked)
        self._request("relaxing the wires", lambda: self._disarm_and(relax))

    def torque_off(self, *, is_bus_lost: bool = False) -> None:
        """Let the wires go slack after what is under way, but for a relaxation, which it ends; servos being switched on stay off.

        A lost bus is not held first.
        """
        with self._lock:
            self._offs += 1
            asked = self._offs
        release = self._request("switching the torque off", lambda: self._switch_off(asked, is_bus_lost=is_bus_lost))
        self._releases = [one for one in (*self._releases, release) if one is not None and not one.done()]

    def close(self) -> None:
        """Begin nothing more but a torque-off that waits, and wait for one that is under way. Other requests end when the robot is
        closed."""
        self.stop()
        self._worker.shutdown(wait=False, cancel_futures=True)
        wait([release for release in self._releases if not release.cancelled()])
        with self._lock:
            is_off_left = self._offs_done < self._offs
        if is_off_left:
            try:
                self._robot.torque_off()
            except DeviceError as error:
                _log.error("the torque is not proven to be off: %s", error)

    def _request(self, what: str, do: Callable[[], None]) -> Future[None] | None:
        def run() -> None:
            try:
                do()
            except DeviceError as error:
                self._post(ServoCheckReport((str(error),)))
            except Exception as error:  # noqa: BLE001 - top of the thread: the future is never looked at
                _log.error("%s failed", what, exc_info=error)
                self._post(
                    ServoCheckReport(
                        (
                            message(
                                "{what} failed ({kind}: {why}): start the rig again",
                                what=what,
                                kind=type(error).__name__,
                                why=error,
                            ),
                        )
                    )
                )
            finally:
                self._end(what)

        with self._lock:
            self._waiting.append(what)
        try:
            return self._worker.submit(run)
        except RuntimeError:  # closed already
            self._end(what)
            return None

    def _end(self, what: str) -> None:
        with self._lock:
            self._waiting.remove(what)

    def _switch_on(self, asked: tuple[int, int]) -> None:
        robot = self._robot
        self._post(ServoRequestBegun())
        self._check(asked)
        if robot.failure is not None:
            robot.connect()
        for step in (robot.disarm, robot.acknowledge, robot.arm):
            self._check(asked)
            step()
        try:
            self._check(asked)
        except Interrupted:
            robot.stop()
            raise
        with self._lock:
            self._offs_done = max(self._offs_done, asked[1])  # earlier torque-offs are over, whatever became of them
        self._post(ServoCheckReport())

    def _switch_off(self, asked: int, *, is_bus_lost: bool) -> None:
        self._post(ServoRequestBegun())
        # a servo that is missing, or a hold that fails, is no reason to let the others pull
        with contextlib.suppress(DeviceError):
            if self._robot.failure is not None:
                self._robot.connect()
            elif not is_bus_lost:
                self._robot.disarm()
        self._robot.torque_off()
        with self._lock:
            self._offs_done = asked
            self._is_released = self._is_released or self._robot.failure is not None  # no report tells it

    def _check(self, asked: tuple[int, int]) -> None:
        """Raise Interrupted when a stop or a torque-off came since the request."""
        with self._lock:
            is_stopped, is_off = self._is_blocked or self._stops != asked[0], self._offs != asked[1]
        if is_stopped:
            raise Interrupted("stopped meanwhile: acknowledge, then switch the servos on again")
        if is_off:
            raise Interrupted("the torque was switched off meanwhile: switch the servos on again")

    def _disarm_and(self, do: Callable[[], None]) -> None:
        self._post(ServoRequestBegun())
        self._robot.disarm()
        do()
