"""Triggers from other programs: each command, what is refused, broken clients, and the example script against a window."""

from __future__ import annotations

import json
import os
import socket
import stat
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pytestqt.qtbot import QtBot

from app.commands.trigger import request_of
from app.operator.triggers import MAX_LINE, TriggerServer
from app.operator.window import OperatorWindow
from core.config.files import trigger_socket
from core.control.modes import Mode
from core.devices import UserError
from core.session.manifest import EventKind
from core.session.reader import SessionReader
from tests.app.fakes import FakeEngine, until

EXAMPLE = Path(__file__).resolve().parents[3] / "resources/examples/trigger.py"


@pytest.fixture
def server(running: OperatorWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[TriggerServer]:
    """Of a window that shows pictures; the runtime folder is the test's."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    server = TriggerServer(running)
    server.listen()
    assert server.problem == ""
    yield server
    server.close()


Ask = Callable[..., dict[str, Any]]


@pytest.fixture
def line(server: TriggerServer) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX) as line:
        line.connect(str(server.path))
        line.setblocking(False)
        yield line


def _answer(line: socket.socket, qtbot: QtBot) -> bytes:
    """The next answers, whole lines; b"" when the window has ended the connection."""
    received = [b""]

    def has_come() -> bool:
        try:
            received.append(line.recv(100_000))
        except BlockingIOError:
            return False
        return not received[-1] or received[-1].endswith(b"\n")

    until(qtbot, has_come)
    return b"".join(received)


@pytest.fixture
def ask(line: socket.socket, qtbot: QtBot) -> Ask:
    def ask(command: str, **values: object) -> dict[str, Any]:
        line.send(json.dumps({"command": command, **values}).encode() + b"\n")
        return dict(json.loads(_answer(line, qtbot)))

    return ask


def _log(window: OperatorWindow) -> str:
    return "\n".join(window.panels.events.lines)


def test_the_example_script_records_notes_in_a_session(server: TriggerServer, running: OperatorWindow, qtbot: QtBot) -> None:
    assert server.path == trigger_socket()
    assert stat.S_IMODE(server.path.stat().st_mode) == 0o600
    script = subprocess.Popen([sys.executable, str(EXAMPLE)], env=os.environ, stdout=subprocess.PIPE, text=True)
    qtbot.waitUntil(lambda: script.poll() is not None, timeout=60_000)
    told, _ = script.communicate()
    assert script.returncode == 0
    until(qtbot, lambda: running.recorder.status.saved is not None)
    assert Path(told.strip()) == running.recorder.status.saved
    with SessionReader(Path(told.strip())) as reader:
        reader.wait()
        assert [event.text for event in reader.events if event.kind is EventKind.NOTE] == ["trial 1", "trial 2", "trial 3"]


def test_record_mark_and_status(ask: Ask, running: OperatorWindow, qtbot: QtBot) -> None:
    assert ask("mark")["error"].startswith("Nothing is being recorded")
    assert ask("record stop") == {"ok": False, "error": "no session is being recorded"}
    assert ask("record start") == {"ok": True}
    assert ask("record start")["error"] == "a session is being recorded already"
    until(qtbot, lambda: running.recorder.status.recording)
    assert ask("mark") == {"ok": True}
    told = ask("status")
    assert (told["ok"], told["kind"], told["phase"], told["recording"]) == (True, "SIM", "running", True)
    assert told["session"] is not None
    assert ask("record stop") == {"ok": True}


def test_a_target_is_a_click_and_refused_where_a_click_is_none_or_would_steer_the_program(
    ask: Ask, running: OperatorWindow, engine: FakeEngine, qtbot: QtBot
) -> None:
    assert ask("target", x=320, y=240) == {"ok": True}
    assert engine.targets[-1] == running.target == (320.0, 240.0)
    for wrong in ({"x": 1}, {"x": True, "y": 1}, {"x": "1", "y": 2}, {"x": 1e999, "y": 0}):
        assert ask("target", **wrong)["error"].startswith('a target needs "x" and "y"')
    assert ask("target", x=5000, y=1)["error"].startswith("the picture has ")
    running.ask_for_place(lambda _: None)
    assert "waits for a click" in ask("target", x=1, y=1)["error"]
    running.ask_for_place(None)
    engine.pilot.view = replace(engine.pilot.view, mode=Mode.ARMED)
    until(qtbot, lambda: running.controls.view is not None and running.controls.view.mode is Mode.ARMED)
    assert ask("target", x=1, y=1)["error"].startswith("the program is armed")
    assert running.target == (320.0, 240.0)
    assert not engine.jogs


def test_a_line_that_makes_no_sense_is_answered_and_the_next_one_is_served(
    line: socket.socket, ask: Ask, running: OperatorWindow, qtbot: QtBot
) -> None:
    for sent, error in (
        (b"record\n", "not a line of JSON"),
        (b"[" * 3000 + b"\n", "not a line of JSON"),
        (b"\xff\xfe\n", "not a line of JSON"),
        (b'["mark"]\n', 'not an object with a "command"'),
        (b'{"command": "arm"}\n', "unknown command 'arm'; known: record start, "),
        (b'{"command": "note", "text": " "}\n', 'a note needs a "text"'),
    ):
        line.send(sent)
        assert json.loads(_answer(line, qtbot))["error"].startswith(error)
        assert error in _log(running)
        assert ask("status")["ok"]


def test_a_line_without_an_end_is_named_and_ends_its_client_alone(
    line: socket.socket, server: TriggerServer, running: OperatorWindow, qtbot: QtBot
) -> None:
    line.send(b"x" * (MAX_LINE + 1))
    assert json.loads(_answer(line, qtbot).splitlines()[0])["error"] == f"a line has {MAX_LINE} bytes at most"
    assert "a line without an end" in _log(running)
    with socket.socket(socket.AF_UNIX) as other:
        other.connect(str(server.path))
        other.sendall(b'{"command": "sta')
    until(qtbot, lambda: "left in the middle of a line" in _log(running))


def test_many_requests_at_once_are_all_answered(line: socket.socket, qtbot: QtBot) -> None:
    line.send(b'{"command": "mark"}\n' * 30)
    answers = b""
    while answers.count(b"\n") < 30:
        answers += _answer(line, qtbot)
    assert answers.count(b'"ok": false') == 30


def test_a_second_window_says_so_and_a_socket_left_by_a_dead_one_is_replaced(
    server: TriggerServer, running: OperatorWindow, qtbot: QtBot
) -> None:
    second = TriggerServer(running)
    second.listen()
    second.describe()
    assert running.panels.toast.text() == "No triggers from other programs: another window of the program has the socket"
    server.close()
    assert not server.path.exists()
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(server.path))
    second.listen()
    second.describe()
    assert str(second.path) in running.panels.toast.text()
    second.close()


def test_words_of_the_command_line_become_requests() -> None:
    assert request_of(["record", "start"]) == {"command": "record start"}
    assert request_of(["note", "two", "words"]) == {"command": "note", "text": "two words"}
    assert request_of(["target", "1", "2.5"]) == {"command": "target", "x": 1.0, "y": 2.5}
    with pytest.raises(UserError, match="a target is two numbers"):
        request_of(["target", "1"])
