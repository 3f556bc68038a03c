"""One contract for every camera that needs no device, and what is special to each."""

from collections.abc import Callable
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from core.config import TwinConfig
from core.devices import Camera, DeviceError, EndOfStream
from hardware.cameras.image_folder import ImageFolder
from hardware.cameras.video_file import VideoFile
from hardware.twin.camera import TwinCamera
from hardware.twin.world import TwinWorld


def _video(path: Path, frames: int = 12, rate: int = 30) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=rate)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for index in range(frames):
            image = np.random.default_rng(index).integers(0, 255, (48, 64, 3), np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
    return path


def _pictures(folder: Path) -> Path:
    folder.mkdir()
    for index in range(3):
        cv2.imwrite(str(folder / f"{index}.png"), np.full((48, 64, 3), 80 * index, np.uint8))
    (folder / "notes.txt").write_text("not a picture")
    (folder / "1b.png").write_bytes(b"broken")
    return folder


def _twin(_: Path) -> Camera:
    return TwinCamera(TwinWorld(TwinConfig(phantom="s_curve", image_width_px=160, image_height_px=120)), lock_step=True)


MAKERS: dict[str, Callable[[Path], Camera]] = {
    "video paced": lambda folder: VideoFile(_video(folder / "v.mp4")),
    "video unpaced": lambda folder: VideoFile(_video(folder / "v.mp4"), paced=False),
    "image folder": lambda folder: ImageFolder(_pictures(folder / "pictures"), period_s=0.01),
    "twin": _twin,
}


@pytest.mark.parametrize("kind", MAKERS)
def test_contract(kind: str, tmp_path: Path) -> None:
    camera = MAKERS[kind](tmp_path)
    assert camera.name
    assert isinstance(camera.is_live, bool)
    camera.open()
    try:
        frames = []
        while len(frames) < 3:
            frame = camera.read(1.0)
            if frame is not None:
                frames.append(frame)
    finally:
        camera.close()
    for before, after in zip(frames, frames[1:], strict=False):
        assert after.index > before.index
        assert after.captured_s >= before.captured_s
    for frame in frames:
        assert frame.image.dtype == np.uint8
        assert frame.image.ndim == 3
        assert frame.image.shape[2] == 3
    camera.close()  # closing twice does no harm


def test_an_unpaced_video_gives_every_frame_and_then_its_end(tmp_path: Path) -> None:
    video = VideoFile(_video(tmp_path / "v.mp4", 7), paced=False)
    video.open()
    times = []
    with pytest.raises(EndOfStream, match="end of the video"):
        while True:
            frame = video.read(0.0)
            assert frame is not None
            times.append(frame.captured_s)
    video.close()
    np.testing.assert_allclose(times, np.arange(7) / 30, atol=1e-3)


def test_a_cut_video_gives_what_is_there(tmp_path: Path) -> None:
    path = _video(tmp_path / "v.mkv", 40)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    video = VideoFile(path, paced=False)
    video.open()
    count = 0
    with pytest.raises(EndOfStream):
        while True:
            assert video.read(0.0) is not None
            count += 1
    video.close()
    assert 0 < count < 40


@pytest.mark.parametrize("content", [b"", b"not a video at all"])
def test_a_foreign_file_is_one_clear_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "v.mp4"
    path.write_bytes(content)
    with pytest.raises(DeviceError, match=r"v\.mp4: cannot be read as a video"):
        VideoFile(path).open()
    with pytest.raises(DeviceError, match=r"gone\.mp4"):
        VideoFile(tmp_path / "gone.mp4").open()


def test_the_last_picture_stays_and_broken_ones_are_skipped(tmp_path: Path) -> None:
    camera = ImageFolder(_pictures(tmp_path / "pictures"), period_s=0.0)
    camera.open()
    values = [int(frame.image[0, 0, 0]) for frame in (camera.read(1.0) for _ in range(5)) if frame]
    camera.close()
    assert values == [0, 80, 160, 160, 160]


def test_a_folder_without_pictures_says_so(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="no picture there"):
        ImageFolder(tmp_path).open()
    (tmp_path / "x.png").write_bytes(b"broken")
    with pytest.raises(DeviceError, match="none of 1 pictures can be read"):
        ImageFolder(tmp_path).open()
