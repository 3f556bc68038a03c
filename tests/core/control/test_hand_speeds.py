"""What a held key makes, in the joints' own units."""

from __future__ import annotations

from core.config.models import JogConfig
from core.config.safety import ServosConfig
from core.control.motion import JogSpeeds, hand_speeds

HAND = JogConfig(bend_rate_per_s=1.5, advance_mm_s=10.0, delivery_mm_s=5.0)


def servos(**slow_mm_s: float) -> ServosConfig:
    """Some joints may go no faster than that."""
    plain = ServosConfig(max_pull_mm=2.0)
    joints = (
        joint.model_copy(update={"max_speed_mm_s": slow_mm_s.get(joint.name, joint.max_speed_mm_s)}) for joint in plain.joints
    )
    return plain.model_copy(update={"joints": tuple(joints)})


def test_a_rate_of_bend_is_a_pull_of_the_wires() -> None:
    assert hand_speeds(HAND, servos()) == JogSpeeds(advance_mm_s=10.0, delivery_mm_s=5.0, bend_mm_s=3.0, pitch_mm_s=3.0)


def test_a_share_of_full_speed_is_of_all() -> None:
    assert hand_speeds(HAND, servos(), 0.5) == JogSpeeds(advance_mm_s=5.0, delivery_mm_s=2.5, bend_mm_s=1.5, pitch_mm_s=1.5)


def test_the_slowest_joint_that_takes_part_holds_the_others_back() -> None:
    slow = servos(advance=4.0, delivery_2=2.0, left=1.0)
    assert hand_speeds(HAND, slow) == JogSpeeds(advance_mm_s=4.0, delivery_mm_s=2.0, bend_mm_s=1.0, pitch_mm_s=3.0)
    assert hand_speeds(HAND, slow, 0.25) == JogSpeeds(advance_mm_s=2.5, delivery_mm_s=1.25, bend_mm_s=0.75, pitch_mm_s=0.75)
