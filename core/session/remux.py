"""What is left of a video file that was cut or damaged, as a whole file: its packets copied, not encoded again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import av.error

from core.session.packet_check import PacketCheck, PictureRow
from core.session.video import VideoError, media_name
from core.session.video_in import open_video

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
