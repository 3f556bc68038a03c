"""Rows of sessions and lines of ``perceive``: what is written is read back, and what is damaged is named."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from core.control.drive_view import DriveView
from core.control.modes import Mode
from core.session.codec import (
    InvalidRecord,
    RecordedRow,
    light_tick,
    row_from_json,
    row_of,
    scene_from_json,
    scene_to_json,
    unread_to_json,
)
from core.session.manifest import Event, EventKind, event_from_json, event_to_json, events_between
from core.types import Command, Pose, PoseState, Reason, Refusal, Tick, Vector
from tests.core.session_data import drive_of, full_scene, tick_of

PLACE = {"row": 3, "video": 0, "pts_ms": 99, "dropped_rows": 0}


def through_json(tick: Tick, drive: DriveView | None = None) -> RecordedRow:
    return row_from_json(json.dumps(PLACE | row_of(light_tick(tick), drive), allow_nan=False).encode())


def test_pose_vectors_advice_command_and_status_come_back_as_they_were() -> None:
    tick = tick_of(7, 12.25, full=True)
    row = through_json(tick)
    assert (row.row, row.index, row.captured_s, row.pts_ms) == (3, 7, 12.25, 99)
    for name in ("pose", "robot_vector", "vessel_vector", "latency_ms", "refusal", "scale_xy", "source_size", "route_problem"):
        assert getattr(row.scene, name) == getattr(tick.scene, name), name
    assert (row.advice, row.sent, row.status) == (tick.advice, tick.sent, tick.status)


def test_lines_come_back_within_half_a_pixel_and_keep_their_ends() -> None:
    tick = tick_of(7, 12.25, full=True)
    row = through_json(tick)
    there, back = tick.scene.path.points, row.scene.path.points
    assert len(back) < len(there)
    assert np.interp(there[:, 0], back[:, 0], back[:, 1]) == pytest.approx(there[:, 1], abs=0.5)
    assert row.scene.path.head == pytest.approx(tick.scene.path.head, abs=0.01)
    assert row.scene.path.tail == pytest.approx(tick.scene.path.tail, abs=0.01)
    assert row.scene.skeletons.bridges == (((1.0, 2.0), (3.0, 4.5)),)
    assert row.scene.route.target == (90.0, 32.0)


def test_masks_come_back_with_their_holes() -> None:
    tick = tick_of(7, 12.25, full=True)
    row = through_json(tick)
    for name in ("vessel", "robot"):
        there, back = getattr(tick.scene.masks, name), getattr(row.scene.masks, name)
        assert (there & back).sum() / (there | back).sum() > 0.97
    assert not row.scene.masks.vessel[31, 65]


def test_every_field_of_the_drive_view_comes_back() -> None:
    drive = drive_of(12.0)
    back = through_json(tick_of(0, 12.0), drive).drive
    for field in fields(DriveView):
        assert getattr(back, field.name) == getattr(drive, field.name), field.name


def test_without_a_robot_there_is_no_drive_view_and_a_refusal_is_kept() -> None:
    row = through_json(tick_of(0, 1.0))
    assert row.drive is None
    assert row.scene.pose is None
    assert row.scene.refusal == Refusal(Reason.NO_ROBOT, "0 px")


def test_what_is_not_finite_becomes_none_and_is_named() -> None:
    nan = float("nan")
    scene = replace(
        full_scene(0, 1.0),
        pose=Pose(nan, nan, 1.0, 1.0, False, PoseState.C, 0.5),
        robot_vector=Vector((nan, 0.0), (1.0, 1.0), (2.0, 2.0)),
        latency_ms={"total": float("inf")},
        novelty=nan,
    )
    tick = replace(tick_of(0, 1.0, full=True), scene=scene, sent=Command(bend=nan))
    record = row_of(tick, None)
    assert set(record["not_finite"]) == {"pose", "novelty", "robot_vector", "sent"}
    row = through_json(tick)
    assert row.scene.pose is None
    assert row.scene.robot_vector is None
    assert row.scene.latency_ms == {}
    assert row.sent is None
    assert row.scene.vessel_vector is not None


@pytest.mark.parametrize("where", ["node", "radius"])
def test_a_graph_with_a_place_that_is_none_is_left_out(where: str) -> None:
    scene = full_scene(0, 1.0)
    (scene.vessel_graph.nodes[0] if where == "node" else scene.vessel_graph.edges[0].radius)[0] = np.nan
    tick = replace(tick_of(0, 1.0, full=True), scene=scene)
    assert row_of(tick, None)["not_finite"] == ["graph"]
    row = through_json(tick)
    assert row.scene.vessel_graph is None
    assert row.scene.pose == scene.pose


def test_a_light_tick_keeps_what_is_recorded() -> None:
    tick = tick_of(0, 1.0, full=True)
    light = light_tick(tick)
    assert light.scene.masks.vessel_probability.size == 0
    assert row_of(light, None) == row_of(tick, None)


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        ("captured_s", None, "captured_s"),
        ("captured_s", True, "captured_s"),
        ("captured_s", 1e12, "captured_s"),
        ("index", -1, "index"),
        ("index", 2**70, "index"),
        ("pts_ms", 1e300, "pts_ms"),
        ("size", [96, 10**9], "size"),
        ("theta_signed_deg", [], "theta_signed_deg"),
        ("crossed", 1, "crossed"),
        ("sent", [0.0, 0.0], "sent"),
        ("scene", None, "scene"),
        ("advice", {"speed": 7}, "advice.speed"),
        ("drive", {"mode": "ARMED"}, "drive.time_s"),
        ("latency_ms", {"total": "x"}, "latency_ms.total"),
    ],
)
def test_a_damaged_value_is_named(key: str, value: object, named: str) -> None:
    record = PLACE | row_of(tick_of(0, 1.0, full=True), None) | {key: value}
    with pytest.raises(InvalidRecord, match=named.replace(".", r"\.")):
        row_from_json(json.dumps(record).encode())


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("path", {"points": []}),
        ("path", {"points": [[1.0, 2.0, 3.0]]}),
        ("masks", {"size": [96, 64], "vessel": [[1, 2, 3]], "robot": []}),
        ("masks", {"size": [0, 64], "vessel": [[1, 1, 2, 2]], "robot": []}),
        ("graph", {"nodes": [[0.0, 0.0]], "edges": [[0, 5, [[0.0, 0.0]], 1.0]]}),
        ("robot_vector", [[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]]),
        ("scale_xy", [1.0, -1.0]),
        ("bridges", [[[1.0, 2.0]]]),
    ],
)
def test_damaged_geometry_is_named(key: str, value: object) -> None:
    record = PLACE | row_of(tick_of(0, 1.0, full=True), None)
    record["scene"] = record["scene"] | {key: value}
    with pytest.raises(InvalidRecord):
        row_from_json(json.dumps(record).encode())


def kinds(before: DriveView | None, after: DriveView) -> list[EventKind]:
    return [event.kind for event in events_between(before, after)]


def plain(mode: Mode, **changes: object) -> DriveView:
    return replace(DriveView(time_s=1.0, mode=mode), **changes)


def test_events_are_what_changed_between_two_pictures_of_driving() -> None:
    latched, active = drive_of(1.0).latched, drive_of(1.0).active
    assert kinds(None, plain(Mode.ADVISORY)) == [EventKind.MODE]
    assert kinds(plain(Mode.ADVISORY), plain(Mode.ADVISORY)) == []
    assert kinds(plain(Mode.ADVISORY), plain(Mode.ARMED)) == [EventKind.MODE, EventKind.ARM]
    assert kinds(plain(Mode.ARMED), plain(Mode.AUTONOMOUS)) == [EventKind.MODE]
    took_back = plain(Mode.ARMED, permitted=drive_of(1.0).permitted)
    assert kinds(plain(Mode.AUTONOMOUS), took_back) == [EventKind.MODE, EventKind.OVERRIDE]
    stopped = plain(Mode.STOPPED, latched=latched, active=active)
    assert kinds(plain(Mode.AUTONOMOUS), stopped) == [EventKind.MODE, EventKind.DISARM, EventKind.FAULT, EventKind.FAULT]
    assert kinds(stopped, plain(Mode.ADVISORY)) == [EventKind.MODE, EventKind.CLEARED, EventKind.CLEARED, EventKind.ACKNOWLEDGE]


def test_a_fault_whose_measured_value_changes_is_no_new_fault() -> None:
    first = plain(Mode.ADVISORY, active=drive_of(1.0).active)
    second = replace(first, active=tuple(replace(fault, detail="other") for fault in first.active))
    assert kinds(first, second) == []


def test_an_event_comes_back() -> None:
    event = Event(12.5, EventKind.NOTE, "kink at the second branch", {"xy": [1.0, 2.0]})
    assert event_from_json(json.dumps(event_to_json(event), allow_nan=False).encode()) == event


@pytest.mark.parametrize(("time_s", "kind"), [(None, "note"), ("x", "note"), (1e18, "note"), (1.0, 3), (1.0, None)])
def test_a_damaged_event_is_named(time_s: object, kind: object) -> None:
    with pytest.raises(InvalidRecord):
        event_from_json(json.dumps({"time_s": time_s, "kind": kind}).encode())


def test_a_target_written_as_text_alone_gets_its_place() -> None:
    assert event_from_json(b'{"time_s": 1.0, "kind": "target", "text": "12.0, -3.5"}').data == {"xy": [12.0, -3.5]}
    assert event_from_json(b'{"time_s": 1.0, "kind": "target", "text": "cleared"}').data == {}


def test_a_perceived_line_comes_back_in_source_pixels() -> None:
    scene = replace(full_scene(7, 1.0), scale=0.5, scale_xy=(0.5, 0.5), source_size=(192, 128))
    line = scene_to_json("x#7", scene)
    again = scene_from_json(json.dumps(line).encode())
    assert (line["image"], again.source_size, again.pose is not None) == ("x#7", (192, 128), True)
    assert again.path.head == pytest.approx(scene.to_source(scene.path.head), abs=0.01)
    assert scene_from_json(json.dumps(scene_to_json("x", tick_of(0, 1.0).scene)).encode()).refusal == Refusal(
        Reason.NO_ROBOT, "0 px"
    )
    with pytest.raises(InvalidRecord):
        scene_from_json(json.dumps(unread_to_json("x", "empty file")).encode())


def test_rows_of_older_sessions_lack_what_was_added_later() -> None:
    record = PLACE | row_of(replace(tick_of(3, 1.0), frame=replace(tick_of(3, 1.0).frame, lost=7)), None)
    assert row_from_json(json.dumps(record).encode()).camera_lost == 7
    del record["camera_lost"], record["novelty"]
    row = row_from_json(json.dumps(record | {"picture_crc": "0af45912"}).encode())
    assert (row.camera_lost, row.scene.novelty) == (0, None)
