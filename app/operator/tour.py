"""What the tour of the operator window points at, and what it says there."""

from __future__ import annotations

from app.operator.panels import OperatorPanels
from app.ui.actions import key_name
from app.ui.i18n import tr
from app.ui.texts import DEADMAN_KEY, STOP_KEY, OperatorStep
from app.widgets.jog_panel import KEYS, Motion
from app.widgets.tour_overlay import TourStop


def operator_stops(panels: OperatorPanels, *, has_robot: bool) -> tuple[TourStop, ...]:
    """The stops of a window; without a robot nothing is said of moving it."""
    watching = (
        TourStop(
            tr("The picture"),
            tr(
                "The robot comes in from the edge. The white ring is its head, the yellow arrow its direction, the blue line the "
                "vessel's centerline. Click into a branch: that is your target, Esc clears it. 1 to 9 and G switch what is "
                "drawn."
            ),
            (panels.live,),
        ),
        TourStop(
            tr("How the head lies in the vessel"),
            tr(
                "A on course, B coming back to the centerline, C moving away from it, D crossed; the numbers that decided it stand "
                "beside it. Rest the mouse on a dial: it says what it means. When the program cannot tell, there is no letter "
                "but a reason."
            ),
            (panels.badge, panels.gauge, panels.bars),
        ),
        TourStop(
            tr("What to do next"),
            tr(
                "How fast to advance and how far to turn, and why. It only advises: you steer. The purple ghost in the picture "
                "shows where the advice leads."
            ),
            (panels.advice,),
        ),
    )
    keeping = (
        TourStop(
            tr("Keep it"),
            tr(
                "F9 records a session: every picture and all that was understood, advised, asked and sent. M marks a moment, F10 "
                "keeps the last seconds without a recording, P a snapshot. F1 shows all keys; Help, Tour shows this again."
            ),
            (panels.record_bar,),
        ),
    )
    return (*watching, *(_moving_stops(panels) if has_robot else ()), *keeping)


def _moving_stops(panels: OperatorPanels) -> tuple[TourStop, ...]:
    keys = {motion: tr(" or ").join(key_name(key) for key in KEYS[motion]) for motion in Motion}
    arm, hand_over, take_back = (step.value.key for step in (OperatorStep.ARM, OperatorStep.HAND_OVER, OperatorStep.TAKE_BACK))
    return (
        TourStop(
            tr("Move it yourself"),
            tr(
                "Hold {advance}: the robot advances. {left} and {right} bend its head, {retract} retracts it, {straighten} "
                "straightens it. Let go and it stops. Try it: the tour waits.",
                advance=keys[Motion.ADVANCE],
                left=keys[Motion.STEER_LEFT],
                right=keys[Motion.STEER_RIGHT],
                retract=keys[Motion.RETRACT],
                straighten=keys[Motion.STRAIGHTEN],
            ),
            (panels.jog,),
        ),
        TourStop(
            tr("Let the program drive"),
            tr(
                "{arm} arms it; then hold {deadman}, the deadman, and press {hand_over}. Let go, and the robot holds. Any key that "
                "moves takes back at once, so does {take_back}. This bar always names the next step, and why it would be refused.",
                arm=arm,
                deadman=DEADMAN_KEY,
                hand_over=hand_over,
                take_back=take_back,
            ),
            (panels.mode_bar,),
        ),
        TourStop(
            tr("STOP"),
            tr(
                "{stop} stops the robot, wherever you are in this program; so does this button, now as well. To go on: "
                "{acknowledge} acknowledges, {servos_on} switches the servos on. It is no emergency stop: that is the power cut "
                "beside the robot.",
                stop=STOP_KEY,
                acknowledge=OperatorStep.ACKNOWLEDGE.value.key,
                servos_on=OperatorStep.SERVOS_ON.value.key,
            ),
            (panels.mode_bar.stop,),
        ),
    )
