"""What every picture of the documents needs: one application, one network, a window that is waited for, and a file."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication, QWidget

from app.operator_window import OperatorWindow
from app.screenshots.stage import Scenery, Stage
from app.side_work import SideWork
from core.config import Config
from core.errors import UserError
from core.perception.pipeline import Pipeline
from core.types import Tick
from hardware.rig import RigKind
from hardware.twin.phantom import PHANTOM_TITLES

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
        if not widget.grab().save(str(path)):
            raise UserError(f"{path}: cannot be written")
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
        self._beside = SideWork(self.window, studio.folder)  # its menus belong to the window; it is not started
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
