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
        self._first_s: float | None = None
        self._pacer: Pacer[av.VideoFrame] = Pacer()

    @property
    def name(self) -> str:
        return self._path.name

    @property
    def is_live(self) -> bool:
        return False

    def open(self) -> None:
        self._first_s, self._pacer = None, Pacer()
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
        except StopIteration:
            raise EndOfStream(f"{self._path}: end of the video") from None
        except av.error.FFmpegError as error:
            raise DamagedStream(f"{self._path}: damaged after frame {self._index} ({error.strerror or error})") from None
        at = frame.time if frame.time is not None and np.isfinite(frame.time) else self._index / 30.0
        if self._first_s is None:
            self._first_s = at
        return frame, at - self._first_s

    def close(self) -> None:
        self._frames, self._pacer = None, Pacer()
        if self._container is not None:
            self._container.close()
            self._container = None
