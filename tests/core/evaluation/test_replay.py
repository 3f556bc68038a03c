"""What changed between two perceptions of the same frames, with answers worked out by hand."""

import json

import pytest

from core.evaluation.replay import Change, FrameResult, RecordedTargets, ReplayTally, Run, changed_most, frame_result, runs
from core.session.codec import row_from_json, row_of
from core.session.manifest import Event, EventKind
from core.types import PoseState, Reason
from tests.core.session_data import full_scene, tick_of

A, B, C, D = PoseState


def posed(theta: float, state: PoseState = A, head: tuple[float, float] = (10.0, 20.0), ms: float = 30.0) -> FrameResult:
    return FrameResult(theta, head, state, 0.9, None, "", ms)


def refused(reason: Reason = Reason.NO_ROBOT) -> FrameResult:
    return FrameResult(reason=reason, total_ms=10.0)


def change(place: int, before: FrameResult, after: FrameResult) -> Change:
    return Change(place, 100 + place, place / 10, before, after)


@pytest.mark.parametrize(
    ("before", "after", "turn"), [(10.0, 12.5, 2.5), (-170.0, 175.0, -15.0), (179.0, -179.0, 2.0), (0.0, 180.0, 180.0)]
)
def test_theta_changes_the_short_way_round(before: float, after: float, turn: float) -> None:
    assert change(0, posed(before), posed(after)).theta_deg == pytest.approx(turn)


def test_the_head_moves_in_source_pixels() -> None:
    assert change(0, posed(0.0, head=(1.0, 2.0)), posed(0.0, head=(4.0, 6.0))).head_px == pytest.approx(5.0)
    assert change(0, posed(0.0), refused()).head_px is None


@pytest.mark.parametrize(
    ("before", "after", "kind"),
    [
        (posed(1.0, A), posed(2.0, A), "same state"),
        (posed(1.0, A), posed(2.0, C), "other state"),
        (posed(1.0), refused(), "pose lost"),
        (refused(), posed(1.0), "pose gained"),
        (refused(), refused(), "same reason"),
        (refused(), refused(Reason.BLACK), "other reason"),
    ],
)
def test_each_frame_has_one_kind_of_change(before: FrameResult, after: FrameResult, kind: str) -> None:
    assert change(0, before, after).kind == kind


def test_the_sums() -> None:
    changes = [
        change(0, posed(0.0, A), posed(1.0, A, head=(13.0, 24.0))),  # 1 degree, 5 px
        change(1, posed(0.0, A), posed(-3.0, B)),  # 3 degrees, state changed
        change(2, posed(0.0, C), refused(Reason.LOW_CONFIDENCE)),
        change(3, refused(Reason.NO_ROBOT), posed(5.0, D)),
        change(4, refused(Reason.NO_ROBOT), refused(Reason.BLACK)),
    ]
    sums = ReplayTally.of(changes).to_json()
    assert sums["frames"] == 5
    theta = sums["theta_change_deg"]
    assert (theta["n"], theta["mean"], theta["median"], theta["max"]) == (2, 2.0, 2.0, 3.0)
    assert theta["p95"] == pytest.approx(2.9)
    assert (sums["head_shift_px"]["n"], sums["head_shift_px"]["max"]) == (2, 5.0)
    assert sums["states"]["labels"] == ["A", "B", "C", "D", "-"]
    assert sums["states"]["matrix"] == [
        [1, 1, 0, 0, 0],
        [0, 0, 0, 0, 0],
        [0, 0, 0, 0, 1],
        [0, 0, 0, 0, 0],
        [0, 0, 0, 1, 1],
    ]
    assert sums["states"]["changed"] == 3
    assert sums["refusals"] == {"gained": {"low confidence": 1}, "lost": {"no robot": 1}, "other_reason": 1}
    assert sums["latency_ms"]["before"]["mean"] == pytest.approx((30 * 3 + 10 * 2) / 5)


def test_most_changed_first_and_a_lost_pose_before_any_angle() -> None:
    changes = [
        change(0, posed(0.0), posed(0.0)),
        change(1, posed(0.0), posed(9.0)),
        change(2, posed(0.0), posed(-20.0)),
        change(3, posed(0.0), refused()),
        change(4, refused(), refused()),
    ]
    assert [c.row for c in changed_most(changes, 10)] == [3, 2, 1]
    assert [c.row for c in changed_most(changes, 1)] == [3]


def test_lost_poses_are_told_as_runs() -> None:
    lost, kept = (posed(0.0), refused()), (posed(0.0), posed(0.0))
    changes = [change(k, *(lost if k in (1, 2, 3, 6) else kept)) for k in range(8)]
    changes[7] = change(7, refused(Reason.BLACK), posed(0.0))
    assert runs(changes) == [
        Run("pose lost", "no robot", 1, 3),
        Run("pose lost", "no robot", 6, 6),
        Run("pose gained", "image black", 7, 7),
    ]


def test_what_a_scene_says() -> None:
    said = frame_result(full_scene(4, 2.0))
    assert (said.theta_signed_deg, said.state, said.confidence, said.reason, said.total_ms) == (-5.5, D, 0.875, None, 20.25)
    assert said.head == pytest.approx((49.0, 32.0 - 0.1535), abs=0.5)


def row(index: int, time_s: float, *, full: bool) -> object:
    place = {"row": index, "video": 0, "pts_ms": 0}
    return row_from_json(json.dumps(place | row_of(tick_of(index, time_s, full=full), None)).encode())


def test_recorded_targets_come_from_routes_and_where_there_is_none_from_events() -> None:
    chosen = Event(1.0, EventKind.TARGET, "5, 6", {"xy": [5.0, 6.0]})
    cleared = Event(3.0, EventKind.TARGET, "cleared")
    targets = RecordedTargets([chosen, cleared])
    rows = [
        row(0, 0.5, full=False),
        row(1, 1.0, full=False),
        row(2, 2.0, full=True),
        row(3, 2.5, full=False),
        row(4, 3.0, full=False),
    ]
    assert [targets.of(r) for r in rows] == [None, (5.0, 6.0), (90.0, 32.0), (90.0, 32.0), None]


def test_a_damaged_target_is_no_target() -> None:
    assert RecordedTargets([Event(0.0, EventKind.TARGET, "")]).of(row(0, 1.0, full=False)) is None
    assert RecordedTargets([Event(0.0, EventKind.TARGET, "?", {"xy": ["a", 1]})]).of(row(0, 1.0, full=False)) is None
