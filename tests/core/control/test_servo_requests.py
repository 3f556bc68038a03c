"""Requests to the servos, and the torque-off that a stop requests."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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

_NOT_PROVEN = "torque of up is not proven to be off: cut the servos' power"


def _releasing_config(is_enabled: bool = True) -> Config:
    config = Config()
    return config.model_copy(update={"servos": config.servos.model_copy(update={"torque_off_on_stop": is_enabled})})


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.pilot.close()


@pytest.fixture
def releasing() -> Iterator[Bench]:
    """A bench whose STOP also switches the torque off."""
    bench = Bench(_releasing_config())
    yield bench
    bench.pilot.close()


@contextmanager
def slow(bench: Bench, call: str) -> Iterator[Callable[[], None]]:
    """Makes the first `call` of the robot last until the end of the block; gives a function that waits until it has begun."""
    begun, end, plain = threading.Event(), threading.Event(), getattr(bench.robot, call)

    def slowly() -> None:
        plain()
        if not begun.is_set():
            begun.set()
            assert end.wait(10.0)

    def wait() -> None:
        assert begun.wait(10.0)

    setattr(bench.robot, call, slowly)
    try:
        yield wait
    finally:
        end.set()


def _fail(bench: Bench, call: str, message: str) -> None:
    """Makes a call of the robot fail after it was counted."""

    def failing() -> None:
        bench.robot.calls.append(call.replace("_", " "))
        raise DeviceError(message)

    setattr(bench.robot, call, failing)


def _lose_the_bus(bench: Bench) -> None:
    _fail(bench, "connect", "the servo port is not there")
    bench.robot.failure = "the servo bus process ended (killed by SIGKILL)"


def _offs(bench: Bench) -> tuple[int, bool]:
    """How often the torque was switched off, and whether it is a fault that this is not proven."""
    is_fault = any(fault.cause is Cause.TORQUE_ON for fault in bench.pilot.view.active)
    return bench.robot.calls.count("torque off"), is_fault


# ---- requests


def test_zeroing_restarting_and_torque_off_need_switching_on_afterwards(bench: Bench) -> None:
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
def test_a_torque_off_is_never_lost_behind_what_is_under_way(bench: Bench, during: str) -> None:
    with slow(bench, during) as wait:
        assert bench.pilot.switch_on()
        wait()
        assert bench.pilot.torque_off()
    bench.done().turn(2)
    assert bench.robot.calls[-2:] == ["disarm", "torque off"]
    assert not bench.pilot.view.servos_on
    assert bench.robot.calls.count("arm") == (during == "arm")


def test_while_the_servos_are_busy_other_requests_are_refused_with_an_alert(bench: Bench) -> None:
    with slow(bench, "arm") as wait:
        assert bench.pilot.switch_on()
        wait()
        for request in (bench.pilot.zero, bench.pilot.switch_on, lambda: bench.pilot.reboot(3)):
            assert not request()
            (alert,) = bench.pilot.news().alerts
            assert (alert.key, alert.detail) == (Hindrance.SERVOS_BUSY, "checking the servos")
    assert bench.done().turn(2).pilot.view.servos_on
    assert "zero" not in bench.robot.calls


@pytest.mark.parametrize("call", ["disarm", "acknowledge", "arm"])
def test_a_stop_while_the_servos_are_being_switched_on_is_not_undone(bench: Bench, call: str) -> None:
    bench.seconds(0.2)
    before = getattr(bench.robot, call)

    def stopped_in_it() -> None:
        before()
        bench.pilot.stop()

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


def test_servo_requests_are_refused_while_armed(bench: Bench) -> None:
    bench.armed()
    count = len(bench.robot.calls)
    for request in (bench.pilot.switch_on, bench.pilot.zero, bench.pilot.torque_off):
        request()
    bench.pilot.reboot(3)
    bench.done().turn()
    assert len(bench.robot.calls) == count
    assert Hindrance.ALREADY_ARMED in bench.alerts()
    assert bench.mode is Mode.ARMED


@pytest.mark.parametrize("before", [{"watchdog_tripped": True}, {"torque_problem": _NOT_PROVEN}])
def test_what_arming_has_repaired_is_no_fault_of_the_servos_that_were_switched_on(bench: Bench, before: dict[str, object]) -> None:
    """Arming is answered before the first report since: in that turn the last report from before must not disarm again."""
    bench.seconds(0.2)
    bench.robot.bus = replace(WELL, armed=False, **before)
    bench.turn(2)
    bench.robot.bus = None
    bench.pilot.switch_on()
    bench.done().turn()
    assert bench.pilot.view.servos_on
    assert bench.pilot.view.latched is None
    bench.robot.bus = replace(WELL, **before)
    bench.turn()
    assert bench.pilot.view.latched is not None, "a later report counts"


def test_an_unexpected_error_of_a_request_is_reported(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    def broken() -> None:
        raise OSError(24, "Too many open files")

    bench.robot.arm = broken
    bench.on()
    assert not bench.pilot.view.servos_on
    (detail,) = [alert.detail for alert in bench.pilot.news().alerts if alert.key is Cause.SERVOS_WRONG]
    assert "Too many open files" in detail
    assert "Traceback" in caplog.text


def test_a_request_that_takes_long_is_no_silent_bus(bench: Bench) -> None:
    bench.seconds(0.2)
    bench.robot.bus = None
    with slow(bench, "arm"):
        bench.pilot.switch_on()
        bench.seconds(2.0)
        assert bench.pilot.view.busy == "checking the servos"
    bench.done().robot.bus = WELL
    bench.turn(3)
    assert bench.pilot.view.servos_on
    assert bench.pilot.view.latched is None


# ---- torque off


def test_torque_off_overtakes_a_relaxation(bench: Bench) -> None:
    """It waited for up to 15 s behind it."""
    bench.seconds(0.2)
    begun, ended = threading.Event(), []

    def relax(is_overtaken: Callable[[], bool]) -> None:
        begun.set()
        until_s = time.monotonic() + 10.0
        while not is_overtaken() and time.monotonic() < until_s:
            time.sleep(0.001)
        ended.append(is_overtaken())

    bench.robot.relax = relax
    assert bench.pilot.relax()
    assert begun.wait(10.0)
    assert bench.pilot.torque_off()
    bench.done().turn()
    assert ended == [True]
    assert bench.robot.calls[-2:] == ["disarm", "torque off"]


def test_a_torque_off_that_waits_when_the_program_ends_is_still_done(bench: Bench) -> None:
    bench.seconds(0.2)
    with slow(bench, "arm") as wait:
        bench.pilot.switch_on()
        wait()
        bench.pilot.torque_off()
        bench.pilot.close()
    assert bench.robot.calls.count("torque off") == 1


def test_servos_that_were_switched_on_after_a_failed_torque_off_keep_their_torque_at_the_end(bench: Bench) -> None:
    bench.seconds(0.2)
    _fail(bench, "torque_off", _NOT_PROVEN)
    bench.pilot.torque_off()
    bench.done().turn()
    bench.pilot.ask(Act.ACKNOWLEDGE)
    bench.on()
    assert bench.pilot.view.servos_on
    bench.pilot.close()
    assert bench.robot.calls.count("torque off") == 1


def test_a_hold_that_fails_does_not_keep_the_torque_on(bench: Bench) -> None:
    bench.seconds(0.2)
    _fail(bench, "disarm", "servo port is lost")
    bench.pilot.torque_off()
    bench.done()
    assert "torque off" in bench.robot.calls


@pytest.mark.parametrize("connects", [True, False])
def test_a_torque_off_needs_neither_a_living_bus_process_nor_all_servos_to_connect(bench: Bench, connects: bool) -> None:
    bench.seconds(0.2)
    bench.robot.failure = "the servo bus process ended"
    if not connects:
        _fail(bench, "connect", "servo up (id 3) does not answer")
    bench.alerts()
    bench.pilot.torque_off()
    bench.done().turn()
    assert bench.robot.calls[-2:] == ["connect", "torque off"]
    assert (Note.TORQUE_OFF in bench.alerts()) is not connects, "a connected robot reports it"
    bench.turn()
    assert Note.TORQUE_OFF not in bench.alerts()


@pytest.mark.parametrize("is_on", [True, False])
def test_the_result_of_a_torque_off_is_reported_also_while_the_servos_are_off(bench: Bench, is_on: bool) -> None:
    bench.seconds(0.2)
    if is_on:
        bench.on()
    bench.pilot.stop()
    bench.turn(2).alerts()
    bench.robot.bus = replace(WELL, armed=False, torque_off=True)
    bench.turn()
    bench.robot.bus = replace(WELL, armed=False, torque_problem=_NOT_PROVEN)
    bench.turn()
    assert {Note.TORQUE_OFF, Cause.TORQUE_ON} <= set(bench.alerts())


@pytest.mark.parametrize(("tight", "note"), [((), Note.LET_OUT), (("up", "down"), Note.STILL_TIGHT)])
def test_that_wires_were_let_out_is_said_where_it_is_true_and_else_which_were_not(
    bench: Bench, tight: tuple[str, ...], note: Note
) -> None:
    bench.seconds(0.2).alerts()
    bench.robot.bus = replace(WELL, armed=False, let_out=True, still_tight=tight)
    bench.turn()
    found = {alert.key: alert.detail for alert in bench.pilot.news().alerts}
    assert found.keys() & {Note.LET_OUT, Note.STILL_TIGHT} == {note}
    assert found[note] == ", ".join(tight)


# ---- torque off after a stop


@pytest.mark.parametrize("is_enabled", [True, False])
def test_a_stop_switches_the_torque_off_also_where_the_bus_process_is_gone(is_enabled: bool) -> None:
    bench = Bench(_releasing_config(is_enabled))
    bench.on()
    _lose_the_bus(bench)
    bench.turn(2)
    assert _offs(bench) == (0, False), "STOP was not pressed"
    bench.pilot.stop()
    bench.turn(2).done().turn(3)
    assert (Note.TORQUE_OFF in bench.alerts()) is is_enabled
    assert _offs(bench) == (int(is_enabled), False)
    bench.seconds(11.0).done()
    assert _offs(bench) == (int(is_enabled), False), "once is enough"
    bench.pilot.close()


def test_the_torque_off_of_a_stop_is_retried_until_it_is_confirmed_or_the_servos_are_switched_on(releasing: Bench) -> None:
    bench = releasing
    bench.on()
    _lose_the_bus(bench)
    _fail(bench, "torque_off", _NOT_PROVEN)
    bench.pilot.stop()
    bench.turn(3).done().seconds(9.0).done()
    assert _offs(bench) == (1, True)
    bench.seconds(1.5).done()
    assert _offs(bench) == (2, True)
    bench.pilot.stop()
    bench.turn(2).done()
    assert _offs(bench)[0] == 3, "another STOP need not wait"
    bench.turn().pilot.ask(Act.ACKNOWLEDGE)
    bench.turn().done().seconds(11.0).done()
    assert _offs(bench) == (4, True), "still not proven"
    bench.robot.failure = None
    bench.turn().pilot.ask(Act.ACKNOWLEDGE)
    bench.turn().on()
    view = bench.pilot.view
    assert (view.servos_on, view.latched, view.permitted) == (True, None, Source.OPERATOR), "the operator has switched them on"
    bench.seconds(11.0).done()
    assert _offs(bench) == (4, False)


def test_a_torque_off_that_the_bus_process_has_confirmed_is_not_repeated(releasing: Bench) -> None:
    """It may confirm before the pilot's turn handles the STOP, and ignores a second press."""
    bench = releasing
    bench.on()
    bench.pilot.stop()
    bench.robot.bus = replace(WELL, torque_off=True)
    bench.turn()
    bench.robot.bus = WELL
    bench.turn().pilot.stop()
    bench.turn(3)
    bench.robot.failure = "the servo bus process ended"
    bench.turn(3).done()
    assert _offs(bench) == (0, False)
    bench.robot.failure = None
    bench.pilot.ask(Act.ACKNOWLEDGE)
    bench.turn().on()
    assert bench.pilot.view.servos_on
    _lose_the_bus(bench)
    bench.pilot.stop()
    bench.turn(3).done().turn()
    assert _offs(bench)[0] == 1, "it was on in between"


def test_a_stop_that_no_turn_has_handled_switches_the_torque_off_at_the_end(releasing: Bench) -> None:
    releasing.on()
    releasing.pilot.stop()
    releasing.pilot.close()
    assert releasing.robot.calls.count("torque off") == 1


@pytest.mark.parametrize("is_stopped", [False, True])
def test_a_torque_off_that_is_under_way_at_the_end_is_waited_for_and_not_done_twice(releasing: Bench, is_stopped: bool) -> None:
    with slow(releasing, "torque_off") as wait:
        releasing.seconds(0.2).pilot.torque_off()
        wait()
        if is_stopped:  # which requests one, too
            releasing.pilot.stop()
        closing = threading.Thread(target=releasing.pilot.close)
        closing.start()
    closing.join(10.0)
    assert releasing.robot.calls.count("torque off") == 1


def test_a_stop_that_was_taken_over_from_the_rig_before_switches_the_torque_off_too() -> None:
    bench = Bench(_releasing_config(), LeftOver(Fault(Cause.STOP_PRESSED), True))
    _lose_the_bus(bench)
    bench.turn(3).done().turn()
    assert "torque off" in bench.robot.calls
    bench.pilot.close()


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
