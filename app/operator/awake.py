"""Keeps the desktop from locking its screen, and the computer from sleeping, while real servos follow.

Gamepad and pedal do not count as input for the desktop, and Space would go to the lock screen. Both inhibitions end with this
program, however it ends.
"""

from __future__ import annotations

from PySide6.QtCore import QObject, QProcess, Signal
from PySide6.QtDBus import QDBusConnection, QDBusMessage, QDBusPendingCallWatcher

from app.ui.i18n import tr
from core.control.drive_view import DriveView
from core.control.modes import ARMED_MODES
from hardware.rig import RigKind

WHO, WHY = "LumenPilot", "a robot is being driven"
SLEEP_COMMAND = ("systemd-inhibit", "--what=idle:sleep:handle-lid-switch", f"--who={WHO}", f"--why={WHY}", "--mode=block", "cat")
"""Inhibits until ``cat`` reads the end of its input, which also the death of this program is."""
_CONNECTION = "lumenpilot_awake"
_SERVICE, _PATH = "org.freedesktop.ScreenSaver", "/org/freedesktop/ScreenSaver"
_END_MS = 1000
"""For the end of ``systemd-inhibit`` when the window closes."""


def must_stay_awake(kind: RigKind, view: DriveView | None) -> bool:
    """Whether real servos follow a source, or the program may be handed over to."""
    return kind is RigKind.LIVE and view is not None and (view.servos_on or view.mode in ARMED_MODES)


class AwakeInhibitor(QObject):
    """``failed`` comes once, with a line, when one of the two cannot be inhibited."""

    failed = Signal(str)

    def __init__(self, parent: QObject | None = None, sleep_command: tuple[str, ...] = SLEEP_COMMAND) -> None:
        super().__init__(parent)
        self._sleep_command = sleep_command
        self._process: QProcess | None = None
        self._watcher: QDBusPendingCallWatcher | None = None
        self._is_told = False
        self.is_held = False

    def hold(self, wanted: bool) -> None:
        """Inhibit, or no longer; to be called as often as wanted."""
        if wanted is self.is_held:
            return
        self.is_held = wanted
        if wanted:
            self._hold_sleep()
            self._hold_screen()
        else:
            self._release()

    def close(self) -> None:
        process = self._process
        self.hold(False)
        if process is not None:
            process.waitForFinished(_END_MS)

    def _hold_sleep(self) -> None:
        process = QProcess(self)
        process.setProgram(self._sleep_command[0])
        process.setArguments(list(self._sleep_command[1:]))
        process.errorOccurred.connect(self._on_no_process)
        process.finished.connect(self._on_process_end)
        self._process = process
        process.start()

    def _hold_screen(self) -> None:
        bus = QDBusConnection.connectToBus(QDBusConnection.BusType.SessionBus, _CONNECTION)
        if not bus.isConnected():
            self._tell()
            return
        call = QDBusMessage.createMethodCall(_SERVICE, _PATH, _SERVICE, "Inhibit")
        call.setArguments([WHO, WHY])
        self._watcher = QDBusPendingCallWatcher(bus.asyncCall(call), self)
        self._watcher.finished.connect(self._on_answer)

    def _release(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.closeWriteChannel()
        if self._watcher is not None:
            self._watcher.deleteLater()
            self._watcher = None
        QDBusConnection.disconnectFromBus(_CONNECTION)  # the desktop drops what a client that is gone has inhibited

    def _on_answer(self, watcher: QDBusPendingCallWatcher) -> None:
        if watcher.isError():
            self._tell()

    def _on_no_process(self) -> None:
        if self.is_held:
            self._tell()

    def _on_process_end(self, code: int) -> None:
        process = self.sender()
        if self.is_held and process is self._process:
            self._process = None
            self._tell()
        if isinstance(process, QProcess):
            process.deleteLater()

    def _tell(self) -> None:
        if not self._is_told:
            self._is_told = True
            self.failed.emit(
                tr("The screen may lock, or the computer sleep, while you drive: switch that off in the desktop's settings")
            )
