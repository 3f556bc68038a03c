"""Live output: received by clients that we did not write, in processes of their own; nothing waits for them."""

import base64
import json
import math
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from importlib import util
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import psutil
import pytest
from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from core.control.drive_view import DriveView
from core.control.modes import Mode
from core.devices import UserError
from core.session import mcap_export
from core.session.live_output import FoxgloveServer, LiveOutput, LslOutlets, is_free
from core.session.manifest import About, Event, EventKind
from core.types import Tick
from tests.app.bus_status import bus
from tests.core.session_data import ABOUT, drive_of, number_in, tick_of

CLIENT = Path(__file__).with_name("live_client.py")
TOPICS = ("/camera/image", "/camera/overlays", "/pose", "/measured_js", "/operating_state", "/events")


@pytest.fixture
def server() -> Iterator[FoxgloveServer]:
    server = FoxgloveServer(0)
    yield server
    server.close()


def port_of(server: FoxgloveServer) -> int:
    return int(server.address.rpartition(":")[2])


def decoded(channel: dict[str, Any], data: str) -> Any:
    """A message by what the server says of its channel."""
    content = base64.b64decode(data)
    if channel["encoding"] == "json":
        return json.loads(content)
    pool = descriptor_pool.DescriptorPool()
    for file in FileDescriptorSet.FromString(base64.b64decode(channel["schema"])).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"])).FromString(content)


def test_a_client_in_another_process_sees_all_and_can_ask_for_nothing() -> None:
    output = LiveOutput(lambda: FoxgloveServer(0))
    output.wait_open()
    output.set_rig(ABOUT)
    before_ns = time.time_ns()
    command = [sys.executable, str(CLIENT), output.address, ",".join(TOPICS)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as client:
        index = 0
        while client.poll() is None:
            now_s = time.monotonic()
            output.put(tick_of(index, now_s, full=True), drive_of(now_s), bus())
            output.add_event(Event(now_s, EventKind.NOTE, "mark 1"))
            index += 1
            time.sleep(0.02)
        told = json.loads(client.stdout.read())
    output.close()
    assert (told["protocol"], told["capabilities"]) == ("foxglove.sdk.v1", [])
    assert "clientPublish" in told["status"]
    stamps, found = {}, {}
    for topic, (at_ns, data) in told["messages"].items():
        stamps[topic], found[topic] = at_ns, decoded(told["channels"][topic], data)
    assert all(before_ns <= at_ns <= time.time_ns() for at_ns in stamps.values())
    image = cv2.imdecode(np.frombuffer(found["/camera/image"].data, np.uint8), cv2.IMREAD_COLOR)
    assert 0 <= number_in(np.asarray(image, np.uint8)) < index
    assert found["/camera/overlays"].texts[0].text == "SIM  D  theta -5.5 deg"
    assert (found["/pose"]["state"], found["/operating_state"]["state"]) == ("D", "FAULT")
    assert found["/measured_js"].joints[0].name == "right"
    assert found["/events"].message == "note: mark 1"


def test_without_a_subscriber_nothing_is_encoded(server: FoxgloveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    def encode(*_: object) -> bytes:
        raise AssertionError("encoded")

    monkeypatch.setattr(mcap_export, "jpeg_of", encode)
    monkeypatch.setattr("core.session.live_output.row_of_tick", encode)
    server.send(1.0, tick_of(0, 1.0, full=True), drive_of(1.0), bus())


def subscribed(port: int, channel: int) -> socket.socket:
    """A client that subscribes, and never reads from then on."""
    client = socket.create_connection(("127.0.0.1", port))
    key = base64.b64encode(bytes(16)).decode()
    client.sendall(
        f"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n".encode()
    )
    assert client.recv(4096).startswith(b"HTTP/1.1 101")
    text = json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": channel}]}).encode()
    client.sendall(struct.pack("!BB4x", 0x81, 0x80 | len(text)) + text)  # masked with zeros
    return client


def test_a_client_that_never_reads_costs_frames_and_bounded_memory(server: FoxgloveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    frame, count = bytes(400_000), 600  # 240 MB
    monkeypatch.setattr(mcap_export, "jpeg_of", lambda *_: frame)
    channel = server._messages._image
    with subscribed(port_of(server), channel.id()):
        while not channel.has_sinks():
            time.sleep(0.005)
        before = psutil.Process().memory_info().rss
        for index in range(count):
            server.send(1.0, tick_of(index, 1.0), None, None)  # returns, whatever the client does
        assert psutil.Process().memory_info().rss - before < 0.4 * count * len(frame)


class StuckReceiver:
    """Begins to send and does not return before it is released."""

    address = "nowhere"

    def __init__(self) -> None:
        self.sent: list[int] = []
        self.events: list[str] = []
        self.stamps: list[float] = []
        self.began, self.release, self.last = threading.Event(), threading.Event(), threading.Event()

    def set_rig(self, about: About) -> None: ...

    def send(self, at_s: float, tick: Tick, drive: DriveView | None, bus: Any) -> None:
        self.sent.append(tick.frame.index)
        self.stamps.append(at_s)
        self.began.set()
        self.release.wait()
        if tick.frame.index == 999:
            self.last.set()

    def send_event(self, at_s: float, event: Event) -> None:
        self.events.append(event.text)
        self.stamps.append(at_s)
        self.last.set()

    def close(self) -> None: ...


def test_a_receiver_that_is_stuck_gets_the_newest_frame_and_all_events() -> None:
    receiver = StuckReceiver()
    output = LiveOutput(lambda: receiver)
    output.put(tick_of(0, 0.0))
    receiver.began.wait()
    for index in range(1, 1000):
        output.put(tick_of(index, 0.0))
    for mode in (Mode.ADVISORY, Mode.ARMED):
        output.drive(DriveView(1.0, mode=mode))
    receiver.release.set()
    receiver.last.wait()
    output.close()
    assert receiver.sent == [0, 999]
    assert receiver.events == ["ADVISORY", "ARMED", ""]


def test_stamps_are_real_times_and_never_go_back() -> None:
    receiver = StuckReceiver()
    receiver.release.set()
    output = LiveOutput(lambda: receiver)

    def frame_at(captured_s: float, published_s: float | None = None) -> float:
        tick = tick_of(999, captured_s)
        receiver.last.clear()
        output.put(replace(tick, frame=replace(tick.frame, published_s=published_s)))
        receiver.last.wait()
        return receiver.stamps.pop()

    def event_at(time_s: float) -> float:
        receiver.last.clear()
        output.add_event(Event(time_s, EventKind.NOTE, "mark"))
        receiver.last.wait()
        return receiver.stamps.pop()

    assert (frame_at(10.0), event_at(10.5)) == (10.0, 10.5)  # a camera
    assert (frame_at(5.0, 12.0), event_at(5.5)) == (12.0, 12.5)  # the twin's clock is 7 s behind,
    assert (frame_at(5.25, 13.0), event_at(5.375)) == (13.0, 13.125)  # then 7.75 s, as it waited for the program
    assert (frame_at(5.5, 12.5), event_at(5.0)) == (13.0, 13.125)
    assert frame_at(math.nan) == 13.0
    assert (frame_at(14.0), event_at(14.5)) == (14.0, 14.5)  # a camera again
    output.close()


def test_an_error_in_the_receiver_ends_it_alone(caplog: pytest.LogCaptureFixture) -> None:
    receiver, ended = StuckReceiver(), threading.Event()
    receiver.send = None
    output = LiveOutput(lambda: receiver)
    output.on_change = lambda: output.problem and ended.set()
    output.put(tick_of(0, 0.0))
    ended.wait()
    output.put(tick_of(1, 0.0))
    output.close()
    assert output.problem.startswith("the live output ended by an unexpected TypeError")


def test_a_port_in_use_is_named_and_free_after_the_end(server: FoxgloveServer) -> None:
    port = port_of(server)
    with pytest.raises(UserError, match=rf"^port {port} is in use by another program"):
        LiveOutput(lambda: FoxgloveServer(port)).wait_open()
    server.close()
    assert is_free(port)


@pytest.mark.parametrize(("open_receiver", "extra"), [(lambda: FoxgloveServer(0), "foxglove"), (LslOutlets, "pylsl")])
def test_a_missing_extra_is_one_line_with_the_command(open_receiver: Any, extra: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(util, "find_spec", lambda _name: None)
    with pytest.raises(UserError, match=rf"^this needs the package {extra}, which is not installed: make setup$"):
        LiveOutput(open_receiver).wait_open()


LOOPBACK = "[multicast]\nResolveScope = machine\n[lab]\nKnownPeers = {127.0.0.1}\n[log]\nlevel = -3\n"
INLETS = """
import json, pylsl, sys
pylsl.set_config_content(sys.argv[1])
(pose,), (marks,) = (pylsl.resolve_byprop("name", f"LumenPilot {what}") for what in ("pose", "markers"))
pose, marks = pylsl.StreamInlet(pose), pylsl.StreamInlet(marks)
pose.open_stream(), marks.open_stream()
samples = {}  # by their state: a refused one, and one with a pose
while len(samples) < 2:
    sample, at_s = pose.pull_sample()
    samples[sample[3]] = [sample, at_s]
print(json.dumps([[samples[-1.0], samples[3.0]], [marks.pull_sample() for _ in range(3)], pose.info().as_xml()]))
"""


def test_lsl_inlets_in_another_process_get_poses_and_markers() -> None:
    import pylsl

    pylsl.set_config_content(LOOPBACK)
    output = LiveOutput(LslOutlets)
    output.wait_open()
    with subprocess.Popen([sys.executable, "-c", INLETS, LOOPBACK], stdout=subprocess.PIPE, text=True) as inlets:
        index = 0
        while inlets.poll() is None:
            now_s = time.monotonic()
            output.put(tick_of(index, now_s, full=index % 10 < 5))
            output.add_event(Event(now_s, EventKind.NOTE, "mark 1"))
            index += 1
            time.sleep(0.02)
        poses, marks, about = json.loads(inlets.stdout.read())
    output.close()
    (refused, _), (seen, _) = poses
    assert (seen[:3], seen[3:]) == ([-5.5, 1.25, 2.5], [3.0, 0.875])
    assert math.isnan(refused[0])
    assert refused[3] == -1.0
    assert all(0.0 <= time.monotonic() - at_s < 3600.0 for _, at_s in poses)
    assert {text for (text,), _ in marks} <= {"note: mark 1", "state: D", "state: no robot: 0 px"}
    assert "<label>d_head_px</label>" in about
