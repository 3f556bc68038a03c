"""Pictures taken of a video, once: in a folder beside it that knows whose they are, so that annotations find them again."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path

import av
import av.error
import numpy as np

from app.long_work import progress_bar
from app.sources import is_video
from core.images import ImageError, read_image
from core.learning.dataset import write_png
from core.session.session_video import Take, is_of_session, session_video, times_of
from core.session.video_in import NoPictures, decoded, is_avi, open_video, pictures_of, upright
from core.study.annotations import AnnotationError
from core.types import Image

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
