"""Keeps what the thread of an input device reports, for tests that wait for it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Listener(Generic[T]):
    def __init__(self) -> None:
        self.states: list[T] = []
        self._news = threading.Condition()

    def state(self, state: T) -> None:
        self.add(self.states, state)

    def add(self, kept: list, item: object) -> None:
        with self._news:
            kept.append(item)
            self._news.notify()

    def until(self, what: Callable[[], bool]) -> None:
        with self._news:
            assert self._news.wait_for(what, 5.0), self.__dict__
