"""Checks before driving: made beside the window, kept for some minutes, and a red one stands against arming."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.operator.preflight import KEPT_S, PreflightModel, live_findings
from app.operator.preflight_list import PreflightList
from app.operator.window import OperatorWindow
from app.ui.texts import OperatorStep, next_step
from app.ui.workers import module_of
from app.widgets.mode_bar import ModeBar
from core.config.models import Config
from core.control.alerts import ALERTS, AlertKey, AlertReporter, alert_of
from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.modes import Act, Hindrance
from hardware.preflight.preflight import Level
from tests.app.fakes import FakeEngine, until

GOOD = {"name": "model", "ok": True, "detail": "all files are whole", "fix": ""}
BAD = {"name": "self-test", "ok": False, "detail": "it gives no pose", "fix": "git checkout -- resources/models"}
LOW = {"name": "recordings", "ok": False, "detail": "0.1 GB free", "fix": "make room"}


def says(*checks: dict[str, object], code: int = 0, first: str = "") -> list[str]:
    """A process that reads a configuration and makes these checks."""
    lines = "".join(f"print({json.dumps(json.dumps(check))}, flush=True);" for check in checks)
    return [sys.executable, "-c", f"import sys, time; sys.stdin.read(); {first}\n{lines}\nsys.exit({code})"]


@dataclass
class Bench:
    """A desk with a clock and a rig that a test turns."""

    config: Config = field(default_factory=Config)
    view: DriveView | None = field(default_factory=lambda: DriveView(0.0))
    now_s: float = 100.0
    asked: list[str] = field(default_factory=list)

    def desk(self, command: list[str]) -> PreflightModel:
        desk = PreflightModel(lambda: self.config, lambda: self.view, command=command, clock=lambda: self.now_s)
        desk.asked.connect(self.asked.append)
        return desk


def done(desk: PreflightModel, qtbot: QtBot) -> None:
    qtbot.waitUntil(lambda: not desk.preflight.is_running, timeout=30_000)


def test_arming_waits_for_the_checks_and_then_is_granted_for_some_minutes(qtbot: QtBot) -> None:
    bench = Bench()
    desk = bench.desk(says(GOOD, LOW))
    assert not desk.may_ask(OperatorStep.ARM)
    assert desk.preflight.is_running
    assert "some seconds" in bench.asked[0]
    done(desk, qtbot)
    assert desk.preflight.headline == "Ready: 3 of 4 checks good, 1 to note"
    assert desk.may_ask(OperatorStep.ARM)
    bench.now_s += KEPT_S - 1.0
    assert desk.may_ask(OperatorStep.ARM)
    bench.now_s += 2.0
    assert not desk.may_ask(OperatorStep.ARM), "too long ago"
    assert desk.preflight.is_running
    desk.close()


def test_a_red_check_refuses_with_its_reason_and_what_to_do(qtbot: QtBot) -> None:
    bench = Bench()
    desk = bench.desk(says(GOOD, BAD))
    desk.begin()
    done(desk, qtbot)
    assert not desk.may_ask(OperatorStep.ARM)
    assert bench.asked == ["Not armed. Self-test: it gives no pose. What to do: git checkout -- resources/models"]
    for step in OperatorStep:
        assert desk.may_ask(step) is (step is not OperatorStep.ARM)


UNUSED = {"name": "gamepad", "ok": True, "detail": "not configured; none is plugged in", "fix": ""}


def test_what_is_not_configured_is_not_counted_as_good(qtbot: QtBot) -> None:
    """ "Ready: 11 of 11 checks good", of which two were "not configured"."""
    bench = Bench()
    model = bench.desk(says(GOOD, UNUSED))
    model.begin()
    done(model, qtbot)
    assert model.preflight.headline == "Ready: 3 of 3 checks good"
    assert model.may_ask(OperatorStep.ARM)
    shown = PreflightList(model)
    qtbot.addWidget(shown)
    assert shown.texts[-1] == "not used gamepad: not configured; none is plugged in"


@pytest.mark.parametrize(
    ("against", "says_"),
    [
        ((Hindrance.SERVOS_UNCHECKED,), "The servos are not in use"),
        ((Hindrance.PERCEPTION_SETTLING,), "Waiting for a steady pose (1 s)"),
        ((Cause.HEAD_LOST, Hindrance.SERVOS_UNCHECKED), "The robot's head is out of sight"),
        ((Hindrance.ALREADY_ARMED,), "Armed"),
    ],
)
def test_good_checks_do_not_say_ready_while_arming_would_be_refused(
    qtbot: QtBot, against: tuple[Hindrance | Cause, ...], says_: str
) -> None:
    """The list said "Ready", with a bright button, while the bar below it said why not."""
    bench = Bench(view=DriveView(0.0, against_arming=against, servos_on=True))
    model = bench.desk(says(GOOD))
    model.begin()
    done(model, qtbot)
    shown = PreflightList(model)
    qtbot.addWidget(shown)
    assert shown.headline == f"The checks are good, but not yet ready to arm: {says_}"
    assert not shown.arm.isEnabled()
    assert shown.arm.toolTip() == says_
    bar = ModeBar()
    qtbot.addWidget(bar)
    bar.set_against(OperatorStep.ARM, model.preflight.step)
    bar.show_view(bench.view)
    assert bar.text.startswith(says_)
    assert model.may_ask(OperatorStep.ARM), "the supervisor refuses it, with its reason"
    bench.view = DriveView(0.0, servos_on=True)
    shown.renew()
    assert shown.headline == "Ready: 3 of 3 checks good"
    assert shown.arm.isEnabled()
    shown.open_list()
    with qtbot.waitActive(shown, timeout=30_000):
        shown.activateWindow()
    with qtbot.waitSignal(shown.arm_asked, timeout=30_000):  # the bar says "press F6" while this list has the keys
        qtbot.keyClick(shown, Qt.Key.Key_F6)
    assert not shown.isVisible()


def test_the_bar_does_not_offer_arming_that_the_checks_would_refuse(qtbot: QtBot) -> None:
    bench = Bench(view=DriveView(0.0, servos_on=True))
    bar = ModeBar()
    qtbot.addWidget(bar)

    def shown(model: PreflightModel) -> str:
        bar.set_against(OperatorStep.ARM, model.preflight.step)
        bar.show_view(bench.view)
        return bar.text

    model = bench.desk(says(GOOD, BAD))
    assert shown(model) == "You steer. The checks before driving come first: F6, some seconds, F6 again."
    model.begin()
    assert shown(model).startswith("Checking before driving.")
    done(model, qtbot)
    assert shown(model) == "Self-test: it gives no pose. What to do: git checkout -- resources/models."
    assert not model.may_ask(OperatorStep.ARM)
    model = bench.desk(says(GOOD))
    model.begin()
    done(model, qtbot)
    assert "Press F6 to arm" in shown(model)
    bench.now_s += KEPT_S + 1.0
    assert "come first" in shown(model)


@pytest.mark.parametrize("key", list(ALERTS))
def test_a_simulated_rig_never_tells_to_check_a_cable(key: AlertKey) -> None:
    """The first thing that a new user read on the twin was "Check the servo cable."."""
    spec = alert_of(key, simulated=True)
    assert not re.search(r"\b(cable|plug|USB|power|supply|shielding)\b", spec.what_to_do), spec.what_to_do
    assert (spec.text, spec.priority, spec.sound) == (ALERTS[key].text, ALERTS[key].priority, ALERTS[key].sound)


def test_the_lines_of_a_simulated_rig_say_so_everywhere() -> None:
    fault = Fault(Cause.SERVO_SILENT, "up")
    for simulated in (False, True):
        view = DriveView(0.0, latched=fault, active=(fault,), against_arming=(Cause.SERVO_SILENT,), simulated=simulated)
        bar, finding = next_step(view), next(one for one in live_findings(view) if one.level is Level.BAD)
        assert ("cable" in bar.text) is not simulated
        assert ("cable" in finding.fix) is not simulated
        reporter = AlertReporter(simulated=simulated)
        reporter.report([(Cause.SERVO_SILENT, "up")], 1.0)
        assert ("cable" in reporter.take()[0].spec.what_to_do) is not simulated


def test_another_model_needs_new_checks_and_another_phantom_does_not(qtbot: QtBot) -> None:
    bench = Bench()
    desk = bench.desk(says(GOOD))
    desk.begin()
    done(desk, qtbot)
    bench.config = Config.model_validate({"twin": {"phantom": "tree"}})
    assert desk.preflight.is_fresh
    bench.config = Config.model_validate({"perception": {"segmentation": {"model": "own_1"}}})
    assert not desk.preflight.is_fresh
    assert desk.preflight.findings == live_findings(bench.view), "what was found of another model is not shown"


def test_without_a_robot_nothing_is_in_the_way() -> None:
    bench = Bench(view=None)
    assert bench.desk(says(BAD)).may_ask(OperatorStep.ARM), "the pilot is not there to refuse; the window says so itself"
    assert bench.asked == []


@pytest.mark.parametrize(
    ("command", "why"),
    [
        (says(GOOD, code=3), "exit code 3"),
        (says(GOOD, first="sys.stderr.write('error: no memory\\n'); sys.exit(2)"), "no memory"),
        (["/nowhere/python"], "cannot be started"),
    ],
)
def test_checks_that_cannot_be_made_are_no_good_checks(command: list[str], why: str, qtbot: QtBot) -> None:
    bench = Bench()
    desk = bench.desk(command)
    desk.begin()
    done(desk, qtbot)
    assert why in desk.preflight.headline
    assert not desk.may_ask(OperatorStep.ARM)
    desk.close()


def test_a_process_that_hangs_is_given_up(qtbot: QtBot) -> None:
    bench = Bench()
    desk = bench.desk(says(GOOD, first="time.sleep(100)"))
    desk.begin()
    desk._limit.start(50)
    done(desk, qtbot)
    assert "no answer" in desk.preflight.problem


def test_what_the_open_rig_says_of_itself() -> None:
    assert live_findings(None) == ()
    assert all(finding.level is Level.GOOD for finding in live_findings(DriveView(0.0)))
    faults = (Fault(Cause.WARM, "61 °C"), Fault(Cause.CAMERA_LOST, "newest frame 900 ms old"))
    camera, servos = live_findings(DriveView(0.0, active=faults))
    assert (camera.level, servos.level) == (Level.BAD, Level.WARNING)
    assert camera.detail == "Camera lost (newest frame 900 ms old)"
    assert camera.fix


def test_what_the_open_rig_lacks_stands_in_the_list() -> None:
    view = DriveView(0.0, against_arming=(Hindrance.CAMERA_SETTLING, Hindrance.STEERING_UNKNOWN))
    *_, lack = live_findings(view)
    assert (lack.level, lack.detail) == (Level.BAD, "The steering is not learned")
    assert "page Steering" in lack.fix
    assert len(live_findings(view)) == 3, "what passes by itself is no finding"


@pytest.fixture
def window(qtbot: QtBot) -> Iterator[QWidget]:
    window = QWidget()
    qtbot.addWidget(window)
    yield window


def test_the_list_shows_words_not_only_colours_and_the_worst_first(window: QWidget, qtbot: QtBot) -> None:
    desk = Bench().desk(says(GOOD, BAD))
    shown = PreflightList(desk, window)
    shown.open_list()
    assert not shown.arm.isEnabled()
    shown.again.click()
    assert not shown.again.isEnabled()
    done(desk, qtbot)
    assert shown.headline == "Not ready: 1 of 4 checks stands against driving"
    assert "NOT READY self-test: it gives no pose git checkout -- resources/models" in shown.texts
    assert not shown.arm.isEnabled()
    assert not shown.isModal()
    shown.leave.click()
    assert not shown.isVisible()
    desk.close()


@pytest.mark.parametrize("size", [(1100, 660), (1280, 720), (1600, 900)])
def test_the_list_that_opens_by_itself_does_not_lie_over_stop(running: OperatorWindow, qtbot: QtBot, size: tuple[int, int]) -> None:
    running.resize(*size)
    qtbot.wait(30)
    stop = running.panels.mode_bar.stop
    desk = PreflightModel(lambda: running.rig.config, lambda: running.controls.view, running, command=says(GOOD))
    shown = PreflightList(desk, running, stop)
    shown.open_list()
    with_title = shown.geometry().adjusted(0, -30, 0, 0)
    assert not with_title.intersects(QRect(stop.mapToGlobal(QPoint(0, 0)), stop.size()))
    assert shown.height() >= 300
    shown.close()
    desk.close()


def test_in_the_window_f6_reaches_the_pilot_only_after_the_checks(
    running: OperatorWindow, engine: FakeEngine, qtbot: QtBot
) -> None:
    desk = PreflightModel(lambda: running.rig.config, lambda: running.controls.view, running, command=says(GOOD))
    running.rig.add_guard(desk.may_ask)
    until(qtbot, lambda: running.controls.view is not None)
    running.ask_step(OperatorStep.ARM)
    assert Act.ARM not in engine.pilot.acts
    done(desk, qtbot)
    running.ask_step(OperatorStep.ARM)
    assert engine.pilot.acts[-1] is Act.ARM
    running.controls.stop()
    assert engine.pilot.acts[-1] is Act.STOP
    desk.close()


@pytest.mark.slow
def test_the_real_checks_come_line_by_line_from_a_process_of_their_own(qtbot: QtBot) -> None:
    bench = Bench()
    bench.config = Config.model_validate({"perception": {"segmentation": {"model": "no_such_model"}}})
    desk = bench.desk(module_of("hardware.preflight.preflight"))
    desk.begin()
    qtbot.waitUntil(lambda: not desk.preflight.is_running, timeout=120_000)
    assert not desk.preflight.problem
    against = {finding.name: finding for finding in desk.preflight.against}
    assert "no_such_model" in against["model"].detail
    assert against["model"].fix
