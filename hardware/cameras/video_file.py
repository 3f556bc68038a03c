"""A recorded video as a camera, played at its own pace or as fast as it is read."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import av
import av.error
import numpy as np

from core.devices import DeviceError, EndOfStream
from core.types import Frame, Image


def _rgb(frame: av.VideoFrame) -> Image:
    return np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)


class VideoFile:
    """A ``Camera`` over a video file.

    With `paced` the frames come at the speed of the recording and late ones are skipped, as from a camera; without, every frame is
    given. ``captured_s`` is the presentation time from the first frame on, in the clock of the first read when paced.
    """

    def __init__(self, path: Path, *, paced: bool = True) -> None:
        self._path = path
        self._paced = paced
        self._frames: Iterator[av.VideoFrame] | None = None
        self._container: av.container.InputContainer | None = None
        self._index = -1
        self._start_s = 0.0
        self._first_s: float | None = None

    @property
    def name(self) -> str:
        return self._path.name

    @property
    def is_live(self) -> bool:
        return False

    def open(self) -> None:
        try:
            self._container = av.open(str(self._path))
            if not self._container.streams.video:
                raise DeviceError(f"{self._path}: has no video in it")
            stream = self._container.streams.video[0]
            stream.thread_type = "AUTO"
            self._frames = self._container.decode(stream)
        except (av.error.FFmpegError, OSError) as error:
            raise DeviceError(f"{self._path}: cannot be read as a video ({error.strerror or error})") from None

    def read(self, timeout_s: float) -> Frame | None:
        while True:
            frame, at_s = self._decode()
            self._index += 1
            if not self._paced:
                return Frame(self._index, at_s, _rgb(frame))
            due = self._start_s + at_s
            late = time.monotonic() - due
            if late < 0.1:
                if late < 0:
                    time.sleep(-late)
                return Frame(self._index, time.monotonic(), _rgb(frame))

    def _decode(self) -> tuple[av.VideoFrame, float]:
        if self._frames is None:
            raise DeviceError(f"{self._path}: not open")
        try:
            frame = next(self._frames)
        except StopIteration:
            raise EndOfStream(f"{self._path}: end of the video") from None
        except av.error.FFmpegError as error:
            raise EndOfStream(f"{self._path}: damaged after frame {self._index} ({error.strerror or error})") from None
        at = frame.time if frame.time is not None and np.isfinite(frame.time) else (self._index + 1) / 30.0
        if self._first_s is None:
            self._first_s = at
            self._start_s = time.monotonic()
        return frame, at - self._first_s

    def close(self) -> None:
        self._frames = None
        if self._container is not None:
            self._container.close()
            self._container = None
