"""The model of the annotator window: the queue of images, the open one, its edits; files and the algorithm in their own threads."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QEventLoop, QObject, QTimer, Signal

from app.ui.workers import Worker
from app.widgets.image_canvas import halvings
from core.annotation.carry import carried_masks
from core.annotation.exchange import Proposal, merged, proposal_of
from core.annotation.follow import followed_lines
from core.annotation.formats import Imported, read_files
from core.annotation.model import (
    ANSWERED,
    FOLLOWS_LINES,
    AngleProvenance,
    Annotation,
    AnnotationError,
    History,
    ImageView,
    JournalEntry,
    Line,
    MaskTarget,
    Readout,
    Status,
    measure_lines,
    status_of,
    turn_annotation,
    turn_image,
)
from core.annotation.store import AnnotationStore, FoundImage, ItemKey
from core.config.models import PerceptionConfig
from core.files import read_image
from core.perception.pipeline import open_pipeline
from core.types import Frame, Image, Scene

_log = logging.getLogger(__name__)

_SAVE_WITHIN_MS = 20_000
"""How long closing waits for each thread."""
_SETTLE_S = 1.0
"""How long ``settle`` waits for the disk."""
_RETRY_MS = 3000
"""Edits that could not be written are tried again after this time."""
_KEPT_IMAGES = 4
"""Decoded images in memory."""
_IDLE_S = 60.0
"""Without mouse or key for longer than this the rater is not at work: the time does not count."""


@dataclass(frozen=True, slots=True)
class QueueEntry:
    """One image of the queue, how it is shown, and under which key its annotation is stored."""

    image: FoundImage
    key: ItemKey
    view: ImageView = ImageView.AS_IS


class AnnotationModel(QObject):
    """Queue, edits and proposals. Annotations go in and out as they lie in the view; the store has them in source pixels.

    ``opened`` comes when the chosen item is loaded; ``changed`` after every edit, undo and redo of it; ``status_changed`` with the
    place of an item; ``imported`` with the number of images that got something from other programs' files, and lines on what was
    left out; ``saved`` when everything is on the disk; ``failed`` with one line and whether edits wait to be written;
    ``proposed`` when there is a proposal for the open item; ``carried`` with masks that another image's lead to, as an
    annotation of the open item, and that image's name; ``following`` with how many images of how many are done; ``followed`` with
    the number of images whose lines were changed.

    Parameters
    ----------
    store : its methods may be called from any thread.
    blind : a study in which the algorithm's answer and the names are hidden.
    hides_angle : theta, and the state that the lines give, are shown only once an image is answered.
    """

    opened = Signal()
    changed = Signal()
    status_changed = Signal(int)
    saved = Signal()
    failed = Signal(str, bool)
    proposed = Signal()
    carried = Signal(object, str)
    imported = Signal(int, object)
    following = Signal(int, int)
    followed = Signal(int)

    def __init__(
        self,
        store: AnnotationStore,
        items: Sequence[QueueEntry],
        config: PerceptionConfig,
        *,
        blind: bool,
        hides_angle: bool = False,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self.store = store
        self.items = tuple(items)
        self.config = config
        self.blind, self._hides_angle = blind, hides_angle
        self.index = -1
        self._levels: dict[int, tuple[Image, ...]] = {}
        self._histories: dict[int, History] = {}
        self._contents: dict[ItemKey, Annotation] = {}
        self._status: dict[ItemKey, Status] = {}
        self._provenance: dict[ItemKey, AngleProvenance] = {}
        self._short: dict[ItemKey, bool] = {}
        self._times: dict[ItemKey, float] = {}
        self._proposals: dict[str, Proposal] = {}
        self._seen_proposals: set[ItemKey] = set()
        self._perceive: Callable[[Frame], Scene] | None = None
        self._to_write: deque[Callable[[], None]] = deque()
        self._is_shut = False
        self._last_activity_s = self._counted_s = time.monotonic()
        self._loading, self._saving = (Worker(name, self) for name in ("loading", "saving"))
        self._perceiving = Worker("perceiving", self, behind=True)
        self._retry = QTimer(self, singleShot=True, interval=_RETRY_MS)
        self._retry.timeout.connect(lambda: self._saving.submit("edit", self._write_all))
        self._loading.done.connect(self._on_loaded)
        self._loading.failed.connect(lambda place, line: self.failed.emit(line, False) if place == self.index else None)
        self._saving.done.connect(self._on_saved)
        self._saving.failed.connect(self._on_save_failed)
        self._perceiving.done.connect(self._on_perceived)
        self._perceiving.failed.connect(lambda _sha256, line: self.failed.emit(line, False))
        self._carrying = Worker("carrying", self, latest_only=True)
        self._carrying.done.connect(self._on_carried)
        self._carrying.failed.connect(lambda _place, line: self.failed.emit(line, False))
        self._tracking = Worker("following", self, latest_only=True, behind=True)
        self._tracking.done.connect(self._on_followed)
        self._tracking.failed.connect(self._on_not_followed)
        self._goes_on = False
        self._importing = Worker("importing", self)
        self._importing.done.connect(self._on_read)
        self._importing.failed.connect(lambda _paths, line: self.failed.emit(line, False))
        if self.items:
            key = self.items[0].key
            for one in store.annotations(key.study, key.rater):
                self._contents[one.key] = one.content
                self._status[one.key] = status_of(one.content, measured=one.theta_deg is not None)
                self._provenance[one.key] = one.provenance
                self._times[one.key] = one.time_spent_s

    # ---- the open item

    @property
    def item(self) -> QueueEntry | None:
        return self.items[self.index] if 0 <= self.index < len(self.items) else None

    @property
    def is_open(self) -> bool:
        return self.index in self._levels

    @property
    def levels(self) -> tuple[Image, ...]:
        """The image as it is shown, with its halvings."""
        return self._levels[self.index]

    @property
    def annotation(self) -> Annotation:
        item = self.item
        return self._in_view(self._contents.get(item.key, Annotation())) if item is not None else Annotation()

    @property
    def history(self) -> History:
        """Empty until the item is loaded."""
        return self._histories.get(self.index) or History()

    def status(self, place: int) -> Status:
        return self._status.get(self.items[place].key, Status.NEW)

    def content(self, place: int) -> Annotation:
        """What is kept of an item, in source pixels."""
        return self._contents.get(self.items[place].key, Annotation())

    def provenance(self, place: int) -> AngleProvenance:
        """Where the lines of an item come from."""
        return self._provenance.get(self.items[place].key, AngleProvenance.MANUAL)

    def is_short(self, place: int) -> bool:
        """Whether a line of an item is shorter than the fit wants; measured when it is first asked for."""
        item = self.items[place]
        if item.key not in self._short:
            self._short[item.key] = measure_lines(self.content(place), item.image.record.size, self.config).is_short
        return self._short[item.key]

    @property
    def finished(self) -> int:
        return sum(self.status(place) in ANSWERED for place in range(len(self.items)))

    @property
    def unsaved(self) -> int:
        return len(self._to_write)

    def measure(self, shown: Annotation) -> Readout:
        """The readout of an annotation as it lies in the view, in the view's own pixels."""
        item = self.item
        return measure_lines(shown, item.image.record.size, self.config) if item is not None else Readout()

    @property
    def is_hidden(self) -> bool:
        """Whether the rater may not see theta and the state of the lines yet."""
        return self._hides_angle and self.item is not None and self.status(self.index) not in ANSWERED

    def shown_readout(self, shown: Annotation) -> Readout:
        """``measure`` as the rater may see it."""
        readout = self.measure(shown)
        if not self.is_hidden:
            return readout
        return replace(readout, robot_vector=None, vessel_vector=None, pose=None, is_hidden=readout.pose is not None)

    def _in_view(self, annotation: Annotation) -> Annotation:
        """From source pixels into the view of the open item, or back: each view is its own inverse."""
        item = self.item
        return turn_annotation(annotation, item.view, item.image.record.size) if item is not None else annotation

    # ---- going through the queue

    def open(self, place: int) -> None:
        """Open an item; it is there when ``opened`` comes (at once when it was loaded before)."""
        if not 0 <= place < len(self.items) or self._is_shut:
            return
        self._save_time()
        self.index = place
        if place in self._levels:
            self.opened.emit()
        for near in (place, place + 1, place - 1):
            if 0 <= near < len(self.items) and near not in self._levels:
                self._load(near, urgent=near == place)

    def next_open(self, start: int) -> int | None:
        """The next item that is not answered, around the end; None when all are."""
        count = len(self.items)
        places = ((start + k) % count for k in range(1, count + 1))
        return next((place for place in places if self.status(place) in (Status.NEW, Status.BEGUN)), None)

    def _load(self, place: int, *, urgent: bool) -> None:
        item, store = self.items[place], self.store

        def load() -> tuple[tuple[Image, ...], History]:
            image = read_image(item.image.path)
            if (image.shape[1], image.shape[0]) != item.image.record.size:
                raise AnnotationError(f"{item.image.path}: has changed since it was listed; start annotate again")
            return halvings(turn_image(image, item.view)), store.history(item.key)

        self._loading.submit(place, load, urgent=urgent, once=True)

    def _on_loaded(self, place: int, loaded: tuple[tuple[Image, ...], History]) -> None:
        if place in self._levels:
            return  # requested twice before the first answer came: edits made since stay
        self._levels[place], history = loaded
        if place not in self._histories:  # one that was edited meanwhile is newer than the disk
            self._histories[place] = history
            content = self._contents.get(self.items[place].key)
            if content is None:  # never begun, or its record is damaged: the journal counts
                self._write(place, history.renewed("restored"), history.current)
            elif history.current != content:  # the journal is damaged: the annotation counts
                self._write(place, history.edit("restored", content), content)
        while len(self._levels) > _KEPT_IMAGES:
            del self._levels[max(self._levels, key=lambda other: abs(other - self.index))]
        if place == self.index:
            self.opened.emit()

    # ---- edits

    def edit(self, action: str, shown: Annotation) -> None:
        """Put an annotation (as it lies in the view) in force and on the disk."""
        if self.is_open:
            self._apply(self.history.edit(action, self._in_view(shown)))

    def undo(self) -> None:
        self._apply(self.history.undo() if self.is_open else None)

    def redo(self) -> None:
        self._apply(self.history.redo() if self.is_open else None)

    def _apply(self, entry: JournalEntry | None) -> None:
        self._write(self.index, entry, self.history.current)
        self.changed.emit()

    def _write(self, place: int, entry: JournalEntry | None, content: Annotation) -> None:
        if entry is None:
            return
        item, store = self.items[place], self.store
        readout = measure_lines(content, item.image.record.size, self.config)
        self._count_time()
        spent = self._times.get(item.key, 0.0)
        self._contents[item.key] = content
        self._status[item.key] = status_of(content, measured=readout.pose is not None)
        self._short[item.key] = readout.is_short
        if place in self._histories:
            self._provenance[item.key] = self._histories[place].provenance
        self._to_write.append(lambda: store.save(item.key, item.view, entry, content, readout, spent))
        self._saving.submit("edit", self._write_all)
        self.status_changed.emit(place)

    def _write_all(self) -> None:
        """In the saving thread: everything that waits, in order. What fails stays in front and is tried again."""
        while self._to_write:
            self._to_write[0]()
            self._to_write.popleft()

    def _on_saved(self, _key: object, _result: object) -> None:
        if not self._to_write:
            self.saved.emit()

    def _on_save_failed(self, key: object, line: str) -> None:
        self.failed.emit(line, key == "edit")
        if self._to_write and not self._is_shut:
            self._retry.start()

    # ---- time

    def record_activity(self) -> None:
        """The rater did something: time counts on."""
        self._count_time()
        self._last_activity_s = time.monotonic()

    def _count_time(self) -> None:
        now = time.monotonic()
        worked = min(now, self._last_activity_s + _IDLE_S) - self._counted_s
        self._counted_s = now
        if worked > 0 and self.item is not None and self.is_open:
            self._times[self.item.key] = self._times.get(self.item.key, 0.0) + worked

    def _save_time(self) -> None:
        self._count_time()
        item, store = self.item, self.store
        if item is not None and item.key in self._contents:
            spent = self._times.get(item.key, 0.0)
            self._saving.submit("time", lambda: store.save_time(item.key, spent))
        self._last_activity_s = time.monotonic()

    # ---- the algorithm

    @property
    def proposal(self) -> Proposal | None:
        """For the open item, in source pixels; None: not asked for yet, or a blind study."""
        item = self.item
        return None if item is None or self.blind else self._proposals.get(item.image.sha256)

    @property
    def proposed_annotation(self) -> Annotation:
        """That of the proposal, as it lies in the view."""
        return self._in_view(self.proposal.annotation) if self.proposal is not None else Annotation()

    def propose(self) -> None:
        """Ask the algorithm; ``proposed`` comes when it has answered. Never in a blind study."""
        item = self.item
        if item is None or self.blind:
            return
        if self.proposal is not None:
            self.proposed.emit()
            return
        path = item.image.path

        def perceive() -> Proposal:
            if self._perceive is None:
                self._perceive = open_pipeline(self.config).perceive_single
            return proposal_of(self._perceive(Frame(0, 0.0, read_image(path))))

        self._perceiving.submit(item.image.sha256, perceive, urgent=True, once=True)

    def record_proposal_seen(self) -> None:
        """The rater sees the algorithm's answer to the open item: later answers are told apart."""
        item, store = self.item, self.store
        if item is None or self.proposal is None or item.key in self._seen_proposals:
            return
        self._seen_proposals.add(item.key)
        after = self.history.last
        self._to_write.append(lambda: store.keep_look(item.key, after))
        self._saving.submit("edit", self._write_all)

    def _on_perceived(self, sha256: str, proposal: Proposal) -> None:
        self._proposals[sha256] = proposal
        if self.item is not None and self.item.image.sha256 == sha256:
            self.proposed.emit()

    # ---- masks of another image

    def carry(self) -> str:
        """Find the masks of the open item by those of the nearest image with a robot's mask, the ones before it first.

        ``carried`` comes when they are found. Returns that image's name; "" where there is no such image, or in a blind study.
        """
        item = self.item
        source = self._mask_source()
        if item is None or source is None or not self.is_open:
            return ""
        of, masks = self.items[source], self._contents[self.items[source].key].masks
        paths = of.image.path, item.image.path

        def find() -> tuple[Annotation, str]:
            before, image = (read_image(path) for path in paths)
            return Annotation(masks=carried_masks(before, masks, image)), paths[0].name

        self._carrying.submit(item.key, find)
        return paths[0].name

    def _mask_source(self) -> int | None:
        item = self.item
        if item is None or self.blind:
            return None

        def fits(place: int) -> bool:
            image, content = self.items[place].image, self._contents.get(self.items[place].key)
            is_near = image.path.parent == item.image.path.parent and image.record.size == item.image.record.size
            return is_near and place != self.index and content is not None and MaskTarget.ROBOT in content.drawn

        places = (*range(self.index - 1, -1, -1), *range(self.index + 1, len(self.items)))
        return next((place for place in places if fits(place)), None)

    def _on_carried(self, key: object, found: tuple[Annotation, str]) -> None:
        if self.item is not None and self.item.key == key and self.is_open:
            self.carried.emit(self._in_view(found[0]), found[1])

    # ---- lines through a clip

    def follow(self) -> int:
        """Follow the lines of the open item's clip: the images of its folder and size, in the order of their names.

        Images whose lines were drawn or corrected are followed from; the others get lines, unless their answer is that there is
        no pose. Returns the number of those; 0 in a blind study, and where no image has both lines.
        """
        item = self.item
        if item is None or self.blind:
            return 0
        near = (item.image.path.parent, item.image.record.size)
        places = [k for k, one in enumerate(self.items) if (one.image.path.parent, one.image.record.size) == near]
        places.sort(key=lambda place: self.items[place].image.path.name)
        keys = {number: self.content(place) for number, place in enumerate(places) if self._is_own(place)}
        if not keys or len(keys) == len(places):
            return 0
        paths, count, store = [self.items[place].image.path for place in places], len(places) - len(keys), self.store
        unread = [place for place in places if place not in self._histories]
        self._goes_on = True

        def find() -> tuple[list[tuple[int, Line, Line]], dict[int, History]]:
            found = []
            lines = followed_lines(lambda number: read_image(paths[number]), keys, len(paths), lambda: self._goes_on)
            for number, robot, vessel in lines:
                found.append((places[number], robot, vessel))
                self.following.emit(len(found), count)
            return found, {place: store.history(self.items[place].key) for place in unread}

        self._tracking.submit(item.key, find)
        return count

    def stop_following(self) -> None:
        """What was followed so far is kept."""
        self._goes_on = False

    def _is_own(self, place: int) -> bool:
        """Whether an item has both lines, and not by following alone."""
        content = self.content(place)
        has_both = len(content.robot) > 1 and len(content.vessel) > 1
        return has_both and self.provenance(place) is not AngleProvenance.FOLLOWED

    def _on_followed(self, _key: object, found: tuple[list[tuple[int, Line, Line]], dict[int, History]]) -> None:
        lines, histories = found
        edits = (
            (place, FOLLOWS_LINES, replace(self.content(place), robot=robot, vessel=vessel))
            for place, robot, vessel in lines
            if not (self._is_own(place) or self.content(place).without_pose)  # drawn or answered meanwhile
        )
        self.followed.emit(self._edit_many(edits, histories))

    def _edit_many(self, edits: Iterable[tuple[int, str, Annotation]], histories: dict[int, History]) -> int:
        """Place, action and content of each, one after the other; how many items were changed."""
        changed = set()
        for place, action, content in edits:
            history = self._histories.get(place) or self._histories.setdefault(place, histories[place])
            if (entry := history.edit(action, content)) is not None:
                self._write(place, entry, content)
                changed.add(place)
        if self.index in changed:
            self.changed.emit()
        return len(changed)

    def _on_not_followed(self, _key: object, line: str) -> None:
        self.followed.emit(0)
        self.failed.emit(line, False)

    # ---- other programs' files

    def import_files(self, paths: Sequence[Path]) -> None:
        """Put the lines and masks of other programs' files into the items; ``imported`` comes when it is done."""
        store, loaded = self.store, set(self._histories)
        # Of the showings of one image the first.
        places = {item.image.sha256: place for place, item in reversed(list(enumerate(self.items)))}
        images = [item.image for item in self.items]

        def read() -> tuple[list[tuple[int, Imported]], list[str], dict[int, History]]:
            found, problems = read_files(paths, {image.sha256: image for image in images}.values())
            placed = [(places[one.image.sha256], one) for one in found]
            return placed, problems, {k: store.history(self.items[k].key) for k in {k for k, _ in placed} - loaded}

        self._importing.submit(tuple(paths), read)

    def _on_read(self, _paths: object, read: tuple[list[tuple[int, Imported]], list[str], dict[int, History]]) -> None:
        placed, problems, histories = read
        edits = ((place, f"import {one.source.name}", merged(self.content(place), one.content)) for place, one in placed)
        self.imported.emit(self._edit_many(edits, histories), problems)

    # ---- the end

    def settle(self) -> None:
        """Wait a moment for the disk: ``unsaved`` then tells what could not be written."""
        if self._to_write and not self._is_shut:
            self._saving.submit("edit", self._write_all, once=True)
        until_s = time.monotonic() + _SETTLE_S
        while self._saving.pending and time.monotonic() < until_s:  # the window goes on painting, and takes no further edit
            QCoreApplication.processEvents(QEventLoop.ProcessEventsFlag.ExcludeUserInputEvents, 5)
            time.sleep(0.002)

    def shut_down(self) -> tuple[str, ...]:
        """Finish writing and end the threads; a line for each that did not end in time."""
        if self._is_shut:
            return ()
        self._save_time()
        self._is_shut, self._goes_on = True, False
        self._retry.stop()
        if self._to_write:
            self._saving.submit("edit", self._write_all)
        self._saving.stop(finish=True)
        others = (self._loading, self._perceiving, self._carrying, self._importing)
        for thread in others:
            thread.stop(finish=False)
        running = [thread for thread in (self._saving, *others) if not thread.wait(_SAVE_WITHIN_MS)]
        if not running:
            self.store.close()
        if self._to_write:
            _log.error("%d edits could not be written to %s", len(self._to_write), self.store.path)
        return tuple(f"{thread.objectName()} did not end in {_SAVE_WITHIN_MS / 1000:g} s" for thread in running)
