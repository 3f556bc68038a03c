"""Who the raters of one file are in another: a name alone does not tell, since two computers may both call theirs "user"."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from core.study.annotation_rows import KeptAnnotation
from core.study.annotations import AnnotationError


@dataclass(frozen=True, slots=True)
class Persons:
    """``names``: by their names there, what raters are called here. ``declared``: of these, who was only said to be so."""

    names: Mapping[str, str]
    declared: frozenset[str]


def whose(there: Sequence[KeptAnnotation], here: Sequence[KeptAnnotation], names: Mapping[str, str], where: str) -> Persons:
    """Who is who, over all studies: whose answers are in both files is the same person, whatever he is called in each of them.

    Parameters
    ----------
    there, here : all answers of both files.
    names : what the operator says: name there -> name here.
    where : the other file, for messages.

    Raises
    ------
    AnnotationError
        A name is in both files, and nothing tells whether it is one person; or `names` contradicts the answers.
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
    """A line for names that may be one person's, written in two ways."""
    ways: dict[str, set[str]] = {}
    for rater in raters:
        ways.setdefault(" ".join(rater.casefold().split()), set()).add(rater)
    several = [" and ".join(map(repr, sorted(names))) for names in ways.values() if len(names) > 1]
    return [f"raters {names} are taken for different people" for names in several]
