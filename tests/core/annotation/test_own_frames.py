"""Masks by hand become a set to train on and one that stays out; the latter says whether training helped."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import torch

from core.annotation.exchange import FEWEST, split_own_frames
from core.annotation.model import AnnotationError
from core.annotation.store import AnnotationStore, FoundImage, StoredAnnotation, find_images
from core.learning.dataset import UNMEASURED, find_samples, read_truth
from core.learning.training import dice, measure_held_out
from core.perception.inference import padded
from core.perception.unet import DualUNet, UNetShape
from tests.app.annotated import annotate_masks, measure


def read(store_path: Path) -> tuple[Sequence[StoredAnnotation], list[FoundImage]]:
    with AnnotationStore(store_path) as store:
        return store.annotations(), find_images(sorted(store_path.parent.glob("*.png")), store)[0]


@pytest.mark.parametrize(("count", "held_out"), [(6, 2), (9, 2), (10, 2), (15, 3), (24, 4)])
def test_a_fifth_and_two_at_least_stay_out(count: int, held_out: int, tmp_path: Path) -> None:
    annotations, images = read(annotate_masks(tmp_path / "images", count))
    frames = split_own_frames(annotations, images, tmp_path / "sets")
    assert (frames.train_count, frames.held_out_count) == (count - held_out, held_out)
    train, out = ({sample.stem for sample in find_samples([folder])} for folder in (frames.train, frames.held_out))
    assert len(train) == count - held_out
    assert not train & out
    places = sorted(int(stem.removeprefix("frame_")) for stem in out)
    begin = (count - held_out) // 2
    assert places == list(range(begin, begin + held_out)), "neighbours in the order of their names"


def test_too_few_masks_are_refused_with_what_is_missing(tmp_path: Path) -> None:
    annotations, images = read(annotate_masks(tmp_path / "images", FEWEST + 1, without_robot=(0, 3)))
    with pytest.raises(AnnotationError, match=r"5 images have both a vessel and a robot mask, and training needs 6: 1 more"):
        split_own_frames(annotations, images, tmp_path / "sets")
    with pytest.raises(AnnotationError, match=r"1 image has both"):
        split_own_frames(annotations, images[1:2], tmp_path / "sets")
    assert not (tmp_path / "sets").exists()


def test_answers_of_several_studies_keep_nobody_from_training(tmp_path: Path) -> None:
    """Training learns masks; that a picture was also measured in a study was said to stand in its way."""
    path = annotate_masks(tmp_path / "images", FEWEST)
    pictures = sorted(path.parent.glob("*.png"))
    measure(path, pictures, [3.0] * FEWEST, study="first")
    annotations, images = read(path)
    frames = split_own_frames(annotations, images, tmp_path / "of one")
    assert {row["state"] for row in read_truth(frames.held_out).values()} == {"C"}
    measure(path, pictures[:1], [9.0], study="second")
    annotations, images = read(path)
    frames = split_own_frames(annotations, images, tmp_path / "of two")
    assert (frames.train_count, frames.held_out_count) == (FEWEST - 2, 2)
    assert {row["reason"] for row in read_truth(frames.held_out).values()} == {UNMEASURED}


def test_a_folder_in_use_is_left_alone(tmp_path: Path) -> None:
    annotations, images = read(annotate_masks(tmp_path / "images", FEWEST))
    split_own_frames(annotations, images, tmp_path / "sets")
    with pytest.raises(AnnotationError, match="not empty"):
        split_own_frames(annotations, images, tmp_path / "sets")


def test_dice_by_hand() -> None:
    one = np.array([[1, 1, 0, 0]], bool)
    two = np.array([[0, 1, 1, 0]], bool)
    none = np.zeros((1, 4), bool)
    assert dice([(one, two)]) == pytest.approx(0.5)  # 2 * 1 / (2 + 2)
    assert dice([(one, two), (one, one)]) == pytest.approx(0.75)  # 2 * 3 / 8, over all pixels together
    assert dice([(one, none)]) == 0.0
    assert dice([(none, none)]) == 1.0


def test_a_network_that_finds_all_or_nothing_is_measured_and_left_in_its_mode(tmp_path: Path) -> None:
    annotations, images = read(annotate_masks(tmp_path / "images", FEWEST))
    frames = split_own_frames(annotations, images, tmp_path / "sets")
    network = DualUNet(UNetShape.of_base(4)).train()
    with torch.no_grad():
        for decoder, bias in ((network.vessel, 50.0), (network.robot, -50.0)):
            decoder.output.weight.zero_()
            decoder.output.bias.fill_(bias)
    seen = measure_held_out(network, find_samples([frames.held_out]))
    assert network.training
    # everything is taken for vessel: 40 of 120 lines are it, 2 * 1/3 / (1 + 1/3)
    assert seen.vessel_dice == pytest.approx(0.5, abs=0.01)
    assert seen.robot_dice == 0.0
    assert {frame.stem for frame in seen.frames} == {sample.stem for sample in find_samples([frames.held_out])}
    assert seen.frames[0].vessel.shape == seen.frames[0].image.shape[:2]


def test_a_held_out_frame_is_filled_up_to_whole_strides_as_perception_does_it() -> None:
    """Mirrored: a network is measured on what it will be shown."""

    class Drawn:
        stem = "drawn"

        def load(self, size_px: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            image = np.random.default_rng(0).integers(0, 255, (90, 120, 3), np.uint8)
            return image, np.zeros((90, 120), bool), np.zeros((90, 120), bool)

    shown: list[np.ndarray] = []
    network = DualUNet(UNetShape.of_base(4))
    network.register_forward_pre_hook(lambda _, given: shown.append(np.rint(255 * given[0][0].numpy()).astype(np.uint8)))
    (seen,) = measure_held_out(network, [Drawn()]).frames  # type: ignore[list-item]
    assert seen.vessel.shape == (90, 120)
    (batch,) = shown
    height = batch.shape[1]
    assert height > 90
    assert height % network.shape.stride == 0
    np.testing.assert_array_equal(batch[:, 90:height], batch[:, 88 : 178 - height : -1])
    np.testing.assert_array_equal(batch.transpose(1, 2, 0), padded(seen.image, network.shape.stride))
