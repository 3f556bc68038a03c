"""The entries that switch the live output: tick and address, what is handed over, and what an error says."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
from PySide6.QtGui import QAction
from pytestqt.qtbot import QtBot

from app.operator import live_menu
from app.operator.live_menu import LiveMenuController
from app.operator.window import OperatorWindow
from app.ui.actions import plain
from core.control.drive_view import DriveView
from core.devices import UserError
from core.session.live_output import LiveOutput, OutputKind
from core.session.manifest import About, Event
from core.types import Tick
from tests.app.fakes import until


class ListReceiver:
    address = "ws://here:1"

    def __init__(self) -> None:
        self.rigs: list[str] = []
        self.ticks: list[Tick] = []
        self.events: list[str] = []
        self.closed = threading.Event()

    def set_rig(self, about: About) -> None:
        self.rigs.append(about.kind)

    def send(self, at_s: float, tick: Tick, drive: DriveView | None, bus: Any) -> None:
        self.ticks.append(tick)

    def send_event(self, at_s: float, event: Event) -> None:
        self.events.append(event.kind.value)

    def close(self) -> None:
        self.closed.set()


@pytest.fixture
def receivers(monkeypatch: pytest.MonkeyPatch) -> list[ListReceiver]:
    """Those that were opened; LSL cannot be."""
    opened: list[ListReceiver] = []

    def open_one(kind: OutputKind, _port: int) -> LiveOutput:
        def receive() -> ListReceiver:
            if kind is OutputKind.LSL:
                raise UserError("this needs the package pylsl")
            opened.append(ListReceiver())
            return opened[-1]

        return LiveOutput(receive)

    monkeypatch.setattr(live_menu, "open_output", open_one)
    return opened


@pytest.fixture
def menu(running: OperatorWindow, receivers: list[ListReceiver]) -> Iterator[LiveMenuController]:
    menu = LiveMenuController(running, {OutputKind.LSL: live_menu.open_output(OutputKind.LSL, 0)})
    yield menu
    menu.close()


def entry(window: OperatorWindow, text: str) -> QAction:
    return next(action for action in window.actions() if plain(action.text()).startswith(text))


def test_a_ticked_entry_has_the_address_and_gets_what_is_kept(
    running: OperatorWindow, menu: LiveMenuController, receivers: list[ListReceiver], qtbot: QtBot
) -> None:
    stream = entry(running, "Stream for Foxglove")
    stream.trigger()
    until(qtbot, lambda: plain(stream.text()) == "Stream for Foxglove: ws://here:1")
    assert stream.isChecked()
    running.choose_target(5.0, 5.0)
    until(qtbot, lambda: bool(receivers[0].ticks) and "target" in receivers[0].events)
    assert receivers[0].rigs == ["SIM"]
    stream.trigger()
    assert not stream.isChecked()
    assert plain(stream.text()) == "Stream for Foxglove"
    receivers[0].closed.wait()


def test_what_cannot_be_opened_says_why_and_is_not_ticked(running: OperatorWindow, menu: LiveMenuController, qtbot: QtBot) -> None:
    outlets = entry(running, "Outlets for LSL")
    until(qtbot, lambda: running.panels.toast.text() == "this needs the package pylsl")
    assert not outlets.isChecked()
