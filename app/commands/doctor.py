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

from app.commands.options import ConfigOption, JsonOption, RigOption
from hardware.preflight import checks as program
from hardware.preflight.checks import RENEW, Check, one_line

_NAME_COLUMNS = 18
"""Width of the column of names."""


def doctor(as_json: JsonOption = False, rig: RigOption = None, config: ConfigOption = None) -> None:
    """Preflight: program, model, camera, servos, controls, disk, clock; what is wrong, and what to do. Nothing moves."""
    checks = []
    with Console(stderr=True, emoji=False).status("checking ...") as status:  # the slowest check takes seconds
        for check in _checks(rig, config):
            status.update(Text(f"checking ... {check.name}: {'ok' if check.ok else 'not ok'}"))
            checks.append(check)
    if as_json:
        sys.stdout.write(json.dumps({"checks": [check.to_json() for check in checks]}) + "\n")
    else:
        _print(checks)
    sys.exit(0 if all(check.ok for check in checks) else 1)


def _checks(rig: str | None, config_path: Path | None) -> Iterator[Check]:
    """All checks; those of the program alone where it does not load."""
    try:
        from hardware.preflight.preflight import run_checks
        from hardware.rig import rig_config
    except ImportError as error:
        yield from (check() for check in program.OF_THE_PROGRAM)
        yield Check("all others", False, f"not made, since the program does not load: {one_line(error)}", RENEW)
        return
    config, _ = rig_config(rig, config_path, None)
    yield from run_checks(config)


def _print(checks: list[Check]) -> None:
    console = Console(highlight=False, markup=False, emoji=False)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, expand=False)
    table.add_column("", no_wrap=True)
    table.add_column("check", no_wrap=True, min_width=_NAME_COLUMNS)
    table.add_column("found", overflow="fold")
    for check in checks:
        mark = Text("ok", style="green") if check.ok else Text("NOT OK", style="bold red")  # a word beside the colour
        table.add_row(mark, Text(check.name), Text(check.detail))
    console.print(table)
    wrong = [check for check in checks if not check.ok]
    sys.stdout.write("What to do:\n" if wrong else "All is well.\n")
    for check in wrong:
        # Not through the console: a command must stay on one line, so that it can be copied.
        sys.stdout.write(f"  {check.name}: {check.fix}\n")
