"""Ties the operator's controls and the panels that show driving to the pilot of the running rig."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from PySide6.QtCore import QObject, QTimer, Slot
from PySide6.QtWidgets import QWidget

from app.alert_sounds import AlertSounds
from app.deadman_key import DeadmanKey
from app.engine_thread import EngineThread
from app.event_model import EventKind
from app.jog_keys import JogKeys, Motion
from app.language import tr, tr_text
from app.next_step import Step, Undriven
from app.recorder import Recorder
from core.control.alerts import Alert
from core.control.drive_view import DriveView
from core.control.hand import Jog
from core.control.modes import Act
from core.servo_config import JointName
from core.types import Point
from hardware.servos.bus_messages import BusStatus

_LOOK_EVERY_MS = 50
_ACT_OF = {
    Step.ACKNOWLEDGE: Act.ACKNOWLEDGE,
    Step.ARM: Act.ARM,
    Step.HAND_OVER: Act.HAND_OVER,
    Step.TAKE_BACK: Act.TAKE_BACK,
    Step.DISARM: Act.DISARM,
}


class DrivePanels(Protocol):
    """What the desk shows things on."""

    def show_drive(self, view: DriveView | None, bus: BusStatus | None, why_not: Undriven = Undriven.NO_ROBOT) -> None: ...
    def show_alerts(self, alerts: tuple[Alert, ...]) -> None: ...
    def log(self, kind: EventKind, text: str) -> None: ...


class DriveDesk(QObject):
    """The operator's side of driving. Without a pilot (a recording) it shows that there is nothing to drive.

    Parameters
    ----------
    window : whose keys are listened to.
    thread : runs the rig.
    panels : what to show the pilot's view on.
    recorder : keeps alerts and destinations with the session.
    """

    def __init__(self, window: QWidget, thread: EngineThread, panels: DrivePanels, recorder: Recorder) -> None:
        super().__init__(window)
        self._thread, self._panels, self._recorder = thread, panels, recorder
        self.jog = JogKeys(window, lambda: self.can_move)
        self.deadman = DeadmanKey(window)
        self.sounds = AlertSounds(self)
        self._shown: DriveView | None = None
        self._speed = 1.0
        self.why_not = Undriven.NOT_YET
        """What is shown while there is no pilot."""
        self._timer = QTimer(self)
        self._timer.setInterval(_LOOK_EVERY_MS)
        self._timer.timeout.connect(self.look)
        self.jog.changed.connect(self._on_jog)
        self.jog.stop_pressed.connect(self.stop)
        self.deadman.reported.connect(self._on_deadman)

    @property
    def view(self) -> DriveView | None:
        """What is on the screen."""
        return self._shown

    @property
    def bus(self) -> BusStatus | None:
        """The servo bus's latest word; None where there is none."""
        return self._thread.bus_status()

    @property
    def can_move(self) -> bool:
        """Whether anything can move now, or is about to; without a rig nothing can."""
        pilot = self._thread.pilot
        return pilot is not None and pilot.can_move

    def start(self) -> None:
        """Look at the pilot from now on; each look is a sign of life of the window."""
        self._timer.start()

    def reset(self) -> None:
        """Let go of everything, and let nobody drive, for a rig that is being opened."""
        self.halt()
        self.jog.release_all()
        self.deadman.release_all()

    def halt(self) -> None:
        """Nobody drives any more: the rig is about to be closed."""
        pilot = self._thread.pilot
        if pilot is not None:
            pilot.halt()

    def detach(self) -> None:
        """Let go, look and listen no more."""
        self._timer.stop()
        self.jog.detach()
        self.deadman.detach()

    # ---- requests

    def take(self, step: Step) -> None:
        """One of the steps that have a button and a key."""
        if step is Step.SERVOS_ON:
            self.switch_on()
        else:
            self.ask(_ACT_OF[step])

    def ask(self, act: Act) -> None:
        """A request of the operator; refusals come back as alerts."""
        pilot = self._thread.pilot
        if pilot is None and act is Act.STOP:
            if self._thread.stop_opening():
                self._panels.log(EventKind.OPERATOR, tr("stop: the rig that is being opened starts stopped"))
                return
            pilot = self._thread.pilot  # it may have been opened between the two questions
        if pilot is not None:
            pilot.ask(act)
            self._panels.log(EventKind.OPERATOR, act.value)
        elif act is Act.STOP:
            self._panels.log(EventKind.OPERATOR, tr("stop: no rig is open, so nothing moves"))

    @Slot()
    def stop(self) -> None:
        """STOP, before anything else."""
        self.ask(Act.STOP)
        self.jog.release_all()
        self.deadman.release_all()

    @Slot()
    def switch_on(self) -> None:
        pilot = self._thread.pilot
        if pilot is not None and pilot.switch_on():
            self._panels.log(EventKind.OPERATOR, tr("servos on"))

    @Slot(int)
    def reboot(self, servo_id: int) -> None:
        pilot = self._thread.pilot
        if pilot is not None and pilot.reboot(servo_id):
            self._panels.log(EventKind.OPERATOR, tr("restart servo {servo_id}", servo_id=servo_id))

    @Slot(object)
    def zero(self, names: Sequence[JointName] | None) -> None:
        pilot = self._thread.pilot
        if pilot is not None and pilot.zero(names):
            self._panels.log(
                EventKind.OPERATOR,
                tr("zero {what}", what=", ".join(tr_text(name) for name in names) if names else tr("all servos")),
            )

    @Slot()
    def torque_off(self) -> None:
        pilot = self._thread.pilot
        if pilot is not None and pilot.torque_off():
            self._panels.log(EventKind.OPERATOR, tr("torque off"))

    def drive(self, jog: Jog) -> None:
        """Move the robot as held keys do; to be repeated."""
        self._on_jog(jog)

    @Slot(float)
    def set_speed(self, share: float) -> None:
        """Move at a share of full speed, 0..1, by whatever control; the next rig keeps it."""
        self._speed = share
        pilot = self._thread.pilot
        if pilot is not None:
            pilot.hand_speed(share)

    def log_target(self, target: Point | None) -> None:
        self._recorder.target(target)
        self._panels.log(
            EventKind.TARGET,
            tr("cleared") if target is None else tr("set to {x:.0f}, {y:.0f} px", x=target[0], y=target[1]),
        )

    @Slot(object)
    def press(self, motion: Motion) -> None:
        """A cap on the screen is held."""
        self.jog.press(("cap", motion), motion)

    @Slot(object)
    def release(self, motion: Motion) -> None:
        self.jog.release(("cap", motion))

    def hold_deadman(self, on: bool) -> None:
        """The field on the screen is held."""
        self.deadman.hold("mouse", on)

    # ---- the pilot

    @Slot(object)
    def _on_jog(self, jog: Jog) -> None:
        pilot = self._thread.pilot
        if pilot is not None:
            pilot.jog("window", jog)

    @Slot(bool)
    def _on_deadman(self, held: bool) -> None:
        pilot = self._thread.pilot
        if pilot is not None:
            pilot.deadman("window", held)

    @Slot()
    def look(self) -> None:
        """Take in what the pilot has said since the last look."""
        pilot = self._thread.pilot
        if pilot is None:
            # A pilot that has just gone belonged to a rig that is over, even where nobody has told so yet.
            has_just_gone, self._shown = self._shown is not None, None
            is_told = not has_just_gone or self.why_not is not Undriven.NO_ROBOT
            self._panels.show_drive(None, None, self.why_not if is_told else Undriven.NOT_YET)
            return
        pilot.window_alive()
        pilot.hand_speed(self._speed)
        if not self.deadman.is_held:
            pilot.deadman("window", False)
        news = pilot.news()
        # The recorder may have heard of the next rig already; what this one said until then was told before (``look``).
        is_kept = not self._thread.is_ending
        for view in news.changes if is_kept else ():
            self._recorder.drive(view)
        before, self._shown = self._shown, news.view
        if before is None or before.mode is not news.view.mode:
            self._panels.log(EventKind.MODE, news.view.mode.value)
        for alert in news.alerts:
            detail = f": {tr_text(alert.detail)}" if alert.detail else ""
            self._panels.log(EventKind.ALERT, f"{tr(alert.spec.text)}{detail}")
            if is_kept:
                self._recorder.alert(alert, news.view.time_s)
            if alert.sound is not None:
                self.sounds.play(alert.sound)
        self._panels.show_drive(news.view, self._thread.bus_status())
        if news.alerts:
            self._panels.show_alerts(news.alerts)
