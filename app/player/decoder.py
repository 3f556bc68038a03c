"""Reads and decodes rows of a session away from the window: the newest request wins, and what comes next is read ahead.

A part of a session as a video with overlays, written by a thread of its own that can be told to stop.

What the player writes: notes into the session, snapshots and clips beside it. Nothing here waits for a disk.
"""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import QObject, QThread, Signal, Slot

from app.player.session_model import Replayed
from app.ui.i18n import tr
from app.ui.snapshot import Origin, SnapshotWriter
from app.ui.workers import Worker
from app.widgets.overlay_image import draw_overlay
from core.devices import Latest, UserError
from core.files import name_of
from core.session.codec import RecordedRow, light_tick
from core.session.export import export_mp4
from core.session.files import add_event, is_being_written
from core.session.manifest import Event, SessionError
from core.session.reader import SessionReader
from core.types import Image, Masks, Point, Points, Scene, Skeletons, Tick

_KEPT = 24
_KEPT_BYTES = 192_000_000
"""Of pictures: 24 of 1920 x 1080, 7 of 3840 x 2160."""
_AHEAD = 6
_FAR_PX, _FAR_SCALE, _FAST_MM_S = 1e5, 1e3, 1e3
_NO_GEOMETRY: dict[str, Any] = dict.fromkeys(("path", "vessel_graph", "route", "centerline", "robot_vector", "vessel_vector"))

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """Row number ``place``: None as ``row`` when it is damaged, None as ``tick`` when its picture is lost too.

    ``other`` is what a replay saw in it.
    """

    place: int
    row: RecordedRow | None
    tick: Tick | None
    other: Scene | None = None


class DecodeThread(QThread):
    """``ask`` from the window's thread, ``decoded`` says that ``take`` has something new."""

    decoded = Signal()
    failed = Signal(str)

    def __init__(self, reader: SessionReader, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("decode")
        self._reader = reader
        self._changed = threading.Condition()
        self._wanted: tuple[int, int] | None = None
        self._served: tuple[int, int] | None = None
        self._newest: Latest[Decoded] = Latest()
        self._stopping = False
        self.replayed: Callable[[int], Scene | None] | None = None
        self._kept: OrderedDict[int, Decoded] = OrderedDict()
        self._kept_bytes = 0

    def ask_again(self) -> None:
        """The same once more."""
        with self._changed:
            self._wanted = self._wanted or self._served
            self._changed.notify()

    def ask(self, place: int, step: int = 1) -> None:
        """The next to be shown; `step` is how far apart the following ones will be, 0: nothing is read ahead."""
        with self._changed:
            self._wanted = place, step
            self._changed.notify()
        if not self.isRunning():
            self.start()

    def take(self) -> Decoded | None:
        """The newest one that nobody has taken."""
        return self._newest.take()

    def stop(self) -> None:
        """Ask the thread to end; returns at once."""
        with self._changed:
            self._stopping = True
            self._changed.notify()

    def run(self) -> None:
        try:
            while (wanted := self._next()) is not None:
                self._serve(*wanted)
        except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible fault
            _log.error("decoding ended", exc_info=error)
            self.failed.emit(f"unexpected {type(error).__name__}: {' '.join(str(error).split())}")

    def _next(self) -> tuple[int, int] | None:
        with self._changed:
            while self._wanted is None and not self._stopping:
                self._changed.wait()
            wanted, self._wanted = self._wanted, None
            self._served = wanted or self._served
            return None if self._stopping else wanted

    def _serve(self, place: int, step: int) -> None:
        shown, replayed = self._decode(place), self.replayed
        if replayed is not None and shown.row is not None:
            other = replayed(shown.row.row)
            shown = replace(shown, other=_drawable(other) if other is not None else None)
        if self._newest.put(shown):
            self.decoded.emit()
        for k in range(1, self._ahead(shown) + 1 if step else 0):
            ahead = place + k * step
            with self._changed:
                if self._wanted is not None or self._stopping:
                    return
            if 0 <= ahead < len(self._reader):
                self._decode(ahead)

    def _decode(self, place: int) -> Decoded:
        if place in self._kept:
            self._kept.move_to_end(place)
            return self._kept[place]
        try:
            row, tick = self._reader.row(place), self._reader.tick(place)
        except IndexError:
            row = tick = None
        found = Decoded(place, row, drawable(light_tick(tick)) if tick is not None else None)
        self._kept[place] = found
        self._kept_bytes += _size(found)
        while len(self._kept) > _KEPT or (self._kept_bytes > _KEPT_BYTES and len(self._kept) > 1):
            self._kept_bytes -= _size(self._kept.popitem(last=False)[1])
        return found

    @staticmethod
    def _ahead(shown: Decoded) -> int:
        """How many may be read ahead, so that what is shown, and the one before it, are still kept."""
        return min(_AHEAD, max(1, _KEPT_BYTES // max(1, _size(shown)) - 2))


def _size(decoded: Decoded) -> int:
    return decoded.tick.frame.image.nbytes if decoded.tick is not None else 0


def drawable(tick: Tick) -> Tick:
    """What the live picture can draw: without what is absurd in a damaged row, and with blank skeletons, which are not recorded."""
    advice = tick.advice
    if advice is not None and (abs(advice.advance_mm_s) > _FAST_MM_S or abs(advice.steer_deg) > 360.0):
        advice = None
    return replace(tick, scene=_drawable(tick.scene), advice=advice)


def _drawable(scene: Scene) -> Scene:
    if not _is_in_reach(scene):
        return replace(scene, scale=1.0, scale_xy=None, masks=None, skeletons=None, **_NO_GEOMETRY)
    skeletons, masks = scene.skeletons, scene.masks
    if skeletons is None or masks is None:
        return scene
    blank = _blank(masks)
    return replace(scene, skeletons=Skeletons(blank, blank, skeletons.bridges))


def _is_in_reach(scene: Scene) -> bool:
    """Lines to the end of the world take seconds to paint, and no perception gives them."""
    across, down = scene.scale_xy or (scene.scale, scene.scale)
    if not all(1 / _FAR_SCALE <= scale <= _FAR_SCALE for scale in (across, down, scene.scale)):
        return False
    lines: list[Points] = [] if scene.path is None else [scene.path.points]
    lines += [] if scene.route is None else [scene.route.points]
    lines += [] if scene.centerline is None else [scene.centerline.piece]
    if not all(len(line) for line in lines):
        return False
    graph = scene.vessel_graph
    lines += [edge.points for edge in graph.edges] if graph is not None else []
    points: list[Point] = [] if scene.route is None else [scene.route.target]
    points += [] if scene.centerline is None else [scene.centerline.nearest]
    for vector in (scene.robot_vector, scene.vessel_vector):
        points += [vector.start, vector.center, vector.end] if vector is not None else []
    points += [end for bridge in scene.skeletons.bridges for end in bridge] if scene.skeletons is not None else []
    everything = [*(np.ravel(line) for line in lines), *(np.ravel(point) for point in points)]
    return not everything or float(np.abs(np.concatenate(everything)).max(initial=0.0)) < _FAR_PX


def _blank(masks: Masks) -> np.ndarray:
    return np.zeros(masks.vessel.shape, bool)


_REPORTS = 100
_LOOK_S = 0.05


@dataclass(frozen=True, slots=True)
class Clip:
    """Rows from `first` to `last` (not included) of a session, into a file that is not there yet. ``kind`` is burnt in."""

    session: Path
    out: Path
    first: int
    last: int
    kind: str


class _Stopped(UserError):
    """Told to stop."""


class ClipExporter(QThread):
    """One clip. It reads the session by itself, so that playing goes on beside it.

    ``progressed`` carries 0..1; ``ended`` a line to show and whether it went wrong.
    """

    progressed = Signal(object)
    ended = Signal(str, bool)

    def __init__(self, clip: Clip, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("clip")
        self._clip = clip
        self._stop = threading.Event()
        self._done = 0

    def cancel(self) -> None:
        """Stop soon; nothing is left of the file."""
        self._stop.set()

    def run(self) -> None:
        clip = self._clip
        try:
            with SessionReader(clip.session) as reader:
                while not reader.wait(_LOOK_S):
                    self._check()
                written = export_mp4(reader, clip.out, self._draw, first=clip.first, last=clip.last, on_row=self._on_row)
        except _Stopped:
            self.ended.emit(tr("Clip cancelled; nothing was kept"), False)
        except UserError as error:
            self.ended.emit(tr("Clip not saved: {why}", why=error), True)
        except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible fault
            _log.error("the clip was not written", exc_info=error)
            self.ended.emit(
                tr("Clip not saved: unexpected {kind}: {why}", kind=type(error).__name__, why=" ".join(str(error).split())), True
            )
        else:
            lost = clip.last - clip.first - written
            note = tr(", {count} pictures are lost", count=lost) if lost > 0 else ""
            self.ended.emit(tr("Clip saved: {file} ({count} pictures{note})", file=clip.out, count=written, note=note), False)

    def _draw(self, tick: Tick) -> Image:
        return draw_overlay(tick.frame.image, tick.scene, tick.advice, stamp=f"{self._clip.kind} PLAYBACK")

    def _check(self) -> None:
        if self._stop.is_set():
            raise _Stopped("cancelled")

    def _on_row(self) -> None:
        self._check()
        self._done += 1
        count = max(1, self._clip.last - self._clip.first)
        if self._done % max(1, count // _REPORTS) == 0 or self._done == count:
            self.progressed.emit(self._done / count)


def clip_path(folder: Path, session: Path, first_s: float, last_s: float) -> Path:
    """A file name that tells what is in it and is not there yet."""
    name = f"{name_of(session)}_{round(first_s * 1000)}-{round(last_s * 1000)}ms"
    path, k = folder / f"{name}.mp4", 1
    while path.exists():
        k += 1
        path = folder / f"{name}_{k}.mp4"
    return path


_STOP_WITHIN_MS = 10_000


class PlayerSessionLoader(QObject):
    """Also reads the events, which are a file of their own.

    ``said`` carries a line to show and whether it is a fault; ``events_read`` the events and whether the session is still being
    recorded; ``replayed_read`` a replay's results; ``noted`` a note that is kept, ``note_refused`` one that the disk did not take;
    ``progressed`` the share of the clip that is written, None when none is.
    """

    said = Signal(str, bool)
    events_read = Signal(object, bool)
    noted = Signal(object)
    note_refused = Signal(object)
    replayed_read = Signal(object)
    progressed = Signal(object)

    def __init__(self, reader: SessionReader, folder: Path, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._reader = reader
        self._folder = folder
        manifest = reader.manifest
        self._kind = manifest.kind if manifest is not None else "UNKNOWN"
        self._model = manifest.model.get("name") if manifest is not None else None
        self._clip: ClipExporter | None = None
        self._work = Worker("player work", self)
        self._work.done.connect(self._on_done)
        self._work.failed.connect(self._on_failed)
        self._snapshots = SnapshotWriter(folder, self)
        self._snapshots.saved.connect(lambda line: self.said.emit(line, False))
        self._snapshots.failed.connect(lambda line: self.said.emit(line, True))

    @property
    def has_clip(self) -> bool:
        """Is a clip being written?"""
        return self._clip is not None

    def read_events(self) -> None:
        self._work.submit("events", lambda: (self._reader.events, is_being_written(self._reader.folder)))

    def read_replayed(self, path: Path) -> None:
        """Results of a replay of this session."""
        self._work.submit("replayed", lambda: Replayed(path, name_of(self._reader.folder)))

    def add_note(self, event: Event) -> None:
        """Into the session's own file."""
        self._work.submit(event, partial(_add, self._reader.folder, event))

    def take_snapshot(self, tick: Tick) -> None:
        """Plain, with overlays, and its values."""
        self._snapshots.write(tick, Origin(f"{self._kind} PLAYBACK", None, self._model))

    def write_clip(self, places: tuple[int, int], times_s: tuple[float, float]) -> None:
        """Rows from the first to the last of `places` (included), named by their times."""
        if self._clip is not None:
            self.said.emit(tr("A clip is being written already; Esc cancels it"), False)
            return
        out = clip_path(self._folder, self._reader.folder, *times_s)
        self._clip = ClipExporter(Clip(self._reader.folder, out, places[0], places[1] + 1, self._kind), self)
        self._clip.progressed.connect(self.progressed)
        self._clip.ended.connect(self._on_clip_ended)
        self.progressed.emit(0.0)
        self._clip.start()

    @Slot()
    def cancel_clip(self) -> None:
        if self._clip is not None:
            self._clip.cancel()

    @Slot(str, bool)
    def _on_clip_ended(self, line: str, is_fault: bool) -> None:
        if self._clip is not None:
            self._clip.wait(_STOP_WITHIN_MS)
            self._clip.deleteLater()
            self._clip = None
        self.progressed.emit(None)
        self.said.emit(line, is_fault)

    @Slot(object, object)
    def _on_done(self, key: object, result: object) -> None:
        if key == "events":
            assert isinstance(result, tuple)
            self.events_read.emit(*result)
        elif key == "replayed":
            self.replayed_read.emit(result)
        else:
            self.noted.emit(result)

    @Slot(object, str)
    def _on_failed(self, key: object, line: str) -> None:
        self.said.emit(line, True)
        if isinstance(key, Event):
            self.note_refused.emit(key)

    def shut_down(self) -> bool:
        """Finish notes and snapshots, give a clip up; False when the disk does not answer."""
        self._work.stop(finish=True)
        if self._clip is not None:
            self._clip.cancel()
        has_ended = self._work.wait(_STOP_WITHIN_MS)
        has_ended = has_ended and (self._clip is None or self._clip.wait(_STOP_WITHIN_MS))
        return self._snapshots.finish() and has_ended


def _add(folder: Path, event: Event) -> Event:
    try:
        return add_event(folder, event)
    except SessionError:
        _log.warning("a note was not kept: %s", event.text)  # whoever wrote it may have left by now
        raise
