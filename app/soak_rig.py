"""The rig of a soak: the whole program but its window, on a twin whose wire is watched and whose devices can be made to fail."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.rig_engine import EngineMaker, RigEngine
from core.config import Config, PerceptionConfig
from core.control.drive_view import LeftOver
from core.control.engine import Perceive
from core.control.health import ModelReport
from core.control.pilot import Pilot
from core.devices import DeviceError
from core.perception.pipeline import Pipeline
from core.session.events import event_of_alert
from core.session.manifest import about_rig
from core.session.record_status import RecordStatus, faults_between
from core.session.writer import SessionWriter
from core.study.accuracy import TrueMasks
from core.types import Frame, Mask, Point, Points, Scene
from hardware.rig import Rig, RigKind
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.camera import TwinCamera
from hardware.twin.renderer import Picture
from hardware.twin.servo_joints import drive_world
from hardware.twin.wire_watch import WatchedBus, WireWatch
from hardware.twin.world import TwinWorld

_log = logging.getLogger(__name__)

_START_MM = 60.0
_STEP_S = 0.1
_FRAMES_KEPT = 20


@dataclass(slots=True)
class Mischief:
    """What is wrong with camera and perception now; changed by the soak's faults, read by the threads that it hits."""

    silent: bool = False
    frozen: bool = False
    level: int | None = None
    shift_px: int = 0
    perceive_s: float = 0.0
    raises: bool = False


class SoakCamera(TwinCamera):
    """The twin's camera, and what mischief makes of its pictures."""

    def __init__(self, world: TwinWorld, mischief: Mischief) -> None:
        super().__init__(world)
        self._mischief = mischief
        self._kept: Frame | None = None

    def read(self, timeout_s: float) -> Frame | None:
        frame = super().read(timeout_s)
        mischief = self._mischief
        if frame is None or mischief.silent:
            return None
        if mischief.frozen and self._kept is not None:
            return replace(frame, image=self._kept.image)
        self._kept = frame
        if mischief.level is not None:
            return replace(frame, image=np.full_like(frame.image, mischief.level))
        if mischief.shift_px:
            return replace(frame, image=np.roll(frame.image, mischief.shift_px, axis=1))
        return frame


class TrueSight:
    """Perceives on the masks with which the twin drew each frame: what remains of the load is the geometry's."""

    def __init__(self, world: TwinWorld, config: PerceptionConfig) -> None:
        self._masks = TrueMasks()
        self._pipeline = Pipeline(self._masks, config)
        self._kept: dict[int, tuple[Mask, Mask]] = {}
        draw = world._renderer.render

        def render(points_mm: Points, sheath_mm: float = 0.0, *, noise_seed: int = 0) -> Picture:
            picture = draw(points_mm, sheath_mm, noise_seed=noise_seed)
            self._kept[noise_seed] = picture.vessel, picture.robot
            for old in sorted(self._kept)[:-_FRAMES_KEPT]:
                self._kept.pop(old, None)
            return picture

        world._renderer.render = render  # type: ignore[method-assign, assignment]

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        masks = self._kept.get(frame.index)
        if masks is not None:
            self._masks.show(*masks)
        return self._pipeline(frame, target)


class SoakRig:
    """An open rig with its engine's thread and its recorder. ``close`` ends all of it.

    Parameters
    ----------
    maker : loads the network once.
    watch : the witness on the wire; it outlives the rig.
    writer : the recorder, which outlives the rig, too.
    left_over : of the rig before.
    true_masks : see with the twin's own masks, not with the network.
    """

    def __init__(
        self,
        config: Config,
        maker: EngineMaker,
        watch: WireWatch,
        writer: SessionWriter,
        left_over: LeftOver | None,
        *,
        true_masks: bool = False,
    ) -> None:
        self.config, self._writer = config, writer
        self.mischief = Mischief()
        self._recorded = RecordStatus()
        self.failure = ""
        self._ended = threading.Event()
        with contextlib.ExitStack() as undo:
            world = TwinWorld(config.twin, perception=config.perception)
            world.insert(_START_MM)
            self.bus = WatchedBus(config.servos, watch)
            self.bus.start()
            undo.callback(self.bus.stop)
            drive_world(world, self.bus, config.servos)
            servos = config.servos.model_copy(update={"port": self.bus.port})
            self.robot = ServoRobot(servos, config.safety, truth=world.physics.status, on_close=self.bus.stop)
            undo.callback(self.robot.close)
            self.robot.connect()
            self.robot.zero()
            self.bus.zeroed()
            camera = SoakCamera(world, self.mischief)
            rig = Rig("soak", RigKind.SIM, camera, self.robot, world)
            perceive: Perceive
            if true_masks:
                perceive, model = TrueSight(world, config.perception), ModelReport(True)
            else:
                perceive, model = maker._perception(config.perception)
            camera.open()
            undo.callback(camera.close)
            self.engine = RigEngine(rig, self._disturbed(perceive), config, model, left_over)
            undo.pop_all()
        assert self.engine.pilot is not None
        self.pilot: Pilot = self.engine.pilot
        self.frames = 0
        self._thread = threading.Thread(target=self._run, name="engine", daemon=True)
        self._thread.start()

    def _disturbed(self, perceive: Perceive) -> Perceive:
        def disturbed(frame: Frame, target: Point | None = None) -> Scene:
            if self.mischief.raises:
                raise RuntimeError("injected: perception breaks")
            if self.mischief.perceive_s > 0.0:
                time.sleep(self.mischief.perceive_s)
            return perceive(frame, target)

        return disturbed

    @property
    def running(self) -> bool:
        """Whether the engine's thread turns; when it has ended by itself, ``failure`` says why."""
        return self._thread.is_alive()

    def _run(self) -> None:
        try:
            while not self._ended.is_set():
                tick = self.engine.step(_STEP_S)
                if tick is not None:
                    self.frames += 1
                    self._writer.put(tick, self.pilot.view, self.engine.bus_status())
        except DeviceError as error:
            self.failure = str(error)
        except Exception as error:  # noqa: BLE001 - top of the thread: a visible fault, as in the window's engine thread
            self.failure = f"{type(error).__name__}: {error}"

    def look(self, *, alive: bool) -> None:
        """What a window does every 50 ms, unless it hangs."""
        if not alive:
            return
        self.pilot.window_alive()
        news = self.pilot.news()
        for view in news.changes:
            self._writer.drive(view)
        for alert in news.alerts:
            self._writer.add_event(event_of_alert(alert, news.view.time_s))
        before, self._recorded = self._recorded, self._writer.status()
        for fault in faults_between(before, self._recorded):
            self.pilot.report(fault)

    def close(self) -> LeftOver | None:
        """End the rig as F5 or a crash does; what the next one takes over."""
        self._ended.set()
        self._thread.join()
        self.engine.close()
        return self.pilot.left_over


def soak_config(folder: Path) -> Config:
    """The default twin, with sessions in a folder that the soak owns."""
    return Config.model_validate(
        {
            "twin": {"live_frames_per_second": 15.0},
            "perception": {"segmentation": {"threads": 1}},
            "record": {"folder": str(folder), "ring_s": 10.0, "warn_free_mb": 0.0, "warn_free_share": 0.0, "stop_free_mb": 0.0},
        }
    )


def make_writer(config: Config, folder: Path) -> SessionWriter:
    return SessionWriter(config.record, about_rig(config, RigKind.SIM.value, "soak"), folder=folder)
