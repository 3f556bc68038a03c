"""Operator window, player and annotator are one house: the same menus, a true page of keys, names for whoever cannot see."""

from __future__ import annotations

import signal
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, Qt
from PySide6.QtGui import QAccessible, QAction, QKeyEvent, QKeySequence
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractScrollArea,
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QLineEdit,
    QMainWindow,
    QMenu,
    QPlainTextEdit,
    QProgressBar,
    QScrollBar,
    QStackedWidget,
    QTabBar,
    QToolButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from app.annotator.canvas import CANVAS_KEYS
from app.annotator.model import AnnotationModel, QueueEntry
from app.annotator.window import AnnotatorWindow
from app.player.window import PlayerWindow
from app.ui.actions import KEY_HINT, MenuEntry, add_menu, key_names, menu_tables, mnemonic, plain
from app.ui.texts import STOP_KEY, OperatorStep
from app.ui.window_base import run_until_closed
from app.widgets.jog_panel import KEYS
from app.widgets.scene_overlay import Layer
from core.annotation.model import ImageView
from core.annotation.store import AnnotationStore, ItemKey, find_images
from core.config.models import Config, PerceptionConfig
from core.learning.dataset import write_png
from core.session.reader import SessionReader
from tests.app.conftest import MakeWindow
from tests.app.golden_session import GOLDEN

WINDOWS = ("operator", "player", "annotator")
SPECIFIC = {"operator": ["Robot"], "player": ["Play", "Go"], "annotator": ["Edit", "Tools", "Go"]}
Key = Qt.Key


def _annotator(folder: Path) -> AnnotatorWindow:
    write_png(folder / "one.png", np.full((480, 640, 3), 90, np.uint8))
    store = AnnotationStore(folder / "a.sqlite")
    images, _ = find_images([folder / "one.png"], store)
    items = [QueueEntry(images[0], ItemKey(images[0].sha256, "", "ann", 1), ImageView.AS_IS)]
    return AnnotatorWindow(AnnotationModel(store, items, PerceptionConfig(), blind=False), "rater ann")


@pytest.fixture(params=WINDOWS)
def window(request: pytest.FixtureRequest, make_window: MakeWindow, qtbot: QtBot, tmp_path: Path) -> Iterator[QMainWindow]:
    """Each of the three windows, open at 1280x720 and not started: nothing moves in it."""
    made: QMainWindow
    if request.param == "operator":
        made = make_window()
    elif request.param == "player":
        config = Config.model_validate({"window": {"pictures_folder": str(tmp_path)}})
        made = PlayerWindow(SessionReader(GOLDEN), config)
        qtbot.addWidget(made)
    else:
        made = _annotator(tmp_path)
        qtbot.addWidget(made)
    made.setObjectName(request.param)
    made.resize(1280, 720)
    made.show()
    yield made
    made.close()


def _menus(window: QMainWindow) -> dict[str, QMenu]:
    return {plain(action.text()): action.menu() for action in window.menuBar().actions()}


def _entries(window: QMainWindow) -> Iterator[QAction]:
    for menu in _menus(window).values():
        yield from (action for action in menu.actions() if not action.isSeparator() and action.menu() is None)


# ---- menus


def test_all_windows_have_the_same_menus_names_keys_and_places(window: QMainWindow) -> None:
    names = list(_menus(window))
    assert names[:2] == ["File", "View"]
    assert names[-1] == "Help"
    assert [name for name in names[2:-1] if name in SPECIFIC[window.objectName()]] == SPECIFIC[window.objectName()]
    assert window.menuBar().cornerWidget().isVisible()
    assert window.menuBar().cornerWidget().text() == "F1  keys"
    menus = _menus(window)
    found = {
        name: [(plain(action.text()), [key.toString() for key in action.shortcuts()]) for action in menus[name].actions()]
        for name in ("File", "View", "Help")
    }
    assert found["File"][-1] == ("Quit", ["Ctrl+Q"])
    assert found["View"][-1] == ("Full screen", ["F11", "Shift+F11"])
    assert "F" in dict(found["View"])["Whole picture"]
    assert found["Help"][0] == ("Keys", ["F1", "Shift+F1"])
    assert found["Help"][-1][0] == "About LumenPilot"


def test_every_entry_has_a_mnemonic_of_its_own_and_no_key_means_two_things(window: QMainWindow) -> None:
    bar = [mnemonic(action.text()) for action in window.menuBar().actions()]
    assert len(set(bar)) == len(bar)
    assert all(bar)
    for name, menu in _menus(window).items():
        letters = [mnemonic(action.text()) for action in menu.actions() if not action.isSeparator()]
        assert all(letters), name
        twice = [letter for letter, count in Counter(letters).items() if count > 1]
        assert not twice, f"{name}: {twice}"
    keys = Counter(key.toString() for action in window.actions() for key in action.shortcuts())
    assert [key for key, count in keys.items() if count > 1] == []


def test_full_screen_is_marked_while_it_lasts_and_left_by_escape(window: QMainWindow, qtbot: QtBot) -> None:
    action = next(action for action in _entries(window) if plain(action.text()) == "Full screen")
    action.trigger()
    assert action.isChecked()
    assert window.isFullScreen()
    window.showNormal()  # as the desktop may do
    qtbot.waitUntil(lambda: not action.isChecked())
    place = window.panels.canvas if window.objectName() == "annotator" else window.panels.live
    place.setFocus()
    qtbot.keyClick(place, Key.Key_F11)
    assert window.isFullScreen()
    assert not window.menuBar().isVisible()
    qtbot.keyClick(place, Key.Key_Escape)
    assert not window.isFullScreen()
    assert window.menuBar().isVisible()


def test_closing_is_done_once(window: QMainWindow) -> None:
    window.start()
    assert window.close()
    assert not window.isVisible()
    assert not window._heartbeat._timer.isActive()
    window.shut_down()  # as the application does it when it ends
    assert window.close()


def test_entries_that_are_added_later_stand_before_help_and_in_the_menu_of_their_title(window: QMainWindow) -> None:
    add_menu(window, "&Rig", [MenuEntry("Make a rig", lambda: None, ("Ctrl+Alt+M",))])
    add_menu(window, "&File", [MenuEntry("Settings", lambda: None)])
    names = list(_menus(window))
    assert names[-2:] == ["Rig", "Help"]
    assert names.count("File") == 1
    names = [plain(action.text()) for action in _menus(window)["File"].actions()]
    assert names[-4:] == ["", "Settings", "", "Quit"]
    add_menu(window, "&Help", [MenuEntry("Language", lambda: None)])
    assert [plain(action.text()) for action in _menus(window)["Help"].actions()][-4:] == ["", "Language", "", "About LumenPilot"]
    inner = QMenu("Inner", window)
    inner.addAction(QAction("Deep", window, shortcut=QKeySequence("Ctrl+Alt+D")))
    _menus(window)["File"].addMenu(inner)
    assert ("Ctrl+Alt+D", "Deep") in dict(menu_tables(window))["File"]
    page = window.panels.help
    page.toggle()
    assert ("Ctrl+Alt+M", "Make a rig") in dict(page.tables)["Rig"]


# ---- the page of keys


def test_the_page_names_every_key_of_the_menus_and_nothing_else_of_them(window: QMainWindow, qtbot: QtBot) -> None:
    qtbot.keyClick(window, Key.Key_F1)
    page = window.panels.help
    assert page.isVisible()
    rows = {row for title, table in page.tables for row in table if title in _menus(window)}
    wanted = {
        (keys, plain(action.text()))
        for action in _entries(window)
        if (keys := "   ".join(part for part in (key_names(action.shortcuts()), action.property(KEY_HINT)) if part))
    }
    assert rows == wanted
    assert "Ctrl+Q: Quit" in page.accessibleDescription()


def test_the_page_fits_the_smallest_window(window: QMainWindow, qtbot: QtBot) -> None:
    window.resize(window.minimumSize())
    qtbot.keyClick(window, Key.Key_F1)
    page = window.panels.help
    image = page.grab().toImage()
    panel = image.pixelColor(page.width() // 2, page.height() // 2)
    assert image.pixelColor(page.width() // 2, 4) != panel, "there is room above it"
    assert image.pixelColor(page.width() // 2, page.height() - 5) != panel, "and below it"


def test_keys_that_move_the_robot_are_those_that_are_listened_to(make_window: MakeWindow) -> None:
    window = make_window()
    window.panels.help.toggle()
    held = dict(window.panels.help.tables)["Hold to move, release to stop"]
    assert held == tuple((key_names(keys), motion.value) for motion, keys in KEYS.items())
    assert ("\N{LEFTWARDS ARROW}   A", "steer left") in held
    robot = dict(window.panels.help.tables)["Robot"]
    assert (f"{STOP_KEY}, Pause", "STOP") in robot
    assert {step.value.name: step.value.key for step in OperatorStep}.items() <= {text: key for key, text in robot}.items()
    view = dict(window.panels.help.tables)["View"]
    assert {layer.value.label: layer.value.key for layer in Layer}.items() <= {text: key for key, text in view}.items()


def test_the_picture_to_annotate_hears_the_keys_that_the_page_tells(qtbot: QtBot, tmp_path: Path) -> None:
    window = _annotator(tmp_path)
    qtbot.addWidget(window)
    window.resize(1280, 720)
    window.show()
    window.start()
    qtbot.waitUntil(lambda: window.model.is_open)
    canvas = window.panels.canvas
    for point in ((100.0, 100.0), (200.0, 120.0)):  # so that Tab has a point to go to
        qtbot.mouseClick(canvas, Qt.MouseButton.LeftButton, pos=QPoint(*(round(value) for value in canvas.view.to_screen(point))))
    for name, text in CANVAS_KEYS:
        for key in _pressed(name):
            heard = QKeyEvent(QEvent.Type.KeyPress, key, Qt.KeyboardModifier.NoModifier)
            escapes = key == Key.Key_Escape and any(QKeySequence(key) in action.shortcuts() for action in window.actions())
            assert escapes or (QApplication.sendEvent(canvas, heard) and heard.isAccepted()), f"{name}: {text}"
    window.close()


def _pressed(name: str) -> list[Qt.Key]:
    arrows = {"\N{LEFTWARDS ARROW}": Key.Key_Left, "\N{RIGHTWARDS ARROW}": Key.Key_Right}
    arrows |= {"\N{UPWARDS ARROW}": Key.Key_Up, "\N{DOWNWARDS ARROW}": Key.Key_Down}
    if name[0] in arrows:
        return [arrows[sign] for sign in name.split()]
    words = {"Enter": Key.Key_Return, "Tab": Key.Key_Tab, "Insert": Key.Key_Insert, "Del": Key.Key_Delete, "Esc": Key.Key_Escape}
    words |= {"Shift+Del": Key.Key_Delete, "Space+drag": Key.Key_Space}
    return [words[name]]


# ---- names for screen readers

CONTROLS = (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QComboBox,
    QLineEdit,
    QPlainTextEdit,
    QProgressBar,
    QTabBar,
)


def _is_part_of_another(widget: QWidget) -> bool:
    """Parts of Qt's own controls: the line in a spin box, the list and the button of a combo, scroll bars, arrows of a tab bar."""
    parent = widget.parentWidget()
    inside = (QAbstractSpinBox, QComboBox, QTabBar, QAbstractScrollArea, QMenu)
    while parent is not None:
        if isinstance(parent, inside):
            return True
        parent = parent.parentWidget()
    return isinstance(widget, QScrollBar) or (isinstance(widget, QToolButton) and widget.objectName().startswith("qt_"))


def _named(widget: QWidget) -> str:
    if isinstance(widget, QComboBox):  # under Linux Qt tells what is chosen as its name; the name goes as the description
        return widget.accessibleName() if widget.accessibleName() == widget.accessibleDescription() else ""
    told = QAccessible.queryAccessibleInterface(widget)
    return told.text(QAccessible.Text.Name) if told is not None else ""


def _is_put_away(widget: QWidget | None) -> bool:
    """Hidden for another reason than that another page is in front: a button of a question that nobody asks has no name yet."""
    while widget is not None and not widget.isWindow():
        if widget.isHidden() and not isinstance(widget.parentWidget(), QStackedWidget):
            return True
        widget = widget.parentWidget()
    return False


def _unnamed(window: QMainWindow, wanted: Callable[[QWidget], bool]) -> list[str]:
    there = (widget for widget in window.findChildren(QWidget) if not (_is_part_of_another(widget) or _is_put_away(widget)))
    widgets = [widget for widget in there if wanted(widget)]
    assert widgets
    return sorted(
        f"{type(widget).__name__} {widget.objectName()} in {type(widget.parent()).__name__}"
        for widget in widgets
        if not _named(widget).strip()
    )


def test_every_control_dial_and_whatever_takes_the_focus_has_a_name(window: QMainWindow) -> None:
    """Dials are painted by us, so Qt cannot read a text from them."""

    def is_painted(widget: QWidget) -> bool:
        return any("paintEvent" in vars(kind) for kind in type(widget).__mro__ if kind.__module__.startswith("app."))

    for wanted in (
        lambda widget: isinstance(widget, CONTROLS),
        lambda widget: bool(widget.focusPolicy() & Qt.FocusPolicy.TabFocus),
        is_painted,
    ):
        assert _unnamed(window, wanted) == []


def test_tab_reaches_every_button_list_and_field_of_the_drive_page(make_window: MakeWindow, qtbot: QtBot) -> None:
    window = make_window()
    window.activateWindow()
    window.panels.live.setFocus()
    reached, place = set(), window.panels.live
    for _ in range(400):
        place = place.nextInFocusChain()
        if place.isVisibleTo(window) and place.focusPolicy() & Qt.FocusPolicy.TabFocus:
            reached.add(_named(place))
    assert {"Phantom", "Speed by hand", "Another random phantom", "STOP"} <= reached
    assert any(name.startswith("Servos on") or name.startswith("Arm") for name in reached)


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


class Window:
    def __init__(self) -> None:
        self.done: list[str] = []

    def show(self) -> None:
        self.done.append("show")

    def start(self) -> None:
        self.done.append("start")

    def shut_down(self) -> None:
        self.done.append("shut down")


def test_what_goes_wrong_after_the_start_leaves_no_thread_running(qapp: QApplication) -> None:
    def fail() -> None:
        raise RuntimeError("no such order")

    window = Window()
    with pytest.raises(RuntimeError, match="no such order"):
        run_until_closed(qapp, window, lambda *_: None, fail)
    assert window.done == ["show", "start", "shut down"]
    qapp.aboutToQuit.disconnect(window.shut_down)
