"""Masks to polygons and back; brush; simplification."""

import cv2
import numpy as np
import pytest

from core.annotation.masks import area_of, area_polygon, fill, paint, polygons_of, simplify
from core.annotation.model import MaskPolygon, MaskTarget
from core.types import Mask

SIZE = (64, 48)


def ring() -> Mask:
    """A disc with a hole, and a bar apart from it."""
    y, x = np.mgrid[:48, :64]
    away = np.hypot(x - 20, y - 24)
    return np.asarray(((away <= 15) & (away > 6)) | ((x > 45) & (x < 60) & (y > 10) & (y < 20)))


def test_exact_outlines_give_the_mask_back() -> None:
    polygons = polygons_of(ring(), MaskTarget.VESSEL, 0.0)
    assert sorted(polygon.is_hole for polygon in polygons) == [False, False, True]
    assert np.array_equal(fill(polygons, MaskTarget.VESSEL, SIZE), ring())
    assert not fill(polygons, MaskTarget.ROBOT, SIZE).any()


def test_fewer_points_change_little() -> None:
    exact, few = (polygons_of(ring(), MaskTarget.VESSEL, tolerance) for tolerance in (0.0, 0.7))
    assert sum(len(p.points) for p in few) < 0.6 * sum(len(p.points) for p in exact)
    assert np.mean(fill(few, MaskTarget.VESSEL, SIZE) != ring()) < 0.01
    fewer = simplify(few, MaskTarget.VESSEL, 2.0)
    assert sum(len(p.points) for p in fewer) < sum(len(p.points) for p in few)
    assert simplify(few, MaskTarget.ROBOT, 2.0) == few


def test_nothing_and_specks_make_no_polygon() -> None:
    speck = np.zeros((48, 64), bool)
    assert polygons_of(speck, MaskTarget.ROBOT) == ()
    speck[5, 5] = True
    assert polygons_of(speck, MaskTarget.ROBOT) == ()


@pytest.mark.parametrize("place", [(20.0, 24.0), (0.0, 0.0), (63.0, 47.0), (-20.0, 10.0)])
def test_the_brush_adds_and_takes_away_a_disc(place: tuple[float, float]) -> None:
    other = MaskPolygon(MaskTarget.ROBOT, ((1.0, 1.0), (5.0, 1.0), (1.0, 5.0)))
    y, x = np.mgrid[:48, :64]
    disc = np.hypot(x - place[0], y - place[1]) <= 5
    for erase, before in ((False, np.zeros((48, 64), bool)), (True, np.ones((48, 64), bool))):
        polygons = (*polygons_of(before, MaskTarget.VESSEL), other)
        after = paint(polygons, MaskTarget.VESSEL, np.array([place]), 5.0, SIZE, erase=erase)
        assert other in after
        found = fill(after, MaskTarget.VESSEL, SIZE)
        assert np.sum(found != (before & ~disc if erase else before | disc)) <= 16


def test_the_brush_changes_nothing_that_it_does_not_come_near() -> None:
    polygons = (*polygons_of(ring(), MaskTarget.VESSEL), MaskPolygon(MaskTarget.VESSEL, ((1.0, 44.0), (3.0, 46.0), (2.0, 45.0))))
    bar = next(p for p in polygons if min(x for x, _ in p.points) > 40)
    after = paint(polygons, MaskTarget.VESSEL, np.array([(52.0, 15.0)]), 2.0, SIZE, erase=True)
    others = tuple(polygon for polygon in polygons if polygon is not bar)
    assert after[: len(others)] == others
    assert len(after) > len(others)


def test_painting_again_and_again_wears_nothing_away() -> None:
    """A tube of one pixel's width is training truth, too."""
    line = np.zeros((48, 64), bool)
    line[24, 4:60] = True
    line[30:33, 4:60] = True
    polygons = polygons_of(line, MaskTarget.VESSEL, 0.0)
    for k in range(20):
        polygons = paint(polygons, MaskTarget.VESSEL, np.array([(10.0 + 2 * k, 27.0)]), 1.0, SIZE, erase=k % 2 == 1)
    found = fill(polygons, MaskTarget.VESSEL, SIZE)
    assert (found & line).sum() == line.sum()


def shoelace(points: np.ndarray) -> float:
    """The area of a polygon (N, 2)."""
    (x0, y0), (x1, y1) = points.T, np.roll(points, -1, axis=0).T
    return abs(float(np.sum(x0 * y1 - x1 * y0))) / 2.0


def test_a_polygon_is_the_area_of_the_pixels_whose_centres_it_encloses() -> None:
    bar = np.zeros((48, 64), bool)
    bar[10:14, 20:50] = True
    corners = np.array([(20.0, 10.0), (50.0, 10.0), (50.0, 14.0), (20.0, 14.0)])
    assert np.array_equal(area_of(corners, SIZE), bar)
    assert np.array_equal(area_of(corners + 0.4, SIZE), bar), "no centre is passed"
    assert np.array_equal(area_of(corners + [-1000.0, 0.0], SIZE), np.zeros_like(bar))
    assert np.array_equal(area_of(np.array([(-9.0, -9.0), (99.0, -9.0), (99.0, 99.0), (-9.0, 99.0)]), SIZE), np.ones_like(bar))
    triangle = area_of(np.array([(0.0, 0.0), (4.0, 0.0), (0.0, 4.0)]), (5, 5))
    assert triangle[:4].astype(int).tolist() == [[1, 1, 1, 0, 0], [1, 1, 0, 0, 0], [1, 0, 0, 0, 0], [0, 0, 0, 0, 0]]


def test_masks_of_any_shape_come_back_as_they_were() -> None:
    rng = np.random.default_rng(4)
    told = 0
    for _ in range(60):
        drawn = np.zeros((48, 64), np.uint8)
        points = np.cumsum(rng.integers(-9, 10, (6, 2)), axis=0) + (32, 24)
        cv2.polylines(drawn, [points.astype(np.int32)], False, 1, int(rng.integers(1, 7)))
        if (polygon := area_polygon(drawn > 0)) is not None:
            told += 1
            assert np.array_equal(area_of(polygon, SIZE), drawn > 0)
            assert shoelace(polygon) == pytest.approx(drawn.sum(), rel=0.12)
    assert told > 20
    holed = np.ones((9, 9), bool)
    holed[4, 4] = False
    assert area_polygon(holed) is None
    assert area_polygon(np.zeros((9, 9), bool)) is None
