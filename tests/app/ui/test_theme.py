"""Two schemes with the same meanings; a change reaches everything that is open."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from itertools import combinations

import cv2
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.operator.window import OperatorWindow
from app.ui import theme
from app.ui.theme import DARK, LIGHT, ON_PICTURE, Scheme
from app.widgets.state_badge import state_outline
from core.types import PoseState
from tests.app.fakes import until

ROLES = [field.name for field in fields(Scheme)]
SURFACES = ("WINDOW", "PANEL", "RAISED")
NOT_WRITTEN = {*SURFACES, "LINE", "INK", "GHOST", "VESSEL_VECTOR"}


@pytest.fixture(autouse=True)
def dark_again(qapp: QApplication) -> Iterator[None]:
    yield
    theme.apply_theme(qapp)


def test_everything_that_is_written_can_be_read() -> None:
    for ground in SURFACES:
        for role in (role for role in ROLES if role not in NOT_WRITTEN):
            assert theme.contrast(getattr(LIGHT, role), getattr(LIGHT, ground)) >= 4.5, (role, ground)
        for role in ("TEXT", "TEXT_DIM", "TEXT_FAINT", "FAULT", "D_HEAD", "THETA"):
            assert theme.contrast(getattr(DARK, role), getattr(DARK, ground)) >= 4.5, (role, ground)
    for role in ("ORANGE", "SKY", "GREEN", "YELLOW", "VERMILLION", "PURPLE", "SIM", "LIVE", "PLAYBACK", "FAULT"):
        assert theme.contrast(LIGHT.INK, getattr(LIGHT, role)) >= 4.5, role
    for state in PoseState:
        assert theme.contrast(theme.INK, theme.STATE_COLOUR[state]) >= 4.5, state


def test_states_and_overlays_never_change() -> None:
    states = dict(theme.STATE_COLOUR)
    theme.use_scheme(LIGHT)
    assert {state: theme.STATE_COLOUR[state] for state in PoseState} == {state: states[state] for state in PoseState}
    assert theme.STATE_COLOUR[None] == LIGHT.TEXT_FAINT
    assert ON_PICTURE is DARK
    for state in PoseState:
        assert theme.contrast(theme.STATE_INK, theme.STATE_COLOUR[state]) >= 4.5


def test_the_desktop_decides_when_it_is_asked(qapp: QApplication, monkeypatch: pytest.MonkeyPatch) -> None:
    schemes = Qt.ColorScheme
    for desktop, scheme in ((schemes.Light, LIGHT), (schemes.Dark, DARK), (schemes.Unknown, DARK)):
        assert theme._scheme_of(theme.Theme.SYSTEM, desktop) is scheme
    assert theme._scheme_of(theme.Theme.DARK, schemes.Light) is DARK
    theme.apply_theme(qapp, "system")
    monkeypatch.setattr(theme, "_scheme_of", lambda chosen, _desktop: LIGHT if chosen is theme.Theme.SYSTEM else DARK)
    qapp.styleHints().colorSchemeChanged.emit(schemes.Light)
    assert theme.current() is LIGHT
    theme.apply_theme(qapp, "dark")
    qapp.styleHints().colorSchemeChanged.emit(schemes.Light)
    assert theme.current() is DARK, "whoever chose dark keeps it"


def test_a_running_window_follows(running: OperatorWindow, qapp: QApplication, qtbot: QtBot) -> None:
    legend = running.panels._legend
    assert DARK.THETA in legend.text()
    theme.apply_theme(qapp, "light")
    assert LIGHT.THETA in legend.text()
    assert running.panels.badge.grab().toImage().pixelColor(1, 1).name().upper() == LIGHT.PANEL
    shown = running.shown_tick
    until(qtbot, lambda: running.shown_tick is not shown)


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
