"""The rig wizard by its pages: names, camera, board, clicks, servos by hand, STOP, save; and what goes wrong."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QDoubleSpinBox, QFileDialog, QSpinBox
from pytestqt.qtbot import QtBot

from app.rig_wizard import servo_pages
from app.rig_wizard.model import RigWizardModel
from app.rig_wizard.wizard import RigWizard
from app.ui.texts import calibration_lines
from app.ui.window_base import close_all, is_asked_to_end
from core.calibration.servos import Assignment
from core.config.calibration import CalibrationConfig, DrumsConfig, ScaleConfig, SteeringConfig, TendonConfig, ZeroConfig
from core.config.models import Config, load_config
from core.config.rig_file import find_rig, list_rigs
from core.config.safety import JOINT_NAMES, TENDONS, ServosConfig
from core.devices import DeviceError
from core.types import Frame
from hardware.calibration import bench as calibration_bench
from hardware.calibration.bench import CalibrationBench
from hardware.calibration.rig_draft import RigDraft
from hardware.calibration.servo_identification import Zeros
from hardware.servos.discovery import FoundPort, FoundServo, FoundServos
from tests.app.fakes import make_scene, turn_the_wheel, until
from tests.core.robots import THREE, TURNED


class StillCamera:
    name = "still camera"

    def open(self) -> None: ...

    def read(self, timeout_s: float) -> Frame | None:
        time.sleep(0.01)
        return Frame(0, time.monotonic(), np.full((480, 640, 3), 90, np.uint8))

    def close(self) -> None: ...


def _open(config: Config, see: object) -> CalibrationBench:
    return CalibrationBench(config, StillCamera(), None, lambda frame: make_scene(), lambda: None)


pytestmark = pytest.mark.usefixtures("own_folder")


MakeWizard = Callable[..., RigWizard]


@pytest.fixture
def make_wizard(qtbot: QtBot) -> Iterator[MakeWizard]:
    made: list[RigWizard] = []

    def make(
        name: str = "", config: Config | None = None, known: CalibrationConfig | None = None, opener: Callable[..., object] = _open
    ) -> RigWizard:
        model = RigWizardModel(config or load_config(), known, opener, lambda _config: lambda frame: make_scene())
        wizard = RigWizard(model, name)
        qtbot.addWidget(wizard)
        made.append(wizard)
        wizard.show()
        until(qtbot, lambda: not model.is_busy)
        return wizard

    yield make
    for wizard in made:
        wizard.reject()


@pytest.fixture
def opened(make_wizard: MakeWizard, qtbot: QtBot) -> RigWizard:
    wizard = make_wizard("bench 1")
    _open_camera(wizard, qtbot)
    return wizard


def _open_camera(wizard: RigWizard, qtbot: QtBot) -> None:
    qtbot.mouseClick(wizard.camera_page.open_button, Qt.MouseButton.LeftButton)
    _idle(wizard, qtbot)
    assert wizard.model.bench is not None
    assert wizard.focusWidget() is not wizard.stop_button


def _idle(wizard: RigWizard, qtbot: QtBot) -> None:
    qtbot.waitUntil(lambda: not wizard.model.is_busy, timeout=60_000)  # looking for the board takes seconds on a busy machine


def _to(wizard: RigWizard, page: object) -> None:
    while wizard.page is not page:
        assert wizard.next_button.isEnabled()
        wizard.next_button.click()


# ---- the first page


def test_a_rig_needs_a_name_and_a_camera(make_wizard: MakeWizard, qtbot: QtBot) -> None:
    wizard = make_wizard()
    page = wizard.camera_page
    assert [page.cameras.item(k).text() for k in range(page.cameras.count())][-1] == "Bench twin (no hardware)"
    assert "Give the rig a name" in page.problem.text()
    assert not wizard.next_button.isEnabled()
    _open_camera(wizard, qtbot)
    until(qtbot, lambda: wizard.picture._image is not None)
    assert not wizard.next_button.isEnabled()
    qtbot.keyClicks(page.name_edit, "twin")
    assert "cannot be called twin" in page.problem.text()
    assert not wizard.next_button.isEnabled()
    page.name_edit.setText("bench 1")
    assert wizard.next_button.isEnabled()
    wizard.next_button.click()
    assert wizard.page is wizard.scale_page


def test_a_camera_that_cannot_be_opened_is_one_line(make_wizard: MakeWizard, qtbot: QtBot) -> None:
    def refuse(config: Config, see: object) -> CalibrationBench:
        raise DeviceError("no webcam: plug it in")

    wizard = make_wizard("bench 1", opener=refuse)
    qtbot.mouseClick(wizard.camera_page.open_button, Qt.MouseButton.LeftButton)
    _idle(wizard, qtbot)
    assert wizard.message == "no webcam: plug it in"
    assert not wizard.next_button.isEnabled()


# ---- scale and lens


def test_the_board_gives_the_scale(opened: RigWizard, qtbot: QtBot) -> None:
    page = opened.scale_page
    _to(opened, page)
    assert opened.next_button.text() == "&Skip"
    for _ in range(2):
        qtbot.mouseClick(page.take_button, Qt.MouseButton.LeftButton)
        _idle(opened, qtbot)
        assert opened.focusWidget() is page.take_button, "Enter takes the next one"
    assert page.count.text() == "2 pictures of the board taken"
    assert len(page.shapes()) > 30
    assert not page.square.isEnabled()
    qtbot.mouseClick(page.solve_button, Qt.MouseButton.LeftButton)
    _idle(opened, qtbot)
    assert opened.model.draft.scale.mm_per_px == pytest.approx(1.0 / 3.1, rel=0.01)
    assert "mm per pixel" in page.result.text()
    assert opened.next_button.text() == "&Next"


def test_two_clicks_give_the_scale(opened: RigWizard, qtbot: QtBot) -> None:
    page = opened.scale_page
    _to(opened, page)
    page.length.setValue(80.0)
    qtbot.mouseClick(page.clicks_button, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: opened.picture._image is not None)
    for place in ((100.0, 100.0), (300.0, 100.0)):
        x, y = opened.picture.on_screen(place)
        qtbot.mouseClick(opened.picture, Qt.MouseButton.LeftButton, pos=QPoint(round(x), round(y)))
    assert opened.model.draft.scale.mm_per_px == pytest.approx(0.4, rel=0.02)
    assert len(page.shapes()) == 3
    page.click(10.0, 10.0)
    page.click(12.0, 10.0)
    assert "px apart" in opened.message
    assert page.shapes() == []


def test_a_board_that_is_not_seen_is_told(make_wizard: MakeWizard, qtbot: QtBot) -> None:
    class Empty(CalibrationBench):
        def board_picture(self, spec: object) -> np.ndarray:
            return np.full((480, 640, 3), 90, np.uint8)

    wizard = make_wizard(
        "bench 1", opener=lambda config, see: Empty(config, StillCamera(), None, lambda frame: make_scene(), lambda: None)
    )
    _open_camera(wizard, qtbot)
    _to(wizard, wizard.scale_page)
    qtbot.mouseClick(wizard.scale_page.take_button, Qt.MouseButton.LeftButton)
    _idle(wizard, qtbot)
    assert wizard.message.startswith("no board: 0 of its markers")
    assert not wizard.scale_page.is_done


def test_the_board_is_written_for_the_printer(opened: RigWizard, tmp_path: Path) -> None:
    opened.scale_page.save_board(tmp_path / "board.pdf")
    assert (tmp_path / "board.pdf").read_bytes().startswith(b"%PDF")
    assert "100 %" in opened.message
    opened.scale_page.save_board(tmp_path / "board.jpg")
    assert "written as .pdf or .png" in opened.message


def test_no_dialog_of_the_desktop_keeps_stop_from_the_wizard(opened: RigWizard) -> None:
    """It would be another program's: Space in it would reach nobody here."""
    dialogs: list[bool] = []

    def look() -> None:
        dialog = QApplication.activeModalWidget()
        dialogs.append(dialog.testOption(QFileDialog.Option.DontUseNativeDialog))
        dialog.reject()

    QTimer.singleShot(0, look)
    opened.scale_page._print()
    assert dialogs == [True]


# ---- servos


def test_without_servos_their_pages_have_nothing_to_do(opened: RigWizard, qtbot: QtBot) -> None:
    _to(opened, opened.port_page)
    qtbot.mouseClick(opened.port_page.search_button, Qt.MouseButton.LeftButton)
    _idle(opened, qtbot)
    for page, control in (
        (opened.identify_page, opened.identify_page.auto_button),
        (opened.zero_page, opened.zero_page.find_button),
        (opened.steering_page, opened.steering_page.learn_button),
    ):
        _to(opened, page)
        assert not control.isEnabled()
        assert page.result.text() == "Search the servos first."


def _with_servos(wizard: RigWizard) -> None:
    wizard.model.bench.port = "/dev/ttyUSB0"
    wizard.model.draft.found = FoundServos("/dev/ttyUSB0", 1_000_000, tuple(FoundServo(k, 1020) for k in range(1, 8)))
    wizard.model.changed.emit()


LIVE = {"rig": {"camera": "webcam", "robot": "servos"}, "servos": {"port": "/dev/servos"}}


def test_the_twins_drums_are_known(opened: RigWizard) -> None:
    _to(opened, opened.drums_page)
    page = opened.drums_page
    assert page.is_done
    assert [field.value() for field in page.ways] == [40.0] * 3
    assert [field.value() for field in page.diameters] == [12.732] * 3
    assert "20 / 29 / 29 N" in page.result.text()


def test_drums_of_a_real_rig_are_asked_by_diameter_or_way(make_wizard: MakeWizard, qtbot: QtBot) -> None:
    wizard = make_wizard("bench 1", load_config(overrides=LIVE))
    wizard.model.open_camera(load_config(overrides=LIVE))
    _idle(wizard, qtbot)
    page, draft = wizard.drums_page, wizard.model.draft
    _to(wizard, page)
    assert not page.is_done
    assert [field.text() for field in page.diameters] == ["not measured"] * 3
    page.diameters[0].setValue(8.0)
    page.ways[1].setValue(5.0)  # a lead screw
    assert page.ways[0].value() == 25.133
    assert not page.is_done
    assert "no servo is moved" in page.result.text()
    page.diameters[2].setValue(30.0)
    assert page.is_done
    assert draft.drums == DrumsConfig(tendons_mm=8.0, advance_mm=1.592, delivery_mm=30.0)
    ways = [joint.mm_per_turn for joint in draft.config.servos.joints]
    assert ways == pytest.approx([25.13] * 4 + [5.0] + [94.25] * 2, abs=0.01)
    assert " N." in page.result.text()


def test_servos_are_told_apart_by_hand(opened: RigWizard, qtbot: QtBot) -> None:
    _to(opened, opened.identify_page)
    _with_servos(opened)
    page, draft = opened.identify_page, opened.model.draft
    assert page.auto_button.isEnabled()
    page._signs[0].setCurrentIndex(1)
    page._signs[0].activated.emit(1)
    assert draft.assignments[0] == Assignment("right", 1, -1, "set by hand")
    assert draft.config.servos.joints[0].sign == -1
    qtbot.mouseClick(page.swap_button, Qt.MouseButton.LeftButton)
    assert [(one.name, one.id) for one in draft.assignments[2:4]] == [("up", 4), ("down", 3)]
    page._ids[0].setCurrentIndex(1)
    page._ids[0].activated.emit(1)
    assert "every servo must have one name" in opened.message
    assert draft.assignments[0].id == 1


def test_touching_one_servo_confirms_no_other_one(opened: RigWizard) -> None:
    """A rig that is calibrated once more: nobody has looked which of two is up meanwhile."""
    _to(opened, opened.identify_page)
    _with_servos(opened)
    page, draft = opened.identify_page, opened.model.draft
    draft._assumed_earlier = ("up", "down")
    page._signs[4].activated.emit(page._signs[4].currentIndex())
    assert draft.assumed == ("up", "down")
    page._signs[2].setCurrentIndex(1 - page._signs[2].currentIndex())
    page._signs[2].activated.emit(0)
    assert draft.assumed == ("down",)


@pytest.mark.parametrize("change", ["another servo", "the other way"])
def test_zero_and_steering_are_of_the_servos_they_were_found_with(opened: RigWizard, qtbot: QtBot, change: str) -> None:
    _to(opened, opened.identify_page)
    _with_servos(opened)
    page, draft = opened.identify_page, opened.model.draft
    named = [Assignment(joint.name, joint.id, joint.sign, "seen") for joint in draft.config.servos.joints]
    draft.zero = ZeroConfig(ticks=tuple(range(7)), slack_mm=(0.1, 0.2, 0.3, 0.4), pretension_mm=0.3)
    draft.zeros = Zeros((0.1, 0.2, 0.3, 0.4))
    tendons = tuple(TendonConfig.model_validate({"name": name, "moved_px": 9.0, "px_per_mm": 6.0}) for name in TENDONS)
    draft.steering = SteeringConfig(heading_deg=0.0, roll_deg=0.0, disagreement_deg=1.0, tendons=tendons)
    draft.set_assignments(named)
    assert opened.zero_page.is_done and opened.steering_page.is_done, "the servos are where they were"
    if change == "another servo":
        qtbot.mouseClick(page.swap_button, Qt.MouseButton.LeftButton)
    else:
        other = 1 - page._signs[0].currentIndex()
        page._signs[0].setCurrentIndex(other)
        page._signs[0].activated.emit(other)
    assert (draft.zero, draft.zeros, draft.steering, draft.head_px) == (None, None, None, None)
    assert not opened.zero_page.is_done
    assert not opened.steering_page.is_done
    assert "find them anew" in opened.message


def test_the_person_is_asked_which_of_two_is_up(opened: RigWizard, qtbot: QtBot) -> None:
    """One camera cannot tell; without an answer the rig file says that it is assumed."""
    _to(opened, opened.identify_page)
    _with_servos(opened)
    page, draft = opened.identify_page, opened.model.draft
    assert not page.right_button.isVisible()
    named = [Assignment(name, number, 1, "seen", assumed=name in {"up", "down"}) for number, name in enumerate(JOINT_NAMES, 1)]
    draft.set_assignments(named)
    opened.model.changed.emit()
    assert "does the head rise" in page.result.text()
    rig = draft.rig_file("bench 1")
    assert rig.calibration.assumed == ("up", "down")
    assert any(line.startswith("assumed: up and down by the order of their ids") for line in calibration_lines(rig))
    qtbot.mouseClick(page.right_button, Qt.MouseButton.LeftButton)
    assert not page.right_button.isVisible()
    assert [one.seen for one in draft.assignments[2:4]] == ["seen by eye"] * 2
    assert draft.calibration().assumed is None
    draft.set_assignments(named)
    opened.model.changed.emit()
    qtbot.mouseClick(page.swap_button, Qt.MouseButton.LeftButton)
    assert [(one.name, one.id) for one in draft.assignments[2:4]] == [("up", 4), ("down", 3)]
    assert draft.calibration().assumed is None, "who swaps has looked"


@pytest.mark.parametrize(
    ("servos", "joints", "tendons"),
    [
        (THREE, ["tendon 1 (90°)", "tendon 2 (210°)", "tendon 3 (330°)", "robot forward"], "tendon 3 (330°)"),
        (TURNED, ["tendon 1 (90°)", "tendon 2 (270°)", "robot forward", "rotation"], "tendon 2 (270°)"),
    ],
)
def test_pages_follow_from_the_joints_of_the_robot(
    make_wizard: MakeWizard, qtbot: QtBot, servos: ServosConfig, joints: list[str], tendons: str
) -> None:
    wizard = make_wizard("bench 1", load_config().model_copy(update={"servos": servos}))
    _open_camera(wizard, qtbot)
    _to(wizard, wizard.drums_page)
    assert [row[0].isVisible() for row in wizard.drums_page._cells] == [True, True, False], "there is no catheter"
    _to(wizard, wizard.identify_page)
    draft, page = wizard.model.draft, wizard.identify_page
    wizard.model.bench.port = "/dev/ttyUSB0"
    draft.found = FoundServos("/dev/ttyUSB0", 1_000_000, tuple(FoundServo(joint.id, 1020) for joint in servos.joints))
    draft.set_assignments([Assignment(one.name, one.id, 1, "seen", assumed=one.name == "rotation") for one in servos.joints])
    wizard.model.changed.emit()
    assert [page.rows.item(row, 0).text() for row in range(page.rows.rowCount())] == joints
    assert page.swap_button.isVisible() is (servos is TURNED), "its tendons act out of the picture's plane"
    assert page.right_button.isVisible() is ("which way the shaft turns" in page.result.text()) is (servos is TURNED)
    draft.zeros = Zeros(tuple(0.1 * k for k in range(len(servos.tendons))))
    for one in (wizard.zero_page, wizard.steering_page):
        _to(wizard, one)
        assert one.rows.item(one.rows.rowCount() - 1, 0).text() == tendons


def test_a_rig_may_have_a_space_in_its_name_and_space_is_stop_there_while_a_job_runs(opened: RigWizard, qtbot: QtBot) -> None:
    bench, name = opened.model.bench, opened.camera_page.name_edit
    opened.back()
    name.clear()
    qtbot.keyClicks(name, "left bench")
    assert name.text() == "left bench"
    assert not bench.stop.is_pressed
    opened.model.run("moving a servo", lambda: bench.stop.sleep(20.0))
    qtbot.keyClick(name, Qt.Key.Key_Space)
    assert bench.stop.is_pressed
    assert name.text() == "left bench"
    _idle(opened, qtbot)


def test_stop_reaches_a_job_that_runs(opened: RigWizard, qtbot: QtBot) -> None:
    bench = opened.model.bench
    for stop in (lambda: qtbot.keyClick(opened, Qt.Key.Key_Space), opened.model.stop):
        stop()
        assert bench.stop.is_pressed
        bench.stop.release()
    opened.model.run("moving a servo", lambda: bench.stop.sleep(20.0))
    assert not opened.next_button.isEnabled()
    assert opened.message == "Moving a servo ..."
    qtbot.mousePress(opened.stop_button, Qt.MouseButton.LeftButton)
    _idle(opened, qtbot)
    assert opened.message == "stopped: nothing moves before you go on"
    opened.model.run("looking", bench.stop.check)  # asking for the next step is going on
    _idle(opened, qtbot)
    assert opened.message == ""


def _enter(wizard: RigWizard, qtbot: QtBot) -> None:
    qtbot.keyClick(wizard, Qt.Key.Key_Return)
    _idle(wizard, qtbot)


def test_a_second_enter_on_stop_moves_nothing(opened: RigWizard, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    _to(opened, opened.identify_page)
    _with_servos(opened)
    moved: list[int] = []

    def wiggle(servo_id: int) -> None:
        moved.append(servo_id)
        opened.model.bench.stop.sleep(20.0)

    monkeypatch.setattr(opened.model.draft, "wiggle", wiggle)
    opened.identify_page.wiggle_button.setFocus()
    qtbot.keyClick(opened, Qt.Key.Key_Return)
    assert opened.focusWidget() is opened.stop_button
    for _ in range(2):
        _enter(opened, qtbot)
    assert len(moved) == 1


def test_enter_goes_on_only_after_the_job_that_did_its_step(
    opened: RigWizard, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    _to(opened, opened.zero_page)
    _with_servos(opened)
    page, draft = opened.zero_page, opened.model.draft
    draft.zeros = Zeros((0.1,) * 4, ("right: not seen",))
    monkeypatch.setattr(draft, "nudge", lambda name, _way_mm: draft._nudged.add(name))
    page.tighten.setFocus()
    for _ in range(2):
        _enter(opened, qtbot)
        assert page.is_done and opened.focusWidget() is page.tighten, "the wire may want more of it"
    draft.zeros = None
    monkeypatch.setattr(RigDraft, "find_zeros", lambda one: setattr(one, "zeros", Zeros((0.1,) * 4)))
    page.find_button.setFocus()
    _enter(opened, qtbot)
    assert opened.focusWidget() is opened.next_button

    def fail(_draft: RigDraft) -> None:
        raise DeviceError("no head")

    monkeypatch.setattr(RigDraft, "find_zeros", fail)
    page.find_button.setFocus()
    _enter(opened, qtbot)
    assert opened.focusWidget() is opened, "neither on nor once more"


# ---- the end


def test_saved_rigs_hold_what_was_found(opened: RigWizard, qtbot: QtBot) -> None:
    opened.model.draft.scale = ScaleConfig(mm_per_px=0.3, size_px=(640, 480), method="two clicks", uncertainty_share=0.01)
    _to(opened, opened.summary_page)
    assert "scale: 0.3000 mm/px" in opened.summary_page.text.toPlainText()
    assert opened.next_button.text() == "&Save"
    with qtbot.waitSignal(opened.saved) as told:
        opened.next_button.click()
    assert told.args == ["bench 1"]
    _, rig = find_rig("bench 1")
    assert rig.calibration.scale.mm_per_px == 0.3
    assert opened.model.wait_closed()
    assert opened.model.bench is None  # the camera is free again


def test_a_step_that_is_left_out_keeps_what_was_known(make_wizard: MakeWizard, qtbot: QtBot) -> None:
    scale = ScaleConfig(mm_per_px=0.3, size_px=(640, 480), method="board", uncertainty_share=0.01)
    known = CalibrationConfig.model_validate({"made_utc": "2025-01-01T00:00:00Z", "scale": scale})
    wizard = make_wizard("bench 1", known=known)
    _open_camera(wizard, qtbot)
    assert wizard.scale_page.is_done
    _to(wizard, wizard.summary_page)
    wizard.next_button.click()
    assert find_rig("bench 1")[1].calibration.scale == scale


def test_another_camera_does_not_inherit_the_calibration(make_wizard: MakeWizard, qtbot: QtBot) -> None:
    scale = ScaleConfig(mm_per_px=0.3, size_px=(640, 480), method="board", uncertainty_share=0.01)
    known = CalibrationConfig.model_validate({"made_utc": "2025-01-01T00:00:00Z", "scale": scale})
    before = load_config(overrides={"rig": {"camera": "webcam", "robot": "none"}, "camera": {"device": "/dev/v4l/by-id/a"}})
    wizard = make_wizard("bench 1", before, known)
    for changes in ({"device": "/dev/v4l/by-id/b"}, {"width_px": 1280, "height_px": 720}):
        wizard.model.open_camera(before.model_copy(update={"camera": before.camera.model_copy(update=changes)}))
        _idle(wizard, qtbot)
        assert not wizard.scale_page.is_done
    wizard.model.open_camera(before)
    _idle(wizard, qtbot)
    assert wizard.scale_page.is_done


@pytest.mark.parametrize(("kind", "sign"), [("realsense", "serial"), ("basler", "serial"), ("webcam", "device")])
def test_a_camera_that_was_not_named_keeps_its_calibration_when_it_is_found(
    make_wizard: MakeWizard, qtbot: QtBot, kind: str, sign: str
) -> None:
    known = CalibrationConfig.model_validate({"made_utc": "2025-01-01T00:00:00Z", "port": {"x_share": 0.1, "y_share": 0.5}})
    before = load_config(overrides={"rig": {"camera": kind, "robot": "none"}})
    wizard = make_wizard("bench 1", before, known)
    wizard.model.open_camera(before.model_copy(update={"camera": before.camera.model_copy(update={sign: "f0123456"})}))
    _idle(wizard, qtbot)
    assert wizard.model.draft.port == known.port


def test_opening_the_camera_anew_asks_before_it_loses_what_was_found(opened: RigWizard, qtbot: QtBot) -> None:
    draft, page = opened.model.draft, opened.camera_page
    draft.scale = ScaleConfig(mm_per_px=0.3, size_px=(640, 480), method="board", uncertainty_share=0.01)
    page.open_button.click()
    assert opened.question.text == "Open the camera again and lose what was found?"
    opened.question.cancel()
    assert opened.model.draft is draft
    page.open_button.click()
    opened.question._yes.click()
    _idle(opened, qtbot)
    assert opened.model.draft is not draft


def test_the_pretension_is_what_the_wires_envelopes_allow(opened: RigWizard) -> None:
    draft, page = opened.model.draft, opened.zero_page
    joints = tuple(joint.model_copy(update={"high_mm": 1.5}) for joint in draft.config.servos.joints)
    draft.config = draft.config.model_copy(
        update={"servos": draft.config.servos.model_copy(update={"joints": joints, "pretension_mm": 0.8})}
    )
    page.refresh()
    assert page.pretension.value() == pytest.approx(0.8)
    page.pretension.setValue(9.0)
    assert draft.config.servos.pretension_mm == page.pretension.value() == 1.5


def test_the_ports_are_those_of_the_bench_that_is_open(
    make_wizard: MakeWizard, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    wizard = make_wizard("bench 1")
    _open_camera(wizard, qtbot)
    page = wizard.port_page
    page.enter()
    assert [page.ports.itemText(k) for k in range(page.ports.count())] == ["the twin's own servos"]
    wizard.model.open_camera(load_config(overrides={"rig": {"camera": "webcam", "robot": "none"}}))
    _idle(wizard, qtbot)
    monkeypatch.setattr(servo_pages, "find_ports", lambda: (FoundPort("/dev/serial/by-id/u2d2", "U2D2"),))
    page.enter()
    assert [page.ports.itemData(k) for k in range(page.ports.count())] == ["/dev/serial/by-id/u2d2", None]


def by_escape(wizard: RigWizard) -> None:
    wizard.setFocus()
    QTest.keyClick(wizard, Qt.Key.Key_Escape)


LEAVING = pytest.mark.parametrize("leave", [by_escape, RigWizard.close])


def _find_a_scale(wizard: RigWizard) -> None:
    wizard.model.draft.solve_clicks((100.0, 100.0), (500.0, 100.0), 80.0)
    wizard.model.changed.emit()


@LEAVING
def test_what_was_found_is_not_thrown_away_without_a_question(
    opened: RigWizard, qtbot: QtBot, leave: Callable[[RigWizard], None]
) -> None:
    _find_a_scale(opened)
    leave(opened)
    assert opened.isVisible()
    assert opened.question.isVisible()
    assert opened.question.text == "Leave without saving what was found?"
    assert opened.model.bench is not None, "camera and servos are still here"
    qtbot.keyClick(opened, Qt.Key.Key_Space)
    assert opened.isVisible(), "Space is STOP, and answers nothing"
    assert opened.question.isVisible()
    qtbot.keyClick(opened, Qt.Key.Key_Escape)
    assert not opened.question.isVisible()
    assert opened.cancel_button.isVisible()
    leave(opened)
    opened.question._yes.click()
    assert not opened.isVisible()
    until(qtbot, lambda: opened.model.bench is None)


def test_a_program_that_is_asked_to_end_is_not_kept_by_a_question(opened: RigWizard, qtbot: QtBot, qapp: QApplication) -> None:
    """Ctrl-C, or a computer that is shut down: whoever waits for an answer is killed, and leaves the servos as they are."""
    _find_a_scale(opened)
    close_all(qapp)
    assert not opened.isVisible()
    until(qtbot, lambda: opened.model.bench is None)
    assert not is_asked_to_end()


@LEAVING
def test_without_results_it_closes_at_once_and_frees_the_camera(opened: RigWizard, leave: Callable[[RigWizard], None]) -> None:
    leave(opened)
    assert not opened.isVisible()
    assert list_rigs() == ()
    assert opened.model.wait_closed()
    assert opened.model.bench is None


def test_the_wheel_changes_no_servo_no_direction_and_no_number(opened: RigWizard) -> None:
    """Turned over the table of joints it would pull a wire the wrong way ever after."""
    lists, numbers = opened.findChildren(QComboBox), opened.findChildren(QSpinBox) + opened.findChildren(QDoubleSpinBox)
    assert len(lists) > 14
    assert len(numbers) > 3
    for control in (*lists, *numbers):
        control.setEnabled(True)
        before = control.currentIndex() if isinstance(control, QComboBox) else control.value()
        event = turn_the_wheel(control)
        assert before == (control.currentIndex() if isinstance(control, QComboBox) else control.value()), control.accessibleName()
        assert not event.isAccepted()
    assert not opened.identify_page.is_done


def test_a_camera_without_pictures_is_none(make_wizard: MakeWizard, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    class Blind(StillCamera):
        def read(self, timeout_s: float) -> Frame | None:
            time.sleep(0.01)
            return None

    monkeypatch.setattr(calibration_bench, "_FRAMES_WITHIN_S", 0.1)
    wizard = make_wizard(
        "bench 1", opener=lambda config, see: CalibrationBench(config, Blind(), None, lambda frame: make_scene(), lambda: None)
    )
    qtbot.mouseClick(wizard.camera_page.open_button, Qt.MouseButton.LeftButton)
    _idle(wizard, qtbot)
    assert "gives no pictures" in wizard.message
    assert wizard.model.bench is None
    assert not wizard.camera_page.is_done
    wizard.next()
    assert wizard.page is wizard.camera_page


def test_a_driver_that_hangs_does_not_hold_the_window_up(make_wizard: MakeWizard, qtbot: QtBot) -> None:
    go_on = threading.Event()

    def hang(config: Config, see: object) -> CalibrationBench:
        go_on.wait(20.0)
        return _open(config, see)

    wizard = make_wizard("bench 1", opener=hang)
    closed: list[bool] = []
    wizard.model.closed.connect(lambda: closed.append(True))
    qtbot.mouseClick(wizard.camera_page.open_button, Qt.MouseButton.LeftButton)
    wizard.cancel_button.click()  # comes back although the driver does not
    assert not wizard.isVisible()
    qtbot.wait(50)
    assert closed == []
    go_on.set()
    until(qtbot, lambda: closed == [True])
    assert wizard.model.bench is None
