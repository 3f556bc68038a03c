"""The program's commands as tests give them: in this process, where what they load is loaded once, or in one of their own."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryFile
from unittest import mock

from app.cli import main

MAIN = Path(__file__).resolve().parents[2] / "main.py"


def run(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command in this process: what it says and its exit code. A traceback is an error of the test."""
    command = ["main.py", *map(str, arguments)]
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    code: object = 0
    with TemporaryFile("w+", encoding="utf-8") as output, TemporaryFile("w+", encoding="utf-8") as errors:
        with (
            mock.patch.object(sys, "argv", command),
            mock.patch("faulthandler.enable"),  # pytest has it look after this process
            contextlib.chdir(cwd or Path.cwd()),
            contextlib.redirect_stdout(output),
            contextlib.redirect_stderr(errors),
        ):
            try:
                main()
            except SystemExit as ended:
                code = ended.code
            finally:
                for number, handler in handlers.items():
                    signal.signal(number, handler)
        texts = [stream.read() for stream in (output, errors) if stream.seek(0) == 0]
    assert isinstance(code, int)
    return subprocess.CompletedProcess(command, code, *texts)


def run_apart(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own, as its users start it."""
    command = [sys.executable, str(MAIN), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)
