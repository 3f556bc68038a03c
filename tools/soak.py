"""Soak: the program without its window for hours on the twin, under random faults and a random operator.

Watched are every goal on the wire, the recorded sessions (no row may be lost), and memory, threads and files (none may grow).
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import random
import shutil
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import numpy as np
import psutil
import typer

from app.commands.progress import Interrupt, progress_bar
from app.operator.rig_engine import EngineMaker, RigEngine
from core.config.models import Config
from core.config.safety import JOINT_NAMES, JointName
from core.control.engine import Perceive
from core.control.faults import Cause
from core.control.kept_zero import ZeroRequest
from core.control.modes import ARMED_MODES, Act, Mode
from core.control.motion import AT_REST, Jog
from core.control.pilot import LeftOver, Pilot
from core.devices import DeviceError, UserError
from core.session.manifest import SessionError, about_rig, event_of_alert, read_manifest
from core.session.reader import SessionReader
from core.session.writer import RecordStatus, SessionWriter, faults_between
from core.system import release_memory
from core.types import Frame, Point, Scene
from hardware.rig import Rig, RigKind
from hardware.servos.bus_ipc import BusStatus
from hardware.servos.registers import ServoState
from hardware.servos.servo_robot import ServoRobot
from hardware.twin.process import drive_world
from hardware.twin.servos.device import OVERLOAD_BIT, SoftServo
from hardware.twin.world import TwinCamera, TwinWorld
from tools.run import run_tool
from tools.wire_monitor import MonitoredBus, WireMonitor

_START_MM = 60.0
_STEP_S = 0.1


@dataclass(slots=True)
class InjectedFaults:
    """What is wrong with camera and perception now; changed by the soak's faults, read by the threads that it hits."""

    silent: bool = False
    frozen: bool = False
    level: int | None = None
    shift_px: int = 0
    perceive_s: float = 0.0
    raises: bool = False


class SoakCamera(TwinCamera):
    """The twin's camera, and what injected makes of its pictures."""

    def __init__(self, world: TwinWorld, injected: InjectedFaults) -> None:
        super().__init__(world)
        self._injected = injected
        self._kept: Frame | None = None

    def read(self, timeout_s: float) -> Frame | None:
        frame = super().read(timeout_s)
        injected = self._injected
        if frame is None or injected.silent:
            return None
        if injected.frozen and self._kept is not None:
            return replace(frame, image=self._kept.image)
        self._kept = frame
        if injected.level is not None:
            return replace(frame, image=np.full_like(frame.image, injected.level))
        if injected.shift_px:
            return replace(frame, image=np.roll(frame.image, injected.shift_px, axis=1))
        return frame


class SoakRig:
    """An open rig with its engine's thread and its recorder. ``close`` ends all of it.

    Parameters
    ----------
    maker : loads the network once.
    watch : the witness on the wire; it outlives the rig.
    writer : the recorder, which outlives the rig, too.
    left_over : of the rig before.
    """

    def __init__(
        self,
        config: Config,
        maker: EngineMaker,
        watch: WireMonitor,
        writer: SessionWriter,
        left_over: LeftOver | None,
    ) -> None:
        self.config, self._writer = config, writer
        self.injected = InjectedFaults()
        self._recorded = RecordStatus()
        self.failure = ""
        self._ended = threading.Event()
        with contextlib.ExitStack() as undo:
            world = TwinWorld(config.twin, perception=config.perception)
            world.insert(_START_MM)
            self.bus = MonitoredBus(config.servos, watch)
            self.bus.start()
            undo.callback(self.bus.stop)
            drive_world(world, self.bus, config.servos)
            servos = config.servos.model_copy(update={"port": self.bus.port})
            self.robot = ServoRobot(servos, config.safety, truth=world.physics.status)
            undo.callback(self.robot.close)
            self.robot.connect()
            self.robot.zero()
            self.bus.set_zero()
            camera = SoakCamera(world, self.injected)
            rig = Rig("soak", RigKind.SIM, camera, self.robot)
            perceive, model = maker._perception(config.perception)
            camera.open()
            undo.callback(camera.close)
            self.engine = RigEngine(rig, self._disturbed(perceive), config, model, left_over)
            undo.pop_all()
        assert self.engine.pilot is not None
        self.pilot: Pilot = self.engine.pilot
        self.frames = 0
        self._thread = threading.Thread(target=self._run, name="engine", daemon=True)
        self._thread.start()

    def _disturbed(self, perceive: Perceive) -> Perceive:
        def disturbed(frame: Frame, target: Point | None = None) -> Scene:
            if self.injected.raises:
                raise RuntimeError("injected: perception breaks")
            if self.injected.perceive_s > 0.0:
                time.sleep(self.injected.perceive_s)
            return perceive(frame, target)

        return disturbed

    @property
    def running(self) -> bool:
        """Whether the engine's thread turns; when it has ended by itself, ``failure`` says why."""
        return self._thread.is_alive()

    def _run(self) -> None:
        try:
            while not self._ended.is_set():
                tick = self.engine.step(_STEP_S)
                if tick is not None:
                    self.frames += 1
                    self._writer.put(tick, self.pilot.view, self.engine.bus_status())
        except DeviceError as error:
            self.failure = str(error)
        except Exception as error:  # noqa: BLE001 - top of the thread: a visible fault, as in the window's engine thread
            self.failure = f"{type(error).__name__}: {error}"

    def look(self, *, alive: bool) -> None:
        """What a window does every 50 ms, unless it hangs."""
        if not alive:
            return
        self.pilot.window_alive()
        news = self.pilot.news()
        for view in news.changes:
            self._writer.drive(view)
        for alert in news.alerts:
            self._writer.add_event(event_of_alert(alert, news.view.time_s))
        before, self._recorded = self._recorded, self._writer.status()
        for fault in faults_between(before, self._recorded):
            self.pilot.report_fault(fault)

    def close(self) -> LeftOver | None:
        """End the rig as F5 or a crash does; what the next one takes over."""
        self._ended.set()
        self._thread.join()
        self.engine.close()
        self.bus.stop()
        return self.pilot.left_over


def soak_config(folder: Path) -> Config:
    """The default twin, with sessions in a folder that the soak owns."""
    return Config.model_validate(
        {
            "twin": {"live_frames_per_second": 15.0},
            "perception": {"segmentation": {"threads": 1}},
            "record": {"folder": str(folder), "ring_s": 10.0, "warn_free_mb": 0.0, "warn_free_share": 0.0, "stop_free_mb": 0.0},
        }
    )


Undo = Callable[[], object]
Breaks = Callable[[SoakRig, random.Random], Undo]
_EVERY_S = (4.0, 15.0)
_SAFE_C, _SAFE_V = 25.0, 12.0


@dataclass(frozen=True, slots=True)
class FaultKind:
    """``do`` breaks it and returns what mends it; ``lasts_s`` is between these."""

    name: str
    do: Breaks
    lasts_s: tuple[float, float]


def _mute(rig: SoakRig, draw: random.Random) -> Undo:
    servo = draw.randint(1, 7)
    rig.bus.faults.mute(servo)
    return lambda: rig.bus.faults.mute(servo, False)


def _noise(rig: SoakRig, draw: random.Random) -> Undo:
    rig.bus.faults.crc(draw.randint(1, 12))
    rig.bus.faults.garbage(draw.randint(0, 40))
    return lambda: rig.bus.faults.crc(0)


def _vanish(rig: SoakRig, draw: random.Random) -> Undo:
    rig.bus.vanish()
    return rig.bus.reappear


def _servo(harm: Callable[[SoftServo, random.Random], object], mend: Callable[[SoftServo], object] | None = None) -> Breaks:
    """One of the seven."""

    def do(rig: SoakRig, draw: random.Random) -> Undo:
        servo = draw.randint(1, 7)
        rig.bus.modify_servo(servo, lambda device: harm(device, draw))
        return lambda: rig.bus.modify_servo(servo, mend) if mend is not None else None

    return do


def _sag(rig: SoakRig, draw: random.Random) -> Undo:
    low_v = draw.uniform(10.1, 11.2)

    def supply(volts: float) -> None:
        for servo in range(1, 8):
            rig.bus.modify_servo(servo, lambda device: setattr(device, "supply_v", volts))

    supply(low_v)
    return lambda: supply(_SAFE_V)


def _set(name: str, value: Callable[[random.Random], object], rest: object) -> Breaks:
    def do(rig: SoakRig, draw: random.Random) -> Undo:
        setattr(rig.injected, name, value(draw))
        return lambda: setattr(rig.injected, name, rest)

    return do


FAULT_KINDS = (
    FaultKind("servo silent", _mute, (0.1, 2.0)),
    FaultKind("bad packets", _noise, (0.5, 1.0)),
    FaultKind("port vanishes", _vanish, (0.5, 3.0)),
    FaultKind("servo restarts", _servo(lambda servo, draw: servo.restart()), (0.0, 0.0)),
    FaultKind("overload", _servo(lambda servo, draw: servo.alert(OVERLOAD_BIT)), (0.0, 0.0)),
    FaultKind("jam", _servo(lambda servo, draw: servo.freeze(True), lambda servo: servo.freeze(False)), (0.2, 2.0)),
    FaultKind(
        "heat", _servo(lambda servo, draw: servo.heat(draw.uniform(60.0, 74.0)), lambda servo: servo.heat(_SAFE_C)), (1.0, 3.0)
    ),
    FaultKind("supply sags", _sag, (1.0, 3.0)),
    FaultKind("camera silent", _set("silent", lambda draw: True, False), (0.1, 1.5)),
    FaultKind("camera frozen", _set("frozen", lambda draw: True, False), (0.3, 1.5)),
    FaultKind("picture black or white", _set("level", lambda draw: draw.choice((0, 255)), None), (0.2, 1.0)),
    FaultKind("camera moved", _set("shift_px", lambda draw: draw.choice((-30, 12, 25)), 0), (1.0, 3.0)),
    FaultKind("perception slow", _set("perceive_s", lambda draw: draw.uniform(0.1, 0.7), 0.0), (0.5, 2.0)),
    FaultKind("perception breaks", _set("raises", lambda draw: True, False), (0.0, 0.5)),
)


class RandomFaults:
    """One kind at a time, with pauses. ``turn`` is called often; ``forget`` when the rig is another one."""

    def __init__(self, seed: int) -> None:
        self._draw = random.Random(seed)
        self._next_s: float | None = None
        self._undo: tuple[float, Undo] | None = None
        self.count: Counter[str] = Counter()

    def turn(self, rig: SoakRig, now_s: float) -> None:
        if self._undo is not None:
            if now_s >= self._undo[0]:
                self._undo[1]()
                self._undo = None
            return
        if self._next_s is None:
            self._next_s = now_s + self._draw.uniform(*_EVERY_S)
        if now_s < self._next_s:
            return
        kind = self._draw.choice(FAULT_KINDS)
        self.count[kind.name] += 1
        self._undo = now_s + self._draw.uniform(*kind.lasts_s), kind.do(rig, self._draw)
        self._next_s = None

    def forget(self) -> None:
        """What was broken is gone with its rig."""
        self._undo = self._next_s = None


_DECIDES_S = (0.2, 1.2)
_HANGS_S = 0.9


class SoakOperator:
    """Wants to hand over most of the time, and does everything else now and then. All goes through the pilot, as from a window.

    ``hangs``: operator or window show no sign of life now.
    """

    def __init__(self, seed: int, watch: WireMonitor, writer: SessionWriter) -> None:
        self._draw = random.Random(seed)
        self._watch, self._writer = watch, writer
        self._decide_s = self._hangs_until_s = 0.0
        self._jog, self._held = AT_REST, False
        self._zeroing = False
        self._zeroed_here: set[JointName] = set()
        self.count: Counter[str] = Counter()
        self.hangs = False
        self.wants_restart = False

    def turn(self, rig: SoakRig, now_s: float) -> None:
        """To be called fifty times a second."""
        self.hangs = now_s < self._hangs_until_s
        if self.hangs:
            return
        pilot = rig.pilot
        pilot.deadman("soak", self._held)
        if not self._jog.is_rest:
            pilot.jog("soak", self._jog)
        if self._zeroing and not pilot.view.busy:
            self._zeroing = False
            rig.bus.set_zero(self._zeroed_here)  # those joints stand: where they are now is what was taken for zero
            self._do("servos on", pilot.switch_on)
        if now_s >= self._decide_s:
            self._decide_s = now_s + self._draw.uniform(*_DECIDES_S)
            self._decide(rig, now_s)

    def _do(self, what: str, action: Callable[[], object]) -> None:
        self.count[what] += 1
        action()

    def _decide(self, rig: SoakRig, now_s: float) -> None:
        draw, pilot, view = self._draw, rig.pilot, rig.pilot.view
        self._jog = AT_REST
        if draw.random() < 0.04:
            self._do("rare", lambda: self._rare(rig, now_s))
        elif view.mode is Mode.STOPPED or view.latched is not None:
            self._watch.set_stop(None)
            self._do("acknowledge", lambda: pilot.ask(Act.ACKNOWLEDGE))
        elif not view.servos_on:
            if not view.busy and not self._zeroing:
                self._mend(rig)
        elif view.mode is Mode.ADVISORY:
            self._held = False
            if view.against_arming or draw.random() < 0.4:
                self._drive_by_hand()
            else:
                self._do("arm", lambda: pilot.ask(Act.ARM))
        elif view.mode in {Mode.ARMED, Mode.HOLD}:
            self._hand_over(rig)
        else:
            self._interfere(rig)

    def _mend(self, rig: SoakRig) -> None:
        """Servos that are off: a restart where one has an error, zero where they have none, and on again."""
        pilot, status = rig.pilot, rig.robot.bus_status()
        causes = {fault.cause for fault in (*rig.pilot.view.active, *(status.active if status is not None else ()))}
        if Cause.SERVO_ALERT in causes:
            errors = [r.id for r in status.servos if getattr(r, "error", 0)] if status is not None else []
            if errors:
                self._do("restart a servo", lambda: pilot.reboot(errors[0]))
        elif status is not None and not all(status.zeroed):
            self._zero(pilot, status)
        else:
            self._do("servos on", pilot.switch_on)

    def _zero(self, pilot: Pilot, status: BusStatus) -> None:
        """Kept zeros where they are offered; else the present positions, with the torque off."""
        lost = {name for name, is_zeroed in zip(JOINT_NAMES, status.zeroed, strict=True) if not is_zeroed}
        kept = tuple(offer.name for offer in status.offers if offer.name in lost)
        here = lost - set(kept)
        if here and any(isinstance(reading, ServoState) and reading.torque for reading in status.servos):
            self._do("torque off", pilot.torque_off)
            return
        self._zeroing, self._zeroed_here = True, here
        request = ZeroRequest(positions_mm=dict.fromkeys(here, 0.0), kept=kept)
        self._do("zero", lambda: pilot.zero(request))

    def _drive_by_hand(self) -> None:
        draw = self._draw
        self.count["jog"] += 1
        self._jog = Jog(
            bend=draw.uniform(-1.0, 1.0),
            pitch=draw.choice((0.0, 0.0, draw.uniform(-1.0, 1.0))),
            advance=draw.uniform(-1.0, 1.0),
            delivery=draw.choice((0.0, 0.0, draw.uniform(-1.0, 1.0))),
            straighten=draw.random() < 0.1,
        )

    def _hand_over(self, rig: SoakRig) -> None:
        draw, pilot = self._draw, rig.pilot
        self._held = draw.random() < 0.9
        if draw.random() >= 0.3 and rig.pilot.view.against_hand_over:
            width, height = rig.config.twin.image_width_px, rig.config.twin.image_height_px
            target = draw.uniform(0.3, 0.95) * width, draw.uniform(0.15, 0.85) * height
            self._do("click", lambda: rig.engine.set_target(target))
        if not rig.pilot.view.against_hand_over:
            pilot.deadman("soak", self._held)
            self._do("hand over", lambda: pilot.ask(Act.HAND_OVER))
        elif draw.random() < 0.15:
            self._drive_by_hand()

    def _interfere(self, rig: SoakRig) -> None:
        """While the program drives: mostly nothing."""
        draw, pilot = self._draw, rig.pilot
        choice = draw.random()
        if choice < 0.12:
            self._drive_by_hand()
        elif choice < 0.2:
            self._held = False
        elif choice < 0.25:
            self._do("take back", lambda: pilot.ask(Act.TAKE_BACK))
        elif choice < 0.3:
            self._do("click", lambda: rig.engine.set_target((draw.uniform(200.0, 600.0), draw.uniform(60.0, 420.0))))

    def _rare(self, rig: SoakRig, now_s: float) -> None:
        draw, pilot = self._draw, rig.pilot
        choice = draw.choice(("stop", "stop", "hang", "disarm", "record", "record", "save last", "torque off", "restart"))
        self.count[choice] += 1
        if choice == "stop":
            pilot.stop()
            self._watch.set_stop(now_s)
        elif choice == "hang":
            self._hangs_until_s = now_s + draw.uniform(0.2, _HANGS_S)
        elif choice == "disarm" and pilot.view.mode in ARMED_MODES:
            pilot.ask(Act.DISARM)
        elif choice == "record":
            (self._writer.stop if self._writer.status().recording else self._writer.start)()
        elif choice == "save last":
            self._writer.save_last()
        elif choice == "torque off":
            pilot.torque_off()
        elif choice == "restart":
            self.wants_restart = True


_WARM_S, _WARM_SHARE = 600.0, 0.4
_MORE_MB, _MORE_SHARE = 12.0, 0.03
_MORE_COUNT = 5
"""A session that is being recorded has three files and a thread of its own; a leak loses one with every rig, hundreds in all."""
_LEAST = 6


@dataclass(frozen=True, slots=True)
class ProcessSample:
    """``memory_mb`` is resident; ``children_mb`` and ``children`` are the bus process and whatever else was started."""

    time_s: float
    memory_mb: float
    threads: int
    files: int
    children: int
    children_mb: float


def take_sample(time_s: float) -> ProcessSample:
    """Of this process, now."""
    own = psutil.Process()
    children = own.children()
    return ProcessSample(
        time_s=round(time_s, 1),
        memory_mb=round(own.memory_info().rss / 1e6, 1),
        threads=own.num_threads(),
        files=own.num_fds(),
        children=len(children),
        children_mb=round(sum(child.memory_info().rss for child in children) / 1e6, 1),
    )


@dataclass(frozen=True, slots=True)
class Flatness:
    """Medians of the first and of the last third after the warm-up; ``flat`` None: too few samples to tell."""

    flat: bool | None
    warm_s: float
    before: dict[str, float]
    after: dict[str, float]


def flatness(samples: Sequence[ProcessSample]) -> Flatness:
    """Whether it stayed the same after ten minutes, or after two fifths of a shorter run."""
    if not samples:
        return Flatness(None, 0.0, {}, {})
    warm_s = min(_WARM_S, _WARM_SHARE * samples[-1].time_s)
    late = [sample for sample in samples if sample.time_s >= warm_s]
    third = len(late) // 3
    if len(late) < _LEAST:
        return Flatness(None, warm_s, {}, {})
    before, after = (_medians(part) for part in (late[:third], late[-third:]))
    grown = [
        after["memory_mb"] - before["memory_mb"] > _MORE_MB + _MORE_SHARE * before["memory_mb"],
        after["children_mb"] - before["children_mb"] > _MORE_MB + _MORE_SHARE * before["children_mb"],
        *(after[name] - before[name] > _MORE_COUNT for name in ("threads", "files", "children")),
    ]
    return Flatness(not any(grown), warm_s, before, after)


def _medians(samples: Sequence[ProcessSample]) -> dict[str, float]:
    names = ("memory_mb", "threads", "files", "children", "children_mb")
    return {name: round(median(getattr(sample, name) for sample in samples), 1) for name in names}


_TURN_S, _LOOK_S, _SAMPLE_S = 0.02, 0.05, 10.0
_RECORD_S = 90.0
_OPEN_TRIES = 5


@dataclass(slots=True)
class SoakTally:
    """Of the whole soak."""

    modes: Counter[str] = field(default_factory=Counter)
    samples: list[ProcessSample] = field(default_factory=list)
    rigs: int = 0
    breakdowns: int = 0
    frames: int = 0
    sessions: int = 0
    rows: int = 0
    lost: int = 0
    problems: list[str] = field(default_factory=list)


class Soak:
    """``run`` goes on until the time is over or it is interrupted; ``summary`` has the figures.

    Parameters
    ----------
    seed : of faults and operator.
    """

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.tally = SoakTally()
        self._folder = Path(tempfile.mkdtemp(prefix="lumenpilot_soak_"))
        self._config = soak_config(self._folder)
        self.watch = WireMonitor(self._config.servos)
        about = about_rig(self._config, RigKind.SIM.value, "soak")
        self._writer = SessionWriter(self._config.record, about, folder=self._folder)
        self._maker = EngineMaker()
        self.faults = RandomFaults(seed)
        self.operator = SoakOperator(seed + 1, self.watch, self._writer)
        self._rig: SoakRig | None = None
        self._left_over: LeftOver | None = None
        self._checked: set[Path] = set()
        self.began_s = time.monotonic()
        self._ran_s = 0.0

    def run(self, seconds: float, go_on: Callable[[Soak], bool]) -> None:
        """For so long, or until `go_on` (called about once a second) says no."""
        self.began_s = started_s = time.monotonic()
        look_s = sample_s = told_s = started_s
        record_s = started_s
        try:
            while (now_s := time.monotonic()) - started_s < seconds:
                rig = self._open()
                self.operator.turn(rig, now_s)
                self.faults.turn(rig, now_s)
                if now_s >= look_s:
                    look_s = now_s + _LOOK_S
                    rig.look(alive=not self.operator.hangs)
                    self.tally.modes[rig.pilot.view.mode.value] += 1
                if now_s >= sample_s:
                    sample_s = now_s + _SAMPLE_S
                    self.tally.samples.append(take_sample(now_s - started_s))
                if now_s >= record_s:
                    record_s = now_s + _RECORD_S
                    self._turn_over()
                if now_s >= told_s:
                    told_s = now_s + 1.0
                    if not go_on(self):
                        break
                time.sleep(max(0.0, now_s + _TURN_S - time.monotonic()))
        finally:
            self._ran_s = time.monotonic() - started_s
            self._close()

    @property
    def elapsed_s(self) -> float:
        return time.monotonic() - self.began_s

    def _open(self) -> SoakRig:
        """The rig; a new one after a breakdown, and when the operator starts it again."""
        rig = self._rig
        if rig is not None and rig.running and not self.operator.wants_restart:
            return rig
        if rig is not None:
            if rig.failure:
                self.tally.breakdowns += 1
                if "injected" not in rig.failure:
                    self.tally.problems.append(f"the rig broke down: {rig.failure}")
            self._shut(rig)
        self.operator.wants_restart = False
        for attempt in range(_OPEN_TRIES):
            try:
                self._rig = SoakRig(self._config, self._maker, self.watch, self._writer, self._left_over)
                break
            except DeviceError as error:  # a machine that pauses while servos are looked for
                if attempt == _OPEN_TRIES - 1:
                    raise
                self.tally.problems.append(f"not opened at once: {error}") if attempt > 1 else None
        assert self._rig is not None
        self.tally.rigs += 1
        return self._rig

    def _shut(self, rig: SoakRig) -> None:
        self.faults.forget()
        self._rig = None
        self._left_over = rig.close()
        self.tally.frames += rig.frames
        del rig
        release_memory()  # as when the window opens the next rig

    def _turn_over(self) -> None:
        """End the session that is being written, begin the next, and look at what is complete."""
        self._writer.stop()
        self._check_sessions()
        self._writer.start()

    def _check_sessions(self) -> None:
        """Every row that was counted must be there; then the session makes room for the next."""
        writing = self._writer.status().folder if self._writer.status().recording else None
        for folder in sorted(self._folder.glob("session_*")):
            if folder == writing or folder in self._checked:
                continue
            try:
                manifest = read_manifest(folder)
            except SessionError:
                continue
            if not manifest.closed:
                continue
            self._checked.add(folder)
            with SessionReader(folder) as reader:
                reader.wait(60.0)
                rows, problems = len(reader), reader.problems
            self.tally.sessions += 1
            self.tally.rows += rows
            self.tally.lost += max(0, manifest.counts.frames - rows) + manifest.counts.dropped
            self.tally.problems += [f"{folder.name}: {problem}" for problem in problems[:3]]
            shutil.rmtree(folder, ignore_errors=True)

    def _close(self) -> None:
        if self._rig is not None:
            self._shut(self._rig)
        if not self._writer.close():
            self.tally.problems.append("the recorder did not end in time")
        status = self._writer.status()
        if status.problem:
            self.tally.problems.append(status.problem)
        self._check_sessions()
        shutil.rmtree(self._folder, ignore_errors=True)

    def summary(self) -> dict[str, Any]:
        """One object; ``ok``: nothing unsafe, nothing lost, nothing grew, nothing unexpected."""
        tally, seen = self.tally, self.watch.report
        steady = flatness(tally.samples)
        looks = max(1, sum(tally.modes.values()))
        return {
            "seconds": round(self._ran_s, 1),
            "seed": self.seed,
            "ok": seen.unsafe == 0 and tally.lost == 0 and steady.flat is not False and not tally.problems,
            "packets": seen.packets,
            "goals": seen.goals,
            "unsafe": seen.unsafe,
            "unsafe_texts": seen.texts,
            "records": {"sessions": tally.sessions, "rows": tally.rows, "lost": tally.lost},
            "flatness": asdict(steady),
            "samples": len(tally.samples),
            "mode_shares": {mode: round(count / looks, 3) for mode, count in sorted(tally.modes.items())},
            "frames": tally.frames,
            "rigs_opened": tally.rigs,
            "breakdowns": tally.breakdowns,
            "faults": dict(self.faults.count),
            "operator": dict(self.operator.count),
            "problems": tally.problems[:50],
        }


def soak(
    hours: Annotated[float, typer.Option(min=0.005, max=1000.0, help="Ctrl-C ends it sooner and tells the figures so far")] = 2.0,
    seed: Annotated[int, typer.Option(min=0, help="of faults and operator")] = 0,
    out: Annotated[Path | None, typer.Option(help="file for the samples and the summary, one JSON object a line")] = None,
) -> None:
    """Run for hours under random faults and operator input; exit code 1 if a goal was unsafe, a row lost, or memory grew."""
    try:
        file = open(out or os.devnull, "w", buffering=1, encoding="utf-8")
    except OSError as error:
        raise UserError(f"{out}: cannot be written ({error.strerror}); choose another --out") from None
    logging.disable(logging.CRITICAL)  # breakdowns are injected; unexpected ones are in the summary
    run, written = Soak(seed), 0
    with file, Interrupt() as interrupt, progress_bar() as bar:
        task = bar.add_task("seconds", total=round(3600.0 * hours))

        def go_on(now: Soak) -> bool:
            nonlocal written
            goals, unsafe = now.watch.report.goals, now.watch.report.unsafe
            bar.update(task, completed=int(now.elapsed_s), description=f"s, {goals} goals, {unsafe} unsafe, {now.tally.lost} lost")
            for sample in now.tally.samples[written:]:
                file.write(json.dumps(asdict(sample)) + "\n")
            written = len(now.tally.samples)
            return not interrupt.asked

        run.run(3600.0 * hours, go_on)
        summary = run.summary() | {"interrupted": interrupt.asked}
        file.write(json.dumps({"summary": summary}) + "\n")
    sys.stdout.write(json.dumps(summary, indent=1) + "\n")
    sys.exit(0 if summary["ok"] else 1)


if __name__ == "__main__":
    run_tool(soak)
