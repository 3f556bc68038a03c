"""The keys that move the robot, on the screen: they light up when pressed, can be held with the mouse, and show how far it went."""

from __future__ import annotations

from enum import Enum

from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QPainter
from PySide6.QtWidgets import QComboBox, QGridLayout, QWidget

from app.ui import theme
from app.ui.i18n import mark, tr
from app.ui.texts import tip
from app.widgets.basics import QuietCombo, column
from app.widgets.mode_bar import MouseHeld
from app.widgets.painting import (
    CENTER,
    NONE,
    RIGHT,
    PaintedWidget,
    draw_box,
    draw_middle_bar,
    draw_text,
    draw_track,
    set_colours,
    text_width,
)
from core.config.models import JogConfig
from core.config.safety import JointKind, ServosConfig
from core.control.joints import bend_of_status, direction
from core.control.motion import can_pitch, can_turn, hand_speeds
from core.types import Advice, RobotStatus


class Motion(Enum):
    """A motion of the robot that lasts as long as a key is held."""

    STEER_LEFT = mark("steer left")
    STEER_RIGHT = mark("steer right")
    ADVANCE = mark("advance")
    RETRACT = mark("retract")
    PITCH_UP = mark("pitch up")
    PITCH_DOWN = mark("pitch down")
    DELIVER = mark("sheath forward")
    WITHDRAW = mark("sheath back")
    STRAIGHTEN = mark("straighten the head")
    TURN_LEFT = mark("turn the shaft left")
    TURN_RIGHT = mark("turn the shaft right")


KEYS: dict[Motion, tuple[Qt.Key, ...]] = {
    Motion.STEER_LEFT: (Qt.Key.Key_Left, Qt.Key.Key_A),
    Motion.STEER_RIGHT: (Qt.Key.Key_Right, Qt.Key.Key_D),
    Motion.ADVANCE: (Qt.Key.Key_Up, Qt.Key.Key_W),
    Motion.RETRACT: (Qt.Key.Key_Down, Qt.Key.Key_S),
    Motion.PITCH_UP: (Qt.Key.Key_E,),
    Motion.PITCH_DOWN: (Qt.Key.Key_Q,),
    Motion.DELIVER: (Qt.Key.Key_PageUp,),
    Motion.WITHDRAW: (Qt.Key.Key_PageDown,),
    Motion.STRAIGHTEN: (Qt.Key.Key_X,),
    Motion.TURN_LEFT: (Qt.Key.Key_Z,),
    Motion.TURN_RIGHT: (Qt.Key.Key_C,),
}
_STRAIGHT_DEG = 0.5
"""Less steering is shown as straight (``texts.advice_headline``)."""


def advised_motions(advice: Advice | None) -> frozenset[Motion]:
    """The motions by hand that follow an advice."""
    if advice is None:
        return frozenset()
    feed = {Motion.ADVANCE} if advice.advance_mm_s > 0.0 else {Motion.RETRACT} if advice.advance_mm_s < 0.0 else set()
    if abs(advice.steer_deg) >= _STRAIGHT_DEG:
        feed.add(Motion.STEER_RIGHT if advice.steer_deg > 0.0 else Motion.STEER_LEFT)
    return frozenset(feed)


def motions_of(servos: ServosConfig) -> frozenset[Motion]:
    """The motions that a robot has."""
    found = {Motion.STEER_LEFT, Motion.STEER_RIGHT, Motion.STRAIGHTEN}
    kinds = {joint.kind for joint in servos.joints}
    if can_pitch(servos):
        found |= {Motion.PITCH_UP, Motion.PITCH_DOWN}
    if can_turn(servos):
        found |= {Motion.TURN_LEFT, Motion.TURN_RIGHT}
    if JointKind.ADVANCE in kinds:
        found |= {Motion.ADVANCE, Motion.RETRACT}
    if JointKind.DELIVERY in kinds:
        found |= {Motion.DELIVER, Motion.WITHDRAW}
    return frozenset(found)


def _taking_part(servos: ServosConfig) -> tuple[list[int], list[int]]:
    """Places of the joints that bend and pitch rest on."""
    rotation = [place for place, joint in enumerate(servos.joints) if joint.kind is JointKind.ROTATION]
    ways = [direction(joint) for joint in servos.tendons]
    across, up = ([place for place, way in enumerate(ways) if rotation or way[axis] != 0.0] + rotation for axis in (0, 1))
    return across, up


_LINE_PX, _BETWEEN_PX, _SMALLEST_PX = 17, 6, 10


class JogReadout(PaintedWidget):
    """Bend and pitch as bars from the middle, how far the robot is in, and below them how fast a held key changes that.

    An unknown value is a dash and a bar without a mark, which differs from a straight head.
    """

    def __init__(self) -> None:
        super().__init__(tr("Bend, pitch and insertion"), tip("bend", "pitch", "insertion", "hand_speeds"), height=2 * _LINE_PX)
        self._bend: float | None = None
        self._pitch: float | None = None
        self._insertion_mm: float | None = None
        self.speeds = ""
        self._describe()

    @property
    def text(self) -> str:
        bend, pitch = (NONE if share is None else f"{share:.2f}" for share in (self._bend, self._pitch))
        return tr("bend {bend}, pitch {pitch}, inserted {inserted} mm", bend=bend, pitch=pitch, inserted=self._inserted)

    @property
    def _inserted(self) -> str:
        return NONE if self._insertion_mm is None else f"{self._insertion_mm:.0f}"

    def show_values(self, bend: float | None, pitch: float | None, insertion_mm: float | None) -> None:
        """Shares of full pull, -1..1, and millimetres; None: not known."""
        values = tuple(
            None if value is None else round(value, digits) for value, digits in ((bend, 2), (pitch, 2), (insertion_mm, 0))
        )
        if values != (self._bend, self._pitch, self._insertion_mm):
            self._bend, self._pitch, self._insertion_mm = values
            self._describe()

    def show_speeds(self, speeds: str) -> None:
        self.speeds = speeds
        self._describe()

    def _describe(self) -> None:
        self.setAccessibleDescription(f"{self.text}; {self.speeds}" if self.speeds else self.text)
        self.update()

    def paint(self, painter: QPainter) -> None:
        label, names = theme.font(theme.Size.LABEL), (tr("bend"), tr("pitch"))
        inserted = tr("inserted {inserted} mm", inserted=self._inserted)
        # room for three digits, so that the bars do not grow and shrink as the robot goes in
        last_px = max(text_width(label, text) for text in (inserted, tr("inserted {inserted} mm", inserted="000")))
        spare_px = self.width() - last_px - sum(text_width(label, name) for name in names) - 4 * _BETWEEN_PX
        bar_px, left = max(8.0, spare_px / 2), 0.0
        for name, share in zip(names, (self._bend, self._pitch), strict=True):
            name_px = text_width(label, name)
            draw_text(painter, QRectF(left, 0, name_px + 1, _LINE_PX), name, label, theme.TEXT_DIM)
            track = QRectF(left + name_px + _BETWEEN_PX, _LINE_PX / 2 - 4, bar_px, 8)
            draw_track(painter, track)
            if share is not None:
                draw_middle_bar(painter, track, share, theme.SKY)
            left = track.right() + _BETWEEN_PX
        draw_text(painter, QRectF(self.width() - last_px, 0, last_px, _LINE_PX), inserted, label, theme.TEXT_DIM, RIGHT)
        colour = theme.TEXT_DIM if self.isEnabled() else theme.TEXT_FAINT
        room = QRectF(0, _LINE_PX, self.width(), _LINE_PX)
        draw_text(painter, room, self.speeds, label, colour, smallest_px=_SMALLEST_PX, elided=True)


_SPEEDS = mark("speeds: feed {feed:.3g}, sheath {sheath:.3g}, tendons {wires} mm/s")
_SPEEDS_BARE = mark("speeds: feed {feed:.3g}, tendons {wires} mm/s")
_FED = mark("{motion}: hold to move, release to stop; {speed:.3g} mm/s")
_TURNED = mark("{motion}: hold to move, release to stop; {speed:.3g} °/s")
_PULLED = mark("{motion}: hold to move, release to stop; the tendons are pulled {speed:.3g} mm/s")


class JogPanel(QWidget):
    """``pressed`` and ``released`` carry a motion that is held with the mouse; ``speed_changed`` a share of full speed, 0..1.

    Keys of motions that the robot does not have are hidden.
    """

    pressed = Signal(object)
    released = Signal(object)
    speed_changed = Signal(float)

    def __init__(self, servos: ServosConfig) -> None:
        super().__init__()
        self._servos = servos
        self._caps: dict[Motion, _Cap] = {}
        self._rig: tuple[JogConfig, ServosConfig] | None = None
        self._status: RobotStatus | None = None
        self._known: tuple[bool, ...] | None = None
        self._enabled = (True, "")
        grid = QGridLayout()
        grid.setSpacing(4)
        for motion, row, place, arrow, key, text in (
            (Motion.PITCH_DOWN, 0, 0, None, "Q", tr("pitch down")),
            (Motion.ADVANCE, 0, 1, QPointF(0, -1), "W", tr("advance")),
            (Motion.PITCH_UP, 0, 2, None, "E", tr("pitch up")),
            (Motion.STEER_LEFT, 1, 0, QPointF(-1, 0), "A", tr("left")),
            (Motion.RETRACT, 1, 1, QPointF(0, 1), "S", tr("retract")),
            (Motion.STEER_RIGHT, 1, 2, QPointF(1, 0), "D", tr("right")),
            (Motion.DELIVER, 0, 3, None, "PgUp", tr("sheath +")),
            (Motion.WITHDRAW, 1, 3, None, "PgDn", tr("sheath \N{MINUS SIGN}")),
            (Motion.TURN_LEFT, 0, 4, None, "Z", tr("turn left")),
            (Motion.TURN_RIGHT, 1, 4, None, "C", tr("turn right")),
            (Motion.STRAIGHTEN, 2, 0, None, "X", tr("straighten")),
        ):
            is_wide = motion is Motion.STRAIGHTEN
            cap = _Cap(arrow, key, text, wide=is_wide)
            cap.setAccessibleName(tr(motion.value))
            cap.setToolTip(tr("{motion}: hold to move, release to stop", motion=tr(motion.value)))
            cap.pressed.connect(lambda which=motion: self.pressed.emit(which))
            cap.released.connect(lambda which=motion: self.released.emit(which))
            grid.addWidget(cap, row, place, 1, 2 if is_wide else 1)
            self._caps[motion] = cap
        wide = tr("bring bend and pitch back to the middle: hold to move, release to stop")
        self._caps[Motion.STRAIGHTEN].setToolTip(wide)
        self._show_motions()
        self._speed = self._speed_choice()
        grid.addWidget(self._speed, 2, 2, 1, 2)
        self._readout = JogReadout()
        self.setLayout(column((grid, 1), self._readout, spacing=4))
        self.setAccessibleName(tr("Keys that move the robot"))

    @property
    def readout(self) -> str:
        return self._readout.text

    @property
    def speeds(self) -> str:
        """What a held key makes, as it is written below the keys; "" as long as no rig is known."""
        return self._readout.speeds

    def set_speeds(self, hand: JogConfig, servos: ServosConfig) -> None:
        """The speeds of the keys: a share of `hand`'s full speeds, limited by the joints' speeds."""
        self._rig, self._servos = (hand, servos), servos
        self._show_motions()
        self._show_speeds()

    def _show_motions(self) -> None:
        had = motions_of(self._servos)
        for motion, cap in self._caps.items():
            cap.setVisible(motion in had)

    def _show_speeds(self) -> None:
        if self._rig is None:
            return
        speeds = hand_speeds(*self._rig, self._speed.currentData())
        bend, pitch, had = f"{speeds.bend_mm_s:.3g}", f"{speeds.pitch_mm_s:.3g}", motions_of(self._servos)
        wires = bend if bend == pitch or Motion.PITCH_UP not in had else f"{bend}/{pitch}"
        text = _SPEEDS if Motion.DELIVER in had else _SPEEDS_BARE
        self._readout.show_speeds(tr(text, feed=speeds.advance_mm_s, sheath=speeds.delivery_mm_s, wires=wires))
        for text, speed_mm_s, motions in (
            (_FED, speeds.advance_mm_s, (Motion.ADVANCE, Motion.RETRACT)),
            (_FED, speeds.delivery_mm_s, (Motion.DELIVER, Motion.WITHDRAW)),
            (_PULLED, speeds.bend_mm_s, (Motion.STEER_LEFT, Motion.STEER_RIGHT)),
            (_PULLED, speeds.pitch_mm_s, (Motion.PITCH_UP, Motion.PITCH_DOWN)),
        ):
            for motion in motions:
                self._caps[motion].setToolTip(tr(text, motion=tr(motion.value), speed=speed_mm_s))
        for motion in (Motion.TURN_LEFT, Motion.TURN_RIGHT):
            self._caps[motion].setToolTip(tr(_TURNED, motion=tr(motion.value), speed=speeds.rotation_deg_s))

    def show_held(self, held: frozenset[Motion]) -> None:
        """Light the caps of the held motions."""
        for motion, cap in self._caps.items():
            cap.light(motion in held)

    def show_advised(self, advised: frozenset[Motion]) -> None:
        """Frame the caps of the motions that are advised."""
        for motion, cap in self._caps.items():
            cap.advise(motion in advised)

    def show_status(self, status: RobotStatus | None) -> None:
        """How the head is bent, as the tendons are pulled, and how far in the robot is; None: not known."""
        self._status = status
        if status is None:
            self._readout.show_values(None, None, None)
            return
        servos, values = self._servos, bend_of_status(status, self._servos)
        known = self._known if self._known is not None else (True,) * len(servos.joints)
        across, up = _taking_part(servos)
        is_inserted_known = all(known[servos.places(JointKind.ADVANCE)])
        self._readout.show_values(
            values[0] if values is not None and all(known[place] for place in across) else None,
            values[1] if values is not None and all(known[place] for place in up) else None,
            status.insertion_mm if is_inserted_known else None,
        )

    def show_known(self, joints: tuple[bool, ...]) -> None:
        """Of which of the joints it is known where they are."""
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
        self._show_speeds()
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
        super().__init__(hint=(62, 22 if wide else 30), least=(46, 22 if wide else 30))
        self._arrow = arrow
        self._key = key
        self._text = text
        self._wide = wide
        self.is_lit = self.is_advised = False
        self.setMaximumHeight(28 if wide else 44)

    def light(self, on: bool) -> None:
        if on != self.is_lit:
            self.is_lit = on
            self.update()

    def advise(self, on: bool) -> None:
        if on != self.is_advised:
            self.is_advised = on
            self.update()

    def on_held(self, held: bool) -> None:
        (self.pressed if held else self.released).emit()

    def paint(self, painter: QPainter) -> None:
        frame = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        back, text, label = theme.RAISED, theme.TEXT, theme.TEXT_DIM
        if self.is_lit:
            back, text, label = theme.SKY, theme.INK, theme.INK
        elif not self.isEnabled():
            back, text, label = theme.PANEL, theme.TEXT_FAINT, theme.TEXT_FAINT
        is_framed = self.is_advised and self.isEnabled()
        draw_box(painter, frame, 5, back, theme.SKY if self.is_lit or is_framed else theme.LINE, 2.0 if is_framed else 1.0)
        if self._wide:
            draw_text(painter, frame, f"{self._key}:  {self._text}", theme.semi_bold(12), text, CENTER)
            return
        top = QRectF(frame.left(), frame.center().y() - 15, frame.width(), 16)
        draw_text(painter, top.translated(8 if self._arrow else 0, 0), self._key, theme.semi_bold(13), text, CENTER)
        if self._arrow:
            tip_at = QPointF(top.center().x() - 9, top.center().y()) + self._arrow * 5
            across, back_at = QPointF(-self._arrow.y(), self._arrow.x()) * 5, tip_at - self._arrow * 9
            set_colours(painter, text)
            painter.drawPolygon([tip_at, back_at + across, back_at - across])
        below = QRectF(frame.left(), frame.center().y() + 1, frame.width(), 14)
        draw_text(painter, below, self._text, theme.font(11), label, CENTER)
