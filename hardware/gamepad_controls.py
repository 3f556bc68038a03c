"""What a gamepad's sticks and buttons mean. Pure: events of the Linux joystick interface in, states out."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from core.gamepad_config import GamepadConfig

EVENT = struct.Struct("IhBB")
"""``js_event`` of linux/joystick.h: time in ms, value, type, number."""
BUTTON, AXIS, INIT = 0x01, 0x02, 0x80
_FULL = 32767
SETTLE_S = 0.3
"""What was held when the gamepad was found has been reported by then."""


class Axis(Enum):
    """Axes that drive, by their codes in linux/input-event-codes.h. Triggers rest at the negative end."""

    LEFT_X = 0x00
    LEFT_Y = 0x01
    LEFT_TRIGGER = 0x02
    RIGHT_Y = 0x04
    RIGHT_TRIGGER = 0x05


class Button(Enum):
    """Buttons that mean something, by their codes: the right one of the four (B, circle), and the right shoulder."""

    STOP = 0x131
    DEADMAN = 0x137


GAMEPAD_BUTTON = 0x130
"""BTN_GAMEPAD, the lower one of the four (A, cross): whoever has it is a gamepad, not a wheel or a motion sensor."""
RIGHT_STICK = frozenset({0x03, 0x04})
"""ABS_RX and ABS_RY. Whoever has its right stick elsewhere has it where the triggers are here, and its buttons are others."""
_TRIGGERS = (Axis.LEFT_TRIGGER, Axis.RIGHT_TRIGGER)


@dataclass(frozen=True, slots=True)
class Layout:
    """Code of each axis and button, by its number. The default is that of Xbox and PlayStation gamepads."""

    axes: Sequence[int] = tuple(range(6))
    buttons: Sequence[int] = (0x130, 0x131, 0x133, 0x134, 0x136, 0x137)


@dataclass(frozen=True, slots=True)
class GamepadState:
    """How the controls are held, at ``time_s`` on the monotonic clock; each rate -1..1 of full speed.

    Positive: bend to the robot's right as seen on screen, pitch up, advance and sheath forward. ``deadman`` is None when the
    configuration does not make the gamepad a deadman. ``stop``: the STOP button is down.
    """

    bend_rate: float = 0.0
    pitch_rate: float = 0.0
    advance: float = 0.0
    delivery: float = 0.0
    deadman: bool | None = None
    stop: bool = False
    time_s: float = 0.0


def shaped(value: float, dead_zone: float, expo: float) -> float:
    """A deflection of -1..1 without its dead zone: 0 inside, 1 at the end, without a step between; `expo` mixes in the cube.

    Each axis by itself, not the stick as a whole: who pushes forward must not bend.
    """
    way = (min(abs(value), 1.0) - dead_zone) / (1.0 - dead_zone)
    return math.copysign((1.0 - expo) * way + expo * way**3, value) if way > 0.0 else 0.0


class GamepadControls:
    """From events to states.

    Nothing moves by what was so at the start: a control counts once it has been at rest, ``SETTLE_S`` after the first event or
    later. Earlier, the kernel may say "at rest" of a stick or button that is held and that it has not heard yet, for many gamepads
    report only after somebody has opened them. Triggers that have not been touched may stand in the middle of their way. Only STOP
    counts at once.
    """

    def __init__(self, config: GamepadConfig, layout: Layout | None = None) -> None:
        self._config = config
        layout = layout or Layout()
        axes, buttons = {axis.value for axis in Axis}, {button.value for button in Button}
        self._axis_of = {number: Axis(code) for number, code in enumerate(layout.axes) if code in axes}
        self._button_of = {number: Button(code) for number, code in enumerate(layout.buttons) if code in buttons}
        self._deflection: dict[Axis, float] = {}
        self._down: dict[Button, bool] = {}
        self._counts: set[Axis | Button] = set()
        self._first_s: float | None = None
        self._rest = b""

    def feed(self, data: bytes, now_s: float) -> list[GamepadState]:
        """All events that wait, in whatever pieces; the states in between at which STOP or the deadman changed."""
        if self._first_s is None and data:
            self._first_s = now_s
        data = self._rest + data
        end = len(data) - len(data) % EVENT.size
        self._rest = data[end:]
        changes = []
        for _, value, kind, number in EVENT.iter_unpack(data[:end]):
            if kind & ~INIT == AXIS and number in self._axis_of:
                axis = self._axis_of[number]
                self._deflection[axis] = (value / _FULL + 1.0) / 2.0 if axis in _TRIGGERS else value / _FULL
            elif kind & ~INIT == BUTTON and number in self._button_of:
                self._down[self._button_of[number]] = value != 0
                changes.append(self._state(now_s))
        self._settle(now_s)
        return changes

    def tick(self, now_s: float) -> GamepadState:
        """The state when no event waits."""
        self._settle(now_s)
        return self._state(now_s)

    def _settle(self, now_s: float) -> None:
        if self._first_s is not None and now_s - self._first_s >= SETTLE_S:
            self._counts.update(axis for axis, value in self._deflection.items() if abs(value) <= self._config.dead_zone)
            self._counts.update(button for button, down in self._down.items() if not down)

    def _rate(self, axis: Axis) -> float:
        return shaped(self._deflection[axis], self._config.dead_zone, self._config.expo) if axis in self._counts else 0.0

    def _state(self, now_s: float) -> GamepadState:
        held = self._down.get(Button.DEADMAN, False) and Button.DEADMAN in self._counts
        return GamepadState(
            bend_rate=self._rate(Axis.LEFT_X),
            pitch_rate=0.0 - self._rate(Axis.RIGHT_Y),  # the kernel counts downwards; and no -0.0
            advance=0.0 - self._rate(Axis.LEFT_Y),
            delivery=self._rate(Axis.RIGHT_TRIGGER) - self._rate(Axis.LEFT_TRIGGER),
            deadman=held if self._config.deadman else None,
            stop=self._down.get(Button.STOP, False),
            time_s=now_s,
        )


def at_rest(config: GamepadConfig, now_s: float) -> GamepadState:
    """All let go: the state of a gamepad that is not there."""
    return GamepadState(deadman=False if config.deadman else None, time_s=now_s)
