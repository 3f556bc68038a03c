"""A vascular phantom: centerline graph with lumen radii, in millimetres on a board of 200 x 150 mm."""

from __future__ import annotations

from dataclasses import dataclass

from core.types import VesselGraph

BOARD_MM = (200.0, 150.0)

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


@dataclass(frozen=True, slots=True, eq=False)
class Phantom:
    """A phantom. ``graph`` is in mm with points every 0.5 mm or denser; the robot enters at node ``port`` (a leaf)."""

    name: str
    title: str
    graph: VesselGraph
    port: int

    @property
    def targets(self) -> tuple[int, ...]:
        """Leaf nodes that the robot can be sent to (all leaves but the port)."""
        degree = [0] * len(self.graph.nodes)
        for edge in self.graph.edges:
            degree[edge.start] += 1
            degree[edge.end] += 1
        return tuple(node for node, count in enumerate(degree) if count == 1 and node != self.port)
