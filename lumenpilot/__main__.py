"""The command ``lumenpilot``, and ``python -m lumenpilot``; importing the package has put the program's folder on the path."""

import os


def main() -> None:
    """Run the command line."""
    os.environ.pop("PYTHONSAFEPATH", None)  # would hide the program from the processes that it starts
    from app.cli import main as run

    run()


if __name__ == "__main__":
    main()
