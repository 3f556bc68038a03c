"""Which serial ports there are, and which servos answer on one. Nothing moves, and no register is written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports

from core.config.safety import JOINT_NAMES
from core.messages import message
from hardware.cameras import sysfs
from hardware.servos.bus_ipc import ask_for_port
from hardware.servos.dynamixel_port import NoAnswer, ServoLine

BAUDS = (1_000_000, 57_600, 115_200, 2_000_000, 3_000_000, 4_000_000)
"""The speeds of these servos, the likeliest first; 57600 is the factory's."""
_TRIES = 3


@dataclass(frozen=True, slots=True)
class FoundPort:
    """A serial port; ``path`` is the stable one in /dev/serial/by-id where there is one."""

    path: str
    title: str


@dataclass(frozen=True, slots=True)
class FoundServo:
    """A servo that answered."""

    id: int
    model: int


@dataclass(frozen=True, slots=True)
class FoundServos:
    """All that answered on a port, by id, and the speed at which they did."""

    port: str
    baud: int
    servos: tuple[FoundServo, ...]
    elsewhere: tuple[tuple[int, tuple[int, ...]], ...] = ()
    """Other speeds at which others answered, with their ids: one bus has one speed."""

    @property
    def ids(self) -> tuple[int, ...]:
        return tuple(servo.id for servo in self.servos)

    @property
    def models(self) -> dict[int, int]:
        """Model numbers by id."""
        return {servo.id: servo.model for servo in self.servos}


def find_ports() -> tuple[FoundPort, ...]:
    """Serial ports of USB adapters, as the system lists them; none is opened."""
    stable = {link.resolve(): link for link in sorted((sysfs.DEV / "serial" / "by-id").glob("*"))}
    titles = {Path(port.device).resolve(): port.description for port in list_ports.comports() if port.vid is not None}
    nodes = sorted({*stable, *titles}, key=lambda node: node.name)
    return tuple(FoundPort(str(stable.get(node, node)), titles.get(node, "") or node.name) for node in nodes)


def find_servos(
    port: str,
    bauds: Sequence[int] = BAUDS,
    say: Callable[[str], object] = lambda _: None,
    check_stop: Callable[[], None] = lambda: None,
    count: int = len(JOINT_NAMES),
) -> FoundServos:
    """Ping all ids, at one speed after the other, until `count` answer; where they never do, those of the speed with the most.

    `check_stop` is called in between, and may raise. Raises PortError: the port is missing, not permitted, in use, or no serial
    port; NoAnswer: no servo answers at any speed.
    """
    answered: dict[int, tuple[FoundServo, ...]] = {}
    ask_for_port(port, relaxed=True)  # a bus process of this program may watch servos that hold: it relaxes them
    for baud in bauds:
        check_stop()
        say(f"asking at {baud} baud")
        line = ServoLine(port, baud)
        line.open()
        try:
            found = [FoundServo(servo_id, model) for servo_id in _ids(line, count) if (model := _model(line, servo_id)) is not None]
        finally:
            line.close()
        if found:
            answered[baud] = tuple(found)
        if len(found) >= count:
            break
    if answered:
        fullest = max(answered, key=lambda baud: len(answered[baud]))
        others = tuple((baud, tuple(one.id for one in found)) for baud, found in answered.items() if baud != fullest)
        return FoundServos(port, fullest, answered[fullest], others)
    speeds = ", ".join(map(str, bauds))
    raise NoAnswer(f"no servo answers on {port} (asked at {speeds} baud): switch their supply on, check the cable to the adapter")


_CYCLE_BYTES = 237.0
"""Bytes on the line in a cycle: all seven read and told. From 41.2 ms measured at 57600 baud, 21.1 at 115200."""
_CYCLE_SHARE = 0.8
"""A cycle that takes more of its period leaves no room for a retry."""
FASTER_BUS = "with DYNAMIXEL Wizard 2.0 set Baud Rate (8) of all seven to 1 Mbps, then servos.baud = 1000000"
"""What to do about a slow bus."""


def slow_bus(baud: int, bus_hz: float) -> str:
    """What a speed costs that is too low for so many cycles a second, in one line; "" where it is fast enough."""
    cycle_s = 10.0 * _CYCLE_BYTES / baud
    if cycle_s <= _CYCLE_SHARE / bus_hz:
        return ""
    return message("{baud} baud: about {a:.0f} cycles a second instead of {b:g}", baud=baud, a=1.0 / cycle_s, b=bus_hz)


def _ids(line: ServoLine, count: int) -> list[int]:
    """Ids that answer. All talk after one another, and one that is missed is found in the next round."""
    ids = set(line.others())
    for _ in range(_TRIES - 1):
        if not ids or len(ids) >= count:
            break
        ids |= set(line.others())
    return sorted(ids)


def _model(line: ServoLine, servo_id: int) -> int | None:
    """Model number; None when the servo falls silent again."""
    return next((model for _ in range(_TRIES) if (model := line.ping(servo_id)) is not None), None)
