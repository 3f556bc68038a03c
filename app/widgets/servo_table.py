"""The seven servos: what each reports, the balance of the tendon pairs, the bus itself, and what can be done about them."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, Qt, Signal, Slot
from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QMenu,
    QPushButton,
    QStackedLayout,
    QVBoxLayout,
    QWidget,
)

from app import theme
from app.cells import TONE_ROLE, Cell, Tone
from app.language import tr, tr_text
from app.pace import Pace
from app.servo_cells import SILENT_AFTER_S, bus_line, pair_balances, servo_rows
from app.widgets.question_strip import BUTTON_STYLE, QuestionStrip
from app.widgets.servo_model import ServoModel, ServoView
from app.widgets.tendon_balance import TendonBalance
from core.safety_config import SafetyConfig
from core.servo_config import JointConfig, JointName, ServosConfig

if TYPE_CHECKING:
    from hardware.servos.bus_messages import BusStatus

_SHOW_EVERY_S = 0.2
_LINE_ROLE = {**TONE_ROLE, Tone.PLAIN: "TEXT_DIM"}


Entry = tuple[str, Callable[[], object]]
"""Of a menu: its text, and what it does."""


class ServoTable(QWidget):
    """Renewed five times a second at most, and there only the cells that changed.

    The table takes no keyboard focus, as the arrow keys belong to the robot; all that it offers is in the buttons' menus as well.
    Each wish is asked back in the widget itself, then told by a signal.

    Attributes
    ----------
    reboot_asked : servo id.
    zero_asked : list of joint names, or None for all joints.
    torque_off_asked : all servos.

    Parameters
    ----------
    safety : where warnings begin.
    clock : monotonic, that of ``BusStatus.time_s``.
    """

    reboot_asked = Signal(int)
    zero_asked = Signal(object)
    torque_off_asked = Signal()

    def __init__(self, safety: SafetyConfig | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._safety = safety or SafetyConfig()
        self._clock = clock
        self._pace = Pace(_SHOW_EVERY_S, clock)
        self._servos = ServosConfig()
        self._kind: object = None
        self._armed = self._reachable = False
        self._model = ServoModel(servo_rows(None, self._servos, self._safety), self)
        self._table = ServoView(self._model)
        self._table.customContextMenuRequested.connect(self._open_context_menu)
        self._balance = TendonBalance()
        self._bus = QLabel()
        self._bus.setFixedHeight(16)
        self._question = QuestionStrip()
        self._question.closed.connect(self._on_answered)
        self._restart_button, self._zero_button, self._off_button = (
            self._make_button(text, slot)
            for text, slot in (
                (tr("Restart servo\N{HORIZONTAL ELLIPSIS}"), self._open_restart_menu),
                (tr("Zero\N{HORIZONTAL ELLIPSIS}"), self._open_zero_menu),
                (tr("Torque off\N{HORIZONTAL ELLIPSIS}"), self._ask_torque_off),
            )
        )
        self._asked_by: QWidget = self._zero_button
        self._lay_out()
        self.setAccessibleName(tr("Servos"))
        self._show(None, None)

    @property
    def model(self) -> ServoModel:
        return self._model

    @property
    def bus_text(self) -> str:
        return self._bus.text()

    @property
    def question(self) -> QuestionStrip:
        """Where a wish is asked back."""
        return self._question

    def show_status(self, status: BusStatus | None, servos: ServosConfig) -> None:
        """The newest status of the bus, None when there is none; a status that is older than a second is shown as silence."""
        self._servos = servos
        silence_s = self._clock() - status.time_s if status is not None else 0.0
        is_silent = silence_s > SILENT_AFTER_S
        kind = (status is None, is_silent, status.phase if status is not None else None)
        if self._pace.due() or kind != self._kind:
            self._kind = kind
            self._show(status, silence_s if is_silent else None)

    def set_safety(self, safety: SafetyConfig) -> None:
        """Where warnings begin, for another rig."""
        self._safety = safety

    def menu_for(self, joint: JointConfig | None) -> QMenu:
        """What can be done, with one servo (None: with all)."""
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        free = self._reachable and not self._armed
        if joint is not None:
            restart = menu.addAction(
                tr("Restart servo {id} ({joint})", id=joint.id, joint=_plain(joint.name)), partial(self._ask_restart, joint)
            )
            zero = menu.addAction(tr("Zero {joint}", joint=_plain(joint.name)), partial(self._ask_zero, joint.name))
            restart.setEnabled(free)
            zero.setEnabled(free)
            menu.addSeparator()
        menu.addAction(tr("Zero all joints"), partial(self._ask_zero, None)).setEnabled(free)
        menu.addAction(tr("Switch all torque off"), self._ask_torque_off).setEnabled(self._reachable)
        return menu

    # ---- composition

    def _make_button(self, text: str, slot: Callable[[], None]) -> QPushButton:
        button = QPushButton(text)
        button.setStyleSheet(BUTTON_STYLE)
        button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        button.clicked.connect(lambda _checked=False: slot())
        return button

    def _lay_out(self) -> None:
        buttons = QWidget()
        row = QHBoxLayout(buttons)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(6)
        for button in (self._restart_button, self._zero_button, self._off_button):
            row.addWidget(button)
        row.addStretch(1)
        strip = QWidget()
        strip.setFixedHeight(24)
        self._strip = QStackedLayout(strip)
        self._strip.addWidget(buttons)
        self._strip.addWidget(self._question)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addWidget(self._table, 1)
        column.addWidget(self._balance)
        column.addWidget(self._bus)
        column.addWidget(strip)

    # ---- showing

    def _show(self, status: BusStatus | None, silence_s: float | None) -> None:
        believed = status if silence_s is None else None
        self._model.show_rows(servo_rows(believed, self._servos, self._safety))
        self._balance.show_pairs(pair_balances(believed, self._servos))
        self._show_line(bus_line(status, silence_s))
        armed, reachable = believed is not None and believed.armed, believed is not None
        if (armed, reachable) != (self._armed, self._reachable) or status is None:
            self._armed, self._reachable = armed, reachable
            self._offer()

    def _show_line(self, line: Cell) -> None:
        if line.text != self._bus.text():
            self._bus.setText(line.text)
            self._bus.setToolTip(line.tip)
            theme.set_sheet(self._bus, f"color: @{_LINE_ROLE[line.tone]}; font-size: 12px;")

    def _offer(self) -> None:
        free = self._reachable and not self._armed
        why = "" if free else tr("press STOP or Torque off first") if self._armed else tr("the servo bus is not open")
        self._restart_button.setEnabled(free)
        self._zero_button.setEnabled(free)
        self._off_button.setEnabled(self._reachable)
        self._restart_button.setToolTip(why or tr("Restart one servo, which clears its error; its joint must be zeroed again"))
        self._zero_button.setToolTip(why or tr("The present positions become 0 mm; the wires must be slack"))
        self._off_button.setToolTip(
            tr("Let all motors go, which releases the wires' tension; not while armed") if self._reachable else why
        )
        self._question.cancel()  # it was asked under other circumstances

    # ---- asking

    def _open_context_menu(self, at: QPoint) -> None:
        place = self._table.indexAt(at).row()
        self.menu_for(self._servos.joints[place] if place >= 0 else None).popup(self._table.viewport().mapToGlobal(at))

    def _open_restart_menu(self) -> None:
        joints: list[Entry] = [
            (f"{joint.id}  {_plain(joint.name)}", partial(self._ask_restart, joint)) for joint in self._servos.joints
        ]
        self._open_menu(self._restart_button, joints)

    def _open_zero_menu(self) -> None:
        joints: list[Entry] = [(_plain(joint.name), partial(self._ask_zero, joint.name)) for joint in self._servos.joints]
        self._open_menu(self._zero_button, [(tr("All joints"), partial(self._ask_zero, None)), *joints])

    def _open_menu(self, button: QPushButton, entries: list[Entry]) -> None:
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        for text, slot in entries:
            menu.addAction(text, slot)
        menu.popup(button.mapToGlobal(QPoint(0, -menu.sizeHint().height())))

    def _ask_restart(self, joint: JointConfig) -> None:
        question = tr("Restart servo {id} ({joint})? It must be zeroed again.", id=joint.id, joint=_plain(joint.name))
        self._ask(self._restart_button, question, tr("Restart"), partial(self.reboot_asked.emit, joint.id))

    def _ask_zero(self, name: JointName | None) -> None:
        what = (
            tr("All joints become 0 mm here") if name is None else tr("{joint} becomes 0 mm here", joint=_plain(name).capitalize())
        )
        names = None if name is None else [name]
        self._ask(
            self._zero_button, tr("Are the wires slack? {what}.", what=what), tr("Zero"), partial(self.zero_asked.emit, names)
        )

    def _ask_torque_off(self) -> None:
        self._ask(self._off_button, tr("All motors let go and the wires hang loose."), tr("Torque off"), self.torque_off_asked.emit)

    def _ask(self, button: QWidget, question: str, answer: str, action: Callable[[], None]) -> None:
        self._asked_by = button
        self._strip.setCurrentIndex(1)
        self._question.ask(question, answer, action)

    @Slot()
    def _on_answered(self) -> None:
        had_focus = self._question.isAncestorOf(self.focusWidget()) if self.focusWidget() is not None else False
        self._strip.setCurrentIndex(0)
        if had_focus:
            self._asked_by.setFocus()

    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._question.cancel()


def _plain(name: str) -> str:
    return tr_text(name).replace("_", " ")
