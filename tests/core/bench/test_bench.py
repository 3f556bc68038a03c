"""Benches: what is combined from pictures and frames, the folder on disk, and what cannot be a bench."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.bench.bench import Bench, BenchError, bench_from_frames, bench_from_pictures, read_bench, write_bench
from core.types import Image, Mask
from tests.core.bench.drawn_bench import SIZE, board, noisy, tube, with_line


def test_noise_is_measured_from_one_picture_and_from_two() -> None:
    for pictures in ([noisy(board(), 6.0, 1)], [noisy(board(), 6.0, 1), noisy(board(), 6.0, 2)]):
        bench = bench_from_pictures(pictures, None, "b", 320)
        assert abs(float(np.median(bench.noise)) / (6.0 * np.sqrt(0.299**2 + 0.587**2 + 0.114**2)) - 1.0) < 0.25
        assert bench.known.mean() > 0.99


def test_a_cable_in_one_of_three_pictures_is_left_out() -> None:
    pictures = [noisy(board(), 2.0, 1), with_line(noisy(board(), 2.0, 2, 0.8), (20, 20), (300, 60)), noisy(board(), 2.0, 3, 1.1)]
    bench = bench_from_pictures(pictures, tube(), "b", 320)
    assert np.abs(bench.empty.astype(int) - board()).max(axis=2)[30:50, 100:200].mean() < 4.0
    assert bench.known.all()
    assert np.array_equal(bench.vessel, tube())


@pytest.mark.parametrize("share", [0.3, 0.65])
def test_a_cloth_over_much_of_one_of_two_pictures_is_not_known(share: float) -> None:
    covered, columns = board().astype(np.float32), int(share * SIZE[0])
    covered[:, :columns] += 45 * np.sign(np.sin(np.arange(columns) / 9.0))[None, :, None]  # folds: no change of light
    picture = np.asarray(np.clip(covered, 0, 255), np.uint8)
    known = bench_from_pictures([noisy(board(), 2.0, 1), noisy(picture, 2.0, 2)], None, "b", 320).known
    assert known[:, :columns].mean() < 0.6 and known[:, columns + 40 :].mean() > 0.95


def test_where_two_pictures_differ_the_bench_is_not_known() -> None:
    bench = bench_from_pictures([noisy(board(), 2.0, 1), with_line(noisy(board(), 2.0, 2), (20, 20), (300, 60))], None, "b", 320)
    assert not bench.known[40, 160]
    assert bench.known[200, 160]


def test_a_blurred_second_picture_does_not_blur_the_bench() -> None:
    sharp = noisy(board(), 1.0, 1)
    bench = bench_from_pictures([cv2.GaussianBlur(board(), (0, 0), 3.0), sharp], None, "b", 320)
    assert np.abs(bench.empty.astype(int) - board()).mean() < 2.0


def test_the_bench_of_frames_is_what_most_of_them_show() -> None:
    frames = [with_line(noisy(board(), 2.0, k, 1.0 + 0.02 * k), (0, 125), (60 + 40 * k, 125)) for k in range(5)]
    robots = []
    for k in range(5):
        robot = np.zeros((SIZE[1], SIZE[0]), np.float32)
        robots.append(cv2.line(robot, (0, 125), (60 + 40 * k, 125), 1.0, 7))
    bench = bench_from_frames(frames, "b", 320, robots=robots)
    assert not bench.known[125, 20]
    assert bench.known[125, 120]
    assert (
        np.abs(
            bench.empty[120:131, 110:300].astype(int)
            - board()[120:131, 110:300] * bench.empty[200, 5].mean() / board()[200, 5].mean()
        ).mean()
        < 6
    )


def test_a_robot_that_lies_still_gives_no_bench() -> None:
    frames = [with_line(noisy(board(), 2.0, k), (0, 125), (160, 125)) for k in range(4)]
    with pytest.raises(BenchError, match="lies still"):
        bench_from_frames(frames, "b", 320)
    with pytest.raises(BenchError, match="too few"):
        bench_from_frames(frames[:2], "b", 320)


def test_pictures_are_scaled_to_the_working_size() -> None:
    bench = bench_from_pictures([board()], tube(), "b", 160)
    assert bench.size == (160, 120)
    assert bench.vessel.shape == (120, 160)


@pytest.mark.parametrize(
    ("pictures", "vessel", "problem"),
    [
        ([], None, "needs a picture"),
        ([board(), board()[:200]], None, "picture 2 has 320x200 px, the first 320x240"),
        ([board(), board(8, 40)], None, "another bench"),
        ([cv2.GaussianBlur(board(), (0, 0), 12.0)], None, "blurred"),
        ([board()], tube()[:, :100], "vessel mask has 100x240 px"),
        ([board()], np.zeros_like(tube()), "vessel mask is empty"),
        ([board()], ~tube(), "white must be the vessel"),
    ],
)
def test_what_cannot_be_a_bench_is_named(pictures: list[Image], vessel: Mask | None, problem: str) -> None:
    with pytest.raises(BenchError, match=problem):
        bench_from_pictures(pictures, vessel, "b", 320)


@pytest.fixture
def bench() -> Bench:
    return bench_from_pictures(
        [noisy(board(), 3.0, 1), with_line(noisy(board(), 3.0, 2), (20, 20), (300, 60))], tube(), "lab 3", 320
    )


def test_a_bench_is_read_as_it_was_written(bench: Bench, tmp_path: Path) -> None:
    folder = tmp_path / "benches" / "one"
    write_bench(bench, folder)
    write_bench(bench, folder)  # in the place of the older one
    again = read_bench(folder)
    assert again.name == "lab 3"
    assert np.array_equal(again.empty, bench.empty)
    assert np.allclose(again.noise, bench.noise, atol=1 / 256)
    assert np.array_equal(again.known, bench.known)
    assert again.vessel is not None
    assert bench.vessel is not None
    assert np.array_equal(again.vessel, bench.vessel)
    assert np.allclose(again.landmarks, bench.landmarks, atol=0.01)
    assert [path.name for path in folder.parent.iterdir()] == ["one"]


def test_the_phantom_of_a_bench_goes_when_the_camera_was_moved(bench: Bench, tmp_path: Path) -> None:
    folder = tmp_path / "one"
    write_bench(bench, folder)
    for name in ("phantom.json", "robot.npz"):
        (folder / name).write_text("made")
    again = bench_from_pictures([noisy(board(), 3.0, 5)], None, "lab 3", 320)
    write_bench(again, folder)
    assert (folder / "phantom.json").is_file()
    moved = np.roll(board(), 12, axis=1)
    write_bench(bench_from_pictures([noisy(moved, 3.0, 6)], None, "lab 3", 320), folder)
    assert not (folder / "phantom.json").is_file() and (folder / "robot.npz").is_file()


def test_a_damaged_bench_is_named(bench: Bench, tmp_path: Path) -> None:
    folder = tmp_path / "one"
    with pytest.raises(BenchError, match="cannot be read"):
        read_bench(folder)
    write_bench(bench, folder)
    data = (folder / "empty.png").read_bytes()
    (folder / "empty.png").write_bytes(data[:-50])
    with pytest.raises(BenchError, match="cut or damaged"):
        read_bench(folder)
    (folder / "empty.png").unlink()
    with pytest.raises(BenchError, match=r"empty\.png"):
        read_bench(folder)
    (folder / "empty.png").write_bytes(data)
    info = json.loads((folder / "bench.json").read_text())
    (folder / "bench.json").write_text(json.dumps(info | {"format": 2}))
    with pytest.raises(BenchError, match="newer version"):
        read_bench(folder)
    (folder / "bench.json").write_text(json.dumps(info | {"width": 10}))
    with pytest.raises(BenchError, match="damaged"):
        read_bench(folder)
    (folder / "bench.json").write_text("{")
    with pytest.raises(BenchError, match="damaged"):
        read_bench(folder)


def test_no_other_folder_is_replaced(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(BenchError, match="no bench"):
        write_bench(bench, tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "mine"
