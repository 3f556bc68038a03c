"""Training from a window: refused with one line, a real process, watched, stopped with what was learnt, never used silently."""

from __future__ import annotations

import errno
import json
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import pytest
from PySide6.QtGui import QAction
from pytestqt.qtbot import QtBot

from app.operator.models import figures_line, installed_models
from app.operator.services import WindowServices
from app.operator.window import OperatorWindow
from app.training.dialog import TrainingDialog
from app.training.model import TrainingJob, TrainingPhase, TrainingRequest, collect_from_file, name_problem
from core.annotation.exchange import FEWEST
from core.annotation.store import FoundImage, StoredAnnotation
from core.control.drive_view import DriveView
from core.control.modes import Mode
from core.perception.model_file import MODELS, model_folder, own_models, read_model_info
from tests.app.annotated import annotate_masks
from tests.app.fakes import FakeEngine, until

LONG_MS = 240_000


@pytest.fixture(autouse=True)
def no_models_stay() -> Iterator[None]:
    yield
    shutil.rmtree(own_models(), ignore_errors=True)


@pytest.fixture
def small_model(tmp_path: Path) -> str:
    """A network that is trained in a moment."""
    from core.learning.model_writer import save_model
    from core.perception.unet import DualUNet, UNetShape

    folder = tmp_path / "small"
    save_model(DualUNet(UNetShape.of_base(4)), folder, training={}, figures={})
    return str(folder)


def job_on(store: Path, tmp_path: Path) -> TrainingJob:
    return TrainingJob(partial(collect_from_file, store), folder=tmp_path / "training")


def ended(job: TrainingJob, qtbot: QtBot) -> None:
    qtbot.waitUntil(lambda: job.state.phase in {TrainingPhase.DONE, TrainingPhase.FAILED}, timeout=LONG_MS)


@pytest.mark.slow
def test_it_trains_in_a_process_shows_how_it_goes_and_installs_the_model(small_model: str, qtbot: QtBot, tmp_path: Path) -> None:
    job = job_on(annotate_masks(tmp_path / "images", 10), tmp_path)
    installed: list[str] = []
    job.installed.connect(installed.append)
    job.start(TrainingRequest("own_1", small_model, 12, remember=2))
    ended(job, qtbot)
    state = job.state
    assert state.phase is TrainingPhase.DONE, state.line
    assert installed == ["own_1"]
    assert [point[0] for point in state.curve] == [2, 4, 6, 8, 10, 12]
    assert state.held_out[0].step == 0
    assert state.held_out[-1].step == 12
    assert (state.frames.train_count, state.frames.held_out_count) == (8, 2)
    before, after = state.held_out[0].pictures, state.held_out[-1].pictures
    assert [Path(path).name for path in before] == ["frame_04_before.png", "frame_05_before.png"]
    assert all(Path(path).is_file() for path in (*before, *after))
    info = read_model_info(model_folder("own_1"))  # with its hashes
    assert info.figures["held_out"] is True
    assert info.figures["robot_dice"] == pytest.approx(state.held_out[-1].robot_dice)
    assert info.figures["before"]["robot_dice"] == pytest.approx(state.held_out[0].robot_dice)
    assert "on held-out pictures" in state.line
    job.close()


@pytest.mark.slow
def test_a_training_that_is_stopped_keeps_what_it_learnt(small_model: str, qtbot: QtBot, tmp_path: Path) -> None:
    job = job_on(annotate_masks(tmp_path / "images", 8), tmp_path)
    job.start(TrainingRequest("own_1", small_model, 5000, remember=2))
    qtbot.waitUntil(lambda: job.state.step >= 2 or not job.state.is_busy, timeout=LONG_MS)
    job.stop()
    assert job.state.phase is TrainingPhase.STOPPING
    ended(job, qtbot)
    assert job.state.phase is TrainingPhase.DONE, job.state.line
    assert "of 5000 steps" in job.state.line
    assert read_model_info(model_folder("own_1")).training["steps_done"] < 5000
    job.close()


@pytest.mark.slow
def test_a_training_whose_window_has_gone_ends_and_keeps_what_it_learnt(small_model: str, qtbot: QtBot, tmp_path: Path) -> None:
    job = job_on(annotate_masks(tmp_path / "images", 8), tmp_path)
    job.start(TrainingRequest("own_1", small_model, 5000, remember=2))
    qtbot.waitUntil(lambda: job.state.step >= 2 or not job.state.is_busy, timeout=LONG_MS)
    child = job._child
    job.close()
    qtbot.waitUntil(lambda: not child.is_running, timeout=LONG_MS)
    assert read_model_info(model_folder("own_1")).training["steps_done"] < 5000


def test_masks_that_are_still_being_collected_are_left_when_the_window_goes(qtbot: QtBot, tmp_path: Path) -> None:
    begun, go_on = threading.Event(), threading.Event()
    store = annotate_masks(tmp_path / "images", FEWEST)

    def collect() -> tuple[Sequence[StoredAnnotation], Sequence[FoundImage]]:
        begun.set()
        go_on.wait(20.0)
        return collect_from_file(store)

    job = TrainingJob(collect, folder=tmp_path / "training")
    job.start(TrainingRequest("own_1"))
    assert begun.wait(5.0)
    threading.Timer(0.2, go_on.set).start()
    job.close()
    qtbot.wait(50)  # what the thread gave is heard here, if it is heard
    assert job._child is None
    assert not list((tmp_path / "training").glob("*"))


def test_a_process_that_cannot_be_started_is_said(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    job = job_on(annotate_masks(tmp_path / "images", FEWEST), tmp_path)
    job.start(TrainingRequest("own_1"))
    ended(job, qtbot)
    assert job.state.phase is TrainingPhase.FAILED
    assert "cannot be started (No space left on device)" in job.state.line
    job.close()


def test_too_few_masks_are_one_clear_line(qtbot: QtBot, tmp_path: Path) -> None:
    job = job_on(annotate_masks(tmp_path / "images", FEWEST - 1), tmp_path)
    job.start(TrainingRequest("own_1"))
    ended(job, qtbot)
    assert job.state.line.startswith("Not started: 5 images have both a vessel and a robot mask, and training needs 6")
    assert not list((tmp_path / "training").glob("*"))
    job.close()


def test_one_that_is_stopped_before_its_first_step_is_said(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stopped = [sys.executable, "-c", "import sys; sys.stderr.write('interrupted\\n'); sys.exit(130)"]
    monkeypatch.setattr("app.training.model.command_of", lambda *_: stopped)
    job = job_on(annotate_masks(tmp_path / "images", FEWEST), tmp_path)
    job.start(TrainingRequest("own_1"))
    ended(job, qtbot)
    assert job.state.line == "Stopped before the first step; there is no new model"
    job.close()


@pytest.mark.parametrize(
    ("name", "why"), [("", "letters"), ("../x", "letters"), ("a b", "letters"), ("default", "already"), ("x" * 41, "letters")]
)
def test_a_name_that_makes_no_sense_is_refused(name: str, why: str, tmp_path: Path) -> None:
    assert why in name_problem(name)
    job = job_on(tmp_path / "nothing.sqlite", tmp_path)
    job.start(TrainingRequest(name))
    assert job.state.phase is TrainingPhase.FAILED
    assert why in job.state.line
    job.close()


def test_what_fails_in_the_process_is_said(qtbot: QtBot, tmp_path: Path) -> None:
    job = job_on(annotate_masks(tmp_path / "images", FEWEST), tmp_path)
    job.count()
    qtbot.waitUntil(lambda: job.state.line == "6 pictures have both masks.", timeout=LONG_MS)
    job.start(TrainingRequest("own_1", "no_such_model"))
    ended(job, qtbot)
    assert job.state.phase is TrainingPhase.FAILED
    assert "no model 'no_such_model'" in job.state.line
    job.close()


def test_the_dialog_says_how_it_goes(qtbot: QtBot, tmp_path: Path) -> None:
    dialog = TrainingDialog(partial(collect_from_file, annotate_masks(tmp_path / "images", 2)), "images")
    qtbot.addWidget(dialog)
    assert not dialog.isModal()
    assert dialog.name.text() == "own_1"
    assert dialog.init.itemData(0) == "default"
    assert "only when you choose it" in dialog.line
    qtbot.waitUntil(lambda: dialog.line.startswith("2 images have both"), timeout=LONG_MS)
    dialog.start.click()
    assert not dialog.start.isEnabled()
    qtbot.waitUntil(lambda: not dialog.is_busy, timeout=LONG_MS)
    assert "training needs 6" in dialog.line
    assert dialog.start.isEnabled()
    dialog.end()


# ---- choosing a model


def install(name: str) -> None:
    target = own_models() / name
    target.mkdir(parents=True)
    info = json.loads((MODELS / "default" / "model.json").read_text())
    info |= {"name": name, "calibration": None, "calibration_mirrored": None}
    info["figures"] = {"held_out": True, "frames": 4, "vessel_dice": 0.91, "robot_dice": 0.82}
    info["figures"]["before"] = {"vessel_dice": 0.80, "robot_dice": 0.70}
    (target / "model.json").write_text(json.dumps(info))


def test_models_are_listed_with_what_is_known_of_them() -> None:
    install("own_1")
    (own_models() / "broken").mkdir()
    (own_models() / "broken" / "model.json").write_text("{")
    models = {model.name: model for model in installed_models()}
    assert list(models) == ["default", "broken", "own_1"]
    assert not models["default"].is_own
    assert "damaged" in models["broken"].figures
    assert models["own_1"].figures == (
        "Dice vessel 0.80 → 0.91, robot 0.70 → 0.82 on 4 held-out pictures, confidence not calibrated"
    )
    info = models["own_1"].info
    assert figures_line(info.model_copy(update={"figures": {}})) == "not measured, confidence not calibrated"


@pytest.fixture
def side(running: OperatorWindow, tmp_path: Path) -> Iterator[WindowServices]:
    side = WindowServices(running, tmp_path / "state")
    yield side
    side.close()


def choose(side: WindowServices, name: str) -> None:
    side.models.update_entries()
    action = next(one for one in side.models._actions if isinstance(one, QAction) and one.text().startswith(name))
    action.trigger()


def test_another_model_is_used_only_after_the_question(side: WindowServices, running: OperatorWindow, qtbot: QtBot) -> None:
    install("own_1")
    choose(side, "own_1")
    strip = running.panels.offers
    assert "Use model own_1 instead of default?" in strip.text
    assert running.rig.config.perception.segmentation.model == "default"
    strip.answers["No"].click()
    assert running.rig.config.perception.segmentation.model == "default"
    choose(side, "own_1")
    strip.answers["Use own_1"].click()
    assert running.rig.config.perception.segmentation.model == "own_1"
    until(qtbot, lambda: running.shown_tick is not None)
    side.models.update_entries()
    assert [one.text().split(",")[0].split(":")[0] for one in side.models._actions if one.isChecked()] == ["own_1"]


def test_no_other_model_while_armed_also_when_it_was_armed_after_the_question(
    side: WindowServices, running: OperatorWindow, engine: FakeEngine, qtbot: QtBot
) -> None:
    install("own_1")
    choose(side, "own_1")
    engine.pilot.view = DriveView(0.0, mode=Mode.AUTONOMOUS)
    until(qtbot, lambda: running.controls.view is not None and running.controls.view.mode is Mode.AUTONOMOUS)
    running.panels.offers.answers["Use own_1"].click()
    choose(side, "own_1")
    assert "disarm first" in running.panels.toast.text()
    assert running.rig.config.perception.segmentation.model == "default"


def test_the_annotator_window_trains_on_its_own_open_file(qtbot: QtBot, tmp_path: Path) -> None:
    from app.annotator.model import AnnotationModel, QueueEntry
    from app.annotator.window import AnnotatorWindow
    from core.annotation.store import AnnotationStore, ItemKey, find_images
    from core.config.models import PerceptionConfig

    path = annotate_masks(tmp_path / "images", 3)
    with AnnotationStore(path) as store:  # locked for all others while the window has it
        images, _ = find_images(sorted(path.parent.glob("*.png")), store)
        model = AnnotationModel(
            store, [QueueEntry(one, ItemKey(one.sha256, "", "ann", 1)) for one in images], PerceptionConfig(), blind=False
        )
        window = AnnotatorWindow(model, "rater ann")
        qtbot.addWidget(window)
        window.show()
        window.start()
        window.train()
        dialog = window._training
        dialog.start.click()
        qtbot.waitUntil(lambda: not dialog.is_busy, timeout=LONG_MS)
        assert "3 images have both a vessel and a robot mask, and training needs 6" in dialog.line
        window.close()
        assert not dialog.isVisible()
