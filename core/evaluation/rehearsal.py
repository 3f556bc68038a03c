"""What a rehearsal found, as ``rehearse --json`` writes it, the window shows it and a session keeps it. Places are pixels."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from core.types import Point


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
    time_s: ArrivalTime = ArrivalTime()
    wall_force_n: WallForce = WallForce()
    weakest: WeakestPlace | None = None
    way: RehearsedWay = RehearsedWay()
    sharp: tuple[SharpBranch, ...] = ()
    speed_mm_s: float
    recommended_speed_mm_s: float | None = None
