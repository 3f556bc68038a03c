"""What was opened last, as the File menus list it; dialogs that ask for a path; commands beside a window."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QFileDialog, QLineEdit, QWidget
from pytestqt.qtbot import QtBot

from app.ui.layout_state import layout_settings
from app.ui.opening import OfferedCommand, RecentMenu, ask_path, note_recent, recent_paths
from app.widgets.messages import Offer, OfferStrip

pytestmark = pytest.mark.usefixtures("own_folder")


@pytest.fixture(autouse=True)
def nothing_kept() -> None:
    layout_settings().clear()


def test_the_newest_is_first_each_stands_once_and_old_ones_go(tmp_path: Path) -> None:
    assert recent_paths() == []
    note_recent(tmp_path / "0")
    assert recent_paths() == [tmp_path / "0"], "one alone comes back as a text"
    for name in [*range(1, 12), 5]:
        note_recent(tmp_path / str(name))
    assert [path.name for path in recent_paths()] == ["5", "11", "10", "9", "8", "7", "6", "4", "3"]


def test_the_menu_opens_what_is_chosen(qtbot: QtBot, tmp_path: Path) -> None:
    opened: list[Path] = []
    parent = QWidget()
    qtbot.addWidget(parent)
    menu = RecentMenu(parent, opened.append)
    menu.aboutToShow.emit()
    (nothing,) = menu.actions()
    assert (nothing.text(), nothing.isEnabled()) == ("Nothing was opened yet", False)
    note_recent(tmp_path / "a & b")
    menu.aboutToShow.emit()
    (entry,) = menu.actions()
    assert entry.text() == f"&1  a && b\t{tmp_path}"
    entry.trigger()
    assert opened == [tmp_path / "a & b"]


def test_a_command_that_is_cancelled_before_it_starts_never_runs(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    parent, ended = QWidget(), list[tuple[object, ...]]()
    qtbot.addWidget(parent)
    strip = OfferStrip(parent)
    command = OfferedCommand(parent, strip, "Copying", "session", "info", "nothing")
    command.ended.connect(lambda *told: ended.append(told))
    monkeypatch.setattr(command._child, "start", lambda: ended.append(("started",)))
    strip.answers["Cancel"].click()
    command.start()
    assert ended == [(None, "Cancelled", False)]


def test_who_asks_twice_for_a_path_sees_the_same_dialog(qtbot: QtBot, tmp_path: Path) -> None:
    chosen: list[Path] = []
    parent = QWidget()
    qtbot.addWidget(parent)
    folder = QFileDialog.FileMode.Directory
    first = ask_path(parent, "A folder", tmp_path, chosen.append, folder, folders_only=True)
    assert first.testOption(QFileDialog.Option.ShowDirsOnly)
    assert ask_path(parent, "A folder", tmp_path, chosen.append, folder) is first
    assert ask_path(parent, "A folder", tmp_path, chosen.append) is not first, "that one asks for a file"
    first.reject()
    assert ask_path(parent, "A folder", tmp_path, chosen.append, folder) is not first


def test_a_name_that_was_typed_stays_when_the_same_is_asked_again(qtbot: QtBot, tmp_path: Path) -> None:
    parent, file = QWidget(), QFileDialog.FileMode.AnyFile
    qtbot.addWidget(parent)
    dialog = ask_path(parent, "Export as", tmp_path / "proposed.mp4", list[Path]().append, file)
    name = dialog.findChild(QLineEdit)
    assert name is not None and name.text() == "proposed.mp4"
    name.setText("mine.mp4")
    ask_path(parent, "Export as", tmp_path / "proposed.mp4", list[Path]().append, file)
    assert name.text() == "mine.mp4"


@pytest.mark.parametrize(
    ("what", "total", "detail"),
    [
        ("bytes read", 104857600, "50 %, 3 s left"),
        ("rows", 104857600, "52428800 of 104857600 rows, 3 s left"),
        ("bytes read", 0, "0 %, 3 s left"),
    ],
)
def test_an_offer_says_how_far_a_command_is(qtbot: QtBot, what: str, total: int, detail: str) -> None:
    class Offers:
        def offer(self, offer: Offer) -> None:
            self.last = offer

        def withdraw(self, key: str) -> None:
            del self.last

    offers, parent = Offers(), QObject()
    command = OfferedCommand(parent, offers, "Recovering", "session", "recover", "x")
    command._child.told.emit({"done": 52428800, "total": total, "what": what, "left_s": 3.0})
    assert (offers.last.detail, offers.last.share) == (detail, 0.5 if total else -1.0)
