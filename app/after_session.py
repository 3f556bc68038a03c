"""What is done with a session that has ended: annotate it, evaluate it, play it; each in a process of its own beside the window."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject, QUrl, Signal
from PySide6.QtGui import QDesktopServices

from app.child_process import ChildProcess, command_of
from app.language import mark, tr, tr_text
from app.recovery_desk import Offers
from app.widgets.offer_strip import Answer, Offer
from core.study.annotation_store import DEFAULT_NAME

FRAMES = 48
"""Pictures of a session that are offered for annotation, evenly over its time: as many as the paper's."""
REPORT = "report.html"
_OFFER, _WORK = "session", "evaluation"


def open_file(path: Path) -> bool:
    """Show a file with whatever the desktop shows such files with."""
    return QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))


class AfterSession(QObject):
    """Offers the next steps for a session, and takes them.

    ``said`` carries a line for people and whether it is a fault.

    Parameters
    ----------
    offers : where to ask and to show how it goes.
    show_file : opens the report; False when it cannot.
    """

    said = Signal(str, bool)

    def __init__(self, offers: Offers, show_file: Callable[[Path], bool] = open_file, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._offers, self._show_file = offers, show_file
        self.session: Path | None = None
        """The newest one, until there is another."""
        self._evaluation: ChildProcess | None = None
        self._windows: list[ChildProcess] = []

    def offer(self, session: Path, text: str = mark("Session saved")) -> None:
        """A session has ended, or was recovered; `text` says which."""
        self.session = session
        answers = (
            Answer(
                tr("Evaluate"), lambda: self.evaluate(session), tr("The algorithm against angles measured by hand, as a report")
            ),
            Answer(
                tr("Annotate"),
                lambda: self.annotate(session),
                tr("Measure by hand: {frames} pictures, evenly over the session", frames=FRAMES),
            ),
            Answer(tr("Play"), lambda: self.play(session), tr("The player, with everything as it was understood")),
        )
        self._offers.offer(
            Offer(_OFFER, tr_text(text), tr("{name}, in {parent}", name=session.name, parent=session.parent), answers)
        )

    def withdraw(self) -> None:
        """Another recording has begun: what is offered is no longer the matter."""
        self._offers.withdraw(_OFFER)

    def close(self) -> None:
        """Windows that people work in stay open; an evaluation ends."""
        for window in self._windows:
            window.leave()
        if self._evaluation is not None:
            self._evaluation.leave()
            self._evaluation.kill()

    # ---- the steps

    def annotate(self, session: Path) -> None:
        """The annotation tool on pictures evenly over the session."""
        self._open(
            tr("Opening the annotation tool: {name}", name=session.name),
            "annotate",
            str(session),
            "--frames",
            str(FRAMES),
            "--order",
            "even",
        )

    def play(self, session: Path) -> None:
        """The player."""
        self._open(tr("Opening the player: {name}", name=session.name), "play", str(session))

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
        done, total = record["done"], record["total"]
        left = tr(", {left:.0f} s left", left=record["left_s"]) if record.get("left_s") else ""
        self._show_share(
            session,
            done / total if total else -1.0,
            tr("{done:.0f} of {total:.0f} {what}{left}", done=done, total=total or 0, what=tr_text(record["what"]), left=left),
        )

    def _show_share(self, session: Path, share: float, detail: str) -> None:
        cancel = Answer(tr("Cancel"), self._cancel, tr("Stop; a report of before stays"))
        self._offers.offer(
            Offer(_WORK, tr("Evaluating {name}", name=session.name), detail, (cancel,), share=share, dismissed=self._cancel)
        )

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
            shown = self._show_file(report)
            judged = tr(
                "{answered} of {measured} pictures answered", answered=told.get("answered", 0), measured=told.get("measured", 0)
            )
            self.said.emit(
                (
                    tr("Evaluated: {judged}. Report opened: {report}", judged=judged, report=report)
                    if shown
                    else tr("Evaluated: {judged}. The report is: {report}", judged=judged, report=report)
                ),
                False,
            )
        elif "no finished annotation" in line:
            self._needs_annotations(session, tr("No picture is measured to the end yet: both lines and a state, or can't tell"))
        else:
            self.said.emit(tr("Not evaluated: {why}", why=tr_text(line) or tr("exit code {code}", code=code)), True)

    def _needs_annotations(self, session: Path, why: str) -> None:
        measure = Answer(
            tr("Annotate"), lambda: self.annotate(session), tr("{frames} pictures, evenly over the session", frames=FRAMES)
        )
        detail = tr("The annotation tool takes {frames} pictures, evenly over the session. Then evaluate again.", frames=FRAMES)
        self._offers.offer(Offer(_OFFER, why, detail, (measure,)))

    def _open(self, words: str, *arguments: str) -> None:
        child = ChildProcess(command_of(*arguments), self, priority=0)
        child.ended.connect(lambda code, line, one=child: self._on_closed(one, code, line))
        self._windows.append(child)
        self.said.emit(words, False)
        child.start()

    def _on_closed(self, child: ChildProcess, code: int, line: str) -> None:
        self._windows.remove(child)
        child.deleteLater()
        if code != 0:
            self.said.emit(tr_text(line) or tr("That window ended with exit code {code}", code=code), True)
