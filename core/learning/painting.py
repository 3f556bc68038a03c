"""Pictures of benches painted from their geometry: any board, tube and robot, and the same bench without the robot.

A bench is given by two maps of its vessel, the distance to the wall and the ratio of the distance to the centerline and the radius.
All else is drawn at random, so that a network does not learn the paint of one simulator. ``exposed`` makes of such a picture what a
camera sees at one moment. Pictures are float32 (3, h, w), RGB of 0..1, as in ``boards``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from core.learning.boards import (
    F32,
    Size,
    filled,
    lay_cable,
    lay_over,
    paint_board,
    random_color,
    random_curve,
    smooth_noise,
    stroke,
)
from core.types import Mask, Points

Levels = NDArray[np.uint8]
"""A picture (3, h, w) of whole levels."""
Range = tuple[float, float]
"""Least and greatest value, drawn evenly between them."""


@dataclass(frozen=True, slots=True)
class Tube:
    """How tubes of a kind look.

    Attributes
    ----------
    share : of the benches.
    fill : opacity of what fills the lumen.
    fill_by_depth : share of this opacity that follows the lumen's depth: none is a flat band, 1 fades towards the walls.
    wall : opacity of the walls.
    veil_share, veil : share of the benches in which it lies before the robot, too, and its opacity there.
    shades : share that throws a shadow on the board.
    refracts : share that bends what is seen through it.
    """

    share: float
    fill: Range
    fill_by_depth: Range
    wall: Range = (0.0, 0.7)
    veil_share: float = 0.3
    veil: Range = (0.0, 0.25)
    shades: float = 0.0
    refracts: float = 0.0


XRAY = "xray"
"""The kind that is seen by absorption: no walls, lamps or colours."""
TUBES = {
    "clear": Tube(0.22, (0.0, 0.18), (1, 1), (0.05, 0.9), shades=0.55, refracts=0.6),
    "milky": Tube(0.20, (0.25, 0.92), (0, 1), veil_share=1.0, veil=(0, 0.55), shades=0.55, refracts=0.6),
    "channel": Tube(0.17, (0.05, 0.6), (0, 1), (0.05, 0.9)),
    XRAY: Tube(0.16, (0, 0), (1, 1), (0, 0)),
    "solid": Tube(0.08, (0.7, 1), (0, 0), veil_share=1.0, veil=(0, 0.55)),
    "liquid": Tube(0.10, (0.15, 0.7), (0.3, 1), veil_share=1.0, veil=(0, 0.55), shades=0.55, refracts=0.6),
    "faint": Tube(0.07, (0.02, 0.1), (0, 0), (0.15, 0.9), shades=0.55),
}
WALL_STYLES = {"band": 0.35, "lines": 0.4, "inner": 0.25}
"""A wall of its own tone with an outer line; two lines; the inner line alone."""
_CLEAR = 0.25
"""Opacity below which a wall is a lens: the lumen seems to reach the outer line, and a label further in would lie at no edge."""
PATTERNS = {"plain": 0.5, "rings": 0.2, "coil": 0.15, "bands": 0.15}
"""Share of the robots with each pattern. Rings may be near the tip alone; bands always are."""
_REFLECTIONS = (0.25, 0.3, 0.2, 0.15, 0.1)
"""Share of the benches with 0, 1, ... bright lines along the tube, which a network may take for a robot."""
_BESIDE_WALL, _UNBROKEN = 0.4, 0.4
"""Share of these lines that lie at 0.55 to 0.95 of the radius, where a network may take them for the wall, and without gaps."""
_RIMS = 0.4
"""Share of the benches whose lumen is darker or brighter from 0.5 to 0.92 of the radius on: a round tube of liquid bends light."""
_CLIPS = (0.7, 0.22, 0.08)
"""Share of the benches with 0, 1, ... clips over the tube."""
_CABLES = 0.3
"""Share of the benches with a cable or two that stay where they are."""
_UNEVEN_LIGHT = 0.6
"""Share of the benches with a lamp that does not reach everything alike."""
_REFRACTION_PX = 6.0
"""Shift of what is seen at the wall of a tube that refracts, times -0.6 to 0.8."""
_COLOR_TRIES = 12
"""Colours that are drawn until a robot stands out from what lies below it."""
_TIPS, _TIP_PX = 0.5, (2.0, 60.0)
"""Share of the robots with a tip of another colour, and its length: as often one of some pixels as a long one."""
_JACKETS = 0.2
"""Share of the robots with a core of one colour in a jacket of another one, or of a darker one."""
_FADING = 0.5
"""Share of the robots in X-rays whose body grows darker or fainter away from the tip."""
_SHEATHED, _SHEATH_RADII, _SHEATH_BEGINS_PX = 0.35, (1.15, 2.4), (15.0, 400.0)
"""Share of the robots that come out of a catheter, its radius over theirs, and the robot's length before it."""
_STEP_PX = 0.4
"""Distance of the points on a robot's line."""
_GRAINS = np.array([NormalDist().inv_cdf((level + 0.5) / 256) for level in range(256)], np.float32)
"""Normal noise for a random byte: five times as fast as NumPy's."""


def drawn(rng: Generator, shares: dict[str, float]) -> str:
    """A key, drawn with its share."""
    return str(rng.choice(list(shares), p=list(shares.values())))


def _between(rng: Generator, limits: Range) -> float:
    return float(rng.uniform(*limits))


def blurred(picture: F32, sigma_px: float) -> F32:
    """Every plane of (3, h, w) blurred."""
    return np.stack([cv2.GaussianBlur(plane, (0, 0), sigma_px) for plane in picture])


@dataclass(frozen=True, slots=True, eq=False)
class _Surface:
    """Geometry of a vessel in a picture, arrays (h, w).

    Attributes
    ----------
    distance_px : signed distance to the wall, negative inside.
    ratio : distance to the centerline over the radius, 1 at the wall.
    inside : 0..1, with soft edges.
    normal_x, normal_y : unit vector away from the centerline.
    lamp : unit vector (x, y) to the lamp, in the picture.
    lit : cosine between both, -1..1.
    """

    distance_px: F32
    ratio: F32
    inside: F32
    normal_x: F32
    normal_y: F32
    lamp: tuple[float, float]
    lit: F32

    @classmethod
    def of(cls, rng: Generator, distance_px: F32, ratio: F32, softness: float) -> _Surface:
        smooth = cv2.GaussianBlur(distance_px, (0, 0), 1.2)
        x, y = (np.asarray(cv2.Sobel(smooth, cv2.CV_32F, *axes, scale=1 / 8), np.float32) for axes in ((1, 0), (0, 1)))
        length = cv2.magnitude(x, y) + 1e-3
        x /= length
        y /= length
        angle = rng.uniform(0, 2 * np.pi)
        lamp = float(np.cos(angle)), float(np.sin(angle))
        inside = 1 / (1 + np.exp(np.clip(distance_px * np.float32(1 / (0.35 * softness)), -30, 30)))
        return cls(distance_px, ratio, inside, x, y, lamp, x * lamp[0] + y * lamp[1])


class _Front:
    """What lies before the robot: light that passes (h, w), and light that is added (3, h, w)."""

    def __init__(self, size: Size) -> None:
        self.passes, self.adds = np.ones(size, np.float32), np.zeros((3, *size), np.float32)

    def lay(self, cover: F32, color: F32) -> None:
        """One more thing before all others: `cover` (h, w), 0..1, of a colour (3, 1, 1)."""
        self.passes *= 1 - cover
        lay_over(self.adds, cover, color)


class PaintedBench:
    """A bench, painted once; robots are painted into it for some milliseconds each.

    Parameters
    ----------
    rng : all looks are drawn from it.
    distance_px : signed distance (h, w) to the vessel's wall, negative inside.
    ratio : distance (h, w) to the centerline over the radius, 1 at the wall.
    tube, board : kinds of ``TUBES`` and ``boards.BOARDS``; None: drawn.
    """

    def __init__(self, rng: Generator, distance_px: F32, ratio: F32, tube: str | None = None, board: str | None = None) -> None:
        self.tube = tube or drawn(rng, {kind: look.share for kind, look in TUBES.items()})
        self.vessel: Mask = np.asarray(distance_px < 0)
        self.blur_px = float(rng.uniform(0, 1.2)) if rng.random() < 0.7 else 0.0
        """Of the camera, for ``exposed``."""
        look, is_xray = TUBES[self.tube], self.tube == XRAY
        softness = float(rng.uniform(0.7, 2.5) if is_xray else rng.uniform(0.5, 1.1))
        self._surface = _Surface.of(rng, distance_px, ratio, softness)
        self._fill_color = random_color(rng)
        self._veil = _between(rng, look.veil) if rng.random() < look.veil_share else 0.0
        size = distance_px.shape[0], distance_px.shape[1]
        self._front = _Front(size)
        under = paint_board(rng, size, board)
        if is_xray:
            self._under = _absorbed(rng, under, self._surface)
        else:
            if self.tube == "channel" and rng.random() < 0.7:  # a block of its own colour
                lay_over(under, np.full(size, rng.uniform(0.3, 0.95), np.float32), random_color(rng, 0.1))
            wall_px = float(rng.uniform(0.8, 5.5))
            wall = np.clip(1 - (distance_px - wall_px), 0, 1) * (1 - self._surface.inside)
            self._under = _seen_through(rng, under, self._surface, look, wall)
            self._fill(rng, look)
            if rng.random() < _RIMS:
                self._under *= _rim(rng, self._surface)
            _paint_wall(rng, self._front, self._surface, wall, wall_px, _between(rng, look.wall))
            for _ in range(int(rng.choice(len(_REFLECTIONS), p=_REFLECTIONS))):
                _paint_reflection(rng, self._front, self._surface)
        np.clip(self._under, 0, 1, out=self._under)
        self._add_objects(rng)
        self._gain = (
            np.clip(1 + smooth_noise(rng, size, 3, rng.uniform(0, 0.2)), 0.3, 1.7) if rng.random() < _UNEVEN_LIGHT else None
        )
        if self._gain is not None:
            self._front.passes *= self._gain
            self._front.adds *= self._gain

    def _fill(self, rng: Generator, look: Tube) -> None:
        """The lumen's own colour, and light and shade of its round surface."""
        surface, by_depth = self._surface, _between(rng, look.fill_by_depth)
        ratio = np.clip(surface.ratio, 0, 1)
        depth = np.sqrt(1 - ratio * ratio)
        cover = _between(rng, look.fill) * surface.inside * (1 - by_depth + by_depth * depth)
        if self.tube == "liquid" and rng.random() < 0.6:
            self._under *= 1 - cover * (1 - self._fill_color)  # a dye: it filters
        else:
            lay_over(self._under, cover, self._fill_color)
        if rng.random() < 0.8:
            self._under *= 1 + float(rng.uniform(0, 0.35)) * surface.lit * ratio * ratio * surface.inside

    def _add_objects(self, rng: Generator) -> None:
        """Clips over the tube, and cables over the board."""
        surface = self._surface
        middle = np.argwhere((np.abs(surface.ratio) < 0.3) & self.vessel)
        if len(middle) > 5:
            for _ in range(int(rng.choice(len(_CLIPS), p=_CLIPS))):
                y, x = middle[int(rng.integers(len(middle)))]
                angle = np.arctan2(surface.normal_y[y, x], surface.normal_x[y, x]) + rng.normal(0, 0.25)
                self._add_clip(rng, (float(x), float(y)), float(angle))
        if rng.random() < _CABLES:
            for _ in range(int(rng.integers(1, 3))):
                lay_cable(rng, self._under)

    def _add_clip(self, rng: Generator, middle: tuple[float, float], angle: float) -> None:
        """A rectangle or frame across the tube, with its shadow."""
        half = np.array([rng.uniform(10, 40), rng.uniform(3, 12)])
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half @ turn + middle
        cover = filled(self.vessel.shape, corners, int(rng.integers(1, 3)) if rng.random() < 0.3 else 0)
        shadow = cv2.GaussianBlur(cover, (0, 0), float(rng.uniform(1, 4)))
        self._under *= 1 - np.float32(0.35) * np.roll(shadow, rng.integers(-4, 5, 2), (0, 1))
        self._front.lay(cover * np.float32(rng.uniform(0.35, 1)), random_color(rng))

    def _seen(self, scene: F32) -> F32:
        """What is seen of a scene behind the front: `scene` is changed in place."""
        scene *= self._front.passes
        scene += self._front.adds
        return np.clip(scene, 0, 1, out=scene)

    def empty(self) -> F32:
        """The picture (3, h, w) without robot."""
        return self._seen(self._under.copy())

    def with_robot(self, rng: Generator, line_px: Points, radius_px: float, pattern: str | None = None) -> tuple[F32, Mask]:
        """The picture (3, h, w) with a robot along `line_px` (N, 2), tail -> head, and its mask (h, w).

        `pattern` is a key of ``PATTERNS``; None: drawn. A robot outside the picture leaves the mask empty.
        """
        sheath_px = radius_px * _between(rng, _SHEATH_RADII) if rng.random() < _SHEATHED else 0.0
        band = _Band.of(rng, line_px, radius_px, self.vessel.shape, max(radius_px, sheath_px) + 3)
        robot: Mask = np.zeros_like(self.vessel)
        scene = self._under.copy()
        if band is None:
            return self._seen(scene), robot
        is_xray = self.tube == XRAY
        if not is_xray and rng.random() < 0.6:
            shift = np.array(self._surface.lamp) * rng.uniform(1, 8)
            shadow = cv2.GaussianBlur(stroke(robot.shape, band.points[::3] - shift, 2 * radius_px), (0, 0), rng.uniform(0.8, 4))
            scene *= 1 - float(rng.uniform(0.05, 0.5)) * shadow
        under = scene[:, band.rows, band.columns]
        within = band.distance_px < band.radius_px
        below = under[:, within] if within.any() else under
        color = _robot_color(rng, below, self._veil, is_xray=is_xray)
        body = _robot_colors(rng, band, color, pattern or drawn(rng, PATTERNS), is_xray=is_xray)
        if not is_xray:
            _shade_robot(rng, band, body, self._surface.lamp)
        soft_px = float(rng.uniform(1, 2.5)) if is_xray and rng.random() < 0.5 else 1.0
        cover = np.clip((band.radius_px - band.distance_px) * np.float32(1 / soft_px) + np.float32(0.5), 0, 1)
        opacity = float(rng.uniform(0.5, 1)) if is_xray or rng.random() < 0.25 else 1.0
        seen = under + (np.clip(body, 0, 1) - under) * (cover * np.float32(opacity))
        if sheath_px:
            _lay_sheath(rng, band, seen, sheath_px, is_xray=is_xray)
        if self._veil:
            veil = self._veil * self._surface.inside[band.rows, band.columns] * cover
            seen += (0.5 * (self._fill_color[:, :, 0] + under) - seen) * veil
        scene[:, band.rows, band.columns] = seen
        robot[band.rows[within], band.columns[within]] = True
        return self._seen(scene), robot


def _absorbed(rng: Generator, board: F32, surface: _Surface) -> F32:
    """X-ray: a blurred grey background, and a vessel that absorbs by its depth, or is a little brighter."""
    size = surface.ratio.shape
    grey = cv2.GaussianBlur(board.mean(axis=0), (0, 0), rng.uniform(1, 6)) * np.float32(0.3) + np.float32(rng.uniform(0.35, 0.7))
    grey += smooth_noise(rng, size, 3, rng.uniform(0.01, 0.08))
    if rng.random() < 0.8:
        depth = np.sqrt(np.clip(1 - surface.ratio * surface.ratio, 0, 1))
        thick = depth * np.float32(rng.uniform(0.3, 1)) + np.float32(rng.uniform(0.1, 0.6))
        grey *= 1 - float(rng.uniform(0.06, 0.45)) * surface.inside * thick
    else:
        grey *= 1 + float(rng.uniform(0.05, 0.2)) * surface.inside
    board[:] = grey
    return board


def _seen_through(rng: Generator, board: F32, surface: _Surface, look: Tube, wall: F32) -> F32:
    """The board with the tube's shadow, and bent by the tube."""
    height, width = wall.shape
    if rng.random() < look.shades:
        away = np.array(surface.lamp) * -rng.uniform(1, 14)
        shift = np.array([[1, 0, away[0]], [0, 1, away[1]]])
        tube = np.minimum(surface.inside + wall, 1)
        shadow = cv2.warpAffine(tube, shift, (width, height), borderMode=cv2.BORDER_REPLICATE)
        shadow = cv2.GaussianBlur(shadow, (0, 0), float(rng.uniform(1, 7)))
        if rng.random() < 0.5:  # a hollow tube: darker along its sides
            shadow = np.clip(shadow - np.float32(0.6) * cv2.erode(shadow, np.ones((5, 5), np.uint8)), 0, 1)
        board *= 1 - float(rng.uniform(0.08, 0.5)) * shadow
    if rng.random() < look.refracts:
        push = np.clip(surface.ratio, 0, 1) ** 2 * np.float32(_REFRACTION_PX * rng.uniform(-0.6, 0.8)) * (surface.distance_px < 0)
        x = push * surface.normal_x + np.arange(width, dtype=np.float32)
        y = push * surface.normal_y + np.arange(height, dtype=np.float32)[:, None]
        maps = cv2.convertMaps(x, y, cv2.CV_16SC2)
        board = np.stack([cv2.remap(plane, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT) for plane in board])
    return board


def _paint_wall(rng: Generator, front: _Front, surface: _Surface, wall: F32, wall_px: float, strength: float) -> None:
    """The walls, as a band or lines, stronger on one side."""
    color, style = random_color(rng, float(rng.beta(0.6, 3))), drawn(rng, WALL_STYLES)
    one_side = 1 + surface.lit * np.float32(rng.uniform(-1, 1))
    width_px = float(rng.uniform(0.6, 1.6))

    def line(at_px: float, side: F32) -> None:
        away = (surface.distance_px - np.float32(at_px)) * np.float32(1 / width_px)
        tone = np.clip(color * np.float32(rng.uniform(0.4, 1.3)), 0, 1)
        front.lay(np.minimum(np.exp(-away * away) * np.float32(strength) * side, 1), tone)

    if style == "band":
        opacity = strength * rng.uniform(0.3, 1)
        if opacity < _CLEAR:
            wall_px = min(wall_px, 1.0)
        else:
            front.lay(np.minimum(wall * np.float32(opacity) * one_side, 1), color)
    if style != "inner":
        line(wall_px, one_side)
    if style != "band":
        line(0.0, np.maximum(2 - one_side, np.float32(0.4)))


def _rim(rng: Generator, surface: _Surface) -> F32:
    """Light (h, w) that is left of 1 or added to it beside the walls, with a sharp or soft inner edge, on both sides or on one."""
    begins, soft = float(rng.uniform(0.5, 0.92)), float(rng.uniform(0.03, 0.3))
    rim = np.clip((surface.ratio - begins) / soft, 0, 1) * surface.inside
    if rng.random() < 0.5:
        rim *= np.clip(0.5 + surface.lit * float(rng.choice((-1, 1))), 0, 1)
    return np.asarray(1 + float(rng.uniform(-0.6, 0.5)) * rim, np.float32)


def _paint_reflection(rng: Generator, front: _Front, surface: _Surface) -> None:
    """A bright line along the tube, often with gaps: in the middle, or beside a wall, on the side towards or away from the lamp."""
    at, width = float(rng.uniform(-0.9, 0.95)), float(rng.uniform(0.04, 0.16))
    if rng.random() < _BESIDE_WALL:
        at = float(rng.uniform(0.55, 0.95) * rng.choice((-1, 1)))
    away = (surface.ratio - np.float32(abs(at))) * np.float32(1 / width)
    line = np.exp(-away * away) * surface.inside
    if abs(at) > 0.12:
        line *= (surface.lit >= 0) == (at >= 0)
        line *= np.abs(surface.lit) ** np.float32(rng.uniform(0, 2))
    if rng.random() >= _UNBROKEN:
        gaps = smooth_noise(rng, surface.ratio.shape, rng.uniform(3, 14), rng.uniform(0.5, 3)) + np.float32(rng.uniform(-0.4, 1.2))
        line *= np.clip(gaps, 0, 1)
    color = 0.75 + 0.25 * random_color(rng, float(rng.beta(0.5, 6)))
    front.lay(line * np.float32(rng.uniform(0.2, 1)), color)


@dataclass(frozen=True, slots=True, eq=False)
class _Band:
    """Pixels near a robot: arrays (N,), and the line (M, 2) that it follows.

    ``side`` is the signed distance to the line over the radius, ``tangent_x`` and ``tangent_y`` the line's direction there.
    """

    points: Points
    tip_px: float
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    distance_px: F32
    radius_px: F32
    from_tip_px: F32
    side: F32
    tangent_x: F32
    tangent_y: F32

    @classmethod
    def of(cls, rng: Generator, line_px: Points, radius_px: float, size: Size, reach_px: float) -> _Band | None:
        """Measured on the line's points nearest to each pixel within `reach_px`; None where the line does not meet the picture."""
        steps = np.linalg.norm(np.diff(line_px, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        wanted = np.linspace(0.0, along[-1], max(2, int(along[-1] / _STEP_PX)))
        points = np.column_stack([np.interp(wanted, along, line_px[:, axis]) for axis in (0, 1)])
        from_tip = (along[-1] - wanted).astype(np.float32)
        tangent = np.gradient(points, axis=0)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True) + 1e-9
        tip_px = float(np.exp(rng.uniform(*np.log(_TIP_PX))))
        radius = np.full(len(points), radius_px, np.float32)
        if rng.random() < 0.3:  # a tip of another width
            radius[from_tip < tip_px] *= np.float32(rng.uniform(0.7, 1.2))
        if rng.random() < 0.3:  # a rounded or pointed end
            radius *= np.interp(from_tip, [0, 2.5 * radius_px], [rng.uniform(0.5, 1), 1]).astype(np.float32)
        nearest = _nearest(points, size, reach_px)
        if nearest is None:
            return None
        rows, columns, place = nearest
        x, y = (columns - points[place, 0]).astype(np.float32), (rows - points[place, 1]).astype(np.float32)
        tangent_x, tangent_y = (tangent[place, axis].astype(np.float32) for axis in (0, 1))
        radius = radius[place]
        side = (tangent_x * y - tangent_y * x) / np.maximum(radius, 1e-3)
        return cls(points, tip_px, rows, columns, np.hypot(x, y), radius, from_tip[place], side, tangent_x, tangent_y)


def _nearest(points: Points, size: Size, reach_px: float) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]] | None:
    """Rows and columns of the pixels within `reach_px` of a dense line, and the place of each one's nearest point on it.

    The distance transform tells the nearest pixel that the line runs through; of the points about there the nearest one is taken.
    """
    height, width = size
    pad = int(np.ceil(reach_px)) + 2
    pixels = np.rint(points).astype(np.intp) + pad
    near = np.all((pixels >= 0) & (pixels < (width + 2 * pad, height + 2 * pad)), axis=1)
    if not near.any():
        return None
    low, high = pixels[near].min(axis=0) - pad, pixels[near].max(axis=0) + pad + 1
    low, high = np.maximum(low, pad), np.minimum(high, (width + pad, height + pad))
    # The part of the line beyond the picture's border counts, too: a window around all of it, and the picture's part of that.
    first, last = np.minimum(low, pixels[near].min(axis=0)), np.maximum(high, pixels[near].max(axis=0) + 1)
    if np.any(high <= low):
        return None
    places = np.flatnonzero(near)
    x, y = (pixels[near] - first).T
    away = np.ones(tuple(last - first)[::-1], np.uint8)
    away[y, x] = 0
    distance, labels = cv2.distanceTransformWithLabels(away, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    of_label = np.zeros(int(labels.max()) + 1, np.intp)
    of_label[labels[y, x]] = places
    part = np.s_[low[1] - first[1] : high[1] - first[1], low[0] - first[0] : high[0] - first[0]]
    rows, columns = np.nonzero(distance[part] <= reach_px)
    if not len(rows):
        return None
    place = of_label[labels[part][rows, columns]]
    rows, columns = rows + low[1] - pad, columns + low[0] - pad
    best = np.full(len(rows), np.inf)
    found = place
    for step in range(-4, 5):
        other = np.clip(place + step, 0, len(points) - 1)
        squared = (columns - points[other, 0]) ** 2 + (rows - points[other, 1]) ** 2
        closer = squared < best
        best = np.where(closer, squared, best)
        found = np.where(closer, other, found)
    return rows, columns, found


def _robot_color(rng: Generator, below: F32, veil: float, *, is_xray: bool) -> F32:
    """A colour (3, 1) that stands out from what lies `below` (3, N) the robot; in X-rays darker than that."""
    mean = below.mean(axis=1, keepdims=True)
    if is_xray:
        return np.full((3, 1), float(mean.mean()) * rng.uniform(0.1, 0.8), np.float32)
    for _ in range(_COLOR_TRIES):
        color = random_color(rng)[:, :, 0]
        if float(np.abs(color - mean).max()) * (1 - veil) > rng.uniform(0.07, 0.3):
            break
    return color


def _robot_colors(rng: Generator, band: _Band, color: F32, pattern: str, *, is_xray: bool) -> F32:
    """The robot's colour (3, N) with a pattern, and often with a tip of another one."""

    def other(darkest: float, brightest: float) -> F32:
        return color * np.float32(rng.uniform(darkest, brightest)) if is_xray else random_color(rng)[:, :, 0]

    body = np.repeat(color, len(band.rows), axis=1)
    if is_xray and rng.random() < _FADING:
        body *= np.interp(band.from_tip_px, [0, rng.uniform(40, 300)], [1, rng.uniform(0.6, 1.8)]).astype(np.float32)
    if pattern != "plain":
        pitch, phase = float(rng.uniform(3, 16)), band.from_tip_px
        if pattern == "coil":
            phase = phase + band.side * band.radius_px * np.float32(rng.uniform(0.5, 1.5))
        is_other = phase % pitch < pitch * float(rng.uniform(0.2, 0.8))
        if pattern == "bands":
            is_other &= band.from_tip_px < float(rng.uniform(30, 120))
        elif pattern == "rings" and rng.random() < 0.5:
            is_other &= band.from_tip_px < 2 * band.tip_px
        body[:, is_other] = other(0.5, 1.5) * np.float32(rng.uniform(0.4, 1))
    if rng.random() < _JACKETS:
        jacket = np.abs(band.side) > float(rng.uniform(0.55, 0.85))
        body[:, jacket] = color * np.float32(rng.uniform(0.3, 1.0)) if rng.random() < 0.5 else other(0.4, 1.2)
    if rng.random() < _TIPS:
        body[:, band.from_tip_px < band.tip_px] = other(0.4, 1.2)
    return body


def _lay_sheath(rng: Generator, band: _Band, seen: F32, radius_px: float, *, is_xray: bool) -> None:
    """The catheter that the robot comes out of, over `seen` (3, N), in place: of any opacity, in X-rays a soft shadow."""
    soft_px = float(rng.uniform(1, 4)) if is_xray else 1.0
    cover = np.clip((np.float32(radius_px) - band.distance_px) * np.float32(1 / soft_px) + np.float32(0.5), 0, 1)
    cover *= np.clip((band.from_tip_px - np.float32(_between(rng, _SHEATH_BEGINS_PX))) * np.float32(0.5), 0, 1)
    if is_xray:
        seen *= 1 - float(rng.uniform(0.03, 0.5)) * cover
        return
    away = np.minimum(band.distance_px * np.float32(1 / radius_px), 1)
    color = random_color(rng)[:, :, 0] * (1 - float(rng.uniform(0, 0.5)) * away * away)
    seen += (color - seen) * (cover * float(rng.uniform(0.1, 1)))


def _shade_robot(rng: Generator, band: _Band, body: F32, lamp: tuple[float, float]) -> None:
    """Light and shade of a round body, and often a bright line along it; `body` (3, N) is changed in place."""
    lit = band.side * (band.tangent_x * lamp[1] - band.tangent_y * lamp[0])
    body *= 1 + float(rng.uniform(0, 0.6)) * lit - float(rng.uniform(0, 0.4)) * band.side**2
    if rng.random() < 0.5:
        away = (band.side - float(rng.uniform(-0.6, 0.6))) / float(rng.uniform(0.1, 0.35))
        lay_over(body, np.exp(-away * away) * np.float32(rng.uniform(0.1, 0.9)), 1.0)


# ---- exposure


def exposed(rng: Generator, picture: F32, vessel: Mask, blur_px: float) -> Levels:
    """What a camera sees of a bench at one moment, uint8 (3, h, w)."""
    return _sensed(rng, _developed(rng, _changed(rng, picture, vessel, blur_px)))


def _changed(rng: Generator, scene: F32, vessel: Mask, blur_px: float) -> F32:
    """With cables, hands, bubbles, glare and shadows that come and go, in other light and focus."""
    picture = scene.copy()
    changes: tuple[tuple[float, Callable[[Generator, F32, Mask], None]], ...] = (
        (0.12, lambda rng, picture, _: lay_cable(rng, picture)),
        (0.04, _add_hand),
        (0.15, _add_bubbles),
        (0.10, _add_glare),
        (0.35, _add_shadow),
    )
    for share, change in changes:
        if rng.random() < share:
            change(rng, picture, vessel)
    if rng.random() < 0.5:
        picture *= float(rng.uniform(0.88, 1.12))
    if rng.random() < 0.25:
        picture *= rng.uniform(0.93, 1.07, (3, 1, 1)).astype(np.float32)
    sigma_px = float(np.hypot(blur_px, rng.uniform(0, 1) if rng.random() < 0.4 else 0.0))
    if rng.random() < 0.03:  # out of focus
        sigma_px = float(rng.uniform(1.5, 2.5))
    if sigma_px > 0.25:
        picture = blurred(picture, sigma_px)
    return np.clip(picture, 0, 1, out=picture)


def _add_hand(rng: Generator, picture: F32, vessel: Mask) -> None:
    hand = stroke(vessel.shape, random_curve(rng, vessel.shape, 3, 30), rng.uniform(25, 70))
    lay_over(picture, np.asarray(cv2.GaussianBlur(hand, (0, 0), 1), np.float32), random_color(rng))


def _add_bubbles(rng: Generator, picture: F32, vessel: Mask) -> None:
    places = np.argwhere(vessel)
    for _ in range(int(rng.integers(1, 6)) if len(places) else 0):
        y, x = places[int(rng.integers(len(places)))]
        bubble = np.zeros(vessel.shape, np.uint8)
        cv2.circle(bubble, (int(x), int(y)), int(rng.integers(1, 5)), 255, int(rng.choice([-1, 1])), cv2.LINE_AA)
        lay_over(picture, bubble * np.float32(1 / 255), random_color(rng, 0.1))


def _add_glare(rng: Generator, picture: F32, vessel: Mask) -> None:
    height, width = vessel.shape
    (y, x), (across, down) = rng.integers((height, width)), rng.uniform(3, 25, 2)
    rows = np.exp(-(((np.arange(height) - y) / down) ** 2)).astype(np.float32)
    columns = np.exp(-(((np.arange(width) - x) / across) ** 2)).astype(np.float32)
    picture += rows[:, None] * columns * np.float32(rng.uniform(0.3, 1.3))


def _add_shadow(rng: Generator, picture: F32, vessel: Mask) -> None:
    level = smooth_noise(rng, vessel.shape, rng.uniform(2, 4)) + np.float32(rng.uniform(-0.8, 0.8))
    shadow = 1 / (1 + np.exp(level * np.float32(-rng.uniform(2, 12))))
    picture *= 1 - float(rng.uniform(0.1, 0.55)) * shadow


def _developed(rng: Generator, picture: F32) -> F32:
    """Contrast, greys, gamma and negatives."""
    if rng.random() < 0.5:
        mean, contrast, offset = float(picture.mean()), float(rng.uniform(0.65, 1.4)), float(rng.uniform(-0.15, 0.15))
        picture = picture * contrast + (mean * (1 - contrast) + offset)
    if rng.random() < 0.22:
        picture = np.repeat(picture.mean(axis=0, keepdims=True), 3, axis=0)
    if rng.random() < 0.3:
        gamma = np.float32(np.exp(rng.uniform(-0.5, 0.5)))
        picture = np.clip(picture, 0, 1) ** gamma
    return 1 - picture if rng.random() < 0.05 else picture


def _sensed(rng: Generator, picture: F32) -> Levels:
    """With the sensor's noise, coloured or grey, and now and then compressed."""
    if rng.random() < 0.85:
        noise = abs(float(rng.normal(0, 0.018)))
        grains = _GRAINS[rng.integers(256, size=picture.shape if rng.random() < 0.7 else picture.shape[1:], dtype=np.uint8)]
        level = np.sqrt(np.clip(picture, 0, 1))
        level *= np.float32(0.8 * noise)
        level += np.float32(0.6 * noise)
        level *= grains
        picture = level + picture
    levels = np.clip(picture * np.float32(255) + np.float32(0.5), 0, 255).astype(np.uint8)
    if rng.random() < 0.25:
        options = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(45, 95))]
        coded = cv2.imencode(".jpg", np.ascontiguousarray(levels.transpose(1, 2, 0)), options)[1]
        decoded = np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), np.uint8)
        levels = np.ascontiguousarray(decoded.transpose(2, 0, 1))
    return np.asarray(levels, np.uint8)
