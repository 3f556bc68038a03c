"""What speaks for and against an answer, as numbers, and how sure it is after calibration.

The numbers are collected while perceiving; how they add up to "right with 90 %" is learnt once per model on labelled frames that
it was not trained on (``calibrate``), by logistic regression (J. Platt, "Probabilistic outputs for support vector machines", 1999),
and kept in ``model.json``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from core.config import PerceptionConfig
from core.perception import polyline
from core.types import Centerline, Masks, Point, Points, RobotPath, Vector

_BEYOND_PX = (4.0, 24.0)
"""Where a robot that goes on beyond the head that was found would be seen."""
_AROUND_PX = 60
"""Half side of the window around the head in which the network's doubt is counted."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Signs of one answer; all are shares or ratios without unit, but ``log_length`` (natural logarithm of px) and the swings.

    The swings are None where nobody looked for them: they take several times as long as all the rest (``steadiness``).
    """

    robot_seen: float
    """Mean robot probability along the last 40 px."""
    robot_seen_all: float
    """The same along the whole path."""
    vessel_seen: float
    """Mean vessel probability along the centerline's piece."""
    inside: float
    """Share of the last 40 px that lies in the vessel."""
    bridged: float
    """Share of the path that was bridged."""
    lead: float
    """How far the runner-up's score is behind, at most 1."""
    ambiguity: float
    off_path: float
    """Share of the robot's mask that the path does not explain."""
    beyond: float
    """Highest robot probability straight beyond the head."""
    bend: float
    """Root mean square distance of the last 40 px from their line, in radii."""
    offset: float
    """Distance of the head from the centerline, in lumen radii."""
    off_border: float
    """1 when the tail is neither at the image border nor at the port."""
    log_length: float
    robot_doubt: float
    """Mean p(1 - p) of the robot around the head, against the robot's share there."""
    vessel_doubt: float
    """Mean p(1 - p) of the vessel around the head."""
    theta_swing: float | None = None
    """How much theta changes when the masks are drawn a little wider or narrower: mean of log(1 + degrees)."""
    head_swing: float | None = None
    """The same of the head: mean of log(1 + px)."""

    @classmethod
    def names(cls) -> tuple[str, ...]:
        return tuple(field.name for field in fields(cls))

    def values(self) -> tuple[float, ...]:
        """The signs that are known, in the order of their ``names``."""
        return tuple(value for value in (getattr(self, name) for name in self.__slots__) if value is not None)


SWINGS = ("theta_swing", "head_swing")
WITHOUT_SWINGS = tuple(name for name in Evidence.names() if name not in SWINGS)


class Calibration(BaseModel):
    """Weights of a logistic regression over ``Evidence``: confidence = 1 / (1 + exp(-(offset + weights . (x - mean) / scale)))."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    features: tuple[str, ...]
    mean: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[float, ...]
    offset: float
    fitted_on: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.features not in (Evidence.names(), WITHOUT_SWINGS):
            raise ValueError("the calibration is of another version; run calibrate again")
        if {len(self.mean), len(self.scale), len(self.weights)} != {len(self.features)} or min(self.scale) <= 0.0:
            raise ValueError("the calibration is damaged; run calibrate again")
        return self

    @property
    def needs_swings(self) -> bool:
        """Whether it was fitted on evidence with swings, and says nothing of any without."""
        return SWINGS[0] in self.features

    def confidence(self, evidence: Evidence) -> float:
        """Probability 0..1 that the answer is right."""
        signs = np.array([getattr(evidence, name) for name in self.features], np.float64)
        standard = (signs - np.array(self.mean)) / np.array(self.scale)
        # What lies far beyond anything seen while fitting must not become certainty.
        logit = self.offset + float(np.clip(standard, -4.0, 4.0) @ np.array(self.weights))
        return float(1.0 / (1.0 + np.exp(-np.clip(logit, -30.0, 30.0))))


def collect(path: RobotPath, robot: Vector, centerline: Centerline, masks: Masks, config: PerceptionConfig) -> Evidence:
    """All signs of an answer; coordinates in working pixels."""
    along = polyline.arc_length(path.points)
    total = float(along[-1])
    tip = polyline.resample(polyline.cut(path.points, total - config.vectors.robot_length_px, total, along), 1.0)
    whole = polyline.resample(path.points, 2.0)
    direction = np.array(robot.direction)
    ahead = np.array(path.head) + np.arange(*_BEYOND_PX)[:, None] * direction
    across = (tip - np.array(robot.center)) @ np.array([-direction[1], direction[0]])
    across -= _mean(across)
    radius = max(path.radius_px, 1.0)
    robot_near, vessel_near = (_around(p, path.head) for p in (masks.robot_probability, masks.vessel_probability))
    area = float(cv2.countNonZero(masks.robot.view(np.uint8)))
    off_centre = math.dist(path.head, centerline.nearest)
    return Evidence(
        robot_seen=_mean(at(masks.robot_probability, tip)),
        robot_seen_all=_mean(at(masks.robot_probability, whole)),
        vessel_seen=_mean(at(masks.vessel_probability, centerline.piece)),
        inside=_mean(at(masks.vessel, tip)),
        bridged=min(1.0, path.bridged_px / max(total, 1.0)),
        lead=1.0 if path.runner_up is None else min(1.0, max(0.0, path.score - path.runner_up)),
        ambiguity=centerline.ambiguity,
        off_path=max(0.0, 1.0 - 2.0 * radius * total / max(area, 1.0)),
        beyond=float(at(masks.robot_probability, ahead).max()),
        bend=math.sqrt(_mean(across * across)) / radius,
        offset=off_centre / max(centerline.radius_px, 1.0),
        off_border=0.0 if path.entry_on_border else 1.0,
        log_length=math.log(max(total, 1.0)),
        robot_doubt=float((robot_near * (1 - robot_near)).sum() / max(float(robot_near.sum()), 1.0)),
        vessel_doubt=_mean(vessel_near * (1 - vessel_near)),
    )


def wall_blur_px(masks: Masks, head: Point) -> float:
    """How wide, on average, the network's doubt at the vessel's walls is beside the head, px: 4 p(1 - p) summed over them.

    For a wall whose probability is a logistic function of the distance that is the width from 0.1 to 0.9. A lumen is clear but for
    its rim; what is drawn around a robot where there is none is doubt all over.
    """
    near, inside = _around(masks.vessel_probability, head), np.ascontiguousarray(_around(masks.vessel, head)).view(np.uint8)
    rim = cv2.countNonZero(inside) - cv2.countNonZero(cv2.erode(inside, np.ones((3, 3), np.uint8), borderValue=1))
    # One wall across the window at least: where the lumen fills all of it, there is nothing to divide by.
    return 4.0 * float((near * (1 - near)).sum()) / max(rim, 2 * _AROUND_PX)


def _mean(values: NDArray[Any]) -> float:
    return float(values.sum()) / values.size


def _around(values: NDArray[Any], place: Point) -> NDArray[Any]:
    x, y = (round(coordinate) for coordinate in place)
    return values[max(0, y - _AROUND_PX) : y + _AROUND_PX + 1, max(0, x - _AROUND_PX) : x + _AROUND_PX + 1]


def at(values: NDArray[Any], points: Points) -> NDArray[Any]:
    """A map (h, w) at the pixels nearest to `points`; places beyond the image count as its border."""
    columns, rows = np.rint(points).T.astype(np.intp)
    # take clips in one go what two fancy indices would need clipped first.
    inner = np.minimum(np.maximum(rows, 0), values.shape[0] - 1) * values.shape[1]
    return np.asarray(np.take(values, inner + np.minimum(np.maximum(columns, 0), values.shape[1] - 1)))
