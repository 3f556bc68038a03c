"""Opens videos to read, and gives their pictures as a person sees them: none that a decoder invented, upright, in square pixels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from pathlib import Path

import av
import av.error
import numpy as np
from av.container import InputContainer

from core.session.video import media_name
from core.types import Image

_SQUARE = 0.005


def open_video(path: Path) -> InputContainer:
    """A container to read from; raises av.error.FFmpegError or OSError for what is none.

    Titles and tags are decoded when it is opened; a flipped bit in one of them must not cost the pictures.
    """
    return av.open(media_name(path), metadata_errors="replace")


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
    # Of other codecs packets may rightly give no picture.
    gives_all = stream.codec_context.name == "h264"
    for packet in container.demux(stream):
        if gives_all and packet.pts is not None and packet.size and not packet.is_discard:
            heappush(waiting, packet.pts)
        try:
            frames = packet.decode()
        except EOFError:
            return
        except av.error.FFmpegError:
            is_whole = False
            if not gives_all:
                yield Damaged(packet.pts)
            continue
        for frame in frames:
            while waiting and frame.pts is not None and waiting[0] < frame.pts:
                is_whole = False
                yield Damaged(heappop(waiting))
            if waiting and waiting[0] == frame.pts:
                heappop(waiting)
            is_whole = (is_whole or frame.key_frame) and not frame.is_corrupt
            yield frame if is_whole else Damaged(frame.pts)
    yield from (Damaged(pts) for pts in sorted(waiting))


def upright(frame: av.VideoFrame, stream: av.VideoStream | None = None) -> Image:
    """RGB uint8 (H, W, 3) of a frame as players show it: turned as the file says, its pixels made square as its stream says."""
    aspect = float((stream.sample_aspect_ratio if stream is not None else None) or 1.0)
    if abs(aspect - 1.0) > _SQUARE:
        frame = frame.reformat(width=max(1, round(frame.width * aspect)), height=frame.height, format="rgb24")
    image = np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)
    turns = round(frame.rotation / 90) % 4  # to the left
    return np.ascontiguousarray(np.rot90(image, turns)) if turns else image
