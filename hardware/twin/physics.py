"""The bench twin's mechanics: a tendon-driven chain fed through a port into the walls of a phantom. Lock-step and deterministic."""

from __future__ import annotations

import math
import threading

import mujoco
import numpy as np
from scipy.spatial import cKDTree

from core.types import Command, Point, Points, RobotStatus
from hardware.twin.chain import Chain
from hardware.twin.lumen_field import lumen_discs
from hardware.twin.mjcf import (
    FEED_KP_MN_MM,
    FEED_KV,
    LINK_MM,
    ROBOT_RADIUS_MM,
    SHAFT_LINK_MM,
    STEERABLE_LINKS,
    TIMESTEP_S,
    Specimen,
)
from hardware.twin.phantom import Phantom
from hardware.twin.phantom_check import node_distances_mm
from hardware.twin.tendon_drive import DriveProperties, TendonDrive
from hardware.twin.walls import lumen_outline, wall_boxes

STEERABLE_MM = STEERABLE_LINKS * LINK_MM
OUTSIDE_MM = 30.0
"""How much of the straight robot behind the port ``robot_points_mm`` shows."""
_SPARE_MM = 24.0
_CHAIN_STEP_LINKS = 20
_SWAP_MM, _SWAP_BACK_MM = 8.0, 20.0
_CONTACT_LOWPASS_S = 0.1
_POINTS_PER_LINK = 4


class TwinPhysics:
    """The robot in its phantom.

    Parameters
    ----------
    phantom : where it moves.
    seed : which robot (see ``Specimen``); 0 is the nominal one.
    drive : the actuator layer of both tendon pairs.

    Notes
    -----
    The same seed and the same commands give bit-equal states. All methods may be called from any thread.
    """

    def __init__(self, phantom: Phantom, seed: int = 0, drive: DriveProperties | None = None) -> None:
        self.phantom = phantom
        self.specimen = Specimen.drawn(seed)
        outlines = lumen_outline(phantom.graph)
        walls, self._port = wall_boxes(phantom, outlines)
        ways = node_distances_mm(phantom)[phantom.port, list(phantom.targets)]
        self._shaft_links = math.ceil((float(ways.max()) + _SPARE_MM - STEERABLE_MM) / SHAFT_LINK_MM)
        self.chain_mm = self._shaft_links * SHAFT_LINK_MM + STEERABLE_MM
        self._walls = walls
        self._discs = lumen_discs(phantom.graph)
        self._centers = cKDTree(self._discs[0])
        self._outline = cKDTree(np.concatenate(outlines))
        self._lock = threading.RLock()
        self._bend, self._pitch = TendonDrive(drive or DriveProperties()), TendonDrive(drive or DriveProperties())
        self._chains: dict[int, Chain] = {}
        self.reset()

    def reset(self) -> None:
        """Back to the start: the tip at the port, tendons slack, time 0."""
        with self._lock:
            self._chain = self._chain_of(0)
            self._chain.reset()
            self._bend.reset()
            self._pitch.reset()
            self._feed_mm = 0.0
            self._delivery_mm = 0.0
            self._contact_mn = 0.0
            self._due_s = 0.0

    def _chain_of(self, size: int) -> Chain:
        """The chain with `size` + 1 times twenty shaft links, at most what the phantom's longest way needs.

        What lies far outside the port cannot matter, and the cost of a step grows faster than the number of links.
        """
        shaft_links = min(self._shaft_links, (size + 1) * _CHAIN_STEP_LINKS)
        if size not in self._chains:
            self._chains[size] = Chain(self._walls, self._port, shaft_links, self.specimen)
        self._size = size
        return self._chains[size]

    def _fit_chain(self) -> None:
        """Swap to a longer or shorter chain when the insertion asks for it."""
        insertion_mm, now = self._chain.insertion_mm, self._chain
        chosen = now
        if now.length_mm < self.chain_mm and insertion_mm > now.length_mm - _SWAP_MM:
            chosen = self._chain_of(self._size + 1)
        elif self._size > 0 and insertion_mm < self._size * _CHAIN_STEP_LINKS * SHAFT_LINK_MM + STEERABLE_MM - _SWAP_BACK_MM:
            chosen = self._chain_of(self._size - 1)
        if chosen is not now:
            chosen.take_over(now)
            self._chain = chosen  # last, so that nobody reads a chain that is not in its place yet

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return float(self._chain.data.time)

    @property
    def insertion_mm(self) -> float:
        """Length of robot beyond the port."""
        return max(0.0, min(self.chain_mm, self._chain.insertion_mm))

    @property
    def delivery_mm(self) -> float:
        """Length of catheter sheath beyond the port."""
        return self._delivery_mm

    def step(self, command: Command, duration_s: float) -> None:
        """Let `duration_s` of simulated time pass under `command`; remainders of the 2 ms time step carry over to the next call."""
        with self._lock:
            self._due_s += duration_s
            while self._due_s >= TIMESTEP_S / 2:
                self._due_s -= TIMESTEP_S
                self._fit_chain()
                self._actuate(command)
                self._chain.step()
                self._contact_mn += (self._chain.wall_force_mn() - self._contact_mn) * TIMESTEP_S / _CONTACT_LOWPASS_S

    def _actuate(self, command: Command) -> None:
        chain = self._chain
        control, slack = chain.data.ctrl, chain.slack_mm
        bend = self._bend.step(command.bend, TIMESTEP_S)
        pitch = self._pitch.step(command.pitch, TIMESTEP_S)
        # The antagonist pays out as much as the other takes in: held still it would halve the bend.
        control[0], control[1] = slack[0] - bend, slack[1] + bend
        control[2], control[3] = slack[2] - pitch, slack[3] + pitch
        control[4] = self._feed(command.advance_mm_s)
        reach_mm = max(0.0, chain.insertion_mm - STEERABLE_MM)
        self._delivery_mm = max(0.0, min(reach_mm, self._delivery_mm + command.delivery_mm_s * TIMESTEP_S))
        chain.shape(self._delivery_mm)

    def _feed(self, advance_mm_s: float) -> float:
        """The feed's next goal. A stalled drive slips: its goal stays within reach of its greatest force.

        The limit acts on the goal, because a saturated force inside the solver is explicit and swings from step to step.
        """
        insertion_mm, speed_mm_s = self._chain.insertion_mm, float(self._chain.data.qvel[0])
        slip_mm, lag_s = self.specimen.feed_force_mn / FEED_KP_MN_MM, FEED_KV / FEED_KP_MN_MM
        moved = self._feed_mm + advance_mm_s * TIMESTEP_S
        moved = max(insertion_mm - slip_mm, min(insertion_mm + slip_mm, moved))
        self._feed_mm = max(0.0, min(self.chain_mm, moved))
        # Velocity feed-forward cancels the drive's lag; none at the ends of the travel.
        goal = self._feed_mm + (lag_s * advance_mm_s if self._feed_mm == moved else 0.0)
        coasting = insertion_mm + lag_s * speed_mm_s
        return max(coasting - slip_mm, min(coasting + slip_mm, goal))

    def robot_points_mm(self) -> Points:
        """The robot's centerline on the board (N, 2) in mm, tail -> head.

        It starts ``OUTSIDE_MM`` behind the port, where the robot is straight, and ends where the last link's axis does: the round
        nose reaches one robot radius beyond it (``head_mm``).
        """
        with self._lock:
            corners = self._chain.corners_mm(OUTSIDE_MM)
        outside = -float((corners[0] - self._port.point) @ self._port.inward)
        lead_in = np.arange(OUTSIDE_MM, outside + SHAFT_LINK_MM / 2, -SHAFT_LINK_MM)
        if len(lead_in):
            corners = np.vstack([self._port.point - lead_in[:, None] * self._port.inward, corners])
        return _smooth(corners)

    @property
    def head_mm(self) -> Point:
        """The true tip on the board: the foremost point of the round nose."""
        before, end = self.robot_points_mm()[-2:]
        x, y = end + ROBOT_RADIUS_MM * (end - before) / np.linalg.norm(end - before)
        return float(x), float(y)

    def status(self) -> RobotStatus:
        """What the robot reports, on simulated time."""
        with self._lock:
            data = self._chain.data
            pull, force = self._chain.slack_mm - data.ten_length, -data.actuator_force[:4]
            return RobotStatus(
                time_s=self.time_s,
                insertion_mm=self.insertion_mm,
                delivery_mm=self._delivery_mm,
                tendon_pull_mm=(float(pull[0]), float(pull[1]), float(pull[2]), float(pull[3])),
                tendon_force_mn=(float(force[0]), float(force[1]), float(force[2]), float(force[3])),
                wall_contact_n=self._contact_mn / 1000.0,
            )

    def contacts(self) -> list[tuple[Point, float]]:
        """Present contacts with the walls: place on the board (mm) and normal force (mN)."""
        found, force = [], np.zeros(6)
        with self._lock:
            model, data = self._chain.model, self._chain.data
            for index in range(data.ncon):
                mujoco.mj_contactForce(model, data, index, force)
                x, y = data.contact[index].pos[:2]
                if force[0] > 0.0:
                    found.append(((float(x), float(y)), float(force[0])))
        return found

    def clearance_mm(self) -> float:
        """Least distance between the robot's surface and the lumen's wall, from the phantom's graph; negative: pressed into it."""
        points = self.robot_points_mm()
        inside = points[(points - self._port.point) @ self._port.inward > 0.0]
        if len(inside) == 0:
            return self._port.radius - ROBOT_RADIUS_MM
        away, _ = self._outline.query(inside)
        gap, disc = self._centers.query(inside)
        centers, radii = self._discs
        doubtful = np.flatnonzero(gap >= radii[disc])
        for index in doubtful:
            within = np.any(np.linalg.norm(centers - inside[index], axis=1) < radii)
            away[index] *= 1.0 if within else -1.0
        return float(away.min()) - ROBOT_RADIUS_MM


def _smooth(corners: Points) -> Points:
    """A Catmull-Rom curve through the link ends, several points per link."""
    padded = np.vstack([2 * corners[0] - corners[1], corners, 2 * corners[-1] - corners[-2]])
    before, start, end, after = padded[:-3], padded[1:-2], padded[2:-1], padded[3:]
    t = np.arange(_POINTS_PER_LINK)[None, :, None] / _POINTS_PER_LINK
    start_slope, end_slope = (end - before)[:, None] / 2, (after - start)[:, None] / 2
    start, end = start[:, None], end[:, None]
    rise = 3 * t**2 - 2 * t**3
    curve = (1 - rise) * start + rise * end + (t**3 - 2 * t**2 + t) * start_slope + (t**3 - t**2) * end_slope
    return np.vstack([curve.reshape(-1, 2), corners[-1]])
