"""Foot pedal: deadman and STOP over a serial line. It finds its port again by itself after the plug was pulled.

A report is seven bytes of ASCII, sent every 20 ms without being asked:

======  ==============================================================================================================
byte    meaning
======  ==============================================================================================================
0       ``P``
1       number of the report, 0 to 31 and then 0 again, as ``0x40 + number`` (``@ A B ... _``)
2       ``D``: the deadman switch (normally open) is closed, the foot is on it; ``-``: it is open, or its wire is broken
3       ``S``: the STOP switch (normally closed) is open, it is pressed, or its wire is broken; ``-``: it is closed; ``E``: the
        second contact (normally closed) of the E-stop button is open, whatever STOP is. Boards without that pin never say so
4, 5    CRC-8 (polynomial 0x07, start 0) of bytes 0 to 3, its upper and lower half as ``0x40 + half`` (``@ A B ... O``)
6       line feed
======  ==============================================================================================================

As every varying bit stands for itself, the CRC finds any one, two or three wrong bits. ``D`` and ``-``, and ``S`` and ``-``, differ
in four and six bits anyway, ``E`` in three from either.
"""

from __future__ import annotations

import contextlib
import errno
import os
import termios
import time
from collections.abc import Callable
from dataclasses import dataclass

import serial

from core.config.models import PedalConfig
from core.devices import DeviceError
from hardware.processes import DeviceThread

_CHUNK = 4096
PERIOD_S = 0.02
NUMBERS = 32
_LENGTH = 6
"""Of a line, without its end."""
_START_UP_S = 3.0
"""Opening the port resets many boards; they talk again when their boot loader has waited in vain."""
_PATIENCE_S = 0.5
"""Silence of a pedal that has talked before, until the operator is told. It releases the deadman long before that."""
_PAUSE_S = PERIOD_S / 10
"""A reader that had to wait so long for bytes has read all that waited."""


class PedalError(DeviceError):
    """Root of the foot pedal's errors."""


class PedalPortError(PedalError):
    """The port cannot be opened."""


class PedalPortTaken(PedalPortError):
    """Another program holds the port."""


class PedalLost(PedalError):
    """The port vanished while it was open."""


class PedalUnheard(PedalError):
    """The port is open, and no report comes."""


class PedalPort:
    """An open serial port that only this program holds. Made by ``open_pedal_port``."""

    def __init__(self, name: str, port: serial.Serial) -> None:
        self.name = name
        self._port = port
        self.fd: int = port.fileno()

    def read(self) -> bytes:
        """What has come; PedalLost: an adapter that was pulled out reads as an error, or as readable without a byte."""
        try:
            if data := os.read(self.fd, _CHUNK):
                return data
        except BlockingIOError:
            return b""
        except OSError as error:
            raise PedalLost(
                "the pedal at {port} is gone ({why}): plug its USB cable in", port=self.name, why=error.strerror
            ) from None
        raise PedalLost("the pedal at {port} is gone: plug its USB cable in", port=self.name)

    def close(self) -> None:
        """Give the port back at once: a plug that comes back meanwhile gets another name. Never fails."""
        with contextlib.suppress(OSError, termios.error):  # a vanished port raises termios.error, which is no OSError
            self._port.close()


def open_pedal_port(config: PedalConfig) -> PedalPort:
    """Open and lock the pedal's port; what has come before is dropped.

    Raises PedalPortError: none set, missing, not permitted, not a serial port, not this speed; ``PedalPortTaken`` when another
    program holds it.
    """
    if config.port is None:
        raise PedalPortError("no pedal is configured: set pedal.port to its path in /dev/serial/by-id")
    try:
        port = serial.Serial(config.port, config.baud, timeout=0, exclusive=True)
    except (OSError, ValueError, termios.error) as error:  # SerialException is an OSError
        raise _port_error(config, error) from None
    # An FTDI chip keeps bytes back for 16 ms otherwise. Not every port is one: a pseudo-terminal has no such mode.
    with contextlib.suppress(ValueError, NotImplementedError, OSError):
        port.set_low_latency_mode(True)
    return PedalPort(config.port, port)


def _port_error(config: PedalConfig, error: Exception) -> PedalPortError:
    port, code = config.port, getattr(error, "errno", None)
    if code == errno.ENOENT:
        return PedalPortError("pedal port {port} does not exist: plug the pedal in, or set pedal.port", port=port)
    if code in {errno.EACCES, errno.EPERM}:
        return PedalPortError(
            "no permission for pedal port {port}: add your user to the group dialout, then log in again", port=port
        )
    if code in {errno.EAGAIN, errno.EBUSY}:
        return PedalPortTaken(
            "pedal port {port} is in use by another program, or by the servos: close it there, or set pedal.port", port=port
        )
    if code in {errno.ENODEV, errno.ENXIO, errno.EIO}:
        return PedalPortError("pedal port {port} has no device behind it: unplug the pedal and plug it in again", port=port)
    reason = " ".join(str(error).split())[:120]
    return PedalPortError(
        "{port} cannot be used as pedal port at {a} baud ({why}): set pedal.port and pedal.baud",
        port=port,
        a=config.baud,
        why=reason,
    )


@dataclass(frozen=True, slots=True)
class PedalLine:
    """One whole report. ``down``: foot on the deadman; ``stop``: STOP pressed, or its wire broken; ``estop``: the E-stop is."""

    number: int
    down: bool
    stop: bool
    estop: bool = False


@dataclass(frozen=True, slots=True)
class PedalReport:
    """What the pedal means now, at ``time_s`` on the monotonic clock.

    ``deadman`` is True only while unbroken reports say so, False only when a whole one in its turn says that the foot is up, and
    None otherwise: the foot may be up or down. ``stop`` is what a whole report said; it is never guessed. ``estop`` is what a whole
    report said of the E-stop button, and None without one: what it was before, it still is.
    """

    deadman: bool | None
    stop: bool
    time_s: float
    estop: bool | None = None


def crc8(data: bytes) -> int:
    """CRC-8/SMBUS: polynomial 0x07, start 0, not reflected."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07) & 0xFF if crc & 0x80 else crc << 1
    return crc


def line_bytes(line: PedalLine) -> bytes:
    """The seven bytes of a report."""
    switch = "E" if line.estop else "S" if line.stop else "-"
    body = bytes([ord("P"), 0x40 | line.number % NUMBERS, ord("D" if line.down else "-"), ord(switch)])
    crc = crc8(body)
    return body + bytes([0x40 | crc >> 4, 0x40 | crc & 0x0F, ord("\n")])


_SWITCHES = ((False, False), (True, False), (False, True))
"""STOP and E-stop of a line."""
_LINES = {
    line_bytes(line)[:-1]: line
    for line in (PedalLine(n, d, s, e) for n in range(NUMBERS) for d in (False, True) for s, e in _SWITCHES)
}
"""All 192 lines that there are: what is not among them, letter for letter, is damaged."""


class PedalParser:
    """Finds lines in bytes, however they are cut."""

    def __init__(self) -> None:
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[PedalLine | None]:
        """The lines that end in `data`, in order; None for a damaged one. What cannot become a line is told at once, and once."""
        *whole, self._rest = (self._rest + data).split(b"\n")
        found: list[PedalLine | None] = []
        for line in whole:
            if self._skipping:  # the end of what has been told already
                self._skipping = False
            else:
                found.append(_LINES.get(line))
        if not self._skipping and len(self._rest) > _LENGTH:
            found.append(None)
            self._skipping = True
        if self._skipping:
            self._rest = b""
        return found


class PedalFilter:
    """Makes reports of lines and silences.

    A press counts from the second whole report in a row on (``press_reports``), so that one line that is wrong in spite of its CRC,
    or a touch shorter than a report, moves nothing. It ends with the first report that says so, and with anything else than the
    next number in time: damage, silence, a number again or left out. After that it takes two reports in a row again, and after an
    interruption longer than ``resume_s``, or a new connection, a lifted foot first: the foot may have come down meanwhile.

    What ends a press without a lifted foot makes the deadman unknown, which holds the robot as well. Reported as a release, it
    would make a new press of a pedal that has been down all the time, since before arming for instance.

    A STOP counts at once, from any whole line, even one that comes late or with a wrong number: a false STOP costs a restart, a
    missed one more. Damage and silence are no STOP: it is latched and may switch the torque off, so an unplugged cable must not
    cause it. They make the deadman unknown, which holds. An E-stop counts in the same way, and is over when a whole line says so.
    """

    def __init__(self, config: PedalConfig) -> None:
        self._config = config
        self._number: int | None = None
        self._heard_s = 0.0
        self._sound_s = 0.0
        self._lifted = False
        self._run = 0

    def update(self, line: PedalLine | None, now_s: float, *, late: bool = False) -> PedalReport:
        """A line, or a damaged one (None), has come; `late`: it has waited, so when it was true is unknown."""
        if line is None:
            return self.silence(now_s)
        in_order = (
            self._number is not None
            and line.number == (self._number + 1) % NUMBERS
            and now_s - self._heard_s <= self._config.silence_s
            and not late
        )
        self._number, self._heard_s = line.number, now_s
        if not in_order:
            self._run = 0
            return PedalReport(None, line.stop, now_s, line.estop)
        if now_s - self._sound_s > self._config.resume_s:
            self._lifted = False
        self._sound_s = now_s
        self._lifted = self._lifted or not line.down
        self._run = self._run + 1 if line.down and self._lifted else 0
        is_press = self._run >= self._config.press_reports
        return PedalReport((is_press or None) if line.down else False, line.stop, now_s, line.estop)

    def silence(self, now_s: float) -> PedalReport:
        """Nothing whole has come for too long."""
        self._run = 0
        return PedalReport(None, False, now_s)


class Pedal:
    """Reads the pedal in a thread of its own, from ``start`` to ``close``.

    Parameters
    ----------
    config : section `pedal`; its port must be set.
    on_report : gets every report, in order, from the pedal's thread, some 50 a second while the pedal talks and one every
        ``silence_s`` while it is silent; one with an unknown deadman comes first after every opening, and last before the port is
        given up. It should return within some milliseconds, and must not call ``close``. Without a pedal nothing is reported.
    on_problem : gets the newest ``problem`` when it changes, from the same thread.

    Notes
    -----
    A report with ``stop`` is repeated while STOP is pressed, so that a latched stop cannot be acknowledged before it is let go.

    Of reports that have waited in the port while this program stood still only STOP counts, until the port is read empty.
    """

    def __init__(
        self,
        config: PedalConfig,
        on_report: Callable[[PedalReport], None],
        on_problem: Callable[[PedalError | None], None] | None = None,
    ) -> None:
        if config.port is None:
            raise PedalPortError("no pedal is configured: set pedal.port to its path in /dev/serial/by-id")
        self._config = config
        self._on_report = on_report
        self._on_problem = on_problem
        self._thread = DeviceThread("pedal", self._serve, self._fail)
        self._problem: PedalError | None = PedalUnheard("the pedal at {port} has not reported yet", port=config.port)

    @property
    def problem(self) -> PedalError | None:
        """Why the pedal is not heard, in one line that says what to do; None while it is."""
        return self._problem

    def start(self) -> None:
        """Start reading. It never raises: what hinders it is the ``problem``, and it is tried again and again."""
        self._thread.start()

    def close(self) -> None:
        """Report an unknown deadman, give the port back; may be called twice."""
        self._thread.close()

    def _serve(self) -> None:
        while not self._thread.stopping:
            try:
                with contextlib.closing(open_pedal_port(self._config)) as port:
                    try:
                        self._listen(port)
                    finally:
                        self._on_report(PedalReport(None, False, time.monotonic()))
            except PedalError as error:
                self._set_problem(error)
                self._thread.wait(None, self._config.reconnect_s)

    def _listen(self, port: PedalPort) -> None:
        """From opening to the loss of the port, or to ``close``."""
        silence_s = self._config.silence_s
        parser, filter_ = PedalParser(), PedalFilter(self._config)
        opened_s = read_s = time.monotonic()
        self._on_report(filter_.silence(opened_s))
        due_s, complain_s = opened_s + silence_s, opened_s + _START_UP_S
        behind = True
        damaged = 0
        while True:
            asked_s = time.monotonic()
            ready = self._thread.wait(port.fd, due_s - asked_s)
            if self._thread.stopping:
                return
            now_s = time.monotonic()
            if ready:
                if now_s - read_s > silence_s:
                    behind = True  # even when that was the pedal's silence: it costs one report
                elif now_s - asked_s >= _PAUSE_S:
                    behind = False
                read_s = now_s
                for line in parser.feed(port.read()):
                    self._on_report(filter_.update(line, now_s, late=behind))
                    if line is None:
                        damaged += 1
                    else:
                        damaged = 0
                        due_s, complain_s = now_s + silence_s, now_s + _PATIENCE_S
                        self._set_problem(None)
            if now_s >= due_s:
                self._on_report(filter_.silence(now_s))
                due_s = now_s + silence_s
            if now_s >= complain_s and damaged:
                hint = "is no pedal's report: check pedal.baud, the cable, and that it is the pedal"
                self._set_problem(PedalUnheard(f"what comes from {port.name} {hint}"))
            elif now_s >= complain_s:
                hint = "is silent: check its power and firmware, then plug it in again"
                self._set_problem(PedalUnheard(f"the pedal at {port.name} {hint}"))

    def _set_problem(self, problem: PedalError | None) -> None:
        if str(problem) != str(self._problem):
            self._problem = problem
            if self._on_problem is not None:
                self._on_problem(problem)

    def _fail(self, error: Exception) -> None:
        self._set_problem(
            PedalError("the pedal is no longer read ({kind}: {why}): start the program again", kind=type(error).__name__, why=error)
        )
