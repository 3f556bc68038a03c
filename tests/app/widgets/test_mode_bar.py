"""Who drives, the next step and why not, STOP and deadman."""

from __future__ import annotations

from itertools import combinations

import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QImage, QMouseEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QMenu, QWidget
from pytestqt.qtbot import QtBot

from app.ui.texts import STOP_KEY, OperatorStep, Undriven, next_step, who_drives
from app.widgets.mode_bar import DOUBLE_PRESS_S, HEIGHT, MODE_LOOK, ModeBadge, ModeBar
from core.control.alerts import ALERTS
from core.control.drive_view import DriveView
from core.control.faults import CAUSES, Cause, Fault
from core.control.gate import Source
from core.control.modes import Hindrance, Mode
from tests.app.hand_clock import Clock
from tests.app.widgets.conftest import Own, words

LEFT = Qt.MouseButton.LeftButton
NARROWEST_AT_720 = 760
OFF = DriveView(0.0)
READY = DriveView(0.0, permitted=Source.OPERATOR, servos_on=True)
ARMED = DriveView(0.0, Mode.ARMED, Source.OPERATOR, servos_on=True, deadman=False)
DRIVING = DriveView(0.0, Mode.AUTONOMOUS, Source.PROGRAM, servos_on=True, deadman=True)
HELD = DriveView(0.0, Mode.HOLD, servos_on=True, deadman=False, active=(Fault(Cause.DEADMAN),))
STOPPED = DriveView(0.0, Mode.STOPPED, latched=Fault(Cause.TRACKING, "0.8 mm"))
VIEWS = (OFF, READY, ARMED, DRIVING, HELD, STOPPED)


def arming_refused(*reasons: Hindrance | Cause, time_s: float = 0.0) -> DriveView:
    return DriveView(time_s, permitted=Source.OPERATOR, servos_on=True, against_arming=reasons)


@pytest.fixture
def bar(own: Own, clock: Clock) -> ModeBar:
    return own(ModeBar(clock), NARROWEST_AT_720, HEIGHT, show=True)


def asked(bar: ModeBar) -> list[str]:
    """What the bar asks for from now on, in order."""
    heard: list[str] = []
    bar.step_asked.connect(lambda step: heard.append(step.name.lower()))
    bar.stop_asked.connect(lambda: heard.append("stop"))
    return heard


@pytest.mark.parametrize(
    ("view", "mode", "who"),
    [
        (None, "ADVISORY", "pictures only"),
        (OFF, "ADVISORY", "servos not in use"),
        (READY, "ADVISORY", "you steer"),
        (DriveView(0.0, latched=Fault(Cause.HOT)), "ADVISORY", "nothing moves"),
        (ARMED, "ARMED", "you steer"),
        (DRIVING, "AUTONOMOUS", "the program drives"),
        (HELD, "HOLD", "interrupted"),
        (STOPPED, "STOPPED", "nothing moves"),
    ],
)
def test_badge_names_the_mode_and_who_drives(own: Own, view: DriveView | None, mode: str, who: str) -> None:
    badge = own(ModeBadge())
    badge.show_view(DRIVING)
    badge.show_view(view)
    assert (badge.accessibleName(), badge.accessibleDescription()) == (f"Mode: {mode}", who)
    assert badge.who == who_drives(view)


def test_without_a_rig_badge_and_bar_say_that_they_wait(own: Own, bar: ModeBar) -> None:
    badge = own(ModeBadge())
    assert badge.who == "waiting for the rig"
    badge.show_view(None)
    assert badge.who == "pictures only"
    for shown in (badge, bar):
        shown.show_view(DRIVING)
        shown.show_view(None, Undriven.NOT_YET)
    assert (badge.mode, badge.who) == (Mode.ADVISORY, "waiting for the rig")
    assert bar.text == "Waiting for the rig."
    assert not bar.main.isEnabled()
    for shown in (badge, bar):
        shown.show_view(None, Undriven.CLOSED)
    assert (badge.who, bar.text) == ("no rig is open", "No rig is open. F5 opens it again.")
    assert not bar.main.isEnabled()


def grey(badge: ModeBadge, view: DriveView) -> QImage:
    badge.show_view(view)
    return badge.grab().toImage().convertToFormat(QImage.Format.Format_Grayscale8)


def test_modes_differ_without_colour_and_without_words(own: Own) -> None:
    badge = own(ModeBadge())
    signs = [grey(badge, view).copy(0, 0, 32, 34) for view in (READY, ARMED, DRIVING, HELD, STOPPED)]
    for first, second in combinations(signs, 2):
        pixels = zip(bytes(first.constBits()), bytes(second.constBits()), strict=True)
        assert sum(abs(one - other) > 60 for one, other in pixels) > 60
    assert len({look.sign for look in MODE_LOOK.values()}) == len({look.colour for look in MODE_LOOK.values()}) == len(Mode)


@pytest.mark.parametrize(
    ("view", "step", "granted", "text"),
    [
        (
            OFF,
            OperatorStep.SERVOS_ON,
            True,
            "The servos are not in use, but may still pull. Press F3: they are checked with the torque off, then tighten the "
            "wires.",
        ),
        (DriveView(0.0, busy="checking the servos"), OperatorStep.SERVOS_ON, False, "Checking the servos. This takes a moment."),
        (READY, OperatorStep.ARM, True, "You steer. Press F6 to arm; then you can hand over to the program."),
        (ARMED, OperatorStep.HAND_OVER, True, "Ready. Hold Shift, then press F7 to hand over."),
        (
            DriveView(0.0, Mode.ARMED, Source.OPERATOR, servos_on=True, deadman=True),
            OperatorStep.HAND_OVER,
            True,
            "Ready. Press F7: the program drives while you hold.",
        ),
        (
            DriveView(0.0, permitted=Source.OPERATOR, servos_on=True, latched=Fault(Cause.CAMERA_LOST)),
            OperatorStep.ACKNOWLEDGE,
            True,
            words(Cause.CAMERA_LOST),
        ),
        (DriveView(0.0, active=(Fault(Cause.PORT_LOST),)), OperatorStep.SERVOS_ON, True, words(Cause.PORT_LOST)),
        (HELD, OperatorStep.TAKE_BACK, True, words(Cause.DEADMAN)),
        (STOPPED, OperatorStep.ACKNOWLEDGE, True, words(Cause.TRACKING)),
        (
            arming_refused(Hindrance.SERVOS_UNCHECKED, Cause.HEAD_LOST, Cause.WARM),
            OperatorStep.ARM,
            False,
            f"{words(Hindrance.SERVOS_UNCHECKED)} (+2 more)",
        ),
        (
            DriveView(0.0, Mode.ARMED, servos_on=True, against_hand_over=(Hindrance.NO_TARGET,)),
            OperatorStep.HAND_OVER,
            False,
            words(Hindrance.NO_TARGET),
        ),
    ],
)
def test_next_step_and_its_line(view: DriveView, step: OperatorStep, granted: bool, text: str) -> None:
    following = next_step(view)
    assert (following.step, following.granted, following.text) == (step, granted, text)


def test_acknowledging_looks_subdued_while_servos_in_use_still_have_the_fault() -> None:
    hot = Fault(Cause.HOT)
    assert not next_step(DriveView(0.0, servos_on=True, latched=hot, active=(hot,))).granted
    assert next_step(DriveView(0.0, servos_on=True, latched=hot)).granted


def test_what_is_not_as_configured_is_said_where_it_is_known() -> None:
    detail = "not armed: outside its envelope: right at 4.00 mm (-2.4 to 2.8 mm)"
    wrong = next_step(DriveView(0.0, active=(Fault(Cause.SERVOS_WRONG, detail),)))
    assert wrong.rest == detail
    assert next_step(DriveView(0.0, active=(Fault(Cause.SERVOS_WRONG),))).rest == ALERTS[Cause.SERVOS_WRONG].what_to_do


def test_every_mode_has_a_step_that_can_be_pressed_and_no_two_steps_share_a_key() -> None:
    assert all(next_step(DriveView(0.0, mode, servos_on=on)).text for mode in Mode for on in (False, True))
    keys = [step.value.key for step in OperatorStep]
    assert len({*keys, STOP_KEY, "F5"}) == len(keys) + 2


@pytest.mark.parametrize(
    ("view", "name"),
    [
        (OFF, "servos_on"),
        (READY, "arm"),
        (ARMED, "hand_over"),
        (DRIVING, "take_back"),
        (HELD, "take_back"),
        (STOPPED, "acknowledge"),
        (arming_refused(Cause.HEAD_LOST), "arm"),
    ],
)
def test_the_main_button_asks_for_what_it_says_refused_or_not(qtbot: QtBot, bar: ModeBar, view: DriveView, name: str) -> None:
    heard = asked(bar)
    bar.show_view(view)
    assert bar.main.text().lower().replace(" ", "_") == name
    qtbot.mouseClick(bar.main, LEFT)
    bar.main.click()
    assert heard == [name, name]


def test_disarming_has_a_button_of_its_own_while_armed(qtbot: QtBot, bar: ModeBar) -> None:
    heard = asked(bar)
    bar.show_view(READY)
    assert not bar.second.isVisible()
    for view in (ARMED, DRIVING, HELD):
        bar.show_view(view)
        assert bar.second.step is OperatorStep.DISARM
    qtbot.mouseClick(bar.second, LEFT)
    assert heard == ["disarm"]


def test_a_refused_button_looks_subdued_but_can_be_pressed_and_tells_all_reasons(bar: ModeBar) -> None:
    bar.show_view(arming_refused(Cause.HEAD_LOST, Hindrance.CAMERA_SETTLING))
    assert bar.main.isEnabled() and not bar.main.is_granted
    assert words(Cause.HEAD_LOST) in bar.main.toolTip() and words(Hindrance.CAMERA_SETTLING) in bar.main.toolTip()
    assert bar.text.endswith("(+1 more)")


def test_a_double_click_never_presses_two_different_steps(qtbot: QtBot, bar: ModeBar, clock: Clock) -> None:
    heard = asked(bar)
    bar.show_view(DRIVING)
    qtbot.mouseClick(bar.main, LEFT)
    bar.show_view(ARMED)
    clock.now_s += 0.9 * DOUBLE_PRESS_S
    qtbot.mouseDClick(bar.main, LEFT)
    assert heard == ["take_back"], "the second half of a double click must not hand over again"
    clock.now_s += DOUBLE_PRESS_S
    qtbot.mouseClick(bar.main, LEFT)
    assert heard == ["take_back", "hand_over"]


def test_a_click_means_what_was_on_the_button_when_it_went_down(qtbot: QtBot, bar: ModeBar) -> None:
    heard = asked(bar)
    bar.show_view(DRIVING)
    qtbot.mousePress(bar.main, LEFT)
    bar.show_view(STOPPED)
    qtbot.mouseRelease(bar.main, LEFT)
    assert heard == ["take_back"]


def test_without_a_robot_only_stop_can_be_pressed(qtbot: QtBot, bar: ModeBar) -> None:
    heard = asked(bar)
    bar.show_view(ARMED)
    bar.show_view(None)
    for widget in (bar.main, bar.second, bar.deadman):
        assert not widget.isEnabled()
        QTest.mouseClick(widget, LEFT)
    assert bar.text == "This rig has no robot. Pictures and advice only."
    qtbot.mouseClick(bar.stop, LEFT)
    assert heard == ["stop"]


def test_no_line_is_cut_at_1280_by_720(bar: ModeBar) -> None:
    refused = [DriveView(0.0, servos_on=True, against_arming=(key, key, key)) for key in ALERTS]
    latched = [DriveView(0.0, latched=Fault(cause)) for cause in CAUSES]
    for view in (None, *VIEWS, DriveView(0.0, Mode.HOLD), DriveView(0.0, Mode.STOPPED), *refused, *latched):
        bar.show_view(view)
        assert bar.text_fits, bar.text


def test_stop_fires_when_the_mouse_goes_down_and_not_again_when_it_comes_up(qtbot: QtBot, bar: ModeBar) -> None:
    heard = asked(bar)
    qtbot.mousePress(bar.stop, LEFT)
    assert heard == ["stop"]
    qtbot.mouseRelease(bar.stop, LEFT, pos=QPoint(-50, -50))
    assert heard == ["stop"]


@pytest.mark.parametrize("button", [LEFT, Qt.MouseButton.RightButton, Qt.MouseButton.MiddleButton])
def test_every_press_of_any_button_counts(qtbot: QtBot, bar: ModeBar, button: Qt.MouseButton) -> None:
    heard = asked(bar)
    for _ in range(3):
        qtbot.mousePress(bar.stop, button)
        qtbot.mouseRelease(bar.stop, button)
    qtbot.mouseDClick(bar.stop, button)
    assert heard.count("stop") >= 4


def test_stop_works_by_keyboard_and_when_disabled(qtbot: QtBot, bar: ModeBar) -> None:
    heard = asked(bar)
    bar.stop.click()
    bar.setEnabled(False)
    qtbot.mousePress(bar.stop, LEFT)
    assert heard == ["stop", "stop"]


@pytest.fixture
def holds(bar: ModeBar) -> list[bool]:
    """The deadman's news, of a bar that is armed."""
    news: list[bool] = []
    bar.deadman_changed.connect(news.append)
    bar.show_view(ARMED)
    return news


def test_deadman_is_held_while_the_left_button_is_down_near_it(qtbot: QtBot, bar: ModeBar, holds: list[bool]) -> None:
    assert holds == []
    qtbot.mousePress(bar.deadman, LEFT)
    assert holds == [True]
    qtbot.mouseRelease(bar.deadman, LEFT, pos=QPoint(300, 5))
    assert holds == [True, False]


def move(widget: QWidget, place: QPointF) -> None:
    event = QMouseEvent(
        QEvent.Type.MouseMove, place, widget.mapToGlobal(place), Qt.MouseButton.NoButton, LEFT, Qt.KeyboardModifier.NoModifier
    )
    QApplication.sendEvent(widget, event)


def test_a_small_movement_holds_and_leaving_the_window_lets_go(qtbot: QtBot, bar: ModeBar, holds: list[bool]) -> None:
    qtbot.mousePress(bar.deadman, LEFT)
    move(bar.deadman, QPointF(-20, 5))
    assert holds == [True]
    move(bar.deadman, QPointF(5, -400))
    assert holds == [True, False]


@pytest.mark.parametrize(
    "lose",
    [
        lambda bar: bar.hide(),
        lambda bar: bar.deadman.hide(),
        lambda bar: bar.show_view(None),
        lambda bar: QApplication.sendEvent(bar.window(), QEvent(QEvent.Type.WindowDeactivate)),
        lambda bar: QApplication.sendEvent(bar.window(), QEvent(QEvent.Type.WindowBlocked)),
        lambda bar: QApplication.sendEvent(QApplication.instance(), QEvent(QEvent.Type.ApplicationDeactivate)),
        lambda bar: QApplication.sendEvent(bar.deadman, QEvent(QEvent.Type.UngrabMouse)),
    ],
    ids=["bar hidden", "field hidden", "no robot", "focus lost", "dialog", "other application", "grab lost"],
)
def test_an_event_that_may_swallow_the_release_counts_as_one(qtbot: QtBot, bar: ModeBar, holds: list[bool], lose: object) -> None:
    qtbot.mousePress(bar.deadman, LEFT)
    lose(bar)
    assert holds == [True, False]
    assert not bar.deadman.is_held


def test_a_release_that_goes_to_a_menu_counts(qtbot: QtBot, bar: ModeBar, holds: list[bool]) -> None:
    qtbot.mousePress(bar.deadman, LEFT)
    menu = QMenu(bar)
    menu.addAction("entry")
    menu.popup(QPoint(0, 0))
    qtbot.mouseRelease(menu, LEFT)
    menu.close()
    assert holds == [True, False]


def test_deadman_shows_what_the_program_sees(bar: ModeBar) -> None:
    bar.show_view(OFF)
    assert (bar.deadman.word, bar.deadman.is_lit) == ("none", False)
    bar.show_view(ARMED)
    assert (bar.deadman.word, bar.deadman.is_lit) == ("not held", False)
    bar.show_view(DRIVING)
    assert (bar.deadman.word, bar.deadman.is_lit) == ("held", True)
    assert bar.deadman.accessibleDescription() == "held"
