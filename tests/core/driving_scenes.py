"""Drawn vessels, and scenes of a straight robot in them, for what drives by them."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from core.config.models import Config
from core.perception.centerline import centerline_at, plan_route
from core.perception.pose import measure_pose
from core.perception.vectors import fit_robot_vector, fit_vessel_vector
from core.types import GraphEdge, Point, Points, RobotPath, RobotStatus, Scene, VesselGraph


def edge(start: int, end: int, points: Points) -> GraphEdge:
    return GraphEdge(start, end, points, np.full(len(points), 15.0))


def line(a: Point, b: Point) -> Points:
    return np.linspace(a, b, 101)


STRAIGHT = VesselGraph(np.array([(0.0, 100.0), (400.0, 100.0)]), (edge(0, 1, line((0, 100), (400, 100))),))


_ARC = np.array([(200 + 60 * math.sin(t), 160 - 60 * math.cos(t)) for t in np.linspace(0, math.pi / 2, 60)])


BEND = VesselGraph(
    np.array([(0.0, 100.0), (260.0, 300.0)]),
    (edge(0, 1, np.vstack([line((0, 100), (199, 100)), _ARC, line((260, 161), (260, 300))])),),
)


FORK = VesselGraph(
    np.array([(0.0, 100.0), (200.0, 100.0), (400.0, 100.0), (300.0, 200.0)]),
    (
        edge(0, 1, line((0, 100), (200, 100))),
        edge(1, 2, line((200, 100), (400, 100))),
        edge(1, 3, line((200, 100), (300, 200))),
    ),
)


def scene_at(
    graph: VesselGraph, head: Point, target: Point | None, heading_deg: float = 0.0, time_s: float = 0.0, length_px: float = 60.0
) -> Scene:
    """A straight robot that points along `heading_deg` (0: right, 90: down)."""
    return replace(_scene(graph, head, target, heading_deg, length_px), captured_s=time_s)


@cache
def _scene(graph: VesselGraph, head: Point, target: Point | None, heading_deg: float, length_px: float) -> Scene:
    way = np.array([math.cos(math.radians(heading_deg)), math.sin(math.radians(heading_deg))])
    points = np.asarray(head) - np.arange(length_px, -1.0, -2.0)[:, None] * way
    robot = fit_robot_vector(points, 40.0)
    route = plan_route(graph, head, target) if target is not None else None
    centerline = centerline_at(graph, head, robot.direction, 20.0, route)
    vessel = fit_vessel_vector(centerline)
    pose = measure_pose(robot, vessel, Config().perception.pose)
    path = RobotPath(points, 1.0, None, True, 0.0, 3.5)
    return Scene(
        0, 0.0, (640, 480), 1.0, path=path, vessel_graph=graph, route=route, centerline=centerline,
        robot_vector=robot, vessel_vector=vessel, pose=pose,
    )  # fmt: skip


def status(contact_n: float | None, insertion_mm: float = 50.0) -> RobotStatus:
    return RobotStatus(0.0, insertion_mm, 0.0, (0, 0, 0, 0), (0, 0, 0, 0), contact_n)
