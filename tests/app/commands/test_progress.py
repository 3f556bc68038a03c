"""Progress for another program: one JSON object a line, and nobody hinders the work by not listening."""

from __future__ import annotations

import io
import json
import sys

import pytest

from app.commands.progress import ProgressLines, ProgressWriter


def test_tasks_are_told_with_what_is_done_and_left(capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressLines(ProgressWriter()) as bar:
        for _ in bar.track(range(3), description="images"):
            pass
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines[-1]["what"] == "images"
    assert (lines[-1]["done"], lines[-1]["total"]) == (3, 3)
    assert all(first["done"] <= second["done"] for first, second in zip(lines, lines[1:], strict=False))


def test_a_thousand_steps_are_few_lines(capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressLines(ProgressWriter()) as bar:
        task = bar.add_task("bytes", total=1000)
        for _ in range(1000):
            bar.advance(task)
    assert 1 <= len(capsys.readouterr().out.splitlines()) < 500


def test_a_listener_that_is_gone_is_noticed_and_hinders_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    class Gone(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr(sys, "stdout", Gone())
    writer = ProgressWriter()
    writer.write({"step": 1})
    assert not writer.is_read
    writer.write({"step": 2})
