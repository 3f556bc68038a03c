"""A recorded session, read with suspicion: each bad record is named and skipped, a lost picture is None, nothing is guessed."""

from __future__ import annotations

import contextlib
import threading
from collections import OrderedDict
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import IO

import numpy as np
from av import VideoFrame

from core.session.checked import Damaged
from core.session.events import Event, event_from_json
from core.session.lines import lines_of, parse, parse_line
from core.session.manifest import EVENTS, FRAMES, Manifest, SessionError, read_manifest
from core.session.packet_check import PictureRow
from core.session.pictures import Pictures, packet_times, video_number
from core.session.recorded import RecordedRow, row_from_json
from core.session.row_index import RowIndex, Timeline
from core.types import Frame, Image, Tick

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
        except Damaged as error:
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
                except Damaged as error:
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
