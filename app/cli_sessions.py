"""Commands on recorded sessions: record, replay, play, session."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from app.cli_options import (
    ConfigOption,
    JsonOption,
    PresetOption,
    ProgressOption,
    RigOption,
    SchedulerOption,
    SessionArgument,
    tell_asked_progress,
)


def record(
    seconds: Annotated[float, typer.Option(min=0.1, max=86_400.0, help="length of the recording; Ctrl-C ends it sooner")],
    out: Annotated[Path | None, typer.Option(help="folder in which the session is made; default: the configured one")] = None,
    rig: RigOption = None,
    lossless: Annotated[bool, typer.Option("--lossless", help="keep every pixel as it is; a hundred times the size")] = False,
    json: JsonOption = False,
    config: ConfigOption = None,
) -> None:
    """Record a session without a window."""
    from app.record_command import run_record

    run_record(seconds, out, rig=rig, config_path=config, lossless=lossless, as_json=json)


def replay(
    sessions: Annotated[
        list[Path], typer.Argument(metavar="SESSION", help="folders of recorded sessions, or folders with sessions in them")
    ],
    model: Annotated[str | None, typer.Option(help="model name or folder; default: the recorded configuration's")] = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
    jsonl: Annotated[Path | None, typer.Option(help="the new results, one JSON object per frame, as perceive writes them")] = None,
    diff: Annotated[bool, typer.Option("--diff", help="also the frames that changed most")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="folder for replay.json, changes.jsonl and the figure as SVG and PDF; of several sessions a folder each"),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes, which share the sessions")] = 1,
    scheduler: SchedulerOption = None,
    json: Annotated[
        bool, typer.Option("--json", help="one JSON object on standard output, nothing else there; of several sessions a line each")
    ] = False,
) -> None:
    """Perceive recorded sessions again and compare; without --config or --preset in the recorded configuration."""
    from app.replay_campaign import run_replays, sessions_in
    from app.replay_command import run_replay
    from app.replay_session import ReplayOptions

    found = sessions_in(sessions)
    options = ReplayOptions(found[0], model, preset, config, jsonl, diff)
    if found == sessions and len(found) == 1 and scheduler is None:
        run_replay(options, out, as_json=json)
    else:
        run_replays(found, options, out, workers=workers, scheduler=scheduler, as_json=json)


def play(
    session: SessionArgument,
    against: Annotated[Path | None, typer.Option(help="results of replay --jsonl, shown beside the recording")] = None,
) -> None:
    """The player: a recorded session with everything that was understood, frame by frame."""
    from app.play_command import run_play

    sys.exit(run_play(session, against))


session_commands = typer.Typer(help="Recorded sessions: look at them, recover cut ones, export.", no_args_is_help=True)


@session_commands.command("info")
def session_info(session: SessionArgument, json: JsonOption = False) -> None:
    """What a session is, what is in it, and what is wrong with it."""
    from app.session_command import run_info

    run_info(session, as_json=json)


@session_commands.command("recover")
def session_recover(
    session: SessionArgument,
    into: Annotated[Path | None, typer.Option(help="folder in which the copy is made; default: beside the session")] = None,
    only_look: Annotated[bool, typer.Option("--only-look", help="write nothing; say what would be lost")] = False,
    json: JsonOption = False,
    progress_json: ProgressOption = False,
) -> None:
    """Repair a cut or damaged session into a copy; the original stays as it is."""
    from app.session_command import run_recover

    tell_asked_progress(progress_json)
    run_recover(session, into, as_json=json, only_look=only_look)


@session_commands.command("export")
def session_export(
    session: SessionArgument,
    out: Annotated[list[Path], typer.Option(help="file.mp4, file.csv or file.mcap; may be repeated")],
    plain: Annotated[bool, typer.Option("--plain", help="MP4 without overlays")] = False,
    json: JsonOption = False,
) -> None:
    """A session as video, table, or MCAP for Foxglove and PlotJuggler."""
    from app.session_command import run_export

    run_export(session, out, plain=plain, as_json=json)
