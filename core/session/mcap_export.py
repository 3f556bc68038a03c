"""A session as MCAP, for Foxglove and PlotJuggler: video, overlays as image annotations, plain time series, events as a log.

All messages are JSON. The lossy video's packets are copied as they are (H.264 in Annex B form, which is what viewers decode); from
a lossless one, which they do not know, JPEG pictures are made.
"""

from __future__ import annotations

import base64
import heapq
import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import av
import av.error
import cv2
import numpy as np
from av.bitstream import BitStreamFilterContext
from mcap.writer import Writer

from core.control.modes import Mode
from core.session.events import EventKind
from core.session.export import Advance, new_file
from core.session.mcap_schemas import SCHEMAS
from core.session.packet_check import PacketCheck
from core.session.pictures import video_number
from core.session.reader import SessionReader
from core.session.recorded import RecordedRow
from core.session.remux import has_h264
from core.session.video_in import open_video
from core.types import Command, Points, PoseState, Vector

Message = tuple[int, int, str, dict[str, Any]]
"""Time (ns since 1970), an order among equal times, topic, content."""

TOPICS = {
    "/camera/video": "foxglove.CompressedVideo",
    "/camera/image": "foxglove.CompressedImage",
    "/camera/overlays": "foxglove.ImageAnnotations",
    "/pose": "lumenpilot.Pose",
    "/robot": "lumenpilot.Robot",
    "/motion": "lumenpilot.Motion",
    "/pace": "lumenpilot.Pace",
    "/events": "foxglove.Log",
}
_LINE_STRIP = 3
_SIDES = ("right", "left", "up", "down")
_LEVELS = {EventKind.FAULT: 4, EventKind.DROPPED: 3, EventKind.LOST: 3, EventKind.ALERT: 3, EventKind.OVERRIDE: 3}
_JPEG_QUALITY = 90
_COLOURS = {
    "vessel": (0.34, 0.71, 0.91),
    "robot": (0.94, 0.89, 0.26),
    "route": (0.0, 0.62, 0.45),
    "robot vector": (0.90, 0.62, 0.0),
    "vessel vector": (0.0, 0.45, 0.70),
}


def export_mcap(reader: SessionReader, path: Path, on_row: Advance = lambda: None) -> int:
    """Write all of a session; returns the messages. Raises SessionError."""
    reader.wait()
    clock = _Clock(reader)
    sources = [_rows(reader, clock, on_row), _events(reader, clock)]
    codec = reader.manifest.codec if reader.manifest is not None else ""
    sources.append(_images(reader, clock) if codec == "lossless" else _video(reader, clock))
    written = 0
    with new_file(path) as part, part.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="lumenpilot")
        channels: dict[str, int] = {}
        for at_ns, _, topic, content in heapq.merge(*sources, key=lambda message: message[:2]):
            if topic not in channels:
                channels[topic] = _channel(writer, topic)
            data = json.dumps(content, allow_nan=False, separators=(",", ":")).encode()
            writer.add_message(channels[topic], log_time=at_ns, publish_time=at_ns, data=data, sequence=written)
            written += 1
        if reader.manifest is not None:
            about = reader.manifest.model_dump(mode="json")
            writer.add_metadata("session", {key: json.dumps(value) for key, value in about.items()})
        writer.finish()  # type: ignore[no-untyped-call]
    return written


def _channel(writer: Writer, topic: str) -> int:
    name = TOPICS[topic]
    schema = writer.register_schema(name=name, encoding="jsonschema", data=json.dumps(SCHEMAS[name]).encode())
    return writer.register_channel(topic=topic, message_encoding="json", schema_id=schema)


class _Clock:
    """The frames' clock as nanoseconds since 1970, never before it."""

    def __init__(self, reader: SessionReader) -> None:
        manifest = reader.manifest
        self._zero_ns = round(manifest.started_utc.timestamp() * 1e9) if manifest is not None else 0
        times = reader.timeline().time_s
        first_s = float(times[0]) if len(times) else 0.0
        self._zero_s = manifest.started_monotonic_s if manifest is not None else first_s

    def ns(self, time_s: float) -> int:
        return max(0, self._zero_ns + round((time_s - self._zero_s) * 1e9))

    def stamp(self, time_s: float) -> dict[str, int]:
        sec, nsec = divmod(self.ns(time_s), 1_000_000_000)
        return {"sec": sec, "nsec": nsec}


def _rows(reader: SessionReader, clock: _Clock, on_row: Advance) -> Iterator[Message]:
    floor = 0
    for place in range(len(reader)):
        row = reader.row(place)
        on_row()
        if row is None:
            continue
        # a clock that went back must not break the order of the file
        floor = at_ns = max(floor, clock.ns(row.captured_s))
        stamp = clock.stamp(row.captured_s)
        yield at_ns, 1, "/camera/overlays", _overlays(row, stamp)
        yield at_ns, 2, "/pose", {"timestamp": stamp, **_pose(row)}
        yield at_ns, 3, "/pace", {"timestamp": stamp, **_pace(row)}
        if row.status is not None:
            yield at_ns, 4, "/robot", {"timestamp": stamp, **_robot(row)}
        if row.sent is not None or row.drive is not None:
            yield at_ns, 5, "/motion", {"timestamp": stamp, **_motion(row)}


def _pose(row: RecordedRow) -> dict[str, Any]:
    pose = row.scene.pose
    return {
        "theta_signed_deg": pose.theta_signed_deg if pose else None,
        "c_head_px": pose.c_head_px if pose else None,
        "c_tail_px": pose.c_tail_px if pose else None,
        "source_px_per_working_px": row.source_px_per_working_px,
        "confidence": pose.confidence if pose else None,
        "novelty": row.scene.novelty,
        "state": pose.state.value if pose else None,
        "state_number": list(PoseState).index(pose.state) if pose else None,
        "refusal": str(row.scene.refusal) if row.scene.refusal else "",
    }


def _pace(row: RecordedRow) -> dict[str, Any]:
    return {
        "frames_per_second": row.frames_per_second,
        "dropped_frames": row.dropped_frames,
        "dropped_rows": row.dropped_rows,
        "perception_ms": row.scene.latency_ms.get("total"),
    }


def _robot(row: RecordedRow) -> dict[str, Any]:
    status = row.status
    assert status is not None
    record: dict[str, Any] = {"insertion_mm": status.insertion_mm, "delivery_mm": status.delivery_mm}
    record["wall_contact_n"] = status.wall_contact_n
    for name, values in (("pull_mm", status.tendon_pull_mm), ("force_mn", status.tendon_force_mn)):
        record |= {f"tendon_{name}_{side}": value for side, value in zip(_SIDES, values, strict=True)}
    return record


def _motion(row: RecordedRow) -> dict[str, Any]:
    drive = row.drive
    record: dict[str, Any] = {
        "mode": drive.mode.value if drive else "",
        "mode_number": list(Mode).index(drive.mode) if drive else None,
        "sent_by": drive.sent_by.value if drive and drive.sent_by else "",
    }
    motions = {"asked": drive.asked if drive else None, "commanded": drive.commanded if drive else None, "sent": row.sent}
    for who, motion in motions.items():
        record |= {f"{who}_{name}": getattr(motion, name) if motion is not None else None for name in Command.__slots__}
    return record


def _overlays(row: RecordedRow, stamp: dict[str, int]) -> dict[str, Any]:
    """Lines in source pixels; viewers count from the corner of the first pixel, we from its centre."""
    scene, points, texts = row.scene, [], []
    lines: list[tuple[str, Points, float]] = []
    if scene.vessel_graph is not None:
        lines += [("vessel", edge.points, 1.5) for edge in scene.vessel_graph.edges]
    if scene.route is not None:
        lines.append(("route", scene.route.points, 3.0))
    if scene.path is not None:
        lines.append(("robot", scene.path.points, 2.0))
    for name, vector in (("vessel vector", scene.vessel_vector), ("robot vector", scene.robot_vector)):
        if vector is not None:
            lines.append((name, _ends(vector), 3.0))
    for name, line, thickness in lines:
        corners = np.round(scene.points_to_source(line) + 0.5, 2).tolist()
        points.append(
            {
                "timestamp": stamp,
                "type": _LINE_STRIP,
                "points": [{"x": x, "y": y} for x, y in corners],
                "outline_color": _colour(name),
                "outline_colors": [],
                "fill_color": {"r": 0.0, "g": 0.0, "b": 0.0, "a": 0.0},
                "thickness": thickness,
            }
        )
    pose = scene.pose
    text = f"{pose.state.value}  theta {pose.theta_signed_deg:+.1f} deg" if pose else str(scene.refusal or "no pose")
    texts.append(
        {
            "timestamp": stamp,
            "position": {"x": 8.0, "y": 24.0},
            "text": text,
            "font_size": 18.0,
            "text_color": {"r": 1.0, "g": 1.0, "b": 1.0, "a": 1.0},
            "background_color": {"r": 0.0, "g": 0.0, "b": 0.0, "a": 0.6},
        }
    )
    return {"circles": [], "points": points, "texts": texts}


def _ends(vector: Vector) -> Points:
    return np.array([vector.start, vector.end], np.float64)


def _colour(name: str) -> dict[str, float]:
    return dict(zip("rgba", (*_COLOURS[name], 1.0), strict=True))


def _events(reader: SessionReader, clock: _Clock) -> Iterator[Message]:
    for event in reader.events:
        text = f"{event.kind.value}: {event.text}" if event.text else event.kind.value
        log = {
            "timestamp": clock.stamp(event.time_s),
            "level": _LEVELS.get(event.kind, 2),
            "message": text,
            "name": event.kind.value,
        }
        yield clock.ns(event.time_s), 6, "/events", log | {"file": "", "line": 0}


def _times(reader: SessionReader) -> Callable[[int, int], float]:
    """Capture time (s) of a picture; one that has lost its row is placed by its file's first one."""
    line = reader.timeline()
    known = {(int(v), int(p)): float(t) for v, p, t in zip(line.video, line.pts_ms, line.time_s, strict=True)}
    zero_s: dict[int, float] = {}
    for (video, pts_ms), time_s in known.items():
        zero_s.setdefault(video, time_s - pts_ms / 1000)
    start_s = reader.manifest.started_monotonic_s if reader.manifest is not None else 0.0
    return lambda video, pts_ms: known.get((video, pts_ms), zero_s.get(video, start_s) + pts_ms / 1000)


def _video(reader: SessionReader, clock: _Clock) -> Iterator[Message]:
    time_of, floor = _times(reader), 0
    for path in reader.videos:
        number = video_number(path)
        if number is None:
            continue
        try:
            for pts_ms, data in _annex_b(path, PacketCheck(partial(reader.known_picture, number))):
                time_s = time_of(number, pts_ms)
                floor = max(floor, clock.ns(time_s))
                coded = base64.b64encode(data).decode()
                content = {"timestamp": clock.stamp(time_s), "frame_id": "camera", "data": coded, "format": "h264"}
                yield floor, 0, "/camera/video", content
        except (av.error.FFmpegError, OSError, ValueError):
            # what could be read is there; the reader names damaged files
            continue


def _annex_b(path: Path, check: PacketCheck) -> Iterator[tuple[int, bytes]]:
    """Time (ms) and trusted H.264 packets with start codes, each key picture with its parameter sets."""
    with open_video(path) as container:
        if not has_h264(container):
            return
        stream = container.streams.video[0]
        to_annex_b = BitStreamFilterContext("h264_mp4toannexb", stream)
        for packet in container.demux(stream):
            if packet.pts is None or stream.time_base is None or not packet.size:
                continue
            pts_ms = round(packet.pts * stream.time_base * 1000)
            if not check.take(pts_ms, bytes(packet), is_key=packet.is_keyframe, is_corrupt=packet.is_corrupt):
                continue
            for filtered in to_annex_b.filter(packet):
                yield pts_ms, bytes(filtered)


def _images(reader: SessionReader, clock: _Clock) -> Iterator[Message]:
    floor = 0
    for place in range(len(reader)):
        frame = reader.frame(place)
        if frame is None:
            continue
        bgr = cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR)
        done, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        if done:
            floor = max(floor, clock.ns(frame.captured_s))
            coded = base64.b64encode(data.tobytes()).decode()
            content = {"timestamp": clock.stamp(frame.captured_s), "frame_id": "camera", "data": coded, "format": "jpeg"}
            yield floor, 0, "/camera/image", content
