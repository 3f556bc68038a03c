"""Recording from the window: the writer of sessions beside the engine's thread, and what the bar shows of it."""

from __future__ import annotations

import time

from PySide6.QtCore import QObject, QTimer, Signal, Slot

from app.engine_thread import EngineThread
from app.language import tr, tr_text
from core.config import Config
from core.control.alerts import Alert
from core.control.drive_view import DriveView
from core.control.faults import Cause
from core.session.events import Event, EventKind, event_of_alert, event_of_target
from core.session.manifest import About, about_rig
from core.session.record_status import STOPPED, RecordStatus, faults_between
from core.session.writer import SessionWriter
from core.types import Point, Tick
from hardware.rig import RigKind

_LOOK_EVERY_MS = 250
_CLOSE_WITHIN_S = 10.0


class Recorder(QObject):
    """Keeps every tick of the running rig, as a session while one is being recorded, else in memory for "save the last seconds".

    ``changed`` carries the ``RecordStatus``, ``said`` a line for people and whether it is a fault.

    Parameters
    ----------
    thread : whose ticks are recorded; they come in its own thread, and nothing here makes it wait.
    """

    changed = Signal(object)
    said = Signal(str, bool)

    def __init__(self, config: Config, kind: RigKind, thread: EngineThread, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._kind, self._thread = kind, thread
        self._writer: SessionWriter | None = None
        self._about: About | None = None
        self._target: Event | None = None
        self._config = config
        self._shown = RecordStatus()
        self._marks = 0
        self._timer = QTimer(self)
        self._timer.setInterval(_LOOK_EVERY_MS)
        self._timer.timeout.connect(self._look)
        thread.on_tick = self._put

    @property
    def status(self) -> RecordStatus:
        """How it is going."""
        return self._writer.status() if self._writer is not None else RecordStatus()

    def open_rig(self, config: Config, kind: RigKind) -> None:
        """Another rig is being opened: what is being recorded ends, for a session never mixes two rigs."""
        self._kind = kind
        self._about = about_rig(config, self._kind.value, config.rig.name)
        if self._writer is None:
            self._config = config
            self._writer = SessionWriter(config.record, self._about)
            self._timer.start()
        else:
            self._living(self._writer).set_about(self._about)

    def _living(self, writer: SessionWriter) -> SessionWriter:
        """The writer, or another one in the place of one that a fault of the program has ended: a day's recording goes on."""
        if writer.is_alive or self._about is None:
            return writer
        writer.close(0.0)
        self._writer = living = SessionWriter(self._config.record, self._about)
        if self._target is not None:
            living.add_event(self._target)
        return living

    @Slot()
    def toggle(self) -> None:
        """Begin a session with the next picture, or end it; one that has not begun yet is taken back."""
        if self._writer is None:
            return
        writer = self._living(self._writer)
        status = writer.status()
        if status.recording or status.armed:
            writer.stop()
        else:
            self._marks = 0  # on paper each session's marks count from 1
            writer.start()

    def stop(self, why: str) -> None:
        """End the session that is being recorded, if any; `why` goes into it. From any thread."""
        if self._writer is not None:
            self._writer.stop(why)

    @Slot()
    def save_last(self) -> None:
        """Make a session of the last seconds, without having recorded."""
        if self._writer is None:
            return
        writer = self._living(self._writer)
        if writer.status().ring_s <= 0.0:
            self.said.emit(tr("Nothing to save yet: record.ring_s is 0, or the rig has just been opened"), True)
            return
        writer.save_last()

    @Slot()
    def mark(self) -> None:
        """Mark this moment with a numbered note in the session, or in the last seconds; what it was can be said in the player.

        Nothing is typed here: hands stay on the controls, and Space stays STOP.
        """
        if self._writer is None:
            return
        writer = self._living(self._writer)
        status = writer.status()
        is_recorded = status.recording or status.armed
        if not is_recorded and status.ring_s <= 0.0:
            self.said.emit(tr("Nothing is being recorded that could be marked: F9 begins a session"), True)
            return
        if not writer.event(EventKind.NOTE, f"mark {self._marks + 1}"):
            self.said.emit(tr("Not marked: the recorder is behind"), True)
            return
        self._marks += 1
        if is_recorded:
            self.said.emit(tr("Mark {number} is in the session", number=self._marks), False)
        else:
            self.said.emit(tr("Mark {number} is in the last seconds: F10 saves them", number=self._marks), False)

    def target(self, target: Point | None) -> None:
        """Keep the operator's destination, source pixels."""
        self._target = event_of_target(target, time.monotonic())
        if self._writer is not None:
            self._writer.add_event(self._target)

    def drive(self, view: DriveView) -> None:
        """Keep that mode or faults have changed, also when there are no pictures."""
        if self._writer is not None:
            self._writer.drive(view)

    def rig_stopped(self, message: str) -> None:
        """Keep that the rig stopped by itself, and why: from here on there is no pilot whose views would tell."""
        if self._writer is not None:
            self._writer.event(EventKind.FAULT, Cause.WORKER_DEAD.value, {"detail": message})

    def alert(self, alert: Alert, time_s: float) -> None:
        """Keep an alert that was shown."""
        if self._writer is not None:
            self._writer.add_event(event_of_alert(alert, time_s))

    def close(self) -> bool:
        """End the session; False when the disk has not answered in time."""
        self._timer.stop()
        self._thread.on_tick = None
        self._about = None  # what has ended now is not to live again
        return self._writer.close(_CLOSE_WITHIN_S) if self._writer is not None else True

    def _put(self, tick: Tick) -> None:
        """A tick, in the engine's thread."""
        writer, pilot = self._writer, self._thread.pilot
        if writer is not None:
            writer.put(tick, pilot.view if pilot is not None else None, self._thread.bus_status())

    @Slot()
    def _look(self) -> None:
        before, self._shown = self._shown, self.status
        self.changed.emit(self._shown)
        self._tell(before, self._shown)

    def _tell(self, before: RecordStatus, now: RecordStatus) -> None:
        """What the operator and the pilot's alerts must know."""
        if (pilot := self._thread.pilot) is not None:
            for fault in faults_between(before, now):
                pilot.report(fault)
        if now.saved is not None and now.saved != before.saved:
            self.said.emit(tr("Session saved: {saved}", saved=now.saved), False)
        if now.notices != before.notices:
            self.said.emit(tr_text(now.notice), True)
        if now.problem and now.problems != before.problems:  # last: what was saved until then must not cover it
            problem = now.problem.removeprefix(STOPPED)
            self.said.emit(tr("Recording stopped: {problem}", problem=tr_text(problem)), True)
