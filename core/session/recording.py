"""What the recorder's thread does: encode once, keep the last seconds, write the session. Not to be called from other threads."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from core.control.drive_view import DriveView
from core.record_config import RecordConfig
from core.session.events import Event, EventKind, events_between
from core.session.files import SessionFiles
from core.session.manifest import About
from core.session.record_status import STOPPED, StatusBoard
from core.session.ring import EncodedFrame, Ring
from core.session.ring_saver import RingSaver
from core.session.rows import row_of
from core.session.video import FrameEncoder
from core.types import Frame, Tick

_TELL_EVERY_S = 1.0
_MAX_EARLY_EVENTS = 1000


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A tick with who drives and the servo bus's status; ``dropped`` counts the frames dropped before it, ever."""

    tick: Tick
    drive: DriveView | None
    bus: Any
    dropped: int


@dataclass(frozen=True, slots=True)
class _Lost:
    """How many frames of the camera are known to be lost, how many of them were told, and when (or when it was first looked at)."""

    total: int
    told: int
    told_s: float


class Recording:
    """The ring, and the session if there is one.

    Parameters
    ----------
    parent : where sessions are made.
    clock : the clock of the frames.
    board : where the state is shown.
    """

    def __init__(self, config: RecordConfig, about: About, parent: Path, clock: Callable[[], float], board: StatusBoard) -> None:
        self._config = config
        self._about = about
        self._parent = parent
        self._clock = clock
        self._board = board
        self._ring = Ring(config.ring_s, round(config.ring_mb * 1e6)) if config.ring_s > 0 else None
        self._encoder: FrameEncoder | None = None
        self._files: SessionFiles | None = None
        self._is_armed = False
        self._early: list[Event] = []
        self._drive: DriveView | None = None
        self._target: Event | None = None
        self._dropped_told = 0
        self._dropped_told_s = -math.inf
        self._last_s = 0.0
        self._lost: _Lost | None = None
        # read by other threads
        self.dropped_before = 0
        self.began_s = 0.0
        self.saver = RingSaver(parent, config, board)

    @property
    def wants_pictures(self) -> bool:
        """Is there anybody who would take them?"""
        return self._ring is not None or self._files is not None or self._is_armed

    @property
    def is_on(self) -> bool:
        """Is a session being recorded, or about to be?"""
        return self._files is not None or self._is_armed

    def take_picture(self, picture: Picture) -> None:
        """Encode it, keep it, write it. Raises VideoError, SessionError or OSError, after which `fail` must be called."""
        if not self.wants_pictures:
            return
        frame = picture.tick.frame
        if not math.isfinite(frame.captured_s):
            frame = replace(frame, captured_s=self._clock())
            picture = replace(picture, tick=replace(picture.tick, frame=frame))
        if self._is_armed:
            self._open(picture)
        if self._drive is None and picture.drive is not None:
            self.take_drive(picture.drive)  # where it began; what changes then comes by itself, all of it and in order
        self._tell_lost(picture.tick.frame)
        encoded = self._encoded(picture)
        if self._ring is not None:
            self._ring.add(encoded)
            self._board.show(ring_s=self._ring.seconds)
        if self._files is not None:
            self._files.write_frame(encoded)
            self._last_s = encoded.captured_s
            self._tell_dropped(picture)
            self._board.show(frames=self._files.counts.frames, bytes=self._files.counts.bytes)

    def _encoded(self, picture: Picture) -> EncodedFrame:
        frame = picture.tick.frame
        size = frame.image.shape[1], frame.image.shape[0]
        if self._encoder is None or self._encoder.size != size:
            self.drop_encoder()
            self._encoder = FrameEncoder(size, self._config)
        force_key = self._files is not None and self._files.wants_key(frame.captured_s)
        packet = self._encoder.encode(frame.image, frame.captured_s, force_key=force_key)
        row = row_of(picture.tick, picture.drive, bus=picture.bus, with_masks=self._config.masks)
        written = json.dumps(row, allow_nan=False, separators=(",", ":"))
        return EncodedFrame(frame.captured_s, packet, self._encoder, written, picture.dropped)

    def take_drive(self, view: DriveView) -> None:
        """Write what changed since the last view; one that is overtaken by a newer one tells nothing new. Raises OSError."""
        if self._drive is not None and view.time_s < self._drive.time_s:
            return
        for event in events_between(self._drive, view):
            self.take_event(event)
        self._drive = view

    def take_event(self, event: Event) -> None:
        """Keep it and write it; between start and the first frame it waits. Raises OSError."""
        if event.kind is EventKind.TARGET:
            self._target = event
        if self._ring is not None:
            self._ring.add_event(event)
        if self._files is not None:
            self._files.write_event(event)
        elif self._is_armed and len(self._early) < _MAX_EARLY_EVENTS:
            self._early.append(event)

    def _tell_dropped(self, picture: Picture) -> None:
        """At most once a second: a recorder that is behind must not be kept busy with saying so."""
        total, now_s = picture.dropped - self.dropped_before, picture.tick.frame.captured_s
        if total > self._dropped_told and now_s - self._dropped_told_s >= _TELL_EVERY_S:
            event = _dropped_event(now_s, total - self._dropped_told, total)
            self._dropped_told, self._dropped_told_s = total, now_s
            self.take_event(event)

    def _tell_lost(self, frame: Frame) -> None:
        """Frames that never came from the camera; at most once a second, too. A camera that was opened again counts from 0."""
        known = self._lost
        if known is None or frame.lost < known.total:
            for event in self._untold(frame.captured_s):
                self.take_event(event)
            self._lost = _Lost(frame.lost, frame.lost, frame.captured_s)
            return
        self._lost = replace(known, total=frame.lost)
        if frame.captured_s - known.told_s >= _TELL_EVERY_S:
            for event in self._untold(frame.captured_s):
                self.take_event(event)

    def _untold(self, time_s: float) -> Iterator[Event]:
        """What the camera has lost and nobody was told yet; it counts as told then."""
        known = self._lost
        if known is not None and known.total > known.told:
            count = known.total - known.told
            self._lost = _Lost(known.total, known.total, time_s)
            yield Event(time_s, EventKind.LOST, f"{count} frames", {"count": count, "total": known.total})

    def begin(self) -> None:
        """A session begins with the next frame; nothing happens when one is being recorded."""
        if self._files is None:
            self._is_armed = True
            self._board.show(armed=True, problem="", is_disk_full=False)

    def _open(self, picture: Picture) -> None:
        self._is_armed = False
        first_s = self._last_s = picture.tick.frame.captured_s
        self._files = SessionFiles(self._parent, self._about, self._config, first_s=first_s, now_s=self._clock())
        self.dropped_before = self._files.dropped_before = picture.dropped
        self._dropped_told, self._dropped_told_s = 0, -math.inf
        self.began_s = self._clock()
        self._leave_losses_before(picture.tick.frame)
        self._board.show(armed=False, recording=True, folder=self._files.folder, frames=0, bytes=self._files.counts.bytes)
        drive = picture.drive or self._drive
        if drive is not None:
            # the session must tell by itself where it began
            self._drive = replace(drive, time_s=first_s)
            self._files.write_event(next(events_between(None, self._drive)))
            for fault in drive.active:
                self._files.write_event(Event(first_s, EventKind.FAULT, str(fault.cause), {"detail": fault.detail}))
        if self._target is not None and self._target.data and self._target not in self._early:
            self._files.write_event(replace(self._target, time_s=first_s))
        early, self._early = self._early, []
        for event in early:
            self._files.write_event(event)

    def _leave_losses_before(self, first: Frame) -> None:
        """What was lost before the first frame of a session is not the session's: the ring is told, which reaches further back."""
        if self._ring is None:
            self._lost = None  # nobody has counted between two sessions
        elif self._lost is not None:
            self._lost = replace(self._lost, total=max(first.lost, self._lost.total))
            for event in self._untold(first.captured_s):
                self._ring.add_event(event)

    def end(self, ended: str, dropped: int) -> None:
        """End the session if there is one; `dropped` frames were dropped until now, ever."""
        self._is_armed, self._early = False, []
        files, self._files = self._files, None
        if files is None:
            self._board.show(armed=False)
            return
        count, elapsed_s = dropped - self.dropped_before, max(0.0, self._clock() - self.began_s)
        with contextlib.suppress(OSError):  # the disk may be why it ends; manifest and rows have the counts, too
            for event in self._untold(self._last_s):
                if self._ring is not None:
                    self._ring.add_event(event)
                files.write_event(event)
            if count > self._dropped_told:
                files.write_event(_dropped_event(self._last_s, count - self._dropped_told, count))
        problem = files.close(ended, count)
        self._board.show(recording=False, elapsed_s=elapsed_s, dropped=count, bytes=files.counts.bytes)
        if problem:
            self._board.fail(problem)
        else:
            self._board.show(saved=files.folder)

    def fail(self, problem: str, dropped: int, *, is_disk_full: bool = False) -> None:
        """End the session, keeping what was written. The ring goes on, with a new encoder."""
        was_on = self.is_on
        self.end(problem, dropped)
        self.drop_encoder()
        self._board.fail(f"{STOPPED}{problem}" if was_on else problem, is_disk_full=is_disk_full)

    def change_rig(self, about: About, dropped: int) -> None:
        """A session never mixes two rigs, and neither does the ring."""
        self.end("another rig was opened", dropped)
        self._about, self._drive, self._lost = about, None, None
        if self._ring is not None:
            self._ring.clear()
            self._board.show(ring_s=0.0)
            if self._target is not None:  # under other thresholds the rig and its destination are the same
                self._ring.add_event(self._target)

    def save_ring(self) -> None:
        """Write what the ring holds, in the background."""
        frames, events = self._ring.content() if self._ring is not None else ([], [])
        self.saver.save(self._about, frames, events, self._clock())

    def drop_encoder(self) -> None:
        """With a ring it may still be needed as the template of what the ring holds."""
        encoder, self._encoder = self._encoder, None
        if encoder is not None and self._ring is None:
            encoder.close()


def _dropped_event(time_s: float, count: int, total: int) -> Event:
    """So many more frames were dropped, so many since the session began."""
    return Event(time_s, EventKind.DROPPED, f"{count} frames", {"count": count, "total": total})
