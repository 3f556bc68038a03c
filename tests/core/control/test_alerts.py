"""One table of texts, and lines that come again."""

import pytest

from core.control.alerts import ALERTS, Alert, AlertKey, AlertReporter, Note, Priority
from core.control.faults import Cause, Reaction
from core.control.gate import RejectReason
from core.control.modes import Hindrance, Mode


def _report(
    reporter: AlertReporter, *keys: AlertKey, at_s: float, mode: Mode = Mode.AUTONOMOUS, changed: bool = False
) -> tuple[Alert, ...]:
    reporter.report([(key, "") for key in keys], at_s, mode, changed=changed)
    return reporter.take()


def test_the_table_has_a_line_for_every_cause_refusal_and_rejection() -> None:
    assert set(ALERTS) == {*Cause, *Hindrance, *RejectReason, *Note}
    assert len(ALERTS) == len(Cause) + len(Hindrance) + len(RejectReason) + len(Note)  # no name stands for two things


@pytest.mark.parametrize("key", ALERTS, ids=str)
def test_every_line_fits_says_what_to_do_and_ends_without_a_stop(key: AlertKey) -> None:
    spec = ALERTS[key]
    assert 0 < len(spec.text) <= 60
    assert 0 < len(spec.what_to_do) <= 100
    assert spec.text[0].isupper()
    assert not spec.text.endswith(".") and not spec.what_to_do.endswith(".")
    assert spec.cooldown_s > 0.0


@pytest.mark.parametrize(
    ("reaction", "priority", "sound"),
    [
        (Reaction.WARN, Priority.WARNING, None),
        (Reaction.HOLD, Priority.HOLD, "hold"),
        (Reaction.DISARM, Priority.DISARM, "disarm"),
        (Reaction.STOP, Priority.STOP, "stop"),
    ],
)
def test_urgency_and_sound_follow_from_the_reaction(reaction: Reaction, priority: Priority, sound: str | None) -> None:
    for cause in Cause:
        if cause.reaction is reaction:
            assert (ALERTS[cause].priority, ALERTS[cause].sound) == (priority, sound)


def test_the_same_line_comes_again_only_after_its_cooldown_and_says_how_often_it_came() -> None:
    reporter = AlertReporter()
    assert [alert.times for alert in _report(reporter, Cause.HEAD_JUMP, at_s=10.0)] == [1]
    for at_s in (10.0, 11.0, 12.99):
        assert _report(reporter, Cause.HEAD_JUMP, at_s=at_s) == ()
    assert [alert.key for alert in _report(reporter, Cause.HEAD_JUMP, Cause.STOP_PRESSED, at_s=12.995)] == [Cause.STOP_PRESSED]
    assert [alert.times for alert in _report(reporter, Cause.HEAD_JUMP, at_s=13.0)] == [2]  # 11.0 and 12.99
    assert [alert.times for alert in _report(reporter, Cause.HEAD_JUMP, at_s=16.0)] == [1]


def test_a_line_that_goes_on_is_counted_once() -> None:
    reporter = AlertReporter()
    shown = [alert.times for turn in range(60) for alert in _report(reporter, Note.AT_LOW_END, at_s=10.0 + turn / 10)]
    assert shown == [1, 0, 0]  # again after each cooldown of 2 s: it stays on the screen
    assert [alert.times for alert in _report(reporter, Note.AT_LOW_END, at_s=18.0)] == [1]


@pytest.mark.parametrize(
    ("keys", "mode", "sounds"),
    [
        ((Cause.DISK_LOW,), Mode.AUTONOMOUS, [None]),
        ((Cause.DISK_LOW, Cause.HEAD_JUMP, Cause.SEVERAL_ROBOTS), Mode.AUTONOMOUS, ["disarm", None, None]),
        ((Cause.HEAD_LOST,), Mode.HOLD, ["hold"]),
        ((Cause.HEAD_LOST,), Mode.ARMED, [None]),
        ((Cause.SEVERAL_ROBOTS,), Mode.ARMED, ["disarm"]),
        ((Cause.SEVERAL_ROBOTS, Cause.HEAD_JUMP), Mode.ADVISORY, [None, None]),
        ((Cause.STOP_PRESSED, Cause.SEVERAL_ROBOTS), Mode.ADVISORY, ["stop", None]),
    ],
)
def test_only_the_most_urgent_sounds_and_only_what_ended_or_interrupted_a_motion(
    keys: tuple[Cause, ...], mode: Mode, sounds: list[str | None]
) -> None:
    assert [alert.sound for alert in _report(AlertReporter(), *keys, at_s=1.0, mode=mode)] == sounds


def test_a_stop_on_the_screen_does_not_pass_for_an_emergency_stop() -> None:
    assert "power cut" in ALERTS[Cause.STOP_PRESSED].what_to_do


def test_what_ends_a_motion_is_reported_each_time() -> None:
    reporter = AlertReporter()
    for at_s, mode, changed, sounds in (
        (20.0, Mode.ARMED, True, ["stop"]),
        (24.0, Mode.ADVISORY, True, ["stop"]),
        (24.1, Mode.STOPPED, False, []),
    ):
        alerts = _report(reporter, Cause.STOP_PRESSED, at_s=at_s, mode=mode, changed=changed)
        assert [alert.sound for alert in alerts] == sounds
