"""The pages on which the servos are found, and told apart.

The pages on which the wires are zeroed, and the steering is learnt.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QHBoxLayout, QHeaderView, QLabel, QTableWidget

from app.rig_wizard.model import RigWizardModel
from app.rig_wizard.pages_base import Arrow, Shape, WizardPage, WizardPicture, button, fit, note, put, table, tell
from app.ui.i18n import mark, tr, tr_text
from app.widgets.painting import NONE
from core.calibration.servos import Assignment
from core.config.safety import JOINT_NAMES, TENDONS, JointName, ServosConfig
from core.devices import UserError
from hardware.calibration.rig_draft import RigDraft
from hardware.rig import with_port
from hardware.servos.discovery import find_ports

_JOINT_TEXT: dict[JointName, str] = {
    "right": mark("tendon right"),
    "left": mark("tendon left"),
    "up": mark("tendon up"),
    "down": mark("tendon down"),
    "advance": mark("robot forward"),
    "delivery_1": mark("catheter, first"),
    "delivery_2": mark("catheter, second"),
}
_UP_OR_DOWN = mark(
    "One camera cannot tell up from down. Choose tendon up, wiggle it and look from the side: does the head rise when the wire is "
    "pulled? Without an answer the order of their ids counts, and the rig file says that it is assumed."
)
_MODEL_NAMES = {
    1000: "XH430-W350", 1010: "XH430-W210", 1020: "XM430-W350", 1030: "XM430-W210", 1040: "XH430-V350", 1050: "XH430-V210",
    1060: "XL430-W250", 1070: "XC430-W150", 1080: "XC430-W240", 1120: "XM540-W270", 1130: "XM540-W150",
}  # fmt: skip
"""As printed on the servo (Robotis e-Manual), by the number that it tells."""
_ID_PX, _DIRECTION_PX = 66, 80
_DIRECTIONS = (("+", 1), ("\N{MINUS SIGN}", -1))


class PortPage(WizardPage):
    """Which port the servos hang on, and who answers there."""

    name = mark("Port and servos")
    hint = mark(
        "Which port are the seven servos connected to? Switch their 12 V supply on. Searching asks every servo on the line for its "
        "number and model; nothing moves. Without servos the rig only looks."
    )

    def __init__(self, desk: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(desk, picture)
        self.ports = QComboBox()
        self.ports.setAccessibleName(tr("Servo port"))
        self.search_button = button(tr("&Search"), self._search)
        row = QHBoxLayout()
        row.addWidget(QLabel(tr("Port")))
        row.addWidget(self.ports, 1)
        row.addWidget(self.search_button)
        self.column.addLayout(row)
        self.servos = table((tr("ID"), tr("Model")), 0, tr("Servos found"))
        self.main = self.search_button
        self.column.addWidget(self.servos, 1)
        self.result = note("")
        self.column.addWidget(self.result)

    @property
    def is_done(self) -> bool:
        return self.desk.draft is not None and self.desk.draft.found is not None

    def enter(self) -> None:
        # Another bench may have been opened since, or an adapter plugged in.
        chosen = self.ports.currentData()
        self.ports.clear()
        self._fill_ports()
        if chosen is not None and (place := self.ports.findData(chosen)) >= 0:
            self.ports.setCurrentIndex(place)
        self.refresh()

    def _fill_ports(self) -> None:
        bench = self.desk.bench
        if bench is not None and bench.config.rig.camera == "twin":
            self.ports.addItem(tr("the twin's own servos"), bench.port)
            return
        for port in find_ports():
            self.ports.addItem(f"{port.title} ({port.path})", port.path)
        known = bench.port if bench is not None else None
        if known is not None and self.ports.findData(known) < 0:
            self.ports.insertItem(0, known, known)
        self.ports.addItem(tr("no servos: look only"), None)
        self.ports.setCurrentIndex(max(0, self.ports.findData(known)))

    def refresh(self) -> None:
        draft = self.desk.draft
        for control in (self.ports, self.search_button):
            control.setEnabled(draft is not None and not self.desk.is_busy)
        found = draft.found if draft is not None else None
        servos = found.servos if found is not None else ()
        self.servos.setRowCount(len(servos))
        for row, servo in enumerate(servos):
            put(self.servos, row, 0, str(servo.id))
            name = _MODEL_NAMES.get(servo.model)
            put(self.servos, row, 1, f"{name}  ({servo.model})" if name is not None else str(servo.model))
        tell(self.result, "" if found is None else tr("{count} servos at {baud} baud.", count=len(servos), baud=found.baud))

    def _search(self) -> None:
        draft, bench = self.desk.draft, self.desk.bench
        if draft is None or bench is None:
            return
        port = self.ports.currentData()
        if bench.config.rig.camera != "twin":
            draft.config = with_port(draft.config, port)
            bench.port = port
        if port is None:
            draft.found = None
            self.desk.said.emit(tr("a rig without servos: the pages about servos have nothing to do"))
            self.desk.changed.emit()
            return
        self.desk.run(tr("searching the servos"), draft.search_servos)


class IdentifyPage(WizardPage):
    """Who is who, and which way is forward: by itself, or by hand."""

    name = mark("Wiggle and direction")
    hint = mark(
        "Each servo is turned by 0.75 mm both ways, and farther (3 mm at most) where nothing is seen. Hands off the wires. The "
        "robot's head must be in the picture, with room on both sides. STOP (Space) ends it at any moment. By hand: wiggle one, "
        "watch, and say what it is."
    )
    needs_servos = True

    def __init__(self, desk: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(desk, picture)
        self.rows = table((tr("Joint"), tr("ID"), tr("Direction"), tr("Seen")), len(JOINT_NAMES), tr("Joints and their servos"))
        self.rows.verticalHeader().setDefaultSectionSize(30)
        self._ids: list[QComboBox] = []
        self._signs: list[QComboBox] = []
        self._fill(self.rows)
        for place, width in ((1, _ID_PX), (2, _DIRECTION_PX)):
            self.rows.horizontalHeader().setSectionResizeMode(place, QHeaderView.ResizeMode.Fixed)
            self.rows.setColumnWidth(place, width)
        fit(self.rows)
        self.column.addWidget(self.rows)
        self.auto_button = button(tr("&Find automatically"), self._identify)
        self.main = self.auto_button
        self.wiggle_button = button(
            tr("&Wiggle the chosen"), self._wiggle, tr("Turn the servo of the chosen row both ways by 1.5 mm")
        )
        self.swap_button = button(tr("Swap &up and down"), self._swap, tr("One camera cannot tell them apart"))
        self.right_button = button(tr("&Yes, it rises"), self._confirm, tr("Up and down are right as they stand in the table"))
        for parts in ((self.auto_button,), (self.wiggle_button, self.swap_button, self.right_button)):
            row = QHBoxLayout()
            for part in parts:
                row.addWidget(part)
            self.column.addLayout(row)
        self.result = note("")
        self.column.addWidget(self.result)
        self.column.addStretch(1)
        self._shown: tuple[Assignment, ...] | None = None
        self._known_ids: tuple[int, ...] = ()
        self._draft: RigDraft | None = None

    @property
    def is_done(self) -> bool:
        return self.desk.draft is not None and bool(self.desk.draft.assignments)

    def _fill(self, rows: QTableWidget) -> None:
        for row, name in enumerate(JOINT_NAMES):
            put(rows, row, 0, tr(_JOINT_TEXT[name]))
            ids, signs = QComboBox(), QComboBox()
            ids.setAccessibleName(tr("Servo of {joint}", joint=tr(_JOINT_TEXT[name])))
            signs.setAccessibleName(tr("Direction of {joint}", joint=tr(_JOINT_TEXT[name])))
            signs.setToolTip(
                tr("Which way the servo turns to pull the wire, or to go forward: + as it counts, \N{MINUS SIGN} against it")
            )
            ids.setToolTip(tr("Number of the servo on the bus"))
            for text, sign in _DIRECTIONS:
                signs.addItem(text, sign)
            for control in (ids, signs):
                control.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
                control.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
                control.setMinimumContentsLength(2)
                control.activated.connect(lambda _index: self._by_hand())
            self._ids.append(ids)
            self._signs.append(signs)
            rows.setCellWidget(row, 1, ids)
            rows.setCellWidget(row, 2, signs)
            put(rows, row, 3, "")
        rows.setCurrentCell(0, 0)

    def refresh(self) -> None:
        draft = self.desk.draft
        found = draft.found if draft is not None else None
        free = found is not None and not self.desk.is_busy
        for control in (self.auto_button, self.wiggle_button, self.swap_button, *self._ids, *self._signs):
            control.setEnabled(free)
        assumed = draft is not None and any(one.assumed for one in draft.assignments)
        self.right_button.setVisible(assumed)
        self.right_button.setEnabled(free)
        if draft is None or found is None:
            tell(self.result, tr("Search the servos first."))
            return
        if (self._known_ids, self._draft) != (found.ids, draft):
            self._known_ids, self._draft, self._shown = found.ids, draft, ()
            joints = draft.config.servos.joints
            spare = [servo_id for servo_id in found.ids if servo_id not in {joint.id for joint in joints}]
            for row, (ids, joint) in enumerate(zip(self._ids, joints, strict=True)):
                ids.clear()
                for servo_id in found.ids:
                    ids.addItem(str(servo_id), servo_id)
                first = joint.id if joint.id in found.ids or not spare else spare.pop(0)
                ids.setCurrentIndex(max(0, ids.findData(first)))
                self._signs[row].setCurrentIndex(self._signs[row].findData(joint.sign))
                put(self.rows, row, 3, "")
        if draft.assignments != self._shown:
            self._show(draft.assignments)
        text = _UP_OR_DOWN if assumed else ""
        tell(
            self.result,
            text or ("" if self.is_done else tr("Not told apart yet; what stands in the table is the configuration's.")),
        )

    def _show(self, assignments: Sequence[Assignment]) -> None:
        self._shown = tuple(assignments)
        for row, one in enumerate(assignments):
            self._ids[row].setCurrentIndex(self._ids[row].findData(one.id))
            self._signs[row].setCurrentIndex(self._signs[row].findData(one.sign))
            put(self.rows, row, 3, tr_text(one.seen) + (tr(" (assumed)") if one.assumed else ""))

    def _identify(self) -> None:
        if self.desk.draft is not None:
            self.desk.run(tr("telling the servos apart"), self.desk.draft.identify)

    def _wiggle(self) -> None:
        draft, row = self.desk.draft, self.rows.currentRow()
        if draft is not None and row >= 0:
            servo_id = int(self._ids[row].currentData())
            self.desk.run(tr("wiggling servo {servo_id}", servo_id=servo_id), lambda: draft.wiggle(servo_id))

    def _swap(self) -> None:
        up, down = JOINT_NAMES.index("up"), JOINT_NAMES.index("down")
        for boxes in (self._ids, self._signs):
            first, second = boxes[up].currentIndex(), boxes[down].currentIndex()
            boxes[up].setCurrentIndex(second)
            boxes[down].setCurrentIndex(first)
        self._by_hand(mark("swapped by hand"), ("up", "down"))

    def _confirm(self) -> None:
        if self.desk.draft is not None:
            self.desk.draft.confirm()
            self.desk.changed.emit()

    def _by_hand(self, seen: str = mark("set by hand"), changed: Sequence[str] | None = None) -> None:
        """Take over what stands in the table."""
        draft = self.desk.draft
        if draft is None:
            return
        before = {one.name: one for one in draft.assignments}
        if not before:  # as the rig's file has it: what was assumed there nobody has confirmed by touching another row
            earlier = draft.assumed
            kept = (Assignment(one.name, one.id, one.sign, mark("set by hand"), one.name in earlier) for one in draft.servos.joints)
            before = {one.name: one for one in kept}
        made = []
        for row, name in enumerate(JOINT_NAMES):
            servo_id, sign = int(self._ids[row].currentData()), self._signs[row].currentData()
            old = before.get(name)
            is_same = old is not None and (old.id, old.sign) == (servo_id, sign) and name not in (changed or ())
            made.append(old if is_same and old is not None else Assignment(name, servo_id, sign, seen))
        try:
            draft.set_assignments(made)
        except UserError as error:
            self.desk.failed.emit(str(error))
        self.desk.changed.emit()


_NUDGE_MM = 0.1
_ARROW_PX = 70.0
_SAME_DEG = 20.0
"""Tendons that pull so nearly the same way share an arrow."""


class ZeroPage(WizardPage):
    """Where each wire just becomes taut."""

    name = mark("Zero and pretension")
    hint = mark(
        "Each wire is loosened by 1.25 mm and then pulled in steps of 0.25 mm until the head follows, 4 mm and 300 mA at most; "
        "there it is left, taut and without tension: zero. A wire that the camera cannot judge is set by eye: choose it, and "
        "tighten or loosen it."
    )
    needs_servos = True

    def __init__(self, desk: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(desk, picture)
        self.find_button = button(tr("&Find automatically"), self._find)
        self.tendon = QComboBox()
        self.tendon.addItems([tr("tendon {name}", name=tr_text(name)) for name in TENDONS])
        self.tendon.setAccessibleName(tr("Tendon to set by eye"))
        self.tighten = button(tr("&Tighten {step:g} mm", step=_NUDGE_MM), lambda: self._nudge(_NUDGE_MM))
        self.loosen = button(tr("&Loosen {step:g} mm", step=_NUDGE_MM), lambda: self._nudge(-_NUDGE_MM))
        self.pretension = QDoubleSpinBox()
        self.pretension.setSingleStep(0.05)
        self.pretension.setSuffix(" mm")
        self.pretension.setAccessibleName(tr("Pretension"))
        self.pretension.setToolTip(tr("Pull of every wire while the robot is straight, so that none hangs"))
        self.pretension.valueChanged.connect(self._set_pretension)
        self.rows = table((tr("Tendon"), tr("Was slack by")), len(TENDONS), tr("Slack of the tendons"))
        for row, name in enumerate(TENDONS):
            put(self.rows, row, 0, tr_text(name))
        fit(self.rows)
        self.main = self.find_button
        self.column.addWidget(self.find_button)
        self.column.addWidget(self.rows)
        for parts in ((self.tendon, self.tighten, self.loosen), (QLabel(tr("Pretension")), self.pretension)):
            row_of = QHBoxLayout()
            for part in parts:
                row_of.addWidget(part)
            row_of.addStretch(1)
            self.column.addLayout(row_of)
        self.result = note("")
        self.column.addWidget(self.result)
        self.column.addStretch(1)

    @property
    def is_done(self) -> bool:
        return self.desk.draft is not None and self.desk.draft.are_zeros_known

    def refresh(self) -> None:
        draft = self.desk.draft
        ready = draft is not None and draft.found is not None and not self.desk.is_busy
        for control in (self.find_button, self.tendon, self.tighten, self.loosen, self.pretension):
            control.setEnabled(ready)
        if draft is not None:
            self._show_pretension(draft.config.servos)
        zeros = draft.zeros if draft is not None else None
        for row in range(len(TENDONS)):
            put(self.rows, row, 1, NONE if zeros is None else f"{zeros.slack_mm[row]:+.2f} mm")
        if draft is None or draft.found is None:
            tell(self.result, tr("Search the servos first."))
        elif not draft.assignments:
            tell(self.result, tr("The servos were not told apart: the configuration's ids and directions are used."))
        else:
            tell(self.result, "\n".join(tr_text(problem) for problem in zeros.problems) if zeros is not None else "")

    def _find(self) -> None:
        if self.desk.draft is not None:
            self.desk.run(tr("looking where the wires are taut"), self.desk.draft.find_zeros)

    def _nudge(self, way_mm: float) -> None:
        draft = self.desk.draft
        if draft is not None:
            name = TENDONS[self.tendon.currentIndex()]
            self.desk.run(tr("moving tendon {name}", name=tr_text(name)), lambda: draft.nudge(name, way_mm))

    def _show_pretension(self, servos: ServosConfig) -> None:
        """As it is, within what every wire's envelope allows."""
        with QSignalBlocker(self.pretension):
            tendons = servos.joints[: len(TENDONS)]
            self.pretension.setRange(max(0.0, *(one.low_mm for one in tendons)), min(5.0, *(one.high_mm for one in tendons)))
            self.pretension.setValue(servos.pretension_mm)

    def _set_pretension(self, pretension_mm: float) -> None:
        if self.desk.draft is not None and not self.desk.is_busy:
            self.desk.draft.set_pretension(pretension_mm)


class SteeringPage(WizardPage):
    """Which way the head goes when a tendon pulls."""

    name = mark("Steering")
    hint = mark(
        "The joints are zeroed where they stand. Then each tendon pulls, 0.3 mm at first and 1.2 mm at most, until the head has "
        "shown its way. The robot must have room on both sides."
    )
    needs_servos = True

    def __init__(self, desk: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(desk, picture)
        self.learn_button = button(tr("&Learn"), self._learn)
        self.rows = table(
            (tr("Tendon"), tr("Direction of the head"), tr("Way per mm of wire")), len(TENDONS), tr("Steering directions")
        )
        for row, name in enumerate(TENDONS):
            for column, text in enumerate((tr_text(name), NONE, NONE)):
                put(self.rows, row, column, text)
        self.result = note("")
        fit(self.rows)
        self.main = self.learn_button
        self.column.addWidget(self.learn_button)
        self.column.addWidget(self.rows)
        self.column.addWidget(self.result)
        self.column.addStretch(1)

    @property
    def is_done(self) -> bool:
        return self.desk.draft is not None and self.desk.draft.steering is not None

    def refresh(self) -> None:
        draft = self.desk.draft
        self.learn_button.setEnabled(draft is not None and draft.found is not None and not self.desk.is_busy)
        steering = draft.steering if draft is not None else None
        if steering is None:
            tell(self.result, "" if draft is not None and draft.found is not None else tr("Search the servos first."))
            return
        for row, tendon in enumerate(steering.tendons):
            direction = tr("out of the picture") if tendon.direction_deg is None else f"{tendon.direction_deg:.0f}°"
            put(self.rows, row, 1, direction)
            put(self.rows, row, 2, f"{tendon.px_per_mm:.1f} px/mm")
        lines = [tr("Directions in the picture: 0° to the right, 90° down.")]
        if abs(steering.roll_deg) > 10.0:
            turn = -steering.roll_deg
            lines.append(
                tr(
                    "The robot is rolled by {roll:+.0f}°: turn it by {turn:+.0f}° in its holder, and learn again.",
                    roll=steering.roll_deg,
                    turn=turn,
                )
            )
        if steering.disagreement_deg > 8.0:
            lines.append(
                tr("Way and heading disagree by {angle:.0f}°: does the head lie against a wall?", angle=steering.disagreement_deg)
            )
        tell(self.result, "\n".join(lines))

    def shapes(self) -> Sequence[Shape]:
        draft = self.desk.draft
        head = draft.head_px if draft is not None else None
        if draft is None or draft.steering is None or head is None:
            return ()
        named: dict[int, list[str]] = {}
        for tendon in draft.steering.tendons:
            if tendon.direction_deg is not None:
                named.setdefault(round(tendon.direction_deg / _SAME_DEG), []).append(tendon.name)
        arrows = []
        for names in named.values():
            angle = math.radians(next(t.direction_deg or 0.0 for t in draft.steering.tendons if t.name == names[0]))
            end = head[0] + _ARROW_PX * math.cos(angle), head[1] + _ARROW_PX * math.sin(angle)
            arrows.append(Arrow(head, end, ", ".join(names)))
        return arrows

    def _learn(self) -> None:
        if self.desk.draft is not None:
            self.desk.run(tr("learning the steering"), self.desk.draft.learn_steering)
