"""Masks for the tests: drawn with characters where the answer is counted by hand, as tubes where it is known by construction."""

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from core import geometry
from core.types import Image, Mask, Masks, Point, Points

SIZE = (640, 480)


def art(picture: str) -> Mask:
    """'#' is set, everything else is not; the first and last line break are dropped."""
    return np.array([[character == "#" for character in line] for line in picture.strip("\n").split("\n")])


def picture(mask: Mask) -> str:
    return "\n".join("".join(".#"[int(value)] for value in row) for row in mask)


def depth(line: Points, radius: float, size: tuple[int, int] = SIZE) -> np.ndarray:
    """How deep each pixel lies in a tube with flat ends around a polyline, in px; negative outside. Shape (h, w)."""
    points = geometry.resample(np.asarray(line, np.float64), 0.5)
    reach = 2 * radius + 2  # what lies further away is so far outside that it does not matter how far
    near = np.zeros((size[1], size[0]), np.uint8)
    cv2.polylines(near, [np.round(points).astype(np.int32)], isClosed=False, color=1, thickness=2 * int(reach) + 3)
    y, x = np.nonzero(near)
    inside = radius - cKDTree(points).query(np.column_stack([x, y]), distance_upper_bound=reach)[0]
    for end, inner in ((points[-1], points[-7]), (points[0], points[6])):
        out = (end - inner) / np.hypot(*(end - inner))
        beyond = (x - end[0]) * out[0] + (y - end[1]) * out[1]
        close = np.hypot(x - end[0], y - end[1]) < 3 * radius + 2
        inside[close] = np.minimum(inside, -beyond)[close]
    deep = np.full((size[1], size[0]), -np.inf)
    deep[y, x] = inside
    return deep


def probability(*depths: np.ndarray) -> np.ndarray:
    """What a network would give for the union of some tubes: 0.5 on the edge, soft over a pixel or two."""
    return (1.0 / (1.0 + np.exp(-2.0 * np.maximum.reduce(depths)))).astype(np.float32)


def masks_of(vessel: np.ndarray, robot: np.ndarray) -> Masks:
    """Masks of two probability maps, thresholded at 0.5 and not cleaned."""
    return Masks(vessel >= 0.5, robot >= 0.5, vessel, robot)


def everywhere(size: tuple[int, int] = SIZE) -> np.ndarray:
    """A vessel that fills the image."""
    return np.ones((size[1], size[0]), np.float32)


def direction(angle_deg: float) -> Point:
    """Unit vector, degrees from right to down."""
    return float(np.cos(np.radians(angle_deg))), float(np.sin(np.radians(angle_deg)))


def curve(*points: tuple[float, float]) -> Points:
    """A smooth line through some points, a point every px."""
    corners = np.asarray(points, np.float64)
    along = geometry.arc_length(corners)
    return geometry.resample(CubicSpline(along, corners)(np.linspace(0.0, along[-1], 400)), 1.0)


def film(
    path: Path, images: Iterable[Image], codec: str = "mpeg4", rate: int = 30, *, quantizer: int | None = None, **options: str
) -> Path:
    """A video of pictures; `options` are the container's (``movflags``) or the encoder's."""
    import av

    first, *rest = images
    with av.open(str(path), "w", options={key: options.pop(key) for key in ("movflags",) if key in options}) as container:
        stream = container.add_stream(codec, rate=rate, options=options)
        stream.height, stream.width, stream.pix_fmt = *first.shape[:2], "yuv420p"
        if quantizer is not None:
            stream.codec_context.qmin = stream.codec_context.qmax = quantizer
        for image in (first, *rest):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode(None))
    return path


def greys(levels: Iterable[int]) -> Iterable[Image]:
    """Pictures of 64x48 pixels, of one grey each."""
    return (np.full((48, 64, 3), level, np.uint8) for level in levels)
