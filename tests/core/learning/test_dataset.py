"""Labelled sets on disk, their truth, and frames that are kept in memory."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.learning import dataset
from core.learning.dataset import (
    DatasetError,
    KeptFrames,
    Sample,
    find_labelled,
    find_samples,
    read_truth,
    without_masks,
    write_mask,
    write_png,
)
from tests.core.learning.toy_set import toy_set


@pytest.fixture(params=[(480, 640), (427, 640)], ids=["whole bytes", "a width that leaves bits over"])
def sample(tmp_path: Path, request: pytest.FixtureRequest) -> Sample:
    height, width = request.param
    rng = np.random.default_rng(3)
    names = [tmp_path / f"{name}.png" for name in ("image", "vessel", "robot")]
    write_png(names[0], rng.integers(0, 256, (height, width, 3), np.uint8))
    for name in names[1:]:
        write_mask(name, rng.random((height, width)) < 0.5)
    return Sample("0", *names)


def test_a_kept_frame_is_the_one_on_disk(sample: Sample) -> None:
    kept = KeptFrames(1)
    first = kept.frame(sample)
    for path in (sample.image, sample.vessel, sample.robot):
        path.unlink()
    for one, again in zip(first, kept.frame(sample), strict=True):
        assert again.dtype == one.dtype
        assert np.array_equal(one, again)


def test_without_room_frames_are_read_again(sample: Sample, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dataset, "_free_memory", lambda: 0.0)
    kept = KeptFrames(1)
    kept.frame(sample)
    write_mask(sample.robot, np.zeros(kept.frame(sample)[1].shape, bool))
    assert not kept.frame(sample)[2].any()


def test_what_is_made_quicker_leaves_its_room_to_the_frames() -> None:
    made: list[int] = []

    def make() -> tuple[np.ndarray, ...]:
        made.append(1)
        return (np.zeros(10, np.uint8),)

    roomy, narrow = KeptFrames(1), KeptFrames(10**9)
    for kept in (roomy, narrow):
        for _ in range(3):
            kept.get("seen", make)
    assert len(made) == 1 + 3


def test_samples_come_back_as_they_were_written(tmp_path: Path) -> None:
    samples = find_samples([toy_set(tmp_path / "set", 2)])
    image, vessel, robot = samples[0].load()
    assert image.shape == (96, 128, 3)
    assert vessel.sum() == 96 * 24
    assert robot.sum() == 60 * 4
    assert image[robot].max() == 10


def test_a_folder_without_labels_says_what_it_needs(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"needs images/NAME\.png"):
        find_samples([tmp_path])


def test_two_pictures_of_one_stem_would_count_twice(tmp_path: Path) -> None:
    folder = toy_set(tmp_path / "set", 2)
    (folder / "images" / "001.jpg").write_bytes((folder / "images" / "001.png").read_bytes())
    with pytest.raises(DatasetError, match=r"001\.jpg and 001\.png have the same masks; remove one of them"):
        find_samples([folder])


def test_a_mask_of_another_size_is_named(tmp_path: Path) -> None:
    folder = toy_set(tmp_path / "set", 1)
    write_mask(folder / "masks" / "000_robot.png", np.zeros((5, 5), bool))
    with pytest.raises(DatasetError, match=r"000_robot.png: 5x5, but its image is 128x96"):
        find_samples([folder])[0].load()


@pytest.mark.parametrize("value", [1, (0, 255, 0)])
def test_a_mask_that_means_something_else_is_named_and_not_taken_for_empty(tmp_path: Path, value: object) -> None:
    folder = toy_set(tmp_path / "set", 1)
    labels = np.zeros((96, 128, 3), np.uint8)
    labels[20:40, 30:60] = value
    cv2.imwrite(str(folder / "masks" / "000_vessel.png"), labels)
    with pytest.raises(DatasetError, match=r"000_vessel\.png: nothing in it is brighter than 127; a mask is grey, 255 inside"):
        find_samples([folder])[0].load()
    cv2.imwrite(str(folder / "masks" / "000_vessel.png"), np.zeros((96, 128), np.uint8))
    assert not find_samples([folder])[0].load()[1].any(), "a picture without a vessel"


def test_images_without_both_masks_are_told(tmp_path: Path) -> None:
    folder = toy_set(tmp_path / "set", 3)
    (folder / "masks" / "001_robot.png").rename(folder / "masks" / "001_robot.jpg")
    assert [path.name for path in without_masks([folder])] == ["001.png"]
    assert len(find_samples([folder])) == 2


def test_truth_skips_a_cut_last_line_and_names_any_other(tmp_path: Path) -> None:
    path = tmp_path / "truth.jsonl"
    path.write_text('{"stem": "a"}\n{"stem": "b", "x"')
    assert list(read_truth(tmp_path)) == ["a"]
    for text, line in (('{"stem": "a"\n{"stem": "b"}\n', 1), ('[]\n{"stem": "a"}\n', 1), ('{"stem": "a"}\n[]\n', 2)):
        path.write_text(text)
        with pytest.raises(DatasetError, match=f"line {line} is damaged"):
            read_truth(tmp_path)


@pytest.mark.parametrize(
    ("entry", "named"),
    [
        ('"theta_deg": -Infinity', "theta_deg: must be a finite number, or null"),
        ('"head_xy": [1, 2, 3]', "head_xy: must be two finite numbers, or null"),
        ('"theta_deg": null, "state": "A"', "state: is said, but theta_deg is not"),
        ('"theta_signed_deg": "x"', "theta_signed_deg"),
        ('"theta_deg": true', "theta_deg"),
        ('"head_xy": [1, Infinity]', "head_xy"),
        ('"state": ["A"]', "state"),
        ('"state": "Z"', "state"),
        ('"seed": [1]', "seed"),
        ('"family": 3', "family"),
        ('"tail_xy": "there"', "tail_xy"),
    ],
)
def test_a_truth_that_makes_no_sense_is_named_by_line_and_key(tmp_path: Path, entry: str, named: str) -> None:
    path = tmp_path / "truth.jsonl"
    path.write_text('{"stem": "a", "seed": 3}\n{"stem": "b", ' + entry + "}\n")
    with pytest.raises(DatasetError, match=rf"truth.jsonl: line 2: {named}.*; mend it") as raised:
        read_truth(tmp_path)
    assert len(str(raised.value).splitlines()) == 1


def test_what_else_a_row_says_and_frames_without_a_pose_are_welcome(tmp_path: Path) -> None:
    rows = [
        {
            "stem": "a",
            "theta_deg": 3,
            "theta_signed_deg": -3.0,
            "head_xy": [1, 2.5],
            "state": "B",
            "seed": "x",
            "family": "backlit",
        },
        {"stem": "b", "theta_deg": None, "theta_signed_deg": None, "head_xy": [1, 2], "state": None, "seed": 4, "crossed": None},
        {"stem": "c", "theta_deg": 3, "state": "A"},
    ]
    (tmp_path / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert list(read_truth(tmp_path).values()) == rows


def test_a_pose_has_what_it_is_to_be_measured_by(tmp_path: Path) -> None:
    folder = toy_set(tmp_path / "set", 2)
    rows = [{"stem": sample.stem, "theta_deg": 3, "state": "A", "head_xy": [1, 2]} for sample in find_samples([folder])]
    rows[1]["head_xy"] = None
    (folder / "truth.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert len(find_labelled(folder)[0]) == 2
    with pytest.raises(DatasetError, match=f"truth of frame {rows[1]['stem']} lacks head_xy; write the set again"):
        find_labelled(folder, ("theta_deg", "head_xy"))


def test_a_truth_in_another_coding_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "truth.jsonl").write_bytes(b"\xff\xfe{}")
    with pytest.raises(DatasetError, match="is not UTF-8 text"):
        read_truth(tmp_path)
    (tmp_path / "truth.jsonl").write_bytes(b'\xef\xbb\xbf{"stem": "a"}\n')
    assert list(read_truth(tmp_path)) == ["a"], "editors of Windows begin with a mark"


def test_frames_are_trained_on_at_working_size(tmp_path: Path) -> None:
    sample = find_samples([toy_set(tmp_path / "set", 1)])[0]
    image, vessel, robot = sample.load(640)
    assert image.shape == (480, 640, 3)
    assert vessel.shape == robot.shape == (480, 640)
    assert vessel.sum() == pytest.approx(96 * 24 * 25, rel=0.03)
