"""A labelled set of drawn boards."""

from pathlib import Path

import numpy as np

from core.learning.dataset import write_mask, write_png


def toy_set(folder: Path, count: int) -> Path:
    """Grey boards with a bright vertical band (vessel) and a dark line in it (robot)."""
    (folder / "images").mkdir(parents=True)
    (folder / "masks").mkdir()
    rng = np.random.default_rng(0)
    for i in range(count):
        x = int(rng.integers(30, 90))
        vessel = np.zeros((96, 128), bool)
        vessel[:, x - 12 : x + 12] = True
        robot = np.zeros_like(vessel)
        robot[:60, x - 2 : x + 2] = True
        image = np.full((96, 128, 3), 90, np.uint8)
        image[vessel], image[robot] = 200, 10
        write_png(folder / "images" / f"{i:03d}.png", image)
        write_mask(folder / "masks" / f"{i:03d}_vessel.png", vessel)
        write_mask(folder / "masks" / f"{i:03d}_robot.png", robot)
    return folder
