"""How well a network does on labelled frames that it is not trained on, while it is being trained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from core.learning.dataset import WORKING_SIZE_PX, Sample
from core.perception.engines import padded
from core.perception.unet import DualUNet
from core.types import Image, Mask


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutFrame:
    """A frame as the network sees it: picture and true masks at working size, and the masks that it finds."""

    stem: str
    image: Image
    true_vessel: Mask
    true_robot: Mask
    vessel: Mask
    robot: Mask


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """All frames, and Dice coefficients over the pixels of all of them together."""

    frames: tuple[HeldOutFrame, ...]
    vessel_dice: float
    robot_dice: float


def measure_held_out(network: DualUNet, samples: Sequence[Sample]) -> HeldOut:
    """Run the network, as it is, on whole frames; its mode is left as it was. Raises DatasetError."""
    was_training = network.training
    network.eval()
    try:
        frames = tuple(_see(network, sample) for sample in samples)
    finally:
        network.train(was_training)
    vessel = dice([(frame.vessel, frame.true_vessel) for frame in frames])
    robot = dice([(frame.robot, frame.true_robot) for frame in frames])
    return HeldOut(frames, vessel, robot)


def dice(pairs: Sequence[tuple[Mask, Mask]]) -> float:
    """Dice coefficient of found and true masks over all pairs together; 1 where neither has any pixel."""
    both = sum(int((found & true).sum()) for found, true in pairs)
    total = sum(int(found.sum()) + int(true.sum()) for found, true in pairs)
    return 2.0 * both / total if total else 1.0


@torch.no_grad()
def _see(network: DualUNet, sample: Sample) -> HeldOutFrame:
    image, vessel, robot = sample.load(WORKING_SIZE_PX)
    height, width = image.shape[:2]
    whole = padded(image, network.shape.stride)  # as perception does it, and cut back
    device = next(network.parameters()).device
    batch = torch.from_numpy(np.ascontiguousarray(whole.transpose(2, 0, 1)))[None].to(device).float() / 255
    found = (network(batch)[0] > 0).cpu().numpy()[:, :height, :width]
    return HeldOutFrame(sample.stem, image, vessel, robot, found[0], found[1])
