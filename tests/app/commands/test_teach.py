"""``teach`` as a user calls it: what is refused in one line, the frames, and, slowly, a model."""

from __future__ import annotations

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.bench.bench import read_bench
from core.bench.robot_texture import read_textures
from core.config.models import Config
from core.config.rig_file import make_rig, read_rig, write_rig
from core.learning.dataset import Sample, write_mask, write_png
from core.learning.model_writer import save_model
from core.learning.training_plan import TrainingPlan
from core.perception.model_file import MODELS, read_model_info
from core.perception.unet import DualUNet, UNetShape
from tests.app.program import run
from tests.core.learning.toy_bench import SIZE, toy_picture, toy_robot, toy_stream, toy_vessel


def _large(picture: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.resize(picture, (2 * SIZE[0], 2 * SIZE[1]), interpolation=cv2.INTER_CUBIC))


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stream in ``stream``, ``empty.png``, ``vessel.png``, and a small ``model``."""
    folder = tmp_path_factory.mktemp("teach")
    (folder / "stream").mkdir()
    for picture in toy_stream(14):
        write_png(folder / "stream" / f"{picture.stem}.png", _large(picture.image))
    write_png(folder / "empty.png", _large(toy_picture(seed=900)))
    write_png(folder / "robot.png", _large(toy_picture(toy_robot(0, 0.95), seed=901)))
    write_mask(folder / "vessel.png", _large(toy_vessel().astype(np.uint8)) > 0)
    save_model(DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)), folder / "model", training={}, figures={})
    return folder


def _teach(place: Path, out: Path, *more: object, empty: str = "empty.png", vessel: str = "vessel.png") -> tuple[int, str, str]:
    done = run(
        "teach",
        place / "stream",
        *("--empty", place / empty, "--vessel", place / vessel, "--out", out, "--init", place / "model", *more),
    )
    return done.returncode, done.stdout, done.stderr


def test_frames_are_picked_and_written_and_no_model_yet(place: Path, tmp_path: Path) -> None:
    write_png(place / "stream" / "013b.png", _large(toy_picture(seed=77)))
    code, output, errors = _teach(place, tmp_path / "own", "--frames", 10, "--frames-only", "--json")
    assert code == 0, errors
    told = json.loads(output)
    assert (told["frames"], told["held_out"], told["pictures"]) == (10, 2, 15)
    assert told["rejected"] == [{"name": "013b.png", "reason": "no robot: nothing in the vessel differs from the empty bench"}]
    assert "rejected: 013b.png: no robot: nothing in the vessel" in errors
    assert len(list((tmp_path / "own_teaching" / "images").iterdir())) == 10
    assert read_bench(tmp_path / "own_teaching" / "bench").size == (640, 480)
    assert not (tmp_path / "own").exists()
    (place / "stream" / "013b.png").unlink()


@pytest.mark.parametrize(
    ("prepare", "told"),
    [
        ("inverted", "white must be the vessel"),
        ("blank", "the vessel mask is empty"),
        ("small mask", "the vessel mask has 320x240 px"),
        ("other bench", "the empty picture does not fit 000.png: not this bench"),
        ("blurred", "the empty picture is blurred"),
        ("small empty", "000.png: 640x480 px at working size, the empty picture 640x400: take both alike"),
        ("robot", "the empty picture shows the robot near"),
        ("no time", "too short a time"),
        ("full disk", "MB are free, 200 MB are needed; make room"),
        ("no source", "is not there"),
        ("no model", "installed models"),
    ],
)
def test_bad_input_is_one_line_and_the_older_model_stays(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, prepare: str, told: str
) -> None:
    out, more, names = tmp_path / "own", list[object](), {"empty": "empty.png", "vessel": "vessel.png"}
    save_model(DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)), out, training={"mine": True}, figures={})
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    vessel, empty = toy_vessel(), toy_picture(seed=900)
    masks = {"inverted": ~_large(vessel.astype(np.uint8)).astype(bool), "blank": np.zeros((480, 640), bool), "small mask": vessel}
    pictures = {
        "other bench": _large(toy_picture(seed=900, board=5)),
        "blurred": np.asarray(cv2.GaussianBlur(_large(empty), (0, 0), 25)),
        "small empty": _large(empty)[:400],
    }
    if prepare in masks:
        write_mask(tmp_path / "given.png", masks[prepare])
        names["vessel"] = os.path.relpath(tmp_path / "given.png", place)
    elif prepare in pictures:
        write_png(tmp_path / "given.png", pictures[prepare])
        names["empty"] = os.path.relpath(tmp_path / "given.png", place)
        if prepare == "small empty":
            write_mask(tmp_path / "mask.png", _large(vessel.astype(np.uint8))[:400] > 0)
            names["vessel"] = os.path.relpath(tmp_path / "mask.png", place)
    elif prepare == "robot":
        names["empty"] = "robot.png"
    elif prepare == "no time":
        monkeypatch.setattr("app.commands.teach._twin_frames", lambda _folder: place / "stream")
        monkeypatch.setattr("core.learning.dataset.find_samples", lambda _folders: [])
        monkeypatch.setattr("core.evaluation.bench_calibration.BenchCalibration.count_s", lambda *_: 600.0)
        more = ["--minutes", 1]
    elif prepare == "full disk":
        monkeypatch.setattr("app.commands.teach._FREE_BYTES", 10**18)
        told = told.replace("200 MB", f"{10**12} MB")
    elif prepare == "no source":
        place = place / "gone"
    else:
        more = ["--init", "gone"]
    if prepare == "no source":
        done = run("teach", place, "--empty", place / "a.png", "--out", out, "--init", place.parent / "model")
        code, output, errors = done.returncode, done.stdout, done.stderr
    else:
        code, output, errors = _teach(place, out, *more, **names)
    assert (code, output) == (2, "")
    last = errors.strip().splitlines()[-1]
    assert last.startswith("error: ")
    assert told in last
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_a_set_is_the_source_of_a_later_call_without_its_pictures(place: Path, tmp_path: Path) -> None:
    assert _teach(place, tmp_path / "own", "--frames", 10, "--frames-only")[0] == 0
    folder = tmp_path / "own_teaching"
    min((folder / "images").iterdir()).unlink()
    done = run("teach", folder, "--out", tmp_path / "own", "--init", place / "model", "--frames-only", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["frames"] == 9
    assert told["rejected"][-1]["reason"] == "removed by hand"
    done = run("teach", folder, "--empty", place / "empty.png", "--out", tmp_path / "own", "--init", place / "model")
    assert (done.returncode, "leave --empty and --vessel out" in done.stderr) == (2, True)


def test_an_interrupted_training_keeps_frames_and_network_and_goes_on(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from app.commands import trainer

    begun_with: list[str] = []
    begin = trainer.FrameTraining.__init__

    def record(task: trainer.FrameTraining, samples: list[Sample], init: str, **more: int) -> None:
        begun_with.append(init)
        begin(task, samples, init, **more)

    def run_until_asked(self: trainer.Trainer, task: trainer.FrameTraining, plan: TrainingPlan) -> int:
        assert plan.seconds is not None and plan.seconds > 60.0, "however long writing and calibrating would take"
        save_model(task.network, self.out, training={}, figures={})
        self.interrupt.asked = True
        return 3

    monkeypatch.setattr(trainer.FrameTraining, "__init__", record)
    monkeypatch.setattr(trainer.Trainer, "run", run_until_asked)
    monkeypatch.setattr("app.commands.teach._twin_frames", lambda folder: folder)
    monkeypatch.setattr("core.evaluation.bench_calibration.BenchCalibration.count_s", lambda *_: 6000.0)
    out = tmp_path / "own"
    save_model(DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)), out, training={"mine": True}, figures={})
    code, output, errors = _teach(place, out, "--frames", 10)
    told = f"go on with teach {tmp_path / 'own_teaching'} --out {out}"
    assert (code, output, told in " ".join(errors.split())) == (130, "", True)
    assert read_model_info(out).training == {"mine": True}
    kept = tmp_path / "own_teaching" / "network"
    done = run("teach", tmp_path / "own_teaching", "--out", out, "--init", place / "model")
    assert (done.returncode, f"note: goes on with what was learnt before in {kept}" in done.stderr) == (130, True)
    assert begun_with == [str(place / "model"), str(kept)]


@pytest.mark.slow
def test_without_an_empty_picture_the_bench_is_what_most_pictures_show(place: Path, tmp_path: Path) -> None:
    (tmp_path / "stream").mkdir()
    for picture in toy_stream(30):
        write_png(tmp_path / "stream" / f"{picture.stem}.png", _large(_large(picture.image)))  # larger than working size
    write_mask(tmp_path / "vessel.png", cv2.resize(toy_vessel().astype(np.uint8), (1280, 960)) > 0)
    here = ("--vessel", tmp_path / "vessel.png", "--out", tmp_path / "own", "--init", place / "model")
    done = run("teach", tmp_path / "stream", *here, "--frames", 8, "--frames-only")
    assert "note: without --empty the empty bench is what most pictures show" in done.stderr
    assert done.returncode == 0, done.stderr
    found, true = read_bench(tmp_path / "own_teaching" / "bench"), _large(toy_picture(seed=900))
    assert np.abs(found.empty.astype(float) - true)[found.known].mean() < 4


@pytest.mark.slow
@pytest.mark.usefixtures("own_folder")
def test_a_bench_is_taught_from_end_to_end(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.commands.teach._EXAMPLES", 2)
    monkeypatch.setattr("app.commands.teach._REMEMBER", 4)
    monkeypatch.setattr("app.commands.teach._MOST_STEPS", 6)
    out = tmp_path / "own"
    rig = write_rig(make_rig(Config(), "lab", None))
    code, output, errors = _teach(place, out, "--frames", 10, "--minutes", 3, "--json", "--rig", "lab")
    assert code == 0, errors
    assert (read_rig(rig).model, read_rig(rig).bench) == (str(out), str(out / "bench"))
    told = json.loads(output)
    assert told["steps"] == 6
    assert told["frames"] == 8
    assert told["held_out"]["frames"] <= 2
    info = read_model_info(out)
    default = read_model_info(MODELS / "default")
    assert info.calibration is not None and default.calibration is not None
    assert info.calibration.features == default.calibration.features
    assert info.familiarity is not None
    assert info.training["taught"] == {"bench": "stream", "frames": 8}
    assert read_bench(out / "bench").vessel is not None and read_textures(out / "bench")
    assert not (tmp_path / "own_teaching" / "network").exists()
    done = run("perceive", place / "stream", "--model", out, "--jsonl", tmp_path / "out.jsonl")
    assert done.returncode == 0, done.stderr
