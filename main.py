"""LumenPilot: hands over to the command line."""

from __future__ import annotations

import os
import sys

if __name__ == "__main__":
    if sys.flags.safe_path:  # PYTHONSAFEPATH leaves this folder out, here and in every process that is started
        os.environ.pop("PYTHONSAFEPATH", None)
        sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
    from app.cli import main

    main()
