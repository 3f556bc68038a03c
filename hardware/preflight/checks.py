"""A check of the preflight, and those of the computer and of what the program stands on: Python, packages, libraries, a display.

Nothing is imported here that these checks look at: they can be made where the rest of the program does not load.
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from core.messages import message
from core.program import ROOT, is_installed

if TYPE_CHECKING:
    from core.config.models import RecordConfig


@dataclass(frozen=True, slots=True)
class Check:
    """What was looked at, whether it is as it should be, what was found, and what to do ("" when nothing)."""

    name: str
    ok: bool
    detail: str
    fix: str = ""

    def to_json(self) -> dict[str, str | bool]:
        """The keys of ``doctor --json``."""
        return asdict(self)


NOT_CONFIGURED = "not configured"
RENEW = "install LumenPilot again, into a new environment" if is_installed() else "make clean && make setup"
"""Mends damaged and missing files of installed packages. `make setup` alone leaves them: pip looks at versions, not at files."""


def one_line(text: object, limit: int = 300) -> str:
    """A message on one line that fits a table."""
    line = " ".join(str(text).split())
    return line if len(line) <= limit else line[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"


_CORES, _MEMORY_GB, _FREE_GB = 2, 3.5, 1.0
"""What the program needs at least."""
_BUILT_IN_YEAR = 2025


def _memory_gb() -> tuple[float, float]:
    """Memory in all, and what is available, in GB."""
    import psutil

    memory = psutil.virtual_memory()
    return memory.total / 1e9, memory.available / 1e9


def check_machine(cores: int | None = None, memory: Callable[[], tuple[float, float]] = _memory_gb) -> Check:
    """Enough to perceive 20 and more frames a second beside the window and the servo bus."""
    name = "cores and memory"
    if cores is None:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        total_gb, free_gb = memory()
    except ImportError as error:
        return Check(name, False, one_line(error), RENEW)
    detail = f"{cores} core{'s' * (cores > 1)}, {total_gb:.1f} GB of memory, {free_gb:.1f} GB free"
    if cores < _CORES:
        return Check(name, False, detail, f"use a computer with {_CORES} cores or more, or allow this program more of them")
    if total_gb < _MEMORY_GB or free_gb < _FREE_GB:
        return Check(
            name,
            False,
            detail,
            message("close other programs: {a:g} GB must be free, and {b:g} GB there in all", a=_FREE_GB, b=_MEMORY_GB),
        )
    return Check(name, True, detail)


def check_disk(config: RecordConfig, usage: Callable[[Path], tuple[int, int, int]] = shutil.disk_usage) -> Check:
    """Where sessions go: writable, and room for them."""
    from core.config.models import sessions_folder

    name, folder = "recordings", sessions_folder(config.folder)
    there = next((place for place in (folder, *folder.parents) if place.exists()), Path("/"))
    if not there.is_dir():
        return Check(name, False, f"{there} is no folder", "set record.folder to one that can be written")
    if not os.access(there, os.W_OK | os.X_OK):
        return Check(name, False, f"{there} cannot be written", f"sudo chown $USER {there}   (or set record.folder)")
    try:
        total, _, free = usage(there)
    except OSError as error:
        return Check(name, False, f"{there}: {error.strerror}", "check the disk, or set record.folder")
    detail = message("{folder}: {a:.1f} GB free of {b:.1f} GB", folder=folder, a=free / 1000000000.0, b=total / 1000000000.0)
    if free < config.warn_free_mb * 1e6 or (total and free / total < config.warn_free_share):
        wanted = max(config.warn_free_mb / 1e3, config.warn_free_share * total / 1e9)
        return Check(name, False, detail, message("make room ({a:.1f} GB or more), or set record.folder to another disk", a=wanted))
    return Check(name, True, detail)


def check_clock(wall: Callable[[], float] = time.time) -> Check:
    """The date can be true: sessions are named by it. Ages and time limits go by the monotonic clock."""
    date = time.gmtime(wall())
    detail = message("now {time} UTC", time=time.strftime("%Y-%m-%d %H:%M", date))
    if date.tm_year < _BUILT_IN_YEAR:
        return Check("clock", False, f"{detail}: the date is wrong, and sessions are named by it", "sudo timedatectl set-ntp true")
    return Check("clock", True, detail)


LOCK = ROOT / "requirements.lock"

_REMOVED = {"openvino-telemetry"}
"""Pinned because openvino asks for it, and removed by set-up because it reports over the network."""

LIBRARIES = {
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libfontconfig.so.1": "libfontconfig1",
    "libglib-2.0.so.0": "libglib2.0-0",
    "libdbus-1.so.3": "libdbus-1-3",
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libxcb-cursor.so.0": "libxcb-cursor0",
    "libxcb-icccm.so.4": "libxcb-icccm4",
    "libxcb-keysyms.so.1": "libxcb-keysyms1",
    "libxcb-shape.so.0": "libxcb-shape0",
    "libxkbcommon-x11.so.0": "libxkbcommon-x11-0",
}
"""Shared library -> the Debian package that has it; the same list as in ``scripts/set_up.sh``."""


def check_python(version: tuple[int, ...] = sys.version_info[:3]) -> Check:
    """Python 3.11 to 3.13."""
    found = ".".join(map(str, version))
    fix = "" if (3, 11) <= version[:2] <= (3, 13) else "install Python 3.11, then: make PYTHON=python3.11 setup"
    return Check("python", not fix, f"{found}, {sys.executable}", fix)


def check_packages(lock: Path = LOCK, installed: Callable[[str], str] = metadata.version) -> Check:
    """Every package to run with against its pin; local parts of versions ("+cpu") do not count. Installed programs have no pins."""
    if lock is LOCK and is_installed():
        return _check_required(metadata.requires("lumenpilot") or ())
    try:
        to_run = lock.read_text(encoding="utf-8").partition("# --- to test")[0]
    except OSError as error:
        return Check("packages", False, f"{lock.name}: cannot be read ({error.strerror})", "restore requirements.lock")
    lines = re.findall(r"^([\w.-]+)==([^\s;]+)(?: ; ([^\\\n]+?))?(?: \\)?$", to_run, re.MULTILINE)
    pins, wrong = {name: pin for name, pin, marker in lines if _applies(marker)}, []
    for name, pin in pins.items():
        try:
            found = installed(name).partition("+")[0]
        except metadata.PackageNotFoundError:
            found = ""
        if found != pin and not (name in _REMOVED and not found):
            wrong.append(f"{name} {found or 'missing'} instead of {pin}")
    if wrong:
        return Check("packages", False, "; ".join(wrong), "rm -f .venv/.ready && make setup")
    return Check("packages", True, message("{a} as pinned", a=len(pins) - len(_REMOVED & set(pins))))


def _applies(marker: str) -> bool:
    """Whether a line of the lock is for this Python; all other markers hold here."""
    found = re.fullmatch(r"python_full_version (<|>=) '3\.(\d+)'", marker)
    return found is None or (sys.version_info < (3, int(found[2]))) == (found[1] == "<")


def _check_required(requirements: Iterable[str], installed: Callable[[str], str] = metadata.version) -> Check:
    """Every package that the installed program needs, extras left out; their versions were the installer's business."""
    names = [re.split(r"[^\w.-]", line, maxsplit=1)[0] for line in requirements if "extra ==" not in line]
    missing = []
    for name in names:
        try:
            installed(name)
        except metadata.PackageNotFoundError:
            missing.append(name)
    if missing:
        return Check("packages", False, message("missing: {names}", names=", ".join(missing)), RENEW)
    return Check("packages", True, message("{a} can be loaded", a=len(names)))


def check_libraries(load: Callable[[str], object] = ctypes.CDLL) -> Check:
    """System libraries of the window and of the USB camera, by loading each."""
    missing = []
    for library in LIBRARIES:
        try:
            load(library)
        except OSError:
            missing.append(library)
    if missing:
        packages = " ".join(dict.fromkeys(LIBRARIES[library] for library in missing))
        fix = f"sudo apt-get install --yes --no-install-recommends {packages}"
        return Check("system libraries", False, message("missing: {names}", names=", ".join(missing)), fix)
    return Check("system libraries", True, message("{a} can be loaded", a=len(LIBRARIES)))


OF_THE_PROGRAM: tuple[Callable[[], Check], ...] = (check_python, check_packages, check_libraries)
"""Those that can be made where the rest of the program does not load."""


def x_server_answers(display: str) -> bool:
    """Whether a window could be opened there, by connecting once. True where that cannot be asked (no libxcb)."""
    try:
        xcb = ctypes.CDLL("libxcb.so.1")
    except OSError:
        return True
    xcb.xcb_connect.restype = ctypes.c_void_p
    xcb.xcb_connect.argtypes = [ctypes.c_char_p, ctypes.c_void_p]
    for function in (xcb.xcb_connection_has_error, xcb.xcb_disconnect):
        function.argtypes = [ctypes.c_void_p]
    connection = xcb.xcb_connect(os.fsencode(display), None)
    try:
        return not xcb.xcb_connection_has_error(connection)
    finally:
        xcb.xcb_disconnect(connection)


def check_display(environ: Mapping[str, str], answers: Callable[[str], bool] = x_server_answers) -> Check:
    """Somewhere to show the window. Recording, trials and training need none."""
    name, advice = "display", "start it in a desktop session, or give it a virtual one: xvfb-run -a make run"
    platform = environ.get("QT_QPA_PLATFORM", "")
    if platform and not platform.startswith(("xcb", "wayland")):
        return Check(name, True, message("QT_QPA_PLATFORM={name}: nothing is shown on a screen", name=platform))
    if wayland := environ.get("WAYLAND_DISPLAY"):
        socket = Path(environ.get("XDG_RUNTIME_DIR", "/")) / wayland
        if socket.exists():
            return Check(name, True, f"Wayland, {wayland}")
        if not environ.get("DISPLAY"):
            return Check(name, False, f"WAYLAND_DISPLAY={wayland}, but {socket} is not there", advice)
    display = environ.get("DISPLAY")
    if not display:
        return Check(name, False, "none: only commands without a window can run", advice)
    if not answers(display):
        return Check(name, False, f"DISPLAY={display}, but no X server takes a window there", advice)
    return Check(name, True, f"X11, {display}")
