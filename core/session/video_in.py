"""Opens videos to read, and gives their pictures as a person sees them: none that a decoder invented, in order, upright, in square
pixels."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from pathlib import Path

import av
import av.error
import numpy as np
from av.container import InputContainer
from av.sidedata.sidedata import SideData

from core.session.video import media_name
from core.types import Image

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
class Damaged:
    """In the place of a picture that is damaged, or builds on such a one; ``pts`` as a frame has it, None: not known."""

    pts: int | None


def decoded(container: InputContainer, stream: av.VideoStream) -> Iterator[av.VideoFrame | Damaged]:
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
                yield Damaged(packet.pts)
            continue
        for frame in frames:
            # One that had gone in before the damage, and comes out after it, says nothing of what follows.
            stands_alone = frame.key_frame and (broken_pts is None or frame.pts is None or frame.pts > broken_pts)
            if is_counted:
                while frame.key_frame and waiting and frame.pts is not None and waiting[0] < frame.pts:
                    yield Damaged(heappop(waiting))
                frame.pts = heappop(waiting) if waiting else frame.pts
            while waiting and frame.pts is not None and waiting[0] < frame.pts:
                is_whole = False
                yield Damaged(heappop(waiting))
            if waiting and waiting[0] == frame.pts:
                heappop(waiting)
            is_whole = (is_whole or stands_alone) and not frame.is_corrupt
            yield frame if is_whole else Damaged(frame.pts)
    yield from (Damaged(pts) for pts in sorted(waiting))


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
