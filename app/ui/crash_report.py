"""Crash reports: of an unforeseen error in any thread or Qt slot, and of a memory fault, which the next start reports.

A memory fault leaves only what ``faulthandler`` could write.
"""

from __future__ import annotations

import faulthandler
import getpass
import json
import logging
import os
import platform
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

import platformdirs

from core.program import ROOT
from core.session.manifest import package_versions

_LOG_LINES = 200
_MOST_REPORTED = 20
_KEPT_REPORTS = 20
_NATIVE, _NEW = ".fault", ".new"

_log = logging.getLogger(__name__)

_Error = tuple[type[BaseException], BaseException | None, TracebackType | None]


def state_folder() -> Path:
    """What the program keeps between runs, and its crash reports."""
    return Path(platformdirs.user_state_dir("LumenPilot"))


@dataclass(frozen=True, slots=True)
class Crash:
    """An unforeseen error. ``what`` is one line, ``report`` the file (None: it could not be written)."""

    what: str
    report: Path | None


class LastLines(logging.Handler):
    """Keeps the newest lines of the log, for the report."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self._lines: deque[str] = deque(maxlen=_LOG_LINES)
        self.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(ValueError, TypeError):  # a message whose arguments do not fit must not make it worse
            self._lines.append(self.format(record))

    @property
    def lines(self) -> list[str]:
        return list(self._lines)


class CrashWatch:
    """Reports all unforeseen errors from ``install`` to ``remove``.

    Parameters
    ----------
    folder : where reports go.
    config : the configuration in force, as plain values, for the report; asked when there is something to report.
    on_error : called at each error, in the thread that met it, before the report is written, with whether it is the first one of
        this run: make the robot safe.
    on_report : called once, after the report was written, in the same thread.
    """

    def __init__(
        self,
        folder: Path,
        config: Callable[[], dict[str, Any]],
        on_error: Callable[[bool], None] = lambda _is_first: None,
        on_report: Callable[[Crash], None] = lambda _: None,
    ) -> None:
        self._folder = folder
        self._config, self.on_error, self.on_report = config, on_error, on_report
        self._lock = threading.Lock()
        self._count = 0
        self._report: Path | None = None
        self._lines = LastLines()
        self._native: TextIO | None = None
        self._name = f"crash_{datetime.now(UTC):%Y%m%dT%H%M%SZ}_{os.getpid()}"
        self._hooks: tuple[Any, Any] | None = None

    def install(self) -> None:
        """Take over all hooks. A folder that cannot be written is logged; errors are then only shown."""
        self._hooks = sys.excepthook, threading.excepthook
        sys.excepthook = self._on_error
        threading.excepthook = self._on_thread_error
        logging.getLogger().addHandler(self._lines)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._native = (self._folder / f"{self._name}{_NATIVE}").open("w", encoding="utf-8")
            faulthandler.enable(self._native)
        except OSError as error:
            _log.warning("crash reports cannot be written to %s (%s)", self._folder, error.strerror)

    def remove(self) -> None:
        """The program ends properly: only reports are left."""
        if self._hooks is not None:
            sys.excepthook, threading.excepthook = self._hooks
            self._hooks = None
        logging.getLogger().removeHandler(self._lines)
        native, self._native = self._native, None
        if native is not None:
            faulthandler.disable()
            native.close()
            with suppress(OSError):
                Path(native.name).unlink()

    # ---- errors

    def _on_error(self, kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if not issubclass(kind, Exception):  # Ctrl-C and exits are no crashes
            sys.__excepthook__(kind, error, trace)
            return
        self.report((kind, error, trace), threading.current_thread().name)

    def _on_thread_error(self, args: threading.ExceptHookArgs) -> None:
        if issubclass(args.exc_type, Exception):
            name = args.thread.name if args.thread is not None else "a thread"
            self.report((args.exc_type, args.exc_value, args.exc_traceback), name)

    def report(self, error: _Error, thread: str) -> None:
        """Make the robot safe and report the error; later errors are added to the report of the first."""
        with self._lock:
            self._count += 1
            number = self._count
        text = "".join(traceback.format_exception(*error))
        if number <= _MOST_REPORTED:  # one that comes with every repaint must not fill the disk
            _log.error("unforeseen error in thread %s\n%s", thread, text)
        with _logging_errors():  # later ones, too: the operator may have gone on driving
            self.on_error(number == 1)
        if number <= _MOST_REPORTED:
            self._write(number, thread, text)
        if number == 1:
            what = " ".join(traceback.format_exception_only(error[0], error[1])[-1].split())
            with _logging_errors():
                self.on_report(Crash(what, self._report))

    def _write(self, number: int, thread: str, text: str) -> None:
        path = self._folder / f"{self._name}.txt"
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with path.open("a", encoding="utf-8") as file:
                if number == 1:
                    file.write(scrubbed(_head(self._config) + "\n"))
                file.write(scrubbed(f"\n== error {number}, thread {thread}, {datetime.now(UTC):%Y-%m-%d %H:%M:%S} UTC\n{text}"))
                if number == 1:
                    file.write(scrubbed("\n== last lines of the log before it\n" + "\n".join(self._lines.lines[:-1]) + "\n"))
                file.flush()
                os.fsync(file.fileno())
            path.with_suffix(_NEW).touch()
            self._report = path
        except OSError as error:
            _log.error("the crash report cannot be written: %s", error.strerror)


@contextmanager
def _logging_errors() -> Iterator[None]:
    """What goes wrong while an error is dealt with is only logged: reporting it would begin all over."""
    try:
        yield
    except Exception as error:  # noqa: BLE001 - the hooks of this error are running
        _log.error("and another one while it was dealt with", exc_info=error)


def _head(config: Callable[[], dict[str, Any]]) -> str:
    """Versions and configuration."""
    lines = [f"LumenPilot crash report, {datetime.now(UTC):%Y-%m-%d %H:%M:%S} UTC", "", "== versions"]
    lines += [f"{name} {version}" for name, version in package_versions().items()]
    lines += [f"kernel {platform.release()}", "", "== configuration"]
    try:
        lines.append(json.dumps(config(), indent=1, default=str))
    except (RuntimeError, TypeError, ValueError, AttributeError) as error:
        lines.append(f"cannot be told: {error}")
    return "\n".join(lines)


def scrubbed(text: str) -> str:
    """Without the paths that name the user and private folders: the report is made to be sent."""
    places = {str(Path(sys.prefix)): "<python>", str(ROOT): "<program>", str(Path.home()): "~"}
    for path in sorted(places, key=len, reverse=True):  # one may lie in the other
        if len(path) > 1:
            text = text.replace(path, places[path])
    with suppress(KeyError, OSError, ImportError):
        user = getpass.getuser()
        for place in ("/home/", "/Users/"):
            text = text.replace(f"{place}{user}", "~")
    return text


def crash_of_last_run(folder: Path) -> Crash | None:
    """The newest crash that was not shown yet. Reports of memory faults are made now; old reports are deleted."""
    try:
        natives = [path for path in folder.glob(f"crash_*{_NATIVE}") if not _is_alive(path)]
        for path in natives:
            _report_native(path)
        new = sorted(folder.glob(f"crash_*{_NEW}"))
        reports = sorted(folder.glob("crash_*.txt"))
        for path in new:
            path.unlink()
        for path in reports[:-_KEPT_REPORTS]:
            path.unlink()
    except OSError:
        return None
    if not new or not (report := new[-1].with_suffix(".txt")).is_file():
        return None
    return Crash(_summary(report), report)


def _is_alive(path: Path) -> bool:
    """Whether the run that the file belongs to still goes on."""
    pid = path.stem.rpartition("_")[2]
    try:
        os.kill(int(pid), 0)
    except (ValueError, ProcessLookupError):
        return False
    except PermissionError:
        pass
    return True


def _report_native(path: Path) -> None:
    """A report of what ``faulthandler`` wrote; an empty file is of a run that was killed, which is no crash of ours."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if text.strip():
        report = path.with_suffix(".txt")
        versions = "\n".join(f"{name} {version}" for name, version in package_versions().items())
        with report.open("a", encoding="utf-8") as file:
            file.write(scrubbed(f"LumenPilot crash report: memory fault\n\n== versions\n{versions}\n\n== all threads\n{text}"))
        path.with_suffix(_NEW).touch()
    path.unlink()


def _summary(report: Path) -> str:
    """One line: the last error's own line, or the first one of a memory fault."""
    try:
        lines = report.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return "unknown"
    native = next((line for line in lines if line.startswith("Fatal Python error")), None)
    if native is not None:
        return native.removeprefix("Fatal Python error: ")
    end = next((place for place, line in enumerate(lines) if line.startswith("== last lines")), len(lines))
    told = [line for line in lines[:end] if line.strip() and not line.startswith((" ", "=="))]
    return told[-1] if told else "unknown"
