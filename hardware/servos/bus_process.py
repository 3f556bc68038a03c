"""The servo bus in its own process, with the gate inside: it survives whatever happens to the application, and stops the servos.

The application starts it (``bus_start``) as ``python -m hardware.servos.bus_process MEMORY LINE SOCKET PARENT``. Its life:

- 50 times a second it reads all servos, takes the newest order through the gate, and writes (``bus_loop``, ``bus_guard``).
- An order is good for 100 ms and for one bounded step. Heartbeats that stop for ``heartbeat_timeout_s`` disarm; then the process
  falls silent, so that the servos' own watchdogs trip as a second layer. When the application wakes up, it finds the cause latched.
- STOP has a pipe of its own. When the application is gone, that pipe ends: the servos hold, and the process ends.
- The process itself stopped or killed: each servo ends at its last goal, within one step; then its watchdog trips.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import os
import signal
import sys

from core.safety_config import SafetyConfig
from core.servo_config import ServosConfig
from hardware.servos.bus_loop import BusLoop
from hardware.servos.dynamixel import ServoBus
from hardware.servos.errors import ServoError
from hardware.servos.guard_end import GuardEnd

_log = logging.getLogger(__name__)

_PRIORITY = -10


def main(arguments: list[str]) -> int:
    """Run until the application ends or is gone; 0 unless something broke. Arguments: three file descriptors and the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the application decides what Ctrl-C means
    memory, line, requests, parent = map(int, arguments)
    end = GuardEnd(memory, line, requests, parent)
    try:
        return _guard(end)
    except Exception as error:  # noqa: BLE001 - top of the process: the loop has closed the bus, and the application is told
        _log.exception("the servo bus process stopped")
        end.last_words(f"{type(error).__name__}: {error}")
        return 1
    finally:
        end.close()


def _guard(end: GuardEnd) -> int:
    message = end.first_message()
    if message is None:
        return 0
    servos, safety = ServosConfig.model_validate(message["servos"]), SafetyConfig.model_validate(message["safety"])
    try:
        bus = ServoBus(servos)
    except ServoError as error:
        end.last_words(str(error))
        return 1
    with contextlib.suppress(PermissionError):  # the servos come before the pictures, where the system allows it
        os.setpriority(os.PRIO_PROCESS, 0, _PRIORITY)
    loop = BusLoop(end, bus, servos, safety)
    signal.signal(signal.SIGTERM, lambda *_: loop.end())
    gc.collect()
    gc.freeze()  # what is loaded stays: later collections are short
    loop.run()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
