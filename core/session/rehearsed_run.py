"""The runs of a session beside the rehearsals of their targets: time, path, wall force and states."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

import numpy as np

from core import geometry
from core.control.modes import Mode
from core.evaluation.rehearsal import FedMoment, PlaceBeside, RehearsalResult, place_beside, rehearsal_of, way_per_feed
from core.session.manifest import EventKind
from core.session.reader import SessionReader
from core.types import Point, PoseState

_BESIDE_PX = 4.0
"""Of a picture of 640 px: so far off a head may be perceived; the band is one of true heads."""
_LEFT_S = 0.5
"""A head that is outside for so long has left the band."""
_FEED_SHARE = 0.03
"""So far outside the rehearsed ones the way per feed is another: commands and pictures are not of one moment."""
_ARRIVED_MM = 5.0
"""Of the target: the rehearsed way may end before it."""


def runs_beside(reader: SessionReader) -> list[dict[str, Any]]:
    """Each run of a session to a rehearsed target beside its rehearsal, as ``session info --json`` has it.

    A run begins with the hand-over, without one when the target was rehearsed; it ends at the target, or with it.
    """
    line, chosen = reader.timeline(), [event for event in reader.events if event.kind is EventKind.TARGET]
    driven, runs = line.mode == list(Mode).index(Mode.AUTONOMOUS), []
    for event, following in zip_longest(chosen, chosen[1:]):
        if (result := rehearsal_of(event)) is None:
            continue
        within = (line.time_s >= event.time_s) & (line.time_s < (following.time_s if following is not None else np.inf))
        places = np.flatnonzero(within & driven)
        places = np.flatnonzero(within)[np.flatnonzero(within) >= (places[0] if len(places) else 0)]
        if (run := _run_beside(reader, result, places.tolist())) is not None:
            runs.append(run)
    return runs


def _run_beside(reader: SessionReader, result: RehearsalResult, places: Sequence[int]) -> dict[str, Any] | None:
    """None where the head was never on the rehearsed way."""
    found: list[tuple[float, PlaceBeside, Point]] = []
    fed: list[FedMoment] = []
    states, forces = [], []
    limit_px, way = _BESIDE_PX * max(result.size_px) / 640, result.way
    px_per_mm = float(geometry.arc_length(np.array(way.xy))[-1]) / (way.along_mm[-1] - way.along_mm[0]) if len(way.xy) > 1 else 0.0
    arrived = False
    for place in places:
        row = reader.row(place)
        if row is None:
            continue
        states += [row.scene.pose.state] if row.scene.pose is not None else []
        if row.status is not None and row.status.wall_contact_n is not None:
            forces.append(row.status.wall_contact_n)
        head = row.scene.to_source(row.scene.path.head) if row.scene.path is not None else None
        feed_mm_s = row.sent.advance_mm_s if row.sent is not None else 0.0
        beside = place_beside(result, head) if head is not None else None
        if fed or beside is not None:  # what was fed while the head was not seen counts, too, and a hold then does not
            fed.append((row.captured_s, beside.along_mm if beside is not None else fed[-1][1], feed_mm_s))
        if head is not None and beside is not None:
            found.append((row.captured_s, beside, head))
            if arrived := math.dist(head, result.target_xy) <= _ARRIVED_MM * px_per_mm:
                break
    if not found:
        return None
    (began_s, first, _), (ended_s, last, _) = found[0], found[-1]
    outside = [(time_s, at, head) for time_s, at, head in found if at.outside_px > limit_px]
    left: list[dict[str, Any]] = []
    since, is_told, zero_s = None, False, float(reader.timeline().time_s[0])
    for time_s, at, head in found:
        if at.outside_px <= limit_px:
            since, is_told = None, False
            continue
        since = since or (time_s, at, head)
        if time_s - since[0] >= _LEFT_S and not is_told:
            is_told = True
            xy = [round(value, 1) for value in since[2]]
            left.append({"time_s": round(since[0] - zero_s, 2), "along_mm": since[1].along_mm, "xy": xy})
    seconds, share, explained_s = ended_s - began_s, way_per_feed(fed), None
    if share is not None and result.way_per_feed is not None:
        low, middle, high = result.way_per_feed
        if not low - _FEED_SHARE <= share <= high + _FEED_SHARE:
            explained_s = round(seconds * (1.0 - share / middle), 2)
    return {
        "target_xy": list(result.target_xy),
        "runs": result.runs,
        "arrived_share": result.arrived.share,
        "arrived": arrived,
        "began_s": round(began_s - zero_s, 2),
        "seconds": round(seconds, 2),
        "rehearsed_seconds": [round(value - first.time_s[1], 2) for value in last.time_s],
        "inside_share": round(1.0 - len(outside) / len(found), 4),
        "left_band": left,
        "wall_force_max_n": round(max(forces), 4) if forces else None,
        "rehearsed_wall_force_max_n": result.wall_force_n.max,
        "states": {state.value: round(states.count(state) / len(states), 4) for state in PoseState} if states else None,
        "rehearsed_states": result.states or None,
        "way_per_feed": share,
        "rehearsed_way_per_feed": result.way_per_feed,
        "feed_explains_s": explained_s,
    }


def beside_line(run: dict[str, Any]) -> str:
    """A run beside its rehearsal, for people."""
    low, middle, high = run["rehearsed_seconds"]
    parts = [
        f"to ({run['target_xy'][0]:.0f}, {run['target_xy'][1]:.0f}) {'arrived' if run['arrived'] else 'not arrived'}",
        f"{run['seconds']:.1f} s (rehearsed {middle:.1f}, {low:.1f} to {high:.1f})",
        f"{run['inside_share']:.0%} in the band",
    ]
    parts += [f"left it at {one['time_s']:.1f} s, {one['along_mm']:.0f} mm in" for one in run["left_band"]]
    if run["wall_force_max_n"] is not None and run["rehearsed_wall_force_max_n"] is not None:
        parts.append(f"wall force {run['wall_force_max_n']:.2f} N at most (rehearsed {run['rehearsed_wall_force_max_n']:.2f})")
    if run["states"] is not None and run["rehearsed_states"] is not None:
        shares = (f"{name} {share:.0%} ({run['rehearsed_states'].get(name, 0.0):.0%})" for name, share in run["states"].items())
        parts.append(f"states {', '.join(shares)}")
    if run["feed_explains_s"] is not None:
        way = f"{run['way_per_feed']:.2f} mm of way per mm fed (rehearsed {run['rehearsed_way_per_feed'][1]:.2f})"
        parts.append(f"the feed slips or is another: {way}, which explains {run['feed_explains_s']:+.1f} s")
    if (told := run.get("explained")) is not None:
        named = " or ".join(f"{name} = {value:g}" for name, value in told["values"].items())
        why = f"would explain it ({told['left_mm']:.1f} mm left)" if named else "no single parameter explains more"
        parts.append(f"its replay in the identified twin is {told['away_mm']:.1f} mm off: {f'{named} ' * bool(named)}{why}")
    return "; ".join(parts)
