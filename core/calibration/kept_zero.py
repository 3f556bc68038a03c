"""Whether the zero that a rig file keeps still fits where its servos stand now. Pure.

A servo in extended position mode counts its turns only while it has power: afterwards its position register has jumped by whole
turns. A tendon's way is a small part of a turn, so there the jump shows; a feed goes over many turns, and a lost one may not
show. So a kept zero is never taken over by itself: it says what has happened, and zeroing is the operator's, with slack wires.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from core.calibration_config import ZeroConfig
from core.servo_config import TICKS_PER_TURN, JointConfig, JointName, ServosConfig

_OVER = "the zero of the rig file does not hold any more"


@dataclass(frozen=True, slots=True)
class KeptZero:
    """One joint. ``at_mm``: where it stands from the kept zero, after ``lost_turns`` of the servo are taken off."""

    name: JointName
    lost_turns: int
    at_mm: float
    is_inside: bool


def kept_zero(joint: JointConfig, zero_ticks: int, ticks: int) -> KeptZero:
    """How a joint stands against its kept zero; turns count as lost only where they take it out of its envelope.

    Parameters
    ----------
    zero_ticks, ticks : position registers, at the kept zero and now.
    """
    away = ticks - zero_ticks
    if _is_inside(joint, away):
        return KeptZero(joint.name, 0, away / joint.ticks_per_mm, True)
    turns = round(away / TICKS_PER_TURN)
    left = away - turns * TICKS_PER_TURN
    if turns and _is_inside(joint, left):
        return KeptZero(joint.name, turns, left / joint.ticks_per_mm, True)
    return KeptZero(joint.name, 0, away / joint.ticks_per_mm, False)


def zero_advice(servos: ServosConfig, zero: ZeroConfig, ticks: Sequence[int]) -> str:
    """One sentence for somebody who wants to arm joints that are not zeroed.

    Parameters
    ----------
    ticks : position registers now, in the order of the joints.
    """
    found = [kept_zero(joint, *both) for joint, *both in zip(servos.joints, zero.ticks, ticks, strict=True)]
    if lost := [f"{one.name} by {one.lost_turns:+d}" for one in found if one.lost_turns]:
        return f"{_OVER}: the servos were without power and lost whole turns ({', '.join(lost)})"
    if moved := [f"{one.name} by {one.at_mm:+.1f} mm" for one in found if not one.is_inside]:
        return f"{_OVER}: joints were moved out of their envelope ({', '.join(moved)})"
    tendons = ", ".join(f"{one.name} {one.at_mm:+.1f}" for one in found[:4])
    return f"no jump against the zero of the rig file is seen (mm from it: {tendons})"


def _is_inside(joint: JointConfig, ticks: int) -> bool:
    return joint.low_mm <= ticks / joint.ticks_per_mm <= joint.high_mm
