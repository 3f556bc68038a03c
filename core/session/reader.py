"""A recorded session: rows, events, pictures and timeline. A bad record is named and skipped, a lost picture becomes None."""

from __future__ import annotations

import contextlib
import re
import threading
from array import array
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import av
import av.error
import cv2
import numpy as np
from numpy.typing import NDArray

from core.control.modes import Mode
from core.devices import disk_errors
from core.messages import message
from core.session.codec import Count, InvalidRecord, JsonLayout, Moment, RecordedRow, read_json, row_from_json
from core.session.files import FileLine, check_seal, is_sealed, lines_of, read_line
from core.session.manifest import (
    EVENTS,
    FRAMES,
    Event,
    NewerVersion,
    SessionError,
    event_from_json,
    read_about,
    was_added_later,
)
from core.session.video import RowOf, has_h264, open_video, packet_times, packets_of, sound_packets, upright, video_number
from core.types import Frame, Image, PoseState, Tick

_CACHE_BYTES = 48_000_000  # of decoded pictures
_STEP_MS = 1500  # up to this far ahead decoding on is quicker than seeking: a group of pictures is a second long
_OPEN_FILES = 2  # videos open at once


def _to_rgb(frame: av.VideoFrame) -> Image:
    if frame.format.name == "yuv420p" and frame.width % 2 == 0 and frame.height % 2 == 0:
        return np.asarray(cv2.cvtColor(frame.to_ndarray(), cv2.COLOR_YUV2RGB_I420), np.uint8)
    return np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)


class _OpenVideo:
    """One file and how far it has been decoded: ``at_ms``. Pictures that are damaged, or build on such ones, are left out."""

    def __init__(self, path: Path, row_of: RowOf) -> None:
        self._path, self._row_of = path, row_of
        self._open()
        self._frames = self._decode()
        self.at_ms: int | None = None

    def _open(self) -> None:
        self._container = open_video(self._path)
        if not has_h264(self._container):
            self._container.close()
            raise ValueError("has no H.264 video in it")
        self._stream = self._container.streams.video[0]
        self._stream.codec_context.thread_count = 1

    def seek(self, pts_ms: int) -> None:
        """To the key picture at or before it; to the beginning where the file has no index."""
        base = self._stream.time_base
        try:
            self._container.seek(max(0, int(pts_ms / 1000 / base)) if base else 0, stream=self._stream)
        except (av.error.FFmpegError, OSError, OverflowError):  # a damaged index: only opening it again leads to the beginning
            self._container.close()
            self._open()
        self._frames, self.at_ms = self._decode(), None

    def next(self) -> tuple[int, av.VideoFrame] | None:
        """The next good picture and its time; None at the end of what can be read."""
        for frame in self._frames:
            if frame.pts is not None and frame.time_base is not None:
                self.at_ms = round(frame.pts * frame.time_base * 1000)
                return self.at_ms, frame
        return None

    def _decode(self) -> Iterator[av.VideoFrame]:
        is_whole = True
        with contextlib.suppress(av.error.FFmpegError, OSError):  # of the file, where it ends early
            for _, packet in sound_packets(packets_of(self._container), self._row_of):
                is_whole = is_whole or packet.is_keyframe
                try:
                    frames = packet.decode()
                except (av.error.FFmpegError, OSError):
                    is_whole = False
                    continue
                for frame in frames:
                    is_whole = is_whole and not frame.is_corrupt
                    if is_whole:
                        yield frame

    def close(self) -> None:
        self._container.close()


class _Pictures:
    """The pictures of a session, for one thread at a time; `on_problem` gets a line for each that cannot be read, once."""

    def __init__(
        self, folder: Path, row_of: Callable[[int, int], tuple[int, int] | None], on_problem: Callable[[str], None]
    ) -> None:
        self._row_of = row_of
        self._folder = folder
        self._on_problem = on_problem
        self._lock = threading.Lock()
        self._open: OrderedDict[int, _OpenVideo] = OrderedDict()
        self._unreadable: set[int] = set()
        self._missing: set[tuple[int, int]] = set()
        self._cache: OrderedDict[tuple[int, int], av.VideoFrame] = OrderedDict()
        self._cache_bytes = 0

    def decoded(self, video: int, pts_ms: int) -> av.VideoFrame | None:
        """The picture of file number `video` at exactly this time; None when it is lost or damaged."""
        with self._lock:
            key = video, pts_ms
            if key not in self._cache and key not in self._missing:
                self._decode_up_to(video, pts_ms)
            frame = self._cache.get(key)
            if frame is not None:
                self._cache.move_to_end(key)
            elif key not in self._missing:
                self._missing.add(key)
                if video not in self._unreadable:
                    self._on_problem(f"{self._path(video).name}: no picture at {pts_ms / 1000:.3f} s")
            return frame

    def close(self) -> None:
        with self._lock:
            for video in self._open.values():
                video.close()
            self._open.clear()
            self._cache.clear()

    def _path(self, number: int) -> Path:
        return self._folder / f"video_{number:04d}.mkv"

    def _decode_up_to(self, number: int, pts_ms: int) -> None:
        if number in self._unreadable:
            return
        try:
            video = self._video(number)
            if video.at_ms is None or not 0 < pts_ms - video.at_ms <= _STEP_MS:
                video.seek(pts_ms)
        except (av.error.FFmpegError, OSError, ValueError) as error:
            self._unreadable.add(number)
            self._open.pop(number, None)
            self._on_problem(
                message(
                    "{path}: cannot be read as a video ({why})",
                    path=self._path(number).name,
                    why=getattr(error, "strerror", None) or error,
                )
            )
            return
        while (found := video.next()) is not None:
            at_ms, frame = found
            if (number, at_ms) not in self._cache:
                self._cache[number, at_ms] = frame
                self._cache_bytes += frame.width * frame.height * 3
                while self._cache_bytes > _CACHE_BYTES and len(self._cache) > 1:
                    _, old = self._cache.popitem(last=False)
                    self._cache_bytes -= old.width * old.height * 3
            if at_ms >= pts_ms:
                return
        video.at_ms = None  # at its end the decoder gives no more until it is sought again

    def _video(self, number: int) -> _OpenVideo:
        if number not in self._open:
            self._open[number] = _OpenVideo(self._path(number), partial(self._row_of, number))
            while len(self._open) > _OPEN_FILES:
                self._open.popitem(last=False)[1].close()
        self._open.move_to_end(number)
        return self._open[number]


_STATES = {None: -1} | {state.value: place for place, state in enumerate(PoseState)}
_MODES = {None: -1} | {mode.value: place for place, mode in enumerate(Mode)}
_PUBLISH_EVERY = 500  # rows


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """Columns of all rows that have been read so far, each of shape (N,).

    ``time_s`` is the capture time on the recorded clock. ``state`` and ``mode`` are places in ``PoseState`` and ``Mode``, or -1.
    ``theta_deg`` is signed, NaN without a pose.
    """

    row: NDArray[np.int64]
    time_s: NDArray[np.float64]
    video: NDArray[np.int64]
    pts_ms: NDArray[np.int64]
    theta_deg: NDArray[np.float64]
    state: NDArray[np.int8]
    mode: NDArray[np.int8]


class RowColumns(JsonLayout):
    """The columns of ``Timeline`` in a row's JSON."""

    row: Count
    captured_s: Moment
    video: Count
    pts_ms: Count
    theta_signed_deg: float | None = None
    state: str | None = None
    mode: str | None = None


# What the recorder writes at the beginning of a row. Measured: 12 us a row, where reading all of its JSON takes 130.
_NUMBER = rb"(-?\d{1,15}(?:\.\d{1,9})?)"
_HEAD = re.compile(
    rb'{"row":(\d{1,18}),"video":(\d{1,9}),"pts_ms":(\d{1,18}),(?:"picture_crc":"[0-9a-f]{8}",)?"index":\d+,"captured_s":'
    + _NUMBER
    + rb',[^{}]{0,200}"mode":(?:null|"('
    + "|".join(Mode).encode()
    + rb')"),"state":(?:null|"([A-D])"),"theta_signed_deg":(?:null|'
    + _NUMBER
    + rb"),"
)


def row_columns(line: FileLine) -> RowColumns:
    """The columns of a row; raises InvalidRecord. Of a row whose checksum is right only the beginning is read."""
    found = _HEAD.match(line.data) if line.data is not None else None
    if found is None or not is_sealed(line):
        return read_line(partial(read_json, RowColumns), line)
    row, video, pts_ms, captured_s, mode, state, theta = found.groups()
    return RowColumns.model_construct(
        row=int(row),
        captured_s=float(captured_s),
        video=int(video),
        pts_ms=int(pts_ms),
        theta_signed_deg=float(theta) if theta is not None else None,
        state=state.decode() if state is not None else None,
        mode=mode.decode() if mode is not None else None,
    )


class _RowIndex:
    """Reads the places of the rows in a thread, names bad records there, and lets what it has read so far be used at once."""

    def __init__(self, path: Path, on_problem: Callable[[str], None]) -> None:
        self._path = path
        self._on_problem = on_problem
        self._lock = threading.Lock()
        self._places: list[tuple[int, int]] = []
        self._columns: tuple[array[Any], ...] = tuple(array(code) for code in "qdqqdbb")
        self._keys = array("q")  # file and time of the picture as one number, rising
        self._stop, self._done = threading.Event(), threading.Event()
        self.missing = 0
        self._thread = threading.Thread(target=self._read, name="row index", daemon=True)
        self._thread.start()

    def __len__(self) -> int:
        with self._lock:
            return len(self._places)

    def wait(self, timeout_s: float | None = None) -> bool:
        return self._done.wait(timeout_s)

    def place(self, row: int) -> tuple[int, int]:
        """Offset and size in bytes of the n-th good row. Raises IndexError."""
        with self._lock:
            return self._places[row]

    def timeline(self) -> Timeline:
        with self._lock:
            return Timeline(*(np.array(column) for column in self._columns))

    def row_of(self, video: int, pts_ms: int) -> tuple[int, int] | None:
        """Place and number of the row whose picture is at this time of this file; None: no such row yet."""
        key = _key(video, pts_ms)
        with self._lock:
            place = bisect_left(self._keys, key)
            is_there = place < len(self._keys) and self._keys[place] == key
            return (place, int(self._columns[0][place])) if is_there else None

    def close(self) -> None:
        self._stop.set()
        self._thread.join()

    def _read(self) -> None:
        waiting: list[tuple[FileLine, RowColumns]] = []
        last_row = -1
        try:
            for line in lines_of(self._path):
                if self._stop.is_set():
                    return
                try:
                    columns = row_columns(line)
                    if columns.row <= last_row:
                        raise InvalidRecord(f"row {columns.row} after row {last_row}")
                except InvalidRecord as error:
                    self._on_problem(f"{self._path.name}: line {line.number}: {error}; skipped")
                    continue
                self.missing += columns.row - last_row - 1
                last_row = columns.row
                waiting.append((line, columns))
                if len(waiting) >= _PUBLISH_EVERY or not self._places:
                    self._publish(waiting)
                    waiting = []
        except FileNotFoundError:
            self._on_problem(f"{self._path.name}: missing")
        except OSError as error:
            self._on_problem(f"{self._path.name}: cannot be read further ({error.strerror})")
        finally:
            self._publish(waiting)
            self._done.set()

    def _publish(self, waiting: list[tuple[FileLine, RowColumns]]) -> None:
        with self._lock:
            for line, row in waiting:
                self._places.append((line.offset, len(line.data or b"")))
                self._keys.append(_key(row.video, row.pts_ms))
                theta = float("nan") if row.theta_signed_deg is None else row.theta_signed_deg
                states = _STATES.get(row.state, -1), _MODES.get(row.mode, -1)
                values = row.row, row.captured_s, row.video, row.pts_ms, theta, *states
                for column, value in zip(self._columns, values, strict=True):
                    column.append(value)


def _key(video: int, pts_ms: int) -> int:
    return (min(video, 2**20) << 42) + min(pts_ms, 2**42 - 1)


_MAX_PROBLEMS = 200
_ROWS_KEPT = 16  # a row with its masks weighs megabytes


class SessionReader:
    """An open session. All methods may be called from any thread.

    It opens at once; rows become available as they are read in the background, an hour of them in some seconds. ``wait`` waits
    for all of them. Rows are counted as they are readable: ``row(0)`` is the first good one.

    Raises SessionError: the folder is no session, or one of a newer version. A damaged manifest or description is only named in
    `problems`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = threading.Lock()
        self._more_problems = 0
        check_is_session(folder)
        self.manifest, self.description, problems = read_about(folder)
        if self.manifest is None and isinstance(problems[0], NewerVersion):
            raise problems[0]
        self._problems = [str(problem) for problem in problems]
        self._rows: OrderedDict[int, RecordedRow | None] = OrderedDict()
        self._file: IO[bytes] | None = None
        with contextlib.suppress(OSError):  # the index names what cannot be opened
            self._file = (folder / FRAMES).open("rb")
        self._index = _RowIndex(folder / FRAMES, self._problem)
        self._pictures = _Pictures(folder, self._index.row_of, self._problem)

    def __enter__(self) -> SessionReader:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        self._index.close()
        self._pictures.close()
        if self._file is not None:
            self._file.close()

    @property
    def is_closed(self) -> bool:
        """Did it end properly?"""
        return self.manifest is not None and self.manifest.closed

    @property
    def problems(self) -> tuple[str, ...]:
        """What was found to be wrong so far, each once; after 200 they are only counted."""
        with self._lock:
            more = (f"and {self._more_problems} more",) if self._more_problems else ()
            return (*self._problems, *more)

    def _problem(self, line: str) -> None:
        with self._lock:
            if len(self._problems) < _MAX_PROBLEMS:
                self._problems.append(line)
            else:
                self._more_problems += 1

    def wait(self, timeout_s: float | None = None) -> bool:
        """Until all rows are known; False when they are not yet."""
        return self._index.wait(timeout_s)

    @property
    def missing_rows(self) -> int:
        """Rows that should be between those that are there."""
        return self._index.missing

    def __len__(self) -> int:
        """Rows known so far."""
        return len(self._index)

    def row(self, place: int) -> RecordedRow | None:
        """The n-th row; None when its values are damaged (then it is named in `problems`). Raises IndexError."""
        if not 0 <= place < len(self):
            raise IndexError(f"row {place} of {len(self)}")
        with self._lock:
            if place in self._rows:
                self._rows.move_to_end(place)
                return self._rows[place]
            offset, size = self._index.place(place)
            data = b""
            if self._file is not None:
                self._file.seek(offset)
                data = self._file.read(size)
        row = None
        try:
            check_seal(data)
            row = row_from_json(data)
        except InvalidRecord as error:
            self._problem(f"{FRAMES}: row {place}: {error}; skipped")
        with self._lock:
            self._rows[place] = row
            while len(self._rows) > _ROWS_KEPT:
                self._rows.popitem(last=False)
        return row

    def frame(self, place: int) -> Frame | None:
        """Picture, index and time of the n-th row; None when row or picture is lost. Raises IndexError."""
        row = self.row(place)
        picture = self.decoded(row.video, row.pts_ms) if row is not None else None
        return Frame(row.index, row.captured_s, _to_rgb(picture)) if row is not None and picture is not None else None

    def tick(self, place: int) -> Tick | None:
        """All that was recorded of the n-th row, as the live window would show it; None when row or picture is lost."""
        row, frame = self.row(place), self.frame(place)
        return row.tick(frame.image) if row is not None and frame is not None else None

    def timeline(self) -> Timeline:
        """Columns of the rows known so far, for plots and jumps."""
        return self._index.timeline()

    @property
    def duration_s(self) -> float:
        """From the first to the last row known so far."""
        times = self.timeline().time_s
        return float(times[-1] - times[0]) if len(times) else 0.0

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """All good events, by time."""
        found: list[Event] = []
        try:
            for line in lines_of(self.folder / EVENTS):
                try:
                    found.append(read_line(event_from_json, line))
                except InvalidRecord as error:
                    self._problem(f"{EVENTS}: line {line.number}: {error}; skipped")
        except OSError as error:
            self._problem(f"{EVENTS}: cannot be read ({error.strerror})")
        return tuple(sorted(found, key=lambda event: event.time_s))

    @cached_property
    def videos(self) -> tuple[Path, ...]:
        """The video files that are there."""
        return tuple(sorted(self.folder.glob("video_*.mkv")))

    def row_of(self, video: int, pts_ms: int) -> tuple[int, int] | None:
        """Place and number of the row whose picture is at this time (ms) of a video; None: no row has it."""
        return self._index.row_of(video, pts_ms)

    def decoded(self, video: int, pts_ms: int) -> av.VideoFrame | None:
        """A picture by file and time, as it was decoded; None when it is lost or damaged."""
        return self._pictures.decoded(video, pts_ms)


def check_is_session(folder: Path) -> None:
    """Raises SessionError when there is nothing of a session in it."""
    with disk_errors(SessionError, folder, "cannot be read", missing="no such session"):
        if folder.is_file():
            raise SessionError(f"{folder}: a session is a folder, not a file")
        names = {path.name for path in folder.iterdir()}
    if FRAMES not in names and not any(name.startswith("video_") and name.endswith(".mkv") for name in names):
        raise SessionError(f"{folder}: not a session: neither {FRAMES} nor a video in it")


Take = Callable[[int], Image | None]
"""The n-th picture of a video, RGB uint8 (H, W, 3); None: it is lost or damaged."""


def is_of_session(video: Path) -> bool:
    """Whether it is the video of a recorded session."""
    is_named_so = video.name.startswith("video_") and video_number(video) is not None
    return is_named_so and (video.absolute().parent / FRAMES).is_file()


def times_of(video: Path) -> list[int]:
    """When its pictures were, in ms, in order."""
    return sorted(set(packet_times(video)))


@contextlib.contextmanager
def session_video(video: Path) -> Iterator[tuple[list[int], Take]]:
    """The times of one of a session's videos, and how to take its pictures. Raises SessionError."""
    number = video_number(video)
    assert number is not None
    with SessionReader(video.absolute().parent) as reader:
        reader.wait()
        times_ms = times_of(video)

        def take(index: int) -> Image | None:
            frame = reader.decoded(number, times_ms[index]) if index < len(times_ms) else None
            return upright(frame) if frame is not None else None

        yield times_ms, take


def rows_cut_off(reader: SessionReader) -> int:
    """Rows that were recorded after the last one that is there. Gaps between rows are ``reader.missing_rows``."""
    manifest = reader.manifest
    if manifest is None or not manifest.closed:
        return 0
    # The gaps that a recovered copy was made with are not among its own rows.
    gaps = reader.missing_rows if manifest.recovered is None else 0
    return max(0, manifest.counts.frames - len(reader) - gaps)


def losses(reader: SessionReader, events: Sequence[Event]) -> list[str]:
    """What a session has lost since it ended, a line each; none of one that is open or was cut: its counts were never written.

    `events` are those that are there; notes that were added later were never counted.
    """
    manifest = reader.manifest
    if manifest is None or not manifest.closed:
        return []
    counts, found = manifest.counts, []
    if cut := rows_cut_off(reader):
        found.append(f"{FRAMES}: the last {cut} of {counts.frames} rows are lost")
    if (videos := len(reader.videos)) < counts.videos:
        found.append(f"{counts.videos - videos} of {counts.videos} videos are lost")
    found += [f"{path.name}: empty, its pictures are lost" for path in reader.videos if path.stat().st_size == 0]
    kept = len(events) - sum(map(was_added_later, events))
    if kept < counts.events:
        found.append(f"{EVENTS}: {counts.events - kept} of {counts.events} events are lost")
    return found
