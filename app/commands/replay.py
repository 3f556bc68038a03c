"""``replay``: perceive recorded sessions again, with another model or configuration, and show what changed."""

from __future__ import annotations

import json
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from pydantic import ValidationError
from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.commands.options import ConfigOption, PresetOption, SchedulerOption
from app.commands.progress import Interrupt, LineOutput, check_apart, check_no_input, check_no_session, make_folder, progress_bar
from app.commands.workers import over_cluster, over_processes
from app.ui.texts import signed_degrees
from core.config.models import Config, choose_model, load_config, merge
from core.devices import UserError
from core.evaluation.replay import STATES, Change, FrameResult, RecordedTargets, ReplayTally, changed_most, frame_result, runs
from core.files import name_as_text, name_of
from core.perception.model_file import check_model, model_folder, read_model_info
from core.session.codec import scene_to_json, unread_to_json
from core.session.manifest import FRAMES, MANIFEST, Manifest, SessionError
from core.session.reader import SessionReader, check_is_session
from core.types import Frame, Scene

if TYPE_CHECKING:
    from core.perception.pipeline import Pipeline


MOST_SHOWN = 20
"""Frames that changed most, and runs of lost and gained poses, that are shown."""
_WRITTEN = ("replay.json", "changes.jsonl")
"""Files of ``--out``."""
_DASH = "\N{EN DASH}"

Watch = Callable[[int], AbstractContextManager[Callable[[], bool]]]
"""A context around so many frames of a session; its value is asked before each frame whether to go on."""


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """How to perceive a session again; None: not given. ``threads``: of the network; None: as configured."""

    session: Path
    model: str | None = None
    preset: str | None = None
    config_path: Path | None = None
    jsonl: Path | None = None
    diff: bool = False
    threads: int | None = None

    @property
    def overrides(self) -> dict[str, Any]:
        """Settings that override a configuration's."""
        overrides = choose_model(self.model)
        if self.threads is not None:
            overrides.setdefault("perception", {}).setdefault("segmentation", {})["threads"] = self.threads
        return overrides


@dataclass(slots=True)
class SessionReplay:
    """The frames of a session before and after; ``result`` is the object of ``--json``. ``problem``: why there are no frames."""

    session: Path
    changes: list[Change] = field(default_factory=list)
    result: dict[str, Any] = field(default_factory=dict)
    no_row: int = 0
    no_picture: int = 0
    ended: str = "all frames"
    interrupted: bool = False
    problem: str = ""


@contextmanager
def unwatched(_count: int) -> Iterator[Callable[[], bool]]:
    """A ``Watch`` that lets all frames pass."""
    yield lambda: True


def replay_session(options: ReplayOptions, watch: Watch = unwatched) -> SessionReplay:
    """Perceive it; raises SessionError, ConfigError, ModelError, and KeyboardInterrupt when it ends before the first frame."""
    with SessionReader(options.session) as reader:
        config, notes = replay_config(reader.manifest, options)
        pipeline = _pipeline_for(config)
        after = model_of(config) | {"engine": pipeline.engine}
        notes += model_note(reader.manifest, config, after)
        reader.wait()
        with LineOutput(options.jsonl) if options.jsonl is not None else nullcontext() as lines:
            done = replay_frames(reader, pipeline, lines, watch)
        problems = list(reader.problems)
        before = dict(reader.manifest.model) if reader.manifest is not None else {}
    if not done.changes:
        if done.interrupted:
            raise KeyboardInterrupt
        first = f"; the first: {problems[0]}" if problems else ""
        raise SessionError(f"{options.session}: no frame that could be perceived again{first}")
    done.result = {
        "session": name_as_text(options.session),
        "ended": done.ended,
        "before": {"name": before.get("name"), "sha256": before.get("sha256")},
        "after": after | {"preset": options.preset, "config": name_as_text(options.config_path) if options.config_path else None},
        **ReplayTally.of(done.changes).to_json(),
        "without_picture": done.no_picture,
        "without_row": done.no_row,
        "notes": notes,
        "problems": problems,
    }
    if options.diff:
        done.result["changed_most"] = [change_to_json(change) for change in changed_most(done.changes, MOST_SHOWN)]
    return done


class _LastPipeline(threading.local):
    """The last pipeline of this thread: loading the network takes over a second, and sessions are recorded alike."""

    key = ""
    pipeline: Pipeline | None = None


_last = _LastPipeline()


def _pipeline_for(config: Config) -> Pipeline:
    from core.perception.pipeline import open_pipeline

    key = config.perception.model_dump_json()
    if _last.pipeline is None or _last.key != key:
        _last.pipeline, _last.key = open_pipeline(config.perception), key
    return _last.pipeline


def replay_config(manifest: Manifest | None, options: ReplayOptions) -> tuple[Config, list[str]]:
    """The configuration to perceive with, and notes on it: the given one; without any, that of the recording.

    `--model` wins over both. Raises ConfigError.
    """
    overrides = options.overrides
    recorded = manifest.config.get("perception") if manifest is not None else None
    if options.config_path is not None or options.preset is not None:
        return load_config(options.config_path, options.preset, overrides), []
    if not isinstance(recorded, dict):
        return load_config(overrides=overrides), ["the recorded configuration is lost; the default one is taken"]
    try:
        config = Config.model_validate(merge({"perception": recorded}, overrides))
    except ValidationError as error:
        key = ".".join(str(part) for part in error.errors()[0]["loc"])
        note = f"the recorded configuration is not one of this version ({key}); the default one is taken"
        return load_config(overrides=overrides), [note]
    return config, []


def model_of(config: Config) -> dict[str, Any]:
    """Name and digests of the configured model."""
    name = config.perception.segmentation.model
    info = read_model_info(model_folder(name), verify=())
    return {"name": name, "sha256": info.weights_sha256, "second_look_sha256": info.second_look_sha256}


def model_note(manifest: Manifest | None, config: Config, after: dict[str, Any]) -> list[str]:
    """Notes on the figures: the same name may be another model, and the same model never gets the same pixels."""
    if manifest is None:
        return []
    before = manifest.model
    # Older recordings do not name the tip refinement.
    same_near = "second_look_sha256" not in before or before["second_look_sha256"] == after["second_look_sha256"]
    same_weights = before.get("sha256") == after["sha256"] and same_near
    if before.get("name") == after["name"] and not same_weights:
        return [f"model {after['name']} is not the one that was recorded with: its weights differ"]
    same_config = manifest.config.get("perception") == config.perception.model_dump(mode="json")
    if same_weights and same_config:
        lossy = "" if manifest.codec == "lossless" else "the video's lossy coding, "
        return [f"same model, same configuration: what differs comes from {lossy}the program and the stream's beginning"]
    return []


def replay_frames(
    reader: SessionReader, pipeline: Pipeline, lines: LineOutput | None = None, watch: Watch = unwatched
) -> SessionReplay:
    """Perceive all frames with the recorded targets, as a stream where they were one, until `watch` ends it."""
    done = SessionReplay(reader.folder)
    targets = RecordedTargets(reader.events)
    first_s: float | None = None
    rig = reader.manifest.config.get("rig") if reader.manifest is not None else None
    is_stream = not (isinstance(rig, dict) and rig.get("camera") == "image_folder")
    perceive = pipeline if is_stream else pipeline.perceive_single
    # The first picture waits for the network's first run, which would spoil the latency.
    pipeline.warm_up()
    if len(reader) and (frame := reader.frame(0)) is not None:
        perceive(frame)
    pipeline.reset()
    with watch(len(reader)) as may_go_on:
        for place in range(len(reader)):
            if not may_go_on():
                done.interrupted, done.ended = True, f"interrupted after {place} of {len(reader)} frames"
                break
            row = reader.row(place)
            if row is None:
                done.no_row += 1
                continue
            first_s = row.captured_s if first_s is None else first_s
            target = targets.of(row)
            frame = reader.frame(place)
            name = f"{name_of(reader.folder)}#{row.row}"
            if frame is None:
                done.no_picture += 1
                record = unread_to_json(name, "the picture is lost")
            else:
                scene: Scene = perceive(Frame(row.index, row.captured_s, frame.image), target)
                done.changes.append(
                    Change(row.row, row.index, row.captured_s - first_s, frame_result(row.scene), frame_result(scene))
                )
                record = scene_to_json(name, scene)
            if lines is not None:
                placed = {"frame": row.index, "captured_s": round(row.captured_s, 6), "time_s": round(row.captured_s - first_s, 6)}
                lines.write(json.dumps(record | placed, allow_nan=False))
    return done


def change_to_json(change: Change) -> dict[str, Any]:
    """One frame before and after, as plain JSON values."""
    both = {"before": change.before, "after": change.after}
    return {
        "row": change.row,
        "frame": change.index,
        "time_s": round(change.time_s, 6),
        "change": change.kind,
        "theta_change_deg": _rounded(change.theta_deg),
        "head_shift_px": _rounded(change.head_px),
    } | {
        name: {
            "theta_signed_deg": _rounded(side.theta_signed_deg),
            "head_xy": [round(value, 3) for value in side.head] if side.head is not None else None,
            "state": side.state.value if side.state else None,
            "confidence": _rounded(side.confidence),
            "reason": side.reason.value if side.reason else None,
            "total_ms": _rounded(side.total_ms),
        }
        for name, side in both.items()
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 4)


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
        typer.Option(help="folder for replay.json and changes.jsonl; of several sessions a folder each"),
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=256, help="processes, which share the sessions")] = 1,
    scheduler: SchedulerOption = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="one JSON object on standard output, nothing else there; of several sessions a line each")
    ] = False,
) -> None:
    """Perceive recorded sessions again and compare; without --config or --preset in the recorded configuration."""
    found = sessions_in(sessions)
    options = ReplayOptions(found[0], model, preset, config, jsonl, diff)
    if found == sessions and len(found) == 1 and scheduler is None:
        run_replay(options, out, as_json=as_json)
    else:
        run_replays(found, options, out, workers=workers, scheduler=scheduler, as_json=as_json)


def run_replay(options: ReplayOptions, out: Path | None = None, *, as_json: bool = False) -> None:
    """Replay one session and print the results; raises UserError, and KeyboardInterrupt at the end."""
    check_is_session(options.session)
    if out is not None:
        prepare_out(out)
    if options.jsonl is not None:
        own = [options.config_path] if options.config_path is not None else []
        check_no_input(options.jsonl, [*options.session.iterdir(), *own], "--jsonl")
        if out is not None:
            check_apart(options.jsonl, [out / name for name in _WRITTEN], "--jsonl", "--out")
    done = replay_session(options, _watched)
    if out is not None:
        write_replay(out, done.changes, done.result)
    result = done.result
    if as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
    else:
        print_replay(result, done.changes, with_diff=options.diff)
        changed = changed_most(done.changes, MOST_SHOWN) if options.diff else []
        if changed:
            rows = ",".join(str(row) for row in sorted(change.row for change in changed))
            sys.stderr.write(f"draw them by hand: annotate {name_as_text(options.session)} --rows {rows}\n")
    for note in result["notes"]:
        sys.stderr.write(f"note: {note}\n")
    if result["without_picture"] or result["without_row"]:
        sys.stderr.write(f"note: {result['without_picture']} pictures and {result['without_row']} rows are lost\n")
    if out is not None:
        sys.stderr.write(f"figures and frames are in {out}\n")
    if done.interrupted:
        raise KeyboardInterrupt


@contextmanager
def _watched(count: int) -> Iterator[Callable[[], bool]]:
    """A ``Watch`` with a bar, which Ctrl-C ends."""
    with Interrupt() as interrupt, progress_bar() as bar:
        task = bar.add_task("frames", total=count)

        def may_go_on() -> bool:
            if not interrupt.asked:
                bar.advance(task)
            return not interrupt.asked

        yield may_go_on


def prepare_out(out: Path) -> None:
    """Make the folder; raises UserError where it is a session, or cannot be written."""
    if (out / "replay.json").is_file() and not (out / MANIFEST).exists():
        (out / FRAMES).unlink(missing_ok=True)  # what earlier versions wrote there made the folder look like a session
    check_no_session(out, "--out")
    make_folder(out)


def write_replay(out: Path, changes: Sequence[Change], result: dict[str, Any]) -> None:
    """A session's files in the folder; raises UserError."""
    try:
        for ending in ("svg", "pdf"):  # an earlier version's figure, of another replay
            (out / f"replay.{ending}").unlink(missing_ok=True)
        (out / "replay.json").write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        with (out / "changes.jsonl").open("w", encoding="utf-8") as file:
            file.writelines(json.dumps(change_to_json(change), allow_nan=False) + "\n" for change in changes)
    except OSError as error:
        raise UserError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from None


@dataclass(slots=True)
class _Sums:
    """Results of the sessions so far; of their frames only those that changed most. ``broken``: the error that ended it."""

    results: dict[Path, dict[str, Any]] = field(default_factory=dict)
    problems: dict[Path, str] = field(default_factory=dict)
    tally: ReplayTally = field(default_factory=lambda: ReplayTally.of([]))
    worst: list[tuple[str, Change]] = field(default_factory=list)
    interrupted: bool = False
    broken: UserError | None = None

    def add(self, done: SessionReplay) -> None:
        """Add a session, or its problem."""
        if done.problem:
            self.problems[done.session] = done.problem
            return
        self.results[done.session] = done.result
        self.interrupted = self.interrupted or done.interrupted
        self.tally += ReplayTally.of(done.changes)
        name = name_as_text(name_of(done.session))
        found = [*self.worst, *((name, change) for change in changed_most(done.changes, MOST_SHOWN))]
        self.worst = sorted(found, key=lambda one: -one[1].size_deg)[:MOST_SHOWN]


def sessions_in(paths: Sequence[Path]) -> list[Path]:
    """Each path that is a session, and the sessions in each that is a folder of them, by name; raises SessionError."""
    found: dict[Path, Path] = {}
    for path in paths:
        try:
            check_is_session(path)
        except SessionError as error:
            inside = sorted(filter(_is_session, path.iterdir())) if path.is_dir() else []
            if not inside:
                raise SessionError(f"{error}, nor any session" if path.is_dir() else str(error)) from None
        else:
            inside = [path]
        for session in inside:
            found.setdefault(session.resolve(), session)
    return list(found.values())


def _is_session(path: Path) -> bool:
    try:
        check_is_session(path)
    except SessionError:
        return False
    return True


def run_replays(
    sessions: Sequence[Path], options: ReplayOptions, out: Path | None, *, workers: int, scheduler: str | None, as_json: bool
) -> None:
    """Replay all sessions with the other options and print the results; raises UserError, and KeyboardInterrupt at the end."""
    if options.jsonl is not None:
        raise UserError("--jsonl is for one session: give --out, which takes the frames of each")
    if options.model is not None or options.config_path is not None or options.preset is not None:
        check_model(load_config(options.config_path, options.preset, options.overrides).perception.segmentation.model)
    if out is not None:
        name, count = Counter(map(name_of, sessions)).most_common(1)[0]
        if count > 1:
            name = name_as_text(name)
            raise UserError(f"{count} sessions are called {name}, and --out has one folder for each name: replay them one by one")
        for folder in (*(out / name_of(session) for session in sessions), out):
            prepare_out(folder)
    if workers > 1 or scheduler is not None:  # one thread each: workers must not fight for the cores
        options = replace(options, threads=1)
    sums = _Sums()
    _run(sums, [session.absolute() for session in sessions], options, out, workers, scheduler)
    if sums.results:
        _print_campaign(sums, len(sessions), out, with_diff=options.diff, as_json=as_json)
    if sums.broken is not None:
        raise sums.broken
    if sums.interrupted:
        raise KeyboardInterrupt
    if not sums.results:
        first = next(iter(sums.problems.values()))
        raise SessionError(f"none of {len(sessions)} sessions could be perceived again; the first: {first}")


def _run(sums: _Sums, sessions: list[Path], options: ReplayOptions, out: Path | None, workers: int, scheduler: str | None) -> None:
    with progress_bar() as bar, ExitStack() as stack:
        task = bar.add_task("sessions", total=len(sessions))
        if scheduler is None and workers <= 1:
            interrupt = stack.enter_context(Interrupt())
            frames = bar.add_task("frames", total=None)

            @contextmanager
            def watch(count: int) -> Iterator[Callable[[], bool]]:
                bar.reset(frames, total=count)

                def may_go_on() -> bool:
                    bar.advance(frames, 0 if interrupt.asked else 1)
                    return not interrupt.asked

                yield may_go_on

            replays: Iterator[SessionReplay] = (replay_one(options, session, watch) for session in sessions)
        elif scheduler is not None:
            replays = over_cluster(scheduler, partial(replay_one, options), sessions)
        else:
            replays = over_processes(min(workers, len(sessions)), partial(replay_one, options), sessions)
        try:
            for done in replays:
                if not done.problem and out is not None:
                    name = name_of(done.session)
                    write_replay(out / name, done.changes, done.result)
                sums.add(done)
                bar.advance(task)
                if sums.interrupted:
                    return
        except KeyboardInterrupt:
            sums.interrupted = True
        except UserError as error:
            sums.broken = error


def replay_one(options: ReplayOptions, session: Path, watch: Watch = unwatched) -> SessionReplay:
    """One session, in this thread; its problem where it cannot be perceived again."""
    try:
        return replay_session(replace(options, session=session), watch)
    except UserError as error:
        return SessionReplay(session, problem=str(error))


def _print_campaign(sums: _Sums, count: int, out: Path | None, *, with_diff: bool, as_json: bool) -> None:
    results = [sums.results[session] for session in sorted(sums.results)]
    done = len(sums.results) + len(sums.problems)
    total: dict[str, Any] = {
        "sessions": len(results),
        "ended": "all sessions" if done == count and not sums.interrupted else f"ended after {done} of {count} sessions",
        **sums.tally.to_json(),
        "problems": list(sums.problems.values()),
    }
    if with_diff:
        total["changed_most"] = [{"session": name} | change_to_json(change) for name, change in sums.worst]
    if out is not None:
        try:
            text = json.dumps({"all": total, "each": results}, indent=1, allow_nan=False)
            (out / "replays.json").write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            raise UserError(f"{out / 'replays.json'}: cannot be written ({error.strerror or error})") from None
    if as_json:
        sys.stdout.writelines(json.dumps(line, allow_nan=False) + "\n" for line in [*results, total])
    else:
        print_replays(results, total, sums.worst if with_diff else None)
    notes = Counter(note for result in results for note in result["notes"])
    for note, often in notes.items():
        sys.stderr.write(f"note: {note} ({often} of {len(results)} sessions)\n")
    for problem in sums.problems.values():
        sys.stderr.write(f"{problem}\n")
    if out is not None:
        sys.stderr.write(f"figures and frames of each are in {out}\n")


def print_replay(result: dict[str, Any], changes: Sequence[Change], *, with_diff: bool) -> None:
    console = Console(markup=False, emoji=False)
    console.print(_sums(result), _states(result["states"]["matrix"]), sep="\n")
    if not with_diff:
        return
    console.print(_frames(changed_most(changes, MOST_SHOWN), MOST_SHOWN))
    found = runs(changes)
    for run in found[:MOST_SHOWN]:
        rows = f"row {run.first}" if run.frames == 1 else f"rows {run.first} to {run.last}"
        console.print(f"{run.kind} at {rows}: {run.reason}", soft_wrap=True)
    if len(found) > MOST_SHOWN:
        console.print(f"and {len(found) - MOST_SHOWN} more places where a pose was lost or gained", soft_wrap=True)


def print_replays(results: Sequence[dict[str, Any]], total: dict[str, Any], worst: Sequence[tuple[str, Change]] | None) -> None:
    """Tables of many sessions and their sum on standard output. `worst`: frames that changed most, by session."""
    console = Console(markup=False, emoji=False)
    console.print(_sessions(results), _sums(total), _states(total["states"]["matrix"]), sep="\n")
    if worst is not None:
        console.print(_frames([change for _, change in worst], len(worst), [name for name, _ in worst]))


def _sessions(results: Sequence[dict[str, Any]]) -> Table:
    table = Table(title=f"{len(results)} session{'s' if len(results) > 1 else ''} perceived again")
    table.add_column("session", overflow="fold")
    for heading in ("frames", "|theta change| median (°)", "p95", "state changed", "pose lost", "gained"):
        table.add_column(heading, justify="right")
    for result in results:
        theta, refusals = result["theta_change_deg"], result["refusals"]
        table.add_row(
            Path(result["session"]).name,
            str(result["frames"]),
            *(_DASH if theta[key] is None else f"{theta[key]:.2f}" for key in ("median", "p95")),
            str(result["states"]["changed"]),
            str(sum(refusals["gained"].values())),
            str(sum(refusals["lost"].values())),
        )
    return table


def _sums(result: dict[str, Any]) -> Table:
    table = Table(title=f"{result['frames']} frames perceived again, {result['ended']}", show_header=True)
    table.add_column("")
    for heading in ("mean", "median", "p95", "max", "frames"):
        table.add_column(heading, justify="right")
    latency = result["latency_ms"]
    for name, spread, digits in (
        ("|theta change| (°)", result["theta_change_deg"], 2),
        ("head shift (source px)", result["head_shift_px"], 2),
        ("latency before (ms)", latency["before"], 1),
        ("latency after (ms)", latency["after"], 1),
    ):
        numbers = (spread[key] for key in ("mean", "median", "p95", "max"))
        table.add_row(name, *(_DASH if value is None else f"{value:.{digits}f}" for value in numbers), str(spread["n"]))
    table.add_section()
    refusals, confidence = result["refusals"], result["confidence"]
    table.add_row("state changed", *[""] * 4, str(result["states"]["changed"]))
    table.add_row(f"pose lost{_reasons(refusals['gained'])}", *[""] * 4, str(sum(refusals["gained"].values())))
    table.add_row(f"pose gained{_reasons(refusals['lost'])}", *[""] * 4, str(sum(refusals["lost"].values())))
    for name in ("before", "after"):
        value = confidence[name]
        table.add_row(f"confidence {name}", "", _DASH if value is None else f"{value:.3f}", "", "", "")
    return table


def _reasons(counts: dict[str, int]) -> str:
    return f" ({', '.join(f'{reason} {count}' for reason, count in counts.items())})" if counts else ""


def _states(matrix: list[list[int]]) -> Table:
    table = Table(title='States: rows before, columns after, "-" no pose')
    table.add_column("before")
    for label in STATES:
        table.add_column(label, justify="right")
    for k, label in enumerate(STATES):
        cells = (Text(str(count), style="bold" if place == k else "") for place, count in enumerate(matrix[k]))
        table.add_row(label, *cells)
    return table


def _frames(worst: Sequence[Change], count: int, sessions: Sequence[str] | None = None) -> Table:
    title = f"The {len(worst)} frames that changed most" if len(worst) == count else f"The {len(worst)} frames that changed"
    table = Table(title=title if worst else "No frame changed")
    if sessions is not None:
        table.add_column("session", overflow="fold")
    for heading in ("row", "time (s)", "theta before", "after", "change", "head shift (px)"):
        table.add_column(heading, justify="right")
    table.add_column("state")
    table.add_column("reason")
    for place, change in enumerate(worst):
        told_by = change.before if change.before.reason is not None else change.after
        table.add_row(
            *([] if sessions is None else [sessions[place]]),
            str(change.row),
            f"{change.time_s:.3f}",
            _theta(change.before),
            _theta(change.after),
            _DASH if change.theta_deg is None else signed_degrees(change.theta_deg, 1),
            _DASH if change.head_px is None else f"{change.head_px:.1f}",
            f"{change.before.state or '-'} \N{RIGHTWARDS ARROW} {change.after.state or '-'}",
            f"{change.kind}: {told_by.reason.value}" if told_by.reason is not None else "",
        )
    return table


def _theta(side: FrameResult) -> str:
    return _DASH if side.theta_signed_deg is None else signed_degrees(side.theta_signed_deg, 1)
