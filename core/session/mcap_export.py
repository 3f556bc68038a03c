"""A session as MCAP: with the schemas of Foxglove, or as messages of ROS 2. Foxglove opens both, PlotJuggler the former.

The packets of a lossy video are copied for Foxglove as they are (H.264 in Annex B form, which viewers decode); of a lossless one,
which they do not know, and for ROS 2, JPEG pictures are made.
"""

from __future__ import annotations

import heapq
import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import IO, Protocol

import av.error
import cv2
from av.bitstream import BitStreamFilterContext

from core.session.codec import RecordedRow
from core.session.export import Advance, new_file
from core.session.manifest import Event
from core.session.reader import SessionReader
from core.session.video import has_h264, open_video, packets_of, sound_packets, video_number
from core.types import Image

_JPEG_QUALITY = 90


class Messages(Protocol):
    """What makes messages. Times in ns since 1970: when it was (`stamp_ns`), and a never falling one, which orders them."""

    logged: int

    def log_picture(self, data: bytes, stamp_ns: int, log_ns: int) -> None: ...
    def log_row(self, row: RecordedRow, stamp_ns: int, log_ns: int) -> None: ...
    def log_event(self, event: Event, stamp_ns: int, log_ns: int) -> None: ...


def export_mcap(reader: SessionReader, path: Path, on_row: Advance = lambda: None) -> int:
    """Write all of a session with the schemas of Foxglove; returns the messages. Raises SessionError."""
    from foxglove import Context, open_mcap

    from core.session.foxglove_messages import FoxgloveMessages

    reader.wait()
    about = reader.manifest
    is_lossless = about is not None and about.codec == "lossless"
    with new_file(path) as part, part.open("wb") as file:
        output, context = _Output(file), Context()
        try:
            with open_mcap(output, context=context) as writer:
                messages = FoxgloveMessages(context, video=not is_lossless)
                if about is not None:
                    messages.set_rig(about.kind, about.config)
                    writer.write_metadata("session", _metadata(reader))
                for log in _in_order(reader, messages, _jpegs(reader) if is_lossless else _packets(reader), on_row):
                    log()
                    output.check()
        except RuntimeError:  # what the writer makes of an error of the file
            output.check()
            raise
    return messages.logged


def export_ros2(reader: SessionReader, path: Path, on_row: Advance = lambda: None) -> int:
    """Write all of a session as messages of ROS 2; returns the messages. Raises SessionError."""
    from core.session.ros2_messages import Ros2Messages

    reader.wait()
    kind, config = (about.kind, about.config) if (about := reader.manifest) is not None else ("UNKNOWN", {})
    with new_file(path) as part, part.open("wb") as file:
        messages = Ros2Messages(file, _metadata(reader), kind, config)
        for log in _in_order(reader, messages, _jpegs(reader), on_row):
            log()
        messages.finish()
    return messages.logged


class _Output:
    """A file of which the SDK only logs that it cannot be written."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._error: OSError | None = None
        self.seek, self.flush = file.seek, file.flush

    def write(self, data: bytes | bytearray) -> int:
        try:
            return self._file.write(data)
        except OSError as error:
            self._error = error
            raise

    def check(self) -> None:
        """Raises the OSError of an earlier ``write``."""
        if self._error is not None:
            raise self._error


def _metadata(reader: SessionReader) -> dict[str, str]:
    about = reader.manifest.model_dump(mode="json") if reader.manifest is not None else {}
    return {key: json.dumps(value) for key, value in about.items()}


Call = Callable[[], None]
_Message = tuple[int, int, Call]
"""Time (ns since 1970), an order among equal times, and what logs it."""


def _in_order(reader: SessionReader, to: Messages, pictures: Iterator[tuple[float, bytes]], on_row: Advance) -> Iterator[Call]:
    """The calls that log a session, in the order of time."""
    clock = _Clock(reader)
    sources = (_pictures(pictures, clock, to), _rows(reader, clock, to, on_row), _events(reader, clock, to))
    return (log for *_, log in heapq.merge(*sources, key=lambda message: message[:2]))


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


def _pictures(pictures: Iterator[tuple[float, bytes]], clock: _Clock, to: Messages) -> Iterator[_Message]:
    floor = 0
    for time_s, data in pictures:
        at_ns = clock.ns(time_s)
        floor = max(floor, at_ns)  # a clock that went back must not break the order of the file
        yield floor, 0, partial(to.log_picture, data, at_ns, floor)


def _rows(reader: SessionReader, clock: _Clock, to: Messages, on_row: Advance) -> Iterator[_Message]:
    floor = 0
    for place in range(len(reader)):
        row = reader.row(place)
        on_row()
        if row is not None:
            at_ns = clock.ns(row.captured_s)
            floor = max(floor, at_ns)
            yield floor, 1, partial(to.log_row, row, at_ns, floor)


def _events(reader: SessionReader, clock: _Clock, to: Messages) -> Iterator[_Message]:
    for event in reader.events:
        at_ns = clock.ns(event.time_s)
        yield at_ns, 2, partial(to.log_event, event, at_ns, at_ns)


def _times(reader: SessionReader) -> Callable[[int, int], float]:
    """Capture time (s) of a picture; one that has lost its row is placed by its file's first one."""
    line = reader.timeline()
    known = {(int(v), int(p)): float(t) for v, p, t in zip(line.video, line.pts_ms, line.time_s, strict=True)}
    zero_s: dict[int, float] = {}
    for (video, pts_ms), time_s in known.items():
        zero_s.setdefault(video, time_s - pts_ms / 1000)
    start_s = reader.manifest.started_monotonic_s if reader.manifest is not None else 0.0
    return lambda video, pts_ms: known.get((video, pts_ms), zero_s.get(video, start_s) + pts_ms / 1000)


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
            yield frame.captured_s, jpeg_of(frame.image, _JPEG_QUALITY)


def jpeg_of(image: Image, quality: int) -> bytes:
    """An RGB picture as JPEG."""
    _, data = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])
    return data.tobytes()
