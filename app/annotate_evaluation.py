"""Manual against algorithm: the raters' common answer for each image beside what perception says of it."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.long_work import progress_bar
from app.taken_frames import recording_of
from core.config import Config
from core.names import name_as_text, name_of
from core.study.annotation_images import FoundImage
from core.study.annotation_measures import measured_alike
from core.study.annotation_records import StoredAnnotation
from core.study.annotation_report import (
    agreement_report,
    choose_study,
    manual_measurements,
    rater_notes,
    second_measure_notes,
)
from core.study.annotations import AnnotationError
from core.study.evaluation import Measurement
from core.types import Frame


def fitted_alike(
    annotations: Sequence[StoredAnnotation], images: Sequence[FoundImage], config: Config, study: str | None, where: str
) -> tuple[list[StoredAnnotation], list[str]]:
    """The finished answers of one study to the images that are here, measured as the algorithm is, and notes for the reader.

    Raises AnnotationError where there are none, or several studies.
    """
    records = {image.sha256: image.record for image in images}
    done = [one for one in choose_study(annotations, study, where) if one.key.sha256 in records]
    if not done:
        raise AnnotationError(f"{where}: none of its annotated images is here")
    alike, notes = measured_alike(done, records, config.perception)
    return alike, [*rater_notes(alike), *second_measure_notes(alike), *notes]


def compared_rows(
    done: Sequence[StoredAnnotation], images: Sequence[FoundImage], config: Config
) -> tuple[list[Measurement], dict[str, int], str, int]:
    """A row for each image with one of these answers (``fitted_alike``); an interruption (Ctrl-C) keeps what was done until then.

    Returns
    -------
    tuple
        Rows, how often which reason was given on images with a manual state, where the network ran, and how many images were not
        perceived before an interruption.
    """
    from core.images import read_image
    from core.perception.pipeline import open_pipeline

    here = {image.sha256: image for image in images}
    manual = manual_measurements(done, {image.sha256: image.sha256 for image in images})
    pipeline = open_pipeline(config.perception)
    groups = groups_of([here[row.image].path for row in manual])
    rows: list[Measurement] = []
    reasons: Counter[str] = Counter()
    with progress_bar() as bar:
        try:
            for row in bar.track(manual, description="images"):
                image = here[row.image]
                scene = pipeline.perceive_single(Frame(len(rows), 0.0, read_image(image.path)))
                angle, state = (scene.pose.theta_deg, scene.pose.state.value) if scene.pose is not None else (None, None)
                name, group = name_as_text(image.path.name), groups[image.path]
                rows.append(replace(row, image=name, algorithm_angle=angle, algorithm_state=state, group=group))
                if scene.refusal is not None and row.state is not None:
                    reasons[scene.refusal.reason.value] += 1
        except KeyboardInterrupt:
            if not rows:
                raise
    return rows, dict(sorted(reasons.items())), pipeline.engine, len(manual) - len(rows)


def groups_of(pictures: Sequence[Path]) -> dict[Path, str | None]:
    """The group of each picture: pictures of one recording are alike, and so may those of one folder be.

    None where all lie in one folder that is of no recording: nothing is known of what they show, then.
    """
    recordings = {folder: recording_of(folder) for folder in {path.parent for path in pictures}}
    if len(recordings) == 1 and None in recordings.values():
        return dict.fromkeys(pictures)
    places = {found or folder for folder, found in recordings.items()}
    names = _names_of(places) if len(places) > 1 else {place: name_as_text(name_of(place)) for place in places}
    return {path: names[recordings[path.parent] or path.parent] for path in pictures}


def groups_of_answered(answers: Iterable[StoredAnnotation], paths: Mapping[str, Path]) -> dict[str, str | None]:
    """The group of each picture with one of these answers, by SHA-256: what nobody has answered says nothing of who is alike."""
    answered = {one.key.sha256 for one in answers} & paths.keys()
    places = groups_of([paths[sha256] for sha256 in answered])
    return {sha256: places[paths[sha256]] for sha256 in answered}


def _names_of(folders: set[Path]) -> dict[Path, str]:
    """Each folder from the one on that they have in common: sessions may all be called alike inside."""
    common = Path(os.path.commonpath([folder.absolute() for folder in folders]))
    return {folder: name_as_text(folder.absolute().relative_to(common).as_posix()) for folder in folders}


def raters_agreement(done: Sequence[StoredAnnotation], images: Sequence[FoundImage], seed: int) -> dict[str, Any] | None:
    """How well raters agree with themselves and each other by these answers (``fitted_alike``, ``agreement_report``).

    None when nobody measured anything twice.
    """
    raters = {one.key.rater for one in done}
    if len(raters) < 2 and all(one.key.repeat == 1 for one in done):
        return None
    groups = groups_of_answered(done, {image.sha256: image.path for image in images})
    report = agreement_report(done, {image.sha256: name_as_text(image.path.name) for image in images}, seed, groups)
    return {"study": done[0].key.study} | report
