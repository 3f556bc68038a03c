"""Texts that people read: states, reasons, quantities. One table each, so that wording stays consistent and can be translated."""

from __future__ import annotations

from dataclasses import dataclass

from core.config import PoseConfig
from core.types import Advice, Pose, PoseState, Reason, Refusal, Scene, Speed

STATE_TITLE = {
    PoseState.A: "On the centerline",
    PoseState.B: "Coming back",
    PoseState.C: "Moving away",
    PoseState.D: "Crossed",
}

STATE_MEANING = {
    PoseState.A: "A: on the centerline and along it. Ideal: speed up, no steering.",
    PoseState.B: "B: the head is nearer to the centerline than the tail. Coming back: slow down, no steering.",
    PoseState.C: "C: the head is farther from the centerline than the tail. Moving away: slowest, steer hardest.",
    PoseState.D: "D: head and tail lie on opposite sides of the centerline. Crossed: moderate speed, steer by theta.",
}


@dataclass(frozen=True, slots=True)
class ReasonText:
    """A refusal in plain words, and what the operator can do about it."""

    title: str
    what_to_do: str


REASON_TEXT = {
    Reason.UNREADABLE: ReasonText("Image unreadable", "check the camera or the file"),
    Reason.NO_MODEL: ReasonText("No model", "put back resources/models/default, or choose another model in the configuration"),
    Reason.BLACK: ReasonText("Image is black", "take off the lens cap, switch the lamp on or raise the exposure"),
    Reason.WHITE: ReasonText("Image is overexposed", "dim the lamp or lower the exposure"),
    Reason.BLURRED: ReasonText("Image is blurred", "focus the camera or hold it still"),
    Reason.NO_VESSEL: ReasonText("No vessel in view", "point the camera at the phantom"),
    Reason.NO_ROBOT: ReasonText("No robot in view", "advance the robot into the picture"),
    Reason.SEVERAL_ROBOTS: ReasonText("Several robots in view", "leave one robot in the picture"),
    Reason.TOO_SHORT: ReasonText("Too little of the robot in view", "advance it a little"),
    Reason.OUTSIDE_VESSEL: ReasonText("Robot is outside the vessel", "check the phantom, or clear what looks like a robot"),
    Reason.GAP_TOO_LONG: ReasonText("Too much of the robot is hidden", "remove what covers it"),
    Reason.AMBIGUOUS_PATH: ReasonText("The robot's path is not clear", "retract a little so that it does not cross itself"),
    Reason.AMBIGUOUS_BRANCH: ReasonText("Two branches fit", "click the destination in the picture"),
    Reason.LOW_CONFIDENCE: ReasonText("Not sure enough to answer", "better light or focus helps"),
    Reason.HEAD_JUMP: ReasonText("The head jumped", "wait for the next frames"),
}

SPEED_WORD = {
    Speed.STOP: "Stop",
    Speed.SLOWEST: "Slowest",
    Speed.SLOW: "Slow",
    Speed.MODERATE: "Moderate",
    Speed.FAST: "Fast",
}


def side(signed: float) -> str:
    """The word for a sign: positive is to the right of the vessel's direction."""
    return "right" if signed > 0 else "left"


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
    angle = f"theta\N{NO-BREAK SPACE}{pose.theta_deg:.0f}°\N{NO-BREAK SPACE}{side(pose.theta_signed_deg)}"
    d_head, d_tail = _pixels("d_head", head, digits), _pixels("d_tail", tail, digits)
    compared = f"{d_head} {'<' if head < tail else '>' if head > tail else '='} {d_tail}"
    if pose.state is PoseState.A:
        allowed_px, allowed_deg = f"allowed {limits.d_allow_px:g}", f"allowed {limits.theta_allow_deg:g}°"
        line = f"{d_head}, {d_tail} ({allowed_px}), {angle} ({allowed_deg})"
    elif pose.state is PoseState.D:
        line = f"head {head:.0f} px {side(pose.c_head_px)}, tail {tail:.0f} px {side(pose.c_tail_px)} of the centerline, {angle}"
    elif pose.state is PoseState.B:
        line = f"to the centerline: {compared}, {angle}"
    else:
        line = f"from the centerline: {compared}, {angle}"
    # hysteresis keeps a state for a moment beyond its limit; without a word about it the values would contradict the letter
    return line if literal_state(pose, limits) is pose.state else f"{line} (kept for a moment)"


def _pixels(name: str, value: float, digits: int) -> str:
    """Name, value and unit, kept together when the sentence wraps."""
    return f"{name} {value:.{digits}f} px".replace(" ", "\N{NO-BREAK SPACE}")


def refusal_line(refusal: Refusal) -> str:
    """What to do about a refusal, and what was measured."""
    advice = REASON_TEXT[refusal.reason].what_to_do
    return f"{advice[0].upper()}{advice[1:]}. {refusal.detail}".rstrip(". ")


def advice_headline(advice: Advice) -> str:
    """For example "Slowest, 18° left"; "Back off" where the advice is to retract."""
    how = SPEED_WORD[advice.speed] if advice.advance_mm_s >= 0.0 else f"Back off, {SPEED_WORD[advice.speed].lower()}"
    if advice.speed is Speed.STOP:
        return SPEED_WORD[advice.speed]
    if abs(advice.steer_deg) < 0.5:
        return f"{how}, straight"
    return f"{how}, {abs(advice.steer_deg):.0f}° {side(advice.steer_deg)}"


def target_note(scene: Scene) -> str:
    """How far it is to the operator's target, or why that is not known."""
    if scene.route is not None:
        return f"{scene.route.length_px:.0f} px to go"
    return f"no way: {scene.route_problem}" if scene.route_problem else "distance unknown without a pose"
