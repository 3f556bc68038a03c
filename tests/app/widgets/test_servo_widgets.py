"""What the operator sees of the servos, of the commands and of the wall: visible text, what is asked back, what is renewed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QApplication, QMenu, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.ui import theme
from app.widgets.command_panel import MAX_ENTRIES, ClampLog, CommandPanel
from app.widgets.distance_bars import ClearanceBar
from app.widgets.live_view import LiveView
from app.widgets.painting import number
from app.widgets.scene_overlay import Layer
from app.widgets.servo_table import Column, ServoTable, Tone, bus_line, error_words, known_joints, pair_balances, servo_rows
from core.config.safety import SafetyConfig, ServosConfig
from core.control.gate import Clamp, Rejection, RejectReason, Source
from core.control.joints import Limit
from core.control.pilot import DriveView
from core.types import Advice, Centerline, Command, Frame, Reason, Refusal, RobotPath, RobotStatus, Scene, Speed
from hardware.servos.bus_ipc import BusPhase, BusStatus, CycleTimes
from hardware.servos.dynamixel_port import LineCounts
from hardware.servos.registers import HardwareError, MissingServo, ServoReading, ServoState
from tests.app.fakes import FakeBench, make_pose, make_scene
from tests.app.hand_clock import Clock

SERVOS, SAFETY = ServosConfig(), SafetyConfig()
MINUS, DASH = "\N{MINUS SIGN}", "\N{EN DASH}"


def servo(place: int, **changes: object) -> ServoState:
    """A servo that holds its joint: tendons at the pretension of 0.3 mm, feeds at 20 mm."""
    joint = SERVOS.joints[place]
    at_mm = 0.3 if place < 4 else 20.0
    state = ServoState(
        joint.name, joint.id, 100.0, 1000, 1000, at_mm, at_mm, 0.0, 8.07, 12.0, 31.0, HardwareError(0), torque=True,
        watchdog_tripped=False,
    )  # fmt: skip
    return replace(state, **changes)  # type: ignore[arg-type]


def bus(*others: ServoReading, **changes: object) -> BusStatus:
    """An armed bus; `others` replace the servos of the same name."""
    by_name = {reading.name: reading for reading in others}
    status = BusStatus(
        cycle=1,
        time_s=100.0,
        phase=BusPhase.ARMED,
        servos=tuple(by_name.get(joint.name, servo(place)) for place, joint in enumerate(SERVOS.joints)),
        active=(),
        latched=None,
        fault_counts={},
        sent=None,
        rejection=None,
        clamps=(),
        at_end=(),
        rejections={},
        clamp_count=12,
        line=LineCounts(),
        bad_packets=3,
        restarts=0,
        times=CycleTimes(20.0, 21.4, 4.0, 6.0),
        zeroed=(True,) * 7,
    )
    return replace(status, **changes)  # type: ignore[arg-type]


def cells(status: BusStatus | None, place: int) -> dict[Column, tuple[str, Tone]]:
    return {column: (cell.text, cell.tone) for column, cell in zip(Column, servo_rows(status, SERVOS, SAFETY)[place], strict=True)}


def test_no_heading_of_the_table_is_cut_in_the_smallest_window(qtbot: QtBot) -> None:
    table = ServoTable()
    qtbot.addWidget(table)
    table.resize(470, 240)
    table.show()
    header, metrics = table._table.horizontalHeader(), QFontMetrics(theme.font(11))
    for place in range(table.model.columnCount()):
        heading = str(table.model.headerData(place, Qt.Orientation.Horizontal)).strip()
        assert metrics.horizontalAdvance(heading) + 6 <= header.sectionSize(place), heading


def test_where_a_joint_is_is_known_of_a_zeroed_one_that_answers() -> None:
    assert known_joints(None, 100.0) == (True,) * 7, "a robot without a bus tells it itself"
    assert known_joints(bus(), 100.5) == (True,) * 7
    assert known_joints(bus(), 102.0) == (False,) * 7, "the bus is silent"
    assert known_joints(bus(servos=(), zeroed=(False,) * 7), 100.0) == (False,) * 7
    silent = MissingServo(SERVOS.joints[2].name, SERVOS.joints[2].id, 100.0, 5, "no answer")
    some = bus(silent, zeroed=(True, False, True, True, True, True, False))
    assert known_joints(some, 100.0) == (True, False, False, True, True, True, False)


# ---- what the table says


def test_a_healthy_servo_in_words_and_numbers() -> None:
    texts = {column: text for column, (text, _) in cells(bus(servo(1, position_mm=-1.5, goal_mm=-1.498)), 1).items()}
    assert texts == {
        Column.JOINT: "left · 2",
        Column.POSITION: f"{MINUS}1.50",
        Column.GOAL: f"{MINUS}1.50",
        Column.CURRENT: "8",
        Column.TEMPERATURE: "31",
        Column.VOLTAGE: "12.0",
        Column.TORQUE: "on",
        Column.ZERO: "yes",
        Column.ERROR: "none",
    }


def test_feeds_are_read_in_tenths() -> None:
    assert cells(bus(servo(4, position_mm=123.456)), 4)[Column.POSITION][0] == "123.5"


@pytest.mark.parametrize(
    ("temperature_c", "text", "tone"), [(64.0, "64", Tone.PLAIN), (65.0, "!65", Tone.WARN), (70.0, "!!70", Tone.BAD)]
)
def test_heat_warns_five_degrees_before_the_limit_of_70(temperature_c: float, text: str, tone: Tone) -> None:
    row = cells(bus(servo(0, temperature_c=temperature_c)), 0)
    assert row[Column.TEMPERATURE] == (text, tone)
    assert row[Column.JOINT][1] is tone, "the joint's name is marked as well"


@pytest.mark.parametrize(
    ("voltage_v", "text", "tone"), [(11.1, "11.1", Tone.PLAIN), (11.0, "!11.0", Tone.WARN), (10.5, "!!10.5", Tone.BAD)]
)
def test_voltage_warns_half_a_volt_before_the_limit(voltage_v: float, text: str, tone: Tone) -> None:
    assert cells(bus(servo(0, voltage_v=voltage_v)), 0)[Column.VOLTAGE] == (text, tone)


@pytest.mark.parametrize(
    ("at_mm", "tone"), [(0.0, Tone.PLAIN), (2.5, Tone.PLAIN), (2.6, Tone.WARN), (-2.2, Tone.WARN), (2.81, Tone.BAD)]
)
def test_position_warns_inside_the_margin_and_outside_the_envelope(at_mm: float, tone: Tone) -> None:
    """A tendon's envelope is -2.4 to 2.8 mm, its margin 0.3 mm."""
    assert cells(bus(servo(2, position_mm=at_mm)), 2)[Column.POSITION][1] is tone


def test_track_tells_shares_of_the_envelope() -> None:
    track = servo_rows(bus(servo(0, position_mm=0.2, goal_mm=2.8)), SERVOS, SAFETY)[0][1].track
    assert track is not None
    assert (track.at, track.goal) == pytest.approx((0.5, 1.0))
    assert (track.low_warn, track.high_warn) == pytest.approx((0.06, 0.94), abs=0.005)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (HardwareError(0), ""),
        (HardwareError.OVERLOAD, "overload"),
        (HardwareError.OVERHEATING | HardwareError.OVERLOAD, "overload, overheating"),
        (HardwareError.INPUT_VOLTAGE, "input voltage"),
        (HardwareError.ELECTRICAL_SHOCK | HardwareError.ENCODER, "electric shock, encoder"),
        (HardwareError(64), "error 64"),
    ],
)
def test_errors_in_plain_words(error: HardwareError, words: str) -> None:
    assert error_words(error) == words


def test_a_silent_servo_says_so_and_shows_no_old_number() -> None:
    row = cells(bus(MissingServo("up", 3, 100.0, 4, "no answer")), 2)
    assert row[Column.ERROR] == ("silent", Tone.BAD)
    assert {row[column][0] for column in Column if column not in (Column.JOINT, Column.ERROR)} == {DASH}
    restarted = MissingServo("up", 3, 100.0, 1, "restarted", restarted=True)
    assert cells(bus(restarted), 2)[Column.ERROR][0] == "restarted"


def test_watchdog_torque_and_zero() -> None:
    assert cells(bus(servo(0, watchdog_tripped=True)), 0)[Column.ERROR] == ("bus watchdog", Tone.BAD)
    assert cells(bus(servo(0, torque=False)), 0)[Column.TORQUE] == ("!!off", Tone.BAD), "armed, and yet it does not hold"
    assert cells(bus(servo(0, torque=False), phase=BusPhase.DISARMED), 0)[Column.TORQUE] == ("off", Tone.FAINT)
    loose = bus(servo(0, position_mm=None, goal_mm=None), zeroed=(False,) * 7)
    assert cells(loose, 0)[Column.ZERO] == ("!no", Tone.WARN)
    assert cells(loose, 0)[Column.POSITION][0] == DASH


def test_a_current_beyond_its_limit_is_marked() -> None:
    assert cells(bus(servo(0, current_ma=600.0)), 0)[Column.CURRENT] == ("600", Tone.PLAIN)
    assert cells(bus(servo(0, current_ma=-612.0)), 0)[Column.CURRENT] == (f"!!{MINUS}612", Tone.BAD)
    assert "limit 600 mA for half a second" in servo_rows(bus(), SERVOS, SAFETY)[0][list(Column).index(Column.CURRENT)].tip


def test_models_that_report_a_load_have_no_current() -> None:
    assert cells(bus(servo(0, current_ma=None)), 0)[Column.CURRENT][0] == DASH


def test_nothing_is_known_without_a_bus_and_while_its_port_is_closed() -> None:
    for status in (None, bus(phase=BusPhase.CLOSED, servos=())):
        assert {cell.text for row in servo_rows(status, SERVOS, SAFETY) for cell in row[1:]} == {DASH}


def test_numbers_have_a_true_minus_and_never_a_negative_zero() -> None:
    assert (number(-0.004, 2), number(-1.256, 2), number(3.0, 0)) == ("0.00", f"{MINUS}1.26", "3")


# ---- tendon pairs


def test_a_pair_is_balanced_when_its_pulls_sum_to_twice_the_pretension() -> None:
    first, second = pair_balances(bus(servo(0, position_mm=2.0), servo(1, position_mm=-1.4)), SERVOS)
    assert (first.names, first.sum_mm, first.wanted_mm) == (("right", "left"), pytest.approx(0.6), pytest.approx(0.6))
    assert first.share == pytest.approx(0.0, abs=1e-9)
    assert (first.word, first.tone) == ("", Tone.PLAIN)
    assert second.names == ("up", "down")


@pytest.mark.parametrize(
    ("left_mm", "word", "tone"),
    [(0.3, "", Tone.PLAIN), (-0.05, "slack", Tone.WARN), (-0.4, "slack", Tone.BAD), (0.65, "too tight", Tone.WARN)],
)
def test_slack_and_tight_pairs_are_named(left_mm: float, word: str, tone: Tone) -> None:
    first, _ = pair_balances(bus(servo(1, position_mm=left_mm)), SERVOS)
    assert (first.word, first.tone) == (word, tone)


def test_slack_wires_are_no_warning_before_arming() -> None:
    first, _ = pair_balances(bus(servo(0, position_mm=0.0), servo(1, position_mm=0.0), phase=BusPhase.DISARMED), SERVOS)
    assert (first.share, first.word) == (pytest.approx(-1.0), "")


def test_tension_is_told_by_the_currents() -> None:
    """100 mA at 4.1 Nm / 2.3 A on a drum of 40 mm per turn: 0.178 Nm / 6.37 mm = 28 N."""
    first, second = pair_balances(bus(servo(0, current_ma=100.0), servo(2, current_ma=None)), SERVOS)
    assert first.forces_n is not None
    assert first.forces_n[0] == pytest.approx(28.0, abs=0.05)
    assert second.forces_n is None


def test_a_pair_with_a_silent_servo_is_unknown() -> None:
    first, _ = pair_balances(bus(MissingServo("left", 2, 100.0, 3, "no answer")), SERVOS)
    assert first.share is None


# ---- the line of the bus


def test_bus_line_has_phase_timing_and_counts() -> None:
    assert bus_line(bus()).text == "bus armed  ·  cycle 20.0 ms, p99 21.4 ms  ·  bad packets 3  ·  clamps 12"
    slow = bus_line(bus(times=CycleTimes(20.0, 31.0, 4.0, 6.0)))
    assert "! p99 31.0 ms" in slow.text
    assert slow.tone is Tone.WARN
    assert "not measured yet" in bus_line(bus(times=CycleTimes())).text
    assert "no servo bus" in bus_line(None).text


def test_bus_line_spells_out_errors() -> None:
    line = bus_line(bus(servo(1, error=HardwareError.OVERLOAD)))
    assert (line.text, line.tone) == ("!! left overload", Tone.BAD)
    assert "bus armed" in line.tip


# ---- the table as a widget


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def table(qtbot: QtBot, clock: Clock) -> Iterator[ServoTable]:
    widget = ServoTable(SAFETY, clock)
    qtbot.addWidget(widget)
    widget.resize(446, 205)
    widget.show()
    yield widget
    for menu in widget.findChildren(QMenu):
        menu.close()


def changed_cells(table: ServoTable) -> list[tuple[int, int]]:
    seen: list[tuple[int, int]] = []
    table.model.dataChanged.connect(lambda first, last: seen.append((first.row(), first.column())))
    return seen


def test_only_cells_that_changed_are_renewed(table: ServoTable, clock: Clock) -> None:
    table.show_status(bus(), SERVOS)
    seen = changed_cells(table)
    clock.now_s += 0.25
    table.show_status(bus(servo(3, temperature_c=32.0), time_s=clock.now_s, cycle=2), SERVOS)
    assert seen == [(3, list(Column).index(Column.TEMPERATURE))]


def test_five_times_a_second_at_most_but_a_new_phase_at_once(table: ServoTable, clock: Clock) -> None:
    table.show_status(bus(), SERVOS)
    clock.now_s += 0.1
    table.show_status(bus(servo(0, temperature_c=33.0)), SERVOS)
    assert table.model.cell(0, Column.TEMPERATURE).text == "31"
    table.show_status(bus(servo(0, temperature_c=33.0), phase=BusPhase.STOPPED), SERVOS)
    assert table.model.cell(0, Column.TEMPERATURE).text == "33"
    assert table.bus_text.startswith("bus stopped")
    table.show_status(None, SERVOS)
    assert table.model.cell(0, Column.TEMPERATURE).text == DASH


def test_an_old_status_is_silence_not_news(table: ServoTable, clock: Clock) -> None:
    table.show_status(bus(), SERVOS)
    clock.now_s += 3.0
    table.show_status(bus(), SERVOS)
    assert table.bus_text == "!! nothing heard from the servo bus for 3 s"
    assert table.model.cell(0, Column.POSITION).text == DASH


@pytest.mark.parametrize("size", [(446, 203), (446, 230), (636, 330)])
def test_all_rows_and_columns_fit(table: ServoTable, size: tuple[int, int]) -> None:
    table.resize(*size)
    table.show_status(bus(), SERVOS)
    table.grab()
    view = table._table
    assert view.rowViewportPosition(6) + view.rowHeight(6) <= view.viewport().height()
    assert view.columnViewportPosition(8) + view.columnWidth(8) == view.viewport().width()


def test_what_is_wrong_is_tinted(table: ServoTable) -> None:
    table.show_status(bus(servo(2, error=HardwareError.OVERLOAD)), SERVOS)
    image = table._table.grab().toImage()
    found = {image.pixelColor(x, y).name().upper() for x in range(image.width()) for y in range(image.height())}
    assert theme.FAULT in found


def button(widget: QWidget, text: str) -> QPushButton:
    return next(found for found in widget.findChildren(QPushButton) if found.text().startswith(text))


def choose(menu: QMenu, text: str) -> None:
    next(action for action in menu.actions() if action.text() == text).trigger()
    menu.close()


def open_menu(table: ServoTable) -> QMenu:
    return next(menu for menu in table.findChildren(QMenu) if menu.isVisible())


def test_zeroing_is_asked_back_and_then_told(table: ServoTable, qtbot: QtBot) -> None:
    table.show_status(bus(phase=BusPhase.DISARMED), SERVOS)
    asked: list[object] = []
    table.zero_asked.connect(asked.append)
    button(table, "Zero").click()
    choose(open_menu(table), "All joints")
    assert table.question.text == "Are the wires slack? All joints become 0 mm here."
    assert asked == []
    next(b for b in table.question.findChildren(QPushButton) if b.text() == "Zero").click()
    assert asked == [None]
    assert table.question.text == ""


def test_one_joint_can_be_zeroed_and_the_question_taken_back(table: ServoTable) -> None:
    table.show_status(bus(phase=BusPhase.DISARMED), SERVOS)
    asked: list[object] = []
    table.zero_asked.connect(asked.append)
    choose(table.menu_for(SERVOS.joints[5]), "Zero delivery 1")
    button(table.question, "Cancel").click()
    assert (asked, table.question.text) == ([], "")
    choose(table.menu_for(SERVOS.joints[5]), "Zero delivery 1")
    button(table.question, "Zero").click()
    assert asked == [["delivery_1"]]


def test_restart_and_torque_off_are_asked_back(table: ServoTable, qtbot: QtBot) -> None:
    table.show_status(bus(phase=BusPhase.DISARMED), SERVOS)
    button(table, "Restart").click()
    choose(open_menu(table), "3  up")
    assert table.question.text == "Restart servo 3 (up)? It must be zeroed again."
    with qtbot.waitSignal(table.reboot_asked) as signal:
        next(b for b in table.question.findChildren(QPushButton) if b.text() == "Restart").click()
    assert signal.args == [3]
    button(table, "Torque off").click()
    with qtbot.waitSignal(table.torque_off_asked):
        next(b for b in table.question.findChildren(QPushButton) if b.text() == "Torque off").click()


def test_while_armed_only_the_torque_can_be_let_go(table: ServoTable) -> None:
    table.show_status(bus(), SERVOS)
    enabled = {action.text(): action.isEnabled() for action in table.menu_for(SERVOS.joints[0]).actions() if action.text()}
    assert enabled == {
        "Restart servo 1 (right)": False,
        "Zero right": False,
        "Zero all joints": False,
        "Switch all torque off": True,
    }
    assert not button(table, "Zero").isEnabled()
    assert button(table, "Zero").toolTip() == "press STOP or Torque off first"
    table.show_status(None, SERVOS)
    assert not button(table, "Torque off").isEnabled()


def test_arming_takes_an_open_question_back(table: ServoTable) -> None:
    table.show_status(bus(phase=BusPhase.DISARMED), SERVOS)
    choose(table.menu_for(None), "Zero all joints")
    assert table.question.text
    table.show_status(bus(), SERVOS)
    assert table.question.text == ""


def test_the_table_keeps_off_the_keyboard_but_its_buttons_do_not(table: ServoTable) -> None:
    table.show_status(bus(phase=BusPhase.DISARMED), SERVOS)
    assert table._table.focusPolicy() is Qt.FocusPolicy.NoFocus
    for text in ("Restart", "Zero", "Torque off"):
        assert button(table, text).focusPolicy() is Qt.FocusPolicy.TabFocus


def test_right_click_offers_the_row_under_it(table: ServoTable, qtbot: QtBot) -> None:
    table.show_status(bus(phase=BusPhase.DISARMED), SERVOS)
    at = QPoint(20, table._table.rowViewportPosition(4) + 4)
    table._table.customContextMenuRequested.emit(at)
    assert any(action.text() == "Restart servo 5 (advance)" for action in open_menu(table).actions())


# ---- the log of the gate


def clamp(joint: str = "right", asked_mm: float = 1.2, allowed_mm: float = 0.8, limit: Limit = Limit.RATE) -> Clamp:
    return Clamp(joint, asked_mm, allowed_mm, limit)  # type: ignore[arg-type]


def told(log: ClampLog) -> list[tuple[str, str, int]]:
    return [(entry.joint or "rejected", entry.text, entry.count) for entry in log.entries]


def test_log_tells_clamps_newest_first() -> None:
    log = ClampLog()
    log.add_status(bus(cycle=1, clamps=(clamp(),)), "12:00:00")
    log.add_status(bus(cycle=2, clamps=(clamp("delivery_1", -3.0, -2.9, Limit.STEP),)), "12:00:01")
    assert told(log) == [
        ("delivery 1", f"{MINUS}3.00 → {MINUS}2.90 mm, step from the measured position", 1),
        ("right", "1.20 → 0.80 mm, speed", 1),
    ]


def test_log_counts_repeats_of_the_same_limit_until_a_second_has_passed() -> None:
    log = ClampLog()
    for cycle in range(1, 6):
        log.add_status(bus(cycle=cycle, time_s=0.02 * cycle, clamps=(clamp(asked_mm=cycle), clamp("left"))), "12:00:00")
    assert told(log) == [("left", "1.20 → 0.80 mm, speed", 5), ("right", "5.00 → 0.80 mm, speed", 5)]
    log.add_status(bus(cycle=6, time_s=2.0, clamps=(clamp(),)), "12:00:02")
    assert told(log)[0] == ("right", "1.20 → 0.80 mm, speed", 1)


def test_log_sees_a_cycle_once() -> None:
    log = ClampLog()
    for _ in range(3):
        log.add_status(bus(cycle=7, clamps=(clamp(),)), "12:00:00")
    assert told(log) == [("right", "1.20 → 0.80 mm, speed", 1)]


def test_log_misses_no_rejection_of_the_cycles_between() -> None:
    log = ClampLog()
    log.add_status(bus(cycle=1, rejections={RejectReason.STALE_POSE: 4}), "12:00:00")
    assert told(log) == [], "what was counted before is no news"
    seen = Rejection(RejectReason.STALE_POSE, "182 ms (at most 150 ms)")
    log.add_status(bus(cycle=2, rejection=seen, rejections={RejectReason.STALE_POSE: 5}), "12:00:00")
    log.add_status(bus(cycle=5, rejections={RejectReason.STALE_POSE: 8}), "12:00:00")
    assert told(log) == [("rejected", "pose behind the command too old: 182 ms (at most 150 ms)", 4)]


def test_rest_is_no_rejection() -> None:
    log = ClampLog()
    log.add_status(bus(cycle=1), "12:00:00")
    log.add_status(bus(cycle=2, rejections={RejectReason.NO_COMMAND: 30, RejectReason.NOT_ARMED: 2}), "12:00:00")
    assert told(log) == []


def test_a_new_bus_process_starts_its_counts_anew() -> None:
    log = ClampLog()
    log.add_status(bus(cycle=900, rejections={RejectReason.OVER_RATE: 9}), "12:00:00")
    log.add_status(bus(cycle=3, rejections={RejectReason.OVER_RATE: 1}), "12:00:00")
    assert told(log) == []
    log.add_status(bus(cycle=4, rejections={RejectReason.OVER_RATE: 2}), "12:00:00")
    assert told(log) == [("rejected", "goal too far away", 1)]


def test_driving_against_the_end_is_told() -> None:
    log = ClampLog()
    log.add_status(bus(cycle=1, at_end=("advance",)), "12:00:00")
    assert told(log) == [("advance", "stopped at the end of its envelope", 1)]


def test_log_keeps_500_entries() -> None:
    log = ClampLog()
    for cycle in range(MAX_ENTRIES + 20):
        log.add_status(bus(cycle=cycle, time_s=2.0 * cycle, clamps=(clamp(asked_mm=cycle),)), "12:00:00")
    assert len(log.entries) == MAX_ENTRIES
    assert log.entries[0].text.startswith("519.00")


# ---- the panel of commands


ADVICE = Advice(Speed.SLOW, 3.0, 18.3, "coming back")


@pytest.fixture
def panel(qtbot: QtBot, clock: Clock) -> CommandPanel:
    widget = CommandPanel(clock, lambda: "12:00:00")
    qtbot.addWidget(widget)
    widget.resize(446, 205)
    widget.show()
    return widget


def lines(panel: CommandPanel) -> list[str]:
    return panel.text.splitlines()


def test_advised_asked_commanded_and_sent_are_kept_apart(panel: CommandPanel) -> None:
    view = DriveView(
        0.0, asked=Command(0.4, -0.2, 5.0, 0.0), advice=ADVICE, sent=Command(0.4, -0.2, 5.0, 0.0), sent_by=Source.OPERATOR,
        latency_s=0.0618, follow_share=0.776,
    )  # fmt: skip
    panel.show_view(view, bus())
    assert lines(panel) == [
        "Advised: bend 18° right, pitch –, advance mm/s 3.0 slow, sheath mm/s –",
        "drives: You asked: bend 0.40 right, pitch 0.20 down, advance mm/s 5.0, sheath mm/s 0.0",
        "Program: does not drive",
        "Sent: bend 0.40 right, pitch 0.20 down, advance mm/s 5.0, sheath mm/s 0.0",
        "capture → servo 62 ms",
        "following the advice 78 %",
        "Gate: 12 goals limited, 0 commands rejected",
    ]


def test_a_difference_that_lasts_is_marked(panel: CommandPanel, clock: Clock) -> None:
    view = DriveView(
        0.0, advice=ADVICE, commanded=Command(0.5, 0.0, 8.0), sent=Command(0.2, 0.0, 8.0), sent_by=Source.PROGRAM, latency_s=0.12
    )
    for _ in range(3):
        clock.now_s += 0.25
        panel.show_view(view, None)
    assert lines(panel)[2].startswith("drives: Program: bend 0.50 right")
    assert lines(panel)[3].startswith("Sent: bend ≠ 0.20 right, pitch 0, advance mm/s 8.0")
    assert lines(panel)[4] == "capture → servo ! 120 ms"
    clock.now_s += 0.25
    panel.show_view(replace(view, sent=Command(0.5, 0.0, 8.0)), None)
    assert "≠" not in panel.text


def test_nothing_and_its_reason(panel: CommandPanel, clock: Clock) -> None:
    panel.show_view(DriveView(0.0, blanked="pose stale"), None)
    assert lines(panel)[0] == "Advised: no advice: pose stale"
    assert lines(panel)[3] == "Sent: no motion: holding"
    assert lines(panel)[5:] == ["following the advice –", "Gate: no servo bus"]
    panel.show_view(None, None)
    assert lines(panel)[:4] == ["Advised: –", "You asked: –", "Program: –", "Sent: –"]


def test_log_rows_follow_whatever_the_pace(panel: CommandPanel, clock: Clock) -> None:
    view = DriveView(0.0)
    for cycle in range(1, 2 * MAX_ENTRIES):
        clock.now_s += 0.03
        status = bus(cycle=cycle, time_s=2.0 * cycle, clamps=(clamp(asked_mm=cycle),), clamp_count=cycle)
        panel.show_view(view, status)
    clock.now_s += 1.0
    panel.show_view(view, status)
    log = panel.log
    assert log.rowCount() == MAX_ENTRIES
    assert [log.data(log.index(0, column)) for column in range(4)] == ["12:00:00", "right", "999.00 → 0.80 mm, speed", ""]
    assert log.data(log.index(MAX_ENTRIES - 1, 2)) == "500.00 → 0.80 mm, speed"
    assert log._shown == log._log.entries


def test_repeats_renew_their_row(panel: CommandPanel, clock: Clock) -> None:
    for cycle in range(1, 30):
        clock.now_s += 0.1
        panel.show_view(DriveView(0.0), bus(cycle=cycle, time_s=0.1 * cycle, clamps=(clamp(), clamp("up", limit=Limit.MARGIN))))
    clock.now_s += 1.0
    panel.show_view(DriveView(0.0), None)
    log = panel.log
    assert [log.data(log.index(row, 3)) for row in range(log.rowCount())] == ["×29", "×29"]


# ---- the room to the wall


def wall_scene(offset_px: float, captured_s: float = 0.0) -> Scene:
    """Lumen radius 24 px, robot radius 4 px: 20 px of room on the centerline, the robot lies along it."""
    path = RobotPath(np.array([(10.0, 100.0 + offset_px), (100.0, 100.0 + offset_px)]), 1.0, None, True, 0.0, 4.0)
    line = Centerline(np.array([(50.0, 100.0), (150.0, 100.0)]), (100.0, 100.0), 24.0)
    return replace(make_scene(make_pose(), captured_s=captured_s), path=path, centerline=line)


def force(newton: float | None) -> RobotStatus:
    return RobotStatus(0.0, 0.0, 0.0, (0.0,) * 4, (0.0,) * 4, newton)  # type: ignore[arg-type]


@pytest.fixture
def bar(qtbot: QtBot) -> ClearanceBar:
    widget = ClearanceBar(4.0)
    qtbot.addWidget(widget)
    widget.resize(440, 48)
    return widget


def test_room_in_pixels_and_millimetres(bar: ClearanceBar) -> None:
    bar.show_scene(wall_scene(8.0), None)
    assert bar.text == "Room to the wall  12 px, 3.0 mm"


def test_near_the_wall_is_said_at_once_and_until_it_is_clearly_over(bar: ClearanceBar) -> None:
    seen = []
    for offset_px in (10.0, 16.9, 17.1, 16.0, 15.1, 14.9, 19.5, 22.0):
        bar.show_scene(wall_scene(offset_px), None)
        seen.append(bar.text.rpartition(", ")[2] if "wall" in bar.text.rpartition(", ")[2] else "")
    assert seen == ["", "", *["near the wall"] * 3, "", "at the wall", "at the wall"]


def test_at_the_wall_an_error_of_the_picture_is_no_negative_room(bar: ClearanceBar) -> None:
    bar.show_scene(wall_scene(22.0), None)
    assert bar.text == "Room to the wall  0 px, 0.0 mm, at the wall"
    assert not bar.is_breach


def test_breach_is_said_when_it_lasts_and_until_it_is_clearly_over(bar: ClearanceBar) -> None:
    seen = []
    for k, offset_px in enumerate((24.0, 24.0, 24.0, 22.5, 21.6, 21.4)):
        bar.show_scene(wall_scene(offset_px, 0.1 * k), None)
        seen.append(bar.is_breach)
        if k == 2:
            assert bar.text == f"BREACH: the head is in the wall  ({MINUS}4 px, {MINUS}1.0 mm)"
            assert theme.FAULT in bar_colours(bar)
    assert seen == [False, False, True, True, True, False]


def bar_colours(bar: ClearanceBar) -> set[str]:
    image = bar.grab().toImage()
    return {image.pixelColor(x, y).name().upper() for x in range(image.width()) for y in range(image.height())}


def test_force_has_words_beyond_its_marks(bar: ClearanceBar) -> None:
    texts = []
    for newton in (0.05, 0.16, 0.14, 0.11, 0.6):
        bar.show_scene(wall_scene(0.0), force(newton))
        texts.append(bar.text.partition("; ")[2])
    assert texts[0] == "Wall force  0.05 N"
    assert texts[1] == "Wall force  0.16 N, leans on the wall"
    assert "leans" in texts[2], "0.14 N is below the mark, but not clearly"
    assert "leans" not in texts[3]
    assert texts[4] == "Wall force  0.60 N, PRESSES TOO HARD"


def test_a_rig_that_tells_no_force_shows_none(bar: ClearanceBar) -> None:
    bar.show_scene(wall_scene(0.0), force(None))
    assert "force" not in bar.text


def test_without_a_pose_the_reason_stands_there(bar: ClearanceBar) -> None:
    for captured_s in (0.0, 0.3):
        bar.show_scene(wall_scene(26.0, captured_s), None)
    assert bar.is_breach
    bar.show_scene(make_scene(refusal=Refusal(Reason.OUTSIDE_VESSEL)), None)
    assert bar.text == "Room to the wall: robot is outside the vessel"
    assert not bar.is_breach
    bar.show_scene(None, None)
    assert bar.text == "Room to the wall: not known"


@pytest.mark.parametrize("width", [230, 440, 660])
def test_bar_paints_at_every_width(bar: ClearanceBar, width: int) -> None:
    bar.resize(width, 48)
    for newton in (None, 0.2, 0.7):
        for k, offset_px in enumerate((0.0, 18.0, 25.0, 25.0)):
            bar.show_scene(wall_scene(offset_px, 0.5 * k), force(newton))
            assert len(bar_colours(bar)) > 3


# ---- the ghost on the live view


def test_ghost_is_drawn_only_with_advice_and_goes_with_the_scene(qtbot: QtBot, bench: FakeBench) -> None:
    live = LiveView()
    qtbot.addWidget(live)
    live.resize(640, 480)
    live.show()
    image, scene = bench.scene_at(0, 6.0)
    frame = Frame(0, 0.0, image)
    for layer in Layer:
        live.set_layer(layer, layer is Layer.GHOST)
    live.show_frame(frame, scene)
    QApplication.processEvents()  # what is drawn over a first picture comes a moment later
    bare = live.grab().toImage()
    live.show_frame(frame, scene, ADVICE)
    assert live.grab().toImage() != bare
    live.blank_overlays()
    assert live.grab().toImage() == bare
    live.show_frame(frame, scene, replace(ADVICE, advance_mm_s=math.nan))
    assert live.grab().toImage() == bare
