"""One line of the preflight."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True, slots=True)
class Check:
    """What was looked at, whether it is as it should be, what was found, and what to do about it ("" when nothing)."""

    name: str
    ok: bool
    detail: str
    fix: str = ""

    def to_json(self) -> dict[str, str | bool]:
        """The keys of ``doctor --json``."""
        return asdict(self)


NOT_CONFIGURED = "not configured"
RENEW = "make clean && make setup"
"""Mends damaged and missing files of installed packages. `make setup` alone leaves them: pip looks at versions, not at files."""


def one_line(text: object, limit: int = 300) -> str:
    """A message on one line, not longer than a table bears."""
    line = " ".join(str(text).split())
    return line if len(line) <= limit else line[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"
