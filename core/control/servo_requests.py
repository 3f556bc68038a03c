"""What the operator asks of the servos and what takes them time: done one after another, beside the pilot's turns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from core.control.guarded_robot import GuardedRobot
from core.control.health import ServosChecked
from core.control.modes import Event
from core.devices import DeviceError
from core.servo_config import JointName


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
        self.busy = ""

    def switch_on(self) -> None:
        """Check the servos and switch their torque on; a bus process that is gone is started again."""
        self._request("checking the servos", self._switch_on)

    def acknowledge(self) -> None:
        self._request("acknowledging", self._robot.acknowledge)

    def zero(self, names: Sequence[JointName] | None = None) -> None:
        """The present positions are zero, of all joints or of those named; the wires must be slack."""
        self._request("zeroing the servos", lambda: self._zero(names))

    def reboot(self, servo_id: int) -> None:
        self._request(f"restarting servo {servo_id}", lambda: self._reboot(servo_id))

    def torque_off(self) -> None:
        self._request("switching the torque off", self._torque_off)

    def close(self) -> None:
        self._worker.shutdown(wait=True, cancel_futures=True)

    def _request(self, what: str, do: Callable[[], None]) -> None:
        def run() -> None:
            self.busy = what
            try:
                do()
            except DeviceError as error:
                self._post(ServosChecked((str(error),)))
            finally:
                self.busy = ""

        self._worker.submit(run)

    def _switch_on(self) -> None:
        robot = self._robot
        if robot.failure is not None:
            robot.connect()
        robot.disarm()
        robot.acknowledge()
        robot.arm()
        self._post(ServosChecked())

    def _zero(self, names: Sequence[JointName] | None) -> None:
        self._off("zeroed")
        self._robot.zero(names)

    def _reboot(self, servo_id: int) -> None:
        self._off(f"servo {servo_id} was restarted")
        self._robot.reboot(servo_id)

    def _torque_off(self) -> None:
        self._off("the torque is off")
        self._robot.torque_off()

    def _off(self, why: str) -> None:
        """Nobody drives before the servos were switched on again."""
        self._post(ServosChecked((f"{why}: switch the servos on",)))
        self._robot.disarm()
