"""``--scheduler`` of ``trial``, ``synth`` and ``replay`` on a real Dask scheduler and worker, on this machine."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import pytest

from app.commands import workers
from app.commands.replay import ReplayOptions, replay_one, replay_session
from app.commands.trial import run_one
from app.commands.workers import ClusterError, code_of_worker, over_cluster
from core.config.models import Config
from core.program import as_called
from hardware.twin.dataset import Episode, SynthPlan, write_set
from hardware.twin.trial import TrialPlan
from tests.app.golden_session import GOLDEN
from tests.app.program import run

ROOT = Path(__file__).resolve().parents[3]
DASK = [sys.executable, "-m", "dask"]


def started(folder: Path, *arguments: str, where: Path = ROOT) -> subprocess.Popen[bytes]:
    with (folder / "log.txt").open("ab") as log:
        return subprocess.Popen([*DASK, *arguments, "--no-dashboard"], cwd=where, stdout=log, stderr=log)


def ended(*processes: subprocess.Popen[bytes]) -> None:
    """At once: a worker that is asked to end waits for its task, be it an hour of sleep."""
    for process in processes:
        process.kill()
        process.wait()


def scheduler(folder: Path, where: Path = ROOT) -> tuple[str, subprocess.Popen[bytes]]:
    contact = folder / "scheduler.json"
    process = started(folder, "scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(contact), where=where)
    while not contact.is_file():
        assert process.poll() is None, (folder / "log.txt").read_text()
        time.sleep(0.05)
    return json.loads(contact.read_text())["address"], process


def worker(folder: Path, address: str, where: Path = ROOT) -> subprocess.Popen[bytes]:
    """A worker that the scheduler knows."""
    process = started(folder, "worker", address, "--nthreads", "1", "--no-nanny", "--local-directory", str(folder), where=where)
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(1)
    return process


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a scheduler with one worker."""
    folder = tmp_path_factory.mktemp("cluster")
    found, process = scheduler(folder)
    hand = worker(folder, found)
    yield found
    ended(hand, process)


@pytest.mark.slow
def test_trials_of_a_cluster_are_those_of_one_process(address: str, tmp_path: Path) -> None:
    done = run("trial", "--seeds", "0:2", "--true-masks", "--max-seconds", "1", "--scheduler", address, "--json", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert [json.loads(line).get("seed") for line in done.stdout.splitlines()] == [0, 1, None]
    rows = [json.loads(line) for line in (tmp_path / "trials.jsonl").read_text().splitlines()]
    alone = run_one(TrialPlan(Config(), true_masks=True, max_seconds=1.0), ("pursuit", 1))
    assert next(row for row in rows if row["seed"] == 1) == json.loads(json.dumps(alone))


def test_frames_of_a_cluster_are_those_of_one_process(address: str, tmp_path: Path) -> None:
    plan = ("synth", "--count", "17", "--seed", "3", "--width", "160", "--height", "120")  # in two parts
    for arguments in ((*plan, "--out", tmp_path / "far", "--scheduler", address), (*plan, "--out", tmp_path / "near")):
        done = run(*arguments)
        assert done.returncode == 0, done.stderr
    far, near = ({p.relative_to(tmp_path / at): p.read_bytes() for p in (tmp_path / at).rglob("*.*")} for at in ("far", "near"))
    assert len(near) == 3 * 17 + 2 + 2
    assert far == near


@pytest.mark.slow
def test_sessions_are_perceived_again_on_a_cluster(address: str, tmp_path: Path) -> None:
    """Where a path leads to them; one that a worker does not see is told, and the others go on."""
    arguments = ("replay", GOLDEN, "--scheduler", address, "--json", "--out", tmp_path / "out")
    done = run(*arguments)
    assert done.returncode == 0, done.stderr
    told, total = (json.loads(line) for line in done.stdout.splitlines())
    alone = replay_session(ReplayOptions(GOLDEN, threads=1)).result
    assert told["states"] == total["states"] == alone["states"]
    assert told["theta_change_deg"] == alone["theta_change_deg"]
    assert json.loads((tmp_path / "out" / GOLDEN.name / "replay.json").read_text()) == told
    away = tmp_path / "away"
    (outcome,) = over_cluster(address, partial(replay_one, ReplayOptions(away)), [away])
    assert (outcome.result, outcome.problem) == ({}, f"{away}: no such session")


@pytest.mark.slow
def test_what_a_cluster_has_not_made_is_made_when_the_command_is_given_again(address: str, tmp_path: Path) -> None:
    plan = SynthPlan(tmp_path / "set", 17, 3, (160, 120))

    def breaks_off(make: Callable[[int], Episode], numbers: Sequence[int]) -> Iterator[Episode]:
        yield next(iter(over_cluster(address, make, numbers)))
        raise ClusterError("the scheduler has gone")

    with pytest.raises(ClusterError):
        write_set(plan, remote=breaks_off)
    asked: list[int] = []

    def the_rest(make: Callable[[int], Episode], numbers: Sequence[int]) -> Iterator[Episode]:
        asked.extend(numbers)
        return over_cluster(address, make, numbers)

    assert write_set(plan, remote=the_rest) == 17
    assert len(asked) == 1
    assert len(list((plan.out / "images").iterdir())) == len((plan.out / "truth.jsonl").read_text().splitlines()) == 17
    write_set(plan, remote=the_rest)
    assert len(asked) == 1


def test_results_come_as_they_are_ready_and_what_has_not_begun_is_cancelled(address: str) -> None:
    slow = over_cluster(address, time.sleep, [0.0, 0.5, 3600.0])
    assert next(slow) is None
    slow.close()
    assert sorted(over_cluster(address, abs, [-1, 2])) == [1, 2]


def test_an_error_of_a_task_comes_through(address: str) -> None:
    with pytest.raises(ZeroDivisionError):
        list(over_cluster(address, partial(divmod, 1), [0]))


def test_a_worker_of_another_version_is_refused(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert sorted(over_cluster(address, abs, [-1])) == [1]
    code_of_worker.cache_clear()
    monkeypatch.setattr(workers, "ROOT", tmp_path)
    try:
        with pytest.raises(ClusterError, match=r"another version of LumenPilot runs on tcp://127\.0\.0\.1:\d+; bring its folder"):
            list(over_cluster(address, abs, [-1]))
    finally:
        code_of_worker.cache_clear()


def test_no_scheduler_is_one_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "_TIMEOUT", "200ms")
    for nowhere, said in (
        ("tcp://127.0.0.1:9", "no Dask scheduler answers there"),
        ("no such name", "says no port; give it as HOST:PORT"),
        ("localhost", "says no port"),
        ("", "says no port"),
    ):
        with pytest.raises(ClusterError, match=said) as caught:
            list(over_cluster(nowhere, abs, [1]))
        assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_without_workers_that_can_do_it_nothing_waits(tmp_path: Path) -> None:
    found, process = scheduler(tmp_path, where=tmp_path)
    with pytest.raises(ClusterError, match=rf"has no workers; start some, in LumenPilot's folder: .*dask worker {found}"):
        list(over_cluster(found, abs, [1]))
    stranger = worker(tmp_path, found, where=tmp_path)
    with pytest.raises(ClusterError, match=r"LumenPilot is not to be found by tcp://"):
        list(over_cluster(found, abs, [1]))
    ended(stranger)
    hand = worker(tmp_path, found)
    with pytest.raises(ClusterError, match=r"does not find LumenPilot; start it in LumenPilot's folder: .*dask scheduler$"):
        list(over_cluster(found, as_called, ["a task of LumenPilot"]))
    ongoing = over_cluster(found, time.sleep, [0.0, 30.0])
    next(ongoing)
    process.kill()
    with pytest.raises(ClusterError, match="the scheduler has gone"):
        list(ongoing)
    hand.kill()
    ended(process, hand)
