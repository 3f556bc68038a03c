"""Evidence of an answer counted by hand; a calibration that learns from it, survives the manifest, and tells the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.config.models import PerceptionConfig
from core.evaluation.accuracy import FrameScore
from core.evaluation.confidence import CalibrationError, auroc, expected_calibration_error, fit, is_right, reliability
from core.learning.model_writer import save_model, write_calibration
from core.perception.model_file import ModelError, read_model_info
from core.perception.quality import ConfidenceCalibration, ConfidenceFeatures, confidence_features
from core.perception.unet import DualUNet, UNetShape
from core.perception.vectors import fit_robot_vector
from core.types import Centerline, Masks, RobotPath

CONFIG = PerceptionConfig()
SHAPE = (120, 200)
LINE = np.column_stack([np.arange(20.0, 121.0), np.full(101, 60.0)])
PIECE = Centerline(np.array([[100.0, 70.0], [140.0, 70.0]]), (120.0, 70.0), 20.0)
GOOD = ConfidenceFeatures(0.99, 0.99, 0.99, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.05, 0.3, 0.0, 5.0, 0.05, 0.01)


def _masks(robot_probability: float = 1.0) -> Masks:
    vessel, robot = np.zeros(SHAPE, bool), np.zeros(SHAPE, bool)
    vessel[40:101] = True
    robot[56:65, 20:121] = True
    return Masks(vessel, robot, vessel.astype(np.float32), (robot * robot_probability).astype(np.float32))


def _collect(masks: Masks, bridged_px: float = 0.0) -> ConfidenceFeatures:
    vector = fit_robot_vector(LINE, 40.0)
    path = RobotPath(LINE, 1.3, 0.9, True, bridged_px, 4.5)
    return confidence_features(path, vector, PIECE, masks, CONFIG)


def test_evidence_of_a_clear_answer_by_hand() -> None:
    found = _collect(_masks())
    assert found.robot_seen == found.robot_seen_all == found.vessel_seen == found.inside == 1.0
    assert found.bridged == found.ambiguity == found.beyond == found.robot_doubt == found.vessel_doubt == 0.0
    assert found.bend == pytest.approx(0.0, abs=1e-9)
    assert found.lead == pytest.approx(0.4)
    assert found.offset == pytest.approx(0.5), "10 px beside the centerline of a lumen with radius 20 px"
    assert found.log_length == pytest.approx(np.log(100.0))
    assert found.off_path == pytest.approx(1 - 2 * 4.5 * 100 / (9 * 101))


def test_evidence_of_doubts_by_hand() -> None:
    masks = _masks(0.8)
    masks.robot_probability[58:62, 126:140] = 0.6  # it seems to go on
    masks.robot[0:9, 0:101] = True  # and there is as much of something else
    found = _collect(masks, bridged_px=25.0)
    assert found.robot_seen == pytest.approx(0.8)
    assert found.beyond == pytest.approx(0.6)
    assert found.bridged == pytest.approx(0.25)
    assert found.off_path == pytest.approx(1 - 900 / (2 * 909))
    assert 0.0 < found.robot_doubt <= 0.4


def _answers(count: int, seed: int = 0) -> tuple[list[tuple[float, ...]], list[bool]]:
    """Answers whose chance to be right falls with what is seen beyond the head; nothing else matters."""
    rng = np.random.default_rng(seed)
    beyond = rng.uniform(0, 1, count)
    right = rng.uniform(0, 1, count) < 1 / (1 + np.exp(8 * (beyond - 0.5)))
    return [replace(GOOD, beyond=float(b)).values() for b in beyond], right.tolist()


def test_the_calibration_finds_what_matters_and_its_promises_hold() -> None:
    calibration = fit(*_answers(2000), {"set": "made"})
    weights = dict(zip(calibration.features, calibration.weights, strict=True))
    assert max(weights, key=lambda name: abs(weights[name])) == "beyond"
    assert weights["beyond"] < 0
    evidence, right = _answers(2000, seed=1)
    confidence = np.array([calibration.confidence(ConfidenceFeatures(*row)) for row in evidence])
    error = expected_calibration_error(reliability(confidence, np.array(right), (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)))
    assert error < 0.05
    assert auroc(confidence, np.array(right)) == pytest.approx(auroc(-np.array([row[8] for row in evidence]), np.array(right)))
    assert calibration.fitted_on == {"set": "made", "answers": 2000, "right": sum(_answers(2000)[1])}


def test_swings_count_for_a_calibration_that_was_fitted_on_them() -> None:
    evidence, right = _answers(500)
    rng = np.random.default_rng(3)
    swings = [(*row, float(rng.normal(0.2 if good else 2.0, 0.3)), 0.1) for row, good in zip(evidence, right, strict=True)]
    without, with_ = fit(evidence, right, {}), fit(swings, right, {})
    assert (without.needs_sensitivity, with_.needs_sensitivity) == (False, True)
    steady, unsteady = (replace(GOOD, beyond=0.5, theta_swing=swing, head_swing=0.1) for swing in (0.2, 2.0))
    assert with_.confidence(steady) > 0.9
    assert with_.confidence(unsteady) < 0.1
    assert without.confidence(steady) == without.confidence(unsteady) == pytest.approx(0.5, abs=0.1)
    assert ConfidenceCalibration.model_validate_json(with_.model_dump_json()) == with_


def test_evidence_beyond_all_that_was_seen_is_no_certainty() -> None:
    calibration = fit(*_answers(500), {})
    absurd = replace(GOOD, bend=1e9, offset=1e9, log_length=1e9)
    assert 0.0 < calibration.confidence(absurd) < 1.0


def test_too_few_answers_are_refused() -> None:
    evidence, _ = _answers(60)
    with pytest.raises(CalibrationError, match="59 right and 1 wrong answers: a calibration needs 20 of each"):
        fit(evidence, [False] + [True] * 59, {})


def test_the_reliability_table_by_hand() -> None:
    confidence = np.array([0.1, 0.95, 0.9, 0.55, 1.0])
    right = np.array([False, True, False, True, True])
    bins = reliability(confidence, right, (0.0, 0.5, 0.9, 1.0))
    assert [(b.low, b.high, b.count) for b in bins] == [(0.0, 0.5, 1), (0.5, 0.9, 1), (0.9, 1.0, 3)]
    assert [b.right_share for b in bins] == pytest.approx([0.0, 1.0, 2 / 3])
    assert expected_calibration_error(bins) == pytest.approx((0.1 + 0.45 + 3 * abs(0.95 - 2 / 3)) / 5)
    assert auroc(confidence, right) == pytest.approx(5 / 6)
    assert auroc(confidence, np.ones(5, bool)) is None
    assert expected_calibration_error([]) is None


@pytest.mark.parametrize(
    ("theta_error_deg", "head_error_px", "expected", "right"),
    [(5.0, 15.0, True, True), (-5.1, 1.0, True, False), (1.0, 15.1, True, False), (None, None, False, False)],
)
def test_what_counts_as_right(theta_error_deg: float | None, head_error_px: float | None, expected: bool, right: bool) -> None:
    score = FrameScore("a", 1.0, 1.0, expected, True, None, head_error_px, theta_error_deg, 1.0, 1.0, "B", "B", 0.9)
    assert is_right(score) is right


def test_a_calibration_survives_the_manifest(tmp_path: Path) -> None:
    folder = tmp_path / "model"
    save_model(DualUNet(UNetShape((4, 4, 8, 8, 8), (4, 4, 4, 4), 1, 2)).eval(), folder, training={}, figures={"theta": 1})
    calibration = fit(*_answers(200), {"set": "made"})
    write_calibration(folder, calibration)
    info = read_model_info(folder)
    assert info.calibration == calibration
    assert info.figures == {}, "what was measured before is no longer true"
    text = (folder / "model.json").read_text().replace('"beyond"', '"behind"')
    (folder / "model.json").write_text(text)
    with pytest.raises(ModelError, match="run calibrate again"):
        read_model_info(folder)
