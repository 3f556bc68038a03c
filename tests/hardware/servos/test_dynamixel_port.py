"""The port beneath the vendor's packet handler, on a line whose time the test tells."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import serial
from dynamixel_sdk import COMM_SUCCESS, PortHandler

from core.config.safety import ServosConfig
from hardware.servos.dynamixel_port import LockedPort, PortTaken, ServoLine, StuffingHandler
from hardware.twin.servos.bus import SoftServoBus

_SLICE_S = 0.0005
_ANSWER = bytes.fromhex("fffffd00 01 0800 55 00 a6000000 8cc0".replace(" ", ""))
"""The vendor's manual, status packet of a read: servo 1, position 166."""


class _Line:
    """What pyserial would give: bytes come at the line's speed, and a read waits for them for half a millisecond at most.

    Time is counted in bytes of the line, so that nothing is lost in rounding.
    """

    def __init__(self, baud: int, noise: str) -> None:
        self._noise, self._slice = noise, max(1, round(_SLICE_S * baud / 10))
        self._random = random.Random(1)
        self._per_byte_s = 10.0 / baud
        self._now = self._read = 0

    @property
    def now_s(self) -> float:
        return self._now * self._per_byte_s

    @property
    def in_waiting(self) -> int:
        return min(4095, self._now - self._read)

    def read(self, length: int) -> bytes:
        self._now += min(self._slice, max(0, length - self.in_waiting))
        count = min(length, self.in_waiting)
        self._read += count
        return bytes(count) if self._noise == "zeros" else self._random.randbytes(count)


def _port(line: object, monkeypatch: pytest.MonkeyPatch, baud: int) -> LockedPort:
    port = LockedPort("none")
    port.ser, port.tx_time_per_byte = line, 10_000.0 / baud
    monkeypatch.setattr(port, "clearPort", lambda: None)
    return port


@pytest.mark.parametrize("noise", ["zeros", "random"])
@pytest.mark.parametrize("baud", [57_600, 1_000_000, 3_000_000])
def test_noise_without_end_does_not_keep_the_bus_from_stop(monkeypatch: pytest.MonkeyPatch, baud: int, noise: str) -> None:
    line = _Line(baud, noise)
    port = _port(line, monkeypatch, baud)
    monkeypatch.setattr(port, "getCurrentTime", lambda: line.now_s * 1000.0)
    port.setPacketTimeout(31)
    limit_s = port.packet_timeout / 1000.0
    _, result = StuffingHandler().rxPacket(port, False)
    assert result != COMM_SUCCESS
    assert line.now_s <= limit_s + 4095 * 10.0 / baud + 2 * _SLICE_S, "of line time: the answer's and what the buffer held then"


def test_an_answer_that_came_in_time_is_read_by_a_process_that_was_kept_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    class Buffer:
        waiting = _ANSWER

        @property
        def in_waiting(self) -> int:
            return len(self.waiting)

        def read(self, length: int) -> bytes:
            taken, self.waiting = self.waiting[:length], self.waiting[length:]
            return taken

    port = _port(Buffer(), monkeypatch, 1_000_000)
    now_ms = [0.0]
    monkeypatch.setattr(port, "getCurrentTime", lambda: now_ms[0])
    port.setPacketTimeout(len(_ANSWER))
    now_ms[0] = 5000.0
    packet, result = StuffingHandler().rxPacket(port, False)
    assert result == COMM_SUCCESS
    assert bytes(packet) == _ANSWER


# --- one program only ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def terminal(start_servos: Callable[..., SoftServoBus]) -> str:
    """The software servos' pseudo-terminal itself, which any user may open."""
    terminal = os.path.realpath(start_servos(ServosConfig()).port)
    os.chmod(terminal, 0o666)
    return terminal


_OPENED, _BUSY, _OTHER = 0, 16, 99


def _opened_by_another_user(terminal: str) -> int:
    """What the vendor's own port handler gets in another process, without the rights of root."""
    child = os.fork()
    if child == 0:
        code = _OTHER
        try:
            if os.geteuid() == 0:
                os.setgid(65534)
                os.setuid(65534)
            code = _OPENED if PortHandler(terminal).openPort() else _OTHER
        except serial.SerialException as error:
            code = error.errno or _OTHER
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_no_other_program_can_open_the_port_until_it_is_closed(terminal: str) -> None:
    assert _opened_by_another_user(terminal) == _OPENED
    line = ServoLine(terminal, 1_000_000)
    line.open()
    assert _opened_by_another_user(terminal) == _BUSY
    line.close()
    assert _opened_by_another_user(terminal) == _OPENED


def test_after_a_driver_that_was_killed_the_twins_port_is_free_again(terminal: str) -> None:
    if (driver := os.fork()) == 0:
        ServoLine(terminal, 1_000_000).open()
        os.kill(os.getpid(), 9)
    os.waitpid(driver, 0)
    until_s = time.monotonic() + 5.0
    while (found := _opened_by_another_user(terminal)) == _BUSY and time.monotonic() < until_s:
        time.sleep(0.02)
    assert found == _OPENED


def test_a_program_that_had_the_port_before_is_named(terminal: str, tmp_path: Path) -> None:
    script = tmp_path / "wizard.py"
    script.write_text(f"import os, sys\nos.open({terminal!r}, os.O_RDWR | os.O_NOCTTY)\nprint(flush=True)\nsys.stdin.read()\n")
    with subprocess.Popen([sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        other.stdout.readline()
        line = ServoLine(terminal, 1_000_000)
        with pytest.raises(PortTaken, match=rf"in use by another program, python\S* wizard.py \(process {other.pid}\): close"):
            line.open()
        assert not line.is_open
        other.communicate()
    line.open()
    line.close()
