"""Kills and stops the application, or its bus process, while the program drives; measures how far and long the servos go on.

``python -m tools.kill_campaign [COUNT] [SEED]`` prints one line per strike and a summary. Three processes: the servos live in this
one and are asked for their mechanical positions; the driving application (``fault_campaign.children``) and its bus process are hit.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from core.config.safety import ServosConfig
from hardware.servos.dynamixel_bus import TORQUE
from hardware.twin.servos.bus import SoftServoBus
from tools.fault_campaign.children import read_line, start_child

BOUND_S = 0.3
REST_MM = 0.01
"""One position unit of the servos."""
BOUND_STEPS = 1.0 + REST_MM / 0.6
"""One step, and one position unit for rounding, in the steps of the joints that have the shortest."""
_SAMPLE_S, _WATCH_S, _GONE_S = 0.004, 1.0, 5.0
KINDS = tuple((victim, number) for victim in ("application", "bus process") for number in (signal.SIGKILL, signal.SIGSTOP))
Sample = tuple[float, tuple[float, ...]]


@dataclass(frozen=True, slots=True)
class StrikeOutcome:
    """``stop_ms`` until the last servo stood still for good, ``steps`` the longest way of a servo in its own bounded steps.

    ``before_mm`` is how far the fastest servo went in the 100 ms before; ``bus_gone`` whether the bus process ended without us: one
    that has lost its application goes on, and watches the servos, which hold.
    The strike itself fell within ``blur_ms``: times count from its beginning, ways from its end.
    """

    victim: str
    signal: str
    stop_ms: float
    steps: float
    before_mm: float
    bus_gone: bool
    blur_ms: float


class PositionLog(threading.Thread):
    """Writes down where the servos' horns are."""

    def __init__(self, servos: SoftServoBus) -> None:
        super().__init__(name="positions", daemon=True)
        self.samples: list[Sample] = []
        self._servos = servos
        self._done = threading.Event()

    def run(self) -> None:
        while not self._done.wait(_SAMPLE_S):
            self.take()

    def take(self) -> Sample:
        positions = self._servos.positions_mm()
        sample = time.monotonic(), positions
        self.samples.append(sample)
        return sample

    def end(self) -> list[Sample]:
        self._done.set()
        self.join()
        return sorted(self.samples)


@contextmanager
def application(servos: SoftServoBus) -> Iterator[tuple[int, int]]:
    """A driving application: the ids of its process and of its bus process; both are gone afterwards."""
    bus_pid = None
    servos.write_by_other(TORQUE, b"\0")  # those of the strike before hold, and servos that hold are not zeroed
    try:
        with start_child("drive", servos.port) as process:
            bus_pid = int(str(read_line(process)["bus_pid"]))
            yield process.pid, bus_pid
            process.kill()
            process.wait()
    finally:
        if bus_pid is not None and not _gone(bus_pid, _GONE_S):
            os.kill(bus_pid, signal.SIGKILL)


def strike(servos: SoftServoBus, victim: str, number: signal.Signals, delay_s: float) -> StrikeOutcome:
    """One application, hit `delay_s` after it began to drive."""
    with application(servos) as (pid, bus_pid):
        recorder = PositionLog(servos)
        recorder.start()
        time.sleep(delay_s)
        target = pid if victim == "application" else bus_pid
        hit_s, _ = recorder.take()
        os.kill(target, number)
        struck_s, start_mm = recorder.take()
        time.sleep(_WATCH_S)
        samples = recorder.end()
        gone = _gone(bus_pid, 0.0)
        if not gone:
            os.kill(bus_pid, signal.SIGKILL)  # a stopped process does not end by itself, and one that watches only after minutes
    joints = ServosConfig().joints
    after = [sample for sample in samples if sample[0] >= hit_s]
    end_mm = after[-1][1]
    moving = [n for n, (_, at) in enumerate(after) if max(abs(a - b) for a, b in zip(at, end_mm, strict=True)) > REST_MM]
    stopped_s = after[moving[-1] + 1][0] if moving else hit_s
    late = [at for time_s, at in after if time_s >= struck_s]
    steps = max(abs(a - b) / j.max_step_mm for at in late for a, b, j in zip(at, start_mm, joints, strict=True))
    before = next(at for time_s, at in samples if time_s >= hit_s - 0.1)
    before_mm = max(abs(a - b) for a, b in zip(before, start_mm, strict=True))
    stop_ms, blur_ms = 1000.0 * (stopped_s - hit_s), 1000.0 * (struck_s - hit_s)
    return StrikeOutcome(victim, number.name, stop_ms, steps, before_mm, gone, blur_ms)


def _gone(pid: int, timeout_s: float) -> bool:
    """Whether a process that is not our child has ended; a zombie has."""
    until = time.monotonic() + timeout_s
    while True:
        try:
            ended = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in {"Z", "X"}
        except (FileNotFoundError, ProcessLookupError):
            ended = True
        if ended or time.monotonic() >= until:
            return ended
        time.sleep(0.01)


def campaign(count: int, seed: int = 0) -> Iterator[StrikeOutcome]:
    """`count` strikes at random moments, all kinds in turn."""
    draw = random.Random(seed)
    servos = SoftServoBus(ServosConfig(), wire_time=True, seed=seed)
    servos.start()
    try:
        for turn in range(count):
            yield strike(servos, *KINDS[turn % len(KINDS)], delay_s=draw.uniform(0.2, 1.2))
    finally:
        servos.stop()


def main(count: int = 60, seed: int = 0) -> None:
    outcomes = []
    for outcome in campaign(count, seed):
        outcomes.append(outcome)
        sys.stdout.write(f"{outcome}\n")
        sys.stdout.flush()
    for victim, number in KINDS:
        of_kind = [outcome for outcome in outcomes if (outcome.victim, outcome.signal) == (victim, number.name)]
        if of_kind:
            times = sorted(outcome.stop_ms for outcome in of_kind)
            line = f"{number.name} {victim}: n {len(times)}, stop median {times[len(times) // 2]:.0f} ms, max {times[-1]:.0f} ms, "
            sys.stdout.write(line + f"farthest {max(outcome.steps for outcome in of_kind):.2f} steps\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
