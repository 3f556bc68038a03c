"""Fixtures for the windows: no screen needed, warnings of Qt fail a test (see pyproject), nothing may be left over."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.operator.window import OperatorWindow
from app.ui.layout_state import layout_settings
from app.ui.theme import apply_theme
from core.config.models import Config, PerceptionConfig
from hardware.rig import RigKind
from tests.app.fakes import FakeBench, FakeEngine

PHANTOMS = (("s_curve", "S-curve"), ("tree", "Tree"))


@pytest.fixture(scope="session", autouse=True)
def themed(qapp: QApplication) -> None:
    apply_theme(qapp)
    layout_settings()  # QSettings keeps the folder that is set at its first use: not that of a test which makes it unwritable


@pytest.fixture(scope="session")
def bench() -> FakeBench:
    return FakeBench()


@pytest.fixture(autouse=True)
def no_leaks(request: pytest.FixtureRequest, qapp: QApplication, imported: set[str]) -> Iterator[None]:
    """Every window that a test makes is gone after it. Without ``qtbot`` it is looked for first: collecting takes its time.

    As in the program, no other thread collects: it would destroy windows that went out of use.
    """
    _leave_out(imported)
    before = set(QApplication.topLevelWidgets())
    gc.disable()
    yield
    gc.enable()
    may_be_clean = "qtbot" not in request.fixturenames
    for _ in range(2):  # what Qt lets go of may hold more
        if may_be_clean and set(QApplication.topLevelWidgets()) <= before:
            break
        gc.collect()
        QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        qapp.processEvents()
        may_be_clean = True
    left = [widget for widget in QApplication.topLevelWidgets() if widget not in before]
    assert not left, f"left over: {left}"
    _leave_out(imported)


@pytest.fixture(scope="session")
def imported() -> set[str]:
    """The modules whose objects the collector no longer looks at."""
    return set()


def _leave_out(imported: set[str]) -> None:
    """Torch, OpenVINO and the like never become garbage: collections that walk through them after each test take half of all time.

    Asked only between tests: what is alive then and becomes garbage later is never found any more.
    """
    if sys.modules.keys() - imported:
        gc.collect()
        gc.freeze()
        imported.update(sys.modules)


@pytest.fixture
def all_orientations() -> None:
    """Asked for by tests that look at pictures as they are looked at, where the others of their file do not."""


@pytest.fixture
def looked_at_once(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures that stand are looked at in one orientation of eight: for tests that are about something else than what is seen."""
    import app.annotator.model  # noqa: F401 - takes open_pipeline when it is imported, which must be the real one
    from core.perception import pipeline

    if "all_orientations" in request.fixturenames:
        return
    opened = pipeline.open_pipeline

    def open_pipeline(config: PerceptionConfig, **how: bool) -> pipeline.Pipeline:
        once = config.segmentation.model_copy(update={"mirrored": "never"})
        return opened(config.model_copy(update={"segmentation": once}), **how)

    monkeypatch.setattr(pipeline, "open_pipeline", open_pipeline)


MakeWindow = Callable[..., OperatorWindow]


@pytest.fixture
def engines() -> list[FakeEngine]:
    """Those that the windows of a test have opened, where it does not say how."""
    return []


@pytest.fixture
def make_window(qtbot: QtBot, bench: FakeBench, engines: list[FakeEngine]) -> Iterator[MakeWindow]:
    """Makes operator windows over fake engines; at the end each is closed, and its thread must have ended."""
    windows: list[OperatorWindow] = []

    def open_another(_config: Config) -> FakeEngine:
        engines.append(FakeEngine(bench))
        return engines[-1]

    def make(
        open_engine: Callable[[Config], FakeEngine] | None = None,
        config: Config | None = None,
        kind: RigKind = RigKind.SIM,
    ) -> OperatorWindow:
        opener = open_engine or open_another
        window = OperatorWindow(
            config or Config.model_validate({"record": {"ring_s": 0}}), opener, kind, PHANTOMS if kind is RigKind.SIM else ()
        )
        qtbot.addWidget(window)
        windows.append(window)
        window.show()
        return window

    yield make
    for window in windows:
        window.close()
        assert not window.rig.engine.isRunning()


@pytest.fixture
def engine(bench: FakeBench) -> FakeEngine:
    return FakeEngine(bench)


@pytest.fixture
def running(make_window: MakeWindow, engine: FakeEngine, qtbot: QtBot, tmp_path: Path) -> OperatorWindow:
    """A window that shows pictures of `engine`; its snapshots go to the test's folder."""
    config = Config.model_validate(
        {"window": {"pictures_folder": str(tmp_path / "shots")}, "record": {"folder": str(tmp_path / "sessions"), "ring_s": 0}}
    )
    window = make_window(lambda _config: engine, config)
    window.start()
    qtbot.waitUntil(lambda: window.shown_tick is not None)
    return window
