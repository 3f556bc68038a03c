"""Files as a camera: a folder of pictures, shown one after another, and a recorded video."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Generic, TypeVar

import av
import av.error
import numpy as np

from core.devices import DamagedPicture, DamagedStream, DeviceError, EndOfStream
from core.files import ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS
from core.session.video import NoPictures, UndecodablePicture, decoded, open_video, pictures_of, upright
from core.types import Frame, Image


class ImageFolder:
    """A ``Camera`` over pictures, in name order. Unreadable ones are skipped; none readable is an error at ``open``."""

    def __init__(self, path: Path, *, period_s: float = 0.5) -> None:
        self._path = path
        self._period_s = period_s
        self._files: list[Path] = []
        self._image: Image | None = None
        self._next = 0
        self._index = -1
        self._due_s = 0.0

    @property
    def name(self) -> str:
        return self._path.name

    def open(self) -> None:
        if self._path.is_dir():
            self._files = sorted(p for p in self._path.iterdir() if p.suffix.lower() in IMAGE_ENDINGS)
        elif self._path.exists():
            self._files = [self._path]
        if not self._files:
            raise DeviceError(f"{self._path}: no picture there (looked for {', '.join(IMAGE_ENDINGS)})")
        self._advance()
        if self._image is None:
            raise DeviceError(f"{self._path}: none of {len(self._files)} pictures can be read")

    def read(self, timeout_s: float) -> Frame | None:
        wait = self._due_s - time.monotonic()
        if wait > timeout_s:
            time.sleep(timeout_s)
            return None
        time.sleep(max(0.0, wait))
        if self._index >= 0:
            self._advance()
        self._index += 1
        self._due_s = time.monotonic() + self._period_s
        assert self._image is not None
        return Frame(self._index, time.monotonic(), self._image)

    def _advance(self) -> None:
        """Load the next readable picture; at the end the last one stays."""
        while self._next < len(self._files):
            path = self._files[self._next]
            self._next += 1
            try:
                self._image = read_image(path)
                return
            except ImageError:
                continue

    def close(self) -> None:
        self._image = None
        self._files = []


LATE_S = 0.1
"""A frame that is this late is skipped."""

F = TypeVar("F")


class Pacer(Generic[F]):
    """Gives each frame when it is due. Late ones are skipped, as from a camera; a video that decodes too slowly is played
    slower."""

    def __init__(self) -> None:
        self._start_s: float | None = None
        self._pending: tuple[F, float] | None = None

    def next(self, decode: Callable[[], tuple[F, float]], timeout_s: float) -> tuple[F, float] | None:
        """The next frame and when it was due (monotonic); None when that is later than in `timeout_s`: then it is kept.

        `decode` gives the next frame and its seconds from the first one on.
        """
        entered_s = time.monotonic()
        while True:
            frame, at_s = self._pending or decode()
            self._pending = None
            now_s = time.monotonic()
            if self._start_s is None:
                self._start_s = now_s - at_s
            late_s = now_s - (self._start_s + at_s)
            left_s = entered_s + timeout_s - now_s
            if -late_s > max(left_s, 0.0):
                self._pending = frame, at_s
                time.sleep(max(left_s, 0.0))
                return None
            if late_s >= LATE_S:
                if left_s > 0.0:
                    continue
                # Decoding is slower than the recording.
                self._start_s += late_s
            time.sleep(max(-late_s, 0.0))
            return frame, self._start_s + at_s


_MAY_LACK_S = 1.0
"""A video that does not say how many pictures it has may end so much before its time: the last one may stay for a while."""


class VideoFile:
    """A ``Camera`` over a video file.

    With `paced` the frames come at the speed of the recording; late ones are skipped, as from a camera, and damaged ones are lost.
    Without, every frame is given, and a damaged one raises DamagedPicture, after which the next may be read. ``captured_s`` is the
    presentation time from the first frame on, in the clock of the first read when paced.
    """

    def __init__(self, path: Path, *, paced: bool = True) -> None:
        self._path = path
        self._paced = paced
        self._frames: Iterator[av.VideoFrame | UndecodablePicture] | None = None
        self._container: av.container.InputContainer | None = None
        self._index = -1
        self._count = 0
        self._lost = 0
        self._first_s: float | None = None
        self._end_s = 0.0
        self._pacer: Pacer[av.VideoFrame] = Pacer()

    @property
    def name(self) -> str:
        return self._path.name

    def open(self) -> None:
        self._count, self._lost, self._first_s, self._end_s, self._pacer = 0, 0, None, 0.0, Pacer()
        try:
            container = open_video(self._path)
        except (av.error.FFmpegError, OSError) as error:
            raise DeviceError("{path}: cannot be read as a video ({why})", path=self._path, why=error.strerror or error) from None
        try:
            stream = pictures_of(container)
        except NoPictures as error:
            container.close()
            raise DeviceError(f"{self._path}: {error}") from None
        stream.thread_type = "SLICE"  # threads by frame hide which frame is damaged
        self._container, self._frames = container, decoded(container, stream)

    def read(self, timeout_s: float) -> Frame | None:
        if not self._paced:
            frame, at_s = self._decode()
            return Frame(self._index, at_s, self._rgb(frame))
        due = self._pacer.next(self._decode_whole, timeout_s)
        return None if due is None else Frame(self._index, due[1], self._rgb(due[0]), self._lost)

    def _rgb(self, frame: av.VideoFrame) -> Image:
        assert self._container is not None
        return upright(frame, self._container.streams.video[0])

    def _decode_whole(self) -> tuple[av.VideoFrame, float]:
        while True:
            try:
                return self._decode()
            except DamagedPicture:
                self._lost += 1

    def _decode(self) -> tuple[av.VideoFrame, float]:
        if self._frames is None:
            raise DeviceError(f"{self._path}: not open")
        try:
            frame = next(self._frames)
            self._index += 1
            self._count += 1
        except StopIteration:
            if lack := self._lack():
                raise DamagedStream(f"{self._path}: cut short: {lack}") from None
            raise EndOfStream("{path}: end of the video", path=self._path) from None
        except av.error.FFmpegError as error:
            where = f"after frame {self._index}" if self._count else "before its first frame"
            raise DamagedStream(f"{self._path}: damaged {where} ({error.strerror or error}), and not read on") from None
        if isinstance(frame, UndecodablePicture):
            assert self._container is not None
            base = self._container.streams.video[0].time_base
            if frame.pts is not None and base is not None:
                self._end_s = max(self._end_s, float(frame.pts * base))
            raise DamagedPicture(f"{self._path}: picture {self._index} is damaged")
        at = frame.time if frame.time is not None and np.isfinite(frame.time) else self._index / 30.0
        if self._first_s is None:
            self._first_s = at
        self._end_s = at + float((frame.duration or 0) * (frame.time_base or 0))
        return frame, at - self._first_s

    def _lack(self) -> str:
        """How much came of what the file says that it holds; empty where all came, or where it says nothing of it."""
        assert self._container is not None
        stream = self._container.streams.video[0]
        if stream.duration is not None and stream.time_base is not None:
            length_s, end_s = float(stream.duration * stream.time_base), self._end_s - (self._first_s or 0.0)
        elif self._container.duration is not None and len(self._container.streams) == 1:
            length_s, end_s = self._container.duration / av.time_base, self._end_s
        else:
            return ""
        if self._count < stream.frames and length_s - end_s > 1.5 * length_s / max(1, self._count):
            return f"{self._count} of {stream.frames} pictures"
        return f"{end_s:.1f} of {length_s:.1f} s" if not stream.frames and length_s - end_s > _MAY_LACK_S else ""

    def close(self) -> None:
        self._frames, self._pacer = None, Pacer()
        if self._container is not None:
            self._container.close()
            self._container = None
