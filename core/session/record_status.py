"""How a recording is going: one frozen picture of it for the window, and what the disk allows."""

from __future__ import annotations

import shutil
import threading
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from core.control.faults import Cause, Fault
from core.record_config import RecordConfig

STOPPED = "recording stopped: "
"""Before a problem that has ended a session."""
_MB = 1e6


@dataclass(frozen=True, slots=True)
class RecordStatus:
    """What the record bar shows.

    Attributes
    ----------
    armed : a session begins with the next picture.
    recording : a session is being written to `folder` (afterwards: the last one).
    elapsed_s, frames, bytes : of that session.
    dropped : frames that the recorder could not take since the session's start, because its queue was full.
    disk_free : bytes; None before the first look.
    warning : disk nearly full, in plain words.
    problem : why the recording stopped, or could not start; empty when all is well. The next start clears it.
    is_disk_full : the disk is why.
    problems : how often there was one: the same twice is told twice.
    notice : the last thing to say of "save the last seconds" that went wrong; `notices` counts them.
    ring_s : how much "save the last seconds" would give now.
    saving : the last seconds are being written.
    saved : the newest session that was completed, by stop or from the ring.
    """

    armed: bool = False
    recording: bool = False
    folder: Path | None = None
    elapsed_s: float = 0.0
    frames: int = 0
    bytes: int = 0
    dropped: int = 0
    disk_free: int | None = None
    warning: str = ""
    problem: str = ""
    is_disk_full: bool = False
    problems: int = 0
    notice: str = ""
    notices: int = 0
    ring_s: float = 0.0
    saving: bool = False
    saved: Path | None = None


def faults_between(before: RecordStatus, now: RecordStatus) -> list[Fault]:
    """What the pilot must tell the operator of the recorder, from one look to the next."""
    faults = []
    if now.problem and now.problems != before.problems:
        faults.append(Fault(Cause.DISK_FULL if now.is_disk_full else Cause.RECORDING_STOPPED, now.problem))
    elif now.warning:
        faults.append(Fault(Cause.DISK_LOW, now.warning))
    if now.dropped > before.dropped:
        faults.append(Fault(Cause.RECORDER_BEHIND, f"{now.dropped} frames"))
    return faults


class StatusBoard:
    """Where the threads of the recorder write what has changed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._status = RecordStatus()

    def show(self, **changes: Any) -> None:
        with self._lock:
            self._status = replace(self._status, **changes)

    def fail(self, problem: str, *, is_disk_full: bool = False) -> None:
        """The recording stopped, or could not start."""
        with self._lock:
            count = self._status.problems + 1
            self._status = replace(self._status, problem=problem, is_disk_full=is_disk_full, problems=count)

    def notice(self, text: str) -> None:
        """Something to say that stops no recording."""
        with self._lock:
            self._status = replace(self._status, notice=text, notices=self._status.notices + 1)

    @property
    def status(self) -> RecordStatus:
        with self._lock:
            return self._status


@dataclass(frozen=True, slots=True)
class Disk:
    """What is free (bytes); `warning` and `full` are lines to show, empty when there is room."""

    free: int
    warning: str
    full: str


def look_at_disk(folder: Path, config: RecordConfig) -> Disk | None:
    """The disk of a folder that may not be there yet; None when it cannot be told."""
    try:
        there = next(parent for parent in (folder, *folder.parents) if parent.exists())
        total, _, free = shutil.disk_usage(there)
    except (OSError, StopIteration):
        return None
    is_low = free < config.warn_free_mb * _MB or free < config.warn_free_share * total
    left = f"{free / _MB:,.0f}"
    warning = f"disk nearly full: {left} MB left" if is_low else ""
    full = f"disk full ({left} MB left in {folder})" if free < config.stop_free_mb * _MB else ""
    return Disk(free, warning, full)
