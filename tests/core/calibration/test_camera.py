"""Lens, board and scale: hand-computed distances, a lens that is known, a board that is printed, seen, and measured."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibration.camera import (
    BoardError,
    BoardSpec,
    BoardView,
    LensError,
    ScaleError,
    board_bitmap,
    distort,
    find_board,
    fit_lens,
    maps,
    mm_per_px_at,
    mm_per_working_px,
    scale_of_board,
    scale_of_clicks,
    scaled_to,
    undistort,
    undistorted,
)
from core.config.calibration import LensConfig, ScaleConfig
from core.types import Scene

SIZE = (640, 480)
HALF = 400.0  # half of the diagonal of 640 x 480


def _lens(k1: float, k2: float = 0.0) -> LensConfig:
    return LensConfig(k1=k1, k2=k2, center_px=(319.5, 239.5), size_px=SIZE, residual_px=0.0, pictures=1)


def _board(matrix: np.ndarray, lens: LensConfig | None = None) -> BoardView:
    """A board of 9 x 6 corners, 18 mm apart, seen through `matrix` (mm -> px) and a lens."""
    x, y = np.meshgrid(np.arange(1, 10) * 18.0, np.arange(1, 7) * 18.0)
    places = np.column_stack([x.ravel(), y.ravel()])
    mapped = np.column_stack([places, np.ones(len(places))]) @ matrix.T
    pixels = mapped[:, :2] / mapped[:, 2:]
    return BoardView(pixels if lens is None else distort(pixels, lens), places)


STRAIGHT = np.array([[3.0, 0.0, 50.0], [0.0, 3.0, 30.0], [0.0, 0.0, 1.0]])
TILTED = np.array([[3.1, 0.1, 20.0], [0.05, 3.2, 15.0], [4e-4, -3e-4, 1.0]])


# ---- the lens


def test_a_point_on_half_the_diagonal_moves_by_k1_and_k2() -> None:
    # at r = 1 the factor is 1 + k1 + k2: 400 px become 400 * 0.92
    seen = distort(np.array([[319.5 + HALF, 239.5]]), _lens(-0.1, 0.02))
    assert seen[0] == pytest.approx([319.5 + 0.92 * HALF, 239.5])
    assert distort(np.array([[319.5, 239.5]]), _lens(-0.1))[0] == pytest.approx([319.5, 239.5])


@pytest.mark.parametrize("lens", [_lens(-0.15), _lens(0.2), _lens(-0.1, 0.03), _lens(0.0)])
def test_straightening_undoes_the_lens(lens: LensConfig) -> None:
    points = np.array([[0.0, 0.0], [639.0, 479.0], [100.0, 400.0], [319.5, 239.5]])
    assert undistort(distort(points, lens), lens) == pytest.approx(points, abs=1e-6)


@pytest.mark.parametrize("k1", [-0.12, 0.0, 0.15])
def test_the_fit_finds_the_lens_whatever_the_angle(k1: float) -> None:
    true = _lens(k1)
    found = fit_lens([_board(STRAIGHT, true), _board(TILTED, true)], SIZE)
    corners = np.array([[0.0, 0.0], [639.0, 0.0], [0.0, 479.0], [639.0, 479.0]])
    assert undistort(distort(corners, true), found) == pytest.approx(corners, abs=0.5)
    assert found.residual_px < 0.02
    assert found.pictures == 2


def test_one_bad_corner_does_not_bend_the_lens() -> None:
    view = _board(STRAIGHT, _lens(-0.1))
    view.pixels[7] += (6.0, -5.0)
    assert fit_lens([view], SIZE).k1 == pytest.approx(-0.1, abs=0.01)


def test_too_few_points_are_refused() -> None:
    view = _board(STRAIGHT)
    with pytest.raises(LensError, match="needs 24 points of the board, 10 were seen"):
        fit_lens([BoardView(view.pixels[:10], view.board_mm[:10])], SIZE)
    with pytest.raises(LensError):
        fit_lens([], SIZE)


def test_a_straightened_picture_is_the_one_without_the_lens() -> None:
    x, y = np.meshgrid(np.arange(640.0), np.arange(480.0))
    waves = lambda x, y: 128 + 60 * np.sin(x / 40.0) + 60 * np.cos(y / 30.0)  # noqa: E731 - a picture as a formula
    lens = _lens(-0.12)
    places = undistort(np.column_stack([x.ravel(), y.ravel()]), lens)
    seen = np.repeat(waves(places[:, 0], places[:, 1]).reshape(480, 640, 1), 3, axis=2).astype(np.uint8)
    plain = np.repeat(waves(x, y)[..., None], 3, axis=2)
    inner = (slice(40, 440), slice(40, 600))
    assert np.abs(undistorted(seen, *maps(lens))[inner].astype(float) - plain[inner]).max() < 3.0
    assert np.abs(seen[inner].astype(float) - plain[inner]).max() > 40.0


def test_a_lens_holds_for_the_same_picture_in_another_size_only() -> None:
    twice = scaled_to(_lens(-0.1), (1280, 960))
    assert twice.center_px == pytest.approx((639.5, 479.5))
    points = np.array([[10.0, 20.0]])
    assert distort(points * 2 + 0.5, twice) == pytest.approx(distort(points, _lens(-0.1)) * 2 + 0.5)
    assert scaled_to(_lens(-0.1), (1280, 720)) is None


# ---- the board


def test_a_board_is_found_where_it_lies() -> None:
    spec = BoardSpec(6, 5, 20.0)
    sheet = np.pad(board_bitmap(spec, 40), 30, constant_values=255)
    view = find_board(np.repeat(sheet[..., None], 3, axis=2), spec)
    assert len(view.pixels) == 5 * 4
    # corner (1, 1) of the board: 40 px behind the margin of 30, pixel centres at integers
    first = view.pixels[np.argmin(view.board_mm.sum(axis=1))]
    assert first == pytest.approx([69.5, 69.5], abs=0.3)
    assert np.diff(np.sort(view.board_mm[:, 0])).max() == pytest.approx(20.0)


def test_a_strip_of_the_board_is_not_enough() -> None:
    spec = BoardSpec(10, 7, 18.0)
    sheet = np.pad(board_bitmap(spec, 40)[: 40 * 3 - 5], 30, constant_values=255)
    with pytest.raises(BoardError):
        find_board(np.repeat(sheet[..., None], 3, axis=2), spec)


# ---- the scale


def test_a_board_seen_straight_down_gives_its_scale() -> None:
    found = scale_of_board([_board(STRAIGHT)], SIZE)
    assert found.mm_per_px == pytest.approx(1.0 / 3.0, rel=1e-6)
    assert found.uncertainty_share < 1e-6
    assert mm_per_px_at(found, (10.0, 10.0), SIZE) == pytest.approx(1.0 / 3.0, rel=1e-5)


def test_a_camera_at_an_angle_has_another_scale_at_every_place() -> None:
    found = scale_of_board([_board(TILTED)], SIZE)
    back = np.linalg.inv(TILTED)

    def truth(x: float, y: float) -> float:
        at = [back @ (x + dx, y + dy, 1.0) for dx, dy in ((0, 0), (0.5, 0), (0, 0.5))]
        here, right, down = (point[:2] / point[2] for point in at)
        return float(np.sqrt(abs(np.linalg.det(np.array([right - here, down - here]) / 0.5))))

    for place in ((20.0, 20.0), (319.5, 239.5), (600.0, 400.0)):
        assert mm_per_px_at(found, place, SIZE) == pytest.approx(truth(*place), rel=1e-4)
    assert truth(20.0, 20.0) != pytest.approx(truth(600.0, 400.0), rel=0.05)


def test_two_clicks_on_a_known_length() -> None:
    found = scale_of_clicks((100.0, 100.0), (400.0, 500.0), 150.0, SIZE)
    assert found.mm_per_px == pytest.approx(0.3)  # 500 px
    assert found.plane is None
    assert 0.001 < found.uncertainty_share < 0.003


@pytest.mark.parametrize(("second", "length_mm"), [((110.0, 100.0), 10.0), ((400.0, 500.0), 0.0), ((400.0, 500.0), float("nan"))])
def test_clicks_that_say_nothing_are_refused(second: tuple[float, float], length_mm: float) -> None:
    with pytest.raises(ScaleError):
        scale_of_clicks((100.0, 100.0), second, length_mm, SIZE)


def test_working_pixels_are_scaled_too() -> None:
    scale = ScaleConfig(mm_per_px=0.2, size_px=(1280, 960), method="two clicks", uncertainty_share=0.0)
    scene = Scene(0, 0.0, (1280, 960), 0.5)  # 640 working px for 1280
    assert mm_per_working_px(scale, scene) == pytest.approx(0.4)
    assert mm_per_px_at(scale, None, (640, 480)) == pytest.approx(0.4)  # the same picture at half the size
    assert mm_per_working_px(None, scene) is None
    width, height = scene.source_size
    assert mm_per_working_px(scale, replace(scene, source_size=(width, height * 3 // 4))) is None, "the camera shows another part"


@pytest.mark.parametrize(("k1", "k2"), [(-0.34, 0.0), (-0.5, 0.1), (0.1, -0.3)])
def test_a_lens_that_would_fold_the_corners_is_refused(k1: float, k2: float) -> None:
    with pytest.raises(ValueError, match="fold the picture's corners"):
        _lens(k1, k2)
    assert _lens(-0.32).k1 == -0.32
