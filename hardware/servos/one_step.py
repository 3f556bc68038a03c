"""What one order may do: a dead application can move a joint by one bounded step at most. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence

from core.control.joints import Joints
from core.servo_config import JointConfig


class OneStep:
    """Keeps the goals of one order within ``max_step_mm`` of where the joints were last seen before it came.

    An order is good for ``command_max_age_s``, which at full speed is more than a step. The gate's own step is counted from the
    measured position of each cycle, and moves along with the joint.
    """

    def __init__(self, joints: Sequence[JointConfig]) -> None:
        self._joints = joints
        self._order: tuple[float, object] | None = None
        self._from_mm: Joints = ()

    def bounded(self, goals_mm: Joints, order: tuple[float, object], before_mm: Joints) -> Joints:
        """The goals, those too far brought nearer.

        Parameters
        ----------
        order : time and content; what is equal in both is the same order.
        before_mm : positions of the cycle before this one, which no new order can be older than. (Counted from this cycle's, a
            joint that moves would already have moved on since the order was issued.)
        """
        if self._order != order:
            self._order, self._from_mm = order, before_mm
        return tuple(
            min(max(goal, start - joint.max_step_mm), start + joint.max_step_mm) if math.isfinite(goal) else goal
            for goal, start, joint in zip(goals_mm, self._from_mm, self._joints, strict=True)
        )
