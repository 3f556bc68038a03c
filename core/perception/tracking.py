"""What the last frames say about this one (METHOD section 4): a memory that fades, a head that cannot jump, or has left."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.config import PerceptionConfig, TrackingConfig
from core.perception.entry import ALONG_STEP_PX, STILL_HEAD_PX, goes_along_px, may_go_on_outside
from core.types import Mask, Points, Reason, Refusal, RobotPath

SLACK_PX = 12.0
"""A still head may be found this far off from frame to frame: noise of the mask's tip."""
TURN_S = 10.0
"""In less nobody takes a robot out of a vessel and brings it in from the other side: so long its head is not its tail."""
HEAD_AT_BORDER_S = 0.3
"""A head that has just arrived at the image border is there. One that stays so long may have gone on beyond it for all one sees."""
HEAD_BACK_S = 0.08
"""The end of a mask that runs out of the picture comes and goes with the noise: a head that was there is back once it has been
clear of the border for so long, and not in a single frame."""
WITHIN_PX = 40.0
"""An end so far from the image border is not one that the border has just not been seen to reach."""


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The last path that was believed, and when its frame was captured.

    ``border_s``: since when the robot's mask has met the image border at its head, but for moments; None where it does not.
    ``clear_s``: the first frame of such a moment, while it lasts. ``came_from_within``: the same head was seen well within the
    picture before; one that never was may be an entry at which the robot was not seen to meet the border.
    """

    path: RobotPath
    captured_s: float
    border_s: float | None = None
    clear_s: float | None = None
    came_from_within: bool = False


def recall(memory: Memory | None, captured_s: float, config: TrackingConfig) -> RobotPath | None:
    """The remembered path, if tracking is on and the memory is not too old (or from the future: a stream that was wound back)."""
    if memory is None or not config.enabled:
        return None
    return memory.path if 0.0 <= captured_s - memory.captured_s <= config.memory_s else None


def recall_ends(memory: Memory | None, captured_s: float, config: TrackingConfig) -> RobotPath | None:
    """The remembered path, where it is too old to tell anything but which way the robot lies; None where it tells more, or nothing.

    Frames without an answer, however they come about, must not make the tail the head.
    """
    if memory is None or not config.enabled or not config.memory_s or recall(memory, captured_s, config) is not None:
        return None
    return memory.path if 0.0 <= captured_s - memory.captured_s <= TURN_S else None


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


def remember(path: RobotPath, mask: Mask, memory: Memory | None, captured_s: float, config: PerceptionConfig) -> Memory:
    """A path that was believed, found in the robot's mask (h, w), beside what is remembered of the frames before."""
    goes_on = _goes_on(path, memory, captured_s, config.tracking)
    border_s, clear_s = (memory.border_s, memory.clear_s) if memory is not None and goes_on else (None, None)
    came = _is_within(path.points[-1], mask.shape) or _came_before(path, memory, captured_s, config.tracking)
    if may_go_on_outside(path.points[-1], mask, config.path):
        return Memory(path, captured_s, captured_s if border_s is None else border_s, came_from_within=came)
    clear_s = captured_s if clear_s is None else clear_s
    if border_s is None or captured_s - clear_s >= HEAD_BACK_S:
        return Memory(path, captured_s, came_from_within=came)
    return Memory(path, captured_s, border_s, clear_s, came)


def _is_within(place: Points, shape: tuple[int, ...]) -> bool:
    """Whether a place (2,) is well within a picture of `shape` (h, w)."""
    x, y = float(place[0]), float(place[1])
    return min(x, y, shape[1] - 1 - x, shape[0] - 1 - y) >= WITHIN_PX


def _came_before(path: RobotPath, memory: Memory | None, captured_s: float, config: TrackingConfig) -> bool:
    """Whether the head of a path is the remembered one, wherever it has gone in a gap, and this one came from within."""
    if memory is None or not memory.came_from_within:
        return False
    before = recall_ends(memory, captured_s, config)
    along = before is not None and goes_along_px(path.points, before.points) > ALONG_STEP_PX
    return along or _goes_on(path, memory, captured_s, config)


def _goes_on(path: RobotPath, memory: Memory | None, captured_s: float, config: TrackingConfig) -> bool:
    """Whether what is remembered of the head is true of this path's: it was seen a moment ago, or lies there still after a gap."""
    if recall(memory, captured_s, config) is not None:
        return True
    before = recall_ends(memory, captured_s, config)
    return before is not None and float(np.hypot(*(path.points[-1] - before.points[-1]))) <= STILL_HEAD_PX


def check_in_view(memory: Memory, config: PerceptionConfig) -> Refusal | None:
    """AMBIGUOUS_PATH, when the robot has met the image border at its head for longer than ``HEAD_AT_BORDER_S``.

    Where it does, or did a moment ago, the border is all that is found of the head, however far outside it is. The refused path
    stays the memory: so its head remains the head, and not the tail of a robot that comes in there, and is known again when it
    comes back into view.
    """
    if not config.quality.enabled or memory.border_s is None or memory.captured_s - memory.border_s <= HEAD_AT_BORDER_S:
        return None
    return Refusal(Reason.AMBIGUOUS_PATH, "it reaches the image border at its head, which may be out of view")
