"""Reads and decodes rows of a session away from the window: the newest request wins, and what comes next is read ahead."""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from PySide6.QtCore import QObject, QThread, Signal

from core.latest import Latest
from core.session.reader import SessionReader
from core.session.recorded import RecordedRow
from core.session.rows import light_tick
from core.types import Masks, Point, Points, Scene, Skeletons, Tick

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
