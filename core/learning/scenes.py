"""Scenes of benches: a vessel's geometry with robots in it, from which training crops are painted; some with the twin's pictures.

``synth --scenes`` writes ``scenes/NNNNNN.npz``, and ``train --scenes`` reads them (``scene_crops``).
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import cv2
import numpy as np
from numpy.typing import NDArray

from core.learning.dataset import DatasetError, mask_png, png
from core.types import Image, Mask, Points

REACH_PX = 31.75
"""Distances to the wall are kept up to this: in quarters of a pixel, in a byte."""
MOST_RATIO = 2.55
"""Ratios are kept up to this, in hundredths."""


@dataclass(frozen=True, slots=True, eq=False)
class BenchScene:
    """One view of a vessel with robots; all in the pixels (H, W) of the view.

    Attributes
    ----------
    distance_px : signed distance to the wall, negative inside; kept to 1/8 px up to ``REACH_PX``, with its exact sign.
    ratio : distance to the centerline over the radius, kept to 1/200 up to ``MOST_RATIO``.
    lines : robots, (N, 2) each, tail -> head.
    radius_px : the robot's radius in the twin's look.
    pictures : the twin's pictures of the first robots, each with the robot's mask.
    empty : its picture without robot; None where there are no pictures.
    """

    distance_px: NDArray[np.float32]
    ratio: NDArray[np.float32]
    lines: tuple[Points, ...]
    radius_px: float
    pictures: tuple[tuple[Image, Mask], ...] = ()
    empty: Image | None = None

    @property
    def vessel(self) -> Mask:
        """Its mask."""
        return np.asarray(self.distance_px < 0)

    def to_bytes(self) -> bytes:
        """The contents of its file."""
        arrays: dict[str, NDArray[Any]] = {
            "radius_px": np.array(self.radius_px),
            "distance": _packed(png(np.clip(np.floor(self.distance_px * 4) + 128, 0, 255).astype(np.uint8))),
            "ratio": _packed(png(np.rint(np.clip(self.ratio, 0, MOST_RATIO) * 100).astype(np.uint8))),
            "lengths": np.array([len(line) for line in self.lines], np.int64),
            "points": np.concatenate(self.lines).astype(np.float32),
        }
        if self.empty is not None:
            arrays["empty"] = _packed(png(self.empty))
        for place, (image, robot) in enumerate(self.pictures):
            arrays |= {f"image{place}": _packed(png(image)), f"robot{place}": _packed(mask_png(robot))}
        file = io.BytesIO()
        np.savez(file, **arrays)  # type: ignore[arg-type]  # its own options are no arrays
        return file.getvalue()


def _packed(data: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(data, np.uint8)


def read_scene(path: Path, *, pictures: bool = True) -> BenchScene:
    """Read a scene's file, without its pictures where they are not wanted; raises DatasetError."""
    try:
        with path.open("rb") as opened, np.load(opened) as file:
            return _unpacked(file, pictures=pictures)
    except (OSError, ValueError, TypeError, LookupError, EOFError, BadZipFile, cv2.error):
        raise DatasetError(f"{path}: damaged, or not a scene as synth --scenes writes it") from None


def _unpacked(file: Any, *, pictures: bool) -> BenchScene:
    distance = (_decoded(file["distance"]).astype(np.float32) - np.float32(127.5)) * np.float32(0.25)
    ratio = _decoded(file["ratio"]).astype(np.float32) * np.float32(0.01)
    radius_px = float(file["radius_px"])
    points, lengths = file["points"].astype(np.float64), file["lengths"]
    if ratio.shape != distance.shape or lengths.min() < 2 or points.shape != (lengths.sum(), 2) or not np.isfinite(points).all():
        raise ValueError("the parts do not fit together")
    lines = tuple(np.split(points, np.cumsum(lengths)[:-1]))
    if not pictures or "empty" not in file:
        return BenchScene(distance, ratio, lines, radius_px)
    shown = range(sum(name.startswith("image") for name in file.files))
    pairs = tuple((_decoded(file[f"image{place}"], cv2.IMREAD_COLOR_RGB), _decoded(file[f"robot{place}"]) > 127) for place in shown)
    empty = _decoded(file["empty"], cv2.IMREAD_COLOR_RGB)
    if any(part.shape[:2] != distance.shape for part in (empty, *(part for pair in pairs for part in pair))):
        raise ValueError("the parts do not fit together")
    return BenchScene(distance, ratio, lines, radius_px, pairs, empty)


def _decoded(data: NDArray[np.uint8], flags: int = cv2.IMREAD_GRAYSCALE) -> NDArray[np.uint8]:
    image = cv2.imdecode(data, flags)
    if image is None:
        raise ValueError("a picture cannot be decoded")
    return np.asarray(image, np.uint8)


def find_scenes(folders: Iterable[Path]) -> list[Path]:
    """The scenes' files in ``scenes/`` of the folders, sorted; raises DatasetError when a folder has none."""
    found: list[Path] = []
    for folder in folders:
        files = sorted((folder / "scenes").glob("*.npz"))
        if not files:
            raise DatasetError(f"{folder}: no scenes; needs scenes/NUMBER.npz as synth --scenes writes them")
        found += files
    return found
