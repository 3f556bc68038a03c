"""From masks drawn by hand to two sets: one to train on, and one that stays out and says whether it helped."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from core.study.annotation_export import export_training_set, mask_source
from core.study.annotation_images import FoundImage
from core.study.annotation_records import StoredAnnotation
from core.study.annotation_report import finished, studies_of
from core.study.annotations import AnnotationError, MaskTarget

FEWEST = 6
"""Images with both masks below which nothing is trained: four to learn from and two to judge by."""
_ONE_IN = 5
_FEWEST_HELD_OUT = 2


@dataclass(frozen=True, slots=True)
class OwnFrames:
    """Folders as ``train --data`` reads them, and how many frames each has. ``problems``: what was left out, a line each."""

    train: Path
    held_out: Path
    train_count: int
    held_out_count: int
    problems: tuple[str, ...] = ()


def count_complete(annotations: Sequence[StoredAnnotation]) -> int:
    """Images with both masks."""
    return len(_complete(annotations))


def split_own_frames(
    annotations: Sequence[StoredAnnotation],
    images: Sequence[FoundImage],
    out: Path,
    go_on: Callable[[], bool] = lambda: True,
) -> OwnFrames:
    """Write both sets below `out`: a fifth of the images, two at least, is held out.

    These are neighbours in the order of the images' names: pictures of one video or session are alike, and one between two that are
    learnt from would tell of its neighbours only. Angles and states go along where they are of one study; masks are what is learnt.

    Raises
    ------
    AnnotationError
        Too few images with both masks are here, `out` is not empty, or cannot be written; or `go_on` has become False.
    """
    here = {image.sha256: image for image in images}
    complete = sorted((sha256 for sha256 in _complete(annotations) if sha256 in here), key=lambda one: str(here[one].path))
    if len(complete) < FEWEST:
        missing = FEWEST - len(complete)
        have = f"{len(complete)} {'image has' if len(complete) == 1 else 'images have'} both a vessel and a robot mask"
        how = "draw them with keys 3 and 4, or take over and correct the model's with G"
        raise AnnotationError(f"{have}, and training needs {FEWEST}: {missing} more ({how})")
    count = max(_FEWEST_HELD_OUT, len(complete) // _ONE_IN)
    begin = (len(complete) - count) // 2
    held_out = set(complete[begin : begin + count])
    measured = finished(annotations)
    measured = measured if len(studies_of(measured)) < 2 else []
    counts, problems = {}, []
    for name in ("train", "held_out"):
        wanted = held_out if name == "held_out" else {image.sha256 for image in images} - held_out
        chosen = [one for one in annotations if one.key.sha256 in wanted]
        here_of = [image for image in images if image.sha256 in wanted]
        counts[name], found = export_training_set(chosen, here_of, out / name, go_on, measured=measured)
        problems += found
    return OwnFrames(out / "train", out / "held_out", counts["train"], counts["held_out"], tuple(problems))


def _complete(annotations: Sequence[StoredAnnotation]) -> list[str]:
    """SHA-256 of the images whose masks that count are there for both targets."""
    return [sha256 for sha256, one in mask_source(annotations).items() if one.content.drawn.issuperset(MaskTarget)]
