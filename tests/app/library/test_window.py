"""The library: listed at once, searched, described and opened from there; broken sessions and refused disks are said."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import ClassVar

import pytest
from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot

from app.library import model as library_model
from app.library.model import SUMMARY, LibraryModel, SortOrder
from app.library.window import LibraryWindow
from app.ui import opening
from app.ui.opening import OfferedCommand
from core.session import manifest as manifests
from core.session.library import SummaryCache
from core.session.manifest import MANIFEST, Description, read_description, read_manifest, write_description
from core.session.writer import SessionWriter
from tests.core.session_data import ABOUT, QUICK, record, tick_of, wait_for

Open = Callable[[Path], LibraryWindow]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three sessions: by Ana (a second), by Ben (three seconds), and one that nothing was said of."""
    folder = tmp_path / "sessions"
    for name, seconds in (("Ana", 1), ("Ben", 3), ("", 2)):
        session = record(folder, (tick_of(k, 1000.0 + k, full=True) for k in range(seconds + 1)))
        if name:
            write_description(session, Description(operator=name, task="loop", tags=("pilot", name.lower())))
    return folder


@pytest.fixture
def open_library(qtbot: QtBot, tmp_path: Path) -> Iterator[Open]:
    windows: list[LibraryWindow] = []

    def opened(folder: Path) -> LibraryWindow:
        window = LibraryWindow(LibraryModel(folder, SummaryCache(tmp_path / "cache.sqlite")))
        qtbot.addWidget(window)
        windows.append(window)
        window.resize(1280, 720)
        window.show()
        window.start()
        qtbot.waitUntil(lambda: window._model.is_scanned)
        return window

    yield opened
    for window in windows:
        window.close()


def listed(window: LibraryWindow) -> list[str]:
    """The operators of the sessions that are listed, in order."""
    rows = range(window.sessions.rowCount())
    return [window.sessions.index(row, 0).data(SUMMARY).description.operator for row in rows]


def all_read(window: LibraryWindow, qtbot: QtBot) -> None:
    qtbot.waitUntil(lambda: all(one.seconds is not None for one in window._model.summaries))


def test_sessions_are_searched_sorted_and_shown(open_library: Open, folder: Path, qtbot: QtBot) -> None:
    window = open_library(folder)
    panels = window.panels
    all_read(window, qtbot)
    assert panels.count.text() == "3 of 3"
    panels.order.setCurrentIndex(panels.order.findData(SortOrder.LONGEST))
    panels.order.activated.emit(panels.order.currentIndex())
    assert listed(window) == ["Ben", "", "Ana"]
    QTest.keyClick(panels.list, Qt.Key.Key_Slash)
    QTest.keyClicks(panels.search, "loop an")
    assert listed(window) == ["Ana"]
    assert panels.form.description.operator == "Ana"
    assert "D 100 %" in panels.facts.text()
    assert not panels.picture.pixmap().isNull()
    panels.search.clear()
    panels.tags.setCurrentIndex(panels.tags.findData("pilot"))
    panels.tags.activated.emit(panels.tags.currentIndex())
    assert sorted(listed(window)) == ["Ana", "Ben"]
    panels.search.setText("nobody")
    assert (listed(window), panels.count.text(), panels.card.isVisible()) == ([], "0 of 3", False)


def test_what_is_typed_is_kept_beside_the_session(open_library: Open, folder: Path, qtbot: QtBot) -> None:
    window = open_library(folder)
    all_read(window, qtbot)
    window.panels.search.setText("ana")
    session = window.summary.folder
    before = (session / MANIFEST).read_bytes()
    window.panels.search.setText("")
    QTest.keyClick(window.panels.list, Qt.Key.Key_D)
    field = window.panels.form.fields["tags"]
    field.setFocus()
    field.setText("pilot, repeated")
    QTest.keyClick(field, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: read_description(session, None).tags == ("pilot", "repeated"))
    qtbot.waitUntil(lambda: window.panels.tags.findData("repeated") > 0)
    assert (session / MANIFEST).read_bytes() == before
    window.close()  # and the next window knows it from the cache


def test_the_next_window_reads_no_session_again(
    open_library: Open, folder: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_library(folder)
    all_read(window, qtbot)
    window.close()
    monkeypatch.setattr(library_model, "_read_session", lambda *_: pytest.fail("it is in the cache"))
    window = open_library(folder)
    assert all(one.seconds is not None for one in window._model.summaries)
    assert not window.panels.picture.pixmap().isNull()
    assert not [path for session in folder.iterdir() for path in session.iterdir() if path.suffix in (".jpg", ".sqlite")]


def test_a_broken_session_is_listed_with_its_reason(open_library: Open, folder: Path, qtbot: QtBot) -> None:
    broken = sorted(folder.iterdir())[0]
    (broken / MANIFEST).write_text("{")
    (folder / "session_empty").mkdir()
    window = open_library(folder)
    qtbot.waitUntil(lambda: all(one.seconds is not None or one.problem for one in window._model.summaries))
    qtbot.waitUntil(lambda: window._model.pending == 0)
    problems = {one.folder.name: one.problem for one in window._model.summaries}
    assert problems[broken.name] == f"{broken / MANIFEST}: damaged (not valid JSON)"
    assert problems["session_empty"] == f"{folder / 'session_empty' / MANIFEST}: missing"


def test_a_folder_that_cannot_be_written_is_said_and_the_fields_show_what_is_kept(
    open_library: Open, folder: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    window = open_library(folder)
    all_read(window, qtbot)
    window.panels.search.setText("ana")
    monkeypatch.setattr(manifests, "write_atomic", refuse)
    field = window.panels.form.fields["operator"]
    field.setFocus()
    field.setText("Eve")
    window.panels.list.setFocus()
    qtbot.waitUntil(lambda: "Read-only file system); nothing was changed" in window.panels.toast.text())
    assert field.text() == "Ana"


def test_a_session_that_is_being_recorded_is_listed_and_read_when_it_has_ended(
    open_library: Open, tmp_path: Path, qtbot: QtBot
) -> None:
    writer = SessionWriter(QUICK, ABOUT, folder=tmp_path / "now", clock=lambda: 1000.0)
    writer.start()
    assert writer.put(tick_of(0, 1000.0))
    wait_for(lambda: writer.status().frames)
    window = open_library(tmp_path / "now")
    (summary,) = window._model.summaries
    assert (summary.is_recording, summary.problem, window._model.pending) == (True, "", 0)
    assert writer.close()
    window._model.scan()
    all_read(window, qtbot)
    assert not read_manifest(summary.folder).recovered


class _Child(QObject):
    """Stands for a process; ends when it is told to."""

    ended = Signal(int, str)
    told = Signal(object)
    started: ClassVar[list[tuple[str, ...]]] = []

    def __init__(self, command: list[str], parent: QObject, *, priority: int = 14) -> None:
        super().__init__(parent)
        self._command = command

    def start(self) -> None:
        self.started.append(tuple(self._command[2:]))

    def leave(self) -> None:
        pass

    def ask_to_end(self) -> None:
        pass


def test_sessions_are_played_annotated_and_exported_from_here(
    open_library: Open, folder: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(opening, "ChildProcess", _Child)
    monkeypatch.setattr(_Child, "started", started := [])
    out = str(tmp_path / "a")
    window = open_library(folder)
    all_read(window, qtbot)
    window.panels.search.setText("ben")
    session = str(window.summary.folder)
    window.panels.list.setFocus()
    QTest.keyClick(window.panels.list, Qt.Key.Key_P)
    QTest.keyClick(window.panels.list, Qt.Key.Key_A)
    window.panels.export.menu().actions()[1].trigger()
    (dialog,) = window.findChildren(QFileDialog)
    dialog.filesSelected.emit([out])
    dialog.close()
    assert started == [
        ("play", session),
        ("annotate", session, "--frames", "48", "--order", "even"),
        ("session", "export", session, "--out", f"{out}.csv", "--progress-json"),
    ]
    child = window.findChild(OfferedCommand)._child
    child.told.emit({"done": 1, "total": 4, "what": "x.csv"})
    assert "Exporting" in window.panels.offers.text
    child.ended.emit(2, "the disk is full; make room")
    assert window.panels.toast.text() == "the disk is full; make room"
    assert window.panels.offers.text == ""
