"""How the robot looks: taken from a frame, it has the robot's colours along its body; its file, and a damaged one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from core.bench.bench import Bench, BenchError, bench_from_pictures
from core.bench.robot_texture import RobotTexture, covers_of, entry_of, lines_above, read_textures, texture_of, write_textures
from core.types import Mask
from tests.core.bench.drawn_bench import SIZE, board, noisy, tube, with_line

NOWHERE = np.zeros(SIZE[::-1], bool)
BODY, TIP, WIDTH = (30, 40, 160), (220, 180, 40), 9


def bench() -> Bench:
    return bench_from_pictures([noisy(board(), 1.0, 1)], tube(), "Mine", SIZE[0])


def robot_mask() -> Mask:
    return with_line(np.zeros((*SIZE[::-1], 3), np.uint8), (0, 122), (200, 126), (255, 255, 255), WIDTH)[:, :, 0] > 0


def test_it_shows_the_robot_from_its_head_backwards_in_the_light_of_the_bench() -> None:
    picture = with_line(with_line(board(), (0, 122), (200, 126), BODY, WIDTH), (180, 126), (200, 126), TIP, WIDTH)
    found = texture_of(noisy(picture, 1.0, 2, gain=0.9), robot_mask(), NOWHERE, bench())
    assert found is not None
    assert found.radius_px == pytest.approx(robot_mask()[:, 100].sum() / 2, abs=0.8)
    assert found.tail_px == pytest.approx((0, 122), abs=3)
    middle = found.rgba[:, 18:23].astype(float).mean(axis=1)
    assert np.abs(middle[2:14, :3] - TIP).max() < 25
    assert np.abs(middle[35:180, :3] - BODY).max() < 25
    assert middle[:, 3].min() > 230 and found.rgba[:, [0, -1], 3].max() < 40  # opaque, and nothing beside it


def test_a_covered_place_looks_as_its_neighbours() -> None:
    picture = with_line(board(), (0, 122), (200, 126), BODY, WIDTH)
    picture[:, 90:110] = board()[:, 90:110]
    found = texture_of(noisy(picture, 1.0, 2), robot_mask(), NOWHERE, bench())
    assert found is not None
    assert np.abs(found.rgba[20:180, 18:23, :3].astype(float).mean(axis=1) - BODY).max() < 40


def test_what_covers_the_robot_in_most_frames_is_opaque_there() -> None:
    clear = with_line(board(), (0, 122), (200, 126), BODY, WIDTH)
    covered = clear.copy()
    covered[:, 90:110] = board()[:, 90:110]
    covered[:, 40:160:8] = covered[:, 41:160:8] = board()[:, :1]  # rings as bright as the bench
    found = [texture_of(noisy(covered, 1.0, seed), robot_mask(), NOWHERE, bench()) for seed in (2, 3, 4)]
    passed = [one for one in found if one is not None]
    covers = covers_of(passed, NOWHERE.shape)
    assert len(passed) == 3 and covers[124, 94:106].min() > 0.8
    assert covers[:, :85].max() == covers[:, 115:].max() == covers[:110].max() == 0.0
    seen = texture_of(noisy(clear, 1.0, 5), robot_mask(), NOWHERE, bench())
    assert seen is not None and covers_of([*passed[:1], seen, seen], NOWHERE.shape).max() == 0.0  # something that lay there once
    assert covers_of(passed[:1], NOWHERE.shape).max() == covers_of([], NOWHERE.shape).max() == 0.0


def test_no_line_no_texture() -> None:
    picture = with_line(board(), (0, 122), (200, 126), BODY, WIDTH)
    assert texture_of(picture, NOWHERE, NOWHERE, bench()) is None
    assert texture_of(board(seed=5, y=60), robot_mask(), NOWHERE, bench()) is None  # another bench
    assert texture_of(picture, robot_mask(), ~NOWHERE, bench()) is None  # all of it doubtful


def test_narrow_bright_lines_lie_above_the_robot() -> None:
    picture = np.full((20, 60, 3), 100, np.uint8)
    picture[:, 10:13], picture[:, 30:50] = 180, 180
    above = lines_above(picture)
    assert above[10, 11].tolist() == [68.0] * 3 and above[:, 14:].max() == 0.0


def test_they_are_kept_beside_the_bench(tmp_path: Path) -> None:
    assert read_textures(tmp_path) == [] and entry_of([]) is None
    rng = np.random.default_rng(0)
    lines = [np.full((20 * n, 3), 0.5, np.float32) for n in range(3)]
    wrote = [RobotTexture(rng.integers(0, 255, (50 + n, 41, 4), np.uint8), 3.5 + n, (1.0, 10.0 * n), lines[n]) for n in range(3)]
    write_textures(wrote, tmp_path)
    read = read_textures(tmp_path)
    assert all(
        np.array_equal(one.rgba, other.rgba) and one.radius_px == other.radius_px for one, other in zip(read, wrote, strict=True)
    )
    assert entry_of(read) == (1.0, 10.0) and all(np.array_equal(one.line, line) for one, line in zip(read, lines, strict=True))
    whole = (tmp_path / "robot.npz").read_bytes()
    for damaged in (whole[:-50], b"", b"text", whole[:3000] + b"\0\0\0\0" + whole[3004:]):
        (tmp_path / "robot.npz").write_bytes(damaged)
        with pytest.raises(BenchError, match=r"robot.npz: damaged"):
            read_textures(tmp_path)
    first = {"format": 1, "robots": [(3.5, 1.0, 0.0)], "rgba_0": wrote[0].rgba}
    np.savez(tmp_path / "robot.npz", **first)  # of a version that knew no covers
    assert covers_of(read_textures(tmp_path), (9, 9)).max() == 0.0
    np.savez(tmp_path / "robot.npz", **first, line_0=np.full((5, 3), np.nan))
    with pytest.raises(BenchError, match=r"robot.npz: damaged"):
        read_textures(tmp_path)
    np.savez(tmp_path / "robot.npz", format=2)
    with pytest.raises(BenchError, match="newer version"):
        read_textures(tmp_path)
    write_textures([], tmp_path)
    assert read_textures(tmp_path) == []
