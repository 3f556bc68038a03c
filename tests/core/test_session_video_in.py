"""A video with a damaged tag is a video."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest

from core.session.video_in import open_video


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
