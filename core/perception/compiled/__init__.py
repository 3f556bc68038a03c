"""Inner loops of the geometry, compiled to machine code when they are first imported, and kept for the next time."""

from core.perception.compiled import lines, maps, openings, pixels
from core.perception.compiled.jit import finish

__all__ = ["lines", "maps", "openings", "pixels"]

finish()
