"""LumenPilot as an installed package: app, core, hardware and resources lie in this folder, in a checkout beside it.

Importing it puts that folder on the path, so that processes that are not started by ``main.py`` (Dask workers) find them.
"""

import sys
from pathlib import Path

_HERE = Path(__file__).resolve().parent
ROOT = _HERE if (_HERE / "main.py").is_file() else _HERE.parent
"""The folder of ``main.py``."""
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))
