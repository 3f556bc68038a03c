"""MCAP exports, read by mcap's own reader, protobuf and the decoder of mcap-ros2-support."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import cv2
import numpy as np
import pytest
from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from core.session.manifest import SessionError, read_manifest
from core.session.mcap_export import export_mcap, export_ros2
from core.session.reader import SessionReader
from core.types import Command
from hardware.servos.bus_ipc import IssuedGoals
from tests.app.bus_status import bus, servo
from tests.core.session_data import QUICK, number_in, record, tick_of

COUNT = 40


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty frames of a robot with servos; from frame 20 on with all that a scene can have."""
    status = bus(sent=IssuedGoals((0.5,) * 7, Command(), 1000.0, None))
    ticks = (tick_of(i, 1000.0 + i / 10, full=i >= 20) for i in range(COUNT))
    return record(tmp_path_factory.mktemp("session"), ticks, driven=True, bus=status)


Found = dict[str, list[tuple[int, Any]]]


def protobuf_message(schema: Schema, data: bytes) -> Any:
    """A message by the definition that the file brings."""
    pool = descriptor_pool.DescriptorPool()
    for file in FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name)).FromString(data)


def messages(path: Path) -> Found:
    """Time and content by topic, in the order of the file's index."""
    found: Found = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            is_json = channel.message_encoding == "json"
            content = json.loads(message.data) if is_json else protobuf_message(schema, message.data)
            found.setdefault(channel.topic, []).append((message.log_time, content))
    return found


@pytest.fixture(scope="module")
def foxglove(session: Path, tmp_path_factory: pytest.TempPathFactory) -> Found:
    path = tmp_path_factory.mktemp("mcap") / "x.mcap"
    with SessionReader(session) as reader:
        written = export_mcap(reader, path)
    with path.open("rb") as file:
        (metadata,) = make_reader(file).iter_metadata()
    assert (metadata.name, json.loads(metadata.metadata["kind"])) == ("session", "SIM")
    found = messages(path)
    assert sum(map(len, found.values())) == written
    return found


def test_all_topics_are_there_in_order_of_time(session: Path, foxglove: Found) -> None:
    assert set(foxglove) == {
        *("/camera/video", "/camera/overlays", "/events", "/pose", "/pace", "/robot", "/motion"),
        *("/operating_state", "/measured_js", "/setpoint_js"),
    }
    start_ns = round(read_manifest(session).started_utc.timestamp() * 1e9)
    for topic in ("/camera/video", "/camera/overlays", "/pose", "/motion", "/measured_js"):
        times = [at_ns - start_ns for at_ns, _ in foxglove[topic]]
        assert times == pytest.approx([i * 1e8 for i in range(COUNT)], abs=2e6), topic
    poses = [content for _, content in foxglove["/pose"]]
    assert (poses[0]["state"], poses[0]["theta_signed_deg"], poses[0]["refusal"]) == (None, None, "no robot: 0 px")
    assert (poses[30]["state"], poses[30]["state_number"], poses[30]["theta_signed_deg"]) == ("D", 3, -5.5)
    motion = foxglove["/motion"][30][1]
    assert (motion["mode"], motion["asked_bend"], motion["commanded_advance_mm_s"]) == ("ARMED", 0.25, 2.0)
    assert foxglove["/robot"][30][1]["tendon_force_mn_left"] == 2.0
    assert any(log.level == 4 and log.message.startswith("fault: ") for _, log in foxglove["/events"])


def test_joints_are_in_metres_and_the_state_in_the_words_of_crtk(foxglove: Found) -> None:
    joints = foxglove["/measured_js"][30][1].joints
    assert [joint.name for joint in joints][:2] == ["right", "left"]
    assert joints[0].position == pytest.approx(1e-3 * (servo(0).position_mm or 0.0))
    assert [joint.position for joint in foxglove["/setpoint_js"][30][1].joints] == [pytest.approx(5e-4)] * 7
    state = foxglove["/operating_state"][30][1]
    assert (state["state"], state["is_homed"], state["is_busy"]) == ("FAULT", True, True)  # a fault is latched


def test_video_decodes_message_by_message(foxglove: Found) -> None:
    """As a viewer does: each message is one picture in Annex B form; key pictures bring their parameter sets."""
    decoder = av.CodecContext.create("h264", "r")
    numbers = []
    for place, (_, content) in enumerate(foxglove["/camera/video"]):
        data = content.data
        assert content.format == "h264"
        assert data.startswith((b"\x00\x00\x00\x01", b"\x00\x00\x01"))
        if place % 30 == 0:
            assert any(unit and unit[0] & 0x1F == 7 for unit in data.split(b"\x00\x00\x01")), "no parameter set"
        for frame in decoder.decode(av.Packet(data)):
            numbers.append(number_in(frame.to_ndarray(format="rgb24")))
    numbers += [number_in(frame.to_ndarray(format="rgb24")) for frame in decoder.decode(None)]
    assert numbers == list(range(COUNT))


def test_overlays_lie_on_the_picture_as_viewers_count_pixels(foxglove: Found) -> None:
    overlays = foxglove["/camera/overlays"][30][1]
    lines = [[(point.x, point.y) for point in line.points] for line in overlays.points if line.type == 3]
    # the robot vector from (0, 30) to (20, 32), pixel centres at integers: half a pixel more from the corner
    assert [(0.5, 30.5), (20.5, 32.5)] in lines
    outlines = [line for line in overlays.points if line.type == 2]
    assert len(outlines) == 3  # the vessel, the hole in it, the robot
    assert overlays.texts[0].text == "SIM  D  theta -5.5 deg"


def test_a_lossless_session_has_pictures(tmp_path: Path) -> None:
    config = QUICK.model_copy(update={"codec": "lossless"})
    session = record(tmp_path, (tick_of(i, 1000.0 + i / 30) for i in range(3)), config)
    with SessionReader(session) as reader:
        export_mcap(reader, tmp_path / "x.mcap")
    images = messages(tmp_path / "x.mcap")["/camera/image"]
    decoded = [cv2.imdecode(np.frombuffer(content.data, np.uint8), cv2.IMREAD_COLOR) for _, content in images]
    assert [number_in(np.asarray(image, np.uint8)) for image in decoded] == [0, 1, 2]


def test_the_pictures_of_all_videos_that_are_left_are_there(tmp_path: Path) -> None:
    config = QUICK.model_copy(update={"split_s": 1.0})
    session = record(tmp_path, (tick_of(i, 1000.0 + i / 30.0) for i in range(75)), config)
    found = []
    for name in ("whole.mcap", "left.mcap"):
        with SessionReader(session) as reader:
            export_mcap(reader, tmp_path / name)
        found.append([(at_ns, content.data) for at_ns, content in messages(tmp_path / name)["/camera/video"]])
        (session / "video_0000.mkv").unlink(missing_ok=True)
    whole, left = found
    assert 30 < len(left) < len(whole) == 75
    assert left == whole[-len(left) :]


def test_ros2_messages_are_decoded_by_their_definitions(session: Path, tmp_path: Path) -> None:
    with SessionReader(session) as reader:
        written = export_ros2(reader, tmp_path / "x.ros2.mcap")
    found: dict[str, list[SimpleNamespace]] = {}
    with (tmp_path / "x.ros2.mcap").open("rb") as file:
        reading = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reading.get_header().profile == "ros2"
        for _, channel, message, decoded in reading.iter_decoded_messages():
            found.setdefault(channel.topic, []).append(decoded)
            assert message.log_time > 0
    assert sum(map(len, found.values())) == written
    pictures = [cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR) for image in found["/camera/image/compressed"]]
    assert [number_in(np.asarray(picture, np.uint8)) for picture in pictures] == list(range(COUNT))
    assert [angle.data for angle in found["/pose/theta_signed_deg"]] == [-5.5] * 20
    assert (found["/pose/state"][0].data, found["/pose/state"][30].data) == ("", "D")
    joints = found["/measured_js"][0]
    assert joints.name[0] == "right"
    assert joints.position[0] == pytest.approx(1e-3 * (servo(0).position_mm or 0.0))
    assert joints.header.stamp.sec == int(read_manifest(session).started_utc.timestamp())
    values = {pair.key: pair.value for pair in found["/diagnostics"][30].status[0].values}
    assert (values["mode"], values["asked_bend"]) == ("ARMED", "0.25")
    assert any(log.level == 40 and log.msg.startswith("fault: ") for log in found["/rosout"])


@pytest.mark.parametrize("export", [export_mcap, export_ros2])
def test_a_full_disk_is_said_and_leaves_nothing(
    session: Path, tmp_path: Path, export: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    real_open = Path.open

    def full(path: Path, *arguments: Any, **options: Any) -> Any:
        return real_open(Path("/dev/full") if path.suffix == ".part" else path, *arguments, **options)

    monkeypatch.setattr(Path, "open", full)
    with SessionReader(session) as reader, pytest.raises(SessionError, match="No space left"):
        export(reader, tmp_path / "x.mcap")
    assert list(tmp_path.iterdir()) == []
