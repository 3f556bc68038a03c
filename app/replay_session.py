"""One recorded session perceived again, with the recorded targets, by itself or in a worker."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from app.line_output import LineOutput
from app.scene_json import scene_to_json, unread_to_json
from core.config import Config, choose_model, load_config, merge
from core.learning.model_file import model_folder, read_model_info
from core.names import name_as_text, name_of
from core.session.manifest import Manifest, SessionError
from core.session.reader import SessionReader
from core.study.replay import Change, RecordedTargets, changed_most, seen
from core.study.replay_tally import Tally
from core.types import Frame, Scene

if TYPE_CHECKING:
    from core.control.engine import Perceive
    from core.perception.pipeline import Pipeline

MOST_SHOWN = 20
"""So many of the frames that changed most."""

Watch = Callable[[int], AbstractContextManager[Callable[[], bool]]]
"""Around the frames of a session, of which there are so many; asked before each whether to go on."""


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """How to perceive a session again; None: not given. ``threads`` are the network's; None: as configured."""

    session: Path
    model: str | None = None
    preset: str | None = None
    config_path: Path | None = None
    jsonl: Path | None = None
    diff: bool = False
    threads: int | None = None

    @property
    def overrides(self) -> dict[str, Any]:
        """Of a configuration, by what wins over it."""
        overrides = choose_model(self.model)
        if self.threads is not None:
            overrides.setdefault("perception", {}).setdefault("segmentation", {})["threads"] = self.threads
        return overrides


@dataclass(frozen=True, slots=True)
class SessionReplay:
    """What came of a session: all its frames, and the object of ``--json`` that tells them in sum."""

    changes: list[Change]
    result: dict[str, Any]
    interrupted: bool = False


@dataclass(slots=True)
class _Replayed:
    changes: list[Change] = field(default_factory=list)
    no_row: int = 0
    no_picture: int = 0
    ended: str = "all frames"
    interrupted: bool = False


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
    if done.interrupted and not done.changes:
        raise KeyboardInterrupt
    if not done.changes:
        first = f"; the first: {problems[0]}" if problems else ""
        raise SessionError(f"{options.session}: no frame that could be perceived again{first}")
    before = dict(reader.manifest.model) if reader.manifest is not None else {}
    return SessionReplay(done.changes, _result(options, done, before, after, notes, problems), done.interrupted)


class _Opened(threading.local):
    """The last perception of this thread: loading the network takes over a second, and sessions are recorded alike."""

    key = ""
    pipeline: Pipeline | None = None


_opened = _Opened()


def _pipeline_for(config: Config) -> Pipeline:
    from core.perception.pipeline import open_pipeline

    key = config.perception.model_dump_json()
    if _opened.pipeline is None or _opened.key != key:
        _opened.pipeline, _opened.key = open_pipeline(config.perception), key
    return _opened.pipeline


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


def replay_frames(
    reader: SessionReader, pipeline: Pipeline, lines: LineOutput | None = None, watch: Watch = unwatched
) -> _Replayed:
    """All frames once more with the recorded targets, as a stream where they were one; whoever ends it keeps what is done."""
    done = _Replayed()
    targets = RecordedTargets(reader.events)
    first_s: float | None = None
    perceive = pipeline if _was_stream(reader.manifest) else pipeline.perceive_single
    _warm_up(reader, pipeline, perceive)
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
        **Tally.of(done.changes).to_json(),
        "without_picture": done.no_picture,
        "without_row": done.no_row,
        "notes": notes,
        "problems": problems,
    }
    if options.diff:
        result["changed_most"] = [change_to_json(change) for change in changed_most(done.changes, MOST_SHOWN)]
    return result


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
