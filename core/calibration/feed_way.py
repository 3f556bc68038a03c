"""Whether the robot goes as far as the feed's servo was sent: a drum of another size than the configured one. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from core.calibration.identify import Assignment, Finding, Function
from core.calibration.scale import mm_per_px_at
from core.calibration_config import ScaleConfig
from core.servo_config import JOINT_NAMES, ServosConfig

_NOISE_PX = 1.0
"""Of a way as two looks give it, in working pixels."""
_LEAST_SHARE = 0.2


def feed_disagreement(
    findings: Mapping[int, Finding],
    assignments: Sequence[Assignment],
    servos: ServosConfig,
    scale: ScaleConfig,
    size: tuple[int, int],
) -> str:
    """What a person must know of the feed's way; "" where camera and configuration agree as far as can be told.

    While nobody knew who is who all servos were turned as if their drums were as large as the largest configured one, so what
    was seen tells the way at one turn of the horn.

    Parameters
    ----------
    findings : by id.
    size : (width, height) of the pictures that were looked at.
    """
    (place,) = (one for one in assignments if one.name == "advance")
    found = findings.get(place.id)
    if found is None or found.function is not Function.ADVANCE or found.way is None:
        return ""
    way = found.way
    turned_as = max(joint.mm_per_turn for joint in servos.joints)
    configured = servos.joints[JOINT_NAMES.index("advance")].mm_per_turn
    mm_per_px = mm_per_px_at(scale, way.head, size)
    seen = way.px_per_mm * mm_per_px * turned_as
    noise = _NOISE_PX / way.scale * mm_per_px / way.amplitude_mm * turned_as
    if abs(seen - configured) <= max(_LEAST_SHARE * configured, noise):
        return ""
    return (
        f"the feed goes by about {seen:.0f} mm at one turn of the servo's horn, as the camera saw it, and is configured with "
        f"{configured:g} mm: measure it, and set servos.joints, advance, mm_per_turn"
    )
