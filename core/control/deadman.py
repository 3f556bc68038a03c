"""The deadmen: keys, pedals and buttons, one of which must be held while the program drives. Pure.

Each is judged by itself, for what one says is no word about another. A press counts when it began while armed, after a release that
this deadman itself has told: what was down before may be a bag on the pedal. Silence, damage and a pulled plug tell nothing of the
hand or foot: nobody holds that deadman meanwhile, but afterwards it is what it was before them, no new press. After a long
interruption nobody knows whether it was let go, and it is as at the start.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, replace

FORGOTTEN_S = 0.5
"""Nothing is known any more of a deadman that told nothing for longer.

Not a setting: a hold may be asked to clear itself sooner, or never, but below a deadman's own period no press would ever count.
"""


@dataclass(frozen=True, slots=True)
class DeadmanReport:
    """A deadman as it is; repeated many times a second, for silence counts as released.

    ``pressed`` is None when it cannot tell, as a pedal with a damaged report: then nobody holds it, but it was not let go either.
    ``said_s`` is when it was said, which may be a turn of the pilot earlier (None: now), and ``source`` which deadman it is.
    """

    pressed: bool | None
    said_s: float | None = None
    source: Hashable = ""

    def at_s(self, now_s: float) -> float:
        """When it was said, for who hears it now."""
        return now_s if self.said_s is None else min(self.said_s, now_s)


@dataclass(frozen=True, slots=True)
class Deadman:
    """What is known of one.

    ``pressed`` is the last that it told (None: nothing yet, or too long ago), at ``reported_s``. ``counts``: the press began while
    armed. ``interrupted``: since then it could not tell.
    """

    pressed: bool | None = None
    reported_s: float = 0.0
    counts: bool = False
    interrupted: bool = False

    def is_down(self, now_s: float, timeout_s: float) -> bool:
        """Is it down as far as it tells, and heard of within `timeout_s`? Whether that counts is another question."""
        return self.pressed is True and not self.interrupted and now_s - self.reported_s <= timeout_s


def see_deadman(deadman: Deadman, pressed: bool | None, said_s: float, *, armed: bool) -> Deadman:
    """What is known of a deadman after its report."""
    known = deadman if said_s - deadman.reported_s <= FORGOTTEN_S else Deadman()
    if pressed is None:
        return replace(known, interrupted=True)
    return Deadman(pressed, said_s, pressed and (known.counts or (known.pressed is False and armed)))


def is_held(deadmen: Iterable[Deadman], now_s: float, timeout_s: float) -> bool:
    """Is one of them held, by a press that began while armed?"""
    return any(deadman.counts and deadman.is_down(now_s, timeout_s) for deadman in deadmen)
