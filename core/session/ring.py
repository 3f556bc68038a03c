"""The last seconds, encoded, in memory: what "save the last 30 s" writes out. Bounded in time and in bytes."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from core.session.events import Event, EventKind
from core.session.video import FrameEncoder, Packet

_MAX_EVENTS = 2000


@dataclass(frozen=True, slots=True, eq=False)
class EncodedFrame:
    """A frame ready to be written: its packet, the encoder that made it, and its row's JSON without its place in a session.

    ``dropped`` counts the frames that the recorder dropped before it, ever.
    """

    captured_s: float
    packet: Packet
    encoder: FrameEncoder
    row: str
    dropped: int = 0

    @property
    def nbytes(self) -> int:
        return len(self.packet.data) + len(self.row)


class Ring:
    """Keeps frames and events. What it holds always begins at a key picture, so it may reach up to a second further back."""

    def __init__(self, seconds: float, max_bytes: int) -> None:
        self._seconds = seconds
        self._max_bytes = max_bytes
        self._groups: deque[list[EncodedFrame]] = deque()
        self._events: deque[Event] = deque()
        self._target: Event | None = None
        self._bytes = 0

    @property
    def seconds(self) -> float:
        """How much it holds now."""
        if not self._groups:
            return 0.0
        return max(0.0, self._groups[-1][-1].captured_s - self._groups[0][0].captured_s)

    @property
    def nbytes(self) -> int:
        return self._bytes

    def add(self, frame: EncodedFrame) -> None:
        """Take a frame in and let the oldest go. Frames before the first key picture are not kept."""
        if frame.packet.is_key:
            self._groups.append([])
        if not self._groups:
            return
        self._groups[-1].append(frame)
        self._bytes += frame.nbytes
        while len(self._groups) > 1 and (self._is_old(frame.captured_s) or self._bytes > self._max_bytes):
            self._bytes -= sum(old.nbytes for old in self._groups.popleft())

    def _is_old(self, now_s: float) -> bool:
        """Is the oldest group not needed, since the next one reaches back far enough? A clock that went back ages everything."""
        age_s = now_s - self._groups[1][0].captured_s
        return age_s >= self._seconds or age_s < 0.0

    def add_event(self, event: Event) -> None:
        """Take it in and let the oldest go; the destination among these stays in force."""
        self._events.append(event)
        while len(self._events) > _MAX_EVENTS:
            old = self._events.popleft()
            if old.kind is EventKind.TARGET:
                self._target = old

    def content(self) -> tuple[list[EncodedFrame], list[Event]]:
        """A copy: the frames in order, and the events since the first of them, with the destination that was chosen before."""
        frames = [frame for group in self._groups for frame in group]
        if not frames:
            return [], []
        first_s = frames[0].captured_s
        chosen = [] if self._target is None else [self._target]
        chosen += [event for event in self._events if event.kind is EventKind.TARGET and event.time_s < first_s]
        before = [replace(event, time_s=first_s) for event in chosen[-1:] if event.data]
        return frames, before + [event for event in self._events if event.time_s >= first_s]

    def clear(self) -> None:
        self._groups.clear()
        self._events.clear()
        self._target = None
        self._bytes = 0
