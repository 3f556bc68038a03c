"""Painted benches: every kind is a picture, labels agree with the geometry, and only the robot and its shadow are new."""

from dataclasses import replace

import numpy as np
import pytest

from core.learning import painting
from core.learning.boards import BOARDS, lay_cable, paint_board, photographs, ramp, smooth_noise
from core.learning.painting import PATTERNS, TUBES, PaintedBench, exposed
from tests.core.learning.toy_scene import toy_scene

SIZE = 96, 128
SCENE = toy_scene(size=SIZE)


def _is_picture(picture: np.ndarray) -> bool:
    return picture.shape == (3, *SIZE) and picture.dtype == np.float32 and picture.min() >= 0 and picture.max() <= 1


@pytest.mark.parametrize("kind", BOARDS)
def test_every_board_is_a_picture_of_its_own(kind: str) -> None:
    boards = [paint_board(np.random.default_rng(seed), SIZE, kind) for seed in range(4)]
    assert all(map(_is_picture, boards))
    assert len({board.tobytes() for board in boards}) == 4
    assert np.array_equal(boards[1], paint_board(np.random.default_rng(1), SIZE, kind))


def test_photographs_come_with_scikit_image() -> None:
    assert len(photographs()) > 10


def test_a_cable_lies_over_a_part_of_the_picture() -> None:
    covered = []
    for seed in range(20):
        picture = np.full((3, *SIZE), 0.5, np.float32)
        lay_cable(np.random.default_rng(seed), picture)
        covered.append(float((picture != 0.5).any(axis=0).mean()))
    assert 0 < np.mean(covered) < 0.5
    assert max(covered) < 1


def test_noise_with_an_angle_runs_along_its_grain() -> None:
    noise = smooth_noise(np.random.default_rng(0), (120, 120), 3, across=20, angle_deg=30)
    across = np.array([np.cos(np.deg2rad(30)), np.sin(np.deg2rad(30))])
    slopes = np.gradient(noise)
    steep, flat = (np.abs(slopes[1] * x + slopes[0] * y).mean() for x, y in (across, (-across[1], across[0])))
    assert steep > 3 * flat
    assert ramp((10, 10), 30)[0, 9] == pytest.approx(9 * across[0])


@pytest.mark.parametrize("tube", TUBES)
def test_every_tube_is_painted_and_repeats_with_its_seed(tube: str) -> None:
    for seed in range(3):
        pictures = []
        for _ in range(2):
            rng = np.random.default_rng(seed)
            bench = PaintedBench(rng, SCENE.distance_px, SCENE.ratio, tube)
            with_robot, robot = bench.with_robot(rng, SCENE.lines[0], 3.0)
            pictures += [bench.empty(), with_robot]
            assert np.array_equal(bench.vessel, SCENE.vessel)
            assert robot.any()
        assert all(map(_is_picture, pictures))
        assert np.array_equal(pictures[0], pictures[2])
        assert np.array_equal(pictures[1], pictures[3])
        away = np.ones(SIZE, bool)
        away[20:76, :110] = False  # the robot and its shadow
        assert np.array_equal(pictures[0][:, away], pictures[1][:, away])
        assert not np.array_equal(pictures[0], pictures[1])


def test_the_one_line_of_a_clear_wall_is_drawn_where_its_label_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(painting, "WALL_STYLES", {"band": 1.0})
    monkeypatch.setattr(painting, "_UNEVEN_LIGHT", 0.0)
    reach = []
    for seed in range(8):
        empty = []
        for opacity in (0.0, 0.2):
            monkeypatch.setitem(TUBES, "clear", replace(TUBES["clear"], wall=(opacity, opacity)))
            empty.append(PaintedBench(np.random.default_rng(seed), SCENE.distance_px, SCENE.ratio, "clear").empty())
        outside = (SCENE.distance_px > 0) & (np.abs(empty[1] - empty[0]).max(axis=0) > 0.02)
        reach.append(float(SCENE.distance_px[outside].max(initial=0.0)))
    assert max(reach) > 0
    assert max(reach) < 3.5


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_robots_mask_is_its_lines_surroundings(pattern: str) -> None:
    line = np.column_stack([np.linspace(20, 100, 30), 40 + 10 * np.sin(np.linspace(0, 4, 30))])
    dense = np.column_stack([np.interp(np.linspace(0, 29, 2000), np.arange(30), line[:, axis]) for axis in (0, 1)])
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    away = np.hypot(columns[..., None] - dense[::4, 0], rows[..., None] - dense[::4, 1]).min(axis=2)
    exact = 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        picture, robot = PaintedBench(rng, SCENE.distance_px, SCENE.ratio).with_robot(rng, line, 4.0, pattern)
        assert _is_picture(picture)
        assert not (robot & (away > 4.0 * 1.2 + 0.3)).any()
        assert robot[away < 4.0 * 0.5 * 0.7 - 0.3].all(), "however thin its tip is"
        exact += np.array_equal(robot[np.abs(away - 4.0) > 0.3], (away < 4.0)[np.abs(away - 4.0) > 0.3])
    assert exact >= 2, "most are of the same radius everywhere"


def test_a_robot_outside_of_the_picture_leaves_no_trace() -> None:
    rng = np.random.default_rng(0)
    bench = PaintedBench(rng, SCENE.distance_px, SCENE.ratio)
    picture, robot = bench.with_robot(rng, SCENE.lines[0] + (0, 500), 3.0)
    assert not robot.any()
    assert np.array_equal(picture, bench.empty())


def test_a_robot_that_comes_from_beyond_the_border_is_cut_there() -> None:
    rng = np.random.default_rng(0)
    _, robot = PaintedBench(rng, SCENE.distance_px, SCENE.ratio).with_robot(rng, np.array([[-60.0, 47.5], [40.0, 47.5]]), 3.0)
    assert robot[:, 0].sum() == 6
    assert not robot[:, 50:].any()


def test_exposures_are_pictures_of_the_bench() -> None:
    noticed, strongly = 0, 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        bench = PaintedBench(rng, SCENE.distance_px, SCENE.ratio)
        painted = bench.empty()
        before = painted.copy()
        seen = exposed(rng, painted, bench.vessel, bench.blur_px)
        assert seen.shape == (3, *SIZE)
        assert seen.dtype == np.uint8
        assert np.array_equal(painted, before)
        moved = float(np.median(np.abs(seen - 255 * painted)))
        noticed += moved > 1
        strongly += moved > 60
    assert noticed > 20
    assert strongly < 8, "most look much as they were painted"
