"""A small set of frames whose colours tell their labels, for tests of crops that a GPU makes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from core.learning.dataset import Sample, find_samples, write_mask, write_png
from core.learning.gpu_batches import DeviceFrames

CPU = torch.device("cpu")
TIP = (330.0, 199.5)
"""Of the robot in ``masks_of()``."""


def masks_of(shift: int = 0) -> tuple[np.ndarray, np.ndarray]:
    vessel, robot = np.zeros((480, 640), bool), np.zeros((480, 640), bool)
    vessel[180 + shift : 220 + shift, :520] = True
    robot[196 + shift : 204 + shift, :332] = True
    return vessel, robot


def picture_of(vessel: np.ndarray, robot: np.ndarray) -> np.ndarray:
    """Colours tell the labels."""
    picture = np.full((*vessel.shape, 3), (20, 20, 120), np.uint8)
    picture[vessel, 0] = 220
    picture[robot, 1] = 220
    return picture


def write_frame(folder: Path, name: str, picture: np.ndarray, vessel: np.ndarray, robot: np.ndarray) -> None:
    for part in ("images", "masks"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    write_png(folder / "images" / f"{name}.png", picture)
    write_mask(folder / "masks" / f"{name}_vessel.png", vessel)
    write_mask(folder / "masks" / f"{name}_robot.png", robot)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator(CPU).manual_seed(seed)


def told_by_colour(picture: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Vessel and robot by colour, and where a colour is neither of one nor of the other (the edges)."""
    red, green = picture[:, 0], picture[:, 1]
    unsure = ((red > 40) & (red < 200)) | ((green > 40) & (green < 200))
    return red > 120, green > 120, unsure


def write_frames(folder: Path) -> list[Sample]:
    """Four frames, each 40 px farther down than the one before."""
    for number in range(4):
        vessel, robot = masks_of(40 * number)
        write_frame(folder, f"{number}", picture_of(vessel, robot), vessel, robot)
    return find_samples([folder])


def loaded(samples: list[Sample]) -> DeviceFrames:
    frames = DeviceFrames.load(samples, CPU, range(len(samples)))
    assert frames is not None
    return frames
