"""A recorded video as a camera, played at its own pace or as fast as it is read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import av.error
import numpy as np

from core.devices import DamagedStream, DeviceError, EndOfStream
from core.session.video_in import open_video
from core.types import Frame, Image
from hardware.cameras.pacing import Pacer

_MAY_LACK_S = 1.0
"""A video that does not say how many pictures it has may end so much before its time: the last one may stay for a while."""


def _rgb(frame: av.VideoFrame) -> Image:
    return np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)


class VideoFile:
    """A ``Camera`` over a video file.

    With `paced` the frames come at the speed of the recording and late ones are skipped, as from a camera; without, every frame is
    given. A video that decodes slower than it was recorded is played slower. ``captured_s`` is the presentation time from the first
    frame on, in the clock of the first read when paced.
    """

    def __init__(self, path: Path, *, paced: bool = True) -> None:
        self._path = path
        self._paced = paced
        self._frames: Iterator[av.VideoFrame] | None = None
        self._container: av.container.InputContainer | None = None
        self._index = -1
        self._count = 0
        self._first_s: float | None = None
        self._end_s = 0.0
        self._pacer: Pacer[av.VideoFrame] = Pacer()

    @property
    def name(self) -> str:
        return self._path.name

    @property
    def is_live(self) -> bool:
        return False

    def open(self) -> None:
        self._count, self._first_s, self._end_s, self._pacer = 0, None, 0.0, Pacer()
        try:
            container = open_video(self._path)
        except (av.error.FFmpegError, OSError) as error:
            raise DeviceError(f"{self._path}: cannot be read as a video ({error.strerror or error})") from None
        if not container.streams.video:
            container.close()
            raise DeviceError(f"{self._path}: has no video in it")
        stream = container.streams.video[0]
        stream.thread_type = "AUTO"
        self._container, self._frames = container, container.decode(stream)

    def read(self, timeout_s: float) -> Frame | None:
        if not self._paced:
            frame, at_s = self._decode()
            return Frame(self._index, at_s, _rgb(frame))
        due = self._pacer.next(self._decode, timeout_s)
        return None if due is None else Frame(self._index, due[1], _rgb(due[0]))

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
            raise EndOfStream(f"{self._path}: end of the video") from None
        except av.error.FFmpegError as error:
            where = f"after frame {self._index}" if self._count else "before its first frame"
            raise DamagedStream(f"{self._path}: damaged {where} ({error.strerror or error})") from None
        at = frame.time if frame.time is not None and np.isfinite(frame.time) else self._index / 30.0
        if self._first_s is None:
            self._first_s = at
        self._end_s = at + float((frame.duration or 0) * (frame.time_base or 0))
        return frame, at - self._first_s

    def _lack(self) -> str:
        """How much came of what the file says that it holds; empty where all came, or where it says nothing of it.

        A trimmed file still counts the pictures that are not to be shown, but knows its length; of several streams any may be the
        longest.
        """
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
