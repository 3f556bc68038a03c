"""Distances of head and tail from the centerline; the room between head and wall, and the contact force where it is measured."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QPainter

from app.ui import theme
from app.ui.i18n import tr
from app.ui.texts import REASON_TEXT, side, tip
from app.ui.workers import Pace
from app.widgets.painting import (
    CENTER,
    LEFT,
    NONE,
    RIGHT,
    PaintedWidget,
    draw_bar,
    draw_box,
    draw_middle_bar,
    draw_text,
    draw_tick,
    draw_track,
    number,
    polygon,
    set_colours,
    text_width,
)
from core.control.clearance import BreachWatch, Clearance, Ladder, clearance_of
from core.types import Pose, RobotStatus, Scene

_RANGE_IN_LIMITS = 5.0  # what a bar shows to each side, over the allowed distance
_NAME_PX = 56
_SMALLEST_PX, _LARGEST_PX = 13, 24  # of the numbers


class DistanceBars(PaintedWidget):
    """Two bars that grow from the centerline to the side on which head and tail lie; the green band is the allowed range.

    Bars on opposite sides mean that the robot has crossed. A bar that leaves the range ends in an arrow.
    """

    ground = "PANEL"

    def __init__(self, d_allow_px: float) -> None:
        explanation = tip("d_head", "d_tail", "crossed")
        super().__init__(tr("Distances from the centerline"), explanation, hint=(240, 160), least=(200, 100))
        self._allow_px = d_allow_px
        self._mm_per_px: float | None = None
        self._offsets: tuple[float, float] | None = None
        self._numbers: tuple[float, float] | None = None

    def set_allowed(self, d_allow_px: float) -> None:
        self._allow_px = d_allow_px
        self.update()

    @property
    def texts(self) -> tuple[str, str]:
        """The numbers of d_head and d_tail."""
        if self._numbers is None:
            return NONE, NONE
        return self._text(self._numbers[0]), self._text(self._numbers[1])

    def set_scale(self, mm_per_px: float | None) -> None:
        """Millimetres per working pixel beside the head; None: not calibrated, and only pixels are shown."""
        self._mm_per_px = mm_per_px

    def _text(self, offset_px: float) -> str:
        text = f"{abs(offset_px):.1f} px"
        return text if self._mm_per_px is None else f"{text} = {abs(offset_px) * self._mm_per_px:.2f} mm"

    def show_pose(self, pose: Pose | None, *, renew_text: bool = True) -> None:
        """The bars follow at once, the numbers when it is time to renew texts."""
        if pose is None and self._offsets is None:
            return
        changed = (pose is None) is not (self._offsets is None)
        self._offsets = (pose.c_head_px, pose.c_tail_px) if pose is not None else None
        if renew_text or changed:
            self._numbers = self._offsets
            self.setAccessibleDescription("d_head {}, d_tail {}".format(*self.texts))
        self.update()

    def paint(self, painter: QPainter) -> None:
        height = (self.height() - 20) / 2
        for k, (name, colour) in enumerate((("d_head", theme.D_HEAD), ("d_tail", theme.D_TAIL))):
            self._paint_row(painter, QRectF(0, k * height, self.width(), height), k, name, colour)
        self._paint_axis(painter, QRectF(0, 2 * height, self.width(), 20))

    def _paint_row(self, painter: QPainter, box: QRectF, index: int, name: str, colour: str) -> None:
        bottom = Qt.AlignmentFlag.AlignBottom
        line = QRectF(box.left(), box.top(), box.width(), box.height() - 26)
        draw_text(painter, line, name, theme.semi_bold(theme.Size.BODY), colour, bottom | Qt.AlignmentFlag.AlignLeft)
        text, ink = self.texts[index], theme.TEXT if self._numbers is not None else theme.TEXT_FAINT
        largest = theme.bold(max(_SMALLEST_PX, min(_LARGEST_PX, int(line.height() + 4))))  # in a low window the row is low, too
        font = theme.fitted(largest, text, int(box.width() - _NAME_PX))
        draw_text(painter, line.adjusted(0, 0, 0, 4), text, font, ink, bottom | Qt.AlignmentFlag.AlignRight)
        track = QRectF(box.left(), box.bottom() - 20, box.width(), 14)
        middle, allowed = track.center().x(), track.width() / 2 / _RANGE_IN_LIMITS
        draw_track(painter, track)
        painter.setBrush(theme.colour(theme.ALLOWED, 0.30))
        painter.drawRect(QRectF(middle - allowed, track.top(), 2 * allowed, track.height()))
        for x in (middle - allowed, middle + allowed):
            draw_tick(painter, track, x, theme.ALLOWED, 2, 3)
        if self._offsets is not None:
            share = self._offsets[index] / (_RANGE_IN_LIMITS * self._allow_px)
            draw_middle_bar(painter, track, share, colour, inset=3, arrow=8)
            draw_tick(painter, track, middle, theme.TEXT, 2, 3)

    def _paint_axis(self, painter: QPainter, box: QRectF) -> None:
        font, half = theme.font(theme.Size.LABEL), box.width() / 2 / _RANGE_IN_LIMITS
        draw_text(painter, box, side(-1.0), font, theme.TEXT_FAINT, LEFT)
        draw_text(painter, box, side(1.0), font, theme.TEXT_FAINT, RIGHT)
        for x, text in ((-half, f"{self._allow_px:g}"), (0.0, "0"), (half, f"{self._allow_px:g}")):
            label = QRectF(box.center().x() + x - 20, box.top(), 40, box.height())
            draw_text(painter, label, text, font, theme.TEXT_FAINT, CENTER)


FORCE_MARKS_N = (0.15, 0.5)
"""Limits of 95 % of a trial's forces, and of all of them."""
_FORCE_RANGE_N = 0.6
_FORCE_BAND_N = 0.03  # how far a force must be below a mark to count as below it again
_NEAR_USED, _USED_BAND = 0.85, 0.1
"""Share of the room that is used up; the band is one to two pixels in a usual vessel, the picture's noise."""
_AT_WALL_PX = 1.0
_TEXT_EVERY_S = 0.2
_ROLE = ("ALLOWED", "ORANGE", "FAULT")  # colour of each level


@dataclass(frozen=True, slots=True)
class _Block:
    """One half of the widget. ``texts`` are versions of one text, the longest first; the first that fits is shown."""

    texts: tuple[str, ...]
    share: float | None
    level: int
    marks: tuple[tuple[float, str], ...]

    @property
    def kind(self) -> tuple[int, str]:
        """What must be shown at once when it changes."""
        return self.level, self.texts[0] if self.share is None else ""


class ClearanceBar(PaintedWidget):
    """The room to the wall as a bar that is full on the centerline, and the contact force beside it when the robot measures it.

    A breach (no room left) and a force beyond its marks are shown in words, colour and with a sign, until they are clearly over.
    Without a pose the reason stands there instead of numbers. `pixels_per_mm` None: no millimetres.
    """

    ground = "WINDOW"

    def __init__(self, pixels_per_mm: float | None = None) -> None:
        super().__init__(tr("Room to the wall"), tip("clearance", "force"), hint=(440, 48), height=48)
        self.setMinimumWidth(230)
        self._pixels_per_mm = pixels_per_mm
        self._walls = Ladder((_NEAR_USED,), _USED_BAND)
        self._breaches = BreachWatch()
        self._forces = Ladder(FORCE_MARKS_N, _FORCE_BAND_N)
        self._pace = Pace(_TEXT_EVERY_S)
        self._room = _room_block(None, 0, tr("no picture yet"))
        self._force: _Block | None = None

    def set_scale(self, pixels_per_mm: float | None) -> None:
        self._pixels_per_mm = pixels_per_mm

    @property
    def text(self) -> str:
        return self._room.texts[0] if self._force is None else f"{self._room.texts[0]}; {self._force.texts[0]}"

    @property
    def is_breach(self) -> bool:
        """Whether the breach warning stands."""
        return self._room.level == 2

    def show_scene(self, scene: Scene | None, status: RobotStatus | None) -> None:
        """The room in `scene` and the force in `status`; None: not known."""
        clearance = clearance_of(scene, self._pixels_per_mm) if scene is not None else None
        force_n = status.wall_contact_n if status is not None else None
        wall = self._walls.update(1.0 - clearance.share if clearance is not None else None)
        if self._breaches.update(clearance, scene.captured_s if scene is not None else 0.0):
            wall = 2
        room = _room_block(clearance, wall, _why_unknown(scene))
        force = _force_block(force_n, self._forces.update(force_n)) if force_n is not None else None
        was_force = self._force
        changed = room.kind != self._room.kind or (force and force.kind) != (was_force and was_force.kind)
        if not self._pace.due() and not changed:
            # bars follow at once, numbers when they can be read
            room = replace(room, texts=self._room.texts)
            force = replace(force, texts=was_force.texts) if force is not None and was_force is not None else force
        if (room, force) != (self._room, was_force):
            self._room, self._force = room, force
            self.setAccessibleDescription(self.text)
            self.update()

    def paint(self, painter: QPainter) -> None:
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        worst = max(self._room.level, self._force.level if self._force is not None else 0)
        draw_box(painter, frame, 6, theme.PANEL, *((theme.FAULT, 2) if worst == 2 else (theme.LINE, 1)))
        inside = frame.adjusted(12, 4, -12, -3)
        if self._force is None:
            _paint_block(painter, inside, self._room)
        else:
            left = inside.width() * 0.58
            _paint_block(painter, QRectF(inside.left(), inside.top(), left - 14, inside.height()), self._room)
            _paint_block(painter, inside.adjusted(left, 0, 0, 0), self._force)


def _room_block(clearance: Clearance | None, level: int, why_unknown: str) -> _Block:
    marks = ((0.0, tr("wall")), (1.0, tr("centerline")))
    if clearance is None:
        texts = (tr("Room to the wall: {why}", why=why_unknown), why_unknown, tr("Room: not known"), tr("not known"))
        return _Block(texts, None, 0, marks)
    # a head slightly inside the wall is an error of the picture, as long as it is no breach
    least = -math.inf if level == 2 else 0.0
    room = f"{number(max(least, clearance.room_px), 0)} px"
    both = room if clearance.room_mm is None else f"{room}, {number(max(least, clearance.room_mm), 1)} mm"
    if level == 2:
        texts = (
            tr("BREACH: the head is in the wall  ({both})", both=both),
            tr("BREACH: in the wall  ({room})", room=room),
            tr("BREACH {room}", room=room),
            tr("BREACH"),
        )
    elif level == 1:
        word = tr("at the wall") if clearance.room_px < _AT_WALL_PX else tr("near the wall")
        texts = (
            tr("Room to the wall  {both}, {word}", both=both, word=word),
            tr("Room  {both}, {word}", both=both, word=word),
            f"{room}, {word}",
            word,
        )
    else:
        texts = (tr("Room to the wall  {both}", both=both), tr("Room  {both}", both=both), tr("Room  {room}", room=room), room)
    return _Block(texts, max(0.0, min(1.0, clearance.share)), level, marks)


def _force_block(force_n: float, level: int) -> _Block:
    number = f"{force_n:.2f} N"
    word, short = (("", ""), (tr("leans on the wall"), tr("leans")), (tr("PRESSES TOO HARD"), tr("TOO HARD")))[level]
    texts: tuple[str, ...] = (tr("Wall force  {number}", number=number), tr("Force  {number}", number=number), number)
    if level:
        texts = (tr("Wall force  {number}, {word}", number=number, word=word), f"{number}, {word}", f"{number} {short}", number)
    marks = tuple((limit_n / _FORCE_RANGE_N, f"{limit_n:g} N") for limit_n in FORCE_MARKS_N)
    return _Block(texts, force_n / _FORCE_RANGE_N, level, marks)


def _why_unknown(scene: Scene | None) -> str:
    if scene is None:
        return tr("not known")
    return tr(REASON_TEXT[scene.refusal.reason].title).lower() if scene.refusal is not None else tr("no pose")


def _paint_block(painter: QPainter, box: QRectF, block: _Block) -> None:
    line = QRectF(box.left(), box.top(), box.width(), 20)
    if block.level:
        _paint_triangle(painter, QPointF(box.left() + 8, line.center().y()), block.level)
        line.adjust(22, 0, 0, 0)
    font = theme.bold(14) if block.level else theme.semi_bold(14)
    text = next((text for text in block.texts if text_width(font, text) <= line.width()), block.texts[-1])
    role = "TEXT_FAINT" if block.share is None else _ROLE[block.level] if block.level else "TEXT"
    draw_text(painter, line, text, font, theme.of(role), smallest_px=11)
    track = QRectF(box.left(), box.top() + 21, box.width(), 8)
    draw_track(painter, track)
    if block.share is not None:
        share = max(0.0, min(1.0, block.share))
        if block.level == 2 and share < 0.1:  # without room there is nothing to fill, so the track is hatched
            painter.setBrush(QBrush(QColor(theme.FAULT), Qt.BrushStyle.BDiagPattern))
            painter.drawRoundedRect(track, 3, 3)
        draw_bar(painter, track, share, theme.of(_ROLE[block.level]))
    for share, mark in block.marks:
        x = track.left() + share * track.width()
        if 0.0 < share < 1.0:
            draw_tick(painter, track, x, theme.TEXT, 1.5, 2)
        width = text_width(theme.font(10), mark) + 2.0
        left = max(box.left(), min(x - width / 2, box.right() - width))
        draw_text(painter, QRectF(left, track.bottom() + 1, width, 12), mark, theme.font(10), theme.TEXT_FAINT, CENTER)


def _paint_triangle(painter: QPainter, middle: QPointF, level: int) -> None:
    """A warning triangle; filled when the limit is passed."""
    colour, is_over = theme.of(_ROLE[level]), level == 2
    set_colours(painter, colour if is_over else None, colour, 1.6)
    painter.drawPolygon(polygon(((0.0, -7.0), (8.0, 6.5), (-8.0, 6.5)), middle))
    box = QRectF(middle.x() - 8, middle.y() - 5, 16, 12)
    draw_text(painter, box, "!", theme.bold(11), theme.INK if is_over else colour, CENTER)
