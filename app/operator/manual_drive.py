"""Manual driving: keys, buttons, gamepad and pedal that move and stop the robot, and the panels that show it.

Keys and buttons act while they are held; which keys are STOP is in ``stop_keys``. The threads of gamepad and pedal call the pilot
directly.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QObject, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QAbstractSpinBox,
    QLineEdit,
    QMenuBar,
    QWidget,
)

from app.operator.recording import Recorder
from app.operator.rig_session import RigSession, StopOutcome
from app.operator.stop_keys import COMMAND_MODIFIERS, application, is_stop
from app.ui.i18n import tr, tr_text
from app.ui.texts import OperatorStep, Undriven, joint_title
from app.widgets.alerts import AlertSounds
from app.widgets.basics import SCROLL_KEYS
from app.widgets.event_log import LogKind
from app.widgets.jog_panel import KEYS, Motion
from core.config.models import Config
from core.control.drive_view import DriveView
from core.control.kept_zero import ZeroRequest
from core.control.modes import ARMED_MODES, Act
from core.control.motion import AT_REST, Jog
from core.control.pilot import KEYBOARD, Pilot
from core.types import Point
from hardware.inputs.gamepad import Gamepad, GamepadError, GamepadState
from hardware.inputs.pedal import Pedal, PedalError, PedalReport
from hardware.servos.bus_ipc import BusStatus

if TYPE_CHECKING:
    from app.operator.panels import OperatorPanels

_WINDOW_LOST = (QEvent.Type.WindowDeactivate, QEvent.Type.WindowBlocked)
"""Blocked by a dialog, a window gets no release any more, even where the desktop leaves it the focus."""


class HeldInput(QObject):
    """Controls that act while they are held: listens to the keys of the whole application until ``detach``.

    Subclasses say what a press and a release mean, and what is repeated every `period_ms` while ``_timer`` runs. Everything is
    released when `window` or the application loses the focus, or a dialog blocks it, so that nothing goes on unattended.
    """

    def __init__(self, window: QWidget, period_ms: int) -> None:
        super().__init__(window)
        self._window = window
        self._timer = QTimer(self, interval=period_ms, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._repeat)
        app = application()
        app.installEventFilter(self)
        app.applicationStateChanged.connect(self._on_application_state)

    def release_all(self) -> None:
        raise NotImplementedError

    def detach(self) -> None:
        """Release everything and listen no more."""
        self.release_all()
        application().removeEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        kind = event.type()
        if kind == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            return self._on_press(watched, event)
        if kind == QEvent.Type.KeyRelease and isinstance(event, QKeyEvent):
            return self._on_release(event)
        if kind in _WINDOW_LOST and watched is self._window:
            self.release_all()
        return False

    def _on_press(self, watched: QObject, event: QKeyEvent) -> bool:
        """True when the key goes no further."""
        raise NotImplementedError

    def _on_release(self, event: QKeyEvent) -> bool:
        raise NotImplementedError

    def _repeat(self) -> None:
        raise NotImplementedError

    def _on_application_state(self, state: Qt.ApplicationState) -> None:
        if state != Qt.ApplicationState.ApplicationActive:
            self.release_all()


def place_of(event: QKeyEvent) -> tuple[str, int]:
    """Which key of the keyboard it is: what it means may change while it is down.

    With NumLock the keypad's Up, pressed beside Shift, is released as an 8; where Shift and Alt together change the layout, Shift
    itself is released as another key.
    """
    scan_code = event.nativeScanCode()
    return ("place", scan_code) if scan_code else ("key", event.key())


PERIOD_MS = 33
"""A held jog is repeated at this period."""
_MOTION_OF_KEY = {key: motion for motion, keys in KEYS.items() for key in keys}
_BY_PLACE = {
    24: Qt.Key.Key_Q, 25: Qt.Key.Key_W, 26: Qt.Key.Key_E, 38: Qt.Key.Key_A, 39: Qt.Key.Key_S, 40: Qt.Key.Key_D, 53: Qt.Key.Key_X,
    52: Qt.Key.Key_Z, 54: Qt.Key.Key_C,
}  # fmt: skip
"""Where these letters lie, in the numbers of X11 and Wayland, for a layout that has the letters of another alphabet there."""
_FIRST_LETTER, _FIRST_OTHER_KEY = 0x80, 0x0100_0000


class JogKeys(HeldInput):
    """Turns held keys and held buttons into a ``Jog``.

    ``changed`` carries the jog at each press and release and every 33 ms while something is held, since silence counts as released.
    ``stop_pressed`` comes from a STOP key in any window of the program; ``can_move`` decides what Space is in a text field.
    """

    changed = Signal(object)
    held_changed = Signal(object)
    stop_pressed = Signal()

    def __init__(self, window: QWidget, can_move: Callable[[], bool] = lambda: True) -> None:
        super().__init__(window, PERIOD_MS)
        self._can_move = can_move
        self._held: dict[object, Motion] = {}

    @property
    def held(self) -> frozenset[Motion]:
        return frozenset(self._held.values())

    @property
    def jog(self) -> Jog:
        """How the controls are held now."""
        held = self.held
        return Jog(
            bend=_sign(held, Motion.STEER_RIGHT, Motion.STEER_LEFT),
            pitch=_sign(held, Motion.PITCH_UP, Motion.PITCH_DOWN),
            advance=_sign(held, Motion.ADVANCE, Motion.RETRACT),
            delivery=_sign(held, Motion.DELIVER, Motion.WITHDRAW),
            straighten=Motion.STRAIGHTEN in held,
            rotation=_sign(held, Motion.TURN_LEFT, Motion.TURN_RIGHT),
        )

    def press(self, source: object, motion: Motion) -> None:
        """`source` (a key, a button) starts to hold `motion`."""
        if self._held.get(source) is not motion:
            self._held[source] = motion
            self._timer.start()
            self._announce()

    def release(self, source: object) -> None:
        if source in self._held:
            del self._held[source]
            if not self._held:
                self._timer.stop()
            self._announce()

    def release_all(self) -> None:
        if self._held:
            self._held.clear()
            self._timer.stop()
            self._announce()

    def _on_press(self, watched: QObject, event: QKeyEvent) -> bool:
        if not isinstance(watched, QWidget):
            return False
        key = _key_of(event)
        if is_stop(watched, event, self._can_move()):  # wherever it goes to: menus, lists and dialogs too
            if not event.isAutoRepeat():
                self.stop_pressed.emit()
                self.release_all()
            return True
        if event.isAutoRepeat() and place_of(event) in self._held:
            return True  # a field or menu that gets the focus meanwhile is not typed into by it
        if watched.window() is not self._window or event.modifiers() & COMMAND_MODIFIERS:
            return False
        motion = _MOTION_OF_KEY.get(key)
        # A field keeps its letters and arrows, and what it does not use must not reach the robot by way of its parent.
        focus = self._window.focusWidget()
        # A tap on Alt gives the keys to the menu bar, where the arrows go from menu to menu.
        if motion is None or isinstance(focus, QAbstractSpinBox | QLineEdit | QMenuBar):
            return False
        if isinstance(focus, QAbstractItemView) and key in SCROLL_KEYS:
            return False
        if not event.isAutoRepeat():
            self.press(place_of(event), motion)
        return True

    def _on_release(self, event: QKeyEvent) -> bool:
        """A release counts wherever it goes, or motion would go on after a menu opened over the window."""
        place = place_of(event)
        if event.isAutoRepeat():
            return place in self._held
        if place in self._held:
            self.release(place)
            return True
        return False

    def _repeat(self) -> None:
        self.changed.emit(self.jog)

    def _announce(self) -> None:
        self.held_changed.emit(self.held)
        self.changed.emit(self.jog if self._held else AT_REST)


def _key_of(event: QKeyEvent) -> Qt.Key:
    """The key by its letter, or for another alphabet by the place that a Latin letter has on the keyboard."""
    key = Qt.Key(event.key())
    return _BY_PLACE.get(event.nativeScanCode(), key) if _FIRST_LETTER <= key < _FIRST_OTHER_KEY else key


def _sign(held: frozenset[Motion], plus: Motion, minus: Motion) -> int:
    """+1, -1, or 0 when neither or both are held."""
    return (plus in held) - (minus in held)


REPEAT_MS = 25
"""Silence of 80 ms counts as released, so a held deadman is reported three times in that time."""
_KEY = Qt.Key.Key_Shift


class DeadmanKey(HeldInput):
    """The deadman on the keyboard (Shift) and on the screen (a field that is held with the mouse).

    ``reported`` comes with True every 25 ms while it is held, and with False at once when it is released or the focus is lost. A
    key that was down when the window got the focus does not count: only a press does.
    """

    reported = Signal(bool)

    def __init__(self, window: QWidget) -> None:
        super().__init__(window, REPEAT_MS)
        self._holders: set[str] = set()
        self._places: set[tuple[str, int]] = set()

    @property
    def is_held(self) -> bool:
        return bool(self._holders)

    def hold(self, holder: str, on: bool) -> None:
        """The key or the mouse presses it, or releases it."""
        before = self.is_held
        if on:
            self._holders.add(holder)
        else:
            self._holders.discard(holder)
        if self.is_held is not before:
            if self.is_held:
                self._timer.start()
            else:
                self._timer.stop()
            self.reported.emit(self.is_held)

    def release_all(self) -> None:
        self._places.clear()
        for holder in tuple(self._holders):
            self.hold(holder, False)

    def _on_press(self, watched: QObject, event: QKeyEvent) -> bool:
        is_own = isinstance(watched, QWidget) and watched.window() is self._window
        if event.key() == _KEY and is_own and not event.isAutoRepeat():
            self._places.add(place_of(event))
            self.hold("key", True)
        return False

    def _on_release(self, event: QKeyEvent) -> bool:
        """The first Shift that comes up counts, and whatever a Shift that went down has become meanwhile."""
        if not event.isAutoRepeat() and (event.key() == _KEY or place_of(event) in self._places):
            self._places.clear()
            self.hold("key", False)
        return False

    def _repeat(self) -> None:
        self.reported.emit(True)


_UPDATE_EVERY_MS = 50
_ACT_OF = {
    OperatorStep.ACKNOWLEDGE: Act.ACKNOWLEDGE,
    OperatorStep.ARM: Act.ARM,
    OperatorStep.HAND_OVER: Act.HAND_OVER,
    OperatorStep.TAKE_BACK: Act.TAKE_BACK,
    OperatorStep.DISARM: Act.DISARM,
}


class DriveController(QObject):
    """Passes the operator's controls to the pilot of the running rig, and the pilot's view and alerts to panels and recorder.

    ``reported`` carries each ``DriveNews`` of the pilot, for other windows that drive.

    Parameters
    ----------
    window : whose keys are listened to.
    panels : what shows driving; without a pilot (a recording) that there is nothing to drive.
    recorder : keeps alerts and targets with the session.
    """

    reported = Signal(object)

    def __init__(self, window: QWidget, rig: RigSession, panels: OperatorPanels, recorder: Recorder) -> None:
        super().__init__(window)
        self._rig, self._panels, self._recorder = rig, panels, recorder
        self.jog = JogKeys(window, lambda: self.can_move)
        self.deadman = DeadmanKey(window)
        self.sounds = AlertSounds(self)
        self.view: DriveView | None = None
        """What is on the screen."""
        self.why_not = Undriven.NOT_YET
        """What is shown while there is no pilot."""
        self._speed = 1.0
        self._timer = QTimer(self, interval=_UPDATE_EVERY_MS)
        self._timer.timeout.connect(self.update_view)
        self.jog.changed.connect(self.drive)
        self.jog.stop_pressed.connect(self.stop)
        self.deadman.reported.connect(self._on_deadman)
        rig.leaving.connect(self.update_view)
        rig.releasing.connect(self._release_all)
        rig.add_work(self._work)

    @property
    def bus(self) -> BusStatus | None:
        """The newest status of the servo bus; None without one."""
        return self._rig.engine.bus_status()

    @property
    def can_move(self) -> bool:
        """Whether anything can move now, or is about to."""
        pilot = self._rig.pilot
        return pilot is not None and pilot.can_move

    def start(self) -> None:
        """Read the pilot's view from now on; each time is a sign of life of the window."""
        self._timer.start()

    def detach(self) -> None:
        """Let go of everything, and listen no more."""
        self._timer.stop()
        self.jog.detach()
        self.deadman.detach()

    def _release_all(self) -> None:
        self.jog.release_all()
        self.deadman.release_all()

    def _work(self) -> str:
        return tr("the robot is armed: disarm it first") if self.view is not None and self.view.mode in ARMED_MODES else ""

    # ---- requests

    def ask_step(self, step: OperatorStep) -> None:
        """One of the steps that have a button and a key; refusals come back as alerts."""
        if step is OperatorStep.SERVOS_ON:
            if (pilot := self._rig.pilot) is not None and pilot.switch_on():
                self._log(tr("servos on"))
        else:
            self.ask(_ACT_OF[step])

    def ask(self, act: Act) -> None:
        """A request of the operator other than STOP; refusals come back as alerts."""
        if (pilot := self._rig.pilot) is not None:
            pilot.ask(act)
            self._log(act.value)

    def stop(self) -> None:
        """STOP, before anything else."""
        texts = {
            StopOutcome.OPENING: tr("stop: the rig that is being opened starts stopped"),
            StopOutcome.NOTHING: tr("stop: no rig is open, so nothing moves"),
        }
        self._log(texts.get(self._rig.stop(), Act.STOP.value))
        self._release_all()

    def reboot(self, servo_id: int) -> None:
        if (pilot := self._rig.pilot) is not None and pilot.reboot(servo_id):
            self._log(tr("restart servo {servo_id}", servo_id=servo_id))

    def zero(self, request: ZeroRequest) -> None:
        if (pilot := self._rig.pilot) is not None and pilot.zero(request):
            names = dict.fromkeys((*request.positions_mm, *request.kept))
            self._log(tr("zero {what}", what=", ".join(joint_title(name) for name in names)))

    def torque_off(self) -> None:
        if (pilot := self._rig.pilot) is not None and pilot.torque_off():
            self._log(tr("torque off"))

    def drive(self, jog: Jog) -> None:
        """Move the robot as held keys do; to be repeated."""
        if (pilot := self._rig.pilot) is not None:
            pilot.jog("window", jog)

    def set_speed(self, share: float) -> None:
        """Move at a share of full speed, 0..1, by whatever control; the next rig keeps it."""
        self._speed = share
        if (pilot := self._rig.pilot) is not None:
            pilot.hand_speed(share)

    def log_target(self, target: Point | None) -> None:
        self._recorder.keep_target(target)
        text = tr("cleared") if target is None else tr("set to {x:.0f}, {y:.0f} px", x=target[0], y=target[1])
        self._panels.log(LogKind.TARGET, text)

    def press(self, motion: Motion) -> None:
        self.jog.press(("button", motion), motion)

    def release(self, motion: Motion) -> None:
        self.jog.release(("button", motion))

    def _on_deadman(self, held: bool) -> None:
        if (pilot := self._rig.pilot) is not None:
            pilot.deadman(KEYBOARD, held)

    def _log(self, text: str) -> None:
        self._panels.log(LogKind.OPERATOR, text)

    # ---- what the pilot reports

    def update_view(self) -> None:
        """Show, record and sound what the pilot has reported since the last time."""
        pilot = self._rig.pilot
        if pilot is None:
            # A pilot that has just gone belonged to a rig that is over, even where its phase has not been reported yet.
            is_told = self.view is None or self.why_not is not Undriven.NO_ROBOT
            self.view = None
            self._panels.show_drive(None, None, self.why_not if is_told else Undriven.NOT_YET)
            return
        pilot.window_alive()
        pilot.hand_speed(self._speed)
        if not self.deadman.is_held:
            pilot.deadman(KEYBOARD, False)
        news = pilot.news()
        # The recorder may know of the next rig already; what this one reported until then was recorded when it was left.
        is_kept = not self._rig.engine.is_ending
        for view in news.changes if is_kept else ():
            self._recorder.keep_drive(view)
        before, self.view = self.view, news.view
        if before is None or before.mode is not news.view.mode:
            self._panels.log(LogKind.MODE, news.view.mode.value)
        for alert in news.alerts:
            detail = f": {tr_text(alert.detail)}" if alert.detail else ""
            self._panels.log(LogKind.ALERT, f"{tr(alert.spec.text)}{detail}")
            if is_kept:
                self._recorder.keep_alert(alert, news.view.time_s)
            if alert.sound is not None:
                self.sounds.play(alert.sound)
        self._panels.show_drive(news.view, self.bus)
        if news.alerts:
            self._panels.show_alerts(news.alerts)
        self.reported.emit(news)


class OperatorDevices(QObject):
    """Gamepad and foot pedal, from ``start`` to ``close``.

    ``said`` carries a line for the operator (what was found, lost, or cannot be used, and what to do) and whether it is a fault.

    Parameters
    ----------
    config : sections `gamepad` and `pedal`; without a pedal's port there is no pedal.
    pilot : the running rig's pilot, None without one; called from the devices' threads.
    stop : STOP to whatever moves the servos; called from the devices' threads.
    """

    said = Signal(str, bool)

    def __init__(
        self,
        config: Config,
        pilot: Callable[[], Pilot | None],
        stop: Callable[[], object],
        parent: QObject | None = None,
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
        if state.stop:
            self._stop()
        if (pilot := self._pilot()) is not None:
            jog = Jog(state.bend_rate, state.pitch_rate, state.advance, state.delivery, rotation=state.rotation)
            pilot.jog("gamepad", jog)
            if state.deadman is not None:
                pilot.deadman("gamepad", state.deadman)

    def _on_pedal(self, report: PedalReport) -> None:
        if report.stop:
            self._stop()
        if (pilot := self._pilot()) is not None:
            pilot.deadman("pedal", report.deadman)
            if report.estop is not None:
                pilot.estop(report.estop)

    def _on_gamepad_device(self, name: str | None, problem: GamepadError | None) -> None:
        before, self._gamepad_name = self._gamepad_name, name
        if problem is not None:
            self.said.emit(str(problem), True)
        elif name is not None and name != before:
            self.said.emit(tr("Gamepad: {name}", name=name), False)
        elif name is None and before is not None:
            self.said.emit(tr("Gamepad lost: {name}", name=before), True)

    def _on_pedal_problem(self, problem: PedalError | None) -> None:
        self.said.emit(tr("Foot pedal: ready") if problem is None else str(problem), problem is not None)
