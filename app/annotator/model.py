"""What the annotator window works on: the queue of images, the one in hand, its edits; disk and network in threads of their own."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QEventLoop, QObject, QTimer, Signal

from app.ui.workers import Worker
from app.widgets.image_canvas import halvings
from core.annotation.exchange import Proposal, proposal_of
from core.annotation.model import (
    Annotation,
    AnnotationError,
    History,
    ImageView,
    JournalEntry,
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
_SETTLE_S = 1.0
_RETRY_MS = 3000
_KEPT_IMAGES = 4
_IDLE_S = 60.0

Perceive = Callable[[Frame], Scene]


@dataclass(frozen=True, slots=True)
class QueueEntry:
    """One entry of the queue: an image, as it is shown, and under which key its annotation is kept."""

    image: FoundImage
    key: ItemKey
    view: ImageView = ImageView.AS_IS


@dataclass(frozen=True, slots=True, eq=False)
class LoadedItem:
    """An image as it is shown, with its halvings, and the edits that were made on it before."""

    levels: tuple[Image, ...]
    history: History


class AnnotationModel(QObject):
    """The model of the annotator window. Annotations go in and out as they lie in the view; the store has them in source pixels.

    ``opened`` comes when the chosen item is loaded; ``changed`` after every edit, undo and redo of it; ``listed`` with the place of
    an item whose status changed; ``saved`` when all is on the disk; ``failed`` with one line and whether edits wait to be written;
    ``proposed`` when there is a proposal for the item in hand.
    """

    opened = Signal()
    changed = Signal()
    listed = Signal(int)
    saved = Signal()
    failed = Signal(str, bool)
    proposed = Signal()

    def __init__(
        self,
        store: AnnotationStore,
        items: Sequence[QueueEntry],
        config: PerceptionConfig,
        *,
        blind: bool,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._store = store
        self.items = tuple(items)
        self.config = config
        self.blind = blind
        self.index = -1
        self._loaded: dict[int, LoadedItem] = {}
        self._contents: dict[ItemKey, Annotation] = {}
        self._status: dict[ItemKey, Status] = {}
        self._times: dict[ItemKey, float] = {}
        self._proposals: dict[str, Proposal] = {}
        self._looks: set[ItemKey] = set()
        self._histories: dict[int, History] = {}
        self._perceive: Perceive | None = None
        self._to_write: deque[Callable[[], None]] = deque()
        self._retry = QTimer(self)
        self._retry.setSingleShot(True)
        self._retry.setInterval(_RETRY_MS)
        self._is_shut = False
        self._last_sign_s = self._counted_s = time.monotonic()
        self._loading, self._saving = (Worker(name, self) for name in ("loading", "saving"))
        self._perceiving = Worker("perceiving", self, behind=True)
        self._retry.timeout.connect(lambda: self._saving.submit("edit", self._write_all))
        self._loading.done.connect(self._on_loaded)
        self._loading.failed.connect(self._on_load_failed)
        self._saving.done.connect(self._on_saved)
        self._saving.failed.connect(self._on_save_failed)
        self._perceiving.done.connect(self._on_perceived)
        self._perceiving.failed.connect(self._on_perceive_failed)
        self._read_annotations()

    def _read_annotations(self) -> None:
        """All that is kept of the queue, before the window opens: a few kilobytes an image."""
        if not self.items:
            return
        key = self.items[0].key
        for one in self._store.annotations(key.study, key.rater):
            self._contents[one.key] = one.content
            self._status[one.key] = status_of(one.content, measured=one.theta_deg is not None)
            self._times[one.key] = one.time_spent_s

    @property
    def store_path(self) -> Path:
        return self._store.path

    @property
    def store(self) -> AnnotationStore:
        """The open file; its methods may be called from any thread."""
        return self._store

    # ---- the item in hand

    @property
    def item(self) -> QueueEntry | None:
        return self.items[self.index] if 0 <= self.index < len(self.items) else None

    @property
    def is_open(self) -> bool:
        """Whether the item in hand is loaded."""
        return self.index in self._loaded

    @property
    def levels(self) -> tuple[Image, ...]:
        return self._loaded[self.index].levels

    @property
    def annotation(self) -> Annotation:
        """As it lies in the view."""
        item = self.item
        if item is None:
            return Annotation()
        return turn_annotation(self._contents.get(item.key, Annotation()), item.view, item.image.record.size)

    @property
    def history(self) -> History:
        """Of the item in hand; empty until it is loaded."""
        return self._histories.get(self.index) or History()

    def status(self, place: int) -> Status:
        return self._status.get(self.items[place].key, Status.NEW)

    def has_masks(self, place: int) -> bool:
        content = self._contents.get(self.items[place].key)
        return content is not None and bool(content.masks)

    @property
    def finished(self) -> int:
        """How many items are answered."""
        return sum(self.status(place) in (Status.DONE, Status.CANNOT_TELL) for place in range(len(self.items)))

    @property
    def unsaved(self) -> int:
        """Edits that are not on the disk yet."""
        return len(self._to_write)

    def measure(self, shown: Annotation) -> Readout:
        """The readout of an annotation as it lies in the view, in the view's own pixels."""
        item = self.item
        return measure_lines(shown, item.image.record.size, self.config) if item is not None else Readout()

    # ---- going through the queue

    def open(self, place: int) -> None:
        """Take an item in hand; it is there when ``opened`` comes (at once when it was fetched before)."""
        if not 0 <= place < len(self.items) or self._is_shut:
            return
        self._keep_time()
        self.index = place
        if place in self._loaded:
            self.opened.emit()
        else:
            self._load(place, urgent=True)
        for near in (place + 1, place - 1):
            if 0 <= near < len(self.items) and near not in self._loaded:
                self._load(near)

    def next_open(self, start: int, step: int = 1) -> int | None:
        """The next item that is not answered, around the end; None when all are."""
        count = len(self.items)
        places = ((start + step * k) % count for k in range(1, count + 1))
        return next((place for place in places if self.status(place) in (Status.NEW, Status.BEGUN)), None)

    def _load(self, place: int, *, urgent: bool = False) -> None:
        item, store = self.items[place], self._store

        def load() -> LoadedItem:
            image = read_image(item.image.path)
            if (image.shape[1], image.shape[0]) != item.image.record.size:
                raise AnnotationError(f"{item.image.path}: has changed since it was listed; start annotate again")
            return LoadedItem(halvings(turn_image(image, item.view)), store.history(item.key))

        self._loading.submit(place, load, urgent=urgent, once=True)

    def _on_loaded(self, place: int, loaded: LoadedItem) -> None:
        if place in self._loaded:
            return  # asked for once more before the first answer was heard: what has been begun since stays
        self._loaded[place] = loaded
        if place not in self._histories:  # one that was edited meanwhile knows more than the disk
            history, kept = loaded.history, self._contents.get(self.items[place].key)
            self._histories[place] = history
            if kept is None:  # never begun, or its record is damaged: then the journal has what it said
                self._write(place, history.renewed("restored"), history.current)
            elif history.current != kept:  # the journal is damaged: what counts is the annotation
                self._write(place, history.edit("restored", kept), kept)
        while len(self._loaded) > _KEPT_IMAGES:
            del self._loaded[max(self._loaded, key=lambda other: abs(other - self.index))]
        if place == self.index:
            self.opened.emit()

    def _on_load_failed(self, place: int, line: str) -> None:
        if place == self.index:
            self.failed.emit(line, False)

    # ---- edits

    def edit(self, action: str, shown: Annotation) -> None:
        """Put an annotation (as it lies in the view) in force and on the disk."""
        item = self.item
        if item is None or not self.is_open:
            return
        content = turn_annotation(shown, item.view, item.image.record.size)
        self._apply(self.history.edit(action, content))

    def undo(self) -> None:
        self._apply(self.history.undo() if self.is_open else None)

    def redo(self) -> None:
        self._apply(self.history.redo() if self.is_open else None)

    def _apply(self, entry: JournalEntry | None) -> None:
        if entry is not None:
            self._write(self.index, entry, self.history.current)
        self.changed.emit()

    def _write(self, place: int, entry: JournalEntry | None, content: Annotation) -> None:
        if entry is None:
            return
        item, store = self.items[place], self._store
        readout = measure_lines(content, item.image.record.size, self.config)
        self._count_time()
        spent = self._times.get(item.key, 0.0)
        self._contents[item.key] = content
        self._status[item.key] = status_of(content, measured=readout.pose is not None)
        self._to_write.append(lambda: store.save(item.key, item.view, entry, content, readout, spent))
        self._saving.submit("edit", self._write_all)
        self.listed.emit(place)

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

    def sign_of_life(self) -> None:
        """The rater did something: time counts on."""
        self._count_time()
        self._last_sign_s = time.monotonic()

    def _count_time(self) -> None:
        """Time since the last count, as far as the rater was at work: a coffee break is none."""
        now = time.monotonic()
        worked = min(now, self._last_sign_s + _IDLE_S) - self._counted_s
        self._counted_s = now
        if worked > 0 and self.item is not None and self.is_open:
            self._times[self.item.key] = self._times.get(self.item.key, 0.0) + worked

    def _keep_time(self) -> None:
        self._count_time()
        item, store = self.item, self._store
        if item is not None and item.key in self._contents:
            spent = self._times.get(item.key, 0.0)
            self._saving.submit("time", lambda: store.save_time(item.key, spent))
        self._last_sign_s = time.monotonic()

    # ---- the algorithm

    @property
    def proposal(self) -> Proposal | None:
        """For the item in hand, as it lies in the view; None: not asked for yet, or a blind study."""
        item = self.item
        if item is None or self.blind or item.image.sha256 not in self._proposals:
            return None
        return self._proposals[item.image.sha256]

    def propose(self) -> None:
        """Ask the algorithm; ``proposed`` comes when it has answered. Never in a blind study."""
        item = self.item
        if item is None or self.blind:
            return
        if self.proposal is not None:
            self.proposed.emit()
            return
        sha256, path = item.image.sha256, item.image.path

        def perceive() -> Proposal:
            if self._perceive is None:
                self._perceive = open_pipeline(self.config).perceive_single
            return proposal_of(self._perceive(Frame(0, 0.0, read_image(path))))

        self._perceiving.submit(sha256, perceive, urgent=True, once=True)

    def keep_look(self) -> None:
        """The rater sees the algorithm's answer to the item in hand: what he draws from now on is told apart."""
        item, store = self.item, self._store
        if item is None or self.proposal is None or item.key in self._looks:
            return
        self._looks.add(item.key)
        after = self.history.last
        self._to_write.append(lambda: store.keep_look(item.key, after))
        self._saving.submit("edit", self._write_all)

    def _on_perceived(self, sha256: str, proposal: Proposal) -> None:
        self._proposals[sha256] = proposal
        if self.item is not None and self.item.image.sha256 == sha256:
            self.proposed.emit()

    def _on_perceive_failed(self, _sha256: str, line: str) -> None:
        self.failed.emit(line, False)

    # ---- the end

    def settle(self) -> None:
        """Give the disk a moment to take what waits: ``unsaved`` then tells what it does not take."""
        if self._to_write and not self._is_shut:
            self._saving.submit("edit", self._write_all, once=True)
        until_s = time.monotonic() + _SETTLE_S
        while self._saving.pending and time.monotonic() < until_s:  # the window goes on painting, and takes no further edit
            QCoreApplication.processEvents(QEventLoop.ProcessEventsFlag.ExcludeUserInputEvents, 5)
            time.sleep(0.002)

    def shut_down(self) -> tuple[str, ...]:
        """Finish writing and end the threads; a line for each that did not end in its time. What the disk refused is logged."""
        if self._is_shut:
            return ()
        self._keep_time()
        self._is_shut = True
        self._retry.stop()
        if self._to_write:
            self._saving.submit("edit", self._write_all)
        self._saving.stop(finish=True)
        for thread in (self._loading, self._perceiving):
            thread.stop(finish=False)
        running = [thread for thread in (self._saving, self._loading, self._perceiving) if not thread.wait(_SAVE_WITHIN_MS)]
        if not running:
            self._store.close()
        if self._to_write:
            _log.error("%d edits could not be written to %s", len(self._to_write), self.store_path)
        return tuple(f"{thread.objectName()} did not end in {_SAVE_WITHIN_MS / 1000:g} s" for thread in running)
