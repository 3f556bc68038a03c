"""Faults 30, 31 and 33 to 42: window, worker, operator input, clock, disk, recorder, damaged files, killed programs."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from PySide6.QtCore import QTimer

from app.operator.engine_thread import EnginePhase
from app.operator.window import OperatorWindow
from app.ui.window_base import make_application
from core.annotation.store import AnnotationStore
from core.config.models import Config, load_config
from core.control.alerts import ALERTS
from core.control.faults import Cause
from core.control.gate import Source
from core.control.modes import Act, Mode
from core.control.motion import AT_REST, Jog
from core.control.pilot import PERIOD_S
from core.devices import UserError
from core.session.manifest import EVENTS, FRAMES, MANIFEST, Event, EventKind, read_manifest
from core.session.reader import SessionReader
from core.session.recovery import find_cut_sessions, recover
from core.session.video import FrameEncoder
from hardware.rig import RigKind, kind_of
from tools.fault_campaign.bench import ExpectedReaction, FaultBench, bench_fault, judge, open_bench
from tools.fault_campaign.children import IMAGE, KEY, MODULE, ROOT, read_line, start_child
from tools.fault_campaign.registry import CampaignError, Kit, Observation, check, fault
from tools.fault_campaign.window import bring_to, make_test_window, record, until

_KILLS = 8  # of the annotating program
_ROUNDS = 6  # hand-overs that the operator ends
_DAMAGES = 24  # copies of each file
_START_S, _END_S = 60.0, 180.0  # patience with a program's start and end
_SLEEP_S, _SUSPEND_S = 0.8, 1.3


def _events_of(folder: Path) -> tuple[Event, ...]:
    with SessionReader(folder) as reader:
        reader.wait(20.0)
        return reader.events


def _words(events: tuple[Event, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(f"{e.kind}: {e.text}" if e.text else e.kind.value for e in events if e.kind is not EventKind.VIDEO))


# ---- window and worker


@fault(30)
def window_hangs(kit: Kit) -> Observation:
    if kit.live:
        return _real_window_hangs(kit)
    with open_bench(kit) as bench:
        bench.hand_over().mark()
        bench.hooks.window_lives = False
        bench.run(0.8)
        bench.hooks.window_lives = True
        bench.run(0.1)
        path, causes = (Mode.HOLD, Mode.ADVISORY), (Cause.DEADMAN, Cause.WINDOW_HUNG)
        return judge(bench, ExpectedReaction(path, causes, Cause.WINDOW_HUNG, within_s=0.14))


def _latched(window: OperatorWindow) -> Cause | None:
    view = window.controls.view
    return view.latched.cause if view is not None and view.latched is not None else None


def _start_driving(window: OperatorWindow) -> list[str]:
    return check(
        (record(window), "nothing was recorded"),
        (bring_to(window, Mode.AUTONOMOUS), "the program did not get to drive"),
    )


def _real_window_hangs(kit: Kit) -> Observation:
    window, _ = make_test_window(kit.folder)
    try:
        problems = _start_driving(window)
        folder = window.recorder.status.folder
        slept_s = time.monotonic()
        QTimer.singleShot(0, lambda: time.sleep(_SLEEP_S))
        until(lambda: time.monotonic() > slept_s + _SLEEP_S + 0.3)
        latched = _latched(window)
        said = any(ALERTS[Cause.WINDOW_HUNG].text in line for line in window.panels.events.lines)
        problems += check((latched is Cause.WINDOW_HUNG, f"latched is {latched or 'nothing'}"), (said, "no alert"))
    finally:
        window.close()
    if folder is None:
        return Observation("not recorded", problems=tuple(problems))
    after = tuple(event for event in _events_of(folder) if event.time_s >= slept_s)
    modes = [(event.text, event.time_s - slept_s) for event in after if event.kind is EventKind.MODE]
    problems += check(
        ([mode for mode, _ in modes] == [Mode.HOLD, Mode.ADVISORY], f"modes went {modes}"),
        (any(event.text == Cause.WINDOW_HUNG.value for event in after), "not in the session: window hangs"),
    )
    words = {Mode.HOLD.value: "HOLD", Mode.ADVISORY.value: "DISARM"}
    reaction = ", ".join(f"{words.get(mode, mode)} at {1000 * at_s:.0f} ms" for mode, at_s in modes)
    alerts = (ALERTS[Cause.DEADMAN].text, ALERTS[Cause.WINDOW_HUNG].text)
    return Observation(reaction, alerts, _words(after), tuple(problems))


@fault(31)
def worker_dies(kit: Kit) -> Observation:
    window, made = make_test_window(kit.folder)
    try:
        problems = _start_driving(window)
        made[-1].broken = True
        problems += check(
            (until(lambda: window.rig.phase is EnginePhase.FAULT), "the window does not tell"),
            (window.panels.notice.isVisibleTo(window), "no notice is shown"),
            (window.rig.pilot is None, "there is still somebody who drives"),
        )
        made[-1].broken = False
        folder = window.recorder.status.folder
        window.rig.restart()
        again = until(lambda: window.rig.phase is EnginePhase.RUNNING and window.controls.view is not None)
        latched = _latched(window)
        problems += check(
            (again, "it could not be started again"),
            (latched is Cause.HEARTBEAT_LOST, f"after the new start {latched or 'nothing'} is latched"),
        )
    finally:
        window.close()
    events = _words(_events_of(folder)) if folder is not None else ()
    problems += check((f"{EventKind.FAULT}: {Cause.HEARTBEAT_LOST}" in events, "not in the session: worker stopped"))
    reaction = "DISARM: rig closed, notice shown; latched until acknowledged"
    return Observation(reaction, ("The rig stopped",), events, tuple(problems))


@fault(41)
def quit_while_busy(kit: Kit) -> Observation:
    problems: list[str] = []
    reaction: list[str] = []
    events: tuple[str, ...] = ()
    for mode in (Mode.ADVISORY, Mode.ARMED, Mode.AUTONOMOUS):
        folder = kit.part(mode.value).folder
        command = [sys.executable, "-m", MODULE, "window", str(folder), mode.value]
        environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=_END_S, env=environment)
        said = json.loads(done.stdout.splitlines()[-1]) if done.stdout.strip() else {}
        sessions = sorted(folder.glob("session_*"))
        whole = len(sessions) == 1 and read_manifest(sessions[0]).closed
        problems += check(
            (said.get("mode") == mode.value, f"{mode} was not reached"),
            (done.returncode == 0, f"{mode}: exit code {done.returncode}"),
            (whole, f"{mode}: the session is not whole"),
        )
        events += _words(_events_of(sessions[0])) if sessions else ()
        reaction.append(f"{mode}: exit code {done.returncode}, session {'whole' if whole else 'cut'}")
    return Observation("; ".join(reaction), (), tuple(dict.fromkeys(events)), tuple(problems))


@fault(42)
def labels(kit: Kit) -> Observation:
    problems = []
    rigs = {
        RigKind.SIM: {},
        RigKind.LIVE: {"camera": "realsense", "robot": "none"},
        RigKind.PLAYBACK: {"camera": "video_file", "robot": "none", "source": "a.mkv"},
    }
    make_application()
    for kind, rig in rigs.items():
        config = Config.model_validate({"rig": rig, "record": {"ring_s": 0.0}})
        window = OperatorWindow(config, lambda _config: None, kind)  # type: ignore[arg-type, return-value]
        problems += check(
            (kind_of(config.rig) is kind, f"{rig} counts as {kind_of(config.rig)}"),
            (kind.value in window.windowTitle(), f"{kind} is not in the window's title"),
            (window.panels.banner.word == kind.value, f"{kind} is on no banner"),
        )
        window.close()
        window.deleteLater()
    with open_bench(kit, live=False) as bench:
        bench.record()
        bench.run(0.2)
        manifest, _ = bench.recorded()
    problems += check((manifest.kind == RigKind.SIM.value, f"the session says {manifest.kind}"))
    reaction = "SIM, LIVE and PLAYBACK on title, banner and in the manifest"
    return Observation(reaction, (), (f"manifest: {manifest.kind}",), tuple(problems))


# ---- operator input and clock


@fault(33)
def override(kit: Kit) -> Observation:
    draw = random.Random(33)
    with open_bench(kit) as bench:
        bench.hand_over().mark()
        problems = []
        for _ in range(_ROUNDS):
            bench.run(draw.uniform(0.02, 0.3))
            problems += _touch(bench, draw)
            bench.run(0.4)
            bench.hand_over()
        modes = [view.mode for view in bench.views_since_mark]
        back = sum(a is Mode.AUTONOMOUS and b is Mode.ARMED for a, b in zip(modes, modes[1:], strict=False))
        problems += check((back >= _ROUNDS, f"only {back} of {_ROUNDS} touches ended autonomy"))
        seen = judge(bench, ExpectedReaction(None), *problems)
        more = check((any("override" in event for event in seen.events), "no override in the session"))
        return replace(seen, reaction=f"{back} of {_ROUNDS} in the same turn", problems=(*seen.problems, *more))


def _touch(bench: FaultBench, draw: random.Random) -> list[str]:
    """Touch the controls, in the same turn as other requests."""
    if bench.mode is not Mode.AUTONOMOUS:
        bench.hand_over()
    if draw.random() < 0.5:
        bench.pilot.ask(draw.choice((Act.HAND_OVER, Act.TAKE_BACK, Act.ARM)))
    bench.jog = draw.choice((Jog(advance=1.0), Jog(bend=-1.0), Jog(straighten=True), Jog(delivery=-0.3)))
    view = bench.turn()
    bench.jog = AT_REST
    stands = view.program_command is None and view.permitted is not Source.PROGRAM
    return check(
        (view.mode is Mode.ARMED, f"after a touch the mode is {view.mode}"),
        (stands, "the program still drives in the turn of the touch"),
    )


@fault(34)
def deadman(kit: Kit) -> Observation:
    def time_to_hold() -> float:
        """By the pilot's clock, less the turn in which the deadman was last reported."""
        since_s = bench.view.time_s
        bench.until_mode(Mode.HOLD, 1.0)
        return bench.view.time_s - since_s

    with open_bench(kit, live=False) as bench:
        bench.hand_over().mark()
        bench.held = False
        released_s = time_to_hold()
        bench.hand_over()
        bench.deadman_speaks = False
        silent_s = time_to_hold()
        bench.run(0.7)  # longer than a hold clears itself
        bench.deadman_speaks = True
        bench.run(0.3)
        expired = bench.mode is Mode.HOLD
        bench.pilot.ask(Act.DISARM)
        bench.held = True
        bench.until(lambda view: not view.against_arming)
        bench.pilot.ask(Act.ARM)
        bench.run(0.1)
        bench.pilot.ask(Act.HAND_OVER)
        bench.run(0.1)
        problems = check(
            (released_s <= 0.121, f"released held after {1000 * released_s:.0f} ms"),
            (silent_s <= 0.121, f"silent held after {1000 * silent_s:.0f} ms"),
            (expired, "a hold of which the deadman was lost for long cleared itself"),
            (bench.mode is Mode.ARMED, "a deadman that was down before arming counted"),
        )
        seen = judge(bench, ExpectedReaction(None, (Cause.DEADMAN,)), *problems)
        reaction = f"HOLD {1000 * released_s:.0f} ms after the release, {1000 * silent_s:.0f} ms after the last word"
        return replace(seen, reaction=reaction)


@bench_fault(35, ExpectedReaction((Mode.ADVISORY,), (Cause.CLOCK,), Cause.CLOCK), seconds=5 * PERIOD_S)
def clock(bench: FaultBench) -> None:
    if bench.live:
        time.sleep(_SUSPEND_S)
    else:
        bench.jump(2.0)


# ---- recording and files


@fault(36)
def disk_full(kit: Kit) -> Observation:
    total, free = 100_000_000_000, 50_000_000_000

    def usage(_path: object) -> tuple[int, int, int]:
        return total, total - free, free

    record_settings = {"warn_free_share": 0.07, "stop_free_mb": 40.0}
    with patch.object(shutil, "disk_usage", usage), open_bench(kit, live=False, record=record_settings) as bench:
        bench.hand_over().mark()
        folder = bench.writer.status().folder
        assert folder is not None
        free = 5_000_000_000
        warned = bench.wait_for(lambda: bool(bench.writer.status().warning))
        bench.run(0.1)
        free = 1_000_000
        stopped = bench.wait_for(lambda: bool(bench.writer.status().problem))
        bench.run(0.3)
        alerts = [alert.key for alert in bench.alerts_since_mark]
        status = bench.writer.status()
        with SessionReader(folder) as reader:
            reader.wait(10.0)
            rows, closed = len(reader), reader.is_closed
        problems = check(
            (warned and Cause.DISK_LOW in alerts, "no warning"),
            (stopped and Cause.DISK_FULL in alerts, "nothing said that the recording stopped"),
            (not status.recording, "the recording went on"),
            (rows > 0 and closed, f"of the session {rows} rows are left, closed: {closed}"),
        )
        seen = judge(bench, ExpectedReaction(()), *problems)
        reaction = f"goes on; {status.problem.partition(':')[0]}; {rows} frames kept"
        return replace(seen, reaction=reaction, events=("session closed with the cause",))


@fault(38)
def slow_encoder(kit: Kit) -> Observation:
    encode, go_on = FrameEncoder.encode, threading.Event()

    def slow(self: FrameEncoder, *arguments: object, **named: object) -> object:
        go_on.wait(20.0)
        return encode(self, *arguments, **named)  # type: ignore[arg-type]

    with open_bench(kit, live=False, record={"max_queue": 3}) as bench:
        bench.hand_over().mark()
        with patch.object(FrameEncoder, "encode", slow):
            bench.hooks.recorder_keeps_up = False
            bench.run(0.5)
            go_on.set()
            bench.wait_for(lambda: bench.writer.pictures_waiting == 0)
            bench.hooks.recorder_keeps_up = True
        bench.run(1.1)  # the next picture says how many were dropped before it
        dropped = bench.writer.status().dropped
        problems = check((dropped > 0, "nothing was counted as dropped"))
        seen = judge(bench, ExpectedReaction((), (Cause.RECORDER_BEHIND,)), *problems)
        more = check((any(text.startswith("frames dropped") for text in seen.events), "the drops are not in the session"))
        return replace(seen, reaction=f"goes on; {dropped} frames dropped and counted", problems=(*seen.problems, *more))


@fault(39)
def malformed(kit: Kit) -> Observation:
    draw = random.Random(39)
    with open_bench(kit, live=False) as bench:
        bench.run(0.2)
        bench.record()
        bench.run(0.5)
        bench.recorded()
        session = bench.writer.status().folder
    assert session is not None
    config = kit.folder / "user.toml"
    config.write_text('[safety]\nmin_confidence = 0.6\n[twin]\nphantom = "tree"\n', encoding="utf-8")
    store = kit.folder / "a.sqlite"
    with AnnotationStore(store) as kept:
        kept.add_image(IMAGE, 1000, 5)
    problems: list[str] = []
    tally = {"refused": 0, "read": 0}
    for number in range(_DAMAGES):
        work = kit.part(f"try{number}")
        for original, use in ((config, load_config), (store, _read_store)):
            copy = work.folder / original.name
            copy.write_bytes(_damage(original.read_bytes(), draw))
            problems += _use(use, copy, tally)
        target = work.part("session").folder
        names = (MANIFEST, FRAMES, EVENTS, "video_0000.mkv")
        for name in names:
            shutil.copyfile(session / name, target / name)
        victim = target / draw.choice(names)
        victim.write_bytes(_damage(victim.read_bytes(), draw))
        before = victim.read_bytes()
        problems += _use(_read_session, target, tally)
        problems += check((victim.read_bytes() == before, f"{victim.name} of a damaged session was changed"))
    reaction = f"{tally['refused']} refused by one line, {tally['read']} read (what is damaged in them named)"
    return Observation(reaction, events=("nothing is recorded meanwhile",), problems=tuple(dict.fromkeys(problems)))


def _damage(data: bytes, draw: random.Random) -> bytes:
    place, kind = draw.randrange(len(data)), draw.randrange(3)
    if kind == 0:
        return data[:place]
    if kind == 1:
        return data[:place] + bytes(16) + data[place + 16 :]
    flipped = np.frombuffer(data, np.uint8).copy()
    for _ in range(draw.choice((1, 1, 20))):
        flipped[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    return flipped.tobytes()


def _use(read: Callable[[Path], object], path: Path, tally: dict[str, int]) -> list[str]:
    """Problems: an error that is not a UserError, or one of more than a line."""
    try:
        read(path)
    except UserError as error:
        tally["refused"] += 1
        return check(("\n" not in str(error), f"more than a line about {path.name}"))
    except Exception as error:  # noqa: BLE001 - what must never happen is what this looks for
        return [f"{path.name}: {type(error).__name__} escaped"]
    tally["read"] += 1
    return []


def _read_store(path: Path) -> None:
    with AnnotationStore(path, read_only=True) as store:
        store.images()
        store.annotations()


def _read_session(path: Path) -> None:
    with SessionReader(path) as reader:
        reader.wait(10.0)
        for place in range(len(reader)):
            reader.tick(place)
        _ = reader.events
    recover(path, path.parent / "recovered")


# ---- killed programs


@fault(37)
def killed_recording(kit: Kit) -> Observation:
    settings = kit.folder / "small.toml"
    settings.write_text("[perception.segmentation]\nthreads = 1\n[record]\nsync_s = 0.5\n", encoding="utf-8")
    folder = kit.folder / "sessions"
    command = [sys.executable, "main.py", "record", "--seconds", "600", "--out", str(folder), "--config", str(settings)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        _rows_written(folder)
        time.sleep(random.Random(37).uniform(0.5, 2.0))
        rows = _rows_written(folder)
    finally:
        process.kill()
        process.wait()
    cut = find_cut_sessions(folder)
    problems = check((len(cut) == 1, f"{len(cut)} cut sessions are listed"))
    if not cut:
        return Observation("not listed", problems=tuple(problems))
    done = recover(cut[0].folder)
    with SessionReader(done.folder) as reader:
        reader.wait(20.0)
        kept, loss = len(reader), reader.manifest.recovered if reader.manifest is not None else None
    problems += check(
        (kept >= rows, f"of {rows} rows that were written {kept} are left"),
        (loss is not None, "the copy does not say what is lost"),
    )
    lost = f"{loss.seconds:.1f} s and {loss.pictures} pictures lost" if loss is not None else "loss unknown"
    reaction, events = f"listed, recovered: {kept} rows, {lost}", ("the copy's manifest names the loss",)
    return Observation(reaction, events=events, problems=tuple(problems))


def _rows_written(folder: Path) -> int:
    """Rows on the disk; waits for the first ten."""
    until_s = time.monotonic() + _START_S
    while time.monotonic() < until_s:
        rows = sum(path.read_bytes().count(b"\n") for path in folder.glob("session_*/frames.jsonl"))
        if rows >= 10:
            return rows
        time.sleep(0.1)
    raise CampaignError("the recording did not begin in time")


@fault(40)
def killed_annotating(kit: Kit) -> Observation:
    path = kit.folder / "a.sqlite"
    draw = random.Random(40)
    told = 0
    problems: list[str] = []
    for _ in range(_KILLS):
        with start_child("annotate", str(path), str(told + 1)) as process:
            first = read_line(process)
            time.sleep(draw.uniform(0.0, 0.1))
            process.kill()
            process.wait()
            assert process.stdout is not None
            lines = [json.loads(line) for line in process.stdout.read().split(b"\n")[:-1]]
        told = int((lines or [first])[-1]["saved"])
        with AnnotationStore(path, read_only=True) as store:
            (one,) = store.annotations()
            kept = int(one.content.robot[0][0])
            problems += check(
                (told <= kept <= told + 1, f"{told} were told as saved, {kept} are there"),
                (store.history(KEY).current == one.content, "the history lacks the last edit"),
            )
            told = kept
    return Observation(f"{told} saves, {_KILLS} kills, none lost", events=("the journal has every edit",), problems=tuple(problems))
