"""Raters' files joined: nothing is lost, no rater is taken for another one, all or nothing, and twice is once."""

import os
import shutil
import signal
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from core.annotation import merge
from core.annotation import store as annotation_store
from core.annotation.agreement_report import agreement_report
from core.annotation.merge import Joined, join, salvage
from core.annotation.model import Annotation, AnnotationError, ImageView, MaskPolygon, MaskTarget, measure_lines
from core.annotation.store import AnnotationStore, ImageRecord, ItemKey
from core.annotation.study import StudySettings
from core.config.models import PerceptionConfig
from core.types import PoseState

SHAS = [f"{k:02d}" * 32 for k in range(4)]
SETTINGS = StudySettings(tuple(SHAS), (ImageView.AS_IS, ImageView.MIRRORED))
MASK = MaskPolygon(MaskTarget.ROBOT, ((10.0, 10.0), (40.0, 10.0), (40.0, 20.0)))


def drawn(bent_px: float, state: PoseState = PoseState.B) -> Annotation:
    return Annotation(((220.0, 180.0), (300.0, 200.0 + bent_px)), ((200.0, 215.0), (400.0, 205.0)), state)


def answer(store: AnnotationStore, key: ItemKey, *contents: Annotation) -> None:
    history = store.history(key)
    for content in contents:
        entry = history.edit("draw", content)
        store.save(key, ImageView.AS_IS, entry, content, measure_lines(content, (640, 480), PerceptionConfig()), 5.0)


@pytest.fixture
def begin(tmp_path: Path):
    """A file of a rater who has answered the four images of the study "angles", bent by so much."""

    def make(name: str, rater: str, bent_px: float, study: str = "angles", shift: int = 0) -> Path:
        path = tmp_path / f"{name}.sqlite"
        with AnnotationStore(path) as store:
            for k in range(4):  # in another order at each computer: its numbers are its own
                place = (k + shift) % 4
                store.add_image(ImageRecord(SHAS[place], f"{name}/{place}.png", 640, 480), 1000, 5)
            if study:
                store.begin_study(study, SETTINGS.to_json())
            for k, sha256 in enumerate(SHAS):
                answer(store, ItemKey(sha256, study, rater), drawn(0.0), drawn(bent_px + k))
        return path

    return make


def joined(target: Path, *files: Path, study: str | None = None, **names: str) -> Joined:
    with AnnotationStore(target) as store:
        return join(store, files, study, names)


def dump(path: Path) -> list[str]:
    with closing(sqlite3.connect(path)) as database:
        return list(database.iterdump())


def answers(path: Path) -> dict[tuple[str, str, str], Annotation]:
    with AnnotationStore(path, read_only=True) as store:
        found = {(one.key.study, one.key.rater, one.key.sha256): one.content for one in store.annotations()}
        assert store.problems == []
    return found


def test_two_raters_files_are_one_study(begin) -> None:
    anna, ben = begin("a", "anna", 3.0), begin("b", "ben", 5.0, shift=2)
    before = answers(ben)
    found = joined(anna, ben)
    assert (found.new, found.grown, found.known, found.told) == (4, 0, 0, [])
    assert before.items() <= answers(anna).items(), "each answer is with its own image"
    with AnnotationStore(anna, read_only=True) as store:
        report = agreement_report(store.annotations("angles"), {})
    assert report["between"]["n"] == 4
    assert answers(ben) == before, "the other file is only read"


def test_the_same_join_twice_changes_nothing(begin) -> None:
    anna, ben, cleo = begin("a", "anna", 3.0), begin("b", "user", 5.0), begin("c", "cleo", 1.0)
    joined(anna, ben, cleo, user="ben")
    once = dump(anna)
    for again in (joined(anna, ben, cleo, user="ben"), joined(anna, ben, cleo)):
        assert (again.new, again.grown, again.known) == (0, 0, 8)
        assert again.persons[ben] == {"user": "ben"}, "his answers tell who he is, without being told again"
    assert dump(anna) == once


def test_two_raters_of_one_name_are_not_one(begin) -> None:
    here, there = begin("a", "user", 3.0), begin("b", "user", 5.0)
    once = dump(here)
    with pytest.raises(AnnotationError, match=r"b\.sqlite: a rater 'user' is there and here.* --as user=NAME \(somebody else\)"):
        joined(here, there)
    with pytest.raises(AnnotationError, match=r"'user' has another answer to this here, and one name cannot have both"):
        joined(here, there, user="user")
    assert dump(here) == once
    joined(here, there, user="ben")
    found = answers(here)
    assert found["angles", "user", SHAS[0]] == drawn(3.0)
    assert found["angles", "ben", SHAS[0]] == drawn(5.0)
    with pytest.raises(AnnotationError, match=r"'user' is 'ben' here, as answers in both files show; leave --as user=eva out"):
        joined(here, there, user="eva")
    with pytest.raises(AnnotationError, match=r"--as otto=\.\.\.: no such rater in the files; in them are: user"):
        joined(here, there, otto="eva")


def test_three_computers_whose_raters_are_all_called_alike(begin) -> None:
    """In one call the second and third file would both be "ben": their answers to one image tell that they are two."""
    here, second, third = (begin(name, "user", bent) for name, bent in (("a", 1.0), ("b", 2.0), ("c", 3.0)))
    once = dump(here)
    with pytest.raises(AnnotationError, match=r"c\.sqlite: image .*: 'ben' has another answer to this here"):
        joined(here, second, third, user="ben")
    assert dump(here) == once, "all or nothing"
    joined(here, second, user="ben")
    joined(here, third, user="cleo")
    assert {rater for _, rater, _ in answers(here)} == {"user", "ben", "cleo"}


def test_who_somebody_is_holds_for_all_studies(begin) -> None:
    """Ben is known by his answers in one study; what he says in another one is his, too, and none of the user's here."""
    here, there = begin("a", "user", 1.0), begin("b", "user", 2.0)
    joined(here, there, study="angles", user="ben")
    with AnnotationStore(there) as store:
        answer(store, ItemKey(SHAS[0], "", "user"), drawn(8.0))
    assert joined(here, there).new == 1
    assert answers(here)["", "ben", SHAS[0]] == drawn(8.0)


def test_of_a_copy_that_went_on_the_new_edits_come(begin, tmp_path: Path) -> None:
    here, copy = begin("a", "anna", 1.0), tmp_path / "copy.sqlite"
    shutil.copyfile(here, copy)
    keys = [ItemKey(sha256, "angles", "anna") for sha256 in SHAS]
    with AnnotationStore(copy) as store:
        answer(store, keys[0], drawn(20.0))
        answer(store, keys[1], drawn(21.0))
    with AnnotationStore(here) as store:
        answer(store, keys[1], drawn(30.0))
        answer(store, keys[2], drawn(31.0))
    found = joined(here, copy)
    assert (found.new, found.grown, found.known) == (0, 1, 2)
    (line,) = found.told
    assert "rater anna, repeat 1: was answered in two ways here and there; left as it is here" in line
    assert [answers(here)["angles", "anna", sha256] for sha256 in SHAS[:3]] == [drawn(20.0), drawn(30.0), drawn(31.0)]
    with AnnotationStore(here) as store:
        history = store.history(keys[0])
        history.undo()
        assert history.current == drawn(1.0)


def test_two_who_begin_in_one_millisecond_with_the_same_words_are_two(begin, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(annotation_store, "_now", lambda: "2026-03-01T10:00:00.000+00:00")
    here, there = begin("a", "user", 3.0), begin("b", "user", 3.0)
    with pytest.raises(AnnotationError, match="a rater 'user' is there and here"):
        joined(here, there)
    for path, state in ((here, PoseState.C), (there, PoseState.D)):  # as an older version wrote it: no origins
        with closing(sqlite3.connect(path)) as database, database:
            database.execute("DROP TABLE origins")
        with AnnotationStore(path) as store:
            answer(store, ItemKey(SHAS[0], "", "user"), drawn(0.0, state))
        with closing(sqlite3.connect(path)) as database, database:
            database.execute("DELETE FROM annotations WHERE study <> ''")
            database.execute("DELETE FROM journal WHERE annotation_id NOT IN (SELECT id FROM annotations)")
            database.execute("DROP TABLE origins")
    with pytest.raises(AnnotationError, match="a rater 'user' is there and here"):
        joined(here, there)


def test_files_of_an_earlier_version_know_their_copies_by_their_edits(begin, tmp_path: Path) -> None:
    here, copy = begin("a", "anna", 1.0), tmp_path / "copy.sqlite"
    with closing(sqlite3.connect(here)) as database, database:
        database.execute("DROP TABLE origins")
        database.execute("DROP TABLE looks")
    shutil.copyfile(here, copy)
    with AnnotationStore(copy) as store:
        answer(store, ItemKey(SHAS[0], "", "anna"), drawn(8.0))
    assert (joined(here, copy).new, len(answers(here))) == (1, 5)


def test_damaged_records_come_along_as_their_raters_own(begin) -> None:
    here, there = begin("a", "user", 1.0), begin("b", "user", 2.0)
    joined(here, there, user="ben")
    with AnnotationStore(there) as store:
        answer(store, ItemKey(SHAS[0], "", "user"), drawn(8.0))
        answer(store, ItemKey(SHAS[1], "", "user"), drawn(9.0))
    with closing(sqlite3.connect(there)) as database, database:
        database.execute("UPDATE annotations SET content = replace(content, '220', '221') WHERE study = ''")
        database.execute("UPDATE journal SET content = replace(content, '220', '221') WHERE number = 1")
    found = joined(here, there)
    assert (found.new, len(found.told)) == (2, 2)
    assert found.told[0].endswith("rater user, repeat 1: damaged there; came along as it is")
    with AnnotationStore(here) as store:
        assert store.studies() == [("", "ben"), ("angles", "ben"), ("angles", "user")]
        store.annotations()
        assert len([line for line in store.problems if "rater ben" in line]) == 2


def test_a_flipped_bit_gives_no_answer_to_another_image(begin, tmp_path: Path) -> None:
    here, there = begin("a", "anna", 1.0), begin("b", "ben", 2.0)
    data = there.read_bytes()
    record = b"\x02angles" + b"ben" + b"as is"  # image 2, study, rater, view: so it lies in the table, and otherwise in its index
    assert data.count(record) == 1
    there.write_bytes(data.replace(record, b"\x03" + record[1:]))
    once = dump(here)
    with pytest.raises(AnnotationError, match=r"b\.sqlite: damaged; annotate --salvage writes what is readable"):
        joined(here, there)
    assert dump(here) == once
    kept, problems = salvage(there, tmp_path / "saved.sqlite")
    assert kept == 3
    assert "1 of annotations are not what the index of their table says; left out" in problems
    joined(here, tmp_path / "saved.sqlite")
    found = answers(here)
    assert [k for k, sha256 in enumerate(SHAS) if found.get(("angles", "ben", sha256)) == drawn(2.0 + k)] == [0, 2, 3]


def test_a_file_that_is_open_in_a_window_is_named(begin) -> None:
    here, there = begin("a", "anna", 1.0), begin("b", "ben", 2.0)
    once = dump(here)
    with AnnotationStore(there), pytest.raises(AnnotationError, match=r"b\.sqlite: is open in another window"):
        joined(here, there)
    with pytest.raises(AnnotationError, match=r"a\.sqlite: cannot be joined with itself"):
        joined(here, here)
    assert dump(here) == once


def test_a_killed_join_leaves_the_file_as_it_was(begin, monkeypatch: pytest.MonkeyPatch) -> None:
    here, there, third = begin("a", "anna", 1.0), begin("b", "ben", 2.0), begin("c", "cleo", 3.0)
    once, whole = dump(here), merge._join_file

    def join_file(*arguments) -> None:
        whole(*arguments)
        arguments[0].execute("PRAGMA cache_spill = 1")
        if arguments[2] == third:
            os.kill(os.getpid(), signal.SIGKILL)

    monkeypatch.setattr(merge, "_join_file", join_file)
    child = os.fork()
    if child == 0:
        joined(here, there, third)
        os._exit(0)
    assert os.WIFSIGNALED(os.waitpid(child, 0)[1])
    monkeypatch.undo()
    assert dump(here) == once
    assert joined(here, there, third).new == 8


def test_a_study_that_was_begun_otherwise_is_not_joined(begin) -> None:
    here, there, other = begin("a", "anna", 1.0), begin("b", "ben", 2.0), begin("c", "cleo", 3.0)
    for path, settings in ((there, StudySettings(tuple(SHAS), seed=4)), (other, StudySettings(tuple(SHAS[:3]), SETTINGS.views))):
        with closing(sqlite3.connect(path)) as database, database:
            database.execute("DELETE FROM studies")
        with AnnotationStore(path) as store:
            store.begin_study("angles", settings.to_json())
    with pytest.raises(AnnotationError, match=r"'angles' was begun otherwise there: shown 1 times \(as is\), .* seed 4, .*; here"):
        joined(here, there)
    with pytest.raises(AnnotationError, match="was begun with other pictures there: 1 are in one of the two only"):
        joined(here, other)
    assert len(answers(here)) == 4


def test_one_study_of_a_file_alone(begin) -> None:
    here, there = begin("a", "anna", 1.0), begin("b", "ben", 2.0)
    with AnnotationStore(there) as store:
        answer(store, ItemKey(SHAS[0], "", "ben"), Annotation(masks=(MASK,)))
    with pytest.raises(AnnotationError, match=r"has no answer of study 'other'; in it is '' \(outside studies\), 'angles'"):
        joined(here, there, study="other")
    found = joined(here, there, study="angles")
    assert (found.new, len(found.told)) == (4, 1)
    assert "1 answers of other studies stay there; without --study they come along" in found.told[0]
    assert joined(here, there).new == 1
    assert answers(here)["", "ben", SHAS[0]].masks == (MASK,), "masks come along, too"


def test_pictures_of_one_name_that_differ_are_two(tmp_path: Path) -> None:
    """The name and time of a picture at the other computer do not stand for the one that is called so here."""
    here, there = tmp_path / "a.sqlite", tmp_path / "b.sqlite"
    with AnnotationStore(here):
        pass
    with AnnotationStore(there) as store:
        store.add_image(ImageRecord(SHAS[0], "0.png", 640, 480), 1000, 5)
        answer(store, ItemKey(SHAS[0], "", "ben"), drawn(1.0))
    joined(here, there)
    with AnnotationStore(here) as store:
        assert store.images()[SHAS[0]].name == "0.png"
        assert store.image_as_last_seen("0.png", 1000, 5) is None
