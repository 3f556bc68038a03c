"""One table of texts, and repeats held back."""

from __future__ import annotations

import pytest

from core.control.alerts import ALERTS, Alert, AlertKey, AlertQueue, Note, Priority, raise_alerts
from core.control.faults import REACTION, Cause, Reaction
from core.control.gate import RejectReason
from core.control.modes import Hindrance


def _raise(queue: AlertQueue, *keys: AlertKey, at_s: float, armed: bool = True) -> tuple[AlertQueue, tuple[Alert, ...]]:
    return raise_alerts(queue, [(key, "") for key in keys], at_s, armed=armed)


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
        if REACTION[cause] is reaction:
            assert (ALERTS[cause].priority, ALERTS[cause].sound) == (priority, sound)


def test_hints_are_silent() -> None:
    assert {ALERTS[key].sound for key in (*Hindrance, *RejectReason, *Note)} == {None}
    assert {ALERTS[key].priority for key in (*Hindrance, *RejectReason, *Note)} == {Priority.HINT}


def test_the_same_line_comes_again_only_after_its_cooldown_and_says_how_often_it_was_held_back() -> None:
    queue, first = _raise(AlertQueue(), Cause.HEAD_JUMP, at_s=10.0)
    assert [alert.repeats for alert in first] == [0]
    for at_s in (10.0, 11.0, 12.99):
        queue, held_back = _raise(queue, Cause.HEAD_JUMP, at_s=at_s)
        assert held_back == ()
    queue, again = _raise(queue, Cause.HEAD_JUMP, at_s=13.0)
    assert [alert.repeats for alert in again] == [3]
    _, later = _raise(queue, Cause.HEAD_JUMP, at_s=16.0)
    assert [alert.repeats for alert in later] == [0]


def test_another_line_is_not_held_back() -> None:
    queue, _ = _raise(AlertQueue(), Cause.HEAD_JUMP, at_s=10.0)
    _, alerts = _raise(queue, Cause.HEAD_JUMP, Cause.STOP_PRESSED, at_s=10.1)
    assert [alert.key for alert in alerts] == [Cause.STOP_PRESSED]


def test_the_most_urgent_comes_first_and_only_it_sounds() -> None:
    _, alerts = _raise(AlertQueue(), Cause.DISK_LOW, Cause.HEAD_JUMP, Cause.SEVERAL_ROBOTS, Cause.POOR_VIEW, at_s=1.0)
    assert [alert.key for alert in alerts] == [Cause.SEVERAL_ROBOTS, Cause.HEAD_JUMP, Cause.POOR_VIEW, Cause.DISK_LOW]
    assert [alert.sound for alert in alerts] == ["disarm", None, None, None]


def test_a_silent_line_does_not_take_the_sound() -> None:
    _, alerts = _raise(AlertQueue(), Cause.DISK_LOW, at_s=1.0)
    assert [alert.sound for alert in alerts] == [None]


def test_while_nothing_is_armed_only_a_stop_sounds() -> None:
    _, quiet = _raise(AlertQueue(), Cause.SEVERAL_ROBOTS, Cause.HEAD_JUMP, at_s=1.0, armed=False)
    assert [alert.sound for alert in quiet] == [None, None]
    _, loud = _raise(AlertQueue(), Cause.STOP_PRESSED, Cause.SEVERAL_ROBOTS, at_s=1.0, armed=False)
    assert [alert.sound for alert in loud] == ["stop", None]


def test_a_clock_that_goes_back_holds_nothing_back() -> None:
    queue, _ = _raise(AlertQueue(), Cause.HEAD_JUMP, at_s=1000.0)
    assert len(_raise(queue, Cause.HEAD_JUMP, at_s=5.0)[1]) == 1


def test_the_detail_and_the_text_go_with_the_alert() -> None:
    _, alerts = raise_alerts(AlertQueue(), [(Cause.HOT, "up 71 °C")], 1.0, armed=True)
    assert alerts == (Alert(Cause.HOT, ALERTS[Cause.HOT], "up 71 °C", 0, "disarm"),)


def test_the_queue_that_was_given_is_not_changed() -> None:
    queue = AlertQueue()
    _raise(queue, Cause.HEAD_JUMP, at_s=1.0)
    assert queue == AlertQueue()


def test_a_stop_on_the_screen_does_not_pass_for_an_emergency_stop() -> None:
    assert "power cut" in ALERTS[Cause.STOP_PRESSED].what_to_do


def test_what_ends_a_motion_is_told_each_time_and_nothing_sounds_held_that_was_not() -> None:
    stop, lost = [(Cause.STOP_PRESSED, "")], [(Cause.HEAD_LOST, "")]
    queue, first = raise_alerts(AlertQueue(), stop, 20.0, armed=True, changed=True)
    queue, again = raise_alerts(queue, stop, 24.0, armed=False, changed=True)
    _, held_down = raise_alerts(queue, stop, 24.1, armed=False)
    assert [alert.sound for alert in (*first, *again)] == ["stop", "stop"]
    assert held_down == ()
    queue, by_hand = raise_alerts(AlertQueue(), lost, 0.0, armed=True, driving=False)
    _, driven = raise_alerts(queue, lost, 2.5, armed=True, changed=True)
    assert [alert.sound for alert in (*by_hand, *driven)] == [None, "hold"]
