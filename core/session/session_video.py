"""The videos of a recorded session: its rows know how each picture was written, so that no damage in them passes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from core.session.manifest import FRAMES
from core.session.pictures import packet_times, video_number
from core.session.reader import SessionReader
from core.session.video_in import upright
from core.types import Image

Take = Callable[[int], Image | None]
"""The n-th picture of a video, RGB uint8 (H, W, 3); None: it is lost or damaged."""


def is_of_session(video: Path) -> bool:
    """Whether it is the video of a recorded session."""
    is_named_so = video.name.startswith("video_") and video_number(video) is not None
    return is_named_so and (video.absolute().parent / FRAMES).is_file()


def times_of(video: Path) -> list[int]:
    """When its pictures were, in ms, in order."""
    return sorted({pts_ms for pts_ms, _ in packet_times(video)})


@contextmanager
def session_video(video: Path) -> Iterator[tuple[list[int], Take]]:
    """The times of one of a session's videos, and how to take its pictures. Raises SessionError."""
    number = video_number(video)
    assert number is not None
    with SessionReader(video.absolute().parent) as reader:
        reader.wait()
        times_ms = times_of(video)

        def take(index: int) -> Image | None:
            frame = reader.decoded(number, times_ms[index]) if index < len(times_ms) else None
            return upright(frame) if frame is not None else None

        yield times_ms, take
