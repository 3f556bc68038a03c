"""The keys that move the robot, on the screen: they light up when pressed, and can be held with the mouse too."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QComboBox, QGridLayout, QSizePolicy, QVBoxLayout, QWidget

from app import palette, theme
from app.jog_keys import Motion
from app.language import mark, tr
from app.widgets.jog_readout import JogReadout, speeds_in_words
from app.widgets.mouse_held import MouseHeld
from app.widgets.quiet_combo import QuietCombo
from core.control.hand import HandSpeeds, hand_speeds
from core.policy_config import HandConfig
from core.servo_config import ServosConfig
from core.types import RobotStatus

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
        self._rig: tuple[HandConfig, ServosConfig] | None = None
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

    def set_speeds(self, hand: HandConfig, servos: ServosConfig) -> None:
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
        back, text, label = palette.RAISED, palette.TEXT, palette.TEXT_DIM
        if self._lit:
            back, text, label = palette.SKY, palette.INK, palette.INK
        elif not self.isEnabled():
            back, text, label = palette.PANEL, palette.TEXT_FAINT, palette.TEXT_FAINT
        painter.setPen(QPen(QColor(palette.SKY if self._lit else palette.LINE), 1))
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


def _speed_of(speeds: HandSpeeds) -> dict[Motion, float]:
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
