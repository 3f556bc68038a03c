"""Recording from the window: one key begins and ends a session, the last seconds can be saved, nothing is lost at the end."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.operator.window import OperatorWindow
from app.widgets.record_bar import RecordBar
from core.config.models import Config
from core.control.alerts import ALERTS, Alert
from core.control.faults import Cause
from core.control.modes import Act
from core.evaluation.replay import event_target
from core.session import writer as recording
from core.session.manifest import EventKind
from core.session.reader import SessionReader
from core.session.writer import RecordStatus
from core.types import Tick
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeBench, FakeEngine, until

Key = Qt.Key


def sessions(folder: Path) -> list[Path]:
    return sorted(folder.glob("session_*")) if folder.is_dir() else []


def test_one_key_begins_and_ends_a_session(running: OperatorWindow, engine: FakeEngine, qtbot: QtBot, tmp_path: Path) -> None:
    bar = running.panels.record_bar
    assert bar.text == "Record F9"
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.frames >= 5)
    until(qtbot, lambda: bar.accessibleName() == "Recording")
    running.panels.live.clicked.emit(500.0, 280.0)
    engine.pilot.alerts = [Alert(Cause.DEADMAN, ALERTS[Cause.DEADMAN])]
    until(qtbot, lambda: not engine.pilot.alerts)
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.saved is not None and bar.accessibleName() == "Record")
    (session,) = sessions(tmp_path / "sessions")
    reader = SessionReader(session)
    assert reader.wait(10.0)
    assert len(reader) >= 5
    assert reader.manifest is not None
    assert reader.manifest.closed
    assert reader.manifest.kind == "SIM"
    kinds = [event.kind.value for event in reader.events]
    (target,) = [event for event in reader.events if event.kind is EventKind.TARGET]
    assert event_target(target) == pytest.approx((500.0, 280.0), abs=0.01)
    assert "alert" in kinds
    assert not reader.problems
    reader.close()
    assert any(str(session) in line for line in running.panels.events.lines)


def test_closing_the_window_ends_the_session_properly(running: OperatorWindow, qtbot: QtBot, tmp_path: Path) -> None:
    running.panels.record_bar.clicked.emit()
    until(qtbot, lambda: running.recorder.status.frames >= 3)
    running.close()
    (session,) = sessions(tmp_path / "sessions")
    reader = SessionReader(session)
    assert reader.wait(10.0)
    assert reader.manifest is not None
    assert reader.manifest.closed
    assert len(reader) >= 3
    reader.close()


@pytest.fixture
def remembering(make_window: MakeWindow, bench: FakeBench, qtbot: QtBot, tmp_path: Path) -> OperatorWindow:
    """A window that records nothing and keeps the last seconds, of which there are some."""
    config = Config.model_validate({"record": {"folder": str(tmp_path / "sessions"), "ring_s": 5.0}})
    window = make_window(lambda _config: FakeEngine(bench), config)
    window.start()
    until(qtbot, lambda: window.recorder.status.ring_s > 0.3)
    return window


def test_the_last_seconds_are_there_without_having_recorded(remembering: OperatorWindow, qtbot: QtBot, tmp_path: Path) -> None:
    qtbot.keyClick(remembering, Key.Key_F10)
    until(qtbot, lambda: remembering.recorder.status.saved is not None)
    (session,) = sessions(tmp_path / "sessions")
    reader = SessionReader(session)
    assert reader.wait(10.0)
    assert len(reader) >= 3
    reader.close()


def _notes(session: Path) -> list[str]:
    reader = SessionReader(session)
    assert reader.wait(10.0)
    notes = [event.text for event in reader.events if event.kind is EventKind.NOTE]
    reader.close()
    return notes


def test_a_moment_is_marked_with_a_number_that_counts_from_one_in_each_session(
    running: OperatorWindow, qtbot: QtBot, tmp_path: Path
) -> None:
    made = []
    for marks in (2, 1):
        qtbot.keyClick(running, Key.Key_F9)
        until(qtbot, lambda: running.recorder.status.recording)
        for number in range(marks):
            qtbot.keyClick(running, Key.Key_M)
            assert running.panels.toast.text() == f"Mark {number + 1} is in the session"
        before = running.recorder.status.saved
        qtbot.keyClick(running, Key.Key_F9)
        until(qtbot, lambda before=before: running.recorder.status.saved != before)
        made.append(running.recorder.status.saved)
    assert sorted(sessions(tmp_path / "sessions")) == sorted(made)
    assert [_notes(session) for session in made] == [["mark 1", "mark 2"], ["mark 1"]]


def test_a_moment_is_marked_while_shift_is_held_as_the_deadman(running: OperatorWindow, qtbot: QtBot, tmp_path: Path) -> None:
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.recording)
    qtbot.keyClick(running, Key.Key_M, Qt.KeyboardModifier.ShiftModifier)
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.saved is not None)
    (session,) = sessions(tmp_path / "sessions")
    assert _notes(session) == ["mark 1"]


def test_a_moment_of_the_last_seconds_can_be_marked(remembering: OperatorWindow, qtbot: QtBot, tmp_path: Path) -> None:
    qtbot.keyClick(remembering, Key.Key_M)
    assert remembering.panels.toast.text() == "Mark 1 is in the last seconds: F10 saves them"
    qtbot.keyClick(remembering, Key.Key_F10)
    until(qtbot, lambda: remembering.recorder.status.saved is not None)
    (session,) = sessions(tmp_path / "sessions")
    assert _notes(session) == ["mark 1"]


def test_without_anything_to_mark_it_is_said(running: OperatorWindow, qtbot: QtBot) -> None:
    qtbot.keyClick(running, Key.Key_M)
    assert "F9 begins a session" in running.panels.toast.text()


def test_nothing_to_save_is_said(running: OperatorWindow, qtbot: QtBot) -> None:
    qtbot.keyClick(running, Key.Key_F10)
    assert "Nothing to save yet" in running.panels.toast.text()


def test_the_key_of_another_phantom_does_not_end_a_recording(running: OperatorWindow, qtbot: QtBot) -> None:
    """It lies among those that drive."""
    before = running.rig.config.twin.phantom
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.recording)
    assert running.panels.picker is not None
    running.panels.picker.chosen.emit("y_branch")
    assert running.rig.config.twin.phantom == before
    assert "The phantom stays as it is: a session is being recorded" in running.panels.toast.text()
    assert running.recorder.status.recording
    qtbot.keyClick(running, Key.Key_F9)


def test_nor_does_f5(running: OperatorWindow, qtbot: QtBot) -> None:
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.recording)
    orders = running.rig.orders
    qtbot.keyClick(running, Key.Key_F5)
    assert "The rig stays as it is: a session is being recorded" in running.panels.toast.text()
    assert running.recorder.status.recording
    assert running.rig.orders == orders
    qtbot.keyClick(running, Key.Key_F9)


def test_a_folder_that_cannot_be_written_stops_the_recording_visibly(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot, tmp_path: Path
) -> None:
    (tmp_path / "sessions").write_text("a file where the folder should be")
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.problem != "")
    until(qtbot, lambda: "stopped" in running.panels.record_bar.text)
    assert "Recording stopped" in running.panels.toast.text()
    assert engine.pilot.faults[-1].cause is Cause.RECORDING_STOPPED
    assert running.shown_tick is not None, "the rig goes on"


def test_after_a_fault_of_the_program_in_the_recorder_the_next_key_records_again(
    running: OperatorWindow, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_values: object, **_options: object) -> None:
        raise RuntimeError("nobody has thought of this")

    with monkeypatch.context() as patch:
        patch.setattr(recording, "row_of", fail)
        qtbot.keyClick(running, Key.Key_F9)
        until(qtbot, lambda: "stopped" in running.panels.record_bar.text)
        said = running.panels.toast.text()
        assert said == "Recording stopped: unexpected RuntimeError: nobody has thought of this", "not that all is saved"
        assert any("Session saved" in line for line in running.panels.events.lines), "what was recorded until then"
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.frames >= 3)
    assert running.recorder.status.problem == ""


def test_a_recorder_that_was_closed_does_not_live_again(running: OperatorWindow, tmp_path: Path) -> None:
    writer = running.recorder._writer
    assert writer is not None
    assert running.recorder.close()
    running.recorder.toggle()
    assert running.recorder._writer is writer
    assert not writer.is_alive
    assert sessions(tmp_path / "sessions") == []


def restart(window: OperatorWindow) -> None:
    window.rig.restart()


def choose_phantom(window: OperatorWindow) -> None:
    assert window.panels.picker is not None
    window.panels.picker.chosen.emit("tree")


@pytest.mark.parametrize("again", [restart, choose_phantom])
def test_no_picture_of_the_old_rig_is_kept_as_one_of_the_new(
    again: Callable[[OperatorWindow], None],
    make_window: MakeWindow,
    engines: list[FakeEngine],
    qtbot: QtBot,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    window = make_window()
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    kept: list[Tick] = []
    stopped: list[bool] = []
    monkeypatch.setattr(window.rig.engine, "on_tick", kept.append)

    def open_rig(*_about: object) -> None:
        kept.clear()
        time.sleep(0.15)  # several pictures long
        assert kept == []
        stopped.append(window.rig.engine.stop_opening())

    monkeypatch.setattr(window.recorder, "open_rig", open_rig)
    again(window)
    assert stopped == [True], "a STOP in between is kept for the new rig"
    until(qtbot, lambda: len(engines) == 2 and bool(kept))
    assert engines[1].pilot.acts == [Act.STOP]


def test_a_double_click_is_one_click(qtbot: QtBot) -> None:
    bar, asked = RecordBar(), list[bool]()
    qtbot.addWidget(bar)
    bar.show()
    bar.clicked.connect(lambda: asked.append(True))
    qtbot.mouseClick(bar, Qt.MouseButton.LeftButton)
    qtbot.mouseDClick(bar, Qt.MouseButton.LeftButton)
    assert asked == [True], "the second would end what the first has begun"
    qtbot.mouseClick(bar, Qt.MouseButton.LeftButton)
    assert asked == [True, True]


def test_the_tool_tip_of_the_bar_is_as_new_as_what_it_tells(qtbot: QtBot) -> None:
    """Between two sessions the bar's own words stay the same, and the disk fills up."""
    bar = RecordBar()
    qtbot.addWidget(bar)
    bar.show_status(RecordStatus(disk_free=40_000_000_000))
    assert "40.0 GB free" in bar.toolTip()
    bar.show_status(RecordStatus(disk_free=1_200_000_000, warning="disk nearly full: 1200 MB left"))
    assert "1.2 GB free" in bar.toolTip()
    assert "disk nearly full: 1200 MB left" in bar.toolTip()
