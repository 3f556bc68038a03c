"""Pictures of files: pictures, folders of pictures, and videos. One item per picture, in order, unreadable ones too."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from core.devices import DamagedPicture, DamagedStream, DeviceError, EndOfStream, UserError, disk_errors
from core.files import VIDEO_ENDINGS, ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS
from core.session.manifest import SessionError
from core.session.reader import is_of_session, session_video
from core.types import Image
from hardware.cameras.files import VideoFile


@dataclass(frozen=True, slots=True, eq=False)
class FilePicture:
    """One picture of the input; unreadable: ``image`` None and ``problem`` says why. ``time_s`` is set in videos.

    ``stem`` is unique; ``real_stems`` are what the user may call it by, the nearest first.
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
    """Folders become their pictures and videos in name order; files stay as they are. Links that lead nowhere count."""
    files: list[Path] = []
    for path in paths:
        with disk_errors(UserError, path, "cannot be read"):
            if not path.is_dir():
                files.append(path)
                continue
            named = sorted(file for file in path.iterdir() if file.suffix.lower() in IMAGE_ENDINGS + VIDEO_ENDINGS)
            files += [file for file in named if file.is_file() or (file.is_symlink() and not file.exists())]
    return files


def inner_folders(paths: Sequence[Path]) -> list[Path]:
    """Folders right inside those of `paths` that have pictures or videos, in order; what cannot be read has none."""
    found = []
    for folder in filter(Path.is_dir, paths):
        with contextlib.suppress(OSError, UserError):
            found += [inner for inner in sorted(folder.iterdir()) if inner.is_dir() and expand([inner])]
    return found


def pictures(files: Sequence[Path]) -> Iterator[FilePicture]:
    """The pictures of all files, one after another."""
    for path, stem in zip(files, own_stems(files), strict=True):
        if is_video(path):
            yield from _session_video(path, stem) if is_of_session(path) else _video(path, stem)
        else:
            try:
                yield FilePicture(str(path), stem, (path.stem,), read_image(path))
            except ImageError as error:
                yield FilePicture(str(path), stem, (path.stem,), None, str(error))


def own_stems(files: Sequence[Path]) -> list[str]:
    """A unique stem for each file: its real one, with a number where an earlier file has it already.

    A picture that is called like a frame of one of the videos gets a number, too; a number never makes another file's real stem.
    """
    real, used = {path.stem for path in files}, set[str]()
    videos: set[str] = set()
    stems = [""] * len(files)
    # Videos first: what a picture must not be called is known once they have their stems.
    for place in sorted(range(len(files)), key=lambda place: not is_video(files[place])):
        path = files[place]
        stem, count = path.stem, 1
        is_taken = stem in used or is_frame_of(stem, videos)
        while is_taken:
            count += 1
            stem = f"{path.stem}_{count}"
            is_taken = stem in used or stem in real
        used.add(stem)
        if is_video(path):
            videos.add(stem)
        stems[place] = stem
    return stems


def is_frame_of(stem: str, videos: Collection[str]) -> bool:
    """Whether a frame of one of these videos (given by their stems) has this stem."""
    frame = re.fullmatch(r"(.+)_\d{6,}", stem)
    return frame is not None and frame[1] in videos


def _video(path: Path, stem: str) -> Iterator[FilePicture]:
    """The pictures of a video, damaged ones as problems."""
    video = VideoFile(path, paced=False)
    index, is_first = 0, True
    try:
        video.open()
        while True:
            try:
                frame = video.read(0.0)
            except DamagedPicture as damage:
                yield FilePicture(*_named(path, stem, index), None, str(damage))
                index += 1
                continue
            if frame is not None:
                yield FilePicture(*_named(path, stem, index), frame.image, None, frame.captured_s, is_first)
                index, is_first = index + 1, False
    except EndOfStream as end:
        if is_first or isinstance(end, DamagedStream):
            yield FilePicture(*_named(path, stem, index), None, str(end))
    except DeviceError as error:
        yield FilePicture(str(path), stem, (path.stem,), None, str(error))
    finally:
        video.close()


def _session_video(path: Path, stem: str) -> Iterator[FilePicture]:
    """The pictures of a recorded session, checked for damage by its index."""
    try:
        with session_video(path) as (times_ms, take):
            is_first = True
            for index, at_ms in enumerate(times_ms):
                image = take(index)
                if image is None:
                    yield FilePicture(*_named(path, stem, index), None, f"{path}: picture {index} is lost or damaged")
                    continue
                yield FilePicture(*_named(path, stem, index), image, None, (at_ms - times_ms[0]) / 1000.0, is_first)
                is_first = False
    except SessionError as error:
        yield FilePicture(str(path), stem, (path.stem,), None, str(error))
        return
    if not times_ms:
        yield FilePicture(str(path), stem, (path.stem,), None, f"{path}: no picture in it can be read")


def _named(path: Path, stem: str, index: int) -> tuple[str, str, tuple[str, ...]]:
    """Name and stems of a video's frame."""
    return f"{path}#{index}", f"{stem}_{index:06d}", (f"{path.stem}_{index:06d}", path.stem)
