"""Recording from the window: one key begins and ends a session, the last seconds can be saved, nothing is lost at the end."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.annotator.sources import image_files
from app.operator.record_bar import RecordBar
from app.operator.recording import AfterSession, RecoveryController, declined_names
from app.operator.services import WindowServices
from app.operator.window import OperatorWindow
from app.ui.description_form import DescriptionDialog
from app.ui.opening import OtherWindows
from app.widgets.messages import Offer, OfferButton, OfferStrip
from core.annotation.store import DEFAULT_NAME
from core.config.models import Config
from core.control.alerts import ALERTS, Alert
from core.control.faults import Cause
from core.control.modes import Act
from core.evaluation.replay import event_target
from core.session import writer as session_writer
from core.session.manifest import (
    MANIFEST,
    Description,
    EventKind,
    read_description,
    read_manifest,
    remembered_description,
)
from core.session.reader import SessionReader
from core.types import Tick
from tests.app.annotated import measure
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeBench, FakeEngine, until
from tests.core.session_data import record, tick_of

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
    qtbot.keyClick(running, Key.Key_F9, Qt.KeyboardModifier.ShiftModifier)
    until(qtbot, lambda: running.recorder.status.recording)
    qtbot.keyClick(running, Key.Key_M, Qt.KeyboardModifier.ShiftModifier)
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.saved is not None)
    (session,) = sessions(tmp_path / "sessions")
    assert _notes(session) == ["mark 1"]


def test_notes_and_marks_go_to_live_outputs_too(remembering: OperatorWindow) -> None:
    output = Mock()
    remembering.recorder.use_outputs([output])
    assert remembering.recorder.note("trial 3") == ""
    remembering.recorder.note()
    assert [call.args[0].text for call in output.add_event.call_args_list] == ["trial 3", "mark 1"]


def test_the_last_seconds_are_there_without_having_recorded(remembering: OperatorWindow, qtbot: QtBot, tmp_path: Path) -> None:
    qtbot.keyClick(remembering, Key.Key_M)
    assert remembering.panels.toast.text() == "Mark 1 is in the last seconds: F10 saves them"
    qtbot.keyClick(remembering, Key.Key_F10)
    until(qtbot, lambda: remembering.recorder.status.saved is not None)
    (session,) = sessions(tmp_path / "sessions")
    assert _notes(session) == ["mark 1"]
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        assert len(reader) >= 3


def test_nothing_to_mark_or_to_save_is_said(running: OperatorWindow, qtbot: QtBot) -> None:
    qtbot.keyClick(running, Key.Key_M)
    assert "F9 begins a session" in running.panels.toast.text()
    qtbot.keyClick(running, Key.Key_F10)
    assert "Nothing to save yet" in running.panels.toast.text()


def test_neither_another_phantom_nor_f5_ends_a_recording(running: OperatorWindow, qtbot: QtBot) -> None:
    """Their keys lie among those that drive."""
    phantom, orders = running.rig.config.twin.phantom, running.rig.orders
    qtbot.keyClick(running, Key.Key_F9)
    until(qtbot, lambda: running.recorder.status.recording)
    running.panels.picker.chosen.emit("y_branch")
    assert running.rig.config.twin.phantom == phantom
    assert "The phantom stays as it is: a session is being recorded" in running.panels.toast.text()
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
        patch.setattr(session_writer, "row_of", fail)
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
    assert running.recorder.close()
    running.recorder.toggle()
    assert running.recorder._writer is writer
    assert not writer.is_alive
    assert sessions(tmp_path / "sessions") == []


def test_no_picture_of_the_old_rig_is_kept_as_one_of_the_new(
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
    window.panels.picker.chosen.emit("tree")
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


LONG_MS = 120_000


@pytest.fixture
def strip(qtbot: QtBot) -> Iterator[OfferStrip]:
    parent = QWidget()
    parent.resize(780, 440)
    qtbot.addWidget(parent)
    parent.show()
    yield OfferStrip(parent)


@pytest.fixture
def shown() -> list[Path]:
    return []


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def after(strip: OfferStrip, shown: list[Path], said: list[str]) -> Iterator[AfterSession]:
    def show(path: Path) -> bool:
        shown.append(path)
        return True

    windows = OtherWindows()
    after = AfterSession(strip, windows, show)
    for part in (after, windows):
        part.said.connect(lambda line, _: said.append(line))
    yield after
    after.close()


def session_in(folder: Path) -> Path:
    size = (320, 240)  # measured in working pixels, which are twice as many
    return record(folder, (tick_of(index, 100.0 + index / 10, size=size) for index in range(12)))


def test_one_click_evaluates_what_was_measured_by_hand_and_opens_the_report(
    after: AfterSession, strip: OfferStrip, shown: list[Path], said: list[str], qtbot: QtBot, tmp_path: Path
) -> None:
    session = session_in(tmp_path)
    images = image_files([session], 48)
    assert len(images) == 12
    measure(session / DEFAULT_NAME, images[:3], [0.0, 10.0, 20.0])
    after.offer(session)
    assert list(strip.answers) == ["Annotate", "Evaluate", "Play", "Describe", "\N{MULTIPLICATION SIGN}"]
    strip.answers["Evaluate"].click()
    assert "Evaluating" in strip.text
    qtbot.waitUntil(lambda: bool(shown), timeout=LONG_MS)
    assert shown == [session / "evaluation" / "report.html"]
    assert "the recorded configuration is lost; the default one is taken" in shown[0].read_text(), "this one kept none"
    metrics = json.loads((session / "evaluation" / "metrics.json").read_text())
    assert metrics["images"]["measured"] == 3
    assert f"0 of 3 pictures answered. Report opened: {shown[0]}" in said[-1]  # there is no robot in these pictures
    assert strip.text == ""


def test_without_anything_measured_it_leads_to_the_annotation_tool(
    after: AfterSession, strip: OfferStrip, shown: list[Path], qtbot: QtBot, tmp_path: Path
) -> None:
    session = session_in(tmp_path)
    after.evaluate(session)
    assert "Nothing is measured by hand yet" in strip.text
    assert "48 pictures, evenly over the session" in strip.text
    assert "Annotate" in strip.answers
    assert shown == []


def test_what_cannot_be_evaluated_is_one_line(
    after: AfterSession, strip: OfferStrip, said: list[str], qtbot: QtBot, tmp_path: Path
) -> None:
    session = session_in(tmp_path)
    (session / DEFAULT_NAME).write_bytes(b"no database, but long enough to be looked at " * 40)
    after.evaluate(session)
    qtbot.waitUntil(lambda: bool(said), timeout=LONG_MS)
    assert said[0].startswith("Not evaluated: ")
    assert "not an annotation file" in said[0]
    assert strip.text == ""


def test_an_evaluation_can_be_cancelled(
    after: AfterSession, strip: OfferStrip, shown: list[Path], said: list[str], qtbot: QtBot, tmp_path: Path
) -> None:
    session = session_in(tmp_path)
    measure(session / DEFAULT_NAME, image_files([session], 48)[:1], [5.0])
    after.evaluate(session)
    strip.answers["Cancel"].click()
    qtbot.waitUntil(lambda: said == ["Cancelled"], timeout=LONG_MS)
    assert shown == []


def test_a_window_that_fails_says_why(after: AfterSession, said: list[str], qtbot: QtBot, tmp_path: Path) -> None:
    after._windows.play(tmp_path / "no_session")
    qtbot.waitUntil(lambda: len(said) == 2, timeout=LONG_MS)
    assert "no_session" in said[1]


def test_the_window_offers_it_when_a_recording_ends_and_takes_it_back_when_the_next_begins(
    running: OperatorWindow, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "remembered"))
    side = WindowServices(running, tmp_path / "state")
    strip = running.panels.offers
    running.recorder.toggle()
    until(qtbot, lambda: running.recorder.status.frames >= 3)
    running.recorder.toggle()
    until(qtbot, lambda: "Session saved" in strip.text)
    live = running.panels.live
    assert strip.geometry().bottom() < live.height(), "over the picture's lower edge"
    assert strip.width() <= live.width()
    assert running.panels.toast.geometry().bottom() < strip.y(), "no message over the offer"
    session = side.after.session
    assert session is not None
    assert "Who recorded it?" in strip.text
    strip.answers["Describe"].click()
    (dialog,) = running.findChildren(DescriptionDialog)
    dialog.form.fields["operator"].setText("Ana")
    dialog.form.fields["tags"].setText("pilot")
    dialog.accept()
    running.recorder.toggle()
    until(qtbot, lambda: strip.text == "" and running.recorder.status.recording and running.recorder.status.frames >= 1)
    until(qtbot, lambda: remembered_description() == Description(operator="Ana"))
    assert read_description(session, None).tags == ("pilot",)
    running.recorder.toggle()
    until(qtbot, lambda: "Session saved" in strip.text)
    assert "Who recorded it?" not in strip.text
    assert side.after.session is not None
    assert read_manifest(side.after.session).description == Description(operator="Ana", phantom="s_curve")
    side.close()


def test_a_double_click_answers_one_offer_and_not_the_next(strip: OfferStrip, qtbot: QtBot) -> None:
    done: list[str] = []
    for key in "ab":
        strip.offer(Offer(key, f"Session {key}", answers=(OfferButton("Never ask again", lambda key=key: done.append(key)),)))
    left = Qt.MouseButton.LeftButton
    qtbot.mouseClick(strip.answers["Never ask again"], left)
    assert strip.text == "Session b"
    button = strip.answers["Never ask again"]
    qtbot.mouseDClick(button, left)
    qtbot.mouseRelease(button, left)
    assert done == ["a"]
    qtbot.mouseClick(button, left)
    assert done == ["a", "b"]


def cut(folder: Path, frames: int = 12) -> Path:
    """A session as a power failure leaves it: not closed, its last row half written."""
    session = record(folder, (tick_of(index, 100.0 + index / 10) for index in range(frames)))
    manifest = json.loads((session / MANIFEST).read_text())
    (session / MANIFEST).write_text(json.dumps(manifest | {"closed": False, "counts": {}}))
    rows = (session / "frames.jsonl").read_bytes()
    (session / "frames.jsonl").write_bytes(rows[:-30])
    return session


def content(session: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in session.iterdir()}


@pytest.fixture
def desk(strip: OfferStrip, tmp_path: Path) -> Iterator[RecoveryController]:
    desk = RecoveryController(tmp_path / "sessions", strip, tmp_path / "state" / "declined.json")
    yield desk
    desk.close()


def test_cut_sessions_are_offered_and_recovered_into_copies(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path
) -> None:
    session = cut(tmp_path / "sessions")
    time.sleep(1.1)  # sessions are named by the second
    damaged = cut(tmp_path / "sessions")
    for path in (damaged / "frames.jsonl", *damaged.glob("video_*")):
        path.write_bytes(b"\0" * 500)
    before = content(session)
    said: list[str] = []
    copies: list[Path] = []
    desk.said.connect(lambda line, _: said.append(line))
    desk.recovered.connect(lambda copy, _words: copies.append(copy))
    desk.search()
    qtbot.waitUntil(lambda: "2 recordings were cut" in strip.text, timeout=LONG_MS)
    assert session.name in strip.text and damaged.name in strip.text
    strip.answers["Recover"].click()
    qtbot.waitUntil(lambda: len(said) == 2, timeout=LONG_MS)
    assert copies == [session.with_name(session.name + "_recovered")]
    with SessionReader(copies[0]) as reader:
        assert reader.wait(10.0)
        assert len(reader) == 11
        assert reader.is_closed
    assert content(session) == before
    # 12 frames 0.1 s apart, one row gone: its picture is there, but nobody knows what it showed
    assert "0.1 s are lost (rows: 1, pictures: 0)" in said[0]
    assert "nothing left to recover" in said[1]
    assert said[1].endswith("Session > Look for cut sessions")
    assert not strip.isVisible()


def test_a_session_that_is_not_wanted_is_not_offered_again(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path
) -> None:
    session = cut(tmp_path / "sessions")
    desk.search()
    qtbot.waitUntil(lambda: "A recording was cut" in strip.text, timeout=LONG_MS)
    strip.answers["Not now"].click()
    assert not declined_names(tmp_path / "state" / "declined.json")
    desk.search()
    qtbot.waitUntil(strip.isVisible, timeout=LONG_MS)
    strip.answers["Never"].click()
    assert declined_names(tmp_path / "state" / "declined.json") == {session.name}
    desk.search()
    qtbot.waitUntil(lambda: desk._work.pending == 0)
    qtbot.wait(50)
    assert not strip.isVisible()
    desk.search(again=True)  # from the menu: it was declined, not forgotten
    qtbot.waitUntil(lambda: strip.isVisible() and "Recover" in strip.answers, timeout=LONG_MS)


def test_what_is_found_after_closing_starts_nothing(desk: RecoveryController, strip: OfferStrip, tmp_path: Path) -> None:
    desk.close()
    desk._on_found(False, [tmp_path])
    assert not strip.isVisible()


def test_a_process_that_cannot_be_started_is_said(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut(tmp_path / "sessions")
    said: list[str] = []
    desk.said.connect(lambda line, _: said.append(line))
    monkeypatch.setattr("app.ui.opening.command_of", lambda *_: ["/nowhere/python"])
    desk.search()
    qtbot.waitUntil(lambda: "Recover" in strip.answers, timeout=LONG_MS)
    strip.answers["Recover"].click()
    qtbot.waitUntil(lambda: bool(said), timeout=LONG_MS)
    assert said[0].startswith("Not recovered: cannot be started")
    assert not strip.isVisible()


def test_a_cancelled_recovery_is_no_fault_and_ends_the_others_too(
    desk: RecoveryController, strip: OfferStrip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from app.ui.workers import ChildProcess  # what is started

    started: list[ChildProcess] = []

    def start(child: ChildProcess) -> None:
        started.append(child)

    monkeypatch.setattr(ChildProcess, "start", start)
    said: list[tuple[str, bool]] = []
    desk.said.connect(lambda *line: said.append(line))
    desk.recovered.connect(lambda _copy, words: strip.offer(Offer("session", words)))
    desk._recover([tmp_path / name for name in "abc"])
    started[0].told.emit({"session": "a_recovered", "lost": {"rows": 0, "pictures": 0, "seconds": 0.0}})
    started[0].ended.emit(0, "")
    assert strip.text == "Recovering a copy: b", "not hidden behind what was recovered"
    started[1].ended.emit(130, "interrupted")
    assert said[1:] == [("Cancelled", False)]
    assert (len(started), strip.text) == (2, "")
