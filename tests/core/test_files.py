"""Atomic writes, names, and reading pictures of any kind."""

import errno
import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.files import ImageError, read_image, sweep_unfinished, to_rgb8, write_atomic


@pytest.mark.parametrize("durable", [False, True])
def test_it_takes_the_old_ones_place_and_permissions_and_leaves_nothing_else(tmp_path: Path, durable: bool) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(b"old")
    path.chmod(0o640)
    write_atomic(path, b"new", durable=durable)
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode & 0o777 == 0o640
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    path, link = tmp_path / "kept" / "a.toml", tmp_path / "a.toml"
    path.parent.mkdir()
    link.symlink_to(path)
    write_atomic(link, b"new", durable=True)
    assert link.is_symlink()
    assert path.read_bytes() == b"new"


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_disk_that_does_not_take_it_leaves_the_old_one_and_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(b"old")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    if call == "fsync":
        monkeypatch.setattr(os, "fsync", full)
    else:
        monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space left") as caught:
        write_atomic(path, b"new", durable=True)
    assert caught.value.filename == str(path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_was_there_is_kept_beside_it_only_once_the_new_one_has_found_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, older = tmp_path / "a.toml", tmp_path / "a.older.toml"
    for text in (b"one", b"two", b"three"):
        write_atomic(path, text, durable=True, older=older)
    assert (path.read_bytes(), older.read_bytes()) == (b"three", b"two")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_atomic(path, b"four", durable=True, older=older)
    assert (path.read_bytes(), older.read_bytes()) == (b"three", b"two")


def test_only_what_was_left_of_its_own_files_is_swept(tmp_path: Path) -> None:
    own, foreign, young, folder = (tmp_path / f".{name}.part" for name in (f"{1:016x}", "holiday", f"{2:016x}", f"{3:016x}"))
    for path in (own, foreign, young):
        path.write_bytes(b"half of it")
    folder.mkdir()
    for path in (own, foreign, folder):
        os.utime(path, (1.0, 1.0))
    sweep_unfinished(tmp_path)
    assert not own.exists()
    assert foreign.exists() and young.exists() and folder.exists()
    sweep_unfinished(tmp_path / "absent")


def test_colour_order_is_rgb(tmp_path: Path) -> None:
    red = np.zeros((4, 6, 3), np.uint8)
    red[:, :, 2] = 255  # OpenCV writes blue first
    cv2.imwrite(str(tmp_path / "red.png"), red)
    assert read_image(tmp_path / "red.png")[0, 0].tolist() == [255, 0, 0]


@pytest.mark.parametrize(
    "pixels",
    [
        np.full((5, 7), 255, np.uint8),
        np.full((5, 7), 65535, np.uint16),
        np.full((5, 7), 4095, np.uint16),
        np.full((5, 7, 1), 255, np.uint8),
        np.full((5, 7, 3), 65535, np.uint16),
        np.full((5, 7, 4), 255, np.uint8),
        np.ones((5, 7), np.float32),
        np.ones((5, 7), bool),
    ],
)
def test_every_depth_and_channel_count_becomes_rgb8(pixels: np.ndarray) -> None:
    image = to_rgb8(pixels)
    assert image.shape == (5, 7, 3)
    assert image.dtype == np.uint8
    assert image.min() == 255


def test_16_bit_file_keeps_its_greys(tmp_path: Path) -> None:
    ramp = np.linspace(0, 65535, 256).astype(np.uint16)[None].repeat(4, axis=0)
    cv2.imwrite(str(tmp_path / "ramp.png"), ramp)
    assert np.abs(read_image(tmp_path / "ramp.png")[0, :, 0].astype(int) - np.arange(256)).max() <= 1


def test_nan_pixels_become_black() -> None:
    assert to_rgb8(np.full((2, 2), np.nan)).max() == 0


def _picture(path: Path) -> bytes:
    rng = np.random.default_rng(0)
    cv2.imwrite(str(path), rng.integers(0, 255, (60, 80, 3), np.uint8))
    return path.read_bytes()


@pytest.mark.parametrize("ending", ["png", "jpg"])
def test_a_cut_file_is_refused_and_not_half_shown(tmp_path: Path, ending: str) -> None:
    data = _picture(tmp_path / f"whole.{ending}")
    cut = tmp_path / f"cut.{ending}"
    for share in (0.02, 0.5, 0.95):
        cut.write_bytes(data[: int(len(data) * share)])
        with pytest.raises(ImageError, match=f"cut.{ending}"):
            read_image(cut)


def test_empty_missing_and_foreign_files_are_named(tmp_path: Path) -> None:
    (tmp_path / "empty.png").write_bytes(b"")
    (tmp_path / "text.png").write_text("not a picture")
    for name, words in (("empty.png", "empty"), ("none.png", "cannot be read"), ("text.png", "not a picture")):
        with pytest.raises(ImageError, match=words):
            read_image(tmp_path / name)
    with pytest.raises(ImageError, match="cannot be read"):
        read_image(tmp_path)


@pytest.mark.parametrize(("value", "grey"), [(300, 75), (1023, 255), (1100, 68), (4095, 255), (4200, 16), (65535, 255)])
def test_16_bit_pictures_are_scaled_by_their_sensors_range(value: int, grey: int) -> None:
    """10, 12 or 16 bit; never by their own brightest pixel, which would make a dark picture white."""
    assert to_rgb8(np.full((40, 50), value, np.uint16))[0, 0].tolist() == [grey] * 3


def _segment(marker: int, content: bytes) -> bytes:
    return bytes((0xFF, marker)) + struct.pack(">H", len(content) + 2) + content


def test_a_picture_is_turned_upright_as_its_exif_says(tmp_path: Path) -> None:
    left_white = np.zeros((40, 80), np.uint8)
    left_white[:, :40] = 255
    cv2.imwrite(str(tmp_path / "plain.jpg"), left_white)
    data = (tmp_path / "plain.jpg").read_bytes()
    orientation_6 = struct.pack("<2sHI H HHIHH I", b"II", 42, 8, 1, 0x0112, 3, 1, 6, 0, 0)  # turn clockwise to see it upright
    (tmp_path / "turned.jpg").write_bytes(data[:2] + _segment(0xE1, b"Exif\0\0" + orientation_6) + data[2:])
    image = read_image(tmp_path / "turned.jpg")
    assert image.shape == (80, 40, 3)
    assert image[10, 20, 0] > 250
    assert image[70, 20, 0] < 5


def _png_header(width: int, height: int) -> bytes:
    header = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header)) + bytes(8) + b"IEND"


@pytest.mark.parametrize(
    "data",
    [
        _png_header(22_000, 22_000),
        b"\xff\xd8" + _segment(0xE0, bytes(14)) + _segment(0xC2, struct.pack(">BHHB", 8, 22_000, 22_000, 1)) + b"\xff\xda\xff\xd9",
        b"BM" + bytes(12) + struct.pack("<Iii", 40, 22_000, -22_000) + bytes(40),
    ],
)
def test_a_picture_far_too_large_is_refused_by_its_header(tmp_path: Path, data: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    (tmp_path / "huge").write_bytes(data)
    with pytest.raises(ImageError, match="22000x22000 is larger than 120 million pixels"):
        read_image(tmp_path / "huge")
