"""Faults 31, 41, 42: what happens to the window's worker, to its end, and what its banner says."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from PySide6.QtCore import QTimer

from app.engine_thread import Phase
from app.faults.bench import open_bench
from app.faults.children import MODULE
from app.faults.process_cases import ROOT
from app.faults.registry import Kit, Seen, fault
from app.faults.window_drive import bring_to, make_test_window, record, until
from core.config import Config
from core.control.alerts import ALERTS
from core.control.faults import Cause
from core.control.modes import Mode
from core.session.events import EventKind
from core.session.manifest import read_manifest
from core.session.reader import SessionReader
from hardware.rig import RigKind, kind_of

_END_S, _SLEEP_S = 180.0, 0.8


@fault(
    31,
    "worker dies",
    injected="in the window, perception raises while the program drives",
    wanted="DISARM: the robot is held and let go; the window says so and stays; starting again acknowledges nothing",
    quick=False,
)
def worker_dies(kit: Kit) -> Seen:
    window, made = make_test_window(kit.folder)
    problems = []
    try:
        problems += [] if record(window) else ["nothing was recorded"]
        problems += [] if bring_to(window, Mode.AUTONOMOUS) else ["the program did not get to drive"]
        made[-1].broken = True
        problems += [] if until(lambda: window._phase is Phase.FAULT) else ["the window does not tell"]
        notice = window.panels.notice
        shown = notice.isVisibleTo(window)
        problems += [] if shown else ["no notice is shown"]
        problems += [] if window.pilot is None else ["there is still somebody who drives"]
        made[-1].broken = False
        folder = window._recorder.status.folder
        window.restart()
        again = until(lambda: window._phase is Phase.RUNNING and window.desk.view is not None)
        problems += [] if again else ["it could not be started again"]
        view = window.desk.view
        latched = view.latched.cause if view is not None and view.latched is not None else None
        problems += [] if latched is Cause.WORKER_DEAD else [f"after the new start {latched or 'nothing'} is latched"]
    finally:
        window.close()
    told = _events_of(folder) if folder is not None else []
    problems += [] if f"{EventKind.FAULT}: {Cause.WORKER_DEAD}" in told else ["not in the session: worker stopped"]
    return Seen("DISARM: rig closed, notice shown; latched until acknowledged", ("The rig stopped",), tuple(told), tuple(problems))


def hung_window(kit: Kit) -> Seen:
    """Fault 30 in the real window: its thread sleeps while the program drives."""
    window, _ = make_test_window(kit.folder)
    problems = []
    try:
        problems += [] if record(window) else ["nothing was recorded"]
        problems += [] if bring_to(window, Mode.AUTONOMOUS) else ["the program did not get to drive"]
        folder = window._recorder.status.folder
        slept_s = time.monotonic()
        QTimer.singleShot(0, lambda: time.sleep(_SLEEP_S))
        until(lambda: time.monotonic() > slept_s + _SLEEP_S + 0.3)
        view = window.desk.view
        latched = view.latched.cause if view is not None and view.latched is not None else None
        problems += [] if latched is Cause.WINDOW_HUNG else [f"latched is {latched or 'nothing'}"]
        said = [line for line in window.panels.events.lines if ALERTS[Cause.WINDOW_HUNG].text in line]
        problems += [] if said else ["no alert"]
    finally:
        window.close()
    if folder is None:
        return Seen("not recorded", problems=tuple(problems))
    with SessionReader(folder) as reader:
        reader.wait(10.0)
        after = [event for event in reader.events if event.time_s >= slept_s]
    modes = [(event.text, event.time_s - slept_s) for event in after if event.kind is EventKind.MODE]
    problems += [] if [mode for mode, _ in modes] == [Mode.HOLD, Mode.ADVISORY] else [f"modes went {modes}"]
    problems += [] if any(event.text == Cause.WINDOW_HUNG.value for event in after) else ["not in the session: window hangs"]
    words = {Mode.HOLD.value: "HOLD", Mode.ADVISORY.value: "DISARM"}
    reaction = ", ".join(f"{words.get(mode, mode)} at {1000 * at_s:.0f} ms" for mode, at_s in modes)
    told = tuple(dict.fromkeys(f"{event.kind}: {event.text}" for event in after if event.text))
    return Seen(reaction, (ALERTS[Cause.DEADMAN].text, ALERTS[Cause.WINDOW_HUNG].text), told, tuple(problems))


def _events_of(folder: Path) -> list[str]:
    with SessionReader(folder) as reader:
        reader.wait(10.0)
        shown = [f"{event.kind}: {event.text}" if event.text else event.kind.value for event in reader.events]
    return list(dict.fromkeys(text for text in shown if not text.startswith("video")))


@fault(
    41,
    "quit while armed or recording",
    injected="the window is closed while it records: in ADVISORY, ARMED and AUTONOMOUS",
    wanted="disarmed, flushed, joined; exit code 0; the session is whole",
    quick=False,
)
def quit_while_busy(kit: Kit) -> Seen:
    problems, reaction = [], []
    events: list[str] = []
    for mode in (Mode.ADVISORY, Mode.ARMED, Mode.AUTONOMOUS):
        folder = kit.folder / mode.value
        folder.mkdir()
        command = [sys.executable, "-m", MODULE, "window", str(folder), mode.value]
        environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=_END_S, env=environment)
        said = json.loads(done.stdout.splitlines()[-1]) if done.stdout.strip() else {}
        problems += [] if said.get("mode") == mode.value else [f"{mode} was not reached"]
        problems += [] if done.returncode == 0 else [f"{mode}: exit code {done.returncode}"]
        sessions = sorted(folder.glob("session_*"))
        whole = len(sessions) == 1 and read_manifest(sessions[0]).closed
        problems += [] if whole else [f"{mode}: the session is not whole"]
        events += _events_of(sessions[0]) if sessions else []
        reaction.append(f"{mode}: exit code {done.returncode}, session {'whole' if whole else 'cut'}")
    return Seen("; ".join(reaction), (), tuple(dict.fromkeys(events)), tuple(problems))


@fault(
    42,
    "twin taken for the real rig",
    injected="the twin, a real camera and a recording are opened",
    wanted="a permanent banner SIM, LIVE or PLAYBACK; the session keeps it",
)
def labels(kit: Kit) -> Seen:
    from app.application import make_application
    from app.operator_window import OperatorWindow

    problems = []
    rigs = {
        RigKind.SIM: {},
        RigKind.LIVE: {"camera": "realsense", "robot": "none"},
        RigKind.PLAYBACK: {"camera": "video_file", "robot": "none", "source": "a.mkv"},
    }
    make_application()
    for kind, rig in rigs.items():
        config = Config.model_validate({"rig": rig, "record": {"ring_s": 0.0}})
        problems += [] if kind_of(config.rig) is kind else [f"{rig} counts as {kind_of(config.rig)}"]
        window = OperatorWindow(config, lambda _config: None, kind)  # type: ignore[arg-type, return-value]
        problems += [] if kind.value in window.windowTitle() else [f"{kind} is not in the window's title"]
        problems += [] if window.panels.banner.word == kind.value else [f"{kind} is on no banner"]
        window.close()
        window.deleteLater()
    with open_bench(Kit(kit.folder, False)) as bench:
        bench.record()
        bench.run(0.2)
        manifest, _ = bench.recorded()
    problems += [] if manifest.kind == RigKind.SIM.value else [f"the session says {manifest.kind}"]
    return Seen("SIM, LIVE and PLAYBACK on title, banner and in the manifest", (), (f"manifest: {manifest.kind}",), tuple(problems))
