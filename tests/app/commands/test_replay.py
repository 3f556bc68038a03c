"""``replay`` of one session and of many."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import pytest

from app.commands import replay
from app.commands.replay import (
    ReplayOptions,
    prepare_out,
    replay_config,
    run_replay,
    run_replays,
    sessions_in,
)
from app.player.replayed import Replayed
from core.config.models import Config
from core.devices import UserError
from core.files import name_of
from core.session.codec import scene_to_json
from core.session.manifest import read_manifest
from core.session.reader import check_is_session
from core.types import Scene
from tests.app.golden_session import COUNT, GOLDEN, TRUTH
from tests.app.program import run as main
from tests.core.session_data import record, tick_of


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, object], Path]:
    """The golden session perceived again in its recorded configuration: what ``--json`` said, and the folder of all files."""
    out = tmp_path_factory.mktemp("replay")
    done = main("replay", GOLDEN, "--json", "--diff", "--jsonl", out / "new.jsonl", "--out", out / "out")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), out


def test_perception_still_says_what_it_said_of_the_golden_session(replayed: tuple[dict[str, object], Path]) -> None:
    """On one processor the same to the last digit; the limits leave room for the arithmetic of others."""
    result, _ = replayed
    before, after = result["before"], result["after"]
    if before["sha256"] != after["sha256"]:
        pytest.skip("it was made with another model: look at the replay, then run python -m tests.app.golden_session")
    theta, head, states = result["theta_change_deg"], result["head_shift_px"], result["states"]
    assert result["frames"] == COUNT
    assert theta["n"] >= COUNT - 3
    assert theta["median"] < 0.7
    assert theta["p95"] < 3.0
    assert head["median"] < 1.0
    assert states["changed"] <= 5


def test_perception_is_near_the_truth_of_the_golden_session(replayed: tuple[dict[str, object], Path]) -> None:
    """Whatever the model is."""
    _, out = replayed
    lines = [json.loads(line) for line in (out / "new.jsonl").read_text().splitlines()]
    truth = json.loads((GOLDEN / TRUTH).read_text())
    seen = [(line, true) for line, true in zip(lines, truth, strict=True) if line["state"] is not None]
    assert len(seen) >= COUNT - 4
    assert median(abs(line["theta_signed_deg"] - true["theta_signed_deg"]) for line, true in seen) < 7.0
    assert median(math.dist(line["head_xy"], true["head_xy"]) for line, true in seen) < 6.0


def test_all_files_tell_the_same(replayed: tuple[dict[str, object], Path]) -> None:
    result, out = replayed
    lines = [json.loads(line) for line in (out / "new.jsonl").read_text().splitlines()]
    assert len(lines) == COUNT
    assert [line["image"] for line in lines] == [f"golden_session#{place}" for place in range(COUNT)]
    assert lines[0]["time_s"] == 0.0
    assert all(second["captured_s"] > first["captured_s"] for first, second in zip(lines, lines[1:], strict=False))
    assert lines[0].keys() >= {"frame", "head_xy", "robot_path_xy", "theta_signed_deg", "state", "reason", "latency_ms"}
    assert json.loads((out / "out" / "replay.json").read_text()) == result
    frames = [json.loads(line) for line in (out / "out" / "changes.jsonl").read_text().splitlines()]
    assert [frame["after"]["theta_signed_deg"] for frame in frames] == [line["theta_signed_deg"] for line in lines]


def test_what_a_replay_has_written_may_be_written_over_and_is_no_session(
    replayed: tuple[dict[str, object], Path], tmp_path: Path
) -> None:
    """Its frames had the name of a session's: the same command was refused the second time."""
    again = Path(shutil.copytree(replayed[1] / "out", tmp_path / "again"))
    prepare_out(again)
    with pytest.raises(UserError):
        check_is_session(again)
    (again / "frames.jsonl").write_text("{}\n")  # as earlier versions called it
    prepare_out(again)
    with pytest.raises(UserError):
        check_is_session(again)
    session = Path(shutil.copytree(GOLDEN, tmp_path / "session"))
    (session / "replay.json").write_text("{}\n")
    with pytest.raises(UserError, match="is a recorded session"):
        prepare_out(session)
    assert (session / "frames.jsonl").is_file()


def options(session: Path, **changes: object) -> ReplayOptions:
    return replace(ReplayOptions(session), **changes)


def test_without_wishes_the_recorded_configuration_is_taken(tmp_path: Path) -> None:
    manifest = read_manifest(GOLDEN)
    paper = {"perception": manifest.config["perception"] | {"working_size_px": 320}}
    recorded = manifest.model_copy(update={"config": paper})
    config, notes = replay_config(recorded, options(GOLDEN))
    assert (config.perception.working_size_px, notes) == (320, [])
    config, _ = replay_config(recorded, options(GOLDEN, model="other"))
    assert (config.perception.working_size_px, config.perception.segmentation.model) == (320, "other")
    config, _ = replay_config(recorded, options(GOLDEN, preset="paper"))
    assert (config.perception.working_size_px, config.perception.gaps.rule) == (Config().perception.working_size_px, "every_pair")
    newer = manifest.model_copy(update={"config": {"perception": {"telepathy": True}}})
    config, notes = replay_config(newer, options(GOLDEN))
    assert config.perception == Config().perception
    assert notes == ["the recorded configuration is not one of this version (perception.telepathy); the default one is taken"]
    assert replay_config(None, options(GOLDEN))[1] == ["the recorded configuration is lost; the default one is taken"]


def test_another_configuration_shows_what_it_changes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Nobody is ever surer than sure: no pose is left."""
    path = tmp_path / "strict.toml"
    path.write_text("[perception.quality]\nmin_confidence = 1.0\n")
    run_replay(options(GOLDEN, config_path=path, diff=True))
    told = capsys.readouterr().out
    assert "pose lost (low confidence" in " ".join(told.split())
    assert re.search(r"pose lost at rows \d+ to \d+: low confidence", told)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda folder: options(folder / "nothing"), "no such session"),
        (options, "not a session"),
        (lambda folder: options(GOLDEN, model="no_such_model"), "no_such_model"),
        (lambda folder: options(GOLDEN, preset="moon"), "unknown preset 'moon'"),
        (lambda folder: options(GOLDEN, jsonl=folder / "file" / "x.jsonl"), "choose another"),
    ],
)
def test_bad_input_is_one_line(tmp_path: Path, make: Callable[[Path], ReplayOptions], why: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=why) as caught:
        run_replay(make(tmp_path))
    assert "\n" not in str(caught.value)


def test_an_output_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="choose another folder"):
        run_replay(options(GOLDEN), tmp_path / "file" / "out")
    with pytest.raises(UserError, match="is a recorded session, which --out would damage"):
        run_replay(options(GOLDEN), GOLDEN)


def test_lost_pictures_are_counted_and_the_rest_goes_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = record(tmp_path, [tick_of(k, 1000.0 + k / 10) for k in range(3)])
    lines = (session / "frames.jsonl").read_text().splitlines()
    (session / "frames.jsonl").write_text("\n".join([lines[0], '{"row": 1, "nonsense', lines[2]]) + "\n")
    session, out = session.rename(tmp_path / os.fsdecode(b"caf\xe9")), tmp_path / "out"
    out.mkdir()
    (out / "replay.svg").write_text("an earlier version's figure")
    run_replay(options(session), out, as_json=True)
    assert not (out / "replay.svg").exists()
    told = json.loads(capsys.readouterr().out)
    assert told["frames"] == 2
    frames = [json.loads(line) for line in (out / "changes.jsonl").read_text().splitlines()]
    assert [frame["row"] for frame in frames] == [0, 2], "as in the session, so that other tables of it can be joined"
    assert "caf\\xe9" in json.loads((out / "replay.json").read_text())["session"], "a name that is no UTF-8"
    assert any("line 2" in problem for problem in told["problems"])


def test_a_session_without_pictures_is_refused_by_name(tmp_path: Path) -> None:
    session = record(tmp_path, [tick_of(0, 1000.0)])
    (session / "video_0000.mkv").unlink()
    with pytest.raises(UserError, match="no frame that could be perceived again; the first: video_0000"):
        run_replay(options(session))


def test_ctrl_c_keeps_what_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session, out = record(tmp_path, [tick_of(k, 1000.0 + k / 10) for k in range(5)]), tmp_path / "new.jsonl"

    def interrupt(name: str, scene: Scene) -> dict[str, Any]:
        if name.endswith("#2"):
            signal.raise_signal(signal.SIGINT)
        return scene_to_json(name, scene)

    monkeypatch.setattr(replay, "scene_to_json", interrupt)
    done = main("replay", session, "--json", "--jsonl", out)
    assert (done.returncode, done.stderr.splitlines()[-1]) == (130, "interrupted")
    result = json.loads(done.stdout)
    assert (result["ended"], result["frames"]) == ("interrupted after 3 of 5 frames", 3)
    assert len(out.read_text().splitlines()) == 3


def test_a_session_that_is_given_as_here_keeps_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    session = record(tmp_path, (tick_of(index, 1000.0 + index / 30) for index in range(3)))
    monkeypatch.chdir(session)
    run_replay(options(Path("."), jsonl=tmp_path / "r.jsonl"))
    assert [json.loads(line)["image"] for line in (tmp_path / "r.jsonl").read_text().splitlines()] == [
        f"{session.name}#{row}" for row in range(3)
    ]
    for given in (Path("."), session):
        assert Replayed(tmp_path / "r.jsonl", name_of(given)).skipped == 0


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


@pytest.mark.slow
def test_over_processes_it_is_the_same(folder: Path, told: tuple[list[dict[str, Any]], Path, str]) -> None:
    done = main("replay", folder, "--diff", "--json", "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert [untimed(json.loads(line)) for line in done.stdout.splitlines()] == [untimed(line) for line in told[0]]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--jsonl", "new.jsonl"], "--jsonl is for one session: give --out"),
        (["--out", "{folder}"], "is a recorded session, which --out would damage"),
    ],
)
def test_bad_input_is_one_line_before_the_work_begins(folder: Path, arguments: list[str], why: str) -> None:
    done = main("replay", folder, *(argument.replace("{folder}", str(folder)) for argument in arguments))
    assert (done.returncode, done.stdout) == (2, "")
    assert why in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_ctrl_c_tells_what_is_done(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = replay.write_replay

    def interrupt(*written: Any) -> None:
        write(*written)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(replay, "write_replay", interrupt)
    second = shutil.copytree(folder / "small", tmp_path / "second")
    done = main("replay", folder / "small", second, "--json", "--out", tmp_path / "out")
    assert (done.returncode, done.stderr.splitlines()[-1]) == (130, "interrupted")
    total = json.loads(done.stdout.splitlines()[-1])
    assert (total["ended"], total["frames"]) == ("ended after 1 of 2 sessions", 3)
    assert json.loads((tmp_path / "out" / "replays.json").read_text())["all"] == total


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
