"""Texts with a tone, which tables of the operator window are made of. No Qt here."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

NONE = "\N{EN DASH}"


class Tone(IntEnum):
    """How a text is meant. What warns also carries a sign: colour alone says nothing to some."""

    FAINT = 0
    PLAIN = 1
    WARN = 2
    BAD = 3


SIGN = {Tone.FAINT: "", Tone.PLAIN: "", Tone.WARN: "!", Tone.BAD: "!!"}
TONE_ROLE = {Tone.FAINT: "TEXT_FAINT", Tone.PLAIN: "TEXT", Tone.WARN: "ORANGE", Tone.BAD: "FAULT"}
"""Colours, as roles of the palette."""


@dataclass(frozen=True, slots=True)
class Track:
    """Where a joint is within its envelope, in shares 0..1 from its low to its high end; beyond 0..1 it is outside."""

    at: float
    goal: float | None
    low_warn: float
    high_warn: float


@dataclass(frozen=True, slots=True)
class Cell:
    text: str
    tone: Tone = Tone.PLAIN
    tip: str = ""
    track: Track | None = None


Row = tuple[Cell, ...]


def number(value: float, digits: int) -> str:
    """No minus before a zero, and a real minus sign."""
    value = round(value, digits) + 0.0
    return f"{value:.{digits}f}".replace("-", "\N{MINUS SIGN}")
