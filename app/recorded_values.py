"""The recorded values of a row that no dial shows, as lines to read and to copy. No Qt here."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from app.cells import number
from app.language import tr, tr_text
from app.wording import refusal_text
from core.session.recorded import RecordedRow

_TENDONS = ("right", "left", "up", "down")
_MOST_LINES = 200


def value_lines(row: RecordedRow) -> list[str]:
    """Frame, latency by stage, robot, drive, and the servo bus as it was."""
    scene, status, drive = row.scene, row.status, row.drive
    camera = tr("{skipped} skipped for newer ones, {lost} lost by the camera", skipped=row.dropped_frames, lost=row.camera_lost)
    dropped = tr("{camera}, {count} by the recorder", camera=camera, count=row.dropped_rows)
    size = f"{row.size[0]} \N{MULTIPLICATION SIGN} {row.size[1]}"
    lines = [
        tr("frame {index} of the camera, captured at {time:.3f} s, {size} px", index=row.index, time=row.captured_s, size=size),
        tr("{rate:.1f} frames per second, {dropped}", rate=row.frames_per_second, dropped=dropped),
    ]
    stages = dict(scene.latency_ms)
    total_ms = stages.pop("total", None)
    if total_ms is not None:
        lines.append(
            tr("perception {total:.1f} ms: ", total=total_ms)
            + ", ".join(f"{tr_text(name)} {ms:.1f}" for name, ms in stages.items())
        )
    if scene.pose is not None:
        lines.append(
            tr(
                "confidence {confidence:.2f}, crossed {crossed}",
                confidence=scene.pose.confidence,
                crossed=tr("yes") if scene.pose.crossed else tr("no"),
            )
        )
    elif scene.refusal is not None:
        lines.append(tr("no pose: {why}", why=refusal_text(scene.refusal)))
    if scene.route_problem:
        lines.append(tr("no way to the target: {why}", why=tr_text(scene.route_problem)))
    if status is not None:
        lines.append(
            tr("insertion {insertion:.1f} mm, sheath {sheath:.1f} mm", insertion=status.insertion_mm, sheath=status.delivery_mm)
        )
        pulls = zip(_TENDONS, status.tendon_pull_mm, status.tendon_force_mn, strict=True)
        lines.append(
            tr("tendons: ")
            + ", ".join(f"{tr_text(name)} {number(pull, 2)} mm {number(force, 0)} mN" for name, pull, force in pulls)
        )
    if drive is not None:
        lines += [
            tr("fault: {cause}: {detail}", cause=tr_text(str(fault.cause)), detail=tr_text(fault.detail)) for fault in drive.active
        ]
        lines += [tr("against arming: {reason}", reason=tr_text(str(reason))) for reason in drive.against_arming]
    if scene.novelty is not None:
        lines.append(tr("distance from the kinds of pictures that the model knows {novelty:.2f}", novelty=scene.novelty))
    if row.bus is not None:
        lines += ["", tr("servo bus"), *_flat(row.bus)]
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
