"""Alert sounds by whatever player the system has; without one, its beep."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QObject, QProcess, QTimer, Slot
from PySide6.QtWidgets import QApplication

from core.config import RESOURCES

SOUNDS = ("hold", "disarm", "stop")
"""Names as in ``core.control.alerts``, most urgent last."""
_PLAYERS = (("pw-play",), ("paplay",), ("aplay", "-q"), ("afplay",))
_LONGEST_MS = 3000
_END_WITHIN_MS = 500

_log = logging.getLogger(__name__)


class AlertSounds(QObject):
    """Plays one sound at a time and never waits for it.

    While a sound is heard, only a more urgent one is played, instead of it. A player that fails (it is installed, but there is no
    sound server) is given up with one line in the log, and the sound goes to the next one.

    Parameters
    ----------
    parent : owner.
    folder : where ``<name>.wav`` are.
    """

    def __init__(self, parent: QObject | None = None, folder: Path = RESOURCES / "sounds") -> None:
        super().__init__(parent)
        self._folder = folder
        self._players = [(path, *rest) for name, *rest in _PLAYERS if (path := shutil.which(name)) is not None]
        self._muted = False
        self._playing: str | None = None
        self._next: str | None = None
        self._cut_short = False
        self._is_logged = False
        self._process = QProcess(self)
        self._process.setStandardOutputFile(QProcess.nullDevice())
        self._process.setStandardInputFile(QProcess.nullDevice())
        self._process.finished.connect(self._on_finished)
        self._process.errorOccurred.connect(self._on_error)
        self._guard = QTimer(self)
        self._guard.setSingleShot(True)
        self._guard.setInterval(_LONGEST_MS)
        self._guard.timeout.connect(self._process.kill)  # a player that hangs is a player that fails
        application = QCoreApplication.instance()
        if application is not None:
            application.aboutToQuit.connect(self.close)
        if parent is not None:
            parent.destroyed.connect(self.close)  # comes before its children go, and Qt warns of a process that goes while it runs

    @property
    def muted(self) -> bool:
        """Nothing is heard."""
        return self._muted

    @muted.setter
    def muted(self, muted: bool) -> None:
        self._muted = muted
        if muted:
            self._next = None
            self._cut()

    @property
    def playing(self) -> str | None:
        """The sound that is heard now."""
        return self._playing

    def play(self, name: str) -> None:
        """Play the sound `name` (one of ``SOUNDS``), unless an equally or more urgent one is being heard. Returns at once."""
        if self._muted:
            return
        if name not in SOUNDS or not (self._folder / f"{name}.wav").is_file():
            self._log_once("there is no sound %r in %s; put resources/sounds back", name, self._folder)
            QApplication.beep()
        elif self._playing is None:
            self._start(name)
        elif SOUNDS.index(name) > SOUNDS.index(self._next or self._playing):
            self._next = name
            self._cut()

    @Slot()
    def close(self) -> None:
        """End what is being heard; waits for it half a second at most."""
        self._next = None
        if self._process.state() != QProcess.ProcessState.NotRunning:
            self._cut()
            self._process.waitForFinished(_END_WITHIN_MS)

    def _start(self, name: str) -> None:
        if not self._players:
            self._log_once("no player of sounds works (looked for pw-play, paplay, aplay, afplay): alerts only beep")
            QApplication.beep()
            return
        program, *options = self._players[0]
        self._playing = name
        self._cut_short = False
        self._guard.start()
        self._process.start(program, [*options, str(self._folder / f"{name}.wav")])

    def _cut(self) -> None:
        if self._process.state() != QProcess.ProcessState.NotRunning:
            self._cut_short = True
            self._process.kill()

    @Slot(int, QProcess.ExitStatus)
    def _on_finished(self, code: int, status: QProcess.ExitStatus) -> None:
        failed = not self._cut_short and (code != 0 or status != QProcess.ExitStatus.NormalExit)
        error = bytes(self._process.readAllStandardError().data()).decode(errors="replace")
        self._go_on("gave up" if failed else None, " ".join(error.split())[:200] or f"exit code {code}")

    @Slot(QProcess.ProcessError)
    def _on_error(self, error: QProcess.ProcessError) -> None:
        # a process that never started does not finish either
        if error == QProcess.ProcessError.FailedToStart:
            self._go_on("did not start", self._process.errorString())

    def _go_on(self, failure: str | None, why: str) -> None:
        """The process has ended: play what waits, or the same once more by another player when this one failed."""
        self._guard.stop()
        name, self._playing = self._playing, None
        following, self._next = self._next, None
        if failure is not None:
            player = self._players.pop(0)
            _log.warning("the player %s %s: %s", player[0], failure, why)
            following = following or name
        if following is not None and not self._muted:
            self._start(following)

    def _log_once(self, message: str, *values: object) -> None:
        if not self._is_logged:
            self._is_logged = True
            _log.warning(message, *values)
