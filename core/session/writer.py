"""The recorder: takes ticks without ever making their sender wait, and writes sessions in a thread of its own.

It encodes each picture once, keeps the last seconds in memory, and writes the session if one is being recorded.
"""

from __future__ import annotations

import contextlib
import errno
import json
import logging
import math
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from core.config.models import RecordConfig, sessions_folder
from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.messages import message
from core.session.codec import light_tick, row_of
from core.session.files import EncodedFrame, SessionFiles
from core.session.manifest import About, Description, Event, EventKind, SessionError, events_between
from core.session.video import FrameEncoder, VideoError
from core.types import Frame, Tick

STOPPED = "recording stopped: "
"""Before a problem that has ended a session."""
_MB = 1e6
_DISK_CHECK_S = 1.0
_MAX_EVENTS = 10_000  # waiting, beyond which events are refused
_RING_EVENTS = 2000
_EARLY_EVENTS = 1000  # kept between start and the first frame
_REPORT_EVERY_S = 1.0  # lost and dropped frames are reported at most so often


_log = logging.getLogger(__name__)
_Order = Callable[[], None]


@dataclass(frozen=True, slots=True)
class RecordStatus:
    """What the record bar shows.

    Attributes
    ----------
    armed : a session begins with the next picture.
    recording : a session is being written to `folder` (afterwards: the last one).
    elapsed_s, frames, bytes : of that session.
    dropped : frames that the recorder could not take since the session's start, because its queue was full.
    disk_free : bytes; None before the first look.
    warning : disk nearly full, in plain words.
    problem : why the recording stopped, or could not start; empty when all is well. The next start clears it.
    is_disk_full : the disk is why.
    problems : how often there was one; a repetition counts.
    notice : what last went wrong with "save the last seconds"; `notices` counts them.
    ring_s : how much "save the last seconds" would give now.
    saving : the last seconds are being written.
    saved : the newest session that was completed, by stop or from the ring.
    """

    armed: bool = False
    recording: bool = False
    folder: Path | None = None
    elapsed_s: float = 0.0
    frames: int = 0
    bytes: int = 0
    dropped: int = 0
    disk_free: int | None = None
    warning: str = ""
    problem: str = ""
    is_disk_full: bool = False
    problems: int = 0
    notice: str = ""
    notices: int = 0
    ring_s: float = 0.0
    saving: bool = False
    saved: Path | None = None


def faults_between(before: RecordStatus, now: RecordStatus) -> list[Fault]:
    """Faults of the recorder that the operator must be told, from one status to the next."""
    faults = []
    if now.problem and now.problems != before.problems:
        faults.append(Fault(Cause.DISK_FULL if now.is_disk_full else Cause.RECORDING_STOPPED, now.problem))
    elif now.warning:
        faults.append(Fault(Cause.DISK_LOW, now.warning))
    if now.dropped > before.dropped:
        faults.append(Fault(Cause.RECORDER_BEHIND, message("{a} frames", a=now.dropped)))
    return faults


class _SharedStatus:
    """The status, which the threads of the recorder change."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.now = RecordStatus()

    def update(self, **changes: Any) -> None:
        with self._lock:
            self.now = replace(self.now, **changes)

    def report_problem(self, problem: str, *, is_disk_full: bool = False) -> None:
        """The recording stopped, or could not start."""
        with self._lock:
            self.now = replace(self.now, problem=problem, is_disk_full=is_disk_full, problems=self.now.problems + 1)

    def notify(self, text: str) -> None:
        """A message that does not stop the recording."""
        with self._lock:
            self.now = replace(self.now, notice=text, notices=self.now.notices + 1)


@dataclass(frozen=True, slots=True)
class Disk:
    """Free space (bytes); `warning` and `full` are lines to show, empty when there is room."""

    free: int
    warning: str
    full: str


def disk_space(folder: Path, config: RecordConfig) -> Disk | None:
    """The disk of a folder that need not exist yet; None when it cannot be read."""
    try:
        there = next(parent for parent in (folder, *folder.parents) if parent.exists())
        total, _, free = shutil.disk_usage(there)
    except (OSError, StopIteration):
        return None
    left = f"{free / _MB:,.0f}"
    is_low = free < config.warn_free_mb * _MB or free < config.warn_free_share * total
    warning = message("disk nearly full: {left} MB left", left=left) if is_low else ""
    full = message("disk full ({left} MB left in {folder})", left=left, folder=folder) if free < config.stop_free_mb * _MB else ""
    return Disk(free, warning, full)


class Ring:
    """The last encoded frames and events, bounded in time and bytes.

    It always begins at a key picture, so it may reach up to a second further back.
    """

    def __init__(self, seconds: float, max_bytes: int) -> None:
        self._seconds = seconds
        self._max_bytes = max_bytes
        self.clear()

    def clear(self) -> None:
        self._groups: deque[list[EncodedFrame]] = deque()
        self._events: deque[Event] = deque()
        self._target: Event | None = None
        self.nbytes = 0

    @property
    def seconds(self) -> float:
        """How much it holds now."""
        return max(0.0, self._groups[-1][-1].captured_s - self._groups[0][0].captured_s) if self._groups else 0.0

    def add(self, frame: EncodedFrame) -> None:
        """Add a frame and drop the oldest. Frames before the first key picture are not kept."""
        if frame.packet.is_key:
            self._groups.append([])
        if not self._groups:
            return
        self._groups[-1].append(frame)
        self.nbytes += frame.nbytes
        while len(self._groups) > 1:
            age_s = frame.captured_s - self._groups[1][0].captured_s
            # The second group reaches back far enough, or the clock went back, which ages everything.
            if not (age_s >= self._seconds or age_s < 0.0 or self.nbytes > self._max_bytes):
                break
            self.nbytes -= sum(old.nbytes for old in self._groups.popleft())

    def add_event(self, event: Event) -> None:
        """Add an event and drop the oldest; the newest dropped target stays in force."""
        self._events.append(event)
        while len(self._events) > _RING_EVENTS:
            old = self._events.popleft()
            if old.kind is EventKind.TARGET:
                self._target = old

    def content(self) -> tuple[list[EncodedFrame], list[Event]]:
        """A copy: the frames in order, and the events since the first of them, with the target that was chosen before."""
        frames = [frame for group in self._groups for frame in group]
        if not frames:
            return [], []
        first_s = frames[0].captured_s
        chosen = [] if self._target is None else [self._target]
        chosen += [event for event in self._events if event.kind is EventKind.TARGET and event.time_s < first_s]
        before = [replace(event, time_s=first_s) for event in chosen[-1:] if event.data]
        return frames, before + [event for event in self._events if event.time_s >= first_s]


class RingSaver:
    """Writes what the ring held as a session, in a thread of its own: a slow disk must not delay a running session.

    One saving at a time; the status shows how it went.
    """

    def __init__(self, parent: Path, config: RecordConfig, status: _SharedStatus) -> None:
        self._parent = parent
        self._config = config
        self._status = status
        self._thread: threading.Thread | None = None

    def save(self, about: About, frames: list[EncodedFrame], events: list[Event], now_s: float) -> None:
        """Start to write; `now_s` is the frames' clock now."""
        if not frames:
            self._status.notify("nothing to save: no frames in memory yet")
        elif self._thread is not None and self._thread.is_alive():
            self._status.notify("the last seconds are still being saved")
        else:
            self._status.update(saving=True)
            arguments = (about, frames, events, now_s)
            self._thread = threading.Thread(target=self._write, args=arguments, name="ring saver", daemon=True)
            self._thread.start()

    def finish(self, within_s: float) -> bool:
        """Wait for it; False when the disk has not answered in time."""
        if self._thread is not None:
            self._thread.join(within_s)
        return self._thread is None or not self._thread.is_alive()

    def _write(self, about: About, frames: list[EncodedFrame], events: list[Event], now_s: float) -> None:
        files: SessionFiles | None = None
        problem, written = "an error of the program; its log says more", 0
        try:
            self._check_room()
            first_s = frames[0].captured_s
            files = SessionFiles(self._parent, about, self._config, first_s=first_s, now_s=now_s, origin="last seconds")
            files.dropped_before = frames[0].dropped
            for event in (*_beginning(frames[0], events), *events):
                files.write_event(event)
            for frame in frames:
                self._check_room()
                files.write_frame(frame)
                written += 1
            problem = ""
        except (VideoError, SessionError) as error:
            problem = str(error)
        except OSError as error:
            problem = f"{error.filename or self._parent}: {error.strerror or error}"
        finally:  # also after an unexpected error, which goes on to the log
            try:
                if files is not None:  # its manifest must record that it is incomplete
                    lost = frames[-1].dropped - frames[0].dropped + len(frames) - written
                    at_end = files.close(problem or "saved from memory", lost)
                    problem = problem or at_end
            finally:
                self._status.update(saving=False)
                if not problem:
                    self._status.update(saved=files.folder if files is not None else None)
                elif not written:
                    self._status.notify(message("the last seconds were not saved: {why}", why=problem))
                else:
                    self._status.notify(
                        message(
                            "of the last seconds only {a} of {b} frames were saved: {why}", a=written, b=len(frames), why=problem
                        )
                    )

    def _check_room(self) -> None:
        """Raises SessionError where the disk is nearly full: its last room is for closing what is open."""
        disk = disk_space(self._parent, self._config)
        if disk is not None and disk.full:
            raise SessionError("{why}; make room and save them again", why=disk.full)


def _beginning(first: EncodedFrame, events: Sequence[Event]) -> Iterator[Event]:
    """Mode and faults at the first frame, which every session must hold; none where the ring has the beginning."""
    drive = json.loads(first.row)["drive"]
    mode = next((event for event in events if event.kind is EventKind.MODE), None)
    if drive is None or (mode is not None and "from" not in mode.data):
        return
    yield Event(first.captured_s, EventKind.MODE, drive["mode"])
    for cause, detail in drive["active"]:
        yield Event(first.captured_s, EventKind.FAULT, cause, {"detail": detail})


@dataclass(frozen=True, slots=True, eq=False)
class RecordedTick:
    """A tick with who drives and the servo bus's status; ``dropped`` counts the frames dropped before it, ever."""

    tick: Tick
    drive: DriveView | None
    bus: Any
    dropped: int


@dataclass(frozen=True, slots=True)
class _Lost:
    """Frames that the camera has lost, how many of them were reported, and when (or when they were first counted)."""

    total: int
    reported: int
    reported_s: float


class Recording:
    """What the recorder's thread does: the ring, and the session in `parent` if there is one; it keeps the `status` up to date."""

    def __init__(self, config: RecordConfig, about: About, parent: Path, clock: Callable[[], float], status: _SharedStatus) -> None:
        self._config = config
        self._about = about
        self._parent = parent
        self._clock = clock
        self._status = status
        self._ring = Ring(config.ring_s, round(config.ring_mb * 1e6)) if config.ring_s > 0 else None
        self._encoder: FrameEncoder | None = None
        self._files: SessionFiles | None = None
        self._is_armed = False
        self._early: list[Event] = []
        self._drive: DriveView | None = None
        self._target: Event | None = None
        self._dropped_reported = 0
        self._dropped_reported_s = -math.inf
        self._last_s = 0.0
        self._lost: _Lost | None = None
        # read by other threads
        self.dropped_before = 0
        self.began_s = 0.0
        self.saver = RingSaver(parent, config, status)

    @property
    def wants_pictures(self) -> bool:
        """Are pictures of use, for the ring or for a session?"""
        return self._ring is not None or self._files is not None or self._is_armed

    @property
    def is_on(self) -> bool:
        """Is a session being recorded, or about to be?"""
        return self._files is not None or self._is_armed

    def write_tick(self, picture: RecordedTick) -> None:
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
            self.write_drive(picture.drive)  # how driving began; later changes come by themselves
        self._report_lost(picture.tick.frame)
        encoded = self._encoded(picture)
        if self._ring is not None:
            self._ring.add(encoded)
            self._status.update(ring_s=self._ring.seconds)
        if self._files is not None:
            self._files.write_frame(encoded)
            self._last_s = encoded.captured_s
            self._report_dropped(picture)
            self._status.update(frames=self._files.counts.frames, bytes=self._files.counts.bytes)

    def _encoded(self, picture: RecordedTick) -> EncodedFrame:
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

    def write_drive(self, view: DriveView) -> None:
        """Write what changed since the last view; one that is older than the last is ignored. Raises OSError."""
        if self._drive is not None and view.time_s < self._drive.time_s:
            return
        for event in events_between(self._drive, view):
            self.write_event(event)
        self._drive = view

    def write_event(self, event: Event) -> None:
        """Keep and write an event; between start and the first frame it waits. Raises OSError."""
        if event.kind is EventKind.TARGET:
            self._target = event
        if self._ring is not None:
            self._ring.add_event(event)
        if self._files is not None:
            self._files.write_event(event)
        elif self._is_armed and len(self._early) < _EARLY_EVENTS:
            self._early.append(event)

    def _report_dropped(self, picture: RecordedTick) -> None:
        """At most once a second: a recorder that is behind must not be kept busy with it."""
        total, now_s = picture.dropped - self.dropped_before, picture.tick.frame.captured_s
        if total > self._dropped_reported and now_s - self._dropped_reported_s >= _REPORT_EVERY_S:
            event = _counted(EventKind.DROPPED, now_s, total - self._dropped_reported, total)
            self._dropped_reported, self._dropped_reported_s = total, now_s
            self.write_event(event)

    def _report_lost(self, frame: Frame) -> None:
        """Frames that never came from the camera; at most once a second, too. A camera that was opened again counts from 0."""
        known = self._lost
        is_reopened = known is None or frame.lost < known.total
        if known is not None and not is_reopened:
            self._lost = replace(known, total=frame.lost)
        if known is None or is_reopened or frame.captured_s - known.reported_s >= _REPORT_EVERY_S:
            for event in self._unreported(frame.captured_s):
                self.write_event(event)
        if is_reopened:
            self._lost = _Lost(frame.lost, frame.lost, frame.captured_s)

    def _unreported(self, time_s: float) -> Iterator[Event]:
        """What the camera has lost and was not reported yet; it counts as reported then."""
        known = self._lost
        if known is not None and known.total > known.reported:
            self._lost = _Lost(known.total, known.total, time_s)
            yield _counted(EventKind.LOST, time_s, known.total - known.reported, known.total)

    def begin(self) -> None:
        """A session begins with the next frame; nothing happens when one is being recorded."""
        if self._files is None:
            self._is_armed = True
            self._status.update(armed=True, problem="", is_disk_full=False)

    def _open(self, picture: RecordedTick) -> None:
        self._is_armed = False
        first_s = self._last_s = picture.tick.frame.captured_s
        self._files = SessionFiles(self._parent, self._about, self._config, first_s=first_s, now_s=self._clock())
        self.dropped_before = self._files.dropped_before = picture.dropped
        self._dropped_reported, self._dropped_reported_s = 0, -math.inf
        self.began_s = self._clock()
        # What was lost before the first frame is not the session's: the ring gets it, which reaches further back.
        if self._ring is None:
            self._lost = None  # between two sessions lost frames were not counted
        elif self._lost is not None:
            self._lost = replace(self._lost, total=max(picture.tick.frame.lost, self._lost.total))
            for event in self._unreported(first_s):
                self._ring.add_event(event)
        self._status.update(armed=False, recording=True, folder=self._files.folder, frames=0, bytes=self._files.counts.bytes)
        drive = picture.drive or self._drive
        if drive is not None:
            # every session holds how it began
            self._drive = replace(drive, time_s=first_s)
            self._files.write_event(next(events_between(None, self._drive)))
            for fault in drive.active:
                self._files.write_event(Event(first_s, EventKind.FAULT, str(fault.cause), {"detail": fault.detail}))
        if self._target is not None and self._target.data and self._target not in self._early:
            self._files.write_event(replace(self._target, time_s=first_s))
        early, self._early = self._early, []
        for event in early:
            self._files.write_event(event)

    def end(self, ended: str, dropped: int) -> None:
        """End the session if there is one; `dropped` frames were dropped until now, ever."""
        self._is_armed, self._early = False, []
        files, self._files = self._files, None
        if files is None:
            self._status.update(armed=False)
            return
        count, elapsed_s = dropped - self.dropped_before, max(0.0, self._clock() - self.began_s)
        with contextlib.suppress(OSError):  # the disk may be why it ends; manifest and rows have the counts, too
            for event in self._unreported(self._last_s):
                if self._ring is not None:
                    self._ring.add_event(event)
                files.write_event(event)
            if count > self._dropped_reported:
                files.write_event(_counted(EventKind.DROPPED, self._last_s, count - self._dropped_reported, count))
        problem = files.close(ended, count)
        self._status.update(recording=False, elapsed_s=elapsed_s, dropped=count, bytes=files.counts.bytes)
        if problem:
            self._status.report_problem(problem)
        else:
            self._status.update(saved=files.folder)

    def fail(self, problem: str, dropped: int, *, is_disk_full: bool = False) -> None:
        """End the session, keeping what was written. The ring goes on, with a new encoder."""
        was_on = self.is_on
        self.end(problem, dropped)
        self.drop_encoder()
        self._status.report_problem(f"{STOPPED}{problem}" if was_on else problem, is_disk_full=is_disk_full)

    def change_rig(self, about: About, dropped: int) -> None:
        """A session never mixes two rigs, and neither does the ring."""
        self.end("another rig was opened", dropped)
        self._about, self._drive, self._lost = about, None, None
        if self._ring is not None:
            self._ring.clear()
            self._status.update(ring_s=0.0)
            if self._target is not None:  # under other thresholds the rig and its target are the same
                self._ring.add_event(self._target)

    def describe(self, description: Description) -> None:
        """What later sessions are about; the one that is being written stays as it is."""
        self._about = replace(self._about, description=description)

    def save_ring(self) -> None:
        """Write what the ring holds, in the background."""
        frames, events = self._ring.content() if self._ring is not None else ([], [])
        self.saver.save(self._about, frames, events, self._clock())

    def drop_encoder(self) -> None:
        """With a ring it may still be needed as the template of what the ring holds."""
        encoder, self._encoder = self._encoder, None
        if encoder is not None and self._ring is None:
            encoder.close()


def _counted(kind: EventKind, time_s: float, count: int, total: int) -> Event:
    """`count` more frames were dropped or lost, `total` until now."""
    return Event(time_s, kind, message("{a} frames", a=count), {"count": count, "total": total})


class SessionWriter:
    """Lives as long as a rig is open; sessions begin and end in it. All methods may be called from any thread and return at once.

    Where the pictures come from goes into the manifests. Sessions are made in `folder`; None: the configured one. `clock` is
    that of the frames.
    """

    def __init__(
        self, config: RecordConfig, about: About, *, folder: Path | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._max_queue = config.max_queue
        self._config = config
        self._parent = folder if folder is not None else sessions_folder(config.folder)
        self._clock = clock
        self._changed = threading.Condition()
        self._waiting: deque[RecordedTick | _Order] = deque()
        self.pictures_waiting = 0
        """Handed over and not yet taken up."""
        self._starts_waiting = 0
        self._dropped = 0
        self._ends_waiting: deque[int] = deque()
        self._is_closing = False
        self._status = _SharedStatus()
        self._recording = Recording(config, about, self._parent, clock, self._status)
        self._wants_pictures = self._recording.wants_pictures
        self._disk_seen_s = -math.inf
        self._thread = threading.Thread(target=self._run, name="session writer", daemon=True)
        self._thread.start()

    def start(self) -> None:
        """Begin a session with the next frame. Does nothing when one is being recorded."""

        def begin() -> None:
            try:
                self._recording.begin()
            finally:
                with self._changed:
                    self._starts_waiting -= 1

        with self._changed:
            if self._enqueue(begin):
                self._wants_pictures = True
                self._starts_waiting += 1

    def stop(self, ended: str = "stopped") -> None:
        """End the session after what was put before; `ended` goes into the manifest."""
        self._enqueue_end(lambda dropped: self._recording.end(ended, dropped))

    def save_last(self) -> None:
        """Write what the ring holds as a session, in the background; the status says when it is complete."""
        self._enqueue(self._recording.save_ring)

    def set_about(self, about: About) -> None:
        """Another rig was opened: the running session ends and the ring is cleared, since a session never mixes two rigs."""
        self._enqueue_end(lambda dropped: self._recording.change_rig(about, dropped))

    def describe(self, description: Description) -> None:
        """What the sessions that begin from here on are about."""
        self._enqueue(lambda: self._recording.describe(description))

    def put(self, tick: Tick, drive: DriveView | None = None, bus: Any = None) -> bool:
        """Hand a tick over, with who drives and the newest status of the servo bus (a dataclass) where there are such.

        How driving began is taken from the first one; later changes come by `drive`. Never waits for the disk. False when it was
        dropped, because the recorder is behind or has ended.
        """
        if not self._wants_pictures:
            return self._thread.is_alive()
        tick = light_tick(tick)
        with self._changed:
            if self._is_closing or not self._thread.is_alive():
                return False
            if self.pictures_waiting >= self._max_queue:
                self._dropped += 1
                return False
            self.pictures_waiting += 1
            self._waiting.append(RecordedTick(tick, drive, bus, self._dropped))
            self._changed.notify()
        return True

    def drive(self, view: DriveView) -> bool:
        """Who drives has changed, or what hinders: recorded although there may be no picture. Never waits.

        False when the recorder has ended or is hopelessly behind.
        """
        return self._enqueue(lambda: self._recording.write_drive(view), most=_MAX_EVENTS)

    def add_event(self, event: Event) -> bool:
        """False when the recorder has ended or is hopelessly behind."""
        return self._enqueue(lambda: self._recording.write_event(event), most=_MAX_EVENTS)

    @property
    def is_alive(self) -> bool:
        """False once it is closed, or has ended because of a fault of the program (see the status)."""
        return self._thread.is_alive()

    def status(self) -> RecordStatus:
        """How it is going, now."""
        status = self._status.now
        if not status.recording:
            return replace(status, armed=True) if self._starts_waiting else status  # its thread has not come to it yet
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

    def _enqueue(self, order: _Order, most: int | None = None) -> bool:
        """Queue what the thread has to do; False when the recorder is closed, or behind by `most` items."""
        with self._changed:
            if self._is_closing or (most is not None and len(self._waiting) >= most):
                return False
            self._waiting.append(order)
            self._changed.notify()
            return True

    def _enqueue_end(self, end: Callable[[int], None]) -> None:
        """Queue an order that ends the session; it gets the number of frames dropped until now."""

        def order() -> None:
            try:
                end(self._ends_waiting[0])
            finally:
                with self._changed:
                    self._ends_waiting.popleft()

        with self._changed:
            if self._enqueue(order):
                self._ends_waiting.append(self._dropped)

    def _dropped_until_end(self) -> int:
        """Frames dropped until now, ever, or until the end of the session that is being written was asked for."""
        with self._changed:
            return self._ends_waiting[0] if self._ends_waiting else self._dropped

    def _run(self) -> None:
        """The thread."""
        try:
            while (item := self._next()) is not None:
                try:
                    if isinstance(item, RecordedTick):
                        self._recording.write_tick(item)
                    else:
                        item()
                except (VideoError, SessionError) as error:
                    self._fail(str(error), is_disk_full=_is_disk_full(error))
                except OSError as error:
                    self._fail(f"{error.filename or self._parent}: {error.strerror or error}", is_disk_full=_is_disk_full(error))
        except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible problem
            _log.error("the recorder stopped", exc_info=error)
            self._fail(f"unexpected {type(error).__name__}: {' '.join(str(error).split())}")
        finally:
            self._recording.end("closed", self._dropped_until_end())
            self._recording.drop_encoder()

    def _next(self) -> RecordedTick | _Order | None:
        """What comes next, checking the disk meanwhile; None when the recorder is closed and all is done."""
        while True:
            self._watch_disk()
            with self._changed:
                self._wants_pictures = self._recording.wants_pictures or self._starts_waiting > 0
                if not self._waiting and not self._is_closing:
                    self._changed.wait(_DISK_CHECK_S)
                if self._waiting:
                    item = self._waiting.popleft()
                    self.pictures_waiting -= isinstance(item, RecordedTick)
                    return item
                if self._is_closing:
                    return None

    def _fail(self, problem: str, *, is_disk_full: bool = False) -> None:
        self._recording.fail(problem, self._dropped_until_end(), is_disk_full=is_disk_full)

    def _watch_disk(self) -> None:
        now_s = time.monotonic()
        if now_s - self._disk_seen_s < _DISK_CHECK_S:
            return
        self._disk_seen_s = now_s
        if (disk := disk_space(self._parent, self._config)) is not None:
            self._status.update(disk_free=disk.free, warning=disk.warning)
            if disk.full and self._recording.is_on:
                self._fail(f"{disk.full}; make room and record again", is_disk_full=True)


def _is_disk_full(error: BaseException | None) -> bool:
    """Whether an error or its cause is a full disk or an exceeded quota."""
    while error is not None:
        if getattr(error, "errno", None) in {errno.ENOSPC, errno.EDQUOT}:
            return True
        error = error.__cause__ or error.__context__
    return False
