"""How the geometry's inner loops become machine code.

NumPy would do them in hundreds of small calls a frame. What stands in this package is plain arithmetic on arrays, and belongs to
the module that calls it: there stand its meaning, its units and its reasons.

Types are declared, so that nothing is compiled in the middle of a stream: an array of another kind is a TypeError (of another byte
order it is misread). Indices are checked. The interpreter's lock is let go, so that the window stays quick meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba import boolean, float32, float64, int64, types

from core.perception.compiled.store import open_store

njit: Any = numba.njit  # its types do not know of lists of types
_Function = TypeVar("_Function", bound=Callable[..., Any])


def _array(kind: Any, dimensions: int) -> Any:
    """An argument: an array of any strides, writable or not."""
    return types.Array(kind, dimensions, "A", readonly=True)


POINTS, VALUES, STARTS = _array(float64, 2), _array(float64, 1), _array(int64, 1)
MAP, MASK = _array(float32, 2), _array(boolean, 2)


class _Compiler:
    """Takes machine code from the store, or fills it."""

    def __init__(self, sources: Path) -> None:
        self._store = open_store(sources)
        if self._store is not None:
            numba.config.CACHE_DIR = str(self._store.folder)  # type: ignore[attr-defined]

    def compile(self, function: Any, kinds: list[tuple[Any, ...]]) -> Any:
        options = {"nogil": True, "error_model": "numpy", "boundscheck": True}
        if self._store is not None:
            try:
                return njit(kinds, cache=True, **options)(function)
            except OSError:  # the disk is full
                self._store.discard()
                self._store = None
        return njit(kinds, **options)(function)

    def finish(self) -> None:
        if self._store is not None:
            self._store.seal()

    @property
    def folder(self) -> Path | None:
        return None if self._store is None else self._store.name or self._store.folder


_compiler = _Compiler(Path(__file__).resolve().parent)


def compiled(*kinds: tuple[Any, ...]) -> Callable[[_Function], _Function]:
    """Compile a function for each of these kinds of arguments, or take what was compiled before."""

    def compile_now(function: _Function) -> _Function:
        return cast(_Function, _compiler.compile(function, list(kinds)))

    return compile_now


def finish() -> None:
    """All functions are compiled: keep that for the next start."""
    _compiler.finish()


def folder() -> Path | None:
    """Where the machine code is kept; None where it cannot be."""
    return _compiler.folder
