"""Registration: how far the camera has moved, the bench in other light, and pictures that are refused."""

import cv2
import numpy as np
import pytest

from core.bench.bench import Bench, bench_from_pictures
from core.bench.registration import BenchView, register
from core.types import Image, Reason
from tests.core.bench.drawn_bench import SIZE, board, noisy, tube, with_line


@pytest.fixture(scope="module")
def bench() -> Bench:
    return bench_from_pictures([noisy(board(), 2.0, 1)], tube(), "b", 320)


def moved(picture: Image, shift: tuple[float, float], rotation_deg: float = 0.0) -> tuple[Image, np.ndarray]:
    """The picture, turned about its middle and shifted, and the transform."""
    matrix = cv2.getRotationMatrix2D(((SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2), rotation_deg, 1.0)
    matrix[:, 2] += shift
    return np.asarray(cv2.warpAffine(picture, matrix, SIZE, borderMode=cv2.BORDER_REPLICATE), np.uint8), matrix


def seen(image: Image, bench: Bench, previous: BenchView | None = None) -> BenchView:
    view = register(image, bench, previous)
    assert isinstance(view, BenchView), view
    return view


@pytest.mark.parametrize("shift", [(0.0, 0.0), (1.0, 0.0), (-4.0, 3.0), (6.0, -7.5), (0.0, 10.0)])
@pytest.mark.parametrize("rotation_deg", [0.0, 1.0, -1.9])
def test_a_moved_camera_is_realigned(bench: Bench, shift: tuple[float, float], rotation_deg: float) -> None:
    picture, matrix = moved(with_line(board(), (0, 125), (160, 128)), shift, rotation_deg)
    view = seen(noisy(picture, 2.0, 2), bench)
    middles = np.array([[x * SIZE[0], y * SIZE[1], 1] for x in (0.25, 0.75) for y in (0.25, 0.75)])
    assert np.hypot(*(middles @ (view.matrix - matrix).T).T).max() < 0.7
    assert view.vessel is not None
    expected, _ = moved(tube().astype(np.uint8) * 255, shift, rotation_deg)
    assert np.mean(view.vessel != (expected > 127)) < 0.01


@pytest.mark.parametrize(("shift", "rotation_deg"), [((13.0, 0.0), 0.0), ((0.0, -30.0), 0.0), ((0.0, 0.0), 3.0)])
def test_a_camera_that_was_moved_too_far_is_named(bench: Bench, shift: tuple[float, float], rotation_deg: float) -> None:
    found = register(noisy(moved(board(), shift, rotation_deg)[0], 2.0, 2), bench)
    assert found.reason is Reason.BENCH_MOVED
    assert "at most 10 px" in found.detail


@pytest.mark.parametrize("by", [8, -10, 12])
def test_a_vessel_that_was_moved_on_its_board_is_named(by: int) -> None:
    rng = np.random.default_rng(3)
    ground = cv2.GaussianBlur(rng.normal(0.0, 60.0, (SIZE[1], SIZE[0], 3)), (0, 0), 4.0) * 16.0 + 120.0
    ground = np.clip(ground, 40, 200).astype(np.uint8)

    def tube_at(x: int) -> Image:  # down the picture, of glass: its walls alone
        picture = ground
        for side in (-15, 15):
            picture = with_line(picture, (x + side, 0), (x + side, SIZE[1]), (230, 230, 230), 3)
        return picture

    lumen = cv2.line(np.zeros((SIZE[1], SIZE[0]), np.uint8), (150, 0), (150, SIZE[1]), 1, 30) > 0
    bench = bench_from_pictures([noisy(tube_at(150), 2.0, 1)], lumen, "glass", 320)
    with_robot = with_line(tube_at(150), (150, 0), (154, 150))
    seen(noisy(with_robot, 2.0, 2), bench)
    seen(noisy(moved(with_robot, (6.0, -7.5))[0], 2.0, 2), bench)
    found = register(noisy(with_line(tube_at(150 + by), (150 + by, 0), (154 + by, 150)), 2.0, 2), bench)
    assert found.reason is Reason.BENCH_MOVED
    assert "the vessel alone" in found.detail


def test_another_bench_is_named(bench: Bench) -> None:
    for picture in (noisy(board(8, 40), 2.0, 2), np.full((SIZE[1], SIZE[0], 3), 128, np.uint8), board()[:200]):
        found = register(picture, bench)
        assert found.reason is Reason.OTHER_BENCH


@pytest.mark.parametrize("gain", [(0.8, 0.8, 0.8), (1.2, 1.2, 1.2), (0.9, 1.0, 1.2)])
@pytest.mark.parametrize("gamma", [0.85, 1.2])
def test_other_light_is_followed(bench: Bench, gain: tuple[float, ...], gamma: float) -> None:
    lit = np.clip(255 * (board() / 255) ** gamma * gain, 0, 255).astype(np.uint8)
    view = seen(noisy(with_line(lit, (0, 125), (160, 128)), 2.0, 2), bench)
    assert np.abs(view.empty.astype(int) - lit).mean() < 4.0
    assert view.shift_px == 0.0


def test_a_soft_shadow_is_followed_and_a_robot_is_not(bench: Bench) -> None:
    shade = 1.0 - 0.35 / (1.0 + np.exp(-(np.arange(SIZE[0]) - 160) / 12.0))[None, :, None]
    picture = with_line(board(), (0, 125), (200, 128))
    view = seen(noisy(np.rint(picture * shade).astype(np.uint8), 2.0, 2), bench)
    assert np.abs(view.empty - board() * shade).mean() < 5.0
    assert view.empty[126, 80].mean() > 150  # the tube, where the picture is black


def test_a_hand_in_the_picture_moves_nothing(bench: Bench) -> None:
    picture = cv2.ellipse(board(), (250, 220), (60, 90), 20.0, 0, 360, (210, 160, 140), cv2.FILLED)
    view = seen(noisy(np.asarray(picture, np.uint8), 2.0, 2), bench)
    assert view.shift_px == 0.0


def test_the_place_of_the_picture_before_is_kept(bench: Bench) -> None:
    first = seen(noisy(moved(board(), (5.0, -3.0))[0], 2.0, 2), bench)
    second = seen(noisy(moved(board(), (5.2, -3.0))[0], 2.0, 3, 1.1), bench, first)
    assert second.vessel is first.vessel
    assert second.gain / first.gain == pytest.approx(1.1, abs=0.03)
    third = seen(noisy(moved(board(), (-2.0, 1.0))[0], 2.0, 4), bench, second)
    assert third.shift_px == pytest.approx(5**0.5, abs=0.5)


def test_a_bench_with_few_corners_is_realigned() -> None:
    plain = bench_from_pictures([noisy(board(discs=2), 4.0, 1)], tube(), "b", 320)
    view = seen(noisy(moved(board(discs=2), (0.0, 6.0))[0], 4.0, 2), plain)
    assert view.matrix[1, 2] == pytest.approx(6.0, abs=1.0)


def test_beyond_the_border_of_the_bench_nothing_is_known(bench: Bench) -> None:
    view = seen(noisy(moved(board(), (8.0, 0.0))[0], 2.0, 2), bench)
    assert not view.known[:, :7].any()
    assert view.known[:, 12:].mean() > 0.99
