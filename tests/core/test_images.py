from pathlib import Path

import cv2
import numpy as np
import pytest

from core.images import ImageError, read_image, to_rgb8


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


def test_an_8k_picture_is_read(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "8k.jpg"), np.full((4320, 7680, 3), 90, np.uint8))
    assert read_image(tmp_path / "8k.jpg").shape == (4320, 7680, 3)
