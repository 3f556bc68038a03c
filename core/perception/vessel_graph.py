"""The vessel's skeleton as a graph of smooth, sub-pixel centerlines with the lumen's radius along them (METHOD section 2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from core.config import CleaningConfig
from core.perception import pixel_graph, polyline
from core.types import GraphEdge, Mask, Points, VesselGraph


def build_graph(skeleton: Mask, radius_map: NDArray[np.float32], config: CleaningConfig) -> VesselGraph:
    """First version."""
    graph = pixel_graph.trace(skeleton)
    edges = []
    for chain in graph.chains:
        points = smooth(chain.points, 4.0)
        edges.append(GraphEdge(chain.start, chain.end, points, sample(radius_map, points)))
    return VesselGraph(graph.nodes, tuple(edges))


def smooth(points: Points, sigma_px: float) -> Points:
    even = polyline.resample(points, 1.0)
    if len(even) < 3:
        return even
    pad = min(len(even) - 1, int(3 * sigma_px) + 1)
    head = 2 * even[0] - even[pad:0:-1]
    tail = 2 * even[-1] - even[-2 : -pad - 2 : -1]
    return np.asarray(gaussian_filter1d(np.concatenate([head, even, tail]), sigma_px, axis=0)[pad : pad + len(even)])


def sample(radius_map: NDArray[np.float32], points: Points) -> NDArray[np.float64]:
    column = np.clip(np.rint(points[:, 0]).astype(int), 0, radius_map.shape[1] - 1)
    row = np.clip(np.rint(points[:, 1]).astype(int), 0, radius_map.shape[0] - 1)
    return radius_map[row, column].astype(np.float64)
