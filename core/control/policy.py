"""Pose -> advice: the paper's state table ("4 states of interventional robot" and the control advice beside them)."""

from __future__ import annotations

from core.config import AdviceConfig
from core.types import Advice, PoseState, Scene, Speed


def table_policy(scene: Scene, config: AdviceConfig) -> Advice | None:
    """The paper's advice for a scene; None when there is no pose (nothing stale is ever shown).

    A: fast, no steering. B: slow, no steering. C: slowest, steer hardest. D: moderate, steer. The degree follows theta, and
    the turn is always the one that closes theta.
    """
    pose = scene.pose
    if pose is None:
        return None
    turn_deg = -pose.theta_signed_deg if pose.theta_signed_deg else -pose.c_head_px
    where = "right" if pose.c_head_px > 0 else "left"
    if pose.state is PoseState.A:
        return Advice(Speed.FAST, config.fast_mm_s, 0.0, "on the centerline and along it")
    if pose.state is PoseState.B:
        return Advice(Speed.SLOW, config.slow_mm_s, 0.0, f"coming back to the centerline from the {where}")
    if pose.state is PoseState.C:
        steer = _limited(config.steer_gain_away * turn_deg, config)
        return Advice(Speed.SLOWEST, config.slowest_mm_s, steer, f"moving away from the centerline to the {where}")
    steer = _limited(config.steer_gain * turn_deg, config)
    return Advice(Speed.MODERATE, config.moderate_mm_s, steer, f"crossed the centerline to the {where}, angle left")


def _limited(steer_deg: float, config: AdviceConfig) -> float:
    return max(-config.max_steer_deg, min(config.max_steer_deg, steer_deg))
