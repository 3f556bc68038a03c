"""Readable and colour-blind safe."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from app import palette
from app.state_shapes import state_outline
from app.theme import fitted, semi_bold
from core.types import PoseState


def test_contrast_after_wcag() -> None:
    assert palette.contrast("#000000", "#FFFFFF") == pytest.approx(21.0)
    assert palette.contrast("#777777", "#FFFFFF") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("text", [palette.TEXT, palette.TEXT_DIM, palette.TEXT_FAINT, palette.FAULT, palette.D_HEAD, palette.THETA])
@pytest.mark.parametrize("ground", [palette.WINDOW, palette.PANEL, palette.RAISED])
def test_text_can_be_read_on_every_surface(text: str, ground: str) -> None:
    assert palette.contrast(text, ground) >= 4.5


def test_letters_can_be_read_on_their_state() -> None:
    for state in PoseState:
        assert palette.contrast(palette.INK, palette.STATE_COLOUR[state]) >= 4.5


def _as_deuteranope(name: str) -> np.ndarray:
    """Viénot, Brettel and Mollon (1999), linear RGB."""
    linear = (np.array(palette.rgb(name)) / 255.0) ** 2.2
    matrix = np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]])
    return np.clip(matrix @ linear, 0, 1) ** (1 / 2.2)


def test_state_colours_differ_for_a_deuteranope() -> None:
    for first, second in combinations(PoseState, 2):
        gap = np.linalg.norm(_as_deuteranope(palette.STATE_COLOUR[first]) - _as_deuteranope(palette.STATE_COLOUR[second]))
        assert gap > 0.12, (first, second)


def test_states_differ_in_shape_too() -> None:
    """Areas in units of the box of side 2: circle 2.8, square 3.0 but with far corners, triangle 2.0, diamond 2.1."""

    def profile(state: PoseState) -> np.ndarray:
        outline = state_outline(state)
        angle = np.arctan2(outline[:, 1], outline[:, 0])
        order = np.argsort(angle)
        grid = np.linspace(-np.pi, np.pi, 90)
        return np.interp(grid, angle[order], np.linalg.norm(outline, axis=1)[order], period=2 * np.pi)

    for first, second in combinations(PoseState, 2):
        assert np.abs(profile(first) - profile(second)).max() > 0.15, (first, second)


def test_text_is_fitted_to_its_place(themed: None) -> None:
    font = semi_bold(40)
    assert fitted(font, "Moving away", 10_000).pixelSize() == 40
    assert fitted(font, "Moving away", 120).pixelSize() < 30
    assert fitted(font, "Moving away", 1).pixelSize() == 11
