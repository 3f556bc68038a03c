"""The compiled loops for all who call them: they are loaded, all together, when the first of them is called for.

On a slow processor that takes more than a second, most of it Numba's, and many a command perceives nothing. Who may not wait in the
middle of something calls ``load`` before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from core.perception.compiled import lines, maps, openings, pixels


__all__ = ["lines", "load", "maps", "openings", "pixels"]


def load() -> None:
    """Load the loops, or compile them where no machine code of them is kept (some 15 s)."""
    from core.perception.compiled import all_loops

    globals().update({name: getattr(all_loops, name) for name in all_loops.__all__})


def __getattr__(name: str) -> Any:
    """Called for what is not there yet (PEP 562), so that a loop that is loaded costs nothing more."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    load()
    return globals()[name]
