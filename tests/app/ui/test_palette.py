"""Readable and colour-blind safe."""

from __future__ import annotations

from itertools import combinations

import cv2
import numpy as np
import pytest

from app.ui import theme
from app.ui.theme import fitted, semi_bold
from app.widgets.state_badge import state_outline
from core.types import PoseState


def test_contrast_after_wcag() -> None:
    assert theme.contrast("#000000", "#FFFFFF") == pytest.approx(21.0)
    assert theme.contrast("#777777", "#FFFFFF") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("text", [theme.TEXT, theme.TEXT_DIM, theme.TEXT_FAINT, theme.FAULT, theme.D_HEAD, theme.THETA])
@pytest.mark.parametrize("ground", [theme.WINDOW, theme.PANEL, theme.RAISED])
def test_text_can_be_read_on_every_surface(text: str, ground: str) -> None:
    assert theme.contrast(text, ground) >= 4.5


def test_letters_can_be_read_on_their_state() -> None:
    for state in PoseState:
        assert theme.contrast(theme.INK, theme.STATE_COLOUR[state]) >= 4.5


def _as_deuteranope(name: str) -> np.ndarray:
    """Viénot, Brettel and Mollon (1999), linear RGB."""
    linear = (np.array(theme.rgb(name)) / 255.0) ** 2.2
    matrix = np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]])
    return np.clip(matrix @ linear, 0, 1) ** (1 / 2.2)


def test_state_colours_differ_for_a_deuteranope() -> None:
    for first, second in combinations(PoseState, 2):
        gap = np.linalg.norm(_as_deuteranope(theme.STATE_COLOUR[first]) - _as_deuteranope(theme.STATE_COLOUR[second]))
        assert gap > 0.12, (first, second)


def test_states_differ_in_shape_too() -> None:
    """At least a tenth of the larger of two shapes lies outside the other one."""

    def filled(state: PoseState) -> np.ndarray:
        canvas = np.zeros((220, 220), np.uint8)
        cv2.fillPoly(canvas, [np.round(110 + 100 * state_outline(state)).astype(np.int32)], 1)
        return canvas.astype(bool)

    for first, second in combinations(PoseState, 2):
        one, other = filled(first), filled(second)
        assert (one ^ other).sum() > 0.1 * max(one.sum(), other.sum()), (first, second)


def test_text_is_fitted_to_its_place(themed: None) -> None:
    font = semi_bold(40)
    assert fitted(font, "Moving away", 10_000).pixelSize() == 40
    assert fitted(font, "Moving away", 120).pixelSize() < 30
    assert fitted(font, "Moving away", 1).pixelSize() == 11
