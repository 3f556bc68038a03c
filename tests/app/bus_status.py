"""Statuses of a servo bus in which all is well, but for what a test changes."""

from __future__ import annotations

from dataclasses import replace

from core.config.safety import ServosConfig
from hardware.servos.bus_ipc import BusPhase, BusStatus, CycleTimes
from hardware.servos.dynamixel_port import LineCounts
from hardware.servos.registers import HardwareError, ServoReading, ServoState

SERVOS = ServosConfig()
MINUS, DASH = "\N{MINUS SIGN}", "\N{EN DASH}"


def servo(place: int, **changes: object) -> ServoState:
    """A servo that holds its joint: tendons at the pretension of 0.3 mm, feeds at 20 mm."""
    joint = SERVOS.joints[place]
    at_mm = 0.3 if place < 4 else 20.0
    state = ServoState(
        joint.name, joint.id, 100.0, 1000, 1000, at_mm, at_mm, 0.0, 8.07, 12.0, 31.0, HardwareError(0), torque=True,
        watchdog_tripped=False,
    )  # fmt: skip
    return replace(state, **changes)


def bus(*others: ServoReading, **changes: object) -> BusStatus:
    """An armed bus; `others` replace the servos of the same name."""
    by_name = {reading.name: reading for reading in others}
    servos = tuple(by_name.get(joint.name, servo(place)) for place, joint in enumerate(SERVOS.joints))
    status = BusStatus(
        cycle=1, time_s=100.0, phase=BusPhase.ARMED, servos=servos, active=(), latched=None, fault_counts={}, sent=None,
        rejection=None, clamps=(), at_end=(), rejections={}, clamp_count=12, line=LineCounts(), bad_packets=3, restarts=0,
        times=CycleTimes(20.0, 21.4, 4.0, 6.0), zeroed=(True,) * 7,
    )  # fmt: skip
    return replace(status, **changes)
