"""The window that teaches a bench: the whole way with its input events, left and taken up again, faults as one line."""

from __future__ import annotations

import json
import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from app.annotator.editing import MaskMode
from app.teaching import model as model_module
from app.teaching.folder import TeachingStep
from app.training.model import TrainingPhase
from app.ui.texts import OperatorStep
from core.bench.bench import read_bench
from core.control.alerts import Alert, alert_of
from core.control.drive_view import DriveNews, DriveView
from core.control.gate import Source
from core.control.modes import Hindrance
from core.learning.model_writer import save_model
from core.perception.model_file import own_models
from core.perception.segmentation import Probability
from core.perception.unet import DualUNet, UNetShape
from core.types import Image
from tests.app.teaching.bench_hand import LONG_MS, BenchHand, PictureFeed
from tests.app.teaching.test_folder import drive, opened, segment
from tests.core.learning.toy_bench import toy_picture, toy_robot

OpenHand = Callable[..., BenchHand]
TEACHES = """
import json, sys
from pathlib import Path
source, out = sys.argv[1], Path(sys.argv[3])
assert (Path(source) / "teaching.json").is_file()
picture = str(next(Path(source, "images").glob("*.png")))
dice = {"vessel_dice": 0.9, "robot_dice": 0.5}
print(json.dumps({"held_out_step": 0, "pictures": [picture]} | dice))
print(json.dumps({"step": 10, "steps": 20, "loss": 0.5, "left_s": 60} | dice))
print(json.dumps({"step": 20, "steps": 20, "loss": 0.3, "left_s": 0} | dice))
print(json.dumps({"held_out_step": 20, "pictures": [picture]} | dice | {"robot_dice": 0.95}))
held_out = {"frames": 5, "answered": 5, "right": 4, "vessel_dice": 0.9, "robot_dice": 0.95, "head_px": 1.2, "theta_deg": 0.8}
print(json.dumps({"model": str(out), "time_s": 290.0, "steps": 20, "held_out": held_out}))
"""
"""Stands for ``teach``: tells what a training tells, in a moment."""


def stands_for_teach(monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    monkeypatch.setattr(model_module, "command_of", lambda _name, *arguments: [sys.executable, "-c", script, *arguments])


@pytest.fixture(scope="session")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which all is taken, at the step of moving the robot."""
    folder = tmp_path_factory.mktemp("driven")
    work = opened(folder)
    work.add_empty([toy_picture(seed=number) for number in range(8)])
    work.set_vessel(work.proposed_vessel())
    drive(work, 6)
    work.go(TeachingStep.MOVE)
    work.release()
    return folder / "teaching"


@pytest.fixture
def open_hand(qtbot: QtBot, tmp_path: Path) -> Iterator[OpenHand]:
    """Opens the window on the toy bench, on a copy of a folder; again: another run of the program on the same one."""
    hands: list[BenchHand] = []

    def make(before: Path | None = None, step: TeachingStep = TeachingStep.MOVE) -> BenchHand:
        if before is not None:
            shutil.copytree(before, tmp_path / "teaching")
            record = tmp_path / "teaching" / "teaching.json"
            record.write_text(json.dumps(json.loads(record.read_text()) | {"step": int(step)}))
        feed = PictureFeed([toy_picture(seed=number) for number in range(9)])
        hand = BenchHand(qtbot, tmp_path / "teaching", feed, segment)
        hands.append(hand)
        hand.open()
        return hand

    yield make
    for hand in hands:
        hand.end()


def to_the_robot(hand: BenchHand) -> None:
    """Empty picture and vessel, to the page on which the robot is moved."""
    window = hand.window
    hand.click(window.empty_page.take)
    assert window.focusWidget() is window.next_button, "Enter goes on"
    hand.click(window.next_button)
    hand.click(window.next_button)
    assert window.page is window.move_page


def move_robot(hand: BenchHand, count: int = 6) -> None:
    for branch in (0, 1):
        for number in range(count):
            hand.show(toy_picture(toy_robot(branch, 0.2 + 0.75 * number / (count - 1)), seed=10 * branch + number))


# ---- the whole way


def test_the_whole_way_to_a_model_in_use(open_hand: OpenHand, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot) -> None:
    stands_for_teach(monkeypatch, TEACHES)
    hand = open_hand()
    hand.model._known = lambda: None
    window, page = hand.window, hand.window.train_page
    assert window.page is window.empty_page
    assert [window.steps.item(row).text().partition("  ")[2] for row in range(5)] == [
        "Empty bench",
        "Vessel",
        "Move the robot",
        "Look through",
        "Train",
    ]
    assert not window.isModal()
    assert not window.next_button.isEnabled()
    to_the_robot(hand)
    move_robot(hand)
    hand.click(window.next_button)
    assert window.frames_page.list.count() == len(hand.model.view.frames)
    hand.click(window.next_button)
    assert not window.next_button.isEnabled()
    hand.click(page.start)
    qtbot.waitUntil(lambda: hand.model.training.phase is TrainingPhase.DONE, timeout=LONG_MS)
    hand.wait()
    assert "4 of these" in page.table.text()
    assert window.message.startswith("The twin has no phantom of this bench: ")
    assert window.next_button.text() == "&Use it"
    hand.refusal = "the program is armed"
    hand.click(window.next_button)
    assert window.message == "Not used: the program is armed"
    hand.refusal = ""
    hand.click(window.next_button)
    assert hand.used == [hand.model.view.model]
    assert "It is in use." in page.words.text()
    assert not window.next_button.isEnabled()
    hand.in_use = "default"
    qtbot.waitUntil(window.next_button.isEnabled, timeout=LONG_MS)
    assert "Use it puts it into force" in page.words.text()
    assert hand.events == 8, "one of them in vain"


# ---- left and taken up again


def test_closed_at_any_step_it_opens_there_again(open_hand: OpenHand, driven: Path) -> None:
    hand = open_hand(driven)
    taken = [frame.stem for frame in hand.model.view.frames]
    hand.click(hand.window.close_button)
    assert not hand.window.isVisible()
    assert not hand.model.is_watching
    hand.window.open()
    assert hand.window.page is hand.window.move_page
    assert hand.model.is_watching
    hand.end()
    again = open_hand()
    assert again.window.page is again.window.move_page
    assert [frame.stem for frame in again.model.view.frames] == taken


def test_back_and_on_lose_nothing_and_starting_over_is_asked_first(open_hand: OpenHand, driven: Path) -> None:
    hand = open_hand(driven)
    window, count = hand.window, len(hand.model.view.frames)
    for button, page in ((window.back_button, window.empty_page), (window.next_button, window.move_page)):
        hand.click(button)
        hand.click(button)
        assert window.page is page
    assert len(hand.model.view.frames) == count
    for _ in range(2):
        hand.click(window.over_button)
        QTest.keyClick(window.question._no, Qt.Key.Key_Escape)
        assert window.isVisible()
        assert not window.question.text
    hand.click(window.over_button)
    assert window.question.text == "Forget pictures, vessel and frames of this bench?"
    window.question._yes.click()
    hand.wait()
    assert window.page is window.empty_page
    assert hand.model.view.empty is None


def test_another_program_that_has_the_folder_is_named_and_nothing_is_lost(open_hand: OpenHand, driven: Path) -> None:
    hand = open_hand(driven)
    count = len(hand.model.view.frames)
    other = open_hand()
    assert other.window.message.startswith("another LumenPilot teaches this bench now")
    assert not other.model.view.frames
    other.click(other.window.empty_page.take)
    assert other.window.message.startswith("another LumenPilot teaches this bench now")
    other.window.close()
    hand.end()
    other.open()
    assert len(other.model.view.frames) == count


def test_what_was_not_read_is_read_before_anything_is_taken(open_hand: OpenHand, driven: Path) -> None:
    hand = open_hand(driven)
    count, other = len(hand.model.view.frames), open_hand()
    hand.end()
    other.click(other.window.empty_page.take)
    assert len(other.model.view.frames) == count > 0


def test_a_bench_that_is_left_while_its_frames_are_read_is_left_at_once_and_keeps_them(
    open_hand: OpenHand, driven: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hand = open_hand(driven)
    count, folder, may_go_on, read = len(hand.model.view.frames), hand.model._folder, threading.Event(), list[str]()
    taken = folder._taken
    monkeypatch.setattr(folder, "_taken", lambda stem, *more: (may_go_on.wait() and read.append(stem)) or taken(stem, *more))
    hand.model.load()
    hand.window.end()
    may_go_on.set()
    assert hand.model.wait()
    assert len(read) <= 1
    assert len(open_hand().model.view.frames) == count


# ---- the pages


def test_looks_at_the_live_picture_leave_the_keyboard_on_stop(open_hand: OpenHand, driven: Path) -> None:
    hand = open_hand(driven)
    hand.window.stop_button.setFocus()
    hand.show(toy_picture(toy_robot(0, 0.5), seed=3))
    assert hand.window.focusWidget() is hand.window.stop_button


def test_the_servos_are_switched_on_and_alerts_are_seen_in_this_window(open_hand: OpenHand) -> None:
    hand = open_hand()
    QTest.keyClick(hand.window, Qt.Key.Key_F3)
    assert hand.asked == [OperatorStep.SERVOS_ON]
    alert = Alert(Hindrance.SERVOS_UNCHECKED, alert_of(Hindrance.SERVOS_UNCHECKED, simulated=True))
    hand.window.show_news(DriveNews(DriveView(1.0), (alert,)))
    assert "Switch them on" in hand.window.alerts.texts[0]
    assert hand.window.picture.caption == "Live: servos not in use (F3)"
    hand.window.show_news(DriveNews(DriveView(1.0, servos_on=True, permitted=Source.OPERATOR)))
    assert hand.window.picture.caption == "Live: you steer"


def test_three_places_make_an_empty_picture(open_hand: OpenHand) -> None:
    hand = open_hand()
    page = hand.window.empty_page
    for branch, share in ((0, 0.95), (1, 0.95), (0, 0.4)):
        hand.feed.pictures = [toy_picture(toy_robot(branch, share), seed=number) for number in range(3)]
        hand.click(page.place)
    assert hand.model.view.is_computed
    assert hand.window.next_button.isEnabled()
    assert "not known (dark)" in page.found.text() or "Good" in page.found.text()


def test_a_vessel_that_the_network_does_not_see_is_painted(qtbot: QtBot, tmp_path: Path) -> None:
    def sees_none(_image: Image) -> tuple[Probability, Probability]:
        return np.zeros((480, 640), np.float32), np.zeros((480, 640), np.float32)

    hand = BenchHand(qtbot, tmp_path / "teaching", PictureFeed([toy_picture(seed=number) for number in range(9)]), sees_none)
    hand.open()
    window, page = hand.window, hand.window.vessel_page
    hand.click(window.empty_page.take)
    hand.click(window.next_button)
    assert page.editor.canvas.mask_mode is MaskMode.TUBE
    assert "sees no vessel" in page.words.text()
    assert not window.next_button.isEnabled()
    canvas = page.editor.canvas
    canvas.resize_circle(26.0 / canvas.editor.radius_px)
    course = [canvas.view.to_screen(point) for point in ((4, 240), (240, 242), (320, 240), (400, 190), (480, 140), (580, 100))]
    hand.drag(canvas, course)
    qtbot.waitUntil(window.next_button.isEnabled, timeout=LONG_MS)  # walls are found beside the window
    hand.click(page.undo)
    assert not window.next_button.isEnabled()
    hand.drag(canvas, course)
    qtbot.waitUntil(window.next_button.isEnabled, timeout=LONG_MS)
    hand.click(window.next_button)
    assert window.page is window.move_page
    assert hand.model.view.vessel[240, 100]
    hand.end()


def test_what_is_missing_and_what_was_rejected_is_said(open_hand: OpenHand) -> None:
    hand = open_hand()
    to_the_robot(hand)
    page = hand.window.move_page
    hand.show(toy_picture(toy_robot(0, 0.95), seed=1))
    assert page.said.text() == "Frame 1 taken: a new place"
    assert "the branch at the lower right" in page.lacks.text()
    assert "a bend of the head" in page.lacks.text()
    hand.show(np.roll(toy_picture(toy_robot(0, 0.6), seed=2), 30, axis=1))
    assert page.said.text().startswith("Not taken: ")
    assert "the frames stay" in page.said.text()
    hand.click(page.pause)
    assert not hand.model.is_watching


def test_a_frame_is_left_out_and_its_mask_corrected(open_hand: OpenHand, driven: Path, qtbot: QtBot) -> None:
    hand = open_hand(driven, TeachingStep.FRAMES)
    page, view = hand.window.frames_page, hand.model.view
    page.list.setCurrentRow(1)
    hand.click(page.out)
    qtbot.waitUntil(lambda: hand.model.view.frames[1].is_left_out, timeout=LONG_MS)
    assert page.list.item(1).text() == "left out"
    assert page.out.text() == "&Take in again"
    page.list.setCurrentRow(2)
    before = view.frames[2].frame.robot
    canvas = page.canvas
    hand.drag(canvas, [canvas.view.to_screen(point) for point in ((300, 60), (340, 60))])
    qtbot.waitUntil(lambda: hand.model.view.frames[2].is_corrected, timeout=LONG_MS)
    after = hand.model.view.frames[2]
    assert after.frame.robot[60, 320]
    assert not before[60, 320]
    hand.click(page.undo)
    qtbot.waitUntil(lambda: not hand.model.view.frames[2].is_corrected, timeout=LONG_MS)
    assert (hand.model.view.frames[2].frame.robot == before).all()


def test_a_stroke_is_kept_when_another_frame_is_chosen_or_the_window_closed_at_once(
    open_hand: OpenHand, driven: Path, qtbot: QtBot
) -> None:
    hand = open_hand(driven, TeachingStep.FRAMES)
    page, canvas = hand.window.frames_page, hand.window.frames_page.canvas
    page.list.setCurrentRow(1)
    hand.drag(canvas, [canvas.view.to_screen(point) for point in ((300, 60), (340, 60))])
    page.list.setCurrentRow(2)
    hand.window.close()
    hand.end()
    again = open_hand()
    assert [taken.is_corrected for taken in again.model.view.frames[:4]] == [False, True, False, False]


def test_a_vessel_that_is_drawn_is_there_after_back_and_after_closing(open_hand: OpenHand) -> None:
    hand = open_hand()
    window, page = hand.window, hand.window.vessel_page
    hand.click(window.empty_page.take)
    hand.click(window.next_button)
    page.editor.set_mode(MaskMode.BRUSH)
    canvas = page.editor.canvas
    hand.drag(canvas, [canvas.view.to_screen(point) for point in ((300, 40), (340, 40))])
    hand.click(window.back_button)
    hand.click(window.next_button)
    assert page.editor.vessel_mask[40, 320]
    window.close()
    hand.end()
    again = open_hand()
    assert again.window.page is again.window.vessel_page
    assert again.window.vessel_page.editor.vessel_mask[40, 320]


# ---- faults: one line, nothing lost


def test_an_empty_picture_is_not_taken_of_one_that_is_not_live_or_in_which_something_moves(
    open_hand: OpenHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(model_module, "_SILENT_MS", 80)
    hand = open_hand()
    hand.feed.is_live = False
    hand.click(hand.window.empty_page.take)
    assert hand.window.message.startswith("The picture is not live")
    hand.feed.is_live = True

    hand.feed.pictures = [toy_picture(toy_robot(0, 0.1 * number), seed=number) for number in range(9)]
    hand.click(hand.window.empty_page.take)
    assert hand.window.message.startswith("something moved while the pictures were taken")
    assert hand.model.view.empty is None


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("import sys; sys.stderr.write('error: no room\\n'); sys.exit(2)", "Training failed: no room"),
        ("import sys; sys.exit(130)", "Stopped. Frames and what was learnt are kept"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "Training failed: it was ended by signal 9"),
    ],
)
def test_a_training_that_fails_loses_no_frame(
    script: str, said: str, open_hand: OpenHand, driven: Path, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot
) -> None:
    stands_for_teach(monkeypatch, script)
    hand = open_hand(driven, TeachingStep.TRAIN)
    count = len(hand.model.view.frames)
    hand.click(hand.window.train_page.start)
    qtbot.waitUntil(lambda: hand.model.training.phase is TrainingPhase.FAILED, timeout=LONG_MS)
    assert hand.window.train_page.words.text().startswith(said)
    assert hand.window.train_page.start.isEnabled()
    assert not hand.window.next_button.isEnabled()
    assert len(hand.model.view.frames) == count


def test_a_training_is_stopped_and_goes_on_while_the_window_is_closed(
    open_hand: OpenHand, driven: Path, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot
) -> None:
    stands_for_teach(monkeypatch, "import time; time.sleep(60)")
    hand = open_hand(driven, TeachingStep.TRAIN)
    hand.click(hand.window.train_page.start)
    assert hand.window.close_button.text() == "&Close, go on training"
    hand.window.close()
    assert hand.model.is_training
    hand.window.open()
    assert hand.window.train_page.words.text() == "Loading the network and frames of the twin, about 5 min left"
    hand.click(hand.window.train_page.stop)
    qtbot.waitUntil(lambda: not hand.model.is_training, timeout=LONG_MS)
    assert hand.model.training.line.startswith("Stopped")


def test_stop_while_the_frames_are_written_starts_no_training(
    open_hand: OpenHand, driven: Path, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot
) -> None:
    """Also after the last frame, when the report that all is written waits for the window."""
    stands_for_teach(monkeypatch, "import time; time.sleep(60)")
    hand = open_hand(driven, TeachingStep.TRAIN)
    for writes in (hand.model._folder.teaching_set, lambda: driven):
        monkeypatch.setattr(hand.model._folder, "teaching_set", writes)
        hand.model.train("mine", 5)
        hand.model.stop_training()
        assert hand.model.training.phase is TrainingPhase.STOPPING
        qtbot.waitUntil(lambda: not hand.model.is_training, timeout=LONG_MS)
        assert hand.model.training.phase is TrainingPhase.FAILED and hand.model.training.line.startswith("Stopped")
        assert hand.model._child is None


# ---- input events


TEACHES_LITTLE = """
import sys
import app.commands.teach as teach
from app.cli import main
teach._EXAMPLES, teach._REMEMBER, teach._MOST_STEPS = 2, 4, 6
sys.argv = ["main.py", "teach", *sys.argv[1:], "--init", {model!r}, "--minutes", "60"]
sys.exit(main())
"""
"""The real command with few steps of a small network, which no slow computer cuts short."""


@pytest.mark.slow
def test_a_real_training_shows_how_it_goes_and_makes_a_model(
    open_hand: OpenHand, driven: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot
) -> None:
    save_model(DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)), tmp_path / "small", training={}, figures={})
    stands_for_teach(monkeypatch, TEACHES_LITTLE.format(model=str(tmp_path / "small")))
    hand = open_hand(driven, TeachingStep.TRAIN)
    page, name = hand.window.train_page, hand.window.train_page.model_name.text()
    hand.click(page.start)
    qtbot.waitUntil(lambda: not hand.model.is_training, timeout=5 * LONG_MS)
    hand.wait()
    state = hand.model.training
    assert state.phase is TrainingPhase.DONE, state.line
    assert state.step == state.steps == 6
    assert [Path(path).is_file() for path in (*state.held_out[0].pictures, *state.held_out[-1].pictures)].count(False) == 0
    assert hand.model.view.model == name
    assert hand.model.result is not None
    assert read_bench(own_models() / name / "bench").vessel is not None
    shutil.rmtree(own_models() / name)
