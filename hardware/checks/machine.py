"""The computer: cores and memory, disk for recordings, clock."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

from core.record_config import RecordConfig, sessions_folder
from hardware.checks.check import RENEW, Check, one_line

_CORES = 2
_MEMORY_GB, _FREE_GB = 3.5, 1.0
_RATE_TOLERANCE = 0.02
_WATCHED_S = 0.05
_BUILT_IN_YEAR = 2025


def memory_gb() -> tuple[float, float]:
    """Memory in all, and what programs can still have, in GB."""
    import psutil

    memory = psutil.virtual_memory()
    return memory.total / 1e9, memory.available / 1e9


def check_machine(cores: int | None = None, memory: Callable[[], tuple[float, float]] = memory_gb) -> Check:
    """Enough to perceive 20 and more frames a second beside the window and the servo bus."""
    name = "cores and memory"
    if cores is None:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        total_gb, free_gb = memory()
    except ImportError as error:
        return Check(name, False, one_line(error), RENEW)
    detail = f"{cores} core{'s' * (cores > 1)}, {total_gb:.1f} GB of memory, {free_gb:.1f} GB free"
    if cores < _CORES:
        return Check(name, False, detail, f"use a computer with {_CORES} cores or more, or allow this program more of them")
    if total_gb < _MEMORY_GB or free_gb < _FREE_GB:
        return Check(name, False, detail, f"close other programs: {_FREE_GB:g} GB must be free, and {_MEMORY_GB:g} GB there in all")
    return Check(name, True, detail)


def check_disk(config: RecordConfig, usage: Callable[[Path], tuple[int, int, int]] = shutil.disk_usage) -> Check:
    """Where sessions go: writable, and room for them."""
    name, folder = "recordings", sessions_folder(config.folder)
    there = next((place for place in (folder, *folder.parents) if place.exists()), Path("/"))
    if not there.is_dir():
        return Check(name, False, f"{there} is no folder", "set record.folder to one that can be written")
    if not os.access(there, os.W_OK | os.X_OK):
        return Check(name, False, f"{there} cannot be written", f"sudo chown $USER {there}   (or set record.folder)")
    try:
        total, _, free = usage(there)
    except OSError as error:
        return Check(name, False, f"{there}: {error.strerror}", "check the disk, or set record.folder")
    detail = f"{folder}: {free / 1e9:.1f} GB free of {total / 1e9:.1f} GB"
    if free < config.warn_free_mb * 1e6 or (total and free / total < config.warn_free_share):
        wanted = max(config.warn_free_mb / 1e3, config.warn_free_share * total / 1e9)
        return Check(name, False, detail, f"make room ({wanted:.1f} GB or more), or set record.folder to another disk")
    return Check(name, True, detail)


def check_clock(
    monotonic: Callable[[], float] = time.monotonic,
    reference: Callable[[], float] = time.perf_counter,
    wall: Callable[[], float] = time.time,
    watched_s: float = _WATCHED_S,
) -> Check:
    """The clock that all ages and time limits hang on runs, never backwards and at the right rate; the date can be true."""
    name, advice = "clock", "restart the computer; in a virtual machine check its clock source"
    # Each reading between two of the other clock: a process can stand still in between, and no clock is at fault then.
    began_after, began, began_before = reference(), monotonic(), reference()
    before = now = began
    while reference() - began_before < watched_s:
        now = monotonic()
        if now < before:
            return Check(name, False, f"the monotonic clock went back by {1e6 * (before - now):.0f} us", advice)
        before = now
    ended_after, ended, ended_before = reference(), monotonic(), reference()
    at_least, at_most = (ended - began) / (ended_before - began_after), (ended - began) / (ended_after - began_before)
    if at_most < 1.0 - _RATE_TOLERANCE or at_least > 1.0 + _RATE_TOLERANCE:
        rate = at_most if at_most < 1.0 else at_least
        return Check(name, False, f"the monotonic clock runs at {rate:.3f} of the real rate", advice)
    date = time.gmtime(wall())
    detail = f"monotonic, now {time.strftime('%Y-%m-%d %H:%M', date)} UTC"
    if date.tm_year < _BUILT_IN_YEAR:
        return Check(name, False, f"{detail}: the date is wrong, and sessions are named by it", "sudo timedatectl set-ntp true")
    return Check(name, True, detail)
