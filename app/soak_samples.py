"""What a process and its children use, from the system's own books; and whether it stays the same."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

_PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6
_WARM_S, _WARM_SHARE = 600.0, 0.4
_MORE_MB, _MORE_SHARE = 12.0, 0.03
_MORE_COUNT = 5
"""A session that is being recorded has three files and a thread of its own; who leaks loses one with every rig, hundreds in all."""
_LEAST = 6


@dataclass(frozen=True, slots=True)
class Sample:
    """``memory_mb`` is resident; ``children_mb`` and ``children`` are the bus process and whatever else was started."""

    time_s: float
    memory_mb: float
    threads: int
    files: int
    children: int
    children_mb: float


def take_sample(time_s: float) -> Sample:
    """Of this process, now."""
    own = os.getpid()
    children = [pid for pid in _pids() if _parent(pid) == own]
    return Sample(
        time_s=round(time_s, 1),
        memory_mb=round(_memory_mb(own), 1),
        threads=len(os.listdir(f"/proc/{own}/task")),
        files=len(os.listdir(f"/proc/{own}/fd")),
        children=len(children),
        children_mb=round(sum(map(_memory_mb, children)), 1),
    )


def _pids() -> list[int]:
    return [int(name) for name in os.listdir("/proc") if name.isdecimal()]


def _parent(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[1])
    except (OSError, IndexError, ValueError):
        return -1


def _memory_mb(pid: int) -> float:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]) * _PAGE_MB
    except (OSError, IndexError, ValueError):
        return 0.0


@dataclass(frozen=True, slots=True)
class Flatness:
    """Medians of the first and of the last third after the warm-up; ``flat`` None: too few samples to tell."""

    flat: bool | None
    warm_s: float
    before: dict[str, float]
    after: dict[str, float]

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


def flatness(samples: Sequence[Sample]) -> Flatness:
    """Whether it stayed the same after ten minutes, or after two fifths of a shorter run."""
    if not samples:
        return Flatness(None, 0.0, {}, {})
    warm_s = min(_WARM_S, _WARM_SHARE * samples[-1].time_s)
    late = [sample for sample in samples if sample.time_s >= warm_s]
    third = len(late) // 3
    if len(late) < _LEAST:
        return Flatness(None, warm_s, {}, {})
    before, after = (_medians(part) for part in (late[:third], late[-third:]))
    grown = [
        after["memory_mb"] - before["memory_mb"] > _MORE_MB + _MORE_SHARE * before["memory_mb"],
        after["children_mb"] - before["children_mb"] > _MORE_MB + _MORE_SHARE * before["children_mb"],
        *(after[name] - before[name] > _MORE_COUNT for name in ("threads", "files", "children")),
    ]
    return Flatness(not any(grown), warm_s, before, after)


def _medians(samples: Sequence[Sample]) -> dict[str, float]:
    names = ("memory_mb", "threads", "files", "children", "children_mb")
    return {name: round(median(getattr(sample, name) for sample in samples), 1) for name in names}
