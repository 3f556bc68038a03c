"""The appearance of the twin's picture: everything apart from phantom and robot shape. Named, random and configured looks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from core.config.models import TwinConfig
from core.types import Points
from hardware.twin.catalog import BENCH_LOOK, LOOKS, OWN_LOOK, family_of, look_of
from hardware.twin.phantom import BOARD_MM, Phantom
from hardware.twin.rendering.presets import LOOK_FAMILIES, RARE_FAMILIES, draw_family
from hardware.twin.view import CameraView

Rgb = tuple[float, float, float]

_SIDE_PX = 640.0
_MIN_SHARE_IN_VIEW = 0.75
_MARGIN_PX = 3.0


@dataclass(frozen=True, slots=True)
class Appearance:
    """All parameters of the picture. Colours and strengths are 0..1; lengths are millimetres on the board.

    The defaults are the clear bench: transparent silicone, slightly tinted liquid, light board, dark ringed robot.

    Settings in px mean pixels of an image whose longer side has 640; other sizes scale them. ``light_deg`` is the direction towards
    the lamp as seen on the board (0 = right, 90 = down). ``material`` is how the lumen is made: a silicone ``tube``, a transparent
    ``block``, a turbid ``gel``, an open opaque ``channel``, or an ``xray`` picture.
    """

    family: str = "silicone_white"
    material: str = "tube"

    # board and table
    board_rgb: Rgb = (0.86, 0.87, 0.86)
    board_texture: str = "speckle"  # plain, speckle, wood, grid, brushed, cloth, folds, layers, patches
    texture_strength: float = 0.25
    table_rgb: Rgb = (0.45, 0.42, 0.40)
    light_gradient: float = 0.15

    # liquid and wall
    liquid_rgb: Rgb = (0.93, 0.72, 0.66)
    liquid_opacity: float = 0.35
    wall_mm: float = 1.4
    wall_rgb: Rgb = (0.93, 0.94, 0.95)
    wall_haze: float = 0.22
    edge_bright: float = 0.45
    edge_dark: float = 0.42
    edge_mm: float = 0.45
    refraction_mm: float = 1.2
    lumen_shade: float = 0.15
    scatter_mm: float = 0.0  # blur of what is seen through a turbid gel
    glow: float = 0.0  # light emitted by the liquid

    # light
    light_deg: float = 235.0
    highlight: float = 0.75
    highlight_width: float = 0.16
    lamps: int = 2
    lamp_strength: float = 0.5
    lamp_mm: float = 5.0
    tube_shadow: float = 0.25
    shadow_mm: float = 2.5
    caustics: float = 0.0  # net of light under rippling water
    lamp_rgb: tuple[Rgb, Rgb] = ((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))  # of the lamp's side and of the far side

    # robot and catheter sheath
    robot_look: str = "ringed"
    robot_radius_mm: float = 1.1
    robot_rgb: Rgb = (0.13, 0.13, 0.15)
    robot_accent_rgb: Rgb = (0.62, 0.62, 0.64)
    ring_pitch_mm: float = 3.0
    ring_share: float = 0.3
    tip_mm: float = 5.0
    tip_rgb: Rgb = (0.80, 0.62, 0.25)
    tip_contrast: float = 1.0
    robot_opacity: float = 0.97
    robot_gloss: float = 0.35
    robot_veil: float = 0.12
    robot_shadow: float = 0.22
    sheath_extra_mm: float = 0.5
    sheath_rgb: Rgb = (0.62, 0.74, 0.86)
    sheath_opacity: float = 0.45

    # things on, over and beside the vessel
    fittings: int = 1
    fitting_rgb: Rgb = (0.88, 0.88, 0.85)
    fitting_opacity: float = 0.8
    end_fittings: bool = True
    bubbles: int = 0
    cables: int = 1
    objects: int = 0  # boxes of equipment and gloved or bare hands, beside the vessel
    ruler: bool = False
    labels: int = 1
    stains: int = 1
    dust: int = 25
    clutter_seed: int = 0

    # camera pose and lens
    pixels_per_mm: float = 3.1
    rotation_deg: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    offset_mm: tuple[float, float] = (0.0, 0.0)
    distortion: float = 0.0

    # effects of lens and sensor
    blur_px: float = 0.6
    motion_px: float = 0.0
    motion_deg: float = 0.0
    exposure: float = 1.0
    white_balance: Rgb = (1.0, 1.0, 1.0)
    saturation: float = 1.0
    gamma: float = 1.0
    contrast: float = 1.0
    vignette: float = 0.15
    collimator: float = 0.0
    noise: float = 3.0
    noise_grain_px: float = 0.0
    jpeg_quality: int = 0


def random_appearance(seed: int, family: str | None = None) -> Appearance:
    """A random appearance of one of ``LOOK_FAMILIES`` or ``RARE_FAMILIES`` (None: a random one of the former).

    The same for the same `seed` (not negative) and `family`. Raises ValueError for an unknown `family`.
    """
    known = (*LOOK_FAMILIES, *RARE_FAMILIES)
    if family is not None and family not in known:
        raise ValueError(f"unknown look family {family!r}; known: {', '.join(known)}")
    chosen = family or family_of(seed)
    rng = np.random.default_rng([seed, known.index(chosen), 104729])
    return Appearance(**draw_family(chosen, rng))


def make_view(appearance: Appearance, size: tuple[int, int], phantom: Phantom | None = None) -> CameraView:
    """The camera's view of the board for an image of `size` (width, height).

    The middle of the lumen (without a phantom: of the board) plus ``offset_mm`` lies in the middle of the image. With a `phantom`,
    offset and zoom are reduced until the port and three quarters of the centerlines are in the picture. A phantom's own view comes
    before all that.
    """
    if phantom is not None and phantom.view is not None:
        return replace(phantom.view.fitted(size), distortion=appearance.distortion)
    points = None if phantom is None else np.vstack([edge.points for edge in phantom.graph.edges])
    middle = np.array(BOARD_MM) / 2 if points is None else (points.min(axis=0) + points.max(axis=0)) / 2
    offset, zoom = np.array(appearance.offset_mm), appearance.pixels_per_mm
    view = _view(appearance, size, middle + offset, zoom)
    if phantom is None or points is None:
        return view
    port = phantom.graph.nodes[phantom.port : phantom.port + 1]
    for step in range(40):
        if _share_inside(view, port) == 1 and _share_inside(view, points) >= _MIN_SHARE_IN_VIEW:
            break
        # First only a smaller offset, then a smaller zoom too.
        offset, zoom = offset * 0.6, zoom * (0.95 if step >= 3 else 1.0)
        view = _view(appearance, size, middle + offset, zoom)
    return view


def _view(appearance: Appearance, size: tuple[int, int], middle_mm: np.ndarray, pixels_per_mm: float) -> CameraView:
    width, height = size
    scale = pixels_per_mm * max(size) / _SIDE_PX
    angle = np.deg2rad(appearance.rotation_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    linear = scale * turn
    shift = np.eye(3)
    shift[:2, 2] = -middle_mm
    place = np.eye(3)
    place[:2, :2] = linear
    # Tilt: the depth changes linearly over the picture, in shares over half the longer side.
    tilt = np.eye(3)
    tilt[2, :2] = np.array(appearance.tilt) / (max(size) / 2)
    center = np.eye(3)
    center[:2, 2] = (width - 1) / 2, (height - 1) / 2
    return CameraView(center @ tilt @ place @ shift, size, appearance.distortion)


def _share_inside(view: CameraView, points_mm: Points) -> float:
    pixels = view.project(points_mm)
    limit = np.array(view.size) - 1 - _MARGIN_PX
    return float(np.mean(np.all((pixels >= _MARGIN_PX) & (pixels <= limit), axis=1)))


def named_appearance(look: str | None, seed: int) -> Appearance:
    """The clear bench, the bench's own picture, or a random look of the family `look` (None: of any of the ten).

    Raises ValueError for an unknown name; the message lists the known ones.
    """
    if look is not None and look not in LOOKS:
        raise ValueError(f"unknown look {look!r}; known: {', '.join(LOOKS)}")
    if look == OWN_LOOK:
        return Appearance(family=OWN_LOOK, clutter_seed=seed)
    return Appearance() if look == BENCH_LOOK else random_appearance(seed, look)


def appearance_of(config: TwinConfig) -> Appearance:
    """The configured look (see ``look_of``) with the configured lens. Raises ValueError as ``named_appearance`` does."""
    look = named_appearance(look_of(config), config.appearance_seed)
    return replace(look, distortion=config.lens_distortion) if config.lens_distortion else look
