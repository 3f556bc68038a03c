"""Where each row of ``frames.jsonl`` is, and what the timeline shows of it: read once, in the background, a few bytes a row."""

from __future__ import annotations

import re
import threading
from array import array
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.control.modes import Mode
from core.session.checked import Damaged, count, maybe_number, moment, text
from core.session.lines import Line, is_sealed, lines_of, parse_line
from core.session.packet_check import PictureRow
from core.types import PoseState

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
                        raise Damaged(f"row {columns[0]} after row {last_row}")
                except Damaged as error:
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


def quick_columns(line: Line) -> Columns | None:
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
        raise Damaged("state or mode: not a text")
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
        raise Damaged("picture_crc: no checksum") from None
