"""Streams: what perception remembers of the frames before (METHOD section 4).

``TrackedPath``: the last believed path, with which a head cannot jump, and a head that may have left the picture is refused.
``RouteMemory``: a route that was found holds over a short gap in the vessel.
``StaticArtefacts``: text, reflections and scratches that are segmented as robot and stay in place while the robot's end moves on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core import geometry
from core.bench.registration import BenchView
from core.config.models import PerceptionConfig, TrackingConfig
from core.messages import message
from core.perception.head_tail import ALONG_STEP_PX, STILL_HEAD_PX, PreviousPath, goes_along_px, may_go_on_outside
from core.perception.pose import StateFilter
from core.perception.roi import GATHERING_S, RoiSelector, VesselAverage, cells_of, has_changed
from core.perception.segmentation import inner_area
from core.perception.vectors import project
from core.types import Image, Mask, Point, Points, Reason, Refusal, RobotPath, Route, Window

SLACK_PX = 12.0
"""A still head may be found this far off from frame to frame: noise of the mask's tip."""
TURN_S = 10.0
"""In less time a robot cannot be taken out of a vessel and brought in from the other side: its head is not its tail."""
HEAD_AT_BORDER_S = 0.3
"""A head that has just arrived at the image border is there. After this time it may have gone on beyond the border."""
HEAD_BACK_S = 0.08
"""The end of a mask that leaves the picture flickers with the noise: its head is back once it has been clear of the border for this
long, and not in a single frame."""
WITHIN_PX = 40.0
"""An end this far from the image border is well within the picture."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedPath:
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


def recall(tracked: TrackedPath | None, captured_s: float, config: TrackingConfig) -> PreviousPath:
    """What the tracked path says of a frame captured at `captured_s`; nothing where tracking is off or a stream was wound back.

    A path older than ``memory_s`` still says which end is the head: frames without an answer must not make the tail the head.
    """
    if tracked is None or not config.enabled:
        return PreviousPath()
    age_s = captured_s - tracked.captured_s
    if 0.0 <= age_s <= config.memory_s:
        return PreviousPath(tracked.path, None, tracked.came_from_within)
    if config.memory_s and 0.0 <= age_s <= TURN_S:
        return PreviousPath(None, tracked.path, tracked.came_from_within)
    return PreviousPath()


def check_jump(path: RobotPath, tracked: TrackedPath | None, captured_s: float, config: TrackingConfig) -> Refusal | None:
    """HEAD_JUMP, when the head is further from its last place than the robot can have moved.

    The refused path must not be tracked: then a wrong one is lost with the next frame, and a right one is accepted as soon as the
    tracked path is too old.
    """
    before = recall(tracked, captured_s, config).path
    if before is None or tracked is None:
        return None
    jump_px = float(np.hypot(path.head[0] - before.head[0], path.head[1] - before.head[1]))
    limit_px = config.max_head_speed_px_s * (captured_s - tracked.captured_s) + SLACK_PX
    if jump_px <= limit_px:
        return None
    return Refusal(Reason.HEAD_JUMP, message("{a:.0f} px since the last frame (at most {b:.0f} px)", a=jump_px, b=limit_px))


def track(path: RobotPath, mask: Mask, tracked: TrackedPath | None, captured_s: float, config: PerceptionConfig) -> TrackedPath:
    """Track a path that was believed, found in the robot's mask (h, w)."""
    before = recall(tracked, captured_s, config.tracking)
    # The head is the tracked one if it was seen a moment ago, or lies there still after a gap.
    is_same_head = before.path is not None or (
        before.before_gap is not None and float(np.hypot(*(path.points[-1] - before.before_gap.points[-1]))) <= STILL_HEAD_PX
    )
    border_s, clear_s = (tracked.border_s, tracked.clear_s) if tracked is not None and is_same_head else (None, None)
    x, y = float(path.points[-1][0]), float(path.points[-1][1])
    came = min(x, y, mask.shape[1] - 1 - x, mask.shape[0] - 1 - y) >= WITHIN_PX
    if not came and tracked is not None and tracked.came_from_within:
        along = before.before_gap is not None and goes_along_px(path.points, before.before_gap.points) > ALONG_STEP_PX
        came = along or is_same_head
    if may_go_on_outside(path.points[-1], mask, config.path):
        return TrackedPath(path, captured_s, captured_s if border_s is None else border_s, came_from_within=came)
    clear_s = captured_s if clear_s is None else clear_s
    if border_s is None or captured_s - clear_s >= HEAD_BACK_S:
        return TrackedPath(path, captured_s, came_from_within=came)
    return TrackedPath(path, captured_s, border_s, clear_s, came)


def check_in_view(tracked: TrackedPath, config: PerceptionConfig) -> Refusal | None:
    """AMBIGUOUS_PATH, when the robot has met the image border at its head for longer than ``HEAD_AT_BORDER_S``.

    Then the head may be outside. The refused path stays tracked: its head remains the head, and not the tail of a robot that comes
    in there, and is recognised when it comes back into view.
    """
    if not config.quality.enabled or tracked.border_s is None or tracked.captured_s - tracked.border_s <= HEAD_AT_BORDER_S:
        return None
    return Refusal(Reason.AMBIGUOUS_PATH, "it reaches the image border at its head, which may be out of view")


_STEP_PX = 1.0
_ALIKE_STEP_PX = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class _FoundRoute:
    """A route as it was found last, and since when it has been found."""

    route: Route
    since_s: float
    last_s: float


class RouteMemory:
    """The last route that was found, for as long as the target stays the same.

    A fitting or a reflection can cut the mask of the vessel in two, in one frame and not in the next, or join two vessels. The
    known route still holds if it has lasted for ``memory_s``, the head is beside it, and the vessel is still where it leads, but
    for a short gap. Another route, longer or shorter, is taken once it has lasted as long. A frame that was not believed changes
    nothing (``settle``): its route began at a head that was somewhere else."""

    def __init__(self, config: TrackingConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Another stream, or no target any more."""
        self._known: _FoundRoute | None = None
        self._other: _FoundRoute | None = None
        self._settled: tuple[_FoundRoute | None, _FoundRoute | None] = (None, None)

    def settle(self, *, is_believed: bool) -> None:
        """End a frame, with or without ``update``: keep what it found, or what was known before it."""
        if not is_believed:
            self._known, self._other = self._settled
        self._settled = self._known, self._other

    def update(self, found: Route | str, head: Point, target: Point, vessel: Mask, captured_s: float) -> Route | str:
        """The route that was found, or the rest of the known one, or the reason for none.

        `found` is what ``route_or_reason`` says of this frame, `vessel` the mask (h, w), all in working px.
        """
        rest, known = self._rest(head, target, vessel), self._known
        is_lasting = known is not None and self._has_lasted(known)
        if not isinstance(found, Route):
            return rest if rest is not None and is_lasting else found
        if known is None or rest is None:
            self._known, self._other = _FoundRoute(found, captured_s, captured_s), None
            return found
        if not is_lasting or self._are_alike(rest, found):
            self._known, self._other = self._found_again(known, rest, found, captured_s), None
            return found
        # Round a loop there is another way when this one is cut, and a short one where two vessels seem to touch: for a moment.
        other = self._other
        if other is not None:
            self._other = self._found_again(other, other.route, found, captured_s)
        else:
            self._other = _FoundRoute(found, captured_s, captured_s)
        if not self._has_lasted(self._other):
            return rest
        self._known, self._other = self._other, None
        return found

    def _has_lasted(self, found: _FoundRoute) -> bool:
        return found.last_s - found.since_s >= self._config.memory_s

    def _are_alike(self, one: Route, other: Route) -> bool:
        """Whether the other route is as long, and nowhere far from the one: round a loop both ways may be as long."""
        if abs(one.length_px - other.length_px) > self._config.route_gap_px:
            return False
        along = geometry.arc_length(one.points)
        places = geometry.resample(other.points, _ALIKE_STEP_PX).tolist()
        return all(geometry.nearest(one.points, (x, y), along)[0] <= self._config.route_reach_px for x, y in places)

    def _found_again(self, before: _FoundRoute, rest: Route, found: Route, captured_s: float) -> _FoundRoute:
        """A route found after `before`, of which `rest` is left: if they are alike, it has been found for as long."""
        goes_on = self._has_lasted(before) or 0.0 <= captured_s - before.last_s <= self._config.memory_s
        is_same = goes_on and self._are_alike(rest, found)
        return _FoundRoute(found, before.since_s if is_same else captured_s, captured_s)

    def _rest(self, head: Point, target: Point, vessel: Mask) -> Route | None:
        """The rest of the known route from the head on, if it still holds."""
        if self._known is None or self._known.route.target != target:
            self.reset()
            return None
        known = self._known.route
        beside = project(known.points, head, vessel)
        if beside is None:
            return None
        away_px, position, _ = beside
        rest = geometry.cut(known.points, position, math.inf)
        if away_px > self._config.route_reach_px or _outside_px(rest, vessel) > self._config.route_gap_px:
            return None
        distinct = np.concatenate([[True], np.any(np.diff(rest, axis=0) != 0.0, axis=1)])
        return Route(rest[distinct], float(geometry.arc_length(rest)[-1]), target)


def _outside_px(points: Points, vessel: Mask) -> float:
    """Length of a line that lies outside a mask."""
    line = np.rint(geometry.resample(points, _STEP_PX)).astype(int)
    height, width = vessel.shape
    within = (line[:, 0] >= 0) & (line[:, 0] < width) & (line[:, 1] >= 0) & (line[:, 1] < height)
    inside = vessel[line[within, 1], line[within, 0]]
    return _STEP_PX * float(len(line) - np.count_nonzero(inside))


_EDGE_PX = 2
"""The edge of a component flickers with the noise by this much."""
_ELLIPSE = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _EDGE_PX + 1, 2 * _EDGE_PX + 1))
_MAX_SHARE = 0.3
"""Of the largest component's pixels. A larger one is another robot or a part of this one, which the quality gate judges."""
_MAX_COMPONENTS = 10
"""A mask of more components is noise."""
_HELD_S = 20.0
"""A component not seen apart for this long is forgotten, and so is that there was robot."""
_SAME_LEVELS = 14.0
"""Grey levels of 255, on the mean over a neighbourhood as wide as a robot: noise of 20 levels stays below, a robot does not."""
_AROUND_PX = 7
_RENEWED_S = 0.3
"""Time constant with which the remembered picture follows a light that changes slowly."""
_CHECK_S, _COMPARED_S = 0.1, 0.5
"""Interval of comparing the whole picture, and greatest age of the one it is compared with: it takes as long as all else here."""


class StaticArtefacts:
    """Working pixels (h, w) that are segmented as robot and are not.

    An artefact stays in place while the robot's end moves on. A part of the robot that a fitting separates from the rest does not:
    it moves with the robot, while the visible end stays at the fitting. A known artefact must not become robot when the robot comes
    near and the gap to it can be bridged, or when it touches it; it is robot where the picture has changed since."""

    def __init__(self, config: TrackingConfig) -> None:
        self._travel_px, self._memory_s = config.lookalike_px, config.memory_s
        self._begin((0, 0))

    def _begin(self, shape: tuple[int, ...]) -> None:
        self._last_s = -math.inf
        self.removed: Mask | None = None
        """What the last ``remove`` took out of the mask (h, w); None for nothing."""
        self._end: tuple[Point, float] | None = None
        self._components: list[_Component] = []
        self._checked_s = -math.inf
        self._cells: tuple[NDArray[np.float32], float] | None = None
        self._known: Mask = np.zeros(shape, np.bool_)
        self._seen_s: NDArray[np.float64] = np.full(shape, -np.inf)
        self._robot_s: NDArray[np.float64] = np.full(shape, -np.inf)
        self._ends: NDArray[np.float32] = np.zeros((*shape, 2), np.float32)  # the robot's, when the pixel was first seen
        self._picture: NDArray[np.float32] = np.zeros((*shape, 3), np.float32)

    def distrust(self) -> None:
        """The robot's end has jumped: what has stayed beside it until now must stay again.

        Known artefacts stay known for as long as the picture there does not change.
        """
        self._end = None
        self._seen_s[~self._known] = -math.inf

    def remove(self, robot: Mask, image: Image, captured_s: float, window: Window | None = None) -> Mask:
        """The robot's mask (h, w) of the next frame without artefacts; the same object if nothing was removed.

        The `window` (x, y, width, height) was segmented; None: all of the picture (h, w, 3).
        """
        self.removed = None
        if self._travel_px == 0.0:
            return robot
        is_rewound = captured_s < self._last_s
        if self._known.shape != robot.shape or is_rewound or self._has_moved(image, captured_s):
            self._begin(robot.shape)
        self._last_s = captured_s
        components = _components_of(robot)
        self._components, left = self._without_known(components, robot, image, captured_s)
        for component in self._components:  # what was robot is robot for as long as it is seen there
            if self._was_robot(component, captured_s):
                self._robot_s[component.box][component.mask] = captured_s
        self._observe(self._separate(components, captured_s, window), image, captured_s)
        if left is not robot:
            self.removed = robot & ~left
        return left

    def learn(self, path: RobotPath, captured_s: float) -> None:
        """The path found in the mask of the last ``remove`` was believed."""
        if self._travel_px == 0.0:
            return
        places = [(component, _places_on(path.points, component)) for component in self._components]
        on_path = sorted(((at, component) for component, at in places if len(at)), key=lambda pair: int(pair[0][0]))
        for _, component in on_path:
            self._robot_s[component.box][component.mask] = captured_s
        if on_path:  # the end of the first component: beyond a gap may lie the tip, or an artefact
            x, y = path.points[on_path[0][0][-1]].tolist()
            self._end = (x, y), captured_s

    def _has_moved(self, image: Image, captured_s: float) -> bool:
        """Whether the whole picture differs from the one a moment ago: then nothing lies where it lay."""
        if captured_s - self._checked_s < _CHECK_S:
            return False
        self._checked_s = captured_s
        cells, before = cells_of(image), self._cells
        if before is None or captured_s - before[1] >= _COMPARED_S:
            self._cells = cells, captured_s
        return before is not None and has_changed(before[0], cells, (0, 0, 0, 0))

    def _was_robot(self, component: _Component, captured_s: float) -> bool:
        return bool(np.any(captured_s - self._robot_s[component.box][component.mask] < _HELD_S))

    def _separate(self, components: list[_Component], captured_s: float, window: Window | None) -> list[_Component]:
        """Small components that were segmented and touch neither the robot nor the image border."""
        if len(components) > _MAX_COMPONENTS:
            return []
        most = _MAX_SHARE * max((component.area for component in components), default=0)
        height, width = self._known.shape
        seen = inner_area(window, (width, height)) if window is not None else (slice(0, height), slice(0, width))
        return [
            component
            for component in components
            if component.area <= most
            and not component.touches_border(width, height)
            and all(part.start >= all_.start and part.stop <= all_.stop for part, all_ in zip(component.box, seen, strict=True))
            and not self._was_robot(component, captured_s)
        ]

    def _observe(self, components: list[_Component], image: Image, captured_s: float) -> None:
        """Remember where components lie and what they look like; those beside which the robot's end has moved on become known."""
        if self._end is None or captured_s - self._end[1] > self._memory_s:
            return
        end = np.array(self._end[0], np.float32)
        for component in components:
            box, mask = component.widened(self._known.shape)
            seen_s, ends, known = self._seen_s[box], self._ends[box], self._known[box]
            now, picture = image[box], self._picture[box]
            passed_s = captured_s - seen_s
            held = mask & (passed_s < _HELD_S)
            is_old = held & _looks_alike(now, picture, held)
            is_new = mask & ~is_old  # also where something else lies now
            ends[is_new] = end
            known[is_new] = False
            renewed = np.where(is_old, 1.0 - np.exp(-np.minimum(passed_s, _HELD_S) / _RENEWED_S), 1.0)[mask]
            picture[mask] += renewed[:, None] * (now[mask] - picture[mask])
            seen_s[mask] = captured_s
            known |= mask & (np.hypot(ends[..., 0] - end[0], ends[..., 1] - end[1]) >= self._travel_px)

    def _without_known(
        self, components: list[_Component], robot: Mask, image: Image, captured_s: float
    ) -> tuple[list[_Component], Mask]:
        """The components without known artefacts that look as before, and the mask of them."""
        left, kept = robot, list[_Component]()
        for component in components:
            artefact = self._artefact_in(component, image, captured_s)
            if artefact is None:
                kept.append(component)
                continue
            if left is robot:
                left = robot.copy()
            left[component.box] &= ~artefact
            kept += _components_of(component.mask & ~artefact, component.x, component.y)
        return kept, left

    def _artefact_in(self, component: _Component, image: Image, captured_s: float) -> Mask | None:
        """A component's known pixels, within its box, with their edge; None if no pixel is known.

        Where the robot has reached something of its own colour the two cannot be told apart: there all is robot.
        """
        box = component.box
        known = self._known[box] & (captured_s - self._seen_s[box] < _HELD_S)
        found = known & component.mask
        if not found.any():
            return None
        now, picture = image[box], self._picture[box]
        found &= _looks_alike(now, picture, known)
        others = component.mask & ~known
        if np.count_nonzero(others) > np.count_nonzero(component.mask & known):
            colour = now[others].mean(axis=0)
            found &= ~_looks_alike(np.broadcast_to(colour, picture.shape), picture, known, 2.0 * _SAME_LEVELS)
        if not found.any():
            return None
        return (cv2.dilate(found.view(np.uint8), _ELLIPSE, iterations=2) > 0) & component.mask


def _looks_alike(now: NDArray[Any], before: NDArray[np.float32], where: Mask, levels: float = _SAME_LEVELS) -> Mask:
    """Where two pictures (h, w, 3) are the same within `levels`, by the mean over those pixels around that `where` holds."""
    weight = where.astype(np.float32)
    difference = np.abs(now - before).mean(axis=2, dtype=np.float32) * weight
    around = (_AROUND_PX, _AROUND_PX)
    return np.asarray(cv2.blur(difference, around) < levels * cv2.blur(weight, around))


@dataclass(frozen=True, slots=True, eq=False)
class _Component:
    """An 8-connected component of a mask: its pixels within its box."""

    x: int
    y: int
    mask: Mask
    area: int

    @property
    def box(self) -> tuple[slice, slice]:
        height, width = self.mask.shape
        return slice(self.y, self.y + height), slice(self.x, self.x + width)

    def touches_border(self, width: int, height: int) -> bool:
        rows, columns = self.box
        return bool(rows.start == 0 or columns.start == 0 or rows.stop == height or columns.stop == width)

    def widened(self, shape: tuple[int, ...]) -> tuple[tuple[slice, slice], Mask]:
        """The component with its edge, cut off at the borders of a picture of `shape` (h, w)."""
        mask = cv2.dilate(np.pad(self.mask, _EDGE_PX).view(np.uint8), _ELLIPSE).view(np.bool_)
        height, width = mask.shape
        x, y = self.x - _EDGE_PX, self.y - _EDGE_PX
        left, top = max(0, -x), max(0, -y)
        right, bottom = min(width, shape[1] - x), min(height, shape[0] - y)
        return (slice(y + top, y + bottom), slice(x + left, x + right)), mask[top:bottom, left:right]


def _components_of(mask: Mask, x0: int = 0, y0: int = 0) -> list[_Component]:
    """The components of a mask whose first pixel lies at (`x0`, `y0`)."""
    left, top, across, down = cv2.boundingRect(mask.view(np.uint8))
    within = np.ascontiguousarray(mask[top : top + down, left : left + across]).view(np.uint8)
    if not within.size:
        return []
    # Short labels in the mask's own box: a quarter of the time.
    count, labels, stats, _ = cv2.connectedComponentsWithStats(within, connectivity=8, ltype=cv2.CV_16U)
    components = []
    for label in range(1, count):
        x, y, width, height, area = stats[label].tolist()
        components.append(_Component(x0 + left + x, y0 + top + y, labels[y : y + height, x : x + width] == label, area))
    return components


def _places_on(points: Points, component: _Component) -> NDArray[np.intp]:
    """Which points of a path (N, 2) lie in a component."""
    columns, rows = np.rint(points).T.astype(np.intp)
    height, width = component.mask.shape
    x, y = columns - component.x, rows - component.y
    within = np.flatnonzero((x >= 0) & (x < width) & (y >= 0) & (y < height))
    return np.asarray(within[component.mask[y[within], x[within]]], np.intp)


class StreamState:
    """All that a stream remembers of its frames. It is mutable: copying its maps in every frame would take time."""

    def __init__(self, config: PerceptionConfig) -> None:
        self._refresh_s = config.tracking.refresh_s
        self.shape: tuple[int, ...] | None = None
        """Of the frames (h, w, 3)."""
        self.tracked: TrackedPath | None = None
        self.routes = RouteMemory(config.tracking)
        self.artefacts = StaticArtefacts(config.tracking)
        self.roi = RoiSelector(config.tracking)
        self.vessel_average = VesselAverage()
        self.pose_filter = StateFilter(config.pose)
        self.view: BenchView | None = None
        """Where the bench was in the last full frame."""
        self.is_unfamiliar = False
        """Whether the last full frame was of a kind that the model does not know."""

    @property
    def refresh_s(self) -> float:
        """The longest time between two full frames."""
        return min(self._refresh_s, GATHERING_S) if self.vessel_average.is_gathering else self._refresh_s

    def begin_full_frame(self) -> VesselAverage:
        """The vessel average, ready for another full frame.

        Only full frames that come between windows are turned: one orientation after the other would make the head tremble.
        """
        if self.roi.has_changed:
            self.vessel_average.reset()
        self.vessel_average.begin(is_turned=self.roi.is_due)
        return self.vessel_average
