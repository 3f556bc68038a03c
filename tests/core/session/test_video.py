"""Videos of other programs: damaged tags, odd orders, odd shapes, pictures that are turned or mirrored."""

import struct
from pathlib import Path

import av
import numpy as np
import pytest

from app.annotator.sources import extract_frames
from core.annotation.model import AnnotationError
from core.devices import DamagedPicture, DeviceError, EndOfStream
from core.files import read_image
from core.session.video import open_video
from hardware.cameras.files import VideoFile
from tests.core.drawing import film, greys


def test_a_damaged_title_costs_no_picture(tmp_path: Path) -> None:
    path = tmp_path / "titled.mkv"
    with av.open(str(path), "w", format="matroska") as container:
        container.metadata["title"] = "phantom one"
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for _ in range(3):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8), format="rgb24")))
        container.mux(stream.encode(None))
    data = path.read_bytes()
    assert b"phantom one" in data
    path.write_bytes(data.replace(b"phantom one", b"phantom \xa3ne"))
    with pytest.raises(UnicodeDecodeError):
        av.open(str(path))
    with open_video(path) as container:
        assert len(list(container.decode(video=0))) == 3


def cornered(path: Path, frames: int = 12) -> Path:
    """Pictures of one grey each, brighter one by one, with a white corner (the upper left one)."""
    images = list(greys(10 + 15 * index for index in range(frames)))
    for image in images:
        image[:8, :8] = 255
    return film(path, images, "libx264", 10)


def film_of_greys(path: Path, codec: str, **options: str) -> Path:
    """A longer one, without a corner."""
    return film(path, greys(10 + 8 * index for index in range(30)), codec, 10, quantizer=2, **options)


@pytest.mark.parametrize(
    ("codec", "more"), [("libx264", {"flags": "-cgop", "x264-params": "open-gop=1"}), ("libx264", {}), ("mpeg4", {})]
)
def test_every_picture_is_taken_of_an_avi_and_none_is_a_neighbours(
    codec: str, more: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = film_of_greys(tmp_path / "film.avi", codec, bf="2", g="6", **more)
    taken = extract_frames(path, range)
    assert [int(read_image(picture).mean()) for picture in taken] == pytest.approx([10 + 8 * index for index in range(30)], abs=3)
    assert "damaged" not in capsys.readouterr().err


def damage(path: Path, place: int) -> None:
    """Nothing but zeros in one packet."""
    with av.open(str(path)) as container:
        packet = [packet for packet in container.demux(video=0) if packet.size][place]
        content, position = bytes(packet), packet.pos
    data = path.read_bytes()
    begin = data.index(content, position)
    path.write_bytes(data[:begin] + bytes(len(content)) + data[begin + len(content) :])


@pytest.mark.parametrize("place", [7, 11, 12, 13, 20])
def test_damage_in_an_avi_loses_no_count_and_moves_no_whole_picture(place: int, tmp_path: Path) -> None:
    """The packets that gave no picture were passed over, and all that followed came too early."""
    path = film_of_greys(tmp_path / "film.avi", "libx264", bf="2", g="6")
    damage(path, place)
    whole: list[tuple[float, float]] = []
    damaged, video = 0, VideoFile(path, paced=False)
    video.open()
    while True:
        try:
            frame = video.read(1.0)
        except DamagedPicture:
            damaged += 1
            continue
        except EndOfStream:
            break
        whole.append((frame.captured_s, float(frame.image.mean())))
    video.close()
    assert len(whole) + damaged == 30
    assert 1 <= damaged <= 12
    assert [grey for _, grey in whole] == pytest.approx([10 + 80 * time_s for time_s, _ in whole], abs=3)


def test_a_video_that_nothing_here_can_decode_is_one_clear_line(tmp_path: Path) -> None:
    path = cornered(tmp_path / "film.mp4")
    path.write_bytes(path.read_bytes().replace(b"avc1", b"zzzz"))
    with pytest.raises(DeviceError, match=r"film\.mp4: has a video of a kind that cannot be decoded here"):
        VideoFile(path).open()
    with pytest.raises(AnnotationError, match="cannot be decoded here"):
        extract_frames(path, range)


@pytest.mark.parametrize(
    ("matrix", "corner"),
    [
        ((1, 0, 0, 1), "upper left"),
        ((0, 1, -1, 0), "upper right"),
        ((0, -1, 1, 0), "lower left"),
        ((-1, 0, 0, -1), "lower right"),
        ((-1, 0, 0, 1), "upper right"),  # mirrored, as the front cameras of telephones do
        ((1, 0, 0, -1), "lower left"),
        ((0, 1, 1, 0), "upper left"),
        ((0, -1, -1, 0), "lower right"),
    ],
)
def test_pictures_are_turned_and_mirrored_as_the_file_says(matrix: tuple[int, int, int, int], corner: str, tmp_path: Path) -> None:
    path = cornered(tmp_path / "film.mp4", 1)
    plain, one = struct.pack(">5i", 65536, 0, 0, 0, 65536), 65536
    a, b, c, d = (one * value for value in matrix)
    data = path.read_bytes()
    place = data.index(plain, data.index(b"tkhd"))
    path.write_bytes(data[:place] + struct.pack(">5i", a, b, 0, c, d) + data[place + 20 :])
    video = VideoFile(path, paced=False)
    video.open()
    frame = video.read(1.0)
    video.close()
    height, width = frame.image.shape[:2]
    assert (width, height) == ((64, 48) if matrix[0] else (48, 64))
    places = {
        "upper left": (3, 3),
        "upper right": (3, width - 4),
        "lower left": (height - 4, 3),
        "lower right": (height - 4, width - 4),
    }
    bright = [name for name, place in places.items() if frame.image[place].mean() > 200]
    assert bright == [corner]
