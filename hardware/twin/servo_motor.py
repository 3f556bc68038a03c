"""A servo's motor: trapezoidal motion to a goal, current from what it pushes against, heat from the current. Pure.

Simple but physical: figures of an XM430-W350 at 12 V, from its data sheet where that has one (speed, stall current, torque).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

TICKS_PER_TURN = 4096
MAX_TICKS_S = 46.0 / 60.0 * TICKS_PER_TURN
"""No-load speed."""
STALL_MA = 2300.0
_TORQUE_NM_PER_A = 1.78
_STAND_MA, _FRICTION_MA = 8.0, 40.0
_STIFFNESS_MA_PER_TICK = 12.0
_OVERLOAD_SHARE, _OVERLOAD_S = 0.8, 1.0
_HEAT_C, _HEAT_TIME_S = 400.0, 180.0
"""Rise of temperature at stall if it lasted, and the time constant."""
_STEP_S = 0.002
_MAX_STEPS = 5000


@dataclass(slots=True)
class Drive:
    """What the servo's registers ask for. Ticks, ticks/s, ticks/s^2; ``acceleration`` 0 means none is prescribed."""

    torque: bool = False
    goal: int = 0
    speed: float = MAX_TICKS_S
    acceleration: float = 0.0


class ServoMotor:
    """Position in ticks since the twin was built: it turns on whatever the servo's registers make of it.

    ``trajectory`` is where the profile wants the horn, ``position`` where it is: the same, unless the horn is frozen. ``grinds_ma``
    is what it draws beyond friction, as with a damaged gear: it still goes where it shall. ``carried_ticks_s``: something
    stronger turns the horn, wherever the goal is.
    """

    def __init__(self, position: float, ambient_c: float = 25.0) -> None:
        self.position = self.trajectory = position
        self.velocity = 0.0
        self.ambient_c = ambient_c
        self.temperature_c = ambient_c
        self.load_mnm = 0.0
        self.grinds_ma = self.carried_ticks_s = 0.0
        self.frozen = False
        self._overloaded_s = 0.0

    def step(self, drive: Drive, duration_s: float) -> None:
        """Let time pass. A pause of more than 10 s is cut: nothing changes in it any more but the temperature."""
        self._warm(drive, duration_s)
        strained = drive.torque and abs(self.current_ma(drive)) > _OVERLOAD_SHARE * STALL_MA
        self._overloaded_s = self._overloaded_s + duration_s if strained else 0.0
        if self.carried_ticks_s:
            self.position += self.carried_ticks_s * duration_s
        if not drive.torque or self.carried_ticks_s:
            self.velocity, self.trajectory = 0.0, self.position
            return
        steps = min(_MAX_STEPS, math.ceil(duration_s / _STEP_S - 1e-9))
        part_s = min(duration_s, _MAX_STEPS * _STEP_S) / max(1, steps)
        for _ in range(steps):
            if self.trajectory == drive.goal and self.velocity == 0.0:
                break
            self._move(drive, part_s)
        if not self.frozen:
            self.position = self.trajectory

    def _move(self, drive: Drive, part_s: float) -> None:
        """One step along the profile: as fast as can still be braked in time."""
        way = drive.goal - self.trajectory
        fastest = min(drive.speed, MAX_TICKS_S)
        if drive.acceleration <= 0.0:
            self.velocity = math.copysign(min(fastest, abs(way) / part_s), way)
        else:
            gain = drive.acceleration * part_s
            # Speed from which steps of `gain` still end at the goal.
            braked = max(0.0, math.sqrt(2.0 * drive.acceleration * abs(way) + gain**2 / 4.0) - gain / 2.0)
            wanted = math.copysign(min(fastest, braked, abs(way) / part_s), way)
            self.velocity += max(-gain, min(gain, wanted - self.velocity))
        move = self.velocity * part_s
        if abs(way - move) < 0.5 and abs(self.velocity) <= max(2.0 * drive.acceleration * part_s, 1.0 / part_s):
            self.trajectory, self.velocity = float(drive.goal), 0.0
        else:
            self.trajectory += move

    def stop(self) -> None:
        """Stand still where the horn is, as at a tripped watchdog."""
        self.trajectory, self.velocity = self.position, 0.0

    def current_ma(self, drive: Drive) -> float:
        """Motor current: load, friction, and the pull towards a trajectory that the horn does not follow."""
        if not drive.torque:
            return 0.0
        lag = self.trajectory - self.position
        friction = math.copysign(_FRICTION_MA, self.velocity) if self.velocity else _STAND_MA
        grinding = math.copysign(self.grinds_ma, friction)
        current = self.load_mnm / _TORQUE_NM_PER_A + friction + grinding + _STIFFNESS_MA_PER_TICK * lag
        return max(-STALL_MA, min(STALL_MA, current))

    @property
    def is_overloaded(self) -> bool:
        """Too much current for too long: the servo switches itself off."""
        return self._overloaded_s > _OVERLOAD_S

    def _warm(self, drive: Drive, duration_s: float) -> None:
        end_c = self.ambient_c + _HEAT_C * (self.current_ma(drive) / STALL_MA) ** 2
        self.temperature_c += (end_c - self.temperature_c) * -math.expm1(-duration_s / _HEAT_TIME_S)
