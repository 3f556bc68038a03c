"""The command line of ``annotate``.

What ``annotate`` is given: pictures, folders, labelled sets, sessions, and videos, which become pictures evenly over time; and
what has been annotated of them, by whom.

Prints how well raters agree: a column for each rater with himself, and for each two raters.

Manual against algorithm: the raters' common answer for each image beside what perception says of it.

Pictures taken of a video, once: in a folder beside it that knows whose they are, so that annotations find them again.
"""

from __future__ import annotations

import getpass
import hashlib
import json
import math
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from glob import escape
from pathlib import Path
from typing import Any

import av
import av.error
import numpy as np
from rich.console import Console
from rich.table import Table

from app.commands.perceive import expand, is_video
from app.commands.progress import progress_bar
from core.annotation.agreement_report import (
    agreement_report,
    choose_study,
    manual_measurements,
    measured_alike,
    rater_notes,
    second_measure_notes,
)
from core.annotation.model import AnnotationError
from core.annotation.store import DEFAULT_NAME, AnnotationStore, FoundImage, StoredAnnotation, find_images, image_sha256
from core.config.models import Config
from core.evaluation.evaluation import Measurement
from core.files import ImageError, name_as_text, name_of, read_image
from core.learning.dataset import write_png
from core.session.reader import Take, is_of_session, session_video, times_of
from core.session.video import NoPictures, decoded, is_avi, open_video, pictures_of, upright
from core.types import Frame, Image


@dataclass(frozen=True, slots=True)
class StudyOptions:
    """What the command line says about the study; None where it says nothing, ``asked`` "" for what lies outside studies."""

    asked: str | None = None
    rater: str | None = None
    repeats: int | None = None
    mirror: bool = False
    turn: bool = False
    seed: int | None = None
    order: str | None = None

    @property
    def name(self) -> str:
        """In which answers are given; "" outside studies."""
        return self.asked or ""


@dataclass(frozen=True, slots=True)
class AnnotateOptions:
    """The command line of ``annotate``."""

    paths: tuple[Path, ...]
    store: Path | None = None
    study: StudyOptions = StudyOptions()
    frames: int | None = None
    """Of each video; None: those that were taken before, or ``FRAMES`` new ones."""
    report: bool = False
    export: str | None = None
    imports: tuple[Path, ...] = ()
    joins: tuple[Path, ...] = ()
    names: tuple[str, ...] = ()
    """Of raters in the files of `joins`, as THERE=HERE."""
    salvage: bool = False
    out: Path | None = None
    as_json: bool = False
    model: str | None = None
    config_path: Path | None = None


_WHOSE = "video.json"
_FRAMES_OF = "_frames"
_END_BYTES = 1_000_000
_SAME_LEVELS = 8.0
"""By so many grey levels two decoders' pictures of one frame differ at most, on average."""


def taken_of(video: Path) -> list[Path]:
    """The pictures that were taken of a video before. Raises AnnotationError where they are those of another one of its name."""
    folder = _folder_of(video)
    found = _pictures_in(folder, video)
    if found:
        _check_owner(folder, video)
    return found


def recording_of(folder: Path) -> Path | None:
    """What the pictures of a folder were taken of: a session, however many files its video has, or the one video that the folder
    stands for; None: not known."""
    if folder.name.endswith(_FRAMES_OF) and is_of_session(folder.with_name(f"{folder.name.removesuffix(_FRAMES_OF)}.mkv")):
        return folder.absolute().parent
    return folder if (folder / _WHOSE).is_file() else None


Choose = Callable[[int], Sequence[int]]
"""Which of so many pictures of a video."""


def evenly(count: int) -> Choose:
    """`count` pictures evenly over time, or all where there are fewer."""
    return lambda total: sorted({round(place) for place in np.linspace(0, total - 1, min(count, total))})


def evenly_over(videos: Sequence[Path], count: int) -> dict[Path, Choose]:
    """`count` pictures evenly over several videos that follow each other, as the files of one session do."""
    lengths = [len(times_of(video)) for video in videos]
    chosen, begin = evenly(count)(sum(lengths)) if sum(lengths) else [], 0
    shares: dict[Path, Choose] = {}
    for video, length in zip(videos, lengths, strict=True):
        places = [place - begin for place in chosen if begin <= place < begin + length]
        shares[video] = lambda _total, places=places: places  # type: ignore[misc]
        begin += length
    return shares


def take_frames(video: Path, choose: Choose, tell: Callable[[Sequence[str]], object]) -> list[Path]:
    """Take the chosen pictures of a video; those that were taken before stay as they are.

    A frame that is lost or damaged is left out, and `tell` hears how many: decoders conceal damage, and what they show must not be
    measured.

    Raises
    ------
    AnnotationError
        The video cannot be read, the folder beside it cannot be written, or holds another video's pictures.
    """
    folder = _folder_of(video)
    written: list[Path] = []
    try:
        with _opened(video) as (total, take), progress_bar() as bar:
            chosen = choose(total)
            folder.mkdir(exist_ok=True)
            _own(folder, video, take)
            for index in bar.track(chosen, description=f"frames of {video.stem}"):
                path = folder / f"{video.stem}_{index:06d}.png"
                if not path.is_file():
                    image = take(index)
                    if image is None:
                        continue
                    write_png(path, image)
                written.append(path)
    except av.error.FFmpegError as error:
        raise AnnotationError(f"{video}: cannot be read as a video ({error.strerror or error})") from None
    except OSError as error:
        raise AnnotationError(
            f"{error.filename or folder}: cannot be written ({error.strerror}); copy the video elsewhere"
        ) from None
    if len(written) < len(chosen):
        tell([f"{video}: {len(chosen) - len(written)} of {len(chosen)} chosen frames are lost or damaged: left out"])
    return written


def _folder_of(video: Path) -> Path:
    """Beside the video and called as it is, with its ending where others are called so, too: run.mp4 and run.mkv."""
    twins = [path for path in video.parent.glob(f"{escape(video.stem)}.*") if is_video(path) and path.name != video.name]
    return video.with_name(f"{video.name if twins else video.stem}{_FRAMES_OF}")


def _pictures_in(folder: Path, video: Path) -> list[Path]:
    return sorted(folder.glob(f"{escape(video.stem)}_*.png"))


def _own(folder: Path, video: Path, take: Take) -> None:
    """Write into the folder whose pictures it holds; those that lie in it without a word are compared with the video's."""
    _check_owner(folder, video)
    if (folder / _WHOSE).exists() or is_of_session(video):
        return
    for path in _pictures_in(folder, video)[:1]:
        number = path.stem.removeprefix(f"{video.stem}_")
        if not _is_alike(path, take(int(number)) if number.isascii() and number.isdigit() else None):
            raise _of_another(folder, video)
    with suppress(OSError):  # where all pictures are there nothing need be written
        (folder / _WHOSE).write_text(json.dumps(_fingerprint(video)) + "\n", encoding="utf-8")


def _check_owner(folder: Path, video: Path) -> None:
    """Raise AnnotationError where the folder says that its pictures are of another video."""
    try:
        told = json.loads((folder / _WHOSE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return
    if told != _fingerprint(video):
        raise _of_another(folder, video)


def _of_another(folder: Path, video: Path) -> AnnotationError:
    return AnnotationError(f"{folder}: holds pictures of another video than {video.name} is now; move it away, or rename the video")


def _fingerprint(video: Path) -> dict[str, object]:
    """What tells a video from another one of its name, without reading all of it."""
    size = video.stat().st_size
    with video.open("rb") as file:
        digest = hashlib.sha256(file.read(_END_BYTES))
        file.seek(max(0, size - _END_BYTES))
        digest.update(file.read(_END_BYTES))
    return {"bytes": size, "sha256_of_ends": digest.hexdigest()}


def _is_alike(path: Path, image: Image | None) -> bool:
    try:
        written = read_image(path)
    except ImageError:
        return True  # it is told when it is to be shown
    if image is None or written.shape != image.shape:
        return image is None
    return float(np.abs(written.astype(np.int16) - image).mean()) <= _SAME_LEVELS


@contextmanager
def _opened(video: Path) -> Iterator[tuple[int, Take]]:
    """How many pictures a video has, and how to take one. Raises AnnotationError, av.error.FFmpegError, OSError."""
    with _session_opened(video) if is_of_session(video) else _video_opened(video) as (total, take):
        if not total:
            raise AnnotationError(f"{video}: no frame in it can be read")
        yield total, take


@contextmanager
def _session_opened(video: Path) -> Iterator[tuple[int, Take]]:
    with session_video(video) as (times_ms, take):
        yield len(times_ms), take


@contextmanager
def _video_opened(video: Path) -> Iterator[tuple[int, Take]]:
    with open_video(video) as container:
        try:
            stream = pictures_of(container)
        except NoPictures as error:
            raise AnnotationError(f"{video}: {error}") from None
        times = sorted({packet.pts for packet in container.demux(stream) if packet.pts is not None})
        if is_avi(container):
            yield len(times), _FromTheStart(container, stream)
        else:
            yield len(times), lambda index: _decoded(container, stream, times[index]) if index < len(times) else None


class _FromTheStart:
    """The picture at a place among all, where times and seeking are not to be trusted: read one after the other."""

    def __init__(self, container: av.container.InputContainer, stream: av.VideoStream) -> None:
        self._container, self._stream = container, stream
        self._next = math.inf

    def __call__(self, index: int) -> Image | None:
        if index < self._next:
            self._container.seek(0, stream=self._stream, backward=True)
            self._pictures, self._next = decoded(self._container, self._stream), 0
        with suppress(av.error.FFmpegError):  # the file cannot be read on
            for picture in self._pictures:
                self._next += 1
                if self._next == index + 1:
                    return upright(picture, self._stream) if isinstance(picture, av.VideoFrame) else None
        return None


def _decoded(container: av.container.InputContainer, stream: av.VideoStream, pts: int) -> Image | None:
    """The picture of exactly this time, not a neighbour's instead."""
    container.seek(pts, stream=stream, backward=True)
    try:
        for frame in decoded(container, stream):
            if frame.pts == pts:
                return upright(frame, stream) if isinstance(frame, av.VideoFrame) else None
            if frame.pts is not None and frame.pts > pts:
                return None
    except av.error.FFmpegError:
        pass  # the file cannot be read on
    return None


_NAMED_PROBLEMS = 20


def default_store(paths: Sequence[Path]) -> Path:
    """Beside the images: in the folder that is given, or in that of the first file."""
    first = paths[0]
    return (first if first.is_dir() else first.parent) / DEFAULT_NAME


FRAMES = 48
"""Pictures taken of a video, unless told otherwise."""


def image_files(paths: Sequence[Path], frames: int, *, taken: bool = False) -> list[Path]:
    """All pictures among `paths`, in name order; of each video `frames` pictures, which lie in a folder beside it afterwards.

    With `taken` those that lie there already, however many they are, and only without any `frames` new ones.

    Raises AnnotationError when a path is not there, a video cannot be read, or there is no picture at all.
    """
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise AnnotationError(f"{path}: no such file or folder")
        found = _whole(path)
        if path.is_dir() and not found and (path / "images").is_dir():  # a labelled set
            found = _whole(path / "images")
        parts = [file for file in found if is_video(file) and is_of_session(file)]  # one recording, in files of an hour
        there = {file: taken_of(file) for file in found if is_video(file)} if taken else {}
        shares = {} if any(there.get(part) for part in parts) else evenly_over(parts, frames)
        for file in found:
            if not is_video(file):
                files.append(file)
            elif there.get(file):
                files += there[file]
            elif file in parts and not shares:
                continue  # of the session's other files pictures were taken before
            else:
                files += take_frames(file, shares.get(file, evenly(frames)), tell_problems)
    if not files:
        raise AnnotationError(f"{paths[0]}: no picture or video in it")
    return files


def asked_files(paths: Sequence[Path], frames: int | None) -> list[Path]:
    """``image_files`` as a person asks for them: without a number, the pictures that were taken before, or ``FRAMES`` new ones."""
    return image_files(paths, frames or FRAMES, taken=frames is None)


def _whole(path: Path) -> list[Path]:
    """What can be annotated in it: a link that leads nowhere cannot, and keeps nobody from the rest."""
    return [file for file in expand([path]) if file.exists()]


def listed_images(files: Sequence[Path], store: AnnotationStore) -> list[FoundImage]:
    """The files as images that the store knows from then on; what cannot be read is told. Raises AnnotationError without any."""
    with progress_bar() as bar:
        task = bar.add_task("looking at the images", total=len(files))
        images, problems = find_images(files, store, lambda: bar.advance(task))
    tell_problems(problems)
    if not images:
        raise AnnotationError(f"{files[0].parent}: no image that can be read")
    return images


def read_annotated(
    store_path: Path, paths: Sequence[Path], frames: int = FRAMES
) -> tuple[list[StoredAnnotation], list[FoundImage]]:
    """All annotations of a file and those of its images that are here; how many are not is told. Raises AnnotationError.

    Of a video those pictures count that were taken from it before; where there are none, `frames` are taken.
    """
    files = image_files(paths, frames, taken=True)
    with AnnotationStore(store_path, read_only=True) as store:
        annotations = store.annotations()
        images, problems = known_images(files, store)
        tell_problems([*store.problems, *problems])
    annotated, here = {one.key.sha256 for one in annotations}, {image.sha256 for image in images}
    if here and not annotated <= here:
        tell_problems([f"{len(annotated - here)} of {len(annotated)} annotated images are not in {paths[0]}: left out"])
    return annotations, images


def known_images(files: Sequence[Path], store: AnnotationStore) -> tuple[list[FoundImage], list[str]]:
    """Those of the files that the store knows, by their content."""
    records = store.images()
    found: dict[str, FoundImage] = {}
    problems = []
    for path in files:
        try:
            sha256 = image_sha256(path)
        except AnnotationError as error:
            problems.append(str(error))
            continue
        if sha256 in records:
            found.setdefault(sha256, FoundImage(path, records[sha256]))
    return list(found.values()), problems


def of_rater(annotations: list[StoredAnnotation], rater: str | None) -> list[StoredAnnotation]:
    """Those of one rater; None: of all. Raises AnnotationError where there are none."""
    if rater is None:
        return annotations
    own = [one for one in annotations if one.key.rater == rater]
    if not own:
        known = ", ".join(sorted({one.key.rater for one in annotations})) or "nobody"
        raise AnnotationError(f"--rater {rater}: has annotated nothing here; who has: {known}")
    return own


def asked_rater(options: StudyOptions) -> str:
    """Who annotates. Raises AnnotationError for a name that no file can hold."""
    rater = options.rater or own_name()
    try:
        rater.encode()
    except UnicodeEncodeError:
        raise AnnotationError(f"--rater {rater!a}: is no UTF-8; give the name in plain letters") from None
    return rater


def own_name() -> str:
    """Who annotates where nobody says who: the user of this computer."""
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):  # no name for this user id
        return "rater"


def tell_problems(problems: Sequence[str]) -> None:
    """One line each on standard error; many are counted."""
    for line in problems[:_NAMED_PROBLEMS]:
        sys.stderr.write(f"warning: {line}\n")
    if len(problems) > _NAMED_PROBLEMS:
        sys.stderr.write(f"warning: and {len(problems) - _NAMED_PROBLEMS} more\n")


_NONE = "\N{EN DASH}"
_COLUMNS = 5
"""So many raters or pairs fit beside each other into eighty columns."""


def print_agreement(report: Mapping[str, Any], *, within: bool = True) -> None:
    """Tables on standard output: first against second measure, then rater against rater, then all together.

    Without `within` the SD of one manual measure is left to another table.
    """
    console = Console(markup=False, emoji=False)
    name = f"Study {report['study']}" if report["study"] else "Annotations outside studies"
    console.print(f"{name}: {report['annotations']} answers on {report['images']} images", "", sep="\n", highlight=False)
    for title, columns in agreement_tables(report).items():
        _print(console, title, columns)
    for words in (within_words(report) if within else "", between_words(report)):
        if words:
            console.print(words, highlight=False)


def agreement_tables(report: Mapping[str, Any]) -> dict[str, dict[str, dict[str, str]]]:
    """By title: by column (a rater, two raters) the quantities as text."""
    pairs = {f"{row['first']}, {row['second']}": _compared(row) for row in report["pairs"]}
    raters = {rater: _of_rater(row) | _compared(row) for rater, row in report["raters"].items()}
    return {"First against second": raters, "Rater against rater": pairs}


def within_words(report: Mapping[str, Any]) -> str:
    """What one measure is uncertain by, over all raters, in one line; empty where nobody measured an image twice."""
    within = report["within"]
    if not within["n"]:
        return ""
    span = f" (95 % interval {_number(within['ci95'][0], 2)} to {_number(within['ci95'][1], 2)}°)" if within["ci95"] else ""
    return f"SD of one manual measure, over all repeats of {within['n']} images: {_degrees(within['sd_deg'])}{span}"


def between_words(report: Mapping[str, Any]) -> str:
    """All raters together in one line; empty when there is only one."""
    both = report["between"]
    if not both["n"]:
        return ""
    spread = f"SD about an image's mean {_degrees(both['sd_deg'])}, ICC(2,1) {_number(both['icc'], 3)}"
    return f"All {both['raters']} raters on {both['n']} images: {spread}"


def _print(console: Console, title: str, columns: Mapping[str, Mapping[str, str]]) -> None:
    names = list(columns)
    for first in range(0, len(names), _COLUMNS):
        shown = names[first : first + _COLUMNS]
        table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
        table.add_column(title, no_wrap=True)
        for name in shown:
            table.add_column(name, justify="right")
        for quantity in columns[shown[0]]:
            table.add_row(quantity, *(columns[name][quantity] for name in shown))
        console.print(table, "", sep="\n", highlight=False)


def _of_rater(row: Mapping[str, Any]) -> dict[str, str]:
    return {
        "Answers": str(row["annotations"]),
        "of these can't tell": str(row["cannot_tell"]),
        "Median time an image": f"{_number(row['median_time_s'], 0)} s",
        "SD within an image": _degrees(row["sd_deg"]),
    }


def _compared(row: Mapping[str, Any]) -> dict[str, str]:
    angle, state = row["angle"], row["state"]
    return {
        "Images with two angles": str(angle["n"]),
        "Mean difference": _degrees(angle["mean_difference_deg"]),
        "Lower limit of agreement": _degrees(angle["loa_low_deg"]),
        "Upper limit of agreement": _degrees(angle["loa_high_deg"]),
        "ICC(2,1)": _number(angle["icc"], 3),
        "Images with two states": str(state["n"]),
        "Equal states": _NONE if state["equal"] is None else f"{state['equal']:.0%}",
        "Cohen’s kappa": _number(state["kappa"], 3),
        "Only one can’t tell": str(state["one_cannot_tell"]),
        "Neither can tell": str(state["neither_can_tell"]),
    }


def _degrees(value: float | None) -> str:
    return _NONE if value is None else f"{_number(value, 2)}°"


def _number(value: float | None, digits: int) -> str:
    return _NONE if value is None else f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def fitted_alike(
    annotations: Sequence[StoredAnnotation], images: Sequence[FoundImage], config: Config, study: str | None, where: str
) -> tuple[list[StoredAnnotation], list[str]]:
    """The finished answers of one study to the images that are here, measured as the algorithm is, and notes for the reader.

    Raises AnnotationError where there are none, or several studies.
    """
    records = {image.sha256: image.record for image in images}
    done = [one for one in choose_study(annotations, study, where) if one.key.sha256 in records]
    if not done:
        raise AnnotationError(f"{where}: none of its annotated images is here")
    alike, notes = measured_alike(done, records, config.perception)
    return alike, [*rater_notes(alike), *second_measure_notes(alike), *notes]


def compared_rows(
    done: Sequence[StoredAnnotation], images: Sequence[FoundImage], config: Config
) -> tuple[list[Measurement], dict[str, int], str, int]:
    """A row for each image with one of these answers (``fitted_alike``); an interruption (Ctrl-C) keeps what was done until then.

    Returns
    -------
    tuple
        Rows, how often which reason was given on images with a manual state, where the network ran, and how many images were not
        perceived before an interruption.
    """
    from core.files import read_image
    from core.perception.pipeline import open_pipeline

    here = {image.sha256: image for image in images}
    manual = manual_measurements(done, {image.sha256: image.sha256 for image in images})
    pipeline = open_pipeline(config.perception)
    groups = groups_of([here[row.image].path for row in manual])
    rows: list[Measurement] = []
    reasons: Counter[str] = Counter()
    with progress_bar() as bar:
        try:
            for row in bar.track(manual, description="images"):
                image = here[row.image]
                scene = pipeline.perceive_single(Frame(len(rows), 0.0, read_image(image.path)))
                angle, state = (scene.pose.theta_deg, scene.pose.state.value) if scene.pose is not None else (None, None)
                name, group = name_as_text(image.path.name), groups[image.path]
                rows.append(replace(row, image=name, algorithm_angle=angle, algorithm_state=state, group=group))
                if scene.refusal is not None and row.state is not None:
                    reasons[scene.refusal.reason.value] += 1
        except KeyboardInterrupt:
            if not rows:
                raise
    return rows, dict(sorted(reasons.items())), pipeline.engine, len(manual) - len(rows)


def groups_of(pictures: Sequence[Path]) -> dict[Path, str | None]:
    """The group of each picture: pictures of one recording are alike, and so may those of one folder be.

    None where all lie in one folder that is of no recording: nothing is known of what they show, then.
    """
    recordings = {folder: recording_of(folder) for folder in {path.parent for path in pictures}}
    if len(recordings) == 1 and None in recordings.values():
        return dict.fromkeys(pictures)
    places = {found or folder for folder, found in recordings.items()}
    names = _names_of(places) if len(places) > 1 else {place: name_as_text(name_of(place)) for place in places}
    return {path: names[recordings[path.parent] or path.parent] for path in pictures}


def groups_of_answered(answers: Iterable[StoredAnnotation], paths: Mapping[str, Path]) -> dict[str, str | None]:
    """The group of each picture with one of these answers, by SHA-256: what nobody has answered says nothing of who is alike."""
    answered = {one.key.sha256 for one in answers} & paths.keys()
    places = groups_of([paths[sha256] for sha256 in answered])
    return {sha256: places[paths[sha256]] for sha256 in answered}


def _names_of(folders: set[Path]) -> dict[Path, str]:
    """Each folder from the one on that they have in common: sessions may all be called alike inside."""
    common = Path(os.path.commonpath([folder.absolute() for folder in folders]))
    return {folder: name_as_text(folder.absolute().relative_to(common).as_posix()) for folder in folders}


def raters_agreement(done: Sequence[StoredAnnotation], images: Sequence[FoundImage], seed: int) -> dict[str, Any] | None:
    """How well raters agree with themselves and each other by these answers (``fitted_alike``, ``agreement_report``).

    None when nobody measured anything twice.
    """
    raters = {one.key.rater for one in done}
    if len(raters) < 2 and all(one.key.repeat == 1 for one in done):
        return None
    groups = groups_of_answered(done, {image.sha256: image.path for image in images})
    report = agreement_report(done, {image.sha256: name_as_text(image.path.name) for image in images}, seed, groups)
    return {"study": done[0].key.study} | report
