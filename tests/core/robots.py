"""Robots of other shapes than the default one, for tests."""

from typing import Any

from core.config.safety import ServosConfig

TENDON: dict[str, Any] = {
    "kind": "tendon", "low_mm": -2.4, "high_mm": 2.8, "max_speed_mm_s": 10.0, "max_acceleration_mm_s2": 200.0, "max_step_mm": 0.6,
}  # fmt: skip
ADVANCE: dict[str, Any] = {
    "name": "advance", "low_mm": -5.0, "high_mm": 400.0, "max_speed_mm_s": 20.0, "max_acceleration_mm_s2": 200.0,
    "max_step_mm": 1.0,
}  # fmt: skip
ROTATION: dict[str, Any] = {
    "name": "rotation", "low_deg": -200.0, "high_deg": 200.0, "max_speed_deg_s": 60.0, "max_acceleration_deg_s2": 1200.0,
    "max_step_deg": 5.0, "model": 1210, "max_torque_nmm": 80.0,
}  # fmt: skip


def robot(*joints: dict[str, Any]) -> ServosConfig:
    """Its servos, with ids in the order of the joints."""
    return ServosConfig.model_validate({"joints": [{"id": place, **joint} for place, joint in enumerate(joints, start=1)]})


def tendons(*angles_deg: float) -> list[dict[str, Any]]:
    return [{**TENDON, "name": f"tendon_{place}", "angle_deg": angle} for place, angle in enumerate(angles_deg, start=1)]


THREE = robot(*tendons(90.0, 210.0, 330.0), ADVANCE)
"""Three tendons and the feed."""
TURNED = robot(*tendons(90.0, 270.0), ADVANCE, ROTATION)
"""Two tendons that bend towards the camera and away from it until the shaft is turned, the feed and the rotation."""
