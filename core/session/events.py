"""What happened beside the frames: one line each in ``events.jsonl``. What can be seen in two pictures of driving is found here."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

from core.control.alerts import Alert
from core.control.drive_view import DriveView
from core.control.gate_checks import Source
from core.control.modes import ARMED_MODES, DRIVING_MODES, Mode
from core.session.checked import finite, finite_tree, group, moment, text
from core.types import Point


class EventKind(StrEnum):
    """The value is the name kept in files."""

    MODE = "mode"
    ARM = "arm"
    DISARM = "disarm"
    OVERRIDE = "override"
    FAULT = "fault"
    CLEARED = "fault cleared"
    ACKNOWLEDGE = "acknowledge"
    ALERT = "alert"
    TARGET = "target"
    NOTE = "note"
    DROPPED = "frames dropped"
    """By the recorder, which was behind."""
    LOST = "frames lost"
    """By the camera: they never came."""
    VIDEO = "video"


@dataclass(frozen=True, slots=True)
class Event:
    """``time_s`` on the clock of the frames; ``data`` adds what a program may want, as plain JSON values."""

    time_s: float
    kind: EventKind
    text: str = ""
    data: dict[str, Any] = field(default_factory=dict)


def events_between(before: DriveView | None, after: DriveView) -> Iterator[Event]:
    """What changed from one picture of driving to the next; the first one has no past and tells its mode only.

    An override is the operator taking back while the program drives: driving -> armed with the motion that goes out his, or wanted.
    """
    now_s = after.time_s
    if before is None:
        yield Event(now_s, EventKind.MODE, after.mode.value)
        return
    if after.mode is not before.mode:
        yield Event(now_s, EventKind.MODE, after.mode.value, {"from": before.mode.value})
        yield from _of_modes(before, after)
    known, active = set(before.active), set(after.active)
    for fault in after.active:
        if fault.cause not in {old.cause for old in known}:
            yield Event(now_s, EventKind.FAULT, str(fault.cause), {"detail": fault.detail})
    for fault in before.active:
        if fault.cause not in {new.cause for new in active}:
            yield Event(now_s, EventKind.CLEARED, str(fault.cause))
    if before.latched is not None and after.latched is None:
        yield Event(now_s, EventKind.ACKNOWLEDGE, str(before.latched.cause))


def _of_modes(before: DriveView, after: DriveView) -> Iterator[Event]:
    if after.mode in ARMED_MODES and before.mode not in ARMED_MODES:
        yield Event(after.time_s, EventKind.ARM)
    if before.mode in ARMED_MODES and after.mode not in ARMED_MODES:
        yield Event(after.time_s, EventKind.DISARM, str(after.latched.cause) if after.latched else "")
    is_back = before.mode in DRIVING_MODES and after.mode is Mode.ARMED
    if is_back and after.permitted is Source.OPERATOR:
        yield Event(after.time_s, EventKind.OVERRIDE, "the operator took back")


def event_of_alert(alert: Alert, time_s: float) -> Event:
    """An alert that was shown."""
    data = {"key": str(alert.key), "detail": alert.detail, "repeats": alert.repeats}
    return Event(time_s, EventKind.ALERT, alert.spec.text, data)


def event_of_target(point: Point | None, time_s: float) -> Event:
    """The destination was chosen (source pixels) or cleared."""
    if point is None:
        return Event(time_s, EventKind.TARGET, "cleared")
    return Event(time_s, EventKind.TARGET, f"{point[0]:.0f}, {point[1]:.0f}", {"xy": [round(point[0], 2), round(point[1], 2)]})


def frames_lost(events: Iterable[Event]) -> int:
    """How many frames never came from the camera, by what the recorder has told of it."""
    counts = (event.data.get("count") for event in events if event.kind is EventKind.LOST)
    return sum(count for count in counts if type(count) is int and count > 0)


_LONGEST_KIND = 40
_ADDED_LATER = "added_later"


def as_added_later(event: Event) -> Event:
    """The event as it is kept when it is added to a session that has ended: the session's own counts know nothing of it."""
    return replace(event, data=event.data | {_ADDED_LATER: True})


def was_added_later(event: Event) -> bool:
    return event.data.get(_ADDED_LATER) is True


def event_to_json(event: Event) -> dict[str, Any]:
    """A JSON object; numbers that are not finite become None."""
    record: dict[str, Any] = {"time_s": finite(event.time_s, 6), "kind": event.kind.value, "text": event.text}
    return record | ({"data": finite_tree(event.data)} if event.data else {})


def event_from_json(record: dict[str, Any]) -> Event:
    """Raises Damaged. What a later version tells of is kept as a note that names its kind."""
    kind, said = text(record.get("kind"), "kind"), text(record.get("text", ""), "text")
    if kind not in set(EventKind):
        kind, said = EventKind.NOTE, f"{kind[:_LONGEST_KIND]}: {said}"
    return Event(moment(record.get("time_s"), "time_s"), EventKind(kind), said, group(record.get("data", {}), "data"))
