"""What a rehearsal found: ``rehearse --json`` writes it, the window shows it, a session keeps it with the target's event.

Places are pixels of the picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import AliasChoices, BaseModel, ConfigDict, Field, ValidationError

from core import geometry
from core.session.manifest import REHEARSAL, Event
from core.types import Point

FEWEST_RUNS = 20
"""Runs, at least, from which a speed is recommended."""
_LEAST_WAY_MM = 20.0
"""A shorter way does not tell the feed."""
FedMoment = tuple[float, float, float]
"""Of a run: time, place along the way (mm), and the speed of the feed that was commanded (mm/s)."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class ArrivedShare(_Part):
    """Share of the runs that arrived, with its 95 % interval."""

    share: float
    low: float
    high: float


class ArrivalTime(_Part):
    """Seconds of the runs that arrived; None where none did."""

    median: float | None = None
    p95: float | None = None


class WallForce(_Part):
    """Newtons, over all moments of all runs."""

    p95: float | None = None
    max: float | None = None


class SharpBranch(_Part):
    """A branch that turns off more sharply than the head bends there."""

    xy: Point
    turn_deg: float
    limit_deg: float


class WeakestPlace(_Part):
    """Where most runs ended that did not arrive, or else where the wall force is largest."""

    xy: Point
    along_mm: float
    turn_deg: float
    ended_here: int
    wall_force_p95_n: float


class RehearsedWay(_Part):
    """What the runs did along the way: lists with one value every few mm, as far as the heads came.

    ``xy`` is their median place, ``low_xy`` and ``high_xy`` have 90 % of them between them; ``wall_force_n`` is the 95th
    percentile over the runs of the largest force there, ``time_s`` are percentiles (5, 50, 95) of the time of arrival there, and
    ``runs`` how many came so far.
    """

    along_mm: tuple[float, ...] = ()
    xy: tuple[Point, ...] = ()
    low_xy: tuple[Point, ...] = ()
    high_xy: tuple[Point, ...] = ()
    wall_force_n: tuple[float, ...] = ()
    time_s: tuple[tuple[float, float, float], ...] = ()
    runs: tuple[int, ...] = ()


class RehearsalResult(_Part):
    """The runs at the set speeds, and the speed to go at: None where none that was tried is good."""

    target_xy: Point
    size_px: tuple[int, int] = Field(description="of the picture whose pixels these are")
    runs: int
    arrived: ArrivedShare
    outcomes: dict[str, int] = {}
    states: dict[str, float] = Field({}, description="share of the answers")
    time_s: ArrivalTime = ArrivalTime()
    wall_force_n: WallForce = WallForce()
    weakest: WeakestPlace | None = None
    way: RehearsedWay = RehearsedWay()
    way_per_feed: tuple[float, float, float] | None = Field(None, description="mm per mm, percentiles (5, 50, 95) over the runs")
    sharp: tuple[SharpBranch, ...] = ()
    speed_mm_s: float
    recommended_speed_mm_s: float | None = None
    based_on: dict[str, float | str] = Field(
        {},
        validation_alias=AliasChoices("based_on", "assumed"),
        description="pictures perceived, share without an answer, and whose robot",
    )


def rehearsal_of(event: Event) -> RehearsalResult | None:
    """Of the target's event; None where it was not rehearsed."""
    try:
        return RehearsalResult.model_validate(event.data[REHEARSAL]) if REHEARSAL in event.data else None
    except ValidationError:  # of another version
        return None


@dataclass(frozen=True, slots=True)
class PlaceBeside:
    """A head beside the rehearsed way: how far it is in, px outside the band or beyond its end, what the runs had there."""

    along_mm: float
    outside_px: float
    wall_force_n: float
    time_s: tuple[float, float, float]


def place_beside(result: RehearsalResult, head: Point) -> PlaceBeside | None:
    """None before the way begins, where no run had its head."""
    way = result.way
    if len(way.xy) < 2:
        return None
    middle = np.array(way.xy)
    along = geometry.arc_length(middle)
    _, at_px, foot = geometry.nearest(middle, head, along)
    if at_px <= 0.0:
        return None
    place = int(np.argmin(np.abs(along - at_px)))
    across = geometry.normals(middle)[place]
    offset, *sides = (float(np.subtract(at, foot) @ across) for at in (head, way.low_xy[place], way.high_xy[place]))
    beyond_px = math.sqrt(max(0.0, math.dist(head, foot) ** 2 - offset**2)) - (along[-1] - along[-2])  # one place after the last
    outside_px = max(0.0, offset - max(sides), min(sides) - offset, beyond_px if at_px >= along[-1] else 0.0)
    along_mm = round(float(np.interp(at_px, along, way.along_mm)), 1)
    return PlaceBeside(along_mm, outside_px, way.wall_force_n[place], way.time_s[place])


def way_per_feed(run: Sequence[FedMoment]) -> float | None:
    """How far the head came for each millimetre that was fed; None for a short way."""
    if len(run) < 2:
        return None
    time_s, along_mm, feed_mm_s = np.array(run).T
    way_mm, fed_mm = float(along_mm[-1] - along_mm[0]), float(np.diff(time_s) @ feed_mm_s[:-1])
    return round(way_mm / fed_mm, 4) if way_mm >= _LEAST_WAY_MM and fed_mm > 0.0 else None
