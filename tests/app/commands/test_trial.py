"""``trial`` as a user calls it: JSON of the contract, resuming, interruption, workers, Dask, errors in one line."""

from __future__ import annotations

import json
import pickle
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from app.commands import trial
from app.commands.trial import TrialError, parse_policies, parse_seeds, run_one, summary_rows
from core.config.models import RESOURCES, Config
from core.devices import UserError
from core.evaluation.trial import Row, TrialLog, TrialSample, summarise, trial_row
from hardware.twin.trial import TrialPlan
from tests.app.program import run, run_apart


def fake_row(plan: TrialPlan, job: tuple[str, int]) -> Row:
    """What a trial would give, without running one."""
    log = TrialLog(forces_n=[0.0, 0.1 + 0.1 * job[1]])
    log.measures = [TrialSample(0.1 * k, (10.0 + k, 70.0), 20.0 + k, 0.05, 1.0, 0.1, 1.0, 0.5, 0.4) for k in range(4)]
    return trial_row(
        log,
        seed=job[1],
        policy=job[0],
        phantom=f"random:{2_000_000 + job[1]}",
        outcome="reached",
        way_mm=3.0,
        target_mm=(15.0, 70.0),
    )


@pytest.fixture
def faked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """Trials that take no time; gives the jobs that were run."""
    ran: list[tuple[str, int]] = []

    def run(plan: TrialPlan, job: tuple[str, int]) -> Row:
        ran.append(job)
        return fake_row(plan, job)

    monkeypatch.setattr(trial, "run_one", run)
    return ran


def call(seeds: str = "0:2", policies: tuple[str, ...] = (), **changed: Any) -> None:
    trial.trial(seeds, list(policies), **({"true_masks": True, "max_seconds": 5.0, "as_json": True} | changed))


def test_seeds_are_read_as_a_python_range() -> None:
    assert list(parse_seeds("3:6")) == [3, 4, 5]
    assert list(parse_seeds("7")) == [7]


@pytest.mark.parametrize("text", ["", "a:b", "5:5", "5:3", "-1:3", "1:2:3", "0:9999999"])
def test_seeds_that_make_no_sense_are_named(text: str) -> None:
    with pytest.raises(TrialError, match="--seeds"):
        parse_seeds(text)


def test_policies_are_known_by_name_and_taken_once() -> None:
    assert parse_policies(["table", "push", "table"]) == ("table", "push")
    with pytest.raises(TrialError, match="unknown policy 'magic'; known: pursuit, table, push, random"):
        parse_policies(["magic"])
    with pytest.raises(TrialError, match="unknown look 'velvet'; known: random, bench"):
        call(look="velvet")


def test_json_is_a_line_per_trial_and_then_the_summary(faked: list[Any], capsys: pytest.CaptureFixture[str]) -> None:
    call("0:2")
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["seed"] for line in lines[:-1]] == [0, 1]
    assert {
        "seed", "reached", "time_s", "insertion_mm", "path_ratio", "wall_contact_n", "time_near_wall_s", "mean_d_px",
        "state_shares", "interventions", "theta_error_median_deg", "head_error_median_px",
    } <= set(lines[0])  # fmt: skip
    assert "track" not in lines[0]
    assert set(lines[0]["wall_contact_n"]) == {"mean", "p95", "max"}
    assert {
        "trials", "reached_share", "wall_force_p95_n", "wall_force_max_n", "mean_offset_ratio", "theta_error_median_deg",
        "head_error_median_px", "mean_time_s",
    } <= set(lines[-1]["summary"])  # fmt: skip
    assert lines[-1]["summary"]["policy"] == "pursuit"
    assert lines[-1]["summary"]["wall_force_max_n"] == pytest.approx(0.2)


def test_policies_stand_side_by_side(faked: list[Any], capsys: pytest.CaptureFixture[str]) -> None:
    call("0:1", ("pursuit", "push"))
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert set(last["by_policy"]) == {"pursuit", "push"}
    call("0:1", ("pursuit", "push"), as_json=False)
    text = capsys.readouterr().out
    assert "Target reached" in text
    assert "push" in text


def test_a_campaign_goes_on_where_it_was(faked: list[Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call("0:2", out=tmp_path)
    with (tmp_path / "trials.jsonl").open("a", encoding="utf-8") as stream:
        stream.write('{"seed": 2, "polic')  # a crash in the middle of a line
    faked.clear()
    call("0:3", out=tmp_path)
    assert faked == [("pursuit", 2)]
    assert len((tmp_path / "trials.jsonl").read_text().splitlines()) == 3
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["summary"]["trials"] == 3
    report = (tmp_path / "report.html").read_text()
    assert "Trials to look at first" in report
    assert report.count("<svg") == 4
    assert json.loads((tmp_path / "summary.json").read_text())["pursuit"]["trials"] == 3


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("plan.json", "no json\n"),
        ("trials.jsonl", "no json\n"),
        ("trials.jsonl", '{"policy": "pursuit", "seed": 0}\n'),
        ("trials.jsonl", "[1]\n"),
    ],
)
def test_a_damaged_folder_is_refused_and_left_alone(faked: list[Any], tmp_path: Path, name: str, text: str) -> None:
    call("0:1", out=tmp_path)
    (tmp_path / name).write_text(text)
    with pytest.raises(TrialError, match="damaged"):
        call("0:1", out=tmp_path)
    assert (tmp_path / name).read_text() == text


def test_a_rig_file_gives_the_robot_its_joints(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    plans: list[TrialPlan] = []

    def run(plan: TrialPlan, job: tuple[str, int]) -> Row:
        plans.append(plan)
        return fake_row(plan, job)

    monkeypatch.setattr(trial, "run_one", run)
    call("3", out=tmp_path, rig=str(RESOURCES / "rigs/two_tendons_rotation.toml"))
    assert plans[0].config.servos.names == ("tendon_1", "tendon_2", "advance", "rotation")
    with pytest.raises(TrialError, match="other settings"):
        call("3", out=tmp_path)
    with pytest.raises(UserError, match=r"^unknown rig 'bench 7'"):
        call("3", rig="bench 7")


def test_a_folder_that_cannot_be_made_is_one_line(faked: list[Any], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(TrialError, match="choose another --out"):
        call("0:1", out=tmp_path / "file")


def test_an_interruption_keeps_what_is_done(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(plan: TrialPlan, job: tuple[str, int]) -> Row:
        if job[1] == 1:
            raise KeyboardInterrupt
        return fake_row(plan, job)

    monkeypatch.setattr(trial, "run_one", run)
    with pytest.raises(KeyboardInterrupt):
        call("0:3", out=tmp_path)
    shown = capsys.readouterr()
    assert json.loads(shown.out.splitlines()[-1])["summary"]["trials"] == 1
    assert "1 of 3 trials were done" in shown.err
    assert len((tmp_path / "trials.jsonl").read_text().splitlines()) == 1


def test_figures_that_miss_their_target_are_marked() -> None:
    failed = fake_row(TrialPlan(Config()), ("push", 6)) | {"reached": False}
    rows = {row.label: row.cells[0] for row in summary_rows({"push": summarise([failed])})}
    assert rows["Target reached"] == ("0 %", "missed")
    assert rows["Wall contact force, largest"] == ("0.700 N", "missed")
    assert rows["Wall contact force, p95"] == ("0.050 N", "met")
    assert rows["Time to the target, mean"] == ("–", "")


def test_what_workers_are_given_is_the_same_there() -> None:
    plan = TrialPlan(Config(), true_masks=True, max_seconds=1.0)
    there = pickle.loads(pickle.dumps(partial(run_one, plan)))
    assert (there.func, there.args) == (run_one, (plan,))


@pytest.mark.slow
def test_workers_find_what_one_process_finds(tmp_path: Path) -> None:
    arguments = ("trial", "--seeds", "0:2", "--true-masks", "--max-seconds", "1", "--workers", "2", "--json", "--out", tmp_path)
    done = run_apart(*arguments)
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in (tmp_path / "trials.jsonl").read_text().splitlines()]
    assert sorted(row["seed"] for row in rows) == [0, 1]
    alone = run_one(TrialPlan(Config(), true_masks=True, max_seconds=1.0), ("pursuit", 1))
    assert next(row for row in rows if row["seed"] == 1) == json.loads(json.dumps(alone))


def test_errors_are_one_line_and_exit_code_2() -> None:
    for extra, text in ((["--policy", "magic", "--no-wall-force"], "unknown policy 'magic'"), (["--model", "nowhere"], "nowhere")):
        done = run("trial", "--seeds", "0:1", *extra, "--json")
        assert done.returncode == 2
        assert done.stdout == ""
        assert text in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
