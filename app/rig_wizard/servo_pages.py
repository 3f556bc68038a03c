"""The servo pages of the rig wizard: find the servos, identify them, zero the wires, learn the steering."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QGridLayout, QHeaderView, QLabel, QWidget

from app.rig_wizard.model import RigWizardModel
from app.rig_wizard.pages_base import Arrow, Shape, WizardPage, WizardPicture, note, set_cell, set_note, set_rows, table
from app.ui.i18n import mark, tr, tr_text
from app.ui.texts import friction_note
from app.widgets.basics import button, enable
from app.widgets.painting import NONE
from core.calibration.servos import Assignment, alike
from core.config.calibration import DrumsConfig
from core.config.safety import JointConfig, JointKind, JointName
from core.config.servo_models import model_name
from core.devices import UserError
from hardware.calibration.rig_draft import RigDraft
from hardware.rig import RigKind, with_port
from hardware.servos.discovery import FASTER_BUS, find_ports, slow_bus

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
    "One camera cannot tell up from down. Choose {joint}, wiggle it and look from the side: does the head rise when the wire is "
    "pulled? Without an answer the order of their ids counts, and the rig file says that it is assumed."
)
_WHICH_WAY_ROUND = mark(
    "Nothing shows which way the shaft turns: wiggle it. With + its right side goes towards the camera. With tendons "
    "up and down a wrong direction shows when the steering is learnt, and the other one is taken."
)


def tendon_text(joint: JointConfig) -> str:
    """A tendon in a table of tendons."""
    return tr_text(joint.name) if joint.name in _JOINT_TEXT else joint_text(joint)


def joint_text(joint: JointConfig) -> str:
    """A joint in words; of a robot of another shape its name, and a tendon's direction."""
    if joint.name in _JOINT_TEXT:
        return tr(_JOINT_TEXT[joint.name])
    text = tr("rotation") if joint.kind is JointKind.ROTATION else joint.name.replace("_", " ")
    return text if joint.angle_deg is None else f"{text} ({joint.angle_deg:g}°)"


_ID_PX, _DIRECTION_PX, _WAY_PX = 66, 80, 116
_DIRECTIONS = (("+", 1), ("\N{MINUS SIGN}", -1))


class PortPage(WizardPage):
    """Which port the servos are connected to, and which of them answer."""

    name = mark("Port and servos")
    hint = mark(
        "Which port are the servos connected to? Switch their 12 V supply on. Searching asks every servo on the line for its "
        "number and model; nothing moves. Without servos the rig only looks."
    )

    def __init__(self, model: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(model, picture)
        self.ports = QComboBox()
        self.ports.setAccessibleName(tr("Servo port"))
        self.main = self.search_button = button(tr("&Search"), self._search)
        self.add_row(QLabel(tr("Port")), self.ports, self.search_button, stretched=self.ports, fill=True)
        self.servos = table((tr("ID"), tr("Model")), (), tr("Servos found"), fitted=False)
        self.result = note("")
        self.add((self.servos, 1), self.result)

    @property
    def is_done(self) -> bool:
        return self.draft is not None and self.draft.found is not None

    def enter(self) -> None:
        """List the ports: another bench may have been opened since, or an adapter plugged in."""
        chosen = self.ports.currentData()
        self.ports.clear()
        self._list_ports()
        if chosen is not None and (place := self.ports.findData(chosen)) >= 0:
            self.ports.setCurrentIndex(place)
        self.refresh()

    def _list_ports(self) -> None:
        bench = self.model.bench
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
        draft = self.draft
        enable(draft is not None and not self.model.is_busy, self.ports, self.search_button)
        found = draft.found if draft is not None else None
        servos = found.servos if found is not None else ()
        self.servos.setRowCount(len(servos))
        for row, servo in enumerate(servos):
            set_cell(self.servos, row, 0, str(servo.id))
            set_cell(self.servos, row, 1, model_name(servo.model))
        text = "" if found is None else tr("{count} servos at {baud} baud.", count=len(servos), baud=found.baud)
        if draft is not None and found is not None and (slow := slow_bus(found.baud, draft.config.servos.bus_hz)):
            text += " " + tr("Slow: {what}; {fix}.", what=tr_text(slow), fix=tr(FASTER_BUS))
        set_note(self.result, text)

    def _search(self) -> None:
        draft, bench = self.draft, self.model.bench
        if draft is None or bench is None:
            return
        port = self.ports.currentData()
        if bench.config.rig.camera != "twin":
            draft.config = with_port(draft.config, port)
            bench.port = port
        if port is None:
            draft.found = None
            self.model.message.emit(tr("a rig without servos: the pages about servos have nothing to do"))
            self.model.changed.emit()
            return
        self.model.run(tr("searching the servos"), draft.search_servos)


class DrumsPage(WizardPage):
    """How far one turn of a servo moves its joint, by the diameter of what it turns: asked before anything moves."""

    name = mark("Drums")
    hint = mark(
        "Measure with a caliper what the servos turn: the drums of the wires, with the wire on them, and the wheels of feed and "
        "delivery. Ways, speeds and the greatest force of each joint follow from it. Of a lead screw enter its way per turn."
    )

    def __init__(self, model: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(model, picture)
        self.diameters: list[QDoubleSpinBox] = []
        self.ways: list[QDoubleSpinBox] = []
        self._cells: list[tuple[QWidget, ...]] = []
        grid = QGridLayout()
        grid.setHorizontalSpacing(5)
        for title in (mark("Tendons"), mark("Robot forward"), mark("Catheter")):
            diameter, way = self._field(1.0), self._field(math.pi)
            diameter.setAccessibleName(tr("Diameter, {what}", what=tr(title)))
            way.setAccessibleName(tr("Way per turn, {what}", what=tr(title)))
            diameter.valueChanged.connect(lambda mm, way=way: self._set_other(way, math.pi * mm))
            way.valueChanged.connect(lambda mm, diameter=diameter: self._set_other(diameter, mm / math.pi))
            self.diameters.append(diameter)
            self.ways.append(way)
            cells = (QLabel(tr(title)), QLabel("\N{DIAMETER SIGN}"), diameter, QLabel(tr("way per turn")), way)
            self._cells.append(cells)
            for place, cell in enumerate(cells):
                grid.addWidget(cell, len(self.ways), place)
        self.result = note("")
        self.add(grid, self.result, None)

    def _field(self, per_mm: float) -> QDoubleSpinBox:
        field = QDoubleSpinBox(decimals=3)
        field.setButtonSymbols(QDoubleSpinBox.ButtonSymbols.NoButtons)  # they would cut the unit
        field.setRange(0.0, per_mm * 150.0)
        field.setSingleStep(0.1)
        field.setSuffix(" mm")
        field.setSpecialValueText(tr("not measured"))
        field.setKeyboardTracking(False)
        field.setMinimumWidth(_WAY_PX)
        return field

    @property
    def is_done(self) -> bool:
        draft, bench = self.draft, self.model.bench
        return draft is not None and (draft.drums is not None or (bench is not None and bench.kind is RigKind.SIM))

    def enter(self) -> None:
        firsts = self._firsts()
        for cells, joint, diameter, way in zip(self._cells, firsts, self.diameters, self.ways, strict=True):
            for cell in cells:
                cell.setVisible(joint is not None or not any(firsts))
            if joint is not None and self.is_done:
                self._show(diameter, joint.mm_per_turn / math.pi)
                self._show(way, joint.mm_per_turn)
        self.refresh()

    def _firsts(self) -> list[JointConfig | None]:
        """The first joint of each row's kind; None without one."""
        if self.draft is None:
            return [None] * len(self.ways)
        servos = self.draft.config.servos
        kinds = (JointKind.TENDON, JointKind.ADVANCE, JointKind.DELIVERY)
        return [next((joint for joint in servos.joints if joint.kind is kind), None) for kind in kinds]

    def refresh(self) -> None:
        draft = self.draft
        enable(draft is not None and not self.model.is_busy, *self.diameters, *self.ways)
        if not self.is_done or draft is None:
            set_note(self.result, tr("Before all of them are known no servo is moved."))
            return
        limits = [draft.config.servos.force_limit(joint) for joint in self._firsts() if joint is not None]
        forces = " / ".join(f"{limit.force_n:.0f}" for limit in limits)
        told = tr("Greatest force, limited in the servos: {forces} N.", forces=forces)
        set_note(self.result, " ".join(filter(None, (told, friction_note(draft.config.servos)))))

    @staticmethod
    def _show(field: QDoubleSpinBox, mm: float) -> None:
        with QSignalBlocker(field):
            field.setValue(mm)

    def _set_other(self, other: QDoubleSpinBox, mm: float) -> None:
        self._show(other, mm)
        draft = self.draft
        tendons_mm, advance_mm, delivery_mm = (round(way.value() / math.pi, 3) for way in self.ways)
        if self._firsts()[2] is None:
            delivery_mm = advance_mm
        if draft is None or min(tendons_mm, advance_mm, delivery_mm) <= 0.3:
            return
        draft.set_drums(DrumsConfig(tendons_mm=tendons_mm, advance_mm=advance_mm, delivery_mm=delivery_mm))
        self.model.changed.emit()


class IdentifyPage(WizardPage):
    """Which servo moves which joint, and which way is forward: found automatically, or by hand."""

    name = mark("Wiggle and direction")
    hint = mark(
        "Each servo is turned by 0.75 mm both ways, and farther (3 mm at most) where nothing is seen. Hands off the wires. The "
        "robot's head must be in the picture, with room on both sides. STOP (Space) ends it at any moment. By hand: wiggle one, "
        "watch, and say what it is."
    )

    def __init__(self, model: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(model, picture)
        headings = tr("Joint"), tr("ID"), tr("Direction"), tr("Seen")
        self.rows = table(headings, (), tr("Joints and their servos"), row_px=30)
        self._ids: list[QComboBox] = []
        self._signs: list[QComboBox] = []
        self._list_joints(model.config.servos.joints)
        for place, width in ((1, _ID_PX), (2, _DIRECTION_PX)):
            self.rows.horizontalHeader().setSectionResizeMode(place, QHeaderView.ResizeMode.Fixed)
            self.rows.setColumnWidth(place, width)
        self.add(self.rows)
        identify = partial(self.run_step, tr("telling the servos apart"), lambda draft: draft.identify())
        self.main = self.auto_button = button(tr("&Find automatically"), identify)
        tip = tr("Turn the servo of the chosen row both ways by 1.5 mm")
        self.wiggle_button = button(tr("&Wiggle the chosen"), self._wiggle, tip)
        self.swap_button = button(tr("Swap &up and down"), self._swap, tr("One camera cannot tell them apart"))
        self.right_button = button(tr("&Yes, it is so"), self._confirm, tr("What was assumed is right as it stands in the table"))
        self.add_row(self.auto_button, fill=True)
        self.add_row(self.wiggle_button, self.swap_button, self.right_button, fill=True)
        self.result = note("")
        self.add(self.result, None)
        self._shown: tuple[Assignment, ...] | None = None
        self._known_ids: tuple[int, ...] = ()
        self._known_draft: RigDraft | None = None

    def _list_joints(self, joints: Sequence[JointConfig]) -> None:
        self._ids.clear()
        self._signs.clear()
        texts = [joint_text(joint) for joint in joints]
        set_rows(self.rows, texts)
        for row, text in enumerate(texts):
            self._add_choosers(row, text)
        self.rows.setCurrentCell(0, 0)

    def _add_choosers(self, row: int, joint: str) -> None:
        ids, signs = QComboBox(), QComboBox()
        ids.setAccessibleName(tr("Servo of {joint}", joint=joint))
        ids.setToolTip(tr("Number of the servo on the bus"))
        signs.setAccessibleName(tr("Direction of {joint}", joint=joint))
        signs.setToolTip(
            tr("Which way the servo turns to pull the wire, or to go forward: + as it counts, \N{MINUS SIGN} against it")
        )
        for text, sign in _DIRECTIONS:
            signs.addItem(text, sign)
        for column, control, kept in ((1, ids, self._ids), (2, signs, self._signs)):
            control.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
            control.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
            control.setMinimumContentsLength(2)
            control.activated.connect(lambda _index: self._set_by_hand())
            self.rows.setCellWidget(row, column, control)
            kept.append(control)
        set_cell(self.rows, row, 3, "")

    @property
    def is_done(self) -> bool:
        return self.draft is not None and bool(self.draft.assignments)

    def refresh(self) -> None:
        draft = self.draft
        enable(self.has_servos, self.auto_button, self.wiggle_button, self.swap_button, self.right_button, *self._ids, *self._signs)
        assumed = [one.name for one in draft.assignments if one.assumed] if draft is not None else []
        self.right_button.setVisible(bool(assumed))
        self.swap_button.setVisible(draft is None or bool(alike(draft.config.servos)))
        if draft is None or draft.found is None:
            set_note(self.result, tr("Search the servos first."))
            return
        if (self._known_ids, self._known_draft) != (draft.found.ids, draft):
            self._known_ids, self._known_draft, self._shown = draft.found.ids, draft, ()
            self._list_servos(draft)
        if draft.assignments != self._shown:
            self._shown = tuple(draft.assignments)
            for row, one in enumerate(draft.assignments):
                self._ids[row].setCurrentIndex(self._ids[row].findData(one.id))
                self._signs[row].setCurrentIndex(self._signs[row].findData(one.sign))
                set_cell(self.rows, row, 3, tr_text(one.seen) + (tr(" (assumed)") if one.assumed else ""))
        notes = [] if self.is_done else [tr("Not told apart yet; what stands in the table is the configuration's.")]
        for joint in draft.config.servos.joints:
            if joint.name in assumed and joint.kind is JointKind.ROTATION:
                notes.append(tr(_WHICH_WAY_ROUND))
            elif joint.name in assumed[:1]:
                notes.append(tr(_UP_OR_DOWN, joint=joint_text(joint)))
        set_note(self.result, " ".join(notes))

    def _list_servos(self, draft: RigDraft) -> None:
        """Offer the servos that were found; each joint has that of the configuration, or one that no joint has."""
        joints, found = draft.config.servos.joints, draft.found.ids if draft.found is not None else ()
        self._list_joints(joints)
        spare = [servo_id for servo_id in found if servo_id not in {joint.id for joint in joints}]
        for row, (ids, joint) in enumerate(zip(self._ids, joints, strict=True)):
            ids.clear()
            for servo_id in found:
                ids.addItem(str(servo_id), servo_id)
            first = joint.id if joint.id in found or not spare else spare.pop(0)
            ids.setCurrentIndex(max(0, ids.findData(first)))
            self._signs[row].setCurrentIndex(self._signs[row].findData(joint.sign))
            set_cell(self.rows, row, 3, "")

    def _wiggle(self) -> None:
        row = self.rows.currentRow()
        if self.draft is not None and row >= 0:
            servo_id = int(self._ids[row].currentData())
            self.run_step(tr("wiggling servo {servo_id}", servo_id=servo_id), lambda draft: draft.wiggle(servo_id))

    def _swap(self) -> None:
        if self.draft is None or len(names := alike(self.draft.config.servos)) != 2:
            return
        up, down = map(self.draft.config.servos.names.index, names)
        for boxes in (self._ids, self._signs):
            first, second = boxes[up].currentIndex(), boxes[down].currentIndex()
            boxes[up].setCurrentIndex(second)
            boxes[down].setCurrentIndex(first)
        self._set_by_hand(mark("swapped by hand"), names)

    def _confirm(self) -> None:
        if self.draft is not None:
            self.draft.confirm()
            self.model.changed.emit()

    def _set_by_hand(self, seen: str = mark("set by hand"), changed: Sequence[str] = ()) -> None:
        """Take the assignments from the table."""
        draft = self.draft
        if draft is None:
            return
        before = {one.name: one for one in draft.assignments}
        if not before:  # as in the rig's file: what was assumed there stays assumed for the rows that are not touched
            earlier, hand = draft.assumed, mark("set by hand")
            kept = (Assignment(one.name, one.id, one.sign, hand, one.name in earlier) for one in draft.servos.joints)
            before = {one.name: one for one in kept}
        made = []
        for row, name in enumerate(draft.config.servos.names):
            servo_id, sign, old = int(self._ids[row].currentData()), self._signs[row].currentData(), before.get(name)
            is_same = old is not None and (old.id, old.sign) == (servo_id, sign) and name not in changed
            made.append(old if is_same and old is not None else Assignment(name, servo_id, sign, seen))
        try:
            draft.set_assignments(made)
        except UserError as error:
            self.model.failed.emit(str(error))
        self.model.changed.emit()


_NUDGE_MM = 0.1
_ARROW_PX = 70.0
_SAME_DEG = 20.0
"""Tendons that pull so nearly the same way share an arrow."""
_LARGE_ROLL_DEG, _LARGE_DISAGREEMENT_DEG = 10.0, 8.0


class ZeroPage(WizardPage):
    """Where each wire just becomes taut."""

    name = mark("Zero and pretension")
    hint = mark(
        "Each wire is loosened by 1.25 mm and then pulled in steps of 0.25 mm until the head follows, by 4 mm and with its "
        "greatest force at most; there it is left, taut and without tension: zero. A wire that the camera cannot judge is set "
        "by eye: choose it, and tighten or loosen it."
    )

    def __init__(self, model: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(model, picture)
        find = partial(self.run_step, tr("looking where the wires are taut"), lambda draft: draft.find_zeros())
        self.main = self.find_button = button(tr("&Find automatically"), find)
        self.tendon = QComboBox()
        self.tendon.setAccessibleName(tr("Tendon to set by eye"))
        self.tighten = button(tr("&Tighten {step:g} mm", step=_NUDGE_MM), lambda: self._nudge(_NUDGE_MM))
        self.loosen = button(tr("&Loosen {step:g} mm", step=_NUDGE_MM), lambda: self._nudge(-_NUDGE_MM))
        self.pretension = QDoubleSpinBox(singleStep=0.05, suffix=" mm")
        self.pretension.setAccessibleName(tr("Pretension"))
        self.pretension.setToolTip(tr("Pull of every wire while the robot is straight, so that none hangs"))
        self.pretension.valueChanged.connect(self._set_pretension)
        self.rows = table((tr("Tendon"), tr("Was slack by")), (), tr("Slack of the tendons"))
        self._tendons: tuple[JointConfig, ...] = ()
        self.add(self.find_button, self.rows)
        self.add_row(self.tendon, self.tighten, self.loosen)
        self.add_row(QLabel(tr("Pretension")), self.pretension)
        self.result = note("")
        self.add(self.result, None)

    @property
    def is_done(self) -> bool:
        return self.draft is not None and self.draft.are_zeros_known

    def refresh(self) -> None:
        draft = self.draft
        enable(self.has_servos, self.find_button, self.tendon, self.tighten, self.loosen, self.pretension)
        tendons = (draft.config if draft is not None else self.model.config).servos.tendons
        if [one.name for one in tendons] != [one.name for one in self._tendons]:
            self._tendons = tendons
            set_rows(self.rows, [tendon_text(one) for one in tendons])
            self.tendon.clear()
            self.tendon.addItems([joint_text(one) for one in tendons])
        if draft is not None:
            with QSignalBlocker(self.pretension):  # within what the envelope of every wire allows
                low, high = max(0.0, *(one.low_mm for one in tendons)), min(5.0, *(one.high_mm for one in tendons))
                self.pretension.setRange(low, high)
                self.pretension.setValue(draft.config.servos.pretension_mm)
        zeros = draft.zeros if draft is not None else None
        for row in range(len(tendons)):
            set_cell(self.rows, row, 1, NONE if zeros is None else f"{zeros.slack_mm[row]:+.2f} mm")
        if draft is None or draft.found is None:
            set_note(self.result, tr("Search the servos first."))
        elif not draft.assignments:
            set_note(self.result, tr("The servos were not told apart: the configuration's ids and directions are used."))
        else:
            set_note(self.result, "\n".join(tr_text(problem) for problem in zeros.problems) if zeros is not None else "")

    def _nudge(self, way_mm: float) -> None:
        joint = self._tendons[self.tendon.currentIndex()]
        self.run_step(tr("moving {joint}", joint=joint_text(joint)), lambda draft: draft.nudge(joint.name, way_mm))

    def _set_pretension(self, pretension_mm: float) -> None:
        if self.draft is not None and not self.model.is_busy:
            self.draft.set_pretension(pretension_mm)


class SteeringPage(WizardPage):
    """Which way the head goes when a tendon pulls."""

    name = mark("Steering")
    hint = mark(
        "From where the page before has left the wires the tendons bend the head to each side, up and down, by 0.3 mm at first and "
        "1.2 mm at most, until it has shown its way. The robot must have room on both sides."
    )

    def __init__(self, model: RigWizardModel, picture: WizardPicture) -> None:
        super().__init__(model, picture)
        learn = partial(self.run_step, tr("learning the steering"), lambda draft: draft.learn_steering())
        self.main = self.learn_button = button(tr("&Learn"), learn)
        headings = (tr("Tendon"), tr("Direction of the head"), tr("Way per mm of wire"))
        self.rows = table(headings, (), tr("Steering directions"))
        self.result = note("")
        self.add(self.learn_button, self.rows, self.result, None)

    @property
    def is_done(self) -> bool:
        return self.draft is not None and self.draft.steering is not None

    def refresh(self) -> None:
        draft = self.draft
        self.learn_button.setEnabled(self.has_servos)
        steering = draft.steering if draft is not None else None
        tendons = (draft.config if draft is not None else self.model.config).servos.tendons
        set_rows(self.rows, [tendon_text(one) for one in tendons])
        if steering is None:
            for row in range(len(tendons)):
                for column in (1, 2):
                    set_cell(self.rows, row, column, NONE)
            set_note(self.result, "" if draft is not None and draft.found is not None else tr("Search the servos first."))
            return
        for row, tendon in enumerate(steering.tendons):
            direction = tr("out of the picture") if tendon.direction_deg is None else f"{tendon.direction_deg:.0f}°"
            set_cell(self.rows, row, 1, direction)
            set_cell(self.rows, row, 2, f"{tendon.px_per_mm:.1f} px/mm")
        lines = [tr("Directions in the picture: 0° to the right, 90° down.")]
        roll, off = steering.roll_deg, steering.disagreement_deg
        if abs(roll) > _LARGE_ROLL_DEG:
            lines.append(
                tr(
                    "The robot is rolled by {roll:+.0f}°: turn it by {turn:+.0f}° in its holder, and learn again.",
                    roll=roll,
                    turn=-roll,
                )
            )
        if off > _LARGE_DISAGREEMENT_DEG:
            lines.append(tr("Way and heading disagree by {angle:.0f}°: does the head lie against a wall?", angle=off))
        set_note(self.result, "\n".join(lines))

    def shapes(self) -> Sequence[Shape]:
        draft = self.draft
        head = draft.head_px if draft is not None else None
        if draft is None or draft.steering is None or head is None:
            return ()
        named: dict[int, list[tuple[str, float]]] = {}
        for tendon in draft.steering.tendons:
            if tendon.direction_deg is not None:
                same = named.setdefault(round(tendon.direction_deg / _SAME_DEG), [])
                same.append((tendon.name, math.radians(tendon.direction_deg)))
        arrows = []
        for tendons in named.values():
            angle = tendons[0][1]
            end = head[0] + _ARROW_PX * math.cos(angle), head[1] + _ARROW_PX * math.sin(angle)
            arrows.append(Arrow(head, end, ", ".join(name for name, _ in tendons)))
        return arrows
