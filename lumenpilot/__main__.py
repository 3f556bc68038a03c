"""The command ``lumenpilot``, and ``python -m lumenpilot``."""

import os
import sys

from lumenpilot import ROOT


def main() -> None:
    """Run the command line."""
    os.environ.pop("PYTHONSAFEPATH", None)  # would hide the program from the processes that it starts
    sys.path.insert(0, str(ROOT))  # importing the package has only appended it: this process is the program's own
    from app.cli import main as run

    run()


if __name__ == "__main__":
    main()
