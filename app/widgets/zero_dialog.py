"""The dialog in which the operator says where the joints are: kept zeros to confirm, slack wires, and how far the feeds are in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QCheckBox, QComboBox, QDialog, QDoubleSpinBox, QGridLayout, QLabel, QWidget

from app.ui import theme
from app.ui.i18n import mark, tr
from app.ui.texts import joint_title
from app.widgets.basics import StillWheel, button, column, line, set_main_button, takes_enter
from core.config.safety import JointConfig, JointKind, JointName, ServosConfig, kind_of_name
from core.control.kept_zero import ZeroOffer, ZeroRequest
from hardware.servos.registers import ServoState

if TYPE_CHECKING:
    from hardware.servos.bus_ipc import BusStatus

_SIZE = QSize(760, 420)
_MOVED_MM = 0.3
"""A joint that was moved by more since its zero was kept is said to be."""
_STEP_MM = 0.1
"""Of a feed's number; one step below the envelope stands for no number."""


@dataclass(frozen=True, slots=True)
class JointZero:
    """What is known of a joint's zero.

    ``position_mm``: None where it is not zeroed; ``holds``: None where its servo does not tell; ``kind``: None as the name says.
    """

    name: JointName
    position_mm: float | None = None
    offer: ZeroOffer | None = None
    holds: bool | None = None
    kind: JointKind | None = None

    @property
    def is_tendon(self) -> bool:
        return (self.kind or kind_of_name(self.name)) is JointKind.TENDON

    @property
    def note(self) -> str:
        """In one line."""
        text = self._note
        return text.replace(" mm", "°") if self.kind is JointKind.ROTATION else text

    @property
    def _note(self) -> str:
        if self.position_mm is not None:
            return tr("at {at:.2f} mm", at=self.position_mm) if self.is_tendon else tr("at {at:.1f} mm", at=self.position_mm)
        if self.holds is None:
            return tr("its servo does not answer")
        if self.offer is None:
            return tr("no kept zero that fits") if self.is_tendon else tr("not known: measure how far it is in")
        at, when = self.offer.position_mm, _when(self.offer.kept_s)
        if self.is_tendon:
            text = tr("{at:+.2f} mm from its kept zero ({when})", at=at, when=when)
        else:
            text = tr("last seen at {at:.1f} mm ({when})", at=at - self.offer.moved_mm, when=when)
        moved = tr(", moved by {moved:+.1f} mm since", moved=self.offer.moved_mm) if abs(self.offer.moved_mm) > _MOVED_MM else ""
        return text + moved


def joint_zeros(status: BusStatus | None, servos: ServosConfig) -> tuple[JointZero, ...]:
    """Of all joints, by a status of the bus."""
    if status is None or len(status.servos) != len(servos.joints):
        return tuple(JointZero(joint.name, kind=joint.kind) for joint in servos.joints)
    offers = {offer.name: offer for offer in status.offers}
    return tuple(
        JointZero(joint.name, reading.position_mm if zeroed else None, offers.get(joint.name), reading.torque, joint.kind)
        if isinstance(reading, ServoState)
        else JointZero(joint.name, kind=joint.kind)
        for joint, reading, zeroed in zip(servos.joints, status.servos, status.zeroed, strict=True)
    )


class Choice(Enum):
    """What a tendon's zero rests on."""

    LEAVE = mark("leave as it is")
    KEPT = mark("the kept zero holds")
    SLACK = mark("the wire is slack here")
    AGAIN = mark("the wire was hung in again, and is slack here")


def choices(known: JointZero) -> tuple[Choice, ...]:
    """What can be chosen for a tendon now; the first is proposed. A wire is slack only where its servo does not hold."""
    first = (Choice.KEPT, Choice.LEAVE) if known.offer is not None else (Choice.LEAVE,)
    if known.holds is not False:
        return first
    return (*first, Choice.SLACK if known.position_mm is None and known.offer is None else Choice.AGAIN)


def _when(kept_s: float) -> str:
    """The time of a kept zero: of today without the date. A zero of an earlier version has no time."""
    if kept_s <= 0.0:
        return tr("rig file")
    at = datetime.fromtimestamp(kept_s)
    return f"{at:%H:%M}" if at.date() == datetime.now().date() else f"{at:%Y-%m-%d %H:%M}"


class _TendonRow(QComboBox):
    """The choices of one tendon."""

    def __init__(self, name: JointName) -> None:
        super().__init__()
        self.setAccessibleName(tr("Zero of {joint}", joint=joint_title(name)))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._offered: tuple[Choice, ...] = ()

    @property
    def choice(self) -> Choice:
        found: Choice = self.currentData()
        return found

    def show_joint(self, known: JointZero) -> None:
        """Offer what is possible now; what was chosen stays, where it is."""
        offered = choices(known)
        if offered == self._offered:
            return
        chosen = self.choice if self._offered and self._offered[0] is offered[0] else offered[0]
        self._offered = offered
        self.clear()
        for choice in offered:
            self.addItem(tr(choice.value), choice)
        self.setCurrentIndex(offered.index(chosen if chosen in offered else Choice.LEAVE))
        self.setToolTip(tr("its servo holds: the torque must be off for a wire to be slack") if known.holds else "")


class _FeedRow(QWidget):
    """How far a feed is in: a number that is set when its box is ticked."""

    changed = Signal()

    def __init__(self, joint: JointConfig) -> None:
        super().__init__()
        self._low_mm = joint.low_mm
        self.box = QCheckBox(tr("it is at"))
        self.number = QDoubleSpinBox(decimals=1, singleStep=_STEP_MM, suffix=f" {joint.unit}")
        self.number.setRange(joint.low_mm - _STEP_MM, joint.high_mm)
        self.number.setSpecialValueText(f"? {joint.unit}")
        self.number.setAccessibleName(tr("Position of {joint}", joint=joint_title(joint.name)))
        self.number.setValue(self.number.minimum())
        self.box.setAccessibleName(tr("Set the position of {joint}", joint=joint_title(joint.name)))
        self.setLayout(line(self.box, (self.number, 1), spacing=6))
        self._known: tuple[bool, ...] | None = None
        self._shown_mm: float | None = None
        self.box.toggled.connect(lambda _on: self.changed.emit())
        self.number.valueChanged.connect(self._on_edited)

    @property
    def position_mm(self) -> float | None:
        """The number to set; None: it stays as it is, or no number was given."""
        is_given = self.box.isChecked() and self.number.value() >= self._low_mm - _STEP_MM / 2
        return max(self._low_mm, round(self.number.value(), 1)) if is_given else None

    def show_joint(self, known: JointZero) -> None:
        """Fill in what is offered, or where it is, also while it is moved by hand; what the operator has typed stays."""
        at_mm = known.offer.position_mm if known.offer is not None else known.position_mm
        key = known.position_mm is None, known.offer is not None, known.holds is not None
        if key == self._known and self.number.value() != self._shown_mm:  # typed
            return
        self.number.setValue(self.number.minimum() if at_mm is None else at_mm)
        self._shown_mm = self.number.value()
        if key != self._known:
            self._known = key
            self.box.setChecked(known.position_mm is None and known.holds is not None)

    def _on_edited(self) -> None:
        if self.number.hasFocus():
            self.box.setChecked(True)
        self.changed.emit()


class ZeroDialog(QDialog):
    """One row a joint: what is known of its zero, and what is to be its zero. Nothing is set before the operator says so.

    It does not block the window: STOP stays within reach. It shows the state of the servos as long as it is open.

    Attributes
    ----------
    zero_asked : a ZeroRequest.
    search_asked : the wizard's search for slack, which is the way where a tendon has no kept zero.
    torque_off_asked : all servos.
    """

    zero_asked = Signal(object)
    search_asked = Signal()
    torque_off_asked = Signal()

    def __init__(self, servos: ServosConfig, parent: QWidget | None = None) -> None:
        super().__init__(parent, modal=False)
        self.setWindowTitle(tr("Where the joints are"))
        theme.set_sheet(self, theme.FORM_SHEET)
        self.resize(_SIZE)
        self._tendons = {joint.name: _TendonRow(joint.name) for joint in servos.tendons}
        self._feeds = {joint.name: _FeedRow(joint) for joint in servos.joints if not joint.is_tendon}
        self._notes: dict[JointName, QLabel] = {}
        rows = QGridLayout()
        rows.setHorizontalSpacing(14)
        rows.setVerticalSpacing(6)
        rows.setColumnStretch(1, 1)
        for place, name in enumerate(servos.names):
            title, note = QLabel(joint_title(name)), QLabel(wordWrap=True)
            title.setFont(theme.semi_bold(theme.Size.BODY))
            self._notes[name] = note
            for column_number, part in enumerate((title, note, self._tendons.get(name) or self._feeds[name])):
                rows.addWidget(part, place, column_number)
        self._hint = QLabel(wordWrap=True)
        theme.set_sheet(self._hint, "color: @TEXT_DIM;")
        search_tip = tr("The rig wizard pulls each wire until the head follows (page Zero and pretension)")
        self.search_button = button(tr("&Search for slack..."), self._on_search, search_tip)
        off_tip = tr("Let all motors go; the wires spring back")
        self.off_button = button(tr("&Torque off"), self.torque_off_asked.emit, off_tip)
        self.set_button, self.leave_button = button(tr("S&et"), self._on_set), button(tr("Cancel"), self.close)
        buttons = line(self.search_button, self.off_button, None, self.set_button, self.leave_button, spacing=12)
        self.setLayout(column(self._hint, rows, buttons, spacing=12, margins=(18, 14, 18, 14)))
        StillWheel(self)
        for box in self._tendons.values():
            box.currentIndexChanged.connect(self._update_buttons)
        for feed in self._feeds.values():
            feed.changed.connect(self._update_buttons)
        self._joints: tuple[JointZero, ...] = ()
        self.show_joints(joint_zeros(None, servos))

    @property
    def request(self) -> ZeroRequest:
        by_choice = {name: row.choice for name, row in self._tendons.items()}
        slack = [name for name, choice in by_choice.items() if choice in {Choice.SLACK, Choice.AGAIN}]
        feeds = {name: at_mm for name, row in self._feeds.items() if (at_mm := row.position_mm) is not None}
        return ZeroRequest(
            positions_mm={**dict.fromkeys(slack, 0.0), **feeds},
            kept=tuple(name for name, choice in by_choice.items() if choice is Choice.KEPT),
            forgotten=tuple(name for name, choice in by_choice.items() if choice is Choice.AGAIN),
        )

    @property
    def notes(self) -> list[str]:
        """What is said of each joint."""
        return [note.text() for note in self._notes.values()]

    def tendon(self, name: JointName) -> QComboBox:
        return self._tendons[name]

    def feed(self, name: JointName) -> tuple[QCheckBox, QDoubleSpinBox]:
        return self._feeds[name].box, self._feeds[name].number

    def show_joints(self, joints: Sequence[JointZero]) -> None:
        """The newest state of the servos; what was chosen stays, as far as it is still possible."""
        if tuple(joints) == self._joints:
            return
        self._joints = tuple(joints)
        for known in self._joints:
            self._notes[known.name].setText(known.note)
            (self._tendons.get(known.name) or self._feeds[known.name]).show_joint(known)
        needs_search = any(one.is_tendon and one.position_mm is None and one.offer is None for one in self._joints)
        self._hint.setText(
            tr(
                "A tendon has no kept zero: search for slack, which pulls each wire until the head follows. By hand: torque off, "
                "see that the wire is slack, and say so."
            )
            if needs_search
            else tr(
                "A kept zero holds as long as the wire was not hung in again. Say how far robot and catheter are in: measure it."
            )
        )
        set_main_button(self.search_button, needs_search)
        set_main_button(self.set_button, not needs_search)
        self.off_button.setEnabled(any(one.holds for one in self._joints))
        self._update_buttons()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if not takes_enter(self, event):
            super().keyPressEvent(event)

    def _update_buttons(self) -> None:
        if self._joints:
            request = self.request
            self.set_button.setEnabled(bool(request.positions_mm or request.kept))

    def _on_search(self) -> None:
        self.close()
        self.search_asked.emit()

    def _on_set(self) -> None:
        request = self.request
        self.close()
        self.zero_asked.emit(request)
