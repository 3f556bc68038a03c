"""Undo and redo as a journal that only grows, and that is followed again after a restart."""

from __future__ import annotations

import random

from core.annotation.model import Annotation, History, JournalEntry


def step(number: int) -> Annotation:
    return Annotation(((float(number), 0.0),))


def test_undo_goes_back_to_the_beginning_and_redo_to_the_end() -> None:
    history = History()
    for number in range(1, 200):
        history.edit(f"edit {number}", step(number))
    assert history.undo_action == "edit 199"
    while history.undo() is not None:
        pass
    assert history.current == Annotation()
    assert not history.can_undo
    while history.redo() is not None:
        pass
    assert history.current == step(199)


def test_an_edit_after_an_undo_ends_redo_but_the_journal_keeps_what_was_undone() -> None:
    history = History()
    entries = [history.edit("one", step(1)), history.edit("two", step(2)), history.undo(), history.edit("three", step(3))]
    assert not history.can_redo
    assert [entry.number for entry in entries if entry is not None] == [1, 2, 3, 4]
    assert entries[1] is not None
    assert entries[1].content == step(2)
    history.undo()
    assert history.current == step(1)
    history.redo()
    assert history.current == step(3)


def test_what_changes_nothing_is_no_edit() -> None:
    history = History()
    assert history.edit("nothing", Annotation()) is None
    assert history.undo() is None
    assert history.redo() is None


def test_the_journal_brings_everything_back() -> None:
    """Whatever a rater did: a history that follows its journal stands where the first one stands, and undoes the same."""
    rng = random.Random(5)
    for _ in range(60):
        history, journal = History(), []
        for number in range(rng.randrange(1, 40)):
            entry = rng.choice((lambda: history.edit("edit", step(number)), history.undo, history.redo))()  # noqa: B023
            journal += [entry] if entry is not None else []
        again = History(journal)
        assert (again.current, again.can_undo, again.can_redo) == (history.current, history.can_undo, history.can_redo)
        while history.undo() is not None:
            again.undo()
            assert again.current == history.current


def test_a_journal_with_holes_and_nonsense_is_followed_as_far_as_it_goes() -> None:
    history = History()
    first, _, third = history.edit("one", step(1)), history.edit("two", step(2)), history.edit("three", step(3))
    assert first is not None
    assert third is not None
    nonsense = [JournalEntry(4, "undo", 77), JournalEntry(5, "redo", 9), JournalEntry(6, "edit", 6, "loop", step(6)), first]
    again = History([first, third, *nonsense])
    assert again.current == step(3)
    again.undo()
    assert again.current == step(1), "the lost edit is stepped over"
