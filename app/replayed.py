"""What ``replay --jsonl`` wrote, found by the session's rows, so that the player can show it beside the recording. No Qt here."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.language import tr
from app.wording import signed_degrees
from core.errors import UserError
from core.session.checked import Damaged, choice, count, group, number, point, points, text
from core.session.lines import lines_of, parse, parse_line
from core.study.replay import Change, seen
from core.types import Point, Pose, PoseState, Reason, Refusal, RobotPath, Scene, Vector

_LARGE_DEG = 5.0
"""A larger change of theta is worth a stop."""


class Replayed:
    """Reads the file once, and single lines of it again when they are shown. ``skipped`` counts lines that cannot be used.

    Raises UserError: not such a file, or another session's.
    """

    def __init__(self, path: Path, session: str) -> None:
        self._path = path
        self._places: dict[int, tuple[int, int]] = {}
        self._values: dict[int, tuple[float, int]] = {}
        self.skipped = 0
        try:
            for line in lines_of(path):
                try:
                    record = parse_line(line)
                    row = self._row_of(record, session)
                    self._values[row] = _columns(record)
                    self._places[row] = line.offset, len(line.data or b"")
                except Damaged:
                    self.skipped += 1
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({error.strerror})") from None
        if not self._places:
            raise UserError(f"{path}: no results in it; write them with: replay SESSION --jsonl FILE")

    def _row_of(self, record: dict[str, Any], session: str) -> int:
        name, _, row = text(record.get("image"), "image").rpartition("#")
        if not name or not row.isdecimal():
            raise Damaged("image: not a row of a session")
        if name != session:
            raise UserError(f"{self._path}: results of another session ({name})")
        return int(row)

    def theta_deg(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Signed angles of these rows, NaN where there is none."""
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
                return scene_from_json(parse(file.read(size)))
        except (Damaged, OSError):
            return None


def _columns(record: dict[str, Any]) -> tuple[float, int]:
    if record.get("state") is None:
        return math.nan, -1
    state = choice(PoseState, record["state"], "state")
    return number(record.get("theta_signed_deg"), "theta_signed_deg"), list(PoseState).index(state)


def scene_from_json(record: dict[str, Any]) -> Scene:
    """The way back from ``scene_to_json``: lines, pose or reason, all in source pixels. Raises Damaged."""
    size = count(record.get("width"), "width"), count(record.get("height"), "height")
    robot, vessel = (_vector(record.get(name), name) for name in ("robot_vector", "vessel_vector"))
    line = record.get("robot_path_xy")
    path = RobotPath(points(line, "robot_path_xy"), 0.0, None, False, 0.0, 0.0) if line else None
    stages = {name: number(ms, name) for name, ms in group(record.get("latency_ms", {}), "latency_ms").items()}
    scene = Scene(0, 0.0, size, 1.0, path=path, robot_vector=robot, vessel_vector=vessel, latency_ms=stages)
    if record.get("state") is None or robot is None or vessel is None:
        return replace(scene, refusal=_refusal(record.get("reason")))
    theta = number(record.get("theta_signed_deg"), "theta_signed_deg")
    sides = [math.copysign(1.0, _offset(vessel, end)) for end in (robot.end, robot.start)]
    pose = Pose(
        abs(theta),
        theta,
        sides[0] * number(record.get("d_head_px"), "d_head_px"),
        sides[1] * number(record.get("d_tail_px"), "d_tail_px"),
        sides[0] != sides[1],
        choice(PoseState, record["state"], "state"),
        number(record.get("confidence"), "confidence"),
    )
    return replace(scene, pose=pose)


def _offset(vessel: Vector, place: Point) -> float:
    """Signed distance from the vessel's line (METHOD section 5), here only for its side."""
    x, y = vessel.direction
    return x * (place[1] - vessel.center[1]) - y * (place[0] - vessel.center[0])


def _vector(value: Any, name: str) -> Vector | None:
    if value is None:
        return None
    ends = [point(group(value, name).get(part), f"{name}.{part}") for part in ("start", "center", "end")]
    if ends[0] == ends[2]:
        raise Damaged(f"{name}: no direction")
    return Vector(ends[0], ends[1], ends[2])


def _refusal(value: Any) -> Refusal:
    told = text(value or "", "reason")
    reason, _, detail = told.partition(": ")
    return Refusal(choice(Reason, reason, "reason"), detail)


def compared_line(before: Scene, after: Scene) -> str:
    """Both in one line, after against before."""
    change = Change(0, 0, 0.0, seen(before), seen(after))
    states = tr("state {before} \N{RIGHTWARDS ARROW} {after}", before=change.before.state or "-", after=change.after.state or "-")
    if after.pose is None:
        return tr("{states}: no pose, {why}", states=states, why=after.refusal)
    line = f"{states}, {tr('theta')} {signed_degrees(after.pose.theta_signed_deg, 1)}"
    if change.theta_deg is not None:
        line += f" ({signed_degrees(change.theta_deg, 1)})"
    return line + (tr(", head {distance:.1f} px away", distance=change.head_px) if change.head_px is not None else "")
