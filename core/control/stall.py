"""Does the head move as it is fed, and how far is it to be taken back? Small memories of the pursuit policy."""

from __future__ import annotations

from dataclasses import dataclass, field

from core.policy_config import PursuitConfig

_FAR_MM = 60.0
"""Farther than this the robot is not taken back for a branch that it missed."""
_RAISE = 1.25
_FORGET_PX = 60.0


class ContactLimit:
    """The contact force above which the robot backs off.

    A long body in a winding vessel leans on the wall wherever its head is: backing off again and again at the same place would get
    it nowhere. So each back-off raises the limit a little, up to the hard one, until the head has come well past that place.
    """

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._limit_n = config.contact_back_off_n
        self._raised_at_px: float | None = None

    def exceeded(self, contact_n: float | None, left_px: float | None) -> bool:
        """Whether to back off; `contact_n` is None where the rig does not know it."""
        if self._raised_at_px is not None and left_px is not None and left_px < self._raised_at_px - _FORGET_PX:
            self._limit_n, self._raised_at_px = self._config.contact_back_off_n, None
        if contact_n is None or contact_n <= self._limit_n:
            return False
        self._limit_n = min(_RAISE * max(contact_n, self._limit_n), self._config.contact_limit_n)
        self._raised_at_px = left_px
        return True


class Stall:
    """Notices that the way left does not shrink although the robot is fed."""

    def __init__(self, config: PursuitConfig) -> None:
        self._config = config
        self._start_px: float | None = None
        self._fed_px = 0.0
        self._watched_s = 0.0

    def update(self, left_px: float | None, speed_mm_s: float, elapsed_s: float) -> bool:
        """Take in one frame; True when there was no progress for the configured time. Without a target it cannot tell."""
        if left_px is None or speed_mm_s <= 0.0:
            self._start_px, self._fed_px, self._watched_s = left_px, 0.0, 0.0
            return False
        if self._start_px is None:
            self._start_px = left_px
        self._fed_px += speed_mm_s * elapsed_s * self._config.pixels_per_mm
        self._watched_s += elapsed_s
        if self._watched_s < self._config.stuck_s:
            return False
        stuck = self._start_px - left_px < self._config.stuck_share * self._fed_px
        self._start_px, self._fed_px, self._watched_s = left_px, 0.0, 0.0
        return stuck


@dataclass(slots=True)
class BackOff:
    """A way back of ``distance_mm``, counted from where the reason for it is gone."""

    why: str
    distance_mm: float
    _cleared_mm: float = field(default=0.0, init=False)
    _moved_mm: float = field(default=0.0, init=False)

    def done(self, still: bool, moved_mm: float) -> bool:
        """Whether it has gone far enough; `still`: the reason for it is still there; `moved_mm`: since the last call."""
        self._moved_mm += max(0.0, moved_mm)
        self._cleared_mm = 0.0 if still else self._cleared_mm + max(0.0, moved_mm)
        return self._cleared_mm >= self.distance_mm or self._moved_mm >= _FAR_MM
