"""Sessions in the operator window: recorded beside the engine's thread, annotated, evaluated and played in processes of their own.

Sessions that were cut (kill, power, full disk) are searched when the window starts, offered, and recovered into copies.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtWidgets import QWidget

from app.ui.actions import plain
from app.ui.description_form import DescriptionDialog
from app.ui.i18n import mark, tr, tr_text
from app.ui.opening import FRAMES, OfferedCommand, Offers, OtherWindows, open_file
from app.ui.workers import Worker
from app.widgets.messages import Offer, OfferButton
from core.annotation.store import DEFAULT_NAME
from core.config.models import Config
from core.control.alerts import Alert
from core.control.drive_view import DriveView
from core.control.faults import Cause
from core.files import write_atomic
from core.program import program_id
from core.session.live_output import LiveOutput
from core.session.manifest import (
    REHEARSAL,
    About,
    Description,
    Event,
    EventKind,
    SessionError,
    about_rig,
    event_of_alert,
    event_of_target,
    read_description,
    read_manifest,
    remember_description,
    remembered_description,
    write_description,
)
from core.session.recovery import find_cut_sessions
from core.session.writer import STOPPED, RecordStatus, SessionWriter, faults_between
from core.types import Point, Tick
from hardware.rig import RigKind

if TYPE_CHECKING:  # the player needs this file where there is no robot: not on Linux
    from app.operator.rig_session import RigSession

_UPDATE_EVERY_MS = 250
_CLOSE_WITHIN_S = 10.0


class Recorder(QObject):
    """Keeps every tick of the running rig, as a session while one is being recorded, else in memory for "save the last seconds".

    ``changed`` carries the ``RecordStatus``, ``said`` a line for people and whether it is a fault.

    Parameters
    ----------
    rig : whose ticks are recorded; they come in the engine's thread, and nothing here makes it wait.
    """

    changed = Signal(object)
    said = Signal(str, bool)

    def __init__(self, rig: RigSession, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._engine = rig.engine
        self._writer: SessionWriter | None = None
        self._about: About | None = None
        self._target: Event | None = None
        self._outputs: tuple[LiveOutput, ...] = ()
        self._config = rig.config
        self._shown = RecordStatus()
        self.description = remembered_description()
        """What the next sessions are about."""
        self._marks = 0
        self._timer = QTimer(self, interval=_UPDATE_EVERY_MS)
        self._timer.timeout.connect(self._update)
        self._engine.on_tick = self._put
        rig.add_work(lambda: tr("a session is being recorded: end it first") if self.status.recording else "")

    @property
    def status(self) -> RecordStatus:
        return self._writer.status() if self._writer is not None else RecordStatus()

    def open_rig(self, config: Config, kind: RigKind) -> None:
        """Another rig is being opened: what is being recorded ends, for a session never mixes two rigs."""
        self._about = replace(about_rig(config, kind.value, config.rig.name), description=self.description)
        self.use_outputs(self._outputs)
        if self._writer is None:
            self._config = config
            self._writer = SessionWriter(config.record, self._about, clock=self._now_s)
            self._timer.start()
        else:
            self._usable(self._writer).set_about(self._about)

    def use_outputs(self, outputs: Iterable[LiveOutput]) -> None:
        """Hand all that is kept also to these, recorded or not."""
        self._outputs = tuple(outputs)
        for output in self._outputs:
            if self._about is not None:
                output.set_rig(self._about)

    def describe(self, description: Description) -> None:
        """What the next sessions are about, without notes and tags; from the next start of the program on, too."""
        self.description = description.for_next
        if self._about is not None and self._writer is not None:
            self._about = replace(self._about, description=self.description)
            self._writer.describe(self.description)

    def _now_s(self) -> float:
        """The clock of the frames."""
        pilot = self._engine.pilot
        return pilot.now_s if pilot is not None else time.monotonic()

    def _usable(self, writer: SessionWriter) -> SessionWriter:
        """The writer, or a new one in place of one that a fault of the program has ended: a day's recording goes on."""
        if writer.is_alive or self._about is None:
            return writer
        writer.close(0.0)
        self._writer = usable = SessionWriter(self._config.record, self._about, clock=self._now_s)
        if self._target is not None:
            usable.add_event(self._target)
        return usable

    def toggle(self) -> None:
        """Begin a session with the next picture, or end it; one that has not begun yet is taken back."""
        if self._writer is None:
            return
        writer = self._usable(self._writer)
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

    def save_last(self) -> None:
        """Make a session of the last seconds, without having recorded."""
        if self._writer is None:
            return
        writer = self._usable(self._writer)
        if writer.status().ring_s <= 0.0:
            self.said.emit(tr("Nothing to save yet: record.ring_s is 0, or the rig has just been opened"), True)
            return
        writer.save_last()

    def note(self, text: str = "") -> str:
        """Note `text` at this moment in the session, or in the last seconds; returns why it cannot be kept, "" when it is.

        Without a text it is a numbered mark; what it was can be said in the player: the operator stays at the controls.
        """
        writer = self._usable(self._writer) if self._writer is not None else None
        status = self.status
        is_recorded = status.recording or status.armed
        event = Event(self._now_s(), EventKind.NOTE, text or f"mark {self._marks + 1}")
        problem = ""
        if writer is None or (not is_recorded and status.ring_s <= 0.0):
            problem = mark("Nothing is being recorded that could be marked: F9 begins a session")
        elif not writer.add_event(event):
            problem = mark("Not marked: the recorder is behind")
        if problem:
            self.said.emit(tr_text(problem), True)
            return problem
        for output in self._outputs:
            output.add_event(event)
        if text:
            self.said.emit(tr("Noted: {text}", text=text), False)
            return ""
        self._marks += 1
        if is_recorded:
            self.said.emit(tr("Mark {number} is in the session", number=self._marks), False)
        else:
            self.said.emit(tr("Mark {number} is in the last seconds: F10 saves them", number=self._marks), False)
        return ""

    def keep_target(self, target: Point | None, rehearsal: dict[str, Any] | None = None) -> None:
        """Keep the operator's target, source pixels, and what its rehearsal found."""
        self._target = event_of_target(target, self._now_s(), rehearsal)
        self._keep(self._target)

    def forget_rehearsal(self) -> None:
        """What the rehearsal found does not hold any more."""
        if self._target is not None and REHEARSAL in self._target.data:
            x, y = self._target.data["xy"]
            self.keep_target((x, y))

    @property
    def _receivers(self) -> tuple[SessionWriter | LiveOutput, ...]:
        return self._outputs if self._writer is None else (self._writer, *self._outputs)

    def _keep(self, event: Event) -> None:
        for receiver in self._receivers:
            receiver.add_event(event)

    def keep_drive(self, view: DriveView) -> None:
        """Keep that mode or faults have changed, also when there are no pictures."""
        for receiver in self._receivers:
            receiver.drive(view)

    def keep_rig_stop(self, message: str) -> None:
        """Keep that the rig stopped by itself, and why: from here on no pilot reports it."""
        self._keep(Event(self._now_s(), EventKind.FAULT, Cause.HEARTBEAT_LOST.value, {"detail": message}))

    def keep_alert(self, alert: Alert, time_s: float) -> None:
        """Keep an alert that was shown."""
        self._keep(event_of_alert(alert, time_s))

    def close(self) -> bool:
        """End the session; False when the disk has not answered in time."""
        self._timer.stop()
        self._engine.on_tick = None
        self._about = None  # no other writer replaces the one that ends now
        return self._writer.close(_CLOSE_WITHIN_S) if self._writer is not None else True

    def _put(self, tick: Tick) -> None:
        """A tick, in the engine's thread."""
        pilot = self._engine.pilot
        view, bus = pilot.view if pilot is not None else None, self._engine.bus_status()
        for receiver in self._receivers:
            receiver.put(tick, view, bus)

    def _update(self) -> None:
        before, self._shown = self._shown, self.status
        now = self._shown
        self.changed.emit(now)
        if (pilot := self._engine.pilot) is not None:
            for fault in faults_between(before, now):
                pilot.report_fault(fault)
        if now.saved is not None and now.saved != before.saved:
            self.said.emit(tr("Session saved: {saved}", saved=now.saved), False)
        if now.notices != before.notices:
            self.said.emit(tr_text(now.notice), True)
        if now.problem and now.problems != before.problems:  # last: what was saved until then must not cover it
            problem = now.problem.removeprefix(STOPPED)
            self.said.emit(tr("Recording stopped: {problem}", problem=tr_text(problem)), True)


class DescriptionController(QObject):
    """Asks what a session is about, or the next ones, and keeps it in a thread.

    ``said`` carries a line and whether it is a fault.

    Parameters
    ----------
    window : that the dialog belongs to.
    recorder : gets what the next sessions are about.
    """

    said = Signal(str, bool)

    def __init__(self, window: QWidget, recorder: Recorder) -> None:
        super().__init__(window)
        self._window, self._recorder = window, recorder
        self._files = Worker("descriptions", self)
        self._files.done.connect(lambda _key, line: self.said.emit(line, False) if isinstance(line, str) else None)
        self._files.submit("program", program_id)  # asks git: no recording is to wait for it
        self._files.failed.connect(lambda _session, line: self.said.emit(tr_text(line), True))

    def ask_for_next(self) -> None:
        """What the next recordings are about."""
        about = tr("The next recordings, until you say otherwise")
        dialog = DescriptionDialog(self._window, about, self._recorder.description, is_of_session=False)
        dialog.given.connect(self._keep_next)
        dialog.show()

    def ask(self, session: Path) -> None:
        """What a session is about. The next ones get it, too, without tags and notes."""
        try:
            manifest = read_manifest(session)
            description = read_description(session, manifest)
        except SessionError as error:
            self.said.emit(tr_text(str(error)), True)
            return
        dialog = DescriptionDialog(self._window, session.name, description)
        dialog.given.connect(partial(self._keep, session, is_twin=manifest.kind == "SIM"))
        dialog.show()

    def _keep(self, session: Path, description: Description, *, is_twin: bool) -> None:
        phantom = self._recorder.description.phantom if is_twin else description.phantom  # a twin's is no bench's
        self._recorder.describe(description.model_copy(update={"phantom": phantom}))
        following = self._recorder.description

        def keep() -> str:
            write_description(session, description)
            remember_description(following)
            return tr("Described: {name}", name=session.name)

        self._files.submit(session, keep)

    def _keep_next(self, description: Description) -> None:
        self._recorder.describe(description)

        def keep() -> str:
            remember_description(description)
            return tr("The next recordings will say so")

        self._files.submit("next", keep)

    def close(self) -> None:
        self._files.stop(finish=True)
        self._files.wait(_END_WITHIN_MS)


_KEY, _OFFER = "recovery", "session"
_END_WITHIN_MS = 3000


class RecoveryController(QObject):
    """Searches cut sessions beside the window, offers them, and has whole copies made of them. The damaged originals stay.

    ``said`` carries a line and whether it is a fault; ``recovered`` the folder of a copy and what it lacks, in words.

    Parameters
    ----------
    folder : where recordings go.
    offers : where to ask.
    declined : file with the names of the sessions that are not offered again.
    """

    said = Signal(str, bool)
    recovered = Signal(object, str)

    def __init__(self, folder: Path, offers: Offers, declined: Path, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._folder, self._offers, self._declined = folder, offers, declined
        self._running: OfferedCommand | None = None
        self._is_closed = False
        self._work = Worker("looking for cut sessions", self)
        self._work.done.connect(self._on_found)
        self._work.failed.connect(
            lambda _again, line: self.said.emit(tr("Cut sessions could not be looked for: {line}", line=line), True)
        )

    def search(self, *, again: bool = False) -> None:
        """Search cut sessions; `again`: also those that were declined, and a line if there was nothing."""
        folder, declined = self._folder, self._declined

        def find() -> list[Path]:
            not_wanted = set() if again else declined_names(declined)
            return [cut.folder for cut in find_cut_sessions(folder) if cut.folder.name not in not_wanted]

        if self._running is None:
            self._work.submit(again, find, once=True)

    def close(self) -> None:
        """Search no more; a running recovery ends by itself, and leaves a whole copy or none."""
        self._is_closed = True
        if self._running is not None:
            self._running.leave(end=True)
        self._work.stop(finish=False)
        self._work.wait(_END_WITHIN_MS)

    def _on_found(self, again: bool, found: list[Path]) -> None:
        if self._is_closed:  # what was found meanwhile was already on its way
            return
        if not found:
            if again:
                self.said.emit(tr("No cut session in {folder}", folder=self._folder), False)
            return
        text = tr("A recording was cut") if len(found) == 1 else tr("{count} recordings were cut", count=len(found))
        names = ", ".join(session.name for session in found)
        answers = (
            OfferButton(tr("Recover"), partial(self._recover, found), tr("Make a whole copy beside each")),
            OfferButton(tr("Not now"), lambda: None, tr("Ask again at the next start")),
            OfferButton(tr("Never"), partial(self._decline, found), tr("Do not ask again for these")),
        )
        self._offers.offer(Offer(_KEY, text, tr("{name}. The damaged original stays as it is.", name=names), answers))

    def _decline(self, sessions: list[Path]) -> None:
        names = declined_names(self._declined) | {session.name for session in sessions}
        try:
            self._declined.parent.mkdir(parents=True, exist_ok=True)
            write_atomic(self._declined, json.dumps(sorted(names)).encode())
        except OSError as error:
            self.said.emit(tr("That you do not want to be asked could not be kept ({why})", why=error.strerror), True)

    def _recover(self, sessions: list[Path]) -> None:
        """One after the other."""
        session, *others = sessions
        words = tr("Recovering a copy: {name}", name=session.name)
        command = OfferedCommand(self, self._offers, words, "session", "recover", str(session), "--progress-json", "--json")
        command.ended.connect(partial(self._on_recovered, others))
        self._running = command
        command.start()

    def _on_recovered(self, others: list[Path], told: dict[str, Any] | None, line: str, is_fault: bool) -> None:
        self._running = None
        if told is not None:
            words = loss_words(told["lost"])
            self.said.emit(tr("Recovered: {session}; {words}", session=told["session"], words=words), False)
            self.recovered.emit(Path(told["session"]), tr("Recovered; {words}", words=words))
        elif is_fault:
            menu = f"{plain(tr('&Session'))} > {plain(tr('Look for &cut sessions'))}"
            self.said.emit(tr("Not recovered: {why}. To try again: {menu}", why=tr_text(line), menu=menu), True)
        else:  # cancelled: so are the others
            self.said.emit(line, False)
            return
        if others:
            self._offers.withdraw(_OFFER)  # of the copy before, which would hide how far this one is
            self._recover(others)


def declined_names(path: Path) -> set[str]:
    """The sessions that are not offered again, by their folders' names; a file that cannot be read declines nothing."""
    try:
        names = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return set()
    return {name for name in names if isinstance(name, str)} if isinstance(names, list) else set()


def loss_words(lost: dict[str, Any]) -> str:
    if not lost["rows"] and not lost["pictures"]:
        return tr("nothing of it is lost")
    seconds, rows, pictures = lost["seconds"], lost["rows"], lost["pictures"]
    return tr("{seconds:.1f} s are lost (rows: {rows}, pictures: {pictures})", seconds=seconds, rows=rows, pictures=pictures)


class AfterSession(QObject):
    """Offers to describe, annotate, evaluate or play a session that has ended, and starts that.

    ``said`` carries a line for the operator and whether it is a fault, ``describe_asked`` the session.

    Parameters
    ----------
    offers : where to ask and to show how it goes.
    windows : opens the annotator and the player.
    show_file : opens the report; False when it cannot.
    """

    said = Signal(str, bool)
    describe_asked = Signal(object)

    def __init__(
        self,
        offers: Offers,
        windows: OtherWindows,
        show_file: Callable[[Path], bool] = open_file,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._offers, self._windows, self._show_file = offers, windows, show_file
        self.session: Path | None = None
        """The newest one, until there is another."""
        self._evaluation: OfferedCommand | None = None

    def offer(self, session: Path, text: str = mark("Session saved"), *, asks_who: bool = False) -> None:
        """A session has ended, or was recovered; `text` says which. `asks_who`: it is not known who recorded it."""
        self.session = session
        report = tr("The algorithm against angles measured by hand, as a report")
        describe = OfferButton(tr("Describe"), partial(self.describe_asked.emit, session), tr("Operator, task, condition, tags"))
        answers: tuple[OfferButton, ...] = (
            self._annotate_button(session),
            OfferButton(tr("Evaluate"), partial(self.evaluate, session), report),
            OfferButton(tr("Play"), partial(self._windows.play, session), tr("The player, with everything as it was understood")),
        )
        detail = tr("{name}, in {parent}", name=session.name, parent=session.parent)
        answers = (describe, *answers) if asks_who else (*answers, describe)
        self._offers.offer(Offer(_OFFER, tr_text(text), detail, answers))

    def withdraw(self) -> None:
        """Another recording has begun."""
        self._offers.withdraw(_OFFER)

    def close(self) -> None:
        if self._evaluation is not None:
            self._evaluation.leave(end=True)

    def evaluate(self, session: Path) -> None:
        """The report; without anything measured by hand yet, the annotation tool, for that comes first."""
        if self._evaluation is not None:
            self.said.emit(tr("An evaluation is running already"), False)
            return
        if not (session / DEFAULT_NAME).is_file():
            self._needs_annotations(session, tr("Nothing is measured by hand yet"))
            return
        out, words = session / "evaluation", tr("Evaluating {name}", name=session.name)
        command = OfferedCommand(self, self._offers, words, "evaluate", str(session), "--out", str(out), "--progress-json")
        command.ended.connect(partial(self._on_evaluated, session, out / "report.html"))
        self._evaluation = command
        command.start()

    def _on_evaluated(self, session: Path, report: Path, told: dict[str, Any] | None, line: str, is_fault: bool) -> None:
        self._evaluation = None
        if told is not None:
            judged = tr("{answered} of {measured} pictures answered", answered=told["answered"], measured=told["measured"])
            if self._show_file(report):
                self.said.emit(tr("Evaluated: {judged}. Report opened: {report}", judged=judged, report=report), False)
            else:
                self.said.emit(tr("Evaluated: {judged}. The report is: {report}", judged=judged, report=report), False)
        elif "no finished annotation" in line:
            why = tr("No picture is measured to the end yet: both lines and a state, can't tell, or no robot")
            self._needs_annotations(session, why)
        else:
            self.said.emit(tr("Not evaluated: {why}", why=tr_text(line)) if is_fault else line, is_fault)

    def _needs_annotations(self, session: Path, why: str) -> None:
        detail = tr("The annotator takes {frames} pictures, evenly over the session. Then evaluate again.", frames=FRAMES)
        self._offers.offer(Offer(_OFFER, why, detail, (self._annotate_button(session),)))

    def _annotate_button(self, session: Path) -> OfferButton:
        meaning = tr("Measure by hand: {frames} pictures, evenly over the session", frames=FRAMES)
        return OfferButton(tr("Annotate"), partial(self._windows.annotate, session), meaning)
