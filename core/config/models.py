"""The whole configuration as validated sections, and how it is loaded.

Layers, later ones win: ``resources/config/default.toml``, then a preset (``resources/config/preset_<name>.toml``), then the user's
file. Every setting has a unit in its name and an allowed range here, which the settings window and the error messages show; a wrong
file is one clear line. Pixels are working pixels. Times that safety depends on may be tightened only.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

import platformdirs
from pydantic import BaseModel, Field, ValidationError, field_validator, model_validator

from core.config.calibration import BehaviourConfig
from core.config.safety import SafetyConfig, ServosConfig
from core.config.section import ConfigSection, ignored, plain_message
from core.devices import UserError, disk_errors
from core.plugins import PluginKind


class CameraConfig(ConfigSection):
    """A real camera. Where it has no such setting, what is asked for is left out, and ``doctor`` says so."""

    serial: str | None = Field(None, min_length=1, description="RealSense, Basler: its serial number; empty: the only one there is")
    device: str | None = Field(
        None, min_length=1, description="webcam: its stable path in /dev/v4l/by-id, or its number; empty: the first one"
    )
    width_px: int = Field(640, ge=160, le=4096, description="of the pictures")
    height_px: int = Field(480, ge=120, le=4096, description="of the pictures")
    frames_per_second: int = Field(30, ge=5, le=240, description="that the camera is asked for")
    pixel_format: str = Field("MJPG", pattern="^[A-Z0-9]{4}$", description="webcam: FOURCC; MJPG is what USB 2 has the room for")
    exposure_ms: float | None = Field(None, gt=0.0, le=1000.0, description="empty: automatic, but never at the cost of frames")
    gain: float | None = Field(None, ge=0.0, le=65535.0, description="in the camera's own steps; empty: as it is")
    white_balance_k: int | None = Field(None, ge=2000, le=10_000, description="colour temperature; empty: automatic")
    lost_after_s: float = Field(0.4, ge=0.1, le=0.5, description="no frame for so long: the camera counts as lost")
    reconnect_s: float = Field(0.5, ge=0.1, le=30.0, description="pause between two attempts to open a lost camera")


class GamepadConfig(ConfigSection):
    """Sticks and buttons that drive by hand. Which does what: docs/bench.md."""

    enabled: bool = Field(True, description="false = gamepads are left alone")
    device: str | None = Field(None, min_length=1, description="path in /dev/input; empty: the first gamepad that is plugged in")
    dead_zone: float = Field(0.15, ge=0.02, le=0.5, description="share of a stick's or trigger's way that counts as rest")
    expo: float = Field(0.5, ge=0.0, le=1.0, description="0 = linear, 1 = cubic: finer near the middle")
    deadman: bool = Field(False, description="right shoulder button as deadman; for wired gamepads only")


_SILENCE_S = 0.06
"""Longest pause between two reports (sent every 20 ms) that is no interruption: the foot need not be lifted after it."""


class PedalConfig(ConfigSection):
    """Foot pedal: deadman and STOP over a serial line. Wiring: docs/bench.md."""

    port: str | None = Field(None, min_length=1, description="stable path in /dev/serial/by-id; empty: no pedal")
    baud: int = Field(115_200, ge=9600, le=1_000_000, description="speed of the line")
    silence_s: float = Field(0.06, ge=0.03, le=_SILENCE_S, description="no report for so long: the deadman counts as released")
    press_reports: int = Field(
        2, ge=2, le=10, description="whole reports in a row that make a press; one makes a release, or a STOP"
    )
    resume_s: float = Field(
        0.5, ge=_SILENCE_S, le=0.5, description="after a longer interruption the foot must be lifted before a press counts again"
    )
    reconnect_s: float = Field(0.5, ge=0.05, le=10.0, description="pause between two attempts to open the port")


POLICIES = PluginKind("policies", ("pursuit", "table", "push", "random"), ("__call__", "reset"))
"""Policies; a plugin's entry point is called with configuration and seed (``core/control/policies.py``)."""
PolicyName = Annotated[str, POLICIES]
RECORDED = ("video_file", "image_folder")
"""Kinds of ``rig.camera`` that are no camera."""
CAMERAS = PluginKind("cameras", ("twin", "realsense", "webcam", "basler", *RECORDED), ("open", "read", "close"))
"""Kinds of cameras; a plugin's entry point is called with the camera's settings (``hardware/cameras/registry.py``)."""
CameraName = Annotated[str, CAMERAS]


class PursuitConfig(ConfigSection):
    """Look-ahead along the route."""

    _ignored = ignored(
        *("contact_slow_n", "lean_mm", "contact_back_off_n", "contact_limit_n", "wall_share", "follow_arc", "min_bend_radius_px")
    )
    pixels_per_mm: float = Field(3.0, gt=0.1, le=50.0, description="of the view, roughly; a calibrated rig has its own scale")
    look_ahead_px: float = Field(10.0, ge=4.0, le=200.0, description="distance of the look-ahead point from a resting head")
    look_ahead_s: float = Field(0.15, ge=0.0, le=5.0, description="so much way at the present speed is added to it")
    rounding_px: float = Field(8.0, ge=0.0, le=100.0, description="added to the rounding of a branch's corner after each miss")
    heading_px: float = Field(16.0, ge=4.0, le=100.0, description="end of the robot whose direction is the head's")
    gain: float = Field(1.0, gt=0.0, le=5.0, description="degrees of steering per degree of error")
    smoothing_s: float = Field(0.08, ge=0.0, le=1.0, description="time constant of the steering's low-pass")
    preview_px: float = Field(50.0, ge=5.0, le=400.0, description="bends and bifurcations so far ahead slow the robot down")
    brake_px: float = Field(16.0, ge=5.0, le=400.0, description="way left at which it begins to slow down for the target")
    gentle_turn_deg: float = Field(25.0, gt=0.0, le=180.0, description="turn within the preview that still allows full speed")
    slow_steer_deg: float = Field(20.0, gt=0.0, le=180.0, description="missing turn above which the robot goes slow")
    stuck_s: float = Field(1.5, ge=0.2, le=20.0, description="no progress for so long: back off")
    stuck_share: float = Field(0.2, ge=0.0, le=1.0, description="progress below this share of what was advised is none")
    back_off_mm: float = Field(4.0, gt=0.0, le=50.0, description="way back when stuck, at least")
    behind_s: float = Field(0.3, ge=0.0, le=5.0, description="the way must have lain behind the head for so long to back off")
    retry_mm: float = Field(9.0, gt=0.0, le=50.0, description="way back from where a missed branch lies beside the head")
    arrive_px: float = Field(8.0, ge=1.0, le=100.0, description="way left at which the target counts as reached")
    most_misses: int = Field(2, ge=1, le=100, description="after missing a branch so often it gives up and stops")
    most_tries: int = Field(4, ge=1, le=100, description="backed off so often without coming farther: it gives up and stops")

    @model_validator(mode="after")
    def _check_limits(self) -> Self:
        if self.brake_px <= self.arrive_px:
            raise ValueError("brake_px must be above arrive_px, or it would never brake")
        return self


class DriveConfig(ConfigSection):
    """From advice to the tendons' bend and the feed."""

    turn_deg: float = Field(94.0, gt=1.0, le=720.0, description="by how much the head turns at a bend of 1")
    proportional: float = Field(0.3, ge=0.0, le=5.0, description="share of the advised turn that is made at once")
    integral_s: float = Field(0.3, ge=0.02, le=60.0, description="time in which the advised turn is made, if advice stays the same")
    max_bend_rate_per_s: float = Field(1.5, gt=0.0, le=20.0, description="share of the tendons' full pull per second, at most")
    max_acceleration_mm_s2: float = Field(30.0, gt=0.0, le=1000.0, description="of the feed")
    max_gap_s: float = Field(0.1, gt=0.0, le=0.5, description="a longer pause between two commands counts as so much")


class JogConfig(ConfigSection):
    """Driving by hand: speeds at full deflection of a key or a stick."""

    bend_rate_per_s: float = Field(1.2, gt=0.0, le=5.0, description="share of the tendons' full pull per second")
    advance_mm_s: float = Field(10.0, gt=0.0, le=20.0, description="of the robot module")
    delivery_mm_s: float = Field(10.0, gt=0.0, le=20.0, description="of the catheter")
    rotation_deg_s: float = Field(30.0, gt=0.0, le=90.0, description="of the shaft, where it can be turned")


class PolicyConfig(ConfigSection):
    """Who advises, and drives when handed over to."""

    name: PolicyName = Field("pursuit", description="table = the paper's; push and random are baselines of trial")
    pursuit: PursuitConfig = PursuitConfig()
    drive: DriveConfig = DriveConfig()


GOP_FRAMES = 30
"""Pictures between two key frames; bounds what a damaged place costs and how long a seek takes."""


class RecordConfig(ConfigSection):
    """How sessions are recorded."""

    folder: str | None = Field(None, min_length=1, description="where sessions go; empty: LumenPilot in Videos")
    codec: Literal["lossy", "lossless"] = Field("lossy", description="lossless keeps every pixel, at a hundred times the size")
    quality_crf: int = Field(21, ge=0, le=40, description="of the lossy video; smaller is better and larger")
    max_mbit_s: float = Field(2.4, ge=0.2, le=100.0, description="upper end of the lossy video at 640x480; grows with the picture")
    masks: bool = Field(True, description="also keep the outlines of both masks and the vessel's centerlines, for the player")
    split_s: float = Field(3600.0, ge=1.0, le=86_400.0, description="a new video file after so long")
    sync_s: float = Field(2.0, ge=0.0, le=60.0, description="how often the files are forced to the disk; 0 = left to the system")
    max_queue: int = Field(60, ge=1, le=1000, description="frames waiting for the recorder; more are dropped and counted")
    ring_s: float = Field(30.0, ge=0.0, le=600.0, description="what 'save the last seconds' keeps in memory; 0 = off")
    ring_mb: float = Field(96.0, ge=1.0, le=4096.0, description="and its upper end")
    warn_free_mb: float = Field(500.0, ge=0.0, le=1e6, description="less free disk warns")
    warn_free_share: float = Field(0.07, ge=0.0, le=1.0, description="less free disk, as a share of it, warns")
    stop_free_mb: float = Field(40.0, ge=0.0, le=1e6, description="less free disk ends the recording while it can still be closed")


def sessions_folder(configured: str | None) -> Path:
    """Where sessions go: the configured folder, else LumenPilot in the user's videos."""
    return Path(configured).expanduser() if configured else Path(platformdirs.user_videos_dir()) / "LumenPilot"


RESOURCES = Path(__file__).resolve().parents[2] / "resources"

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class ConfigError(UserError):
    """The configuration cannot be used; the message names file, key and allowed range in one line."""


class SegmentationConfig(ConfigSection):
    """The network and its thresholds (METHOD section 1)."""

    model: str = Field("default", min_length=1, description="model folder in resources/models, or a path")
    device: Literal["auto", "openvino", "torch"] = Field("auto", description="inference engine")
    precision: Literal["auto", "int8", "fp32"] = Field("auto", description="of OpenVINO; auto = int8 where the model has it")
    threads: int = Field(0, ge=0, le=64, description="CPU threads; 0 = all cores")
    mirrored: Literal["pictures", "always", "never"] = Field(
        "pictures", description="average over a picture's eight orientations: of single pictures, always, never"
    )
    second_look: bool = Field(True, description="look again, closely, at the robot's ends, where the model has a network for it")
    vessel_threshold: float = Field(0.5, gt=0.0, lt=1.0, description="probability from which on a pixel is vessel")
    robot_threshold: float = Field(0.5, gt=0.0, lt=1.0, description="probability from which on a pixel is robot")


class CleaningConfig(ConfigSection):
    """Mask cleaning and thinning (METHOD section 2)."""

    min_vessel_area_px: int = Field(400, ge=0, le=100_000, description="smaller pieces of vessel are dropped")
    min_robot_area_px: int = Field(40, ge=0, le=100_000, description="smaller pieces of robot are dropped")
    max_hole_area_px: int = Field(150, ge=0, le=100_000, description="holes up to this size are filled, in both masks")
    prune_spurs: bool = Field(True, description="drop vessel spurs shorter than the local lumen radius")
    extend_ends: bool = Field(True, description="lead ends on as they run, to the edge of mask or image")
    rebuild_junctions: bool = Field(
        True, description="lead vessel branches into their trunk as their walls run, not as the skeleton"
    )
    half_size_thinning: bool = Field(True, description="thin the vessel on every second pixel: faster, same topology")


class GapConfig(ConfigSection):
    """Gap repair of the robot's skeleton (METHOD section 3)."""

    rule: Literal["components", "every_pair"] = Field("components", description="every_pair = the paper's Algorithm 1, literally")
    gap_threshold_px: float = Field(40.0, ge=0.0, le=300.0, description="ends nearer to each other than this may be joined")
    max_turn_deg: float = Field(
        50.0, ge=0.0, le=180.0, description="largest turn that joining two ends may make; not used by every_pair"
    )


class PathConfig(ConfigSection):
    """Choice of the robot's path among candidates (METHOD section 4)."""

    weight_length: float = Field(-0.2, ge=-10.0, le=10.0, description="of a candidate's length; negative prefers the shorter")
    weight_smoothness: float = Field(1.0, ge=-10.0, le=10.0, description="of how little a candidate turns at its points")
    weight_consistency: float = Field(0.5, ge=-10.0, le=10.0, description="of how well its steps go from start to end")
    step_px: float = Field(8.0, ge=1.0, le=50.0, description="distance over which directions are taken")
    cosine: Literal["signed", "absolute"] = Field("signed", description="absolute = the paper's |cos|, blind to hairpins")
    min_length_px: float = Field(12.0, ge=2.0, le=500.0, description="shorter candidates are no robot")
    border_px: float = Field(6.0, ge=0.0, le=100.0, description="an end this near to the image border counts as the entry")
    port_px: float = Field(25.0, ge=0.0, le=300.0, description="an end this near to the insertion port counts as the entry")
    port_x_share: float | None = Field(
        None, ge=0.0, le=1.0, description="insertion port: share of the picture's width; a rig's own goes before it"
    )
    port_y_share: float | None = Field(None, ge=0.0, le=1.0, description="the same of its height; one is missing: not known")
    junction_turn_px: float = Field(
        40.0, ge=0.0, le=500.0, description="a right-angled turn at a junction costs a branch this length"
    )
    outside_cost: float = Field(2.0, ge=0.0, le=10.0, description="px a branch loses per px outside the vessel at its end")
    outlier_share: Share = Field(
        0.5, description="pieces shorter than this share of the longest are outliers; 0 = only the score decides"
    )
    smoothing_px: float = Field(3.0, ge=0.0, le=20.0, description="smoothing and sub-pixel centring of the path; 0 = raw pixels")
    max_candidates: int = Field(200, ge=1, le=10_000, description="no more paths than these are compared in one frame")


class VectorConfig(ConfigSection):
    """Line fits (METHOD section 5)."""

    robot_length_px: float = Field(40.0, ge=4.0, le=400.0, description="end of the robot's path that its line is fitted to")
    vessel_half_length_px: float = Field(
        20.0, ge=2.0, le=200.0, description="so far to both sides of the head goes the piece of centerline that is fitted"
    )
    vessel_rule: Literal["graph", "window"] = Field(
        "graph", description="window = all skeleton pixels near the head, the paper's way"
    )
    line_fit: Literal["total_least_squares", "least_squares"] = Field(
        "total_least_squares", description="least_squares = the paper's linear fit: y on x (in a steep piece x on y)"
    )


class PoseConfig(ConfigSection):
    """Pose state thresholds (METHOD section 6); hysteresis acts in a stream only."""

    d_allow_px: float = Field(6.0, gt=0.0, le=200.0, description="distance of head and tail that is still on the centerline")
    theta_allow_deg: float = Field(10.0, gt=0.0, le=180.0, description="angle that is still along the centerline")
    hysteresis_px: float = Field(1.0, ge=0.0, le=50.0, description="state A is left only this far beyond its limit")
    hysteresis_deg: float = Field(1.5, ge=0.0, le=45.0, description="state A is left only this far beyond its limit")
    dwell_s: float = Field(0.1, ge=0.0, le=5.0, description="a new state must have been seen for so long to be shown")

    @model_validator(mode="before")
    @classmethod
    def _count_no_frames(cls, values: Any) -> Any:
        """Older sessions and files say `dwell_frames`, of 30 a second."""
        if not isinstance(values, dict) or not isinstance(values.get("dwell_frames"), int):
            return values
        rest = {key: value for key, value in values.items() if key != "dwell_frames"}
        return {"dwell_s": min(values["dwell_frames"] / 30.0, 5.0), **rest}


class QualityConfig(ConfigSection):
    """When perception refuses to answer, and with which reason."""

    enabled: bool = Field(True, description="false = answer wherever a pose can be computed at all, as the paper does")
    black_level: float = Field(12.0, ge=0.0, le=255.0, description="99th percentile of brightness below this: black")
    white_level: float = Field(250.0, ge=0.0, le=255.0, description="1st percentile of brightness above this: overexposed")
    min_sharpness: float = Field(0.045, ge=0.0, le=1.0, description="steepest step per px against the contrast; 0 = not checked")
    min_robot_length_px: float = Field(20.0, ge=2.0, le=640.0, description="a shorter robot has no direction")
    min_inside_vessel: Share = Field(0.6, description="share of the robot's last 40 px that must lie in the lumen")
    max_wall_blur_px: float = Field(
        12.0,
        gt=0.0,
        le=1000.0,
        description="width of the model's doubt at the vessel's walls beside the head; at a lumen that it knows some 1 px",
    )
    max_bridged_share: Share = Field(0.4, description="repaired length over path length")
    max_ambiguity: Share = Field(0.8, description="how near the second best path may come to the best one")
    min_confidence: Share = Field(0.3, description="an answer with less confidence is not given")
    confident_from: Share = Field(0.5, description="an answer with less confidence is shown as unsure")
    max_novelty: float = Field(
        1.25, gt=0.0, le=1000.0, description="distance from the pictures that the model knows; 1: hardly any of them is farther"
    )
    several_robots_share: Share = Field(0.5, description="a second robot this large against the first one")


class TrackingConfig(ConfigSection):
    """Use of the last frames in a stream."""

    enabled: bool = Field(True, description="false = every frame by itself")
    max_head_speed_px_s: float = Field(600.0, gt=0.0, le=100_000.0, description="a head that jumps faster is not believed")
    memory_s: float = Field(0.5, ge=0.0, le=10.0, description="older frames tell at most which end is the head")
    window_px: int = Field(
        256, ge=0, le=4096, multiple_of=32, description="side of what is looked at anew between two whole looks; 0 = always all"
    )
    refresh_s: float = Field(
        1.5, ge=0.0, le=60.0, description="longest time between two whole looks, the last four of which tell the vessel"
    )
    route_gap_px: float = Field(40.0, ge=0.0, le=1000.0, description="gap in the vessel over which a known route still holds")
    route_reach_px: float = Field(30.0, ge=0.0, le=1000.0, description="the head is on a known route if no farther beside it")
    lookalike_px: float = Field(
        15.0, ge=0.0, le=1000.0, description="a piece that stays while the robot's end moves so far is no robot; 0 = it may be"
    )


class PerceptionConfig(ConfigSection):
    """From the picture to the pose."""

    working_size_px: int = Field(640, ge=128, le=4096, description="longer side that all _px settings refer to")
    segmentation: SegmentationConfig = SegmentationConfig()
    cleaning: CleaningConfig = CleaningConfig()
    gaps: GapConfig = GapConfig()
    path: PathConfig = PathConfig()
    vectors: VectorConfig = VectorConfig()
    pose: PoseConfig = PoseConfig()
    quality: QualityConfig = QualityConfig()
    tracking: TrackingConfig = TrackingConfig()
    bench: str | None = Field(None, min_length=1, description="folder of the bench that the camera sees; empty: not known")


class AdviceConfig(ConfigSection):
    """Speeds behind the paper's words, and how theta becomes a degree of steering."""

    slowest_mm_s: float = Field(1.0, ge=0.0, le=50.0, description="in state C, moving away from the centerline")
    slow_mm_s: float = Field(3.0, ge=0.0, le=50.0, description="in state B, coming back to it")
    moderate_mm_s: float = Field(5.0, ge=0.0, le=50.0, description="in state D, when it has been crossed")
    fast_mm_s: float = Field(8.0, ge=0.0, le=50.0, description="in state A, on it and along it")
    steer_gain: float = Field(1.0, ge=0.0, le=10.0, description="degrees of steering per degree of theta in state D")
    steer_gain_away: float = Field(1.5, ge=0.0, le=10.0, description="the same in state C, where the paper steers hardest")
    max_steer_deg: float = Field(45.0, gt=0.0, le=180.0, description="more steering is never advised")


class TwinConfig(ConfigSection):
    """The bench twin: a simulated robot, phantom and camera."""

    _ignored = ignored("own_process")
    phantom: str = Field("s_curve", min_length=1, description="a named phantom, or random:<seed>")
    look: str | None = Field(None, min_length=1, description="a family of looks, as in synth --family; empty: by appearance_seed")
    appearance_seed: int = Field(
        0, ge=0, le=2**31 - 1, description="of light, board and camera noise; without a look, 0 = the clear bench"
    )
    image_width_px: int = Field(640, ge=160, le=4096, description="of its camera")
    image_height_px: int = Field(480, ge=120, le=4096, description="of its camera")
    frames_per_second: float = Field(30.0, gt=0.0, le=240.0, description="in lock-step: trials, data sets")
    live_frames_per_second: float = Field(20.0, gt=0.0, le=240.0, description="of the running twin, which shares the computer")
    wiring: str | None = Field(
        None,
        pattern=r"^-?\d{1,3}(,-?\d{1,3}){1,11}$",
        description="ids of its servos in the order of the joints, minus: it turns the other way; empty: as servos.joints says",
    )
    roll_deg: float = Field(
        0.0, ge=-180.0, le=180.0, description="turn of the robot about its axis; 0: right and left act in the picture"
    )
    lens_distortion: float = Field(0.0, ge=-0.14, le=0.3, description="of its camera's lens; negative: barrel, 0: none")
    behaviour: BehaviourConfig | None = Field(None, description="of its robot; empty: the nominal one's")


class RigConfig(ConfigSection):
    """Which camera and robot are used."""

    _ignored = ignored("watch_folder")
    name: str = Field("twin", min_length=1, description="what sessions and messages call this rig")
    camera: CameraName = Field("twin", description="where pictures come from")
    robot: Literal["twin", "servos", "none"] = Field("twin", description="what moves; servos = real ones, see section Servos")
    source: str | None = Field(None, description="path of the video or folder")
    file: str | None = Field(
        None, min_length=1, description="rig file, made by the rig wizard, whose calibration is used; empty: not calibrated"
    )


class StreamConfig(ConfigSection):
    """What goes to other programs while the rig runs: docs/operating.md."""

    foxglove: bool = Field(False, description="pictures, overlays, pose and joints as a WebSocket for Foxglove, on this computer")
    port: int = Field(8765, ge=1024, le=65_535, description="of the WebSocket")
    lsl: bool = Field(False, description="pose and markers for the lab streaming layer, in the local network")


class WindowConfig(ConfigSection):
    """How the windows look, where they keep pictures, and what they ask before a hand-over."""

    theme: Literal["dark", "light", "system"] = Field("dark", description="of all windows; system = as the desktop has it")
    language: Literal["auto", "en", "zh"] = Field(
        "auto", description="of all windows; auto = the system's, en = English, zh = Chinese (simplified)"
    )
    pictures_folder: str | None = Field(None, min_length=1, description="where snapshots go; empty: LumenPilot in Pictures")
    needs_rehearsal: bool = Field(False, description="hand-over needs a rehearsal of this target (menu Robot)")


class Config(ConfigSection):
    rig: RigConfig = RigConfig()
    camera: CameraConfig = CameraConfig()
    twin: TwinConfig = TwinConfig()
    perception: PerceptionConfig = PerceptionConfig()
    advice: AdviceConfig = AdviceConfig()
    policy: PolicyConfig = PolicyConfig()
    hand: JogConfig = JogConfig()
    servos: ServosConfig = ServosConfig()
    safety: SafetyConfig = SafetyConfig()
    pedal: PedalConfig = PedalConfig()
    gamepad: GamepadConfig = GamepadConfig()
    window: WindowConfig = WindowConfig()
    record: RecordConfig = RecordConfig()
    stream: StreamConfig = StreamConfig()

    @field_validator("servos")
    @classmethod
    def _check_servos(cls, servos: ServosConfig) -> ServosConfig:
        if servos.port is not None and servos.too_loose:
            raise ValueError(servos.too_loose)
        return servos


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        with disk_errors(ConfigError, path, "cannot be read", missing="no such configuration file"):
            return tomllib.loads(path.read_text(encoding="utf-8-sig"))  # some editors begin with a mark
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file in UTF-8") from None
    except ValueError as error:  # not TOMLDecodeError alone: a number of 5000 digits is another ValueError
        raise ConfigError(f"{path}: not valid TOML: {error}") from None
    except RecursionError:
        raise ConfigError(f"{path}: not valid TOML: nested too deeply") from None


def merge(base: dict[str, Any], top: dict[str, Any]) -> dict[str, Any]:
    """Nested dictionaries, where `top` wins; lists are replaced as a whole."""
    merged = dict(base)
    for key, value in top.items():
        old = merged.get(key)
        merged[key] = merge(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return merged


def choose_model(model: str | None) -> dict[str, Any]:
    """Overrides for ``load_config`` that choose a model; None leaves it as it is."""
    return {} if model is None else {"perception": {"segmentation": {"model": model}}}


def _field_range(location: tuple[Any, ...]) -> str:
    """The allowed range of a setting as text, so that one error line shows both ends; "" without one."""
    model: Any = Config
    for part in location[:-1]:
        fields = getattr(model, "model_fields", {})
        if isinstance(part, int):  # of a list, all of whose items are alike
            model = get_args(model)[0]
        elif part in fields:
            model = fields[part].annotation
        else:
            return ""
    info = getattr(model, "model_fields", {}).get(location[-1]) if location else None
    bounds = []
    for item in info.metadata if info is not None else ():
        for name, sign in (("ge", ">="), ("gt", ">"), ("le", "<="), ("lt", "<"), ("multiple_of", "a multiple of")):
            value = getattr(item, name, None)
            if value is not None:
                bounds.append(f"{sign} {value:g}" if isinstance(value, float) else f"{sign} {value}")
    return " and ".join(bounds)


def _one_line(path: str, error: ValidationError) -> str:
    first: Any = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    is_unknown = first["type"] == "extra_forbidden"
    bounds = _field_range(first["loc"])
    what = "unknown key" if is_unknown else f"must be {bounds}" if bounds else plain_message(first)
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    says_no_value = not key or is_unknown or isinstance(first["input"], dict | BaseModel)
    got = "" if says_no_value else f", got {first['input']!r}"
    return f"{path}: {key + ': ' if key else ''}{what}{got}{more}"


def load_config(path: Path | None = None, preset: str | None = None, overrides: dict[str, Any] | None = None) -> Config:
    """The configuration from its layers: default, `preset`, the user's file at `path`, `overrides` (nested dictionaries).

    Raises ConfigError: with file, key and allowed range in one line.
    """
    data: dict[str, Any] = {}
    layers = [RESOURCES / "config" / "default.toml"]
    if preset is not None:
        preset_path = RESOURCES / "config" / f"preset_{preset}.toml"
        if not preset_path.is_file():
            known = ", ".join(sorted(p.stem.removeprefix("preset_") for p in preset_path.parent.glob("preset_*.toml")))
            raise ConfigError(f"unknown preset {preset!r}; known: {known}")
        layers.append(preset_path)
    if path is not None:
        layers.append(path)
    config = Config()
    for layer in layers:
        data = merge(data, _read_toml(layer))
        config = _validate(data, str(layer))
    return _validate(merge(data, overrides), "command line") if overrides else config


def _validate(data: dict[str, Any], source: str) -> Config:
    try:
        # as JSON, strictly: true is no number there, nor is "6", while a list still makes a tuple
        return Config.model_validate_json(json.dumps(data, default=str, ensure_ascii=False).encode(), strict=True)
    except UnicodeEncodeError as error:
        text, at = str(error.object), error.start
        quoted = text[text.rfind('"', 0, at) + 1 :].partition('"')[0]
        raise ConfigError(f"{source}: {quoted!r} is no text in UTF-8; rename that file or folder") from None
    except RecursionError:
        raise ConfigError(f"{source}: nested too deeply") from None
    except ValidationError as error:
        raise ConfigError(_one_line(source, error)) from None
