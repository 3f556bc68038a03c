"""Reports in, faults out: every threshold on either side; deadmen."""

import math
from dataclasses import replace

import pytest

from core.control.camera_monitor import CameraMonitor, FrameReport, RouteState
from core.control.faults import Cause, Fault
from core.types import Reason
from tests.core.healthy import SAFETY, TICK_S


def _watch(*reports: FrameReport, now_s: float | None = None) -> CameraMonitor:
    watch = CameraMonitor()
    for report in reports:
        watch = watch.update(report, report.captured_s if now_s is None else now_s, SAFETY)
    return watch


def _good(count: int, first: int = 0, **changes: object) -> list[FrameReport]:
    report = FrameReport(0, 0.0, confidence=0.9, route=RouteState.READY)
    return [replace(report, index=first + n, captured_s=(first + n) * TICK_S, **changes) for n in range(count)]


def _causes(watch: CameraMonitor, now_s: float | None = None) -> set[Cause]:
    newest_s = watch.newest.captured_s if watch.newest is not None else 0.0
    return {fault.cause for fault in watch.faults(newest_s if now_s is None else now_s, SAFETY)}


@pytest.mark.parametrize(
    ("age_s", "causes"),
    [
        (0.15, set()),
        (0.151, {Cause.CAMERA_SILENT, Cause.POSE_STALE}),
        (0.5, {Cause.CAMERA_SILENT, Cause.POSE_STALE}),
        (0.501, {Cause.CAMERA_LOST, Cause.POSE_LOST}),
    ],
)
def test_ages_of_frame_and_pose(age_s: float, causes: set[Cause]) -> None:
    assert _causes(_watch(*_good(1)), age_s) == causes


def test_a_living_camera_with_slow_perception_is_no_silent_camera() -> None:
    watch = _watch(*_good(1)).arrived(0.3, 0.3)
    assert _causes(watch, 0.4) == {Cause.POSE_STALE}
    assert _causes(CameraMonitor().arrived(0.0, 0.0), 0.1) == {Cause.POSE_LOST}
    assert CameraMonitor().arrived(0.0, 0.0).faults(0.1, SAFETY) == [Fault(Cause.POSE_LOST, "no pose yet")]


@pytest.mark.parametrize("captured_s", [0.2, 0.1, 0.51, math.nan, math.inf, -math.inf])
def test_an_arrival_that_is_older_or_from_the_future_is_ignored(captured_s: float) -> None:
    watch = CameraMonitor().arrived(0.2, 0.2)
    assert watch.arrived(captured_s, 0.5) == watch


def test_results_out_of_order_are_dropped_and_counted() -> None:
    first, second, third = _good(3)
    bad = replace(first, refusal=Reason.SEVERAL_ROBOTS)
    watch = _watch(first, second, third, bad, second, now_s=1.0)
    assert watch.out_of_order == 2
    assert watch.newest == third
    assert _watch(third, third, now_s=1.0).out_of_order == 1
    assert _watch(third, replace(third, index=9, captured_s=0.03), now_s=1.0).out_of_order == 1
    assert _watch(third, replace(third, index=9), now_s=1.0).out_of_order == 0


def test_a_camera_that_was_opened_again_counts_from_the_beginning() -> None:
    before = replace(_good(1)[0], index=500, captured_s=1.0)
    assert _watch(before, replace(before, index=0, captured_s=1.5), now_s=9.0).out_of_order == 1
    assert _watch(before, replace(before, index=0, captured_s=1.501), now_s=9.0).out_of_order == 0
    assert _watch(before, replace(before, index=0, captured_s=0.4), now_s=9.0).out_of_order == 1


@pytest.mark.parametrize("captured_s", [math.nan, math.inf, 5.001])
def test_a_frame_from_the_future_is_a_broken_result(captured_s: float) -> None:
    watch = _watch(*_good(1), now_s=5.0).update(replace(_good(1)[0], index=1, captured_s=captured_s), 5.0, SAFETY)
    assert watch.newest.index == 0
    assert Cause.NOT_FINITE in _causes(watch, 0.1)
    assert not watch.well
    again = watch.update(replace(_good(1)[0], index=2, captured_s=math.nan), 5.0, SAFETY)
    assert again.broken_run == 2


@pytest.mark.parametrize(("count", "frozen"), [(4, False), (5, True)])
def test_five_equal_pictures_are_a_frozen_camera(count: int, frozen: bool) -> None:
    first, *rest = _good(count)
    assert (Cause.CAMERA_FROZEN in _causes(_watch(first, *(replace(r, same_picture=True) for r in rest)))) == frozen


@pytest.mark.parametrize(("reason", "cause"), [(Reason.BLACK, Cause.IMAGE_BLACK), (Reason.WHITE, Cause.IMAGE_WHITE)])
def test_three_dark_or_bright_pictures(reason: Reason, cause: Cause) -> None:
    bad = [replace(r, refusal=reason) for r in _good(4, first=1)]
    assert cause not in _causes(_watch(*_good(1), *bad[:2]))
    assert cause in _causes(_watch(*_good(1), *bad[:3]))
    mixed = [*bad[:2], replace(bad[2], refusal=Reason.BLURRED), bad[3]]
    assert cause not in _causes(_watch(*_good(1), *mixed))


def test_the_head_is_lost_after_three_frames_and_for_long_after_half_a_second() -> None:
    gone = [replace(r, refusal=Reason.NO_ROBOT) for r in _good(3, first=1)]
    assert _causes(_watch(*_good(1), *gone[:2])) == set()
    assert _causes(_watch(*_good(1), *gone)) == {Cause.HEAD_LOST}
    assert Cause.HEAD_LOST in _causes(_watch(*_good(1), *gone), 0.5)
    late = _causes(_watch(*_good(1), *gone), 0.501)
    assert Cause.HEAD_LOST_LONG in late
    assert Cause.HEAD_LOST not in late
    # without a frame before, from the first one on
    assert Cause.HEAD_LOST_LONG not in _causes(_watch(*gone), 0.53125)
    assert Cause.HEAD_LOST_LONG in _causes(_watch(*gone), 0.532)


@pytest.mark.parametrize("broken", [{"finite": False}, {"confidence": math.nan}, {"confidence": math.inf}])
def test_a_result_that_is_not_finite_is_discarded(broken: dict[str, object]) -> None:
    bad = _good(3, first=1, **broken)
    watch = _watch(*_good(1), bad[0])
    assert _causes(watch) == {Cause.NOT_FINITE}
    assert watch.pose_captured_s == 0.0
    assert not watch.well
    assert _causes(_watch(*_good(1), *bad[:2])) == {Cause.NOT_FINITE}
    assert _causes(_watch(*_good(1), *bad)) == {Cause.NOT_FINITE_REPEATED}
    mended = _watch(*_good(1), *bad[:2], *_good(1, first=3), *_good(2, first=4, **broken))
    assert _causes(mended) == {Cause.NOT_FINITE}
    assert _causes(_watch(*_good(1), bad[0], *_good(1, first=3))) == set()


def test_confidence_has_hysteresis() -> None:
    def after(*values: float) -> bool:
        return _watch(*(replace(r, confidence=c) for r, c in zip(_good(len(values)), values, strict=True))).unsure

    assert not after(0.5)
    assert after(0.499)
    assert after(0.499, 0.549)
    assert not after(0.499, 0.55)
    assert after(0.499, 0.55, 0.499)
    assert not after(0.499, 0.55, 0.5)


def test_only_poses_that_stay_unsure_hold_the_program() -> None:
    doubt = [replace(report, confidence=0.4) for report in _good(20, first=1)]
    assert Cause.CONFIDENCE_LOW in _causes(_watch(doubt[0]))  # there was no sure one
    watch = _watch(*_good(1), doubt[0])
    assert _causes(watch, 0.15) == set()
    assert Cause.CONFIDENCE_LOW in _causes(watch, 0.151)
    assert _causes(_watch(*_good(1), *doubt[:4])) == set()
    assert _causes(_watch(*_good(1), *doubt)) == {Cause.CONFIDENCE_LOW}
    assert _causes(_watch(*_good(1), *doubt, *_good(1, first=21))) == set()
    mixed = [one for n in range(8) for one in (doubt[2 * n], *_good(1, first=2 * n + 2))]
    assert _causes(_watch(*_good(1), *mixed, *_good(1, first=17, confidence=0.4))) == {Cause.CONFIDENCE_LOW}  # one sure is none
    assert _watch(*_good(1), replace(doubt[0], route=RouteState.NONE)).route is RouteState.READY


def test_a_refusal_keeps_the_route_and_the_age_of_the_last_pose() -> None:
    watch = _watch(*_good(1), replace(_good(1, first=1)[0], refusal=Reason.HEAD_JUMP, route=RouteState.NONE))
    assert watch.route is RouteState.READY
    assert watch.pose_captured_s == 0.0
    assert _watch(*_good(1, route=RouteState.BEHIND)).route is RouteState.BEHIND
    assert _watch(*_good(1)).well


@pytest.mark.parametrize(
    ("drift", "moved"), [(None, False), (6.0, False), (-6.0, False), (6.01, True), (-6.01, True), (math.nan, True)]
)
def test_landmarks_that_drift_mean_a_moved_camera(drift: float | None, moved: bool) -> None:
    assert (Cause.CAMERA_MOVED in _causes(_watch(*_good(1, drift_px=drift)))) == moved


@pytest.mark.parametrize(
    ("delivered", "lost", "causes"),
    [
        (27, 2, set()),  # too few to tell
        (24, 5, set()),
        (24, 6, {Cause.FRAMES_DROPPED}),  # exactly 20 %
        (23, 7, {Cause.FRAMES_LOST}),
        (27, 3, set()),  # exactly 10 %
        (26, 4, {Cause.FRAMES_DROPPED}),
    ],
)
def test_lost_frames(delivered: int, lost: int, causes: set[Cause]) -> None:
    assert _causes(_watch(*_good(1, delivered=delivered, lost=lost))) == causes


def test_loss_is_counted_over_three_seconds() -> None:
    bad, late = _good(1, delivered=20, lost=20)[0], replace(_good(1)[0], index=1, delivered=30)
    assert _causes(_watch(bad, replace(late, captured_s=3.0))) == {Cause.FRAMES_LOST_LONG}
    assert _causes(_watch(bad, replace(late, captured_s=3.01))) == set()


def test_loss_that_stays_for_half_a_second_is_loss_for_long() -> None:
    bad = _good(1, delivered=20, lost=20)[0]
    assert Cause.FRAMES_LOST in _causes(_watch(bad), 0.5)
    assert Cause.FRAMES_LOST_LONG in _causes(_watch(bad), 0.501)
    mended = _watch(
        bad, replace(bad, index=1, captured_s=0.4, delivered=200, lost=0), replace(bad, index=2, captured_s=0.6, lost=80)
    )
    assert Cause.FRAMES_LOST in _causes(mended, 0.7)


def test_the_details_are_measured_values() -> None:
    watch = _watch(*_good(1, delivered=20, lost=20, drift_px=9.4, confidence=0.3))
    assert watch.faults(0.2, SAFETY) == [
        Fault(Cause.CAMERA_SILENT, "newest frame 200 ms old"),
        Fault(Cause.POSE_STALE, "200 ms old"),
        Fault(Cause.CAMERA_MOVED, "by 9 px (at most 6 px)"),
        Fault(Cause.FRAMES_LOST, "50 %"),
        Fault(Cause.CONFIDENCE_LOW, "30 % (at least 55 % to go on)"),
    ]
    assert [fault.detail for fault in watch.faults(0.6, SAFETY)][:2] == ["newest frame 600 ms old", "600 ms old"]
    dropped = _watch(*_good(1, delivered=26, lost=4)).faults(0.0, SAFETY)
    assert dropped == [Fault(Cause.FRAMES_DROPPED, "13 %")]
