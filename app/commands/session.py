"""``session info``, ``describe``, ``recover`` and ``export``; ``play`` and ``library``, which open the player and the library."""

from __future__ import annotations

import json
import logging
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from pydantic import ValidationError
from rich.console import Console
from rich.table import Table

from app.commands.options import (
    ConditionOption,
    JsonOption,
    NotesOption,
    OperatorOption,
    PhantomOption,
    ProgressOption,
    SessionArgument,
    TagOption,
    TaskOption,
)
from app.commands.progress import end_like_an_interrupt, progress_bar, report_progress
from app.commands.workers import over_processes
from app.ui.display import check_qt
from app.ui.i18n import mark
from core.config.files import own_config
from core.config.models import Config, sessions_folder
from core.config.rig_file import find_rig, has_rig
from core.control.modes import Mode
from core.devices import UserError
from core.session.exporters import export_session, exporter_name, items_of
from core.session.files import is_being_written
from core.session.manifest import (
    Manifest,
    SessionError,
    changed_description,
    frames_lost,
    read_description,
    read_manifest,
    write_description,
)
from core.session.reader import SessionReader, check_is_session, losses, rows_cut_off
from core.session.rehearsed_run import beside_line, runs_beside
from core.types import Image, PoseState, Tick

session = typer.Typer(help="Recorded sessions: look at them, describe them, recover cut ones, export.", no_args_is_help=True)


@session.command()
def info(
    session: SessionArgument,
    explain: Annotated[
        bool, typer.Option("--explain", help="replay its rehearsed runs in the identified twin: which parameter is another now?")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """What a session is, what is in it, and what is wrong with it."""
    with SessionReader(session) as reader:
        reader.wait()
        result, is_cut = describe(reader), _is_cut(reader)
        if explain:
            explain_runs(reader, result["rehearsals"])
    if as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
        return
    table = Table(title=str(session), show_header=False)
    for key, value in result.items():
        if key == "rehearsals":
            text = "\n".join(map(beside_line, value)) or "none"
        elif isinstance(value, list):
            text = "\n".join(value) or "none"
        elif isinstance(value, dict):
            text = ", ".join(f"{name} {count}" for name, count in value.items()) or "none"
        else:
            text = "-" if value is None else str(value)
        table.add_row(key, text)
    Console(markup=False, emoji=False).print(table)
    if is_cut:
        sys.stderr.write(f"note: it did not end properly; repair it with: session recover {session}\n")


def explain_runs(reader: SessionReader, runs: list[dict[str, Any]]) -> None:
    """Add to each run beside its rehearsal how far its replay is off, and which parameter would explain that.

    Raises UserError: no run was rehearsed, or the robot was not identified, or the bench is not known.
    """
    from hardware.twin.identification import RUNS, JogError, bench_of_session, explained, motion_of_session

    if reader.manifest is None or not runs:
        raise UserError("no run of this session was rehearsed; rehearse the way (T) before the hand-over")
    name, config = reader.manifest.rig, Config.model_validate(reader.manifest.config)
    known = find_rig(name)[1].behaviour if has_rig(name) else config.twin.behaviour
    if known is None:
        raise UserError("its robot was not identified; record a jog, and run: rig identify SESSION --rig NAME")
    bench = bench_of_session(reader)
    motion, zero_s = motion_of_session(reader, bench), float(reader.timeline().time_s[0])
    with progress_bar() as bar:
        task = bar.add_task("runs of the twin", total=RUNS * len(runs))

        def spread(function: Any, tasks: Any) -> Iterator[Any]:
            for one in over_processes(min(2, os.cpu_count() or 1), function, tasks):
                bar.advance(task)
                yield one

        for run in runs:
            began_s = zero_s + run["began_s"]
            part = motion.between(began_s, began_s + run["seconds"])
            try:
                run["explained"] = asdict(explained(bench.phantom, part, known, config.servos, spread))
            except (JogError, FloatingPointError) as error:
                sys.stderr.write(f"note: {error}\n")


def _is_cut(reader: SessionReader) -> bool:
    """Whether it did not end properly and was not repaired."""
    return not (reader.manifest is not None and reader.manifest.closed) and not is_being_written(reader.folder)


def describe(reader: SessionReader) -> dict[str, Any]:
    """What ``session info --json`` prints."""
    manifest, line, events = reader.manifest, reader.timeline(), reader.events
    is_closed = manifest is not None and manifest.closed
    loss = manifest.recovered if manifest else None
    if loss is not None:
        ended = "recovered"
    elif manifest is not None and is_closed:
        ended = manifest.ended or "closed"
    else:
        ended = "cut" if _is_cut(reader) else "being recorded"
    return {
        "session": str(reader.folder),
        "kind": manifest.kind if manifest else None,
        "rig": manifest.rig if manifest else None,
        "program": manifest.program or None if manifest else None,
        **{key: value or None for key, value in reader.description.model_dump(exclude={"tags"}).items()},
        "tags": list(reader.description.tags),
        "started_utc": manifest.started_utc.isoformat() if manifest else None,
        "ended": ended,
        "recovered": f"{loss.seconds} s, {loss.rows} rows and {loss.pictures} pictures lost" if loss else None,
        "seconds": round(reader.duration_s, 3),
        "rows": len(reader),
        "missing_rows": reader.missing_rows + rows_cut_off(reader),
        "dropped": manifest.counts.dropped if manifest and is_closed else None,
        "camera_lost": frames_lost(events),
        "states": {state.value: int((line.state == place).sum()) for place, state in enumerate(PoseState)},
        "without_pose": int((line.state < 0).sum()),
        "theta_median_deg": round(float(np.nanmedian(np.abs(line.theta_deg))), 3) if np.isfinite(line.theta_deg).any() else None,
        "modes": {mode.value: int((line.mode == place).sum()) for place, mode in enumerate(Mode) if (line.mode == place).any()},
        "rehearsals": runs_beside(reader),
        "events": dict(Counter(event.kind.value for event in events)),
        "videos": [path.name for path in reader.videos],
        "codec": manifest.codec if manifest else None,
        "model": manifest.model.get("name") if manifest else None,
        "bytes": sum(path.stat().st_size for path in reader.folder.iterdir() if path.is_file()),
        "problems": [*reader.problems, *losses(reader, events)],
    }


@session.command("describe")
def describe_session(
    session: SessionArgument,
    operator: OperatorOption = None,
    task: TaskOption = None,
    condition: ConditionOption = None,
    phantom: PhantomOption = None,
    notes: NotesOption = None,
    tag: TagOption = None,
    untag: Annotated[list[str] | None, typer.Option(help="a tag to take away; may be repeated")] = None,
) -> None:
    """Say what a session is about: in a file beside its manifest, nothing else of it changes. " " empties a text."""
    check_is_session(session)
    try:
        manifest = read_manifest(session)
    except SessionError as error:  # damaged, as `info` says; it can be described all the same
        sys.stderr.write(f"note: {error}\n")
        manifest = None
    before = read_description(session, manifest)
    away = {name.strip().lstrip("#").casefold() for name in untag or ()}
    tags = [name for name in (*before.tags, *(tag or ())) if name.casefold() not in away]
    given = {"operator": operator, "task": task, "condition": condition, "phantom": phantom, "notes": notes, "tags": tags}
    write_description(session, changed_description(before, given))


@session.command("recover")
def recover_session(
    session: SessionArgument,
    into: Annotated[Path | None, typer.Option(help="folder in which the copy is made; default: beside the session")] = None,
    only_look: Annotated[bool, typer.Option("--only-look", help="write nothing; say what would be lost")] = False,
    as_json: JsonOption = False,
    progress_json: ProgressOption = False,
) -> None:
    """Repair a cut or damaged session into a copy; the original stays as it is."""
    from core.session.recovery import expected_loss, payload_bytes, recover

    if progress_json:
        report_progress()
        end_like_an_interrupt()
    with progress_bar() as bar:
        on_bytes = partial(bar.advance, bar.add_task("bytes read", total=payload_bytes(session)))
        done = expected_loss(session, on_bytes) if only_look else recover(session, into, on_bytes)
    if as_json:
        result = {"session": str(done.folder), "frames": done.frames, "pictures": done.pictures}
        loss = {"seconds": done.loss.seconds, "rows": done.loss.rows, "pictures": done.loss.pictures}
        sys.stdout.write(json.dumps(result | {"lost": loss, "problems": list(done.loss.problems)}) + "\n")
        return
    sys.stdout.write(f"{done.folder}\n")
    for problem in done.loss.problems:
        sys.stderr.write(f"note: {problem}\n")
    sys.stderr.write(
        f"{done.frames} rows and {done.pictures} pictures {'can be ' * only_look}recovered; lost: {done.loss.seconds:.2f} s "
        f"({done.loss.rows} rows, {done.loss.pictures} pictures)\n"
    )


@session.command()
def export(
    session: SessionArgument,
    out: Annotated[
        list[Path], typer.Option(help="x.mp4, .csv, .mcap, .ros2.mcap, .lerobot, or what a plugin writes; may be repeated")
    ],
    plain: Annotated[bool, typer.Option("--plain", help="MP4 without overlays")] = False,
    rows: Annotated[str | None, typer.Option(metavar="FIRST-LAST", help="MP4 of these rows alone")] = None,
    as_json: JsonOption = False,
    progress_json: ProgressOption = False,
) -> None:
    """A session as video, table, MCAP for Foxglove and PlotJuggler or for ROS 2 (.ros2.mcap), or episode of a LeRobotDataset."""
    names = {str(path): exporter_name(path) for path in out}
    if rows is not None and (set(names.values()) != {"mp4"} or plain):
        raise UserError("--rows is for an MP4 with overlays")
    if not plain and "mp4" in names.values():
        check_qt("export it with --plain")
    if progress_json:
        report_progress()
        end_like_an_interrupt()
    written: dict[str, int] = {}
    with SessionReader(session) as reader:
        reader.wait()
        with progress_bar() as bar:
            first, last = _places(reader, rows) if rows is not None else (0, len(reader))
            for path in out:
                on_row = partial(bar.advance, bar.add_task("rows" if progress_json else path.name, total=last - first))
                written[str(path)] = _export(reader, path, plain, on_row, (first, last))
        lost = losses(reader, reader.events)  # reading the events adds to the problems
        problems = [*reader.problems, *lost]
        if _is_cut(reader):
            problems.append(f"it did not end properly: session recover {session} saves what can be had")
        elif is_being_written(session):
            problems.append(mark("it is still being recorded: what came later is not in what was written"))
    if as_json:
        sys.stdout.write(json.dumps({"written": written, "problems": problems}) + "\n")
        return
    for problem in problems:
        sys.stderr.write(f"note: {problem}\n")
    if progress_json:
        return
    for name, count in written.items():
        sys.stdout.write(f"{name}: {count} {items_of(names[name])}\n")


def _export(reader: SessionReader, out: Path, plain: bool, on_row: Callable[[], None], places: tuple[int, int]) -> int:
    if plain or exporter_name(out) != "mp4":
        return export_session(reader, out, on_row)
    from app.widgets.overlay_image import draw_overlay
    from core.session.export import export_mp4

    # The banner of an exported video says that a simulation is no real run.
    stamp = f"{reader.manifest.kind if reader.manifest else 'UNKNOWN'} PLAYBACK"

    def draw(tick: Tick) -> Image:
        return draw_overlay(tick.frame.image, tick.scene, tick.advice, stamp=stamp)

    return export_mp4(reader, out, draw, first=places[0], last=places[1], on_row=on_row)


def _places(reader: SessionReader, rows: str) -> tuple[int, int]:
    """Of the rows from FIRST to LAST, which is included; raises UserError without any."""
    first, _, last = rows.partition("-")
    if not (first.isdecimal() and last.isdecimal()):
        raise UserError(f"--rows {rows}: must be the first and the last row, such as 12-40")
    known = reader.timeline().row
    low, high = int(np.searchsorted(known, int(first))), int(np.searchsorted(known, int(last), side="right"))
    if low >= high:
        raise UserError(f"--rows {rows}: the session has none of them")
    return low, high


def play(
    session: SessionArgument,
    against: Annotated[Path | None, typer.Option(help="results of replay --jsonl, shown beside the recording")] = None,
) -> None:
    """The player: a recorded session with everything that was understood, frame by frame."""
    from app.ui.display import check_display

    check_display()
    from app.ui.window_base import make_application, run_until_closed
    from core.perception import compiled

    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    if against is not None and not against.is_file():
        raise UserError(f"{against}: no such file; write one with: replay SESSION --jsonl FILE")
    with SessionReader(session) as reader:
        config = recorded_config(reader.manifest)
        compiled.load()  # drawing uses them, and may not wait
        application = make_application(own_config().window)

        from app.player.window import PlayerWindow
        from app.ui.layout_state import LayoutState
        from app.ui.opening import note_recent
        from app.widgets.scene_panels import overlay_actions

        window = PlayerWindow(reader, config, against)
        panels = window.panels
        switches = overlay_actions(window)
        if against is not None:
            del switches["loupe"]  # two pictures leave no room for it
        LayoutState(window, "player", panels.columns, panels.pages, switches)
        note_recent(session)
        code = run_until_closed(application, window, window.show_message)
    sys.exit(code)


def library(
    folder: Annotated[Path | None, typer.Argument(help="where the sessions are; default: the configured folder")] = None,
) -> None:
    """The library: all sessions of a folder, searched, described, tagged, and opened from there."""
    if folder is not None and not folder.is_dir():
        raise UserError(f"{folder}: no such folder; give one that holds sessions")
    from app.ui.display import check_display

    check_display()
    from app.ui.window_base import make_application, run_until_closed

    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    own = own_config()
    application = make_application(own.window)

    from app.library.model import LibraryModel
    from app.library.window import LibraryWindow
    from app.ui.layout_state import LayoutState

    window = LibraryWindow(LibraryModel((folder or sessions_folder(own.record.folder)).absolute()))
    LayoutState(window, "library", window.panels.columns)
    sys.exit(run_until_closed(application, window, window.show_message))


def recorded_config(manifest: Manifest | None) -> Config:
    """The user's own configuration, with the limits and the scale of the recording where its manifest has them."""
    own = own_config()
    recorded = manifest.config if manifest is not None else {}
    try:
        parts = Config.model_validate({key: recorded[key] for key in ("perception", "policy") if key in recorded})
    except ValidationError:  # of another version; its limits are only lines on the dials
        return own
    return own.model_copy(update={"perception": parts.perception, "policy": parts.policy})
