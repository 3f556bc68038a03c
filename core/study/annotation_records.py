"""The records of an annotation file: its tables, and how a row is checked and read."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

from core.study.annotation_history import JournalEntry
from core.study.annotations import Annotation, View, annotation_from_json

SCHEMA_VERSION = 1
APPLICATION_ID = 0x4C50414E  # "LPAN"

SCHEMA = """
CREATE TABLE images (id INTEGER PRIMARY KEY, sha256 TEXT NOT NULL UNIQUE, name TEXT NOT NULL, width INTEGER NOT NULL,
    height INTEGER NOT NULL, file_size INTEGER NOT NULL, modified_ns INTEGER NOT NULL);
CREATE TABLE studies (name TEXT PRIMARY KEY, settings TEXT NOT NULL, made_utc TEXT NOT NULL);
CREATE TABLE annotations (id INTEGER PRIMARY KEY, image_id INTEGER NOT NULL REFERENCES images(id), study TEXT NOT NULL,
    rater TEXT NOT NULL, repeat INTEGER NOT NULL, view TEXT NOT NULL, content TEXT NOT NULL, check_sum INTEGER NOT NULL,
    robot_vector TEXT, vessel_vector TEXT, theta_deg REAL, theta_signed_deg REAL, d_head_px REAL, d_tail_px REAL, crossed INTEGER,
    state TEXT, suggested_state TEXT, cannot_tell INTEGER NOT NULL, note TEXT NOT NULL, time_spent_s REAL NOT NULL,
    begun_utc TEXT NOT NULL, changed_utc TEXT NOT NULL, UNIQUE (image_id, study, rater, repeat));
CREATE TABLE journal (id INTEGER PRIMARY KEY, annotation_id INTEGER NOT NULL REFERENCES annotations(id), number INTEGER NOT NULL,
    kind TEXT NOT NULL, base INTEGER NOT NULL, action TEXT NOT NULL, content TEXT, check_sum INTEGER NOT NULL,
    made_utc TEXT NOT NULL, UNIQUE (annotation_id, number));
"""
EXTRAS = """
CREATE TABLE IF NOT EXISTS origins (annotation_id INTEGER PRIMARY KEY REFERENCES annotations(id), origin TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS looks (image_id INTEGER NOT NULL REFERENCES images(id), study TEXT NOT NULL, rater TEXT NOT NULL,
    repeat INTEGER NOT NULL, after INTEGER NOT NULL, UNIQUE (image_id, study, rater, repeat));
"""
"""What files of earlier versions lack, and these leave alone.

``origins``: a random number that an annotation gets when it is begun, and keeps in every copy: it tells whose it is.
``looks``: who was shown the algorithm's answer, and after which of his own edits.
"""
ANNOTATION_COLUMNS = (
    "sha256, study, rater, repeat, view, content, check_sum, theta_deg, theta_signed_deg, d_head_px, d_tail_px, crossed,"
    " time_spent_s, changed_utc"
)
ENTRY_COLUMNS = "j.number, j.kind, j.base, j.action, j.content, j.check_sum"


@dataclass(frozen=True, slots=True)
class ImageRecord:
    """An image by its content: ``name`` is its path from the store's folder when it was last seen."""

    sha256: str
    name: str
    width: int
    height: int

    @property
    def size(self) -> tuple[int, int]:
        return self.width, self.height


@dataclass(frozen=True, slots=True)
class ItemKey:
    """One annotation: image, study ("" outside studies), rater, and the how-many-th time (1, 2, ...)."""

    sha256: str
    study: str
    rater: str
    repeat: int = 1


TAKES_LINES = "take the algorithm's lines"
"""The edit by which a rater begins with the algorithm's answer."""


@dataclass(frozen=True, slots=True)
class StoredAnnotation:
    """An annotation as it was kept, with what was measured from it at that time."""

    key: ItemKey
    view: View
    content: Annotation
    theta_deg: float | None
    theta_signed_deg: float | None
    d_head_px: float | None
    d_tail_px: float | None
    crossed: bool | None
    time_spent_s: float
    changed_utc: str


def stored_from(row: Any) -> StoredAnnotation:
    """A row of ``ANNOTATION_COLUMNS``; raises ValueError, TypeError when it is damaged."""
    sha256, study, rater, repeat, view, text, kept_sum, *measured, spent, changed = row
    if check_sum(text) != kept_sum:
        raise ValueError("its check sum does not fit")
    if not all(isinstance(value, str) for value in (sha256, study, rater, changed)):
        raise TypeError("no text where text should be")
    theta, signed, head, tail, crossed = (None if value is None else float(value) for value in measured)
    key = ItemKey(sha256, study, rater, int(repeat))
    return StoredAnnotation(
        key=key,
        view=View(view),
        content=annotation_from_json(text),
        theta_deg=theta,
        theta_signed_deg=signed,
        d_head_px=head,
        d_tail_px=tail,
        crossed=None if crossed is None else bool(crossed),
        time_spent_s=float(spent),
        changed_utc=changed,
    )


def entry_from(row: Any) -> JournalEntry:
    """A row of ``ENTRY_COLUMNS``; raises ValueError, TypeError when it is damaged."""
    number, kind, base, action, text, kept_sum = row
    if check_sum(text or "") != kept_sum:
        raise ValueError("its check sum does not fit")
    if kind not in ("edit", "undo", "redo"):
        raise ValueError(f"unknown kind {kind!r}")
    return JournalEntry(int(number), kind, int(base), action, annotation_from_json(text) if text else None)


def check_sum(text: object) -> int:
    """What tells that a record is as it was written; raises TypeError for what is no text at all."""
    if not isinstance(text, str):
        raise TypeError("no text where text should be")
    return zlib.crc32(text.encode())
