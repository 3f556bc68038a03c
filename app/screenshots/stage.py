"""The bench twin in lock-step behind a real window: what it shows follows from seeds and turns, not from how busy the machine is.

Perception, policy, pilot and gate are the real ones; the servos are ideal, and time is what the stage's frames have passed.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from core.config import Config, PerceptionConfig
from core.control.drive_view import DriveView
from core.control.engine import Engine
from core.control.hand import AT_REST, Jog
from core.control.health import ModelReport
from core.control.modes import Act, Mode
from core.control.pilot import PERIOD_S, Pilot
from core.control.policies import make_policy
from core.errors import UserError
from core.perception.pipeline import Pipeline
from core.session.events import Event, event_of_alert, event_of_target
from core.session.manifest import about_rig
from core.session.writer import SessionWriter
from core.types import Frame, Point, RobotStatus, Tick
from hardware.servos.bus_messages import BusStatus
from hardware.servos.lock_step import LockStepServos
from hardware.twin.servo_joints import JointsToTwin
from hardware.twin.world import TwinWorld

_FRAMES_PER_S = 25.0
_REQUEST_WAIT_S = 0.002
_IDLE_S = 0.01
_PATIENCE_TURNS = 400


@dataclass(frozen=True, slots=True)
class Scenery:
    """Where a stage begins: the phantom, how far the robot is in, and the seed of what is random."""

    phantom: str = "tree"
    start_mm: float = 78.0
    seed: int = 1


class Stage:
    """An engine for one window; nothing moves but by ``run``. ``act`` is called before each frame, from the stage's own thread.

    Parameters
    ----------
    config : limits, policy and the like.
    pipeline : perception; its memory is cleared.
    scenery : where it begins.
    """

    def __init__(self, config: Config, pipeline: Pipeline, scenery: Scenery) -> None:
        self.config = config
        self._now_s = 1000.0
        twin = config.twin.model_copy(update={"phantom": scenery.phantom})
        self.world = TwinWorld(twin, perception=config.perception, seed=scenery.seed)
        self.world.insert(scenery.start_mm)
        pipeline.reset()
        self.robot = robot = _StageServos(config, self.world, lambda: self._now_s)
        robot.cycle()  # there is a report before anybody asks for one
        joints = JointsToTwin(config.servos, robot.positions_mm())
        self.world.drive = lambda duration_s: joints.command(robot.positions_mm(), duration_s)
        policy = make_policy(config.policy.name, config)
        self.pilot = Pilot(robot, policy, config, ModelReport(True), clock=lambda: self._now_s)
        self._engine = Engine(_Camera(self), pipeline, policy, lambda: None, self.pilot, robot, turns_pilot=False)
        self.jog: Jog = AT_REST
        self.deadman = False
        self.blur_px = 0.0
        self.writer: SessionWriter | None = None
        self.problem: str | None = None
        self._lock = threading.Lock()
        self._ticks: list[Tick] = []

    # ---- what the window asks of an engine

    def step(self, timeout_s: float) -> Tick | None:
        """The frames that ``run`` has made, one at a time."""
        with self._lock:
            if self._ticks:
                return self._ticks.pop(0)
        time.sleep(min(timeout_s, _IDLE_S))
        return None

    def bus_status(self) -> BusStatus | None:
        """There is no bus."""
        return None

    def set_target(self, target_px: Point | None) -> None:
        self._engine.set_target(target_px)
        if self.writer is not None:
            self.writer.add_event(event_of_target(target_px, self._now_s))

    def set_perception(self, config: PerceptionConfig) -> bool:
        return False

    def close(self) -> None:
        self._engine.close()

    # ---- what the script does

    def run(self, frames: int, act: Callable[[], None] | None = None) -> Tick:
        """So many frames; returns the last one, which alone is shown."""
        tick: Tick | None = None
        for _ in range(frames):
            if act is not None:
                act()
            tick = self._turn() or tick
        assert tick is not None
        return tick

    def show(self, tick: Tick) -> None:
        """Hand a frame to the window."""
        with self._lock:
            self._ticks = [tick]

    def until(self, wanted: Callable[[DriveView], bool], what: str) -> Tick:
        """Turn until the pilot's view is as wanted. Raises UserError when it never is."""
        for _ in range(_PATIENCE_TURNS):
            tick = self.run(1)
            if wanted(self.pilot.view):
                return tick
        view = self.pilot.view
        why = (*view.active, view.latched, *view.against_arming, *view.against_hand_over, view.busy, view.blanked)
        raise UserError(f"the twin did not get there: {what}; {'; '.join(str(each) for each in why if each)}")

    def switch_on(self) -> None:
        """The servos on, as the twin does by itself."""
        self.pilot.switch_on()
        self.until(lambda view: view.servos_on, "servos on")

    def hand_over(self, target: Point) -> None:
        """The program drives to a destination."""
        self.set_target(target)
        self.until(lambda view: not view.against_arming, "well enough to arm")
        self.pilot.ask(Act.ARM)
        self.until(lambda view: view.mode is Mode.ARMED, "armed")
        self.deadman = True
        self.until(lambda view: not view.against_hand_over and view.deadman is True, "ready to hand over")
        self.pilot.ask(Act.HAND_OVER)
        self.until(lambda view: view.mode is Mode.AUTONOMOUS, "handed over")

    def record(self, folder: Path) -> None:
        """A session from the next frame on, until ``end_recording``."""
        settings = self.config.record.model_copy(update={"ring_s": 0.0, "max_queue": 2000, "sync_s": 0.0})
        folder.mkdir(parents=True, exist_ok=True)
        self.writer = SessionWriter(settings, about_rig(self.config, "SIM", "twin"), folder=folder, clock=lambda: self._now_s)
        self.writer.start()
        while not self.writer.status().recording:
            self.run(1)
            time.sleep(_REQUEST_WAIT_S)

    @property
    def now_s(self) -> float:
        """The stage's clock."""
        return self._now_s

    def note(self, event: Event) -> None:
        """Into the session that is being recorded."""
        assert self.writer is not None
        self.writer.add_event(event)

    def end_recording(self) -> Path:
        """The session's folder."""
        assert self.writer is not None
        self.writer.stop("all recorded")
        is_whole = self.writer.close()
        saved = self.writer.status().saved
        self.writer = None
        if saved is None or not is_whole:
            raise UserError("the session for the pictures could not be written: free some space")
        return saved

    # ---- a turn

    def _turn(self) -> Tick | None:
        """A frame's time: the pilot's turns of it, then the picture."""
        tick = self._engine.step(0.0)
        for _ in range(round(1.0 / (_FRAMES_PER_S * PERIOD_S))):
            self._now_s += PERIOD_S
            self._turn_pilot()
        if tick is not None:
            tick = replace(tick, frames_per_second=_FRAMES_PER_S)
            if self.writer is not None:
                self.writer.put(tick, self.pilot.view, None)
        return tick

    def _turn_pilot(self) -> None:
        pilot = self.pilot
        pilot.window_alive()
        pilot.deadman("stage", self.deadman)
        if not self.jog.is_rest:
            pilot.jog("stage", self.jog)
        view = pilot.tick()
        self.robot.cycle()
        if self.writer is not None:
            news = pilot.news()
            for changed in news.changes:
                self.writer.drive(changed)
            for alert in news.alerts:
                self.writer.add_event(event_of_alert(alert, view.time_s))
        if view.busy:
            time.sleep(_REQUEST_WAIT_S)  # requests are done in a thread, at the wall's pace

    def picture(self) -> Frame:
        """The world after another frame's time."""
        self.world.advance(1.0 / _FRAMES_PER_S)
        frame = self.world.frame(self._now_s)
        if self.blur_px <= 0.0:
            return frame
        return replace(frame, image=np.asarray(cv2.GaussianBlur(frame.image, (0, 0), self.blur_px), np.uint8))


class _StageServos(LockStepServos):
    """They tell what the twin's sensors would: how far in it is, and how hard it leans on the wall."""

    def __init__(self, config: Config, world: TwinWorld, clock: Callable[[], float]) -> None:
        super().__init__(config.servos, config.safety, clock)
        self._world = world

    def status(self) -> RobotStatus:
        truth = self._world.physics.status()
        return replace(super().status(), insertion_mm=truth.insertion_mm, wall_contact_n=truth.wall_contact_n)


class _Camera:
    """One picture for each turn of the stage."""

    name = "bench twin"
    is_live = False

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def open(self) -> None: ...

    def close(self) -> None: ...

    def read(self, timeout_s: float) -> Frame | None:
        return self._stage.picture()
