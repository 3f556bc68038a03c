"""What a thread has to say to an object of the window, which may be gone by then: Qt destroys it with its window.

A signal that a thread emits of an object that is just being destroyed is that of half-freed memory, and ends the program now and
then. ``QObject.destroyed`` comes too late to prevent it: what makes up the object in Python is gone before. So threads touch no
object of the window at all. They post letters, and the window's own thread, in which objects are destroyed too, reads them out to
those that are still there.
"""

from __future__ import annotations

import atexit
import threading
import weakref
from collections.abc import Callable
from functools import cache
from typing import Generic, TypeVar

import shiboken6
from PySide6.QtCore import QObject, Qt, Signal, Slot

Addressee = TypeVar("Addressee", bound=QObject)


class _Letterbox(QObject):
    """The program's one, of the thread that asks for it first: the window's. It belongs to no window."""

    _posted = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._lock = threading.Lock()
        self._is_open = True
        self._posted.connect(self._read, Qt.ConnectionType.QueuedConnection)
        atexit.register(self._close)  # before PySide's own, which destroys all objects that are left

    def post(self, letter: Callable[[], None]) -> None:
        with self._lock:
            if self._is_open:
                self._posted.emit(letter)

    def _close(self) -> None:
        with self._lock:
            self._is_open = False

    @Slot(object)
    def _read(self, letter: Callable[[], None]) -> None:
        letter()


@cache
def _letterbox() -> _Letterbox:
    return _Letterbox()


class Letters(Generic[Addressee]):
    """Letters to one object, made in its thread and sent from any.

    It keeps no object alive: what the sender holds of it, a thread could have to destroy.
    """

    def __init__(self, addressee: Addressee) -> None:
        self._addressee = weakref.ref(addressee)
        self._letterbox = _letterbox()

    def send(self, say: Callable[[Addressee], None]) -> None:
        """Have `say` called with the object, in the window's thread and in the order of sending; never once it is gone."""
        self._letterbox.post(lambda: self._deliver(say))

    def _deliver(self, say: Callable[[Addressee], None]) -> None:
        addressee = self._addressee()
        if addressee is not None and shiboken6.isValid(addressee):
            say(addressee)
