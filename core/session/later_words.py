"""Words of a later version of the program in a recorded row: what they belong to is left out, and the row stands. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum
from typing import Any

from core.control.faults import Cause
from core.control.gate_checks import Source
from core.control.modes import Hindrance, Mode
from core.types import PoseState, Reason, Speed

Row = dict[str, Any]

_PAIR = 2


def without_later_words(record: Row) -> tuple[Row, tuple[str, ...]]:
    """The row without what this version has no word for, and these words, each with its place.

    Damage is not looked for here: a row whose checksum is right says what its writer meant.
    """
    unknown: list[str] = []
    row = dict(record)
    if _is_later(PoseState, row.get("state"), "state", unknown):
        row["state"] = None
    if isinstance(row.get("refusal"), dict) and _is_later(Reason, row["refusal"].get("reason"), "refusal", unknown):
        row["refusal"] = None
    row["advice"] = _advice(row.get("advice"), unknown)
    if isinstance(row.get("drive"), dict):
        row["drive"] = _drive(row["drive"], unknown)
    return row, tuple(dict.fromkeys(unknown))


def _is_later(kind: type[StrEnum], word: Any, place: str, unknown: list[str]) -> bool:
    """What is no text is for others to judge."""
    if not isinstance(word, str) or word in set(kind):
        return False
    unknown.append(f"{place} {word[:40]!r}")
    return True


def _advice(advice: Any, unknown: list[str]) -> Any:
    is_later = isinstance(advice, dict) and _is_later(Speed, advice.get("speed"), "speed", unknown)
    return None if is_later else advice


def _drive(drive: Row, unknown: list[str]) -> Row | None:
    if _is_later(Mode, drive.get("mode"), "mode", unknown):
        return None
    known = dict(drive)
    for name in ("permitted", "sent_by"):
        if _is_later(Source, known.get(name), name, unknown):
            known[name] = None
    known["latched"] = next(_known_faults([known.get("latched")], unknown), None)
    if isinstance(known.get("active"), list):
        known["active"] = list(_known_faults(known["active"], unknown))
    for name in ("against_arming", "against_hand_over"):
        if isinstance(known.get(name), list):
            known[name] = [word for word in known[name] if _is_hindrance(word) or not _is_later(Cause, word, name, unknown)]
    known["advice"] = _advice(known.get("advice"), unknown)
    return known


def _is_hindrance(word: Any) -> bool:
    return isinstance(word, str) and word in set(Hindrance)


def _known_faults(faults: list[Any], unknown: list[str]) -> Iterator[Any]:
    for fault in faults:
        if not (isinstance(fault, list) and len(fault) == _PAIR and _is_later(Cause, fault[0], "fault", unknown)):
            yield fault
