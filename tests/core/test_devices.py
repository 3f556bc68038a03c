import threading

from core.devices import Latest


def test_the_newest_value_wins_and_the_lost_ones_are_counted() -> None:
    slot: Latest[int] = Latest()
    assert slot.put(1) is True
    assert slot.put(2) is False
    assert slot.take() == 2
    assert slot.dropped == 1
    assert slot.take() is None


def test_a_waiting_reader_is_woken() -> None:
    slot: Latest[str] = Latest()
    threading.Timer(0.05, slot.put, ["frame"]).start()
    assert slot.take(timeout_s=10.0) == "frame"
