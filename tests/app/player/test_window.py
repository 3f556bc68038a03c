"""The player, driven by real keys and clicks: what it shows is what was recorded, and it is never taken for a live picture."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import av
import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from app.annotator.sources import default_store, session_rows
from app.commands.session import beside_line, describe
from app.player import session_model
from app.player.course import JumpKind
from app.player.window import PlayerWindow
from app.ui.description_form import DescriptionDialog
from app.ui.texts import signed_degrees
from core.annotation.model import Annotation, History, ImageView, measure_lines
from core.annotation.store import AnnotationStore, ItemKey, find_images
from core.config.models import Config
from core.control.modes import Mode
from core.session.codec import scene_to_json
from core.session.files import LineFile, add_event
from core.session.manifest import (
    Description,
    Event,
    EventKind,
    SessionError,
    event_of_target,
    read_description,
    read_manifest,
    write_manifest,
)
from core.session.reader import SessionReader
from core.session.writer import SessionWriter
from core.types import Frame, PoseState, Reason, Refusal, RobotStatus, Tick
from tests.app.fakes import FakeBench, advise, make_scene
from tests.core.session_data import ABOUT, QUICK, drive_of, record, tick_of

Key = Qt.Key
COUNT, FIRST_S, STEP_S = 60, 1000.0, 0.1
MAIN = Path(__file__).resolve().parents[3] / "main.py"
Open = Callable[..., PlayerWindow]


def make_session(folder: Path) -> Path:
    """Six seconds of the drawn bench: armed at 2 s, no robot from 3.0 to 3.4 s, a fault at 4 s, a note at 5 s."""
    bench = FakeBench()
    writer = SessionWriter(QUICK, ABOUT, folder=folder, clock=lambda: FIRST_S)
    writer.start()
    for k in range(COUNT):
        time_s = FIRST_S + k * STEP_S
        image, scene = bench.scene_at(k, time_s)
        if 30 <= k < 34:
            scene = make_scene(refusal=Refusal(Reason.NO_ROBOT, "0 px"), index=k, captured_s=time_s)
        status = RobotStatus(time_s, 40.0, 0.0, (0.0,) * 4, (0.0,) * 4, 0.01)
        tick = Tick(Frame(k, time_s, image), scene, advise(scene), None, status, 0, 10.0)
        drive = drive_of(time_s, Mode.ADVISORY if k < 20 else Mode.ARMED)
        assert writer.put(tick, drive)
        assert writer.drive(drive)
    writer.add_event(event_of_target((300.0, 200.0), FIRST_S + 1.0))
    writer.add_event(Event(FIRST_S + 4.0, EventKind.FAULT, "head jumped", {"detail": "31 px"}))
    writer.add_event(Event(FIRST_S + 5.0, EventKind.NOTE, "touches the wall"))
    assert writer.close()
    saved = writer.status().saved
    assert saved is not None
    return saved


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_session(tmp_path_factory.mktemp("sessions"))


@pytest.fixture
def open_player(qtbot: QtBot, tmp_path: Path) -> Iterator[Open]:
    """Opens players; at the end each is closed, and its threads must have ended."""
    windows: list[PlayerWindow] = []

    def opened(folder: Path, against: Path | None = None) -> PlayerWindow:
        config = Config.model_validate({"window": {"pictures_folder": str(tmp_path / "kept")}})
        window = PlayerWindow(SessionReader(folder), config, against)
        qtbot.addWidget(window)
        windows.append(window)
        window.resize(1280, 720)
        window.show()
        window.start()
        return window

    yield opened
    for window in windows:
        window.close()
        assert window._decoder.worker.wait(0)


@pytest.fixture
def player(open_player: Open, session: Path, qtbot: QtBot) -> PlayerWindow:
    """On the first frame, with all rows and events known."""
    window = open_player(session)
    until(
        qtbot,
        lambda: window.place == 0 and len(window.course) == COUNT and len(window.session.events) > 3 and window.session.is_whole,
    )
    return window


def test_here_can_be_exported(open_player: Open, session: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    """As by: play ."""
    monkeypatch.chdir(session)
    asked: list[Path] = []
    monkeypatch.setattr("app.player.window.ask_path", lambda _parent, _title, start, *_: asked.append(start))
    opened_at_start(open_player, Path(), qtbot).ask_export()
    assert asked == [session.with_name(f"{session.name}.mp4")]


def opened_at_start(open_player: Open, folder: Path, qtbot: QtBot) -> PlayerWindow:
    window = open_player(folder)
    until(qtbot, lambda: window.place == 0 and len(window.course) == COUNT)
    return window


def press(window: PlayerWindow, *keys: Qt.Key, modifier: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
    for key in keys:
        QTest.keyClick(window.focusWidget() or window, key, modifier)


def until(qtbot: QtBot, condition: Callable[[], bool]) -> None:
    """Disks of busy machines stand still for seconds."""
    qtbot.waitUntil(condition, timeout=30_000)


def at(qtbot: QtBot, window: PlayerWindow, place: int) -> None:
    until(qtbot, lambda: window.place == place)


def test_it_opens_on_the_first_frame_and_says_what_it_is(player: PlayerWindow) -> None:
    panels = player.panels
    assert panels.banner.word == "PLAYBACK"
    assert panels.plate.text.startswith("recorded SIM, ")
    assert "rig twin" in panels.plate.text
    assert "PLAYBACK" in player.windowTitle()
    assert panels.live.scene is not None
    assert panels.badge.letter in "ABCD"
    assert panels.advice.text != ""
    assert panels.mode.mode is Mode.ADVISORY
    assert panels.bar.frame.text() == f"frame 1 of {COUNT}"
    assert panels.bar.slider.maximum() == panels.bar.position.maximum() == round((COUNT - 1) * STEP_S * 1000)


def test_arrows_go_by_frames_and_show_what_was_recorded(player: PlayerWindow, session: Path, qtbot: QtBot) -> None:
    with SessionReader(session) as reader:
        reader.wait()
        for key, place in (
            (Key.Key_Right, 1),
            (Key.Key_Right, 2),
            (Key.Key_Left, 1),
            (Key.Key_End, COUNT - 1),
            (Key.Key_Left, COUNT - 2),
        ):
            press(player, key)
            at(qtbot, player, place)
            row = reader.row(place)
            assert player.panels.badge.letter == row.scene.pose.state.value
            assert player.panels.bar.position.value() == round(place * STEP_S * 1000)
    press(player, Key.Key_Home)
    at(qtbot, player, 0)
    press(player, Key.Key_Left)  # there is nothing before
    press(player, Key.Key_Right, modifier=Qt.KeyboardModifier.ShiftModifier)
    at(qtbot, player, 10)
    press(player, Key.Key_Right, modifier=Qt.KeyboardModifier.ControlModifier)
    at(qtbot, player, COUNT - 1)


def test_space_plays_and_pauses_wherever_the_focus_is(player: PlayerWindow, qtbot: QtBot) -> None:
    player.panels.bar.note.setFocus()
    press(player, Key.Key_Space)
    assert player.clock.is_playing
    assert not player.panels.note.isVisible()
    assert player.panels.bar.play.accessibleName() == "Pause"
    until(qtbot, lambda: player.place > 2)
    until(qtbot, lambda: player.place >= 4)
    press(player, Key.Key_Space)
    assert not player.clock.is_playing
    until(qtbot, lambda: player.place == player._requested)
    scene = player.panels.live.scene
    assert player.panels.gauge.text == signed_degrees(scene.pose.theta_signed_deg, 1), "of this frame, not of some before"
    position_s = player.clock.position_s
    qtbot.wait(60)
    assert player.clock.position_s == position_s


def test_it_plays_to_the_end_and_from_the_beginning_again(player: PlayerWindow, qtbot: QtBot) -> None:
    for _ in range(3):
        press(player, Key.Key_BracketRight)
    assert player.clock.speed == 8.0
    player.go(COUNT - 10)
    press(player, Key.Key_Space)
    until(qtbot, lambda: not player.clock.is_playing and player.place == COUNT - 1)
    press(player, Key.Key_Space)
    assert player.clock.is_playing
    assert player.clock.position_s < 1.0
    press(player, Key.Key_R)
    assert player.clock.speed == 1.0
    for _ in range(3):
        press(player, Key.Key_BracketLeft)
    assert (player.clock.speed, player.panels.bar.speed.currentData()) == (0.1, 0.1)


def test_n_and_p_jump_to_the_chosen_kind(player: PlayerWindow, qtbot: QtBot) -> None:
    def choose(kind: JumpKind) -> None:
        for _ in range(len(JumpKind)):
            if player.jump_kind is not kind:
                press(player, Key.Key_K)
        assert player.jump_kind is kind
        assert player.panels.bar.kind.currentData() is kind

    for kind, place in ((JumpKind.FAULT, 40), (JumpKind.NOTE, 50), (JumpKind.MODE, 20), (JumpKind.TARGET, 10)):
        choose(kind)
        player.go(5)
        press(player, Key.Key_N)
        at(qtbot, player, place)
        press(player, Key.Key_N)
        assert player.panels.toast.text() == f"No {kind.value.lower()} after this frame"
    choose(JumpKind.STATE)
    player.go(29)
    press(player, Key.Key_N)
    at(qtbot, player, 30)
    press(player, Key.Key_N)
    at(qtbot, player, 34)
    press(player, Key.Key_P)
    at(qtbot, player, 30)


def test_a_time_is_typed_or_dragged(player: PlayerWindow, qtbot: QtBot) -> None:
    """As the clock shows it or in seconds; anything else changes nothing, and one beyond the end is the end."""
    bar = player.panels.bar
    right = dict.fromkeys(("0:03.5", "3.5", "3,5", "3.5 s", "3500 ms", "0:0:3.5"), "0:03.500")
    for typed, shown in {**right, "1:": "0:01.000", "abc": "0:01.000", "..": "0:01.000", "99:00": "0:05.900"}.items():
        player.seek(1.0)
        press(player, Key.Key_T)
        QTest.keyClicks(bar.position, typed)
        QTest.keyClick(bar.position, Key.Key_Return)
        assert bar.position.text() == shown
        assert player.focusWidget() is player.panels.live
    player.seek(1.0)
    press(player, Key.Key_T)
    QTest.keyClicks(bar.position, "4.5")
    QTest.keyClick(bar.position, Key.Key_Escape)
    qtbot.wait(50)
    assert player.clock.position_s == pytest.approx(1.0)
    bar.slider.setValue(4199)
    at(qtbot, player, 41)
    assert bar.position.value() == 4199


def test_the_timeline_is_clicked_zoomed_and_selected(player: PlayerWindow, qtbot: QtBot) -> None:
    line = player.panels.timeline
    middle = QPoint((50 + line.width() - 10) // 2, line.height() // 2)
    width = line.width() - 60
    assert line.text_at(50 + 3.2 / 5.9 * width) == "0:03.200  no pose  ARMED"
    state, angle = line.text_at(50 + 1.0 / 5.9 * width).split("  ")[1:3]
    assert state[:6] == "state " and angle.endswith("°")
    QTest.mouseClick(line, Qt.MouseButton.LeftButton, pos=middle)
    assert player.clock.position_s == pytest.approx((COUNT - 1) * STEP_S / 2, abs=0.05)
    press(player, Key.Key_Plus)
    low, high = line.view
    assert high - low == pytest.approx(5.9 / 1.5)
    assert low < player.clock.position_s < high
    press(player, Key.Key_0, modifier=Qt.KeyboardModifier.ControlModifier)
    assert line.view == (0.0, pytest.approx(5.9))
    shift = Qt.KeyboardModifier.ShiftModifier
    QTest.mousePress(line, Qt.MouseButton.LeftButton, shift, QPoint(middle.x() - 100, 60))
    QTest.mouseMove(line, QPoint(middle.x(), 60))
    QTest.mouseRelease(line, Qt.MouseButton.LeftButton, shift, middle)
    assert player.selection[1] == pytest.approx(2.95, abs=0.05)
    assert "selected 0:0" in line.accessibleDescription()
    player.panels.live.setFocus()
    press(player, Key.Key_Escape)
    assert player.selection is None
    # the fault's mark is three pixels away
    place = QPoint(round(50 + 4.0 / 5.9 * (line.width() - 60)) + 3, 26)
    QTest.mouseClick(line, Qt.MouseButton.LeftButton, pos=place)
    at(qtbot, player, 40)


def test_what_a_row_tells_is_shown_with_it(player: PlayerWindow, qtbot: QtBot) -> None:
    panels = player.panels
    told = panels.values.toPlainText()
    assert "frame 0 of the camera, captured at 1000.000 s, 640 \N{MULTIPLICATION SIGN} 480 px" in told
    assert "insertion 40.0 mm, sheath 0.0 mm" in told
    assert "perception 27.5 ms: " in told
    assert panels.live._target is None
    player.go(12)
    at(qtbot, player, 12)
    assert panels.live._target == (300.0, 200.0), "from when it was chosen"
    player.go(31)
    at(qtbot, player, 31)
    assert "no pose: no robot: 0 px" in panels.values.toPlainText()
    assert (panels.badge.letter, panels.badge.title) == ("-", "No robot in view")
    assert panels.gauge.text == "\N{EN DASH}"
    assert panels.mode.mode is Mode.ARMED


def test_the_list_of_events_leads_to_them(player: PlayerWindow, qtbot: QtBot) -> None:
    press(player, Key.Key_F6)
    listed = player.panels.events
    assert listed.hasFocus()
    assert listed.lines[-2:] == ["0:04.000  fault: head jumped (31 px)", "0:05.000  note: touches the wall"]
    row = len(listed.lines) - 1
    QTest.mouseClick(listed.viewport(), Qt.MouseButton.LeftButton, pos=listed.visualRect(listed.model().index(row, 0)).center())
    at(qtbot, player, 50)


def test_a_note_is_kept_in_the_session(open_player: Open, tmp_path: Path, qtbot: QtBot) -> None:
    folder = make_session(tmp_path)
    window = opened_at_start(open_player, folder, qtbot)
    window.go(22)
    press(window, Key.Key_M)
    assert window.panels.note.hasFocus()
    QTest.keyClicks(window.panels.note, "space n and p are letters here")
    press(window, Key.Key_Return)
    until(qtbot, lambda: any(event.text == "space n and p are letters here" for event in window.session.events))
    with SessionReader(folder) as reader:
        (kept,) = [event for event in reader.events if "letters" in event.text]
    assert (kept.kind, kept.time_s) == (EventKind.NOTE, pytest.approx(FIRST_S + 2.2))
    assert "0:02.200  note: space n and p are letters here" in window.panels.events.lines
    press(window, Key.Key_M)
    QTest.keyClicks(window.panels.note, "never mind")
    press(window, Key.Key_Escape)
    assert not window.panels.note.isVisible()
    assert not any("never" in event.text for event in window.session.events)


def test_a_note_stays_at_its_time_and_is_lost_by_nothing(open_player: Open, tmp_path: Path, qtbot: QtBot) -> None:
    folder = make_session(tmp_path)
    window = opened_at_start(open_player, folder, qtbot)
    window.seek(2.0)
    press(window, Key.Key_M)
    QTest.keyClicks(window.panels.note, "head touches")
    window.panels.live.setFocus()
    press(window, Key.Key_M)
    QTest.keyClicks(window.panels.note, " the wall")
    window.seek(4.6)
    QTest.keyClick(window.panels.note, Key.Key_Return)
    until(qtbot, lambda: any(event.text == "head touches the wall" for event in window.session.events))
    press(window, Key.Key_M)
    QTest.keyClicks(window.panels.note, "written while closing")
    window.close()
    with SessionReader(folder) as reader:
        kept = {event.text: event.time_s - FIRST_S for event in reader.events if event.kind is EventKind.NOTE}
    assert kept["head touches the wall"] == pytest.approx(2.0)
    assert kept["written while closing"] == pytest.approx(4.6)


def test_notes_that_the_disk_does_not_take_are_not_lost(
    open_player: Open, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = threading.Event()

    def refuse(folder: Path, _event: Event) -> None:
        written.wait(20.0)
        raise SessionError(f"{folder}: read-only")

    window = opened_at_start(open_player, make_session(tmp_path), qtbot)
    with monkeypatch.context() as patch:
        patch.setattr(session_model, "add_event", refuse)
        for place, text in ((22, "a long careful remark"), (30, "another")):
            window.go(place)
            press(window, Key.Key_M)
            QTest.keyClicks(window.panels.note, text)
            press(window, Key.Key_Return)
        written.set()
        until(qtbot, lambda: window.panels.note.isVisible() and len(window._refused_notes) == 1)
    assert "read-only" in window.panels.toast.text()
    until(qtbot, lambda: window.place == 22)
    assert window.panels.note.text() == "a long careful remark"
    press(window, Key.Key_Return)  # there is room again
    until(qtbot, lambda: window.panels.note.text() == "another")
    press(window, Key.Key_Return)
    until(qtbot, lambda: {"a long careful remark", "another"} <= {event.text for event in window.session.events})


def test_a_session_that_was_cut_says_so(open_player: Open, tmp_path: Path, qtbot: QtBot) -> None:
    folder = make_session(tmp_path)
    write_manifest(folder, read_manifest(folder).model_copy(update={"closed": False}))
    window = open_player(folder)
    until(qtbot, lambda: "did not end properly" in window.panels.problems.toPlainText())
    assert window.panels.plate.text.endswith(", cut off")


def test_a_note_into_a_session_that_is_being_recorded_is_refused(open_player: Open, tmp_path: Path, qtbot: QtBot) -> None:
    folder = make_session(tmp_path)
    write_manifest(folder, read_manifest(folder).model_copy(update={"closed": False}))
    (folder / "frames.jsonl").rename(folder / "old")
    lock = LineFile(folder / "frames.jsonl")
    try:
        for line in (folder / "old").read_text().splitlines():
            lock.write(line)
        window = open_player(folder)
        until(qtbot, lambda: "still being recorded" in window.panels.toast.text())
        until(qtbot, lambda: window.place == 0)
        assert "did not end properly" not in window.panels.problems.toPlainText()
        assert window.panels.plate.text.endswith(", being recorded")
        press(window, Key.Key_M)
        QTest.keyClicks(window.panels.note, "x")
        press(window, Key.Key_Return)
        until(qtbot, lambda: "stop the recording first" in window.panels.toast.text())
    finally:
        lock.close()


def test_the_selection_becomes_a_video_with_the_banner_in_it(player: PlayerWindow, tmp_path: Path, qtbot: QtBot) -> None:
    player.go(10)
    press(player, Key.Key_I)
    player.go(14)
    press(player, Key.Key_O)
    assert player.selection == (pytest.approx(1.0), pytest.approx(1.4))
    assert player.panels.bar.clip.text() == "Clip 0.4 s"
    press(player, Key.Key_E)
    qtbot.waitUntil(lambda: "Exported" in player.panels.offers.text, timeout=120_000)
    assert next(iter(player.panels.offers.answers)) == "Open its folder"
    (path,) = (tmp_path / "kept").iterdir()
    assert path.name.endswith("_1000-1400ms.mp4")
    with av.open(str(path)) as container:
        assert sum(1 for _ in container.decode(video=0)) == 5


EXPORT = """
import pathlib, sys, time
go, out = map(pathlib.Path, sys.argv[1:])
while not go.exists():
    time.sleep(0.01)
out.parent.mkdir(exist_ok=True)
out.touch()
print('{"problems": []}')
"""


def test_a_file_is_exported_once_at_a_time_and_a_closed_player_ends_no_export(
    player: PlayerWindow, session: Path, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    go, out = tmp_path / "go", tmp_path / "kept" / f"{session.name}.mp4"
    command = [sys.executable, "-c", EXPORT, str(go)]
    monkeypatch.setattr("app.ui.opening.command_of", lambda *words: [*command, words[words.index("--out") + 1]])
    press(player, Key.Key_E, Key.Key_E)
    assert player.panels.toast.text() == f"{out.name} is being written already"
    go.touch()
    until(qtbot, lambda: player.panels.offers.text.startswith("Exported"))
    go.unlink()
    press(player, Key.Key_E)
    assert player.panels.offers.text == f"Exporting {session.name}_2.mp4", "not hidden behind the one before"
    player.close()
    go.touch()
    until(qtbot, out.with_name(f"{session.name}_2.mp4").exists)


def test_a_clip_is_cancelled_without_a_trace(player: PlayerWindow, tmp_path: Path, qtbot: QtBot) -> None:
    press(player, Key.Key_E)
    player.panels.offers.answers["Cancel"].click()
    qtbot.waitUntil(lambda: player.panels.toast.text() == "Cancelled", timeout=120_000)
    assert not list((tmp_path / "kept").glob("*"))


def test_a_snapshot_tells_that_it_is_played_back(player: PlayerWindow, tmp_path: Path, qtbot: QtBot) -> None:
    press(player, Key.Key_S)  # in the operator window it retracts the robot: it does nothing here
    assert player.panels.toast.text() == ""
    press(player, Key.Key_S, modifier=Qt.KeyboardModifier.ControlModifier)
    until(qtbot, lambda: "Snapshot saved" in player.panels.toast.text())
    (values,) = (tmp_path / "kept").glob("*.json")
    told = json.loads(values.read_text())
    assert (told["rig"], told["frame"], told["model"]) == ("SIM PLAYBACK", 0, "default")


def test_damage_is_listed_and_the_rest_is_played(open_player: Open, tmp_path: Path, qtbot: QtBot) -> None:
    folder = make_session(tmp_path)
    lines = (folder / "frames.jsonl").read_bytes().splitlines()
    lines[5] = lines[5][:-40]
    (folder / "frames.jsonl").write_bytes(b"\n".join(lines) + b"\n")
    video = folder / "video_0000.mkv"
    data = bytearray(video.read_bytes())
    half = len(data) // 2
    data[half : half + 3000] = bytes(3000)
    video.write_bytes(bytes(data))
    (folder / "manifest.json").write_text("{")
    window = open_player(folder)
    until(qtbot, lambda: window.place == 0 and len(window.course) == COUNT - 1)
    assert "manifest is damaged" in window.panels.plate.text
    assert window.panels.plate.text.startswith("recorded UNKNOWN")
    for place in range(len(window.course)):
        window.go(place)
        at(qtbot, window, place)
    until(qtbot, lambda: "no picture at" in window.panels.problems.toPlainText())
    problems = window.panels.problems.toPlainText()
    assert "line 6" in problems
    assert "manifest.json: damaged" in problems
    assert "1 rows are missing" in problems
    assert "Problems" in window.panels.pages.tabText(3)
    window.go(0)
    at(qtbot, window, 0)
    assert window.panels.badge.letter in {state.value for state in PoseState}


def test_a_lost_picture_is_said_and_nothing_of_another_is_shown(open_player: Open, tmp_path: Path, qtbot: QtBot) -> None:
    folder = make_session(tmp_path)
    (folder / "video_0000.mkv").unlink()
    window = open_player(folder)
    at(qtbot, window, 0)
    assert window.panels.notice.text.startswith("This picture is lost")
    assert window.panels.live.scene is None
    assert window.panels.badge.letter == "-"
    press(window, Key.Key_S, modifier=Qt.KeyboardModifier.ControlModifier)
    assert "No snapshot" in window.panels.toast.text()


def test_a_session_without_rows_says_what_to_do(open_player: Open, tmp_path: Path, qtbot: QtBot) -> None:
    folder = record(tmp_path, [tick_of(0, FIRST_S)])
    (folder / "frames.jsonl").unlink()
    window = open_player(folder)
    until(qtbot, lambda: window.panels.notice.text.startswith("Nothing to play"))
    assert "session recover" in window.panels.notice.text
    for key in (Key.Key_Space, Key.Key_N, Key.Key_Right, Key.Key_E, Key.Key_I, Key.Key_M, Key.Key_Return, Key.Key_End):
        press(window, key)
    assert window.place == -1


def replayed_file(session: Path, out: Path, *, name: str | None = None) -> Path:
    """Results of a replay that sees what was recorded, but rows 12 to 14 turned by ten degrees and nothing in row 20."""
    lines = []
    with SessionReader(session) as reader:
        reader.wait()
        for place in range(len(reader)):
            row = reader.row(place)
            record = scene_to_json(f"{name or session.name}#{row.row}", row.scene)
            if 12 <= place < 15:
                record["theta_signed_deg"] += 10.0
            if place == 20:
                record |= {"state": None, "theta_signed_deg": None, "reason": "low confidence: 12 %"}
            lines.append(json.dumps(record))
    out.write_text("\n".join([*lines, "{ nonsense"]) + "\n")
    return out


def test_angles_by_hand_are_shown_beside_the_recording(open_player: Open, session: Path, tmp_path: Path, qtbot: QtBot) -> None:
    copy = tmp_path / session.name
    shutil.copytree(session, copy)
    pictures = session_rows(copy, "12,50")
    with AnnotationStore(default_store([copy])) as store:
        images, _ = find_images(pictures, store)
        for image, down_px in zip(images, (10.0, 0.0), strict=True):
            content = Annotation(((100.0, 100.0), (160.0, 100.0 + down_px)), ((60.0, 90.0), (240.0, 90.0)))
            entry = History().edit("draw", content)
            assert entry is not None
            measured = measure_lines(content, image.record.size, Config().perception)
            store.save(ItemKey(image.sha256, "", "ann", 1), ImageView.AS_IS, entry, content, measured, 1.0)
    window = open_player(copy)
    until(qtbot, lambda: window.session.is_whole and window.session.course.by_hand is not None)
    by_hand = window.session.course.by_hand
    assert by_hand[:, 0] == pytest.approx([1.2, 5.0])
    assert np.abs(by_hand[:, 1]) == pytest.approx([math.degrees(math.atan2(10.0, 60.0)), 0.0])
    timeline = window.panels.timeline
    assert "by hand" in timeline.text_at(timeline._x(1.2))
    assert "by hand" not in timeline.text_at(timeline._x(3.0))
    timeline.grab()


def test_a_replay_is_shown_beside_the_recording(open_player: Open, session: Path, tmp_path: Path, qtbot: QtBot) -> None:
    window = open_player(session, replayed_file(session, tmp_path / "again.jsonl"))
    until(qtbot, lambda: window.jump_kind is JumpKind.REPLAY)
    assert window.panels.toast.text() == "1 results of the replay cannot be read"
    other = window.panels.other
    until(qtbot, lambda: other.scene is not None and other.scene.pose is not None)
    until(qtbot, lambda: len(window.course) == COUNT)
    window.go(5)
    for place, told in ((12, "(+10.0°)"), (20, "no pose, low confidence: 12 %")):
        press(window, Key.Key_N)
        at(qtbot, window, place)
        until(qtbot, lambda told=told: told in window.panels.compared.text())
    assert (other.scene.pose, other.scene.refusal) == (None, Refusal(Reason.LOW_CONFIDENCE, "12 %"))
    assert other.scene.path is not None
    press(window, Key.Key_N)
    assert "No difference after this frame" in window.panels.toast.text()


@pytest.mark.parametrize(("text", "why"), [("{}\n", "no results in it"), (None, "of another session")])
def test_results_that_do_not_belong_here_are_refused(
    open_player: Open, session: Path, tmp_path: Path, qtbot: QtBot, text: str | None, why: str
) -> None:
    path = tmp_path / "again.jsonl"
    if text is None:
        replayed_file(session, path, name="session_of_someone_else")
    else:
        path.write_text(text)
    window = open_player(session, path)
    until(qtbot, lambda: why in window.panels.toast.text())
    at(qtbot, window, 0)  # the recording plays all the same


def test_frames_are_annotated_in_a_window_of_their_own(
    open_player: Open, session: Path, tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, ...]] = []

    def command(*arguments: str) -> list[str]:
        asked.append(arguments)
        return [sys.executable, "-c", "import sys; sys.exit('error: no such file')"]

    monkeypatch.setattr("app.ui.opening.command_of", command)
    again = tmp_path / "again.jsonl"
    replayed_file(session, again)
    window = open_player(session, again)
    until(qtbot, lambda: len(window.course) == COUNT and window.course.differs is not None)
    window.go(7)
    press(window, Key.Key_A)
    assert asked == [("annotate", str(session), "--rows", "7")]
    until(qtbot, lambda: window.panels.toast.text() == "no such file")
    window.annotate_refused()
    assert asked[-1][-1] == "30,31,32,33"
    window.annotate_differences()
    assert asked[-1][-1] == "12,20"
    window.select((0.0, 1.5))
    window.annotate_differences()
    assert asked[-1][-1] == "12"
    window.annotate_refused()
    assert len(asked) == 4 and window.panels.toast.text() == "No frame without a pose here"
    until(qtbot, lambda: not window.others._children)


def test_the_player_says_what_the_session_is_about_and_keeps_changes(
    open_player: Open, session: Path, tmp_path: Path, qtbot: QtBot
) -> None:
    copy = Path(shutil.copytree(session, tmp_path / session.name))
    window = open_player(copy)
    until(qtbot, lambda: window.place == 0)
    press(window, Key.Key_D)
    (dialog,) = window.findChildren(DescriptionDialog)
    dialog.form.fields["operator"].setText("Ana")
    dialog.form.fields["tags"].setText("pilot")
    QTest.keyClick(dialog.form.fields["operator"], Key.Key_Return)
    until(qtbot, lambda: "Ana" in window.panels.plate.text)
    assert "#pilot" in window.panels.plate.toolTip()
    assert read_description(copy, None) == Description(operator="Ana", tags=("pilot",))


def test_the_command_refuses_what_is_no_session_in_one_line(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, str(MAIN), "play", str(tmp_path)], capture_output=True, text=True, check=False)
    assert (done.returncode, "not a session" in done.stderr, "Traceback" in done.stderr) == (2, True, False)


def test_a_run_is_shown_beside_its_rehearsal(open_player: Open, session: Path, tmp_path: Path, qtbot: QtBot) -> None:
    folder = tmp_path / session.name
    shutil.copytree(session, folder)
    bench = FakeBench()
    paths = [bench.scene_at(k, FIRST_S + k * STEP_S)[1].path for k in range(0, COUNT, 2)]
    heads = [path.head for path in paths if path is not None]
    way: dict[str, object] = {"along_mm": [*range(len(heads))], "xy": heads, "runs": [50] * len(heads)}
    way |= {"low_xy": [(x, y + 4.0) for x, y in heads], "high_xy": [(x, y - 4.0) for x, y in heads]}
    way |= {"wall_force_n": [0.2] * len(heads), "time_s": [(k, k + 1, k + 2) for k in range(len(heads))]}
    share = {"share": 0.96, "low": 0.86, "high": 0.99}
    found = {"target_xy": heads[-1], "size_px": (640, 480), "runs": 50, "arrived": share, "way": way, "speed_mm_s": 8.0}
    add_event(folder, event_of_target(heads[-1], FIRST_S + 2.0, found))
    window = opened_at_start(open_player, folder, qtbot)
    assert window.panels.live._marks.rehearsal is None
    window.go(45)
    until(qtbot, lambda: window.place == 45)
    assert window.panels.live._marks.rehearsal is not None
    line = window.panels.values.toPlainText().splitlines()[0]
    assert line.startswith("rehearsal: within the band") and line.endswith("with up to 0.20 N at the wall")
    window.go(5)
    until(qtbot, lambda: window.place == 5)
    assert window.panels.live._marks.rehearsal is None
    with SessionReader(folder) as reader:
        reader.wait()
        (run,) = describe(reader)["rehearsals"]
    assert run["inside_share"] == 1.0 and run["left_band"] == [] and "100% in the band" in beside_line(run)
