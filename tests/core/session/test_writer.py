"""The recorder: nothing is lost without being reported, its sender never waits, and a disk that fails stops it visibly."""

import errno
import math
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.control.drive_view import DriveView
from core.control.faults import Cause, Fault
from core.control.modes import Mode
from core.evaluation.replay import event_target
from core.session import files as session_files
from core.session import writer as session_writer
from core.session.files import EncodedFrame, SessionFiles, is_being_written
from core.session.manifest import About, Event, EventKind, SessionError, event_of_target, frames_lost, read_manifest
from core.session.reader import SessionReader
from core.session.video import FrameEncoder, Packet
from core.session.writer import Ring, SessionWriter, faults_between
from core.types import Tick
from tests.core.session_data import ABOUT, QUICK, SIZE, drive_of, number_in, record, tick_of, wait_for


def ticks(count: int, start: int = 0, fps: float = 30.0, **options: object) -> list[Tick]:
    return [tick_of(i, 1000.0 + i / fps, **options) for i in range(start, start + count)]


@contextmanager
def writer_in(folder: Path, config: object = QUICK) -> Iterator[SessionWriter]:
    writer = SessionWriter(config, ABOUT, folder=folder, clock=lambda: 1002.0)
    try:
        yield writer
    finally:
        assert writer.close()


def replace_config(**changes: object):
    return QUICK.model_copy(update=changes)


def saved(writer: SessionWriter) -> Path:
    return writer.status().saved


@contextmanager
def opened(session: Path) -> Iterator[SessionReader]:
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        yield reader


def events_of(session: Path, kind: EventKind) -> list[Event]:
    with opened(session) as reader:
        return [event for event in reader.events if event.kind is kind]


def test_every_frame_has_its_row_and_its_own_picture(tmp_path: Path) -> None:
    session = record(tmp_path, ticks(70, full=True))
    with opened(session) as reader:
        assert len(reader) == 70
        assert reader.is_closed
        for place in (0, 1, 29, 30, 31, 69, 68, 5):
            frame = reader.frame(place)
            assert (frame.index, number_in(frame.image)) == (place, place)
        assert reader.problems == ()


def test_the_manifest_tells_what_the_session_is(tmp_path: Path) -> None:
    session = record(tmp_path, ticks(5))
    assert session.name.startswith("session_")
    assert {path.name for path in session.iterdir()} == {"manifest.json", "video_0000.mkv", "frames.jsonl", "events.jsonl"}
    manifest = read_manifest(session)
    assert (manifest.kind, manifest.rig, manifest.model["name"]) == ("SIM", "twin", "default")
    assert manifest.calibration == {"mm_per_px": 0.25}
    assert manifest.config == {"rig": {"name": "twin"}}
    assert {"python", "numpy", "av"} <= set(manifest.versions)
    assert manifest.closed
    assert (manifest.counts.frames, manifest.counts.videos, manifest.counts.dropped) == (5, 1, 0)
    assert manifest.started_monotonic_s == 1000.0


def test_until_it_ends_properly_the_manifest_says_so_and_the_session_is_held(tmp_path: Path) -> None:
    with writer_in(tmp_path) as writer:
        writer.start()
        writer.put(tick_of(0, 1000.0))
        wait_for(lambda: writer.status().frames == 1)
        session = writer.status().folder
        assert not read_manifest(session).closed
        assert is_being_written(session)
        assert writer.status().recording
        assert writer.status().elapsed_s == 0.0
    assert read_manifest(session).closed
    assert not is_being_written(session)


def test_a_time_that_is_no_number_is_replaced_by_the_clock(tmp_path: Path) -> None:
    session = record(tmp_path, [tick_of(0, math.nan)])
    with opened(session) as reader:
        assert reader.timeline().time_s.tolist() == [1000.0]


def test_all_videos_are_on_the_disk_before_the_manifest_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one that was ended between two syncs."""
    forced: list[str] = []
    real = os.fdatasync

    def force(handle: int) -> None:
        forced.append(Path(os.readlink(f"/proc/self/fd/{handle}")).name)
        real(handle)

    monkeypatch.setattr(session_files.os, "fdatasync", force)
    session = record(tmp_path, ticks(100), replace_config(split_s=1.0))
    videos = sorted(path.name for path in session.glob("video_*.mkv"))
    assert len(videos) > 2
    assert set(videos) <= set(forced)


def test_a_new_video_begins_when_the_size_changes_and_when_it_is_long(tmp_path: Path) -> None:
    odd = [tick_of(i, 1000.0 + i / 30, size=(97, 63)) for i in range(40, 44)]
    session = record(tmp_path, [*ticks(40), *odd], replace_config(split_s=1.0))
    with opened(session) as reader:
        assert [path.name for path in reader.videos] == ["video_0000.mkv", "video_0001.mkv", "video_0002.mkv"]
        line = reader.timeline()
        assert sorted(set(line.video.tolist())) == [0, 1, 2]
        assert [int(line.pts_ms[line.video == video][0]) for video in (0, 1, 2)] == [0, 0, 0]
        frame, last = reader.frame(35), reader.frame(43)
        assert number_in(frame.image) == 35
        assert last.image.shape == (63, 97, 3)


def test_lossless_keeps_every_pixel(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (63, 97, 3), dtype=np.uint8)
    tick = tick_of(0, 1000.0)
    tick = replace(tick, frame=replace(tick.frame, image=noise))
    session = record(tmp_path, [tick], replace_config(codec="lossless"))
    with opened(session) as reader:
        frame = reader.frame(0)
        assert np.array_equal(frame.image, noise)


def slow_disk(monkeypatch: pytest.MonkeyPatch) -> tuple[threading.Event, threading.Event]:
    """A frame has come to be written; and let it, and all later ones, be."""
    entered, go = threading.Event(), threading.Event()
    real = SessionFiles.write_frame

    def slow(self: SessionFiles, frame: EncodedFrame) -> None:
        entered.set()
        assert go.wait(10.0)
        real(self, frame)

    monkeypatch.setattr(SessionFiles, "write_frame", slow)
    return entered, go


def test_a_full_queue_drops_counts_and_tells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entered, go = slow_disk(monkeypatch)
    with writer_in(tmp_path, replace_config(max_queue=2)) as writer:
        writer.start()
        assert writer.put(tick_of(0, 1000.0))
        assert entered.wait(10.0)
        taken = [writer.put(tick) for tick in ticks(5, start=1)]
        assert taken == [True, True, False, False, False]
        assert writer.add_event(Event(1000.0, EventKind.NOTE, "events are never dropped for frames"))
        assert writer.status().dropped == 3
        go.set()
        wait_for(lambda: writer.status().frames == 3)
        writer.put(tick_of(9, 1000.3))
    session = saved(writer)
    with opened(session) as reader:
        rows = [reader.row(place) for place in range(len(reader))]
        assert [row.index for row in rows if row] == [0, 1, 2, 9]
        assert [row.dropped_rows for row in rows if row] == [0, 0, 0, 3]
        assert read_manifest(session).counts.dropped == 3
        assert [e.data["total"] for e in reader.events if e.kind is EventKind.DROPPED] == [3]
        assert any(e.kind is EventKind.NOTE for e in reader.events)


def test_what_is_dropped_after_the_stop_was_asked_is_not_the_sessions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And what was dropped just before it is told, though no picture came after it."""
    entered, go = slow_disk(monkeypatch)
    with writer_in(tmp_path, replace_config(max_queue=2)) as writer:
        writer.start()
        writer.put(tick_of(0, 1000.0))
        assert entered.wait(10.0)
        assert [writer.put(tick) for tick in ticks(3, start=1)] == [True, True, False]
        writer.stop()
        assert [writer.put(tick) for tick in ticks(4, start=4)] == [False] * 4
        assert writer.status().dropped == 1
        go.set()
        wait_for(lambda: writer.status().saved is not None)
        assert writer.status().dropped == 1
    session = saved(writer)
    assert read_manifest(session).counts.dropped == 1
    with opened(session) as reader:
        assert [event.data for event in reader.events if event.kind is EventKind.DROPPED] == [{"count": 1, "total": 1}]
        assert read_manifest(session).counts.events == len(reader.events)


def test_events_of_driving_and_the_mode_at_the_start_are_written(tmp_path: Path) -> None:
    with writer_in(tmp_path) as writer:
        writer.start()
        writer.add_event(Event(1000.15, EventKind.NOTE, "ready"))  # before the first frame
        writer.put(tick_of(0, 1000.0), DriveView(1000.0, Mode.ADVISORY))
        writer.put(tick_of(1, 1000.1), drive_of(1000.1, Mode.ARMED))
        writer.drive(drive_of(1000.1, Mode.ARMED))
        writer.add_event(Event(1000.2, EventKind.TARGET, "10, 20", {"xy": [10.0, 20.0]}))
        writer.stop("enough")
        wait_for(lambda: writer.status().saved is not None)
    session = saved(writer)
    with opened(session) as reader:
        kinds = [event.kind for event in reader.events]
        assert kinds[:2] == [EventKind.MODE, EventKind.VIDEO]
        assert EventKind.NOTE in kinds
        assert kinds.count(EventKind.FAULT) == 2
        assert EventKind.ARM in kinds
        assert kinds[-1] is EventKind.TARGET
    assert read_manifest(session).ended == "enough"


def test_driving_is_recorded_though_the_camera_gives_no_picture(tmp_path: Path) -> None:
    with writer_in(tmp_path) as writer:
        writer.start()
        writer.put(tick_of(0, 1000.0), DriveView(1000.0, Mode.AUTONOMOUS))
        lost = Fault(Cause.CAMERA_LOST, "newest frame 501 ms old")
        writer.drive(DriveView(1000.5, Mode.ADVISORY, latched=lost, active=(lost,)))
        writer.drive(DriveView(1000.4, Mode.HOLD))  # overtaken by a newer view
    with opened(saved(writer)) as reader:
        told = [(event.time_s, event.kind, event.text) for event in reader.events if event.kind is not EventKind.VIDEO]
    assert told == [
        (1000.0, EventKind.MODE, "AUTONOMOUS"),
        (1000.5, EventKind.MODE, "ADVISORY"),
        (1000.5, EventKind.DISARM, "camera lost"),
        (1000.5, EventKind.FAULT, "camera lost"),
    ]


def test_saving_the_last_seconds_twice_or_of_nothing_stops_no_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    go = threading.Event()
    close = SessionFiles.close

    def slow(self: SessionFiles, ended: str, dropped: int) -> str:
        go.wait(10.0)
        return close(self, ended, dropped)

    monkeypatch.setattr(SessionFiles, "close", slow)
    with writer_in(tmp_path, replace_config(ring_s=5.0)) as writer:
        writer.put(tick_of(0, 1000.0))
        writer.put(tick_of(1, 1000.5))
        wait_for(lambda: writer.status().ring_s > 0.0)
        before = writer.status()
        writer.save_last()
        writer.save_last()
        wait_for(lambda: writer.status().notices == 1)
        assert writer.status().notice == "the last seconds are still being saved"
        go.set()
        wait_for(lambda: writer.status().saved is not None)
        writer.set_about(About("LIVE", "bench"))
        wait_for(lambda: writer.status().ring_s == 0.0)
        writer.save_last()
        wait_for(lambda: writer.status().notices == 2)
        assert (writer.status().problem, faults_between(before, writer.status())) == ("", [])


def test_a_recording_that_cannot_start_says_so_each_time(tmp_path: Path) -> None:
    (tmp_path / "sessions").write_text("a file where the folder should be")
    with writer_in(tmp_path / "sessions") as writer:
        for count in (1, 2):
            before = writer.status()
            writer.start()
            writer.put(tick_of(count, 1000.0 + count))
            wait_for(lambda: writer.status().problems == count)  # noqa: B023
            assert [fault.cause for fault in faults_between(before, writer.status())] == [Cause.RECORDING_STOPPED]


def test_nothing_is_written_before_start_and_after_stop(tmp_path: Path) -> None:
    with writer_in(tmp_path) as writer:
        assert writer.put(tick_of(0, 1000.0))
        writer.start()
        writer.put(tick_of(1, 1000.1))
        writer.stop()
        wait_for(lambda: writer.status().saved is not None)
        assert writer.put(tick_of(2, 1000.2))
        writer.start()
        writer.put(tick_of(3, 1000.3))
    counts = sorted(read_manifest(path).counts.frames for path in tmp_path.iterdir())
    assert counts == [1, 1]
    assert not writer.put(tick_of(4, 1000.4))


def test_the_target_that_was_chosen_before_is_told_at_the_start(tmp_path: Path) -> None:
    def targets_of() -> list[tuple[float, object]]:
        return [(event.time_s, event_target(event)) for event in events_of(saved(writer), EventKind.TARGET)]

    with writer_in(tmp_path, replace_config(ring_s=2.0)) as writer:
        writer.add_event(event_of_target((10.0, 20.0), 999.0))
        writer.add_event(event_of_target((30.0, 40.0), 999.5))
        writer.start()
        for tick in ticks(3):
            writer.put(tick)
        writer.stop()
        wait_for(lambda: writer.status().saved is not None)
        first = writer.status().saved
        assert targets_of() == [(1000.0, (30.0, 40.0))]
        writer.save_last()
        wait_for(lambda: writer.status().saved != first)
        assert targets_of() == [(1000.0, (30.0, 40.0))]
        writer.set_about(About("SIM", "twin", {"perception": "under other thresholds"}))
        second = writer.status().saved
        writer.start()
        writer.put(tick_of(9, 1001.0))
        writer.stop()
        wait_for(lambda: writer.status().saved != second)
        assert targets_of() == [(1001.0, (30.0, 40.0))]
        writer.add_event(event_of_target(None, 1001.5))
        writer.start()
        writer.put(tick_of(10, 1002.0))
    assert targets_of() == []


def test_another_rig_ends_the_session(tmp_path: Path) -> None:
    with writer_in(tmp_path) as writer:
        writer.start()
        writer.put(tick_of(0, 1000.0))
        writer.set_about(About("LIVE", "bench"))
        writer.start()
        writer.put(tick_of(1, 1000.1))
    found = {read_manifest(path).kind: read_manifest(path) for path in tmp_path.iterdir()}
    assert set(found) == {"SIM", "LIVE"}
    assert found["SIM"].ended == "another rig was opened"


# --- frames that never came from the camera


def losing(index: int, lost: int) -> Tick:
    """At ten frames a second."""
    tick = tick_of(index, 100.0 + index / 10)
    return replace(tick, frame=replace(tick.frame, lost=lost))


def losses(session: Path) -> list[tuple[str, int, float]]:
    found = events_of(session, EventKind.LOST)
    return [(event.text, event.data["total"], round(event.time_s - 100.0, 3)) for event in found]


@pytest.mark.parametrize(
    ("lost", "reported"),
    [
        pytest.param([4, 4, 5, 5, 6] + [6] * 17 + [9] * 5, [("2 frames", 6, 1.0), ("3 frames", 9, 2.2)], id="once a second"),
        pytest.param([50] * 3 + [0] * 12 + [2] * 12, [("2 frames", 2, 1.5)], id="counts from 0 again"),
        pytest.param([0] * 12 + [1, 4, 4, 9], [("1 frames", 1, 1.2), ("8 frames", 9, 1.5)], id="the rest at the end"),
        pytest.param(
            [0] * 12 + [1, 4, 4, 0, 0, 2], [("1 frames", 1, 1.2), ("3 frames", 4, 1.5), ("2 frames", 2, 1.7)], id="at a reopening"
        ),
    ],
)
def test_lost_frames_are_counted_in_rows_and_reported(tmp_path: Path, lost: list[int], reported: list[object]) -> None:
    session = record(tmp_path, (losing(index, count) for index, count in enumerate(lost)))
    assert losses(session) == reported
    with opened(session) as reader:
        assert [row.camera_lost for place in range(len(reader)) if (row := reader.row(place))] == lost
        assert frames_lost(reader.events) == sum(int(text.split()[0]) for text, *_ in losses(session))


def test_what_was_lost_before_the_start_belongs_to_the_ring(tmp_path: Path) -> None:
    writer = SessionWriter(QUICK.model_copy(update={"ring_s": 30.0}), ABOUT, folder=tmp_path, clock=lambda: 1000.0)
    before, within = [0] * 12 + [1, 4, 4], [9, 9, 11]
    for k, count in enumerate(before):
        writer.put(losing(k, count))
    writer.start()
    for k, count in enumerate(within, start=len(before)):
        writer.put(losing(k, count))
    writer.stop()
    writer.save_last()
    assert writer.close()
    by_origin = {manifest.origin: path for path in tmp_path.glob("session_*") if (manifest := read_manifest(path))}
    assert losses(by_origin["recorded"]) == [("2 frames", 11, 1.7)]
    assert losses(by_origin["last seconds"]) == [("1 frames", 1, 1.2), ("8 frames", 9, 1.5), ("2 frames", 11, 1.7)]


# --- the last seconds


def test_the_last_seconds_are_saved_without_having_recorded(tmp_path: Path) -> None:
    with writer_in(tmp_path, replace_config(ring_s=2.0)) as writer:
        for tick in ticks(150):
            writer.put(tick)
        writer.add_event(Event(1000.1, EventKind.NOTE, "old"))
        writer.add_event(Event(1004.5, EventKind.NOTE, "new"))
        writer.save_last()
        wait_for(lambda: writer.status().saved is not None)
        assert not writer.status().recording
        assert writer.status().ring_s == pytest.approx(2.97, abs=0.1)
    session = saved(writer)
    manifest = read_manifest(session)
    assert (manifest.origin, manifest.closed) == ("last seconds", True)
    with opened(session) as reader:
        first, last = reader.frame(0), reader.frame(len(reader) - 1)
        assert (last.index, number_in(last.image)) == (149, 149)
        assert number_in(first.image) == first.index
        # at least what was asked for, at most a group of pictures more
        assert 2.0 <= reader.duration_s <= 3.0
        assert [e.text for e in reader.events if e.kind is EventKind.NOTE] == ["new"]
        assert manifest.started_monotonic_s == reader.timeline().time_s[0]


def test_the_last_seconds_tell_where_driving_stood_when_they_began(tmp_path: Path) -> None:
    armed = drive_of(1000.0)
    with writer_in(tmp_path, replace_config(ring_s=2.0)) as writer:
        for tick in ticks(150):
            writer.put(tick, replace(armed, time_s=tick.frame.captured_s))
        writer.drive(replace(armed, time_s=1004.5, mode=Mode.ADVISORY, active=(Fault(Cause.WARM),)))
        writer.save_last()
        wait_for(lambda: writer.status().saved is not None)
    session = saved(writer)
    first_s = read_manifest(session).started_monotonic_s
    with opened(session) as reader:
        told = [(event.time_s, event.kind, event.text) for event in reader.events if event.kind is not EventKind.VIDEO]
    assert told == [
        (first_s, EventKind.MODE, "ARMED"),
        (first_s, EventKind.FAULT, str(Cause.HEAD_JUMP)),
        (first_s, EventKind.FAULT, str(Cause.WARM)),
        (1004.5, EventKind.MODE, "ADVISORY"),
        (1004.5, EventKind.DISARM, str(Cause.HEAD_JUMP)),
        (1004.5, EventKind.CLEARED, str(Cause.HEAD_JUMP)),
    ]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_fault_of_the_program_while_the_last_seconds_are_saved_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And the next ones can be saved: it does not stand there as being saved for ever."""
    calls: list[int] = []
    writes = SessionFiles.write_frame

    def breaks_once(files: SessionFiles, frame: EncodedFrame) -> None:
        calls.append(1)
        if len(calls) == 3:
            raise RuntimeError("unexpected")
        writes(files, frame)

    monkeypatch.setattr(SessionFiles, "write_frame", breaks_once)
    with writer_in(tmp_path, replace_config(ring_s=60.0)) as writer:
        for tick in ticks(10):
            writer.put(tick)
        writer.save_last()
        wait_for(lambda: writer.status().notice)
        told = "of the last seconds only 2 of 10 frames were saved: an error of the program; its log says more"
        assert (writer.status().notice, writer.status().saving) == (told, False)
        wait_for(lambda: all(thread.name != "ring saver" for thread in threading.enumerate()))
        writer.save_last()
        wait_for(lambda: writer.status().saved)
    assert sorted(read_manifest(path).counts.frames for path in tmp_path.iterdir()) == [2, 10]


def test_the_last_seconds_leave_the_last_room_of_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rule of a recording: what is open must still be closed, and the system must go on."""
    free = [30_000_000]
    writes = SessionFiles.write_frame

    def shrinking(files: SessionFiles, frame: EncodedFrame) -> None:
        writes(files, frame)
        free[0] -= 1_000_000

    monkeypatch.setattr(SessionFiles, "write_frame", shrinking)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: (100_000_000_000, 0, free[0]))
    with writer_in(tmp_path, replace_config(ring_s=60.0, stop_free_mb=40.0)) as writer:
        for tick in ticks(50):
            writer.put(tick)
        writer.save_last()
        wait_for(lambda: writer.status().notices == 1)
        left = f"MB left in {tmp_path}); make room and save them again"
        assert writer.status().notice == f"the last seconds were not saved: disk full (30 {left}"
        assert list(tmp_path.iterdir()) == []
        free[0] = 59_500_000
        writer.save_last()
        wait_for(lambda: writer.status().notices == 2)
        assert writer.status().notice == f"of the last seconds only 20 of 50 frames were saved: disk full (40 {left}"
        assert not writer.status().problem
    (session,) = tmp_path.iterdir()
    manifest = read_manifest(session)
    assert (manifest.closed, manifest.counts.frames) == (True, 20)
    assert manifest.ended.startswith("disk full")


def test_a_recording_and_the_last_seconds_share_one_encoder(tmp_path: Path) -> None:
    with writer_in(tmp_path, replace_config(ring_s=5.0)) as writer:
        for tick in ticks(10):
            writer.put(tick)
        writer.start()
        for tick in ticks(20, start=10):
            writer.put(tick)
        writer.save_last()
        for tick in ticks(5, start=30):
            writer.put(tick)
        writer.stop()
    found = {read_manifest(path).origin: path for path in tmp_path.iterdir()}
    with SessionReader(found["recorded"]) as recorded, SessionReader(found["last seconds"]) as ring:
        recorded.wait(10.0)
        ring.wait(10.0)
        assert (len(recorded), len(ring)) == (25, 30)
        for reader, place, number in ((recorded, 0, 10), (recorded, 24, 34), (ring, 0, 0), (ring, 29, 29), (ring, 11, 11)):
            frame = reader.frame(place)
            assert number_in(frame.image) == number


def test_the_ring_is_bounded_by_bytes_and_begins_at_a_key_picture() -> None:
    encoder = FrameEncoder(SIZE, QUICK)
    ring = Ring(60.0, 1000)
    for i in range(100):
        ring.add(EncodedFrame(i / 30, Packet(b"x" * 90, i * 33, i % 10 == 0), encoder, "r" * 10))
        assert ring.nbytes <= 1000 + 1000
    frames, _ = ring.content()
    assert frames[0].packet.is_key
    assert frames[-1].captured_s == pytest.approx(99 / 30)
    assert ring.nbytes == sum(frame.nbytes for frame in frames) <= 1000
    # a target stays in force, whatever number of events came after it
    ring.add_event(event_of_target((10.0, 20.0), -1.0))
    for _ in range(5000):
        ring.add_event(Event(-0.5, EventKind.ALERT, "again"))
    assert [event.data for event in ring.content()[1]] == [{"xy": [10.0, 20.0]}]
    ring.clear()
    assert ring.content() == ([], [])
    encoder.close()


# --- disks that fail


def test_with_the_disk_nearly_full_it_warns_and_before_it_is_full_it_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    free = [10_000_000_000]
    monkeypatch.setattr(shutil, "disk_usage", lambda _: (100_000_000_000, 0, free[0]))
    monkeypatch.setattr(session_writer, "_DISK_CHECK_S", 0.0)
    config = replace_config(warn_free_mb=500.0, warn_free_share=0.07, stop_free_mb=40.0)
    with writer_in(tmp_path, config) as writer:
        writer.start()
        writer.put(tick_of(0, 1000.0))
        wait_for(lambda: writer.status().frames == 1)
        assert (writer.status().warning, writer.status().disk_free) == ("", 10_000_000_000)
        free[0] = 6_000_000_000
        writer.put(tick_of(1, 1000.1))
        wait_for(lambda: "6,000 MB left" in writer.status().warning)
        assert writer.status().recording
        free[0] = 30_000_000
        writer.put(tick_of(2, 1000.2))
        wait_for(lambda: "disk full" in writer.status().problem)
        assert not writer.status().recording
        session = writer.status().folder
    assert read_manifest(session).closed
    assert "disk full" in read_manifest(session).ended


LIMITED = """
import resource, signal, sys
sys.path[:0] = [{root!r}]
from pathlib import Path
from dataclasses import replace
import numpy as np
from core.session.writer import SessionWriter
from tests.core.session_data import ABOUT, QUICK, tick_of, wait_for
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
writer = SessionWriter(QUICK.model_copy(update={{"codec": {codec!r}}}), ABOUT, folder=Path(sys.argv[1]), clock=lambda: 1000.0)
writer.start()
noise = np.random.default_rng(0)
for i in range(600):
    tick = tick_of(i, 1000.0 + i / 30)
    if {codec!r} == "lossless":
        tick = replace(tick, frame=replace(tick.frame, image=noise.integers(0, 256, (64, 96, 3), dtype=np.uint8)))
    while not writer.put(tick) and not writer.status().problem:
        pass
    if writer.status().problem:
        break
writer.close()
print(writer.status().problem)
"""


@pytest.mark.parametrize("codec", ["lossy", "lossless"])
def test_a_disk_that_is_really_full_loses_nothing_written(tmp_path: Path, codec: str) -> None:
    """A file size limit stands in for it: rows hit it in the lossy case, the video in the lossless one."""
    root = str(Path(__file__).resolve().parents[3])
    code = LIMITED.format(root=root, limit=60_000 if codec == "lossy" else 150_000, codec=codec)
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "recording stopped" in done.stdout
    assert "File too large" in done.stdout
    (session,) = tmp_path.glob("session_*")
    with opened(session) as reader:
        assert len(reader) > 5
        assert all("line" not in problem for problem in reader.problems), "no torn line"
        lost = sum(reader.frame(place) is None for place in range(len(reader)))
        assert lost <= 8


def test_an_unexpected_failure_ends_the_recorder_visibly(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with writer_in(tmp_path) as writer:
        writer.start()
        writer.put(tick_of(0, 1000.0))
        broken = tick_of(1, 1000.1)
        writer.put(replace(broken, frame=replace(broken.frame, image=np.zeros((64, 96), np.uint8))))
        wait_for(lambda: writer.status().problem)
        assert "recording stopped" in writer.status().problem
        wait_for(lambda: not writer.put(tick_of(2, 1000.2)))
    session = writer.status().folder
    assert read_manifest(session).closed


def test_a_reason_with_a_name_that_is_no_utf8_still_ends_the_session(tmp_path: Path) -> None:
    """The manifest could not hold the folder's name, stayed open, and the recorder went on saying that it records."""
    files = SessionFiles(tmp_path, ABOUT, QUICK, first_s=1000.0, now_s=1000.0)
    assert files.close("disk full in /data/b\udcfc", 0) == ""
    manifest = read_manifest(files.folder)
    assert (manifest.closed, manifest.ended) == (True, "disk full in /data/b\\xfc")


def test_a_drive_without_locks_can_be_recorded_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_locks(_file: int, _kind: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", no_locks)
    files = SessionFiles(tmp_path / "under way", ABOUT, QUICK, first_s=1000.0, now_s=1000.0)
    assert is_being_written(files.folder), "it has just been written to"
    with pytest.raises(SessionError, match="is being recorded"):
        session_files.add_event(files.folder, Event(1000.0, EventKind.NOTE, "kink"))
    os.utime(files.folder / session_files.FRAMES, (0.0, 0.0))
    assert not is_being_written(files.folder), "it was cut"
    assert files.close("the end", 0) == ""
    session = record(tmp_path, ticks(3))
    assert read_manifest(session).closed
    assert not is_being_written(session)
    assert session_files.add_event(session, Event(1000.0, EventKind.NOTE, "kink")).text == "kink"
