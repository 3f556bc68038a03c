"""The 45 faults by number: what is injected, what must follow, and the function that does the one and looks for the other."""

from __future__ import annotations

import logging
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from core.errors import UserError

_log = logging.getLogger(__name__)

COUNT = 45
_TRIES = 3


@dataclass(frozen=True, slots=True)
class Seen:
    """What followed. ``problems`` are what should have and did not; empty: all as listed."""

    reaction: str
    alerts: tuple[str, ...] = ()
    events: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        return not self.problems


@dataclass(frozen=True, slots=True)
class Kit:
    """What a fault may use: a folder of its own, and whether it shall take place over real lines, processes and windows."""

    folder: Path
    live: bool


class Inject(Protocol):
    """Brings the fault about and tells what was seen."""

    def __call__(self, kit: Kit) -> Seen: ...


@dataclass(frozen=True, slots=True)
class FaultCase:
    """``quick``: it can also be had in lock-step or on files alone, within a second or so, whatever the machine does meanwhile."""

    number: int
    name: str
    injected: str
    wanted: str
    inject: Inject
    quick: bool


@dataclass(frozen=True, slots=True)
class Result:
    """A case and what was seen of it, in the try that is told."""

    case: FaultCase
    seen: Seen
    seconds: float
    tries: int


class CampaignError(UserError):
    """The campaign cannot be run."""


@dataclass(slots=True)
class _Register:
    cases: dict[int, FaultCase] = field(default_factory=dict)


_register = _Register()


def fault(number: int, name: str, *, injected: str, wanted: str, quick: bool = True) -> Callable[[Inject], Inject]:
    """Enter the function that injects fault `number` of the list."""

    def enter(inject: Inject) -> Inject:
        if number in _register.cases or not 1 <= number <= COUNT:
            raise ValueError(f"fault {number} is registered twice, or there is none of that number")
        _register.cases[number] = FaultCase(number, name, injected, wanted, inject, quick)
        return inject

    return enter


def all_cases() -> tuple[FaultCase, ...]:
    """All faults that are registered, by number."""
    from app.faults import (  # noqa: F401 - they register themselves
        camera_cases,
        file_cases,
        operator_cases,
        perception_cases,
        process_cases,
        servo_cases,
        window_cases,
    )

    return tuple(_register.cases[number] for number in sorted(_register.cases))


def run_case(case: FaultCase, *, live: bool) -> Result:
    """Bring a fault about. Over real lines a machine that pauses at the wrong moment spoils a try, so there are up to three."""
    started_s = time.monotonic()
    most, tries = _TRIES if live else 1, 0
    while True:
        tries += 1
        with tempfile.TemporaryDirectory(prefix="lumenpilot_fault_") as folder:
            seen = _try(case, Kit(Path(folder), live))
        if seen.ok or tries == most:
            return Result(case, seen, time.monotonic() - started_s, tries)


def _try(case: FaultCase, kit: Kit) -> Seen:
    try:
        return case.inject(kit)
    except UserError as error:
        return Seen("not brought about", problems=(" ".join(str(error).split()),))
    except Exception as error:  # noqa: BLE001 - one case that breaks must not end the campaign; it is not OK
        _log.error("fault %d broke", case.number, exc_info=error)
        return Seen("not brought about", problems=(f"{type(error).__name__}: {' '.join(str(error).split())}",))


def tidy(seen: Seen, folder: Path) -> Seen:
    """Without the names of this machine's folders."""

    def clean(text: str) -> str:
        return text.replace(str(folder), "…")

    return replace(
        seen,
        reaction=clean(seen.reaction),
        alerts=tuple(map(clean, seen.alerts)),
        events=tuple(map(clean, seen.events)),
        problems=tuple(map(clean, seen.problems)),
    )
