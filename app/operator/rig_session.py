"""The rig of a window from opening to the end: its configuration, its phase, what may be asked of it, and STOP."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from enum import Enum
from functools import partial

from PySide6.QtCore import QObject, QTimer, Signal

from app.operator.engine_thread import EngineLike, EnginePhase, EngineStatus, EngineThread
from app.ui.i18n import mark
from app.ui.texts import OperatorStep
from core.config.models import Config
from core.config.rig_file import RigFileError, as_calibrated
from core.control.pilot import Pilot
from core.devices import DeviceError
from hardware.rig import RigKind, kind_of

OpenEngineFor = Callable[[Config], EngineLike]
Guard = Callable[[OperatorStep], bool]
ConfigSource = Callable[[Config], Config]

_PAINTED_AFTER_MS = 60
"""By then the window has painted itself on a screen of this machine. Opening a rig imports for seconds and holds up the painting,
which takes longer where it begins later."""


class StopOutcome(Enum):
    """What a STOP has reached, in the words of the box after an unforeseen error."""

    SERVOS = mark("The servos were stopped")
    OPENING = mark("The rig that is being opened starts stopped")
    NOTHING = mark("No servos were in use, so there was nothing to stop")
    UNKNOWN = mark("It is not certain that the servos were stopped: press Space")


class RigSession(QObject):
    """Opens one rig after the other in the engine's thread, and lends camera and servos to something else (the rig wizard).

    ``leaving`` comes while the old rig still runs, ``releasing`` when the operator's controls are let go, ``config_changed`` when
    another rig or phantom is going to be opened, ``preparing`` when its configuration is final, and ``phase_changed`` with each
    ``EnginePhase``. Lent, the rig is in FAULT with the reason as its message.

    Other parts of the window register themselves:

    - a guard refuses steps of the operator, and says why itself;
    - a configuration source changes the configuration of the rig that is about to be opened;
    - a work says what would be broken off if the rig were opened again, "" for nothing;
    - a borrower stops what it moves with a lent rig, and returns whether it moves anything.

    Parameters
    ----------
    config : what is opened first.
    open_engine : opens rig and engine for a configuration; called in the engine's thread, may take seconds, may raise.
    """

    leaving = Signal()
    releasing = Signal()
    config_changed = Signal()
    preparing = Signal()
    phase_changed = Signal(object)

    def __init__(self, config: Config, open_engine: OpenEngineFor, kind: RigKind, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._open_engine = open_engine
        self.config = config
        """In force; ``use_config`` opens another rig."""
        self.kind = kind
        self.phase = EnginePhase.IDLE
        self.message = ""
        """Why the rig has ended or is in FAULT."""
        self.orders = 0
        """How often a rig was opened or lent: tells whether another one was asked for since."""
        self.engine = EngineThread(self)
        self._is_shut = False
        self._guards: list[Guard] = []
        self._sources: list[tuple[ConfigSource, bool]] = []
        self._works: list[Callable[[], str]] = []
        self._borrowers: list[Callable[[], bool]] = []
        self._first = QTimer(self, singleShot=True, interval=_PAINTED_AFTER_MS)
        self._first.timeout.connect(self._open)
        self.engine.status_changed.connect(self._on_status)

    # ---- what other parts register

    def add_guard(self, guard: Guard) -> None:
        """Ask it before each step of the operator; the last one that was added comes first."""
        self._guards.insert(0, guard)

    def add_config_source(self, source: ConfigSource, *, rereads: bool = False) -> None:
        """Ask it, in the order of adding, before a rig is opened; with `rereads` also by ``reread_config``."""
        self._sources.append((source, rereads))

    def add_work(self, work: Callable[[], str]) -> None:
        self._works.append(work)

    def add_borrower(self, stop: Callable[[], bool]) -> None:
        """`stop` is called from any thread."""
        self._borrowers.append(stop)

    def may_ask(self, step: OperatorStep) -> bool:
        """Whether no guard refuses the step."""
        return all(guard(step) for guard in self._guards)

    def reread_config(self) -> Config:
        """The configuration with what was edited in its files meanwhile."""
        config = self.config
        for source, rereads in self._sources:
            config = source(config) if rereads else config
        return config

    def work_in_progress(self) -> str:
        """What opening the rig again would break off; empty: nothing."""
        return next((why for work in self._works if (why := work())), "")

    # ---- the running rig

    @property
    def pilot(self) -> Pilot | None:
        """The running rig's pilot; from any thread."""
        return self.engine.pilot

    @property
    def is_over(self) -> bool:
        """Whether the rig has ended or is in FAULT."""
        return self.phase in (EnginePhase.ENDED, EnginePhase.FAULT)

    def calibrated(self, config: Config) -> Config:
        """With what the rig file knows better; what is wrong with that file is reported when the rig is opened."""
        with contextlib.suppress(RigFileError):
            return as_calibrated(config)
        return config

    def stop(self) -> StopOutcome:
        """STOP to the rig's pilot, to a rig that is being opened, and to what borrows the rig; from any thread."""
        before = self.pilot
        if before is not None:
            before.stop()
        is_opening, moved = self.engine.stop_opening(), [stop() for stop in self._borrowers]
        pilot = self.pilot
        if pilot is not None and pilot is not before:  # opened between the questions
            pilot.stop()
        if before is not None or pilot is not None or any(moved):
            return StopOutcome.SERVOS
        return StopOutcome.OPENING if is_opening else StopOutcome.NOTHING

    def halt(self) -> None:
        """End all driving and let go of the controls: the rig is about to be closed."""
        if (pilot := self.pilot) is not None:
            pilot.halt()
        self.releasing.emit()

    # ---- opening and closing

    def start(self) -> None:
        """Open the first rig once the window has painted itself."""
        self._prepare()
        self.engine.announce_engine()
        self._first.start()

    def restart(self) -> None:
        if not self._is_shut:
            self._leave()
            self._prepare()
            self._open()

    def use_config(self, config: Config) -> None:
        """Open the rig of another configuration; it may be of another kind."""
        self._leave()
        if kind_of(config.rig) is not kind_of(self.config.rig):
            self.kind = kind_of(config.rig)
        self.config = config
        self.config_changed.emit()
        self.restart()

    def lend(self, why: str) -> None:
        """Close the rig, so that a borrower can have camera and servos; it stays in FAULT with `why` until it is opened again."""
        self.halt()
        self._start_engine(partial(_lent, why))

    def shut(self) -> None:
        """Open nothing any more; the window closes."""
        self._is_shut = True
        self._first.stop()

    def _leave(self) -> None:
        self.engine.announce_engine()
        self.leaving.emit()  # the last changes of the old rig belong to its session
        self.engine.end_engine()  # before anything else changes: nothing of the old rig is shown or recorded as of the new one

    def _prepare(self) -> None:
        config = self.config
        for source, _ in self._sources:
            config = source(config)
        is_another = config.rig != self.config.rig
        self.config = config
        if is_another:
            self.kind = kind_of(config.rig)
            self.config_changed.emit()
        self.halt()
        self.preparing.emit()
        self._set_phase(EnginePhase.STARTING)

    def _open(self) -> None:
        self._start_engine(partial(self._open_engine, self.config))

    def _start_engine(self, open_engine: Callable[[], EngineLike]) -> None:
        self.orders += 1
        self._first.stop()
        self.engine.start_engine(open_engine)

    def _on_status(self, status: EngineStatus) -> None:
        if not self._is_shut and status.phase is not EnginePhase.IDLE:
            self._set_phase(status.phase, status.message)

    def _set_phase(self, phase: EnginePhase, message: str = "") -> None:
        self.phase, self.message = phase, message
        if self.is_over:
            self.halt()
        self.phase_changed.emit(phase)


def _lent(why: str) -> EngineLike:
    """Instead of an engine: the one before it is closed by the time that this is called."""
    raise DeviceError(why)
