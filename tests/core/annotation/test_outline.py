"""Tubes that snap to walls, regions around clicks, and the vessel's outline with undo."""

import cv2
import numpy as np
import pytest

from core.annotation.masks import fill, polygons_of
from core.annotation.model import Annotation, MaskTarget
from core.annotation.outline import VesselOutline, with_region, with_tube
from core.annotation.tube import drawn_tube, snapped_tube
from core.types import Image, Mask, Points

SIZE = (400, 140)
X = np.arange(20.0, 381.0, 4.0)
MIDDLE = np.column_stack([X, 70.0 + 15.0 * np.sin(X / 40.0)])
"""Of a vessel with a radius of 10 px."""


def vessel(points: Points = MIDDLE, radius: float = 10.0) -> Mask:
    return drawn_tube(points, np.full(len(points), radius)).area(SIZE)


def picture(mask: Mask, inside: int = 170, noise: float = 6.0) -> Image:
    rng = np.random.default_rng(1)
    grey = np.where(mask, inside, 90).astype(np.float64) + rng.normal(0, noise, mask.shape)
    return np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def dice(a: Mask, b: Mask) -> float:
    return 2.0 * float((a & b).sum()) / float(a.sum() + b.sum())


def test_tube_is_the_union_of_its_discs() -> None:
    mask = drawn_tube(np.array([[50.0, 50.0], [90.0, 50.0]]), np.array([10.0, 20.0])).area(SIZE)
    assert mask[50, 40] and mask[50, 109] and not mask[50, 38] and not mask[50, 112]
    assert mask[66, 90] and not mask[66, 55]


def test_a_click_without_a_drag_is_a_disc() -> None:
    tube = snapped_tube(picture(vessel()), np.array([[60.0, 70.0], [60.0, 70.0]]), np.array([7.0, 7.0]))
    assert tube.middle.tolist() == [[60.0, 70.0]] and tube.radius.tolist() == [7.0]


@pytest.mark.parametrize(("shift", "radius"), [((0.0, 3.0), 10.0), ((0.0, 0.0), 8.0), ((0.0, -2.0), 12.5)])
def test_walls_are_found_beside_an_inexact_drag(shift: tuple[float, float], radius: float) -> None:
    true = vessel()
    stroke, radii = MIDDLE + shift, np.full(len(MIDDLE), radius)
    found = snapped_tube(picture(true), stroke, radii).area(SIZE)
    assert dice(found, true) > 0.95
    assert dice(found, true) > dice(drawn_tube(stroke, radii).area(SIZE), true) + 0.03


def test_a_faint_wall_is_carried_by_the_other_one() -> None:
    true = vessel()
    image = picture(true)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    below = y > np.interp(x, MIDDLE[:, 0], MIDDLE[:, 1])
    image[below & (x > 70) & (x < 130)] = 170  # no lower wall over a third of the way
    found = snapped_tube(image, MIDDLE + (0.0, 1.5), np.full(len(MIDDLE), 10.5)).area(SIZE)
    assert dice(found, true) > 0.94


def test_a_drag_to_the_border_leads_out_of_the_picture() -> None:
    points = np.column_stack([np.arange(0.0, 400.0, 4.0), np.full(100, 60.0)])
    true = vessel(points)
    found = snapped_tube(picture(true), points[1:-1], np.full(98, 10.0)).area(SIZE)
    assert found[52:69, [0, -1]].all()


def test_a_large_picture_gives_the_same_tube() -> None:
    true, factor = vessel(), 5
    large = cv2.resize(picture(true), None, fx=factor, fy=factor, interpolation=cv2.INTER_NEAREST)
    stroke = (MIDDLE + (0.0, 2.0) + 0.5) * factor - 0.5
    found = snapped_tube(large, stroke, np.full(len(MIDDLE), 10.0 * factor)).area((SIZE[0] * factor, SIZE[1] * factor))
    assert dice(found[2::factor, 2::factor], true) > 0.95


def test_walls_are_not_sought_within_what_is_vessel_already() -> None:
    trunk = vessel()
    branch = np.column_stack([np.full(14, 100.0), np.linspace(78.0, 128.0, 14)])
    both = trunk | vessel(branch, 6.0)
    found = snapped_tube(picture(both), branch, np.full(14, 6.0), trunk)
    assert np.abs(found.radius - 6.0).max() < 2.0
    assert dice(found.area(SIZE) | trunk, both) > 0.97


def test_erasing_takes_what_was_drawn_and_keeps_other_masks() -> None:
    robot = polygons_of(vessel(MIDDLE[:10], 3.0), MaskTarget.ROBOT)
    polygons = (*robot, *polygons_of(vessel(), MaskTarget.VESSEL))
    image = picture(vessel())
    left = with_tube(polygons, MaskTarget.VESSEL, image, MIDDLE[20:], 14.0, erase=True)
    mask = fill(left, MaskTarget.VESSEL, SIZE)
    assert not mask[:, 130:].any() and mask[:, :80].sum() > 0.9 * vessel()[:, :80].sum()
    assert tuple(polygon for polygon in left if polygon.target is MaskTarget.ROBOT) == robot


def test_a_click_adds_the_region_up_to_its_edges() -> None:
    true = vessel()
    start = true.copy()
    start[:, 120:160] = False
    polygons = polygons_of(start, MaskTarget.VESSEL)
    point = float(np.interp(140.0, MIDDLE[:, 0], MIDDLE[:, 1]))
    added = fill(with_region(polygons, MaskTarget.VESSEL, picture(true), (140.0, point), 9.0), MaskTarget.VESSEL, SIZE)
    assert dice(added, true) > 0.95


def test_a_click_takes_a_region_away() -> None:
    true = vessel()
    start = true.copy()
    start[8:30, 60:84] = True  # beside the vessel, on the ground
    polygons = polygons_of(start, MaskTarget.VESSEL)
    left = fill(with_region(polygons, MaskTarget.VESSEL, picture(true), (72.0, 18.0), 10.0, erase=True), MaskTarget.VESSEL, SIZE)
    assert dice(left, true) > 0.97


@pytest.mark.parametrize("point", [(0.0, 0.0), (-9.0, 70.0), (399.4, 139.4)])
def test_a_click_at_the_border_of_the_picture(point: tuple[float, float]) -> None:
    image = picture(vessel())
    assert fill(with_region((), MaskTarget.VESSEL, image, point, 8.0), MaskTarget.VESSEL, SIZE).any()
    assert with_region((), MaskTarget.VESSEL, image, point, 8.0, erase=True) == ()


def test_gestures_are_undone_and_done_again() -> None:
    true = vessel()
    outline = VesselOutline(picture(true))
    assert not outline.mask.any() and outline.undo_action == ""
    tube = with_tube((), MaskTarget.VESSEL, picture(true), MIDDLE, 10.0)
    outline.edit("tube", Annotation(masks=tube))
    assert dice(outline.mask, true) > 0.95
    outline.edit("add region", Annotation(masks=with_region(tube, MaskTarget.VESSEL, picture(true), (100.0, 20.0), 6.0)))
    outline.undo()
    assert dice(outline.mask, true) > 0.95 and outline.undo_action == "tube"
    outline.redo()
    assert outline.undo_action == "add region" and not outline.can_redo


def test_an_outline_begins_with_the_proposal() -> None:
    outline = VesselOutline(picture(vessel()), vessel())
    assert dice(outline.mask, vessel()) > 0.99 and outline.undo_action == "proposal"
    outline.undo()
    assert not outline.mask.any()
