"""Opens videos to read."""

from __future__ import annotations

from pathlib import Path

import av
from av.container import InputContainer


def open_video(path: Path) -> InputContainer:
    """A container to read from; raises av.error.FFmpegError or OSError for what is none.

    Titles and tags are decoded when it is opened; a flipped bit in one of them must not cost the pictures.
    """
    return av.open(str(path), metadata_errors="replace")
