"""Where every command comes from (advised, asked for, commanded, sent), and what the gate limited or rejected."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QPainter
from PySide6.QtWidgets import QWidget

from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import SPEED_WORD, joint_title, side, tip
from app.ui.workers import Pace
from app.widgets.basics import card_note, column
from app.widgets.painting import NONE, PaintedWidget, draw_bar, draw_text, draw_track, number, polygon, set_colours
from app.widgets.servo_table import TONE_ROLE, Cell, Tone
from core.config.safety import ServosConfig
from core.control.drive_view import DriveView
from core.control.gate import RejectReason, Source
from core.types import Command

if TYPE_CHECKING:
    from hardware.servos.bus_ipc import BusStatus


HEADINGS = (mark("bend"), mark("pitch"), mark("advance mm/s"), mark("sheath mm/s"))
LABELS = (mark("Advised"), mark("You asked"), mark("Program"), mark("Sent"))
_SAME_BEND, _SAME_MM_S = 0.03, 0.5  # smaller differences are not marked
_LASTING = 3  # renewals in a row: the speed of a single cycle of the bus swings with its period


@dataclass(frozen=True, slots=True)
class ProvenanceRow:
    """``cells`` under the headings, or a ``note``. ``drives``: the source of the command that was sent."""

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
        commanded = ProvenanceRow(LABELS[2], note=tr("does not drive"))
        if view.program_command is not None:
            tone = Tone.PLAIN if by_program else Tone.FAINT
            commanded = ProvenanceRow(LABELS[2], _motion(view.program_command, tone), drives=by_program)
        return (
            _advised(view),
            ProvenanceRow(LABELS[1], _motion(view.operator_command, Tone.PLAIN if by_operator else Tone.FAINT), drives=by_operator),
            commanded,
            self._sent(view.sent, view.operator_command if by_operator else view.program_command if by_program else None),
        )

    def _sent(self, sent: Command | None, wanted: Command | None) -> ProvenanceRow:
        if sent is None:
            self._differing = [0, 0, 0, 0]
            return ProvenanceRow(LABELS[3], note=tr("no motion: holding"))
        differs = (False,) * 4
        if wanted is not None:
            differs = (
                abs(sent.bend - wanted.bend) > _SAME_BEND,
                abs(sent.pitch - wanted.pitch) > _SAME_BEND,
                abs(sent.advance_mm_s - wanted.advance_mm_s) > _SAME_MM_S,
                abs(sent.delivery_mm_s - wanted.delivery_mm_s) > _SAME_MM_S,
            )
        self._differing = [count + 1 if now else 0 for count, now in zip(self._differing, differs, strict=True)]
        cells = tuple(
            Cell(f"\N{NOT EQUAL TO} {cell.text}", Tone.WARN, tr("limited by the gate")) if count >= _LASTING else cell
            for cell, count in zip(_motion(sent, Tone.PLAIN), self._differing, strict=True)
        )
        return ProvenanceRow(LABELS[3], cells)


def _advised(view: DriveView) -> ProvenanceRow:
    advice, none = view.advice, Cell(NONE, Tone.FAINT)
    if advice is None:
        why = tr("no advice: {why}", why=tr_text(str(view.blanked))) if view.blanked else tr("no advice")
        return ProvenanceRow(LABELS[0], note=why)
    turn = tr("straight")
    if abs(advice.steer_deg) >= 0.5:
        turn = tr("{angle:.0f}° {side}", angle=abs(advice.steer_deg), side=side(advice.steer_deg))
    speed = f"{number(advice.advance_mm_s, 1)} {tr(SPEED_WORD[advice.speed]).lower()}"
    return ProvenanceRow(LABELS[0], (Cell(turn), none, Cell(speed), none))


def _motion(command: Command | None, tone: Tone) -> tuple[Cell, ...]:
    if command is None:
        return ()
    texts = (
        _share(command.bend, tr("right"), tr("left")),
        _share(command.pitch, tr("up"), tr("down")),
        number(command.advance_mm_s, 1),
        number(command.delivery_mm_s, 1),
    )
    return tuple(Cell(text, tone) for text in texts)


def _share(value: float, positive: str, negative: str) -> str:
    if abs(value) < 0.005:
        return "0"
    return f"{abs(value):.2f} {positive if value > 0.0 else negative}"


_SHOW_EVERY_S = 0.2
_IDLE = frozenset({RejectReason.NO_COMMAND, RejectReason.NOT_ARMED})  # nothing was asked for, so nothing was refused


@dataclass(frozen=True, slots=True)
class GateEvent:
    """Something that the gate limited or rejected: what it is a repetition of, in words, and how often."""

    key: Hashable
    text: str
    times: int = 1


class GateEvents:
    """What the gate has limited and rejected, from every status that the window receives.

    Those are fewer than the cycles of the bus, so clamps are samples; ``BusStatus.clamp_count`` counts all of them. Rejections
    are taken from the status' own counts, and none is missed.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._pace = Pace(_SHOW_EVERY_S, clock)
        self._cycle: int | None = None
        self._rejections: dict[RejectReason, int] = {}
        self._waiting: dict[Hashable, GateEvent] = {}

    def since_last(self, status: BusStatus, servos: ServosConfig) -> list[GateEvent]:
        """What is to be told now: nothing more than five times a second."""
        for event in self._found(status, servos):
            times = event.times + (self._waiting[event.key].times if event.key in self._waiting else 0)
            self._waiting[event.key] = replace(event, times=times)
        if not self._waiting or not self._pace.due():
            return []
        told, self._waiting = list(self._waiting.values()), {}
        return told

    def _found(self, status: BusStatus, servos: ServosConfig) -> list[GateEvent]:
        if self._cycle is None or status.cycle < self._cycle:  # the first of a bus process: what it counted before is no news
            self._rejections = dict(status.rejections)
        elif status.cycle == self._cycle:
            return []
        self._cycle, found = status.cycle, []
        units = {joint.name: joint.unit for joint in servos.joints}
        for clamp in status.clamps:
            unit = " mm" if (unit := units.get(clamp.joint, "mm")) == "mm" else unit
            change = f"{number(clamp.asked_mm, 2)} \N{RIGHTWARDS ARROW} {number(clamp.allowed_mm, 2)}{unit}"
            text = f"{joint_title(clamp.joint)}: {change}, {tr_text(clamp.limit.value)}"
            found.append(GateEvent((clamp.joint, clamp.limit), text))
        for joint in status.at_end:
            found.append(GateEvent((joint, "end"), f"{joint_title(joint)}: {tr('stopped at the end of its envelope')}"))
        for reason, count in status.rejections.items():
            more = count - self._rejections.get(reason, 0)
            if more > 0 and reason not in _IDLE:
                known = status.rejection is not None and status.rejection.reason is reason and status.rejection.detail
                why = tr_text(f"{reason.value}: {known}" if known else reason.value)
                found.append(GateEvent(reason, f"{tr('rejected')}: {why}", more))
        self._rejections = dict(status.rejections)
        return found


LATENCY_LIMIT_MS = 100.0
_LABEL_WIDTH = 100.0
_ROWS = 6  # headings, four rows, measures


class ProvenanceTable(PaintedWidget):
    """Advised, asked, commanded and sent; below it the latency from capture to servo, and how much of the advice is followed.

    A mark stands before the row that drives; what the gate sent differently is marked with an unequal sign.
    """

    ground = "PANEL"

    def __init__(self) -> None:
        name, explanation = tr("Advice, commands and what was sent"), tip("commands", "capture_to_servo", "following")
        super().__init__(name, explanation, hint=(440, _ROWS * 20), least=(300, _ROWS * 17))
        self._rows: tuple[ProvenanceRow, ...] = tuple(ProvenanceRow(label, note=NONE) for label in LABELS)
        self._latency_ms: float | None = None
        self._follow: float | None = None

    @property
    def text(self) -> str:
        """All that is shown, as lines."""
        lines = [
            f"{tr('drives: ') if row.drives else ''}{tr(row.label)}: "
            + (row.note or ", ".join(f"{tr(head)} {cell.text}" for head, cell in zip(HEADINGS, row.cells, strict=True)))
            for row in self._rows
        ]
        return "\n".join([*lines, self._latency_text, self._follow_text])

    @property
    def _is_late(self) -> bool:
        return self._latency_ms is not None and self._latency_ms > LATENCY_LIMIT_MS

    @property
    def _latency_text(self) -> str:
        time = NONE if self._latency_ms is None else f"{'! ' if self._is_late else ''}{self._latency_ms:.0f} ms"
        return tr("capture \N{RIGHTWARDS ARROW} servo {time}", time=time)

    @property
    def _follow_text(self) -> str:
        share = NONE if self._follow is None else f"{100 * self._follow:.0f} %"
        return tr("following the advice {share}", share=share)

    def show_rows(self, rows: tuple[ProvenanceRow, ...], latency_ms: float | None, follow: float | None) -> None:
        """Repaints when something changed that can be read."""
        latency_ms = None if latency_ms is None else float(round(latency_ms))
        follow = None if follow is None else round(follow, 2)
        if (rows, latency_ms, follow) != (self._rows, self._latency_ms, self._follow):
            self._rows, self._latency_ms, self._follow = rows, latency_ms, follow
            self.setAccessibleDescription(self.text)
            self.update()

    def paint(self, painter: QPainter) -> None:
        height = self.height() / _ROWS
        width = (self.width() - _LABEL_WIDTH) / len(HEADINGS)
        for k, heading in enumerate(HEADINGS):
            draw_text(painter, QRectF(_LABEL_WIDTH + k * width, 0, width, height), tr(heading), theme.font(11), theme.TEXT_FAINT)
        for k, row in enumerate(self._rows):
            _paint_row(painter, QRectF(0, (k + 1) * height, self.width(), height), row, width, is_sent=k == len(self._rows) - 1)
        box, font = QRectF(0, 5 * height, self.width(), height), theme.semi_bold(12)
        draw_text(painter, box.adjusted(4, 0, 0, 0), self._latency_text, font, theme.FAULT if self._is_late else theme.TEXT_DIM)
        left = max(170.0, box.width() * 0.42)
        draw_text(painter, QRectF(left, box.top(), 166, height), self._follow_text, font, theme.TEXT_DIM)
        track = QRectF(left + 170, box.center().y() - 4, box.right() - left - 170, 8)
        draw_track(painter, track)
        if self._follow is not None:
            draw_bar(painter, track, self._follow, theme.SKY)


def _paint_row(painter: QPainter, box: QRectF, row: ProvenanceRow, width: float, *, is_sent: bool) -> None:
    if is_sent:
        painter.fillRect(box, theme.colour(theme.RAISED, 0.8))
    size, strong = 14 if box.height() >= 22 else 13, row.drives or is_sent
    plain = theme.semi_bold(size) if strong else theme.font(size)
    if row.drives:
        set_colours(painter, theme.SKY)
        painter.drawPolygon(polygon([(-4.0, -5.0), (5.0, 0.0), (-4.0, 5.0)], QPointF(box.left() + 7, box.center().y())))
    colour = theme.SKY if row.drives else theme.TEXT if is_sent else theme.TEXT_DIM
    draw_text(painter, box.adjusted(16, 0, 0, 0), tr(row.label), plain, colour)
    if not row.cells:
        draw_text(painter, box.adjusted(_LABEL_WIDTH, 0, 0, 0), row.note, theme.font(size), theme.TEXT_FAINT, elided=True)
    for k, cell in enumerate(row.cells):
        place = QRectF(_LABEL_WIDTH + k * width, box.top(), width - 4, box.height())
        font = theme.semi_bold(size) if cell.tone >= Tone.WARN else plain
        draw_text(painter, place, cell.text, font, theme.of(TONE_ROLE[cell.tone]), smallest_px=11)


class CommandPanel(QWidget):
    """Advised, asked, commanded and sent in one table; below it how often the gate limited and rejected.

    ``show_view`` may be called at any rate: texts are renewed five times a second at most.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._pace = Pace(_SHOW_EVERY_S, clock)
        self._provenance = Provenance()
        self._known = False
        self._table = ProvenanceTable()
        self._heading = card_note(_heading(None))
        self._heading.setFixedHeight(16)
        self._heading.setToolTip(tr("What it did stands in the page Log"))
        self.setLayout(column((self._table, 1), self._heading, spacing=3))
        self.setAccessibleName(tr("Commands"))

    @property
    def text(self) -> str:
        """The provenance table and the line on the gate, as lines."""
        return f"{self._table.text}\n{self._heading.text()}"

    def show_view(self, view: DriveView | None, status: BusStatus | None) -> None:
        """The newest state of driving and of the bus; None without a robot, or without a bus."""
        known = view is not None
        if not self._pace.due() and known is self._known:
            return
        self._known = known
        latency_ms = 1000.0 * view.latency_s if view is not None and view.latency_s is not None else None
        self._table.show_rows(self._provenance.rows(view), latency_ms, view.follow_share if view is not None else None)
        heading = _heading(status)
        if heading != self._heading.text():
            self._heading.setText(heading)


def _heading(status: BusStatus | None) -> str:
    if status is None:
        return tr("Gate: no servo bus")
    rejected = sum(count for reason, count in status.rejections.items() if reason not in _IDLE)
    if not status.clamp_count and not rejected:
        return tr("Gate: nothing limited or rejected yet")
    return tr("Gate: {clamped} goals limited, {rejected} commands rejected", clamped=status.clamp_count, rejected=rejected)
