"""The twin's robot without servos in between, under the pilot's rules: no bus, no process, the lightest load on the machine."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import replace

from core.control.bus_watch import BusReport
from core.control.gate import Rejection, RejectReason, Source
from core.control.guarded_robot import SentMotion
from core.safety_config import SafetyConfig
from core.servo_config import JOINT_NAMES, JointName
from core.types import Command, RobotStatus
from hardware.twin.robot import TwinRobot

_WELL = BusReport(
    misses=(0,) * len(JOINT_NAMES),
    hardware_errors=(0,) * len(JOINT_NAMES),
    temperatures_c=(25.0,) * len(JOINT_NAMES),
    voltages_v=(12.0,) * len(JOINT_NAMES),
    tracking_mm=(0.0,) * len(JOINT_NAMES),
)
"""Servos that do not exist are always well."""


class DirectRobot:
    """Follows the orders of whoever the newest ``beat`` permits, while it is fresh. All methods may be called from any thread."""

    def __init__(self, robot: TwinRobot, safety: SafetyConfig) -> None:
        self._robot, self._safety = robot, safety
        self._lock = threading.Lock()
        self._permitted: Source | None = None
        self._beat_s = -1.0
        self._armed = False
        self._cycle = 0
        self._sent: SentMotion | None = None
        self._waiting: SentMotion | None = None

    @property
    def name(self) -> str:
        return self._robot.name

    @property
    def failure(self) -> str | None:
        return None

    def connect(self) -> None:
        self._robot.connect()

    def beat(self, permitted: Source | None) -> None:
        """Who may drive; holds good for 100 ms. An order that came just before its permission is followed now."""
        with self._lock:
            self._permitted, self._beat_s = permitted, time.monotonic()
            waiting, self._waiting = self._waiting, None
            if waiting is not None and self._beat_s - waiting.time_s <= self._safety.command_max_age_s:
                self._follow(waiting)

    def send(self, command: Command, *, source: Source = Source.OPERATOR, captured_s: float | None = None) -> Command:
        """Make the command the current one if its source may drive; otherwise the robot holds."""
        with self._lock:
            return self._follow(SentMotion(0, time.monotonic(), command, source, captured_s))

    def hold(self) -> None:
        with self._lock:
            self._waiting = None
            self._hold(None)

    def stop(self) -> None:
        with self._lock:
            self._armed, self._waiting = False, None
            self._robot.hold()

    def arm(self) -> None:
        with self._lock:
            self._armed = True

    def disarm(self) -> None:
        self.stop()

    def acknowledge(self) -> None:
        """There is nothing that latches."""

    def zero(self, names: Sequence[JointName] | None = None) -> None:
        """There is nothing to zero."""

    def reboot(self, servo_id: int) -> None:
        """There is nothing to restart."""

    def torque_off(self) -> None:
        self.stop()

    def report(self) -> BusReport | None:
        with self._lock:
            return replace(_WELL, armed=self._armed)

    def sent_motion(self) -> SentMotion | None:
        with self._lock:
            return self._sent if self._armed else None

    def kept_back(self) -> Rejection | None:
        """There is no gate: what is sent is done."""
        return None

    def status(self) -> RobotStatus:
        return self._robot.status()

    def close(self) -> None:
        self._robot.close()

    def _follow(self, order: SentMotion) -> Command:
        """Do as the order says if its source may drive; else hold, and keep it for a permission that follows at once."""
        self._waiting = None
        is_stale = time.monotonic() - self._beat_s > self._safety.command_max_age_s
        if not self._armed or is_stale or self._permitted is None:
            self._hold(RejectReason.NOT_ARMED)
            self._waiting = order
            return Command()
        if order.source is not self._permitted:
            self._hold(RejectReason.WRONG_SOURCE)
            self._waiting = order
            return Command()
        sent = self._robot.send(order.motion)
        self._note(replace(order, motion=sent))
        return sent

    def _hold(self, rejection: RejectReason | None) -> None:
        self._robot.hold()
        self._note(SentMotion(0, time.monotonic(), self._robot.current_command, rejection=rejection))

    def _note(self, sent: SentMotion) -> None:
        self._cycle += 1
        self._sent = SentMotion(self._cycle, sent.time_s, sent.motion, sent.source, sent.captured_s, sent.rejection)
