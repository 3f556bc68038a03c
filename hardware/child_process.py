"""Processes of our own beside the application's: the servo bus and the twin."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]


def start_child(module: str, ends: Sequence[int], *arguments: str, talks: bool = False) -> subprocess.Popen[bytes]:
    """``python -m module``, whose first arguments are the file descriptors `ends`, which it inherits; raises OSError.

    In a session of its own: Ctrl-C and Ctrl-Z in the application's terminal do not reach it. One that `talks` has pipes for its
    standard input and output, others have none.
    """
    path = os.pathsep.join(filter(None, (str(_ROOT), os.environ.get("PYTHONPATH", ""))))
    quiet = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    stream = subprocess.PIPE if talks else subprocess.DEVNULL
    return subprocess.Popen(
        [sys.executable, "-P", "-m", module, *map(str, ends), *arguments],
        stdin=stream,
        stdout=stream,
        pass_fds=ends,
        start_new_session=True,
        env={**os.environ, **quiet, "PYTHONPATH": path},
    )
