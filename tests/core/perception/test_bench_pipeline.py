"""The pipeline with a bench: drawn vessel, robot by difference, refusals, streams with windows."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.bench.bench import Bench, BenchError, bench_from_pictures, write_bench
from core.config.models import PerceptionConfig
from core.perception.pipeline import CalibratedSegmenter, Pipeline, open_pipeline, soft_edged
from core.perception.segmentation import Segmentation, Segmenter
from core.types import Frame, Image, Mask, Reason, Scene

SIZE = (640, 480)
CONFIG = PerceptionConfig()
CENTER_Y = 240


def picture(head_x: int | None, *, gain: float = 1.0, shift: tuple[int, int] = (0, 0), seed: int = 1, bench: int = 1) -> Image:
    """A textured board with a straight tube across it, and a robot from the left border to `head_x`."""
    rng = np.random.default_rng(bench)
    board = cv2.GaussianBlur(rng.normal(0.0, 60.0, (SIZE[1], SIZE[0])).astype(np.float32), (0, 0), 4.0) * 4.0
    image = np.repeat((120.0 + board)[:, :, None], 3, axis=2) * np.array([1.0, 0.9, 0.8])
    cv2.line(image, (0, CENTER_Y), (SIZE[0], CENTER_Y), (205.0, 190.0, 180.0), 44)
    if head_x is not None:
        cv2.line(image, (0, CENTER_Y + 4), (head_x, CENTER_Y + 4), (40.0, 40.0, 60.0), 9)
    matrix = np.array([[1, 0, shift[0]], [0, 1, shift[1]]], np.float64)
    image = cv2.warpAffine(image, matrix, SIZE, borderMode=cv2.BORDER_REPLICATE)
    noise = np.random.default_rng(seed).normal(0.0, 2.0, image.shape)
    return np.clip(np.rint(image * gain + noise), 0, 255).astype(np.uint8)


def tube() -> Mask:
    drawn = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    cv2.line(drawn, (0, CENTER_Y), (SIZE[0], CENTER_Y), 1, 44)
    return drawn > 0


class Blind(Segmenter):
    """A network that sees nothing; `asked` counts."""

    asked = 0

    def __call__(self, image: Image) -> tuple[np.ndarray, np.ndarray]:
        self.asked += 1
        nothing = np.zeros(image.shape[:2], np.float32)
        return nothing, nothing


@pytest.fixture(scope="module")
def bench() -> Bench:
    return bench_from_pictures([picture(None, seed=7)], tube(), "b", 640)


def single(image: Image, bench: Bench | None) -> Scene:
    return Pipeline(Blind(), CONFIG, bench=bench).perceive_single(Frame(0, 0.0, image))


def test_with_a_bench_a_robot_is_found_that_the_network_does_not_see(bench: Bench) -> None:
    scene = single(picture(400), bench)
    assert scene.refusal is None
    assert scene.path.head == pytest.approx((404, CENTER_Y + 4), abs=4.0)
    assert np.array_equal(scene.masks.vessel, tube())
    without = single(picture(400), None)
    assert without.refusal.reason is Reason.NO_VESSEL


@pytest.mark.parametrize(("shift", "gain"), [((0, 0), 0.8), ((0, 0), 1.2), ((4, -3), 1.0), ((-7, 7), 0.9), ((0, 10), 1.0)])
def test_pose_and_state_follow_a_camera_that_was_moved_and_other_light(bench: Bench, shift: tuple[int, int], gain: float) -> None:
    before, after = single(picture(400), bench), single(picture(400, shift=shift, gain=gain, seed=3), bench)
    assert after.pose.state == before.pose.state
    assert after.pose.theta_deg == pytest.approx(before.pose.theta_deg, abs=2.0)
    assert np.subtract(after.path.head, before.path.head) == pytest.approx(shift, abs=2.5)


def test_a_camera_that_was_moved_far_and_another_bench_are_refused_by_name(bench: Bench) -> None:
    for image, reason in (
        (picture(400, shift=(30, 0)), Reason.BENCH_MOVED),
        (picture(400, bench=2), Reason.OTHER_BENCH),
        (picture(400)[:400], Reason.OTHER_BENCH),
    ):
        scene = single(image, bench)
        assert scene.pose is None
        assert scene.refusal.reason is reason


class Unfamiliar(Blind):
    """Sees the tube and a robot in pictures that it does not know."""

    def __call__(self, image: Image) -> tuple[np.ndarray, np.ndarray]:
        robot = np.zeros(image.shape[:2], np.float32)
        return soft_edged(tube()), cv2.line(robot, (0, CENTER_Y + 4), (400, CENTER_Y + 4), 1.0, 9)

    def segment_signed(self, images: Sequence[Image]) -> list[Segmentation]:
        return [(*self(image), np.zeros(4, np.float32)) for image in images]


class KnowsNothing:
    working_size_px = 640

    def novelty(self, signature: np.ndarray) -> float:
        return 5.0


def test_a_picture_of_the_bench_is_known_whatever_it_looks_like(bench: Bench) -> None:
    calibrated = CalibratedSegmenter(Unfamiliar(), known=KnowsNothing())
    refused = Pipeline(calibrated, CONFIG).perceive_single(Frame(0, 0.0, picture(400))).refusal
    assert refused.reason is Reason.UNLIKE_TRAINING
    scene = Pipeline(calibrated, CONFIG, bench=bench).perceive_single(Frame(0, 0.0, picture(400)))
    assert scene.refusal is None
    assert scene.novelty == 5.0
    taught = Pipeline(replace(calibrated, is_taught=True), CONFIG, bench=bench).perceive_single(Frame(0, 0.0, picture(400)))
    assert taught.refusal.reason is Reason.UNLIKE_TRAINING, "what a model was taught on this bench holds good for it"


def test_in_a_stream_windows_follow_the_robot_and_the_drawn_vessel_is_traced_once(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    network = Blind()
    calibrated = CalibratedSegmenter(network)
    pipeline = Pipeline(calibrated, CONFIG, roi=calibrated, bench=bench)
    traced: list[Mask] = []
    original = Pipeline._trace_drawn

    def count(self: Pipeline, mask: Mask) -> object:
        traced.append(mask)
        return original(self, mask)

    monkeypatch.setattr(Pipeline, "_trace_drawn", count)
    scenes = [pipeline(Frame(k, k / 30, picture(380 + k, seed=k))) for k in range(6)]
    assert all(scene.pose is not None for scene in scenes)
    assert scenes[-1].window is not None
    assert scenes[-1].path.head[0] == pytest.approx(380 + 5 + 4, abs=4.0)
    assert len(traced) == 1


def test_a_moved_camera_is_noticed_in_a_stream(bench: Bench) -> None:
    calibrated = CalibratedSegmenter(Blind())
    pipeline = Pipeline(calibrated, CONFIG, roi=calibrated, bench=bench)
    for k in range(3):
        assert pipeline(Frame(k, k / 30, picture(380, seed=k))).pose is not None
    moved = pipeline(Frame(3, 0.1, picture(380, seed=3, shift=(0, 30))))
    assert moved.refusal.reason is Reason.BENCH_MOVED


def test_without_a_drawn_vessel_the_networks_is_used(bench: Bench) -> None:
    class SeesTheTube(Blind):
        def __call__(self, image: Image) -> tuple[np.ndarray, np.ndarray]:
            return soft_edged(tube()), np.zeros(image.shape[:2], np.float32)

    scene = Pipeline(SeesTheTube(), CONFIG, bench=replace(bench, vessel=None)).perceive_single(Frame(0, 0.0, picture(400)))
    assert scene.refusal is None
    assert scene.path.head[0] == pytest.approx(404, abs=4.0)


def test_the_configured_bench_is_read(bench: Bench, tmp_path: Path) -> None:
    write_bench(bench, tmp_path / "b")
    config = CONFIG.model_copy(update={"bench": str(tmp_path / "b")})
    opened = Pipeline(Blind(), CONFIG).with_config(config).bench
    assert opened.name == "b"
    pipeline = Pipeline(Blind(), config, bench=opened)
    assert pipeline.with_config(config).bench is opened
    write_bench(replace(bench, name="made again"), tmp_path / "b")
    again = pipeline.with_config(config).bench
    assert again.name == "made again"
    other = config.model_copy(update={"working_size_px": 320})
    with pytest.raises(BenchError, match="working size of 640 px"):
        Pipeline(Blind(), CONFIG).with_config(other)
    with pytest.raises(BenchError, match="working size of 640 px"):
        Pipeline(Blind(), config, bench=opened).with_config(other)
    with pytest.raises(BenchError, match="cannot be read"):
        open_pipeline(config.model_copy(update={"bench": str(tmp_path / "none")}))
