"""Training crops: geometry, looks, clips, and the weights of the robot's ends."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.learning.augmentation import FrameCrops, end_nearness, random_clutter, random_crop, random_look, with_strips
from core.learning.dataset import find_samples
from core.learning.training_plan import TrainingPlan
from tests.core.learning.toy_set import toy_set


def test_crops_keep_image_and_labels_together(tmp_path: Path) -> None:
    image, vessel, robot = find_samples([toy_set(tmp_path / "set", 1)])[0].load()
    rng = np.random.default_rng(3)
    for _ in range(20):
        cut, (cut_vessel, cut_robot) = random_crop(image, (vessel, robot), (64, 80), rng)
        assert cut.shape == (64, 80, 3)
        inner = cut_robot & (
            np.roll(cut_robot, 1, 0) & np.roll(cut_robot, -1, 0) & np.roll(cut_robot, 1, 1) & np.roll(cut_robot, -1, 1)
        )
        assert not (cut_robot & ~cut_vessel)[2:-2, 2:-2].any()
        if inner.any():
            assert np.median(cut[inner]) < 60


def test_looks_and_clutter_are_pictures() -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        picture = random_look(random_clutter((40, 50), rng), rng)
        assert picture.shape == (40, 50, 3)
        assert picture.dtype == np.uint8


def test_strips_lie_across_the_robot_and_leave_the_rest() -> None:
    image = np.full((200, 300, 3), 128, np.uint8)
    robot = np.zeros((200, 300), bool)
    robot[98:102, 100:200] = True
    vessel = np.zeros((200, 300), bool)
    vessel[85:115, 80:220] = True
    over, across = 0, 0
    for seed in range(40):
        painted = with_strips(image, vessel, robot, np.random.default_rng(seed))
        assert painted.shape == image.shape
        assert painted.dtype == np.uint8
        changed = np.any(painted != image, axis=2)
        assert 0 < changed.sum() < 0.15 * changed.size
        assert not changed[:, :20].any()
        assert not changed[:, 280:].any()
        over += bool((changed & robot).any())
        rows = np.flatnonzero(changed[:, 100:200].any(axis=1))
        across += len(rows) > 0 and np.ptp(rows) > 20
    assert (image == 128).all()
    assert over > 30
    assert across > 30


def test_strips_need_something_to_lie_on() -> None:
    image = np.full((64, 64, 3), 128, np.uint8)
    nothing = np.zeros((64, 64), bool)
    assert (with_strips(image, nothing, nothing, np.random.default_rng(0)) == image).all()


def test_the_robots_ends_are_told_where_they_count_for_more(tmp_path: Path) -> None:
    samples = find_samples([toy_set(tmp_path / "set", 1)])
    plan = TrainingPlan(steps=20, batch=1, crop=(320, 320), clutter_share=0.0, look_share=0.0, end_weight=4.0)
    crops, plain = FrameCrops(samples, plan), FrameCrops(samples, replace(plan, end_weight=0.0))
    seen = 0
    for index in range(20):
        labels = crops[index][1].numpy()
        assert plain[index][1].numpy().tolist() == labels[:2].tolist()
        if labels[2].any():
            seen += 1
            rows, columns = np.nonzero(labels[2] == labels[2].max())
            robot = np.argwhere(labels[1])
            assert np.hypot(*(robot - (rows[0], columns[0])).T).min() <= 2.0, "it is on the robot"
            assert labels[2].mean() < 55, "and nowhere else"
    assert seen > 10


@pytest.mark.parametrize("width", [1, 4, 10, 24, 40])
def test_a_robot_does_not_end_where_it_is_cut_off(width: int) -> None:
    robot = np.zeros((160, 160), bool)
    robot[60 : 60 + width, :100] = True
    near = end_nearness(robot)
    peaks, places = cv2.connectedComponents((near == 255).view(np.uint8))
    assert peaks == 2, "one end beside the background, the right one"
    assert 99 - width <= np.argwhere(places == 1)[:, 1].mean() <= 99
    robot[60 : 60 + width] = True
    assert not end_nearness(robot).any()
    robot[:] = False
    robot[60:76, 0] = True
    assert not end_nearness(robot).any(), "a sliver at the border"
    assert not end_nearness(np.zeros((160, 160), bool)).any()
