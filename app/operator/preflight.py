"""The checks before arming: made in a process beside the window, valid for some minutes; a red one prevents arming."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal

from app.ui.i18n import tr, tr_text
from app.ui.texts import OperatorStep, sentence
from app.ui.workers import LOW_PRIORITY, ChildProcess, module_of
from core.config.models import Config
from core.control.alerts import alert_of
from core.control.drive_view import DriveView
from core.control.faults import Area, Cause
from core.control.modes import OF_THE_RIG
from hardware.preflight.checks import Check
from hardware.preflight.preflight import Level, level_of

KEPT_S = 600.0
"""Checks are valid for so long."""
_BEGIN_AFTER_MS = 4000
"""After the first picture of a rig: its own start has the computer to itself."""
_LONGEST_MS = 180_000
"""Checks that take longer are cancelled."""
_MATTERS = ("rig", "camera", "perception", "servos", "pedal", "gamepad", "record")
"""Sections of the configuration that the checks depend on: another phantom needs no new ones."""


@dataclass(frozen=True, slots=True)
class PreflightFinding:
    """One line of the list: what was looked at, how it is, what was found and what to do about it."""

    name: str
    level: Level
    detail: str
    fix: str = ""


@dataclass(frozen=True, slots=True)
class Preflight:
    """What is known. ``is_running``: more is to come. ``age_s`` None: never finished, or for another configuration.

    ``waiting`` is why arming would be refused now though all checks are good, in a line that the bar below the advice has, too.
    """

    findings: tuple[PreflightFinding, ...] = ()
    is_running: bool = False
    age_s: float | None = None
    problem: str = ""
    waiting: tuple[str, ...] = ()

    @property
    def is_fresh(self) -> bool:
        return self.age_s is not None and self.age_s <= KEPT_S and not self.problem

    @property
    def against(self) -> tuple[PreflightFinding, ...]:
        """What stands against driving."""
        return tuple(finding for finding in self.findings if finding.level is Level.BAD)

    @property
    def headline(self) -> str:
        """In one line. What is not configured is neither good nor bad, and is not counted."""
        used = [finding for finding in self.findings if finding.level is not Level.UNUSED]
        good = sum(finding.level is Level.GOOD for finding in used)
        if self.problem:
            return tr("The checks could not be made: {problem}", problem=self.problem)
        if self.is_running:
            return tr("Checking: {count} looked at", count=len(self.findings))
        if self.against:
            count = len(self.against)
            whole = len(used)
            if count == 1:
                return tr("Not ready: 1 of {whole} checks stands against driving", whole=whole)
            return tr("Not ready: {count} of {whole} checks stand against driving", count=count, whole=whole)
        if not self.is_fresh:
            return tr("Not checked yet")
        if self.waiting:
            return tr("The checks are good, but not yet ready to arm: {why}", why=self.waiting[0])
        warned = len(used) - good
        return tr("Ready: {good} of {count} checks good", good=good, count=len(used)) + (
            tr(", {warned} to note", warned=warned) if warned else ""
        )

    @property
    def step(self) -> tuple[str, str] | None:
        """What the bar says instead of "press F6", and what to do; None when the checks are no reason against arming."""
        key = OperatorStep.ARM.value.key
        if self.is_running:
            return tr("Checking before driving"), tr("this takes some seconds; then press {key} to arm", key=key)
        if self.against:
            first = self.against[0]
            return f"{tr_text(first.name)}: {tr_text(first.detail)}", tr("What to do: {fix}", fix=tr_text(first.fix))
        if not self.is_fresh:
            return tr("You steer"), tr("the checks before driving come first: {key}, some seconds, {key} again", key=key)
        return None


def live_findings(view: DriveView | None) -> tuple[PreflightFinding, ...]:
    """What the open rig says of its own camera and servos, now."""
    if view is None:
        return ()
    found = []
    for area, name in ((Area.CAMERA, tr("camera's pictures")), (Area.SERVOS, tr("servos' answers"))):
        faults = [fault for fault in view.active if fault.cause.area is area]
        held = [fault for fault in faults if fault.holds]
        worst = next(iter(held or faults), None)
        if worst is None:
            found.append(PreflightFinding(name, Level.GOOD, tr("no fault")))
            continue
        spec = alert_of(worst.cause, simulated=view.simulated)
        detail = f"{tr(spec.text)} ({tr_text(worst.detail)})" if worst.detail else tr(spec.text)
        found.append(PreflightFinding(name, Level.BAD if held else Level.WARNING, detail, tr(spec.what_to_do)))
    specs = [alert_of(reason, simulated=view.simulated) for reason in view.against_arming if reason in OF_THE_RIG]
    found += [PreflightFinding(tr("rig"), Level.BAD, tr(spec.text), tr(spec.what_to_do)) for spec in specs]
    return tuple(found)


def waiting_for(view: DriveView | None) -> tuple[str, ...]:
    """Why the supervisor would refuse arming now, apart from what ``live_findings`` has."""
    if view is None:
        return ()
    told = {Area.CAMERA, Area.SERVOS}
    reasons = (
        reason
        for reason in view.against_arming
        if reason not in OF_THE_RIG and not (isinstance(reason, Cause) and reason.area in told)
    )
    return tuple(tr(alert_of(reason, simulated=view.simulated).text) for reason in reasons)


class PreflightModel(QObject):
    """Makes the checks in a process of their own, and refuses arming without them.

    ``changed`` comes when there is something new to show; ``asked`` with a line when the operator wanted to arm and could not yet.

    Parameters
    ----------
    config : the configuration in force.
    view : who drives, now; None while there is nothing to drive.
    command : what makes the checks; each line of it a check, as ``hardware.preflight.preflight`` writes them.
    """

    changed = Signal()
    asked = Signal(str)

    def __init__(
        self,
        config: Callable[[], Config],
        view: Callable[[], DriveView | None],
        parent: QObject | None = None,
        *,
        command: list[str] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(parent)
        self._config, self._view, self._clock = config, view, clock
        self._command = command if command is not None else module_of("hardware.preflight.preflight")
        self.sources: list[Callable[[], PreflightFinding | None]] = []
        """Of findings that another part of the window has."""
        self._child: ChildProcess | None = None
        self._checks: list[Check] = []
        self._checked: str | None = None
        self._of = ""
        self._done_s = 0.0
        self._problem = ""
        self._later = QTimer(self, singleShot=True, interval=_BEGIN_AFTER_MS)
        self._later.timeout.connect(self._begin_if_needed)
        self._limit = QTimer(self, singleShot=True, interval=_LONGEST_MS)
        self._limit.timeout.connect(self._on_too_long)

    @property
    def has_robot(self) -> bool:
        return self._view() is not None

    @property
    def preflight(self) -> Preflight:
        is_of_now = self._of == _digest(self._config())
        age_s = self._clock() - self._done_s if self._checked is not None and is_of_now else None
        made = (
            tuple(PreflightFinding(check.name, level_of(check), check.detail, check.fix) for check in self._checks)
            if is_of_now
            else ()
        )
        view = self._view()
        more = tuple(finding for source in self.sources if (finding := source()) is not None)
        return Preflight((*live_findings(view), *more, *made), self._child is not None, age_s, self._problem, waiting_for(view))

    def begin_soon(self) -> None:
        """Make the checks soon after a rig's first picture, so that they are ready before arming."""
        self._later.start()

    def begin(self) -> None:
        """Make the checks; running ones are cancelled."""
        self._cancel()
        config = self._config()
        self._checks, self._checked, self._problem, self._of = [], None, "", _digest(config)
        priority = 0 if config.rig.camera == "twin" else LOW_PRIORITY  # the twin waits for a busy computer, real devices do not
        child = ChildProcess(self._command, self, given=config.model_dump_json(), priority=priority)
        child.told.connect(self._on_check)
        child.ended.connect(self._on_ended)
        self._child = child
        self._limit.start()
        child.start()
        self.changed.emit()

    def may_ask(self, step: OperatorStep) -> bool:
        """Whether a step may be asked for: arming only after the checks. Missing ones are begun, and the operator is told."""
        if step is not OperatorStep.ARM or self._view() is None:
            return True
        now = self.preflight
        if now.is_fresh and not now.is_running and not now.against:
            return True
        line = tr("Not armed yet: the checks before driving take some seconds, then arm again")
        if now.against:
            first = now.against[0]
            more = tr(" (+{count} more)", count=len(now.against) - 1) if len(now.against) > 1 else ""
            what, fix = sentence(f"{tr_text(first.name)}: {tr_text(first.detail)}"), tr_text(first.fix)
            line = tr("Not armed. {what} What to do: {fix}{more}", what=what, fix=fix, more=more)
        if not now.is_fresh and not now.is_running:
            self.begin()
        self.asked.emit(line)
        return False

    def close(self) -> None:
        self._later.stop()
        self._cancel()

    def _cancel(self) -> None:
        child, self._child = self._child, None
        self._limit.stop()
        if child is not None:
            child.leave()
            child.kill()

    def _begin_if_needed(self) -> None:
        if self._child is None and self._view() is not None and not self.preflight.is_fresh:
            self.begin()

    def _on_check(self, record: dict[str, Any]) -> None:
        if {"name", "ok", "detail", "fix"} <= record.keys():
            self._checks.append(Check(str(record["name"]), record["ok"] is True, str(record["detail"]), str(record["fix"])))
            self.changed.emit()

    def _on_ended(self, code: int, line: str) -> None:
        self._child = None
        self._limit.stop()
        if code == 0 and self._checks:
            self._checked, self._done_s = self._of, self._clock()
        else:
            self._problem = line or tr("they ended with exit code {code}", code=code)
        self.changed.emit()

    def _on_too_long(self) -> None:
        self._cancel()
        self._problem = tr("no answer within {seconds:.0f} s", seconds=_LONGEST_MS / 1000)
        self.changed.emit()


def _digest(config: Config) -> str:
    return json.dumps({name: getattr(config, name).model_dump(mode="json") for name in _MATTERS}, sort_keys=True)
