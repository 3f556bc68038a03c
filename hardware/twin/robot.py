"""The twin's robot behind the ``Robot`` protocol: it keeps the current command, which the world applies as it steps the physics."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import replace

from core.devices import DeviceError
from core.types import Command, RobotStatus
from hardware.twin.physics import TwinPhysics

MAX_ADVANCE_MM_S = 20.0
MAX_DELIVERY_MM_S = 10.0


class TwinRobot:
    """Clamps commands to the robot's limits and holds the last one. All methods may be called from any thread."""

    def __init__(
        self, physics: TwinPhysics, *, max_advance_mm_s: float = MAX_ADVANCE_MM_S, max_delivery_mm_s: float = MAX_DELIVERY_MM_S
    ) -> None:
        self._physics = physics
        self._max_advance_mm_s = max_advance_mm_s
        self._max_delivery_mm_s = max_delivery_mm_s
        self._lock = threading.Lock()
        self._command = Command()
        self._connected = False
        self._sent_s = time.monotonic()

    @property
    def name(self) -> str:
        return "bench twin"

    @property
    def current_command(self) -> Command:
        """What the world applies now."""
        with self._lock:
            return self._command

    def connect(self) -> None:
        """Ready for commands, at rest."""
        with self._lock:
            self._command = Command()
            self._connected = True

    def send(self, command: Command) -> Command:
        """Make `command`, clamped to the limits, the current one; returns what was really sent.

        Raises
        ------
        ValueError
            When a number is not finite; the current command stays.
        DeviceError
            When the robot is not connected.
        """
        values = (command.bend, command.pitch, command.advance_mm_s, command.delivery_mm_s)
        if not all(math.isfinite(value) for value in values):
            raise ValueError(f"command is not finite: {command}")
        sent = Command(
            bend=_clamp(command.bend, 1.0),
            pitch=_clamp(command.pitch, 1.0),
            advance_mm_s=_clamp(command.advance_mm_s, self._max_advance_mm_s),
            delivery_mm_s=_clamp(command.delivery_mm_s, self._max_delivery_mm_s),
        )
        with self._lock:
            if not self._connected:
                raise DeviceError("the bench twin's robot is not connected: call connect() first")
            self._command = sent
            self._sent_s = time.monotonic()
        return sent

    def command_age_s(self) -> float:
        """Time since the last command came; the living world holds a robot whose driver has fallen silent."""
        with self._lock:
            return time.monotonic() - self._sent_s

    def hold(self) -> None:
        """Stop all motion and keep the bend."""
        with self._lock:
            self._command = replace(self._command, advance_mm_s=0.0, delivery_mm_s=0.0)

    def status(self) -> RobotStatus:
        return self._physics.status()

    def close(self) -> None:
        """Hold; further commands are refused."""
        self.hold()
        with self._lock:
            self._connected = False


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
