"""``python -m tools.screenshots``: every picture of the documents, taken from the real windows. No screen is needed.

The operator window shows the twin in lock-step: perception, policy, pilot and gate are the real ones, the servos are ideal, and
time is what the frames have passed. So a picture follows from seeds and turns, not from how busy the machine is.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, TypeVar

import PIL.Image
import typer
from PySide6.QtCore import QEvent, QRectF, Qt
from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QAbstractButton, QApplication, QWidget

from app.annotator.model import AnnotationModel, QueueEntry
from app.annotator.panels import Answer
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
from app.ui import theme
from app.ui.window_base import make_application
from app.widgets.basics import Card
from app.widgets.servo_table import ServoTable
from core.annotation.model import ImageView
from core.annotation.store import AnnotationStore, ItemKey, find_images
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
from core.perception.pipeline import Pipeline, open_pipeline
from core.session.manifest import Event, EventKind, about_rig, event_of_alert, event_of_target
from core.session.reader import SessionReader
from core.session.writer import SessionWriter
from core.types import Frame, Point, Reason, Refusal, RobotStatus, Scene, Tick
from hardware.calibration.bench import CalibrationBench
from hardware.rig import RigKind
from hardware.servos.bus_ipc import BusPhase, BusStatus, CycleTimes
from hardware.servos.dynamixel_port import LineCounts
from hardware.servos.registers import HardwareError, ServoState
from hardware.twin.actuation import JointsToTwin
from hardware.twin.phantom import PHANTOM_TITLES
from hardware.twin.world import TwinWorld
from tools.lockstep import LockStepServos
from tools.run import run_tool

_FRAMES_PER_S = 25.0
_REQUEST_WAIT_S = 0.002  # for requests to the servos, which run in a thread at the wall's pace
_IDLE_S = 0.01
_PATIENCE_TURNS = 400


class LockStepEngine:
    """An engine for one window, on the bench twin in lock-step. It moves only by ``run``.

    Parameters
    ----------
    config : limits, policy and the like.
    pipeline : perception; it is reset.
    phantom, start_mm, seed : the phantom, the robot's insertion at the start, and the seed of what is random.
    """

    def __init__(self, config: Config, pipeline: Pipeline, phantom: str = "tree", start_mm: float = 78.0, seed: int = 1) -> None:
        self.config = config
        self.now_s = 1000.0
        twin = config.twin.model_copy(update={"phantom": phantom})
        self.world = TwinWorld(twin, perception=config.perception, seed=seed)
        self.world.insert(start_mm)
        pipeline.reset()
        self.robot = robot = _TwinServos(config, self.world, lambda: self.now_s)
        robot.cycle()  # the first report
        joints = JointsToTwin(config.servos, robot.positions_mm())
        self.world.drive = lambda duration_s: joints.command(robot.positions_mm(), duration_s)
        policy = make_policy(config.policy.name, config)
        self.pilot = Pilot(robot, policy, config, ModelReport(True), clock=lambda: self.now_s)
        self._engine = Engine(_Camera(self.render), pipeline, policy, lambda: None, self.pilot, robot, turns_pilot=False)
        self.jog: Jog = AT_REST
        self.deadman = False
        self.writer: SessionWriter | None = None
        self.problem: str | None = None
        self._lock = threading.Lock()
        self._ticks: list[Tick] = []

    # ---- interface of an engine

    def step(self, timeout_s: float) -> Tick | None:
        """The frame that ``show`` was given."""
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
            self.writer.add_event(event_of_target(target_px, self.now_s))

    def set_perception(self, config: PerceptionConfig) -> bool:
        return False

    def close(self) -> None:
        self._engine.close()

    # ---- script

    def run(self, frames: int) -> Tick:
        """Turn for so many frames; returns the last one."""
        tick: Tick | None = None
        for _ in range(frames):
            tick = self._turn() or tick
        assert tick is not None
        return tick

    def show(self, tick: Tick) -> None:
        """Give a frame to the window."""
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
        self.pilot.switch_on()
        self.until(lambda view: view.servos_on, "servos on")

    def hand_over(self, target: Point) -> None:
        """Let the program drive to a target."""
        self.set_target(target)
        self.until(lambda view: not view.against_arming, "well enough to arm")
        self.pilot.ask(Act.ARM)
        self.until(lambda view: view.mode is Mode.ARMED, "armed")
        self.deadman = True
        self.until(lambda view: not view.against_hand_over and view.deadman is True, "ready to hand over")
        self.pilot.ask(Act.HAND_OVER)
        self.until(lambda view: view.mode is Mode.AUTONOMOUS, "handed over")

    def record(self, folder: Path) -> None:
        """Record a session from the next frame on, until ``end_recording``."""
        settings = self.config.record.model_copy(update={"ring_s": 0.0, "max_queue": 2000, "sync_s": 0.0})
        folder.mkdir(parents=True, exist_ok=True)
        self.writer = SessionWriter(settings, about_rig(self.config, "SIM", "twin"), folder=folder, clock=lambda: self.now_s)
        self.writer.start()
        while not self.writer.status().recording:
            self.run(1)
            time.sleep(_REQUEST_WAIT_S)

    def end_recording(self) -> Path:
        """End the session; its folder."""
        assert self.writer is not None
        self.writer.stop("all recorded")
        is_whole = self.writer.close()
        saved, self.writer = self.writer.status().saved, None
        if saved is None or not is_whole:
            raise UserError("the session for the pictures could not be written: free some space")
        return saved

    def _turn(self) -> Tick | None:
        """The time of a frame: a frame, then the turns of the pilot."""
        tick = self._engine.step(0.0)
        for _ in range(round(1.0 / (_FRAMES_PER_S * PERIOD_S))):
            self.now_s += PERIOD_S
            self._turn_pilot()
        if tick is not None:
            tick = replace(tick, frames_per_second=_FRAMES_PER_S)
            if self.writer is not None:
                self.writer.put(tick, self.pilot.view, None)
        return tick

    def _turn_pilot(self) -> None:
        pilot = self.pilot
        pilot.window_alive()
        pilot.deadman("script", self.deadman)
        if not self.jog.is_rest:
            pilot.jog("script", self.jog)
        view = pilot.tick()
        self.robot.cycle()
        if self.writer is not None:
            news = pilot.news()
            for changed in news.changes:
                self.writer.drive(changed)
            for alert in news.alerts:
                self.writer.add_event(event_of_alert(alert, view.time_s))
        if view.busy:
            time.sleep(_REQUEST_WAIT_S)

    def render(self) -> Frame:
        """The world one frame later."""
        self.world.advance(1.0 / _FRAMES_PER_S)
        return self.world.frame(self.now_s)


class _TwinServos(LockStepServos):
    """Ideal servos that also report the insertion and the wall contact of the twin."""

    def __init__(self, config: Config, world: TwinWorld, clock: Callable[[], float]) -> None:
        super().__init__(config.servos, config.safety, clock)
        self._world = world

    def status(self) -> RobotStatus:
        truth = self._world.physics.status()
        return replace(super().status(), insertion_mm=truth.insertion_mm, wall_contact_n=truth.wall_contact_n)


class _Camera:
    name = "bench twin"

    def __init__(self, render: Callable[[], Frame]) -> None:
        self._render = render

    def open(self) -> None: ...

    def close(self) -> None: ...

    def read(self, timeout_s: float) -> Frame | None:
        return self._render()


SIZE = (1600, 900)
SMALL = (1280, 720)
T = TypeVar("T")
_PATIENCE_S = 60.0
_POLL_S = 0.01
_SETTLE_S = 0.35  # until a window has drawn what it was given


@dataclass(frozen=True, slots=True)
class PictureJob:
    """What the pictures share. ``folder`` is temporary; ``out`` is the folder of the pictures."""

    application: QApplication
    config: Config
    pipeline: Pipeline
    folder: Path
    out: Path

    def wait(self, seconds: float) -> None:
        """Run the event loop."""
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            self.application.processEvents()
            time.sleep(_POLL_S)

    def until(self, ready: Callable[[], bool], what: str, patience_s: float = _PATIENCE_S) -> None:
        """Run the event loop until something is so. Raises UserError after `patience_s`."""
        until_s = time.monotonic() + patience_s
        while not ready():
            if time.monotonic() > until_s:
                raise UserError(f"waited in vain for {what}; is the machine very busy? Try again")
            self.wait(_POLL_S)

    def save(self, widget: QWidget, name: str, settle_s: float = 0.3) -> None:
        """Save a widget as ``name``.png after it has settled."""
        self.wait(settle_s)
        _save(widget.grab().toImage(), self.out / f"{name}.png")

    def close(self, window: QWidget) -> None:
        """Close and delete a window."""
        window.close()
        window.deleteLater()
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        self.application.processEvents()


class OperatorScene:
    """An operator window on a lock-step engine. As a context it opens and closes both."""

    def __init__(self, job: PictureJob, size: tuple[int, int] = SMALL) -> None:
        self._job = job
        self.engine = LockStepEngine(job.config, job.pipeline)
        twin = job.config.twin.model_copy(update={"phantom": "tree"})
        shown = job.config.model_copy(update={"twin": twin, "record": job.config.record.model_copy(update={"ring_s": 0.0})})
        self.window = OperatorWindow(shown, lambda _config: self.engine, RigKind.SIM, list(PHANTOM_TITLES.items()))
        self._services = WindowServices(self.window, job.folder)  # for the menus; it is not started
        self.window.resize(*size)
        self._worker = ThreadPoolExecutor(1, "engine")

    def __enter__(self) -> OperatorScene:
        self.window.show()
        self.window.start()
        self.window._stale_after_s = math.inf  # how busy this machine is, the pictures do not show
        try:
            self.run_aside(self.engine.switch_on)
        except UserError:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_error: object) -> None:
        self._worker.shutdown()
        self._services.close()
        self._job.close(self.window)

    def play(self, frames: int) -> None:
        """Show so many frames, each of them in the window, so that the trends have something to show."""
        for _ in range(frames):
            tick = self.run_aside(lambda: self.engine.run(1))
            self.engine.show(tick)
            self._job.until(lambda tick=tick: self.window.shown_tick is tick, "the frame in the window")  # type: ignore[misc]

    def hand_over(self) -> None:
        self.run_aside(lambda: self.engine.hand_over(_TARGET))

    def run_aside(self, work: Callable[[], T]) -> T:
        """Run something in a thread, as the program does: the window must not count as blocked."""
        future = self._worker.submit(work)
        self._job.until(future.done, "the twin")
        return future.result()

    def save(self, name: str) -> None:
        self._job.save(self.window, name, _SETTLE_S)


_SHOWN_FOLDER = "/data/LumenPilot"  # instead of a folder of this machine
_BOARDS = 5


def settings(job: PictureJob) -> None:
    """A section with a limit that was changed and is not saved."""
    dialog = SettingsDialog(SettingsDraft(load_config()), Path("~/.config/LumenPilot/settings.toml"))
    dialog.show()
    key = "perception.pose.d_allow_px"
    dialog.go_to(key)
    dialog.page.edited.emit(key, "8")
    job.save(dialog, "settings")
    job.close(dialog)


def preflight(job: PictureJob) -> None:
    """The checks before arming."""
    config = job.config.model_copy(update={"record": job.config.record.model_copy(update={"folder": _SHOWN_FOLDER})})
    model = PreflightModel(lambda: config, lambda: DriveView(0.0))
    checks = PreflightList(model)
    try:
        model.begin()
        job.until(lambda: not model.preflight.is_running, "the checks before driving")
        checks.open_list()
        job.save(checks, "preflight")
    finally:
        model.close()
        job.close(checks)


def rig_wizard(job: PictureJob) -> None:
    """The page of scale and lens, with the board found in its last picture."""
    world = TwinWorld(job.config.twin, perception=job.config.perception, seed=0)
    world.insert(60.0)
    still = world.frame(0.0)

    def render() -> Frame:
        time.sleep(0.05)
        return replace(still, captured_s=time.monotonic())

    def perceive_nothing(frame: Frame) -> Scene:
        height, width = frame.image.shape[:2]
        return Scene(frame.index, frame.captured_s, (width, height), 1.0, refusal=Refusal(Reason.NO_ROBOT))

    def open_bench(config: Config, _perceive: object) -> CalibrationBench:
        return CalibrationBench(config, _Camera(render), None, perceive_nothing, lambda: None)

    model = RigWizardModel(job.config, None, open_bench, lambda _config: perceive_nothing)
    wizard = RigWizard(model, "bench 1")
    wizard.resize(1074, 580)
    wizard.show()

    def click(*buttons: QAbstractButton) -> None:
        for button in buttons:
            button.click()
            job.until(lambda: not model.is_busy, "the rig wizard")

    try:
        job.until(lambda: not model.is_busy, "the rig wizard")
        click(wizard.camera_page.open_button)
        wizard.next()
        page = wizard.scale_page
        click(*[page.take_button] * _BOARDS, page.solve_button, page.take_button)
        job.save(wizard, "rig_wizard")
    finally:
        wizard.reject()
        job.close(wizard)


def servo_table(job: PictureJob) -> None:
    """Seven servos, of which one is warm, one pulls near its end, and one was not zeroed."""
    # fmt: off
    servos = ServosConfig()
    table = ServoTable(clock=lambda: 0.0)
    card = Card("", table)
    card.resize(700, 320)
    card.show()
    places_mm = (2.60, -1.95, 0.30, 0.30, 62.4, 20.0, None)
    currents_ma = (86.0, 11.0, 24.0, 27.0, 41.0, 19.0, 3.0)
    readings = tuple(
        ServoState(
            joint.name, joint.id, 0.0, 1000, 1000, at_mm, at_mm, 0.0, current_ma, 11.9,
            66.0 if joint.name == "right" else 34.0, HardwareError(0), torque=True, watchdog_tripped=False,
        )
        for joint, at_mm, current_ma in zip(servos.joints, places_mm, currents_ma, strict=True)
    )
    status = BusStatus(
        cycle=1, time_s=0.0, phase=BusPhase.DISARMED, servos=readings, active=(), latched=None, fault_counts={}, sent=None,
        rejection=None, clamps=(), at_end=(), rejections={}, clamp_count=0, line=LineCounts(), bad_packets=0, restarts=0,
        times=CycleTimes(20.0, 21.4, 4.0, 6.0), zeroed=tuple(at_mm is not None for at_mm in places_mm),
    )
    # fmt: on
    table.show_status(status, servos)
    job.save(card, "servo_table")
    job.close(card)


_TARGET: Point = (560.0, 318.0)
_FEED = Jog(advance=0.5)
_MOST_FRAMES = 1500


def operator_window(job: PictureJob) -> None:
    """By hand, with a target."""
    with OperatorScene(job, SIZE) as scene:
        scene.window.choose_target(*_TARGET)
        for jog, frames in ((Jog(bend=0.25, advance=0.7), 60), (_FEED, 40), (AT_REST, 2)):
            scene.engine.jog = jog
            scene.play(frames)
        scene.save("operator_window")


def operator_driving(job: PictureJob) -> None:
    """The program drives."""
    with OperatorScene(job) as scene:
        scene.window.choose_target(*_TARGET)
        scene.play(10)
        scene.hand_over()
        scene.play(70)
        scene.save("operator_driving")


def operator_arrived(job: PictureJob) -> None:
    """The program has driven to the target, and given the robot back."""
    with OperatorScene(job) as scene:
        scene.window.choose_target(*_TARGET)
        scene.play(10)
        scene.hand_over()
        for _ in range(_MOST_FRAMES):
            scene.play(1)
            if scene.engine.pilot.view.mode is not Mode.AUTONOMOUS:
                break
        if scene.engine.pilot.view.mode is not Mode.ARMED:
            raise UserError("the twin did not get there: the target was not reached")
        scene.play(5)
        scene.save("operator_arrived")


def operator_stopped(job: PictureJob) -> None:
    """STOP was pressed while the program drove; the log."""
    with OperatorScene(job) as scene:
        scene.window.choose_target(*_TARGET)
        scene.hand_over()
        scene.play(40)
        scene.engine.pilot.stop()
        scene.engine.deadman = False
        scene.play(3)
        pages = scene.window.panels.pages
        pages.setCurrentIndex(next(k for k in range(pages.count()) if pages.tabText(k) == "Log"))
        scene.save("operator_stopped")


def operator_tour(job: PictureJob) -> None:
    """The tour, at a stop in its middle."""
    with OperatorScene(job) as scene:
        scene.play(30)
        scene.window.show_tour()
        for _ in range(3):
            scene.window.tour.forward()
        scene.save("operator_tour")


def operator_light(job: PictureJob) -> None:
    """The smallest common screen, in the light theme."""
    theme.apply_theme(job.application, theme.Theme.LIGHT)
    try:
        with OperatorScene(job) as scene:
            scene.window.choose_target(*_TARGET)
            scene.engine.jog = _FEED
            scene.play(35)
            scene.save("operator_light")
    finally:
        theme.apply_theme(job.application, theme.Theme.DARK)


_SHOWN_FRAME = 96
_PICTURES = 8
_STUDY_FRAMES, _STUDY_SEED = 64, 910_000
_FIGURE_WIDTH, _GAP = 780, 24


def player(job: PictureJob) -> None:
    """A session: by hand, then handed over, stopped, and noted."""
    folder = _session(job)
    window = PlayerWindow(SessionReader(folder), job.config)
    window.resize(*SIZE)
    window.show()
    window.start()
    try:
        job.until(lambda: len(window.course) > _SHOWN_FRAME and bool(window.session.events), "the session in the player")
        window.go(_SHOWN_FRAME)
        job.until(lambda: window.place == _SHOWN_FRAME, "the frame in the player")
        window.select((window.clock.position_s - 1.0, window.clock.position_s + 1.5))
        job.save(window, "player")
    finally:
        job.close(window)


def _session(job: PictureJob) -> Path:
    engine = LockStepEngine(job.config, job.pipeline)
    engine.switch_on()
    engine.record(job.folder / "sessions")
    engine.set_target(_TARGET)
    engine.jog = Jog(bend=0.2, advance=0.4)
    engine.run(24)
    engine.jog = AT_REST
    engine.run(8)
    engine.hand_over(_TARGET)
    engine.run(50)
    assert engine.writer is not None
    engine.writer.add_event(Event(engine.now_s, EventKind.NOTE, "contrast agent is in"))
    engine.run(25)
    engine.pilot.stop()
    engine.deadman = False
    engine.run(20)
    engine.close()
    return engine.end_recording()


def annotator(job: PictureJob) -> None:
    """Pictures of the twin, annotated with the algorithm's proposal, as the key G applies it."""
    pictures = _pictures(job)
    store = AnnotationStore(job.folder / "annotations.sqlite")
    images, _ = find_images(pictures, store)
    items = [QueueEntry(image, ItemKey(image.sha256, "", "anna", 1), ImageView.AS_IS) for image in images]
    window = AnnotatorWindow(AnnotationModel(store, items, job.config.perception, blind=False), "rater anna")
    window.resize(*SIZE)
    window.show()
    window.start()
    try:
        for place in (2, 1, 0):
            window.open(place)
            _annotate(job, window)
        window.panels.toast.hide()
        job.save(window, "annotator")
    finally:
        job.close(window)


def _annotate(job: PictureJob, window: AnnotatorWindow) -> None:
    model = window.model
    job.until(lambda: model.is_open, "the picture in the annotator")
    window.toggle_proposal()
    job.until(lambda: model.proposal is not None, "the algorithm's proposal")
    job.wait(0.1)
    window.apply_proposal()
    pose = model.measure(model.annotation).pose
    if pose is None:
        raise UserError("the algorithm had no lines for the annotator's picture; is the model the default one?")
    window.give(Answer[pose.state.value])
    job.wait(0.1)


def _pictures(job: PictureJob) -> list[Path]:
    folder = job.folder / "annotated"
    folder.mkdir()
    paths = []
    for k, phantom in zip(range(_PICTURES), ("tree", "y_branch", "aortic_arch", "tortuous") * 2, strict=True):
        engine = LockStepEngine(job.config, job.pipeline, phantom, start_mm=60.0 + 6.0 * k, seed=k)
        paths.append(folder / f"{phantom}_{k + 1}.png")
        write_png(paths[-1], engine.render().image)
        engine.close()
    return paths


def study_figures(job: PictureJob) -> None:
    """The figures of an evaluation like the paper's, on frames of the twin that no training has seen."""
    labelled, result = job.folder / "labelled", job.folder / "result"
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
    _save(page, job.out / "study_figures.png")


def _save(picture: QImage, path: Path) -> None:
    """Write a PNG of 256 colours: less than half the size of one in true colour, and alike to the eye."""
    if not picture.save(str(path)):
        raise UserError(f"{path}: cannot be written")
    with PIL.Image.open(path) as saved:
        small = saved.convert("RGB").quantize(256, method=PIL.Image.Quantize.MEDIANCUT, kmeans=2)
    small.save(path, optimize=True)


PICTURES = {
    make.__name__: make
    for make in (
        *(operator_window, operator_driving, operator_arrived, operator_stopped),
        *(operator_tour, operator_light, player, annotator, study_figures),
        *(settings, preflight, rig_wizard, servo_table),
    )
}
"""What makes a picture, by the name of its file without ending."""


def main(
    out: Annotated[Path, typer.Option(help="folder of the pictures")],
    only: Annotated[list[str] | None, typer.Option(help="only this picture; may be repeated")] = None,
    config: ConfigOption = None,
) -> None:
    """The pictures of the documents, from the running program with fixed seeds. No screen is needed."""
    if unknown := [name for name in only or () if name not in PICTURES]:
        raise UserError(f"no picture is called {unknown[0]!r}; there are: {', '.join(PICTURES)}")
    # The offscreen platform draws with the same fonts and at the same sizes on every machine.
    os.environ["QT_QPA_PLATFORM"] = "offscreen"
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: cannot be made ({error.strerror})") from None
    with tempfile.TemporaryDirectory(prefix="lumenpilot_pictures_", ignore_cleanup_errors=True) as temporary:
        folder = Path(temporary)
        overrides = {
            "record": {"folder": str(folder / "sessions")},
            "window": {"pictures_folder": str(folder / "pictures")},
            "perception": {"segmentation": {"threads": 1}},
        }
        settings = load_config(config, overrides=overrides)
        job = PictureJob(make_application(), settings, open_pipeline(settings.perception), folder, out)
        for name in only or PICTURES:
            sys.stderr.write(f"{out / name}.png\n")
            PICTURES[name](job)


if __name__ == "__main__":
    run_tool(main)
