"""``faults``: brings every fault of the list about, and prints what followed."""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from app.faults.registry import COUNT, CampaignError, FaultCase, Result, all_cases, run_case, tidy
from app.faults.report import line_of, page_of, summary_of, to_json
from app.long_work import Interrupt, progress_bar
from app.outputs import check_can_write
from core.whole_file import write_whole


def run_faults(only: list[int], out: Path | None, *, quick: bool, as_json: bool) -> int:
    """Run the campaign, or the faults that are named; returns 0 when all went as listed, 1 when not.

    Raises UserError, and KeyboardInterrupt once the results so far are told.
    """
    cases = _chosen(only, quick=quick)
    if out is not None and len(cases) < COUNT:
        raise CampaignError("--out writes the whole list: leave --only and --quick out")
    if out is not None:
        check_can_write(out, "--out")
    os.environ["QT_QPA_PLATFORM"] = "offscreen"  # windows are opened and closed; nobody shall see them
    logging.disable(logging.CRITICAL)  # what is logged of injected faults is what is looked for anyway
    try:
        results = list(_with_progress(cases, live=not quick, as_json=as_json))
    finally:
        logging.disable(logging.NOTSET)
    try:
        if not as_json:
            sys.stdout.write(f"{summary_of(results)}\n")
            sys.stdout.flush()
    finally:  # neither costs the other
        if out is not None and results:
            write_whole(out, page_of(results, live=not quick).encode())
    if len(results) < len(cases):
        raise KeyboardInterrupt
    return 0 if all(result.seen.ok for result in results) else 1


def _chosen(only: list[int], *, quick: bool) -> list[FaultCase]:
    cases = list(all_cases())
    if unknown := [number for number in only if not 1 <= number <= COUNT]:
        raise CampaignError(f"there is no fault {unknown[0]}: they are numbered 1 to {COUNT}")
    chosen = [case for case in cases if (not only or case.number in only) and (case.quick or not quick)]
    if not chosen:
        numbers = ", ".join(str(number) for number in only)
        raise CampaignError(f"fault {numbers} needs a line, a process or a window: leave --quick out")
    return chosen


def _with_progress(cases: list[FaultCase], *, live: bool, as_json: bool) -> Iterator[Result]:
    with Interrupt() as interrupt, progress_bar() as bar:
        task = bar.add_task("faults", total=len(cases))
        for case in cases:
            bar.update(task, description=f"{case.number} {case.name}")
            result = run_case(case, live=live)
            interrupted = interrupt.asked
            if interrupted and not result.seen.ok:
                return  # Ctrl-C reaches the processes of the case, too: what went wrong may be its doing
            result = replace(result, seen=tidy(result.seen, Path.cwd()))
            sys.stdout.write((json.dumps(to_json(result)) if as_json else line_of(result)) + "\n")
            sys.stdout.flush()
            bar.advance(task)
            yield result
            if interrupted:
                return
