"""A session as CSV and MP4. Files appear whole or not at all; nothing is overwritten."""

from __future__ import annotations

import csv
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import av.error
import cv2
import numpy as np

from core.session.manifest import SessionError
from core.session.reader import SessionReader
from core.session.values import rotation_joints, values_of
from core.session.video import MS, media_name
from core.types import Command, Image, Tick

Draw = Callable[[Tick], Image]
Advance = Callable[[], None]


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place when all went well. Raises SessionError."""
    part = path.with_name(f".{secrets.token_hex(8)}.part")
    try:
        if path.exists():
            raise SessionError(f"{path}: is there already; choose another file")
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        try:
            _move(part, path)
        except FileExistsError:
            raise SessionError(f"{path}: was made by something else meanwhile; choose another file") from None
    except (av.error.FFmpegError, OSError) as error:
        raise SessionError(f"{path}: cannot be written ({getattr(error, 'strerror', None) or error})") from None
    finally:
        with suppress(OSError):
            part.unlink()


def _move(part: Path, path: Path) -> None:
    """Give `part` its name. Raises FileExistsError: of two that write the same file the first one stands."""
    try:
        os.link(part, path)
    except FileExistsError:
        raise
    except OSError:  # a drive without links
        path.touch(exist_ok=False)
        try:
            part.replace(path)
        except OSError:
            path.unlink()  # the empty one that held the name
            raise


def export_csv(reader: SessionReader, path: Path, on_row: Advance = lambda: None) -> int:
    """One line per frame, blank where something is missing; points in source pixels, distances in working pixels.

    Returns the lines. Raises SessionError.
    """
    reader.wait()
    config = reader.manifest.config if reader.manifest is not None else {}
    written = 0
    first_s: float | None = None
    with new_file(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        out, columns = csv.writer(file), (*_COLUMNS, *(_TURNING if rotation_joints(config) else ()))
        out.writerow(columns)
        for place in range(len(reader)):
            row = reader.row(place)
            if row is not None:
                first_s = row.captured_s if first_s is None else first_s
                values = values_of(row)
                values["time_s"] = round(row.captured_s - first_s, 6)
                values["source_px_per_working_px"] = round(row.source_px_per_working_px, 6)
                out.writerow(values[name] for name in columns)
                written += 1
            on_row()
    return written


_WHO = ("asked", "commanded", "sent")
_MOTIONS = tuple(f"{who}_{name}" for who in _WHO for name in Command.__slots__ if name != "rotation_deg_s")
_TURNING = (*(f"{who}_rotation_deg_s" for who in _WHO), "rotation_deg")
"""Columns of a robot whose shaft is turned, after the others."""
_COLUMNS = (
    *("row", "index", "captured_s", "time_s", "video", "pts_ms", "dropped_frames", "camera_lost", "dropped_rows"),
    *("width_px", "height_px", "source_px_per_working_px", "state", "theta_deg", "theta_signed_deg", "c_head_px", "c_tail_px"),
    *("crossed", "confidence", "novelty", "refusal", "head_x_px", "head_y_px", "tail_x_px", "tail_y_px"),
    *("advice_speed", "advice_advance_mm_s", "advice_steer_deg", "mode", "permitted", *_MOTIONS, "sent_by"),
    *("insertion_mm", "delivery_mm", "wall_contact_n", "perception_ms", "latency_s"),
)


def export_mp4(
    reader: SessionReader,
    path: Path,
    draw: Draw | None = None,
    *,
    first: int = 0,
    last: int | None = None,
    on_row: Advance = lambda: None,
) -> int:
    """Pictures of the rows from `first` to `last` (not included; None: all) as H.264, at the times when they were captured.

    `draw` burns in what it likes; None: the plain pictures. All take the size of the first one. Returns the number of pictures
    written; rows whose picture is lost are left out. Raises SessionError: no picture at all, or the file cannot be written or
    is there already.
    """
    reader.wait()
    written = 0
    with new_file(path) as part:
        movie: Movie | None = None
        try:
            for place in range(first, len(reader) if last is None else min(last, len(reader))):
                tick = reader.tick(place)
                if tick is not None:
                    image = draw(tick) if draw is not None else tick.frame.image
                    movie = movie or Movie(part, image)
                    movie.add(image, tick.frame.captured_s)
                    written += 1
                on_row()
        finally:
            if movie is not None:
                movie.close()
        if not written:
            raise SessionError(f"{reader.folder}: no picture there that could be exported")
    return written


class Movie:
    """An MP4 that every player takes: yuv420p, even sides as of the `first` picture, index in front.

    All times are multiples of `time_base` (s); every `key_every`-th picture can be decoded by itself.
    """

    def __init__(self, path: Path, first: Image, time_base: Fraction = MS, key_every: int = 30) -> None:
        height, width = first.shape[:2]
        self.size = width + width % 2, height + height % 2
        self._container = av.open(media_name(path), "w", format="mp4", options={"movflags": "faststart"})
        options = {"preset": "veryfast", "crf": "18", "g": f"{key_every}", "bf": "0"}
        self._stream: Any = self._container.add_stream("libx264", rate=30, options=options)
        self._stream.width, self._stream.height = self.size
        self._stream.pix_fmt = "yuv420p"
        self._stream.codec_context.time_base = self._time_base = time_base
        self._stream.codec_context.thread_count = 1
        self._zero_s: float | None = None
        self._pts = -1

    def add(self, image: Image, captured_s: float) -> None:
        self._zero_s = captured_s if self._zero_s is None else self._zero_s
        self._pts = max(self._pts + 1, round((captured_s - self._zero_s) / self._time_base))
        planes = np.asarray(cv2.cvtColor(self._fitted(image), cv2.COLOR_RGB2YUV_I420), np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts, frame.time_base = self._pts, self._time_base
        self._container.mux(self._stream.encode(frame))

    def _fitted(self, image: Image) -> Image:
        """At the movie's size; an odd side grows by repeating its last row or column."""
        height, width = image.shape[:2]
        grown = image
        if (width + width % 2, height + height % 2) == self.size:
            if width % 2 or height % 2:
                grown = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
        else:
            grown = np.asarray(cv2.resize(image, self.size, interpolation=cv2.INTER_AREA), np.uint8)
        return np.ascontiguousarray(grown)

    def close(self) -> None:
        try:
            self._container.mux(self._stream.encode(None))
        finally:
            self._container.close()
