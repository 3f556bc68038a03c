"""The recorded values of a row that no dial shows, as lines to read and to copy. No Qt here."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from app.cells import number
from core.session.recorded import RecordedRow

_TENDONS = ("right", "left", "up", "down")
_MOST_LINES = 200


def value_lines(row: RecordedRow) -> list[str]:
    """Frame, latency by stage, robot, drive, and the servo bus as it was."""
    scene, status, drive = row.scene, row.status, row.drive
    camera = f"{row.dropped_frames} skipped for newer ones, {row.camera_lost} lost by the camera"
    dropped = f"{camera}, {row.dropped_rows} by the recorder"
    size = f"{row.size[0]} \N{MULTIPLICATION SIGN} {row.size[1]}"
    lines = [
        f"frame {row.index} of the camera, captured at {row.captured_s:.3f} s, {size} px",
        f"{row.frames_per_second:.1f} frames per second, {dropped}",
    ]
    stages = dict(scene.latency_ms)
    total_ms = stages.pop("total", None)
    if total_ms is not None:
        lines.append(f"perception {total_ms:.1f} ms: " + ", ".join(f"{name} {ms:.1f}" for name, ms in stages.items()))
    if scene.pose is not None:
        lines.append(f"confidence {scene.pose.confidence:.2f}, crossed {'yes' if scene.pose.crossed else 'no'}")
    elif scene.refusal is not None:
        lines.append(f"no pose: {scene.refusal}")
    if scene.route_problem:
        lines.append(f"no way to the target: {scene.route_problem}")
    if status is not None:
        lines.append(f"insertion {status.insertion_mm:.1f} mm, sheath {status.delivery_mm:.1f} mm")
        pulls = zip(_TENDONS, status.tendon_pull_mm, status.tendon_force_mn, strict=True)
        lines.append("tendons: " + ", ".join(f"{name} {number(pull, 2)} mm {number(force, 0)} mN" for name, pull, force in pulls))
    if drive is not None:
        lines += [f"fault: {fault.cause}: {fault.detail}" for fault in drive.active]
        lines += [f"against arming: {reason}" for reason in drive.against_arming]
    if row.bus is not None:
        lines += ["", "servo bus", *_flat(row.bus)]
    return lines[:_MOST_LINES]


def _flat(values: dict[str, Any], prefix: str = "") -> Iterator[str]:
    """Plain values of nested ones, each named by its way."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        elif isinstance(value, list) and value and all(isinstance(inner, dict) for inner in value):
            for k, inner in enumerate(value, 1):
                yield from _flat(inner, f"{prefix}{name} {k}.")
        else:
            yield f"{prefix}{name} {value}"
