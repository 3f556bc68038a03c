"""The checks before driving in a process of their own: ``python -m app.preflight_child``, for the window, not for people.

Reads the configuration as JSON from standard input; writes each check as one JSON object a line as soon as it is made.
"""

from __future__ import annotations

import json
import sys

from pydantic import ValidationError

from core.config import Config
from hardware.driving_checks import driving_checks


def main() -> int:
    """Returns 2 when the configuration cannot be read."""
    try:
        config = Config.model_validate_json(sys.stdin.read())
    except ValidationError as error:
        sys.stderr.write(f"error: the configuration cannot be read ({error.error_count()} errors)\n")
        return 2
    for check in driving_checks(config):
        sys.stdout.write(json.dumps(check.to_json()) + "\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
