"""The images that are annotated, known by their content: a file that was renamed or moved finds its annotations again."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from core.images import ImageError, read_image
from core.study.annotation_records import ImageRecord
from core.study.annotation_store import AnnotationStore, image_sha256
from core.study.annotations import AnnotationError


@dataclass(frozen=True, slots=True)
class FoundImage:
    """An image that is there: its file and its record in the store."""

    path: Path
    record: ImageRecord

    @property
    def sha256(self) -> str:
        return self.record.sha256


def find_images(
    paths: Sequence[Path], store: AnnotationStore, on_progress: Callable[[], None] = lambda: None
) -> tuple[list[FoundImage], list[str]]:
    """The images among `paths`, in order and each content once, made known to the store; and one line for each that is left out.

    A file whose name, size and time are as last seen is not read again. Raises AnnotationError when the store cannot be written.
    """
    found: dict[str, FoundImage] = {}
    problems: list[str] = []
    for path in paths:
        try:
            one = _identified(path, store)
        except (AnnotationError, ImageError) as error:
            if not isinstance(error, ImageError) and not str(error).startswith(str(path)):
                raise
            problems.append(str(error))
        else:
            if one.sha256 in found:
                problems.append(f"{path}: the same picture as {found[one.sha256].path.name}; shown once")
            else:
                found[one.sha256] = one
        on_progress()
    return list(found.values()), problems


def _identified(path: Path, store: AnnotationStore) -> FoundImage:
    try:
        state = path.stat()
    except OSError as error:
        raise ImageError(f"{path}: cannot be read ({error.strerror})") from None
    # A name that is no UTF-8, as old archives have them, is kept in a form that a file can hold.
    name = os.fsencode(os.path.relpath(path.resolve(), store.path.parent.resolve())).decode("utf-8", "backslashreplace")
    record = store.image_as_last_seen(name, state.st_size, state.st_mtime_ns)
    if record is None:
        sha256 = image_sha256(path)
        height, width = read_image(path).shape[:2]
        record = ImageRecord(sha256, name, width, height)
        store.add_image(record, state.st_size, state.st_mtime_ns)
    return FoundImage(path, record)
