"""Which pictures the window of ``annotate`` shows a rater, in which order: those of a study as it was begun, or every one once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from app.annotate_options import StudyOptions
from app.annotate_sources import tell_problems
from app.long_work import progress_bar
from core.config import Config
from core.study.annotation_images import FoundImage
from core.study.annotation_records import ItemKey
from core.study.annotation_store import AnnotationStore
from core.study.annotations import AnnotationError
from core.study.study_plan import Order, StudySettings, Task, queue_order, repeat_views, settings_from, tasks
from core.types import Frame

if TYPE_CHECKING:
    from app.annotation_desk import Item

_DISAGREEMENT_DEG = 30.0


def queue_of(store: AnnotationStore, images: Sequence[FoundImage], rater: str, options: StudyOptions, config: Config) -> list[Item]:
    """The items of the window: of the study, or every image once."""
    from app.annotation_desk import Item

    here = {image.sha256: image for image in images}
    if options.name:
        settings = _settings(store, images, options, config)
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


def _settings(store: AnnotationStore, images: Sequence[FoundImage], options: StudyOptions, config: Config) -> StudySettings:
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
