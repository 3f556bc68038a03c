"""Dialogs work by keyboard with Space left to STOP, everything in them has a name, and one button is what comes next."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QAccessible
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSpinBox,
    QComboBox,
    QDialog,
    QLineEdit,
    QPushButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from app.operator.preflight import PreflightModel
from app.operator.preflight_list import PreflightList
from app.rig_wizard.model import RigWizardModel
from app.rig_wizard.wizard import RigWizard
from app.settings.dialog import SettingsDialog
from app.settings.draft import SettingsDraft
from app.training.dialog import TrainingDialog
from core.config.models import Config, load_config
from core.control.drive_view import DriveView
from hardware.calibration.bench import CalibrationBench
from hardware.cameras.registry import FoundCamera
from hardware.rig import FoundDevices
from tests.app.fakes import make_scene, until
from tests.app.operator.test_preflight import BAD, GOOD, done, says
from tests.app.rig_wizard.test_wizard import StillCamera

Key = Qt.Key
IDLE = DriveView(0.0)


@pytest.fixture
def wizard(qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RigWizard]:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))

    def open_bench(config: Config, see: object) -> CalibrationBench:
        return CalibrationBench(config, StillCamera(), None, lambda frame: make_scene(), lambda: None)

    made = RigWizard(RigWizardModel(load_config(), None, open_bench, lambda _config: lambda frame: make_scene()), "bench 1")
    qtbot.addWidget(made)
    made.show()
    until(qtbot, lambda: not made.model.is_busy)
    yield made
    made.reject()


@pytest.fixture
def settings(qtbot: QtBot) -> SettingsDialog:
    made = SettingsDialog(SettingsDraft(load_config()), Path("settings.toml"))
    made.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose, False)
    qtbot.addWidget(made)
    made.show()
    return made


@contextmanager
def training(qtbot: QtBot) -> Iterator[TrainingDialog]:
    """No fixture: the menus of its plots go with the last one who knows it."""
    made = TrainingDialog(lambda: ((), ()), "/a/folder" + 40 * "/of_a_long_name" + "/annotations.sqlite")
    qtbot.addWidget(made)
    made.show()
    yield made
    made.end()


MakeChecks = Callable[..., tuple[PreflightModel, PreflightList]]


@pytest.fixture
def make_checks(qtbot: QtBot) -> Iterator[MakeChecks]:
    made: list[PreflightModel] = []

    def make(command: list[str], view: DriveView | None = IDLE) -> tuple[PreflightModel, PreflightList]:
        desk = PreflightModel(Config, lambda: view, command=command)
        shown = PreflightList(desk)
        qtbot.addWidget(shown)
        made.append(desk)
        shown.open_list()
        return desk, shown

    yield make
    for desk in made:
        desk.close()


@pytest.fixture(params=["wizard", "settings", "preflight"])
def dialog(request: pytest.FixtureRequest, make_checks: MakeChecks) -> QDialog:
    made: QDialog = make_checks(says(GOOD))[1] if request.param == "preflight" else request.getfixturevalue(request.param)
    return made


def _names_missing(dialog: QDialog) -> list[QWidget]:
    kinds = (QAbstractButton, QAbstractSpinBox, QComboBox, QLineEdit, QAbstractItemView)
    controls = [one for one in dialog.findChildren(QWidget) if isinstance(one, kinds) and one.isVisible()]
    parts = [one for one in controls if isinstance(one.parentWidget(), kinds) or one.objectName().startswith("qt_")]
    assert len(controls) > len(parts)
    told = ((one, QAccessible.queryAccessibleInterface(one)) for one in controls if one not in parts)
    return [one for one, name in told if not (name.text(QAccessible.Text.Name) or one.accessibleName())]


def _not_pressed_by_enter(dialog: QDialog) -> list[str]:
    buttons = [one for one in dialog.findChildren(QPushButton) if one.isVisible() and one.isEnabled() and one.menu() is None]
    assert buttons
    pressed: list[QPushButton] = []
    for button in buttons:
        button.clicked.disconnect()
        button.clicked.connect(lambda _on=False, one=button: pressed.append(one))
    for button in buttons:
        button.setFocus()
        QTest.keyClick(button, Key.Key_Return)
    assert dialog.isVisible()
    return [button.text() for button in buttons if pressed.count(button) != 1]


def test_every_control_has_a_name_and_enter_presses_the_button_that_has_the_focus(dialog: QDialog) -> None:
    assert _names_missing(dialog) == []
    assert _not_pressed_by_enter(dialog) == []


def test_the_training_is_named_and_works_by_enter(qtbot: QtBot) -> None:
    with training(qtbot) as shown:
        assert _names_missing(shown) == []
        assert _not_pressed_by_enter(shown) == []


# ---- settings


# ---- the rig wizard


def _is_main(button: QPushButton) -> bool:
    return button.objectName() == "main_button"


def test_one_button_of_a_page_is_what_comes_next(wizard: RigWizard, qtbot: QtBot) -> None:
    page = wizard.camera_page
    assert _is_main(page.open_button)
    assert not _is_main(wizard.next_button)
    assert "when the camera is open" in page.problem.text()
    page.open_button.click()
    until(qtbot, lambda: not wizard.model.is_busy)
    assert not _is_main(page.open_button)
    assert _is_main(wizard.next_button)
    wizard.next()
    scale = wizard.scale_page
    for count, main in ((1, scale.take_button), (2, scale.take_button), (3, scale.solve_button)):
        scale.take_button.click()
        until(qtbot, lambda: not wizard.model.is_busy)
        assert len(wizard.model.draft.views) == count
        assert [one for one in (scale.take_button, scale.solve_button, wizard.next_button) if _is_main(one)] == [main]


def test_size_and_rate_can_be_set_for_real_cameras_only(wizard: RigWizard) -> None:
    page = wizard.camera_page
    page._on_found(FoundDevices((FoundCamera("webcam", "A webcam", device="/dev/video0"), FoundCamera("twin", "The twin")), ()))
    page.cameras.setCurrentRow(0)
    assert all(field.isEnabled() for field in (*page.sizes, page.rate))
    page.cameras.setCurrentRow(1)
    assert not any(field.isEnabled() for field in (*page.sizes, page.rate))


# ---- training


# ---- before driving


def test_why_it_cannot_be_armed_yet_is_told(make_checks: MakeChecks, qtbot: QtBot) -> None:
    desk, shown = make_checks(says(GOOD, BAD))
    assert shown.again.text() == "Check &now"
    assert shown.arm.toolTip() == "First the checks must be done"
    desk.begin()
    done(desk, qtbot)
    shown.renew()
    assert shown.again.text() == "Check &again"
    assert not shown.arm.isEnabled()
    assert shown.arm.toolTip() == "First mend what is NOT READY, and check again"


def test_without_servos_there_is_nothing_to_arm(make_checks: MakeChecks) -> None:
    _, shown = make_checks([sys.executable, "-c", ""], None)
    assert "no servos are open" in shown.arm.toolTip()


# ---- offers
