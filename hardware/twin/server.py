"""The bench twin in a process of its own, so that physics, rendering and software servos do not slow the application down.

Started as ``python -m hardware.twin.server MEMORY PIPE SOCKET PARENT``; ``hardware.twin.process`` has the application's side.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading

from core.config.models import Config
from core.devices import DeviceError
from hardware.processes import ParentLink, SharedSlot
from hardware.simulated_clock import WorldClock
from hardware.twin.process import drive_world, pack_frame, pack_status, slot_sizes, wired
from hardware.twin.servos.bus import SoftServoBus
from hardware.twin.world import TwinWorld

_WAIT_S = 0.2
"""How long the loop waits for a frame."""


def main(arguments: list[str]) -> int:
    """Run until the application ends it, or has ended. Arguments: those of ``ParentLink``."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the application decides what Ctrl-C means
    link = ParentLink(arguments)
    message = link.first_message()
    if message is None:  # started ahead, and not needed
        return 0
    config = Config.model_validate(message["config"])
    sizes = slot_sizes(config.twin)
    frames, status = SharedSlot.row(link.map_memory(sum(map(SharedSlot.size, sizes))), sizes)
    try:
        clock = WorldClock(message["clock"])
        world = TwinWorld(config.twin, perception=config.perception, servos=config.servos, safety=config.safety, clock=clock)
        world.insert(message["insertion_mm"])
        wiring = wired(config.twin, config.servos)
        servos = SoftServoBus(wiring, clock=clock, wire_time=True)
        servos.start()
    except (ValueError, OSError, DeviceError) as error:
        link.send({"error": str(error)})
        return 1
    drive_world(world, servos, wiring)
    world.start()
    gc.collect()
    gc.freeze()  # keeps later collections short
    link.send({"port": servos.port, "title": world.phantom.title})
    ended = threading.Event()
    threading.Thread(target=link.wait_for_end, args=(ended,), name="end of link", daemon=True).start()
    try:
        _serve(world, frames, status, link, ended)
    finally:
        world.stop()
        servos.stop()
    return 0


def _serve(world: TwinWorld, frames: SharedSlot, status: SharedSlot, link: ParentLink, ended: threading.Event) -> None:
    while not ended.is_set():
        if world.failure is not None:
            link.send({"error": world.failure})
            return
        frame = world.frames.take(_WAIT_S)
        status.put(pack_status(world.physics.status()))
        if frame is not None:
            frames.put(pack_frame(frame))
            try:
                os.write(link.pipe, b".")
            except BlockingIOError:
                pass  # a full pipe wakes the reader as well
            except BrokenPipeError:
                return  # the application ended just now, before the end of the link is seen


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
