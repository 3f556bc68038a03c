"""The videos of a recorded session: its rows know how each picture was written, so that no damage in them passes.

Pictures out of a session's video files, one at a time, by their time: decoded when asked for, never a neighbour's instead.

A recorded session, read with suspicion: each bad record is named and skipped, a lost picture is None, nothing is guessed.

Where each row of ``frames.jsonl`` is, and what the timeline shows of it: read once, in the background, a few bytes a row.

What a session that ended properly has lost since, by its own counts: rows cut off at the end, videos and events that went.
"""

from __future__ import annotations

import contextlib
import re
import threading
from array import array
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import av
import av.error
import cv2
import numpy as np
from av import VideoFrame
from numpy.typing import NDArray

from core.control.modes import Mode
from core.session.files import FileLine, is_sealed, lines_of, parse, parse_line
from core.session.format import InvalidRecord, RecordedRow, count, maybe_number, moment, row_from_json, text
from core.session.manifest import EVENTS, FRAMES, Event, Manifest, SessionError, event_from_json, read_manifest, was_added_later
from core.session.video import Known, PacketCheck, PictureRow, has_h264, open_video, upright
from core.types import Frame, Image, PoseState, Tick

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


_STATES: dict[Any, int] = {None: -1, **{state.value: place for place, state in enumerate(PoseState)}}
_MODES: dict[Any, int] = {None: -1, **{mode.value: place for place, mode in enumerate(Mode)}}
_PUBLISH_EVERY = 500

Columns = tuple[int, float, int, int, float, int, int, int]
"""Row, time (s), file, time in it (ms), theta (deg), places of state and mode, checksum of the picture."""


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """Columns of all rows that have been read so far, each of shape (N,).

    ``time_s`` is the capture time on the recorded clock. ``state`` and ``mode`` are places in ``PoseState`` and ``Mode``, -1 where
    there is none. ``theta_deg`` is signed, and NaN where there is none (an array for plots has no None).
    """

    row: NDArray[np.int64]
    time_s: NDArray[np.float64]
    video: NDArray[np.int64]
    pts_ms: NDArray[np.int64]
    theta_deg: NDArray[np.float64]
    state: NDArray[np.int8]
    mode: NDArray[np.int8]


class RowIndex:
    """Reads the rows' places in a thread; what it has read so far can be used at once.

    Parameters
    ----------
    on_problem : is told of each bad record, in the thread.
    """

    def __init__(self, path: Path, on_problem: Callable[[str], None]) -> None:
        self._path = path
        self._on_problem = on_problem
        self._lock = threading.Lock()
        self._offsets, self._sizes = array("q"), array("q")
        self._columns: tuple[array[Any], ...] = tuple(array(code) for code in "qdqqdbbq")
        self._keys = array("q")
        self._stop = threading.Event()
        self._done = threading.Event()
        self.missing = 0
        self._thread = threading.Thread(target=self._read, name="row index", daemon=True)
        self._thread.start()

    def __len__(self) -> int:
        """Rows that can be used now."""
        with self._lock:
            return len(self._offsets)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Until all is read; False when it is not yet."""
        return self._done.wait(timeout_s)

    def place(self, row: int) -> tuple[int, int]:
        """Offset and size in bytes of the n-th good row. Raises IndexError."""
        with self._lock:
            return self._offsets[row], self._sizes[row]

    def timeline(self) -> Timeline:
        """A copy of the columns so far."""
        with self._lock:
            row, time_s, video, pts, theta, state, mode, _ = (np.array(column) for column in self._columns)
        return Timeline(row, time_s, video, pts, theta, state, mode)

    def picture(self, video: int, pts_ms: int) -> PictureRow | None:
        """The row whose picture is at this time of this file; None: no such row yet."""
        key = _key(video, pts_ms)
        with self._lock:
            place = bisect_left(self._keys, key)
            if place == len(self._keys) or self._keys[place] != key:
                return None
            number, crc = self._columns[0][place], self._columns[-1][place]
        return PictureRow(place, number, None if crc < 0 else crc)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()

    def _read(self) -> None:
        waiting: list[tuple[int, int, tuple[Any, ...]]] = []
        last_row = -1
        try:
            for line in lines_of(self._path):
                if self._stop.is_set():
                    return
                try:
                    columns = quick_columns(line) or columns_of(parse_line(line))
                    if columns[0] <= last_row:
                        raise InvalidRecord(f"row {columns[0]} after row {last_row}")
                except InvalidRecord as error:
                    self._on_problem(f"{self._path.name}: line {line.number}: {error}; skipped")
                    continue
                self.missing += columns[0] - last_row - 1
                last_row = columns[0]
                waiting.append((line.offset, len(line.data or b""), columns))
                if len(waiting) >= _PUBLISH_EVERY or len(self._offsets) == 0:
                    self._publish(waiting)
                    waiting = []
        except FileNotFoundError:
            self._on_problem(f"{self._path.name}: missing")
        except OSError as error:
            self._on_problem(f"{self._path.name}: cannot be read further ({error.strerror})")
        finally:
            self._publish(waiting)
            self._done.set()

    def _publish(self, waiting: list[tuple[int, int, tuple[Any, ...]]]) -> None:
        with self._lock:
            for offset, size, values in waiting:
                self._offsets.append(offset)
                self._sizes.append(size)
                self._keys.append(_key(values[2], values[3]))
                for column, value in zip(self._columns, values, strict=True):
                    column.append(value)


def _key(video: int, pts_ms: int) -> int:
    """One number that orders files and times."""
    return (min(video, 2**20) << 42) + min(pts_ms, 2**42 - 1)


# What the recorder writes at the beginning of a row. Measured: 12 us a row, where reading all of its JSON takes 100.
_NUMBER = rb"(-?\d{1,15}(?:\.\d{1,9})?)"
_HEAD = re.compile(
    rb'{"row":(\d{1,18}),"video":(\d{1,9}),"pts_ms":(\d{1,18}),"picture_crc":"([0-9a-f]{8})","index":\d+,"captured_s":'
    + _NUMBER
    + rb',[^{}]{0,200}"mode":(?:null|"('
    + "|".join(Mode).encode()
    + rb')"),"state":(?:null|"([A-D])"),"theta_signed_deg":(?:null|'
    + _NUMBER
    + rb"),"
)


def quick_columns(line: FileLine) -> Columns | None:
    """The columns of a row whose checksum proves that it is the recorder's; None for others, which must be read whole."""
    found = _HEAD.match(line.data) if line.data is not None else None
    if found is None or not is_sealed(line):
        return None
    row, video, pts_ms, crc, captured_s, mode, state, theta = found.groups()
    return (
        int(row),
        float(captured_s),
        int(video),
        int(pts_ms),
        float(theta) if theta is not None else float("nan"),
        _STATES[state.decode() if state is not None else None],
        _MODES[mode.decode() if mode is not None else None],
        int(crc, 16),
    )


def columns_of(record: dict[str, Any]) -> Columns:
    """What the timeline needs. Raises Damaged."""
    theta = maybe_number(record.get("theta_signed_deg"), "theta_signed_deg")
    state, mode = record.get("state"), record.get("mode")
    if not isinstance(state, str | None) or not isinstance(mode, str | None):
        raise InvalidRecord("state or mode: not a text")
    return (
        count(record.get("row"), "row"),
        moment(record.get("captured_s"), "captured_s"),
        count(record.get("video"), "video"),
        count(record.get("pts_ms"), "pts_ms"),
        float("nan") if theta is None else theta,
        _STATES.get(state, -1),  # a later version may know more of them
        _MODES.get(mode, -1),
        _crc(record.get("picture_crc")),
    )


def _crc(value: Any) -> int:
    """-1 where a row made by hand has none."""
    if value is None:
        return -1
    try:
        return int(text(value, "picture_crc"), 16) & 0xFFFFFFFF
    except ValueError:
        raise InvalidRecord("picture_crc: no checksum") from None


_MAX_PROBLEMS = 200
_ROWS_KEPT = 16
"""A row with its masks weighs megabytes."""


class SessionReader:
    """An open session. All methods may be called from any thread.

    It opens at once; rows become available as they are read in the background, an hour of them in some seconds. ``wait`` waits
    for all of them. Rows are counted as they are readable: ``row(0)`` is the first good one.

    Raises
    ------
    SessionError
        When the folder is no session, or one of a newer version. A damaged manifest is only named in `problems`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._lock = threading.Lock()
        self._problems: list[str] = []
        self._more_problems = 0
        self._later: set[str] = set()
        self.manifest: Manifest | None = self._read_manifest()
        self._rows: OrderedDict[int, RecordedRow | None] = OrderedDict()
        self._file: IO[bytes] | None = None
        # what cannot be opened is named by the index
        with contextlib.suppress(OSError):
            self._file = (folder / FRAMES).open("rb")
        self._index = RowIndex(folder / FRAMES, self._problem)
        self._pictures = Pictures(folder, self._index.picture, self._problem)

    def __enter__(self) -> SessionReader:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        self._index.close()
        self._pictures.close()
        if self._file is not None:
            self._file.close()

    def _read_manifest(self) -> Manifest | None:
        check_is_session(self.folder)
        try:
            return read_manifest(self.folder)
        except SessionError as error:
            if "newer version" in str(error):
                raise
            self._problem(str(error))
            return None

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
        row = self._read_row(place, data)
        with self._lock:
            self._rows[place] = row
            while len(self._rows) > _ROWS_KEPT:
                self._rows.popitem(last=False)
        return row

    def _read_row(self, place: int, data: bytes) -> RecordedRow | None:
        try:
            row = row_from_json(parse(data))
        except InvalidRecord as error:
            self._problem(f"{FRAMES}: row {place}: {error}; skipped")
            return None
        for word in row.unknown:
            self._tell_later(word)
        return row

    def _tell_later(self, word: str) -> None:
        with self._lock:
            is_new = word not in self._later
            self._later.add(word)
        if is_new:
            self._problem(f"{FRAMES}: {word} is a word of a later version, and is left out; update the program to see it")

    def frame(self, place: int) -> Frame | None:
        """Picture, index and time of the n-th row; None when row or picture is lost. Raises IndexError."""
        row = self.row(place)
        image = self._pictures.picture(row.video, row.pts_ms) if row is not None else None
        return Frame(row.index, row.captured_s, image) if row is not None and image is not None else None

    def tick(self, place: int) -> Tick | None:
        """All that was recorded of the n-th row, as the live window would show it; None when row or picture is lost."""
        row, frame = self.row(place), self.frame(place)
        return row.tick(frame.image) if row is not None and frame is not None else None

    def timeline(self) -> Timeline:
        """Columns of the rows known so far, for plots and jumps."""
        return self._index.timeline()

    def place_at(self, time_s: float) -> int:
        """The row shown at a time of the recorded clock: the last one captured until then, or the first. Raises IndexError."""
        times = self.timeline().time_s
        if not len(times):
            raise IndexError("no rows")
        # a clock that went back must not confuse the search
        return max(0, int(np.searchsorted(np.maximum.accumulate(times), time_s, side="right")) - 1)

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
                    found.append(event_from_json(parse_line(line)))
                except InvalidRecord as error:
                    self._problem(f"{EVENTS}: line {line.number}: {error}; skipped")
        except OSError as error:
            self._problem(f"{EVENTS}: cannot be read ({error.strerror})")
        return tuple(sorted(found, key=lambda event: event.time_s))

    @cached_property
    def videos(self) -> tuple[Path, ...]:
        """The video files that are there."""
        return tuple(sorted(self.folder.glob("video_*.mkv")))

    @cached_property
    def loose_pictures(self) -> tuple[tuple[int, int], ...]:
        """(video, pts_ms) of all pictures in the files, for a session that has lost its rows. Reads the files once, undecoded."""
        found: list[tuple[int, int]] = []
        for path in self.videos:
            if (number := video_number(path)) is not None:
                found += [(number, pts_ms) for pts_ms, _ in packet_times(path)]
        return tuple(found)

    def known_picture(self, video: int, pts_ms: int) -> PictureRow | None:
        """What the rows tell of a picture."""
        return self._index.picture(video, pts_ms)

    def loose_picture(self, video: int, pts_ms: int) -> Image | None:
        """A picture by file and time."""
        return self._pictures.picture(video, pts_ms)

    def decoded(self, video: int, pts_ms: int) -> VideoFrame | None:
        """A picture by file and time, as it was decoded; None when it is lost or damaged."""
        return self._pictures.decoded(video, pts_ms)


def check_is_session(folder: Path) -> None:
    """Raises SessionError when there is nothing of a session in it."""
    try:
        names = {path.name for path in folder.iterdir()}
    except FileNotFoundError:
        raise SessionError(f"{folder}: no such session") from None
    except NotADirectoryError:
        raise SessionError(f"{folder}: a session is a folder, not a file") from None
    except OSError as error:
        raise SessionError(f"{folder}: cannot be read ({error.strerror})") from None
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
    return sorted({pts_ms for pts_ms, _ in packet_times(video)})


@contextmanager
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
    """A line for each kind of loss; of a session that is still open or was cut, none: its counts were never written.

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
