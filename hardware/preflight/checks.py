"""One line of the preflight.

The computer: cores and memory, disk for recordings, clock.

What the program stands on: Python, packages as pinned, system libraries, a display.

The network: its files are whole, and on a picture whose truth is known it sees what is there.
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from core.config.models import PerceptionConfig, RecordConfig, SegmentationConfig, TwinConfig, sessions_folder
from core.perception.model_file import ModelError, ModelInfo, check_all_files, model_folder, read_model_info, second_look_of
from core.types import Image, Mask, Scene

if TYPE_CHECKING:
    from hardware.twin.truth import Truth


@dataclass(frozen=True, slots=True)
class Check:
    """What was looked at, whether it is as it should be, what was found, and what to do about it ("" when nothing)."""

    name: str
    ok: bool
    detail: str
    fix: str = ""

    def to_json(self) -> dict[str, str | bool]:
        """The keys of ``doctor --json``."""
        return asdict(self)


NOT_CONFIGURED = "not configured"
RENEW = "make clean && make setup"
"""Mends damaged and missing files of installed packages. `make setup` alone leaves them: pip looks at versions, not at files."""


def one_line(text: object, limit: int = 300) -> str:
    """A message on one line, not longer than a table bears."""
    line = " ".join(str(text).split())
    return line if len(line) <= limit else line[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"


_CORES = 2
_MEMORY_GB, _FREE_GB = 3.5, 1.0
_RATE_TOLERANCE = 0.02
_WATCHED_S = 0.05
_BUILT_IN_YEAR = 2025


def memory_gb() -> tuple[float, float]:
    """Memory in all, and what programs can still have, in GB."""
    import psutil

    memory = psutil.virtual_memory()
    return memory.total / 1e9, memory.available / 1e9


def check_machine(cores: int | None = None, memory: Callable[[], tuple[float, float]] = memory_gb) -> Check:
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
        return Check(name, False, detail, f"close other programs: {_FREE_GB:g} GB must be free, and {_MEMORY_GB:g} GB there in all")
    return Check(name, True, detail)


def check_disk(config: RecordConfig, usage: Callable[[Path], tuple[int, int, int]] = shutil.disk_usage) -> Check:
    """Where sessions go: writable, and room for them."""
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
    detail = f"{folder}: {free / 1e9:.1f} GB free of {total / 1e9:.1f} GB"
    if free < config.warn_free_mb * 1e6 or (total and free / total < config.warn_free_share):
        wanted = max(config.warn_free_mb / 1e3, config.warn_free_share * total / 1e9)
        return Check(name, False, detail, f"make room ({wanted:.1f} GB or more), or set record.folder to another disk")
    return Check(name, True, detail)


def check_clock(
    monotonic: Callable[[], float] = time.monotonic,
    reference: Callable[[], float] = time.perf_counter,
    wall: Callable[[], float] = time.time,
    watched_s: float = _WATCHED_S,
) -> Check:
    """The clock that all ages and time limits hang on runs, never backwards and at the right rate; the date can be true."""
    name, advice = "clock", "restart the computer; in a virtual machine check its clock source"
    # Each reading between two of the other clock: a process can stand still in between, and no clock is at fault then.
    began_after, began, began_before = reference(), monotonic(), reference()
    before = now = began
    while reference() - began_before < watched_s:
        now = monotonic()
        if now < before:
            return Check(name, False, f"the monotonic clock went back by {1e6 * (before - now):.0f} us", advice)
        before = now
    ended_after, ended, ended_before = reference(), monotonic(), reference()
    at_least, at_most = (ended - began) / (ended_before - began_after), (ended - began) / (ended_after - began_before)
    if at_most < 1.0 - _RATE_TOLERANCE or at_least > 1.0 + _RATE_TOLERANCE:
        rate = at_most if at_most < 1.0 else at_least
        return Check(name, False, f"the monotonic clock runs at {rate:.3f} of the real rate", advice)
    date = time.gmtime(wall())
    detail = f"monotonic, now {time.strftime('%Y-%m-%d %H:%M', date)} UTC"
    if date.tm_year < _BUILT_IN_YEAR:
        return Check(name, False, f"{detail}: the date is wrong, and sessions are named by it", "sudo timedatectl set-ntp true")
    return Check(name, True, detail)


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


SHIPPED = "default"
GOLDEN = TwinConfig(phantom="s_curve", appearance_seed=0, image_width_px=640, image_height_px=480)
"""Rendered, never filmed: the same phantom, look, noise and robot on every computer, and the truth with it."""
_GOLDEN_MM = 70.0
_THETA_DEG, _HEAD_PX = 8.0, 8.0
_OVERLAP = 0.5
_BRIGHTER = 1.5
"""Sums are large in a bright picture. Twice as bright the walls of the golden one are gone: there networks that differ by nothing
but rounding are 0.014 apart, and sums that overflow 0.025."""
_EIGHT_BIT_OFF, _EIGHT_BIT_NEAR_OFF = 0.01, 0.05
"""Mean difference of probability between eight-bit and exact network, in a whole picture (0.001 where all is well, 0.073 where sums
overflowed) and in a window around the robot's end, much of which is uncertain (0.004 where all is well)."""
_RESTORE = "git checkout -- resources/models   (or unpack the program again)"


def check_model(name: str) -> Check:
    """The hashes of all files of a model."""
    try:
        folder = model_folder(name)
        info, files = read_model_info(folder, verify=()), check_all_files(folder)
        if (near := second_look_of(folder)) is not None:
            files += [f"{near.name}/{file}" for file in check_all_files(near)]
    except ModelError as error:
        return Check("model", False, one_line(error), _advice(name))
    return Check("model", True, f"{info.name}: all {len(files)} files are whole (SHA-256)")


def check_self_test(config: PerceptionConfig) -> Check:
    """Perceive the golden picture and compare with its truth.

    The shipped model must find state, theta and head. A model of the user's own, which may never have seen such a phantom, must not
    take the vessel for the robot. Of both, the eight-bit copy must answer on this processor as the exact network does.
    """
    name = "self-test"
    try:
        from core.perception.pipeline import open_pipeline
        from hardware.twin.world import TwinWorld

        info = read_model_info(model_folder(config.segmentation.model), verify=())
        plain = PerceptionConfig(segmentation=config.segmentation)
        pipeline = open_pipeline(plain)
        world = TwinWorld(GOLDEN, perception=plain, seed=0)
        world.insert(_GOLDEN_MM)
        frame, truth = world.frame(), world.truth()
        masks = world.picture(world.physics.robot_points_mm())
        scene = pipeline.perceive_single(frame)
        off = _eight_bit_off(config.segmentation, frame.image)
    except ModelError as error:
        return Check(name, False, f"not run: {one_line(error)}", _advice(config.segmentation.model))
    except (ImportError, RuntimeError, ValueError, OSError) as error:
        return Check(name, False, f"{type(error).__name__}: {one_line(error)}", RENEW)
    if off is not None:
        detail = f"{info.name}: on this processor the eight-bit network is off by {off}"
        return Check(name, False, detail, "set perception.segmentation.precision to fp32, or train the model on with this version")
    return judge(name, info, pipeline.engine, scene, truth, (masks.vessel, masks.robot))


def _eight_bit_off(config: SegmentationConfig, image: Image) -> str | None:
    """How far an eight-bit network is off where its sums are large, in a brighter picture; None: no more than it may."""
    from core.perception.inference import OpenVinoSegmenter, open_second_look, open_segmenter
    from core.perception.segmentation import see, window_around
    from core.perception.tip_refinement import WINDOW_PX, planes_of

    used, used_near = open_segmenter(config), open_second_look(config)
    if not isinstance(used, OpenVinoSegmenter) or not used.is_eight_bit:
        return None
    exact = config.model_copy(update={"device": "openvino", "precision": "fp32"})
    bright = np.asarray(cv2.convertScaleAbs(image, alpha=_BRIGHTER), np.uint8)
    seen = open_segmenter(exact)(bright)
    # Three are seen as two at once, as single pictures are, and one by itself, as in a stream.
    found = [(_apart(one, seen), _EIGHT_BIT_OFF) for one in see(used, [bright] * 3)]
    near = open_second_look(exact)
    if used_near is not None and near is not None:
        row, column = np.unravel_index(int(np.argmax(seen[1])), seen[1].shape)
        x, y, width, height = window_around((float(column), float(row)), (image.shape[1], image.shape[0]), WINDOW_PX)
        part = np.s_[y : y + height, x : x + width]
        planes = planes_of(bright[part], seen[0][part], seen[1][part])
        exactly = near(planes)
        found += [(_apart(one, exactly), _EIGHT_BIT_NEAR_OFF) for one in see(used_near, [planes] * 3)]
    return next((f"{off:.3f} (at most {allowed:g})" for off, allowed in found if off > allowed), None)


def _apart(some: Sequence[NDArray[np.float32]], others: Sequence[NDArray[np.float32]]) -> float:
    """The largest of the mean differences."""
    return max(float(np.abs(one - other).mean()) for one, other in zip(some, others, strict=True))


def judge(name: str, info: ModelInfo, engine: str, scene: Scene, truth: Truth, true_masks: tuple[Mask, Mask]) -> Check:
    """What was seen against what is there; `true_masks` are vessel and robot."""
    milliseconds = f"first frame in {scene.latency_ms.get('total', 0.0):.0f} ms"
    advice = _advice(info.name) if info.name == SHIPPED else "train it with the twin's frames too, or choose another model"
    if scene.masks is not None:
        seen = (scene.masks.vessel, scene.masks.robot)
        overlaps = [[_overlap(mask, there) for there in true_masks] for mask in seen]
        if overlaps[0][1] > overlaps[0][0] or overlaps[1][0] > overlaps[1][1]:
            return Check(name, False, f"{info.name} takes the vessel for the robot: its outputs are swapped", advice)
        if info.name != SHIPPED:
            found = f"vessel {overlaps[0][0]:.2f}, robot {overlaps[1][1]:.2f} overlap on the golden picture"
            return Check(name, True, f"{engine}, {milliseconds}; a model of your own: {found}")
        if min(overlaps[0][0], overlaps[1][1]) < _OVERLAP:
            detail = f"{info.name} finds only {overlaps[0][0]:.0%} of the vessel and {overlaps[1][1]:.0%} of the robot"
            return Check(name, False, detail, advice)
    if scene.pose is None or scene.path is None or truth.pose is None or truth.head_xy is None:
        return Check(name, False, f"{info.name} gives no pose on the golden picture: {scene.refusal}", advice)
    theta_off = abs(scene.pose.theta_signed_deg - truth.pose.theta_signed_deg)
    head_off = float(np.hypot(*np.subtract(scene.path.head, truth.head_xy)))
    detail = (
        f"{engine}, {milliseconds}: state {scene.pose.state.value} (true {truth.pose.state.value}), "
        f"theta off by {theta_off:.1f} deg, head by {head_off:.1f} px"
    )
    good = scene.pose.state is truth.pose.state and theta_off <= _THETA_DEG and head_off <= _HEAD_PX
    return Check(name, good, detail, "" if good else advice)


def _overlap(mask: Mask, there: Mask) -> float:
    """Dice coefficient."""
    total = int(mask.sum()) + int(there.sum())
    return 2.0 * int((mask & there).sum()) / total if total else 0.0


def _advice(model: str) -> str:
    return _RESTORE if model == SHIPPED else "restore the model folder, or set perception.segmentation.model to another one"
