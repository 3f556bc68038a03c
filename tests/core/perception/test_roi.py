"""Windows in a stream: when one is enough, what it renews, and what stays."""

import functools
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from core.config.models import PerceptionConfig, TrackingConfig
from core.evaluation.confidence import KnownPicture, fit_out_of_distribution
from core.perception.pipeline import CalibratedSegmenter, Pipeline
from core.perception.roi import ORIENTATIONS, RoiSelector, VesselAverage, cells_of, has_changed, segment_roi
from core.perception.segmentation import Segmentation, Segmenter, window_around
from core.types import Frame, Image, Reason, Scene
from tests.core.drawing import SIZE, curve

VESSEL = curve((-30, 240), (200, 220), (420, 260), (680, 230))
RED, GREEN, GREY = (200, 30, 30), (30, 160, 60), (120, 120, 120)
CONFIG = PerceptionConfig(tracking=TrackingConfig(window_px=256, refresh_s=1.0))
WINDOW = (256, 256, 3)
WHOLE = (SIZE[1], SIZE[0], 3)


def picture(head_x: float, shift: tuple[int, int] = (0, 0), light: int = 0) -> Image:
    """A green vessel with a red robot whose head is at about this column, perhaps moved, perhaps in another light."""
    return np.clip(np.roll(_drawn(head_x), shift, (1, 0)).astype(int) + light, 0, 255).astype(np.uint8)


@functools.cache
def _drawn(head_x: float) -> Image:
    image = np.full((SIZE[1], SIZE[0], 3), GREY, np.uint8)
    line = np.rint(VESSEL).astype(np.int32)
    cv2.polylines(image, [line], False, GREEN, 44)
    cv2.polylines(image, [line[line[:, 0] <= head_x] + [0, 3]], False, RED, 8)
    return image


class Colours(Segmenter):
    """Tells vessel and robot by their colours and can look at any part of a picture; notes what it was shown."""

    engine = "colours"

    def __init__(self) -> None:
        self.shown: list[tuple[int, ...]] = []

    def __call__(self, image: Image) -> tuple[np.ndarray, np.ndarray]:
        self.shown.append(image.shape)
        red, green = image[:, :, 0].astype(int), image[:, :, 1].astype(int)
        robot, vessel = red > green + 60, np.abs(red - green) > 20
        return tuple(cv2.GaussianBlur(mask.astype(np.float32), (3, 3), 0) for mask in (vessel, robot))


@pytest.fixture
def network() -> Colours:
    return Colours()


@pytest.fixture
def pipeline(network: Colours) -> Pipeline:
    return Pipeline(network, CONFIG, roi=CalibratedSegmenter(network))


def see(pipeline: Pipeline, time_s: float, image: Image):
    return pipeline(Frame(round(time_s * 20), time_s, image))


def test_the_first_look_is_whole_and_the_next_ones_are_windows(pipeline: Pipeline, network: Colours) -> None:
    scenes = [see(pipeline, 0.05 * index, picture(300 + 4 * index)) for index in range(5)]
    assert network.shown == [WHOLE, *[WINDOW] * 4]
    assert [scene.window is None for scene in scenes] == [True, False, False, False, False]
    for index, scene in enumerate(scenes):
        assert scene.path.head[0] == pytest.approx(304 + 4 * index, abs=2.0)  # the line is drawn with a round end


def test_a_window_is_looked_at_beside_the_vessel_that_is_known() -> None:
    class Beside(Colours):
        """Notes which vessel it is told of, and finds the robot alone."""

        def __init__(self) -> None:
            super().__init__()
            self.told: list[np.ndarray] = []

        def segment_robot_beside(self, vessel: np.ndarray, image: Image) -> np.ndarray:
            self.told.append(vessel)
            return self(image)[1]

    network = Beside()
    pipeline = Pipeline(network, CONFIG, roi=CalibratedSegmenter(network))
    scenes = [see(pipeline, 0.05 * index, picture(300 + 4 * index)) for index in range(3)]
    assert len(network.told) == 2
    for scene, vessel in zip(scenes[1:], network.told, strict=True):
        assert scene.pose is not None
        x, y, width, height = scene.window
        np.testing.assert_array_equal(vessel, scene.masks.vessel_probability[y : y + height, x : x + width])


def test_a_window_tells_the_same_pose_as_the_whole_picture(pipeline: Pipeline) -> None:
    whole = Pipeline(Colours(), CONFIG)
    for index in range(6):
        image = picture(300 + 3 * index)
        part, all_of_it = see(pipeline, 0.05 * index, image), see(whole, 0.05 * index, image)
        assert part.pose.theta_deg == pytest.approx(all_of_it.pose.theta_deg, abs=1e-6)
        np.testing.assert_allclose(part.path.points, all_of_it.path.points)


def test_after_refresh_s_all_of_it_is_looked_at_again_and_sooner_until_all_orientations_are_seen(pipeline: Pipeline) -> None:
    whole = [step for step in range(40) if see(pipeline, 0.125 * step, picture(300)).window is None]
    assert whole == [0, 5, 10, 15, 24, 33], "more than 0.5 s three times, then more than 1 s"


def test_a_slow_machine_comes_back_to_windows(pipeline: Pipeline, network: Colours) -> None:
    """A whole look that takes longer than the head needs to leave the window would make the next one whole, too, and so on."""
    for index in range(4):
        see(pipeline, 0.2 * index, picture(300 + 5 * index))
    assert network.shown == [WHOLE, WHOLE, WINDOW, WINDOW]
    see(pipeline, 1.4, picture(320))
    assert network.shown[-1] == WHOLE, "later than usual"


def test_after_a_pause_in_which_the_head_may_have_left_the_window_all_of_it_is_looked_at(pipeline: Pipeline) -> None:
    see(pipeline, 0.0, picture(200))
    see(pipeline, 0.1, picture(200))
    scene = see(pipeline, 0.5, picture(400))
    assert scene.window is None
    assert scene.path.head[0] == pytest.approx(404, abs=2.0)


def test_a_phantom_that_moves_is_looked_at_whole(pipeline: Pipeline, network: Colours) -> None:
    see(pipeline, 0.0, picture(300))
    scene = see(pipeline, 0.05, picture(300, shift=(0, 6)))
    assert network.shown == [WHOLE, WHOLE]
    assert scene.vessel_graph is not None
    assert see(pipeline, 0.1, picture(300, shift=(0, 6))).window is not None


def grainy(image: Image, seed: int, levels: float = 16.0) -> Image:
    """With noise whose grain is some pixels wide, as in an X-ray: as many levels of it do not average out over a cell."""
    grain = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, image.shape[:2]), (0, 0), 1.6)
    return np.clip(image + levels * (0.6 * grain / grain.std())[:, :, None], 0, 255).astype(np.uint8)


def textured(seed: int) -> Image:
    """A picture full of spots, another one for each seed."""
    spots = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, WHOLE), (0, 0), 8.0)
    return np.clip(128 + 40 * spots / spots.std(), 0, 255).astype(np.uint8)


def test_grain_is_no_change_either_once_it_is_known(pipeline: Pipeline, network: Colours) -> None:
    assert has_changed(cells_of(grainy(picture(300), 0)), cells_of(grainy(picture(300), 1)), (200, 100, 256, 256))
    for step in range(6):
        see(pipeline, 0.05 * step, grainy(picture(300), step))
    assert network.shown == [WHOLE, *[WINDOW] * 5]
    see(pipeline, 0.3, grainy(picture(300, shift=(0, 6)), 7))
    assert network.shown[-1] == WHOLE


@pytest.mark.parametrize("is_noisy", [False, True])
def test_another_picture_is_a_change_however_much_of_it_is_another(is_noisy: bool) -> None:
    """Noise is what frames have differed by before, and not what the frame in question does."""
    glances = RoiSelector(CONFIG.tracking)
    for step in range(20):
        glances.choose(grainy(textured(0), step) if is_noisy else textured(0), 0.05 * step, 9.0)
    assert (glances.noise > 2.0) is is_noisy
    before, moved = cells_of(textured(0)), cells_of(np.roll(textured(0), 40, 0))
    for other in (cells_of(textured(1)), moved, cells_of(picture(300))):
        assert has_changed(before, other, (200, 100, 256, 256), glances.noise)
    glances.choose(textured(1), 2.0, 9.0)
    assert glances.noise < 10.0, "one frame says nothing of the noise"


def test_after_a_frame_without_an_answer_comes_a_whole_look(pipeline: Pipeline, network: Colours) -> None:
    see(pipeline, 0.0, picture(300))
    black = see(pipeline, 0.05, np.zeros(WHOLE, np.uint8))
    assert black.refusal.reason is Reason.BLACK
    see(pipeline, 0.1, picture(300))
    assert network.shown == [WHOLE, WHOLE]


def test_a_reset_and_another_picture_size_forget(pipeline: Pipeline, network: Colours) -> None:
    see(pipeline, 0.0, picture(300))
    pipeline.reset()
    see(pipeline, 0.05, picture(300))
    see(pipeline, 0.1, np.ascontiguousarray(picture(300)[:400]))
    assert network.shown == [WHOLE, WHOLE, (400, 640, 3)]


def test_single_pictures_neither_use_nor_disturb_the_windows(pipeline: Pipeline, network: Colours) -> None:
    see(pipeline, 0.0, picture(300))
    assert pipeline.perceive_single(Frame(9, 0.02, picture(150))).window is None
    assert see(pipeline, 0.05, picture(304)).window is not None
    assert network.shown == [WHOLE, WHOLE, WINDOW]


@pytest.mark.parametrize("tracking", [TrackingConfig(window_px=0), TrackingConfig(enabled=False)])
def test_windows_can_be_switched_off(network: Colours, tracking: TrackingConfig) -> None:
    pipeline = Pipeline(network, replace_tracking(tracking), roi=CalibratedSegmenter(network))
    for index in range(3):
        see(pipeline, 0.05 * index, picture(300))
    assert network.shown == [WHOLE] * 3


def replace_tracking(tracking: TrackingConfig) -> PerceptionConfig:
    return CONFIG.model_copy(update={"tracking": tracking})


def test_the_window_stays_inside_the_picture_with_the_head_in_its_middle() -> None:
    assert window_around((320.4, 240.0), SIZE, 256) == (192, 112, 256, 256)
    assert window_around((10.0, 470.0), SIZE, 256) == (0, 224, 256, 256)
    assert window_around((320.0, 240.0), (640, 200), 256) == (192, 0, 256, 200)


def test_a_windows_inner_edges_are_left_out_and_the_pictures_are_not() -> None:
    old = np.full((480, 640), 0.25, np.float32)

    class Ones(Segmenter):
        def __call__(self, image: Image) -> tuple[np.ndarray, np.ndarray]:
            return np.zeros(image.shape[:2], np.float32), np.ones(image.shape[:2], np.float32)

    known = SimpleNamespace(vessel_probability=np.zeros_like(old), robot_probability=old)
    renewed = segment_roi(Ones(), np.zeros(WHOLE, np.uint8), (0, 100, 256, 256), known)
    assert old.max() == 0.25
    seen = np.argwhere(renewed == 1.0)
    assert seen.min(axis=0).tolist() == [116, 0]
    assert seen.max(axis=0).tolist() == [339, 239]


def test_a_stream_that_is_wound_back_is_looked_at_whole() -> None:
    glances = RoiSelector(CONFIG.tracking)
    assert glances.choose(picture(300), 1.0, 1.0) is None
    network = Colours()
    pipeline = Pipeline(network, CONFIG, roi=CalibratedSegmenter(network))
    see(pipeline, 5.0, picture(300))
    see(pipeline, 4.0, picture(300))
    assert network.shown == [WHOLE, WHOLE]


class Kind(Colours):
    """Also tells what kind of picture it is."""

    def __init__(self, signature: np.ndarray) -> None:
        super().__init__()
        self.signature = signature

    def segment_signed(self, images: list[Image]) -> list[Segmentation]:
        return [(*self(image), self.signature) for image in images]


def test_a_window_tells_nothing_of_the_kind_and_who_is_refused_for_it_is_looked_at_whole() -> None:
    signatures = np.random.default_rng(0).normal(size=(100, 4)).astype(np.float32)
    network = Kind(signatures[0])
    familiarity = fit_out_of_distribution([KnownPicture(Path(), Path(), index) for index in range(100)], signatures, 640, {})
    pipeline = Pipeline(CalibratedSegmenter(network, known=familiarity), CONFIG, roi=CalibratedSegmenter(network))
    scenes = [see(pipeline, 0.05 * index, picture(300 + 4 * index)) for index in range(3)]
    assert [scene.window is None for scene in scenes] == [True, False, False]
    assert [scene.novelty is None for scene in scenes] == [False, True, True]
    assert all(scene.pose is not None for scene in scenes)
    network.signature = np.full(4, 50.0, np.float32)
    assert see(pipeline, 0.2, picture(312)).pose is not None, "it is asked for again with the next whole look"
    later = [see(pipeline, 2.0 + 0.05 * index, picture(312)) for index in range(2)]
    assert [scene.refusal.reason for scene in later if scene.refusal] == [Reason.UNLIKE_TRAINING] * 2
    assert [scene.window for scene in later] == [None, None]


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
def biased() -> Biased:
    return Biased()


@pytest.fixture
def averaging(biased: Biased) -> Pipeline:
    return Pipeline(biased, CONFIG, roi=CalibratedSegmenter(biased))


def going_on(time_s: float) -> Image:
    """A robot that goes on by 20 px a second."""
    return picture(300 + 20 * time_s)


def whole_looks(
    averaging: Pipeline, seconds: float, image_at: Callable[[float], Image] = going_on, start_s: float = 0.0
) -> list[Scene]:
    """Those among eight frames a second."""
    times = start_s + 0.125 * np.arange(round(8 * seconds))
    scenes = [averaging(Frame(round(8 * t), float(t), image_at(float(t)))) for t in times]
    return [scene for scene in scenes if scene.window is None]


def middle_of(scene: Scene, column: int = 100) -> float:
    """How far down the middle of the vessel lies in a column, in px."""
    return float(np.mean(np.flatnonzero(scene.masks.vessel[:, column])))


def test_what_is_wrong_in_one_orientation_and_right_in_another_is_evened_out(averaging: Pipeline, biased: Biased) -> None:
    scenes = whole_looks(averaging, 6.5)
    times = [scene.captured_s for scene in scenes]
    assert times == [0.0, 0.625, 1.25, 1.875, 3.0, 4.125, 5.25, 6.375]
    middles = [middle_of(scene) for scene in scenes]
    true = middles[0] - BIAS_PX
    assert middles[1] - true == pytest.approx(BIAS_PX, abs=0.6), "mirrored only, it is as wrong"
    assert [middle - true for middle in middles[3:]] == pytest.approx([0.0] * 5, abs=0.6), "one of each orientation stays"
    shown = [image for image in biased.pictures if image.shape == WHOLE]
    upright = [np.array_equal(image, going_on(scene.captured_s)) for image, scene in zip(shown, scenes, strict=True)]
    assert upright == [True, False, False, False] * 2


def test_the_robot_is_that_of_the_newest_look_and_lies_where_it_is(averaging: Pipeline) -> None:
    for scene in whole_looks(averaging, 4.5):
        assert scene.path.head[0] == pytest.approx(304 + 20 * scene.captured_s, abs=2.0)
        alone = Colours()(going_on(scene.captured_s))[1]
        np.testing.assert_allclose(scene.masks.robot_probability, alone, atol=1e-6)


@pytest.mark.parametrize("shift", [(0, 6), (0, 40), (60, 0)])
def test_a_vessel_that_was_moved_is_looked_at_anew(averaging: Pipeline, biased: Biased, shift: tuple[int, int]) -> None:
    whole_looks(averaging, 2.5)
    moved = whole_looks(averaging, 0.1, lambda _: picture(350, shift), start_s=2.5)[0]
    np.testing.assert_array_equal(biased.pictures[-1], picture(350, shift), err_msg="as it is, to begin with")
    alone = Pipeline(biased, CONFIG)(Frame(0, 0.0, picture(350, shift)))
    assert middle_of(moved) == middle_of(alone)


def bent(dent_px: float) -> Image:
    """A vessel that something has bent over some 150 px, by so much, and a robot that stands still."""
    image = np.full(WHOLE, GREY, np.uint8)
    line = VESSEL + np.column_stack([0.0 * VESSEL[:, 0], dent_px * np.exp(-(((VESSEL[:, 0] - 430) / 40) ** 2))])
    cv2.polylines(image, [np.rint(line).astype(np.int32)], False, GREEN, 44)
    cv2.polylines(image, [np.rint(VESSEL[VESSEL[:, 0] <= 300] + [0, 3]).astype(np.int32)], False, RED, 8)
    return image


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


def test_a_look_that_is_broken_does_not_count(averaging: Pipeline, biased: Biased) -> None:
    whole_looks(averaging, 0.5)
    biased.is_broken = True
    broken = averaging(Frame(6, 0.6, going_on(0.6)))
    assert broken.refusal.reason is Reason.LOW_CONFIDENCE
    biased.is_broken = False
    assert all(scene.pose is not None for scene in whole_looks(averaging, 4.0, start_s=0.7))


def test_who_looks_in_all_orientations_at_once_need_not_do_so_in_turn(biased: Biased) -> None:
    averaging = Pipeline(biased, CONFIG, roi=CalibratedSegmenter(biased, all_orientations=True))
    scenes = whole_looks(averaging, 4.0)
    shown = [image for image in biased.pictures if image.shape == WHOLE]
    assert [np.array_equal(image, going_on(scene.captured_s)) for image, scene in zip(shown, scenes, strict=True)] == [True] * 4


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
