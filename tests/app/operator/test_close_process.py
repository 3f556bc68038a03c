"""A process with the window ends with exit code 0 and says nothing, whenever it is closed and however."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]

PROGRAM = """
import os, signal, sys, time
from PySide6.QtCore import QTimer
from app.operator import window as operator_window
from app.operator.window import OperatorWindow
from app.ui.window_base import make_application, quit_on_signal
from core.config.models import Config
from hardware.rig import RigKind
from tests.app.fakes import FakeBench, FakeEngine

how, after_ms = sys.argv[1], int(sys.argv[2])
if len(sys.argv) > 3:
    operator_window._STOP_WITHIN_MS = 300

class StuckEngine(FakeEngine):
    def step(self, timeout_s):
        time.sleep(30.0 if len(sys.argv) > 3 else 0.0)
        return super().step(timeout_s)

def open_engine(config):
    time.sleep(0.3)
    return StuckEngine(FakeBench())

application = make_application()
window = OperatorWindow(Config(), open_engine, RigKind.SIM, [("tree", "Tree")])
application.aboutToQuit.connect(window.shut_down)
window.show()
window.start()
quit_on_signal(application)
end = {
    "close": window.close,
    "quit": application.quit,
    "SIGINT": lambda: os.kill(os.getpid(), signal.SIGINT),
    "SIGTERM": lambda: os.kill(os.getpid(), signal.SIGTERM),
}
QTimer.singleShot(after_ms, end[how])
sys.exit(application.exec())
"""


@pytest.mark.parametrize(
    ("how", "after_ms"),
    [
        ("close", 0),
        ("close", 80),
        pytest.param("close", 150, marks=pytest.mark.slow),
        ("close", 900),
        ("quit", 150),
        pytest.param("quit", 900, marks=pytest.mark.slow),
        ("SIGINT", 900),
        ("SIGTERM", 150),
    ],
)
def test_exit_code_0_and_not_a_word(how: str, after_ms: int) -> None:
    """At 0 ms the rig is only announced, at 80 and 150 ms it is being opened, at 900 ms pictures run.

    Or not yet, on a slow machine: no less a moment.
    """
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, how, str(after_ms)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "")


def test_a_driver_that_never_returns_does_not_keep_the_window() -> None:
    command = [sys.executable, "-c", PROGRAM, "close", "600", "stuck"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "the rig's driver did not return within 0.3 s; leaving without it\n"
