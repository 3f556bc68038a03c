"""LumenPilot as an installed package: app, core, hardware and resources lie in this folder, in a checkout beside it.

Importing it appends that folder to the path, so that processes that are not started by ``main.py`` (Dask workers, notebooks,
plugins) find them, and another package that is called app or core keeps its name; where such a one comes first, the names below
raise one clear ImportError. They are loaded when they are used, from ``lumenpilot.api``: importing the package alone loads nothing.
"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lumenpilot.api import Measured, Perceived, Perceiver, Session, open_session, read_annotations, run_trials, summarise

__all__ = ["Measured", "Perceived", "Perceiver", "Session", "open_session", "read_annotations", "run_trials", "summarise"]

_HERE = Path(__file__).resolve().parent
ROOT = _HERE if (_HERE / "main.py").is_file() else _HERE.parent
"""The folder of ``main.py``."""
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'lumenpilot' has no attribute {name!r}")
    from importlib import import_module
    from importlib.util import find_spec

    for ours in ("app", "core", "hardware"):
        found = find_spec(ours)
        origin = found.origin if found is not None else None
        if origin is None or not Path(origin).resolve().is_relative_to(ROOT):
            raise ImportError(f"another package called {ours} comes first ({origin}): use a process of its own for lumenpilot")
    return getattr(import_module("lumenpilot.api"), name)
