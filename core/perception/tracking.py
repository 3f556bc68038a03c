"""What the last frames say about this one (METHOD section 4): a memory that fades, and a head that cannot jump."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.config import TrackingConfig
from core.types import Reason, Refusal, RobotPath

SLACK_PX = 12.0
"""A still head may be found this far off from frame to frame: noise of the mask's tip."""


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The last path that was accepted, and when its frame was captured."""

    path: RobotPath
    captured_s: float


def recall(memory: Memory | None, captured_s: float, config: TrackingConfig) -> RobotPath | None:
    """The remembered path, if tracking is on and the memory is not too old (or from the future: a stream that was wound back)."""
    if memory is None or not config.enabled:
        return None
    return memory.path if 0.0 <= captured_s - memory.captured_s <= config.memory_s else None


def check_jump(path: RobotPath, memory: Memory | None, captured_s: float, config: TrackingConfig) -> Refusal | None:
    """HEAD_JUMP, when the head is farther from its last place than the robot can have moved.

    The refused path must not become the memory: then a wrong one is forgotten with the next frame, and a right one is accepted as
    soon as the old memory has faded.
    """
    before = recall(memory, captured_s, config)
    if before is None or memory is None:
        return None
    jump_px = float(np.hypot(path.head[0] - before.head[0], path.head[1] - before.head[1]))
    limit_px = config.max_head_speed_px_s * (captured_s - memory.captured_s) + SLACK_PX
    if jump_px <= limit_px:
        return None
    return Refusal(Reason.HEAD_JUMP, f"{jump_px:.0f} px since the last frame (at most {limit_px:.0f} px)")
