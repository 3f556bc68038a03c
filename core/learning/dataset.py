"""Labelled frames on disk: ``images/<stem>.png``, ``masks/<stem>_vessel.png``, ``masks/<stem>_robot.png``, ``truth.jsonl``.

``synth`` writes this layout and ``train --data`` reads it; truth is optional for training, and so is ``masks/<stem>_doubtful.png``:
where the robot's label is unsure and is not trained on.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError, ValidationInfo, field_validator

from core.devices import UserError
from core.files import ImageError, read_image, write_atomic
from core.types import Image, Mask

WORKING_SIZE_PX = 640
"""Longer side at which networks are trained: the default of ``perception.working_size_px``."""
UNMEASURED = "not measured by hand"
"""The `reason` of a frame with masks whose pose was not measured: it may well have one."""
IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


class DatasetError(UserError):
    """A data folder cannot be used; the message is one line and says what to do."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Paths of one labelled frame. ``doubtful``: a mask of where the robot's label is unsure, and not trained on; None: nowhere."""

    stem: str
    image: Path
    vessel: Path
    robot: Path
    doubtful: Path | None = None

    def load(self, longer_side_px: int | None = None) -> tuple[Image, Mask, Mask]:
        """Image (H, W, 3) and both masks (H, W), scaled to `longer_side_px` if given; raises DatasetError."""
        try:
            image = read_image(self.image)
            masks = [read_mask(path) for path in (self.vessel, self.robot)]
        except ImageError as error:
            raise DatasetError(str(error)) from None
        for path, mask in zip((self.vessel, self.robot), masks, strict=True):
            if mask.shape != image.shape[:2]:
                raise DatasetError(f"{path}: {mask.shape[1]}x{mask.shape[0]}, but its image is {image.shape[1]}x{image.shape[0]}")
        if longer_side_px is None or max(image.shape[:2]) == longer_side_px:
            return image, masks[0], masks[1]
        scale = longer_side_px / max(image.shape[:2])
        size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
        vessel, robot = (_resized(mask.astype(np.uint8) * 255, size) > 127 for mask in masks)
        return _resized(image, size), vessel, robot

    def load_doubtful(self, shape: tuple[int, ...]) -> Mask:
        """Where the robot's label is unsure, (H, W) scaled to `shape`; raises DatasetError."""
        if self.doubtful is None:
            return np.zeros(shape[:2], bool)
        try:
            mask = read_mask(self.doubtful)
        except ImageError as error:
            raise DatasetError(str(error)) from None
        if mask.shape == shape[:2]:
            return mask
        return np.asarray(_resized(mask.astype(np.uint8) * 255, (shape[1], shape[0])) > 127)


def read_mask(path: Path) -> Mask:
    """A mask: grey, 255 inside. Raises ImageError, and DatasetError for one in which other values mean something."""
    pixels = read_image(path)
    mask = np.asarray(pixels[:, :, 0] > 127)
    if pixels.any() and not mask.any():
        raise DatasetError(f"{path}: nothing in it is brighter than 127; a mask is grey, 255 inside and 0 elsewhere")
    return mask


def _resized(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    shrinks = size[0] < pixels.shape[1]
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR))


def find_samples(folders: Sequence[Path]) -> list[Sample]:
    """All images with both masks below the folders' ``images/``, sorted.

    Raises DatasetError when a folder has none, or two images of one stem: they would count twice.
    """
    samples: list[Sample] = []
    for folder in folders:
        images = sorted(p for p in (folder / "images").glob("*") if p.suffix.lower() in IMAGE_ENDINGS)
        masks = folder / "masks"
        found = [sample_at(p, masks) for p in images]
        complete = [s for s in found if s.vessel.is_file() and s.robot.is_file()]
        for first, second in pairwise(sorted(complete, key=lambda sample: sample.stem)):
            if first.stem == second.stem:
                both = f"{first.image.name} and {second.image.name}"
                raise DatasetError(f"{folder}: {both} have the same masks; remove one of them, or rename it with masks of its own")
        if not complete:
            raise DatasetError(
                f"{folder}: no labelled frames; needs images/NAME.png with masks/NAME_vessel.png and masks/NAME_robot.png"
            )
        samples += complete
    return samples


def sample_at(image: Path, masks: Path) -> Sample:
    """The paths of an image and of its masks in the folder `masks`, whether they are there or not, but for the doubtful one."""
    vessel, robot, doubtful = (masks / f"{image.stem}_{name}.png" for name in ("vessel", "robot", "doubtful"))
    return Sample(image.stem, image, vessel, robot, doubtful if doubtful.is_file() else None)


def without_masks(folders: Sequence[Path]) -> list[Path]:
    """Images that ``find_samples`` leaves out, because one of their masks is missing."""
    labelled = {sample.image for sample in find_samples(folders)}
    images = (path for folder in folders for path in sorted((folder / "images").glob("*")))
    return [path for path in images if path.suffix.lower() in IMAGE_ENDINGS and path not in labelled]


_Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class _TruthLine(BaseModel):
    """Another vessel line that a person accepts, beside a branch."""

    theta_deg: _Number
    theta_signed_deg: _Number
    state: Literal["A", "B", "C", "D"]


class _TruthRow(BaseModel):
    """What every row of ``truth.jsonl`` must satisfy; other keys are allowed."""

    stem: Annotated[str, Field(strict=True)]
    seed: int | str | None = None
    family: Annotated[str, Field(strict=True)] | None = None
    theta_deg: _Number | None = None
    state: Literal["A", "B", "C", "D"] | None = None
    theta_signed_deg: _Number | None = None
    head_xy: tuple[_Number, _Number] | None = None
    tail_xy: tuple[_Number, _Number] | None = None
    c_head_px: _Number | None = None
    c_tail_px: _Number | None = None
    alternatives: tuple[_TruthLine, ...] = ()

    @field_validator("state")
    @classmethod
    def _has_its_angle(cls, state: str | None, before: ValidationInfo) -> str | None:
        if state is not None and before.data.get("theta_deg", 0.0) is None:
            raise ValueError("theta_deg is missing")
        return state


_WANTED = {
    "stem": "must be the frame's name, as text",
    "seed": "must be a whole number or a text",
    "family": "must be the name of a family of looks, as text",
    "state": "must be A, B, C, D or null",
    "head_xy": "must be two finite numbers, or null",
    "tail_xy": "must be two finite numbers, or null",
    "alternatives": "must be a list of objects with theta_deg, theta_signed_deg and state",
}
"""Texts of errors about values; all others must be finite numbers, or null."""

POSE_KEYS = ("theta_deg", "theta_signed_deg", "head_xy")
"""Keys that the accuracy of a frame is measured with, where its truth has a state."""


def read_truth(folder: Path) -> dict[str, dict[str, Any]]:
    """``truth.jsonl`` by stem; raises DatasetError. A cut last line (a killed writer) is left out."""
    path = folder / "truth.jsonl"
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise DatasetError(f"{path}: cannot be read ({error.strerror}); write the set again with synth") from None
    except UnicodeDecodeError:
        raise DatasetError(f"{path}: is not UTF-8 text; write the set again with synth") from None
    truth: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(lines, 1):
        try:
            row = json.loads(line)
        except (ValueError, RecursionError):
            if number < len(lines):
                raise DatasetError(f"{path}: line {number} is damaged; write the set again with synth") from None
            continue
        if not isinstance(row, dict):
            raise DatasetError(f"{path}: line {number} is damaged; write the set again with synth")
        try:
            truth[_TruthRow.model_validate(row).stem] = row
        except ValidationError as error:
            first = error.errors()[0]
            key = str(first["loc"][0])
            wanted = _WANTED.get(key, "must be a finite number, or null")
            why = "is said, but theta_deg is not" if first["type"] == "value_error" else wanted
            raise DatasetError(f"{path}: line {number}: {key}: {why}; mend it, or write the set again with synth") from None
    return truth


def find_labelled(folder: Path, needed: Sequence[str] = ()) -> tuple[list[Sample], dict[str, dict[str, Any]]]:
    """The frames of a set that ``synth`` wrote, and their truth by stem.

    Raises DatasetError when a frame has no truth, or one with a state lacks a `needed` key.
    """
    samples, truth = find_samples([folder]), read_truth(folder)
    without = [sample.stem for sample in samples if sample.stem not in truth]
    if without:
        share = f"{len(without)} of {len(samples)} frames lack a truth (the first: {without[0]})"
        raise DatasetError(f"{folder}: {share}; write the set again with synth")
    for row in (truth[sample.stem] for sample in samples):
        missing = [key for key in needed if row.get(key) is None] if row.get("state") is not None else []
        if missing:
            raise DatasetError(f"{folder}: truth of frame {row['stem']} lacks {missing[0]}; write the set again with synth")
    return samples, truth


def write_mask(path: Path, mask: Mask) -> None:
    """A mask as 0/255 PNG; raises OSError when it cannot be written."""
    write_atomic(path, mask_png(mask))


def mask_png(mask: Mask) -> bytes:
    """A mask as a 0/255 PNG."""
    return png(mask.astype(np.uint8) * 255)


def write_png(path: Path, image: np.ndarray) -> None:
    """RGB or grey uint8 as PNG, never half a file; raises OSError."""
    write_atomic(path, png(image))


def png(image: np.ndarray) -> bytes:
    """RGB or grey uint8 as PNG; raises OSError when it cannot be encoded."""
    ok, data = cv2.imencode(
        ".png", image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 1]
    )
    if not ok:
        raise OSError(f"a picture of {image.shape} cannot be encoded")
    return data.tobytes()


_KEPT_SHARE = 0.65
"""Of the free memory: 14 GB hold 14000 frames of 640x480, or 8700 with one picture of what was seen of each."""
_FRAME_BYTES = WORKING_SIZE_PX**2 * 13 // 4
"""The most that one frame takes: three bytes of colour a pixel and two bits of masks."""


class KeptFrames:
    """Labelled frames at working size, and arrays that belong to them, kept in memory as far as they fit: decoding is slow.

    `count` is the number of frames. Arrays are kept only where the frames leave room: they are quicker to make again.
    """

    def __init__(self, count: int) -> None:
        self._frames: dict[Hashable, tuple[Image, NDArray[np.uint8]]] = {}
        self._arrays: dict[Hashable, tuple[NDArray[Any], ...]] = {}
        self._doubtful: dict[Path, Mask] = {}
        self._room = _free_memory() * _KEPT_SHARE
        self._room_besides = self._room - count * _FRAME_BYTES

    def frame(self, sample: Sample) -> tuple[Image, Mask, Mask]:
        """Image (h, w, 3), vessel and robot (h, w); one that is shown more often is kept once. Raises DatasetError."""
        kept = self._frames.get(sample.image)
        if kept is None:
            image, vessel, robot = sample.load(WORKING_SIZE_PX)
            packed = np.packbits(np.stack([vessel, robot]).reshape(2, -1), axis=1)
            if self._room > 0:
                self._frames[sample.image] = image, packed
                self._room -= image.nbytes + packed.nbytes
            return image, vessel, robot
        image, packed = kept
        height, width = image.shape[:2]
        masks = np.unpackbits(packed, axis=1, count=height * width).view(bool).reshape(2, height, width)
        return image, masks[0], masks[1]

    def doubtful(self, sample: Sample, shape: tuple[int, ...]) -> Mask:
        """Where the robot's label is unsure, (h, w); such frames are few and stay in memory. Raises DatasetError."""
        if sample.doubtful is None:
            return np.zeros(shape[:2], bool)
        if sample.doubtful not in self._doubtful:
            self._doubtful[sample.doubtful] = sample.load_doubtful(shape)
        return self._doubtful[sample.doubtful]

    def get(self, key: Hashable, make: Callable[[], tuple[NDArray[Any], ...]]) -> tuple[NDArray[Any], ...]:
        """What was kept under `key`, or what `make` gives."""
        arrays = self._arrays.get(key)
        if arrays is None:
            arrays = make()
            if self._room_besides > 0:
                self._arrays[key] = arrays
                self._room_besides -= sum(array.nbytes for array in arrays)
        return arrays


def _free_memory() -> float:
    """Bytes that are free, or 4 GB where the system does not say."""
    try:
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return 4e9
