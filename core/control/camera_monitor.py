"""What stops the program when the camera dies or perception fails: age of the newest frame and pose, and their faults. Pure.

Reports on frames go in, active faults come out. ``supervisor.supervise`` applies them at each of the pilot's turns, which do not
wait for the camera; the operator can still drive by hand. The second barrier is ``gate.gate_step`` in the servo process: it rejects
a command of the program whose frame is too old.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from core.config.safety import SafetyConfig
from core.control.direction_monitor import HeadSeen
from core.control.faults import AFTER_SOME, AT_ONCE, Cause, Fault
from core.messages import message
from core.types import Reason


class RouteState(StrEnum):
    """Is there a way to the operator's target?"""

    NONE = "no target"
    BEHIND = "target behind the robot"
    READY = "ready"


@dataclass(frozen=True, slots=True)
class FrameReport:
    """One turn of perception.

    Attributes
    ----------
    confidence : of the pose.
    finite : False when any number of the result is not finite.
    delivered, lost : the camera's frames since the last report that arrived (also those skipped for a newer one), or never did.
    drift_px : how far the landmarks moved since the rig was set up; None: not watched.
    head : where the head is and points, for ``direction_monitor``; None without a pose.
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
    head: HeadSeen | None = None


@dataclass(frozen=True, slots=True)
class FrameArrived:
    """The camera gave a frame; sent before perception, it tells a silent camera from slow perception."""

    captured_s: float


@dataclass(frozen=True, slots=True)
class FrameLate:
    """A frame was overtaken by a newer one, and left out before perception."""


@dataclass(frozen=True, slots=True)
class CameraMonitor:
    """State of camera and perception.

    Attributes
    ----------
    well : the newest frame gave a pose.
    equal_run, refusal_run, broken_run : frames in a row with the same picture, the same refusal, a result that is not finite.
    refusal_since_s : capture of the last frame before this run of refusals.
    unsure : the confidence is below the limit, with hysteresis.
    sure_s : capture of the newest pose that was sure enough, as was the one before.
    counts : (time, frames delivered, frames lost) of the reports in the window of frame loss.
    """

    arrived_s: float | None = None
    newest: FrameReport | None = None
    pose_captured_s: float | None = None
    well: bool = False
    equal_run: int = 0
    refusal_run: int = 0
    refusal_since_s: float = 0.0
    broken_run: int = 0
    unsure: bool = False
    sure_s: float = -math.inf
    route: RouteState = RouteState.NONE
    counts: tuple[tuple[float, int, int], ...] = ()
    loss_since_s: float | None = None
    out_of_order: int = 0
    out_of_order_s: float = -math.inf

    def arrived(self, captured_s: float, now_s: float) -> CameraMonitor:
        """The state after a frame came; a time that is older, in the future or NaN is ignored."""
        known_s = self.arrived_s if self.arrived_s is not None else -math.inf
        return replace(self, arrived_s=captured_s) if known_s < captured_s <= now_s else self

    def late(self, now_s: float) -> CameraMonitor:
        """The state after a frame that was overtaken by a newer one."""
        return replace(self, out_of_order=self.out_of_order + 1, out_of_order_s=now_s)

    def update(self, report: FrameReport, now_s: float, safety: SafetyConfig) -> CameraMonitor:
        """The state after a report. A report that is overtaken by a newer one is dropped and counted."""
        if not (math.isfinite(report.captured_s) and report.captured_s <= now_s):
            # such a time would look fresh for ever: the result counts as broken
            return replace(self, broken_run=self.broken_run + 1, well=False)
        newest = self.newest
        if newest is not None:
            later_s = report.captured_s - newest.captured_s
            # after a longer silence the camera was opened again, and counts from the beginning
            if later_s < 0.0 or (report.index <= newest.index and later_s <= safety.frame_disarm_s):
                return self.late(now_s)
        kept = (count for count in self.counts if now_s - count[0] <= safety.frame_loss_window_s)
        counts = (*kept, (now_s, report.delivered, report.lost))
        is_lossy = _lost_share(counts, safety) > safety.frame_loss_hold_share
        again = newest is not None and report.refusal is not None and newest.refusal is report.refusal
        state = replace(
            self.arrived(report.captured_s, now_s),
            newest=report,
            counts=counts,
            loss_since_s=(self.loss_since_s if self.loss_since_s is not None else now_s) if is_lossy else None,
            equal_run=self.equal_run + 1 if report.same_picture and newest is not None else 1,
            refusal_run=self.refusal_run + 1 if again else 1,
            refusal_since_s=self.refusal_since_s if again else (newest or report).captured_s,
        )
        if not (report.finite and math.isfinite(report.confidence)):
            return replace(state, broken_run=state.broken_run + 1, well=False)
        state = replace(state, broken_run=0)
        if report.refusal is not None:
            return replace(state, well=False)
        needed = safety.min_confidence + (safety.confidence_hysteresis if state.unsure else 0.0)
        unsure = report.confidence < needed
        sure_s = state.sure_s if unsure or state.unsure else report.captured_s
        route = state.route if unsure else report.route
        return replace(state, pose_captured_s=report.captured_s, well=True, unsure=unsure, sure_s=sure_s, route=route)

    def faults(self, now_s: float, safety: SafetyConfig) -> list[Fault]:
        """The active faults of camera and perception."""
        if self.arrived_s is None:
            faults = [Fault(Cause.CAMERA_LOST, "no frame yet")]
        else:
            age_s = now_s - self.arrived_s
            faults = _age_fault(
                age_s, safety.frame_hold_s, safety.frame_disarm_s, Cause.CAMERA_SILENT, Cause.CAMERA_LOST, "newest frame "
            )
            pose_age_s = math.inf if self.pose_captured_s is None else now_s - self.pose_captured_s
            faults += _age_fault(pose_age_s, safety.pose_hold_s, safety.pose_disarm_s, Cause.POSE_STALE, Cause.POSE_LOST, "")
        if self.newest is None:
            return faults
        return [*faults, *self._camera_faults(self.newest, now_s, safety), *self._result_faults(self.newest, now_s, safety)]

    def _camera_faults(self, newest: FrameReport, now_s: float, safety: SafetyConfig) -> list[Fault]:
        faults = []
        if self.equal_run >= safety.equal_frames:
            faults.append(Fault(Cause.CAMERA_FROZEN, message("{a} identical pictures", a=self.equal_run)))
        if not newest.format_ok:
            faults.append(Fault(Cause.WRONG_FORMAT))
        if newest.drift_px is not None and not abs(newest.drift_px) <= safety.max_drift_px:
            moved = message("by {a:.0f} px (at most {b:g} px)", a=newest.drift_px, b=safety.max_drift_px)
            faults.append(Fault(Cause.CAMERA_MOVED, moved if math.isfinite(newest.drift_px) else "it shows something else"))
        share = _lost_share(self.counts, safety)
        if self.loss_since_s is not None:
            long = now_s - self.loss_since_s > safety.frame_loss_disarm_s
            faults.append(Fault(Cause.FRAMES_LOST_LONG if long else Cause.FRAMES_LOST, f"{100 * share:.0f} %"))
        elif share > safety.frame_loss_warn_share:
            faults.append(Fault(Cause.FRAMES_DROPPED, f"{100 * share:.0f} %"))
        if now_s - self.out_of_order_s <= safety.frame_loss_window_s:
            faults.append(Fault(Cause.OUT_OF_ORDER, message("{a} until now", a=self.out_of_order)))
        return faults

    def _result_faults(self, newest: FrameReport, now_s: float, safety: SafetyConfig) -> list[Fault]:
        faults = []
        if self.broken_run >= safety.broken_results:
            faults.append(Fault(Cause.NOT_FINITE_REPEATED, message("{a} in a row", a=self.broken_run)))
        elif self.broken_run > 0:
            faults.append(Fault(Cause.NOT_FINITE))
        refusal = newest.refusal
        if refusal is None:
            if self.unsure and now_s - self.sure_s > safety.pose_hold_s:
                least = 100 * (safety.min_confidence + safety.confidence_hysteresis)
                faults.append(Fault(Cause.CONFIDENCE_LOW, f"{100 * newest.confidence:.0f} % (at least {least:.0f} % to go on)"))
            return faults
        if (cause := AT_ONCE.get(refusal)) is not None:
            return [*faults, Fault(cause)]
        cause, enough = AFTER_SOME[refusal], safety.dark_frames
        if refusal is Reason.NO_ROBOT:
            enough = safety.head_lost_frames
            if now_s - self.refusal_since_s > safety.head_lost_disarm_s:
                cause, enough = Cause.HEAD_LOST_LONG, 1
        if self.refusal_run >= enough:
            faults.append(Fault(cause, message("{a} frames", a=self.refusal_run)))
        return faults


def _lost_share(counts: tuple[tuple[float, int, int], ...], safety: SafetyConfig) -> float:
    lost = sum(count[2] for count in counts)
    total = lost + sum(count[1] for count in counts)
    return lost / total if total >= safety.frame_loss_min_frames else 0.0


def _age_fault(age_s: float, hold_s: float, disarm_s: float, hold: Cause, disarm: Cause, what: str) -> list[Fault]:
    detail = "no pose yet" if math.isinf(age_s) else f"{what}{1000 * age_s:.0f} ms old"
    if age_s > disarm_s:
        return [Fault(disarm, detail)]
    return [Fault(hold, detail)] if age_s > hold_s else []
