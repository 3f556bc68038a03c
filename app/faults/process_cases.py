"""Faults 29, 32, 37, 40: programs that get in each other's way, or are killed."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from app.faults.bench import open_bench
from app.faults.children import KEY, MODULE
from app.faults.judge import Wanted, judge, mark
from app.faults.registry import CampaignError, Kit, Seen, fault
from core.control.modes import Mode
from core.servo_config import ServosConfig
from core.session.reader import SessionReader
from core.session.recovery import find_cut_sessions, recover
from core.study.annotation_store import AnnotationStore
from hardware.twin.servo_bus import SoftServoBus

ROOT = Path(__file__).resolve().parents[2]
_BOUND_S = 1.0
"""Half a second of patience with a stopped application, a hold, and a machine that has other things to do."""
_STEP_SLACK = 1.05
_REST_MM = 0.01
_SAMPLE_S, _WATCH_S, _START_S = 0.004, 1.6, 60.0
_GLANCE_S, _MOVING_MM = 0.04, 0.2
_KILLS = 8


@contextmanager
def child(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """One of the campaign's programs; gone afterwards."""
    process = subprocess.Popen([sys.executable, "-m", MODULE, *arguments], cwd=ROOT, stdout=subprocess.PIPE)
    try:
        yield process
    finally:
        with_stdout = process.stdout
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.kill()
        process.wait()
        if with_stdout is not None:
            with_stdout.close()


def _line(process: subprocess.Popen[bytes]) -> dict[str, object]:
    assert process.stdout is not None
    try:
        found = json.loads(process.stdout.readline() or b"{}")
    except ValueError:
        found = {}
    if not found:
        raise CampaignError("a program of the campaign did not start")
    return dict(found)


@fault(
    29,
    "two programs on one port",
    injected="a second program opens the port while the first one drives",
    wanted="the second is refused by name; the first drives on",
    quick=False,
)
def two_programs(kit: Kit) -> Seen:
    with open_bench(kit, live=True) as bench:
        start = mark(bench.hand_over())
        assert bench.bus is not None
        with child("open", bench.bus.port) as process:
            bench.wait_for(lambda: process.poll() is not None)
            said = _line(process)
        problems = [] if said.get("error") == "PortTaken" else [f"the second program: {said}"]
        driving = bench.mode in {Mode.AUTONOMOUS, Mode.HOLD}
        problems += [] if driving else [f"the first program went to {bench.mode}"]
        seen = judge(bench, start, Wanted((), (), alternatives=((Mode.HOLD,),), may_hold=True), *problems)
        return replace(
            seen, reaction=f"refused: {str(said.get('message', '')).replace(bench.bus.port, 'PORT')}; the first one goes on"
        )


@dataclass(frozen=True, slots=True)
class Strike:
    """What became of the servos: time until the last one stood still, and the longest way in its own bounded steps."""

    what: str
    stop_s: float
    steps: float


@fault(
    32,
    "process killed or stopped",
    injected="SIGKILL and SIGSTOP, to the application and to the bus process, while the program drives",
    wanted=f"the servos stand within {_BOUND_S:g} s, and within one bounded step from where the order found them",
    quick=False,
)
def killed(kit: Kit) -> Seen:
    strikes = []
    for victim in ("application", "bus process"):
        for number in (signal.SIGKILL, signal.SIGSTOP):
            strikes.append(_strike(victim, number))
    problems = [f"{one.what}: still moving after {one.stop_s:.2f} s" for one in strikes if one.stop_s > _BOUND_S]
    # a stopped application is still permitted until its heartbeat is missed: its order is good for a step, and then held
    problems += [f"{one.what}: went {one.steps:.2f} steps" for one in strikes if one.steps > _STEP_SLACK]
    reaction = "; ".join(f"{one.what}: {1000 * one.stop_s:.0f} ms, {one.steps:.2f} steps" for one in strikes)
    return Seen(f"servos stand. {reaction}", events=("the session ends there (fault 37)",), problems=tuple(problems))


def _strike(victim: str, number: signal.Signals) -> Strike:
    servos = ServosConfig()
    bus = SoftServoBus(servos, wire_time=True)
    bus.start()
    samples: list[tuple[float, tuple[float, ...]]] = []
    done = threading.Event()

    def watch() -> None:
        while not done.wait(_SAMPLE_S):
            positions = bus.positions_mm()
            samples.append((time.monotonic(), positions))

    try:
        with child("drive", bus.port) as process:
            bus_pid = int(str(_line(process)["bus_pid"]))
            watcher = threading.Thread(target=watch, daemon=True)
            watcher.start()
            time.sleep(0.6)
            _await_motion(bus)
            hit_s = time.monotonic()
            os.kill(process.pid if victim == "application" else bus_pid, number)
            start_mm = bus.positions_mm()
            struck_s = time.monotonic()
            time.sleep(_WATCH_S)
            done.set()
            watcher.join()
            if victim != "application":
                _end(bus_pid)
    finally:
        done.set()
        bus.stop()
    after = [sample for sample in samples if sample[0] >= hit_s]
    end_mm = after[-1][1]
    moving = [n for n, (_, at) in enumerate(after) if max(abs(a - b) for a, b in zip(at, end_mm, strict=True)) > _REST_MM]
    stopped_s = after[min(moving[-1] + 1, len(after) - 1)][0] if moving else hit_s
    late = [at for time_s, at in after if time_s >= struck_s]
    steps = max(abs(a - b) / j.max_step_mm for at in late for a, b, j in zip(at, start_mm, servos.joints, strict=True))
    return Strike(f"{number.name} {victim}", stopped_s - hit_s, steps)


def _await_motion(bus: SoftServoBus) -> None:
    """Until a servo is under way: a strike at one that stands shows nothing."""
    until_s = time.monotonic() + _WATCH_S
    while time.monotonic() < until_s:
        before = bus.positions_mm()
        time.sleep(_GLANCE_S)
        if max(abs(a - b) for a, b in zip(before, bus.positions_mm(), strict=True)) > _MOVING_MM:
            return


def _end(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return


@fault(
    37,
    "kill -9 while recording",
    injected="the recording program is killed at a random moment",
    wanted="the session is listed as cut, is recovered into a copy, and the copy says what is lost",
    quick=False,
)
def killed_recording(kit: Kit) -> Seen:
    settings = kit.folder / "small.toml"
    settings.write_text("[perception.segmentation]\nthreads = 1\n[record]\nsync_s = 0.5\n", encoding="utf-8")
    folder = kit.folder / "sessions"
    command = [sys.executable, "main.py", "record", "--seconds", "600", "--out", str(folder), "--config", str(settings)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        rows = _rows_written(folder)
        time.sleep(random.Random(37).uniform(0.5, 2.0))
        rows = _rows_written(folder)
    finally:
        process.kill()
        process.wait()
    cut = find_cut_sessions(folder)
    problems = [] if len(cut) == 1 else [f"{len(cut)} cut sessions are listed"]
    if not cut:
        return Seen("not listed", problems=tuple(problems))
    done = recover(cut[0].folder)
    with SessionReader(done.folder) as reader:
        reader.wait(20.0)
        kept, loss = len(reader), reader.manifest.recovered if reader.manifest is not None else None
    problems += [] if kept >= rows else [f"of {rows} rows that were written {kept} are left"]
    problems += [] if loss is not None else ["the copy does not say what is lost"]
    lost = f"{loss.seconds:.1f} s and {loss.pictures} pictures lost" if loss is not None else "loss unknown"
    return Seen(f"listed, recovered: {kept} rows, {lost}", events=("the copy's manifest names the loss",), problems=tuple(problems))


def _rows_written(folder: Path) -> int:
    """Rows that are on the disk by now; waits for the first thirty."""
    until_s = time.monotonic() + _START_S
    while time.monotonic() < until_s:
        rows = sum(path.read_bytes().count(b"\n") for path in folder.glob("session_*/frames.jsonl"))
        if rows >= 10:
            return rows
        time.sleep(0.1)
    raise CampaignError("the recording did not begin in time")


@fault(
    40,
    "kill during annotation save",
    injected=f"a program that saves one annotation after the other is killed, {_KILLS} times",
    wanted="nothing is lost after it said that it was saved",
    quick=False,
)
def killed_annotating(kit: Kit) -> Seen:
    path = kit.folder / "a.sqlite"
    draw = random.Random(40)
    told, problems = 0, []
    for _ in range(_KILLS):
        with child("annotate", str(path), str(told + 1)) as process:
            first = _line(process)
            time.sleep(draw.uniform(0.0, 0.1))
            process.kill()
            process.wait()
            assert process.stdout is not None
            lines = [json.loads(line) for line in process.stdout.read().split(b"\n")[:-1]]
        told = int((lines or [first])[-1]["saved"])
        with AnnotationStore(path, read_only=True) as store:
            (one,) = store.annotations()
            kept = int(one.content.robot[0][0])
            problems += [] if told <= kept <= told + 1 else [f"{told} were told as saved, {kept} are there"]
            problems += [] if store.history(KEY).current == one.content else ["the history lacks the last edit"]
            told = kept
    return Seen(f"{told} saves, {_KILLS} kills, none lost", events=("the journal has every edit",), problems=tuple(problems))
