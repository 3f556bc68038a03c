"""What was advised, asked for, commanded and sent, side by side as texts. No Qt here."""

from __future__ import annotations

from dataclasses import dataclass

from app.cells import NONE, Cell, Tone, number
from app.language import mark, tr, tr_text
from app.wording import SPEED_WORD, side
from core.control.drive_view import DriveView
from core.control.gate_checks import Source
from core.types import Advice, Command

HEADINGS = (mark("bend"), mark("pitch"), mark("advance mm/s"), mark("sheath mm/s"))
LABELS = (mark("Advised"), mark("You asked"), mark("Program"), mark("Sent"))
_SAME_BEND, _SAME_MM_S = 0.03, 0.5
_LASTING = 3
"""Renewals in a row: the speed of a single cycle of the bus swings with its period."""


@dataclass(frozen=True, slots=True)
class ProvenanceRow:
    """``cells`` under the headings; or a ``note`` instead. ``drives``: what was sent comes from here."""

    label: str
    cells: tuple[Cell, ...] = ()
    note: str = ""
    drives: bool = False


class Provenance:
    """Makes the rows; remembers for how long what was sent has differed from what was asked."""

    def __init__(self) -> None:
        self._differing = [0, 0, 0, 0]

    def rows(self, view: DriveView | None) -> tuple[ProvenanceRow, ...]:
        """Four rows in the order of ``LABELS``."""
        if view is None:
            self._differing = [0, 0, 0, 0]
            return tuple(ProvenanceRow(label, note=NONE) for label in LABELS)
        by_operator, by_program = view.sent_by is Source.OPERATOR, view.sent_by is Source.PROGRAM
        wanted = view.asked if by_operator else view.commanded if by_program else None
        return (
            _advised(view),
            ProvenanceRow(LABELS[1], _motion(view.asked, _tone(by_operator)), drives=by_operator),
            ProvenanceRow(LABELS[2], _motion(view.commanded, _tone(by_program)), drives=by_program)
            if view.commanded is not None
            else ProvenanceRow(LABELS[2], note=tr("does not drive")),
            self._sent(view.sent, wanted),
        )

    def _sent(self, sent: Command | None, wanted: Command | None) -> ProvenanceRow:
        if sent is None:
            self._differing = [0, 0, 0, 0]
            return ProvenanceRow(LABELS[3], note=tr("no motion: holding"))
        differs = _differs(sent, wanted) if wanted is not None else (False,) * 4
        self._differing = [count + 1 if now else 0 for count, now in zip(self._differing, differs, strict=True)]
        cells = tuple(
            Cell(f"\N{NOT EQUAL TO} {cell.text}", Tone.WARN, tr("limited by the gate")) if count >= _LASTING else cell
            for cell, count in zip(_motion(sent, Tone.PLAIN), self._differing, strict=True)
        )
        return ProvenanceRow(LABELS[3], cells)


def _tone(drives: bool) -> Tone:
    return Tone.PLAIN if drives else Tone.FAINT


def _advised(view: DriveView) -> ProvenanceRow:
    if view.advice is None:
        return ProvenanceRow(
            LABELS[0], note=tr("no advice: {why}", why=tr_text(str(view.blanked))) if view.blanked else tr("no advice")
        )
    none = Cell(NONE, Tone.FAINT)
    return ProvenanceRow(LABELS[0], (Cell(_turn(view.advice)), none, Cell(_speed(view.advice)), none))


def _turn(advice: Advice) -> str:
    if abs(advice.steer_deg) < 0.5:
        return tr("straight")
    return tr("{angle:.0f}° {side}", angle=abs(advice.steer_deg), side=side(advice.steer_deg))


def _speed(advice: Advice) -> str:
    return f"{number(advice.advance_mm_s, 1)} {tr(SPEED_WORD[advice.speed]).lower()}"


def _motion(command: Command | None, tone: Tone) -> tuple[Cell, ...]:
    if command is None:
        return ()
    return (
        Cell(_share(command.bend, tr("right"), tr("left")), tone),
        Cell(_share(command.pitch, tr("up"), tr("down")), tone),
        Cell(number(command.advance_mm_s, 1), tone),
        Cell(number(command.delivery_mm_s, 1), tone),
    )


def _share(value: float, positive: str, negative: str) -> str:
    if abs(value) < 0.005:
        return "0"
    return f"{abs(value):.2f} {positive if value > 0.0 else negative}"


def _differs(sent: Command, wanted: Command) -> tuple[bool, bool, bool, bool]:
    return (
        abs(sent.bend - wanted.bend) > _SAME_BEND,
        abs(sent.pitch - wanted.pitch) > _SAME_BEND,
        abs(sent.advance_mm_s - wanted.advance_mm_s) > _SAME_MM_S,
        abs(sent.delivery_mm_s - wanted.delivery_mm_s) > _SAME_MM_S,
    )
