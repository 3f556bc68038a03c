"""The thread of the engine: opens the rig, runs the loop, hands the newest tick to the window."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from PySide6.QtCore import QObject, QThread, Signal

from app.ui.workers import error_line
from core.config.models import PerceptionConfig
from core.control.pilot import Pilot
from core.devices import EndOfStream, Latest
from core.system import lower_priority
from core.types import Point, Tick
from hardware.servos.bus_ipc import BusStatus

STEP_TIMEOUT_S = 0.1

_log = logging.getLogger(__name__)


class EngineLike(Protocol):
    """What the thread needs of an engine."""

    @property
    def pilot(self) -> Pilot | None: ...
    def step(self, timeout_s: float) -> Tick | None: ...
    @property
    def problem(self) -> str | None: ...
    def bus_status(self) -> BusStatus | None: ...
    def set_target(self, target_px: Point | None) -> None: ...
    def set_perception(self, config: PerceptionConfig) -> bool: ...
    def close(self) -> None: ...


OpenEngine = Callable[[], EngineLike]


class EnginePhase(Enum):
    """Where the thread is. Nothing leaves FAULT or ENDED but a new order."""

    IDLE = "idle"
    STARTING = "starting"
    RUNNING = "running"
    ENDED = "ended"
    FAULT = "fault"


@dataclass(frozen=True, slots=True)
class EngineStatus:
    """A phase and, for FAULT and ENDED, the one line that says why."""

    phase: EnginePhase
    message: str = ""


class EngineThread(QThread):
    """Runs one engine at a time.

    ``tick_ready`` carries no payload and comes only when the slot was empty, so a slow window falls behind by one tick at most.
    ``start_engine`` closes the running engine and opens another one in the thread; its loop turns in one beside. ``stop`` ends the
    thread; it returns at once.
    """

    tick_ready = Signal()
    status_changed = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("engine")
        self.ticks: Latest[Tick] = Latest()
        self.on_tick: Callable[[Tick], None] | None = None
        """Gets every tick, in the loop's thread; it must return at once."""
        self._lock = threading.Lock()
        self._changed = threading.Event()
        self._stopping = False
        self._opening = self._stop_next = False
        self._order: OpenEngine | None = None
        self._engine: EngineLike | None = None

    def end_engine(self) -> None:
        """Hand over no tick of the running engine any more; it is closed soon."""
        with self._lock:
            self._changed.set()

    def announce_engine(self) -> None:
        """An engine will be started soon: a STOP until then is kept for it."""
        with self._lock:
            self._opening = True

    def start_engine(self, open_engine: OpenEngine) -> None:
        """Close the running engine and open this one; the last of several orders wins."""
        with self._lock:
            self._order = open_engine
            self._opening = True
            self._changed.set()
        if not self.isRunning():
            self.start()

    def stop(self) -> None:
        """Ask the thread to end. An engine that is being opened is still opened, and closed at once."""
        with self._lock:
            self._stopping = True
            self._changed.set()

    @property
    def pilot(self) -> Pilot | None:
        """The running engine's; None without an engine or a robot."""
        engine = self._engine
        return engine.pilot if engine is not None else None

    @property
    def problem(self) -> str | None:
        """Why the open rig gives no pictures, where that is known."""
        engine = self._engine
        return engine.problem if engine is not None else None

    @property
    def is_ending(self) -> bool:
        """Whether the running engine is about to be closed; what it still reports is dropped."""
        return self._changed.is_set()

    def stop_opening(self) -> bool:
        """STOP while an engine is announced or being opened: it starts stopped. False without one. From any thread."""
        with self._lock:
            self._stop_next = self._stop_next or self._opening
            return self._opening

    def bus_status(self) -> BusStatus | None:
        """The newest status of the servo bus; None without one."""
        engine = self._engine
        return engine.bus_status() if engine is not None else None

    def set_target(self, target_px: Point | None) -> bool:
        """Set or clear the target, in source pixels; False when there is no engine."""
        engine = self._engine
        if engine is None:
            return False
        engine.set_target(target_px)
        return True

    def set_perception(self, config: PerceptionConfig) -> bool:
        """Perceive under other thresholds from the next frame on; False when there is no engine, or no network in it."""
        engine = self._engine
        return engine is not None and engine.set_perception(config)

    def run(self) -> None:
        while True:
            self._changed.wait()
            with self._lock:
                self._changed.clear()
                if self._stopping:
                    return
                order, self._order = self._order, None
            if order is not None:
                self._report(self._outcome(order))

    def _outcome(self, order: OpenEngine) -> EngineStatus:
        try:
            self._serve(order)
        except EndOfStream as error:
            return EngineStatus(EnginePhase.ENDED, error_line(error))
        except Exception as error:  # noqa: BLE001 - the one top of this thread: everything becomes a visible fault
            line = error_line(error)
            if line.startswith("unexpected"):
                _log.error("the engine stopped", exc_info=error)
            return EngineStatus(EnginePhase.FAULT, line)
        return EngineStatus(EnginePhase.IDLE)

    def _serve(self, open_engine: OpenEngine) -> None:
        """Open an engine and turn its loop until there is another order."""
        self.ticks.take()
        self._report(EngineStatus(EnginePhase.STARTING))
        try:
            engine = open_engine()
        except BaseException:
            self._opened(None)
            raise
        try:
            if not self._changed.is_set():
                self._engine = engine
                self._opened(engine)
                self._report(EngineStatus(EnginePhase.RUNNING))
                # In a thread of its own: what the next engine starts (pilot, servos) must not wait behind perception.
                with ThreadPoolExecutor(1, "engine turns", lower_priority) as turns:
                    turns.submit(self._turn, engine).result()
        finally:
            try:
                engine.close()  # STOP still finds its way meanwhile
            finally:
                self._engine = None

    def _opened(self, engine: EngineLike | None) -> None:
        """Apply a STOP that was kept for the engine; without an engine it is kept for the next one."""
        with self._lock:
            self._opening = self._order is not None
            stop = self._stop_next and engine is not None
            self._stop_next = self._stop_next and engine is None
        if stop and engine is not None and engine.pilot is not None:
            engine.pilot.stop()

    def _turn(self, engine: EngineLike) -> None:
        while not self._changed.is_set():
            tick = engine.step(STEP_TIMEOUT_S)
            if tick is None:
                continue
            with self._lock:
                if self._changed.is_set():  # its last tick must not be taken for one of the next engine
                    return
                if (on_tick := self.on_tick) is not None:
                    on_tick(tick)
            if self.ticks.put(tick):
                self.tick_ready.emit()

    def _report(self, status: EngineStatus) -> None:
        if not self._stopping:
            self.status_changed.emit(status)
