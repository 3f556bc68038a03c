"""Windows in a stream: when one is enough, what it renews, and what stays."""

import functools
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from core.config.models import PerceptionConfig, TrackingConfig
from core.evaluation.confidence import KnownPicture, fit_out_of_distribution
from core.perception.pipeline import CalibratedSegmenter, Pipeline
from core.perception.roi import RoiSelector, cells_of, has_changed, segment_roi
from core.perception.segmentation import Segmentation, Segmenter, window_around
from core.types import Frame, Image, Reason
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
        return tuple(cv2.GaussianBlur(mask.astype(np.float32), (3, 3), 0) for mask in (vessel, robot))  # type: ignore[return-value]


@pytest.fixture
def network() -> Colours:
    return Colours()


@pytest.fixture
def pipeline(network: Colours) -> Pipeline:
    return Pipeline(network, CONFIG, roi=CalibratedSegmenter(network))


def see(pipeline: Pipeline, time_s: float, image: Image):  # type: ignore[no-untyped-def]
    return pipeline(Frame(round(time_s * 20), time_s, image))


def test_the_first_look_is_whole_and_the_next_ones_are_windows(pipeline: Pipeline, network: Colours) -> None:
    scenes = [see(pipeline, 0.05 * index, picture(300 + 4 * index)) for index in range(5)]
    assert network.shown == [WHOLE, *[WINDOW] * 4]
    assert [scene.window is None for scene in scenes] == [True, False, False, False, False]
    for index, scene in enumerate(scenes):
        assert scene.path is not None
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
        assert scene.window is not None
        assert scene.masks is not None
        x, y, width, height = scene.window
        np.testing.assert_array_equal(vessel, scene.masks.vessel_probability[y : y + height, x : x + width])


def test_a_window_tells_the_same_pose_as_the_whole_picture(pipeline: Pipeline) -> None:
    whole = Pipeline(Colours(), CONFIG)
    for index in range(6):
        image = picture(300 + 3 * index)
        part, all_of_it = see(pipeline, 0.05 * index, image), see(whole, 0.05 * index, image)
        assert part.pose is not None
        assert all_of_it.pose is not None
        assert part.pose.theta_deg == pytest.approx(all_of_it.pose.theta_deg, abs=1e-6)
        assert part.path is not None
        assert all_of_it.path is not None
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
    assert scene.path is not None
    assert scene.path.head[0] == pytest.approx(404, abs=2.0)


def test_a_phantom_that_moves_is_looked_at_whole(pipeline: Pipeline, network: Colours) -> None:
    see(pipeline, 0.0, picture(300))
    scene = see(pipeline, 0.05, picture(300, shift=(0, 6)))
    assert network.shown == [WHOLE, WHOLE]
    assert scene.vessel_graph is not None
    assert see(pipeline, 0.1, picture(300, shift=(0, 6))).window is not None


def test_another_brightness_of_all_of_it_is_no_change(pipeline: Pipeline, network: Colours) -> None:
    see(pipeline, 0.0, picture(300))
    see(pipeline, 0.05, picture(300, light=15))
    assert network.shown == [WHOLE, WINDOW]


def test_noise_is_no_change() -> None:
    rng = np.random.default_rng(0)
    image = picture(300)
    noisy = np.clip(image + rng.normal(0, 20, image.shape), 0, 255).astype(np.uint8)
    assert not has_changed(cells_of(image), cells_of(noisy), (200, 100, 256, 256))


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
    glances.forget()
    assert glances.noise == 0.0


def test_after_a_frame_without_an_answer_comes_a_whole_look(pipeline: Pipeline, network: Colours) -> None:
    see(pipeline, 0.0, picture(300))
    black = see(pipeline, 0.05, np.zeros(WHOLE, np.uint8))
    assert black.refusal is not None
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

    def ones(image: Image) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(image.shape[:2], np.float32), np.ones(image.shape[:2], np.float32)

    known = SimpleNamespace(vessel_probability=np.zeros_like(old), robot_probability=old)
    renewed = segment_roi(ones, np.zeros(WHOLE, np.uint8), (0, 100, 256, 256), known)  # type: ignore[arg-type]
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
