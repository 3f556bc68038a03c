"""The result of a closed-loop trial and the sums over many: plain numbers."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from core.types import Point, Pose

NEAR_WALL_MM = 0.5
Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class TrialSample:
    """One sample of the truth during a trial; unknown values: None.

    ``head_mm`` lies on the board; ``offset_ratio`` is the head's distance from the centerline over the lumen's radius, ``d_px``
    that distance in working px; the errors are perception's.
    """

    time_s: float
    head_mm: Point
    insertion_mm: float
    wall_contact_n: float
    d_px: float | None = None
    offset_ratio: float | None = None
    head_clearance_mm: float | None = None
    theta_error_deg: float | None = None
    head_error_px: float | None = None


@dataclass(slots=True)
class TrialLog:
    """Collects a trial frame by frame."""

    measures: list[TrialSample] = field(default_factory=list)
    forces_n: list[float] = field(default_factory=list)
    states: Counter[str] = field(default_factory=Counter)
    refusals: Counter[str] = field(default_factory=Counter)
    interventions: int = 0
    back_offs: int = 0
    direction_alarms: int = 0

    def count(self, pose: Pose | None, refusal: str, wall_contact_n: float) -> None:
        """Count a frame: the result of perception, and the contact force."""
        if pose is not None:
            self.states[pose.state.value] += 1
        else:
            self.refusals[refusal] += 1
        self.forces_n.append(wall_contact_n)


def trial_row(log: TrialLog, *, seed: int, policy: str, phantom: str, outcome: str, way_mm: float, target_mm: Point) -> Row:
    """A trial as plain types; ``outcome`` "reached" means success, `way_mm` is how far the head came along the route to
    `target_mm` (on the board).

    ``track`` holds one value per measure, for plots and for sums over all trials.
    """
    frames = len(log.forces_n)
    answered = sum(log.states.values())
    measures = log.measures
    reached = outcome == "reached"
    travelled_mm = sum(math.dist(a.head_mm, b.head_mm) for a, b in zip(measures, measures[1:], strict=False))
    steps = [b.time_s - a.time_s for a, b in zip(measures, measures[1:], strict=False)]
    clearances = [m.head_clearance_mm for m in measures[1:]]
    near_s = math.fsum(step for step, c in zip(steps, clearances, strict=True) if c is not None and c < NEAR_WALL_MM)
    return {
        "seed": seed,
        "policy": policy,
        "phantom": phantom,
        "target_mm": [_rounded(target_mm[0]), _rounded(target_mm[1])],
        "outcome": outcome,
        "reached": reached,
        "time_s": _rounded(measures[-1].time_s if measures else 0.0),
        "insertion_mm": _rounded(measures[-1].insertion_mm if measures else 0.0),
        "way_mm": _rounded(way_mm),
        "path_ratio": _rounded(travelled_mm / way_mm) if reached and way_mm > 0.0 else None,
        "wall_contact_n": _force(log.forces_n),
        "time_near_wall_s": _rounded(near_s),
        "mean_d_px": _mean([m.d_px for m in measures]),
        "offset_ratio": _mean([m.offset_ratio for m in measures]),
        "state_shares": {s: _rounded(log.states[s] / answered) if answered else None for s in "ABCD"},
        "answered_share": _rounded(answered / frames) if frames else None,
        "refusals": dict(sorted(log.refusals.items())),
        "interventions": log.interventions,
        "back_offs": log.back_offs,
        "direction_alarms": log.direction_alarms,
        "theta_error_median_deg": _median([m.theta_error_deg for m in measures]),
        "head_error_median_px": _median([m.head_error_px for m in measures]),
        "track": _track(measures),
    }


def _track(measures: Sequence[TrialSample]) -> dict[str, list[float | None]]:
    """Column by column, rounded: a hundred trials stay readable and small."""
    columns: dict[str, list[float | None]] = {
        "time_s": [m.time_s for m in measures],
        "x_mm": [m.head_mm[0] for m in measures],
        "y_mm": [m.head_mm[1] for m in measures],
        "wall_contact_n": [m.wall_contact_n for m in measures],
        "offset_ratio": [m.offset_ratio for m in measures],
        "theta_error_deg": [m.theta_error_deg for m in measures],
        "head_error_px": [m.head_error_px for m in measures],
    }
    return {name: [None if v is None else round(v, 4) for v in values] for name, values in columns.items()}


def summarise(rows: Sequence[Mapping[str, Any]]) -> Row:
    """Sums over trials, with the names of the command line's contract.

    Forces, offsets and errors are taken over all moments of all trials (every tenth of a second), but the largest force over every
    frame. Times and path ratios are those of the trials that reached their target. None where there is nothing to sum.
    """
    count = len(rows)
    reached = [row for row in rows if row["reached"]]
    forces, offsets = _pooled(rows, "wall_contact_n"), _pooled(rows, "offset_ratio")
    outcomes = Counter(str(row["outcome"]) for row in rows)
    return {
        "trials": count,
        "reached_share": _rounded(len(reached) / count) if count else None,
        "unaided_share": _rounded(sum(row["interventions"] == 0 for row in reached) / count) if count else None,
        "outcomes": dict(sorted(outcomes.items())),
        "wall_force_p95_n": _rounded(float(np.percentile(forces, 95))) if forces else None,
        "wall_force_median_n": _median(forces),
        "wall_force_max_n": max((row["wall_contact_n"]["max"] for row in rows if row["wall_contact_n"]), default=None),
        "mean_offset_ratio": _mean(offsets),
        "median_offset_ratio": _median(offsets),
        "theta_error_median_deg": _median(_pooled(rows, "theta_error_deg")),
        "head_error_median_px": _median(_pooled(rows, "head_error_px")),
        "mean_time_s": _mean([row["time_s"] for row in reached]),
        "median_time_s": _median([row["time_s"] for row in reached]),
        "median_path_ratio": _median([row["path_ratio"] for row in reached]),
        "mean_interventions": _mean([float(row["interventions"]) for row in rows]),
        "answered_share": _mean([row["answered_share"] for row in rows]),
        "direction_alarms": sum(row.get("direction_alarms", 0) for row in rows) if rows else None,
    }


def worst(rows: Sequence[Mapping[str, Any]], count: int) -> list[Mapping[str, Any]]:
    """The trials to look at first: failures, then the largest forces."""

    def badness(row: Mapping[str, Any]) -> tuple[bool, int, float]:
        force = row["wall_contact_n"]
        return row["reached"], -row["interventions"], -(force["max"] if force else 0.0)

    return sorted(rows, key=badness)[:count]


def _pooled(rows: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    return [value for row in rows for value in row["track"][name] if value is not None]


def _force(forces_n: Sequence[float]) -> dict[str, float] | None:
    if not forces_n:
        return None
    array = np.asarray(forces_n)
    return {
        "mean": round(float(array.mean()), 4),
        "p95": round(float(np.percentile(array, 95)), 4),
        "max": round(float(array.max()), 4),
    }


def _mean(values: Sequence[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return _rounded(float(np.mean(known))) if known else None


def _median(values: Sequence[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return _rounded(float(np.median(known))) if known else None


def _rounded(value: float) -> float:
    return round(value, 4)
