"""What came in for the pilot since its last turn, from whatever thread."""

from __future__ import annotations

import math
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
    """Everything heard since the turn before.

    ``deadman`` is whether one is held (None: none has ever reported); ``deadman_news`` what to tell the mode machine of it (None:
    nothing was heard that it does not know), and ``deadman_said_s`` when that was said.
    """

    events: list[Event]
    jog: Jog = AT_REST
    deadman: bool | None = None
    deadman_news: bool | None = None
    deadman_said_s: float = -math.inf
    seen: Seen | None = None


class Inbox:
    """Events are kept until they are taken; controls and deadmen are states that must be repeated, since silence means let go.

    A frame's advice comes together with the report that vets it.
    """

    def __init__(self, safety: SafetyConfig, events: Iterable[Event] = ()) -> None:
        self._safety = safety
        self._lock = threading.Lock()
        self._events: list[Event] = list(events)
        self._jogs: dict[Hashable, tuple[Jog, float]] = {}
        self._deadmen = _Deadmen(safety)
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

    def deadman(self, source: Hashable, pressed: bool, now_s: float) -> None:
        """A deadman as it is; one that is held is enough."""
        with self._lock:
            self._deadmen.hear(source, pressed, now_s)

    def take(self, now_s: float) -> Inputs:
        """What came in; the events are gone from here."""
        with self._lock:
            events, self._events = self._events, []
            jogs = [jog for jog, at_s in self._jogs.values() if now_s - at_s <= self._safety.command_max_age_s]
            held, news, said_s = self._deadmen.take(now_s)
            return Inputs(events, combined(jogs), held, news, said_s, self._seen)


class _Deadmen:
    """Several deadmen as one.

    The mode machine itself takes silence for a release, and knows that a press from before arming does not count. So silence is
    not made a release here: a key that is held through a hiccup would come back as a new press. After a longer silence, and when
    it is down at its first word, a deadman is doubted until it was seen released.
    """

    def __init__(self, safety: SafetyConfig) -> None:
        self._safety = safety
        self._said: dict[Hashable, tuple[bool, float]] = {}
        self._doubted: set[Hashable] = set()
        self._spoke: set[Hashable] = set()
        self._released = False

    def hear(self, source: Hashable, pressed: bool, now_s: float) -> None:
        before = self._said.get(source)
        if not pressed:
            self._doubted.discard(source)
            self._released = self._released or (before is not None and before[0])
        elif before is None or (before[0] and now_s - before[1] > self._safety.hold_clear_s):
            self._doubted.add(source)
        self._said[source] = (pressed, now_s)
        self._spoke.add(source)

    def take(self, now_s: float) -> tuple[bool | None, bool | None, float]:
        """Whether one is held (None: there is none), what is new about it, and when that was said."""
        spoke, self._spoke = self._spoke, set()
        released, self._released = self._released, False
        down = {source: at_s for source, (pressed, at_s) in self._said.items() if pressed}
        held = {source for source, at_s in down.items() if now_s - at_s <= self._safety.deadman_timeout_s}
        maybe_held = {source for source, at_s in down.items() if now_s - at_s <= self._safety.hold_clear_s}
        news, said_s = None, now_s
        if sure := (held & spoke) - self._doubted:
            news, said_s = True, max(down[source] for source in sure)
        elif released or (spoke and not maybe_held - self._doubted):
            news = False
        return (bool(held) if self._said else None), news, said_s
