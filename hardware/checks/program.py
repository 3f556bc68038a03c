"""What the program stands on: Python, packages as pinned, system libraries, a display."""

from __future__ import annotations

import ctypes
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from importlib import metadata
from pathlib import Path

from hardware.checks.check import RENEW, Check, one_line

LOCK = Path(__file__).resolve().parents[2] / "requirements.lock"

PIN_REASONS = {
    "pyrealsense2": "the last version that knows the L515",
    "pyside6-essentials": "others leak on every signal or paint, and abort",
    "shiboken6": "must be PySide6's own version",
    "dynamixel-sdk": "versions before 4.0.5 leave stale input in the port",
    "opencv-python-headless": "the build without a Qt of its own that would clash with PySide6",
    "torch": "what the models were trained and tested with",
    "openvino": "what the eight-bit network was tested with",
}
"""Why these must not simply be another version; ``requirements.lock`` says it at length."""

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

OPENCV, REALSENSE = "OpenCV", "RealSense"
_BINARIES = (
    ("Qt's window plugin (xcb)", "PySide6_Essentials", "**/plugins/platforms/libqxcb.so"),
    (OPENCV, "opencv-python-headless", "cv2/cv2*.so"),
    (REALSENSE, "pyrealsense2", "pyrealsense2/pyrealsense2*.so"),
)
_LOAD = "import ctypes, sys\ntry: ctypes.CDLL(sys.argv[1])\nexcept OSError as error: sys.exit(str(error))\n"
_LOAD_WITHIN_S = 60.0


def read_pins(lock: Path) -> dict[str, str]:
    """Package -> version of what is needed to run, from a lock file. OSError when it cannot be read."""
    to_run = lock.read_text(encoding="utf-8").partition("# --- to test")[0]
    return dict(re.findall(r"^([A-Za-z0-9_.-]+)==(\S+)$", to_run, re.MULTILINE))


def check_python(version: tuple[int, ...] = sys.version_info[:3]) -> Check:
    """The only Python that the last RealSense package with the L515 has a build for."""
    found = ".".join(map(str, version))
    fix = "" if version[:2] == (3, 11) else "install Python 3.11, then: make PYTHON=python3.11 setup"
    return Check("python", not fix, f"{found}, {sys.executable}", fix)


def check_packages(lock: Path = LOCK, installed: Callable[[str], str] = metadata.version) -> Check:
    """Every package to run with against its pin; local parts of versions ("+cpu") do not count."""
    try:
        pins = read_pins(lock)
    except OSError as error:
        return Check("packages", False, f"{lock.name}: cannot be read ({error.strerror})", "restore requirements.lock")
    wrong = []
    for name, pin in pins.items():
        try:
            found = installed(name).partition("+")[0]
        except metadata.PackageNotFoundError:
            found = ""
        if found != pin and not (name in _REMOVED and not found):
            reason = PIN_REASONS.get(re.sub(r"[-_.]+", "-", name).lower(), "")
            wrong.append(f"{name} {found or 'missing'} instead of {pin}" + (f" ({reason})" if reason else ""))
    if wrong:
        return Check("packages", False, "; ".join(wrong), "rm -f .venv/.ready && make setup")
    return Check("packages", True, f"{len(pins) - len(_REMOVED & set(pins))} as pinned")


def _load(library: str) -> None:
    ctypes.CDLL(library)


def check_libraries(load: Callable[[str], None] = _load) -> Check:
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
        return Check("system libraries", False, f"missing: {', '.join(missing)}", fix)
    return Check("system libraries", True, f"{len(LIBRARIES)} can be loaded")


def load_elsewhere(path: Path) -> str:
    """Load a shared library in a process of its own, which a broken one may take down; returns what is wrong, or ""."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _LOAD, str(path)], capture_output=True, text=True, timeout=_LOAD_WITHIN_S, check=False
        )
    except subprocess.TimeoutExpired:
        return "does not load within a minute"
    if done.returncode < 0:
        return f"loading it ends with a fault ({signal.Signals(-done.returncode).name})"
    return "" if done.returncode == 0 else one_line(done.stderr or f"loading it ends with code {done.returncode}")


def load_problem(title: str) -> str:
    """Why OPENCV or REALSENSE cannot be loaded, "" when it can. Asked in a process of its own, in a tenth of a second."""
    path = dict(_binaries())[title]
    return load_elsewhere(path) if path is not None else "is not installed"


def _binaries() -> list[tuple[str, Path | None]]:
    found: list[tuple[str, Path | None]] = []
    for title, package, pattern in _BINARIES:
        try:
            files = metadata.distribution(package).files or []
        except metadata.PackageNotFoundError:
            files = []
        match = next((file for file in files if file.match(pattern)), None)
        found.append((title, Path(str(match.locate())) if match is not None else None))
    return found


def _is_packaged(library: str) -> bool:
    """Whether an installed Python package brings this file, so that no package of the system could."""
    return any(file.name == library for package in metadata.distributions() for file in package.files or [])


def check_binaries(
    binaries: Iterable[tuple[str, Path | None]] | None = None,
    load: Callable[[Path], str] = load_elsewhere,
    is_packaged: Callable[[str], bool] = _is_packaged,
) -> Check:
    """The vendors' own libraries with all that they need in turn, which no list can keep up with."""
    name = "vendor libraries"
    problems, fine = [], []
    packages: dict[str, None] = {}
    unknown, is_damaged = "", False
    for title, path in _binaries() if binaries is None else binaries:
        problem = load(path) if path is not None else "is not installed"
        if not problem:
            fine.append(title)
            continue
        problems.append(f"{title}: {problem}")
        needed = re.search(r"(lib[\w.+-]+?\.so[.\d]*): cannot open shared object", problem)
        if needed and (package := LIBRARIES.get(needed[1])):
            packages[package] = None
        elif needed and not is_packaged(needed[1]):
            unknown = unknown or needed[1]
        else:
            is_damaged = True
    if not problems:
        return Check(name, True, f"{', '.join(fine)} can be loaded")
    commands = [f"sudo apt-get install --yes --no-install-recommends {' '.join(packages)}"] if packages else []
    commands += [RENEW] if is_damaged else []
    fixes = [" && ".join(commands)] if commands else []
    fixes += [f"find and install the package of {unknown}: apt-file search {unknown}"] if unknown else []
    return Check(name, False, "; ".join(problems), "; ".join(fixes))


OF_THE_PROGRAM: tuple[Callable[[], Check], ...] = (check_python, check_packages, check_libraries, check_binaries)
"""Those that need nothing of what they look at: they can be made where nothing else can."""


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
        return Check(name, True, f"QT_QPA_PLATFORM={platform}: nothing is shown on a screen")
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
