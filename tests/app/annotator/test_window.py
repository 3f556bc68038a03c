"""The annotator window, driven by real mouse and key events: what a rater does is what is kept."""

from __future__ import annotations

import json
import logging
import math
import sqlite3
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDropEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.annotator.canvas import AnnotationCanvas
from app.annotator.editing import RADIUS_NOTCH, MaskMode, Tool
from app.annotator.model import AnnotationModel, QueueEntry
from app.annotator.panels import Answer
from app.annotator.window import AnnotatorWindow
from core.annotation.exchange import Proposal, proposal_of
from core.annotation.masks import fill
from core.annotation.model import (
    TAKES_LINES,
    AngleProvenance,
    Annotation,
    AnnotationError,
    ImageView,
    MaskPolygon,
    MaskTarget,
    measure_lines,
)
from core.annotation.store import AnnotationStore, ItemKey, StoredAnnotation, find_images
from core.config.models import PerceptionConfig
from core.evaluation.accuracy import TrueMasks
from core.learning.dataset import write_png
from core.perception.pipeline import Pipeline
from core.types import Frame, Point, PoseState, Scene
from tests.app.fakes import make_scene, turn_the_wheel

Key = Qt.Key
SIZE = (640, 480)
ROBOT = ((200.0, 180.0), (260.0, 190.0), (320.0, 210.0))
VESSEL = ((260.0, 215.0), (400.0, 215.0))


class Rater:
    """A window over some pictures; sends it real events and counts them."""

    def __init__(self, qtbot: QtBot, folder: Path, views: tuple[ImageView, ...], blind: bool, hides_angle: bool) -> None:
        self.store_path = folder / "a.sqlite"
        paths = [folder / f"{k}.png" for k in range(3)]
        for k, path in enumerate(paths):
            if not path.exists():
                write_png(path, np.full((SIZE[1], SIZE[0], 3), 60 + 40 * k, np.uint8))
        store = AnnotationStore(self.store_path)
        images, _ = find_images(paths, store)
        study = "pilot" if blind else ""
        items = [
            QueueEntry(image, ItemKey(image.sha256, study, "ann", k), view) for k, view in enumerate(views, 1) for image in images
        ]
        model = AnnotationModel(store, items, PerceptionConfig(), blind=blind, hides_angle=hides_angle)
        self.window = AnnotatorWindow(model, "rater ann")
        self.events = 0
        self.qtbot = qtbot
        qtbot.addWidget(self.window)
        self.window.resize(1280, 720)
        self.window.show()
        self.window.start()
        qtbot.waitUntil(lambda: self.model.is_open)

    @property
    def model(self) -> AnnotationModel:
        return self.window.model

    @property
    def canvas(self) -> AnnotationCanvas:
        return self.window.panels.canvas

    @property
    def drawn(self) -> Annotation:
        return self.model.annotation

    @property
    def message(self) -> str:
        return self.window.panels.toast.text()

    def at(self, point: Point) -> QPoint:
        return QPoint(*(round(value) for value in self.canvas.view.to_screen(point)))

    def click(self, *points: Point, button: Qt.MouseButton = Qt.MouseButton.LeftButton) -> None:
        for point in points:
            QTest.mouseMove(self.canvas, self.at(point))
            QTest.mouseClick(self.canvas, button, pos=self.at(point))
            self.events += 1

    def drag(self, start: Point, end: Point) -> None:
        QTest.mousePress(self.canvas, Qt.MouseButton.LeftButton, pos=self.at(start))
        QTest.mouseMove(self.canvas, self.at(((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)))
        QTest.mouseMove(self.canvas, self.at(end))
        QTest.mouseRelease(self.canvas, Qt.MouseButton.LeftButton, pos=self.at(end))
        self.events += 1

    def press(self, *keys: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        for key in keys:
            QTest.keyClick(QApplication.focusWidget() or self.canvas, key, modifier)
            self.events += 1
            if not self.model.is_open:
                self.qtbot.waitUntil(lambda: self.model.is_open)

    def kept(self) -> list[StoredAnnotation]:
        """What a reader finds in the file, once the window is closed."""
        self.window.close()
        with AnnotationStore(self.store_path, read_only=True) as store:
            return store.annotations()


MakeRater = Callable[..., Rater]


@pytest.fixture
def make(qtbot: QtBot, tmp_path: Path) -> Iterator[MakeRater]:
    raters = []

    def made(views: tuple[ImageView, ...] = (ImageView.AS_IS,), blind: bool = False, hides_angle: bool = False) -> Rater:
        raters.append(Rater(qtbot, tmp_path, views, blind, hides_angle))
        return raters[-1]

    yield made
    for rater in raters:
        rater.window.close()


@pytest.fixture
def rater(make: MakeRater) -> Rater:
    return make()


def test_an_image_in_at_most_twelve_events_with_the_angle_of_the_method(rater: Rater) -> None:
    rater.click(*ROBOT)
    rater.press(Key.Key_Return)
    rater.click(*VESSEL)
    rater.press(Key.Key_Return, Key.Key_Return, Key.Key_Return)
    assert rater.events <= 12
    assert rater.model.index == 1, "on to the next"
    (one,) = rater.kept()
    placed = measure_lines(one.content, SIZE, PerceptionConfig()).pose
    asked = measure_lines(Annotation(ROBOT, VESSEL), SIZE, PerceptionConfig()).pose
    assert one.theta_deg == pytest.approx(placed.theta_deg, abs=1e-9)
    # clicks lie on whole screen pixels, up to 0.45 image pixels off: 40 px turn by about a degree then
    assert one.theta_deg == pytest.approx(asked.theta_deg, abs=math.degrees(2 * 0.45 / 40))
    assert one.content.state is asked.state


def test_an_angle_with_its_state_takes_at_most_eight_events_and_from_the_proposal_four(rater: Rater) -> None:
    """Clicks and keys, up to the next image: two points a line; Enter ends the first, the state ends the second."""
    rater.click(ROBOT[0], ROBOT[-1])
    rater.press(Key.Key_Return)
    rater.click(*VESSEL)
    rater.press(Key.Key_B, Key.Key_Return)
    assert (rater.model.index, rater.model.finished, rater.events) == (1, 1, 7)
    assert rater.events <= 8
    rater.events = 0
    pose = measure_lines(Annotation(ROBOT, VESSEL), SIZE, PerceptionConfig()).pose
    rater.model._proposals[rater.model.item.image.sha256] = Proposal(Annotation(ROBOT, VESSEL, PoseState.B), pose, 0.8)
    rater.press(Key.Key_G, Key.Key_Return, Key.Key_Return)
    assert (rater.model.index, rater.model.finished, rater.events) == (2, 2, 3)
    assert rater.events <= 4
    first, second = sorted(rater.kept(), key=lambda one: one.changed_utc)
    assert (first.provenance, second.provenance) == (AngleProvenance.MANUAL, AngleProvenance.ALGORITHM)


def test_answers_are_chips_and_no_robot_is_one_of_its_own(rater: Rater) -> None:
    chips = rater.window.panels.bar._answers
    assert len(chips) == 6 and chips[Answer.NO_ROBOT].text() == "No robot"
    QTest.mouseClick(chips[Answer.NO_ROBOT], Qt.MouseButton.LeftButton)
    assert rater.drawn == Annotation(no_robot=True)
    assert chips[Answer.NO_ROBOT].isChecked()
    assert rater.window.panels.readout.state_text == "No robot"
    rater.press(Key.Key_O)
    assert rater.drawn == Annotation(), "given again it is taken back"
    rater.press(Key.Key_O, Key.Key_C)
    assert (rater.drawn.no_robot, rater.drawn.state) == (False, PoseState.C)
    rater.press(Key.Key_O, Key.Key_Return)
    assert rater.model.index == 1, "it is an answer: Enter goes on"
    (one,) = rater.kept()
    assert one.content == Annotation(no_robot=True)


def test_a_blind_study_hides_names_theta_and_the_state_of_the_lines_until_the_answer_and_offers_no_proposals(
    make: MakeRater,
) -> None:
    rater = make(blind=True, hides_angle=True)
    readout, chips = rater.window.panels.readout, rater.window.panels.bar._answers
    rater.click(ROBOT[0], ROBOT[-1])
    rater.press(Key.Key_Return)
    rater.click(VESSEL[0])
    QTest.mouseMove(rater.canvas, rater.at(VESSEL[1]))
    assert readout.angle_text == "hidden"
    rater.click(VESSEL[1])
    assert rater.canvas.editor.drawing.readout.robot_vector is None, "nor as an arrow in the picture"
    assert "The lines say" not in readout.advice_text
    assert not any(chip._is_next for chip in chips.values())
    rater.press(Key.Key_Return, Key.Key_Return)
    assert rater.drawn.state is None, "Enter takes no state that is not seen"
    assert "choose the state yourself" in rater.message
    rater.press(Key.Key_D)
    assert readout.angle_text.endswith("°")
    assert rater.canvas.editor.drawing.readout.pose is not None
    assert ".png" not in rater.window.panels.header._title.text()
    rater.press(Key.Key_H)
    assert "hidden" in rater.message
    rater.press(Key.Key_G)
    assert (rater.model.proposal, rater.canvas.editor.drawing.proposal) == (None, None)
    picture = rater.window.panels.queue._model.index(0).data(Qt.ItemDataRole.DecorationRole)
    assert picture is None, "it would show what is mirrored"
    rater.press(Key.Key_V)
    assert rater.message == "A blind study: masks are drawn outside it"


def test_short_lines_and_what_the_algorithm_drew_are_marked_in_the_list(rater: Rater) -> None:
    queue = rater.window.panels.queue._model
    rater.click((300.0, 210.0), (320.0, 210.0))
    rater.press(Key.Key_Return)
    rater.click(*VESSEL)
    assert queue.particulars(0) == ["short"]
    assert "; short: 2" in rater.window.panels.readout.accessibleDescription()
    rater.model.edit(TAKES_LINES, Annotation(ROBOT, VESSEL))
    assert queue.particulars(0) == ["algorithm"]
    rater.drag(ROBOT[0], (190.0, 170.0))
    assert queue.particulars(0) == ["corrected"]
    listed = rater.window.panels.queue
    listed._filter.setCurrentIndex(listed._filter.findText("Not drawn by hand"))
    assert [listed._view.isRowHidden(row) for row in range(3)] == [False, True, True]


def test_escape_lets_go_of_a_line_and_a_click_goes_on(rater: Rater) -> None:
    rater.click(ROBOT[0])
    QTest.mouseMove(rater.canvas, rater.at(ROBOT[1]))
    assert rater.canvas.editor.drawing.rubber_band
    rater.press(Key.Key_Escape)
    QTest.mouseMove(rater.canvas, rater.at(ROBOT[2]))
    assert not rater.canvas.editor.drawing.rubber_band
    rater.click(ROBOT[2])
    assert len(rater.drawn.robot) == 2


def test_a_file_of_another_program_that_is_dropped_is_imported(rater: Rater, tmp_path: Path) -> None:
    shapes = [{"label": "robot", "shape_type": "linestrip", "points": [[10.5, 10.5], [90.5, 10.5]]}]
    path = tmp_path / "1.json"
    path.write_text(json.dumps({"imagePath": "1.png", "imageWidth": 640, "imageHeight": 480, "shapes": shapes}))
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path))])
    at = QPointF(50, 50)
    buttons, keys = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    with rater.qtbot.waitSignal(rater.model.imported) as said:
        rater.window.dropEvent(QDropEvent(at, Qt.DropAction.CopyAction, data, buttons, keys))
    assert said.args == [1, []]
    rater.press(Key.Key_N)
    assert rater.drawn.robot == ((10.0, 10.0), (90.0, 10.0))
    rater.press(Key.Key_Z, modifier=Qt.KeyboardModifier.ControlModifier)
    assert rater.drawn == Annotation(), "an import can be undone"


def test_exports_and_reports_are_made_by_other_processes_from_a_copy(
    rater: Rater, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, ...]] = []
    count = "import sqlite3, sys; n, = sqlite3.connect(sys.argv[1]).execute('SELECT count(*) FROM annotations').fetchone(); "

    def command(*arguments: str) -> list[str]:
        asked.append(arguments)
        copy, out = (arguments[arguments.index(name) + 1] for name in ("--store", "--out"))
        return [sys.executable, "-c", f"{count}open(sys.argv[2], 'w').write(str(n))", copy, out]

    monkeypatch.setattr("app.ui.opening.command_of", command)
    rater.press(Key.Key_X)
    rater.window.files.export("coco", tmp_path / "masks")
    rater.qtbot.waitUntil(lambda: "Written" in rater.message, timeout=30_000)
    assert (tmp_path / "masks.json").read_text() == "1"
    assert asked[0][4:] == ("--export", "coco", "--out", str(tmp_path / "masks.json"), "--study", "")
    assert not list(tmp_path.glob(".copy_*"))


def test_the_next_rater_is_asked_for_and_this_window_closes(rater: Rater) -> None:
    rater.window._on_rater("  ")
    assert rater.window.isVisible()
    rater.window._on_rater("bob")
    assert (rater.window.isVisible(), rater.window.next_rater) == (False, "bob")


def test_the_readout_is_live_and_says_what_is_missing(rater: Rater) -> None:
    readout = rater.window.panels.readout
    assert readout.angle_text == "–"
    assert readout.advice_text == "Draw the robot, from its tail to its head"
    rater.click(*ROBOT)
    assert readout.advice_text == "Draw the vessel's centerline beside the head"
    rater.press(Key.Key_Return)
    rater.click(VESSEL[0])
    QTest.mouseMove(rater.canvas, rater.at(VESSEL[1]))
    live = readout.angle_text
    assert live.endswith("°"), "before the second click"
    rater.click(VESSEL[1])
    assert readout.angle_text == live
    assert "The lines say" in readout.advice_text
    rater.press(Key.Key_D)
    assert readout.state_text == "Crossed"
    rater.press(Key.Key_X)
    assert (readout.state_text, rater.drawn.state) == ("Can't tell", None)
    rater.press(Key.Key_X)
    assert (readout.state_text, rater.drawn.state) == ("Crossed", PoseState.D), "as it was before"


def test_everything_by_keyboard(rater: Rater) -> None:
    """A cross moved by arrows, points set by Insert; Shift moves 10 px, Ctrl 0.1 px."""
    shift, ctrl = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier
    rater.canvas._cursor = None
    rater.press(Key.Key_Left, modifier=shift)  # from the middle, (319.5, 239.5)
    rater.press(Key.Key_Insert)
    rater.press(*[Key.Key_Right] * 6, modifier=shift)
    rater.press(Key.Key_Insert, Key.Key_Return)
    assert rater.drawn.robot == ((309.5, 239.5), (369.5, 239.5))
    assert rater.canvas.tool is Tool.VESSEL
    rater.press(Key.Key_Down, modifier=shift)
    rater.press(Key.Key_Insert)
    rater.press(*[Key.Key_Left] * 6, modifier=shift)
    rater.press(Key.Key_Insert, Key.Key_Return)
    assert rater.window.panels.readout.angle_text == "0.0°"
    rater.press(Key.Key_1, Key.Key_Tab)
    rater.press(Key.Key_Up)
    rater.press(Key.Key_Right, modifier=ctrl)
    assert rater.drawn.robot[-1] == pytest.approx((369.6, 238.5))
    rater.press(Key.Key_Delete)
    assert len(rater.drawn.robot) == 1
    rater.press(Key.Key_Z, modifier=ctrl)
    assert rater.drawn.robot[-1] == pytest.approx((369.6, 238.5))


def test_undo_and_redo_reach_over_a_restart(make: MakeRater) -> None:
    ctrl, both = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    first = make()
    first.click(*ROBOT)
    before = first.drawn
    first.press(Key.Key_Z, modifier=ctrl)
    first.window.close()
    again = make()
    assert again.model.index == 0
    again.press(Key.Key_Z, modifier=both)
    assert again.drawn == before
    again.press(*[Key.Key_Z] * 3, modifier=ctrl)
    assert again.drawn == Annotation()
    again.press(Key.Key_Z, modifier=ctrl)
    assert again.message == "Nothing to undo"


def test_a_right_click_that_misses_answers_nothing(rater: Rater) -> None:
    for line in (ROBOT, VESSEL):
        rater.click(*line)
        rater.press(Key.Key_Return)
    beside = rater.at(ROBOT[1]) + QPoint(0, 14)
    for _ in range(2):
        QTest.mouseClick(rater.canvas, Qt.MouseButton.RightButton, pos=beside)
    assert (rater.drawn.state, rater.model.index, len(rater.drawn.robot)) == (None, 0, 3)


OUTLINE: tuple[Point, ...] = ((300.0, 300.0), (400.0, 300.0), (400.0, 400.0), (300.0, 400.0))


@pytest.mark.parametrize("key", [Key.Key_4, Key.Key_N])
def test_an_outline_is_not_lost_by_what_comes_next(rater: Rater, key: Qt.Key) -> None:
    rater.press(Key.Key_3)
    rater.click(*OUTLINE)
    rater.press(key)
    if rater.model.index:
        rater.press(Key.Key_P)
    (mask,) = rater.drawn.masks
    assert len(mask.points) == 4
    rater.press(Key.Key_3)
    rater.click(*((x + 150.0, y) for x, y in OUTLINE))
    assert len(rater.kept()[0].content.masks) == 2, "closing the window completes it, too"


def test_a_key_while_the_button_is_down_loses_no_point(rater: Rater) -> None:
    rater.click(*ROBOT[:2])
    QTest.mouseMove(rater.canvas, rater.at(ROBOT[2]))
    QTest.mousePress(rater.canvas, Qt.MouseButton.LeftButton, pos=rater.at(ROBOT[2]))
    rater.press(Key.Key_B)
    QTest.mouseRelease(rater.canvas, Qt.MouseButton.LeftButton, pos=rater.at(ROBOT[2]))
    assert (len(rater.drawn.robot), rater.drawn.state) == (3, PoseState.B)


def test_a_stroke_is_not_lost_by_a_key_or_another_button(rater: Rater) -> None:
    rater.press(Key.Key_3, Key.Key_T)
    QTest.mousePress(rater.canvas, Qt.MouseButton.LeftButton, pos=rater.at((300.0, 300.0)))
    QTest.mouseMove(rater.canvas, rater.at((350.0, 300.0)))
    QTest.mousePress(rater.canvas, Qt.MouseButton.RightButton, pos=rater.at((350.0, 300.0)))
    QTest.mouseMove(rater.canvas, rater.at((400.0, 300.0)))
    rater.press(Key.Key_N)
    QTest.mouseRelease(rater.canvas, Qt.MouseButton.LeftButton, pos=rater.at((400.0, 300.0)))
    rater.press(Key.Key_P)
    (mask,) = rater.drawn.masks
    xs = [x for x, _ in mask.points]
    assert max(xs) - min(xs) > 100.0


def test_a_double_click_ends_a_line_and_on_one_of_its_points_answers_nothing(rater: Rater) -> None:
    rater.click((200.0, 180.0), (320.0, 180.0))
    QTest.mouseDClick(rater.canvas, Qt.MouseButton.LeftButton, pos=rater.at((320.0, 180.0)))
    QTest.mouseRelease(rater.canvas, Qt.MouseButton.LeftButton, pos=rater.at((320.0, 180.0)))
    assert rater.canvas.tool is Tool.VESSEL
    assert len(rater.drawn.robot) == 2
    rater.click((200.0, 200.0), (320.0, 200.0))
    rater.press(Key.Key_Return)
    assert rater.drawn.state is None
    for _ in range(2):
        QTest.mouseDClick(rater.canvas, Qt.MouseButton.LeftButton, pos=rater.at((320.0, 180.0)))
        QTest.mouseRelease(rater.canvas, Qt.MouseButton.LeftButton, pos=rater.at((320.0, 180.0)))
    assert rater.drawn.state is None
    assert rater.model.index == 0
    rater.press(Key.Key_Return)
    assert rater.drawn.state is not None, "Enter does"


def test_a_record_that_is_damaged_comes_back_from_its_journal(make: MakeRater) -> None:
    """Opening its image must not put an empty one in its place."""
    rater = make()
    rater.click((200.0, 180.0), (320.0, 180.0))
    rater.press(Key.Key_Return)
    (before,) = rater.kept()
    with closing(sqlite3.connect(rater.store_path)) as database, database:
        database.execute("UPDATE annotations SET check_sum = 'spoilt'")
    again = make()
    rater.qtbot.waitUntil(lambda: again.drawn.robot == before.content.robot)
    (after,) = again.kept()
    assert after.content == before.content


def test_progress_and_status(rater: Rater) -> None:
    queue = rater.window.panels.queue
    assert queue.progress.text() == "0 of 3 done, 3 left"
    rater.qtbot.waitUntil(lambda: not queue._model.index(2).data(Qt.ItemDataRole.DecorationRole).isNull(), timeout=30_000)
    rater.press(Key.Key_X, Key.Key_N)
    assert queue.progress.text() == "1 of 3 done, 2 left"
    rater.press(Key.Key_N, Key.Key_U)
    assert rater.model.index == 1, "the next without an answer, around the end"
    rater.press(Key.Key_X, Key.Key_End, Key.Key_X, Key.Key_N)
    assert rater.window.panels.offers.text == "All 3 images have an answer"
    assert list(rater.window.panels.offers.answers)[:3] == ["Evaluate", "Report", "Next rater..."]
    assert [one.content.cannot_tell for one in rater.kept()] == [True] * 3


def test_a_mirrored_repeat_is_kept_as_the_image_lies_on_the_disk(make: MakeRater) -> None:
    rater = make((ImageView.AS_IS, ImageView.MIRRORED), blind=True)
    rater.window.open(3)
    rater.qtbot.waitUntil(lambda: rater.model.is_open)
    mirrored = [tuple((SIZE[0] - 1 - x, y) for x, y in line) for line in (ROBOT, VESSEL)]
    rater.click(*mirrored[0])
    rater.press(Key.Key_Return)
    rater.click(*mirrored[1])
    rater.press(Key.Key_C)
    (one,) = rater.kept()
    assert (one.view, one.key.repeat) == (ImageView.MIRRORED, 2)
    assert np.array(one.content.robot) == pytest.approx(np.array(ROBOT), abs=0.6)
    assert one.theta_signed_deg == pytest.approx(
        measure_lines(Annotation(ROBOT, VESSEL), SIZE, PerceptionConfig()).pose.theta_signed_deg, abs=1.3
    )


def test_the_algorithms_answer_is_shown_and_taken_over_on_demand(rater: Rater) -> None:
    box = MaskPolygon(MaskTarget.VESSEL, ((100.0, 100.0), (300.0, 100.0), (300.0, 300.0)))
    pose = measure_lines(Annotation(ROBOT, VESSEL), SIZE, PerceptionConfig()).pose
    item = rater.model.item
    rater.model._proposals[item.image.sha256] = Proposal(Annotation(ROBOT, VESSEL, PoseState.B, masks=(box,)), pose, 0.8)
    assert rater.canvas.editor.drawing.proposal is None
    rater.press(Key.Key_H)
    assert rater.canvas.editor.drawing.proposal is not None
    assert "G takes it over" in rater.message
    assert rater.drawn == Annotation(), "seen is not taken"
    assert rater.model.store.given_after_look() == set(), "nothing was answered yet"
    rater.press(Key.Key_G)
    assert (rater.drawn.robot, rater.drawn.vessel, rater.drawn.state, rater.drawn.masks) == (ROBOT, VESSEL, None, ())
    rater.press(Key.Key_4, Key.Key_G)
    assert rater.drawn.masks == (box,)
    rater.qtbot.waitUntil(lambda: rater.model.unsaved == 0)
    assert rater.model.store.given_after_look() == {item.key}


def test_an_answer_that_comes_after_it_was_switched_off_is_not_shown(rater: Rater) -> None:
    may_answer, pose = threading.Event(), measure_lines(Annotation(ROBOT, VESSEL), SIZE, PerceptionConfig()).pose

    def perceive(_frame: Frame) -> Scene:
        may_answer.wait(20.0)
        return make_scene(pose)

    rater.model._perceive = perceive
    bar = rater.window.panels.bar
    rater.press(Key.Key_H)
    rater.press(Key.Key_G)
    assert bar.is_on("H"), "what is waited for cannot be taken over yet, and is waited for"
    rater.press(Key.Key_H)
    may_answer.set()
    rater.qtbot.waitUntil(lambda: rater.model.proposal is not None, timeout=60_000)
    assert not bar.is_on("H")
    assert rater.canvas.editor.drawing.proposal is None
    assert "Algorithm:" not in rater.message
    rater.press(Key.Key_H)
    assert rater.canvas.editor.drawing.proposal is not None, "the answer was kept"


def test_what_the_algorithm_or_another_image_does_not_give_is_said(rater: Rater) -> None:
    item = rater.model.item
    blank = Frame(0, 0.0, np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    rater.model._proposals[item.image.sha256] = proposal_of(Pipeline(TrueMasks(), PerceptionConfig()).perceive_single(blank))
    rater.press(Key.Key_H)
    assert rater.message.startswith("The algorithm gives no pose: image black: 99 % of it")
    rater.press(Key.Key_V)
    assert rater.message == "No other image of this folder and size has a robot mask"


VESSEL_Y, VESSEL_RADIUS = 240, 20


@pytest.fixture
def vessel_rater(make: MakeRater, tmp_path: Path) -> Rater:
    """Over a picture of a bright vessel across all of it, with the vessel's mask as the tool."""
    picture = np.full((SIZE[1], SIZE[0], 3), 60, np.uint8)
    picture[VESSEL_Y - VESSEL_RADIUS : VESSEL_Y + VESSEL_RADIUS + 1] = 180
    write_png(tmp_path / "0.png", picture)
    rater = make()
    rater.press(Key.Key_4)
    return rater


def height_at(rater: Rater, column: int) -> int:
    return int(fill(rater.drawn.masks, MaskTarget.VESSEL, SIZE)[:, column].sum())


def test_a_tube_snaps_to_the_walls(vessel_rater: Rater) -> None:
    vessel_rater.press(Key.Key_Y)
    vessel_rater.canvas.editor.radius_px = 16.0
    vessel_rater.drag((100.0, 243.0), (400.0, 243.0))
    vessel_rater.qtbot.waitUntil(lambda: bool(vessel_rater.drawn.masks))
    assert abs(height_at(vessel_rater, 250) - 2 * VESSEL_RADIUS) <= 4
    assert height_at(vessel_rater, 60) == 0
    vessel_rater.press(Key.Key_Z, modifier=Qt.KeyboardModifier.ControlModifier)
    assert not vessel_rater.drawn.masks
    assert vessel_rater.message == "Undone: add a tube to the vessel mask"


def test_a_tube_is_kept_by_the_key_that_goes_on_before_it_is_computed(vessel_rater: Rater) -> None:
    vessel_rater.press(Key.Key_Y)
    vessel_rater.canvas.editor.radius_px = 18.0
    vessel_rater.drag((100.0, 240.0), (400.0, 240.0))
    vessel_rater.press(Key.Key_N)
    vessel_rater.press(Key.Key_P)
    assert height_at(vessel_rater, 250) > VESSEL_RADIUS
    assert vessel_rater.canvas.mask_mode is MaskMode.POINTS


def test_two_quick_gestures_are_both_kept(vessel_rater: Rater) -> None:
    vessel_rater.press(Key.Key_R)
    vessel_rater.canvas.editor.radius_px = 15.0
    vessel_rater.click((100.0, 240.0), (500.0, 240.0))
    vessel_rater.qtbot.waitUntil(lambda: len(vessel_rater.drawn.masks) == 2)
    for column in (100, 500):
        assert abs(height_at(vessel_rater, column) - 2 * VESSEL_RADIUS) <= 4
    vessel_rater.click((100.0, 240.0), button=Qt.MouseButton.RightButton)
    vessel_rater.qtbot.waitUntil(lambda: height_at(vessel_rater, 100) == 0)
    assert height_at(vessel_rater, 500) > 0


def test_the_wheel_is_the_circles_size_and_with_ctrl_the_zoom(vessel_rater: Rater) -> None:
    canvas = vessel_rater.canvas
    zoom, radius_px = canvas.view.zoom, canvas.editor.radius_px
    vessel_rater.press(Key.Key_Y)
    turn_the_wheel(canvas, 1)
    assert canvas.editor.radius_px == pytest.approx(radius_px * RADIUS_NOTCH) and canvas.view.zoom == zoom
    turn_the_wheel(canvas, 1, Qt.KeyboardModifier.ControlModifier)
    assert canvas.view.zoom > zoom
    vessel_rater.press(Key.Key_Y)
    assert canvas.mask_mode is MaskMode.POINTS
    radius_px = canvas.editor.radius_px
    turn_the_wheel(canvas)
    assert canvas.editor.radius_px == radius_px


def test_a_mode_with_a_line_tool_means_the_vessels_mask(rater: Rater) -> None:
    rater.press(Key.Key_Y)
    assert rater.canvas.tool is Tool.VESSEL_MASK and rater.canvas.mask_mode is MaskMode.TUBE
    assert rater.window.panels.bar.hint.text().startswith("Drag along the middle")
    rater.press(Key.Key_R)
    assert rater.window.panels.bar.modes[MaskMode.REGION].isChecked()
    rater.press(Key.Key_Escape)
    assert not rater.window.panels.bar.modes[MaskMode.REGION].isChecked()
    assert "click the outline" in rater.window.panels.bar.hint.text()


@pytest.fixture
def moving_rater(make: MakeRater, tmp_path: Path) -> Rater:
    """Over three pictures of a bench in which a dark robot goes on; it is drawn in the first."""
    for k in range(3):
        picture = np.full((SIZE[1], SIZE[0], 3), 180, np.uint8)
        picture[230:251, : 200 + 100 * k] = 40
        write_png(tmp_path / f"{k}.png", picture)
    rater = make()
    rater.model.edit("masks", Annotation(masks=(MaskPolygon(MaskTarget.ROBOT, ((0, 230), (199, 230), (199, 250), (0, 250))),)))
    return rater


def test_masks_of_the_image_before_are_proposed_hidden_and_taken(moving_rater: Rater) -> None:
    def propose() -> None:
        moving_rater.press(Key.Key_V)
        moving_rater.qtbot.waitUntil(lambda: moving_rater.canvas.editor.drawing.proposal is not None, timeout=60_000)

    moving_rater.press(Key.Key_N)
    propose()
    moving_rater.press(Key.Key_V)
    assert moving_rater.canvas.editor.drawing.proposal is None
    propose()
    moving_rater.press(Key.Key_P)
    assert moving_rater.canvas.editor.drawing.proposal is None, "it was of another image"
    moving_rater.press(Key.Key_N)
    propose()
    assert not moving_rater.drawn.masks, "a proposal is no answer"
    assert moving_rater.message == "Proposed from 0.png, dotted: G takes the masks over, V hides them"
    moving_rater.press(Key.Key_G)
    assert moving_rater.canvas.editor.drawing.proposal is None
    robot = fill(moving_rater.drawn.masks, MaskTarget.ROBOT, SIZE)
    assert robot[240, 290] and not robot[240, 310] and not robot[200].any()
    moving_rater.press(Key.Key_Z, modifier=Qt.KeyboardModifier.ControlModifier)
    assert not moving_rater.drawn.masks


def test_letters_go_into_a_note_and_not_into_the_state(rater: Rater) -> None:
    rater.press(Key.Key_F2)
    assert rater.window.panels.note.hasFocus()
    for letter in (Key.Key_B, Key.Key_A, Key.Key_D):
        QTest.keyClick(rater.window.panels.note, letter)
    rater.press(Key.Key_Return)
    assert rater.canvas.hasFocus()
    assert (rater.drawn.note, rater.drawn.state) == ("bad", None)


def test_zoom_keeps_the_place_under_the_cursor_and_clicks_stay_true(rater: Rater) -> None:
    QTest.mouseMove(rater.canvas, rater.at((200.0, 180.0)))
    before = rater.canvas.view.to_screen((200.0, 180.0))
    for _ in range(6):
        rater.press(Key.Key_Plus)
    assert rater.canvas.view.to_screen((200.0, 180.0)) == pytest.approx(before, abs=3.0)
    rater.click((201.2, 181.4))
    assert rater.drawn.robot[0] == pytest.approx((201.2, 181.4), abs=0.1), "zoomed in, clicks are as fine"
    rater.press(Key.Key_F)
    assert rater.canvas.view.is_fitted


def test_an_edit_that_cannot_be_written_is_shouted_and_written_later(rater: Rater, monkeypatch: pytest.MonkeyPatch) -> None:
    store = rater.model.store
    whole = store.save
    monkeypatch.setattr(store, "save", lambda *_: (_ for _ in ()).throw(AnnotationError("the disk is full")))
    rater.click(*ROBOT)
    rater.qtbot.waitUntil(lambda: "NOT SAVED: 3 edits" in rater.window.panels.header.saved.text())
    monkeypatch.setattr(store, "save", whole)
    rater.press(Key.Key_X)
    rater.qtbot.waitUntil(lambda: rater.window.panels.header.saved.text().endswith("saved"))
    (one,) = rater.kept()
    assert one.content.cannot_tell
    with AnnotationStore(rater.store_path, read_only=True) as kept:
        assert len(kept.history(one.key)._contents) == 5, "no edit was skipped"


@pytest.mark.parametrize("last", ["note", "state", "only one"])
def test_closing_asks_about_edits_that_the_disk_did_not_take(
    rater: Rater, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, last: str
) -> None:
    monkeypatch.setattr(rater.model.store, "save", lambda *_: (_ for _ in ()).throw(AnnotationError("the disk is full")))
    asked: list[int] = []
    answer = False
    monkeypatch.setattr(rater.window, "_may_lose", lambda: asked.append(rater.model.unsaved) or answer)
    if last != "only one":
        rater.press(Key.Key_A)
        rater.qtbot.waitUntil(lambda: "NOT SAVED: 1 edit" in rater.window.panels.header.saved.text())
    if last == "note":
        rater.press(Key.Key_F2)
        QTest.keyClicks(rater.window.panels.note, "glare")
    else:
        rater.press(Key.Key_B)
    assert not rater.window.close()
    assert asked == [1 if last == "only one" else 2]
    answer = True
    with caplog.at_level(logging.ERROR):
        assert rater.window.close()
    assert f"{asked[0]} edits could not be written to {rater.store_path}" in caplog.text


def test_a_note_stays_with_its_picture(rater: Rater) -> None:
    rater.press(Key.Key_F2)
    QTest.keyClicks(rater.window.panels.note, "blurred")
    rater.press(Key.Key_PageDown)
    rater.qtbot.waitUntil(lambda: rater.model.index == 1 and rater.model.is_open)
    assert rater.window.panels.note.text() == ""
    rater.press(Key.Key_Return)
    assert [(one.key.sha256, one.content.note) for one in rater.kept()] == [(rater.model.items[0].key.sha256, "blurred")]


def test_an_image_that_vanished_is_named_and_the_others_go_on(rater: Rater) -> None:
    rater.model.items[2].image.path.unlink()
    rater.window.open(2)
    rater.qtbot.waitUntil(lambda: "2.png: cannot be read" in rater.message)
    assert not rater.model.is_open
    rater.click(*ROBOT)
    rater.window.open(0)
    rater.qtbot.waitUntil(lambda: rater.model.is_open)
    assert rater.kept() == []


def test_lines_are_followed_through_the_clip_and_begin_again_from_a_correction(qtbot: QtBot, tmp_path: Path) -> None:
    still = np.random.default_rng(1).integers(40, 200, (SIZE[1], SIZE[0], 3), np.uint8)
    for k in range(3):
        write_png(tmp_path / f"{k}.png", np.roll(still, 2 * k, axis=1))
    rater = Rater(qtbot, tmp_path, (ImageView.AS_IS,), blind=False, hides_angle=False)
    control = Qt.KeyboardModifier.ControlModifier
    rater.press(Key.Key_F, modifier=control)
    assert rater.message == "Draw both lines on an image of this folder first; the others get theirs from it"
    lines = Annotation(((200.0, 240.0), (300.0, 240.0)), ((150.0, 260.0), (450.0, 260.0)))
    rater.model.edit("draw", lines)
    with qtbot.waitSignal(rater.model.followed, timeout=60_000) as done:
        rater.press(Key.Key_F, modifier=control)
    assert done.args == [2]
    assert [rater.model.provenance(k).value for k in range(3)] == ["manual", "followed", "followed"]
    heads = [rater.model.content(k).robot[-1] for k in range(3)]
    assert heads == [pytest.approx((300.0 + 2 * k, 240.0), abs=0.3) for k in range(3)]
    rater.press(Key.Key_N, Key.Key_N)
    low = replace(rater.drawn, robot=((204.0, 250.0), (304.0, 250.0)))
    rater.model.edit("move a point", low)
    assert rater.model.provenance(2).value == "corrected"
    with qtbot.waitSignal(rater.model.followed, timeout=60_000):
        rater.press(Key.Key_F, modifier=control)
    assert rater.model.content(2) == low, "a correction stays"
    kept = {one.key.sha256: one for one in rater.kept()}
    assert sorted(one.provenance.value for one in kept.values()) == ["corrected", "followed", "manual"]
