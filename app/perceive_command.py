"""``perceive``: pictures and videos through perception, to JSON lines, masks and overlay pictures."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from app.line_output import LineOutput
from app.outputs import check_apart, check_no_input, is_same
from app.overlay_picture import draw_overlay
from app.scene_json import scene_to_json, unread_to_json
from app.sources import SourcePicture, expand, frame_of, inner_folders, is_video, own_stems, pictures
from core.config import choose_model, load_config
from core.control.policy import table_policy
from core.errors import UserError
from core.learning.dataset import write_mask, write_png
from core.types import Frame, Mask, Point, Scene

_FARTHEST_PX = 1_000_000
"""No picture is so large: a destination beyond is a slip of the pen."""


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where results go; None: not wanted (``jsonl``: standard output)."""

    jsonl: Path | None
    masks: Path | None
    overlay: Path | None


def run_perceive(
    paths: list[Path],
    outputs: Outputs,
    *,
    targets_path: Path | None,
    model: str | None,
    preset: str | None,
    config_path: Path | None,
) -> None:
    """Perceive everything in `paths`; raises UserError when nothing could be done, ConfigError, ModelError."""
    from app.long_work import progress_bar
    from core.perception.pipeline import open_pipeline

    config = load_config(config_path, preset, choose_model(model))
    targets = _Targets(_read_targets(targets_path))
    files = expand(paths)
    if not files:
        raise UserError(f"{', '.join(map(str, paths))}: no pictures or videos there{_where_else(paths)}")
    if outputs.jsonl is not None:
        read = (path for path in (*files, targets_path, config_path) if path is not None)
        check_no_input(outputs.jsonl, read, "--jsonl")
    for folder, option, endings in (
        (outputs.masks, "--masks", ("_vessel.png", "_robot.png")),
        (outputs.overlay, "--overlay", ("_overlay.png",)),
    ):
        if folder is not None:
            is_written = _written_names(files, endings)
            _check_keeps_inputs(folder, files, option, is_written)
            if outputs.jsonl is not None and is_written(outputs.jsonl.name):
                check_apart(outputs.jsonl, [folder / outputs.jsonl.name], "--jsonl", option)
            _make_folder(folder)
    pipeline = open_pipeline(config.perception)
    tally = _Tally()
    with LineOutput(outputs.jsonl) as lines, progress_bar() as bar:
        task = bar.add_task("pictures", total=None if any(is_video(f) for f in files) else len(files))
        for picture in pictures(files):
            if picture.image is None:
                tally.problem(picture.problem or f"{picture.name}: cannot be read")
                record = unread_to_json(picture.name, picture.problem or "")
            else:
                scene = _perceive_one(pipeline, picture, picture.image, tally.done, targets)
                record = scene_to_json(picture.name, scene)
                if scene.route_problem:
                    tally.no_route(picture.real_stems[-1], picture.name, scene.route_problem)
                tally.done += 1
            lines.write(json.dumps(record, allow_nan=False))
            if picture.image is not None:
                try:
                    _write_pictures(outputs, picture.stem, picture.image, scene, config.advice)
                except OSError as error:
                    tally.unwritten += 1
                    tally.problem(f"{error.filename or picture.stem}: cannot be written ({error.strerror or error})")
            bar.advance(task)
    tally.close([stem for stem in targets if stem not in targets.used])


def _where_else(paths: list[Path]) -> str:
    """Pictures are not looked for in folders of folders; but who gave one is told where there are some."""
    inner = inner_folders(paths)
    if not inner:
        return ""
    if len(inner) == 1:
        return f"; {inner[0]} has some: name that"
    return f"; {inner[0]} and others in it ({len(inner)} folders) have some: name those"


@dataclass(slots=True)
class _Tally:
    """What was done and what was not; the rest of a batch always goes on."""

    done: int = 0
    unwritten: int = 0
    problems: list[str] = field(default_factory=list)
    routes: dict[tuple[str, str], tuple[str, int]] = field(default_factory=dict)
    """Video or picture, and why there is no way to its target: the first picture, and how many."""

    def no_route(self, source: str, name: str, why: str) -> None:
        first, count = self.routes.get((source, why), (name, 0))
        self.routes[source, why] = first, count + 1

    def problem(self, line: str) -> None:
        self.problems.append(line)

    def close(self, unused_targets: list[str]) -> None:
        """Say what went wrong, once; raises UserError where nothing could be done or something was not written."""
        for (_, why), (first, count) in self.routes.items():
            more = f" (and in {count - 1} more of its frames)" if count > 1 else ""
            sys.stderr.write(f"note: {first}: no route to the target: {why}{more}\n")
        if unused_targets:
            sys.stderr.write(f"note: targets of no picture: {', '.join(unused_targets)}\n")
        if self.unwritten:
            raise UserError(f"{self.unwritten} pictures could not be written; the first: {self.problems[0]}")
        if self.problems and not self.done:
            raise UserError(f"none of {len(self.problems)} pictures could be read; the first: {self.problems[0]}")
        if self.problems:
            sys.stderr.write(f"note: {len(self.problems)} pictures could not be read; the first: {self.problems[0]}\n")


class _Targets(dict[str, Point]):
    """Destinations by stem; a video's holds for all its frames. Remembers which were asked for."""

    def __init__(self, points: dict[str, Point]) -> None:
        super().__init__(points)
        self.used: set[str] = set()

    def of(self, picture: SourcePicture) -> Point | None:
        for stem in (picture.stem, *picture.real_stems):
            if stem in self:
                self.used.add(stem)
                return self[stem]
        return None


def _perceive_one(pipeline: Any, picture: SourcePicture, image: Any, index: int, targets: _Targets) -> Scene:
    if picture.time_s is None:
        return pipeline.perceive_single(Frame(index, 0.0, image), targets.of(picture))  # type: ignore[no-any-return]
    if picture.first_of_stream:
        pipeline.reset()
    return pipeline(Frame(index, picture.time_s, image), targets.of(picture))  # type: ignore[no-any-return]


def _write_pictures(outputs: Outputs, stem: str, image: np.ndarray, scene: Scene, advice_config: Any) -> None:
    if outputs.masks is not None:
        size = scene.source_size
        blank = np.zeros((size[1], size[0]), bool)
        for name in ("vessel", "robot"):
            mask = getattr(scene.masks, name) if scene.masks is not None else blank
            write_mask(outputs.masks / f"{stem}_{name}.png", _source_sized(mask, size))
    if outputs.overlay is not None:
        write_png(outputs.overlay / f"{stem}_overlay.png", draw_overlay(image, scene, table_policy(scene, advice_config)))


def _source_sized(mask: Mask, size: tuple[int, int]) -> Mask:
    if mask.shape == (size[1], size[0]):
        return mask
    return np.asarray(cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_LINEAR) > 127)


def _written_names(files: Sequence[Path], endings: Sequence[str]) -> Callable[[str], bool]:
    """Whether a file of this name is written for one of the inputs."""
    stems = own_stems(files)
    filmed = {stem for file, stem in zip(files, stems, strict=True) if is_video(file)}
    shot = set(stems) - filmed

    def is_written(name: str) -> bool:
        found = [name.removesuffix(ending) for ending in endings if name.endswith(ending)]
        return any(stem in shot or frame_of(stem, filmed) for stem in found)

    return is_written


def _check_keeps_inputs(folder: Path, files: Sequence[Path], option: str, is_written: Callable[[str], bool]) -> None:
    """Refuse a folder in which what is written would have the name of an input, or of the masks that belong to one."""
    for file in files:
        if is_written(file.name) and is_same(folder, file.parent):
            raise UserError(f"{file}: is an input, which {option} {folder} would overwrite; choose another folder")
    # An input may be given as ".", and it or its folder may be a link into the set.
    places = {path for file in files for path in (os.path.abspath(file.parent), os.path.realpath(file.parent), _real_folder(file))}
    sets = [Path(place).parent for place in places if Path(place).name == "images"]
    if folder.is_dir() and any(is_same(folder, one / "masks") for one in sets):
        drawn = next((path for path in sorted(folder.iterdir()) if is_written(path.name)), None)
        if drawn is not None:
            raise UserError(f"{drawn}: is a mask of the set, which {option} would overwrite; choose another folder")


def _real_folder(file: Path) -> str:
    return os.path.dirname(os.path.realpath(file))


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-probe"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from None


def _read_targets(path: Path | None) -> dict[str, Point]:
    """``{stem: [x, y]}`` in source pixels."""
    if path is None:
        return {}
    wanted = f'an object {{"stem": [x, y], ...}} with numbers below {_FARTHEST_PX:,} px'
    try:
        data = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError):
        raise UserError(f"{path}: not valid JSON; needs {wanted}") from None
    if not isinstance(data, dict):
        raise UserError(f"{path}: needs {wanted}")
    targets: dict[str, Point] = {}
    for stem, point in data.items():
        if not (isinstance(point, list) and len(point) == 2 and all(_is_place(value) for value in point)):
            raise UserError(f"{path}: {stem}: needs {wanted}")
        targets[stem] = (float(point[0]), float(point[1]))
    return targets


def _is_place(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _FARTHEST_PX
