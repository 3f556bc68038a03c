"""What is known of a frame as messages for Foxglove and PlotJuggler: the same channels fill an MCAP file and the live stream.

Pictures, overlays, joints and the log have the schemas of foxglove-sdk; pose, pace, robot and motion are JSON with our own names.
Topics have the names of CRTK where it has one (``measured_js``, ``setpoint_js``, ``operating_state``). Slow to import.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from itertools import islice
from typing import Any

import numpy as np
from foxglove import Channel, Context
from foxglove.channels import (
    CompressedImageChannel,
    CompressedVideoChannel,
    ImageAnnotationsChannel,
    JointStatesChannel,
    LogChannel,
)
from foxglove.messages import (
    Color,
    CompressedImage,
    CompressedVideo,
    ImageAnnotations,
    JointState,
    JointStates,
    Log,
    LogLevel,
    Point2,
    PointsAnnotation,
    PointsAnnotationType,
    TextAnnotation,
    Timestamp,
)

from core.control.modes import Mode
from core.session.codec import ROBOT_LINE_PX, VESSEL_LINE_PX, RecordedRow, finite_tree, mask_outlines, thinned
from core.session.manifest import Event
from core.session.values import (
    FRAME_ID,
    JointValues,
    Severity,
    event_line,
    joint_values,
    operating_state,
    rotation_joints,
    severity,
    values_of,
)
from core.types import Command, Points, PoseState

logging.getLogger("foxglove").setLevel(logging.CRITICAL)  # a client that goes away is no error; a full disk is ours to report
_TEXTS = frozenset({"state", "refusal", "mode", "sent_by"})
_MOTION = tuple(f"{who}_{name}" for who in ("asked", "commanded", "sent") for name in Command.__slots__)
_TABLES: dict[str, tuple[str, ...]] = {
    "pose": (
        *("theta_signed_deg", "c_head_px", "c_tail_px", "source_px_per_working_px", "confidence", "novelty", "state"),
        *("state_number", "refusal"),
    ),
    "pace": ("frames_per_second", "dropped_frames", "dropped_rows", "perception_ms"),
    "robot": ("insertion_mm", "delivery_mm", "wall_contact_n", "rotation_deg"),
    "motion": ("mode", "mode_number", "sent_by", *_MOTION),
}
"""Topic -> the values in its messages; those of the tendons come to "robot" as the robot has them."""
_COLOURS = {
    "vessel": Color(r=0.34, g=0.71, b=0.91, a=1.0),
    "robot": Color(r=0.94, g=0.89, b=0.26, a=1.0),
    "route": Color(r=0.0, g=0.62, b=0.45, a=1.0),
    "robot vector": Color(r=0.90, g=0.62, b=0.0, a=1.0),
    "vessel vector": Color(r=0.0, g=0.45, b=0.70, a=1.0),
}
_LOG_LEVELS = {Severity.INFO: LogLevel.Info, Severity.WARNING: LogLevel.Warning, Severity.ERROR: LogLevel.Error}
_WHITE, _SHADE = Color(r=1.0, g=1.0, b=1.0, a=1.0), Color(r=0.0, g=0.0, b=0.0, a=0.6)


class FoxgloveMessages:
    """The channels of one MCAP file or server. A message is made only where a channel has a receiver; ``logged`` counts them.

    A file or a server is open on the foxglove-sdk's `context`. `video`: pictures are packets of H.264 in Annex B form; False:
    JPEG.
    """

    def __init__(self, context: Context, *, video: bool) -> None:
        self.logged = 0
        self._kind = ""
        self._rotation: frozenset[str] = frozenset()
        self._video = CompressedVideoChannel("/camera/video", context=context) if video else None
        self._image = None if video else CompressedImageChannel("/camera/image", context=context)
        self._overlays = ImageAnnotationsChannel("/camera/overlays", context=context)
        self._joints = [JointStatesChannel(f"/{name}", context=context) for name in ("measured_js", "setpoint_js")]
        self._events = LogChannel("/events", context=context)
        self._tables = {
            name: Channel(f"/{name}", schema=_schema(f"lumenpilot.{name.capitalize()}", _values(names)), context=context)
            for name, names in _TABLES.items()
        }
        crtk = {"state": {"type": "string"}, "is_homed": {"type": "boolean"}, "is_busy": {"type": "boolean"}}
        self._state = Channel("/operating_state", schema=_schema("lumenpilot.OperatingState", crtk), context=context)

    def set_rig(self, kind: str, config: Mapping[str, Any]) -> None:
        """What the pictures show from now on: SIM, LIVE or PLAYBACK, and the configuration as plain values."""
        self._kind, self._rotation = kind, rotation_joints(config)

    @property
    def wants_pictures(self) -> bool:
        """Whether anything receives pictures."""
        return any(channel is not None and channel.has_sinks() for channel in (self._video, self._image))

    @property
    def wants_rows(self) -> bool:
        """Whether anything receives what is not a picture."""
        channels: tuple[Any, ...] = (self._overlays, *self._joints, self._state, *self._tables.values())
        return any(channel.has_sinks() for channel in channels)

    def log_picture(self, data: bytes, stamp_ns: int, log_ns: int) -> None:
        """A picture that was captured at `stamp_ns` (since 1970); `log_ns` orders the messages."""
        if self._video is not None:
            video = CompressedVideo(timestamp=_stamp(stamp_ns), frame_id=FRAME_ID, data=data, format="h264")
            self._log(self._video, video, log_ns)
        elif self._image is not None:
            image = CompressedImage(timestamp=_stamp(stamp_ns), frame_id=FRAME_ID, data=data, format="jpeg")
            self._log(self._image, image, log_ns)

    def log_row(self, row: RecordedRow, stamp_ns: int, log_ns: int) -> None:
        """All that is known of a frame but its picture."""
        stamp = _stamp(stamp_ns)
        json_stamp = {"timestamp": {"sec": stamp.sec, "nsec": stamp.nsec}}
        if self._overlays.has_sinks():
            self._log(self._overlays, overlays(row, stamp, self._kind), log_ns)
        if any(channel.has_sinks() for channel in self._tables.values()):
            self._log_tables(row, json_stamp, log_ns)
        if row.drive is not None and self._state.has_sinks():
            self._log(self._state, json_stamp | operating_state(row), log_ns)
        if row.bus is not None and any(channel.has_sinks() for channel in self._joints):
            for channel, joints in zip(self._joints, joint_values(row, self._rotation), strict=True):
                if joints is not None:
                    self._log(channel, _joint_states(joints, stamp), log_ns)

    def _log_tables(self, row: RecordedRow, stamp: dict[str, Any], log_ns: int) -> None:
        values = values_of(row)
        for name in ("refusal", "mode", "sent_by"):
            values[name] = values[name] or ""
        values["state_number"] = list(PoseState).index(values["state"]) if values["state"] else None
        values["mode_number"] = list(Mode).index(values["mode"]) if values["mode"] else None
        tendons = [name for name in values if name.startswith("tendon_")]
        for name, names in _TABLES.items():
            if (name == "robot" and row.status is None) or (name == "motion" and row.sent is None and row.drive is None):
                continue
            parts = (*names, *tendons) if name == "robot" else names
            self._log(self._tables[name], stamp | finite_tree({part: values[part] for part in parts}), log_ns)

    def log_event(self, event: Event, stamp_ns: int, log_ns: int) -> None:
        """An event as a line of the log."""
        level = _LOG_LEVELS[severity(event)]
        line = Log(timestamp=_stamp(stamp_ns), level=level, message=event_line(event), name=event.kind.value)
        self._log(self._events, line, log_ns)

    def _log(self, channel: Any, message: Any, log_ns: int) -> None:
        channel.log(message, log_time=log_ns)
        self.logged += 1


def _schema(title: str, properties: dict[str, Any]) -> dict[str, Any]:
    stamp = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
    return {"title": title, "type": "object", "properties": {"timestamp": stamp, **properties}}


def _values(names: tuple[str, ...]) -> dict[str, Any]:
    return {name: {"type": ["string" if name in _TEXTS else "number", "null"]} for name in names}


def _stamp(at_ns: int) -> Timestamp:
    return Timestamp(*divmod(at_ns, 1_000_000_000))


def _joint_states(joints: JointValues, stamp: Timestamp) -> JointStates:
    speeds: tuple[float | None, ...] = joints.velocities or (None,) * len(joints.names)
    each = zip(joints.names, joints.positions, speeds, strict=True)
    return JointStates(timestamp=stamp, joints=[JointState(name=name, position=at, velocity=speed) for name, at, speed in each])


def overlays(row: RecordedRow, stamp: Timestamp, kind: str) -> ImageAnnotations:
    """Outlines, skeletons, vectors and the pose as annotations of the picture.

    In source pixels; viewers count from the corner of the first pixel, we from its centre. `kind`: a word before the pose, or "".
    """
    scene, lines = row.scene, list[tuple[PointsAnnotationType, str, Any, float]]()
    if scene.masks is not None:
        for name, mask, leave_px in (("vessel", scene.masks.vessel, VESSEL_LINE_PX), ("robot", scene.masks.robot, ROBOT_LINE_PX)):
            lines += [(PointsAnnotationType.LineLoop, name, outline, 1.0) for outline in mask_outlines(mask, leave_px)]
    edges = scene.vessel_graph.edges if scene.vessel_graph is not None else ()
    strips: list[tuple[str, Points, float]] = [("vessel", edge.points, 1.5) for edge in edges]
    if scene.route is not None:
        strips.append(("route", scene.route.points, 3.0))
    if scene.path is not None:
        strips.append(("robot", scene.path.points, 2.0))
    for name, vector in (("vessel vector", scene.vessel_vector), ("robot vector", scene.robot_vector)):
        if vector is not None:
            strips.append((name, np.array([vector.start, vector.end]), 3.0))
    lines += [(PointsAnnotationType.LineStrip, name, thinned(line), width) for name, line, width in strips if len(line)]
    whole = np.concatenate([np.zeros((0, 2)), *(line for _, _, line, _ in lines)])
    corners = (Point2(x=x, y=y) for x, y in np.round(scene.points_to_source(whole) + 0.5, 2).tolist())
    points = [
        PointsAnnotation(
            timestamp=stamp, type=kind_of, points=list(islice(corners, len(line))), outline_color=_COLOURS[name], thickness=width
        )
        for kind_of, name, line, width in lines
    ]
    pose = scene.pose
    text = f"{pose.state.value}  theta {pose.theta_signed_deg:+.1f} deg" if pose else str(scene.refusal or "no pose")
    caption = TextAnnotation(
        timestamp=stamp,
        position=Point2(x=8.0, y=24.0),
        text=f"{kind}  {text}" if kind else text,
        font_size=18.0,
        text_color=_WHITE,
        background_color=_SHADE,
    )
    return ImageAnnotations(timestamp=stamp, points=points, texts=[caption])
