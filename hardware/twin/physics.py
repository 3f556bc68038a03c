"""The twin's mechanics in MuJoCo: a tendon-driven chain fed through a port into the lumen of a phantom. Deterministic.

Units mm, kg, s, so forces are millinewtons; board plane z = 0, x right, y down, z away from the camera. Parameters were chosen by
stability and bending and are not calibrated to a real rig. Walls are thin boxes outside the outline of the lumen. Drives have slew
limit, backlash and dead zone (tendon friction in the solver gave no hysteresis). Sparse Jacobian and elliptic cones are fastest: a
step with 25 contacts on 127 degrees of freedom took 1.4 ms, with pyramidal cones 1.8 ms, with a dense Jacobian too 5.8 ms.
"""

from __future__ import annotations

import itertools
import logging
import math
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from core import geometry
from core.config.calibration import BehaviourConfig
from core.control.joints import unit_vector
from core.types import Command, Point, Points, RobotStatus, VesselGraph
from hardware.twin.phantom import Phantom
from hardware.twin.phantoms import node_distances_mm
from hardware.twin.view import lumen_discs

_THICKNESSES_MM = (1.0, 0.6, 0.35, 0.2)
_GRID_MM = 0.25
_TOLERANCE_MM = 0.1
_MAX_PIECE_MM = 6.0


@dataclass(frozen=True, slots=True)
class Wall:
    """A box: centre, half length along ``angle_rad``, half thickness across; its inner face lies on the lumen's outline."""

    x: float
    y: float
    half_length: float
    half_thickness: float
    angle_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class Port:
    """Where the robot enters: a point and the unit direction into the lumen."""

    point: NDArray[np.float64]
    inward: NDArray[np.float64]
    radius: float

    @property
    def angle_rad(self) -> float:
        return float(np.arctan2(self.inward[1], self.inward[0]))


def port_of(phantom: Phantom) -> Port:
    """The phantom's port, with the direction of the first 2 mm of centerline."""
    for edge in phantom.graph.edges:
        if phantom.port in (edge.start, edge.end):
            points, radius = (edge.points, edge.radius) if edge.start == phantom.port else (edge.points[::-1], edge.radius[::-1])
            step = points[5] - points[0]
            return Port(points[0], step / np.linalg.norm(step), float(radius[0]))
    raise ValueError(f"phantom {phantom.name}: node {phantom.port} has no edge, so it cannot be the port")


def lumen_outline(graph: VesselGraph) -> list[Points]:
    """Closed outlines (N, 2) of the union of discs along the centerlines, to about 0.02 mm."""
    centers, radii = lumen_discs(graph)
    low = np.floor((centers - radii[:, None]).min(axis=0)) - 2.0
    high = np.ceil((centers + radii[:, None]).max(axis=0)) + 2.0
    columns, rows = ((high - low) / _GRID_MM).astype(int)
    x, y = low[0] + _GRID_MM * np.arange(columns), low[1] + _GRID_MM * np.arange(rows)
    depth = np.full((rows, columns), -1.0)
    for (cx, cy), radius in zip(centers, radii, strict=True):
        # A disc changes only a window around it; 1 mm outside is enough to interpolate the zero line.
        reach = radius + 1.0
        i = slice(int((cy - reach - low[1]) / _GRID_MM), int((cy + reach - low[1]) / _GRID_MM) + 2)
        j = slice(int((cx - reach - low[0]) / _GRID_MM), int((cx + reach - low[0]) / _GRID_MM) + 2)
        np.maximum(depth[i, j], radius - np.hypot(y[i, None] - cy, x[None, j] - cx), out=depth[i, j])
    return [low + _GRID_MM * outline for outline in geometry.outlines(depth, 0.0)]


def wall_boxes(phantom: Phantom, outlines: list[Points]) -> tuple[list[Wall], Port]:
    """The walls of a phantom along its ``lumen_outline``, open at its port."""
    port, discs = port_of(phantom), lumen_discs(phantom.graph)
    walls = []
    for outline in outlines:
        corners = geometry.thinned(outline, _TOLERANCE_MM)
        for start, end in itertools.pairwise(corners):
            length = float(np.linalg.norm(end - start))
            if length < 1e-6:
                continue
            along = (end - start) / length
            # The lumen lies on the right of all outlines as seen on screen (x right, y down), islands too.
            outward = np.array([along[1], -along[0]])
            count = int(np.ceil(length / _MAX_PIECE_MM))
            for piece in range(count):
                ends = start + np.outer((piece, piece + 1), along) * length / count
                middle = ends.mean(axis=0)
                if not _in_port_opening(middle, port):
                    thickness = _thickness(ends, outward, discs)
                    x, y = middle + outward * thickness / 2
                    angle = float(np.arctan2(along[1], along[0]))
                    walls.append(Wall(float(x), float(y), length / count / 2, thickness / 2, angle))
    return walls, port


def _thickness(ends: Points, outward: NDArray[np.float64], discs: tuple[Points, NDArray[np.float64]]) -> float:
    """The largest thickness that does not reach into the lumen behind, as at the sharp divider of two branches."""
    centers, radii = discs
    for thickness in _THICKNESSES_MM[:-1]:
        outer = ends + outward * thickness
        depth = radii - np.linalg.norm(outer[:, None] - centers, axis=2)
        if depth.max() < 0.1:
            return thickness
    return _THICKNESSES_MM[-1]


def _in_port_opening(point: NDArray[np.float64], port: Port) -> bool:
    """The rounded cap of the lumen behind the port, through which the robot comes."""
    offset = point - port.point
    return float(offset @ port.inward) < 0.0 and float(np.linalg.norm(offset)) < 1.2 * port.radius + 1.0


ROBOT_RADIUS_MM = 1.25
LINK_MM = 2.0
"""Length of the steerable links; the bend per pull was measured with ten of them."""
SHAFT_LINK_MM = 3.0
"""Shaft links are longer, which halves the cost of a step; at the tightest bends (8 mm) the axis is off by 0.14 mm."""
STEERABLE_LINKS = 10
DEFAULT_TENDONS_DEG = (0.0, 180.0, 90.0, 270.0)
"""Directions of the default robot's tendons around the shaft: 0 to its right on the screen, 90 towards the camera."""
TIMESTEP_S = 0.002
LUMEN_HALF_HEIGHT_MM = 6.0
TENDON_OFFSET_MM = 1.0
OUTSIDE_MM = 30.0
"""Length of the straight robot behind the port in ``TwinPhysics.robot_points_mm``."""
DRAWN_OUT_MM = OUTSIDE_MM + 2.0
"""The tip can be drawn back so far behind the port: then no part of the robot is in the picture."""
FEED_KP_MN_MM, FEED_KV = 2000.0, 200.0
_MASS_KG_MM = 3e-5
_TENDON_KP_MN_MM, _TENDON_KV, _TENDON_MAX_MN = 2000.0, 40.0, 4000.0


@dataclass(frozen=True, slots=True)
class Specimen:
    """Mechanical properties of one robot.

    ``shaft_ei`` and ``tip_ei`` are bending stiffnesses (mN mm2), ``damping_s`` is damping over stiffness, ``tip_set_deg`` the bend
    that the steerable part keeps with slack tendons (positive: right), ``friction`` that against the wall.
    """

    shaft_ei: float = 2e4
    tip_ei: float = 8e3
    damping_s: float = 0.04
    friction: float = 0.1
    tip_set_deg: float = 0.0
    feed_force_mn: float = 600.0

    @property
    def bend_deg_per_mm(self) -> float:
        """Bend of the free head by pull: its own stiffness and the spring of its tendons share the pull."""
        own = self.tip_ei / (STEERABLE_LINKS * LINK_MM * _TENDON_KP_MN_MM * TENDON_OFFSET_MM**2)
        return math.degrees(1.0 / TENDON_OFFSET_MM) / (1.0 + own)

    @staticmethod
    def drawn(seed: int) -> Specimen:
        """The nominal robot for seed 0, else a random one."""
        if seed == 0:
            return Specimen()
        rng = np.random.default_rng([seed, 40427])
        return Specimen(
            shaft_ei=rng.uniform(1.8e4, 3.5e4),
            tip_ei=8e3 * rng.uniform(0.9, 1.15),
            friction=rng.uniform(0.06, 0.15),
            tip_set_deg=float(np.clip(rng.normal(0.0, 2.0), -5.0, 5.0)),
        )


def link_lengths_mm(shaft_links: int) -> NDArray[np.float64]:
    """Lengths of all links of a chain, tail -> head."""
    return np.array([SHAFT_LINK_MM] * shaft_links + [LINK_MM] * STEERABLE_LINKS)


def build_model(
    walls: list[Wall], port: Port, shaft_links: int, specimen: Specimen, tendons_deg: Sequence[float] = DEFAULT_TENDONS_DEG
) -> mujoco.MjModel:
    """Compile the model: a chain of capsules on a slide along the port's axis, with its tip at the port for slide position 0.

    Joint order: slide, then one planar hinge per link, followed by the pitch hinge where the link is steerable. Actuator order:
    the tendons, the feed.
    """
    x, y = port.point
    wall_geoms = "".join(
        f'<geom class="wall" type="box" size="{wall.half_length + 0.01:.5f} {wall.half_thickness:.5f} {LUMEN_HALF_HEIGHT_MM + 1}" '
        f'pos="{wall.x:.5f} {wall.y:.5f} 0" euler="0 0 {wall.angle_rad:.6f}"/>'
        for wall in walls
    )
    lengths = link_lengths_mm(shaft_links)
    sites = range(shaft_links - 1, len(lengths))
    names = [f"tendon{place}_" for place in range(len(tendons_deg))]
    tendons = "".join(
        f'<spatial name="{name}">' + "".join(f'<site site="{name}{link}"/>' for link in sites) + "</spatial>" for name in names
    )
    pulls = "".join(
        f'<position name="{name}" tendon="{name}" kp="{_TENDON_KP_MN_MM}" kv="{_TENDON_KV}" forcerange="-{_TENDON_MAX_MN} 0"/>'
        for name in names
    )
    return mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{TIMESTEP_S}" gravity="0 0 0" integrator="discrete"
          solver="Newton" jacobian="sparse" cone="elliptic" iterations="20" tolerance="1e-8"/>
  <default>
    <joint armature="0.05"/>
    <geom condim="3" friction="{specimen.friction} 0.001 0.0001" solref=".004 1" solimp=".9 .95 .05"/>
    <default class="wall"><geom contype="2" conaffinity="1"/></default>
    <default class="link">
      <geom type="capsule" size="{ROBOT_RADIUS_MM}" contype="1" conaffinity="2"/>
    </default>
  </default>
  <worldbody>
    {wall_geoms}
    <geom class="wall" type="plane" size="1 1 1" pos="0 0 -{LUMEN_HALF_HEIGHT_MM}"/>
    <geom class="wall" type="plane" size="1 1 1" pos="0 0 {LUMEN_HALF_HEIGHT_MM}" euler="{np.pi} 0 0"/>
    <body name="base" pos="{x:.6f} {y:.6f} 0" euler="0 0 {port.angle_rad:.9f}">
      <joint name="feed" type="slide" axis="1 0 0" range="{-DRAWN_OUT_MM} {lengths.sum()}" armature="0.05"/>
      <inertial pos="0 0 0" mass="0.001" diaginertia="0.01 0.01 0.01"/>
      {_chain(lengths, specimen, tendons_deg)}
    </body>
  </worldbody>
  <tendon>{tendons}</tendon>
  <actuator>
    {pulls}
    <position name="feed" joint="feed" kp="{FEED_KP_MN_MM}" kv="{FEED_KV}"/>
  </actuator>
</mujoco>""")


def _chain(lengths: NDArray[np.float64], specimen: Specimen, tendons_deg: Sequence[float]) -> str:
    """The nested bodies of the chain, from the base on."""
    opening, first = [], len(lengths) - STEERABLE_LINKS
    before = -float(lengths.sum())
    for link, length in enumerate(lengths):
        steerable = link >= first
        stiffness = (specimen.tip_ei if steerable else specimen.shaft_ei) / length
        hinge = f'stiffness="{stiffness:.6g}" damping="{stiffness * specimen.damping_s:.6g}" range="-0.45 0.45"'
        set_rad = np.radians(specimen.tip_set_deg) / STEERABLE_LINKS if steerable else 0.0
        opening.append(f'<body pos="{before} 0 0"><joint axis="0 0 1" {hinge} springref="{set_rad:.6g}"/>')
        if steerable:
            # Positive pitch lifts the tip towards the camera (-z).
            opening.append(f'<joint axis="0 1 0" {hinge}/>')
        opening.append(f'<geom class="link" fromto="0 0 0 {length} 0 0" mass="{_MASS_KG_MM * length}"/>')
        if link >= first - 1:
            at = length - LINK_MM / 2
            for place, (across, up) in enumerate(map(unit_vector, tendons_deg)):
                y, z = TENDON_OFFSET_MM * across, 0.0 - TENDON_OFFSET_MM * up  # the camera is at -z
                opening.append(f'<site name="tendon{place}_{link}" pos="{at} {y} {z}"/>')
        before = float(length)
    return "".join(opening) + "</body>" * len(lengths)


_log = logging.getLogger(__name__)
_FATAL = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
_GUIDE_EI = 1e8
_GUIDE_DAMPING_S = 0.004
_GUIDE_MM = 3.0
_SHEATH_EI = 6e4


# Without a callback MuJoCo writes its warnings to a file in the working directory.
mujoco.set_mju_user_warning(lambda text: _log.warning("MuJoCo: %s", text))


class LinkChain:
    """A MuJoCo model of the robot with a fixed number of links; the tip is at the port for slide position 0.

    ``slack_mm`` (tendons,) are the tendon lengths of the straight robot.
    """

    def __init__(
        self,
        walls: list[Wall],
        port: Port,
        shaft_links: int,
        specimen: Specimen,
        tendons_deg: Sequence[float] = DEFAULT_TENDONS_DEG,
    ) -> None:
        self.model = build_model(walls, port, shaft_links, specimen, tendons_deg)
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
        self._set_rad = self._straight_set_rad = self.model.qpos_spring[1:].copy()
        self._is_steerable = link >= shaft_links
        self._is_pitch = self.model.jnt_axis[1:, 1] != 0.0
        self._sites_mm = self.model.site_pos.copy()
        self._turned_for = 0.0
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
        self.data.ctrl[: len(self.slack_mm)] = self.slack_mm
        self.turn(0.0)
        self.shape(0.0)
        mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        """One time step.

        Raises FloatingPointError when the state is no longer finite (never seen); MuJoCo would silently restart from the
        straight robot.
        """
        mujoco.mj_step(self.model, self.data)
        if any(self.data.warning[kind].number for kind in _FATAL):
            raise FloatingPointError(f"the twin's physics diverged at {self.data.time:.3f} s")

    def take_over(self, other: LinkChain) -> None:
        """Copy the state of a shorter or longer chain: distal joints are copied, further ones are straight."""
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

    def turn(self, rotation_deg: float) -> None:
        """Turn the shaft about its axis: its tendons and its set stand in other directions then. The links do not twist."""
        if rotation_deg == self._turned_for:
            return
        self._turned_for = rotation_deg
        cos, sin = unit_vector(rotation_deg)
        y, z = self._sites_mm[:, 1], self._sites_mm[:, 2]
        self.model.site_pos[:, 1], self.model.site_pos[:, 2] = y * cos + z * sin, z * cos - y * sin
        set_rad = np.radians(self._specimen.tip_set_deg) / STEERABLE_LINKS
        turned = np.where(self._is_pitch, set_rad * sin, set_rad * cos)
        self._set_rad = np.where(self._is_steerable, turned, self._straight_set_rad)
        self._shaped_for = None

    def shape(self, delivery_mm: float) -> None:
        """Stiffen what the guide behind the port and the sheath cover; links touch walls only inside.

        Stiffness keeps the joints outside straight, so the robot cannot buckle there.
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


MAX_PULL_MM = 2.0
"""Tendon pull at a bend or pitch of 1; the tip bends about 47 degrees per millimetre."""
NOMINAL_DEG_PER_MM = Specimen().bend_deg_per_mm

_ROTATION_PLAY_DEG = 4.0
"""Between the servo that turns the shaft and the head: the shaft twists against its friction."""


@dataclass(frozen=True, slots=True)
class DriveProperties:
    """What lies between the commands and the robot.

    ``backlash_mm`` is the play between motor and tendon, ``dead_zone_mm`` the slack that must be taken up before it pulls (to the
    left ``dead_zone_left_mm``, None: as to the right); beyond it a tendon moves by ``gain`` (right, left) of the motor's way. Of
    the feed's way the robot makes ``feed_share``, forward less by the share ``feed_slip``. All comes ``delay_s`` late.
    """

    slew_mm_s: float = 10.0
    backlash_mm: float = 0.08
    dead_zone_mm: float = 0.02
    dead_zone_left_mm: float | None = None
    gain: tuple[float, float] = (1.0, 1.0)
    feed_share: float = 1.0
    feed_slip: float = 0.0
    delay_s: float = 0.0

    @staticmethod
    def identified(known: BehaviourConfig, max_pull_mm: float, deg_per_mm: float) -> DriveProperties:
        """Those of a robot whose full pull is `max_pull_mm`, where the twin's one bends by `deg_per_mm` of pull."""
        real_mm = max_pull_mm / MAX_PULL_MM
        return DriveProperties(
            backlash_mm=known.play_mm.value / real_mm,
            dead_zone_mm=known.slack_right_mm.value / real_mm,
            dead_zone_left_mm=known.slack_left_mm.value / real_mm,
            gain=(
                known.bend_right_deg_per_mm.value * real_mm / deg_per_mm,
                known.bend_left_deg_per_mm.value * real_mm / deg_per_mm,
            ),
            feed_share=known.feed_share.value,
            feed_slip=known.feed_slip.value,
            delay_s=known.delay_s.value,
        )


class ShaftDrive:
    """Turns the shaft: ``servo_deg`` is where its servo is; ``tip_deg`` follows with the play of a shaft that twists."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.servo_deg = self.tip_deg = 0.0

    def step(self, speed_deg_s: float, duration_s: float) -> float:
        """Turn at this speed; returns ``tip_deg``."""
        self.servo_deg += speed_deg_s * duration_s
        play = _ROTATION_PLAY_DEG / 2
        self.tip_deg = max(self.servo_deg - play, min(self.servo_deg + play, self.tip_deg))
        return self.tip_deg


class TendonDrive:
    """The tendons' pull in one direction across the shaft. ``pull_mm`` is what reaches them, the opposite one negatively."""

    def __init__(self, properties: DriveProperties) -> None:
        self._properties = properties
        self.reset()

    def reset(self) -> None:
        self._motor_mm = 0.0
        self._carried_mm = 0.0

    def step(self, demand: float, duration_s: float) -> float:
        """Move towards `demand` (-1..1) for `duration_s`; returns ``pull_mm``."""
        properties = self._properties
        reach = properties.slew_mm_s * duration_s
        target = max(-1.0, min(1.0, demand)) * MAX_PULL_MM
        self._motor_mm += max(-reach, min(reach, target - self._motor_mm))
        play = properties.backlash_mm / 2
        self._carried_mm = max(self._motor_mm - play, min(self._motor_mm + play, self._carried_mm))
        return self.pull_mm

    @property
    def pull_mm(self) -> float:
        properties = self._properties
        if self._carried_mm > 0:
            return properties.gain[0] * max(0.0, self._carried_mm - properties.dead_zone_mm)
        slack_mm = properties.dead_zone_mm if properties.dead_zone_left_mm is None else properties.dead_zone_left_mm
        return -properties.gain[1] * max(0.0, -self._carried_mm - slack_mm)


STEERABLE_MM = STEERABLE_LINKS * LINK_MM
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
    seed : which robot (see ``Specimen``); 0 is the nominal one, and `specimen` another one.
    drive : the actuator layer.
    tendons_deg : directions of the tendons around the shaft; default: right, left, up, down.

    Notes
    -----
    The same seed and the same commands give bit-equal states. All methods may be called from any thread. Bend and pitch of a
    command count in the shaft's own directions, which its rotation turns.
    """

    def __init__(
        self,
        phantom: Phantom,
        seed: int = 0,
        drive: DriveProperties | None = None,
        tendons_deg: Sequence[float] = DEFAULT_TENDONS_DEG,
        specimen: Specimen | None = None,
    ) -> None:
        self.phantom = phantom
        self.specimen = specimen or Specimen.drawn(seed)
        outlines = lumen_outline(phantom.graph)
        walls, self._port = wall_boxes(phantom, outlines)
        routes_mm = node_distances_mm(phantom)[phantom.port, list(phantom.targets)]
        self._shaft_links = math.ceil((float(routes_mm.max()) + _SPARE_MM - STEERABLE_MM) / SHAFT_LINK_MM)
        self.chain_mm = self._shaft_links * SHAFT_LINK_MM + STEERABLE_MM
        self._walls = walls
        self._discs = lumen_discs(phantom.graph)
        self._centers = cKDTree(self._discs[0])
        self._outline = cKDTree(np.concatenate(outlines))
        self._lock = threading.RLock()
        self._drive = drive = drive or DriveProperties()
        self._bend, self._pitch = TendonDrive(drive), TendonDrive(drive)
        self._shaft = ShaftDrive()
        self._tendons_deg = tuple(tendons_deg)
        self._tendons = tuple(map(unit_vector, tendons_deg))
        self._chains: dict[int, LinkChain] = {}
        self.reset()

    def reset(self) -> None:
        """The tip at the port, tendons slack, time 0."""
        with self._lock:
            self._chain = self._chain_of(0)
            self._chain.reset()
            self._bend.reset()
            self._pitch.reset()
            self._shaft.reset()
            self._feed_mm = 0.0
            self._delivery_mm = 0.0
            self._contact_mn = 0.0
            self._due_s = 0.0
            self._on_the_way = deque([Command()] * round(self._drive.delay_s / TIMESTEP_S))

    def _chain_of(self, size: int) -> LinkChain:
        """The chain with (`size` + 1) * 20 shaft links, at most what the longest route of the phantom needs.

        Links far outside the port do not matter, and the cost of a step grows faster than the number of links.
        """
        shaft_links = min(self._shaft_links, (size + 1) * _CHAIN_STEP_LINKS)
        if size not in self._chains:
            self._chains[size] = LinkChain(self._walls, self._port, shaft_links, self.specimen, self._tendons_deg)
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
            self._chain = chosen  # last: other threads read it without the lock

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return float(self._chain.data.time)

    @property
    def insertion_mm(self) -> float:
        """Length of robot beyond the port."""
        return max(0.0, min(self.chain_mm, self._chain.insertion_mm))

    @property
    def is_drawn_out(self) -> bool:
        """Whether the tip is so far behind the port that no part of the robot is shown."""
        return self._chain.insertion_mm < -OUTSIDE_MM

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
                self._on_the_way.append(command)
                self._actuate(self._on_the_way.popleft())
                self._chain.step()
                self._contact_mn += (self._chain.wall_force_mn() - self._contact_mn) * TIMESTEP_S / _CONTACT_LOWPASS_S

    def _actuate(self, command: Command) -> None:
        chain = self._chain
        control, slack = chain.data.ctrl, chain.slack_mm
        bend = self._bend.step(command.bend, TIMESTEP_S)
        pitch = self._pitch.step(command.pitch, TIMESTEP_S)
        # A tendon is let go as far as the curve takes: a fixed antagonist would halve the bend.
        for place, (across, up) in enumerate(self._tendons):
            control[place] = slack[place] - (bend * across + pitch * up)
        control[len(slack)] = self._feed(command.advance_mm_s)
        chain.turn(self._shaft.step(command.rotation_deg_s, TIMESTEP_S))
        reach_mm = max(0.0, chain.insertion_mm - STEERABLE_MM)
        self._delivery_mm = max(0.0, min(reach_mm, self._delivery_mm + command.delivery_mm_s * TIMESTEP_S))
        chain.shape(self._delivery_mm)

    def _feed(self, advance_mm_s: float) -> float:
        """The next goal of the feed. A stalled drive slips: the goal stays where the drive's maximal force still reaches.

        The limit acts on the goal, because a saturated force inside the solver is explicit and oscillates.
        """
        insertion_mm, speed_mm_s = self._chain.insertion_mm, float(self._chain.data.qvel[0])
        slip_mm, lag_s = self.specimen.feed_force_mn / FEED_KP_MN_MM, FEED_KV / FEED_KP_MN_MM
        advance_mm_s *= self._drive.feed_share * (1.0 - self._drive.feed_slip * (advance_mm_s > 0.0))
        moved = self._feed_mm + advance_mm_s * TIMESTEP_S
        moved = max(insertion_mm - slip_mm, min(insertion_mm + slip_mm, moved))
        self._feed_mm = max(-DRAWN_OUT_MM, min(self.chain_mm, moved))
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
            pull, force = self._chain.slack_mm - data.ten_length, -data.actuator_force[: len(self._tendons)]
            return RobotStatus(
                time_s=self.time_s,
                insertion_mm=self.insertion_mm,
                delivery_mm=self._delivery_mm,
                tendon_pull_mm=tuple(map(float, pull)),
                tendon_force_mn=tuple(map(float, force)),
                wall_contact_n=self._contact_mn / 1000.0,
                rotation_deg=self._shaft.servo_deg,
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
