"""What ``annotate`` is given: pictures, folders, labelled sets, sessions, and videos, which become pictures evenly over time; and
what has been annotated of them, by whom."""

from __future__ import annotations

import getpass
import sys
from collections.abc import Sequence
from pathlib import Path

from app.annotate_options import StudyOptions
from app.long_work import progress_bar
from app.sources import expand, is_video
from app.taken_frames import evenly, evenly_over, take_frames, taken_of
from core.session.session_video import is_of_session
from core.study.annotation_images import FoundImage, find_images
from core.study.annotation_records import StoredAnnotation
from core.study.annotation_store import DEFAULT_NAME, AnnotationStore, image_sha256
from core.study.annotations import AnnotationError

_NAMED_PROBLEMS = 20


def default_store(paths: Sequence[Path]) -> Path:
    """Beside the images: in the folder that is given, or in that of the first file."""
    first = paths[0]
    return (first if first.is_dir() else first.parent) / DEFAULT_NAME


FRAMES = 48
"""Pictures taken of a video, unless told otherwise."""


def image_files(paths: Sequence[Path], frames: int, *, taken: bool = False) -> list[Path]:
    """All pictures among `paths`, in name order; of each video `frames` pictures, which lie in a folder beside it afterwards.

    With `taken` those that lie there already, however many they are, and only without any `frames` new ones.

    Raises AnnotationError when a path is not there, a video cannot be read, or there is no picture at all.
    """
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise AnnotationError(f"{path}: no such file or folder")
        found = _whole(path)
        if path.is_dir() and not found and (path / "images").is_dir():  # a labelled set
            found = _whole(path / "images")
        parts = [file for file in found if is_video(file) and is_of_session(file)]  # one recording, in files of an hour
        there = {file: taken_of(file) for file in found if is_video(file)} if taken else {}
        shares = {} if any(there.get(part) for part in parts) else evenly_over(parts, frames)
        for file in found:
            if not is_video(file):
                files.append(file)
            elif there.get(file):
                files += there[file]
            elif file in parts and not shares:
                continue  # of the session's other files pictures were taken before
            else:
                files += take_frames(file, shares.get(file, evenly(frames)), tell_problems)
    if not files:
        raise AnnotationError(f"{paths[0]}: no picture or video in it")
    return files


def asked_files(paths: Sequence[Path], frames: int | None) -> list[Path]:
    """``image_files`` as a person asks for them: without a number, the pictures that were taken before, or ``FRAMES`` new ones."""
    return image_files(paths, frames or FRAMES, taken=frames is None)


def _whole(path: Path) -> list[Path]:
    """What can be annotated in it: a link that leads nowhere cannot, and keeps nobody from the rest."""
    return [file for file in expand([path]) if file.exists()]


def listed_images(files: Sequence[Path], store: AnnotationStore) -> list[FoundImage]:
    """The files as images that the store knows from then on; what cannot be read is told. Raises AnnotationError without any."""
    with progress_bar() as bar:
        task = bar.add_task("looking at the images", total=len(files))
        images, problems = find_images(files, store, lambda: bar.advance(task))
    tell_problems(problems)
    if not images:
        raise AnnotationError(f"{files[0].parent}: no image that can be read")
    return images


def read_annotated(
    store_path: Path, paths: Sequence[Path], frames: int = FRAMES
) -> tuple[list[StoredAnnotation], list[FoundImage]]:
    """All annotations of a file and those of its images that are here; how many are not is told. Raises AnnotationError.

    Of a video those pictures count that were taken from it before; where there are none, `frames` are taken.
    """
    files = image_files(paths, frames, taken=True)
    with AnnotationStore(store_path, read_only=True) as store:
        annotations = store.annotations()
        images, problems = known_images(files, store)
        tell_problems([*store.problems, *problems])
    annotated, here = {one.key.sha256 for one in annotations}, {image.sha256 for image in images}
    if here and not annotated <= here:
        tell_problems([f"{len(annotated - here)} of {len(annotated)} annotated images are not in {paths[0]}: left out"])
    return annotations, images


def known_images(files: Sequence[Path], store: AnnotationStore) -> tuple[list[FoundImage], list[str]]:
    """Those of the files that the store knows, by their content."""
    records = store.images()
    found: dict[str, FoundImage] = {}
    problems = []
    for path in files:
        try:
            sha256 = image_sha256(path)
        except AnnotationError as error:
            problems.append(str(error))
            continue
        if sha256 in records:
            found.setdefault(sha256, FoundImage(path, records[sha256]))
    return list(found.values()), problems


def of_rater(annotations: list[StoredAnnotation], rater: str | None) -> list[StoredAnnotation]:
    """Those of one rater; None: of all. Raises AnnotationError where there are none."""
    if rater is None:
        return annotations
    own = [one for one in annotations if one.key.rater == rater]
    if not own:
        known = ", ".join(sorted({one.key.rater for one in annotations})) or "nobody"
        raise AnnotationError(f"--rater {rater}: has annotated nothing here; who has: {known}")
    return own


def asked_rater(options: StudyOptions) -> str:
    """Who annotates. Raises AnnotationError for a name that no file can hold."""
    rater = options.rater or own_name()
    try:
        rater.encode()
    except UnicodeEncodeError:
        raise AnnotationError(f"--rater {rater!a}: is no UTF-8; give the name in plain letters") from None
    return rater


def own_name() -> str:
    """Who annotates where nobody says who: the user of this computer."""
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):  # no name for this user id
        return "rater"


def tell_problems(problems: Sequence[str]) -> None:
    """One line each on standard error; many are counted."""
    for line in problems[:_NAMED_PROBLEMS]:
        sys.stderr.write(f"warning: {line}\n")
    if len(problems) > _NAMED_PROBLEMS:
        sys.stderr.write(f"warning: and {len(problems) - _NAMED_PROBLEMS} more\n")
