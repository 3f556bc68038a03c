"""Where the columns of a table stand, however their headings are spelt: Angle 1, ANGLE-1, angle_1 (deg) are one."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence

_UNIT = re.compile(r"[(\[][^)\]]*[)\]]|°")


def places(header: Sequence[str], needed: Sequence[str], may_be: Sequence[str]) -> dict[str, int]:
    """By column its place in the header, of `needed` all and of `may_be` those that there are.

    Raises ValueError with what is wrong, and what is expected.
    """
    known = {_plain(name): name for name in (*needed, *may_be)}
    found: dict[str, list[int]] = {}
    for place, heading in enumerate(header):
        plain = _plain(heading)
        name = known.get(plain) or known.get(re.sub(r"deg(rees?)?$", "", plain))
        if name is not None:
            found.setdefault(name, []).append(place)
    expected = f"needs the columns {', '.join(needed)} (blank where not measured)"
    for name, at in found.items():
        if len(at) > 1:
            spelt = "" if len({header[place] for place in at}) == 1 else f" ({', '.join(repr(header[place]) for place in at)})"
            raise ValueError(f"column {name!r} occurs {len(at)} times{spelt}; {expected}")
    for name in needed:
        if name not in found:
            others = [heading for place, heading in enumerate(header) if [place] not in found.values()]
            alike = difflib.get_close_matches(name, others, 1, cutoff=0.75)
            raise ValueError(f"column {name!r} is missing{f'; is {alike[0]!r} meant?' if alike else ''}; {expected}")
    return {name: at[0] for name, at in found.items()}


def _plain(heading: str) -> str:
    """Letters and digits alone, small, without a unit in brackets."""
    return re.sub(r"[\W_]+", "", _UNIT.sub("", heading.casefold()))
