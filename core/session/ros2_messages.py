"""A session's content as messages of ROS 2, of packages that every installation of it has. Slow to import.

Joints and operating state have the topics of CRTK. Pose values are plain numbers and texts, in degrees and working pixels; all
values of a frame, by the names of the CSV, stand in ``/diagnostics``.
"""

from __future__ import annotations

from typing import IO, Any

from mcap_ros2.writer import Writer

from core.session.codec import RecordedRow, finite_tree
from core.session.manifest import Event
from core.session.values import FRAME_ID, Severity, event_line, joint_values, operating_state, rotation_joints, severity, values_of

_RULE = "=" * 80
_HEADER = f"\n{_RULE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
_DEFINITIONS = {
    "sensor_msgs/msg/CompressedImage": f"std_msgs/Header header\nstring format\nuint8[] data{_HEADER}",
    "sensor_msgs/msg/JointState": (
        f"std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort{_HEADER}"
    ),
    "diagnostic_msgs/msg/DiagnosticArray": (
        f"std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status{_HEADER}"
        f"\n{_RULE}\nMSG: diagnostic_msgs/DiagnosticStatus\n"
        "byte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values"
        f"\n{_RULE}\nMSG: diagnostic_msgs/KeyValue\nstring key\nstring value"
    ),
    "rcl_interfaces/msg/Log": (
        "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line"
    ),
    "std_msgs/msg/Float64": "float64 data",
    "std_msgs/msg/String": "string data",
}
"""The messages that are written, as their packages define them."""
_POSE = ("theta_signed_deg", "c_head_px", "c_tail_px", "confidence")
"""Numbers of the pose with a topic each."""
_LOG_LEVELS = {Severity.INFO: 20, Severity.WARNING: 30, Severity.ERROR: 40}
"""Levels of ``rcl_interfaces/msg/Log``."""


class Ros2Messages:
    """Writes one MCAP file with the profile of ROS 2; ``logged`` counts the messages."""

    def __init__(self, file: IO[bytes], about: dict[str, str], kind: str, config: dict[str, Any]) -> None:
        self.logged = 0
        self._kind, self._rotation = kind, rotation_joints(config)
        self._writer = Writer(file)
        self._schemas = {name: self._writer.register_msgdef(name, text) for name, text in _DEFINITIONS.items()}
        self._writer.add_metadata("session", about)

    def finish(self) -> None:
        """Write the index; the file is whole from then on."""
        self._writer.finish()  # type: ignore[no-untyped-call]

    def log_picture(self, data: bytes, stamp_ns: int, log_ns: int) -> None:
        image = {"header": _header(stamp_ns), "format": "jpeg", "data": data}
        self._write("/camera/image/compressed", "sensor_msgs/msg/CompressedImage", image, log_ns)

    def log_row(self, row: RecordedRow, stamp_ns: int, log_ns: int) -> None:
        values, header = finite_tree(values_of(row)), _header(stamp_ns)
        for name in _POSE:
            if values[name] is not None:
                self._write(f"/pose/{name}", "std_msgs/msg/Float64", {"data": values[name]}, log_ns)
        self._write("/pose/state", "std_msgs/msg/String", {"data": values["state"] or ""}, log_ns)
        if row.drive is not None:
            self._write("/operating_state", "std_msgs/msg/String", {"data": operating_state(row)["state"]}, log_ns)
        for topic, joints in zip(("/measured_js", "/setpoint_js"), joint_values(row, self._rotation), strict=True):
            if joints is not None:
                parts = {"name": joints.names, "position": joints.positions, "velocity": joints.velocities}
                self._write(topic, "sensor_msgs/msg/JointState", {"header": header, **parts}, log_ns)
        status = {
            "level": 0 if row.scene.pose is not None else 1,  # OK, WARN
            "name": "lumenpilot: perception",
            "message": values["refusal"] or "",
            "hardware_id": self._kind,
            "values": [{"key": name, "value": str(value)} for name, value in values.items() if value is not None],
        }
        array = {"header": header, "status": [status]}
        self._write("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", array, log_ns)

    def log_event(self, event: Event, stamp_ns: int, log_ns: int) -> None:
        stamp = _header(stamp_ns)["stamp"]
        log = {"stamp": stamp, "level": _LOG_LEVELS[severity(event)], "name": "lumenpilot", "msg": event_line(event)}
        self._write("/rosout", "rcl_interfaces/msg/Log", log, log_ns)

    def _write(self, topic: str, kind: str, message: dict[str, Any], log_ns: int) -> None:
        self._writer.write_message(topic, self._schemas[kind], message, log_ns, log_ns, self.logged)
        self.logged += 1


def _header(stamp_ns: int) -> dict[str, Any]:
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": FRAME_ID}
