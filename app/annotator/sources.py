"""What ``annotate`` works on: its options, the pictures among files, folders, sessions and videos, and their annotations.

Pictures of a video are extracted once, into a folder beside it that records which video they are of.
"""

from __future__ import annotations

import getpass
import hashlib
import json
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from glob import escape
from pathlib import Path

import av
import av.error
import numpy as np

from core.annotation.model import AnnotationError
from core.annotation.store import DEFAULT_NAME, AnnotationStore, FoundImage, StoredAnnotation, find_images, image_sha256
from core.files import ImageError, read_image
from core.learning.dataset import write_png
from core.session.reader import SessionReader, Take, check_is_session, is_of_session, session_video, times_of
from core.session.video import NoPictures, decoded, is_avi, open_video, pictures_of, upright, video_number
from core.types import Image
from hardware.cameras.picture_files import expand, is_video


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
    show_angle: bool | None = None

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
    """Of each video; None: those that were extracted before, or ``FRAMES`` new ones."""
    rows: str | None = None
    """Of one session instead: row numbers with commas between, or ``REFUSED``."""
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


# ---- pictures of a video

FRAMES = 48
"""Pictures extracted of a video by default."""
REFUSED = "refused"
"""Instead of row numbers: rows without a pose, at most ``FRAMES``, evenly over their number."""
_VIDEO_RECORD = "video.json"
"""In a folder of pictures: the fingerprint of their video."""
_FRAMES_SUFFIX = "_frames"
_END_BYTES = 1_000_000
"""The fingerprint of a video is of so many bytes at its beginning and end."""
_SAME_LEVELS = 8.0
"""By so many grey levels two decoders' pictures of one frame differ at most, on average."""

Choose = Callable[[int], Sequence[int]]
"""Which of so many pictures of a video."""


def extracted_pictures(session: Path) -> list[Path]:
    """The pictures that were extracted from a session."""
    return sorted(session.glob(f"*{_FRAMES_SUFFIX}/*.png"))


def recording_of(folder: Path) -> Path | None:
    """The session that the pictures of a folder were extracted from, or the folder itself for those of one video; None: unknown."""
    if folder.name.endswith(_FRAMES_SUFFIX) and is_of_session(folder.with_name(f"{folder.name.removesuffix(_FRAMES_SUFFIX)}.mkv")):
        return folder.absolute().parent
    return folder if (folder / _VIDEO_RECORD).is_file() else None


def recorded_angles(folder: Path) -> dict[int, tuple[float, float | None]]:
    """By number of the picture in its video, the time (s) and, of a session, the algorithm's signed angle (degrees, None: refused).

    Empty for a folder that was not extracted from a video that is still there.
    """
    name = folder.name.removesuffix(_FRAMES_SUFFIX)
    beside = [path for path in sorted(folder.parent.glob(f"{escape(name)}*")) if is_video(path) and name in (path.name, path.stem)]
    if name == folder.name or not beside:
        return {}
    video = beside[0]
    times_ms = times_of(video)
    if not is_of_session(video):
        return {index: ((time_ms - times_ms[0]) / 1000.0, None) for index, time_ms in enumerate(times_ms)}
    number, index_of = video_number(video), {time_ms: index for index, time_ms in enumerate(times_ms)}
    with SessionReader(folder.absolute().parent) as reader:
        reader.wait()
        line = reader.timeline()
    found: dict[int, tuple[float, float | None]] = {}
    for place in np.flatnonzero(line.video == number).tolist():
        index, theta = index_of.get(int(line.pts_ms[place])), float(line.theta_deg[place])
        if index is not None:
            found[index] = round(float(line.time_s[place] - line.time_s[0]), 6), None if math.isnan(theta) else theta
    return found


def _evenly(count: int) -> Choose:
    """`count` pictures evenly over time, or all where there are fewer."""
    return lambda total: sorted({round(place) for place in np.linspace(0, total - 1, min(count, total))})


def _evenly_over(videos: Sequence[Path], count: int) -> dict[Path, Choose]:
    """`count` pictures evenly over several videos that follow each other, as the files of one session do."""
    lengths = [len(times_of(video)) for video in videos]
    chosen, begin = _evenly(count)(sum(lengths)) if sum(lengths) else [], 0
    shares: dict[Path, Choose] = {}
    for video, length in zip(videos, lengths, strict=True):
        places = [place - begin for place in chosen if begin <= place < begin + length]
        shares[video] = lambda _total, places=places: places  # type: ignore[misc]
        begin += length
    return shares


def extract_frames(video: Path, choose: Choose) -> list[Path]:
    """Extract the chosen pictures of a video; those that were extracted before stay as they are.

    A frame that is lost or damaged is left out with a warning: decoders conceal damage, and what they show must not be measured.

    Raises
    ------
    AnnotationError
        The video cannot be read, the folder beside it cannot be written, or holds another video's pictures.
    """
    from app.commands.progress import progress_bar  # loads rich, which no window needs

    folder = _frames_folder(video)
    written: list[Path] = []
    try:
        with _opened(video) as (total, take), progress_bar() as bar:
            chosen = choose(total)
            folder.mkdir(exist_ok=True)
            _claim_folder(folder, video, take)
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
        where = error.filename or folder
        raise AnnotationError(f"{where}: cannot be written ({error.strerror}); copy the video elsewhere") from None
    if len(written) < len(chosen):
        print_warnings([f"{video}: {len(chosen) - len(written)} of {len(chosen)} chosen frames are lost or damaged: left out"])
    return written


def _frames_folder(video: Path) -> Path:
    """Beside the video, with its name; with its ending, too, where another video has the same name: run.mp4 and run.mkv."""
    twins = [path for path in video.parent.glob(f"{escape(video.stem)}.*") if is_video(path) and path.name != video.name]
    return video.with_name(f"{video.name if twins else video.stem}{_FRAMES_SUFFIX}")


def _extracted_frames(video: Path) -> list[Path]:
    """The pictures that were extracted before; raises AnnotationError where they are of another video."""
    folder = _frames_folder(video)
    found = sorted(folder.glob(f"{escape(video.stem)}_*.png"))
    if found:
        _check_owner(folder, video)
    return found


def _claim_folder(folder: Path, video: Path, take: Take) -> None:
    """Record in the folder which video its pictures are of; in a folder without a record one of them is compared with the video."""
    _check_owner(folder, video)
    if (folder / _VIDEO_RECORD).exists() or is_of_session(video):
        return
    for path in sorted(folder.glob(f"{escape(video.stem)}_*.png"))[:1]:
        number = path.stem.removeprefix(f"{video.stem}_")
        if not _is_alike(path, take(int(number)) if number.isascii() and number.isdigit() else None):
            raise _other_video(folder, video)
    with suppress(OSError):  # on a read-only disk where all pictures are there already
        (folder / _VIDEO_RECORD).write_text(json.dumps(_fingerprint(video)) + "\n", encoding="utf-8")


def _check_owner(folder: Path, video: Path) -> None:
    """Raise AnnotationError where the folder records another video."""
    try:
        recorded = json.loads((folder / _VIDEO_RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return
    if recorded != _fingerprint(video):
        raise _other_video(folder, video)


def _other_video(folder: Path, video: Path) -> AnnotationError:
    return AnnotationError(f"{folder}: holds pictures of another video than {video.name} is now; move it away, or rename the video")


def _fingerprint(video: Path) -> dict[str, object]:
    """Tells a video from another one of its name, without reading all of it."""
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
        return True  # reported when it is to be shown
    if image is None or written.shape != image.shape:
        return image is None
    return float(np.abs(written.astype(np.int16) - image).mean()) <= _SAME_LEVELS


@contextmanager
def _opened(video: Path) -> Iterator[tuple[int, Take]]:
    """How many pictures a video has, and how to decode one. Raises AnnotationError, av.error.FFmpegError, OSError."""
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
            yield len(times), _SequentialDecoder(container, stream)
        else:
            yield len(times), lambda index: _picture_at(container, stream, times[index]) if index < len(times) else None


class _SequentialDecoder:
    """The picture at a place among all, decoded one after the other, where times and seeking are not reliable."""

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


def _picture_at(container: av.container.InputContainer, stream: av.VideoStream, pts: int) -> Image | None:
    """The picture of exactly this time, not a neighbour's instead."""
    container.seek(pts, stream=stream, backward=True)
    with suppress(av.error.FFmpegError):  # the file cannot be read on
        for frame in decoded(container, stream):
            if frame.pts == pts:
                return upright(frame, stream) if isinstance(frame, av.VideoFrame) else None
            if frame.pts is not None and frame.pts > pts:
                return None
    return None


# ---- pictures and their annotations


def default_store(paths: Sequence[Path]) -> Path:
    """Beside the images: in the folder that is given, or in that of the first file."""
    first = paths[0]
    return (first if first.is_dir() else first.parent) / DEFAULT_NAME


def image_files(paths: Sequence[Path], frames: int | None, *, reuse: bool = False) -> list[Path]:
    """All pictures among `paths`, in name order; of each video `frames` pictures, which lie in a folder beside it afterwards.

    Without a number, or with `reuse`, those that were extracted before, however many they are; without any, `frames` (or
    ``FRAMES``) new ones. Raises AnnotationError when a path does not exist, a video cannot be read, or there is no picture at all.
    """
    files: list[Path] = []
    reuse, frames = reuse or frames is None, frames or FRAMES
    for path in paths:
        if not path.exists():
            raise AnnotationError(f"{path}: no such file or folder")
        found = _existing(path)
        if path.is_dir() and not found and (path / "images").is_dir():  # a labelled set
            found = _existing(path / "images")
        parts = [file for file in found if is_video(file) and is_of_session(file)]  # one recording, in files of an hour
        extracted = {file: _extracted_frames(file) for file in found if is_video(file)} if reuse else {}
        shares = {} if any(extracted.get(part) for part in parts) else _evenly_over(parts, frames)
        for file in found:
            if not is_video(file):
                files.append(file)
            elif extracted.get(file):
                files += extracted[file]
            elif file in parts and not shares:
                continue  # pictures were extracted of the session's other files
            else:
                files += extract_frames(file, shares.get(file, _evenly(frames)))
    if not files:
        raise AnnotationError(f"{paths[0]}: no picture or video in it")
    return files


def session_rows(session: Path, chosen: str) -> list[Path]:
    """Pictures of single rows of a session, which lie in folders beside its videos afterwards.

    Parameters
    ----------
    session : its folder.
    chosen : row numbers with commas between, or ``REFUSED``.

    Raises
    ------
    AnnotationError
        No such row, no row that was refused, or a picture cannot be read.
    SessionError
        There is no session.
    """
    check_is_session(session)
    with SessionReader(session) as reader:
        reader.wait()
        known, videos = reader.timeline(), {video_number(path): path for path in reader.videos}
    if chosen == REFUSED:
        refused = np.flatnonzero(known.state < 0)
        places = [int(refused[place]) for place in _evenly(FRAMES)(len(refused))] if len(refused) else []
        if not places:
            raise AnnotationError(f"{session}: every row has a pose; give row numbers, such as --rows 12,40")
    else:
        places = _places_of_rows(session, chosen, known.row.tolist())
    files: list[Path] = []
    for number in sorted({int(known.video[place]) for place in places}):
        if number not in videos:
            print_warnings([f"{session}: the video file {number} is missing; its rows are left out"])
            continue
        times = {time_ms: index for index, time_ms in enumerate(times_of(videos[number]))}
        pictures = [times.get(int(known.pts_ms[place])) for place in places if known.video[place] == number]
        there = sorted({index for index in pictures if index is not None})
        if len(there) < len(pictures):
            print_warnings([f"{videos[number]}: {len(pictures) - len(there)} chosen rows have no picture of their own: left out"])
        files += extract_frames(videos[number], lambda _total, there=there: there) if there else []  # type: ignore[misc]
    if not files:
        raise AnnotationError(f"{session}: none of the chosen rows has a picture")
    return files


def _places_of_rows(session: Path, chosen: str, rows: list[int]) -> list[int]:
    texts = [text.strip() for text in chosen.split(",") if text.strip()]
    if not texts or not all(text.isascii() and text.isdigit() for text in texts):
        raise AnnotationError(f"--rows {chosen}: must be row numbers with commas between, such as 12,40, or {REFUSED}")
    places = {row: place for place, row in enumerate(rows)}
    missing = [text for text in texts if int(text) not in places]
    if missing:
        there = f"its rows are {rows[0]} to {rows[-1]}" if rows else "it has none"
        raise AnnotationError(f"{session}: no row {missing[0]}; {there}")
    return sorted({places[int(text)] for text in texts})


def _existing(path: Path) -> list[Path]:
    """The files in it, without links that lead nowhere."""
    return [file for file in expand([path]) if file.exists()]


def listed_images(files: Sequence[Path], store: AnnotationStore) -> list[FoundImage]:
    """Enter the files into the store as images, with a warning for each unreadable one. Raises AnnotationError if all are."""
    from app.commands.progress import progress_bar

    with progress_bar() as bar:
        task = bar.add_task("images looked at", total=len(files))
        images, problems = find_images(files, store, lambda: bar.advance(task))
    print_warnings(problems)
    if not images:
        raise AnnotationError(f"{files[0].parent}: no image that can be read")
    return images


def read_annotated(
    store_path: Path, paths: Sequence[Path], frames: int | None = None
) -> tuple[list[StoredAnnotation], list[FoundImage]]:
    """All annotations of a file and those of its images that are here, with a warning for the others. Raises AnnotationError."""
    files = image_files(paths, frames, reuse=True)
    with AnnotationStore(store_path, read_only=True) as store:
        annotations = store.annotations()
        images, problems = known_images(files, store)
        print_warnings([*store.problems, *problems])
    annotated, here = {one.key.sha256 for one in annotations}, {image.sha256 for image in images}
    if here and not annotated <= here:
        print_warnings([f"{len(annotated - here)} of {len(annotated)} annotated images are not in {paths[0]}: left out"])
    return annotations, images


def known_images(files: Sequence[Path], store: AnnotationStore) -> tuple[list[FoundImage], list[str]]:
    """Those of the files whose content the store knows, and what could not be read."""
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
    """Those of one rater; None: of all. Raises AnnotationError if the list is empty."""
    if rater is None:
        return annotations
    own = [one for one in annotations if one.key.rater == rater]
    if not own:
        known = ", ".join(sorted({one.key.rater for one in annotations})) or "nobody"
        raise AnnotationError(f"--rater {rater}: has annotated nothing here; who has: {known}")
    return own


def rater_name(options: StudyOptions) -> str:
    """Who annotates: by default the user of this computer. Raises AnnotationError for a name that no file can hold."""
    try:
        rater = options.rater or getpass.getuser()
    except (KeyError, OSError, ImportError):  # no name for this user id
        rater = "rater"
    try:
        rater.encode()
    except UnicodeEncodeError:
        raise AnnotationError(f"--rater {rater!a}: is no UTF-8; give the name in plain letters") from None
    return rater


_NAMED_PROBLEMS = 20


def print_warnings(problems: Sequence[str]) -> None:
    """One line each on standard error; beyond ``_NAMED_PROBLEMS`` they are only counted."""
    for line in problems[:_NAMED_PROBLEMS]:
        sys.stderr.write(f"warning: {line}\n")
    if len(problems) > _NAMED_PROBLEMS:
        sys.stderr.write(f"warning: and {len(problems) - _NAMED_PROBLEMS} more\n")
