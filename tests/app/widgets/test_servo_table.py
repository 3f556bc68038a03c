"""What the operator sees of the servos, and what is confirmed before it is done."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from PySide6.QtWidgets import QMenu, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.widgets.servo_table import Column, ServoTable, Tone, bus_line, error_words, known_joints, pair_balances, servo_rows
from core.config.safety import SafetyConfig
from core.control.kept_zero import ZeroRequest
from hardware.servos.bus_ipc import BusPhase, BusStatus, CycleTimes
from hardware.servos.registers import HardwareError, MissingServo
from tests.app.bus_status import DASH, MINUS, SERVOS, bus, servo
from tests.app.hand_clock import Clock
from tests.app.widgets.conftest import Own
from tests.core.robots import THREE, TURNED

SAFETY = SafetyConfig()


def cells(status: BusStatus | None, place: int) -> dict[Column, tuple[str, Tone]]:
    return {column: (cell.text, cell.tone) for column, cell in zip(Column, servo_rows(status, SERVOS, SAFETY)[place], strict=True)}


def test_where_a_joint_is_is_known_of_a_zeroed_one_that_answers() -> None:
    assert known_joints(None, SERVOS, 100.0) == (True,) * 7, "a robot without a bus tells it itself"
    assert known_joints(bus(), SERVOS, 100.5) == (True,) * 7
    assert known_joints(bus(), SERVOS, 102.0) == (False,) * 7, "the bus is silent"
    assert known_joints(bus(servos=(), zeroed=(False,) * 7), SERVOS, 100.0) == (False,) * 7
    silent = MissingServo(SERVOS.joints[2].name, SERVOS.joints[2].id, 100.0, 5, "no answer")
    some = bus(silent, zeroed=(True, False, True, True, True, True, False))
    assert known_joints(some, SERVOS, 100.0) == (True, False, False, True, True, True, False)


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


LOOSE = {"position_mm": None, "goal_mm": None}


@pytest.mark.parametrize(
    ("place", "changes", "column", "text", "tone"),
    [
        (4, {"position_mm": 123.456}, Column.POSITION, "123.5", Tone.PLAIN),  # feeds are read in tenths
        (2, {"position_mm": 2.5}, Column.POSITION, "2.50", Tone.PLAIN),  # envelope -2.4 to 2.8 mm, margin 0.3 mm
        (2, {"position_mm": 2.6}, Column.POSITION, "!2.60", Tone.WARN),
        (2, {"position_mm": -2.2}, Column.POSITION, f"!{MINUS}2.20", Tone.WARN),
        (2, {"position_mm": 2.81}, Column.POSITION, "!!2.81", Tone.BAD),
        (0, LOOSE, Column.POSITION, DASH, Tone.FAINT),
        (0, {"temperature_c": 64.0}, Column.TEMPERATURE, "64", Tone.PLAIN),  # limit 70, warning 5 degrees before
        (0, {"temperature_c": 65.0}, Column.TEMPERATURE, "!65", Tone.WARN),
        (0, {"temperature_c": 70.0}, Column.TEMPERATURE, "!!70", Tone.BAD),
        (0, {"temperature_c": 70.0}, Column.JOINT, "right · 1", Tone.BAD),  # the joint's name is marked as well
        (0, {"voltage_v": 11.1}, Column.VOLTAGE, "11.1", Tone.PLAIN),
        (0, {"voltage_v": 11.0}, Column.VOLTAGE, "!11.0", Tone.WARN),
        (0, {"voltage_v": 10.5}, Column.VOLTAGE, "!!10.5", Tone.BAD),
        (0, {"current_ma": 62.0}, Column.CURRENT, "62", Tone.PLAIN),
        (0, {"current_ma": -64.0}, Column.CURRENT, f"!!{MINUS}64", Tone.BAD),  # nine tenths of what its force limit allows
        (4, {"current_ma": 94.0}, Column.CURRENT, "94", Tone.PLAIN),  # the feed may give more
        (0, {"current_ma": None}, Column.CURRENT, DASH, Tone.PLAIN),  # models that report a load
        (0, {"watchdog_tripped": True}, Column.ERROR, "bus watchdog", Tone.BAD),
        (0, {"torque": False}, Column.TORQUE, "!!off", Tone.BAD),  # armed, and yet it does not hold
    ],
)
def test_cells_and_their_warnings(place: int, changes: dict[str, object], column: Column, text: str, tone: Tone) -> None:
    assert cells(bus(servo(place, **changes)), place)[column] == (text, tone)


def test_before_arming_loose_and_unzeroed_joints_are_no_fault() -> None:
    row = cells(bus(servo(0, torque=False, **LOOSE), phase=BusPhase.DISARMED, zeroed=(False,) * 7), 0)
    assert (row[Column.TORQUE], row[Column.ZERO]) == (("off", Tone.FAINT), ("!no", Tone.WARN))


def test_track_tells_shares_of_the_envelope() -> None:
    track = servo_rows(bus(servo(0, position_mm=0.2, goal_mm=2.8)), SERVOS, SAFETY)[0][1].track
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


def test_nothing_is_known_without_a_bus_and_while_its_port_is_closed() -> None:
    for status in (None, bus(phase=BusPhase.CLOSED, servos=())):
        assert {cell.text for row in servo_rows(status, SERVOS, SAFETY) for cell in row[1:]} == {DASH}


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


def test_tension_is_told_by_the_currents() -> None:
    """100 mA at 4.1 Nm / 2.3 A on a drum of 40 mm per turn: 0.178 Nm / 6.37 mm = 28 N."""
    first, second = pair_balances(bus(servo(0, current_ma=100.0), servo(2, current_ma=None)), SERVOS)
    silent, _ = pair_balances(bus(MissingServo("left", 2, 100.0, 3, "no answer")), SERVOS)
    assert silent.share is None
    loose, _ = pair_balances(bus(servo(0, position_mm=0.0), servo(1, position_mm=0.0), phase=BusPhase.DISARMED), SERVOS)
    assert (loose.share, loose.word) == (pytest.approx(-1.0), ""), "slack wires are no warning before arming"
    assert first.forces_n[0] == pytest.approx(28.0, abs=0.05)
    assert second.forces_n is None


def test_bus_line_has_phase_timing_and_counts() -> None:
    assert bus_line(bus()).text == "bus armed  ·  cycle 20.0 ms, p99 21.4 ms  ·  bad packets 3  ·  clamps 12"
    slow = bus_line(bus(times=CycleTimes(20.0, 31.0, 4.0, 6.0)))
    assert "! p99 31.0 ms" in slow.text
    assert slow.tone is Tone.WARN
    assert "not measured yet" in bus_line(bus(times=CycleTimes())).text
    assert "no servo bus" in bus_line(None).text


@pytest.fixture
def table(own: Own, clock: Clock) -> Iterator[ServoTable]:
    widget = own(ServoTable(SAFETY, clock), 446, 205, show=True)
    yield widget
    for menu in widget.findChildren(QMenu):
        menu.close()


def test_an_old_status_is_silence_not_news(table: ServoTable, clock: Clock) -> None:
    table.show_status(bus(), SERVOS)
    clock.now_s += 3.0
    table.show_status(bus(), SERVOS)
    assert table.bus.text() == "!! nothing heard from the servo bus for 3 s"
    assert table.table.cell(0, Column.POSITION).text == DASH


def button(widget: QWidget, text: str) -> QPushButton:
    return next(found for found in widget.findChildren(QPushButton) if found.text().startswith(text))


def choose(menu: QMenu, text: str) -> None:
    next(action for action in menu.actions() if action.text() == text).trigger()
    menu.close()


def test_zeroing_is_asked_back_and_then_told(table: ServoTable, qtbot: QtBot) -> None:
    table.show_status(bus(phase=BusPhase.DISARMED), SERVOS)
    asked: list[object] = []
    table.zero_asked.connect(asked.append)
    button(table, "Zero").click()
    dialog = table.zeros
    assert not dialog.isModal(), "STOP stays within reach"
    box, number = dialog.feed("delivery_1")
    box.setChecked(True)
    number.setValue(12.5)
    dialog.leave_button.click()
    assert table.zeros is None
    assert asked == []
    table.open_zeros()
    table.zeros.feed("delivery_1")[1].setValue(12.5)
    table.zeros.feed("delivery_1")[0].setChecked(True)
    table.zeros.set_button.click()
    assert asked == [ZeroRequest(positions_mm={"delivery_1": 12.5})]


@pytest.mark.parametrize(
    ("changes", "lacks"),
    [
        ({"phase": BusPhase.DISARMED}, False),
        ({"phase": BusPhase.DISARMED, "zeroed": (False,) + (True,) * 6}, True),
        ({"zeroed": (False,) + (True,) * 6}, False),
        ({"phase": BusPhase.DISARMED, "zeroed": (False,) * 7, "servos": ()}, False),
    ],
)
def test_a_joint_that_is_not_zeroed_is_noticed_when_all_servos_answer(
    table: ServoTable, changes: dict[str, object], lacks: bool
) -> None:
    table.show_status(bus(**changes), SERVOS)
    assert table.lacks_zeros is lacks


def test_restart_and_torque_off_are_asked_back(table: ServoTable, qtbot: QtBot) -> None:
    table.show_status(bus(phase=BusPhase.DISARMED), SERVOS)
    menu = button(table, "Restart").menu()
    menu.aboutToShow.emit()
    choose(menu, "3  up")
    assert table.question.text == "Restart servo 3 (up)? It must be zeroed again."
    with qtbot.waitSignal(table.reboot_asked) as signal:
        next(b for b in table.question.findChildren(QPushButton) if b.text() == "Restart").click()
    assert signal.args == [3]
    button(table, "Torque off").click()
    with qtbot.waitSignal(table.torque_off_asked):
        next(b for b in table.question.findChildren(QPushButton) if b.text() == "Torque off").click()


def test_while_armed_only_the_torque_can_be_let_go(table: ServoTable) -> None:
    table.show_status(bus(), SERVOS)
    assert not button(table, "Restart").isEnabled()
    assert not button(table, "Zero").isEnabled()
    assert button(table, "Torque off").isEnabled()
    assert button(table, "Zero").toolTip() == "press STOP or Torque off first"
    table.show_status(None, SERVOS)
    assert not button(table, "Torque off").isEnabled()


def test_arming_takes_an_open_question_back_and_closes_the_dialog_of_the_zeros(table: ServoTable) -> None:
    table.show_status(bus(phase=BusPhase.DISARMED), SERVOS)
    table.open_zeros()
    button(table, "Torque off").click()
    assert table.question.text
    table.show_status(bus(), SERVOS)
    assert table.question.text == ""
    assert table.zeros is None


def test_a_robot_of_another_shape_has_rows_of_its_own(qtbot: QtBot) -> None:
    table = ServoTable()
    qtbot.addWidget(table)
    table.show_status(None, TURNED)
    assert [table.table.cell(row, Column.JOINT).text for row in range(table.table.rowCount())] == [
        "tendon 1 \N{MIDDLE DOT} 1", "tendon 2 \N{MIDDLE DOT} 2", "advance \N{MIDDLE DOT} 3", "rotation \N{MIDDLE DOT} 4",
    ]  # fmt: skip
    assert [pair.title for pair in pair_balances(None, TURNED)] == ["tendon 1 + tendon 2"]
    (three,) = pair_balances(None, THREE)
    assert three.title == "tendon 1 + tendon 2 + tendon 3"
    assert three.wanted_mm == pytest.approx(0.9)
    state = replace(servo(3), name="rotation", position_mm=30.0)
    rows = servo_rows(replace(bus(), servos=(*bus().servos[:2], bus().servos[4], state), zeroed=(True,) * 4), TURNED, SAFETY)
    tips = [cell.tip for cell in rows[3]]
    assert any("envelope -200 to 200°" in tip for tip in tips), tips
    assert any("N mm at most" in tip for tip in tips), tips
    assert rows[3][list(Column).index(Column.POSITION)].text == "30.0°"
