"""``perceive``: pictures and videos through perception, to JSON lines, masks and overlay pictures."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import cv2
import numpy as np
import typer

from app.commands.options import ConfigOption, ModelOption, PresetOption
from app.commands.progress import LineOutput, check_apart, check_no_input, is_same, make_folder, progress_bar
from app.ui.display import check_qt
from core.bench.bench import Bench, bench_from_pictures, check_size, read_bench
from core.config.models import choose_model, load_config
from core.control.policies import table_policy
from core.devices import UserError
from core.files import ImageError, read_image
from core.learning.dataset import write_mask, write_png
from core.session.codec import scene_to_json, unread_to_json
from core.types import Frame, Image, Mask, Point, Scene
from hardware.cameras.picture_files import FilePicture, expand, inner_folders, is_frame_of, is_video, own_stems, pictures

if TYPE_CHECKING:
    from core.perception.pipeline import Pipeline

_LARGEST_PX = 1_000_000
"""No picture is so large: a larger coordinate of a target is a typing error."""
_MASK_ENDINGS, _OVERLAY_ENDINGS = ("_vessel.png", "_robot.png"), ("_overlay.png",)


def perceive(
    images: Annotated[list[Path], typer.Argument(help="pictures, folders of pictures, or videos")],
    jsonl: Annotated[str, typer.Option(metavar="<path>", help="one JSON object per image; -: standard output")] = "-",
    masks: Annotated[Path | None, typer.Option(help="folder for <stem>_vessel.png and <stem>_robot.png")] = None,
    targets: Annotated[Path | None, typer.Option(help='JSON {"stem": [x, y]}: where the operator wants to go')] = None,
    overlay: Annotated[Path | None, typer.Option(help="folder for pictures with everything drawn in")] = None,
    model: ModelOption = None,
    preset: PresetOption = None,
    config: ConfigOption = None,
    empty: Annotated[
        list[Path] | None, typer.Option(metavar="<picture>", help="the same bench without the robot; may be given more than once")
    ] = None,
    vessel: Annotated[Path | None, typer.Option(metavar="<mask>", help="the vessel of that bench, white on black")] = None,
    bench: Annotated[Path | None, typer.Option(metavar="<folder>", help="the bench as it was saved, instead of --empty")] = None,
) -> None:
    """Vessel, robot, angle, distances and pose state of pictures or a video."""
    from core.perception.pipeline import open_pipeline

    settings = load_config(config, preset, choose_model(model))
    known = _read_bench(bench, empty or [], vessel, settings.perception.working_size_px)
    points = _Targets(_read_targets(targets))
    files = expand(images)
    if not files:
        raise UserError(f"{', '.join(map(str, images))}: no pictures or videos there{_hint_inner(images)}")
    if overlay is not None:
        check_qt("leave --overlay out")
    lines_to = None if jsonl == "-" else Path(jsonl)  # ./- is a file
    if lines_to is not None:
        of_bench = bench.glob("*") if bench is not None else ()
        read = (path for path in (*files, *(empty or ()), *of_bench, targets, config, vessel) if path is not None)
        check_no_input(lines_to, read, "--jsonl")
    for folder, option, endings in ((masks, "--masks", _MASK_ENDINGS), (overlay, "--overlay", _OVERLAY_ENDINGS)):
        if folder is not None:
            is_written = written_names(files, endings)
            check_keeps_inputs(folder, files, option, is_written)
            if lines_to is not None and is_written(lines_to.name):
                check_apart(lines_to, [folder / lines_to.name], "--jsonl", option)
            make_folder(folder)
    pipeline = open_pipeline(settings.perception, bench=known)
    if known is not None and empty:
        _check_empty(pipeline, known, files, settings.perception.working_size_px)
    done, report = 0, _Report()
    with LineOutput(lines_to) as lines, progress_bar() as bar:
        task = bar.add_task("pictures", total=None if any(is_video(f) for f in files) else len(files))
        for picture in pictures(files):
            if picture.image is None:
                report.problems.append(picture.problem or f"{picture.name}: cannot be read")
                lines.write(json.dumps(unread_to_json(picture.name, picture.problem or ""), allow_nan=False))
                bar.advance(task)
                continue
            scene = _perceive_picture(pipeline, picture, picture.image, done, points)
            if scene.route_problem:
                report.add_route_problem(picture, scene.route_problem)
            done += 1
            lines.write(json.dumps(scene_to_json(picture.name, scene), allow_nan=False))
            try:
                if masks is not None:
                    for name, mask in source_masks(scene).items():
                        write_mask(masks / f"{picture.stem}_{name}.png", mask)
                if overlay is not None:
                    _write_overlay(overlay, picture.stem, picture.image, scene, settings.advice)
            except OSError as error:
                report.unwritten += 1
                report.problems.append(f"{error.filename or picture.stem}: cannot be written ({error.strerror or error})")
            bar.advance(task)
    report.print(done, [stem for stem in points if stem not in points.used])


def _read_bench(folder: Path | None, empty: list[Path], vessel: Path | None, working_size_px: int) -> Bench | None:
    """The bench of the options; None without one. Raises UserError."""
    if folder is not None:
        if empty or vessel is not None:
            raise UserError("--bench already has empty picture and vessel: leave --empty and --vessel out")
        bench = read_bench(folder)
        check_size(bench, working_size_px, str(folder))
        return bench
    if not empty:
        if vessel is not None:
            raise UserError("--vessel needs --empty: a picture of the same bench without the robot")
        return None
    drawn = read_image(vessel).max(axis=2) > _WHITE if vessel is not None else None
    return bench_from_pictures([read_image(path) for path in empty], drawn, empty[0].stem, working_size_px)


_WHITE = 127
"""Grey level above which a mask is set."""
_CHECKED = 5
"""Pictures that an empty one is compared with."""


def _check_empty(pipeline: Pipeline, bench: Bench, files: list[Path], working_size_px: int) -> None:
    """Raise BenchError where the robot lies in the empty picture."""
    from core.bench.difference import check_without_robot
    from core.perception.segmentation import to_working

    stills = [file for file in files if not is_video(file)]
    frames = []
    for file in stills[:: max(1, len(stills) // _CHECKED)][:_CHECKED]:
        with suppress(ImageError):  # reported when it is perceived
            frames.append(to_working(read_image(file), working_size_px)[0])
    masks = pipeline.with_bench(None).perceive_single(Frame(0, 0.0, bench.empty)).masks
    if masks is not None and frames:
        check_without_robot(bench, masks.robot_probability, frames)


def _hint_inner(paths: list[Path]) -> str:
    """Folders of folders are not searched; the inner ones with pictures are named."""
    inner = inner_folders(paths)
    if len(inner) < 2:
        return f"; {inner[0]} has some: name that" if inner else ""
    return f"; {inner[0]} and others in it ({len(inner)} folders) have some: name those"


@dataclass(slots=True)
class _Report:
    """What went wrong; the rest of a batch always goes on.

    ``routes``: video or picture, and why there is no route to its target -> the first picture, and how many.
    """

    unwritten: int = 0
    problems: list[str] = field(default_factory=list)
    routes: dict[tuple[str, str], tuple[str, int]] = field(default_factory=dict)

    def add_route_problem(self, picture: FilePicture, why: str) -> None:
        key = picture.real_stems[-1], why
        first, count = self.routes.get(key, (picture.name, 0))
        self.routes[key] = first, count + 1

    def print(self, done: int, unused_targets: list[str]) -> None:
        """On standard error; raises UserError where nothing could be done or something was not written."""
        for (_, why), (first, count) in self.routes.items():
            more = f" (and in {count - 1} more of its frames)" if count > 1 else ""
            sys.stderr.write(f"note: {first}: no route to the target: {why}{more}\n")
        if unused_targets:
            sys.stderr.write(f"note: targets of no picture: {', '.join(unused_targets)}\n")
        if self.unwritten:
            raise UserError(f"{self.unwritten} pictures could not be written; the first: {self.problems[0]}")
        if self.problems and not done:
            raise UserError(f"none of {len(self.problems)} pictures could be read; the first: {self.problems[0]}")
        if self.problems:
            sys.stderr.write(f"note: {len(self.problems)} pictures could not be read; the first: {self.problems[0]}\n")


class _Targets(dict[str, Point]):
    """Targets by stem; a video's holds for all its frames. ``used``: stems of pictures that there were."""

    def __init__(self, points: dict[str, Point]) -> None:
        super().__init__(points)
        self.used: set[str] = set()

    def of(self, picture: FilePicture) -> Point | None:
        for stem in (picture.stem, *picture.real_stems):
            if stem in self:
                self.used.add(stem)
                return self[stem]
        return None


def _perceive_picture(pipeline: Pipeline, picture: FilePicture, image: Image, index: int, targets: _Targets) -> Scene:
    if picture.time_s is None:
        return pipeline.perceive_single(Frame(index, 0.0, image), targets.of(picture))
    if picture.first_of_stream:
        pipeline.reset()
    return pipeline(Frame(index, picture.time_s, image), targets.of(picture))


def source_masks(scene: Scene) -> dict[str, Mask]:
    """The masks ``vessel`` and ``robot`` at source size, empty without any."""
    width, height = scene.source_size
    found = {}
    for name in ("vessel", "robot"):
        mask = getattr(scene.masks, name) if scene.masks is not None else np.zeros((height, width), bool)
        if mask.shape != (height, width):
            mask = np.asarray(cv2.resize(mask.astype(np.uint8) * 255, (width, height), interpolation=cv2.INTER_LINEAR) > 127)
        found[name] = mask
    return found


def _write_overlay(folder: Path, stem: str, image: Image, scene: Scene, advice_config: Any) -> None:
    """Raises OSError."""
    from app.widgets.overlay_image import draw_overlay

    write_png(folder / f"{stem}_overlay.png", draw_overlay(image, scene, table_policy(scene, advice_config)))


def written_names(files: Sequence[Path], endings: Sequence[str]) -> Callable[[str], bool]:
    """Whether a file of this name is written for one of the inputs."""
    stems = own_stems(files)
    of_videos = {stem for file, stem in zip(files, stems, strict=True) if is_video(file)}
    of_pictures = set(stems) - of_videos

    def is_written(name: str) -> bool:
        found = [name.removesuffix(ending) for ending in endings if name.endswith(ending)]
        return any(stem in of_pictures or is_frame_of(stem, of_videos) for stem in found)

    return is_written


def check_keeps_inputs(folder: Path, files: Sequence[Path], option: str, is_written: Callable[[str], bool]) -> None:
    """Raise UserError for a folder in which a written file would replace an input, or the masks that belong to one."""
    for file in files:
        if is_written(file.name) and is_same(folder, file.parent):
            raise UserError(f"{file}: is an input, which {option} {folder} would overwrite; choose another folder")
    # An input may be given as ".", and it or its folder may be a link into the set.
    places = {
        path
        for file in files
        for path in (os.path.abspath(file.parent), os.path.realpath(file.parent), os.path.dirname(os.path.realpath(file)))
    }
    sets = [Path(place).parent for place in places if Path(place).name == "images"]
    if folder.is_dir() and any(is_same(folder, one / "masks") for one in sets):
        drawn = next((path for path in sorted(folder.iterdir()) if is_written(path.name)), None)
        if drawn is not None:
            raise UserError(f"{drawn}: is a mask of the set, which {option} would overwrite; choose another folder")


def _read_targets(path: Path | None) -> dict[str, Point]:
    """``{stem: [x, y]}`` in source pixels; raises UserError."""
    if path is None:
        return {}
    wanted = f'an object {{"stem": [x, y], ...}} with numbers below {_LARGEST_PX:,} px'
    try:
        data = json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError):
        raise UserError(f"{path}: not valid JSON; needs {wanted}") from None
    if not isinstance(data, dict):
        raise UserError(f"{path}: needs {wanted}")

    def is_coordinate(value: object) -> bool:
        return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LARGEST_PX

    targets: dict[str, Point] = {}
    for stem, point in data.items():
        if not (isinstance(point, list) and len(point) == 2 and all(map(is_coordinate, point))):
            raise UserError(f"{path}: {stem}: needs {wanted}")
        targets[stem] = (float(point[0]), float(point[1]))
    return targets
