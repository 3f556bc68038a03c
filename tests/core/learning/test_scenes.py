"""Scenes on disk, and the training crops painted from them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from torch.utils.data import DataLoader

from core.learning.augmentation import FrameCrops
from core.learning.dataset import DatasetError, find_samples, write_mask
from core.learning.scene_crops import CROPS_PER_BENCH, MixedCrops, SceneCrops
from core.learning.scenes import find_scenes, read_scene
from core.learning.training_plan import TrainingPlan
from tests.core.learning.toy_scene import toy_scene
from tests.core.learning.toy_set import toy_set

PLAN = TrainingPlan(steps=10, batch=6, crop=(64, 80), end_weight=2.0, workers=0)


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    (tmp_path / "set" / "scenes").mkdir(parents=True)
    for number in range(3):
        (tmp_path / "set" / "scenes" / f"{number:06d}.npz").write_bytes(toy_scene(pictures=number == 1).to_bytes())
    return tmp_path / "set"


def test_a_scene_is_read_as_it_was_written(scenes: Path) -> None:
    files = find_scenes([scenes])
    assert [path.stem for path in files] == ["000000", "000001", "000002"]
    for path, pictures in zip(files, (False, True, False), strict=True):
        written, scene = toy_scene(pictures=pictures), read_scene(path)
        assert np.abs(scene.distance_px - np.clip(written.distance_px, -31.75, 31.75)).max() <= 0.126
        assert np.abs(scene.ratio - np.clip(written.ratio, 0, 2.55)).max() <= 0.0051
        assert np.array_equal(scene.vessel, written.vessel)
        assert all(np.abs(a - b).max() < 1e-4 for a, b in zip(scene.lines, written.lines, strict=True))
        assert scene.radius_px == 3.0
        assert len(scene.pictures) == (2 if pictures else 0)
        for (image, robot), (true_image, true_robot) in zip(scene.pictures, written.pictures, strict=True):
            assert np.array_equal(image, true_image)
            assert np.array_equal(robot, true_robot)
        assert (scene.empty is None) == (not pictures)
        without = read_scene(path, pictures=False)
        assert (without.pictures, without.empty) == ((), None)


@pytest.mark.parametrize("damage", ["cut", "empty", "text", "missing", "other"])
def test_a_damaged_scene_is_one_line(scenes: Path, damage: str) -> None:
    path = find_scenes([scenes])[0]
    data = path.read_bytes()
    match damage:
        case "cut":
            path.write_bytes(data[: len(data) // 2])
        case "empty":
            path.write_bytes(b"")
        case "text":
            path.write_text("no scene")
        case "missing":
            path.unlink()
        case "other":
            np.savez(path, distance=np.zeros(3))
    with pytest.raises(DatasetError, match="damaged, or not a scene") as raised:
        read_scene(path)
    assert str(path) in str(raised.value)
    assert len(str(raised.value).splitlines()) == 1


def test_a_flipped_byte_is_noticed(scenes: Path) -> None:
    path = find_scenes([scenes])[1]
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)
    with pytest.raises(DatasetError):
        read_scene(path)


def test_a_folder_without_scenes_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"no scenes; needs scenes/NUMBER\.npz"):
        find_scenes([tmp_path])


def test_crops_are_pictures_with_labels_that_fit(scenes: Path) -> None:
    crops = SceneCrops(find_scenes([scenes]), PLAN)
    assert len(crops) == 60
    robots, ends = 0, 0
    for index in range(60):
        image, labels = (part.numpy() for part in crops[index])
        assert image.shape == (3, 64, 80)
        assert labels.shape == (3, 64, 80)
        assert image.dtype == labels.dtype == np.uint8
        assert set(np.unique(labels[:2])) <= {0, 1}
        robots += bool(labels[1].any())
        ends += bool(labels[2].max() > 200)
        if labels[2].any():
            rows, columns = np.nonzero(labels[2] == labels[2].max())
            assert np.hypot(*(np.argwhere(labels[1]) - (rows[0], columns[0])).T).min() <= 2, "an end is on the robot"
    assert robots > 30
    assert 10 < ends <= robots


def test_a_crop_depends_on_its_number_alone(scenes: Path) -> None:
    files = find_scenes([scenes])
    in_order = [SceneCrops(files, PLAN)[index] for index in range(12)]
    kept = SceneCrops(files, PLAN)
    backwards = [kept[index] for index in reversed(range(12))][::-1]
    for one, other in zip(in_order, backwards, strict=True):
        assert one[0].equal(other[0])
        assert one[1].equal(other[1])
    assert not in_order[0][0].equal(SceneCrops(files, replace(PLAN, seed=1))[0][0])
    batch = next(iter(DataLoader(kept, 4)))
    assert batch[0][3].equal(in_order[3][0])


def test_crops_of_a_bench_share_its_board_and_labels(scenes: Path) -> None:
    crops = SceneCrops(find_scenes([scenes])[:1], replace(PLAN, end_weight=0.0))
    shown = [crops[index][1].numpy() for index in range(CROPS_PER_BENCH)]
    assert shown[0].shape[0] == 2
    assert all(np.array_equal(labels[0], shown[0][0]) for labels in shown)


def test_boards_without_a_vessel_have_no_robot(scenes: Path) -> None:
    crops = SceneCrops(find_scenes([scenes])[:1], replace(PLAN, clutter_share=1.0))
    assert not any(crops[index][1].any() for index in range(12))


def test_scenes_stand_beside_labelled_frames(scenes: Path, tmp_path: Path) -> None:
    folder = toy_set(tmp_path / "frames", 2)
    write_mask(folder / "masks" / "000_doubtful.png", np.ones((96, 128), bool))
    plan = replace(PLAN, scene_share=0.5, clutter_share=0.0, steps=20)
    frames = FrameCrops(find_samples([folder]), plan)
    files = find_scenes([scenes])
    mixed, painted = MixedCrops(files, frames, plan), SceneCrops(files, plan, has_doubt=True)
    assert len(mixed) == 120
    shown = 0
    for index in range(0, 60, CROPS_PER_BENCH):
        image, labels = mixed[index]
        assert (image.shape, labels.shape) == ((3, 64, 80), (4, 64, 80))
        shown += image.equal(painted[index][0])
        assert image.equal(painted[index][0]) or image.equal(frames[index][0])
    assert 4 < shown < 16
    assert MixedCrops(files, frames, replace(plan, scene_share=1.0))[0][0].equal(painted[0][0])
