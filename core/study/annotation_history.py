"""Undo without limit as a journal: every edit, undo and redo is an entry, and none is ever taken away."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from core.study.annotations import Annotation

Kind = Literal["edit", "undo", "redo"]


@dataclass(frozen=True, slots=True)
class JournalEntry:
    """One entry. ``number`` counts from 1 per annotation; 0 is the empty annotation before all edits.

    For an edit ``base`` is the edit that it was made on and ``content`` what it led to; for undo and redo ``base`` is the edit
    (or 0) that is in force again, and there is no content.
    """

    number: int
    kind: Kind
    base: int
    action: str = ""
    content: Annotation | None = None


class History:
    """The edits of one annotation: what is in force, and what undo and redo lead to.

    A new edit after an undo starts a branch: redo no longer leads to what was undone, but its entries stay in the journal.

    Parameters
    ----------
    entries : the journal, in order.
    last : the highest number that is taken, also by an entry that is not among these because its record is damaged.
    """

    def __init__(self, entries: Iterable[JournalEntry] = (), *, last: int = 0) -> None:
        self._contents: dict[int, Annotation] = {0: Annotation()}
        self._actions: dict[int, str] = {0: ""}
        self._bases: dict[int, int] = {}
        self._now = self._tip = 0
        self._last = last
        for entry in entries:
            self._take(entry)

    @property
    def current(self) -> Annotation:
        return self._contents[self._now]

    @property
    def last(self) -> int:
        """The newest entry's number, 0 before the first."""
        return self._last

    @property
    def can_undo(self) -> bool:
        return self._now != 0

    @property
    def can_redo(self) -> bool:
        return self._now != self._tip

    @property
    def undo_action(self) -> str:
        """What undo takes back, in words; "" for nothing."""
        return self._actions[self._now]

    def edit(self, action: str, content: Annotation) -> JournalEntry | None:
        """Put `content` in force; None when it changes nothing."""
        if content == self.current:
            return None
        return self._taken(JournalEntry(self._last + 1, "edit", self._now, action, content))

    def renewed(self, action: str) -> JournalEntry | None:
        """What is in force once more, because its record was lost; None where nothing was ever said."""
        if self.current == Annotation():
            return None
        return self._taken(JournalEntry(self._last + 1, "edit", self._now, action, self.current))

    def undo(self) -> JournalEntry | None:
        """Back to before the last edit; None when there is none."""
        if not self.can_undo:
            return None
        return self._taken(JournalEntry(self._last + 1, "undo", self._bases[self._now], self._actions[self._now]))

    def redo(self) -> JournalEntry | None:
        """Forward again; None when nothing was undone."""
        if not self.can_redo:
            return None
        step = self._tip
        while self._bases[step] != self._now:
            step = self._bases[step]
        return self._taken(JournalEntry(self._last + 1, "redo", step, self._actions[step]))

    def _taken(self, entry: JournalEntry) -> JournalEntry:
        self._take(entry)
        return entry

    def _take(self, entry: JournalEntry) -> None:
        """Follow an entry; one that refers to an edit that is not there (its record was damaged) changes nothing."""
        if entry.base >= entry.number or entry.number in self._contents:
            return
        self._last = max(self._last, entry.number)
        if entry.kind == "edit" and entry.content is not None:
            # An edit whose base was lost to damage goes on from what is in force, so that undo still leads to the beginning.
            self._bases[entry.number] = entry.base if entry.base in self._contents else self._now
            self._contents[entry.number] = entry.content
            self._actions[entry.number] = entry.action
            self._now = self._tip = entry.number
        elif entry.kind != "edit" and entry.base in self._contents and self._leads_to_tip(entry.base):
            self._now = entry.base

    def _leads_to_tip(self, step: int) -> bool:
        back = self._tip
        while back not in (step, 0):
            back = self._bases[back]
        return back == step
