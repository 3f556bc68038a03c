"""The MuJoCo model of robot and walls. Units mm, kg, s, so forces are millinewtons; board plane z = 0, x right, y down, z away
from the camera. Numbers come from measurements of stability and bending; they are not calibrated to a real rig. Sparse Jacobian and
elliptic cones: with 25 contacts on 127 degrees of freedom a step took 1.4 ms, 1.8 with pyramidal cones, 5.8 with a
dense Jacobian too.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from hardware.twin.walls import Port, Wall

ROBOT_RADIUS_MM = 1.25
LINK_MM = 2.0
"""Length of the steerable links; facts on the bend per pull hold for ten of them."""
SHAFT_LINK_MM = 3.0
"""Shaft links are longer: at the shaft's tightest bends (8 mm) the axis is off by 0.14 mm, and a step costs half."""
STEERABLE_LINKS = 10
TENDONS = ("right", "left", "up", "down")
TIMESTEP_S = 0.002
LUMEN_HALF_HEIGHT_MM = 6.0
TENDON_OFFSET_MM = 1.0
FEED_KP_MN_MM, FEED_KV = 2000.0, 200.0
_MASS_KG_MM = 3e-5
_TENDON_KP_MN_MM, _TENDON_KV, _TENDON_MAX_MN = 2000.0, 40.0, 4000.0


@dataclass(frozen=True, slots=True)
class Specimen:
    """One robot's mechanical properties; no two are alike.

    ``shaft_ei`` and ``tip_ei`` are bending stiffnesses (mN mm2), ``damping_s`` is damping over stiffness, ``tip_set_deg`` the bend
    that the steerable part keeps with slack tendons (positive: right), ``friction`` that against the wall.
    """

    shaft_ei: float = 2e4
    tip_ei: float = 8e3
    damping_s: float = 0.04
    friction: float = 0.1
    tip_set_deg: float = 0.0
    feed_force_mn: float = 600.0

    @staticmethod
    def drawn(seed: int) -> Specimen:
        """The nominal robot for seed 0, else one drawn at random."""
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


def build_model(walls: list[Wall], port: Port, shaft_links: int, specimen: Specimen) -> mujoco.MjModel:
    """Compile the model: a chain of capsules on a slide along the port's axis, with its tip at the port for slide position 0.

    Joint order: slide, then one planar hinge per link, followed by the pitch hinge where the link is steerable. Actuator order:
    right, left, up, down, feed.
    """
    x, y = port.point
    wall_geoms = "".join(
        f'<geom class="wall" type="box" size="{wall.half_length + 0.01:.5f} {wall.half_thickness:.5f} {LUMEN_HALF_HEIGHT_MM + 1}" '
        f'pos="{wall.x:.5f} {wall.y:.5f} 0" euler="0 0 {wall.angle_rad:.6f}"/>'
        for wall in walls
    )
    lengths = link_lengths_mm(shaft_links)
    sites = range(shaft_links - 1, len(lengths))
    tendons = "".join(
        f'<spatial name="{name}">' + "".join(f'<site site="{name}{link}"/>' for link in sites) + "</spatial>" for name in TENDONS
    )
    pulls = "".join(
        f'<position name="{name}" tendon="{name}" kp="{_TENDON_KP_MN_MM}" kv="{_TENDON_KV}" forcerange="-{_TENDON_MAX_MN} 0"/>'
        for name in TENDONS
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
      <joint name="feed" type="slide" axis="1 0 0" range="0 {lengths.sum()}" armature="0.05"/>
      <inertial pos="0 0 0" mass="0.001" diaginertia="0.01 0.01 0.01"/>
      {_chain(lengths, specimen)}
    </body>
  </worldbody>
  <tendon>{tendons}</tendon>
  <actuator>
    {pulls}
    <position name="feed" joint="feed" kp="{FEED_KP_MN_MM}" kv="{FEED_KV}"/>
  </actuator>
</mujoco>""")


def _chain(lengths: NDArray[np.float64], specimen: Specimen) -> str:
    """The nested bodies of the chain, written from the base outward."""
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
            side = TENDON_OFFSET_MM
            places = {"right": (side, 0.0), "left": (-side, 0.0), "up": (0.0, -side), "down": (0.0, side)}
            at = length - LINK_MM / 2
            opening.extend(f'<site name="{name}{link}" pos="{at} {y} {z}"/>' for name, (y, z) in places.items())
        before = float(length)
    return "".join(opening) + "</body>" * len(lengths)
