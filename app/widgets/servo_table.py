"""The servos: what each reports, the balance of the tendon pairs, the bus itself, and what can be done about them.

A bus status becomes a row of cells for each joint, the balance of its tendons and one line; the widgets below show them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, IntEnum
from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QHideEvent, QPainter, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLabel,
    QMenu,
    QStackedLayout,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.ui import theme
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import joint_title, tip
from app.ui.workers import Pace
from app.widgets.basics import column, holder, line, text_button
from app.widgets.messages import BUTTON_STYLE, QuestionStrip
from app.widgets.painting import (
    LEFT,
    NONE,
    RIGHT,
    PaintedWidget,
    draw_middle_bar,
    draw_text,
    draw_tick,
    draw_track,
    number,
    set_colours,
    text_width,
)
from app.widgets.zero_dialog import ZeroDialog, joint_zeros
from core.config.safety import LIMITS_FORCE, JointConfig, JointKind, JointName, SafetyConfig, ServosConfig
from core.config.servo_models import PWM_FULL
from core.control.joints import status_at
from core.types import RobotStatus
from hardware.servos.registers import HardwareError, MissingServo, ServoReading, ServoState, wire_force_mn

if TYPE_CHECKING:
    from hardware.servos.bus_ipc import BusStatus


class Tone(IntEnum):
    """How urgent a text is. A warning also carries a sign, as some operators see no difference in colour."""

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


SILENT_AFTER_S = 1.0  # age from which on a status of the bus is not shown
_CYCLE_P99_LIMIT_MS = 30.0
_LONG_TRAVEL_MM = 50.0  # of a feed; tendons travel less
_TRACK_STEPS = 200.0  # resolution of the bar of a joint's position


class Column(Enum):
    """The columns in order: heading, explanation, least width in px, and share of what is left."""

    JOINT = (mark("Joint"), mark("Joint, and id of its servo on the bus"), 70, 0.10)
    POSITION = (
        mark("Position mm"),
        mark("Where the joint is, and where that is within its envelope; darker ends: there it is slowed down"),
        78,
        0.25,
    )
    GOAL = (mark("Goal mm"), mark("The goal that the servo has taken"), 52, 0.07)
    CURRENT = ("mA", mark("Motor current in mA"), 42, 0.05)
    TEMPERATURE = ("°C", mark("Temperature of the servo in °C"), 34, 0.05)
    VOLTAGE = ("V", mark("Supply voltage at the servo in V"), 40, 0.05)
    TORQUE = (mark("Torque"), mark("Whether the motor holds"), 42, 0.04)
    ZERO = (mark("Zero"), mark("Whether the joint has been zeroed since the servo was switched on"), 32, 0.04)
    ERROR = (mark("Error"), mark("What the servo reports, or that it does not answer"), 56, 0.35)


_ERROR_WORDS = {
    HardwareError.OVERLOAD: (mark("overload"), mark("overload: the motor was pulled too hard for too long; free the wire")),
    HardwareError.OVERHEATING: (mark("overheating"), mark("overheating: let the servo cool down")),
    HardwareError.INPUT_VOLTAGE: (mark("input voltage"), mark("input voltage out of range: check the power supply")),
    HardwareError.ELECTRICAL_SHOCK: (
        mark("electric shock"),
        mark("electric shock on the circuit, or too little power for the motor"),
    ),
    HardwareError.ENCODER: (mark("encoder"), mark("encoder: the servo does not know where it is; have it repaired")),
}


def error_words(error: HardwareError) -> str:
    """The error bits as a few words, worst first; empty without an error."""
    words = [tr(short) for flag, (short, _) in _ERROR_WORDS.items() if error & flag]
    rest = int(error) & ~sum(int(flag) for flag in _ERROR_WORDS)
    return ", ".join(words + ([tr("error {number}", number=rest)] if rest else []))


def servo_rows(status: BusStatus | None, servos: ServosConfig, safety: SafetyConfig) -> tuple[Row, ...]:
    """Rows in the order of the joints, each with a cell for every column; dashes where nothing is known."""
    nothing, is_told = (None,) * len(servos.joints), status is not None and len(status.servos) == len(servos.joints)
    readings: tuple[ServoReading | None, ...] = status.servos if status is not None and is_told else nothing
    zeroed: tuple[bool | None, ...] = status.zeroed if status is not None and is_told else nothing
    armed = status is not None and status.armed
    rows = []
    for joint, reading, is_zeroed in zip(servos.joints, readings, zeroed, strict=True):
        if isinstance(reading, ServoState):
            rows.append(_known(joint, reading, bool(is_zeroed), armed, servos, safety))
        else:
            rows.append(_unknown(joint, reading))
    return tuple(rows)


def known_joints(status: BusStatus | None, servos: ServosConfig, now_s: float) -> tuple[bool, ...]:
    """Which joints have a known position: those that are zeroed, and whose servo has answered lately.

    Without a bus all of them: such a robot reports its own position. `now_s` is by the clock of ``BusStatus.time_s``.
    """
    if status is None:
        return (True,) * len(servos.joints)
    if len(status.servos) != len(servos.joints) or now_s - status.time_s > SILENT_AFTER_S:
        return (False,) * len(servos.joints)
    return tuple(zeroed and isinstance(reading, ServoState) for reading, zeroed in zip(status.servos, status.zeroed, strict=True))


def status_by_servos(status: BusStatus | None, servos: ServosConfig) -> RobotStatus | None:
    """The robot's status from its servos alone, while there is no picture; None when not all of them answer.

    The position of a joint that is not zeroed is meaningless: see ``known_joints``.
    """
    states = [reading for reading in status.servos if isinstance(reading, ServoState)] if status is not None else []
    if status is None or len(states) != len(servos.joints):
        return None
    return status_at([state.position_mm or 0.0 for state in states], (0.0,) * len(servos.tendons), status.time_s, servos)


def _known(joint: JointConfig, state: ServoState, zeroed: bool, armed: bool, servos: ServosConfig, safety: SafetyConfig) -> Row:
    hot, low = servos.hottest_c(joint), servos.lowest_v(joint)
    warm, sags = hot - safety.temperature_warn_margin_c, low + safety.voltage_warn_margin_v
    heat = Tone.BAD if state.temperature_c >= hot else Tone.WARN if state.temperature_c >= warm else Tone.PLAIN
    volts = Tone.BAD if state.voltage_v <= low else Tone.WARN if state.voltage_v <= sags else Tone.PLAIN
    error, limit = _error(state), servos.force_limit(joint)
    if servos.driver not in LIMITS_FORCE:
        current = Cell(NONE, tip=tr("this drive cannot limit its force"))
    elif state.current_ma is None or limit.current_ma is None or limit.strain_ma is None:
        duty = 100.0 * limit.units / PWM_FULL
        most = tr("the servo gives {force:.0f} N at most ({duty:.0f} % of its duty)", force=limit.force_n, duty=duty)
        current = Cell(NONE, tip=_of_joint(joint, most))
    else:
        strain = Tone.BAD if abs(state.current_ma) > limit.strain_ma else Tone.PLAIN
        most = tr("the servo gives {force:.0f} N at most ({most:.0f} mA)", force=limit.force_n, most=limit.current_ma)
        current = _signed(number(state.current_ma, 0), strain, _of_joint(joint, most))
    return (
        Cell(_name(joint), max(Tone.PLAIN, heat, volts, error.tone)),
        _position(joint, state),
        Cell(_mm(joint, state.goal_mm), Tone.PLAIN if armed else Tone.FAINT),
        current,
        _signed(f"{state.temperature_c:.0f}", heat, tr("warning from {warm:g} °C, limit {hot:g} °C", warm=warm, hot=hot)),
        _signed(f"{state.voltage_v:.1f}", volts, tr("warning from {sags:g} V, limit {low:g} V", sags=sags, low=low)),
        Cell(tr("on")) if state.torque else _signed(tr("off"), Tone.BAD if armed else Tone.FAINT),
        Cell(tr("yes")) if zeroed else _signed(tr("no"), Tone.WARN, tr("its zero must be confirmed or set before arming: Zero...")),
        error,
    )


def _unknown(joint: JointConfig, reading: MissingServo | None) -> Row:
    blank = (Cell(NONE, Tone.FAINT),) * (len(Column) - 2)
    if reading is None:
        return (Cell(_name(joint), Tone.FAINT), *blank, Cell(NONE, Tone.FAINT))
    if reading.restarted:
        error = Cell(tr("restarted"), Tone.BAD, tr("the servo restarted: zero its joint again"))
    else:
        why = tr("{reason}, {misses} times in a row", reason=tr_text(reading.reason), misses=reading.misses)
        error = Cell(tr("silent"), Tone.BAD, why)
    return (Cell(_name(joint), Tone.BAD), *blank, error)


def _position(joint: JointConfig, state: ServoState) -> Cell:
    at, low, high, margin = state.position_mm, joint.low_mm, joint.high_mm, joint.warn_margin_mm
    if at is None:
        return Cell(NONE, Tone.FAINT, tr("not known before the joint is zeroed"))
    tone = Tone.BAD if not low <= at <= high else Tone.PLAIN if low + margin <= at <= high - margin else Tone.WARN

    def share(mm: float) -> float:
        return round((mm - low) / (high - low) * _TRACK_STEPS) / _TRACK_STEPS

    goal = None if state.goal_mm is None else share(state.goal_mm)
    explanation = tr(
        "envelope {low_mm:g} to {high_mm:g} mm, slow within {margin:g} mm of its ends", low_mm=low, high_mm=high, margin=margin
    )
    explanation = _of_joint(joint, explanation)
    track = Track(share(at), goal, share(low + margin), share(high - margin))
    return Cell(SIGN[tone] + _mm(joint, at), tone, explanation, track)


def _error(state: ServoState) -> Cell:
    if state.error:
        tips = [tr(long) for flag, (_, long) in _ERROR_WORDS.items() if state.error & flag]
        return Cell(error_words(state.error), Tone.BAD, "\n".join(tips) or tr("see the servo's manual: hardware error status"))
    if state.watchdog_tripped:
        return Cell(tr("bus watchdog"), Tone.BAD, tr("nobody talked to the servo: arm again"))
    return Cell(tr("none"), Tone.FAINT)


def _signed(text: str, tone: Tone, tip: str = "") -> Cell:
    return Cell(SIGN[tone] + text, tone, tip)


def _name(joint: JointConfig) -> str:
    return f"{joint_title(joint.name)} \N{MIDDLE DOT} {joint.id}"


def _of_joint(joint: JointConfig, text: str) -> str:
    """A text about a tendon or feed in the units of the joint: a rotation has degrees for mm and N mm for N."""
    if joint.kind is not JointKind.ROTATION:
        return text
    return text.replace(" mm", "°").replace(" N ", f" {joint.force_unit} ")


def _mm(joint: JointConfig, value_mm: float | None) -> str:
    """Hundredths for a tendon, tenths for a feed, and degrees of a rotation, which say so under a heading in mm."""
    if value_mm is None:
        return NONE
    text = number(value_mm, 1 if joint.high_mm - joint.low_mm > _LONG_TRAVEL_MM else 2)
    return f"{text}°" if joint.kind is JointKind.ROTATION else text


@dataclass(frozen=True, slots=True)
class PairBalance:
    """Wires that pull against each other, two or three. ``sum_mm`` of their pulls should be ``wanted_mm``, as often the pretension.

    None: not known. ``forces_n`` of the wires are computed from the motors' currents, friction included.
    """

    names: tuple[JointName, ...]
    wanted_mm: float
    sum_mm: float | None = None
    forces_n: tuple[float, ...] | None = None
    tone: Tone = Tone.FAINT

    @property
    def share(self) -> float | None:
        """Excess over the wanted sum: -1 no tension left, 0 as wanted, 1 twice as much."""
        if self.sum_mm is None:
            return None
        return (self.sum_mm - self.wanted_mm) / max(self.wanted_mm, 0.1)

    @property
    def word(self) -> str:
        if self.sum_mm is None or self.tone < Tone.WARN:
            return ""
        return tr("slack") if self.sum_mm < self.wanted_mm else tr("too tight")

    @property
    def title(self) -> str:
        return " + ".join(map(joint_title, self.names))

    @property
    def total(self) -> str:
        return NONE if self.sum_mm is None else number(self.sum_mm, 2)

    @property
    def sum(self) -> str:
        return tr("{total} of {wanted_mm:.2f} mm", total=self.total, wanted_mm=self.wanted_mm)

    @property
    def forces(self) -> str:
        if self.forces_n is None:
            return ""
        return " / ".join(number(force, 1 if abs(force) < 100.0 else 0) for force in self.forces_n) + " N"

    @property
    def text(self) -> str:
        return ", ".join(part for part in (f"{self.title}: {self.sum}", self.word, self.forces) if part)


def pair_balances(status: BusStatus | None, servos: ServosConfig) -> tuple[PairBalance, ...]:
    """Opposite tendons, or all three. Before arming nothing is pretensioned, so slack wires are no warning then."""
    count = len(servos.tendons)
    size = 3 if count == 3 else 2
    return tuple(_balance(status, servos, slice(place, place + size)) for place in range(0, count, size))


def _balance(status: BusStatus | None, servos: ServosConfig, places: slice) -> PairBalance:
    joints = servos.joints[places]
    balance = PairBalance(tuple(joint.name for joint in joints), len(joints) * servos.pretension_mm)
    states = [state for state in (status.servos[places] if status is not None else ()) if isinstance(state, ServoState)]
    at_mm = [state.position_mm for state in states if state.position_mm is not None]
    if status is None or len(at_mm) < len(joints):
        return balance
    pulled = [
        wire_force_mn(joint, servos.model_of(joint), state.current_ma) / 1000.0
        for joint, state in zip(joints, states, strict=True)
        if state.current_ma is not None
    ]
    forces = tuple(pulled) if len(pulled) == len(joints) else None
    known = replace(balance, sum_mm=sum(at_mm), forces_n=forces)
    if not status.armed:
        return known
    off = abs(known.share or 0.0)
    return replace(known, tone=Tone.BAD if off >= 1.0 else Tone.WARN if off > 0.5 else Tone.PLAIN)


def bus_line(status: BusStatus | None, silence_s: float | None = None) -> Cell:
    """Phase, timing and counts of the bus in one line; `silence_s` is how long ago it was heard, when that is too long."""
    if status is None:
        return Cell(tr("no servo bus: nothing is known about the servos"), Tone.FAINT)
    if silence_s is not None:
        return Cell(tr("!! nothing heard from the servo bus for {seconds:.0f} s", seconds=silence_s), Tone.BAD)
    slow = status.times.period_p99_ms > _CYCLE_P99_LIMIT_MS
    timing = tr(
        "cycle {half:.1f} ms, {sign}p99 {most:.1f} ms",
        half=status.times.period_p50_ms,
        sign="! " if slow else "",
        most=status.times.period_p99_ms,
    )
    parts = [
        tr("bus {phase}", phase=tr_text(status.phase.value)),
        timing if status.times.period_p50_ms > 0.0 else tr("cycle not measured yet"),
        tr("bad packets {count}", count=status.bad_packets),
        tr("clamps {count}", count=status.clamp_count),
    ]
    whole = f"  {chr(0xB7)}  ".join(parts)
    tip = f"{whole}\n" + tr("cycle: half of the periods of the last ten seconds were shorter than the first, 99 % than p99")
    if broken := [f"{joint_title(r.name)} {error_words(r.error)}" for r in status.servos if isinstance(r, ServoState) and r.error]:
        return Cell(f"!! {'; '.join(broken)}", Tone.BAD, tip)  # for which a narrow table has no room
    return Cell(whole, Tone.WARN if slow else Tone.PLAIN, tip)


_COLUMNS = tuple(Column)
_LEFT = {Column.JOINT, Column.ERROR}
_HEADER, _ROW = 19, (15, 34)  # heights, the row's least and most
_STYLE = """
QTableView { background: @PANEL; border: none; }
QHeaderView::section { background: @PANEL; color: @TEXT_FAINT; border: none;
    border-bottom: 1px solid @LINE; font-size: 11px; padding: 0 3px; }
"""
_PAD, _GAP = 3.0, 6.0
"""The last column is left-aligned beside right-aligned ones, so it has a gap before it."""
_NUMBER_PX = 48.0

_Index = QModelIndex | QPersistentModelIndex


class ServoView(QTableWidget):
    """All rows and all columns at any size; no scroll bars, no keyboard focus. Only changed cells are painted again."""

    def __init__(self, rows: tuple[Row, ...]) -> None:
        super().__init__(0, len(_COLUMNS))
        self._rows: tuple[Row, ...] = ()
        self._items: list[list[QTableWidgetItem]] = []
        for place, kind in enumerate(_COLUMNS):
            heading = tr(kind.value[0])
            item = QTableWidgetItem(f"  {heading}" if kind is Column.ERROR else heading)
            item.setToolTip(tr(kind.value[1]))
            item.setTextAlignment(LEFT if kind in _LEFT else RIGHT)
            self.setHorizontalHeaderItem(place, item)
        self.setItemDelegate(ServoDelegate(self))
        theme.set_sheet(self, _STYLE)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setShowGrid(False)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.verticalHeader().hide()
        self.verticalHeader().setMinimumSectionSize(_ROW[0])
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        header.setSectionsClickable(False)
        header.setMinimumSectionSize(20)
        header.setFixedHeight(_HEADER)
        header.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setAccessibleName(tr("Servos"))
        self.show_rows(rows)

    def show_rows(self, rows: tuple[Row, ...]) -> None:
        if len(rows) != self.rowCount():
            self._make_rows(len(rows))
        for row, cells in enumerate(rows):
            for place, cell in enumerate(cells):
                if not self._rows or self._rows[row][place] != cell:
                    item = self._items[row][place]
                    item.setText(cell.text)
                    item.setData(Qt.ItemDataRole.ToolTipRole, cell.tip or None)
                    item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{tr(_COLUMNS[place].value[0])} {cell.text}")
                    item.setData(Qt.ItemDataRole.UserRole, cell)
        self._rows = rows

    def _make_rows(self, count: int) -> None:
        """Empty rows for another robot."""
        self._rows = ()
        self._items = [[QTableWidgetItem() for _ in _COLUMNS] for _ in range(count)]
        self.setRowCount(count)
        for row, items in enumerate(self._items):
            for place, item in enumerate(items):
                self.setItem(row, place, item)
        self.setMinimumHeight(_HEADER + count * _ROW[0])
        self._fit_rows()

    def _fit_rows(self) -> None:
        room = (self.height() - _HEADER) // max(1, self.rowCount())
        self.verticalHeader().setDefaultSectionSize(max(_ROW[0], min(_ROW[1], room)))

    def cell(self, row: int, column: Column) -> Cell:
        return self._rows[row][_COLUMNS.index(column)]

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        spare = max(0, self.width() - sum(kind.value[2] for kind in _COLUMNS))
        widths = [kind.value[2] + int(kind.value[3] * spare) for kind in _COLUMNS]
        widths[-1] += max(0, self.width() - sum(widths))
        for place, width in enumerate(widths):
            self.setColumnWidth(place, width)
        self._fit_rows()


class ServoDelegate(QStyledItemDelegate):
    """Numbers to the right, words to the left, the position with a bar of its envelope; warnings are tinted."""

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        cell = index.data(Qt.ItemDataRole.UserRole)
        if not isinstance(cell, Cell):
            return
        column = _COLUMNS[index.column()]
        box = QRectF(option.rect)  # type: ignore[attr-defined]
        painter.save()
        if index.row() % 2:
            painter.fillRect(box, theme.colour(theme.RAISED, 0.45))
        if cell.tone >= Tone.WARN:
            painter.fillRect(box.adjusted(1, 0, -1, 0), theme.colour(theme.of(TONE_ROLE[cell.tone]), 0.16))
        size = 14 if box.height() >= 26 else 13 if box.height() >= 21 else 12
        font = theme.semi_bold(size) if column is Column.JOINT or cell.tone >= Tone.WARN else theme.font(size)
        inside = box.adjusted(_PAD + (_GAP if column is Column.ERROR else 0), 0, -_PAD, 0)
        if cell.track is not None:
            _paint_track(painter, inside.adjusted(2, 0, -_NUMBER_PX, 0), cell.track, cell.tone)
        side = LEFT if column in _LEFT else RIGHT
        draw_text(painter, inside, cell.text, font, theme.of(TONE_ROLE[cell.tone]), side, smallest_px=9, elided=True)
        painter.restore()


def _paint_track(painter: QPainter, box: QRectF, track: Track, tone: Tone) -> None:
    """The envelope as a strip with darker ends; a line at the goal, a block at the joint."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    strip = QRectF(box.left(), box.center().y() - 3.5, box.width(), 7.0)
    set_colours(painter, theme.colour(theme.ORANGE, 0.40))
    painter.drawRect(strip)
    painter.setBrush(QColor(theme.LINE))
    low, high = (strip.left() + share * strip.width() for share in (track.low_warn, track.high_warn))
    painter.drawRect(QRectF(low, strip.top(), high - low, strip.height()))

    def x(share: float) -> float:
        return strip.left() + max(0.0, min(1.0, share)) * strip.width()

    if track.goal is not None:
        draw_tick(painter, strip, x(track.goal), theme.TEXT_DIM, 1.5, 3)
    set_colours(painter, theme.of("SKY" if tone < Tone.WARN else TONE_ROLE[tone]))
    painter.drawRect(QRectF(x(track.at) - 2.5, strip.top() - 1, 5.0, strip.height() + 2))


_HEIGHT = 33
_RANGE = 1.25  # excess that the balance's bar shows to each side


class TendonBalance(PaintedWidget):
    """Two bars that grow from the middle: to the left when a pair of wires hangs slack, to the right when it is too tight.

    Half a pair's pretension off is worth a warning; the marks show where that begins.
    """

    ground = "PANEL"

    def __init__(self) -> None:
        super().__init__(tr("Balance of the tendon pairs"), tip("tendon_balance"), hint=(440, _HEIGHT), height=_HEIGHT)
        self._pairs: tuple[PairBalance, ...] = ()

    def show_pairs(self, pairs: tuple[PairBalance, ...]) -> None:
        if pairs != self._pairs:
            self._pairs = pairs
            self.setAccessibleDescription("; ".join(pair.text for pair in pairs))
            self.update()

    def paint(self, painter: QPainter) -> None:
        width = (self.width() - 16.0 * (len(self._pairs) - 1)) / max(1, len(self._pairs))
        for k, pair in enumerate(self._pairs):
            _paint_pair(painter, QRectF(k * (width + 16.0), 0, width, self.height()), pair)


def _paint_pair(painter: QPainter, box: QRectF, pair: PairBalance) -> None:
    text_box, warns = QRectF(box.left(), box.top(), box.width(), 16), pair.tone >= Tone.WARN
    colour = theme.ALLOWED if pair.tone is Tone.PLAIN else theme.of(TONE_ROLE[pair.tone])
    title = f"! {pair.title} {pair.word}:" if warns else f"{pair.title} "
    font = theme.semi_bold(12) if warns else theme.font(12)
    room = text_box.width() - text_width(font, pair.forces) - 8
    choices = (f"{title} {pair.sum}", f"{title} {pair.total} mm")
    left = next((text for text in choices if text_width(font, text) <= room), choices[-1])
    draw_text(painter, text_box, left, font, colour if warns else theme.TEXT_DIM)
    if text_width(font, left) <= room:
        draw_text(painter, text_box, pair.forces, theme.font(12), theme.TEXT_DIM, RIGHT)
    track = QRectF(box.left(), box.top() + 20, box.width(), 8)
    middle, half = track.center().x(), track.width() / 2 / _RANGE
    draw_track(painter, track)
    for mark_at in (-0.5, 0.5):
        draw_tick(painter, track, middle + mark_at * half, theme.TEXT_FAINT, 1, 1)
    if pair.share is not None:
        draw_middle_bar(painter, track, pair.share / _RANGE, colour, inset=1, least=0.0, arrow=7)
    draw_tick(painter, track, middle, theme.TEXT, 2, 3)


_SHOW_EVERY_S = 0.2


class ServoTable(QWidget):
    """Renewed five times a second at most, and there only the cells that changed.

    The table takes no keyboard focus, as the arrow keys belong to the robot.
    Each request is confirmed in the widget itself, then emitted as a signal.

    Attributes
    ----------
    reboot_asked : servo id.
    zero_asked : a ZeroRequest.
    search_asked : the wizard's search for slack.
    torque_off_asked : all servos.

    Parameters
    ----------
    safety : where warnings begin.
    clock : monotonic, that of ``BusStatus.time_s``.
    """

    reboot_asked = Signal(int)
    zero_asked = Signal(object)
    search_asked = Signal()
    torque_off_asked = Signal()

    def __init__(self, safety: SafetyConfig | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self.safety = safety or SafetyConfig()
        self._clock = clock
        self._pace = Pace(_SHOW_EVERY_S, clock)
        self._servos = ServosConfig()
        self._kind: object = None
        self._armed = self._reachable = False
        self._status: BusStatus | None = None
        self.zeros: ZeroDialog | None = None
        """While it is open."""
        self.table = ServoView(servo_rows(None, self._servos, self.safety))
        self._balance = TendonBalance()
        self.bus = QLabel()
        self.bus.setFixedHeight(16)
        self.question = QuestionStrip()  # where a request is confirmed
        self.question.closed.connect(self._on_answered)
        self._restart_button = text_button(tr("Restart servo\N{HORIZONTAL ELLIPSIS}"), lambda: None)
        self._restarts = QMenu(self)
        self._restarts.aboutToShow.connect(self._fill_restarts)
        self._restart_button.setMenu(self._restarts)
        self._zero_button = text_button(tr("Zero\N{HORIZONTAL ELLIPSIS}"), self.open_zeros)
        self._off_button = text_button(tr("Torque off\N{HORIZONTAL ELLIPSIS}"), self._ask_torque_off)
        self._asked_by: QWidget = self._zero_button
        buttons = line(self._restart_button, self._zero_button, self._off_button, None, spacing=6)
        for button in (self._restart_button, self._zero_button, self._off_button):
            button.setStyleSheet(BUTTON_STYLE)
        strip = QWidget()
        strip.setFixedHeight(24)
        self._strip = QStackedLayout(strip)
        self._strip.addWidget(holder(buttons))
        self._strip.addWidget(self.question)
        self.setLayout(column((self.table, 1), self._balance, self.bus, strip, spacing=2))
        self.setAccessibleName(tr("Servos"))
        self._show(None, None)

    def show_status(self, status: BusStatus | None, servos: ServosConfig, now_s: float | None = None) -> None:
        """The newest status of the bus, None without one; a status that is older than a second is shown as silence.

        `now_s` is by the clock of the rig, which is slower than the wall's where the twin waits for a busy computer.
        """
        self._servos = servos
        silence_s = (self._clock() if now_s is None else now_s) - status.time_s if status is not None else 0.0
        is_silent = silence_s > SILENT_AFTER_S
        kind = (status is None, is_silent, status.phase if status is not None else None)
        if self._pace.due() or kind != self._kind:
            self._kind = kind
            self._show(status, silence_s if is_silent else None)

    def _show(self, status: BusStatus | None, silence_s: float | None) -> None:
        believed = self._status = status if silence_s is None else None
        if self.zeros is not None:
            self.zeros.show_joints(joint_zeros(believed, self._servos))
        self.table.show_rows(servo_rows(believed, self._servos, self.safety))
        self._balance.show_pairs(pair_balances(believed, self._servos))
        said = bus_line(status, silence_s)
        if said.text != self.bus.text():
            self.bus.setText(said.text)
            self.bus.setToolTip(said.tip)
            role = "TEXT_DIM" if said.tone is Tone.PLAIN else TONE_ROLE[said.tone]
            theme.set_sheet(self.bus, f"color: @{role}; font-size: 12px;")
        armed, reachable = believed is not None and believed.armed, believed is not None
        if (armed, reachable) != (self._armed, self._reachable) or status is None:
            self._armed, self._reachable = armed, reachable
            self._show_offered()

    def _show_offered(self) -> None:
        free = self._reachable and not self._armed
        if self.zeros is not None and not free:
            self.zeros.close()
        why = "" if free else tr("press STOP or Torque off first") if self._armed else tr("the servo bus is not open")
        self._restart_button.setEnabled(free)
        self._zero_button.setEnabled(free)
        self._off_button.setEnabled(self._reachable)
        self._restart_button.setToolTip(why or tr("Restart one servo, which clears its error; its joint must be zeroed again"))
        self._zero_button.setToolTip(why or tr("Say where the joints are: kept zeros, slack wires, and how far the feeds are in"))
        self._off_button.setToolTip(
            tr("Let all motors go, which releases the wires' tension; not while armed") if self._reachable else why
        )
        self.question.cancel()  # it was asked under other circumstances

    def _fill_restarts(self) -> None:
        self._restarts.clear()
        for joint in self._servos.joints:
            self._restarts.addAction(f"{joint.id}  {joint_title(joint.name)}", partial(self._ask_restart, joint))

    @property
    def lacks_zeros(self) -> bool:
        """Whether all servos answer, and a joint is not zeroed: before that they cannot be switched on."""
        status = self._status
        is_known = status is not None and bool(status.servos) and all(isinstance(one, ServoState) for one in status.servos)
        return is_known and status is not None and not status.armed and not all(status.zeroed)

    def open_zeros(self) -> None:
        """The dialog in which the operator says where the joints are."""
        if self.zeros is not None:
            self.zeros.raise_()
            return
        self.zeros = dialog = ZeroDialog(self._servos, self)
        dialog.show_joints(joint_zeros(self._status, self._servos))
        dialog.zero_asked.connect(self.zero_asked)
        dialog.search_asked.connect(self.search_asked)
        dialog.torque_off_asked.connect(self.torque_off_asked)
        dialog.finished.connect(self._on_zeros_closed)
        dialog.show()

    def _on_zeros_closed(self) -> None:
        if self.zeros is not None:
            self.zeros.deleteLater()
            self.zeros = None

    def _ask_restart(self, joint: JointConfig) -> None:
        question = tr("Restart servo {id} ({joint})? It must be zeroed again.", id=joint.id, joint=joint_title(joint.name))
        self._ask(self._restart_button, question, tr("Restart"), partial(self.reboot_asked.emit, joint.id))

    def _ask_torque_off(self) -> None:
        self._ask(self._off_button, tr("All motors let go and the wires hang loose."), tr("Torque off"), self.torque_off_asked.emit)

    def _ask(self, button: QWidget, question: str, answer: str, action: Callable[[], None]) -> None:
        self._asked_by = button
        self._strip.setCurrentIndex(1)
        self.question.ask(question, answer, action)

    def _on_answered(self) -> None:
        focus = self.focusWidget()
        had_focus = focus is not None and self.question.isAncestorOf(focus)
        self._strip.setCurrentIndex(0)
        if had_focus:
            self._asked_by.setFocus()

    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self.question.cancel()
