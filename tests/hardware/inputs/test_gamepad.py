"""The gamepad: what its events mean, and the driver against a pipe in place of the device."""

from __future__ import annotations

import errno
import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.config.models import ConfigError, GamepadConfig, load_config
from hardware.inputs import gamepad as driver
from hardware.inputs.gamepad import (
    AXIS,
    BUTTON,
    EVENT,
    INIT,
    SETTLE_S,
    Gamepad,
    GamepadControls,
    GamepadError,
    GamepadState,
    Layout,
    at_rest,
    find_gamepad,
    shaped,
)
from tests.hardware.inputs.listener import Listener

LINEAR = GamepadConfig(dead_zone=0.2, expo=0.0, deadman=True)
FULL = 32767
LX, LY, LT, RX, RY, RT = range(6)
A, B, SHOULDER = 0, 1, 5


def axis(number: int, share: float, kind: int = AXIS) -> bytes:
    return EVENT.pack(0, round(share * FULL), kind, number)


def button(number: int, down: bool, kind: int = BUTTON) -> bytes:
    return EVENT.pack(0, int(down), kind, number)


def burst(sticks: float = 0.0, triggers: float = -1.0, buttons: bool = False) -> bytes:
    """What the kernel says first: the state of everything."""
    return b"".join(
        [axis(number, triggers if number in {LT, RT} else sticks, AXIS | INIT) for number in range(8)]
        + [button(number, buttons, BUTTON | INIT) for number in range(11)]
    )


class Pad:
    """Controls with a clock that a test turns."""

    def __init__(self, config: GamepadConfig = LINEAR, layout: Layout | None = None, start: bytes | None = None) -> None:
        self.controls = GamepadControls(config, layout)
        self.now_s = 100.0
        self.changes: list[GamepadState] = []
        self.state = self.send(burst() if start is None else start)
        self.after(2 * SETTLE_S)

    def send(self, *events: bytes) -> GamepadState:
        self.changes += self.controls.feed(b"".join(events), self.now_s)
        return self.after(0.0)

    def after(self, seconds: float) -> GamepadState:
        self.now_s += seconds
        self.state = self.controls.tick(self.now_s)
        return self.state


# --- what the events mean --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "dead_zone", "expo", "rate"),
    [
        (0.0, 0.2, 0.0, 0.0),
        (0.2, 0.2, 0.0, 0.0),
        (-0.1, 0.2, 1.0, 0.0),
        (0.6, 0.2, 0.0, 0.5),  # half way between 0.2 and 1
        (-0.6, 0.2, 0.0, -0.5),
        (0.6, 0.2, 1.0, 0.125),  # its cube
        (0.6, 0.2, 0.5, 0.3125),  # their mean
        (1.0, 0.2, 0.7, 1.0),
        (-1.1, 0.2, 0.7, -1.0),
    ],
)
def test_the_curve_by_hand(value: float, dead_zone: float, expo: float, rate: float) -> None:
    assert shaped(value, dead_zone, expo) == pytest.approx(rate)


@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), st.floats(0.02, 0.5), st.floats(0.0, 1.0))
def test_the_curve_grows_without_a_step(first: float, second: float, dead_zone: float, expo: float) -> None:
    low, high = sorted((first, second))
    rise = shaped(high, dead_zone, expo) - shaped(low, dead_zone, expo)
    steepest = (1.0 + 2.0 * expo) / (1.0 - dead_zone)
    assert 0.0 <= rise <= steepest * (high - low) + 1e-12


@pytest.mark.parametrize(
    ("event", "expected"),
    [
        (axis(LX, 0.6), {"bend_rate": 0.5}),
        (axis(LX, -1.0), {"bend_rate": -1.0}),
        (axis(LY, -0.6), {"advance": 0.5}),  # the kernel counts downwards
        (axis(LY, 1.0), {"advance": -1.0}),
        (axis(RY, -1.0), {"pitch_rate": 1.0}),
        (axis(RX, 1.0), {"rotation": -1.0}),  # to the right as seen from behind
        (axis(RT, 0.2), {"delivery": 0.5}),  # 0.6 of its way
        (axis(LT, 1.0), {"delivery": -1.0}),
        (axis(LT, 1.0) + axis(RT, 0.2), {"delivery": -0.5}),
        (axis(LX, 0.19), {}),
        (axis(6, 1.0) + axis(7, -1.0) + axis(99, 1.0), {}),
        (button(A, True), {}),
        (button(B, True), {"stop": True}),
        (button(B, True) + button(B, False), {}),
        (button(SHOULDER, True), {"deadman": True}),
        (EVENT.pack(0, -32768, AXIS, LX), {"bend_rate": -1.0}),
        (EVENT.pack(0, FULL, 0x04, LX) + EVENT.pack(0, 1, 0x03, B), {}),  # unknown kinds
    ],
)
def test_what_each_control_does(event: bytes, expected: dict[str, object]) -> None:
    pad = Pad()
    state = pad.send(event)
    wanted = {"bend_rate": 0.0, "pitch_rate": 0.0, "advance": 0.0, "delivery": 0.0, "rotation": 0.0, "deadman": False}
    wanted |= {"stop": False, **expected}
    found = {name: getattr(state, name) for name in wanted}
    assert found == {name: pytest.approx(value, abs=1e-3) for name, value in wanted.items()}
    assert "-0.0" not in repr(state)


def test_a_tap_within_one_read_is_told() -> None:
    pad = Pad()
    pad.changes.clear()
    assert not pad.send(button(B, True), button(B, False), button(SHOULDER, True), button(SHOULDER, False)).stop
    assert [(state.stop, state.deadman) for state in pad.changes] == [(True, False), (False, False), (False, True), (False, False)]


def test_sticks_and_shoulder_held_at_the_start_do_nothing_until_they_were_let_go() -> None:
    pad = Pad(start=burst(sticks=1.0, triggers=1.0, buttons=True))
    for _ in range(10):
        assert pad.after(0.1) == GamepadState(deadman=False, stop=True, time_s=pad.now_s)
    for number in (LX, LY, RY):
        pad.send(axis(number, 0.9))
    assert pad.state == GamepadState(deadman=False, stop=True, time_s=pad.now_s)
    pad.send(axis(LX, 0.1), button(SHOULDER, False), button(B, False))
    state = pad.send(axis(LX, 1.0), button(SHOULDER, True))
    assert state == GamepadState(bend_rate=1.0, deadman=True, time_s=pad.now_s)


def test_what_the_kernel_had_not_heard_yet_does_nothing_either() -> None:
    """Many gamepads report only once somebody has opened them: the burst says 0, and a moment later comes the truth."""
    pad = Pad(start=b"")
    pad.send(burst())
    pad.after(0.01)
    pad.send(axis(LX, 1.0), axis(LY, -1.0), button(SHOULDER, True))
    for _ in range(10):
        assert pad.after(0.1) == GamepadState(deadman=False, time_s=pad.now_s)


def test_a_truth_that_is_read_late_does_nothing_either() -> None:
    pad = Pad(start=b"")
    pad.send(burst())
    pad.now_s += 5.0  # this program stood still, and the stick has been reported meanwhile
    assert pad.send(button(A, True), axis(LX, 1.0), button(SHOULDER, True)) == GamepadState(deadman=False, time_s=pad.now_s)


def test_triggers_stand_in_the_middle_until_they_are_touched() -> None:
    pad = Pad(start=burst(triggers=0.0))
    assert pad.state.delivery == 0.0
    pad.send(axis(RT, -0.9))
    assert pad.send(axis(RT, 1.0)).delivery == 1.0
    assert pad.send(axis(LX, 1.0)).bend_rate == 1.0


def test_an_axis_of_which_nothing_was_said_does_nothing() -> None:
    pad = Pad(start=axis(LY, 0.0))
    assert pad.send(axis(LX, 1.0)).bend_rate == 0.0


def test_other_gamepads_number_otherwise() -> None:
    """The kernel says which is which: here the right stick is axes 2 and 3, and the lower button is number 1."""
    layout = Layout(axes=(0x00, 0x01, 0x03, 0x04, 0x10, 0x11), buttons=(0x131, 0x130, 0x134, 0x133, 0x135, 0x136, 0x137))
    pad = Pad(layout=layout)
    state = pad.send(axis(3, -1.0), axis(2, 1.0), button(0, True), button(6, True))
    assert state == GamepadState(pitch_rate=1.0, deadman=True, stop=True, time_s=pad.now_s)


def test_it_is_no_deadman_unless_the_configuration_says_so() -> None:
    pad = Pad(GamepadConfig())
    assert pad.send(button(SHOULDER, True)).deadman is None
    assert at_rest(GamepadConfig(), 1.0) == GamepadState(time_s=1.0)
    assert at_rest(LINEAR, 1.0).deadman is False


@given(st.lists(st.binary(max_size=40) | st.sampled_from([burst(), axis(LX, 1.0), axis(RT, 1.0), button(B, True)]), max_size=20))
def test_no_bytes_make_it_fail_or_go_beyond_full_speed(chunks: list[bytes]) -> None:
    controls = GamepadControls(GamepadConfig())
    for turn, chunk in enumerate(chunks):
        for state in [*controls.feed(chunk, 0.1 * turn), controls.tick(0.1 * turn + 0.05)]:
            assert all(-1.0 <= rate <= 1.0 for rate in (state.bend_rate, state.pitch_rate, state.advance, state.delivery))


@given(st.lists(st.integers(1, 12), max_size=30))
def test_events_are_understood_however_they_are_cut(sizes: list[int]) -> None:
    stream = axis(LX, 1.0) + button(SHOULDER, True) + axis(LY, -0.6) + axis(RT, 0.2)
    pad = Pad()
    for size in [*sizes, len(stream)]:
        pad.send(stream[:size])
        stream = stream[size:]
    assert (pad.state.bend_rate, pad.state.deadman) == (1.0, True)
    assert (pad.state.advance, pad.state.delivery) == pytest.approx((0.5, 0.5), abs=1e-3)


# --- the driver ------------------------------------------------------------------------------------------------------------------


class GamepadListener(Listener[GamepadState]):
    """Keeps what the gamepad's thread says."""

    def __init__(self) -> None:
        super().__init__()
        self.devices: list[tuple[str | None, GamepadError | None]] = []

    def device(self, name: str | None, problem: GamepadError | None) -> None:
        self.add(self.devices, (name, problem))

    def until_state(self, what: Callable[[GamepadState], bool]) -> None:
        self.until(lambda: bool(self.states) and what(self.states[-1]))


class FakeDevice:
    """A pipe in the place of the device file, with the kernel's end of it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        os.mkfifo(path)
        self._end = os.open(path, os.O_RDWR | os.O_NONBLOCK)

    def send(self, *events: bytes) -> None:
        os.write(self._end, b"".join(events))

    def settle(self, listener: GamepadListener) -> None:
        """Say the state of everything, and wait until that has been read."""
        listener.until(lambda: bool(listener.states))
        self.send(burst())
        count = len(listener.states)
        listener.until(lambda: len(listener.states) > count + 15)  # the burst alone makes eleven

    def unplug(self) -> None:
        self.path.unlink()
        os.close(self._end)


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(driver, "_FOLDER", tmp_path)


@pytest.fixture
def listener(monkeypatch: pytest.MonkeyPatch) -> GamepadListener:
    monkeypatch.setattr(driver, "RESCAN_S", 0.02)
    monkeypatch.setattr("hardware.inputs.gamepad.SETTLE_S", 0.0)
    return GamepadListener()


@pytest.fixture
def gamepad(listener: GamepadListener) -> Iterator[Gamepad]:
    gamepad = Gamepad(LINEAR, listener.state, listener.device)
    gamepad.start()
    yield gamepad
    gamepad.close()


@pytest.mark.real_time
def test_plugged_in_used_pulled_out_and_plugged_in_again(gamepad: Gamepad, listener: GamepadListener, tmp_path: Path) -> None:
    assert (gamepad.name, gamepad.problem) == (None, None)
    for _ in range(2):
        device = FakeDevice(tmp_path / "js0")
        listener.until(lambda: gamepad.name == "js0")
        device.settle(listener)
        device.send(axis(LX, 1.0), button(SHOULDER, True))
        listener.until_state(lambda state: state.bend_rate == 1.0 and state.deadman is True)
        device.unplug()
        listener.until_state(lambda state: state.bend_rate == 0.0 and state.deadman is False)
        listener.until(lambda: gamepad.name is None)
        assert listener.states[-1] == at_rest(LINEAR, listener.states[-1].time_s)
    assert listener.devices == [("js0", None), (None, None)] * 2


@pytest.mark.real_time
def test_what_is_held_is_repeated_and_a_tap_on_stop_is_told(gamepad: Gamepad, listener: GamepadListener, tmp_path: Path) -> None:
    device = FakeDevice(tmp_path / "js0")
    device.settle(listener)
    device.send(axis(LY, -1.0))
    listener.until_state(lambda state: state.advance == 1.0)
    count = len(listener.states)
    listener.until(lambda: len(listener.states) > count + 10)
    assert all(state.advance == 1.0 for state in listener.states[count:])
    times = [state.time_s for state in listener.states]
    assert times == sorted(times)
    device.send(button(B, True), button(B, False))
    listener.until(lambda: any(state.stop for state in listener.states))
    listener.until_state(lambda state: not state.stop)
    device.unplug()


@pytest.mark.real_time
def test_closed_all_is_at_rest(gamepad: Gamepad, listener: GamepadListener, tmp_path: Path) -> None:
    device = FakeDevice(tmp_path / "js0")
    device.settle(listener)
    device.send(button(SHOULDER, True), axis(LX, 1.0))
    listener.until_state(lambda state: state.bend_rate == 1.0)
    gamepad.close()
    gamepad.close()
    assert listener.states[-1] == at_rest(LINEAR, listener.states[-1].time_s)
    assert gamepad.name is None
    device.unplug()


def test_a_listener_that_fails_is_seen(listener: GamepadListener, tmp_path: Path) -> None:
    def fail(_: GamepadState) -> None:
        raise ZeroDivisionError("not today")

    device = FakeDevice(tmp_path / "js0")
    gamepad = Gamepad(LINEAR, fail, listener.device)
    gamepad.start()
    listener.until(lambda: gamepad.problem is not None)
    gamepad.close()
    assert "no longer read (ZeroDivisionError: not today)" in str(gamepad.problem)
    device.unplug()


# --- which device ----------------------------------------------------------------------------------------------------------------


def test_a_configured_one_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(GamepadError, match=r"js7 is not there: plug it in, or leave gamepad\.device out"):
        find_gamepad(GamepadConfig(device=str(tmp_path / "js7")))


@pytest.mark.real_time
def test_a_configured_one_is_waited_for(listener: GamepadListener, tmp_path: Path) -> None:
    gamepad = Gamepad(GamepadConfig(device=str(tmp_path / "mine")), listener.state, listener.device)
    gamepad.start()
    listener.until(lambda: gamepad.problem is not None)
    device = FakeDevice(tmp_path / "mine")
    listener.until(lambda: gamepad.name == "mine")
    assert gamepad.problem is None
    gamepad.close()
    device.unplug()


def test_no_permission(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied")

    device = FakeDevice(tmp_path / "js0")
    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(GamepadError, match="group input"):
        find_gamepad(GamepadConfig())
    monkeypatch.undo()
    device.unplug()


def test_a_file_is_no_gamepad(tmp_path: Path) -> None:
    (tmp_path / "js0").write_bytes(axis(LX, 1.0))
    with pytest.raises(GamepadError, match="no gamepad with two sticks"):
        find_gamepad(GamepadConfig(device=str(tmp_path / "js0")))
    assert find_gamepad(GamepadConfig()) is None


def _kernel(axes: list[int], buttons: list[int], name: bytes) -> Callable[[int, int, bytearray], int]:
    """The joystick ioctls; their numbers are those of linux/joystick.h."""
    answers = {
        0x80016A11: bytes([len(axes)]),
        0x80016A12: bytes([len(buttons)]),
        0x80406A32: bytes(axes),
        0x84006A34: struct.pack(f"{len(buttons)}H", *buttons),
        0x80806A13: name + b"\0",
    }

    def ioctl(_: int, request: int, buffer: bytearray) -> int:
        answer = answers[request]
        buffer[: len(answer)] = answer
        return len(answer)

    return ioctl


def test_the_kernel_is_asked_for_name_and_layout(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    device = FakeDevice(tmp_path / "js0")
    monkeypatch.setattr(driver.fcntl, "ioctl", _kernel([0, 1, 3, 4], [0x131, 0x130], b"Pro\tController \xff"))
    found = find_gamepad(GamepadConfig())
    assert found[1:] == ("Pro Controller \ufffd", Layout((0, 1, 3, 4), (0x131, 0x130)))
    os.close(found[0])
    device.unplug()


@pytest.mark.parametrize("axes", [[0, 1, 2, 5, 0x0A, 0x09, 0x10, 0x11], [0, 1, 2, 5, 0x10, 0x11], [0, 1, 3, 5]])
def test_one_with_its_right_stick_elsewhere_is_refused_by_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, axes: list[int]
) -> None:
    """Where the triggers are here: the sheath would run on by itself, and STOP would be another button."""
    device = FakeDevice(tmp_path / "js0")
    monkeypatch.setattr(driver.fcntl, "ioctl", _kernel(axes, [*range(0x130, 0x13D)], b"EX10"))
    for config in (GamepadConfig(), GamepadConfig(device=str(tmp_path / "js0"))):
        with pytest.raises(GamepadError, match=r"gamepad EX10 has its right stick and buttons elsewhere: switch it to XInput"):
            find_gamepad(config)
    device.unplug()


@pytest.mark.real_time
def test_a_second_window_says_that_the_gamepad_is_not_its_own_and_gets_it_when_the_first_closes(
    gamepad: Gamepad, listener: GamepadListener, tmp_path: Path
) -> None:
    device, second = FakeDevice(tmp_path / "js0"), GamepadListener()
    listener.until(lambda: gamepad.name == "js0")
    other = Gamepad(LINEAR, second.state, second.device)
    other.start()
    second.until(lambda: other.problem is not None)
    assert str(other.problem).startswith(
        "gamepad js0 is in use by another window, so its STOP does nothing here: close that window"
    )
    assert (other.name, second.states) == (None, [])
    found = find_gamepad(GamepadConfig())  # who only looks, as a check does, is not refused
    os.close(found[0])
    gamepad.close()
    second.until(lambda: other.name == "js0")
    assert other.problem is None
    other.close()
    device.unplug()


def test_a_gamepad_that_cannot_be_locked_is_not_said_to_be_another_windows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device = FakeDevice(tmp_path / "js0")

    def no_locks(_: int, __: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(driver.fcntl, "flock", no_locks)
    with pytest.raises(GamepadError, match=r"js0 cannot be locked \(No locks available\), so its STOP does nothing here"):
        find_gamepad(GamepadConfig(device=str(tmp_path / "js0")), drives=True)
    device.unplug()


@pytest.mark.parametrize("text", ["dead_zone = 0", "dead_zone = nan", "expo = 1.5", "device = ''", "invert = true"])
def test_bad_settings_are_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f"[gamepad]\n{text}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"gamepad\.{text.partition(' ')[0]}"):
        load_config(path)
