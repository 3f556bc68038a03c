"""What a folder of sessions holds, at a glance: found, summed up, and kept in a cache so that hundreds are listed at once.

Nothing is written into a session; the cache may be removed at any time, and one that cannot be used is done without.
"""

from __future__ import annotations

import os
import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np
import platformdirs
from pydantic import BaseModel, ConfigDict, ValidationError

from core.session.files import is_being_written
from core.session.manifest import (
    DESCRIPTION,
    EVENTS,
    FRAMES,
    MANIFEST,
    PREFIX,
    Description,
    EventKind,
    SessionError,
    read_about,
)
from core.session.reader import SessionReader
from core.session.recovery import unknown_manifest
from core.types import PoseState

_DEPTH = 2
"""Sessions are looked for so many folders deep: a folder for each study, and one for each day in it."""
_FORMAT = 1
"""Of the cache; one of another format is begun again."""


class SessionSummary(BaseModel):
    """One line of the library.

    Attributes
    ----------
    started_utc : without a manifest as the folder's name has it, 1970 where that says nothing.
    seconds, states, without_pose, faults : of the rows and events: None and empty until these have been read. ``states`` counts the
        rows of A, B, C, D; ``faults`` counts each fault by its name.
    problem : one line; "" where all is well.
    """

    model_config = ConfigDict(frozen=True)

    folder: Path
    kind: str = "UNKNOWN"
    rig: str = ""
    program: str = ""
    started_utc: datetime
    seconds: float | None = None
    states: tuple[int, ...] = ()
    without_pose: int = 0
    faults: dict[str, int] = {}
    description: Description = Description()
    problem: str = ""
    is_recording: bool = False

    @property
    def text(self) -> str:
        """All that can be searched, in lower case."""
        about = self.description
        when = f"{self.started_utc.astimezone():%Y-%m-%d %H:%M}"
        parts = (self.folder.name, self.kind, self.rig, when, about.line, about.notes, self.problem, *self.faults)
        return " ".join([*parts, *(f"#{tag}" for tag in about.tags)]).casefold()

    def matches(self, words: str) -> bool:
        """Whether it has all of these words, parts of words included; ``#word`` begins a tag."""
        return all(word in self.text for word in words.casefold().split())


def find_sessions(folder: Path) -> list[Path]:
    """All sessions in a folder and its folders, in no order; folders within that cannot be read are passed over.

    None where there is no such folder: nothing has been recorded yet. Raises SessionError when it cannot be read.
    """
    try:
        with os.scandir(folder):
            pass
    except FileNotFoundError:
        return []
    except OSError as error:
        raise SessionError(f"{folder}: cannot be read ({error.strerror}); choose another folder") from None
    return list(_sessions_below(folder, _DEPTH))


def _sessions_below(folder: Path, depth: int) -> Iterator[Path]:
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith(".") or not entry.is_dir():
                continue
            path = Path(entry.path)
            if entry.name.startswith(PREFIX) or (path / FRAMES).is_file():
                yield path
            elif depth:
                yield from _sessions_below(path, depth - 1)


def signature_of(folder: Path) -> str:
    """Changes whenever a file of the session does that a summary is made of."""
    parts = []
    for name in (MANIFEST, DESCRIPTION, FRAMES, EVENTS):
        try:
            stat = (folder / name).stat()
            parts.append(f"{stat.st_size}.{stat.st_mtime_ns}")
        except OSError:
            parts.append("-")
    return " ".join(parts)


def first_summary(folder: Path) -> SessionSummary:
    """What manifest and description say, read in less than a millisecond; never raises for a broken session."""
    manifest, description, problems = read_about(folder)
    problem = str(problems[0]) if problems else ""
    is_recording = is_being_written(folder)
    if manifest is not None and not manifest.closed and not is_recording:
        problem = problem or f"it did not end properly; repair it with: session recover {folder.name}"
    known = manifest or unknown_manifest(folder)
    return SessionSummary(
        folder=folder,
        kind=known.kind,
        rig=known.rig,
        program=known.program,
        started_utc=known.started_utc,
        description=description,
        problem=problem,
        is_recording=is_recording,
    )


def whole_summary(reader: SessionReader) -> SessionSummary:
    """With all that rows and events say; the reader must know all rows."""
    first = first_summary(reader.folder)
    line, faults = reader.timeline(), Counter(event.text for event in reader.events if event.kind is EventKind.FAULT)
    states = np.bincount(line.state[line.state >= 0], minlength=len(PoseState))
    problem = first.problem
    if not problem and not first.is_recording:
        problem = next(iter(reader.problems), "" if len(reader) else "it holds no frame")
    return first.model_copy(
        update={
            "seconds": round(reader.duration_s, 3),
            "states": tuple(int(count) for count in states),
            "without_pose": int((line.state < 0).sum()),
            "faults": dict(faults),
            "problem": problem,
        }
    )


@dataclass(frozen=True, slots=True)
class Cached:
    """A summary, the signature of the session that it was made of, and a small picture (JPEG; empty: not made)."""

    signature: str
    summary: SessionSummary
    picture: bytes = field(default=b"", repr=False)


class SummaryCache:
    """Summaries by the sessions' folders, in one SQLite file; None: in the user's cache folder.

    Never raises: without it all is read again.
    """

    def __init__(self, path: Path | None = None) -> None:
        self._path = path or Path(platformdirs.user_cache_dir("LumenPilot")) / f"library_{_FORMAT}.sqlite"

    def read(self) -> dict[Path, Cached]:
        """All that is kept."""
        found = {}
        with suppress(sqlite3.Error, OSError), closing(self._open()) as database:
            for signature, text, picture in database.execute("SELECT signature, summary, picture FROM sessions"):
                with suppress(ValidationError, TypeError):  # of another version, or damaged: read again
                    summary = SessionSummary.model_validate_json(text)
                    found[summary.folder] = Cached(signature, summary, bytes(picture))
        return found

    def keep(self, cached: Cached) -> None:
        """Keep one; a damaged file is begun again."""
        try:
            self._insert(cached)
        except sqlite3.DatabaseError as error:
            if not isinstance(error, sqlite3.OperationalError):  # those are a full disk, a lock, a folder that cannot be written
                with suppress(OSError):
                    self._path.unlink(missing_ok=True)
        except OSError:
            pass

    def _insert(self, cached: Cached) -> None:
        row = str(cached.summary.folder), cached.signature, cached.summary.model_dump_json(), cached.picture
        with closing(self._open()) as database, database:
            database.execute("INSERT OR REPLACE INTO sessions VALUES (?, ?, ?, ?)", row)

    def _open(self) -> sqlite3.Connection:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        database = sqlite3.connect(self._path, timeout=1.0)
        try:
            database.execute("PRAGMA synchronous = OFF")  # a cache that is lost is made again
            database.execute(
                "CREATE TABLE IF NOT EXISTS sessions (folder TEXT PRIMARY KEY, signature TEXT, summary TEXT, picture BLOB)"
            )
        except sqlite3.Error:
            database.close()
            raise
        return database
