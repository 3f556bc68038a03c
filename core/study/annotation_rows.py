"""The records of an annotation file as they lie in it, damage included, and when two of them are one answer in two files."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass

_Edit = tuple[str, int, int, object, str]
"""Kind, base, check sum, content and time of an edit."""


@dataclass(frozen=True, slots=True)
class KeptAnnotation:
    """One record of the table of annotations with its edits by number; ``origin``: see ``annotation_records.EXTRAS``."""

    row_id: int
    sha256: str
    study: str
    rater: str
    repeat: int
    content: object
    check_sum: int
    begun_utc: str
    origin: str | None
    edits: Mapping[int, _Edit]

    @property
    def key(self) -> tuple[str, str, str, int]:
        return self.sha256, self.study, self.rater, self.repeat

    @property
    def last(self) -> int:
        return max(self.edits, default=0)

    def is_same_as(self, other: KeptAnnotation) -> bool:
        """Whether both began as one, so that they are one person's: in a copy of the file, or in one that was joined before.

        Two people may begin in the same millisecond, and say the same at first: where records of older versions have no origin, the
        beginning must be the same edits, not only the same moment.
        """
        if self.origin is not None and other.origin is not None:
            return self.origin == other.origin
        if self.begun_utc != other.begun_utc:
            return False
        both = sorted(self.edits.keys() & other.edits.keys())
        if not both:
            return self.check_sum == other.check_sum and self.content == other.content
        shared = [_is_same_edit(self.edits[number], other.edits[number]) for number in both]
        return all(shared) or (len(shared) > 2 and all(shared[:2]))

    def agrees_with(self, other: KeptAnnotation) -> bool:
        """Whether one of the two only went on where the other one stopped."""
        both = self.edits.keys() & other.edits.keys()
        return self.is_same_as(other) and all(_is_same_edit(self.edits[number], other.edits[number]) for number in both)


def _is_same_edit(one: _Edit, other: _Edit) -> bool:
    """Of a damaged edit the content or its check sum is still as it was written."""
    (*kind, check, content, made), (*kind_there, check_there, content_there, made_there) = one, other
    return (kind, made) == (kind_there, made_there) and (check == check_there or content == content_there)


def read_kept(database: sqlite3.Connection) -> list[KeptAnnotation]:
    """All records, oldest first."""
    edits: dict[int, dict[int, _Edit]] = {}
    journal = "SELECT annotation_id, number, kind, base, check_sum, content, made_utc FROM journal"
    for row_id, number, *edit in database.execute(journal).fetchall():
        edits.setdefault(row_id, {})[number] = tuple(edit)
    has_origins = has_table(database, "origins")
    origin, beside = ("o.origin", "LEFT JOIN origins o ON o.annotation_id = a.id") if has_origins else ("NULL", "")
    rows = database.execute(
        f"SELECT a.id, i.sha256, a.study, a.rater, a.repeat, a.content, a.check_sum, a.begun_utc, {origin} FROM annotations a"
        f" JOIN images i ON i.id = a.image_id {beside} ORDER BY a.id"
    )
    found: list[KeptAnnotation] = []
    for row_id, sha256, study, rater, repeat, content, check_sum, begun_utc, came_from in rows.fetchall():
        kept = edits.get(row_id, {})
        found.append(KeptAnnotation(row_id, sha256, study, rater, repeat, content, check_sum, begun_utc, came_from, kept))
    return found


def has_table(database: sqlite3.Connection, name: str) -> bool:
    """Files of older versions lack some."""
    found = database.execute("SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = ?", (name,)).fetchone()
    return bool(found[0])
