"""From pictures that a model should know to what is familiar to it (``core/perception/familiarity.py``)."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.config import PerceptionConfig
from core.errors import UserError
from core.images import ImageError, read_image
from core.learning.dataset import IMAGE_ENDINGS, DatasetError, read_truth
from core.perception import masks, quality
from core.perception.familiarity import Familiarity, Signature, packed
from core.perception.segmentation import Segmenter, recognise, to_working

LEAST = 40
"""Pictures that a fit needs."""
_AXES = 16
_PICTURES_PER_AXIS = 8
_LIMIT_SHARE = 0.995
_LEAST_SCALE = 1e-2
_LEAST_HALF = 10
_NEIGHBOURS = 16
"""Where nobody tells which pictures show the same, so many in a row are taken to."""


class FamiliarityError(UserError):
    """The pictures do not allow a fit; the message is one line and says what to do."""


@dataclass(frozen=True, slots=True)
class KnownPicture:
    """A picture of a folder, and the ``group`` of those there that show the same phantom: they say little about each other."""

    file: Path
    folder: Path
    group: Hashable


def find_known(folder: Path) -> list[KnownPicture]:
    """The pictures of a labelled set (``dataset.py``), or of a plain folder.

    Pictures of one group have the same ``seed`` in the set's truth; without a truth they are neighbours.

    Raises DatasetError for a folder without pictures or with a damaged truth.
    """
    place = folder / "images" if (folder / "images").is_dir() else folder
    files = sorted(file for file in place.glob("*") if file.suffix.lower() in IMAGE_ENDINGS)
    if not files:
        raise DatasetError(f"{folder}: no pictures ({', '.join(ending[1:] for ending in IMAGE_ENDINGS)}); give a folder with some")
    truth = read_truth(folder) if (folder / "truth.jsonl").is_file() else {}
    seeds = [truth.get(file.stem, {}).get("seed") for file in files]
    return [
        KnownPicture(file, folder, index // _NEIGHBOURS if seed is None else f"seed {seed}")
        for index, (file, seed) in enumerate(zip(files, seeds, strict=True))
    ]


def signatures_in(
    pictures: Sequence[KnownPicture], segment: Segmenter, config: PerceptionConfig, on_unreadable: Callable[[UserError], None]
) -> Iterator[tuple[KnownPicture, Signature] | None]:
    """Each picture with its signature; None where it cannot be read, is refused before the network sees it, or shows no vessel.

    Raises
    ------
    FamiliarityError
        The segmenter tells no signatures.
    """
    for picture in pictures:
        try:
            image = to_working(read_image(picture.file), config.working_size_px)[0]
        except ImageError as error:
            on_unreadable(error)
            yield None
            continue
        if quality.check_image(image, config.quality) is not None:
            yield None
            continue
        vessel, robot, signature = recognise(segment, [image])[0]
        if signature is None:
            raise FamiliarityError("the network's deepest level is not to be had: it cannot tell kinds of pictures; train it again")
        usable = masks.clean(vessel, robot, config).vessel.any() and bool(np.isfinite(signature).all())
        yield (picture, signature) if usable else None


def check_known(pictures: Sequence[KnownPicture]) -> None:
    """Raise FamiliarityError where so few pictures could not be enough, whatever they show: said before they are looked at."""
    _check_number(len(pictures), "pictures")


def _check_number(number: int, of: str) -> None:
    if number < LEAST:
        raise FamiliarityError(f"{number} {of}; {LEAST} are needed; give it more (synth --count)")


def fit_familiarity(
    pictures: Sequence[KnownPicture], signatures: NDArray[np.float32], working_size_px: int, fitted_on: dict[str, Any]
) -> Familiarity:
    """Fit where the signatures (N, F) of N known pictures lie.

    The limit is what 995 of 1000 pictures keep to (the farthest one of few) when they are judged by the other half of their groups:
    of pictures that were fitted to, or whose like were, it would be too narrow for any new one.

    Raises
    ------
    FamiliarityError
        There are less than ``LEAST``, or all are the same.
    """
    _check_number(len(signatures), "pictures show a vessel")
    first = _first_half(pictures)
    apart = [_Fit(signatures[~half]).distance(signatures[half]) for half in (first, ~first)]
    limit = float(np.quantile(np.concatenate(apart), _LIMIT_SHARE))
    if limit <= 0.0:
        raise FamiliarityError("all pictures are the same; give it pictures that differ as those of the rig do")
    return _Fit(signatures).familiarity(limit, working_size_px, fitted_on | {"pictures": len(signatures)})


def _first_half(pictures: Sequence[KnownPicture]) -> NDArray[np.bool_]:
    """Every other group of each folder; of a folder with one group its first pictures.

    Each folder's kind has to be in both halves: judged by pictures among which there are none of its kind, it would be taken for
    the limit of all.
    """
    first = np.zeros(len(pictures), np.bool_)
    for folder in dict.fromkeys(picture.folder for picture in pictures):
        places = [place for place, picture in enumerate(pictures) if picture.folder == folder]
        order = list(dict.fromkeys(pictures[place].group for place in places))
        if len(order) < 2:
            first[places[: (len(places) + 1) // 2]] = True
            continue
        chosen = set(order[::2])
        first[[place for place in places if pictures[place].group in chosen]] = True
    if min(first.sum(), (~first).sum()) < _LEAST_HALF:  # one group holds nearly all of them
        first = np.arange(len(pictures)) % 2 == 0
    return first


class _Fit:
    """Mean, scale and principal directions of some signatures."""

    def __init__(self, signatures: NDArray[np.float32]) -> None:
        count = len(signatures)
        self._mean, self._scale = signatures.mean(axis=0), signatures.std(axis=0) + _LEAST_SCALE
        _, size, directions = np.linalg.svd(((signatures - self._mean) / self._scale).astype(np.float64), full_matrices=False)
        share = size**2 / count
        axes = max(1, min(_AXES, count // _PICTURES_PER_AXIS))
        smallest = max(1e-6 * float(share.sum()), 1e-12)
        self._directions, self._spread = directions[:axes], np.sqrt(np.maximum(share[:axes], smallest))
        self._across = np.array([max(float(share[axes:].sum()), smallest)])

    def distance(self, signatures: NDArray[np.float32]) -> NDArray[np.float64]:
        """``Familiarity.distance`` of what was fitted."""
        return self.familiarity(1.0, 1, {}).distance(signatures)

    def familiarity(self, limit: float, working_size_px: int, fitted_on: dict[str, Any]) -> Familiarity:
        numbers = packed(self._mean, self._scale, self._directions, self._spread, self._across)
        return Familiarity(
            size=len(self._mean),
            axes=len(self._directions),
            limit=limit,
            working_size_px=working_size_px,
            packed=numbers,
            fitted_on=fitted_on,
        )
