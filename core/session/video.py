"""Video files of sessions: encoding, writing, decoding, and copying what is left of a damaged one.

Measured at 640x480 with a kill after some seconds: Matroska with its clusters closed every 200 ms and flushed packet by packet
loses 0.2 s; MP4 loses everything. ``ultrafast`` at crf 21 costs 2.3 ms a frame on one core and 9 MB a minute in the twin; a limit
of the rate keeps a noisy camera from filling the disk. Lossless RGB (x264, qp 0) costs 10 ms and 1 GB a minute; FFV1 takes 27 ms
for the same size.
"""

from __future__ import annotations

import contextlib
import math
import os
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from heapq import heappop, heappush
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import av.error
import cv2
import numpy as np
from av.container import InputContainer
from av.sidedata.sidedata import SideData
from av.video.frame import PictureType

from core.config.models import GOP_FRAMES, RecordConfig
from core.messages import message
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
    """One encoded picture. ``pts_ms`` counts from the encoder's first picture."""

    data: bytes
    pts_ms: int
    is_key: bool


class FrameEncoder:
    """Turns pictures of one size into packets, one for one and without delay.

    Its packets may go to several files, each beginning at a key picture; `template` describes the stream to those files.
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
        return Packet(bytes(packets[0]), self._pts_ms, packets[0].is_keyframe)

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


_SQUARE = 0.005
_MOST_ASPECT = 4.0
"""No camera has pixels of a larger aspect: beyond it the file is damaged."""


class NoPictures(ValueError):
    """The file is a container, but nothing can be decoded from it; the message says why."""


def open_video(path: Path) -> InputContainer:
    """A container to read from; raises av.error.FFmpegError, OSError.

    Titles and tags are decoded when it is opened; a flipped bit in one of them must not cost the pictures.
    """
    return av.open(media_name(path), metadata_errors="replace")


def pictures_of(container: InputContainer) -> av.VideoStream:
    """The first video stream, which is the one that is decoded. Raises NoPictures."""
    if not container.streams.video:
        raise NoPictures("has no video in it")
    stream = container.streams.video[0]
    if getattr(stream, "codec_context", None) is None:  # FFmpeg has no decoder for it
        raise NoPictures("has a video of a kind that cannot be decoded here")
    return stream


def is_avi(container: InputContainer) -> bool:
    """Whether the file has no presentation times."""
    return container.format.name == "avi"


@dataclass(frozen=True, slots=True)
class UndecodablePicture:
    """In the place of a picture that is damaged, or builds on such a one; ``pts`` as a frame has it, None: not known."""

    pts: int | None


def decoded(container: InputContainer, stream: av.VideoStream) -> Iterator[av.VideoFrame | UndecodablePicture]:
    """Each picture from here on, in order.

    Decoders conceal damage until the next key picture; concealed pictures must not be measured.
    Damage that the decoder does not notice passes. Raises av.error.FFmpegError where the file
    itself cannot be read on.
    """
    is_whole, waiting = True, list[int]()
    broken_pts: int | None = None
    # Of other codecs packets may rightly give no picture.
    gives_all = stream.codec_context.name == "h264"
    # An AVI has no presentation times: packets of H.264 are numbered in the order of decoding, not of showing.
    is_counted = gives_all and is_avi(container)
    for packet in container.demux(stream):
        if gives_all and packet.pts is not None and packet.size and not packet.is_discard:
            heappush(waiting, packet.pts)
        try:
            frames = packet.decode()
        except EOFError:
            return
        except av.error.FFmpegError:
            is_whole, broken_pts = False, packet.pts
            if not gives_all:
                yield UndecodablePicture(packet.pts)
            continue
        for frame in frames:
            # A key picture from before the damage may come out after it.
            stands_alone = frame.key_frame and (broken_pts is None or frame.pts is None or frame.pts > broken_pts)
            if is_counted:
                while frame.key_frame and waiting and frame.pts is not None and waiting[0] < frame.pts:
                    yield UndecodablePicture(heappop(waiting))
                frame.pts = heappop(waiting) if waiting else frame.pts
            while waiting and frame.pts is not None and waiting[0] < frame.pts:
                is_whole = False
                yield UndecodablePicture(heappop(waiting))
            if waiting and waiting[0] == frame.pts:
                heappop(waiting)
            is_whole = (is_whole or stands_alone) and not frame.is_corrupt
            yield frame if is_whole else UndecodablePicture(frame.pts)
    yield from (UndecodablePicture(pts) for pts in sorted(waiting))


def upright(frame: av.VideoFrame, stream: av.VideoStream | None = None) -> Image:
    """RGB uint8 (H, W, 3) of a frame as players show it: turned or mirrored as the file says, its pixels made square as its stream
    says."""
    aspect = float((stream.sample_aspect_ratio if stream is not None else None) or 1.0)
    if abs(aspect - 1.0) > _SQUARE and 1.0 / _MOST_ASPECT <= aspect <= _MOST_ASPECT:
        frame = frame.reformat(width=max(1, round(frame.width * aspect)), height=frame.height, format="rgb24")
    image = np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)
    turns = round(frame.rotation / 90) % 4  # to the left
    if _is_mirrored(frame):  # the rotation is that of the picture before mirroring
        return np.ascontiguousarray(np.rot90(image, -turns)[::-1])
    return np.ascontiguousarray(np.rot90(image, turns)) if turns else image


def _is_mirrored(frame: av.VideoFrame) -> bool:
    """By the determinant of the display matrix (3x3 numbers of 16.16 bits)."""
    matrix = frame.side_data.get("DISPLAYMATRIX")
    if not isinstance(matrix, SideData):
        return False
    across_x, across_y, _, down_x, down_y = struct.unpack_from("=5i", bytes(matrix))
    return bool(across_x * down_y - across_y * down_x < 0)


_MAX_STEP_MS = 5_000  # behind the last row, a larger step is a damaged time
RowOf = Callable[[int], tuple[int, int] | None]
"""Time in the file (ms) -> place (among the good rows) and number of the row whose picture it is; None: no row has it."""
Packets = Iterator[tuple[int, "av.Packet[av.VideoStream]"]]
"""Time in the file (ms) and packet of each picture."""


def video_number(path: Path) -> int | None:
    """The number of a session's video file; None for other names."""
    digits = path.stem.rpartition("_")[2]
    return int(digits) if digits.isascii() and digits.isdigit() else None


def has_h264(container: InputContainer) -> bool:
    """Whether it has a video of the kind that the recorder writes. Damage can turn the name of its codec into another's."""
    context = container.streams.video[0].codec_context if container.streams.video else None
    return context is not None and context.name == "h264" and context.width > 0 and context.height > 0


def packets_of(container: InputContainer) -> Packets:
    """The packets of the first video. Raises FFmpegError, OSError where the file cannot be read on."""
    stream = container.streams.video[0]
    for packet in container.demux(stream):
        if packet.pts is not None and packet.size and stream.time_base is not None:
            yield round(packet.pts * stream.time_base * 1000), packet


def sound_packets(packets: Packets, row_of: RowOf) -> Packets:
    """`packets` without damaged ones, and without those that build on a damaged or missing one."""
    last: tuple[int, int] | None = None
    unknown, is_whole = 0, False
    for pts_ms, packet in packets:
        row = row_of(pts_ms)
        if packet.is_corrupt:
            is_whole = False
            continue
        if row is None:
            unknown += 1
        else:
            # no row lies in between, and as many pictures came by as rows are lost there
            if last is not None and (row[0] != last[0] + 1 or row[1] > last[1] + 1 + unknown):
                is_whole = False
            last, unknown = row, 0
        is_whole = is_whole or packet.is_keyframe
        if is_whole:
            yield pts_ms, packet


def packet_times(path: Path) -> list[int]:
    """Times (ms) of all pictures that can be found, without decoding; empty when it is no video."""
    found: list[int] = []
    with contextlib.suppress(av.error.FFmpegError, OSError), open_video(path) as container:
        if container.streams.video:
            found += (pts_ms for pts_ms, _ in packets_of(container))
    return found


def remux(source: Path, target: Path, rows: Mapping[int, int]) -> tuple[set[int], list[str]]:
    """Copy the sound packets of `source`; nothing is written if all are damaged.

    A time that no row has is possible where rows are missing, or soon after the last row; others are damaged.

    Raises VideoError: the target cannot be written. A source that cannot be read is a problem in the result.

    Returns the times (ms) of the pictures that were kept, and what was wrong, a line each.

    Parameters
    ----------
    rows : time (ms) of a picture -> number of its row, in order.
    """
    kept: set[int] = set()
    problems: list[str] = []
    last_ms, found = -1, 0
    known: list[tuple[float, int]] = [(-1, -2), *(rows.items() or [(math.inf, 0)])]
    gaps = [(low, high) for (low, before), (high, after) in pairwise(known) if after > before + 1]
    end_ms = known[-1][0]
    places = {pts_ms: (place, row) for place, (pts_ms, row) in enumerate(rows.items())}

    def possible(packets: Packets) -> Packets:
        nonlocal found
        for pts_ms, packet in packets:
            found += 1
            is_known = pts_ms in rows or any(low < pts_ms < high for low, high in gaps)
            if pts_ms > last_ms and (is_known or end_ms < pts_ms < max(last_ms, end_ms) + _MAX_STEP_MS):
                yield pts_ms, packet

    try:
        container = open_video(source)
    except (av.error.FFmpegError, OSError) as error:
        return kept, [message("{path}: cannot be read as a video ({why})", path=source.name, why=_words(error))]
    with container:
        if not has_h264(container):
            return kept, [f"{source.name}: has no H.264 video in it"]
        packets = sound_packets(possible(packets_of(container)), places.get)
        try:
            with av.open(media_name(target), "w", format="matroska") as output:
                copy = output.add_stream_from_template(container.streams.video[0])
                while True:
                    try:
                        pts_ms, packet = next(packets)
                    except StopIteration:
                        break
                    except (av.error.FFmpegError, OSError) as error:
                        problems.append(f"{source.name}: ends early ({_words(error)})")
                        break
                    last_ms = pts_ms
                    packet.stream = copy
                    packet.dts = packet.pts
                    output.mux_one(packet)
                    kept.add(pts_ms)
        except (av.error.FFmpegError, OSError, ValueError) as error:
            raise VideoError(f"{target}: cannot be written ({_words(error)})") from None
    if left_out := found - len(kept):
        problems.append(f"{source.name}: {left_out} damaged pictures left out")
    if not kept:
        target.unlink(missing_ok=True)
        problems.append(f"{source.name}: no picture left")
    return kept, problems
