"""Where commands come from, and what the gate limited or rejected."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.widgets.command_panel import CommandPanel, GateEvents
from core.control.drive_view import DriveView
from core.control.gate import Clamp, Rejection, RejectReason, Source
from core.control.joints import Limit
from core.types import Advice, Command, Speed
from tests.app.bus_status import MINUS, bus
from tests.app.hand_clock import Clock
from tests.app.widgets.conftest import Own
from tests.core.robots import TURNED


def clamp(joint: str = "right", asked_mm: float = 1.2, allowed_mm: float = 0.8, limit: Limit = Limit.RATE) -> Clamp:
    return Clamp(joint, asked_mm, allowed_mm, limit)


STALE, TOO_FAR = RejectReason.STALE_POSE, RejectReason.OVER_RATE
SEEN = Rejection(STALE, "182 ms (at most 150 ms)")


@pytest.mark.parametrize(
    ("statuses", "entries"),
    [
        (
            [{"clamps": (clamp(),)}, {"clamps": (clamp("delivery_1", -3.0, -2.9, Limit.STEP),)}],
            [
                ("right: 1.20 → 0.80 mm, speed", 1),
                (f"delivery 1: {MINUS}3.00 → {MINUS}2.90 mm, step from the measured position", 1),
            ],
        ),
        ([{"clamps": (clamp("rotation", -7.17, -6.45),)}], [(f"rotation: {MINUS}7.17 → {MINUS}6.45°, speed", 1)]),
        ([{"cycle": 7, "clamps": (clamp(),)}] * 3, [("right: 1.20 → 0.80 mm, speed", 1)]),
        ([{"rejections": {STALE: 4}}], []),
        (
            [{"rejections": {STALE: 4}}, {"rejection": SEEN, "rejections": {STALE: 5}}, {"rejections": {STALE: 8}}],
            [
                ("rejected: pose behind the command too old: 182 ms (at most 150 ms)", 1),
                ("rejected: pose behind the command too old", 3),
            ],
        ),
        ([{}, {"rejections": {RejectReason.NO_COMMAND: 30, RejectReason.NOT_ARMED: 2}}], []),
        (
            [
                {"cycle": 900, "rejections": {TOO_FAR: 9}},
                {"cycle": 3, "rejections": {TOO_FAR: 1}},
                {"cycle": 4, "rejections": {TOO_FAR: 2}},
            ],
            [("rejected: goal too far away", 1)],
        ),
        ([{"at_end": ("advance",)}], [("advance: stopped at the end of its envelope", 1)]),
    ],
    ids=[
        "in their order",
        "degrees",
        "a cycle once",
        "counted before",
        "between cycles",
        "rest",
        "new bus process",
        "end of envelope",
    ],
)
def test_what_the_gate_limited_and_rejected(statuses: list[dict[str, object]], entries: list[tuple[str, int]]) -> None:
    clock = Clock()
    gate, found = GateEvents(clock), []
    for cycle, changes in enumerate(statuses, start=1):
        clock.now_s += 1.0
        found += gate.since_last(bus(**{"cycle": cycle, **changes}), TURNED)
    assert [(event.text, event.times) for event in found] == entries


ADVICE = Advice(Speed.SLOW, 3.0, 18.3, "coming back")


@pytest.fixture
def panel(own: Own, clock: Clock) -> CommandPanel:
    return own(CommandPanel(clock), 446, 205, show=True)


def lines(panel: CommandPanel) -> list[str]:
    return panel.text.splitlines()


def test_advised_asked_commanded_and_sent_are_kept_apart(panel: CommandPanel) -> None:
    view = DriveView(
        0.0, operator_command=Command(0.4, -0.2, 5.0, 0.0), advice=ADVICE, sent=Command(0.4, -0.2, 5.0, 0.0),
        sent_by=Source.OPERATOR, latency_s=0.0618, follow_share=0.776,
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
        0.0,
        advice=ADVICE,
        program_command=Command(0.5, 0.0, 8.0),
        sent=Command(0.2, 0.0, 8.0),
        sent_by=Source.PROGRAM,
        latency_s=0.12,
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
