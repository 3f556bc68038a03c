"""Which labelled frames a model finds hard, so that training can show them more often."""

from __future__ import annotations

from core.learning.dataset import WORKING_SIZE_PX, Sample
from core.perception.segmentation import Segmenter
from core.study.accuracy import dice

_LEAST = 0.02
"""Of a frame that is known by heart: it may still be drawn."""


def difficulty(sample: Sample, segment: Segmenter) -> float:
    """1 - Dice of the robot plus half of 1 - Dice of the vessel, at least ``_LEAST``; raises DatasetError.

    The vessel counts half: it is seen in nearly every frame, and where the robot is lost nothing can be answered.
    """
    image, vessel, robot = sample.load(WORKING_SIZE_PX)
    vessel_probability, robot_probability = segment(image)
    lost = 1 - dice(robot_probability >= 0.5, robot) + 0.5 * (1 - dice(vessel_probability >= 0.5, vessel))
    return max(_LEAST, lost)
