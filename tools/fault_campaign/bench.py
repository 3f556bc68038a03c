"""The whole program but its window, turned step by step: twin, perception, engine, pilot, gate, servos, recorder; and switches.

It runs in one of two ways. In lock-step nothing looks at the wall's clock: the bench turns a clock of its own, the servos are
ideal, and the gate and all that the bus process decides are the real ones, however busy the machine is. Live, the servos are seven
software ones behind a pseudo-terminal, the real driver in its own process talks to them, and time is the wall's. Perception runs on
the twin's own masks unless a case asks for the network: what is tested is what follows from it.

The campaign's table: for the terminal, as JSON, and as the page ``docs/faults.md``.

``faults``: brings every fault of the list about, and prints what followed.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.commands.progress import Interrupt, check_can_write, progress_bar
from core.config.models import Config
from core.control.alerts import Alert
from core.control.drive_view import DriveView
from core.control.engine import Engine, Perceive
from core.control.health import ModelReport
from core.control.modes import Act, Mode
from core.control.motion import AT_REST
from core.control.pilot import PERIOD_S, LeftOver, Pilot
from core.control.policies import make_policy
from core.devices import CameraLost
from core.evaluation.accuracy import TrueMasks
from core.files import write_atomic
from core.perception.pipeline import Pipeline, open_pipeline
from core.perception.segmentation import Segmenter
from core.session.manifest import Event, Manifest, about_rig, event_of_alert, read_manifest
from core.session.reader import SessionReader
from core.session.writer import RecordStatus, SessionWriter, faults_between
from core.types import Frame, Image, Point, Scene, Tick
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.process import JointsToTwin, drive_world
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.world import TwinWorld
from tools.fault_campaign.registry import COUNT, CampaignError, FaultCase, Kit, Result, all_cases, run_case, tidy
from tools.lockstep import LockStepServos

Probability = NDArray[np.float32]
_START_MM, _START_NETWORK_MM, _TARGET = 45.0, 70.0, (560.0, 195.0)
_FRAMES_PER_S, _FRAMES_PER_S_LIVE = 12.5, 22.0
_PATIENCE_S, _PATIENCE_LIVE_S = 8.0, 20.0
_WALL_S, _WALL_PATIENCE_S = 0.001, 30.0
_SETTLED_TURNS = 10
_WARM_S = 0.2
_FIT = ModelReport(True)


@dataclass(slots=True)
class Hooks:
    """What a fault may change on the way from the world to the robot. Each is given what comes by, and returns what goes on."""

    frame: Callable[[Frame], Frame | None] = lambda frame: frame
    masks: Callable[[Probability, Probability], tuple[Probability, Probability]] = lambda vessel, robot: (vessel, robot)
    scene: Callable[[Scene], Scene] = lambda scene: scene
    silent: bool = False
    camera_problem: str = ""
    read_s: float = 0.0
    perceive_s: float = 0.0
    window_lives: bool = True
    recorder_keeps_up: bool = True
    """Lock-step waits for the recorder, which goes by the wall's clock, so that only a case that wants it sees dropped frames."""


class BenchCamera:
    """The twin's pictures as the bench's clock goes on; late, altered or missing as the hooks say."""

    name = "bench twin"
    is_live = False

    def __init__(self, bench: FaultBench) -> None:
        self._bench = bench
        self._due_s = 0.0
        self._index = -1
        self.waiting: list[Frame] = []
        """Frames that a hook has kept back, given before any new one."""
        self.lost = 0

    def open(self) -> None: ...

    def close(self) -> None: ...

    def read(self, timeout_s: float) -> Frame | None:
        bench = self._bench
        if bench.hooks.read_s > 0.0:
            bench.pass_time(bench.hooks.read_s)
        if bench.hooks.camera_problem:
            raise CameraLost(bench.hooks.camera_problem)
        if self.waiting:
            return self.waiting.pop(0)
        if bench.hooks.silent or bench.now_s < self._due_s:
            return None
        self._due_s = max(self._due_s + bench.period_s, bench.now_s)
        self._index += 1
        frame = Frame(self._index, bench.now_s, bench.picture(), self.lost)
        return bench.hooks.frame(frame)


class FaultBench:
    """See the module. Use ``open_bench``; a bench belongs to one thread."""

    def __init__(self, folder: Path, *, live: bool, undo: ExitStack, options: BenchOptions) -> None:
        self.live, self._options = live, options
        self._now_s, self._skew_s = 1000.0, 0.0
        self.config = config = _config(folder, live=live, options=options)
        self.period_s = 1.0 / (options.frames_per_s or (_FRAMES_PER_S_LIVE if live else _FRAMES_PER_S))
        self.hooks = Hooks()
        self.world = TwinWorld(config.twin, perception=config.perception)
        self.world.insert(_START_NETWORK_MM if options.network else _START_MM)
        self._masks = TrueMasks()
        self.bus: SoftServoBus | None = None
        self.robot = self._make_robot(undo)
        self.pipeline = open_pipeline(config.perception) if options.network else Pipeline(self._masks, config.perception)
        self._segment = self.pipeline._stream.segment
        self.pipeline._stream = replace(self.pipeline._stream, segment=_Hooked(self))
        policy = make_policy(config.policy.name, config)
        self.pilot = Pilot(self.robot, policy, config, options.model, clock=lambda: self.now_s, left_over=options.left_over)
        self.camera = BenchCamera(self)
        self.engine = Engine(self.camera, self._perceive, policy, lambda: None, self.pilot, self.robot, turns_pilot=False)
        undo.callback(self.engine.close)
        self.writer = SessionWriter(
            config.record, about_rig(config, "SIM", config.rig.name), folder=folder, clock=lambda: self.now_s
        )
        undo.callback(self.writer.close)
        self._recorded = RecordStatus()
        self.held = self.handed_over = False
        self.deadman_speaks = True
        self.jog = AT_REST
        self.views: list[DriveView] = []
        self.alerts: list[Alert] = []
        self.ticks: list[Tick] = []
        self._pictures = 0
        self._next_s = self.now_s

    # ---- how it is made

    def _make_robot(self, undo: ExitStack) -> LockStepServos | ServoRobot:
        config = self.config
        if not self.live:
            robot = LockStepServos(config.servos, config.safety, lambda: self.now_s)
            joints = JointsToTwin(config.servos, robot.positions_mm())
            self.world.drive = lambda duration_s: joints.command(robot.positions_mm(), duration_s)
            return robot
        self.bus = bus = SoftServoBus(config.servos, wire_time=True)
        bus.start()
        undo.callback(bus.stop)
        if self._options.before_open is not None:
            self._options.before_open(bus)
        drive_world(self.world, bus, config.servos)
        servos = config.servos.model_copy(update={"port": bus.port})
        live = ServoRobot(servos, config.safety, name="bench twin with servos", truth=self.world.physics.status)
        undo.callback(live.close)
        live.connect()
        live.zero()
        return live

    @property
    def now_s(self) -> float:
        return time.monotonic() + self._skew_s if self.live else self._now_s

    def jump(self, seconds: float) -> None:
        """The clock of pilot and frames leaps, as after a suspend."""
        self._skew_s += seconds
        self._now_s += seconds

    @property
    def view(self) -> DriveView:
        return self.pilot.view

    @property
    def mode(self) -> Mode:
        return self.view.mode

    # ---- what comes by

    def picture(self) -> Image:
        """The world as it is now, and its masks for perception."""
        world = self.world
        world.advance(self.period_s)
        shown = world.picture(world.physics.robot_points_mm(), world.physics.delivery_mm)
        self._masks.show(shown.vessel, shown.robot)
        image = shown.image
        self._pictures += 1
        image[0, 0] = self._pictures % 251  # the clear bench's camera has no noise, and must not pass for a frozen one
        return image

    def segment(self, image: Image) -> tuple[Probability, Probability]:
        return self.hooks.masks(*self._segment(image))

    def _perceive(self, frame: Frame, target: Point | None = None) -> Scene:
        if self.hooks.perceive_s > 0.0:
            self.pass_time(self.hooks.perceive_s)
        perceive: Perceive = self._options.perceive or self.pipeline
        return self.hooks.scene(perceive(frame, target))

    # ---- turning it

    def turn(self) -> DriveView:
        """Twenty milliseconds: a frame if one is due, then the pilot."""
        self._wait()
        tick = self.engine.step(0.0)
        if tick is not None:
            corner = replace(tick.frame, image=tick.frame.image[:1, :1].copy())
            self.ticks.append(replace(tick, frame=corner, scene=replace(tick.scene, masks=None, skeletons=None)))
            status = self.robot.bus_status() if isinstance(self.robot, ServoRobot) else None
            self.writer.put(tick, self.view, status)
            if not self.live and self.hooks.recorder_keeps_up:
                self.wait_for(lambda: self.writer.pictures_waiting == 0)
        return self._beat()

    def pass_time(self, seconds: float) -> None:
        """Time goes by while perception or camera is stuck: the pilot's turns and the window's go on."""
        until_s = self.now_s + seconds
        while self.now_s < until_s - 1e-9:
            self._wait()
            self._beat()

    def run(self, seconds: float) -> None:
        until_s = self.now_s + seconds
        while self.now_s < until_s - 1e-9:
            self.turn()

    def until(self, wanted: Callable[[DriveView], bool], patience_s: float | None = None) -> bool:
        """Turn until a view is as wanted; False when it was not in time."""
        until_s = self.now_s + (patience_s or (_PATIENCE_LIVE_S if self.live else _PATIENCE_S))
        while self.now_s < until_s:
            if wanted(self.turn()):
                return True
        return False

    def wait_for(self, wanted: Callable[[], bool]) -> bool:
        """Until something that goes by the wall's clock has happened: disk, encoder, another process. Lock-step stands still."""
        until_s = time.monotonic() + _WALL_PATIENCE_S
        while not wanted() and time.monotonic() < until_s:
            if self.live:
                self.turn()
            else:
                time.sleep(_WALL_S)
        return wanted()

    def _wait(self) -> None:
        if not self.live:
            self._now_s += PERIOD_S
            return
        self._next_s = max(self._next_s + PERIOD_S, self.now_s - PERIOD_S)
        time.sleep(max(0.0, self._next_s - self.now_s))

    def _beat(self) -> DriveView:
        pilot = self.pilot
        if self.hooks.window_lives:
            pilot.window_alive()
            if self.deadman_speaks:
                pilot.deadman("bench", self.held)
            if not self.jog.is_rest:
                pilot.jog("bench", self.jog)
        view = pilot.tick()
        if isinstance(self.robot, LockStepServos):
            self.robot.cycle()
            if view.busy:
                time.sleep(_WALL_S)  # requests are done in a thread, at the wall's pace
        self.views.append(view)
        self._tell()
        return view

    def _tell(self) -> None:
        """What the window does with the pilot's news and the recorder's."""
        news = self.pilot.news()
        for changed in news.changes:
            self.writer.drive(changed)
        for alert in news.alerts:
            self.alerts.append(alert)
            self.writer.add_event(event_of_alert(alert, news.view.time_s))
        before, self._recorded = self._recorded, self.writer.status()
        for fault in faults_between(before, self._recorded):
            self.pilot.report_fault(fault)

    # ---- what an operator does

    def switch_on(self) -> None:
        """Check the servos and switch them on; raises CampaignError."""
        self.pilot.switch_on()
        if not self.until(lambda view: view.servos_on):
            raise CampaignError(f"the servos could not be switched on: {_why(self.view)}")

    def arm(self) -> None:
        """From whatever state to ARMED; raises CampaignError."""
        self.held = False
        for _ in range(4):
            if self.view.latched is not None:
                self.pilot.ask(Act.ACKNOWLEDGE)
                self.until(lambda view: view.latched is None and not view.busy, 1.0)
            if not self.view.servos_on:
                self.switch_on()
            if self.until(lambda view: not view.against_arming):
                self.pilot.ask(Act.ARM)
                if self.until(lambda view: view.mode is Mode.ARMED, 0.5):
                    return
        raise CampaignError(f"the bench could not be armed: {_why(self.view)}")

    def hand_over(self, target: Point = _TARGET) -> FaultBench:
        """The program drives, and has done so for a moment; raises CampaignError."""
        self.engine.set_target(target)
        for _ in range(8):
            if self.mode not in {Mode.ARMED, Mode.HOLD}:
                self.arm()
            self.held = True
            self.until(lambda view: not view.against_hand_over and view.deadman is True, 3.0)
            self.pilot.ask(Act.HAND_OVER)
            if self.until(lambda view: view.mode is Mode.AUTONOMOUS, 0.5):
                steady = [self.turn().mode is Mode.AUTONOMOUS for _ in range(_SETTLED_TURNS)]
                if all(steady):
                    self.handed_over = True
                    return self
            self.held = False
            self.turn()
        raise CampaignError(f"the bench could not be handed over: {_why(self.view)}")

    # ---- the record

    def record(self) -> None:
        """Begin a session; the next frame is its first."""
        self.writer.start()
        while not self.writer.status().recording:
            self.turn()
            time.sleep(_WALL_S)

    def recorded(self) -> tuple[Manifest, tuple[Event, ...]]:
        """End the session; its manifest and events."""
        self.writer.stop()
        until_s = time.monotonic() + _PATIENCE_LIVE_S
        while (status := self.writer.status()).recording and time.monotonic() < until_s:
            time.sleep(_WALL_S)
        if status.folder is None:
            raise CampaignError("nothing was recorded")
        with SessionReader(status.folder) as reader:
            reader.wait(_PATIENCE_LIVE_S)
            return read_manifest(status.folder), reader.events


class _Hooked(Segmenter):
    """The bench's segmenter as the pipeline wants it."""

    def __init__(self, bench: FaultBench) -> None:
        self._bench = bench

    @property
    def engine(self) -> str:
        return self._bench._segment.engine

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        return self._bench.segment(image)


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """``network``: perceive with the shipped network; ``perceive`` instead of the pipeline; ``before_open`` alters the servos."""

    network: bool = False
    frames_per_s: float | None = None
    model: ModelReport = _FIT
    perceive: Perceive | None = None
    left_over: LeftOver | None = None
    before_open: Callable[[SoftServoBus], None] | None = None
    record: dict[str, Any] | None = None
    servos: dict[str, Any] | None = None


@contextmanager
def open_bench(kit: Kit, *, live: bool | None = None, **options: Any) -> Iterator[FaultBench]:
    """A bench in the kit's folder, in lock-step or live as the kit says unless told otherwise."""
    with ExitStack() as undo:
        bench = FaultBench(kit.folder, live=kit.live if live is None else live, undo=undo, options=BenchOptions(**options))
        bench.run(_WARM_S)  # the servos have reported, perception is warm
        yield bench


def _config(folder: Path, *, live: bool, options: BenchOptions) -> Config:
    # Live, the servos' watchdog and the bus process are patient: a machine that pauses for others is not what is tested here.
    patient = {"watchdog_s": 2.5, "heartbeat_timeout_s": 3.0} if live else {}
    record = {"folder": str(folder), "ring_s": 0.0, "sync_s": 0.0, "warn_free_mb": 0.0, "warn_free_share": 0.0, "stop_free_mb": 0.0}
    return Config.model_validate(
        {
            "record": record | (options.record or {}),
            "servos": patient | (options.servos or {}),
            "perception": {"segmentation": {"threads": 1}},
        }
    )


def _why(view: DriveView) -> str:
    reasons = [str(reason) for reason in (*view.against_arming, *view.against_hand_over)]
    details = [f"{fault.cause} {fault.detail}".strip() for fault in view.active]
    return f"mode {view.mode}; {'; '.join(dict.fromkeys((*reasons, *details))) or 'no reason given'}"


_MOST_EVENTS = 8
_HEAD = """# Faults

Every fault of the program's list, brought about and watched: `python main.py faults` does it again (`--only N` one of them,
`--quick` those that need no line, process or window). This page is written by `python main.py faults --out docs/faults.md`.

Reactions: **HOLD** stops an autonomous motion and may clear itself within half a second; **DISARM** holds, leaves autonomy and
waits to be acknowledged; **STOP** does so in every mode and blocks the bus. Faults of camera and perception blank the advice from
the first cause on, which is checked, too. Times are the pilot's own, from the injection on; ages count from the capture of the last
frame or from the last word, which came up to a frame's period before it. A case is OK only if the way through the modes, the alerts
and the record in the session are all as listed.
"""
_WAYS = {
    True: (
        "Measured live: seven software servos behind a pseudo-terminal, the real driver in its own process, the wall's clock. The "
        "twin's own masks stand in for the network, but where a case says that it looks through the network. A machine that pauses "
        "for others spoils a try; there are up to three, and the last column says how many it took."
    ),
    False: "Measured in lock-step where a case allows it: a clock of its own, ideal servos behind the real gate.",
}


def to_json(result: Result) -> dict[str, Any]:
    """One fault as plain values."""
    case, seen = result.case, result.seen
    return {
        "fault": case.number,
        "name": case.name,
        "injected": case.injected,
        "wanted": case.wanted,
        "seen": seen.reaction,
        "alerts": list(seen.alerts),
        "events": list(seen.events),
        "ok": seen.ok,
        "problems": list(seen.problems),
        "tries": result.tries,
        "seconds": round(result.seconds, 1),
    }


def line_of(result: Result) -> str:
    """One fault on one line."""
    case, seen = result.case, result.seen
    word = "OK    " if seen.ok else "NOT OK"
    tries = f" (try {result.tries})" if result.tries > 1 else ""
    problems = f"  <- {'; '.join(seen.problems)}" if seen.problems else ""
    return f"{case.number:2d} {word} {case.name}: {seen.reaction}{tries}{problems}"


def summary_of(results: Sequence[Result]) -> str:
    good = sum(result.seen.ok for result in results)
    return f"{good} of {len(results)} as listed" + ("" if len(results) == COUNT else f" ({COUNT} in the list)")


def page_of(results: Sequence[Result], *, live: bool) -> str:
    """The page in Markdown."""
    lines = [_HEAD, f"{_WAYS[live]}\n"]
    lines.append(f"**{summary_of(results)}**, {datetime.now(UTC):%Y-%m-%d}.\n")
    if len(results) < COUNT:
        lines.append("The campaign was interrupted: the faults that are missing here were not brought about.\n")
    lines.append("| # | fault | injected | wanted | seen | alerts | in the session | |")
    lines.append("|---|---|---|---|---|---|---|---|")
    for result in results:
        case, seen = result.case, result.seen
        verdict = "OK" if seen.ok else f"**NOT OK**: {'; '.join(seen.problems)}"
        verdict += f", try {result.tries}" if result.tries > 1 else ""
        cells = (case.name, case.injected, case.wanted, seen.reaction, _several(seen.alerts), _several(seen.events), verdict)
        lines.append(f"| {case.number} | {' | '.join(map(_cell, cells))} |")
    return "\n".join(lines) + "\n"


def _several(texts: Iterable[str]) -> str:
    texts = list(texts)
    more = f"; and {len(texts) - _MOST_EVENTS} more" if len(texts) > _MOST_EVENTS else ""
    return "; ".join(texts[:_MOST_EVENTS]) + more or "none"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def run_faults(only: list[int], out: Path | None, *, quick: bool, as_json: bool) -> int:
    """Run the campaign, or the faults that are named; returns 0 when all went as listed, 1 when not.

    Raises UserError, and KeyboardInterrupt once the results so far are told.
    """
    cases = _chosen(only, quick=quick)
    if out is not None and len(cases) < COUNT:
        raise CampaignError("--out writes the whole list: leave --only and --quick out")
    if out is not None:
        check_can_write(out, "--out")
    os.environ["QT_QPA_PLATFORM"] = "offscreen"  # windows are opened and closed; nobody shall see them
    logging.disable(logging.CRITICAL)  # what is logged of injected faults is what is looked for anyway
    try:
        results = list(_with_progress(cases, live=not quick, as_json=as_json))
    finally:
        logging.disable(logging.NOTSET)
    try:
        if not as_json:
            sys.stdout.write(f"{summary_of(results)}\n")
            sys.stdout.flush()
    finally:  # neither costs the other
        if out is not None and results:
            write_atomic(out, page_of(results, live=not quick).encode())
    if len(results) < len(cases):
        raise KeyboardInterrupt
    return 0 if all(result.seen.ok for result in results) else 1


def _chosen(only: list[int], *, quick: bool) -> list[FaultCase]:
    cases = list(all_cases())
    if unknown := [number for number in only if not 1 <= number <= COUNT]:
        raise CampaignError(f"there is no fault {unknown[0]}: they are numbered 1 to {COUNT}")
    chosen = [case for case in cases if (not only or case.number in only) and (case.quick or not quick)]
    if not chosen:
        numbers = ", ".join(str(number) for number in only)
        raise CampaignError(f"fault {numbers} needs a line, a process or a window: leave --quick out")
    return chosen


def _with_progress(cases: list[FaultCase], *, live: bool, as_json: bool) -> Iterator[Result]:
    with Interrupt() as interrupt, progress_bar() as bar:
        task = bar.add_task("faults", total=len(cases))
        for case in cases:
            bar.update(task, description=f"{case.number} {case.name}")
            result = run_case(case, live=live)
            interrupted = interrupt.asked
            if interrupted and not result.seen.ok:
                return  # Ctrl-C reaches the processes of the case, too: what went wrong may be its doing
            result = replace(result, seen=tidy(result.seen, Path.cwd()))
            sys.stdout.write((json.dumps(to_json(result)) if as_json else line_of(result)) + "\n")
            sys.stdout.flush()
            bar.advance(task)
            yield result
            if interrupted:
                return
