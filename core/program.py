"""The program itself: where it lies, its version and commit, how its commands are called, and its optional packages.

It runs from a checkout or as an installed package. In both, ``app``, ``core``, ``hardware``, ``resources`` and ``main.py`` lie in
one folder, which is on ``sys.path``.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
import tomllib
from functools import cache
from importlib import metadata, util
from pathlib import Path

from core.devices import UserError

ROOT = Path(__file__).resolve().parents[1]
"""The folder of ``main.py``."""
COMMIT_FILE = ROOT / "commit"
"""The commit that a package or source archive was built from; written when it is built."""
_NAME = "lumenpilot"
_GIT_WITHIN_S = 5.0
"""Git answers in milliseconds; on a network drive it may hang."""


def is_installed() -> bool:
    """Whether this is the installed package: a checkout has its pyproject.toml beside ``main.py``."""
    return not (ROOT / "pyproject.toml").is_file()


CALLED = _NAME if is_installed() else "main.py"
"""How users call the program."""
COMMAND = _NAME if is_installed() else "python main.py"
"""The beginning of a command line that can be copied."""


def as_called(text: str) -> str:
    """A message, which names commands as a checkout has them (``main.py doctor``), with the name that this program has."""
    return text.replace("main.py", CALLED) if is_installed() else text


@cache
def program_version() -> str:
    """Version of this program; "0" where nothing says it."""
    try:
        if is_installed():
            return metadata.version(_NAME)
        return str(tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"])
    except (OSError, ValueError, KeyError, metadata.PackageNotFoundError):
        return "0"


@cache
def program_id() -> dict[str, str]:
    """``version`` and ``commit`` (where it is known) of the program that runs: they go into all that it keeps."""
    commit = program_commit()
    return {"version": program_version()} | ({"commit": commit} if commit else {})


def known_program_id() -> dict[str, str]:
    """``program_id`` without waiting for git: the version alone where nothing has asked for the commit before."""
    return program_id() if program_id.cache_info().currsize else {"version": program_version()}


def program_line() -> str:
    """Version and commit in one line, "0.2.0 (0123456789ab)"."""
    return " ".join([program_version(), *(f"({commit})" for commit in [program_id().get("commit")] if commit)])


def program_commit() -> str | None:
    """Commit of the source that runs, with "+" when files differ from it; None where that is not known."""
    try:
        if COMMIT_FILE.is_file():
            return COMMIT_FILE.read_text(encoding="ascii").strip() or None
        told = subprocess.run(
            ["git", "-C", str(ROOT), "describe", "--always", "--exclude=*", "--dirty=+", "--abbrev=12"],
            capture_output=True,
            text=True,
            timeout=_GIT_WITHIN_S,
            check=True,
        )
    except (OSError, ValueError, subprocess.SubprocessError):
        return None
    return told.stdout.strip() or None


EXTRAS = {
    "torch": "train",
    "skimage": "train",
    "onnx": "train",
    "distributed": "cluster",
    "dask": "cluster",
    "pyrealsense2": "realsense",
    "pypylon": "industrial",
    "foxglove": "foxglove",
    "mcap": "ros2",
    "mcap_ros2": "ros2",
    "pylsl": "lsl",
    "pyarrow": "lerobot",
    "gymnasium": "gym",
    "matplotlib": "figures",
}
"""Optional package -> the extra of pyproject.toml that brings it."""


def how_to_install(package: str) -> str:
    """The command that installs an optional package of ``EXTRAS``, for a shell."""
    extra = f"{_NAME}[{EXTRAS[package]}]"
    if not is_installed():
        return ".venv/bin/pip install pypylon" if package == "pypylon" else "make setup"
    if util.find_spec("pip") is not None:
        return f'{shlex.quote(sys.executable)} -m pip install "{extra}"'
    if (Path(sys.prefix) / "uv-receipt.toml").is_file():  # an environment of `uv tool`, without pip; it is made again as a whole
        return f'uv tool install --force "{extra}{_origin()}"'
    return f'uv pip install --python {shlex.quote(sys.executable)} "{extra}"'


def _origin() -> str:
    """ " @ URL" of the folder or repository that the package was installed from; "" when it came from an index."""
    try:
        told = json.loads(metadata.distribution(_NAME).read_text("direct_url.json") or "{}")
        system = told.get("vcs_info", {}).get("vcs")
        return f" @ {system + '+' if system else ''}{told['url']}"
    except (ValueError, KeyError, AttributeError, metadata.PackageNotFoundError):
        return ""


_OF_LINUX = frozenset({"fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"})
"""Modules of Python that Windows lacks."""
_NEEDS_LINUX = "this needs Linux, as all that drives does; annotate, evaluate, perceive, train, play and session run here, too"


def import_problem(error: ImportError) -> str | None:
    """The line for an import that fails because an optional package is not installed, or this is not Linux; None for all others."""
    package = (error.name or "").partition(".")[0]
    if isinstance(error, ModuleNotFoundError) and package in _OF_LINUX:
        return _NEEDS_LINUX
    if not isinstance(error, ModuleNotFoundError) or package not in EXTRAS:
        return None
    return f"this needs the package {package}, which is not installed: {how_to_install(package)}"


def missing(package: str) -> str | None:
    """The line that says so when an optional package is not installed; it is not imported."""
    return import_problem(ModuleNotFoundError(name=package)) if util.find_spec(package) is None else None


def need_package(package: str) -> None:
    """Raise UserError when an optional package is not installed; it is not imported."""
    if why := missing(package):
        raise UserError(why)
