"""Annotations on disk: one SQLite file, one commit per edit, and every edit kept.

Not in WAL mode: its newest edits lie in a second file, which is lost when only the first is copied to another computer, and it does
not work on network drives. A commit takes some milliseconds, and hands make a few edits a second. The file is locked while it is
open for writing, so that a second window cannot write over it; the lock dies with its process.
"""

from __future__ import annotations

import hashlib
import json
import secrets
import sqlite3
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from core.study.annotation_history import History, JournalEntry
from core.study.annotation_records import (
    ANNOTATION_COLUMNS,
    APPLICATION_ID,
    ENTRY_COLUMNS,
    EXTRAS,
    SCHEMA,
    SCHEMA_VERSION,
    TAKES_LINES,
    ImageRecord,
    ItemKey,
    StoredAnnotation,
    check_sum,
    entry_from,
    stored_from,
)
from core.study.annotation_rows import has_table
from core.study.annotations import Annotation, AnnotationError, Readout, View

DEFAULT_NAME = "annotations.lumenpilot.sqlite"


def image_sha256(path: Path) -> str:
    """SHA-256 of the file's bytes; raises AnnotationError."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise AnnotationError(f"{path}: cannot be read ({error.strerror})") from None


class AnnotationStore:
    """One open annotation file. Its methods may be called from any thread, and each is one transaction.

    Parameters
    ----------
    path : the file; it is made when there is none.
    read_only : look only; then there must be one.

    Raises
    ------
    AnnotationError
        From every method: file missing, damaged, locked, of another kind or of a newer version, or the disk full.
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
        if not found:
            return None
        try:
            settings: dict[str, Any] = json.loads(found[0][0])
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
        self, key: ItemKey, view: View, entry: JournalEntry, content: Annotation, measured: Readout, time_spent_s: float
    ) -> None:
        """Keep one edit: when this returns, it is on the disk."""
        text, pose, now = content.to_json(), measured.pose, _now()
        values = {
            "view": view.value,
            "content": text,
            "check_sum": check_sum(text),
            "robot_vector": _vector_json(measured.robot_vector),
            "vessel_vector": _vector_json(measured.vessel_vector),
            "theta_deg": pose.theta_deg if pose else None,
            "theta_signed_deg": pose.theta_signed_deg if pose else None,
            "d_head_px": pose.d_head_px if pose else None,
            "d_tail_px": pose.d_tail_px if pose else None,
            "crossed": int(pose.crossed) if pose else None,
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
            step = entry.content.to_json() if entry.content is not None else None
            database.execute(
                "INSERT INTO journal (annotation_id, number, kind, base, action, content, check_sum, made_utc)"
                " VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (annotation_id, entry.number, entry.kind, entry.base, entry.action, step, check_sum(step or ""), now),
            )

    def save_time(self, key: ItemKey, time_spent_s: float) -> None:
        """Keep how long the rater has looked at an image; nothing when he has not annotated it."""
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
        for row in rows:
            try:
                found.append(stored_from(row))
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

    def taken_over(self) -> set[ItemKey]:
        """Annotations whose lines were the algorithm's at some time: what became of them agrees with it the more for that."""
        rows = self._rows(
            "SELECT DISTINCT i.sha256, a.study, a.rater, a.repeat FROM journal j JOIN annotations a ON a.id = j.annotation_id"
            " JOIN images i ON i.id = a.image_id WHERE j.action = ?",
            (TAKES_LINES,),
        )
        return {ItemKey(str(sha256), str(study), str(rater), int(repeat)) for sha256, study, rater, repeat in rows}

    def keep_look(self, key: ItemKey, after: int) -> None:
        """Keep that the rater was shown the algorithm's answer, after his own edit of that number (0: before all).

        The first look counts.
        """
        with self.transaction() as database:
            database.execute(
                "INSERT INTO looks (image_id, study, rater, repeat, after) SELECT id, ?, ?, ?, ? FROM images WHERE sha256 = ?"
                " ON CONFLICT (image_id, study, rater, repeat) DO UPDATE SET after = min(after, excluded.after)",
                (key.study, key.rater, key.repeat, after, key.sha256),
            )

    def given_after_look(self) -> set[ItemKey]:
        """Annotations that were edited after their rater had been shown the algorithm's answer; older files tell none."""
        with self.transaction(writing=False) as database:
            if not has_table(database, "looks"):
                return set()
        rows = self._rows(
            "SELECT DISTINCT i.sha256, a.study, a.rater, a.repeat FROM looks l JOIN images i ON i.id = l.image_id"
            " JOIN annotations a ON a.image_id = l.image_id AND a.study = l.study AND a.rater = l.rater AND a.repeat = l.repeat"
            " JOIN journal j ON j.annotation_id = a.id AND j.number > l.after"
        )
        return {ItemKey(str(sha256), str(study), str(rater), int(repeat)) for sha256, study, rater, repeat in rows}

    def take_rows(
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
        """The database, for all or nothing: whatever raises before the end takes everything back."""
        with self._lock, self._named_errors():
            self._database.execute("BEGIN IMMEDIATE" if writing else "BEGIN")
            try:
                yield self._database
                self._database.execute("COMMIT")
            finally:  # whatever ended it before the commit
                if self._database.in_transaction:
                    self._database.execute("ROLLBACK")

    def _prepare(self, read_only: bool) -> None:
        database = self._database
        # Bytes that are no text any more become replacement characters: the record's check sum tells, the others are read.
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
        if not read_only:
            database.executescript(f"BEGIN; {EXTRAS} COMMIT;")

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


def _vector_json(vector: Any) -> str | None:
    return None if vector is None else json.dumps([vector.start, vector.center, vector.end], allow_nan=False)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
