"""How large a picture may be, known before OpenCV is loaded."""

from __future__ import annotations

import os

MAX_PIXELS = 120_000_000
"""8k (33 million pixels) passes easily; far beyond it a file is rather damaged or hostile than a photograph."""


def limit_pictures() -> None:
    """Let OpenCV refuse larger pictures before it decodes them: a small file may say that it is huge, and takes gigabytes.

    To be called before OpenCV is loaded; the program's other processes inherit it.
    """
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
