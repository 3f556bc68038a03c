"""``annotate``: ground truth by hand, alone or as a study of several raters; agreement, export, import, joining, salvage."""

from __future__ import annotations

import csv
import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.annotator.sources import (
    AnnotateOptions,
    StudyOptions,
    default_store,
    image_files,
    listed_images,
    of_rater,
    print_warnings,
    rater_name,
    read_annotated,
    session_rows,
)
from app.commands.options import ConfigOption, JsonOption, ModelOption
from app.commands.progress import check_can_write, progress_bar
from app.ui.i18n import tr
from core.annotation.formats import FORMATS, export_as, read_files
from core.annotation.model import AnnotationError, ImageView, measure_lines
from core.annotation.store import AnnotationStore, FoundImage, ItemKey, StoredAnnotation
from core.annotation.study import QueueOrder, StudySettings, Task, queue_order, repeat_views, settings_from, tasks
from core.config.files import own_config
from core.config.models import Config, choose_model, load_config
from core.devices import UserError, disk_errors
from core.files import write_atomic
from core.perception import compiled
from core.program import COMMAND, program_id
from core.types import Frame

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

    from app.annotator.model import QueueEntry


EXPORTS = ("dataset", "csv", "angles", *(one.name for one in FORMATS.values() if one.write is not None))
_DISAGREEMENT_DEG = 30.0
"""A disagreement of so much takes all certainty from an image, half as much half of it."""
_KEPT = {"loupe": "L", "masks": "K"}
"""Switches of the window that keep their state, and their keys."""


def queue_of(
    store: AnnotationStore, images: Sequence[FoundImage], rater: str, options: StudyOptions, config: Config
) -> list[QueueEntry]:
    """The items of the window: of the study, or every image once."""
    from app.annotator.model import QueueEntry

    here = {image.sha256: image for image in images}
    if options.name:
        settings = _settings(store, images, options, config)
        missing = [sha256 for sha256 in settings.images if sha256 not in here]
        others = len(set(here) - set(settings.images))
        print_warnings([f"{others} images are here that do not belong to study {options.name!r}; left out"] if others else [])
        if missing:
            names = store.images()
            print_warnings(
                [f"{names[m].name if m in names else m[:12]}: belongs to the study, but is not here; left out" for m in missing]
            )
        queue = [task for task in tasks(settings, rater) if task.sha256 in here]
        if not queue:
            raise AnnotationError(f"study {options.name!r}: none of its {len(settings.images)} images is here")
    else:
        if options.repeats not in (None, 1) or options.mirror or options.turn or options.show_angle is not None:
            raise AnnotationError("--repeats, --mirror, --turn and --show-angle belong to a study: give it a name with --study")
        order = _order(options.order, QueueOrder.LISTED)
        listed = [image.sha256 for image in images]
        if order is QueueOrder.RANDOM:
            queue = tasks(StudySettings(tuple(listed), seed=options.seed or 0), rater)
        else:
            queue = [Task(sha256) for sha256 in queue_order(listed, order, _certainty(store, images, order, config))]
    return [QueueEntry(here[t.sha256], ItemKey(t.sha256, options.name, rater, t.repeat), t.view) for t in queue]


def _order(name: str | None, default: QueueOrder) -> QueueOrder:
    if name is None:
        return default
    try:
        return QueueOrder(name)
    except ValueError:
        raise AnnotationError(f"--order {name}: must be one of {', '.join(QueueOrder)}") from None


def _settings(store: AnnotationStore, images: Sequence[FoundImage], options: StudyOptions, config: Config) -> StudySettings:
    """The settings that the study was begun with; raises AnnotationError for options that contradict them."""
    kept = store.study_settings(options.name)
    if kept is None:
        order = _order(options.order, QueueOrder.RANDOM)
        views = repeat_views(options.repeats or 2, mirror=options.mirror, turn=options.turn)
        listed = queue_order([image.sha256 for image in images], order, _certainty(store, images, order, config))
        settings = StudySettings(listed, views, order, options.seed or 0, hides_angle=not options.show_angle)
        store.begin_study(options.name, settings.to_json())
        return settings
    settings = settings_from(kept, f"study {options.name!r}")
    repeats = settings.repeats if options.repeats is None else options.repeats
    asked_views = repeat_views(repeats, mirror=options.mirror, turn=options.turn)
    given = options.repeats is not None or options.mirror or options.turn
    differs = (
        (given and asked_views != settings.views)
        or (options.seed is not None and options.seed != settings.seed)
        or (options.order is not None and _order(options.order, settings.order) is not settings.order)
        or (options.show_angle is not None and options.show_angle is settings.hides_angle)
    )
    if differs:
        raise AnnotationError(
            f"study {options.name!r} was begun otherwise: {settings.words}; leave these options out, or choose another name"
        )
    return settings


def _certainty(store: AnnotationStore, images: Sequence[FoundImage], order: QueueOrder, config: Config) -> dict[str, float] | None:
    """How certain the algorithm is of each image (0: refused), for the order "worst"; disagreement with a rater lowers it."""
    if order is not QueueOrder.WORST:
        return None
    from core.files import read_image
    from core.perception.pipeline import open_pipeline

    measured = {
        one.key.sha256: one.theta_deg for one in store.annotations() if one.theta_deg is not None and not one.content.without_pose
    }
    pipeline = open_pipeline(config.perception)
    certainty = {}
    with progress_bar() as bar:
        for image in bar.track(images, description="asking the algorithm"):
            pose = pipeline.perceive_single(Frame(0, 0.0, read_image(image.path))).pose
            certainty[image.sha256] = 0.0
            if pose is not None:
                differs_deg = abs(pose.theta_deg - measured.get(image.sha256, pose.theta_deg))
                certainty[image.sha256] = pose.confidence * max(0.0, 1.0 - differs_deg / _DISAGREEMENT_DEG)
    return certainty


def export_annotations(store_path: Path, paths: Sequence[Path], options: AnnotateOptions, config: Config) -> int:
    """``--export``: a training set, another program's files, or the table for ``evaluate --csv``, as far as it came.

    Raises AnnotationError, and KeyboardInterrupt after an interrupted table was written.
    """
    from core.annotation.agreement_report import finished
    from core.annotation.exchange import export_training_set
    from core.evaluation.evaluation import write_measurements

    assert options.out is not None
    annotations, images = read_annotated(store_path, paths, options.frames)
    asked, of_all = options.study.asked, annotations
    if asked is not None:
        annotations = [one for one in of_all if one.key.study == asked]
    annotations = of_rater(annotations, options.study.rater)
    if options.export == "dataset":
        if asked and not annotations:
            raise AnnotationError(f"{store_path}: nobody has answered in study {asked!r}")
        # A study is blind, so masks are drawn outside it: it contributes angles and states, not masks.
        drawn, measured = annotations, None
        if asked is not None:
            drawn, measured = of_rater(of_all, options.study.rater), finished(annotations)
        count, problems = export_training_set(drawn, images, options.out, measured=measured)
        print_warnings(problems)
        said = f"{count} image{'s' if count != 1 else ''} with both masks in {options.out}"
        sys.stderr.write(f"{said}; next: {COMMAND} train --data {options.out} --init default --out MODEL\n")
    elif options.export == "angles":
        _export_angles(annotations, images, options.out)
    elif options.export in FORMATS:
        count = export_as(FORMATS[options.export], annotations, images, options.out)
        sys.stderr.write(f"{options.export} of {count} image{'s' if count != 1 else ''} in {options.out}\n")
    else:
        from app.annotator.comparison import comparable_answers, compare_with_algorithm

        if options.out.exists():
            raise AnnotationError(f"{options.out}: is there already; choose another --out")
        check_can_write(options.out, "--out")
        done, notes = comparable_answers(annotations, images, config, options.study.asked, str(store_path))
        print_warnings(notes)
        rows, _, _, missed = compare_with_algorithm(done, images, config)
        with disk_errors(AnnotationError, options.out, "cannot be written", "; choose another --out"):
            write_measurements(options.out, rows)
        said = f"{len(rows)} image{'s' if len(rows) != 1 else ''} in {options.out}"
        sys.stderr.write(f"{said}; next: {COMMAND} evaluate --csv {options.out} --out DIR\n")
        unfinished = {one.key.sha256 for one in annotations} - {one.key.sha256 for one in finished(annotations)}
        begun = sorted(image.path.name for image in images if image.sha256 in unfinished)
        if begun:
            print_warnings([f"{name}: begun only, not answered; left out" for name in begun])
        if missed:
            raise KeyboardInterrupt
    return 0


def _export_angles(annotations: Sequence[StoredAnnotation], images: Sequence[FoundImage], out: Path) -> None:
    """The angles over time as a table, and as a figure beside it where one can be drawn. Raises AnnotationError."""
    from app.annotator.comparison import ANGLE_COLUMNS, angles_over_time
    from app.commands.evaluation_report import can_draw

    figure = out.with_suffix(".svg") if can_draw() else None
    for path in filter(None, (out, figure)):
        if path.exists():
            raise AnnotationError(f"{path}: is there already; choose another --out")
    rows = angles_over_time(annotations, images)
    if not rows:
        raise AnnotationError("no image has both lines; draw them in annotate, and follow them with Ctrl+F")
    try:
        with out.open("x", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, ANGLE_COLUMNS)
            table.writeheader()
            table.writerows(rows)
        if figure is not None:
            from app.commands.figures import draw_angles, save_figure

            save_figure(draw_angles(rows), figure)
    except OSError as error:
        raise AnnotationError(f"{error.filename or out}: cannot be written ({error.strerror}); choose another --out") from None
    sys.stderr.write(f"{len(rows)} angles in {out}{f', their course in {figure}' if figure is not None else ''}\n")


def import_annotations(store_path: Path, paths: Sequence[Path], options: AnnotateOptions, config: Config) -> int:
    """``--import``: the lines and masks of other programs' files, for one rater. Raises AnnotationError if they hold nothing."""
    from core.annotation.exchange import merged

    endings = {one.ending for one in FORMATS.values()}
    sources = []
    for path in options.imports:
        sources += [file for file in sorted(path.rglob("*")) if file.suffix.lower() in endings] if path.is_dir() else [path]
    if not sources:
        raise AnnotationError(f"{options.imports[0]}: no {', '.join(sorted(endings))} file in it")
    if not any(source.is_file() for source in sources):  # before an annotation file is made for them
        raise AnnotationError(f"{sources[0]}: no such file; nothing was imported")
    rater = rater_name(options.study)
    files = image_files(paths, options.frames)
    counts: Counter[str] = Counter()
    with AnnotationStore(store_path) as store:
        images = listed_images(files, store)
        pictures = {image.path.resolve() for image in images}
        imported, problems = read_files([file for file in sources if file.resolve() not in pictures], images)
        existing = {one.key: one.content for one in store.annotations(options.study.name, rater)}
        for one in imported:
            key = ItemKey(one.image.sha256, options.study.name, rater)
            history = store.history(key)
            old = existing.get(key, history.current)  # where the record is damaged, the journal still has it
            content = merged(old, one.content)
            entry = history.edit(f"import {one.source.name}", content)
            if entry is None or content == old:
                problems.append(f"{one.source}: {one.image.path.name} has these annotations already; left as they are")
                continue
            store.save(key, ImageView.AS_IS, entry, content, measure_lines(content, one.image.record.size, config.perception), 0.0)
            existing[key] = content
            counts[one.image.sha256] += 1
        problems += store.problems
    print_warnings(problems)
    if not counts:
        raise AnnotationError("nothing was imported")
    sys.stderr.write(f"{len(counts)} images got annotations, for rater {rater}, in {store_path}\n")
    return 0


def join_annotations(store_path: Path, options: AnnotateOptions) -> int:
    """``--join``: answers of other raters in files of their own; raises AnnotationError, and changes nothing then."""
    from core.annotation.merge import join

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
    print_warnings(joined.told)
    for path, persons in joined.persons.items():
        who = ", ".join(here if here == there else f"{here} (there: {there})" for there, here in sorted(persons.items()))
        sys.stderr.write(f"{path}: {who or 'nobody has answered in it'}\n")
    sys.stderr.write(f"{joined.new} answers are new in {store_path}, {joined.grown} went on, {joined.known} were there already\n")
    return 0


def salvage_annotations(store_path: Path, out: Path | None) -> int:
    """``--salvage``: copy what can be read of a damaged file into a new one. Raises AnnotationError."""
    from core.annotation.merge import salvage

    target = out or store_path.with_name(f"salvaged_{store_path.name}")
    kept, problems = salvage(store_path, target)
    print_warnings(problems)
    sys.stderr.write(f"{kept} annotations saved into {target}; the damaged file is as it was\n")
    return 0


def annotate(
    paths: Annotated[list[Path] | None, typer.Argument(help="folders, pictures, videos or sessions; default: this folder")] = None,
    store: Annotated[Path | None, typer.Option(help="annotation file; default: annotations.lumenpilot.sqlite there")] = None,
    rater: Annotated[str | None, typer.Option(help="who annotates; default: the user's name")] = None,
    study: Annotated[
        str | None,
        typer.Option(
            help='blind study of this name: begun at the first call, gone on with at later ones; --report, --export: "" outside any'
        ),
    ] = None,
    repeats: Annotated[int | None, typer.Option(min=1, max=20, help="how often a study shows each image; default: 2")] = None,
    mirror: Annotated[bool, typer.Option("--mirror", help="repeats of a study are shown mirrored")] = False,
    turn: Annotated[bool, typer.Option("--turn", help="repeats of a study are shown turned by 180 degrees")] = False,
    order: Annotated[str | None, typer.Option(help="listed, random, worst (least sure first) or even (evenly over time)")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="of the shuffled order")] = None,
    show_angle: Annotated[
        bool | None,
        typer.Option("--show-angle/--hide-angle", help="a study shows theta while the lines are drawn; default: after the answer"),
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="pictures taken of each video, evenly; default: those taken before, or 48"),
    ] = None,
    rows: Annotated[
        str | None, typer.Option(help="of one session: row numbers such as 12,40, or refused: those without a pose")
    ] = None,
    report: Annotated[bool, typer.Option("--report", help="agreement within and between raters, instead of the window")] = False,
    export: Annotated[str | None, typer.Option(help=f"to --out: {', '.join(EXPORTS)}")] = None,
    import_: Annotated[
        list[Path] | None, typer.Option("--import", help=f"file or folder of {', '.join(FORMATS)}; may be repeated")
    ] = None,
    join: Annotated[
        list[Path] | None, typer.Option("--join", help="take in the answers of another annotation file; may be repeated")
    ] = None,
    as_: Annotated[
        list[str] | None, typer.Option("--as", metavar="THERE=HERE", help="what a rater of joined files is called here")
    ] = None,
    salvage: Annotated[bool, typer.Option("--salvage", help="copy what is readable of a damaged annotation file")] = False,
    out: Annotated[Path | None, typer.Option(help="where report or export go")] = None,
    as_json: JsonOption = False,
    model: ModelOption = None,
    config: ConfigOption = None,
) -> None:
    """Measure angles and states by hand, draw masks; as a study with several raters, blind and repeated."""
    if study == "" and not report and export is None:  # without a name it would not be blind
        raise UserError("--study is empty: give it a value, or leave it out (is a variable of a script not set?)")
    options = AnnotateOptions(
        paths=tuple(paths or ()),
        store=store,
        study=StudyOptions(study, rater, repeats, mirror, turn, seed, order, show_angle),
        frames=frames,
        rows=rows,
        report=report,
        export=export,
        imports=tuple(import_ or ()),
        joins=tuple(join or ()),
        names=tuple(as_ or ()),
        salvage=salvage,
        out=out,
        as_json=as_json,
        model=model,
        config_path=config,
    )
    sys.exit(run_annotate(options))


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
        raise AnnotationError("--export needs --out: a file for csv, angles and coco, else a folder")
    if options.as_json and not options.report:
        raise AnnotationError("--json is for --report; leave it out")
    if options.rows is not None:
        _check_rows(options)
    config = load_config(options.config_path, overrides=choose_model(options.model))
    given = options.paths or (Path(),)
    store_path = options.store or (given[0] if given[0].suffix == ".sqlite" else default_store(given))
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


def _check_rows(options: AnnotateOptions) -> None:
    """Raise AnnotationError where single rows of a session cannot be chosen."""
    if len(options.paths) != 1 or options.frames is not None:
        raise AnnotationError("--rows is for one session: give its folder, and no --frames")
    if options.study.name:
        raise AnnotationError("--rows is for annotations outside a study: leave out --study")
    if options.report or options.export is not None or options.imports or options.joins or options.salvage:
        raise AnnotationError("--rows is for the window; leave it out")


def _window(store_path: Path, paths: Sequence[Path], options: AnnotateOptions, config: Config) -> int:
    from app.ui.display import check_display

    check_display()
    from app.ui.window_base import make_application

    rater = rater_name(options.study)
    files = session_rows(paths[0], options.rows) if options.rows is not None else image_files(paths, options.frames)
    application = None
    while True:
        with AnnotationStore(store_path) as store:
            images = listed_images(files, store)
            items = queue_of(store, images, rater, options.study, config)
            compiled.load()  # drawing uses them, and may not wait
            application = application or make_application(own_config().window)
            sys.stderr.write(f"{len(items)} images for rater {rater}; every edit is saved at once, in {store_path}\n")
            code, next_rater = _rater_window(application, store, items, rater, paths, options, config)
        if code or not next_rater:
            return code
        rater = next_rater


def _rater_window(
    application: QApplication,
    store: AnnotationStore,
    items: Sequence[QueueEntry],
    rater: str,
    paths: Sequence[Path],
    options: AnnotateOptions,
    config: Config,
) -> tuple[int, str]:
    """One rater's window until it is closed; the exit code, and who annotates next."""
    from app.annotator.model import AnnotationModel
    from app.annotator.window import AnnotatorWindow
    from app.ui.actions import action_of
    from app.ui.layout_state import LayoutState
    from app.ui.opening import note_recent
    from app.ui.window_base import run_until_closed

    program_id()  # asks git once, before the rater begins
    name = options.study.name
    kept = store.study_settings(name) if name else None
    hides_angle = kept is not None and settings_from(kept, f"study {name!r}").hides_angle
    model = AnnotationModel(store, items, config.perception, blind=bool(name), hides_angle=hides_angle)
    print_warnings(store.problems)
    who = tr("study {name}, rater {rater}, blind", name=name, rater=rater) if name else tr("rater {rater}", rater=rater)
    window = AnnotatorWindow(model, who, paths)
    switches = {name: action_of(window, key) for name, key in _KEPT.items()}
    LayoutState(window, "annotator", window.panels.columns, switches=switches)
    if len(paths) == 1 and not name:  # opened again, a study would not be blind
        note_recent(paths[0])
    return run_until_closed(application, window, window.show_message), window.next_rater


def _report(store_path: Path, options: AnnotateOptions, config: Config) -> int:
    from app.annotator.comparison import groups_of_answered
    from app.commands.evaluation_report import agreement_page
    from core.annotation.agreement_report import (
        agreement_report,
        choose_study,
        group_notes,
        measured_alike,
        rater_notes,
        write_measures,
    )

    with AnnotationStore(store_path, read_only=True) as store:
        annotations = choose_study(store.annotations(), options.study.asked, str(store_path))
        images = store.images()
        annotations, notes = measured_alike(of_rater(annotations, options.study.rater), images, config.perception)
        names = {sha256: image.name for sha256, image in images.items()}
        chosen = annotations[0].key.study
        kept = store.study_settings(chosen) if chosen else None
        groups = groups_of_answered(annotations, {sha256: store_path.parent / name for sha256, name in names.items()})
        print_warnings([*store.problems, *rater_notes(annotations), *group_notes(annotations, groups), *notes])
    report: dict[str, Any] = {"study": chosen, "program": program_id()}
    report |= agreement_report(annotations, names, options.study.seed or 0, groups)
    if chosen:
        report["hides_angle"] = kept is not None and settings_from(kept, f"study {chosen!r}").hides_angle
    if options.out is not None:
        try:
            options.out.mkdir(parents=True, exist_ok=True)
            text = json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False)
            (options.out / "agreement.json").write_text(text + "\n", encoding="utf-8")
            write_measures(options.out / "measures.csv", report["measures"])
            write_atomic(options.out / "report.html", agreement_page(report).encode())
        except OSError as error:
            raise AnnotationError(
                f"{error.filename or options.out}: cannot be written ({error.strerror}); choose another --out"
            ) from None
    if options.as_json:
        sys.stdout.write(json.dumps(report, allow_nan=False) + "\n")
    else:
        from app.annotator.comparison import print_agreement

        print_agreement(report)
        if options.out is not None:
            sys.stderr.write(f"report.html, agreement.json and measures.csv are in {options.out}\n")
    return 0
