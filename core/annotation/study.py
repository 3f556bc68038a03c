"""Studies: who annotates what in which order; several raters, every image several times, repeats turned against recognition."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from core.annotation.model import AnnotationError, ImageView


class QueueOrder(StrEnum):
    """The order of a queue."""

    LISTED = "listed"
    RANDOM = "random"
    WORST = "worst"
    EVEN = "even"


@dataclass(frozen=True, slots=True)
class StudySettings:
    """What all raters of a study share; it is fixed when the study begins.

    ``images`` are SHA-256 in the order of the queue; with ``QueueOrder.RANDOM`` each rater gets another order.
    ``views`` are those of the first, second, ... repeat. ``hides_angle``: theta, and the state that the lines give, are shown only
    once an image is answered; studies of versions that always showed them do not say it.
    """

    images: Annotated[tuple[str, ...], Field(min_length=1)]
    views: Annotated[tuple[ImageView, ...], Field(min_length=1)] = (ImageView.AS_IS,)
    order: QueueOrder = QueueOrder.RANDOM
    seed: int = 0
    hides_angle: bool = False

    @property
    def repeats(self) -> int:
        return len(self.views)

    @property
    def words(self) -> str:
        """All but the images, as messages say it."""
        shown, angle = ", ".join(view.value for view in self.views), "hidden until the answer" if self.hides_angle else "shown"
        return f"shown {self.repeats} times ({shown}), order {self.order.value}, seed {self.seed}, theta {angle}"

    def to_json(self) -> dict[str, Any]:
        return _SETTINGS.dump_python(self, mode="json")  # type: ignore[no-any-return]


def angle_words(hides_angle: bool) -> str:
    """Which way a study was done, as reports say it."""
    when = "only after the answer" if hides_angle else "while the lines were drawn"
    return f"Theta and the state of the lines were shown to the raters {when}."


_SETTINGS = TypeAdapter(StudySettings)


def settings_from(row: Mapping[str, Any], where: str) -> StudySettings:
    """The settings as they were kept; raises AnnotationError."""
    try:
        return _SETTINGS.validate_python(row)
    except ValidationError:
        raise AnnotationError(f"{where}: the settings of the study are damaged; begin a study of another name") from None


@dataclass(frozen=True, slots=True)
class Task:
    """One showing of an image to a rater."""

    sha256: str
    repeat: int = 1
    view: ImageView = ImageView.AS_IS


def repeat_views(repeats: int, *, mirror: bool, turn: bool) -> tuple[ImageView, ...]:
    """How each repeat is shown: the first as it is, the others in turn in the views that are asked for."""
    kinds = [ImageView.MIRRORED] * mirror + [ImageView.TURNED] * turn or [ImageView.AS_IS]
    return (ImageView.AS_IS, *(kinds[place % len(kinds)] for place in range(repeats - 1)))


def queue_order(images: Sequence[str], order: QueueOrder, confidence: Mapping[str, float] | None = None) -> tuple[str, ...]:
    """Images in the order in which they are best annotated; ``QueueOrder.RANDOM`` is left to ``tasks``.

    ``WORST`` puts the least `confidence` first (0 for what was refused). ``EVEN`` goes through the images, taken as a sequence in
    time, ever more finely: wherever a rater stops, the answers are spread evenly.
    """
    if order is QueueOrder.WORST:
        known = confidence or {}
        return tuple(sorted(images, key=lambda image: known.get(image, 0.0)))
    if order is QueueOrder.EVEN:
        # By bit reversal: 0, 1/2, 1/4, 3/4, 1/8, ... of the way.
        bits = max(len(images) - 1, 1).bit_length()
        places = (int(f"{place:0{bits}b}"[::-1], 2) for place in range(1 << bits))
        return tuple(images[place] for place in places if place < len(images))
    return tuple(images)


def tasks(settings: StudySettings, rater: str) -> list[Task]:
    """All showings for one rater, one pass through the images after the other.

    Shuffled passes keep their distance: each half of a pass is shuffled by itself in the next one, so that at least half of the
    images lie between two showings of the same one (but for one image when their number is odd).
    """
    order = list(settings.images)
    found: list[Task] = []
    for repeat, view in enumerate(settings.views, 1):
        if settings.order is QueueOrder.RANDOM:
            rng = np.random.default_rng((settings.seed, zlib.crc32(rater.encode()), repeat))
            middle = len(order) // 2
            parts = [order] if repeat == 1 else [order[:middle], order[middle:]]
            order = [part[place] for part in parts for place in rng.permutation(len(part))]
        found += [Task(image, repeat, view) for image in order]
    return found
