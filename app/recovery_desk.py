"""Sessions that were cut (kill, power, full disk): looked for when the window starts, offered one by one, recovered into copies."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from PySide6.QtCore import QObject, Signal

from app.child_process import NOT_STARTED, ChildProcess, command_of
from app.language import tr, tr_text
from app.widgets.offer_strip import Answer, Offer
from app.work_thread import WorkThread
from core.session.recovery import CutSession, find_cut_sessions
from core.whole_file import write_whole

_KEY = "recovery"
_END_WITHIN_MS = 3000


class Offers(Protocol):
    """Where offers are shown."""

    def offer(self, offer: Offer) -> None: ...
    def withdraw(self, key: str) -> None: ...


class Declined:
    """The sessions that nobody wants to hear of again, by their folders' names; a small file in the program's state folder."""

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
        write_whole(self._path, json.dumps(sorted(self.names() | {name})).encode())


class RecoveryDesk(QObject):
    """Looks, measures, offers, recovers. The window waits for none of it, and the damaged original is never touched.

    ``said`` carries a line for people and whether it is a fault; ``recovered`` the folder of a copy and what it lacks, in words.

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
        self._work = WorkThread("looking for cut sessions", self)
        self._work.done.connect(self._on_looked)
        self._work.failed.connect(self._on_look_failed)

    def look(self, *, again: bool = False) -> None:
        """Look for cut sessions; `again`: also for those that were declined, and say when there are none."""
        if self._child is not None or self._waiting or self._is_closed:
            return
        self._says_none = again
        folder, declined = self._folder, self._declined

        def find() -> list[CutSession]:
            not_wanted = set() if again else declined.names()
            return [cut for cut in find_cut_sessions(folder) if cut.folder.name not in not_wanted]

        self._work.submit("look", find, once=True)

    def close(self) -> None:
        """Look no further; a recovery that goes on ends by itself, and leaves a whole copy or none."""
        self._is_closed = True
        if self._child is not None:
            self._child.leave()
            self._child.ask_to_end()
        self._work.stop(finish=False)
        self._work.wait(_END_WITHIN_MS)

    def _on_looked(self, _key: object, found: list[CutSession]) -> None:
        if self._is_closed:  # what was found meanwhile was already on its way
            return
        self._waiting, self._found = list(found), len(found)
        if not found and self._says_none:
            self.said.emit(tr("No cut session in {folder}", folder=self._folder), False)
        self._measure_next()

    def _on_look_failed(self, _key: object, line: str) -> None:
        self.said.emit(tr("Cut sessions could not be looked for: {line}", line=line), True)

    # ---- one after the other

    def _measure_next(self) -> None:
        """How much would be lost is read before anybody is asked."""
        if not self._waiting:
            return
        session = self._waiting[0].folder
        told: dict[str, Any] = {}
        self._run("--only-look", session, told.update, lambda code, line: self._on_measured(session, told, code, line))

    def _on_measured(self, session: Path, told: dict[str, Any], code: int, line: str) -> None:
        self._child = None
        lost = told.get("lost")
        if _says_nothing(code):
            self._offer_again(session, code, line, self._measure_next)
            return
        if code != 0 or not isinstance(lost, dict):
            never = Answer(tr("Never"), lambda: self._decline(session), tr("Do not ask again for this one"))
            text = tr("A recording was cut, and it cannot be recovered")
            self._offers.offer(Offer(_KEY, text, line or session.name, (never,), is_fault=True, dismissed=self._next))
            return
        place = (
            tr(" ({place} of {count})", place=self._found - len(self._waiting) + 1, count=self._found) if self._found > 1 else ""
        )
        text = tr("A recording was cut{place}: {loss}", place=place, loss=loss_words(lost))
        kept = tr("{count} pictures are whole", count=told.get("pictures", 0))
        self._offers.offer(
            Offer(
                _KEY,
                text,
                tr("{name}; {kept}. The damaged original stays as it is.", name=session.name, kept=kept),
                (
                    Answer(
                        tr("Recover"), lambda: self._recover(session), tr("Make a whole copy beside {session}", session=session)
                    ),
                    Answer(tr("Not now"), self._next, tr("Ask again at the next start")),
                    Answer(tr("Never"), lambda: self._decline(session), tr("Do not ask again for this one")),
                ),
                dismissed=self._next,
            )
        )

    def _offer_again(self, session: Path, code: int, line: str, again: Callable[[], None]) -> None:
        """The session may well be recovered, at another time; so nothing is said against it."""
        if code == NOT_STARTED:
            text = tr("A recording was cut; the program that recovers it could not be started")
        else:
            text = tr("A recording was cut; the program that recovers it was ended from outside")
        why = f": {tr_text(line)}" if line else ""
        answers = (
            Answer(tr("Try again"), again, tr("Once there is memory and room on the disk, for instance")),
            Answer(tr("Not now"), self._next, tr("Ask again at the next start")),
        )
        self._offers.offer(Offer(_KEY, text, f"{session.name}{why}", answers, is_fault=True, dismissed=self._next))

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
        told: dict[str, Any] = {}

        def on_told(record: dict[str, Any]) -> None:
            if "done" in record:  # progress
                self._show_share(session, record)
            else:
                told.update(record)

        self._show_share(session, {})
        self._run("--progress-json", session, on_told, lambda code, line: self._on_recovered(session, told, code, line))

    def _show_share(self, session: Path, record: dict[str, Any]) -> None:
        done, total = record.get("done"), record.get("total")
        share = min(1.0, done / total) if done is not None and total else -1.0
        self._offers.offer(Offer(_KEY, tr("Recovering a copy"), session.name, share=share))

    def _on_recovered(self, session: Path, told: dict[str, Any], code: int, line: str) -> None:
        self._child = None
        if _says_nothing(code):
            self._offer_again(session, code, line, lambda: self._recover(session))
            return
        self._offers.withdraw(_KEY)
        if code == 0 and "session" in told:
            words = loss_words(told["lost"])
            self.said.emit(tr("Recovered: {session}; {words}", session=told["session"], words=words), False)
            self.recovered.emit(Path(told["session"]), tr("Recovered; {words}", words=words))
        else:
            self.said.emit(tr("Not recovered: {why}", why=tr_text(line) or tr("exit code {code}", code=code)), True)
        self._next()

    def _run(
        self, option: str, session: Path, on_told: Callable[[dict[str, Any]], None], on_ended: Callable[[int, str], None]
    ) -> None:
        self._child = ChildProcess(command_of("session", "recover", str(session), option, "--json"), self)
        self._child.told.connect(on_told)
        self._child.ended.connect(on_ended)
        self._child.start()


def _says_nothing(code: int) -> bool:
    """Whether a process never began, or a signal ended it: that tells nothing of the session."""
    return code == NOT_STARTED or code < 0


def loss_words(lost: dict[str, Any]) -> str:
    """A loss as people say it."""
    if not lost["rows"] and not lost["pictures"]:
        return tr("nothing of it is lost")
    return tr(
        "{seconds:.1f} s are lost (rows: {rows}, pictures: {pictures})",
        seconds=lost["seconds"],
        rows=lost["rows"],
        pictures=lost["pictures"],
    )
