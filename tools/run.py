"""How a development tool runs: a typer function with the product's error handling."""

from __future__ import annotations

import sys
from collections.abc import Callable

import typer

from core.devices import UserError


def run_tool(*commands: Callable[..., None]) -> None:
    """Run the command line of a tool. A UserError ends it as one line on standard error and exit code 2."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    for command in commands:
        app.command()(command)
    try:
        app()
    except UserError as error:
        sys.stderr.write(f"error: {error}\n")
        raise SystemExit(2) from None
