"""What came in for the pilot since its last turn, from whatever thread."""

from __future__ import annotations

import threading
from collections.abc import Hashable, Iterable
from dataclasses import dataclass

from core.control.hand import AT_REST, Jog, combined
from core.control.modes import Act, Event
from core.safety_config import SafetyConfig


@dataclass(frozen=True, slots=True)
class Inputs:
    """Everything heard since the turn before; ``deadman`` None: no deadman has ever reported."""

    events: list[Event]
    jog: Jog = AT_REST
    deadman: bool | None = None


class Inbox:
    """Events are kept until they are taken; controls and deadmen are states that must be repeated, since silence means let go."""

    def __init__(self, safety: SafetyConfig, events: Iterable[Event] = ()) -> None:
        self._safety = safety
        self._lock = threading.Lock()
        self._events: list[Event] = list(events)
        self._jogs: dict[Hashable, tuple[Jog, float]] = {}
        self._deadmen: dict[Hashable, tuple[bool, float]] = {}

    def post(self, *events: Event) -> None:
        with self._lock:
            self._events += events

    def jog(self, source: Hashable, jog: Jog, now_s: float) -> None:
        """How a control is held. Even the shortest touch is an input of the operator."""
        with self._lock:
            self._jogs[source] = (jog, now_s)
            if not jog.is_rest:
                self._events.append(Act.INPUT)

    def deadman(self, source: Hashable, pressed: bool, now_s: float) -> None:
        """A deadman as it is; one that is held is enough."""
        with self._lock:
            self._deadmen[source] = (pressed, now_s)

    def take(self, now_s: float) -> Inputs:
        """What came in; the events are gone from here."""
        safety = self._safety
        with self._lock:
            events, self._events = self._events, []
            jog = combined(jog for jog, at_s in self._jogs.values() if now_s - at_s <= safety.command_max_age_s)
            held = [pressed and now_s - at_s <= safety.deadman_timeout_s for pressed, at_s in self._deadmen.values()]
        return Inputs(events, jog, any(held) if held else None)
