"""``replay``: perceive a recorded session again, with another model or configuration, and show what changed."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from app.learning_commands import Interrupt, progress_bar
from app.line_output import LineOutput
from app.outputs import check_apart, check_no_input, check_no_session
from app.perceive_command import _make_folder
from app.scene_json import scene_to_json, unread_to_json
from core.config import Config, choose_model, load_config, merge
from core.errors import UserError
from core.learning.model_file import model_folder, read_model_info
from core.names import name_as_text, name_of
from core.session.manifest import Manifest, SessionError
from core.session.reader import SessionReader
from core.study.replay import Change, RecordedTargets, changed_most, seen, summarise
from core.types import Frame, Scene

if TYPE_CHECKING:
    from core.control.engine import Perceive
    from core.perception.pipeline import Pipeline

MOST_SHOWN = 20
_WRITTEN = ("replay.json", "frames.jsonl", "replay.svg", "replay.pdf")
"""What ``--out`` gets."""


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """The command line of ``replay``; None: not given."""

    session: Path
    model: str | None = None
    preset: str | None = None
    config_path: Path | None = None
    jsonl: Path | None = None
    out: Path | None = None
    diff: bool = False
    as_json: bool = False


@dataclass(slots=True)
class _Replayed:
    changes: list[Change] = field(default_factory=list)
    no_row: int = 0
    no_picture: int = 0
    ended: str = "all frames"
    interrupted: bool = False


def run_replay(options: ReplayOptions) -> None:
    """Replay and tell; raises SessionError, ConfigError, ModelError, UserError, and KeyboardInterrupt once all is told."""
    from core.perception.pipeline import open_pipeline

    with SessionReader(options.session) as reader, ExitStack() as stack:
        config, notes = replay_config(reader.manifest, options)
        if options.out is not None:
            check_no_session(options.out, "--out")
            _make_folder(options.out)
        if options.jsonl is not None:
            own = [options.config_path] if options.config_path is not None else []
            check_no_input(options.jsonl, [*options.session.iterdir(), *own], "--jsonl")
            if options.out is not None:
                check_apart(options.jsonl, [options.out / name for name in _WRITTEN], "--jsonl", "--out")
        pipeline = open_pipeline(config.perception)
        after = model_of(config) | {"engine": pipeline.engine}
        notes += model_note(reader.manifest, config, after)
        reader.wait()
        lines = stack.enter_context(LineOutput(options.jsonl)) if options.jsonl is not None else None
        done = replay(reader, pipeline, lines)
        problems = list(reader.problems)
    if done.interrupted and not done.changes:
        raise KeyboardInterrupt
    if not done.changes:
        first = f"; the first: {problems[0]}" if problems else ""
        raise SessionError(f"{options.session}: no frame that could be perceived again{first}")
    before = dict(reader.manifest.model) if reader.manifest is not None else {}
    result = _result(options, done, before, after, notes, problems)
    if options.out is not None:
        _write(options.out, name_as_text(name_of(options.session)), done.changes, result)
    _tell(options, result, done.changes)
    if done.interrupted:
        raise KeyboardInterrupt


def replay_config(manifest: Manifest | None, options: ReplayOptions) -> tuple[Config, list[str]]:
    """The configuration to perceive with, and notes on it: the given one; without any, that of the recording.

    `--model` wins over both. Raises ConfigError.
    """
    overrides = choose_model(options.model)
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
    name = config.perception.segmentation.model
    info = read_model_info(model_folder(name), verify=())
    return {"name": name, "sha256": info.weights_sha256, "second_look_sha256": info.second_look_sha256}


def model_note(manifest: Manifest | None, config: Config, after: dict[str, Any]) -> list[str]:
    """What must be known to read the figures: the same name may be another model, and the same model never sees the same pixels."""
    if manifest is None:
        return []
    before = manifest.model
    # Recordings from before the second look was noted say nothing of it.
    same_near = "second_look_sha256" not in before or before["second_look_sha256"] == after["second_look_sha256"]
    same_weights = before.get("sha256") == after["sha256"] and same_near
    if before.get("name") == after["name"] and not same_weights:
        return [f"model {after['name']} is not the one that was recorded with: its weights differ"]
    same_config = manifest.config.get("perception") == config.perception.model_dump(mode="json")
    if same_weights and same_config:
        lossy = "" if manifest.codec == "lossless" else "the video's lossy coding, "
        return [f"same model, same configuration: what differs comes from {lossy}the program and the stream's beginning"]
    return []


def replay(reader: SessionReader, pipeline: Pipeline, lines: LineOutput | None = None) -> _Replayed:
    """All frames once more with the recorded targets, as a stream where they were one; Ctrl-C keeps what is done."""
    done = _Replayed()
    targets = RecordedTargets(reader.events)
    first_s: float | None = None
    perceive = pipeline if _was_stream(reader.manifest) else pipeline.perceive_single
    _warm_up(reader, pipeline, perceive)
    with Interrupt() as interrupt, progress_bar() as bar:
        task = bar.add_task("frames", total=len(reader))
        for place in range(len(reader)):
            if interrupt.asked:
                done.interrupted, done.ended = True, f"interrupted after {place} of {len(reader)} frames"
                break
            bar.advance(task)
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
                done.changes.append(Change(row.row, row.index, row.captured_s - first_s, seen(row.scene), seen(scene)))
                record = scene_to_json(name, scene)
            if lines is not None:
                placed = {"frame": row.index, "captured_s": round(row.captured_s, 6), "time_s": round(row.captured_s - first_s, 6)}
                lines.write(json.dumps(record | placed, allow_nan=False))
    return done


def _was_stream(manifest: Manifest | None) -> bool:
    """Whether the frames follow each other; the pictures of a folder have nothing to do with each other, and were perceived so."""
    rig = manifest.config.get("rig") if manifest is not None else None
    return not (isinstance(rig, dict) and rig.get("camera") == "image_folder")


def _warm_up(reader: SessionReader, pipeline: Pipeline, perceive: Perceive) -> None:
    """The first picture waits for the network's first run, which would spoil the latency."""
    pipeline.warm_up()
    frame = reader.frame(0) if len(reader) else None
    if frame is not None:
        perceive(frame)
    pipeline.reset()


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


def _result(
    options: ReplayOptions,
    done: _Replayed,
    before: dict[str, Any],
    after: dict[str, Any],
    notes: list[str],
    problems: list[str],
) -> dict[str, Any]:
    result = {
        "session": name_as_text(options.session),
        "ended": done.ended,
        "before": {"name": before.get("name"), "sha256": before.get("sha256")},
        "after": after | {"preset": options.preset, "config": name_as_text(options.config_path) if options.config_path else None},
        **summarise(done.changes),
        "without_picture": done.no_picture,
        "without_row": done.no_row,
        "notes": notes,
        "problems": problems,
    }
    if options.diff:
        result["changed_most"] = [change_to_json(change) for change in changed_most(done.changes, MOST_SHOWN)]
    return result


def _write(out: Path, name: str, changes: Sequence[Change], result: dict[str, Any]) -> None:
    from app.evaluation_figures import save_figure
    from app.replay_figure import draw_replay

    try:
        (out / "replay.json").write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        with (out / "frames.jsonl").open("w", encoding="utf-8") as file:
            file.writelines(json.dumps(change_to_json(change), allow_nan=False) + "\n" for change in changes)
        figure = draw_replay(changes, result["states"]["matrix"], name)
        for ending in (".svg", ".pdf"):
            save_figure(figure, out / f"replay{ending}")
    except OSError as error:
        raise UserError(f"{error.filename or out}: cannot be written ({error.strerror or error})") from None


def _tell(options: ReplayOptions, result: dict[str, Any], changes: Sequence[Change]) -> None:
    from app.replay_tables import print_replay

    if options.as_json:
        sys.stdout.write(json.dumps(result, allow_nan=False) + "\n")
    else:
        print_replay(result, changes, with_diff=options.diff, count=MOST_SHOWN)
    for note in result["notes"]:
        sys.stderr.write(f"note: {note}\n")
    if result["without_picture"] or result["without_row"]:
        sys.stderr.write(f"note: {result['without_picture']} pictures and {result['without_row']} rows are lost\n")
    if options.out is not None:
        sys.stderr.write(f"figures and frames are in {options.out}\n")
