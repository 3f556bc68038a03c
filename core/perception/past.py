"""Streams: all that perception remembers of the frames before."""

from __future__ import annotations

from dataclasses import dataclass

from core.config import TrackingConfig
from core.perception.glance import Glances
from core.perception.lookalikes import Lookalikes
from core.perception.route_memory import RouteMemory
from core.perception.standing_vessel import GATHERING_S, StandingVessel
from core.perception.tracking import Memory, recall, recall_ends
from core.types import Mask, RobotPath


@dataclass(frozen=True, slots=True, eq=False)
class Before:
    """The path of the last frame, or, after a gap, the one that still tells which end is the head; whether that head came to where
    it is from within the picture; and which pixels (h, w) of this frame are known to be no robot."""

    path: RobotPath | None = None
    ends: RobotPath | None = None
    came_from_within: bool = False
    none: Mask | None = None


class Past:
    """What a stream remembers of its frames."""

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self.memory: Memory | None = None
        self.routes = RouteMemory(config)
        self.lookalikes = Lookalikes(config)
        self.glances = Glances(config)
        self.standing = StandingVessel()
        self.unlike = False

    @property
    def refresh_s(self) -> float:
        """The longest time between two whole looks."""
        longest = self._config.refresh_s
        return min(longest, GATHERING_S) if self.standing.is_gathering else longest

    def next_look(self) -> StandingVessel:
        """What earlier whole looks have told of the vessel, ready for another one.

        Only looks that come between windows are turned: one orientation after the other would make the head tremble.
        """
        if self.glances.has_changed:
            self.standing.forget()
        self.standing.begin(is_turned=self.glances.is_due)
        return self.standing

    def recall(self, captured_s: float) -> Before:
        memory, config = self.memory, self._config
        return Before(
            recall(memory, captured_s, config),
            recall_ends(memory, captured_s, config),
            memory is not None and memory.came_from_within,
            self.lookalikes.none,
        )

    def forget(self) -> None:
        self.memory, self.unlike = None, False
        for part in (self.routes, self.lookalikes, self.glances, self.standing):
            part.forget()
