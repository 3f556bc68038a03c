"""``doctor``: the preflight as a table or as JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from hardware.checks import program
from hardware.checks.check import RENEW, Check, one_line

_NAME_COLUMNS = 18


def run_doctor(rig: str | None, config_path: Path | None, *, as_json: bool) -> int:
    """Check everything and tell; returns 0 when all is well, 1 when something is not. Raises UserError for bad input."""
    checks = list(_with_progress(_checks(rig, config_path)))
    if as_json:
        sys.stdout.write(json.dumps({"checks": [check.to_json() for check in checks]}) + "\n")
    else:
        _print(checks)
    return 0 if all(check.ok for check in checks) else 1


def _checks(rig: str | None, config_path: Path | None) -> Iterator[Check]:
    """All of them; where what they stand on is missing or damaged, those that say so."""
    # One that is cut short would end this process, too.
    problem = program.load_problem(program.OPENCV)
    if problem:
        problem = f"{program.OPENCV}: {problem}"
    else:
        try:
            from app.window_command import window_config
            from hardware.preflight import run_checks
        except ImportError as error:
            problem = one_line(error)
    if problem:
        yield from (check() for check in program.OF_THE_PROGRAM)
        yield Check("all others", False, f"not made, since the program does not load: {problem}", RENEW)
        return
    config, _ = window_config(rig, config_path, None)
    yield from run_checks(config)


def _with_progress(checks: Iterator[Check]) -> Iterator[Check]:
    """The slowest take seconds: say on standard error that something happens."""
    with Console(stderr=True, emoji=False).status("checking ...") as status:
        for check in checks:
            status.update(Text(f"checking ... {check.name}: {'ok' if check.ok else 'not ok'}"))
            yield check


def _print(checks: list[Check]) -> None:
    console = Console(highlight=False, markup=False, emoji=False)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, expand=False)
    table.add_column("", no_wrap=True)
    table.add_column("check", no_wrap=True, min_width=_NAME_COLUMNS)
    table.add_column("found", overflow="fold")
    for check in checks:
        # A word beside the colour: colour alone says nothing to some, and to a file.
        mark = Text("ok", style="green") if check.ok else Text("NOT OK", style="bold red")
        table.add_row(mark, Text(check.name), Text(check.detail))
    console.print(table)
    wrong = [check for check in checks if not check.ok]
    if not wrong:
        sys.stdout.write("All is well.\n")
        return
    sys.stdout.write("What to do:\n")
    for check in wrong:
        # Not through the console: a command must stay on one line, so that it can be copied.
        sys.stdout.write(f"  {check.name}: {check.fix}\n")
