"""All compiled loops: whoever needs some of them imports these from here, and so they are all compiled, and kept, together."""

from __future__ import annotations

from core.perception.compiled import lines, maps, openings, pixels
from core.perception.compiled.jit import finish

__all__ = ["lines", "maps", "openings", "pixels"]

finish()
