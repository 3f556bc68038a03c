"""An application that drives seven servos by itself until something ends it: the victim of the kill campaign.

``python -m tests.hardware.bus_application PORT`` says in JSON lines what happens: armed (with the bus process's id), then ended.
"""

from __future__ import annotations

import json
import math
import sys
import time

from core.config.safety import SafetyConfig, ServosConfig
from core.control.gate import Source
from core.types import Command
from hardware.servos.dynamixel_port import ServoError
from hardware.servos.servo_robot import ServoRobot

PERIOD_S = 0.02


def say(**what: object) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def drive(robot: ServoRobot) -> None:
    """Advance and bend to and fro, never at rest, as the program that follows fresh frames."""
    start_s = time.monotonic()
    while True:
        now_s = time.monotonic()
        phase = now_s - start_s
        robot.beat(Source.PROGRAM)
        advance_mm_s = 10.0 if phase % 2.0 < 1.0 else -10.0
        command = Command(bend=math.sin(3.0 * phase), pitch=math.cos(3.0 * phase), advance_mm_s=advance_mm_s)
        robot.send(command, source=Source.PROGRAM, captured_s=now_s)
        status = robot.bus_status()
        if status is not None and not status.armed:
            say(ended=str(status.latched))
            return
        time.sleep(PERIOD_S)


def main(port: str) -> None:
    robot = ServoRobot(ServosConfig(port=port), SafetyConfig())
    robot.connect()
    try:
        robot.zero()
        robot.arm()
        say(bus_pid=robot._client.pid)
        drive(robot)
    except ServoError as error:
        say(ended=str(error))
    finally:
        robot.close()


if __name__ == "__main__":
    main(sys.argv[1])
