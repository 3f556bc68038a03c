"""What the operator asks of the servos and what takes them time: done one after another, beside the pilot's turns."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from core.control.guarded_robot import GuardedRobot
from core.control.health import ServosChecked, ServosOff
from core.control.modes import Event
from core.devices import DeviceError
from core.servo_config import JointName

_log = logging.getLogger(__name__)


class Interrupted(DeviceError):
    """STOP came while the servos were being switched on."""


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
        self._blocked = False
        self.busy = ""

    def stopped(self) -> None:
        """STOP: what is running or waiting must not switch anything on, and nothing does before an acknowledgement."""
        with self._lock:
            self._stops += 1
            self._blocked = True

    def switch_on(self) -> None:
        """Check the servos and switch their torque on; a bus process that is gone is started again."""
        stops = self._stops
        self._request("checking the servos", lambda: self._switch_on(stops))

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

    def torque_off(self) -> None:
        """Let the wires go slack."""
        self._request("switching the torque off", lambda: self._off_and(self._robot.torque_off))

    def close(self) -> None:
        """Let nothing more begin. What is under way ends by itself when the robot is closed."""
        self.stopped()
        self._worker.shutdown(wait=False, cancel_futures=True)

    def _request(self, what: str, do: Callable[[], None]) -> None:
        def run() -> None:
            try:
                do()
            except DeviceError as error:
                self._post(ServosChecked((str(error),)))
            except Exception as error:  # noqa: BLE001 - top of the thread: nobody would ever look at the future
                _log.error("%s failed", what, exc_info=error)
                self._post(ServosChecked((f"{what} failed ({type(error).__name__}: {error}): start the rig again",)))
            finally:
                self.busy = ""

        self.busy = what
        try:
            self._worker.submit(run)
        except RuntimeError:  # closed already
            self.busy = ""

    def _switch_on(self, stops: int) -> None:
        robot = self._robot
        self._post(ServosOff())
        if robot.failure is not None and self._may_go_on(stops):
            robot.connect()
        for step in (robot.disarm, robot.acknowledge, robot.arm):
            if not self._may_go_on(stops):
                raise Interrupted("stopped meanwhile: acknowledge, then switch the servos on again")
            step()
        if not self._may_go_on(stops):
            robot.stop()
            raise Interrupted("stopped meanwhile: acknowledge, then switch the servos on again")
        self._post(ServosChecked())

    def _may_go_on(self, stops: int) -> bool:
        with self._lock:
            return self._stops == stops and not self._blocked

    def _off_and(self, do: Callable[[], None]) -> None:
        """Nobody drives any more before the servos were switched on again."""
        self._post(ServosOff())
        self._robot.disarm()
        do()
