"""What was opened last, as the File menus of annotator and player list it; commands beside a window."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.ui.actions import MenuEntry, plain
from app.ui.layout_state import layout_settings
from app.ui.opening import OfferedCommand, RecentMenu, note_recent, recent_paths
from app.ui.window_base import WindowFrame
from app.widgets.messages import OfferStrip

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


def test_it_stands_behind_open(qtbot: QtBot) -> None:
    window = WindowFrame()
    qtbot.addWidget(window)
    window.add_file_menu([MenuEntry("&Open...", lambda: None)], has_recent=True)
    menu = window.menuBar().actions()[0].menu()
    assert [plain(action.text()) for action in menu.actions()][:2] == ["Open...", "Open recent"]
    assert isinstance(menu.actions()[1].menu(), RecentMenu)


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
