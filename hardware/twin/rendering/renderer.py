"""The twin's picture with its exact labels: the background is painted once, then the robot into it for every frame.

A frame repaints only a window around the robot and copies the rest. Labels are independent of the painting: exact distances of
pixel centres, in mm on the board, to the robot's line and to the lumen's discs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from core.bench.bench import bench_stamp, read_bench
from core.bench.robot_texture import PAINTED_TEXTURES, REACH_RADII, RobotTexture, covers_of, lines_above, read_textures
from core.types import Image, Mask, Points
from hardware.twin.catalog import OWN_LOOK
from hardware.twin.phantom import BOARD_MM, Phantom, own_file
from hardware.twin.rendering.appearance import Appearance, make_view
from hardware.twin.rendering.background import light_field, paint_board, stroke
from hardware.twin.rendering.camera_effects import CameraEffects
from hardware.twin.rendering.robot import Band, measure_band, paint_robot, paint_sheath, paint_texture
from hardware.twin.rendering.scene_objects import add_board_clutter, add_fittings
from hardware.twin.rendering.vessel import paint_vessel, surface_of
from hardware.twin.view import CameraView, measure_lumen

F32 = NDArray[np.float32]

_REACH_MM = 2.5
_GREY = 0.005
"""A picture whose channels differ by less on average is grey: so is the robot in it."""


@dataclass(frozen=True, slots=True, eq=False)
class RenderedFrame:
    """One rendered frame: ``image`` (H, W, 3) RGB uint8; exact labels ``vessel`` and ``robot``, each (H, W)."""

    image: Image
    vessel: Mask
    robot: Mask


class Renderer:
    """Pictures of one phantom in one appearance through one view.

    Parameters
    ----------
    phantom : the vessel.
    appearance : all looks; the same appearance and `seed` give the same pictures.
    size : (width, height) in px.
    seed : chooses textures, clutter and the sensor's noise.
    view : None takes ``make_view(appearance, size, phantom)``.
    """

    def __init__(
        self,
        phantom: Phantom,
        appearance: Appearance,
        size: tuple[int, int] = (640, 480),
        seed: int = 0,
        view: CameraView | None = None,
    ) -> None:
        self.view = view if view is not None else make_view(appearance, size, phantom)
        own = _own_bench(phantom, self.view, appearance) if appearance.family == OWN_LOOK else None
        self._texture = own.texture if own is not None else None
        if own is not None:  # what the bench's camera does is in the picture already
            appearance = own.appearance
        self.phantom, self.appearance = phantom, appearance
        rng = np.random.default_rng([seed, appearance.clutter_seed])
        self._grid = self.view.grid_mm().astype(np.float32)
        self._scale = self.view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
        self._lamp = _lamp_in_image(self.view, appearance.light_deg)
        self.lumen = measure_lumen(phantom.graph, self.view, self._grid, appearance.wall_mm, appearance.wall_mm + _REACH_MM)
        self._vessel = self.lumen.inside
        self._camera = CameraEffects(appearance, self.view.size, rng)
        self._under, self._front, self._front_keep = self._paint_background(rng) if own is None else self._taken(own)
        whole = slice(0, self.view.size[1]), slice(0, self.view.size[0])
        self._empty = self._camera.expose(self._under * self._front_keep + self._front, whole)

    def render(self, robot_points_mm: Points | None, sheath_mm: float = 0.0, noise_seed: int = 0) -> RenderedFrame:
        """The picture with the robot's line at `robot_points_mm` (N, 2), tail -> head (None or one point: no robot).

        The whole line within the picture is painted and labelled, outside the port too. `sheath_mm` of catheter sheath, measured
        from the port, cover its proximal part, which stays labelled.
        """
        radius_mm = self.appearance.robot_radius_mm
        robot = np.zeros(self._vessel.shape, bool)
        image = self._empty
        if robot_points_mm is not None and len(robot_points_mm) >= 2:
            points = np.asarray(robot_points_mm, np.float64)
            reach = radius_mm + max(self.appearance.sheath_extra_mm if sheath_mm > 0 else 0.0, 1.0 / self._scale) + 0.3
            if self._texture is not None:
                reach = max(reach, REACH_RADII * radius_mm)
            band = measure_band(points, radius_mm, reach, self.view, self._grid)
            if len(band.pixel):
                robot.reshape(-1)[band.pixel] = band.distance_mm < np.float32(radius_mm)
                image = self._with_robot(points, band, sheath_mm)
        return RenderedFrame(self._camera.add_noise(image, noise_seed), self._vessel.copy(), robot)

    def _paint_background(self, rng: np.random.Generator) -> tuple[F32, F32, F32]:
        appearance, view = self.appearance, self.view
        board = paint_board(appearance, self._grid, self._scale, rng)
        board = add_board_clutter(appearance, board, view, self.phantom, self.lumen, rng)
        surface = surface_of(self.lumen, self._scale, self._lamp)
        layers = paint_vessel(appearance, board, surface, rng)
        add_fittings(appearance, layers, self.phantom, view, rng)
        light = light_field(appearance, self._grid, rng)
        self._light = light
        return layers.under * light[..., None], layers.front, (1 - layers.front_alpha)[..., None]

    def _taken(self, own: _OwnBench) -> tuple[F32, F32, F32]:
        """The same layers where the background is a picture."""
        self._light = np.ones(own.picture.shape[:2], np.float32)
        keep, shown = 1 - own.above, 1 - own.covers[..., None]
        under = np.asarray((own.picture - own.above) / np.maximum(keep, np.float32(0.01)), np.float32)
        return under, own.above * shown + own.picture * (1 - shown), keep * shown

    def _with_robot(self, points: Points, band: Band, sheath_mm: float) -> Image:
        """The noise-free image, with the window around the robot painted again."""
        appearance = self.appearance
        outer, inner = self._windows(band)
        scene = self._under[outer].copy()
        if appearance.robot_shadow:
            self._shade(scene, points, outer)
        local = _local(band, outer, self.view.size[0])
        canvas = scene.reshape(-1, 3)
        lit = band.side * (band.normal @ np.asarray(self._lamp, np.float32))
        coverage = np.clip(
            (np.float32(appearance.robot_radius_mm) - band.distance_mm) * np.float32(self._scale) + np.float32(0.5), 0, 1
        )
        veil = np.float32(appearance.robot_veil) * self._vessel.reshape(-1)[band.pixel]
        if self._texture is not None:
            from_head_mm = self._grid.reshape(-1, 2)[band.pixel] - points[-1].astype(np.float32)
            paint_texture(canvas, local, self._texture, appearance.robot_radius_mm, from_head_mm)
        else:
            light = self._light.reshape(-1)[band.pixel]
            paint_robot(canvas, local, coverage * (1 - veil), lit.astype(np.float32), appearance, light)
        if sheath_mm > 0:
            covered = np.clip((self._port_mm(points) + np.float32(sheath_mm) - band.from_tail_mm) * np.float32(self._scale), 0, 1)
            outside = np.float32(appearance.robot_radius_mm + appearance.sheath_extra_mm)
            coverage = np.clip((outside - band.distance_mm) * np.float32(self._scale) + np.float32(0.5), 0, 1) * covered
            paint_sheath(canvas, local, coverage.astype(np.float32), appearance)
        scene *= self._front_keep[outer]
        scene += self._front[outer]
        image = self._empty.copy()
        developed = self._camera.expose(scene, outer)
        offset_y, offset_x = inner[0].start - outer[0].start, inner[1].start - outer[1].start
        height, width = inner[0].stop - inner[0].start, inner[1].stop - inner[1].start
        image[inner] = developed[offset_y : offset_y + height, offset_x : offset_x + width]
        return image

    def _windows(self, band: Band) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
        """The window to paint, and within it the window where the blur used only painted pixels."""
        width, height = self.view.size
        shadow = int(np.ceil((1.5 * self.appearance.shadow_mm + 2) * self._scale)) if self.appearance.robot_shadow else 0
        y, x = band.pixel // width, band.pixel % width
        windows = []
        for pad in (shadow + 2 * self._camera.reach_px, shadow + self._camera.reach_px):
            rows = slice(max(int(y.min()) - pad, 0), min(int(y.max()) + pad + 1, height))
            columns = slice(max(int(x.min()) - pad, 0), min(int(x.max()) + pad + 1, width))
            windows.append((rows, columns))
        return windows[0], windows[1]

    def _shade(self, scene: F32, points: Points, window: tuple[slice, slice]) -> None:
        """The robot's soft shadow on the floor of the lumen, away from the lamp."""
        pixels = self.view.project(points) - (window[1].start, window[0].start)
        pixels = pixels - np.asarray(self._lamp) * 0.5 * self.appearance.shadow_mm * self._scale
        mask = np.zeros(scene.shape[:2], np.uint8)
        stroke(mask, pixels, 255, 2 * self.appearance.robot_radius_mm * self._scale)
        soft = cv2.blur(mask, (3, 3) if self._scale < 2 else (5, 5))
        soft = cv2.blur(soft, (5, 5))
        scene *= (1 - np.float32(self.appearance.robot_shadow / 255) * soft.astype(np.float32))[..., None]

    def _port_mm(self, points: Points) -> np.float32:
        """Arc length from the robot's tail to the point of its line nearest to the port."""
        port = self.phantom.graph.nodes[self.phantom.port]
        index = int(np.argmin(np.sum((points - port) ** 2, axis=1)))
        return np.float32(np.sum(np.linalg.norm(np.diff(points[: index + 1], axis=0), axis=1)))


@dataclass(frozen=True, slots=True, eq=False)
class _OwnBench:
    """The empty picture of a bench (H, W, 3), 0..1, and the robot's texture, if known.

    What of the picture lies ``above`` the robot is added to it; ``covers`` (H, W) are opaque.
    """

    picture: F32
    above: F32
    covers: F32
    texture: RobotTexture | None
    appearance: Appearance


def _own_bench(phantom: Phantom, view: CameraView, appearance: Appearance) -> _OwnBench | None:
    """The picture of the phantom's bench, fitted into the view's; the appearance's seed chooses between the robots seen there.

    None for a phantom of no bench, or of one without a picture. Raises BenchError for a damaged one.
    """
    file = own_file(phantom.name)
    if file is None or bench_stamp(file.parent) is None:
        return None
    bench, textures = read_bench(file.parent), read_textures(file.parent)
    zoom = min(new / old for new, old in zip(view.size, bench.size, strict=True))
    shift = [(new - 1 - zoom * (old - 1)) / 2 for new, old in zip(view.size, bench.size, strict=True)]
    place = np.array([[zoom, 0.0, shift[0]], [0.0, zoom, shift[1]]])

    def fitted(pixels: Image | F32) -> F32:
        warped = cv2.warpAffine(pixels, place, view.size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return warped.astype(np.float32) / np.float32(255)

    picture = fitted(bench.empty)
    grey = float(np.ptp(picture, axis=2).mean()) < _GREY
    noise = float(np.median(bench.noise))
    appearance = replace(appearance, blur_px=0.0, vignette=0.0, noise=noise, saturation=0.0 if grey else 1.0)
    if not textures:
        return _OwnBench(picture, np.zeros_like(picture), np.zeros(picture.shape[:2], np.float32), None, appearance)
    chosen = textures[appearance.clutter_seed % min(len(textures), PAINTED_TEXTURES)]
    radius_mm = chosen.radius_px * zoom / view.pixels_per_mm((BOARD_MM[0] / 2, BOARD_MM[1] / 2))
    appearance = replace(appearance, robot_radius_mm=radius_mm, robot_shadow=0.0)
    covers = fitted(np.float32(255) * covers_of(textures, bench.empty.shape[:2]))
    return _OwnBench(picture, fitted(lines_above(bench.empty)), covers, chosen, appearance)


def _lamp_in_image(view: CameraView, light_deg: float) -> tuple[float, float]:
    """The direction to the lamp as a unit vector on screen."""
    angle, middle = np.deg2rad(light_deg), np.array(BOARD_MM) / 2
    ends = view.project(np.array([middle, middle + (np.cos(angle), np.sin(angle))]))
    step = ends[1] - ends[0]
    x, y = step / np.linalg.norm(step)
    return float(x), float(y)


def _local(band: Band, window: tuple[slice, slice], width: int) -> Band:
    """The same band with pixel indices into the window."""
    y, x = band.pixel // width, band.pixel % width
    inside = (y - window[0].start) * (window[1].stop - window[1].start) + (x - window[1].start)
    return Band(inside, band.distance_mm, band.from_tip_mm, band.from_tail_mm, band.side, band.normal)
