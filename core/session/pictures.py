"""Pictures out of a session's video files, one at a time, by their time: decoded when asked for, never a neighbour's instead."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import av
import av.error
import cv2
import numpy as np

from core.session.packet_check import Known, PacketCheck, PictureRow
from core.session.remux import has_h264
from core.session.video_in import open_video
from core.types import Image

_CACHE_BYTES = 48_000_000
_STEP_MS = 1500
"""So far ahead it is quicker to go on decoding than to seek: a group of pictures is a second long."""
_OPEN_FILES = 2


def video_path(folder: Path, number: int) -> Path:
    return folder / f"video_{number:04d}.mkv"


def video_number(path: Path) -> int | None:
    """Of a video file; None when it is none of ours."""
    digits = path.stem.rpartition("_")[2]
    return int(digits) if digits.isascii() and digits.isdigit() else None


def to_rgb(frame: av.VideoFrame) -> Image:
    """A decoded frame as RGB uint8 (H, W, 3)."""
    if frame.format.name == "yuv420p" and frame.width % 2 == 0 and frame.height % 2 == 0:
        return np.asarray(cv2.cvtColor(frame.to_ndarray(), cv2.COLOR_YUV2RGB_I420), np.uint8)
    return np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)


class _OpenVideo:
    """One file and how far it has been decoded. What cannot be trusted is passed over."""

    def __init__(self, path: Path, known: Known) -> None:
        self._known = known
        self._path = path
        self._open()
        self._frames: Iterator[av.VideoFrame] = self._decode()
        self.at_ms: int | None = None

    def _open(self) -> None:
        self._container = open_video(self._path)
        if not has_h264(self._container):
            self._container.close()
            raise ValueError("has no H.264 video in it")
        self._stream = self._container.streams.video[0]
        self._stream.codec_context.thread_count = 1

    def seek(self, pts_ms: int) -> None:
        """To the key picture at or before it; to the beginning where the file has no index that says where that is."""
        base = self._stream.time_base
        try:
            self._container.seek(max(0, int(pts_ms / 1000 / base)) if base else 0, stream=self._stream)
        except (av.error.FFmpegError, OSError, OverflowError):
            # where its index is damaged too, only opening it again leads back to the beginning
            self._container.close()
            self._open()
        self._frames, self.at_ms = self._decode(), None

    def next(self) -> tuple[int, av.VideoFrame] | None:
        """The next good picture and its time; None at the end of what can be read."""
        for frame in self._frames:
            if frame.pts is None or frame.time_base is None:
                continue
            self.at_ms = round(frame.pts * frame.time_base * 1000)
            return self.at_ms, frame
        return None

    def _decode(self) -> Iterator[av.VideoFrame]:
        check = PacketCheck(self._known)
        packets = self._container.demux(self._stream)
        base = self._stream.time_base
        while True:
            try:
                packet = next(packets)
            except (StopIteration, av.error.FFmpegError, OSError):
                return
            if packet.pts is not None and base is not None:
                pts_ms = round(packet.pts * base * 1000)
                if not check.take(pts_ms, bytes(packet), is_key=packet.is_keyframe, is_corrupt=packet.is_corrupt):
                    continue
            try:
                frames = packet.decode()
            except (av.error.FFmpegError, OSError):
                check.fail()
                continue
            for frame in frames:
                if frame.is_corrupt:
                    check.fail()
                else:
                    yield frame

    def close(self) -> None:
        self._container.close()


class Pictures:
    """The pictures of a session. All methods may be called from any thread; one at a time is served.

    Parameters
    ----------
    known : what the rows tell of the picture of a file at a time; see `PacketCheck`.
    on_problem : is told of each file and each picture that cannot be read, once.
    """

    def __init__(self, folder: Path, known: Callable[[int, int], PictureRow | None], on_problem: Callable[[str], None]) -> None:
        self._known = known
        self._folder = folder
        self._on_problem = on_problem
        self._lock = threading.Lock()
        self._open: OrderedDict[int, _OpenVideo] = OrderedDict()
        self._unreadable: set[int] = set()
        self._missing: set[tuple[int, int]] = set()
        self._cache: OrderedDict[tuple[int, int], av.VideoFrame] = OrderedDict()
        self._cache_bytes = 0

    def picture(self, video: int, pts_ms: int) -> Image | None:
        """The picture of file number `video` at exactly this time; None when it is lost or damaged."""
        frame = self.decoded(video, pts_ms)
        return to_rgb(frame) if frame is not None else None

    def decoded(self, video: int, pts_ms: int) -> av.VideoFrame | None:
        """The same as it was decoded."""
        with self._lock:
            key = video, pts_ms
            if key not in self._cache and key not in self._missing:
                self._decode_up_to(video, pts_ms)
            frame = self._cache.get(key)
            if frame is None:
                self._miss(video, pts_ms)
                return None
            self._cache.move_to_end(key)
            return frame

    def close(self) -> None:
        with self._lock:
            for video in self._open.values():
                video.close()
            self._open.clear()
            self._cache.clear()

    def _miss(self, video: int, pts_ms: int) -> None:
        if (video, pts_ms) not in self._missing:
            self._missing.add((video, pts_ms))
            if video not in self._unreadable:
                self._on_problem(f"{video_path(self._folder, video).name}: no picture at {pts_ms / 1000:.3f} s")

    def _decode_up_to(self, number: int, pts_ms: int) -> None:
        video = self._video(number)
        if video is None:
            return
        if video.at_ms is None or not 0 < pts_ms - video.at_ms <= _STEP_MS:
            try:
                video.seek(pts_ms)
            except (av.error.FFmpegError, OSError, ValueError) as error:
                self._give_up(number, error)
                return
        while (found := video.next()) is not None:
            at_ms, frame = found
            self._keep((number, at_ms), frame)
            if at_ms >= pts_ms:
                return
        # at its end the decoder gives no more: it must be sought again
        video.at_ms = None

    def _keep(self, key: tuple[int, int], frame: av.VideoFrame) -> None:
        if key in self._cache:
            return
        self._cache[key] = frame
        self._cache_bytes += _size(frame)
        while self._cache_bytes > _CACHE_BYTES and len(self._cache) > 1:
            _, old = self._cache.popitem(last=False)
            self._cache_bytes -= _size(old)

    def _video(self, number: int) -> _OpenVideo | None:
        if number in self._open:
            self._open.move_to_end(number)
            return self._open[number]
        if number in self._unreadable:
            return None
        try:
            self._open[number] = _OpenVideo(video_path(self._folder, number), partial(self._known, number))
        except (av.error.FFmpegError, OSError, ValueError) as error:
            self._give_up(number, error)
            return None
        while len(self._open) > _OPEN_FILES:
            self._open.popitem(last=False)[1].close()
        return self._open[number]

    def _give_up(self, number: int, error: Exception) -> None:
        self._unreadable.add(number)
        self._open.pop(number, None)
        reason = getattr(error, "strerror", None) or error
        self._on_problem(f"{video_path(self._folder, number).name}: cannot be read as a video ({reason})")


def _size(frame: Any) -> int:
    return int(frame.width) * int(frame.height) * 3


def packet_times(path: Path) -> list[tuple[int, bool]]:
    """Time in ms and "is a key picture" of all packets that can be read, without decoding; empty when it is no video."""
    found: list[tuple[int, bool]] = []
    try:
        with open_video(path) as container:
            if not container.streams.video:
                return []
            stream = container.streams.video[0]
            for packet in container.demux(stream):
                if packet.pts is not None and stream.time_base is not None:
                    found.append((round(packet.pts * stream.time_base * 1000), packet.is_keyframe))
    except (av.error.FFmpegError, OSError):
        pass
    return found
