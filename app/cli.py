"""The command line (a contract: scripts and studies rely on it). Errors are one clear line and exit code 2.

A command is a function with the command's name in ``app/commands``; its module is imported when the command is called, or its help
is asked for.
"""

from __future__ import annotations

import errno
import faulthandler
import importlib
import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, NoReturn, TextIO

import typer
from typer.core import TyperCommand, TyperGroup

from app.commands.options import BenchOption, ConfigOption, LslOption, RigOption, SourceOption, StreamOption, bare_stream
from core.devices import UserError
from core.program import CALLED, as_called, import_problem, is_installed, program_line
from core.system import keep_freed_memory, limit_heaps, limit_pictures

COMMANDS = {
    "gui": ("app.cli", "The operator window (the same as no command)."),
    "perceive": ("app.commands.perceive", "Vessel, robot, angle, distances and pose state of pictures or a video."),
    "synth": ("app.commands.synth", "Randomised labelled frames from the bench twin: images, masks, truth."),
    "train": ("app.commands.train", "Train or fine-tune the network; Ctrl-C keeps what was learnt."),
    "teach": (
        "app.commands.teach",
        "Teach a bench in minutes: from a picture of the empty bench, one outline of the vessel, and the moving robot.",
    ),
    "calibrate": (
        "app.commands.calibrate",
        "Teach a model what its confidence means: the share of right answers among those that it is so sure of.",
    ),
    "annotate": (
        "app.commands.annotate",
        "Measure angles and states by hand, draw masks; as a study with several raters, blind and repeated.",
    ),
    "evaluate": (
        "app.commands.evaluate",
        "The algorithm against manual measures, with the statistics of the paper beside its own figures.",
    ),
    "phantom": (
        "app.commands.phantom",
        "Your own bench as a phantom of the twin: from its vessel, an outline, a drawing, or centerlines.",
    ),
    "rehearse": (
        "app.commands.rehearse",
        "Rehearse the way to a target of your own bench in the twin, before the real robot moves.",
    ),
    "trial": (
        "app.commands.trial",
        "Closed-loop trials in the bench twin: a policy drives the robot to a target that it has never seen.",
    ),
    "benchmark": (
        "app.commands.benchmark",
        "Latency per stage, throughput, memory and start-up, against the paper-literal baseline in the same run; or accuracy.",
    ),
    "record": ("app.commands.record", "Record a session without a window."),
    "replay": (
        "app.commands.replay",
        "Perceive recorded sessions again and compare; without --config or --preset in the recorded configuration.",
    ),
    "trigger": ("app.commands.trigger", "Trigger the open window: record, mark, note, snapshot, target, status. Nothing moves."),
    "play": (
        "app.commands.session",
        "The player: a recorded session with everything that was understood, frame by frame.",
    ),
    "library": (
        "app.commands.session",
        "The library: all sessions of a folder, searched, described, tagged, and opened from there.",
    ),
    "doctor": (
        "app.commands.doctor",
        "Preflight: program, model, camera, servos, controls, disk, clock; what is wrong, and what to do. Nothing moves.",
    ),
    "desktop": ("app.commands.desktop", "Put the program into the menu of your desktop, or take it out again."),
    "session": ("app.commands.session", "Recorded sessions: look at them, recover cut ones, export."),
    "rig": ("app.commands.rig", "Rigs: camera, servos and calibration of a bench, in one file."),
}
"""Name -> the module with the function (or Typer group) of this name, and the line of ``main.py --help``, in its order."""
MOVED = {
    "average": "average is gone: models are trained on with train --init",
    "ablation": "ablation is a development tool now: .venv/bin/python -m tools.ablation",
    "faults": "faults is a development tool now: .venv/bin/python -m tools.fault_campaign",
    "screenshots": "screenshots is a development tool now: .venv/bin/python -m tools.screenshots",
    "soak": "soak is a development tool now: .venv/bin/python -m tools.soak",
}
"""Former commands, and what is said to those who call them."""
_INTERRUPTED = 130
_TYPER_OPTIONS: Any = {"pretty_exceptions_enable": False, "rich_markup_mode": None}


class LazyGroup(TyperGroup):
    """The commands of ``COMMANDS``: each is a stub with its line of help until it is called."""

    def __init__(self, **options: Any) -> None:
        stubs = {name: TyperCommand(name, help=line) for name, (_, line) in COMMANDS.items()}
        super().__init__(**{**options, "commands": stubs})

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and args[0] in MOVED:
            raise UserError(MOVED[args[0]])
        name, _, rest = super().resolve_command(ctx, args)
        return name, load_command(str(name)), rest


def load_command(name: str) -> Any:
    """The command of this name, or the group, with its options."""
    found = getattr(importlib.import_module(COMMANDS[name][0]), name)
    parent = typer.Typer(add_completion=False, **_TYPER_OPTIONS)
    if isinstance(found, typer.Typer):
        parent.add_typer(found, name=name)
        return typer.main.get_group(parent).commands[name]
    parent.command(name)(found)
    return typer.main.get_command(parent)


app = typer.Typer(
    cls=LazyGroup,
    name="lumenpilot",
    help="Teleoperation assist for a tendon-driven interventional robot: perception, pose state, advice, and a bench twin.",
    no_args_is_help=False,
    add_completion=is_installed(),  # in a checkout there is no command whose arguments a shell could complete
    **_TYPER_OPTIONS,
)


def _print_version(is_asked: bool) -> None:
    if is_asked:
        print(f"lumenpilot {program_line()}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _window(
    context: typer.Context,
    rig: RigOption = None,
    config: ConfigOption = None,
    source: SourceOption = None,
    stream: StreamOption = None,
    lsl: LslOption = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="version and commit of this program")
    ] = False,
) -> None:
    """Without a command: the operator window."""
    if context.invoked_subcommand is None:
        _open_window(rig, config, source, stream=stream, lsl=lsl)
    options = {"--rig": rig, "--config": config, "--source": source, "--stream": stream, "--lsl": lsl or None}
    given = [name for name, value in options.items() if value is not None]
    if given:
        command = context.invoked_subcommand
        raise UserError(f"{given[0]} before {command} is for the window alone; write it behind, where {command} takes it")


def gui(
    rig: RigOption = None,
    config: ConfigOption = None,
    source: SourceOption = None,
    stream: StreamOption = None,
    lsl: LslOption = False,
    bench: BenchOption = None,
    tour: Annotated[bool, typer.Option("--tour", help="show the tour, as at the first start")] = False,
    until_first_frame: Annotated[bool, typer.Option("--until-first-frame", hidden=True)] = False,
) -> None:
    """The operator window (the same as no command)."""
    _open_window(rig, config, source, stream=stream, lsl=lsl, until_first_frame=until_first_frame, tour=tour, bench=bench)


def _open_window(rig: str | None, config_path: Path | None, source: Path | None, **options: Any) -> NoReturn:
    from app.operator.startup import run_window

    sys.exit(run_window(rig, config_path, source, **options))


def main() -> None:
    """Run the command line. Known errors end as one line on standard error and exit code 2; Ctrl-C as exit code 130."""
    with suppress(OSError, RuntimeError, ValueError):  # there is not always a standard error
        faulthandler.enable()
    limit_heaps()
    keep_freed_memory()
    limit_pictures()
    if sys.stdout is None:  # started with a closed one
        sys.stdout = open(os.devnull, "w")
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")  # a file's name need not be text that this terminal has
    try:
        try:
            _refuse_empty(sys.argv[1:])
            code = app(args=bare_stream(sys.argv[1:]), prog_name=CALLED, standalone_mode=False)
        finally:
            _flush_output()
    except UserError as error:
        _print_error(as_called(f"error: {error}"))
        sys.exit(2)
    except ImportError as error:
        if (line := import_problem(error)) is None:
            raise
        _print_error(f"error: {line}")
        sys.exit(2)
    except typer.TyperException as error:  # a command line that makes no sense
        message = error.format_message()
        if message.startswith("Usage:"):  # a group by itself: its help is the answer
            _print_error(message)
            sys.exit(2)
        context = getattr(error, "ctx", None)
        message = " ".join(message.split()).rstrip(".")
        _print_error(f"error: {message}; see {context.command_path + ' ' if context is not None else ''}--help")
        sys.exit(2)
    except OSError as error:
        if error.errno == errno.ENOSPC:
            _print_error(f"error: {error.filename or 'output'}: the disk is full; make room, or write to another one")
        elif error.filename is not None and error.strerror:
            _print_error(f"error: {error.filename}: {error.strerror}")
        else:
            raise
        sys.exit(2)
    except (KeyboardInterrupt, typer.Abort):
        code = _INTERRUPTED
    if code == _INTERRUPTED:  # Typer returns it instead of raising
        _print_error("interrupted")
    if isinstance(code, int) and code:
        sys.exit(code)


def _refuse_empty(words: Sequence[str]) -> None:
    """Raise UserError for an empty text: as a path it would mean this folder, as a name nothing.

    An empty ``--study`` stands for what was measured outside studies.
    """
    for before, word in zip(["", *words], words, strict=False):
        option, has_value, value = word.partition("=") if word.startswith("--") else (before, word == "", word)
        if has_value and not value and option != "--study":
            what = option if option.startswith("-") and option.strip("-") else "an argument"
            raise UserError(f"{what} is empty: give it a value, or leave it out (is a variable of a script not set?)")


def _print_error(line: str) -> None:
    """On standard error; where that cannot be written, the exit code alone remains."""
    try:
        sys.stderr.write(line + "\n")
        sys.stderr.flush()
    except OSError:
        _discard(sys.stderr)


def _discard(stream: TextIO) -> None:
    """Send buffered output nowhere: the interpreter would try again at its end, and change the exit code."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _flush_output() -> None:
    """Write what standard output still holds, while an error of it can still be reported."""
    try:
        sys.stdout.flush()
    except OSError as error:
        _discard(sys.stdout)
        if error.errno != errno.EPIPE:
            raise
