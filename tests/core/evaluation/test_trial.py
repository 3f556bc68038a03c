"""A trial as a row, and sums over rows, with numbers computed by hand."""

import json

import pytest

from core.evaluation.trial import Row, TrialLog, TrialSample, summarise, trial_row, worst
from core.types import Pose, PoseState


def _pose(state: PoseState) -> Pose:
    return Pose(5.0, 5.0, 1.0, 1.0, False, state, 1.0)


def _log() -> TrialLog:
    log = TrialLog()
    for state, force in ((PoseState.A, 0.0), (PoseState.A, 0.1), (PoseState.C, 0.4), (None, 0.1)):
        log.count(_pose(state) if state is not None else None, "" if state is not None else "no robot", force)
    log.measures = [
        TrialSample(0.0, (0.0, 0.0), 20.0, 0.0, 2.0, 0.1, 3.0, 1.0, 0.5),
        TrialSample(1.0, (3.0, 4.0), 25.0, 0.1, 4.0, 0.2, 0.2, 3.0, 1.5),
        TrialSample(2.0, (3.0, 10.0), 31.0, 0.4, None, None, None, None, None),
    ]
    return log


def _row(seed: int = 0, outcome: str = "reached", log: TrialLog | None = None) -> Row:
    return trial_row(
        log or _log(), seed=seed, policy="pursuit", phantom="random:1", outcome=outcome, way_mm=10.0, target_mm=(3.0, 12.0)
    )


def test_a_row_has_what_the_contract_asks_for() -> None:
    row = _row()
    assert (row["seed"], row["reached"], row["time_s"], row["insertion_mm"]) == (0, True, 2.0, 31.0)
    assert row["path_ratio"] == pytest.approx(1.1)  # 5 mm and 6 mm for 10 mm of way
    assert row["wall_contact_n"] == {"mean": 0.15, "p95": 0.355, "max": 0.4}
    assert row["time_near_wall_s"] == 1.0  # the second that ended 0.2 mm from the wall
    assert row["mean_d_px"] == 3.0
    assert row["offset_ratio"] == pytest.approx(0.15)
    assert row["state_shares"] == {"A": 0.6667, "B": 0.0, "C": 0.3333, "D": 0.0}
    assert (row["answered_share"], row["refusals"], row["interventions"]) == (0.75, {"no robot": 1}, 0)
    assert (row["theta_error_median_deg"], row["head_error_median_px"]) == (2.0, 1.0)
    assert row["track"]["offset_ratio"] == [0.1, 0.2, None]
    assert json.loads(json.dumps(row, allow_nan=False)) == row


def test_a_failed_trial_has_no_path_ratio() -> None:
    row = _row(outcome="stuck")
    assert (row["reached"], row["outcome"], row["path_ratio"]) == (False, "stuck", None)


def test_sums_pool_all_moments_and_take_times_from_those_that_arrived() -> None:
    failed = _row(1, "stuck")
    failed["time_s"], failed["wall_contact_n"]["max"], failed["interventions"] = 60.0, 0.7, 2
    summary = summarise([_row(0), failed])
    assert (summary["trials"], summary["reached_share"], summary["unaided_share"]) == (2, 0.5, 0.5)
    assert summary["outcomes"] == {"reached": 1, "stuck": 1}
    assert summary["wall_force_p95_n"] == 0.4  # of 0, 0.1, 0.4 twice
    assert summary["wall_force_median_n"] == 0.1
    assert summary["wall_force_max_n"] == 0.7
    assert summary["mean_offset_ratio"] == pytest.approx(0.15)
    assert (summary["mean_time_s"], summary["median_time_s"], summary["median_path_ratio"]) == (2.0, 2.0, 1.1)
    assert (summary["theta_error_median_deg"], summary["head_error_median_px"]) == (2.0, 1.0)
    assert summary["mean_interventions"] == 1.0


def test_sums_of_nothing_are_none() -> None:
    summary = summarise([])
    assert summary["trials"] == 0
    assert {value for name, value in summary.items() if name not in {"trials", "outcomes"}} == {None}


def test_the_worst_are_failures_then_those_that_needed_help_then_the_hardest() -> None:
    rows = [_row(seed) for seed in range(4)]
    rows[1]["reached"] = False
    rows[2]["wall_contact_n"]["max"] = 0.9
    rows[3]["interventions"] = 1
    assert [row["seed"] for row in worst(rows, 3)] == [1, 3, 2]
