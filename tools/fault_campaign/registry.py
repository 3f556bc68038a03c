"""The 45 faults by number: what is injected, what must follow, and the function that does the one and looks for the other.

Looks at what followed a fault: the way through the modes, alerts, the record in the session; and says what is missing of it.
"""

from __future__ import annotations

import logging
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from core.control.alerts import ALERTS, AlertKey
from core.control.drive_view import DriveView
from core.control.faults import Cause
from core.control.modes import DRIVING_MODES, Mode
from core.devices import UserError
from core.session.manifest import Event, EventKind

if TYPE_CHECKING:
    from tools.fault_campaign.bench import FaultBench

_log = logging.getLogger(__name__)

COUNT = 45
_TRIES = 3


@dataclass(frozen=True, slots=True)
class Observation:
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

    def __call__(self, kit: Kit) -> Observation: ...


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
    seen: Observation
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
    from tools.fault_campaign import cases  # noqa: F401 - they register themselves

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


def _try(case: FaultCase, kit: Kit) -> Observation:
    try:
        return case.inject(kit)
    except UserError as error:
        return Observation("not brought about", problems=(" ".join(str(error).split()),))
    except Exception as error:  # noqa: BLE001 - one case that breaks must not end the campaign; it is not OK
        _log.error("fault %d broke", case.number, exc_info=error)
        return Observation("not brought about", problems=(f"{type(error).__name__}: {' '.join(str(error).split())}",))


def tidy(seen: Observation, folder: Path) -> Observation:
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


_WORD = {
    Mode.HOLD: "HOLD",
    Mode.STOPPED: "STOP",
    Mode.ADVISORY: "DISARM",
    Mode.ARMED: "back to the operator",
    Mode.AUTONOMOUS: "resumes",
}
_BEFORE_S = 0.03
"""The turn of the mark itself."""


@dataclass(frozen=True, slots=True)
class Mark:
    """Where the observation begins."""

    time_s: float
    views: int
    alerts: int
    mode: Mode
    active: frozenset[str]


@dataclass(frozen=True, slots=True)
class ExpectedReaction:
    """What must follow.

    ``path`` are the modes in turn, the one at the mark left out; ``causes`` must all have been active, be said as alerts (but for
    those of `silent`) and be in the session; ``latched`` is what waits to be acknowledged at the end; ``within_s`` bounds the first
    change of mode, by the pilot's own clock; ``blank``: no advice from the first cause on. ``alternatives`` are other ways through
    the modes that are as good; with ``may_hold`` a hold on the way that clears itself is, too: a cycle that waits for answers in
    vain leaves the gate without positions.
    """

    path: tuple[Mode, ...]
    causes: tuple[Cause, ...]
    latched: Cause | None = None
    within_s: float | None = None
    blank: bool = False
    alerts: tuple[AlertKey, ...] = ()
    silent: tuple[Cause, ...] = ()
    alternatives: tuple[tuple[Mode, ...], ...] = ()
    may_hold: bool = False


def mark(bench: FaultBench) -> Mark:
    """Begin to record and to look; a bench that was handed over is so at the mark, whatever the machine did meanwhile."""
    bench.record()
    bench.turn()
    if bench.handed_over and bench.mode is not Mode.AUTONOMOUS:
        bench.hand_over()
    active = frozenset(fault.cause.value for fault in bench.view.active)
    return Mark(bench.now_s, len(bench.views), len(bench.alerts), bench.mode, active)


def judge(bench: FaultBench, start: Mark, wanted: ExpectedReaction, *more: str) -> Observation:
    """What was seen since the mark, against what was wanted; `more` are problems found elsewhere."""
    views = bench.views[start.views :]
    problems = list(more)
    path, times = _path(views, start)
    if (_without_holds(path) if wanted.may_hold else path) not in (wanted.path, *wanted.alternatives):
        problems.append(f"modes went {_words(path)} instead of {_words(wanted.path)}")
    if wanted.within_s is not None and times and times[0] > wanted.within_s:
        problems.append(f"first reaction after {1000 * times[0]:.0f} ms (at most {1000 * wanted.within_s:.0f} ms)")
    active = {fault.cause for view in views for fault in view.active}
    problems += [f"never active: {cause}" for cause in wanted.causes if cause not in active]
    if wanted.latched is not None:
        found = views[-1].latched.cause if views and views[-1].latched is not None else None
        if found is not wanted.latched:
            problems.append(f"latched is {found or 'nothing'} instead of {wanted.latched}")
    if wanted.blank:
        problems += _not_blank(views, wanted.causes)
    if views and views[-1].mode not in DRIVING_MODES and views[-1].commanded is not None:
        problems.append("the program goes on commanding")
    keys: list[AlertKey] = [*(cause for cause in wanted.causes if cause not in wanted.silent), *wanted.alerts]
    alerts = bench.alerts[start.alerts :]
    said = {alert.key for alert in alerts}
    problems += [f"no alert: {ALERTS[key].text}" for key in keys if key not in said]
    told, missing = _events(bench, start, keys, wanted.causes, path)
    return Observation(
        _reaction(path, times), tuple(dict.fromkeys(alert.spec.text for alert in alerts)), told, (*problems, *missing)
    )


def _path(views: Sequence[DriveView], start: Mark) -> tuple[tuple[Mode, ...], list[float]]:
    path: list[Mode] = []
    times: list[float] = []
    for view in views:
        if view.mode is not (path[-1] if path else start.mode):
            path.append(view.mode)
            times.append(view.time_s - start.time_s)
    return tuple(path), times


def _without_holds(path: tuple[Mode, ...]) -> tuple[Mode, ...]:
    """Without the holds that cleared themselves."""
    kept = list(path)
    while len(kept) >= 2 and kept[0] is Mode.HOLD and kept[1] is Mode.AUTONOMOUS:
        del kept[:2]
    return tuple(kept)


def _words(path: Sequence[Mode]) -> str:
    return ", ".join(path) or "nowhere"


def _reaction(path: Sequence[Mode], times: Sequence[float]) -> str:
    if not path:
        return "goes on"
    return ", ".join(f"{_WORD[mode]} at {1000 * time_s:.0f} ms" for mode, time_s in zip(path, times, strict=True))


def _not_blank(views: Sequence[DriveView], causes: Sequence[Cause]) -> list[str]:
    for view in views:
        if any(fault.cause in causes for fault in view.active):
            if view.advice is not None:
                return ["advice is shown although a fault should blank it"]
            if not view.blanked:
                return ["the advice is blank, but nothing says why"]
    return []


def _events(
    bench: FaultBench, start: Mark, keys: Sequence[AlertKey], causes: Sequence[Cause], path: Sequence[Mode]
) -> tuple[tuple[str, ...], list[str]]:
    """The session's events since the mark in words, and what is missing among them."""
    _, events = bench.recorded()
    told = [(event.kind, _text(event)) for event in events if event.time_s >= start.time_s - _BEFORE_S]
    # what was active before is told at the beginning of the session
    earlier = {event.text for event in events if event.kind is EventKind.FAULT and event.text in start.active}
    missing = [
        f"not in the session: fault {c}" for c in causes if (EventKind.FAULT, c.value) not in told and c.value not in earlier
    ]
    missing += [f"not in the session: mode {mode}" for mode in path if (EventKind.MODE, mode.value) not in told]
    missing += [f"not in the session: alert {key}" for key in keys if (EventKind.ALERT, str(key)) not in told]
    shown = [f"{kind}: {text}" if text else kind.value for kind, text in told if kind is not EventKind.VIDEO]
    return tuple(dict.fromkeys([*shown, *(f"fault: {text}" for text in sorted(earlier))])), missing


def _text(event: Event) -> str:
    return str(event.data.get("key", event.text)) if event.kind is EventKind.ALERT else event.text
