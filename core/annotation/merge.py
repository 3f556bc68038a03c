"""Annotation files of several computers become one, and what is readable of a damaged one goes into a new file.

Joining takes all files or none, and a second time changes nothing. Each answer comes with all its edits, as its record lies in its
file, damage included. Nothing here is overwritten: an answer that went on at the other computer goes on here, one that went on
differently at both is reported and left as it is here.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from core.annotation.model import AnnotationError
from core.annotation.store import ADD_LOOK, ADDED, DEFAULT_NAME, AnnotationStore, KeptAnnotation, check_sum, read_kept
from core.annotation.study import settings_from


@dataclass(frozen=True, slots=True)
class Persons:
    """``names``: names of raters there -> here. ``declared``: names here that only the operator has matched, no common answer."""

    names: Mapping[str, str]
    declared: frozenset[str]


def identify_raters(
    there: Sequence[KeptAnnotation], here: Sequence[KeptAnnotation], names: Mapping[str, str], where: str
) -> Persons:
    """Who is who, over all studies: a rater whose answers are in both files is one person, whatever the names in the two files.

    `names` is what the operator says (name there -> name here); `where` names the other file in messages. Raises
    AnnotationError: a name is in both files, and nothing tells whether it is one person; or `names` contradicts the answers.
    """
    at: dict[tuple[str, str, int], list[KeptAnnotation]] = {}
    for one in here:
        at.setdefault((one.sha256, one.study, one.repeat), []).append(one)
    seen: dict[str, Counter[str]] = {one.rater: Counter() for one in there}
    for one in there:
        seen[one.rater].update(own.rater for own in at.get((one.sha256, one.study, one.repeat), ()) if own.is_same_as(one))
    taken = {one.rater for one in here}
    found: dict[str, str] = {}
    declared = set()
    for rater, answers in seen.items():
        said = names.get(rater)
        if answers:
            who = rater if rater in answers else answers.most_common(1)[0][0]
            if said not in (None, who):
                shown = f"its rater {rater!r} is {who!r} here, as answers in both files show"
                raise AnnotationError(f"{where}: {shown}; leave --as {rater}={said} out")
            found[rater] = who
        elif said is not None:
            found[rater] = said
            declared.add(said)
        elif rater in taken:
            raise AnnotationError(
                f"{where}: a rater {rater!r} is there and here, and no answer of theirs is in both files: say who it is with "
                f"--as {rater}=NAME (somebody else), or --as {rater}={rater} (the same person)"
            )
        else:
            found[rater] = rater
    return Persons(found, frozenset(declared))


def raters_alike(raters: Iterable[str]) -> list[str]:
    """A line for each group of names that may be one person's, written in different ways."""
    ways: dict[str, set[str]] = {}
    for rater in raters:
        ways.setdefault(" ".join(rater.casefold().split()), set()).add(rater)
    several = [" and ".join(map(repr, sorted(names))) for names in ways.values() if len(names) > 1]
    return [f"raters {names} are taken for different people" for names in several]


@dataclass(slots=True)
class Joined:
    """What a join did: answers that are new, that have more edits, that were here already; raters by file; and messages."""

    new: int = 0
    grown: int = 0
    known: int = 0
    persons: dict[Path, dict[str, str]] = field(default_factory=dict)
    told: list[str] = field(default_factory=list)


def join(target: AnnotationStore, files: Sequence[Path], study: str | None, names: Mapping[str, str]) -> Joined:
    """Take the answers of other annotation files in, one after the other and in one transaction.

    The files, or folders with one, are only read. `study`: only this one; None: all, and what lies outside studies. `names`:
    what raters of the files are called here, where their names alone do not identify them.

    Raises AnnotationError: a file is damaged, open in a window, or cannot be read; a study was begun otherwise there; or it is
    not clear who a rater is. Nothing is changed then.
    """
    paths = [path / DEFAULT_NAME if path.is_dir() else path for path in files]
    for path in paths:
        if path.exists() and path.samefile(target.path):
            raise AnnotationError(f"{path}: cannot be joined with itself")
    joined = Joined()
    with ExitStack() as stack:
        sources = [stack.enter_context(AnnotationStore(path, read_only=True)) for path in paths]
        raters = {rater for source in sources for _, rater in source.studies()}
        for name in names:
            if name not in raters:
                there = ", ".join(sorted(raters)) or "none"
                raise AnnotationError(f"--as {name}=...: no such rater in the files; in them are: {there}")
        opened = [(source.path, stack.enter_context(source.transaction(writing=False))) for source in sources]
        with target.transaction() as database:
            for path, theirs in opened:
                _join_file(database, theirs, path, study, names, joined)
            if database.execute("PRAGMA foreign_key_check").fetchone() is not None:
                raise AnnotationError(f"{target.path}: damaged; annotate --salvage writes what is readable into a new file")
    joined.told += raters_alike(rater for _, rater in target.studies())
    return joined


def _join_file(
    database: sqlite3.Connection,
    theirs: sqlite3.Connection,
    where: Path,
    study: str | None,
    names: Mapping[str, str],
    joined: Joined,
) -> None:
    if theirs.execute("PRAGMA foreign_key_check").fetchone() is not None:
        raise AnnotationError(f"{where}: damaged; annotate --salvage writes what is readable into a new file")
    kept, here = read_kept(theirs), read_kept(database)
    persons = identify_raters(kept, here, names, str(where))
    wanted = [one for one in kept if study in (None, one.study)]
    if study is not None and not wanted:
        there = ", ".join(sorted({repr(one.study) if one.study else "'' (outside studies)" for one in kept})) or "nothing"
        raise AnnotationError(f"{where}: has no answer of study {study!r}; in it is {there}")
    if left := len(kept) - len(wanted):
        joined.told.append(f"{where}: {left} answers of other studies stay there; without --study they come along")
    for name in dict.fromkeys(one.study for one in wanted if one.study):
        _join_study(database, theirs, name, where)
    _join_images(database, theirs, {one.sha256 for one in wanted}, where)
    _join_answers(database, theirs, (wanted, here), persons, where, joined)
    looks = "SELECT l.study, l.rater, l.repeat, l.after, i.sha256 FROM looks l JOIN images i ON i.id = l.image_id"
    for name, rater, *look in theirs.execute(looks).fetchall():
        if study in (None, name):
            database.execute(ADD_LOOK, (name, persons.names.get(rater, rater), *look))
    rows = theirs.execute("SELECT version, commit_id, first_utc FROM programs").fetchall()
    database.executemany("INSERT OR IGNORE INTO programs VALUES (?, ?, ?)", rows)
    joined.persons[where] = dict(persons.names)


def _join_study(database: sqlite3.Connection, theirs: sqlite3.Connection, name: str, where: Path) -> None:
    """Its settings; raises AnnotationError when it was begun otherwise: answers to other questions are no repeats."""
    query = "SELECT settings, made_utc FROM studies WHERE name = ?"
    their, own = theirs.execute(query, (name,)).fetchone(), database.execute(query, (name,)).fetchone()
    if their is None:
        return
    if own is None:
        database.execute("INSERT INTO studies (name, settings, made_utc) VALUES (?, ?, ?)", (name, *their))
        return
    sides = []
    for text, which in ((their[0], f"{where}: study {name!r}"), (own[0], f"study {name!r}")):
        try:
            sides.append(settings_from(json.loads(str(text)), which))
        except ValueError:
            raise AnnotationError(f"{which}: the settings of the study are damaged") from None
    there, here = sides
    if replace(there, images=here.images) != here:
        raise AnnotationError(f"{where}: study {name!r} was begun otherwise there: {there.words}; here: {here.words}")
    if others := len(set(there.images) ^ set(here.images)):
        raise AnnotationError(f"{where}: study {name!r} was begun with other pictures there: {others} are in one of the two only")


def _join_images(database: sqlite3.Connection, theirs: sqlite3.Connection, wanted: set[str], where: Path) -> None:
    sizes = {sha256: (width, height) for sha256, width, height in database.execute("SELECT sha256, width, height FROM images")}
    for sha256, name, width, height in theirs.execute("SELECT sha256, name, width, height FROM images").fetchall():
        if sha256 not in wanted:
            continue
        if sizes.setdefault(sha256, (width, height)) != (width, height):
            raise AnnotationError(f"{where}: {name}: has another size there than here; one of the two files is damaged")
        # The size of no file: the file of that name here is read again before it counts as this image.
        database.execute(
            "INSERT INTO images (sha256, name, width, height, file_size, modified_ns) VALUES (?, ?, ?, ?, -1, 0)"
            " ON CONFLICT (sha256) DO NOTHING",
            (sha256, name, width, height),
        )


def _join_answers(
    database: sqlite3.Connection,
    theirs: sqlite3.Connection,
    there_and_here: tuple[Sequence[KeptAnnotation], Sequence[KeptAnnotation]],
    persons: Persons,
    where: Path,
    joined: Joined,
) -> None:
    wanted, here = there_and_here
    own = {one.key: one for one in here}
    for one in wanted:
        rater = persons.names[one.rater]
        kept = own.get((one.sha256, one.study, rater, one.repeat))
        who = f"{where}: image {one.sha256[:12]}, rater {one.rater}, repeat {one.repeat}"
        if kept is None:
            _insert(database, theirs, one, rater)
            own[one.sha256, one.study, rater, one.repeat] = one
            joined.new += 1
            if check_sum(one.content) != one.check_sum:
                joined.told.append(f"{who}: damaged there; came along as it is")
        elif not kept.is_same_as(one) and rater in persons.declared:
            raise AnnotationError(
                f"{who}: {rater!r} has another answer to this here, and one name cannot have both; give another one with --as"
            )
        elif not kept.agrees_with(one):
            joined.told.append(f"{who}: was answered in two ways here and there; left as it is here")
        elif one.last > kept.last and check_sum(one.content) == one.check_sum:
            _go_on(database, theirs, kept, one)
            joined.grown += 1
        else:
            joined.known += 1


_OWN = ("id", "image_id", "rater")


def _columns(theirs: sqlite3.Connection, table: str, without: Sequence[str]) -> list[str]:
    return [str(row[1]) for row in theirs.execute(f"PRAGMA table_info({table})") if row[1] not in without]


def _insert(database: sqlite3.Connection, theirs: sqlite3.Connection, one: KeptAnnotation, rater: str) -> None:
    """The record as it lies there, with all its edits, under this file's numbers."""
    names = _columns(theirs, "annotations", _OWN)
    values = theirs.execute(f"SELECT {', '.join(names)} FROM annotations WHERE id = ?", (one.row_id,)).fetchone()
    (image_id,) = database.execute("SELECT id FROM images WHERE sha256 = ?", (one.sha256,)).fetchone()
    (row_id,) = database.execute(
        f"INSERT INTO annotations (image_id, rater, {', '.join(names)}) VALUES (?, ?{', ?' * len(names)}) RETURNING id",
        (image_id, rater, *values),
    ).fetchone()
    _add_edits(database, theirs, one, row_id, after=0)
    if one.origin is not None:
        database.execute("INSERT INTO origins (annotation_id, origin) VALUES (?, ?)", (row_id, one.origin))


def _go_on(database: sqlite3.Connection, theirs: sqlite3.Connection, kept: KeptAnnotation, one: KeptAnnotation) -> None:
    """The same answer, some edits later."""
    names = _columns(theirs, "annotations", (*_OWN, "study", "repeat", "begun_utc"))
    values = theirs.execute(f"SELECT {', '.join(names)} FROM annotations WHERE id = ?", (one.row_id,)).fetchone()
    database.execute(f"UPDATE annotations SET {', '.join(f'{name} = ?' for name in names)} WHERE id = ?", (*values, kept.row_id))
    _add_edits(database, theirs, one, kept.row_id, after=kept.last)


def _add_edits(database: sqlite3.Connection, theirs: sqlite3.Connection, one: KeptAnnotation, row_id: int, after: int) -> None:
    names = _columns(theirs, "journal", ("id", "annotation_id"))
    rows = theirs.execute(
        f"SELECT {', '.join(names)} FROM journal WHERE annotation_id = ? AND number > ? ORDER BY number", (one.row_id, after)
    )
    database.executemany(
        f"INSERT INTO journal (annotation_id, {', '.join(names)}) VALUES (?{', ?' * len(names)})",
        [(row_id, *row) for row in rows.fetchall()],
    )


_MAX_ROW = 1_000_000
_MISSES = 2_000  # after so many row numbers on end that cannot be read, nothing more is expected
_TABLES = ("images", "studies", "annotations", "journal", "origins", "looks", "programs")


def salvage(damaged: Path, target: Path) -> tuple[int, list[str]]:
    """Copy all rows that can be read; returns how many annotations there are, and a line for each table or record that is lost.

    Raises AnnotationError: nothing can be read, or the new file is there already or cannot be written.
    """
    if not damaged.is_file():
        raise AnnotationError(f"{damaged}: no such annotation file")
    if target.exists():
        raise AnnotationError(f"{target}: is there already; choose another --out")
    found = _read(damaged)
    if not found.rows:
        raise AnnotationError(f"{damaged}: nothing in it can be read{f' ({found.why})' if found.why else ''}")
    with AnnotationStore(target) as store:
        store.insert_rows(found.columns, found.tables, found.problems)
    with AnnotationStore(target, read_only=True) as store:
        kept = len(store.annotations())
        return kept, found.problems + store.problems


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
    """Read copies of a file, in which SQLite rolls back what a crash has left half done, by the journal.

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
            source.execute("PRAGMA writable_schema = ON")  # without it SQLite refuses a file that was cut short
            source.text_factory = lambda data: data.decode("utf-8", errors="replace")
            for table in _TABLES:
                found.columns[table], found.tables[table] = _readable(source, table, found.problems)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        found.why = str(error)
    return found


def _readable(source: sqlite3.Connection, table: str, problems: list[str]) -> tuple[list[str], list[tuple[Any, ...]]]:
    try:
        names = [str(row[1]) for row in source.execute(f"PRAGMA table_info({table})")]
        if not names and table in ADDED:  # a file of an earlier version
            return [], []
        lost = _astray(source, table)
        rows = [row for row in _rows(source, table, problems) if row[0] not in lost]
        if lost:
            problems.append(f"{len(lost)} of {table} are not what the index of their table says; left out")
    except (sqlite3.Error, UnicodeDecodeError) as error:
        problems.append(f"table {table} is lost ({error})")
        return [], []
    return names, rows


_INDEXED = {"images": ("sha256",), "annotations": ("image_id", "study", "rater", "repeat"), "journal": ("annotation_id", "number")}


def _astray(source: sqlite3.Connection, table: str) -> set[int]:
    """Rows that differ from the table's index: one of the two is damaged, and an answer might be assigned to another image."""
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
                    first, last = whole + 1, number - 1
                    rows = f"row {first}" if first == last else f"rows {first} to {last}"
                    problems.append(f"{rows} of {table} cannot be read")
                misses, whole = 0, number
                yield row[1:]
            break
        except (sqlite3.DatabaseError, UnicodeDecodeError):
            number, misses = number + 1, misses + 1
    if misses:
        problems.append(f"the rows of {table} after number {whole} cannot be read")
