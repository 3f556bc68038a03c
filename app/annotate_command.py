"""``annotate``: ground truth by hand, alone or as a study of several raters; agreement, export, import."""

from __future__ import annotations

import getpass
import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from app.annotate_sources import FRAMES, asked_files, default_store, image_files, tell_problems
from app.language import tr
from app.long_work import progress_bar
from core.config import Config, choose_model, load_config
from core.perception.compiled import loops
from core.profiles import own_config
from core.study.annotation_images import FoundImage, find_images
from core.study.annotation_records import ItemKey, StoredAnnotation
from core.study.annotation_store import AnnotationStore
from core.study.annotations import Annotation, AnnotationError, View, measure_lines
from core.study.study_plan import Order, StudySettings, Task, queue_order, repeat_views, settings_from, tasks
from core.types import Frame

EXPORTS = ("dataset", "csv", "coco")
_DISAGREEMENT_DEG = 30.0


@dataclass(frozen=True, slots=True)
class StudyOptions:
    """What the command line says about the study; None where it says nothing, ``asked`` "" for what lies outside studies."""

    asked: str | None = None
    rater: str | None = None
    repeats: int | None = None
    mirror: bool = False
    turn: bool = False
    seed: int | None = None
    order: str | None = None

    @property
    def name(self) -> str:
        """In which answers are given; "" outside studies."""
        return self.asked or ""


@dataclass(frozen=True, slots=True)
class AnnotateOptions:
    """The command line of ``annotate``."""

    paths: tuple[Path, ...]
    store: Path | None = None
    study: StudyOptions = StudyOptions()
    frames: int | None = None
    """Of each video; None: those that were taken before, or ``FRAMES`` new ones."""
    report: bool = False
    export: str | None = None
    imports: tuple[Path, ...] = ()
    joins: tuple[Path, ...] = ()
    names: tuple[str, ...] = ()
    """Of raters in the files of `joins`, as THERE=HERE."""
    salvage: bool = False
    out: Path | None = None
    as_json: bool = False
    model: str | None = None
    config_path: Path | None = None


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
        return _salvage(store_path, options.out)
    if options.report:
        return _report(store_path, options, config)
    if options.export is not None:
        return _export(store_path, paths, options, config)
    if options.joins:
        return _join(store_path, options)
    if options.imports:
        return _import(store_path, paths, options, config)
    return _window(store_path, paths, options, config)


def _config(options: AnnotateOptions) -> Config:
    return load_config(options.config_path, overrides=choose_model(options.model))


def _store_of(paths: Sequence[Path]) -> Path:
    """A path that is an annotation file itself, or the file beside the images."""
    return paths[0] if paths[0].suffix == ".sqlite" else default_store(paths)


# ---- the window

_KEPT = (("loupe", "L"), ("masks", "K"))


def _window(store_path: Path, paths: Sequence[Path], options: AnnotateOptions, config: Config) -> int:
    from app.application import check_display, make_application, run_until_closed

    check_display()
    files = asked_files(paths, options.frames)
    with AnnotationStore(store_path) as store:
        images = _listed(files, store)
        rater = options.study.rater or _user()
        items = _queue(store, images, rater, options.study, config)
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


def _listed(files: Sequence[Path], store: AnnotationStore) -> list[FoundImage]:
    with progress_bar() as bar:
        task = bar.add_task("looking at the images", total=len(files))
        images, problems = find_images(files, store, lambda: bar.advance(task))
    tell_problems(problems)
    if not images:
        raise AnnotationError(f"{files[0].parent}: no image that can be read")
    return images


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):  # no name for this user id
        return "rater"


def _queue(store: AnnotationStore, images: Sequence[FoundImage], rater: str, options: StudyOptions, config: Config) -> list[Any]:
    """The items of the window: of the study, or every image once."""
    from app.annotation_desk import Item

    here = {image.sha256: image for image in images}
    if options.name:
        settings = _study(store, images, options, config)
        missing = [sha256 for sha256 in settings.images if sha256 not in here]
        others = len(set(here) - set(settings.images))
        tell_problems([f"{others} images are here that do not belong to study {options.name!r}; left out"] if others else [])
        if missing:
            names = store.images()
            tell_problems(
                [f"{names[m].name if m in names else m[:12]}: belongs to the study, but is not here; left out" for m in missing]
            )
        queue = [task for task in tasks(settings, rater) if task.sha256 in here]
        if not queue:
            raise AnnotationError(f"study {options.name!r}: none of its {len(settings.images)} images is here")
    else:
        if options.repeats not in (None, 1) or options.mirror or options.turn:
            raise AnnotationError("--repeats, --mirror and --turn belong to a study: give it a name with --study")
        order = _order(options.order, Order.LISTED)
        listed = [image.sha256 for image in images]
        if order is Order.RANDOM:
            queue = tasks(StudySettings(tuple(listed), seed=options.seed or 0), rater)
        else:
            queue = [Task(sha256) for sha256 in queue_order(listed, order, _sureness(store, images, order, config))]
    return [Item(here[t.sha256], ItemKey(t.sha256, options.name, rater, t.repeat), t.view) for t in queue]


def _order(name: str | None, default: Order) -> Order:
    if name is None:
        return default
    try:
        return Order(name)
    except ValueError:
        raise AnnotationError(f"--order {name}: must be one of {', '.join(Order)}") from None


def _study(store: AnnotationStore, images: Sequence[FoundImage], options: StudyOptions, config: Config) -> StudySettings:
    """The settings that the study was begun with; what the command line says must not contradict them."""
    kept = store.study_settings(options.name)
    if kept is None:
        order = _order(options.order, Order.RANDOM)
        views = repeat_views(options.repeats or 2, mirror=options.mirror, turn=options.turn)
        listed = queue_order([image.sha256 for image in images], order, _sureness(store, images, order, config))
        settings = StudySettings(listed, views, order, options.seed or 0)
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
    )
    if differs:
        shown = ", ".join(view.value for view in settings.views)
        was = f"shown {settings.repeats} times ({shown}), order {settings.order.value}, seed {settings.seed}"
        raise AnnotationError(f"study {options.name!r} was begun otherwise: {was}; leave these options out, or choose another name")
    return settings


def _sureness(store: AnnotationStore, images: Sequence[FoundImage], order: Order, config: Config) -> dict[str, float] | None:
    """How sure the algorithm is of each image (0: refused), for the order "worst".

    Where a rater has measured already, a disagreement takes away from it: half at 15 degrees, everything from 30 degrees on.
    """
    if order is not Order.WORST:
        return None
    from core.images import read_image
    from core.perception.pipeline import open_pipeline

    measured = {
        one.key.sha256: one.theta_deg for one in store.annotations() if one.theta_deg is not None and not one.content.cannot_tell
    }
    pipeline = open_pipeline(config.perception)
    sureness = {}
    with progress_bar() as bar:
        for image in bar.track(images, description="asking the algorithm"):
            pose = pipeline.perceive_single(Frame(0, 0.0, read_image(image.path))).pose
            sureness[image.sha256] = 0.0
            if pose is not None:
                differs_deg = abs(pose.theta_deg - measured.get(image.sha256, pose.theta_deg))
                sureness[image.sha256] = pose.confidence * max(0.0, 1.0 - differs_deg / _DISAGREEMENT_DEG)
    return sureness


# ---- agreement


def _report(store_path: Path, options: AnnotateOptions, config: Config) -> int:
    from app.annotate_evaluation import groups_of
    from core.study.annotation_measures import measured_alike
    from core.study.annotation_report import agreement_report, choose_study, rater_notes, write_measures

    with AnnotationStore(store_path, read_only=True) as store:
        annotations = choose_study(store.annotations(), options.study.asked, str(store_path))
        images = store.images()
        annotations, notes = measured_alike(_of_rater(annotations, options.study.rater), images, config.perception)
        names = {sha256: image.name for sha256, image in images.items()}
        tell_problems([*store.problems, *rater_notes(annotations), *notes])
    study = annotations[0].key.study
    paths = {sha256: store_path.parent / name for sha256, name in names.items()}
    places = groups_of(list(paths.values()))
    groups = {sha256: places[path] for sha256, path in paths.items()}
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


# ---- export, import, join, salvage


def _export(store_path: Path, paths: Sequence[Path], options: AnnotateOptions, config: Config) -> int:
    from core.study.annotation_export import export_coco, export_training_set
    from core.study.evaluation import write_measurements

    assert options.out is not None
    annotations, images = read_annotated(store_path, paths, options.frames or FRAMES)
    if options.study.asked is not None:
        annotations = [one for one in annotations if one.key.study == options.study.asked]
    annotations = _of_rater(annotations, options.study.rater)
    if options.export == "dataset":
        count, problems = export_training_set(annotations, images, options.out)
        tell_problems(problems)
        sys.stderr.write(f"{count} frames with both masks in {options.out}: train --data {options.out}\n")
    elif options.export == "coco":
        count = export_coco(annotations, images, options.out)
        sys.stderr.write(f"masks of {count} images in {options.out}\n")
    else:
        from app.annotate_evaluation import compared_rows, fitted_alike

        if options.out.exists():
            raise AnnotationError(f"{options.out}: is there already; choose another --out")
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


def _of_rater(annotations: list[StoredAnnotation], rater: str | None) -> list[StoredAnnotation]:
    """Those of one rater; None: of all. Raises AnnotationError where there are none."""
    if rater is None:
        return annotations
    own = [one for one in annotations if one.key.rater == rater]
    if not own:
        known = ", ".join(sorted({one.key.rater for one in annotations})) or "nobody"
        raise AnnotationError(f"--rater {rater}: has annotated nothing here; who has: {known}")
    return own


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
    from core.study.annotation_store import image_sha256

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


def _import(store_path: Path, paths: Sequence[Path], options: AnnotateOptions, config: Config) -> int:
    from core.study.annotation_import import merged, read_files

    sources = [file for path in options.imports for file in (sorted(path.glob("*.json")) if path.is_dir() else [path])]
    if not sources:
        raise AnnotationError(f"{options.imports[0]}: no .json file in it")
    if not any(source.is_file() for source in sources):  # before an annotation file is made for them
        raise AnnotationError(f"{sources[0]}: no such file; nothing was imported")
    files = asked_files(paths, options.frames)
    rater = options.study.rater or _user()
    counts: Counter[str] = Counter()
    with AnnotationStore(store_path) as store:
        images = _listed(files, store)
        imported, problems = read_files(sources, images)
        existing = {one.key: one.content for one in store.annotations(options.study.name, rater)}
        for one in imported:
            key = ItemKey(one.image.sha256, options.study.name, rater)
            history = store.history(key)
            old = existing.get(key, Annotation())
            content = merged(old, one.content)
            entry = history.edit(f"import {one.source.name}", content)
            if entry is None or content == old:
                problems.append(f"{one.source}: {one.image.path.name} has these annotations already; left as they are")
                continue
            store.save(key, View.AS_IS, entry, content, measure_lines(content, one.image.record.size, config.perception), 0.0)
            existing[key] = content
            counts[one.image.sha256] += 1
    tell_problems(problems)
    if not counts:
        raise AnnotationError("nothing was imported")
    sys.stderr.write(f"{len(counts)} images got annotations, for rater {rater}, in {store_path}\n")
    return 0


def _join(store_path: Path, options: AnnotateOptions) -> int:
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


def _salvage(store_path: Path, out: Path | None) -> int:
    from core.study.annotation_salvage import salvage

    target = out or store_path.with_name(f"salvaged_{store_path.name}")
    kept, problems = salvage(store_path, target)
    tell_problems(problems)
    sys.stderr.write(f"{kept} annotations saved into {target}; the damaged file is as it was\n")
    return 0
