"""``perceive``: pictures and videos through perception, to JSON lines, masks and overlay pictures.

What ``perceive`` is given: pictures, folders of pictures, videos. One item per picture, in order, unreadable ones too.

Frames of a set that cannot be read are left out and said once, at the end: one damaged picture must not cost a night's run.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import typer

from app.commands.options import ConfigOption, ModelOption, PresetOption
from app.commands.progress import LineOutput, check_apart, check_no_input, is_same
from core.config.models import choose_model, load_config
from core.control.policies import table_policy
from core.devices import DamagedPicture, DamagedStream, DeviceError, EndOfStream, UserError
from core.files import VIDEO_ENDINGS, ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS, write_mask, write_png
from core.session.codec import scene_to_json, unread_to_json
from core.types import Frame, Image, Mask, Point, Scene


@dataclass(frozen=True, slots=True, eq=False)
class SourcePicture:
    """One picture of the input; unreadable: ``image`` is None and ``problem`` says why. ``time_s`` is set in videos.

    ``stem`` is its own alone; ``real_stems`` are what the user may call it by, the nearest first.
    """

    name: str
    stem: str
    real_stems: tuple[str, ...]
    image: Image | None
    problem: str | None = None
    time_s: float | None = None
    first_of_stream: bool = True


def is_video(path: Path) -> bool:
    """Whether its name is that of a video."""
    return path.suffix.lower() in VIDEO_ENDINGS


def expand(paths: Sequence[Path]) -> list[Path]:
    """Folders become their pictures and videos in name order (other files in them are left out); files stay as they are."""
    files: list[Path] = []
    for path in paths:
        try:
            if path.is_dir():
                files += sorted(p for p in path.iterdir() if p.suffix.lower() in IMAGE_ENDINGS + VIDEO_ENDINGS and _is_file(p))
                continue
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({error.strerror})") from None
        files.append(path)
    return files


def inner_folders(paths: Sequence[Path]) -> list[Path]:
    """Folders right inside those of `paths` that have pictures or videos, in order; what cannot be read has none."""
    found = []
    for folder in filter(Path.is_dir, paths):
        with contextlib.suppress(OSError, UserError):
            found += [inner for inner in sorted(folder.iterdir()) if inner.is_dir() and expand([inner])]
    return found


def _is_file(path: Path) -> bool:
    """Links that lead nowhere count: who put one there shall hear of it."""
    return path.is_file() or (path.is_symlink() and not path.exists())


def pictures(files: Sequence[Path]) -> Iterator[SourcePicture]:
    """The pictures of all files, one after another."""
    for path, stem in zip(files, own_stems(files), strict=True):
        if is_video(path):
            yield from _video(path, stem)
        else:
            try:
                yield SourcePicture(str(path), stem, (path.stem,), read_image(path))
            except ImageError as error:
                yield SourcePicture(str(path), stem, (path.stem,), None, str(error))


def own_stems(files: Sequence[Path]) -> list[str]:
    """A stem for each file that no other one has: its real one, with a number where an earlier file has it already.

    A picture that is called like a frame of one of the videos gets a number, too; a number never makes another file's real stem.
    """
    real, used = {path.stem for path in files}, set[str]()
    videos: set[str] = set()
    stems = [""] * len(files)
    # Videos first: what a picture must not be called is known once they have their stems.
    for place in sorted(range(len(files)), key=lambda place: not is_video(files[place])):
        path = files[place]
        stem, count = path.stem, 1
        is_taken = stem in used or frame_of(stem, videos)
        while is_taken:
            count += 1
            stem = f"{path.stem}_{count}"
            is_taken = stem in used or stem in real
        used.add(stem)
        if is_video(path):
            videos.add(stem)
        stems[place] = stem
    return stems


def frame_of(stem: str, videos: Collection[str]) -> bool:
    """Whether a frame of one of these videos (given by their stems) has this stem."""
    frame = re.fullmatch(r"(.+)_\d{6,}", stem)
    return frame is not None and frame[1] in videos


def _video(path: Path, stem: str) -> Iterator[SourcePicture]:
    """The pictures of a video, damaged ones as problems."""
    from core.session.reader import is_of_session
    from hardware.cameras.files import VideoFile

    if is_of_session(path):
        yield from _session_video(path, stem)
        return
    video = VideoFile(path, paced=False)
    index, is_first = 0, True
    try:
        video.open()
        while True:
            try:
                frame = video.read(0.0)
            except DamagedPicture as damage:
                yield SourcePicture(*_named(path, stem, index), None, str(damage))
                index += 1
                continue
            if frame is not None:
                yield SourcePicture(*_named(path, stem, index), frame.image, None, frame.captured_s, is_first)
                index, is_first = index + 1, False
    except EndOfStream as end:
        if is_first or isinstance(end, DamagedStream):
            yield SourcePicture(*_named(path, stem, index), None, str(end))
    except DeviceError as error:
        yield SourcePicture(str(path), stem, (path.stem,), None, str(error))
    finally:
        video.close()


def _session_video(path: Path, stem: str) -> Iterator[SourcePicture]:
    """Of a recorded session: no damage passes."""
    from core.session.manifest import SessionError
    from core.session.reader import session_video

    try:
        with session_video(path) as (times_ms, take):
            is_first = True
            for index, at_ms in enumerate(times_ms):
                image = take(index)
                if image is None:
                    yield SourcePicture(*_named(path, stem, index), None, f"{path}: picture {index} is lost or damaged")
                    continue
                yield SourcePicture(*_named(path, stem, index), image, None, (at_ms - times_ms[0]) / 1000.0, is_first)
                is_first = False
    except SessionError as error:
        yield SourcePicture(str(path), stem, (path.stem,), None, str(error))
        return
    if not times_ms:
        yield SourcePicture(str(path), stem, (path.stem,), None, f"{path}: no picture in it can be read")


def _named(path: Path, stem: str, index: int) -> tuple[str, str, tuple[str, ...]]:
    """Name and stems of a video's frame."""
    return f"{path}#{index}", f"{stem}_{index:06d}", (f"{path.stem}_{index:06d}", path.stem)


_FARTHEST_PX = 1_000_000
"""No picture is so large: a destination beyond is a slip of the pen."""


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where results go; None: not wanted (``jsonl``: standard output)."""

    jsonl: Path | None
    masks: Path | None
    overlay: Path | None


def perceive(
    images: Annotated[list[Path], typer.Argument(help="pictures, folders of pictures, or videos")],
    jsonl: Annotated[str, typer.Option(metavar="<path>", help="one JSON object per image; -: standard output")] = "-",
    masks: Annotated[Path | None, typer.Option(help="folder for <stem>_vessel.png and <stem>_robot.png")] = None,
    targets: Annotated[Path | None, typer.Option(help='JSON {"stem": [x, y]}: where the operator wants to go')] = None,
    overlay: Annotated[Path | None, typer.Option(help="folder for pictures with everything drawn in")] = None,
    model: ModelOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
) -> None:
    """Vessel, robot, angle, distances and pose state of pictures or a video."""
    lines = None if jsonl == "-" else Path(jsonl)  # ./- is a file
    run_perceive(images, Outputs(lines, masks, overlay), targets_path=targets, model=model, preset=preset, config_path=config)


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
    from app.commands.progress import progress_bar
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
        from app.widgets.overlay_image import draw_overlay

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


class LeftOut:
    """Counts them; what could not be read twice counts once."""

    def __init__(self) -> None:
        self._problems: dict[str, None] = {}

    def __len__(self) -> int:
        return len(self._problems)

    def add(self, error: UserError) -> None:
        self._problems[str(error)] = None

    def tell(self, done: int) -> None:
        """A note on standard error; raises UserError where nothing at all was `done`."""
        if not self._problems:
            return
        first = next(iter(self._problems))
        if not done:
            raise UserError(f"none of {len(self)} frames could be read; the first: {first}")
        sys.stderr.write(f"note: {len(self)} of {len(self) + done} frames could not be read and are left out; the first: {first}\n")
