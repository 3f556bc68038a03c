"""What came in for the pilot since its last turn, from whatever thread."""

from __future__ import annotations

import threading
from collections.abc import Hashable, Iterable
from dataclasses import dataclass

from core.control.hand import AT_REST, Jog, combined
from core.control.modes import Act, Event
from core.safety_config import SafetyConfig
from core.types import Advice


@dataclass(frozen=True, slots=True)
class Seen:
    """The newest frame that was understood: when it was captured, the advice for it, whether the destination is reached."""

    captured_s: float
    advice: Advice | None
    arrived: bool


@dataclass(frozen=True, slots=True)
class Inputs:
    """Everything heard since the turn before."""

    events: list[Event]
    jog: Jog = AT_REST
    seen: Seen | None = None


class Inbox:
    """Events are kept until they are taken; controls are states that must be repeated, since silence means let go.

    A frame's advice comes together with the report that vets it.
    """

    def __init__(self, safety: SafetyConfig, events: Iterable[Event] = ()) -> None:
        self._safety = safety
        self._lock = threading.Lock()
        self._events: list[Event] = list(events)
        self._jogs: dict[Hashable, tuple[Jog, float]] = {}
        self._seen: Seen | None = None

    def post(self, *events: Event) -> None:
        with self._lock:
            self._events += events

    def see(self, seen: Seen, *events: Event) -> None:
        """A frame was understood; `events` report it."""
        with self._lock:
            self._seen = seen
            self._events += events

    def forget_seen(self) -> None:
        """What was advised until now was for another destination."""
        with self._lock:
            self._seen = None

    def jog(self, source: Hashable, jog: Jog, now_s: float) -> None:
        """How a control is held. Even the shortest touch is an input of the operator."""
        with self._lock:
            self._jogs[source] = (jog, now_s)
            if not jog.is_rest:
                self._events.append(Act.INPUT)

    def take(self, now_s: float) -> Inputs:
        """What came in; the events are gone from here."""
        with self._lock:
            events, self._events = self._events, []
            jogs = [jog for jog, at_s in self._jogs.values() if now_s - at_s <= self._safety.command_max_age_s]
            return Inputs(events, combined(jogs), self._seen)
