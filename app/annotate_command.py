"""``annotate``: ground truth by hand, alone or as a study of several raters; agreement, export, import."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from app.annotate_exchange import EXPORTS, export_annotations, import_annotations, join_annotations, salvage_annotations
from app.annotate_options import AnnotateOptions
from app.annotate_queue import queue_of
from app.annotate_sources import asked_files, asked_rater, default_store, listed_images, of_rater, tell_problems
from app.language import tr
from core.config import Config, choose_model, load_config
from core.perception.compiled import loops
from core.profiles import own_config
from core.study.annotation_store import AnnotationStore
from core.study.annotations import AnnotationError

_KEPT = (("loupe", "L"), ("masks", "K"))
"""Switches of the window that are as they were left, and their keys."""


def run_annotate(options: AnnotateOptions) -> int:
    """Open the window, or report, export, import, join, salvage; returns the exit code. Raises UserError."""
    if options.export is not None and options.export not in EXPORTS:
        raise AnnotationError(f"--export {options.export}: must be one of {', '.join(EXPORTS)}")
    if sum((options.report, options.export is not None, bool(options.imports), bool(options.joins), options.salvage)) > 1:
        raise AnnotationError("--report, --export, --import, --join and --salvage are different things: give one of them")
    if options.names and not options.joins:
        raise AnnotationError("--as says who somebody is in a file that is joined: give --join FILE, too")
    if options.joins and options.study.rater is not None:
        raise AnnotationError("--join takes all raters of a file; --as THERE=HERE says what one of them is called here")
    if options.export is not None and options.out is None:
        raise AnnotationError("--export needs --out: a folder for dataset, a file for csv and coco")
    if options.as_json and not options.report:
        raise AnnotationError("--json is for --report; leave it out")
    config = _config(options)
    given = options.paths or (Path(),)
    store_path = options.store or _store_of(given)
    paths = tuple(path.parent if path.suffix == ".sqlite" else path for path in given)
    if options.salvage:
        return salvage_annotations(store_path, options.out)
    if options.report:
        return _report(store_path, options, config)
    if options.export is not None:
        return export_annotations(store_path, paths, options, config)
    if options.joins:
        return join_annotations(store_path, options)
    if options.imports:
        return import_annotations(store_path, paths, options, config)
    return _window(store_path, paths, options, config)


def _config(options: AnnotateOptions) -> Config:
    return load_config(options.config_path, overrides=choose_model(options.model))


def _store_of(paths: Sequence[Path]) -> Path:
    """A path that is an annotation file itself, or the file beside the images."""
    return paths[0] if paths[0].suffix == ".sqlite" else default_store(paths)


def _window(store_path: Path, paths: Sequence[Path], options: AnnotateOptions, config: Config) -> int:
    from app.application import check_display, make_application, run_until_closed

    check_display()
    rater = asked_rater(options.study)
    files = asked_files(paths, options.frames)
    with AnnotationStore(store_path) as store:
        images = listed_images(files, store)
        items = queue_of(store, images, rater, options.study, config)
        loops.load()  # drawing uses them, and may not wait
        application = make_application(own_config().window)

        from app.annotation_desk import AnnotationDesk
        from app.annotator_window import AnnotatorWindow
        from app.layout_keeper import LayoutKeeper, Parts, Switch, toggling

        desk = AnnotationDesk(store, items, config.perception, blind=bool(options.study.name))
        tell_problems(store.problems)
        who = (
            tr("study {name}, rater {rater}, blind", name=options.study.name, rater=rater)
            if options.study.name
            else tr("rater {rater}", rater=rater)
        )
        window = AnnotatorWindow(desk, who)
        bar = window.panels.bar
        switches = {name: Switch(partial(bar.is_on, key), toggling(partial(bar.toggle, key))) for name, key in _KEPT}
        LayoutKeeper(window, "annotator", Parts({"main": window.panels.columns}, {}, switches))
        return run_until_closed(application, window, window.say)


def _report(store_path: Path, options: AnnotateOptions, config: Config) -> int:
    from app.annotate_evaluation import groups_of_answered
    from core.study.annotation_measures import measured_alike
    from core.study.annotation_report import agreement_report, choose_study, group_notes, rater_notes, write_measures

    with AnnotationStore(store_path, read_only=True) as store:
        annotations = choose_study(store.annotations(), options.study.asked, str(store_path))
        images = store.images()
        annotations, notes = measured_alike(of_rater(annotations, options.study.rater), images, config.perception)
        names = {sha256: image.name for sha256, image in images.items()}
        groups = groups_of_answered(annotations, {sha256: store_path.parent / name for sha256, name in names.items()})
        tell_problems([*store.problems, *rater_notes(annotations), *group_notes(annotations, groups), *notes])
    study = annotations[0].key.study
    report = {"study": study} | agreement_report(annotations, names, options.study.seed or 0, groups)
    if options.out is not None:
        try:
            options.out.mkdir(parents=True, exist_ok=True)
            text = json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False)
            (options.out / "agreement.json").write_text(text + "\n", encoding="utf-8")
            write_measures(options.out / "measures.csv", report["measures"])
        except OSError as error:
            raise AnnotationError(
                f"{error.filename or options.out}: cannot be written ({error.strerror}); choose another --out"
            ) from None
    if options.as_json:
        sys.stdout.write(json.dumps(report, allow_nan=False) + "\n")
    else:
        from app.annotate_tables import print_agreement

        print_agreement(report)
        if options.out is not None:
            sys.stderr.write(f"agreement.json and measures.csv are in {options.out}\n")
    return 0
