"""Gamepad and foot pedal, beside the keys: their threads talk straight to the pilot, never by way of the window."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Signal

from app.language import tr
from core.config import Config
from core.control.hand import Jog
from core.control.modes import Act
from core.control.pilot import Pilot
from hardware.gamepad import Gamepad, GamepadError, GamepadState
from hardware.servos.pedal import Pedal, PedalError, PedalReport


class OperatorDevices(QObject):
    """From ``start`` to ``close``. ``said`` carries a line for people: what was found, lost, or cannot be used, and what to do.

    Parameters
    ----------
    config : sections `gamepad` and `pedal`; without a pedal's port there is no pedal.
    pilot : the running rig's pilot, None while there is none; called from the devices' threads.
    stop : called instead for STOP while there is no pilot: somebody else may be moving the servos.
    """

    said = Signal(str, bool)

    def __init__(
        self,
        config: Config,
        pilot: Callable[[], Pilot | None],
        parent: QObject | None = None,
        stop: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__(parent)
        self._pilot, self._stop = pilot, stop
        self._gamepad = Gamepad(config.gamepad, self._on_gamepad, self._on_gamepad_device)
        self._gamepad_name: str | None = None
        self._pedal = Pedal(config.pedal, self._on_pedal, self._on_pedal_problem) if config.pedal.port is not None else None

    def start(self) -> None:
        self._gamepad.start()
        if self._pedal is not None:
            self._pedal.start()

    def close(self) -> None:
        """Let go, and end; may be called twice."""
        self._gamepad.close()
        if self._pedal is not None:
            self._pedal.close()

    def _on_gamepad(self, state: GamepadState) -> None:
        pilot = self._pilot() or self._pilot_after(state.stop)
        if pilot is None:
            return
        pilot.jog("gamepad", Jog(state.bend_rate, state.pitch_rate, state.advance, state.delivery))
        if state.deadman is not None:
            pilot.deadman("gamepad", state.deadman)
        if state.stop:
            pilot.ask(Act.STOP)

    def _pilot_after(self, stop: bool) -> Pilot | None:
        """Without a pilot STOP goes to whoever else has the servos; a rig may have been opened in that moment."""
        if not stop:
            return None
        self._stop()
        return self._pilot()

    def _on_gamepad_device(self, name: str | None, problem: GamepadError | None) -> None:
        before, self._gamepad_name = self._gamepad_name, name
        if problem is not None:
            self.said.emit(str(problem), True)
        elif name is not None and name != before:
            self.said.emit(tr("Gamepad: {name}", name=name), False)
        elif name is None and before is not None:
            self.said.emit(tr("Gamepad lost: {name}", name=before), True)

    def _on_pedal(self, report: PedalReport) -> None:
        pilot = self._pilot() or self._pilot_after(report.stop)
        if pilot is None:
            return
        pilot.deadman("pedal", report.deadman)
        if report.stop:
            pilot.ask(Act.STOP)

    def _on_pedal_problem(self, problem: PedalError | None) -> None:
        self.said.emit(tr("Foot pedal: ready") if problem is None else str(problem), problem is not None)
