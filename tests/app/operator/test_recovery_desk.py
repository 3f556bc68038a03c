"""Cut sessions are found, measured, offered and recovered into a copy, by real processes; the damaged original stays as it is."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.operator import recording
from app.operator.recording import Declined, RecoveryController, loss_words
from app.widgets.messages import OfferStrip
from core.session.files import is_being_written
from core.session.manifest import MANIFEST
from core.session.reader import SessionReader
from core.session.recovery import CutSession
from tests.core.session_data import record, tick_of

LONG_MS = 60_000  # two Python processes on a busy computer


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
def strip(qtbot: QtBot) -> Iterator[OfferStrip]:
    parent = QWidget()
    parent.resize(780, 440)
    qtbot.addWidget(parent)
    parent.show()
    yield OfferStrip(parent)


@pytest.fixture
def desk(strip: OfferStrip, tmp_path: Path) -> Iterator[RecoveryController]:
    desk = RecoveryController(tmp_path / "sessions", strip, Declined(tmp_path / "state" / "declined.json"))
    yield desk
    desk.close()


def test_a_cut_session_is_offered_with_its_loss_and_recovered_into_a_copy(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path
) -> None:
    session = cut(tmp_path / "sessions")
    before = content(session)
    said: list[str] = []
    copies: list[Path] = []
    desk.said.connect(lambda line, _: said.append(line))
    desk.recovered.connect(lambda copy, _words: copies.append(copy))
    desk.search()
    qtbot.waitUntil(lambda: "Recover" in strip.answers, timeout=LONG_MS)
    # 12 frames 0.1 s apart, one row gone: its picture is there, but nobody knows what it showed
    assert "0.1 s are lost (rows: 1, pictures: 0)" in strip.text
    assert session.name in strip.text
    strip.answers["Recover"].click()
    qtbot.waitUntil(lambda: bool(copies), timeout=LONG_MS)
    assert copies == [session.with_name(session.name + "_recovered")]
    with SessionReader(copies[0]) as reader:
        assert reader.wait(10.0)
        assert len(reader) == 11
        assert reader.is_closed
    assert content(session) == before
    assert "0.1 s are lost" in said[-1]
    assert not strip.isVisible()


def test_a_session_that_is_not_wanted_is_not_offered_again(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path
) -> None:
    session = cut(tmp_path / "sessions")
    desk.search()
    qtbot.waitUntil(lambda: "Never" in strip.answers, timeout=LONG_MS)
    strip.answers["Never"].click()
    assert Declined(tmp_path / "state" / "declined.json").names() == {session.name}
    desk.search()
    qtbot.waitUntil(lambda: desk._work.pending == 0)
    qtbot.wait(50)
    assert not strip.isVisible()
    desk.search(again=True)  # from the menu: it was declined, not forgotten
    qtbot.waitUntil(lambda: strip.isVisible() and "Recover" in strip.answers, timeout=LONG_MS)


def test_what_is_found_after_closing_starts_nothing(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path
) -> None:
    cut(tmp_path / "sessions")
    desk.search()
    desk.close()
    desk._on_found("look", [CutSession(tmp_path, "cut", 1)])
    assert desk._child is None
    assert not strip.isVisible()


def test_not_now_goes_on_to_the_next_one_and_asks_again_at_the_next_start(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path
) -> None:
    first = cut(tmp_path / "sessions")
    time.sleep(1.1)  # sessions are named by the second
    second = cut(tmp_path / "sessions")
    desk.search()
    qtbot.waitUntil(lambda: "(1 of 2)" in strip.text, timeout=LONG_MS)
    assert first.name in strip.text
    strip.answers["Not now"].click()
    qtbot.waitUntil(lambda: "(2 of 2)" in strip.text, timeout=LONG_MS)
    assert second.name in strip.text
    strip.answers["\N{MULTIPLICATION SIGN}"].click()
    assert not Declined(tmp_path / "state" / "declined.json").names()
    desk.search()
    qtbot.waitUntil(lambda: "(1 of 2)" in strip.text, timeout=LONG_MS)


def test_what_cannot_be_recovered_is_said_and_can_be_declined(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path
) -> None:
    session = cut(tmp_path / "sessions")
    (session / "frames.jsonl").write_bytes(b"\0" * 500)
    for video in session.glob("video_*"):
        video.write_bytes(b"\0" * 500)
    desk.search()
    qtbot.waitUntil(lambda: "cannot be recovered" in strip.text, timeout=LONG_MS)
    assert "nothing left to recover" in strip.text
    strip.answers["Never"].click()
    assert Declined(tmp_path / "state" / "declined.json").names() == {session.name}


_NOWHERE, _KILLED = ["/nowhere/python"], ["/bin/sh", "-c", "kill -9 $$"]


@pytest.mark.parametrize(
    ("what", "command", "told"),
    [
        ("looking", _NOWHERE, "could not be started"),
        ("recovering", _KILLED, "was ended from outside"),
        pytest.param("looking", _KILLED, "was ended from outside", marks=pytest.mark.slow),
        pytest.param("recovering", _NOWHERE, "could not be started", marks=pytest.mark.slow),
    ],
)
def test_a_process_that_says_nothing_is_no_word_against_the_session_and_can_be_tried_again(
    desk: RecoveryController,
    strip: OfferStrip,
    qtbot: QtBot,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    what: str,
    command: list[str],
    told: str,
) -> None:
    session = cut(tmp_path / "sessions")
    copies: list[Path] = []
    desk.recovered.connect(lambda copy, _words: copies.append(copy))
    if what == "recovering":
        desk.search()
        qtbot.waitUntil(lambda: "Recover" in strip.answers, timeout=LONG_MS)
    with monkeypatch.context() as broken:
        broken.setattr(recording, "command_of", lambda *_: command)
        if what == "recovering":
            strip.answers["Recover"].click()
        else:
            desk.search()
        qtbot.waitUntil(lambda: "Try again" in strip.answers, timeout=LONG_MS)
        assert told in strip.text
        assert session.name in strip.text
        assert "cannot be recovered" not in strip.text
        assert "Never" not in strip.answers  # nobody knows anything against it
        strip.answers["Try again"].click()
        qtbot.waitUntil(lambda: desk._child is None and "Try again" in strip.answers, timeout=LONG_MS)
    strip.answers["Try again"].click()
    if what == "looking":
        qtbot.waitUntil(lambda: "Recover" in strip.answers, timeout=LONG_MS)
        strip.answers["Recover"].click()
    qtbot.waitUntil(lambda: bool(copies), timeout=LONG_MS)
    assert not strip.isVisible()


def test_a_session_that_could_not_be_looked_at_is_asked_for_again_at_the_next_start(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut(tmp_path / "sessions")
    with monkeypatch.context() as broken:
        broken.setattr(recording, "command_of", lambda *_: ["/nowhere/python"])
        desk.search()
        qtbot.waitUntil(lambda: "Not now" in strip.answers, timeout=LONG_MS)
        strip.answers["Not now"].click()
    assert not strip.isVisible()
    assert not Declined(tmp_path / "state" / "declined.json").names()
    desk.search()
    qtbot.waitUntil(lambda: "Recover" in strip.answers, timeout=LONG_MS)


def test_a_folder_that_is_not_there_and_whole_sessions_offer_nothing(
    desk: RecoveryController, strip: OfferStrip, qtbot: QtBot, tmp_path: Path
) -> None:
    said: list[str] = []
    desk.said.connect(lambda line, _: said.append(line))
    desk.search()
    qtbot.waitUntil(lambda: desk._work.pending == 0)
    whole = record(tmp_path / "sessions", (tick_of(index, 100.0 + index / 10) for index in range(3)))
    assert not is_being_written(whole)
    desk.search(again=True)
    qtbot.waitUntil(lambda: bool(said))
    assert "No cut session" in said[0]
    assert strip.text == ""


@pytest.mark.parametrize("text", ["", "{", '{"a": 1}', "[[[", "\0"])
def test_a_damaged_list_of_declined_ones_declines_nothing(text: str, tmp_path: Path) -> None:
    path = tmp_path / "declined.json"
    path.write_text(text)
    declined = Declined(path)
    assert declined.names() == set()
    declined.add("session_a")
    declined.add("session_b")
    assert declined.names() == {"session_a", "session_b"}


def test_a_loss_in_words() -> None:
    assert loss_words({"seconds": 0.2, "rows": 1, "pictures": 6}) == "0.2 s are lost (rows: 1, pictures: 6)"
    assert loss_words({"seconds": 0.0, "rows": 0, "pictures": 0}) == "nothing of it is lost"
