"""The twin's pictures: labels by brute force, pictures by their labels, looks by their ranges."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.types import GraphEdge, Mask, Points, VesselGraph
from hardware.twin.phantom import Phantom
from hardware.twin.rendering.appearance import Appearance, random_appearance
from hardware.twin.rendering.presets import LOOK_FAMILIES, RARE_FAMILIES, ROBOT_LOOKS
from hardware.twin.rendering.renderer import RenderedFrame, Renderer
from hardware.twin.view import CameraView

SMALL = (160, 120)
BENT_VIEW = CameraView(np.array([[0.9, 0.05, -6.0], [-0.04, 0.85, -3.0], [0.0004, -0.0003, 1.0]]), SMALL, -0.08)
QUIET = replace(Appearance(), noise=0.0, jpeg_quality=0)


def _y_phantom() -> Phantom:
    """A trunk from the left that forks into a wide upper and a narrow lower branch; radii change along the way."""
    nodes = np.array([[20.0, 80.0], [90.0, 75.0], [170.0, 40.0], [165.0, 120.0]])
    edges = []
    for start, end, bow, first, last in ((0, 1, 6.0, 7.0, 5.0), (1, 2, -7.0, 5.0, 3.5), (1, 3, 5.0, 4.0, 2.5)):
        share = np.linspace(0, 1, int(np.linalg.norm(nodes[end] - nodes[start]) / 0.4))[:, None]
        line = nodes[start] + share * (nodes[end] - nodes[start]) + np.sin(np.pi * share) * (0.0, bow)
        edges.append(GraphEdge(start, end, line, first + share[:, 0] * (last - first)))
    return Phantom("y", "Y", VesselGraph(nodes, tuple(edges)), 0)


PHANTOM = _y_phantom()


def _robot(length: int = 70, outside_mm: float = 12.0) -> Points:
    """A wavy robot that enters through the port and stays in the trunk; 2-mm steps."""
    trunk = PHANTOM.graph.edges[0].points[: length * 2 : 5]
    wave = trunk + np.column_stack([np.zeros(len(trunk)), 2.5 * np.sin(np.arange(len(trunk)) / 4)])
    outside = wave[0] - np.column_stack([np.arange(outside_mm, 0, -2.0), np.zeros(int(outside_mm / 2))])
    return np.vstack([outside, wave])


def _distance_to_line(points: Points, line: Points) -> np.ndarray:
    """Brute force: every point against every piece."""
    best = np.full(len(points), np.inf)
    for a, b in zip(line[:-1], line[1:], strict=True):
        share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return best


def _disagree(mask: Mask, signed_mm: np.ndarray, tolerance_mm: float = 1e-3) -> int:
    """Pixels whose label differs from the sign, unless they lie on the border itself."""
    return int(np.sum((mask.ravel() != (signed_mm < 0)) & (np.abs(signed_mm) > tolerance_mm)))


def test_vessel_label_is_the_union_of_discs_at_pixel_centres() -> None:
    grid = BENT_VIEW.grid_mm().reshape(-1, 2)
    depth = np.full(len(grid), np.inf)
    for edge in PHANTOM.graph.edges:
        for center, radius in zip(edge.points, edge.radius, strict=True):
            depth = np.minimum(depth, np.linalg.norm(grid - center, axis=1) - radius)
    picture = Renderer(PHANTOM, QUIET, SMALL, view=BENT_VIEW).render(None)
    assert picture.vessel.sum() > 1000
    assert _disagree(picture.vessel, depth) == 0


@pytest.mark.parametrize(
    "robot",
    [_robot(), np.array([[20.0, 80], [70, 80], [70, 60], [60.5, 60], [60, 60], [60, 95], [90, 70]])],
    ids=["wavy", "crosses itself"],
)
def test_robot_label_is_the_distance_to_its_line_with_round_ends(robot: Points) -> None:
    distance = _distance_to_line(BENT_VIEW.grid_mm().reshape(-1, 2), robot)
    picture = Renderer(PHANTOM, QUIET, SMALL, view=BENT_VIEW).render(robot)
    assert picture.robot.sum() > 80
    assert _disagree(picture.robot, distance - QUIET.robot_radius_mm) == 0


@pytest.mark.parametrize(
    "robot",
    [None, np.zeros((0, 2)), np.array([[50.0, 80.0]]), np.array([[900.0, 900.0], [950.0, 900.0]]), np.full((3, 2), 50.0)],
    ids=["none", "empty", "one point", "out of the picture", "no length"],
)
def test_no_robot_in_the_picture(robot: Points | None) -> None:
    renderer = Renderer(PHANTOM, QUIET, SMALL)
    picture = renderer.render(robot)
    assert not picture.robot.any()
    assert np.array_equal(picture.image, renderer.render(None).image)


def test_robot_is_labelled_up_to_the_image_border() -> None:
    picture = Renderer(PHANTOM, QUIET, SMALL).render(_robot(outside_mm=60.0))
    assert picture.robot[:, 0].any()


def test_objects_change_the_picture_but_no_label() -> None:
    bare = replace(QUIET, fittings=0, cables=0, labels=0, stains=0, dust=0, end_fittings=False, lamps=0)
    full = replace(bare, fittings=6, cables=4, labels=3, stains=3, dust=50, end_fittings=True, lamps=5, ruler=True, objects=3)
    empty, crowded = (Renderer(PHANTOM, appearance, seed=3).render(_robot()) for appearance in (bare, full))
    assert np.array_equal(empty.vessel, crowded.vessel)
    assert np.array_equal(empty.robot, crowded.robot)
    changed = np.abs(empty.image.astype(int) - crowded.image).max(axis=2) > 40
    assert changed.mean() > 0.02


def test_sheath_covers_the_robot_but_not_its_label() -> None:
    renderer = Renderer(PHANTOM, QUIET)
    bare, sheathed = renderer.render(_robot()), renderer.render(_robot(), sheath_mm=25.0)
    assert np.array_equal(bare.robot, sheathed.robot)
    changed = np.argwhere(np.abs(bare.image.astype(int) - sheathed.image).max(axis=2) > 10)[:, 1]
    port = renderer.view.project(PHANTOM.graph.nodes[:1])[0, 0]
    assert changed.max() == pytest.approx(port + 25.0 * QUIET.pixels_per_mm, abs=15)


def test_same_seeds_same_bits_other_noise_seed_other_noise() -> None:
    appearance = random_appearance(5, "silicone_white")
    first = Renderer(PHANTOM, appearance, SMALL, seed=2).render(_robot(), noise_seed=7)
    again = Renderer(PHANTOM, appearance, SMALL, seed=2).render(_robot(), noise_seed=7)
    assert np.array_equal(first.image, again.image)
    other = Renderer(PHANTOM, appearance, SMALL, seed=2).render(_robot(), noise_seed=8)
    assert not np.array_equal(first.image, other.image)
    assert np.abs(first.image.astype(int) - other.image).mean() < 4 * appearance.noise + 1


def test_a_frame_does_not_remember_the_one_before() -> None:
    renderer = Renderer(PHANTOM, Appearance(), SMALL)
    before = renderer.render(_robot(30))
    renderer.render(_robot(70), sheath_mm=20.0)
    assert np.array_equal(before.image, renderer.render(_robot(30)).image)


@pytest.mark.parametrize("family", ["silicone_white", "opaque_channel", "fluoroscopy"])
def test_painting_a_window_equals_painting_the_whole(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    appearance = replace(random_appearance(3, family), motion_px=4.0, motion_deg=30.0, blur_px=1.2)
    renderer = Renderer(PHANTOM, appearance, (320, 240))
    part = renderer.render(_robot(40)).image
    whole = slice(0, 240), slice(0, 320)
    monkeypatch.setattr(Renderer, "_windows", lambda *_: (whole, whole))
    difference = np.abs(part.astype(int) - renderer.render(_robot(40)).image)
    assert difference.max() <= 1


def _contrast(picture: RenderedFrame, without: RenderedFrame) -> float:
    """How far the robot's pixels differ from the same picture without it, in grey levels."""
    grey, empty = (cv2.cvtColor(p.image, cv2.COLOR_RGB2GRAY).astype(float) for p in (picture, without))
    return float(np.abs(grey - empty)[picture.robot].mean())


@pytest.mark.parametrize("family", [*LOOK_FAMILIES, *RARE_FAMILIES])
def test_every_family_shows_the_robot_it_labels(family: str) -> None:
    contrasts = []
    for seed in range(3):
        appearance = replace(random_appearance(seed, family), noise=0.0, jpeg_quality=0)
        renderer = Renderer(PHANTOM, appearance, (320, 240), seed)
        contrasts.append(_contrast(renderer.render(_robot()), renderer.render(None)))
    assert min(contrasts) > 3.0
    assert np.median(contrasts) > 12.0


@pytest.mark.parametrize("family", [*LOOK_FAMILIES, *RARE_FAMILIES])
def test_every_family_shows_the_vessel_it_labels(family: str) -> None:
    for seed in range(2):
        appearance = replace(random_appearance(seed, family), noise=0.0, jpeg_quality=0, cables=0, labels=0, objects=0, dust=0)
        picture = Renderer(PHANTOM, appearance, (320, 240), seed).render(None)
        mask = picture.vessel.astype(np.uint8)
        kernel = np.ones((3, 3), np.uint8)
        inside = cv2.erode(mask, kernel, iterations=2) > 0
        outside = (cv2.dilate(mask, kernel, iterations=8) > 0) & (cv2.dilate(mask, kernel, iterations=2) == 0)
        difference = picture.image[inside].mean(axis=0) - picture.image[outside].mean(axis=0)
        edges = cv2.Laplacian(cv2.cvtColor(picture.image, cv2.COLOR_RGB2GRAY), cv2.CV_32F)
        border = (cv2.dilate(mask, kernel) > 0) & (cv2.erode(mask, kernel) == 0)
        assert np.abs(difference).max() > 2.0 or np.abs(edges)[border].mean() > 3.0, f"seed {seed}"


def test_a_faint_tip_stays_labelled() -> None:
    clear, faint = (replace(QUIET, tip_contrast=value, robot_look="plain_dark") for value in (1.0, 0.25))
    robot = _robot()
    pictures = [Renderer(PHANTOM, appearance).render(robot) for appearance in (clear, faint)]
    empty = Renderer(PHANTOM, clear).render(None)
    tip = np.zeros_like(pictures[0].robot)
    x, y = np.rint(Renderer(PHANTOM, clear).view.project(robot[-2:-1])[0]).astype(int)
    tip[y - 2 : y + 3, x - 2 : x + 3] = True
    assert np.array_equal(pictures[0].robot, pictures[1].robot)
    seen = [np.abs(p.image.astype(int) - empty.image)[tip & p.robot].mean() for p in pictures]
    assert seen[1] < 0.5 * seen[0]


def test_random_appearance_is_a_function_of_seed_and_family() -> None:
    assert len(LOOK_FAMILIES) >= 7
    assert random_appearance(11) == random_appearance(11)
    assert random_appearance(11) != random_appearance(12)
    assert all(random_appearance(4, family).family == family for family in (*LOOK_FAMILIES, *RARE_FAMILIES))
    drawn = [random_appearance(seed) for seed in range(150)]
    assert {appearance.family for appearance in drawn} == set(LOOK_FAMILIES)
    assert {appearance.robot_look for appearance in drawn} == set(ROBOT_LOOKS)
    with pytest.raises(ValueError, match="unknown look family 'glass'; known: silicone_white"):
        random_appearance(0, "glass")


def test_the_device_is_three_to_ten_pixels_wide() -> None:
    for seed in range(100):
        appearance = random_appearance(seed)
        assert 2.9 <= 2 * appearance.robot_radius_mm * appearance.pixels_per_mm <= 10.1
        assert 2.0 <= appearance.pixels_per_mm <= 4.5
