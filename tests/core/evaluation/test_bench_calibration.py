"""Calibration on the few frames of one bench: the fit to a prior, the looks, and the limit of the kind of pictures."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from core.bench.bench import bench_from_pictures
from core.bench.registration import BenchView, register
from core.config.models import PerceptionConfig
from core.evaluation import bench_calibration as calibrating
from core.evaluation.accuracy import FrameScore
from core.evaluation.bench_calibration import bad_look, fit_to_prior, moved, poses_of_masks, usual_look
from core.evaluation.confidence import KnownPicture
from core.learning.dataset import Sample, write_mask, write_png
from core.perception.model_file import ModelInfo
from core.perception.quality import BASIC_FEATURES, ConfidenceCalibration
from tests.core.bench.drawn_bench import board, tube
from tests.core.learning.toy_bench import SIZE, toy_picture, toy_robot, toy_vessel

COUNT = len(BASIC_FEATURES)
PRIOR = ConfidenceCalibration(
    features=BASIC_FEATURES, mean=(0.0,) * COUNT, scale=(1.0,) * COUNT, weights=(1.0,) + (0.0,) * (COUNT - 1), offset=1.0
)


def _features(first: np.ndarray) -> np.ndarray:
    return np.column_stack([first, np.zeros((len(first), COUNT - 1))])


def scored(**different: float) -> FrameScore:
    pose = {"expected": True, "answered": True, "reason": None, "head_error_px": 1.0, "theta_error_deg": 1.0}
    angle = {"theta_deg": 5.0, "true_theta_deg": 4.0, "state": "A", "true_state": "A", "confidence": 0.8}
    return FrameScore("a", 1.0, 1.0, **pose | angle | different, evidence=(0.5,) * COUNT)


def toy_sample(folder: Path) -> Sample:
    names = [folder / name for name in ("a.png", "a_vessel.png", "a_robot.png")]
    write_png(names[0], toy_picture(toy_robot(0, 0.7)))
    write_mask(names[1], toy_vessel())
    write_mask(names[2], toy_robot(0, 0.7))
    return Sample("a", *names)


def test_without_answers_the_fit_is_the_prior() -> None:
    fitted = fit_to_prior(np.zeros(0), np.zeros(0, bool), np.zeros(0), PRIOR)
    assert fitted.weights == pytest.approx(PRIOR.weights)
    assert fitted.offset == pytest.approx(PRIOR.offset)


def test_a_model_that_answers_no_held_out_frame_keeps_the_prior() -> None:
    fitted = fit_to_prior(*calibrating._examples(calibrating._Answers((), (), ()), COUNT), PRIOR)
    assert fitted.weights == pytest.approx(PRIOR.weights)


def test_the_evidence_of_answers_is_what_the_prior_is_computed_from() -> None:
    score = scored()
    evidence, right, weight = calibrating._examples(calibrating._Answers((score,), (score,), (score,)), COUNT)
    assert evidence.shape == (3, COUNT)
    assert right.tolist() == [1.0] * 3
    assert weight.tolist() == [1.0, 1.0, 0.5]
    assert fit_to_prior(evidence, right, weight, PRIOR).offset > PRIOR.offset


def test_between_right_and_wrong_an_answer_is_right_by_a_share_but_in_the_figures(tmp_path: Path) -> None:
    errors = (0.0, -5.0, 7.0, -9.0, 10.0, 12.0)
    scores = tuple(scored(theta_error_deg=error) for error in errors)
    evidence, right, weight = calibrating._examples(calibrating._Answers(scores, (), ()), COUNT)
    assert right == pytest.approx([1.0, 1.0, 0.6, 0.2, 0.0, 0.0]), "a mask by difference is off by some degrees itself"
    far = calibrating._examples(calibrating._Answers((scored(head_error_px=16.0),), (), ()), COUNT)
    assert far[1].tolist() == [0.0]
    fitted = fit_to_prior(evidence, right, weight, PRIOR)
    lowest, highest = (fit_to_prior(evidence, (right > least).astype(float), weight, PRIOR) for least in (0.9, 0.1))
    assert lowest.offset < fitted.offset < highest.offset
    assert fitted.fitted_on["right"] == 2
    info = ModelInfo(name="drawn", shape={"fold": 1}, stride=16, weights_sha256="0" * 64, onnx_sha256="0" * 64)
    model = calibrating.BenchCalibration(tmp_path, info, [], [toy_sample(tmp_path)], [], PerceptionConfig())
    shown = model._result(calibrating._Answers(scores, (), ()), None, None)
    assert (shown.answered, shown.right) == (6, 2)
    assert shown.calibration_error == pytest.approx(0.8 - 2 / 6), "right answers are 2 of 6, whatever is in between"


def test_its_time_is_that_of_most_pictures_and_not_of_one_that_was_held_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = ModelInfo(name="drawn", shape={"fold": 1}, stride=16, weights_sha256="0" * 64, onnx_sha256="0" * 64)
    model = calibrating.BenchCalibration(tmp_path, info, [], [toy_sample(tmp_path)], [], PerceptionConfig())
    monkeypatch.setattr(calibrating, "open_pipeline", lambda *_, **_options: SimpleNamespace(perceive_single=lambda _frame: None))
    monkeypatch.setattr(calibrating, "perf_counter", iter([0.0, 13.0, 14.0, 15.0, 16.0, 17.0]).__next__)
    assert model.count_s("default", 80.0) == pytest.approx(80.0 + 6.0 + 0.12 * (model.count - 6))


def test_answers_move_the_offset_first_and_the_weights_when_there_are_many() -> None:
    rng = np.random.default_rng(1)
    few = _features(rng.normal(0, 1, 12))
    right = fit_to_prior(few, np.ones(12, bool), np.ones(12), PRIOR)
    assert right.offset > PRIOR.offset + 0.5
    assert np.abs(np.array(right.weights) - PRIOR.weights).max() < 0.3
    wrong = fit_to_prior(few, np.zeros(12, bool), np.ones(12), PRIOR)
    assert wrong.offset < PRIOR.offset - 1.0
    assert fit_to_prior(few, np.zeros(12, bool), np.full(12, 1e-9), PRIOR).offset == pytest.approx(PRIOR.offset, abs=1e-3)
    many = _features(rng.normal(0, 1, 4000))
    true = rng.random(4000) < 1 / (1 + np.exp(-(2.5 * many[:, 0] + 0.2)))
    learnt = fit_to_prior(many, true, np.ones(4000), PRIOR)
    assert learnt.weights[0] == pytest.approx(2.5, abs=0.3)
    assert learnt.offset == pytest.approx(0.2, abs=0.2)
    assert (learnt.fitted_on["answers"], learnt.fitted_on["right"]) == (4000, int(true.sum()))


def test_looks_change_the_picture_and_not_its_kind() -> None:
    image, rng = toy_picture(toy_robot(0, 0.7)), np.random.default_rng(0)
    usual = [usual_look(image, rng) for _ in range(8)]
    bad = [bad_look(image, toy_vessel(), toy_robot(0, 0.7), rng) for _ in range(8)]
    assert all(one.shape == image.shape and one.dtype == np.uint8 for one in (*usual, *bad))
    changes = [np.mean([np.corrcoef(one.ravel(), image.ravel())[0, 1] for one in looks]) for looks in (usual, bad)]
    assert changes[0] > 0.8
    assert changes[1] < changes[0]


def test_a_moved_camera_is_one_that_is_realigned() -> None:
    bench, rng = bench_from_pictures([board()], tube(), "b", 320), np.random.default_rng(0)
    views = [register(moved(board(), rng), bench) for _ in range(8)]
    assert all(isinstance(view, BenchView) for view in views)


def test_the_truth_is_the_pose_of_the_masks(tmp_path: Path) -> None:
    sample = toy_sample(tmp_path)
    empty = tmp_path / "none.png"
    write_mask(empty, np.zeros(SIZE[::-1], bool))
    config = PerceptionConfig(working_size_px=SIZE[0])
    truth = poses_of_masks([sample, replace(sample, stem="b", robot=empty)], config)
    assert truth["b"]["state"] is None
    true = np.argwhere(toy_robot(0, 0.7))
    head = true[np.argmax(true[:, 1])][::-1]
    assert np.hypot(*(np.array(truth["a"]["head_xy"]) - head)) < 6
    assert truth["a"]["theta_deg"] < 20


def test_the_limit_lies_between_the_bench_and_other_kinds() -> None:
    rng = np.random.default_rng(3)
    known = [
        (KnownPicture(Path(f"{index}.png"), Path(), index // 4), rng.normal(0, 0.1, 24).astype(np.float32)) for index in range(80)
    ]
    alone = calibrating._kind_of(known, np.zeros((0, 24), np.float32), 640)
    others = rng.normal(1.5, 0.1, (30, 24)).astype(np.float32)
    beside = calibrating._kind_of(known, others, 640)
    assert alone.limit < beside.limit <= 1.5 * alone.limit
    assert (beside.distance(others) > beside.limit).all()
    near = calibrating._kind_of(known, others / 100, 640)
    assert near.limit == alone.limit, "pictures of other kinds do not make it narrower than the bench's own"
