"""In a stream the vessel is the mean of several looks, wherever the picture stands still, and of that picture only."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from core.config.models import PerceptionConfig, TrackingConfig
from core.perception.pipeline import CalibratedSegmenter, Pipeline
from core.perception.roi import ORIENTATIONS, VesselAverage, cells_of
from core.types import Frame, Image, Reason, Scene
from tests.core.perception.test_glance import CONFIG, GREEN, GREY, RED, VESSEL, WHOLE, Colours, picture

BIAS_PX = 3


class Biased(Colours):
    """Takes the vessel, but not the robot, to lie some pixels below where it is in the picture that it is shown; or is broken."""

    def __init__(self) -> None:
        super().__init__()
        self.pictures: list[Image] = []
        self.is_broken = False

    def __call__(self, image: Image) -> tuple[np.ndarray, np.ndarray]:
        self.pictures.append(image)
        vessel, robot = super().__call__(image)
        return np.roll(vessel, BIAS_PX, 0) * np.float32(np.nan if self.is_broken else 1.0), robot


@pytest.fixture
def network() -> Biased:
    return Biased()


@pytest.fixture
def pipeline(network: Biased) -> Pipeline:
    return Pipeline(network, CONFIG, roi=CalibratedSegmenter(network))


def going_on(time_s: float) -> Image:
    """A robot that goes on by 20 px a second."""
    return picture(300 + 20 * time_s)


def whole_looks(
    pipeline: Pipeline, seconds: float, image_at: Callable[[float], Image] = going_on, start_s: float = 0.0
) -> list[Scene]:
    """Those among eight frames a second."""
    times = start_s + 0.125 * np.arange(round(8 * seconds))
    scenes = [pipeline(Frame(round(8 * t), float(t), image_at(float(t)))) for t in times]
    return [scene for scene in scenes if scene.window is None]


def middle_of(scene: Scene, column: int = 100) -> float:
    """How far down the middle of the vessel lies in a column, in px."""
    assert scene.masks is not None
    return float(np.mean(np.flatnonzero(scene.masks.vessel[:, column])))


def test_what_is_wrong_in_one_orientation_and_right_in_another_is_evened_out(pipeline: Pipeline, network: Biased) -> None:
    scenes = whole_looks(pipeline, 6.5)
    times = [scene.captured_s for scene in scenes]
    assert times == [0.0, 0.625, 1.25, 1.875, 3.0, 4.125, 5.25, 6.375]
    middles = [middle_of(scene) for scene in scenes]
    true = middles[0] - BIAS_PX
    assert middles[1] - true == pytest.approx(BIAS_PX, abs=0.6), "mirrored only, it is as wrong"
    assert [middle - true for middle in middles[3:]] == pytest.approx([0.0] * 5, abs=0.6), "one of each orientation stays"
    shown = [image for image in network.pictures if image.shape == WHOLE]
    upright = [np.array_equal(image, going_on(scene.captured_s)) for image, scene in zip(shown, scenes, strict=True)]
    assert upright == [True, False, False, False] * 2


def test_the_robot_is_that_of_the_newest_look_and_lies_where_it_is(pipeline: Pipeline) -> None:
    for scene in whole_looks(pipeline, 4.5):
        assert scene.path is not None
        assert scene.path.head[0] == pytest.approx(304 + 20 * scene.captured_s, abs=2.0)
        assert scene.masks is not None
        alone = Colours()(going_on(scene.captured_s))[1]
        np.testing.assert_allclose(scene.masks.robot_probability, alone, atol=1e-6)


@pytest.mark.parametrize("shift", [(0, 6), (0, 40), (60, 0)])
def test_a_vessel_that_was_moved_is_looked_at_anew(pipeline: Pipeline, network: Biased, shift: tuple[int, int]) -> None:
    whole_looks(pipeline, 2.5)
    moved = whole_looks(pipeline, 0.1, lambda _: picture(350, shift), start_s=2.5)[0]
    np.testing.assert_array_equal(network.pictures[-1], picture(350, shift), err_msg="as it is, to begin with")
    alone = Pipeline(network, CONFIG)(Frame(0, 0.0, picture(350, shift)))
    assert middle_of(moved) == middle_of(alone)


def bent(dent_px: float) -> Image:
    """A vessel that something has bent over some 150 px, by so much, and a robot that stands still."""
    image = np.full(WHOLE, GREY, np.uint8)
    line = VESSEL + np.column_stack([0.0 * VESSEL[:, 0], dent_px * np.exp(-(((VESSEL[:, 0] - 430) / 40) ** 2))])
    cv2.polylines(image, [np.rint(line).astype(np.int32)], False, GREEN, 44)
    cv2.polylines(image, [np.rint(VESSEL[VESSEL[:, 0] <= 300] + [0, 3]).astype(np.int32)], False, RED, 8)
    return image


def test_a_vessel_that_is_bent_in_one_place_is_seen_bent_with_the_next_whole_look() -> None:
    network = Colours()
    pipeline = Pipeline(network, CONFIG, roi=CalibratedSegmenter(network))
    straight = whole_looks(pipeline, 5.0, lambda _: bent(0.0))[-1]
    for scene in whole_looks(pipeline, 5.0, lambda _: bent(14.0), start_s=5.0):
        assert middle_of(scene, 430) - middle_of(straight, 430) == pytest.approx(14.0, abs=1.0)
        assert middle_of(scene) == middle_of(straight)


def test_a_clear_tube_that_was_moved_leaves_no_ghost() -> None:
    """Its lumen looks as the board does, so most of what it leaves has not changed."""
    standing, before, after = VesselAverage(), np.zeros((480, 640), np.float32), np.zeros((480, 640), np.float32)
    before[200:240], after[260:300] = 0.9, 0.9
    image = np.full(WHOLE, 120, np.uint8)
    walls = [image.copy() for _ in range(2)]
    for picture_of, top in zip(walls, (200, 260), strict=True):
        picture_of[top - 2 : top + 2] = picture_of[top + 38 : top + 42] = 60
    nothing = np.zeros((480, 640), np.float32)
    for _ in range(ORIENTATIONS):
        standing.begin(is_turned=True)
        standing.add(before, nothing, cells_of(walls[0]), 0.0)
    standing.begin(is_turned=True)
    np.testing.assert_array_equal(standing.add(after, nothing, cells_of(walls[1]), 0.0) >= 0.5, after >= 0.5)


def test_the_robot_does_not_change_the_vessel_under_it() -> None:
    """Its body is as large as a changed picture, in time."""
    standing, nothing = VesselAverage(), np.zeros((480, 640), np.float32)
    for head_x, value in ((100, 1.0), (550, 0.0)):
        image = picture(head_x)
        robot = Colours()(image)[1]
        standing.begin(is_turned=True)
        mean = standing.add(nothing + np.float32(value), robot, cells_of(image), 0.0)
    assert (mean == 0.5).all()


def test_a_reset_begins_anew(pipeline: Pipeline) -> None:
    first = whole_looks(pipeline, 2.5)[0]
    pipeline.reset()
    assert middle_of(whole_looks(pipeline, 0.1, start_s=2.5)[0]) == middle_of(first)


def test_a_look_that_is_broken_does_not_count(pipeline: Pipeline, network: Biased) -> None:
    whole_looks(pipeline, 0.5)
    network.is_broken = True
    broken = pipeline(Frame(6, 0.6, going_on(0.6)))
    assert broken.refusal is not None
    assert broken.refusal.reason is Reason.LOW_CONFIDENCE
    network.is_broken = False
    assert all(scene.pose is not None for scene in whole_looks(pipeline, 4.0, start_s=0.7))


@pytest.mark.parametrize(
    "tracking",
    [
        TrackingConfig(window_px=0),
        TrackingConfig(window_px=640),
        TrackingConfig(refresh_s=0.0),
        TrackingConfig(enabled=False),
    ],
)
def test_who_looks_at_all_of_every_picture_sees_it_as_it_is(network: Biased, tracking: TrackingConfig) -> None:
    """One orientation after the other would make the head tremble."""
    pipeline = Pipeline(network, PerceptionConfig(tracking=tracking), roi=CalibratedSegmenter(network))
    for step in range(5):
        pipeline(Frame(step, 0.05 * step, picture(300)))
    assert [np.array_equal(image, picture(300)) for image in network.pictures] == [True] * 5


def test_pictures_without_an_answer_are_seen_as_they_are(pipeline: Pipeline, network: Biased) -> None:
    whole_looks(pipeline, 2.5)
    network.pictures.clear()
    without = picture(-100)
    for step in range(4):
        pipeline(Frame(step, 2.5 + 0.1 * step, without))
    assert [np.array_equal(image, without) for image in network.pictures[1:]] == [True] * 3, "after the one that tells it"


def test_who_looks_in_all_orientations_at_once_need_not_do_so_in_turn(network: Biased) -> None:
    pipeline = Pipeline(network, CONFIG, roi=CalibratedSegmenter(network, all_orientations=True))
    scenes = whole_looks(pipeline, 4.0)
    shown = [image for image in network.pictures if image.shape == WHOLE]
    assert [np.array_equal(image, going_on(scene.captured_s)) for image, scene in zip(shown, scenes, strict=True)] == [True] * 4


def test_single_pictures_are_seen_as_they_are(pipeline: Pipeline, network: Biased) -> None:
    whole_looks(pipeline, 0.3)
    pipeline.perceive_single(Frame(9, 1.0, picture(300)))
    np.testing.assert_array_equal(network.pictures[-1], picture(300))


STILL = np.zeros((1, 1, 3), np.float32)


def test_every_orientation_is_undone() -> None:
    standing, image = VesselAverage(), np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    seen = []
    for step in range(ORIENTATIONS):
        assert standing.is_gathering is (step > 0)
        standing.begin(is_turned=True)
        turned = standing.orient(image)
        assert turned.shape == image.shape
        found = standing.orient(turned[:, :, 0].astype(np.float32))
        np.testing.assert_array_equal(found, image[:, :, 0])
        assert found.flags.c_contiguous
        seen.append(turned.tobytes())
        standing.add(found, np.zeros_like(found), STILL, 0.0)
    assert seen[0] == image.tobytes()
    assert len(set(seen)) == ORIENTATIONS
    assert not standing.is_gathering


def test_the_mean_is_of_the_newest_look_in_each_orientation() -> None:
    standing, means = VesselAverage(), []
    for value, is_turned in ((0.0, False), (1.0, True), (0.5, True), (0.5, True), (1.0, True), (0.0, False)):
        standing.begin(is_turned=is_turned)
        found = np.full((2, 2), value, np.float32)
        means.append(float(standing.add(found, np.zeros_like(found), STILL, 0.0)[0, 0]))
        assert found[0, 0] == value, "what was given stays as it is"
    assert means == [0.0, 0.5, 0.5, 0.5, 0.75, 0.5]
    standing.reset()
    standing.begin(is_turned=True)
    assert float(standing.add(found + np.float32(0.25), found, STILL, 0.0)[0, 0]) == 0.25


def test_noise_and_light_are_no_other_vessel() -> None:
    rng = np.random.default_rng(0)
    standing, nothing = VesselAverage(), np.zeros((480, 640), np.float32)
    for value, light, noise in ((0.6, 0, 0), (1.0, 15, 12), (0.6, -10, 12), (1.0, 0, 12)):
        image = np.clip(picture(300, light=light) + rng.normal(0, noise, (480, 640, 3)), 0, 255).astype(np.uint8)
        standing.begin(is_turned=True)
        mean = standing.add(nothing + np.float32(value), nothing, cells_of(image), 2.5)
    assert np.isclose(mean, 0.8).mean() > 0.98


def test_another_picture_and_another_size_are_another_vessel() -> None:
    for other in (np.random.default_rng(1).integers(0, 255, WHOLE, np.uint8), np.zeros((240, 320, 3), np.uint8)):
        standing = VesselAverage()
        for image, value in ((picture(300), 1.0), (cv2.GaussianBlur(other, (0, 0), 6.0) * 8, 0.25)):
            found = np.full(image.shape[:2], value, np.float32)
            standing.begin(is_turned=True)
            mean = standing.add(found, np.zeros_like(found), cells_of(image), 0.0)
        assert (mean == 0.25).all()
        assert standing.is_gathering
