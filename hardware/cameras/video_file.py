"""A recorded video as a camera, played at its own pace or as fast as it is read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import av
import av.error
import numpy as np

from core.devices import DamagedPicture, DamagedStream, DeviceError, EndOfStream
from core.session.video_in import Damaged, NoPictures, decoded, open_video, pictures_of, upright
from core.types import Frame, Image
from hardware.cameras.pacing import Pacer

_MAY_LACK_S = 1.0
"""A video that does not say how many pictures it has may end so much before its time: the last one may stay for a while."""


class VideoFile:
    """A ``Camera`` over a video file.

    With `paced` the frames come at the speed of the recording and late ones are skipped, as from a camera, and damaged ones are
    lost; without, every frame is given, and for a damaged one DamagedPicture raised, after which the next may be read. A video that
    decodes slower than it was recorded is played slower. ``captured_s`` is the presentation time from the first frame on, in the
    clock of the first read when paced, whenever a frame is handed out.
    """

    def __init__(self, path: Path, *, paced: bool = True) -> None:
        self._path = path
        self._paced = paced
        self._frames: Iterator[av.VideoFrame | Damaged] | None = None
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

    @property
    def is_live(self) -> bool:
        return False

    def open(self) -> None:
        self._count, self._lost, self._first_s, self._end_s, self._pacer = 0, 0, None, 0.0, Pacer()
        try:
            container = open_video(self._path)
        except (av.error.FFmpegError, OSError) as error:
            raise DeviceError(f"{self._path}: cannot be read as a video ({error.strerror or error})") from None
        try:
            stream = pictures_of(container)
        except NoPictures as error:
            container.close()
            raise DeviceError(f"{self._path}: {error}") from None
        stream.thread_type = "SLICE"  # with a thread for each frame nobody could say which one is damaged
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
            raise EndOfStream(f"{self._path}: end of the video") from None
        except av.error.FFmpegError as error:
            where = f"after frame {self._index}" if self._count else "before its first frame"
            raise DamagedStream(f"{self._path}: damaged {where} ({error.strerror or error}), and not read on") from None
        if isinstance(frame, Damaged):
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
