"""The operator window on the twin without an operator: for what happens to a window, its threads and its end."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QEventLoop

from app.operator.rig_engine import EngineMaker
from app.operator.window import OperatorWindow
from app.ui.texts import OperatorStep
from app.ui.window_base import make_application
from core.config.models import Config, PerceptionConfig
from core.control.engine import Perceive
from core.control.gate import Source
from core.control.health import ModelReport
from core.control.modes import Mode
from core.types import Command, Frame, Point, Scene
from hardware.rig import START_INSERTION_MM, Rig, RigKind
from hardware.twin.actuation import JointsToTwin
from hardware.twin.world import TwinCamera, TwinWorld
from tools.fault_campaign.bench import TARGET
from tools.lockstep import LockStepServos

_PATIENCE_S, _DRIVES_WITHIN_S = 60.0, 300.0
"""For a state of the window, and until the program drives: a computer that others keep busy is tried again and again."""


class BreakingPerception:
    """Perceives until ``broken`` is set."""

    def __init__(self, perceive: Perceive) -> None:
        self._perceive = perceive
        self.broken = False

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        if self.broken:
            raise RuntimeError("injected: perception breaks")
        return self._perceive(frame, target)


class _ThreadedServos(LockStepServos):
    """For the threads of a window, and the world's, which turns the cycles."""

    def __init__(self, config: Config) -> None:
        super().__init__(config.servos, config.safety, time.monotonic)
        self._lock = threading.RLock()

    def cycle(self) -> None:
        with self._lock:
            super().cycle()

    def arm(self) -> None:
        with self._lock:
            super().arm()

    def disarm(self) -> None:
        with self._lock:
            super().disarm()

    def stop(self) -> None:
        with self._lock:
            super().stop()

    def torque_off(self) -> None:
        with self._lock:
            super().torque_off()


def _open_in_real_time(config: Config) -> Rig:
    """The twin in this process, with ideal servos behind the real guard and gate."""
    world, servos = TwinWorld(config.twin, perception=config.perception), _ThreadedServos(config)
    world.insert(START_INSERTION_MM)
    joints = JointsToTwin(config.servos, servos.positions_mm())

    def drive(duration_s: float) -> Command:
        servos.cycle()
        return joints.command(servos.positions_mm(), duration_s)

    world.drive = drive
    camera = TwinCamera(world)
    camera.open()
    return Rig("twin", RigKind.SIM, camera, servos)


def make_test_window(folder: Path) -> tuple[OperatorWindow, list[BreakingPerception]]:
    """The window, shown and started; and the perceptions that it opens, newest last.

    The twin runs by the wall's clock, which does not wait for a window that hangs. It is a light one: 12 pictures a second, one
    thread. Sessions go to `folder`.
    """
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    make_application()
    made: list[BreakingPerception] = []

    class Maker(EngineMaker):
        def _open(self, config: Config, ahead: object) -> Rig:
            return _open_in_real_time(config)

        def _perception(self, config: PerceptionConfig) -> tuple[Perceive, ModelReport]:
            perceive, report = super()._perception(config)
            made.append(BreakingPerception(perceive))
            return made[-1], report

    config = Config.model_validate(
        {
            "twin": {"live_frames_per_second": 12.0},
            "perception": {"segmentation": {"threads": 1, "mirrored": "never"}},
            "record": {"folder": str(folder), "ring_s": 0.0},
        }
    )
    window = OperatorWindow(config, Maker(), RigKind.SIM)
    window.show()
    window.start()
    return window, made


def until(wanted: Callable[[], bool], patience_s: float = _PATIENCE_S) -> bool:
    """Run the event loop until something is so; False when it was not in time."""
    until_s = time.monotonic() + patience_s
    while not wanted() and time.monotonic() < until_s:
        QCoreApplication.processEvents(QEventLoop.ProcessEventsFlag.AllEvents, 20)
        time.sleep(0.002)
    return wanted()


def bring_to(window: OperatorWindow, wanted: Mode) -> bool:
    """Do what an operator does to get there: servos on (the twin's are), target, arm, deadman, hand over."""
    controls = window.controls

    def is_in(*modes: Mode) -> bool:
        return controls.view is not None and controls.view.mode in modes

    def can_drive() -> bool:
        return controls.view is not None and controls.view.permitted is Source.OPERATOR and window.shown_tick is not None

    if not until(can_drive, _DRIVES_WITHIN_S):
        return False
    window.choose_target(*TARGET)
    until_s = time.monotonic() + _DRIVES_WITHIN_S
    while not is_in(wanted) and time.monotonic() < until_s:
        if is_in(Mode.ADVISORY) and wanted is not Mode.ADVISORY:
            controls.deadman.hold("mouse", False)
            if controls.view is not None and controls.view.latched is not None:
                controls.ask_step(OperatorStep.ACKNOWLEDGE)
            if until(lambda: controls.view is not None and not controls.view.against_arming, 5.0):
                controls.ask_step(OperatorStep.ARM)
        elif is_in(Mode.ARMED, Mode.HOLD) and wanted is Mode.AUTONOMOUS:
            controls.deadman.hold("mouse", True)
            if until(lambda: (view := controls.view) is not None and not view.against_hand_over and bool(view.deadman), 2.0):
                controls.ask_step(OperatorStep.HAND_OVER)
        until(lambda: is_in(wanted), 0.5)
    return is_in(wanted)


def record(window: OperatorWindow) -> bool:
    """Begin to record; True when the first frames are written."""
    window.recorder.toggle()
    return until(lambda: window.recorder.status.frames > 3)
