"""Sessions that were cut (kill, power, full disk): found, and repaired into a copy. The original is never touched."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from core.files import name_as_text, sync_folder
from core.session.files import FileLine, alone_in, is_being_written, is_sealed, lines_of, parse_line
from core.session.format import InvalidRecord, count, row_from_json
from core.session.manifest import (
    EVENTS,
    FRAMES,
    PREFIX,
    RECOVERED,
    Counts,
    EventKind,
    Loss,
    Manifest,
    SessionError,
    event_from_json,
    read_manifest,
    was_added_later,
    write_manifest,
)
from core.session.reader import check_is_session, columns_of, packet_times, quick_columns, video_number
from core.session.video import Expected, VideoError, remux

_PROBLEMS_KEPT = 50


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
    """Sessions in `folder` that were cut, that nobody is writing, and that have not been recovered yet; oldest first."""
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
    except SessionError as error:
        return "" if "newer version" in str(error) else str(error)


def payload_bytes(folder: Path) -> int:
    """Bytes of rows and videos."""
    total = 0
    for path in (folder / FRAMES, *folder.glob("video_*.mkv")):
        try:
            total += path.stat().st_size
        except OSError:
            continue
    return total


@dataclass(slots=True)
class _Salvage:
    """What was found so far. ``places`` are the video, time (ms) and capture time (s) of every good row, ``expected`` what that
    means for each video file."""

    problems: list[str] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    places: list[tuple[int, int, float]] = field(default_factory=list)
    expected: dict[int, list[Expected]] = field(default_factory=dict)
    last_row: FileLine | None = None
    events: int = 0
    dropped: int = 0
    last_event_s: float | None = None
    kept: set[tuple[int, int]] = field(default_factory=set)
    videos: int = 0


_Take = Callable[[FileLine, _Salvage], None]
OnBytes = Callable[[int], None]


def recover(session: Path, into: Path | None = None, on_bytes: OnBytes = lambda _: None) -> Recovery:
    """Repair a session into a copy beside it, or in `into`: ``<name>_recovered``. `on_bytes` hears how much was read.

    Raises
    ------
    SessionError
        Not a session, being recorded or recovered, recovered before, nothing left in it, or the copy cannot be written.
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
                _sync(path)
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


def _sync(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())


def expected_loss(session: Path, on_bytes: OnBytes = lambda _: None) -> Recovery:
    """What `recover` would find, without writing anything. Pictures count as there when their packets are: none is decoded.

    Raises
    ------
    SessionError
        Not a session, being recorded, of a newer version, or nothing left in it.
    """
    session = Path(os.path.abspath(session))  # "." and ".." have names, too
    check_is_session(session)
    if is_being_written(session):
        raise SessionError(f"{session}: is being recorded; stop the recording first")
    manifest, problems = _manifest_of(session)
    found = _Salvage(problems)
    nowhere = Path(os.devnull)
    _copy_lines(session / FRAMES, nowhere, found, _take_row, on_bytes)
    _copy_lines(session / EVENTS, nowhere, found, _take_event, lambda _: None)
    for path in sorted(session.glob("video_*.mkv")):
        if (video := video_number(path)) is not None:
            found.kept |= {(video, pts_ms) for pts_ms, _ in packet_times(path)}
        on_bytes(path.stat().st_size)
    if not found.rows and not found.kept:
        raise SessionError(f"{session}: nothing left to recover: neither rows nor pictures can be read")
    return Recovery(session, len(found.rows), len(found.kept), _loss(session, manifest, found))


def _manifest_of(session: Path) -> tuple[Manifest, list[str]]:
    """The manifest, or one that claims nothing, and what is wrong with it. Raises SessionError for a newer version."""
    try:
        return read_manifest(session), []
    except SessionError as error:
        if "newer version" in str(error):
            raise
        return _unknown(session), [str(error)]


def _salvage(session: Path, work: Path, target: Path, on_bytes: OnBytes) -> Recovery:
    manifest, problems = _manifest_of(session)
    is_unknown = bool(problems)
    found = _Salvage(problems)
    _copy_lines(session / FRAMES, work / FRAMES, found, _take_row, on_bytes)
    _copy_lines(session / EVENTS, work / EVENTS, found, _take_event, lambda _: None)
    for path in sorted(session.glob("video_*.mkv")):
        _copy_video(path, work / path.name, found)
        on_bytes(path.stat().st_size)
    if not found.rows and not found.kept:
        raise SessionError(f"{session}: nothing left to recover: neither rows nor pictures can be read")
    if is_unknown and found.places:
        # The rows' clock began anywhere; its moment that the folder's name tells of is the first row's.
        manifest = manifest.model_copy(update={"started_monotonic_s": found.places[0][2]})
    loss = _loss(session, manifest, found)
    if found.last_row is not None:  # a session that was cut has no count in its manifest
        with contextlib.suppress(InvalidRecord):
            found.dropped = max(found.dropped, count(parse_line(found.last_row).get("dropped_rows", 0), "dropped_rows"))
    counts = Counts(frames=len(found.rows), events=found.events, videos=found.videos)
    counts.dropped = max(found.dropped, manifest.counts.dropped)
    counts.bytes = sum(path.stat().st_size for path in work.iterdir())
    ended = {"closed": True, "ended": manifest.ended or "cut", "counts": counts, "recovered": loss}
    write_manifest(work, manifest.model_copy(update=ended))
    return Recovery(target, len(found.rows), len(found.kept), loss)


def _unknown(session: Path) -> Manifest:
    """A manifest for a session whose own is lost: nothing is claimed."""
    try:
        started = datetime.strptime(session.name.removeprefix(PREFIX)[:16], "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC)
    except ValueError:
        started = datetime.fromtimestamp(0, UTC)
    name = name_as_text(session.name)
    return Manifest(id=name.rpartition("_")[2][:64], kind="UNKNOWN", started_utc=started, started_monotonic_s=0.0)


def _copy_lines(source: Path, target: Path, found: _Salvage, take: _Take, on_bytes: OnBytes) -> None:
    """Copy the good lines as they are; name the others."""
    with target.open("wb") as output:
        for line in _readable(source, found):
            on_bytes(len(line.data or b""))
            try:
                take(line, found)
            except InvalidRecord as error:
                found.problems.append(f"{source.name}: line {line.number}: {error}; left out")
            else:
                output.write((line.data or b"") + b"\n")


def _readable(source: Path, found: _Salvage) -> Iterator[FileLine]:
    """The lines until the file ends or the disk gives no more of it. Raises OSError for what may be read another time."""
    try:
        yield from lines_of(source)
    except FileNotFoundError:
        found.problems.append(f"{source.name}: missing")
    except OSError as error:
        if error.errno != errno.EIO:
            raise
        found.problems.append(f"{source.name}: cannot be read further ({error.strerror})")


def _take_row(line: FileLine, found: _Salvage) -> None:
    columns = quick_columns(line)
    if columns is None:
        record = parse_line(line)
        columns = columns_of(record)
        if not is_sealed(line):  # what is sealed is as it was written, whatever of it this version understands
            row_from_json(record)
    row, captured_s, video, pts_ms, *_, crc = columns
    found.last_row = line
    if found.rows and row <= found.rows[-1]:
        raise InvalidRecord(f"row {row} after row {found.rows[-1]}")
    found.rows.append(row)
    found.places.append((video, pts_ms, captured_s))
    found.expected.setdefault(video, []).append(Expected(row, pts_ms, crc if crc >= 0 else None))


def _take_event(line: FileLine, found: _Salvage) -> None:
    event = event_from_json(parse_line(line))
    if was_added_later(event):
        return  # kept, but neither counted nor a sign of how long was recorded
    found.events += 1
    found.last_event_s = event.time_s
    if event.kind is EventKind.DROPPED and isinstance(total := event.data.get("total"), int):
        found.dropped = max(found.dropped, total)


def _copy_video(path: Path, target: Path, found: _Salvage) -> None:
    video = video_number(path)
    if video is None:
        found.problems.append(f"{path.name}: not a name of ours; left out")
        return
    done = remux(path, target, found.expected.get(video, []))
    found.problems += done.problems
    found.kept |= {(video, pts_ms) for pts_ms in done.kept_ms}
    found.videos += bool(done.kept_ms)


def _period_s(row_steps_s: np.ndarray, found: _Salvage) -> float:
    """Time from picture to picture, by the rows, where these are gone by the videos' own clock, or as cameras usually have it."""
    kept = sorted(found.kept)
    steps_s = [(after - before) / 1000.0 for (video, before), (same, after) in pairwise(kept) if video == same]
    for steps in (row_steps_s, np.array(steps_s)):
        if (steps > 0).any():
            return float(np.median(steps[steps > 0]))
    return 1.0 / 30.0


def _loss(session: Path, manifest: Manifest, found: _Salvage) -> Loss:
    """Rows that should be there and are not, pictures that rows tell of and that are not there, and how long all that lasted."""
    told = {(video, pts_ms) for video, pts_ms, _ in found.places}
    pictures = len(told - found.kept)
    before = manifest.recovered  # of a copy that is recovered again: it has counted the rows that it has
    whole = max(found.rows[-1] + 1 if found.rows else 0, manifest.counts.frames + (before.rows if before else 0))
    rows = max(whole - len(found.rows), len(found.kept - told))
    times = np.array([captured_s for *_, captured_s in found.places])
    period_s = _period_s(np.diff(times), found)
    seconds = (pictures + rows) * period_s
    if found.last_event_s is not None and len(times) and not manifest.closed:
        # an event after the last row: at least until then it was recording
        seconds = max(seconds, found.last_event_s - float(times[-1]))
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
