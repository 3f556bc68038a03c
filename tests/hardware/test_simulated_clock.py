"""The clock of a simulated bench, by a wall clock that the test sets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from core.devices import DeviceError
from hardware import simulated_clock
from hardware.simulated_clock import STEP_S, SimulatedClock, WorldClock


class Bench:
    """World and program; ``pass_s`` lets the wall clock go on while the world makes the steps that are due."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.wall_s = 100.0
        monkeypatch.setattr(simulated_clock.time, "monotonic", lambda: self.wall_s)
        self.program = SimulatedClock()
        self.world = WorldClock(self.program.file)
        self.bus = SimulatedClock(self.program.file)

    def pass_s(self, seconds: float) -> None:
        for _ in range(round(1000 * seconds)):
            self.wall_s += 0.001
            while self.world.wait_s() == 0.0:
                pass


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    made = Bench(monkeypatch)
    yield made
    made.program.close()


def test_it_goes_with_the_wall_clock_for_all_of_them(bench: Bench) -> None:
    bench.pass_s(1.005)
    assert bench.program() == bench.bus() == bench.world() == pytest.approx(101.005)
    assert bench.world.world_s == pytest.approx(101.0)


def test_it_stands_still_at_what_is_granted_and_goes_on_from_there(bench: Bench) -> None:
    bench.program.grant(100.1)
    bench.pass_s(0.5)
    assert bench.program() == bench.bus() == pytest.approx(100.1, abs=STEP_S)
    assert bench.program() <= 100.1
    bench.program.grant(200.0)
    bench.pass_s(0.5)
    assert bench.program() == pytest.approx(100.6, abs=STEP_S), "what was waited for is not made up for"


def test_a_program_that_hangs_is_waited_for_ten_seconds(bench: Bench) -> None:
    bench.program.grant(100.0)
    bench.pass_s(9.9)
    assert bench.program() <= 100.0 + STEP_S
    bench.pass_s(1.0)
    assert bench.program() == pytest.approx(100.9, abs=0.05), "its faults are found then"
    bench.program.grant(100.5)
    bench.pass_s(1.0)
    assert bench.program() == pytest.approx(100.9, abs=0.05), "it gets on again: late, but not behind for ever"


def test_a_world_that_was_late_becomes_slower_and_does_not_jump(bench: Bench) -> None:
    bench.pass_s(0.1)
    bench.wall_s += 5.0
    before_s = bench.program()
    assert before_s <= bench.world.world_s + STEP_S
    bench.pass_s(0.1)
    assert bench.program() - before_s < 0.2


def test_it_never_goes_back(bench: Bench) -> None:
    seen = []
    for turn in range(400):
        bench.program.grant(100.0 + 0.004 * turn)
        bench.wall_s += 0.3 if turn % 50 == 49 else 0.0
        bench.pass_s(0.007)
        seen.append(bench.bus())
    assert seen == sorted(seen)


def test_the_speed_of_the_simulation_is_told(bench: Bench) -> None:
    assert bench.program.speed == 1.0
    for _ in range(30):
        bench.program.grant(bench.program() + 0.05)
        bench.pass_s(0.1)
        speed = bench.program.speed
    assert speed == pytest.approx(0.4, abs=0.05), "whole steps of 20 ms"


def test_a_file_that_cannot_be_made_or_opened_is_a_device_error(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"the bench twin cannot be started \(No such file"):
        SimulatedClock(str(tmp_path / "gone"))
