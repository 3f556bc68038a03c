"""The two processes of a twin with servos, which load beside whatever else is loading."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

from hardware.servos.bus_start import BusProcess
from hardware.twin.twin_start import TwinProcess


@dataclass(frozen=True, slots=True, eq=False)
class Ahead:
    """They load, and wait for what they shall be."""

    twin: TwinProcess
    bus: BusProcess

    def end(self) -> None:
        """They are not needed. What was taken over is left alone."""
        self.bus.end()
        self.twin.end()


def start_twin() -> Ahead:
    """Raises DeviceError when they cannot be started."""
    with ExitStack() as undo:
        twin = TwinProcess()  # first: it loads for longer
        undo.callback(twin.end)
        bus = BusProcess()
        undo.pop_all()
    return Ahead(twin, bus)
