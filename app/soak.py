"""Soak: the whole program but its window runs for hours under random faults and a restless operator, and everything is watched."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.memory import give_back
from app.rig_engine import EngineMaker
from app.soak_faults import RandomFaults
from app.soak_operator import RandomOperator
from app.soak_rig import SoakRig, make_writer, soak_config
from app.soak_samples import Sample, flatness, take_sample
from core.control.drive_view import LeftOver
from core.devices import DeviceError
from core.session.manifest import SessionError, read_manifest
from core.session.reader import SessionReader
from hardware.twin.wire_watch import WireWatch

_TURN_S, _LOOK_S, _SAMPLE_S = 0.02, 0.05, 10.0
_RECORD_S = 90.0
_OPEN_TRIES = 5


@dataclass(slots=True)
class Tally:
    """Of the whole soak."""

    modes: Counter[str] = field(default_factory=Counter)
    samples: list[Sample] = field(default_factory=list)
    rigs: int = 0
    breakdowns: int = 0
    frames: int = 0
    sessions: int = 0
    rows: int = 0
    lost: int = 0
    problems: list[str] = field(default_factory=list)


class Soak:
    """``run`` goes on until the time is over or somebody interrupts; ``summary`` tells.

    Parameters
    ----------
    seed : of faults and operator.
    true_masks : see with the twin's own masks, a lighter load than the network.
    """

    def __init__(self, seed: int, *, true_masks: bool = False) -> None:
        self.seed, self._true_masks = seed, true_masks
        self.tally = Tally()
        self._folder = Path(tempfile.mkdtemp(prefix="lumenpilot_soak_"))
        self._config = soak_config(self._folder)
        self.watch = WireWatch(self._config.servos)
        self._writer = make_writer(self._config, self._folder)
        self._maker = EngineMaker()
        self.faults = RandomFaults(seed)
        self.operator = RandomOperator(seed + 1, self.watch, self._writer)
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
                self._rig = SoakRig(
                    self._config, self._maker, self.watch, self._writer, self._left_over, true_masks=self._true_masks
                )
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
        give_back()  # as when the window opens the next rig

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
        tally, seen = self.tally, self.watch.seen
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
            "flatness": steady.to_json(),
            "samples": len(tally.samples),
            "mode_shares": {mode: round(count / looks, 3) for mode, count in sorted(tally.modes.items())},
            "frames": tally.frames,
            "rigs_opened": tally.rigs,
            "breakdowns": tally.breakdowns,
            "faults": dict(self.faults.count),
            "operator": dict(self.operator.count),
            "problems": tally.problems[:50],
        }
