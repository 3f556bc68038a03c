"""What `perceive` is given, picture by picture."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest

from app.sources import pictures
from core.devices import DamagedStream
from core.types import Frame
from hardware.cameras.video_file import VideoFile


def video(path: Path, frames: int = 4) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for index in range(frames):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.full((48, 64, 3), 40 * index, np.uint8), format="rgb24")))
        container.mux(stream.encode())
    return path


def test_a_video_named_damaged_is_not_damaged(tmp_path: Path) -> None:
    found = list(pictures([video(tmp_path / "damaged_catheter.mp4")]))
    assert [picture.problem for picture in found] == [None] * 4


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
