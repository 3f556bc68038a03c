"""Gamepad and pedal at the pilot: their states become controls, deadman and STOP; what happens to them is told."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pytestqt.qtbot import QtBot

from app.operator.manual_drive import OperatorDevices
from core.config.models import Config
from core.control.modes import Act
from core.control.motion import Jog
from hardware.inputs.gamepad import GamepadState
from hardware.twin.soft_pedal import SoftPedal
from tests.app.fakes import FakePilot, until


@pytest.fixture
def pedal() -> Iterator[SoftPedal]:
    with SoftPedal() as made:
        yield made


def test_a_rig_that_is_opened_while_stop_is_on_its_way_is_stopped(qtbot: QtBot) -> None:
    there: list[FakePilot] = []
    config = Config.model_validate({"gamepad": {"enabled": False}})
    devices = OperatorDevices(config, lambda: there[0] if there else None, stop=lambda: there.append(FakePilot()))  # type: ignore[arg-type,return-value]
    devices._on_gamepad(GamepadState(0.0, 0.0, 0.0, 0.0, None, False, 1.0))
    assert there == []
    devices._on_gamepad(GamepadState(0.0, 0.0, 0.0, 0.0, None, True, 1.0))
    assert [pilot.acts for pilot in there] == [[Act.STOP]]
    devices.close()


def test_a_gamepads_state_is_a_jog_a_deadman_and_a_stop(qtbot: QtBot) -> None:
    pilot = FakePilot()
    devices = OperatorDevices(Config.model_validate({"gamepad": {"enabled": False}}), lambda: pilot)  # type: ignore[arg-type,return-value]
    devices._on_gamepad(GamepadState(0.5, -0.25, 1.0, 0.0, None, False, 1.0))
    assert pilot.jogs == [Jog(0.5, -0.25, 1.0, 0.0)]
    assert pilot.deadman_said == []
    devices._on_gamepad(GamepadState(0.0, 0.0, 0.0, 0.0, True, True, 1.0))
    assert pilot.deadman_said == [True]
    assert pilot.acts == [Act.STOP]
    devices.close()


def test_without_a_rig_nothing_happens(qtbot: QtBot) -> None:
    devices = OperatorDevices(Config.model_validate({"gamepad": {"enabled": False}}), lambda: None)
    devices._on_gamepad(GamepadState(0.5, 0.0, 0.0, 0.0, True, True, 1.0))
    devices.close()


@pytest.mark.real_time
def test_a_pedal_on_its_line_is_deadman_and_stop(qtbot: QtBot, pedal: SoftPedal) -> None:
    pilot = FakePilot()
    config = Config.model_validate({"gamepad": {"enabled": False}, "pedal": {"port": pedal.port}})
    devices = OperatorDevices(config, lambda: pilot)  # type: ignore[arg-type,return-value]
    said: list[tuple[str, bool]] = []
    devices.said.connect(lambda text, bad: said.append((text, bad)))
    devices.start()
    try:
        until(qtbot, lambda: len(pilot.deadman_said) > 3)
        pedal.press()
        until(qtbot, lambda: pilot.deadman_said[-1] is True)
        pedal.release()
        until(qtbot, lambda: pilot.deadman_said[-1] is False)
        pedal.press_stop()
        until(qtbot, lambda: Act.STOP in pilot.acts)
        pedal.vanish()
        until(qtbot, lambda: any(bad for _, bad in said))
        assert pilot.deadman_said[-1] is None
    finally:
        devices.close()


def test_a_pedal_that_cannot_be_opened_is_told_with_what_to_do(qtbot: QtBot) -> None:
    config = Config.model_validate({"gamepad": {"enabled": False}, "pedal": {"port": "/dev/serial/by-id/none"}})
    devices = OperatorDevices(config, lambda: None)
    with qtbot.waitSignal(devices.said) as told:
        devices.start()
    devices.close()
    assert "/dev/serial/by-id/none" in told.args[0]
    assert told.args[1] is True
