"""What goes out of an annotation file and comes into it: ``annotate --export``, ``--import``, ``--join`` and ``--salvage``."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from app.annotate_options import AnnotateOptions
from app.annotate_sources import FRAMES, asked_files, asked_rater, listed_images, of_rater, read_annotated, tell_problems
from app.outputs import check_can_write
from core.config import Config
from core.study.annotation_records import ItemKey
from core.study.annotation_store import AnnotationStore
from core.study.annotations import AnnotationError, View, measure_lines

EXPORTS = ("dataset", "csv", "coco")


def export_annotations(store_path: Path, paths: Sequence[Path], options: AnnotateOptions, config: Config) -> int:
    """``--export``: a training set, COCO masks, or the table that ``evaluate --csv`` reads, as far as it was interrupted.

    Raises AnnotationError, and KeyboardInterrupt after an interrupted table was written.
    """
    from core.study.annotation_export import export_coco, export_training_set
    from core.study.annotation_report import finished
    from core.study.evaluation import write_measurements

    assert options.out is not None
    annotations, images = read_annotated(store_path, paths, options.frames or FRAMES)
    asked, everybodys = options.study.asked, annotations
    if asked is not None:
        annotations = [one for one in everybodys if one.key.study == asked]
    annotations = of_rater(annotations, options.study.rater)
    if options.export == "dataset":
        if asked and not annotations:
            raise AnnotationError(f"{store_path}: nobody has answered in study {asked!r}")
        # A study is blind, so that masks are drawn outside it: its angles and states are chosen, not its masks.
        drawn, measured = annotations, None
        if asked is not None:
            drawn, measured = of_rater(everybodys, options.study.rater), finished(annotations)
        count, problems = export_training_set(drawn, images, options.out, measured=measured)
        tell_problems(problems)
        sys.stderr.write(f"{count} frames with both masks in {options.out}: train --data {options.out}\n")
    elif options.export == "coco":
        count = export_coco(annotations, images, options.out)
        sys.stderr.write(f"masks of {count} images in {options.out}\n")
    else:
        from app.annotate_evaluation import compared_rows, fitted_alike

        if options.out.exists():
            raise AnnotationError(f"{options.out}: is there already; choose another --out")
        check_can_write(options.out, "--out")
        done, notes = fitted_alike(annotations, images, config, options.study.asked, str(store_path))
        tell_problems(notes)
        rows, _, _, missed = compared_rows(done, images, config)
        try:
            write_measurements(options.out, rows)
        except OSError as error:
            raise AnnotationError(f"{options.out}: cannot be written ({error.strerror}); choose another --out") from None
        sys.stderr.write(f"{len(rows)} images in {options.out}: evaluate --csv {options.out} --out DIR\n")
        if missed:
            raise KeyboardInterrupt
    return 0


def import_annotations(store_path: Path, paths: Sequence[Path], options: AnnotateOptions, config: Config) -> int:
    """``--import``: the lines and masks of other programs' files, for one rater. Raises AnnotationError where there are none."""
    from core.study.annotation_import import merged, read_files

    sources = [file for path in options.imports for file in (sorted(path.glob("*.json")) if path.is_dir() else [path])]
    if not sources:
        raise AnnotationError(f"{options.imports[0]}: no .json file in it")
    if not any(source.is_file() for source in sources):  # before an annotation file is made for them
        raise AnnotationError(f"{sources[0]}: no such file; nothing was imported")
    rater = asked_rater(options.study)
    files = asked_files(paths, options.frames)
    counts: Counter[str] = Counter()
    with AnnotationStore(store_path) as store:
        images = listed_images(files, store)
        imported, problems = read_files(sources, images)
        existing = {one.key: one.content for one in store.annotations(options.study.name, rater)}
        for one in imported:
            key = ItemKey(one.image.sha256, options.study.name, rater)
            history = store.history(key)
            old = existing.get(key, history.current)  # whose record is damaged, his journal still has
            content = merged(old, one.content)
            entry = history.edit(f"import {one.source.name}", content)
            if entry is None or content == old:
                problems.append(f"{one.source}: {one.image.path.name} has these annotations already; left as they are")
                continue
            store.save(key, View.AS_IS, entry, content, measure_lines(content, one.image.record.size, config.perception), 0.0)
            existing[key] = content
            counts[one.image.sha256] += 1
        problems += store.problems
    tell_problems(problems)
    if not counts:
        raise AnnotationError("nothing was imported")
    sys.stderr.write(f"{len(counts)} images got annotations, for rater {rater}, in {store_path}\n")
    return 0


def join_annotations(store_path: Path, options: AnnotateOptions) -> int:
    """``--join``: what other raters have answered in files of their own; raises AnnotationError, and changes nothing then."""
    from core.study.annotation_join import join

    names: dict[str, str] = {}
    for said in options.names:
        there, _, here = (part.strip() for part in said.partition("="))
        if not there or not here or names.get(there, here) != here:
            raise AnnotationError(f"--as {said}: must be THERE=HERE, a rater's name in the file that is joined and his name here")
        names[there] = here
    is_new = not store_path.exists()
    try:
        with AnnotationStore(store_path) as store:
            joined = join(store, options.joins, options.study.asked, names)
    except AnnotationError:
        if is_new:
            store_path.unlink(missing_ok=True)
        raise
    tell_problems(joined.told)
    for path, persons in joined.persons.items():
        who = ", ".join(here if here == there else f"{here} (there: {there})" for there, here in sorted(persons.items()))
        sys.stderr.write(f"{path}: {who or 'nobody has answered in it'}\n")
    sys.stderr.write(f"{joined.new} answers are new in {store_path}, {joined.grown} went on, {joined.known} were there already\n")
    return 0


def salvage_annotations(store_path: Path, out: Path | None) -> int:
    """``--salvage``: what can be read of a damaged file, in a new one. Raises AnnotationError."""
    from core.study.annotation_salvage import salvage

    target = out or store_path.with_name(f"salvaged_{store_path.name}")
    kept, problems = salvage(store_path, target)
    tell_problems(problems)
    sys.stderr.write(f"{kept} annotations saved into {target}; the damaged file is as it was\n")
    return 0
