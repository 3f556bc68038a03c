"""The command line (a contract: scripts and studies rely on it). Errors are one clear line and exit code 2.

What a command takes stands with its family, in ``cli_*.py``; what it does, in a module that is imported only when it is called.
"""

from __future__ import annotations

import errno
import faulthandler
import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, TextIO

import typer

from app.cli_campaigns import benchmark, faults, screenshots, soak, trial
from app.cli_learning import average, calibrate, synth, train
from app.cli_options import ConfigOption, RigOption
from app.cli_rigs import doctor, rig_commands
from app.cli_sessions import play, record, replay, session_commands
from app.cli_study import ablation, annotate, evaluate, perceive
from app.memory import keep_freed, share_heaps
from core.errors import UserError
from core.picture_limit import limit_pictures

app = typer.Typer(
    name="lumenpilot",
    help="Teleoperation assist for a tendon-driven interventional robot: perception, pose state, advice, and a bench twin.",
    add_completion=False,
    no_args_is_help=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

SourceOption = Annotated[
    Path | None, typer.Option("--source", help="video, picture or folder to look at instead of a rig's camera")
]


_INTERRUPTED = 130


def main() -> None:
    """Run the command line. Known errors end as one line on standard error and exit code 2; Ctrl-C as exit code 130."""
    with suppress(OSError, RuntimeError, ValueError):  # there is not always a standard error
        faulthandler.enable()  # a memory fault says at least where, and not only that
    share_heaps()
    keep_freed()
    limit_pictures()
    if sys.stdout is None:  # started with a closed one: what is told there is told to nobody
        sys.stdout = open(os.devnull, "w")
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")  # a file's name need not be text that this terminal has
    try:
        try:
            _refuse_empty(sys.argv[1:])
            code = app(prog_name="main.py", standalone_mode=False)
        finally:
            _finish_output()
    except UserError as error:
        _tell(f"error: {error}")
        sys.exit(2)
    except typer.TyperException as error:  # a command line that makes no sense
        if error.format_message().startswith("Usage:"):  # a group by itself: its help is the answer
            _tell(error.format_message())
            sys.exit(2)
        context = getattr(error, "ctx", None)
        told = " ".join(error.format_message().split()).rstrip(".")
        _tell(f"error: {told}; see {context.command_path + ' ' if context is not None else ''}--help")
        sys.exit(2)
    except OSError as error:
        if error.errno == errno.ENOSPC:
            _tell(f"error: {error.filename or 'output'}: the disk is full; make room, or write to another one")
        elif error.filename is not None and error.strerror:
            _tell(f"error: {error.filename}: {error.strerror}")
        else:
            raise
        sys.exit(2)
    except (KeyboardInterrupt, typer.Abort):
        code = _INTERRUPTED
    if code == _INTERRUPTED:  # Typer gives it back instead of raising
        _tell("interrupted")
    if isinstance(code, int) and code:
        sys.exit(code)


def _refuse_empty(words: Sequence[str]) -> None:
    """No option and no argument takes an empty text: as a path it would mean this folder, and as a name nothing at all.

    But a study without a name is what was measured outside studies.
    """
    for before, word in zip(["", *words], words, strict=False):
        option, has_value, value = word.partition("=") if word.startswith("--") else (before, word == "", word)
        if has_value and not value and option != "--study":
            what = option if option.startswith("-") and option.strip("-") else "an argument"
            raise UserError(f"{what} is empty: give it a value, or leave it out (is a variable of a script not set?)")


def _tell(line: str) -> None:
    """On standard error; where that cannot be written, the exit code says it alone."""
    try:
        sys.stderr.write(line + "\n")
        sys.stderr.flush()
    except OSError:
        _let_go(sys.stderr)


def _let_go(stream: TextIO) -> None:
    """What it still holds goes nowhere: the interpreter would try again at its end, and change the exit code."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _finish_output() -> None:
    """What standard output still holds is written while an error of it can be told; at the interpreter's end nobody could."""
    if sys.stdout is None:
        return
    try:
        sys.stdout.flush()
    except OSError as error:
        _let_go(sys.stdout)
        if error.errno != errno.EPIPE:
            raise


@app.callback(invoke_without_command=True)
def _window(context: typer.Context, rig: RigOption = None, config: ConfigOption = None, source: SourceOption = None) -> None:
    """Without a command: the operator window."""
    if context.invoked_subcommand is None:
        _open_window(rig, config, source)
    given = [name for name, value in (("--rig", rig), ("--config", config), ("--source", source)) if value is not None]
    if given:
        command = context.invoked_subcommand
        raise UserError(f"{given[0]} before {command} is for the window alone; write it behind, where {command} takes it")


def gui(
    rig: RigOption = None,
    config: ConfigOption = None,
    source: SourceOption = None,
    tour: Annotated[bool, typer.Option("--tour", help="show the tour, as at the first start")] = False,
    until_first_frame: Annotated[bool, typer.Option("--until-first-frame", hidden=True)] = False,
) -> None:
    """The operator window (the same as no command)."""
    _open_window(rig, config, source, until_first_frame, tour=tour)


def _open_window(
    rig: str | None, config_path: Path | None, source: Path | None, until_first_frame: bool = False, *, tour: bool = False
) -> None:
    from app.window_command import run_window

    sys.exit(run_window(rig, config_path, source, until_first_frame=until_first_frame, tour=tour))


# --help lists them in this order, and the groups after them
for _command in (
    gui,
    perceive,
    synth,
    train,
    average,
    calibrate,
    annotate,
    evaluate,
    trial,
    benchmark,
    record,
    replay,
    play,
    ablation,
    screenshots,
    faults,
    soak,
    doctor,
):
    app.command()(_command)
app.add_typer(session_commands, name="session")
app.add_typer(rig_commands, name="rig")
