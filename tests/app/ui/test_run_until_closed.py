"""A window from its opening to its end."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest
from PySide6.QtWidgets import QApplication

from app.ui.window_base import run_until_closed


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


class Window:
    def __init__(self) -> None:
        self.done: list[str] = []

    def show(self) -> None:
        self.done.append("show")

    def start(self) -> None:
        self.done.append("start")

    def shut_down(self) -> None:
        self.done.append("shut down")


def test_what_goes_wrong_after_the_start_leaves_no_thread_running(qapp: QApplication) -> None:
    def fail() -> None:
        raise RuntimeError("no such order")

    window = Window()
    with pytest.raises(RuntimeError, match="no such order"):
        run_until_closed(qapp, window, lambda *_: None, fail)  # type: ignore[arg-type]
    assert window.done == ["show", "start", "shut down"]
    qapp.aboutToQuit.disconnect(window.shut_down)
