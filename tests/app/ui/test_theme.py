"""Two schemes with the same meanings; a change reaches everything that is open."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from itertools import combinations

import cv2
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.operator.window import OperatorWindow
from app.player.course import MARK_LOOK
from app.ui import theme
from app.ui.theme import DARK, LIGHT, ON_PICTURE, Scheme, fitted, semi_bold
from app.widgets.alerts import LOOK
from app.widgets.event_log import LogKind
from app.widgets.messages import NoticeKind
from app.widgets.mode_bar import MODE_LOOK
from app.widgets.servo_table import TONE_ROLE
from app.widgets.state_badge import StateBadge, state_outline
from app.widgets.theta_gauge import ThetaGauge
from app.widgets.trend_plot import TrendPlot
from core.config.models import PoseConfig
from core.types import PoseState
from tests.app.fakes import make_pose, make_scene, until

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


def test_curves_that_lie_in_one_chart_differ_for_a_deuteranope_in_the_light() -> None:
    for first, second in combinations(("D_HEAD", "D_TAIL", "THETA"), 2):
        assert np.linalg.norm(_as_deuteranope(getattr(LIGHT, first)) - _as_deuteranope(getattr(LIGHT, second))) > 0.12


def test_states_and_overlays_never_change() -> None:
    states = dict(theme.STATE_COLOUR)
    theme.use_scheme(LIGHT)
    assert {state: theme.STATE_COLOUR[state] for state in PoseState} == {state: states[state] for state in PoseState}
    assert theme.STATE_COLOUR[None] == LIGHT.TEXT_FAINT
    assert ON_PICTURE is DARK
    for state in PoseState:
        assert theme.contrast(theme.STATE_INK, theme.STATE_COLOUR[state]) >= 4.5


def test_names_of_the_module_are_those_of_the_scheme_in_use() -> None:
    for scheme in (LIGHT, DARK):
        theme.use_scheme(scheme)
        assert theme.current() is scheme
        for role in ROLES:
            assert getattr(theme, role) == getattr(scheme, role) == theme.of(role)


def test_every_table_names_roles_that_there_are() -> None:
    tables = [
        *(kind.value.role for kind in LogKind),
        *(look.role for look in MARK_LOOK.values()),
        *(look.role for look in LOOK.values()),
        *(look.role for look in MODE_LOOK.values()),
        *(kind.value for kind in NoticeKind),
        *TONE_ROLE.values(),
    ]
    assert set(tables) <= set(ROLES)
    assert theme.of("#12AB34") == "#12AB34"
    assert theme.sheet("a { color: @TEXT; } b { color: @LINE }") == f"a {{ color: {DARK.TEXT}; }} b {{ color: {DARK.LINE} }}"


def ground_of(widget: QWidget) -> str:
    image = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    return image.pixelColor(1, image.height() - 2).name().upper()


def test_style_sheets_of_widgets_follow(qapp: QApplication, qtbot: QtBot) -> None:
    label = QLabel("x")
    qtbot.addWidget(label)
    theme.set_sheet(label, "color: @FAULT;")
    assert DARK.FAULT in label.styleSheet()
    theme.apply_theme(qapp, "light")
    assert LIGHT.FAULT in label.styleSheet()
    button = QPushButton("later")
    qtbot.addWidget(button)
    theme.set_sheet(button, "color: @TEXT;")
    assert LIGHT.TEXT in button.styleSheet()


def test_what_widgets_keep_painted_is_painted_anew(qapp: QApplication, qtbot: QtBot) -> None:
    gauge, badge, trends = ThetaGauge(10.0), StateBadge(PoseConfig(), 0.5), TrendPlot(PoseConfig())
    for widget in (gauge, badge, trends):
        qtbot.addWidget(widget)
        widget.resize(300, 200)
        widget.show()
    gauge.show_pose(make_pose())
    badge.show_scene(make_scene(make_pose()))
    for name, scheme in (("dark", DARK), ("light", LIGHT), ("dark", DARK)):
        theme.apply_theme(qapp, name)
        for widget in (gauge, badge):
            assert ground_of(widget) == scheme.PANEL.upper()
        assert [curve.opts["pen"].color().name().upper() for curve in trends.curves] == [scheme.THETA, scheme.D_HEAD, scheme.D_TAIL]


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


def test_contrast_after_wcag() -> None:
    assert theme.contrast("#000000", "#FFFFFF") == pytest.approx(21.0)
    assert theme.contrast("#777777", "#FFFFFF") == pytest.approx(4.48, abs=0.01)


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
