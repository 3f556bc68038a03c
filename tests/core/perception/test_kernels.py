"""The kernels against what NumPy, OpenCV and scikit-image say, on all kinds of arrays."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core import geometry
from core.perception import compiled
from core.types import Points


def walk(seed: int, count: int) -> Points:
    """A line that may stand still from one point to the next."""
    steps = np.random.default_rng(seed).normal(0.0, 3.0, (count, 2))
    steps[np.random.default_rng(seed + 1).random(count) < 0.2] = 0.0
    return np.cumsum(steps, axis=0)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 60), step=st.floats(0.3, 20.0))
def test_arc_length_and_places_along_it(seed: int, count: int, step: float) -> None:
    points = walk(seed, count)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    np.testing.assert_allclose(geometry.arc_length(points), along, atol=1e-9)
    wanted = np.linspace(-5.0, along[-1] + 5.0, 37)
    places = np.column_stack([np.interp(wanted, along, points[:, axis]) for axis in (0, 1)])
    np.testing.assert_allclose(geometry.point_at(points, along, wanted), places, atol=1e-7)
    if along[-1] > 0.0:
        marks = np.linspace(0.0, along[-1], max(2, round(along[-1] / step) + 1))
        even = np.column_stack([np.interp(marks, along, points[:, axis]) for axis in (0, 1)])
        np.testing.assert_allclose(geometry.resample(points, step), even, atol=1e-7)
    start, end = sorted(np.random.default_rng(seed).uniform(-2.0, along[-1] + 2.0, 2))
    part = geometry.cut(points, start, end)
    inner = points[(along > max(start, 0.0)) & (along < min(end, along[-1]))]
    np.testing.assert_allclose(part[1:-1], inner)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 40), x=st.floats(-30.0, 30.0), y=st.floats(-30.0, 30.0))
def test_the_nearest_place_is_none_farther_than_any_other(seed: int, count: int, x: float, y: float) -> None:
    points = walk(seed, count)
    distance, position, place = geometry.nearest(points, (x, y))
    fine = geometry.point_at(points, geometry.arc_length(points), np.linspace(0.0, geometry.arc_length(points)[-1], 4000))
    assert distance <= np.hypot(*(fine - (x, y)).T).min() + 1e-9
    assert distance == pytest.approx(np.hypot(place[0] - x, place[1] - y), abs=1e-9)
    assert geometry.point_at(points, geometry.arc_length(points), np.array([position]))[0] == pytest.approx(place, abs=1e-6)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), count=st.integers(2, 70), sigma=st.floats(0.5, 6.0), keeps=st.booleans())
def test_smoothing_is_a_weighted_mean_of_the_line_mirrored_through_its_ends(
    seed: int, count: int, sigma: float, keeps: bool
) -> None:
    points = walk(seed, count)
    pad = min(count - 1, int(np.ceil(3.0 * sigma)))
    square = (np.arange(-pad, pad + 1) / sigma) ** 2
    weights = np.exp(-0.5 * square)
    if keeps and pad >= 2:
        weights *= (weights * square**2).sum() - (weights * square).sum() * square
    weights /= weights.sum()
    mirrored = np.concatenate([2.0 * points[0] - points[pad:0:-1], points, 2.0 * points[-1] - points[-2 : -pad - 2 : -1]])
    expected = np.column_stack([np.correlate(mirrored[:, axis], weights) for axis in (0, 1)])
    np.testing.assert_allclose(geometry.smooth(points, sigma, keeps_bends=keeps), expected, atol=1e-7)


@pytest.mark.parametrize("shape", [(480, 640), (37, 20), (1, 9), (9, 1), (1, 1)])
def test_a_map_is_read_as_opencv_reads_it_and_beyond_its_border_as_there(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(7)
    values = rng.random(shape, np.float32)
    places = rng.uniform(-3.0, 3.0, (300, 2)) + rng.random((300, 2)) * (shape[1], shape[0])
    across, down = places.astype(np.float32).T
    there = cv2.remap(values, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    np.testing.assert_allclose(geometry.sample(values, places), there.ravel(), atol=1e-4)
    mask = values > 0.5
    np.testing.assert_allclose(geometry.sample(mask, places), geometry.sample(mask.astype(np.float32), places), atol=1e-12)


def test_every_kernel_is_compiled_before_it_is_called() -> None:
    compiled.load()
    kernels = [value for value in vars(compiled).values() if hasattr(value, "nopython_signatures")]
    assert len(kernels) > 20
    assert all(kernel.nopython_signatures and not kernel._can_compile for kernel in kernels)


@settings(max_examples=80)
@given(seed=st.integers(0, 10**6), expected=st.floats(0.0, 30.0), turn=st.floats(0.0, 6.3), blur=st.sampled_from([0.0, 1.0, 3.0]))
def test_walls_are_where_the_level_first_falls_through_a_half(seed: int, expected: float, turn: float, blur: float) -> None:
    rng = np.random.default_rng(seed)
    level = (rng.random((60, 80)) > 0.2).astype(np.float32)
    level = cv2.GaussianBlur(level, (0, 0), blur) if blur else level
    points, across = rng.uniform(5.0, 55.0, (4, 2)), np.tile([np.cos(turn), np.sin(turn)], (4, 1))
    reach, slope = compiled.wall_distances(level, points, across, np.full(4, expected), 4)
    for side, sign in enumerate((1.0, -1.0)):
        for i in range(4):
            steps = np.maximum(expected + np.arange(-4.0, 5.0), 0.0)
            inside = geometry.sample(level, points[i] + sign * steps[:, None] * across[i])
            first = int((inside < 0.5).argmax())
            if first == 0:
                assert np.isnan(reach[side, i])
                continue
            before, after = inside[first - 1], inside[first]
            assert reach[side, i] == pytest.approx(steps[first - 1] + (before - 0.5) / max(before - after, 1e-6), abs=1e-6)
            low, high = max(first - 2, 0), min(first + 1, 8)
            assert slope[side, i] == pytest.approx((inside[low] - inside[high]) / (high - low), abs=1e-9)


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), side=st.integers(1, 12))
def test_the_middle_of_the_robot_is_the_mean_place_of_what_falls_outwards(seed: int, side: int) -> None:
    rng = np.random.default_rng(seed)
    seen = cv2.GaussianBlur(rng.random((50, 50)).astype(np.float32), (0, 0), 2.0)
    points, turn = rng.uniform(-2.0, 52.0, (5, 2)), rng.uniform(0.0, 6.3, 5)
    across = np.column_stack([np.cos(turn), np.sin(turn)])
    shift, total = compiled.probability_centres(seen, points, across, side, 3.0)
    for i in range(5):
        offsets = np.arange(-side, side + 1.0)
        places = points[i] + offsets[:, None] * across[i]
        weight = np.where(((places > -0.5) & (places < 49.5)).all(axis=1), geometry.sample(seen, places), 0.0)
        weight[side:] = np.minimum.accumulate(weight[side:])
        weight[side::-1] = np.minimum.accumulate(weight[side::-1])
        assert total[i] == pytest.approx(weight.sum(), abs=1e-6)
        wanted = np.clip(offsets @ weight / weight.sum(), -3.0, 3.0) if weight.sum() > 1.0 else 0.0
        assert shift[i] == pytest.approx(wanted, abs=1e-6)


def test_kernels_are_loaded_by_the_first_call_and_never_by_a_twin() -> None:
    code = """
import sys
import numpy as np
import app.commands.perceive, app.commands.train, core.perception.pipeline, core.session.reader
from core.config.models import TwinConfig
from core import geometry
from core.perception import compiled
from hardware.twin.world import TwinWorld
world = TwinWorld(TwinConfig(image_width_px=160, image_height_px=120))
world.insert(20.0)
world.frame()
print("numba" in sys.modules)
geometry.arc_length(np.zeros((2, 2)))
print("numba" in sys.modules)
"""
    root = Path(__file__).parents[3]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=root)
    assert done.stdout.split() == ["False", "True"], done.stderr
