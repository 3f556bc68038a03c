"""Raters compared with themselves, each other and the algorithm: tables of their agreement, and rows for ``evaluate``."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from app.annotator.sources import recorded_angles, recording_of
from app.commands.progress import progress_bar
from core.annotation.agreement_report import (
    DECIMALS,
    agreement_report,
    choose_study,
    manual_measurements,
    measured_alike,
    rater_notes,
    second_measure_notes,
)
from core.annotation.model import AngleProvenance, AnnotationError
from core.annotation.store import FoundImage, StoredAnnotation
from core.annotation.study import angle_words
from core.config.models import Config
from core.evaluation.evaluation import Measurement
from core.files import name_as_text, name_of
from core.types import Frame

_NONE = "\N{EN DASH}"
_COLUMNS = 5
"""So many raters or pairs fit beside each other into eighty columns."""


def print_agreement(report: Mapping[str, Any], *, within: bool = True) -> None:
    """Tables on standard output: first against second measure, then rater against rater, then all together.

    Without `within` the SD of one manual measure is left to another table.
    """
    console = Console(markup=False, emoji=False)
    name = f"Study {report['study']}" if report["study"] else "Annotations outside studies"
    console.print(f"{name}: {report['annotations']} answers on {report['images']} images", "", sep="\n", highlight=False)
    for title, columns in agreement_tables(report).items():
        names = list(columns)
        for first in range(0, len(names), _COLUMNS):
            shown = names[first : first + _COLUMNS]
            table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
            table.add_column(title, no_wrap=True)
            for column in shown:
                table.add_column(column, justify="right")
            for quantity in columns[shown[0]]:
                table.add_row(quantity, *(columns[column][quantity] for column in shown))
            console.print(table, "", sep="\n", highlight=False)
    for words in (report_words(report), within_words(report) if within else "", between_words(report)):
        if words:
            console.print(words, highlight=False)


def report_words(report: Mapping[str, Any]) -> str:
    """Which way a study was done; empty outside studies."""
    return angle_words(report["hides_angle"]) if "hides_angle" in report else ""


def agreement_tables(report: Mapping[str, Any]) -> dict[str, dict[str, dict[str, str]]]:
    """By title: by column (a rater, two raters) the quantities as text."""
    pairs = {f"{row['first']}, {row['second']}": _comparison_texts(row) for row in report["pairs"]}
    raters = {}
    for rater, row in report["raters"].items():
        raters[rater] = {
            "Answers": str(row["annotations"]),
            "of these can't tell": str(row["cannot_tell"]),
            "of these no robot": str(row["no_robot"]),
            "Angles by hand": _by_hand(row["provenance"]),
            "on lines that are short": str(row["short_lines"]),
            "Median time an image": f"{_number(row['median_time_s'], 0)} s",
            "SD within an image": _degrees(row["sd_deg"]),
            **_comparison_texts(row),
        }
    return {"First against second": raters, "Rater against rater": pairs}


def within_words(report: Mapping[str, Any]) -> str:
    """The uncertainty of one measure, over all raters, in one line; empty where no image was measured twice by a rater."""
    within = report["within"]
    if not within["n"]:
        return ""
    span = f" (95 % interval {_number(within['ci95'][0], 2)} to {_number(within['ci95'][1], 2)}°)" if within["ci95"] else ""
    return f"SD of one manual measure, over all repeats of {within['n']} images: {_degrees(within['sd_deg'])}{span}"


def between_words(report: Mapping[str, Any]) -> str:
    """All raters together in one line; empty when there is only one."""
    both = report["between"]
    if not both["n"]:
        return ""
    spread = f"SD about an image's mean {_degrees(both['sd_deg'])}, ICC(2,1) {_number(both['icc'], 3)}"
    return f"All {both['raters']} raters on {both['n']} images: {spread}"


def _comparison_texts(row: Mapping[str, Any]) -> dict[str, str]:
    angle, state = row["angle"], row["state"]
    return {
        "Images with two angles": str(angle["n"]),
        "Mean difference": _degrees(angle["mean_difference_deg"]),
        "Lower limit of agreement": _degrees(angle["loa_low_deg"]),
        "Upper limit of agreement": _degrees(angle["loa_high_deg"]),
        "ICC(2,1)": _number(angle["icc"], 3),
        "Images with two states": str(state["n"]),
        "Equal states": _NONE if state["equal"] is None else f"{state['equal']:.0%}",
        "Cohen’s kappa": _number(state["kappa"], 3),
        "Only one can’t tell": str(state["one_cannot_tell"]),
        "Neither can tell": str(state["neither_can_tell"]),
        "Only one sees no robot": str(state["one_no_robot"]),
        "Both see no robot": str(state["both_no_robot"]),
    }


def _by_hand(provenance: Mapping[str, int]) -> str:
    """How many angles are manual, and how many came from elsewhere."""
    others = ", ".join(f"{count} {word}" for word, count in provenance.items() if word != AngleProvenance.MANUAL)
    return f"{provenance.get(AngleProvenance.MANUAL, 0)}{f' ({others})' if others else ''}"


def _degrees(value: float | None) -> str:
    return _NONE if value is None else f"{_number(value, 2)}°"


def _number(value: float | None, digits: int) -> str:
    return _NONE if value is None else f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")


def comparable_answers(
    annotations: Sequence[StoredAnnotation], images: Sequence[FoundImage], config: Config, study: str | None, where: str
) -> tuple[list[StoredAnnotation], list[str]]:
    """The finished answers of one study to the images that are here, measured as the algorithm is, and notes for the reader.

    Raises AnnotationError without any, or several studies.
    """
    records = {image.sha256: image.record for image in images}
    done = [one for one in choose_study(annotations, study, where) if one.key.sha256 in records]
    if not done:
        raise AnnotationError(f"{where}: none of its annotated images is here")
    alike, notes = measured_alike(done, records, config.perception)
    return alike, [*rater_notes(alike), *second_measure_notes(alike), *notes]


def compare_with_algorithm(
    answers: Sequence[StoredAnnotation], images: Sequence[FoundImage], config: Config
) -> tuple[list[Measurement], dict[str, int], str, int]:
    """Perceive each image with one of these answers (``comparable_answers``); after Ctrl-C the rows so far are returned.

    Returns
    -------
    tuple
        Rows; how often which reason was given on images with a manual state; where the network ran; how many images were not
        perceived before an interruption.
    """
    from core.files import read_image
    from core.perception.pipeline import open_pipeline

    here = {image.sha256: image for image in images}
    manual = manual_measurements(answers, {image.sha256: image.sha256 for image in images})
    pipeline = open_pipeline(config.perception)
    groups = groups_of([here[row.image].path for row in manual])
    rows: list[Measurement] = []
    reasons: Counter[str] = Counter()
    with progress_bar() as bar:
        try:
            for row in bar.track(manual, description="images"):
                image = here[row.image]
                scene = pipeline.perceive_single(Frame(len(rows), 0.0, read_image(image.path)))
                pose = scene.pose
                angle, state = (round(pose.theta_deg, DECIMALS), pose.state.value) if pose is not None else (None, None)
                name, group = name_as_text(image.path.name), groups[image.path]
                rows.append(replace(row, image=name, algorithm_angle=angle, algorithm_state=state, group=group))
                if scene.refusal is not None and row.state is not None:
                    reasons[scene.refusal.reason.value] += 1
        except KeyboardInterrupt:
            if not rows:
                raise
    return rows, dict(sorted(reasons.items())), pipeline.engine, len(manual) - len(rows)


def groups_of(pictures: Sequence[Path]) -> dict[Path, str | None]:
    """The group of each picture for resampling: pictures of one recording, or of one folder, are alike.

    None where all lie in one folder that is of no recording: nothing is known of what they show.
    """
    recordings = {folder: recording_of(folder) for folder in {path.parent for path in pictures}}
    if len(recordings) == 1 and None in recordings.values():
        return dict.fromkeys(pictures)
    places = {found or folder for folder, found in recordings.items()}
    if len(places) > 1:  # from what they have in common on: the folders inside sessions have equal names
        common = Path(os.path.commonpath([place.absolute() for place in places]))
        names = {place: name_as_text(place.absolute().relative_to(common).as_posix()) for place in places}
    else:
        names = {place: name_as_text(name_of(place)) for place in places}
    return {path: names[recordings[path.parent] or path.parent] for path in pictures}


def groups_of_answered(answers: Iterable[StoredAnnotation], paths: Mapping[str, Path]) -> dict[str, str | None]:
    """The group of each picture with one of these answers, by SHA-256; pictures without an answer do not count."""
    answered = {one.key.sha256 for one in answers} & paths.keys()
    groups = groups_of([paths[sha256] for sha256 in answered])
    return {sha256: groups[paths[sha256]] for sha256 in answered}


def rater_agreement(answers: Sequence[StoredAnnotation], images: Sequence[FoundImage], seed: int) -> dict[str, Any] | None:
    """``agreement_report`` of these answers (``comparable_answers``); None when no image was measured twice."""
    raters = {one.key.rater for one in answers}
    if len(raters) < 2 and all(one.key.repeat == 1 for one in answers):
        return None
    groups = groups_of_answered(answers, {image.sha256: image.path for image in images})
    report = agreement_report(answers, {image.sha256: name_as_text(image.path.name) for image in images}, seed, groups)
    return {"study": answers[0].key.study} | report


ANGLE_COLUMNS = (
    *("image", "frame", "time_s", "rater", "theta_deg", "theta_signed_deg", "state", "provenance"),
    "algorithm_theta_signed_deg",
)
"""Of ``--export angles``: an angle by hand in each row; ``time_s`` counts from the first picture of the recording."""


def angles_over_time(annotations: Sequence[StoredAnnotation], images: Sequence[FoundImage]) -> list[dict[str, Any]]:
    """The angles of all pictures with both lines, by recording, rater and time; the recorded ones of the algorithm beside them."""
    paths = {image.sha256: image.path for image in images}
    found = [one for one in annotations if one.theta_deg is not None and not one.content.without_pose and one.key.sha256 in paths]
    recorded = {folder: recorded_angles(folder) for folder in {paths[one.key.sha256].parent for one in found}}
    rows = []
    order = {one.key: (paths[one.key.sha256].parent, one.key.rater, paths[one.key.sha256].name, one.key.repeat) for one in found}
    for one in sorted(found, key=lambda one: order[one.key]):
        path = paths[one.key.sha256]
        digits = path.stem.rpartition("_")[2]
        frame = int(digits) if digits.isascii() and digits.isdigit() else None
        time_s, algorithm = recorded[path.parent].get(-1 if frame is None else frame, (None, None))
        state = one.content.state.value if one.content.state is not None else None
        values = (name_as_text(path.name), frame, time_s, one.key.rater, one.theta_deg, one.theta_signed_deg, state)
        rows.append(dict(zip(ANGLE_COLUMNS, (*values, one.provenance.value, algorithm), strict=True)))
    return rows
