"""What goes to other programs while the rig runs: a WebSocket for Foxglove, and the outlets of the lab streaming layer (LSL).

Nothing comes in. Each receiver has a thread that takes the newest frame from a slot: a slow one loses frames, and nothing waits.
"""

from __future__ import annotations

import logging
import math
import platform
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from enum import StrEnum
from functools import partial
from typing import Any, Protocol

from core.config.models import StreamConfig
from core.control.drive_view import DriveView
from core.devices import Latest, UserError
from core.program import need_package
from core.session.manifest import About, Event, events_between
from core.session.values import event_line, row_of_tick
from core.system import lower_priority
from core.types import PoseState, Tick

_log = logging.getLogger(__name__)
_HOST = "127.0.0.1"
"""Loopback: who wants the stream on another computer forwards the port (``ssh -L``)."""
_EVERY_S = 1.0 / 30.0
"""A frame is sent thirty times a second at most."""
_POLL_S = 0.1
"""Events without pictures, and the end, are noticed after so long at most."""
_MOST_EVENTS = 256
"""Events that wait; older ones are dropped."""
_BACKLOG = 64
"""Messages that wait for one slow client, some eight frames; the server drops older ones."""
_CLOSED_WITHIN_S = 1.0
"""The server ends within milliseconds; then the port can be opened again."""
_JPEG_QUALITY = 80


class Receiver(Protocol):
    """Where frames and events go; used by one thread. ``address`` is for people.

    ``at_s`` is ``time.monotonic()`` of the capture or the event, also on a bench with a simulated clock. It does not go back from
    frame to frame, nor from event to event.
    """

    address: str

    def set_rig(self, about: About) -> None: ...
    def send(self, at_s: float, tick: Tick, drive: DriveView | None, bus: Any) -> None: ...
    def send_event(self, at_s: float, event: Event) -> None: ...
    def close(self) -> None: ...


class LiveOutput:
    """Sends the newest frame and all events to a receiver, in a thread of its own; its methods return at once.

    `open_receiver` is called in the thread and may take a second; it raises UserError.
    """

    def __init__(self, open_receiver: Callable[[], Receiver]) -> None:
        self.address = ""
        """Where the stream is; empty until it is open."""
        self.problem = ""
        """Why it is not open, or has ended."""
        self.on_change: Callable[[], object] = lambda: None
        """Called in the thread when ``address`` or ``problem`` has been set."""
        self._open_receiver = open_receiver
        self._newest: Latest[tuple[Tick, DriveView | None, Any]] = Latest()
        self._events: deque[Event] = deque(maxlen=_MOST_EVENTS)
        self._about: About | None = None
        self._view: DriveView | None = None
        self._opened, self._closing = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="live output", daemon=True)
        self._thread.start()

    def wait_open(self) -> None:
        """Wait until it is open. Raises UserError."""
        self._opened.wait()
        if self.problem:
            raise UserError(self.problem)

    def set_rig(self, about: About) -> None:
        """What the frames show from now on."""
        self._about = about

    def put(self, tick: Tick, drive: DriveView | None = None, bus: Any = None) -> None:
        """The newest frame, with who drives and the servo bus's status; one that was not sent yet is dropped."""
        self._newest.put((tick, drive, bus))

    def drive(self, view: DriveView) -> None:
        """Mode or faults have changed."""
        self._events.extend(events_between(self._view, view))
        self._view = view

    def add_event(self, event: Event) -> None:
        self._events.append(event)

    def end(self) -> None:
        """Send nothing more; returns at once."""
        self._closing.set()

    def close(self) -> None:
        """End the thread, and close what it has opened."""
        self._closing.set()
        self._thread.join()

    def _run(self) -> None:
        lower_priority()
        try:
            receiver = self._open_receiver()
            try:
                self.address = receiver.address
                self._opened.set()
                self.on_change()
                self._send_all(receiver)
            finally:
                receiver.close()
        except UserError as error:
            self._fail(str(error))
        except Exception as error:  # noqa: BLE001 - the one top of this thread: the rig goes on without it
            _log.error("the live output ended", exc_info=error)
            self._fail(f"the live output ended by an unexpected {type(error).__name__}: {error}")

    def _fail(self, problem: str) -> None:
        self.problem = problem
        self._opened.set()
        self.on_change()

    def _send_all(self, receiver: Receiver) -> None:
        about, due_s = None, 0.0
        frame_s = event_s = behind_s = 0.0  # of the last ones; how far the rig's clock is behind the real one
        while not self._closing.is_set():
            newest = self._newest.take(_POLL_S)
            if self._about is not about:
                about, behind_s = self._about, 0.0
                receiver.set_rig(about) if about is not None else None
            if newest is not None:
                frame = newest[0].frame
                behind_s = 0.0 if frame.published_s is None else frame.published_s - frame.captured_s
            while self._events:
                event = self._events.popleft()
                event_s = max(event_s, event.time_s + behind_s)
                receiver.send_event(event_s, event)
            if newest is not None:
                frame_s = max(frame_s, frame.captured_s + behind_s)  # a NaN changes nothing
                receiver.send(frame_s, *newest)
                # on average a thirtieth apart, as in the window
                due_s = max(due_s, time.monotonic() - _EVERY_S) + _EVERY_S
                self._closing.wait(max(0.0, due_s - time.monotonic()))


class FoxgloveServer:
    """A WebSocket server for Foxglove on this computer. Read only; without a subscriber nothing is encoded. Raises UserError."""

    def __init__(self, port: int) -> None:
        need_package("foxglove")
        from foxglove import Context, start_server

        from core.session.foxglove_messages import FoxgloveMessages

        if not is_free(port):
            raise UserError(f"port {port} is in use by another program: name another one with --stream PORT, or in the settings")
        self._context = Context()  # kept: the channels end with it
        self._messages = FoxgloveMessages(self._context, video=False)
        try:
            self._server = start_server(
                name="LumenPilot", host=_HOST, port=port, capabilities=[], context=self._context, message_backlog_size=_BACKLOG
            )
        except RuntimeError as error:
            raise UserError(f"port {port}: the stream cannot be opened ({error})") from None
        self.address = f"ws://{_HOST}:{self._server.port}"
        self._zero_ns = time.time_ns() - time.monotonic_ns()  # kept: stamps do not jump when the computer's time is set

    def set_rig(self, about: About) -> None:
        self._messages.set_rig(about.kind, about.config)

    def send(self, at_s: float, tick: Tick, drive: DriveView | None, bus: Any) -> None:
        at_ns = self._ns(at_s)
        if self._messages.wants_rows:
            self._messages.log_row(row_of_tick(tick, drive, bus), at_ns, at_ns)
        if self._messages.wants_pictures:
            from core.session.mcap_export import jpeg_of

            self._messages.log_picture(jpeg_of(tick.frame.image, _JPEG_QUALITY), at_ns, at_ns)

    def send_event(self, at_s: float, event: Event) -> None:
        at_ns = self._ns(at_s)
        self._messages.log_event(event, at_ns, at_ns)

    def _ns(self, time_s: float) -> int:
        return self._zero_ns + round(time_s * 1e9)

    def close(self) -> None:
        port = self._server.port
        self._server.stop()  # returns at once
        until_s = time.monotonic() + _CLOSED_WITHIN_S
        while time.monotonic() < until_s and not is_free(port):
            time.sleep(0.02)


def is_free(port: int) -> bool:
    """Whether no program listens on a port of this computer."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does: an ended connection is no listener
        try:
            probe.bind((_HOST, port))
        except OSError:
            return False
    return True


_CHANNELS = (("theta_signed_deg", "degrees"), ("d_head_px", "pixels"), ("d_tail_px", "pixels"), ("state", ""), ("confidence", ""))
"""Label and unit of the numbers in a sample of the pose; the state is 0 to 3 for A to D."""
_NO_STATE = -1.0


class LslOutlets:
    """Two streams of LSL: a sample of the pose for each frame (NaN: refused), and markers. Raises UserError.

    Stamps are capture times. As all of LSL they can be received in the whole local network.
    """

    address = "LumenPilot pose, LumenPilot markers"

    def __init__(self) -> None:
        need_package("pylsl")
        try:
            from pylsl import StreamInfo, StreamOutlet, local_clock
        except RuntimeError as error:  # its C library is missing
            raise UserError(f"pylsl: {' '.join(str(error).split())}") from None
        source = f"LumenPilot-{platform.node()}"
        pose = StreamInfo("LumenPilot pose", "Pose", len(_CHANNELS), 0.0, "float32", f"{source}-pose")
        channels = pose.desc().append_child("channels")
        for label, unit in _CHANNELS:
            channels.append_child("channel").append_child_value("label", label).append_child_value("unit", unit)
        self._pose = StreamOutlet(pose)
        self._markers = StreamOutlet(StreamInfo("LumenPilot markers", "Markers", 1, 0.0, "string", f"{source}-markers"))
        self._zero_s = local_clock() - time.monotonic()
        self._state: PoseState | None = None

    def set_rig(self, about: About) -> None:
        self._mark(f"rig: {about.kind} {about.rig}", time.monotonic())

    def send(self, at_s: float, tick: Tick, drive: DriveView | None, bus: Any) -> None:
        pose = tick.scene.pose
        sample = [math.nan, math.nan, math.nan, _NO_STATE, math.nan]
        if pose is not None:
            place = list(PoseState).index(pose.state)
            sample = [pose.theta_signed_deg, pose.d_head_px, pose.d_tail_px, float(place), pose.confidence]
        self._pose.push_sample(sample, self._zero_s + at_s)
        state = pose.state if pose is not None else None
        if state is not self._state:
            self._state = state
            self._mark(f"state: {state.value if state is not None else tick.scene.refusal or 'no pose'}", at_s)

    def send_event(self, at_s: float, event: Event) -> None:
        self._mark(event_line(event), at_s)

    def _mark(self, text: str, at_s: float) -> None:
        self._markers.push_sample([text], self._zero_s + at_s)

    def close(self) -> None:
        del self._pose, self._markers  # their streams end with them


class OutputKind(StrEnum):
    """The values are the fields of ``StreamConfig`` that switch them on."""

    FOXGLOVE = "foxglove"
    LSL = "lsl"


def open_output(kind: OutputKind, port: int) -> LiveOutput:
    """Begin to open an output; `port` is that of the WebSocket."""
    return LiveOutput(partial(FoxgloveServer, port) if kind is OutputKind.FOXGLOVE else LslOutlets)


def open_outputs(config: StreamConfig) -> dict[OutputKind, LiveOutput]:
    """Begin to open those that a configuration switches on."""
    return {kind: open_output(kind, config.port) for kind in OutputKind if getattr(config, kind.value)}
