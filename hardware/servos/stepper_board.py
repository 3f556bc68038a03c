"""A board with stepper motors on a serial line, as an example of a drive; its protocol is in docs/development.md."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from functools import reduce
from operator import xor

from hardware.servos.drive import AxisState
from hardware.servos.dynamixel_port import LineCounts, ServoLine
from hardware.servos.registers import HardwareError

_ANSWER_S = 0.03
"""Longest wait for a line of the board, which answers within 5 ms."""
_TRIES = 2


def line_of(text: str) -> bytes:
    """A line as it is sent: the text, ``*``, the exclusive or of its bytes as two hexadecimal digits, a line feed."""
    return f"{text}*{reduce(xor, text.encode(), 0):02X}\n".encode()


def text_of(line: bytes) -> str:
    """The text of a line. Raises ValueError for a damaged one."""
    body, star, check = line.strip().rpartition(b"*")
    if not star or len(check) != 2 or int(check, 16) != reduce(xor, body, 0):
        raise ValueError("checksum")
    return body.decode("ascii")


def states_of(text: str) -> dict[int, AxisState]:
    """The axes by id, of the answer ``A boot volts celsius;id position goal on errors;...``. Raises ValueError."""
    head, *axes = text.split(";")
    letter, boot, volts, celsius = head.split()
    if letter != "A":
        raise ValueError("no state")
    found = {}
    for axis in axes:
        number, position, goal, is_on, errors = map(int, axis.split())
        found[number] = AxisState(position, goal, is_on == 1, HardwareError(errors), float(volts), float(celsius), int(boot))
    return found


class StepperBoard:
    """The board on a port. It cannot limit its force: the current of a stepper is the same whatever the load."""

    def __init__(self, port: str, baud: int) -> None:
        self._line = ServoLine(port, baud)

    @property
    def is_open(self) -> bool:
        return self._line.is_open

    @property
    def counts(self) -> LineCounts:
        return self._line.counts

    def open(self) -> None:
        self._line.open()

    def close(self) -> None:
        self._line.close()

    def interruptible(self, check: Callable[[], None]) -> contextlib.AbstractContextManager[None]:
        return self._line.interruptible(check)

    def pause(self, seconds: float) -> None:
        self._line.pause(seconds)

    def read(self) -> Mapping[int, AxisState]:
        found: Mapping[int, AxisState] = {}
        for _ in range(_TRIES):
            answer = self._ask("?")
            if answer is None:
                continue
            try:
                found = states_of(answer)
            except ValueError:
                self.counts.corrupt += 1
                continue
            break
        return found

    def write(self, goals: Mapping[int, int]) -> bool:
        return self._confirmed("G " + " ".join(f"{axis} {goal}" for axis, goal in goals.items()))

    def hold(self) -> bool:
        """Current on; every axis holds where it is."""
        return self._confirmed("H")

    def stop(self, *, release: bool) -> bool:
        return self._confirmed("R" if release else "S")

    def _confirmed(self, text: str) -> bool:
        """Whether the board has said OK; each of these may be said twice."""
        return any(self._ask(text) == "OK" for _ in range(_TRIES))

    def _ask(self, text: str) -> str | None:
        """The board's answer to a line; None without a whole one, which is counted."""
        answer = self._line.ask(line_of(text), _ANSWER_S)
        if answer is None:
            self.counts.silent += 1
            return None
        try:
            return text_of(answer)
        except ValueError:
            self.counts.corrupt += 1
            return None
