"""The pages on which the wires are zeroed, and the steering is learnt."""

from __future__ import annotations

import math
from collections.abc import Sequence

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QHBoxLayout, QLabel

from app.cells import NONE
from app.language import mark, tr, tr_text
from app.widgets.wizard_page import WizardPage, button, fit, note, put, table, tell
from app.widgets.wizard_picture import Arrow, Shape, WizardPicture
from app.wizard_desk import WizardDesk
from core.servo_config import TENDONS, ServosConfig

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

    def __init__(self, desk: WizardDesk, picture: WizardPicture) -> None:
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

    def __init__(self, desk: WizardDesk, picture: WizardPicture) -> None:
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
