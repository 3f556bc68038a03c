"""Drawn lines measured anew, so that all angles of a report were fitted alike, whatever the settings were when they were drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from core.config import PerceptionConfig
from core.study.annotation_records import ImageRecord, StoredAnnotation
from core.study.annotations import measure_lines

_SAME_DEG = 0.005
"""As fine as an angle is ever told."""


def measured_alike(
    annotations: Sequence[StoredAnnotation], images: Mapping[str, ImageRecord], config: PerceptionConfig
) -> tuple[list[StoredAnnotation], list[str]]:
    """The annotations with angle, side and distances of their lines as `config` fits them; states stay as they were given.

    Parameters
    ----------
    images : by SHA-256; annotations of others stay as they were kept.

    Returns
    -------
    tuple
        The annotations, and a note for the reader where some of the angles were others when they were drawn.
    """
    alike = [_measured(one, images[one.key.sha256].size, config) if one.key.sha256 in images else one for one in annotations]
    others = sum(not _is_same(was.theta_deg, now.theta_deg) for was, now in zip(annotations, alike, strict=True))
    if not others:
        return alike, []
    gone = sum(was.theta_deg is not None and now.theta_deg is None for was, now in zip(annotations, alike, strict=True))
    lengths = f"robot {config.vectors.robot_length_px:g} px, vessel twice {config.vectors.vessel_half_length_px:g} px"
    return alike, [
        f"Of the manual angles {others} were fitted otherwise when they were drawn (with other lengths of the lines, say); here "
        f"all are fitted anew to what was drawn, as the algorithm's are ({lengths})."
        + (f" On {gone} of them too little was drawn for these lengths: they have a state, and no angle." if gone else "")
    ]


def _measured(one: StoredAnnotation, size: tuple[int, int], config: PerceptionConfig) -> StoredAnnotation:
    pose = measure_lines(one.content, size, config).pose
    if pose is None:
        return replace(one, theta_deg=None, theta_signed_deg=None, d_head_px=None, d_tail_px=None, crossed=None)
    return replace(
        one,
        theta_deg=pose.theta_deg,
        theta_signed_deg=pose.theta_signed_deg,
        d_head_px=pose.d_head_px,
        d_tail_px=pose.d_tail_px,
        crossed=pose.crossed,
    )


def _is_same(one_deg: float | None, other_deg: float | None) -> bool:
    if one_deg is None or other_deg is None:
        return one_deg is other_deg
    return abs(one_deg - other_deg) < _SAME_DEG
