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
from collections.abc import Iterator
from pathlib import Path

from platformdirs import user_cache_path

from core.whole_file import sweep_unfinished, write_whole

_MOST = 32
"""Some 3 MB each; a start of the window takes four. Those that were not used for longest go."""
_ENDING = ".network"
_DIGEST_BYTES = hashlib.sha256().digest_size


def name_of(*told: object) -> str:
    """What the network is kept under that was compiled from all that is `told`, on this machine."""
    return hashlib.sha256(repr((told, _machine())).encode()).hexdigest()[:32]


def read(name: str) -> bytes | None:
    """The compiled network; None when it is not there, or not as it was written."""
    with _folder() as folder:
        path = folder / (name + _ENDING)
        data = path.read_bytes()
        if hashlib.sha256(data[_DIGEST_BYTES:]).digest() == data[:_DIGEST_BYTES]:
            os.utime(path)
            return data[_DIGEST_BYTES:]
    return None


def keep(name: str, compiled: bytes) -> None:
    """Keep it for the next start. Where that cannot be written, the next start compiles again."""
    with _folder() as folder:
        folder.mkdir(parents=True, exist_ok=True)
        sweep_unfinished(folder)
        write_whole(folder / (name + _ENDING), hashlib.sha256(compiled).digest() + compiled)
        # A file that another process has just removed has no time any more, and ends this: the next one to be kept goes on.
        for path in sorted(folder.glob("*" + _ENDING), key=lambda path: path.stat().st_mtime)[:-_MOST]:
            path.unlink()


@contextlib.contextmanager
def _folder() -> Iterator[Path]:
    """Where they are, to do something there that may fail: a missing file, a full disk, a user without a home (RuntimeError)."""
    with contextlib.suppress(OSError, RuntimeError):
        yield user_cache_path("lumenpilot") / "networks"


@functools.cache
def _machine() -> str:
    """The processor with all that it can: a home may be shared with another one."""
    try:
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split("\n\n")[0].splitlines()
        return "\n".join(line for line in told if line.startswith(("model name", "flags", "Features")))
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
