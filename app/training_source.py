"""Where a training's annotations come from: an annotation file and the images beside it, or those of an open annotator window."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from core.study.annotation_images import FoundImage
from core.study.annotation_records import StoredAnnotation
from core.study.annotation_store import AnnotationStore
from core.study.annotations import AnnotationError


def collect_from_file(path: Path) -> tuple[Sequence[StoredAnnotation], Sequence[FoundImage]]:
    """All annotations of a file, and those of their images that lie beside it. Raises AnnotationError."""
    from app.annotate_sources import read_annotated  # statistics, which a window does without until then

    return read_annotated(path, [path.parent])


def collect_from_store(
    store: AnnotationStore, images: Sequence[FoundImage]
) -> tuple[Sequence[StoredAnnotation], Sequence[FoundImage]]:
    """The same of a file that is open; images that are shown twice count once. Raises AnnotationError."""
    annotations = store.annotations()
    if not annotations:
        raise AnnotationError(f"{store.path.name}: nothing is annotated yet")
    return annotations, list({image.sha256: image for image in images}.values())
