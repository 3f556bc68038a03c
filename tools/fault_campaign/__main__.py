"""``python -m tools.fault_campaign``: brings all faults about and compares reaction, alert and record with what is listed."""

from __future__ import annotations

import json
import logging
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from app.commands.progress import Interrupt, check_can_write, progress_bar
from core.devices import UserError
from core.files import write_atomic
from tools.fault_campaign import perception_cases, program_cases, servo_cases  # noqa: F401 - they register themselves
from tools.fault_campaign.registry import CASES, COUNT, CampaignError, FaultCase, Kit, Observation
from tools.run import run_tool

_log = logging.getLogger(__name__)
_TRIES = 3  # over real lines, where a machine that pauses at the wrong moment spoils a try

_HEAD = """# Faults

What the program does in each fault. `python -m tools.fault_campaign --out docs/faults.md` brings them about and writes this page.

**HOLD** stops an autonomous motion and may clear itself within half a second; **DISARM** holds, leaves autonomy and must be
acknowledged; **STOP** does so in every mode and blocks the bus. Times count from the injection on, ages from the frame before it.
"As listed" includes modes, alerts, the session's record and, for camera and perception, the blanked advice.
"""
_WAYS = {
    True: """Measured live: seven software servos on a pseudo-terminal, the real driver in its own process, the wall's clock. The
twin's masks stand in for the network. A try that the machine disturbs is repeated, twice at most.
""",
    False: "Measured in lock-step where a case allows it: simulated time, ideal servos behind the real gate.\n",
}


@dataclass(frozen=True, slots=True)
class Result:
    """A case and its last try."""

    case: FaultCase
    seen: Observation
    seconds: float
    tries: int


def run_case(case: FaultCase, *, live: bool) -> Result:
    """Bring a fault about; live, up to three times."""
    started_s = time.monotonic()
    tries = 0
    while True:
        tries += 1
        with tempfile.TemporaryDirectory(prefix="lumenpilot_fault_") as folder:
            try:
                seen = case.inject(Kit(Path(folder), live))
            except UserError as error:
                seen = Observation("not brought about", problems=(" ".join(str(error).split()),))
            except Exception as error:  # noqa: BLE001 - one case that breaks must not end the campaign; it is not OK
                _log.error("fault %d broke", case.number, exc_info=error)
                seen = Observation("not brought about", problems=(f"{type(error).__name__}: {' '.join(str(error).split())}",))
        if seen.ok or not live or tries == _TRIES:
            return Result(case, seen, time.monotonic() - started_s, tries)


def to_json(result: Result) -> dict[str, Any]:
    """One fault as plain values."""
    case, seen = result.case, result.seen
    return {
        "fault": case.number,
        "name": case.text.name,
        "injected": case.text.injected,
        "wanted": case.text.wanted,
        "seen": seen.reaction,
        "alerts": list(seen.alerts),
        "events": list(seen.events),
        "ok": seen.ok,
        "problems": list(seen.problems),
        "tries": result.tries,
        "seconds": round(result.seconds, 1),
    }


def _line_of(result: Result) -> str:
    case, seen = result.case, result.seen
    word = "OK    " if seen.ok else "NOT OK"
    tries = f" (try {result.tries})" if result.tries > 1 else ""
    problems = f"  <- {'; '.join(seen.problems)}" if seen.problems else ""
    return f"{case.number:2d} {word} {case.text.name}: {seen.reaction}{tries}{problems}"


def _summary_of(results: Sequence[Result]) -> str:
    good = sum(result.seen.ok for result in results)
    return f"{good} of {len(results)} as listed" + ("" if len(results) == COUNT else f" ({COUNT} in the list)")


def page_of(results: Sequence[Result], *, live: bool) -> str:
    """The page in Markdown."""
    lines = [_HEAD, _WAYS[live], f"**{_summary_of(results)}**, {datetime.now(UTC):%Y-%m-%d}.\n"]
    if len(results) < COUNT:
        lines.append("The campaign was interrupted: the missing faults were not brought about.\n")
    lines += ["| # | fault | injected | wanted | seen |", "|---|---|---|---|---|"]
    for result in results:
        case, seen = result.case, result.seen
        text = seen.reaction if seen.ok else f"{seen.reaction}; **NOT OK**: {'; '.join(seen.problems)}"
        text += f" (try {result.tries})" if result.tries > 1 else ""
        cells = (" ".join(cell.split()).replace("|", "\\|") for cell in (*case.text[:3], text))
        lines.append(f"| {case.number} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def run_faults(only: list[int], out: Path | None, *, quick: bool, as_json: bool) -> int:
    """Run the campaign, or the faults that are named; returns 0 when all went as listed, 1 when not.

    Raises UserError, and KeyboardInterrupt once the results so far are written.
    """
    if unknown := [number for number in only if not 1 <= number <= COUNT]:
        raise CampaignError(f"there is no fault {unknown[0]}: they are numbered 1 to {COUNT}")
    cases = [case for _, case in sorted(CASES.items()) if (not only or case.number in only) and (case.text.quick or not quick)]
    if not cases:
        raise CampaignError(f"fault {', '.join(map(str, only))} needs a line, a process or a window: leave --quick out")
    if out is not None:
        if len(cases) < COUNT:
            raise CampaignError("--out writes the whole list: leave --only and --quick out")
        check_can_write(out, "--out")
    os.environ["QT_QPA_PLATFORM"] = "offscreen"
    logging.disable(logging.CRITICAL)  # what is logged of injected faults is what the cases look for
    try:
        results = list(_run_cases(cases, live=not quick, as_json=as_json))
    finally:
        logging.disable(logging.NOTSET)
    if not as_json:
        sys.stdout.write(f"{_summary_of(results)}\n")
    if out is not None and results:
        write_atomic(out, page_of(results, live=not quick).encode())
    if len(results) < len(cases):
        raise KeyboardInterrupt
    return 0 if all(result.seen.ok for result in results) else 1


def _run_cases(cases: list[FaultCase], *, live: bool, as_json: bool) -> Iterator[Result]:
    with Interrupt() as interrupt, progress_bar() as bar:
        task = bar.add_task("faults", total=len(cases))
        for case in cases:
            bar.update(task, description=f"{case.number} {case.text.name}")
            result = run_case(case, live=live)
            if interrupt.asked and not result.seen.ok:
                return  # Ctrl-C reaches the processes of the case, too: it may be the cause of the problem
            seen = replace(result.seen, reaction=result.seen.reaction.replace(str(Path.cwd()), "…"))
            result = replace(result, seen=seen)
            sys.stdout.write((json.dumps(to_json(result)) if as_json else _line_of(result)) + "\n")
            sys.stdout.flush()
            bar.advance(task)
            yield result
            if interrupt.asked:
                return


def main(
    only: Annotated[list[int] | None, typer.Option(min=1, help="this fault of the list only; may be repeated")] = None,
    json: Annotated[bool, typer.Option("--json", help="one JSON object per fault on standard output")] = False,
    out: Annotated[Path | None, typer.Option(help="also write the table as a page, as docs/faults.md")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="those that need no line, process or window, in lock-step")] = False,
) -> None:
    """Fault campaign: bring all faults about and look for reaction, alert and record."""
    sys.exit(run_faults(only or [], out, quick=quick, as_json=json))


if __name__ == "__main__":
    run_tool(main)
