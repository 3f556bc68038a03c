"""What a reader should know of the rows that are evaluated: what is missing in them, and which angles go to the other side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from core.study.agreement import RANGE_DEG, SHARE_EDGES_PERCENT

if TYPE_CHECKING:
    from core.study.evaluation import Measurement

_APART_DEG = 15.0
_ALIKE_DEG = SHARE_EDGES_PERCENT[1] / 100 * RANGE_DEG
_NAMED = 5


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
                "the algorithmic one": having.count((True, False)),
                "the manual one": having.count((False, True)),
                "both": having.count((False, False)),
            }
            told = ", ".join(f"{which}: {count}" for which, count in lacks.items() if count)
            notes.append(f"Rows with a manual and an algorithmic {what}: {both} of {len(rows)}; without {told}.")
    once = sum((row.angle_1 is None) is not (row.angle_2 is None) for row in rows)
    if once and any(row.angle_1 is not None and row.angle_2 is not None for row in rows):
        notes.append(f"Images that were measured once by hand, and not twice: {once}.")
    nameless = sum(not row.image for row in rows)
    if nameless:
        notes.append(f"Rows that name no image: {nameless}; whether one is there twice cannot be seen.")
    return notes


def other_side_notes(rows: Sequence[Measurement]) -> list[str]:
    """Angles that are alike as soon as one of them is measured to the other side: 180 degrees minus it, or with the other sign.

    They are told and not turned: an algorithm that takes the tail for the head errs in just this way.
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
