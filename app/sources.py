"""What ``perceive`` is given: pictures, folders of pictures, videos. One item per picture, in order, unreadable ones too."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from core.devices import DamagedStream, DeviceError, EndOfStream
from core.errors import UserError
from core.images import ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS
from core.types import Image

VIDEO_ENDINGS = (".mp4", ".mkv", ".avi", ".mov", ".webm", ".m4v")


@dataclass(frozen=True, slots=True, eq=False)
class SourcePicture:
    """One picture of the input; unreadable: ``image`` is None and ``problem`` says why. ``time_s`` is set in videos."""

    name: str
    stem: str
    image: Image | None
    problem: str | None = None
    time_s: float | None = None
    first_of_stream: bool = True


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


def _is_file(path: Path) -> bool:
    """Links that lead nowhere count: who put one there shall hear of it."""
    return path.is_file() or (path.is_symlink() and not path.exists())


def pictures(files: Sequence[Path]) -> Iterator[SourcePicture]:
    """The pictures of all files, one after another; stems are made unique by a number where two files share one.

    A picture that is called like a frame of one of the videos shares its stem, too.
    """
    videos = {path.stem for path in files if path.suffix.lower() in VIDEO_ENDINGS}
    used: set[str] = set()
    for path in files:
        stem, count = path.stem, 1
        frame = re.fullmatch(r"(.+)_\d{6,}", stem)
        if frame is not None and frame[1] in videos:
            used.add(stem)
        while stem in used:
            count += 1
            stem = f"{path.stem}_{count}"
        used.add(stem)
        if path.suffix.lower() in VIDEO_ENDINGS:
            yield from _video(path, stem)
        else:
            try:
                yield SourcePicture(str(path), stem, read_image(path))
            except ImageError as error:
                yield SourcePicture(str(path), stem, None, str(error))


def _video(path: Path, stem: str) -> Iterator[SourcePicture]:
    from hardware.cameras.video_file import VideoFile

    video = VideoFile(path, paced=False)
    index = 0
    try:
        video.open()
        while True:
            frame = video.read(0.0)
            if frame is not None:
                yield SourcePicture(f"{path}#{index}", f"{stem}_{index:06d}", frame.image, None, frame.captured_s, index == 0)
                index += 1
    except EndOfStream as end:
        if index == 0 or isinstance(end, DamagedStream):
            yield SourcePicture(f"{path}#{index}", f"{stem}_{index:06d}", None, str(end))
    except DeviceError as error:
        yield SourcePicture(str(path), stem, None, str(error))
    finally:
        video.close()
