"""How the geometry's inner loops become machine code, and where that is kept.

NumPy would do them in hundreds of small calls a frame. What stands in this package is plain arithmetic on arrays, and belongs to
the module that calls it: there stand its meaning, its units and its reasons.

Types are declared, so that nothing is compiled in the middle of a stream: an array of another kind is a TypeError. Indices are
checked. The interpreter's lock is let go, so that the window stays quick meanwhile.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from pickle import UnpicklingError
from typing import Any, TypeVar, cast

import numba
from numba import boolean, float32, float64, int64, types
from platformdirs import user_cache_path

njit: Any = numba.njit  # its types do not know of lists of types
config: Any = numba.config
_DAMAGE = (AttributeError, EOFError, ImportError, LookupError, OSError, RuntimeError, TypeError, UnpicklingError, ValueError)
"""What reading machine code ends in that a full disk or a power cut has damaged."""
_Function = TypeVar("_Function", bound=Callable[..., Any])
_HERE = Path(__file__).parent


def _array(kind: Any, dimensions: int) -> Any:
    """An argument: an array of any strides, writable or not."""
    return types.Array(kind, dimensions, "A", readonly=True)


POINTS, VALUES, STARTS = _array(float64, 2), _array(float64, 1), _array(int64, 1)
MAP, MASK = _array(float32, 2), _array(boolean, 2)


def compiled(*kinds: tuple[Any, ...]) -> Callable[[_Function], _Function]:
    """Compile a function for each of these kinds of arguments, or take what was compiled before."""

    def compile_now(function: _Function) -> _Function:
        options = {"nogil": True, "error_model": "numpy", "boundscheck": True}
        try:
            kernel = njit(list(kinds), cache=_IS_KEPT, **options)(function)
        except _DAMAGE:
            shutil.rmtree(config.CACHE_DIR, ignore_errors=True)
            kernel = njit(list(kinds), **options)(function)
        return cast(_Function, kernel)

    return compile_now


def _keep_in(folder: Path) -> bool:
    """Have Numba keep what it compiles in a folder of this version's own; False where that cannot be written.

    By itself Numba takes what it has kept for as long as the one file of a function is the same: one that calls functions of
    another file would not notice when these change.
    """
    told = hashlib.sha256(numba.__version__.encode())
    for file in sorted(_HERE.glob("*.py")):
        told.update(file.read_bytes())
    own = folder / f"compiled-{told.hexdigest()[:16]}"
    try:
        own.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    if not os.access(own, os.W_OK):
        return False
    for older in folder.glob("compiled-*"):
        if older != own:
            shutil.rmtree(older, ignore_errors=True)
    config.CACHE_DIR = str(own)
    return True


_IS_KEPT = _keep_in(_HERE / "__pycache__") or _keep_in(user_cache_path("lumenpilot"))
