"""Closing the window over servos that hold: what is asked, what is done, and that a simulated rig is never kept open."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.operator.leaving import ANSWERS
from app.operator.window import OperatorWindow
from app.ui.window_base import close_all
from core.config.models import Config
from core.config.rig_file import RigFile, read_rig, with_rig, write_rig
from core.config.safety import ServosConfig
from core.control.faults import Cause
from core.control.modes import Act
from hardware.rig import RigKind
from hardware.servos.bus_ipc import BusPhase, BusStatus
from hardware.servos.registers import MissingServo
from tests.app.bus_status import bus, servo
from tests.app.conftest import MakeWindow
from tests.app.fakes import FakeBench, FakeEngine, until

CLOSED_CONFIG = {"record": {"ring_s": 0}}


class HoldingEngine(FakeEngine):
    """An engine whose servos are as the test says."""

    status: BusStatus | None = None

    def bus_status(self) -> BusStatus | None:
        return self.status


@pytest.fixture
def engine(bench: FakeBench) -> HoldingEngine:
    engine = HoldingEngine(bench)
    engine.status = bus()
    return engine


def _slack(**changes: object) -> BusStatus:
    return bus(*(servo(place, torque=False) for place in range(7)), **changes)


def _window(
    make_window: MakeWindow, engine: HoldingEngine, qtbot: QtBot, kind: RigKind = RigKind.LIVE, config: Config | None = None
) -> OperatorWindow:
    window = make_window(lambda _config: engine, config or Config.model_validate(CLOSED_CONFIG), kind)
    window.start()
    until(qtbot, lambda: window.shown_tick is not None)
    return window


def _answer(window: OperatorWindow, title: str) -> None:
    box = window.leaving.box
    next(button for button in box.buttons() if button.text() == title).click()


@pytest.fixture
def live(make_window: MakeWindow, engine: HoldingEngine, qtbot: QtBot) -> Iterator[OperatorWindow]:
    """The window of a LIVE rig whose servos hold."""
    yield _window(make_window, engine, qtbot)
    engine.status = _slack()  # so that it closes


@pytest.mark.parametrize(
    ("status", "pulls"),
    [
        (bus(), True),
        (_slack(), False),
        (bus(*(servo(place, torque=False) for place in range(6))), True),
        (bus(servos=()), True),
        (bus(phase=BusPhase.CLOSED), False),
        (_slack(phase=BusPhase.STOPPED), False),
        (bus(*(MissingServo(servo(place).name, place + 1, 100.0, 3, "no answer") for place in range(7))), False),
    ],
)
def test_when_servos_count_as_pulling(status: BusStatus, pulls: bool) -> None:
    assert status.pulls is pulls


def test_a_live_rig_asks_and_does_not_close_before_the_answer(live: OperatorWindow, engine: HoldingEngine) -> None:
    assert not live.close()
    assert live.isVisible()
    box = live.leaving.box
    assert not box.isModal(), "STOP stays within reach"
    assert {button.text() for button in box.buttons()} == {*ANSWERS.values(), "Do not close"}
    assert box.defaultButton().text() == "Relax slowly"
    assert box.checkBox() is None, "without a rig file there is nothing to remember it in"
    assert not live.close(), "nor when it is asked again"
    _answer(live, "Do not close")
    assert live.isVisible()
    assert live.leaving.box is None
    assert engine.pilot.asked == []


def test_hold_closes_at_once(live: OperatorWindow, engine: HoldingEngine) -> None:
    live.close()
    _answer(live, "Hold")
    assert not live.isVisible()
    assert engine.pilot.asked == []


@pytest.mark.parametrize(("title", "asked"), [("Relax slowly", "relax"), ("Torque off now", "torque off")])
def test_it_closes_when_the_torque_is_off(
    live: OperatorWindow, engine: HoldingEngine, qtbot: QtBot, title: str, asked: str
) -> None:
    live.close()
    _answer(live, title)
    assert engine.pilot.asked == [asked]
    qtbot.wait(300)
    assert live.isVisible()
    assert not live.close()
    engine.status = _slack()
    until(qtbot, lambda: not live.isVisible())


@pytest.mark.parametrize(("title", "name"), [("Relax slowly", "relax"), ("Torque off now", "torque_off")])
def test_a_pilot_that_refuses_is_told_and_the_window_stays(
    live: OperatorWindow, engine: HoldingEngine, monkeypatch: pytest.MonkeyPatch, title: str, name: str
) -> None:
    monkeypatch.setattr(engine.pilot, name, lambda: False)
    live.close()
    _answer(live, title)
    assert "disarm first" in live.panels.toast.text()
    assert live.isVisible()


def test_stop_keeps_it_open(live: OperatorWindow, engine: HoldingEngine, qtbot: QtBot) -> None:
    live.close()
    _answer(live, "Relax slowly")
    live.controls.stop()
    assert engine.pilot.acts == [Act.STOP]
    engine.status = bus(phase=BusPhase.STOPPED, fault_counts={Cause.STOP_PRESSED: 1})
    until(qtbot, lambda: "the window stays open" in live.panels.toast.text())
    qtbot.wait(300)
    assert live.isVisible()


def test_what_a_rig_remembers_is_done_without_a_question(
    make_window: MakeWindow, engine: HoldingEngine, qtbot: QtBot, tmp_path: Path
) -> None:
    rig = RigFile(
        name="bench",
        made_utc=datetime(2026, 1, 1, tzinfo=UTC),
        kind="webcam",
        robot="servos",
        servos=ServosConfig(port="/dev/none"),
    )
    path = write_rig(rig, tmp_path / "bench.toml")
    window = _window(make_window, engine, qtbot, config=with_rig(Config.model_validate(CLOSED_CONFIG), rig, path))
    window.close()
    box = window.leaving.box
    box.checkBox().setChecked(True)
    _answer(window, "Hold")
    assert not window.isVisible()
    assert read_rig(path).servos.at_close == "hold"
    again = HoldingEngine(FakeBench())
    again.status = bus()
    window = _window(make_window, again, qtbot, config=with_rig(Config.model_validate(CLOSED_CONFIG), read_rig(path), path))
    assert window.close()
    assert window.leaving.box is None


def test_a_simulated_rig_just_closes(make_window: MakeWindow, engine: HoldingEngine, qtbot: QtBot) -> None:
    window = _window(make_window, engine, qtbot, RigKind.SIM)
    assert window.close()
    assert window.leaving.box is None


def test_ctrl_c_asks_once_and_a_second_one_or_the_system_does_not(
    live: OperatorWindow, engine: HoldingEngine, qapp: QApplication
) -> None:
    close_all(qapp, may_ask=True)
    assert live.isVisible()
    assert live.leaving.box is not None
    close_all(qapp, may_ask=True)
    assert not live.isVisible()
    assert engine.pilot.asked == []


def test_the_system_asks_nothing(live: OperatorWindow, qapp: QApplication) -> None:
    close_all(qapp)
    assert not live.isVisible()
    assert live.leaving.box is None
