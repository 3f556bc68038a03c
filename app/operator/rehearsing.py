"""Rehearse the way to the target: ``rehearse`` in processes beside the window, its result over the picture and on a card."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from PySide6.QtCore import QObject, QTimer

from app.operator.engine_thread import EnginePhase
from app.operator.preflight import PreflightFinding
from app.operator.rehearsal_card import KEY, advice_of
from app.operator.window import OperatorWindow
from app.ui.actions import MenuEntry, add_menu
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import OperatorStep, sentence
from app.ui.workers import ChildProcess, command_of
from core.bench.bench import PHANTOM_FILE
from core.evaluation.rehearsal import RehearsalResult
from hardware.preflight.preflight import Level
from hardware.rig import RigKind

RUNS, MINUTES = 50, 2
_WATCH_MS = 1000
"""Settings change without a signal."""
_LACKING = mark("this target was not rehearsed")
_NO_PHANTOM = mark("no phantom of this bench for the twin: teach the bench, or python main.py phantom BENCH")


class RehearsalController(QObject):
    """Lives as long as the window. What was found holds for one target on one phantom, and goes with them.

    Parameters
    ----------
    window : gets the menu's entry, and asks for a rehearsal before a hand-over where ``window.needs_rehearsal`` says so.
    command : stands for ``rehearse`` with its options.
    """

    def __init__(self, window: OperatorWindow, command: Callable[..., list[str]] = command_of) -> None:
        super().__init__(window)
        self._window, self._command = window, command
        self._card = window.panels.rehearsal
        self._child: ChildProcess | None = None
        self._bench: tuple[tuple[str, ...], int] | None = None
        """Options that name the phantom, and when it was made; None: no phantom."""
        self._done, self._total = 0, RUNS
        self._speed: float | None = None
        """A share; None: the way is still perceived in pictures."""
        self._so_far: RehearsalResult | None = None
        self.result: RehearsalResult | None = None
        """Of the present target; None: it was not rehearsed."""
        add_menu(window, tr("&Robot"), [MenuEntry(tr("Re&hearse this target"), self.toggle, (KEY, f"Shift+{KEY}"))])
        window.target_changed.connect(self.forget)
        window.rig.preparing.connect(self.forget)
        window.rig.phase_changed.connect(self._offer)
        window.rig.add_guard(self._may_ask)
        self._card.pressed.connect(self.toggle)
        self._card.closed.connect(self._card.hide)
        self._watch = QTimer(self, interval=_WATCH_MS)
        self._watch.timeout.connect(self._look_again)
        self._watch.start()
        self._offer()

    # ---- what may be rehearsed

    def _known_bench(self) -> tuple[tuple[str, ...], int] | None:
        rig = self._window.rig
        if rig.kind is RigKind.SIM:
            return (), 0
        if rig.kind is RigKind.LIVE and (bench := rig.calibrated(rig.config).perception.bench) is not None:
            with contextlib.suppress(OSError):
                return ("--bench", bench), (Path(bench) / PHANTOM_FILE).stat().st_mtime_ns
        return None

    def _offer(self) -> None:
        """Show that the target can be rehearsed, if it can."""
        window, self._bench = self._window, self._known_bench()
        can_begin = window.target is not None and window.last_tick is not None and window.rig.phase is EnginePhase.RUNNING
        if can_begin and self._bench is not None:
            self._card.offer()
        else:
            self._card.hide()
        self._show_lack()

    def forget(self) -> None:
        """Nothing is known of a target; a rehearsal that goes on is given up."""
        self._end()
        self.result = None
        self._window.recorder.forget_rehearsal()
        self._window.panels.show_rehearsal(None)
        self._offer()

    def _look_again(self) -> None:
        """A phantom may be made or changed beside the window."""
        if self._known_bench() != self._bench:
            self.forget()
        self._show_lack()

    # ---- a rehearsal

    def toggle(self) -> None:
        """Begin one, or give the running one up; a result whose card was closed is shown again."""
        if self._child is not None:
            self.forget()
        elif self.result is not None and self._card.isHidden():
            self._card.show_result(self.result, is_real=self._window.rig.kind is RigKind.LIVE)
        else:
            self._begin()

    def _begin(self) -> None:
        window, bench = self._window, self._bench
        tick, target = window.last_tick, window.target
        if bench is None:
            window.say(tr("Not rehearsed: {why}", why=tr(_NO_PHANTOM)), is_fault=True)
            return
        if target is None or tick is None:
            window.say(tr("First click the target, then rehearse"), is_fault=True)
            return
        height, width = tick.frame.image.shape[:2]
        config = window.rig.calibrated(window.rig.config).model_dump(mode="json")
        options = ["--target", f"{target[0]:.1f},{target[1]:.1f}", "--given", "--progress-json", "--runs", str(RUNS)]
        options += ["--minutes", str(MINUTES), "--workers", str(max(2, (os.cpu_count() or 2) - 2)), *bench[0]]
        given = json.dumps({"config": config, "size_px": [width, height]})
        child = ChildProcess(self._command("rehearse", *options), self, given=given)
        child.told.connect(self._on_told)
        child.ended.connect(self._on_ended)
        self._child, self._done, self._speed, self._so_far, self.result = child, 0, None, None, None
        self._card.show_running(0, RUNS, None, None)
        child.start()

    def _on_told(self, record: dict[str, Any]) -> None:
        try:
            if isinstance(so_far := record.get("so_far"), dict):
                self._so_far = RehearsalResult.model_validate(so_far)
            elif "arrived" in record:
                self.result = self._so_far = RehearsalResult.model_validate(record)
            elif isinstance(record.get("speed"), int | float):
                self._done, self._total, self._speed = 0, RUNS, float(record["speed"])
            elif isinstance(record.get("done"), int | float):
                self._done, self._total = int(record["done"]), int(record.get("total") or RUNS)
        except ValidationError:  # of another version
            return
        if self._so_far is not None:
            self._window.panels.show_rehearsal(self._so_far)
        self._card.show_running(self._done, self._total, self._so_far, self._speed)

    def _on_ended(self, code: int, said: str) -> None:
        self._child = None
        if self.result is not None:
            self._card.show_result(self.result, is_real=self._window.rig.kind is RigKind.LIVE)
            self._show_lack()
            self._window.recorder.keep_target(self._window.target, self.result.model_dump(mode="json"))
            return
        self.forget()
        self._window.say(tr("Not rehearsed: {why}", why=tr_text(said) or tr("exit code {code}", code=code)), is_fault=True)

    def _end(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            child.leave()
            child.kill()  # its own processes end with it

    def close(self) -> None:
        self._watch.stop()
        self._end()

    # ---- before a hand-over

    @property
    def finding(self) -> PreflightFinding | None:
        """For the checks before driving; None where no rehearsal is asked for."""
        if not self._window.rig.config.window.needs_rehearsal:
            return None
        name, result = tr("rehearsal"), self.result
        if result is not None:
            share = tr("{share:.0f} % of {runs} runs arrived", share=100 * result.arrived.share, runs=result.runs)
            if (result.recommended_speed_mm_s or 0.0) >= result.speed_mm_s:
                return PreflightFinding(name, Level.GOOD, share)
            return PreflightFinding(name, Level.WARNING, share, advice_of(result)[0])
        if self._child is not None:
            return PreflightFinding(name, Level.WARNING, tr("the rehearsal is not finished"), tr("wait for its result"))
        if self._bench is None:
            return PreflightFinding(name, Level.WARNING, tr("the hand-over needs one"), tr(_NO_PHANTOM))
        if self._window.target is None:
            return PreflightFinding(name, Level.WARNING, tr("no target yet"), tr("click it, and press {key}", key=KEY))
        return PreflightFinding(name, Level.WARNING, tr(_LACKING), tr("press {key}: two minutes beside the window", key=KEY))

    def _lack(self) -> tuple[str, str] | None:
        """What stands against a hand-over, and what to do."""
        finding = self.finding
        return (finding.detail, finding.fix) if finding is not None and self.result is None else None

    def _show_lack(self) -> None:
        self._window.panels.mode_bar.set_against(OperatorStep.HAND_OVER, self._lack())

    def _may_ask(self, step: OperatorStep) -> bool:
        lack = self._lack() if step is OperatorStep.HAND_OVER else None
        if lack is not None:
            self._window.say(tr("Not handed over: {what}. {fix}", what=lack[0], fix=sentence(lack[1])), is_fault=True)
        return lack is None
