"""Exports: opened again by what reads them."""

from __future__ import annotations

import base64
import csv
import errno
import json
import os
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from mcap.reader import make_reader

from core.session.export import TOPICS, export_csv, export_mcap, export_mp4
from core.session.manifest import SessionError, read_manifest
from core.session.reader import SessionReader
from core.session.recovery import recover
from core.session.writer import SessionWriter
from core.types import Image, Tick
from tests.core.session_data import ABOUT, QUICK, drive_of, number_in, record, tick_of

COUNT = 40


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty frames, the camera's clock standing still once; from frame 20 on with all that a scene can have."""
    writer = SessionWriter(QUICK, ABOUT, folder=tmp_path_factory.mktemp("session"), clock=lambda: 1000.0)
    writer.start()
    for i in range(COUNT):
        time_s = 1000.0 + i / 10
        writer.put(tick_of(i, time_s, full=i >= 20), drive_of(time_s))
    assert writer.close()
    saved = writer.status().saved
    assert saved is not None
    return saved


def messages(path: Path) -> dict[str, list[tuple[int, dict[str, object]]]]:
    """Content by topic, in the order of the file's index, by mcap's own reader."""
    found: dict[str, list[tuple[int, dict[str, object]]]] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            assert schema.name == TOPICS[channel.topic]
            assert channel.message_encoding == "json"
            found.setdefault(channel.topic, []).append((message.log_time, json.loads(message.data)))
    return found


def test_csv_has_a_line_a_frame_and_blanks_where_something_is_missing(session: Path, tmp_path: Path) -> None:
    with SessionReader(session) as reader:
        assert export_csv(reader, tmp_path / "x.csv") == COUNT
    with (tmp_path / "x.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["index"]) for row in rows] == list(range(COUNT))
    assert (rows[0]["state"], rows[0]["theta_signed_deg"], rows[0]["refusal"]) == ("", "", "no robot: 0 px")
    assert (rows[25]["state"], rows[25]["theta_signed_deg"], rows[25]["refusal"]) == ("D", "-5.5", "")
    assert (rows[25]["asked_bend"], rows[25]["commanded_advance_mm_s"], rows[25]["sent_bend"]) == ("0.25", "2.0", "0.5")
    assert (rows[25]["mode"], rows[25]["time_s"], rows[25]["insertion_mm"]) == ("ARMED", "2.5", "12.5")


def test_mp4_plays_at_the_captured_times(session: Path, tmp_path: Path) -> None:
    with SessionReader(session) as reader:
        assert export_mp4(reader, tmp_path / "x.mp4") == COUNT
    with av.open(str(tmp_path / "x.mp4")) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        frames = list(container.decode(stream))
    assert [number_in(frame.to_ndarray(format="rgb24")) for frame in frames] == list(range(COUNT))
    assert [frame.time for frame in frames] == pytest.approx([i / 10 for i in range(COUNT)], abs=0.002)


def test_mp4_burns_in_what_is_drawn_and_takes_odd_sizes_and_a_clip(session: Path, tmp_path: Path) -> None:
    drawn: list[int] = []

    def draw(tick: Tick) -> Image:
        drawn.append(tick.frame.index)
        return np.full((81, 121, 3), 200, np.uint8)

    with SessionReader(session) as reader:
        assert export_mp4(reader, tmp_path / "x.mp4", draw, first=10, last=15) == 5
    assert drawn == [10, 11, 12, 13, 14]
    with av.open(str(tmp_path / "x.mp4")) as container:
        frame = next(container.decode(video=0))
    assert (frame.width, frame.height) == (122, 82)
    assert frame.to_ndarray(format="rgb24").mean() == pytest.approx(200, abs=3)


def test_mcap_has_all_topics_in_order_of_time(session: Path, tmp_path: Path) -> None:
    with SessionReader(session) as reader:
        written = export_mcap(reader, tmp_path / "x.mcap")
    with (tmp_path / "x.mcap").open("rb") as file:
        (metadata,) = make_reader(file).iter_metadata()
    assert (metadata.name, json.loads(metadata.metadata["kind"])) == ("session", "SIM")
    found = messages(tmp_path / "x.mcap")
    assert set(found) == set(TOPICS) - {"/camera/image"}
    assert sum(map(len, found.values())) == written
    start_ns = round(read_manifest(session).started_utc.timestamp() * 1e9)
    for topic in ("/camera/video", "/camera/overlays", "/pose", "/motion"):
        times = [at_ns - start_ns for at_ns, _ in found[topic]]
        assert times == pytest.approx([i * 1e8 for i in range(COUNT)], abs=2e6), topic
    poses = [content for _, content in found["/pose"]]
    assert (poses[0]["state"], poses[0]["theta_signed_deg"], poses[0]["refusal"]) == (None, None, "no robot: 0 px")
    assert (poses[30]["state"], poses[30]["theta_signed_deg"]) == ("D", -5.5)
    motion = found["/motion"][30][1]
    assert (motion["mode"], motion["asked_bend"], motion["commanded_advance_mm_s"]) == ("ARMED", 0.25, 2.0)
    assert any(str(content["message"]).startswith("fault: ") for _, content in found["/events"])


def test_mcap_video_decodes_message_by_message(session: Path, tmp_path: Path) -> None:
    """As a viewer does: each message is one picture in Annex B form; key pictures bring their parameter sets."""
    with SessionReader(session) as reader:
        export_mcap(reader, tmp_path / "x.mcap")
    decoder = av.CodecContext.create("h264", "r")
    numbers = []
    for place, (_, content) in enumerate(messages(tmp_path / "x.mcap")["/camera/video"]):
        data = base64.b64decode(str(content["data"]), validate=True)
        assert content["format"] == "h264"
        assert data.startswith((b"\x00\x00\x00\x01", b"\x00\x00\x01"))
        if place % 30 == 0:
            assert any(unit and unit[0] & 0x1F == 7 for unit in data.split(b"\x00\x00\x01")), "no parameter set"
        for frame in decoder.decode(av.Packet(data)):
            numbers.append(number_in(frame.to_ndarray(format="rgb24")))
    numbers += [number_in(frame.to_ndarray(format="rgb24")) for frame in decoder.decode(None)]
    assert numbers == list(range(COUNT))


def test_mcap_overlays_lie_on_the_picture_as_viewers_count_pixels(session: Path, tmp_path: Path) -> None:
    with SessionReader(session) as reader:
        export_mcap(reader, tmp_path / "x.mcap")
    overlays = messages(tmp_path / "x.mcap")["/camera/overlays"][30][1]
    lines = {json.dumps(line["points"]) for line in overlays["points"]}  # type: ignore[attr-defined]
    # the robot vector from (0, 30) to (20, 32), pixel centres at integers: half a pixel more from the corner
    assert json.dumps([{"x": 0.5, "y": 30.5}, {"x": 20.5, "y": 32.5}]) in lines


def test_mcap_of_a_lossless_session_has_pictures(tmp_path: Path) -> None:
    config = QUICK.model_copy(update={"codec": "lossless"})
    session = record(tmp_path, (tick_of(i, 1000.0 + i / 30) for i in range(3)), config)
    with SessionReader(session) as reader:
        export_mcap(reader, tmp_path / "x.mcap")
    images = messages(tmp_path / "x.mcap")["/camera/image"]
    decoded = [cv2.imdecode(np.frombuffer(base64.b64decode(str(c["data"])), np.uint8), cv2.IMREAD_COLOR) for _, c in images]
    assert [number_in(np.asarray(image, np.uint8)) for image in decoded] == [0, 1, 2]


def test_mcap_has_the_pictures_of_all_videos_that_are_left(tmp_path: Path) -> None:
    config = QUICK.model_copy(update={"split_s": 1.0})
    session = record(tmp_path, (tick_of(i, 1000.0 + i / 30.0) for i in range(75)), config)
    found = []
    for name in ("whole.mcap", "left.mcap"):
        with SessionReader(session) as reader:
            export_mcap(reader, tmp_path / name)
        found.append(messages(tmp_path / name)["/camera/video"])
        (session / "video_0000.mkv").unlink(missing_ok=True)
    whole, left = found
    assert 30 < len(left) < len(whole) == 75
    assert left == whole[-len(left) :]


@pytest.mark.parametrize("export", [export_csv, export_mp4, export_mcap])
def test_nothing_is_overwritten_and_nothing_half_is_left(session: Path, tmp_path: Path, export: object) -> None:
    assert callable(export)
    there = tmp_path / "there.mp4"
    there.write_text("mine")
    with SessionReader(session) as reader:
        with pytest.raises(SessionError, match="there already"):
            export(reader, there)
        with pytest.raises(SessionError, match="cannot be written"):
            export(reader, there / "in a file.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["there.mp4"]
    assert there.read_text() == "mine"


def test_a_session_without_pictures_is_no_mp4(tmp_path: Path) -> None:
    session = record(tmp_path, [tick_of(0, 1000.0)])
    (session / "video_0000.mkv").unlink()
    with SessionReader(session) as reader, pytest.raises(SessionError, match="no picture"):
        export_mp4(reader, tmp_path / "x.mp4")
    assert not list(tmp_path.glob("*.mp4*"))


def test_colons_in_a_relative_path_name_no_protocol(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    session = record(Path("rig:1"), [tick_of(i, 1000.0 + i / 10, full=True) for i in range(5)])
    assert not session.is_absolute()
    with SessionReader(session) as reader:
        assert reader.wait(20.0)
        frame = reader.frame(4)
        assert frame is not None
        assert number_in(frame.image) == 4
        assert export_mp4(reader, Path("clip:1.mp4")) == 5
    assert recover(session, Path("copy:1")).pictures == 5


def no_links(*_: object) -> None:
    raise OSError(errno.EPERM, os.strerror(errno.EPERM))


@pytest.mark.parametrize("has_links", [True, False])
def test_of_two_that_export_to_one_file_the_first_one_stands(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_links: bool
) -> None:
    """Also when the other one ends between a check whether the file exists and the move."""
    if not has_links:
        monkeypatch.setattr(os, "link", no_links)
    out = tmp_path / "x.csv"
    with SessionReader(session) as reader, pytest.raises(SessionError, match="was made by something else meanwhile"):

        def another() -> None:
            if not out.exists():
                with SessionReader(session) as other:
                    export_csv(other, out)
                monkeypatch.setattr(Path, "exists", lambda _: False)

        export_csv(reader, out, another)
    monkeypatch.undo()
    with SessionReader(session) as reader:
        export_csv(reader, tmp_path / "y.csv")
    assert out.read_bytes() == (tmp_path / "y.csv").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.csv", "y.csv"]


def test_a_drive_without_links_takes_an_export_too(session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "link", no_links)
    with SessionReader(session) as reader:
        written = export_csv(reader, tmp_path / "x.csv")
    assert len((tmp_path / "x.csv").read_text().splitlines()) == written + 1
    assert [path.name for path in tmp_path.iterdir()] == ["x.csv"]


def test_a_drive_that_takes_no_file_in_the_end_keeps_no_empty_one(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "link", no_links)
    monkeypatch.setattr(Path, "replace", no_links)
    with SessionReader(session) as reader, pytest.raises(SessionError, match="cannot be written"):
        export_csv(reader, tmp_path / "x.csv")
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_was_made_while_exporting_is_not_overwritten(session: Path, tmp_path: Path) -> None:
    out = tmp_path / "x.csv"
    with SessionReader(session) as reader, pytest.raises(SessionError, match="was made by something else meanwhile"):
        export_csv(reader, out, lambda: out.write_text("another program's") and None)
    assert out.read_text() == "another program's"
    assert [path.name for path in tmp_path.iterdir()] == ["x.csv"]
