"""All angles of a report are fitted alike, whatever lengths the lines had when they were drawn."""

from __future__ import annotations

from dataclasses import replace

import pytest

from core.annotation.agreement_report import measured_alike
from core.annotation.model import Annotation, ImageView, measure_lines
from core.annotation.store import ImageRecord, ItemKey, StoredAnnotation
from core.config.models import PerceptionConfig
from core.types import PoseState

IMAGE = ImageRecord("ab" * 32, "frame.png", 640, 480)
BENT = Annotation(((200.0, 240.0), (270.0, 240.0), (290.0, 220.0)), ((150.0, 200.0), (400.0, 200.0)), PoseState.C)
"""The robot's last 28 px lead elsewhere than what lies before them."""
METHODS = PerceptionConfig()
SHORTER = METHODS.model_copy(update={"vectors": METHODS.vectors.model_copy(update={"robot_length_px": 20.0})})


def kept(content: Annotation, config: PerceptionConfig) -> StoredAnnotation:
    """As the annotator keeps it under this configuration."""
    pose = measure_lines(content, IMAGE.size, config).pose
    assert pose is not None
    key = ItemKey(IMAGE.sha256, "", "ann")
    values = pose.theta_deg, pose.theta_signed_deg, pose.d_head_px, pose.d_tail_px, pose.crossed
    return StoredAnnotation(key, ImageView.AS_IS, content, *values, 1.0, "2026-01-01")


def test_what_was_drawn_under_the_same_settings_stays_as_it_was_kept() -> None:
    annotations = [kept(BENT, METHODS)]
    assert measured_alike(annotations, {IMAGE.sha256: IMAGE}, METHODS) == (annotations, [])


def test_angles_of_other_lengths_are_measured_anew_and_told() -> None:
    other, own = kept(BENT, SHORTER), kept(BENT, METHODS)
    assert other.theta_deg == pytest.approx(45.0)
    assert own.theta_deg is not None
    assert own.theta_deg < 40.0
    (first, second), (note,) = measured_alike([other, own], {IMAGE.sha256: IMAGE}, METHODS)
    assert first == own == second
    assert "Of the manual angles 1 were fitted otherwise" in note
    assert "robot 40 px, vessel twice 20 px" in note


def test_lines_that_are_too_short_for_other_lengths_have_no_angle_any_more() -> None:
    one = kept(replace(BENT, vessel=((285.0, 200.0), (295.0, 200.0))), METHODS)
    vectors = METHODS.vectors.model_copy(update={"vessel_half_length_px": 60.0})
    (now,), notes = measured_alike([one], {IMAGE.sha256: IMAGE}, METHODS.model_copy(update={"vectors": vectors}))
    assert (now.theta_deg, now.theta_signed_deg, now.d_head_px, now.d_tail_px, now.crossed) == (None,) * 5
    assert now.content.state is PoseState.C, "what the rater said stays"
    (note,) = notes
    assert note.endswith("On 1 of them too little was drawn for these lengths: they have a state, and no angle.")


def test_an_annotation_whose_image_is_not_here_stays_as_it_was_kept() -> None:
    other = kept(BENT, SHORTER)
    assert measured_alike([other], {}, METHODS) == ([other], [])
