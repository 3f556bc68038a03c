"""The bench twin in a process of its own: physics, pictures and software servos take no time from the program that looks at them.

The application starts it (``twin_start``) as ``python -m hardware.twin.twin_process MEMORY WAKE``, gives it the configuration as
one line of JSON on standard input, and gets one line back: the servos' port, or what is wrong. From then on pictures and truth go
through shared memory, a byte in the pipe WAKE tells that there is a new picture, and the end of standard input ends the process.
"""

from __future__ import annotations

import contextlib
import gc
import json
import mmap
import os
import signal
import sys
import threading

from core.config import Config
from core.devices import DeviceError
from hardware.servos.shared_slot import SharedSlot
from hardware.twin.remote_twin import memory_layout, pack_frame, pack_status
from hardware.twin.servo_bus import SoftServoBus
from hardware.twin.servo_joints import drive_world, wired
from hardware.twin.world import TwinWorld

_WAIT_S = 0.2


def main(arguments: list[str]) -> int:
    """Run until standard input ends. Arguments: file descriptors of the shared memory and of the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the application decides what Ctrl-C means
    memory_fd, wake = map(int, arguments)
    line = sys.stdin.readline()
    if not line:  # started ahead, and not needed
        return 0
    message = json.loads(line)
    config = Config.model_validate(message["config"])
    layout = memory_layout(config.twin)
    with mmap.mmap(memory_fd, layout.size) as memory:
        frames, status = layout.slots(memory)
        try:
            world = TwinWorld(config.twin, perception=config.perception)
            world.insert(message["insertion_mm"])
            wiring = wired(config.twin, config.servos)
            servos = SoftServoBus(wiring, wire_time=True)
            servos.start()
        except (ValueError, OSError, DeviceError) as error:
            _say({"error": str(error)})
            return 1
        drive_world(world, servos, wiring)
        world.start()
        gc.collect()
        gc.freeze()  # what is loaded stays: later collections are short
        _say({"port": servos.port, "title": world.phantom.title})
        ended = threading.Event()
        threading.Thread(target=_await_end, args=(ended,), name="end of input", daemon=True).start()
        try:
            _serve(world, frames, status, wake, ended)
        finally:
            world.stop()
            servos.stop()
    return 0


def _serve(world: TwinWorld, frames: SharedSlot, status: SharedSlot, wake: int, ended: threading.Event) -> None:
    os.set_blocking(wake, False)
    while not ended.is_set():
        if world.failure is not None:
            _say({"error": world.failure})
            return
        frame = world.frames.take(_WAIT_S)
        status.put(pack_status(world.physics.status()))
        if frame is not None:
            frames.put(pack_frame(frame))
            try:
                os.write(wake, b".")
            except BlockingIOError:
                pass  # a full pipe wakes as well
            except BrokenPipeError:
                return  # the application was ended at this moment, before its end of the input is seen


def _await_end(ended: threading.Event) -> None:
    """The application closes its end, or is gone."""
    sys.stdin.read()
    ended.set()


def _say(message: dict[str, str]) -> None:
    with contextlib.suppress(BrokenPipeError):
        sys.stdout.write(json.dumps(message) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
