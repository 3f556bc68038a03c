"""The pilot's thread: it turns until it is closed, and tells of a sleep of the computer."""

from __future__ import annotations

import threading

from core.control.faults import Cause, Fault
from core.control.pilot import PilotLoop
from core.system import slept_s


class Turned:
    """Counts its turns; the test may let the computer sleep or a turn fail."""

    def __init__(self) -> None:
        self.turns = 0
        self.asleep_s = 7.0
        self.reported: list[Fault] = []
        self.closed = False
        self.fails = False
        self.turned = threading.Semaphore(0)

    def tick(self) -> None:
        if self.fails:
            raise RuntimeError("no more")
        self.turns += 1
        self.turned.release()

    def report_fault(self, fault: Fault) -> None:
        self.reported.append(fault)

    def close(self) -> None:
        self.closed = True

    def wait(self, turns: int) -> None:
        for _ in range(turns):
            assert self.turned.acquire(timeout=10.0)


def test_a_sleep_of_the_computer_is_told_once() -> None:
    turned = Turned()
    loop = PilotLoop(turned, lambda: turned.asleep_s)
    turned.wait(3)
    turned.asleep_s += 30.0
    turned.wait(5)
    loop.close()
    assert turned.reported == [Fault(Cause.CLOCK, "the computer slept for 30 s")]
    assert turned.closed


def test_clocks_that_drift_apart_a_little_are_no_sleep() -> None:
    turned = Turned()
    loop = PilotLoop(turned, lambda: turned.asleep_s)
    for _ in range(5):
        turned.wait(1)
        turned.asleep_s += 0.001
    loop.close()
    assert turned.reported == []


def test_a_turn_that_fails_ends_the_turns_with_its_reason() -> None:
    turned = Turned()
    loop = PilotLoop(turned)
    turned.wait(1)
    turned.fails = True
    loop._thread.join(10.0)
    assert loop.failure is not None
    assert "RuntimeError: no more" in loop.failure
    loop.close()
    assert turned.closed


def test_the_sleep_so_far_is_read_from_the_system() -> None:
    assert slept_s() > -0.1
