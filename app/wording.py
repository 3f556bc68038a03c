"""Texts that people read: states, reasons, quantities. One table each, so that wording stays consistent and can be translated."""

from __future__ import annotations

from dataclasses import dataclass

from app.language import mark, tr, tr_text
from core.config import PoseConfig
from core.types import Advice, Pose, PoseState, Reason, Refusal, Scene, Speed

STATE_TITLE = {
    PoseState.A: mark("On the centerline"),
    PoseState.B: mark("Coming back"),
    PoseState.C: mark("Moving away"),
    PoseState.D: mark("Crossed"),
}

STATE_MEANING = {
    PoseState.A: mark("A: on the centerline and along it. Ideal: speed up, no steering."),
    PoseState.B: mark("B: the head is nearer to the centerline than the tail. Coming back: slow down, no steering."),
    PoseState.C: mark("C: the head is farther from the centerline than the tail. Moving away: slowest, steer hardest."),
    PoseState.D: mark("D: head and tail lie on opposite sides of the centerline. Crossed: moderate speed, steer by theta."),
}


@dataclass(frozen=True, slots=True)
class ReasonText:
    """A refusal in plain words, and what the operator can do about it."""

    title: str
    what_to_do: str


REASON_TEXT = {
    Reason.UNREADABLE: ReasonText(mark("Image unreadable"), mark("check the camera or the file")),
    Reason.NO_MODEL: ReasonText(
        mark("No model"), mark("put back resources/models/default, or choose another model in the configuration")
    ),
    Reason.BLACK: ReasonText(mark("Image is black"), mark("take off the lens cap, switch the lamp on or raise the exposure")),
    Reason.WHITE: ReasonText(mark("Image is overexposed"), mark("dim the lamp or lower the exposure")),
    Reason.BLURRED: ReasonText(mark("Image is blurred"), mark("focus the camera or hold it still")),
    Reason.NO_VESSEL: ReasonText(mark("No vessel in view"), mark("point the camera at the phantom")),
    Reason.NO_ROBOT: ReasonText(mark("No robot in view"), mark("advance the robot into the picture")),
    Reason.SEVERAL_ROBOTS: ReasonText(mark("Several robots in view"), mark("leave one robot in the picture")),
    Reason.TOO_SHORT: ReasonText(mark("Too little of the robot in view"), mark("advance it a little")),
    Reason.OUTSIDE_VESSEL: ReasonText(
        mark("Robot is outside the vessel"), mark("check the phantom, or clear what looks like a robot")
    ),
    Reason.GAP_TOO_LONG: ReasonText(mark("Too much of the robot is hidden"), mark("remove what covers it")),
    Reason.AMBIGUOUS_PATH: ReasonText(
        mark("The robot's path is not clear"), mark("retract a little so that it does not cross itself")
    ),
    Reason.AMBIGUOUS_BRANCH: ReasonText(mark("Two branches fit"), mark("click the destination in the picture")),
    Reason.LOW_CONFIDENCE: ReasonText(mark("Not sure enough to answer"), mark("better light or focus helps")),
    Reason.UNLIKE_TRAINING: ReasonText(
        mark("Picture of an unknown kind"), mark("teach the model with labelled pictures of this rig")
    ),
    Reason.HEAD_JUMP: ReasonText(mark("The head jumped"), mark("wait for the next frames")),
}

SPEED_WORD = {
    Speed.STOP: mark("Stop"),
    Speed.SLOWEST: mark("Slowest"),
    Speed.SLOW: mark("Slow"),
    Speed.MODERATE: mark("Moderate"),
    Speed.FAST: mark("Fast"),
}


def side(signed: float) -> str:
    """The word for a sign: positive is to the right of the vessel's direction."""
    return tr("right") if signed > 0 else tr("left")


def signed_degrees(angle_deg: float, digits: int) -> str:
    """For example "+18.4°"; zero has no sign."""
    if round(angle_deg, digits) == 0:
        return f"{0:.{digits}f}°"
    return f"{angle_deg:+.{digits}f}°".replace("-", "\N{MINUS SIGN}")


def literal_state(pose: Pose, limits: PoseConfig) -> PoseState:
    """The state by METHOD section 6 without hysteresis."""
    if pose.d_head_px < limits.d_allow_px and pose.d_tail_px < limits.d_allow_px and pose.theta_deg < limits.theta_allow_deg:
        return PoseState.A
    if pose.crossed:
        return PoseState.D
    return PoseState.B if pose.d_head_px < pose.d_tail_px else PoseState.C


def why_line(pose: Pose, limits: PoseConfig) -> str:
    """Why the pose has its state, in one plain sentence with the values that decided it."""
    head, tail = pose.d_head_px, pose.d_tail_px
    digits = 1 if round(head) == round(tail) else 0
    angle = f"{tr('theta')}\N{NO-BREAK SPACE}{pose.theta_deg:.0f}°\N{NO-BREAK SPACE}{side(pose.theta_signed_deg)}"
    d_head, d_tail = _pixels("d_head", head, digits), _pixels("d_tail", tail, digits)
    compared = f"{d_head} {'<' if head < tail else '>' if head > tail else '='} {d_tail}"
    if pose.state is PoseState.A:
        allowed_px, allowed_deg = (
            tr("allowed {limit:g}", limit=limits.d_allow_px),
            tr("allowed {limit:g}°", limit=limits.theta_allow_deg),
        )
        line = f"{d_head}, {d_tail} ({allowed_px}), {angle} ({allowed_deg})"
    elif pose.state is PoseState.D:
        line = tr(
            "head {head:.0f} px {side}, tail {tail:.0f} px {other_side} of the centerline, {angle}",
            head=head,
            side=side(pose.c_head_px),
            tail=tail,
            other_side=side(pose.c_tail_px),
            angle=angle,
        )
    elif pose.state is PoseState.B:
        line = tr("to the centerline: {compared}, {angle}", compared=compared, angle=angle)
    else:
        line = tr("from the centerline: {compared}, {angle}", compared=compared, angle=angle)
    # hysteresis keeps a state for a moment beyond its limit; without a word about it the values would contradict the letter
    return line if literal_state(pose, limits) is pose.state else tr("{line} (kept for a moment)", line=line)


def _pixels(name: str, value: float, digits: int) -> str:
    """Name, value and unit, kept together when the sentence wraps."""
    return f"{name} {value:.{digits}f} px".replace(" ", "\N{NO-BREAK SPACE}")


def refusal_line(refusal: Refusal) -> str:
    """What to do about a refusal, and what was measured."""
    advice = tr(REASON_TEXT[refusal.reason].what_to_do)
    return tr("{advice}. {detail}", advice=f"{advice[0].upper()}{advice[1:]}", detail=tr_text(refusal.detail)).rstrip(". ")


def refusal_text(refusal: Refusal) -> str:
    """Reason and what was measured, in few words."""
    detail = f": {tr_text(refusal.detail)}" if refusal.detail else ""
    return f"{tr(refusal.reason.value)}{detail}"


def advice_headline(advice: Advice) -> str:
    """For example "Slowest, 18° left"; "Back off" where the advice is to retract."""
    speed = tr(SPEED_WORD[advice.speed])
    how = speed if advice.advance_mm_s >= 0.0 else tr("Back off, {speed}", speed=speed.lower())
    if advice.speed is Speed.STOP:
        return speed
    if abs(advice.steer_deg) < 0.5:
        return tr("{how}, straight", how=how)
    return tr("{how}, {angle:.0f}° {side}", how=how, angle=abs(advice.steer_deg), side=side(advice.steer_deg))


def target_note(scene: Scene) -> str:
    """How far it is to the operator's target, or why that is not known."""
    if scene.route is not None:
        return tr("{length:.0f} px to go", length=scene.route.length_px)
    return tr("no way: {why}", why=tr_text(scene.route_problem)) if scene.route_problem else tr("distance unknown without a pose")
