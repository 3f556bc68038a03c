"""``calibrate`` on a set that ``synth`` writes now, of a copy of the shipped model."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import core.study.calibration as fitting
from app.calibrate_command import run_calibrate
from core.config import PerceptionConfig
from core.learning.model_file import INFO, MODELS, read_model_info
from core.perception.evidence import WITHOUT_SWINGS
from core.perception.pipeline import open_sights
from core.study.calibration import CalibrationError
from hardware.twin.synth import SynthPlan, write_set


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A set in which every other true angle is far off, so that there are wrong answers to learn from."""
    out = tmp_path_factory.mktemp("calibrate") / "set"
    write_set(SynthPlan(out, 10, 77, (320, 240)))
    rows = [json.loads(line) for line in (out / "truth.jsonl").read_text().splitlines()]
    for row in rows[::2]:
        row["theta_deg"] = None if row["theta_deg"] is None else 180.0 - abs(row["theta_deg"])
    (out / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    return out


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """The shipped model, as one from before there was a word about how often it looks closely, or of swings."""
    shutil.copytree(MODELS / "default", tmp_path / "older")
    info = json.loads((tmp_path / "older" / INFO).read_text())
    del info["mirrored_second_looks"]
    for part in ("features", "mean", "scale", "weights"):
        info["calibration_mirrored"][part] = info["calibration_mirrored"][part][: len(WITHOUT_SWINGS)]
    (tmp_path / "older" / INFO).write_text(json.dumps(info))
    return tmp_path / "older"


def _looks(model: Path, **how: bool) -> list[bool]:
    """Whether a picture is looked at closely twice, and its answer's swings looked for: seen once, and in all orientations."""
    config = PerceptionConfig.model_validate({"segmentation": {"model": str(model), "threads": 1}})
    sights = open_sights(config, **how)
    twice = [getattr(sight.segment, "engine", "").endswith("second look twice") for sight in sights]
    assert twice == [sight.swings for sight in sights]
    return twice


def test_a_model_looks_as_often_as_when_its_confidence_was_calibrated(
    frames: Path, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert _looks(MODELS / "default") == [False, True]
    assert _looks(model) == [False, False]
    assert _looks(model, recalibrating=True) == [False, True]
    monkeypatch.setattr(fitting, "_LEAST", 1)
    run_calibrate(frames, model=str(model), config_path=None)
    info = read_model_info(model)
    assert info.mirrored_second_looks == 2
    assert info.figures == {}
    assert info.calibration is not None
    assert info.calibration_mirrored is not None
    assert (info.calibration.needs_swings, info.calibration_mirrored.needs_swings) == (False, True)
    assert info.calibration != info.calibration_mirrored
    assert info.calibration.fitted_on["set"] == "set"
    assert _looks(model) == [False, True]


def test_too_few_frames_leave_the_model_as_it_is(frames: Path, model: Path) -> None:
    before = (model / INFO).read_bytes()
    with pytest.raises(CalibrationError, match="give it more frames"):
        run_calibrate(frames, model=str(model), config_path=None)
    assert (model / INFO).read_bytes() == before
