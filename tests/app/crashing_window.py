"""A real operator window on a fake rig that meets errors nobody foresaw.

Arguments: which ("errors", in a thread and a slot, or "fault"), folder.

Writes what became of it as one JSON object on standard output; a memory fault ends it before.
"""

from __future__ import annotations

import faulthandler
import json
import os
import sys
import threading
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QMessageBox

from app.operator.services import WindowServices
from app.operator.window import OperatorWindow
from app.ui.crash_report import CrashWatch
from app.ui.window_base import make_application
from core.config.models import Config
from hardware.rig import RigKind
from tests.app.fakes import FakeEngine


def fail() -> None:
    secret_name = "pelvis"
    raise ZeroDivisionError(f"of {secret_name} in {Path.home()}/private")


def main() -> None:
    which, folder = sys.argv[1], Path(sys.argv[2])
    application = make_application()
    application.setQuitOnLastWindowClosed(False)
    config = Config.model_validate({"record": {"folder": str(folder / "sessions"), "ring_s": 0}})
    engine = FakeEngine()
    window = OperatorWindow(config, lambda _config: engine, RigKind.SIM)
    watch = CrashWatch(folder / "crashes", lambda: window.rig.config.model_dump(mode="json"))
    watch.install()
    side = WindowServices(window, folder, watch)
    window.show()
    window.start()

    asked: list[bool] = []

    def look() -> None:
        status, boxes = window.recorder.status, window.findChildren(QMessageBox)
        if status.frames < 5 and status.saved is None:
            if not asked and window.shown_tick is not None:
                asked.append(True)
                window.recorder.toggle()  # once: until its first picture it does not record yet
        elif not boxes:
            if which == "fault":
                sys.stdout.write("going\n")
                sys.stdout.flush()
                faulthandler._sigsegv()
            threading.Thread(target=fail, name="helper").start()
            QTimer.singleShot(0, fail)
            again.setInterval(1000)
        elif status.saved is not None:
            again.stop()
            result = {
                "acts": [act.value for act in engine.pilot.acts],
                "boxes": [f"{box.text()} {box.informativeText()}" for box in boxes if box.isVisible()],
                "saved": str(status.saved),
                "modal": [box.isModal() for box in boxes],
            }
            sys.stdout.write(json.dumps(result) + "\n")
            sys.stdout.flush()
            side.close()
            window.close()
            watch.remove()
            application.quit()

    again = QTimer()
    again.timeout.connect(look)
    again.start(50)
    application.exec()


main()
