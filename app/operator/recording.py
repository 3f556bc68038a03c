"""Sessions in the operator window: recorded beside the engine's thread, annotated, evaluated and played in processes of their own.

Sessions that were cut (kill, power, full disk) are searched when the window starts, offered one by one, and recovered into copies.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from PySide6.QtCore import QObject, QTimer, QUrl, Signal, Slot
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QWidget

from app.annotator.sources import REFUSED
from app.ui.description_form import DescriptionDialog
from app.ui.i18n import mark, tr, tr_text
from app.ui.opening import OtherWindows
from app.ui.workers import NOT_STARTED, ChildProcess, Worker, command_of
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
from core.session.recovery import CutSession, find_cut_sessions
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

    @Slot()
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

    @Slot()
    def save_last(self) -> None:
        """Make a session of the last seconds, without having recorded."""
        if self._writer is None:
            return
        writer = self._usable(self._writer)
        if writer.status().ring_s <= 0.0:
            self.said.emit(tr("Nothing to save yet: record.ring_s is 0, or the rig has just been opened"), True)
            return
        writer.save_last()

    @Slot()
    def mark(self) -> None:
        """Mark this moment with a numbered note in the session, or in the last seconds; what it was can be said in the player.

        Nothing is typed here: the operator stays at the controls, and Space stays STOP.
        """
        self.note("")

    def note(self, text: str) -> str:
        """Note `text` at this moment, or a numbered mark when it is empty. Returns why it cannot be kept, "" when it is."""
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
        """Keep the operator's destination, source pixels, and what its rehearsal found."""
        self._target = event_of_target(target, self._now_s(), rehearsal)
        self._keep(self._target)

    def forget_rehearsal(self) -> None:
        """What the rehearsal found does not hold any more."""
        if self._target is not None and REHEARSAL in self._target.data:
            x, y = self._target.data["xy"]
            self.keep_target((x, y))

    def _keep(self, event: Event) -> None:
        if self._writer is not None:
            self._writer.add_event(event)
        for output in self._outputs:
            output.add_event(event)

    def keep_drive(self, view: DriveView) -> None:
        """Keep that mode or faults have changed, also when there are no pictures."""
        if self._writer is not None:
            self._writer.drive(view)
        for output in self._outputs:
            output.drive(view)

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
        writer, outputs, pilot = self._writer, self._outputs, self._engine.pilot
        view, bus = pilot.view if pilot is not None else None, self._engine.bus_status()
        if writer is not None:
            writer.put(tick, view, bus)
        for output in outputs:
            output.put(tick, view, bus)

    @Slot()
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


_KEY = "recovery"
_END_WITHIN_MS = 3000


class Offers(Protocol):
    """Where offers are shown."""

    def offer(self, offer: Offer) -> None: ...
    def withdraw(self, key: str) -> None: ...


class Declined:
    """The sessions that are not offered again, by their folders' names; a small file in the program's state folder."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def names(self) -> set[str]:
        """A file that cannot be read declines nothing."""
        try:
            names = json.loads(self._path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return set()
        return {name for name in names if isinstance(name, str)} if isinstance(names, list) else set()

    def add(self, name: str) -> None:
        """Raises OSError."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(self._path, json.dumps(sorted(self.names() | {name})).encode())


class RecoveryController(QObject):
    """Searches, measures, offers and recovers cut sessions beside the window. The damaged original is never changed.

    ``said`` carries a line and whether it is a fault; ``recovered`` the folder of a copy and what it lacks, in words.

    Parameters
    ----------
    folder : where recordings go.
    offers : where to ask.
    declined : what is not asked again.
    """

    said = Signal(str, bool)
    recovered = Signal(object, str)

    def __init__(self, folder: Path, offers: Offers, declined: Declined, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._folder, self._offers, self._declined = folder, offers, declined
        self._waiting: list[CutSession] = []
        self._found = 0
        self._child: ChildProcess | None = None
        self._says_none = False
        self._is_closed = False
        self._work = Worker("looking for cut sessions", self)
        self._work.done.connect(self._on_found)
        self._work.failed.connect(self._on_search_failed)

    def search(self, *, again: bool = False) -> None:
        """Search cut sessions; `again`: also those that were declined, and a line if there was nothing."""
        if self._child is not None or self._waiting or self._is_closed:
            return
        self._says_none = again
        folder, declined = self._folder, self._declined

        def find() -> list[CutSession]:
            not_wanted = set() if again else declined.names()
            return [cut for cut in find_cut_sessions(folder) if cut.folder.name not in not_wanted]

        self._work.submit("search", find, once=True)

    def close(self) -> None:
        """Search no more; a running recovery ends by itself, and leaves a whole copy or none."""
        self._is_closed = True
        if self._child is not None:
            self._child.leave()
            self._child.ask_to_end()
        self._work.stop(finish=False)
        self._work.wait(_END_WITHIN_MS)

    def _on_found(self, _key: object, found: list[CutSession]) -> None:
        if self._is_closed:  # what was found meanwhile was already on its way
            return
        self._waiting, self._found = list(found), len(found)
        if not found and self._says_none:
            self.said.emit(tr("No cut session in {folder}", folder=self._folder), False)
        self._measure_next()

    def _on_search_failed(self, _key: object, line: str) -> None:
        self.said.emit(tr("Cut sessions could not be looked for: {line}", line=line), True)

    # ---- one after the other

    def _measure_next(self) -> None:
        """How much would be lost is measured before the operator is asked."""
        if self._waiting:
            self._run("--only-look", self._waiting[0].folder, lambda _record: None, self._on_measured, self._measure_next)

    def _on_measured(self, session: Path, told: dict[str, Any], code: int, line: str) -> None:
        lost = told.get("lost")
        never = OfferButton(tr("Never"), lambda: self._decline(session), tr("Do not ask again for this one"))
        if code != 0 or not isinstance(lost, dict):
            text = tr("A recording was cut, and it cannot be recovered")
            self._ask(text, line or session.name, (never,), is_fault=True)
            return
        number = self._found - len(self._waiting) + 1
        place = tr(" ({place} of {count})", place=number, count=self._found) if self._found > 1 else ""
        kept = tr("{count} pictures are whole", count=told.get("pictures", 0))
        recover = tr("Make a whole copy beside {session}", session=session)
        self._ask(
            tr("A recording was cut{place}: {loss}", place=place, loss=loss_words(lost)),
            tr("{name}; {kept}. The damaged original stays as it is.", name=session.name, kept=kept),
            (OfferButton(tr("Recover"), lambda: self._recover(session), recover), self._not_now(), never),
        )

    def _ask(self, text: str, detail: str, answers: tuple[OfferButton, ...], *, is_fault: bool = False) -> None:
        self._offers.offer(Offer(_KEY, text, detail, answers, is_fault=is_fault, dismissed=self._next))

    def _not_now(self) -> OfferButton:
        return OfferButton(tr("Not now"), self._next, tr("Ask again at the next start"))

    def _next(self) -> None:
        self._waiting.pop(0)
        self._measure_next()

    def _decline(self, session: Path) -> None:
        try:
            self._declined.add(session.name)
        except OSError as error:
            self.said.emit(tr("That you do not want to be asked could not be kept ({why})", why=error.strerror), True)
        self._next()

    def _recover(self, session: Path) -> None:
        def show_share(record: dict[str, Any]) -> None:
            done, total = record.get("done"), record.get("total")
            share = min(1.0, done / total) if done is not None and total else -1.0
            self._offers.offer(Offer(_KEY, tr("Recovering a copy"), session.name, share=share))

        show_share({})
        self._run("--progress-json", session, show_share, self._on_recovered, lambda: self._recover(session))

    def _on_recovered(self, session: Path, told: dict[str, Any], code: int, line: str) -> None:
        self._offers.withdraw(_KEY)
        if code == 0 and "session" in told:
            words = loss_words(told["lost"])
            self.said.emit(tr("Recovered: {session}; {words}", session=told["session"], words=words), False)
            self.recovered.emit(Path(told["session"]), tr("Recovered; {words}", words=words))
        else:
            self.said.emit(tr("Not recovered: {why}", why=tr_text(line) or tr("exit code {code}", code=code)), True)
        self._next()

    def _run(
        self,
        option: str,
        session: Path,
        on_progress: Callable[[dict[str, Any]], None],
        on_result: Callable[[Path, dict[str, Any], int, str], None],
        again: Callable[[], None],
    ) -> None:
        told: dict[str, Any] = {}

        def on_told(record: dict[str, Any]) -> None:
            if "done" in record:
                on_progress(record)
            else:
                told.update(record)

        def on_ended(code: int, line: str) -> None:
            self._child = None
            if code != NOT_STARTED and code >= 0:
                on_result(session, told, code, line)
                return
            # It never began, or a signal ended it: the session may well be recovered at another time.
            if code == NOT_STARTED:
                text = tr("A recording was cut; the program that recovers it could not be started")
            else:
                text = tr("A recording was cut; the program that recovers it was ended from outside")
            why = f": {tr_text(line)}" if line else ""
            retry = OfferButton(tr("Try again"), again, tr("Once there is memory and room on the disk, for instance"))
            self._ask(text, f"{session.name}{why}", (retry, self._not_now()), is_fault=True)

        self._child = ChildProcess(command_of("session", "recover", str(session), option, "--json"), self)
        self._child.told.connect(on_told)
        self._child.ended.connect(on_ended)
        self._child.start()


def loss_words(lost: dict[str, Any]) -> str:
    if not lost["rows"] and not lost["pictures"]:
        return tr("nothing of it is lost")
    seconds, rows, pictures = lost["seconds"], lost["rows"], lost["pictures"]
    return tr("{seconds:.1f} s are lost (rows: {rows}, pictures: {pictures})", seconds=seconds, rows=rows, pictures=pictures)


FRAMES = 48
"""Pictures of a session that are offered for annotation, evenly over its time: as many as in the paper."""
REPORT = "report.html"
_OFFER, _WORK = "session", "evaluation"


def open_file(path: Path) -> bool:
    """Show a file with whatever the desktop shows such files with."""
    return QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))


class AfterSession(QObject):
    """Offers to describe, annotate, evaluate or play a session that has ended, and starts that.

    ``said`` carries a line for the operator and whether it is a fault, ``describe_asked`` the session.

    Parameters
    ----------
    offers : where to ask and to show how it goes.
    show_file : opens the report; False when it cannot.
    """

    said = Signal(str, bool)
    describe_asked = Signal(object)

    def __init__(self, offers: Offers, show_file: Callable[[Path], bool] = open_file, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._offers, self._show_file = offers, show_file
        self.session: Path | None = None
        """The newest one, until there is another."""
        self._evaluation: ChildProcess | None = None
        self._windows = OtherWindows(self)
        self._windows.said.connect(self.said)

    def offer(self, session: Path, text: str = mark("Session saved"), *, asks_who: bool = False) -> None:
        """A session has ended, or was recovered; `text` says which. `asks_who`: it is not known who recorded it."""
        self.session = session
        report = tr("The algorithm against angles measured by hand, as a report")
        measure = tr("Measure by hand: {frames} pictures, evenly over the session", frames=FRAMES)
        describe = OfferButton(tr("Describe"), partial(self.describe_asked.emit, session), tr("Operator, task, condition, tags"))
        answers: tuple[OfferButton, ...] = (
            OfferButton(tr("Annotate"), partial(self.annotate, session), measure),
            OfferButton(tr("Evaluate"), partial(self.evaluate, session), report),
            OfferButton(tr("Play"), partial(self.play, session), tr("The player, with everything as it was understood")),
        )
        detail = tr("{name}, in {parent}", name=session.name, parent=session.parent)
        answers = (describe, *answers) if asks_who else (*answers, describe)
        self._offers.offer(Offer(_OFFER, tr_text(text), detail, answers))

    def withdraw(self) -> None:
        """Another recording has begun."""
        self._offers.withdraw(_OFFER)

    def close(self) -> None:
        """Windows that people work in stay open; an evaluation ends."""
        self._windows.leave()
        if self._evaluation is not None:
            self._evaluation.leave()
            self._evaluation.kill()

    # ---- the steps

    def annotate(self, session: Path) -> None:
        """The annotation tool on pictures evenly over the session."""
        options = ("--frames", str(FRAMES), "--order", "even")
        self._windows.open(tr("Opening the annotator: {name}", name=session.name), "annotate", str(session), *options)

    def annotate_refused(self, session: Path) -> None:
        """The annotation tool on pictures without a pose."""
        self._windows.open(tr("Opening the annotator: {name}", name=session.name), "annotate", str(session), "--rows", REFUSED)

    def play(self, session: Path) -> None:
        self._windows.open(tr("Opening the player: {name}", name=session.name), "play", str(session))

    def open_library(self, folder: Path) -> None:
        """All sessions of a folder."""
        self._windows.open(tr("Opening the library"), "library", str(folder))

    def evaluate(self, session: Path) -> None:
        """The report; without anything measured by hand yet, the annotation tool, for that comes first."""
        if self._evaluation is not None:
            self.said.emit(tr("An evaluation is running already"), False)
            return
        if not (session / DEFAULT_NAME).is_file():
            self._needs_annotations(session, tr("Nothing is measured by hand yet"))
            return
        out = session / "evaluation"
        told: dict[str, Any] = {}
        child = ChildProcess(command_of("evaluate", str(session), "--out", str(out), "--progress-json"), self)
        child.told.connect(lambda record: self._on_told(session, record, told))
        child.ended.connect(lambda code, line: self._on_evaluated(session, told, code, line))
        self._evaluation = child
        self._show_share(session, -1.0, tr("loading the network"))
        child.start()

    def _on_told(self, session: Path, record: dict[str, Any], told: dict[str, Any]) -> None:
        if "done" not in record:
            told.update(record)
            return
        done, total, what = record["done"], record["total"], tr_text(record["what"])
        left = tr(", {left:.0f} s left", left=record["left_s"]) if record.get("left_s") else ""
        detail = tr("{done:.0f} of {total:.0f} {what}{left}", done=done, total=total or 0, what=what, left=left)
        self._show_share(session, done / total if total else -1.0, detail)

    def _show_share(self, session: Path, share: float, detail: str) -> None:
        cancel = OfferButton(tr("Cancel"), self._cancel, tr("Stop; a report of before stays"))
        text = tr("Evaluating {name}", name=session.name)
        self._offers.offer(Offer(_WORK, text, detail, (cancel,), share=share, dismissed=self._cancel))

    def _cancel(self) -> None:
        child, self._evaluation = self._evaluation, None
        if child is not None:
            child.leave()
            child.kill()
            self.said.emit(tr("Evaluation cancelled"), False)

    def _on_evaluated(self, session: Path, told: dict[str, Any], code: int, line: str) -> None:
        self._evaluation = None
        self._offers.withdraw(_WORK)
        if code == 0:
            report = session / "evaluation" / REPORT
            answered, measured = told.get("answered", 0), told.get("measured", 0)
            judged = tr("{answered} of {measured} pictures answered", answered=answered, measured=measured)
            if self._show_file(report):
                self.said.emit(tr("Evaluated: {judged}. Report opened: {report}", judged=judged, report=report), False)
            else:
                self.said.emit(tr("Evaluated: {judged}. The report is: {report}", judged=judged, report=report), False)
        elif "no finished annotation" in line:
            self._needs_annotations(
                session, tr("No picture is measured to the end yet: both lines and a state, can't tell, or no robot")
            )
        else:
            self.said.emit(tr("Not evaluated: {why}", why=tr_text(line) or tr("exit code {code}", code=code)), True)

    def _needs_annotations(self, session: Path, why: str) -> None:
        pictures = tr("{frames} pictures, evenly over the session", frames=FRAMES)
        measure = OfferButton(tr("Annotate"), partial(self.annotate, session), pictures)
        detail = tr("The annotator takes {frames} pictures, evenly over the session. Then evaluate again.", frames=FRAMES)
        self._offers.offer(Offer(_OFFER, why, detail, (measure,)))
