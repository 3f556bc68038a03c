"""The timeline: marks of events, theta as a curve, states and modes as bands, gaps, selection, and where playing is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QLineF, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QBrush,
    QColor,
    QFontMetrics,
    QHelpEvent,
    QImage,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QPolygonF,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy, QToolTip, QWidget

from app.player.course import MARK_LOOK, Course, Shape, clock_text, event_line
from app.ui import theme
from app.ui.i18n import tr
from app.ui.texts import signed_degrees, tip
from app.widgets.mode_bar import MODE_LOOK
from app.widgets.painting import LEFT, RIGHT, draw_text
from core.control.modes import Mode
from core.session.manifest import Event
from core.types import PoseState


def paint_band(painter: QPainter, lane: QRectF, values: NDArray[np.int64], colours: Sequence[QColor], nothing: QColor) -> None:
    """One value a pixel, as index of its colour; -1 is `nothing`, -2 transparent."""
    table = np.array([0, nothing.rgba(), *(colour.rgba() for colour in colours)], np.uint32)
    pixels = np.ascontiguousarray(table[values + 2])
    image = QImage(pixels.data, len(pixels), 1, 4 * len(pixels), QImage.Format.Format_ARGB32)
    painter.drawImage(lane, image)


def curves(xs: NDArray[np.float64], ys: NDArray[np.float64], gap: NDArray[np.bool_]) -> list[list[QPointF]]:
    """Lines through the finite values, broken where `gap` is true."""
    known = np.isfinite(ys)
    breaks = np.flatnonzero((known[1:] != known[:-1]) | gap[1:]) + 1
    parts = (part for part in np.split(np.arange(len(xs)), breaks) if len(part) and known[part[0]])
    return [[QPointF(x, y) for x, y in zip(xs[part].tolist(), ys[part].tolist(), strict=True)] for part in parts]


def extents(xs: NDArray[np.float64], ys: NDArray[np.float64]) -> list[QLineF]:
    """A line from the lowest to the highest value of each pixel column, so that no peak is lost; neighbours touch."""
    columns = np.floor(xs).astype(np.int64)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(columns)) + 1])
    low, high = np.fmin.reduceat(ys, edges), np.fmax.reduceat(ys, edges)
    at = columns[edges]
    beside = np.flatnonzero(np.diff(at) == 1)
    touching_low, touching_high = low.copy(), high.copy()
    touching_low[beside + 1] = np.fmin(low[beside + 1], high[beside])
    touching_high[beside + 1] = np.fmax(high[beside + 1], low[beside])
    kept = np.isfinite(low)
    ends = zip(at[kept].tolist(), touching_low[kept].tolist(), touching_high[kept].tolist(), strict=True)
    return [QLineF(x + 0.5, first - 0.5, x + 0.5, last + 0.5) for x, first, last in ends]


def paint_mark(painter: QPainter, middle: QPointF, shape: Shape, colour_name: str) -> None:
    """The mark of a kind of event, 12 px high."""
    colour = QColor(colour_name)
    is_hollow = shape in (Shape.HOLLOW_TRIANGLE, Shape.RING, Shape.CROSS)
    painter.setPen(QPen(colour, 1.8) if is_hollow else QPen(QColor(theme.PANEL), 1))
    painter.setBrush(Qt.BrushStyle.NoBrush if is_hollow else colour)
    x, y = middle.x(), middle.y()
    if shape in (Shape.TRIANGLE, Shape.HOLLOW_TRIANGLE):
        painter.drawPolygon(QPolygonF([QPointF(x, y - 6), QPointF(x + 6, y + 5), QPointF(x - 6, y + 5)]))
    elif shape is Shape.DIAMOND:
        painter.drawPolygon(QPolygonF([QPointF(x, y - 6.5), QPointF(x + 6.5, y), QPointF(x, y + 6.5), QPointF(x - 6.5, y)]))
    elif shape is Shape.SQUARE:
        painter.drawRect(QRectF(x - 4.5, y - 4.5, 9, 9))
    elif shape is Shape.RING:
        painter.drawEllipse(middle, 4.5, 4.5)
    elif shape is Shape.CROSS:
        painter.drawLine(QPointF(x - 4, y - 4), QPointF(x + 4, y + 4))
        painter.drawLine(QPointF(x - 4, y + 4), QPointF(x + 4, y - 4))
    else:  # a flag on its staff
        painter.setPen(QPen(colour, 1.6))
        painter.drawLine(QPointF(x, y - 7), QPointF(x, y + 7))
        painter.drawPolygon(QPolygonF([QPointF(x, y - 6.5), QPointF(x + 8, y - 3), QPointF(x, y + 0.5)]))


_LEFT, _RIGHT = 50.0, 10.0
_NAME_GAP = 10.0
"""Between the names of the lanes and the lanes: half of a mark at the first moment lies there."""
_RULER, _MARKS, _STATES, _MODES = 18.0, 17.0, 13.0, 5.0
_SPACE = 3.0
_HOLD_S = 0.6
"""A row counts for so long after its time, so that a slow camera leaves no holes in the bands."""
_LEAST_SPAN_S = 0.5
_STEPS_S = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600)
_ANGLE_RANGES = (20.0, 45.0, 90.0, 180.0)
_MARK_REACH_PX = 7.0
_BY_HAND_PX = 2.5
"""Radius of the point of an angle that was measured by hand."""
_CROWDED = 3.0
"""With more rows a pixel than this a curve is drawn as ``extents``."""


@dataclass(frozen=True, slots=True)
class _Lanes:
    """Where each lane is, from top to bottom."""

    ruler: QRectF
    marks: QRectF
    theta: QRectF
    states: QRectF
    modes: QRectF


class TimelineView(QWidget):
    """Click or drag seeks, with Shift it selects; the wheel zooms about the pointer.

    ``sought`` and ``selected`` (first and last) carry seconds from the first row. The course is painted once per zoom and size,
    into a pixmap below selection and cursor.
    """

    sought = Signal(float)
    selected = Signal(float, float)

    def __init__(self) -> None:
        super().__init__()
        self._course: Course | None = None
        self._events: tuple[Event, ...] = ()
        self._time_s = 0.0
        self._selection: tuple[float, float] | None = None
        self._from_s, self._span_s = 0.0, 1.0
        self._is_whole = True
        self._selecting_from: float | None = None
        self._picture: QPixmap | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMinimumSize(320, 112)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.setMouseTracking(True)
        self.setAccessibleName(tr("Timeline"))
        self.setToolTip(tip("timeline"))

    def sizeHint(self) -> QSize:
        return QSize(800, 128)

    @property
    def view(self) -> tuple[float, float]:
        """First and last second in sight."""
        return self._from_s, self._from_s + self._span_s

    def show_course(self, course: Course, events: Sequence[Event]) -> None:
        """The rows known so far, and the events."""
        self._course, self._events = course, tuple(event for event in events if event.kind in MARK_LOOK)
        if self._is_whole:
            self._from_s, self._span_s = 0.0, max(course.duration_s, _LEAST_SPAN_S)
        self._describe()
        self._paint_again()

    def show_time(self, time_s: float, *, follow: bool = False) -> None:
        """The cursor; with `follow` a zoomed view goes with it."""
        self._time_s = time_s
        low, high = self.view
        if not low <= time_s <= high and (follow or not self._is_whole):
            self._set_view(time_s - 0.1 * self._span_s, self._span_s)
        self.update()

    def show_selection(self, selection: tuple[float, float] | None) -> None:
        self._selection = selection
        self._describe()
        self.update()

    def zoom(self, factor: float, about_s: float | None = None) -> None:
        """Shorter (`factor` > 1) or longer about a time, without one about the cursor."""
        about_s = self._time_s if about_s is None else about_s
        span_s = self._span_s / factor
        share = (about_s - self._from_s) / self._span_s
        self._set_view(about_s - min(1.0, max(0.0, share)) * span_s, span_s)

    def fit(self) -> None:
        self._set_view(0.0, np.inf)

    def _describe(self) -> None:
        length = clock_text(self._course.duration_s) if self._course is not None else tr("empty")
        gaps = tr(", {count} gaps", count=len(self._course.gaps)) if self._course is not None and len(self._course.gaps) else ""
        chosen = ""
        if self._selection is not None:
            first, last = (clock_text(time_s) for time_s in self._selection)
            chosen = tr("; selected {first} to {last}", first=first, last=last)
        marks = len(self._events)
        self.setAccessibleDescription(
            tr("{length} long, {count} marks{gaps}{chosen}", length=length, count=marks, gaps=gaps, chosen=chosen)
        )

    def _set_view(self, from_s: float, span_s: float) -> None:
        longest_s = max(self._course.duration_s if self._course is not None else 0.0, _LEAST_SPAN_S)
        self._span_s = min(max(span_s, _LEAST_SPAN_S), longest_s)
        self._is_whole = self._span_s >= longest_s
        self._from_s = min(max(0.0, from_s), longest_s - self._span_s)
        self._paint_again()

    def _paint_again(self) -> None:
        self._picture = None
        self.update()

    # ---- geometry

    def _lanes(self) -> _Lanes:
        width = max(10.0, self.width() - _LEFT - _RIGHT)
        top = _RULER + _MARKS
        bottom = self.height() - 4.0 - _MODES - _SPACE - _STATES - _SPACE
        return _Lanes(
            QRectF(_LEFT, 0, width, _RULER),
            QRectF(_LEFT, _RULER, width, _MARKS),
            QRectF(_LEFT, top + 2, width, max(8.0, bottom - top - 2)),
            QRectF(_LEFT, bottom + _SPACE, width, _STATES),
            QRectF(_LEFT, bottom + 2 * _SPACE + _STATES, width, _MODES),
        )

    def _x(self, time_s: float) -> float:
        return _LEFT + (time_s - self._from_s) / self._span_s * max(10.0, self.width() - _LEFT - _RIGHT)

    def _time(self, x: float) -> float:
        share = (x - _LEFT) / max(10.0, self.width() - _LEFT - _RIGHT)
        longest_s = self._course.duration_s if self._course is not None else 0.0
        return min(max(0.0, self._from_s + share * self._span_s), longest_s)

    # ---- painting

    def follow_theme(self) -> None:
        self._picture = None

    def paintEvent(self, event: QPaintEvent) -> None:
        ratio = self.devicePixelRatioF()
        if self._picture is None or self._picture.size() != self.size() * ratio:
            self._picture = QPixmap(self.size() * ratio)
            self._picture.setDevicePixelRatio(ratio)
            self._paint_course(self._picture)
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._picture)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._selection is not None:
            self._paint_selection(painter, *self._selection)
        self._paint_cursor(painter)
        painter.end()

    def _paint_course(self, picture: QPixmap) -> None:
        picture.fill(QColor(theme.PANEL))
        painter = QPainter(picture)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        lanes = self._lanes()
        painter.fillRect(lanes.theta, QColor(theme.WINDOW))
        self._paint_ruler(painter, lanes)
        if self._course is not None and len(self._course):
            self._paint_bands(painter, self._course, lanes)
            self._paint_gaps(painter, self._course, lanes)
            self._paint_theta(painter, self._course, lanes.theta)
        self._paint_names(painter, lanes)
        for event in sorted(self._events, key=lambda e: list(MARK_LOOK).index(e.kind)):
            x = self._x(event.time_s - (self._course.first_s if self._course else 0.0))
            if lanes.marks.left() - 1 <= x <= lanes.marks.right() + 1:
                look = MARK_LOOK[event.kind]
                painter.setPen(QPen(theme.colour(look.colour, 0.35), 1))
                painter.drawLine(QPointF(x, lanes.marks.bottom()), QPointF(x, lanes.theta.bottom()))
                paint_mark(painter, QPointF(x, lanes.marks.center().y()), look.shape, look.colour)
        painter.end()

    def _paint_ruler(self, painter: QPainter, lanes: _Lanes) -> None:
        label_font = theme.font(11)
        painter.setFont(label_font)
        # "0:00.000" must not touch its neighbour
        least_s = self._span_s * (QFontMetrics(label_font).horizontalAdvance("00:00.00") + 26) / lanes.ruler.width()
        step_s = next((step for step in _STEPS_S if step >= least_s), float(_STEPS_S[-1]) * max(1, round(least_s / _STEPS_S[-1])))
        k = int(np.ceil(self._from_s / step_s))
        while (time_s := k * step_s) <= self._from_s + self._span_s:
            x = self._x(time_s)
            painter.setPen(QPen(QColor(theme.LINE), 1))
            painter.drawLine(QPointF(x, lanes.ruler.bottom() - 4), QPointF(x, lanes.theta.bottom()))
            painter.setPen(QColor(theme.TEXT_FAINT))
            text = clock_text(time_s)
            text = text[: -4 if step_s >= 1 else -2 if step_s >= 0.1 else -1]
            room = QRectF(min(max(x - 40, 0), self.width() - 80), 0, 80, lanes.ruler.height() - 4)
            place = Qt.AlignmentFlag.AlignHCenter if room.left() == x - 40 else Qt.AlignmentFlag.AlignRight
            painter.drawText(room, Qt.AlignmentFlag.AlignVCenter | place, text)
            k += 1

    def _columns(self, course: Course, lane: QRectF) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """For every pixel of a lane the row that is shown in its middle, and whether it is still true there."""
        count = max(1, round(lane.width() * self.devicePixelRatioF()))
        middles_s = self._from_s + (np.arange(count) + 0.5) / count * self._span_s
        rows = np.searchsorted(course.times_s, middles_s, side="right") - 1
        # a row that lies within the pixel counts, also where it comes after the middle
        ahead = np.minimum(rows + 1, len(course) - 1)
        near = (rows < 0) & (course.times_s[ahead] - middles_s < self._span_s / count)
        rows = np.where(near, ahead, rows)
        age_s = middles_s - course.times_s[np.maximum(rows, 0)]
        return np.maximum(rows, 0), (rows >= 0) & (age_s < max(_HOLD_S, self._span_s / count))

    def _paint_bands(self, painter: QPainter, course: Course, lanes: _Lanes) -> None:
        rows, fresh = self._columns(course, lanes.states)
        colours = [QColor(theme.STATE_COLOUR[state]) for state in PoseState]
        nothing, states = theme.colour(theme.LINE, 0.6), np.where(fresh, course.states[rows], -2)
        paint_band(painter, lanes.states, states, colours, nothing)
        if (course.modes >= 0).any():
            modes = [QColor(MODE_LOOK[mode].colour) for mode in Mode]
            paint_band(painter, lanes.modes, np.where(fresh, course.modes[rows], -2), modes, nothing)
        # the state's letter wherever its colour is wide enough for one
        painter.setFont(theme.bold(10))
        painter.setPen(QColor(theme.STATE_INK))
        ratio = self.devicePixelRatioF()
        edges = np.concatenate([[0], np.flatnonzero(np.diff(states)) + 1, [len(states)]])
        for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
            if last - first > 14 * ratio and states[first] >= 0:
                lane = lanes.states
                room = QRectF(lane.left() + first / ratio, lane.top(), (last - first) / ratio, lane.height())
                painter.drawText(room, Qt.AlignmentFlag.AlignCenter, tuple(PoseState)[int(states[first])].value)

    def _paint_gaps(self, painter: QPainter, course: Course, lanes: _Lanes) -> None:
        """Hatched from the last row before to the first one after; never too narrow to be seen."""
        for place in course.gaps.tolist():
            left, right = self._x(float(course.times_s[place - 1])), self._x(float(course.times_s[place]))
            if right < lanes.theta.left() or left > lanes.theta.right():
                continue
            widened = max(0.0, 3.0 - (right - left)) / 2
            room = QRectF(left - widened, lanes.theta.top(), right - left + 2 * widened, lanes.states.bottom() - lanes.theta.top())
            room = room.intersected(QRectF(lanes.theta.left(), 0, lanes.theta.width(), self.height()))
            painter.fillRect(room, theme.colour(theme.INK, 0.9))
            painter.fillRect(room, QBrush(theme.colour(theme.FAULT, 0.55), Qt.BrushStyle.BDiagPattern))

    def _paint_theta(self, painter: QPainter, course: Course, lane: QRectF) -> None:
        """The signed angle; the 99.5th percentile of the session sets its scale."""
        known = np.abs(course.theta_deg[np.isfinite(course.theta_deg)])
        largest = float(np.percentile(known, 99.5)) if known.size else 0.0
        most = next((r for r in _ANGLE_RANGES if largest <= r), _ANGLE_RANGES[-1])
        middle = lane.center().y()
        painter.setPen(QPen(QColor(theme.LINE), 1))
        painter.drawLine(QPointF(lane.left(), middle), QPointF(lane.right(), middle))
        painter.setFont(theme.font(10))
        painter.setPen(QColor(theme.TEXT_FAINT))
        flags = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        for text, y in ((f"+{most:g}°", lane.top() + 5), (f"\N{MINUS SIGN}{most:g}°", lane.bottom() - 5)):
            painter.drawText(QRectF(0, y - 8, _LEFT - _NAME_GAP, 16), flags, text)
        if course.other_theta_deg is not None:
            self._paint_curve(painter, course, course.other_theta_deg / most, lane, theme.SKY)
        self._paint_curve(painter, course, course.theta_deg / most, lane, theme.THETA)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.TEXT))
        for time_s, theta_deg in course.by_hand if course.by_hand is not None else ():
            if lane.left() <= (x := self._x(float(time_s))) <= lane.right():
                share = min(max(float(theta_deg) / most, -1.0), 1.0)
                painter.drawEllipse(QPointF(x, middle - share * (lane.height() / 2 - 2)), _BY_HAND_PX, _BY_HAND_PX)

    def _paint_curve(self, painter: QPainter, course: Course, values: NDArray[np.float64], lane: QRectF, colour_name: str) -> None:
        """`values` of -1..1."""
        first = max(0, int(np.searchsorted(course.times_s, self._from_s)) - 1)
        last = min(len(course), int(np.searchsorted(course.times_s, self._from_s + self._span_s)) + 2)
        xs = _LEFT + (course.times_s[first:last] - self._from_s) / self._span_s * lane.width()
        ys = lane.center().y() - np.clip(values[first:last], -1.0, 1.0) * (lane.height() / 2 - 2)
        painter.save()
        painter.setClipRect(lane)
        painter.setPen(QPen(QColor(colour_name), 1.3))
        if last - first > _CROWDED * lane.width():
            painter.drawLines(extents(xs, ys))
        else:
            gap = np.zeros(len(xs), bool)
            gap[course.gaps[(course.gaps > first) & (course.gaps < last)] - first] = True
            for line in curves(xs, ys, gap):
                if len(line) > 1:
                    painter.drawPolyline(line)
                else:
                    painter.drawPoint(line[0])
        painter.restore()

    def _paint_names(self, painter: QPainter, lanes: _Lanes) -> None:
        painter.setFont(theme.font(10))
        painter.setPen(QColor(theme.TEXT_DIM))
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        painter.drawText(QRectF(0, lanes.theta.center().y() - 8, _LEFT - _NAME_GAP, 16), right, tr("theta"))
        painter.drawText(QRectF(0, lanes.marks.top(), _LEFT - _NAME_GAP, lanes.marks.height()), right, tr("events"))
        painter.drawText(QRectF(0, lanes.states.top() - 2, _LEFT - _NAME_GAP, lanes.states.height() + 4), right, tr("state"))

    def _paint_selection(self, painter: QPainter, first_s: float, last_s: float) -> None:
        lanes = self._lanes()
        left, right = (min(max(self._x(t), lanes.theta.left()), lanes.theta.right()) for t in (first_s, last_s))
        room = QRectF(left, lanes.marks.top(), max(1.0, right - left), self.height() - lanes.marks.top() - 2)
        painter.fillRect(room, theme.colour(theme.PLAYBACK, 0.20))
        painter.setPen(QPen(QColor(theme.PLAYBACK), 1.5))
        painter.drawLine(room.topLeft(), room.bottomLeft())
        painter.drawLine(room.topRight(), room.bottomRight())

    def _paint_cursor(self, painter: QPainter) -> None:
        x = self._x(self._time_s)
        lanes = self._lanes()
        if not lanes.theta.left() - 1 <= x <= lanes.theta.right() + 1:
            return
        painter.setPen(QPen(theme.colour(theme.INK, 0.8), 4))
        painter.drawLine(QPointF(x, lanes.ruler.bottom()), QPointF(x, self.height() - 2.0))
        painter.setPen(QPen(QColor(theme.TEXT), 2))
        painter.drawLine(QPointF(x, lanes.ruler.bottom() - 2), QPointF(x, self.height() - 2.0))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.TEXT))
        top = lanes.ruler.bottom() - 6
        painter.drawPolygon(QPolygonF([QPointF(x - 6, top), QPointF(x + 6, top), QPointF(x, top + 8)]))
        course = self._course
        theta_deg = course.theta_deg[course.place_at(self._time_s)] if course is not None and len(course) else float("nan")
        if np.isfinite(theta_deg):
            room = QRectF(x + 6, lanes.theta.top(), 60, 16)
            room.moveRight(min(room.right(), lanes.theta.right()) if room.right() < lanes.theta.right() else x - 6)
            align = RIGHT if room.right() < x else LEFT
            draw_text(painter, room, f"{theta_deg:.1f}°", theme.semi_bold(12), theme.TEXT, align)

    # ---- the pointer

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton:
            return
        time_s = self._time(event.position().x())
        if event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            self._selecting_from = time_s
        else:
            near = self._event_near(event.position())
            self.sought.emit(near.time_s - self._course.first_s if near is not None and self._course is not None else time_s)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if not event.buttons() & Qt.MouseButton.LeftButton:
            return
        time_s = self._time(event.position().x())
        if self._selecting_from is not None:
            self.selected.emit(min(time_s, self._selecting_from), max(time_s, self._selecting_from))
        else:
            self.sought.emit(time_s)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._selecting_from = None

    def wheelEvent(self, event: QWheelEvent) -> None:
        self.zoom(1.2 ** (event.angleDelta().y() / 120.0), self._time(event.position().x()))
        event.accept()

    def event(self, event: QEvent) -> bool:
        if isinstance(event, QHelpEvent) and event.type() == QEvent.Type.ToolTip:
            near = self._event_near(QPointF(event.pos()))
            QToolTip.showText(event.globalPos(), self.text_at(event.pos().x(), near), self)
            return True
        return super().event(event)

    def text_at(self, x: float, event: Event | None = None) -> str:
        """Time, state, angle and mode at a place, or the event that is there."""
        course = self._course
        if course is None or not len(course):
            return ""
        if event is not None:
            return f"{clock_text(event.time_s - course.first_s)}  {event_line(event)}"
        time_s = self._time(x)
        place = course.place_at(time_s)
        parts = [clock_text(time_s), tr("no pose")]
        if place + 1 in course.gaps and time_s - course.times_s[place] > _HOLD_S:
            # in a gap the row before it does not count
            return "  ".join((parts[0], tr("no frames")))
        if course.states[place] >= 0:
            parts[1:] = [
                tr("state {state}", state=tuple(PoseState)[course.states[place]].value),
                signed_degrees(float(course.theta_deg[place]), 1),
            ]
        if course.modes[place] >= 0:
            parts.append(tr(tuple(Mode)[course.modes[place]].value))
        if course.by_hand is not None:
            away_px = np.abs(course.by_hand[:, 0] - time_s) * (self.width() - _LEFT) / self._span_s
            if away_px.min() <= 2 * _BY_HAND_PX:
                parts.append(tr("by hand {angle}", angle=signed_degrees(float(course.by_hand[away_px.argmin(), 1]), 1)))
        return "  ".join(parts)

    def _event_near(self, place: QPointF) -> Event | None:
        lanes = self._lanes()
        if self._course is None or not lanes.marks.adjusted(-8, -2, 8, 2).contains(place):
            return None
        first_s = self._course.first_s
        away = [(abs(self._x(event.time_s - first_s) - place.x()), -k) for k, event in enumerate(self._events)]
        nearest, k = min(away, default=(np.inf, 0))
        return self._events[-k] if nearest <= _MARK_REACH_PX else None
