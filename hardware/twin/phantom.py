"""A vascular phantom: centerline graph with lumen radii, in millimetres on a board of 200 x 150 mm."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from core.types import VesselGraph
from hardware.twin.view import CameraView

BOARD_MM = (200.0, 150.0)
OWN = "bench:"
"""How the name of the phantom of a bench begins; the bench's folder follows."""

PHANTOM_TITLES = {
    "s_curve": "S-curve",
    "y_branch": "Y-branch",
    "tree": "Tree with five ends",
    "aortic_arch": "Aortic arch with supra-aortic vessels",
    "tortuous": "Tortuous vessel",
    "cerebral_siphon": "Carotid siphon",
    "parallel_channels": "Three parallel channels",
    "loop": "Loop of two ways",
    "coronary": "Coronary tree with stenosis",
}
"""Titles of the named phantoms. Apart from ``phantoms``, which takes a second to load."""


def own_file(name: str) -> Path | None:
    """The file of the phantom of a bench, which need not be there; None for another phantom's name."""
    if not name.startswith(OWN):
        return None
    from core.bench.bench import PHANTOM_FILE  # loads OpenCV

    return Path(name.removeprefix(OWN)) / PHANTOM_FILE


@dataclass(frozen=True, slots=True, eq=False)
class Phantom:
    """A phantom. ``graph`` is in mm with points every 0.5 mm or denser; the robot enters at node ``port`` (a leaf).

    ``view``: how the camera of the bench that it was made from sees it; None: as the look has it.
    """

    name: str
    title: str
    graph: VesselGraph
    port: int
    view: CameraView | None = None

    @property
    def targets(self) -> tuple[int, ...]:
        """Leaf nodes that the robot can be sent to (all leaves but the port)."""
        degree = [0] * len(self.graph.nodes)
        for edge in self.graph.edges:
            degree[edge.start] += 1
            degree[edge.end] += 1
        return tuple(node for node, count in enumerate(degree) if count == 1 and node != self.port)
