"""How much room the head has to the wall, and how hard the robot leans on it where the rig can tell."""

from __future__ import annotations

import math
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QBrush, QColor, QFont, QFontMetrics, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app import palette, theme
from app.cells import number
from app.language import tr
from app.pace import Pace
from app.tool_tips import tip
from app.wording import REASON_TEXT
from core.control.clearance import BreachWatch, Clearance, Ladder, clearance_of
from core.types import RobotStatus, Scene

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
        painter.fillRect(self.rect(), QColor(palette.WINDOW))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        worst = max(self._room.level, self._force.level if self._force is not None else 0)
        painter.setPen(QPen(QColor(palette.FAULT), 2) if worst == 2 else QPen(QColor(palette.LINE), 1))
        painter.setBrush(QColor(palette.PANEL))
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
    painter.setPen(QColor(palette.of(role)))
    text_font = theme.bold(14) if block.level else theme.semi_bold(14)
    metrics = QFontMetrics(text_font)
    text = next((text for text in block.texts if metrics.horizontalAdvance(text) <= text_box.width()), block.texts[-1])
    painter.setFont(theme.fitted(text_font, text, int(text_box.width())))
    painter.drawText(text_box, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, text)
    track = QRectF(box.left(), box.top() + 21, box.width(), 8)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(palette.RAISED))
    painter.drawRoundedRect(track, 3, 3)
    if block.share is not None:
        _paint_fill(painter, track, block)
    _paint_marks(painter, track, block.marks, box)


def _paint_fill(painter: QPainter, track: QRectF, block: _Block) -> None:
    share = max(0.0, min(1.0, block.share or 0.0))
    if block.level == 2 and share < 0.1:  # no room: nothing to fill, and yet it must be seen
        painter.setBrush(QBrush(QColor(palette.FAULT), Qt.BrushStyle.BDiagPattern))
        painter.drawRoundedRect(track, 3, 3)
    painter.setBrush(QColor(palette.of(_ROLE[block.level])))
    painter.drawRoundedRect(QRectF(track.left(), track.top(), max(3.0, share * track.width()), track.height()), 3, 3)


def _paint_marks(painter: QPainter, track: QRectF, marks: tuple[tuple[float, str], ...], box: QRectF) -> None:
    mark_font = QFont(theme.font(10))
    painter.setFont(mark_font)
    metrics = QFontMetrics(mark_font)
    for share, text in marks:
        x = track.left() + share * track.width()
        if 0.0 < share < 1.0:
            painter.setPen(QPen(QColor(palette.TEXT), 1.5))
            painter.drawLine(QPointF(x, track.top() - 2), QPointF(x, track.bottom() + 2))
        width = metrics.horizontalAdvance(text) + 2.0
        left = max(box.left(), min(x - width / 2, box.right() - width))
        painter.setPen(QColor(palette.TEXT_FAINT))
        painter.drawText(QRectF(left, track.bottom() + 1, width, 12), Qt.AlignmentFlag.AlignCenter, text)


def _paint_sign(painter: QPainter, middle: QPointF, level: int) -> None:
    """A warning triangle; filled when the limit is passed."""
    name = palette.of(_ROLE[level])
    triangle = QPolygonF([middle + QPointF(x, y) for x, y in ((0.0, -7.0), (8.0, 6.5), (-8.0, 6.5))])
    painter.setPen(QPen(QColor(name), 1.6))
    painter.setBrush(QColor(name) if level == 2 else Qt.BrushStyle.NoBrush)
    painter.drawPolygon(triangle)
    painter.setPen(QColor(palette.INK if level == 2 else name))
    painter.setFont(theme.bold(11))
    painter.drawText(QRectF(middle.x() - 8, middle.y() - 5, 16, 12), Qt.AlignmentFlag.AlignCenter, "!")
