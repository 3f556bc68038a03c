"""A session as CSV and as MP4. Files appear whole or not at all; what is there already is never overwritten."""

from __future__ import annotations

import csv
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import av
import av.error
import cv2
import numpy as np

from core.session.manifest import SessionError
from core.session.reader import SessionReader
from core.session.recorded import RecordedRow
from core.session.video import MS, media_name
from core.types import Command, Image, Point, Tick

Draw = Callable[[Tick], Image]
Advance = Callable[[], None]
_MADE_MEANWHILE = "{path}: was made by something else meanwhile; choose another file"


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place when all went well. Raises SessionError."""
    part = path.with_name(f".{secrets.token_hex(8)}.part")  # its own: of two that write the same file the second is refused
    try:
        if path.exists():
            raise SessionError(f"{path}: is there already; choose another file")
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        _put_in_place(part, path)
    except (av.error.FFmpegError, OSError) as error:
        raise SessionError(f"{path}: cannot be written ({getattr(error, 'strerror', None) or error})") from None
    finally:
        with suppress(OSError):
            part.unlink()


def _put_in_place(part: Path, path: Path) -> None:
    """Give the file its name, unless somebody else has made one of that name meanwhile."""
    try:
        os.link(part, path)
    except FileExistsError:
        raise SessionError(_MADE_MEANWHILE.format(path=path)) from None
    except OSError:  # a drive that knows no second name for a file
        try:
            path.touch(exist_ok=False)
        except FileExistsError:
            raise SessionError(_MADE_MEANWHILE.format(path=path)) from None
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
    written = 0
    first_s: float | None = None
    with new_file(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow(_COLUMNS)
        for place in range(len(reader)):
            row = reader.row(place)
            if row is not None:
                first_s = row.captured_s if first_s is None else first_s
                out.writerow(_COLUMNS[name](row, first_s) for name in _COLUMNS)
                written += 1
            on_row()
    return written


def _point(row: RecordedRow, point: Point | None, axis: int) -> float | None:
    return round(row.scene.to_source(point)[axis], 3) if point is not None else None


def _head(axis: int) -> Callable[[RecordedRow, float], Any]:
    return lambda row, _: _point(row, row.scene.path.head if row.scene.path else None, axis)


def _tail(axis: int) -> Callable[[RecordedRow, float], Any]:
    return lambda row, _: _point(row, row.scene.path.tail if row.scene.path else None, axis)


def _pose(name: str) -> Callable[[RecordedRow, float], Any]:
    return lambda row, _: getattr(row.scene.pose, name) if row.scene.pose else None


def _of(first: str, *names: str) -> Callable[[RecordedRow, float], Any]:
    """An attribute of an attribute of the row, None as soon as one is missing."""

    def value(row: RecordedRow, _: float) -> Any:
        found: Any = getattr(row, first)
        for name in names:
            found = getattr(found, name) if found is not None else None
        return found

    return value


def _motion(prefix: str, *names: str) -> dict[str, Callable[[RecordedRow, float], Any]]:
    return {f"{prefix}_{field}": _of(*names, field) for field in Command.__slots__}


_COLUMNS: dict[str, Callable[[RecordedRow, float], Any]] = {
    "row": _of("row"),
    "index": _of("index"),
    "captured_s": _of("captured_s"),
    "time_s": lambda row, first_s: round(row.captured_s - first_s, 6),
    "video": _of("video"),
    "pts_ms": _of("pts_ms"),
    "dropped_frames": _of("dropped_frames"),
    "camera_lost": _of("camera_lost"),
    "dropped_rows": _of("dropped_rows"),
    "width_px": lambda row, _: row.size[0],
    "height_px": lambda row, _: row.size[1],
    "source_px_per_working_px": lambda row, _: round(row.source_px_per_working_px, 6),
    "state": _pose("state"),
    "theta_deg": _pose("theta_deg"),
    "theta_signed_deg": _pose("theta_signed_deg"),
    "c_head_px": _pose("c_head_px"),
    "c_tail_px": _pose("c_tail_px"),
    "crossed": _pose("crossed"),
    "confidence": _pose("confidence"),
    "novelty": lambda row, _: row.scene.novelty,
    "refusal": lambda row, _: str(row.scene.refusal) if row.scene.refusal else None,
    "head_x_px": _head(0),
    "head_y_px": _head(1),
    "tail_x_px": _tail(0),
    "tail_y_px": _tail(1),
    "advice_speed": _of("advice", "speed"),
    "advice_advance_mm_s": _of("advice", "advance_mm_s"),
    "advice_steer_deg": _of("advice", "steer_deg"),
    "mode": _of("drive", "mode"),
    "permitted": _of("drive", "permitted"),
    **_motion("asked", "drive", "asked"),
    **_motion("commanded", "drive", "commanded"),
    **_motion("sent", "sent"),
    "sent_by": _of("drive", "sent_by"),
    "insertion_mm": _of("status", "insertion_mm"),
    "delivery_mm": _of("status", "delivery_mm"),
    "wall_contact_n": _of("status", "wall_contact_n"),
    "perception_ms": lambda row, _: row.scene.latency_ms.get("total"),
    "latency_s": _of("drive", "latency_s"),
}


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

    Parameters
    ----------
    draw : burns in what it likes; None: the plain pictures. All pictures take the size of the first one.
    on_row : called after every row.

    Returns
    -------
    int
        Pictures written; rows whose picture is lost are left out.

    Raises
    ------
    SessionError
        No picture at all, or the file cannot be written or is there already.
    """
    reader.wait()
    written = 0
    with new_file(path) as part:
        movie: _Movie | None = None
        try:
            for place in range(first, len(reader) if last is None else min(last, len(reader))):
                tick = reader.tick(place)
                if tick is not None:
                    image = draw(tick) if draw is not None else tick.frame.image
                    movie = movie or _Movie(part, image)
                    movie.add(image, tick.frame.captured_s)
                    written += 1
                on_row()
        finally:
            if movie is not None:
                movie.close()
        if not written:
            raise SessionError(f"{reader.folder}: no picture there that could be exported")
    return written


class _Movie:
    """An MP4 that every player takes: yuv420p, even sides, index in front."""

    def __init__(self, path: Path, first: Image) -> None:
        height, width = first.shape[:2]
        self._size = width + width % 2, height + height % 2
        self._container = av.open(media_name(path), "w", format="mp4", options={"movflags": "faststart"})
        options = {"preset": "veryfast", "crf": "18", "g": "30", "bf": "0"}
        self._stream: Any = self._container.add_stream("libx264", rate=30, options=options)
        self._stream.width, self._stream.height = self._size
        self._stream.pix_fmt = "yuv420p"
        self._stream.codec_context.time_base = MS
        self._stream.codec_context.thread_count = 1
        self._zero_s: float | None = None
        self._pts_ms = -1

    def add(self, image: Image, captured_s: float) -> None:
        self._zero_s = captured_s if self._zero_s is None else self._zero_s
        self._pts_ms = max(self._pts_ms + 1, round((captured_s - self._zero_s) * 1000))
        planes = np.asarray(cv2.cvtColor(self._fitted(image), cv2.COLOR_RGB2YUV_I420), np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts, frame.time_base = self._pts_ms, MS
        self._container.mux(self._stream.encode(frame))

    def _fitted(self, image: Image) -> Image:
        """At the movie's size; an odd side grows by repeating its last row or column."""
        height, width = image.shape[:2]
        grown = image
        if (width + width % 2, height + height % 2) == self._size:
            if width % 2 or height % 2:
                grown = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
        else:
            grown = np.asarray(cv2.resize(image, self._size, interpolation=cv2.INTER_AREA), np.uint8)
        return np.ascontiguousarray(grown)

    def close(self) -> None:
        try:
            self._container.mux(self._stream.encode(None))
        finally:
            self._container.close()
