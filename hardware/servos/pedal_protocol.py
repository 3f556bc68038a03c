"""What a foot pedal says, and what that means. Pure: bytes and times in, reports out.

A report is seven bytes of ASCII, sent every 20 ms without being asked:

======  ==============================================================================================================
byte    meaning
======  ==============================================================================================================
0       ``P``
1       number of the report, 0 to 31 and then 0 again, as ``0x40 + number`` (``@ A B ... _``)
2       ``D``: the deadman switch (normally open) is closed, the foot is on it; ``-``: it is open, or its wire is broken
3       ``S``: the STOP switch (normally closed) is open, it is pressed, or its wire is broken; ``-``: it is closed
4, 5    CRC-8 (polynomial 0x07, start 0) of bytes 0 to 3, its upper and lower half as ``0x40 + half`` (``@ A B ... O``)
6       line feed
======  ==============================================================================================================

As every varying bit stands for itself, the CRC finds any one, two or three wrong bits. ``D`` and ``-``, and ``S`` and ``-``, differ
in four and six bits anyway.
"""

from __future__ import annotations

from dataclasses import dataclass

from core.pedal_config import PedalConfig

PERIOD_S = 0.02
NUMBERS = 32
_LENGTH = 6
"""Of a line, without its end."""


@dataclass(frozen=True, slots=True)
class PedalLine:
    """One whole report. ``down``: foot on the deadman; ``stop``: STOP pressed, or its wire broken."""

    number: int
    down: bool
    stop: bool


@dataclass(frozen=True, slots=True)
class PedalReport:
    """What the pedal means now, at ``time_s`` on the monotonic clock.

    ``deadman`` is True only while unbroken reports say so, False only when a whole one in its turn says that the foot is up, and
    None otherwise: the foot may be up or down. ``stop`` is what a whole report said; it is never guessed.
    """

    deadman: bool | None
    stop: bool
    time_s: float


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
    body = bytes([ord("P"), 0x40 | line.number % NUMBERS, ord("D" if line.down else "-"), ord("S" if line.stop else "-")])
    crc = crc8(body)
    return body + bytes([0x40 | crc >> 4, 0x40 | crc & 0x0F, ord("\n")])


_LINES = {
    line_bytes(line)[:-1]: line
    for line in (PedalLine(n, d, s) for n in range(NUMBERS) for d in (False, True) for s in (False, True))
}
"""All 128 lines that there are: what is not among them, letter for letter, is damaged."""


class PedalParser:
    """Finds lines in whatever comes, in any pieces."""

    def __init__(self) -> None:
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[PedalLine | None]:
        """The lines that end in `data`, in order; None for a damaged one. What cannot become a line is told at once, and once."""
        *whole, rest = (self._rest + data).split(b"\n")
        found: list[PedalLine | None] = []
        for line in whole:
            if self._skipping:  # the end of what has been told already
                self._skipping = False
            else:
                found.append(_LINES.get(line))
        if self._skipping:
            rest = b""
        elif len(rest) > _LENGTH:
            found.append(None)
            self._skipping, rest = True, b""
        self._rest = rest
        return found


class PedalWatch:
    """From lines and silences to reports.

    A press counts from the second whole report in a row on (``press_reports``), so that one line that is wrong in spite of its CRC,
    or a touch shorter than a report, moves nothing. It ends with the first report that says so, and with anything else than the
    next number in time: damage, silence, a number again or left out. After that it takes two reports in a row again, and after an
    interruption longer than ``resume_s``, or a new connection, a lifted foot first: who has looked away may have stepped down.

    What ends a press without a lifted foot is no release: nobody knows, and that holds the robot as well. Told as a release, it
    would make a new press of a pedal that has been down all the time, since before arming for instance.

    A STOP counts at once, from any whole line, even one that comes late or with a wrong number: a false STOP costs a restart, a
    missed one more. But damage and silence are none. They say that nobody knows, and a deadman that nobody holds is the answer to
    that: it holds the robot. A STOP is latched and may switch the torque off, so an unplugged cable must not cause it.
    """

    def __init__(self, config: PedalConfig) -> None:
        self._config = config
        self._number: int | None = None
        self._heard_s = 0.0
        self._sound_s = 0.0
        self._lifted = False
        self._run = 0

    def hear(self, line: PedalLine | None, now_s: float, *, late: bool = False) -> PedalReport:
        """A line, or a damaged one (None), has come; `late`: it has waited somewhere, so nobody knows when it was true."""
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
            return PedalReport(None, line.stop, now_s)
        if now_s - self._sound_s > self._config.resume_s:
            self._lifted = False
        self._sound_s = now_s
        self._lifted = self._lifted or not line.down
        self._run = self._run + 1 if line.down and self._lifted else 0
        is_press = self._run >= self._config.press_reports
        return PedalReport((is_press or None) if line.down else False, line.stop, now_s)

    def silence(self, now_s: float) -> PedalReport:
        """Nothing whole has come for too long."""
        self._run = 0
        return PedalReport(None, False, now_s)
