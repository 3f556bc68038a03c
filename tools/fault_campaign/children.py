"""Child processes of the fault campaign: ``python -m tools.fault_campaign.children WHAT ARGUMENT...``."""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from core.annotation.model import Annotation, ImageView, measure_lines
from core.annotation.store import AnnotationStore, ImageRecord, ItemKey
from core.config.models import PerceptionConfig
from core.config.safety import SafetyConfig, ServosConfig
from core.control.gate import Source
from core.control.modes import Mode
from core.types import Command
from hardware.servos.dynamixel_port import BusProcessLost, ServoError
from hardware.servos.servo_robot import ServoRobot
from tools.fault_campaign.registry import CampaignError

ROOT = Path(__file__).resolve().parents[2]
MODULE = "tools.fault_campaign.children"
IMAGE = ImageRecord("0" * 64, "a.png", 640, 480)
KEY = ItemKey(IMAGE.sha256, "", "campaign")
_PERIOD_S = 0.02
_MOST_EDITS = 100_000


@contextmanager
def start_child(*arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run one of the programs below; it is killed at the end of the context."""
    with subprocess.Popen([sys.executable, "-m", MODULE, *arguments], cwd=ROOT, stdout=subprocess.PIPE) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()


def read_line(process: subprocess.Popen[bytes]) -> dict[str, object]:
    """The next object that a child has written. Raises CampaignError when it ended without."""
    assert process.stdout is not None
    with contextlib.suppress(ValueError):
        if found := json.loads(process.stdout.readline() or b"{}"):
            return dict(found)
    raise CampaignError("a program of the campaign did not start")


def write_line(**record: object) -> None:
    """Write an object at once: what was written has happened, however the process ends."""
    os.write(1, f"{json.dumps(record)}\n".encode())


def drive(port: str) -> None:
    """Advance and bend to and fro, never at rest, as a program does that follows fresh frames."""
    robot = ServoRobot(ServosConfig(port=port), SafetyConfig())
    robot.connect()
    robot.zero()
    robot.arm()
    assert robot._client is not None
    write_line(bus_pid=robot._client.pid)
    start_s = time.monotonic()
    while robot.failure is None:
        now_s = time.monotonic()
        phase = now_s - start_s
        command = Command(math.sin(3.0 * phase), math.cos(3.0 * phase), 10.0 if phase % 2.0 < 1.0 else -10.0)
        with contextlib.suppress(BusProcessLost):  # the bus process is killed at a random moment
            robot.send(command, source=Source.PROGRAM, captured_s=now_s)
            robot.beat(Source.PROGRAM)
        time.sleep(_PERIOD_S)
    robot.close()


def open_port(port: str) -> None:
    """Try to open a port that another program may hold."""
    robot = ServoRobot(ServosConfig(port=port), SafetyConfig())
    try:
        robot.connect()
        write_line(opened=True)
    except ServoError as error:
        write_line(opened=False, error=type(error).__name__, message=str(error))
    finally:
        robot.close()


def annotate(path: str, first: str) -> None:
    """Save one annotation after the other, and write a line after each."""
    with AnnotationStore(Path(path)) as store:
        store.add_image(IMAGE, 1000, 5)
        history = store.history(KEY)
        for number in range(int(first), int(first) + _MOST_EDITS):
            content = Annotation(((float(number), 0.0),))
            entry = history.edit("edit", content)
            assert entry is not None
            store.save(KEY, ImageView.AS_IS, entry, content, measure_lines(content, (640, 480), PerceptionConfig()), 1.0)
            write_line(saved=number)


def record_and_close(folder: str, wanted: str) -> None:
    """The operator window on the twin: records, is brought to a mode, and is closed."""
    from tools.fault_campaign.window import bring_to, make_test_window, record

    window, _ = make_test_window(Path(folder))
    recorded = record(window)
    reached = bring_to(window, Mode(wanted))
    write_line(recorded=recorded, mode=wanted if reached else "not reached")
    window.close()


if __name__ == "__main__":
    commands = {"drive": drive, "open": open_port, "annotate": annotate, "window": record_and_close}
    commands[sys.argv[1]](*sys.argv[2:])  # type: ignore[operator]
