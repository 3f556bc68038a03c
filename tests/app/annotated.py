"""Annotation files made by the program: masks, and lines on request."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from core.annotation.masks import polygons_of
from core.annotation.model import Annotation, ImageView, MaskTarget, measure_lines
from core.annotation.store import DEFAULT_NAME, AnnotationStore, FoundImage, ItemKey, find_images
from core.config.models import PerceptionConfig
from core.learning.dataset import write_png
from core.types import Image, Mask, PoseState

SIZE = (160, 120)


def tube(index: int) -> tuple[Image, Mask, Mask]:
    """A bright lumen with a dark robot in it, whose length depends on the index; RGB (120, 160, 3) and both masks."""
    vessel, robot = np.zeros((SIZE[1], SIZE[0]), bool), np.zeros((SIZE[1], SIZE[0]), bool)
    vessel[40:80, :] = True
    robot[56:64, : 60 + 4 * index] = True
    image = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    image[vessel], image[robot] = 200, 20
    image[:4, 4 * index : 4 * index + 4] = 255  # every picture is another file
    return image, vessel, robot


def annotate_masks(folder: Path, count: int, *, without_robot: Sequence[int] = ()) -> Path:
    """`count` pictures of `tube` in `folder`, with their masks as one rater draws them; returns the annotation file."""
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(count):
        write_png(folder / f"frame_{index:02d}.png", tube(index)[0])
    path = folder / DEFAULT_NAME
    with AnnotationStore(path) as store:
        for index, image in enumerate(_found(folder, store)):
            _, vessel, robot = tube(index)
            masks = polygons_of(vessel, MaskTarget.VESSEL)
            if index not in without_robot:
                masks += polygons_of(robot, MaskTarget.ROBOT)
            _save(store, image, Annotation(masks=masks))
    return path


def measure(
    store_path: Path, images: Sequence[Path], tilt_px: Sequence[float], *, study: str = "", rater: str = "ann", repeat: int = 1
) -> None:
    """Lines on images: the vessel level, the robot falling by `tilt_px` over its 40 px."""
    with AnnotationStore(store_path) as store:
        for image, tilt in zip(find_images(images, store)[0], tilt_px, strict=True):
            lines = Annotation(robot=((20.0, 60.0), (60.0, 60.0 + tilt)), vessel=((10.0, 60.0), (110.0, 60.0)), state=PoseState.C)
            _save(store, image, lines, study, rater, repeat)


def _found(folder: Path, store: AnnotationStore) -> list[FoundImage]:
    return find_images(sorted(folder.glob("*.png")), store)[0]


def _save(
    store: AnnotationStore, image: FoundImage, content: Annotation, study: str = "", rater: str = "ann", repeat: int = 1
) -> None:
    key = ItemKey(image.sha256, study, rater, repeat)
    entry = store.history(key).edit("drawn", content)
    assert entry is not None
    store.save(key, ImageView.AS_IS, entry, content, measure_lines(content, image.record.size, PerceptionConfig()), 1.0)
