"""Reading pictures: any size, grey or colour, 8 or 16 bit, to RGB uint8. Colour order is converted here, once, at the border."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import UserError
from core.types import Image

MAX_PIXELS = 120_000_000
"""8k (33 million pixels) passes easily; far beyond it a file is rather damaged or hostile than a photograph."""


class ImageError(UserError):
    """A picture cannot be read; the message is one line with the file's name."""


def read_image(path: Path) -> Image:
    """The picture as RGB uint8 (H, W, 3); of an animation its first image.

    Raises
    ------
    ImageError
        Missing, empty, truncated, not a picture, or larger than ``MAX_PIXELS``.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ImageError(f"{path}: cannot be read ({error.strerror})") from None
    if not data:
        raise ImageError(f"{path}: empty file")
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise ImageError(f"{path}: cannot be decoded ({error.err or 'damaged or too large'})") from None
    if pixels is None or pixels.size == 0:
        raise ImageError(f"{path}: not a picture that can be read, or cut short")
    if pixels.shape[0] * pixels.shape[1] > MAX_PIXELS:
        raise ImageError(f"{path}: {pixels.shape[1]}x{pixels.shape[0]} is larger than {MAX_PIXELS // 1_000_000} million pixels")
    if _is_cut(data):
        raise ImageError(f"{path}: cut short (the end of the file is missing)")
    return to_rgb8(pixels, blue_first=True)


def _is_cut(data: bytes) -> bool:
    """Decoders fill the missing part of a cut PNG or JPEG with grey and say nothing; its end mark tells."""
    if data.startswith(b"\x89PNG"):
        return b"IEND" not in data[-64:]
    if data.startswith(b"\xff\xd8"):
        return b"\xff\xd9" not in data[-4096:]
    return False


def to_rgb8(pixels: NDArray[np.generic], *, blue_first: bool = False) -> Image:
    """Grey, grey + alpha, colour or colour + alpha of any depth -> RGB uint8 (H, W, 3).

    16-bit images are scaled by their full range (65535 -> 255) unless they use less than 1/16 of it, as 10- and 12-bit sensors do;
    then by the largest value. Floats are taken as 0..1. Raises ImageError for any other shape or kind.
    """
    array = np.asarray(pixels)
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[:, :, 0]
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (2, 3, 4)):
        raise ImageError(f"an image has 1 to 4 channels, this array has the shape {array.shape}")
    if array.dtype == np.bool_:
        array = array.astype(np.uint8) * 255
    elif np.issubdtype(array.dtype, np.floating):
        array = (np.clip(np.nan_to_num(array), 0.0, 1.0) * 255).astype(np.uint8)
    elif array.dtype == np.uint16:
        top = int(array.max(initial=0))
        array = (array.astype(np.float32) * (255.0 / (65535 if top >= 4096 else max(top, 255)))).astype(np.uint8)
    elif array.dtype != np.uint8:
        raise ImageError(f"images of type {array.dtype} are not supported; use 8 or 16 bit")
    if array.ndim == 3 and array.shape[2] == 2:
        array = array[:, :, 0]
    if array.ndim == 2:
        return np.ascontiguousarray(np.repeat(array[:, :, None], 3, axis=2))
    colours = array[:, :, :3]
    return np.ascontiguousarray(colours[:, :, ::-1] if blue_first else colours)
