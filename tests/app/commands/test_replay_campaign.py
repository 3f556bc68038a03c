"""``replay`` of many sessions: alone, over processes and on a cluster the same, and one bad session spoils no other."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from app.commands import replay
from app.commands.replay import ReplayOptions, run_replays, sessions_in
from core.devices import UserError
from core.evaluation.replay import ReplayTally
from tests.app.golden_session import COUNT, GOLDEN
from tests.app.program import MAIN
from tests.app.program import run as main
from tests.core.session_data import record, tick_of


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The golden session, one of three frames that show nothing, one without pictures; and what else lies about."""
    folder = tmp_path_factory.mktemp("sessions")
    shutil.copytree(GOLDEN, folder / "golden")
    record(folder, [tick_of(k, 1000.0 + k / 10) for k in range(3)]).rename(folder / "small")
    blind = record(folder, [tick_of(0, 1000.0)])
    (blind / "video_0000.mkv").unlink()
    blind.rename(folder / "blind")
    (folder / "notes.txt").write_text("of Tuesday")
    (folder / "exports").mkdir()
    return folder


def untimed(result: dict[str, Any]) -> dict[str, Any]:
    """What two runs of the same frames must agree in."""
    kept = {key: value for key, value in result.items() if key != "latency_ms"}
    for frame in kept["changed_most"]:
        del frame["before"]["total_ms"], frame["after"]["total_ms"]
    return kept


@pytest.fixture(scope="module")
def told(folder: Path) -> tuple[list[dict[str, Any]], Path, str]:
    """What ``--json`` said of all of them, the folder of all files, and the notes."""
    out = folder.parent / "replays"
    done = main("replay", folder, "--diff", "--json", "--out", out)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()], out, done.stderr


def test_sessions_are_found_in_folders_each_once_by_name(folder: Path) -> None:
    found = [folder / name for name in ("blind", "golden", "small")]
    assert sessions_in([folder]) == found
    assert sessions_in([folder / "small", folder, folder / "golden"]) == [found[2], found[0], found[1]]
    for nothing, why in (
        (folder / "exports", "neither frames.jsonl nor a video in it, nor any session"),
        (folder / "gone", "no such session"),
        (folder / "notes.txt", "a session is a folder"),
    ):
        with pytest.raises(UserError, match=why):
            sessions_in([folder, nothing])


def test_all_are_told_in_sum_and_the_one_that_is_broken_by_name(told: tuple[list[dict[str, Any]], Path, str]) -> None:
    (golden, small, total), _, notes = told
    assert [Path(result["session"]).name for result in (golden, small)] == ["golden", "small"]
    assert (golden["frames"], small["frames"], total["frames"], total["sessions"]) == (COUNT, 3, COUNT + 3, 2)
    assert total["ended"] == "all sessions"
    assert total["theta_change_deg"] == golden["theta_change_deg"], "nothing is seen in the other one"
    each = [result["states"]["matrix"] for result in (golden, small)]
    assert total["states"]["matrix"] == [[sum(cells) for cells in zip(*rows, strict=True)] for rows in zip(*each, strict=True)]
    assert len(total["problems"]) == 1
    assert "blind: no frame that could be perceived again; the first: video_0000" in total["problems"][0]
    assert total["problems"][0] in notes
    each_most = [(Path(result["session"]).name, result["changed_most"]) for result in (golden, small)]
    frames = [{"session": name} | frame for name, most in each_most for frame in most]
    assert len(total["changed_most"]) == min(20, len(frames))
    assert all(frame in frames for frame in total["changed_most"])


def test_each_has_its_files(told: tuple[list[dict[str, Any]], Path, str]) -> None:
    (golden, small, total), out, _ = told
    assert json.loads((out / "replays.json").read_text()) == {"all": total, "each": [golden, small]}
    for result in (golden, small):
        own = out / Path(result["session"]).name
        assert json.loads((own / "replay.json").read_text()) == result
        assert len((own / "changes.jsonl").read_text().splitlines()) == result["frames"]
        assert (own / "replay.svg").is_file()


def test_over_processes_it_is_the_same(folder: Path, told: tuple[list[dict[str, Any]], Path, str]) -> None:
    done = main("replay", folder, "--diff", "--json", "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert [untimed(json.loads(line)) for line in done.stdout.splitlines()] == [untimed(line) for line in told[0]]


def test_as_tables(folder: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    run_replays(sessions_in([folder / "small"]), ReplayOptions(folder, diff=True), None, workers=1, scheduler=None, as_json=False)
    said, _ = capsys.readouterr()
    assert "1 session perceived again" in said
    assert "3 frames perceived again, all sessions" in said
    assert said.count("small") == 4, "in its row, and beside the three frames that changed"


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--jsonl", "new.jsonl"], "--jsonl is for one session: give --out"),
        (["--model", "no_such_model"], "no_such_model"),
        (["--preset", "moon"], "unknown preset 'moon'"),
        (["--out", "{folder}"], "is a recorded session, which --out would damage"),
        (["--out", "{folder}/notes.txt"], "choose another folder"),
    ],
)
def test_bad_input_is_one_line_before_the_work_begins(folder: Path, arguments: list[str], why: str) -> None:
    done = main("replay", folder, *(argument.replace("{folder}", str(folder)) for argument in arguments))
    assert (done.returncode, done.stdout) == (2, "")
    assert why in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_two_sessions_of_one_name_have_no_folder_each(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "small", tmp_path / "small")
    both = [folder / "small", tmp_path / "small"]
    with pytest.raises(UserError, match="2 sessions are called small"):
        run_replays(both, ReplayOptions(folder), tmp_path / "out", workers=1, scheduler=None, as_json=True)
    assert not (tmp_path / "out").exists()


def test_none_that_can_be_perceived_is_an_error(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "blind", tmp_path / "blind2")
    with pytest.raises(UserError, match=r"none of 2 sessions could be perceived again; the first: .*blind: no frame"):
        run_replays([folder / "blind", tmp_path / "blind2"], ReplayOptions(folder), None, workers=1, scheduler=None, as_json=True)


def test_ctrl_c_tells_what_is_done(folder: Path, tmp_path: Path) -> None:
    record(tmp_path, [tick_of(k, 1000.0 + k / 10) for k in range(900)]).rename(tmp_path / "zlong")
    out = tmp_path / "out"
    command = [sys.executable, str(MAIN), "replay", str(folder / "small"), str(tmp_path / "zlong"), "--json", "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    until_s = time.monotonic() + 60.0
    while not (out / "small" / "replay.svg").exists():
        assert process.poll() is None
        assert time.monotonic() < until_s
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    said, errors = process.communicate(timeout=60.0)
    assert (process.returncode, errors.splitlines()[-1]) == (130, "interrupted")
    total = json.loads(said.splitlines()[-1])
    assert total["ended"] in {"ended after 1 of 2 sessions", "ended after 2 of 2 sessions"}
    assert 3 <= total["frames"] < 900
    assert json.loads((out / "replays.json").read_text())["all"] == total


def test_what_was_done_is_told_when_a_worker_is_killed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(workers: int, function: Any, tasks: list[Path]) -> Any:
        yield function(tasks[0])
        raise UserError("a worker ended")

    monkeypatch.setattr(replay, "over_processes", broken)
    both = [folder / "small", folder / "golden"]
    with pytest.raises(UserError, match="a worker ended"):
        run_replays(both, ReplayOptions(folder), None, workers=2, scheduler=None, as_json=True)
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["ended"] == "ended after 1 of 2 sessions"


def test_tallies_add_up() -> None:
    nothing = ReplayTally.of([])
    assert (nothing + nothing).to_json() == nothing.to_json()
