"""What is computed, without Qt and without devices."""

import os

MAX_PIXELS = 120_000_000
"""8k (33 million pixels) passes easily; far beyond it a file is rather damaged or hostile than a photograph."""

# OpenCV reads this when it is loaded, and any part of this program is loaded before that: a small file that says that it is a huge
# picture is refused before it takes gigabytes.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PIXELS))
