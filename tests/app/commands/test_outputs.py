"""No command writes over what it reads, over somebody's work, or takes an option that could have no effect."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from app.cli import app
from app.commands.session import export, info
from app.commands.train import TrainOptions, run_train
from core.devices import UserError
from core.learning.dataset import write_mask, write_png
from core.learning.training_plan import TrainingPlan
from core.perception.model_file import MODELS
from core.session.files import add_event
from core.session.manifest import EVENTS, FRAMES, Event, EventKind
from core.session.reader import SessionReader, rows_cut_off
from core.session.recovery import recover
from hardware.twin.dataset import SynthError, SynthPlan, write_set
from tests.app.golden_session import GOLDEN
from tests.app.program import MAIN
from tests.core.session_data import record, tick_of


def call(*arguments: object) -> None:
    app([str(one) for one in arguments], standalone_mode=False)


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture
def labelled(tmp_path: Path) -> Path:
    folder = tmp_path / "set"
    for name in ("images", "masks"):
        (folder / name).mkdir(parents=True)
    for stem in ("a", "a_overlay"):
        write_png(folder / "images" / f"{stem}.png", np.full((48, 64, 3), 90, np.uint8))
        for target in ("vessel", "robot"):
            write_mask(folder / "masks" / f"{stem}_{target}.png", np.zeros((48, 64), bool))
    return folder


@pytest.mark.parametrize(
    ("outputs", "why"),
    [
        (("--jsonl", "images/a.png"), "is an input, which --jsonl would overwrite"),
        (("--masks", "masks"), "is a mask of the set, which --masks would overwrite"),
        (("--overlay", "images"), "a_overlay.png: is an input, which --overlay"),
    ],
)
def test_perceive_does_not_write_over_its_pictures(
    labelled: Path, outputs: tuple[str, str], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(labelled)
    before = contents(labelled)
    with pytest.raises(UserError, match=why):
        call("perceive", "images", *outputs)
    assert contents(labelled) == before


@pytest.mark.parametrize("given", [".", "a.png", "{tmp}/linked/a.png"])
def test_the_masks_of_a_set_are_known_however_its_pictures_are_given(
    labelled: Path, tmp_path: Path, given: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "linked").symlink_to(labelled / "images")
    (tmp_path / "a.png").symlink_to(labelled / "images" / "a.png")
    monkeypatch.chdir(labelled / "images")
    before = contents(labelled)
    with pytest.raises(UserError, match="is a mask of the set, which --masks would overwrite"):
        call("perceive", given.format(tmp=tmp_path), "--jsonl", tmp_path / "o.jsonl", "--masks", "../masks")
    assert contents(labelled) == before


def test_a_session_is_not_replayed_into_itself(tmp_path: Path) -> None:
    session = Path(shutil.copytree(GOLDEN, tmp_path / "session"))
    before = contents(session)
    with pytest.raises(UserError, match="is a recorded session, which --out would damage"):
        call("replay", session, "--out", session)
    with pytest.raises(UserError, match=f"{FRAMES}: is an input, which --jsonl would overwrite"):
        call("replay", session, "--jsonl", session / FRAMES)
    assert contents(session) == before


def test_a_replay_writes_no_file_twice_and_none_over_its_configuration(tmp_path: Path) -> None:
    for name in ("replay.json", "changes.jsonl"):
        with pytest.raises(UserError, match=f"{name}: is written by --out, too; choose another file for --jsonl"):
            call("replay", GOLDEN, "--out", tmp_path / "new", "--jsonl", tmp_path / "new" / name)
    (tmp_path / "own.toml").write_text("")
    with pytest.raises(UserError, match=r"own.toml: is an input, which --jsonl would overwrite"):
        call("replay", GOLDEN, "--config", tmp_path / "own.toml", "--jsonl", tmp_path / "own.toml")


@pytest.mark.parametrize("name", ["measurements.csv", "scatter.svg"])
def test_a_table_is_not_evaluated_into_itself(tmp_path: Path, name: str) -> None:
    table = tmp_path / name
    table.write_text("image,angle_1,angle_2,state,algorithm_angle,algorithm_state,mine\na,1,,A,2,A,x\n")
    with pytest.raises(UserError, match=f"{name}: is an input, which --out would overwrite"):
        call("evaluate", "--csv", table, "--out", tmp_path)
    assert table.read_text().endswith(",x\n")


def test_frames_are_not_made_into_somebody_elses_folder(labelled: Path) -> None:
    before = contents(labelled)
    with pytest.raises(SynthError, match="holds something that synth did not write"):
        write_set(SynthPlan(labelled, 4, 0))
    assert contents(labelled) == before


def test_frames_made_for_a_training_name_the_options_that_they_hang_on(tmp_path: Path) -> None:
    """Their folder has no option of its own."""
    plan = SynthPlan(tmp_path / "m_frames", 4, 1_000_000)
    (tmp_path / "m_frames").mkdir()
    (tmp_path / "m_frames" / "plan.json").write_text("{}")
    with pytest.raises(SynthError, match=r"other settings .*; choose another folder"):
        write_set(plan)
    with pytest.raises(UserError, match=r"m_frames: holds a set with other .*: give --seed and .*, or choose another --out$"):
        run_train(TrainOptions(tmp_path / "m", synthetic=4, base=4), TrainingPlan(steps=1, seed=3))


def test_a_folder_without_frames_to_judge_by_is_told_before_frames_are_made(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("app.commands.train.make_set", lambda *_: pytest.fail("frames are made"))
    with pytest.raises(UserError, match="nothing here: no labelled frames; needs images"):
        run_train(TrainOptions(tmp_path / "m", synthetic=4, held_out=tmp_path / "nothing here"), TrainingPlan(steps=1))


def test_frames_within_the_model_that_is_trained_are_not_learnt_from(labelled: Path, tmp_path: Path) -> None:
    model = Path(shutil.copytree(MODELS / "default", tmp_path / "model"))
    frames = Path(shutil.copytree(labelled, model / "frames"))
    before = contents(frames)
    for option in ("--data", "--held-out"):
        other = () if option == "--data" else ("--data", labelled)
        with pytest.raises(UserError, match="frames: lies within --out, which is replaced now and then; choose another --out"):
            call("train", option, frames, *other, "--init", model, "--out", model, "--steps", "1")
    assert contents(frames) == before


def test_a_finished_model_is_not_replaced(labelled: Path, tmp_path: Path) -> None:
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "model.json").write_text("{}")
    with pytest.raises(UserError, match="is a model already; choose another --out"):
        run_train(TrainOptions(tmp_path / "model", [labelled]), TrainingPlan(steps=1))
    assert (tmp_path / "model" / "model.json").read_text() == "{}"
    model = str(tmp_path / "model")
    with pytest.raises(UserError, match="lies within a model that is read for it"):
        run_train(TrainOptions(tmp_path / "model" / "newer", [labelled], init=model), TrainingPlan(steps=1))
    assert [path.name for path in (tmp_path / "model").iterdir()] == ["model.json"]
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(UserError, match="leads nowhere but to itself"):
        run_train(TrainOptions(tmp_path / "loop", [labelled]), TrainingPlan(steps=1))


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--init", "default", "--base", "8"), "--base shapes a new network; the one of --init default has its shape"),
        (("--init", "default", "--second-look", "--base", "8"), "--base is for the first look"),
        (("--init", "default", "--second-look", "--crop", "384"), "--crop is for whole pictures"),
        (("--held-out", "{set}"), "is trained on, so that it cannot judge"),
    ],
)
def test_training_refuses_what_could_have_no_effect(labelled: Path, tmp_path: Path, options: tuple[str, ...], why: str) -> None:
    with pytest.raises(UserError, match=why):
        call("train", "--data", labelled, "--out", tmp_path / "m", *(one.format(set=labelled) for one in options))
    assert not (tmp_path / "m.log").exists(), "what was refused leaves nothing behind"


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("benchmark", "--window", "5"), "benchmark --window is a development tool now: .* -m tools.benchmarks window"),
        (("benchmark", "--recording"), "tools.benchmarks recording"),
        (("benchmark", "--player", "2"), "tools.benchmarks player"),
        (("average", "a", "b", "--out", "c"), "average is gone"),
        (("soak", "--hours", "2"), "soak is a development tool now: .* -m tools.soak"),
        (("benchmark", "--store"), "--store is for --accuracy"),
        (("benchmark", "--accuracy", "set", "--store", "--true-masks"), "--store keeps figures of the model as it is shipped"),
        (("benchmark", "--accuracy", "set", "--store", "--preset", "paper"), "--store keeps figures of the model as it is shipped"),
        (("benchmark", "--accuracy", "set", "--frames", "5"), "leave it out with --accuracy"),
        (("benchmark", "--accuracy", "set", "--true-masks", "--model", "x"), "--true-masks looks through no network"),
        (("trial", "--seeds", "0:2", "--true-masks", "--model", "x"), "--true-masks looks through no network"),
        (("gui", "--rig", "twin", "--source", "photo.png"), "--source is looked at instead of a rig's camera: leave --rig out"),
        (("evaluate", "set", "--out", "out", "--manual-sd", "3"), "--manual-sd is for --like-paper"),
        (("evaluate", "set", "--out", "out", "--json", "--progress-json"), "both write to standard output"),
        (("annotate", "set", "--export", "csv", "--out", "o.csv", "--json"), "--json is for --report"),
        (("--rig", "twin", "record", "--out", "x"), "--rig before record is for the window alone"),
        (("rig", "show", "twin"), "twin: is built in and has no file"),
    ],
)
def test_options_that_contradict_each_other_are_refused(arguments: tuple[str, ...], why: str) -> None:
    with pytest.raises(UserError, match=why):
        call(*arguments)


def test_what_a_recovered_copy_loses_later_is_told_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = record(tmp_path, [tick_of(k, 1000.0 + k / 10) for k in range(12)])
    lines = (session / FRAMES).read_bytes().splitlines(keepends=True)
    (session / FRAMES).write_bytes(b"".join([*lines[:3], *lines[8:]]))
    copy = recover(session, tmp_path / "copies").folder
    with SessionReader(copy) as reader:
        reader.wait()
        assert (rows_cut_off(reader), len(reader)) == (0, 7)
    lines = (copy / FRAMES).read_bytes().splitlines(keepends=True)
    (copy / FRAMES).write_bytes(b"".join(lines[:-2]))
    with SessionReader(copy) as reader:
        reader.wait()
        assert rows_cut_off(reader) == 2


def test_what_a_closed_session_has_lost_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = record(tmp_path, [tick_of(k, 1000.0 + k / 10) for k in range(6)])

    def found() -> dict[str, object]:
        info(session, as_json=True)
        return json.loads(capsys.readouterr().out)

    assert (found()["problems"], found()["missing_rows"]) == ([], 0)
    lines = (session / FRAMES).read_bytes().splitlines(keepends=True)
    (session / FRAMES).write_bytes(b"".join(lines[:4]))
    assert (found()["problems"], found()["missing_rows"]) == ([f"{FRAMES}: the last 2 of 6 rows are lost"], 2)
    (session / FRAMES).write_bytes(b"".join(lines))
    events = (session / EVENTS).read_bytes().splitlines(keepends=True)
    (session / EVENTS).write_bytes(b"".join(events[1:]))
    lost_one = [f"{EVENTS}: 1 of {len(events)} events are lost"]
    assert found()["problems"] == lost_one
    add_event(session, Event(1000.2, EventKind.NOTE, "written while it is played"))
    assert found()["problems"] == lost_one, "a note that was added later does not stand for one that is lost"
    note = (session / EVENTS).read_bytes().splitlines(keepends=True)[-1]
    (session / EVENTS).write_bytes(b"".join([*events, note]))
    assert found()["problems"] == []
    copy = recover(session, tmp_path / "recovered").folder
    info(copy, as_json=True)
    assert "events" not in str(json.loads(capsys.readouterr().out)["problems"])
    (session / EVENTS).write_bytes(b"")
    export(session, [tmp_path / "table.csv"], as_json=True)
    assert f"{EVENTS}: {len(events)} of {len(events)} events are lost" in json.loads(capsys.readouterr().out)["problems"]
    (session / EVENTS).write_bytes(b"".join(events))
    (session / "video_0000.mkv").unlink()
    assert "1 of 1 videos are lost" in found()["problems"]


WITHOUT_QT = """
import importlib, json, sys
sys.modules["PySide6"] = None
modules, calls = json.loads(sys.argv[1])
for name in modules:
    importlib.import_module(name)
from app.cli import main
for words in calls:
    sys.argv = ["main.py", *words]
    try:
        main()
    except SystemExit as ended:
        print(ended.code, flush=True)
"""


def test_commands_need_no_qt_but_for_overlays_which_are_refused_before_anything_is_done(labelled: Path, tmp_path: Path) -> None:
    modules = [f"app.commands.{path.stem}" for path in sorted((MAIN.parent / "app" / "commands").glob("[!_]*.py"))]
    session, clip = record(tmp_path, [tick_of(k, 1000.0 + k / 10) for k in range(6)]), tmp_path / "clip.mp4"
    out, lines, video = tmp_path / "overlays", tmp_path / "o.jsonl", tmp_path / "video.mp4"
    calls = (
        ("perceive", labelled / "images", "--jsonl", lines, "--overlay", out),
        ("session", "export", tmp_path / "no_session", "--out", video),
        ("session", "export", session, "--out", clip, "--plain"),
    )
    given = json.dumps([modules, [list(map(str, words)) for words in calls]])
    done = subprocess.run([sys.executable, "-c", WITHOUT_QT, given], capture_output=True, text=True, check=False, cwd=MAIN.parent)
    assert (done.returncode, done.stdout) == (0, f"2\n2\n{clip}: 6 pictures\n"), done.stderr
    refused = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(refused) == 2
    for line, instead in zip(refused, ("leave --overlay out", "export it with --plain"), strict=True):
        assert line.startswith("error: overlays are drawn with Qt, which does not load (")
        assert line.endswith(f", or {instead}")
    assert not out.exists()
    assert not lines.exists()
