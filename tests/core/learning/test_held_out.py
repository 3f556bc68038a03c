"""Measuring a network on held-out frames."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import torch

from core.annotation.exchange import FEWEST, split_own_frames
from core.annotation.store import AnnotationStore, FoundImage, StoredAnnotation, find_images
from core.learning.dataset import find_samples
from core.learning.training import dice, measure_held_out
from core.perception.inference import padded
from core.perception.unet import DualUNet, UNetShape
from tests.app.annotated import annotate_masks


def read(store_path: Path) -> tuple[Sequence[StoredAnnotation], list[FoundImage]]:
    with AnnotationStore(store_path) as store:
        return store.annotations(), find_images(sorted(store_path.parent.glob("*.png")), store)[0]


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
    (seen,) = measure_held_out(network, [Drawn()]).frames
    assert seen.vessel.shape == (90, 120)
    (batch,) = shown
    height = batch.shape[1]
    assert height > 90
    assert height % network.shape.stride == 0
    np.testing.assert_array_equal(batch[:, 90:height], batch[:, 88 : 178 - height : -1])
    np.testing.assert_array_equal(batch.transpose(1, 2, 0), padded(seen.image, network.shape.stride))
