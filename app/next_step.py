"""What the operator may do next, and why it would be refused. Words and keys only, no widgets."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from app.language import mark, tr, tr_text
from core.control.alerts import ALERTS, AlertKey
from core.control.drive_view import DriveView
from core.control.faults import AREA, REACTION, Area, Cause, Fault, Reaction
from core.control.gate_checks import Source
from core.control.modes import Mode

DEADMAN_KEY = "Shift"
STOP_KEY = "Space"


@dataclass(frozen=True, slots=True)
class StepWords:
    """Name on the button, its key, and what it does."""

    name: str
    key: str
    meaning: str


class Step(Enum):
    """A request of the operator that has a button. STOP is no step: it is always there."""

    SERVOS_ON = StepWords(
        mark("Servos on"), "F3", mark("Check all servos and switch their torque on: then you can move the robot by hand")
    )
    ACKNOWLEDGE = StepWords(mark("Acknowledge"), "F4", mark("I have read why the program stopped; nothing moves by this"))
    ARM = StepWords(mark("Arm"), "F6", mark("Allow the program to be handed over to; nothing moves by this"))
    HAND_OVER = StepWords(mark("Hand over"), "F7", mark("The program drives to the destination for as long as the deadman is held"))
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
    """

    step: Step
    granted: bool
    headline: str
    rest: str
    reasons: tuple[AlertKey, ...] = ()
    other: Step | None = None

    @property
    def text(self) -> str:
        """The one line."""
        more = tr(" (+{count} more)", count=len(self.reasons) - 1) if len(self.reasons) > 1 else ""
        return f"{sentence(self.headline)} {sentence(self.rest)}{more}".strip()

    @property
    def all_reasons(self) -> str:
        """Every reason on a line of its own."""
        return "\n".join(f"{sentence(ALERTS[key].text)} {sentence(ALERTS[key].what_to_do)}" for key in self.reasons)


NO_ROBOT = NextStep(Step.SERVOS_ON, False, mark("This rig has no robot"), mark("pictures and advice only"))
NOT_YET = NextStep(Step.SERVOS_ON, False, mark("Waiting for the rig"), "")
CLOSED = NextStep(Step.SERVOS_ON, False, mark("No rig is open"), mark("F5 opens it again"))


class Undriven(Enum):
    """Why there is no view of driving: what the badge says, and the step."""

    NO_ROBOT = (mark("pictures only"), NO_ROBOT)
    NOT_YET = (mark("waiting for the rig"), NOT_YET)
    """It is being opened: nobody knows yet whether there will be something to drive."""
    CLOSED = (mark("no rig is open"), CLOSED)
    """It stopped, and nobody opens it by himself."""

    @property
    def who(self) -> str:
        return self.value[0]

    @property
    def step(self) -> NextStep:
        return self.value[1]


def who_drives(view: DriveView | None, why_not: Undriven = Undriven.NO_ROBOT) -> str:
    """In few words, for the badge; `why_not` says it where there is no view."""
    if view is None:
        return tr(why_not.who)
    if view.mode is Mode.HOLD:
        return tr("interrupted")
    if view.mode is Mode.STOPPED:
        return tr("nothing moves")
    if view.permitted is Source.PROGRAM:
        return tr("the program drives")
    if view.permitted is Source.OPERATOR:
        return tr("you steer")
    return tr("nothing moves") if view.servos_on or view.latched is not None else tr("servos follow nobody")


def next_step(view: DriveView) -> NextStep:
    """The next sensible step of the operator."""
    if view.latched is not None or view.mode is Mode.STOPPED:
        return _acknowledge(view)
    if view.mode is Mode.AUTONOMOUS:
        rest = tr("let go and it holds; move the controls or press {key} to steer yourself", key=Step.TAKE_BACK.value.key)
        return NextStep(Step.TAKE_BACK, True, tr("The program drives"), rest, other=Step.DISARM)
    if view.mode is Mode.HOLD:
        return _interrupted(view)
    if view.busy:
        return NextStep(Step.SERVOS_ON, False, sentence(view.busy).rstrip(".。"), tr("this takes a moment"))
    if not view.servos_on:
        faults = tuple(fault.cause for fault in view.active if AREA[fault.cause] is Area.SERVOS and _holds(fault))
        rest = tr("press {key}: they are checked with the torque off, then tighten the wires", key=Step.SERVOS_ON.value.key)
        if faults:
            step = _refused(Step.SERVOS_ON, faults)
            # What it is that is not as configured the servos' process has said, and what to do depends on it.
            said = next((fault.detail for fault in view.active if fault.cause is Cause.SERVOS_WRONG), "")
            return replace(step, rest=said) if said and faults[0] is Cause.SERVOS_WRONG else step
        return NextStep(Step.SERVOS_ON, True, tr("The servos follow nobody, but may still pull"), rest)
    if view.mode is Mode.ARMED:
        return _hand_over(view)
    if view.against_arming:
        return _refused(Step.ARM, view.against_arming)
    return NextStep(
        Step.ARM, True, tr("You steer"), tr("press {key} to arm; then you can hand over to the program", key=Step.ARM.value.key)
    )


def sentence(text: str) -> str:
    """`text` with a capital letter and a full stop; empty stays empty."""
    shown = tr_text(text)
    return tr("{sentence}.", sentence=f"{shown[0].upper()}{shown[1:]}") if shown else ""


def _holds(fault: Fault) -> bool:
    return REACTION[fault.cause] >= Reaction.HOLD


def _refused(step: Step, reasons: tuple[AlertKey, ...], other: Step | None = None) -> NextStep:
    first = ALERTS[reasons[0]]
    # servos that are in trouble can still be checked: that is the way out
    return NextStep(step, step is Step.SERVOS_ON, first.text, first.what_to_do, reasons, other)


def _acknowledge(view: DriveView) -> NextStep:
    if view.latched is None:
        return NextStep(
            Step.ACKNOWLEDGE, True, tr("Stopped"), tr("press {key}, then switch the servos on", key=Step.ACKNOWLEDGE.value.key)
        )
    cause = view.latched.cause
    # a fault of servos in use that is still there latches again at once
    remains = view.servos_on and AREA[cause] is Area.SERVOS and any(fault.cause is cause for fault in view.active)
    return NextStep(Step.ACKNOWLEDGE, not remains, ALERTS[cause].text, ALERTS[cause].what_to_do, (cause,))


def _hand_over(view: DriveView) -> NextStep:
    if view.against_hand_over:
        return _refused(Step.HAND_OVER, view.against_hand_over, Step.DISARM)
    key = Step.HAND_OVER.value.key
    held, loose = (
        tr("press {key}: the program drives while you hold", key=key),
        tr("hold {deadman}, then press {key} to hand over", deadman=DEADMAN_KEY, key=key),
    )
    return NextStep(Step.HAND_OVER, True, tr("Ready"), held if view.deadman else loose, other=Step.DISARM)


def _interrupted(view: DriveView) -> NextStep:
    causes = tuple(fault.cause for fault in view.active if _holds(fault))
    back, again = Step.TAKE_BACK.value.key, Step.HAND_OVER.value.key
    if causes:
        first = ALERTS[causes[0]]
        return NextStep(Step.TAKE_BACK, True, first.text, first.what_to_do, causes, Step.DISARM)
    rest = tr("hold {deadman} and press {again} to go on, or {back} to take back", deadman=DEADMAN_KEY, again=again, back=back)
    return NextStep(Step.TAKE_BACK, True, tr("Interrupted"), rest, other=Step.DISARM)
