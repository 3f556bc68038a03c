"""Has the camera been moved? A drawn board tells by how much, whatever moves or covers a part of it."""

import math

import cv2
import numpy as np
import pytest

from core.control.frame_reports import Landmarks, kept_view, view_picture
from core.types import Image

SIZE = (640, 480)


def board() -> Image:
    """Marks and edges all over, as on a bench."""
    rng = np.random.default_rng(3)
    image = np.full((*SIZE[::-1], 3), 180, np.uint8)
    for x, y in zip(rng.integers(20, 620, 60).tolist(), rng.integers(20, 460, 60).tolist(), strict=True):
        cv2.rectangle(image, (x, y), (x + 14, y + 10), rng.integers(20, 120, 3).tolist(), -1)
    return image


BOARD = board()


def moved(image: Image, dx: float = 0.0, dy: float = 0.0, turn_deg: float = 0.0) -> Image:
    matrix = cv2.getRotationMatrix2D((SIZE[0] / 2, SIZE[1] / 2), turn_deg, 1.0)
    matrix[:, 2] += dx, dy
    return np.asarray(cv2.warpAffine(image, matrix, SIZE, borderMode=cv2.BORDER_REPLICATE), np.uint8)


def drift(image: Image, scale: float = 1.0, looks: int = 1) -> float | None:
    landmarks = Landmarks()
    assert landmarks.drift_px(BOARD, 0.0, scale) is None
    found = None
    for look in range(1, looks + 1):
        found = landmarks.drift_px(image, float(look), scale)
    return found


@pytest.mark.parametrize(("dx", "dy", "px"), [(0, 0, 0.0), (3, 4, 5.0), (-12, 5, 13.0), (40, 0, 40.0)])
def test_a_shift_comes_out_in_pixels(dx: float, dy: float, px: float) -> None:
    assert drift(moved(BOARD, dx, dy)) == pytest.approx(px, abs=0.5)


def test_a_turn_is_a_move_though_the_middle_stays() -> None:
    turned = drift(moved(BOARD, turn_deg=3.0))
    assert turned > 6.0


def test_a_lamp_a_hand_and_noise_are_no_move() -> None:
    hand = BOARD.copy()
    hand[:, :220] = 150
    noise = np.clip(BOARD + np.random.default_rng(0).normal(0.0, 10.0, BOARD.shape), 0, 255).astype(np.uint8)
    for picture in ((BOARD * 0.6).astype(np.uint8), hand, noise):
        found = drift(picture)
        assert found < 1.0


def test_a_covered_picture_tells_nothing_and_another_scene_counts_when_it_stays() -> None:
    assert drift(np.full_like(BOARD, 90), looks=5) is None
    other = np.ascontiguousarray(BOARD[::-1, ::-1])
    assert drift(other, looks=2) is None
    assert drift(other, looks=3) == math.inf


def test_an_empty_picture_is_no_beginning_and_another_size_a_new_one() -> None:
    landmarks = Landmarks()
    assert landmarks.drift_px(np.full_like(BOARD, 90), 0.0, 1.0) is None
    assert landmarks.drift_px(BOARD, 1.0, 1.0) is None
    assert landmarks.drift_px(moved(BOARD, 10.0), 2.0, 1.0) == pytest.approx(10.0, abs=0.5)
    assert landmarks.drift_px(np.ascontiguousarray(BOARD[::2, ::2]), 3.0, 1.0) is None


@pytest.mark.parametrize(("dx", "dy"), [(0.0, 0.0), (6.0, -8.0), (60.0, 40.0), (-150.0, 90.0)])
def test_a_camera_that_was_moved_while_the_program_was_closed_is_noticed_at_its_first_picture(dx: float, dy: float) -> None:
    kept = view_picture(kept_view(BOARD))
    found = Landmarks(kept).drift_px(moved((BOARD * 0.7).astype(np.uint8), dx, dy), 0.0, 1.0)
    assert found == pytest.approx(math.hypot(dx, dy), abs=0.6)


def test_another_scene_than_the_kept_one_is_compared_with_its_own_first_picture() -> None:
    other = np.ascontiguousarray(BOARD[::-1, ::-1])
    landmarks = Landmarks(view_picture(kept_view(BOARD)))
    assert landmarks.drift_px(other, 0.0, 1.0) is None
    assert landmarks.drift_px(other, 1.0, 1.0) == pytest.approx(0.0, abs=0.3)
    assert landmarks.drift_px(moved(other, 12.0), 2.0, 1.0) == pytest.approx(12.0, abs=0.5)
    assert landmarks.drift_px(BOARD, 3.0, 1.0) == pytest.approx(0.0, abs=0.6), "the phantom is back"


def test_a_kept_picture_of_another_shape_or_damaged_says_nothing() -> None:
    wide = np.ascontiguousarray(np.hstack([BOARD, BOARD[:, :200]]))
    landmarks = Landmarks(view_picture(kept_view(wide)))
    assert landmarks.drift_px(BOARD, 0.0, 1.0) is None
    assert landmarks.drift_px(moved(BOARD, 10.0), 1.0, 1.0) == pytest.approx(10.0, abs=0.5)
    kept = kept_view(BOARD)
    assert len(kept) < 60_000
    for damaged in ("", "no base64!", kept[:40], "AAAA"):
        assert view_picture(damaged) is None


def test_it_looks_now_and_then_only_and_at_no_time_that_is_none() -> None:
    landmarks = Landmarks()
    landmarks.drift_px(BOARD, 0.0, 1.0)
    landmarks.drift_px(BOARD, 1.0, 1.0)
    assert landmarks.drift_px(moved(BOARD, 20.0), 1.1, 1.0) == pytest.approx(0.0, abs=0.3)
    assert landmarks.drift_px(moved(BOARD, 20.0), math.nan, 1.0) == pytest.approx(0.0, abs=0.3)
    assert landmarks.drift_px(moved(BOARD, 20.0), 1.5, 1.0) == pytest.approx(20.0, abs=0.5)
