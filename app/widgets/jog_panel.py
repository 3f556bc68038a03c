"""The keys that move the robot, on the screen: they light up when pressed, and can be held with the mouse too.

How far the head is bent and the robot in, and what the keys make of that while they are held.
"""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFontMetrics, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QComboBox, QGridLayout, QSizePolicy, QVBoxLayout, QWidget

from app.operator.manual_drive import Motion
from app.ui import theme
from app.ui.i18n import mark, tr
from app.ui.texts import tip
from app.widgets.basics import QuietCombo
from app.widgets.mode_bar import MouseHeld
from core.config.models import JogConfig
from core.config.safety import ServosConfig
from core.control.motion import JogSpeeds, hand_speeds
from core.types import RobotStatus

_LINE_PX, _BETWEEN_PX, _SMALLEST_PX = 17, 6, 10
_UNKNOWN = "\N{EN DASH}"


class JogReadout(QWidget):
    """Bend and pitch as bars from the middle, how far the robot is in, and below them how fast a held key changes that.

    What is not known is a dash, and a bar without a mark: it must not pass for a straight head.
    """

    def __init__(self) -> None:
        super().__init__()
        self._bend: float | None = None
        self._pitch: float | None = None
        self._insertion_mm: float | None = None
        self._speeds = ""
        self.setFixedHeight(2 * _LINE_PX)
        self.setAccessibleName(tr("Bend, pitch and insertion"))
        self._say()
        self.setToolTip(tip("bend", "pitch", "insertion", "hand_speeds"))

    @property
    def text(self) -> str:
        return tr(
            "bend {bend}, pitch {pitch}, in {inserted} mm",
            bend=_number(self._bend),
            pitch=_number(self._pitch),
            inserted=self._inserted,
        )

    @property
    def speeds(self) -> str:
        return self._speeds

    @property
    def _inserted(self) -> str:
        return _UNKNOWN if self._insertion_mm is None else f"{self._insertion_mm:.0f}"

    def show_values(self, bend: float | None, pitch: float | None, insertion_mm: float | None) -> None:
        """Shares of full pull, -1..1, and millimetres; None: not known."""
        values = (_rounded(bend, 2), _rounded(pitch, 2), _rounded(insertion_mm, 0))
        if values != (self._bend, self._pitch, self._insertion_mm):
            self._bend, self._pitch, self._insertion_mm = values
            self._say()

    def show_speeds(self, speeds: str) -> None:
        self._speeds = speeds
        self._say()

    def _say(self) -> None:
        self.setAccessibleDescription(f"{self.text}; {self._speeds}" if self._speeds else self.text)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        label = theme.font(theme.Size.LABEL)
        painter.setFont(label)
        metrics = QFontMetrics(label)
        inserted = tr("in {inserted} mm", inserted=self._inserted)
        names = (tr("bend"), tr("pitch"))
        # room for three digits, so that the bars do not grow and shrink as the robot goes in
        last_px = max(metrics.horizontalAdvance(text) for text in (inserted, tr("in {inserted} mm", inserted="000")))
        spare_px = self.width() - last_px - sum(metrics.horizontalAdvance(name) for name in names) - 4 * _BETWEEN_PX
        left = 0.0
        for name, share in zip(names, (self._bend, self._pitch), strict=True):
            painter.setPen(QColor(theme.TEXT_DIM))
            name_px = metrics.horizontalAdvance(name)
            painter.drawText(QRectF(left, 0, name_px + 1, _LINE_PX), Qt.AlignmentFlag.AlignVCenter, name)
            left += name_px + _BETWEEN_PX
            _paint_bar(painter, QRectF(left, _LINE_PX / 2 - 4, max(8.0, spare_px / 2), 8), share)
            left += max(8.0, spare_px / 2) + _BETWEEN_PX
        painter.setPen(QColor(theme.TEXT_DIM))
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        painter.drawText(QRectF(self.width() - last_px, 0, last_px, _LINE_PX), right, inserted)
        painter.setPen(QColor(theme.TEXT_DIM if self.isEnabled() else theme.TEXT_FAINT))
        painter.setFont(theme.fitted(label, self._speeds, self.width(), _SMALLEST_PX))
        room = QRectF(0, _LINE_PX, self.width(), _LINE_PX)
        painter.drawText(room, Qt.AlignmentFlag.AlignVCenter, theme.elide(painter.font(), self._speeds, self.width()))
        painter.end()


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def _number(share: float | None) -> str:
    return _UNKNOWN if share is None else f"{share:.2f}"


def _paint_bar(painter: QPainter, track: QRectF, share: float | None) -> None:
    """From the middle of `track` to the left or right; `share` is -1..1, or None."""
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(theme.RAISED))
    painter.drawRoundedRect(track, 3, 3)
    if share is None:
        return
    center = track.center().x()
    end = center + max(-1.0, min(1.0, share)) * track.width() / 2
    painter.setBrush(QColor(theme.SKY))
    painter.drawRect(QRectF(min(center, end), track.top(), max(2.0, abs(end - center)), track.height()))


def speeds_in_words(speeds: JogSpeeds) -> str:
    bend, pitch = f"{speeds.bend_mm_s:.3g}", f"{speeds.pitch_mm_s:.3g}"
    return tr(
        "feed {feed:.3g}, sheath {sheath:.3g}, wires {wires} mm/s",
        feed=speeds.advance_mm_s,
        sheath=speeds.delivery_mm_s,
        wires=bend if bend == pitch else f"{bend}/{pitch}",
    )


_FEEDS = (Motion.ADVANCE, Motion.RETRACT, Motion.DELIVER, Motion.WITHDRAW)
_FED = mark("{motion}: hold to move, release to stop; {speed:.3g} mm/s")
_PULLED = mark("{motion}: hold to move, release to stop; the tendons are pulled {speed:.3g} mm/s")
_ALL = (True,) * 7
_LEFT, _RIGHT, _UP, _DOWN = (QPointF(-1, 0), QPointF(1, 0), QPointF(0, -1), QPointF(0, 1))


class JogPanel(QWidget):
    """``pressed`` and ``released`` carry a motion that is held with the mouse; ``speed_changed`` a share of full speed, 0..1.

    `max_pull_mm` is the tendons' pull at a bend of 1.
    """

    pressed = Signal(object)
    released = Signal(object)
    speed_changed = Signal(float)

    def __init__(self, max_pull_mm: float) -> None:
        super().__init__()
        self.max_pull_mm = max_pull_mm
        self._caps: dict[Motion, _Cap] = {}
        self._rig: tuple[JogConfig, ServosConfig] | None = None
        self._status: RobotStatus | None = None
        self._known: tuple[bool, ...] = _ALL
        self._enabled = (True, "")
        grid = QGridLayout()
        grid.setSpacing(4)
        for motion, row, column, arrow, key, text in (
            (Motion.PITCH_DOWN, 0, 0, None, "Q", tr("dip")),
            (Motion.ADVANCE, 0, 1, _UP, "W", tr("advance")),
            (Motion.PITCH_UP, 0, 2, None, "E", tr("lift")),
            (Motion.STEER_LEFT, 1, 0, _LEFT, "A", tr("left")),
            (Motion.RETRACT, 1, 1, _DOWN, "S", tr("retract")),
            (Motion.STEER_RIGHT, 1, 2, _RIGHT, "D", tr("right")),
            (Motion.DELIVER, 0, 3, None, "PgUp", tr("sheath +")),
            (Motion.WITHDRAW, 1, 3, None, "PgDn", tr("sheath \N{MINUS SIGN}")),
        ):
            cap = _Cap(arrow, key, text)
            cap.setAccessibleName(tr(motion.value))
            cap.setToolTip(tr("{motion}: hold to move, release to stop", motion=tr(motion.value)))
            cap.pressed.connect(lambda which=motion: self.pressed.emit(which))
            cap.released.connect(lambda which=motion: self.released.emit(which))
            grid.addWidget(cap, row, column)
            self._caps[motion] = cap
        straighten = _Cap(None, "X", tr("straighten"), wide=True)
        straighten.setAccessibleName(tr(Motion.STRAIGHTEN.value))
        straighten.setToolTip(tr("bring bend and pitch back to the middle: hold to move, release to stop"))
        straighten.pressed.connect(lambda: self.pressed.emit(Motion.STRAIGHTEN))
        straighten.released.connect(lambda: self.released.emit(Motion.STRAIGHTEN))
        grid.addWidget(straighten, 2, 0, 1, 2)
        self._caps[Motion.STRAIGHTEN] = straighten
        self._speed = self._speed_choice()
        grid.addWidget(self._speed, 2, 2, 1, 2)
        self._readout = JogReadout()
        rows = QVBoxLayout(self)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.setSpacing(4)
        rows.addLayout(grid, 1)
        rows.addWidget(self._readout)
        self.setAccessibleName(tr("Keys that move the robot"))

    @property
    def readout(self) -> str:
        return self._readout.text

    @property
    def speeds(self) -> str:
        """What a held key makes, as it is written below the keys; "" as long as no rig is known."""
        return self._readout.speeds

    def set_speeds(self, hand: JogConfig, servos: ServosConfig) -> None:
        """Whose speeds the keys have: a share of `hand`'s full speeds, as far as the joints may go that fast."""
        self._rig = hand, servos
        self._tell_speeds()

    def _tell_speeds(self) -> None:
        if self._rig is None:
            return
        speeds = hand_speeds(*self._rig, self._speed.currentData())
        self._readout.show_speeds(speeds_in_words(speeds))
        for motion, speed_mm_s in _speed_of(speeds).items():
            text = _FED if motion in _FEEDS else _PULLED
            self._caps[motion].setToolTip(tr(text, motion=tr(motion.value), speed=speed_mm_s))

    def show_held(self, held: frozenset[Motion]) -> None:
        """Light the caps of what is held."""
        for motion, cap in self._caps.items():
            cap.light(motion in held)

    def show_status(self, status: RobotStatus | None) -> None:
        """How the head is bent, as the tendons are pulled, and how far in the robot is; None: nobody knows."""
        self._status = status
        if status is None:
            self._readout.show_values(None, None, None)
            return
        right, left, up, down = status.tendon_pull_mm
        full_mm = 2.0 * self.max_pull_mm
        bend, pitch, insertion_mm = (right - left) / full_mm, (up - down) / full_mm, status.insertion_mm
        known = self._known
        self._readout.show_values(
            bend if known[0] and known[1] else None, pitch if known[2] and known[3] else None, insertion_mm if known[4] else None
        )

    def show_known(self, joints: tuple[bool, ...]) -> None:
        """Of which of the seven joints it is known where they are."""
        if joints != self._known:
            self._known = joints
            self.show_status(self._status)

    def _speed_choice(self) -> QComboBox:
        """Full speed, or a share of it for fine work."""
        choice = QuietCombo(tr("Speed by hand"))
        choice.setToolTip(tr("Speed of all motions by hand, of the configured full speed"))
        for share in (1.0, 0.5, 0.2):
            choice.addItem(f"{100 * share:.0f} %", share)
        choice.currentIndexChanged.connect(self._on_speed)
        return choice

    def _on_speed(self, place: int) -> None:
        self._tell_speeds()
        self.speed_changed.emit(self._speed.itemData(place))

    def set_enabled(self, enabled: bool, why: str = "") -> None:
        """Grey the caps out when there is nothing to move."""
        if (enabled, why) == self._enabled:
            return
        self._enabled = enabled, why
        for cap in self._caps.values():
            cap.setEnabled(enabled)
        self._readout.setEnabled(enabled)
        self.setToolTip(why)
        self.setAccessibleDescription(why)


class _Cap(MouseHeld):
    """A key cap. Holding it with the left button is holding the key."""

    pressed = Signal()
    released = Signal()

    def __init__(self, arrow: QPointF | None, key: str, text: str, *, wide: bool = False) -> None:
        super().__init__()
        self._arrow = arrow
        self._key = key
        self._text = text
        self._wide = wide
        self._lit = False
        self.setMinimumSize(46, self.sizeHint().height())
        self.setMaximumHeight(28 if wide else 44)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)

    def sizeHint(self) -> QSize:
        return QSize(62, 22 if self._wide else 30)

    @property
    def is_lit(self) -> bool:
        return self._lit

    def light(self, on: bool) -> None:
        if on != self._lit:
            self._lit = on
            self.update()

    def on_held(self, held: bool) -> None:
        (self.pressed if held else self.released).emit()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        back, text, label = theme.RAISED, theme.TEXT, theme.TEXT_DIM
        if self._lit:
            back, text, label = theme.SKY, theme.INK, theme.INK
        elif not self.isEnabled():
            back, text, label = theme.PANEL, theme.TEXT_FAINT, theme.TEXT_FAINT
        painter.setPen(QPen(QColor(theme.SKY if self._lit else theme.LINE), 1))
        painter.setBrush(QColor(back))
        painter.drawRoundedRect(frame, 5, 5)
        painter.setPen(QColor(text))
        if self._wide:
            painter.setFont(theme.semi_bold(12))
            painter.drawText(frame, Qt.AlignmentFlag.AlignCenter, f"{self._key}:  {self._text}")
            return
        top = QRectF(frame.left(), frame.center().y() - 15, frame.width(), 16)
        painter.setFont(theme.semi_bold(13))
        painter.drawText(top.translated(8 if self._arrow is not None else 0, 0), Qt.AlignmentFlag.AlignCenter, self._key)
        if self._arrow is not None:
            self._paint_arrow(painter, QPointF(top.center().x() - 9, top.center().y()), self._arrow, text)
        painter.setPen(QColor(label))
        painter.setFont(theme.font(11))
        painter.drawText(QRectF(frame.left(), frame.center().y() + 1, frame.width(), 14), Qt.AlignmentFlag.AlignCenter, self._text)
        painter.end()

    @staticmethod
    def _paint_arrow(painter: QPainter, middle: QPointF, direction: QPointF, name: str) -> None:
        across = QPointF(-direction.y(), direction.x())
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(name))
        back = middle - direction * 4
        painter.drawPolygon(QPolygonF([middle + direction * 5, back + across * 5, back - across * 5]))


def _speed_of(speeds: JogSpeeds) -> dict[Motion, float]:
    """What each key makes, mm/s."""
    return {
        Motion.ADVANCE: speeds.advance_mm_s,
        Motion.RETRACT: speeds.advance_mm_s,
        Motion.DELIVER: speeds.delivery_mm_s,
        Motion.WITHDRAW: speeds.delivery_mm_s,
        Motion.STEER_LEFT: speeds.bend_mm_s,
        Motion.STEER_RIGHT: speeds.bend_mm_s,
        Motion.PITCH_UP: speeds.pitch_mm_s,
        Motion.PITCH_DOWN: speeds.pitch_mm_s,
    }
