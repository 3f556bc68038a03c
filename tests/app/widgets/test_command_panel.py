"""Where commands come from, and what the gate limited or rejected."""

from __future__ import annotations

from dataclasses import replace

import pytest
from pytestqt.qtbot import QtBot

from app.widgets.command_panel import MAX_ENTRIES, ClampLog, CommandPanel
from core.config.safety import SafetyConfig, ServosConfig
from core.control.gate import Clamp, Rejection, RejectReason, Source
from core.control.joints import Limit
from core.control.pilot import DriveView
from core.types import Advice, Command, Speed
from hardware.servos.bus_ipc import BusPhase, BusStatus, CycleTimes
from hardware.servos.dynamixel_port import LineCounts
from hardware.servos.registers import HardwareError, ServoReading, ServoState
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


@pytest.fixture
def clock() -> Clock:
    return Clock()


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
    assert [log.item(0, column).text() for column in range(4)] == ["12:00:00", "right", "999.00 → 0.80 mm, speed", ""]
    assert log.item(MAX_ENTRIES - 1, 2).text() == "500.00 → 0.80 mm, speed"
    assert [log.item(row, 2).text() for row in range(log.rowCount())] == [entry.text for entry in log.log.entries]


def test_repeats_renew_their_row(panel: CommandPanel, clock: Clock) -> None:
    for cycle in range(1, 30):
        clock.now_s += 0.1
        panel.show_view(DriveView(0.0), bus(cycle=cycle, time_s=0.1 * cycle, clamps=(clamp(), clamp("up", limit=Limit.MARGIN))))
    clock.now_s += 1.0
    panel.show_view(DriveView(0.0), None)
    log = panel.log
    assert [log.item(row, 3).text() for row in range(log.rowCount())] == ["×29", "×29"]
