"""Rows of a session decoded in a thread: the newest request first, then the rows that are likely to follow."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from PySide6.QtCore import QObject, Signal

from app.player.replayed import Replayed
from app.ui.workers import Worker
from core.session.codec import RecordedRow, light_tick
from core.session.reader import SessionReader
from core.types import Point, Points, Scene, Skeletons, Tick

_KEPT = 24
_KEPT_BYTES = 192_000_000
"""Of pictures: 24 of 1920 x 1080, 7 of 3840 x 2160."""
_AHEAD = 6
"""So many rows are decoded ahead."""
_FAR_PX, _FAR_SCALE, _FAST_MM_S = 1e5, 1e3, 1e3
"""Beyond these limits recorded geometry, scale and advice are damaged."""
_NO_GEOMETRY: dict[str, Any] = dict.fromkeys(("path", "vessel_graph", "route", "centerline", "robot_vector", "vessel_vector"))


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """Row number ``place``: ``row``: None when it is damaged, ``tick`` when its picture is lost; ``other`` is of a replay."""

    place: int
    row: RecordedRow | None
    tick: Tick | None
    other: Scene | None = None

    @property
    def nbytes(self) -> int:
        return self.tick.frame.image.nbytes if self.tick is not None else 0


class FrameDecoder(QObject):
    """``decoded`` carries the row that was requested; of requests that come meanwhile only the last one counts."""

    decoded = Signal(object)
    failed = Signal(str)

    def __init__(self, reader: SessionReader, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.replayed: Replayed | None = None
        self._reader = reader
        self._place, self._step, self._requests = -1, 0, 0
        self._kept: OrderedDict[int, Decoded] = OrderedDict()
        self._kept_bytes = 0
        self.worker = Worker("decode", self, latest_only=True)
        self.worker.done.connect(self._on_done)
        self.worker.failed.connect(lambda _key, line: self.failed.emit(line))

    def request(self, place: int, step: int = 1) -> None:
        """The row to be shown; `step` is how far apart the following ones will be, 0: none is decoded ahead."""
        self._place, self._step = place, step
        self._requests += 1
        replayed = self.replayed
        self.worker.submit((self._requests, 0), lambda: self._with_replay(self._decode(place), replayed))

    def request_again(self) -> None:
        if self._place >= 0:
            self.request(self._place, self._step)

    def _on_done(self, key: tuple[int, int], found: Decoded) -> None:
        """Show the row, then decode those ahead one by one, until the next request.

        Only a job of the last request is followed by another: its row is decoded, so no request waits that the new job would
        replace. The row alone does not tell: it may have been requested once more.
        """
        request, count = key
        if count == 0:
            self.decoded.emit(found)
        ahead = self._place + (count + 1) * self._step
        if request == self._requests and self._step and count < self._ahead_count(found) and 0 <= ahead < len(self._reader):
            self.worker.submit((request, count + 1), lambda: self._decode(ahead))

    def _with_replay(self, shown: Decoded, replayed: Replayed | None) -> Decoded:
        if replayed is None or shown.row is None:
            return shown
        other = replayed.scene(shown.row.row)
        return replace(shown, other=_drawable(other) if other is not None else None)

    def _decode(self, place: int) -> Decoded:
        """In the thread."""
        if place in self._kept:
            self._kept.move_to_end(place)
            return self._kept[place]
        try:
            row, tick = self._reader.row(place), self._reader.tick(place)
        except IndexError:
            row = tick = None
        found = Decoded(place, row, drawable(light_tick(tick)) if tick is not None else None)
        self._kept[place] = found
        self._kept_bytes += found.nbytes
        while len(self._kept) > _KEPT or (self._kept_bytes > _KEPT_BYTES and len(self._kept) > 1):
            self._kept_bytes -= self._kept.popitem(last=False)[1].nbytes
        return found

    @staticmethod
    def _ahead_count(shown: Decoded) -> int:
        """How many may be decoded ahead, so that what is shown, and the one before it, are still kept."""
        return min(_AHEAD, max(1, _KEPT_BYTES // max(1, shown.nbytes) - 2))


def drawable(tick: Tick) -> Tick:
    """For the live picture: without the absurd values of a damaged row, and with blank skeletons, which are not recorded."""
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
    blank = np.zeros(masks.vessel.shape, bool)
    return replace(scene, skeletons=Skeletons(blank, blank, skeletons.bridges))


def _is_in_reach(scene: Scene) -> bool:
    """Whether all geometry is near the picture: lines far beyond it take seconds to paint, and perception never gives them."""
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
