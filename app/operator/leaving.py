"""What becomes of servos that hold when the window closes: hold, relax slowly, or torque off. Asked of a LIVE rig only."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtWidgets import QCheckBox, QMessageBox, QWidget

from app.operator.rig_session import RigSession
from app.ui.i18n import mark, tr
from app.ui.window_base import is_asked_to_end, may_be_asked
from core.config.rig_file import RigFileError, set_at_close
from core.config.safety import AtClose
from core.control.faults import Cause
from hardware.rig import RigKind
from hardware.servos.bus_ipc import BusStatus

ANSWERS: dict[AtClose, str] = {"relax": mark("Relax slowly"), "hold": mark("Hold"), "torque off": mark("Torque off now")}
"""Answers to the question, the recommended one first."""
_LOOK_EVERY_MS = 100
_PATIENCE_S = 20.0
"""Longer than relaxing and proving that the torque is off take."""


class LeavingQuestion(QObject):
    """Asks before the window closes, and does what is answered; ``done`` when the window may close.

    The question does not block: STOP stays within reach, and the robot goes on holding.

    Parameters
    ----------
    say : tells the operator a line, and whether it is a fault.
    """

    done = Signal()

    def __init__(self, window: QWidget, rig: RigSession, say: Callable[[str, bool], None]) -> None:
        super().__init__(window)
        self._window, self._rig, self._say = window, rig, say
        self._was_asked_to_end = False
        self._is_decided = False
        self._before: BusStatus | None = None
        self._begun_s = 0.0
        self.box: QMessageBox | None = None
        """The question, while it is asked."""
        self._look = QTimer(self, interval=_LOOK_EVERY_MS)
        self._look.timeout.connect(self._on_look)

    def may_close(self) -> bool:
        """Whether the window may close now; else ``done`` comes later, or the operator stays."""
        status = self._rig.engine.bus_status()
        if self._is_decided or self._rig.kind is not RigKind.LIVE or status is None or not status.pulls:
            return True
        if self.box is not None or self._look.isActive():  # asked to close once more
            if self.box is not None:
                self.box.raise_()
            return is_asked_to_end()
        at_close = self._rig.config.servos.at_close
        if at_close != "ask":
            return self._leave(at_close)
        if is_asked_to_end() and (self._was_asked_to_end or not may_be_asked()):
            return True
        self._was_asked_to_end = is_asked_to_end()
        self._ask()
        return False

    def _ask(self) -> None:
        servos = self._rig.config.servos
        box = QMessageBox(QMessageBox.Icon.Question, tr("The servos hold"), tr("The servos hold the wires."), parent=self._window)
        box.setInformativeText(
            tr(
                "Relax slowly: the wires are let out at 1 mm/s, then the torque goes off.\n"
                "Hold: they stay as they are; heat, supply and current are watched, and after {minutes:.0f} min they are relaxed.\n"
                "Torque off now: the wires spring back at once.",
                minutes=servos.unattended_s / 60.0,
            )
        )
        for how, title in ANSWERS.items():
            button = box.addButton(tr(title), QMessageBox.ButtonRole.AcceptRole)
            button.clicked.connect(partial(self._on_answer, how, box))
            if how == "relax":
                box.setDefaultButton(button)
        box.setEscapeButton(box.addButton(tr("Do not close"), QMessageBox.ButtonRole.RejectRole))
        if self._rig.config.rig.file is not None:
            box.setCheckBox(QCheckBox(tr("Always so for this rig"), box))  # without a parent Python would delete it
        box.setModal(False)
        box.finished.connect(self._on_finished)
        self.box = box
        box.show()

    def _on_finished(self) -> None:
        if not is_asked_to_end():  # a second request to end closes the question, too, perhaps before it is asked here
            self._was_asked_to_end = False
        if self.box is not None:
            self.box.deleteLater()
            self.box = None

    def _on_answer(self, how: AtClose, box: QMessageBox, _checked: bool = False) -> None:
        always, file = box.checkBox(), self._rig.config.rig.file
        if always is not None and always.isChecked() and file is not None:
            try:
                set_at_close(Path(file), how)
            except RigFileError as error:
                self._say(str(error), True)
        if self._leave(how):
            self._finish()

    def _leave(self, how: AtClose) -> bool:
        """Begin it; whether it is done already."""
        pilot = self._rig.pilot
        if how == "hold" or pilot is None:
            return True
        self._before, self._begun_s = self._rig.engine.bus_status(), time.monotonic()
        if not (pilot.relax() if how == "relax" else pilot.torque_off()):  # while it drives, and while it does something else
            self._say(tr("The window stays open: disarm first (Shift+F6), or wait until the servos are ready"), True)
            return False
        if how == "relax":
            self._say(tr("The wires are relaxed, then the window closes; STOP ends it"), False)
        else:
            self._say(tr("The torque goes off, then the window closes"), False)
        self._look.start()
        return False

    def _on_look(self) -> None:
        status, before = self._rig.engine.bus_status(), self._before
        stops, known = (one.fault_counts.get(Cause.STOP_PRESSED, 0) if one is not None else 0 for one in (status, before))
        if status is None or not status.pulls:
            self._finish()
        elif stops > known:
            self._look.stop()
            self._say(tr("Stopped: the window stays open, and the wires are as they were then"), True)
        elif time.monotonic() - self._begun_s > _PATIENCE_S:
            self._look.stop()
            self._say(tr("The torque is not proven to be off: cut the servos' power"), True)

    def _finish(self) -> None:
        self._look.stop()
        self._is_decided = True
        self.done.emit()
