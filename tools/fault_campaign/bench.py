"""The bench of the fault campaign: twin, perception, engine, pilot, gate, servos and recorder without a window, step by step.

In lock-step the bench has a simulated clock and ideal servos; the gate and the decisions of the bus process are the real ones.
Live, seven software servos stand behind a pseudo-terminal, the real driver runs in its own process, and time is the wall's.
Perception runs on the twin's masks unless a case asks for the network. ``judge`` compares modes, alerts and the recorded session
with what is listed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.config.models import Config
from core.control.alerts import ALERTS, Alert, AlertKey
from core.control.drive_view import DriveView
from core.control.engine import Engine, Perceive
from core.control.faults import Cause
from core.control.health import ModelReport
from core.control.modes import DRIVING_MODES, Act, Mode
from core.control.motion import AT_REST
from core.control.pilot import PERIOD_S, Pilot
from core.control.policies import make_policy
from core.evaluation.accuracy import TrueMasks
from core.perception.pipeline import Pipeline, open_pipeline
from core.perception.segmentation import Segmenter
from core.session.manifest import Event, EventKind, Manifest, about_rig, event_of_alert, read_manifest
from core.session.reader import SessionReader
from core.session.writer import RecordStatus, SessionWriter, faults_between
from core.types import Frame, Image, Point, Scene, Tick
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.actuation import JointsToTwin
from hardware.twin.process import drive_world
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.world import TwinWorld
from tools.fault_campaign.registry import CampaignError, Kit, Observation, fault
from tools.lockstep import LockStepServos

Probability = NDArray[np.float32]
Masks = tuple[Probability, Probability]
TARGET: Point = (560.0, 195.0)  # the target of the program, in source pixels
_START_MM, _START_NETWORK_MM = 45.0, 70.0  # insertion at the start, with the twin's masks and with the network
_FRAMES_PER_S, _FRAMES_PER_S_LIVE = 12.5, 22.0
_PATIENCE_S, _PATIENCE_LIVE_S = 8.0, 20.0  # for a state of the pilot, in the bench's time
_WALL_S, _WALL_PATIENCE_S = 0.001, 30.0  # poll and patience for what goes by the wall's clock
_SETTLED_TURNS = 10  # autonomy must last so long before a fault is injected
_WARM_S = 0.2  # the servos have reported, perception is warm
_FIT = ModelReport(True)


@dataclass(slots=True)
class Hooks:
    """What a fault may change between the world and the robot. A function is given a value and returns what goes on."""

    frame: Callable[[Frame], Frame | None] = lambda frame: frame
    masks: Callable[[Probability, Probability], Masks] = lambda vessel, robot: (vessel, robot)
    scene: Callable[[Scene], Scene] = lambda scene: scene
    silent: bool = False
    read_s: float = 0.0
    perceive_s: float = 0.0
    window_lives: bool = True
    recorder_keeps_up: bool = True
    """Lock-step waits for the recorder, which goes by the wall's clock, so that only a case that wants it sees dropped frames."""


class BenchCamera:
    """Pictures of the twin by the bench's clock; late, altered or missing as the hooks say."""

    name = "bench twin"

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
        if self.waiting:
            return self.waiting.pop(0)
        if bench.hooks.silent or bench.now_s < self._due_s:
            return None
        self._due_s = max(self._due_s + bench.period_s, bench.now_s)
        self._index += 1
        return bench.hooks.frame(Frame(self._index, bench.now_s, bench.render(), self.lost))


class _HookedSegmenter(Segmenter):
    def __init__(self, bench: FaultBench, inner: Segmenter) -> None:
        self._bench, self._inner = bench, inner

    @property
    def engine(self) -> str:
        return self._inner.engine

    def __call__(self, image: Image) -> Masks:
        return self._bench.hooks.masks(*self._inner(image))


@dataclass(frozen=True, slots=True)
class Mark:
    """Where the observation begins."""

    time_s: float = 0.0
    views: int = 0
    alerts: int = 0
    mode: Mode = Mode.ADVISORY
    active: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """``network``: perceive with the shipped network; ``perceive`` instead of the pipeline; ``before_open`` alters the servos."""

    network: bool = False
    frames_per_s: float | None = None
    model: ModelReport = _FIT
    perceive: Perceive | None = None
    before_open: Callable[[SoftServoBus], None] | None = None
    record: dict[str, Any] | None = None
    servos: dict[str, Any] | None = None


class FaultBench:
    """The program without its window. Use ``open_bench``; a bench belongs to one thread."""

    def __init__(self, folder: Path, *, live: bool, undo: ExitStack, options: BenchOptions) -> None:
        self.live, self._options = live, options
        self._now_s, self._skew_s = 1000.0, 0.0
        self.config = config = _config(folder, live=live, options=options)
        self.period_s = 1.0 / (options.frames_per_s or (_FRAMES_PER_S_LIVE if live else _FRAMES_PER_S))
        self.hooks = Hooks()
        self.world = TwinWorld(config.twin, perception=config.perception)
        self.world.insert(_START_NETWORK_MM if options.network else _START_MM)
        self._masks = TrueMasks()
        self._soft_bus: SoftServoBus | None = None
        self.robot = self._connect_live(undo) if live else self._connect_lock_step()
        self.pipeline = open_pipeline(config.perception) if options.network else Pipeline(self._masks, config.perception)
        stream = self.pipeline._stream
        self.pipeline._stream = replace(stream, segment=_HookedSegmenter(self, stream.segment))
        policy = make_policy(config.policy.name, config)
        self.pilot = Pilot(self.robot, policy, config, options.model, clock=lambda: self.now_s)
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
        self.start = Mark()
        self._pictures = 0
        self._next_s = self.now_s

    def _connect_lock_step(self) -> LockStepServos:
        robot = LockStepServos(self.config.servos, self.config.safety, lambda: self.now_s)
        joints = JointsToTwin(self.config.servos, robot.positions_mm())
        self.world.drive = lambda duration_s: joints.command(robot.positions_mm(), duration_s)
        return robot

    def _connect_live(self, undo: ExitStack) -> ServoRobot:
        config = self.config
        self._soft_bus = bus = SoftServoBus(config.servos, wire_time=True)
        bus.start()
        undo.callback(bus.stop)
        if self._options.before_open is not None:
            self._options.before_open(bus)
        drive_world(self.world, bus, config.servos)
        servos = config.servos.model_copy(update={"port": bus.port})
        robot = ServoRobot(servos, config.safety, name="bench twin with servos", truth=self.world.physics.status)
        undo.callback(robot.close)
        robot.connect()
        robot.zero()
        return robot

    # ---- state

    @property
    def bus(self) -> SoftServoBus:
        """The software servos of a live bench."""
        assert self._soft_bus is not None
        return self._soft_bus

    @property
    def now_s(self) -> float:
        return time.monotonic() + self._skew_s if self.live else self._now_s

    @property
    def view(self) -> DriveView:
        return self.pilot.view

    @property
    def mode(self) -> Mode:
        return self.view.mode

    @property
    def latched(self) -> Cause | None:
        return self.view.latched.cause if self.view.latched is not None else None

    @property
    def views_since_mark(self) -> list[DriveView]:
        return self.views[self.start.views :]

    @property
    def alerts_since_mark(self) -> list[Alert]:
        return self.alerts[self.start.alerts :]

    def path_since_mark(self) -> tuple[list[Mode], list[float]]:
        """The modes since the mark in turn, and their times after it in seconds."""
        path: list[Mode] = []
        times: list[float] = []
        for view in self.views_since_mark:
            if view.mode is not (path[-1] if path else self.start.mode):
                path.append(view.mode)
                times.append(view.time_s - self.start.time_s)
        return path, times

    # ---- frames

    def render(self) -> Image:
        """The picture of the world one period later; its masks go to perception."""
        world = self.world
        world.advance(self.period_s)
        shown = world.picture(world.physics.robot_points_mm(), world.physics.delivery_mm)
        self._masks.show(shown.vessel, shown.robot)
        image = shown.image
        self._pictures += 1
        image[0, 0] = self._pictures % 251  # the twin's picture has no noise here, and must not count as frozen
        return image

    def _perceive(self, frame: Frame, target: Point | None = None) -> Scene:
        if self.hooks.perceive_s > 0.0:
            self.pass_time(self.hooks.perceive_s)
        perceive: Perceive = self._options.perceive or self.pipeline
        return self.hooks.scene(perceive(frame, target))

    # ---- time

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
        return self._turn_pilot()

    def pass_time(self, seconds: float) -> None:
        """Time passes while perception or camera is stuck: the turns of pilot and window go on."""
        until_s = self.now_s + seconds
        while self.now_s < until_s - 1e-9:
            self._wait()
            self._turn_pilot()

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

    def until_mode(self, mode: Mode, patience_s: float | None = None) -> bool:
        return self.until(lambda view: view.mode is mode, patience_s)

    def until_active(self, cause: Cause, patience_s: float | None = None) -> bool:
        return self.until(lambda view: is_active(view, cause), patience_s)

    def wait_for(self, wanted: Callable[[], bool]) -> bool:
        """Wait for something that goes by the wall's clock: disk, encoder, another process. Lock-step stands still."""
        until_s = time.monotonic() + _WALL_PATIENCE_S
        while not wanted() and time.monotonic() < until_s:
            if self.live:
                self.turn()
            else:
                time.sleep(_WALL_S)
        return wanted()

    def jump(self, seconds: float) -> None:
        """The clock of pilot and frames leaps, as after a suspend."""
        self._skew_s += seconds
        self._now_s += seconds

    def _wait(self) -> None:
        if not self.live:
            self._now_s += PERIOD_S
            return
        self._next_s = max(self._next_s + PERIOD_S, self.now_s - PERIOD_S)
        time.sleep(max(0.0, self._next_s - self.now_s))

    def _turn_pilot(self) -> DriveView:
        """A turn of the pilot, and what the window does in it with operator input, alerts and recorder."""
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
        news = pilot.news()
        for changed in news.changes:
            self.writer.drive(changed)
        for alert in news.alerts:
            self.alerts.append(alert)
            self.writer.add_event(event_of_alert(alert, news.view.time_s))
        before, self._recorded = self._recorded, self.writer.status()
        for problem in faults_between(before, self._recorded):
            pilot.report_fault(problem)
        return view

    # ---- requests of the operator

    def switch_on(self) -> None:
        """Check the servos and switch them on; raises CampaignError."""
        self.pilot.switch_on()
        if not self.until(lambda view: view.servos_on):
            raise CampaignError(f"the servos could not be switched on: {_reasons(self.view)}")

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
                if self.until_mode(Mode.ARMED, 0.5):
                    return
        raise CampaignError(f"the bench could not be armed: {_reasons(self.view)}")

    def hand_over(self, target: Point = TARGET) -> FaultBench:
        """Let the program drive, steadily; raises CampaignError."""
        self.engine.set_target(target)
        for _ in range(8):
            if self.mode not in {Mode.ARMED, Mode.HOLD}:
                self.arm()
            self.held = True
            self.until(lambda view: not view.against_hand_over and view.deadman is True, 3.0)
            self.pilot.ask(Act.HAND_OVER)
            if self.until_mode(Mode.AUTONOMOUS, 0.5):
                steady = [self.turn().mode is Mode.AUTONOMOUS for _ in range(_SETTLED_TURNS)]
                if all(steady):
                    self.handed_over = True
                    return self
            self.held = False
            self.turn()
        raise CampaignError(f"the bench could not be handed over: {_reasons(self.view)}")

    # ---- record

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

    def mark(self) -> FaultBench:
        """Begin to record and to observe. A bench that was handed over is so at the mark, whatever the machine did meanwhile."""
        self.record()
        self.turn()
        if self.handed_over and self.mode is not Mode.AUTONOMOUS:
            self.hand_over()
        active = frozenset(fault.cause.value for fault in self.view.active)
        self.start = Mark(self.now_s, len(self.views), len(self.alerts), self.mode, active)
        return self


def is_active(view: DriveView, cause: Cause) -> bool:
    """Whether a fault of this cause is active."""
    return any(fault.cause is cause for fault in view.active)


@contextmanager
def open_bench(kit: Kit, *, live: bool | None = None, **options: Any) -> Iterator[FaultBench]:
    """A bench in the kit's folder, in lock-step or live as the kit says unless told otherwise."""
    with ExitStack() as undo:
        bench = FaultBench(kit.folder, live=kit.live if live is None else live, undo=undo, options=BenchOptions(**options))
        bench.run(_WARM_S)
        yield bench


def _config(folder: Path, *, live: bool, options: BenchOptions) -> Config:
    # Live, the servos' watchdog and the bus process are patient: a machine that pauses is not what is tested here.
    patient = {"watchdog_s": 2.5, "heartbeat_timeout_s": 3.0} if live else {}
    record = {"folder": str(folder), "ring_s": 0.0, "sync_s": 0.0, "warn_free_mb": 0.0, "warn_free_share": 0.0, "stop_free_mb": 0.0}
    return Config.model_validate(
        {
            "record": record | (options.record or {}),
            "servos": patient | (options.servos or {}),
            "perception": {"segmentation": {"threads": 1}},
        }
    )


def _reasons(view: DriveView) -> str:
    reasons = [str(reason) for reason in (*view.against_arming, *view.against_hand_over)]
    details = [f"{fault.cause} {fault.detail}".strip() for fault in view.active]
    return f"mode {view.mode}; {'; '.join(dict.fromkeys((*reasons, *details))) or 'no reason given'}"


# ---- judgement

_WORD = {
    Mode.HOLD: "HOLD",
    Mode.STOPPED: "STOP",
    Mode.ADVISORY: "DISARM",
    Mode.ARMED: "back to the operator",
    Mode.AUTONOMOUS: "resumes",
}
_BEFORE_S = 0.03  # the turn of the mark itself


@dataclass(frozen=True, slots=True)
class ExpectedReaction:
    """What must follow.

    Attributes
    ----------
    path : the modes in turn, without the one at the mark; None: whatever happened.
    causes : must all have been active, be alerts (but for those in `silent`) and be in the session.
    latched : must wait to be acknowledged at the end.
    within_s : bounds the first change of mode, by the pilot's clock.
    blank : no advice from the first cause on.
    alerts : further alerts that must come.
    alternatives : other paths that are as good.
    may_hold : so is a path with holds that clear themselves: a cycle without answers leaves the gate without positions.
    """

    path: tuple[Mode, ...] | None
    causes: tuple[Cause, ...] = ()
    latched: Cause | None = None
    within_s: float | None = None
    blank: bool = False
    alerts: tuple[AlertKey, ...] = ()
    silent: tuple[Cause, ...] = ()
    alternatives: tuple[tuple[Mode, ...], ...] = ()
    may_hold: bool = False


def judge(bench: FaultBench, wanted: ExpectedReaction, *more: str) -> Observation:
    """What was seen since the mark, against what was wanted; `more` are problems found elsewhere. Ends the session."""
    views = bench.views_since_mark
    path, times = bench.path_since_mark()
    problems = list(more)
    kept = path[:]
    while wanted.may_hold and kept[:2] == [Mode.HOLD, Mode.AUTONOMOUS]:
        del kept[:2]
    if wanted.path is not None and tuple(kept) not in (wanted.path, *wanted.alternatives):
        problems.append(f"modes went {', '.join(path) or 'nowhere'} instead of {', '.join(wanted.path) or 'nowhere'}")
    if wanted.within_s is not None and times and times[0] > wanted.within_s:
        problems.append(f"first reaction after {1000 * times[0]:.0f} ms (at most {1000 * wanted.within_s:.0f} ms)")
    active = {fault.cause for view in views for fault in view.active}
    problems += [f"never active: {cause}" for cause in wanted.causes if cause not in active]
    if wanted.latched is not None:
        latched = views[-1].latched.cause if views and views[-1].latched is not None else None
        if latched is not wanted.latched:
            problems.append(f"latched is {latched or 'nothing'} instead of {wanted.latched}")
    if wanted.blank:
        faulty = [view for view in views if any(fault.cause in wanted.causes for fault in view.active)]
        if any(view.advice is not None for view in faulty):
            problems.append("advice is shown although a fault should blank it")
        elif any(not view.blanked for view in faulty):
            problems.append("the advice is blank, but nothing says why")
    if views and views[-1].mode not in DRIVING_MODES and views[-1].program_command is not None:
        problems.append("the program goes on commanding")
    keys: list[AlertKey] = [*(cause for cause in wanted.causes if cause not in wanted.silent), *wanted.alerts]
    alerts = bench.alerts_since_mark
    raised = {alert.key for alert in alerts}
    problems += [f"no alert: {ALERTS[key].text}" for key in keys if key not in raised]
    shown, missing = _session_events(bench, keys, wanted.causes, path)
    reaction = ", ".join(f"{_WORD[mode]} at {1000 * time_s:.0f} ms" for mode, time_s in zip(path, times, strict=True)) or "goes on"
    texts = tuple(dict.fromkeys(alert.spec.text for alert in alerts))
    return Observation(reaction, texts, shown, (*problems, *missing))


def _session_events(
    bench: FaultBench, keys: Sequence[AlertKey], causes: Sequence[Cause], path: Sequence[Mode]
) -> tuple[tuple[str, ...], list[str]]:
    """The session's events since the mark in words, and what is missing among them."""
    _, events = bench.recorded()
    told = [
        (event.kind, str(event.data.get("key", event.text)) if event.kind is EventKind.ALERT else event.text)
        for event in events
        if event.time_s >= bench.start.time_s - _BEFORE_S
    ]
    # what was active before the mark stands at the beginning of the session
    earlier = {event.text for event in events if event.kind is EventKind.FAULT and event.text in bench.start.active}
    missing = [
        f"not in the session: fault {c}" for c in causes if (EventKind.FAULT, c.value) not in told and c.value not in earlier
    ]
    missing += [f"not in the session: mode {mode}" for mode in path if (EventKind.MODE, mode.value) not in told]
    missing += [f"not in the session: alert {key}" for key in keys if (EventKind.ALERT, str(key)) not in told]
    shown = [f"{kind}: {text}" if text else kind.value for kind, text in told if kind is not EventKind.VIDEO]
    return tuple(dict.fromkeys([*shown, *(f"fault: {text}" for text in sorted(earlier))])), missing


BenchInject = Callable[[FaultBench], Sequence[str] | None]


def bench_fault(
    number: int, expected: ExpectedReaction, *, seconds: float = 0.0, **options: Any
) -> Callable[[BenchInject], BenchInject]:
    """Register a function that injects a fault on a bench while the program drives.

    It returns the problems that it found; `seconds` later the reaction is judged. `options` go to ``open_bench``.
    """

    def enter(inject: BenchInject) -> BenchInject:
        @fault(number)
        def run(kit: Kit) -> Observation:
            with open_bench(kit, **options) as bench:
                bench.hand_over().mark()
                problems = inject(bench) or ()
                bench.run(seconds)
                return judge(bench, expected, *problems)

        return inject

    return enter
