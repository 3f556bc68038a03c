"""Annotations on disk: one SQLite file, one commit per edit, and every edit kept.

Not in WAL mode: its newest edits lie in a second file, which is lost when only the first is copied to another computer, and it does
not work on network drives. A commit takes some milliseconds, and raters make a few edits a second. The file is locked while it is
open for writing, so that a second window cannot overwrite it; the lock ends with its process. Images are known by their content:
a file that was renamed or moved finds its annotations again.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import sqlite3
import threading
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from core.annotation.model import (
    PROVENANCE,
    AngleProvenance,
    Annotation,
    AnnotationError,
    History,
    ImageView,
    JournalEntry,
    Readout,
    annotation_from_json,
)
from core.devices import disk_errors
from core.files import ImageError, name_as_text, read_image
from core.program import known_program_id

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
ADDED = {
    "origins": "(annotation_id INTEGER PRIMARY KEY REFERENCES annotations(id), origin TEXT NOT NULL)",
    "looks": "(image_id INTEGER NOT NULL REFERENCES images(id), study TEXT NOT NULL, rater TEXT NOT NULL, repeat INTEGER NOT NULL,"
    " after INTEGER NOT NULL, UNIQUE (image_id, study, rater, repeat))",
    "programs": "(version TEXT NOT NULL, commit_id TEXT NOT NULL, first_utc TEXT NOT NULL, UNIQUE (version, commit_id))",
}
"""Tables that files of earlier versions lack, and those versions ignore.

``origins``: a random number that an annotation gets when it is begun, and keeps in every copy: it tells which ones are the same.
``looks``: who was shown the algorithm's answer, and after which of their own edits.
``programs``: versions and commits of this program ("": not known) that have written annotations, and since when.
"""
ANNOTATION_COLUMNS = (
    "sha256, study, rater, repeat, view, content, check_sum, theta_deg, theta_signed_deg, d_head_px, d_tail_px, crossed,"
    " time_spent_s, changed_utc"
)
MEASURED = ("theta_deg", "theta_signed_deg", "d_head_px", "d_tail_px", "crossed")
"""What is kept of the pose of the lines, by the names of ``Pose`` and of the columns."""
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


@dataclass(frozen=True, slots=True)
class StoredAnnotation:
    """An annotation as it was kept, with what was measured from it at that time.

    ``is_short`` (a line shorter than the fit wants) is known once ``measured_alike`` has measured the lines again.
    """

    key: ItemKey
    view: ImageView
    content: Annotation
    theta_deg: float | None
    theta_signed_deg: float | None
    d_head_px: float | None
    d_tail_px: float | None
    crossed: bool | None
    time_spent_s: float
    changed_utc: str
    provenance: AngleProvenance = AngleProvenance.MANUAL
    is_short: bool = False


def stored_from(row: Any) -> StoredAnnotation:
    """A row of ``ANNOTATION_COLUMNS``; raises ValueError, TypeError when it is damaged."""
    sha256, study, rater, repeat, view, text, kept_sum, *measured, spent, changed = row
    if check_sum(text) != kept_sum:
        raise ValueError("its check sum does not fit")
    if not all(isinstance(value, str) for value in (sha256, study, rater, changed)):
        raise TypeError("no text where text should be")
    theta, signed, head, tail, crossed = (None if value is None else float(value) for value in measured)
    pose = theta, signed, head, tail, None if crossed is None else bool(crossed)
    key = ItemKey(sha256, study, rater, int(repeat))
    return StoredAnnotation(key, ImageView(view), annotation_from_json(text), *pose, float(spent), changed)


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


_Edit = tuple[str, int, int, object, str]
"""Kind, base, check sum, content and time of an edit."""


@dataclass(frozen=True, slots=True)
class KeptAnnotation:
    """A row of the table of annotations as it lies there, damage included, with its edits by number; ``origin``: see ``ADDED``."""

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

        Two people may begin in the same millisecond with the same answer: where records of older versions have no origin, the
        first edits must be the same, not only the moment.
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
    rows = database.execute(
        "SELECT a.id, i.sha256, a.study, a.rater, a.repeat, a.content, a.check_sum, a.begun_utc, o.origin FROM annotations a"
        " JOIN images i ON i.id = a.image_id LEFT JOIN origins o ON o.annotation_id = a.id ORDER BY a.id"
    )
    return [KeptAnnotation(*(*row, edits.get(row[0], {}))) for row in rows.fetchall()]


ADD_LOOK = (
    "INSERT INTO looks (image_id, study, rater, repeat, after) SELECT id, ?, ?, ?, ? FROM images WHERE sha256 = ?"
    " ON CONFLICT (image_id, study, rater, repeat) DO UPDATE SET after = min(after, excluded.after)"
)
"""Values: study, rater, repeat, after, SHA-256."""
DEFAULT_NAME = "annotations.lumenpilot.sqlite"


def image_sha256(path: Path) -> str:
    """SHA-256 of the file's bytes; raises AnnotationError."""
    with disk_errors(AnnotationError, path, "cannot be read"):
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()


class AnnotationStore:
    """One open annotation file, made unless it exists or `read_only`. Any thread may call its methods; each is one transaction.

    All of them raise AnnotationError: file missing, damaged, locked, of another kind or of a newer version, or the disk full.
    """

    def __init__(self, path: Path, *, read_only: bool = False) -> None:
        self.path = path
        self.problems: list[str] = []
        self._lock = threading.Lock()
        if path.is_dir():
            raise AnnotationError(f"{path}: is a folder; give the annotation file in it")
        if read_only and not path.is_file():
            raise AnnotationError(f"{path}: no such annotation file; annotate the images first")
        if not path.parent.is_dir():
            raise AnnotationError(f"{path.parent}: no such folder; give another --store FILE")
        with self._named_errors():
            if read_only and path.with_name(f"{path.name}-journal").exists():
                # A process was killed in the middle of a commit: only who may write can take the half of it back.
                with closing(sqlite3.connect(path, timeout=0.3)) as database:
                    database.execute("SELECT count(*) FROM sqlite_master").fetchone()
            uri = f"{path.resolve().as_uri()}{'?mode=ro' if read_only else ''}"
            self._database = sqlite3.connect(uri, timeout=0.3, isolation_level=None, check_same_thread=False, uri=True)
        try:
            with self._named_errors():
                self._prepare(read_only)
        except AnnotationError:
            self._database.close()
            raise

    def close(self) -> None:
        """Give the file free; everything is on disk already."""
        with self._lock:
            self._database.close()

    def __enter__(self) -> AnnotationStore:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def copy_to(self, path: Path) -> None:
        """Write a copy for other processes, which cannot read a file that is open here."""
        with self._lock, self._named_errors():
            self._database.execute("VACUUM INTO ?", (str(path),))

    # ---- images and studies

    def add_image(self, record: ImageRecord, file_size: int, modified_ns: int) -> None:
        """Make an image known, or renew the name under which it lies."""
        with self.transaction() as database:
            database.execute(
                "INSERT INTO images (sha256, name, width, height, file_size, modified_ns) VALUES (?, ?, ?, ?, ?, ?)"
                " ON CONFLICT (sha256) DO UPDATE SET name = excluded.name, file_size = excluded.file_size,"
                " modified_ns = excluded.modified_ns",
                (record.sha256, record.name, record.width, record.height, file_size, modified_ns),
            )

    def images(self) -> dict[str, ImageRecord]:
        """All images ever added, by SHA-256."""
        rows = self._rows("SELECT sha256, name, width, height FROM images ORDER BY id")
        return {str(row[0]): ImageRecord(*row) for row in rows}

    def image_as_last_seen(self, name: str, file_size: int, modified_ns: int) -> ImageRecord | None:
        """The image of that name if the file is unchanged since, so that it need not be read again."""
        found = self._rows(
            "SELECT sha256, name, width, height FROM images WHERE name = ? AND file_size = ? AND modified_ns = ?",
            (name, file_size, modified_ns),
        )
        return ImageRecord(*found[0]) if found else None

    def study_settings(self, name: str) -> dict[str, Any] | None:
        """The settings that the study was begun with, None when there is no such study."""
        found = self._rows("SELECT settings FROM studies WHERE name = ?", (name,))
        try:
            settings: dict[str, Any] | None = json.loads(found[0][0]) if found else None
        except (ValueError, TypeError):
            raise AnnotationError(
                f"{self.path}: the settings of study {name!r} are damaged; begin a study of another name"
            ) from None
        return settings

    def begin_study(self, name: str, settings: dict[str, Any]) -> None:
        with self.transaction() as database:
            row = (name, json.dumps(settings, allow_nan=False), _now())
            database.execute("INSERT INTO studies (name, settings, made_utc) VALUES (?, ?, ?)", row)

    def studies(self) -> list[tuple[str, str]]:
        """All pairs of study and rater that have annotations, "" for the study of what was annotated outside studies."""
        return [(str(s), str(r)) for s, r in self._rows("SELECT DISTINCT study, rater FROM annotations ORDER BY study, rater")]

    # ---- annotations

    def save(
        self, key: ItemKey, view: ImageView, entry: JournalEntry, content: Annotation, measured: Readout, time_spent_s: float
    ) -> None:
        """Keep one edit: when this returns, it is on the disk."""
        text, pose, now = content.to_json(), measured.pose, _now()
        values = {
            "view": view.value,
            "content": text,
            "check_sum": check_sum(text),
            "robot_vector": _vector_json(measured.robot_vector),
            "vessel_vector": _vector_json(measured.vessel_vector),
            **{name: getattr(pose, name) if pose else None for name in MEASURED},
            "state": content.state,
            "suggested_state": pose.state.value if pose else None,
            "cannot_tell": int(content.cannot_tell),
            "note": content.note,
            "time_spent_s": time_spent_s,
            "changed_utc": now,
        }
        names = ", ".join(values)
        renewed = ", ".join(f"{name} = excluded.{name}" for name in values)
        with self.transaction() as database:
            image = database.execute("SELECT id FROM images WHERE sha256 = ?", (key.sha256,)).fetchone()
            if image is None:
                raise AnnotationError(f"{self.path}: image {key.sha256[:12]} is not in it")
            (annotation_id,) = database.execute(
                f"INSERT INTO annotations (image_id, study, rater, repeat, begun_utc, {names})"
                f" VALUES (?, ?, ?, ?, ?, {', '.join('?' * len(values))})"
                f" ON CONFLICT (image_id, study, rater, repeat) DO UPDATE SET {renewed} RETURNING id",
                (image[0], key.study, key.rater, key.repeat, now, *values.values()),
            ).fetchone()
            if database.execute("SELECT 1 FROM journal WHERE annotation_id = ?", (annotation_id,)).fetchone() is None:
                database.execute("INSERT OR IGNORE INTO origins VALUES (?, ?)", (annotation_id, secrets.token_hex(8)))
            program = known_program_id()  # a rater does not wait for git
            written_by = program["version"], program.get("commit", ""), now
            database.execute("INSERT OR IGNORE INTO programs VALUES (?, ?, ?)", written_by)
            step = entry.content.to_json() if entry.content is not None else None
            database.execute(
                "INSERT INTO journal (annotation_id, number, kind, base, action, content, check_sum, made_utc)"
                " VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (annotation_id, entry.number, entry.kind, entry.base, entry.action, step, check_sum(step or ""), now),
            )

    def save_time(self, key: ItemKey, time_spent_s: float) -> None:
        """Keep how long the rater has looked at an image; nothing when it is not annotated."""
        with self.transaction() as database:
            database.execute(
                "UPDATE annotations SET time_spent_s = ? WHERE study = ? AND rater = ? AND repeat = ?"
                " AND image_id = (SELECT id FROM images WHERE sha256 = ?)",
                (time_spent_s, key.study, key.rater, key.repeat, key.sha256),
            )

    def annotations(self, study: str | None = None, rater: str | None = None) -> list[StoredAnnotation]:
        """All annotations (of a study, of a rater), oldest first. A damaged one is left out and named in ``problems``."""
        wanted = [(name, value) for name, value in (("study", study), ("rater", rater)) if value is not None]
        where = " AND ".join(f"a.{name} = ?" for name, _ in wanted) or "1"
        rows = self._rows(
            f"SELECT {ANNOTATION_COLUMNS} FROM annotations a JOIN images i ON i.id = a.image_id WHERE {where} ORDER BY a.id",
            tuple(value for _, value in wanted),
        )
        found = []
        brought = self._keys("journal j JOIN annotations a ON a.id = j.annotation_id AND j.action IN (?, ?)", *PROVENANCE)
        for row in rows:
            try:
                one = stored_from(row)
                found.append(replace(one, provenance=self.history(one.key).provenance) if one.key in brought else one)
            except (ValueError, TypeError) as error:
                self._note(
                    f"{self.path.name}: image {str(row[0])[:12]}, rater {row[2]}, repeat {row[3]}: damaged ({error}); left out"
                )
        return found

    def history(self, key: ItemKey) -> History:
        """All edits of an annotation, for undo. Damaged records are left out and named in ``problems``."""
        rows = self._rows(
            f"SELECT {ENTRY_COLUMNS} FROM journal j JOIN annotations a ON a.id = j.annotation_id"
            " JOIN images i ON i.id = a.image_id WHERE i.sha256 = ? AND a.study = ? AND a.rater = ? AND a.repeat = ?"
            " ORDER BY j.number",
            (key.sha256, key.study, key.rater, key.repeat),
        )
        entries = []
        for row in rows:
            try:
                entries.append(entry_from(row))
            except (ValueError, TypeError) as error:
                self._note(f"{self.path.name}: edit {row[0]} of image {key.sha256[:12]} is damaged ({error}); left out")
        return History(entries, last=max((row[0] for row in rows if isinstance(row[0], int)), default=0))

    def keep_look(self, key: ItemKey, after: int) -> None:
        """Keep that the rater was shown the algorithm's answer, after their own edit of that number (0: before all).

        The first look counts.
        """
        with self.transaction() as database:
            database.execute(ADD_LOOK, (key.study, key.rater, key.repeat, after, key.sha256))

    def given_after_look(self) -> set[ItemKey]:
        """Annotations that were edited after their rater had been shown the algorithm's answer; older files do not record looks."""
        return self._keys(
            "looks l JOIN annotations a USING (image_id, study, rater, repeat)"
            " JOIN journal j ON j.annotation_id = a.id AND j.number > l.after"
        )

    def _keys(self, tables: str, *values: str) -> set[ItemKey]:
        columns = "i.sha256, a.study, a.rater, a.repeat"
        rows = self._rows(f"SELECT DISTINCT {columns} FROM {tables} JOIN images i ON i.id = a.image_id", values)
        return {ItemKey(str(sha256), str(study), str(rater), int(repeat)) for sha256, study, rater, repeat in rows}

    def insert_rows(
        self, columns: Mapping[str, Sequence[str]], tables: Mapping[str, Sequence[Sequence[Any]]], problems: list[str]
    ) -> None:
        """Rows as they lay in a damaged file, each by itself: what does not fit is named in `problems`.

        So is what belongs to a row that is lost: its number will be another one's.
        """
        with self.transaction() as database:
            for table, rows in tables.items():
                known = {row[1] for row in database.execute(f"PRAGMA table_info({table})")}
                if not rows or not known.issuperset(columns[table]):
                    continue
                names, marks = ", ".join(columns[table]), ", ".join("?" * len(columns[table]))
                for row in rows:
                    try:
                        database.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", row)
                    except sqlite3.IntegrityError as error:
                        problems.append(f"a row of {table} is damaged ({error}); left out")
            # In this order: the edits of an annotation go with it.
            for table, belongs_to, parents in (
                ("annotations", "image_id", "images"),
                ("journal", "annotation_id", "annotations"),
                ("origins", "annotation_id", "annotations"),
                ("looks", "image_id", "images"),
            ):
                orphans = f"FROM {table} WHERE {belongs_to} NOT IN (SELECT id FROM {parents})"
                lost, count = database.execute(f"SELECT count(DISTINCT {belongs_to}), count(*) {orphans}").fetchone()
                if count and table not in ("origins", "looks"):
                    problems.append(f"{lost} of {parents} are lost, and with them {count} of {table}")
                database.execute(f"DELETE {orphans}")

    # ---- the file

    @contextmanager
    def transaction(self, *, writing: bool = True) -> Iterator[sqlite3.Connection]:
        """The database in one transaction: an exception before the end takes everything back."""
        with self._lock, self._named_errors():
            self._database.execute("BEGIN IMMEDIATE" if writing else "BEGIN")
            try:
                yield self._database
                self._database.execute("COMMIT")
            finally:
                if self._database.in_transaction:
                    self._database.execute("ROLLBACK")

    def _prepare(self, read_only: bool) -> None:
        database = self._database
        # Bytes that are not UTF-8 become replacement characters; the check sum of that record then differs.
        database.text_factory = lambda data: data.decode("utf-8", errors="replace")
        if not read_only:
            database.execute("PRAGMA locking_mode = EXCLUSIVE")
            database.execute("PRAGMA synchronous = FULL")
            database.execute("BEGIN EXCLUSIVE")
            database.execute("COMMIT")
        (application,), (version,) = (database.execute(f"PRAGMA {name}").fetchone() for name in ("application_id", "user_version"))
        tables = database.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if tables and application != APPLICATION_ID:
            raise AnnotationError(f"{self.path}: a database, but not of annotations; give another --store FILE")
        if version > SCHEMA_VERSION:
            newer = f"written by a newer version (format {version}, this one reads up to {SCHEMA_VERSION})"
            raise AnnotationError(f"{self.path}: {newer}; update LumenPilot, or give another --store FILE")
        if not tables:
            if read_only:
                raise AnnotationError(f"{self.path}: empty; annotate the images first")
            database.executescript(
                f"BEGIN; PRAGMA application_id = {APPLICATION_ID}; PRAGMA user_version = {SCHEMA_VERSION}; {SCHEMA} COMMIT;"
            )
        # Each table against its indexes, too: a flipped bit in a number would give an answer to another image.
        (verdict,) = database.execute("PRAGMA integrity_check(1)").fetchone()
        if verdict != "ok":
            raise sqlite3.DatabaseError("malformed")
        _upgrade(database, read_only)

    def _rows(self, query: str, values: Sequence[Any] = ()) -> list[Any]:
        with self._lock, self._named_errors(), closing(self._database.execute(query, values)) as cursor:
            return cursor.fetchall()

    def _note(self, problem: str) -> None:
        if problem not in self.problems:
            self.problems.append(problem)

    @contextmanager
    def _named_errors(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, UnicodeError) as error:  # damage can reach SQLite's own messages
            raise AnnotationError(f"{self.path}: {_advice(error)}") from None


def _upgrade(database: sqlite3.Connection, read_only: bool) -> None:
    """Give a file of an earlier version what it lacks; one that may only be read gets empty tables in memory."""
    there = {row[0] for row in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    for name, columns in ADDED.items():
        if name not in there:
            database.execute(f"CREATE {'TEMP' if read_only else ''} TABLE {name} {columns}")


def _advice(error: Exception) -> str:
    if isinstance(error, UnicodeEncodeError):
        return "cannot hold a name that is no UTF-8; give names of raters and studies in plain letters"
    text = str(error) if isinstance(error, sqlite3.Error) else "malformed"
    if "locked" in text:
        return "is open in another window; close that one, or give another --store FILE"
    if "full" in text:
        return "the disk is full; free some space. Everything up to the last saved edit is kept"
    if "readonly" in text or "unable to open" in text or "disk I/O" in text:
        return "cannot be written or read here; give another --store FILE"
    if "not a database" in text:
        return "not an annotation file, or its beginning is damaged; give another --store FILE, or try annotate --salvage"
    if "malformed" in text or "corrupt" in text or "no such" in text:
        return "damaged; annotate --salvage writes what is readable into a new file"
    return f"cannot be used ({text})"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def _vector_json(vector: Any) -> str | None:
    return None if vector is None else json.dumps([vector.start, vector.center, vector.end], allow_nan=False)


@dataclass(frozen=True, slots=True)
class FoundImage:
    """An image that is there: its file and its record in the store."""

    path: Path
    record: ImageRecord

    @property
    def sha256(self) -> str:
        return self.record.sha256


def find_images(
    paths: Sequence[Path], store: AnnotationStore, on_progress: Callable[[], None] = lambda: None
) -> tuple[list[FoundImage], list[str]]:
    """The images among `paths`, in order and each content once, made known to the store; and one line for each that is left out.

    A file whose name, size and time are as last seen is not read again. Raises AnnotationError when the store cannot be written.
    """
    found: dict[str, FoundImage] = {}
    problems: list[str] = []
    for path in paths:
        try:
            one = _identified(path, store)
        except (AnnotationError, ImageError) as error:
            if not isinstance(error, ImageError) and not str(error).startswith(str(path)):
                raise
            problems.append(str(error))
        else:
            if one.sha256 in found:
                problems.append(f"{path}: the same picture as {found[one.sha256].path.name}; shown once")
            else:
                found[one.sha256] = one
        on_progress()
    return list(found.values()), problems


def _identified(path: Path, store: AnnotationStore) -> FoundImage:
    with disk_errors(ImageError, path, "cannot be read"):
        state = path.stat()
    name = name_as_text(os.path.relpath(path.resolve(), store.path.parent.resolve()))
    record = store.image_as_last_seen(name, state.st_size, state.st_mtime_ns)
    if record is None:
        sha256 = image_sha256(path)
        height, width = read_image(path).shape[:2]
        record = ImageRecord(sha256, name, width, height)
        store.add_image(record, state.st_size, state.st_mtime_ns)
    return FoundImage(path, record)
