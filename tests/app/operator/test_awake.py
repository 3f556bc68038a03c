"""Screen lock and sleep are inhibited while real servos follow, and no longer."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from app.operator.awake import SLEEP_COMMAND, WHO, AwakeInhibitor, must_stay_awake
from core.control.drive_view import DriveView
from core.control.modes import Mode
from hardware.rig import RigKind

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize(
    ("kind", "view", "awake"),
    [
        (RigKind.LIVE, None, False),
        (RigKind.LIVE, DriveView(0.0), False),
        (RigKind.LIVE, DriveView(0.0, servos_on=True), True),
        (RigKind.LIVE, DriveView(0.0, mode=Mode.ARMED), True),
        (RigKind.LIVE, DriveView(0.0, mode=Mode.AUTONOMOUS, servos_on=True), True),
        (RigKind.LIVE, DriveView(0.0, mode=Mode.STOPPED), False),
        (RigKind.SIM, DriveView(0.0, mode=Mode.AUTONOMOUS, servos_on=True), False),
        (RigKind.PLAYBACK, None, False),
    ],
)
def test_when_the_computer_must_stay_awake(kind: RigKind, view: DriveView | None, awake: bool) -> None:
    assert must_stay_awake(kind, view) is awake


def _writes(path: Path) -> tuple[str, ...]:
    """A command that says when it begins and ends, and ends with its input, as ``systemd-inhibit ... cat`` does."""
    program = f"import sys; f = open({str(path)!r}, 'a', buffering=1); f.write('held\\n'); sys.stdin.read(); f.write('free\\n')"
    return (sys.executable, "-c", program)


def test_sleep_is_inhibited_by_a_process_that_ends_with_its_input(qtbot: QtBot, tmp_path: Path) -> None:
    path = tmp_path / "said"
    path.touch()
    inhibitor = AwakeInhibitor(sleep_command=_writes(path))
    for _ in range(3):
        inhibitor.hold(True)
    qtbot.waitUntil(lambda: path.read_text().split() == ["held"], timeout=20_000)
    inhibitor.hold(False)
    qtbot.waitUntil(lambda: path.read_text().split() == ["held", "free"], timeout=20_000)
    inhibitor.hold(True)
    qtbot.waitUntil(lambda: path.read_text().split() == ["held", "free", "held"], timeout=20_000)
    inhibitor.close()
    assert path.read_text().split() == ["held", "free", "held", "free"]


def test_where_it_cannot_be_inhibited_it_is_said_once(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DBUS_SESSION_BUS_ADDRESS", "unix:path=/nowhere")
    inhibitor = AwakeInhibitor(sleep_command=("/nowhere/systemd-inhibit",))
    said: list[str] = []
    inhibitor.failed.connect(said.append)
    for wanted in (True, False, True):
        inhibitor.hold(wanted)
        qtbot.wait(100)
    inhibitor.close()
    assert len(said) == 1
    assert "switch that off in the desktop's settings" in said[0]


def test_the_command_inhibits_sleep_idle_and_the_lid() -> None:
    assert SLEEP_COMMAND[0] == "systemd-inhibit"
    assert "--what=idle:sleep:handle-lid-switch" in SLEEP_COMMAND
    assert f"--who={WHO}" in SLEEP_COMMAND
    assert SLEEP_COMMAND[-1] == "cat"


DESKTOP = """
import sys
from PySide6.QtCore import ClassInfo, QCoreApplication, QObject, QTimer, Slot
from PySide6.QtDBus import QDBusAbstractAdaptor, QDBusConnection, QDBusServiceWatcher
from app.operator.awake import AwakeInhibitor

@ClassInfo({"D-Bus Interface": "org.freedesktop.ScreenSaver"})
class ScreenSaver(QDBusAbstractAdaptor):
    @Slot(str, str, result="uint")
    def Inhibit(self, who, why):
        print("inhibited by", who, why, flush=True)
        return 7

application = QCoreApplication([])
bus, owner = QDBusConnection.sessionBus(), QObject()
saver = ScreenSaver(owner)
assert bus.registerService("org.freedesktop.ScreenSaver")
assert bus.registerObject("/org/freedesktop/ScreenSaver", owner, QDBusConnection.RegisterOption.ExportAdaptors)
inhibitor = AwakeInhibitor(sleep_command=(sys.executable, "-c", "import sys; sys.stdin.read()"))
inhibitor.failed.connect(lambda line: print("failed", line, flush=True))
QTimer.singleShot(0, lambda: inhibitor.hold(True))
QTimer.singleShot(1500, lambda: (inhibitor.close(), application.quit()))
application.exec()
"""


@pytest.mark.skipif(shutil.which("dbus-run-session") is None, reason="needs a message bus")
def test_a_desktop_is_asked_to_inhibit_its_lock() -> None:
    done = subprocess.run(
        ["dbus-run-session", "--", sys.executable, "-c", DESKTOP], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "inhibited by LumenPilot a robot is being driven\n"
