"""Last page of the rig wizard: what was found, what was left out, and what to keep in mind."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QFrame, QPlainTextEdit

from app.language import mark, tr, tr_text
from app.rig_command import calibration_lines, describe
from app.widgets.wizard_page import WizardPage
from app.widgets.wizard_picture import WizardPicture
from app.wizard_desk import WizardDesk
from core.rig_file import RigFile, RigFileError


class SummaryPage(WizardPage):
    """Shows the rig as it will be saved; ``rig_name`` tells its name."""

    name = mark("Save")
    hint = mark("This is what will be saved. A step that was left out can be done later: menu Rig, Calibrate.")

    def __init__(self, desk: WizardDesk, picture: WizardPicture, rig_name: Callable[[], str]) -> None:
        super().__init__(desk, picture)
        self._rig_name = rig_name
        self.text = QPlainTextEdit()
        self.text.setReadOnly(True)
        self.text.setFrameShape(QFrame.Shape.NoFrame)
        self.text.setAccessibleName(tr("The rig as it will be saved"))
        self.text.setTabChangesFocus(True)
        self.column.addWidget(self.text, 1)

    def rig(self) -> RigFile | None:
        """The rig; None before a camera is open. Raises RigFileError."""
        draft = self.desk.draft
        return draft.rig_file(self._rig_name()) if draft is not None else None

    @property
    def is_done(self) -> bool:
        return False

    def refresh(self) -> None:
        try:
            rig = self.rig()
        except RigFileError as error:
            self.text.setPlainText(str(error))
            return
        draft = self.desk.draft
        if rig is None or draft is None:
            return
        lines = [
            f"{rig.name}: {describe(rig)}",
            "",
            *calibration_lines(rig),
            "",
            *dict.fromkeys(tr_text(line) for line in draft.notes),
        ]
        if rig.robot != "none":
            lines.append(tr("Zero is lost whenever the servos are switched off: zero them again then, with slack wires."))
        self.text.setPlainText("\n".join(lines))
