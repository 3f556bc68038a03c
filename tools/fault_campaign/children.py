"""Child processes of the fault campaign: ``python -m tools.fault_campaign.children WHAT ARGUMENT...``."""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
import time
from pathlib import Path

from core.annotation.model import Annotation, ImageView, measure_lines
from core.annotation.store import AnnotationStore, ImageRecord, ItemKey
from core.config.models import PerceptionConfig
from core.config.safety import SafetyConfig, ServosConfig
from core.control.gate import Source
from core.types import Command
from hardware.servos.dynamixel_port import BusProcessLost, ServoError
from hardware.servos.servo_robot import ServoRobot

MODULE = "tools.fault_campaign.children"
IMAGE = ImageRecord("0" * 64, "a.png", 640, 480)
KEY = ItemKey(IMAGE.sha256, "", "campaign")
_PERIOD_S = 0.02
_MOST_EDITS = 100_000


def say(**what: object) -> None:
    """One line, at once: what was said has happened, however the process ends."""
    os.write(1, f"{json.dumps(what)}\n".encode())


def drive(port: str) -> None:
    """Advance and bend to and fro, never at rest, as a program that follows fresh frames."""
    robot = ServoRobot(ServosConfig(port=port), SafetyConfig())
    robot.connect()
    robot.zero()
    robot.arm()
    assert robot._client is not None
    say(bus_pid=robot._client.pid)
    start_s = time.monotonic()
    while robot.failure is None:
        now_s = time.monotonic()
        phase = now_s - start_s
        command = Command(math.sin(3.0 * phase), math.cos(3.0 * phase), 10.0 if phase % 2.0 < 1.0 else -10.0)
        with contextlib.suppress(BusProcessLost):  # it is killed at a random moment
            robot.send(command, source=Source.PROGRAM, captured_s=now_s)
            robot.beat(Source.PROGRAM)
        time.sleep(_PERIOD_S)
    robot.close()


def open_port(port: str) -> None:
    """Try to open a port that another program may hold."""
    robot = ServoRobot(ServosConfig(port=port), SafetyConfig())
    try:
        robot.connect()
        say(opened=True)
    except ServoError as error:
        say(opened=False, error=type(error).__name__, message=str(error))
    finally:
        robot.close()


def annotate(path: str, first: str) -> None:
    """Save one annotation after the other, and tell each."""
    with AnnotationStore(Path(path)) as store:
        store.add_image(IMAGE, 1000, 5)
        history = store.history(KEY)
        for number in range(int(first), int(first) + _MOST_EDITS):
            content = Annotation(((float(number), 0.0),))
            entry = history.edit("edit", content)
            assert entry is not None
            store.save(KEY, ImageView.AS_IS, entry, content, measure_lines(content, (640, 480), PerceptionConfig()), 1.0)
            say(saved=number)


def window(folder: str, wanted: str) -> int:
    """The operator window on the twin: records, is brought to a mode, and is closed; returns its exit code."""
    from tools.fault_campaign.cases import run_and_close

    return run_and_close(Path(folder), wanted)


def main(arguments: list[str]) -> int:
    what, *rest = arguments
    done = {"drive": drive, "open": open_port, "annotate": annotate, "window": window}[what](*rest)  # type: ignore[operator]
    return int(done or 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
