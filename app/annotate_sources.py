"""What ``annotate`` is given: pictures, folders, labelled sets, sessions, and videos, which become pictures evenly over time."""

from __future__ import annotations

from collections.abc import Sequence
from glob import escape
from pathlib import Path

import av
import av.error
import numpy as np

from app.learning_commands import progress_bar
from app.sources import VIDEO_ENDINGS, expand
from core.learning.dataset import write_png
from core.session.video_in import open_video
from core.study.annotation_store import DEFAULT_NAME
from core.study.annotations import AnnotationError


def default_store(paths: Sequence[Path]) -> Path:
    """Beside the images: in the folder that is given, or in that of the first file."""
    first = paths[0]
    return (first if first.is_dir() else first.parent) / DEFAULT_NAME


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
        for file in found:
            if file.suffix.lower() in VIDEO_ENDINGS:
                files += (_taken_of(file) if taken else []) or _frames_of(file, frames)
            else:
                files.append(file)
    if not files:
        raise AnnotationError(f"{paths[0]}: no picture or video in it")
    return files


def _whole(path: Path) -> list[Path]:
    """What can be annotated in it: a link that leads nowhere cannot, and keeps nobody from the rest."""
    return [file for file in expand([path]) if file.exists()]


def _taken_of(video: Path) -> list[Path]:
    return sorted(_folder_of(video).glob(f"{escape(video.stem)}_*.png"))


def _folder_of(video: Path) -> Path:
    return video.with_name(f"{video.stem}_frames")


def _frames_of(video: Path, count: int) -> list[Path]:
    """Pictures of a video, written once: the same frames are the same files, so that their annotations are found again."""
    folder = _folder_of(video)
    try:
        with open_video(video) as container:
            if not container.streams.video:
                raise AnnotationError(f"{video}: has no video in it")
            stream = container.streams.video[0]
            times = sorted({packet.pts for packet in container.demux(stream) if packet.pts is not None})
            if not times:
                raise AnnotationError(f"{video}: no frame in it can be read")
            chosen = sorted({round(place) for place in np.linspace(0, len(times) - 1, min(count, len(times)))})
            folder.mkdir(exist_ok=True)
            return _write_frames(container, stream, times, chosen, folder, video.stem)
    except av.error.FFmpegError as error:
        raise AnnotationError(f"{video}: cannot be read as a video ({error.strerror or error})") from None
    except OSError as error:
        raise AnnotationError(
            f"{error.filename or folder}: cannot be written ({error.strerror}); copy the video elsewhere"
        ) from None


def _write_frames(
    container: av.container.InputContainer, stream: av.VideoStream, times: list[int], chosen: list[int], folder: Path, stem: str
) -> list[Path]:
    written = []
    with progress_bar() as bar:
        for index in bar.track(chosen, description=f"frames of {stem}"):
            path = folder / f"{stem}_{index:06d}.png"
            if not path.is_file():
                container.seek(times[index], stream=stream, backward=True)
                frame = next((f for f in container.decode(stream) if f.pts is not None and f.pts >= times[index]), None)
                if frame is None:
                    continue
                write_png(path, frame.to_ndarray(format="rgb24"))
            written.append(path)
    return written
