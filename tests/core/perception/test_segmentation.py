from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from core.config.models import CleaningConfig, PerceptionConfig, SegmentationConfig
from core.perception.segmentation import (
    SIZES,
    USUAL_RADIUS_PX,
    LumenSizeAverage,
    Probability,
    Segmentation,
    Segmenter,
    clean,
    clean_mask,
    size_to_see,
)
from core.types import Image
from tests.core.drawing import art, picture

CLUTTERED = art("""
##............
##..########..
....########..
....##.##.##..
....########..
.#..########..
""")


def test_specks_go_and_pinholes_are_filled() -> None:
    assert picture(clean_mask(CLUTTERED, min_area_px=5, max_hole_area_px=1)) == (
        "..............\n....########..\n....########..\n....########..\n....########..\n....########.."
    )


RING = art("""
.........
.#######.
.#.....#.
.#.###.#.
.#.....#.
.#######.
.........
""")


def test_a_loop_that_encloses_more_than_a_hole_stays_open() -> None:
    assert not clean_mask(RING, 0, 11)[2, 3]  # the hole has 15 pixels, or 12 without the island in it
    assert clean_mask(RING, 0, 15)[1:6, 1:8].all()


def test_holes_do_not_count_as_area() -> None:
    assert clean_mask(RING, 20, 0)[1, 1]  # the ring has 20 pixels
    assert not clean_mask(RING, 21, 0)[1, 1]


@pytest.mark.parametrize("thickness", [1, 2, 3])
def test_what_lies_inside_a_ring_stays_when_the_ring_goes(thickness: int) -> None:
    mask, disc = np.zeros((140, 140), np.uint8), np.zeros((140, 140), np.uint8)
    cv2.circle(disc, (70, 70), 18, 1, cv2.FILLED)
    cv2.circle(mask, (70, 70), 31, 1, thickness)
    cv2.circle(mask, (70, 70), 23, 1, thickness)
    cleaned = clean_mask((mask | disc) > 0, min_area_px=1000, max_hole_area_px=20)
    assert (cleaned == (disc > 0)).all()


def test_background_at_the_image_border_is_no_hole() -> None:
    bay = art("""
##.##
##.##
#####
""")
    assert picture(clean_mask(bay, 0, 100)) == picture(bay)


def test_diagonal_pixels_belong_together() -> None:
    stairs = art("""
#....
.#...
..#..
...#.
....#
""")
    assert clean_mask(stairs, 5, 0).sum() == 5
    assert clean_mask(stairs, 6, 0).sum() == 0


def test_each_mask_has_its_own_threshold_and_limit() -> None:
    probability = np.zeros((60, 80), np.float32)
    probability[10:40, 10:40] = 0.6
    config = PerceptionConfig(
        segmentation=SegmentationConfig(vessel_threshold=0.5, robot_threshold=0.7),
        cleaning=CleaningConfig(min_vessel_area_px=900, min_robot_area_px=900),
    )
    masks = clean(probability, probability, config)
    assert masks.vessel.sum() == 900
    assert masks.robot.sum() == 0
    assert masks.vessel_probability is probability


def noise(pitch_px: int) -> np.ndarray:
    """Squares of 2 px, this far apart, all over an image."""
    mask = np.zeros((480, 640), bool)
    for row in (0, 1):
        for column in (0, 1):
            mask[row::pitch_px, column::pitch_px] = True
    return mask


@pytest.mark.parametrize("pitch_px", [4, 5, 9, 16])
def test_of_a_mask_scattered_all_over_the_image_nothing_is_left(pitch_px: int) -> None:
    assert not clean_mask(noise(pitch_px), min_area_px=0, max_hole_area_px=0).any()


SIGNATURE = np.ones(4, np.float32)


class Bright(Segmenter):
    """What is bright is vessel. At the picture's own size half of it is seen, and the robot nowhere; else all of it everywhere."""

    def __init__(self) -> None:
        self.sizes: list[tuple[int, int]] = []

    def __call__(self, image: Image) -> tuple[Probability, Probability]:
        self.sizes.append((image.shape[1], image.shape[0]))
        vessel = (image[:, :, 0] > 127).astype(np.float32)
        return vessel, np.full(vessel.shape, 0.0 if len(self.sizes) == 1 else 1.0, np.float32)

    def segment_signed(self, images: Sequence[Image]) -> list[Segmentation]:
        return [(*self(image), SIGNATURE) for image in images]


def tube(radius: int) -> Image:
    image = np.zeros((240, 320, 3), np.uint8)
    image[120 - radius : 120 + radius] = 255
    return image


@pytest.mark.parametrize(
    ("radius", "size", "robot"),
    [(25, (160, 120), 0.0), (16, (256, 192), 0.0), (12, None, 0.0), (10, (400, 300), 0.5), (8, (480, 360), 0.5)],
)
def test_a_lumen_of_unusual_width_is_seen_again_at_the_usual_one(radius: int, size: tuple[int, int] | None, robot: float) -> None:
    network = Bright()
    vessel, found = LumenSizeAverage(network)(tube(radius))
    assert network.sizes[1:] == ([size] if size else [])
    assert (found == np.float32(robot)).all()  # a smaller picture says nothing of the robot
    assert vessel.shape == (240, 320) and vessel[120].min() > 0.99 and vessel[: 120 - radius - 3].max() < 0.01


def test_the_signature_is_that_of_the_picture_as_it_is() -> None:
    network = Bright()
    ((vessel, _, signature),) = LumenSizeAverage(network).segment_signed([tube(25)])
    assert signature is SIGNATURE and len(network.sizes) == 2 and vessel.shape == (240, 320)


@pytest.mark.parametrize("vessel", [np.zeros((60, 80)), np.eye(60, 80)], ids=["nothing", "specks"])
def test_without_a_vessel_the_picture_is_seen_once(vessel: np.ndarray) -> None:
    assert size_to_see(vessel.astype(np.float32)) == 1.0


def test_a_picture_that_is_vessel_all_over_is_seen_at_the_smallest_size() -> None:
    assert size_to_see(np.ones((120, 160), np.float32)) == min(SIZES)
    assert min(SIZES) * 25 == USUAL_RADIUS_PX
