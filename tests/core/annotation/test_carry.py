"""Masks carried from one picture of a bench to the next."""

import numpy as np

from core.annotation.carry import carried_masks
from core.annotation.masks import fill, polygons_of
from core.annotation.model import MaskTarget
from core.types import Image, Mask

SIZE = (200, 120)
VESSEL = np.zeros((SIZE[1], SIZE[0]), bool)
VESSEL[40:80] = True


def robot(tip: int, row: int = 60) -> Mask:
    mask = np.zeros_like(VESSEL)
    mask[row - 5 : row + 6, :tip] = True
    return mask


def picture(mask: Mask, light: float = 1.0, seed: int = 0) -> Image:
    rng = np.random.default_rng(seed)
    image = np.full((*mask.shape, 3), (150.0, 160.0, 150.0))
    image[VESSEL] = (190.0, 190.0, 200.0)
    image[mask] = (40.0, 40.0, 60.0)
    return np.clip(image * light + rng.normal(0.0, 2.0, image.shape), 0, 255).astype(np.uint8)


def dice(a: Mask, b: Mask) -> float:
    return 2.0 * float((a & b).sum()) / float(a.sum() + b.sum())


def test_the_robot_has_moved_on_and_back() -> None:
    vessel = polygons_of(VESSEL, MaskTarget.VESSEL)
    for before, after in ((80, 140), (140, 80)):
        masks = (*vessel, *polygons_of(robot(before), MaskTarget.ROBOT))
        found = carried_masks(picture(robot(before)), masks, picture(robot(after), seed=1))
        assert tuple(polygon for polygon in found if polygon.target is MaskTarget.VESSEL) == vessel
        assert dice(fill(found, MaskTarget.ROBOT, SIZE), robot(after)) > 0.93


def test_more_light_is_no_change() -> None:
    masks = polygons_of(robot(90), MaskTarget.ROBOT)
    found = carried_masks(picture(robot(90)), masks, picture(robot(110), light=1.1, seed=1))
    assert dice(fill(found, MaskTarget.ROBOT, SIZE), robot(110)) > 0.9


def test_what_changes_outside_the_vessel_is_no_robot() -> None:
    image = picture(robot(120), seed=1)
    image[5:20, 20:180] = (40, 40, 60)
    masks = (*polygons_of(VESSEL, MaskTarget.VESSEL), *polygons_of(robot(80), MaskTarget.ROBOT))
    found = fill(carried_masks(picture(robot(80)), masks, image), MaskTarget.ROBOT, SIZE)
    assert not found[:30].any() and dice(found, robot(120)) > 0.9


def test_without_a_robot_or_in_a_picture_of_another_size_the_vessel_alone_is_carried() -> None:
    vessel = polygons_of(VESSEL, MaskTarget.VESSEL)
    masks = (*vessel, *polygons_of(robot(80), MaskTarget.ROBOT))
    assert carried_masks(picture(robot(80)), vessel, picture(robot(90))) == vessel
    assert carried_masks(picture(robot(80))[:100], masks, picture(robot(90))) == vessel
