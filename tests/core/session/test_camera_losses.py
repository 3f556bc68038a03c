"""Frames that the camera lost are in the session: counted in every row, and told as events."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from core.session.codec import row_from_json, row_of
from core.session.export import export_csv
from core.session.manifest import EventKind, frames_lost, read_manifest
from core.session.reader import SessionReader
from core.session.writer import SessionWriter
from core.types import Tick
from tests.core.session_data import ABOUT, QUICK, picture, record, tick_of


def losing(index: int, captured_s: float, lost: int) -> Tick:
    tick = tick_of(index, captured_s)
    return replace(tick, frame=replace(tick.frame, lost=lost))


def test_a_row_keeps_the_count_and_gives_it_back() -> None:
    row = row_of(losing(3, 100.0, 7), None) | {"row": 0, "video": 0, "pts_ms": 0}
    recorded = row_from_json(json.dumps(row).encode())
    assert recorded.tick(picture(3)).frame.lost == recorded.camera_lost == 7
    del row["camera_lost"]  # as rows of older sessions
    assert row_from_json(json.dumps(row).encode()).camera_lost == 0


def test_losses_are_events_once_a_second_at_most(tmp_path: Path) -> None:
    # ten frames a second; what was lost before the first frame is not this session's
    lost = [4, 4, 5, 5, 6] + [6] * 7 + [6] * 10 + [9] * 5
    session = record(tmp_path, (losing(k, 100.0 + k / 10, count) for k, count in enumerate(lost)))
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        told = [event for event in reader.events if event.kind is EventKind.LOST]
        rows = [row.camera_lost for k in range(len(reader)) if (row := reader.row(k)) is not None]
        out = tmp_path / "table.csv"
        export_csv(reader, out)
    assert [(event.text, event.data["total"]) for event in told] == [("2 frames", 6), ("3 frames", 9)]
    assert [round(event.time_s - 100.0, 3) for event in told] == [1.0, 2.2]
    assert rows == lost
    assert "camera_lost" in out.read_text().splitlines()[0].split(",")


def test_a_camera_that_was_opened_again_counts_from_nothing(tmp_path: Path) -> None:
    lost = [50] * 3 + [0] * 12 + [2] * 12
    session = record(tmp_path, (losing(k, 100.0 + k / 10, count) for k, count in enumerate(lost)))
    with SessionReader(session) as reader:
        assert reader.wait(10.0)
        told = [(event.text, event.data["total"]) for event in reader.events if event.kind is EventKind.LOST]
    assert told == [("2 frames", 2)]


def losses(session: Path) -> list[tuple[str, int, float]]:
    with SessionReader(session) as reader:
        return [
            (event.text, event.data["total"], round(event.time_s - 100.0, 3))
            for event in reader.events
            if event.kind is EventKind.LOST
        ]


def test_what_was_lost_just_before_the_end_is_told_at_the_end(tmp_path: Path) -> None:
    lost = [0] * 12 + [1] + [4, 4, 9]
    session = record(tmp_path, (losing(k, 100.0 + k / 10, count) for k, count in enumerate(lost)))
    assert losses(session) == [("1 frames", 1, 1.2), ("8 frames", 9, 1.5)]
    with SessionReader(session) as reader:
        assert frames_lost(reader.events) == lost[-1]


def test_what_was_lost_just_before_the_camera_was_opened_again_is_told_too(tmp_path: Path) -> None:
    lost = [0] * 12 + [1] + [4, 4] + [0, 0, 2]
    session = record(tmp_path, (losing(k, 100.0 + k / 10, count) for k, count in enumerate(lost)))
    assert losses(session) == [("1 frames", 1, 1.2), ("3 frames", 4, 1.5), ("2 frames", 2, 1.7)]


def test_what_was_lost_just_before_the_start_is_the_rings_and_not_the_sessions(tmp_path: Path) -> None:
    writer = SessionWriter(QUICK.model_copy(update={"ring_s": 30.0}), ABOUT, folder=tmp_path, clock=lambda: 1000.0)
    before, within = [0] * 12 + [1, 4, 4], [9, 9, 11]
    for k, count in enumerate(before):
        writer.put(losing(k, 100.0 + k / 10, count))
    writer.start()
    for k, count in enumerate(within, start=len(before)):
        writer.put(losing(k, 100.0 + k / 10, count))
    writer.stop()
    writer.save_last()
    assert writer.close()
    by_origin = {manifest.origin: path for path in tmp_path.glob("session_*") if (manifest := read_manifest(path))}
    assert losses(by_origin["recorded"]) == [("2 frames", 11, 1.7)]
    assert losses(by_origin["last seconds"]) == [("1 frames", 1, 1.2), ("8 frames", 9, 1.5), ("2 frames", 11, 1.7)]
