"""What the gate limited and rejected, newest first, repeats counted. No Qt here."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from app.cells import number
from app.language import tr, tr_text
from core.control.gate_checks import RejectReason

if TYPE_CHECKING:
    from hardware.servos.bus_messages import BusStatus

MAX_ENTRIES = 500
_LOOK_BACK = 30
_BURST_S = 1.0
"""The same thing again within so long is counted, not told again."""
_IDLE = frozenset({RejectReason.NO_COMMAND, RejectReason.NOT_ARMED})
"""Nobody moves the robot, and so it holds: nothing was refused."""


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One burst: ``text`` is its newest event's, ``clock`` the time of day of its first; ``joint`` is empty for rejections."""

    clock: str
    joint: str
    text: str
    count: int
    last_s: float
    key: Hashable
    serial: int

    @property
    def is_rejection(self) -> bool:
        return not self.joint


@dataclass(frozen=True, slots=True)
class LogChanges:
    """Since the last look: entries that were put before the others, rows that were renewed (after that), entries that were cut."""

    added: int
    renewed: tuple[int, ...]
    cut: int


def rejected_commands(status: BusStatus) -> int:
    """How often something that was asked for was refused as a whole."""
    return sum(count for reason, count in status.rejections.items() if reason not in _IDLE)


class ClampLog:
    """Fed with every status that the window sees.

    It sees fewer than there are cycles of the bus, so clamps are samples; ``BusStatus.clamp_count`` counts all of them. Rejections
    are taken from the status' own counts, and none is missed.
    """

    def __init__(self) -> None:
        self.entries: list[LogEntry] = []
        self._cycle: int | None = None
        self._rejections: dict[RejectReason, int] = {}
        self._serial = self._added = self._cut = 0
        self._renewed: set[int] = set()

    def see(self, status: BusStatus, clock: str) -> None:
        """Take in a status; `clock` is the time of day for people."""
        if self._cycle is None or status.cycle < self._cycle:  # the first of a bus process: what it counted before is no news
            self._rejections = dict(status.rejections)
        elif status.cycle == self._cycle:
            return
        self._cycle = status.cycle
        for clamp in status.clamps:
            text = (
                f"{number(clamp.asked_mm, 2)} \N{RIGHTWARDS ARROW} {number(clamp.allowed_mm, 2)} mm, {tr_text(clamp.limit.value)}"
            )
            self._tell((clamp.joint, clamp.limit), clamp.joint, text, 1, status.time_s, clock)
        for joint in status.at_end:
            self._tell((joint, "end"), joint, tr("stopped at the end of its envelope"), 1, status.time_s, clock)
        for reason, count in status.rejections.items():
            more = count - self._rejections.get(reason, 0)
            if more > 0 and reason not in _IDLE:
                known = status.rejection is not None and status.rejection.reason is reason and status.rejection.detail
                self._tell(reason, "", f"{reason.value}: {known}" if known else reason.value, more, status.time_s, clock)
        self._rejections = dict(status.rejections)

    def take_changes(self) -> LogChanges:
        """What a view has to do to be up to date."""
        newest = self._serial
        rows = sorted(newest - serial for serial in self._renewed if newest - serial < len(self.entries))
        changes = LogChanges(self._added, tuple(rows), self._cut)
        self._added = self._cut = 0
        self._renewed.clear()
        return changes

    def _tell(self, key: Hashable, joint: str, text: str, count: int, now_s: float, clock: str) -> None:
        for row, entry in enumerate(self.entries[:_LOOK_BACK]):
            if entry.key == key and 0.0 <= now_s - entry.last_s <= _BURST_S:
                # a detail that was seen once is worth more than a newer count without one
                kept = entry.text if entry.is_rejection and ":" not in text else text
                self.entries[row] = replace(entry, text=kept, count=entry.count + count, last_s=now_s)
                self._renewed.add(entry.serial)
                return
        self._serial += 1
        self.entries.insert(0, LogEntry(clock, joint.replace("_", " "), text, count, now_s, key, self._serial))
        self._added += 1
        if len(self.entries) > MAX_ENTRIES:
            del self.entries[MAX_ENTRIES:]
            self._cut += 1
