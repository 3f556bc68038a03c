"""The files of a session while it is written, and JSON lines that may be damaged when they are read.

Every line that the recorder writes ends with the CRC-32 of what is before it: without it a flipped bit in a digit would pass as a
measurement. A line without one (made by hand) is taken as it is.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import secrets
import shutil
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from io import FileIO
from pathlib import Path
from typing import TypeVar

from core.config.models import RecordConfig
from core.devices import disk_errors
from core.files import name_as_text
from core.locks import lock_file
from core.program import program_id
from core.session.codec import InvalidRecord
from core.session.manifest import (
    ADDED_LATER,
    EVENTS,
    FRAMES,
    PREFIX,
    About,
    Counts,
    Event,
    EventKind,
    Origin,
    SessionError,
    event_to_json,
    new_manifest,
    program_versions,
    read_manifest,
    write_manifest,
)
from core.session.video import FrameEncoder, Packet, VideoError, VideoTrack

MAX_LINE_BYTES = 4_000_000
_CHUNK = 1 << 20
_SEAL = re.compile(rb',"crc":"([0-9a-f]{8})"}')
_SEAL_BYTES = 18
_STILL_S = 10.0  # on a drive without locks a file that was written to so recently counts as being written

T = TypeVar("T")


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
    """Whether it has a checksum, and the right one: then it is what the recorder wrote."""
    if line.data is None:
        return False
    seal = _SEAL.fullmatch(line.data[-_SEAL_BYTES:])
    return seal is not None and int(seal[1], 16) == zlib.crc32(line.data[:-_SEAL_BYTES])


def check_seal(data: bytes) -> None:
    """Raises InvalidRecord when the checksum of a line is wrong; a line without one passes."""
    seal = _SEAL.fullmatch(data[-_SEAL_BYTES:])
    if seal is not None and int(seal[1], 16) != zlib.crc32(data[:-_SEAL_BYTES]):
        raise InvalidRecord("checksum wrong")


def read_line(read: Callable[[bytes], T], line: FileLine) -> T:
    """What `read` makes of a line. Raises InvalidRecord: too long, checksum wrong, cut, or damaged."""
    if line.data is None:
        raise InvalidRecord(f"longer than {MAX_LINE_BYTES} bytes")
    check_seal(line.data)
    try:
        return read(line.data)
    except InvalidRecord:
        if line.is_cut:
            raise InvalidRecord("cut off") from None
        raise


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


def _append(file: FileIO, line: str, end: int) -> int:
    """Append all of a line to a file of `end` bytes, or nothing; returns its bytes. Raises OSError."""
    data = memoryview(line.encode())
    done = 0
    try:
        while done < len(data):
            done += file.write(data[done:]) or 0
    except OSError:
        with contextlib.suppress(OSError):
            os.ftruncate(file.fileno(), end)
        raise
    return done


class LineFile:
    """A new file of JSON lines, each handed to the system at once. A line that cannot be written whole is taken back.

    The lock on it lasts as long as this process: it distinguishes a session that is being recorded from one that was cut.
    """

    def __init__(self, path: Path) -> None:
        # Opened for appending: a note that another process adds where no lock forbids it is not overwritten.
        self._file = FileIO(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666), "wb")
        self._end = 0
        try:
            lock_file(self._file.fileno())
        except BlockingIOError:
            self._file.close()
            raise
        except OSError:
            pass  # a drive without locks

    def write(self, line: str) -> int:
        """Append a line; returns its bytes. Raises OSError."""
        size = _append(self._file, f"{line}\n", self._end)
        self._end += size
        return size

    def close(self) -> None:
        self._file.close()


def is_being_written(folder: Path) -> bool:
    """Does a living process hold this session?"""
    try:
        with (folder / FRAMES).open("rb") as file:
            lock_file(file.fileno(), is_shared=True)
            return False
    except BlockingIOError:
        return True
    except OSError:  # a drive without locks
        try:
            return time.time() - (folder / FRAMES).stat().st_mtime < _STILL_S and not read_manifest(folder).closed
        except (OSError, SessionError):
            return False


@contextlib.contextmanager
def alone_in(work: Path, busy: str) -> Iterator[None]:
    """An empty folder for one process at a time; what a killed one has left there is removed, and in the end the folder itself.

    A closed window may leave a recovery running, and the next window offers it again. Raises SessionError (`busy`) and OSError.
    """
    held: int | None = None
    while True:
        work.mkdir(parents=True, exist_ok=True)
        if os.name == "nt":  # a folder cannot be opened there, and so not be locked
            break
        held = os.open(work, os.O_RDONLY)
        try:
            lock_file(held)
        except BlockingIOError:
            os.close(held)
            raise SessionError(busy) from None
        except OSError:
            pass  # a drive without locks
        if work.exists() and os.path.samestat(os.fstat(held), work.stat()):
            break
        os.close(held)  # the other process has just ended, and removed its folder
    try:
        for left in work.iterdir():
            left.unlink()
        yield
    finally:
        shutil.rmtree(work, ignore_errors=True)
        if held is not None:
            os.close(held)


def add_event(session: Path, event: Event) -> Event:
    """Add an event (a note made while it is played) to a session that has ended; gives it as it is kept, marked as added later.

    Raises SessionError; nothing else is changed.
    """
    path = session / EVENTS
    event = replace(event, data=event.data | {ADDED_LATER: True})
    line = sealed(json.dumps(event_to_json(event), allow_nan=False)) + "\n"
    if is_being_written(session):
        raise SessionError(f"{session}: is being recorded; stop the recording first")
    with disk_errors(SessionError, path, "cannot be written", "; the note was not kept"):
        with path.open("a+b", buffering=0) as file:
            with contextlib.suppress(OSError):  # a drive without locks
                lock_file(file.fileno(), waits=True)
            end = file.seek(0, os.SEEK_END)
            if end:
                file.seek(end - 1)
                line = line if file.read(1) == b"\n" else "\n" + line  # a last line that was cut must not swallow the new one
            _append(file, line, end)
            try:
                os.fsync(file.fileno())
            except OSError:
                with contextlib.suppress(OSError):
                    os.ftruncate(file.fileno(), end)
                raise
    return event


def check_parent(folder: Path) -> None:
    """Raises SessionError when no session could be made in `folder`; it is made if it is not there."""
    probe = folder / f".write-probe-{os.getpid()}"
    with disk_errors(SessionError, folder, "cannot be written", "; choose another folder"):
        folder.mkdir(parents=True, exist_ok=True)
        probe.write_bytes(b"")
        probe.unlink()


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


class SessionFiles:
    """A session folder in `parent` being written by one thread. Raises SessionError: it cannot be made.

    `first_s` is the time of the first frame on the frames' clock; `now_s` is the same clock now, by which it becomes a date.
    """

    def __init__(
        self, parent: Path, about: About, config: RecordConfig, *, first_s: float, now_s: float, origin: Origin = "recorded"
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
        with disk_errors(SessionError, parent, "cannot be written", "; choose another folder"):
            parent.mkdir(parents=True, exist_ok=True)
            self.folder.mkdir()
            self.counts.bytes += write_manifest(self.folder, self._manifest)
            self._rows = LineFile(self.folder / FRAMES)
            self._events = LineFile(self.folder / EVENTS)
        self._track: VideoTrack | None = None
        self._encoder: FrameEncoder | None = None
        self._track_from_s = 0.0
        self._is_closed = threading.Event()
        if config.sync_s > 0:
            threading.Thread(target=self._sync_until_closed, args=(config.sync_s,), name="session sync", daemon=True).start()

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
        self._is_closed.set()
        if self._track is not None:
            try:
                self._track.close()
            except VideoError as error:
                problem = str(error)
        # all must be on the disk before the manifest is closed
        _sync_files(self.folder, all_videos=True)
        self.counts.dropped = dropped
        changes = {"closed": not problem, "ended": name_as_text(ended), "ended_utc": datetime.now(UTC), "counts": self.counts}
        changes["versions"] = self._manifest.versions | program_versions(program_id())  # git may not have answered in the beginning
        try:
            write_manifest(self.folder, self._manifest.model_copy(update=changes))
        except OSError as error:
            problem = problem or f"{self.folder}: the manifest cannot be written ({error.strerror})"
        with contextlib.suppress(OSError):
            self._rows.close()
            self._events.close()
        return problem

    def _sync_until_closed(self, every_s: float) -> None:
        """A thread of its own: a slow disk delays no writing."""
        while not self._is_closed.wait(every_s):
            _sync_files(self.folder)


def _sync_files(folder: Path, *, all_videos: bool = False) -> None:
    """Force rows, events and the newest video to the disk; at the end all videos, since one that was closed in between may have
    been forced before its index was written. What cannot be forced now is written by the system later."""
    videos = sorted(folder.glob("video_*.mkv"))
    for path in (folder / FRAMES, folder / EVENTS, *(videos if all_videos else videos[-1:])):
        with contextlib.suppress(OSError):
            handle = os.open(path, os.O_RDONLY)
            try:
                os.fdatasync(handle)
            finally:
                os.close(handle)
