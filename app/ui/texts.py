"""Texts that people read, in tables: the operator's next step, states, reasons, quantities (all tool tips), rigs. No Qt here."""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass, replace
from enum import Enum

from app.ui.i18n import ENGLISH, language_in_use, mark, tr, tr_text
from core.config.models import PoseConfig
from core.config.rig_file import RigFile
from core.config.safety import LIMITS_FORCE, JointKind, ServosConfig
from core.control.alerts import AlertKey, alert_of
from core.control.drive_view import DriveView
from core.control.faults import Area, Cause
from core.control.gate import Source
from core.control.modes import Mode
from core.types import Advice, Pose, PoseState, Reason, Refusal, Scene, Speed

DEADMAN_KEY = "Shift"
STOP_KEY = "Space"


@dataclass(frozen=True, slots=True)
class StepWords:
    """Name on the button, its key, and what it does."""

    name: str
    key: str
    meaning: str


class OperatorStep(Enum):
    """A request of the operator that has a button. STOP is not one of them: it is always there."""

    SERVOS_ON = StepWords(
        mark("Servos on"), "F3", mark("Check all servos and switch their torque on: then you can move the robot by hand")
    )
    ACKNOWLEDGE = StepWords(mark("Acknowledge"), "F4", mark("I have read why the program stopped; nothing moves by this"))
    ARM = StepWords(mark("Arm"), "F6", mark("Allow the program to be handed over to; nothing moves by this"))
    HAND_OVER = StepWords(mark("Hand over"), "F7", mark("The program drives to the target for as long as the deadman is held"))
    TAKE_BACK = StepWords(mark("Take back"), "F8", mark("You steer again, at once; moving the controls does the same"))
    DISARM = StepWords(
        mark("Disarm"), "Shift+F6", mark("The program may not be handed over to any more; you go on steering by hand")
    )


@dataclass(frozen=True, slots=True)
class NextStep:
    """The main step, and the line beside it.

    Attributes
    ----------
    step, other : what the main button asks for; what a second one asks for, if anything.
    granted : it would be granted now. A request that would be refused may still be made: the answer names all reasons.
    headline, rest : what is the matter, and what to do or what happens next.
    reasons : all that `headline` is the first of.
    simulated : camera and servos are the twin's.
    """

    step: OperatorStep
    granted: bool
    headline: str
    rest: str
    reasons: tuple[AlertKey, ...] = ()
    other: OperatorStep | None = None
    simulated: bool = False

    @property
    def text(self) -> str:
        """The one line."""
        more = tr(" (+{count} more)", count=len(self.reasons) - 1) if len(self.reasons) > 1 else ""
        return f"{sentence(self.headline)} {sentence(self.rest)}{more}".strip()

    @property
    def all_reasons(self) -> str:
        specs = (alert_of(key, simulated=self.simulated) for key in self.reasons)
        return "\n".join(f"{sentence(spec.text)} {sentence(spec.what_to_do)}" for spec in specs)


class Undriven(Enum):
    """Why there is no view of driving: what the badge says, and what and what else the line beside the main button says."""

    NO_ROBOT = (mark("pictures only"), mark("This rig has no robot"), mark("pictures and advice only"))
    NOT_YET = (mark("waiting for the rig"), mark("Waiting for the rig"), "")
    """It is being opened: whether there is something to drive is not known yet."""
    CLOSED = (mark("no rig is open"), mark("No rig is open"), mark("F5 opens it again"))
    """It stopped, and is opened again by the operator only."""

    @property
    def step(self) -> NextStep:
        return NextStep(OperatorStep.SERVOS_ON, False, *self.value[1:])


def who_drives(view: DriveView | None, why_not: Undriven = Undriven.NO_ROBOT) -> str:
    """In few words, for the badge; `why_not` says it where there is no view."""
    if view is None:
        return tr(why_not.value[0])
    if view.mode is Mode.HOLD:
        return tr("interrupted")
    if view.mode is Mode.STOPPED:
        return tr("nothing moves")
    if view.permitted is Source.PROGRAM:
        return tr("the program drives")
    if view.permitted is Source.OPERATOR:
        return tr("you steer")
    return tr("nothing moves") if view.servos_on or view.latched is not None else tr("servos not in use")


def next_step(view: DriveView) -> NextStep:
    if view.latched is not None or view.mode is Mode.STOPPED:
        return _acknowledge(view)
    if view.mode is Mode.AUTONOMOUS:
        rest = tr("let go and it holds; move the controls or press {key} to steer yourself", key=OperatorStep.TAKE_BACK.value.key)
        return NextStep(OperatorStep.TAKE_BACK, True, tr("The program drives"), rest, other=OperatorStep.DISARM)
    if view.mode is Mode.HOLD:
        return _interrupted(view)
    if view.busy:
        return NextStep(OperatorStep.SERVOS_ON, False, sentence(view.busy).rstrip(".。"), tr("this takes a moment"))
    if not view.servos_on:
        faults = tuple(fault.cause for fault in view.active if fault.cause.area is Area.SERVOS and fault.holds)
        rest = tr("press {key}: they are checked with the torque off, then tighten the wires", key=OperatorStep.SERVOS_ON.value.key)
        if faults:
            step = _refused(OperatorStep.SERVOS_ON, faults, view)
            # The servos' process has named what is not as configured, and what to do depends on it.
            said = next((fault.detail for fault in view.active if fault.cause is Cause.SERVOS_WRONG), "")
            return replace(step, rest=said) if said and faults[0] is Cause.SERVOS_WRONG else step
        return NextStep(OperatorStep.SERVOS_ON, True, tr("The servos are not in use, but may still pull"), rest)
    if view.mode is Mode.ARMED:
        return _hand_over(view)
    if view.against_arming:
        return _refused(OperatorStep.ARM, view.against_arming, view)
    rest = tr("press {key} to arm; then you can hand over to the program", key=OperatorStep.ARM.value.key)
    return NextStep(OperatorStep.ARM, True, tr("You steer"), rest)


def sentence(text: str) -> str:
    """`text` with a capital letter and a full stop; empty stays empty."""
    shown = tr_text(text)
    return tr("{sentence}.", sentence=f"{shown[0].upper()}{shown[1:]}") if shown else ""


def _refused(step: OperatorStep, reasons: tuple[AlertKey, ...], view: DriveView, other: OperatorStep | None = None) -> NextStep:
    first = alert_of(reasons[0], simulated=view.simulated)
    # servos that are in trouble can still be checked: that is the way out
    return NextStep(step, step is OperatorStep.SERVOS_ON, first.text, first.what_to_do, reasons, other, view.simulated)


def _acknowledge(view: DriveView) -> NextStep:
    if view.latched is None:
        rest = tr("press {key}, then switch the servos on", key=OperatorStep.ACKNOWLEDGE.value.key)
        return NextStep(OperatorStep.ACKNOWLEDGE, True, tr("Stopped"), rest)
    cause = view.latched.cause
    # a fault of servos in use that is still there latches again at once
    remains = view.servos_on and cause.area is Area.SERVOS and any(fault.cause is cause for fault in view.active)
    spec = alert_of(cause, simulated=view.simulated)
    return NextStep(OperatorStep.ACKNOWLEDGE, not remains, spec.text, spec.what_to_do, (cause,), simulated=view.simulated)


def _hand_over(view: DriveView) -> NextStep:
    if view.against_hand_over:
        return _refused(OperatorStep.HAND_OVER, view.against_hand_over, view, OperatorStep.DISARM)
    key = OperatorStep.HAND_OVER.value.key
    rest = tr("hold {deadman}, then press {key} to hand over", deadman=_deadman_of(view), key=key)
    if view.deadman:
        rest = tr("press {key}: the program drives while you hold", key=key)
    return NextStep(OperatorStep.HAND_OVER, True, tr("Ready"), rest, other=OperatorStep.DISARM)


def _interrupted(view: DriveView) -> NextStep:
    causes = tuple(fault.cause for fault in view.active if fault.holds)
    back, again = OperatorStep.TAKE_BACK.value.key, OperatorStep.HAND_OVER.value.key
    if causes:
        first = alert_of(causes[0], simulated=view.simulated)
        return NextStep(OperatorStep.TAKE_BACK, True, first.text, first.what_to_do, causes, OperatorStep.DISARM, view.simulated)
    deadman = _deadman_of(view)
    rest = tr("hold {deadman} and press {again} to go on, or {back} to take back", deadman=deadman, again=again, back=back)
    return NextStep(OperatorStep.TAKE_BACK, True, tr("Interrupted"), rest, other=OperatorStep.DISARM)


def _deadman_of(view: DriveView) -> str:
    """What must be held on this rig."""
    return DEADMAN_KEY if view.keyboard_deadman else tr("the pedal")


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


_WAY_DECIDES = mark("The way ahead may ask for something else: then badge and advice say so, and the advice counts.")

_TABLE: dict[PoseState, tuple[Speed, bool, str]] = {
    PoseState.A: (Speed.FAST, False, mark("fast, no steering")),
    PoseState.B: (Speed.SLOW, False, mark("slow, no steering")),
    PoseState.C: (Speed.SLOWEST, True, mark("slowest, steer")),
    PoseState.D: (Speed.MODERATE, True, mark("moderate, steer")),
}
"""The state table: speed, whether the head is turned, and both in words."""
_STRAIGHT_DEG = 0.5
"""Less steering is shown as straight."""


def override_line(advice: Advice | None, state: PoseState | None, *, with_rule: bool) -> str:
    """That the route decides and not the state table (`with_rule`: and what that says), in one line; "" where both agree."""
    if advice is None or state is None:
        return ""
    speed, steers, rule = _TABLE[state]
    agrees = advice.speed is speed and advice.advance_mm_s > 0.0 and (abs(advice.steer_deg) >= _STRAIGHT_DEG) is steers
    line = "" if agrees else tr("the route decides, not state {state}", state=state.value)
    return f"{line} ({tr(rule)})" if line and with_rule else line


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
    Reason.AMBIGUOUS_BRANCH: ReasonText(mark("Two branches fit"), mark("click the target in the picture")),
    Reason.LOW_CONFIDENCE: ReasonText(mark("Not sure enough to answer"), mark("better light or focus helps")),
    Reason.UNLIKE_TRAINING: ReasonText(mark("Picture of an unknown kind"), mark("teach this bench (menu Model)")),
    Reason.HEAD_JUMP: ReasonText(mark("The head jumped"), mark("wait for the next frames")),
    Reason.BENCH_MOVED: ReasonText(mark("The camera or the phantom was moved"), mark("put it back, or make the bench again")),
    Reason.OTHER_BENCH: ReasonText(
        mark("Not the bench that was set up"), mark("point the camera at the phantom, or make the bench again")
    ),
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
        allowed_px = tr("allowed {limit:g}", limit=limits.d_allow_px)
        line = f"{d_head}, {d_tail} ({allowed_px}), {angle} ({tr('allowed {limit:g}°', limit=limits.theta_allow_deg)})"
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
    # hysteresis keeps a state for a moment beyond its limit; without a note the values would contradict the letter
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
    if abs(advice.steer_deg) < _STRAIGHT_DEG:
        return tr("{how}, straight", how=how)
    return tr("{how}, {angle:.0f}° {side}", how=how, angle=abs(advice.steer_deg), side=side(advice.steer_deg))


def target_note(scene: Scene) -> str:
    """How far it is to the operator's target, or why that is not known."""
    if scene.route is not None:
        return tr("{length:.0f} px to go", length=scene.route.length_px)
    return tr("no way: {why}", why=tr_text(scene.route_problem)) if scene.route_problem else tr("distance unknown without a pose")


_WIDTH = 96
_NEVER_FIRST = "，。；：？）、"
"""Signs that do not begin a line."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """Its name as it is written on the screen, its unit ("" where it has none), and its meaning in whole sentences."""

    name: str
    unit: str
    meaning: str


QUANTITY = {
    # ---- the pose
    "theta": Quantity(
        "theta",
        "degrees",
        mark(
            "Angle between the line through the robot's last 40 px and the line through 40 px of the vessel's centerline beside "
            "the head. Positive: the robot points to the right of the vessel's direction, as seen on screen."
        ),
    ),
    "d_head": Quantity(
        "d_head",
        mark("working px"),
        mark(
            "Distance of the robot's head from the vessel's line. Working pixels: the picture scaled to 640 px along its longer "
            "side."
        ),
    ),
    "d_tail": Quantity(
        "d_tail",
        mark("working px"),
        mark(
            "Distance of the point 40 px behind the head from the same line. On the other side than the head: the robot has "
            "crossed."
        ),
    ),
    "crossed": Quantity(
        mark("crossed"),
        "",
        mark("Head and tail of the robot's line lie on opposite sides of the vessel's line: one of them is past it."),
    ),
    "state": Quantity(mark("Pose state"), "", "\n".join((*STATE_MEANING.values(), _WAY_DECIDES))),
    "confidence": Quantity(
        "confidence",
        mark("0 to 1"),
        mark(
            "Chance that the answer is right (theta within 5 degrees, head within 15 px), as learnt on pictures with known truth. "
            "Where it is low, the answer is shown as unsure, and its shape is not filled; where it is lower, there is a reason "
            "instead."
        ),
    ),
    # ---- the vessel and the way
    "clearance": Quantity(
        mark("Room"),
        mark("working px, about mm"),
        mark(
            "Between the edge of the robot's head and the wall of the vessel. The bar is full on the centerline and empty at the "
            "wall."
        ),
    ),
    "force": Quantity(
        mark("Wall force"), "N", mark("Sum of the contact forces of the robot on the vessel's wall. Known on the bench twin only.")
    ),
    "phantom": Quantity(
        mark("Phantom"), "", mark("The vessel phantom that the bench twin shows; another one starts the twin again.")
    ),
    "seed": Quantity(mark("Seed"), "", mark("Of the random phantom: the same seed gives the same phantom.")),
    # ---- advice and commands
    "advice": Quantity(
        mark("Advice"),
        mark("mm/s and degrees"),
        mark(
            "How fast to advance or retract, and how far to turn the head (right and left as seen on screen). Unless you hand "
            "over, you steer, and nothing is sent to the robot but what you ask for."
        ),
    ),
    "commands": Quantity(
        mark("Commands"),
        "",
        mark(
            "Four things kept apart: advised, asked by you, commanded by the program, and sent after the gate. Bend and pitch: "
            "share of the tendons' full pull; advised: the turn in degrees. \N{NOT EQUAL TO}: the gate sent something else than "
            "was asked."
        ),
    ),
    "capture_to_servo": Quantity(
        mark("Capture to servo"), "ms", mark("From the picture to the command made of it. It should stay below 100 ms.")
    ),
    "following": Quantity(mark("Following"), "%", mark("How far your motions of the last ten seconds agreed with the advice.")),
    "bend": Quantity(
        mark("bend"),
        mark("share of full pull"),
        mark("How far the head is bent, as the tendons are pulled: left and right of the middle."),
    ),
    "pitch": Quantity(
        mark("pitch"), mark("share of full pull"), mark("How far the head is bent out of the picture's plane: right is lifted.")
    ),
    "hand_speeds": Quantity(
        mark("Speeds by hand"),
        "mm/s",
        mark(
            "What a key makes while it is held, at the chosen share of full speed: way of the feed, of the sheath, and pull of the "
            "tendons' wires. A press of a tenth of a second makes about a tenth of that way."
        ),
    ),
    "insertion": Quantity(mark("in"), "mm", mark("How far the robot is in, by the feed's servo.")),
    "deadman": Quantity(
        mark("Deadman"),
        "",
        mark(
            "The program drives only while you hold this with the mouse, hold {deadman} or stand on the pedal. Let go and the "
            "robot holds. It must be pressed after arming: what was down before does not count."
        ),
    ),
    "tendon_balance": Quantity(
        mark("Tendon pair"),
        mark("mm and N"),
        mark(
            "Two wires that pull against each other: the sum of their pulls should be twice the pretension. Bar to the left: "
            "slack. Bar to the right: too tight. In N: tension of either wire as the motor's current tells it, friction included."
        ),
    ),
    # ---- pace
    "shown": Quantity(mark("shown/s"), "1/s", mark("Frames drawn on this screen per second.")),
    "engine": Quantity(mark("frames/s"), "1/s", mark("Frames perceived per second.")),
    "dropped": Quantity(
        mark("dropped"), mark("frames"), mark("The camera gave them, but nobody looked: a newer one was there already.")
    ),
    "gui_block": Quantity(mark("block"), "ms", mark("Longest time in the last 10 s in which this window could not react to you.")),
    "latency": Quantity(
        mark("Latency"),
        "ms",
        mark(
            "Time that each stage took for one frame, over the last seconds: half of the frames were quicker than p50, 95 % were "
            "quicker than p95."
        ),
    ),
    "trends": Quantity(
        mark("Last 30 seconds"),
        mark("degrees, px"),
        mark("Theta above, d_head and d_tail (dotted) below, and the state as a band. Gaps: no pose."),
    ),
    # ---- sessions and studies
    "timeline": Quantity(
        mark("Timeline"),
        "s",
        mark(
            "The whole session: states as a band, theta, gaps, and marks of alerts, steps, targets and notes. Click or drag "
            "goes there, the wheel zooms, Shift and drag selects."
        ),
    ),
    "lines_used": Quantity(
        mark("lines used"),
        mark("working px"),
        mark("Length of robot and vessel that the two lines are fitted to: less than 40 + 40 is less sure."),
    ),
}


def tip(*names: str) -> str:
    """A tool tip: "name (unit): meaning" of each quantity on lines that fit a screen. Raises KeyError for an unknown one."""
    return "\n".join(_paragraph(QUANTITY[name]) for name in names)


def _paragraph(quantity: Quantity) -> str:
    unit = f" ({tr(quantity.unit)})" if quantity.unit else ""
    if "\n" in quantity.meaning:  # a list of its own
        return "\n".join(tr(line) for line in quantity.meaning.splitlines())
    return _filled(f"{tr(quantity.name)}{unit}: {tr(quantity.meaning).format(deadman=DEADMAN_KEY)}")


def _filled(text: str) -> str:
    """On lines of a width that fits a screen. Chinese has no spaces to break at, and its letters are twice as wide."""
    if language_in_use() == ENGLISH:
        return textwrap.fill(text, _WIDTH)
    lines, room = [""], _WIDTH
    for part in re.findall(r"[!-~]+ ?|.", text):
        width = sum(1 if letter.isascii() else 2 for letter in part)
        if width > room and part not in _NEVER_FIRST:
            lines.append("")
            room = _WIDTH
        lines[-1] += part
        room -= width
    return "\n".join(lines)


def rig_line(rig: RigFile) -> str:
    """Camera, servos and calibration of a rig in one line."""
    camera = {
        "twin": tr("bench twin"),
        "realsense": f"RealSense {rig.camera.serial or ''}",
        "basler": f"Basler {rig.camera.serial or ''}",
        "webcam": tr("webcam {device}", device=rig.camera.device or ""),
    }
    servos = {"twin": tr("its own servos"), "servos": tr("servos on {port}", port=rig.servos.port), "none": tr("no servos")}
    parts = calibrated_parts(rig)
    return tr(
        "{camera}, {servos}; {calibrated}; made {made:%Y-%m-%d}",
        camera=camera.get(rig.kind, rig.kind).strip(),
        servos=servos[rig.robot],
        calibrated=tr("calibrated: {parts}", parts=", ".join(map(tr, parts))) if parts else tr("not calibrated"),
        made=rig.made_utc,
    )


def friction_note(servos: ServosConfig) -> str:
    """Which joints the gear's own friction may keep from moving; "" for none."""
    weak = ", ".join(f"{tr_text(joint.name)} {least_n:g} {joint.force_unit}" for joint, least_n in servos.weak_joints)
    if not weak:
        return ""
    return tr("The gear's friction may take it all: larger drums, or max_force_n of at least {forces}", forces=weak)


def joint_title(name: str) -> str:
    return tr_text(name).replace("_", " ")


def calibration_lines(rig: RigFile) -> list[str]:
    known = rig.calibration
    if known is None:
        return [tr("not calibrated")]
    lines = []
    if (lens := known.lens) is not None:
        lines.append(tr("lens: k1 {k1:+.4f}, k2 {k2:+.4f}, {left:.2f} px left over", k1=lens.k1, k2=lens.k2, left=lens.residual_px))
    if (scale := known.scale) is not None:
        text = mark("scale: {scale:.4f} mm/px in the middle, \N{PLUS-MINUS SIGN}{share:.2f} % (by {method})")
        share, method = 100 * scale.uncertainty_share, tr_text(scale.method)
        lines.append(tr(text, scale=scale.mm_per_px, share=share, method=method))
    servos = ", ".join(f"{tr_text(joint.name)} {'+' if joint.sign > 0 else '-'}{joint.id}" for joint in rig.servos.joints)
    lines.append(tr("servos (direction and id): {servos}", servos=servos))
    in_mm = [joint for joint in rig.servos.joints if joint.unit == "mm"]
    ways = ", ".join(f"{tr_text(joint.name)} {joint.mm_per_turn:g}" for joint in in_mm)
    if known.drums is not None and known.drums.fit(rig.servos):
        lines.append(tr("way at one turn of the horn, by the diameters measured: {ways} mm", ways=ways))
    else:
        lines.append(tr("way at one turn of the horn, as it is set and not measured: {ways} mm", ways=ways))
    forces = ", ".join(f"{tr_text(joint.name)} {rig.servos.force_limit(joint).force_n:.0f}" for joint in in_mm)
    if rig.servos.driver in LIMITS_FORCE:
        lines.append(tr("greatest force, limited in the servo, friction included: {forces} N", forces=forces))
    else:
        lines.append(tr("this drive cannot limit its force"))
    if weak := friction_note(rig.servos):
        lines.append(weak)
    rotation = rig.servos.names[rig.servos.places(JointKind.ROTATION)]
    if assumed := [name for name in known.assumed or () if name not in rotation]:
        lines.append(
            tr(
                "assumed: {joints} by the order of their ids, since one camera cannot tell them apart; look at the head, and swap "
                "them in the rig wizard if it goes the other way",
                joints=tr(" and ").join(tr_text(name) for name in assumed),
            )
        )
    if set(rotation) & set(known.assumed or ()):
        lines.append(tr("assumed: the direction of the rotation, which one camera cannot see; confirm it in the rig wizard"))
    if known.steering is not None:
        ways = ", ".join(
            f"{tr_text(tendon.name)} {tr('out of the picture') if tendon.direction_deg is None else f'{tendon.direction_deg:.0f}°'}"
            for tendon in known.steering.tendons
        )
        roll = known.steering.roll_deg
        lines.append(tr("steering, 0° to the right and 90° down in the picture: {ways}; roll {roll:+.0f}°", ways=ways, roll=roll))
        if known.steering.turn_deg_per_mm is not None:
            lines.append(tr("turn of the head: {turn:.0f}° per mm of pull", turn=known.steering.turn_deg_per_mm))
    if known.zero is not None:
        slack = ", ".join(f"{value:+.2f}" for value in known.zero.slack_mm)
        tight = known.zero.pretension_mm
        lines.append(tr("zero: wires were slack by {slack} mm; pretension {pretension:g} mm", slack=slack, pretension=tight))
    return lines


_CALIBRATED = (mark("lens"), mark("scale"), mark("steering"), mark("zero"))


def calibrated_parts(rig: RigFile) -> list[str]:
    """The names of the parts of a rig that are calibrated, in English."""
    return [part for part in _CALIBRATED if rig.calibration is not None and getattr(rig.calibration, part) is not None]
