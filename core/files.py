"""Files: atomic writes, names as text, and pictures of any size and depth as RGB uint8 (colour order is converted only here)."""

from __future__ import annotations

import contextlib
import math
import os
import re
import secrets
import shutil
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from core.devices import UserError, disk_errors
from core.system import MAX_PIXELS
from core.types import Image

VIDEO_ENDINGS = (".mp4", ".mkv", ".avi", ".mov", ".webm", ".m4v")
"""Files that are read as videos."""

LEFT_AFTER_S = 60.0
"""An unfinished file that is older was left by a process that was killed."""
_UNFINISHED = re.compile(r"\.[0-9a-f]{16}\.part")


def write_atomic(path: Path, data: bytes, *, durable: bool = False, older: Path | None = None) -> None:
    """Atomic write: a reader, even after a crash, finds the old file or the new one. A link is followed.

    An old file's permissions are kept where possible. With `durable` it also survives a power cut, which takes some milliseconds.
    The old file is copied to `older`, once the new one has found room. Raises OSError, which names `path`; the old file is
    unchanged then, and no other is left behind.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():  # a device or a pipe, which must not be replaced
        target.write_bytes(data)
        return
    aside = target.with_name(f".{secrets.token_hex(8)}.part")  # as _UNFINISHED; the target's name plus an ending may be too long
    try:
        with aside.open("wb") as file:
            if target.exists():
                with contextlib.suppress(PermissionError):  # a disk of another user
                    shutil.copymode(target, aside)
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        if older is not None and target.exists():
            write_atomic(older, target.read_bytes(), durable=durable)
        aside.replace(target)
    except OSError as error:
        with contextlib.suppress(OSError):
            aside.unlink()
        raise OSError(error.errno, error.strerror, str(path)) from None
    if durable:
        with contextlib.suppress(OSError):  # some file systems cannot; the new file is in place by now
            sync_folder(target.parent)


def is_unfinished(path: Path) -> bool:
    """Whether a file has the name that ``write_atomic`` uses until the file is complete."""
    return _UNFINISHED.fullmatch(path.name) is not None


def sweep_unfinished(folder: Path) -> None:
    """Remove unfinished files of processes that were killed a minute ago or longer; a file that cannot be removed stays."""
    for path in filter(is_unfinished, folder.glob(".*.part")):
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime > LEFT_AFTER_S:
                path.unlink()


def sync_folder(folder: Path) -> None:
    """Force the folder's entries to the disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def name_as_text(name: str | Path) -> str:
    """A file name for files, figures and terminals: bytes that are not UTF-8, as from old archives, are escaped."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def name_of(path: Path) -> str:
    """The name of a file or folder, also of "." and ".."; a link keeps its own."""
    return os.path.basename(os.path.abspath(path))


_AS_SEEN = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR
"""Grey stays grey and 16 bit stay 16 bit; alpha is dropped, and EXIF orientation is applied."""
_TOO_LARGE = f"is larger than {MAX_PIXELS // 1_000_000} million pixels"
_FULL_SCALES = (1023, 4095, 65535)
_PNG, _JPEG = b"\x89PNG", b"\xff\xd8"
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Segments with the size (SOF); the three that are left out are tables."""

# damaged files are reported as ImageError, not by OpenCV's log
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


class ImageError(UserError):
    """A picture cannot be read; the message is one line with the file's name."""


def read_image(path: Path) -> Image:
    """The picture as RGB uint8 (H, W, 3); of an animation its first image.

    Raises ImageError: missing, empty, truncated, not a picture, or larger than ``MAX_PIXELS``.
    """
    with disk_errors(ImageError, path, "cannot be read"):
        data = path.read_bytes()
    if not data:
        raise ImageError(f"{path}: empty file")
    if _is_cut(data):
        raise ImageError(f"{path}: cut short (the end of the file is missing)")
    _check_size(path, *(_header_size(data) or (0, 0)))
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), _AS_SEEN)
        if pixels is None:  # some rare kinds, such as TIFF of floats with alpha, are only read unchanged
            pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        if "MAX_IMAGE" in error.err:
            raise ImageError(f"{path}: {_TOO_LARGE}") from None
        raise ImageError(f"{path}: cannot be decoded ({error.err or 'damaged or too large'})") from None
    if pixels is None or pixels.size == 0:
        raise ImageError(f"{path}: not a picture that can be read, or cut short")
    _check_size(path, pixels.shape[1], pixels.shape[0])
    try:
        return to_rgb8(pixels, blue_first=True)
    except ImageError as error:
        raise ImageError(f"{path}: {error}") from None


def _check_size(path: Path, width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise ImageError(f"{path}: {width}x{height} {_TOO_LARGE}")


def _is_cut(data: bytes) -> bool:
    """Whether a PNG or JPEG has no end mark: decoders silently fill the missing part of a truncated file with grey.

    Data may follow the end mark (phones append a short video), and a JPEG's preview has an end mark before the pixels; among the
    pixels it cannot occur, because 0xFF is escaped there.
    """
    if data.startswith(_PNG):
        return b"IEND" not in data
    if data.startswith(_JPEG):
        *_, (_, pixels) = _jpeg_segments(data)
        return data.find(b"\xff\xd9", pixels) < 0
    return False


def _header_size(data: bytes) -> tuple[int, int] | None:
    """Width and height from the header of PNG, JPEG or BMP, before the picture is decoded; None for other kinds."""
    try:
        if data.startswith(_PNG):
            return struct.unpack_from(">II", data, 16)
        if data.startswith(_JPEG):
            for marker, place in _jpeg_segments(data):
                if marker in _JPEG_FRAMES:
                    height, width = struct.unpack_from(">HH", data, place + 3)
                    return width, height
        if data.startswith(b"BM"):
            old = struct.unpack_from("<I", data, 14)[0] == 12
            width, height = struct.unpack_from("<HH" if old else "<ii", data, 18)
            return abs(width), abs(height)
    except struct.error:
        pass
    return None


def _jpeg_segments(data: bytes) -> Iterator[tuple[int, int]]:
    """Each segment's marker and the position of its length, up to the start of the pixels or the end of the file."""
    place = 2
    while place + 4 <= len(data) and data[place] == 0xFF:
        marker = data[place + 1]
        if marker == 0xFF:  # a fill byte
            place += 1
            continue
        yield marker, place + 2
        if marker == 0xDA:
            return
        alone = marker == 0x01 or 0xD0 <= marker <= 0xD8
        place += 2 if alone else 2 + int.from_bytes(data[place + 2 : place + 4], "big")
    yield 0, min(place, len(data))


def to_rgb8(pixels: NDArray[np.generic], *, blue_first: bool = False) -> Image:
    """Grey, grey + alpha, colour or colour + alpha of any depth -> RGB uint8 (H, W, 3).

    16-bit images are scaled by the full range of the sensor that fits their brightest pixels: 10, 12 or 16 bit. Floats are taken as
    0..1. Alpha is dropped. Raises ImageError for any other shape or kind.
    """
    array = np.asarray(pixels)
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (1, 2, 3, 4)):
        raise ImageError(f"an image has 1 to 4 channels, this array has the shape {array.shape}")
    if array.ndim == 3:
        array = array[:, :, 0] if array.shape[2] <= 2 else array[:, :, :3]
    if array.dtype == np.bool_:
        array = array.astype(np.uint8) * 255
    elif np.issubdtype(array.dtype, np.floating):
        array = np.rint(np.clip(np.nan_to_num(array), 0.0, 1.0) * 255).astype(np.uint8)
    elif array.dtype == np.uint16:
        array = _from_16_bit(array)
    elif array.dtype != np.uint8:
        raise ImageError(f"images of type {array.dtype} are not supported; use 8 or 16 bit")
    if array.ndim == 2:
        return np.ascontiguousarray(np.repeat(array[:, :, None], 3, axis=2))
    return np.ascontiguousarray(array[:, :, ::-1] if blue_first else array)


def _from_16_bit(array: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Scaled by the smallest usual range (10, 12 or 16 bit) that holds the picture, so that a dark one stays dark."""
    if array.size == 0:
        return array.astype(np.uint8)
    step = max(1, math.isqrt(array.shape[0] * array.shape[1] // 250_000))
    brightest = float(np.percentile(array[::step, ::step], 99.9))  # a few hot pixels do not count
    top = next(full for full in _FULL_SCALES if brightest <= full)
    greys = np.rint(np.minimum(np.arange(65536) * (255.0 / top), 255.0)).astype(np.uint8)
    return np.asarray(greys[array])


def replace_folder(scratch: Path, folder: Path) -> Path | None:
    """Move a finished folder to its place, and return where the one that was there before lies now.

    Raises OSError, with the older folder in its place again. If it is interrupted, one of both folders is whole.
    """
    aside = scratch.with_name(scratch.name + ".old")
    was_there = folder.exists()
    if was_there:
        os.replace(folder, aside)
    try:
        os.replace(scratch, folder)
    except BaseException:
        if was_there:
            os.replace(aside, folder)
        raise
    with contextlib.suppress(OSError):  # some file systems cannot
        sync_folder(folder.parent)
    return aside if was_there else None
