"""Gamepad: drives by hand. Found by itself, also when it is plugged in later, through the joystick interface of Linux."""

from __future__ import annotations

import errno
import fcntl
import math
import os
import re
import stat
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from core.config.models import GamepadConfig
from core.devices import DeviceError
from hardware.processes import DeviceThread

EVENT = struct.Struct("IhBB")
"""``js_event`` of linux/joystick.h: time in ms, value, type, number."""
BUTTON, AXIS, INIT = 0x01, 0x02, 0x80
_FULL = 32767
SETTLE_S = 0.3
"""What was held when the gamepad was found has been reported by then."""
PERIOD_S = 0.02
RESCAN_S = 1.0
_CHUNK = 512 * EVENT.size
"""More than the kernel keeps for a reader: one read takes all."""
_FOLDER = Path("/dev/input")


class Axis(Enum):
    """Axes that drive, by their codes in linux/input-event-codes.h. Triggers rest at the negative end."""

    LEFT_X = 0x00
    LEFT_Y = 0x01
    LEFT_TRIGGER = 0x02
    RIGHT_X = 0x03
    RIGHT_Y = 0x04
    RIGHT_TRIGGER = 0x05


class Button(Enum):
    """Buttons that mean something, by their codes: the right one of the four (B, circle), and the right shoulder."""

    STOP = 0x131
    DEADMAN = 0x137


GAMEPAD_BUTTON = 0x130
"""BTN_GAMEPAD, the lower one of the four (A, cross): a wheel or a motion sensor does not have it."""
RIGHT_STICK = frozenset({0x03, 0x04})
"""ABS_RX and ABS_RY. A gamepad with its right stick elsewhere has it where the triggers are here, and other buttons."""
_TRIGGERS = (Axis.LEFT_TRIGGER, Axis.RIGHT_TRIGGER)


@dataclass(frozen=True, slots=True)
class Layout:
    """Code of each axis and button, by its number. The default is that of Xbox and PlayStation gamepads."""

    axes: Sequence[int] = tuple(range(6))
    buttons: Sequence[int] = (0x130, 0x131, 0x133, 0x134, 0x136, 0x137)


@dataclass(frozen=True, slots=True)
class GamepadState:
    """How the controls are held, at ``time_s`` on the monotonic clock; each rate -1..1 of full speed.

    Positive: bend to the robot's right as seen on screen, pitch up, advance and sheath forward, shaft to the left. ``deadman``:
    None when the configuration does not make the gamepad a deadman. ``stop``: the STOP button is down.
    """

    bend_rate: float = 0.0
    pitch_rate: float = 0.0
    advance: float = 0.0
    delivery: float = 0.0
    deadman: bool | None = None
    stop: bool = False
    time_s: float = 0.0
    rotation: float = 0.0


def shaped(value: float, dead_zone: float, expo: float) -> float:
    """A deflection of -1..1 without its dead zone: 0 inside, 1 at the end, without a step between; `expo` mixes in the cube.

    Each axis by itself, not the stick as a whole: pushing forward must not bend.
    """
    way = (min(abs(value), 1.0) - dead_zone) / (1.0 - dead_zone)
    return math.copysign((1.0 - expo) * way + expo * way**3, value) if way > 0.0 else 0.0


class GamepadControls:
    """Makes states of events.

    A control counts once it has been at rest, ``SETTLE_S`` after the first event or later. Earlier, the kernel may report a held
    stick or button as "at rest", as many gamepads report only after they were opened. Untouched triggers may stand in the middle of
    their way. Only STOP counts at once.
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
            rotation=0.0 - self._rate(Axis.RIGHT_X),
        )


def at_rest(config: GamepadConfig, now_s: float) -> GamepadState:
    """Nothing is held: the state of a gamepad that is not there."""
    return GamepadState(deadman=False if config.deadman else None, time_s=now_s)


class GamepadError(DeviceError):
    """A gamepad cannot be used."""


class GamepadRefused(GamepadError):
    """A gamepad is there that cannot be used; the operator must know why, since its STOP does nothing either."""


class Gamepad:
    """Reads the first gamepad, or the configured one, in a thread of its own, from ``start`` to ``close``.

    Parameters
    ----------
    config : section `gamepad`.
    on_state : gets the state 50 times a second while there is a gamepad, and besides whenever STOP or the deadman changes; all at
        rest when one was found, when it is lost, and at the end. Called from the gamepad's thread; it should return within some
        milliseconds, and must not call ``close``. Without a gamepad nothing comes, and silence is rest.
    on_device : gets ``name`` when a gamepad was found, None when it is lost; and whenever ``problem`` changes. Same thread.
    """

    def __init__(
        self,
        config: GamepadConfig,
        on_state: Callable[[GamepadState], None],
        on_device: Callable[[str | None, GamepadError | None], None] | None = None,
    ) -> None:
        self._config = config
        self._on_state = on_state
        self._on_device = on_device
        self._thread = DeviceThread("gamepad", self._serve, self._fail)
        self._name: str | None = None
        self._problem: GamepadError | None = None

    @property
    def name(self) -> str | None:
        """What the gamepad calls itself; None without one."""
        return self._name

    @property
    def problem(self) -> GamepadError | None:
        """Why a gamepad that is there, or that the configuration names, cannot be used."""
        return self._problem

    def start(self) -> None:
        """Start looking for gamepads; does nothing when the configuration does not want any. It never raises."""
        if self._config.enabled:
            self._thread.start()

    def close(self) -> None:
        """Report all at rest and end; may be called twice."""
        self._thread.close()

    def _serve(self) -> None:
        while not self._thread.stopping:
            try:
                found = find_gamepad(self._config, drives=True)
            except GamepadError as error:
                self._report_device(None, error)
            else:
                self._report_device(found[1] if found else None, None)
                if found is not None:
                    self._listen(*found)
            self._thread.wait(None, RESCAN_S)

    def _listen(self, device: int, _: str, layout: Layout) -> None:
        """Until the gamepad is lost, or ``close``."""
        controls = GamepadControls(self._config, layout)
        try:
            self._on_state(at_rest(self._config, time.monotonic()))
            due_s = time.monotonic()
            while not self._thread.stopping:
                if self._thread.wait(device, due_s - time.monotonic()):
                    data = _read(device)
                    if data is None:
                        break
                    for state in controls.feed(data, time.monotonic()):
                        self._on_state(state)
                now_s = time.monotonic()
                if now_s >= due_s:
                    self._on_state(controls.tick(now_s))
                    due_s = now_s + PERIOD_S
        finally:
            os.close(device)
            self._on_state(at_rest(self._config, time.monotonic()))
            self._report_device(None, None)

    def _report_device(self, name: str | None, problem: GamepadError | None) -> None:
        if (name, str(problem)) != (self._name, str(self._problem)):
            self._name, self._problem = name, problem
            if self._on_device is not None:
                self._on_device(name, problem)

    def _fail(self, error: Exception) -> None:
        self._report_device(
            None,
            GamepadError(
                "the gamepad is no longer read ({kind}: {why}): start the program again", kind=type(error).__name__, why=error
            ),
        )


def find_gamepad(config: GamepadConfig, *, drives: bool = False) -> tuple[int, str, Layout] | None:
    """Open the configured gamepad, or the first that there is: file descriptor, name, layout. None when none is plugged in.

    With `drives` it is locked: one gamepad must not drive the robots of two windows.

    Raises GamepadError: the configured one is missing or no gamepad; ``GamepadRefused`` when it, or all that there are, is not
    permitted, in use or has its controls elsewhere.
    """
    if config.device is not None:
        return _open(config.device, drives=drives)
    refused: GamepadRefused | None = None
    for path in sorted(_FOLDER.glob("js*"), key=lambda path: (len(path.name), path.name)):  # js2 before js10
        try:
            return _open(str(path), drives=drives)
        except GamepadError as error:
            # wheels and motion sensors are joysticks, too: nothing to complain about
            refused = refused or (error if isinstance(error, GamepadRefused) else None)
    if refused is not None:
        raise refused
    return None


def _open(path: str, *, drives: bool) -> tuple[int, str, Layout]:
    try:
        device = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except PermissionError as error:
        raise GamepadRefused(
            "no permission for gamepad {path}: add your user to the group input, then log in again", path=path
        ) from error
    except (OSError, ValueError) as error:
        missing = isinstance(error, OSError) and error.errno in {errno.ENOENT, errno.ENODEV, errno.ENXIO}
        reason = "is not there" if missing else "cannot be opened"
        raise GamepadError(f"gamepad {path} {reason}: plug it in, or leave gamepad.device out to take the first") from error
    layout = read_layout(device)
    # A pipe may stand in for a gamepad. Other devices in the same folder talk otherwise, and would be misunderstood as motion.
    if layout is None and stat.S_ISFIFO(os.fstat(device).st_mode):
        layout = Layout()
    if layout is None or GAMEPAD_BUTTON not in layout.buttons:
        os.close(device)
        raise GamepadError(
            "{path} is no gamepad with two sticks: leave gamepad.device out to take the first that there is", path=path
        )
    raw = (_ask(device, 0x13, 128) or b"").split(b"\0")[0].decode("utf-8", "replace")
    name = " ".join(re.sub(r"[^\x20-\uffff]", " ", raw).split()) or Path(path).name
    if not RIGHT_STICK.issubset(layout.axes):
        os.close(device)
        raise GamepadRefused(
            "gamepad {name} has its right stick and buttons elsewhere: switch it to XInput, or take another one", name=name
        )
    try:
        if drives:
            fcntl.flock(device, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(device)
        if isinstance(error, BlockingIOError):
            text = "is in use by another window, so its STOP does nothing here: close that window, or set gamepad.device"
        else:
            text = f"cannot be locked ({error.strerror}), so its STOP does nothing here: unplug it and plug it in again"
        raise GamepadRefused(f"gamepad {name} {text}") from error
    return device, name, layout


def _ask(device: int, number: int, size: int) -> bytes | None:
    """What a joystick ioctl reads (_IOR in linux/ioctl.h)."""
    buffer = bytearray(size)
    try:
        fcntl.ioctl(device, 2 << 30 | size << 16 | ord("j") << 8 | number, buffer)
    except OSError:  # a pipe or a file in its place
        return None
    return bytes(buffer)


def read_layout(device: int) -> Layout | None:
    """Which axis and button is which, from the kernel (linux/joystick.h); None when it is no joystick."""
    axes, buttons = _ask(device, 0x11, 1), _ask(device, 0x12, 1)
    axis_map, button_map = _ask(device, 0x32, 64), _ask(device, 0x34, 1024)
    if axes is None or buttons is None or axis_map is None or button_map is None:
        return None
    codes = struct.unpack("512H", button_map)
    return Layout(tuple(axis_map[: axes[0]]), tuple(codes[: buttons[0]]))


def _read(device: int) -> bytes | None:
    """What has come; None when the gamepad was unplugged."""
    try:
        return os.read(device, _CHUNK) or None
    except BlockingIOError:
        return b""
    except OSError:
        return None
