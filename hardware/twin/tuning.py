"""Settings of ``pursuit`` for one bench: successive halving over rehearsals, then a comparison on runs that were not searched.

All candidates, of which the configured settings are one, get the same seeds: the same friction, play, start and errors of
perception. Those that do worse are left out after a few runs, and the others go on. More runs reach the target first, then less
wall force, then less time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from core.config.models import PursuitConfig
from core.config.rig_file import with_pursuit
from core.evaluation.trial import Row, summarise
from hardware.twin.rehearsal import FORCE_MAX_N, FORCE_P95_N, RehearsalPlan, figures, rehearse_once

Tuned = dict[str, float]
"""Settings of ``policy.pursuit`` by name."""

SETTINGS = {
    "look_ahead_px": (6.0, 24.0),
    "look_ahead_s": (0.05, 0.5),
    "gain": (0.5, 1.8),
    "smoothing_s": (0.02, 0.25),
    "gentle_turn_deg": (12.0, 70.0),
    "slow_steer_deg": (5.0, 40.0),
}
"""What is searched, and how far."""
CALM = ((0.8, 0.1), (0.6, 0.2), (0.5, 0.35))
"""Candidates for a robot that follows late, whose head weaves: factors of ``gain``, and what is added to ``look_ahead_s``."""
RUNGS = ((12, 3), (5, 5), (3, 10))
"""Candidates, the configured settings among them, and the runs that each of them gets more."""
SEARCH_SEEDS = sum(more for _, more in RUNGS)
SEARCH_RUNS = sum(count * more for count, more in RUNGS)
_SPREAD = 0.4
"""Standard deviation of a drawn setting's logarithm about the configured one."""
_FORCE_STEP_N, _FORCE_SAME = 0.02, 0.005
"""A smaller difference of the force counts as none in the search, and a smaller change in the comparison."""
_RESAMPLES = 2000

Task = tuple[int, Tuned, int]
Spread = Callable[[Callable[[Task], tuple[int, Row]], Sequence[Task]], Iterable[tuple[int, Row]]]
"""Calls a function for all tasks, in any order, over processes or not (``map``)."""


def candidates(pursuit: PursuitConfig, count: int, seed: int) -> list[Tuned]:
    """The configured settings, calmer ones, and others about them."""
    rng, own = np.random.default_rng([seed, 70009]), {name: float(getattr(pursuit, name)) for name in SETTINGS}
    calm = [own | {"gain": own["gain"] * gain, "look_ahead_s": own["look_ahead_s"] + more_s} for gain, more_s in CALM]
    factors = np.exp(_SPREAD * rng.standard_normal((count, len(SETTINGS))))
    low, high = np.array(list(SETTINGS.values())).T
    drawn = np.clip([*(list(one.values()) for one in calm), *(list(own.values()) * factors)], low, high).round(3)
    return [own, *(dict(zip(SETTINGS, row, strict=True)) for row in drawn.tolist())][:count]


def rank(rows: Sequence[Row]) -> tuple[float, ...]:
    """Less is better: failures, force above the limits, force, time."""
    sums = summarise(rows)
    p95_n, most_n = sums["wall_force_p95_n"] or 0.0, sums["wall_force_max_n"] or 0.0
    above_n = max(0.0, p95_n - FORCE_P95_N, most_n - FORCE_MAX_N)
    time_s = sums["median_time_s"]
    return -sums["reached_share"], above_n, round(p95_n / _FORCE_STEP_N), np.inf if time_s is None else time_s


def run_candidate(plan: RehearsalPlan, task: Task) -> tuple[int, Row]:
    """One run with a candidate's settings, with the candidate's number."""
    number, tuned, seed = task
    trial = replace(plan.trial, config=with_pursuit(plan.trial.config, tuned))
    return number, rehearse_once(replace(plan, trial=trial), seed)


def search(plan: RehearsalPlan, seed: int, spread: Spread = map) -> Tuned:
    """The best settings in ``SEARCH_RUNS`` runs with the seeds from `seed` on; the configured ones where none does better."""
    tried = candidates(plan.trial.config.policy.pursuit, RUNGS[0][0], seed)
    rows: dict[int, list[Row]] = {number: [] for number in range(len(tried))}
    kept = list(rows)
    for count, more in RUNGS:
        # The configured settings stay in to the end; a tie goes to the lower number, so to them.
        kept = [0, *sorted(kept[1:], key=lambda number: rank(rows[number]) if rows[number] else ())[: count - 1]]
        seeds = range(seed, seed + more)
        seed += more
        for number, row in spread(partial(run_candidate, plan), [(number, tried[number], one) for one in seeds for number in kept]):
            rows[number].append(row)
    return tried[min(kept, key=lambda number: (rank(rows[number]), number))]


def tuned(plan: RehearsalPlan, seed: int, runs: int, spread: Spread = map) -> dict[str, Any]:
    """The ``configured`` and the ``found`` settings; where they differ, both compared on `runs` seeds that were not searched."""
    own, found = candidates(plan.trial.config.policy.pursuit, 1, seed)[0], search(plan, seed, spread)
    about: dict[str, Any] = {"configured": own, "found": found, "search_runs": SEARCH_RUNS}
    if found != own:
        seeds = range(seed + SEARCH_SEEDS, seed + SEARCH_SEEDS + runs)
        tasks = [(number, settings, one) for one in seeds for number, settings in enumerate((own, found))]
        rows = sorted(spread(partial(run_candidate, plan), tasks), key=lambda result: int(result[1]["seed"]))
        before, after = ([row for number, row in rows if number == which] for which in (0, 1))
        about |= {"before": figures(before), "after": figures(after), "changes": compared(before, after)}
    return about


def compared(before: Sequence[Row], after: Sequence[Row]) -> dict[str, Any]:
    """Changes from `before` to `after`, rows of the same seeds: of the share that arrives, the median time, the wall force.

    Each with its 95 % interval, by resampling the seeds, and as a share where it is one of time or force (of 0.02 N at least).
    ``is_better``: the force is not surely larger, and surely more arrive; or not fewer do, and the force is surely smaller and the
    time not surely longer, or the time surely shorter and the mean force not larger.
    """
    rng = np.random.default_rng(0)

    def columns(rows: Sequence[Row]) -> tuple[Any, ...]:
        force = [row["wall_contact_n"]["p95"] if row["wall_contact_n"] else 0.0 for row in rows]
        times = [row["time_s"] if row["reached"] else np.nan for row in rows]
        return np.array([row["reached"] for row in rows], float), np.array(times), np.array(force)

    def change(picks: Any) -> tuple[float, float, float]:
        (reached_0, time_0, force_0), (reached_1, time_1, force_1) = ([one[picks] for one in part] for part in parts)
        both = np.isfinite(time_0) & np.isfinite(time_1)
        time = np.median(time_1[both]) / np.median(time_0[both]) - 1.0 if both.any() else 0.0
        force = (force_1.mean() - force_0.mean()) / max(force_0.mean(), _FORCE_STEP_N)
        return float(reached_1.mean() - reached_0.mean()), float(time), float(force)

    parts = [columns(before), columns(after)]
    found = change(np.arange(len(before)))
    low, high = np.percentile([change(rng.integers(len(before), size=len(before))) for _ in range(_RESAMPLES)], [2.5, 97.5], axis=0)
    about: dict[str, Any] = {
        name: {"change": round(value, 4), "low": round(float(a), 4), "high": round(float(b), 4)}
        for name, value, a, b in zip(("arrived", "time", "wall_force"), found, low, high, strict=True)
    }
    time, force = about["time"], about["wall_force"]
    is_gentler = force["high"] < 0.0 and time["low"] <= 0.0
    is_faster = time["high"] < 0.0 and found[2] <= _FORCE_SAME
    is_better = found[0] >= 0.0 and (is_gentler or is_faster)
    return about | {"is_better": bool(force["low"] <= _FORCE_SAME and (is_better or about["arrived"]["low"] > 0.0))}
