"""A command beside the window: what it says comes in the window's thread, and it can be told to end."""

from __future__ import annotations

import os
import signal
import sys
import threading

import pytest
from pytestqt.qtbot import QtBot

from app.ui.workers import ChildProcess


def python(code: str) -> list[str]:
    return [sys.executable, "-c", code]


@pytest.fixture
def ended(qtbot: QtBot) -> list[tuple[int, str]]:
    return []


def run(command: list[str], ended: list[tuple[int, str]], qtbot: QtBot, given: str = "") -> list[object]:
    told: list[object] = []
    child = ChildProcess(command, given=given)
    child.told.connect(told.append)
    child.ended.connect(lambda code, line: ended.append((code, line)))
    child.start()
    qtbot.waitUntil(lambda: bool(ended), timeout=10_000)
    return told


def test_json_objects_are_told_and_other_lines_are_not(ended: list[tuple[int, str]], qtbot: QtBot) -> None:
    code = "print('{\"step\": 1}'); print('no json'); print('[1]'); print('{\"step\": 2}')"
    assert run(python(code), ended, qtbot) == [{"step": 1}, {"step": 2}]
    assert ended == [(0, "")]


def test_what_it_says_comes_in_the_windows_thread(qtbot: QtBot) -> None:
    threads: list[threading.Thread] = []
    child = ChildProcess(python("print('{}')"))
    child.told.connect(lambda _: threads.append(threading.current_thread()))
    child.ended.connect(lambda *_: threads.append(threading.current_thread()))
    child.start()
    qtbot.waitUntil(lambda: len(threads) == 2, timeout=10_000)
    assert set(threads) == {threading.main_thread()}


def test_the_last_line_of_an_error_is_told_without_its_first_word(ended: list[tuple[int, str]], qtbot: QtBot) -> None:
    run(python("import sys; sys.stderr.write('bar 10 %\\nerror: no such folder\\n\\n'); sys.exit(2)"), ended, qtbot)
    assert ended == [(2, "no such folder")]


def test_a_program_that_is_not_there_ends_at_once(ended: list[tuple[int, str]], qtbot: QtBot) -> None:
    run(["/nowhere/program"], ended, qtbot)
    assert ended[0][0] == 127
    assert "cannot be started" in ended[0][1]


def test_it_reads_what_it_is_given(ended: list[tuple[int, str]], qtbot: QtBot) -> None:
    assert run(python("import sys, json; print(json.dumps({'got': sys.stdin.read()}))"), ended, qtbot, "αβγ") == [{"got": "αβγ"}]


def test_it_runs_at_low_priority_and_can_be_asked_to_end(ended: list[tuple[int, str]], qtbot: QtBot) -> None:
    child = ChildProcess(python("import time, os; print('{}', flush=True); time.sleep(60)"), priority=3)
    told: list[object] = []
    child.told.connect(told.append)
    child.ended.connect(lambda code, line: ended.append((code, line)))
    child.start()
    qtbot.waitUntil(lambda: bool(told), timeout=10_000)
    assert child.pid is not None
    assert os.getpriority(os.PRIO_PROCESS, child.pid) == min(19, os.getpriority(os.PRIO_PROCESS, 0) + 3)
    child.ask_to_end()
    qtbot.waitUntil(lambda: bool(ended), timeout=10_000)
    assert ended[0][0] == -signal.SIGTERM


def test_one_that_is_left_says_no_more(qtbot: QtBot) -> None:
    heard: list[object] = []
    child = ChildProcess(python("print('{}')"))
    child.told.connect(heard.append)
    child.ended.connect(lambda *_: heard.append("ended"))
    child.start()
    child.leave()
    qtbot.waitUntil(lambda: not child.is_running, timeout=10_000)
    qtbot.wait(50)
    assert heard == []
