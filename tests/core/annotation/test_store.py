"""The annotation file: what was saved is there, whatever happens; damage is named; nothing is overwritten."""

import os
import random
import shutil
import signal
import sqlite3
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from core.annotation.merge import salvage
from core.annotation.model import Annotation, AnnotationError, History, ImageView, measure_lines
from core.annotation.store import AnnotationStore, ImageRecord, ItemKey, find_images
from core.config.models import PerceptionConfig
from core.devices import UserError
from core.learning.dataset import write_png
from core.types import PoseState

SHA = "ab" * 32
KEY = ItemKey(SHA, "", "ann")
DRAWN = Annotation(((220.0, 180.0), (300.0, 200.0)), ((200.0, 215.0), (400.0, 205.0)), PoseState.B, note="clear")


def known(path: Path) -> AnnotationStore:
    store = AnnotationStore(path)
    store.add_image(ImageRecord(SHA, "a.png", 640, 480), 1000, 5)
    return store


def save(store: AnnotationStore, history: History, content: Annotation, key: ItemKey = KEY, spent_s: float = 1.0) -> None:
    entry = history.edit("edit", content)
    store.save(key, ImageView.AS_IS, entry, content, measure_lines(content, (640, 480), PerceptionConfig()), spent_s)


def test_what_was_saved_is_there_with_its_measures_and_its_edits(tmp_path: Path) -> None:
    path = tmp_path / "a.sqlite"
    with known(path) as store:
        history = History()
        save(store, history, Annotation(DRAWN.robot))
        save(store, history, DRAWN, spent_s=12.5)
        store.save_time(KEY, 14.0)
    with AnnotationStore(path) as store:
        (one,) = store.annotations()
        assert (one.key, one.content, one.view, one.time_spent_s) == (KEY, DRAWN, ImageView.AS_IS, 14.0)
        pose = measure_lines(DRAWN, (640, 480), PerceptionConfig()).pose
        assert (one.theta_deg, one.d_head_px, one.d_tail_px) == (pose.theta_deg, pose.d_head_px, pose.d_tail_px)
        assert one.crossed is False
        again = store.history(KEY)
        again.undo()
        assert again.current == Annotation(DRAWN.robot), "undo survives"
        assert store.problems == []


def test_raters_studies_and_repeats_are_kept_apart(tmp_path: Path) -> None:
    keys = [KEY, ItemKey(SHA, "", "bob"), ItemKey(SHA, "pilot", "ann", 1), ItemKey(SHA, "pilot", "ann", 2)]
    with known(tmp_path / "a.sqlite") as store:
        for place, key in enumerate(keys):
            save(store, History(), Annotation(note=str(place)), key)
        assert {one.key: one.content.note for one in store.annotations()} == {key: str(k) for k, key in enumerate(keys)}
        assert [one.key for one in store.annotations("pilot", "ann")] == keys[2:]
        assert store.studies() == [("", "ann"), ("", "bob"), ("pilot", "ann")]


def test_answers_that_were_given_after_a_look_at_the_algorithms_are_known(tmp_path: Path) -> None:
    """Not those that were complete before it, nor those of raters who never looked."""
    before, after, never, again = (ItemKey(SHA, "", rater) for rater in ("ann", "bob", "eve", "kim"))
    with known(tmp_path / "a.sqlite") as store:
        assert store.given_after_look() == set()
        done = History()
        save(store, done, DRAWN, before)
        store.keep_look(before, done.last)
        store.keep_look(after, 0)
        save(store, History(), DRAWN, after)
        save(store, History(), DRAWN, never)
        changed = History()
        save(store, changed, DRAWN, again)
        store.keep_look(again, changed.last)
        save(store, changed, Annotation(DRAWN.robot, DRAWN.vessel, PoseState.C), again)
        store.keep_look(again, changed.last)
        assert store.given_after_look() == {after, again}, "the first look counts"
    with AnnotationStore(tmp_path / "a.sqlite", read_only=True) as store:
        assert store.given_after_look() == {after, again}


def test_a_second_window_is_told_and_the_file_is_free_after_closing(tmp_path: Path) -> None:
    path = tmp_path / "a.sqlite"
    with known(path):
        for read_only in (False, True):
            with pytest.raises(AnnotationError, match=r"a\.sqlite: is open in another window"):
                AnnotationStore(path, read_only=read_only)
    AnnotationStore(path).close()


def test_files_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    text, foreign, newer, empty = (tmp_path / name for name in ("text.sqlite", "foreign.sqlite", "newer.sqlite", "empty.sqlite"))
    text.write_text("no database at all, but long enough to have a header of a hundred bytes" * 3)
    with sqlite3.connect(foreign) as database:
        database.execute("CREATE TABLE songs (title TEXT)")
    database.close()
    known(newer).close()
    with sqlite3.connect(newer) as database:
        database.execute("PRAGMA user_version = 9")
    database.close()
    empty.touch()
    before = {path: path.read_bytes() for path in (text, foreign, newer)}
    for path, message in (
        (text, "not an annotation file"),
        (foreign, "a database, but not of annotations"),
        (newer, r"written by a newer version \(format 9, this one reads up to 1\); update LumenPilot"),
        (tmp_path, "is a folder"),
        (tmp_path / "none" / "a.sqlite", "no such folder"),
    ):
        with pytest.raises(AnnotationError, match=message):
            AnnotationStore(path)
    assert {path: path.read_bytes() for path in before} == before, "nothing was written over"
    for path, message in ((empty, "empty; annotate the images first"), (tmp_path / "b.sqlite", "no such annotation file")):
        with pytest.raises(AnnotationError, match=message):
            AnnotationStore(path, read_only=True)
    AnnotationStore(empty).close()  # an empty file is a new one


def test_a_full_disk_raises_and_keeps_what_was_saved(tmp_path: Path) -> None:
    path = tmp_path / "a.sqlite"
    with known(path) as store:
        history = History()
        save(store, history, DRAWN)
        (pages,) = store._database.execute("PRAGMA page_count").fetchone()
        store._database.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(AnnotationError, match="the disk is full; free some space"):
            save(store, history, Annotation(note="x" * 100_000))
    with AnnotationStore(path) as store:
        assert store.annotations()[0].content == DRAWN


def test_a_flipped_bit_in_a_record_is_found_and_the_others_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.sqlite"
    with known(path) as store:
        save(store, History(), Annotation(note="first record"))
        save(store, History(), Annotation(note="second record"), ItemKey(SHA, "", "bob"))
    data = path.read_bytes()
    path.write_bytes(data.replace(b"first record", b"firsu record"))
    with AnnotationStore(path) as store:
        assert [one.content.note for one in store.annotations()] == ["second record"]
        assert store.history(KEY).current == Annotation()
        assert "rater ann, repeat 1: damaged (its check sum does not fit); left out" in store.problems[0]


def test_a_study_keeps_its_settings(tmp_path: Path) -> None:
    with known(tmp_path / "a.sqlite") as store:
        assert store.study_settings("pilot") is None
        store.begin_study("pilot", {"seed": 3})
        assert store.study_settings("pilot") == {"seed": 3}
        store._database.execute("UPDATE studies SET settings = 'x'")
        with pytest.raises(AnnotationError, match="settings of study 'pilot' are damaged"):
            store.study_settings("pilot")


def test_a_renamed_image_finds_its_annotations_and_a_changed_one_is_another(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    first = tmp_path / "first.png"
    write_png(first, picture)
    with AnnotationStore(tmp_path / "a.sqlite") as store:
        (found,), problems = find_images([first], store)
        assert (found.record.size, problems) == ((64, 48), [])
        save(store, History(), DRAWN, ItemKey(found.sha256, "", "ann"))
        renamed = first.rename(tmp_path / "renamed.png")
        (again,), _ = find_images([renamed], store)
        assert (again.sha256, again.record.name) == (found.sha256, "renamed.png")
        write_png(renamed, 255 - picture)
        (other,), _ = find_images([renamed], store)
        assert other.sha256 != found.sha256
        copy = tmp_path / "copy.png"
        copy.write_bytes(renamed.read_bytes())
        (tmp_path / "cut.png").write_bytes(renamed.read_bytes()[:200])
        images, problems = find_images([renamed, copy, tmp_path / "cut.png", tmp_path / "gone.png"], store)
        assert len(images) == 1
        assert [line.rpartition("/")[2] for line in problems] == [
            "copy.png: the same picture as renamed.png; shown once",
            "cut.png: cut short (the end of the file is missing)",
            "gone.png: cannot be read (No such file or directory)",
        ]


def _save_until_killed(path: Path, out: int, first: int) -> None:
    with AnnotationStore(path) as store:
        history = store.history(KEY)
        for number in range(first, first + 10_000):
            save(store, history, Annotation(((float(number), 0.0),)))
            os.write(out, f"{number}\n".encode())


def test_kill_9_loses_nothing_that_was_saved(tmp_path: Path) -> None:
    """A process that tells each save is killed at random moments; the file has every edit that was told, and at most one more."""
    path = tmp_path / "a.sqlite"
    known(path).close()
    rng = random.Random(1)
    told = 0
    kills = int(os.environ.get("LUMENPILOT_KILLS", "8"))
    for _ in range(kills):
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            try:
                _save_until_killed(path, writing, told + 1)
            finally:
                os._exit(1)
        os.close(writing)
        first = os.read(reading, 1)
        time.sleep(rng.uniform(0.0, 0.05))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        with os.fdopen(reading, "rb") as pipe:
            lines = (first + pipe.read()).decode().split("\n")[:-1]
        told = int(lines[-1]) if lines else told
        with AnnotationStore(path, read_only=rng.random() < 0.5) as store:
            (one,) = store.annotations()
            kept = int(one.content.robot[0][0])
            assert told <= kept <= told + 1
            assert store.history(KEY).current == one.content
            assert store._database.execute("SELECT count(*), max(number) FROM journal").fetchone() == (kept, kept)
            told = kept
    assert told >= kills


def _damaged(data: bytes, rng: random.Random) -> bytes:
    kind = rng.randrange(3)
    place = rng.randrange(len(data))
    if kind == 0:
        return data[:place]
    if kind == 1:
        length = rng.choice((1, 16, 512))
        return data[:place] + bytes(length) + data[place + length :]
    flipped = bytearray(data)
    for _ in range(rng.choice((1, 1, 20))):
        flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(flipped)


def test_damaged_files_end_in_one_line_and_salvage_reads_what_is_readable(tmp_path: Path) -> None:
    """Cut, zeroed and bit-flipped files: read, or refused by one line; never another error. Most rows come back by salvage."""
    whole = tmp_path / "whole.sqlite"
    with known(whole) as store:
        for number in range(40):
            save(store, History(), Annotation(note=f"note {number}"), ItemKey(SHA, "", f"rater {number}"))
    data, rng = whole.read_bytes(), random.Random(2)
    refused = salvaged = 0
    for case in range(int(os.environ.get("LUMENPILOT_FUZZ", "20"))):
        path, target = tmp_path / "damaged.sqlite", tmp_path / f"salvaged_{case}.sqlite"
        path.write_bytes(_damaged(data, rng))
        before = path.read_bytes()
        try:
            with AnnotationStore(path, read_only=True) as store:
                for one in store.annotations():
                    store.history(one.key)
        except UserError as error:
            assert "\n" not in str(error)
            refused += 1
        try:
            salvaged += salvage(path, target)[0]
        except UserError as error:
            assert "\n" not in str(error)
        target.unlink(missing_ok=True)
        assert path.read_bytes() == before, "the damaged file is as it was"
    assert refused > 2
    assert salvaged > 40 * 7


_PAGE = 4096
_TABLE_LEAF = 0x0D


def _pages_with(data: bytes, *words: bytes) -> list[int]:
    """Offsets of those pages with rows that hold all the words."""
    starts = range(0, len(data), _PAGE)
    return [at for at in starts if data[at] == _TABLE_LEAF and all(word in data[at : at + _PAGE] for word in words)]


def _without_page(data: bytes, at: int) -> bytes:
    return data[:at] + b"\xff" * _PAGE + data[at + _PAGE :]


@pytest.fixture(scope="module")
def sixty(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """An annotation file of sixty images, each annotated."""
    path = tmp_path_factory.mktemp("sixty") / "a.sqlite"
    with AnnotationStore(path) as store:
        store._database.execute("PRAGMA synchronous = OFF")
        for number in range(60):
            key = ItemKey(f"{number:064x}", "", "ann")
            store.add_image(ImageRecord(key.sha256, f"{number}.png", 640, 480), 1000, 5)
            save(store, History(), Annotation(tuple((float(x), 50.5) for x in range(40)), note=f"note {number}"), key)
    return path.read_bytes()


def test_an_image_that_is_lost_takes_its_annotation_with_it(sixty: bytes, tmp_path: Path) -> None:
    """Otherwise its number, and with it the annotation, would go to the next image that is added."""
    page = _pages_with(sixty, b"59.png")[-1]
    (tmp_path / "damaged.sqlite").write_bytes(_without_page(sixty, page))
    kept, problems = salvage(tmp_path / "damaged.sqlite", tmp_path / "b.sqlite")
    assert 0 < kept < 60
    lost = 60 - kept
    assert problems == [
        f"the rows of images after number {kept} cannot be read",
        f"{lost} of images are lost, and with them {lost} of annotations",
        f"{lost} of annotations are lost, and with them {lost} of journal",
    ]
    with AnnotationStore(tmp_path / "b.sqlite") as store:
        assert {one.key.sha256 for one in store.annotations()} == set(store.images())
        new = ItemKey("f" * 64, "", "ann")
        store.add_image(ImageRecord(new.sha256, "new.png", 640, 480), 1, 1)
        assert len(store.annotations()) == kept
        assert not store.history(new).can_undo


def test_what_a_crash_has_left_half_done_is_taken_back_before_salvage(sixty: bytes, tmp_path: Path) -> None:
    """A journal lies beside the file then, and without it the file cannot be read at all."""
    path, damaged = tmp_path / "a.sqlite", tmp_path / "damaged.sqlite"
    path.write_bytes(sixty)
    with closing(sqlite3.connect(path, isolation_level=None)) as database:
        database.execute("PRAGMA cache_size = 1")
        database.execute("BEGIN")
        database.execute("UPDATE images SET name = name || hex(zeroblob(3000))")
        for ending in ("", "-journal"):
            shutil.copyfile(f"{path}{ending}", f"{damaged}{ending}")
        database.execute("ROLLBACK")
    before = {file.name: file.read_bytes() for file in tmp_path.glob("damaged.sqlite*")}
    assert len(before) == 2
    assert salvage(damaged, tmp_path / "b.sqlite") == (60, [])
    assert {file.name: file.read_bytes() for file in tmp_path.glob("damaged.sqlite*")} == before
