"""Zeros of joints that outlive a restart of program or servos: kept modulo one turn, and offered to the operator. Pure.

A kept zero is never used before the operator has confirmed it.

A DYNAMIXEL X servo counts turns only while it has power: after switching on or a reboot its position register is an absolute value
within one turn again (Robotis e-Manual, Operating Mode). So a kept position tells the present one up to whole turns, and the last
known position says which turn it is, as long as the joint was moved by less than a quarter of a turn in between.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from pydantic import Field

from core.config.safety import TICKS_PER_TURN, JointConfig, JointName, ServosConfig
from core.config.section import ConfigSection
from core.messages import message

_MOST_MOVED_TICKS = TICKS_PER_TURN // 4
"""A joint that was moved further while nothing watched it may be in another turn: no offer."""
_ROUNDING_TICKS = 2
"""Play and noise of a joint that stands at the end of its envelope."""


class ZeroBasis(StrEnum):
    """What the new zero of a tendon rests on."""

    SLACK = "slack"
    """The operator says that the wire hangs slack: its torque must be off, and nothing may be kept that says otherwise."""
    SEARCHED = "searched"
    """A search has left the wire where it becomes taut: its servo may hold, without more current than friction takes."""
    HERE = "here"
    """Where the joint stands, whatever its tension, for a procedure that moves it by some millimetres from there. Not kept."""


class ZeroRequest(ConfigSection):
    """Where joints are, for their zeros to be set."""

    positions_mm: dict[JointName, float] = Field({}, description="from zero, as the joints stand; 0 of a tendon: its wire is slack")
    kept: tuple[JointName, ...] = Field((), description="joints whose kept zero holds, as the operator has confirmed")
    forgotten: tuple[JointName, ...] = Field((), description="tendons whose kept zero holds no more, as they were hung in again")
    basis: ZeroBasis = Field(ZeroBasis.SLACK, description="of the tendons in positions_mm")


def all_at_zero(servos: ServosConfig) -> ZeroRequest:
    """All joints stand at zero, with slack wires."""
    return ZeroRequest(positions_mm=dict.fromkeys(servos.names, 0.0))


class KeptJoint(ConfigSection):
    """Where a joint was last, with which servo and drum."""

    name: JointName
    id: int
    model: int
    sign: int
    mm_per_turn: float
    ticks: int = Field(description="position register")
    position_mm: float = Field(description="from zero")
    kept_s: float = Field(description="when, in seconds since 1970")

    def is_of(self, joint: JointConfig, model: int) -> bool:
        """Whether it was kept of the same servo, turning the same way, with the same drum."""
        there = (self.name, self.id, self.model, self.sign, self.mm_per_turn)
        return there == (joint.name, joint.id, model, joint.sign, joint.mm_per_turn)


class KeptZeros(ConfigSection):
    """Content of the file that keeps the zeros of a rig."""

    format: int = Field(1, ge=1, le=1)
    joints: tuple[KeptJoint, ...] = ()


@dataclass(frozen=True, slots=True)
class ZeroOffer:
    """Where a joint stands by its kept zero, for the operator to confirm.

    ``zero_ticks`` is the position register at zero as the servo counts now; ``moved_mm`` how far it was moved since it was kept.
    """

    name: JointName
    position_mm: float
    moved_mm: float
    zero_ticks: int
    kept_s: float


def keep(joint: JointConfig, model: int, ticks: int, position_mm: float, kept_s: float) -> KeptJoint:
    """What is kept of a joint that stands at `ticks`, `position_mm` from its zero."""
    return KeptJoint(
        name=joint.name,
        id=joint.id,
        model=model,
        sign=joint.sign,
        mm_per_turn=joint.mm_per_turn,
        ticks=ticks,
        position_mm=position_mm,
        kept_s=kept_s,
    )


def zero_offer(joint: JointConfig, model: int, kept: KeptJoint | None, ticks: int) -> ZeroOffer | None:
    """Where a joint with the position register `ticks` stands by what was kept of it.

    None where nothing was kept of this servo, where it was moved by more than a quarter of a turn, where whole turns were added to
    its register by a motion and not by a restart, or where the place is outside the joint's envelope.
    """
    if kept is None or not kept.is_of(joint, model):
        return None
    away = ticks - kept.ticks
    turns = (away + TICKS_PER_TURN // 2) // TICKS_PER_TURN
    moved = away - turns * TICKS_PER_TURN
    # A servo that has restarted counts within one turn.
    if abs(moved) > _MOST_MOVED_TICKS or (turns and not 0 <= ticks < TICKS_PER_TURN):
        return None
    at_ticks = round(kept.position_mm * joint.ticks_per_mm) + moved
    low, high = sorted((joint.low_mm * joint.ticks_per_mm, joint.high_mm * joint.ticks_per_mm))
    if not low - _ROUNDING_TICKS <= at_ticks <= high + _ROUNDING_TICKS:
        return None
    return ZeroOffer(joint.name, at_ticks / joint.ticks_per_mm, moved / joint.ticks_per_mm, ticks - at_ticks, kept.kept_s)


def unknown_joint(request: ZeroRequest, servos: ServosConfig) -> str:
    """The first joint of a request that the robot does not have, in one line; "" for none."""
    for name in (*request.positions_mm, *request.kept, *request.forgotten):
        if name not in servos.names:
            return message("{joint} is no joint of this robot: {names}", joint=name, names=", ".join(servos.names))
    return ""


def request_problem(request: ZeroRequest, offers: Iterable[ZeroOffer], servos: ServosConfig) -> str:
    """Why zeros cannot be set as requested, in one line; "" when they can, as far as configuration and kept zeros tell.

    `request` names joints of the robot only; `offers` are those of all joints, zeroed or not.
    """
    joints = {joint.name: joint for joint in servos.joints}
    offered = {offer.name: offer for offer in offers if offer.name not in request.forgotten}
    for name, position_mm in request.positions_mm.items():
        low_mm, high_mm = joints[name].low_mm, joints[name].high_mm
        if not low_mm <= position_mm <= high_mm:
            return message("{joint} cannot be at {a:g} mm: give {b:g} to {c:g} mm", joint=name, a=position_mm, b=low_mm, c=high_mm)
        if not joints[name].is_tendon:
            continue
        if position_mm != 0.0:
            return message("{joint}: a tendon is zeroed where its wire is slack, at 0 mm", joint=name)
        if name in offered:
            return message(
                "{joint} stands {a:+.2f} mm from its kept zero: use that, or forget it if the wire was hung in again",
                joint=name,
                a=offered[name].position_mm,
            )
    for name in request.kept:
        if name not in offered:
            return message(
                "{joint} has no kept zero that fits: give its position, or search for it (menu Rig, Calibrate)", joint=name
            )
    return ""
