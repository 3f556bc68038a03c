"""Health of camera and perception: frame by frame reports in, active faults out. Pure; ages count from the capture."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from core.control.faults import AFTER_SOME, AT_ONCE, Cause, Fault
from core.safety_config import SafetyConfig
from core.types import Reason


class RouteState(StrEnum):
    """Is there a way to the operator's destination?"""

    NONE = "no destination"
    BEHIND = "destination behind the robot"
    READY = "ready"


@dataclass(frozen=True, slots=True)
class FrameReport:
    """What one turn of perception says.

    ``delivered`` and ``lost`` count the camera's frames since the last report: those that arrived (also those skipped for a newer
    one) and those that never did. ``confidence`` is the pose's; ``finite`` is False when any number of the result is not finite.
    ``drift_px`` is how far the landmarks moved since the rig was set up (None: not watched).
    """

    index: int
    captured_s: float
    refusal: Reason | None = None
    confidence: float = 0.0
    route: RouteState = RouteState.NONE
    finite: bool = True
    format_ok: bool = True
    same_picture: bool = False
    delivered: int = 1
    lost: int = 0
    drift_px: float | None = None


@dataclass(frozen=True, slots=True)
class FrameArrived:
    """The camera gave a frame; sent from beside the camera, it tells a silent camera from slow perception."""

    captured_s: float


@dataclass(frozen=True, slots=True)
class FrameWatch:
    """What is remembered of the frames. ``well``: the newest one gave a pose."""

    arrived_s: float | None = None
    newest: FrameReport | None = None
    pose_captured_s: float | None = None
    well: bool = False
    equal_run: int = 0
    refusal_run: int = 0
    refusal_since_s: float = 0.0
    broken_run: int = 0
    unsure: bool = False
    route: RouteState = RouteState.NONE
    counts: tuple[tuple[float, int, int], ...] = ()
    loss_since_s: float | None = None
    out_of_order: int = 0
    out_of_order_s: float = -math.inf


def see_arrival(watch: FrameWatch, captured_s: float, now_s: float) -> FrameWatch:
    """The watch after a frame came; a time that is older, in the future or no number is ignored."""
    known_s = watch.arrived_s if watch.arrived_s is not None else -math.inf
    return replace(watch, arrived_s=captured_s) if known_s < captured_s <= now_s else watch


def see_late(watch: FrameWatch, now_s: float) -> FrameWatch:
    """The watch after a frame that was overtaken by a newer one: it is counted, and counts for nothing else."""
    return replace(watch, out_of_order=watch.out_of_order + 1, out_of_order_s=now_s)


def see_frame(watch: FrameWatch, report: FrameReport, now_s: float, safety: SafetyConfig) -> FrameWatch:
    """The watch after a report. A report that is overtaken by a newer one is dropped and counted."""
    if not (math.isfinite(report.captured_s) and report.captured_s <= now_s):
        # such a time would look fresh for ever; the picture is as good as none
        return replace(watch, broken_run=watch.broken_run + 1, well=False)
    newest = watch.newest
    if newest is not None:
        later_s = report.captured_s - newest.captured_s
        # after a longer silence the camera was opened again, and counts from the beginning
        if later_s < 0.0 or (report.index <= newest.index and later_s <= safety.frame_disarm_s):
            return see_late(watch, now_s)
    watch = _count_loss(see_arrival(watch, report.captured_s, now_s), report, now_s, safety)
    again = newest is not None and report.refusal is not None and newest.refusal is report.refusal
    watch = replace(
        watch,
        newest=report,
        equal_run=watch.equal_run + 1 if report.same_picture and newest is not None else 1,
        refusal_run=watch.refusal_run + 1 if again else 1,
        # since the last frame that was different
        refusal_since_s=watch.refusal_since_s if again else newest.captured_s if newest is not None else report.captured_s,
    )
    if not (report.finite and math.isfinite(report.confidence)):
        return replace(watch, broken_run=watch.broken_run + 1, well=False)
    watch = replace(watch, broken_run=0)
    if report.refusal is not None:
        return replace(watch, well=False)
    needed = safety.min_confidence + (safety.confidence_hysteresis if watch.unsure else 0.0)
    return replace(watch, pose_captured_s=report.captured_s, well=True, unsure=report.confidence < needed, route=report.route)


def _count_loss(watch: FrameWatch, report: FrameReport, now_s: float, safety: SafetyConfig) -> FrameWatch:
    kept = tuple(count for count in watch.counts if now_s - count[0] <= safety.frame_loss_window_s)
    counts = (*kept, (now_s, report.delivered, report.lost))
    share = _lost_share(counts, safety)
    since_s = watch.loss_since_s if watch.loss_since_s is not None else now_s
    return replace(watch, counts=counts, loss_since_s=since_s if share > safety.frame_loss_hold_share else None)


def _lost_share(counts: tuple[tuple[float, int, int], ...], safety: SafetyConfig) -> float:
    lost = sum(count[2] for count in counts)
    total = lost + sum(count[1] for count in counts)
    return lost / total if total >= safety.frame_loss_min_frames else 0.0


def frame_faults(watch: FrameWatch, now_s: float, safety: SafetyConfig) -> list[Fault]:
    """The active faults of camera and perception."""
    faults = _age_faults(watch, now_s, safety)
    if watch.newest is not None:
        faults += [*_camera_faults(watch, watch.newest, now_s, safety), *_result_faults(watch, watch.newest, now_s, safety)]
    return faults


def _age_faults(watch: FrameWatch, now_s: float, safety: SafetyConfig) -> list[Fault]:
    if watch.arrived_s is None:
        return [Fault(Cause.CAMERA_LOST, "no frame yet")]
    faults = []
    age_s = now_s - watch.arrived_s
    if age_s > safety.frame_disarm_s:
        faults.append(Fault(Cause.CAMERA_LOST, f"newest frame {1000 * age_s:.0f} ms old"))
    elif age_s > safety.frame_hold_s:
        faults.append(Fault(Cause.CAMERA_SILENT, f"newest frame {1000 * age_s:.0f} ms old"))
    pose_age_s = math.inf if watch.pose_captured_s is None else now_s - watch.pose_captured_s
    if pose_age_s > safety.pose_disarm_s:
        faults.append(Fault(Cause.POSE_LOST, "no pose yet" if math.isinf(pose_age_s) else f"{1000 * pose_age_s:.0f} ms old"))
    elif pose_age_s > safety.pose_hold_s:
        faults.append(Fault(Cause.POSE_STALE, f"{1000 * pose_age_s:.0f} ms old"))
    return faults


def _camera_faults(watch: FrameWatch, newest: FrameReport, now_s: float, safety: SafetyConfig) -> list[Fault]:
    faults = []
    if watch.equal_run >= safety.equal_frames:
        faults.append(Fault(Cause.CAMERA_FROZEN, f"{watch.equal_run} identical pictures"))
    if not newest.format_ok:
        faults.append(Fault(Cause.WRONG_FORMAT))
    if newest.drift_px is not None and not abs(newest.drift_px) <= safety.max_drift_px:
        moved = f"by {newest.drift_px:.0f} px (at most {safety.max_drift_px:g} px)"
        faults.append(Fault(Cause.CAMERA_MOVED, moved if math.isfinite(newest.drift_px) else "it shows something else"))
    share = _lost_share(watch.counts, safety)
    if watch.loss_since_s is not None:
        long = now_s - watch.loss_since_s > safety.frame_loss_disarm_s
        faults.append(Fault(Cause.FRAMES_LOST_LONG if long else Cause.FRAMES_LOST, f"{100 * share:.0f} %"))
    elif share > safety.frame_loss_warn_share:
        faults.append(Fault(Cause.FRAMES_DROPPED, f"{100 * share:.0f} %"))
    if now_s - watch.out_of_order_s <= safety.frame_loss_window_s:
        faults.append(Fault(Cause.OUT_OF_ORDER, f"{watch.out_of_order} until now"))
    return faults


def _result_faults(watch: FrameWatch, newest: FrameReport, now_s: float, safety: SafetyConfig) -> list[Fault]:
    faults = []
    if watch.broken_run >= safety.broken_results:
        faults.append(Fault(Cause.NOT_FINITE_REPEATED, f"{watch.broken_run} in a row"))
    elif watch.broken_run > 0:
        faults.append(Fault(Cause.NOT_FINITE))
    if newest.refusal is not None:
        faults += _refusal_faults(watch, newest.refusal, now_s, safety)
    elif watch.unsure:
        faults.append(
            Fault(Cause.CONFIDENCE_LOW, f"{100 * newest.confidence:.0f} % (at least {100 * safety.min_confidence:.0f} %)")
        )
    return faults


def _refusal_faults(watch: FrameWatch, refusal: Reason, now_s: float, safety: SafetyConfig) -> list[Fault]:
    if (cause := AT_ONCE.get(refusal)) is not None:
        return [Fault(cause)]
    cause, enough = AFTER_SOME[refusal], safety.dark_frames
    if refusal is Reason.NO_ROBOT:
        enough = safety.head_lost_frames
        if now_s - watch.refusal_since_s > safety.head_lost_disarm_s:
            cause, enough = Cause.HEAD_LOST_LONG, 1
    return [Fault(cause, f"{watch.refusal_run} frames")] if watch.refusal_run >= enough else []
