"""Tuning of pursuit: what is tried, what counts as better, and how many runs that takes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from core.config.models import Config, PursuitConfig
from hardware.twin.rehearsal import RehearsalPlan, SeenHeads
from hardware.twin.trial import TrialPlan
from hardware.twin.tuning import CALM, SEARCH_RUNS, SEARCH_SEEDS, SETTINGS, Task, candidates, compared, rank, search

NOTHING = SeenHeads(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))


def row(seed: int, *, reached: bool = True, time_s: float = 10.0, force_n: float = 0.1) -> dict[str, Any]:
    track = {name: [force_n] for name in ("wall_contact_n", "offset_ratio", "theta_error_deg", "head_error_px")}
    about = {"seed": seed, "reached": reached, "outcome": "reached" if reached else "stuck", "interventions": 0, "track": track}
    force = {"p95": force_n, "max": force_n}
    return about | {"time_s": time_s, "wall_contact_n": force, "path_ratio": None, "answered_share": 1.0}


def test_candidates_are_the_configured_settings_and_others_that_are_valid() -> None:
    own, *others = candidates(PursuitConfig(), 12, 1)
    assert own == {name: getattr(PursuitConfig(), name) for name in SETTINGS}
    for one in others:
        PursuitConfig.model_validate(PursuitConfig().model_dump() | one)
        assert all(low <= one[name] <= high for name, (low, high) in SETTINGS.items())
    for calm, (gain, more_s) in zip(others, CALM, strict=False):
        assert (calm["gain"], calm["look_ahead_s"]) == pytest.approx((own["gain"] * gain, own["look_ahead_s"] + more_s))
    assert candidates(PursuitConfig(), 12, 1) == [own, *others] != candidates(PursuitConfig(), 12, 2)


def test_success_goes_before_force_and_force_before_time() -> None:
    good = [row(0), row(1)]
    ordered = [
        [row(0, time_s=8.0), row(1, time_s=8.0)],
        good,
        [row(0, force_n=0.14, time_s=5.0), row(1, force_n=0.14, time_s=5.0)],
        [row(0, force_n=0.3, time_s=5.0), row(1, force_n=0.3, time_s=5.0)],  # above the limit
        [row(0, time_s=5.0, force_n=0.0), row(1, reached=False, force_n=0.0)],
        [row(0, reached=False), row(1, reached=False)],
    ]
    ranks = [rank(rows) for rows in ordered]
    assert ranks == sorted(ranks) and len(set(ranks)) == len(ranks)


def test_the_search_keeps_to_its_runs_and_all_candidates_get_the_same_seeds() -> None:
    seen: list[Task] = []

    def spread(_function: object, tasks: Any) -> Any:
        for task in tasks:
            seen.append(task)
            yield task[0], row(task[2], time_s=10.0 + abs(task[1]["gain"] - 1.5))

    found = search(RehearsalPlan(TrialPlan(Config()), NOTHING), 100, spread)
    assert len(seen) == SEARCH_RUNS and {task[2] for task in seen} == set(range(100, 100 + SEARCH_SEEDS))
    assert {task[2] for task in seen if task[0] == 0} == {task[2] for task in seen}  # the configured ones stay in
    assert found == min((task[1] for task in seen), key=lambda one: abs(one["gain"] - 1.5))
    alike = search(RehearsalPlan(TrialPlan(Config()), NOTHING), 100, lambda _, tasks: ((task[0], row(task[2])) for task in tasks))
    assert alike == {name: getattr(PursuitConfig(), name) for name in SETTINGS}


@pytest.mark.parametrize(
    ("change", "is_better"),
    [
        ({"time_s": 8.0}, True),
        ({"force_n": 0.07}, True),
        ({"time_s": 8.0, "force_n": 0.2}, False),
        ({"time_s": 8.0, "force_n": 0.101}, False),
        ({"time_s": 8.0, "reached": False}, False),
        ({}, False),
    ],
)
def test_better_is_what_is_surely_better_and_nowhere_worse(change: dict[str, Any], is_better: bool) -> None:
    rng = np.random.default_rng(3)
    noise = rng.normal(1.0, 0.02, (2, 30))
    before = [row(seed, time_s=10.0 * noise[0, seed]) for seed in range(30)]
    after = [row(seed, **{"time_s": 10.0 * noise[0, seed], **(change if seed else {})}) for seed in range(30)]
    found = compared(before, after)
    assert found["is_better"] is is_better
    assert found["time"]["low"] <= found["time"]["change"] <= found["time"]["high"]


def test_a_force_that_is_hardly_there_does_not_stand_against_a_shorter_time() -> None:
    before = [row(seed, time_s=10.0 + 0.1 * seed, force_n=0.0002) for seed in range(30)]
    after = [row(seed, time_s=8.0 + 0.1 * seed, force_n=0.00025) for seed in range(30)]
    assert compared(before, after)["is_better"]


@pytest.mark.parametrize(("force_n", "is_better"), [(0.1, True), (0.2, False)])
def test_more_that_arrive_count_before_the_time(force_n: float, is_better: bool) -> None:
    before = [row(seed, reached=seed % 3 > 0) for seed in range(30)]
    after = [row(seed, time_s=12.0, force_n=force_n) for seed in range(30)]
    found = compared(before, after)
    assert found["arrived"]["low"] > 0.0 and found["time"]["low"] > 0.0 and found["is_better"] is is_better
