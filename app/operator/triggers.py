"""Triggers from other programs: one JSON object a line on a Unix socket, each answered by one (docs/operating.md).

They record, mark, note, take snapshots, ask for the status, and set the target while the program is not armed; nothing here
moves the robot, arms or hands over.
"""

from __future__ import annotations

import json
import math
import os
import socket
from collections.abc import Callable
from functools import partial
from typing import Any

from PySide6.QtCore import QObject, QSocketNotifier, QTimer

from app.operator.window import OperatorWindow
from app.ui.i18n import mark, tr, tr_text
from app.widgets.event_log import LogKind
from core.config.files import trigger_socket
from core.control.modes import ARMED_MODES
from core.devices import UserError
from core.locks import FolderLock

MAX_LINE = 4096
"""Longest request in bytes, its line feed included."""
_MOST_CLIENTS = 8
_LINES_AT_ONCE = 8
"""Requests of one client that are answered without a pause for the window."""
_PAUSE_MS = 20

Answer = dict[str, Any]


class TriggerError(UserError):
    """A request is refused; the message is what its client is told."""


class _Client(QObject):
    """One connection: splits what comes into lines, and sends the answers."""

    def __init__(
        self, line: socket.socket, answer: Callable[[bytes], Answer], on_end: Callable[[str], None], parent: QObject
    ) -> None:
        super().__init__(parent)
        self._line, self._answer, self._on_end = line, answer, on_end
        self._waiting = b""
        line.setblocking(False)
        self._readable = QSocketNotifier(line.fileno(), QSocketNotifier.Type.Read, self)
        self._readable.activated.connect(self._read)

    def _read(self) -> None:
        try:
            received = self._line.recv(MAX_LINE)
        except BlockingIOError:
            return
        except OSError:
            received = b""
        if not received:
            self.close("a program left in the middle of a line" if self._waiting else "")
            return
        self._waiting += received
        self._readable.setEnabled(False)  # what a client sends meanwhile waits in the socket, and then the client waits
        self._serve()

    def _serve(self) -> None:
        """Answer the whole lines that are there, some at a time."""
        if self._line.fileno() < 0:  # closed during the pause
            return
        for _ in range(_LINES_AT_ONCE):
            request, has_end, rest = self._waiting.partition(b"\n")
            if not has_end or len(request) >= MAX_LINE:
                if len(request) >= MAX_LINE:
                    self._send({"ok": False, "error": f"a line has {MAX_LINE} bytes at most"})
                    self.close("a program sent a line without an end")
                    return
                self._readable.setEnabled(True)
                return
            self._waiting = rest
            if not self._send(self._answer(request)):
                self.close("a program does not read its answers")
                return
        QTimer.singleShot(_PAUSE_MS, self, self._serve)

    def _send(self, answer: Answer) -> bool:
        """Whether the whole line was taken: the socket's buffer holds hundreds of answers."""
        data = json.dumps(answer).encode() + b"\n"
        try:
            return self._line.send(data, socket.MSG_NOSIGNAL) == len(data)
        except OSError:
            return False

    def close(self, why: str = "") -> None:
        """End the connection; `why` is a line for the log, "" for a client that simply went."""
        if self._line.fileno() < 0:
            return
        self._readable.setEnabled(False)
        self._line.close()
        self._on_end(why)
        self.deleteLater()


class TriggerServer(QObject):
    """Listens at ``trigger_socket()`` until ``close``; one window of a user has it, and ``problem`` says why not this one."""

    def __init__(self, window: OperatorWindow) -> None:
        super().__init__(window)
        self._window = window
        self.path = trigger_socket()
        self.problem = mark("not started")
        self._lock = FolderLock()
        self._clients: list[_Client] = []
        self._listener: socket.socket | None = None
        self._commands: dict[str, Callable[[Answer], Answer]] = {
            "record start": partial(self._record, True),
            "record stop": partial(self._record, False),
            "mark": lambda _: self._mark(""),
            "note": self._note,
            "snapshot": self._snapshot,
            "target": self._target,
            "status": self._status,
        }

    def listen(self) -> None:
        """Make the socket, which this user alone can open. What goes wrong becomes ``problem``."""
        folder = self.path.parent
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if folder.stat().st_uid != os.getuid():
                raise PermissionError(0, "the folder belongs to another user")
            if not self._lock.take(folder):
                self.problem = mark("another window of the program has the socket")
                return
            self.path.unlink(missing_ok=True)  # of a process that was killed: a living one has the lock
            self._listener = socket.socket(socket.AF_UNIX)
            self._listener.bind(str(self.path))
            self.path.chmod(0o600)
            self._listener.listen(_MOST_CLIENTS)
        except OSError as error:  # among others a path that is too long for a socket
            self.problem = f"{self.path}: {error.strerror or error}"
            self.close()
            return
        self._listener.setblocking(False)
        notifier = QSocketNotifier(self._listener.fileno(), QSocketNotifier.Type.Read, self)
        notifier.activated.connect(self._accept)
        self.problem = ""

    def describe(self) -> None:
        """Say in the window where the socket is, or why it is not open."""
        if self.problem:
            self._window.say(tr("No triggers from other programs: {why}", why=tr_text(self.problem)), is_fault=True)
        else:
            self._window.say(tr("Triggers from other programs: {path}; see main.py trigger --help", path=self.path))

    def close(self) -> None:
        """End all connections, and remove the socket."""
        for client in tuple(self._clients):
            client.close()
        if self._listener is not None:
            for notifier in self.findChildren(QSocketNotifier):
                notifier.setEnabled(False)
            self._listener.close()
            self._listener = None
            self.path.unlink(missing_ok=True)
        self._lock.release()

    def _accept(self) -> None:
        assert self._listener is not None
        try:
            line, _ = self._listener.accept()
        except OSError:  # it has gone already
            return
        if len(self._clients) >= _MOST_CLIENTS:
            line.close()
            self._log(f"more than {_MOST_CLIENTS} programs at once: one was turned away")
            return
        client = _Client(line, self.answer, lambda why: self._on_end(client, why), self)
        self._clients.append(client)

    def _on_end(self, client: _Client, why: str) -> None:
        self._clients.remove(client)
        if why:
            self._log(why)

    def _log(self, line: str) -> None:
        self._window.panels.log(LogKind.NOTE, f"triggers: {line}")

    # ---- requests

    def answer(self, request: bytes) -> Answer:
        """The answer to a line: ``ok``, and what the command tells or the ``error``."""
        try:
            told = json.loads(request)
            if not isinstance(told, dict) or "command" not in told:
                raise TriggerError('not an object with a "command"')
            command = self._commands.get(str(told["command"]))
            if command is None:
                raise TriggerError(f"unknown command {str(told['command'])[:40]!r}; known: {', '.join(self._commands)}")
            return {"ok": True, **command(told)}
        except (ValueError, RecursionError):
            line = "not a line of JSON"
        except TriggerError as error:
            line = str(error)
        self._log(line)
        return {"ok": False, "error": line}

    def _record(self, wanted: bool, _: Answer) -> Answer:
        recorder = self._window.recorder
        status = recorder.status
        if (status.recording or status.armed) is wanted:
            raise TriggerError("a session is being recorded already" if wanted else "no session is being recorded")
        recorder.toggle()
        return {}

    def _mark(self, text: str) -> Answer:
        if problem := self._window.recorder.note(text):
            raise TriggerError(problem)
        return {}

    def _note(self, told: Answer) -> Answer:
        text = told.get("text")
        if not isinstance(text, str) or not text.strip():
            raise TriggerError('a note needs a "text"')
        return self._mark(" ".join(text.split()))

    def _snapshot(self, _: Answer) -> Answer:
        if problem := self._window.save_snapshot():
            raise TriggerError(problem)
        return {}

    def _target(self, told: Answer) -> Answer:
        """As a click into the picture, but only while the program cannot be handed over to: it would drive there."""
        window = self._window
        frame, view, place = window.live_frame, window.controls.view, (told.get("x"), told.get("y"))
        if not all(isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) for value in place):
            raise TriggerError('a target needs "x" and "y", in pixels of the camera')
        x, y = (float(value) for value in place if value is not None)
        if view is not None and view.mode in ARMED_MODES:
            raise TriggerError("the program is armed: choose the target in the window")
        if frame is None or window.waits_for_place:
            raise TriggerError("the picture is not live" if frame is None else "the window waits for a click of the operator")
        height, width = frame.image.shape[:2]
        if not (-0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5):
            raise TriggerError(f"the picture has {width} x {height} pixels")
        if not window.set_target((x, y)):
            raise TriggerError("no rig is open")
        return {}

    def _status(self, _: Answer) -> Answer:
        window = self._window
        recorded, view, tick = window.recorder.status, window.controls.view, window.shown_tick
        pose = tick.scene.pose if tick is not None and window.live_frame is not None else None
        return {
            "rig": window.rig.config.rig.name,
            "kind": window.rig.kind.value,
            "phase": window.rig.phase.value,
            "mode": view.mode.value if view is not None else None,
            "recording": recorded.recording,
            "session": str(recorded.folder) if recorded.recording and recorded.folder is not None else None,
            "saved": str(recorded.saved) if recorded.saved is not None else None,
            "frames": recorded.frames,
            "dropped": recorded.dropped,
            "target": window.target,
            "state": pose.state.value if pose is not None else None,
            "theta_signed_deg": round(pose.theta_signed_deg, 3) if pose is not None else None,
            "confidence": round(pose.confidence, 3) if pose is not None else None,
        }
