"""What the tour of the operator window points at, and what it says there."""

from __future__ import annotations

from app.jog_keys import KEYS, Motion
from app.key_sheet import key_name
from app.next_step import DEADMAN_KEY, STOP_KEY, Step
from app.operator_panels import OperatorPanels
from app.widgets.tour_overlay import TourStop


def operator_stops(panels: OperatorPanels, *, has_robot: bool) -> tuple[TourStop, ...]:
    """The stops of a window; without a robot nothing is said of moving it."""
    keys = {motion: " or ".join(key_name(key) for key in KEYS[motion]) for motion in Motion}
    arm, hand_over, take_back = (step.value.key for step in (Step.ARM, Step.HAND_OVER, Step.TAKE_BACK))
    watching = (
        TourStop(
            "The picture",
            "The robot comes in from the edge. The white ring is its head, the yellow arrow its direction, the blue line the "
            "vessel's centerline. Click into a branch: that is your destination, Esc clears it. 1 to 9 and G switch what is drawn.",
            (panels.live,),
        ),
        TourStop(
            "How the head lies in the vessel",
            "A on course, B coming back to the centerline, C moving away from it, D crossed; the numbers that decided it stand "
            "beside it. Rest the mouse on a dial: it says what it means. When the program cannot tell, there is no letter but a "
            "reason.",
            (panels.badge, panels.gauge, panels.bars),
        ),
        TourStop(
            "What to do next",
            "How fast to advance and how far to turn, and why. It only advises: you steer. The purple ghost in the picture shows "
            "where the advice leads.",
            (panels.advice,),
        ),
    )
    moving = (
        TourStop(
            "Move it yourself",
            f"Hold {keys[Motion.ADVANCE]}: the robot advances. {keys[Motion.STEER_LEFT]} and {keys[Motion.STEER_RIGHT]} bend its "
            f"head, {keys[Motion.RETRACT]} retracts it, {keys[Motion.STRAIGHTEN]} straightens it. Let go and it stops. Try it: the "
            "tour waits.",
            (panels.jog,),
        ),
        TourStop(
            "Let the program drive",
            f"{arm} arms it; then hold {DEADMAN_KEY}, the deadman, and press {hand_over}. Let go, and the robot holds. Any key "
            f"that moves takes back at once, so does {take_back}. This bar always names the next step, and why it would be "
            "refused.",
            (panels.mode_bar,),
        ),
        TourStop(
            "STOP",
            f"{STOP_KEY} stops the robot, wherever you are in this program; so does this button, now as well. To go on: "
            f"{Step.ACKNOWLEDGE.value.key} acknowledges, {Step.SERVOS_ON.value.key} switches the servos on. It is no emergency "
            "stop: that is the power cut beside the robot.",
            (panels.mode_bar.stop,),
        ),
    )
    keeping = (
        TourStop(
            "Keep it",
            "F9 records a session: every picture and all that was understood, advised, asked and sent. F10 keeps the last seconds "
            "without a recording, P a snapshot. F1 shows all keys; Help, Tour shows this again.",
            (panels.record_bar,),
        ),
    )
    return (*watching, *(moving if has_robot else ()), *keeping)
