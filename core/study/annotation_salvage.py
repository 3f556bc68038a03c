"""What is readable of a damaged annotation file, written into a new one; the damaged file is never touched."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from core.study.annotation_store import AnnotationStore
from core.study.annotations import AnnotationError

_MAX_ROW = 1_000_000
_MISSES = 2_000
"""After so many rows in a row that cannot be read, nothing more is expected."""
_TABLES = ("images", "studies", "annotations", "journal", "origins", "looks")


def salvage(damaged: Path, target: Path) -> tuple[int, list[str]]:
    """Copy all rows that can be read.

    Returns
    -------
    tuple
        Number of annotations in the new file, and one line for each table or record that is lost.

    Raises
    ------
    AnnotationError
        Nothing can be read, or the new file is there already or cannot be written.
    """
    if not damaged.is_file():
        raise AnnotationError(f"{damaged}: no such annotation file")
    if target.exists():
        raise AnnotationError(f"{target}: is there already; choose another --out")
    found = _read(damaged)
    if not found.rows:
        raise AnnotationError(f"{damaged}: nothing in it can be read{f' ({found.why})' if found.why else ''}")
    columns, tables, problems = found.columns, found.tables, found.problems
    with AnnotationStore(target) as store:
        store.take_rows(columns, tables, problems)
    with AnnotationStore(target, read_only=True) as store:
        kept = len(store.annotations())
        problems += store.problems
    return kept, problems


@dataclass(slots=True)
class _Found:
    """What of a file can be read; ``why`` not more of it can."""

    columns: dict[str, list[str]] = field(default_factory=dict)
    tables: dict[str, list[tuple[Any, ...]]] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    why: str = ""

    @property
    def rows(self) -> int:
        """Of images and annotations."""
        return len(self.tables.get("images", [])) + len(self.tables.get("annotations", []))


def _read(damaged: Path) -> _Found:
    """Read copies of a file: the database itself takes back in them what a crash has left half done, as its journal says.

    That may be damaged, too: then the file is read without.
    """
    found = _Found()
    for endings in (("", "-journal", "-wal"), ("",)):
        with tempfile.TemporaryDirectory() as scratch:
            copy = Path(scratch) / "damaged.sqlite"
            try:
                for ending in endings:
                    if (beside := damaged.with_name(damaged.name + ending)).is_file():
                        shutil.copyfile(beside, copy.with_name(copy.name + ending))
            except OSError as error:
                raise AnnotationError(f"{error.filename or damaged}: cannot be read ({error.strerror})") from None
            again = _read_copy(copy)
        found = again if again.rows > found.rows or not found.tables else found
        if not any(damaged.with_name(damaged.name + ending).is_file() for ending in endings[1:]) or not found.problems:
            break
    return found


def _read_copy(path: Path) -> _Found:
    found = _Found()
    try:
        with closing(sqlite3.connect(path, isolation_level=None)) as source:
            source.execute("PRAGMA writable_schema = ON")  # without it a file that was cut short is not looked into at all
            source.text_factory = lambda data: data.decode("utf-8", errors="replace")
            for table in _TABLES:
                found.columns[table], found.tables[table] = _readable(source, table, found.problems)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        found.why = str(error)
    return found


def _readable(source: sqlite3.Connection, table: str, problems: list[str]) -> tuple[list[str], list[tuple[Any, ...]]]:
    try:
        names = [str(row[1]) for row in source.execute(f"PRAGMA table_info({table})")]
        if not names and table in ("origins", "looks"):  # a file of an earlier version
            return [], []
        lost = _astray(source, table)
        rows = [row for row in _rows(source, table, problems) if row[0] not in lost]
        if lost:
            problems.append(f"{len(lost)} of {table} are not what the index of their table says; left out")
    except (sqlite3.Error, UnicodeDecodeError) as error:
        problems.append(f"table {table} is lost ({error})")
        return [], []
    return names, rows


_INDEXED = {
    "images": ("sha256",),
    "annotations": ("image_id", "study", "rater", "repeat"),
    "journal": ("annotation_id", "number"),
}


def _astray(source: sqlite3.Connection, table: str) -> set[int]:
    """Rows that the table's index knows otherwise: one of the two is damaged, and an answer might be given to another image."""
    if table not in _INDEXED:
        return set()
    same = " AND ".join(f"b.{name} IS a.{name}" for name in ("id", *_INDEXED[table]))
    index = f"sqlite_autoindex_{table}_1"
    query = f"SELECT a.id FROM {table} a NOT INDEXED WHERE NOT EXISTS (SELECT 1 FROM {table} b INDEXED BY {index} WHERE {same})"
    try:
        return {int(row[0]) for row in source.execute(query)}
    except (sqlite3.Error, UnicodeDecodeError):  # no index to ask
        return set()


def _rows(source: sqlite3.Connection, table: str, problems: list[str]) -> Iterator[tuple[Any, ...]]:
    """All rows by row number: where a page is damaged, the numbers on it are stepped over, and named."""
    number, misses, whole = 0, 0, 0
    while number < _MAX_ROW and misses < _MISSES:
        try:
            for row in source.execute(f"SELECT rowid, * FROM {table} WHERE rowid > ? ORDER BY rowid", (number,)):
                if int(row[0]) <= number:  # damaged links between pages can lead in a circle
                    raise sqlite3.DatabaseError("rows out of order")
                number = int(row[0])
                if misses:
                    problems.append(f"{_numbers(whole + 1, number - 1)} of {table} cannot be read")
                misses, whole = 0, number
                yield row[1:]
            break
        except (sqlite3.DatabaseError, UnicodeDecodeError):
            number, misses = number + 1, misses + 1
    if misses:
        problems.append(f"the rows of {table} after number {whole} cannot be read")


def _numbers(first: int, last: int) -> str:
    return f"row {first}" if first == last else f"rows {first} to {last}"
