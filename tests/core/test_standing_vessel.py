"""In a stream the vessel is the mean of several looks at a picture that stands still, and of that picture only."""

import numpy as np
import pytest

from core.config import PerceptionConfig, TrackingConfig
from core.perception.glance import cells_of
from core.perception.pipeline import Pipeline, Sight
from core.perception.standing_vessel import ORIENTATIONS, StandingVessel
from core.types import Frame, Image, Reason, Scene
from tests.core.test_glance import CONFIG, Colours, picture

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
    return Pipeline(network, CONFIG, glance=Sight(network))


def looks(pipeline: Pipeline, count: int, start_s: float = 0.0, shift: tuple[int, int] = (0, 0)) -> list[Scene]:
    """Frames so far apart that each is looked at whole, of a robot that goes on."""
    return [pipeline(Frame(k, start_s + 2.0 * k, picture(300 + 20 * k, shift))) for k in range(count)]


def height_of(scene: Scene) -> float:
    """Where the middle of the vessel lies in the column 100, in px."""
    assert scene.masks is not None
    return float(np.mean(np.flatnonzero(scene.masks.vessel[:, 100])))


def test_what_is_wrong_in_one_orientation_and_right_in_another_is_evened_out(pipeline: Pipeline, network: Biased) -> None:
    heights = [height_of(scene) for scene in looks(pipeline, 7)]
    true = heights[0] - BIAS_PX
    assert heights[1] - true == pytest.approx(BIAS_PX, abs=0.6), "mirrored only, it is as wrong"
    assert heights[3] - true == pytest.approx(0.0, abs=0.6)
    assert heights[6] - true == pytest.approx(0.0, abs=0.6), "one of each orientation stays"
    assert len({image.tobytes() for image in network.pictures[:4]}) == 4
    np.testing.assert_array_equal(network.pictures[4], picture(380), err_msg="and round again")


def test_the_robot_is_that_of_the_newest_look_and_lies_where_it_is(pipeline: Pipeline) -> None:
    for index, scene in enumerate(looks(pipeline, 5)):
        assert scene.path is not None
        assert scene.path.head[0] == pytest.approx(304 + 20 * index, abs=2.0)
        assert scene.masks is not None
        alone = Colours()(picture(300 + 20 * index))[1]
        np.testing.assert_allclose(scene.masks.robot_probability, alone, atol=1e-6)


@pytest.mark.parametrize("shift", [(0, 2), (2, 2), (0, 40)])
def test_a_vessel_that_was_moved_is_looked_at_anew(pipeline: Pipeline, network: Biased, shift: tuple[int, int]) -> None:
    before = looks(pipeline, 4)
    moved = looks(pipeline, 1, start_s=20.0, shift=shift)[0]
    np.testing.assert_array_equal(network.pictures[4], picture(300, shift), err_msg="as it is, to begin with")
    alone = looks(Pipeline(network, CONFIG), 1, shift=shift)[0]
    assert height_of(moved) == height_of(alone) != height_of(before[-1])


def test_a_reset_begins_anew(pipeline: Pipeline) -> None:
    first = looks(pipeline, 4)[0]
    pipeline.reset()
    assert height_of(looks(pipeline, 1, start_s=20.0)[0]) == height_of(first)


def test_a_look_that_is_broken_does_not_count(pipeline: Pipeline, network: Biased) -> None:
    looks(pipeline, 1)
    network.is_broken = True
    broken = looks(pipeline, 1, start_s=10.0)[0]
    assert broken.refusal is not None
    assert broken.refusal.reason is Reason.LOW_CONFIDENCE
    network.is_broken = False
    later = looks(pipeline, 4, start_s=20.0)
    assert all(scene.pose is not None for scene in later)


@pytest.mark.parametrize("tracking", [TrackingConfig(window_px=0), TrackingConfig(enabled=False)])
def test_who_looks_at_all_of_every_picture_sees_it_as_it_is(network: Biased, tracking: TrackingConfig) -> None:
    """One orientation after the other would make the head tremble."""
    pipeline = Pipeline(network, PerceptionConfig(tracking=tracking), glance=Sight(network))
    for step in range(5):
        pipeline(Frame(step, 0.05 * step, picture(300)))
    assert all(np.array_equal(image, picture(300)) for image in network.pictures)


def test_single_pictures_are_seen_as_they_are(pipeline: Pipeline, network: Biased) -> None:
    looks(pipeline, 1)
    pipeline.perceive_single(Frame(9, 1.0, picture(300)))
    np.testing.assert_array_equal(network.pictures[-1], picture(300))


def test_every_orientation_is_undone() -> None:
    standing, image = StandingVessel(), np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    seen = []
    for step in range(ORIENTATIONS):
        assert standing.is_upright is (step == 0)
        assert standing.is_gathering is (step > 0)
        turned = standing.turned(image)
        assert turned.shape == image.shape
        found = standing.upright(turned[:, :, 0].astype(np.float32))
        np.testing.assert_array_equal(found, image[:, :, 0])
        assert found.flags.c_contiguous
        seen.append(turned.tobytes())
        standing.add(found)
    assert len(set(seen)) == ORIENTATIONS
    assert standing.is_upright
    assert not standing.is_gathering


def test_the_mean_is_of_the_last_looks() -> None:
    standing = StandingVessel()
    means = [float(standing.add(np.full((2, 2), value, np.float32))[0, 0]) for value in (0.0, 1.0, 0.5, 0.5, 1.0)]
    assert means == [0.0, 0.5, 0.5, 0.5, 0.75]
    standing.forget()
    assert float(standing.add(np.full((2, 2), 0.25, np.float32))[0, 0]) == 0.25


def test_noise_light_and_a_robot_that_goes_on_are_no_other_vessel() -> None:
    rng = np.random.default_rng(0)
    standing = StandingVessel()
    for head_x, light, noise in ((300, 0, 0), (420, 15, 20), (200, -10, 20), (300, 0, 60)):
        image = np.clip(picture(head_x, light=light) + rng.normal(0, noise, (480, 640, 3)), 0, 255).astype(np.uint8)
        standing.meet(cells_of(image))
        standing.add(np.zeros((480, 640), np.float32))
    assert standing.is_upright
    assert not standing.is_gathering, "four looks are kept"
