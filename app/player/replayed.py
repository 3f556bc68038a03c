"""The results of ``replay --jsonl``, found by the session's rows and compared with the recording, without Qt."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.ui.i18n import tr
from app.ui.texts import signed_degrees
from core.devices import UserError, disk_errors
from core.evaluation.replay import Change, frame_result
from core.session.codec import InvalidRecord, PerceivedLine, read_json, scene_from_json
from core.session.files import lines_of, read_line
from core.types import PoseState, Scene

_LARGE_DEG = 5.0
"""A larger change of theta is a difference."""


class Replayed:
    """Reads the file once, and single lines again when they are shown. ``skipped`` counts lines that cannot be used.

    Raises UserError for a file without results, or with those of another session.
    """

    def __init__(self, path: Path, session: str) -> None:
        self._path = path
        self._places: dict[int, tuple[int, int]] = {}
        self._values: dict[int, tuple[float, int]] = {}
        self.skipped = 0
        with disk_errors(UserError, path, "cannot be read"):
            for line in lines_of(path):
                try:
                    record = read_line(partial(read_json, PerceivedLine), line)
                    row = self._row_of(record.image, session)
                    if record.state is not None and record.theta_signed_deg is None:
                        raise InvalidRecord("theta_signed_deg: missing")
                    state = list(PoseState).index(record.state) if record.state is not None else -1
                    self._values[row] = (math.nan if state < 0 else record.theta_signed_deg or 0.0), state
                    self._places[row] = line.offset, len(line.data or b"")
                except InvalidRecord:
                    self.skipped += 1
        if not self._places:
            raise UserError(f"{path}: no results in it; write them with: replay SESSION --jsonl FILE")

    def _row_of(self, image: str, session: str) -> int:
        name, _, row = image.rpartition("#")
        if not name or not row.isdecimal():
            raise InvalidRecord("image: not a row of a session")
        if name != session:
            raise UserError(f"{self._path}: results of another session ({name})")
        return int(row)

    def theta_deg(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Signed angles of these rows, NaN without one."""
        return np.array([self._values.get(row, (math.nan, -1))[0] for row in rows.tolist()], np.float64)

    def changed(self, rows: NDArray[np.int64], theta_deg: NDArray[np.float64], states: NDArray[np.int8]) -> NDArray[np.int64]:
        """Places of `rows` where a difference begins: another state, a pose lost or gained, or an angle more than 5 degrees off."""
        others = np.array([self._values.get(row, (math.nan, -2))[1] for row in rows.tolist()], np.int64)
        turn = np.abs((self.theta_deg(rows) - theta_deg + 180.0) % 360.0 - 180.0)
        differs = (others != -2) & ((others != states) | (np.nan_to_num(turn) > _LARGE_DEG))
        return np.flatnonzero(differs & ~np.concatenate([[False], differs[:-1]]))

    def scene(self, row: int) -> Scene | None:
        """What was seen of a row, in source pixels; None: nothing, or it is damaged."""
        if row not in self._places:
            return None
        offset, size = self._places[row]
        try:
            with self._path.open("rb") as file:
                file.seek(offset)
                return scene_from_json(file.read(size))
        except (InvalidRecord, OSError):
            return None


def compared_line(before: Scene, after: Scene) -> str:
    """The change of state, angle and head in one line."""
    change = Change(0, 0, 0.0, frame_result(before), frame_result(after))
    states = tr("state {before} \N{RIGHTWARDS ARROW} {after}", before=change.before.state or "-", after=change.after.state or "-")
    if after.pose is None:
        return tr("{states}: no pose, {why}", states=states, why=after.refusal)
    line = f"{states}, {tr('theta')} {signed_degrees(after.pose.theta_signed_deg, 1)}"
    if change.theta_deg is not None:
        line += f" ({signed_degrees(change.theta_deg, 1)})"
    return line + (tr(", head {distance:.1f} px away", distance=change.head_px) if change.head_px is not None else "")
