"""Sessions that were cut (kill, power, full disk): found, and repaired into a copy. The original is never touched."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from core.files import name_as_text, sync_folder
from core.session.codec import Count, InvalidRecord, JsonLayout, read_json, row_from_json
from core.session.files import FileLine, alone_in, is_being_written, is_sealed, lines_of, read_line
from core.session.manifest import (
    DESCRIPTION,
    EVENTS,
    FRAMES,
    PREFIX,
    RECOVERED,
    Counts,
    EventKind,
    Loss,
    Manifest,
    NewerVersion,
    SessionError,
    event_from_json,
    read_manifest,
    was_added_later,
    write_manifest,
)
from core.session.reader import check_is_session, row_columns
from core.session.video import VideoError, packet_times, remux, video_number

_PROBLEMS_KEPT = 50
OnBytes = Callable[[int], None]
"""Called with the number of bytes that were read since the last call."""


@dataclass(frozen=True, slots=True)
class CutSession:
    """A session that did not end properly. ``why`` is one line."""

    folder: Path
    why: str
    bytes: int


@dataclass(frozen=True, slots=True)
class Recovery:
    """A recovered copy. ``loss`` tells what it lacks, in seconds, rows and pictures; ``frames`` what it has."""

    folder: Path
    frames: int
    pictures: int
    loss: Loss


def find_cut_sessions(folder: Path) -> tuple[CutSession, ...]:
    """Sessions in `folder` that were cut, that no process is writing, and that have not been recovered yet; oldest first."""
    found = []
    try:
        candidates = sorted(path for path in folder.iterdir() if path.name.startswith(PREFIX) and path.is_dir())
    except OSError:
        return ()
    for path in candidates:
        if path.name.endswith(RECOVERED) or (folder / (path.name + RECOVERED)).exists():
            continue
        why = _why_cut(path)
        if why and not is_being_written(path):
            found.append(CutSession(path, why, payload_bytes(path)))
    return tuple(found)


def _why_cut(folder: Path) -> str:
    """Empty when it is well, holds nothing, or is of a newer version."""
    if not payload_bytes(folder):
        return ""
    try:
        return "" if read_manifest(folder).closed else "it did not end properly"
    except NewerVersion:
        return ""
    except SessionError as error:
        return str(error)


def payload_bytes(folder: Path) -> int:
    """Bytes of rows and videos."""
    total = 0
    for path in (folder / FRAMES, *folder.glob("video_*.mkv")):
        try:
            total += path.stat().st_size
        except OSError:
            continue
    return total


class _Dropped(JsonLayout):
    dropped_rows: Count = 0


@dataclass(slots=True)
class _Salvage:
    """What was found so far.

    ``rows`` are the numbers of all good rows, ``captured_s`` their times, ``expected`` the time in its video file (ms) and the row
    number of each of their pictures, by file; ``kept`` are the files and times of the pictures that are there.
    """

    problems: list[str] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    captured_s: list[float] = field(default_factory=list)
    expected: dict[int, dict[int, int]] = field(default_factory=dict)
    events: int = 0
    dropped: int = 0
    last_event_s: float | None = None
    kept: set[tuple[int, int]] = field(default_factory=set)
    videos: int = 0

    def read_rows(self, source: Path, target: Path, on_bytes: OnBytes) -> None:
        """Copy the good lines as they are, and name the others."""
        last = self._copy_lines(source, target, self._add_row, on_bytes)
        if last is not None:  # a session that was cut has no count in its manifest
            with contextlib.suppress(InvalidRecord):
                self.dropped = max(self.dropped, read_json(_Dropped, last).dropped_rows)

    def read_events(self, source: Path, target: Path) -> None:
        self._copy_lines(source, target, self._add_event, lambda _: None)

    def _copy_lines(self, source: Path, target: Path, add: Callable[[FileLine], None], on_bytes: OnBytes) -> bytes | None:
        """Returns the last good line. Raises OSError for what may be read another time."""
        last: bytes | None = None
        with target.open("wb") as output:
            try:
                for line in lines_of(source):
                    on_bytes(len(line.data or b""))
                    try:
                        add(line)
                    except InvalidRecord as error:
                        self.problems.append(f"{source.name}: line {line.number}: {error}; left out")
                    else:
                        last = line.data or b""
                        output.write(last + b"\n")
            except FileNotFoundError:
                self.problems.append(f"{source.name}: missing")
            except OSError as error:
                if error.errno != errno.EIO:
                    raise
                self.problems.append(f"{source.name}: cannot be read further ({error.strerror})")
        return last

    def _add_row(self, line: FileLine) -> None:
        columns = row_columns(line)
        if not is_sealed(line):  # a sealed row is as it was written
            read_line(row_from_json, line)
        if self.rows and columns.row <= self.rows[-1]:
            raise InvalidRecord(f"row {columns.row} after row {self.rows[-1]}")
        self.rows.append(columns.row)
        self.captured_s.append(columns.captured_s)
        self.expected.setdefault(columns.video, {})[columns.pts_ms] = columns.row

    def _add_event(self, line: FileLine) -> None:
        event = read_line(event_from_json, line)
        if was_added_later(event):
            return  # kept, but neither counted nor a sign of how long was recorded
        self.events += 1
        self.last_event_s = event.time_s
        if event.kind is EventKind.DROPPED and isinstance(total := event.data.get("total"), int):
            self.dropped = max(self.dropped, total)

    def copy_video(self, path: Path, target: Path) -> None:
        video = video_number(path)
        if video is None:
            self.problems.append(f"{path.name}: not a name of ours; left out")
            return
        kept_ms, problems = remux(path, target, self.expected.get(video, {}))
        self.problems += problems
        self.kept |= {(video, pts_ms) for pts_ms in kept_ms}
        self.videos += bool(kept_ms)

    def check_anything(self, session: Path) -> None:
        if not self.rows and not self.kept:
            raise SessionError(f"{session}: nothing left to recover: neither rows nor pictures can be read")

    def period_s(self) -> float:
        """Time from picture to picture, by the rows, by the videos where rows are lost, or as cameras usually have it."""
        kept = sorted(self.kept)
        steps_s = [(after - before) / 1000.0 for (video, before), (same, after) in pairwise(kept) if video == same]
        for steps in (np.diff(self.captured_s), np.array(steps_s)):
            if (steps > 0).any():
                return float(np.median(steps[steps > 0]))
        return 1.0 / 30.0


def recover(session: Path, into: Path | None = None, on_bytes: OnBytes = lambda _: None) -> Recovery:
    """Repair a session into a copy beside it, or in `into`: ``<name>_recovered``. `on_bytes` is called with progress.

    Raises SessionError: not a session, being recorded or recovered, recovered before, nothing left in it, or the copy cannot be
    written.
    """
    session = Path(os.path.abspath(session))  # "." and ".." have names, too
    check_is_session(session)
    if is_being_written(session):
        raise SessionError(f"{session}: is being recorded; stop the recording first")
    parent = session.parent if into is None else into.absolute()
    target, work = parent / (session.name + RECOVERED), parent / f".{session.name}.recovering"
    try:
        with alone_in(work, f"{session}: is being recovered already; wait until that has ended"):
            if target.exists():
                raise SessionError(f"{target}: is there already; remove it to recover again")
            recovery = _salvage(session, work, target, on_bytes)
            for path in work.iterdir():
                with path.open("rb") as file:
                    os.fsync(file.fileno())
            work.rename(target)
            with contextlib.suppress(OSError):  # some file systems cannot; the copy is in place by now
                sync_folder(parent)
    except VideoError as error:
        raise SessionError(f"{error}; make room or choose another folder") from None
    except OSError as error:
        is_source = error.filename is not None and Path(error.filename).parent == session
        what_to_do = "let it be read, and try again" if is_source else "make room or choose another folder"
        raise SessionError(f"{error.filename or work}: {error.strerror or error}; {what_to_do}") from None
    return recovery


def expected_loss(session: Path, on_bytes: OnBytes = lambda _: None) -> Recovery:
    """What `recover` would find, without writing anything. Pictures count as there when their packets are: none is decoded.

    Raises SessionError: not a session, being recorded, of a newer version, or nothing left in it.
    """
    session = Path(os.path.abspath(session))  # "." and ".." have names, too
    check_is_session(session)
    if is_being_written(session):
        raise SessionError(f"{session}: is being recorded; stop the recording first")
    manifest, problems = _manifest_of(session)
    found = _Salvage(problems)
    found.read_rows(session / FRAMES, Path(os.devnull), on_bytes)
    found.read_events(session / EVENTS, Path(os.devnull))
    for path in sorted(session.glob("video_*.mkv")):
        if (video := video_number(path)) is not None:
            found.kept |= {(video, pts_ms) for pts_ms in packet_times(path)}
        on_bytes(path.stat().st_size)
    found.check_anything(session)
    return Recovery(session, len(found.rows), len(found.kept), _loss(session, manifest, found))


def _manifest_of(session: Path) -> tuple[Manifest, list[str]]:
    """The manifest, or one that claims nothing, and what is wrong with it. Raises SessionError for a newer version."""
    try:
        return read_manifest(session), []
    except NewerVersion:
        raise
    except SessionError as error:
        return unknown_manifest(session), [str(error)]


def _salvage(session: Path, work: Path, target: Path, on_bytes: OnBytes) -> Recovery:
    manifest, problems = _manifest_of(session)
    is_unknown = bool(problems)
    found = _Salvage(problems)
    found.read_rows(session / FRAMES, work / FRAMES, on_bytes)
    found.read_events(session / EVENTS, work / EVENTS)
    for path in sorted(session.glob("video_*.mkv")):
        found.copy_video(path, work / path.name)
        on_bytes(path.stat().st_size)
    found.check_anything(session)
    with contextlib.suppress(FileNotFoundError):
        shutil.copy(session / DESCRIPTION, work / DESCRIPTION)
    if is_unknown and found.rows:
        # The zero of the rows' clock is unknown; the time in the folder's name is that of the first row.
        manifest = manifest.model_copy(update={"started_monotonic_s": found.captured_s[0]})
    loss = _loss(session, manifest, found)
    counts = Counts(frames=len(found.rows), events=found.events, videos=found.videos)
    counts.dropped = max(found.dropped, manifest.counts.dropped)
    counts.bytes = sum(path.stat().st_size for path in work.iterdir())
    ended = {"closed": True, "ended": manifest.ended or "cut", "counts": counts, "recovered": loss}
    write_manifest(work, manifest.model_copy(update=ended))
    return Recovery(target, len(found.rows), len(found.kept), loss)


def unknown_manifest(session: Path) -> Manifest:
    """A manifest for a session whose own is lost: nothing is claimed."""
    try:
        started = datetime.strptime(session.name.removeprefix(PREFIX)[:16], "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC)
    except ValueError:
        started = datetime.fromtimestamp(0, UTC)
    name = name_as_text(session.name)
    return Manifest(id=name.rpartition("_")[2][:64], kind="UNKNOWN", started_utc=started, started_monotonic_s=0.0)


def _loss(session: Path, manifest: Manifest, found: _Salvage) -> Loss:
    """Rows that are missing, pictures of rows that are missing, and the time that both make up."""
    expected = {(video, pts_ms) for video, pictures in found.expected.items() for pts_ms in pictures}
    pictures = len(expected - found.kept)
    before = manifest.recovered  # of a copy that is recovered again: it has counted the rows that it has
    whole = max(found.rows[-1] + 1 if found.rows else 0, manifest.counts.frames + (before.rows if before else 0))
    rows = max(whole - len(found.rows), len(found.kept - expected))
    seconds = (pictures + rows) * found.period_s()
    if found.last_event_s is not None and found.rows and not manifest.closed:
        seconds = max(seconds, found.last_event_s - found.captured_s[-1])  # it was recording at least until its last event
    told_before = before.problems if before else ()
    problems = [*told_before, *found.problems[:_PROBLEMS_KEPT]]
    if len(found.problems) > _PROBLEMS_KEPT:
        problems.append(f"and {len(found.problems) - _PROBLEMS_KEPT} more")
    return Loss(
        origin=name_as_text(session),
        recovered_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        seconds=round(max(seconds, before.seconds if before else 0.0), 3),
        rows=rows,
        pictures=pictures,
        problems=tuple(name_as_text(problem) for problem in problems),
    )
