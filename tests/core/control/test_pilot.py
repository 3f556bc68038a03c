"""The pilot: which source drives, from where, and what it reports."""

import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from core.config.models import Config
from core.config.safety import SafetyConfig
from core.control.alerts import Note
from core.control.faults import Cause, Fault
from core.control.gate import Rejection, RejectReason, Source
from core.control.health import ModelReport
from core.control.joints import Retracted
from core.control.modes import Act, Hindrance, Mode
from core.control.motion import AT_REST, Jog
from core.control.pilot import KEYBOARD, PERIOD_S, LeftOver, Pilot, PilotLoop
from core.control.policies import make_policy
from core.control.readiness import Readiness
from core.system import slept_s
from core.types import Advice, Frame, Points, Reason, Refusal, Route, Scene, Speed
from tests.core.pilot_bench import ADVICE, WELL, Bench, Policy, Robot, scene_at


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.pilot.close()


@pytest.fixture
def strict() -> Iterator[Callable[..., Bench]]:
    """Benches with tightened thresholds."""
    made: list[Bench] = []

    def make(**safety: float) -> Bench:
        made.append(Bench(Config(safety=SafetyConfig.model_validate(safety))))
        return made[-1]

    yield make
    for bench in made:
        bench.pilot.close()


def test_nothing_is_sent_before_the_servos_were_switched_on(bench: Bench) -> None:
    bench.jog = Jog(bend=1.0, advance=1.0)
    bench.seconds(0.5)
    assert bench.robot.sent == []
    assert not bench.pilot.view.servos_on
    assert Hindrance.SERVOS_UNCHECKED in bench.alerts(), "a key that does nothing says why"


def test_switching_on_checks_the_servos_and_gives_the_operator_the_hand(bench: Bench) -> None:
    bench.on()
    assert bench.robot.calls == ["disarm", "acknowledge", "arm"]
    assert bench.pilot.view.servos_on
    assert bench.pilot.view.permitted is Source.OPERATOR
    assert bench.pilot.view.against_arming == ()


def test_it_is_certain_that_nothing_moves_only_while_the_servos_are_off(bench: Bench) -> None:
    bench.seconds(0.1)
    assert not bench.pilot.can_move
    bench.pilot.switch_on()
    assert bench.pilot.can_move, "from the request on, before any turn has seen it"
    bench.seconds(2.0)
    assert bench.pilot.view.servos_on
    assert bench.pilot.can_move
    bench.pilot.stop()
    bench.seconds(2.0)
    assert bench.pilot.view.mode is Mode.STOPPED
    assert bench.pilot.can_move, "STOP can be said again"
    bench.pilot.ask(Act.ACKNOWLEDGE)
    bench.seconds(0.1)
    assert bench.pilot.can_move, "the servos may still be at it"
    bench.seconds(2.0)
    assert not bench.pilot.can_move


def test_servos_that_are_not_in_order_are_named(bench: Bench) -> None:
    bench.robot.problem = "servo 3 is an XL430, not an XM430-W350"
    bench.on()
    assert not bench.pilot.view.servos_on
    assert Cause.SERVOS_WRONG in bench.pilot.view.against_arming
    details = [alert.detail for alert in bench.pilot.news().alerts if alert.key is Cause.SERVOS_WRONG]
    assert details == [bench.robot.problem]


def test_held_keys_are_rates_of_bend_and_speeds_of_feed(bench: Bench) -> None:
    bench.on().jog = Jog(bend=0.5, advance=-1.0)
    bench.seconds(0.5)
    source, command, captured_s = bench.robot.sent[-1]
    assert (source, captured_s) == (Source.OPERATOR, None)
    assert command.bend == pytest.approx(0.5 * 0.5 * 1.2, abs=0.02)
    assert command.advance_mm_s == -10.0
    bench.jog = AT_REST
    bench.pilot.jog("keys", AT_REST)
    bench.turn()
    rest = bench.robot.sent[-1][1]
    assert (rest.bend, rest.advance_mm_s) == (command.bend, 0.0)


def test_a_share_of_full_speed_holds_for_all_controls_together(bench: Bench) -> None:
    bench.pilot.hand_speed(0.2)
    bench.on().jog = Jog(bend=1.0, advance=1.0, delivery=-1.0)
    for _ in range(25):
        bench.pilot.jog("pad", Jog(bend=1.0, advance=1.0))
        bench.turn()
    bent = bench.robot.sent[-1][1]
    assert bent.bend == pytest.approx(0.2 * 0.5 * 1.2, abs=0.01)
    assert (bent.advance_mm_s, bent.delivery_mm_s) == (2.0, -2.0)
    bench.jog = Jog(straighten=True)
    bench.pilot.jog("pad", AT_REST)
    bench.turn()
    assert bent.bend - bench.robot.sent[-1][1].bend == pytest.approx(0.2 * 1.2 * PERIOD_S)


def test_a_window_that_says_no_more_lets_go(bench: Bench) -> None:
    bench.on().jog = Jog(advance=1.0)
    bench.seconds(0.2)
    assert bench.robot.sent[-1][1].advance_mm_s == 10.0
    bench.jog = AT_REST  # nothing is reported any more, as by a window that hangs
    bench.seconds(0.14)
    assert bench.robot.sent[-1][1].advance_mm_s == 0.0


def test_arming_and_handing_over_lets_the_program_drive_from_where_the_robot_is(bench: Bench) -> None:
    bench.on().jog = Jog(bend=1.0, pitch=1.0)
    bench.seconds(0.3)
    bench.jog = AT_REST
    bench.seconds(0.4)
    bend, pitch = bench.robot.sent[-1][1].bend, bench.robot.sent[-1][1].pitch
    assert bend > 0.2
    assert pitch > 0.2
    bench.pilot.ask(Act.ARM)
    bench.turn().held = True
    bench.turn(2).pilot.ask(Act.HAND_OVER)
    bench.turn()
    assert bench.mode is Mode.AUTONOMOUS
    source, command, captured_s = bench.robot.sent[-1]
    assert source is Source.PROGRAM
    assert command.bend == bend, "the first command moves nothing"
    assert captured_s is not None
    bench.turn(5)
    assert bench.robot.sent[-1][1].bend > bend, "the advice is to the right"
    assert bench.robot.sent[-1][1].pitch == pitch
    assert bench.policy.resets == 1
    assert bench.pilot.view.latency_s == pytest.approx(0.08)
    assert bench.pilot.view.program_command == bench.robot.sent[-1][1]


def test_the_operators_touch_takes_back_in_the_same_turn_and_from_where_the_program_left(bench: Bench) -> None:
    bench.handed_over().turn(10)
    bend = bench.robot.sent[-1][1].bend
    bench.jog = Jog(advance=1.0)
    bench.turn()
    assert bench.mode is Mode.ARMED
    source, command, _ = bench.robot.sent[-1]
    assert source is Source.OPERATOR
    assert command.bend == pytest.approx(bend)


def test_a_touch_shorter_than_a_turn_counts(bench: Bench) -> None:
    bench.handed_over()
    bench.pilot.jog("pad", Jog(bend=0.1))
    bench.pilot.jog("pad", AT_REST)
    bench.turn()
    assert bench.mode is Mode.ARMED


def test_letting_the_deadman_go_holds(bench: Bench) -> None:
    bench.handed_over().turn(3)
    bench.held = False
    bench.turn()
    assert bench.mode is Mode.HOLD
    assert bench.robot.permitted is None
    count = len(bench.robot.sent)
    bench.turn(3)
    assert len(bench.robot.sent) == count


def test_a_policy_remembers_through_a_hold_and_forgets_at_the_next_hand_over(bench: Bench) -> None:
    """Else a branch that it misses again and again would be new to it after every short hold."""
    bench.handed_over().turn(3)
    assert bench.policy.resets == 1
    bench.held = False
    bench.turn(2)
    assert bench.mode is Mode.HOLD
    bench.held = True
    bench.seconds(0.5)
    assert bench.mode is Mode.AUTONOMOUS
    assert bench.robot.permitted is Source.PROGRAM
    assert bench.policy.resets == 1
    bench.pilot.ask(Act.TAKE_BACK)
    bench.turn(2).pilot.ask(Act.HAND_OVER)
    bench.turn(2)
    assert bench.mode is Mode.AUTONOMOUS
    assert bench.policy.resets == 2


def test_a_policy_forgets_when_it_is_handed_over_to_out_of_a_hold_that_has_expired(bench: Bench) -> None:
    """Another hand-over is another try: a policy that has given up would else give up at once."""
    bench.handed_over().turn(3)
    bench.held = False
    bench.seconds(2.0)
    assert bench.mode is Mode.HOLD
    bench.held = True
    bench.turn(2).pilot.ask(Act.HAND_OVER)
    bench.turn(3)
    assert bench.mode is Mode.AUTONOMOUS
    assert bench.policy.resets == 2
    bench.pilot.ask(Act.HAND_OVER)  # refused: it drives already
    bench.turn(3)
    assert bench.policy.resets == 2


def test_where_the_keyboard_is_no_deadman_it_hands_over_beside_a_pedal_only() -> None:
    bench = Bench(readiness=Readiness(keyboard_deadman=False)).armed()

    def turn(*, key: bool, pedal: bool) -> None:
        bench.pilot.deadman(KEYBOARD, key)
        bench.pilot.deadman("pedal", pedal)
        bench.turn()

    turn(key=False, pedal=False)
    turn(key=True, pedal=False)
    assert bench.pilot.view.deadman is True
    assert not bench.pilot.view.keyboard_deadman
    bench.pilot.ask(Act.HAND_OVER)
    turn(key=True, pedal=False)
    assert (bench.mode, bench.alerts()) == (Mode.ARMED, {Hindrance.DEADMAN_ON_KEYBOARD})
    turn(key=True, pedal=True)
    bench.pilot.ask(Act.HAND_OVER)
    turn(key=True, pedal=True)
    assert bench.mode is Mode.AUTONOMOUS
    turn(key=True, pedal=False)
    assert bench.mode is Mode.HOLD
    bench.pilot.close()


def test_stop_goes_to_the_robot_at_once_and_stays(bench: Bench) -> None:
    bench.handed_over()
    bench.pilot.stop()
    assert bench.robot.calls[-1] == "stop", "not in the next turn"
    bench.turn()
    assert bench.mode is Mode.STOPPED
    assert bench.alerts() >= {Cause.STOP_PRESSED}
    bench.pilot.ask(Act.ARM)
    bench.turn()
    assert bench.mode is Mode.STOPPED
    bench.pilot.ask(Act.ACKNOWLEDGE)
    bench.done().turn()
    assert bench.mode is Mode.ADVISORY
    assert not bench.pilot.view.servos_on
    assert "acknowledge" in bench.robot.calls[-1]


def test_faults_of_the_servos_stop_them_too(bench: Bench) -> None:
    bench.armed()
    bench.robot.bus = replace(WELL, hardware_errors=(0, 0, 32, 0, 0, 0, 0))
    bench.turn()
    assert bench.mode is Mode.STOPPED
    assert bench.robot.calls[-1] == "stop"
    assert bench.latched is Cause.SERVO_ALERT


def test_a_bus_process_that_is_gone_is_started_again_by_switching_on(bench: Bench) -> None:
    bench.on()
    bench.robot.failure = "the servo bus process ended (killed by SIGKILL)"
    bench.turn(2)
    assert not bench.pilot.view.servos_on
    assert bench.pilot.view.latched is not None
    bench.pilot.ask(Act.ACKNOWLEDGE)
    bench.done().turn(2)
    bench.pilot.switch_on()
    bench.done().turn(2)
    assert "connect" in bench.robot.calls
    assert bench.pilot.view.servos_on


def test_no_advice_is_shown_while_a_fault_blanks_it(bench: Bench) -> None:
    bench.on()
    assert bench.shown is ADVICE
    assert bench.pilot.view.advice is ADVICE
    bench.scene = lambda scene: replace(scene, pose=None, refusal=Refusal(Reason.SEVERAL_ROBOTS), route=None)
    bench.turn(4)
    assert bench.shown is None
    assert bench.pilot.view.advice is None
    assert bench.pilot.view.blanked == Cause.SEVERAL_ROBOTS.value
    assert bench.alerts() == set(), "in ADVISORY the screen says it, and nothing beeps"


def test_the_frame_that_ends_a_silence_brings_its_advice(bench: Bench) -> None:
    bench.on().seeing = False
    bench.seconds(0.2)
    assert bench.pilot.view.blanked == Cause.CAMERA_SILENT.value
    bench.shown, bench.seeing = None, True
    bench.turn(2)
    assert bench.shown is ADVICE


def test_at_the_target_the_operator_has_the_hand_again(bench: Bench) -> None:
    bench.handed_over()
    bench.scene = lambda scene: scene_at(scene.frame_index, scene.captured_s, left_px=5.0)
    bench.seconds(0.8)
    assert bench.mode is Mode.ARMED
    assert Note.REACHED in bench.alerts()


def test_a_hand_over_without_a_way_is_refused_with_its_reason(bench: Bench) -> None:
    bench.scene = lambda scene: replace(scene, route=None)
    bench.armed().held = True
    assert bench.pilot.view.against_hand_over == (Hindrance.NO_TARGET,)
    bench.turn(2).pilot.ask(Act.HAND_OVER)
    bench.turn()
    assert bench.mode is Mode.ARMED
    assert Hindrance.NO_TARGET in bench.alerts()


def test_commands_that_the_gate_rejects_again_and_again_end_autonomy(bench: Bench) -> None:
    bench.handed_over()
    bench.robot.edit = lambda sent: replace(sent, source=None, rejection=RejectReason.OVER_RATE)
    bench.turn(2)
    assert bench.mode is Mode.HOLD
    bench.seconds(0.4)
    assert bench.mode is Mode.ADVISORY
    assert bench.latched is Cause.COMMANDS_REJECTED


def test_a_joint_at_its_end_is_told_to_him_who_drives_it(bench: Bench) -> None:
    bench.on().jog = Jog(advance=1.0)
    bench.robot.edit = lambda sent: replace(sent, at_end=("advance",))
    bench.turn(4)
    assert [alert.detail for alert in bench.pilot.news().alerts if alert.key is Note.AT_END] == ["advance"]


def test_a_feed_at_its_end_is_told_when_the_program_drives_and_a_tendon_is_not(bench: Bench) -> None:
    bench.handed_over()
    for at_end, told in ((("right",), []), (("right", "advance"), ["advance"])):
        bench.robot.edit = lambda sent, at_end=at_end: replace(sent, at_end=at_end)
        bench.turn(4)
        assert [alert.detail for alert in bench.pilot.news().alerts if alert.key is Note.AT_END] == told


def test_following_the_advice_is_measured(bench: Bench) -> None:
    bench.on().jog = Jog(bend=0.5, advance=0.5)
    assert bench.seconds(1.0).pilot.view.follow_share == 1.0
    bench.jog = Jog(bend=-0.5, advance=-0.5)
    assert 0.0 < (bench.seconds(1.0).pilot.view.follow_share or 0.0) < 1.0


def test_servos_that_the_bus_process_disarmed_by_itself_are_off_with_its_reason(bench: Bench) -> None:
    bench.handed_over()
    bench.robot.bus = replace(WELL, armed=False, ended=Fault(Cause.TRACKING, "advance pushes against something"))
    bench.turn(4)
    assert bench.mode is Mode.STOPPED
    assert not bench.pilot.view.servos_on
    assert bench.pilot.view.latched == Fault(Cause.TRACKING, "advance pushes against something")
    assert Cause.TRACKING in bench.alerts()


def test_a_bus_process_that_missed_the_program_is_a_watchdog(bench: Bench) -> None:
    bench.on()
    bench.robot.bus = replace(WELL, armed=False, ended=Fault(Cause.HEARTBEAT_LOST, "no heartbeat"))
    bench.turn(4)
    assert not bench.pilot.view.servos_on
    assert bench.pilot.view.latched == Fault(Cause.WATCHDOG, "worker stopped, no heartbeat")


def test_one_report_from_before_arming_is_no_fault(bench: Bench) -> None:
    bench.on().robot.bus = replace(WELL, armed=False)
    bench.turn(2)
    bench.robot.bus = WELL
    bench.turn(5)
    assert bench.pilot.view.servos_on
    assert bench.pilot.view.latched is None


def test_an_unsure_pose_is_not_followed_and_the_next_sure_one_goes_on(bench: Bench) -> None:
    bench.handed_over().turn(20)
    assert bench.robot.sent[-1][1].advance_mm_s > 0.0
    bench.scene = lambda scene: replace(scene, pose=replace(scene.pose, confidence=0.49))
    bench.turn(4)
    bend = bench.robot.sent[-1][1].bend
    bench.turn(2)
    assert bench.mode is Mode.AUTONOMOUS
    assert (bench.robot.sent[-1][1].advance_mm_s, bench.robot.sent[-1][1].bend) == (0.0, bend)
    assert (bench.shown, bench.pilot.view.advice, bench.pilot.view.blanked) == (None, None, Cause.CONFIDENCE_LOW.value)
    bench.scene = lambda scene: scene
    bench.turn(10)
    assert bench.shown is ADVICE
    assert bench.robot.sent[-1][1].advance_mm_s > 0.0
    bench.scene = lambda scene: replace(scene, pose=replace(scene.pose, confidence=0.49))
    bench.seconds(0.3)
    assert bench.mode is Mode.HOLD
    assert Cause.CONFIDENCE_LOW in {fault.cause for fault in bench.pilot.view.active}


def test_advice_that_is_no_number_is_neither_driven_nor_shown(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.handed_over()
    bend = bench.robot.sent[-1][1].bend
    broken = Advice(Speed.SLOW, 2.0, math.nan, "broken")
    monkeypatch.setattr(Policy, "__call__", lambda *_, **__: broken)
    bench.turn(2)
    assert bench.mode is Mode.HOLD
    assert bench.shown is None
    bench.turn(20)
    assert bench.mode is Mode.ADVISORY
    assert bench.latched is Cause.NOT_FINITE_REPEATED
    assert abs(bench.robot.motion.motion.bend - bend) < 0.1


def test_a_deadman_held_since_before_arming_does_not_count_after_a_hiccup_either(bench: Bench) -> None:
    bench.on().held = True
    bench.turn(3).pilot.ask(Act.ARM)
    bench.turn()
    for _ in range(6):  # 120 ms in which the window says nothing
        bench.now_s += PERIOD_S
        bench.pilot.window_alive()
        bench.pilot.tick()
    bench.turn(2).pilot.ask(Act.HAND_OVER)
    bench.turn()
    assert bench.mode is Mode.ARMED
    assert Hindrance.DEADMAN_HELD_BEFORE in bench.alerts()


@pytest.mark.parametrize("what", ["damaged", "damaged for long", "late", "beside a tap of the key", "late beside a tap of the key"])
def test_a_pedal_that_is_stuck_since_before_arming_never_counts(bench: Bench, what: str) -> None:
    def turn(pedal: bool | None, count: int = 1) -> None:
        for _ in range(count):
            bench.pilot.deadman("pedal", pedal)
            bench.turn()

    turn(False)
    bench.on()
    turn(True, 3)
    bench.pilot.ask(Act.ARM)
    turn(True)
    if "key" in what:
        bench.held = True
        turn(True, 3)
        bench.held = False
    if "late" in what:
        bench.turn()
    if "damaged" in what:
        turn(None, 40 if "long" in what else 1)
    turn(True, 3)
    bench.pilot.ask(Act.HAND_OVER)
    turn(True, 3)
    assert bench.mode is Mode.ARMED
    assert Hindrance.DEADMAN_HELD_BEFORE in bench.alerts()
    assert bench.pilot.view.deadman is True  # what it says, which is another question
    turn(False)
    turn(True, 2)
    bench.pilot.ask(Act.HAND_OVER)
    turn(True)
    assert bench.mode is Mode.AUTONOMOUS


def test_a_hold_that_never_clears_itself_takes_no_press_away(strict: Callable[..., Bench]) -> None:
    bench = strict(hold_clear_s=0.0, deadman_timeout_s=0.05)
    bench.handed_over()
    assert bench.seconds(0.5).mode is Mode.AUTONOMOUS
    bench.held = False
    bench.turn()
    bench.held = True
    assert bench.seconds(0.5).mode is Mode.HOLD  # which is what was asked for
    bench.pilot.ask(Act.HAND_OVER)
    assert bench.turn().mode is Mode.AUTONOMOUS


@pytest.mark.parametrize("phase_s", [0.0, 0.007, 0.013])
def test_the_soonest_that_a_command_may_be_too_old_is_later_than_a_held_key_is_repeated(
    strict: Callable[..., Bench], phase_s: float
) -> None:
    period_s = 0.033  # app/operator/manual_drive.py
    bench = strict(command_max_age_s=0.05)
    bench.on()
    said_s = bench.now_s + phase_s
    for turn in range(30):
        now_s = bench.now_s
        while said_s <= now_s + PERIOD_S:
            bench.now_s = said_s
            bench.pilot.jog("keys", Jog(advance=1.0))
            said_s += period_s
        bench.now_s = now_s
        bench.turn()
        assert turn < 2 or bench.pilot.view.operator_command.advance_mm_s > 0.0, turn


def test_a_tap_of_the_key_beside_a_held_pedal_holds_nothing(bench: Bench) -> None:
    bench.armed().pilot.deadman("pedal", False)
    for turn in range(40):
        if turn % 3 != 2:  # its reports and the pilot's turns keep no common time
            bench.pilot.deadman("pedal", True)
        if turn == 3:
            bench.pilot.ask(Act.HAND_OVER)
        bench.held = turn in {10, 11, 12, 20, 30}
        bench.turn()
        assert turn < 3 or bench.mode is Mode.AUTONOMOUS, turn
    assert Cause.DEADMAN not in bench.alerts()


def test_a_held_deadman_that_cannot_tell_for_a_moment_holds_at_once_and_goes_on(bench: Bench) -> None:
    def turn(pedal: bool | None) -> Mode:
        bench.pilot.deadman("pedal", pedal)
        bench.turn()
        return bench.mode

    bench.armed()
    turn(False)
    turn(True)
    bench.pilot.ask(Act.HAND_OVER)
    assert turn(True) is Mode.AUTONOMOUS
    assert turn(None) is Mode.HOLD
    assert bench.pilot.view.deadman is False
    assert turn(True) is Mode.HOLD
    assert bench.pilot.view.deadman is True
    modes = [turn(True) for _ in range(7)]
    assert modes == sorted(modes, key=[Mode.HOLD, Mode.AUTONOMOUS].index)
    assert modes[-1] is Mode.AUTONOMOUS


def test_a_control_held_since_before_must_be_let_go_first(bench: Bench) -> None:
    bench.jog = Jog(advance=1.0)
    bench.on()
    assert {command.advance_mm_s for _, command, _ in bench.robot.sent} == {0.0}
    bench.jog = AT_REST
    bench.seconds(0.2)
    bench.jog = Jog(advance=1.0)
    bench.turn()
    assert bench.robot.sent[-1][1].advance_mm_s == 10.0


def test_nobody_drives_by_hand_before_a_window_that_hangs(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.on().jog = Jog(advance=1.0)
    bench.turn(3)
    assert bench.robot.sent[-1][1].advance_mm_s == 10.0
    monkeypatch.setattr(bench.pilot, "window_alive", lambda: None)
    bench.seconds(0.6)
    assert bench.robot.sent[-1][1].advance_mm_s == 0.0


def test_what_ends_autonomy_is_heard(bench: Bench) -> None:
    bench.handed_over()
    bench.scene = lambda scene: replace(scene, pose=None, refusal=Refusal(Reason.SEVERAL_ROBOTS), route=None)
    bench.turn(3)
    assert bench.mode is Mode.ADVISORY
    assert "disarm" in {alert.sound for alert in bench.pilot.news().alerts}


def test_a_rejection_in_the_turn_of_a_touch_does_not_stay(bench: Bench) -> None:
    bench.handed_over()
    bench.robot.edit = lambda sent: replace(sent, source=None, rejection=RejectReason.OVER_RATE)
    bench.turn()
    bench.robot.edit = lambda sent: sent
    bench.pilot.jog("pad", Jog(bend=0.1))
    bench.turn()
    assert bench.mode is Mode.ARMED
    bench.seconds(1.0)
    assert bench.pilot.view.against_hand_over == ()


def test_keys_while_stopped_remind_and_do_not_sound(bench: Bench) -> None:
    bench.on().pilot.stop()
    bench.turn()
    bench.pilot.news()
    bench.jog = Jog(advance=1.0)
    bench.seconds(8.0)
    alerts = bench.pilot.news().alerts
    assert {alert.key for alert in alerts} == {Hindrance.IS_STOPPED}
    assert {alert.sound for alert in alerts} == {None}


def test_straightening_and_steering_are_no_faster_than_either(bench: Bench) -> None:
    bench.on().jog = Jog(bend=1.0)
    bench.seconds(0.3)
    before = bench.robot.sent[-1][1].bend
    bench.jog = Jog(bend=-1.0, straighten=True)
    bench.turn()
    assert before - bench.robot.sent[-1][1].bend <= 1.2 * PERIOD_S + 1e-9


def test_closing_holds_and_permits_nobody(bench: Bench) -> None:
    bench.on().pilot.close()
    assert bench.robot.permitted is None
    assert bench.robot.motion.source is None


# ---- what outlives a rig, and what ends a hand-over


def test_another_target_ends_the_hand_over_and_the_old_advice_is_not_followed(bench: Bench) -> None:
    bench.handed_over().alerts()
    bench.seeing = False
    sent = len(bench.robot.sent)
    bench.pilot.target_changed()
    bench.turn()
    assert bench.mode is Mode.ARMED
    assert bench.alerts() == {Note.NEW_TARGET}
    assert all(source is not Source.PROGRAM for source, _, _ in bench.robot.sent[sent:])


def pilot_after(bench: Bench, left_over: LeftOver | None) -> Bench:
    """The next rig's bench; the one before is closed."""
    bench.pilot.close()
    after = Bench()
    after.pilot.close()
    after.pilot = Pilot(after.robot, after.policy, Config(), ModelReport(True), clock=lambda: after.now_s, left_over=left_over)
    return after


def test_a_stop_outlives_the_rig_and_needs_its_acknowledgement(bench: Bench) -> None:
    bench.on().pilot.stop()
    assert bench.pilot.left_over == LeftOver(Fault(Cause.STOP_PRESSED), stopped=True), "before any turn, too"
    bench.turn()
    assert bench.pilot.left_over == LeftOver(Fault(Cause.STOP_PRESSED), stopped=True)
    after = pilot_after(bench, bench.pilot.left_over)
    assert (after.mode, after.pilot.view.latched) == (Mode.STOPPED, Fault(Cause.STOP_PRESSED))
    assert after.robot.calls == ["stop"], "pressed while it was being opened, it had reached no servo, and no torque went off"
    after.pilot.switch_on()
    after.done().seconds(0.2)
    assert after.mode is Mode.STOPPED
    assert "arm" not in after.robot.calls
    after.pilot.ask(Act.ACKNOWLEDGE)
    after.turn()
    assert (after.mode, after.pilot.view.latched, after.pilot.left_over) == (Mode.ADVISORY, None, None)
    after.on()
    assert after.pilot.view.servos_on
    after.pilot.close()


def test_a_rig_that_breaks_off_while_armed_leaves_that_and_one_that_is_ended_does_not(bench: Bench) -> None:
    bench.armed()
    left_over = bench.pilot.left_over
    assert (left_over.fault.cause, left_over.stopped) == (Cause.HEARTBEAT_LOST, False)
    bench.pilot.halt()
    bench.turn()
    assert bench.pilot.left_over is None
    assert bench.robot.permitted is None


def test_changes_are_kept_for_the_record_though_nobody_looks(bench: Bench) -> None:
    bench.handed_over().pilot.news()
    bench.held = False
    bench.turn(2)
    bench.held = True
    bench.turn(10)
    news = bench.pilot.news()
    assert [view.mode for view in news.changes] == [Mode.HOLD, Mode.HOLD, Mode.AUTONOMOUS]
    assert bench.pilot.news().changes == ()


def test_a_late_frame_is_counted_and_told_and_changes_nothing(bench: Bench) -> None:
    bench.handed_over().alerts()
    bench.pilot.frame_late()
    bench.turn()
    assert bench.mode is Mode.AUTONOMOUS
    assert Fault(Cause.OUT_OF_ORDER, "1 until now") in bench.pilot.view.active
    assert bench.alerts() == {Cause.OUT_OF_ORDER}


# ---- a robot that cannot be driven, though its servos are on


OUTSIDE = Rejection(RejectReason.MEASURED_OUT_OF_ENVELOPE, "advance at -7.00 mm (-5 to 400 mm)")


def test_a_robot_that_keeps_all_back_is_told_to_who_moves_the_controls_and_nobody_is_shown_as_driving(bench: Bench) -> None:
    bench.robot.keeps_back = OUTSIDE
    bench.on().alerts()
    assert bench.seconds(0.2).alerts() == set()  # no command was given
    assert bench.pilot.view.servos_on
    assert bench.pilot.view.permitted is None
    bench.jog = Jog(advance=1.0)
    bench.turn()
    told = {alert.key: alert.detail for alert in bench.pilot.news().alerts}
    assert told == {RejectReason.MEASURED_OUT_OF_ENVELOPE: "advance at -7.00 mm (-5 to 400 mm)"}
    bench.robot.keeps_back = None
    bench.turn()
    assert bench.pilot.view.permitted is Source.OPERATOR


def test_a_robot_that_keeps_all_back_is_not_driven_by_the_program_either(bench: Bench) -> None:
    bench.robot.keeps_back = OUTSIDE
    bench.handed_over()
    bench.seconds(1.0)
    assert bench.mode is Mode.HOLD
    assert bench.pilot.view.permitted is None
    assert bench.alerts() >= {RejectReason.MEASURED_OUT_OF_ENVELOPE, Cause.COMMAND_REJECTED}
    assert all(source is Source.OPERATOR for source, _, _ in bench.robot.sent)


@pytest.mark.parametrize("reason", [RejectReason.NOT_ARMED, RejectReason.NO_COMMAND])
def test_the_first_turns_after_switching_on_are_not_worth_a_word(bench: Bench, reason: RejectReason) -> None:
    bench.on().alerts()
    bench.robot.keeps_back = Rejection(reason)
    bench.jog = Jog(advance=1.0)
    assert bench.turn(3).alerts() == set()


# ---- orders of events that are seldom


@pytest.mark.parametrize("said_after_turn_s", [0.001, 0.01, 0.019])
def test_the_deadmans_silence_counts_from_when_it_was_said(bench: Bench, said_after_turn_s: float) -> None:
    bench.handed_over()
    turned_s = bench.now_s
    said_s = bench.now_s = turned_s + said_after_turn_s
    bench.pilot.deadman("key", True)
    bench.now_s = turned_s
    while bench.mode is Mode.AUTONOMOUS:
        bench.now_s += PERIOD_S
        bench.pilot.window_alive()
        bench.pilot.perception_alive()
        bench.pilot.tick()
    assert bench.mode is Mode.HOLD
    assert bench.now_s - said_s <= 0.1 + 1e-9


def test_another_target_in_the_turn_of_the_hand_over_ends_it(bench: Bench) -> None:
    bench.armed().held = True
    bench.turn(2)
    bench.pilot.ask(Act.HAND_OVER)
    bench.pilot.target_changed()
    bench.turn(6)
    assert bench.mode is Mode.ARMED
    assert all(source is Source.OPERATOR for source, _, _ in bench.robot.sent)


def _behind(scene: Scene) -> Scene:
    way = np.column_stack([np.arange(200.0, 20.0, -1.0), np.full(180, 60.0)])
    return replace(scene, route=Route(way, 180.0, (20.0, 60.0)))


def test_an_expired_hold_does_not_excuse_a_target_behind_the_robot(bench: Bench) -> None:
    bench.handed_over().held = False
    bench.seconds(0.3)
    bench.scene = _behind
    bench.seconds(3.0)
    assert bench.mode is Mode.HOLD
    assert Hindrance.TARGET_BEHIND in bench.pilot.view.against_hand_over
    bench.alerts()
    bench.held = True
    bench.turn(2).pilot.ask(Act.HAND_OVER)
    bench.turn(2)
    assert bench.mode is Mode.HOLD
    assert Hindrance.TARGET_BEHIND in bench.alerts()


@pytest.mark.parametrize("handed_over", [True, False])
def test_a_press_that_ends_a_hold_moves_at_once(bench: Bench, handed_over: bool) -> None:
    bench.handed_over().held = handed_over
    bench.seconds(0.3)
    assert bench.mode is (Mode.AUTONOMOUS if handed_over else Mode.HOLD)
    bench.jog = Jog(advance=-1.0)
    bench.turn(2)
    assert bench.mode is Mode.ARMED
    assert bench.robot.sent[-1][1].advance_mm_s == -10.0


def _spoilt(points: Points, value: float) -> Points:
    spoilt = points.copy()
    spoilt[len(spoilt) // 2] = value
    return spoilt


@pytest.mark.parametrize("value", [math.nan, -math.inf])
@pytest.mark.parametrize(
    "part", ["path", "path radius", "bridged", "piece", "nearest", "radius", "ambiguity", "route", "length", "target", "theta"]
)
def test_any_number_that_is_none_holds_and_the_policy_is_not_asked(bench: Bench, part: str, value: float) -> None:
    def spoil(scene: Scene) -> Scene:
        path, line, route, pose = scene.path, scene.centerline, scene.route, scene.pose
        changes: dict[str, dict[str, Any]] = {
            "path": {"path": replace(path, points=_spoilt(path.points, value))},
            "path radius": {"path": replace(path, radius_px=value)},
            "bridged": {"path": replace(path, bridged_px=value)},
            "piece": {"centerline": replace(line, piece=_spoilt(line.piece, value))},
            "nearest": {"centerline": replace(line, nearest=(value, 60.0))},
            "radius": {"centerline": replace(line, radius_px=value)},
            "ambiguity": {"centerline": replace(line, ambiguity=value)},
            "route": {"route": replace(route, points=_spoilt(route.points, value))},
            "length": {"route": replace(route, length_px=value)},
            "target": {"route": replace(route, target=(value, 60.0))},
            "theta": {"pose": replace(pose, theta_deg=value)},
        }
        return replace(scene, **changes[part])

    bench.pilot._policy = make_policy("pursuit", Config())
    bench.handed_over()
    assert bench.mode is Mode.AUTONOMOUS
    bench.scene = spoil
    bench.turn(2)
    assert bench.mode is Mode.HOLD
    assert Cause.NOT_FINITE in {fault.cause for fault in bench.pilot.view.active}
    assert bench.shown is None


def test_a_jump_of_the_clock_with_the_servos_on_is_told_and_must_be_acknowledged(bench: Bench) -> None:
    bench.on().alerts()
    bench.now_s += 2.0
    bench.turn(5)
    view = bench.pilot.view
    assert (view.mode, view.servos_on) == (Mode.ADVISORY, False)
    assert bench.latched is Cause.CLOCK
    assert Cause.CLOCK in bench.alerts()


def test_a_jump_of_the_clock_with_the_servos_off_is_nobodys_concern(bench: Bench) -> None:
    bench.seconds(0.2).alerts()
    bench.now_s += 2.0
    bench.turn(5)
    assert bench.pilot.view.latched is None
    assert bench.alerts() == set()


class Turned:
    """Counts its turns; the test may let the computer sleep or a turn fail."""

    def __init__(self) -> None:
        self.turns = 0
        self.asleep_s = 7.0
        self.reported: list[Fault] = []
        self.closed = False
        self.fails = False
        self.turned = threading.Semaphore(0)

    def tick(self) -> None:
        if self.fails:
            raise RuntimeError("no more")
        self.turns += 1
        self.turned.release()

    def report_fault(self, fault: Fault) -> None:
        self.reported.append(fault)

    def close(self) -> None:
        self.closed = True

    def wait(self, turns: int) -> None:
        for _ in range(turns):
            assert self.turned.acquire(timeout=10.0)


def test_a_sleep_of_the_computer_is_told_once() -> None:
    turned = Turned()
    loop = PilotLoop(turned, lambda: turned.asleep_s)
    turned.wait(3)
    turned.asleep_s += 30.0
    turned.wait(5)
    loop.close()
    assert turned.reported == [Fault(Cause.CLOCK, "the computer slept for 30 s")]
    assert turned.closed


def test_clocks_that_drift_apart_a_little_are_no_sleep() -> None:
    turned = Turned()
    loop = PilotLoop(turned, lambda: turned.asleep_s)
    for _ in range(5):
        turned.wait(1)
        turned.asleep_s += 0.001
    loop.close()
    assert turned.reported == []


def test_a_turn_that_fails_ends_the_turns_with_its_reason() -> None:
    turned = Turned()
    loop = PilotLoop(turned)
    turned.wait(1)
    turned.fails = True
    loop._thread.join(10.0)
    assert "RuntimeError: no more" in loop.failure
    loop.close()
    assert turned.closed


def test_the_sleep_so_far_is_read_from_the_system() -> None:
    assert slept_s() > -0.1


# --- a retraction beyond the end of the envelope ---------------------------------------------------------------------------------


def _at_low(bench: Bench, **feeds_mm: float) -> None:
    """From now on what was sent says that these feeds are at the low end, or below."""
    bench.robot.edit = lambda motion: replace(motion, at_end=tuple(feeds_mm), at_low=feeds_mm)


@pytest.mark.parametrize(
    ("jog", "feed", "retracted"),
    [(Jog(advance=-1.0, delivery=-0.4), "advance", Retracted.ROBOT), (Jog(delivery=-0.4), "delivery_2", Retracted.CATHETER)],
)
def test_the_operator_lets_go_at_the_end_and_pulls_again_to_go_beyond_it(
    bench: Bench, jog: Jog, feed: str, retracted: Retracted
) -> None:
    bench.on()
    bench.jog = jog
    bench.turn(5)
    _at_low(bench, **{feed: -5.0})
    bench.turn(5)
    assert not bench.robot.retracts
    assert Note.AT_LOW_END in bench.alerts()
    bench.jog = AT_REST
    bench.seconds(0.2)
    assert not bench.robot.retracts
    bench.jog = jog
    _at_low(bench, **{feed: -6.2})
    bench.turn(2)
    assert bench.robot.retracts is retracted
    bench.pilot.news()
    bench.seconds(2.5)
    (alert,) = (alert for alert in bench.pilot.news().alerts if alert.key is Note.BEYOND_END)
    assert alert.detail == f"{feed} -6.2 mm"
    bench.jog = AT_REST
    bench.seconds(0.2)
    assert not bench.robot.retracts
    bench.jog = Jog(advance=1.0)
    bench.turn(2)
    assert not bench.robot.retracts


def test_a_pull_at_the_end_that_is_held_over_a_stop_must_begin_again(bench: Bench) -> None:
    bench.on()
    _at_low(bench, advance=-5.0)
    bench.turn(2)
    bench.jog = Jog(advance=-1.0)
    bench.turn(2)
    assert bench.robot.retracts
    bench.pilot.stop()
    bench.turn(2).pilot.ask(Act.ACKNOWLEDGE)
    bench.done().turn(2).on()
    assert bench.pilot.view.permitted is Source.OPERATOR
    assert not bench.robot.retracts
    bench.jog = AT_REST
    bench.seconds(0.2)
    bench.jog = Jog(advance=-1.0)
    bench.turn(2)
    assert bench.robot.retracts


class BenchTime:
    """The clock of a simulated bench, which the test sets."""

    now_s, granted_s, speed = 100.0, 0.0, 1.0

    def __call__(self) -> float:
        return self.now_s

    def grant(self, until_s: float) -> None:
        self.granted_s = until_s


def test_a_simulated_bench_is_granted_no_time_in_which_an_input_becomes_too_old() -> None:
    at, robot, safety = BenchTime(), Robot(), SafetyConfig()
    pilot = Pilot(robot, Policy(), Config(), ModelReport(True), bench_clock=at)
    try:
        frame = Frame(1, 99.96, np.zeros((480, 640, 3), np.uint8))
        pilot.deadman(KEYBOARD, True)
        pilot.update_scene(frame, scene_at(1, frame.captured_s), None, has_target=True)
        pilot.tick()
        assert at.granted_s == pytest.approx(99.96 + safety.pose_hold_s * 2 / 3), "a slow perception"
        at.now_s = 100.05
        pilot.update_scene(replace(frame, index=2, captured_s=100.05), scene_at(2, 100.05), None, has_target=True)
        pilot.tick()
        assert at.granted_s == pytest.approx(100.0 + safety.deadman_timeout_s), "a window that hangs while the deadman is held"
        pilot.deadman(KEYBOARD, False)
        robot.bus = None
        at.now_s = 100.09
        pilot.tick()
        assert at.granted_s == pytest.approx(100.05 + safety.measurement_max_age_s * 2 / 3), "a servo process that is late"
    finally:
        pilot.close()
