"""Requests to the servos, and the torque-off that a stop requests."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace

import pytest

from core.config.models import Config
from core.control.alerts import Note
from core.control.faults import Cause, Fault
from core.control.gate import Source
from core.control.modes import Act, Hindrance, Mode
from core.control.pilot import LeftOver
from core.control.servo_requests import RETRY_S, ReleaseEvent, ReleaseState, TorqueRelease, next_state
from core.devices import DeviceError
from tests.core.pilot_bench import WELL, Bench


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.pilot.close()


def test_zeroing_restarting_and_letting_go_need_switching_on_afterwards(bench: Bench) -> None:
    for request, call in (
        (bench.pilot.zero, "zero"),
        (lambda: bench.pilot.reboot(3), "reboot 3"),
        (bench.pilot.torque_off, "torque off"),
    ):
        bench.on()
        assert bench.pilot.view.servos_on
        request()
        bench.done().turn(2)
        assert bench.robot.calls[-2:] == ["disarm", call]
        assert not bench.pilot.view.servos_on
        if bench.pilot.view.latched is not None:
            bench.pilot.ask(Act.ACKNOWLEDGE)
            bench.done().turn()


@pytest.mark.parametrize("during", ["disarm", "arm"])
def test_letting_the_wires_go_is_never_lost_behind_what_is_under_way(bench: Bench, during: str) -> None:
    """Checking seven servos on a bad line takes seconds; who changes his mind meanwhile finds the servos without torque."""
    under_way, go_on, plain = threading.Event(), threading.Event(), getattr(bench.robot, during)

    def slow() -> None:
        plain()
        if not under_way.is_set():
            under_way.set()
            assert go_on.wait(10.0)

    setattr(bench.robot, during, slow)
    assert bench.pilot.switch_on()
    assert under_way.wait(10.0)
    assert bench.pilot.torque_off()
    go_on.set()
    bench.done().turn(2)
    assert bench.robot.calls[-2:] == ["disarm", "torque off"]
    assert not bench.pilot.view.servos_on
    assert bench.robot.calls.count("arm") == (during == "arm")


def test_while_the_servos_are_busy_other_requests_are_refused_aloud(bench: Bench) -> None:
    under_way, go_on = threading.Event(), threading.Event()

    def slow() -> None:
        under_way.set()
        assert go_on.wait(10.0)

    bench.robot.arm = slow  # type: ignore[method-assign]
    assert bench.pilot.switch_on()
    assert under_way.wait(10.0)
    for request in (bench.pilot.zero, bench.pilot.switch_on, lambda: bench.pilot.reboot(3)):
        assert not request()
        (alert,) = bench.pilot.news().alerts
        assert (alert.key, alert.detail) == (Hindrance.SERVOS_BUSY, "checking the servos")
    go_on.set()
    assert bench.done().turn(2).pilot.view.servos_on
    assert "zero" not in bench.robot.calls


@pytest.mark.parametrize("call", ["disarm", "acknowledge", "arm"])
def test_stop_while_the_servos_are_being_switched_on_is_not_undone(bench: Bench, call: str) -> None:
    bench.seconds(0.2)
    before = getattr(bench.robot, call)

    def stopped_in_it() -> None:
        before()
        bench.pilot.ask(Act.STOP)

    setattr(bench.robot, call, stopped_in_it)
    bench.pilot.switch_on()
    bench.done().turn(3)
    assert bench.mode is Mode.STOPPED
    assert bench.robot.calls[-1] == "stop" or "arm" not in bench.robot.calls
    assert not bench.pilot.view.servos_on
    setattr(bench.robot, call, before)
    bench.pilot.ask(Act.ACKNOWLEDGE)
    bench.done().turn(3)
    assert not bench.pilot.view.servos_on, "an acknowledgement moves nothing"
    bench.pilot.switch_on()
    bench.done().turn(3)
    assert bench.pilot.view.servos_on


def test_servo_requests_wait_until_nobody_may_be_driving(bench: Bench) -> None:
    bench.armed()
    count = len(bench.robot.calls)
    for request in (bench.pilot.switch_on, bench.pilot.zero, bench.pilot.torque_off):
        request()
    bench.pilot.reboot(3)
    bench.done().turn()
    assert len(bench.robot.calls) == count
    assert Hindrance.ALREADY_ARMED in bench.alerts()
    assert bench.mode is Mode.ARMED


def test_a_torque_off_that_waits_when_the_program_ends_is_still_done(bench: Bench) -> None:
    """Asked for while the servos were being checked; it was dropped, and the wires stayed under tension."""
    go_on, entered = threading.Event(), threading.Event()

    def arm() -> None:
        entered.set()
        go_on.wait(5.0)

    bench.seconds(0.2)
    bench.robot.arm = arm  # type: ignore[method-assign]
    bench.pilot.switch_on()
    assert entered.wait(5.0)
    bench.pilot.torque_off()
    bench.pilot.close()
    go_on.set()
    assert bench.robot.calls.count("torque off") == 1


def test_a_torque_off_that_is_done_is_not_done_again_at_the_end(bench: Bench) -> None:
    bench.seconds(0.2)
    bench.pilot.torque_off()
    bench.done().pilot.close()
    assert bench.robot.calls.count("torque off") == 1


def test_servos_that_were_switched_on_after_a_torque_off_in_vain_keep_their_torque_at_the_end(bench: Bench) -> None:
    """The wires went slack when the window was closed, though the operator had switched the servos on and driven since."""
    bench.seconds(0.2)
    plain = bench.robot.torque_off

    def in_vain() -> None:
        plain()
        raise DeviceError("torque of up is not proven to be off: cut the servos' power")

    bench.robot.torque_off = in_vain  # type: ignore[method-assign]
    bench.pilot.torque_off()
    bench.done().turn()
    bench.pilot.ask(Act.ACKNOWLEDGE)
    bench.on()
    assert bench.pilot.view.servos_on
    bench.pilot.close()
    assert bench.robot.calls.count("torque off") == 1


def test_a_hold_that_fails_does_not_keep_the_torque_on(bench: Bench) -> None:
    """The servos were to hold first; where that failed the bus process never heard of the torque-off, and owed none."""
    bench.seconds(0.2)

    def lost() -> None:
        raise DeviceError("servo port is lost")

    bench.robot.disarm = lost  # type: ignore[method-assign]
    bench.pilot.torque_off()
    bench.done()
    assert "torque off" in bench.robot.calls


def test_a_torque_off_needs_no_bus_process_that_lives(bench: Bench) -> None:
    bench.seconds(0.2)
    bench.robot.failure = "the servo bus process ended"
    bench.pilot.torque_off()
    bench.done()
    assert bench.robot.calls[-2:] == ["connect", "torque off"]


def test_a_torque_off_needs_not_all_servos_to_connect(bench: Bench) -> None:
    """The bus process was gone and a servo was missing: connecting failed, and six servos went on pulling."""
    bench.seconds(0.2)
    bench.robot.failure = "the servo bus process ended"

    def connect() -> None:
        bench.robot.calls.append("connect")
        raise DeviceError("servo up (id 3) does not answer")

    bench.robot.connect = connect  # type: ignore[method-assign]
    bench.alerts()
    bench.pilot.torque_off()
    bench.done()
    bench.turn()
    assert bench.robot.calls[-2:] == ["connect", "torque off"]
    assert Note.TORQUE_OFF in bench.alerts()
    bench.turn()
    assert Note.TORQUE_OFF not in bench.alerts()


def _letting_go(bench: Bench) -> bool:
    return any(fault.cause is Cause.TORQUE_ON for fault in bench.pilot.view.active)


def _lose_the_bus(bench: Bench) -> None:
    def connect() -> None:
        raise DeviceError("the servo port is not there")

    bench.robot.connect = connect  # type: ignore[method-assign]
    bench.robot.failure = "the servo bus process ended (killed by SIGKILL)"


@pytest.mark.parametrize("is_wanted", [True, False])
def test_a_stop_lets_go_also_where_the_bus_process_is_gone(is_wanted: bool) -> None:
    """The debt lived in the process that was gone: all servos went on pulling, and nobody was told."""
    config = Config()
    bench = Bench(config.model_copy(update={"servos": config.servos.model_copy(update={"torque_off_on_stop": is_wanted})}))
    bench.on()
    _lose_the_bus(bench)
    bench.turn(2)
    assert not _letting_go(bench), "nobody has pressed STOP"
    bench.pilot.ask(Act.STOP)
    bench.turn(2)
    assert _letting_go(bench) is is_wanted
    bench.done().turn(3)
    assert bench.robot.calls.count("torque off") == int(is_wanted)
    assert (Note.TORQUE_OFF in bench.alerts()) is is_wanted
    assert not _letting_go(bench)
    bench.seconds(11.0).done()
    assert bench.robot.calls.count("torque off") == int(is_wanted), "once is enough"
    bench.pilot.close()


@pytest.fixture
def slackening() -> Iterator[Bench]:
    """A bench whose STOP also switches the torque off."""
    config = Config()
    bench = Bench(config.model_copy(update={"servos": config.servos.model_copy(update={"torque_off_on_stop": True})}))
    yield bench
    bench.pilot.close()


def test_what_a_stop_owes_is_tried_until_the_servos_have_let_go_or_are_switched_on(slackening: Bench) -> None:
    bench = slackening
    plain = bench.robot.torque_off

    def in_vain() -> None:
        plain()
        raise DeviceError("torque of up is not proven to be off: cut the servos' power")

    bench.on()
    _lose_the_bus(bench)
    bench.robot.torque_off = in_vain  # type: ignore[method-assign]
    bench.pilot.ask(Act.STOP)
    bench.turn(3).done().seconds(9.0).done()
    assert (bench.robot.calls.count("torque off"), _letting_go(bench)) == (1, True)
    bench.seconds(1.5).done()
    assert (bench.robot.calls.count("torque off"), _letting_go(bench)) == (2, True)
    bench.pilot.ask(Act.STOP)
    bench.turn(2).done()
    assert bench.robot.calls.count("torque off") == 3, "another STOP need not wait"
    bench.turn().pilot.ask(Act.ACKNOWLEDGE)
    bench.turn().done().seconds(11.0).done()
    assert (bench.robot.calls.count("torque off"), _letting_go(bench)) == (4, True), "still not proven"
    bench.robot.failure = None
    bench.turn().pilot.ask(Act.ACKNOWLEDGE)
    bench.turn().on()
    view = bench.pilot.view
    assert (view.servos_on, view.latched, view.permitted) == (True, None, Source.OPERATOR), "the operator has switched them on"
    bench.seconds(11.0).done()
    assert (bench.robot.calls.count("torque off"), _letting_go(bench)) == (4, False)


def test_a_stop_that_the_bus_process_has_paid_is_owed_no_more(slackening: Bench) -> None:
    """It may pay before the pilot's turn hears of the STOP, and of a second press it takes no notice."""
    bench = slackening
    bench.on()
    bench.pilot.ask(Act.STOP)
    bench.robot.bus = replace(WELL, torque_off=True)
    bench.turn()
    bench.robot.bus = WELL
    bench.turn().pilot.ask(Act.STOP)
    bench.turn(3)
    bench.robot.failure = "the servo bus process ended"
    bench.turn(3).done()
    assert not _letting_go(bench)
    assert "torque off" not in bench.robot.calls
    bench.robot.failure = None
    bench.pilot.ask(Act.ACKNOWLEDGE)
    bench.turn().on()
    assert bench.pilot.view.servos_on
    _lose_the_bus(bench)
    bench.pilot.ask(Act.STOP)
    bench.turn(3).done().turn()
    assert "torque off" in bench.robot.calls, "it was on in between"


def test_what_a_stop_owes_is_paid_at_the_end(slackening: Bench) -> None:
    """Pressed when nothing is heard from the bus any more, but nobody knows it yet: no turn has heard of it before the end."""
    slackening.on()
    slackening.pilot.ask(Act.STOP)
    slackening.pilot.close()
    assert slackening.robot.calls.count("torque off") == 1


@pytest.mark.parametrize("is_stopped", [False, True])
def test_a_torque_off_that_is_under_way_at_the_end_is_waited_for_and_not_done_twice(slackening: Bench, is_stopped: bool) -> None:
    entered, go_on = threading.Event(), threading.Event()
    plain = slackening.robot.torque_off

    def slow() -> None:
        entered.set()
        go_on.wait(5.0)
        plain()

    slackening.robot.torque_off = slow  # type: ignore[method-assign]
    slackening.seconds(0.2).pilot.torque_off()
    assert entered.wait(5.0)
    if is_stopped:  # and owes one, too
        slackening.pilot.ask(Act.STOP)
    threading.Timer(0.1, go_on.set).start()
    slackening.pilot.close()
    assert slackening.robot.calls.count("torque off") == 1


def test_a_stop_that_was_taken_over_from_the_rig_before_is_owed_too() -> None:
    config = Config()
    config = config.model_copy(update={"servos": config.servos.model_copy(update={"torque_off_on_stop": True})})
    bench = Bench(config, LeftOver(Fault(Cause.STOP_PRESSED), True))
    _lose_the_bus(bench)
    bench.turn(3).done().turn()
    assert "torque off" in bench.robot.calls
    bench.pilot.close()


def test_what_became_of_a_torque_off_is_told(bench: Bench) -> None:
    bench.on()
    bench.alerts()
    bench.robot.bus = replace(WELL, torque_off=True)
    bench.turn()
    bench.robot.bus = replace(WELL, torque_problem="torque of up is not proven to be off: cut the servos' power")
    bench.turn()
    assert {Note.TORQUE_OFF, Cause.TORQUE_ON} <= set(bench.alerts())


@pytest.mark.parametrize("is_on", [True, False])
def test_torque_that_is_not_proven_to_be_off_is_told_though_the_servos_follow_nobody(bench: Bench, is_on: bool) -> None:
    """After a STOP they follow nobody: that is when it matters."""
    bench.seconds(0.2)
    if is_on:
        bench.on()
    bench.pilot.ask(Act.STOP)
    bench.turn(2)
    bench.alerts()
    bench.robot.bus = replace(WELL, armed=False, torque_problem="torque of up is not proven to be off: cut the servos' power")
    bench.turn(2)
    assert Cause.TORQUE_ON in bench.alerts()


@pytest.mark.parametrize(
    "before", [{"watchdog_tripped": True}, {"torque_problem": "torque of up is not proven to be off: cut the servos' power"}]
)
def test_what_arming_has_mended_is_no_fault_of_the_servos_that_were_switched_on(bench: Bench, before: dict[str, object]) -> None:
    """Arming is answered a moment before the first report since: in that turn the last one from before disarmed them again."""
    bench.seconds(0.2)
    bench.robot.bus = replace(WELL, armed=False, **before)  # type: ignore[arg-type]
    bench.turn(2)
    bench.robot.bus = None
    bench.pilot.switch_on()
    bench.done().turn()
    assert bench.pilot.view.servos_on
    assert bench.pilot.view.latched is None
    bench.robot.bus = replace(WELL, **before)  # type: ignore[arg-type]
    bench.turn()
    assert bench.pilot.view.latched is not None, "what is said of them afterwards counts"


def test_an_unexpected_error_of_a_request_is_told(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    def broken() -> None:
        raise OSError(24, "Too many open files")

    bench.robot.arm = broken  # type: ignore[method-assign]
    bench.on()
    assert not bench.pilot.view.servos_on
    details = [alert.detail for alert in bench.pilot.news().alerts if alert.key is Cause.SERVOS_WRONG]
    assert len(details) == 1
    assert "Too many open files" in details[0]
    assert "Traceback" in caplog.text


def test_a_request_that_takes_long_is_no_silent_bus(bench: Bench) -> None:
    bench.seconds(0.2)
    go_on = threading.Event()
    bench.robot.arm = lambda: go_on.wait(5.0)  # type: ignore[method-assign,assignment,return-value]
    bench.robot.bus = None
    bench.pilot.switch_on()
    bench.seconds(2.0)
    assert bench.pilot.view.busy == "checking the servos"
    go_on.set()
    bench.done().robot.bus = WELL
    bench.turn(3)
    assert bench.pilot.view.servos_on
    assert bench.pilot.view.latched is None


_REQUEST, _LOST, _CONFIRM, _SWITCH_ON, _CANCEL = ReleaseEvent
_IDLE, _REQUESTED, _BUS_LOST, _CONFIRMED = ReleaseState


@pytest.mark.parametrize(
    ("state", "after"),
    [  # event: request, lose bus, confirm, switch on, cancel
        (_IDLE, (_REQUESTED, _IDLE, _CONFIRMED, _IDLE, _IDLE)),
        (_REQUESTED, (_REQUESTED, _BUS_LOST, _CONFIRMED, _REQUESTED, _IDLE)),
        (_BUS_LOST, (_BUS_LOST, _BUS_LOST, _CONFIRMED, _BUS_LOST, _IDLE)),
        (_CONFIRMED, (_CONFIRMED, _CONFIRMED, _CONFIRMED, _IDLE, _IDLE)),
    ],
)
def test_torque_release_state_by_event(state: ReleaseState, after: tuple[ReleaseState, ...]) -> None:
    assert tuple(next_state(state, event) for event in ReleaseEvent) == after


def test_a_torque_release_is_retried_after_ten_seconds_and_at_once_after_another_stop() -> None:
    release = TorqueRelease(is_enabled=True)
    release.handle(_REQUEST)
    assert not release.is_due(0.0, is_bus_lost=False, is_busy=False), "the bus process does it"
    assert not release.is_due(0.0, is_bus_lost=True, is_busy=True)
    tries = [release.is_due(now_s, is_bus_lost=True, is_busy=False) for now_s in (0.0, RETRY_S - 0.01, RETRY_S)]
    assert tries == [True, False, True]
    release.handle(_REQUEST)
    assert release.is_due(RETRY_S + 0.01, is_bus_lost=True, is_busy=False)
    release.handle(_CONFIRM)
    assert not release.is_due(99.0, is_bus_lost=True, is_busy=False)


def test_without_the_setting_a_stop_requests_no_torque_release() -> None:
    release = TorqueRelease(is_enabled=False)
    release.handle(_REQUEST)
    assert release.state is ReleaseState.IDLE
