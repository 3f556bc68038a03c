"""Files of raters who annotated at several computers become one: all of them, or none, and a second time changes nothing.

Each answer comes with all its edits, as its record lies in its file, damage included. What is here stays: an answer that went on at
the other computer goes on here, one that went on differently at both is told and left as it is here.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from core.study.annotation_persons import Persons, raters_alike, whose
from core.study.annotation_records import check_sum
from core.study.annotation_rows import KeptAnnotation, has_table, read_kept
from core.study.annotation_store import DEFAULT_NAME, AnnotationStore
from core.study.annotations import AnnotationError
from core.study.study_plan import StudySettings, settings_from


@dataclass(slots=True)
class Joined:
    """What a join did: answers that came in, that went on, that were here already; raters by file; and what is to be told."""

    new: int = 0
    grown: int = 0
    known: int = 0
    persons: dict[Path, dict[str, str]] = field(default_factory=dict)
    told: list[str] = field(default_factory=list)


def join(target: AnnotationStore, files: Sequence[Path], study: str | None, names: Mapping[str, str]) -> Joined:
    """Take the answers of other annotation files in, one after the other and in one transaction.

    Parameters
    ----------
    target : open for writing.
    files : annotation files, or folders with one; they are only read.
    study : only this one; None: all, and what lies outside studies.
    names : what raters of the files are called here, where their names alone do not tell.

    Raises
    ------
    AnnotationError
        A file is damaged, open in a window, or cannot be read; a study was begun otherwise there; or it is not clear who somebody
        is. Nothing is changed then.
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
                _take(database, theirs, _Ask(path, study, names), joined)
            if database.execute("PRAGMA foreign_key_check").fetchone() is not None:
                raise AnnotationError(f"{target.path}: damaged; annotate --salvage writes what is readable into a new file")
    joined.told += raters_alike(rater for _, rater in target.studies())
    return joined


@dataclass(frozen=True, slots=True)
class _Ask:
    """What is asked of one file: its path for messages, and as in ``join``."""

    where: Path
    study: str | None
    names: Mapping[str, str]


def _take(database: sqlite3.Connection, theirs: sqlite3.Connection, ask: _Ask, joined: Joined) -> None:
    if theirs.execute("PRAGMA foreign_key_check").fetchone() is not None:
        raise AnnotationError(f"{ask.where}: damaged; annotate --salvage writes what is readable into a new file")
    kept, here = read_kept(theirs), read_kept(database)
    persons = whose(kept, here, ask.names, str(ask.where))
    wanted = [one for one in kept if ask.study in (None, one.study)]
    if ask.study is not None and not wanted:
        there = ", ".join(sorted({repr(one.study) if one.study else "'' (outside studies)" for one in kept})) or "nothing"
        raise AnnotationError(f"{ask.where}: has no answer of study {ask.study!r}; in it is {there}")
    if left := len(kept) - len(wanted):
        joined.told.append(f"{ask.where}: {left} answers of other studies stay there; without --study they come along")
    for name in dict.fromkeys(one.study for one in wanted if one.study):
        _take_study(database, theirs, name, ask.where)
    _take_images(database, theirs, {one.sha256 for one in wanted}, ask.where)
    _take_answers(database, theirs, (wanted, here), persons, ask.where, joined)
    if has_table(theirs, "looks"):
        _take_looks(database, theirs, ask.study, persons)
    joined.persons[ask.where] = dict(persons.names)


def _take_study(database: sqlite3.Connection, theirs: sqlite3.Connection, name: str, where: Path) -> None:
    """Its settings; raises AnnotationError when it was begun otherwise: answers to other questions are no repeats."""
    query = "SELECT settings, made_utc FROM studies WHERE name = ?"
    their, own = theirs.execute(query, (name,)).fetchone(), database.execute(query, (name,)).fetchone()
    if their is None:
        return
    if own is None:
        database.execute("INSERT INTO studies (name, settings, made_utc) VALUES (?, ?, ?)", (name, *their))
        return
    there, here = _settings(their[0], f"{where}: study {name!r}"), _settings(own[0], f"study {name!r}")
    if (there.views, there.order, there.seed) != (here.views, here.order, here.seed):
        raise AnnotationError(f"{where}: study {name!r} was begun otherwise there: {_said(there)}; here: {_said(here)}")
    if others := len(set(there.images) ^ set(here.images)):
        raise AnnotationError(f"{where}: study {name!r} was begun with other pictures there: {others} are in one of the two only")


def _settings(text: object, where: str) -> StudySettings:
    """The settings as the file has them; raises AnnotationError."""
    try:
        return settings_from(json.loads(str(text)), where)
    except ValueError:
        raise AnnotationError(f"{where}: the settings of the study are damaged") from None


def _said(settings: StudySettings) -> str:
    shown = ", ".join(view.value for view in settings.views)
    return f"shown {settings.repeats} times ({shown}), order {settings.order.value}, seed {settings.seed}"


def _take_images(database: sqlite3.Connection, theirs: sqlite3.Connection, wanted: set[str], where: Path) -> None:
    sizes = {sha256: (width, height) for sha256, width, height in database.execute("SELECT sha256, width, height FROM images")}
    for sha256, name, width, height in theirs.execute("SELECT sha256, name, width, height FROM images").fetchall():
        if sha256 not in wanted:
            continue
        if sizes.setdefault(sha256, (width, height)) != (width, height):
            raise AnnotationError(f"{where}: {name}: has another size there than here; one of the two files is damaged")
        # The size of no file: it is looked at anew before it is taken for the file of that name here.
        database.execute(
            "INSERT INTO images (sha256, name, width, height, file_size, modified_ns) VALUES (?, ?, ?, ?, -1, 0)"
            " ON CONFLICT (sha256) DO NOTHING",
            (sha256, name, width, height),
        )


def _take_answers(
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


def _take_looks(database: sqlite3.Connection, theirs: sqlite3.Connection, study: str | None, persons: Persons) -> None:
    query = "SELECT i.sha256, l.study, l.rater, l.repeat, l.after FROM looks l JOIN images i ON i.id = l.image_id"
    for sha256, name, rater, repeat, after in theirs.execute(query).fetchall():
        if study is None or name == study:
            database.execute(
                "INSERT INTO looks (image_id, study, rater, repeat, after) SELECT id, ?, ?, ?, ? FROM images WHERE sha256 = ?"
                " ON CONFLICT (image_id, study, rater, repeat) DO UPDATE SET after = min(after, excluded.after)",
                (name, persons.names.get(rater, rater), repeat, after, sha256),
            )
