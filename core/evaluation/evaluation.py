"""From a table of manual and algorithmic measures to the figures of the paper's evaluation (METHOD section 7)."""

from __future__ import annotations

import codecs
import csv
import difflib
import io
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from core.devices import UserError, disk_errors
from core.evaluation.metrics import (
    RANGE_DEG,
    SHARE_EDGES_PERCENT,
    angle_metrics,
    are_too_few,
    members,
    repeat_metrics,
    state_metrics,
    too_few_words,
)
from core.types import PoseState

_UNIT = re.compile(r"[(\[][^)\]]*[)\]]|°")


def places(header: Sequence[str], needed: Sequence[str], may_be: Sequence[str]) -> dict[str, int]:
    """By column its place in the header, of `needed` all and of `may_be` those that there are.

    Raises ValueError with what is wrong, and what is expected.
    """
    known = {_plain(name): name for name in (*needed, *may_be)}
    found: dict[str, list[int]] = {}
    for place, heading in enumerate(header):
        plain = _plain(heading)
        name = known.get(plain) or known.get(re.sub(r"deg(rees?)?$", "", plain))
        if name is not None:
            found.setdefault(name, []).append(place)
    expected = f"needs the columns {', '.join(needed)} (blank where not measured)"
    for name, at in found.items():
        if len(at) > 1:
            spelt = "" if len({header[place] for place in at}) == 1 else f" ({', '.join(repr(header[place]) for place in at)})"
            raise ValueError(f"column {name!r} occurs {len(at)} times{spelt}; {expected}")
    for name in needed:
        if name not in found:
            others = [heading for place, heading in enumerate(header) if [place] not in found.values()]
            alike = difflib.get_close_matches(name, others, 1, cutoff=0.75)
            raise ValueError(f"column {name!r} is missing{f'; is {alike[0]!r} meant?' if alike else ''}; {expected}")
    return {name: at[0] for name, at in found.items()}


def _plain(heading: str) -> str:
    """Letters and digits alone, small, without a unit in brackets."""
    return re.sub(r"[\W_]+", "", _UNIT.sub("", heading.casefold()))


_FULL_TURN_DEG = 360.0
_MOST_DIGITS = 6  # of a count of measures


class EvaluationError(UserError):
    """Measures cannot be evaluated; the message is one line and says what to do."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """One image, measured by hand (once or twice) and by the algorithm; None = not measured. Field names are the CSV's columns.

    ``group`` is the session or phantom that the image is of; images of one group are alike. None: not known. ``counts``: of how
    many single measures ``angle_1`` and ``angle_2`` are the means. ``answer`` is what was said instead of a pose: "can't tell" or
    "no robot". ``provenance`` is where the manual angle comes from, several with "+" between; ``short_lines`` is "yes" where a line
    was shorter than the fit wants.
    """

    image: str
    angle_1: float | None
    angle_2: float | None
    state: str | None
    algorithm_angle: float | None
    algorithm_state: str | None
    group: str | None = None
    counts: tuple[int, int] = (1, 1)
    answer: str | None = None
    provenance: str | None = None
    short_lines: str | None = None

    @property
    def manual_angle_deg(self) -> float | None:
        """The mean of all single measures that there are."""
        measured = [(a, n) for a, n in zip((self.angle_1, self.angle_2), self.counts, strict=True) if a is not None]
        return sum(a * n for a, n in measured) / sum(n for _, n in measured) if measured else None


GROUP = "group"
COUNTS = ("count_1", "count_2")
TEXTS = (GROUP, "answer", "provenance", "short_lines")
COLUMNS = tuple(column.name for column in fields(Measurement) if column.name not in (*TEXTS, "counts"))
_MAY_BE = (*TEXTS, *COUNTS)
NO_ROBOT = "no robot"
"""The ``answer`` to a picture without a robot."""


def read_measurements(path: Path) -> list[Measurement]:
    """Rows of a CSV file with the columns ``COLUMNS`` in any order, and those of ``TEXTS`` and ``COUNTS`` that there are.

    Others are ignored, blank cells mean "not measured". Headings may be spelt with capitals, spaces and units.

    Commas, semicolons or tabs separate cells, as the header shows; where it is not the comma, numbers may have a decimal comma.

    Raises EvaluationError: with file, line and column in one line. An image that is there twice is refused: it would count twice.
    """
    with disk_errors(EvaluationError, path, "cannot be read", missing="no such file"):
        data = path.read_bytes()
    try:  # UTF-16 is what spreadsheets call Unicode text
        text = data.decode("utf-16" if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig")
    except UnicodeDecodeError:
        raise EvaluationError(f"{path}: not a text file in UTF-8; save the table as CSV (UTF-8)") from None
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines:
        raise EvaluationError(f"{path}: empty; needs the columns {', '.join(COLUMNS)}")
    # Spreadsheets may name the separator in a line before the header.
    said = re.fullmatch(r"sep=([,;\t])", lines[0].strip(' "'))
    separator = said[1] if said else max(",;\t", key=lines[0].count)
    table = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        filled = ((table.line_num, cells) for cells in table if any(map(str.strip, cells)))
        if said:
            next(filled, None)
        header = [cell.strip() for cell in next(filled, (0, [""]))[1]]
        try:
            place = places(header, COLUMNS, _MAY_BE)
        except ValueError as error:
            raise EvaluationError(f"{path}: {error}") from None
        rows = {}
        for line, cells in filled:
            where = f"{path}: line {line}"
            if len(cells) > len(header) and any(map(str.strip, cells[len(header) :])):
                raise EvaluationError(f"{where}: {len(cells)} cells under {len(header)} columns")
            text_of = {name: cells[at].strip() if at < len(cells) else "" for name, at in place.items()}
            rows[line] = _measurement(where, text_of, has_decimal_comma=separator != ",")
    except csv.Error as error:
        raise EvaluationError(f"{path}: line {table.line_num}: not valid CSV ({error})") from None
    if not rows:
        raise EvaluationError(f"{path}: has a header but no rows")
    first: dict[tuple[str | None, str], int] = {}
    for line, row in rows.items():
        before = first.setdefault((row.group, row.image), line)  # pictures of several sessions may be called alike
        if row.image and before != line:
            raise EvaluationError(
                f"{path}: line {line}: image {row.image!r} is in line {before} already; give it one row, with a second manual "
                "measure as angle_2, and images of one name different groups"
            )
    return list(rows.values())


def _measurement(where: str, text: Mapping[str, str], *, has_decimal_comma: bool) -> Measurement:
    """A row of a table from its cells by column; raises EvaluationError."""

    def angle(name: str) -> float | None:
        if not text[name]:
            return None
        try:
            plain = text[name].removesuffix("°").replace("\N{MINUS SIGN}", "-")
            value = float(plain.replace(",", ".") if has_decimal_comma else plain) if "_" not in plain else math.nan
        except ValueError:
            value = math.nan
        if not abs(value) <= _FULL_TURN_DEG:
            raise EvaluationError(f"{where}: {name} is {text[name]!r}; must be an angle in degrees, or blank where not measured")
        return value

    def state(name: str) -> str | None:
        label = text[name].upper()
        if label and label not in set(PoseState):
            known = ", ".join(PoseState)
            raise EvaluationError(f"{where}: {name} is {text[name]!r}; must be one of {known}, or blank where not measured")
        return label or None

    def count(name: str) -> int:
        said = text.get(name) or "1"
        if not said.isdecimal() or len(said) > _MOST_DIGITS or int(said) < 1:
            raise EvaluationError(
                f"{where}: {name} is {said[:20]!r}; must be of how many measures the angle is the mean, 1 or more"
            )
        return int(said)

    return Measurement(
        text["image"],
        angle("angle_1"),
        angle("angle_2"),
        state("state"),
        angle("algorithm_angle"),
        state("algorithm_state"),
        counts=(count("count_1"), count("count_2")),
        **{name: text.get(name) or None for name in TEXTS},
    )


def write_measurements(path: Path, rows: Iterable[Measurement]) -> None:
    """The rows as a CSV file that ``read_measurements`` reads, with ``TEXTS`` and counts that say something; raises OSError."""
    rows = list(rows)
    columns = (*COLUMNS, *(name for name in TEXTS if any(getattr(row, name) is not None for row in rows)))
    counts = COUNTS if any(row.counts != (1, 1) for row in rows) else ()
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow((*columns, *counts))
        for row in rows:
            values = (*(getattr(row, name) for name in columns), *(row.counts if counts else ()))
            table.writerow(["" if value is None else value for value in values])


@dataclass(frozen=True, slots=True, eq=False)
class AnglePairs:
    """Images with a manual and an algorithmic angle: arrays of shape (n,), degrees."""

    manual_deg: np.ndarray
    algorithm_deg: np.ndarray


def angle_pairs(rows: Sequence[Measurement]) -> AnglePairs:
    """The rows that have both; of the manual measures the mean."""
    pairs = [(row.manual_angle_deg, row.algorithm_angle) for row in rows]
    both = np.array([(m, a) for m, a in pairs if m is not None and a is not None], np.float64).reshape(-1, 2)
    return AnglePairs(both[:, 0], both[:, 1])


def evaluate(rows: Sequence[Measurement], seed: int = 0) -> dict[str, Any]:
    """The content of ``metrics.json``.

    Returns ``no_robot`` (images without one, and on how many of them the algorithm gave a pose), ``images``, ``intervals`` (what
    the bootstrap draws), ``angle``, ``state``, ``manual`` (the two manual measures against each other) and ``notes``: one sentence
    for each thing that a reader should know. Undefined figures: None, and a note says why.

    Parameters
    ----------
    rows : images, measured by hand and by the algorithm; each statistic takes those that have what it needs.
    seed : of the bootstrap intervals.
    """
    pairs = angle_pairs(rows)
    twice_rows = [row for row in rows if row.angle_1 is not None and row.angle_2 is not None]
    twice = np.array([(row.angle_1, row.angle_2) for row in twice_rows], np.float64).reshape(-1, 2)
    counts = np.array([row.counts for row in twice_rows], np.float64).reshape(-1, 2)
    labelled = [row for row in rows if row.state is not None and row.algorithm_state is not None]
    measured = [row for row in rows if row.manual_angle_deg is not None and row.algorithm_angle is not None]
    parts = {"angle": measured, "state": labelled, "manual": twice_rows}
    group = {name: members([row.group for row in part]) for name, part in parts.items()}
    manual, algorithm = [str(row.state) for row in labelled], [str(row.algorithm_state) for row in labelled]
    by_hand = [row for row in rows if row.manual_angle_deg is not None or row.state is not None]
    answered = sum(row.algorithm_angle is not None or row.algorithm_state is not None for row in by_hand)
    drawn = group["angle" if measured else "state"]
    known_groups = {row.group for row in measured or labelled if row.group is not None}
    empty = [row for row in rows if (row.answer or "").casefold() == NO_ROBOT]
    metrics: dict[str, Any] = {
        "no_robot": {"n": len(empty), "pose_given": sum(row.algorithm_state is not None for row in empty)},
        "images": {"n": len(rows), "measured": len(by_hand), "answered": answered, "unanswered": len(by_hand) - answered},
        "intervals": {
            "drawn": "images" if drawn is None else "nothing" if are_too_few(drawn) else "groups",
            "groups": len(known_groups),
        },
        "angle": angle_metrics(pairs.manual_deg, pairs.algorithm_deg, seed, group["angle"]),
        "state": state_metrics(manual, algorithm, seed, group["state"]),
        "manual": repeat_metrics(twice[:, 0], twice[:, 1], seed, group["manual"], counts),
    }
    notes = []
    if without := [name for name in parts if are_too_few(group[name])]:
        known = max(len({row.group for row in parts[name] if row.group is not None}) for name in without)
        words = [_OF[name] for name in without]
        what = " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
        notes.append(too_few_words(f"intervals of {what}", known))
    notes += answer_notes(rows, metrics["no_robot"]) + missing_notes(rows) + other_side_notes(rows)
    return metrics | {"notes": notes + _angle_notes(metrics, rows) + _state_notes(metrics["state"])}


_OF = {"angle": "angles", "state": "states", "manual": "manual measures"}
_APART_DEG = 15.0  # angles further apart may have been measured to different sides
_ALIKE_DEG = SHARE_EDGES_PERCENT[1] / 100 * RANGE_DEG  # if they are so near once one is turned
_NAMED = 5  # images named in a note


def answer_notes(rows: Sequence[Measurement], no_robot: Mapping[str, int]) -> list[str]:
    """Images without a pose, and manual angles that were not drawn by hand alone, or on short lines."""
    notes = []
    if no_robot["n"]:
        given = no_robot["pose_given"]
        notes.append(f"Images without a robot, by hand: {no_robot['n']}; the algorithm gave a pose on {given} of them, wrongly.")
    unclear = sum(row.answer is not None for row in rows) - no_robot["n"]
    if unclear:
        notes.append(f"Images on which the raters could not tell the pose: {unclear}; they are in none of the figures.")
    sources = Counter(source for row in rows for source in (row.provenance or "").split("+"))
    taken = {word: sources[word] for word in _NOT_BY_HAND if sources[word]}
    if taken:
        told = ", ".join(f"{word}: {count}" for word, count in taken.items())
        notes.append(
            f"Manual angles that were not drawn by hand from the start ({told}); with these the algorithm agrees too well."
        )
    short = sum(row.short_lines is not None for row in rows)
    if short:
        notes.append(f"Manual angles on lines shorter than the fit wants: {short}; they are less certain.")
    return notes


_NOT_BY_HAND = ("algorithm", "followed", "corrected")
"""Values of ``provenance`` beside "manual"."""


def missing_notes(rows: Sequence[Measurement]) -> list[str]:
    """How many rows are not among the figures because a measure is missing, and how many name no image."""
    columns = {
        "angle": [(row.manual_angle_deg is not None, row.algorithm_angle is not None) for row in rows],
        "state": [(row.state is not None, row.algorithm_state is not None) for row in rows],
    }
    notes = []
    for what, having in columns.items():
        both = having.count((True, True))
        if 0 < both < len(rows):
            lacks = {
                "by hand only": having.count((True, False)),
                "by the algorithm only": having.count((False, True)),
                "by neither": having.count((False, False)),
            }
            told = ", ".join(f"{count} {which}" for which, count in lacks.items() if count)
            notes.append(f"The {what} was given by hand and by the algorithm on {both} of {len(rows)} images ({told}).")
    once = sum((row.angle_1 is None) is not (row.angle_2 is None) for row in rows)
    if once and any(row.angle_1 is not None and row.angle_2 is not None for row in rows):
        notes.append(f"Images that were measured once by hand, and not twice: {once}.")
    nameless = sum(not row.image for row in rows)
    if nameless:
        notes.append(f"Rows that name no image: {nameless}; whether one is there twice cannot be seen.")
    return notes


def other_side_notes(rows: Sequence[Measurement]) -> list[str]:
    """Angles that are alike as soon as one of them is measured to the other side: 180 degrees minus it, or with the other sign.

    They are reported and not changed: an algorithm that takes the tail for the head errs in just this way.
    """
    pairs = {
        "manual and algorithmic angle": [(row.image, row.manual_angle_deg, row.algorithm_angle) for row in rows],
        "the two manual angles": [(row.image, row.angle_1, row.angle_2) for row in rows],
    }
    notes = []
    for what, measures in pairs.items():
        turned = [image for image, a, b in measures if a is not None and b is not None and _is_other_side(a, b)]
        if turned:
            named = ", ".join(image or "without a name" for image in turned[:_NAMED]) + (", ..." if len(turned) > _NAMED else "")
            notes.append(
                f"Images on which {what} are more than {_APART_DEG:g}° apart, but alike with one of them measured to the "
                f"other side (180° minus it, or its sign changed): {len(turned)} ({named}). They are taken as they are; "
                "look at them."
            )
    return notes


def _is_other_side(one_deg: float, other_deg: float) -> bool:
    apart = abs(one_deg - other_deg)
    turned = min(abs(one_deg + other_deg), abs(RANGE_DEG - one_deg - other_deg))
    return apart > _APART_DEG and turned <= _ALIKE_DEG


def _angle_notes(metrics: dict[str, Any], rows: Sequence[Measurement]) -> list[str]:
    angle, manual, counts, notes = metrics["angle"], metrics["manual"], metrics["images"], []
    if counts["unanswered"]:
        notes.append(
            f"The algorithm gave no answer for {counts['unanswered']} of {counts['measured']} images that were measured by hand; "
            "they are in none of the figures."
        )
    outside = sum(not 0 <= a <= RANGE_DEG for r in rows for a in (r.angle_1, r.angle_2, r.algorithm_angle) if a is not None)
    if outside:
        notes.append(f"{outside} angles lie outside 0° to 180°; they are taken as they are.")
    if angle["n"] == 0:
        notes.append("No image has both a manual and an algorithmic angle: no angle statistics.")
    elif angle["n"] == 1:
        notes.append("One image with angles: spread, correlation and intervals are undefined.")
    elif angle["pearson"] is None:
        notes.append("All manual or all algorithmic angles are equal: their correlation is undefined.")
    if angle["n"] > 1 and manual["n"] < 2:
        notes.append("Fewer than two images were measured twice by hand: repeatability and the manual ICC are undefined.")
    elif any(r.counts != (1, 1) for r in rows):
        notes.append("The two manual angles are means over several raters: the manual ICC is that of means, not of one measure.")
    return notes


def _state_notes(state: dict[str, Any]) -> list[str]:
    if state["n"] == 0:
        return ["No image has both a manual and an algorithmic state: no state statistics."]
    notes = []
    if state["kappa"] is None:
        notes.append("Only one state occurs on both sides: kappa is undefined.")
    if state["fowlkes_mallows_pairs"] is None:
        notes.append("No two images share a state on one of the sides: the pair-counting Fowlkes-Mallows index is undefined.")
    for label, row in state["per_class"].items():
        if row["precision"] is None:
            notes.append(f"The algorithm never gave state {label}: its precision is undefined and counts as 0 in the averages.")
        if row["recall"] is None:
            notes.append(f"No image has the manual state {label}: its recall is undefined and left out of the averages.")
    return notes
