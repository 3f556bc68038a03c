"""From two vectors to the pose: angle, signed distances, crossing, and the state A to D (METHOD sections 5 and 6)."""

from __future__ import annotations

import math
from dataclasses import replace

from core.config.models import PoseConfig
from core.types import Point, Pose, PoseState, Vector


def measure_pose(robot: Vector, vessel: Vector, config: PoseConfig, confidence: float = 1.0) -> Pose:
    """The robot's pose against the vessel's line in its direction of travel, with the state that this one image shows.

    `robot` is the line through the last 40 px, pointing to the head; `confidence` is handed through.
    """
    v, r = vessel.direction, robot.direction
    cross, dot = v[0] * r[1] - v[1] * r[0], v[0] * r[0] + v[1] * r[1]
    theta_signed_deg = math.degrees(math.atan2(cross, dot))
    if theta_signed_deg <= -180.0:  # atan2 gives -180 for a cross product of -0.0; the interval is (-180, 180]
        theta_signed_deg = 180.0
    c_head, c_tail = signed_distance(robot.end, vessel), signed_distance(robot.start, vessel)
    theta_deg = abs(theta_signed_deg)
    return Pose(
        theta_deg=theta_deg,
        theta_signed_deg=theta_signed_deg,
        c_head_px=c_head,
        c_tail_px=c_tail,
        crossed=c_head * c_tail < 0.0,
        state=classify(c_head, c_tail, theta_deg, config),
        confidence=confidence,
    )


def signed_distance(point: Point, line: Vector) -> float:
    """Distance of a point to a directed line, in px; positive to the right of its direction as seen on screen."""
    v, p = line.direction, line.center
    return v[0] * (point[1] - p[1]) - v[1] * (point[0] - p[0])


def classify(
    c_head_px: float, c_tail_px: float, theta_deg: float, config: PoseConfig, current: PoseState | None = None
) -> PoseState:
    """The one state of a pose: signed distances of head and tail to the vessel's line, unsigned angle.

    The paper's four descriptions overlap and leave gaps; tested in the order A, D, B, C every pose has exactly one state. The
    state in force, `current`, is left only when it is contradicted by more than the hysteresis.
    """
    d_head, d_tail = abs(c_head_px), abs(c_tail_px)
    band_px = 0.0 if current is None else config.hysteresis_px
    slack_px, slack_deg = (config.hysteresis_px, config.hysteresis_deg) if current is PoseState.A else (0.0, 0.0)
    if max(d_head, d_tail) < config.d_allow_px + slack_px and theta_deg < config.theta_allow_deg + slack_deg:
        return PoseState.A
    crossed = c_head_px * c_tail_px < 0.0
    if current is PoseState.D:
        crossed = crossed or min(d_head, d_tail) < band_px
    elif current is not None:
        crossed = crossed and min(d_head, d_tail) >= band_px
    if crossed:
        return PoseState.D
    favour_px = {PoseState.B: band_px, PoseState.C: -band_px}.get(current, 0.0) if current is not None else 0.0
    return PoseState.B if d_head < d_tail + favour_px else PoseState.C


def room_px(c_head_px: float, c_tail_px: float, theta_deg: float, config: PoseConfig, length_px: float) -> float:
    """Least displacement of head and tail across the vessel that gives the pose another state; 0 at a threshold.

    Where it is less than the distances can be measured to, the state is undecided, for a person, too. Theta turns as head and
    tail move, which are `length_px` apart; other arguments are those of ``classify``.
    """
    d_head, d_tail = abs(c_head_px), abs(c_tail_px)
    aside, allowed = (math.sin(math.radians(min(angle, 90.0))) for angle in (theta_deg, config.theta_allow_deg))
    beyond_px = 0.5 * length_px * (aside - allowed)  # they move against each other, each by half of it
    to_ideal_px = max(max(d_head, d_tail) - config.d_allow_px, beyond_px)
    if to_ideal_px < 0.0:
        return -to_ideal_px
    to_crossing_px = min(d_head, d_tail)
    if c_head_px * c_tail_px < 0.0:
        return min(to_ideal_px, to_crossing_px)
    return min(to_ideal_px, to_crossing_px, 0.5 * abs(d_head - d_tail))


class StateFilter:
    """Filters the state of a stream with a hysteresis on every threshold and a dwell time, so that the badge does not flicker.

    A state is left once it has been contradicted for ``dwell_s``, to half a frame, by more than two thirds of the frames since, for
    the one seen most often in them (of equals the latest). Where the next frame would come too late, one is enough. A frame without
    a pose resets the filter: no stale state is ever shown.
    """

    def __init__(self, config: PoseConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """The next pose is the first of a stream."""
        self._current: PoseState | None = None
        self._last_s = math.inf
        self._votes: list[tuple[float, PoseState]] = []

    def update(self, pose: Pose | None, captured_s: float) -> Pose | None:
        """The pose with the filtered state; None for None. `captured_s` is the frame's."""
        if pose is None:
            self.reset()
            return None
        shown = classify(pose.c_head_px, pose.c_tail_px, pose.theta_deg, self._config, self._current)
        half_frame_s = 0.5 * max(0.0, captured_s - self._last_s)
        self._last_s = captured_s
        if self._current is None:
            self._current = shown
        elif self._votes or shown is not self._current:
            # Kept are the votes since the first contradiction, for twice the dwell time.
            self._votes.append((captured_s, shown))
            oldest_s = captured_s - 2.0 * self._config.dwell_s
            kept = [vote for vote in self._votes if vote[0] >= oldest_s]
            first = next((place for place, (_, state) in enumerate(kept) if state is not self._current), len(kept))
            self._votes = kept[first:]
            self._decide(captured_s + half_frame_s)
        return replace(pose, state=self._current)

    def _decide(self, until_s: float) -> None:
        against = [state for _, state in self._votes if state is not self._current]
        if 2 * len(against) < len(self._votes):  # it was noise
            self._votes = []
        elif 3 * len(against) > 2 * len(self._votes) and until_s - self._votes[0][0] >= self._config.dwell_s:
            self._current, self._votes = max(reversed(against), key=against.count), []
