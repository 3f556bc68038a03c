"""The campaign's table: for the terminal, as JSON, and as the page ``docs/faults.md``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

from app.faults.registry import COUNT, Result

_MOST_EVENTS = 8
_HEAD = """# Faults

Every fault of the program's list, brought about and watched: `python main.py faults` does it again (`--only N` one of them,
`--quick` those that need no line, process or window). This page is written by `python main.py faults --out docs/faults.md`.

Reactions: **HOLD** stops an autonomous motion and may clear itself within half a second; **DISARM** holds, leaves autonomy and
waits to be acknowledged; **STOP** does so in every mode and blocks the bus. Faults of camera and perception blank the advice from
the first cause on, which is checked, too. Times are the pilot's own, from the injection on; ages count from the capture of the last
frame or from the last word, which came up to a frame's period before it. A case is OK only if the way through the modes, the alerts
and the record in the session are all as listed.
"""
_WAYS = {
    True: (
        "Measured live: seven software servos behind a pseudo-terminal, the real driver in its own process, the wall's clock. The "
        "twin's own masks stand in for the network, but where a case says that it looks through the network. A machine that pauses "
        "for others spoils a try; there are up to three, and the last column says how many it took."
    ),
    False: "Measured in lock-step where a case allows it: a clock of its own, ideal servos behind the real gate.",
}


def to_json(result: Result) -> dict[str, Any]:
    """One fault as plain values."""
    case, seen = result.case, result.seen
    return {
        "fault": case.number,
        "name": case.name,
        "injected": case.injected,
        "wanted": case.wanted,
        "seen": seen.reaction,
        "alerts": list(seen.alerts),
        "events": list(seen.events),
        "ok": seen.ok,
        "problems": list(seen.problems),
        "tries": result.tries,
        "seconds": round(result.seconds, 1),
    }


def line_of(result: Result) -> str:
    """One fault on one line."""
    case, seen = result.case, result.seen
    word = "OK    " if seen.ok else "NOT OK"
    tries = f" (try {result.tries})" if result.tries > 1 else ""
    problems = f"  <- {'; '.join(seen.problems)}" if seen.problems else ""
    return f"{case.number:2d} {word} {case.name}: {seen.reaction}{tries}{problems}"


def summary_of(results: Sequence[Result]) -> str:
    good = sum(result.seen.ok for result in results)
    return f"{good} of {len(results)} as listed" + ("" if len(results) == COUNT else f" ({COUNT} in the list)")


def page_of(results: Sequence[Result], *, live: bool) -> str:
    """The page in Markdown."""
    lines = [_HEAD, f"{_WAYS[live]}\n"]
    lines.append(f"**{summary_of(results)}**, {datetime.now(UTC):%Y-%m-%d}.\n")
    if len(results) < COUNT:
        lines.append("The campaign was interrupted: the faults that are missing here were not brought about.\n")
    lines.append("| # | fault | injected | wanted | seen | alerts | in the session | |")
    lines.append("|---|---|---|---|---|---|---|---|")
    for result in results:
        case, seen = result.case, result.seen
        verdict = "OK" if seen.ok else f"**NOT OK**: {'; '.join(seen.problems)}"
        verdict += f", try {result.tries}" if result.tries > 1 else ""
        cells = (case.name, case.injected, case.wanted, seen.reaction, _several(seen.alerts), _several(seen.events), verdict)
        lines.append(f"| {case.number} | {' | '.join(map(_cell, cells))} |")
    return "\n".join(lines) + "\n"


def _several(texts: Iterable[str]) -> str:
    texts = list(texts)
    more = f"; and {len(texts) - _MOST_EVENTS} more" if len(texts) > _MOST_EVENTS else ""
    return "; ".join(texts[:_MOST_EVENTS]) + more or "none"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
