"""The last seconds, encoded, in memory: what "save the last 30 s" writes out. Bounded in time and in bytes.

The files of one session while it is written. No thread of its own but the one that forces what is written to the disk.

JSON lines out of files that nobody trusts: each line is a checked object, or it is named and skipped.

Every line that the recorder writes ends with the CRC-32 of what is before it: without it a flipped bit in a digit would pass as a
measurement. A line without one (made by hand) is taken as it is.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import secrets
import shutil
import threading
import time
import zlib
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from io import FileIO
from pathlib import Path
from typing import Any, NoReturn

from core.config.models import RecordConfig
from core.files import name_as_text
from core.session.format import InvalidRecord
from core.session.manifest import (
    EVENTS,
    FRAMES,
    PREFIX,
    About,
    Counts,
    Event,
    EventKind,
    Manifest,
    Origin,
    SessionError,
    as_added_later,
    event_to_json,
    new_manifest,
    read_manifest,
    write_manifest,
)
from core.session.video import FrameEncoder, Packet, VideoError, VideoTrack

_MAX_EVENTS = 2000


@dataclass(frozen=True, slots=True, eq=False)
class EncodedFrame:
    """A frame ready to be written: its packet, the encoder that made it, and its row's JSON without its place in a session.

    ``dropped`` counts the frames that the recorder dropped before it, ever.
    """

    captured_s: float
    packet: Packet
    encoder: FrameEncoder
    row: str
    dropped: int = 0

    @property
    def nbytes(self) -> int:
        return len(self.packet.data) + len(self.row)


class Ring:
    """Keeps frames and events. What it holds always begins at a key picture, so it may reach up to a second further back."""

    def __init__(self, seconds: float, max_bytes: int) -> None:
        self._seconds = seconds
        self._max_bytes = max_bytes
        self._groups: deque[list[EncodedFrame]] = deque()
        self._events: deque[Event] = deque()
        self._target: Event | None = None
        self._bytes = 0

    @property
    def seconds(self) -> float:
        """How much it holds now."""
        if not self._groups:
            return 0.0
        return max(0.0, self._groups[-1][-1].captured_s - self._groups[0][0].captured_s)

    @property
    def nbytes(self) -> int:
        return self._bytes

    def add(self, frame: EncodedFrame) -> None:
        """Take a frame in and let the oldest go. Frames before the first key picture are not kept."""
        if frame.packet.is_key:
            self._groups.append([])
        if not self._groups:
            return
        self._groups[-1].append(frame)
        self._bytes += frame.nbytes
        while len(self._groups) > 1 and (self._is_old(frame.captured_s) or self._bytes > self._max_bytes):
            self._bytes -= sum(old.nbytes for old in self._groups.popleft())

    def _is_old(self, now_s: float) -> bool:
        """Is the oldest group not needed, since the next one reaches back far enough? A clock that went back ages everything."""
        age_s = now_s - self._groups[1][0].captured_s
        return age_s >= self._seconds or age_s < 0.0

    def add_event(self, event: Event) -> None:
        """Take it in and let the oldest go; the destination among these stays in force."""
        self._events.append(event)
        while len(self._events) > _MAX_EVENTS:
            old = self._events.popleft()
            if old.kind is EventKind.TARGET:
                self._target = old

    def content(self) -> tuple[list[EncodedFrame], list[Event]]:
        """A copy: the frames in order, and the events since the first of them, with the destination that was chosen before."""
        frames = [frame for group in self._groups for frame in group]
        if not frames:
            return [], []
        first_s = frames[0].captured_s
        chosen = [] if self._target is None else [self._target]
        chosen += [event for event in self._events if event.kind is EventKind.TARGET and event.time_s < first_s]
        before = [replace(event, time_s=first_s) for event in chosen[-1:] if event.data]
        return frames, before + [event for event in self._events if event.time_s >= first_s]

    def clear(self) -> None:
        self._groups.clear()
        self._events.clear()
        self._target = None
        self._bytes = 0


MAX_LINE_BYTES = 4_000_000
_CHUNK = 1 << 20
_SEAL = re.compile(rb',"crc":"([0-9a-f]{8})"}')
_SEAL_BYTES = 18


@dataclass(frozen=True, slots=True)
class FileLine:
    """A line of a file: its number from 1, where it begins, and its bytes without the line break; None when it is too long.

    ``is_cut`` tells that the file ends within it.
    """

    number: int
    offset: int
    data: bytes | None
    is_cut: bool


def sealed(line: str) -> str:
    """A JSON object as one line, with its checksum as last key."""
    return f'{line[:-1]},"crc":"{zlib.crc32(line[:-1].encode()):08x}"}}'


def is_sealed(line: FileLine) -> bool:
    """Does it carry a checksum, and the right one? Then it is what the recorder wrote."""
    seal = _seal(line.data) if line.data is not None else None
    return line.data is not None and seal is not None and seal == zlib.crc32(line.data[:-_SEAL_BYTES])


def _seal(data: bytes) -> int | None:
    found = _SEAL.fullmatch(data[-_SEAL_BYTES:])
    return int(found[1], 16) if found is not None else None


def parse_line(line: FileLine) -> dict[str, Any]:
    """The object in it. Raises Damaged: cut, checksum wrong, no JSON, NaN, nested too deeply, no object."""
    if line.data is None:
        raise InvalidRecord(f"longer than {MAX_LINE_BYTES} bytes")
    return parse(line.data, is_cut=line.is_cut)


def parse(data: bytes, *, is_cut: bool = False) -> dict[str, Any]:
    """Like `parse_line`, of bytes."""
    seal = _seal(data)
    if seal is not None and seal != zlib.crc32(data[:-_SEAL_BYTES]):
        raise InvalidRecord("checksum wrong")
    try:
        record = json.loads(data, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        if isinstance(error, InvalidRecord):
            raise
        if is_cut:
            raise InvalidRecord("cut off") from None
        raise InvalidRecord("nested too deeply" if isinstance(error, RecursionError) else "not valid JSON") from None
    if type(record) is not dict:
        raise InvalidRecord("not an object")
    return record


def _refuse(name: str) -> NoReturn:
    raise InvalidRecord(f"{name} is no number")


def lines_of(path: Path) -> Iterator[FileLine]:
    """All lines that are not blank, in order, whatever is in the file; never more than a few MB in memory. Raises OSError."""
    number, offset = 1, 0
    with path.open("rb") as file:
        while data := file.readline(MAX_LINE_BYTES):
            size = len(data)
            is_long = False
            while not data.endswith(b"\n") and (more := file.readline(_CHUNK)):
                data, is_long = more, True
                size += len(more)
            is_cut = not data.endswith(b"\n")
            data = data.removesuffix(b"\n")
            if is_long or data.strip():
                yield FileLine(number, offset, None if is_long else data, is_cut)
            number, offset = number + 1, offset + size


_STILL_S = 10.0


class LineFile:
    """A file of JSON lines, each handed to the system at once. A line that cannot be written whole is taken back.

    The lock on it lasts as long as this process: it tells a session that is being recorded from one that was cut. A drive without
    locks knows only when it was last written to.
    """

    def __init__(self, path: Path) -> None:
        # Appended to: a note that somebody else adds meanwhile, where no lock forbids it, is not written over.
        self._file = FileIO(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666), "wb")
        self._end = 0
        try:
            fcntl.flock(self._file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise
        except OSError:
            pass  # a drive without locks

    def write(self, line: str) -> int:
        """Append a line; returns its bytes. Raises OSError."""
        data = memoryview(f"{line}\n".encode())
        done = 0
        try:
            while done < len(data):
                done += self._file.write(data[done:]) or 0
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file.fileno(), self._end)
                self._file.seek(self._end)
            raise
        self._end += done
        return done

    def close(self) -> None:
        self._file.close()


def is_being_written(folder: Path) -> bool:
    """Does a living process hold this session?"""
    try:
        with (folder / FRAMES).open("rb") as file:
            fcntl.flock(file.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
            return False
    except BlockingIOError:
        return True
    except OSError:
        return _has_just_grown(folder)


def _has_just_grown(folder: Path) -> bool:
    """Whether a session that has not ended was written to in the last seconds: all that can be told on a drive without locks."""
    try:
        return time.time() - (folder / FRAMES).stat().st_mtime < _STILL_S and not read_manifest(folder).closed
    except (OSError, SessionError):
        return False


@contextlib.contextmanager
def alone_in(work: Path, busy: str) -> Iterator[None]:
    """An empty folder for one process at a time; what a killed one has left there is removed, and in the end the folder itself.

    A window leaves a recovery going on when it is closed, and the next window offers it again. Raises SessionError (`busy`) and
    OSError.
    """
    while True:
        work.mkdir(parents=True, exist_ok=True)
        held = os.open(work, os.O_RDONLY)
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(held)
            raise SessionError(busy) from None
        except OSError:
            pass  # a drive without locks
        if work.exists() and os.path.samestat(os.fstat(held), work.stat()):
            break
        os.close(held)  # the other one has just ended, and taken its folder along
    try:
        for left in work.iterdir():
            left.unlink()
        yield
    finally:
        shutil.rmtree(work, ignore_errors=True)
        os.close(held)


def add_event(session: Path, event: Event) -> Event:
    """Add an event (a note made while it is played) to a session that has ended; gives it as it is kept, marked as added later.

    Raises SessionError; nothing else is changed.
    """
    path = session / EVENTS
    event = as_added_later(event)
    line = sealed(json.dumps(event_to_json(event), allow_nan=False)) + "\n"
    if is_being_written(session):
        raise SessionError(f"{session}: is being recorded; stop the recording first")
    try:
        with path.open("a+b", buffering=0) as file:
            with contextlib.suppress(OSError):  # a drive without locks
                fcntl.flock(file.fileno(), fcntl.LOCK_EX)
            end = file.seek(0, os.SEEK_END)
            if end:
                # a last line that was cut must not swallow the new one
                file.seek(end - 1)
                line = line if file.read(1) == b"\n" else "\n" + line
            _append(file, line.encode(), end)
    except OSError as error:
        raise SessionError(f"{path}: cannot be written ({error.strerror}); the note was not kept") from None
    return event


def _append(file: FileIO, data: bytes, end: int) -> None:
    """All of it, forced to the disk, or nothing: the file ends at `end` as before. Raises OSError."""
    try:
        rest = memoryview(data)
        while rest:
            rest = rest[file.write(rest) or 0 :]
        os.fsync(file.fileno())
    except OSError:
        with contextlib.suppress(OSError):
            os.ftruncate(file.fileno(), end)
        raise


def check_parent(folder: Path) -> None:
    """Raises SessionError when no session could be made in `folder`; it is made if it is not there."""
    probe = folder / f".write-probe-{os.getpid()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise SessionError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from None


class SessionFiles:
    """A session folder being written by one thread.

    Parameters
    ----------
    parent : where the folder is made.
    first_s : time of the first frame on the frames' clock; `now_s` is the same clock now, by which it becomes a date.

    Raises
    ------
    SessionError
        When the folder cannot be made.
    """

    def __init__(
        self,
        parent: Path,
        about: About,
        config: RecordConfig,
        *,
        first_s: float,
        now_s: float,
        origin: Origin = "recorded",
    ) -> None:
        self._split_s = config.split_s
        self.started_s = first_s
        now = datetime.now(UTC)
        age_s = now_s - first_s if 0.0 <= now_s - first_s < 86_400.0 else 0.0
        started = datetime.fromtimestamp(now.timestamp() - age_s, UTC)
        session_id = secrets.token_hex(4)
        self.folder = parent / f"{PREFIX}{started:%Y%m%dT%H%M%SZ}_{session_id}"
        self._manifest = new_manifest(about, session_id, started, first_s, config.codec).model_copy(update={"origin": origin})
        self.counts = Counts()
        self.dropped_before = 0
        """Frames that the recorder had dropped before the session began."""
        try:
            parent.mkdir(parents=True, exist_ok=True)
            self.folder.mkdir()
            self.counts.bytes += write_manifest(self.folder, self._manifest)
            self._rows = LineFile(self.folder / FRAMES)
            self._events = LineFile(self.folder / EVENTS)
        except OSError as error:
            raise SessionError(f"{parent}: cannot be written ({error.strerror}); choose another folder") from None
        self._track: VideoTrack | None = None
        self._encoder: FrameEncoder | None = None
        self._track_from_s = 0.0
        self._syncer = _Syncer(self.folder, config.sync_s) if config.sync_s > 0 else None

    def wants_key(self, captured_s: float) -> bool:
        """Must the next frame be a key picture, since a new file begins with it?"""
        return self._track is None or captured_s - self._track_from_s >= self._split_s

    def write_frame(self, frame: EncodedFrame) -> None:
        """Append picture and row. Raises VideoError or OSError; the session must then be closed."""
        if frame.encoder is not self._encoder or (frame.packet.is_key and self.wants_key(frame.captured_s)):
            self._next_track(frame)
        assert self._track is not None
        pts_ms = self._track.write(frame.packet)
        place = f'{{"row":{self.counts.frames},"video":{self.counts.videos - 1},"pts_ms":{pts_ms},'
        place += f'"picture_crc":"{frame.packet.crc:08x}",'
        dropped = f',"dropped_rows":{max(0, frame.dropped - self.dropped_before)}}}'
        self.counts.bytes += self._rows.write(sealed(place + frame.row[1:-1] + dropped)) + len(frame.packet.data)
        self.counts.frames += 1

    def write_event(self, event: Event) -> None:
        """Append an event. Raises OSError."""
        self.counts.bytes += self._events.write(sealed(json.dumps(event_to_json(event), allow_nan=False)))
        self.counts.events += 1

    def _next_track(self, frame: EncodedFrame) -> None:
        if not frame.packet.is_key:
            raise VideoError("a video file must begin with a key picture")
        if self._track is not None:
            self._track.close()
        name = f"video_{self.counts.videos:04d}.mkv"
        self._track = VideoTrack(self.folder / name, frame.encoder.template)
        self._encoder, self._track_from_s = frame.encoder, frame.captured_s
        self.counts.videos += 1
        width, height = frame.encoder.size
        self.write_event(Event(frame.captured_s, EventKind.VIDEO, name, {"size": [width, height]}))

    def close(self, ended: str, dropped: int) -> str:
        """End the session: index of the video, then the manifest. Returns what went wrong, or nothing; never raises for the disk.

        A session whose video cannot be closed stays marked as cut, so that it is recovered at the next start.
        """
        problem = ""
        if self._syncer is not None:
            self._syncer.stop()
        if self._track is not None:
            try:
                self._track.close()
            except VideoError as error:
                problem = str(error)
        # before the manifest says that all is well, all must be on the disk
        _sync_files(self.folder, all_videos=True)
        self.counts.dropped = dropped
        changes = {"closed": not problem, "ended": name_as_text(ended), "ended_utc": datetime.now(UTC), "counts": self.counts}
        try:
            write_manifest(self.folder, self._manifest.model_copy(update=changes))
        except OSError as error:
            problem = problem or f"{self.folder}: the manifest cannot be written ({error.strerror})"
        with contextlib.suppress(OSError):
            self._rows.close()
            self._events.close()
        return problem

    @property
    def manifest(self) -> Manifest:
        return self._manifest


class _Syncer:
    """Forces the files to the disk now and then, for the day when the power goes. A slow disk delays only this thread."""

    def __init__(self, folder: Path, every_s: float) -> None:
        self._folder = folder
        self._every_s = every_s
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="session sync", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(self._every_s):
            _sync_files(self._folder)

    def stop(self) -> None:
        self._stop.set()


def _sync_files(folder: Path, *, all_videos: bool = False) -> None:
    """Now and then only the newest video, since one that was ended just before may have been forced too early: in the end, all.

    What cannot be forced now is written by the system later.
    """
    videos = sorted(folder.glob("video_*.mkv"))
    for path in (folder / FRAMES, folder / EVENTS, *(videos if all_videos else videos[-1:])):
        with contextlib.suppress(OSError):
            handle = os.open(path, os.O_RDONLY)
            try:
                os.fdatasync(handle)
            finally:
                os.close(handle)
