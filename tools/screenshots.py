"""``screenshots``: every picture of the documents, taken from the running program. No screen is needed.

Settings, checks before driving, training, rig wizard and servo table, each by itself.

The operator window in the situations that the documents speak of.

Player, annotator and study.

What every picture of the documents needs: one application, one network, a window that is waited for, and a file.

The bench twin in lock-step behind a real window: what it shows follows from seeds and turns, not from how busy the machine is.

Perception, policy, pilot and gate are the real ones; the servos are ideal, and time is what the stage's frames have passed.
"""

from __future__ import annotations

import contextlib
import io
import os
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, TypeVar

import cv2
import numpy as np
import PIL.Image
import typer
from PySide6.QtCore import QEvent, QRectF, Qt
from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QApplication, QWidget

from app.annotator.model import AnnotationModel, QueueEntry
from app.annotator.window import AnnotatorWindow
from app.commands.evaluate import evaluate
from app.commands.options import ConfigOption
from app.commands.synth import make_set
from app.operator.preflight import PreflightModel
from app.operator.preflight_list import PreflightList
from app.operator.services import WindowServices
from app.operator.window import OperatorWindow
from app.player.window import PlayerWindow
from app.rig_wizard.model import RigWizardModel
from app.rig_wizard.wizard import RigWizard
from app.settings.dialog import SettingsDialog
from app.settings.draft import SettingsDraft
from app.training.dialog import TrainingDialog
from app.training.model import TrainingRequest, collect_from_file
from app.ui import theme
from app.widgets.basics import Card
from app.widgets.servo_table import ServoTable
from core.annotation.masks import polygons_of
from core.annotation.model import Annotation, ImageView, MaskTarget, measure_lines
from core.annotation.store import DEFAULT_NAME, AnnotationStore, ItemKey, find_images
from core.config.files import Profiles
from core.config.models import Config, PerceptionConfig, load_config
from core.config.safety import ServosConfig
from core.control.drive_view import DriveView
from core.control.engine import Engine
from core.control.health import ModelReport
from core.control.modes import Act, Mode
from core.control.motion import AT_REST, Jog
from core.control.pilot import PERIOD_S, Pilot
from core.control.policies import make_policy
from core.devices import UserError
from core.learning.dataset import write_png
from core.perception.pipeline import Pipeline
from core.session.manifest import Event, EventKind, about_rig, event_of_alert, event_of_target
from core.session.reader import SessionReader
from core.session.writer import SessionWriter
from core.types import Frame, Point, Reason, Refusal, RobotStatus, Scene, Tick
from hardware.calibration.bench import CalibrationBench
from hardware.rig import RigKind
from hardware.servos.bus_ipc import BusPhase, BusStatus, CycleTimes
from hardware.servos.dynamixel_port import LineCounts
from hardware.servos.registers import HardwareError, ServoState
from hardware.twin.phantom import PHANTOM_TITLES
from hardware.twin.process import JointsToTwin
from hardware.twin.world import TwinWorld
from tools.lockstep import LockStepServos
from tools.run import run_tool

NAMES = {
    "operator_window": "advisory",
    "operator_driving": "driving",
    "operator_arrived": "arrived",
    "operator_stopped": "stopped",
    "operator_no_answer": "no_answer",
    "operator_keys": "keys",
    "operator_tour": "tour",
    "operator_light": "small_and_light",
    "player": "player",
    "annotator": "annotator",
    "study_figures": "study_figures",
    "settings": "settings",
    "preflight": "preflight",
    "training": "training",
    "rig_wizard": "rig_wizard",
    "servo_table": "servo_table",
}
"""Name of the file, without its ending, and what makes it."""


def run_screenshots(out: Path, only: Sequence[str], config_path: Path | None) -> None:
    """Write the pictures to a folder. Raises UserError for unknown names, and when the folder cannot be written."""
    unknown = [name for name in only if name not in NAMES]
    if unknown:
        raise UserError(f"no picture is called {unknown[0]!r}; there are: {', '.join(NAMES)}")
    # The offscreen platform draws with the same fonts and at the same sizes on every machine; a screen of one's own does not.
    os.environ["QT_QPA_PLATFORM"] = "offscreen"
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: cannot be made ({error.strerror})") from None
    folder = Path(tempfile.mkdtemp(prefix="lumenpilot_pictures_"))
    try:
        studio = _open_studio(out, folder, config_path)
        for name in only or NAMES:
            sys.stderr.write(f"{out / name}.png\n")
            _picture_of(name)(studio)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _open_studio(out: Path, folder: Path, config_path: Path | None) -> Studio:
    from app.ui.window_base import make_application
    from core.perception.pipeline import open_pipeline

    places = {"record": {"folder": str(folder / "sessions")}, "window": {"pictures_folder": str(folder / "pictures")}}
    config = load_config(config_path, overrides={**places, "perception": {"segmentation": {"threads": 1}}})
    return Studio(make_application(), config, open_pipeline(config.perception), folder, out)


def _picture_of(name: str) -> Callable[[Studio], None]:
    make: Callable[[Studio], None] = globals()[NAMES[name]]
    return make


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


T = TypeVar("T")
SIZE = (1600, 900)
SMALL = (1280, 720)
_PATIENCE_S = 60.0
_LOOK_S = 0.01
_SETTLE_S = 0.35


@dataclass(frozen=True, slots=True)
class Studio:
    """``folder`` is for what only the pictures need; it is taken away afterwards."""

    application: QApplication
    config: Config
    pipeline: Pipeline
    folder: Path
    out: Path

    def wait(self, seconds: float) -> None:
        """Let the windows work."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.application.processEvents()
            time.sleep(_LOOK_S)

    def until(self, ready: Callable[[], bool], what: str, patience_s: float = _PATIENCE_S) -> None:
        """Let the windows work until something is so. Raises UserError after `patience_s`."""
        until_s = time.monotonic() + patience_s
        while not ready():
            if time.monotonic() > until_s:
                raise UserError(f"waited in vain for {what}; is the machine very busy? Try again")
            self.application.processEvents()
            time.sleep(_LOOK_S)

    def take(self, widget: QWidget, name: str) -> Path:
        """The widget as it is now, as ``name``.png."""
        path = self.out / f"{name}.png"
        _save(widget.grab().toImage(), path)
        return path

    def close(self, window: QWidget) -> None:
        """The window is gone afterwards."""
        window.close()
        window.deleteLater()
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        self.application.processEvents()


class OperatorScene:
    """An operator window on a stage. As a context it opens and closes both."""

    def __init__(self, studio: Studio, scenery: Scenery | None = None, size: tuple[int, int] = SMALL) -> None:
        scenery = scenery or Scenery()
        self._studio = studio
        config = studio.config
        twin = config.twin.model_copy(update={"phantom": scenery.phantom})
        self.stage = Stage(config, studio.pipeline, scenery)
        shown = config.model_copy(update={"twin": twin, "record": config.record.model_copy(update={"ring_s": 0.0})})
        self.window = OperatorWindow(shown, lambda _config: self.stage, RigKind.SIM, list(PHANTOM_TITLES.items()))
        self._beside = WindowServices(self.window, studio.folder)  # its menus belong to the window; it is not started
        self.window.resize(*size)
        self._worker = ThreadPoolExecutor(1, "stage")

    def __enter__(self) -> OperatorScene:
        self.window.show()
        self.window.start()
        try:
            self.aside(self.stage.switch_on)
        except UserError:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_error: object) -> None:
        self._worker.shutdown()
        self._beside.close()
        self._studio.close(self.window)

    def play(self, frames: int) -> Tick:
        """So many frames, each of them in the window, so that the trends have something to show."""
        tick: Tick | None = None
        for _ in range(frames):
            tick = self.aside(partial(self.stage.run, 1))
            self._put_on(tick)
        assert tick is not None
        return tick

    def aside(self, work: Callable[[], T]) -> T:
        """Done in a thread, as the program does it: the window must not say that it was blocked."""
        future = self._worker.submit(work)
        self._studio.until(future.done, "the twin")
        return future.result()

    def _put_on(self, tick: Tick) -> None:
        self.stage.show(tick)
        self._studio.until(lambda: self.window.shown_tick is tick, "the frame in the window")

    def show(self, tick: Tick, name: str, prepare: Callable[[OperatorWindow], None] | None = None) -> Path:
        """Wait until the window shows a frame, and take its picture."""
        studio, window = self._studio, self.window
        self._put_on(tick)
        if prepare is not None:
            prepare(window)
        studio.wait(_SETTLE_S)
        return studio.take(window, name)


_SOMEBODY = "/data/LumenPilot"
"""Whose computer the pictures show."""
_BOARDS = 5
_PHANTOMS = ("tree", "y_branch", "s_curve", "aortic_arch", "tortuous", "tree")
_STEPS, _SHOWN_STEP, _SHOWN_LOOKS, _REMEMBERED = 40, 12, 4, 2
_TRAINING_S = 1800.0


def settings(studio: Studio) -> None:
    """A section with a limit that was changed and is not saved."""
    profiles = Profiles(studio.folder / "profiles")
    dialog = SettingsDialog(SettingsDraft(load_config()), Path("~/.config/LumenPilot/settings.toml"), profiles)
    dialog.show()
    key = "perception.pose.d_allow_px"
    dialog.go_to(key)
    dialog.page.edited.emit(key, "8")
    studio.wait(0.3)
    studio.take(dialog, "settings")
    studio.close(dialog)


def preflight(studio: Studio) -> None:
    """The checks themselves, in a process of their own, as they are made before arming."""
    config = studio.config.model_copy(update={"record": studio.config.record.model_copy(update={"folder": _SOMEBODY})})
    desk = PreflightModel(lambda: config, lambda: DriveView(0.0))
    checks = PreflightList(desk)
    try:
        desk.begin()
        studio.until(lambda: not desk.preflight.is_running, "the checks before driving")
        checks.open_list()
        studio.wait(0.3)
        studio.take(checks, "preflight")
    finally:
        desk.close()
        studio.close(checks)


def training(studio: Studio) -> None:
    """A training on frames of the twin in false colours, while it goes on."""
    folder = studio.folder / "own"
    folder.mkdir()
    store = _masks_by_hand(folder, studio.config)
    with _data_folder(studio.folder / "data"):
        dialog = TrainingDialog(partial(collect_from_file, store), f"{_SOMEBODY}/{DEFAULT_NAME}")
        dialog.steps.setValue(_STEPS)
        dialog.show()
        try:
            dialog.job.start(TrainingRequest(dialog.name.text(), steps=_STEPS, remember=_REMEMBERED))

            def far_enough() -> bool:
                state = dialog.job.state
                if not state.is_busy:
                    raise UserError(dialog.line)
                return state.step >= _SHOWN_STEP and len(state.held_out) >= _SHOWN_LOOKS

            studio.until(far_enough, "the training", _TRAINING_S)
            studio.wait(0.3)
            studio.take(dialog, "training")
            dialog.job.stop()
            studio.until(lambda: not dialog.is_busy, "the end of the training", _TRAINING_S)
        finally:
            dialog.end()
            studio.close(dialog)


@contextmanager
def _data_folder(folder: Path) -> Iterator[None]:
    """The model that comes of it is not to stay among the user's own."""
    before = os.environ.get("XDG_DATA_HOME")
    os.environ["XDG_DATA_HOME"] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ["XDG_DATA_HOME"]
        else:
            os.environ["XDG_DATA_HOME"] = before


def _masks_by_hand(folder: Path, config: Config) -> Path:
    """Pictures in false colours, with the true masks as somebody would have drawn them; returns the annotation file."""
    masks = []
    for k, phantom in enumerate(_PHANTOMS):
        world = TwinWorld(config.twin.model_copy(update={"phantom": phantom}), perception=config.perception, seed=k)
        world.insert(50.0 + 6.0 * k)
        seen = world.picture(world.physics.robot_points_mm())
        write_png(folder / f"{k:02d}_{phantom}.png", np.ascontiguousarray(255 - seen.image[..., ::-1]))
        masks.append(polygons_of(seen.vessel, MaskTarget.VESSEL) + polygons_of(seen.robot, MaskTarget.ROBOT))
    path = folder / DEFAULT_NAME
    with AnnotationStore(path) as store:
        for image, drawn in zip(find_images(sorted(folder.glob("*.png")), store)[0], masks, strict=True):
            content, key = Annotation(masks=drawn), ItemKey(image.sha256, "", "anna", 1)
            entry = store.history(key).edit("drawn", content)
            assert entry is not None
            store.save(key, ImageView.AS_IS, entry, content, measure_lines(content, image.record.size, config.perception), 1.0)
    return path


def rig_wizard(studio: Studio) -> None:
    """The page of scale and lens, with the board found in its last picture."""
    desk = RigWizardModel(studio.config, None, _open_bench, lambda _config: _see_nothing)
    wizard = RigWizard(desk, "bench 1")
    wizard.resize(1074, 580)
    wizard.show()
    idle = "the rig wizard"
    try:
        studio.until(lambda: not desk.is_busy, idle)
        wizard.camera_page.open_button.click()
        studio.until(lambda: not desk.is_busy, idle)
        wizard.next()
        page = wizard.scale_page
        for button in (*[page.take_button] * _BOARDS, page.solve_button, page.take_button):
            button.click()
            studio.until(lambda: not desk.is_busy, idle)
        studio.wait(0.3)
        studio.take(wizard, "rig_wizard")
    finally:
        wizard.reject()
        studio.close(wizard)


def _open_bench(config: Config, see: object) -> CalibrationBench:
    return CalibrationBench(config, _TwinCamera(config), None, _see_nothing, lambda: None)


def _see_nothing(frame: Frame) -> Scene:
    height, width = frame.image.shape[:2]
    return Scene(frame.index, frame.captured_s, (width, height), 1.0, refusal=Refusal(Reason.NO_ROBOT))


class _TwinCamera:
    """The twin, standing still."""

    name = "bench twin"
    is_live = False

    def __init__(self, config: Config) -> None:
        world = TwinWorld(config.twin, perception=config.perception, seed=0)
        world.insert(60.0)
        self._frame = world.frame(0.0)

    def open(self) -> None: ...

    def close(self) -> None: ...

    def read(self, timeout_s: float) -> Frame | None:
        time.sleep(min(timeout_s, 0.05))
        return replace(self._frame, captured_s=time.monotonic())


def servo_table(studio: Studio) -> None:
    """Seven servos, of which one is warm, one pulls near its end, and one was not zeroed."""
    servos = ServosConfig()
    table = ServoTable(clock=lambda: 0.0)
    card = Card("", table)
    card.resize(700, 320)
    card.show()
    table.show_status(_bus(servos), servos)
    studio.wait(0.3)
    studio.take(card, "servo_table")
    studio.close(card)


def _bus(servos: ServosConfig) -> BusStatus:
    places_mm = (2.60, -1.95, 0.30, 0.30, 62.4, 20.0, None)
    currents_ma = (86.0, 11.0, 24.0, 27.0, 41.0, 19.0, 3.0)
    readings = tuple(
        ServoState(
            joint.name, joint.id, 0.0, 1000, 1000, at_mm, at_mm, 0.0, current_ma, 11.9,
            66.0 if joint.name == "right" else 34.0, HardwareError(0), torque=True, watchdog_tripped=False,
        )
        for joint, at_mm, current_ma in zip(servos.joints, places_mm, currents_ma, strict=True)
    )  # fmt: skip
    return BusStatus(
        cycle=1,
        time_s=0.0,
        phase=BusPhase.DISARMED,
        servos=readings,
        active=(),
        latched=None,
        fault_counts={},
        sent=None,
        rejection=None,
        clamps=(),
        at_end=(),
        rejections={},
        clamp_count=0,
        line=LineCounts(),
        bad_packets=0,
        restarts=0,
        times=CycleTimes(20.0, 21.4, 4.0, 6.0),
        zeroed=tuple(at_mm is not None for at_mm in places_mm),
    )


_TARGET: Point = (560.0, 318.0)
_FEED = Jog(advance=0.5)
_OUT_OF_FOCUS_PX = 9.0
_MOST_FRAMES = 1500


def advisory(studio: Studio) -> None:
    """By hand, with a destination."""
    with OperatorScene(studio, size=SIZE) as scene:
        scene.window.choose_target(*_TARGET)
        scene.stage.jog = Jog(bend=0.25, advance=0.7)
        scene.play(60)
        scene.stage.jog = _FEED
        scene.play(40)
        scene.stage.jog = AT_REST
        scene.show(scene.play(2), "operator_window")


def driving(studio: Studio) -> None:
    """The program drives."""
    with OperatorScene(studio) as scene:
        scene.window.choose_target(*_TARGET)
        scene.play(10)
        scene.aside(lambda: scene.stage.hand_over(_TARGET))
        scene.show(scene.play(70), "operator_driving")


def arrived(studio: Studio) -> None:
    """The program has driven to the destination, and given the robot back."""
    with OperatorScene(studio) as scene:
        scene.window.choose_target(*_TARGET)
        scene.play(10)
        scene.aside(lambda: scene.stage.hand_over(_TARGET))
        for _ in range(_MOST_FRAMES):
            scene.play(1)
            if scene.stage.pilot.view.mode is not Mode.AUTONOMOUS:
                break
        if scene.stage.pilot.view.mode is not Mode.ARMED:
            raise UserError("the twin did not get there: the destination was not reached")
        scene.show(scene.play(5), "operator_arrived")


def stopped(studio: Studio) -> None:
    """STOP was pressed while the program drove."""
    with OperatorScene(studio) as scene:
        scene.window.choose_target(*_TARGET)
        scene.aside(lambda: scene.stage.hand_over(_TARGET))
        scene.play(40)
        scene.stage.pilot.ask(Act.STOP)
        scene.stage.deadman = False
        scene.show(scene.play(3), "operator_stopped", lambda window: _turn_to(window, "Log"))


def no_answer(studio: Studio) -> None:
    """A picture of which nothing can be said: the reason stands where the letter would."""
    with OperatorScene(studio) as scene:
        scene.play(25)
        scene.stage.blur_px = _OUT_OF_FOCUS_PX
        scene.show(scene.play(12), "operator_no_answer")


def keys(studio: Studio) -> None:
    """The page of keys."""
    with OperatorScene(studio) as scene:
        scene.show(scene.play(5), "operator_keys", lambda window: window.panels.help.toggle())


def tour(studio: Studio) -> None:
    """The tour, at a stop in its middle."""

    def begin(window: OperatorWindow) -> None:
        window.show_tour()
        for _ in range(3):
            window.tour.forward()

    with OperatorScene(studio) as scene:
        scene.show(scene.play(30), "operator_tour", begin)


def small_and_light(studio: Studio) -> None:
    """The smallest common screen, in the light theme."""
    theme.apply_theme(studio.application, theme.Theme.LIGHT)
    try:
        with OperatorScene(studio) as scene:
            scene.window.choose_target(*_TARGET)
            scene.stage.jog = _FEED
            scene.show(scene.play(35), "operator_light")
    finally:
        theme.apply_theme(studio.application, theme.Theme.DARK)


def _turn_to(window: OperatorWindow, title: str) -> None:
    pages = window.panels.pages
    pages.setCurrentIndex(next(k for k in range(pages.count()) if pages.tabText(k) == title))


_SHOWN_FRAME = 96
_PICTURES = 8
_STUDY_FRAMES, _STUDY_SEED = 64, 910_000
_FIGURE_WIDTH, _GAP = 780, 24


def player(studio: Studio) -> None:
    """A session: by hand, then handed over, stopped, and noted."""
    folder = _session(studio)
    window = PlayerWindow(SessionReader(folder), studio.config)
    window.resize(*SIZE)
    window.show()
    window.start()
    try:
        studio.until(lambda: len(window.course) > _SHOWN_FRAME and bool(window.session.events), "the session in the player")
        window.go(_SHOWN_FRAME)
        studio.until(lambda: window.place == _SHOWN_FRAME, "the frame in the player")
        window.select((window.clock.position_s - 1.0, window.clock.position_s + 1.5))
        studio.wait(0.3)
        studio.take(window, "player")
    finally:
        studio.close(window)


def _session(studio: Studio) -> Path:
    stage = Stage(studio.config, studio.pipeline, Scenery())
    try:
        stage.switch_on()
        stage.record(studio.folder / "sessions")
        stage.set_target(_TARGET)
        stage.jog = Jog(bend=0.2, advance=0.4)
        stage.run(24)
        stage.jog = AT_REST
        stage.run(8)
        stage.hand_over(_TARGET)
        stage.run(50)
        stage.note(Event(stage.now_s, EventKind.NOTE, "contrast agent is in"))
        stage.run(25)
        stage.pilot.ask(Act.STOP)
        stage.deadman = False
        stage.run(20)
        return stage.end_recording()
    finally:
        stage.close()


def annotator(studio: Studio) -> None:
    """Some pictures of the twin; the lines of the one in hand come from the algorithm, as G takes them over."""
    pictures = _pictures(studio)
    store = AnnotationStore(studio.folder / "annotations.sqlite")
    images, _ = find_images(pictures, store)
    items = [QueueEntry(image, ItemKey(image.sha256, "", "anna", 1), ImageView.AS_IS) for image in images]
    window = AnnotatorWindow(AnnotationModel(store, items, studio.config.perception, blind=False), "rater anna")
    window.resize(*SIZE)
    window.show()
    window.start()
    try:
        for place in (2, 1, 0):
            window.open(place)
            _annotate(studio, window)
        window.panels.toast.hide()
        studio.wait(0.3)
        studio.take(window, "annotator")
    finally:
        studio.close(window)


def _annotate(studio: Studio, window: AnnotatorWindow) -> None:
    model = window.model
    studio.until(lambda: model.is_open, "the picture in the annotator")
    window.toggle_proposal()
    studio.until(lambda: model.proposal is not None, "the algorithm's proposal")
    studio.wait(0.1)
    window.apply_proposal()
    pose = model.measure(model.annotation).pose
    if pose is None:
        raise UserError("the algorithm had no lines for the annotator's picture; is the model the default one?")
    window.set_state(pose.state)
    studio.wait(0.1)


def _pictures(studio: Studio) -> list[Path]:
    folder = studio.folder / "annotated"
    folder.mkdir()
    paths = []
    for k, phantom in zip(range(_PICTURES), ("tree", "y_branch", "aortic_arch", "tortuous") * 2, strict=True):
        stage = Stage(studio.config, studio.pipeline, Scenery(phantom, start_mm=60.0 + 6.0 * k, seed=k))
        paths.append(folder / f"{phantom}_{k + 1}.png")
        write_png(paths[-1], stage.picture().image)
        stage.close()
    return paths


def study_figures(studio: Studio) -> None:
    """The figures of an evaluation like the paper's, on frames of the twin; none of them was trained on."""
    labelled, result = studio.folder / "labelled", studio.folder / "result"
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        make_set(labelled, _STUDY_FRAMES, _STUDY_SEED)
        evaluate(result, labelled, as_json=True, like_paper=True)
    figures = [QSvgRenderer(str(path)) for path in sorted(result.rglob("*.svg"))]
    scale = _FIGURE_WIDTH / max(figure.defaultSize().width() for figure in figures)
    sizes = [figure.defaultSize() * scale for figure in figures]
    rows = [max(size.height() for size in sizes[k : k + 2]) for k in range(0, len(sizes), 2)]
    room = 2 * _FIGURE_WIDTH + 3 * _GAP, sum(rows) + (len(rows) + 1) * _GAP
    page = QImage(*room, QImage.Format.Format_RGB32)
    page.fill(Qt.GlobalColor.white)
    painter = QPainter(page)
    for k, figure in enumerate(figures):
        left = _GAP + (k % 2) * (_FIGURE_WIDTH + _GAP)
        top = _GAP + sum(rows[: k // 2]) + (k // 2) * _GAP
        figure.render(painter, QRectF(left, top, sizes[k].width(), sizes[k].height()))
    painter.end()
    _save(page, studio.out / "study_figures.png")


def _save(picture: QImage, path: Path) -> None:
    """Write a PNG of 256 colours: less than half the size of one in true colour, and alike to the eye."""
    if not picture.save(str(path)):
        raise UserError(f"{path}: cannot be written")
    with PIL.Image.open(path) as saved:
        small = saved.convert("RGB").quantize(256, method=PIL.Image.Quantize.MEDIANCUT, dither=PIL.Image.Dither.FLOYDSTEINBERG)
    small.save(path, optimize=True)


def main(
    out: Annotated[Path, typer.Option(help="folder of the pictures")],
    only: Annotated[list[str] | None, typer.Option(help="only this picture; may be repeated")] = None,
    config: ConfigOption = None,
) -> None:
    """The pictures of the documents, from the running program with fixed seeds. No screen is needed."""
    run_screenshots(out, only or (), config)


if __name__ == "__main__":
    run_tool(main)
