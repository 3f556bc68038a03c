"""The robot's body in the solver: one MuJoCo model of a given length, and what guide, sheath and port do to its links."""

from __future__ import annotations

import logging

import mujoco
import numpy as np

from core.types import Points
from hardware.twin.mjcf import Specimen, build_model, link_lengths_mm
from hardware.twin.walls import Port, Wall

_log = logging.getLogger(__name__)
_FATAL = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
_GUIDE_EI = 1e8
_GUIDE_DAMPING_S = 0.004
_GUIDE_MM = 3.0
_SHEATH_EI = 6e4


def _on_warning(message: str) -> None:
    _log.warning("MuJoCo: %s", message)


# Without a callback MuJoCo writes its warnings to a file in the working directory.
mujoco.set_mju_user_warning(_on_warning)


class Chain:
    """A chain of links with the port at slide position 0 of its tip.

    Attributes
    ----------
    model, data : MuJoCo's.
    length_mm : of all links.
    slack_mm : tendon lengths (4,) of the straight robot.
    """

    def __init__(self, walls: list[Wall], port: Port, shaft_links: int, specimen: Specimen) -> None:
        self.model = build_model(walls, port, shaft_links, specimen)
        self.data = mujoco.MjData(self.model)
        lengths = link_lengths_mm(shaft_links)
        self.length_mm = float(lengths.sum())
        self._specimen = specimen
        self._starts_mm = np.concatenate([[0.0], np.cumsum(lengths)[:-1]]) - self.length_mm
        self._bodies = np.arange(self.model.nbody - len(lengths), self.model.nbody)
        self._geoms = self.model.body_geomadr[self._bodies].copy()
        self._tip_length_mm = float(lengths[-1])
        # Joint 0 is the feed; joints and degrees of freedom have the same numbers in a chain of hinges.
        link = np.searchsorted(self._bodies, self.model.jnt_bodyid[1:])
        self._joint_link, self._joint_length = link, lengths[link]
        ei = np.where(link >= shaft_links, specimen.tip_ei, specimen.shaft_ei)
        self._own_stiffness = ei / self._joint_length
        self._set_rad = self.model.qpos_spring[1:].copy()
        self._shaped_for: tuple[float, float] | None = None
        self.shape(0.0)
        mujoco.mj_forward(self.model, self.data)
        self.slack_mm = self.data.ten_length.copy()

    @property
    def insertion_mm(self) -> float:
        return float(self.data.qpos[0])

    def reset(self) -> None:
        """Straight, at rest, tip at the port, time 0."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.ctrl[:4] = self.slack_mm
        self.shape(0.0)
        mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        """One time step.

        Raises
        ------
        FloatingPointError
            When the state is no longer finite. It was never seen; MuJoCo would silently start again from the straight robot.
        """
        mujoco.mj_step(self.model, self.data)
        if any(self.data.warning[kind].number for kind in _FATAL):
            raise FloatingPointError(f"the twin's physics diverged at {self.data.time:.3f} s")

    def take_over(self, other: Chain) -> None:
        """Carry on from the state of a shorter or longer chain: the distal joints are copied, further ones are straight."""
        self.reset()
        joints = min(self.model.nv, other.model.nv) - 1
        self.data.time = other.data.time
        for mine, theirs in (
            (self.data.qpos, other.data.qpos),
            (self.data.qvel, other.data.qvel),
            (self.data.qacc_warmstart, other.data.qacc_warmstart),
        ):
            mine[0] = theirs[0]
            mine[-joints:] = theirs[-joints:]
        self.data.ctrl[:] = other.data.ctrl

    def shape(self, delivery_mm: float) -> None:
        """Stiffen what the guide behind the port and the sheath cover; links touch walls only once they are inside.

        Joints outside are held straight by stiffness, so the robot cannot buckle there and comes back clean.
        """
        insertion_mm = self.insertion_mm
        key = round(insertion_mm, 1), round(delivery_mm, 1)
        if key == self._shaped_for:
            return
        self._shaped_for = key
        starts = insertion_mm + self._starts_mm
        inside = (starts >= 0.0).astype(np.int32)
        self.model.geom_contype[self._geoms] = inside
        self.model.geom_conaffinity[self._geoms] = 2 * inside
        at = starts[self._joint_link]
        guided = np.clip((_GUIDE_MM - at) / _GUIDE_MM, 0.0, 1.0) ** 3
        covered = np.clip((delivery_mm - at) / self._joint_length, 0.0, 1.0)
        own = self._own_stiffness + covered * _SHEATH_EI / self._joint_length
        held = guided * _GUIDE_EI / self._joint_length
        self.model.jnt_stiffness[1:] = own + held
        self.model.dof_damping[1:] = own * self._specimen.damping_s + held * _GUIDE_DAMPING_S
        # Guide and sheath are straight, so they pull against the robot's own set.
        self.model.qpos_spring[1:] = self._set_rad * self._own_stiffness / (own + held)

    def corners_mm(self, outside_mm: float) -> Points:
        """The axis on the board (N, 2): link starts from at most `outside_mm` behind the port on, then the last link's end."""
        joints = self.data.xpos[self._bodies][:, :2]
        direction = self.data.xmat[self._bodies[-1]].reshape(3, 3)[:2, 0]
        first = max(0, int(np.searchsorted(self._starts_mm + self.insertion_mm, -outside_mm)) - 1)
        return np.vstack([joints[first:], joints[-1] + direction * self._tip_length_mm])

    def wall_force_mn(self) -> float:
        """Sum of the normal forces of all contacts."""
        count = self.data.ncon
        if count == 0:
            return 0.0
        rows = self.data.contact.efc_address[:count]
        return float(self.data.efc_force[rows[rows >= 0]].sum())
