"""One contract for every camera that needs no device, and what is special to each."""

import contextlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from core.config.models import TwinConfig
from core.devices import Camera, DamagedPicture, DamagedStream, DeviceError, EndOfStream
from core.types import Image
from hardware.cameras import files
from hardware.cameras.files import ImageFolder, VideoFile
from hardware.cameras.live import LiveCamera
from hardware.cameras.realsense import realsense_camera
from hardware.cameras.webcam import WebcamSensor
from hardware.twin.world import TwinCamera, TwinWorld
from tests.core.drawing import film
from tests.hardware.soft_cameras import CONFIG as SOFT
from tests.hardware.soft_cameras import SoftRealSense, SoftWebcam


def _noise(count: int) -> Iterator[Image]:
    return (np.random.default_rng(index).integers(0, 255, (48, 64, 3), np.uint8) for index in range(count))


def _video(path: Path, frames: int = 12, rate: int = 30, **options: str) -> Path:
    return film(path, _noise(frames), rate=rate, **options)


def _pictures(folder: Path) -> Path:
    folder.mkdir()
    for index in range(3):
        cv2.imwrite(str(folder / f"{index}.png"), np.full((48, 64, 3), 80 * index, np.uint8))
    (folder / "notes.txt").write_text("not a picture")
    (folder / "1b.png").write_bytes(b"broken")
    return folder


def _twin(_: Path, __: ExitStack) -> Camera:
    return TwinCamera(TwinWorld(TwinConfig(phantom="s_curve", image_width_px=160, image_height_px=120)), lock_step=True)


def _realsense(_: Path, undo: ExitStack) -> Camera:
    return realsense_camera(SOFT, undo.enter_context(SoftRealSense()).context)


def _webcam(folder: Path, undo: ExitStack) -> Camera:
    soft = SoftWebcam(folder, undo.enter_context(pytest.MonkeyPatch.context()))
    return LiveCamera(WebcamSensor(SOFT, soft.open_capture), SOFT)


MAKERS: dict[str, Callable[[Path, ExitStack], Camera]] = {
    "video paced": lambda folder, _: VideoFile(_video(folder / "v.mp4")),
    "video unpaced": lambda folder, _: VideoFile(_video(folder / "v.mp4"), paced=False),
    "image folder": lambda folder, _: ImageFolder(_pictures(folder / "pictures"), period_s=0.01),
    "RealSense": _realsense,
    "webcam": _webcam,
    "twin": _twin,
}


@pytest.mark.parametrize("kind", MAKERS)
def test_contract(kind: str, tmp_path: Path) -> None:
    with ExitStack() as undo:
        camera = MAKERS[kind](tmp_path, undo)
        assert camera.name
        camera.open()
        try:
            frames = []
            while len(frames) < 3:
                frame = camera.read(1.0)
                if frame is not None:
                    frames.append(frame)
        finally:
            camera.close()
        camera.close()  # closing twice does no harm
    for before, after in zip(frames, frames[1:], strict=False):
        assert after.index > before.index
        assert after.captured_s >= before.captured_s
    for frame in frames:
        assert frame.image.dtype == np.uint8
        assert frame.image.ndim == 3
        assert frame.image.shape[2] == 3
        assert frame.image.flags.c_contiguous
        assert frame.lost == 0 or kind in {"RealSense", "webcam"}  # a machine that stands still for a moment loses some
    assert len({frame.image.ctypes.data for frame in frames}) == 3  # nobody writes to a picture once it was given


def test_an_unpaced_video_gives_every_frame_and_then_its_end(tmp_path: Path) -> None:
    video = VideoFile(_video(tmp_path / "v.mp4", 7), paced=False)
    video.open()
    times = []
    with pytest.raises(EndOfStream, match="end of the video"):
        while True:
            frame = video.read(0.0)
            times.append(frame.captured_s)
    video.close()
    np.testing.assert_allclose(times, np.arange(7) / 30, atol=1e-3)


def _ends(path: Path) -> tuple[int, EndOfStream]:
    """How many frames come, damaged ones too, and how they end."""
    video = VideoFile(path, paced=False)
    video.open()
    count = 0
    with pytest.raises(EndOfStream) as end:
        while True:
            with contextlib.suppress(DamagedPicture):
                assert video.read(0.0) is not None
            count += 1
    video.close()
    return count, end.value


def test_a_whole_video_in_a_fine_clock_is_not_cut(tmp_path: Path) -> None:
    """An AVI counts the ticks of its clock, not its pictures."""
    path = tmp_path / "fine.avi"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=1000)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuvj420p"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 1000)
        for index in range(20):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 10 * index, np.uint8), format="rgb24")
            frame.pts, frame.time_base = 33 * index, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    count, end = _ends(path)
    assert (count, isinstance(end, DamagedStream)) == (20, False)


@pytest.mark.parametrize("name", ["v.mp4", "v.avi"])
def test_a_cut_video_that_knows_its_length_says_that_it_is_cut(tmp_path: Path, name: str) -> None:
    path = _video(tmp_path / name, 40, movflags="faststart")  # so that it can be opened when its end is cut off
    count, end = _ends(path)
    assert (count, isinstance(end, DamagedStream)) == (40, False)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 6 // 10])
    count, end = _ends(path)
    assert 10 < count < 30
    assert isinstance(end, DamagedStream)
    assert str(end) == f"{path}: cut short: {count} of 40 pictures"


def test_a_cut_video_that_knows_its_time_alone_says_so_when_much_is_lacking(tmp_path: Path) -> None:
    path = _video(tmp_path / "v.mkv", 90)
    assert not isinstance(_ends(path)[1], DamagedStream)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert str(_ends(path)[1]).endswith(" of 3.0 s")


def _h264(path: Path, frames: int = 40, broken: int | None = None, aspect: Fraction | None = None) -> Path:
    """With a key picture every ten; one packet has other bytes than were written."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"g": "10", "bf": "0", "sc_threshold": "0"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        if aspect is not None:
            stream.sample_aspect_ratio = aspect
        packets = []
        for image in _noise(frames):
            packets += stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24"))
        for index, packet in enumerate(packets + stream.encode()):
            if index == broken:
                data = bytes(packet)
                other = av.Packet(data[:5] + bytes(value ^ 0x5A for value in data[5:]))
                other.pts, other.dts, other.time_base, other.stream = packet.pts, packet.dts, packet.time_base, stream
                container.mux(other)
            else:
                container.mux(packet)
    return path


def test_a_damaged_picture_and_what_builds_on_it_are_named_and_the_rest_goes_on(tmp_path: Path) -> None:
    video = VideoFile(_h264(tmp_path / "v.mp4", broken=13), paced=False)
    video.open()
    whole: list[int] = []
    damaged: list[str] = []
    with pytest.raises(EndOfStream, match="end of the video"):
        while True:
            try:
                frame = video.read(0.0)
            except DamagedPicture as error:
                damaged.append(str(error))
            else:
                whole.append(frame.index)
    video.close()
    assert whole == [*range(13), *range(20, 40)]
    assert damaged == [f"{tmp_path / 'v.mp4'}: picture {index} is damaged" for index in range(13, 20)]


def test_damaged_pictures_are_lost_to_a_window(tmp_path: Path) -> None:
    video = VideoFile(_h264(tmp_path / "v.mp4", broken=13))
    video.open()
    lost: list[int] = []
    with pytest.raises(EndOfStream):
        while True:
            if (frame := video.read(1.0)) is not None:
                lost.append(frame.lost)
    video.close()
    assert (lost[0], lost[-1]) == (0, 7)


def test_a_trimmed_video_is_whole(tmp_path: Path) -> None:
    """It still counts the pictures before its beginning, which are not shown."""
    with av.open(str(_video(tmp_path / "v.mp4", 40))) as whole, av.open(str(tmp_path / "trimmed.mp4"), "w") as trimmed:
        source = whole.streams.video[0]
        target = trimmed.add_stream_from_template(source)
        for packet in whole.demux(source):
            if packet.pts is not None and packet.dts is not None:
                early = round(0.5 / packet.time_base)
                packet.pts, packet.dts, packet.stream = packet.pts - early, packet.dts - early, target
                trimmed.mux(packet)
    count, end = _ends(tmp_path / "trimmed.mp4")
    assert 20 < count < 30
    assert not isinstance(end, DamagedStream)


class _Clock:
    """Time that passes only when somebody sleeps or decodes."""

    now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, wait_s: float) -> None:
        assert wait_s >= 0.0
        self.now_s += wait_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> _Clock:
    clock = _Clock()
    monkeypatch.setattr(files, "time", clock)
    return clock


def _decoding_takes(seconds: float, video: VideoFile, clock: _Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    decode = video._decode

    def slowly() -> tuple[av.VideoFrame, float]:
        clock.now_s += seconds
        return decode()

    monkeypatch.setattr(video, "_decode", slowly)


def test_a_video_that_decodes_too_slowly_is_played_slower(tmp_path: Path, clock: _Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    video = VideoFile(_video(tmp_path / "v.mp4", 30))
    video.open()
    _decoding_takes(0.3, video, clock, monkeypatch)
    seen = []
    for _ in range(5):
        before_s = clock.now_s
        frame = video.read(0.5)
        assert clock.now_s - before_s <= 0.5 + 0.3 + 1e-6  # the time asked for, and a frame that was begun in it
        seen.append(frame.index)
    video.close()
    assert seen == sorted(set(seen))


def test_late_frames_are_skipped_and_early_ones_waited_for(tmp_path: Path, clock: _Clock) -> None:
    video = VideoFile(_video(tmp_path / "v.mp4", 30))
    video.open()
    first = video.read(1.0)
    clock.now_s += 0.5
    after = video.read(1.0)
    following = video.read(1.0)
    video.close()
    assert after.index == 12  # due 0.4 s after the first one: 0.1 s late, less a rounding error
    assert following.captured_s - first.captured_s == pytest.approx(13 / 30), "when it was due, not when it was handed out"


def test_a_file_without_pictures_in_it_is_closed_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        sound.sample_rate = 44100
        container.mux(stream.encode(sound))
        container.mux(stream.encode())
    opened = []
    really_open = av.open
    monkeypatch.setattr(av, "open", lambda *name, **how: opened.append(really_open(*name, **how)) or opened[-1])
    with pytest.raises(DeviceError, match="has no video in it"):
        VideoFile(path).open()
    with pytest.raises(AssertionError, match="not open"):
        next(opened[0].demux())


def test_damage_is_told_from_the_end_by_its_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> Iterator[av.VideoFrame]:
        yield from ()
        raise av.error.InvalidDataError(1, "invalid data")

    video = VideoFile(_video(tmp_path / "v.mp4", 3), paced=False)
    video.open()
    monkeypatch.setattr(video, "_frames", broken())
    with pytest.raises(DamagedStream, match="damaged before its first frame"):
        video.read(0.0)
    video.close()


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
