"""``calibrate`` on a set that ``synth`` writes now, of a copy of the shipped model."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from app.commands import calibrate as calibrate_command
from app.commands.benchmark import benchmark
from app.commands.calibrate import calibrate
from core.config.models import PerceptionConfig
from core.devices import UserError
from core.evaluation import confidence as fitting
from core.evaluation import confidence as knowing
from core.evaluation.confidence import CalibrationError
from core.files import read_image
from core.perception.inference import OpenVinoSegmenter
from core.perception.model_file import INFO, MODELS, ONNX, ONNX_INT8, SECOND_LOOK, ModelError, read_model_info, sha256_of
from core.perception.pipeline import open_calibrated
from core.perception.quality import BASIC_FEATURES
from core.perception.tip_refinement import MAX_PASSES
from hardware.twin.dataset import SynthPlan, write_set


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A set in which every other true angle is far off, so that there are wrong answers to learn from."""
    out = tmp_path_factory.mktemp("calibrate") / "set"
    write_set(SynthPlan(out, 6, 77, (320, 240)))
    rows = [json.loads(line) for line in (out / "truth.jsonl").read_text().splitlines()]
    for row in rows[::2]:
        if row["theta_deg"] is not None:
            row["theta_deg"] = 180.0 - row["theta_deg"]
            row["theta_signed_deg"] = (row["theta_signed_deg"] + 360.0) % 360.0 - 180.0
    (out / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    return out


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """The shipped model, as one from before it told how often it looks closely, of swings, and of kinds of pictures."""
    shutil.copytree(MODELS / "default", tmp_path / "older")
    info = json.loads((tmp_path / "older" / INFO).read_text())
    del info["mirrored_second_looks"], info["familiarity"]
    for part in ("features", "mean", "scale", "weights"):
        info["calibration_mirrored"][part] = info["calibration_mirrored"][part][: len(BASIC_FEATURES)]
    (tmp_path / "older" / INFO).write_text(json.dumps(info))
    return tmp_path / "older"


def _looks(model: Path, **how: bool) -> list[bool]:
    """Whether the tip is refined in four passes and the threshold sensitivity computed: seen once, and in all orientations."""
    config = PerceptionConfig.model_validate({"segmentation": {"model": str(model), "threads": 1}})
    sights = open_calibrated(config, **how)
    often = [getattr(sight.segment, "engine", "").endswith(f"second look {MAX_PASSES} times") for sight in sights]
    assert often == [sight.sensitivity for sight in sights]
    return often


@pytest.mark.slow
def test_a_model_looks_as_often_as_when_its_confidence_was_calibrated(
    frames: Path, model: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert _looks(MODELS / "default") == [False, True]
    assert _looks(model) == [False, False]
    assert _looks(model, recalibrating=True) == [False, True]
    monkeypatch.setattr(fitting, "_LEAST", 1)
    monkeypatch.setattr(knowing, "LEAST", 4)
    more = tmp_path / "more"
    more.mkdir()
    for picture in sorted((frames / "images").iterdir())[:3]:
        shutil.copy(picture, more)
    calibrate(frames, str(model), knows=[more])
    info = read_model_info(model)
    assert info.mirrored_second_looks == MAX_PASSES
    assert info.figures == {}
    assert (info.calibration.needs_sensitivity, info.calibration_mirrored.needs_sensitivity) == (False, True)
    assert info.calibration != info.calibration_mirrored
    assert info.calibration.fitted_on["set"] == "set"
    assert info.familiarity.fitted_on["knows"] == ["more"]
    assert 6 < info.familiarity.fitted_on["pictures"] <= 6 + 3
    assert _looks(model) == [False, True]


@pytest.mark.slow
def test_eight_bit_copies_are_made_anew_with_the_calibration(frames: Path, model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fitting, "_LEAST", 1)
    monkeypatch.setattr(knowing, "LEAST", 4)
    monkeypatch.setattr(calibrate_command, "_EXAMPLES", 2)
    olds, near_before = (read_model_info(folder) for folder in (model, model / SECOND_LOOK))
    calibrate(frames, str(model), eight_bit=True)
    for folder, older in ((model, olds), (model / SECOND_LOOK, near_before)):
        newer = read_model_info(folder, verify=(ONNX, ONNX_INT8))
        assert newer.onnx_int8_sha256 not in (None, older.onnx_int8_sha256), "its eight-bit copy is another one, from two frames"
        assert newer.weights_sha256 == older.weights_sha256
    assert not list(model.parent.glob(".older-*")), "nothing is left of the copy that it was worked on in"
    image = read_image(sorted((frames / "images").iterdir())[0])
    eight_bit, exact = (OpenVinoSegmenter(model, 1, precision)(image) for precision in ("int8", "fp32"))
    for one, other in zip(eight_bit, exact, strict=True):
        assert 0 < float(np.abs(one - other).mean()) < 0.02
    assert read_model_info(model).calibration is not None


def test_what_cannot_be_enough_is_said_before_the_work(
    frames: Path, model: Path, monkeypatch: pytest.MonkeyPatch, looked_at: list[object]
) -> None:
    with pytest.raises(CalibrationError, match=r"^6 frames: a calibration needs 20 right and 20 wrong answers; give it more"):
        calibrate(frames, str(model), knows=[frames])
    monkeypatch.setattr(fitting, "_LEAST", 1)
    with pytest.raises(knowing.OutOfDistributionError, match=r"^12 pictures; 40 are needed; give it more"):
        calibrate(frames, str(model), knows=[frames])
    assert not looked_at


def test_too_few_frames_leave_the_model_as_it_is(frames: Path, model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also its networks: new ones would be believed as the old ones were."""

    def write_another(folder: Path, _images: object) -> None:
        """As quickly as can be: how eight bits are learnt is another test's."""
        shutil.copyfile(folder / ONNX, folder / ONNX_INT8)
        info = read_model_info(folder, verify=())
        text = info.model_copy(update={"onnx_int8_sha256": sha256_of(folder / ONNX_INT8)}).model_dump_json()
        (folder / INFO).write_text(text)

    monkeypatch.setattr("core.learning.model_writer.write_eight_bit", write_another)
    monkeypatch.setattr(fitting, "check_frames", lambda _: None)  # as if the answers were too few, and not the frames
    monkeypatch.setattr(knowing, "check_known", lambda _: None)
    before = _files(model)
    with pytest.raises(CalibrationError, match=r"\d right and \d wrong answers: a calibration needs 20 of each; give it more"):
        calibrate(frames, str(model), eight_bit=True)
    assert _files(model) == before


def _files(folder: Path) -> dict[Path, str]:
    """Every file beside and in the folder, by its hash."""
    return {path: sha256_of(path) for path in folder.parent.rglob("*") if path.is_file()}


def test_a_model_that_cannot_be_written_is_said_before_the_work(
    frames: Path, model: Path, monkeypatch: pytest.MonkeyPatch, looked_at: list[object]
) -> None:
    can = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK and can(path, mode))
    with pytest.raises(ModelError, match="cannot be written; copy the model to a folder of yours"):
        calibrate(frames, str(model))
    with pytest.raises(ModelError, match="cannot be written; copy the model to a folder of yours"):
        benchmark(accuracy=[frames], model=str(model), store=True)
    assert not looked_at


@pytest.fixture
def looked_at(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """The sets that were perceived."""
    seen: list[object] = []
    monkeypatch.setattr("core.evaluation.accuracy.score_set", lambda samples, *_: seen.append(samples) or iter(()))
    return seen


def test_eight_bit_copies_need_torch_and_that_is_told_before_any_frame_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("core.program.util.find_spec", lambda _name: None)
    with pytest.raises(UserError, match="this needs the package torch, which is not installed: make setup"):
        calibrate(tmp_path / "none", eight_bit=True)
