"""The program's commands as tests give them: in this process, where what they load is loaded once, or in one of their own."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO
from unittest import mock

from app.cli import main

MAIN = Path(__file__).resolve().parents[2] / "main.py"


def run(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command in this process: its exit code and all that is written to its outputs. What it does not catch fails the test."""
    command = ["main.py", *map(str, arguments)]
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    code: object = 0
    with TemporaryFile("w+", encoding="utf-8") as output, TemporaryFile("w+", encoding="utf-8") as errors:
        with (
            mock.patch.object(sys, "argv", command),
            mock.patch("faulthandler.enable"),  # pytest has it look after this process
            mock.patch("app.commands.progress._writers", []),  # each command has its own answer to --progress-json
            contextlib.chdir(cwd or Path.cwd()),
            _instead_of(1, output),
            _instead_of(2, errors),
            contextlib.redirect_stdout(output),
            contextlib.redirect_stderr(errors),
            _logged_to(errors),
        ):
            try:
                main()
            except SystemExit as ended:
                code = ended.code
            finally:
                for number, handler in handlers.items():
                    signal.signal(number, handler)
        texts = [stream.read() for stream in (output, errors) if stream.seek(0) == 0]
    return subprocess.CompletedProcess(command, code, *texts)


@contextlib.contextmanager
def _instead_of(descriptor: int, file: IO[str]) -> Iterator[None]:
    """What libraries and child processes write there goes to the file, too."""
    before = os.dup(descriptor)
    os.dup2(file.fileno(), descriptor)
    try:
        yield
    finally:
        file.flush()
        os.dup2(before, descriptor)
        os.close(before)


@contextlib.contextmanager
def _logged_to(errors: IO[str]) -> Iterator[None]:
    """Pytest listens to what is logged, so that Python would no longer show it."""
    handler = logging.StreamHandler(errors)
    handler.setLevel(logging.WARNING)
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)


def run_apart(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own, as its users start it."""
    command = [sys.executable, str(MAIN), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)
