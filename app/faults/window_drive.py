"""The operator window on the twin, driven without a hand: for what happens to a window, its threads and its end."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from core.config import Config, PerceptionConfig
from core.control.engine import Perceive
from core.control.gate_checks import Source
from core.control.health import ModelReport
from core.control.modes import Mode
from core.types import Frame, Point, Scene
from hardware.rig import RigKind

if TYPE_CHECKING:
    from app.operator_window import OperatorWindow

_PATIENCE_S = 60.0
_TARGET = (560.0, 195.0)


class BreakingPerception:
    """Perceives, until it is told to break."""

    def __init__(self, perceive: Perceive) -> None:
        self._perceive = perceive
        self.broken = False

    def __call__(self, frame: Frame, target: Point | None = None) -> Scene:
        if self.broken:
            raise RuntimeError("injected: perception breaks")
        return self._perceive(frame, target)


def window_settings(folder: Path) -> Config:
    """A light twin: no servo line, ten pictures a second, one thread; sessions go to the folder."""
    return Config.model_validate(
        {
            "twin": {"live_frames_per_second": 12.0},
            "servos": {"driver": "direct"},
            "perception": {"segmentation": {"threads": 1, "mirrored": "never"}},
            "record": {"folder": str(folder), "ring_s": 0.0},
        }
    )


def make_test_window(folder: Path) -> tuple[OperatorWindow, list[BreakingPerception]]:
    """The window, shown and started, with the real opener; and the perceptions that it opens, newest last."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    from app.application import make_application
    from app.operator_window import OperatorWindow
    from app.rig_engine import EngineMaker

    make_application()
    made: list[BreakingPerception] = []

    class Maker(EngineMaker):
        def _perception(self, config: PerceptionConfig) -> tuple[Perceive, ModelReport]:
            perceive, report = super()._perception(config)
            made.append(BreakingPerception(perceive))
            return made[-1], report

    window = OperatorWindow(window_settings(folder), Maker(), RigKind.SIM)
    window.show()
    window.start()
    return window, made


def until(wanted: Callable[[], bool], patience_s: float = _PATIENCE_S) -> bool:
    """Let the window live until something is so; False when it was not in time."""
    from PySide6.QtCore import QCoreApplication, QEventLoop

    until_s = time.monotonic() + patience_s
    while not wanted() and time.monotonic() < until_s:
        QCoreApplication.processEvents(QEventLoop.ProcessEventsFlag.AllEvents, 20)
        time.sleep(0.002)
    return wanted()


def bring_to(window: OperatorWindow, wanted: Mode) -> bool:
    """Do what an operator does to get there: servos on (the twin's are), destination, arm, deadman, hand over."""
    from app.next_step import Step

    desk = window.desk

    def is_in(*modes: Mode) -> bool:
        return desk.view is not None and desk.view.mode in modes

    if not until(lambda: desk.view is not None and desk.view.permitted is Source.OPERATOR and window.shown_tick is not None):
        return False
    window.choose_target(*_TARGET)
    until_s = time.monotonic() + _PATIENCE_S
    while not is_in(wanted) and time.monotonic() < until_s:
        if is_in(Mode.ADVISORY) and wanted is not Mode.ADVISORY:
            desk.hold_deadman(False)
            if desk.view is not None and desk.view.latched is not None:
                desk.take(Step.ACKNOWLEDGE)
            if until(lambda: desk.view is not None and not desk.view.against_arming, 5.0):
                desk.take(Step.ARM)
        elif is_in(Mode.ARMED, Mode.HOLD) and wanted is Mode.AUTONOMOUS:
            desk.hold_deadman(True)
            if until(lambda: desk.view is not None and not desk.view.against_hand_over and bool(desk.view.deadman), 2.0):
                desk.take(Step.HAND_OVER)
        until(lambda: is_in(wanted), 0.5)
    return is_in(wanted)


def record(window: OperatorWindow) -> bool:
    """Begin to record; True when the first frames are written."""
    window._recorder.toggle()
    return until(lambda: window._recorder.status.frames > 3)


def run_and_close(folder: Path, wanted: str) -> int:
    """For a process of its own: record, go to a mode, close the window; what was reached is told on standard output."""
    window, _ = make_test_window(folder)
    recorded = record(window)
    reached = bring_to(window, Mode(wanted))
    sys.stdout.write(json.dumps({"recorded": recorded, "mode": wanted if reached else "not reached"}) + "\n")
    sys.stdout.flush()
    window.close()
    return 0
