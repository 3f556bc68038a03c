"""Distances of head and tail from the centerline, to their side.

How much room the head has to the wall, and how hard the robot leans on it where the rig can tell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QBrush, QColor, QFont, QFontMetrics, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui import theme
from app.ui.i18n import tr
from app.ui.texts import REASON_TEXT, side, tip
from app.ui.workers import Pace
from app.widgets.servo_table import number
from core.control.clearance import BreachWatch, Clearance, Ladder, clearance_of
from core.types import Pose, RobotStatus, Scene

_RANGE_IN_LIMITS = 5.0
_NAME_PX = 56
_SMALLEST_PX = 13


class DistanceBars(QWidget):
    """Two bars that grow from the centerline to the side on which head and tail lie; the green band is what is allowed.

    Bars on opposite sides mean that the robot has crossed. A bar that leaves the range ends in an arrow.
    """

    def __init__(self, d_allow_px: float) -> None:
        super().__init__()
        self._allow_px = d_allow_px
        self._mm_per_px: float | None = None
        self._offsets: tuple[float, float] | None = None
        self._numbers: tuple[float, float] | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMinimumSize(200, 100)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(tr("Distances from the centerline"))
        self.setToolTip(tip("d_head", "d_tail", "crossed"))

    def set_allowed(self, d_allow_px: float) -> None:
        self._allow_px = d_allow_px
        self.update()

    @property
    def texts(self) -> tuple[str, str]:
        """The numbers of d_head and d_tail."""
        if self._numbers is None:
            return "\N{EN DASH}", "\N{EN DASH}"
        return self._text(self._numbers[0]), self._text(self._numbers[1])

    def set_scale(self, mm_per_px: float | None) -> None:
        """Millimetres per working pixel beside the head; None: not calibrated, and only pixels are shown."""
        self._mm_per_px = mm_per_px

    def _text(self, offset_px: float) -> str:
        text = f"{abs(offset_px):.1f} px"
        return text if self._mm_per_px is None else f"{text} = {abs(offset_px) * self._mm_per_px:.2f} mm"

    def sizeHint(self) -> QSize:
        return QSize(240, 160)

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

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(theme.PANEL))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        row = (self.height() - 20) / 2
        for k, (name, colour_name) in enumerate((("d_head", theme.D_HEAD), ("d_tail", theme.D_TAIL))):
            box = QRectF(0, k * row, self.width(), row)
            self._paint_row(painter, box, k, name, colour_name)
        self._paint_axis(painter, QRectF(0, 2 * row, self.width(), 20))
        painter.end()

    def _paint_row(self, painter: QPainter, box: QRectF, index: int, name: str, colour_name: str) -> None:
        text_box = QRectF(box.left(), box.top(), box.width(), box.height() - 26)
        painter.setPen(QColor(colour_name))
        painter.setFont(theme.semi_bold(theme.Size.BODY))
        painter.drawText(text_box, Qt.AlignmentFlag.AlignBottom | Qt.AlignmentFlag.AlignLeft, name)
        painter.setPen(QColor(theme.TEXT if self._numbers is not None else theme.TEXT_FAINT))
        largest = theme.bold(max(_SMALLEST_PX, min(24, int(text_box.height() + 4))))  # in a low window the row is low, too
        painter.setFont(theme.fitted(largest, self.texts[index], int(box.width() - _NAME_PX)))
        right = Qt.AlignmentFlag.AlignBottom | Qt.AlignmentFlag.AlignRight
        painter.drawText(text_box.adjusted(0, 0, 0, 4), right, self.texts[index])
        track = QRectF(box.left(), box.bottom() - 20, box.width(), 14)
        self._paint_track(painter, track)
        if self._offsets is not None:
            self._paint_bar(painter, track, self._offsets[index], colour_name)

    def _paint_track(self, painter: QPainter, track: QRectF) -> None:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(theme.RAISED))
        painter.drawRoundedRect(track, 3, 3)
        half = track.width() / 2 / _RANGE_IN_LIMITS
        middle = track.center().x()
        painter.setBrush(theme.colour(theme.ALLOWED, 0.30))
        painter.drawRect(QRectF(middle - half, track.top(), 2 * half, track.height()))
        painter.setPen(QPen(QColor(theme.ALLOWED), 2))
        for x in (middle - half, middle + half):
            painter.drawLine(QPointF(x, track.top() - 3), QPointF(x, track.bottom() + 3))

    def _paint_bar(self, painter: QPainter, track: QRectF, offset_px: float, colour_name: str) -> None:
        span = _RANGE_IN_LIMITS * self._allow_px
        middle, half = track.center().x(), track.width() / 2
        end = middle + half * max(-1.0, min(1.0, offset_px / span))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(colour_name))
        painter.drawRect(QRectF(min(middle, end), track.top() + 3, max(2.0, abs(end - middle)), track.height() - 6))
        if abs(offset_px) > span:
            inward = -8 if offset_px > 0 else 8
            tip = QPointF(end, track.center().y())
            painter.setBrush(QColor(theme.TEXT))
            painter.drawPolygon(QPolygonF([tip, tip + QPointF(inward, -7), tip + QPointF(inward, 7)]))
        painter.setPen(QPen(QColor(theme.TEXT), 2))
        painter.drawLine(QPointF(middle, track.top() - 3), QPointF(middle, track.bottom() + 3))

    def _paint_axis(self, painter: QPainter, box: QRectF) -> None:
        painter.setPen(QColor(theme.TEXT_FAINT))
        painter.setFont(theme.font(theme.Size.LABEL))
        painter.drawText(box, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter, side(-1.0))
        painter.drawText(box, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter, side(1.0))
        half = box.width() / 2 / _RANGE_IN_LIMITS
        for x, text in ((-half, f"{self._allow_px:g}"), (0.0, "0"), (half, f"{self._allow_px:g}")):
            label = QRectF(box.center().x() + x - 20, box.top(), 40, box.height())
            painter.drawText(label, Qt.AlignmentFlag.AlignCenter, text)


FORCE_MARKS_N = (0.15, 0.5)
"""What 95 % of a trial's forces should keep below, and what none may exceed."""
_FORCE_RANGE_N = 0.6
_FORCE_BAND_N = 0.03
_NEAR_USED, _USED_BAND = 0.85, 0.1
"""Share of the room that is used up; the band is one to two pixels in a usual vessel, the picture's noise."""
_AT_WALL_PX = 1.0
_TEXT_EVERY_S = 0.2
_ROLE = ("ALLOWED", "ORANGE", "FAULT")
_HEIGHT = 48


@dataclass(frozen=True, slots=True)
class _Block:
    """One half of the widget. ``texts`` are the same said longer and shorter; the first that fits is shown."""

    texts: tuple[str, ...]
    share: float | None
    level: int
    marks: tuple[tuple[float, str], ...]


class ClearanceBar(QWidget):
    """The room to the wall as a bar that is full on the centerline, and the contact force beside it when the robot tells it.

    A breach (no room left) and a force beyond its marks are said in words, colour and with a sign; they go away only when they are
    clearly over. Without a pose the reason stands there instead of numbers. `pixels_per_mm` None: no millimetres.
    """

    def __init__(self, pixels_per_mm: float | None = None) -> None:
        super().__init__()
        self._pixels_per_mm = pixels_per_mm
        self._walls = Ladder((_NEAR_USED,), _USED_BAND)
        self._breaches = BreachWatch()
        self._forces = Ladder(FORCE_MARKS_N, _FORCE_BAND_N)
        self._pace = Pace(_TEXT_EVERY_S)
        self._room = _room_block(None, 0, tr("no picture yet"))
        self._force: _Block | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMinimumWidth(230)
        self.setFixedHeight(_HEIGHT)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(tr("Room to the wall"))
        self.setToolTip(tip("clearance", "force"))

    def set_scale(self, pixels_per_mm: float | None) -> None:
        self._pixels_per_mm = pixels_per_mm

    @property
    def text(self) -> str:
        """All that is said, in full."""
        return self._room.texts[0] if self._force is None else f"{self._room.texts[0]}; {self._force.texts[0]}"

    @property
    def is_breach(self) -> bool:
        """Whether the breach warning stands."""
        return self._room.level == 2

    def sizeHint(self) -> QSize:
        return QSize(440, _HEIGHT)

    def show_scene(self, scene: Scene | None, status: RobotStatus | None) -> None:
        """The room in `scene` and the force in `status`; None: not known."""
        clearance = clearance_of(scene, self._pixels_per_mm) if scene is not None else None
        force_n = status.wall_contact_n if status is not None else None
        wall = self._walls.update(1.0 - clearance.share if clearance is not None else None)
        if self._breaches.update(clearance, scene.captured_s if scene is not None else 0.0):
            wall = 2
        room = _room_block(clearance, wall, _why_unknown(scene))
        force = _force_block(force_n, self._forces.update(force_n)) if force_n is not None else None
        changed = _kind(room) != _kind(self._room) or _kind(force) != _kind(self._force)
        if not self._pace.due() and not changed:
            # bars follow at once, numbers when they can be read
            room = _with_texts(room, self._room)
            force = _with_texts(force, self._force) if force is not None and self._force is not None else force
        if (room, force) != (self._room, self._force):
            self._room, self._force = room, force
            self.setAccessibleDescription(self.text)
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(theme.WINDOW))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        worst = max(self._room.level, self._force.level if self._force is not None else 0)
        painter.setPen(QPen(QColor(theme.FAULT), 2) if worst == 2 else QPen(QColor(theme.LINE), 1))
        painter.setBrush(QColor(theme.PANEL))
        painter.drawRoundedRect(frame, 6, 6)
        inside = frame.adjusted(12, 4, -12, -3)
        if self._force is None:
            _paint_block(painter, inside, self._room)
        else:
            left = inside.width() * 0.58
            _paint_block(painter, QRectF(inside.left(), inside.top(), left - 14, inside.height()), self._room)
            _paint_block(painter, inside.adjusted(left, 0, 0, 0), self._force)
        painter.end()


def _room_block(clearance: Clearance | None, level: int, why_unknown: str) -> _Block:
    marks = ((0.0, tr("wall")), (1.0, tr("centerline")))
    if clearance is None:
        return _Block(
            (tr("Room to the wall: {why}", why=why_unknown), why_unknown, tr("Room: not known"), tr("not known")),
            None,
            0,
            marks,
        )
    # how far the head seems to be in the wall is an error of the picture, as long as it is no breach
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


def _kind(block: _Block | None) -> tuple[int, str] | None:
    """What must be shown at once when it changes."""
    return None if block is None else (block.level, block.texts[0] if block.share is None else "")


def _with_texts(block: _Block, old: _Block) -> _Block:
    return _Block(old.texts, block.share, block.level, block.marks)


def _paint_block(painter: QPainter, box: QRectF, block: _Block) -> None:
    text_box = QRectF(box.left(), box.top(), box.width(), 20)
    if block.level:
        _paint_sign(painter, QPointF(box.left() + 8, text_box.center().y()), block.level)
        text_box.adjust(22, 0, 0, 0)
    role = "TEXT_FAINT" if block.share is None else _ROLE[block.level] if block.level else "TEXT"
    painter.setPen(QColor(theme.of(role)))
    text_font = theme.bold(14) if block.level else theme.semi_bold(14)
    metrics = QFontMetrics(text_font)
    text = next((text for text in block.texts if metrics.horizontalAdvance(text) <= text_box.width()), block.texts[-1])
    painter.setFont(theme.fitted(text_font, text, int(text_box.width())))
    painter.drawText(text_box, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, text)
    track = QRectF(box.left(), box.top() + 21, box.width(), 8)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(theme.RAISED))
    painter.drawRoundedRect(track, 3, 3)
    if block.share is not None:
        _paint_fill(painter, track, block)
    _paint_marks(painter, track, block.marks, box)


def _paint_fill(painter: QPainter, track: QRectF, block: _Block) -> None:
    share = max(0.0, min(1.0, block.share or 0.0))
    if block.level == 2 and share < 0.1:  # no room: nothing to fill, and yet it must be seen
        painter.setBrush(QBrush(QColor(theme.FAULT), Qt.BrushStyle.BDiagPattern))
        painter.drawRoundedRect(track, 3, 3)
    painter.setBrush(QColor(theme.of(_ROLE[block.level])))
    painter.drawRoundedRect(QRectF(track.left(), track.top(), max(3.0, share * track.width()), track.height()), 3, 3)


def _paint_marks(painter: QPainter, track: QRectF, marks: tuple[tuple[float, str], ...], box: QRectF) -> None:
    mark_font = QFont(theme.font(10))
    painter.setFont(mark_font)
    metrics = QFontMetrics(mark_font)
    for share, text in marks:
        x = track.left() + share * track.width()
        if 0.0 < share < 1.0:
            painter.setPen(QPen(QColor(theme.TEXT), 1.5))
            painter.drawLine(QPointF(x, track.top() - 2), QPointF(x, track.bottom() + 2))
        width = metrics.horizontalAdvance(text) + 2.0
        left = max(box.left(), min(x - width / 2, box.right() - width))
        painter.setPen(QColor(theme.TEXT_FAINT))
        painter.drawText(QRectF(left, track.bottom() + 1, width, 12), Qt.AlignmentFlag.AlignCenter, text)


def _paint_sign(painter: QPainter, middle: QPointF, level: int) -> None:
    """A warning triangle; filled when the limit is passed."""
    name = theme.of(_ROLE[level])
    triangle = QPolygonF([middle + QPointF(x, y) for x, y in ((0.0, -7.0), (8.0, 6.5), (-8.0, 6.5))])
    painter.setPen(QPen(QColor(name), 1.6))
    painter.setBrush(QColor(name) if level == 2 else Qt.BrushStyle.NoBrush)
    painter.drawPolygon(triangle)
    painter.setPen(QColor(theme.INK if level == 2 else name))
    painter.setFont(theme.bold(11))
    painter.drawText(QRectF(middle.x() - 8, middle.y() - 5, 16, 12), Qt.AlignmentFlag.AlignCenter, "!")
