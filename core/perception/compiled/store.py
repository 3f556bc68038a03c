"""Where the machine code of the compiled loops is kept: whole, of just this version, or not at all.

Numba keeps what it compiles by itself, but it takes what it has kept for as long as the one file of a function is the same (one
that calls functions of another file would not notice when these change), and it believes every byte of it: a damaged one ends the
program. So a version's code has a folder of its own, which is written aside, sealed with the digests of its files, and only then
given its name. One whose seal does not fit is compiled anew.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numba
from llvmlite import binding
from platformdirs import user_cache_path

_SEAL = "seal.json"
_PREFIX = "compiled-"
_FORGOTTEN_S = 7 * 86_400.0
"""What no start has used for so long goes: the code of other versions, and of starts that were cut off."""


@dataclass(frozen=True, slots=True)
class Store:
    """``folder``: where Numba reads and writes; ``name``: what it is called once it is sealed, None where it is already."""

    folder: Path
    name: Path | None

    def seal(self) -> None:
        """All is compiled: from now on it may be used. Where that cannot be written, the next start compiles again."""
        if self.name is None:
            return
        try:
            (self.folder / _SEAL).write_text(json.dumps(_digests(self.folder)), encoding="utf-8")
            self.folder.rename(self.name)
        except OSError:  # the disk is full, or another start was sooner
            self.discard()

    def discard(self) -> None:
        """Something could not be written: what there is of it is of no use."""
        if self.name is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


def open_store(sources: Path) -> Store | None:
    """The store for the loops in a folder of sources: beside them, or in the user's cache; None where neither is to be had."""
    name = _PREFIX + _version(sources)
    beside = sources / "__pycache__"
    store = _open(beside / name)
    if store is not None:
        return store
    try:
        mine = user_cache_path("lumenpilot") / name
    except RuntimeError:  # a user without a home
        return None
    # What an administrator's set-up has compiled is only read here, and Numba wants to write where it reads.
    return _open(mine, like=beside / name)


def _open(folder: Path, like: Path | None = None) -> Store | None:
    """The sealed store of this name, else one to be filled, or a copy of another one; None where nothing can be written."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        if not os.access(folder.parent, os.W_OK) or (folder.exists() and not os.access(folder, os.W_OK)):
            return None
        _forget_old(folder)
        if is_whole(folder):
            os.utime(folder)
            return Store(folder, None)
        shutil.rmtree(folder, ignore_errors=True)
        aside = Path(tempfile.mkdtemp(prefix=f"{folder.name}.", dir=folder.parent))
        aside.chmod(0o755)
        if like is not None and is_whole(like):
            shutil.copytree(like, aside, dirs_exist_ok=True)
            aside.rename(folder)
            return Store(folder, None)
    except OSError:
        return None
    return Store(aside, folder)


def is_whole(folder: Path) -> bool:
    """Whether all files that were sealed are there as they were, and no others."""
    try:
        sealed = json.loads((folder / _SEAL).read_text(encoding="utf-8"))
        return bool(sealed == _digests(folder))
    except (OSError, ValueError):
        return False


def _digests(folder: Path) -> dict[str, str]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and path.name != _SEAL)
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def _version(sources: Path) -> str:
    """Of all that Numba's code depends on, and of all that it looks at before it takes it: also the place and the files' times."""
    told = hashlib.sha256(f"{numba.__version__} {sys.version} {binding.get_host_cpu_name()} {sources}".encode())
    for file in sorted(sources.glob("*.py")):
        told.update(f"{file.name} {file.stat().st_mtime_ns}".encode() + file.read_bytes())
    return told.hexdigest()[:16]


def _forget_old(folder: Path) -> None:
    for other in folder.parent.glob(f"{_PREFIX}*"):
        if other != folder and time.time() - other.stat().st_mtime > _FORGOTTEN_S:
            shutil.rmtree(other, ignore_errors=True)
