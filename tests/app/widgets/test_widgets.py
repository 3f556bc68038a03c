"""Each widget shows one value; what it shows can be read back as text."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QMenu, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot

from app.operator.manual_drive import Motion
from app.ui import theme
from app.widgets.advice_line import AdviceLine
from app.widgets.distance_bars import DistanceBars
from app.widgets.jog_panel import JogPanel
from app.widgets.messages import Notice, NoticeKind
from app.widgets.mode_bar import ModeBadge, MouseHeld
from app.widgets.overlay_bar import OverlayBar
from app.widgets.performance_panel import PerformancePanel
from app.widgets.phantom_picker import PhantomPicker
from app.widgets.scene_overlay import Layer
from app.widgets.sim_banner import SimBanner
from app.widgets.state_badge import StateBadge
from app.widgets.theta_gauge import ThetaGauge
from app.widgets.trend_plot import SPAN_S, TrendPlot
from core.config.models import JogConfig, PoseConfig
from core.config.safety import ServosConfig
from core.types import Advice, PoseState, Reason, Refusal, RobotStatus, Speed
from hardware.rig import RigKind
from tests.app.fakes import make_pose, make_scene, make_tick

LIMITS = PoseConfig()


def colours_in(widget: QWidget) -> set[str]:
    image = widget.grab().toImage()
    return {image.pixelColor(x, y).name().upper() for x in range(0, image.width(), 2) for y in range(0, image.height(), 2)}


# ---- state badge


@pytest.mark.parametrize("state", list(PoseState))
def test_badge_shows_letter_title_and_colour_of_the_state(qtbot: QtBot, state: PoseState) -> None:
    badge = StateBadge(LIMITS, 0.5)
    qtbot.addWidget(badge)
    badge.resize(480, badge.height())
    badge.show_scene(make_scene(make_pose(state)))
    assert badge.letter == state.value
    assert badge.accessibleDescription().startswith(f"{state.value}: {badge.title}")
    assert theme.STATE_COLOUR[state].upper() in colours_in(badge)


def test_badge_shows_a_dash_and_the_reason_without_a_pose(qtbot: QtBot) -> None:
    badge = StateBadge(LIMITS, 0.5)
    qtbot.addWidget(badge)
    badge.show_scene(make_scene(make_pose()))
    badge.show_scene(make_scene(refusal=Refusal(Reason.OUTSIDE_VESSEL, "41 % inside, 60 % needed")), renew_text=False)
    assert (badge.letter, badge.title) == ("-", "Robot is outside the vessel")
    assert badge.why.endswith("41 % inside, 60 % needed")


def test_badge_keeps_its_sentence_until_texts_are_renewed_but_never_a_wrong_letter(qtbot: QtBot) -> None:
    badge = StateBadge(LIMITS, 0.5)
    qtbot.addWidget(badge)
    badge.show_scene(make_scene(make_pose(PoseState.C, head=14.0)))
    before = badge.why
    badge.show_scene(make_scene(make_pose(PoseState.C, head=19.0)), renew_text=False)
    assert badge.why == before
    badge.show_scene(make_scene(make_pose(PoseState.B, head=6.5, tail=12.0)), renew_text=False)
    assert badge.letter == "B"
    assert badge.why != before


def _shown(badge: StateBadge, confidence: float, *, renew_text: bool = True) -> tuple[bool, str]:
    badge.show_scene(make_scene(replace(make_pose(PoseState.D), confidence=confidence)), renew_text=renew_text)
    return badge.is_unsure, badge.sureness


def test_badge_says_how_sure_it_is_and_leaves_the_shape_of_an_unsure_state_open(qtbot: QtBot) -> None:
    badge = StateBadge(LIMITS, 0.5)
    qtbot.addWidget(badge)
    badge.resize(480, badge.height())
    assert _shown(badge, 0.974) == (False, "97 % sure")
    filled = _share_of(badge, theme.STATE_COLOUR[PoseState.D])
    assert _shown(badge, 1.0) == (False, "99 % sure"), "nothing is as sure as 100 %"
    assert _shown(badge, 0.499) == (True, "unsure: 49 %")
    assert badge.accessibleDescription().startswith("D: Crossed (unsure: 49 %). ")
    assert 0 < _share_of(badge, theme.STATE_COLOUR[PoseState.D]) < filled / 3
    badge.show_scene(make_scene(refusal=Refusal(Reason.NO_ROBOT)))
    assert (badge.is_unsure, badge.sureness) == (False, "")
    assert _shown(badge, 0.52) == (False, "52 % sure"), "after a refusal it begins anew"


def test_the_limit_decides_whether_a_badge_is_unsure_and_nothing_that_was_before(qtbot: QtBot) -> None:
    badge = StateBadge(LIMITS, 0.57)
    qtbot.addWidget(badge)
    assert _shown(badge, 0.57) == (False, "57 % sure"), "0.57 is a little less than that in binary"
    assert _shown(badge, 0.569) == (True, "unsure: 56 %")
    assert _shown(badge, 0.57) == (False, "57 % sure")
    assert _shown(badge, 0.1, renew_text=False) == (False, "57 % sure"), "texts are renewed together"
    badge.set_limits(LIMITS, 0.8)
    assert _shown(badge, 0.79)[0]


def test_advice_on_a_pose_that_is_unsure_says_so(qtbot: QtBot) -> None:
    line = AdviceLine()
    qtbot.addWidget(line)
    advice = Advice(Speed.SLOWEST, 1.0, -18.4, "moving away")
    line.show_advice(advice, PoseState.C, "", is_unsure=True)
    assert line.text == line.accessibleDescription() == "Slowest, 18° left: the pose is unsure; moving away"
    line.show_advice(advice, PoseState.C, "")
    assert line.text == "Slowest, 18° left: moving away"


def _share_of(badge: StateBadge, colour: str) -> int:
    image = badge.grab().toImage()
    pixels = ((x, y) for x in range(image.width()) for y in range(image.height()))
    return sum(image.pixelColor(x, y).name().upper() == colour.upper() for x, y in pixels)


# ---- gauge and bars


def test_gauge_shows_sign_number_and_side(qtbot: QtBot) -> None:
    gauge = ThetaGauge(10.0)
    qtbot.addWidget(gauge)
    assert (gauge.text, gauge.direction) == ("–", "")
    gauge.show_pose(make_pose(theta=18.44))
    assert (gauge.text, gauge.direction) == ("+18.4°", "right")
    gauge.show_pose(make_pose(theta=-132.0))
    assert (gauge.text, gauge.direction) == ("−132.0°", "left")
    gauge.show_pose(None)
    assert gauge.text == "–"


@pytest.mark.parametrize(("theta", "side"), [(60.0, 1), (-60.0, -1), (170.0, 1), (-170.0, -1)])
def test_needle_points_to_the_side_of_the_sign(qtbot: QtBot, theta: float, side: int) -> None:
    gauge = ThetaGauge(10.0)
    qtbot.addWidget(gauge)
    gauge.resize(300, 200)
    gauge.show_pose(make_pose(theta=theta))
    image = gauge.grab().toImage()
    needle = [
        x for x in range(image.width()) for y in range(image.height()) if image.pixelColor(x, y).name().upper() == theme.THETA
    ]
    assert needle
    assert (np.mean(needle) - image.width() / 2) * side > 5


def test_needle_follows_at_once_the_number_when_texts_are_renewed(qtbot: QtBot) -> None:
    gauge = ThetaGauge(10.0)
    qtbot.addWidget(gauge)
    gauge.show_pose(make_pose(theta=10.0))
    gauge.show_pose(make_pose(theta=20.0), renew_text=False)
    assert gauge.text == "+10.0°"
    gauge.show_pose(make_pose(theta=20.0))
    assert gauge.text == "+20.0°"


def test_bars_show_unsigned_numbers_and_grow_to_their_side(qtbot: QtBot) -> None:
    bars = DistanceBars(6.0)
    qtbot.addWidget(bars)
    bars.resize(300, 160)
    assert bars.texts == ("–", "–")
    bars.show_pose(make_pose(head=-14.2, tail=6.1))
    assert bars.texts == ("14.2 px", "6.1 px")
    image = bars.grab().toImage()
    track = [x for x in range(300) if any(image.pixelColor(x, y).name().upper() == theme.D_HEAD for y in range(52, 70))]
    assert track
    assert max(track) <= 150, "left of the middle"
    bars.show_pose(make_pose(head=500.0, tail=1.0))
    bars.grab()
    bars.show_pose(None)
    assert bars.texts == ("–", "–")


# ---- advice


def test_advice_is_blank_with_a_reason_when_there_is_none(qtbot: QtBot) -> None:
    line = AdviceLine()
    qtbot.addWidget(line)
    line.show_advice(Advice(Speed.SLOWEST, 1.0, -18.4, "moving away"), PoseState.C, "")
    assert line.text == "Slowest, 18° left: moving away"
    line.show_advice(None, None, "no robot in view", renew_text=False)
    assert line.text == "No advice: no robot in view"


@pytest.mark.parametrize("speed", list(Speed))
def test_advice_paints_every_speed(qtbot: QtBot, speed: Speed) -> None:
    line = AdviceLine()
    qtbot.addWidget(line)
    line.resize(700, 68)
    line.show_advice(Advice(speed, 1.0, 200.0, "a reason " * 40), PoseState.D, "")
    assert not line.grab().isNull()


# ---- trends


def test_frames_without_a_pose_are_gaps(qtbot: QtBot) -> None:
    plot = TrendPlot(LIMITS)
    qtbot.addWidget(plot)
    for k in range(5):
        plot.add(make_scene(None if k == 2 else make_pose(theta=float(k)), captured_s=k * 0.1))
    plot._draw()
    ago, theta = plot.curves[0].getData()
    np.testing.assert_allclose(ago, [-0.4, -0.3, -0.2, -0.1, 0.0], atol=1e-9)
    np.testing.assert_array_equal(theta, [0.0, 1.0, np.nan, 3.0, 4.0])


def test_trends_go_on_to_the_left_while_nothing_comes(qtbot: QtBot) -> None:
    """Where now is there is no value: the newest one is not taken for it."""
    plot = TrendPlot(LIMITS)
    qtbot.addWidget(plot)
    for k in range(50):
        plot._pace.reset()
        plot.add(make_scene(make_pose(theta=5.0), index=k, captured_s=100.0 + 0.1 * k))
    newest_s = plot.curves[0].xData[-1]
    assert newest_s == 0.0
    plot._pace.reset()
    plot.show_silence(12.0)
    assert plot.curves[0].xData[-1] == pytest.approx(-12.0)
    plot._pace.reset()
    plot.show_silence(SPAN_S + 1.0)
    assert len(plot.curves[0].xData) == 0
    plot._pace.reset()
    plot.add(make_scene(make_pose(theta=5.0), index=50, captured_s=120.0))
    assert plot.curves[0].xData[-1] == 0.0


def test_trends_hold_thirty_seconds_and_restart_when_the_clock_jumps_back(qtbot: QtBot) -> None:
    plot = TrendPlot(LIMITS)
    qtbot.addWidget(plot)
    for k in range(1200):
        plot.add(make_scene(make_pose(), captured_s=k / 30))
    plot._draw()
    ago, _ = plot.curves[0].getData()
    assert ago[0] == pytest.approx(-SPAN_S, abs=0.04)
    plot.add(make_scene(make_pose(), captured_s=0.0))
    plot._draw()
    assert len(plot.curves[0].getData()[0]) == 1


# ---- performance


def test_performance_shows_percentiles_and_marks_a_long_block(qtbot: QtBot) -> None:
    panel = PerformancePanel()
    qtbot.addWidget(panel)
    panel.resize(260, 180)
    panel.add(make_tick(), 12.4)
    assert "network" not in panel.text
    assert "total 30.0 30.0" in panel.text
    assert "segmentation 21.0 21.0" in panel.text
    assert "block ms 12" in panel.text
    panel.clear()
    assert "total" not in panel.text
    panel.add(make_tick(), 80.0)
    assert theme.FAULT.upper() in colours_in(panel)


# ---- switches, picker, panels


def test_chips_switch_their_layer(qtbot: QtBot) -> None:
    bar = OverlayBar()
    qtbot.addWidget(bar)
    seen: list[tuple[Layer, bool]] = []
    bar.toggled.connect(lambda layer, on: seen.append((layer, on)))
    bar.toggle(Layer.VECTORS)
    assert seen == [(Layer.VECTORS, False)]
    assert not bar.is_on(Layer.VECTORS)
    bar.set_all(True)
    assert seen[-1] == (Layer.VECTORS, True)


@pytest.mark.parametrize(("width", "rows"), [(1200, 1), (600, 2), (420, 2)])
def test_chips_go_in_two_rows_where_one_would_cut_their_names(qtbot: QtBot, width: int, rows: int) -> None:
    bar = OverlayBar()
    qtbot.addWidget(bar)
    bar.resize(width, bar.heightForWidth(width))
    bar.grab()
    chips = bar.findChildren(QAbstractButton)
    assert len({chip.y() for chip in chips}) == rows
    assert all(chip.width() >= chip.sizeHint().width() for chip in chips) is (width > 420)
    for chip in chips:
        assert bar.rect().contains(chip.geometry())
        assert not any(chip.geometry().intersects(other.geometry()) for other in chips if other is not chip)
    in_order = sorted(chips, key=lambda chip: (chip.y(), chip.x()))
    assert [chip.text() for chip in in_order] == [layer.value.label for layer in Layer]


def test_layers_have_keys_of_their_own() -> None:
    assert [layer.value.key for layer in Layer] == [*"123456789", "G"]


@pytest.mark.parametrize("kind", list(RigKind))
def test_banner_says_what_the_picture_is(qtbot: QtBot, kind: RigKind) -> None:
    banner = SimBanner(kind)
    qtbot.addWidget(banner)
    banner.resize(500, 34)
    banner.grab()
    assert banner.word == kind.value
    assert banner.accessibleName().startswith(kind.value)


def test_a_live_rig_without_servos_does_not_claim_that_they_move(qtbot: QtBot) -> None:
    banner = SimBanner(RigKind.LIVE, has_servos=False)
    qtbot.addWidget(banner)
    assert banner.word == "LIVE"
    assert "no servos" in banner.accessibleName()


def test_mode_badge_says_advisory(qtbot: QtBot) -> None:
    badge = ModeBadge()
    qtbot.addWidget(badge)
    badge.grab()
    assert "ADVISORY" in badge.accessibleName()


def test_picker_gives_names_as_the_configuration_writes_them(qtbot: QtBot) -> None:
    picker = PhantomPicker([("s_curve", "S-curve"), ("tree", "Tree")], "tree")
    qtbot.addWidget(picker)
    chosen: list[str] = []
    picker.chosen.connect(chosen.append)
    assert (picker.name, picker.title) == ("tree", "Tree")
    picker._combo.setCurrentIndex(0)
    picker._combo.activated.emit(0)
    picker.roll()
    picker.roll()
    assert chosen == ["s_curve", "random:1", "random:2"]
    assert picker.title == "random 2"


def test_the_wheel_chooses_nothing(qtbot: QtBot) -> None:
    picker = PhantomPicker([("s_curve", "S-curve"), ("tree", "Tree")], "random:5")
    qtbot.addWidget(picker)
    chosen: list[str] = []
    picker.chosen.connect(chosen.append)
    for widget in (picker._combo, picker._seed):
        for notch in (-120, 120):
            middle = QPointF(widget.rect().center())
            event = QWheelEvent(
                middle,
                widget.mapToGlobal(middle),
                QPoint(),
                QPoint(0, notch),
                Qt.MouseButton.NoButton,
                Qt.KeyboardModifier.NoModifier,
                Qt.ScrollPhase.NoScrollPhase,
                False,
            )
            QApplication.sendEvent(widget, event)
    assert chosen == []
    assert picker.name == "random:5"


def test_a_motion_held_with_the_mouse_ends_with_a_release_that_a_menu_got(qtbot: QtBot) -> None:
    panel, menu = JogPanel(2.0), QMenu()
    qtbot.addWidget(panel)
    qtbot.addWidget(menu)
    menu.addAction("Open")
    panel.show()
    heard: list[tuple[str, Motion]] = []
    panel.pressed.connect(lambda motion: heard.append(("down", motion)))
    panel.released.connect(lambda motion: heard.append(("up", motion)))
    cap = next(cap for cap in panel.findChildren(MouseHeld) if cap.accessibleName().startswith("advance"))
    QTest.mousePress(cap, Qt.MouseButton.LeftButton)
    menu.popup(panel.mapToGlobal(panel.rect().topLeft()))
    QTest.mouseRelease(menu, Qt.MouseButton.RightButton)
    assert heard == [("down", Motion.ADVANCE)]
    QTest.mouseRelease(menu, Qt.MouseButton.LeftButton)
    assert heard == [("down", Motion.ADVANCE), ("up", Motion.ADVANCE)]
    menu.close()


def test_jog_panel_says_aloud_what_it_shows(qtbot: QtBot) -> None:
    panel = JogPanel(max_pull_mm=2.0)
    qtbot.addWidget(panel)
    panel.show_status(RobotStatus(0.0, 84.0, 0.0, (1.3, -0.7, 0.3, 0.3), (0.0,) * 4))
    assert panel.readout == "bend 0.50, pitch 0.00, in 84 mm"
    assert panel._readout.accessibleName()
    assert panel._readout.accessibleDescription() == panel.readout
    panel.set_enabled(False, "Fault")
    assert panel.accessibleDescription() == "Fault"


def test_jog_panel_says_what_a_held_key_makes(qtbot: QtBot) -> None:
    panel = JogPanel(2.0)
    qtbot.addWidget(panel)
    assert panel.speeds == "", "no rig is known"
    panel.set_speeds(JogConfig(bend_rate_per_s=1.2, advance_mm_s=10.0, delivery_mm_s=8.0), ServosConfig(max_pull_mm=2.0))
    assert panel.speeds == "feed 10, sheath 8, wires 2.4 mm/s"
    assert panel.speeds in panel._readout.accessibleDescription()
    assert panel._caps[Motion.WITHDRAW].toolTip() == "sheath back: hold to move, release to stop; 8 mm/s"
    assert panel._caps[Motion.PITCH_UP].toolTip().endswith("the tendons are pulled 2.4 mm/s")
    heard: list[float] = []
    panel.speed_changed.connect(heard.append)
    panel._speed.setCurrentIndex(1)
    assert heard == [0.5]
    assert panel.speeds == "feed 5, sheath 4, wires 1.2 mm/s"
    panel.set_speeds(JogConfig(), ServosConfig(max_pull_mm=1.0))
    assert panel.speeds == "feed 5, sheath 5, wires 0.6 mm/s", "another rig has the chosen share, too"


def test_pitch_is_seen_and_not_only_said(qtbot: QtBot) -> None:
    panel = JogPanel(2.0)
    qtbot.addWidget(panel)
    panel.resize(203, 170)
    panel.show()
    panel.show_status(RobotStatus(0.0, 84.0, 0.0, (0.3, 0.3, 0.3, 0.3), (0.0,) * 4))
    before = panel._readout.grab().toImage()
    panel.show_status(RobotStatus(0.0, 84.0, 0.0, (0.3, 0.3, 1.7, -1.1), (0.0,) * 4))
    assert panel._readout.grab().toImage() != before


def test_picker_shows_a_random_phantom_of_the_configuration(qtbot: QtBot) -> None:
    picker = PhantomPicker([("tree", "Tree")], "random:77")
    qtbot.addWidget(picker)
    assert picker.name == "random:77"


def test_seed_counts_when_confirmed_not_at_each_digit(qtbot: QtBot) -> None:
    holder = QWidget()
    qtbot.addWidget(holder)
    picker = PhantomPicker([("tree", "Tree")], "random:1")
    QVBoxLayout(holder).addWidget(picker)
    holder.show()
    chosen: list[str] = []
    picker.chosen.connect(chosen.append)
    picker._seed.setFocus()
    picker._seed.selectAll()
    QTest.keyClicks(picker._seed, "42")
    assert chosen == []
    QTest.keyClick(picker._seed, Qt.Key.Key_Return)
    assert chosen == ["random:42"]


@pytest.mark.parametrize("came_by", ["key", "configuration"])
def test_the_seed_before_this_one_can_be_typed_again(qtbot: QtBot, came_by: str) -> None:
    picker = PhantomPicker([("tree", "Tree")], "random:1")
    qtbot.addWidget(picker)
    picker.show()
    chosen: list[str] = []
    picker.chosen.connect(chosen.append)
    if came_by == "key":
        picker.roll()
    else:
        picker.show_name("random:2")
    assert picker.name == "random:2"
    picker._seed.setFocus()
    picker._seed.selectAll()
    QTest.keyClicks(picker._seed, "1")
    QTest.keyClick(picker._seed, Qt.Key.Key_Return)
    assert chosen[-1:] == ["random:1"]


def test_key_caps_light_up_and_can_be_held_with_the_mouse(qtbot: QtBot) -> None:
    panel = JogPanel(2.0)
    qtbot.addWidget(panel)
    panel.resize(280, 140)
    panel.show()
    events: list[tuple[str, Motion]] = []
    panel.pressed.connect(lambda motion: events.append(("down", motion)))
    panel.released.connect(lambda motion: events.append(("up", motion)))
    panel.show_held(frozenset({Motion.ADVANCE}))
    lit = [motion for motion, cap in panel._caps.items() if cap.is_lit]
    assert lit == [Motion.ADVANCE]
    cap = panel._caps[Motion.STEER_LEFT]
    qtbot.mousePress(cap, Qt.MouseButton.LeftButton, pos=QPoint(5, 5))
    qtbot.mouseRelease(cap, Qt.MouseButton.LeftButton, pos=QPoint(500, 5))
    assert events == [("down", Motion.STEER_LEFT), ("up", Motion.STEER_LEFT)]
    qtbot.mousePress(cap, Qt.MouseButton.LeftButton)
    panel.hide()
    assert events[-1] == ("up", Motion.STEER_LEFT), "a hidden cap holds nothing"


def test_readout_shows_how_far_the_robot_is_in(qtbot: QtBot) -> None:
    panel = JogPanel(2.0)
    qtbot.addWidget(panel)
    panel.show_status(RobotStatus(0.0, 84.2, 0.0, (-1.0, 1.0, 0, 0), (0, 0, 0, 0)))
    assert panel.readout == "bend -0.50, pitch 0.00, in 84 mm"
    panel.show_status(None)
    assert panel.readout == "bend –, pitch –, in – mm", "a straight head would be something that is known"


def test_readout_shows_nothing_of_joints_of_which_nobody_knows_where_they_are(qtbot: QtBot) -> None:
    panel = JogPanel(2.0)
    qtbot.addWidget(panel)
    panel.show_known((False,) * 7)
    panel.show_status(RobotStatus(0.0, 0.0, 0.0, (0.0,) * 4, (0.0,) * 4))
    assert panel.readout == "bend –, pitch –, in – mm"
    unknown = panel._readout.grab().toImage()
    panel.show_known((True, True, False, True, True, True, True))
    assert panel.readout == "bend 0.00, pitch –, in 0 mm"
    assert panel._readout.grab().toImage() != unknown, "a bar without a mark is no straight head"
    panel.show_known((True,) * 4 + (False, True, True))
    assert panel.readout == "bend 0.00, pitch 0.00, in – mm"


def test_notice_shows_title_detail_and_a_way_out(qtbot: QtBot) -> None:
    room = QWidget()
    qtbot.addWidget(room)
    room.resize(700, 500)
    room.show()
    notice = Notice(room)
    notice.show_notice(NoticeKind.FAULT, "The rig stopped", "camera lost", restartable=True)
    assert notice.text == "The rig stopped. camera lost"
    with qtbot.waitSignal(notice.restart):
        qtbot.mouseClick(notice._button, Qt.MouseButton.LeftButton)
    assert room.rect().contains(notice.geometry())
    notice.clear()
    assert not notice.isVisible()


@pytest.mark.parametrize("size", [(480, 320), (590, 345), (1000, 700)])
@pytest.mark.parametrize("restartable", [False, True])
def test_a_notice_has_room_for_all_that_it_says(qtbot: QtBot, size: tuple[int, int], restartable: bool) -> None:
    room = QWidget()
    qtbot.addWidget(room)
    room.resize(*size)
    room.show()
    notice = Notice(room)
    path = "/dev/serial/by-id/usb-FTDI_USB__-__Serial_Converter_FT8J0MXY-if00-port0"
    why = f"no permission for {path}: {'add yourself to the group dialout, log out and in again; ' * 4}then start the rig again"

    notice.show_notice(NoticeKind.FAULT, "The rig stopped", why, restartable=restartable)
    assert room.rect().contains(notice.geometry())
    assert notice.toolTip() == notice.text
    shown = notice.grab().toImage()
    notice.show_notice(NoticeKind.FAULT, "The rig stopped", why.removesuffix("again") + "twice", restartable=restartable)
    assert notice.grab().toImage() != shown, "its last word is seen"
    notice.show_notice(NoticeKind.FAULT, "The rig stopped", "camera lost", restartable=restartable)
    assert notice.height() == (178 if restartable else 132)


def test_every_widget_has_an_accessible_name_and_a_tool_tip(qtbot: QtBot) -> None:
    widgets = (StateBadge(LIMITS, 0.5), ThetaGauge(10), DistanceBars(6), AdviceLine(), TrendPlot(LIMITS), PerformancePanel())
    for widget in (*widgets, ModeBadge()):
        qtbot.addWidget(widget)
        assert widget.accessibleName(), widget
        assert widget.toolTip(), widget


def test_sizes_do_not_depend_on_values(qtbot: QtBot) -> None:
    """No layout jumps when numbers change."""
    gauge, bars, badge = ThetaGauge(10.0), DistanceBars(6.0), StateBadge(LIMITS, 0.5)
    for widget in (gauge, bars, badge):
        qtbot.addWidget(widget)
    before = [widget.sizeHint() for widget in (gauge, bars, badge)]
    pose = make_pose(theta=-179.9, head=-333.3, tail=222.2)
    gauge.show_pose(pose)
    bars.show_pose(pose)
    badge.show_scene(make_scene(pose))
    assert [widget.sizeHint() for widget in (gauge, bars, badge)] == before
