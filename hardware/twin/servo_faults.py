"""Switches for what goes wrong on a servo line: between a servo's answer and the computer."""

from __future__ import annotations

import random
from dataclasses import dataclass

from hardware.twin.servo_packets import status_packet


@dataclass(frozen=True, slots=True)
class Sent:
    """What really goes onto the line, and how much later than it should."""

    data: bytes
    delay_s: float = 0.0


class LineFaults:
    """Which answers are lost, late or damaged. Switches may be thrown from any thread while the bus runs."""

    def __init__(self, seed: int = 0) -> None:
        self._random = random.Random(seed)
        self.clear()

    def clear(self) -> None:
        """All faults off."""
        self._muted: set[int] = set()
        self._delay_s: dict[int, float] = {}
        self._truncate: dict[int, int] = {}
        self._short: dict[int, int] = {}
        self._crc = 0
        self._garbage = 0

    def mute(self, servo_id: int, on: bool = True) -> None:
        """The servo hears and obeys, but does not answer."""
        (self._muted.add if on else self._muted.discard)(servo_id)

    def delay(self, servo_id: int, seconds: float) -> None:
        """All answers of the servo come later by so much; 0 ends it."""
        self._delay_s[servo_id] = seconds

    def crc(self, count: int) -> None:
        """The next `count` answers have a wrong CRC."""
        self._crc = count

    def garbage(self, count: int) -> None:
        """The next answer comes behind `count` random bytes."""
        self._garbage = count

    def truncate(self, servo_id: int, count: int = 1) -> None:
        """The next `count` answers of the servo break off in the middle."""
        self._truncate[servo_id] = count

    def short(self, servo_id: int, count: int = 1) -> None:
        """The next `count` answers of the servo are whole packets without data."""
        self._short[servo_id] = count

    def silences(self, servo_id: int) -> bool:
        return servo_id in self._muted

    def shape(self, servo_id: int, answer: bytes) -> Sent:
        """What becomes of an answer."""
        if self._short.get(servo_id, 0) > 0:
            self._short[servo_id] -= 1
            answer = status_packet(servo_id, 0)
        if self._truncate.get(servo_id, 0) > 0:
            self._truncate[servo_id] -= 1
            answer = answer[: len(answer) // 2 + 1]
        if self._crc > 0:
            self._crc -= 1
            answer = answer[:-1] + bytes([answer[-1] ^ 0x55])
        if self._garbage > 0:
            answer = self._random.randbytes(self._garbage) + answer
            self._garbage = 0
        return Sent(answer, self._delay_s.get(servo_id, 0.0))
