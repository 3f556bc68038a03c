"""The bench twin's mechanics: a tendon-driven chain fed through a port into the walls of a phantom. Lock-step and deterministic."""

from __future__ import annotations

import math
import threading

import mujoco
import numpy as np
from scipy.spatial import cKDTree

from core.types import Command, Point, Points, RobotStatus
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
    build_model,
    link_lengths_mm,
)
from hardware.twin.phantom import Phantom
from hardware.twin.phantom_check import node_distances_mm
from hardware.twin.tendon_drive import DriveProperties, TendonDrive
from hardware.twin.walls import lumen_outline, wall_boxes

STEERABLE_MM = STEERABLE_LINKS * LINK_MM
OUTSIDE_MM = 30.0
"""How much of the straight robot behind the port ``robot_points_mm`` shows."""
_SPARE_MM = 24.0
_GUIDE_EI = 1e6
_GUIDE_DAMPING_S = 0.05
_GUIDE_MM = 3.0
_SHEATH_EI = 6e4
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
        walls, self._port = wall_boxes(phantom)
        ways = node_distances_mm(phantom)[phantom.port, list(phantom.targets)]
        shaft_links = math.ceil((float(ways.max()) + _SPARE_MM - STEERABLE_MM) / SHAFT_LINK_MM)
        self._lengths = link_lengths_mm(shaft_links)
        self.chain_mm = float(self._lengths.sum())
        self._model = build_model(walls, self._port, shaft_links, self.specimen)
        self._data = mujoco.MjData(self._model)
        self._discs = lumen_discs(phantom.graph)
        self._centers = cKDTree(self._discs[0])
        self._outline = cKDTree(np.concatenate(lumen_outline(phantom.graph)))
        self._lock = threading.RLock()
        self._bend, self._pitch = TendonDrive(drive or DriveProperties()), TendonDrive(drive or DriveProperties())
        self._index_model()
        self.reset()

    def _index_model(self) -> None:
        """Which entries of MuJoCo's arrays belong to which link."""
        model, links = self._model, len(self._lengths)
        self._bodies = np.flatnonzero(np.arange(model.nbody) >= model.nbody - links)
        self._geoms = np.array([model.body_geomadr[body] for body in self._bodies])
        joints = np.arange(1, model.njnt)
        self._joints, self._dofs = joints, model.jnt_dofadr[joints].copy()
        self._joint_link = np.searchsorted(self._bodies, model.jnt_bodyid[joints])
        self._starts_mm = np.concatenate([[0.0], np.cumsum(self._lengths)[:-1]]) - self.chain_mm
        self._joint_length = self._lengths[self._joint_link]
        self._own_stiffness = model.jnt_stiffness[joints].copy().reshape(len(joints), -1)[:, 0]

    def reset(self) -> None:
        """Back to the start: the tip at the port, tendons slack, time 0."""
        with self._lock:
            mujoco.mj_resetData(self._model, self._data)
            self._bend.reset()
            self._pitch.reset()
            self._feed_mm = 0.0
            self._delivery_mm = 0.0
            self._contact_mn = 0.0
            self._due_s = 0.0
            self._shaped_for: tuple[float, float] | None = None
            self._shape_chain()
            mujoco.mj_forward(self._model, self._data)
            self._slack_mm = self._data.ten_length.copy()
            self._data.ctrl[:4] = self._slack_mm

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return float(self._data.time)

    @property
    def insertion_mm(self) -> float:
        """Length of robot beyond the port."""
        return float(np.clip(self._data.qpos[0], 0.0, self.chain_mm))

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
                self._actuate(command)
                mujoco.mj_step(self._model, self._data)
                force = self._data.efc_force[self._data.efc_type == mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL].sum()
                self._contact_mn += (float(force) - self._contact_mn) * TIMESTEP_S / _CONTACT_LOWPASS_S

    def _actuate(self, command: Command) -> None:
        control = self._data.ctrl
        bend = self._bend.step(command.bend, TIMESTEP_S)
        pitch = self._pitch.step(command.pitch, TIMESTEP_S)
        # The antagonist pays out as much as the other takes in: held still it would halve the bend.
        control[0], control[1] = self._slack_mm[0] - bend, self._slack_mm[1] + bend
        control[2], control[3] = self._slack_mm[2] - pitch, self._slack_mm[3] + pitch
        control[4] = self._feed(command.advance_mm_s)
        insertion_mm = float(self._data.qpos[0])
        reach_mm = max(0.0, insertion_mm - STEERABLE_MM)
        self._delivery_mm = max(0.0, min(reach_mm, self._delivery_mm + command.delivery_mm_s * TIMESTEP_S))
        self._shape_chain()

    def _feed(self, advance_mm_s: float) -> float:
        """The feed's next goal. A stalled drive slips: its goal stays within reach of its greatest force.

        The limit acts on the goal, because a saturated force inside the solver is explicit and swings from step to step.
        """
        insertion_mm, speed_mm_s = float(self._data.qpos[0]), float(self._data.qvel[0])
        slip_mm, lag_s = self.specimen.feed_force_mn / FEED_KP_MN_MM, FEED_KV / FEED_KP_MN_MM
        moved = self._feed_mm + advance_mm_s * TIMESTEP_S
        moved = max(insertion_mm - slip_mm, min(insertion_mm + slip_mm, moved))
        self._feed_mm = max(0.0, min(self.chain_mm, moved))
        # Velocity feed-forward cancels the drive's lag; none at the ends of the travel.
        goal = self._feed_mm + (lag_s * advance_mm_s if self._feed_mm == moved else 0.0)
        coasting = insertion_mm + lag_s * speed_mm_s
        return max(coasting - slip_mm, min(coasting + slip_mm, goal))

    def _shape_chain(self) -> None:
        """Stiffen what the guide behind the port and the sheath cover; links touch walls only once they are inside.

        Joints outside are held straight by stiffness, so the robot cannot buckle there and comes back clean.
        """
        insertion_mm = float(self._data.qpos[0])
        key = round(insertion_mm, 1), round(self._delivery_mm, 1)
        if key == self._shaped_for:
            return
        self._shaped_for = key
        starts = insertion_mm + self._starts_mm
        inside = (starts >= 0.0).astype(np.int32)
        self._model.geom_contype[self._geoms] = inside
        self._model.geom_conaffinity[self._geoms] = 2 * inside
        at = starts[self._joint_link]
        guided = np.clip((_GUIDE_MM - at) / _GUIDE_MM, 0.0, 1.0) ** 3
        covered = np.clip((self._delivery_mm - at) / self._joint_length, 0.0, 1.0)
        own = self._own_stiffness + covered * _SHEATH_EI / self._joint_length
        held = guided * _GUIDE_EI / self._joint_length
        stiffness = own + held
        damping = own * self.specimen.damping_s + held * _GUIDE_DAMPING_S
        self._model.jnt_stiffness[self._joints] = stiffness
        self._model.dof_damping[self._dofs] = damping

    def robot_points_mm(self) -> Points:
        """The robot's centerline on the board (N, 2) in mm, tail -> head.

        It starts up to ``OUTSIDE_MM`` behind the port, where the robot is straight, and ends in the true tip: the foremost point of the
        round nose, one robot radius beyond the end of the last link's axis.
        """
        with self._lock:
            joints = self._data.xpos[self._bodies][:, :2]
            last = self._data.xmat[self._bodies[-1]].reshape(3, 3)[:2, 0]
            insertion_mm = self.insertion_mm
        first = max(0, int(np.searchsorted(self._starts_mm + insertion_mm, -OUTSIDE_MM)) - 1)
        nose = joints[-1] + last * LINK_MM, joints[-1] + last * (LINK_MM + ROBOT_RADIUS_MM)
        return _smooth(np.vstack([joints[first:], *nose]))

    @property
    def head_mm(self) -> Point:
        """The true tip on the board."""
        x, y = self.robot_points_mm()[-1]
        return float(x), float(y)

    def status(self) -> RobotStatus:
        """What the robot reports, on simulated time."""
        with self._lock:
            pull = self._slack_mm - self._data.ten_length
            force = -self._data.actuator_force[:4]
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
            for index in range(self._data.ncon):
                mujoco.mj_contactForce(self._model, self._data, index, force)
                x, y = self._data.contact[index].pos[:2]
                if force[0] > 0.0:
                    found.append(((float(x), float(y)), float(force[0])))
        return found

    def clearance_mm(self) -> float:
        """Least distance between the robot's surface and the lumen's wall, from the phantom's graph; negative: pressed into it."""
        points = self.robot_points_mm()[:-_POINTS_PER_LINK]  # without the nose, which is no part of the axis
        inside = points[(points - self._port.point) @ self._port.inward > 0.0]
        if len(inside) == 0:
            return self._port.radius - ROBOT_RADIUS_MM
        away, _ = self._outline.query(inside)
        gap, disc = self._centers.query(inside, k=4)
        within = (gap < self._discs[1][disc]).any(axis=1)
        return float(np.where(within, away, -away).min()) - ROBOT_RADIUS_MM


def _smooth(corners: Points) -> Points:
    """A Catmull-Rom curve through the link ends, several points per link."""
    padded = np.vstack([2 * corners[0] - corners[1], corners, 2 * corners[-1] - corners[-2]])
    before, start, end, after = padded[:-3], padded[1:-2], padded[2:-1], padded[3:]
    t = np.arange(_POINTS_PER_LINK)[None, :, None] / _POINTS_PER_LINK
    start_slope, end_slope = (end - before)[:, None] / 2, (after - start)[:, None] / 2
    start, end = start[:, None], end[:, None]
    curve = (
        (2 * t**3 - 3 * t**2 + 1) * start + (t**3 - 2 * t**2 + t) * start_slope + (3 * t**2 - 2 * t**3) * end + (t**3 - t**2) * end_slope
    )
    return np.vstack([curve.reshape(-1, 2), corners[-1]])
