"""``python -m tools.fault_campaign``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from tools.fault_campaign.bench import run_faults
from tools.run import run_tool


def main(
    only: Annotated[list[int] | None, typer.Option(min=1, help="this fault of the list only; may be repeated")] = None,
    json: Annotated[bool, typer.Option("--json", help="one JSON object per fault on standard output")] = False,
    out: Annotated[Path | None, typer.Option(help="also write the table as a page, as docs/faults.md")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="those that need no line, process or window, in lock-step")] = False,
) -> None:
    """Fault campaign: bring all 45 faults about and look for reaction, alert and record."""
    sys.exit(run_faults(only or [], out, quick=quick, as_json=json))


if __name__ == "__main__":
    run_tool(main)
