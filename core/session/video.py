"""Pictures to packets, and packets to a video file that survives the death of its writer.

Measured at 640x480 with a kill after some seconds: Matroska with its clusters closed every 200 ms and flushed packet by packet
loses 0.2 s; MP4 loses everything. ``ultrafast`` at crf 21 costs 2.3 ms a frame on one core and 9 MB a minute in the twin; a bound
on the rate keeps a noisy camera from filling the disk. RGB without loss (x264, qp 0) costs 10 ms and 1 GB a minute; FFV1 takes
27 ms for the same size.

Opens videos to read, and gives their pictures as a person sees them: none that a decoder invented, in order, upright, in square
pixels.

What is left of a video file that was cut or damaged, as a whole file: its packets copied, not encoded again.

Which packets of a video can be trusted: those that are as they were written, and whose picture builds on such ones only.

Decoders conceal damage: they show something. What they show must not be measured, so every row of a session carries the checksum of
its picture's packet.
"""

from __future__ import annotations

import contextlib
import os
import re
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from heapq import heappop, heappush
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import av
import av.error
import cv2
import numpy as np
from av.container import InputContainer
from av.sidedata.sidedata import SideData
from av.video.frame import PictureType

from core.config.models import GOP_FRAMES, RecordConfig
from core.types import Image

_START = re.compile(b"\x00\x00\x00?\x01")


class PictureRow(NamedTuple):
    """What the rows tell of a picture: place of its row among the good ones, the row's own number, and the checksum of the packet
    (None: the row has none)."""

    place: int
    number: int
    crc: int | None


Known = Callable[[int], PictureRow | None]
"""Time in ms -> its picture's row. None: no row has it."""


def checksum_with_codes(packet: bytes) -> int:
    """CRC-32 of the NAL units of an H.264 packet as the encoder gives it, with start codes."""
    return _checksum(unit for unit in _START.split(packet) if unit)


def checksum_with_lengths(packet: bytes) -> int:
    """The same of a packet as Matroska stores it, with lengths of four bytes."""
    return _checksum(_with_lengths(packet))


def _checksum(units: Iterable[bytes]) -> int:
    total = 0
    for unit in units:
        # zeros at the end belong to the next start code
        total = zlib.crc32(unit.rstrip(b"\x00"), total)
    return total


def _with_lengths(packet: bytes) -> Iterator[bytes]:
    at = 0
    while at + 4 <= len(packet):
        size = int.from_bytes(packet[at : at + 4], "big")
        yield packet[at + 4 : at + 4 + size]
        at += 4 + size


class PacketCheck:
    """Follows the packets of one file in order, from the beginning or from a seek on."""

    def __init__(self, known: Known) -> None:
        self._known = known
        self._last: PictureRow | None = None
        self._unknown = 0
        self._is_whole = False

    def take(self, pts_ms: int, data: bytes, *, is_key: bool, is_corrupt: bool = False) -> bool:
        """Can the picture of this packet be trusted? After a damaged or missing one none can until the next key picture."""
        found = self._known(pts_ms)
        if found is not None:
            if self._last is not None and not self._follows(self._last, found):
                self._is_whole = False
            if is_corrupt or (found.crc is not None and checksum_with_lengths(data) != found.crc):
                self._is_whole = False
                return False
            self._last, self._unknown = found, 0
        elif is_corrupt:
            self._is_whole = False
            return False
        else:
            self._unknown += 1
        self._is_whole = self._is_whole or is_key
        return self._is_whole

    def _follows(self, last: PictureRow, found: PictureRow) -> bool:
        """Is no picture missing in between? Where rows are lost, too, their pictures must have come by."""
        return found.place == last.place + 1 and found.number - last.number - 1 <= self._unknown

    def fail(self) -> None:
        """The decoder refused the packet."""
        self._is_whole = False


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


_SQUARE = 0.005
_MOST_ASPECT = 4.0
"""No camera's pixels are so much wider than high, or higher than wide: what a file says beyond that is damaged."""


class NoPictures(ValueError):
    """The file is a container, but nothing can be decoded from it; the message says why."""


def open_video(path: Path) -> InputContainer:
    """A container to read from; raises av.error.FFmpegError or OSError for what is none.

    Titles and tags are decoded when it is opened; a flipped bit in one of them must not cost the pictures.
    """
    return av.open(media_name(path), metadata_errors="replace")


def pictures_of(container: InputContainer) -> av.VideoStream:
    """The stream that is looked at: the first video. Raises NoPictures."""
    if not container.streams.video:
        raise NoPictures("has no video in it")
    stream = container.streams.video[0]
    if getattr(stream, "codec_context", None) is None:  # FFmpeg has no decoder for it
        raise NoPictures("has a video of a kind that cannot be decoded here")
    return stream


def is_avi(container: InputContainer) -> bool:
    """Whether nothing in the file says when a picture is shown."""
    return container.format.name == "avi"


@dataclass(frozen=True, slots=True)
class UndecodablePicture:
    """In the place of a picture that is damaged, or builds on such a one; ``pts`` as a frame has it, None: not known."""

    pts: int | None


def decoded(container: InputContainer, stream: av.VideoStream) -> Iterator[av.VideoFrame | UndecodablePicture]:
    """Each picture from here on, in order.

    Decoders conceal damage: they show something, until the next picture that stands for itself, and that must not be measured.
    Damage that the decoder does not notice (another content of the right form) passes. Raises av.error.FFmpegError where the file
    itself cannot be read on.
    """
    is_whole, waiting = True, list[int]()
    broken_pts: int | None = None
    # Of other codecs packets may rightly give no picture.
    gives_all = stream.codec_context.name == "h264"
    # An AVI knows no times: packets of H.264 are counted there in the order in which they are decoded, not shown.
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
            # One that had gone in before the damage, and comes out after it, says nothing of what follows.
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
    if _is_mirrored(frame):  # what it says of the turn is of the picture as it would be without that
        return np.ascontiguousarray(np.rot90(image, -turns)[::-1])
    return np.ascontiguousarray(np.rot90(image, turns)) if turns else image


def _is_mirrored(frame: av.VideoFrame) -> bool:
    """Whether the file shows it as in a mirror: the determinant of its display matrix, 3x3 numbers in 16.16 bits, says so."""
    matrix = frame.side_data.get("DISPLAYMATRIX")
    if not isinstance(matrix, SideData):
        return False
    across_x, across_y, _, down_x, down_y = struct.unpack_from("=5i", bytes(matrix))
    return bool(across_x * down_y - across_y * down_x < 0)


_MAX_STEP_MS = 5_000
_NO_END_MS = 2**62


@dataclass(slots=True)
class Remuxed:
    """Times (ms) of the pictures that were kept, and what was wrong."""

    kept_ms: set[int] = field(default_factory=set)
    problems: list[str] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Expected:
    """A picture that a row tells of: number of the row, time in the file, checksum of the packet (None: the row has none)."""

    row: int
    pts_ms: int
    crc: int | None


def remux(source: Path, target: Path, expected: Sequence[Expected]) -> Remuxed:
    """Copy what can be read of `source` and be trusted.

    Parameters
    ----------
    expected : the pictures that rows tell of, in order. What differs from them, or is built on one that is missing, is left out.

    Raises
    ------
    VideoError
        When the target cannot be written. A source that cannot be read is a problem in the result.
    """
    done = Remuxed()
    try:
        container = open_video(source)
    except (av.error.FFmpegError, OSError) as error:
        done.problems.append(f"{source.name}: cannot be read as a video ({getattr(error, 'strerror', None) or error})")
        return done
    with container:
        if not has_h264(container):
            done.problems.append(f"{source.name}: has no H.264 video in it")
            return done
        _copy(container, target, expected, done)
    if not done.kept_ms:
        target.unlink(missing_ok=True)
        done.problems.append(f"{source.name}: no picture left")
    return done


def has_h264(container: Any) -> bool:
    """Is there a video of the kind that the recorder writes? Damage can turn the name of its codec into another's."""
    streams = container.streams.video
    context = streams[0].codec_context if streams else None
    return context is not None and context.name == "h264" and context.width > 0 and context.height > 0


def _copy(container: Any, target: Path, expected: Sequence[Expected], done: Remuxed) -> None:
    stream = container.streams.video[0]
    try:
        with av.open(media_name(target), "w", format="matroska") as output:
            copy = output.add_stream_from_template(stream)
            for packet, pts_ms in _whole(container, stream, expected, done):
                packet.stream = copy
                packet.dts = packet.pts
                output.mux_one(packet)
                done.kept_ms.add(pts_ms)
    except (av.error.FFmpegError, OSError, ValueError) as error:
        raise VideoError(f"{target}: cannot be written ({getattr(error, 'strerror', None) or error})") from None


def _whole(container: Any, stream: Any, expected: Sequence[Expected], done: Remuxed) -> Iterator[tuple[Any, int]]:
    """Packets whose picture can be trusted, in order."""
    known = {one.pts_ms: PictureRow(place, one.row, one.crc) for place, one in enumerate(expected)}
    check, gaps = PacketCheck(known.get), _gaps(expected)
    last_ms, left_out = -1, 0
    # Rows that were cut off leave their pictures, each soon after the one before; a damaged time leaps.
    end_ms = expected[-1].pts_ms if expected else _NO_END_MS
    for packet in _packets(container, stream, done):
        pts_ms = round(packet.pts * stream.time_base * 1000)
        # a time that no row tells of is a damaged time, unless rows are missing there
        is_told = pts_ms in known or any(low < pts_ms < high for low, high in gaps)
        is_after = end_ms < pts_ms < max(last_ms, end_ms) + _MAX_STEP_MS
        is_possible = pts_ms > last_ms and (is_told or is_after)
        if not is_possible or not check.take(pts_ms, bytes(packet), is_key=packet.is_keyframe, is_corrupt=packet.is_corrupt):
            left_out += 1
            continue
        last_ms = pts_ms
        yield packet, pts_ms
    if left_out:
        done.problems.append(f"{container.name.rpartition('/')[2]}: {left_out} damaged pictures left out")


def _gaps(expected: Sequence[Expected]) -> list[tuple[int, int]]:
    """Between which times (ms) pictures may be of which no row tells: where rows are missing."""
    if not expected:
        return [(-1, _NO_END_MS)]
    gaps = [(a.pts_ms, b.pts_ms) for a, b in pairwise(expected) if b.row > a.row + 1]
    if expected[0].pts_ms > 0:
        gaps.append((-1, expected[0].pts_ms))
    return gaps


def _packets(container: Any, stream: Any, done: Remuxed) -> Iterator[Any]:
    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets)
        except StopIteration:
            return
        except (av.error.FFmpegError, OSError) as error:
            done.problems.append(f"{container.name.rpartition('/')[2]}: ends early ({getattr(error, 'strerror', None) or error})")
            return
        if packet.pts is not None and packet.size:
            yield packet
