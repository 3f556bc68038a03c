"""What the operator asks of the servos and what takes them time: done one after another, beside the pilot's turns."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait

from core.control.guarded_robot import GuardedRobot
from core.control.health import ServosChecked, ServosOff
from core.control.modes import Event
from core.devices import DeviceError
from core.servo_config import JointName

_log = logging.getLogger(__name__)


class Interrupted(DeviceError):
    """STOP, or the wish to let the wires go, came while the servos were being switched on."""


class ServoRequests:
    """A request that fails tells the supervisor, in the driver's words, that the servos are not in order.

    Parameters
    ----------
    robot : whose servos.
    post : takes the outcome, from another thread.
    """

    def __init__(self, robot: GuardedRobot, post: Callable[[Event], None]) -> None:
        self._robot, self._post = robot, post
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="servo request")
        self._lock = threading.Lock()
        self._stops = 0
        self._offs = self._offs_done = 0
        self._blocked = self._let_go = False
        self._releases: list[Future[None]] = []
        self._waiting: list[str] = []

    @property
    def busy(self) -> str:
        """What is being done; "" for nothing."""
        with self._lock:
            return self._waiting[0] if self._waiting else ""

    @property
    def is_letting_go(self) -> bool:
        """Whether a torque-off is under way, or waits."""
        return any(not release.done() for release in self._releases)

    def take_let_go(self) -> bool:
        """Whether the torque went off since the last call, of all servos of a robot that is not connected and reports nothing."""
        with self._lock:
            let_go, self._let_go = self._let_go, False
        return let_go

    def stopped(self) -> None:
        """STOP: what is running or waiting must not switch anything on, and nothing does before an acknowledgement."""
        with self._lock:
            self._stops += 1
            self._blocked = True

    def switch_on(self) -> None:
        """Check the servos and switch their torque on; a bus process that is gone is started again."""
        with self._lock:
            asked = self._stops, self._offs
        self._request("checking the servos", lambda: self._switch_on(asked))

    def acknowledge(self) -> None:
        """The operator has seen why the servos were stopped."""
        with self._lock:
            self._blocked = False
        self._request("acknowledging", self._robot.acknowledge)

    def zero(self, names: Sequence[JointName] | None = None) -> None:
        """The present positions are zero, of all joints or of those named; the wires must be slack."""
        self._request("zeroing the servos", lambda: self._off_and(lambda: self._robot.zero(names)))

    def reboot(self, servo_id: int) -> None:
        """Restart a servo, which clears its hardware error."""
        self._request(f"restarting servo {servo_id}", lambda: self._off_and(lambda: self._robot.reboot(servo_id)))

    def torque_off(self, *, is_lost: bool = False) -> None:
        """Let the wires go slack, at once after what is under way; servos that are being switched on are not. `is_lost`: nothing is
        heard from their bus, and nobody need wait for its hold."""
        with self._lock:
            self._offs += 1
            asked = self._offs
        release = self._request("switching the torque off", lambda: self._switch_off(asked, is_lost=is_lost))
        self._releases = [one for one in (*self._releases, release) if one is not None and not one.done()]

    def close(self) -> None:
        """Let nothing more begin but a torque-off that waits; one that is under way is waited for. All else that is ends by itself
        when the robot is closed."""
        self.stopped()
        self._worker.shutdown(wait=False, cancel_futures=True)
        wait([release for release in self._releases if not release.cancelled()])
        with self._lock:
            owes_off = self._offs_done < self._offs
        if owes_off:
            try:
                self._robot.torque_off()
            except DeviceError as error:
                _log.error("the torque is not proven to be off: %s", error)

    def _request(self, what: str, do: Callable[[], None]) -> Future[None] | None:
        def run() -> None:
            try:
                do()
            except DeviceError as error:
                self._post(ServosChecked((str(error),)))
            except Exception as error:  # noqa: BLE001 - top of the thread: nobody would ever look at the future
                _log.error("%s failed", what, exc_info=error)
                self._post(ServosChecked((f"{what} failed ({type(error).__name__}: {error}): start the rig again",)))
            finally:
                self._ended(what)

        with self._lock:
            self._waiting.append(what)
        try:
            return self._worker.submit(run)
        except RuntimeError:  # closed already
            self._ended(what)
            return None

    def _ended(self, what: str) -> None:
        with self._lock:
            self._waiting.remove(what)

    def _switch_on(self, asked: tuple[int, int]) -> None:
        robot = self._robot
        self._post(ServosOff())
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
            self._offs_done = max(self._offs_done, asked[1])  # what was asked for before is over, whatever became of it
        self._post(ServosChecked())

    def _switch_off(self, asked: int, *, is_lost: bool) -> None:
        """Also where the bus process is gone, and where not all servos are there to connect: no reason to let the others pull."""
        self._post(ServosOff())
        with contextlib.suppress(DeviceError):  # nor is a hold that fails
            if self._robot.failure is not None:
                self._robot.connect()
            elif not is_lost:
                self._robot.disarm()
        self._robot.torque_off()
        with self._lock:
            self._offs_done = asked
            self._let_go = self._let_go or self._robot.failure is not None  # no report tells it

    def _check(self, asked: tuple[int, int]) -> None:
        """Raise Interrupted when something came since that speaks against switching on."""
        with self._lock:
            is_stopped, is_off = self._blocked or self._stops != asked[0], self._offs != asked[1]
        if is_stopped:
            raise Interrupted("stopped meanwhile: acknowledge, then switch the servos on again")
        if is_off:
            raise Interrupted("the torque was switched off meanwhile: switch the servos on again")

    def _off_and(self, do: Callable[[], None]) -> None:
        """Nobody drives any more before the servos were switched on again."""
        self._post(ServosOff())
        self._robot.disarm()
        do()
