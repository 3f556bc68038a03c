"""Pictures to packets, and packets to a video file that survives the death of its writer.

Measured at 640x480 with a kill after some seconds: Matroska with its clusters closed every 200 ms and flushed packet by packet
loses 0.2 s; MP4 loses everything. ``ultrafast`` at crf 21 costs 2.3 ms a frame on one core and 9 MB a minute in the twin; a bound
on the rate keeps a noisy camera from filling the disk. RGB without loss (x264, qp 0) costs 10 ms and 1 GB a minute; FFV1 takes
27 ms for the same size.
"""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import av.error
import cv2
import numpy as np
from av.video.frame import PictureType

from core.record_config import GOP_FRAMES, RecordConfig
from core.session.packet_check import checksum_with_codes
from core.types import Image

MS = Fraction(1, 1000)
LOSSY, LOSSLESS = "libx264", "libx264rgb"
LIVE_OPTIONS = {"flush_packets": "1", "cluster_time_limit": "200"}
_NOMINAL_FPS = 30
_GLOBAL_HEADER = 1 << 22


def media_name(path: Path) -> str:
    """The path as the video library takes it: what stands before a colon in a relative one would be a protocol's name."""
    return os.path.abspath(path)


class VideoError(Exception):
    """The encoder or the video file gave up; the recorder stops with this line."""


@dataclass(frozen=True, slots=True)
class Packet:
    """One encoded picture. ``pts_ms`` counts from the encoder's first picture; ``crc`` is its checksum (``packet_check``)."""

    data: bytes
    pts_ms: int
    is_key: bool
    crc: int = 0


class FrameEncoder:
    """Turns pictures of one size into packets, one for one and without delay.

    Its packets may go to several files, each beginning at a key picture; `template` tells those files what is in them.
    """

    def __init__(self, size: tuple[int, int], config: RecordConfig) -> None:
        self.size = size
        self._lossless = config.codec == "lossless"
        self._even = size[0] % 2 == 0 and size[1] % 2 == 0
        self._pts_ms = -1
        self._zero_s: float | None = None
        # A container that writes nowhere: only as part of one does PyAV hand out the stream that files are made after.
        self._container: Any = av.open(os.devnull, "w", format="null")
        self.template: Any
        try:
            codec = LOSSLESS if self._lossless else LOSSY
            self.template = self._container.add_stream(codec, rate=_NOMINAL_FPS, options=_options(size, config))
            self.template.width, self.template.height = size
            self.template.pix_fmt = "rgb24" if self._lossless else "yuv420p" if self._even else "yuv444p"
            context = self.template.codec_context
            context.time_base = MS
            context.thread_count = 1
            context.flags |= _GLOBAL_HEADER
            self._container.start_encoding()
        except (av.error.FFmpegError, ValueError) as error:
            self._container.close()
            raise VideoError(f"no encoder for {size[0]}x{size[1]} pictures ({error})") from None

    def encode(self, image: Image, captured_s: float, *, force_key: bool) -> Packet:
        """A picture, RGB uint8 (H, W, 3), as a packet; a time that does not go on is taken 1 ms later. Raises VideoError."""
        self._zero_s = captured_s if self._zero_s is None else self._zero_s
        self._pts_ms = max(self._pts_ms + 1, round((captured_s - self._zero_s) * 1000.0))
        frame = self._frame(image)
        frame.pts, frame.time_base = self._pts_ms, MS
        if force_key:
            frame.pict_type = PictureType.I
        try:
            packets = self.template.encode(frame)
        except av.error.FFmpegError as error:
            raise VideoError(f"a picture could not be encoded ({error})") from None
        if len(packets) != 1:
            raise VideoError(f"the encoder gave {len(packets)} packets for one picture")
        data = bytes(packets[0])
        return Packet(data, self._pts_ms, packets[0].is_keyframe, checksum_with_codes(data))

    def _frame(self, image: Image) -> av.VideoFrame:
        if self._lossless:
            return av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
        if self._even:
            # five times faster than libswscale's
            planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), np.uint8)
            return av.VideoFrame.from_ndarray(planes, format="yuv420p")
        return av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24").reformat(format="yuv444p")

    def close(self) -> None:
        with contextlib.suppress(av.error.FFmpegError):
            self._container.close()


_MOST_BITS_S = 2**30 - 1
"""Twice that is the largest number that the encoder takes."""


def _options(size: tuple[int, int], config: RecordConfig) -> dict[str, str]:
    common = {"preset": "ultrafast", "tune": "zerolatency", "g": str(GOP_FRAMES), "forced-idr": "1"}
    if config.codec == "lossless":
        return common | {"qp": "0"}
    rate = min(max(200_000, round(config.max_mbit_s * 1e6 * size[0] * size[1] / (640 * 480))), _MOST_BITS_S)
    return common | {"crf": str(config.quality_crf), "maxrate": str(rate), "bufsize": str(2 * rate)}


class VideoTrack:
    """One Matroska file being written. The first packet must be a key picture; its time becomes 0."""

    def __init__(self, path: Path, template: Any) -> None:
        self._zero_ms: int | None = None
        try:
            self._container = av.open(media_name(path), "w", format="matroska", options=LIVE_OPTIONS)
            self._stream = self._container.add_stream_from_template(template)
        except (av.error.FFmpegError, OSError, ValueError) as error:
            raise VideoError(f"{path}: cannot be written ({_words(error)})") from None
        self._path = path

    def write(self, packet: Packet) -> int:
        """Append it; returns its time in this file in ms. Raises VideoError, after which nothing more should be written."""
        self._zero_ms = packet.pts_ms if self._zero_ms is None else self._zero_ms
        pts_ms = packet.pts_ms - self._zero_ms
        native = av.Packet(packet.data)
        native.pts = native.dts = pts_ms
        native.time_base, native.is_keyframe, native.stream = MS, packet.is_key, self._stream
        try:
            self._container.mux_one(native)
        except (av.error.FFmpegError, OSError) as error:
            raise VideoError(f"{self._path}: cannot be written ({_words(error)})") from None
        return pts_ms

    def close(self) -> None:
        """Write the index and close. Raises VideoError; what was written before stays readable."""
        try:
            self._container.close()
        except (av.error.FFmpegError, OSError) as error:
            raise VideoError(f"{self._path}: cannot be closed ({_words(error)})") from None


def _words(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
