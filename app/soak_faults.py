"""Random faults of a soak: each breaks something for a while and mends it; what the operator must do afterwards is his."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from app.soak_rig import SoakRig
from hardware.twin.servo_device import OVERLOAD_BIT

Undo = Callable[[], None]
_EVERY_S = (4.0, 15.0)
_SAFE_C, _SAFE_V = 25.0, 12.0


@dataclass(frozen=True, slots=True)
class Trouble:
    """``do`` breaks it and returns what mends it; ``lasts_s`` is between these."""

    name: str
    do: Callable[[SoakRig, random.Random], Undo]
    lasts_s: tuple[float, float]


def _mute(rig: SoakRig, draw: random.Random) -> Undo:
    servo = draw.randint(1, 7)
    rig.bus.faults.mute(servo)
    return lambda: rig.bus.faults.mute(servo, False)


def _noise(rig: SoakRig, draw: random.Random) -> Undo:
    rig.bus.faults.crc(draw.randint(1, 12))
    rig.bus.faults.garbage(draw.randint(0, 40))
    return lambda: rig.bus.faults.crc(0)


def _vanish(rig: SoakRig, draw: random.Random) -> Undo:
    rig.bus.vanish()
    return rig.bus.reappear


def _restart(rig: SoakRig, draw: random.Random) -> Undo:
    rig.bus.stir(draw.randint(1, 7), lambda servo: servo.restart())
    return lambda: None


def _overload(rig: SoakRig, draw: random.Random) -> Undo:
    rig.bus.stir(draw.randint(1, 7), lambda servo: servo.alert(OVERLOAD_BIT))
    return lambda: None


def _jam(rig: SoakRig, draw: random.Random) -> Undo:
    servo = draw.randint(1, 7)
    rig.bus.stir(servo, lambda device: device.freeze(True))
    return lambda: rig.bus.stir(servo, lambda device: device.freeze(False))


def _heat(rig: SoakRig, draw: random.Random) -> Undo:
    servo, hot_c = draw.randint(1, 7), draw.uniform(60.0, 74.0)
    rig.bus.stir(servo, lambda device: device.heat(hot_c))
    return lambda: rig.bus.stir(servo, lambda device: device.heat(_SAFE_C))


def _sag(rig: SoakRig, draw: random.Random) -> Undo:
    low_v = draw.uniform(10.1, 11.2)

    def supply(volts: float) -> None:
        for servo in range(1, 8):
            rig.bus.stir(servo, lambda device: setattr(device, "supply_v", volts))

    supply(low_v)
    return lambda: supply(_SAFE_V)


def _set(name: str, value: Callable[[random.Random], object], rest: object) -> Callable[[SoakRig, random.Random], Undo]:
    def do(rig: SoakRig, draw: random.Random) -> Undo:
        setattr(rig.mischief, name, value(draw))
        return lambda: setattr(rig.mischief, name, rest)

    return do


TROUBLES = (
    Trouble("servo silent", _mute, (0.1, 2.0)),
    Trouble("bad packets", _noise, (0.5, 1.0)),
    Trouble("port vanishes", _vanish, (0.5, 3.0)),
    Trouble("servo restarts", _restart, (0.0, 0.0)),
    Trouble("overload", _overload, (0.0, 0.0)),
    Trouble("jam", _jam, (0.2, 2.0)),
    Trouble("heat", _heat, (1.0, 3.0)),
    Trouble("supply sags", _sag, (1.0, 3.0)),
    Trouble("camera silent", _set("silent", lambda draw: True, False), (0.1, 1.5)),
    Trouble("camera frozen", _set("frozen", lambda draw: True, False), (0.3, 1.5)),
    Trouble("picture black or white", _set("level", lambda draw: draw.choice((0, 255)), None), (0.2, 1.0)),
    Trouble("camera moved", _set("shift_px", lambda draw: draw.choice((-30, 12, 25)), 0), (1.0, 3.0)),
    Trouble("perception slow", _set("perceive_s", lambda draw: draw.uniform(0.1, 0.7), 0.0), (0.5, 2.0)),
    Trouble("perception breaks", _set("raises", lambda draw: True, False), (0.0, 0.5)),
)


class RandomFaults:
    """One trouble at a time, with pauses. ``turn`` is called often; ``forget`` when the rig is another one."""

    def __init__(self, seed: int) -> None:
        self._draw = random.Random(seed)
        self._next_s: float | None = None
        self._undo: tuple[float, Undo] | None = None
        self.count: Counter[str] = Counter()

    def turn(self, rig: SoakRig, now_s: float) -> None:
        if self._undo is not None:
            if now_s >= self._undo[0]:
                self._undo[1]()
                self._undo = None
            return
        if self._next_s is None:
            self._next_s = now_s + self._draw.uniform(*_EVERY_S)
        if now_s < self._next_s:
            return
        trouble = self._draw.choice(TROUBLES)
        self.count[trouble.name] += 1
        self._undo = now_s + self._draw.uniform(*trouble.lasts_s), trouble.do(rig, self._draw)
        self._next_s = None

    def forget(self) -> None:
        """What was broken is gone with its rig."""
        self._undo = self._next_s = None


def names() -> Iterator[str]:
    """Of all troubles."""
    return (trouble.name for trouble in TROUBLES)
