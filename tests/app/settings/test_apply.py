"""Settings of the running window: tried out at once, put back by Cancel, saved, and locked while the robot is armed or recorded."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel
from pytestqt.qtbot import QtBot

from app.operator.engine_thread import EnginePhase
from app.operator.window import OperatorWindow
from app.settings.apply import SettingsController
from app.ui import theme
from app.ui.texts import OperatorStep
from core.config.files import read_settings
from core.config.models import Config, PerceptionConfig, load_config
from core.config.rig_file import make_rig, read_rig, with_rig, write_rig
from core.control.modes import Act, Mode
from core.devices import DeviceError, EndOfStream
from core.types import Frame, Point, Scene
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeBench, FakeEngine, make_pose, make_scene, until

D_ALLOW = "perception.pose.d_allow_px"


class Bench:
    """A window over a fake engine, with its settings in a folder of the test."""

    def __init__(self, make_window: MakeWindow, bench: FakeBench, folder: Path, text: str | None = None) -> None:
        self.path = folder / "settings.toml"
        if text is not None:
            self.path.write_text(text, encoding="utf-8")
        self.engines: list[FakeEngine] = []
        self.configs: list[Config] = []
        self.again: list[PerceptionConfig] = []

        def open_engine(config: Config) -> FakeEngine:
            self.configs.append(config)
            self.engines.append(FakeEngine(bench))
            return self.engines[-1]

        file = read_settings(self.path)
        config = file.config.model_copy(update={"record": file.config.record.model_copy(update={"ring_s": 0.0})})
        self.window: OperatorWindow = make_window(open_engine, config)
        self.desk = SettingsController(self.window, file, self._perceive_again)
        self.window.start()
        self.desk.start()

    def _perceive_again(self, _frame: Frame, _target: Point | None, config: PerceptionConfig) -> Scene:
        self.again.append(config)
        return make_scene(make_pose())

    @property
    def engine(self) -> FakeEngine:
        return self.engines[-1]

    def edit(self, key: str, entry: object) -> None:
        self.desk.open()
        self.desk.dialog._on_edited(key, entry)

    def tried(self) -> list[float]:
        return [perception.pose.d_allow_px for perception in self.engine.perceptions]


@pytest.fixture
def at(make_window: MakeWindow, bench: FakeBench, tmp_path: Path, qtbot: QtBot, themed: None) -> Iterator[Bench]:
    made = Bench(make_window, bench, tmp_path)
    until(qtbot, lambda: made.window.shown_tick is not None)
    yield made
    made.desk.close()


def test_ctrl_comma_opens_it_once(at: Bench) -> None:
    QTest.keyClick(at.window, Qt.Key.Key_Comma, Qt.KeyboardModifier.ControlModifier)
    first = at.desk.dialog
    assert first.isVisible()
    assert not first.isModal(), "the robot must be in reach"
    at.desk.open()
    assert at.desk.dialog is first


def test_it_leaves_stop_in_sight(at: Bench) -> None:
    stop = at.window.panels.mode_bar.stop
    for size in ((1600, 900), (1280, 720), (1100, 660)):
        at.window.resize(*size)
        at.window.move(0, 0)
        at.desk.open()
        dialog = at.desk.dialog
        assert not dialog.frameGeometry().intersects(QRect(stop.mapToGlobal(QPoint(0, 0)), stop.size()))
        assert dialog.frameGeometry().right() <= at.window.frameGeometry().right()
        dialog.reject()


def test_thresholds_act_at_once_and_cancel_puts_them_back(at: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded: list[float] = []
    monkeypatch.setattr(at.window.recorder, "open_rig", lambda config, _kind: recorded.append(config.perception.pose.d_allow_px))
    at.edit(D_ALLOW, "9")
    at.edit(D_ALLOW, "12")
    at.edit(D_ALLOW, "900")
    assert at.tried() == [9.0, 12.0]
    assert at.window.panels._allowed[1].text() == "A: up to 12 px"
    assert at.desk.is_trying
    at.desk.dialog.reject()
    assert at.tried() == [9.0, 12.0, 6.0]
    assert at.window.panels._allowed[1].text() == "A: up to 6 px"
    assert not at.desk.is_trying
    assert not at.path.exists()
    assert recorded == [9.0, 12.0, 6.0], "what is recorded names the thresholds in force"
    at.edit("advice.fast_mm_s", "9")
    assert at.tried() == [9.0, 12.0, 6.0], "settings of the rig are not tried out"
    assert not at.desk.is_trying


def test_a_session_names_the_model_that_was_chosen_while_something_was_tried_out(
    at: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[PerceptionConfig] = []
    monkeypatch.setattr(at.window.recorder, "open_rig", lambda config, _kind: told.append(config.perception))
    at.edit(D_ALLOW, "12")
    config = at.window.rig.config
    segmentation = config.perception.segmentation.model_copy(update={"model": "own_1"})
    perception = config.perception.model_copy(update={"segmentation": segmentation})
    at.window.rig.use_config(config.model_copy(update={"perception": perception}))
    until(qtbot, lambda: at.tried() == [12.0] and len(at.engines) == 2)
    assert [(one.segmentation.model, one.pose.d_allow_px) for one in told] == [("default", 12.0), ("own_1", 6.0), ("own_1", 12.0)]
    assert at.engine.perceptions[0].segmentation.model == "own_1"
    at.desk.dialog.reject()
    assert at.engine.perceptions[-1] == perception


def test_what_somebody_else_wrote_first_is_kept_beside(at: Bench) -> None:
    """There was no file when the window opened; another window has saved one meanwhile."""
    at.path.write_text("[window]\npictures_folder = 'mine'\n", encoding="utf-8")
    at.edit(D_ALLOW, "9")
    at.desk.dialog.save.click()
    assert "was changed meanwhile" in at.window.panels.toast.text()
    (aside,) = (path for path in at.path.parent.glob("settings*") if path != at.path)
    assert "pictures_folder = 'mine'" in aside.read_text(encoding="utf-8")
    at.edit(D_ALLOW, "6")
    at.desk.dialog.save.click()
    assert "meanwhile" not in at.window.panels.toast.text()


def test_what_is_saved_stays_and_is_written(at: Bench) -> None:
    at.edit(D_ALLOW, "9")
    at.desk.dialog.save.click()
    assert at.desk.dialog is None
    assert at.tried()[-1] == 9.0
    assert at.window.rig.config.perception.pose.d_allow_px == 9.0
    assert read_settings(at.path).config.perception.pose.d_allow_px == 9.0
    assert str(at.path) in at.window.panels.toast.text()
    assert len(at.configs) == 1, "no rig was opened anew"
    at.edit(D_ALLOW, "6")
    at.desk.dialog.save.click()
    assert read_settings(at.path).config == load_config()


def test_the_rig_is_started_again_when_asked_and_takes_what_waited(at: Bench, qtbot: QtBot) -> None:
    at.edit("advice.fast_mm_s", "9")
    at.desk.dialog.save_and_restart.click()
    until(qtbot, lambda: len(at.configs) == 2)
    assert at.configs[1].advice.fast_mm_s == 9.0


def test_what_was_saved_without_a_restart_waits_for_the_next_one(at: Bench, qtbot: QtBot) -> None:
    at.edit("advice.fast_mm_s", "9")
    at.edit("record.codec", "lossless")
    at.desk.dialog.save.click()
    assert at.window.rig.config.advice.fast_mm_s == 8.0, "what is recorded says what acts"
    at.window.panels.picker.chosen.emit("tree")
    until(qtbot, lambda: len(at.configs) == 2)
    assert at.configs[1].advice.fast_mm_s == 9.0
    assert at.configs[1].twin.phantom == "tree"
    assert at.configs[1].record.codec == "lossy", "of the program's next start"


def test_other_limits_reach_a_rig_that_is_started_while_they_are_tried_out(at: Bench, qtbot: QtBot) -> None:
    at.edit(D_ALLOW, "9")
    at.window.rig.restart()
    until(qtbot, lambda: len(at.engines) == 2 and bool(at.engine.perceptions))
    assert at.tried() == [9.0]


def test_nothing_changes_while_the_robot_is_armed(at: Bench, qtbot: QtBot) -> None:
    at.desk.open()
    at.engine.pilot.view = replace(at.engine.pilot.view, mode=Mode.ARMED)
    dialog = at.desk.dialog
    until(qtbot, lambda: "armed" in dialog.status.text())
    at.edit(D_ALLOW, "9")
    assert at.tried() == []
    dialog.save_asked.emit(True)
    assert not at.path.exists()
    assert len(at.configs) == 1
    at.engine.pilot.view = replace(at.engine.pilot.view, mode=Mode.ADVISORY)
    until(qtbot, lambda: "armed" not in dialog.status.text())
    assert dialog.page.isEnabled()


def test_nobody_arms_while_something_is_tried_out(at: Bench) -> None:
    at.edit(D_ALLOW, "9")
    at.window.ask_step(OperatorStep.ARM)
    assert Act.ARM not in at.engine.pilot.acts
    assert "tried out" in at.window.panels.toast.text()
    at.window.ask_step(OperatorStep.DISARM)
    assert Act.DISARM in at.engine.pilot.acts
    at.desk.dialog.reject()
    at.window.ask_step(OperatorStep.ARM)
    assert Act.ARM in at.engine.pilot.acts


def test_after_saving_a_rig_that_stopped_looks_stopped(
    make_window: MakeWindow, bench: FakeBench, tmp_path: Path, qtbot: QtBot
) -> None:
    """What was tried out on its last picture must not stay: it would look alive."""
    at = Bench(make_window, bench, tmp_path)
    until(qtbot, lambda: at.window.shown_tick is not None)
    at.engine.fail_with = DeviceError("camera: cable out")
    until(qtbot, lambda: at.window.rig.phase is EnginePhase.FAULT)
    at.engine.set_perception = lambda _config: False
    panels = at.window.panels
    assert panels.notice.isVisible()
    at.edit(D_ALLOW, "9")
    until(qtbot, lambda: not panels.notice.isVisible())
    at.desk.dialog.save.click()
    until(qtbot, panels.notice.isVisible)
    assert panels.live.scene is None
    at.desk.close()


def test_space_is_stop_in_the_dialog_and_typed_while_the_servos_are_off(at: Bench) -> None:
    at.desk.open()
    QTest.keyClick(at.desk.dialog.search, Qt.Key.Key_Space)
    assert (at.engine.pilot.acts, at.desk.dialog.search.text()) == ([Act.STOP], "")
    at.engine.pilot.acts.clear()
    at.engine.pilot.view = replace(at.engine.pilot.view, servos_on=False)
    QTest.keyClicks(at.desk.dialog.search, "allowed px")
    assert at.desk.dialog.search.text() == "allowed px"
    assert Act.STOP not in at.engine.pilot.acts
    for mode in (Mode.ARMED, Mode.AUTONOMOUS, Mode.HOLD, Mode.STOPPED):
        at.engine.pilot.acts.clear()
        at.engine.pilot.view = replace(at.engine.pilot.view, mode=mode)
        QTest.keyClick(at.desk.dialog.search, Qt.Key.Key_Space)
        assert at.engine.pilot.acts == [Act.STOP], mode
    assert at.desk.dialog.search.text() == "allowed px"


def test_a_session_has_one_set_of_thresholds(at: Bench, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    at.edit(D_ALLOW, "9")
    recorder = at.window.recorder
    status = replace(recorder.status, recording=True)
    monkeypatch.setattr(type(recorder), "status", property(lambda _self: status))
    dialog = at.desk.dialog
    until(qtbot, lambda: "recorded" in dialog.status.text())
    at.edit(D_ALLOW, "12")
    dialog.reject()
    assert at.tried() == [9.0], "it goes on as it was begun"
    assert "goes on with the thresholds" in at.window.panels.toast.text()
    status = replace(status, recording=False)
    until(qtbot, lambda: at.tried() == [9.0, 6.0])
    assert not at.desk.is_trying


def test_the_last_frame_is_understood_anew_when_the_rig_is_over(at: Bench, qtbot: QtBot) -> None:
    at.engine.fail_with = EndOfStream("the end")
    until(qtbot, lambda: at.window.rig.phase is EnginePhase.ENDED)
    at.engine.set_perception = lambda config: False
    assert at.window.panels.badge.letter == "-"
    at.edit(D_ALLOW, "9")
    until(qtbot, lambda: at.window.panels.badge.letter == "C")
    assert [config.pose.d_allow_px for config in at.again] == [9.0]
    assert not at.window.panels.notice.isVisible()
    at.desk.dialog.reject()
    until(qtbot, lambda: at.window.panels.badge.letter == "-")
    assert at.window.panels.notice.isVisible()


def test_a_disk_that_does_not_take_it_keeps_the_dialog_open(at: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    at.path.mkdir()
    at.edit(D_ALLOW, "9")
    dialog = at.desk.dialog
    dialog.save.click()
    assert dialog.isVisible()
    assert "cannot be written" in dialog.notice.text()
    assert at.desk.is_trying


def test_unknown_keys_and_comments_survive_and_are_told(
    make_window: MakeWindow, bench: FakeBench, tmp_path: Path, themed: None
) -> None:
    text = "# mine\nfuture = 1\n[perception.pose]\nd_allow_px = 7 # measured\n"
    at = Bench(make_window, bench, tmp_path, text)
    assert "unknown key" in at.window.panels.toast.text()
    assert at.window.rig.config.perception.pose.d_allow_px == 7.0
    at.edit(D_ALLOW, "8")
    at.desk.dialog.save.click()
    assert at.path.read_text(encoding="utf-8") == text.replace("= 7", "= 8.0")
    at.desk.close()


def test_the_theme_is_shown_at_once_and_put_back(at: Bench, qapp: QApplication) -> None:
    at.edit("window.theme", "light")
    assert theme.current() is theme.LIGHT
    at.desk.dialog.reject()
    assert theme.current() is theme.DARK
    assert theme.chosen(qapp) == "dark"


def test_what_the_rig_file_keeps_is_shown_as_it_is_in_force_and_not_edited(
    make_window: MakeWindow, bench: FakeBench, tmp_path: Path, qtbot: QtBot, themed: None
) -> None:
    """A limit that is set here would act today and be gone at the next `gui --rig`."""
    text = "[servos]\nmax_pull_mm = 7.0\n[advice]\nfast_mm_s = 9.0\n"
    at = Bench(make_window, bench, tmp_path, text)
    until(qtbot, lambda: at.window.shown_tick is not None)
    at.edit("servos.max_pull_mm", "3")
    dialog = at.desk.dialog
    path = write_rig(make_rig(load_config(overrides={"servos": {"max_pull_mm": 5.0}}), "bench 1", None), tmp_path / "bench 1.toml")
    at.window.rig.use_config(with_rig(at.window.rig.config, read_rig(path), path))
    until(qtbot, lambda: dialog.draft.value("servos.max_pull_mm") == 5.0)
    dialog.go_to("servos.max_pull_mm")
    pull = dialog.page.fields["servos.max_pull_mm"]
    assert (pull.editor.text(), pull.isEnabled()) == ("5", False)
    said = [label.text() for label in dialog.page.findChildren(QLabel) if label.isVisible()]
    assert f"Kept in the rig file {path}: change it there, or by menu Rig, Calibrate" in said
    assert dialog.draft.changed_in(dialog._section) == 1
    assert not dialog.page._section_buttons["servos"][1].isEnabled()
    assert not dialog.draft.is_dirty, "what was typed before is dropped"
    dialog._reset_everything()
    assert not dialog.reset_all.isEnabled()
    dialog.save_and_restart.click()
    assert at.path.read_text(encoding="utf-8") == "[servos]\nmax_pull_mm = 7.0\n"
    until(qtbot, lambda: len(at.configs) == 3)
    assert (at.configs[-1].servos.max_pull_mm, at.configs[-1].advice.fast_mm_s) == (5.0, 8.0)
    at.desk.close()


def test_what_was_saved_before_a_rig_file_was_chosen_does_not_reach_it(at: Bench, tmp_path: Path, qtbot: QtBot) -> None:
    at.edit("servos.max_pull_mm", "3")
    at.edit("advice.fast_mm_s", "9")
    at.desk.dialog.save.click()
    path = write_rig(make_rig(load_config(), "bench 1", None), tmp_path / "bench 1.toml")
    rig = read_rig(path)
    at.window.rig.use_config(with_rig(at.window.rig.config, rig, path))
    until(qtbot, lambda: len(at.configs) == 2)
    assert (at.configs[1].servos, at.configs[1].advice.fast_mm_s) == (rig.servos, 9.0)


def test_what_somebody_edits_in_the_rig_file_acts_when_the_rig_is_started_again(at: Bench, tmp_path: Path, qtbot: QtBot) -> None:
    path = write_rig(make_rig(load_config(), "bench 1", None), tmp_path / "bench 1.toml")
    at.window.rig.use_config(with_rig(at.window.rig.config, read_rig(path), path))
    until(qtbot, lambda: len(at.configs) == 2)
    at.window.panels.picker.chosen.emit("y_junction")
    until(qtbot, lambda: len(at.configs) == 3)
    file = path.read_text(encoding="utf-8")
    path.write_text(file.replace("max_pull_mm = 2.0", "max_pull_mm = 4.5"), encoding="utf-8")
    assert at.window.rig.reread_config().servos.max_pull_mm == 4.5, "Calibrate begins with it, too"
    at.window.rig.restart()
    until(qtbot, lambda: len(at.configs) == 4)
    assert (at.configs[3].servos.max_pull_mm, at.configs[3].twin.phantom) == (4.5, "y_junction")
    path.write_text("[servos", encoding="utf-8")
    at.window.rig.restart()
    until(qtbot, lambda: len(at.configs) == 5)
    assert at.configs[4] == at.configs[3], "whoever opens it tells what is wrong"
