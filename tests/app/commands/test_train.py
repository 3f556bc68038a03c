"""``synth``, ``train`` and ``benchmark`` as a user calls them, small."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from itertools import count, islice
from pathlib import Path
from typing import Any

import pytest

from app.commands.benchmark import benchmark
from core.bench.bench import bench_from_pictures, write_bench
from core.evaluation.accuracy import FrameScore, score_set
from core.learning import training
from core.learning.augmentation import FrameCrops
from core.learning.dataset import find_samples, read_truth
from core.learning.training_plan import TrainingPlan
from core.perception.model_file import load_network, read_model_info
from tests.app.golden_session import GOLDEN
from tests.app.program import MAIN, run, run_apart


@pytest.fixture(scope="module", autouse=True)
def eight_bits_learn_quickly() -> Iterator[None]:
    """From very few pictures: how well they learn is another test's."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr("app.commands.trainer._EXAMPLES", 1)
        yield


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("synth") / "set"
    done = run("synth", "--out", out, "--count", 6, "--seed", 77, "--width", 320, "--height", 240)
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    return out


@pytest.fixture(scope="module")
def model(frames: Path) -> Path:
    out = frames.parent / "tiny"
    done = run("train", "--data", frames, "--out", out, "--steps", 3, "--batch", 2, "--crop", 64, "--base", 4, "--threads", 1)
    assert done.returncode == 0, done.stderr
    return out


def test_training_writes_a_verified_model_and_a_log(model: Path, frames: Path) -> None:
    info = read_model_info(model)
    assert info.training["frames"] == 6
    assert info.training["steps_done"] == 3
    assert info.training["sets"][0]["seed"] == 77
    assert "step 3 loss" in model.with_name("tiny.log").read_text()


def test_fine_tuning_starts_from_a_model(model: Path, frames: Path, tmp_path: Path) -> None:
    done = run("train", "--data", frames, "--init", model, "--out", tmp_path / "tuned", "--steps", 1, "--batch", 1, "--crop", 64)
    assert done.returncode == 0, done.stderr
    assert read_model_info(tmp_path / "tuned").shape == read_model_info(model).shape


@pytest.fixture(scope="module")
def near(model: Path, frames: Path) -> Path:
    """The model with a second look."""
    out = frames.parent / "near"
    few = ("--data", frames, "--steps", 1, "--batch", 1, "--threads", 1)
    done = run("train", "--second-look", "--init", model, "--out", out, *few)
    assert done.returncode == 0, done.stderr
    return out


@pytest.mark.slow
def test_the_second_look_is_trained_used_and_carried_along(near: Path, frames: Path, tmp_path: Path) -> None:
    few = ("--data", frames, "--steps", 1, "--batch", 1, "--threads", 1)
    assert read_model_info(near / "second_look").training["steps_done"] == 1
    done = run("train", "--init", near, "--out", tmp_path / "tuned", "--crop", 64, *few)
    assert done.returncode == 0, done.stderr
    weights = [folder / "second_look" / "network.onnx" for folder in (near, tmp_path / "tuned")]
    assert weights[0].read_bytes() == weights[1].read_bytes()
    done = run("perceive", frames / "images", "--model", near, "--jsonl", tmp_path / "out.jsonl")
    assert done.returncode == 0, done.stderr
    assert len((tmp_path / "out.jsonl").read_text().splitlines()) == 6
    done = run("train", "--second-look", "--out", tmp_path / "none", *few)
    assert (done.returncode, "needs --init MODEL" in done.stderr) == (2, True)


@pytest.mark.slow
def test_a_few_frames_of_a_new_look_are_learnt_beside_what_is_to_be_remembered(near: Path, frames: Path, tmp_path: Path) -> None:
    few = ("--data", frames, "--steps", 2, "--batch", 2, "--crop", 64, "--threads", 1)
    held_out = Path(shutil.copytree(frames, tmp_path / "held_out"))
    done = run("train", "--init", near, "--out", tmp_path / "tuned", "--remember", 14, "--held-out", held_out, *few)
    assert done.returncode == 0, done.stderr
    info = read_model_info(tmp_path / "tuned")
    assert info.training["frames"] == 2 * 6 + 14
    assert info.figures["held_out"] is True
    for part in (".", "second_look"):  # one after the other
        before, after = (load_network(folder / part)[0].state_dict() for folder in (near, tmp_path / "tuned"))
        learnt = {name for name in before if not before[name].equal(after[name])}
        assert "encoder.0.0.weight" in learnt
        assert not [name for name in learnt if "running_" in name], "the normalisation is not of these few frames"
    done = run("train", "--out", tmp_path / "none", "--remember", 14, *few)
    assert (done.returncode, "--remember N is for" in done.stderr) == (2, True)


def test_an_interrupted_training_keeps_what_was_learnt(frames: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = count(1)

    def interrupt(*given: Any) -> None:
        average(*given)
        if next(steps) == 3:
            signal.raise_signal(signal.SIGINT)

    average = training._average
    monkeypatch.setattr(training, "_average", interrupt)
    out, few = tmp_path / "long", ("--steps", 100_000, "--batch", 1, "--crop", 64, "--base", 4, "--threads", 1)
    done = run("train", "--data", frames, "--out", out, *few)
    assert done.returncode == 0, done.stderr
    assert "interrupted after" in done.stderr.replace("\n", " ")
    assert read_model_info(out).training["steps_done"] == 3


@pytest.mark.slow
def test_a_damaged_frame_is_one_clear_line_and_the_model_until_then_is_there(frames: Path, tmp_path: Path) -> None:
    folder, out = tmp_path / "set", tmp_path / "model"
    shutil.copytree(frames, folder)
    samples = find_samples([folder])
    mask = samples[FrameCrops(samples, TrainingPlan()).place_of(5)].robot  # of the frame that is shown last
    mask.write_bytes(mask.read_bytes()[:60])
    done = run("train", "--data", folder, "--out", out, "--steps", 60, "--batch", 1, "--crop", 64, "--base", 4, "--threads", 1)
    assert (done.returncode, done.stdout) == (2, "")
    told = f"error: {mask}: cut short (the end of the file is missing); mend this frame, or remove it; what was learnt before"
    assert done.stderr.splitlines()[-1] == f"{told} is kept, go on with --init {out}"
    assert "Traceback" not in done.stderr
    assert 5 <= read_model_info(out).training["steps_done"] < 60


def test_accuracy_goes_on_after_a_damaged_picture(model: Path, frames: Path, tmp_path: Path) -> None:
    damaged = Path(shutil.copytree(frames, tmp_path / "set"))
    cut = min((damaged / "images").iterdir())
    cut.write_bytes(cut.read_bytes()[:500])
    done = run("benchmark", "--accuracy", damaged, "--model", model, "--json")
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert (figures["frames"], figures["left_out"]) == (5, 1)
    assert f"note: 1 of 6 frames could not be read and are left out; the first: {cut}" in done.stderr


def test_an_interrupted_accuracy_tells_the_frames_until_then_and_stores_nothing(
    model: Path, frames: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    own = Path(shutil.copytree(model, tmp_path / "model"))
    before = (own / "model.json").read_bytes()

    def measure(done: int, *, as_json: bool = True) -> str:
        def cut(*given: Any) -> Iterator[FrameScore]:
            yield from islice(score_set(*given), done)
            raise KeyboardInterrupt

        monkeypatch.setattr("core.evaluation.accuracy.score_set", cut)
        with pytest.raises(KeyboardInterrupt):
            benchmark(as_json, [frames], model=str(own), store=True)
        return capsys.readouterr().out

    figures = json.loads(measure(2))
    assert (figures["interrupted"], figures["frames"], figures["frames_of_set"]) == (True, 2, 6)
    assert "interrupted after 2 of 6 frames" in " ".join(measure(2, as_json=False).split())
    assert measure(0) == ""
    assert (own / "model.json").read_bytes() == before


def test_accuracy_is_one_json_object_and_tells_by_look(model: Path, frames: Path, tmp_path: Path) -> None:
    looks = [row["family"] for row in read_truth(frames).values()]
    done = run("benchmark", "--accuracy", frames, "--model", model, "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["frames"] == 6
    assert 0 <= result["vessel_dice"] <= 1
    assert {look: row["frames"] for look, row in result["looks"].items()} == Counter(looks)
    assert result["mean_over_looks"]["frames"] == 6


@pytest.mark.slow
def test_sets_stand_side_by_side_each_also_with_its_bench(model: Path, frames: Path, tmp_path: Path) -> None:
    with_bench = Path(shutil.copytree(frames, tmp_path / "set"))
    sample = find_samples([frames])[0]
    image, vessel, _ = sample.load(640)
    write_bench(bench_from_pictures([image], vessel, "set", 640), with_bench / "bench")
    done = run("benchmark", "--accuracy", frames, "--accuracy", with_bench, "--model", model, "--json")
    assert done.returncode == 0, done.stderr
    sets = json.loads(done.stdout)["sets"]
    assert list(sets) == [str(frames), str(with_bench), f"{with_bench} with its bench"]
    assert sets[str(frames)] == sets[str(with_bench)]
    assert sets[f"{with_bench} with its bench"]["vessel_dice"] != sets[str(frames)]["vessel_dice"]
    done = run("benchmark", "--accuracy", frames, "--accuracy", with_bench, "--model", model, "--store")
    assert done.returncode == 2
    assert "--store keeps the figures of one set" in done.stderr


@pytest.mark.parametrize(
    "command",
    [
        ("perceive", "no.png"),
        ("benchmark", "--frames", "3"),
        ("trial", "--seeds", "0:1"),
        ("replay", GOLDEN),
    ],
)
def test_an_empty_name_is_no_model(command: tuple[object, ...], tmp_path: Path) -> None:
    out = ("--out", tmp_path / "out") if command[0] == "trial" else ()
    done = run(*command, *out, "--model", "")
    assert done.returncode == 2
    assert "--model is empty" in done.stderr


@pytest.mark.slow
def test_speed_is_the_contracts_json_object() -> None:
    done = run_apart("benchmark", "--json", "--frames", 8)  # the window that it times is started as it was itself
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    for key in ("total_ms", "after_network_ms", "baseline_total_ms"):
        assert 0 < result[key]["p50"] <= result[key]["p95"]
    assert {"network", "masks", "skeletons", "path", "pose"} <= set(result["stages_ms"])
    assert result["speedup"] > 0
    assert result["fps"] > 0
    assert result["peak_memory_mb"] > 0
    assert result["first_frame_s"] > 0


def test_the_window_opens_shows_and_closes_with_exit_code_0() -> None:
    environment = {name: value for name, value in os.environ.items() if name not in {"DISPLAY", "WAYLAND_DISPLAY"}}
    environment["QT_QPA_PLATFORM"] = "offscreen"
    done = subprocess.run(
        [sys.executable, str(MAIN), "gui", "--until-first-frame"], capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert json.loads(done.stdout)["first_frame_monotonic_s"] > 0


def test_without_a_display_the_window_says_so() -> None:
    environment = {name: v for name, v in os.environ.items() if name not in {"DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"}}
    done = subprocess.run([sys.executable, str(MAIN)], capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 2
    assert done.stderr.startswith("error: no display")


def test_scenes_are_trained_on_beside_frames_for_a_given_time(frames: Path, tmp_path: Path) -> None:
    done = run("synth", "--scenes", "--out", tmp_path / "set", "--count", 2, "--seed", 5, "--width", 160, "--height", 120)
    assert done.returncode == 0, done.stderr
    assert "2 scenes of phantom seed 5 " in done.stderr
    few = ("--batch", 3, "--crop", 64, "--threads", 1)
    out = tmp_path / "painted"
    done = run("train", "--scenes", tmp_path / "set", "--out", out, "--base", 4, "--minutes", 0.02, *few)
    assert done.returncode == 0, done.stderr
    info = read_model_info(out)
    assert (info.planes, info.training["scenes"], info.training["scene_sets"][0]["scenes"]) == (3, 2, True)
    assert f"({info.training['steps_done']} steps)" in done.stderr
    both = ("--data", frames, "--scenes", tmp_path / "set", "--held-out", Path(shutil.copytree(frames, tmp_path / "held_out")))
    done = run("train", *both, "--init", out, "--out", tmp_path / "both", "--steps", 2, *few)
    assert done.returncode == 0, done.stderr
    info = read_model_info(tmp_path / "both")
    assert (info.planes, info.training["frames"], info.figures["held_out"]) == (3, 6, True)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--scenes", "nowhere"), "nowhere: no scenes; needs scenes/NUMBER.npz"),
        (("--scenes", "nowhere", "--second-look", "--init", "default"), "--scenes is for whole pictures"),
        (
            ("--data", "nowhere", "--remember", 5, "--init", "default", "--minutes", 1),
            "--minutes is for a training without --remember",
        ),
    ],
)
def test_options_of_scenes_that_fit_nothing_are_refused(options: tuple[object, ...], words: str, tmp_path: Path) -> None:
    done = run("train", "--out", tmp_path / "out", *options)
    assert (done.returncode, words in done.stderr) == (2, True), done.stderr
    assert not list(tmp_path.iterdir())


def test_a_damaged_scene_ends_a_training_with_one_line(tmp_path: Path) -> None:
    (tmp_path / "set" / "scenes").mkdir(parents=True)
    (tmp_path / "set" / "scenes" / "000000.npz").write_bytes(b"no scene")
    done = run("train", "--scenes", tmp_path / "set", "--out", tmp_path / "out", "--base", 4, "--steps", 2, "--crop", 64)
    assert done.returncode == 2
    assert "000000.npz: damaged, or not a scene as synth --scenes writes it; mend this frame, or remove it" in done.stderr
    assert "Traceback" not in done.stderr


def test_several_poses_of_a_scene_are_refused(tmp_path: Path) -> None:
    done = run("synth", "--scenes", "--out", tmp_path / "x", "--count", 1, "--poses", 2)
    assert (done.returncode, "--poses is for frames" in done.stderr) == (2, True)


def test_an_unknown_look_is_named(tmp_path: Path) -> None:
    done = run("synth", "--out", tmp_path / "x", "--count", 1, "--family", "velvet")
    assert done.returncode == 2
    assert "unknown look family 'velvet'" in done.stderr
