"""The recorder: takes ticks without ever making their sender wait, and writes sessions in a thread of its own."""

from __future__ import annotations

import errno
import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from core.control.drive_view import DriveView
from core.record_config import RecordConfig, sessions_folder
from core.session.events import Event, EventKind
from core.session.manifest import About, SessionError
from core.session.record_status import RecordStatus, StatusBoard, look_at_disk
from core.session.recording import Picture, Recording
from core.session.rows import light_tick
from core.session.video import VideoError
from core.types import Tick

_log = logging.getLogger(__name__)

_LOOK_AT_DISK_S = 1.0
_MAX_EVENTS = 10_000

_Order = Callable[[], None]


class SessionWriter:
    """Lives as long as a rig is open; sessions begin and end in it. All methods may be called from any thread and return at once.

    Parameters
    ----------
    about : where the pictures come from; goes into the manifests.
    folder : where sessions are made; None: the configured one.
    clock : the clock of the frames.
    """

    def __init__(
        self, config: RecordConfig, about: About, *, folder: Path | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._max_queue = config.max_queue
        self._config = config
        self._parent = folder if folder is not None else sessions_folder(config.folder)
        self._clock = clock
        self._changed = threading.Condition()
        self._waiting: deque[Picture | Event | _Order] = deque()
        self._pictures_waiting = 0
        self._starts_waiting = 0
        self._dropped = 0
        self._ends_waiting: deque[int] = deque()
        self._is_closing = False
        self._board = StatusBoard()
        self._recording = Recording(config, about, self._parent, clock, self._board)
        self._wants_pictures = self._recording.wants_pictures
        self._looked_s = -math.inf
        self._thread = threading.Thread(target=self._run, name="session writer", daemon=True)
        self._thread.start()

    def start(self) -> None:
        """Begin a session with the next frame. Does nothing when one is being recorded."""
        with self._changed:
            if not self._is_closing:
                self._wants_pictures = True
                self._starts_waiting += 1
                self._waiting.append(self._begin)
                self._changed.notify()

    def stop(self, ended: str = "stopped") -> None:
        """End the session after what was put before; `ended` goes into the manifest."""
        self._order_end(lambda dropped: self._recording.end(ended, dropped))

    def save_last(self) -> None:
        """Write what the ring holds as a session, in the background; the status tells when it is there."""
        self._order(self._recording.save_ring)

    def set_about(self, about: About) -> None:
        """Another rig was opened: the running session ends, and the ring begins anew, for a session never mixes two rigs."""
        self._order_end(lambda dropped: self._recording.change_rig(about, dropped))

    def put(self, tick: Tick, drive: DriveView | None = None, bus: Any = None) -> bool:
        """Hand a tick over, with who drives and the newest status of the servo bus (a dataclass) where there are such.

        Where driving began is taken from the first one; what changes then is told by `drive`. Never waits for the disk. False when
        it was dropped, because the recorder is behind or has ended.
        """
        if not self._wants_pictures:
            return self._thread.is_alive()
        tick = light_tick(tick)
        with self._changed:
            if self._is_closing or not self._thread.is_alive():
                return False
            if self._pictures_waiting >= self._max_queue:
                self._dropped += 1
                return False
            self._pictures_waiting += 1
            self._waiting.append(Picture(tick, drive, bus, self._dropped))
            self._changed.notify()
        return True

    def drive(self, view: DriveView) -> bool:
        """Who drives has changed, or what hinders: recorded although there may be no picture. Never waits.

        False when the recorder has ended or is hopelessly behind.
        """
        return self._queue(lambda: self._recording.take_drive(view))

    def event(self, kind: EventKind, text: str = "", data: dict[str, Any] | None = None, time_s: float | None = None) -> bool:
        """Add an event (a note, a destination, an alert); modes, faults and acknowledgements are found in the drive views."""
        return self.add_event(Event(self._clock() if time_s is None else time_s, kind, text, data or {}))

    def add_event(self, event: Event) -> bool:
        """False when the recorder has ended or is hopelessly behind."""
        return self._queue(event)

    def _queue(self, item: Event | _Order) -> bool:
        with self._changed:
            if self._is_closing or len(self._waiting) >= _MAX_EVENTS:
                return False
            self._waiting.append(item)
            self._changed.notify()
        return True

    @property
    def is_alive(self) -> bool:
        """False once it is closed, or has ended because of a fault of the program: the status tells which."""
        return self._thread.is_alive()

    @property
    def pictures_waiting(self) -> int:
        """Handed over and not yet taken up."""
        return self._pictures_waiting

    def status(self) -> RecordStatus:
        """How it is going, now."""
        status = self._board.status
        if not status.recording:
            return status
        elapsed_s = max(0.0, self._clock() - self._recording.began_s)
        return replace(status, elapsed_s=elapsed_s, dropped=max(0, self._dropped_until_end() - self._recording.dropped_before))

    def close(self, timeout_s: float = 10.0) -> bool:
        """End the session and the thread, after all that was put; False when the disk has not answered in time."""
        self.stop("closed")
        with self._changed:
            self._is_closing = True
            self._changed.notify()
        until_s = time.monotonic() + timeout_s
        self._thread.join(timeout_s)
        is_saved = self._recording.saver.finish(max(0.0, until_s - time.monotonic()))
        return is_saved and not self._thread.is_alive()

    def _order(self, order: _Order) -> None:
        with self._changed:
            if not self._is_closing:
                self._waiting.append(order)
                self._changed.notify()

    def _order_end(self, end: Callable[[int], None]) -> None:
        """An order that ends the session. It hears how many frames were dropped until it was given: later ones are not its."""

        def order() -> None:
            try:
                end(self._ends_waiting[0])
            finally:
                with self._changed:
                    self._ends_waiting.popleft()

        with self._changed:
            if not self._is_closing:
                self._ends_waiting.append(self._dropped)
                self._waiting.append(order)
                self._changed.notify()

    def _dropped_until_end(self) -> int:
        """Frames dropped until now, ever, or until somebody asked for the end of the session that is being written."""
        with self._changed:
            return self._ends_waiting[0] if self._ends_waiting else self._dropped

    def _run(self) -> None:
        """The thread."""
        try:
            while (item := self._next()) is not None:
                self._take(item)
        except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible problem
            _log.error("the recorder stopped", exc_info=error)
            self._fail(f"unexpected {type(error).__name__}: {' '.join(str(error).split())}")
        finally:
            self._recording.end("closed", self._dropped_until_end())
            self._recording.drop_encoder()

    def _next(self) -> Picture | Event | _Order | None:
        """What comes next, looking at the disk meanwhile; None when the recorder is closed and all is done."""
        while True:
            self._watch_disk()
            with self._changed:
                self._wants_pictures = self._recording.wants_pictures or self._starts_waiting > 0
                if not self._waiting and not self._is_closing:
                    self._changed.wait(_LOOK_AT_DISK_S)
                if self._waiting:
                    item = self._waiting.popleft()
                    self._pictures_waiting -= isinstance(item, Picture)
                    return item
                if self._is_closing:
                    return None

    def _take(self, item: Picture | Event | _Order) -> None:
        try:
            if isinstance(item, Picture):
                self._recording.take_picture(item)
            elif isinstance(item, Event):
                self._recording.take_event(item)
            else:
                item()
        except (VideoError, SessionError) as error:
            self._fail(str(error), is_disk_full=_is_disk_full(error))
        except OSError as error:
            self._fail(f"{error.filename or self._parent}: {error.strerror or error}", is_disk_full=_is_disk_full(error))

    def _begin(self) -> None:
        with self._changed:
            self._starts_waiting -= 1
        self._recording.begin()

    def _fail(self, problem: str, *, is_disk_full: bool = False) -> None:
        self._recording.fail(problem, self._dropped_until_end(), is_disk_full=is_disk_full)

    def _watch_disk(self) -> None:
        now_s = time.monotonic()
        if now_s - self._looked_s < _LOOK_AT_DISK_S:
            return
        self._looked_s = now_s
        disk = look_at_disk(self._parent, self._config)
        if disk is not None:
            self._board.show(disk_free=disk.free, warning=disk.warning)
            if disk.full and self._recording.is_on:
                self._fail(f"{disk.full}; make room and record again", is_disk_full=True)


def _is_disk_full(error: BaseException | None) -> bool:
    """Whether an error, or the one that it was made of, says that there is no room: on the disk, or for this user."""
    while error is not None:
        if getattr(error, "errno", None) in {errno.ENOSPC, errno.EDQUOT}:
            return True
        error = error.__cause__ or error.__context__
    return False
