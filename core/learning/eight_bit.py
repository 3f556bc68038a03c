"""New eight-bit copies of a model's networks, without training: after a better way to make them was found, or for another rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from core.config import SegmentationConfig
from core.learning.model_file import second_look_of
from core.learning.model_writing import write_eight_bit
from core.perception.engines import open_second_look, open_segmenter
from core.perception.second_look import Planes, look_again
from core.perception.segmentation import Probability, Segmenter
from core.types import Image

_MOST_WINDOWS = 160
"""More of them say no more about the second look's ranges."""


class _Listening:
    """A second look's network that keeps what it was asked about."""

    def __init__(self, near: Segmenter) -> None:
        self._near = near
        self.asked: list[Planes] = []

    @property
    def engine(self) -> str:
        return self._near.engine

    def __call__(self, image: Planes) -> tuple[Probability, Probability]:
        self.asked.append(image)
        return self._near(image)


def renew_eight_bit(folder: Path, images: Sequence[Image], on_progress: Callable[[float], None] = lambda share: None) -> None:
    """Make the eight-bit copies of the model in `folder` anew, from what its networks see of RGB `images` at working size.

    What its confidence meant is no longer quite true. `on_progress` is told which share is done, 0..1.

    Raises
    ------
    ModelError
        The model is damaged, or sees nothing of a robot in these pictures.
    """
    # In fp32: the copies that are there may be damaged, or the reason for new ones.
    config = SegmentationConfig(model=str(folder), precision="fp32")
    near, where = open_second_look(config), second_look_of(folder)
    asked: list[Planes] = []
    if near is not None:
        first, listening = open_segmenter(config), _Listening(near)
        for done, image in enumerate(images):
            look_again(image, first(image), listening)
            on_progress(0.2 * done / len(images))
        asked = listening.asked[:: max(1, math.ceil(len(listening.asked) / _MOST_WINDOWS))]
    write_eight_bit(folder, images)
    on_progress(0.6)
    if where is not None:
        write_eight_bit(where, asked)
    on_progress(1.0)
