"""Lazy access to the Numba kernels: Numba and the machine code are loaded by the first call, not by the import of this module.

Loading takes about a second, and some 15 s where no machine code is cached. Many commands perceive nothing and never load it.
Code that must not wait later calls ``load`` first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from core.perception.kernels import *  # noqa: F403


def load() -> None:
    """Load all kernels; compile them where no machine code is cached."""
    from core.perception import kernels

    globals().update({name: value for name, value in vars(kernels).items() if hasattr(value, "nopython_signatures")})


def __getattr__(name: str) -> Any:
    """Called for names that are not loaded yet (PEP 562)."""
    if name.startswith("__"):
        raise AttributeError(name)
    load()
    if name not in globals():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return globals()[name]
