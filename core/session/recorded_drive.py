"""Advice, commands, servo status and driving out of a row of ``frames.jsonl``. Pure; part of ``recorded``."""

from __future__ import annotations

from typing import Any

from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.gate_checks import Source
from core.control.modes import Hindrance, Mode
from core.session.checked import Damaged, choice, flag, group, items, maybe_number, number, numbers, text
from core.types import Advice, Command, RobotStatus, Speed


def advice_from(value: Any, name: str) -> Advice | None:
    if value is None:
        return None
    advice = group(value, name)
    return Advice(
        choice(Speed, advice.get("speed"), f"{name}.speed"),
        number(advice.get("advance_mm_s"), f"{name}.advance_mm_s"),
        number(advice.get("steer_deg"), f"{name}.steer_deg"),
        text(advice.get("why"), f"{name}.why"),
    )


def command_from(value: Any, name: str) -> Command | None:
    return None if value is None else Command(*numbers(value, name, 4))


def status_from(value: Any) -> RobotStatus | None:
    if value is None:
        return None
    status = group(value, "servo")
    pull = numbers(status.get("tendon_pull_mm"), "servo.tendon_pull_mm", 4)
    force = numbers(status.get("tendon_force_mn"), "servo.tendon_force_mn", 4)
    return RobotStatus(
        number(status.get("time_s"), "servo.time_s"),
        number(status.get("insertion_mm"), "servo.insertion_mm"),
        number(status.get("delivery_mm"), "servo.delivery_mm"),
        (pull[0], pull[1], pull[2], pull[3]),
        (force[0], force[1], force[2], force[3]),
        maybe_number(status.get("wall_contact_n"), "servo.wall_contact_n"),
    )


def _fault(value: Any, name: str) -> Fault:
    pair = items(value, name)
    if len(pair) != 2:
        raise Damaged(f"{name}: not cause and detail")
    return Fault(choice(Cause, pair[0], name), text(pair[1], name))


def _reasons(value: Any, name: str) -> tuple[Hindrance | Cause, ...]:
    found: list[Hindrance | Cause] = []
    for reason in items(value, name):
        is_hindrance = type(reason) is str and reason in set(Hindrance)
        found.append(choice(Hindrance, reason, name) if is_hindrance else choice(Cause, reason, name))
    return tuple(found)


def _maybe_source(value: Any, name: str) -> Source | None:
    return None if value is None else choice(Source, value, name)


def drive_from(value: Any) -> DriveView | None:
    if value is None:
        return None
    drive = group(value, "drive")
    latched, deadman = drive.get("latched"), drive.get("deadman")
    return DriveView(
        time_s=number(drive.get("time_s"), "drive.time_s"),
        mode=choice(Mode, drive.get("mode"), "drive.mode"),
        permitted=_maybe_source(drive.get("permitted"), "drive.permitted"),
        latched=None if latched is None else _fault(latched, "drive.latched"),
        active=tuple(_fault(fault, "drive.active") for fault in items(drive.get("active"), "drive.active")),
        against_arming=_reasons(drive.get("against_arming"), "drive.against_arming"),
        against_hand_over=_reasons(drive.get("against_hand_over"), "drive.against_hand_over"),
        deadman=None if deadman is None else flag(deadman, "drive.deadman"),
        servos_on=flag(drive.get("servos_on"), "drive.servos_on"),
        busy=text(drive.get("busy"), "drive.busy"),
        asked=command_from(drive.get("asked"), "drive.asked") or Command(),
        asked_s=maybe_number(drive.get("asked_s"), "drive.asked_s"),
        advice=advice_from(drive.get("advice"), "drive.advice"),
        blanked=text(drive.get("blanked"), "drive.blanked"),
        commanded=command_from(drive.get("commanded"), "drive.commanded"),
        sent=command_from(drive.get("sent"), "drive.sent"),
        sent_by=_maybe_source(drive.get("sent_by"), "drive.sent_by"),
        latency_s=maybe_number(drive.get("latency_s"), "drive.latency_s"),
        latency_p95_s=maybe_number(drive.get("latency_p95_s"), "drive.latency_p95_s"),
        follow_share=maybe_number(drive.get("follow_share"), "drive.follow_share"),
    )
