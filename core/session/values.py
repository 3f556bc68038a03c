"""The values of a row by name, for tables and messages: the columns of the CSV and the fields of MCAP and live messages."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import reduce
from typing import Any, cast

from core.config.safety import TENDONS
from core.control.drive_view import DriveView
from core.control.modes import Mode
from core.session.codec import RecordedRow
from core.session.manifest import Event, EventKind
from core.types import Command, Tick

FRAME_ID = "camera"
"""The frame of reference of pictures, as messages name it."""
_PATHS = {
    "novelty": "scene.novelty",
    **{name: f"scene.pose.{name}" for name in ("theta_deg", "theta_signed_deg", "c_head_px", "c_tail_px", "crossed")},
    **{name: f"scene.pose.{name}" for name in ("state", "confidence")},
    **{f"advice_{name}": f"advice.{name}" for name in ("speed", "advance_mm_s", "steer_deg")},
    **{name: f"drive.{name}" for name in ("mode", "permitted", "sent_by", "latency_s")},
    **{f"asked_{name}": f"drive.operator_command.{name}" for name in Command.__slots__},
    **{f"commanded_{name}": f"drive.program_command.{name}" for name in Command.__slots__},
    **{f"sent_{name}": f"sent.{name}" for name in Command.__slots__},
    **{name: f"status.{name}" for name in ("insertion_mm", "delivery_mm", "wall_contact_n", "rotation_deg")},
    **{name: name for name in ("row", "index", "captured_s", "video", "pts_ms", "frames_per_second", "dropped_frames")},
    **{name: name for name in ("camera_lost", "dropped_rows", "source_px_per_working_px")},
}
"""Where a value is in a row, by its name in files."""


def values_of(row: RecordedRow) -> dict[str, Any]:
    """The values of a row by name; None where something is missing. Points in source pixels."""
    scene, path, start = row.scene, row.scene.path, cast(Any, row)
    values: dict[str, Any] = {
        name: reduce(lambda found, part: getattr(found, part, None), place.split("."), start) for name, place in _PATHS.items()
    }
    values |= {"width_px": row.size[0], "height_px": row.size[1], "perception_ms": scene.latency_ms.get("total")}
    values["refusal"] = str(scene.refusal) if scene.refusal else None
    for end, point in (("head", path.head), ("tail", path.tail)) if path else (("head", None), ("tail", None)):
        x, y = scene.to_source(point) if point is not None else (None, None)
        values[f"{end}_x_px"], values[f"{end}_y_px"] = (None, None) if x is None or y is None else (round(x, 3), round(y, 3))
    for name in ("pull_mm", "force_mn"):
        each = getattr(row.status, f"tendon_{name}", (None,) * 4)
        values |= {f"tendon_{name}_{tendon}": value for tendon, value in zip(tendon_names(len(each)), each, strict=True)}
    return values


def tendon_names(count: int) -> tuple[str, ...]:
    """Names for the tendons of a status: those of the default robot, numbers for other robots."""
    return TENDONS if count == len(TENDONS) else tuple(f"{number}" for number in range(1, count + 1))


def row_of_tick(tick: Tick, drive: DriveView | None, bus: Any) -> RecordedRow:
    """A tick as the row that a recording of it would have, of the servo bus's status only what messages need; it costs 0.1 ms."""
    frame, height_width = tick.frame, tick.frame.image.shape
    return RecordedRow(
        row=0,
        index=frame.index,
        captured_s=frame.captured_s,
        video=0,
        pts_ms=0,
        size=(height_width[1], height_width[0]),
        dropped_frames=tick.dropped_frames,
        dropped_rows=0,
        frames_per_second=tick.frames_per_second,
        scene=tick.scene,
        advice=tick.advice,
        sent=tick.sent,
        status=tick.status,
        drive=drive,
        bus=_bus_values(bus) if bus is not None else None,
        camera_lost=frame.lost,
    )


def _bus_values(bus: Any) -> dict[str, Any]:
    servos = [{name: getattr(servo, name, None) for name in ("name", "position_mm", "velocity_mm_s")} for servo in bus.servos]
    return {"servos": servos, "zeroed": bus.zeroed, "sent": {"goals_mm": bus.sent.goals_mm} if bus.sent is not None else None}


def rotation_joints(config: Mapping[str, Any]) -> frozenset[str]:
    """Names of the joints that turn the shaft, by a configuration as plain values."""
    joints = (config.get("servos") or {}).get("joints") or ()
    return frozenset(str(j.get("name")) for j in joints if isinstance(j, dict) and j.get("kind") == "rotation")


@dataclass(frozen=True, slots=True)
class JointValues:
    """Joints in the units of CRTK and ROS: metres and metres a second; of a rotation radians. No velocities: not known."""

    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...] = ()


def joint_values(row: RecordedRow, rotation: frozenset[str]) -> tuple[JointValues | None, JointValues | None]:
    """Measured joints, and the goals that left the gate last; None without a servo bus. Joints that are not zeroed are left out."""
    bus = row.bus or {}
    servos: Sequence[Mapping[str, Any]] = bus.get("servos") or ()
    names = tuple(str(servo.get("name")) for servo in servos)
    factors = [math.radians(1.0) if name in rotation else 1e-3 for name in names]
    known = [(n, f, s) for n, f, s in zip(names, factors, servos, strict=True) if s.get("position_mm") is not None]
    measured = JointValues(
        tuple(name for name, _, _ in known),
        tuple(factor * servo["position_mm"] for _, factor, servo in known),
        tuple(factor * (servo.get("velocity_mm_s") or 0.0) for _, factor, servo in known),
    )
    goals: Sequence[float] = (bus.get("sent") or {}).get("goals_mm") or ()
    sent = JointValues(names, tuple(f * goal for f, goal in zip(factors, goals, strict=True))) if len(goals) == len(names) else None
    return (measured if known else None), (sent if goals else None)


def operating_state(row: RecordedRow) -> dict[str, Any]:
    """CRTK's ``operating_state``: state, is_homed (all joints are zeroed) and is_busy."""
    drive, zeroed = row.drive, (row.bus or {}).get("zeroed") or ()
    if drive is None or not (drive.servos_on or drive.latched or drive.mode is not Mode.ADVISORY):
        state = "DISABLED"
    elif drive.latched is not None or drive.mode is Mode.STOPPED:
        state = "FAULT"
    else:
        state = "PAUSED" if drive.mode is Mode.HOLD else "ENABLED"
    return {"state": state, "is_homed": bool(zeroed) and all(zeroed), "is_busy": drive is not None and bool(drive.busy)}


class Severity(Enum):
    """Of an event, as a line of a log."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


_WARNINGS = frozenset({EventKind.DROPPED, EventKind.LOST, EventKind.ALERT, EventKind.OVERRIDE})


def severity(event: Event) -> Severity:
    """A fault is an error."""
    if event.kind is EventKind.FAULT:
        return Severity.ERROR
    return Severity.WARNING if event.kind in _WARNINGS else Severity.INFO


def event_line(event: Event) -> str:
    """An event in one line: "mode: ARMED"."""
    return f"{event.kind.value}: {event.text}" if event.text else event.kind.value
