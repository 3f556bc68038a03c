"""Data types from the camera's frame to the command that was sent.

All are frozen, and arrays in them are never written. Points are ``(x, y)`` in pixels, x to the right, y down, pixel centres at
integers. Inside the pipeline they are *working* pixels (longer side of the image = 640); ``Scene.to_source`` maps them back.
"Missing" is ``None`` together with a named reason, never NaN.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""RGB image, shape (H, W, 3)."""
Mask = NDArray[np.bool_]
"""Binary mask or skeleton, shape (H, W)."""
Points = NDArray[np.float64]
"""Polyline or point set, shape (N, 2), columns x, y."""
Point = tuple[float, float]
Window = tuple[int, int, int, int]
"""Part of an image: x, y of its upper left pixel, width, height."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One camera image. ``captured_s`` is ``time.monotonic()`` at capture (or simulated time in lock-step).

    ``index`` counts the frames that the camera gave; ``lost`` the frames that never came, by its own count or by its rate, since
    it was opened. ``published_s`` is ``time.monotonic()`` when a bench with a simulated clock gave it; None: ``captured_s``.
    """

    index: int
    captured_s: float
    image: Image
    lost: int = 0
    published_s: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Masks:
    """Cleaned masks and raw probabilities at working resolution, each of shape (h, w); probabilities float32 in 0..1."""

    vessel: Mask
    robot: Mask
    vessel_probability: NDArray[np.float32]
    robot_probability: NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Skeletons:
    """One-pixel skeletons of both masks, shape (h, w). ``bridges`` are the gaps that were joined, as pairs of (x, y) end points."""

    vessel: Mask
    robot: Mask
    bridges: tuple[tuple[Point, Point], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class RobotPath:
    """The robot's centerline ``points`` (N, 2), ordered tail -> head, extended to the mask's edge at the head.

    ``score`` is the weighted score of METHOD section 4; ``runner_up`` that of the best different candidate (None: there was none);
    ``entry_on_border`` tells whether the tail lies at the image border or the insertion port; ``bridged_px`` the length of repaired
    gaps on the path; ``radius_px`` the robot's median radius.
    """

    points: Points
    score: float
    runner_up: float | None
    entry_on_border: bool
    bridged_px: float
    radius_px: float

    @property
    def head(self) -> Point:
        return float(self.points[-1, 0]), float(self.points[-1, 1])

    @property
    def tail(self) -> Point:
        return float(self.points[0, 0]), float(self.points[0, 1])


@dataclass(frozen=True, slots=True, eq=False)
class GraphEdge:
    """A piece of vessel: ``points`` (N, 2) from node ``start`` to node ``end``, with the lumen's ``radius`` (N,)."""

    start: int
    end: int
    points: Points
    radius: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class VesselGraph:
    """Centerlines of a vessel tree (loops allowed): ``nodes`` (K, 2) are junctions and ends, ``edges`` join them.

    Lengths are pixels in perception and millimetres in the twin's phantoms.
    """

    nodes: Points
    edges: tuple[GraphEdge, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """The way along the vessel graph to the operator's target: ``points`` (N, 2) from the robot's place to the target."""

    points: Points
    length_px: float
    target: Point


@dataclass(frozen=True, slots=True, eq=False)
class Centerline:
    """The piece of the vessel's centerline beside the head.

    ``piece`` (N, 2) runs along one path of the vessel graph in the robot's direction of travel; ``nearest`` is the centerline point
    nearest to the head; ``radius_px`` the lumen radius there; ``ambiguity`` 0..1 how nearly another branch fitted as well.
    """

    piece: Points
    nearest: Point
    radius_px: float
    ambiguity: float = 0.0


@dataclass(frozen=True, slots=True)
class Vector:
    """A fitted line, directed from ``start`` to ``end``; ``center`` is its middle."""

    start: Point
    center: Point
    end: Point

    @property
    def direction(self) -> Point:
        """Unit vector from ``start`` to ``end``."""
        dx, dy = self.end[0] - self.start[0], self.end[1] - self.start[1]
        length = float(np.hypot(dx, dy))
        return dx / length, dy / length


class PoseState(StrEnum):
    """The paper's four pose states (METHOD section 6)."""

    A = "A"
    B = "B"
    C = "C"
    D = "D"


class Reason(StrEnum):
    """Why there is no pose. The value is the name in files."""

    UNREADABLE = "unreadable image"
    NO_MODEL = "no model"
    BLACK = "image black"
    WHITE = "image overexposed"
    BLURRED = "image blurred"
    NO_VESSEL = "no vessel"
    NO_ROBOT = "no robot"
    SEVERAL_ROBOTS = "several robots"
    TOO_SHORT = "robot too short"
    OUTSIDE_VESSEL = "robot outside vessel"
    GAP_TOO_LONG = "repaired gap too long"
    AMBIGUOUS_PATH = "robot path ambiguous"
    AMBIGUOUS_BRANCH = "ambiguous branch"
    LOW_CONFIDENCE = "low confidence"
    UNLIKE_TRAINING = "unlike the training data"
    HEAD_JUMP = "head jumped"
    BENCH_MOVED = "camera or phantom moved"
    OTHER_BENCH = "not this bench"


@dataclass(frozen=True, slots=True)
class Refusal:
    """No pose, and why. ``detail`` adds the measured value and its threshold."""

    reason: Reason
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.reason.value}: {self.detail}" if self.detail else self.reason.value


@dataclass(frozen=True, slots=True)
class Pose:
    """The robot's pose against the vessel's centerline (METHOD sections 5 and 6). Distances in working pixels.

    ``c_head`` and ``c_tail`` are the signed distances (positive: right of the vessel's direction as seen on screen);
    ``theta_signed_deg`` in (-180, 180] is positive when the robot points to the right of the vessel's direction.
    """

    theta_deg: float
    theta_signed_deg: float
    c_head_px: float
    c_tail_px: float
    crossed: bool
    state: PoseState
    confidence: float

    @property
    def d_head_px(self) -> float:
        return abs(self.c_head_px)

    @property
    def d_tail_px(self) -> float:
        return abs(self.c_tail_px)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The result of perception for one frame. Exactly one of ``pose`` and ``refusal`` is set.

    ``scale`` is working pixels per source pixel along the longer side, and ``scale_xy`` in x and y, which differ by the rounding to
    whole pixels (None: both are ``scale``); ``source_size`` is (width, height) of the frame. None: a stage was not reached.
    ``latency_ms`` maps stage name to milliseconds, with "total". ``route_problem`` says why there is no way to the target.
    ``window`` is the part of the working image that was perceived again in a stream; None: all of it. ``novelty`` is how far the
    picture is from those that the model knows, 1 at the limit; None: the model was not taught which, or only a window was seen.
    """

    frame_index: int
    captured_s: float
    source_size: tuple[int, int]
    scale: float
    masks: Masks | None = None
    skeletons: Skeletons | None = None
    path: RobotPath | None = None
    vessel_graph: VesselGraph | None = None
    route: Route | None = None
    centerline: Centerline | None = None
    robot_vector: Vector | None = None
    vessel_vector: Vector | None = None
    pose: Pose | None = None
    refusal: Refusal | None = None
    latency_ms: dict[str, float] = field(default_factory=dict)
    evidence: tuple[float, ...] | None = None
    route_problem: str = ""
    scale_xy: tuple[float, float] | None = None
    window: Window | None = None
    novelty: float | None = None

    def points_to_source(self, points: Points) -> Points:
        """Working pixels (N, 2) -> source pixels (N, 2); pixel centres are at integers in both."""
        return np.asarray((points + 0.5) / (self.scale_xy or (self.scale, self.scale)) - 0.5, np.float64)

    def to_source(self, point: Point) -> Point:
        """A point in working pixels -> source pixels."""
        x, y = self.points_to_source(np.array([point]))[0].tolist()
        return x, y

    def to_working(self, point: Point) -> Point:
        """A point in source pixels -> working pixels."""
        across, down = self.scale_xy or (self.scale, self.scale)
        return (point[0] + 0.5) * across - 0.5, (point[1] + 0.5) * down - 0.5


class Speed(StrEnum):
    """The paper's speed words, slowest to fastest."""

    STOP = "stop"
    SLOWEST = "slowest"
    SLOW = "slow"
    MODERATE = "moderate"
    FAST = "fast"


@dataclass(frozen=True, slots=True)
class Advice:
    """Advice to the operator.

    ``steer_deg`` is how far to turn the head, positive = to the robot's right as seen on screen; 0 means no steering. ``speed`` is
    the paper's word and ``advance_mm_s`` its number. ``why`` is one plain sentence. No pose -> no advice (None), never a stale one.
    """

    speed: Speed
    advance_mm_s: float
    steer_deg: float
    why: str


@dataclass(frozen=True, slots=True)
class Command:
    """A command to the robot.

    ``bend`` and ``pitch`` are the head's bend in the image plane and out of it, each -1..1 of the tendons' full pull; positive bend
    = to the robot's right as seen on screen. ``advance_mm_s`` feeds the robot (negative retracts), ``delivery_mm_s`` the catheter
    sheath. ``rotation_deg_s`` turns the shaft where it can be turned, to the left as seen from behind, and keeps the bend.
    """

    bend: float = 0.0
    pitch: float = 0.0
    advance_mm_s: float = 0.0
    delivery_mm_s: float = 0.0
    rotation_deg_s: float = 0.0


@dataclass(frozen=True, slots=True)
class RobotStatus:
    """Measurements of the robot. ``time_s`` on the clock of the frames; tendons in the order of the joints, by default right, left,
    up, down (pull in mm, force in mN). ``rotation_deg`` of the shaft; 0 where it cannot be turned.

    ``wall_contact_n`` is the low-passed sum of wall contact forces, known in the twin only (None on a real rig).
    """

    time_s: float
    insertion_mm: float
    delivery_mm: float
    tendon_pull_mm: tuple[float, ...]
    tendon_force_mn: tuple[float, ...]
    wall_contact_n: float | None = None
    rotation_deg: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """Result of one turn of the engine. ``dropped_frames`` counts since start."""

    frame: Frame
    scene: Scene
    advice: Advice | None
    sent: Command | None
    status: RobotStatus | None
    dropped_frames: int
    frames_per_second: float
