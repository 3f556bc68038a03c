"""A stepper board in software on a pseudo-terminal, strict about its protocol (docs/development.md)."""

from __future__ import annotations

import os
import threading
import time
import tty
from dataclasses import dataclass

from core.config.safety import ServosConfig
from hardware.servos.stepper_board import line_of, text_of


@dataclass
class Axis:
    position: float
    goal: int
    is_on: bool = False
    errors: int = 0


class SoftStepper:
    """Answers from a thread. ``said`` are the lines that it understood; faults are set from a test.

    Attributes
    ----------
    mute : lines that get no answer yet, or all of them for a negative number.
    garbled : answers that are damaged yet.
    stuck : axes do not switch off.
    """

    watchdog_s = 0.2
    speed_per_s = 4096.0

    def __init__(self, servos: ServosConfig) -> None:
        self.axes = {joint.id: Axis(1000.0 * joint.id, 1000 * joint.id) for joint in servos.joints}
        self.boot, self.mute, self.garbled, self.stuck = 7, 0, 0, False
        self.said: list[str] = []
        self._is_ended = False
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._moved_s = self._heard_s = time.monotonic()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def restart(self) -> None:
        """The supply dips: counters begin again, the current is off."""
        self.boot += 1
        for axis in self.axes.values():
            axis.position, axis.goal, axis.is_on = 0.0, 0, False

    def close(self) -> None:
        self._is_ended = True
        os.write(self._slave, b"\n")  # wakes the thread
        self._thread.join(2.0)
        os.close(self._master)
        os.close(self._slave)

    def _run(self) -> None:
        rest = b""
        while not self._is_ended:
            rest += os.read(self._master, 4096)
            *lines, rest = rest.split(b"\n")
            for line in lines:
                self._answer(line)

    def _answer(self, line: bytes) -> None:
        now_s = time.monotonic()
        self._move(now_s)
        try:
            text = text_of(line)
        except ValueError:
            return
        self._heard_s = now_s
        self.said.append(text)
        if self.mute:
            self.mute -= 1
            return
        answer = line_of(self._do(text))
        if self.garbled:
            self.garbled -= 1
            answer = answer[:4] + b"#" + answer[5:]
        os.write(self._master, answer)

    def _move(self, now_s: float) -> None:
        if now_s - self._heard_s > self.watchdog_s:
            self._do("S")
        reach, self._moved_s = self.speed_per_s * (now_s - self._moved_s), now_s
        for axis in self.axes.values():
            axis.position += max(-reach, min(reach, axis.goal - axis.position)) if axis.is_on else 0.0

    def _do(self, text: str) -> str:
        letter, *numbers = text.split()
        if letter == "?":
            axes = (f"{k} {round(a.position)} {a.goal} {int(a.is_on)} {a.errors}" for k, a in self.axes.items())
            return ";".join([f"A {self.boot} 24.1 31.5", *axes])
        if letter == "G":
            for number, goal in zip(map(int, numbers[::2]), map(int, numbers[1::2]), strict=True):
                self.axes[number].goal = goal
        for axis in self.axes.values():
            if letter in "HSR":
                axis.goal = round(axis.position)
                axis.position = float(axis.goal)
            if letter == "H":
                axis.is_on = True
            if letter == "R" and not self.stuck:
                axis.is_on = False
        return "OK"
