"""Which edges of the vessel graph a head may belong to: those near it within its own lumen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.perception import polyline
from core.perception.lumen import foot, is_walled_off
from core.types import Mask, Point, VesselGraph

REACH_RADII = 1.5
"""Vessels farther from the head than this many of their radii are not looked at."""


@dataclass(frozen=True, slots=True)
class Foot:
    """The place on an edge nearest to the head within its lumen: its distance, its arc-length position, the radius there."""

    distance: float
    edge: int
    position: float
    radius: float


def feet_of(graph: VesselGraph, head: Point, half_length: float, vessel: Mask | None) -> list[Foot]:
    """The edges that the head may belong to, in the graph's order.

    Parameters
    ----------
    graph, head : in the graph's unit; in pixels where there is a mask.
    half_length : of the piece of centerline that is wanted; a radius below a quarter of it counts as that.
    vessel : mask (h, w), or None: then nobody can tell what lies beyond a wall. What does is left aside, unless everything does.
    """
    plain = []
    for index, edge in enumerate(graph.edges):
        if len(edge.points) >= 2:
            along = polyline.arc_length(edge.points)
            distance, position, place = polyline.nearest(edge.points, head, along)
            radius = float(np.interp(position, along, edge.radius))
            plain.append((Foot(distance, index, position, max(radius, 0.25 * half_length)), place, distance <= radius))
    plain.sort(key=lambda one: (one[0].distance, one[0].edge))
    found: list[Foot] = []
    for near, place, is_inside in plain:
        if found and not _is_in_reach(near, found):
            continue
        if vessel is None or is_inside or not is_walled_off(head, place, vessel):
            found.append(near)
        elif (within := foot(graph.edges[near.edge].points, head, vessel)) is not None:
            edge = graph.edges[near.edge]
            radius = float(np.interp(within[1], polyline.arc_length(edge.points), edge.radius))
            found.append(Foot(within[0], near.edge, within[1], max(radius, 0.25 * half_length)))
    found = found or [near for near, *_ in plain]
    return sorted((one for one in found if _is_in_reach(one, found)), key=lambda one: one.edge)


def _is_in_reach(one: Foot, found: list[Foot]) -> bool:
    first = min(found, key=lambda near: (near.distance, near.edge))
    return one.distance <= max(first.distance + 0.25 * first.radius, REACH_RADII * one.radius)
