"""What `perceive` is given, picture by picture."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from core.devices import DamagedStream
from core.types import Frame
from hardware.cameras.files import VideoFile
from hardware.cameras.picture_files import own_stems, pictures
from tests.core.drawing import film, greys
from tests.core.session_data import record, tick_of


def video(path: Path, frames: int = 4) -> Path:
    return film(path, greys(40 * index for index in range(frames)))


def test_a_video_named_damaged_is_not_damaged(tmp_path: Path) -> None:
    found = list(pictures([video(tmp_path / "damaged_catheter.mp4")]))
    assert [picture.problem for picture in found] == [None] * 4


def test_a_picture_that_is_called_like_a_frame_of_a_video_has_a_stem_of_its_own(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "v_000002.png"), np.full((48, 64, 3), 90, np.uint8))
    cv2.imwrite(str(tmp_path / "w_000002.png"), np.full((48, 64, 3), 90, np.uint8))
    files = [video(tmp_path / "v.mp4"), tmp_path / "v_000002.png", tmp_path / "w_000002.png"]
    for order in (files, files[::-1]):
        stems = sorted(picture.stem for picture in pictures(order))
        assert stems == ["v_000000", "v_000001", "v_000002", "v_000002_2", "v_000003", "w_000002"]


def test_a_number_makes_no_other_files_stem() -> None:
    assert own_stems([Path("a.jpg"), Path("a.png"), Path("a_2.png")]) == ["a", "a_3", "a_2"]
    assert own_stems([Path("x/a.png"), Path("y/a_2.png"), Path("y/a.png")]) == ["a", "a_2", "a_3"]


def test_a_picture_that_is_called_like_a_frame_of_a_numbered_video_is_numbered_too() -> None:
    files = [Path("clip_2_000000.png"), Path("clip.mkv"), Path("clip.mp4")]
    for order in (files, files[::-1]):
        stems = dict(zip(order, own_stems(order), strict=True))
        assert stems[files[0]] == "clip_2_000000_2"
        assert {stems[files[1]], stems[files[2]]} == {"clip", "clip_2"}


def test_a_picture_is_called_by_its_real_stem(tmp_path: Path) -> None:
    for name in ("a.jpg", "a.png", "b#1.png"):
        cv2.imwrite(str(tmp_path / name), np.full((48, 64, 3), 90, np.uint8))
    files = [tmp_path / "a.jpg", tmp_path / "a.png", tmp_path / "b#1.png", video(tmp_path / "v.mp4", 1)]
    assert [(one.stem, one.real_stems) for one in pictures(files)] == [
        ("a", ("a",)),
        ("a_2", ("a",)),
        ("b#1", ("b#1",)),
        ("v_000000", ("v_000000", "v")),
    ]


def test_the_damaged_picture_of_a_session_is_a_problem_though_its_decoder_shows_something(tmp_path: Path) -> None:
    session = record(tmp_path, [tick_of(index, 1000.0 + index / 30.0) for index in range(40)])
    path = session / "video_0000.mkv"
    data = bytearray(path.read_bytes())
    with av.open(str(path)) as container:
        packets = [packet for packet in container.demux() if packet.size]
    at = bytes(data).index(bytes(packets[33]))
    data[at + packets[33].size // 2] ^= 1
    path.write_bytes(data)
    found = list(pictures([path]))
    assert len(found) == 40
    assert next(place for place, one in enumerate(found) if one.image is None) == 33
    assert found[33].problem == f"{path}: picture 33 is lost or damaged"
    assert found[0].time_s == 0.0
    assert found[1].stem == "video_0000_000001"


def test_a_video_that_breaks_off_says_so_after_its_last_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = VideoFile.read

    def read_two(self: VideoFile, timeout_s: float) -> Frame | None:
        if self._index == 1:
            raise DamagedStream("clip.mp4: broken")
        return read(self, timeout_s)

    monkeypatch.setattr(VideoFile, "read", read_two)
    found = list(pictures([video(tmp_path / "clip.mp4")]))
    assert [picture.problem for picture in found] == [None, None, "clip.mp4: broken"]
    assert found[-1].image is None
