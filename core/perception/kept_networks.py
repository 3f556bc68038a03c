"""Networks as OpenVINO has compiled them for this machine, in the user's cache: compiling takes eight times as long as reading.

OpenVINO can keep them by itself, but it believes every byte of what it has kept: a weight in which a bit has turned would go past
the digests of the model's manifest. So each file begins with the digest of the rest, and one that does not fit is not there.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import platform
from pathlib import Path

from platformdirs import user_cache_path

from core.whole_file import sweep_unfinished, write_whole

_MOST = 32
"""Some 3 MB each; a start of the window takes five. Those that were not used for longest go."""
_ENDING = ".network"
_DIGEST_BYTES = hashlib.sha256().digest_size


def name_of(*told: object) -> str:
    """What the network is kept under that was compiled from all that is `told`, on this machine."""
    return hashlib.sha256(repr((told, _machine())).encode()).hexdigest()[:32]


def read(name: str) -> bytes | None:
    """The compiled network; None when it is not there, or not as it was written."""
    try:
        path = _folder() / (name + _ENDING)
        data = path.read_bytes()
    except (OSError, RuntimeError):
        return None
    if hashlib.sha256(data[_DIGEST_BYTES:]).digest() != data[:_DIGEST_BYTES]:
        return None
    with contextlib.suppress(OSError):  # one that may only be read is as good
        os.utime(path)
    return data[_DIGEST_BYTES:]


def keep(name: str, compiled: bytes) -> None:
    """Keep it for the next start. Where that cannot be written, the next start compiles again."""
    with contextlib.suppress(OSError, RuntimeError):
        path = _folder() / (name + _ENDING)
        path.parent.mkdir(parents=True, exist_ok=True)
        sweep_unfinished(path.parent)
        write_whole(path, hashlib.sha256(compiled).digest() + compiled)
        others = (other for other in path.parent.glob("*" + _ENDING) if other != path)
        # A file that another process has just removed has no time any more, and ends this: the next one to be kept goes on.
        for old in sorted(others, key=lambda other: other.stat().st_mtime)[: 1 - _MOST]:
            old.unlink()


def _folder() -> Path:
    """Where they are; RuntimeError for a user without a home."""
    return user_cache_path("lumenpilot") / "networks"


@functools.cache
def _machine() -> str:
    """The processor with all that it can: a home may be shared with another one."""
    try:
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split("\n\n")[0].splitlines()
        return "\n".join(line for line in told if line.startswith(("model name", "flags", "Features")))
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
