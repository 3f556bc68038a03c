"""A session as CSV, MP4 and MCAP (Foxglove, PlotJuggler). Files appear whole or not at all; nothing is overwritten.

All MCAP messages are JSON. The packets of a lossy video are copied as they are (H.264 in Annex B form, which viewers decode); of a
lossless one, which they do not know, JPEG pictures are made.
"""

from __future__ import annotations

import base64
import csv
import heapq
import json
import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial, reduce
from pathlib import Path
from typing import Any, cast

import av
import av.error
import cv2
import numpy as np
from av.bitstream import BitStreamFilterContext
from mcap.writer import Writer

from core.config.safety import TENDONS
from core.control.modes import Mode
from core.session.codec import RecordedRow
from core.session.manifest import EventKind, SessionError
from core.session.reader import SessionReader
from core.session.video import MS, has_h264, media_name, open_video, packets_of, sound_packets, video_number
from core.types import Command, Image, Points, PoseState, Tick

Draw = Callable[[Tick], Image]
Advance = Callable[[], None]


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place when all went well. Raises SessionError."""
    part = path.with_name(f".{secrets.token_hex(8)}.part")
    try:
        if path.exists():
            raise SessionError(f"{path}: is there already; choose another file")
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        try:
            _move(part, path)
        except FileExistsError:
            raise SessionError(f"{path}: was made by something else meanwhile; choose another file") from None
    except (av.error.FFmpegError, OSError) as error:
        raise SessionError(f"{path}: cannot be written ({getattr(error, 'strerror', None) or error})") from None
    finally:
        with suppress(OSError):
            part.unlink()


def _move(part: Path, path: Path) -> None:
    """Give `part` its name. Raises FileExistsError: of two that write the same file the first one stands."""
    try:
        os.link(part, path)
    except FileExistsError:
        raise
    except OSError:  # a drive without links
        path.touch(exist_ok=False)
        try:
            part.replace(path)
        except OSError:
            path.unlink()  # the empty one that held the name
            raise


def export_csv(reader: SessionReader, path: Path, on_row: Advance = lambda: None) -> int:
    """One line per frame, blank where something is missing; points in source pixels, distances in working pixels.

    Returns the lines. Raises SessionError.
    """
    reader.wait()
    written = 0
    first_s: float | None = None
    with new_file(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        out, columns = csv.writer(file), (*_COLUMNS, *(_TURNING if _has_rotation(reader) else ()))
        out.writerow(columns)
        for place in range(len(reader)):
            row = reader.row(place)
            if row is not None:
                first_s = row.captured_s if first_s is None else first_s
                values = _flat(row)
                values["time_s"] = round(row.captured_s - first_s, 6)
                values["source_px_per_working_px"] = round(row.source_px_per_working_px, 6)
                out.writerow(values[name] for name in columns)
                written += 1
            on_row()
    return written


_WHO = ("asked", "commanded", "sent")
_MOTIONS = tuple(f"{who}_{name}" for who in _WHO for name in Command.__slots__ if name != "rotation_deg_s")
_TURNING = (*(f"{who}_rotation_deg_s" for who in _WHO), "rotation_deg")
"""Columns of a robot whose shaft is turned, after the others."""
_COLUMNS = (
    *("row", "index", "captured_s", "time_s", "video", "pts_ms", "dropped_frames", "camera_lost", "dropped_rows"),
    *("width_px", "height_px", "source_px_per_working_px", "state", "theta_deg", "theta_signed_deg", "c_head_px", "c_tail_px"),
    *("crossed", "confidence", "novelty", "refusal", "head_x_px", "head_y_px", "tail_x_px", "tail_y_px"),
    *("advice_speed", "advice_advance_mm_s", "advice_steer_deg", "mode", "permitted", *_MOTIONS, "sent_by"),
    *("insertion_mm", "delivery_mm", "wall_contact_n", "perception_ms", "latency_s"),
)


# Where the values of CSV and MCAP are in a row, by the names that they have there.
_PATHS = {
    "novelty": "scene.novelty",
    **{name: f"scene.pose.{name}" for name in ("theta_deg", "theta_signed_deg", "c_head_px", "c_tail_px", "crossed")},
    **{name: f"scene.pose.{name}" for name in ("state", "confidence")},
    **{f"advice_{name}": f"advice.{name}" for name in ("speed", "advance_mm_s", "steer_deg")},
    **{name: f"drive.{name}" for name in ("mode", "permitted", "sent_by", "latency_s")},
    **{f"asked_{name}": f"drive.operator_command.{name}" for name in Command.__slots__},
    **{f"commanded_{name}": f"drive.program_command.{name}" for name in Command.__slots__},
    **{f"sent_{name}": f"sent.{name}" for name in Command.__slots__},
    **{name: f"status.{name}" for name in ("insertion_mm", "delivery_mm", "wall_contact_n", "rotation_deg")},
    **{name: name for name in ("row", "index", "captured_s", "video", "pts_ms", "frames_per_second", "dropped_frames")},
    **{name: name for name in ("camera_lost", "dropped_rows", "source_px_per_working_px")},
}


def _has_rotation(reader: SessionReader) -> bool:
    """Whether the session's robot has a shaft that is turned."""
    config = reader.manifest.config if reader.manifest is not None else {}
    joints = (config.get("servos") or {}).get("joints") or ()
    return any(isinstance(joint, dict) and joint.get("kind") == "rotation" for joint in joints)


def tendon_names(count: int) -> tuple[str, ...]:
    """Names for the tendons of a status: those of the default robot, numbers for other robots."""
    return TENDONS if count == len(TENDONS) else tuple(f"{number}" for number in range(1, count + 1))


def _flat(row: RecordedRow) -> dict[str, Any]:
    """The values of a row by name; None where something is missing."""
    scene, path, start = row.scene, row.scene.path, cast(Any, row)
    values: dict[str, Any] = {
        name: reduce(lambda found, part: getattr(found, part, None), place.split("."), start) for name, place in _PATHS.items()
    }
    values |= {"width_px": row.size[0], "height_px": row.size[1], "perception_ms": scene.latency_ms.get("total")}
    values["refusal"] = str(scene.refusal) if scene.refusal else None
    for end, point in (("head", path.head), ("tail", path.tail)) if path else (("head", None), ("tail", None)):
        x, y = scene.to_source(point) if point is not None else (None, None)
        values[f"{end}_x_px"], values[f"{end}_y_px"] = (None, None) if x is None or y is None else (round(x, 3), round(y, 3))
    for name in ("pull_mm", "force_mn"):
        each = getattr(row.status, f"tendon_{name}", (None,) * 4)
        values |= {f"tendon_{name}_{tendon}": value for tendon, value in zip(tendon_names(len(each)), each, strict=True)}
    return values


def export_mp4(
    reader: SessionReader,
    path: Path,
    draw: Draw | None = None,
    *,
    first: int = 0,
    last: int | None = None,
    on_row: Advance = lambda: None,
) -> int:
    """Pictures of the rows from `first` to `last` (not included; None: all) as H.264, at the times when they were captured.

    Parameters
    ----------
    draw : burns in what it likes; None: the plain pictures. All pictures take the size of the first one.
    on_row : called after every row.

    Returns
    -------
    int
        Pictures written; rows whose picture is lost are left out.

    Raises
    ------
    SessionError
        No picture at all, or the file cannot be written or is there already.
    """
    reader.wait()
    written = 0
    with new_file(path) as part:
        movie: _Movie | None = None
        try:
            for place in range(first, len(reader) if last is None else min(last, len(reader))):
                tick = reader.tick(place)
                if tick is not None:
                    image = draw(tick) if draw is not None else tick.frame.image
                    movie = movie or _Movie(part, image)
                    movie.add(image, tick.frame.captured_s)
                    written += 1
                on_row()
        finally:
            if movie is not None:
                movie.close()
        if not written:
            raise SessionError(f"{reader.folder}: no picture there that could be exported")
    return written


class _Movie:
    """An MP4 that every player takes: yuv420p, even sides, index in front."""

    def __init__(self, path: Path, first: Image) -> None:
        height, width = first.shape[:2]
        self._size = width + width % 2, height + height % 2
        self._container = av.open(media_name(path), "w", format="mp4", options={"movflags": "faststart"})
        options = {"preset": "veryfast", "crf": "18", "g": "30", "bf": "0"}
        self._stream: Any = self._container.add_stream("libx264", rate=30, options=options)
        self._stream.width, self._stream.height = self._size
        self._stream.pix_fmt = "yuv420p"
        self._stream.codec_context.time_base = MS
        self._stream.codec_context.thread_count = 1
        self._zero_s: float | None = None
        self._pts_ms = -1

    def add(self, image: Image, captured_s: float) -> None:
        self._zero_s = captured_s if self._zero_s is None else self._zero_s
        self._pts_ms = max(self._pts_ms + 1, round((captured_s - self._zero_s) * 1000))
        planes = np.asarray(cv2.cvtColor(self._fitted(image), cv2.COLOR_RGB2YUV_I420), np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts, frame.time_base = self._pts_ms, MS
        self._container.mux(self._stream.encode(frame))

    def _fitted(self, image: Image) -> Image:
        """At the movie's size; an odd side grows by repeating its last row or column."""
        height, width = image.shape[:2]
        grown = image
        if (width + width % 2, height + height % 2) == self._size:
            if width % 2 or height % 2:
                grown = np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
        else:
            grown = np.asarray(cv2.resize(image, self._size, interpolation=cv2.INTER_AREA), np.uint8)
        return np.ascontiguousarray(grown)

    def close(self) -> None:
        try:
            self._container.mux(self._stream.encode(None))
        finally:
            self._container.close()


Schema = dict[str, Any]

_NUMBER: Schema = {"type": "number"}
_MAYBE: Schema = {"type": ["number", "null"]}
_TEXT: Schema = {"type": "string"}
_INTEGER: Schema = {"type": "integer"}
_TIME: Schema = {"type": "object", "properties": {"sec": _INTEGER, "nsec": _INTEGER}}
_COLOUR: Schema = {"type": "object", "properties": dict.fromkeys("rgba", _NUMBER)}
_POINT: Schema = {"type": "object", "properties": {"x": _NUMBER, "y": _NUMBER}}
_DATA: Schema = {"type": "string", "contentEncoding": "base64"}
# Values of ``_flat`` by topic, in the order of their messages.
_POSE = {
    "theta_signed_deg": _MAYBE,
    "c_head_px": _MAYBE,
    "c_tail_px": _MAYBE,
    "source_px_per_working_px": _NUMBER,
    "confidence": _MAYBE,
    "novelty": _MAYBE,
    "state": {"type": ["string", "null"]},
    "state_number": _MAYBE,
    "refusal": _TEXT,
}
_PACE = {"frames_per_second": _NUMBER, "dropped_frames": _NUMBER, "dropped_rows": _NUMBER, "perception_ms": _MAYBE}
_TENDONS = {f"tendon_{what}_{side}": _NUMBER for what in ("pull_mm", "force_mn") for side in TENDONS}
_ROBOT = {"insertion_mm": _NUMBER, "delivery_mm": _NUMBER, "wall_contact_n": _MAYBE, "rotation_deg": _MAYBE, **_TENDONS}
_MOTION = {"mode": _TEXT, "mode_number": _MAYBE, "sent_by": _TEXT, **dict.fromkeys((*_MOTIONS, *_TURNING[:3]), _MAYBE)}


def _message(title: str, **properties: Schema) -> Schema:
    return {"title": title, "type": "object", "properties": {"timestamp": _TIME, **properties}}


def _list(item: Schema) -> Schema:
    return {"type": "array", "items": item}


_CIRCLE = {"position": _POINT, "diameter": _NUMBER, "thickness": _NUMBER, "fill_color": _COLOUR, "outline_color": _COLOUR}
_POINTS = {
    "type": _INTEGER,
    "points": _list(_POINT),
    "outline_color": _COLOUR,
    "outline_colors": _list(_COLOUR),
    "fill_color": _COLOUR,
    "thickness": _NUMBER,
}
_LABEL = {"position": _POINT, "text": _TEXT, "font_size": _NUMBER, "text_color": _COLOUR, "background_color": _COLOUR}
_ANNOTATIONS = {
    "circles": _list(_message("foxglove.CircleAnnotation", **_CIRCLE)),
    "points": _list(_message("foxglove.PointsAnnotation", **_POINTS)),
    "texts": _list(_message("foxglove.TextAnnotation", **_LABEL)),
}
# Viewers know the messages named foxglove.* by their public definitions.
SCHEMAS: dict[str, Schema] = {
    str(schema["title"]): schema
    for schema in (
        _message("foxglove.CompressedVideo", frame_id=_TEXT, data=_DATA, format=_TEXT),
        _message("foxglove.CompressedImage", frame_id=_TEXT, data=_DATA, format=_TEXT),
        _message("foxglove.Log", level=_INTEGER, message=_TEXT, name=_TEXT, file=_TEXT, line=_INTEGER),
        {"title": "foxglove.ImageAnnotations", "type": "object", "properties": _ANNOTATIONS},
        _message("lumenpilot.Pose", **_POSE),
        _message("lumenpilot.Robot", **_ROBOT),
        _message("lumenpilot.Motion", **_MOTION),
        _message("lumenpilot.Pace", **_PACE),
    )
}

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
    if reader.manifest is not None and reader.manifest.codec == "lossless":
        sources.append(_camera(_jpegs(reader), clock, "/camera/image", "jpeg"))
    else:
        sources.append(_camera(_packets(reader), clock, "/camera/video", "h264"))
    written = 0
    with new_file(path) as part, part.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="lumenpilot")
        channels: dict[str, int] = {}
        for at_ns, _, topic, content in heapq.merge(*sources, key=lambda message: message[:2]):
            if topic not in channels:
                name = TOPICS[topic]
                schema = writer.register_schema(name=name, encoding="jsonschema", data=json.dumps(SCHEMAS[name]).encode())
                channels[topic] = writer.register_channel(topic=topic, message_encoding="json", schema_id=schema)
            data = json.dumps(content, allow_nan=False, separators=(",", ":")).encode()
            writer.add_message(channels[topic], log_time=at_ns, publish_time=at_ns, data=data, sequence=written)
            written += 1
        if reader.manifest is not None:
            about = reader.manifest.model_dump(mode="json")
            writer.add_metadata("session", {key: json.dumps(value) for key, value in about.items()})
        writer.finish()  # type: ignore[no-untyped-call]
    return written


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
        values = _flat(row)
        for name in ("refusal", "mode", "sent_by"):
            values[name] = values[name] or ""
        values["state_number"] = list(PoseState).index(values["state"]) if values["state"] else None
        values["mode_number"] = list(Mode).index(values["mode"]) if values["mode"] else None
        yield at_ns, 1, "/camera/overlays", _overlays(row, stamp)
        for order, topic, names, is_there in (
            (2, "/pose", _POSE, True),
            (3, "/pace", _PACE, True),
            (4, "/robot", [name for name in values if name in _ROBOT or name.startswith("tendon_")], row.status is not None),
            (5, "/motion", _MOTION, row.sent is not None or row.drive is not None),
        ):
            if is_there:
                yield at_ns, order, topic, {"timestamp": stamp} | {name: values[name] for name in names}


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
            lines.append((name, np.array([vector.start, vector.end], np.float64), 3.0))
    for name, line, thickness in lines:
        corners = np.round(scene.points_to_source(line) + 0.5, 2).tolist()
        points.append(
            {
                "timestamp": stamp,
                "type": _LINE_STRIP,
                "points": [{"x": x, "y": y} for x, y in corners],
                "outline_color": dict(zip("rgba", (*_COLOURS[name], 1.0), strict=True)),
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


def _events(reader: SessionReader, clock: _Clock) -> Iterator[Message]:
    for event in reader.events:
        name, level = event.kind.value, _LEVELS.get(event.kind, 2)
        log = {"timestamp": clock.stamp(event.time_s), "level": level, "message": f"{name}: {event.text}" if event.text else name}
        yield clock.ns(event.time_s), 6, "/events", log | {"name": name, "file": "", "line": 0}


def _times(reader: SessionReader) -> Callable[[int, int], float]:
    """Capture time (s) of a picture; one that has lost its row is placed by its file's first one."""
    line = reader.timeline()
    known = {(int(v), int(p)): float(t) for v, p, t in zip(line.video, line.pts_ms, line.time_s, strict=True)}
    zero_s: dict[int, float] = {}
    for (video, pts_ms), time_s in known.items():
        zero_s.setdefault(video, time_s - pts_ms / 1000)
    start_s = reader.manifest.started_monotonic_s if reader.manifest is not None else 0.0
    return lambda video, pts_ms: known.get((video, pts_ms), zero_s.get(video, start_s) + pts_ms / 1000)


def _camera(pictures: Iterator[tuple[float, bytes]], clock: _Clock, topic: str, kind: str) -> Iterator[Message]:
    floor = 0
    for time_s, data in pictures:
        floor = max(floor, clock.ns(time_s))
        coded = base64.b64encode(data).decode()
        yield floor, 0, topic, {"timestamp": clock.stamp(time_s), "frame_id": "camera", "data": coded, "format": kind}


def _packets(reader: SessionReader) -> Iterator[tuple[float, bytes]]:
    """Capture time (s) and H.264 packet in Annex B form of each picture."""
    time_of = _times(reader)
    for path in reader.videos:
        number = video_number(path)
        if number is None:
            continue
        # What cannot be read of a damaged file is missing here; the reader names it.
        with suppress(av.error.FFmpegError, OSError, ValueError), open_video(path) as container:
            if not has_h264(container):
                continue
            to_annex_b = BitStreamFilterContext("h264_mp4toannexb", container.streams.video[0])
            for pts_ms, packet in sound_packets(packets_of(container), partial(reader.row_of, number)):
                for filtered in to_annex_b.filter(packet):
                    yield time_of(number, pts_ms), bytes(filtered)


def _jpegs(reader: SessionReader) -> Iterator[tuple[float, bytes]]:
    for place in range(len(reader)):
        frame = reader.frame(place)
        if frame is not None:
            bgr = cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR)
            done, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
            if done:
                yield frame.captured_s, data.tobytes()
